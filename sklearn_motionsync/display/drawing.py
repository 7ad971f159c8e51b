"""Panels, colours, curves and legends that several displays draw."""

from itertools import cycle
from textwrap import fill
from typing import NamedTuple

import numpy as np

__all__ = [
    "COLORS",
    "WIDTH",
    "GroupCurves",
    "bone_lines",
    "curves",
    "front_line",
    "group_styles",
    "legend_above",
    "panels",
    "parts_outside",
    "pyplot",
    "signal_panels",
    "stage",
]

# Okabe and Ito's colours and a violet, which colour-blind people can distinguish. Each has one
# meaning in all figures.
COLORS = {
    "performance": "#0072B2",
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
# Rounding of the largest bound, in units of the last place.
_ROUNDING = 64
# Font sizes of a legend; the largest with which the legend fits into the figure is used.
_SIZES = ["small", "x-small", "xx-small"]


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


def panels(ax, cells, n_rows, n_cols, size, drawn=()):
    """A figure and its axes in some cells of a grid.

    Parameters
    ----------
    ax : None, Axes, or array-like of Axes
        None makes a figure. As many axes as cells are used as they are. A single subplot is
        divided: the panels take its place.
    cells : list
        Indices into the grid, one a panel.
    n_rows, n_cols : int
    size : (float, float)
        Width and height of a new figure in inches.
    drawn : list of Axes, default=()
        Axes that the display has drawn before; they are cleared.

    Returns
    -------
    figure : Figure or SubFigure
    axes : list of Axes
    """
    plt = pyplot()
    if ax is None:
        figure = plt.figure(figsize=size, layout="constrained")
        grid = figure.add_gridspec(n_rows, n_cols)
        return figure, [figure.add_subplot(grid[cell]) for cell in cells]
    axes = list(np.ravel(np.asarray(ax, dtype=object)))
    if not axes or not all(isinstance(a, plt.Axes) for a in axes):
        raise ValueError(f"ax must be Axes of matplotlib, got {ax!r:.80}.")
    figure = axes[0].figure
    if len(axes) == len(cells):
        for axis in axes:
            if axis in drawn:
                axis.clear()
        return figure, axes
    if len(axes) != 1 or axes[0].get_subplotspec() is None:
        raise ValueError(
            f"ax must be one of a figure's subplots, to be divided, or {len(cells)} axes, one a "
            f"panel; got {len(axes)}."
        )
    axes[0].set_axis_off()
    grid = axes[0].get_subplotspec().subgridspec(n_rows, n_cols)
    return figure, [figure.add_subplot(grid[cell]) for cell in cells]


def signal_panels(ax, count, more=0.0):
    """Panels of signals, two in a row if there are three or more, above a wide one of their timing.

    Parameters
    ----------
    ax : None, Axes, or array-like of Axes
        As of `panels`.
    count : int
        Of the signals.
    more : float, default=0.0
        Height in inches beside that of the panels.

    Returns
    -------
    figure : Figure or SubFigure
    axes : list of Axes
    upper : list of Axes
        Those in the first row.
    """
    n_cols = 1 if count < 3 else 2
    n_rows = -(-count // n_cols)
    cells = [divmod(i, n_cols) for i in range(count)] + [(n_rows, slice(None))]
    figure, axes = panels(ax, cells, n_rows + 1, n_cols, (WIDTH, 1.9 * (n_rows + 1) + more))
    return figure, axes, axes[:n_cols]


def stage(axis, title, low, high):
    """Prepare axes for stick figures between two corners (2,): a floor, and no scales."""
    margin = 0.05 * (high - low)
    axis.set_xlim(low[0] - margin[0], high[0] + margin[0])
    axis.set_ylim(low[1] - margin[1], high[1] + margin[1])
    axis.set_aspect("equal", anchor="S")
    axis.set_title(title, fontsize="medium")
    axis.set_yticks([])
    axis.grid(False)
    axis.set_xticks([])
    axis.spines[:].set_visible(False)
    axis.axhline(0, color="0.6", linewidth=1, zorder=0)
    axis.tick_params(length=0)


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


def legend_above(top, handles, labels, title=None, below=None, n_cols=6):
    """Draw a legend between panels and their titles, where it hides no curve.

    Panels of a figure without a layout engine become lower to make room. The font becomes smaller
    if the legend does not fit above the middle of the panels.

    Parameters
    ----------
    top : list of Axes
        Panels, the first of them on the left. The titles of panels in the same row, which must be
        set already, move up.
    handles : list of Artist
    labels : list of str
    title : str, default=None
    below : list of Axes, default=None
        Panels over which the legend may extend, beginning above the first; by default all.
    n_cols : int, default=6
        The largest number of columns.

    Returns
    -------
    Legend
    """
    axis, labels = top[0], [_escape(label) for label in labels]
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
            _lower(a, needed)
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


def _lower(axis, height):
    """Make axes lower at the top by some pixels, by half of their height at most."""
    spec, figure = axis.get_subplotspec(), axis.figure
    box = axis.get_position() if spec is None else spec.get_position(figure)
    height = min(height / figure.bbox.height, box.height / 2)
    axis.set_position([box.x0, box.y0, box.width, box.height - height])


def _escape(label):
    """Text that matplotlib neither reads as mathematics nor leaves out of a legend."""
    label = label.replace("$", r"\$")
    return f" {label}" if label.startswith("_") else label


def bone_lines(axis, color, width, alpha=1.0, zorder=2):
    """An empty artist for the bones of stick figures."""
    from matplotlib.collections import LineCollection

    lines = LineCollection([], colors=color, linewidths=width, alpha=alpha, zorder=zorder)
    lines.set_capstyle("round")
    return axis.add_collection(lines, autolim=False)


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


class GroupCurves(NamedTuple):
    """The mean, the band and the performances of all, or of one group, in each panel.

    Attributes
    ----------
    mean, lower, upper : ndarray, shape (P, n_panels)
        The bounds are NaN without a band.
    performances : ndarray (n, P, n_panels), or None
    label : str
        The entry of the legend.
    name : str or None
        The name of a group.
    color, line : str
        The colour and the line style of the mean.
    """

    mean: np.ndarray
    lower: np.ndarray
    upper: np.ndarray
    performances: np.ndarray | None = None
    label: str = ""
    name: str | None = None
    color: str = COLORS["mean"]
    line: str = "-"

    @property
    def has_band(self):
        return not np.isnan(self.lower).all()

    def of_features(self, chosen):
        """The same in some of the panels."""
        shown = None if self.performances is None else self.performances[:, :, chosen]
        bounds = (x[:, chosen] for x in self[:3])
        return GroupCurves(*bounds, shown, *self[4:])

    def through(self, function):
        """The same after a function of arrays (P, n_panels)."""
        performances, bounds = self.performances, self[1:3]
        if performances is not None:
            performances = np.stack([function(x) for x in performances])
        if self.has_band:
            bounds = map(function, bounds)
        return GroupCurves(function(self.mean), *bounds, performances, *self[4:])

    def outer_bounds(self):
        """The bounds with a margin for rounding."""
        largest = np.nanmax(np.abs([self.lower, self.upper]), axis=(0, 1), initial=0)
        eps = np.finfo(np.result_type(self.mean, np.float32)).eps
        margin = _ROUNDING * eps * largest
        return self.lower - margin, self.upper + margin

    def count_outside(self):
        """The number of performances that leave the band in a drawn feature."""
        lower, upper = self.outer_bounds()
        outside = (self.performances < lower) | (self.performances > upper)
        return int(outside.any(axis=(1, 2)).sum())

    def draw_band(self, axis, clock, i):
        """Draw the band of panel i, in grey or in the pale colour of the group."""
        lower, upper = self.lower[:, i], self.upper[:, i]
        color, edge, alpha, width = COLORS["envelope"], COLORS["pattern"], 0.35, 0.9
        if self.name is not None:
            color, edge, alpha, width = self.color, self.color, 0.18, 0.5
        band = axis.fill_between(clock, lower, upper, color=color, alpha=alpha, linewidth=0)
        for bound in (lower, upper):
            axis.plot(clock, bound, color=edge, linewidth=width)
        return band

    def draw_performances(self, axis, clock, i):
        """Draw the performances in panel i."""
        behind = self.performances[:, :, i]
        style = {"colors": COLORS["performance"], "linestyles": "dashed"}
        if self.name is not None:
            style = {"colors": self.color}
        return curves(axis, [clock] * len(behind), behind, linewidths=0.7, alpha=0.5, **style)

    def draw_departures(self, axis, time_axis, i):
        """Draw the parts of performances outside the band in panel i."""
        lower, upper = self.outer_bounds()
        xs, ys = parts_outside(self.performances[:, :, i], lower[:, i], upper[:, i])
        xs, violet = time_axis.convert(xs), COLORS["departure"]
        return curves(axis, xs, ys, colors=violet, linewidths=1.4, zorder=3)

    def draw_mean(self, axis, clock, i):
        """Draw the mean in panel i."""
        mean, color, dashes = self.mean[:, i], self.color, self.line
        if self.name is not None:
            return front_line(axis, clock, mean, color=color, linewidth=2, linestyle=dashes)
        (line,) = axis.plot(clock, mean, color=color, linewidth=2, linestyle=dashes)
        return line
