"""What action models accept and refuse: people held out, against other packages' detectors.

    pip install . dtaidistance
    python benchmarks/model.py DATA_FOLDER

DATA_FOLDER holds hdm05/hdm05_positions.npz and utkinect and cmu07_walk of the same form; without it
only the synthetic bends of make_bending are run. Every actor is held out in turn, and everything is
learnt from the others: aSpace, synchronizer, model, border. Walking cycles are one person's, so a
take of them stands for an actor. Shares are in percent, means over actions. Detectors of other
packages are shown at the best of a few settings (judges.py), chosen by the result: the largest mean
area under the curve on that data set. Prints Markdown.
"""

import sys
import time
from pathlib import Path
from typing import NamedTuple

import numpy as np
from accuracy import print_head, print_row
from events import P
from joblib import Parallel, delayed
from judges import DETECTOR, MODEL, PEERS, judges, version_of
from negatives import (
    BACKWARDS,
    BENDS,
    KINDS,
    OTHERS,
    OWN,
    SPOILT,
    THERE_AND_BACK,
    hold_out,
    hold_out_few,
    read_clips,
)
from scipy.special import ndtr, ndtri
from sklearn.metrics import roc_auc_score
from sklearn.pipeline import make_pipeline
from sklearn_motionsync import (
    ActionModel,
    ASpace,
    DenseSynchronizer,
    DirectionCosines,
    Skeleton,
    find_departures,
)
from sklearn_motionsync.datasets import load_performances

NOMINAL = (0.80, 0.90, 0.95, 0.99)
# The last is that of three standard deviations.
HELD = (*NOMINAL, 0.9973)
FEW, DRAWS = (5, 10, 20), 2
REACHED = [(n, given) for n in ("all", *FEW) for given in (True, False)]


# -- what is found on a fold ------------------------------------------------------------


class Found(NamedTuple):
    """Of one action and actor.

    verdicts : {judge: {setting: {kind: decisions}}}
    reached : {(training performances, groups given): accepted (n, nominal)}
    held : {band: shares of points held, and whether all (n, nominal, 2)}
    border : float
    reversal : dissimilarities of the right performances to themselves backwards
    """

    action: str
    verdicts: dict
    reached: dict
    held: dict
    border: float
    reversal: np.ndarray


def examine(clips, action, actor):
    """Everything that is measured on a fold."""
    fold = hold_out(clips, action, actor)
    own, groups = fold.synchronised[OWN], fold.groups
    verdicts = {name: judge(fold) for name, judge in judges().items()}
    reached = accepted_at(fold.on_clock, groups, own, "all")
    rng = np.random.default_rng(0)
    for n in FEW:
        drawn = [hold_out_few(clips, action, actor, n, rng) for _ in range(DRAWS)]
        for known in filter(None, drawn):
            reached = joined(reached, accepted_at(*known, n))
    border = ActionModel().fit(fold.on_clock, groups=groups).threshold_
    pairs = zip(own, fold.synchronised[BACKWARDS], strict=True)
    reversal = np.array([unlikeness(*pair) for pair in pairs])
    return Found(action, verdicts, reached, held_by(fold), border, reversal)


def accepted_at(on_clock, groups, own, label):
    """Whether right performances are accepted, at every nominal share, with groups and without."""
    found = {}
    for given in (groups, None):
        models = [ActionModel(coverage=c).fit(on_clock, groups=given) for c in NOMINAL]
        accepted = np.column_stack([model.predict(own) == 1 for model in models])
        found[label, given is not None] = accepted
    return found


def held_by(fold):
    """Shares of points, and whether the whole, of right performances that bands hold."""
    bands = {
        "points": (lambda c: ActionModel(n_std=ndtri((1 + c) / 2)), False),
        "performances": (lambda c: ActionModel(coverage=c), True),
    }
    found = {}
    for band, (make, whole) in bands.items():
        models = [make(c).fit(fold.on_clock, groups=fold.groups) for c in HELD]
        found[band] = np.stack([held(model.envelope(whole), fold) for model in models], axis=1)
    return found


def held(bounds, fold):
    """(n, 2) shares of points, and whether all, of right performances within bounds."""
    own = fold.synchronised[OWN]
    inside = (own >= bounds[0]) & (own <= bounds[1])
    return np.column_stack([inside.mean(axis=(1, 2)), inside.all(axis=(1, 2))])


