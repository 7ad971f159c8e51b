"""Faults of the whole body: it starts late, pauses, moves backwards, or too little."""

from typing import NamedTuple

import numpy as np
from scipy.stats import t as student

from ..matching.counting import ROUNDING, first_largest, runs_of
from ..matching.filters import smooth
from ..utils.groups import mean_of_others
from .acceptance import PRIOR_COUNT, LogPredictionInterval

# Standard deviation of the Gaussian under which speeds are estimated, as a share of the time.
_SMOOTHING = 0.01
# A movement starts, and stops, where so much of its squared speed is over, or is still to come.
_AT_ENDS = 0.01
# A body starts, and stops, when so many of its columns have, by what they count.
_FEW_COLUMNS = 0.25
# It pauses where the squared speed of its mean part is below this share of the mean.
_SLOW = 0.02
# Shares of the time are compared by their logarithms, with so much added; and the prior variance
# of these.
_ADDED, _PRIOR_VARIANCE = 0.2, 0.015
# A body moves too little, or too far, if another amplitude explains so much of how it differs.
_EXPLAINED = 0.35
# The contrast of one column counts at most so often.
_MOST_OF_COLUMN = 1.5
# An action has a direction if its contrast is so many standard deviations, and if it and its way
# back differ by such a share of the movement: as in `Contrast`.
_CLEAR, _LARGE = 2, 0.1
# A trial is backwards from this share of the usual contrast on.
_OTHER_WAY = -0.5
_KINDS = {
    "start": ("starts early", "starts late"),
    "stop": ("stops late", "stops early"),
    "pause": (None, "pauses"),
    "amplitude": ("too small", "too large"),
}


class WholeFault(NamedTuple):
    """A fault of the whole body.

    Attributes
    ----------
    kind : str
    start, stop : float
        Shares of the time of the trial.
    size : float
        What is late, early or paused, in per cent of the time; the ratio of amplitudes; NaN.
    unit : str
    excess : float
        In units of the limit: above 1.
    rarity : float
        In units of the limit if people are as different as so few can be: above 1 it is rare.
    deviation : float
        In standard deviations of people; NaN where these are not known.
    """

    kind: str
    start: float
    stop: float
    size: float
    unit: str
    excess: float
    rarity: float
    deviation: float


