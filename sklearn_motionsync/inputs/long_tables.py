"""Tables of frames to trials, in order of an even time, and back."""

from __future__ import annotations

import reprlib
from collections.abc import Hashable, Sequence
from numbers import Integral

import numpy as np
import pandas as pd

from .collections import NOT_ONE, as_collection, check_members
from .facts import TIMELESS, compare_facts
from .numbers import refuse_non_numeric
from .recorded import (
    CLOCK,
    Recorded,
    frame_rate_of_rows,
    set_clock_of_index,
    times_of_rows,
    warn_of_rows,
)
from .resampling import (
    even_grid,
    find_time_gaps,
    interpolate,
    is_rate,
    times_as_numbers,
)
from .tables import (
    FRAME,
    INDEX_NAMES,
    ROW,
    SPLIT,
    TRIAL,
    as_pandas,
    full_names,
    is_labelled_array,
    is_nested,
    labelled,
    labels_given,
    labels_of,
    own_label,
    rows_of_labels,
    split_table,
    stack_frame,
)
from .types import Labels, Table, TrialsLike
from .wording import counted

# What to do with times that are no frames.
_EVENTS = (
    "Rows that are events, such as spikes, become rates first: see the page 'Align neural trials' "
    "(docs/howto/neuroscience.md)."
)


def to_trials(
    df: Table,
    by: str | Sequence[str] | None = None,
    time: str | None = None,
    *,
    frame_rate: float | None = None,
    max_gap_time: float | None = None,
) -> TrialList:
    """Turn a table of frames into a list of trials, with a table of their labels.

    Do this *before* cross-validation: scikit-learn would split the table by row. Estimators warn of
    rows split at random. Every second row passes: it is a lower frame rate.

    Parameters
    ----------
    df : DataFrame of pandas or polars, or DataArray of xarray
        One row a frame. Without ``by`` and ``time`` its index has two levels or more: the last is
        the frame, increasing within each trial, and those before it name the trial. Times there
        that are not even are warned of. A table with a row a trial and a series in each cell, and
        an array with the dimensions of trials, ``time`` and features, are made into such a table.
    by : str or list of str, default=None
        Columns or index levels that together tell trials apart; rows of one trial
        need not be neighbours. By default the levels of the index before the last; a table
        without such an index is one trial if there is a ``time``.
    time : str, default=None
        The column or index level that tells the time of frames: numbers, dates, which become
        seconds from the first of them, or durations, which become seconds. It puts the frames in
        order. By default rows are frames in the order they come in.
    frame_rate : float, default=None
        Frames in a unit of ``time`` that trials shall have. By default each keeps its own.
        Without ``time`` they are frames a second, and each trial has a known frame rate: in
        its ``attrs``, as from `io.read_motion`, or by an index in seconds, as the result has.
    max_gap_time : float, default=None
        Longest step of ``time``, in its unit, that is bridged by a straight line. By default
        steps above 1.9 times the median step are errors.

    Returns
    -------
    list of DataFrame
        Its attribute ``labels`` is a table with a row a trial and a column for each of ``by``, such
        as the condition and the subject of each. A slice of the list, and a choice by an array of
        indices or of booleans, keeps its labels.

        One ``(n_frames_i, n_features)`` frame a trial, in order of first appearance, indexed
        by the frame level, the time, or 0, 1, ... What ``by`` and ``time`` name are no features.
        ``attrs["trial"]`` is the label, a tuple if several levels name the trial,
        ``attrs["levels"]`` the names of the levels. With a ``time``, ``attrs["resampled"]`` is
        whether frames were interpolated, and ``attrs["clock"]`` the time of the first frame and the
        step to the next. A table without ``by`` keeps the label that it has. What `io.read_motion`
        puts into ``attrs`` of times, frame rate and events is that of the frames returned.

    Raises
    ------
    ValueError
        If there is no such column or level, a key or a time is missing, a time of a trial comes
        twice, or there is a gap; without ``time``, if the frames of a trial do not increase.

    See Also
    --------
    to_frame : The way back.

    Notes
    -----
    A trial whose times are even, but for rounding, is left as it is. Any other is
    *resampled*: every feature is interpolated linearly on an even grid from its first to its last
    time, whose step is as near as possible to the median of its steps, or at ``frame_rate`` from
    its first time on. A gap in a feature (NaN) stays one.

    Examples
    --------
    >>> import pandas as pd
    >>> from sklearn_motionsync import to_frame, to_trials
    >>> df = pd.DataFrame({
    ...     "subject": ["ann"] * 5, "trial": [1, 1, 2, 2, 2], "time": [0.1, 0, 0, 0.1, 0.25],
    ...     "knee": [3, 1, 4, 5, 8],
    ... })
    >>> trials = to_trials(df, by=["subject", "trial"], time="time")
    >>> trials.labels
      subject  trial
    0     ann      1
    1     ann      2
    >>> to_frame(trials)["knee"]
    subject  trial  time
    ann      1      0.000    1.0
                    0.100    3.0
             2      0.000    4.0
                    0.125    5.5
                    0.250    8.0
    Name: knee, dtype: float64
    """
    return TrialList(_trials_of(_as_table(df), by, time, frame_rate, max_gap_time))


