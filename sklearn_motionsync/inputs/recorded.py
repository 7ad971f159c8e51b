"""Which frames of a recording the rows of a table are, and the frame rate that these rows have.

The ``attrs`` of a recording (``frame_rate``, ``times``, ``events``, ...) stay as they are when
pandas drops, thins out or reorders rows. The index goes with the rows: it tells which frames they
are.
"""

import re
import warnings
from numbers import Real

import numpy as np
import pandas as pd

from ..matching.counting import whole
from .resampling import is_even, is_rate, rounded_rate, times_as_numbers
from .tables import FRAME, split_table

# Key of ``attrs``: the time of frame 0 and the step to the next, where the index is a time.
CLOCK = "clock"
# Keys of ``attrs`` that are true of the rows of one table only.
_OF_ROWS = ("events", "times", "first_frame", "first_time", "rows", CLOCK)
# Names of an index in seconds: "time", "t", "time_s", "time (s)", "seconds", ...
_SECONDS = re.compile(r"(time|t)?[\s_]*[(\[]?(s|secs?|seconds?)?[)\]]?", re.IGNORECASE)
# Seconds; longer steps of a time are of another unit.
_LONGEST_STEP = 1
# Rates that differ by less are one: 29.97 and 30, 59.94 and 60 frames a second.
SAME_RATE = 0.01
# A share of a step by which rounding may move a time.
_ROUNDING = 0.4
# Key-frames are seconds if all of a trial are below 1, or in this share of it. Of 585 moments
# of people none is: the first lies at frame 8.3, or at 0.032 of its trial.
_IN_SECONDS = 1 / 50
# In fewer frames than these a key-frame may be below 1.
_FEW_FRAMES = 10
# So many gaps, and such a share of the steps, are of random rows: of ten folds a training set has
# gaps at 10 % of its steps.
_FEW_GAPS, _SHARE_OF_GAPS = 3, 0.05


def recorded_frames(df):
    """The frames of the recording that the rows of a trial are, in the order of the rows.

    They are counted as in its ``attrs["events"]``: from 0, the first row of the table that
    ``attrs`` describe. The result is None if the index does not tell.
    """
    index, clock = _frame_level(df), df.attrs.get(CLOCK)
    if isinstance(index, pd.RangeIndex) and not names_seconds(index.name):
        return index.to_numpy() if index.min() >= 0 or not len(index) else None
    if index.dtype.kind not in "iuf":
        return None
    values, slack = index.to_numpy(dtype=np.float64, na_value=np.nan), 0
    if not np.isfinite(values).all():
        return None
    if index.dtype.kind == "f" and isinstance(clock, (tuple, list)):
        values, slack = (values - clock[0]) / clock[1], _ROUNDING
    elif names_seconds(index.name) and (
        index.dtype.kind == "f" or np.abs(np.diff(values)).min(initial=np.inf) > 1
    ):
        # Whole seconds, or every tenth frame, or milliseconds.
        return None
    frames = np.round(values)
    if (np.abs(values - frames) > slack).any() or frames.min(initial=0) < 0:
        return None
    return frames.astype(np.int64)


def frames_of_rows(x):
    """The frames of the rows of a trial, which increase; without an index of frames, from 0."""
    frames = recorded_frames(x) if isinstance(x, pd.DataFrame) else None
    if frames is None or (np.diff(frames) <= 0).any():
        return np.arange(len(x))
    return frames


def frame_rate_of_rows(x):
    """The frame rate that the rows of a table have now: 60 of every second one of 120.

    By ``attrs["frame_rate"]`` and which frames the rows are, or by an index in seconds: dates,
    durations, or numbers under such a name. None if it is not known or rows are not evenly spaced,
    and for all that is no DataFrame.
    """
    if not isinstance(x, pd.DataFrame):
        return None
    rate, frames = x.attrs.get("frame_rate"), recorded_frames(x)
    if frames is None or not is_rate(rate):
        return _rate_of_seconds(_frame_level(x))
    steps = np.abs(np.diff(frames))
    if len(steps) and (steps[0] == 0 or (steps != steps[0]).any()):
        return None
    return float(rate / steps[0]) if len(steps) else float(rate)


