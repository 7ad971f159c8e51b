"""Units: whatever the unit of the data, matching computes with numbers about 1.

Powers of two are taken out, which costs no bit: nothing that is computed depends on the unit, and
no square is too large or too small for the precision.
"""

from typing import NamedTuple

import numpy as np
from scipy.sparse.csgraph import connected_components

from .warps import even_slices

__all__ = ["Unit", "exponent_of", "squared_distances"]

# A feature whose values differ by less than this share of their size does not move, and features
# that differ by less than this share of their energy are copies: the rest is rounding.
_STILL = 2.0**-44
_COPY = 2.0**-30
# Up to this exponent a power of two is a plain number in single precision.
_PLAIN = 100
# Numbers that are looked at together: what stands in between is no copy of a large set.
AT_ONCE = 1 << 20


class Unit(NamedTuple):
    """What is taken off and out of postures before they are compared.

    Attributes
    ----------
    centre : ndarray, shape (n_features,)
        Mean posture of the training set, in the unit: centred features keep inner products small.
    exponent : int
        The unit is ``2 ** exponent``; even, so that its square root is a power of two, too.
    rounding : ndarray, shape (n_features,)
        Of features that are constant, how far rounding may take them from the centre; else 0.
    copies : list of ndarray of int
        Features that are copies of each other: the first one becomes their mean, the others 0.
    """

    centre: np.ndarray
    exponent: int
    rounding: np.ndarray
    copies: list

    @classmethod
    def of(cls, on_clock):
        """The unit of a training set on the clock: (n_sequences, P, n_features)."""
        low, high = on_clock.min(axis=(0, 1)), on_clock.max(axis=(0, 1))
        size = exponent_of(np.stack([low, high]))
        low, high = np.ldexp(low, -size), np.ldexp(high, -size)
        centre = _centre(on_clock, size)
        spread = np.maximum(high - centre, centre - low)
        rounding = max(_STILL, 64 * float(np.finfo(on_clock.dtype).eps))
        rounding = rounding * np.maximum(high, -low)
        moves = spread > rounding
        exponent = size + exponent_of(spread[moves])
        exponent += exponent % 2
        copies = _copies(lambda: _centred(on_clock, size, centre))
        centre, rounding = (np.ldexp(x, size - exponent) for x in (centre, rounding))
        return cls(centre, exponent, np.where(moves, 0, rounding), copies)

    def __call__(self, postures, out=None):
        """Postures (..., n_features), centred, in this unit; what does not move is exactly 0."""
        out = _scaled(postures, -self.exponent, out)
        out -= self.centre
        still = np.flatnonzero(self.rounding)
        if len(still):
            part = out[..., still]
            out[..., still] = np.where(np.abs(part) > self.rounding[still], part, 0)
        for first, *others in self.copies:
            kept = out[..., first]
            # Nothing is added to what is equal to the last bit.
            kept += (out[..., others] - kept[..., np.newaxis]).sum(axis=-1) / (1 + len(others))
            out[..., others] = 0
        return out

    def fill(self, on_clock):
        """Take sequences (n_sequences, P, n_features) over into this unit, where they are."""
        for rows in _portions(on_clock):
            self(on_clock[rows], out=on_clock[rows])
        return on_clock

    def first_beyond(self, size, arrays):
        """The index of the first array that holds a number of this size in the unit, or None."""
        limit = float(self.back(size, 1))
        near = (float(x.max()) < limit and -float(x.min()) < limit for x in arrays)
        return next((i for i, is_near in enumerate(near) if not is_near), None)

    def part(self, columns):
        """That of some features alone, by their indices."""
        place = {int(column): i for i, column in enumerate(columns)}
        copies = [[place[k] for k in group.tolist() if k in place] for group in self.copies]
        copies = [np.array(group) for group in copies if len(group) > 1]
        centre, rounding = self.centre[columns], self.rounding[columns]
        return Unit(centre, self.exponent, rounding, copies)

    @property
    def holders(self):
        """For every feature, the one that holds what it does: itself, unless it is a copy."""
        holders = np.arange(len(self.centre))
        for first, *others in self.copies:
            holders[others] = first
        return holders

    def back(self, values, degree=2):
        """What grows as the unit to some degree, such as squares, in the unit of the data.

        In double precision; infinite where that does not reach.
        """
        with np.errstate(over="ignore", under="ignore"):
            return np.ldexp(np.asarray(values, dtype=np.float64), degree * self.exponent)


def _scaled(values, exponent, out=None):
    """``values * 2 ** exponent``, to the bit; ``ldexp`` takes twenty times as long."""
    if abs(exponent) > _PLAIN:
        return np.ldexp(values, exponent, out=out)
    return np.multiply(values, values.dtype.type(2.0**exponent), out=out)


def _portions(on_clock):
    """Slices of sequences that are looked at together."""
    return even_slices(len(on_clock), max(1, AT_ONCE // max(1, on_clock[0].size)))


def _centre(on_clock, size):
    """The mean posture, in ``2 ** size``."""
    portions = _portions(on_clock)
    means = [_scaled(on_clock[rows], -size).mean(axis=(0, 1)) for rows in portions]
    if len(means) == 1:
        return means[0]
    weights = [rows.stop - rows.start for rows in portions]
    return np.average(means, axis=0, weights=weights).astype(on_clock.dtype)


def _centred(on_clock, size, centre):
    """Yield portions of the frames, in ``2 ** size`` and about the centre: (n, n_features)."""
    for rows in _portions(on_clock):
        frames = _scaled(on_clock[rows], -size)
        frames -= centre
        yield frames.reshape(-1, len(centre))


def _copies(portions):
    """The columns of centred frames that are there more than once, copies together.

    ``portions()`` yields the frames.
    """
    energy = sum(np.square(frames).sum(axis=0, dtype=np.float64) for frames in portions())
    order = np.argsort(energy, kind="stable")
    alike = np.diff(energy[order]) <= _COPY * energy[order[1:]]
    found = []
    # Only columns of equal energy can be copies: they are neighbours in this order.
    for run in np.split(order, np.flatnonzero(~alike) + 1):
        if len(run) == 1 or energy[run[0]] == 0:
            continue
        run = np.sort(run)
        columns = (frames[:, run].astype(np.float64) for frames in portions())
        products = sum(x.T @ x for x in columns)
        distances = energy[run][:, np.newaxis] + energy[run] - 2 * products
        count, group_of = connected_components(distances <= _COPY * energy[run[0]], directed=False)
        groups = [run[group_of == k] for k in range(count)]
        found.extend(group for group in groups if len(group) > 1)
    return found


def exponent_of(values):
    """The e of the largest of some numbers, ``2 ** (e - 1) <= |x| < 2 ** e``; 0 for none."""
    largest = max(abs(float(values.max(initial=0))), abs(float(values.min(initial=0))))
    return int(np.frexp(largest)[1])


def squared_distances(sequences, other):
    """``|x_i - y|^2`` of sequences (n_sequences, P, n_features) to another one, in any unit.

    Infinite where double precision does not reach.
    """
    exponent = max(exponent_of(sequences), exponent_of(other))
    differences = _scaled(sequences, -exponent) - _scaled(other, -exponent)
    squares = np.square(differences).sum(axis=(1, 2), dtype=np.float64)
    with np.errstate(over="ignore", under="ignore"):
        return np.ldexp(squares, 2 * exponent)
