"""What action models and detectors accept and refuse: people held out.

    python benchmarks/model.py DATA_FOLDER

DATA_FOLDER holds hdm05/hdm05_positions.npz and utkinect and cmu07_walk of the same form. A model
that can say no accepts what people it has not seen do (`OWN`) and refuses what is not the action
(`KINDS`): the other actions of the same people, and their own trials spoilt in six ways
(`SPOILT`), all made of points of the aSpace. Every actor is held out in turn, and everything is
learnt from the others: aSpace, synchronizer, model, border. Walking cycles are one person's, so a
take of them stands for an actor. Shares are in percent, means over actions. Prints Markdown.
"""

from itertools import product
from typing import NamedTuple

import numpy as np
from harness import P, command_line, percent, print_head, print_row, print_versions, read_archive
from joblib import Parallel, delayed
from scipy.special import ndtri
from sklearn.pipeline import make_pipeline
from sklearn_motionsync import (
    ActionDetector,
    ActionModel,
    ASpace,
    DenseSynchronizer,
    DirectionCosines,
)
from sklearn_motionsync.datasets import make_bending

NOMINAL = (0.80, 0.90, 0.95, 0.99)
# The last is that of three standard deviations.
HELD = (*NOMINAL, 0.9973)
FEW, DRAWS = (5, 10, 20), 2

# -- wrong trials -----------------------------------------------------------------