def times_of_rows(x, rows, frame_rate):
    """Seconds at rows of a trial, with fractions, on the clock of its recording and its events."""
    return _start_of_rows(x) + np.asarray(rows, dtype=np.float64) / frame_rate


def rows_at(x, times, frame_rate):
    """The inverse of `times_of_rows`."""
    return (times - _start_of_rows(x)) * frame_rate


def _start_of_rows(x):
    """The time of the first row of a table in seconds, by its index or ``attrs``; 0 if unknown."""
    if not isinstance(x, pd.DataFrame) or not len(x):
        return 0.0
    if _rate_of_seconds(_frame_level(x)) is not None:
        return float(times_as_numbers(_frame_level(x), "The index")[0])
    start, rate = first_time_of(x.attrs) or 0.0, x.attrs.get("frame_rate")
    frames = recorded_frames(x)
    return start if frames is None or not is_rate(rate) else start + float(frames[0] / rate)


def set_clock_of_index(x):
    """Move first time and events in ``attrs`` of a trial to the clock of its index in seconds."""
    if (rate := _rate_of_seconds(_frame_level(x))) is None:
        return
    start = _start_of_rows(x)
    x.attrs |= {"first_time": start} if "first_time" in x.attrs else {}
    for i, event in enumerate(x.attrs.get("events", ())):
        if _frame_of(event) is not None and "time" in event:
            time = round(start + event["frame"] / rate, 6)
            x.attrs["events"][i] = event | {"time": time}


def first_time_of(attrs):
    """The time of frame 0 of a recording, perhaps by its number, of which 1 is at 0 seconds."""
    time, number, rate = map(attrs.get, ("first_time", "first_frame", "frame_rate"))
    if time is None and isinstance(number, int) and is_rate(rate):
        time = max(number - 1, 0) * _rows_per_frame(attrs) / rate
    return float(time) if isinstance(time, Real) else None


def _rows_per_frame(attrs):
    """Analog channels and segments may have several rows in a frame of the trial."""
    groups = attrs.get("groups", {})
    rates = [groups.get(group, {}).get("frame_rate") for group in (attrs.get("kind"), "markers")]
    return rates[0] / rates[1] if all(rates) else 1


def names_seconds(name):
    """Whether a column or level of this name may be in seconds."""
    return bool(name) and bool(_SECONDS.fullmatch(str(name).strip()))


def refuse_seconds(frames, n_frames, name):
    """Refuse key-frames of a trial, fractions among them, that can only be seconds."""
    last = max(frames, default=0)
    is_early = n_frames >= _FEW_FRAMES and last < max(1, _IN_SECONDS * (n_frames - 1))
    if is_early and (frames != np.round(frames)).any():
        raise ValueError(
            f"{name}: its key-frames {frames[:5].tolist()} look like seconds, as it has {n_frames} "
            "frames: give seconds * frame_rate. If they are frames, round them."
        )


def refuse_moved_events(X):
    """Refuse tables, in a list or in one, whose rows are not the frames that their events count.

    Key-frames count the rows of a trial; those of its events would be of other rows.
    """
    if isinstance(X, pd.DataFrame) and X.index.nlevels > 1:
        X = split_table(X)
    for i, x in enumerate(X if isinstance(X, (list, tuple)) else ()):
        if not isinstance(x, pd.DataFrame) or not x.attrs.get("events"):
            continue
        frames = recorded_frames(x)
        if frames is not None and (frames != np.arange(len(frames))).any():
            row = int((frames != np.arange(len(frames))).argmax())
            raise ValueError(
                f"Trial {i}: by its index row {row} is frame {frames[row]} of the recording. "
                "Events in attrs count its frames, and key-frames the rows of the trial. "
                "Cut trials by cut_at_events, which moves events; if the key-frames count "
                "rows, give df.reset_index(drop=True)."
            )


