"""Postures and performances like those that were learnt, drawn at random."""

import numpy as np
from scipy.special import ndtr, ndtri

from ..body.limbs import unit_vectors
from ..body.sphere import exp_map, log_map, mean_direction

__all__ = ["PERFORMANCE", "POSTURE", "sample_performances", "sample_postures"]

# Shares of the variance that a drawn posture owes to one training performance, to a mixture of
# all, and to chance in every feature by itself; and a drawn performance to the first two. Chance
# makes tangles; the first keeps bodies in one piece and styles apart (benchmarks/samples.py).
POSTURE = (0.84, 0.14, 0.02)
PERFORMANCE = (0.64, 0.36)
# In so many steps a performance that is outside is drawn in to its training performance.
_STEPS = 4


def sample_postures(mean, variance, deviations, n, n_std, random_state, shares=POSTURE):
    """Postures at a frame, inside the envelope there.

    Each lies about the posture of a training performance chosen at random. As far as nothing is
    cut off their mean is that of the training postures, their variance ``variance``, and their
    covariance is that of the training postures, shrunk a little towards its diagonal (2 %). They
    are cut off feature by feature, by the monotone function that makes a normal distribution one
    that ends at ``n_std``: nothing is rejected, and what belongs together stays together.

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
        Shares of the variance, of sum 1: one training performance's, a mixture's, chance's.

    Returns
    -------
    ndarray, shape (n, n_features), of the mean's dtype
        From ``mean - n_std * sqrt(variance)`` to ``mean + n_std * sqrt(variance)``.
    """
    spread = deviations.std(axis=0)
    shapes = (deviations - deviations.mean(axis=0)) / np.where(spread > 0, spread, 1)
    own = random_state.randint(len(shapes), size=n)
    one, mixed, chance = shares
    z = _mixtures(own, len(shapes), one, mixed, random_state) @ shapes
    z += np.sqrt(chance) * random_state.standard_normal(z.shape)
    with np.errstate(over="ignore"):
        std = np.sqrt(variance)
        lower, upper = mean - n_std * std, mean + n_std * std
    postures = mean + _cut_off(z, n_std) * std
    return np.clip(postures.astype(mean.dtype), lower, upper)


def sample_performances(
    mean, variance, deviations, n, dissimilarity, threshold, random_state, shares=PERFORMANCE
):
    """Whole performances, none more unlike the training ones than a threshold.

    Each is a random mixture of the training performances' deviations, most of it one of them
    that is inside itself, with the variance of all. One that comes out outside is drawn in to that
    training performance, at last as far as it: the mean is no way out, it need not be inside.
    Features that are directions are mixed on the sphere, as tangents at their mean, and keep the
    length 1 (`directions_in`).

    Parameters
    ----------
    mean, variance : ndarray, shape (P, n_features)
        Of the training performances.
    deviations : ndarray, shape (n_kept, P, n_features)
        Training performances less the mean.
    n : int
        How many.
    dissimilarity : callable
        Of performances (m, P, n_features) gives m numbers, none depending on the others.
    threshold : float
        What is inside has no larger one.
    random_state : RandomState
    shares : tuple of 2 floats, default=(0.64, 0.36)
        Shares of the variance, of sum 1: one training performance's, and a mixture's.

    Returns
    -------
    ndarray, shape (n, P, n_features), of the mean's dtype
        If no training performance is inside, some may be as unlike as the most typical one.
    """
    chart = Chart(mean, deviations)
    known = chart.coordinates
    unlike = dissimilarity(chart.performances(known))
    inside = np.flatnonzero(unlike <= threshold)
    homes = inside if len(inside) else np.array([np.argmin(unlike)])
    own = homes[random_state.randint(len(homes), size=n)]
    weights = _mixtures(own, len(known), *shares, random_state)
    drawn = np.tensordot(weights, known - known.mean(axis=0), axes=1)
    drawn *= _scale(variance, deviations)
    samples = chart.performances(drawn)
    outside = np.arange(n)
    for step in range(1, _STEPS + 1):
        # What is no number is not inside.
        outside = outside[~(dissimilarity(samples[outside]) <= threshold)]
        if not len(outside):
            break
        nearer = step / _STEPS
        at = (1 - nearer) * drawn[outside] + nearer * known[own[outside]]
        samples[outside] = chart.performances(at)
    return samples


def _mixtures(own, n_kept, one, mixed, random_state):
    """Weights (n, n_kept) of sums with these shares of the variance: one's own, and all."""
    weights = random_state.standard_normal((len(own), n_kept)) * np.sqrt(mixed / n_kept)
    weights[np.arange(len(own)), own] += np.sqrt(one)
    return weights


def _cut_off(z, n_std):
    """Standard normal numbers as ones between -n_std and n_std, in the same order."""
    tail = ndtr(-n_std)
    below = tail + (1 - 2 * tail) * ndtr(-np.abs(z))
    return np.copysign(ndtri(np.maximum(below, np.finfo(float).tiny)), z)


def _scale(variance, deviations):
    """What gives mixtures of the kept deviations the variance of all of them.

    At most twice or half: few that differ in a feature say little of how all do.
    """
    kept = deviations.var(axis=0)
    with np.errstate(over="ignore"):
        ratio = np.divide(variance, kept, out=np.ones_like(kept), where=kept > 0)
    return np.clip(np.sqrt(ratio), 0.5, 2)


# -- coordinates in which performances are mixed: numbers as they are, directions on the sphere

# Directions are of length 1. Warps that fall between frames shorten them, half of the time by less
# than this, and where trackers leap nearly to nothing: to 0.06 among 190 performances of a Kinect.
_USUALLY, _AT_LEAST, _AT_MOST = 0.99, 1e-3, 1 + 1e-3


class Chart:
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
        """Performances (m, P, n_features) at coordinates: their directions have the length 1."""
        found = self.mean + coordinates
        for columns, base in zip(self.directions, self._bases, strict=True):
            tangents = coordinates[..., columns]
            tangents = tangents - (tangents * base).sum(axis=-1, keepdims=True) * base
            found[..., columns] = exp_map(base, tangents)
        return found.astype(self.mean.dtype)


def directions_in(performances):
    """Which features are directions: three, or two, side by side, of length 1 in all performances.

    Parameters
    ----------
    performances : ndarray, shape (n, P, n_features)

    Returns
    -------
    list of slice
    """
    found, start = [], 0
    with np.errstate(over="ignore"):
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
    in_bounds = lengths.min() > _AT_LEAST and lengths.max() < _AT_MOST
    return in_bounds and np.median(lengths) > _USUALLY
