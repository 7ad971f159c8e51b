"""What `ActionModelDisplay` draws over each other: one model, or that of every group."""

from typing import NamedTuple

import numpy as np

from .drawing import COLORS, curves, front_line, group_colors, group_lines, parts_outside

__all__ = ["Layer", "count_outside", "layers_of"]

# Of the largest bound, how much beyond it is rounding, in units of the last place.
_ROUNDING = 64


class Layer(NamedTuple):
    """A mean, a band about it and the performances behind, of all or of one group.

    Attributes
    ----------
    mean, lower, upper : ndarray, shape (P, n_shown)
        Bounds are NaN without a band.
    performances : ndarray (n, P, n_shown), or None
    group : str or None
    color, line : str
        Of the mean.
    """

    mean: np.ndarray
    lower: np.ndarray
    upper: np.ndarray
    performances: np.ndarray | None
    group: str | None = None
    color: str = COLORS["mean"]
    line: str = "-"

    @property
    def has_band(self):
        return not np.isnan(self.lower).all()

    @property
    def just_outside(self):
        """The bounds, so much farther out that rounding does not count."""
        largest = [np.nanmax(np.abs(b), axis=0, initial=0) for b in (self.lower, self.upper)]
        eps = np.finfo(np.result_type(self.mean, np.float32)).eps
        margin = _ROUNDING * eps * np.maximum(*largest)
        return self.lower - margin, self.upper + margin

    def draw_band(self, axis, clock, i):
        """The band of feature i, in grey or pale in the colour of the group."""
        lower, upper = self.lower[:, i], self.upper[:, i]
        color, edge, alpha = COLORS["envelope"], COLORS["pattern"], 0.35
        if self.group is not None:
            color, edge, alpha = self.color, self.color, 0.16
        band = axis.fill_between(clock, lower, upper, color=color, alpha=alpha, linewidth=0)
        for bound in (lower, upper):
            axis.plot(clock, bound, color=edge, linewidth=0.9)
        return band

    def draw_performances(self, axis, clock, i):
        behind = self.performances[:, :, i]
        color = COLORS["performance"] if self.group is None else self.color
        style = {"linewidths": 0.7, "linestyles": "dashed", "alpha": 0.55, "colors": color}
        return curves(axis, [clock] * len(behind), behind, **style)

    def draw_departures(self, axis, time_axis, i):
        """Those parts of performances that are outside the band."""
        bounds = (bound[:, i] for bound in self.just_outside)
        xs, ys = parts_outside(self.performances[:, :, i], *bounds)
        style = {"colors": COLORS["departure"], "linewidths": 1.4, "zorder": 3}
        return curves(axis, time_axis.of_clock(xs), ys, **style)

    def draw_mean(self, axis, clock, i):
        style = {"color": self.color, "linewidth": 2, "linestyle": self.line}
        if self.group is not None:
            return front_line(axis, clock, self.mean[:, i], **style)
        (line,) = axis.plot(clock, self.mean[:, i], **style)
        return line


def layers_of(mean, lower, upper, performances, groups):
    """The layers of a display.

    Parameters
    ----------
    mean, lower, upper : ndarray, shape (P, n_shown), or (n_groups, P, n_shown)
    performances : ndarray (n_sequences, P, n_shown), or None
    groups : Groups or None

    Returns
    -------
    list of Layer
    """
    if groups is None:
        return [Layer(mean, lower, upper, performances)]
    _, color_of = group_colors(groups.labels, len(groups.labels))
    lines = group_lines(len(color_of))
    return [
        Layer(
            mean[k],
            lower[k],
            upper[k],
            performances[groups.members(name)],
            name,
            color_of[name],
            lines[k],
        )
        for k, name in enumerate(groups.names)
    ]


def count_outside(layers):
    """How many performances leave the band of their layer in a feature that is shown."""
    count = 0
    for layer in layers:
        if layer.has_band:
            lower, upper = layer.just_outside
            outside = (layer.performances < lower) | (layer.performances > upper)
            count += int(outside.any(axis=(1, 2)).sum())
    return count
