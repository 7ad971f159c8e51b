"""Which frames of a recording the rows of a table are, and the frame rate that these rows have.

The ``attrs`` of a recording (``frame_rate``, ``times``, ``events``, ...) stay as they are when
pandas drops, thins out or reorders rows. The index goes with the rows: it tells which frames they
are.
"""

import math
import re
from numbers import Real

import numpy as np
import pandas as pd

from .resampling import is_even, rounded_rate, times_as_numbers

__all__ = ["CLOCK", "frame_rate_of_rows", "recorded_frames"]

# Key of ``attrs``: the time of frame 0 and the step to the next, where the index is a time.
CLOCK = "clock"
# Names of an index in seconds: "time", "t", "time_s", "time (s)", "seconds", ...
_SECONDS = re.compile(r"(time|t)?[\s_]*[(\[]?(s|secs?|seconds?)?[)\]]?", re.IGNORECASE)
# Seconds; longer steps of a time are of another unit.
_LONGEST_STEP = 1
# A share of a step by which rounding may move a time.
_ROUNDING = 0.4


def recorded_frames(df):
    """The frames of the recording that the rows of a table are.

    Parameters
    ----------
    df : DataFrame
        One performance. Frames are counted as in its ``attrs["events"]``: from 0, the first row
        of the table that ``attrs`` describe.

    Returns
    -------
    ndarray of int, shape (n_rows,), or None
        In the order of the rows. None if the index does not tell.
    """
    index, clock = _frame_level(df), df.attrs.get(CLOCK)
    if isinstance(index, pd.RangeIndex) and not _may_be_seconds(index):
        return index.to_numpy() if index.min() >= 0 or not len(index) else None
    if index.dtype.kind not in "iuf":
        return None
    values, slack = index.to_numpy(dtype=np.float64, na_value=np.nan), 0
    if not np.isfinite(values).all():
        return None
    if index.dtype.kind == "f" and isinstance(clock, (tuple, list)):
        values, slack = (values - clock[0]) / clock[1], _ROUNDING
    elif _may_be_seconds(index) and (index.dtype.kind == "f" or _smallest_step(values) > 1):
        # Whole seconds, or every tenth frame, or milliseconds.
        return None
    frames = np.round(values)
    if (np.abs(values - frames) > slack).any() or frames.min(initial=0) < 0:
        return None
    return frames.astype(np.int64)


def frame_rate_of_rows(x):
    """The frame rate that the rows of a table have now: 60 of every second one of 120.

    Parameters
    ----------
    x : DataFrame, or anything
        One performance.

    Returns
    -------
    float or None
        Frames a second, by ``attrs["frame_rate"]`` and which frames the rows are, or by an index
        in seconds: dates, durations, or numbers under such a name. None if it is not known or rows
        are not evenly spaced, and for all that is no DataFrame.
    """
    if not isinstance(x, pd.DataFrame):
        return None
    rate, frames = x.attrs.get("frame_rate"), recorded_frames(x)
    if frames is None or not _is_rate(rate):
        return _rate_of_seconds(_frame_level(x))
    steps = np.abs(np.diff(frames))
    if len(steps) and (steps[0] == 0 or (steps != steps[0]).any()):
        return None
    return float(rate / steps[0]) if len(steps) else float(rate)


def _frame_level(df):
    return df.index.get_level_values(-1)


def _is_rate(rate):
    return isinstance(rate, Real) and not isinstance(rate, bool) and 0 < rate < math.inf


def _may_be_seconds(index):
    return bool(index.name) and bool(_SECONDS.fullmatch(str(index.name).strip()))


def _smallest_step(values):
    return np.abs(np.diff(values)).min(initial=np.inf)


def _rate_of_seconds(index):
    """The frame rate of even times in seconds; None of all else."""
    if len(index) < 2 or not (index.dtype.kind in "mM" or _may_be_seconds(index)):
        return None
    if index.dtype.kind not in "mMfiu":
        return None
    seconds = times_as_numbers(index, "The index")
    if not np.isfinite(seconds).all():
        return None
    if seconds[-1] < seconds[0]:
        seconds = seconds[::-1]
    step = (seconds[-1] - seconds[0]) / (len(seconds) - 1)
    if not 0 < step < _LONGEST_STEP or not is_even(seconds):
        return None
    if index.dtype.kind in "fiu" and (seconds[0], seconds[-1]) == (0, 1):
        # Shares of a movement.
        return None
    return rounded_rate(1 / step)
