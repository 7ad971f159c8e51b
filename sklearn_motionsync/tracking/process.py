"""How postures depart from the mean: a Gaussian process in time, and the pace of people."""

from typing import NamedTuple

import numpy as np

__all__ = ["Pace", "Process", "left_out", "shrunk_covariance"]

# How far a covariance is drawn to its diagonal.
_SHRINKAGE = 0.5
# Smallest variance of a feature, as a share of the largest: one in which nobody differed, too.
_FLOOR = 1e-9
# Where the Matern-3/2 correlation (1 + x) exp(-x) is a half.
_HALF = 1.6783469900166605
# Rates beyond these, in either direction, are pauses or misses of a warp, and tell nothing.
_FASTEST = 4.0


class Process(NamedTuple):
    """A Matern-3/2 process of several features, whose states are values and their derivatives.

    ``k(s) = (1 + l s) exp(-l s) C`` for elapsed time ``s``; so the derivative has the covariance
    ``l^2 C`` and is independent of the value at the same time.

    Attributes
    ----------
    covariance : ndarray, shape (n_features, n_features)
        ``C``, of the values.
    decay : float
        ``l = sqrt(3) / length scale``, per frame.
    """

    covariance: np.ndarray
    decay: float

    @classmethod
    def learn(cls, deviations, step):
        """The process behind what performances differ by from the mean of others.

        Parameters
        ----------
        deviations : ndarray, shape (n, P, n_features)
        step : float
            Time between two of their frames.
        """
        covariance = shrunk_covariance(deviations)
        # Each feature counts by its own spread, so that units do not matter.
        lag = _lag_of(deviations / np.sqrt(np.diag(covariance)), 0.5)
        return cls(covariance, _HALF / (lag * step))

    @property
    def length_scale(self):
        return float(np.sqrt(3) / self.decay)

    @property
    def stationary(self):
        """Covariance of the states (2 n_features, 2 n_features) when nothing has been seen."""
        return np.kron(np.diag([1.0, self.decay**2]), self.covariance)

    def transition(self, dt):
        """How states (value, derivative) go on over a time: (2, 2), the same for all features."""
        decay = self.decay
        rows = [[1 + decay * dt, dt], [-(decay**2) * dt, 1 - decay * dt]]
        return np.exp(-decay * dt) * np.array(rows)

    def predict(self, means, covariance, dt):
        """States after a time in which nothing is seen.

        Parameters
        ----------
        means : ndarray, shape (2, n, n_features)
            Of n hypotheses: their values, then derivatives.
        covariance : ndarray, shape (2 n_features, 2 n_features)
        dt : float

        Returns
        -------
        means, covariance
        """
        here = self.transition(dt)
        means = (here @ means.reshape(2, -1)).reshape(means.shape)
        for _ in range(2):
            covariance = (here @ covariance.reshape(2, -1)).reshape(covariance.shape).T
        # Q = S - A S A', so that what is stationary stays.
        powers = np.diag([1.0, self.decay**2])
        pushed = (powers - here @ powers @ here.T)[:, np.newaxis, :, np.newaxis]
        blocks = pushed * self.covariance[:, np.newaxis]
        return means, covariance + blocks.reshape(covariance.shape)


class Pace(NamedTuple):
    """How fast people go through an action: a log rate about 0 that forgets.

    Attributes
    ----------
    spread : float
        Standard deviation of the log rate.
    memory : float
        Time after which its correlation is 1/e.
    """

    spread: float
    memory: float

    def begin(self, rng, n):
        """Log rates of performances that nothing is known of: (n,)."""
        return self.spread * rng.standard_normal(n)

    def expect(self, logs, dt):
        """Log rates to be expected after a time, and the standard deviation about them."""
        kept = np.exp(-dt / self.memory)
        return kept * logs, self.spread * np.sqrt(1 - kept**2)

    @classmethod
    def learn(cls, rates, step):
        """From rates (n, P) of performances along the clock, whose frames are a step apart."""
        logs = np.log(np.clip(rates, 1 / _FASTEST, _FASTEST))
        spread = float(np.sqrt(np.square(logs).mean()))
        return cls(spread, _lag_of(logs[:, :, np.newaxis], np.exp(-1)) * step)


def left_out(performances, groups):
    """What every performance differs by from the mean of those of other groups.

    Parameters
    ----------
    performances : ndarray, shape (n, P, n_features)
    groups : ndarray of int, shape (n,)
        At least two, counted from 0.
    """
    counts = np.bincount(groups)[:, np.newaxis, np.newaxis]
    sums = np.zeros((len(counts), *performances.shape[1:]))
    np.add.at(sums, groups, performances)
    others = (sums.sum(axis=0) - sums) / (len(performances) - counts)
    return performances - others[groups]


def shrunk_covariance(deviations):
    """Second moments of deviations from 0, half-way to their diagonal, which is nowhere 0."""
    flat = deviations.reshape(-1, deviations.shape[-1])
    moments = flat.T @ flat / len(flat)
    variances = np.diag(moments).copy()
    largest = variances.max() if variances.max() > 0 else 1.0
    moments *= 1 - _SHRINKAGE
    np.fill_diagonal(moments, np.maximum(variances, _FLOOR * largest))
    return moments


def _lag_of(series, level):
    """Frames after which the autocorrelation about 0 of (n, P, n_features) falls to a level.

    It is that of all frames where it never does, or there is nothing to correlate.
    """
    n_frames, power, before = series.shape[1], float(np.square(series).mean()), 1.0
    for lag in range(1, n_frames if power > 0 else 1):
        now = float((series[:, lag:] * series[:, :-lag]).mean()) / power
        if now <= level:
            return lag - 1 + (before - level) / (before - now)
        before = now
    return float(n_frames)