class TrialList(list):
    """Trials of a table, as a list, and the table of their labels.

    Parameters
    ----------
    trials : iterable of DataFrame, each (n_frames_i, n_features)
    labels : DataFrame, shape (n_trials, n_levels), default=None
        By default what the trials carry in their ``attrs``, or their numbers.
    """

    def __init__(self, trials, labels=None):
        super().__init__(trials)
        if labels is None:
            values, (*levels, _) = labels_of(list(self))
            rows = values if len(levels) > 1 else [(value,) for value in values]
            labels = pd.DataFrame(rows, columns=levels)
        self.labels = labels

    def __getitem__(self, index):
        if isinstance(index, Integral):
            return super().__getitem__(index)
        rows = np.arange(len(self))[index]
        return TrialList([self[int(row)] for row in rows], self.labels.iloc[rows])

    def _repr_html_(self):
        """The labels and lengths of the trials, for notebooks."""
        return self.labels.assign(n_frames=[len(x) for x in self]).to_html(max_rows=10)


def _trials_of(df, by, time, frame_rate, max_gap_time):
    for name, value in (("frame_rate", frame_rate), ("max_gap_time", max_gap_time)):
        if value is not None and not is_rate(value):
            raise ValueError(
                f"{name} must be a number above 0, in units of time; got {reprlib.repr(value)}."
            )
    if time is None and max_gap_time is not None:
        raise ValueError(f"max_gap_time={max_gap_time!r} needs time=, the column of the times.")
    if time is None and frame_rate is not None:
        sequences = [df] if by is None and df.index.nlevels < 2 else to_trials(df, by)
        return [_at_rate(x, frame_rate) for x in sequences]
    if by is None and time is None:
        sequences = split_table(df)
        warn_of_rows(sequences, lambda i: f"Trial {sequences[i].attrs['trial']!r}")
        return sequences
    return _split_by_columns(df, by, time, frame_rate, max_gap_time)


def to_frame(
    sequences: TrialsLike,
    *,
    trials: Labels | None = None,
    columns: Sequence[Hashable] | pd.Index | None = None,
) -> pd.DataFrame:
    """Turn trials into one frame that is indexed by trial and frame.

    Parameters
    ----------
    sequences : list of 2-D arrays or DataFrames, or 3-D array
        Trials ``(n_frames_i, n_features)``.
    trials : sequence of length n_sequences, default=None
        Labels; an index of one level or several; or the DataFrames of `to_trials`. The last two
        give the names of the levels, too. By default those that the sequences have from
        there, or 0, 1, ...
    columns : sequence of str, default=None
        Names of the features; by default those of the DataFrames, or 0, 1, ...

    Returns
    -------
    DataFrame
        The concatenated trials. The index levels are ``trial`` and ``frame``, or what
        they are called in the table that labels and frames come from. Its ``attrs`` have the frame
        rate, unit and vertical axis that all trials share.

    Raises
    ------
    ValueError
        If the trials do not agree in width, names, units or vertical axes, or a label is
        missing or given twice.

    See Also
    --------
    to_trials : The way back.

    Examples
    --------
    >>> import numpy as np
    >>> import pandas as pd
    >>> from sklearn_motionsync import to_frame
    >>> X = [np.zeros((2, 1)), np.ones((3, 1))]
    >>> df = to_frame(X, columns=["knee"])
    >>> df.loc[1, "knee"].tolist()
    [1.0, 1.0, 1.0]
    >>> labels = pd.MultiIndex.from_tuples([("ann", 1), ("ann", 2)], names=["subject", "trial"])
    >>> to_frame(X, trials=labels, columns=["knee"]).loc["ann"].loc[2].shape
    (3, 1)
    """
    sequences = as_collection(sequences)
    if sequences is None:
        raise ValueError(NOT_ONE)
    arrays = check_members(sequences, finite=False)
    labels, levels, names = arrays.labels, arrays.levels, arrays.names
    if trials is not None:
        labels, outer = labels_given(trials)
        levels = (*outer, levels[-1])
    if len(labels) != len(arrays) or len(set(labels)) != len(labels):
        raise ValueError(
            f"trials must be {counted(len(arrays), 'different label')}, one a trial, "
            f"got {len(labels)} of which {len(set(labels))} differ."
        )
    for i, label in enumerate(labels):
        if any(pd.isna(item) is True for item in (label if isinstance(label, tuple) else [label])):
            raise ValueError(f"Trial {i} has no label: trials[{i}] is {label!r}.")
    columns = names if columns is None else list(columns)
    if columns is not None and len(columns) != arrays[0].shape[1]:
        raise ValueError(
            f"columns must name the {counted(arrays[0].shape[1], 'feature')}, one each; got "
            f"{len(columns)}."
        )
    table = stack_frame(arrays, labels, arrays.frames, columns, levels)
    # An index of times keeps the rate of each.
    timed = table.index.get_level_values(-1).dtype.kind in "fmM"
    shared = compare_facts(arrays.facts, arrays.called, TIMELESS if timed else None)
    table.attrs = {
        fact: values[0]
        for fact, values in shared.items()
        if len(values) == 1 and all(fact in facts for facts in arrays.facts)
    }
    return table


