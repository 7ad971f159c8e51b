"""Variance and bands of new people, a confidence band of the mean, and random trials.

Trials of one person resemble each other, so all is estimated from how people differ from
*other* people. Functions of plain arrays; features may have different units.
"""

import numpy as np
from scipy.special import ndtr, ndtri
from sklearn.utils import check_random_state

from ..body.limbs import unit_vectors
from ..body.sphere import exp_map, log_map, mean_direction
from ..matching.counting import first_smallest
from ..matching.gaps import is_gappy
from ..utils.groups import group_counts, mean_of_others, sums_of_groups
from .acceptance import LogMoments

# A variance is shrunk to its mean over the frames, which weighs as much as so many trials.
_SHRINKAGE = 5
# Prior variance of the logarithm of the largest deviation: it is 0.05 to 0.3 in the classes of
# HDM05 and UTKinect; and that of two trials, where no variance can be left out.
_PRIOR_VARIANCE, _VAGUE_VARIANCE = 0.1, 1.0
# Lower bounds of a largest deviation: so many standard deviations, and so much below the median
# in the logarithm.
_LEAST, _BELOW_MEDIAN = 0.1, 1.0
# Variance within people as a share of the predictive variance: the geometric mean over six classes
# of HDM05 and five exercises of UI-PRMD, where it is 0.09 to 0.76.
_WITHIN_SHARE = 0.32
# Smallest variance, as a share of that of the feature over all frames and trials. A feature
# is constant if it varies by less than a share of the most varying one, whose floor it gets.
_FLOOR, _CONSTANT = 1e-9, 1e-15
# Bootstrap samples, and the fewest of the group means among each other.
_N_DRAWS, _MIN_DRAWS = 2000, 50


def predictive_variance(trials, groups, shrinkage=_SHRINKAGE):
    """Variance of a new person's poses about the mean of the trials.

    ``v = ((n - 1) s^2 + k mean(s^2)) / (n - 1 + k) (1 + 1 / n)``, where ``s^2`` is the mean squared
    deviation of trials from the mean of all trials of *other* groups, and its mean
    is that over the frames, feature by feature.

    Parameters
    ----------
    trials : ndarray, shape (n, P, n_features)
        At least 2. NaN in gaps: then n is the number of deviations that are known of a value.
    groups : ndarray of int, shape (n,)
        If all are of one group, each trial counts as a group of its own.
    shrinkage : float, default=5
        ``k``: the mean over the frames weighs as much as so many trials.

    Returns
    -------
    ndarray, shape (P, n_features)
        Positive, also where trials do not differ.
    """
    squares = np.square(trials - mean_of_others(trials, _at_least_two(groups)))
    n_known = (~np.isnan(squares)).sum(axis=0)
    n = np.maximum(n_known, 1)
    squares = np.where(n_known > 0, np.nansum(squares, axis=0) / n, np.nan)
    return np.maximum(_shrink(squares, n, shrinkage) * (1 + 1 / n), _floor(trials))


def within_variance(trials, groups):
    """Variance of a person's poses about the mean of this person, pooled over the people.

    ``w = (d s^2 + k mean(s^2)) / (d + k)``, where ``s^2`` is the sum of the squared deviations from
    the mean of the own group, divided by their degrees of freedom ``d``: trials less groups,
    of groups of at least two. The mean is that over the frames, feature by feature. A new
    trial of a person deviates from the mean of n others by ``w (1 + 1 / n)``.

    Parameters
    ----------
    trials : ndarray, shape (n, P, n_features)
        At least 2. NaN in gaps: then d is that of a value.
    groups : ndarray of int, shape (n,)
        In a feature that no group shows twice, the variance is 0.32 times `predictive_variance`:
        the geometric mean over eleven actions of HDM05 and UI-PRMD, where it is 0.09 to 0.76.

    Returns
    -------
    ndarray, shape (P, n_features)
        Positive, also where trials do not differ.
    """
    codes = np.unique(groups, return_inverse=True)[1].ravel()
    counts = group_counts(trials, codes)
    sums = sums_of_groups(np.nan_to_num(trials), codes)[0]
    means = sums / np.maximum(counts, 1)
    freedom = np.maximum(counts - 1, 0).sum(axis=0)
    squares = np.nansum(np.square(trials - means[codes]), axis=0)
    squares = np.where(freedom > 0, squares / np.maximum(freedom, 1), np.nan)
    # The shrinkage counts trials, one more than degrees of freedom.
    variance = np.maximum(_shrink(squares, freedom + 1, _SHRINKAGE), _floor(trials))
    unknown = ~freedom.any(axis=0)
    if unknown.any():
        unseen = trials[..., unknown]
        variance[:, unknown] = _WITHIN_SHARE * predictive_variance(unseen, codes)
    return variance


