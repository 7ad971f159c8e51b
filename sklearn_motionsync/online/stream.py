"""Streams: where running performances are, by the rows of the trellis (Eqs. 16 and 17)."""

from collections import deque
from typing import NamedTuple

import numpy as np

from ..matching.causal import CausalDerivative, CausalTrellis
from ..matching.trellis import Trellis
from .features import LiveFeatures
from .times import time_left

__all__ = ["UNKNOWN", "Calibration", "Course", "LivePhase", "Session", "Stream", "gathered"]

# Shares of the clock: over which rate and likeness are told, and how near a phase counts as right.
_RECENT, _NEAR = 0.1, 0.05


class LivePhase(NamedTuple):
    """Where a performance is.

    Attributes
    ----------
    phase : float, or ndarray
        Frame of the pattern, from 0 to P - 1.
    rate : float, or ndarray
        Frames of the pattern in the time of one at the mean pace of the training set.
    confidence : float, or ndarray
        From 0 to 1: how probable it is that the phase is right to a twentieth of the clock.
    """

    phase: float | np.ndarray
    rate: float | np.ndarray
    confidence: float | np.ndarray


class Calibration(NamedTuple):
    """What the costs of paths say of performances of the action.

    Attributes
    ----------
    temperature : float
        Costs over it are log-probabilities of phases.
    usual : float
        Recent cost of a sample that half of the action never exceed.
    """

    temperature: float
    usual: float


UNKNOWN = Calibration(1.0, np.inf)


class Course(NamedTuple):
    """What running performances follow.

    Attributes
    ----------
    n_frames : int
        ``P``.
    trellis : Trellis
        It goes on after the end, where the performer rests.
    features : LiveFeatures
    width : float
        Time constant of the filters, in frames of the clock.
    step : float
        From one frame of the clock to the next, in frames of the training performances.
    calibration : Calibration
    """

    n_frames: int
    trellis: Trellis
    features: LiveFeatures
    width: float
    step: float
    calibration: Calibration

    @property
    def duration(self):
        """Of a performance at the mean pace, in frames of the training performances."""
        return self.step * (self.n_frames - 1)


