"""Directions as points of the unit sphere: logarithmic and exponential map, and weighted means."""

import numpy as np

from ..matching.counting import first_largest
from .limbs import unit_vectors

# Iterations of a mean: directions of a right angle need 40, nearly equal ones 3.
_MAX_ITER = 100
_TOLERANCE = 1e-14
# A shorter sum of directions has no direction of its own.
_VANISHING = 1e-9
# Lower bound of a mean length, as a share of the shortest one.
_LEAST_SHARE = 0.5


def log_map(base, directions):
    """Tangents at a base towards directions, as long as the angle; 0 for the opposite direction."""
    cosine = (base * directions).sum(axis=-1, keepdims=True)
    across = directions - cosine * base
    sine = np.linalg.norm(across, axis=-1, keepdims=True)
    # For the opposite direction, the perpendicular part is rounding.
    shown = sine > 8 * np.finfo(base.dtype).eps
    return across * np.divide(np.arctan2(sine, cosine), sine, out=np.zeros_like(sine), where=shown)


def exp_map(base, tangents):
    """Directions at the ends of tangents at a base, along great circles."""
    angle = np.linalg.norm(tangents, axis=-1, keepdims=True)
    # sin(a) / a
    return unit_vectors(np.cos(angle) * base + np.sinc(angle / np.pi) * tangents)


def mean_direction(directions, weights):
    """The direction with the least weighted mean of squared angles (the Karcher mean).

    Negative weights extrapolate: ``exp_map(m, sum_i w_i log_map(m, u_i))``, where m is the mean
    with the positive weights. For two directions that is the great circle through them.

    Parameters
    ----------
    directions : ndarray, shape (n, ..., d)
        Unit vectors.
    weights : ndarray, shape (n, ...)
        Broadcast to the directions; of sum 1 along the first axis.

    Returns
    -------
    ndarray, shape (..., d)
        Where the weighted sum vanishes, as for opposite directions, the direction with the largest
        weight.
    """
    weights = np.broadcast_to(weights, directions.shape[:-1])
    positive = np.maximum(weights, 0)
    positive = (positive / positive.sum(axis=0))[..., np.newaxis]
    total = (positive * directions).sum(axis=0)
    shown = np.linalg.norm(total, axis=-1, keepdims=True) > _VANISHING
    largest = first_largest(positive, axis=0)[np.newaxis]
    base = unit_vectors(np.where(shown, total, np.take_along_axis(directions, largest, axis=0)[0]))
    for _ in range(_MAX_ITER):
        step = np.where(shown, (positive * log_map(base, directions)).sum(axis=0), 0)
        base = exp_map(base, step)
        if np.abs(step).max(initial=0) < _TOLERANCE:
            break
    if (weights < 0).any():
        tangent = (weights[..., np.newaxis] * log_map(base, directions)).sum(axis=0)
        base = np.where((weights < 0).any(axis=0)[..., np.newaxis], exp_map(base, tangent), base)
    return base


def mean_vector(vectors, weights):
    """The weighted mean direction (..., d) of vectors, times their weighted mean length.

    The vectors (n, ..., d) have a length above 0, and the weights (n, ...), which are broadcast to
    them, the sum 1 along the first axis.
    """
    lengths = mean_length(np.linalg.norm(vectors, axis=-1), weights)
    return mean_direction(unit_vectors(vectors), weights) * lengths[..., np.newaxis]


def mean_length(lengths, weights):
    """Weighted mean of lengths (n, ...) above 0; at least half the shortest of them."""
    return np.maximum((weights * lengths).sum(axis=0), _LEAST_SHARE * lengths.min(axis=0))
