"""Sessions: what runs, since when, and what has been said of it."""

from collections import deque

import numpy as np

from .stream import LivePhase, Stream
from .times import time_left

__all__ = ["Session", "gathered"]

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
