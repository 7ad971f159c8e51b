"""Ticks: frames that come at any time, at the even times of a clock."""

import numpy as np

__all__ = ["Ticks"]

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
        self.since = 0.0

    def take(self, frame, stamp):
        """Yield the frames (n_streams, n_features) of all ticks until now.

        Parameters
        ----------
        frame : ndarray, shape (n_streams, n_features)
        stamp : float
        """
        if self._stamp is None:
            self._next, self._stamp, self._frame = stamp, stamp, frame
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
        self._stamp, self._frame = stamp, frame
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
