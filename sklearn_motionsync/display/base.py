"""What all displays share: panels, names and units on axes, key-frames, colours, and legends."""

from __future__ import annotations

from collections.abc import Iterable
from itertools import cycle
from textwrap import fill
from typing import TYPE_CHECKING, Any, Self, TypeAlias

import numpy as np
import pandas as pd

from ..synchronizers.match import UNITS, check_unit

if TYPE_CHECKING:
    from matplotlib.axes import Axes

    AxesLike: TypeAlias = Axes | Iterable[Axes] | np.ndarray
else:
    # matplotlib is imported on drawing.
    AxesLike = Any

# Okabe and Ito's colours and a violet, which colour-blind people can distinguish. Each has one
# meaning in all figures.
COLORS = {
    "trial": "#0072B2",
    "pattern": "#000000",
    "mean": "#D55E00",
    "envelope": "#999999",
    "left": "#0072B2",
    "middle": "#4D4D4D",
    "right": "#D55E00",
    # Beside departures all else is grey.
    "departure": "#A000F0",
    "quiet": "#808080",
    "shadow": "#D9D9D9",
}
# The width of a new figure in inches: its text is still readable on a phone.
WIDTH = 6.4
# Colours of groups, without black, which is the pattern.
_GROUPS = ["#0072B2", "#D55E00", "#009E73", "#E69F00", "#CC79A7", "#56B4E9"]
# Line styles of the means of more groups, whose colours are similar.
_LINES = ["-", "--", ":", "-."]
# Points between a legend and a title above it.
_GAP = 6
# Font sizes of a legend; the largest with which the legend fits into the figure is used.
_SIZES = ["small", "x-small", "xx-small"]
_TRIAL_LABELS = {
    "frames": "frame of the trial",
    "percent": "% of the trial",
    "seconds": "time of the trial (s)",
}
_CLOCK_LABELS = {
    "frames": "frame of the pattern",
    "percent": "% of the pattern",
    "seconds": "time of the median trial (s)",
}
# The height of ticks, as a share of the panel.
_TICK = 0.05


def pyplot():
    """``matplotlib.pyplot``, which only drawing needs."""
    try:
        import matplotlib.pyplot as plt
    except ImportError as error:
        raise ImportError("Drawing needs matplotlib: pip install matplotlib.") from error
    return plt


def empty_lists(n: int) -> list[list]:
    """Lists that a plot fills with what it draws."""
    return [[] for _ in range(n)]


class Display:
    """The base of all displays: a figure with panels, which may be drawn any number of times.

    A display is computed before it is drawn: what is drawn are attributes, which its class lists
    and ``from_estimator`` computes. It tells the layout of its panels (`_layout`), and draws on
    them (`_draw`).

    Attributes
    ----------
    figure_ : Figure
        The figure of the last plot.
    axes_ : list of Axes
        The panels of the last plot.
    """

    figure_: Any
    axes_: list

    @classmethod
    def _of(cls, **drawn: Any) -> Self:
        """A display of what is drawn, by the names that its class lists."""
        display = cls()
        vars(display).update(drawn)
        return display

    def plot(self, ax: AxesLike | None = None) -> Self:
        """Draw.

        Parameters
        ----------
        ax : Axes or array-like of Axes, default=None
            One of a figure's subplots is divided into the panels; or one axes a panel, in the order
            of ``axes_``. None makes a figure.

        Returns
        -------
        Display
            The display itself.
        """
        self.figure_, self.axes_ = self._panels(ax)
        self._draw()
        return self

    def _panels(self, ax):
        """The figure and its axes: those of the user, or new ones in cells of a grid."""
        plt = pyplot()
        cells, shape, size = self._layout()
        if ax is None:
            figure = plt.figure(figsize=size, layout="constrained")
            grid = figure.add_gridspec(*shape)
            return figure, [figure.add_subplot(grid[cell]) for cell in cells]
        axes = list(np.ravel(np.asarray(ax, dtype=object)))
        if not axes or not all(isinstance(a, plt.Axes) for a in axes):
            raise ValueError(f"ax must be Axes of matplotlib, got {ax!r:.80}.")
        figure = axes[0].figure
        if len(axes) == len(cells):
            for axis in axes:
                if axis in getattr(self, "axes_", ()):
                    axis.clear()
            return figure, axes
        if len(axes) != 1 or axes[0].get_subplotspec() is None:
            raise ValueError(
                f"ax must be one of a figure's subplots, to be divided, or {len(cells)} axes, one "
                f"a panel; got {len(axes)}."
            )
        axes[0].set_axis_off()
        grid = axes[0].get_subplotspec().subgridspec(*shape)
        return figure, [figure.add_subplot(grid[cell]) for cell in cells]

    def _layout(self):
        """The cells of the panels, the rows and columns of their grid, and the size in inches."""
        raise NotImplementedError

    def _draw(self):
        """Draw on ``axes_``, and set the artists as attributes."""
        raise NotImplementedError

    def _label_axes(self, axes, ylabels, xlabel, *, ends=None, n_cols=1):
        """Write names and units on panels in a grid, the time below the lowest of each column."""
        for i, (axis, ylabel) in enumerate(zip(axes, ylabels, strict=True)):
            axis.set_ylabel(ylabel)
            if ends is not None:
                axis.set_xlim(ends[0], ends[-1])
            if i + n_cols >= len(axes):
                axis.set_xlabel(xlabel)


