"""One way to draw: the panels, colours and curves that all displays share."""

from textwrap import fill

import numpy as np

__all__ = [
    "COLORS",
    "curves",
    "front_line",
    "group_colors",
    "group_lines",
    "legend_above",
    "panels",
    "parts_outside",
    "pyplot",
    "stage",
    "sticks",
]

# Okabe and Ito's colours and a violet, told apart by colour-blind people. One role each, in every
# figure.
COLORS = {
    "performance": "#0072B2",
    "pattern": "#000000",
    "mean": "#D55E00",
    "envelope": "#999999",
    "left": "#0072B2",
    "middle": "#4D4D4D",
    "right": "#D55E00",
    # Where something departs from the action, all else is grey.
    "departure": "#A000F0",
    "quiet": "#808080",
    "shadow": "#D9D9D9",
}
# Black is the pattern.
_GROUPS = ["#0072B2", "#D55E00", "#009E73", "#E69F00", "#CC79A7", "#56B4E9"]
# Of more groups the colours are alike, and their means are told apart by lines.
_LINES = ["-", "--", ":", "-."]
# Points between a legend and a title above it.
_GAP = 6
# Sizes of a legend's letters: the largest is taken with which nothing is lost above the figure.
_SIZES = ["small", "x-small", "xx-small"]


def pyplot():
    """``matplotlib.pyplot``, which only drawing needs."""
    try:
        import matplotlib.pyplot as plt
    except ImportError as error:
        raise ImportError("Drawing needs matplotlib: pip install matplotlib.") from error
    return plt


def panels(ax, spots, n_rows, n_cols, size):
    """A figure and its axes at some spots of a grid.

    Parameters
    ----------
    ax : None, Axes, or array-like of Axes
        None makes a figure. As many axes as spots are used as they are. A single one is
        divided: the panels take its place.
    spots : list
        Indices into the grid, one a panel.
    n_rows, n_cols : int
    size : (float, float)
        Inches of a new figure.

    Returns
    -------
    figure : Figure or SubFigure
    axes : list of Axes
    """
    plt = pyplot()
    if ax is None:
        figure = plt.figure(figsize=size, layout="constrained")
        grid = figure.add_gridspec(n_rows, n_cols)
        return figure, [figure.add_subplot(grid[spot]) for spot in spots]
    given = list(np.ravel(np.asarray(ax, dtype=object)))
    strange = [type(a).__name__ for a in given if not isinstance(a, plt.Axes)]
    if strange or not given:
        got = strange[0] if strange else "none of them"
        raise ValueError(f"ax must be Axes of matplotlib, got {got}.")
    figure = given[0].figure
    if len(given) == len(spots):
        return figure, given
    if len(given) != 1 or given[0].get_subplotspec() is None:
        raise ValueError(
            f"ax must be one of a figure's subplots, to be divided, or {len(spots)} axes, one a "
            f"panel; got {len(given)}."
        )
    given[0].set_axis_off()
    grid = given[0].get_subplotspec().subgridspec(n_rows, n_cols)
    return figure, [figure.add_subplot(grid[spot]) for spot in spots]


def stage(axis, title, low, high):
    """Axes as a stage for bodies that move between two corners (2,): a floor, and no scales."""
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
    """Many curves as one artist, in the data limits of the axes."""
    from matplotlib.collections import LineCollection

    lines = LineCollection([np.column_stack(xy) for xy in zip(xs, ys, strict=True)], **style)
    axis.add_collection(lines)
    axis.autoscale_view()
    return lines


def front_line(axis, xs, ys, **style):
    """A curve in front of others, with a white rim so that it is seen among them."""
    from matplotlib.patheffects import Normal, Stroke

    style = {"linewidth": 1.8, "zorder": 4} | style
    rim = [Stroke(linewidth=style["linewidth"] + 1.4, foreground="white"), Normal()]
    (line,) = axis.plot(xs, ys, path_effects=rim, **style)
    return line


