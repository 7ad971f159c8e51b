"""How a performance was recorded, which synchronisation hides: its course, duration and energy."""

import numpy as np

from .likeness import Logs, Neighbours, learn_reach
from .stream import spread_out

__all__ = ["Course", "Usual", "energies"]

# Energies below this share of all are rounding, or none.
_LEAST = 1e-9


class Course:
    """How unlike performances are to those that were learnt, each in units of the border.

    Parameters
    ----------
    performances : sequence of ndarray (P, n_features)
        On one clock.
    groups : ndarray of int (n_sequences,)
    coverage : float
        Share of new performances below 1.

    Attributes
    ----------
    border : float
        The dissimilarity that is 1.
    """

    def __init__(self, performances, groups, coverage):
        kept = spread_out(groups)
        known = np.stack([performances[i] for i in kept]).astype(np.float64)
        self._neighbours = Neighbours(known, groups[kept])
        unlike = Logs.of(self._neighbours.dissimilarity(performances, groups))
        self.border = self._neighbours.border(unlike, coverage)

    def __call__(self, performances):
        return self._neighbours.dissimilarity(performances) / self.border


class Usual:
    """How far numbers above 0 are from what is usual, in units of what is allowed.

    Everything is said of logarithms: twice is as far as half. What is usual is the mean; how far
    people may be from it is learnt from each performance and the mean of the other groups.

    Parameters
    ----------
    values : ndarray (n_sequences,)
        Above 0.
    groups : ndarray of int (n_sequences,)
        From 0, at least two different ones.
    coverage : float
        Share of new values between -1 and 1.

    Attributes
    ----------
    lower, upper : float
        The values that are -1 and 1.
    """

    def __init__(self, values, groups, coverage):
        logs = np.log(values)
        self._mean = float(logs.mean())
        apart, n = logs - _mean_of_others(logs, groups), len(logs)
        # That the mean of the others is uncertain is in them, and must not be counted twice.
        self._reach = learn_reach(apart * np.sqrt((n - 1) / (n + 1)), (1 + coverage) / 2)
        with np.errstate(over="ignore"):
            ends = np.exp([self._mean - self._reach, self._mean + self._reach])
        self.lower, self.upper = map(float, ends)

    def __call__(self, values):
        return (np.log(values) - self._mean) / self._reach


def energies(on_clock, floor=None):
    """The mean squared distance of the postures of performances from their own mean posture.

    Parameters
    ----------
    on_clock : ndarray (n_sequences, P, n_features)
    floor : float, default=None
        What standing still counts as; by default a tiny share of how much the postures of all
        performances differ.

    Returns
    -------
    ndarray (n_sequences,)
        Above 0; infinite beyond any number.
    floor : float
    """
    on_clock = np.asarray(on_clock, dtype=np.float64)
    with np.errstate(over="ignore"):
        squares = np.square(on_clock - on_clock.mean(axis=1, keepdims=True))
        energy = squares.reshape(len(on_clock), -1).sum(axis=1) / on_clock.shape[1]
    if floor is None:
        about = np.square(on_clock - on_clock.mean(axis=(0, 1))).sum(axis=2).mean()
        rounding = np.square(64 * np.finfo(float).eps * np.abs(on_clock).max())
        floor = max(_LEAST * about, rounding * on_clock.shape[2], np.finfo(float).tiny)
    return np.maximum(energy, floor), float(floor)


def _mean_of_others(values, groups):
    """For each value, the mean of those of other groups."""
    total, count = np.bincount(groups, weights=values), np.bincount(groups)
    return (values.sum() - total[groups]) / (len(values) - count[groups])
