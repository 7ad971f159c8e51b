"""What was hidden, expected given what was seen: postures with gaps, of a normal distribution."""

from __future__ import annotations

import warnings
from typing import NamedTuple

import numpy as np
from scipy.linalg import solveh_banded
from sklearn.exceptions import ConvergenceWarning
from sklearn.utils.extmath import svd_flip

__all__ = ["HiddenNormal", "components_of_seen", "estimate_moments"]

# Noise of the features by which others are predicted, as a share of their variance: few people have
# shown them together. It is near the best in seven sets of people (benchmarks/expectation.py).
SHRINKAGE = 0.1
# A fit ends when hidden values (RMS) and variances change by less, in standard units.
TOLERANCE, MAX_ROUNDS = 1e-4, 500
# A feature is constant if it varies by less than a share of the most varying one.
_CONSTANT = 1e-15
# So many performances tell how fast postures change.
_ENOUGH = 32
# Numbers of a batch: bounds the memory.
BATCH = 1 << 21


class HiddenNormal(NamedTuple):
    """A normal distribution of postures, by which hidden features are expected.

    Postures that are frames of a performance are correlated over time, by ``exp(-t / tau)`` for all
    features alike.

    Attributes
    ----------
    mean, scale : ndarray, shape (n_features,)
        Postures less the mean, divided by the scale, are in standard units.
    precision : ndarray, shape (n_features, n_features)
        The inverse of their covariance in these units, with the variance of a noise.
    tau : float
        In frames; 0 if frames have no order.
    """

    mean: np.ndarray
    scale: np.ndarray
    precision: np.ndarray
    tau: float

    @classmethod
    def of(cls, mean, covariance, arrays):
        """The distribution with these moments, in double precision.

        Parameters
        ----------
        mean : ndarray, shape (n_features,)
        covariance : ndarray, shape (n_features, n_features)
        arrays : list of ndarray (n_frames_i, n_features)
            Performances, with NaN where nothing was seen; empty if frames have no order.
        """
        mean, covariance = (np.asarray(a, dtype=np.float64) for a in (mean, covariance))
        scale = _scale(np.diag(covariance))
        covariance = covariance / np.outer(scale, scale)
        precision = np.linalg.inv(covariance + np.diag(_noise(covariance)))
        return cls(mean, scale, precision, _correlation_time(arrays, mean, scale))

    def fill(self, x, timed):
        """The conditional expectation of a performance given all that was seen of it.

        Parameters
        ----------
        x : ndarray, shape (n_frames, n_features)
            With NaN where nothing was seen.
        timed : bool
            Whether rows are the frames of one performance, in order.

        Returns
        -------
        ndarray of float64, shape (n_frames, n_features)
            Frames in which nothing was seen stay NaN.
        """
        frames = np.flatnonzero(~np.isnan(x).all(axis=1))
        z = (x[frames].astype(np.float64) - self.mean) / self.scale
        hidden = np.isnan(z)
        z[hidden] = 0
        same, next_ = _time_precision(frames, self.tau if timed else 0)
        if not next_.any():
            z = Patterns(hidden).expect(z, self.precision)
        elif hidden.any():
            z[hidden] = _solve(z, hidden, self.precision, same, next_)
        out = x.astype(np.float64)
        out[frames] = np.where(hidden, z * self.scale + self.mean, out[frames])
        return out


