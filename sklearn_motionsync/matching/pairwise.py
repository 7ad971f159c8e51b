"""Synchronisation distances of any two performances by themselves (Eq. 12).

In a fit distances are rounded as the tile they are computed in. Here no distance depends on the
other performances, not in its last bit: all products have one size, and blocks that are not full
are padded with zeros.
"""

import numpy as np

from .matcher import cost_features
from .trellis import Bases, Tile, Trellis, right_factor

__all__ = ["BLOCK", "PairwiseDistance"]

# Bases, and moving sequences, of a block. Smaller ones are slower (8 x 8 twice), larger ones are
# padded with more zeros for a single performance.
BLOCK = 16
# A feature whose range is less than this share of its performance's magnitude is constant, and a
# distance that is less than this share of both energies is 0: the rest is rounding.
_CONSTANT, _EQUAL = 2.0**-44, 2.0**-40


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
    """

    def __init__(
        self, cost, *, normalize, n_frames, velocity_smoothing, max_offset, smoothness, max_rate
    ):
        self.cost, self.normalize, self.smoothing = cost, normalize, velocity_smoothing
        self.n_frames = n_frames
        reach = {"max_offset": max_offset, "max_rate": max_rate}
        self.trellis = Trellis.on_clock(cost, n_frames, float(smoothness), **reach)

    def features(self, on_clock):
        """Features of performances (n, P, n_features) on the clock: (n, P, n_compared)."""
        on_clock = on_clock.astype(np.float64)
        size = np.abs(on_clock).max(axis=(1, 2), keepdims=True, initial=0)
        if self.normalize:
            # The same bits in any unit: powers of two are taken out.
            exponents = np.frexp(size)[1]
            on_clock, size = np.ldexp(on_clock, -exponents), np.ldexp(size, -exponents)
        is_constant = np.ptp(on_clock, axis=1, keepdims=True) <= _CONSTANT * size
        on_clock = np.where(is_constant, on_clock[:, :1], on_clock)
        features = cost_features(on_clock, self.cost, smoothing=self.smoothing)
        if not self.normalize:
            return features
        energy = _energies(features)[:, np.newaxis, np.newaxis] / self.n_frames
        # All energy of a performance that stands still is in a feature that is 0 in others.
        rest = np.broadcast_to(energy == 0, (*features.shape[:2], 1))
        features /= np.sqrt(np.where(energy > 0, energy, 1))
        return np.concatenate([features, rest], axis=2)

    def block(self, bases, moving):
        """Distances of at most ``BLOCK`` bases to as many moving sequences; not symmetric.

        Parameters
        ----------
        bases, moving : ndarray, shape (n, P, n_features)
            Features.

        Returns
        -------
        ndarray, shape (n_bases, n_moving)
        """
        # Not by the tiles of the trellis: their sizes follow the number of features.
        tile = Tile(Bases(self.trellis, _padded(bases)), right_factor(_padded(moving)))
        distances = tile.ends()[: len(bases), : len(moving), 0]
        both = _energies(bases)[:, np.newaxis] + _energies(moving)
        return np.where(distances <= _EQUAL * both, 0, distances)


def _energies(features):
    """``sum_p |x(p)|^2`` of every performance."""
    flat = features.reshape(len(features), -1)
    return np.vecdot(flat, flat)


def _padded(sequences):
    padded = np.zeros((BLOCK, *sequences.shape[1:]))
    padded[: len(sequences)] = sequences
    return padded