def warn_of_rows(sequences, called):
    """Warn of the first table whose index says that its rows are not even steps of time.

    Every k-th row is a lower frame rate and passes. Random rows, as of folds of a table, do not;
    nor do, where the index tells the time, rows with a gap. Or that they have a frame rate of which
    the one in ``attrs`` is no multiple: rows may have been left out since. What is no table passes,
    and ``called`` gives the name of a trial by its index.
    """
    for i, x in enumerate(sequences):
        trouble = _trouble_of_rows(x) if isinstance(x, pd.DataFrame) else None
        if trouble:
            warnings.warn(f"{called(i)}: {trouble}", UserWarning, stacklevel=3)
            return


def _trouble_of_rows(x):
    """What is wrong with the rows of a table, and what to do, by its index; None if nothing is."""
    index = _frame_level(x)
    if index.dtype.kind not in "iufmM" or len(index) < 2:
        return None
    if isinstance(index, pd.RangeIndex) and index.step > 0:
        return None
    times = times_as_numbers(index, "The index")
    if not np.isfinite(times).all():
        return None
    name, steps = FRAME if index.name is None else index.name, np.diff(times)
    if (steps < 0).any():
        row = int((steps < 0).argmax())
        return (
            f"its rows are not in order of time. By the level {name!r} of its index "
            f"{times[row + 1]:.10g} follows {times[row]:.10g}. Sort it by x.sort_index(); if the "
            "order is meant, number the rows by x.reset_index(drop=True)."
        )
    rate = x.attrs.get("frame_rate")
    # Whole numbers are numbers of frames; those of a recording at a frame rate tell its time.
    timed = index.dtype.kind in "fmM" or is_rate(rate)
    index_rate = _rate_of_seconds(index)
    is_uneven = index_rate is None and (steps != steps[0]).any() and not is_even(times)
    if is_uneven and _look_split(steps):
        return (
            f"rows look split, as by cross-validation of rows, which puts every trial into train "
            f"and test: {len(times)} are left of {round(np.ptp(times) / steps.min()) + 1} between "
            f"{times[0]:.10g} and {times[-1]:.10g}, level {name!r} of the index. Give "
            "to_trials(table), a list, which is split by trial. Rows left out on purpose are "
            f"filled in by to_trials(df, time={name!r}, max_gap_time=...)."
        )
    if is_uneven and timed:
        worst = steps.argmax()
        return (
            f"the times of its rows, level {name!r} of the index, are not even: from "
            f"{times[worst]:.10g} to {times[worst + 1]:.10g} it is {steps[worst]:.4g}, mostly "
            f"{np.median(steps):.4g}. Frames count as evenly spaced: "
            f"to_trials(df, time={name!r}) makes them so."
        )
    has_two_rates = index_rate is not None and is_rate(rate) and recorded_frames(x) is None
    if has_two_rates and not is_thinned(index_rate, rate):
        return (
            f"its index has {index_rate:g} frames a second, and x.attrs['frame_rate'] is "
            f"{rate:g}. The index is taken. Correct the wrong one."
        )
    return None


def _look_split(steps):
    """Whether rows were left out here and there, as random ones are, and not in a few gaps."""
    left_out = steps / steps.min() if steps.min() > 0 else np.ones(1)
    if (np.abs(left_out - np.round(left_out)) > _ROUNDING).any():
        return False
    return (left_out > 1.5).sum() >= max(_FEW_GAPS, _SHARE_OF_GAPS * len(steps))


def is_thinned(rate, recorded):
    """Whether a frame rate is that of every k-th frame of a recording; False if one is None."""
    if not rate or not recorded:
        return False
    k = round(recorded / rate)
    return k >= 1 and abs(rate * k - recorded) < SAME_RATE * recorded


def timeless(x):
    """The ``attrs`` of a table without those of its rows; ``frame_rate`` is that of the rows."""
    facts = {key: value for key, value in x.attrs.items() if key not in _OF_ROWS}
    return facts | ({"frame_rate": frame_rate_of_rows(x)} if "frame_rate" in facts else {})


