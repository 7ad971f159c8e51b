"""The axis of time of a display: frames, per cent or seconds, of performances and of the clock."""

import numpy as np

from ..inputs.collections import as_collection
from ..inputs.resampling import as_frame_rates
from ..synchronizers.match import check_unit

__all__ = ["TimeAxis", "lengths_of"]

_OF_PERFORMANCES = {
    "frames": "frame of the performance",
    "percent": "% of the performance",
    "seconds": "time of the performance (s)",
}
_OF_CLOCK = {
    "frames": "frame of the pattern",
    "percent": "% of the pattern",
    "seconds": "time (s), of median duration",
}


class TimeAxis:
    """Where frames are on an axis of time.

    Parameters
    ----------
    unit : {"frames", "percent", "seconds"}
    n_frames : int
        Of the clock.
    lengths : sequence of int, default=None
        How many frames each performance has; None if they are not known, and then ``frame_rate``
        is that of the clock.
    frame_rate : float, or array-like of shape (n_sequences,), default=None
        Frames a second, for seconds only.

    Attributes
    ----------
    unit : str
    clock : ndarray, shape (P,)
        Where the frames of the clock are. In seconds it takes as long as the median performance.
    label, label_of_performances : str
    """

    def __init__(self, unit, n_frames, lengths=None, frame_rate=None):
        self.unit = check_unit(unit)
        self.label, self.label_of_performances = _OF_CLOCK[unit], _OF_PERFORMANCES[unit]
        self._lengths, self._rates = lengths, None
        clock = np.arange(n_frames)
        self.clock = clock
        if unit == "percent":
            self.clock = 100 * clock / (n_frames - 1)
        if unit == "seconds":
            self._rates = _rates(frame_rate, lengths)
            durations = (np.array(lengths or [n_frames]) - 1) / self._rates
            self.clock = np.median(durations) * clock / (n_frames - 1)

    def own(self):
        """Where the frames of each performance are: list of ndarray (n_frames_i,)."""
        frames = [np.arange(n) for n in self._lengths]
        if self.unit == "percent":
            return [100 * f / f[-1] for f in frames]
        if self.unit == "seconds":
            return [f / rate for f, rate in zip(frames, self._rates, strict=True)]
        return frames

    def of_clock(self, times):
        """Where times are that are in frames of the clock."""
        scale = self.clock[-1] / (len(self.clock) - 1)
        return times if self.unit == "frames" else times * scale


def lengths_of(X):
    """How many frames performances have, of any input that estimators take."""
    collection = as_collection(X)
    if collection is None:
        n_sequences, n_frames = np.shape(X)
        return [n_frames] * n_sequences
    return [len(x) for x in collection]


def _rates(frame_rate, lengths):
    """One frame rate a performance; of the clock alone if there are none."""
    count = 1 if lengths is None else len(lengths)
    if frame_rate is None:
        raise ValueError("unit='seconds' needs frame_rate, frames a second of the performances.")
    return np.broadcast_to(as_frame_rates(frame_rate, count), (count, 1))[:, 0]
