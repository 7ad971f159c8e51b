"""The density of whole trials: curves that vary smoothly and together, and noise."""

import numpy as np
from scipy.linalg import solve_triangular

# Smooth curves are sums of so many bumps, evenly spread over the clock, and of at most one for two
# frames. On 24 actions of people held out the density has 1.48, 1.66, 1.75, 1.78 and 1.78 nats a
# value with 8, 12, 16, 20 and 24.
_N_BUMPS = 16
# Least variance of the noise, as a share of the variance of a feature.
_LEAST_NOISE = 1e-4


class TrialDensity:
    """A normal distribution of whole trials.

    A trial less the mean is, in standard deviations of its features, a smooth curve and noise,
    which is independent at every frame. The covariance of smooth curves over all frames and
    features is that of the training trials, shrunk towards one in which features are independent
    and alike; the share of the latter is that of Ledoit and Wolf (2004).

    Parameters
    ----------
    mean : ndarray, shape (P, n_features)
    trials : ndarray, shape (n, P, n_features), float64
        Training trials, without gaps.
    floor : float
        Least variance of a feature.
    """

    def __init__(self, mean, trials, floor):
        n, n_frames, _ = trials.shape
        deviations = trials - mean
        self._mean = mean
        self._std = np.sqrt(np.maximum(np.square(deviations).mean(axis=(0, 1)), floor))
        deviations = deviations / self._std
        basis = smooth_basis(n_frames)
        weights = np.einsum("pk,npf->nkf", basis, deviations)
        curves = np.einsum("pk,nkf->npf", basis, weights)
        # Of as many frames as there are more than bumps.
        squares = np.square(deviations - curves).sum(axis=1).mean(axis=0)
        self._noise = squares / max(n_frames - basis.shape[1], 1) + _LEAST_NOISE
        share = shrinkage_of(weights.reshape(n, -1))
        of_bumps = np.square(weights).mean(axis=(0, 2))
        self._alone = share * (basis * of_bumps) @ basis.T
        # Noise has the same axes in time for all features.
        self._variances, self._axes = np.linalg.eigh(self._alone)
        self._together = np.sqrt((1 - share) / (n - 1)) * curves

    def log_densities(self, trials):
        """The logarithms of the densities of trials (P, n_features), of what is not NaN."""
        densities, known = np.empty(len(trials)), {}
        for i, trial in enumerate(trials):
            seen = ~np.isnan(trial)
            if seen.tobytes() not in known:
                together, log_scale = self._whitened(self._together, seen)
                inner = np.linalg.cholesky(np.eye(len(together)) + together @ together.T)
                log_scale += np.log(np.diag(inner)).sum() + (seen * np.log(self._std)).sum()
                known[seen.tobytes()] = together, inner, log_scale
            together, inner, log_scale = known[seen.tobytes()]
            (white,), _ = self._whitened(((trial - self._mean) / self._std)[np.newaxis], seen)
            explained = solve_triangular(inner, together @ white, lower=True)
            squares = white @ white - explained @ explained
            densities[i] = -0.5 * (squares + seen.sum() * np.log(2 * np.pi)) - log_scale
        return densities

    def _whitened(self, trials, seen):
        """Values of trials (n, n_seen) of independent features, in units of their covariance.

        With the sum of the logarithms of these units.
        """
        if seen.all():
            scale = np.sqrt(np.maximum(self._variances, 0)[:, np.newaxis] + self._noise)
            white = np.einsum("pq,npf->nqf", self._axes, trials) / scale
            return white.reshape(len(trials), -1), np.log(scale).sum()
        values, log_scale = [], 0.0
        for feature, at in enumerate(seen.T):
            covariance = self._alone[np.ix_(at, at)] + self._noise[feature] * np.eye(at.sum())
            factor = np.linalg.cholesky(covariance)
            values.append(solve_triangular(factor, trials[:, at, feature].T, lower=True).T)
            log_scale += np.log(np.diag(factor)).sum()
        return np.concatenate(values, axis=1), log_scale


def smooth_basis(n_frames):
    """Orthonormal curves (n_frames, n_bumps) that span those of evenly spread bumps."""
    n_bumps = min(_N_BUMPS, (n_frames + 1) // 2)
    t, step = np.linspace(0, 1, n_frames), 1.1 / max(n_bumps - 1, 1)
    centres = np.linspace(-0.05, 1.05, n_bumps) if n_bumps > 1 else np.array([0.5])
    return np.linalg.qr(np.exp(-0.5 * np.square((t[:, np.newaxis] - centres) / step)))[0]


def shrinkage_of(rows):
    """The share of the identity in the covariance of rows (n, n_values) of mean 0.

    That of Ledoit and Wolf (2004), as of `sklearn.covariance.ledoit_wolf_shrinkage`, by products of
    rows instead of columns, of which there are thousands.
    """
    n, width = rows.shape
    products = rows @ rows.T
    squares = np.diag(products)
    norm = np.square(products).sum() / n**2
    apart = norm - squares.mean() ** 2 / width
    error = (np.square(squares).mean() - norm) / n
    return float(np.clip(error / apart, 0, 1)) if apart > 0 else 1.0