def unlikeness(x, y):
    """How unlike two performances (P, b) are to the model: 0 equal, 1 one of them stands still."""
    both = [(z - z.mean(axis=0), np.gradient(z, axis=0)) for z in (x, y)]
    ratios = [
        np.square(a - b).sum() / (np.square(a).sum() + np.square(b).sum())
        for a, b in zip(*both, strict=True)
    ]
    return np.mean(ratios)


def joined(one, other):
    """Dicts of arrays, those under one key one after the other."""
    both = dict(one)
    for key, array in other.items():
        both[key] = np.concatenate([both[key], array]) if key in both else array
    return both


# -- figures ----------------------------------------------------------------------------


def pooled(found, judge, setting):
    """Decisions of a judge over all actors: {action: {kind: decisions}}."""
    actions: dict = {}
    for one in found:
        actions[one.action] = joined(actions.get(one.action, {}), one.verdicts[judge][setting])
    return actions


def accepted(actions, kind=OWN):
    """Share of a kind that every action accepts; actions without that kind are left out."""
    return {name: np.mean(by[kind] >= 0) for name, by in actions.items() if kind in by}


def areas(actions, kind):
    """Area under the curve of every action: right performances against those of a kind."""
    return [area(by[OWN], by[kind]) for by in actions.values() if kind in by]


def area(right, wrong):
    labels = np.repeat([1, 0], [len(right), len(wrong)])
    return roc_auc_score(labels, np.concatenate([right, wrong]))


def mean(values):
    values = list(values)
    return np.mean(values, axis=0) if values else np.nan


def mean_areas(actions):
    """Of every kind, the mean over actions; NaN where no action has that kind."""
    return np.array([mean(areas(actions, kind)) for kind in KINDS])


def best_setting(found, judge):
    """The setting with the largest mean area under the curve."""
    settings = found[0].verdicts[judge]
    return max(settings, key=lambda s: np.nanmean(mean_areas(pooled(found, judge, s))))


def refused(actions, kind, apart=()):
    """Share of a kind that is refused, mean over actions but for some."""
    return 1 - mean(share for name, share in accepted(actions, kind).items() if name not in apart)


# -- tables -----------------------------------------------------------------------------


def percent(share):
    return "-" if np.isnan(share) else f"{100 * share:.0f}"


def two_digits(value):
    return "-" if np.isnan(value) else f"{value:.2f}"


def verdict_tables(name, found):
    """What is accepted and refused, and the areas under the curves, of every judge."""
    best = {judge: best_setting(found, judge) for judge in found[0].verdicts}
    decided = {
        f"{judge}, {setting}" if setting else judge: pooled(found, judge, setting)
        for judge, setting in best.items()
    }
    header = ["own", "lowest action", *KINDS]
    header += [f"{BACKWARDS}, {some}" for some in ("without bends", "one-way actions")]
    print_head(f"{name}: accepted / refused", header)
    for label, actions in decided.items():
        own = list(accepted(actions).values())
        cells = [np.mean(own), min(own)]
        cells += [refused(actions, kind) for kind in KINDS]
        cells += [refused(actions, BACKWARDS, apart) for apart in (BENDS, THERE_AND_BACK)]
        print_row(label, map(percent, cells))
    print_head(f"{name}: area under the curve", [*KINDS, "mean"])
    areas_of = {label: mean_areas(actions) for label, actions in decided.items()}
    every = [
        mean_areas(pooled(found, judge, setting))
        for judge in PEERS.keys() & best.keys()
        for setting in found[0].verdicts[judge]
    ]
    areas_of["*the best of others' settings, every number by itself*"] = np.max(every, axis=0)
    for label, of_kinds in areas_of.items():
        print_row(label, map(two_digits, [*of_kinds, np.nanmean(of_kinds)]))


def action_table(found_by_set, judge):
    """What a judge of ours accepts and refuses, action by action."""
    header = ["trials", "own", *KINDS, "threshold", "dissimilarity to itself backwards"]
    print_head(f"{judge}: accepted / refused", header)
    for name, found in found_by_set.items():
        for action, by in pooled(found, judge, "").items():
            folds = [one for one in found if one.action == action]
            shares = [np.mean(by[OWN] >= 0), *(refused({action: by}, kind) for kind in KINDS)]
            borders = [one.border for one in folds]
            cells = [str(len(by[OWN])), *map(percent, shares)]
            cells += [f"{min(borders):.2f} to {max(borders):.2f}"]
            cells += [two_digits(np.median(np.concatenate([one.reversal for one in folds])))]
            print_row(f"{name}, `{action}`", cells)


