"""How unlike a performance is to those that were learnt, and how unlike people may be."""

from dataclasses import dataclass

import numpy as np
from scipy.stats import t as student

from ..matching.filters import smooth
from ..utils.threads import on_one_thread

__all__ = [
    "Logs",
    "Neighbours",
    "learn_border",
    "learn_reach",
    "portions",
    "power_of_two",
]

# Of the nearest ones, so many count: one alone may be a stray.
_NEAREST = 2
# Say of the mean posture: people stand differently, but a movement elsewhere is another one.
_SAY_OF_MEAN = 0.1
# Under which Gaussian velocities are taken, as a share of the clock.
_SMOOTHING = 0.01
# The variance of the logarithm over performances of one action, as found over 16 actions of
# people; it counts like that of so many performances.
_PRIOR_VARIANCE, _PRIOR_COUNT = 0.07, 3
# What is less is rounding, or nobody differs.
_LEAST = 1e-9
# Who stands still is as unlike to people who move as 1; that is never accepted.
_STANDS_STILL = 1 - 1e-6
# Performances that are multiplied at a time, always so many, so that no result depends on the
# others; and those that are in memory at a time.
_TILE, _PORTION = 8, 64


class Neighbours:
    """Performances that others are compared with.

    Parameters
    ----------
    performances : ndarray (n_kept, P, n_features), float64
    groups : ndarray of int (n_kept,)

    Attributes
    ----------
    stand_still : bool
        Whether nobody moves, so that only postures can be compared.
    """

    def __init__(self, performances, groups):
        self._groups = groups
        self._unit = power_of_two(performances)
        performances = performances * self._unit
        self._center = performances.mean(axis=(0, 1))
        self._postures, self._energy = self._move(performances)
        self._velocities = self._velocity(performances)
        self._speed = np.square(self._velocities).sum(axis=1)
        about = np.square(performances - self._center).sum(axis=(1, 2)).mean()
        largest = np.abs(performances).max()
        rounding = np.square(64 * np.finfo(float).eps * largest) * performances[0].size
        self._scale = max(about, rounding, np.finfo(float).tiny)
        self.stand_still = bool(self._energy.max() <= _LEAST * self._scale)

    def dissimilarity(self, performances, groups=None):
        """How unlike performances are to the most similar neighbours: the mean over these.

        Parameters
        ----------
        performances : sequence of ndarray (P, n_features)
        groups : ndarray of int (n,), default=None
            Their groups; then only neighbours of other groups are asked.

        Returns
        -------
        ndarray (n,)
            Infinite if no neighbour is a number away.
        """
        # Products of eight rows are too small to be shared by threads.
        return on_one_thread(self._compare, performances, groups)

    def border(self, unlike, coverage):
        """Up to how unlike somebody new is to be expected.

        Parameters
        ----------
        unlike : Logs
            Of the dissimilarities of performances to neighbours of other groups.
        coverage : float
            Share of new performances within the border.

        Returns
        -------
        float
            Less than standing still, unless nobody moves.
        """
        border = unlike.border(coverage)
        return border if self.stand_still else min(border, _STANDS_STILL)

    def _compare(self, performances, groups):
        found = np.empty(len(performances))
        for rows, some in portions(performances):
            ratios = self._ratios(some.astype(np.float64, copy=False))
            if groups is not None:
                ratios[groups[rows, np.newaxis] == self._groups] = np.inf
            found[rows] = _mean_of_smallest(ratios)
        return found

    def _ratios(self, performances):
        """How unlike performances (n, P, n_features) are to each of the neighbours (n, n_kept).

        The mean of ``|y - y_i|^2 / (|y|^2 + |y_i|^2)`` of postures less their own mean over time,
        and the same of velocities: 0 equal, 1 one of them stands still, 2 opposite. The distance
        of the mean postures adds to the first, with a tenth of its weight.
        """
        # What is too far away for any number is nobody's neighbour.
        with np.errstate(over="ignore", invalid="ignore"):
            performances = performances * self._unit
            postures, energy = self._move(performances)
            apart = _squared_distances(postures, self._postures)
            if self.stand_still:
                return np.nan_to_num(apart / self._scale, nan=np.inf, posinf=np.inf)
            velocities = self._velocity(performances)
            hurried = _squared_distances(velocities, self._velocities)
            speed = np.square(velocities).sum(axis=1)
            ratio = apart / _sums(energy, self._energy) + hurried / _sums(speed, self._speed)
        return np.nan_to_num(ratio / 2, nan=np.inf, posinf=np.inf)

    def _move(self, performances):
        """Postures less their mean over time, beside that mean; squares of the first alone."""
        n, n_frames, _ = performances.shape
        mean = performances.mean(axis=1)
        moved = (performances - mean[:, np.newaxis]).reshape(n, -1)
        stood = np.sqrt(_SAY_OF_MEAN * n_frames) * (mean - self._center)
        return np.hstack([moved, stood]), np.square(moved).sum(axis=1)

    def _velocity(self, performances):
        n, n_frames, _ = performances.shape
        if n_frames == 1:
            return np.zeros((n, performances[0].size))
        return smooth(performances, _SMOOTHING * (n_frames - 1), order=1).reshape(n, -1)


