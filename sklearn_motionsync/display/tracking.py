"""TrackingDisplay: what was seen of a body, what is known of the rest, and how well."""

from copy import copy
from textwrap import fill

import numpy as np

from ..body.direction_cosines import DirectionCosines
from ..inputs.features import choose_features, names_of_features
from ..inputs.numbers import is_integer
from ..online.particle_filter import Track
from ..online.tracker import MotionTracker
from .departing import bones_of, limb_of
from .drawing import COLORS, legend_above, panels
from .given import as_drawn, as_frames, as_index, as_names
from .live import from_zero, one_each, taken, times_of
from .stick_figures import SkeletonDisplay

__all__ = ["TrackingDisplay"]

# Features below each other, if not chosen.
_FEW_FEATURES = 4
# Standard deviations to each side that leave out a tenth.
_BAND = 1.645
_UNITS = {"frames": "time (frames)", "seconds": "time (s)"}
# Inches of a panel, and of all.
_PANEL, _WIDTH = 1.15, 8.5
# Letters of a name beside a panel.
_LETTERS = 18


class TrackingDisplay:
    """A body that is followed while parts of it are hidden: estimate and band, truth beside.

    Features one below the other: what was seen, the estimate with the band that holds 90 %, and
    the truth if it is known. Grey is when a feature was hidden, hatched when the tracker was lost.
    Below them phase and rate. Make one with `from_estimator` or `from_predictions`; `strip` and
    `side_by_side` show the bodies.

    Parameters
    ----------
    track : Track
        Of one take.
    truth : array-like, shape (n_frames, n_features), default=None
    observed : array-like, shape (n_frames, n_features), default=None
        What was seen, NaN where nothing was.
    times : array-like, shape (n_frames,), default=None
        When; by default one frame after the other.
    n_frames : int, default=None
        Of the clock; phases are then in per cent of it.
    names : list of str, default=None
        Of all features.
    unit : {"frames", "seconds"}, default="frames"
        Of the times.

    Attributes
    ----------
    figure_ : Figure
    axes_ : list of Axes
        One a feature, then that of the phase and that of the rate.
    estimates_, truths_, observed_ : list of Line2D
        One a feature; empty for what is not known.
    bands_ : list of PolyCollection
        One a feature.
    hidden_, lost_ : list of list of Polygon
        For each panel the spans in which a feature was hidden, and the body lost.
    phase_, rate_ : Line2D

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
        track,
        *,
        truth=None,
        observed=None,
        times=None,
        n_frames=None,
        names=None,
        unit="frames",
    ):
        if not isinstance(track, Track) or np.ndim(track.postures) != 2:
            got = "that of one frame" if isinstance(track, Track) else type(track).__name__
            raise ValueError(
                f"track must be the Track of one take, as from MotionTracker.track; got {got}. Of "
                "a list of them give one."
            )
        if n_frames is not None and (not is_integer(n_frames) or n_frames < 2):
            raise ValueError(f"n_frames must be frames of the clock, at least 2; got {n_frames!r}.")
        if unit not in list(_UNITS):
            raise ValueError(f"unit must be one of {list(_UNITS)}, got {unit!r}.")
        shape = np.shape(track.postures)
        self.track, self.n_frames, self.unit = track, n_frames, unit
        self.truth, self.observed = (
            None if x is None else as_drawn(x, what, shape)
            for x, what in ((truth, "The truth"), (observed, "What was observed"))
        )
        if times is not None:
            times = as_drawn(times, "times", shape[:1]).astype(np.float64)
        self.times = from_zero(times, shape[0], 0)
        names = [f"x{k}" for k in range(shape[1])] if names is None else names
        self.names = as_names(names, shape[1], "names", "features")
        self.hidden = np.zeros(shape, dtype=bool)
        if self.observed is not None:
            self.hidden = np.isnan(self.observed)

    def __repr__(self):
        n_frames, n_features = self.hidden.shape
        count = int(self.hidden.any(axis=0).sum())
        return (
            f"TrackingDisplay({n_frames} frames of {n_features} features, {count} of them hidden "
            "at times)"
        )

    @classmethod
    def from_estimator(
        cls,
        estimator,
        X,
        *,
        truth=None,
        smooth=False,
        times=None,
        projection=None,
        take=0,
        features=None,
        names=None,
        ax=None,
    ):
        """Follow a take, and draw what is known of it.

        Parameters
        ----------
        estimator : MotionTracker
            Fitted.
        X : array-like (n_frames, n_observed), or takes, as ``estimator.track`` takes them
        truth : array-like (n_frames, n_features), or as many as takes, as X, default=None
        smooth : bool, default=False
            Whether ``estimator.smooth`` answers, which knows all of the take at every frame.
        times : array-like (n_frames,), or as many as takes, default=None
        projection : as for ``estimator.track``, default=None
            What is observed is then not drawn: it is no feature.
        take : int, default=0
            Which of several takes.
        features, ax : as for `plot`
        names : list of str, default=None
            Of all features; by default those of ``fit``.

        Returns
        -------
        TrackingDisplay

        Raises
        ------
        ValueError
            As from ``estimator.track``; or if there is no such take or feature.
        """
        if not isinstance(estimator, MotionTracker):
            raise ValueError(f"Give a MotionTracker, got {type(estimator).__name__}.")
        given, arrays, labels, single = taken(estimator, X)
        i = as_index(take, len(arrays), "take")
        if times is not None:
            of_all = [times] if single else times
            (times,) = times_of(estimator, of_all, [i], arrays, labels, "takes")
        if truth is not None:
            truth = one_each(
                taken(estimator, truth, "The truth")[1], len(arrays), "truth", "takes"
            )[i]
        method = estimator.smooth if smooth else estimator.track
        (track,) = method(given([i]), None if times is None else [times], projection)
        rate = 1.0 if estimator.frame_rate is None else estimator.frame_rate
        if names is None:
            names = names_of_features(None, estimator, track.postures.shape[1])
        return cls(
            track,
            truth=truth,
            observed=arrays[i] if projection is None else None,
            times=np.arange(len(track.phases)) / rate if times is None else times,
            n_frames=estimator.n_frames_,
            names=names,
            unit="frames" if estimator.frame_rate is None else "seconds",
        ).plot(ax, features=features)

    @classmethod
    def from_predictions(cls, track, *, features=None, ax=None, **known):
        """Draw a track that is there already.

        Parameters
        ----------
        track : Track
        features, ax : as for `plot`
        **known : dict
            What else is known of it: the parameters of the class.

        Returns
        -------
        TrackingDisplay
        """
        return cls(track, **known).plot(ax, features=features)

    def plot(self, ax=None, *, features=None):
        """Draw.

        Parameters
        ----------
        ax : Axes or array-like of Axes, default=None
            One of a figure's subplots is divided into the panels; or one axes a panel. None
            makes a figure.
        features : int, str or list of them, default=None
            By index or name; by default those that vary most in the estimate, at most four, of
            those that were hidden at any time, or of all if none was.

        Returns
        -------
        self
        """
        shown = self._most_varied() if features is None else choose_features(features, self.names)
        count = len(shown) + 2
        size = _WIDTH, _PANEL * count + 0.6
        before = getattr(self, "axes_", [])
        self.figure_, self.axes_ = panels(ax, [(i, 0) for i in range(count)], count, 1, size)
        for axis in self.axes_:
            if axis in before:
                axis.clear()
        self.estimates_, self.bands_, self.truths_, self.observed_ = [], [], [], []
        for axis, k in zip(self.axes_, shown, strict=False):
            self._draw_feature(axis, k)
        self._draw_progress(*self.axes_[-2:])
        any_hidden = self.hidden[:, shown].any(axis=1)
        masks = [*self.hidden[:, shown].T, any_hidden, any_hidden]
        grey = {"color": COLORS["shadow"], "alpha": 0.7, "linewidth": 0, "zorder": 0}
        hatched = {"facecolor": "none", "edgecolor": COLORS["departure"], "hatch": "///"}
        hatched |= {"linewidth": 0, "alpha": 0.5, "zorder": 0.5}
        self.hidden_ = [
            self._spans(axis, mask, label="hidden", **grey)
            for axis, mask in zip(self.axes_, masks, strict=True)
        ]
        lost = np.asarray(self.track.lost, dtype=bool)
        self.lost_ = [self._spans(axis, lost, label="lost", **hatched) for axis in self.axes_]
        for axis in self.axes_:
            axis.set_xlim(0, self.times[-1] or 1.0)
            axis.tick_params(labelbottom=axis is self.axes_[-1])
        self.axes_[-1].set_xlabel(_UNITS[self.unit])
        self.figure_.align_ylabels(self.axes_)
        handles, labels = self.axes_[0].get_legend_handles_labels()
        of_label = dict(zip(labels, handles, strict=True))
        legend_above(self.axes_[:1], list(of_label.values()), list(of_label))
        return self

    def strip(self, cosines, *, frames=6, ax=None, **view):
        """Estimated bodies at a few moments, before the true ones; violet are hidden limbs.

        Parameters
        ----------
        cosines : DirectionCosines
            Fitted; what made the features.
        frames : int or list of int, default=6
            How many, evenly spaced from the first to the last, or which ones.
        ax, **view : as for `SkeletonDisplay.plot`

        Returns
        -------
        SkeletonDisplay
        """
        skeleton, estimate, truth = self._bodies(cosines)
        shown = as_frames(frames, len(estimate))
        limbs = np.array([limb_of(name) for name in cosines.get_feature_names_out()])
        marked = [
            dict.fromkeys(
                bone
                for limb in dict.fromkeys(limbs[self.hidden[frame]])
                for bone in bones_of(limb, skeleton)
            )
            for frame in shown
        ]
        unit = " s" if self.unit == "seconds" else ""
        titles = [f"{self.times[k]:.1f}{unit}" if unit else f"frame {k}" for k in shown]
        return SkeletonDisplay(
            [[estimate[[frame]]] for frame in shown],
            skeleton,
            titles,
            marked=[list(bones) for bones in marked],
            behind=None if truth is None else [[truth[[frame]]] for frame in shown],
        ).plot(ax, **view)

    def side_by_side(self, cosines, *, ax=None, **view):
        """Bodies beside each other, to `SkeletonDisplay.animate`: what was seen, estimate, truth.

        Parameters
        ----------
        cosines : DirectionCosines
            Fitted; what made the features.
        ax, **view : as for `SkeletonDisplay.plot`

        Returns
        -------
        SkeletonDisplay
            At the beginning.
        """
        skeleton, estimate, truth = self._bodies(cosines)
        people = {"estimate": estimate, "truth": truth}
        if self.observed is not None:
            gaps = copy(cosines).set_params(hidden="nan")
            people = {"seen": _positions(gaps, self.observed, skeleton)} | people
        people = {name: x for name, x in people.items() if x is not None}
        title = ["what is known of a body"]
        return SkeletonDisplay([list(people.values())], skeleton, title, labels=list(people)).plot(
            ax, **view
        )

    # -- what is drawn ------------------------------------------------------------------------

    def _most_varied(self):
        """The features that move most, of those that were hidden."""
        variance = np.var(self.track.postures, axis=0)
        hidden = self.hidden.any(axis=0)
        candidates = np.flatnonzero(hidden if hidden.any() else ~hidden)
        return candidates[np.argsort(-variance[candidates], kind="stable")][:_FEW_FEATURES]

    def _draw_feature(self, axis, k):
        estimate = self.track.postures[:, k]
        wide = _BAND * np.sqrt(np.maximum(self.track.covariances[:, k, k], 0))
        blue = COLORS["performance"]
        style = {"color": blue, "alpha": 0.25, "linewidth": 0, "label": "90 %"}
        self.bands_.append(axis.fill_between(self.times, estimate - wide, estimate + wide, **style))
        if self.truth is not None:
            style = {"color": COLORS["mean"], "linewidth": 1.2, "label": "truth"}
            self.truths_ += axis.plot(self.times, self.truth[:, k], **style)
        style = {"color": blue, "linewidth": 1.8, "label": "estimate"}
        self.estimates_ += axis.plot(self.times, estimate, **style)
        if self.observed is not None:
            style = {"color": COLORS["pattern"], "markersize": 2.5, "label": "seen"}
            self.observed_ += axis.plot(self.times, self.observed[:, k], ".", **style)
        axis.set_ylabel(fill(self.names[k], _LETTERS), fontsize="small")

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
        # The axis of another display may be shared.
        lower.set_ylim(0, max(lower.get_ylim()[1], 1.1 * max(1, *self.track.rates)))
        lower.set_ylabel("rate", fontsize="small")

    def _spans(self, axis, mask, **style):
        """Shade the time of frames, each of them until half-way to the next."""
        edges = np.flatnonzero(np.diff(np.concatenate([[0], mask.astype(int), [0]])))
        middles = (self.times[1:] + self.times[:-1]) / 2
        bounds = np.concatenate([self.times[:1], middles, self.times[-1:]])
        return [axis.axvspan(bounds[a], bounds[b], **style) for a, b in edges.reshape(-1, 2)]

    def _bodies(self, cosines):
        """The skeleton of bodies, the estimated ones, and the true ones or None."""
        if not isinstance(cosines, DirectionCosines):
            raise ValueError(f"cosines must be DirectionCosines, got {type(cosines).__name__}.")
        skeleton = cosines.skeleton.body()
        estimate, truth = (
            None if x is None else _positions(cosines, x, skeleton)
            for x in (self.track.postures, self.truth)
        )
        return skeleton, estimate, truth


def _positions(cosines, postures, skeleton):
    """Joint positions (n_frames, n_joints, n_dims) of postures."""
    found = np.asarray(cosines.inverse_transform(np.asarray(postures)))
    return found.reshape(len(postures), len(skeleton.joints), skeleton.n_dims)
