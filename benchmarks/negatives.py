"""What action models are judged on: performances of people held out, and wrong ones made of them.

A model that can say no accepts what people it has not seen do (`OWN`) and refuses what is not the
action (`KINDS`): the other actions of the same people, and their own performances spoilt in six
ways (`SPOILT`). Everything is made of points of the aSpace, before anything is synchronised.
"""

from typing import NamedTuple

import numpy as np
from events import P, read_archive
from sklearn_motionsync import ASpace, DenseSynchronizer, DirectionCosines
from sklearn_motionsync.datasets import make_bending

# -- wrong performances -----------------------------------------------------------------


def still(x):
    """The first posture held."""
    return np.repeat(x[:1], len(x), axis=0)


def weak(x):
    """The same movement, hardly: 0.3 times as far from the mean posture."""
    mean = x.mean(axis=0)
    return mean + 0.3 * (x - mean)


def half(x):
    """Broken off in the middle."""
    return x[: max(len(x) // 2, 3)]


def twice(x):
    """Two of them in a row."""
    return np.concatenate([x, x])


def exchanged(x):
    """The second half before the first."""
    middle = len(x) // 2
    return np.concatenate([x[middle:], x[:middle]])


def backwards(x):
    """From the end to the beginning."""
    return x[::-1].copy()


OWN, OTHERS, BACKWARDS = "own", "other actions", "backwards"
SPOILT = {
    "standing still": still,
    "amplitude x 0.3": weak,
    "first half": half,
    "twice in a row": twice,
    "halves exchanged": exchanged,
    BACKWARDS: backwards,
}
KINDS = (OTHERS, *SPOILT)
# Bent down and up again is, backwards, nearly the same; and so is whatever returns as it went.
BENDS = ("depositFloorR", "bending")
THERE_AND_BACK = (*BENDS, "elbowToKnee1RepsLelbowStart", "grabHighR", "hopBothLegs1hops")
THERE_AND_BACK += ("pickUp", "waveHands", "clapHands")

# -- the data sets ----------------------------------------------------------------------


class Clips(NamedTuple):
    """Postures (n_frames_i, 37) of a data set, what is done in them, and by whom."""

    name: str
    postures: list
    actions: np.ndarray
    actors: np.ndarray

    def folds(self):
        """Every action with every actor who does it."""
        return list(dict.fromkeys(zip(self.actions, self.actors, strict=True)))

    def some(self, which):
        """The postures of those that are chosen by a mask."""
        return [self.postures[i] for i in np.flatnonzero(which)]


ARCHIVES = {"hdm05": "HDM05", "utkinect": "UTKinect", "cmu07_walk": "CMU, walking cycles"}


def read_clips(folder=None):
    """The data sets: three of real people, if there is a folder of them, and make_bending."""
    archives = {} if folder is None else ARCHIVES
    sets = [as_clips(name, read_archive(folder, archive)) for archive, name in archives.items()]
    return [*sets, as_clips("make_bending", make_bending(random_state=0))]


def as_clips(name, bunch):
    postures = DirectionCosines(bunch.skeleton).fit_transform(bunch.data)
    return Clips(name, list(postures), np.asarray(bunch.target), np.asarray(bunch.actor))


# -- actors held out --------------------------------------------------------------------


class Fold(NamedTuple):
    """An action, learnt from some actors and tried on another.

    ``raw`` and ``synchronised`` hold by kind what is tried, points (n_frames_i, b) of the aSpace
    and (n, P, b) on the clock of the training performances; kinds that are empty are left out.
    """

    clips: str
    action: str
    actor: object
    train: list
    groups: np.ndarray
    on_clock: np.ndarray
    raw: dict
    synchronised: dict


def hold_out(clips, action, actor):
    """Everything learnt without an actor: aSpace, synchronizer; then the actor's performances."""
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
    return Fold(clips.name, action, actor, known, clips.actors[train], on_clock, raw, synchronised)


def hold_out_few(clips, action, actor, n_performances, rng):
    """The same from a few training performances, of two actors at least, and right ones only.

    Returns these on their clock, their groups, and the actor's own; None if there are not so many.
    """
    does_it, is_held = clips.actions == action, clips.actors == actor
    train = np.flatnonzero(does_it & ~is_held)
    if len(train) < n_performances or len(set(clips.actors[train])) < 2:
        return None
    while True:
        chosen = np.sort(rng.permutation(train)[:n_performances])
        if len(set(clips.actors[chosen])) > 1:
            break
    space = ASpace().fit([clips.postures[i] for i in chosen])
    synchronizer = DenseSynchronizer(P)
    on_clock = synchronizer.fit_transform([*space.transform([clips.postures[i] for i in chosen])])
    own = synchronizer.transform(_points(space, clips, does_it & is_held))
    return on_clock, clips.actors[chosen], own


def _points(space, clips, which):
    chosen = clips.some(which)
    return list(space.transform(chosen)) if chosen else []