def estimate_moments(postures):
    """Mean and covariance of postures with gaps, by expectation and maximisation.

    In every round hidden features are expected given the seen ones of their posture, and the
    moments are those of the postures filled so, with the covariance of what is left unknown.

    Parameters
    ----------
    postures : ndarray, shape (n_postures, n_features)
        With NaN where nothing was seen. Every posture and every feature was seen somewhere.

    Returns
    -------
    mean : ndarray of float64, shape (n_features,)
    covariance : ndarray of float64, shape (n_features, n_features)
        Divided by the number of postures.
    """
    center = np.nanmean(postures, axis=0, dtype=np.float64)
    scale = _scale(np.nanvar(postures, axis=0, dtype=np.float64))
    z = (postures - center) / scale
    hidden = np.isnan(z)
    z[hidden] = 0
    has_gaps = hidden.any(axis=1)
    whole, gappy, hidden = z[~has_gaps], z[has_gaps], hidden[has_gaps]
    sums, squares = whole.sum(axis=0), whole.T @ whole
    patterns, n = Patterns(hidden), len(z)
    variance = np.square(z).sum(axis=0) / (~np.isnan(postures)).sum(axis=0)
    mean, covariance = np.zeros(len(center)), np.diag(variance)
    for round_ in range(MAX_ROUNDS):
        before, known = gappy[hidden], np.diag(covariance)
        noise = _noise(covariance)
        precision = np.linalg.inv(covariance + np.diag(noise))
        gappy = patterns.expect(np.where(hidden, 0, gappy - mean), precision) + mean
        mean = (sums + gappy.sum(axis=0)) / n
        unknown = patterns.left_unknown(precision) - np.diag(hidden.sum(axis=0) * noise)
        covariance = (squares + gappy.T @ gappy + unknown) / n - np.outer(mean, mean)
        change = np.sqrt(np.square(gappy[hidden] - before).sum() / max(len(before), 1))
        change = max(change, np.abs(np.diag(covariance) - known).max())
        # In the first round all features are independent.
        if round_ and change < TOLERANCE:
            break
    else:
        warnings.warn(
            f"The covariance of postures with gaps still changes after {MAX_ROUNDS} rounds: "
            f"{hidden.sum() / z.size:.0%} of all values are missing. Leave out features that are "
            "hardly ever seen, or performances that show little.",
            ConvergenceWarning,
            stacklevel=2,
        )
    return mean * scale + center, covariance * np.outer(scale, scale)


def components_of_seen(postures):
    """Principal components of postures with gaps, as `estimate_moments` takes them.

    Parameters
    ----------
    postures : ndarray, shape (n_postures, n_features)

    Returns
    -------
    mean : ndarray, shape (n_features,)
    components : ndarray, shape (n, n_features)
        As rows, with the signs of scikit-learn's ``PCA``; n is the smaller of the two dimensions.
    variance : ndarray, shape (n,)
        The eigenvalues, the largest first.
    covariance : ndarray of float64, shape (n_features, n_features)
        Divided by the number of postures less 1.
    """
    n, dtype = len(postures), postures.dtype
    mean, covariance = estimate_moments(postures)
    covariance *= n / (n - 1)
    variance, vectors = np.linalg.eigh(covariance)
    largest = slice(None, -1 - min(postures.shape), -1)
    _, components = svd_flip(None, vectors.T[largest], u_based_decision=False)
    variance = np.maximum(variance[largest], 0)
    return mean.astype(dtype), components.astype(dtype), variance.astype(dtype), covariance


