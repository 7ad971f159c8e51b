"""SynchronizationDisplay: features before and after synchronisation, and the warps (Figs. 1, 3)."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, Self

import numpy as np
from sklearn.base import BaseEstimator

from ..inputs.collections import as_collection
from ..inputs.facts import units_of_columns
from ..inputs.features import choose_features, names_of_features
from ..inputs.numbers import as_numbers, check_finite, check_names, nanmean
from ..inputs.types import (
    Features,
    Labels,
    NumbersLike,
    PerformanceLike,
    PerformancesLike,
    Unit,
    ValuesLike,
)
from ..inputs.validation import read_collection
from ..inputs.wording import counted
from ..synchronizers.match import Match, check_coverage, match_of_times, rates_of
from ..utils.groups import names_of_groups
from ..utils.pipelines import index_of_pattern, route_to_synchronizer, with_frame_rate
from .arguments import AxesLike, as_names, labels_of_signals, undo_scaling
from .drawing import (
    COLORS,
    WIDTH,
    curves,
    empty_lists,
    front_line,
    group_styles,
    legend_above,
    panels,
)
from .time_axis import (
    TimeAxis,
    check_own_keyframes,
    check_pattern_keyframes,
    draw_keyframes,
    draw_own_keyframes,
    named_keyframes,
    own_keyframes,
)

__all__ = ["SynchronizationDisplay"]

# Labels of the vertical axis of the warps.
_WARP_LABELS = {
    "frames": "frame of the trial,\nstretched to the template",
    "percent": "% of the trial",
    "seconds": "time of the trial (s),\nstretched to the template",
}
# The dots of doubtful trials, in line widths, and their opacity.
_DOTTED, _STRONG = (0, (1, 1.4)), 0.9
# The opacity of a band, at least and at most; and of all bands where they overlap.
_FAINTEST, _BAND, _BANDS = 0.01, 0.2, 0.4


class SynchronizationDisplay:
    """Features over time before and after synchronisation, and the warps (Figs. 1 and 3).

    Use `from_estimator` or `from_predictions`.

    Parameters
    ----------
    before : list of array-like (n_frames_i, n_shown)
        The features of the performances at their own frames; NaN in gaps.
    after : array-like, shape (n_sequences, P, n_shown)
        The features on the clock of the pattern.
    match : Match
        The warps, their intervals, and which performances are doubtful.
    axis : TimeAxis
        The times of the frames of performances and pattern.
    feature_names : list of str
        The names of the features.
    units : dict of str to str, default=None
        Their units by name, as far as they are known.
    pattern : array-like, shape (P, n_shown), default=None
        Drawn in front; by default the mean of the synchronised performances.
    pattern_index : int, default=None
        The index of the pattern among the performances.
    groups : sequence of length n_sequences, default=None
        The group of each performance, which determines its colour.
    keyframes : array-like, shape (n_sequences, n_keyframes), default=None
        Key-frames of the performances in their frames, NaN where one is not known: ticks.
    pattern_keyframes : array-like of shape (n_keyframes,) or Series, default=None
        Key-frames on the clock: lines. The index of a Series holds their names.
    coverage : float or None, default=0.9
        Probability of the intervals around the warps, as of `from_estimator`.

    Attributes
    ----------
    figure_ : Figure
        The figure of the last plot.
    axes_ : list of Axes
        For each feature the panels before and after, then that of the warps.
    before_, after_ : list of LineCollection
        The performances, one collection a feature.
    pattern_ : list of Line2D
        The pattern, one line a feature.
    group_means_ : list of list of Line2D
        For each feature the mean of each group; empty without groups.
    warps_ : LineCollection or None
        The warps.
    intervals_ : PolyCollection or None
        The bands around them, one a performance; None without intervals or warps.
    keyframes_ : list of list of Line2D
        The key-frames, for each panel on the clock; empty without any.
    own_keyframes_ : list of LineCollection
        Those of the performances, one collection a feature; empty without any.

    Examples
    --------
    >>> from sklearn.pipeline import make_pipeline
    >>> from sklearn_motionsync import ASpace, DenseSynchronizer, DirectionCosines
    >>> from sklearn_motionsync.display import SynchronizationDisplay
    >>> from sklearn_motionsync.datasets import make_bending
    >>> bunch = make_bending(6, random_state=0)
    >>> pipe = make_pipeline(DirectionCosines(bunch.skeleton), ASpace(), DenseSynchronizer(50))
    >>> pipe = pipe.fit(bunch.data)
    >>> display = SynchronizationDisplay.from_estimator(pipe, bunch.data, features=["aspace0"])
    >>> len(display.axes_)
    3
    """

    def __init__(
        self,
        before: Sequence[PerformanceLike],
        after: PerformancesLike,
        match: Match,
        axis: TimeAxis,
        *,
        feature_names: Sequence[str],
        units: Mapping[str, str] | None = None,
        pattern: PerformanceLike | None = None,
        pattern_index: int | None = None,
        groups: Sequence[object] | None = None,
        keyframes: NumbersLike | None = None,
        pattern_keyframes: ValuesLike | None = None,
        coverage: float | None = 0.9,
    ) -> None:
        self.before, self.after = [np.asarray(x) for x in before], np.asarray(after)
        self.match, self.times = match, match.times
        self.axis, self.feature_names = axis, feature_names
        self.units = {name: "" for name in feature_names} | dict(units or {})
        self.pattern = None if pattern is None else np.asarray(pattern)
        self.pattern_index, self.coverage = pattern_index, coverage
        self.groups = None if groups is None else list(map(str, groups))
        self.keyframes = None if keyframes is None else np.asarray(keyframes, dtype=np.float64)
        self.pattern_keyframes = check_pattern_keyframes(pattern_keyframes, match.times.shape[1])
        self.intervals = self.doubtful = None
        if coverage is not None and match.intervals is not None:
            self.intervals, self.doubtful = np.asarray(match.interval(coverage)), match.doubtful

    def __repr__(self):
        count = counted(len(self.before), "performance")
        return f"SynchronizationDisplay({count}, {self.feature_names})"

    @classmethod
    def from_estimator(
        cls,
        estimator: BaseEstimator,
        X: PerformancesLike,
        *,
        features: Features | None = None,
        groups: Labels | None = None,
        unit: Unit = "frames",
        frame_rate: float | ValuesLike | None = None,
        xlabel: str | None = None,
        warps: bool = True,
        keyframe_lines: bool = True,
        coverage: float | None = 0.9,
        ax: AxesLike | None = None,
        **params: Any,
    ) -> Self:
        """Draw performances before and after synchronisation.

        Parameters
        ----------
        estimator : synchronizer, or Pipeline with one
            Fitted.
        X : performances
            As the estimator takes them.
        features : int, str or list of them, default=None
            Features by index or name, as they reach the synchronizer, such as dimensions of the
            aSpace. By default the first four. What scalers before the synchronizer do is undone,
            and tables tell units in ``attrs["units"]``.
        groups : sequence of length n_sequences, default=None
            The group of each performance, such as ``bunch.actor``. Groups have different colours,
            and their means are drawn; all are on the clock of the same pattern.
        unit : {"frames", "percent", "seconds"}, default="frames"
            The unit of time: frames; per cent of a performance, and of the pattern; or seconds of
            the performances as recorded, and of the median performance on the clock.
        frame_rate : float, or array-like of shape (n_sequences,), default=None
            Frames a second of X, for seconds; by default what tables tell, as in
            `Match.to_frame`. Key-frames are then in seconds, as for ``match``.
        xlabel : str, default=None
            The label of time axes, such as ``"% gait cycle"``, in place of that of the unit.
        warps : bool, default=True
            Whether to draw tau(p) against the diagonal.
        keyframe_lines : bool, default=True
            Whether to draw the key-frames of the synchronizer, if it has some, as lines; and those
            of X that are given, as ticks.
        coverage : float or None, default=0.9
            Probability of the intervals of `Match.interval`, which are bands around the warps.
            Performances that are `Match.doubtful` are dotted in all panels. None: neither is
            drawn. Nor is it if the match does not tell: only those of a `DenseSynchronizer` or
            `PartSynchronizer` do.
        ax : Axes or array-like of Axes, default=None
            See `plot`.
        **params : dict
            Further arguments of the ``match`` of the synchronizer, such as ``keyframes``, in
            frames. The columns of a table of key-frames are their names.

        Returns
        -------
        SynchronizationDisplay
            The display, drawn.
        """
        if coverage is not None:
            check_coverage(coverage)
        params = with_frame_rate(params, frame_rate)
        reached = route_to_synchronizer(estimator, X, params, f"{cls.__name__}.from_estimator")
        before, synchronizer, performances = reached[:3]
        width = performances[0].shape[1]
        names = names_of_features(before, synchronizer, width)
        chosen = choose_features(features, names)
        undo, units = undo_scaling(before, X, width)
        match, shown = reached.match(), [undo(x)[:, chosen] for x in performances]
        groups = None if groups is None else names_of_groups(groups, len(performances))
        lengths = [len(x) for x in shown]
        rates = rates_of(X, frame_rate, unit)
        axis = TimeAxis(unit, match.times.shape[1], lengths, rates, xlabel)
        display = cls(
            shown,
            match.warp(shown),
            match,
            axis,
            feature_names=[names[i] for i in chosen],
            units=units,
            pattern=undo(synchronizer.pattern_)[:, chosen],
            pattern_index=index_of_pattern(synchronizer, performances),
            groups=groups,
            keyframes=own_keyframes(synchronizer, performances, params),
            pattern_keyframes=named_keyframes(synchronizer, params.get("keyframes")),
            coverage=coverage,
        )
        return display.plot(ax, warps=warps, keyframe_lines=keyframe_lines)

    @classmethod
    def from_predictions(
        cls,
        X: PerformancesLike,
        match: Match | NumbersLike,
        *,
        pattern: PerformanceLike | None = None,
        features: Features | None = None,
        feature_names: Sequence[str] | None = None,
        groups: Labels | None = None,
        unit: Unit = "frames",
        frame_rate: float | ValuesLike | None = None,
        xlabel: str | None = None,
        warps: bool = True,
        keyframes: NumbersLike | None = None,
        pattern_keyframes: ValuesLike | None = None,
        coverage: float | None = 0.9,
        ax: AxesLike | None = None,
    ) -> Self:
        """Draw performances and warps that are known already.

        Parameters
        ----------
        X : list of arrays (n_frames_i, n_features), 3-D array, or (performance, frame) frame
            Performances, with NaN in gaps.
        match : Match, or array-like of shape (n_sequences, P)
            Such as ``synchronizer.match(X)``; or the warps tau(p) from 0 to P - 1 alone.
        pattern : array-like, shape (P, n_features), default=None
            Drawn in front, with the features of X; by default the mean of the synchronised
            performances.
        features : int, str or list of them, default=None
            Features by index or name; by default the first four.
        feature_names : sequence of str, default=None
            The names of all features; by default those of the columns, or x0, x1, ...
        groups : sequence of length n_sequences, default=None
            The group of each performance, which determines its colour.
        unit : {"frames", "percent", "seconds"}, default="frames"
            The unit of time.
        frame_rate : float, or array-like of shape (n_sequences,), default=None
            Frames a second of X, for seconds; by default what tables tell, as in
            `Match.to_frame`.
        xlabel : str, default=None
            The label of time axes, such as ``"% gait cycle"``, in place of that of the unit.
        warps : bool, default=True
            Whether to draw tau(p) against the diagonal.
        keyframes : array-like, shape (n_sequences, n_keyframes), default=None
            Key-frames of the performances in their frames, NaN where one is not known: ticks.
        pattern_keyframes : array-like of shape (n_keyframes,) or Series, default=None
            Key-frames on the clock, such as ``synchronizer.keyframes_``: lines. The index of a
            Series holds their names.
        coverage : float or None, default=0.9
            Probability of the intervals around the warps, as of `from_estimator`.
        ax : Axes or array-like of Axes, default=None
            See `plot`.

        Returns
        -------
        SynchronizationDisplay
            The display, drawn.

        Raises
        ------
        ValueError
            If there is not one row of times or key-frames a performance, the pattern has another
            shape, the number of names differs, there is no such feature, a value is infinite, or
            a key-frame is not on the clock.
        """
        if coverage is not None:
            check_coverage(coverage)
        arrays, names = read_collection(X)
        if not isinstance(match, Match):
            match = match_of_times(match, len(arrays))
        width = arrays[0].shape[1]
        keyframes = check_own_keyframes(keyframes, len(arrays))
        if feature_names is None:
            feature_names = names or [f"x{i}" for i in range(width)]
        feature_names = as_names(feature_names, width, "feature_names", "features")
        groups = None if groups is None else names_of_groups(groups, len(arrays))
        for i, x in enumerate(arrays):
            check_finite(x, f"Performance {i}, frame", allow_nan=True)
        if pattern is not None:
            check_names(pattern, names, "The pattern")
            pattern, shape = as_numbers(pattern, "The pattern"), (match.times.shape[1], width)
            if pattern.shape != shape:
                raise ValueError(f"The pattern must have the shape {shape}, got {pattern.shape}.")
        chosen = choose_features(features, feature_names)
        shown = [x[:, chosen] for x in arrays]
        lengths = [len(x) for x in shown]
        rates = rates_of(X, frame_rate, unit)
        axis = TimeAxis(unit, match.times.shape[1], lengths, rates, xlabel)
        display = cls(
            shown,
            match.warp(shown),
            match,
            axis,
            feature_names=[feature_names[i] for i in chosen],
            units=units_of_columns(as_collection(X)[0]),
            pattern=None if pattern is None else pattern[:, chosen],
            groups=groups,
            keyframes=keyframes,
            pattern_keyframes=pattern_keyframes,
            coverage=coverage,
        )
        return display.plot(ax, warps=warps)

    def plot(
        self,
        ax: AxesLike | None = None,
        *,
        warps: bool = True,
        keyframe_lines: bool = True,
    ) -> Self:
        """Draw.

        Parameters
        ----------
        ax : Axes or array-like of Axes, default=None
            One of a figure's subplots is divided into the panels; or one axes a panel, for each
            feature before and after, then the warps. None makes a figure.
        warps : bool, default=True
            Whether to draw tau(p) against the diagonal.
        keyframe_lines : bool, default=True
            Whether to draw key-frames, if there are some.

        Returns
        -------
        SynchronizationDisplay
            The display itself.
        """
        n_rows = len(self.feature_names)
        cells: list[tuple] = [(row, column) for row in range(n_rows) for column in (0, 1)]
        cells += [(slice(n_rows, None), slice(None))] * bool(warps)
        styles = {} if self.groups is None else group_styles(self.groups)
        colors = [styles[group][0] for group in self.groups or ()] or COLORS["performance"]
        n_lines = -(-len(styles) // 3)
        # The warps are as high as two rows of features.
        n_all = n_rows + bool(warps) * min(n_rows, 2)
        size = (WIDTH, max(2.6, 1.6 * n_all + 0.8) + bool(warps) + 0.2 * n_lines)
        self.figure_, self.axes_ = panels(ax, cells, n_all, 2, size)
        clock, times = self.axis.clock, self.axis.performances()
        self.before_, self.after_, self.pattern_, self.group_means_ = [], [], [], []
        labels = labels_of_signals(self.feature_names, self.units)
        for row, label in enumerate(labels):
            left, right = self.axes_[2 * row : 2 * row + 2]
            before, after = [x[:, row] for x in self.before], self.after[:, :, row]
            self.before_.append(self._draw_trials(left, times, before, colors))
            self.after_.append(self._draw_trials(right, [clock] * len(after), after, colors))
            self.group_means_.append(self._draw_means(right, clock, row, styles))
            self.pattern_.append(self._draw_pattern(right, clock, row))
            left.set_ylabel(label)
            right.sharey(left)
            right.autoscale_view()
            if row == 0:
                dotted = "" if warps else self._describe_doubtful(", dotted: ")
                left.set_title(f"as recorded\n{counted(len(self.before), 'trial')}{dotted}")
                means = ", thick: group means" if styles else ""
                right.set_title(f"aligned{means}\n{self._describe_pattern()}")
        left.set_xlabel(self.axis.performance_label)
        right.set_xlabel(self.axis.label)
        self.warps_ = self.intervals_ = None
        if warps:
            self.intervals_ = self._draw_intervals(self.axes_[-1], clock, colors)
            self.warps_ = self._draw_warps(self.axes_[-1], clock, colors)
        self.keyframes_, self.own_keyframes_ = empty_lists(2)
        if keyframe_lines:
            self._draw_keyframes(colors)
        for axis in self.axes_:
            axis.set_title(axis.get_title(), fontsize="medium")
        if styles:
            handles, labels = self.group_means_[0], list(styles)
            legend_above(self.axes_, handles, labels, below=self.axes_[:2])
        return self

    def _draw_keyframes(self, colors):
        """Draw key-frames: lines on the clock, with names once, and ticks of the performances."""
        if self.pattern_keyframes is not None:
            times = self.axis.convert(self.pattern_keyframes.to_numpy())
            aligned = self.axes_[1 : 2 * len(self.feature_names) : 2]
            named = aligned if self.warps_ is None else [*aligned, self.axes_[-1]]
            for axis in named:
                names = self.pattern_keyframes.index if axis is named[-1] else ()
                by_diagonal = axis not in aligned
                lines = draw_keyframes(axis, times, names, by_diagonal=by_diagonal)
                self.keyframes_.append(lines)
        if self.keyframes is not None:
            times = self.axis.own(self.keyframes)
            for axis in self.axes_[: 2 * len(self.feature_names) : 2]:
                self.own_keyframes_.append(draw_own_keyframes(axis, times, colors))

    def _describe_pattern(self):
        if self.pattern is None:
            return "black: their mean"
        which = "" if self.pattern_index is None else f", trial {self.pattern_index}"
        return f"black: the template{which}"

    def _draw_trials(self, axis, xs, ys, colors):
        """Draw a curve of each performance; those of doubtful ones are dotted."""
        linestyles, linewidths, alpha = "-", 0.9, 0.35 if self.groups else 0.55
        if self._n_doubtful():
            colors = colors if self.groups else [colors] * len(self.before)
            linestyles = [_DOTTED if one else "-" for one in self.doubtful]
            linewidths = np.where(self.doubtful, 1.5, linewidths)
            alpha = np.where(self.doubtful, _STRONG, alpha)
        return curves(
            axis,
            xs,
            ys,
            colors=colors,
            linestyles=linestyles,
            linewidths=linewidths,
            alpha=alpha,
        )

    def _draw_means(self, axis, clock, row, styles):
        """Draw the mean of each group in front of its performances."""
        means = []
        for name, (color, line) in styles.items():
            members = np.array(self.groups) == name
            curve = nanmean(self.after[members, :, row], axis=0)
            means.append(front_line(axis, clock, curve, color=color, linestyle=line))
        return means

    def _draw_pattern(self, axis, clock, row):
        curve = nanmean(self.after[:, :, row], axis=0)
        if self.pattern is not None:
            curve = self.pattern[:, row]
        (line,) = axis.plot(
            clock,
            curve,
            color=COLORS["pattern"],
            linestyle="--" if self.groups else None,
            linewidth=1.2 if self.groups else 1.6,
            zorder=5,
        )
        return line

    def _draw_warps(self, axis, clock, colors):
        times = self.axis.convert(self.match.times)
        lines = self._draw_trials(axis, [clock] * len(times), times, colors)
        axis.plot(clock, clock, "--", color=COLORS["pattern"], linewidth=1)
        bands = ""
        if self.intervals is not None:
            bands = f"shaded: {100 * self.coverage:g} % intervals"
        dotted = self._describe_doubtful("dotted: ")
        second = "; ".join(words for words in (bands, dotted) if words)
        axis.set_title("\n".join(filter(None, ("warps; dashed: an even pace", second))))
        axis.set_xlabel(self.axis.label)
        axis.set_ylabel(_WARP_LABELS[self.axis.unit])
        for x, y, text, ha, va in (
            (0.04, 0.96, "later than\nthe template", "left", "top"),
            (0.96, 0.04, "earlier than\nthe template", "right", "baseline"),
        ):
            axis.text(
                x, y, text, ha=ha, va=va, transform=axis.transAxes, fontsize="small", color="0.3"
            )
        return lines

    def _draw_intervals(self, axis, clock, colors):
        """Draw bands around the warps, lighter if there are more; None without intervals."""
        from matplotlib.collections import PolyCollection
        from matplotlib.colors import to_rgba_array

        if self.intervals is None:
            return None
        lower, upper = self.axis.convert(self.intervals)
        n_sequences, n_doubtful = len(lower), self._n_doubtful()
        xs = np.concatenate([clock, clock[::-1]])
        ys = np.concatenate([lower, upper[:, ::-1]], axis=1)
        faces = np.tile(to_rgba_array(colors), (1 if self.groups else n_sequences, 1))
        # Those of doubtful performances are wide, few, and stay visible.
        faces[:, 3] = _opacity(n_sequences - n_doubtful)
        if n_doubtful:
            faces[self.doubtful, 3] = _opacity(n_doubtful)
        outlines = [np.column_stack([xs, y]) for y in ys]
        bands = PolyCollection(outlines, facecolors=faces, edgecolors="none", zorder=1)
        return axis.add_collection(bands)

    def _n_doubtful(self):
        return 0 if self.doubtful is None else int(np.count_nonzero(self.doubtful))

    def _describe_doubtful(self, before):
        """How many performances are doubtful, after other words; nothing if none is."""
        count = self._n_doubtful()
        return f"{before}{counted(count, 'doubtful trial')}" if count else ""


def _opacity(n_bands):
    """The opacity of each of so many bands, which overlap."""
    return float(np.clip(1 - (1 - _BANDS) ** (1 / max(n_bands, 1)), _FAINTEST, _BAND))