def legend_above(top, handles, labels, title=None, below=None, n_cols=6):
    """A legend between panels and their titles, where it hides no curve.

    Panels of a figure without a layout engine become lower by as much. Letters become smaller where
    it would be higher than half of them and what is above.

    Parameters
    ----------
    top : list of Axes
        Panels, the first of them on the left. Titles of those beside it, which must be there
        already, move up.
    handles : list of Artist
    labels : list of str
    title : str, default=None
    below : list of Axes, default=None
        Those that it may reach over, of which it begins above the first; by default all.
    n_cols : int, default=6
        Columns at most.

    Returns
    -------
    Legend
    """
    axis, labels = top[0], [_plain(label) for label in labels]
    extents = [a.get_window_extent() for a in (below or top)]
    room = max(e.x1 for e in extents) - extents[0].x0
    height = axis.figure.bbox.y1 - (extents[0].y0 + extents[0].y1) / 2
    for size in _SIZES:
        legend, box = _legend(axis, handles, labels, title, n_cols, room, size)
        if box.height <= height:
            break
    beside = [a for a in top if abs(a.get_window_extent().y1 - extents[0].y1) < 1]
    if any(a.get_title() for a in beside):
        # The titles keep the room.
        legend.set_in_layout(False)
        pad = box.height * 72 / axis.figure.dpi + _GAP
        for a in beside:
            a.set_title(a.get_title(), fontsize=a.title.get_fontsize(), pad=pad)
    if axis.figure.get_layout_engine() is None:
        for a in beside:
            _lower(a, box.height)
    return legend


def _legend(axis, handles, labels, title, n_cols, room, size):
    """A legend in as many columns as there is room for, in letters of a size, and its extent."""
    style = {"loc": "lower left", "bbox_to_anchor": (0, 1), "borderaxespad": 0.2}
    style |= {"fontsize": size, "title_fontsize": size, "alignment": "left"}
    for count in range(min(len(labels), n_cols), 0, -1):
        legend = axis.legend(handles, labels, title=title, ncols=count, frameon=False, **style)
        box = legend.get_window_extent()
        if box.width <= room:
            break
    if title is not None and box.width > room:
        legend.set_title(fill(title, max(int(len(title) * room / box.width), 12)))
        box = legend.get_window_extent()
    return legend, box


def _lower(axis, height):
    """Take so many pixels off the top of axes, of half of them at most."""
    spec, figure = axis.get_subplotspec(), axis.figure
    place = axis.get_position() if spec is None else spec.get_position(figure)
    height = min(height / figure.bbox.height, place.height / 2)
    axis.set_position([place.x0, place.y0, place.width, place.height - height])


def _plain(label):
    """Text that matplotlib neither takes for mathematics nor leaves out of a legend."""
    label = label.replace("$", r"\$")
    return f" {label}" if label.startswith("_") else label


def sticks(axis, color, width, alpha=1.0, zorder=2):
    """An empty artist for the bones of bodies."""
    from matplotlib.collections import LineCollection

    style = {"colors": color, "linewidths": width, "alpha": alpha, "zorder": zorder}
    lines = LineCollection([], **style)
    lines.set_capstyle("round")
    return axis.add_collection(lines, autolim=False)


def parts_outside(ys, lower, upper):
    """Pieces of polylines beyond two others, up to where they cross.

    Parameters
    ----------
    ys : ndarray, shape (n, P)
        NaN leaves a gap.
    lower, upper : ndarray, shape (P,)

    Returns
    -------
    xs, ys : ndarray, shape (n_pieces, 2)
        Both ends of straight pieces, of which none is longer than a frame.
    """
    pieces = []
    for beyond in (ys - upper, lower - ys):
        out = beyond > 0
        curve, p = np.nonzero((out[:, :-1] | out[:, 1:]) & np.isfinite(np.diff(beyond)))
        here, there = beyond[curve, p], beyond[curve, p + 1]
        crossed = (here > 0) != (there > 0)
        share = here / np.where(crossed, here - there, 1)
        ends = np.stack([np.where(here > 0, 0, share), np.where(there > 0, 1, share)], axis=1)
        start, step = ys[curve, p], ys[curve, p + 1] - ys[curve, p]
        pieces.append((p[:, np.newaxis] + ends, start[:, np.newaxis] + ends * step[:, np.newaxis]))
    return tuple(np.concatenate(of_both) for of_both in zip(*pieces, strict=True))


def group_colors(groups, n_sequences):
    """The colour of every performance, and the colour of every group by its name."""
    if groups is None:
        return [COLORS["performance"]] * n_sequences, {}
    names = list(dict.fromkeys(groups))
    palette = _GROUPS
    if len(names) > len(_GROUPS):
        palette = pyplot().colormaps["viridis"](np.linspace(0, 0.95, len(names)))
    color_of = dict(zip(names, palette, strict=False))
    return [color_of[group] for group in groups], color_of


def group_lines(n_groups):
    """The line of the mean of every group, of so many."""
    lines = _LINES if n_groups > len(_GROUPS) else _LINES[:1]
    return [lines[k % len(lines)] for k in range(n_groups)]
