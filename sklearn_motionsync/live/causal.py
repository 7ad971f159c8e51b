"""Causal matching of running sequences: velocities from the past, and rows sample by sample.

A velocity is the difference of two samples under two exponential filters, delayed by twice the
width of a filter. The sequence it is compared with goes through the same filters, with the same
delay.
"""

import math

import numpy as np
from scipy.signal import lfilter

from ..matching.tile import TIE, Bases, Tile, right_factor

# Gaps longer than this, in widths of the filter, are not bridged: the filter restarts.
_BRIDGED = 3
# After so many widths both filters have forgotten everything.
_FORGOTTEN = 40


class CausalDerivative:
    """The velocity of streams (n_streams, n_features) at their last sample.

    ``width`` is the time constant of both filters in samples, 0 for the plain difference. Streams
    are at rest before their first sample; without ``from_rest`` their velocity is known from the
    second one on.
    """

    def __init__(self, width, shape, from_rest=True):
        self._keep = _kept_share(width)
        self._longest = max(1.0, _BRIDGED * width)
        self._last = np.full(shape, np.nan)
        # Samples since the last observation; states of both filters, and their observed weights.
        # Steady: all features were observed in the last sample, and long enough before.
        self._steady = False
        self._age = np.zeros(shape)
        self._filtered = np.zeros((2, *shape))
        self._from_rest, self._weight = from_rest, np.full((2, *shape), float(from_rest))

    def step(self, sample):
        """Velocity by the sample, both (n_streams, n_features); NaN where it is unknown.

        A sample is NaN where nothing was observed. Across a short gap the velocity is taken as
        constant; after a long one the filter restarts with the second sample.
        """
        if self._steady and not np.isnan(sample).any():
            velocity = sample - self._last
            for filtered in self._filtered:
                filtered += (1 - self._keep) * (velocity - filtered)
                velocity = filtered.copy()
            self._last = np.array(sample)
            return velocity
        # Some features are or were not observed.
        self._age += 1
        seen = ~np.isnan(sample)
        first = seen & np.isnan(self._last)
        lost = seen & (self._age > self._longest) & ~first
        if not self._from_rest:
            lost |= first
        self._weight[:, lost] = 0
        known = seen & ~lost
        gap = np.where(known, self._age, 1)
        difference = np.where(known & ~first, sample - self._last, 0) / gap
        keep = np.where(known, self._keep**gap, 1)
        velocity = difference
        for filtered, weight in zip(self._filtered, self._weight, strict=True):
            weight *= keep
            weight += 1 - keep
            # The weighted mean of all observations.
            gain = np.where(weight > 0, (1 - keep) / np.where(weight > 0, weight, 1), 0)
            filtered += gain * (velocity - filtered)
            velocity = filtered.copy()
        self._last = np.where(seen, sample, self._last)
        self._age[seen] = 0
        self._steady = bool(seen.all() and (self._weight > 1 - 1e-12).all())
        return np.where(known, velocity, np.nan)


def causal_velocity(positions, subframes, width, cyclic=False):
    """Causal velocity of a whole sequence (Q, n_features), at every position, by the frame.

    Every position, of which there are ``subframes`` a frame, is filtered with those whole frames
    before it, as samples of a stream are, with a time constant of ``width`` frames. It is without
    NaN. A cyclic sequence was repeated before, and its last position is the first one again; any
    other was at rest.
    """
    if cyclic:
        n = len(positions) - 1
        before = math.ceil((_FORGOTTEN * width + 1) * subframes)
        repeated = np.concatenate([positions[np.arange(-before, 0) % n], positions])
        return causal_velocity(repeated, subframes, width)[before:]
    velocity = positions.copy()
    # Before the first position is rest.
    velocity[:subframes] -= positions[0]
    velocity[subframes:] -= positions[:-subframes]
    keep = _kept_share(width)
    for lane in range(subframes):
        for _ in range(2):
            filtered = lfilter([1 - keep], [1, -keep], velocity[lane::subframes], axis=0)
            velocity[lane::subframes] = filtered
    return velocity


def _kept_share(width):
    """What a filter of this width keeps of its state from one sample to the next."""
    return float(np.exp(-1 / width)) if width > 0 else 0.0


# -- the rows of the trellis, sample by sample (Eqs. 16, 17) -----------------------------------


