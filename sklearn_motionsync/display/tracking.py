"""TrackingDisplay: the estimated postures of a tracked body, and what was observed of it."""

from __future__ import annotations

from collections.abc import Sequence
from textwrap import fill
from typing import Any, Literal, Self

import numpy as np
from sklearn.base import BaseEstimator

from ..body.direction_cosines import DirectionCosines
from ..inputs.features import choose_features, names_of_features
from ..inputs.types import (
    Features,
    Indexed,
    NumbersLike,
    PerformanceLike,
    PerformancesLike,
    ValuesLike,
)
from ..inputs.wording import counted
from ..matching.counting import runs_of
from ..online.members import Track
from ..online.tracker import MotionTracker
from .arguments import (
    TIME_LABELS,
    AxesLike,
    Takes,
    as_frames,
    as_index,
    as_names,
    one_each,
    times_from_zero,
)
from .bodies import invert_postures
from .drawing import COLORS, WIDTH, empty_lists, legend_above, panels
from .limb_departures import bones_of_limbs, limb_of
from .stick_figures import SkeletonDisplay, postures_at

__all__ = ["TrackingDisplay"]

# The number of features by default.
_N_FEATURES = 4
# Standard deviations on each side that contain 90 %.
_BAND = 1.645
# The height of a panel in inches.
_PANEL = 1.15
# Characters a line of an axis label.
_LINE_LENGTH = 18


