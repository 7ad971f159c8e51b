"""The times of frames: as numbers, in order, without gaps, and evenly spaced or made so."""

import reprlib
from numbers import Real

import numpy as np
import pandas as pd

from ..matching.counting import whole
from ..matching.sizes import RATES
from .numbers import as_numbers
from .wording import counted

# Steps of time longer than so many median steps are gaps.
_GAP = 1.9
# Times this share of a step from even ones are even.
_EVEN = 1e-6
# Rounding to digits of which a step has fewer than so many is no gap only where the longer steps
# that it makes come often: so many, and this share of all.
_DIGITS_IN_STEP, _OFTEN, _OFTEN_SHARE = 3, 3, 0.08
# The straight line by least squares misses rounded times by so much more than the nearest one.
_LEAST_SQUARES = 1.1
# More than so many times the recorded frames come from a mistake in the unit.
_MOST = 100


def times_as_numbers(values, what):
    """Times, called ``what`` in messages, as numbers (n_frames,).

    Dates are seconds from the first of them, and durations are seconds.
    """
    series = pd.Series(values).infer_objects()
    if isinstance(series.dtype, pd.PeriodDtype):
        series = series.dt.to_timestamp()
    if series.dtype.kind == "M":
        series = series - series.min()
    if series.dtype.kind == "m":
        return series.dt.total_seconds().to_numpy(dtype=np.float64)
    texts = [v for v in series if isinstance(v, str)] if series.dtype.kind in "OSUT" else []
    if texts:
        raise ValueError(
            f"{what} is text, such as {texts[0][:40]!r}. Convert it by pd.to_datetime, "
            "pd.to_timedelta or pd.to_numeric."
        )
    return as_numbers(series, what, dtype=np.float64)


def find_time_gaps(times, max_gap_time=None):
    """Gaps in times that increase: triples of start, end, and the median step."""
    steps = np.diff(times)
    if len(steps) < 2:
        return []
    step = float(np.median(steps))
    longest = max(_GAP * step, (max_gap_time or 0) * (1 + _EVEN))
    if steps.max() <= longest or is_even(times):
        return []
    return [(times[i], times[i + 1], step) for i in np.flatnonzero(steps > longest)]


def even_grid(times, frame_rate, what):
    """The even times that replace those of a trial, which increase; None if they are even.

    Without a ``frame_rate``, in a unit of time, their step is as near to the median step as it
    takes to keep the first and the last frame. ``what`` is the name of the trial in messages.
    """
    if len(times) < 2:
        return None
    duration, n_steps = times[-1] - times[0], len(times) - 1
    slack = _slack(times)
    keeps_rate = frame_rate is None or abs(duration - n_steps / frame_rate) <= slack
    if keeps_rate and is_even(times):
        return None
    if frame_rate is None:
        n_steps = whole(duration / np.median(np.diff(times)))
    else:
        # Rounding of the times is no reason to lose the last frame.
        n_steps = whole((duration + slack) * frame_rate, "down")
    if not 1 <= n_steps <= _MOST * len(times):
        setting = "max_gap_time" if frame_rate is None else f"frame_rate={frame_rate:g}"
        raise ValueError(
            f"{what} has {len(times)} frames from {times[0]:.10g} to {times[-1]:.10g}, of which "
            f"{setting} would make {n_steps + 1}: give it in units of the time column."
        )
    if frame_rate is None:
        return np.linspace(times[0], times[-1], n_steps + 1)
    return np.minimum(times[0] + np.arange(n_steps + 1) / frame_rate, times[-1])


def interpolate(column, times, grid):
    """A feature at other times, on straight lines; NaN beside NaN."""
    column = as_numbers(column, f"Column {column.name!r}")
    return np.interp(grid, times, column).astype(column.dtype, copy=False)


def is_rate(value):
    """Whether a value is a number above 0 that can be a frame rate or a duration."""
    is_number = isinstance(value, Real) and not isinstance(value, bool)
    return is_number and RATES[0] <= value <= RATES[1]


def rounded_rate(rate):
    """A frame rate without the rounding of the times that it comes from."""
    return float(f"{rate:.9g}")


def _slack(times):
    """How far rounding may have moved times, in memory or to the digits of a file."""
    step = (times[-1] - times[0]) / (len(times) - 1)
    slack = max(_EVEN * step, 8 * np.spacing(np.abs(times).max()))
    single = times.astype(np.float32)
    if (single == times).all():
        slack = max(slack, 2 * float(np.spacing(np.abs(single).max())))
    for digits in range(-9, 10):
        quantum = 10.0**-digits
        if quantum > step:
            continue
        ticks = (times - times[0]) / quantum
        if np.abs(ticks - np.round(ticks)).max() < 1e-3:
            is_fine = quantum <= step / _DIGITS_IN_STEP
            return max(slack, quantum) if is_fine or _rounds_often(ticks) else slack
    return slack


def _rounds_often(ticks):
    """Whether steps are of two neighbouring numbers of digits, and the longer ones no lost frames.

    Of 60 frames a second with two digits a third of the steps are 0.01 and the others 0.02. A lost
    frame or two would be a longer step now and then, and twice as long.
    """
    sizes, counts = np.unique(np.round(np.diff(ticks)), return_counts=True)
    return (
        len(sizes) == 2
        and sizes[1] - sizes[0] == 1
        and (sizes[0] > 1 or counts[1] >= max(_OFTEN, _OFTEN_SHARE * len(ticks)))
    )


def is_even(times):
    """Whether times are even but for rounding."""
    frames = np.arange(len(times)) - (len(times) - 1) / 2
    slope = frames @ times / max(frames @ frames, 1e-300)
    # Rounding moves a time by half a digit up or down.
    return np.ptp(times - slope * frames) <= _LEAST_SQUARES * _slack(times)


def as_frame_rates(frame_rate, n_sequences=None):
    """Frames a second of each trial (n_sequences,), from one number or one for each.

    Without a number of trials any count is right.
    """
    rate = as_numbers(frame_rate, "frame_rate", dtype=np.float64)
    valid = (rate >= RATES[0]) & (rate <= RATES[1])
    valid &= np.asarray(frame_rate).dtype.kind != "b"
    fits = rate.ndim < 2 if n_sequences is None else rate.shape in ((), (n_sequences,))
    if not fits or not valid.all():
        which = f": trial {int(np.argmin(valid))}" if rate.ndim and not valid.all() else ""
        each = "trials" if n_sequences is None else counted(n_sequences, "trial")
        raise ValueError(
            "frame_rate must be one number above 0, in frames a second, or one for each of the "
            f"{each}, got {reprlib.repr(frame_rate)}{which}."
        )
    return rate if n_sequences is None else np.broadcast_to(rate, n_sequences)