class WholeBody:
    """Judges whole trials by limits that people left out give.

    Parameters
    ----------
    in_time : ndarray (n, P, n_columns)
        Right trials in linear time, without gaps.
    groups : ndarray of int (n,)
    on_clock : ndarray (n_on_clock, P, n_columns)
        Right trials on the clock of the model.
    groups_on_clock : ndarray of int (n_on_clock,)
    coverage : float
        The share of trials of new people within each limit.
    """

    def __init__(self, in_time, groups, on_clock, groups_on_clock, coverage):
        self._mean = on_clock.mean(axis=0)
        self._swing = self._mean - self._mean.mean(axis=0)
        self._norms = np.square(self._swing).sum(axis=0)
        total = on_clock.var(axis=(0, 1))
        # Columns count by what all trials do alike.
        shares = np.divide(self._norms, total, out=np.zeros_like(total), where=total > 0)
        self._weights = shares / max(shares.sum(), np.finfo(float).tiny)
        self._moves = bool((self._norms > 0).any())
        if not self._moves:
            return
        measured = [self._in_time(x) for x in in_time]
        self._limits = {
            name: LogPredictionInterval(
                np.array([each[name] for each in measured]), groups, coverage, _PRIOR_VARIANCE
            )
            for name in ("start", "stop", "pause")
        }
        amplitudes = np.array([self._amplitude(x) for x in on_clock])
        self._limits["amplitude"] = LogPredictionInterval(amplitudes, groups_on_clock, coverage)
        # Trials of one person are alike, so a limit is as sure as so few people make it.
        tail = (1 + coverage) / 2
        self._few = {
            name: _limit_of(tail, len(np.unique(of_limit))) / _limit_of(tail, len(of_limit))
            for name, of_limit in {
                **dict.fromkeys(("start", "stop", "pause"), groups),
                "amplitude": groups_on_clock,
            }.items()
        }
        differences = on_clock - on_clock[:, ::-1]
        self._difference = differences.mean(axis=0)
        of_others = mean_of_others(differences, groups_on_clock)
        held_out = [self._direction(x, m) for x, m in zip(differences, of_others, strict=True)]
        changes = np.square(self._difference - self._difference.mean(axis=0)).mean(axis=0)
        is_large = self._weights @ (changes > _LARGE * total) > 0.5
        self._middle = np.mean(held_out)
        self._has_direction = bool(is_large and self._middle > _CLEAR * np.std(held_out))

    def find(self, in_time, on_clock):
        """The faults of a trial (P, n_columns), in linear time and on the clock."""
        if not self._moves:
            return []
        faults, measures = [], self._in_time(in_time)
        measures["amplitude"] = self._amplitude(on_clock)
        places = {
            "start": (0.0, measures["start"] - _ADDED),
            "stop": (1 + _ADDED - measures["stop"], 1.0),
            "pause": self._pause(in_time),
            "amplitude": (0.0, 1.0),
        }
        for name, limit in self._limits.items():
            excess = float(limit.standardize(measures[name]))
            kind = _KINDS[name][int(excess > 0)]
            if abs(excess) <= 1 or kind is None:
                continue
            ratio = float(limit.ratio(excess))
            size, unit = 100 * measures[name] * abs(1 - 1 / ratio), "percent"
            if name == "amplitude":
                if not self._explains(on_clock, measures[name]):
                    continue
                size, unit = ratio, "ratio"
            deviation = excess * limit.end
            rarity = abs(excess) / self._few[name]
            fault = WholeFault(kind, *places[name], size, unit, abs(excess), rarity, deviation)
            faults.append(fault)
        if self._has_direction:
            contrast = self._direction(on_clock - on_clock[::-1], self._difference)
            # A trial that stands still is like neither way.
            if contrast < _OTHER_WAY * self._middle:
                excess = float(1 - contrast / self._middle)
                faults.append(WholeFault("backwards", 0.0, 1.0, np.nan, "", excess, np.inf, np.nan))
        return faults

    def _in_time(self, trial):
        """When a trial starts, how long before its end it stops, and its longest pause."""
        done = np.cumsum(self._squared_speeds(trial), axis=0)
        # Columns that never move have started, and stopped, at once.
        done /= np.where(done[-1] > 0, done[-1], 1)
        starts, stops = (done < _AT_ENDS).mean(axis=0), (done < 1 - _AT_ENDS).mean(axis=0)
        # One limb that is late does not make the body late.
        start, stop = self._quantile(starts, _FEW_COLUMNS), self._quantile(stops, 1 - _FEW_COLUMNS)
        first, last = self._pause(trial)
        return {"start": start + _ADDED, "stop": 1 - stop + _ADDED, "pause": last - first + _ADDED}

    def _squared_speeds(self, trial):
        return np.square(smooth(trial[np.newaxis], _SMOOTHING * (len(trial) - 1), order=1)[0])

    def _quantile(self, values, share):
        """The value that a share of the columns, by their weights, does not exceed."""
        order = np.argsort(values, kind="stable")
        reached = np.cumsum(self._weights[order]) >= share - ROUNDING
        return values[order[np.flatnonzero(reached)[0]]]

    def _pause(self, trial):
        """Where the longest pause is, as shares of the time."""
        squares = self._squared_speeds(trial)
        means = squares.mean(axis=0)
        # The mean over the columns, each relative to its own mean.
        speeds = (squares / np.where(means > 0, means, 1)) @ self._weights
        done = np.cumsum(speeds) / max(speeds.sum(), np.finfo(float).tiny)
        is_inside = (done > _AT_ENDS) & (done < 1 - _AT_ENDS)
        runs = runs_of((speeds < _SLOW * speeds.mean()) & is_inside)
        return runs[first_largest(np.diff(runs)[:, 0])] / len(trial) if len(runs) else (0.0, 0.0)

    def _amplitude(self, trial):
        """The factor of the mean movement in a trial, above 0."""
        products = ((trial - trial.mean(axis=0)) * self._swing).sum(axis=0)
        factor = self._weights @ (products / np.where(self._norms > 0, self._norms, 1))
        return max(float(factor), np.finfo(float).eps)

    def _explains(self, trial, factor):
        """Whether another amplitude explains most of how a trial differs from the mean."""
        moved = trial - trial.mean(axis=0)
        plain, scaled = (np.square(moved - f * self._swing).sum(axis=0) for f in (1.0, factor))
        return bool(self._weights @ (scaled < _EXPLAINED * plain) > 0.5)

    def _direction(self, difference, mean):
        """How much a difference from the way back is that of the action: about 1, or -1."""
        products, norms = (difference * mean).sum(axis=0), np.square(mean).sum(axis=0)
        ratios = products / np.where(norms > 0, norms, 1)
        return float(self._weights @ np.clip(ratios, -_MOST_OF_COLUMN, _MOST_OF_COLUMN))


def _limit_of(tail, n):
    """The limit of a new value in standard deviations, by n others."""
    return student.ppf(tail, n - 1 + PRIOR_COUNT) * np.sqrt(1 + 1 / n)
