"""Lags: how much later than the rest parts of the body are, and whether that is a person's own."""

from typing import NamedTuple

import numpy as np
import pandas as pd
from scipy.stats import t as student

from .match import timing_table

__all__ = ["Lags"]

# Share of such intervals that hold what they are made for.
_CONFIDENCE = 0.95


class Lags(NamedTuple):
    """How much later than the rest of the body each part is, at every frame of the pattern.

    `PartSynchronizer.lags` makes them. The pattern has no lag: it is how much *more* than in the
    pattern the part is late. Whether a lag is a habit of people or comes and goes is what the
    spread is for, so no table is without it.

    Attributes
    ----------
    values : ndarray, shape (n_sequences, n_parts, P)
        Positive where a part is late, negative where it leads.
    parts : list of str
        What is late.
    against : str
        Than what: ``"rest"``, ``"body"``, or the name of a part.
    unit : {"frames", "percent", "seconds"}
        Of the values.
    groups : ndarray of int, shape (n_sequences,), or None
        The person of every performance, counted from 0.
    people : list or None
        What they are called.
    labels : list or None
        What performances are called.

    Examples
    --------
    Two people, twice each. The arm of one of them is always late by 4 frames.

    >>> import numpy as np
    >>> from sklearn_motionsync import Lags
    >>> values = np.repeat([0.0, 0.2, 4.0, 4.4], 5).reshape(4, 1, 5)
    >>> groups = np.array([0, 0, 1, 1])
    >>> lags = Lags(values, ["arm"], "rest", "frames", groups, ["ann", "bob"])
    >>> lags.summary()[["mean", "sd_within", "sd_between", "icc"]].round(2)
          mean  sd_within  sd_between   icc
    part
    arm   2.15       0.22        2.89  0.99

    Nobody can tell from two people where the mean of all people is:

    >>> lags.summary()[["low", "high"]].round().to_numpy().tolist()
    [[-24.0, 28.0]]
    """

    values: np.ndarray
    parts: list
    against: str
    unit: str
    groups: np.ndarray | None = None
    people: list | None = None
    labels: list | None = None

    def summary(self):
        """The mean lag of a performance over the clock, and its spread, part by part.

        Returns
        -------
        DataFrame
            A row a part. ``mean`` over all; with people, of the means of each. ``sd`` over
            performances. ``low`` and ``high``: the 95 % interval of the mean, by the t distribution
            over people, or performances where nobody said whose they are. With people also those of
            a one-way analysis of variance: ``sd_within`` and ``sd_between`` people, and ``icc``,
            the share of the variance that is between them, ICC(1,1): near 1 for a habit, near 0 for
            a lag that comes and goes. NaN where there are too few to tell.
        """
        columns = self._spread(self.values.mean(axis=2))
        return pd.DataFrame(columns, index=pd.Index(self.parts, name="part"))

    def over_time(self):
        """The lag at every frame of the pattern, and its spread.

        Returns
        -------
        DataFrame
            A row a part and frame, columns as in ``summary``. The intervals are those of each frame
            by itself: 5 % of all frames lie outside by chance, and neighbours together.
        """
        n_frames = self.values.shape[2]
        index = pd.MultiIndex.from_product([self.parts, range(n_frames)], names=["part", "frame"])
        columns = self._spread(self.values.reshape(len(self.values), -1))
        return pd.DataFrame(columns, index=index)

    def to_frame(self):
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
            f"Lags({n_parts} parts of {n_sequences} performances on {n_frames} frames, behind "
            f"{self.against!r}, in {self.unit})"
        )

    def _spread(self, values):
        """Mean and spread of columns of values (n_sequences, n_columns), by name."""
        if self.groups is None:
            mean, sd, n = values.mean(axis=0), _sd(values), len(values)
            return {"mean": mean, "sd": sd, **_interval(mean, sd, n)}
        counts = np.bincount(self.groups)
        own = np.stack([values[self.groups == g].mean(axis=0) for g in range(len(counts))])
        mean = own.mean(axis=0)
        within, between = _components(values, own, self.groups, counts)
        with np.errstate(invalid="ignore"):
            icc = between / (between + within)
        return {
            "mean": mean,
            "sd": _sd(values),
            **_interval(mean, _sd(own), len(own)),
            "sd_within": np.sqrt(within),
            "sd_between": np.sqrt(between),
            "icc": icc,
        }


def _sd(values):
    """Standard deviations, NaN of fewer than two."""
    return values.std(axis=0, ddof=1) if len(values) > 1 else np.full(values.shape[1], np.nan)


def _interval(mean, sd, n):
    """Where the mean of all that there could be lies."""
    reach = np.nan
    if n > 1:
        reach = student.ppf((1 + _CONFIDENCE) / 2, n - 1) * sd / np.sqrt(n)
    return {"low": mean - reach, "high": mean + reach}


def _components(values, own, groups, counts):
    """Variances within and between people: a one-way analysis, people of unequal counts.

    NaN where nobody has two performances, or there is one person only.
    """
    n_people, n = len(counts), len(values)
    nothing = np.full(values.shape[1], np.nan)
    within = between = nothing
    if n > n_people:
        within = np.square(values - own[groups]).sum(axis=0) / (n - n_people)
    if n > n_people > 1:
        squares = np.square(own - values.mean(axis=0))
        mean_square = (counts[:, np.newaxis] * squares).sum(axis=0) / (n_people - 1)
        typical = (n - np.square(counts).sum() / n) / (n_people - 1)
        between = np.maximum(mean_square - within, 0) / typical
    return within, between