class TrackingDisplay:
    """A tracked body with hidden parts: the estimate with its band, and the true course.

    One panel a feature: what was observed, the estimate with the band that contains 90 %, and the
    true course if it is known. Grey are times at which the feature was hidden, hatched those at
    which the tracker was lost. Below are phase and rate. Make one with `from_estimator` or
    `from_predictions`; `strip` and `side_by_side` draw the bodies.

    Parameters
    ----------
    track : Track
        The track of one take.
    truth : array-like, shape (n_frames, n_features), default=None
        The true features.
    observed : array-like, shape (n_frames, n_features), default=None
        The observed features, NaN where they were hidden.
    times : array-like, shape (n_frames,), default=None
        The times of the frames; by default frame numbers.
    n_frames : int, default=None
        The length of the clock. The phase is then in per cent, otherwise in frames.
    names : list of str, default=None
        The names of all features.
    unit : {"frames", "seconds"}, default="frames"
        The unit of the times.

    Attributes
    ----------
    figure_ : Figure
        The figure of the last plot.
    axes_ : list of Axes
        One a feature, then those of the phase and the rate.
    estimates_, truths_, observed_ : list of Line2D
        One a feature; empty if unknown.
    bands_ : list of PolyCollection
        One a feature.
    hidden_, lost_ : list of list of Polygon
        For each panel the intervals in which a feature was hidden, and the body lost.
    phase_, rate_ : Line2D
        The phase and the rate.

    Examples
    --------
    >>> import numpy as np
    >>> from sklearn_motionsync import LinearSynchronizer, MotionTracker
    >>> from sklearn_motionsync.display import TrackingDisplay
    >>> t = np.linspace(0, 6, 60)
    >>> X = [np.column_stack([size * np.cos(t), size * np.sin(t)]) for size in (0.9, 1, 1.1, 1.2)]
    >>> tracker = MotionTracker(LinearSynchronizer(), noise=0.02, random_state=0).fit(X[1:])
    >>> hidden = X[0].copy()
    >>> hidden[20:40, 1] = np.nan
    >>> TrackingDisplay.from_estimator(tracker, hidden, truth=X[0])
    TrackingDisplay(60 frames of 2 features, 1 of them hidden at times)
    """

    def __init__(
        self,
        track: Track,
        *,
        truth: PerformanceLike | None = None,
        observed: PerformanceLike | None = None,
        times: ValuesLike | None = None,
        n_frames: int | None = None,
        names: Sequence[str] | None = None,
        unit: Literal["frames", "seconds"] = "frames",
    ) -> None:
        shape = np.shape(track.postures)
        self.track, self.n_frames, self.unit = track, n_frames, unit
        self.truth = None if truth is None else np.asarray(truth, dtype=np.float64)
        self.observed = None if observed is None else np.asarray(observed, dtype=np.float64)
        self.times = times_from_zero(times, shape[0])
        self.names = [f"x{k}" for k in range(shape[1])] if names is None else names
        self.hidden = np.zeros(shape, dtype=bool)
        if self.observed is not None:
            self.hidden = np.isnan(self.observed)

    def __repr__(self):
        n_frames, n_features = self.hidden.shape
        count = int(self.hidden.any(axis=0).sum())
        return (
            f"TrackingDisplay({n_frames} frames of {counted(n_features, 'feature')}, {count} of "
            "them hidden at times)"
        )

    @classmethod
    def from_estimator(
        cls,
        estimator: BaseEstimator,
        X: PerformancesLike,
        *,
        truth: PerformancesLike | None = None,
        smooth: bool = False,
        times: Indexed[ValuesLike] | ValuesLike | None = None,
        projection: NumbersLike | tuple[NumbersLike, NumbersLike] | None = None,
        take: int = 0,
        features: Features | None = None,
        names: Sequence[str] | None = None,
        ax: AxesLike | None = None,
    ) -> Self:
        """Track a take, and draw the estimate.

        Parameters
        ----------
        estimator : MotionTracker
            Fitted.
        X : array-like (n_frames, n_observed), or takes
            As ``estimator.track`` takes them.
        truth : array-like (n_frames, n_features), or as many as takes, default=None
            The true features, in the form of X.
        smooth : bool, default=False
            Whether to use ``estimator.smooth``, whose estimates depend on the whole take.
        times : array-like (n_frames,), or as many as takes, default=None
            The times of the frames, in seconds if the estimator has a frame rate.
        projection : array-like, default=None
            As for ``estimator.track``. The observations are then not drawn: they are no features.
        take : int, default=0
            The index of the take.
        features : int, str or list of them, default=None
            See `plot`.
        names : list of str, default=None
            The names of all features; by default those of ``fit``.
        ax : Axes or array-like of Axes, default=None
            See `plot`.

        Returns
        -------
        TrackingDisplay
            The display, drawn.

        Raises
        ------
        ValueError
            As from ``estimator.track``; or if there is no such take or feature.
        """
        if not isinstance(estimator, MotionTracker):
            raise ValueError(f"Give a MotionTracker, got {type(estimator).__name__}.")
        takes = Takes(estimator, X)
        i = as_index(take, len(takes.arrays), "take")
        stamps = None if times is None else takes.select_times(times, [i], "takes")
        true = None
        if truth is not None:
            true_takes = Takes(estimator, truth, "The truth").arrays
            true = one_each(true_takes, len(takes.arrays), "truth", "takes")[i]
        method = estimator.smooth if smooth else estimator.track
        (track,) = method(takes.select([i]), stamps, projection)
        n_frames, n_features = track.postures.shape
        if true is not None and np.shape(true) != (n_frames, n_features):
            raise ValueError(
                f"The truth must have the shape {(n_frames, n_features)}, got {np.shape(true)}."
            )
        rate = 1.0 if estimator.frame_rate is None else estimator.frame_rate
        if names is None:
            names = names_of_features(None, estimator, n_features)
        display = cls(
            track,
            truth=true,
            observed=takes.arrays[i] if projection is None else None,
            times=np.arange(n_frames) / rate if stamps is None else stamps[0],
            n_frames=estimator.n_frames_,
            names=as_names(names, n_features, "names", "features"),
            unit="frames" if estimator.frame_rate is None else "seconds",
        )
        return display.plot(ax, features=features)

    @classmethod
    def from_predictions(
        cls,
        track: Track,
        *,
        features: Features | None = None,
        ax: AxesLike | None = None,
        **known: Any,
    ) -> Self:
        """Draw a track that is known already.

        Parameters
        ----------
        track : Track
            The track of one take.
        features : int, str or list of them, default=None
            See `plot`.
        ax : Axes or array-like of Axes, default=None
            See `plot`.
        **known : dict
            Further parameters of the class.

        Returns
        -------
        TrackingDisplay
            The display, drawn.

        Raises
        ------
        ValueError
            If ``track`` is not the track of one take.
        """
        if not isinstance(track, Track) or np.ndim(track.postures) != 2:
            got = "that of one frame" if isinstance(track, Track) else type(track).__name__
            raise ValueError(
                f"track must be the Track of one take, as from MotionTracker.track; got {got}. Of "
                "a list of them give one."
            )
        return cls(track, **known).plot(ax, features=features)

    def plot(self, ax: AxesLike | None = None, *, features: Features | None = None) -> Self:
        """Draw.

        Parameters
        ----------
        ax : Axes or array-like of Axes, default=None
            One of a figure's subplots is divided into the panels; or one axes a panel. None
            makes a figure.
        features : int, str or list of them, default=None
            By index or name; by default those of the features hidden at any time, or of all if
            none was, whose estimates vary most, at most four.

        Returns
        -------
        TrackingDisplay
            The display itself.
        """
        shown = self._most_varied() if features is None else choose_features(features, self.names)
        count = len(shown) + 2
        size = WIDTH, _PANEL * count + 0.6
        cells, before = [(i, 0) for i in range(count)], getattr(self, "axes_", ())
        self.figure_, self.axes_ = panels(ax, cells, count, 1, size, before)
        self.estimates_, self.bands_, self.truths_, self.observed_ = empty_lists(4)
        for axis, k in zip(self.axes_, shown, strict=False):
            self._draw_feature(axis, k)
        self._draw_progress(*self.axes_[-2:])
        any_hidden = self.hidden[:, shown].any(axis=1)
        masks = [*self.hidden[:, shown].T, any_hidden, any_hidden]
        grey, violet = COLORS["shadow"], COLORS["departure"]
        self.hidden_ = [
            [
                axis.axvspan(a, b, label="hidden", color=grey, alpha=0.7, linewidth=0, zorder=0)
                for a, b in self._spans(mask)
            ]
            for axis, mask in zip(self.axes_, masks, strict=True)
        ]
        lost = self._spans(np.asarray(self.track.lost, dtype=bool))
        self.lost_ = [
            [
                axis.axvspan(
                    a,
                    b,
                    label="lost",
                    facecolor="none",
                    edgecolor=violet,
                    hatch="///",
                    linewidth=0,
                    alpha=0.5,
                    zorder=0.5,
                )
                for a, b in lost
            ]
            for axis in self.axes_
        ]
        for axis in self.axes_:
            axis.set_xlim(0, self.times[-1] or 1.0)
            axis.tick_params(labelbottom=axis is self.axes_[-1])
        self.axes_[-1].set_xlabel(TIME_LABELS[self.unit])
        self.figure_.align_ylabels(self.axes_)
        handles, labels = self.axes_[0].get_legend_handles_labels()
        of_label = dict(zip(labels, handles, strict=True))
        legend_above(self.axes_[:1], list(of_label.values()), list(of_label))
        return self

    def strip(
        self,
        cosines: DirectionCosines,
        *,
        frames: int | Sequence[int] | np.ndarray = 6,
        ax: AxesLike | None = None,
        at: float = 0.0,
        azimuth: float = -60,
    ) -> SkeletonDisplay:
        """Draw estimated bodies at some frames, before the true ones; hidden limbs are violet.

        Parameters
        ----------
        cosines : DirectionCosines
            The fitted transformer of the features.
        frames : int or list of int, default=6
            The number of frames, evenly spaced from the first to the last, or their indices.
        ax : Axes or array-like of Axes, default=None
            As for `SkeletonDisplay.plot`.
        at : float in [0, 1], default=0.0
            As for `SkeletonDisplay.plot`.
        azimuth : float, default=-60
            As for `SkeletonDisplay.plot`.

        Returns
        -------
        SkeletonDisplay
            The display of the bodies, drawn.
        """
        skeleton, estimate, truth = self._bodies(cosines)
        shown = as_frames(frames, len(estimate))
        limbs = np.array([limb_of(name) for name in cosines.get_feature_names_out()])
        marked = [bones_of_limbs(limbs[self.hidden[frame]], skeleton) for frame in shown]
        titles = [f"frame {k}" for k in shown]
        if self.unit == "seconds":
            titles = [f"{self.times[k]:.1f} s" for k in shown]
        return SkeletonDisplay(
            postures_at(shown, [estimate]),
            skeleton,
            titles,
            marked=marked,
            behind=None if truth is None else postures_at(shown, [truth]),
        ).plot(ax, at=at, azimuth=azimuth)

    def side_by_side(
        self,
        cosines: DirectionCosines,
        *,
        ax: AxesLike | None = None,
        at: float = 0.0,
        azimuth: float = -60,
    ) -> SkeletonDisplay:
        """Draw the observed, the estimated and the true body side by side.

        Parameters
        ----------
        cosines : DirectionCosines
            The fitted transformer of the features.
        ax : Axes or array-like of Axes, default=None
            As for `SkeletonDisplay.plot`.
        at : float in [0, 1], default=0.0
            As for `SkeletonDisplay.plot`.
        azimuth : float, default=-60
            As for `SkeletonDisplay.plot`.

        Returns
        -------
        SkeletonDisplay
            The display of the bodies, drawn at the beginning; see `SkeletonDisplay.animate`.
        """
        skeleton, estimate, truth = self._bodies(cosines)
        bodies = {"estimate": estimate, "truth": truth}
        if self.observed is not None:
            bodies = {"seen": invert_postures(self.observed, cosines, skeleton)} | bodies
        bodies = {name: x for name, x in bodies.items() if x is not None}
        title = ["what is known of a body"]
        display = SkeletonDisplay([list(bodies.values())], skeleton, title, labels=list(bodies))
        return display.plot(ax, at=at, azimuth=azimuth)

    def _most_varied(self):
        """The features of largest variance among those that were hidden."""
        variance = np.var(self.track.postures, axis=0)
        hidden = self.hidden.any(axis=0)
        candidates = np.flatnonzero(hidden if hidden.any() else ~hidden)
        return candidates[np.argsort(-variance[candidates], kind="stable")][:_N_FEATURES]

    def _draw_feature(self, axis, k):
        estimate = self.track.postures[:, k]
        half_width = _BAND * np.sqrt(np.maximum(self.track.covariances[:, k, k], 0))
        low, high = estimate - half_width, estimate + half_width
        blue, orange, black = (COLORS[key] for key in ("performance", "mean", "pattern"))
        times = self.times
        band = axis.fill_between(
            times, low, high, color=blue, alpha=0.25, linewidth=0, label="90 %"
        )
        self.bands_.append(band)
        if self.truth is not None:
            truth = self.truth[:, k]
            self.truths_ += axis.plot(times, truth, color=orange, linewidth=1.2, label="truth")
        self.estimates_ += axis.plot(times, estimate, color=blue, linewidth=1.8, label="estimate")
        if self.observed is not None:
            seen = self.observed[:, k]
            self.observed_ += axis.plot(times, seen, ".", color=black, markersize=2.5, label="seen")
        axis.set_ylabel(fill(self.names[k], _LINE_LENGTH), fontsize="small")

    def _draw_progress(self, upper, lower):
        phases, label = self.track.phases, "phase (frame)"
        if self.n_frames is not None:
            phases, label = 100 * np.asarray(phases) / (self.n_frames - 1), "phase (%)"
            upper.set_ylim(-3, 103)
        blue = COLORS["performance"]
        (self.phase_,) = upper.plot(self.times, phases, color=blue)
        upper.set_ylabel(label, fontsize="small")
        lower.axhline(1, color=COLORS["envelope"], linewidth=1, linestyle="--")
        (self.rate_,) = lower.plot(self.times, self.track.rates, color=blue)
        # The axis may be shared with another display.
        lower.set_ylim(0, max(lower.get_ylim()[1], 1.1 * max(1, *self.track.rates)))
        lower.set_ylabel("rate", fontsize="small")

    def _spans(self, mask):
        """The times of frames, up to the middle between frames, as (start, stop)."""
        middles = (self.times[1:] + self.times[:-1]) / 2
        bounds = np.concatenate([self.times[:1], middles, self.times[-1:]])
        return bounds[runs_of(mask)]

    def _bodies(self, cosines):
        """The skeleton, the estimated bodies, and the true ones or None."""
        if not isinstance(cosines, DirectionCosines):
            raise ValueError(f"cosines must be DirectionCosines, got {type(cosines).__name__}.")
        skeleton = cosines.skeleton.body()
        estimate, truth = (
            None if x is None else invert_postures(x, cosines, skeleton)
            for x in (self.track.postures, self.truth)
        )
        return skeleton, estimate, truth
