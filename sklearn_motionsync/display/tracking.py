"""TrackingDisplay: the estimated poses of a tracked body, and what was observed of it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from textwrap import fill
from typing import Self

import numpy as np
from sklearn.base import BaseEstimator
from sklearn.utils.validation import check_is_fitted

from ..inputs.facts import units_of_columns
from ..inputs.features import choose_features, names_of_features
from ..inputs.types import Features, TrialLike, ValuesLike
from ..inputs.wording import counted
from ..live.members import Track
from ..live.tracker import MotionTracker
from ..matching.counting import runs_of
from .arguments import as_names, labels_of_signals, time_label, times_from_zero
from .base import COLORS, WIDTH, AxesLike, Display, empty_lists, legend_above

# The number of features by default.
_N_FEATURES = 4
# Standard deviations on each side that contain 90 %.
_BAND = 1.645
# The height of a panel in inches.
_PANEL = 1.15
# Characters a line of an axis label.
_LINE_LENGTH = 18


class TrackingDisplay(Display):
    """A tracked body with hidden parts: the estimate with its band, and the true course.

    One panel a feature: what was observed, the estimate with the band that contains 90 %, and the
    true course if it is known. Grey are times at which the feature was hidden, hatched those at
    which the tracker was lost. Below are phase and rate. Use `from_estimator`.

    Attributes
    ----------
    track : Track
        The track of one take.
    axes_ : list of Axes
        One a feature, then those of the phase and the rate.
    estimates_, truths_, observed_ : list of Line2D
        One a feature; no true ones if they are unknown.
    bands_ : list of PolyCollection
        One a feature.
    hidden_, lost_ : list of list of Polygon
        For each panel the intervals in which a feature was hidden, and the body lost.
    phase_, rate_ : Line2D
        The phase and the rate.

    Examples
    --------
    >>> import numpy as np
    >>> from sklearn_motionsync import LinearSynchronizer
    >>> from sklearn_motionsync.live import MotionTracker
    >>> from sklearn_motionsync.display import TrackingDisplay
    >>> t = np.linspace(0, 6, 60)
    >>> X = [np.column_stack([size * np.cos(t), size * np.sin(t)]) for size in (0.9, 1, 1.1, 1.2)]
    >>> tracker = MotionTracker(LinearSynchronizer(), noise=0.02, random_state=0).fit(X[1:])
    >>> hidden = X[0].copy()
    >>> hidden[20:40, 1] = np.nan
    >>> TrackingDisplay.from_estimator(tracker, hidden, truth=X[0])
    TrackingDisplay(60 frames of 2 features, 1 of them hidden at times)
    """

    track: Track
    # The true features (n_frames, n_features), and those that were seen, NaN where hidden.
    truth: np.ndarray | None = None
    observed: np.ndarray
    times: np.ndarray  # of the frames; the first one is 0
    n_frames: int  # of the clock
    names: Sequence[str]  # of all features, with their units
    shown: Sequence[int]  # the features that are drawn
    xlabel: str

    def __repr__(self):
        n_frames, n_features = self.observed.shape
        count = int(np.isnan(self.observed).any(axis=0).sum())
        return (
            f"TrackingDisplay({n_frames} frames of {counted(n_features, 'feature')}, {count} of "
            "them hidden at times)"
        )

    @classmethod
    def from_estimator(
        cls,
        estimator: BaseEstimator,
        X: TrialLike,
        *,
        truth: TrialLike | None = None,
        times: ValuesLike | None = None,
        features: Features | None = None,
        names: Sequence[str] | None = None,
        units: str | Sequence[str] | Mapping[str, str] | None = None,
        ax: AxesLike | None = None,
    ) -> Self:
        """Track a take, and draw the estimate.

        Parameters
        ----------
        estimator : MotionTracker
            Fitted.
        X : array-like, shape (n_frames, n_features)
            One take, NaN where a feature was hidden.
        truth : array-like, shape (n_frames, n_features), default=None
            The true features.
        times : array-like, shape (n_frames,), default=None
            The times of the frames, in seconds if the estimator has a frame rate.
        features : int, str or list of them, default=None
            Those that are drawn, by index or name; by default those of the features hidden at any
            time, or of all if none was, whose estimates vary most, at most four.
        names : list of str, default=None
            The names of all features; by default those of ``fit``.
        units : str, list of str or dict, default=None
            The units of the features for their labels: of all, one each, or by name. By default
            what tables tell in ``attrs["units"]``.
        ax : Axes or array-like of Axes, default=None
            See `plot`.

        Returns
        -------
        TrackingDisplay
            The display, drawn.

        Raises
        ------
        ValueError
            As from ``estimator.track``; or if there is no such feature.
        """
        if not isinstance(estimator, MotionTracker):
            raise ValueError(f"Give a MotionTracker, got {type(estimator).__name__}.")
        check_is_fitted(estimator)
        if np.ndim(X) != 2:
            raise ValueError(
                f"X must be one take, 2-D, got an array-like with {np.ndim(X)} axes: "
                "of several takes give one."
            )
        (track,) = estimator.track([X], None if times is None else [times])
        poses = track.poses
        n_frames, n_features = poses.shape
        if truth is not None and np.shape(truth) != poses.shape:
            raise ValueError(f"The truth must have the shape {poses.shape}, got {np.shape(truth)}.")
        if names is None:
            names = names_of_features(None, estimator, n_features)
        names = as_names(names, n_features, "names", "features")
        observed = np.asarray(X, dtype=np.float64)
        if features is None:
            hidden = np.isnan(observed).any(axis=0)
            candidates = np.flatnonzero(hidden if hidden.any() else ~hidden)
            variance = np.var(poses[:, candidates], axis=0)
            shown = candidates[np.argsort(-variance, kind="stable")][:_N_FEATURES].tolist()
        else:
            shown = choose_features(features, names)
        return cls._of(
            track=track,
            truth=None if truth is None else np.asarray(truth, dtype=np.float64),
            observed=observed,
            times=times_from_zero(times, n_frames, estimator.frame_rate),
            n_frames=estimator.n_frames_,
            names=labels_of_signals(names, units_of_columns(X), units),
            shown=shown,
            xlabel=time_label(estimator.frame_rate),
        ).plot(ax)

    def _layout(self):
        count = len(self.shown) + 2
        return [(i, 0) for i in range(count)], (count, 1), (WIDTH, _PANEL * count + 0.6)

    def _draw(self):
        shown = self.shown
        self.estimates_, self.bands_, self.truths_, self.observed_ = empty_lists(4)
        for axis, k in zip(self.axes_, shown, strict=False):
            self._draw_feature(axis, k)
        upper, lower = self.axes_[-2:]
        phases, blue = 100 * self.track.phases / (self.n_frames - 1), COLORS["trial"]
        upper.set_ylim(-3, 103)
        (self.phase_,) = upper.plot(self.times, phases, color=blue)
        lower.axhline(1, color=COLORS["envelope"], linewidth=1, linestyle="--")
        (self.rate_,) = lower.plot(self.times, self.track.rates, color=blue)
        # The axis may be shared with another display.
        lower.set_ylim(0, max(lower.get_ylim()[1], 1.1 * max(1, *self.track.rates)))
        hidden = np.isnan(self.observed[:, shown])
        masks = [*hidden.T, hidden.any(axis=1), hidden.any(axis=1)]
        grey, violet = COLORS["shadow"], COLORS["departure"]
        self.hidden_ = self._shade(
            masks, label="hidden", color=grey, alpha=0.7, linewidth=0, zorder=0
        )
        self.lost_ = self._shade(
            [np.asarray(self.track.lost, dtype=bool)] * len(masks),
            label="lost",
            facecolor="none",
            edgecolor=violet,
            hatch="///",
            linewidth=0,
            alpha=0.5,
            zorder=0.5,
        )
        names = [fill(self.names[k], _LINE_LENGTH) for k in shown]
        ylabels, ends = [*names, "phase (%)", "rate"], (0, self.times[-1] or 1.0)
        self._label_axes(self.axes_, ylabels, self.xlabel, ends=ends)
        for axis in self.axes_:
            axis.tick_params(labelbottom=axis is self.axes_[-1])
            axis.yaxis.label.set_fontsize("small")
        self.figure_.align_ylabels(self.axes_)
        handles, labels = self.axes_[0].get_legend_handles_labels()
        of_label = dict(zip(labels, handles, strict=True))
        legend_above(self.axes_[:1], list(of_label.values()), list(of_label))

    def _draw_feature(self, axis, k):
        estimate = self.track.poses[:, k]
        half_width = _BAND * np.sqrt(np.maximum(self.track.covariances[:, k, k], 0))
        low, high = estimate - half_width, estimate + half_width
        blue, orange, black = (COLORS[key] for key in ("trial", "mean", "pattern"))
        times = self.times
        band = axis.fill_between(
            times, low, high, color=blue, alpha=0.25, linewidth=0, label="90 %"
        )
        self.bands_.append(band)
        if self.truth is not None:
            truth = self.truth[:, k]
            self.truths_ += axis.plot(times, truth, color=orange, linewidth=1.2, label="truth")
        self.estimates_ += axis.plot(times, estimate, color=blue, linewidth=1.8, label="estimate")
        seen = self.observed[:, k]
        self.observed_ += axis.plot(times, seen, ".", color=black, markersize=2.5, label="seen")

    def _shade(self, masks, **style):
        """Shade the frames of a mask in each panel, up to the middle between frames."""
        middles = (self.times[1:] + self.times[:-1]) / 2
        bounds = np.concatenate([self.times[:1], middles, self.times[-1:]])
        return [
            [axis.axvspan(*span, **style) for span in bounds[runs_of(mask)]]
            for axis, mask in zip(self.axes_, masks, strict=True)
        ]
