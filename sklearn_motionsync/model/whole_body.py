"""Faults of the whole body: it starts late, pauses, moves backwards, or too little."""

from typing import NamedTuple

import numpy as np
from scipy.stats import t as student

from ..matching.counting import ROUNDING, first_largest, runs_of
from ..matching.filters import smooth
from .acceptance import PRIOR_COUNT, Contrast, LogPredictionInterval, backwards

# All was chosen on HDM05 and two exercises of UI-PRMD (benchmarks/departures.py DATA whole); what
# each is worth was measured of `_AT_ENDS` and `_FEW_COLUMNS` alone (docs/design.md).
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
# A trial is backwards whose contrast to the way back is beyond this, where 2 is the way back.
_OTHER_WAY = 1.5
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
        mean = on_clock.mean(axis=0)
        self._swing = mean - mean.mean(axis=0)
        self._norms = np.square(self._swing).sum(axis=0)
        total = on_clock.var(axis=(0, 1))
        # Columns count by what all trials do alike.
        shares = np.divide(self._norms, total, out=np.zeros_like(total), where=total > 0)
        self._weights = shares / max(shares.sum(), np.finfo(float).tiny)
        self._moves = bool((self._norms > 0).any())
        if not self._moves:
            return
        times, _ = zip(*(self._in_time(x) for x in in_time), strict=True)
        self._limits = {
            name: LogPredictionInterval(
                np.array([each[name] for each in times]), groups, coverage, _PRIOR_VARIANCE
            )
            for name in ("start", "stop", "pause")
        }
        amplitudes = np.array([self._amplitude(x) for x in on_clock])
        self._limits["amplitude"] = LogPredictionInterval(amplitudes, groups_on_clock, coverage)
        # Trials of one person are alike, so a limit is as sure as so few people make it.
        of_few = dict.fromkeys(("start", "stop", "pause"), _widening(groups, coverage))
        self._of_few = {**of_few, "amplitude": _widening(groups_on_clock, coverage)}
        self._scale = np.divide(1, np.sqrt(total), out=np.zeros_like(total), where=total > 0)
        self._way = Contrast(self._scale * on_clock, backwards, groups_on_clock)

    def find(self, in_time, on_clock):
        """The faults of a trial (P, n_columns), in linear time and on the clock."""
        if not self._moves:
            return []
        faults, (measures, pause) = [], self._in_time(in_time)
        measures["amplitude"] = self._amplitude(on_clock)
        places = {
            "start": (0.0, measures["start"] - _ADDED),
            "stop": (1 + _ADDED - measures["stop"], 1.0),
            "pause": pause,
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
            rarity = abs(excess) / self._of_few[name]
            fault = WholeFault(kind, *places[name], size, unit, abs(excess), rarity, deviation)
            faults.append(fault)
        if self._way.is_clear:
            # A trial that stands still is like neither way, which is 1.
            excess = float(self._way.standardize(self._scale * on_clock[np.newaxis])[0])
            if excess > _OTHER_WAY:
                faults.append(WholeFault("backwards", 0.0, 1.0, np.nan, "", excess, np.inf, np.nan))
        return faults

    def _in_time(self, trial):
        """When a trial starts, how long before its end it stops, and its longest pause.

        With the first and last time of the pause.
        """
        squares = np.square(smooth(trial[np.newaxis], _SMOOTHING * (len(trial) - 1), order=1)[0])
        # Each column relative to all that it does; one that never moves starts and stops at once.
        sums = squares.sum(axis=0)
        squares = squares / np.where(sums > 0, sums, 1)
        done = np.cumsum(squares, axis=0)
        starts, stops = (done < _AT_ENDS).mean(axis=0), (done < 1 - _AT_ENDS).mean(axis=0)
        # One limb that is late does not make the body late.
        start, stop = self._quantile(starts, _FEW_COLUMNS), self._quantile(stops, 1 - _FEW_COLUMNS)
        speeds = squares @ self._weights
        done = np.cumsum(speeds) / max(speeds.sum(), np.finfo(float).tiny)
        is_inside = (done > _AT_ENDS) & (done < 1 - _AT_ENDS)
        runs = runs_of((speeds < _SLOW * speeds.mean()) & is_inside)
        pause = (0.0, 0.0)
        if len(runs):
            pause = tuple(runs[first_largest(np.diff(runs)[:, 0])] / len(trial))
        measures = {"start": start, "stop": 1 - stop, "pause": pause[1] - pause[0]}
        return {name: share + _ADDED for name, share in measures.items()}, pause

    def _quantile(self, values, share):
        """The value that a share of the columns, by their weights, does not exceed."""
        order = np.argsort(values, kind="stable")
        reached = np.cumsum(self._weights[order]) >= share - ROUNDING
        return values[order[np.flatnonzero(reached)[0]]]

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


def _widening(groups, coverage):
    """By how much a limit is wider if each of the groups (n,) counts as a single trial."""
    counts, tail = np.array([len(np.unique(groups)), len(groups)]), (1 + coverage) / 2
    few, many = student.ppf(tail, counts - 1 + PRIOR_COUNT) * np.sqrt(1 + 1 / counts)
    return few / many
