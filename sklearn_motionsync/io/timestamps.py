"""Times of frames: even ones give a frame rate, uneven ones are kept and warned of."""

import math
import warnings
from numbers import Real

import numpy as np

from ..inputs.recorded import SAME_RATE

# A share of a step by which even times may miss their places, beside rounding.
_JITTER = 0.1
# A larger share is never explained by rounding: half a step is what one lost frame leaves.
_MAX_JITTER = 0.45
# A step this many times longer than it should be is a gap.
_GAP = 1.9
# Seconds; no recording has shorter steps.
_SHORTEST_STEP = 1e-9


def check_frame_rate(frame_rate):
    is_number = isinstance(frame_rate, Real) and not isinstance(frame_rate, bool)
    if frame_rate is not None and not (is_number and 0 < frame_rate < math.inf):
        raise ValueError(f"frame_rate must be frames a second, above 0, got {frame_rate!r}.")


def warn_of_other_rate(name, stated, rate):
    """Warn if the times of a recording contradict the frame rate that it states."""
    if stated and rate and rate != stated:
        warnings.warn(
            f"{name}: it says {stated:g} frames a second, but by its times there are {rate:g}, "
            "which is used. If the times are wrong, give frame_rate=.",
            UserWarning,
            stacklevel=3,
        )


def describe_times(name, times, *, stated=None, decimals=17, frame_rate=None, unit="s"):
    """The ``attrs`` of a recording that describe its times.

    Parameters
    ----------
    name : str
        Name of the recording, for the warning.
    times : ndarray (n_frames,)
        The times of the frames, not decreasing.
    stated : float or None
        The frame rate that the file states. It counts where the times agree with it, as far as
        their digits allow.
    decimals : int
        How many decimals the times were written with.
    frame_rate : float or None
        The frame rate that the caller of the reader gives. It replaces all others.
    unit : {"s", "frames"}
        Unit of the times. Those in frames give no frame rate.

    Returns
    -------
    dict
        ``frame_rate`` (None if it is not known), ``first_time`` where times are in seconds,
        ``times`` where they are uneven.

    Warns
    -----
    UserWarning
        In the caller's caller: if times are uneven and no `frame_rate` is given.
    """
    rate, even = _estimate_frame_rate(times, decimals, stated)
    facts = {"frame_rate": rate if unit == "s" else None}
    if unit == "s":
        facts["first_time"] = float(times[0])
    if not even:
        facts["times"] = times.tolist()
    if frame_rate is not None:
        facts["frame_rate"] = float(frame_rate)
    elif not even:
        steps = np.diff(times)
        warnings.warn(
            f"{name}: its times are uneven, in steps of {steps.min():.4g} to {steps.max():.4g} "
            f"{unit}, but frames count as evenly spaced. df.attrs['times'] holds them; "
            "to_sequences(df.assign(time=df.attrs['times']), time='time') makes them even. If they "
            "are even in truth, give frame_rate=.",
            UserWarning,
            stacklevel=3,
        )
    return facts


def _estimate_frame_rate(times, decimals, stated):
    """Frames a second of the times, None where it cannot be estimated, and whether they are even.

    The stated rate is returned where the times agree with it.
    """
    step = (times[-1] - times[0]) / max(len(times) - 1, 1)
    if len(times) < 2 or step < _SHORTEST_STEP:
        return stated, len(times) < 2 or stated is not None
    # Times have few digits: 0.033, 0.067, 0.1.
    rate = float(f"{1 / step:.6g}")
    rounding = 10.0**-decimals
    # With few frames the digits leave the rate uncertain.
    blur = rounding / (len(times) - 1)
    agree = stated is not None and abs(step - 1 / stated) < max(
        SAME_RATE / stated, min(blur, step / 4)
    )
    off = times - step * np.arange(len(times))
    even = np.ptp(off) / 2 <= min(_JITTER * step + rounding / 2, _MAX_JITTER * step)
    if agree and (even or np.diff(times).max() < _GAP * max(step, rounding)):
        return stated, True
    return (rate, True) if even else (None, False)
