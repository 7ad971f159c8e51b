"""Lags: delays of parts of the body, with their spread within and between subjects."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import pandas as pd
from scipy.stats import t as student

from ..inputs.types import Unit
from ..inputs.wording import counted
from ..matching.counting import whole
from .match import timing_table

__all__ = ["Lags", "common_delay", "share_apart"]

# Level of the confidence intervals.
_CONFIDENCE = 0.95


class Lags(NamedTuple):
    """How much later than the rest of the body each part is, at every frame of the pattern.

    `PartSynchronizer.lags` returns them. Lags are counted from the mean of the training
    performances. Their spread shows whether a lag is a habit of subjects or varies from performance
    to performance.

    Parameters
    ----------
    values : ndarray, shape (n_sequences, n_parts, P)
        The lags: positive where a part is late, negative where it leads.
    parts : list of str
        Names of the parts.
    unit : {"frames", "percent", "seconds"}
        Unit of the values.
    groups : ndarray of int, shape (n_sequences,), default=None
        The subject of every performance, counted from 0.
    people : list, default=None
        Labels of the subjects.
    labels : list, default=None
        Labels of the performances.

    Examples
    --------
    Two subjects, two performances each. The arm of the second is always late by 4 frames.

    >>> import numpy as np
    >>> from sklearn_motionsync import Lags
    >>> values = np.repeat([0.0, 0.2, 4.0, 4.4], 5).reshape(4, 1, 5)
    >>> groups = np.array([0, 0, 1, 1])
    >>> lags = Lags(values, ["arm"], "frames", groups, ["ann", "bob"])
    >>> lags.summary()[["mean", "sd_within", "sd_between", "icc"]].round(2)
          mean  sd_within  sd_between   icc
    part
    arm   2.15       0.22        2.89  0.99

    Two subjects do not determine the mean of the population:

    >>> lags.summary()[["low", "high"]].round().to_numpy().tolist()
    [[-24.0, 28.0]]
    """

    values: np.ndarray
    parts: list[str]
    unit: Unit
    groups: np.ndarray | None = None
    people: list | None = None
    labels: list | None = None

    def summary(self) -> pd.DataFrame:
        """The mean lag of a performance over the clock, and its spread, part by part.

        Returns
        -------
        DataFrame
            A row a part. ``mean`` over performances, or with groups over the means of subjects;
            ``sd`` over performances; ``low`` and ``high``, the 95 % confidence interval of the
            mean, by the t distribution over subjects, or over performances without groups. With
            groups also a one-way analysis of variance: ``sd_within`` and ``sd_between`` subjects,
            and ``icc``, the share of the variance between subjects, ICC(1,1): near 1 for a habit,
            near 0 for a lag that varies. NaN where there are too few performances or subjects.
        """
        columns = self._spread(self.values.mean(axis=2))
        return pd.DataFrame(columns, index=pd.Index(self.parts, name="part"))

    def over_time(self) -> pd.DataFrame:
        """The lag at every frame of the pattern, and its spread.

        Returns
        -------
        DataFrame
            A row a part and frame, columns as in ``summary``. Intervals are pointwise: at 5 % of
            the frames they miss the mean by chance.
        """
        n_frames = self.values.shape[2]
        index = pd.MultiIndex.from_product([self.parts, range(n_frames)], names=["part", "frame"])
        columns = self._spread(self.values.reshape(len(self.values), -1))
        return pd.DataFrame(columns, index=index)

    def to_frame(self) -> pd.DataFrame:
        """All lags as a table, such as for a CSV file.

        Returns
        -------
        DataFrame
            A row a performance and frame of the pattern, a column a part.
        """
        columns = {part: self.values[:, i] for i, part in enumerate(self.parts)}
        return timing_table(columns, None, self.labels)

    def __repr__(self):
        n_sequences, n_parts, n_frames = self.values.shape
        return (
            f"Lags({counted(n_parts, 'part')} of {counted(n_sequences, 'performance')} on "
            f"{n_frames} frames, in {self.unit})"
        )

    def _spread(self, values):
        """Mean and spread of columns of values (n_sequences, n_columns), by name."""
        if self.groups is None:
            mean, sd, n = values.mean(axis=0), _sd(values), len(values)
            return {"mean": mean, "sd": sd, **_interval(mean, sd, n)}
        counts = np.bincount(self.groups)
        means = np.stack([values[self.groups == g].mean(axis=0) for g in range(len(counts))])
        mean = means.mean(axis=0)
        within, between = _components(values, means, self.groups, counts)
        with np.errstate(invalid="ignore"):
            icc = between / (between + within)
        return {
            "mean": mean,
            "sd": _sd(values),
            **_interval(mean, _sd(means), len(means)),
            "sd_within": np.sqrt(within),
            "sd_between": np.sqrt(between),
            "icc": icc,
        }


def common_delay(offsets, apart):
    """What several parts have in common: what nearly all of them are late by, or early; or 0.

    It minimises the sum of the distances from all offsets, and, ``apart`` times as often, from 0;
    of equally good ones it is the farthest from 0. So a part that is shifted hardly moves it.

    Parameters
    ----------
    offsets : list of ndarray, shape (n_sequences, P)
        Of each part, counted from their means.
    apart : float
        From 0, where all parts of people have one offset, to 1, where they differ as much as they
        share.

    Returns
    -------
    ndarray, shape (n_sequences, P); or 0.0, if there are no parts
    """
    if not offsets:
        return 0.0
    count = len(offsets)
    agree = max(whole((1 + apart) / 2 * count, "up"), count // 2 + 1)
    ranked = np.sort(offsets, axis=0)
    return np.maximum(ranked[count - agree], 0) + np.minimum(ranked[agree - 1], 0)


def share_apart(offsets):
    """How far parts are from what they have in common, as a share of that; at most 1.

    Parameters
    ----------
    offsets : ndarray, shape (n_parts, n_sequences, P)
        Counted from their means.
    """
    common = np.median(offsets, axis=0)
    apart, shared = np.abs(offsets - common).mean(), np.abs(common).mean()
    return float(apart / shared) if apart < shared else 1.0


def _sd(values):
    """Standard deviations, NaN of fewer than two."""
    return values.std(axis=0, ddof=1) if len(values) > 1 else np.full(values.shape[1], np.nan)


def _interval(mean, sd, n):
    """The confidence interval of a mean."""
    quantile = student.ppf((1 + _CONFIDENCE) / 2, n - 1) if n > 1 else np.nan
    reach = quantile * sd / np.sqrt(n)
    return {"low": mean - reach, "high": mean + reach}


def _components(values, own, groups, counts):
    """Variances within and between groups of unequal counts, by a one-way analysis of variance.

    NaN if no group has two performances, or there is only one group.
    """
    n_groups, n = len(counts), len(values)
    within = between = np.full(values.shape[1], np.nan)
    if n > n_groups:
        within = np.square(values - own[groups]).sum(axis=0) / (n - n_groups)
    if n > n_groups > 1:
        squares = np.square(own - values.mean(axis=0))
        mean_square = (counts[:, np.newaxis] * squares).sum(axis=0) / (n_groups - 1)
        typical = (n - np.square(counts).sum() / n) / (n_groups - 1)
        between = np.maximum(mean_square - within, 0) / typical
    return within, between
