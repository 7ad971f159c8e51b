"""ActionModelDisplay: the mean of a learnt action, a band, and departures from it (Fig. 3d)."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, Literal, NamedTuple, Self

import numpy as np
from sklearn.base import BaseEstimator, clone

from ..inputs.collections import as_collection
from ..inputs.features import choose_features
from ..inputs.types import Features, Labels, PerformanceLike, PerformancesLike, Unit, ValuesLike
from ..inputs.wording import counted
from ..model.views import view_of
from ..synchronizers.match import rates_of
from ..utils.groups import names_of_groups
from ..utils.pipelines import with_frame_rate
from .arguments import AxesLike
from .drawing import (
    COLORS,
    WIDTH,
    curves,
    front_line,
    group_styles,
    legend_above,
    panels,
    parts_outside,
)
from .keyframes import check_pattern_keyframes, draw_keyframes, keyframes_of_estimator
from .time_axis import TimeAxis, clock_rate

__all__ = ["ActionModelDisplay"]

# Titles of the legend, without and with groups.
_BAND_TITLES = {
    "points": "band holds single poses, not whole trials",
    "performances": "band holds {share:.3g} % of new people's trials",
    "mean": "band holds the mean of all people, {share:.3g} % sure",
}
_GROUP_BAND_TITLES = {
    "points": "bands hold single poses, not whole trials",
    "performances": "bands hold {share:.3g} % of new people's trials",
    "mean": "bands hold the mean of all people, {share:.3g} % sure",
}
# Rounding of the largest bound, in units of the last place.
_ROUNDING = 64


class ActionModelDisplay:
    """A learnt action: its mean, a band about it, and the performances behind (Fig. 3d).

    Use `from_estimator`.

    Parameters
    ----------
    mean, lower, upper : array-like, shape (P, n_shown)
        With groups (n_groups, P, n_shown), in the order of their first appearance; NaN are the
        bounds of a group without a band.
    feature_names : list of str
        The names of the features.
    n_std : float, default=None
        Half-width of the band in standard deviations. None for the band of the mean, and with
        groups.
    performances : array-like, shape (n_sequences, P, n_shown), default=None
        Synchronised performances, drawn behind.
    band : {"points", "performances", "mean"}, default="points"
        The meaning of the band, for the legend: see `from_estimator`.
    coverage : float, default=None
        The probability of the band, between 0 and 1. None for the band of points.
    departures : bool, default=True
        Whether the parts of performances outside the band are violet. The band of the mean shows
        no departures, since single performances need not stay in it.
    groups : sequence of length n_sequences, default=None
        The group of each performance.
    people : sequence of length n_sequences, default=None
        The subject of each performance, for the legend.
    unit : {"frames", "percent", "seconds"}, default="frames"
        The unit of time.
    frame_rate : float, default=None
        Frames of the clock a second, for seconds.
    pattern_keyframes : array-like of shape (n_keyframes,) or Series, default=None
        Key-frames on the clock: lines. The index of a Series holds their names.

    Attributes
    ----------
    figure_ : Figure
        The figure of the last plot.
    axes_ : list of Axes
        The panels, one a feature.
    mean_ : list of Line2D
        The means, one a feature; with groups one a group, feature by feature.
    envelope_ : list of FillBetweenPolyCollection
        The bands, in the same order; groups without a band are left out.
    performances_ : list of LineCollection
        The performances, in the order of ``mean_``; empty without performances.
    departures_ : list of LineCollection
        The parts of performances outside the band; empty if they are not drawn.
    keyframes_ : list of list of Line2D
        The key-frames, for each panel; empty without any.

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
        mean: PerformanceLike,
        lower: PerformanceLike,
        upper: PerformanceLike,
        *,
        feature_names: Sequence[str],
        n_std: float | None = None,
        performances: PerformancesLike | None = None,
        band: Literal["points", "performances", "mean"] = "points",
        coverage: float | None = None,
        departures: bool = True,
        groups: Labels | None = None,
        people: Labels | None = None,
        unit: Unit = "frames",
        frame_rate: float | None = None,
        pattern_keyframes: ValuesLike | None = None,
    ) -> None:
        self.mean, self.lower, self.upper = np.asarray(mean), np.asarray(lower), np.asarray(upper)
        self.feature_names, self.n_std = feature_names, n_std
        self.performances = None if performances is None else np.asarray(performances)
        self.band, self.coverage, self.departures = band, coverage, departures
        self.groups = (
            None if groups is None else SubjectGroups(groups, people, len(self.performances))
        )
        self.unit, self.frame_rate = unit, frame_rate
        self._axis = TimeAxis(unit, self.mean.shape[-2], None, frame_rate)
        self.pattern_keyframes = check_pattern_keyframes(pattern_keyframes, self.mean.shape[-2])

    def __repr__(self):
        return f"ActionModelDisplay({self.feature_names})"

    @classmethod
    def from_estimator(
        cls,
        estimator: BaseEstimator,
        X: PerformancesLike | None = None,
        *,
        features: Features | None = None,
        band: Literal["points", "performances", "mean"] | None = None,
        departures: bool = True,
        groups: Labels | None = None,
        people: Labels | None = None,
        unit: Unit = "frames",
        frame_rate: float | ValuesLike | None = None,
        keyframe_lines: bool = True,
        ax: AxesLike | None = None,
        **params: Any,
    ) -> Self:
        """Draw a fitted model, or a pipeline that ends in one.

        Parameters
        ----------
        estimator : ActionModel, or Pipeline with one
            Fitted.
        X : performances, default=None
            As the estimator takes them; drawn behind, as they reach the model.
        features : int, str or list of them, default=None
            Features of the model, by index or name. In a pipeline with an `ASpace` they may also
            be features of the postures, such as ``"pelvis_height"`` or ``"left_leg_y"``: the
            model is then fitted again on the postures of the performances that it keeps. By default
            the first four of the model.
        band : {"points", "performances", "mean"}, default=None
            The band about the mean, named in the legend; by default ``"performances"``, without X
            ``"points"``:

            - ``"points"``: ``model.envelope()``, ``n_std`` standard deviations at each frame. It
              holds most postures of new subjects, but few of their performances from the first
              frame to the last;
            - ``"performances"``: ``model.envelope(simultaneous=True)``, which holds whole
              performances of new subjects, in all features and at all frames, with probability
              ``coverage``. In features of postures it includes what the `ASpace` leaves out, as do
              the performances;
            - ``"mean"``: ``model.mean_envelope()``, which holds the mean of the population with
              probability ``coverage``.
        departures : bool, default=True
            Whether the parts of performances outside the band are violet; they never are with the
            band of the mean.
        groups : sequence of length n_sequences, default=None
            The group of each performance of X. Mean and band are then those of a model of each
            group, fitted to its performances; all are on the clock of the same pattern. A group of
            one performance has no band, nor has a group of one subject, except ``"points"``.
        people : sequence of length n_sequences, default=None
            The subject of each performance of X, as in ``ActionModel.fit(groups=...)``: bands of
            performances and of means then estimate the differences between subjects. By default
            each performance is of another subject; give it if subjects come more than once.
        unit : {"frames", "percent", "seconds"}, default="frames"
            The unit of time: frames or per cent of the pattern, or seconds; the clock then lasts
            as long as the median performance of X.
        frame_rate : float, or array-like of shape (n_sequences,), default=None
            Frames a second of X as recorded, for seconds, by default what tables tell, as in
            `Match.to_frame`; without X those of the clock.
        keyframe_lines : bool, default=True
            Whether to draw the key-frames of the synchronizer, if it has some.
        ax : Axes or array-like of Axes, default=None
            See `plot`.
        **params : dict
            Further arguments of the synchronizer, such as ``keyframes``, in frames. The columns of
            a table of key-frames are their names.

        Returns
        -------
        ActionModelDisplay
            The display, drawn.

        Raises
        ------
        ValueError
            If there is no such feature or band, or groups do not fit the performances.
        TypeError
            If groups, people or further arguments come without performances, or people without
            groups.

        See Also
        --------
        SkeletonDisplay.from_departures : The limbs that depart, on stick figures.
        """
        if band is None:
            band = "points" if X is None else "performances"
        if band not in list(_BAND_TITLES):
            raise ValueError(f"band must be one of {list(_BAND_TITLES)}, got {band!r}.")
        caller = f"{cls.__name__}.from_estimator"
        named = params | {"groups": groups, "people": people}
        names = [name for name, value in named.items() if value is not None]
        if X is None and names:
            raise TypeError(f"{caller} takes {', '.join(names)} along with performances X only.")
        if people is not None and groups is None:
            raise TypeError(
                f"{caller} takes people along with groups only: a fitted model has learnt its "
                "people by fit(X, groups=people)."
            )
        params = with_frame_rate(params, frame_rate)
        view = view_of(estimator, X, params, caller, features=features)
        chosen = choose_features(features, view.names)
        shown = view.whole if band == "performances" else view.synchronised
        n_std = None
        if groups is None:
            mean, (lower, upper, n_std) = view.model.mean_, _bounds(view, band)
        else:
            groups_of = SubjectGroups(groups, people, len(shown))
            mean, lower, upper = bands_of_groups(view.model, shown, groups_of, band)
        if unit == "seconds" and X is not None:
            rates = rates_of(X, frame_rate)
            clock = TimeAxis(unit, mean.shape[-2], _lengths(X), rates).clock
            frame_rate = clock_rate(clock)
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
            pattern_keyframes=keyframes_of_estimator(
                estimator, mean.shape[-2], params.get("keyframes")
            ),
        )
        return display.plot(ax, keyframe_lines=keyframe_lines)

    def plot(self, ax: AxesLike | None = None, *, keyframe_lines: bool = True) -> Self:
        """Draw.

        Parameters
        ----------
        ax : Axes or array-like of Axes, default=None
            One of a figure's subplots is divided into the panels; or one axes a feature. None
            makes a figure.
        keyframe_lines : bool, default=True
            Whether to draw key-frames, if there are some.

        Returns
        -------
        ActionModelDisplay
            The display itself.
        """
        count = len(self.feature_names)
        n_cols = 1 if count == 1 else 2
        n_rows = -(-count // n_cols)
        cells = [divmod(i, n_cols) for i in range(count)]
        groups = self._group_curves()
        height = max(3, 1.9 * n_rows + 1.4) + 0.2 * max(len(groups) - 3, 0)
        self.figure_, self.axes_ = panels(ax, cells, n_rows, n_cols, (WIDTH, height))
        self.mean_, self.envelope_, self.performances_, self.departures_ = [], [], [], []
        for i, (axis, name) in enumerate(zip(self.axes_, self.feature_names, strict=True)):
            self._draw_feature(axis, groups, i)
            axis.set_ylabel(name)
            if i + n_cols >= count:
                axis.set_xlabel(self._axis.label)
        self.keyframes_ = []
        if keyframe_lines and self.pattern_keyframes is not None:
            times = self._axis.convert(self.pattern_keyframes.to_numpy())
            for axis in self.axes_:
                names = self.pattern_keyframes.index if axis is self.axes_[0] else ()
                self.keyframes_.append(draw_keyframes(axis, times, names))
        self._draw_legend(groups, n_cols)
        return self

    def _group_curves(self):
        """All performances, or those of each group, with their mean and band."""
        if self.groups is None:
            return [GroupCurves(self.mean, self.lower, self.upper, self.performances)]
        styles = group_styles(self.groups.labels).items()
        return [
            GroupCurves(
                mean, lower, upper, self.performances[self.groups.members(name)], name, color, line
            )
            for mean, lower, upper, (name, (color, line)) in zip(
                self.mean, self.lower, self.upper, styles, strict=True
            )
        ]

    def _draw_feature(self, axis, groups, i):
        """Draw the bands of a feature, then performances, departures, and means."""
        clock = self._axis.clock
        banded = [group for group in groups if group.has_band]
        self.envelope_ += [group.draw_band(axis, clock, i) for group in banded]
        if self.performances is not None:
            self.performances_ += [group.draw_performances(axis, clock, i) for group in groups]
            if self.departures and self.band != "mean":
                self.departures_ += [group.draw_departures(axis, self._axis, i) for group in banded]
        self.mean_ += [group.draw_mean(axis, clock, i) for group in groups]

    def _draw_legend(self, groups, n_cols):
        """Draw a legend above the panels, with the meaning of the band as its title."""
        if self.groups is None:
            label = "where the mean may be"
            if self.n_std is not None:
                predicted = "predicted " if self.band == "performances" else ""
                label = f"mean ± {self.n_std:.3g} {predicted}standard deviations"
            handles, labels = [self.envelope_[0]], [label]
            if self.performances is not None:
                handles.append(self.performances_[0])
                labels.append(counted(len(self.performances), "trial"))
        else:
            handles, labels = [], []
            bands = iter(self.envelope_)
            for group, line in zip(groups, self.mean_, strict=False):
                handles.append((next(bands), line) if group.has_band else line)
                labels.append(self.groups.describe(group.name, group.has_band))
        if self.departures_:
            count = sum(group.count_outside() for group in groups if group.has_band)
            handles.append(self.departures_[0])
            of_group = "" if self.groups is None else " of its group"
            labels.append(f"outside the band{of_group}: {count} of them")
        if self.groups is None:
            handles.append(self.mean_[0])
            labels.append("mean")
        titles = _BAND_TITLES if self.groups is None else _GROUP_BAND_TITLES
        title = titles[self.band].format(share=100 * (self.coverage or 0))
        legend_above(self.axes_, handles, labels, title, below=self.axes_[:n_cols], n_cols=1)


def _lengths(X):
    """The numbers of frames of performances, or of univariate rows."""
    collection = as_collection(X)
    if collection is None:
        n_sequences, n_frames = np.shape(X)
        return [n_frames] * n_sequences
    return [len(x) for x in collection]


def _bounds(view, band):
    """The lower and the upper bound of a band, and its half-width in standard deviations."""
    if band == "mean":
        return *view.model.mean_envelope(random_state=0), None
    if band == "points":
        return *view.model.envelope(), view.model.n_std
    factor = view.model.simultaneous_factor()
    mean, reach = view.model.mean_, factor * view.predicted
    return mean - reach, mean + reach, factor


class GroupCurves(NamedTuple):
    """The mean, the band and the performances of all, or of one group.

    Attributes
    ----------
    mean, lower, upper : ndarray, shape (P, n_shown)
        The bounds are NaN without a band.
    performances : ndarray (n, P, n_shown), or None
    name : str or None
    color, line : str
        The colour and the line style of the mean.
    """

    mean: np.ndarray
    lower: np.ndarray
    upper: np.ndarray
    performances: np.ndarray | None
    name: str | None = None
    color: str = COLORS["mean"]
    line: str = "-"

    @property
    def has_band(self):
        return not np.isnan(self.lower).all()

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
        """Draw the band of feature i, in grey or in the pale colour of the group."""
        lower, upper = self.lower[:, i], self.upper[:, i]
        color, edge, alpha = COLORS["envelope"], COLORS["pattern"], 0.35
        if self.name is not None:
            color, edge, alpha = self.color, self.color, 0.16
        band = axis.fill_between(clock, lower, upper, color=color, alpha=alpha, linewidth=0)
        for bound in (lower, upper):
            axis.plot(clock, bound, color=edge, linewidth=0.9)
        return band

    def draw_performances(self, axis, clock, i):
        """Draw feature i of the performances."""
        behind = self.performances[:, :, i]
        color = COLORS["performance"] if self.name is None else self.color
        xs = [clock] * len(behind)
        return curves(
            axis, xs, behind, colors=color, linewidths=0.7, linestyles="dashed", alpha=0.55
        )

    def draw_departures(self, axis, time_axis, i):
        """Draw the parts of feature i outside the band."""
        lower, upper = self.outer_bounds()
        xs, ys = parts_outside(self.performances[:, :, i], lower[:, i], upper[:, i])
        xs, violet = time_axis.convert(xs), COLORS["departure"]
        return curves(axis, xs, ys, colors=violet, linewidths=1.4, zorder=3)

    def draw_mean(self, axis, clock, i):
        """Draw the mean of feature i."""
        mean, color, dashes = self.mean[:, i], self.color, self.line
        if self.name is not None:
            return front_line(axis, clock, mean, color=color, linewidth=2, linestyle=dashes)
        (line,) = axis.plot(clock, mean, color=color, linewidth=2, linestyle=dashes)
        return line


class SubjectGroups:
    """The groups and the subjects of performances.

    Parameters
    ----------
    groups : sequence of length n_sequences
    people : sequence of length n_sequences, or None
        The subject of each performance; by default each is of another subject.
    n_sequences : int

    Attributes
    ----------
    labels : list of str
        The group of each performance.
    names : list of str
        The groups in the order of first appearance.
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
        """The subject of each performance of a group."""
        members = self.members(name)
        return members if self.people is None else np.array(self.people)[members]

    def describe(self, name, has_band):
        """The entry of a group in the legend: its performances and subjects."""
        count, people = len(self.members(name)), len(set(self.people_of(name)))
        text = f"{name}: {count} trial{'s' * (count != 1)}"
        if self.people is not None:
            text += f" of {people} {'person' if people == 1 else 'people'}"
        return text if has_band else f"{text}, no band"


def bands_of_groups(model, performances, groups, band):
    """The mean and the band of each group, by a model of its performances alone.

    A group of one performance has no band. A group of one subject has none either, except for
    points: it does not show the differences between subjects.

    Parameters
    ----------
    model : ActionModel
        Its clones are fitted.
    performances : ndarray, shape (n_sequences, P, n_features)
        Synchronised to one pattern.
    groups : SubjectGroups
    band : {"points", "performances", "mean"}

    Returns
    -------
    mean, lower, upper : ndarray, shape (n_groups, P, n_features)
        The bounds are NaN where there is no band.
    """
    means, bounds = [], []
    for name in groups.names:
        of_group, people = performances[groups.members(name)], groups.people_of(name)
        means.append(of_group.mean(axis=0))
        count = len(of_group) if band == "points" else len(set(people))
        if count < 2:
            bounds.append(np.full((2, *of_group.shape[1:]), np.nan))
            continue
        group_model = clone(model).fit(of_group, groups=None if band == "points" else people)
        if band == "mean":
            bounds.append(group_model.mean_envelope(random_state=0))
        else:
            bounds.append(group_model.envelope(simultaneous=band == "performances"))
    return np.stack(means), *np.stack(bounds, axis=1)
