"""Running trials, frame by frame: streams matched by rows of the trellis (Eqs. 16 and 17)."""

import warnings
from typing import Any, NamedTuple

import numpy as np
import pandas as pd

from ..inputs.facts import TIMELESS
from ..inputs.numbers import LARGEST, SMALLEST, as_numbers, check_finite, check_names
from ..inputs.validation import check_input
from .causal import CausalDerivative

# Shares of the clock: the window of rate and cost, and how near a phase counts as right.
_WINDOW, _TOLERANCE = 0.1, 0.05
# Probabilities below the bounds of an interval; half of its least width, as a share of the clock.
_TAILS, _LEAST = np.array([[0.05], [0.95]], dtype=np.float32), 0.01
# Below this share of the mean square of speeds a stream stands still.
_STILL = 0.05
# Log-weights of phases are this at least.
_MIN_LOG_WEIGHT = -80.0
# Costs above so many times the typical one are those of other movements. Chosen on people of
# HDM05, so that intervals of other actions are wide, and those under noise are not: docs/design.md.
_UNUSUAL = 4
# Gaps longer than this share of the clock are not interpolated.
_LONGEST_GAP = 0.25
# Times that pass by more training frames a frame, or less than the inverse, are of another unit:
# seconds taken for frames do, at 25 frames a second and more. So many frames tell.
_OTHER_UNIT, _FEW = 24, 4
# A cycle may last so many mean durations.
_PERIODS = 1 / 3, 3
# After so many clocks without a frame a stream has forgotten what was before.
_FORGETTING = 3


class LivePhase(NamedTuple):
    """The phase of a running trial, its rate, and how sure it is.

    All values have the shape of the phase: numbers of a frame, arrays of several frames or trials.

    Parameters
    ----------
    phase : float, or ndarray
        Frame of the pattern, from 0 to P - 1.
    rate : float, or ndarray
        Pace in units of the mean pace of the training trials.
    confidence : float, or ndarray
        Probability, from 0 to 1, that the phase is right to a twentieth of the clock.
    lower, upper : float, or ndarray, default=None
        Frames of the pattern between which the phase lies with a probability of 90 %, from 0 to
        P - 1; the estimated phase is between them. None: unknown. Of cycles they may be below 0, in
        the cycle before, or above P - 1, in the next.
    cycle : int, or ndarray of int, default=None
        Number of the cycle, from 0, which is the one of the first frame. It rises when a cycle
        begins. Without ``cyclic=True`` it counts attempts: it rises when the movement begins anew.

    See Also
    --------
    OnlineSynchronizer : Estimates it.

    Examples
    --------
    >>> from sklearn_motionsync.live import LivePhase
    >>> now = LivePhase(phase=12.5, rate=1.0, confidence=0.9, lower=10.0, upper=16.0)
    >>> now.phase, now.upper - now.lower
    (12.5, 6.0)
    """

    phase: Any
    rate: Any
    confidence: Any
    lower: Any = None
    upper: Any = None
    cycle: Any = None


class Session:
    """Trials that run side by side, from their first frame on.

    The first frame, (n_features,) or (n_streams, n_features), is still to be taken by ``step``.
    ``time`` is its time, in frames of the training trials, and later that of the last frame.
    """

    def __init__(self, reference, frame, time):
        frames = np.atleast_2d(frame)
        self.time, self._shape = time, frame.shape
        self._streams = Streams(reference, *frames.shape)
        self._resampler = Resampler(reference.step, reference.n_frames, frames, time)
        self._course = Course(reference.n_frames, reference.duration, reference.cyclic, len(frames))

    def step(self, frame, time):
        """Take a frame, and estimate the phases: a `LivePhase` of numbers, or of arrays."""
        if self._shape != frame.shape:
            raise ValueError(
                f"The frames before had the shape {self._shape}, this one has {frame.shape}: give "
                "the same trials in each, NaN for what is not seen, or call reset()."
            )
        self.time = time
        for sample in self._resampler.add(np.atleast_2d(frame), time):
            self._streams.update(sample)
        phases = self._streams.estimate(self._resampler.elapsed)
        self._course.follow(time, phases.phase, phases.cycle)
        if frame.ndim == 1:
            return LivePhase(*(values[0].item() for values in phases))
        return phases

    def time_left(self):
        """Frames of the training trials until the end of each stream, or of its cycle."""
        left = self._course.time_left()
        return left if len(self._shape) == 2 else float(left[0])


