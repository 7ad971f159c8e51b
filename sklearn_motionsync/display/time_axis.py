"""Time axes of performances and of the clock: frames, per cent or seconds."""

import numpy as np

from ..inputs.resampling import as_frame_rates
from ..synchronizers.match import UNITS, check_unit

__all__ = ["TimeAxis", "clock_rate", "offset_label"]

_PERFORMANCE_LABELS = {
    "frames": "frame of the trial",
    "percent": "% of the trial",
    "seconds": "time of the trial (s)",
}
_CLOCK_LABELS = {
    "frames": "frame of the template",
    "percent": "% of the template",
    "seconds": "time of the median trial (s)",
}


class TimeAxis:
    """The times of frames in a unit.

    Parameters
    ----------
    unit : {"frames", "percent", "seconds"}
    n_frames : int
        The length of the clock.
    lengths : sequence of int, default=None
        The number of frames of each performance. None if unknown; ``frame_rate`` is then that of
        the clock.
    frame_rate : float, or array-like of shape (n_sequences,), default=None
        Frames a second, for seconds only.

    Attributes
    ----------
    unit : str
    clock : ndarray, shape (P,)
        The times of the frames of the clock. In seconds the clock lasts as long as the median
        performance.
    label, performance_label : str
        Axis labels of the clock and of the performances.
    """

    def __init__(self, unit, n_frames, lengths=None, frame_rate=None):
        self.unit = check_unit(unit)
        self.label, self.performance_label = _CLOCK_LABELS[unit], _PERFORMANCE_LABELS[unit]
        self._lengths, self._rates = lengths, None
        clock = np.arange(n_frames)
        self.clock = clock
        if unit == "percent":
            self.clock = 100 * clock / (n_frames - 1)
        if unit == "seconds":
            self._rates = _frame_rates(frame_rate, lengths)
            durations = (np.array(lengths or [n_frames]) - 1) / self._rates
            self.clock = np.median(durations) * clock / (n_frames - 1)

    def performances(self):
        """The times of the frames of each performance: list of ndarray (n_frames_i,)."""
        return self.own([np.arange(n) for n in self._lengths])

    def own(self, frames):
        """Frames of each performance, whole or not, in the unit: list of ndarray."""
        if self.unit == "percent":
            return [100 * f / (n - 1) for f, n in zip(frames, self._lengths, strict=True)]
        if self.unit == "seconds":
            return [f / rate for f, rate in zip(frames, self._rates, strict=True)]
        return list(frames)

    def convert(self, frames):
        """Frames of the clock, whole or not, in the unit."""
        scale = self.clock[-1] / (len(self.clock) - 1)
        return frames if self.unit == "frames" else frames * scale


def clock_rate(clock):
    """Frames of the clock in a unit of time, such as a second."""
    return (len(clock) - 1) / clock[-1]


def offset_label(unit):
    """The label of an axis of offsets."""
    return f"offset ({UNITS[unit]}),\nlater is above"


def _frame_rates(frame_rate, lengths):
    """A frame rate for each performance; one for the clock without performances."""
    count = 1 if lengths is None else len(lengths)
    if frame_rate is None:
        raise ValueError("unit='seconds' needs frame_rate, frames a second of the performances.")
    return np.broadcast_to(as_frame_rates(frame_rate, count), (count, 1))[:, 0]