class Patterns:
    """Rows by which of their features are hidden: rows of one pattern are computed together.

    Parameters
    ----------
    hidden : ndarray of bool, shape (n_rows, n_features)
        At least one feature of every row is seen.
    """

    def __init__(self, hidden):
        self._shape = hidden.shape
        patterns, of = np.unique(hidden, axis=0, return_inverse=True)
        of, counts = of.ravel(), np.bincount(of.ravel(), minlength=len(patterns))
        order = np.argsort(of, kind="stable")
        first = np.concatenate([[0], np.cumsum(counts)])
        n_hidden = patterns.sum(axis=1)
        # Of a batch: its rows, the patterns of those, the patterns' hidden features, their counts.
        self._batches = []
        for n in np.unique(n_hidden[n_hidden > 0]):
            same = np.flatnonzero(n_hidden == n)
            for some in np.split(same, range(0, len(same), max(1, BATCH // n**2))[1:]):
                rows = np.concatenate([order[first[k] : first[k + 1]] for k in some])
                features = np.nonzero(patterns[some])[1].reshape(-1, n)
                own = np.repeat(np.arange(len(some)), counts[some])
                self._batches.append((rows, own, features, counts[some]))

    def expect(self, z, precision):
        """Rows less their mean, with hidden features expected given the others of the row.

        Parameters
        ----------
        z : ndarray, shape (n_rows, n_features)
            0 where hidden.
        precision : ndarray, shape (n_features, n_features)
        """
        out, pulls = z.copy(), z @ precision
        for rows, own, features, _ in self._batches:
            unknown = self._covariances(precision, features)
            step = max(1, BATCH // features.shape[1] ** 2)
            for k in range(0, len(rows), step):
                some, which = rows[k : k + step, np.newaxis], own[k : k + step]
                at = features[which]
                out[some, at] = -np.einsum("rij,rj->ri", unknown[which], pulls[some, at])
        return out

    def left_unknown(self, precision):
        """The sum over all rows of the covariances of what is hidden, given what is seen.

        Of hidden features with their noise.
        """
        n = self._shape[1]
        total = np.zeros(n * n)
        for _, _, features, counts in self._batches:
            at = features[:, :, np.newaxis] * n + features[:, np.newaxis]
            parts = self._covariances(precision, features) * counts[:, np.newaxis, np.newaxis]
            total += np.bincount(at.ravel(), parts.ravel(), minlength=n * n)
        return total.reshape(n, n)

    @staticmethod
    def _covariances(precision, features):
        return np.linalg.inv(precision[features[:, :, np.newaxis], features[:, np.newaxis]])


def _scale(variance):
    """Standard deviations; 1 of features that are constant."""
    return np.sqrt(np.where(variance > _CONSTANT * variance.max(), variance, 1))


def _noise(covariance):
    """The variance of the noise of each feature, by a covariance in standard units."""
    variance = np.diag(covariance)
    # Constant features have no unit, and predict nothing.
    return np.where(variance > _CONSTANT * max(1, variance.max()), SHRINKAGE * variance, 1)


def _correlation_time(arrays, mean, scale):
    """Frames after which the correlation of postures with later ones has fallen to 1 / e.

    Of many performances a few tell, evenly spread.
    """
    arrays = arrays[:: -(-len(arrays) // _ENOUGH) or 1]
    seen = [~np.isnan(x) for x in arrays]
    centred = [np.where(s, (x - mean) / scale, 0) for x, s in zip(arrays, seen, strict=True)]
    squares = [np.square(z) for z in centred]
    lag, before, longest = 1, 1.0, max(map(len, arrays), default=0)
    while lag < longest:
        products = energy = 0.0
        for z, s, q in zip(centred, seen, squares, strict=True):
            if len(z) > lag:
                products += np.vdot(z[lag:], z[:-lag])
                energy += (q[lag:] * s[:-lag]).sum() / 2 + (q[:-lag] * s[lag:]).sum() / 2
        now = products / energy if energy > 0 else 1.0
        if now < 1 / np.e:
            if lag == 1:
                # Hardly any correlation.
                return float(-1 / np.log(max(now, 0.01)))
            return float(lag - lag / 2 * (1 / np.e - now) / (before - now))
        lag, before = 2 * lag, now
    # Performances shorter than that.
    return float(longest)


def _time_precision(frames, tau):
    """The tridiagonal inverse of ``exp(-|s - t| / tau)`` of frames: its diagonal, and beside it."""
    same = np.ones(len(frames))
    if tau == 0:
        return same, np.zeros(max(len(frames) - 1, 0))
    decay = np.exp(-np.diff(frames) / tau)
    weight = decay / (1 - np.square(decay))
    same[:-1] += decay * weight
    same[1:] += decay * weight
    return same, -weight


def _solve(z, hidden, precision, same, next_):
    """Hidden values of frames, in the order of the mask, given all that was seen.

    The inverse covariance of all values is ``T x precision`` of frames and features, with a
    tridiagonal T: only frames side by side are coupled, and the equations are banded.
    """
    weighted = same[:, np.newaxis] * z
    weighted[1:] += next_[:, np.newaxis] * z[:-1]
    weighted[:-1] += next_[:, np.newaxis] * z[1:]
    pulls = -(weighted @ precision)[hidden]
    frame, feature = np.nonzero(hidden)
    counts = hidden.sum(axis=1)
    width = int((counts[:-1] + counts[1:]).max(initial=counts.max()))
    bands, n = np.zeros((width, len(frame))), len(frame)
    beside = np.append(next_, 0.0)
    for k in range(min(width, n)):
        f, apart = frame[: n - k], frame[k:] - frame[: n - k]
        weight = np.where(apart == 0, same[f], np.where(apart == 1, beside[f], 0))
        bands[k, : n - k] = weight * precision[feature[k:], feature[: n - k]]
    return solveh_banded(bands, pulls, lower=True, overwrite_ab=True, check_finite=False)
