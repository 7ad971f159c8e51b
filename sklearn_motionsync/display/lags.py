"""LagDisplay: the lags of parts of the body, with their confidence intervals."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Self

import numpy as np
from sklearn.base import BaseEstimator

from ..inputs.types import Labels, TrialsLike, Unit
from ..inputs.wording import counted
from ..synchronizers.parts import Lags, PartSynchronizer
from ..utils.pipelines import route_to_synchronizer
from .base import (
    COLORS,
    WIDTH,
    AxesLike,
    Display,
    TimeAxis,
    curves,
    empty_lists,
    front_line,
    legend_above,
)

_UNITS = {"frames": "frames", "percent": "% of the time", "seconds": "s"}
# The largest number of curves in a row.
_CURVES_A_ROW = 3


@dataclass(eq=False, repr=False)
class LagDisplay(Display):
    """The lag of each part over time: its mean, and how much it varies.

    The grey band is the 95 % confidence interval of the mean: where it contains 0, the lag cannot
    be told from none. Broken lines are one standard deviation of trials from the mean. Use
    `from_estimator`, or ``LagDisplay(lags).plot()`` with lags that are known already.

    Parameters
    ----------
    lags : Lags
        The result of `PartSynchronizer.lags`.
    xlabel : str, default=None
        The label of time axes.

    Attributes
    ----------
    axes_ : list of Axes
        The panels, one a part.
    means_ : list of Line2D
        The mean of each part.
    intervals_ : list of FillBetweenPolyCollection
        The confidence interval of each part.
    spreads_ : list of LineCollection
        The standard deviation of each part.

    Examples
    --------
    >>> from sklearn_motionsync import DirectionCosines, PartSynchronizer
    >>> from sklearn_motionsync.display import LagDisplay
    >>> from sklearn_motionsync.datasets import make_bending
    >>> bunch = make_bending(6, n_frames=50, random_state=0)
    >>> X = DirectionCosines(bunch.skeleton).fit_transform(bunch.data)
    >>> sync = PartSynchronizer().fit(X)
    >>> LagDisplay.from_estimator(sync, X, groups=bunch.actor)
    LagDisplay(5 parts behind the rest of the body, 6 trials of 4 people)
    """

    lags: Lags
    xlabel: str | None = None

    def __repr__(self):
        n_parts = self.lags.values.shape[1]
        lagging = f"{n_parts} parts" if n_parts > 1 else self.lags.parts[0]
        return f"LagDisplay({lagging} behind the rest of the body, {self._count()})"

    @classmethod
    def from_estimator(
        cls,
        estimator: BaseEstimator,
        X: TrialsLike,
        *,
        groups: Labels | None = None,
        unit: Unit = "percent",
        xlabel: str | None = None,
        ax: AxesLike | None = None,
        **params: Any,
    ) -> Self:
        """Draw the lags of trials.

        Parameters
        ----------
        estimator : PartSynchronizer, or Pipeline with one
            Fitted.
        X : trials
            As the estimator takes them.
        groups : array-like, shape (n_sequences,), default=None
            The subject of each trial.
        unit : {"frames", "percent", "seconds"}, default="percent"
            Unit of the lags.
        xlabel : str, default=None
            The label of time axes, such as ``"% gait cycle"``, in place of that of the unit.
        ax : Axes or array-like of Axes, default=None
            See `plot`.
        **params : dict
            Further arguments of the steps before the synchronizer, and ``frame_rate``, frames a
            second of X, which seconds need where tables do not tell. Key-frames are of the whole
            body, and lags do not depend on them.

        Returns
        -------
        LagDisplay
            The display, drawn.
        """
        caller = f"{cls.__name__}.from_estimator"
        reached = route_to_synchronizer(
            estimator, X, params, caller, kind=PartSynchronizer, uses=()
        )
        rates = reached.facts.frame_rates if reached.facts.are_timed else None
        lags = reached.synchronizer.lags(reached.trials, groups, unit=unit, frame_rate=rates)
        return cls(lags, xlabel=xlabel).plot(ax)

    def _layout(self):
        n_parts = self.lags.values.shape[1]
        n_cols = min(n_parts, _CURVES_A_ROW)
        n_rows = -(-n_parts // n_cols)
        cells = [divmod(i, n_cols) for i in range(n_parts)]
        return cells, (n_rows, n_cols), (WIDTH, 1 + 1.9 * n_rows)

    def _draw(self):
        n_parts, n_frames = self.lags.values.shape[1:]
        unit = "frames" if self.lags.unit == "frames" else "percent"
        time, table = TimeAxis(unit, n_frames, label=self.xlabel), self.lags.over_time()
        self.means_, self.intervals_, self.spreads_ = empty_lists(3)
        reach = 1.05 * max((table["mean"].abs() + table["sd"].fillna(0)).max(), 1e-9)
        black, grey, orange = (COLORS[name] for name in ("pattern", "envelope", "mean"))
        for i, (axis, part) in enumerate(zip(self.axes_, self.lags.parts, strict=True)):
            mean, sd, low, high = table.loc[part, ["mean", "sd", "low", "high"]].to_numpy().T
            axis.axhline(0, color="0.3", linewidth=0.8)
            band = axis.fill_between(time.clock, low, high, color=grey, alpha=0.6, linewidth=0)
            self.intervals_.append(band)
            style = {"colors": black, "linewidths": 0.9, "linestyles": "--"}
            ends = mean - np.nan_to_num(sd), mean + np.nan_to_num(sd)
            self.spreads_.append(curves(axis, [time.clock] * 2, ends, **style))
            self.means_.append(front_line(axis, time.clock, mean, color=orange))
            axis.set_ylim(-reach, reach)
            axis.tick_params(labelleft=i % _CURVES_A_ROW == 0)
        of_row = [f"late by\n({_UNITS[self.lags.unit]})", "", ""]
        ylabels = [of_row[i % _CURVES_A_ROW] for i in range(n_parts)]
        self._label_axes(
            self.axes_, ylabels, time.label, ends=time.clock, n_cols=min(n_parts, _CURVES_A_ROW)
        )
        titles = dict(zip(self.lags.parts, self.lags.parts, strict=True))
        if self.lags.groups is not None:
            # With their repeatability where it is known.
            icc = self.lags.summary()["icc"].dropna()
            titles |= {part: f"{part}, ICC {share:.2f}" for part, share in icc.items()}
        for axis, title in zip(self.axes_, titles.values(), strict=True):
            axis.set_title(title, fontsize="small")
        units = "trials" if self.lags.groups is None else "people"
        handles = [self.means_[0], self.intervals_[0], self.spreads_[0]]
        labels = [f"mean, {self._count()}", f"95 % interval ({units})", "± 1 SD of trials"]
        legend_above(self.axes_, handles, labels)

    def _count(self):
        people = ""
        if self.lags.groups is not None:
            n_people = len(np.unique(self.lags.groups))
            people = " of 1 person" if n_people == 1 else f" of {n_people} people"
        return f"{counted(len(self.lags.values), 'trial')}{people}"
