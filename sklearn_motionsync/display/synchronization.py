"""SynchronizationDisplay: features before and after, and the warps (Figs. 1 and 3)."""

import numpy as np

from ..inputs.features import choose_features, names_of_features
from ..inputs.numbers import check_names
from ..inputs.validation import read_collection
from ..synchronizers.match import match_of_times
from ..utils.groups import names_of_groups
from ..utils.pipelines import index_of_pattern, route_to_synchronizer
from .drawing import COLORS, curves, front_line, group_colors, group_lines, legend_above, panels
from .given import as_drawn, as_names, mean_of_seen
from .time_axis import TimeAxis

__all__ = ["SynchronizationDisplay"]

_WARPED = {
    "frames": "frame tau(p) of the performance,\nevenly stretched to the clock",
    "percent": "% of the performance",
    "seconds": "time of the performance (s),\nevenly stretched to the clock",
}


class SynchronizationDisplay:
    """Features over time before and after synchronisation, and the warps (Figs. 1 and 3).

    Use `from_estimator` or `from_predictions`.

    Parameters
    ----------
    before : list of ndarray (n_frames_i, n_shown)
        The shown features of the performances, at their own frames; NaN where there is a gap.
    after : ndarray, shape (n_sequences, P, n_shown)
        The same on the clock of the pattern.
    times : ndarray, shape (n_sequences, P)
        tau(p), in frames of the pattern.
    feature_names : list of str
    pattern : ndarray, shape (P, n_shown), default=None
        Drawn in front; the mean if None.
    pattern_index : int, default=None
        Which of the performances is the pattern.
    groups : sequence of str, default=None
        The group of every performance, by which it is coloured: actors, sessions, ...
    unit : {"frames", "percent", "seconds"}, default="frames"
        Of the axes of time.
    frame_rate : float, or array-like of shape (n_sequences,), default=None
        Frames a second of the performances, for seconds.

    Attributes
    ----------
    figure_ : Figure
    axes_ : list of Axes
        For each feature the panels before and after, then that of the warps.
    before_, after_ : list of LineCollection
        The performances of each feature.
    pattern_ : list of Line2D
    group_means_ : list of list of Line2D
        For each feature the mean of every group; empty without groups.
    warps_ : LineCollection or None

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
        before,
        after,
        times,
        *,
        feature_names,
        pattern=None,
        pattern_index=None,
        groups=None,
        unit="frames",
        frame_rate=None,
    ):
        before, _ = read_collection(before)
        self.times = match_of_times(times, len(before)).times
        n_sequences, n_frames = self.times.shape
        n_shown = np.shape(after)[-1] if np.ndim(after) else 0
        self.feature_names = as_names(feature_names, n_shown, "feature_names", "features")
        self.before = [
            as_drawn(x, f"Performance {i}", ("n_frames", n_shown)) for i, x in enumerate(before)
        ]
        self.after = as_drawn(after, "What is synchronised", (n_sequences, n_frames, n_shown))
        self.pattern = None
        if pattern is not None:
            self.pattern = as_drawn(pattern, "The pattern", (n_frames, n_shown))
        self.pattern_index = pattern_index
        self.groups = None if groups is None else names_of_groups(groups, n_sequences)
        self.unit, self.frame_rate = unit, frame_rate
        lengths = [len(x) for x in self.before]
        self._axis = TimeAxis(unit, n_frames, lengths, frame_rate)

    def __repr__(self):
        return f"SynchronizationDisplay({len(self.before)} performances, {self.feature_names})"

    @classmethod
    def from_estimator(
        cls,
        estimator,
        X,
        *,
        features=None,
        groups=None,
        unit="frames",
        frame_rate=None,
        warps=True,
        ax=None,
        **params,
    ):
        """Draw what a fitted synchronizer, or a pipeline with one, does to performances.

        Parameters
        ----------
        estimator : synchronizer, or Pipeline with one
            Fitted.
        X : performances, as the estimator takes them
        features : int, str or list of them, default=None
            Which features to draw, by index or name: those that reach the synchronizer, which
            may be dimensions of the aSpace. By default the first four.
        groups : sequence of length n_sequences, default=None
            Colours performances by group, such as ``bunch.actor``, and draws the mean of each
            group; all of them are on the clock of the one pattern.
        unit : {"frames", "percent", "seconds"}, default="frames"
            Of the axes of time: frames; per cent of a performance, and of the pattern; or seconds
            of the performances as recorded, on the clock those of the median performance.
        frame_rate : float, or array-like of shape (n_sequences,), default=None
            Frames a second of X, for seconds.
        warps : bool, default=True
            Whether to draw tau(p) against the diagonal.
        ax : Axes or array-like of Axes, default=None
            See `plot`.
        **params : dict
            What the ``match`` of the synchronizer takes besides, such as ``keyframes``.

        Returns
        -------
        SynchronizationDisplay
        """
        reached = route_to_synchronizer(estimator, X, params, f"{cls.__name__}.from_estimator")
        before, synchronizer, performances = reached[:3]
        names = names_of_features(before, synchronizer, performances[0].shape[1])
        chosen = choose_features(features, names)
        match, shown = reached.match(), [x[:, chosen] for x in performances]
        display = cls(
            shown,
            match.warp(shown),
            match.times,
            feature_names=[names[i] for i in chosen],
            pattern=synchronizer.pattern_[:, chosen],
            pattern_index=index_of_pattern(synchronizer, performances),
            groups=groups,
            unit=unit,
            frame_rate=frame_rate,
        )
        return display.plot(ax, warps=warps)

    @classmethod
    def from_predictions(
        cls,
        X,
        times,
        *,
        pattern=None,
        features=None,
        feature_names=None,
        groups=None,
        unit="frames",
        frame_rate=None,
        warps=True,
        ax=None,
    ):
        """Draw performances and warps that are there already, whoever made them.

        Parameters
        ----------
        X : list of arrays (n_frames_i, n_features), 3-D array, or (performance, frame) frame
        times : array-like, shape (n_sequences, P)
            tau(p) from 0 to P - 1, such as ``synchronizer.match(X).times``.
        pattern : array-like, shape (P, n_features), default=None
            Drawn in front, with the features of X; by default the mean of the synchronised
            performances.
        features : int, str or list of them, default=None
        feature_names : sequence of str, default=None
            By default the names of the columns, or x0, x1, ...
        groups, unit, frame_rate, warps, ax : as for `from_estimator`

        Returns
        -------
        SynchronizationDisplay

        Raises
        ------
        ValueError
            If there is not one row of times a performance, a pattern of another shape, another
            number of names, a feature that does not exist, or something infinite.
        """
        arrays, names = read_collection(X)
        match, width = match_of_times(times, len(arrays)), arrays[0].shape[1]
        if feature_names is None:
            feature_names = names or [f"x{i}" for i in range(width)]
        feature_names = as_names(feature_names, width, "feature_names", "features")
        if pattern is not None:
            check_names(pattern, names, "The pattern")
            pattern = as_drawn(pattern, "The pattern", (match.times.shape[1], width))
        chosen = choose_features(features, feature_names)
        shown = [x[:, chosen] for x in arrays]
        display = cls(
            shown,
            match.warp(shown),
            match.times,
            feature_names=[feature_names[i] for i in chosen],
            pattern=None if pattern is None else pattern[:, chosen],
            groups=groups,
            unit=unit,
            frame_rate=frame_rate,
        )
        return display.plot(ax, warps=warps)

    def plot(self, ax=None, *, warps=True):
        """Draw.

        Parameters
        ----------
        ax : Axes or array-like of Axes, default=None
            One of a figure's subplots is divided into the panels; or one axes a panel, for each
            feature before and after, then the warps. None makes a figure.
        warps : bool, default=True
            Whether to draw tau(p) against the diagonal.

        Returns
        -------
        self
        """
        n_rows, n_cols = len(self.feature_names), 2 + bool(warps)
        spots = [(row, column) for row in range(n_rows) for column in (0, 1)]
        spots += [(slice(None), 2)] * bool(warps)
        colors, color_of = group_colors(self.groups, len(self.before))
        n_lines = -(-len(color_of) // 3)
        size = (3.2 * n_cols, max(2.6, 1.6 * n_rows + 0.8) + 0.2 * n_lines)
        self.figure_, self.axes_ = panels(ax, spots, n_rows, n_cols, size)
        style = {"colors": colors, "linewidths": 0.9, "alpha": 0.35 if color_of else 0.55}
        clock, own = self._axis.clock, self._axis.own()
        self.before_, self.after_, self.pattern_, self.group_means_ = [], [], [], []
        for row, name in enumerate(self.feature_names):
            left, right = self.axes_[2 * row : 2 * row + 2]
            self.before_.append(curves(left, own, [x[:, row] for x in self.before], **style))
            after = self.after[:, :, row]
            self.after_.append(curves(right, [clock] * len(after), after, **style))
            self.group_means_.append(self._draw_means(right, clock, row, color_of))
            self.pattern_.append(self._draw_pattern(right, clock, row))
            left.set_ylabel(name)
            right.sharey(left)
            right.autoscale_view()
            if row == 0:
                left.set_title(f"as recorded\n{len(self.before)} performances")
                means = ", thick: means of groups" if color_of else ""
                right.set_title(f"synchronised{means}\n{self._describe_pattern()}")
        left.set_xlabel(self._axis.label_of_performances)
        right.set_xlabel(self._axis.label)
        self.warps_ = self._draw_warps(self.axes_[-1], clock, style) if warps else None
        _small_titles(self.axes_)
        if color_of:
            handles, labels = self.group_means_[0], list(color_of)
            legend_above(self.axes_, handles, labels, below=self.axes_[:2])
        return self

    def _describe_pattern(self):
        if self.pattern is None:
            return "black: their mean"
        which = "" if self.pattern_index is None else f", performance {self.pattern_index}"
        return f"black: the pattern{which}"

    def _draw_means(self, axis, clock, row, color_of):
        """The mean of every group, in front of its performances."""
        means, lines = [], group_lines(len(color_of))
        for (name, color), line in zip(color_of.items(), lines, strict=True):
            members = np.array(self.groups) == name
            curve = mean_of_seen(self.after[members, :, row], axis=0)
            means.append(front_line(axis, clock, curve, color=color, linestyle=line))
        return means

    def _draw_pattern(self, axis, clock, row):
        curve = mean_of_seen(self.after[:, :, row], axis=0)
        if self.pattern is not None:
            curve = self.pattern[:, row]
        style = {"linestyle": "--", "linewidth": 1.2} if self.groups else {"linewidth": 1.6}
        (line,) = axis.plot(clock, curve, color=COLORS["pattern"], zorder=5, **style)
        return line

    def _draw_warps(self, axis, clock, style):
        times = self._axis.of_clock(self.times)
        lines = curves(axis, [clock] * len(times), times, **style)
        axis.plot(clock, clock, "--", color=COLORS["pattern"], linewidth=1)
        axis.set_title("warps\ndashed: an even pace")
        axis.set_xlabel(self._axis.label)
        axis.set_ylabel(_WARPED[self.unit])
        place = {"transform": axis.transAxes, "fontsize": "small", "color": "0.3"}
        axis.text(0.04, 0.96, "later than\nthe pattern", va="top", **place)
        axis.text(0.96, 0.04, "earlier than\nthe pattern", ha="right", **place)
        return lines


def _small_titles(axes):
    for axis in axes:
        axis.set_title(axis.get_title(), fontsize="medium")