# -- steps of to_trials ------------------------------------------------------------------


def _as_table(df):
    """A table of pandas, one row a frame."""
    df = as_pandas(df)
    if is_labelled_array(df):
        df = to_frame([df] if df.ndim == 2 else df)
    if not isinstance(df, pd.DataFrame):
        raise ValueError(
            f"to_trials needs a DataFrame of pandas or polars, got {type(df).__name__}. Several "
            f"tables make one: pd.concat(tables, names={list(INDEX_NAMES)}); arrays that are "
            "trials already need no table."
        )
    return to_frame(df) if is_nested(df) else df


def _split_by_columns(df, by, time, frame_rate, max_gap_time):
    """The trials of a table of which columns or levels name trial or time."""
    if df.index.nlevels > 1:
        df = df.rename_axis(index=full_names(df.index.names))
    keys, times = _keys(df, by, time), [] if time is None else [time]
    flat = _levels_as_columns(df, keys, times)
    features = flat.drop(columns=[*keys, *times])
    refuse_non_numeric(features, "The table")
    names = keys or [TRIAL]
    if len(keys) > 1:
        index = pd.MultiIndex.from_frame(flat[keys])
    else:
        index = pd.Index(flat[keys[0]] if keys else np.zeros(len(flat), dtype=int))
    labels, rows_by_label = rows_of_labels(index, names)
    if keys and len(flat) == len(labels):
        raise ValueError(
            f"{keys} give {counted(len(flat), 'trial')} of one row each, and a trial "
            "has 2 frames or more, one below the other. Name in by= the columns of the "
            "trial only, and the time in time=: to_trials(df, by=..., time=...)."
        )
    if not keys and own_label(df)[0] is not None:
        label, names = own_label(df)
        labels = [label]
    recording = Recorded(df)
    if time is None:
        level = ROW if FRAME in names else None
        return [
            labelled(
                _rows(features, rows, pd.RangeIndex(len(rows), name=level)),
                label,
                (*names, level or FRAME),
                recording.attrs_of(rows),
            )
            for rows, label in zip(rows_by_label, labels, strict=True)
        ]
    clock = flat[time]
    if isinstance(clock.dtype, np.dtype) and clock.dtype.kind in "fiu":
        clock = clock.to_numpy(dtype=np.float64)
    timed = [
        _in_order(clock, rows, label, time)
        for rows, label in zip(rows_by_label, labels, strict=True)
    ]
    _check_gaps([times for times, _ in timed], labels, max_gap_time)
    sequences = []
    for (times, rows), label in zip(timed, labels, strict=True):
        grid = even_grid(times, frame_rate, f"Trial {label!r}")
        x = _rows(features, rows, pd.Index(times, name=time))
        if grid is not None:
            columns = {k: interpolate(x.iloc[:, k], times, grid) for k in range(x.shape[1])}
            index = pd.Index(grid, name=time)
            x = pd.DataFrame(columns, index=index).set_axis(x.columns, axis=1)
        attrs = recording.attrs_of(rows, times, grid) | {"resampled": grid is not None}
        even = times if grid is None else grid
        step = (even[-1] - even[0]) / (len(even) - 1) if len(even) > 1 else 1
        attrs[CLOCK] = float(even[0]), float(step)
        sequences.append(labelled(x, label, (*names, time), attrs))
        set_clock_of_index(sequences[-1])
    return sequences


