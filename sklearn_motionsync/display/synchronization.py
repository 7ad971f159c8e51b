"""SynchronizationDisplay: features before and after, and the warps (Figs. 1 and 3)."""

import numpy as np

from ..features import choose_features, names_of
from ..gate import check_names
from ..performances import read_collection
from ..pipelines import index_of_pattern, reach_synchronizer
from ..synchronizers.match import as_match
from .drawing import COLORS, curves, group_colors, panels
from .given import as_drawn, as_names, mean_of_seen

__all__ = ["SynchronizationDisplay"]


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

    Attributes
    ----------
    figure_ : Figure
    axes_ : list of Axes
        For each feature the panels before and after, then that of the warps.
    before_, after_ : list of LineCollection
        The performances of each feature.
    pattern_ : list of Line2D
    warps_ : LineCollection or None

    Examples
    --------
    >>> from sklearn.pipeline import make_pipeline
    >>> from sklearn_motionsync import ASpace, DenseSynchronizer, DirectionCosines
    >>> from sklearn_motionsync import SynchronizationDisplay
    >>> from sklearn_motionsync.datasets import make_bending
    >>> bunch = make_bending(6, random_state=0)
    >>> pipe = make_pipeline(DirectionCosines(bunch.skeleton), ASpace(), DenseSynchronizer(50))
    >>> pipe = pipe.fit(bunch.data)
    >>> display = SynchronizationDisplay.from_estimator(pipe, bunch.data, features=["aspace0"])
    >>> len(display.axes_)
    3
    """

    def __init__(
        self, before, after, times, *, feature_names, pattern=None, pattern_index=None, groups=None
    ):
        before, _ = read_collection(before)
        self.times = as_match(times, len(before)).times
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
        self.groups = groups

    def __repr__(self):
        return f"SynchronizationDisplay({len(self.before)} performances, {self.feature_names})"

    @classmethod
    def from_estimator(
        cls, estimator, X, *, features=None, groups=None, warps=True, ax=None, **params
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
            Colours performances by group, such as ``bunch.actor``.
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
        reached = reach_synchronizer(estimator, X, params, f"{cls.__name__}.from_estimator")
        before, synchronizer, performances = reached[:3]
        names = names_of(before, synchronizer, performances[0].shape[1])
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
        groups, warps, ax : as for `from_estimator`

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
        match, width = as_match(times, len(arrays)), arrays[0].shape[1]
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
        size = (3.2 * n_cols, max(2.6, 1.6 * n_rows + 0.8))
        self.figure_, self.axes_ = panels(ax, spots, n_rows, n_cols, size)
        colors, color_of = group_colors(self.groups, len(self.before))
        style = {"colors": colors, "linewidths": 0.9, "alpha": 0.55}
        clock = np.arange(self.times.shape[1])
        self.before_, self.after_, self.pattern_ = [], [], []
        for row, name in enumerate(self.feature_names):
            left, right = self.axes_[2 * row : 2 * row + 2]
            own = [np.arange(len(x)) for x in self.before]
            self.before_.append(curves(left, own, [x[:, row] for x in self.before], **style))
            after = self.after[:, :, row]
            self.after_.append(curves(right, [clock] * len(after), after, **style))
            self.pattern_.append(self._draw_pattern(right, clock, row))
            left.set_ylabel(name)
            right.sharey(left)
            right.autoscale_view()
            if row == 0:
                left.set_title(f"as recorded\n{len(self.before)} performances")
                right.set_title(f"synchronised\n{self._describe_pattern()}")
        left.set_xlabel("frame of the performance")
        right.set_xlabel("frame of the pattern")
        self.warps_ = self._draw_warps(self.axes_[-1], clock, style) if warps else None
        if color_of:
            _legend_of_groups(self.axes_[0], color_of)
        _small_titles(self.axes_)
        return self

    def _describe_pattern(self):
        if self.pattern is None:
            return "black: their mean"
        which = "" if self.pattern_index is None else f", performance {self.pattern_index}"
        return f"black: the pattern{which}"

    def _draw_pattern(self, axis, clock, row):
        curve = mean_of_seen(self.after[:, :, row], axis=0)
        if self.pattern is not None:
            curve = self.pattern[:, row]
        (line,) = axis.plot(clock, curve, color=COLORS["pattern"], linewidth=1.6)
        return line

    def _draw_warps(self, axis, clock, style):
        lines = curves(axis, [clock] * len(self.times), self.times, **style)
        axis.plot(clock, clock, "--", color=COLORS["pattern"], linewidth=1)
        axis.set_title("warps\ndashed: an even pace")
        axis.set_xlabel("frame p of the pattern")
        axis.set_ylabel("frame tau(p) of the performance,\nevenly stretched to the clock")
        place = {"transform": axis.transAxes, "fontsize": "small", "color": "0.3"}
        axis.text(0.04, 0.96, "later than\nthe pattern", va="top", **place)
        axis.text(0.96, 0.04, "earlier than\nthe pattern", ha="right", **place)
        return lines


def _legend_of_groups(axis, color_of):
    handles = [axis.plot([], [], color=color, label=name)[0] for name, color in color_of.items()]
    axis.legend(handles=handles, loc="best", fontsize="small", frameon=True)


def _small_titles(axes):
    for axis in axes:
        axis.set_title(axis.get_title(), fontsize="medium")
