"""Takes of which limbs are hidden, and what is learnt of other people to tell where they are.

An actor is held out (`Fold`); peers of trackers.py, their settings and `MotionTracker` are learnt
from the takes of all others.
"""

from itertools import product
from typing import NamedTuple

import numpy as np
import trackers
from harness import P, read_archive
from sklearn_motionsync import DenseSynchronizer, DirectionCosines, MotionTracker

KINDS = ("half", "gap", "halfgap")
NOISE, RATE, STEP, N_LIMBS = 0.05, 30, 4, 12
TRACKER, SMOOTHER = "MotionTracker", ", smoother"
PEERS = (
    ("constant velocity", trackers.constant_velocity, [(x,) for x in trackers.FACTORS]),
    ("VAR(2)", trackers.autoregression, [(x,) for x in trackers.RIDGES]),
    ("pooled Matern", trackers.pooled_matern, list(product(trackers.LENGTHS, trackers.SHARES))),
)

# -- takes, and what of them is hidden --------------------------------------------------


class Action(NamedTuple):
    name: str
    takes: list
    actors: np.ndarray


def read(folder, names):
    bunch = read_archive(folder, "hdm05")
    for name in names:
        chosen = np.flatnonzero(bunch.target == name)
        positions = [bunch.data[i].astype(float)[::STEP] for i in chosen]
        takes = DirectionCosines(bunch.skeleton).fit_transform(positions)
        yield Action(name, takes, bunch.actor[chosen])


def columns_of(limbs):
    return np.concatenate([[1 + 3 * i, 2 + 3 * i, 3 + 3 * i] for i in limbs])


def hide(takes, kind, rng):
    """Masks, True where hidden."""
    masks = []
    for x in takes:
        mask = np.zeros(x.shape, dtype=bool)
        limbs = columns_of(rng.choice(N_LIMBS, N_LIMBS // 2, replace=False))
        gap = RATE if len(x) >= 2 * RATE else len(x) // 3
        begin = rng.integers(1, len(x) - gap)
        if kind == "half":
            mask[:, limbs] = True
        elif kind == "gap":
            mask[begin : begin + gap] = True
        elif kind == "halfgap":
            mask[begin : begin + gap, limbs] = True
        masks.append(mask)
    return masks


def angles(estimate, truth, mask):
    """Degrees between directions of the limbs that are hidden, mean of a take."""
    a, b = (x[:, 1:].reshape(len(x), N_LIMBS, 3) for x in (estimate, truth))
    cosine = (a * b).sum(-1) / (np.linalg.norm(a, axis=-1) * np.linalg.norm(b, axis=-1) + 1e-12)
    hidden = mask[:, 1:].reshape(len(truth), N_LIMBS, 3)[..., 0]
    return np.degrees(np.arccos(np.clip(cosine, -1, 1)))[hidden].mean()


def phases_of(times, n_frames):
    """Where the path of a take is at each of its frames; the middle of where it stands still."""
    at, first, counts = np.unique(times, return_index=True, return_counts=True)
    middle = first + (counts - 1) / 2
    middle[0], middle[-1] = 0, len(times) - 1
    return np.interp(np.linspace(0, len(times) - 1, n_frames), at, middle)


def phases(sync, takes):
    """The paths of takes."""
    times = sync.match(takes).times
    return [phases_of(t, len(x)) for t, x in zip(times, takes, strict=True)]


def on_path(clock, phases):
    """A course of the clock (P, n_features) at these phases."""
    return np.stack([np.interp(phases, np.arange(len(clock)), c) for c in clock.T], axis=1)


def examine(takes, kinds, rng):
    """What is seen of takes, and what is hidden of them."""
    masks = [hide([x], kind, rng)[0] for x, kind in zip(takes, kinds, strict=True)]
    given = trackers.noisy(takes, NOISE, rng)
    return [np.where(m, np.nan, x) for m, x in zip(masks, given, strict=True)], masks


def choose(make, people, settings):
    """The best setting of a filter and of its smoother, for people left out of the training set.

    Three takes of each are looked at, one a kind of hiding.
    """
    rng, totals = np.random.default_rng(0), np.zeros((len(settings), 2))
    for k, takes in enumerate(people):
        takes = takes[: len(KINDS)]
        seen, masks = examine(takes, KINDS[: len(takes)], rng)
        for row, setting in zip(totals, settings, strict=True):
            found = make(trackers.all_but(people, k), *setting).run(seen, NOISE)
            row += [
                sum(map(angles, estimates, takes, masks))
                for estimates in ([e.means for e in found], [e.smoothed for e in found])
            ]
    return [settings[i] for i in totals.argmin(axis=0)]


# -- what an actor's takes are met with -------------------------------------------------


class Fitted(DenseSynchronizer):
    """Is fitted once, so that another seed of a tracker costs little."""

    def fit(self, X, y=None):
        return self if hasattr(self, "pattern_") else super().fit(X)

    def __sklearn_clone__(self):
        return self


class Fold:
    """An actor held out: the takes, their paths, and all that is learnt from the others."""

    def __init__(self, action, actor):
        out = action.actors == actor
        self.takes = [x for x, o in zip(action.takes, out, strict=True) if o]
        self.train = [x for x, o in zip(action.takes, out, strict=True) if not o]
        self.of = action.actors[~out]
        self.sync = Fitted(n_frames=P).fit(self.train)
        warped = self.sync.transform(self.train)
        self.paths = phases(self.sync, self.takes)
        self.means = [on_path(warped.mean(axis=0), path) for path in self.paths]
        self.peers, self.chosen = {}, {}
        self._learn_peers()
        self.peers["known phase + Matern"] = [self._about_the_path(warped)] * 2
        paces = np.log([(P - 1) / (len(x) - 1) for x in self.train])
        self.particles, self.pruned = (
            trackers.PostureParticles(warped, self.train, paces, NOISE, prunes=prunes)
            for prunes in (False, True)
        )

    def _learn_peers(self):
        people = [
            [x for x, a in zip(self.train, self.of, strict=True) if a == b]
            for b in np.unique(self.of)
        ]
        for name, make, settings in PEERS:
            self.chosen[name] = choose(make, people, settings)
            made = {setting: make(self.train, *setting) for setting in self.chosen[name]}
            self.peers[name] = [made[setting] for setting in self.chosen[name]]

    def _about_the_path(self, warped):
        """The process of deviations from the mean of other people, at the phase of the path."""
        paths = zip(phases(self.sync, self.train), self.of, strict=True)
        means = [on_path(warped[self.of != a].mean(axis=0), path) for path, a in paths]
        rests = [x - m for x, m in zip(self.train, means, strict=True)]
        return trackers.deviation_process(rests, NOISE)

    def tracker(self, seed):
        tracker = MotionTracker(self.sync, noise=NOISE, random_state=seed)
        return tracker.fit(self.train, groups=self.of)

    def answers(self, some, seen, rng):
        """Of every peer its name, postures of some takes, and their standard deviations or None."""
        means = [self.means[i] for i in some]
        yield "mean at known phase", means, None
        yield "imputation", trackers.imputation(self.train, seen, NOISE), None
        for name, (peer, other) in self.peers.items():
            paths = means if name.startswith("known") else None
            smoothed = other.run(seen, NOISE, paths)
            found = smoothed if peer is other else peer.run(seen, NOISE, paths, smooth=False)
            yield name, [e.means for e in found], [np.sqrt(e.variances) for e in found]
            yield name + SMOOTHER, [e.smoothed for e in smoothed], None
        yield "particles over postures", self.particles.run(seen, rng), None
        yield "the same, pruned", self.pruned.run(seen, rng), None