class CausalTrellis:
    """The trellis of streams against one moving sequence (Q, n_features), row by row.

    The ``trellis`` has ``running=True``. A cyclic moving sequence goes on with its first position
    after the last one, which is the same, and paths then begin at any position. A new attempt, a
    path that goes on from any position to the first one, pays ``restart_cost``.

    ``n_samples`` counts the samples so far; ``attempts`` (n_streams,) how often a new attempt
    became cheaper than the one before, which then ends.
    """

    def __init__(self, trellis, moving, n_streams=1, cyclic=False, restart_cost=np.inf):
        self.trellis, self.n_samples = trellis, 0
        self._cyclic, self._restart_cost = cyclic, restart_cost
        empty = np.empty((n_streams, 0, moving.shape[1]), dtype=moving.dtype)
        self._tile = Tile(Bases(trellis, empty), right_factor(moving[np.newaxis], trellis))
        # The rows of paths, and of those that begin another attempt.
        self._states, self._others = self._tile.states(2), self._tile.states(2)
        self._energy = np.full(n_streams, self._tile.right[:, 0, -2].sum())
        self._rank = TIE[moving.dtype] * np.arange(trellis.width + 1.0)[:, np.newaxis]
        self.attempts = np.zeros(n_streams, dtype=np.intp)

    def advance(self, samples, partial=None, moves=None):
        """Take one sample of every stream (n_streams, n_features).

        Of streams with missing features, ``partial`` has by a tuple of their numbers the observed
        features of their samples and of the moving sequence, or None where all are missing. Streams
        that do not move, by the mask ``moves``, begin no other attempt meanwhile; None says that
        all move.
        """
        tile, p, high = self._tile, self.n_samples, self.trellis.width
        if not self._cyclic:
            high = int(min(high, self.trellis.slopes.max() * p))
        local = tile.costs_of_sample(p, self._left(samples), 0, high)
        by_stream = local.reshape(len(local), high + 1, -1)
        self._energy += np.vecdot(samples, samples)
        for streams, parts in (partial or {}).items():
            by_stream[:, :, streams] = self._costs_of_part(parts, len(streams), high)
        if p > 0:
            # Fill the cells before the first position, from which steps lead to row p.
            first, before = self.trellis.centre, self._last_row()
            if self._cyclic:
                pad = self.trellis.pad
                self._rows(self._states, p - 1)[first - pad : first] = before[-1 - pad : -1]
            elif self._restart_cost < np.inf:
                entry = first - self.trellis.table.subframes
                self._rows(self._others, p - 1)[entry] = before.min(axis=0) + self._restart_cost
            tile.take_row(self._states, p, local, 0, high)
        if self._restart_cost < np.inf and p > 0:
            tile.take_row(self._others, p, local, 0, high)
            self._compare_attempts(p, moves)
        if p == 0:
            # A cycle begins anywhere.
            unit, stop = self.trellis.unit_group, high + 1 if self._cyclic else 1
            first = by_stream[unit, :stop] - self.trellis.groups[unit].penalty
            self._inside(self._states, 0)[:stop] = first
        self.n_samples += 1
        if self._cyclic:
            # The last position is the first one.
            row = self._last_row()
            row[[0, -1]] = np.minimum(row[0], row[-1])

    @property
    def costs(self):
        """``S(p, q)`` of the last sample: (n_streams, Q); of a cycle without its last position."""
        row = self._last_row()
        return np.maximum(row[:-1] if self._cyclic else row, 0).T

    def best(self):
        """Where the best paths end, in positions, and their costs: (n_streams,) each.

        Of equal ends it is the earliest.
        """
        row = self._last_row()
        ends = (row + self._rank * self._energy).argmin(axis=0)
        return ends, np.maximum(row[ends, np.arange(len(ends))], 0)

    def _last_row(self):
        return self._inside(self._states, self.n_samples - 1)

    def _rows(self, states, p):
        return states[p % 2].reshape(-1, len(self._energy))

    def _inside(self, states, p):
        first = self.trellis.centre
        return self._rows(states, p)[first : first + self.trellis.width + 1]

    def _compare_attempts(self, p, moves):
        """Go on with the other attempt of a stream where it is cheaper in row p."""
        now, others = (self._inside(states, p) for states in (self._states, self._others))
        least = now.min(axis=0)
        if moves is not None and not moves.all():
            gained = least - self._inside(self._states, p - 1).min(axis=0)
            others[:, ~moves] = (self._inside(self._others, p - 1) + gained)[:, ~moves]
        wins = others.min(axis=0) < least
        if wins.any():
            now[:, wins], others[:, wins] = others[:, wins], np.inf
            self.attempts += wins

    def _left(self, samples):
        return Bases(self.trellis, samples[:, np.newaxis]).by_group()[0]

    def _costs_of_part(self, parts, n_streams, high):
        if parts is None:
            # Without an observation only the penalties remain.
            penalties = np.array([group.penalty for group in self.trellis.groups])
            shape = len(penalties), high + 1, n_streams
            return np.broadcast_to(penalties[:, np.newaxis, np.newaxis], shape)
        samples, moving = parts
        right = right_factor(moving[np.newaxis], self.trellis)[: high + 1, 0]
        return right @ self._left(samples)
