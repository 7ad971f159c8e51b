"""PhaseDisplay: the phase of running trials, and the predicted rest of them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from textwrap import fill
from typing import Any, NamedTuple, Self

import numpy as np
from sklearn.base import BaseEstimator

from ..body.direction_cosines import DirectionCosines
from ..body.skeleton import Skeleton
from ..inputs.collections import as_collection
from ..inputs.facts import units_of_columns
from ..inputs.features import choose_features, names_of_features
from ..inputs.types import Features, Indexed, TrialsLike, ValuesLike
from ..inputs.wording import counted
from ..live.stream import Course, LivePhase
from ..live.synchronizer import OnlineSynchronizer
from ..matching.counting import first_largest
from ..utils.pipelines import find_step
from .animation import MovingDisplay
from .arguments import (
    as_index,
    as_trials,
    labels_of_signals,
    names_of_trials,
    time_label,
    times_from_zero,
)
from .base import COLORS, WIDTH, AxesLike, front_line, legend_above
from .bodies import BodyPanel, bounds, invert_poses, project, stage

# The number of trials by default.
_N_TRIALS = 4
# The height of a row of panels in inches.
_ROW = 2.2
# Characters a line of a title or an axis label.
_LINE_LENGTH = 24
# The interval of the arc of a dial, as a share of the mean duration.
_AHEAD = 0.1
# The opacity of the interval of the phase.
_INTERVAL_OPACITY = 0.25
# Cycles on the time axis.
_N_CYCLES = 5
# The number of points of a prediction.
_N_POINTS = 60
# Inner and outer radius of the ring and of the arc around it, and the radius of the numbers.
_RING, _ARC, _NUMBERS = (0.78, 1.0), (1.05, 1.13), 1.28
# The direction of the viewer of bodies in degrees.
_AZIMUTH = -60
# The opacity of the ring at confidence 0.
_MIN_OPACITY = 0.12


class PhaseDisplay(MovingDisplay):
    """Running trials: their phase, its confidence, and a prediction.

    Panels for each trial: a dial of its phase, with an arc that ends at the phase after a
    tenth of the mean duration at the present rate; the phase over time with its interval and its
    confidence; and features, as far as they were observed, with the predicted rest: the mean from
    the phase on, for as long as `OnlineSynchronizer.time_left` estimates. With ``body`` also a
    stick figure, before the mean one at the end of that arc. Use `from_estimator`.

    Attributes
    ----------
    axes_ : list of Axes
        Row by row: a body if there are bodies, the dial, the phase, and one a feature.
    rows_ : list
        The artists of each trial: ``row.dial.passed``, ``row.phase``, ``row.interval``,
        ``row.confidence``, ``row.rest``, ``row.curves[k].seen``, ``row.curves[k].expected``.

    Examples
    --------
    >>> from sklearn_motionsync import ASpace, DirectionCosines
    >>> from sklearn_motionsync.live import OnlineSynchronizer
    >>> from sklearn_motionsync.display import PhaseDisplay
    >>> from sklearn_motionsync.datasets import make_bending
    >>> from sklearn.pipeline import make_pipeline
    >>> bunch = make_bending(8, random_state=0)
    >>> features = make_pipeline(DirectionCosines(bunch.skeleton), ASpace())
    >>> X = features.fit_transform(bunch.data)
    >>> live = OnlineSynchronizer().fit(X[:6])
    >>> display = PhaseDisplay.from_estimator(live, X[6:], frame=40)
    >>> display, len(display.axes_)
    (PhaseDisplay(2 trials), 6)
    """

    action: LearntAction
    trials: list[RunningTrial]
    features: Sequence[str]  # their labels
    skeleton: Skeleton | None = None  # of the bodies
    xlabel: str
    time: float  # the moment that is drawn

    def __repr__(self):
        return f"PhaseDisplay({counted(len(self.trials), 'trial')})"

    @classmethod
    def from_estimator(
        cls,
        estimator: BaseEstimator,
        X: TrialsLike,
        *,
        times: Indexed[ValuesLike] | ValuesLike | None = None,
        features: Features | None = None,
        body: BaseEstimator | None = None,
        names: Sequence[str] | None = None,
        units: str | Sequence[str] | Mapping[str, str] | None = None,
        frame: int | None = None,
        ax: AxesLike | None = None,
    ) -> Self:
        """Follow trials, and draw their phases.

        Parameters
        ----------
        estimator : OnlineSynchronizer
            Fitted. The trials that it follows live are not affected.
        X : list of arrays (n_frames_i, n_features), or one of them
            Trials; of more than four the first four are drawn.
        times : list of array-like (n_frames_i,), default=None
            As ``estimator.track`` takes them; of one trial an array.
        features : int, str or list of them, default=None
            By index or name; by default the one that varies most in the mean trial.
        body : DirectionCosines or Pipeline, default=None
            The fitted transformer of the features, with ``inverse_transform``. The body is then
            drawn, without the limbs that have a NaN cosine. In a pipeline one NaN hides the body.
        names : list of str, default=None
            The names of the trials that are drawn; by default their labels in X, or numbers.
        units : str, list of str or dict, default=None
            The units of the features: of all, one each, or by name. By default what tables tell in
            ``attrs["units"]``.
        frame : int, default=None
            The frame of the longest trial that is drawn; the others are drawn at the same time. By
            default the last.
        ax : Axes or array-like of Axes, default=None
            See `plot`.

        Returns
        -------
        PhaseDisplay
            The display, drawn.

        Raises
        ------
        ValueError
            As from ``estimator.track``; or if there is no such feature or frame.
        """
        if not isinstance(estimator, OnlineSynchronizer):
            raise ValueError(
                f"estimator must be an OnlineSynchronizer, got {type(estimator).__name__}."
            )
        live = estimator
        is_single, trials = as_collection(X) is None, list(as_trials(X))
        trials = trials[:_N_TRIALS]
        names = names_of_trials(names, trials)
        stamps = None
        if times is not None:
            listed: Any = [times] if is_single else times
            stamps = listed[:_N_TRIALS]
        tracked = live.track(trials, stamps)
        seen = [np.asarray(x, dtype=np.float64) for x in trials]
        feature_names = names_of_features(body, live, live.mean_.shape[1])
        if features is None:
            features = [first_largest(live.mean_.var(axis=0))]
        shown = choose_features(features, feature_names)
        skeleton, bodies = None, [None] * (len(seen) + 1)
        if body is not None:
            skeleton = find_step(body, DirectionCosines)[1].skeleton.body()
            bodies = [invert_poses(x, body, skeleton) for x in (*seen, live.mean_)]
        duration = live.duration_ / (live.frame_rate or 1.0)
        action = LearntAction(
            live.n_frames_, live.cyclic, duration, live.mean_[:, shown], bodies[-1]
        )
        running = []
        for k, (x, phases) in enumerate(zip(seen, tracked, strict=True)):
            stamps_of_trial = None if stamps is None else stamps[k]
            clock = times_from_zero(stamps_of_trial, len(x), live.frame_rate)
            left = action.times_left(phases, clock)
            running.append(RunningTrial(phases, clock, left, names[k], x[:, shown], bodies[k]))
        labels = [feature_names[k] for k in shown]
        longest = max((p.times for p in running), key=lambda times: times[-1])
        last = len(longest) - 1
        return cls._of(
            action=action,
            trials=running,
            features=labels_of_signals(labels, units_of_columns(trials[0]), units),
            skeleton=skeleton,
            xlabel=time_label(live.frame_rate),
            time=longest[last if frame is None else as_index(frame, last + 1, "frame")],
        ).plot(ax)

    def _layout(self):
        # Two panels beside each other; an odd last one has the whole width.
        has_bodies, count = self.skeleton is not None, len(self.trials)
        n_panels = has_bodies + 2 + len(self.features)
        places = [divmod(i, 2) for i in range(n_panels)]
        if n_panels % 2:
            places[-1] = (n_panels // 2, slice(None))
        each = -(-n_panels // 2)
        cells = [(each * k + row, column) for k in range(count) for row, column in places]
        return cells, (count * each, 2), (WIDTH, count * each * _ROW + 0.3)

    def _draw(self):
        last = self.action.n_frames - 1
        # The latest time observed or predicted.
        end = max((p.times + np.where(p.phases.phase < last, p.left, 0)).max() for p in self.trials)
        by_row = np.array(self.axes_, dtype=object).reshape(len(self.trials), -1)
        curves_from = (self.skeleton is not None) + 1
        self.rows_ = []
        for axes, p in zip(by_row, self.trials, strict=True):
            row = TrialRow(axes, p, self.action, self.skeleton, self.features)
            self.rows_.append(row)
            axes[0].set_title(fill(p.name, _LINE_LENGTH), fontsize="medium", parse_math=False)
            for axis in axes[curves_from:]:
                axis.set_xlim(0, 1.02 * end or 1.0)
                axis.set_xlabel(self.xlabel)
            row.show(self.time)
        # One legend for all curves.
        for axis in by_row[0, curves_from : curves_from + 2]:
            handles, _ = axis.get_legend_handles_labels()
            # Areas before lines.
            handles.sort(key=lambda handle: hasattr(handle, "get_xdata"))
            legend_above([axis], handles, n_cols=2)

    def _show(self, share):
        time = share * max(p.times[-1] for p in self.trials)
        for row in self.rows_:
            row.show(time)


# -- what is drawn -----------------------------------------------------------------------


class LearntAction(NamedTuple):
    """The learnt action.

    Attributes
    ----------
    n_frames : int
        The length of the clock.
    cyclic : bool
        Whether it is a cycle.
    duration : float
        The mean duration in the unit of the times.
    mean : ndarray, shape (P, n_shown)
    body : ndarray (P, n_joints, n_dims), or None
        The mean body.
    """

    n_frames: int
    cyclic: bool
    duration: float
    mean: np.ndarray
    body: np.ndarray | None

    def interpolate(self, phase, values):
        """Values at the frames of the clock, interpolated to phases."""
        clock = np.arange(self.n_frames)
        flat = values.reshape(self.n_frames, -1)
        there = np.stack([np.interp(phase, clock, column) for column in flat.T], axis=-1)
        return there.reshape(*np.shape(phase), *values.shape[1:])

    def times_left(self, phases, times):
        """The time left at every frame, as `OnlineSynchronizer.time_left` estimates it."""
        course, out = Course(self.n_frames, self.duration, self.cyclic), []
        for now in zip(times, phases.phase, phases.cycle, strict=True):
            course.follow(*map(np.atleast_1d, now))
            out.append(course.time_left()[0])
        return np.array(out)


class RunningTrial(NamedTuple):
    """A trial with its phases.

    Attributes
    ----------
    phases : LivePhase
        Of arrays (n_frames,).
    times : ndarray, shape (n_frames,)
        The first time is 0.
    left : ndarray, shape (n_frames,)
        The time left.
    name : str
    seen : ndarray, shape (n_frames, n_shown)
    body : ndarray (n_frames, n_joints, n_dims), or None
    """

    phases: LivePhase
    times: np.ndarray
    left: np.ndarray
    name: str
    seen: np.ndarray
    body: np.ndarray | None


class TrialRow:
    """The panels of one trial: a body if there is one, a dial, the phase, curves.

    Parameters
    ----------
    axes : list of Axes
    trial : RunningTrial
    action : LearntAction
    skeleton : Skeleton or None
        The skeleton of the bodies.
    features : list of str
        The labels of the curves.
    """

    def __init__(self, axes, trial, action, skeleton, features):
        self.axes, self._trial, self._action = list(axes), trial, action
        axes, self.body = list(axes), None
        if trial.body is not None:
            self._bodies, self._mean = (
                project(x, skeleton, _AZIMUTH) for x in (trial.body, action.body)
            )
            places = [x.reshape(-1, 2) for x in (self._bodies, self._mean)]
            stage(axes[0], "", *bounds(np.concatenate(places)))
            self.body = BodyPanel(axes.pop(0), skeleton)
        self.dial = PhaseDial(axes.pop(0))
        self._time_axes = axes
        self.confidence = self.interval = None
        (self.rest,) = axes[0].plot([], [], color=COLORS["mean"], linestyle=":", label="predicted")
        self.phase = front_line(axes[0], [], [], color=COLORS["trial"], label="phase")
        axes[0].set_ylim(0, 105)
        axes[0].set_ylabel("phase (%)")
        # Ticks need not be drawn again with the areas over them.
        axes[0].set_axisbelow(True)
        self.curves = [
            FeaturePanel(axis, trial, action, k, name)
            for k, (axis, name) in enumerate(zip(axes[1:], features, strict=True))
        ]

    def show(self, time):
        """Move to a time."""
        p, action = self._trial, self._action
        now = max(np.searchsorted(p.times, time, side="right") - 1, 0)
        phase, rate, confidence, lower, upper, cycle = p.phases
        last, past = action.n_frames - 1, slice(now + 1)
        ahead = phase[now] + _AHEAD * last * rate[now]
        # Of a cycle it may be in the next one.
        ahead = ahead if action.cyclic else min(ahead, last)
        number = cycle[now] if action.cyclic else None
        self.dial.show(phase[now] / last, ahead / last, rate[now], confidence[now], number)
        axis, style = self._time_axes[0], {"color": COLORS["shadow"], "alpha": 0.75}
        level = 100 * confidence[past]
        self.confidence = _refilled(
            self.confidence, axis, p.times[past], 0, level, label="confidence", **style
        )
        # The line and its band have a gap where a cycle begins.
        begins = 1 + np.flatnonzero(np.diff(cycle[past]))
        so_far = np.stack([p.times, *(100 / last * values for values in (phase, lower, upper))])
        times, percent, *band = np.insert(so_far[:, past], begins, np.nan, axis=1)
        self.phase.set_data(times, percent)
        style = {"color": COLORS["trial"], "alpha": _INTERVAL_OPACITY}
        self.interval = _refilled(self.interval, axis, times, *band, label="90 % band", **style)
        if action.cyclic:
            stop = p.times[now] + action.duration
            for axis in self._time_axes:
                axis.set_xlim(max(0, stop - _N_CYCLES * action.duration), stop)
        # Nothing is predicted at the end.
        n_points = _N_POINTS if phase[now] < last else 0
        times = p.times[now] + np.linspace(0, p.left[now], n_points)
        phases = np.linspace(phase[now], last, n_points)
        self.rest.set_data(times, 100 / last * phases)
        if self.body is not None:
            ahead = ahead % last if action.cyclic else ahead
            self.body.show([self._bodies[now]], [action.interpolate(ahead, self._mean)])
        for curve in self.curves:
            curve.show(now, times, phases)


class PhaseDial:
    """A ring from 0 % at the top clockwise to 100 %.

    Parameters
    ----------
    axis : Axes

    Attributes
    ----------
    passed : Wedge
        From 0 to the phase; the opacity shows the confidence.
    ahead : Wedge
        From the phase to the phase ahead.
    share, state : Text
        The phase in per cent; rate and confidence.
    """

    def __init__(self, axis):
        from matplotlib.patches import Wedge

        axis.set_aspect("equal")
        axis.set_xlim(-1.5, 1.5)
        axis.set_ylim(-1.75, 1.45)
        axis.axis("off")

        def ring(color, inner, outer, end):
            return axis.add_patch(
                Wedge((0, 0), outer, end, 90, width=outer - inner, facecolor=color, linewidth=0)
            )

        ring(COLORS["shadow"], *_RING, end=-270)
        self.passed = ring(COLORS["trial"], *_RING, end=90)
        self.ahead = ring(COLORS["mean"], *_ARC, end=90)
        for quarter, text in enumerate(("0 %", "25", "50", "75")):
            angle, radius = np.pi * quarter / 2, _NUMBERS + 0.02 * (quarter % 2)
            x, y = radius * np.sin(angle), radius * np.cos(angle)
            axis.text(x, y, text, color="0.35", fontsize="x-small", ha="center", va="center")
        self.share = axis.text(0, 0, "", fontsize="large", ha="center", va="center")
        self.state = axis.text(0, -1.62, "", fontsize="small", ha="center", va="center")

    def show(self, share, ahead, rate, confidence, cycle=None):
        """Move to a share of the action, or of the cycle of this number."""
        # Rounding may take a sum of probabilities above 1.
        confidence = min(confidence, 1)
        self.passed.set_theta1(90 - 360 * share)
        self.passed.set_alpha(_MIN_OPACITY + (1 - _MIN_OPACITY) * confidence)
        self.ahead.set_theta1(90 - 360 * ahead)
        self.ahead.set_theta2(90 - 360 * share)
        # A wedge of no length would be drawn as a whole ring.
        self.ahead.set_visible(ahead > share)
        self.share.set_text(f"{100 * share:.0f} %")
        number = "" if cycle is None else f"cycle {cycle:.0f}, "
        self.state.set_text(f"{number}rate {rate:.1f}, confidence {confidence:.2f}")


class FeaturePanel:
    """A feature as it was observed, and its prediction."""

    def __init__(self, axis, trial, action, k, name):
        self._times, self._seen = trial.times, trial.seen[:, k]
        self._action, self._k = action, k
        blue, orange = COLORS["trial"], COLORS["mean"]
        (self.to_come,) = axis.plot(
            self._times,
            self._seen,
            label="what came",
            color=blue,
            linewidth=1,
            linestyle="--",
            alpha=0.6,
        )
        (self.expected,) = axis.plot([], [], color=orange, linewidth=2, label="predicted")
        self.seen = front_line(axis, [], [], color=blue, label="seen")
        (self.now,) = axis.plot([], [], "o", color=blue, markersize=5, zorder=5)
        values = np.concatenate([self._seen, action.mean[:, k]])
        low, high = np.nanmin(values), np.nanmax(values)
        margin = 0.06 * (high - low) or 1.0
        axis.set_ylim(low - margin, high + margin)
        axis.set_ylabel(fill(name, _LINE_LENGTH))

    def show(self, now, times, phases):
        """Move to a frame, with the times and the phases of the predicted rest."""
        past = slice(now + 1)
        self.seen.set_data(self._times[past], self._seen[past])
        self.now.set_data([self._times[now]], [self._seen[now]])
        mean = self._action.interpolate(phases, self._action.mean[:, self._k])
        self.expected.set_data(times, mean)


def _refilled(area, axis, xs, lower, upper, **style):
    """The area between two curves, which takes the place of an earlier one."""
    if area is not None:
        area.remove()
    return axis.fill_between(xs, lower, upper, linewidth=0, zorder=1, **style)