def simultaneous_factor(trials, groups, coverage):
    """The c for which a share of whole trials of new people lies within mean +- c sqrt(v).

    ``v`` is the predictive variance. Each group is left out in turn and compared with the mean and
    the variance of the others. The logarithms of the largest ``|z|`` of its trials, over all
    frames and features, predict that of a new person by a Student t distribution. Their
    variance has a prior of 0.1, which weighs as much as 3 trials.

    Of new people of HDM05 and UTKinect a band of nominal 95 % holds 94 to 97 % of the
    trials in the aSpace and 97 to 100 % in poses, of 5 to 20 training ones; without
    groups, of 10 or more, 76 to 85 % of those of HDM05, where people came about six times.

    Parameters
    ----------
    trials : ndarray, shape (n, P, n_features)
    groups : ndarray of int, shape (n,)
    coverage : float
        Share of the trials, between 0 and 1.

    Returns
    -------
    float
    """
    codes, prior = _at_least_two(groups), _PRIOR_VARIANCE
    mean = mean_of_others(trials, codes)
    largest = np.empty(len(trials))
    for group in range(codes.max() + 1):
        out = codes == group
        compared = ~out
        if compared.sum() == 1:
            # A single trial has no variance: that of both takes its place.
            compared, prior = slice(None), _VAGUE_VARIANCE
        variance = predictive_variance(trials[compared], codes[compared])
        z = (trials[out] - mean[out]) / np.sqrt(variance)
        # Of what was seen.
        largest[out] = np.fmax.reduce(np.abs(z), axis=(1, 2), initial=0)
    logs = np.log(np.maximum(largest, _LEAST))
    logs = np.maximum(logs, np.median(logs) - _BELOW_MEDIAN)
    return LogMoments.of_logs(logs).upper_limit(coverage, prior)


