"""Unit: poses are centred and scaled to about 1 before they are compared.

The scale is a power of two, so it changes no bit: warps do not depend on the unit of the data.
"""

from typing import NamedTuple

import numpy as np
from scipy.sparse.csgraph import connected_components

from .sizes import BATCH_NUMBERS, CONSTANT
from .warps import even_slices

# Features that differ by less than this share of their energy are copies: the rest is rounding.
_COPY = 2.0**-30


class Unit(NamedTuple):
    """Centre and scale of a training set.

    Attributes
    ----------
    centre : ndarray, shape (n_features,)
        Mean pose of the training set, in the unit: centred features keep inner products small.
    size : float
        The unit: a power of four, so that its square root is a power of two, too.
    rounding : ndarray, shape (n_features,)
        Largest deviation of constant features from the centre due to rounding; else 0.
    copies : list of ndarray of int
        Features that are copies of each other: the first becomes their mean, the others 0.
    """

    centre: np.ndarray
    size: float
    rounding: np.ndarray
    copies: list

    @classmethod
    def of(cls, on_clock):
        """The unit of a training set on the clock: (n_sequences, P, n_features)."""
        low, high = on_clock.min(axis=(0, 1)), on_clock.max(axis=(0, 1))
        batches = even_slices(len(on_clock), max(1, BATCH_NUMBERS // max(1, on_clock[0].size)))
        centre = on_clock[batches[0]].mean(axis=(0, 1))
        if len(batches) > 1:
            means = [centre, *(on_clock[rows].mean(axis=(0, 1)) for rows in batches[1:])]
            weights = [rows.stop - rows.start for rows in batches]
            centre = np.average(means, axis=0, weights=weights).astype(on_clock.dtype)
        spread, magnitude = np.maximum(high - centre, centre - low), np.maximum(high, -low)
        rounding = max(CONSTANT, 64 * float(np.finfo(on_clock.dtype).eps)) * magnitude
        varies = spread > rounding
        largest = spread[varies].max() if varies.any() else np.abs(magnitude).max()
        exponent = int(np.frexp(largest)[1])
        size = 2.0 ** (exponent + exponent % 2)
        copies = _find_copies(on_clock, batches, centre)
        inverse = centre.dtype.type(1 / size)
        return cls(centre * inverse, size, np.where(varies, 0, rounding * inverse), copies)

    def __call__(self, poses, out=None):
        """Centred poses (..., n_features) in this unit; constant features are exactly 0.

        Further columns stay as they are.
        """
        n_features = len(self.centre)
        if poses.shape[-1] > n_features:
            out = poses.copy() if out is None else out
            self(poses[..., :n_features], out[..., :n_features])
            return out
        out = np.multiply(poses, poses.dtype.type(1 / self.size), out=out)
        out -= self.centre
        constant = np.flatnonzero(self.rounding)
        if len(constant):
            part = out[..., constant]
            out[..., constant] = np.where(np.abs(part) > self.rounding[constant], part, 0)
        for first, *others in self.copies:
            mean = out[..., first]
            # Copies that are equal to the last bit stay so.
            mean += (out[..., others] - mean[..., np.newaxis]).sum(axis=-1) / (1 + len(others))
            out[..., others] = 0
        return out

    def part(self, columns):
        """The unit of some features, by their indices."""
        place = {int(column): i for i, column in enumerate(columns)}
        copies = [[place[k] for k in group.tolist() if k in place] for group in self.copies]
        copies = [np.array(group) for group in copies if len(group) > 1]
        return Unit(self.centre[columns], self.size, self.rounding[columns], copies)

    @property
    def originals(self):
        """For every feature its own index, or that of the feature it is a copy of."""
        originals = np.arange(len(self.centre))
        for first, *others in self.copies:
            originals[others] = first
        return originals


def _find_copies(on_clock, batches, centre):
    """Groups of equal columns, by their indices."""

    def centred():
        for rows in batches:
            yield (on_clock[rows] - centre).reshape(-1, len(centre))

    energy = sum(np.square(frames).sum(axis=0, dtype=np.float64) for frames in centred())
    order = np.argsort(energy, kind="stable")
    alike = np.diff(energy[order]) <= _COPY * energy[order[1:]]
    copies = []
    # Only columns of equal energy can be copies: they are neighbours in this order.
    for run in np.split(order, np.flatnonzero(~alike) + 1):
        if len(run) == 1 or energy[run[0]] == 0:
            continue
        run = np.sort(run)
        columns = (frames[:, run].astype(np.float64) for frames in centred())
        products = sum(x.T @ x for x in columns)
        distances = energy[run][:, np.newaxis] + energy[run] - 2 * products
        count, group_of = connected_components(distances <= _COPY * energy[run[0]], directed=False)
        groups = [run[group_of == k] for k in range(count)]
        copies.extend(group for group in groups if len(group) > 1)
    return copies
