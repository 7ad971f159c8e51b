"""The times of frames: as numbers, in order, without gaps, and evenly spaced or made so."""

import warnings

import numpy as np
import pandas as pd

from .numbers import as_numbers

__all__ = [
    "as_frame_rates",
    "attrs_of_rows",
    "even_grid",
    "find_time_gaps",
    "interpolate",
    "is_even",
    "rounded_rate",
    "times_as_numbers",
    "warn_of_uneven",
]

# Steps of time longer than so many median steps are gaps.
_GAP = 1.9
# Times this share of a step from even ones are even.
_EVEN = 1e-6
# More than so many times the recorded frames come from a mistake in the unit.
_MOST = 100


def times_as_numbers(values, what):
    """Times as numbers: dates are seconds from the first of them, durations are seconds.

    Parameters
    ----------
    values : Series or Index
    what : str
        Their name in messages.

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
    return [(times[i], times[i + 1], step) for i in np.flatnonzero(steps > longest)]


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
        The name of the performance in messages.
    """
    if len(times) < 2:
        return None
    duration, n_steps = times[-1] - times[0], len(times) - 1
    slack = _slack(times)
    keeps_rate = frame_rate is None or abs(duration - n_steps / frame_rate) <= slack
    if keeps_rate and is_even(times):
        return None
    if frame_rate is None:
        n_steps = round(duration / float(np.median(np.diff(times))))
    else:
        # Rounding of the times is no reason to lose the last frame.
        n_steps = int((duration + slack) * frame_rate)
    if not 1 <= n_steps <= _MOST * len(times):
        setting = "max_gap_time" if frame_rate is None else f"frame_rate={frame_rate:g}"
        raise ValueError(
            f"{what} has {len(times)} frames from {times[0]:.10g} to {times[-1]:.10g}, of which "
            f"{setting} would make {n_steps + 1}: give it in units of the time column."
        )
    if frame_rate is None:
        return np.linspace(times[0], times[-1], n_steps + 1)
    return np.minimum(times[0] + np.arange(n_steps + 1) / frame_rate, times[-1])


def warn_of_uneven(sequences):
    """Warn of performances whose index is a time that is not even.

    Whole numbers are numbers of frames, some of which may be missing.

    Parameters
    ----------
    sequences : list of DataFrame
        As `split_table` gives them.
    """
    for x in sequences:
        if x.index.dtype.kind not in "fmM" or len(x) < 2:
            continue
        label, name = x.attrs["performance"], x.index.name
        times = times_as_numbers(x.index, f"The time of performance {label!r}")
        if not np.isfinite(times).all() or is_even(times):
            continue
        steps = np.diff(times)
        worst, what = steps.argmax(), "frame" if name is None else name
        warnings.warn(
            f"The times of performance {label!r}, level {what!r} of the index, are not even: from "
            f"{times[worst]:.10g} to {times[worst + 1]:.10g} it is {steps[worst]:.4g}, mostly "
            f"{np.median(steps):.4g}. Frames count as evenly spaced: to_sequences(df, "
            f"time={what!r}) makes them so.",
            UserWarning,
            stacklevel=3,
        )
        return


def interpolate(column, times, grid):
    """A feature at other times, on straight lines; NaN beside NaN."""
    column = as_numbers(column, f"Column {column.name!r}")
    return np.interp(grid, times, column).astype(column.dtype, copy=False)