def _at_rate(x, frame_rate):
    """A trial of a known frame rate at another one."""
    rate = frame_rate_of_rows(x)
    if rate is None:
        raise ValueError(
            f"frame_rate={frame_rate!r} needs time=, the column of the times, or a table whose "
            f"frame rate is known, by df.attrs['frame_rate'] or an index in seconds; "
            f"{counted(len(x), 'row')} with the index {x.index.name!r} have none."
        )
    time = next(name for name in ("time", "time_s", "seconds") if name not in x.columns)
    timed = x.assign(**{time: times_of_rows(x, np.arange(len(x)), rate)})
    return to_trials(timed, time=time, frame_rate=frame_rate)[0]


def _keys(df, by, time):
    """The columns or levels that name the trial."""
    if by is not None:
        return list(by) if isinstance(by, (list, tuple, pd.Index, np.ndarray)) else [by]
    levels = list(df.index.names)
    if time not in levels and (len(levels) > 1 or df.index.is_unique):
        # The time takes the place of the numbers of frames.
        levels = levels[:-1]
    return [level for level in levels if level is not None and level != time]


def _levels_as_columns(df, keys, times):
    """The table with the levels of the index that are named as columns."""
    named = [*keys, *times]
    levels = [name for name in df.index.names if name in named and name not in df.columns]
    flat = df
    if levels:
        # All at once: inserting into a table of many columns makes pandas warn.
        from_index = pd.DataFrame({name: df.index.get_level_values(name) for name in levels})
        flat = pd.concat([from_index, df.reset_index(drop=True)], axis=1)
    columns = list(flat.columns)
    missing = [key for key in named if key not in columns]
    if missing or not named:
        level_names = [name for name in df.index.names if name is not None]
        raise ValueError(
            f"There is no column or index level {missing}; there are the columns "
            f"{list(df.columns)[:20]} and the levels {level_names}. {SPLIT}"
        )
    if len(set(named)) < len(named) or any(columns.count(key) > 1 for key in named):
        raise ValueError(
            f"by={keys!r} and time= must be different columns, each of which comes once; there "
            f"are {columns[:20]}."
        )
    if not len(flat):
        raise ValueError("The table has no rows, so there are no trials in it.")
    return flat


def _in_order(column, rows, label, name):
    """Times of a trial, increasing, and its rows in this order."""
    called = f"The time of trial {label!r}"
    if isinstance(column, np.ndarray):
        times = column[rows]
    else:
        times = times_as_numbers(column.iloc[rows], called)
    if not np.isfinite(times).all():
        row = rows[np.argmin(np.isfinite(times))]
        raise ValueError(
            f"{called} is missing (NaN) or infinite in row {row}. Drop such rows: "
            f"df.dropna(subset=[{name!r}])."
        )
    order = np.argsort(times, kind="stable")
    times = times[order]
    twice = times[:-1][np.diff(times) == 0]
    if len(twice):
        raise ValueError(
            f"Times of trial {label!r} come twice, {len(twice)} of them, the first is "
            f"{twice[0]:.10g}. Name in by= all columns that tell trials apart, or drop the "
            f"doubles by df.drop_duplicates. {_EVENTS}"
        )
    return times, rows[order]


def _check_gaps(timed, labels, max_gap_time):
    """Refuse gaps in time: frames count as evenly spaced."""
    gaps = [
        (*gap, label)
        for times, label in zip(timed, labels, strict=True)
        for gap in find_time_gaps(times, max_gap_time)
    ]
    if gaps:
        start, end, step, label = max(gaps, key=lambda gap: gap[1] - gap[0])
        raise ValueError(
            f"Trial {label!r} has a gap from {start:.10g} to {end:.10g}, where frames are "
            f"{step:.4g} apart, the longest of {len(gaps)} in all trials. Frames count as "
            "evenly spaced: bridge gaps by straight lines with max_gap_time="
            f"{end - start:.7g}, or leave such trials out. {_EVENTS}"
        )


def _rows(features, rows, index):
    """Rows of a table, a copy, under an index of their own."""
    x = features.iloc[rows]
    # In place: set_axis would copy everything once more.
    x.index = index
    return x