def signal_layout(count, more=0.0):
    """Panels of signals, two in a row if there are three or more, above a wide one of their timing.

    Parameters
    ----------
    count : int
        Of the signals.
    more : float, default=0.0
        Height in inches beside that of the panels.

    Returns
    -------
    cells, shape, size
        As `Display._layout` tells them.
    """
    n_cols = 1 if count < 3 else 2
    n_rows = -(-count // n_cols)
    cells = [divmod(i, n_cols) for i in range(count)] + [(n_rows, slice(None))]
    return cells, (n_rows + 1, n_cols), (WIDTH, 1.9 * (n_rows + 1) + more)


def curves(axis, xs, ys, **style):
    """Draw many curves as one artist."""
    from matplotlib.collections import LineCollection

    lines = LineCollection([np.column_stack(xy) for xy in zip(xs, ys, strict=True)], **style)
    axis.add_collection(lines)
    axis.autoscale_view()
    return lines


def front_line(axis, xs, ys, **style):
    """Draw a curve in front of others, with a white outline."""
    from matplotlib.patheffects import Normal, Stroke

    style = {"linewidth": 1.8, "zorder": 4} | style
    rim = [Stroke(linewidth=style["linewidth"] + 1.4, foreground="white"), Normal()]
    (line,) = axis.plot(xs, ys, path_effects=rim, **style)
    return line


def legend_above(top, handles, labels=None, title=None, below=None, n_cols=6):
    """Draw a legend between panels and their titles, where it hides no curve.

    Panels of a figure without a layout engine become lower to make room. The font becomes smaller
    if the legend does not fit above the middle of the panels.

    Parameters
    ----------
    top : list of Axes
        Panels, the first of them on the left. The titles of panels in the same row, which must be
        set already, move up.
    handles : list of Artist
    labels : list of str, default=None
        By default those of the handles.
    title : str, default=None
    below : list of Axes, default=None
        Panels over which the legend may extend, beginning above the first; by default all.
    n_cols : int, default=6
        The largest number of columns.

    Returns
    -------
    Legend
    """
    if labels is None:
        labels = [handle.get_label() for handle in handles]
    axis, labels = top[0], [label.replace("$", r"\$") for label in labels]
    # Matplotlib leaves out labels that begin with an underscore.
    labels = [f" {label}" if label.startswith("_") else label for label in labels]
    extents = [a.get_window_extent() for a in (below or top)]
    room = max(e.x1 for e in extents) - extents[0].x0
    height = axis.figure.bbox.y1 - (extents[0].y0 + extents[0].y1) / 2
    for size in _SIZES:
        legend, box = _legend(axis, handles, labels, title, n_cols, room, size)
        # With its distance from the panel.
        needed = box.y1 - extents[0].y1
        if needed <= height:
            break
    in_row = [a for a in top if abs(a.get_window_extent().y1 - extents[0].y1) < 1]
    if any(a.get_title() for a in in_row) or box.width > extents[0].width:
        # The padding of the titles reserves the space; a wide legend would part the panels.
        legend.set_in_layout(False)
        pad = box.height * 72 / axis.figure.dpi + _GAP
        for a in in_row:
            a.set_title(a.get_title() or " ", fontsize=a.title.get_fontsize(), pad=pad)
    if axis.figure.get_layout_engine() is None:
        for a in in_row:
            # By half of their height at most.
            spec = a.get_subplotspec()
            box = a.get_position() if spec is None else spec.get_position(a.figure)
            lowered = min(needed / a.figure.bbox.height, box.height / 2)
            a.set_position([box.x0, box.y0, box.width, box.height - lowered])
    return legend


def _legend(axis, handles, labels, title, n_cols, room, size):
    """A legend with as many columns as fit, in a font size, and its extent."""
    for count in range(min(len(labels), n_cols), 0, -1):
        legend = axis.legend(
            handles,
            labels,
            title=title,
            ncols=count,
            frameon=False,
            loc="lower left",
            bbox_to_anchor=(0, 1),
            borderaxespad=0.2,
            fontsize=size,
            title_fontsize=size,
            alignment="left",
        )
        box = legend.get_window_extent()
        if box.width <= room:
            break
    if title is not None and box.width > room:
        legend.set_title(fill(title, max(int(len(title) * room / box.width), 12)))
        box = legend.get_window_extent()
    return legend, box


def parts_outside(ys, lower, upper):
    """The pieces of polylines outside a band, cut where they cross a bound.

    Parameters
    ----------
    ys : ndarray, shape (n, P)
        NaN leaves a gap.
    lower, upper : ndarray, shape (P,)

    Returns
    -------
    xs, ys : ndarray, shape (n_pieces, 2)
        Both ends of straight pieces, each at most one frame long.
    """
    all_xs, all_ys = [], []
    for beyond in (ys - upper, lower - ys):
        out = beyond > 0
        curve, p = np.nonzero((out[:, :-1] | out[:, 1:]) & np.isfinite(np.diff(beyond)))
        first, last = beyond[curve, p], beyond[curve, p + 1]
        crossed = (first > 0) != (last > 0)
        share = first / np.where(crossed, first - last, 1)
        ends = np.stack([np.where(first > 0, 0, share), np.where(last > 0, 1, share)], axis=1)
        start, step = ys[curve, p], ys[curve, p + 1] - ys[curve, p]
        all_xs.append(p[:, np.newaxis] + ends)
        all_ys.append(start[:, np.newaxis] + ends * step[:, np.newaxis])
    return np.concatenate(all_xs), np.concatenate(all_ys)


def group_styles(groups):
    """The colour and the line style of each group by its name, in order of first appearance."""
    names = list(dict.fromkeys(groups))
    palette, lines = _GROUPS, _LINES[:1]
    if len(names) > len(_GROUPS):
        palette, lines = pyplot().colormaps["viridis"](np.linspace(0, 0.95, len(names))), _LINES
    pairs = zip(palette, cycle(lines), strict=False)
    return dict(zip(names, pairs, strict=False))


class TimeAxis:
    """The times of frames in a unit.

    Parameters
    ----------
    unit : {"frames", "percent", "seconds"}
    n_frames : int
        The length of the clock.
    lengths : sequence of int, default=None
        The number of frames of each trial, where trials are drawn.
    durations : array-like, default=None
        For seconds only: how long each trial lasts.
    label : str, default=None
        In place of the axis labels.
    keyframes : Series, default=None
        Key-frames on the clock, in frames, by name.
    trial_keyframes : DataFrame, shape (n_sequences, n_keyframes), default=None
        Those of the trials as shares of them, NaN where one is not known.

    Attributes
    ----------
    unit : str
    clock : ndarray, shape (P,)
        The times of the frames of the clock. In seconds the clock lasts as long as the median
        trial.
    label, trial_label : str
        Axis labels of the clock and of the trials.
    """

    def __init__(
        self,
        unit,
        n_frames,
        lengths=None,
        durations=None,
        label=None,
        *,
        keyframes=None,
        trial_keyframes=None,
    ):
        self.unit = check_unit(unit)
        self.label, self.trial_label = label or _CLOCK_LABELS[unit], label or _TRIAL_LABELS[unit]
        self.keyframes, self.trial_keyframes = keyframes, trial_keyframes
        self.lengths, self.durations = lengths, durations
        clock = np.arange(n_frames)
        self.clock = clock
        if unit == "percent":
            self.clock = 100 * clock / (n_frames - 1)
        if unit == "seconds":
            self.clock = np.median(durations) * clock / (n_frames - 1)

    @classmethod
    def of_clock(cls, unit, clock, label=None, *, keyframes=None):
        """The axis of a clock whose frames have these times, in the unit."""
        return cls(unit, len(clock), None, clock[-1:], label, keyframes=keyframes)

    def trials(self):
        """The times of the frames of each trial: list of ndarray (n_frames_i,)."""
        return self.of_trials([np.arange(n) for n in self.lengths])

    def of_trials(self, frames):
        """Frames of each trial, whole or not, in the unit: list of ndarray."""
        if self.unit == "percent":
            return [100 * f / (n - 1) for f, n in zip(frames, self.lengths, strict=True)]
        if self.unit == "seconds":
            known = zip(frames, self.durations, self.lengths, strict=True)
            return [f * (lasting / (n - 1)) for f, lasting, n in known]
        return list(frames)

    def convert(self, frames):
        """Frames of the clock, whole or not, in the unit."""
        scale = self.clock[-1] / (len(self.clock) - 1)
        return frames if self.unit == "frames" else frames * scale

    def draw_keyframes(self, axes, named):
        """Draw the key-frames on the clock in panels, with their names in one of these."""
        if self.keyframes is None:
            return []
        times, names = self.convert(self.keyframes.to_numpy()), self.keyframes.index
        return [draw_keyframes(axis, times, names if axis is named else ()) for axis in axes]

    def draw_trial_keyframes(self, axes, colors):
        """Draw those of the trials as ticks along the lower edges, in one colour or many."""
        from matplotlib.collections import LineCollection

        if self.trial_keyframes is None:
            return []
        segments, of_ticks = [], []
        lasts = np.array(self.lengths)[:, np.newaxis] - 1
        for i, row in enumerate(self.of_trials(self.trial_keyframes.to_numpy() * lasts)):
            places = row[np.isfinite(row)]
            segments += [[(at, 0), (at, _TICK)] for at in places]
            of_ticks += [colors if isinstance(colors, str) else colors[i]] * len(places)
        return [
            axis.add_collection(
                LineCollection(
                    segments, colors=of_ticks, linewidths=1, transform=axis.get_xaxis_transform()
                ),
                autolim=False,
            )
            for axis in axes
        ]


def offset_label(unit):
    """The label of an axis of offsets, which are counted from a mean."""
    return f"later than\nthe mean ({UNITS[unit]})"


# -- key-frames: lines on the clock, and ticks of each trial ---------------------------


def named_keyframes(synchronizer, keyframes):
    """The key-frames of a fitted synchronizer, with the names that a table of them has.

    Parameters
    ----------
    synchronizer : estimator
    keyframes : DataFrame with a column a key-frame, or anything, or None

    Returns
    -------
    Series, indexed by names, or None
        In frames of the clock, None without key-frames. Those without a name are numbered.
    """
    frames = getattr(synchronizer, "keyframes_", None)
    if frames is None:
        return None
    named = isinstance(keyframes, pd.DataFrame) and len(keyframes.columns) == len(frames)
    return pd.Series(frames, index=keyframes.columns if named else None)


def text_of_label(label):
    """The text of a label; the levels of one with several, such as a context, after commas."""
    return ", ".join(map(str, label)) if isinstance(label, tuple) else str(label)


def text_of_keyframe(name):
    """The text of the name of a key-frame; empty for a number."""
    is_number = isinstance(name, (int, np.integer))
    return "" if is_number else text_of_label(name).replace("$", r"\$")


def draw_keyframes(axis, times, names=()):
    """Draw key-frames as vertical lines, with their names beside them.

    Parameters
    ----------
    axis : Axes
    times : array-like, shape (n_keyframes,)
        In the unit of the axis.
    names : sequence, default=()
        Text, or pairs of text; numbers are not drawn.

    Returns
    -------
    list of Line2D
    """
    lines = [
        axis.axvline(at, color="0.35", linewidth=0.9, linestyle=(0, (2, 2)), zorder=1.5)
        for at in times
        if np.isfinite(at)
    ]
    for at, name in zip(times, names, strict=False):
        if not (text := text_of_keyframe(name)) or not np.isfinite(at):
            continue
        axis.annotate(
            text,
            (at, 0.04),
            xycoords=axis.get_xaxis_transform(),
            xytext=(2, 0),
            textcoords="offset points",
            rotation=90,
            va="bottom",
            fontsize="small",
            color="0.2",
            zorder=6,
            bbox={"facecolor": "white", "alpha": 0.7, "edgecolor": "none", "pad": 0.5},
        )
    return lines
