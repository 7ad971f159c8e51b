"""Directions as points of a sphere: their weighted mean, and what is beyond it."""

import numpy as np

from .limbs import unit

__all__ = ["away", "blended", "mean_direction", "towards", "weighted"]

# Steps to a mean; the directions of a right angle need 40, of a hair's breadth 3.
_STEPS = 100
_NEAR = 1e-14
# A sum of directions that is no longer shows none of its own.
_VANISHING = 1e-9
# A length that is to be less than so much of the shortest of those that are blended is not.
_SHORTEST = 0.5


def towards(base, directions):
    """Tangents at a base that lead to directions: as long as the angle, 0 to the opposite (log)."""
    cosine = (base * directions).sum(axis=-1, keepdims=True)
    across = directions - cosine * base
    sine = np.linalg.norm(across, axis=-1, keepdims=True)
    # Of the opposite nothing but rounding is across.
    shown = sine > 8 * np.finfo(base.dtype).eps
    return across * np.divide(np.arctan2(sine, cosine), sine, out=np.zeros_like(sine), where=shown)


def away(base, tangents):
    """Directions where tangents at a base lead to, on great circles (exp)."""
    angle = np.linalg.norm(tangents, axis=-1, keepdims=True)
    # sin(a) / a
    return unit(np.cos(angle) * base + np.sinc(angle / np.pi) * tangents)


def mean_direction(directions, weights):
    """The direction with the least weighted mean of squared angles (Karcher's mean).

    Weights below 0 lead away from it: ``away(m, sum_i w_i towards(m, u_i))``, where m is the mean
    with the weights above 0. For two directions that is the great circle through them, before,
    between and beyond them.

    Parameters
    ----------
    directions : ndarray, shape (n, ..., d)
        Of length 1.
    weights : ndarray, shape (n, ...)
        Broadcast to the directions; of sum 1 along the first axis.

    Returns
    -------
    ndarray, shape (..., d)
        Where the sum vanishes, of exact opposites, the direction of the largest weight.
    """
    weights = np.broadcast_to(weights, directions.shape[:-1])
    above = np.maximum(weights, 0)
    above = (above / above.sum(axis=0))[..., np.newaxis]
    total = (above * directions).sum(axis=0)
    shown = np.linalg.norm(total, axis=-1, keepdims=True) > _VANISHING
    largest = above.argmax(axis=0)[np.newaxis]
    base = unit(np.where(shown, total, np.take_along_axis(directions, largest, axis=0)[0]))
    for _ in range(_STEPS):
        step = np.where(shown, (above * towards(base, directions)).sum(axis=0), 0)
        base = away(base, step)
        if np.abs(step).max(initial=0) < _NEAR:
            break
    if (weights < 0).any():
        tangent = (weights[..., np.newaxis] * towards(base, directions)).sum(axis=0)
        base = np.where((weights < 0).any(axis=0)[..., np.newaxis], away(base, tangent), base)
    return base


def blended(vectors, weights):
    """Vectors blended in direction, on the sphere, and in length.

    Parameters
    ----------
    vectors : ndarray, shape (n, ..., d)
        None of length 0.
    weights : ndarray, shape (n, ...)
        Broadcast to the vectors; of sum 1 along the first axis.

    Returns
    -------
    ndarray, shape (..., d)
    """
    lengths = weighted(np.linalg.norm(vectors, axis=-1), weights)
    return mean_direction(unit(vectors), weights) * lengths[..., np.newaxis]


def weighted(sizes, weights):
    """Weighted mean of sizes (n, ...) above 0; at least half the smallest of them."""
    return np.maximum((weights * sizes).sum(axis=0), _SHORTEST * sizes.min(axis=0))
