"""Random postures and performances with the moments of the training performances."""

import numpy as np
from scipy.special import ndtr, ndtri

from ..body.limbs import unit_vectors
from ..body.sphere import exp_map, log_map, mean_direction
from ..matching.counting import first_smallest

__all__ = ["PERFORMANCE", "POSTURE", "sample_performances", "sample_postures"]

# Shares of the variance of a sampled posture: of one training performance, of a mixture of all,
# and of noise that is independent in every feature; a sampled performance has the first two. Noise
# tangles limbs; the first keeps bodies in one piece and styles apart (docs/design.md).
POSTURE = (0.84, 0.14, 0.02)
PERFORMANCE = (0.64, 0.36)
# A performance that is outside reaches its training performance in so many steps.
_STEPS = 4


def sample_postures(mean, variance, deviations, n, n_std, random_state, shares=POSTURE):
    """Sample postures at a frame, inside the envelope there.

    Each is near the posture of a training performance chosen at random. Before truncation their
    mean is that of the training postures, their variance ``variance``, and their
    covariance is that of the training postures, shrunk a little towards its diagonal (2 %).
    Each feature is truncated by the monotone function that makes a normal distribution a truncated
    one: no sample is rejected, and features keep their correlations.

    Parameters
    ----------
    mean, variance : ndarray, shape (n_features,)
        Of the training postures.
    deviations : ndarray, shape (n_kept, n_features)
        Training postures less the mean, in the same units.
    n : int
        How many.
    n_std : float
        Half-width of the envelope, in standard deviations.
    random_state : RandomState
    shares : tuple of 3 floats, default=(0.84, 0.14, 0.02)
        Shares of the variance, of sum 1: of one training performance, a mixture, and noise.

    Returns
    -------
    ndarray, shape (n, n_features), of the mean's dtype
        From ``mean - n_std * sqrt(variance)`` to ``mean + n_std * sqrt(variance)``.
    """
    spread = deviations.std(axis=0)
    shapes = (deviations - deviations.mean(axis=0)) / np.where(spread > 0, spread, 1)
    own = random_state.randint(len(shapes), size=n)
    one, mixed, noise = shares
    z = _mixtures(own, len(shapes), one, mixed, random_state) @ shapes
    z += np.sqrt(noise) * random_state.standard_normal(z.shape)
    std = np.sqrt(variance)
    lower, upper = mean - n_std * std, mean + n_std * std
    postures = mean + _truncate(z, n_std) * std
    return np.clip(postures.astype(mean.dtype), lower, upper)


def sample_performances(
    mean, variance, deviations, n, dissimilarity, threshold, random_state, shares=PERFORMANCE
):
    """Sample whole performances, of a dissimilarity up to a threshold.

    Each is a random mixture of the training performances' deviations, dominated by one that is
    inside itself, with the variance of all. A sample outside moves in steps to that training
    performance; not to the mean, which need not be inside. Features that are directions are mixed
    in the tangent space of the sphere at their mean, and keep the length 1 (`directions_in`).

    Parameters
    ----------
    mean, variance : ndarray, shape (P, n_features)
        Of the training performances.
    deviations : ndarray, shape (n_kept, P, n_features)
        Training performances less the mean.
    n : int
        How many.
    dissimilarity : callable
        Of performances (m, P, n_features): m numbers, each independent of the others.
    threshold : float
        Largest dissimilarity inside.
    random_state : RandomState
    shares : tuple of 2 floats, default=(0.64, 0.36)
        Shares of the variance, of sum 1: of one training performance, and a mixture.

    Returns
    -------
    ndarray, shape (n, P, n_features), of the mean's dtype
        If no training performance is inside, their dissimilarity is up to that of the most
        typical one.
    """
    space = TangentSpace(mean, deviations)
    known = space.coordinates
    of_known = dissimilarity(space.performances(known))
    inside = np.flatnonzero(of_known <= threshold)
    centers = inside if len(inside) else np.array([first_smallest(of_known)])
    own = centers[random_state.randint(len(centers), size=n)]
    weights = _mixtures(own, len(known), *shares, random_state)
    drawn = np.tensordot(weights, known - known.mean(axis=0), axes=1)
    drawn *= _scale(variance, deviations)
    samples = space.performances(drawn)
    outside = np.arange(n)
    for step in range(1, _STEPS + 1):
        outside = outside[dissimilarity(samples[outside]) > threshold]
        if not len(outside):
            break
        share = step / _STEPS
        coordinates = (1 - share) * drawn[outside] + share * known[own[outside]]
        samples[outside] = space.performances(coordinates)
    return samples


