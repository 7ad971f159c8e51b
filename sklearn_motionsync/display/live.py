"""PhaseDisplay: the phase of running performances, and the predicted rest of them."""

from __future__ import annotations

from collections.abc import Sequence
from textwrap import fill
from typing import Any, Literal, NamedTuple, Self

import numpy as np
from sklearn.base import BaseEstimator

from ..body.direction_cosines import DirectionCosines
from ..body.skeleton import Skeleton
from ..inputs.features import choose_features, names_of_features
from ..inputs.types import (
    Features,
    Indexed,
    PerformanceLike,
    PerformancesLike,
    SupportsArray,
    ValuesLike,
)
from ..matching.counting import first_largest
from ..online.stream import Course, LivePhase, each_value
from ..online.synchronizer import OnlineSynchronizer
from ..utils.pipelines import find_step
from .animation import animate
from .arguments import (
    TIME_LABELS,
    Animation,
    AxesLike,
    Takes,
    as_index,
    as_indices,
    as_names,
    times_from_zero,
)
from .bodies import bones_by_side, bounds, invert_postures, landmark_track, project
from .dial import PhaseDial
from .drawing import COLORS, WIDTH, bone_lines, front_line, legend_above, panels, stage

__all__ = ["PhaseDisplay"]

# The number of performances by default.
_N_PERFORMANCES = 4
# The height of a row of panels in inches.
_ROW = 2.2
# Characters a line of a title or an axis label.
_LINE_LENGTH = 24
# The interval of the arc of a dial, as a share of the mean duration.
_AHEAD = 0.1
# Standard deviations on each side that contain 90 %.
_BAND = 1.645
# The opacity of the interval of the phase.
_INTERVAL_OPACITY = 0.25
# Cycles on the time axis.
_N_CYCLES = 5
# The number of points of a prediction.
_N_POINTS = 60


