"""The times of frames: as numbers, in order, without gaps, and evenly spaced or made so."""

from numbers import Real

import numpy as np
import pandas as pd

from .gate import as_numbers

__all__ = ["as_times", "check_settings", "even_grid", "gaps_of", "interpolated", "round_up"]

# Steps of time this much longer than the usual one are gaps.
_GAP = 1.9
# Times this share of a step from even ones are even.
_EVEN = 1e-6
# So many times the recorded frames are a mistake in the unit.
_MOST = 100


def as_times(values, what, column):
    """Times as numbers: dates are seconds from the first of them, durations are seconds.

    Parameters
    ----------
    values : Series or Index
    what, column : str
        What to call them in messages, and in code.

    Returns
    -------
    ndarray of float64, shape (n_frames,)
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
        name = f"df[{column!r}]"
        raise ValueError(
            f"{what} is text, such as {texts[0][:40]!r}. Convert it: {name} = "
            f"pd.to_datetime({name}) for dates, pd.to_timedelta for durations, pd.to_numeric for "
            "numbers."
        )
    return as_numbers(series, what, dtype=np.float64)


def check_settings(frame_rate, max_gap, time):
    """Refuse what is no rate or no gap, or comes without times."""
    for name, value in (("frame_rate", frame_rate), ("max_gap", max_gap)):
        if value is None:
            continue
        is_number = isinstance(value, Real) and not isinstance(value, bool)
        if not is_number or not 0 < value < np.inf:
            raise ValueError(f"{name} must be a number above 0, in units of time; got {value!r}.")
        if time is None:
            raise ValueError(
                f"{name}={value!r} goes with time=: say which column tells the time, as in "
                f"to_sequences(df, by=[...], time='time', {name}={value!r})."
            )


def gaps_of(times, max_gap=None):
    """Where times that increase leap: pairs (from, to), and the usual step."""
    steps = np.diff(times)
    if len(steps) < 2:
        return [], float(steps.sum())
    usual = float(np.median(steps))
    longest = max(_GAP * usual, (max_gap or 0) * (1 + _EVEN))
    return [(times[i], times[i + 1]) for i in np.flatnonzero(steps > longest)], usual


def round_up(size):
    """A number of four digits that is not less."""
    scale = 10.0 ** (3 - int(np.floor(np.log10(size))))
    return float(f"{np.ceil(size * scale - _EVEN) / scale:.10g}")


def even_grid(times, frame_rate, what):
    """The even times that replace those of a performance; None if they are even themselves.

    Parameters
    ----------
    times : ndarray, shape (n_frames,)
        They increase.
    frame_rate : float or None
        Frames in a unit of time; by default as near to the median step as it takes to keep the
        first and the last frame.
    what : str
        What to call the performance.
    """
    if len(times) < 2:
        return None
    duration, n_steps = times[-1] - times[0], len(times) - 1
    slack = _slack(times)
    keeps_rate = frame_rate is None or abs(duration - n_steps / frame_rate) <= slack
    if keeps_rate and _is_even(times, slack):
        return None
    if frame_rate is None:
        n_steps = round(duration / float(np.median(np.diff(times))))
    else:
        # Rounding of the times is no reason to lose the last frame.
        n_steps = int((duration + slack) * frame_rate)
    if not 1 <= n_steps <= _MOST * len(times):
        asked = "max_gap" if frame_rate is None else f"frame_rate={frame_rate:g}"
        raise ValueError(
            f"{what} has {len(times)} frames from {times[0]:.10g} to {times[-1]:.10g}, of which "
            f"{asked} would make {n_steps + 1}: give it in units of the time column."
        )
    if frame_rate is None:
        return np.linspace(times[0], times[-1], n_steps + 1)
    return np.minimum(times[0] + np.arange(n_steps + 1) / frame_rate, times[-1])


def interpolated(column, times, grid):
    """A feature at other times, on straight lines; what is next to NaN is NaN."""
    dtype = column.dtype if column.dtype.kind == "f" else np.float64
    return np.interp(grid, times, column).astype(dtype, copy=False)


def _slack(times):
    """How far rounding may have moved times: in memory, or to the digits they are written with."""
    step = (times[-1] - times[0]) / (len(times) - 1)
    slack = max(_EVEN * step, 8 * np.spacing(np.abs(times).max()))
    for digits in range(-9, 10):
        quantum = 10.0**-digits
        ticks = (times - times[0]) / quantum
        written = np.abs(ticks - np.round(ticks)).max() < 1e-3
        if quantum <= step / 4 and written:
            return max(slack, quantum)
    return slack


def _is_even(times, slack):
    """Whether even times, rounded like these, would be these."""
    frames = np.arange(len(times)) - (len(times) - 1) / 2
    slope = frames @ times / max(frames @ frames, 1e-300)
    # Rounding moves a time by half a digit up or down.
    return np.ptp(times - slope * frames) < 0.999 * slack
