"""NormDisplay: a subject before a norm, in shape and timing."""

from __future__ import annotations

from collections.abc import Hashable, Mapping, Sequence
from typing import Self

import numpy as np

from ..comparison.norm import NormComparison
from ..inputs.features import choose_features
from ..inputs.types import Features
from ..inputs.wording import counted
from .arguments import AxesLike, labels_of_signals
from .drawing import COLORS, curves, front_line, legend_above, parts_outside, signal_panels
from .time_axis import TimeAxis, offset_label

__all__ = ["NormDisplay"]


class NormDisplay:
    """A subject before a norm: a panel for each signal, and one of the offset.

    The subject is the strongest line, violet where it departs. Use `from_comparison`.

    Parameters
    ----------
    comparison : NormComparison
        From `compare_to_norm`.
    subject : label
        One of ``comparison.verdicts.index``.
    signals : list of int
        The signals that are drawn, by index.
    labels : list of str
        Their labels.
    xlabel : str, default=None
        The label of the time axis.

    Attributes
    ----------
    figure_ : Figure
        The figure of the last plot.
    axes_ : list of Axes
        One a signal, then that of the offset.
    subject_, mean_ : list of Line2D
        The subject and the mean of the norm, one a panel.
    bands_ : list of FillBetweenPolyCollection
        The limits of the norm, one a panel.
    spread_ : list of FillBetweenPolyCollection
        One standard deviation of the norm, one a panel.
    departures_ : list of LineCollection
        The parts of the subject outside the limits, one a panel.

    Examples
    --------
    >>> from sklearn_motionsync import DenseSynchronizer, compare_to_norm
    >>> from sklearn_motionsync.display import NormDisplay
    >>> from sklearn_motionsync.datasets import make_gait
    >>> gait = make_gait(16, timing=6, random_state=0)
    >>> sync = DenseSynchronizer(n_frames=101).fit(gait.data)
    >>> found = compare_to_norm(sync, gait.data, gait.group, norm="A", people=gait.person)
    >>> display = NormDisplay.from_comparison(found, "person1", features=[0, 1], units="degrees")
    >>> len(display.axes_)
    3
    """

    def __init__(
        self,
        comparison: NormComparison,
        subject: Hashable,
        signals: Sequence[int],
        labels: Sequence[str],
        xlabel: str | None = None,
    ) -> None:
        self.comparison, self.subject = comparison, subject
        self.signals, self.labels, self.xlabel = signals, labels, xlabel

    def __repr__(self):
        return f"NormDisplay({self.comparison.describe(self.subject)!r})"

    @classmethod
    def from_comparison(
        cls,
        comparison: NormComparison,
        subject: Hashable,
        *,
        features: Features | None = None,
        ylabel: str | Sequence[str] | Mapping[str, str] | None = None,
        units: str | Sequence[str] | Mapping[str, str] | None = None,
        xlabel: str | None = None,
        ax: AxesLike | None = None,
    ) -> Self:
        """Draw a subject of a comparison.

        Parameters
        ----------
        comparison : NormComparison
            From `compare_to_norm`.
        subject : label
            One of ``comparison.verdicts.index``.
        features : int, str or list of them, default=None
            Signals that are drawn, by index or name. By default those with a departure and the
            first ones, four in all. The offset is always drawn.
        ylabel : str, list of str or dict, default=None
            Labels of the signals in place of their names: one each, or by name.
        units : str, list of str or dict, default=None
            Units of the signals for their labels: of all, one each, or by name. By default what
            tables tell.
        xlabel : str, default=None
            The label of time axes, such as ``"% gait cycle"``, in place of that of the unit.
        ax : Axes or array-like of Axes, default=None
            See `plot`.

        Returns
        -------
        NormDisplay
            The display, drawn.

        Raises
        ------
        ValueError
            If there is no such subject or feature, or labels or units do not fit the signals.

        See Also
        --------
        sklearn_motionsync.compare_to_norm : Makes the comparison.
        """
        if not isinstance(comparison, NormComparison):
            raise ValueError(f"Give what compare_to_norm returns, got {type(comparison).__name__}.")
        subjects = comparison.verdicts.index.to_list()
        if subject not in subjects:
            raise ValueError(f"There is no subject {subject!r}; there are {subjects[:8]}.")
        signals = comparison.features[:-1]
        if features is None:
            table = comparison.departures
            is_departure = (table["subject"] == subject) & (table["what"] == "shape")
            departing = map(signals.index, table[is_departure]["feature"])
            order = list(dict.fromkeys([*departing, *range(len(signals))]))
            chosen = sorted(order[: len(choose_features(None, signals))])
        else:
            chosen = choose_features(features, signals)
        names = [signals[k] for k in chosen]
        known_units = dict(zip(comparison.features, comparison.units, strict=True))
        labels = labels_of_signals(names, known_units, ylabel, units)
        return cls(comparison, subject, chosen, labels, xlabel).plot(ax)

    def plot(self, ax: AxesLike | None = None) -> Self:
        """Draw.

        Parameters
        ----------
        ax : Axes or array-like of Axes, default=None
            One of a figure's subplots is divided into the panels; or one axes a signal and one for
            the offset. None makes a figure.

        Returns
        -------
        NormDisplay
            The display itself.
        """
        norm = self.comparison
        subject = norm.verdicts.index.get_loc(self.subject)
        axis_of_time = TimeAxis.of_clock(norm.unit, norm.clock, self.xlabel)
        self.figure_, self.axes_, top = signal_panels(ax, len(self.signals), 1.0)
        self.subject_, self.mean_, self.bands_ = [], [], []
        self.spread_, self.departures_ = [], []
        clock, grey, violet = norm.clock, COLORS["envelope"], COLORS["departure"]
        # The offset is the last of the signals.
        shown, labels = [*self.signals, -1], [*self.labels, offset_label(norm.unit)]
        for axis, k, label in zip(self.axes_, shown, labels, strict=True):
            mean, std, curve = norm.mean[:, k], norm.std[:, k], norm.curves[subject, :, k]
            reach = norm.limits[subject, k] * std
            lower, upper = mean - reach, mean + reach
            band = axis.fill_between(clock, lower, upper, color=grey, alpha=0.3, linewidth=0)
            self.bands_.append(band)
            low, high = mean - std, mean + std
            spread = axis.fill_between(clock, low, high, color=grey, alpha=0.5, linewidth=0)
            self.spread_.append(spread)
            self.mean_.extend(axis.plot(clock, mean, color="0.3", linewidth=1, linestyle="--"))
            line = front_line(axis, clock, curve, color=COLORS["performance"], linewidth=2.4)
            self.subject_.append(line)
            xs, ys = parts_outside(curve[np.newaxis], lower, upper)
            xs = axis_of_time.convert(xs)
            lines = curves(axis, xs, ys, colors=violet, linewidths=2.8, zorder=5)
            self.departures_.append(lines)
            axis.set_ylabel(label)
            axis.set_xlim(clock[0], clock[-1])
        self.axes_[-1].set_xlabel(axis_of_time.label)
        handles = [self.subject_[0], (self.spread_[0], self.mean_[0]), self.bands_[0]]
        n_trials = int(norm.verdicts["n_trials"].iloc[subject])
        labels = [
            f"{self.subject}: {counted(n_trials, 'trial')}",
            f"norm: mean and standard deviation of {norm.n_people} people",
            f"{100 * (1 - norm.level):.3g} % of new people stay inside in all panels",
        ]
        if any(len(lines.get_segments()) for lines in self.departures_):
            handles.insert(1, self.departures_[0])
            labels.insert(1, "departs")
        title = norm.describe(self.subject)
        legend_above(self.axes_[:-1], handles, labels, title, below=top, n_cols=1)
        return self