class PhaseDisplay:
    """Running performances: their phase, its confidence, and a prediction.

    Panels for each performance: a dial of its phase, with an arc that ends at the phase after a
    tenth of the mean duration at the present rate; the phase over time with its interval and its
    confidence; and features, as far as they were observed, with the predicted rest: the mean from
    the phase on, for as long as `OnlineSynchronizer.time_left` estimates. With ``body`` also a
    stick figure, before the mean one at the end of that arc. Make one with `from_estimator` or
    `from_predictions`.

    Parameters
    ----------
    phases : LivePhase, or list of LivePhase
        Of arrays (n_frames_i,); or of arrays (n_frames, n_streams).
    n_frames : int
        The length of the clock, ``P``.
    times : list of array-like (n_frames_i,), default=None
        The times of the frames; by default frame numbers.
    duration : float, default=None
        The mean duration of the action in the unit of the times; None predicts nothing.
    seen : list of array-like (n_frames_i, n_shown), default=None
        The observed features.
    mean, spread : array-like, shape (P, n_shown), default=None
        The expected features, and their standard deviation.
    afterwards : list of array-like (n_frames_i,) or None, default=None
        The phases as they are known at the end of a performance.
    features : list of str, default=None
        The names of the features.
    bodies : list of array-like (n_frames_i, n_joints, n_dims), default=None
        Joint positions, y up; NaN where they were not observed.
    mean_body : array-like, shape (P, n_joints, n_dims), default=None
        The mean joint positions; together with bodies.
    skeleton : Skeleton, default=None
        The skeleton of the bodies.
    names : list of str, default=None
        The names of the performances.
    unit : {"frames", "seconds"}, default="frames"
        The unit of the times.
    cyclic : bool, default=False
        Whether the phases are those of cycles. The time axis then shows the last few of them.

    Attributes
    ----------
    figure_ : Figure
        The figure of the last plot.
    axes_ : list of Axes
        Row by row: a body if there are bodies, the dial, the phase, and one a feature.
    rows_ : list
        The artists of each performance: ``row.dial.passed``, ``row.phase``, ``row.interval``,
        ``row.confidence``, ``row.afterwards``, ``row.rest``, ``row.curves[k].seen``,
        ``row.curves[k].expected``.

    Examples
    --------
    >>> from sklearn_motionsync import ASpace, DirectionCosines, OnlineSynchronizer
    >>> from sklearn_motionsync.display import PhaseDisplay
    >>> from sklearn_motionsync.datasets import make_bending
    >>> from sklearn.pipeline import make_pipeline
    >>> bunch = make_bending(8, random_state=0)
    >>> features = make_pipeline(DirectionCosines(bunch.skeleton), ASpace())
    >>> X = features.fit_transform(bunch.data)
    >>> live = OnlineSynchronizer().fit(X[:6])
    >>> display = PhaseDisplay.from_estimator(live, X[6:], frame=40)
    >>> display, len(display.axes_)
    (PhaseDisplay(2 performances), 6)
    """

    def __init__(
        self,
        phases: LivePhase | Sequence[LivePhase],
        n_frames: int,
        *,
        times: Indexed[ValuesLike] | None = None,
        duration: float | None = None,
        seen: PerformancesLike | None = None,
        mean: PerformanceLike | None = None,
        spread: PerformanceLike | None = None,
        afterwards: Indexed[ValuesLike | None] | None = None,
        features: Sequence[str] | None = None,
        bodies: Indexed[SupportsArray] | None = None,
        mean_body: SupportsArray | None = None,
        skeleton: Skeleton | None = None,
        names: Sequence[str] | None = None,
        unit: Literal["frames", "seconds"] = "frames",
        cyclic: bool = False,
    ) -> None:
        phases = _as_list_of_phases(phases)
        count, nothing = len(phases), [None] * len(phases)
        self.names = list(map(str, range(count))) if names is None else names
        self.unit, self.skeleton = unit, skeleton
        n_shown = 0 if seen is None else np.shape(seen[0])[1]
        self.features = [f"x{k}" for k in range(n_shown)] if features is None else features
        learnt = map(_as_floats, (mean, spread, mean_body))
        self._action = LearntAction(n_frames, cyclic, duration, *learnt)
        times = nothing if times is None else times
        times = [times_from_zero(t, len(of.phase)) for t, of in zip(times, phases, strict=True)]
        parts = (nothing if x is None else x for x in (seen, afterwards, bodies))
        self._performances = [
            RunningPerformance(
                *map(_as_floats, phase),
                np.zeros(len(t), dtype=np.intp) if phase.cycle is None else phase.cycle,
                t,
                self._action.times_left(phase, t),
                name,
                *map(_as_floats, of_one),
            )
            for phase, name, t, *of_one in zip(phases, self.names, times, *parts, strict=True)
        ]

    def __repr__(self):
        count = len(self._performances)
        return f"PhaseDisplay({count} performance{'s' * (count != 1)})"

    @classmethod
    def from_estimator(
        cls,
        estimator: BaseEstimator,
        X: PerformancesLike,
        *,
        times: Indexed[ValuesLike] | None = None,
        performances: int | Sequence[int] | None = None,
        features: Features | None = None,
        training: PerformancesLike | None = None,
        body: BaseEstimator | None = None,
        names: Sequence[str] | None = None,
        frame: int | None = None,
        ax: AxesLike | None = None,
        azimuth: float = -60,
    ) -> Self:
        """Follow performances, and draw their phases.

        Parameters
        ----------
        estimator : OnlineSynchronizer
            Fitted. The performances that it follows live are not affected.
        X : performances
            As ``estimator.track`` takes them; or one, array (n_frames, n_features).
        times : list of array-like (n_frames_i,), default=None
            As ``estimator.track`` takes them; of one performance an array.
        performances : int or list of int, default=None
            The indices of the performances that are drawn; by default the first four.
        features : int, str or list of them, default=None
            By index or name; by default the one that varies most in the mean performance.
        training : performances, default=None
            Those of ``fit``. Their standard deviation from the mean is drawn as a band.
        body : DirectionCosines or Pipeline, default=None
            The fitted transformer of the features, with ``inverse_transform``. The body is then
            drawn, without the limbs that have a NaN cosine. In a pipeline one NaN hides the body.
        names : list of str, default=None
            The names of the performances that are drawn; by default their labels in X, or numbers.
        frame : int, default=None
            A frame of the longest performance; the others are drawn at the same time. By default
            the last.
        ax : Axes or array-like of Axes, default=None
            See `plot`.
        azimuth : float, default=-60
            The direction of the viewer of bodies in degrees, as in `SkeletonDisplay`.

        Returns
        -------
        PhaseDisplay
            The display, drawn.

        Raises
        ------
        ValueError
            As from ``estimator.track``; or if there is no such performance, feature or frame.
        """
        if not isinstance(estimator, OnlineSynchronizer):
            raise ValueError(
                f"estimator must be an OnlineSynchronizer, got {type(estimator).__name__}."
            )
        live = estimator
        takes = Takes(live, X)
        if performances is None:
            performances = range(min(_N_PERFORMANCES, len(takes.arrays)))
        chosen = as_indices(performances, len(takes.arrays), "performances")
        if names is None:
            names = [takes.labels[i] for i in chosen]
        names = as_names(names, len(chosen), "names", "performances")
        if times is not None:
            times = takes.select_times(times, chosen)
        phases = live.track(takes.select(chosen), times)
        seen = [np.asarray(takes.arrays[i], dtype=np.float64) for i in chosen]
        feature_names = names_of_features(body, live, live.mean_.shape[1])
        if features is None:
            features = [first_largest(live.mean_.var(axis=0))]
        shown = choose_features(features, feature_names)
        rate = 1.0 if live.frame_rate is None else live.frame_rate
        bodies, mean_body, skeleton = None, None, None
        if body is not None:
            skeleton = find_step(body, DirectionCosines)[1].skeleton.body()
            *bodies, mean_body = (invert_postures(x, body, skeleton) for x in (*seen, live.mean_))
        display = cls(
            phases,
            live.n_frames_,
            times=times if times or rate == 1 else [np.arange(len(x)) / rate for x in seen],
            duration=live.duration_ / rate,
            seen=[x[:, shown] for x in seen],
            mean=live.mean_[:, shown],
            spread=None if training is None else _spread(live, training)[:, shown],
            afterwards=[
                None
                if live.cyclic or np.isnan(x).any()
                else _final_phases(live, takes.select([i]), len(x))
                for i, x in zip(chosen, seen, strict=True)
            ],
            features=[feature_names[k] for k in shown],
            bodies=bodies,
            mean_body=mean_body,
            skeleton=skeleton,
            names=names,
            unit="frames" if live.frame_rate is None else "seconds",
            cyclic=live.cyclic,
        )
        return display.plot(ax, frame=frame, azimuth=azimuth)

    @classmethod
    def from_predictions(
        cls,
        phases: LivePhase | Sequence[LivePhase],
        n_frames: int,
        *,
        frame: int | None = None,
        ax: AxesLike | None = None,
        azimuth: float = -60,
        **known: Any,
    ) -> Self:
        """Draw phases that are known already, such as ``live.history``.

        Parameters
        ----------
        phases : LivePhase, or list of LivePhase
            The phases of one performance or several.
        n_frames : int
            The length of the clock, ``live.n_frames_``.
        frame : int, default=None
            A frame of the longest performance; the others are drawn at the same time. By default
            the last.
        ax : Axes or array-like of Axes, default=None
            See `plot`.
        azimuth : float, default=-60
            The direction of the viewer of bodies in degrees, as in `SkeletonDisplay`.
        **known : dict
            Further parameters of the class.

        Returns
        -------
        PhaseDisplay
            The display, drawn.

        Raises
        ------
        ValueError
            If phases are of another class, or there is no such frame.
        """
        return cls(phases, n_frames, **known).plot(ax, frame=frame, azimuth=azimuth)

    def plot(
        self, ax: AxesLike | None = None, *, frame: int | None = None, azimuth: float = -60
    ) -> Self:
        """Draw the state at a frame.

        Parameters
        ----------
        ax : Axes or array-like of Axes, default=None
            One of a figure's subplots is divided into the panels; or one axes a panel. None
            makes a figure.
        frame : int, default=None
            A frame of the longest performance; the others are drawn at the same time. By default
            the last.
        azimuth : float, default=-60
            The direction of the viewer of bodies in degrees, as in `SkeletonDisplay`.

        Returns
        -------
        PhaseDisplay
            The display itself.
        """
        longest = max((p.times for p in self._performances), key=lambda times: times[-1])
        if frame is None:
            frame = len(longest) - 1
        frame = as_index(frame, len(longest), "frame")
        has_body = self._performances[0].body is not None
        # Two panels beside each other; an odd last one has the whole width.
        n_panels, count = has_body + 2 + len(self.features), len(self._performances)
        places = [divmod(i, 2) for i in range(n_panels)]
        if n_panels % 2:
            places[-1] = (n_panels // 2, slice(None))
        each = -(-n_panels // 2)
        cells = [(each * k + row, column) for k in range(count) for row, column in places]
        size, before = (WIDTH, count * each * _ROW + 0.3), getattr(self, "axes_", ())
        self.figure_, self.axes_ = panels(ax, cells, count * each, 2, size, before)
        end = max(self._action.end_of(p) for p in self._performances)
        by_row = np.array(self.axes_, dtype=object).reshape(count, -1)
        self.rows_ = [
            PerformanceRow(
                axes, p, self._action, self.skeleton, self.features, 1.02 * end or 1.0, azimuth
            )
            for axes, p in zip(by_row, self._performances, strict=True)
        ]
        for axes, name in zip(by_row, self.names, strict=True):
            axes[0].set_title(fill(name, _LINE_LENGTH), fontsize="medium", parse_math=False)
        for axis in by_row[:, has_body + 1 :].flat:
            axis.set_xlabel(TIME_LABELS[self.unit])
        self._show(longest[frame])
        # One legend for all curves.
        for axis in by_row[0, has_body + 1 : has_body + 3]:
            handles, labels = axis.get_legend_handles_labels()
            legend_above([axis], handles, labels, n_cols=2)
        return self

    def animate(
        self,
        ax: AxesLike | None = None,
        *,
        seconds: float = 5.0,
        fps: int = 15,
        azimuth: float = -60,
    ) -> Animation:
        """Animate the performances.

        Parameters
        ----------
        ax : Axes or array-like of Axes, default=None
            As for `plot`; by default the axes of the last plot.
        seconds : float, default=5.0
            The time until the longest performance ends.
        fps : int, default=15
            Pictures a second.
        azimuth : float, default=-60
            The direction of the viewer of bodies in degrees, as in `SkeletonDisplay`.

        Returns
        -------
        Animation
            A notebook plays it as the last value of a cell; ``to_jshtml()`` gives the HTML,
            ``save(path)`` a GIF or a video, for which Matplotlib draws the whole figure picture by
            picture.
        """
        longest = max(p.times[-1] for p in self._performances)
        view = {"seconds": seconds, "fps": fps, "azimuth": azimuth}
        return animate(self, lambda k, last: self._show(longest * k / last), ax, **view)

    def _show(self, time):
        """Move all rows to a time."""
        for row in self.rows_:
            row.show(time)


def _as_list_of_phases(phases):
    """A list of LivePhase of arrays (n_frames_i,); streams side by side are separated."""
    listed = [phases] if isinstance(phases, LivePhase) else phases
    if not isinstance(listed, list) or not all(isinstance(of, LivePhase) for of in listed):
        raise ValueError(
            "phases must be a LivePhase of arrays, such as live.history, or a list of them, such "
            f"as live.track(X) gives; got {phases!r:.80}."
        )
    if len(listed) == 1 and np.ndim(listed[0].phase) == 2:
        (many,) = listed
        streams = range(many.phase.shape[1])
        return [
            each_value(many, lambda values, n=n: None if values is None else values[:, n])
            for n in streams
        ]
    return listed


def _as_floats(values):
    return None if values is None else np.asarray(values, dtype=np.float64)


def _final_phases(live, X, n_frames):
    """The phases of the frames of one performance as they are known at its end."""
    (tau,) = live.synchronizer_.match(X).times
    clock = np.arange(live.n_frames_)
    # Where tau is constant, all phases in between are equally right.
    return np.interp(np.linspace(0, clock[-1], n_frames), tau + 1e-9 * clock, clock)


def _spread(live, training):
    """The standard deviation (P, n_features) of the training performances from their mean."""
    match = live.synchronizer_.match(training)
    warped = match.warp(Takes(live, training).arrays)
    return np.asarray(warped).reshape(len(warped), *live.mean_.shape).std(axis=0)


# -- what is drawn -----------------------------------------------------------------------


class LearntAction(NamedTuple):
    """The learnt action, and what it predicts of a running performance.

    Attributes
    ----------
    n_frames : int
        The length of the clock.
    cyclic : bool
        Whether it is a cycle.
    duration : float or None
        The mean duration in the unit of the times.
    mean, spread : ndarray (P, n_shown), or None
    body : ndarray (P, n_joints, n_dims), or None
        The mean body.
    """

    n_frames: int
    cyclic: bool = False
    duration: float | None = None
    mean: np.ndarray | None = None
    spread: np.ndarray | None = None
    body: np.ndarray | None = None

    def interpolate(self, phase, values):
        """Values at the frames of the clock, interpolated to phases."""
        clock = np.arange(self.n_frames)
        flat = values.reshape(self.n_frames, -1)
        found = np.stack([np.interp(phase, clock, column) for column in flat.T], axis=-1)
        return found.reshape(*np.shape(phase), *values.shape[1:])

    def phase_ahead(self, phase, rate):
        """The phase a tenth of the duration later at this rate; of a cycle maybe in the next."""
        last = self.n_frames - 1
        ahead = phase + _AHEAD * last * rate
        return ahead if self.cyclic else min(ahead, last)

    def times_left(self, found, times):
        """The time left at every frame, as `OnlineSynchronizer.time_left` estimates it."""
        if self.duration is None:
            return np.zeros(len(times))
        course, out = Course(self.n_frames, self.duration, self.cyclic), []
        cycles = np.zeros(len(times), dtype=np.intp) if found.cycle is None else found.cycle
        for now in zip(times, found.phase, cycles, strict=True):
            course.follow(*map(np.atleast_1d, now))
            out.append(course.time_left()[0])
        return np.array(out)

    def end_of(self, performance):
        """The latest time observed or predicted of a performance."""
        times = performance.times
        expected = times + np.where(performance.phase < self.n_frames - 1, performance.left, 0)
        return max(times[-1], expected.max())

    def predict(self, phase, now, left):
        """The times and the phases of the rest, (n_points,) each; empty at the end."""
        last = self.n_frames - 1
        if self.duration is None or phase >= last:
            return np.empty((2, 0))
        return now + np.linspace(0, left, _N_POINTS), np.linspace(phase, last, _N_POINTS)


class RunningPerformance(NamedTuple):
    """A performance with its phases.

    Attributes
    ----------
    phase, rate, confidence : ndarray, shape (n_frames,)
    lower, upper : ndarray (n_frames,), or None
        The bounds of the phases.
    cycle : ndarray of int, shape (n_frames,)
    times : ndarray, shape (n_frames,)
        The first time is 0.
    left : ndarray, shape (n_frames,)
        The time left.
    name : str
    seen : ndarray (n_frames, n_shown), or None
    afterwards : ndarray (n_frames,), or None
        The phases as they are known at the end.
    body : ndarray (n_frames, n_joints, n_dims), or None
    """

    phase: np.ndarray
    rate: np.ndarray
    confidence: np.ndarray
    lower: np.ndarray | None
    upper: np.ndarray | None
    cycle: np.ndarray
    times: np.ndarray
    left: np.ndarray
    name: str
    seen: np.ndarray | None = None
    afterwards: np.ndarray | None = None
    body: np.ndarray | None = None


class PerformanceRow:
    """The panels of one performance: a body if there is one, a dial, the phase, curves.

    Parameters
    ----------
    axes : list of Axes
    performance : RunningPerformance
    action : LearntAction
    skeleton : Skeleton or None
        The skeleton of the bodies.
    features : list of str
        The names of the curves.
    end : float
        The end of the time axis.
    azimuth : float
    """

    def __init__(self, axes, performance, action, skeleton, features, end, azimuth):
        self.axes, self._performance, self._action = list(axes), performance, action
        axes, self.body = list(axes), None
        if performance.body is not None:
            self.body = BodyPanel(axes.pop(0), performance, action, skeleton, azimuth)
        self.dial = PhaseDial(axes.pop(0))
        self._time_axes = axes
        self._draw_phase(axes[0], end)
        self.curves = [
            FeaturePanel(axis, performance, action, k, name, end)
            for k, (axis, name) in enumerate(zip(axes[1:], features, strict=True))
        ]

    def _draw_phase(self, axis, end):
        grey, blue, orange = (COLORS[k] for k in ("shadow", "performance", "mean"))
        self.confidence = _empty_area(axis, grey, 0.75, "confidence")
        self.afterwards = None
        performance, percent = self._performance, 100 / (self._action.n_frames - 1)
        label = _label("90 % band", performance.lower)
        self.interval = _empty_area(axis, blue, _INTERVAL_OPACITY, label)
        if performance.afterwards is not None:
            style = {"color": COLORS["pattern"], "linewidth": 0.9, "linestyle": "--"}
            ys = percent * performance.afterwards
            (self.afterwards,) = axis.plot(performance.times, ys, label="afterwards", **style)
        label = _label("predicted", self._action.duration)
        (self.rest,) = axis.plot([], [], color=orange, linestyle=":", label=label)
        self.phase = front_line(axis, [], [], color=blue, label="phase")
        axis.set_xlim(0, end)
        axis.set_ylim(0, 105)
        axis.set_ylabel("phase (%)")
        # Ticks need not be drawn again with the areas over them.
        axis.set_axisbelow(True)

    def show(self, time):
        """Move to a time."""
        p, action = self._performance, self._action
        now = max(np.searchsorted(p.times, time, side="right") - 1, 0)
        phase, rate, confidence = (x[now] for x in (p.phase, p.rate, p.confidence))
        last, past = action.n_frames - 1, slice(now + 1)
        ahead = action.phase_ahead(phase, rate)
        rest = action.predict(phase, p.times[now], p.left[now])
        number = p.cycle[now] if action.cyclic else None
        self.dial.show(phase / last, ahead / last, rate, confidence, number)
        # The line has a gap where a cycle begins.
        begins = 1 + np.flatnonzero(np.diff(p.cycle[past]))
        line = p.times[past], 100 / last * p.phase[past]
        self.phase.set_data(*(np.insert(values, begins, np.nan) for values in line))
        _fill_area(self.confidence, p.times[past], 0, 100 * p.confidence[past])
        if p.lower is not None:
            lower, upper = (100 / last * bound[past] for bound in (p.lower, p.upper))
            _fill_area(self.interval, p.times[past], lower, upper, begins)
        if action.cyclic and action.duration is not None:
            stop = p.times[now] + action.duration
            for axis in self._time_axes:
                axis.set_xlim(max(0, stop - _N_CYCLES * action.duration), stop)
        self.rest.set_data(rest[0], 100 / last * rest[1])
        if self.body is not None:
            self.body.show(now, ahead % last if action.cyclic else ahead)
        for curve in self.curves:
            curve.show(now, *rest)


class FeaturePanel:
    """A feature as it was observed, and its prediction."""

    def __init__(self, axis, performance, action, k, name, end):
        self._times, self._seen = performance.times, performance.seen[:, k]
        self._action, self._k = action, k
        blue, orange = COLORS["performance"], COLORS["mean"]
        self.band = _empty_area(axis, COLORS["envelope"], 0.35, _label("90 % band", action.spread))
        style = {"color": blue, "linewidth": 1, "linestyle": "--", "alpha": 0.6}
        (self.to_come,) = axis.plot(self._times, self._seen, label="what came", **style)
        style = {"color": orange, "linewidth": 2, "label": _label("predicted", action.mean)}
        (self.expected,) = axis.plot([], [], **style)
        self.seen = front_line(axis, [], [], color=blue, label="seen")
        (self.now,) = axis.plot([], [], "o", color=blue, markersize=5, zorder=5)
        values = [self._seen]
        if action.mean is not None:
            mean, half_width = action.mean[:, k], 0
            if action.spread is not None:
                half_width = _BAND * action.spread[:, k]
            values += [mean - half_width, mean + half_width]
        values = np.concatenate(values)
        values = values[np.isfinite(values)]
        low, high = (values.min(), values.max()) if len(values) else (0.0, 0.0)
        margin = 0.06 * (high - low) or 1.0
        axis.set_ylim(low - margin, high + margin)
        axis.set_xlim(0, end)
        axis.set_ylabel(fill(name, _LINE_LENGTH))

    def show(self, now, times, phases):
        """Move to a frame, with the times and the phases of the predicted rest."""
        past = slice(now + 1)
        self.seen.set_data(self._times[past], self._seen[past])
        self.now.set_data([self._times[now]], [self._seen[now]])
        mean, spread = (
            None if x is None else self._action.interpolate(phases, x[:, self._k])
            for x in (self._action.mean, self._action.spread)
        )
        if mean is not None:
            self.expected.set_data(times, mean)
        if spread is not None:
            _fill_area(self.band, times, mean - _BAND * spread, mean + _BAND * spread)


class BodyPanel:
    """The observed body, before the mean body at the phase ahead."""

    def __init__(self, axis, performance, action, skeleton, azimuth):
        self._action, self._bones = action, bones_by_side(skeleton)
        self._bodies, self._mean = (
            project(x, skeleton, azimuth) for x in (performance.body, action.body)
        )
        self.ahead = bone_lines(axis, COLORS["shadow"], 5, zorder=1)
        self.bones = {
            side: bone_lines(axis, COLORS[side], 2) for side in ("middle", "left", "right")
        }
        self.head, self._head = None, None
        if "head" in skeleton.landmarks:
            self._head = landmark_track(self._bodies, skeleton, "head")
            (self.head,) = axis.plot([], [], "o", color=COLORS["middle"], markersize=5)
        places = [x.reshape(-1, 2) for x in (self._bodies, self._mean)]
        stage(axis, "", *bounds(np.concatenate(places)))

    def show(self, now, ahead):
        """Move to a frame, and the mean body to a phase."""
        body, mean = self._bodies[now], self._action.interpolate(ahead, self._mean)
        bones = [bone for of_side in self._bones.values() for bone in of_side]
        self.ahead.set_segments([mean[list(bone)] for bone in bones])
        for side, lines in self.bones.items():
            lines.set_segments([body[list(bone)] for bone in self._bones[side]])
        if self.head is not None:
            self.head.set_data(self._head[[now]].T)


def _label(text, value):
    """A label in a legend; none for an unknown value."""
    return text if value is not None else "_nolegend_"


def _empty_area(axis, color, alpha, label):
    from matplotlib.collections import PolyCollection

    area = PolyCollection([], facecolor=color, alpha=alpha, linewidth=0, zorder=1, label=label)
    return axis.add_collection(area, autolim=False)


def _fill_area(area, xs, lower, upper, gaps=()):
    """Fill the area between two curves, but for gaps before these indices."""
    lower, upper = np.broadcast_to(lower, xs.shape), np.broadcast_to(upper, xs.shape)
    there, back = np.column_stack([xs, upper]), np.column_stack([xs, lower])
    pairs = zip(np.split(there, gaps), np.split(back, gaps), strict=True)
    area.set_verts([np.concatenate([a, b[::-1]]) for a, b in pairs if len(a)])
