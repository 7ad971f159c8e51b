"""ActionModelDisplay: the mean of a learnt action, a band about it, who leaves it (Fig. 3d)."""

from typing import NamedTuple

import numpy as np
from sklearn.base import clone

from ..inputs.features import choose_features
from ..model.views import view_of
from ..utils.groups import names_of_groups
from .drawing import (
    COLORS,
    curves,
    front_line,
    group_colors,
    group_lines,
    legend_above,
    panels,
    parts_outside,
)
from .given import as_drawn, as_names, is_number
from .time_axis import TimeAxis, lengths_of

__all__ = ["ActionModelDisplay"]

# What each band holds, said above the legend.
_HOLDS = {
    "points": "band holds single postures, not performances",
    "performances": "band holds {share:.3g} % of new people's performances",
    "mean": "band holds the mean of all people, {share:.3g} % sure",
}
# The same of groups.
_HOLD = {
    "points": "bands hold single postures, not performances",
    "performances": "bands hold {share:.3g} % of new people's performances",
    "mean": "bands hold the mean of all people, {share:.3g} % sure",
}


class ActionModelDisplay:
    """The learnt action: mean, a band about it, and the performances behind (Fig. 3d).

    Use `from_estimator`.

    Parameters
    ----------
    mean, lower, upper : ndarray, shape (P, n_shown)
        With groups (n_groups, P, n_shown), in the order in which they come; bounds are NaN where a
        group has no band.
    feature_names : list of str
    n_std : float, default=None
        Half-width of the band, in standard deviations; None only of the band of the mean, and of
        groups.
    performances : ndarray, shape (n_sequences, P, n_shown), default=None
        Synchronised performances, drawn behind.
    band : {"points", "performances", "mean"}, default="points"
        What the band holds, for the legend: see `from_estimator`.
    coverage : float, default=None
        The share that it holds, between 0 and 1; None only of the band of points.
    departures : bool, default=True
        Whether parts of performances outside the band are violet. They never are when the band is
        that of the mean, which nobody needs to keep to.
    groups : sequence of length n_sequences, default=None
        The group of every performance.
    people : sequence of length n_sequences, default=None
        Who gave it, for the legend.
    unit : {"frames", "percent", "seconds"}, default="frames"
        Of the axis of time.
    frame_rate : float, default=None
        Frames of the clock a second, for seconds.

    Attributes
    ----------
    figure_ : Figure
    axes_ : list of Axes
        One a feature.
    mean_ : list of Line2D
        One a feature; with groups one a group, feature by feature.
    envelope_ : list of FillBetweenPolyCollection
        The same, without groups that have no band.
    performances_ : list of LineCollection
        As ``mean_``; empty without performances.
    departures_ : list of LineCollection
        What of them is outside the band; empty where that is not drawn.

    Examples
    --------
    >>> from sklearn.pipeline import make_pipeline
    >>> from sklearn_motionsync import ActionModel, ASpace, DenseSynchronizer, DirectionCosines
    >>> from sklearn_motionsync.display import ActionModelDisplay
    >>> from sklearn_motionsync.datasets import make_bending
    >>> bunch = make_bending(6, random_state=0)
    >>> steps = DirectionCosines(bunch.skeleton), ASpace(), DenseSynchronizer(50), ActionModel()
    >>> pipe = make_pipeline(*steps).fit(bunch.data)
    >>> display = ActionModelDisplay.from_estimator(pipe, bunch.data, features="pelvis_height")
    >>> display.mean.shape
    (50, 1)
    """

    def __init__(
        self,
        mean,
        lower,
        upper,
        *,
        feature_names,
        n_std=None,
        performances=None,
        band="points",
        coverage=None,
        departures=True,
        groups=None,
        people=None,
        unit="frames",
        frame_rate=None,
    ):
        self.groups, of_each = None, ()
        if groups is not None:
            if performances is None:
                raise ValueError("groups are those of performances: give these, too.")
            self.groups = Groups(groups, people, len(performances))
            of_each = (len(self.groups.names),)
        self.mean = as_drawn(mean, "The mean", (*of_each, "P", "n_shown"))
        self.lower = as_drawn(lower, "The lower bound", self.mean.shape)
        self.upper = as_drawn(upper, "The upper bound", self.mean.shape)
        n_frames, n_shown = self.mean.shape[-2:]
        self.feature_names = as_names(feature_names, n_shown, "feature_names", "features")
        self.band = _as_band(band)
        optional = band == "mean" or groups is not None
        if not (is_number(n_std, 0) or (n_std is None and optional)):
            raise ValueError(f"n_std must be a number of at least 0, got {n_std!r}.")
        if not (is_number(coverage, 0, 1) or (coverage is None and band == "points")):
            raise ValueError(f"coverage must be a share between 0 and 1, got {coverage!r}.")
        self.n_std, self.coverage = n_std, coverage
        self.departures = bool(departures)
        self.performances = None
        if performances is not None:
            shape = ("n_sequences", *self.mean.shape[-2:])
            self.performances = as_drawn(performances, "What is drawn behind", shape)
        self.unit, self.frame_rate = unit, frame_rate
        self._axis = TimeAxis(unit, n_frames, None, frame_rate)

    def __repr__(self):
        return f"ActionModelDisplay({self.feature_names})"

    @classmethod
    def from_estimator(
        cls,
        estimator,
        X=None,
        *,
        features=None,
        band=None,
        departures=True,
        groups=None,
        people=None,
        unit="frames",
        frame_rate=None,
        ax=None,
        **params,
    ):
        """Draw a fitted model, or a pipeline that ends in one.

        Parameters
        ----------
        estimator : ActionModel, or Pipeline with one
            Fitted.
        X : performances, as the estimator takes them, default=None
            Drawn behind, as they reach the model.
        features : int, str or list of them, default=None
            Features of the model, by index or name. In a pipeline with an `ASpace` they may also
            be features of the postures, such as ``"pelvis_height"`` or ``"left_leg_y"``: the
            model is then taken back out of the aSpace, fitted anew on the postures of the
            performances that it keeps. By default the first four of the model.
        band : {"points", "performances", "mean"}, default=None
            Which band is drawn about the mean, and named in the legend; by default that of points,
            with groups that of performances:

            - ``"points"``: ``model.envelope()``, ``n_std`` standard deviations at every frame by
              itself. It holds most postures of new people, but few of their performances from
              the first frame to the last;
            - ``"performances"``: ``model.envelope(simultaneous=True)``, which holds the share
              ``coverage`` of whole performances of new people, in all features and at all frames.
              In features of postures it allows for what the `ASpace` leaves out, and performances
              are drawn with that;
            - ``"mean"``: ``model.mean_envelope()``, which holds the mean of all people with
              probability ``coverage``: how well the mean is known.
        departures : bool, default=True
            Whether the parts of performances that leave the band are drawn violet; they are not
            when the band is that of the mean.
        groups : sequence of length n_sequences, default=None
            The group of every performance of X. Mean and band are then drawn for each group, of a
            model of its own that is fitted now on the performances of the group, all on the clock
            of the one pattern. A single performance has no band, nor have those of a single person,
            unless the band is that of points.
        people : sequence of length n_sequences, default=None
            Who gave each performance of X, as ``ActionModel.fit(groups=...)`` takes it: bands of
            performances and means of groups are then learnt from how people differ. By default
            each is of another person; give it whenever people come more than once.
        unit : {"frames", "percent", "seconds"}, default="frames"
            Of the axis of time: frames or per cent of the pattern, or seconds, in which the clock
            takes as long as the median performance of X.
        frame_rate : float, or array-like of shape (n_sequences,), default=None
            Frames a second of X as recorded, for seconds; without X those of the clock.
        ax : Axes or array-like of Axes, default=None
            See `plot`.
        **params : dict
            What synchronizing X takes besides, such as ``keyframes``.

        Returns
        -------
        ActionModelDisplay

        See Also
        --------
        SkeletonDisplay.from_departures : Which limbs depart, on stick figures.
        """
        by_default = "points" if groups is None else "performances"
        band = _as_band(by_default if band is None else band)
        caller = f"{cls.__name__}.from_estimator"
        if X is None and (params or groups is not None or people is not None):
            given = [*params, *(["groups"] if groups is not None else [])] or ["people"]
            raise TypeError(f"{caller} takes {', '.join(given)} along with performances X only.")
        if people is not None and groups is None:
            raise TypeError(
                f"{caller} takes people along with groups only: a model that is fitted already "
                "knows its people, by fit(X, groups=people)."
            )
        view = view_of(estimator, X, params, caller, features=features)
        chosen = choose_features(features, view.names)
        shown = view.whole if band == "performances" else view.synchronised
        n_std = None
        if groups is None:
            mean, (lower, upper, n_std) = view.model.mean_, _bounds(view, band)
        else:
            of_groups = Groups(groups, people, len(shown))
            mean, lower, upper = bands_of_groups(view.model, shown, of_groups, band)
        if unit == "seconds" and X is not None:
            clock = TimeAxis(unit, mean.shape[-2], lengths_of(X), frame_rate).clock
            frame_rate = (len(clock) - 1) / clock[-1]
        display = cls(
            mean[..., chosen],
            lower[..., chosen],
            upper[..., chosen],
            feature_names=[view.names[i] for i in chosen],
            n_std=n_std,
            performances=None if shown is None else shown[:, :, chosen],
            band=band,
            coverage=None if band == "points" else view.model.coverage,
            departures=departures,
            groups=groups,
            people=people,
            unit=unit,
            frame_rate=frame_rate,
        )
        return display.plot(ax)

    def plot(self, ax=None):
        """Draw.

        Parameters
        ----------
        ax : Axes or array-like of Axes, default=None
            One of a figure's subplots is divided into the panels; or one axes a feature. None
            makes a figure.

        Returns
        -------
        self
        """
        count = len(self.feature_names)
        n_cols = 1 if count == 1 else 2
        n_rows = -(-count // n_cols)
        spots = [divmod(i, n_cols) for i in range(count)]
        layers = layers_of(self.mean, self.lower, self.upper, self.performances, self.groups)
        height = max(3, 2.2 * n_rows + 0.6) + 0.2 * max(len(layers) - 3, 0)
        self.figure_, self.axes_ = panels(ax, spots, n_rows, n_cols, (5 * n_cols, height))
        self.mean_, self.envelope_, self.performances_, self.departures_ = [], [], [], []
        for i, (axis, name) in enumerate(zip(self.axes_, self.feature_names, strict=True)):
            self._draw(axis, layers, i)
            axis.set_ylabel(name)
            if i + n_cols >= count:
                axis.set_xlabel(self._axis.label)
        self._explain(layers)
        return self

    def _draw(self, axis, layers, i):
        """One feature: bands, performances in front of them, what departs, and the means."""
        clock = self._axis.clock
        banded = [layer for layer in layers if layer.has_band]
        self.envelope_ += [layer.draw_band(axis, clock, i) for layer in banded]
        if self.performances is not None:
            self.performances_ += [layer.draw_performances(axis, clock, i) for layer in layers]
            if self.departures and self.band != "mean":
                self.departures_ += [layer.draw_departures(axis, self._axis, i) for layer in banded]
        self.mean_ += [layer.draw_mean(axis, clock, i) for layer in layers]

    def _label(self):
        if self.n_std is None:
            return "where the mean may be"
        predicted = "predicted " if self.band == "performances" else ""
        return f"mean ± {self.n_std:.3g} {predicted}standard deviations"

    def _explain(self, layers):
        """A legend, with what the band holds as its title; above the panels it hides nothing."""
        if self.groups is None:
            handles, labels = [self.envelope_[0]], [self._label()]
            if self.performances is not None:
                handles.append(self.performances_[0])
                labels.append(f"{len(self.performances)} performances")
        else:
            handles, labels = [], []
            bands = iter(self.envelope_)
            for layer, line in zip(layers, self.mean_, strict=False):
                handles.append((next(bands), line) if layer.has_band else line)
                labels.append(self.groups.describe(layer.group, layer.has_band))
        if self.departures_:
            handles.append(self.departures_[0])
            of_group = "" if self.groups is None else " of its group"
            labels.append(f"outside the band{of_group}: {count_outside(layers)} of them")
        if self.groups is None:
            handles.append(self.mean_[0])
            labels.append("mean performance")
        what = _HOLDS[self.band] if self.groups is None else _HOLD[self.band]
        title = what.format(share=100 * (self.coverage or 0))
        legend_above(self.axes_, handles, labels, title, below=self.axes_[:1], n_cols=1)


def _as_band(band):
    if not (isinstance(band, str) and band in _HOLDS):
        raise ValueError(f"band must be one of {list(_HOLDS)}, got {band!r}.")
    return band


def _bounds(view, band):
    """Lower and upper bound of a band, and its half-width in standard deviations."""
    if band == "mean":
        # The same picture every time.
        return *view.model.mean_envelope(random_state=0), None
    if band == "points":
        return *view.model.envelope(), view.model.n_std
    factor = view.model.simultaneous_factor()
    mean, reach = view.model.mean_, factor * view.predicted
    return mean - reach, mean + reach, factor


# -- what `ActionModelDisplay` draws over each other: one model, or that of every group --

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


# -- bands of groups of people: a model of each group, on the one clock that all share ---


class Groups:
    """Which performances are in which group, and who gave them.

    Parameters
    ----------
    groups : sequence of length n_sequences
    people : sequence of length n_sequences, or None
    n_sequences : int

    Attributes
    ----------
    labels : list of str
        The group of every performance.
    names : list of str
        The groups, in the order in which they come.
    people : list of str or None
    """

    def __init__(self, groups, people, n_sequences):
        self.labels = names_of_groups(groups, n_sequences)
        self.names = list(dict.fromkeys(self.labels))
        self.people = None
        if people is not None:
            self.people = names_of_groups(people, n_sequences, name="people")

    def members(self, name):
        """The indices of the performances of a group."""
        return np.flatnonzero(np.array(self.labels) == name)

    def people_of(self, name):
        """Who gave the performances of a group, one each; by default as many people."""
        members = self.members(name)
        return members if self.people is None else np.array(self.people)[members]

    def describe(self, name, has_band):
        """A line for the legend: how many performances of how many people, and if none is known."""
        count, people = len(self.members(name)), len(set(self.people_of(name)))
        text = f"{name}: {count} performance{'s' * (count != 1)}"
        if self.people is not None:
            text += f" of {people} {'person' if people == 1 else 'people'}"
        return text if has_band else f"{text}, no band"


class Bands(NamedTuple):
    """Means and bounds of groups, NaN where there is no band.

    Attributes
    ----------
    mean, lower, upper : ndarray, shape (n_groups, P, n_features)
    """

    mean: np.ndarray
    lower: np.ndarray
    upper: np.ndarray


def bands_of_groups(model, performances, groups, band):
    """The mean and the band of every group, by a model of its performances alone.

    A single performance has no band. Neither has a single person, unless the band is that of
    points: nothing tells how others would differ.

    Parameters
    ----------
    model : ActionModel
        Its clones are fitted.
    performances : ndarray, shape (n_sequences, P, n_features)
        Synchronised to one pattern.
    groups : Groups
    band : {"points", "performances", "mean"}

    Returns
    -------
    Bands
    """
    means, bounds = [], []
    for name in groups.names:
        some, people = performances[groups.members(name)], groups.people_of(name)
        means.append(some.mean(axis=0))
        known = len(some) if band == "points" else len(set(people))
        if known < 2:
            bounds.append(np.full((2, *some.shape[1:]), np.nan))
            continue
        own = clone(model).fit(some, groups=None if band == "points" else people)
        if band == "mean":
            # The same picture every time.
            bounds.append(own.mean_envelope(random_state=0))
        else:
            bounds.append(own.envelope(simultaneous=band == "performances"))
    return Bands(np.stack(means), *np.stack(bounds, axis=1))
