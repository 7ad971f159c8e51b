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
from .base import COLORS, WIDTH, AxesLike, Display, TimeAxis, curves, front_line, legend_above

_UNITS = {"frames": "frames", "percent": "% of the time", "seconds": "s"}
# The largest number of curves in a row.
_CURVES_A_ROW = 3


@dataclass(eq=False, repr=False)
class LagDisplay(Display):
    """A map of lags, part by time, above the curves of the parts with their spread.

    The map shows the mean lag. It is hatched where the 95 % confidence interval of the mean
    contains 0. The curves show the mean and the interval; broken lines are one standard deviation
    of trials from the mean. Use `from_estimator`, or ``LagDisplay(lags).plot()`` with lags that are
    known already.

    Parameters
    ----------
    lags : Lags
        The result of `PartSynchronizer.lags`.
    xlabel : str, default=None
        The label of time axes.

    Attributes
    ----------
    axes_ : list of Axes
        The panel of the map, then those of the curves, one a part.
    map_ : QuadMesh
        The mean lags.
    unsure_ : list of PolyCollection
        The hatched stretches of each part.
    means_ : list of Line2D
        The mean of each part.
    intervals_ : list of FillBetweenPolyCollection
        The confidence interval of each part.
    spreads_ : list of LineCollection
        The standard deviation of each part.
    colorbar_ : Colorbar
        The scale of the map.

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
        return f"LagDisplay({self._describe()})"

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
        n_rows = 2 - (-n_parts // n_cols)
        # The map is as high as two rows of curves.
        curves_at = ((2 + i // n_cols, i % n_cols) for i in range(n_parts))
        cells = [(slice(0, 2), slice(None)), *curves_at]
        return cells, (n_rows, n_cols), (WIDTH, 0.6 + 1.6 * n_rows)

    def _draw(self):
        n_parts, n_frames = self.lags.values.shape[1:]
        unit = "frames" if self.lags.unit == "frames" else "percent"
        axis, table = TimeAxis(unit, n_frames, label=self.xlabel), self.lags.over_time()
        columns = {
            name: table[name].to_numpy().reshape(n_parts, n_frames)
            for name in ("mean", "sd", "low", "high")
        }
        top, *below = self.axes_
        self._draw_map(top, axis, columns)
        self._draw_curves(below, axis, columns)

    def _draw_map(self, top, axis, columns):
        mean = columns["mean"]
        largest = np.abs(mean).max() or 1.0
        self.map_ = top.pcolormesh(
            axis.clock,
            np.arange(len(mean)),
            mean,
            cmap="RdBu_r",
            vmin=-largest,
            vmax=largest,
            shading="nearest",
            rasterized=True,
        )
        # NaN bounds, of a single trial, are unsure as well.
        unsure = ~((columns["low"] > 0) | (columns["high"] < 0))
        self.unsure_ = [
            top.fill_between(
                axis.clock,
                i - 0.5,
                i + 0.5,
                where=where,
                step="mid",
                facecolor="none",
                edgecolor="0.35",
                hatch="////",
                linewidth=0,
            )
            for i, where in enumerate(unsure)
        ]
        names = list(self.lags.parts)
        if self.lags.groups is not None:
            # With their repeatability where it is known.
            icc = self.lags.summary()["icc"]
            names = [f"{name}\nICC {x:.2f}" if x == x else name for name, x in icc.items()]
        top.set_yticks(range(len(mean)), names, fontsize="small")
        top.set_ylim(len(mean) - 0.5, -0.5)
        top.set_xlim(axis.clock[0], axis.clock[-1])
        top.set_xlabel(axis.label)
        top.set_title(self._describe(), fontsize="small")
        top.grid(False)
        self.colorbar_ = self.figure_.colorbar(
            self.map_, ax=top, location="top", aspect=40, pad=0.02
        )
        self.colorbar_.set_label(f"mean lag ({_UNITS[self.lags.unit]})", fontsize="small")

    def _draw_curves(self, panels, axis, columns):
        self.means_, self.intervals_, self.spreads_ = [], [], []
        mean, sd = columns["mean"], np.nan_to_num(columns["sd"])
        reach = 1.05 * max((np.abs(mean) + sd).max(), 1e-9)
        for i, ax in enumerate(panels):
            ax.axhline(0, color="0.3", linewidth=0.8)
            low, high, grey = columns["low"][i], columns["high"][i], COLORS["envelope"]
            interval = ax.fill_between(axis.clock, low, high, color=grey, alpha=0.6, linewidth=0)
            self.intervals_.append(interval)
            ends, black = (mean[i] - sd[i], mean[i] + sd[i]), COLORS["pattern"]
            spread = curves(
                ax, [axis.clock] * 2, ends, colors=black, linewidths=0.9, linestyles="--"
            )
            self.spreads_.append(spread)
            self.means_.append(front_line(ax, axis.clock, mean[i], color=COLORS["mean"]))
            ax.set_title(self.lags.parts[i], fontsize="small")
            ax.set_xlim(axis.clock[0], axis.clock[-1])
            ax.set_ylim(-reach, reach)
            if i + _CURVES_A_ROW >= len(mean):
                ax.set_xlabel(axis.label, fontsize="small")
            if i % _CURVES_A_ROW:
                ax.tick_params(labelleft=False)
            else:
                ax.set_ylabel(f"late by\n({_UNITS[self.lags.unit]})", fontsize="small")
        units = "trials" if self.lags.groups is None else "people"
        handles = [self.means_[0], self.intervals_[0], self.spreads_[0]]
        legend_above(panels, handles, ["mean", f"95 % interval ({units})", "± 1 SD of trials"])

    def _describe(self):
        n_sequences, n_parts = self.lags.values.shape[:2]
        lagging = f"{n_parts} parts" if n_parts > 1 else self.lags.parts[0]
        people = ""
        if self.lags.groups is not None:
            n_people = len(np.unique(self.lags.groups))
            people = " of 1 person" if n_people == 1 else f" of {n_people} people"
        count = counted(n_sequences, "trial")
        return f"{lagging} behind the rest of the body, {count}{people}"
