"""Synchronisation distances of any two performances by themselves (Eq. 12).

In a fit distances are rounded as the tile they are computed in. Here no distance depends on the
other performances, not in its last bit: every pair has matrix products of its own, of one size, and
all else is done element by element.
"""

import itertools

import numpy as np

from ..matching.matcher import cost_features
from ..matching.sizes import CONSTANT, EQUAL
from ..matching.tile import PRODUCT_ROWS, Bases, Tile, right_factor
from ..matching.trellis import Trellis
from ..matching.warps import even_slices

__all__ = ["BLOCK", "PairwiseDistance", "blocks_of_pairs"]

# Bases, and moving sequences, of a block; of few of the one there are more of the other. Of 50
# frames 8 x 8 take 1.5 times as long a pair, 16 x 32 as long, 1 x 256 1.2 times.
BLOCK = 16


class PairwiseDistance:
    """The synchronisation distance of performances on the clock, under one cost.

    Parameters
    ----------
    cost : str
        A key of ``costs.COSTS``.
    normalize : bool
        Whether the features of every performance are divided by their own root mean square.
    n_frames : int
        Of the clock.
    velocity_smoothing : float
        As a share of the clip.
    max_offset : float
        As a share of the clock.
    smoothness : float
        Weight of changes of pace, in units of the squared features of a frame.
    max_rate : float
    dtype : type, default=numpy.float64
        Of the features that are compared, and of distances. numpy.float32 takes 0.6 of the time.
    """

    def __init__(
        self,
        cost,
        *,
        normalize,
        n_frames,
        velocity_smoothing,
        max_offset,
        smoothness,
        max_rate,
        dtype=np.float64,
    ):
        self.cost, self.normalize, self.smoothing = cost, normalize, velocity_smoothing
        self.n_frames, self.dtype = n_frames, dtype
        self.trellis = Trellis.on_clock(
            cost, n_frames, float(smoothness), max_offset=max_offset, max_rate=max_rate
        )

    def features(self, on_clock):
        """Features of performances (n, P, n_features) on the clock: (n, P, n_compared)."""
        on_clock = on_clock.astype(np.float64)
        size = np.abs(on_clock).max(axis=(1, 2), keepdims=True, initial=0)
        if self.normalize:
            # The same bits in any unit: powers of two are taken out.
            exponents = np.frexp(size)[1]
            on_clock, size = np.ldexp(on_clock, -exponents), np.ldexp(size, -exponents)
        is_constant = np.ptp(on_clock, axis=1, keepdims=True) <= CONSTANT * size
        on_clock = np.where(is_constant, on_clock[:, :1], on_clock)
        features = cost_features(on_clock, self.cost, smoothing=self.smoothing)
        if not self.normalize:
            return features.astype(self.dtype, copy=False)
        energy = _energies(features)[:, np.newaxis, np.newaxis] / self.n_frames
        # All energy of a performance that stands still is in a feature that is 0 in others.
        residue = np.broadcast_to(energy == 0, (*features.shape[:2], 1))
        features /= np.sqrt(np.where(energy > 0, energy, 1))
        return np.concatenate([features, residue], axis=2, dtype=self.dtype)

    def block(self, bases, moving):
        """Distances of bases to moving sequences, not symmetric.

        Parameters
        ----------
        bases, moving : ndarray, shape (n, P, n_features)
            Features.

        Returns
        -------
        ndarray, shape (n_bases, n_moving)
        """
        distances = PairTile(self.trellis, bases, moving).ends()[:, :, 0]
        energies = _energies(bases)[:, np.newaxis] + _energies(moving)
        return np.where(distances <= EQUAL[distances.dtype] * energies, 0, distances)


def _energies(features):
    """``sum_p |x(p)|^2`` of every performance."""
    flat = features.reshape(len(features), -1)
    return np.vecdot(flat, flat)


class PairTile(Tile):
    """A tile that multiplies every pair by itself.

    Parameters
    ----------
    trellis : Trellis
    bases, moving : ndarray, shape (n, P, n_features)
    """

    def __init__(self, trellis, bases, moving):
        super().__init__(Bases(trellis, bases), right_factor(moving, trellis))
        self.moving = moving

    def costs_of_samples(self, first, last, lows, highs):
        """Yield ``p`` and the costs of its window, one flat array a group, less ``|x_n(p)|^2``."""
        bases, moving, n_groups = self.bases.sequences, self.moving, len(self.trellis.groups)
        of_group = self.trellis.of_group.astype(self.dtype)
        weights, inner, penalty = of_group[:, :, np.newaxis, np.newaxis]
        if n_groups == 1:
            # All but a constant is in the product.
            energies = np.vecdot(moving, moving)[:, :, np.newaxis]
            moving = np.concatenate([moving, weights * energies + penalty], axis=2)
            bases = np.concatenate([-inner * bases, np.ones_like(bases[:, :, :1])], axis=2)
        else:
            energies = np.vecdot(moving, moving).T
            fixed = np.repeat(weights * energies + penalty, len(bases), axis=2)
        for start in range(first, last, PRODUCT_ROWS):
            stop = min(start + PRODUCT_ROWS, last)
            lowest, highest = start + lows[start], stop + highs[stop - 1]
            columns = moving[:, np.newaxis, lowest:highest].swapaxes(2, 3)
            products = self._products(stop - start, highest - lowest)
            np.matmul(bases[:, start:stop], columns, out=products)
            products = products.reshape(self.pairs, stop - start, -1).transpose(1, 2, 0)
            for p, row in enumerate(np.ascontiguousarray(products), start):
                window = slice(p + lows[p], p + highs[p] + 1)
                row = row[window.start - lowest : window.stop - lowest]
                if n_groups == 1:
                    yield p, row.reshape(1, -1)
                    continue
                costs = self._cost_buffer[: n_groups * row.size].reshape(n_groups, *row.shape)
                np.multiply(row, -inner, out=costs)
                costs += fixed[:, window]
                yield p, costs.reshape(n_groups, -1)

    def _products(self, n_rows, n_columns):
        """An array (n_moving, n_bases, n_rows, n_columns) whose pairs are read side by side."""
        # An odd number of cache lines from pair to pair: other distances share few of its sets.
        line = 64 // self.dtype.itemsize
        size = n_rows * n_columns
        pitch = (-(-size // line) | 1) * line
        products = np.empty((self.pairs, pitch), self.dtype)[:, :size]
        return products.reshape(len(self.moving), -1, n_rows, n_columns)

    # Of a single base, too.
    _costs_of_blocks = costs_of_samples

    def _last_row(self, states):
        return super()._last_row(states) + np.tile(
            _energies(self.bases.sequences), len(self.moving)
        )


def blocks_of_pairs(n_bases, n_moving):
    """Slices of bases and of moving sequences that cover all pairs."""
    rows = even_slices(n_bases, max(BLOCK, BLOCK**2 // n_moving))
    columns = even_slices(n_moving, max(BLOCK, BLOCK**2 // n_bases))
    return list(itertools.product(rows, columns))
