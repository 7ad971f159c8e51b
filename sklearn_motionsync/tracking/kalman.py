"""The Kalman filter of many hypotheses that share one covariance, and so one gain."""

from typing import NamedTuple

import numpy as np

__all__ = ["Correction", "correct", "whitening"]


class Correction(NamedTuple):
    """What an observation does to states.

    Attributes
    ----------
    gain : ndarray, shape (n_states, n_seen)
    rest : ndarray, shape (n_states, n_states)
        ``I - K H``, what is left of a state.
    weigh : ndarray, shape (n_states, n_seen)
        ``H' S^-1``, by which a smoother takes innovations back.
    surprise : ndarray, shape (n,)
        Squared Mahalanobis distances of the innovations, per observed number.
    """

    gain: np.ndarray
    rest: np.ndarray
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
        After it, by Joseph's form, which stays positive.
    Correction
    """
    n_seen, n_features = matrix.shape
    carried = covariance[:, :n_features] @ matrix.T
    spread = matrix @ carried[:n_features]
    spread[np.diag_indices(n_seen)] += noise**2
    whiten = whitening(spread)
    weigh = np.zeros((len(covariance), n_seen))
    weigh[:n_features] = matrix.T @ whiten.T @ whiten
    gain = covariance @ weigh
    rest = np.eye(len(covariance))
    rest[:, :n_features] -= gain @ matrix
    covariance = rest @ covariance @ rest.T + noise**2 * gain @ gain.T
    surprise = np.square(innovations @ whiten.T).sum(axis=1) / n_seen
    return covariance, Correction(gain, rest, weigh, surprise)


def whitening(covariance):
    """A matrix that makes what has this covariance white: the inverse of its Cholesky factor."""
    return np.linalg.inv(np.linalg.cholesky(covariance))
