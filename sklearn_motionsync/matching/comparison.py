"""Comparison: synchronisation distances of any two performances by themselves (Eq. 12).

What is learnt in a fit, and rounds with the tile a pair is computed in, serves one training set.
Here no distance depends on which other performances there are, not in its last bit: all
products have one size, and blocks that are not full are filled up with zeros.
"""

import numpy as np

from .costs import COSTS, cost_features
from .rows import Bases, Bundle, right_factor
from .trellis import Trellis
from .units import exponent_of

__all__ = ["BLOCK", "Comparison"]

# Bases, and moving sequences, of a block. Smaller ones are slower (8 x 8 twice), larger ones are
# filled up with more zeros for a single performance.
BLOCK = 16
# A feature that differs by less than this share of its performance's size does not move, and a
# distance that is less than this share of both energies is 0: the rest is rounding.
_STILL, _EQUAL = 2.0**-44, 2.0**-40


class Comparison:
    """How performances on the clock are compared.

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
    exponent : int, default=0
        Even. Without ``normalize`` performances are compared in the unit ``2 ** exponent``, which
        costs no bit, and no square is beyond the precision.
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
        exponent=0,
    ):
        self.cost, self.normalize, self.smoothing = cost, normalize, velocity_smoothing
        self.n_frames, self.exponent = n_frames, 0 if normalize else exponent
        mu = float(np.ldexp(float(smoothness), -self._degree))
        reach = {"max_offset": max_offset, "max_rate": max_rate}
        self.trellis = Trellis.on_clock(cost, n_frames, mu, **reach)

    @property
    def _degree(self):
        """Of the power of two that distances are to be multiplied by."""
        return COSTS[self.cost].degree * self.exponent

    def features(self, on_clock):
        """What is compared of performances (n, P, n_features) on the clock: (n, P, n_compared)."""
        exponents = np.full(len(on_clock), self.exponent)
        if self.normalize:
            exponents[:] = [exponent_of(x) for x in on_clock]
        scaled = np.ldexp(on_clock.astype(np.float64), -exponents[:, np.newaxis, np.newaxis])
        size = np.abs(scaled).max(axis=(1, 2), keepdims=True, initial=0)
        still = np.ptp(scaled, axis=1, keepdims=True) <= _STILL * size
        scaled = np.where(still, scaled[:, :1], scaled)
        features = cost_features(scaled, self.cost, smoothing=self.smoothing)
        if not self.normalize:
            return features
        energy = energies(features) / self.n_frames
        # Who does not move has all energy in a feature that nobody else has.
        rest = np.broadcast_to(energy == 0, (*features.shape[:2], 1))
        features /= np.sqrt(np.where(energy > 0, energy, 1))
        return np.concatenate([features, rest], axis=2)

    def block(self, bases, moving):
        """Distances, without symmetry, of at most ``BLOCK`` bases to as many moving sequences.

        Parameters
        ----------
        bases, moving : ndarray, shape (n, P, n_features)
            Features.

        Returns
        -------
        ndarray, shape (n_bases, n_moving)
        """
        full = Bases(self.trellis, _filled(bases))
        # Not by the tiles of the trellis: their sizes follow the number of features.
        bundle = Bundle(self.trellis, full, right_factor(_filled(moving)))
        distances = bundle.distances()[: len(bases), : len(moving)]
        both = energies(bases)[:, 0] + energies(moving)[:, 0, 0]
        distances = np.where(distances <= _EQUAL * both, 0, distances)
        with np.errstate(over="ignore", under="ignore"):
            return np.ldexp(distances, self._degree)


def energies(features):
    """``sum_p |x(p)|^2`` of every performance: (n, 1, 1)."""
    flat = features.reshape(len(features), -1)
    return np.vecdot(flat, flat)[:, np.newaxis, np.newaxis]


def _filled(sequences):
    if len(sequences) == BLOCK:
        return sequences
    filled = np.zeros((BLOCK, *sequences.shape[1:]))
    filled[: len(sequences)] = sequences
    return filled
