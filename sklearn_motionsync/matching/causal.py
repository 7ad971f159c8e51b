"""Causal matching of running sequences: velocities from the past, and rows sample by sample.

A velocity is the difference of two samples under two exponential filters, delayed by twice the
width of a filter. The sequence it is compared with goes through the same filters, with the same
delay.
"""

import numpy as np
from scipy.signal import lfilter

from .factors import Bases, right_factor
from .trellis import TIE, Tile

__all__ = ["CausalDerivative", "CausalTrellis", "causal_costs", "causal_velocity"]

# Gaps longer than this, in widths of the filter, are not bridged: the filter restarts.
_BRIDGED = 3


class CausalDerivative:
    """The velocity of streams at their last sample; before their first sample they are at rest.

    Parameters
    ----------
    width : float
        Time constant of both filters, in samples; 0 for the plain difference.
    shape : tuple (n_streams, n_features)
    """

    def __init__(self, width, shape):
        self._keep = _kept_share(width)
        self._longest = max(1.0, _BRIDGED * width)
        self._last = np.full(shape, np.nan)
        # Samples since the last observation; states of both filters, and their observed weights.
        # Steady: all features were observed in the last sample, and long enough before.
        self._steady = False
        self._age = np.zeros(shape)
        self._filtered = np.zeros((2, *shape))
        self._weight = np.ones((2, *shape))

    def restart(self, stream):
        """Forget the past of one stream."""
        self._last[stream], self._age[stream] = np.nan, 0
        self._filtered[:, stream], self._weight[:, stream] = 0, 1
        self._steady = False

    def step(self, sample):
        """Velocity by the sample, NaN where it is unknown: (n_streams, n_features).

        Parameters
        ----------
        sample : ndarray, shape (n_streams, n_features)
            NaN where nothing was observed. Across a short gap the velocity is taken as constant;
            after a long one the filter restarts with the second sample.
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
        lost = seen & (self._age > self._longest) & ~np.isnan(self._last)
        self._weight[:, lost] = 0
        first = seen & np.isnan(self._last)
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


def causal_velocity(positions, subframes, width):
    """Causal velocity of a whole sequence, at every position, by the frame.

    Parameters
    ----------
    positions : ndarray, shape (Q, n_features)
        ``subframes`` positions a frame. Every position is filtered with those whole frames before
        it, as samples of a stream are. Without NaN.
    subframes : int
    width : float
        Time constant in frames.

    Returns
    -------
    ndarray, shape (Q, n_features)
    """
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
    """The trellis of streams against one moving sequence, row by row.

    Parameters
    ----------
    trellis : Trellis
        With ``running=True``.
    moving : ndarray, shape (Q, n_features)
    n_streams : int, default=1

    Attributes
    ----------
    n_samples : int
        Samples so far.
    """

    def __init__(self, trellis, moving, n_streams=1):
        self.trellis, self.n_samples = trellis, 0
        empty = np.empty((n_streams, 0, moving.shape[1]), dtype=moving.dtype)
        self._tile = Tile(Bases(trellis, empty), right_factor(moving[np.newaxis], trellis))
        self._states = self._tile.states(2)
        self._energy = np.full(n_streams, self._tile.right[:, 0, -2].sum())
        self._rank = TIE[moving.dtype] * np.arange(trellis.width + 1.0)[:, np.newaxis]
        self._begins = np.zeros(n_streams, dtype=bool)

    def restart(self, stream):
        """Start a new path of one stream at its next sample."""
        self._begins[stream] = True

    def advance(self, samples, own=None):
        """Take one sample of every stream.

        Parameters
        ----------
        samples : ndarray, shape (n_streams, n_features)
        own : dict of {tuple of int: (ndarray (n, n_features'), ndarray (Q, n_features'))}
            For streams with missing features: the observed features of their samples and of
            the moving sequence; None where all are missing.
        """
        tile, p = self._tile, self.n_samples
        high = int(min(self.trellis.width, self.trellis.slopes.max() * p))
        local = tile.costs_of_sample(p, self._left(samples), 0, high)
        by_stream = local.reshape(len(local), high + 1, -1)
        self._energy += np.vecdot(samples, samples)
        for streams, parts in (own or {}).items():
            by_stream[:, :, streams] = self._costs_of_part(parts, len(streams), high)
        tile.take_row(self._states, p, local, 0, high)
        if self._begins.any():
            unit = self.trellis.unit_group
            row = self._states[p % 2].reshape(-1, len(self._begins))
            row[:, self._begins] = np.inf
            first = by_stream[unit, 0, self._begins] - self.trellis.groups[unit].penalty
            row[self.trellis.centre, self._begins] = first
            self._begins[:] = False
        self.n_samples += 1

    @property
    def costs(self):
        """``S(p, q)`` of the last sample: (n_streams, Q)."""
        return np.maximum(self._last_row().T, 0)

    def best(self):
        """Where the best paths end, in positions, and their costs: (n_streams,) each.

        Of equal ends it is the earliest.
        """
        row = self._last_row()
        ends = (row + self._rank * self._energy).argmin(axis=0)
        return ends, np.maximum(row[ends, np.arange(len(ends))], 0)

    def _last_row(self):
        row = self._states[(self.n_samples - 1) % 2].reshape(-1, len(self._energy))
        return row[self.trellis.centre : self.trellis.centre + self.trellis.width + 1]

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


def causal_costs(trellis, moving, base):
    """Yield, of every sample of a whole base, the `CausalTrellis.costs` of one stream: (Q,).

    Parameters
    ----------
    trellis : Trellis
        With ``running=True``.
    moving : ndarray, shape (Q, n_features)
    base : ndarray, shape (n_samples, n_features)
    """
    tile = Tile(Bases(trellis, base[np.newaxis]), right_factor(moving[np.newaxis], trellis))
    states = tile.states(2)
    for p in tile.advance(states):
        row = states[p % 2, trellis.centre : trellis.centre + trellis.width + 1]
        yield np.maximum(row, 0)
