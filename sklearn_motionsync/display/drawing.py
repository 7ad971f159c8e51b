"""One way to draw: the panels, colours and curves that all displays share."""

import numpy as np

__all__ = [
    "COLORS",
    "as_features",
    "choose_features",
    "curves",
    "group_colors",
    "names_of",
    "panels",
    "pyplot",
]

# Okabe and Ito's colours, told apart by colour-blind people. One role each, in every figure.
COLORS = {
    "performance": "#0072B2",
    "pattern": "#000000",
    "mean": "#D55E00",
    "envelope": "#999999",
    "left": "#0072B2",
    "middle": "#4D4D4D",
    "right": "#D55E00",
}
_GROUPS = ["#0072B2", "#D55E00", "#009E73", "#E69F00", "#CC79A7", "#56B4E9", "#000000"]
# Features drawn when none are named.
_FEW_FEATURES = 4


def pyplot():
    """``matplotlib.pyplot``, which only drawing needs."""
    try:
        import matplotlib.pyplot as plt
    except ImportError as error:
        raise ImportError(
            "Drawing needs matplotlib: pip install 'sklearn-motionsync[plot]'."
        ) from error
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
    if not all(isinstance(a, plt.Axes) for a in given):
        raise ValueError(f"ax must be Axes of matplotlib, got {type(given[0]).__name__}.")
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


def curves(axis, xs, ys, **style):
    """Many curves as one artist, in the data limits of the axes."""
    from matplotlib.collections import LineCollection

    lines = LineCollection([np.column_stack(xy) for xy in zip(xs, ys, strict=True)], **style)
    axis.add_collection(lines)
    axis.autoscale_view()
    return lines


def group_colors(groups, n_sequences):
    """The colour of every performance, and the colour of every group by its name."""
    if groups is None:
        return [COLORS["performance"]] * n_sequences, {}
    groups = [str(group) for group in groups]
    if len(groups) != n_sequences:
        raise ValueError(
            f"groups must name the group of each of the {n_sequences} performances, got "
            f"{len(groups)}."
        )
    names = list(dict.fromkeys(groups))
    palette = _GROUPS
    if len(names) > len(_GROUPS):
        palette = pyplot().colormaps["viridis"](np.linspace(0, 0.95, len(names)))
    color_of = dict(zip(names, palette, strict=False))
    return [color_of[group] for group in groups], color_of


def choose_features(features, names):
    """Indices of features given by index or name; by default the first few."""
    names = list(names)
    if features is None:
        return list(range(min(_FEW_FEATURES, len(names))))
    chosen = []
    for feature in as_features(features):
        index = names.index(feature) if feature in names else feature
        if not isinstance(index, (int, np.integer)) or not 0 <= index < len(names):
            raise ValueError(
                f"There is no feature {feature!r}; there are {len(names)}: {', '.join(names)}."
            )
        chosen.append(int(index))
    if not chosen:
        raise ValueError("features must name at least one feature to draw.")
    return chosen


def as_features(features):
    """Features by index or name as a list, of one or several; empty for None."""
    if features is None:
        return []
    return [features] if np.ndim(features) == 0 else list(features)


def names_of(before, step, width):
    """Names of the ``width`` features that reach a step of a pipeline, after those before it."""
    names = getattr(step, "feature_names_in_", None)
    if names is None and before is not None:
        try:
            names = before.get_feature_names_out()
        except AttributeError:  # of a pipeline in which some step does not name its features
            names = None
    if names is None or len(names) != width:
        names = [f"x{i}" for i in range(width)]
    return [str(name) for name in names]