def border_table(found_by_set):
    """The share of right performances that is accepted, beside what was asked for."""
    print_head("accepted, nominal share", ["actions", *(f"{c:.0%}" for c in NOMINAL)])
    for name, found in found_by_set.items():
        for key in REACHED:
            shares, n_actions = by_action(found, lambda one, key=key: one.reached.get(key))
            if n_actions:
                label = f"{name}, {key[0]} trials, {'groups given' if key[1] else 'no groups'}"
                print_row(label, [str(n_actions), *map(one_digit, shares)])


def band_table(found_by_set):
    """The share of right points and whole performances that bands hold."""
    header = [f"{what}, {c:.4g}" for what in ("points", "trials") for c in HELD]
    print_head("held", header)
    for name, found in found_by_set.items():
        for band in found[0].held:
            shares, _ = by_action(found, lambda one, band=band: one.held[band])
            print_row(f'{name}, `band="{band}"`', map(one_digit, shares.T.ravel()))


def by_action(found, rows_of):
    """Mean over actions of the means of rows, and how many actions have any."""
    actions: dict = {}
    for one in found:
        rows = rows_of(one)
        if rows is not None:
            actions.setdefault(one.action, []).extend(rows)
    return mean(np.mean(rows, axis=0) for rows in actions.values()), len(actions)


def one_digit(share):
    return f"{100 * share:.1f}"


# -- departures -------------------------------------------------------------------------


def departures_of(clips, action, actor):
    """How right and refused performances of an actor held out depart, in whole postures.

    {kind: (n, 3) whether it departs, whether rarely, number of departures}
    """
    does_it, is_held = clips.actions == action, clips.actors == actor
    pipe = make_pipeline(ASpace(), DenseSynchronizer(P), ActionModel())
    known = does_it & ~is_held
    pipe.fit(clips.some(known), actionmodel__groups=clips.actors[known])
    right = clips.some(does_it & is_held)
    tried = {OWN: right, OTHERS: clips.some(~does_it & is_held)}
    tried |= {kind: [spoil(x) for x in right] for kind, spoil in SPOILT.items()}
    found = {}
    for kind, some in tried.items():
        if kind != OWN and some:
            some = [x for x, verdict in zip(some, pipe.predict(some), strict=True) if verdict < 0]
        if some:
            found[kind] = counted(find_departures(pipe, some), len(some))
    return found


def counted(table, n):
    """(n, 3) of performances: any departure, any rare one, how many."""
    counts = np.bincount(table["performance"].astype(int), minlength=n)
    rare = np.bincount(table["performance"][table["rare"]].astype(int), minlength=n)
    return np.column_stack([counts > 0, rare > 0, counts])


def departure_table(sets):
    """Of right performances, accepted or not, and of those of other kinds that are refused."""
    header = ["trials", "with a departure", "with a rare one", "departures each"]
    print_head("departures of whole poses", header)
    for clips in sets:
        work = [delayed(departures_of)(clips, *fold) for fold in clips.folds()]
        found: dict = {}
        for one in Parallel(n_jobs=-1)(work):
            found = joined(found, one)
        for kind in (k for k in (OWN, *KINDS) if k in found):
            any_, rare, counts = found[kind].T
            cells = [str(len(counts)), percent(any_.mean()), percent(rare.mean())]
            which = "right" if kind == OWN else f"{kind}, refused"
            print_row(f"{clips.name}, {which}", [*cells, f"{counts.mean():.1f}"])


# -- sampled feet -----------------------------------------------------------------------

SAMPLES = 200


