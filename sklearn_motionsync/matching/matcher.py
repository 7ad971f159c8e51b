"""Matcher: what is compared of performances, and how any two of them are compared."""

import math
from typing import NamedTuple

import numpy as np
from sklearn import get_config

from .consensus import choose_exemplars, smoothed, vote
from .costs import COSTS, cost_features
from .metric import Metric, energy_shares, learn_metric
from .trellis import Trellis
from .units import Unit
from .warps import follow, normalise

__all__ = ["Features", "Matcher"]

# Of a clip so many frames tell the metric.
LEARNING_FRAMES = 100
# Frames in the reach of a band from which on finer ones do not matter to who is typical, and by how
# many times fewer frames than all are worth it.
_REACH, _WORTH = 8, 1.5


def _spread(n, count):
    """Indices of so many of n, evenly spaced, the first and the last among them."""
    return np.round(np.linspace(0, n - 1, count)).astype(np.intp)


class Features(NamedTuple):
    """What is compared of performances.

    Attributes
    ----------
    cost : str
        A key of ``costs.COSTS``.
    subframes : int
        Positions a frame.
    velocity_smoothing : float
    unit : Unit
    metric : Metric or None
        Learnt of velocities and postures.
    frames : int, default=None
        At so many frames alone, evenly spaced.
    single : bool, default=False
        In single precision, whatever that of the postures.
    """

    cost: str
    subframes: int
    velocity_smoothing: float
    unit: Unit
    metric: Metric | None = None
    frames: int | None = None
    single: bool = False

    def __call__(self, positions):
        """Features, at every position, of postures in the unit: (n_sequences, Q, n_compared)."""
        if self.single:
            positions = positions.astype(np.float32, copy=False)
        features = self._of_cost(positions)
        if self.metric is not None:
            features = self.metric(features, positions)
        if self.frames is not None:
            features = features[:, _spread(features.shape[1], self.frames)]
        return features

    def _of_cost(self, positions):
        return cost_features(positions, self.cost, self.subframes, self.velocity_smoothing)

    @property
    def degree(self):
        """With which power of the unit of the data squares of features grow."""
        return COSTS[self.cost].degree if self.metric is None else 0

    def for_search(self, n_frames, max_offset):
        """The same as a training set is searched by: at fewer frames, in single precision.

        If a metric is learnt.
        """
        enough = self._enough(n_frames, max_offset)
        if self.metric is None or enough == n_frames:
            return self
        return self._replace(frames=enough, single=True)

    def _enough(self, n_frames, max_offset):
        """How many frames tell who is typical and what is noise, or all if not many fewer do.

        As many as the smoothing of velocities leaves independent, and the band needs.
        """
        finest = min(self.velocity_smoothing, max_offset / _REACH)
        return n_frames if n_frames * finest < _WORTH else 1 + math.ceil(1 / finest)

    def in_full(self):
        """The same in the precision of the postures."""
        return self._replace(single=False)

    def shape(self, positions):
        """How many performances and positions are compared, and how many of these are a frame."""
        n_sequences, n_positions = positions.shape[:2]
        if self.frames is None:
            return n_sequences, n_positions, self.subframes
        return n_sequences, self.frames, 1

    def at_pace(self, subframes, smoothing=None):
        """The same of so many positions a frame, under this smoothing or its own."""
        smoothing = self.velocity_smoothing if smoothing is None else smoothing
        return self._replace(subframes=subframes, velocity_smoothing=smoothing)

    def plain(self):
        """The same without the metric."""
        return self._replace(metric=None)

    def learn(self, positions, *, consensus, warp_smoothing, **settings):
        """These features with the metric of performances, at all positions in the unit.

        And the share of every feature in what is compared, and in the energy of its velocities; or
        None if there is nothing to learn.

        At most ``LEARNING_FRAMES`` frames of each are looked at, which the smoothing of velocities,
        a share of the clip, leaves without loss; as many as are enough are matched.
        """
        # What rounding does to a metric is nothing beside what noise does.
        positions = positions.astype(np.float32, copy=False)
        velocity = self._of_cost(positions)
        n_frames = (positions.shape[1] - 1) // self.subframes + 1
        some = _spread(positions.shape[1], min(n_frames, LEARNING_FRAMES))
        few = _spread(len(some), self._enough(len(some), settings["max_offset"]))
        settings["max_rate"] = min(settings["max_rate"], len(few) - 1)
        # Where all frames lie among the few.
        within = np.interp(np.arange(len(some)), few, np.arange(len(few)))

        def match(compared, others):
            compared = compared[:, few]
            matcher = Matcher.of(self.at_pace(1), compared, **settings)
            times = matcher.voted(compared, others, consensus, warp_smoothing)
            times = np.interp(times, np.arange(len(few)), few)
            return follow(times, within[np.newaxis, np.newaxis])

        # Who of two is the base does not depend on the order they are given in.
        order = np.argsort(np.einsum("npk,npk->n", velocity, velocity), kind="stable")
        positions, velocity = (x[np.ix_(order, some)] for x in (positions, velocity))
        metric = learn_metric(match, positions, velocity)
        if metric is None:
            return None
        shares = metric.shares(velocity, positions), energy_shares(velocity)
        return self._replace(metric=metric), *shares

    def part(self, columns, on_clock):
        """What is compared of some features alone; None if they do not move.

        Features that the metric takes for noise are left out; if it takes all of them for that,
        they are compared without it.

        Parameters
        ----------
        columns : ndarray of int
        on_clock : ndarray, shape (n_sequences, Q, n_features)
            The training set at all positions, whole and not in the unit.
        """
        plain = self._replace(unit=self.unit.part(columns), metric=None)
        positions = plain.unit(on_clock[:, :, columns])
        compared = plain(positions)
        if not np.ptp(compared, axis=1).any():
            return None
        if self.metric is None:
            return plain
        metric = self.metric.part(self.unit.holders[columns], compared)
        return Features(plain.cost, plain.subframes, plain.velocity_smoothing, plain.unit, metric)

    def positions(self, arrays, n_frames):
        """Performances at every position of the clock (Eq. 7), in the unit."""
        return self.unit.fill(normalise(arrays, n_frames, self.subframes))

    def back(self, squares):
        """Squares of features in the unit of the data."""
        return self.unit.back(squares, self.degree)


