"""Kalman filters of deviations: many hypotheses that share one covariance, and so one gain."""

from typing import NamedTuple

import numpy as np
from scipy.linalg.lapack import dtrtri

__all__ = ["DeviationFilter", "KalmanUpdate", "kalman_update", "squared_norms", "whitening"]

# The innovation covariance is larger by this share, so that rounding leaves the updated covariance
# positive, however small the noise.
_MARGIN = 1e-13


class KalmanUpdate(NamedTuple):
    """The update of states by an observation; ``W' W = S^-1`` for the innovation covariance S.

    Parameters
    ----------
    whitened : ndarray, shape (n, n_seen)
        Whitened innovations ``W v`` of each hypothesis.
    gain_rows : ndarray, shape (n_seen, 2 n_features)
        ``gain_rows' W v = K v``, with the Kalman gain ``K``.
    obs_rows : ndarray, shape (n_seen, n_features)
        ``W H``, the whitened observation matrix.
    """

    whitened: np.ndarray
    gain_rows: np.ndarray
    obs_rows: np.ndarray

    @property
    def nis(self):
        """Normalised innovation squared per observed number: (n,)."""
        return squared_norms(self.whitened) / self.whitened.shape[1]

    @property
    def corrections(self):
        """``K v``: (2, n, n_features)."""
        n_seen, n_features = self.obs_rows.shape
        return self.whitened @ self.gain_rows.reshape(n_seen, 2, n_features).swapaxes(0, 1)


def kalman_update(covariance, matrix, innovations, noise):
    """The Kalman update.

    Parameters
    ----------
    covariance : ndarray, shape (2 n_features, 2 n_features)
        Of the values, then derivatives, before the observation.
    matrix : ndarray, shape (n_seen, n_features)
        ``H``, without rows of missing numbers.
    innovations : ndarray, shape (n, n_seen)
        ``v`` of every hypothesis.
    noise : ndarray, shape (n_seen, n_seen)
        Covariance of the noise of the observation.

    Returns
    -------
    covariance : ndarray, shape (2 n_features, 2 n_features)
        After it: symmetric.
    KalmanUpdate
    """
    n_seen, n_features = matrix.shape
    cross_covariance = covariance[:, :n_features] @ matrix.T
    innovation_covariance = matrix @ cross_covariance[:n_features] + noise
    innovation_covariance[np.diag_indices(n_seen)] *= 1 + _MARGIN
    whiten = whitening(innovation_covariance)
    gain_rows = whiten @ cross_covariance.T
    update = KalmanUpdate(innovations @ whiten.T, gain_rows, whiten @ matrix)
    return covariance - gain_rows.T @ gain_rows, update


def whitening(covariance):
    """The inverse of the Cholesky factor of a covariance."""
    return dtrtri(np.linalg.cholesky(covariance), lower=1)[0]


def squared_norms(vectors):
    """Of vectors (n, n_dims): (n,)."""
    return np.einsum("ij,ij->i", vectors, vectors)


class DeviationFilter:
    """A Kalman filter of the deviations of several hypotheses, from what each expects.

    The covariance depends on what is observed and not on the hypothesis.

    Parameters
    ----------
    process : MaternProcess
    n : int
        Hypotheses.

    Attributes
    ----------
    means : ndarray, shape (2, n, n_features)
        Of values and derivatives.
    covariance : ndarray, shape (2 n_features, 2 n_features)
    """

    def __init__(self, process, n):
        self.process = process
        self.begin(n)

    def begin(self, n):
        """Forget what was observed."""
        self.means = np.zeros((2, n, len(self.process.covariance)))
        self.covariance = self.process.stationary

    @property
    def posture_covariance(self):
        """Of the values: (n_features, n_features)."""
        width = self.means.shape[2]
        return self.covariance[:width, :width]

    def predict(self, dt):
        """Let a time pass."""
        self.means, self.covariance = self.process.predict(self.means, self.covariance, dt)

    def correct(self, residuals, rows, noise, gate=np.inf):
        """Take an observation, unless it is outside the gate of every hypothesis.

        Parameters
        ----------
        residuals : ndarray, shape (n, n_seen)
            Of what is observed, from what each hypothesis expects without a deviation.
        rows : ndarray, shape (n_seen, n_features)
        noise : ndarray, shape (n_seen, n_seen)
        gate : float
            NIS beyond which it is ignored.

        Returns
        -------
        KalmanUpdate or None
            None if it is ignored.
        """
        innovations = residuals - self.means[0] @ rows.T
        # What overflows is outside the gate.
        with np.errstate(over="ignore", invalid="ignore"):
            covariance, update = kalman_update(self.covariance, rows, innovations, noise)
            if not (update.nis <= gate).any():
                return None
        self.means = self.means + update.corrections
        self.covariance = covariance
        return update