class Course:
    """When streams began their cycles, or attempts, and when these will end.

    The clock has ``n_frames``, and a trial the mean ``duration``, in the unit of times.
    """

    def __init__(self, n_frames, duration, cyclic, n_streams=1):
        self._last, self._duration, self._cyclic = n_frames - 1, duration, cyclic
        # None: streams begin with the next frame. The first cycle may begin anywhere.
        self._begin, self._time, self._share = None, np.nan, np.zeros(n_streams)
        self._cycle = np.zeros(n_streams, dtype=np.intp)
        self._period = np.full(n_streams, float(duration))

    def follow(self, time, phase, cycle):
        """Take the phases and cycles (n_streams,) at a time."""
        self._time, self._share = time, phase / self._last
        rises = cycle > self._cycle
        if self._begin is None:
            self._begin = np.full(len(phase), time, dtype=np.float64)
        elif rises.any():
            # At the mean pace the phase was 0.
            begin = time - self._share * self._duration
            # The cycle before was whole if its beginning was seen, too.
            whole = rises & (self._cycle > 0) & (cycle - self._cycle == 1)
            period = np.clip(begin - self._begin, *np.multiply(_PERIODS, self._duration))
            self._period = np.where(whole, period, self._period)
            self._begin = np.where(rises, begin, self._begin)
        self._cycle = np.array(cycle)

    def time_left(self):
        """The time until each stream ends, or its cycle; (n_streams,).

        A mean of what is left of the mean duration, and of the phase at the mean pace, which has
        the share of the clock that has passed as its weight.
        """
        share, duration = self._share, self._duration
        if self._cyclic:
            return (1 - share) * self._period
        by_time = np.maximum(duration - (self._time - self._begin), 0)
        return (1 - share) * by_time + share * duration * (1 - share)