class Matcher(NamedTuple):
    """Matches performances to each other: what is compared, and the trellis."""

    features: Features
    trellis: Trellis

    @classmethod
    def learn(cls, features, positions, *, smoothness, max_offset, max_rate):
        """The matcher of a training set, at all positions in the unit, and what it compares of it.

        The weight of changes of pace, ``mu``, is ``smoothness`` times the mean squared norm of the
        features, so that it does not depend on their unit.
        """
        compared = features(positions)
        return cls.of(
            features, compared, smoothness=smoothness, max_offset=max_offset, max_rate=max_rate
        ), compared

    @classmethod
    def of(cls, features, compared, *, smoothness, max_offset, max_rate):
        """The matcher of a training set, of which this is compared."""
        energy = np.einsum("npk,npk->", compared, compared, dtype=np.float64)
        settings = {"smoothness": smoothness, "max_offset": max_offset, "max_rate": max_rate}
        shape = *compared.shape[:2], features.subframes
        return cls.of_energy(features, shape, energy, **settings)

    @classmethod
    def of_energy(cls, features, shape, energy, *, smoothness, max_offset, max_rate):
        """The matcher of a training set, of which features of this shape have this energy.

        Performances, positions, and how many of these are a frame.
        """
        n_sequences, n_positions, subframes = shape
        mu = float(smoothness * energy / (n_sequences * n_positions))
        n_frames = (n_positions - 1) // subframes + 1
        return cls.of_clock(features, n_frames, mu, subframes, max_offset, max_rate)

    @classmethod
    def of_clock(cls, features, n_frames, mu, subframes, max_offset, max_rate):
        """The matcher on a clock of so many frames, with so many positions a frame."""
        reach = {"max_offset": max_offset, "max_rate": max_rate, "subframes": subframes}
        return cls(features, Trellis.on_clock(features.cost, n_frames, mu, **reach))

    def at_all_frames(self, features, n_frames, *, smoothness, max_offset, max_rate):
        """The matcher of the same training set by all frames, if this one searches by fewer."""
        if self.features is features:
            return self
        mu = self.trellis.mu
        return self.of_clock(features, n_frames, mu, features.subframes, max_offset, max_rate)

    def distances(self, features, bases, moving, tiles):
        """Synchronisation distances ``D_{n,m}`` of the tiles of the pairs of two index arrays."""
        return [
            (rows, columns, self._tile(features, bases[rows], moving[columns]))
            for rows, columns in tiles
        ]

    def _tile(self, features, bases, moving):
        bases = features[bases, :: self.trellis.table.subframes]
        return self.trellis.distances(bases, features[moving])

    def paths(self, bases, moving, coupling=None):
        """Disparities of the best paths: (n_bases, n_moving, P)."""
        return self.paths_and_costs(bases, moving, coupling)[0]

    def paths_and_costs(self, bases, moving, coupling=None):
        """The same, and the costs of the recurrence (n_bases, n_moving)."""
        max_bytes = get_config()["working_memory"] * 2**20 // 2
        return self.trellis.paths_and_costs(bases, moving, max_bytes, coupling)

    def voted(self, sequences, others, consensus, warp_smoothing):
        """Times of pairs of sequences, at the pace of the frames, after the vote.

        Each is the base for others of its own: their indices, and their times, (n_sequences,
        n_others) and (n_sequences, n_others, P).
        """
        disparities, costs = self.paths_and_costs(sequences, sequences)
        times = self.times(disparities).astype(costs.dtype)
        typical = costs.sum(axis=1, dtype=np.float64)
        chosen = [choose_exemplars(typical, consensus, n) for n in range(len(typical))]
        # The base, the other and, (n_exemplars, n_pairs), the exemplars of every pair.
        n, m = np.repeat(np.arange(len(others)), others.shape[1]), others.ravel()
        k = np.stack(chosen, axis=1)[:, n]
        lengths = np.concatenate([costs[n, m][np.newaxis], costs[n, k] + costs[k, m]])
        out = vote(times[n, m], times[n, k], times[k, m], lengths)
        return smoothed(out, self.trellis.reach, warp_smoothing).reshape(*others.shape, -1)

    def times(self, disparities):
        """``tau``, in frames, of disparities."""
        frames = np.arange(disparities.shape[-1])
        return frames + disparities / self.trellis.table.subframes