class Stream:
    """Performances that run, all seen at the same times.

    Parameters
    ----------
    course : Course
    n_streams : int
    n_features : int
    """

    def __init__(self, course, n_streams, n_features):
        self.course = course
        self.running = CausalTrellis(course.trellis, course.features.moving, n_streams)
        self.recent = np.zeros(n_streams)
        self._ticks = Ticks(course.step, course.n_frames)
        self._derivative = CausalDerivative(course.width, (n_streams, n_features))
        # The phases of the last ticks, in a ring; and how many ticks streams have run.
        self._lag = max(2, round(_RECENT * course.n_frames))
        self._near = max(1.0, _NEAR * (course.n_frames - 1))
        table = course.trellis.table
        self._fastest = table.steps.max() / table.subframes
        # Phases of positions: who rests is at the end.
        places = np.arange(len(course.features.moving)) / table.subframes
        self._clock = np.minimum(places, course.n_frames - 1)
        self._phases = np.zeros((self._lag + 1, n_streams))
        self._age = np.zeros(n_streams, dtype=np.intp)
        self._floor, self._all_seen = np.zeros(n_streams), np.ones(n_streams)
        # The share of the last ticks that showed anything.
        self._awake = np.ones(n_streams)
        # Phases, rates and confidences of the last tick, when somebody has asked.
        self._told = None

    def restart(self, stream):
        """Let one of them begin anew with its next tick."""
        self.running.restart(stream)
        self._ticks.restart(stream)
        self._derivative.restart(stream)
        self._age[stream] = self._floor[stream] = self.recent[stream] = 0
        self._phases[:, stream] = 0
        self._told = None

    def take(self, frames, stamp):
        """Take the frames (n_streams, n_features) of a moment, and say where all of them are."""
        for sample in self._ticks.take(frames, stamp):
            self.tick(sample)
        if self._told is None:
            self._told = self._now(), self._rates(), self._confidence()
        phase, rate, confidence = self._told
        phase = np.minimum(phase + rate * self._ticks.since, self.course.n_frames - 1)
        return LivePhase(phase, rate, confidence)

    def tick(self, sample):
        """Take the sample of a tick, in the unit of the data."""
        features = self.course.features
        postures = features.unit(sample)
        velocity = self._derivative.step(postures)
        # What does not move is 0 in the unit, seen or not.
        hidden = np.isnan(velocity) | np.isnan(sample)
        self._told = None
        compared, parts, share = features(velocity, postures), None, self._all_seen
        if hidden.any():
            share = 1 - hidden.mean(axis=1)
            compared[share < 1] = 0
            parts = self._parts(~hidden, share == 1, velocity, postures)
        self.running.advance(compared, parts)
        self._note(share)

    def _parts(self, seen, whole, velocity, postures):
        groups = {}
        for n in np.flatnonzero(~whole):
            groups.setdefault(tuple(np.flatnonzero(seen[n]).tolist()), []).append(int(n))
        return {
            tuple(rows): self.course.features.part(columns, velocity[rows], postures[rows])
            for columns, rows in groups.items()
        }

    def _note(self, share):
        """Keep what rate and confidence are told from, of a tick that shows a share of features."""
        ends, least = self.running.best()
        self._phases[(self.running.n_samples - 1) % len(self._phases)] = self._clock[ends]
        # Of what is seen: a hidden body is neither like nor unlike.
        self._age += 1
        weight, shows = 1 / np.minimum(self._age, self._lag), share > 0
        self._awake += weight * (shows - self._awake)
        risen = (least - self._floor) / np.where(shows, share, 1)
        self.recent += weight * shows * (risen - self.recent)
        self._floor = least

    def _now(self):
        return self._phases[(self.running.n_samples - 1) % len(self._phases)]

    def _rates(self):
        """Slope of the last phases; at first it is taken to be about 1."""
        back = np.minimum(np.maximum(self._age - 1, 0), self._lag)
        then = (self.running.n_samples - 1 - back) % len(self._phases)
        moved = self._now() - self._phases[then, np.arange(len(back))]
        rate = (moved + self._lag - back) / self._lag
        return np.minimum(np.maximum(rate, 0), self._fastest)

    def _confidence(self):
        chances = self.chances(self.running.costs, self.course.calibration.temperature)
        near = np.abs(self._clock - self._now()[:, np.newaxis]) <= self._near
        mass = np.vecdot(chances, near)
        unlike = np.maximum(self.recent / self.course.calibration.usual, 1)
        # Who has not begun is at the beginning.
        return np.where(self._age > 0, self._awake * mass / unlike**2, 1.0)

    @staticmethod
    def chances(costs, temperature):
        """Probabilities of phases of which these are the costs: (..., Q)."""
        weights = np.exp((costs.min(axis=-1, keepdims=True) - costs) / temperature)
        return weights / weights.sum(axis=-1, keepdims=True)


# -- sessions: what runs, since when, and what has been said of it -----------------------

# Answers that are kept; a stream may go on for days.
_KEPT = 100_000


