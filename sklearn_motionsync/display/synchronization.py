"""SynchronizationDisplay: features before and after synchronisation, and offsets (Figs. 1, 3)."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, Self

import numpy as np
from sklearn.base import BaseEstimator

from ..inputs.features import choose_features, names_of_features
from ..inputs.numbers import nanmean
from ..inputs.types import Features, Labels, TrialsLike, Unit
from ..inputs.wording import counted
from ..synchronizers.match import Match
from ..utils.groups import names_of_groups
from ..utils.pipelines import index_of_pattern, route_to_synchronizer
from .arguments import labels_of_signals, undo_scaling
from .base import (
    COLORS,
    WIDTH,
    AxesLike,
    Display,
    TimeAxis,
    curves,
    empty_lists,
    front_line,
    group_styles,
    legend_above,
    named_keyframes,
    offset_label,
)

# The dots of doubtful trials, in line widths, and their opacity.
_DOTTED, _STRONG = (0, (1, 1.4)), 0.9
# Probability of the intervals around offsets.
_COVERAGE = 0.9
# The opacity of a band, at least and at most; and of all bands where they overlap.
_FAINTEST, _BAND, _BANDS = 0.01, 0.2, 0.4


class SynchronizationDisplay(Display):
    """Features over time before and after synchronisation, and the offsets (Figs. 1 and 3).

    Below the features are the offsets: how much later or earlier than the others a trial is.
    They are counted from the mean offset of all trials, so this mean is a line at 0. Use
    `from_estimator`.

    Attributes
    ----------
    before : list of ndarray (n_frames_i, n_shown)
        The features of the trials at their own frames; NaN in gaps.
    after : ndarray, shape (n_sequences, P, n_shown)
        The features on the clock of the pattern.
    match : Match
        The warps, their intervals, and which trials are doubtful.
    axes_ : list of Axes
        For each feature the panels before and after, then that of the offsets.
    before_, after_ : list of LineCollection
        The trials, one collection a feature.
    pattern_ : list of Line2D
        The pattern, one line a feature.
    group_means_ : list of list of Line2D
        For each feature the mean of each group; empty without groups.
    offsets_ : LineCollection or None
        The offsets.
    intervals_ : PolyCollection or None
        The bands around them, one a trial; None without intervals or offsets.
    keyframes_ : list of list of Line2D
        The key-frames, for each panel on the clock; empty without any.
    own_keyframes_ : list of LineCollection
        Those of the trials, one collection a feature; empty without any.

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

    before: Sequence[np.ndarray]
    after: np.ndarray
    match: Match
    axis: TimeAxis
    ylabels: Sequence[str]
    pattern: np.ndarray  # (P, n_shown)
    titles: tuple[str, str]  # of the panels before and after
    groups: Sequence[str] | None = None  # of each trial
    warps: bool = True  # whether to draw the offsets

    def __repr__(self):
        count = counted(len(self.before), "trial")
        return f"SynchronizationDisplay({count}, {list(self.ylabels)})"

    @classmethod
    def from_estimator(
        cls,
        estimator: BaseEstimator | Match,
        X: TrialsLike,
        *,
        features: Features | None = None,
        y: Labels | None = None,
        unit: Unit = "frames",
        units: str | Sequence[str] | Mapping[str, str] | None = None,
        xlabel: str | None = None,
        warps: bool = True,
        ax: AxesLike | None = None,
        **params: Any,
    ) -> Self:
        """Draw trials before and after synchronisation.

        Parameters
        ----------
        estimator : synchronizer, Pipeline with one, or Match of X
            Fitted.
        X : trials
            As the estimator takes them.
        features : int, str or list of them, default=None
            Features by index or name, as they reach the synchronizer, such as dimensions of the
            aSpace. By default the first four. What scalers before the synchronizer do is undone.
        y : sequence of length n_sequences, default=None
            What the trials are told apart by, such as a condition. Each label has a colour, and the
            mean of its trials is drawn; all are on the clock of the same pattern.
        unit : {"frames", "percent", "seconds"}, default="frames"
            The unit of time: frames; per cent of a trial, and of the pattern; or seconds of
            the trials as recorded, and of the median trial on the clock.
        units : str, list of str or dict, default=None
            The units of the features: of all, one each, or by name. By default what tables tell in
            ``attrs["units"]``.
        xlabel : str, default=None
            The label of time axes, such as ``"% gait cycle"``, in place of that of the unit.
        warps : bool, default=True
            Whether to draw the offsets, in a panel of their own. The bands around them are the
            intervals of 90 % of `Match.interval`. Trials that are `Match.doubtful` are dotted in
            all panels. Neither is drawn if the match does not tell: only those of a
            `DenseSynchronizer` or `PartSynchronizer` do.
        ax : Axes or array-like of Axes, default=None
            See `plot`.
        **params : dict
            Further arguments of the ``match`` of the synchronizer: ``frame_rate``, frames a second
            of X, which seconds need where tables do not tell; ``keyframes``, which are seconds
            where a frame rate is given: lines on the clock, and ticks of each trial. The columns of
            a table of key-frames are their names.

        Returns
        -------
        SynchronizationDisplay
            The display, drawn.
        """
        reached = route_to_synchronizer(estimator, X, params, f"{cls.__name__}.from_estimator")
        steps, synchronizer, trials = reached[:3]
        width = trials[0].shape[1]
        names = names_of_features(steps, synchronizer, width)
        chosen = choose_features(features, names)
        undo, known_units = undo_scaling(steps, X, width)
        match, before = reached.match(), [undo(x)[:, chosen] for x in trials]
        pattern = undo(synchronizer.pattern_)[:, chosen]
        lengths, ticks = [len(x) for x in trials], reached.keyframes
        lasting = reached.facts.durations() if unit == "seconds" else None
        lines = named_keyframes(synchronizer, reached.params.get("keyframes"))
        axis = TimeAxis(
            unit, len(pattern), lengths, lasting, xlabel, keyframes=lines, trial_keyframes=ticks
        )
        index = index_of_pattern(synchronizer, trials)
        title = "the pattern" if index is None else f"the pattern, trial {index}"
        return cls._of(
            before=before,
            after=match.warp(before),
            match=match,
            axis=axis,
            ylabels=labels_of_signals([names[i] for i in chosen], known_units, units),
            pattern=pattern,
            titles=("as recorded", title),
            groups=None if y is None else names_of_groups(y, len(trials), name="y"),
            warps=bool(warps),
        ).plot(ax)

    @property
    def doubtful(self) -> np.ndarray | None:
        """Which trials are doubtful; None if the match does not tell."""
        return None if self.match.intervals is None else self.match.doubtful

    @property
    def times(self) -> np.ndarray:
        """The times of the match, (n_sequences, P), in frames."""
        return self.match.times

    def _layout(self):
        n_rows = len(self.ylabels)
        cells = [(row, column) for row in range(n_rows) for column in (0, 1)]
        cells += [(slice(n_rows, None), slice(None))] * self.warps
        # The offsets are as high as two rows of features.
        n_all = n_rows + self.warps * min(n_rows, 2)
        n_lines = -(-len(set(self.groups or ())) // 3)
        height = max(2.6, 1.6 * n_all + 0.8) + self.warps + 0.2 * n_lines
        return cells, (n_all, 2), (WIDTH, height)

    def _draw(self):
        styles = {} if self.groups is None else group_styles(self.groups)
        colors = [styles[group][0] for group in self.groups or ()] or COLORS["trial"]
        clock, times, n_rows = self.axis.clock, self.axis.trials(), len(self.ylabels)
        self.before_, self.after_, self.pattern_, self.group_means_ = empty_lists(4)
        lefts, rights = self.axes_[: 2 * n_rows : 2], self.axes_[1 : 2 * n_rows : 2]
        for row, (left, right) in enumerate(zip(lefts, rights, strict=True)):
            before, after = [x[:, row] for x in self.before], self.after[:, :, row]
            self.before_.append(self._draw_trials(left, times, before, colors))
            self.after_.append(self._draw_trials(right, [clock] * len(after), after, colors))
            self.group_means_.append([])
            for name, (color, line) in styles.items():
                members = np.array(self.groups) == name
                curve = nanmean(self.after[members, :, row], axis=0)
                line = front_line(right, clock, curve, color=color, linestyle=line)
                self.group_means_[-1].append(line)
            self.pattern_ += right.plot(
                clock,
                self.pattern[:, row],
                color=COLORS["pattern"],
                linestyle="--" if styles else "-",
                linewidth=1.2 if styles else 1.6,
                zorder=5,
            )
            right.sharey(left)
            right.autoscale_view()
        self._label_axes(lefts, self.ylabels, self.axis.trial_label)
        self._label_axes(rights, [""] * n_rows, self.axis.label)
        before, pattern = self.titles
        dotted = "" if self.warps else self._describe_doubtful(", dotted: ")
        title = f"{before}\n{counted(len(self.before), 'trial')}{dotted}"
        lefts[0].set_title(title, fontsize="medium")
        means = ", thick: group means" if styles else ""
        rights[0].set_title(f"aligned{means}\nblack: {pattern}", fontsize="medium")
        self.offsets_ = self.intervals_ = None
        if self.warps:
            self._draw_offsets(self.axes_[-1], clock, colors)
        # Names are below the curves, once.
        on_clock = [*rights, *self.axes_[2 * n_rows :]]
        self.keyframes_ = self.axis.draw_keyframes(on_clock, on_clock[-1])
        self.own_keyframes_ = self.axis.draw_trial_keyframes(lefts, colors)
        if styles:
            legend_above(self.axes_, self.group_means_[0], list(styles), below=self.axes_[:2])

    def _draw_trials(self, axis, xs, ys, colors):
        """Draw a curve of each trial; those of doubtful ones are dotted."""
        linestyles, linewidths, alpha = "-", 0.9, 0.35 if self.groups else 0.55
        if self._n_doubtful():
            colors = colors if self.groups else [colors] * len(self.before)
            linestyles = [_DOTTED if one else "-" for one in self.doubtful]
            linewidths = np.where(self.doubtful, 1.5, linewidths)
            alpha = np.where(self.doubtful, _STRONG, alpha)
        return curves(
            axis, xs, ys, colors=colors, linestyles=linestyles, linewidths=linewidths, alpha=alpha
        )

    def _draw_offsets(self, axis, clock, colors):
        """Draw offsets from their mean, and bands around them if the match tells intervals."""
        match, unit, bands = self.match, self.axis.unit, ""
        offsets = match.offsets_in(unit)
        mean = offsets.mean(axis=0)
        if self.doubtful is not None:
            warps = (Match(bound).of_trials(match.facts) for bound in match.interval(_COVERAGE))
            bounds = (warp.offsets_in(unit) - mean for warp in warps)
            self.intervals_ = self._draw_intervals(axis, clock, *bounds, colors)
            bands = f"shaded: {100 * _COVERAGE:g} % intervals"
        self.offsets_ = self._draw_trials(axis, [clock] * len(offsets), offsets - mean, colors)
        axis.axhline(0, color=COLORS["pattern"], linestyle="--", linewidth=1)
        second = "; ".join(filter(None, (bands, self._describe_doubtful("dotted: "))))
        title = "\n".join(filter(None, ("offsets", second)))
        axis.set_title(title, fontsize="medium")
        self._label_axes([axis], [offset_label(self.axis.unit)], self.axis.label, ends=clock)

    def _draw_intervals(self, axis, clock, lower, upper, colors):
        """Draw bands around the offsets, lighter if there are more."""
        from matplotlib.collections import PolyCollection
        from matplotlib.colors import to_rgba_array

        n_sequences, n_doubtful = len(lower), self._n_doubtful()
        xs = np.concatenate([clock, clock[::-1]])
        ys = np.concatenate([lower, upper[:, ::-1]], axis=1)
        faces = np.tile(to_rgba_array(colors), (1 if self.groups else n_sequences, 1))
        # Those of doubtful trials are wide, few, and stay visible.
        faces[:, 3] = _opacity(n_sequences - n_doubtful)
        if n_doubtful:
            faces[self.doubtful, 3] = _opacity(n_doubtful)
        outlines = [np.column_stack([xs, y]) for y in ys]
        bands = PolyCollection(outlines, facecolors=faces, edgecolors="none", zorder=1)
        return axis.add_collection(bands)

    def _n_doubtful(self):
        return 0 if self.doubtful is None else int(np.count_nonzero(self.doubtful))

    def _describe_doubtful(self, before):
        """How many trials are doubtful, after other words; nothing if none is."""
        count = self._n_doubtful()
        return f"{before}{counted(count, 'doubtful trial')}" if count else ""


def _opacity(n_bands):
    """The opacity of each of so many bands, which overlap."""
    return float(np.clip(1 - (1 - _BANDS) ** (1 / max(n_bands, 1)), _FAINTEST, _BAND))
