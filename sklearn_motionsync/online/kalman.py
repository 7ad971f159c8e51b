"""The Kalman filter of many hypotheses that share one covariance, and so one gain."""

from typing import NamedTuple

import numpy as np
from scipy.linalg.lapack import dtrtri

__all__ = ["Correction", "correct", "squared_lengths", "whitening"]

# By such a share the spread of innovations is taken larger, so that what it leaves of a covariance
# is none below 0 by rounding, however small the noise.
_MARGIN = 1e-13


class Correction(NamedTuple):
    """What an observation does to states, with ``W' W = S^-1`` of the spread of innovations.

    Attributes
    ----------
    white : ndarray, shape (n, n_seen)
        Innovations made white, ``W v`` of each.
    told : ndarray, shape (n_seen, 2 n_features)
        What of the states each white number tells: ``told' white = K v``, with the gain ``K``.
    looks : ndarray, shape (n_seen, n_features)
        ``W H``, what white numbers are of the values.
    """

    white: np.ndarray
    told: np.ndarray
    looks: np.ndarray

    @property
    def surprise(self):
        """Squared Mahalanobis distances of the innovations, per observed number: (n,)."""
        return squared_lengths(self.white) / self.white.shape[1]

    @property
    def moves(self):
        """What the means of the states move by: (2, n, n_features)."""
        n_seen, n_features = self.looks.shape
        return self.white @ self.told.reshape(n_seen, 2, n_features).swapaxes(0, 1)


def correct(covariance, matrix, innovations, noise):
    """How states are corrected by what is seen of their values.

    Parameters
    ----------
    covariance : ndarray, shape (2 n_features, 2 n_features)
        Of all hypotheses, before the observation: of their values, then derivatives.
    matrix : ndarray, shape (n_seen, n_features)
        What is seen of the values; nothing that is missing is a row.
    innovations : ndarray, shape (n, n_seen)
        Of every hypothesis.
    noise : float
        Standard deviation of the observation.

    Returns
    -------
    covariance : ndarray, shape (2 n_features, 2 n_features)
        After it: symmetric, as a square of the Cholesky form is taken away.
    Correction
    """
    n_seen, n_features = matrix.shape
    carried = covariance[:, :n_features] @ matrix.T
    spread = matrix @ carried[:n_features]
    diagonal = np.diag_indices(n_seen)
    spread[diagonal] = (spread[diagonal] + noise**2) * (1 + _MARGIN)
    whiten = whitening(spread)
    told = whiten @ carried.T
    correction = Correction(innovations @ whiten.T, told, whiten @ matrix)
    return covariance - told.T @ told, correction


def whitening(covariance):
    """A matrix that makes what has this covariance white: the inverse of its Cholesky factor."""
    return dtrtri(np.linalg.cholesky(covariance), lower=1)[0]


def squared_lengths(vectors):
    """Of vectors (n, n_dims): (n,)."""
    return np.einsum("ij,ij->i", vectors, vectors)