class Session:
    """Performances that run side by side, from their first frame on.

    Attributes
    ----------
    stamp : float or None
        When the last frame was seen, in frames of the training performances; None before the first.
    """

    def __init__(self):
        self._stream = self._shape = self.stamp = None
        self._said, self._began = deque(maxlen=_KEPT), None

    @property
    def history(self):
        """What was said, frame by frame: `LivePhase` of arrays."""
        return gathered(self._said) if self._said else LivePhase(*np.empty((3, 0)))

    def reset(self, stream=None):
        """Begin anew: all, or some streams."""
        if stream is None:
            self.__init__()
            return
        count = 0 if self._shape is None else [1, *self._shape][-2]
        streams = np.atleast_1d(stream)
        runs = streams.dtype.kind in "iu" and ((-count <= streams) & (streams < count)).all()
        if not runs and len(streams):
            raise ValueError(
                f"stream={stream!r}, but {count} performances run: give an index of these or "
                "several, or None for all."
            )
        for n in streams:
            self._stream.restart(int(n))
            # It begins with the next frame.
            self._began[n] = np.nan

    def step(self, course, frame, stamp):
        """Take a frame (n_features,) or (n_streams, n_features), and say where they are."""
        if self._shape not in (None, frame.shape):
            raise ValueError(
                f"The frames before had the shape {self._shape}, this one has {frame.shape}: give "
                "the same performances in each, NaN for what is not seen, or call reset()."
            )
        frames = np.atleast_2d(frame)
        if self._stream is None:
            self._stream = Stream(course, *frames.shape)
            self._began = np.full(len(frames), np.nan)
        self._began = np.where(np.isnan(self._began), stamp, self._began)
        self._shape, self.stamp = frame.shape, stamp
        found = self._stream.take(frames, stamp)
        if frame.ndim == 1:
            found = LivePhase(*(float(values[0]) for values in found))
            self._said.append(found)
            return found
        self._said.append(found)
        # Who writes to the arrays does not write to what is kept.
        return LivePhase(*map(np.copy, found))

    def time_left(self, course):
        """Frames of the training performances until the end, of every performance that runs."""
        if not self._said:
            return course.duration
        # Who begins anew with the next frame has not begun.
        begun = ~np.isnan(self._began)
        elapsed = np.where(begun, self.stamp - self._began, 0)
        share = np.where(begun, self._said[-1].phase, 0) / (course.n_frames - 1)
        left = time_left(share, elapsed, course.duration)
        return left if len(self._shape) == 2 else float(left[0])


def gathered(said):
    """Answers one after the other as one, of arrays."""
    return LivePhase(*(np.array(values) for values in zip(*said, strict=True)))


# -- ticks: frames that come at any time, at the even times of a clock -------------------

# Shares of the clock: longer gaps between frames are not bridged, and after so many clocks without
# a frame nothing more is to be forgotten.
_BRIDGED, _FORGOTTEN = 0.25, 3


class Ticks:
    """The frames of streams at even times, the first of which is that of the first frame.

    Parameters
    ----------
    step : float
        From one tick to the next, in frames of the training performances.
    n_frames : int
        Ticks of a performance of usual duration.

    Attributes
    ----------
    since : float
        Ticks from the last one until the last frame, less than 1.
    """

    def __init__(self, step, n_frames):
        self._step, self._n_frames = step, n_frames
        self._next = self._stamp = self._frame = None
        self._begun = []
        self.since = 0.0

    def restart(self, stream):
        """Let one stream begin anew: there is no line to its next frame from the one before."""
        self._begun.append(stream)

    def take(self, frame, stamp):
        """Yield the frames (n_streams, n_features) of all ticks until now.

        Parameters
        ----------
        frame : ndarray, shape (n_streams, n_features)
        stamp : float
        """
        if self._stamp is None:
            self._next, self._stamp, self._frame = stamp, stamp, frame.copy()
        self._frame[self._begun] = frame[self._begun]
        self._begun = []
        gap = (stamp - self._stamp) / self._step
        if gap > _FORGOTTEN * self._n_frames:
            # The clock goes on at this frame.
            yield from [np.full_like(frame, np.nan)] * (_FORGOTTEN * self._n_frames)
            self._next = stamp
        bridged = gap <= max(1, _BRIDGED * self._n_frames)
        # Rounding of the times must not lose a tick.
        while self._next <= stamp + 1e-9 * self._step:
            yield self._at(self._next, frame, stamp, bridged)
            self._next += self._step
        # Cameras write all their frames to the same place.
        self._stamp, self._frame = stamp, frame.copy()
        self.since = max(0.0, 1 - (self._next - stamp) / self._step)

    def _at(self, time, frame, stamp, bridged):
        """Between two frames on straight lines; nothing is known where one does not see."""
        if time >= stamp - 1e-9 * self._step:
            return frame
        if time <= self._stamp + 1e-9 * self._step:
            return self._frame
        if not bridged:
            return np.full_like(frame, np.nan)
        share = (time - self._stamp) / (stamp - self._stamp)
        return (1 - share) * self._frame + share * frame