class Recorded:
    """A table of a recording: which frames its rows are, and what ``attrs`` parts of it have.

    Parameters
    ----------
    df : DataFrame
        One recording, or a long table of several whose ``attrs`` are true of all.

    Attributes
    ----------
    frames : ndarray of int, shape (n_rows,), or None
        As from `recorded_frames`.
    step : int
        The smallest step between frames: 2 where every second row was taken.
    """

    def __init__(self, df):
        self._attrs, self._n_rows, self.frames = df.attrs, len(df), recorded_frames(df)
        steps = np.diff(np.unique([] if self.frames is None else self.frames))
        self.step = int(steps.min()) if len(steps) else 1
        self._is_whole = (steps == self.step).all()
        self._rate = frame_rate_of_rows(df)

    def attrs_of(self, rows, times=None, grid=None):
        """The ``attrs`` of a trial of some rows, clock and events moved to its frames.

        ``times`` are those of the rows, in any unit, and ``grid`` the even ones that replace them.
        What the index does not tell is left out.
        """
        facts = {key: value for key, value in self._attrs.items() if key not in _OF_ROWS}
        rate = facts.get("frame_rate")
        if self.frames is None:
            index_rate = self._rate if grid is None and (np.diff(rows) == 1).all() else None
            has_rate = rate is not None or index_rate is not None
            return facts | {"frame_rate": index_rate} if has_rate else facts
        frames = self.frames[rows]
        first, all_rows = int(frames[0]), len(rows) == self._n_rows
        start, seconds = first_time_of(self._attrs), self._attrs.get("times")
        events, number = map(self._attrs.get, ("events", "first_frame"))
        if first == 0 and all_rows and "rows" in self._attrs:
            facts["rows"] = self._attrs["rows"]
        if isinstance(number, int):
            facts["first_frame"] = number + whole(first / _rows_per_frame(self._attrs), "down")
        if start is not None and (is_rate(rate) or first == 0):
            facts["first_time"] = start + (first / rate if first else 0)
        if seconds is not None and frames.max() < len(seconds):
            seconds = np.asarray(seconds)[frames]
            seconds = seconds if grid is None else np.interp(grid, times, seconds)
            facts["first_time"] = float(seconds[0])
            if len(seconds) > 1 and is_even(seconds):
                pace = (len(seconds) - 1) / (seconds[-1] - seconds[0])
                facts["frame_rate"] = rounded_rate(pace)
            else:
                facts["times"] = seconds.tolist()
        elif is_rate(rate) and grid is not None:
            pace = np.median(np.diff(times)) / (grid[1] - grid[0])
            facts["frame_rate"] = rounded_rate(rate / self.step * pace)
        elif is_rate(rate):
            has_steps = times is not None or self._is_whole or (np.diff(frames) == self.step).all()
            facts["frame_rate"] = rate / self.step if has_steps else None
        if isinstance(events, (list, tuple)) and (np.diff(frames) > 0).all():
            last = len(frames if grid is None else grid) - 1
            moved = [_move_event(event, frames, times, grid) for event in events]
            facts["events"] = [
                event for event in moved if all_rows or 0 <= (_frame_of(event) or 0) <= last
            ]
        return facts


def _frame_of(event):
    return event.get("frame") if isinstance(event, dict) else None


def _move_event(event, frames, times, grid):
    """An event at its frame in the trial."""
    frame, places = _frame_of(event), np.arange(len(frames))
    if frame is None:
        return event
    place = _on_line(frame, frames, places)
    if grid is not None:
        place = _on_line(_on_line(place, places, times), grid, np.arange(len(grid)))
    return event | {"frame": round(float(place), 5)}


def _on_line(x, xs, ys):
    """Interpolate between points that increase, and extrapolate at their mean slope."""
    if xs[0] <= x <= xs[-1]:
        return np.interp(x, xs, ys)
    return ys[0] + (x - xs[0]) * (ys[-1] - ys[0]) / max(xs[-1] - xs[0], 1e-300)


def _frame_level(df):
    return df.index.get_level_values(-1)


def _rate_of_seconds(index):
    """The frame rate of even times in seconds; None of all else."""
    if len(index) < 2 or not (index.dtype.kind in "mM" or names_seconds(index.name)):
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