def mean_band(trials, groups, coverage, random_state=None):
    """Half-widths of a simultaneous confidence band of the *population's* mean.

    The population's mean is that of a new person's trials, where people are a random sample
    and do not depend on how many trials they have. Its estimate is the mean of the
    trials, in which a group weighs as much as it has trials. Its variance is that of
    the jackknife by groups, shrunk towards its mean over the frames. The factor is the quantile of
    the largest ``|t|`` over all frames and features in a studentised bootstrap over groups: as many
    groups with as many trials are drawn from the normal distribution with the covariance of
    the group means, and mean and variance are estimated from each draw.

    In simulations with 4 to 20 people of 1 to 5 trials each, a band of nominal 95 % holds the
    mean in 92 to 99 % of the cases; one of nominal 80 % in 67 to 78 %.

    Parameters
    ----------
    trials : ndarray, shape (n, P, n_features)
    groups : ndarray of int, shape (n,)
    coverage : float
        Probability that the band holds the mean at all frames and in all features.
    random_state : int, RandomState instance or None, default=None

    Returns
    -------
    ndarray, shape (P, n_features)
    """
    random_state = check_random_state(random_state)
    codes = _at_least_two(groups)
    sums, counts = sums_of_groups(np.nan_to_num(trials), codes)[0], group_counts(trials, codes)
    n_groups, shape, floor = len(sums), trials.shape[1:], _floor(trials) / len(trials)
    # Each value has weights of its own: a group that does not show it has none.
    shown = (counts > 0).reshape(n_groups, -1)
    weights, n_seen = (counts / counts.sum(axis=0)).reshape(n_groups, -1), shown.sum(axis=0)
    # Without group g the mean changes by w_g / (1 - w_g) (mean - mean_g).
    jackknife = (1 - 1 / n_seen) * np.square(weights / (1 - weights))

    def estimate(means):
        mean = np.einsum("gv,gv->v", weights, means)
        squares = np.einsum("gv,gv->v", jackknife, np.square(means - mean)).reshape(shape)
        variance = _shrink(squares, n_seen.reshape(shape))
        return mean, np.sqrt(np.maximum(variance, floor)).ravel()

    means = (sums / np.maximum(counts, 1)).reshape(n_groups, -1)
    scatter = np.where(shown, means - means.sum(axis=0) / n_seen, 0) / np.sqrt(n_seen - 1)
    # Drawn means about their average are independent of that average: each draw of the former,
    # which takes longer, is combined with several of the latter. Few groups vary most.
    n_draws = max(_N_DRAWS // n_groups, _MIN_DRAWS)
    largest = np.empty((n_draws, -(-_N_DRAWS // n_draws)))
    for row in largest:
        drawn = random_state.standard_normal((n_groups, n_groups))
        off, error = estimate((drawn - drawn.mean(axis=0)) @ scatter)
        drawn = random_state.standard_normal((len(row), n_groups)) / np.sqrt(n_groups)
        row[:] = np.abs((drawn @ scatter + off) / error).max(axis=1)
    return np.quantile(largest, coverage) * estimate(means)[1].reshape(shape)


def clock_error(mean, lower, upper):
    """Standard error of a mean trial by that of the clock: (P, n_features).

    Parameters
    ----------
    mean : ndarray, shape (P, n_features)
    lower, upper : ndarray, shape (n_sequences, P)
        Intervals of one standard error about the times of trials.
    """
    error = (upper - lower).mean(axis=0) / 2
    return np.abs(np.gradient(mean, axis=0)) * error[:, np.newaxis]


def _at_least_two(groups):
    """Codes of the groups; of a single group, every trial is one of its own."""
    codes = np.unique(groups, return_inverse=True)[1].ravel()
    return codes if codes.max() > 0 else np.arange(len(codes))


def _shrink(squares, n, shrinkage=_SHRINKAGE):
    """Variances (P, n_features) shrunk towards their mean over the frames.

    Where one is not known (NaN) it is that mean.
    """
    is_known = ~np.isnan(squares)
    mean = np.nansum(squares, axis=0) / np.maximum(is_known.sum(axis=0), 1)
    return np.where(is_known, ((n - 1) * squares + shrinkage * mean) / (n - 1 + shrinkage), mean)


def _floor(trials):
    var = np.nanvar if is_gappy(trials) else np.var
    spread = var(trials, axis=(0, 1))
    largest = spread.max() if spread.max() > 0 else 1.0
    return _FLOOR * np.where(spread > _CONSTANT * largest, spread, largest)


# -- new trials ------------------------------------------------------------------------------

# Shares of the variance of a sampled pose: of one training trial, of a mixture of all,
# and of noise that is independent in every feature. Noise tangles limbs; the first keeps bodies in
# one piece and styles apart (docs/design.md).
_POSE = (0.84, 0.14, 0.02)
# A trial that is outside reaches its training trial in so many steps.
_STEPS = 4


def sample_poses(mean, variance, deviations, n, n_std, random_state):
    """Sample poses at a frame, inside the envelope there.

    Each is near the pose of a training trial chosen at random. Before truncation their
    mean is that of the training poses, their variance ``variance``, and their
    covariance is that of the training poses, shrunk a little towards its diagonal (2 %).
    Each feature is truncated by the monotone function that makes a normal distribution a truncated
    one: no sample is rejected, and features keep their correlations.

    Parameters
    ----------
    mean, variance : ndarray, shape (n_features,)
        Of the training poses.
    deviations : ndarray, shape (n_kept, n_features)
        Training poses less the mean, in the same units.
    n : int
        How many.
    n_std : float
        Half-width of the envelope, in standard deviations.
    random_state : RandomState

    Returns
    -------
    ndarray, shape (n, n_features), of the mean's dtype
        From ``mean - n_std * sqrt(variance)`` to ``mean + n_std * sqrt(variance)``.
    """
    spread = deviations.std(axis=0)
    shapes = (deviations - deviations.mean(axis=0)) / np.where(spread > 0, spread, 1)
    chosen = random_state.randint(len(shapes), size=n)
    one, mixed, noise = _POSE
    weights = random_state.standard_normal((n, len(shapes))) * np.sqrt(mixed / len(shapes))
    weights[np.arange(n), chosen] += np.sqrt(one)
    z = weights @ shapes
    z += np.sqrt(noise) * random_state.standard_normal(z.shape)
    std = np.sqrt(variance)
    lower, upper = mean - n_std * std, mean + n_std * std
    poses = mean + _truncate(z, n_std) * std
    return np.clip(poses.astype(mean.dtype), lower, upper)


def sample_trials(mean, variance, deviations, n, dissimilarity, threshold, random_state):
    """Sample whole trials, of a dissimilarity up to a threshold.

    Each is a random mixture of the deviations of all training trials, with the variance of all. A
    sample outside moves in steps to a training trial that is inside; not to the mean, which need
    not be. Features that are directions are mixed
    in the tangent space of the sphere at their mean, and keep the length 1 (`directions_in`).

    Parameters
    ----------
    mean, variance : ndarray, shape (P, n_features)
        Of the training trials.
    deviations : ndarray, shape (n_kept, P, n_features)
        Training trials less the mean.
    n : int
        How many.
    dissimilarity : callable
        Of trials (m, P, n_features): m numbers, each independent of the others.
    threshold : float
        Largest dissimilarity inside.
    random_state : RandomState

    Returns
    -------
    ndarray, shape (n, P, n_features), of the mean's dtype
        If no training trial is inside, their dissimilarity is up to that of the most typical one.
    """
    space = TangentSpace(mean, deviations)
    known = space.coordinates
    of_known = dissimilarity(space.trials(known))
    inside = np.flatnonzero(of_known <= threshold)
    centers = inside if len(inside) else np.array([first_smallest(of_known)])
    chosen = centers[random_state.randint(len(centers), size=n)]
    weights = random_state.standard_normal((n, len(known))) / np.sqrt(len(known))
    drawn = np.tensordot(weights, known - known.mean(axis=0), axes=1)
    drawn *= _scale(variance, deviations)
    samples = space.trials(drawn)
    outside = np.arange(n)
    for step in range(1, _STEPS + 1):
        outside = outside[dissimilarity(samples[outside]) > threshold]
        if not len(outside):
            break
        share = step / _STEPS
        coordinates = (1 - share) * drawn[outside] + share * known[chosen[outside]]
        samples[outside] = space.trials(coordinates)
    return samples


def _truncate(z, n_std):
    """Standard normal numbers as truncated normal ones, from -n_std to n_std, in the same order."""
    tail = ndtr(-n_std)
    below = tail + (1 - 2 * tail) * ndtr(-np.abs(z))
    return np.copysign(ndtri(np.maximum(below, np.finfo(float).tiny)), z)


def _scale(variance, deviations):
    """The factor that gives mixtures of the kept deviations the variance of all: 0.5 to 2."""
    of_kept = deviations.var(axis=0)
    ratio = np.divide(variance, of_kept, out=np.ones_like(of_kept), where=of_kept > 0)
    return np.clip(np.sqrt(ratio), 0.5, 2)


# Directions have the length 1. Interpolation between frames shortens them: the median stays above
# the first; jumps of a tracker shorten some to 0.06 (190 trials of a Kinect).
_MEDIAN_LENGTH, _MIN_LENGTH, _MAX_LENGTH = 0.99, 1e-3, 1 + 1e-3


class TangentSpace:
    """Coordinates of trials about a mean: tangents for directions, differences for numbers.

    Parameters
    ----------
    mean : ndarray, shape (P, n_features)
    deviations : ndarray, shape (n, P, n_features)
        Trials less the mean.

    Attributes
    ----------
    directions : list of slice
        Of features; see `directions_in`.
    coordinates : ndarray, shape (n, P, n_features)
        Of the trials.
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

    def trials(self, coordinates):
        """Trials (m, P, n_features) of coordinates: their directions have the length 1."""
        out = self.mean + coordinates
        for columns, base in zip(self.directions, self._bases, strict=True):
            tangents = coordinates[..., columns]
            tangents = tangents - (tangents * base).sum(axis=-1, keepdims=True) * base
            out[..., columns] = exp_map(base, tangents)
        return out.astype(self.mean.dtype)


def directions_in(trials):
    """Features that are directions: three or two columns in a row, of length 1 at all frames.

    Parameters
    ----------
    trials : ndarray, shape (n, P, n_features)

    Returns
    -------
    list of slice
    """
    directions, start = [], 0
    squares = np.square(trials.astype(np.float64))
    while start < squares.shape[2]:
        for width in (3, 2):
            columns = slice(start, start + width)
            if columns.stop <= squares.shape[2] and _are_one(squares[..., columns]):
                directions.append(columns)
                break
        start = directions[-1].stop if directions and directions[-1].start == start else start + 1
    return directions


def _are_one(squares):
    lengths = np.sqrt(squares.sum(axis=-1))
    in_bounds = lengths.min() > _MIN_LENGTH and lengths.max() < _MAX_LENGTH
    return in_bounds and np.median(lengths) > _MEDIAN_LENGTH