class Streams:
    """Trials that are matched to a reference at the same samples.

    ``mean_cost`` (n_streams,) is that of a sample, over the last tenth of the clock.
    """

    def __init__(self, reference, n_streams, n_features):
        self.reference = reference
        self.trellis = reference.begin(n_streams)
        self.mean_cost, self._cycles = np.zeros(n_streams), np.zeros(n_streams, dtype=np.intp)
        self._derivative = CausalDerivative(
            reference.width, (n_streams, n_features), from_rest=not reference.cyclic
        )
        self._window = window_length(reference.n_frames)
        self._last, table = reference.n_frames - 1, reference.trellis.table
        self._tolerance = max(1.0, _TOLERANCE * self._last)
        # Positions of whole frames.
        self._whole = slice(None, None, table.subframes)
        self._max_rate = table.steps.max() / table.subframes
        # Positions after the end of the movement have its last phase.
        positions = np.arange(len(reference.moving) - reference.cyclic) / table.subframes
        self._phase_of_position = np.minimum(positions, self._last)
        # The phases of the last samples, the last one last.
        self._phases, self._n_samples = np.zeros((self._window + 1, n_streams)), 0
        self._path_cost, self._fully_observed = np.zeros(n_streams), np.ones(n_streams)
        # The share of the last samples in which anything was observed.
        self._observed_share = np.ones(n_streams)
        # Of the features, the share that was observed in those samples.
        self._feature_share = np.ones(n_streams)

    def update(self, sample):
        """Take a sample (n_streams, n_features), one frame of the clock after the one before."""
        reference = self.reference
        poses = reference.unit(sample)
        velocity = self._derivative.step(poses)
        # The unit makes constant features 0, observed or not.
        hidden = np.isnan(velocity) | np.isnan(sample)
        compared, parts = reference.features.compare(velocity, poses), {}
        observed = self._fully_observed
        if hidden.any():
            observed = 1 - hidden.mean(axis=1)
            compared[observed < 1] = 0
            by_columns = {}
            for n in np.flatnonzero(observed < 1):
                columns = tuple(np.flatnonzero(~hidden[n]).tolist())
                by_columns.setdefault(columns, []).append(int(n))
            for columns, rows in by_columns.items():
                part = reference.subset(columns)
                if part is None:
                    observed[rows] = 0
                else:
                    part = part.compare(velocity[rows], poses[rows]), part.moving
                parts[tuple(rows)] = part
        self.trellis.advance(compared, parts, self._moves(velocity))
        self._update_window(observed)

    def estimate(self, elapsed):
        """Phases with bounds, rates and confidences, so many samples after the last one."""
        gains, rate = gains_of(self.trellis.costs), self._rates()
        excess = np.maximum(self.mean_cost / self.reference.typical_cost, 1)
        phases = np.concatenate([self._phases[-1:], self._bounds(gains, excess)]) + rate * elapsed
        phase, lower, upper = phases if self.reference.cyclic else np.minimum(phases, self._last)
        confidence, cycle = self._confidences(gains, excess), self._cycles + self.trellis.attempts
        return LivePhase(np.minimum(phase, self._last), rate, confidence, lower, upper, cycle)

    def _moves(self, velocity):
        """Whether streams move, by their velocities (n_streams, n_features), NaN where hidden."""
        usual, hidden = self.reference.speed, np.isnan(velocity)
        if hidden.any():
            velocity, usual = np.where(hidden, 0, velocity), np.where(hidden, 0, usual)
        return np.vecdot(velocity, velocity) > _STILL * usual.sum(axis=-1)

    def _update_window(self, observed):
        """Phases, costs and observed shares of the window, with a sample of this observed share."""
        ends, costs = self.trellis.best()
        now = self._phase_of_position[ends]
        if self.reference.cyclic:
            before = self._phases[-1] if self._n_samples else now
            now, turns = go_round(before, now, self._cycles, self._last, self._tolerance)
            self._cycles = np.maximum(self._cycles + turns, 0)
            # Phases of the window are those of this cycle, below 0 in the cycles before.
            self._phases -= self._last * turns
        self._phases = np.concatenate([self._phases[1:], now[np.newaxis]])
        self._n_samples += 1
        weight, seen = 1 / min(self._n_samples, self._window), observed > 0
        self._observed_share += weight * (seen - self._observed_share)
        # Per observed feature, so that hidden features make a stream neither like nor unlike.
        cost = (costs - self._path_cost) / np.where(seen, observed, 1)
        self.mean_cost += weight * seen * (cost - self.mean_cost)
        self._feature_share += weight * seen * (observed - self._feature_share)
        self._path_cost = costs

    def _rates(self):
        """Slopes of the phases over the window; before the first sample the rate is 1."""
        length = min(self._n_samples - 1, self._window)
        moved = self._phases[-1] - self._phases[-1 - length]
        rate = (moved + self._window - length) / self._window
        return np.minimum(np.maximum(rate, 0), self._max_rate)

    def _confidences(self, gains, excess):
        probabilities = phase_probabilities(gains, self.reference.temperature)
        distances = np.abs(self._phase_of_position - self._phases[-1][:, np.newaxis])
        if self.reference.cyclic:
            distances = np.minimum(distances, self._last - distances)
        mass = np.vecdot(probabilities, distances <= self._tolerance)
        return self._observed_share * mass / excess**2

    def _bounds(self, gains, excess):
        """Bounds of the phases of the last sample: (2, n_streams)."""
        # Noise raises all costs, and the differences between phases with them.
        temperature = self.reference.interval_temperature * excess
        temperature *= (np.maximum(excess / _UNUSUAL, 1) / self._feature_share) ** 2
        cyclic, phase = self.reference.cyclic, self._phases[-1]
        return phase_bounds(gains[:, self._whole], temperature, phase, self._last, cyclic)