@dataclass(frozen=True)
class Logs:
    """The logarithms of dissimilarities, as far as a border depends on them; they can be added.

    Parameters
    ----------
    n : int, default=0
        How many.
    mean : float, default=0.0
    squares : float, default=0.0
        The sum of their squared deviations from the mean.
    """

    n: int = 0
    mean: float = 0.0
    squares: float = 0.0

    @classmethod
    def of(cls, values):
        """Those of dissimilarities (n,), not negative."""
        if not len(values):
            return cls()
        logs = np.log(np.maximum(values, _LEAST))
        mean = logs.mean()
        return cls(len(logs), float(mean), float(np.square(logs - mean).sum()))

    def __add__(self, other):
        if not self.n or not other.n:
            return self if self.n else other
        n, apart = self.n + other.n, other.mean - self.mean
        squares = self.squares + other.squares + apart**2 * self.n * other.n / n
        return Logs(n, self.mean + apart * other.n / n, squares)

    def border(self, coverage):
        """What a new dissimilarity stays below with this probability; see `learn_border`."""
        with np.errstate(over="ignore"):
            return float(np.exp(self.mean + _reach(self.n, self.squares, coverage)))


def portions(performances):
    """Performances (n, P, n_features) by portions: pairs of a slice and an array."""
    for start in range(0, len(performances), _PORTION):
        rows = slice(start, start + _PORTION)
        yield rows, np.asarray(performances[rows])


def power_of_two(performances):
    """What to multiply them by, for squares that are numbers; no bit is lost by it."""
    largest = np.abs(performances).max()
    return np.ldexp(1.0, -int(np.frexp(largest)[1])) if largest > 0 else 1.0


def learn_border(values, coverage):
    """Up to where values like these are to be expected of somebody new.

    The logarithms are taken for normal, and their variance for known as well as if a few more
    performances had shown the usual one: the bound of a new value is Student's.

    Parameters
    ----------
    values : ndarray (n,)
        Not negative.
    coverage : float
        Share of new values below the border.

    Returns
    -------
    float
    """
    return Logs.of(values).border(coverage)


def learn_reach(deviations, coverage, usual=_PRIOR_VARIANCE):
    """How far a new logarithm may lie above what is usual.

    Parameters
    ----------
    deviations : ndarray (n,)
        Of the logarithms that are known, from what is usual.
    coverage : float
        Share of new values below it.
    usual : float, default=0.07
        Their usual variance, which counts like that of three of them.

    Returns
    -------
    float
    """
    return _reach(len(deviations), np.square(deviations).sum(), coverage, usual)


def _reach(n, squares, coverage, usual=_PRIOR_VARIANCE):
    freedom = n - 1 + _PRIOR_COUNT
    squares = squares + _PRIOR_COUNT * usual
    return float(student.ppf(coverage, freedom) * np.sqrt(squares / freedom * (1 + 1 / n)))


def _mean_of_smallest(ratios):
    nearest = np.sort(ratios, axis=1)[:, :_NEAREST]
    counts = np.isfinite(nearest)
    total = np.where(counts, nearest, 0).sum(axis=1)
    return np.where(counts.any(axis=1), total / np.maximum(counts.sum(axis=1), 1), np.inf)


def _squared_distances(a, b):
    squares = np.square(a).sum(axis=1)[:, np.newaxis] + np.square(b).sum(axis=1)
    tiles = np.zeros((-(-len(a) // _TILE), _TILE, a.shape[1]))
    tiles.reshape(-1, a.shape[1])[: len(a)] = a
    products = np.matmul(tiles, b.T).reshape(-1, len(b))[: len(a)]
    return np.maximum(squares - 2 * products, 0)


def _sums(a, b):
    """Sums of all pairs, none 0: where neither moves both are 0 apart."""
    return np.maximum(a[:, np.newaxis] + b, np.finfo(float).tiny)
