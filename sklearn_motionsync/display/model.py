"""ActionModelDisplay: the mean of a learnt action, a band, and departures from it (Fig. 3d)."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, Literal, Self

import numpy as np
from sklearn.base import BaseEstimator

from ..inputs.features import choose_features
from ..inputs.types import Features, TrialsLike, Unit
from ..inputs.wording import counted
from ..model.action_model import ActionModel
from ..model.views import view_of
from ..utils.pipelines import find_step, find_synchronizer
from .arguments import labels_of_signals, undo_scaling
from .base import (
    COLORS,
    WIDTH,
    AxesLike,
    Display,
    TimeAxis,
    curves,
    empty_lists,
    legend_above,
    named_keyframes,
    parts_outside,
)

# Titles of the legend.
_BAND_TITLES = {
    "points": "band holds single poses, not whole trials",
    "trials": "band holds {:.3g} % of new people's trials",
}
# Rounding of the largest bound, in units of the last place.
_ROUNDING = 64


class ActionModelDisplay(Display):
    """A learnt action: its mean, a band about it, and the trials behind (Fig. 3d).

    Use `from_estimator`.

    Attributes
    ----------
    mean, lower, upper : ndarray, shape (P, n_shown)
        The mean of the model, and the bounds of the band.
    trials : ndarray, shape (n_sequences, P, n_shown)
        Synchronised.
    axes_ : list of Axes
        The panels, one a feature.
    mean_ : list of Line2D
        The means, one a feature.
    envelope_ : list of FillBetweenPolyCollection
        The bands, one a feature.
    trials_ : list of LineCollection
        The trials, one collection a feature.
    departures_ : list of LineCollection
        The parts of trials outside the band.
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

    mean: np.ndarray
    lower: np.ndarray
    upper: np.ndarray
    trials: np.ndarray
    axis: TimeAxis
    ylabels: Sequence[str]
    titles: tuple[str, str]  # what the band holds, and what it is

    def __repr__(self):
        return f"ActionModelDisplay({list(self.ylabels)})"

    @classmethod
    def from_estimator(
        cls,
        estimator: BaseEstimator,
        X: TrialsLike,
        *,
        features: Features | None = None,
        band: Literal["points", "trials"] = "trials",
        unit: Unit = "frames",
        units: str | Sequence[str] | Mapping[str, str] | None = None,
        xlabel: str | None = None,
        ax: AxesLike | None = None,
        **params: Any,
    ) -> Self:
        """Draw a fitted model, or a pipeline that ends in one.

        Parameters
        ----------
        estimator : ActionModel, or Pipeline with one
            Fitted.
        X : trials
            As the estimator takes them; drawn behind, as they reach the model.
        features : int, str or list of them, default=None
            Features of the model, by index or name. In a pipeline with an `ASpace` they may also
            be features of the poses, such as ``"pelvis_height"``: the model is then fitted again
            on the poses of the trials that it keeps. By default the first four of the
            model. What scalers before the model do to its own features is undone.
        band : {"points", "trials"}, default="trials"
            The band about the mean, which holds poses of new subjects one by one
            (`ActionModel.envelope`); or their trials from the first frame to the last, with
            probability ``coverage`` of the model (``simultaneous=True``). In features of poses it
            includes what the `ASpace` leaves out. Parts of trials outside the band are violet.
        unit : {"frames", "percent", "seconds"}, default="frames"
            The unit of time: frames or per cent of the pattern, or seconds; the clock then lasts
            as long as the median trial of X.
        units : str, list of str or dict, default=None
            The units of the features: of all, one each, or by name. By default what tables tell in
            ``attrs["units"]``.
        xlabel : str, default=None
            The label of time axes, such as ``"% gait cycle"``, in place of that of the unit.
        ax : Axes or array-like of Axes, default=None
            See `plot`.
        **params : dict
            Further arguments of the synchronizer: ``frame_rate``, frames a second of X as recorded,
            which seconds need where tables do not tell; ``keyframes``, which are seconds where a
            frame rate is given: lines. The columns of a table of key-frames are their names.

        Returns
        -------
        ActionModelDisplay
            The display, drawn.

        Raises
        ------
        ValueError
            If there is no such feature or band.

        See Also
        --------
        SkeletonDisplay.from_departures : The limbs that depart, on stick figures.
        GroupDisplay : Groups of trials, with their means and bands.
        """
        if band not in list(_BAND_TITLES):
            raise ValueError(f"band must be one of {list(_BAND_TITLES)}, got {band!r}.")
        caller = f"{cls.__name__}.from_estimator"
        view = view_of(estimator, X, params, caller, features=features)
        chosen = choose_features(features, view.names)
        shown = view.whole if band == "trials" else view.synchronised
        model, what = view.model, "mean ± {:.3g} {}standard deviations"
        if band == "points":
            lower, upper = model.envelope()
            what = what.format(model.n_std, "")
        else:
            factor = model.simultaneous_factor()
            lower, upper = (model.mean_ + sign * factor * view.predicted for sign in (-1, 1))
            what = what.format(factor, "predicted ")
        drawn: list = [model.mean_, lower, upper, *shown]
        n_frames = len(model.mean_)
        known_units: dict = {}
        if model is view.model_of_points:
            before, _ = find_step(estimator, ActionModel)
            undo, known_units = undo_scaling(before, X, model.mean_.shape[1])
            drawn = [undo(x) for x in drawn]
        mean, lower, upper, *trials = (x[:, chosen] for x in drawn)
        lasting = view.curves.facts.durations() if unit == "seconds" else None
        keyframes = _keyframes_of(estimator, n_frames, params.get("keyframes"))
        return cls._of(
            mean=mean,
            lower=lower,
            upper=upper,
            trials=np.stack(trials),
            axis=TimeAxis(unit, n_frames, None, lasting, xlabel, keyframes=keyframes),
            ylabels=labels_of_signals([view.names[i] for i in chosen], known_units, units),
            titles=(_BAND_TITLES[band].format(100 * model.coverage), what),
        ).plot(ax)

    def _layout(self):
        count = len(self.ylabels)
        n_cols = 1 if count == 1 else 2
        n_rows = -(-count // n_cols)
        cells = [divmod(i, n_cols) for i in range(count)]
        return cells, (n_rows, n_cols), (WIDTH, max(3, 1.9 * n_rows + 1.4))

    def _draw(self):
        self.mean_, self.envelope_, self.trials_, self.departures_ = empty_lists(4)
        for i, axis in enumerate(self.axes_):
            self._draw_feature(axis, i)
        n_cols = self._layout()[1][1]
        self._label_axes(self.axes_, self.ylabels, self.axis.label, n_cols=n_cols)
        self.keyframes_ = self.axis.draw_keyframes(self.axes_, self.axes_[0])
        # The meaning of the band is the title of the legend.
        title, what = self.titles
        lower, upper = self._outer_bounds()
        outside = (self.trials < lower) | (self.trials > upper)
        handles = [self.envelope_[0], self.trials_[0], self.departures_[0], self.mean_[0]]
        beyond = f"outside the band: {outside.any(axis=(1, 2)).sum()} of them"
        labels = [what, counted(len(self.trials), "trial"), beyond, "mean"]
        below = self.axes_[:n_cols]
        legend_above(self.axes_, handles, labels, title, below=below, n_cols=1)

    def _draw_feature(self, axis, i):
        """Draw the band of a feature, then trials, departures, and the mean."""
        clock = self.axis.clock
        bounds, grey = (self.lower[:, i], self.upper[:, i]), COLORS["envelope"]
        band = axis.fill_between(clock, *bounds, color=grey, alpha=0.35, linewidth=0)
        self.envelope_.append(band)
        for bound in bounds:
            axis.plot(clock, bound, color=COLORS["pattern"], linewidth=0.9)
        behind = self.trials[:, :, i]
        style = {"colors": COLORS["trial"], "linestyles": "dashed", "linewidths": 0.7}
        self.trials_.append(curves(axis, [clock] * len(behind), behind, alpha=0.5, **style))
        lower, upper = (bound[:, i] for bound in self._outer_bounds())
        xs, ys = parts_outside(behind, lower, upper)
        style = {"colors": COLORS["departure"], "linewidths": 1.4, "zorder": 3}
        self.departures_.append(curves(axis, self.axis.convert(xs), ys, **style))
        self.mean_ += axis.plot(clock, self.mean[:, i], color=COLORS["mean"], linewidth=2)

    def _outer_bounds(self):
        """The bounds with a margin for rounding."""
        largest = np.abs([self.lower, self.upper]).max(axis=(0, 1))
        margin = _ROUNDING * np.finfo(np.result_type(self.mean, np.float32)).eps * largest
        return self.lower - margin, self.upper + margin


def _keyframes_of(estimator, n_frames, keyframes):
    """The key-frames of a pipeline; None without any, or if its synchronizer has another clock."""
    try:
        _, synchronizer = find_synchronizer(estimator)
    except ValueError:
        return None
    same = getattr(synchronizer, "n_frames_", None) == n_frames
    return named_keyframes(synchronizer, keyframes) if same else None
