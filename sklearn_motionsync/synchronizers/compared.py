"""What is compared of a training set: kept of a small one, made in portions of a large one."""

import functools
import threading

import numpy as np

from ..matching.warps import even_slices

__all__ = ["Compared", "Found"]

# Up to so many bytes features are kept; beyond, making them again takes a few per cent of what
# comparing by them takes, and keeping them would be one copy more of all performances.
KEPT_BYTES = 1 << 25


class Compared:
    """What is compared of performances.

    Parameters
    ----------
    features : Features
    positions : ndarray, shape (n_sequences, Q, n_features)
        In the unit.

    Attributes
    ----------
    is_kept : bool
        Whether the features of all are.
    """

    def __init__(self, features, positions):
        self._features, self._positions = features, positions
        self.is_kept = positions.nbytes <= KEPT_BYTES
        self._kept, self._lock = None, threading.Lock()

    def __len__(self):
        return len(self._positions)

    @functools.cached_property
    def like(self):
        """An array of no performance that is of the kind of the features: (0, Q, n_compared)."""
        return self.of(np.arange(1))[:0].copy()

    @property
    def kept(self):
        """Of all, (n_sequences, Q, n_compared): made once, whatever number of threads ask."""
        with self._lock:
            if self._kept is None:
                self._kept = self._features(self._positions)
            return self._kept

    def of(self, indices):
        """Of some, (n_indices, Q, n_compared)."""
        portions = [indices[rows] for rows in self._slices(len(indices))]
        first = self._features(self._positions[portions[0]])
        if len(portions) == 1:
            return first
        out, stop = np.empty((len(indices), *first.shape[1:]), first.dtype), len(first)
        out[:stop] = first
        for some in portions[1:]:
            start, stop = stop, stop + len(some)
            out[start:stop] = self._features(self._positions[some])
        return out

    def portions(self):
        """Yield those of all, a portion at a time."""
        if self.is_kept:
            yield self.kept
            return
        for rows in self._slices(len(self)):
            yield self._features(self._positions[rows])

    def _slices(self, n):
        """Of so many performances, slices whose features take half a dozen copies in the making."""
        return even_slices(n, max(1, KEPT_BYTES // (16 * self._positions[0].nbytes)))

    def energy(self):
        """The sum of the squares of all."""
        parts = [np.einsum("npk,npk->", x, x, dtype=np.float64) for x in self.portions()]
        return parts[0] if len(parts) == 1 else float(np.sum(parts))


class Found:
    """Features of some performances, found by the indices of these among all.

    Parameters
    ----------
    *parts : tuple (indices, features)
        Those who are asked for together are in one of them.
    """

    def __init__(self, *parts):
        self._parts = []
        for indices, features in parts:
            place = np.full(indices.max(initial=-1) + 1, -1)
            place[indices] = np.arange(len(indices))
            self._parts.append((place, features))

    def __getitem__(self, key):
        indices, *other = key if isinstance(key, tuple) else (key,)
        for place, features in self._parts:
            if indices.max(initial=-1) < len(place) and (place[indices] >= 0).all():
                return features[(place[indices], *other)]
        raise IndexError("These performances are not in one part.")
