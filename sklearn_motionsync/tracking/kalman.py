"""The Kalman filter of many hypotheses that share one covariance, and so one gain."""

from typing import NamedTuple

import numpy as np
from scipy.linalg.lapack import dtrtri

__all__ = ["Correction", "correct", "whitening"]

# By such a share the spread of innovations is taken larger, so that what it leaves of a covariance
# is none below 0 by rounding, however small the noise.
_MARGIN = 1e-13


class Correction(NamedTuple):
    """What an observation does to states.

    Attributes
    ----------
    gain : ndarray, shape (n_states, n_seen)
    weigh : ndarray, shape (n_features, n_seen)
        ``H' S^-1``, by which a smoother takes innovations back.
    surprise : ndarray, shape (n,)
        Squared Mahalanobis distances of the innovations, per observed number.
    """

    gain: np.ndarray
    weigh: np.ndarray
    surprise: np.ndarray


def correct(covariance, matrix, innovations, noise):
    """How states are corrected by what is seen of their values.

    Parameters
    ----------
    covariance : ndarray, shape (n_states, n_states)
        Of all hypotheses, before the observation.
    matrix : ndarray, shape (n_seen, n_features)
        What is seen of the first ``n_features`` states; nothing that is missing is a row.
    innovations : ndarray, shape (n, n_seen)
        Of every hypothesis.
    noise : float
        Standard deviation of the observation.

    Returns
    -------
    covariance : ndarray, shape (n_states, n_states)
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
    surprise = np.square(innovations @ whiten.T).sum(axis=1) / n_seen
    correction = Correction(told.T @ whiten, matrix.T @ whiten.T @ whiten, surprise)
    return covariance - told.T @ told, correction


def whitening(covariance):
    """A matrix that makes what has this covariance white: the inverse of its Cholesky factor."""
    return dtrtri(np.linalg.cholesky(covariance), lower=1)[0]