def attrs_of_rows(attrs, rows, n_rows, times=None, grid=None):
    """The ``attrs`` of a recording, its clock and events moved to the frames of a performance.

    Parameters
    ----------
    attrs : dict
        Of the table, as `io.read_motion` gives it.
    rows : ndarray of int
        Which of the ``n_rows`` of the table are in the performance, in its order.
    times : ndarray, default=None
        Of these rows, in any unit.
    grid : ndarray, default=None
        The even times that replace them.

    Returns
    -------
    dict
    """
    facts = dict(attrs)
    seconds, rate = facts.pop("times", None), facts.get("frame_rate")
    events = facts.pop("events", None)
    if rows[0]:
        facts.pop("first_frame", None)
        if rate and "first_time" in facts:
            facts["first_time"] += rows[0] / rate
    if seconds is not None and len(seconds) == n_rows:
        seconds = np.asarray(seconds, dtype=np.float64)[rows]
        facts |= _clock_of(seconds if grid is None else np.interp(grid, times, seconds))
    elif rate and grid is not None:
        facts["frame_rate"] = rounded_rate(rate * np.median(np.diff(times)) / (grid[1] - grid[0]))
    if isinstance(events, (list, tuple)) and (np.diff(rows) > 0).all():
        n_frames = len(rows if grid is None else grid)
        moved = [_move_event(event, rows, times, grid) for event in events]
        whole = len(rows) == n_rows
        facts["events"] = [
            event
            for event in moved
            if whole or event.get("frame") is None or 0 <= event["frame"] <= n_frames - 1
        ]
    return facts


def _clock_of(seconds):
    """The frame rate of even times, or the times."""
    clock = {"first_time": float(seconds[0])}
    if len(seconds) > 1 and is_even(seconds):
        rate = (len(seconds) - 1) / (seconds[-1] - seconds[0])
        return clock | {"frame_rate": rounded_rate(rate)}
    return clock | {"times": seconds.tolist()}


def rounded_rate(rate):
    """A frame rate without the rounding of the times that it comes from."""
    return float(f"{rate:.9g}")


def _move_event(event, rows, times, grid):
    """An event at its frame in the performance."""
    if not isinstance(event, dict) or event.get("frame") is None:
        return event
    own = np.arange(len(rows))
    place = _on_line(event["frame"], rows, own)
    if grid is not None:
        place = _on_line(_on_line(place, own, times), grid, np.arange(len(grid)))
    return event | {"frame": round(float(place), 5)}


def _on_line(x, xs, ys):
    """Interpolate between points that increase, and extrapolate at their mean slope."""
    if xs[0] <= x <= xs[-1]:
        return np.interp(x, xs, ys)
    end = 0 if x < xs[0] else -1
    return ys[end] + (x - xs[end]) * (ys[-1] - ys[0]) / max(xs[-1] - xs[0], 1e-300)


def _slack(times):
    """How far rounding may have moved times, in memory or to the digits of a file."""
    step = (times[-1] - times[0]) / (len(times) - 1)
    slack = max(_EVEN * step, 8 * np.spacing(np.abs(times).max()))
    single = times.astype(np.float32)
    if (single == times).all():
        slack = max(slack, 2 * float(np.spacing(np.abs(single).max())))
    for digits in range(-9, 10):
        quantum = 10.0**-digits
        # A third: 30 frames a second with two digits.
        if quantum > step / 3:
            continue
        ticks = (times - times[0]) / quantum
        if np.abs(ticks - np.round(ticks)).max() < 1e-3:
            return max(slack, quantum)
    return slack


def is_even(times):
    """Whether times are even but for rounding."""
    frames = np.arange(len(times)) - (len(times) - 1) / 2
    slope = frames @ times / max(frames @ frames, 1e-300)
    # Rounding moves a time by half a digit up or down.
    return np.ptp(times - slope * frames) < 0.999 * _slack(times)


def as_frame_rates(frame_rate, n_sequences):
    """Frames a second: one number, or a column of one number for each performance."""
    rate = as_numbers(frame_rate, "frame_rate", dtype=np.float64)
    valid = (rate > 0) & np.isfinite(rate)
    if rate.shape not in ((), (n_sequences,)) or not valid.all():
        which = f": performance {int(np.argmin(valid))}" if rate.ndim and not valid.all() else ""
        raise ValueError(
            "frame_rate must be one number above 0, in frames a second, or one for each of the "
            f"{n_sequences} performances, got {frame_rate!r}{which}."
        )
    return rate[..., np.newaxis]
