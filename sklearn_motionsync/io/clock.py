"""The clock of what comes with times of its own: even ones are a frame rate, others are told."""

import warnings

import numpy as np

# A share of a step by which even times may miss their places, beside what rounding does.
_JITTER = 0.1
# More than that is never taken for rounding: half a step is what one lost frame leaves.
_MOST = 0.45
# A step this much longer than it should be is a gap.
_GAP = 1.9
# No clock of a recording has steps below.
_LEAST = 1e-9
# Two frame rates that differ by less are the same.
_SAME = 0.01


def find_rate(times, decimals=17, stated=None):
    """Frames a second of the times, None where they do not tell, and whether they are even.

    Parameters
    ----------
    times : ndarray (n_frames,)
        Seconds, not decreasing.
    decimals : int
        How many of them were written.
    stated : float or None
        The frame rate that is written elsewhere. It decides where the times agree with it, as
        far as they can tell.
    """
    step = (times[-1] - times[0]) / max(len(times) - 1, 1)
    if len(times) < 2 or step < _LEAST:
        return stated, len(times) < 2 or stated is not None
    # Times have few digits: 0.033, 0.067, 0.1.
    rate = float(f"{1 / step:.6g}")
    rounding = 10.0**-decimals
    # Of a few frames the digits do not tell the rate that well.
    blur = rounding / (len(times) - 1)
    agree = stated is not None and abs(step - 1 / stated) < max(_SAME / stated, min(blur, step / 4))
    off = times - step * np.arange(len(times))
    even = np.ptp(off) / 2 <= min(_JITTER * step + rounding / 2, _MOST * step)
    if agree and (even or np.diff(times).max() < _GAP * max(step, rounding)):
        return stated, True
    return (rate, True) if even else (None, False)


def set_clock(name, motion, frame_rate):
    """Put the frame rate in the place of the times, or tell that there is none.

    `motion` holds ``times``, what its file says of its ``frame_rate``, and the ``decimals`` of
    its times. The times stay where they are uneven.
    """
    times, decimals = motion.pop("times"), motion.pop("decimals")
    stated = motion["frame_rate"]
    motion["first_time"] = float(times[0])
    rate, even = find_rate(times, decimals, stated)
    if not even:
        motion["times"] = times.tolist()
    motion["frame_rate"] = rate
    if frame_rate is not None:
        return
    if not even:
        tell_uneven(name, times, stacklevel=4)
    elif stated and rate != stated:
        warnings.warn(
            f"{name}: it says {stated:g} frames a second, but by its times there are {rate:g}, "
            "which are taken. If the times are wrong, give frame_rate=.",
            UserWarning,
            stacklevel=3,
        )


def tell_uneven(name, times, stacklevel, unit="s"):
    """Warn that frames are not evenly spaced, and say what to do."""
    steps = np.diff(times)
    warnings.warn(
        f"{name}: its times are uneven, in steps of {steps.min():.4g} to {steps.max():.4g} "
        f"{unit}, but frames count as evenly spaced. df.attrs['times'] holds them; "
        "to_sequences(df.assign(time=df.attrs['times']), time='time') makes them even. Where they "
        "are even in truth, give frame_rate=.",
        UserWarning,
        stacklevel=stacklevel,
    )