class Resampler:
    """Interpolates the frames of streams at even times, from the first frame on.

    Two samples are a ``step`` apart, in frames of the training trials, and a trial of mean duration
    has ``n_frames`` samples. ``frame`` (n_streams, n_features) is the first one, and ``time`` its
    time. ``elapsed`` is the time from the last sample to the last frame, in steps, below 1.
    """

    def __init__(self, step, n_frames, frame, time):
        self._step, self._n_frames = step, n_frames
        # Since the origin, so that times of any magnitude are told apart.
        self._origin, self._next, self._time = time, 0.0, 0.0
        # The last values that were seen, and their times.
        self._seen, self._seen_at = np.full(frame.shape, np.nan), np.zeros(frame.shape)
        self.elapsed = 0.0

    def add(self, frame, time):
        """Yield the samples (n_streams, n_features) up to a new frame of that shape."""
        time -= self._origin
        gap = (time - self._time) / self._step
        if gap > _FORGETTING * self._n_frames:
            # The samples go on at this frame.
            yield from [np.full_like(frame, np.nan)] * (_FORGETTING * self._n_frames)
            self._seen_at -= time
            self._origin, self._next, time = self._origin + time, 0.0, 0.0
        # Rounding of the times loses no sample.
        while self._next <= time + 1e-9 * self._step:
            yield self._interpolate(self._next, frame, time)
            self._next += self._step
        seen = ~np.isnan(frame)
        self._seen, self._seen_at = (
            np.where(seen, frame, self._seen),
            np.where(seen, time, self._seen_at),
        )
        self._time = time
        self.elapsed = max(0.0, 1 - (self._next - time) / self._step)

    def _interpolate(self, at, frame, time):
        """Linear interpolation from the last seen values to a frame; NaN where it or a gap is."""
        if at >= time - 1e-9 * self._step:
            return frame
        gap = time - self._seen_at
        share = (at - self._seen_at) / gap
        bridged = gap <= max(1, _LONGEST_GAP * self._n_frames) * self._step
        return np.where(bridged, (1 - share) * self._seen + share * frame, np.nan)


def window_length(n_frames):
    """Samples of the window of rate and cost, of a clock of so many frames."""
    return max(2, round(_WINDOW * n_frames))


def go_round(before, now, cycles, last, tolerance):
    """Go on from phases to the next ones by the shorter way round the cycle.

    Phases (n_streams,) are from 0 to ``last``, P - 1. The results are the next ones and the turns:
    1 where a cycle begins, -1 where one is taken back. A phase that goes back over the beginning of
    a cycle by the tolerance at most stays there, so that no cycle begins twice.
    """
    turns = np.round((before - now) / last).astype(np.intp)
    stays = (turns < 0) & (now >= last - tolerance) & (cycles > 0)
    return np.where(stays, 0, now), np.where(stays, 0, turns)


def stack_phases(phases):
    """The `LivePhase` of each frame as one of arrays."""
    return LivePhase(*map(np.array, zip(*phases, strict=True)))


def gains_of(costs):
    """The least path costs (..., Q) less the others: log-probabilities, but for their scale."""
    return costs.min(axis=-1, keepdims=True) - costs


def phase_probabilities(gains, temperature):
    """Probabilities of phases with these `gains_of` costs (..., Q): ``exp(gain / temperature)``."""
    weights = np.exp(gains / temperature)
    return weights / weights.sum(axis=-1, keepdims=True)


def phase_bounds(gains, temperature, phase, last, cyclic=False):
    """Bounds (2, n) between which phases lie with a probability of 90 %.

    The `gains_of` costs (n, n_frames) are those at whole frames up to ``last``, P - 1, and after
    the end of the movement, or of a cycle those at its frames but the last one; over the
    temperature (n,) they are log-probabilities. The estimated phases (n,) are between the bounds.

    Those of a cycle are half a cycle from the phase at most: below 0 in the cycle before, above
    P - 1 in the next.
    """
    # Half the digits are enough, and nothing overflows.
    logs = np.maximum(gains / temperature[:, np.newaxis], _MIN_LOG_WEIGHT)
    weights, first = np.exp(logs.astype(np.float32)), 0
    if cyclic:
        first = np.round(phase).astype(np.intp) - last // 2
        frames = (first[:, np.newaxis] + np.arange(last)) % last
        weights = np.take_along_axis(weights, frames, axis=1)
    mass = weights.cumsum(axis=1)
    lower, upper = first + (mass >= (mass[:, -1] * _TAILS)[..., np.newaxis]).argmax(axis=-1)
    # Not too near to the phase.
    least = max(1.0, _LEAST * last)
    bounds = np.array([np.minimum(lower, phase - least), np.maximum(upper, phase + least)])
    return bounds if cyclic else np.clip(bounds, 0, last)