def feet_table(folder):
    """How far sampled bends have their feet under the floor of the mean performance."""
    bunch = load_performances(Path(folder) / "hdm05" / "hdm05_positions.npz")
    chosen = np.flatnonzero(bunch.target == BENDS[0])
    steps = (DirectionCosines(bunch.skeleton), ASpace(), DenseSynchronizer())
    pipe = make_pipeline(*steps, ActionModel())
    data, actors = [bunch.data[i] for i in chosen], bunch.actor[chosen]
    model = pipe.fit(data, actionmodel__groups=actors)[-1]
    on_clock = np.asarray(pipe[:-1].transform(data))
    ankles = [Skeleton.paper().index_of(side + "_ankle") for side in ("left", "right")]
    rng = np.random.RandomState(0)
    drawn = {
        "training trials": lambda frame: on_clock[:, frame],
        "every feature by itself": lambda frame: by_feature(model, frame, rng),
        "`sample(200, frame)`": lambda frame: model.sample(SAMPLES, frame=frame, random_state=rng),
    }
    low = ["lowest foot, cm", "lowest joint, cm"]
    deep = ["with a foot more than 10 cm under", "with any joint more than 10 cm under"]
    print_head(f"`{BENDS[0]}`, all frames", [*low, *deep])
    for label, postures in drawn.items():
        heights = np.concatenate(
            [above_floor(pipe[:2], model.mean_, postures(t)) for t in range(len(model.mean_))]
        )
        of_feet = heights[:, ankles]
        cells = [f"{100 * some.min():.0f}" for some in (of_feet, heights)]
        cells += [f"{np.mean(some.min(axis=1) < -0.1):.1%}" for some in (of_feet, heights)]
        print_row(label, cells)


def by_feature(model, frame, rng):
    """Normal distributions cut off at the envelope, each feature by itself."""
    shape = (SAMPLES, model.mean_.shape[1])
    z = ndtri(rng.uniform(ndtr(-model.n_std), ndtr(model.n_std), shape))
    return model.mean_[frame] + z * np.sqrt(model.variance_[frame])


def above_floor(space, mean_performance, postures):
    """Heights (n, 15) of joints above the lowest that the mean performance reaches, in metres.

    Postures do not tell how far the hips are below the pelvis, and bodies that are built together
    have their legs moved until the lowest ankle is on the floor: here they hang as in the mean.
    """

    def heights(points):
        return np.asarray(space.inverse_transform(points)).reshape(len(points), -1, 3)[..., 1]

    def drop(found):
        return (
            found[:, of("hip")].mean(axis=1, keepdims=True) - found[:, [paper.index_of("pelvis")]]
        )

    def of(joint):
        return [paper.index_of(f"{side}_{joint}") for side in ("left", "right")]

    paper, mean = Skeleton.paper(), heights(mean_performance)
    found = heights(postures)
    found[:, [*of("hip"), *of("knee"), *of("ankle")]] -= drop(found) - drop(mean).mean()
    return found - mean.min()


# -- time -------------------------------------------------------------------------------

REPETITIONS = 50


def time_table(folds):
    """predict over score_samples, in alternation."""
    print_head("time of `predict` / of the density", ["trials", "together", "alone"])
    for fold in folds:
        model = ActionModel().fit(fold.on_clock, groups=fold.groups)
        tried = np.concatenate(list(fold.synchronised.values()))
        cells = [str(len(tried))]
        for X in (tried, tried[:1]):
            seconds = np.array(
                [
                    [took(f, X) for f in (model.predict, model.score_samples)]
                    for _ in range(REPETITIONS)
                ]
            )
            cells.append("{:.2f} / {:.2f} ms = {:.1f}".format(*ratio(seconds)))
        print_row(f"{fold.clips}, `{fold.action}`, {len(fold.on_clock)} learnt", cells)


def took(function, X):
    start = time.perf_counter()
    function(X)
    return time.perf_counter() - start


def ratio(seconds):
    ours, other = np.median(seconds, axis=0)
    return 1e3 * ours, 1e3 * other, ours / other


# -- all of it --------------------------------------------------------------------------


def examine_all(sets):
    """{data set: what is found on its folds}."""
    work = [(clips, *fold) for clips in sets for fold in clips.folds()]
    done = iter(Parallel(n_jobs=-1)(delayed(examine)(*one) for one in work))
    return {clips.name: [next(done) for _ in clips.folds()] for clips in sets}


def print_tables(sets):
    found_by_set = examine_all(sets)
    for name, found in found_by_set.items():
        verdict_tables(name, found)
    for judge in (MODEL, DETECTOR):
        action_table(found_by_set, judge)
    border_table(found_by_set)
    band_table(found_by_set)
    departure_table(sets)
    time_table([hold_out(clips, *clips.folds()[0]) for clips in sets])


def main():
    """Print the tables."""
    folder = Path(sys.argv[1]) if len(sys.argv) > 1 else None
    packages = ("sklearn_motionsync", "numpy", "scipy", "scikit-learn", "dtaidistance")
    versions = {package: version_of(package) for package in packages}
    print(", ".join(f"{name} {version or 'not installed'}" for name, version in versions.items()))
    print_tables(read_clips(folder))
    if folder is not None:
        feet_table(folder)


if __name__ == "__main__":
    main()
