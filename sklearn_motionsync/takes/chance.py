"""Movements by chance: what a take may hold that is like an action without being it.

An Ornstein-Uhlenbeck process wanders among the postures of the training performances, and forgets
where it was within the length of one of them.
"""

import numpy as np
from scipy.signal import lfilter

from ..matching.filters import SMOOTHING, smooth

__all__ = ["chance_movements"]


def chance_movements(positions, counts):
    """Movements with the mean and the covariance of postures, smooth as those of people.

    Parameters
    ----------
    positions : ndarray, shape (n_sequences, Q, n_features)
        Performances on the clock.
    counts : iterable of int
        How many at a time; always the same ones for the same ``counts``.

    Yields
    ------
    ndarray, shape (count, Q, n_features)
    """
    _, n_positions, n_features = positions.shape
    postures = positions.reshape(-1, n_features)
    center = postures.mean(axis=0)
    _, spread, axes = np.linalg.svd(postures - center, full_matrices=False)
    axes *= spread[:, np.newaxis] / np.sqrt(len(postures))
    kept, rng = np.exp(-1 / n_positions), np.random.default_rng(0)
    for count in counts:
        steps = rng.standard_normal((count, n_positions, len(axes)))
        # Stationary from the first position on.
        steps[:, 1:] *= np.sqrt(1 - kept**2)
        course = lfilter([1], [1, -kept], steps, axis=1)
        yield smooth(course, SMOOTHING * (n_positions - 1)) @ axes + center