def check_observations(x, what, names, width, ndims=(1,)) -> np.ndarray:
    """The numbers of a frame or of a take, checked; NaN is not seen.

    ``names`` are those that a table must have, and ``width`` is the number of features. Of the
    accepted numbers of dimensions 1 is a frame, and 2 are several frames. A ValueError, about
    ``what``, refuses another shape, other names, and what is empty or infinite.
    """
    # A row of a table has the names of its columns.
    check_names(x.to_frame().T if isinstance(x, pd.Series) else x, names, what)
    values = np.atleast_1d(as_numbers(x, what, dtype=np.float64))
    if values.ndim not in ndims or values.shape[-1] != width or not values.size:
        shapes = {1: f"({width},)", 2: f"(n, {width}) with n at least 1"}
        raise ValueError(
            f"{what} has shape {values.shape}, expected {' or '.join(shapes[n] for n in ndims)}. "
            "Features that are not seen are NaN. A single feature is a column: reshape your data, "
            "x[:, np.newaxis]."
        )
    frames = x.index if isinstance(x, pd.DataFrame) else None
    check_finite(np.atleast_2d(values), f"{what}, frame", names, frames, allow_nan=True)
    return values


def check_times(times, n_frames, frame_rate=None, what="The frame", after=None):
    """The times of frames, checked, in frames of the training trials.

    They are given in seconds if there is a frame rate, else in frames of the training trials; None
    is one frame of these after another, the first at 0, or behind the time ``after`` of the frame
    before.

    A ValueError, about ``what``, refuses times that are not one a frame, not finite, or do not
    increase by 1e-9 to 1e9 frames. A UserWarning tells of frames that are more than 24 frames of
    the training trials apart, or less than 1/24, in the median: times in milliseconds where seconds
    are meant.
    """
    if times is None:
        return np.arange(n_frames) + (0.0 if after is None else after + 1)
    stamps = np.atleast_1d(as_numbers(times, f"{what}: times", dtype=np.float64))
    if stamps.shape != (n_frames,):
        raise ValueError(
            f"{what}: times must be one a frame, shape ({n_frames},), got {stamps.shape}."
        )
    scale = 1.0 if frame_rate is None else frame_rate
    with np.errstate(over="ignore"):
        frames = stamps * scale
        all_frames = frames if after is None else np.concatenate([[after], frames])
        steps = np.diff(all_frames)
    finite = np.isfinite(frames)
    if not finite.all():
        i = int(finite.argmin())
        raise ValueError(f"{what}: the time of frame {i} is {stamps[i]}; times must be finite.")
    wrong = (steps < SMALLEST) | (steps > LARGEST)
    if wrong.any():
        i = int(wrong.argmax())
        before, now = all_frames[i : i + 2] / scale
        by = f", by {SMALLEST:g} to {LARGEST:g} frames" if steps[i] > 0 else ""
        raise ValueError(
            f"{what}: time stamps must increase{by}, but {now:.10g} follows {before:.10g}. Leave "
            "out a frame that comes twice or late; begin another trial with reset()."
        )
    step = 1.0 if n_frames < _FEW else float(np.median(np.diff(frames)))
    if not 1 / _OTHER_UNIT < step < _OTHER_UNIT:
        unit = "frames of the training trials" if frame_rate is None else "seconds"
        warnings.warn(
            f"{what}: times are in {unit}, and {step / scale:.4g} of them from one frame to the "
            f"next are {step:.4g} frames of the training trials. Give them in this unit, and "
            "the frame_rate of the training trials.",
            UserWarning,
            stacklevel=4,
        )
    return frames


def check_recordings(estimator, X, times, on_rows):
    """Whole takes in double precision, in which NaN is not seen, and their times, both checked.

    The times, of each take, are as for `check_times`, with the frame rate of the estimator; it was
    fitted ``on_rows``, or not.
    """
    takes = check_input(
        estimator,
        X,
        reset=False,
        level="sequence",
        on_rows=on_rows,
        finite="allow-nan",
        facts=None if times is None else TIMELESS,
        timed=times is not None,
    )
    n = len(takes)
    times = [None] * n if times is None else times
    count = len(times) if np.iterable(times) else "none"
    if count != n:
        raise ValueError(
            f"There must be one sequence of times for each trial, got {count} for {n}."
        )
    checked_times = [
        check_times(t, len(x), estimator.frame_rate, takes.called(i))
        for i, (x, t) in enumerate(zip(takes, times, strict=True))
    ]
    return [x.astype(np.float64) for x in takes], checked_times