def _mixtures(own, n_kept, one, mixed, random_state):
    """Weights (n, n_kept) of mixtures: shares of the variance of one performance, and of all."""
    weights = random_state.standard_normal((len(own), n_kept)) * np.sqrt(mixed / n_kept)
    weights[np.arange(len(own)), own] += np.sqrt(one)
    return weights


def _truncate(z, n_std):
    """Standard normal numbers as truncated normal ones, from -n_std to n_std, in the same order."""
    tail = ndtr(-n_std)
    below = tail + (1 - 2 * tail) * ndtr(-np.abs(z))
    return np.copysign(ndtri(np.maximum(below, np.finfo(float).tiny)), z)


def _scale(variance, deviations):
    """The factor that gives mixtures of the kept deviations the variance of all: 0.5 to 2."""
    kept = deviations.var(axis=0)
    ratio = np.divide(variance, kept, out=np.ones_like(kept), where=kept > 0)
    return np.clip(np.sqrt(ratio), 0.5, 2)


# Directions have the length 1. Interpolation between frames shortens them: the median stays above
# the first; jumps of a tracker shorten some to 0.06 (190 performances of a Kinect).
_MEDIAN_LENGTH, _MIN_LENGTH, _MAX_LENGTH = 0.99, 1e-3, 1 + 1e-3


class TangentSpace:
    """Coordinates of performances about a mean: tangents for directions, differences for numbers.

    Parameters
    ----------
    mean : ndarray, shape (P, n_features)
    deviations : ndarray, shape (n, P, n_features)
        Performances less the mean.

    Attributes
    ----------
    directions : list of slice
        Of features; see `directions_in`.
    coordinates : ndarray, shape (n, P, n_features)
        Of the performances.
    """

    def __init__(self, mean, deviations):
        known = mean + deviations
        self.mean, self.directions = mean, directions_in(known)
        self.coordinates, self._bases = deviations, []
        even = np.full(len(known), 1 / len(known)).reshape(-1, 1)
        if self.directions:
            self.coordinates = deviations.copy()
        for columns in self.directions:
            directions = unit_vectors(known[..., columns])
            base = mean_direction(directions, even)
            self._bases.append(base)
            self.coordinates[..., columns] = log_map(base, directions)

    def performances(self, coordinates):
        """Performances (m, P, n_features) of coordinates: their directions have the length 1."""
        found = self.mean + coordinates
        for columns, base in zip(self.directions, self._bases, strict=True):
            tangents = coordinates[..., columns]
            tangents = tangents - (tangents * base).sum(axis=-1, keepdims=True) * base
            found[..., columns] = exp_map(base, tangents)
        return found.astype(self.mean.dtype)


def directions_in(performances):
    """Features that are directions: three or two columns in a row, of length 1 at all frames.

    Parameters
    ----------
    performances : ndarray, shape (n, P, n_features)

    Returns
    -------
    list of slice
    """
    found, start = [], 0
    squares = np.square(performances.astype(np.float64))
    while start < squares.shape[2]:
        for width in (3, 2):
            columns = slice(start, start + width)
            if columns.stop <= squares.shape[2] and _are_one(squares[..., columns]):
                found.append(columns)
                break
        start = found[-1].stop if found and found[-1].start == start else start + 1
    return found


def _are_one(squares):
    lengths = np.sqrt(squares.sum(axis=-1))
    in_bounds = lengths.min() > _MIN_LENGTH and lengths.max() < _MAX_LENGTH
    return in_bounds and np.median(lengths) > _MEDIAN_LENGTH