OWN, OTHERS, BACKWARDS = "own", "other actions", "backwards"
SPOILT = {
    "standing still": lambda x: np.repeat(x[:1], len(x), axis=0),
    "amplitude x 0.3": lambda x: x.mean(axis=0) + 0.3 * (x - x.mean(axis=0)),
    "first half": lambda x: x[: max(len(x) // 2, 3)],
    "twice in a row": lambda x: np.concatenate([x, x]),
    "halves exchanged": lambda x: np.roll(x, -(len(x) // 2), axis=0),
    BACKWARDS: lambda x: x[::-1].copy(),
}
KINDS = (OTHERS, *SPOILT)
# Bent down and up again is, backwards, nearly the same; and so is whatever returns as it went.
THERE_AND_BACK = ("depositFloorR", "bending", "elbowToKnee1RepsLelbowStart", "grabHighR")
THERE_AND_BACK += ("hopBothLegs1hops", "pickUp", "waveHands", "clapHands")

# -- the data sets ----------------------------------------------------------------------


class Clips(NamedTuple):
    """Poses (n_frames_i, 37) of a data set, what is done in them, and by whom."""

    name: str
    poses: list
    actions: np.ndarray
    actors: np.ndarray

    def folds(self):
        """Every action with every actor who does it."""
        return list(dict.fromkeys(zip(self.actions, self.actors, strict=True)))

    def some(self, which):
        """The poses of those that are chosen by a mask."""
        return [self.poses[i] for i in np.flatnonzero(which)]


ARCHIVES = {"hdm05": "HDM05", "utkinect": "UTKinect", "cmu07_walk": "CMU, walking cycles"}


def read_clips(folder=None):
    """The data sets: three of real people, if there is a folder of them, and make_bending."""
    archives = {} if folder is None else ARCHIVES
    sets = [as_clips(name, read_archive(folder, archive)) for archive, name in archives.items()]
    return [*sets, as_clips("make_bending", make_bending(random_state=0))]


def as_clips(name, bunch):
    poses = DirectionCosines(bunch.skeleton).fit_transform(bunch.data)
    return Clips(name, list(poses), np.asarray(bunch.target), np.asarray(bunch.actor))


# -- actors held out --------------------------------------------------------------------


class Fold(NamedTuple):
    """An action, learnt from some actors and tried on another.

    ``raw`` and ``synchronised`` hold by kind what is tried, points (n_frames_i, b) of the aSpace
    and (n, P, b) on the clock of the training trials; kinds that are empty are left out.
    """

    train: list
    groups: np.ndarray
    on_clock: np.ndarray
    raw: dict
    synchronised: dict


def hold_out(clips, action, actor):
    """Everything learnt without an actor: aSpace, synchronizer; then the actor's trials."""
    does_it, is_held = clips.actions == action, clips.actors == actor
    train = np.flatnonzero(does_it & ~is_held)
    space = ASpace().fit(clips.some(does_it & ~is_held))
    raw = {OWN: _points(space, clips, does_it & is_held)}
    raw[OTHERS] = _points(space, clips, ~does_it & is_held)
    raw |= {kind: [spoil(x) for x in raw[OWN]] for kind, spoil in SPOILT.items()}
    raw = {kind: some for kind, some in raw.items() if some}
    known = _points(space, clips, does_it & ~is_held)
    synchronizer = DenseSynchronizer(P)
    on_clock = synchronizer.fit_transform(known)
    synchronised = {kind: synchronizer.transform(some) for kind, some in raw.items()}
    return Fold(known, clips.actors[train], on_clock, raw, synchronised)


def hold_out_few(clips, action, actor, n_trials, rng):
    """The same from a few training trials, of two actors at least, and right ones only.

    Returns these on their clock, their groups, and the actor's own; None if there are not so many.
    """
    does_it, is_held = clips.actions == action, clips.actors == actor
    train = np.flatnonzero(does_it & ~is_held)
    if len(train) < n_trials or len(set(clips.actors[train])) < 2:
        return None
    while True:
        chosen = np.sort(rng.permutation(train)[:n_trials])
        if len(set(clips.actors[chosen])) > 1:
            break
    space = ASpace().fit([clips.poses[i] for i in chosen])
    synchronizer = DenseSynchronizer(P)
    on_clock = synchronizer.fit_transform([*space.transform([clips.poses[i] for i in chosen])])
    own = synchronizer.transform(_points(space, clips, does_it & is_held))
    return on_clock, clips.actors[chosen], own


def _points(space, clips, which):
    chosen = clips.some(which)
    return list(space.transform(chosen)) if chosen else []


# -- who judges: decisions by kind, below 0 outside -------------------------------------

MODEL, DETECTOR = "`ActionModel`", "`ActionDetector`"


def verdicts_on(fold):
    """{judge: {kind: decisions}}"""
    model = ActionModel().fit(fold.on_clock, groups=fold.groups)
    judged = {kind: model.decision_function(X) for kind, X in fold.synchronised.items()}
    verdicts = {MODEL: judged}
    for name, duration in (("`ActionDetector(duration=False)`", False), (DETECTOR, True)):
        pipe = make_pipeline(DenseSynchronizer(P), ActionModel())
        detector = ActionDetector(pipe, duration=duration).fit(fold.train, groups=fold.groups)
        verdicts[name] = {kind: detector.decision_function(X) for kind, X in fold.raw.items()}
    return verdicts


# -- what is found on a fold ------------------------------------------------------------


class Found(NamedTuple):
    """Of one action and actor.

    verdicts : {judge: {kind: decisions}}
    reached : {(training trials, groups given): accepted (n, nominal)}
    held : {band: shares of points held, and whether all (n, nominal, 2)}
    """

    action: str
    verdicts: dict
    reached: dict
    held: dict


def examine(clips, action, actor):
    """Everything that is measured on a fold."""
    fold = hold_out(clips, action, actor)
    reached = accepted_at(fold.on_clock, fold.groups, fold.synchronised[OWN], "all")
    rng = np.random.default_rng(0)
    for n in FEW:
        drawn = [hold_out_few(clips, action, actor, n, rng) for _ in range(DRAWS)]
        for known in filter(None, drawn):
            reached = joined(reached, accepted_at(*known, n))
    return Found(action, verdicts_on(fold), reached, held_by(fold))


def accepted_at(on_clock, groups, own, label):
    """Whether right trials are accepted, at every nominal share, with groups and without."""
    found = {}
    for given in (groups, None):
        models = [ActionModel(coverage=c).fit(on_clock, groups=given) for c in NOMINAL]
        accepted = np.column_stack([model.predict(own) == 1 for model in models])
        found[label, given is not None] = accepted
    return found


def held_by(fold):
    """Shares of points, and whether the whole, of right trials that bands hold."""
    bands = {
        "points": (lambda c: ActionModel(n_std=ndtri((1 + c) / 2)), False),
        "trials": (lambda c: ActionModel(coverage=c), True),
    }
    found = {}
    for band, (make, whole) in bands.items():
        models = [make(c).fit(fold.on_clock, groups=fold.groups) for c in HELD]
        found[band] = np.stack([held(model.envelope(whole), fold) for model in models], axis=1)
    return found


def held(bounds, fold):
    """(n, 2) shares of points, and whether all, of right trials within bounds."""
    own = fold.synchronised[OWN]
    inside = (own >= bounds[0]) & (own <= bounds[1])
    return np.column_stack([inside.mean(axis=(1, 2)), inside.all(axis=(1, 2))])


def joined(one, other):
    """Dicts of arrays, those under one key one after the other."""
    both = dict(one)
    for key, array in other.items():
        both[key] = np.concatenate([both[key], array]) if key in both else array
    return both


# -- figures ----------------------------------------------------------------------------


def pooled(found, judge):
    """Decisions of a judge over all actors: {action: {kind: decisions}}."""
    actions: dict = {}
    for one in found:
        actions[one.action] = joined(actions.get(one.action, {}), one.verdicts[judge])
    return actions


def accepted(actions, kind=OWN):
    """Share of a kind that every action accepts; actions without that kind are left out."""
    return {name: np.mean(by[kind] >= 0) for name, by in actions.items() if kind in by}


def mean(values):
    values = list(values)
    return np.mean(values, axis=0) if values else np.nan


def refused(actions, kind, apart=()):
    """Share of a kind that is refused, mean over actions but for some."""
    return 1 - mean(share for name, share in accepted(actions, kind).items() if name not in apart)


# -- tables -----------------------------------------------------------------------------


def verdict_tables(name, found):
    """What is accepted and refused by every judge."""
    header = ["own", "lowest action", *KINDS, f"{BACKWARDS}, one-way actions"]
    decided = {judge: pooled(found, judge) for judge in found[0].verdicts}
    print_head(f"{name}: accepted / refused", header)
    for judge, actions in decided.items():
        own = list(accepted(actions).values())
        cells = [np.mean(own), min(own), *(refused(actions, kind) for kind in KINDS)]
        cells.append(refused(actions, BACKWARDS, THERE_AND_BACK))
        print_row(judge, map(percent, cells))


def action_table(found_by_set, judge):
    """What a judge accepts and refuses, action by action."""
    print_head(f"{judge}: accepted / refused", ["trials", "own", *KINDS])
    for name, found in found_by_set.items():
        for action, by in pooled(found, judge).items():
            shares = [np.mean(by[OWN] >= 0), *(refused({action: by}, kind) for kind in KINDS)]
            print_row(f"{name}, `{action}`", [str(len(by[OWN])), *map(percent, shares)])


def border_table(found_by_set):
    """The share of right trials that is accepted, beside what was asked for."""
    print_head("accepted, nominal share", ["actions", *(f"{c:.0%}" for c in NOMINAL)])
    for name, found in found_by_set.items():
        for key in product(("all", *FEW), (True, False)):
            shares, n_actions = by_action(found, lambda one, key=key: one.reached.get(key))
            if n_actions:
                label = f"{name}, {key[0]} trials, {'groups given' if key[1] else 'no groups'}"
                print_row(label, [str(n_actions), *(percent(x, 1) for x in shares)])


def band_table(found_by_set):
    """The share of right points and whole trials that bands hold."""
    header = [f"{what}, {c:.4g}" for what in ("points", "trials") for c in HELD]
    print_head("held", header)
    for name, found in found_by_set.items():
        for band in found[0].held:
            shares, _ = by_action(found, lambda one, band=band: one.held[band])
            print_row(f'{name}, `band="{band}"`', [percent(x, 1) for x in shares.T.ravel()])


def by_action(found, rows_of):
    """Mean over actions of the means of rows, and how many actions have any."""
    actions: dict = {}
    for one in found:
        rows = rows_of(one)
        if rows is not None:
            actions.setdefault(one.action, []).extend(rows)
    return mean(np.mean(rows, axis=0) for rows in actions.values()), len(actions)


def examine_all(sets):
    """{data set: what is found on its folds}."""
    work = [(clips, *fold) for clips in sets for fold in clips.folds()]
    done = iter(Parallel(n_jobs=-1)(delayed(examine)(*one) for one in work))
    return {clips.name: [next(done) for _ in clips.folds()] for clips in sets}


def print_tables(sets):
    found_by_set = examine_all(sets)
    for name, found in found_by_set.items():
        verdict_tables(name, found)
    action_table(found_by_set, DETECTOR)
    border_table(found_by_set)
    band_table(found_by_set)


if __name__ == "__main__":
    folder = command_line(__doc__).parse_args().folder
    print_versions("scipy", "scikit-learn")
    print_tables(read_clips(folder))
