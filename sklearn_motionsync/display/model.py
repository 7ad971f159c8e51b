"""ActionModelDisplay: the mean of a learnt action, a band, and departures from it (Fig. 3d)."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, Literal, Self

import numpy as np
import pandas as pd
from sklearn.base import BaseEstimator, clone

from ..comparison.study import GroupsOfPeople
from ..inputs.collections import as_collection
from ..inputs.features import choose_features
from ..inputs.types import Features, Labels, PerformancesLike, Unit, ValuesLike
from ..inputs.wording import counted
from ..model.action_model import ActionModel
from ..model.views import view_of
from ..synchronizers.match import rates_of
from ..utils.groups import encode_groups
from ..utils.pipelines import find_step, with_frame_rate
from .arguments import AxesLike, labels_of_signals, undo_scaling
from .drawing import WIDTH, GroupCurves, empty_lists, group_styles, legend_above, panels
from .time_axis import TimeAxis, draw_keyframes, keyframes_of_estimator

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


class ActionModelDisplay:
    """A learnt action: its mean, a band about it, and the performances behind (Fig. 3d).

    Use `from_estimator`.

    Parameters
    ----------
    groups : list of GroupCurves
        The mean, the band and the synchronised performances of all, or of each group in the order
        of their first appearance.
    axis : TimeAxis
        The clock of the pattern.
    feature_names : list of str
        The names of the features.
    units : dict of str to str, default=None
        Their units by name, as far as they are known.
    title : str, default=""
        The meaning of the band, for the legend.
    departures : bool, default=False
        Whether the parts of performances outside the band are violet.
    keyframes : Series, default=None
        Key-frames on the clock, by name: lines.

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
    >>> display.groups[0].mean.shape
    (50, 1)
    """

    def __init__(
        self,
        groups: Sequence[GroupCurves],
        axis: TimeAxis,
        *,
        feature_names: Sequence[str],
        units: Mapping[str, str] | None = None,
        title: str = "",
        departures: bool = False,
        keyframes: pd.Series | None = None,
    ) -> None:
        self.groups, self.axis, self.feature_names = groups, axis, feature_names
        self.units = {name: "" for name in feature_names} | dict(units or {})
        self.title, self.departures, self.keyframes = title, departures, keyframes

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
        xlabel: str | None = None,
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
            the first four of the model. What scalers before the model do to its own features is
            undone, and tables tell units in ``attrs["units"]``.
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
            `Match.to_frame`; without X those of the clock. Key-frames are then in seconds, as for
            ``match``.
        xlabel : str, default=None
            The label of time axes, such as ``"% gait cycle"``, in place of that of the unit.
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
        if groups is None:
            of_groups = [_curves_of_all(view, band, shown)]
        else:
            of_groups = curves_of_groups(view.model, shown, groups, people, band)
        n_frames, lengths, rates, units = len(view.model.mean_), None, frame_rate, {}
        if view.model is view.model_of_points:
            before, model = find_step(estimator, ActionModel)
            undo, units = undo_scaling(before, X, model.mean_.shape[1])
            of_groups = [curves.through(undo) for curves in of_groups]
        if unit == "seconds" and X is not None:
            lengths, rates = _lengths(X), rates_of(X, frame_rate)
        title = (_BAND_TITLES if groups is None else _GROUP_BAND_TITLES)[band]
        display = cls(
            [curves.of_features(chosen) for curves in of_groups],
            TimeAxis(unit, n_frames, lengths, rates, xlabel),
            feature_names=[view.names[i] for i in chosen],
            units=units,
            title=title.format(share=100 * view.model.coverage),
            departures=departures and band != "mean",
            keyframes=keyframes_of_estimator(estimator, n_frames, params.get("keyframes")),
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
        height = max(3, 1.9 * n_rows + 1.4) + 0.2 * max(len(self.groups) - 3, 0)
        self.figure_, self.axes_ = panels(ax, cells, n_rows, n_cols, (WIDTH, height))
        self.mean_, self.envelope_, self.performances_, self.departures_ = empty_lists(4)
        labels = labels_of_signals(self.feature_names, self.units)
        for i, (axis, label) in enumerate(zip(self.axes_, labels, strict=True)):
            self._draw_feature(axis, i)
            axis.set_ylabel(label)
            if i + n_cols >= count:
                axis.set_xlabel(self.axis.label)
        self.keyframes_ = []
        if keyframe_lines and self.keyframes is not None:
            times = self.axis.convert(self.keyframes.to_numpy())
            for axis in self.axes_:
                names = self.keyframes.index if axis is self.axes_[0] else ()
                self.keyframes_.append(draw_keyframes(axis, times, names))
        self._draw_legend(n_cols)
        return self

    def _draw_feature(self, axis, i):
        """Draw the bands of a feature, then performances, departures, and means."""
        clock, banded = self.axis.clock, [group for group in self.groups if group.has_band]
        self.envelope_ += [group.draw_band(axis, clock, i) for group in banded]
        if self.groups[0].performances is not None:
            self.performances_ += [group.draw_performances(axis, clock, i) for group in self.groups]
            if self.departures:
                self.departures_ += [group.draw_departures(axis, self.axis, i) for group in banded]
        self.mean_ += [group.draw_mean(axis, clock, i) for group in self.groups]

    def _draw_legend(self, n_cols):
        """Draw a legend above the panels, with the meaning of the band as its title."""
        (first, *_), bands = self.groups, iter(self.envelope_)
        if first.name is None:
            handles, labels = [self.envelope_[0]], [first.label]
            if first.performances is not None:
                handles.append(self.performances_[0])
                labels.append(counted(len(first.performances), "trial"))
        else:
            labels = [group.label for group in self.groups]
            handles = [
                (next(bands), line) if group.has_band else line
                for group, line in zip(self.groups, self.mean_, strict=False)
            ]
        if self.departures_:
            count = sum(group.count_outside() for group in self.groups if group.has_band)
            handles.append(self.departures_[0])
            of_group = "" if first.name is None else " of its group"
            labels.append(f"outside the band{of_group}: {count} of them")
        if first.name is None:
            handles.append(self.mean_[0])
            labels.append("mean")
        legend_above(self.axes_, handles, labels, self.title, below=self.axes_[:n_cols], n_cols=1)


def _lengths(X):
    """The numbers of frames of performances, or of univariate rows."""
    collection = as_collection(X)
    if collection is None:
        n_sequences, n_frames = np.shape(X)
        return [n_frames] * n_sequences
    return [len(x) for x in collection]


def _curves_of_all(view, band, shown):
    """The mean, the band and all performances of a model, with a label of the band."""
    model, label = view.model, "mean ± {:.3g} {}standard deviations"
    if band == "mean":
        lower, upper = model.mean_envelope(random_state=0)
        label = "where the mean may be"
    elif band == "points":
        lower, upper = model.envelope()
        label = label.format(model.n_std, "")
    else:
        factor = model.simultaneous_factor()
        lower, upper = model.mean_ - factor * view.predicted, model.mean_ + factor * view.predicted
        label = label.format(factor, "predicted ")
    return GroupCurves(model.mean_, lower, upper, shown, label=label)


def curves_of_groups(model, performances, groups, people, band):
    """The mean, the band and the performances of each group, by a model of these alone.

    A group of one performance has no band. A group of one subject has none either, except for
    points: it does not show the differences between subjects.

    Parameters
    ----------
    model : ActionModel
        Its clones are fitted.
    performances : ndarray, shape (n_sequences, P, n_features)
        Synchronised to one pattern.
    groups : sequence of length n_sequences
    people : sequence of length n_sequences, or None
        The subject of each performance; by default each is of another subject.
    band : {"points", "performances", "mean"}

    Returns
    -------
    list of GroupCurves
        The bounds are NaN where there is no band.
    """
    n, out = len(performances), []
    of_people = GroupsOfPeople.of(groups, people, n)
    subjects, _ = encode_groups(people, n, name="people")
    labels, styles = of_people.describe(people is not None), group_styles(of_people.labels)
    for maker, label, (name, (color, line)) in zip(
        of_people.makers, labels, styles.items(), strict=True
    ):
        members = maker.any(axis=0)
        of_group = performances[members]
        count, bounds = len(maker), np.full((2, *of_group.shape[1:]), np.nan)
        if band == "points":
            count = len(of_group)
        if count > 1:
            people_of = None if band == "points" else subjects[members]
            group_model = clone(model).fit(of_group, groups=people_of)
            if band == "mean":
                bounds = group_model.mean_envelope(random_state=0)
            else:
                bounds = group_model.envelope(simultaneous=band == "performances")
        else:
            label += ", no band"
        out.append(GroupCurves(of_group.mean(axis=0), *bounds, of_group, label, name, color, line))
    return out
