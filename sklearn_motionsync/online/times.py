"""Time stamps of frames, in frames of the training performances; and how much time is left."""

import numpy as np

from ..inputs.numbers import as_numbers

__all__ = ["as_stamps", "time_left"]


def as_stamps(times, n_frames, frame_rate=None, what="The frame", after=None):
    """When frames are seen, in frames of the training performances.

    Parameters
    ----------
    times : float, array-like of shape (n_frames,), or None
        In seconds if there is a frame rate, else in frames of the training performances. None: one
        frame of these follows another, the first at 0.
    n_frames : int
    frame_rate : float, default=None
        Frames a second of the training performances.
    what : str
        What to call the sequence in messages.
    after : float, default=None
        When the frame before these was seen, in frames of the training performances.

    Returns
    -------
    ndarray of float64, shape (n_frames,)
        Increasing.

    Raises
    ------
    ValueError
        If there is not one time a frame, or times are not finite, stand still or go back.
    """
    if times is None:
        return np.arange(n_frames) + (0.0 if after is None else after + 1)
    stamps = np.atleast_1d(as_numbers(times, f"{what}: times", dtype=np.float64))
    if stamps.shape != (n_frames,):
        raise ValueError(
            f"{what}: times must be one a frame, shape ({n_frames},), got {stamps.shape}."
        )
    scale = 1.0 if frame_rate is None else frame_rate
    given = stamps if after is None else np.concatenate([[after / scale], stamps])
    if not np.isfinite(given).all():
        i = int(np.argmin(np.isfinite(stamps)))
        raise ValueError(f"{what}: the time of frame {i} is {stamps[i]}; times must be finite.")
    still = np.diff(given) <= 0
    if still.any():
        i = int(still.argmax())
        raise ValueError(
            f"{what}: time stamps must increase, but {given[i + 1]:.10g} follows {given[i]:.10g}. "
            "Leave out a frame that comes twice or late; begin another performance with reset()."
        )
    return stamps * scale


def time_left(share, elapsed, duration):
    """How long a performance will go on: a guess.

    Of what is left of the mean duration, and of the phase at the mean pace, the second counts the
    more the farther the phase is.

    Parameters
    ----------
    share : ndarray
        The phase, from 0 to 1.
    elapsed : ndarray
        Since the beginning.
    duration : float
        Mean duration, in the same unit.
    """
    by_time = np.maximum(duration - elapsed, 0)
    return (1 - share) * by_time + share * duration * (1 - share)
