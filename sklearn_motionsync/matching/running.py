"""Sequences that are still running: the rows of the trellis as their samples come (Eqs. 16, 17).

The rows are those of a trellis whose bases are running, one at a time; where a path ends is the
best cell of the last row. Nothing but that row is kept, so a stream may go on for ever.
"""

import numpy as np

from .factors import Bases, right_factor
from .rows import TIE, Bundle

__all__ = ["Running"]


class Running:
    """Streams that are matched to a moving sequence while they run, all at the same samples.

    Parameters
    ----------
    trellis : Trellis
        With ``running=True``.
    moving : ndarray, shape (Q, n_features)
    n_streams : int, default=1

    Attributes
    ----------
    n_samples : int
        How many samples have been taken.
    """

    def __init__(self, trellis, moving, n_streams=1):
        self.trellis, self.n_samples = trellis, 0
        nothing = np.empty((n_streams, 0, moving.shape[1]), dtype=moving.dtype)
        self._bundle = Bundle(trellis, Bases(trellis, nothing), right_factor(moving[np.newaxis]))
        self._states = self._bundle.states(2)
        self._energy = np.full(n_streams, self._bundle.right[:, 0, -2].sum())
        self._rank = TIE[moving.dtype] * np.arange(trellis.width + 1.0)[:, np.newaxis]
        self._begins = np.zeros(n_streams, dtype=bool)

    def restart(self, stream):
        """Let the path of one stream begin anew at its next sample."""
        self._begins[stream] = True

    def advance(self, samples, own=None):
        """Take one sample of every stream.

        Parameters
        ----------
        samples : ndarray, shape (n_streams, n_features)
        own : dict of {tuple of int: (ndarray (n, n_features'), ndarray (Q, n_features'))}
            Streams that see only a part of the features: of these, what is compared of the
            sample and of the moving sequence; None where nothing is seen.
        """
        bundle, p = self._bundle, self.n_samples
        high = int(min(self.trellis.width, self.trellis.slopes.max() * p))
        local = bundle.costs_of_sample(p, self._left(samples), 0, high)
        by_stream = local.reshape(len(local), high + 1, -1)
        self._energy += np.vecdot(samples, samples)
        for streams, parts in (own or {}).items():
            by_stream[:, :, streams] = self._costs_of_part(parts, len(streams), high)
        bundle.take_row(self._states, p, local, 0, high)
        if self._begins.any():
            unit = self.trellis.unit_group
            row = self._states[p % 2].reshape(-1, len(self._begins))
            row[:, self._begins] = np.inf
            first = by_stream[unit, 0, self._begins] - self.trellis.groups[unit].penalty
            row[bundle.centre, self._begins] = first
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
        return row[self._bundle.centre : self._bundle.centre + self.trellis.width + 1]

    def _left(self, samples):
        return Bases(self.trellis, samples[:, np.newaxis]).by_group()[0]

    def _costs_of_part(self, parts, n_streams, high):
        if parts is None:
            # Every pace is as likely as before: what is left are the penalties.
            penalties = [group.penalty for group in self.trellis.groups]
            return np.broadcast_to(
                np.array(penalties)[:, np.newaxis, np.newaxis],
                (len(penalties), high + 1, n_streams),
            )
        samples, moving = parts
        right = right_factor(moving[np.newaxis])[: high + 1, 0]
        return right @ self._left(samples)
