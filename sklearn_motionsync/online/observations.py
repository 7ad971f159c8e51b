"""What a tracker observes of a posture: an observation matrix and the covariance of the noise."""

from typing import NamedTuple

import numpy as np

from ..inputs.numbers import as_numbers, check_finite, check_magnitude

__all__ = ["Observer", "check_projection"]


class Observer(NamedTuple):
    """``y = matrix @ posture + noise``.

    Parameters
    ----------
    matrix : ndarray, shape (n_observed, n_features)
    noise : ndarray, shape (n_observed, n_observed)
        Covariance of the noise.
    """

    matrix: np.ndarray
    noise: np.ndarray

    def of(self, chosen):
        """Of the observed numbers with this mask alone."""
        return Observer(self.matrix[chosen], self.noise[np.ix_(chosen, chosen)])


def check_projection(projection, n_features):
    """The observation matrix (n_observed, n_features) and its offset (n_observed,), checked.

    Parameters
    ----------
    projection : array-like, pair of two of them, or None
        A matrix; or it and the offset; None is the identity.
    n_features : int

    Returns
    -------
    matrix, offset : ndarray

    Raises
    ------
    ValueError
        If the matrix is not of this width, or anything is not finite or above 1e9, or there is not
        one offset for each of its rows.
    """
    if projection is None:
        return np.eye(n_features), np.zeros(n_features)
    pair = projection if isinstance(projection, tuple) else (projection,)
    pair = [as_numbers(part, "The projection", dtype=np.float64) for part in pair]
    shapes, n = [part.shape for part in pair], len(np.atleast_1d(pair[0]))
    if n == 0 or shapes not in ([(n, n_features)], [(n, n_features), (n,)]):
        raise ValueError(
            f"projection must be a matrix (n_observed, {n_features}), or the pair (matrix, offset) "
            f"with an offset (n_observed,); got the shapes {shapes}."
        )
    matrix, offset = pair if len(pair) == 2 else (pair[0], np.zeros(n))
    both = np.column_stack([matrix, offset])
    check_finite(both, "The projection, row")
    check_magnitude(float(np.abs(both).max()), "The projection", training=False)
    return matrix, offset
