"""Long tables: one row a frame, cut into performances by columns, in order of an even time."""

from typing import NamedTuple

import numpy as np
import pandas as pd

from .numbers import as_numbers
from .resampling import (
    COMMA,
    as_times,
    check_settings,
    even_grid,
    facts_at,
    gaps_of,
    has_comma,
    interpolated,
    round_up,
    warn_of_uneven,
)
from .tables import (
    INDEX_NAMES,
    ROW,
    as_pandas,
    call_to_unfold,
    called,
    cut,
    full_names,
    own_label,
    parts_of,
)

__all__ = ["to_sequences"]

# Gaps, and performances with any, named in a message.
_SHOWN = 3


def to_sequences(df, by=None, time=None, *, frame_rate=None, max_gap=None):
    """Turn a table of frames into a list of performances.

    Do this *before* cross-validation: scikit-learn would split the table by row.

    Parameters
    ----------
    df : DataFrame of pandas or polars
        One row a frame. Without ``by`` and ``time`` its index has two levels or more: the last is
        the frame, increasing within each performance, and those before it name the performance.
        Times there that are not even are warned of.
    by : str or list of str, default=None
        Columns or index levels that together tell performances apart; rows of one performance
        need not be neighbours. By default the levels of the index before the last; a table
        without such an index is one performance if there is a ``time``.
    time : str, default=None
        The column or index level that tells the time of frames: numbers, dates, which become
        seconds from the first of them, or durations, which become seconds. It puts the frames in
        order. By default rows are frames in the order they come in.
    frame_rate : float, default=None
        Frames in a unit of ``time`` that performances shall have. By default each keeps its own.
    max_gap : float, default=None
        Longest step of ``time``, in its unit, that is bridged by a straight line. By default
        steps above 1.9 times the median step are errors.

    Returns
    -------
    list of DataFrame
        One ``(n_frames_i, n_features)`` frame a performance, in order of first appearance, indexed
        by the frame level, the time, or 0, 1, ... What ``by`` and ``time`` name are no features.
        ``attrs["performance"]`` is the label, a tuple if several levels name the performance,
        ``attrs["levels"]`` the names of the levels, and ``attrs["resampled"]``, with a ``time``,
        whether frames were interpolated. A table without ``by`` keeps the label that it has. Other
        ``attrs`` stay; what `io.read_motion` puts there of times, frame rate and events is
        that of the frames returned.

    Raises
    ------
    ValueError
        If there is no such column or level, a key or a time is missing, a time of a performance
        comes twice, or there is a gap; without ``time``, if the frames of a performance do not
        increase.

    See Also
    --------
    to_frame : The way back.

    Notes
    -----
    Frames count as evenly spaced. A performance whose times are even, but for rounding to the
    digits they are written with, is left as it is. Any other is *resampled*: every feature is
    interpolated linearly on an even grid from its first to its last time, whose step is as near as
    possible to the median of its steps, or at ``frame_rate`` from its first time on. A gap in a
    feature (NaN) stays one.

    Examples
    --------
    >>> import pandas as pd
    >>> from sklearn_motionsync import to_frame, to_sequences
    >>> df = pd.DataFrame({
    ...     "subject": ["ann"] * 5, "trial": [1, 1, 2, 2, 2], "time": [0.1, 0, 0, 0.1, 0.25],
    ...     "knee": [3, 1, 4, 5, 8],
    ... })
    >>> performances = to_sequences(df, by=["subject", "trial"], time="time")
    >>> [x.attrs["performance"] for x in performances]
    [('ann', 1), ('ann', 2)]
    >>> to_frame(performances)["knee"]
    subject  trial  time
    ann      1      0.000    1.0
                    0.100    3.0
             2      0.000    4.0
                    0.125    5.5
                    0.250    8.0
    Name: knee, dtype: float64
    """
    df = as_pandas(df)
    if not isinstance(df, pd.DataFrame):
        raise ValueError(
            f"to_sequences needs a DataFrame of pandas or polars, got {type(df).__name__}. Several "
            f"tables make one: pd.concat({{'ann': ann, 'bob': bob}}, names={list(INDEX_NAMES)}). "
            "An array makes one by pd.DataFrame(x, columns=[...]); arrays that are performances "
            "already need no table."
        )
    check_settings(frame_rate, max_gap, time)
    if by is None and time is None:
        sequences = cut(df)
        warn_of_uneven(sequences)
        return sequences
    if df.index.nlevels > 1:
        df = df.rename_axis(index=full_names(df.index.names))
    return _cut_by_columns(df, _Request(by, time, frame_rate, max_gap))


class _Request(NamedTuple):
    """What is asked for."""

    by: object
    time: object
    frame_rate: float | None
    max_gap: float | None

    def keys(self, df):
        """The columns or levels that name the performance."""
        if self.by is not None:
            is_list = isinstance(self.by, (list, tuple, pd.Index, np.ndarray))
            return list(self.by) if is_list else [self.by]
        levels = list(df.index.names)
        if self.time not in levels and (len(levels) > 1 or df.index.is_unique):
            # The time takes the place of what numbers the frames.
            levels = levels[:-1]
        return [level for level in levels if level is not None and level != self.time]

    def call(self, **other):
        """The call to make."""
        settings = {**self._asdict(), **other}
        given = [f"{name}={value!r}" for name, value in settings.items() if value is not None]
        return f"to_sequences(df, {', '.join(given)})"


def _cut_by_columns(df, request):
    keys, time = request.keys(df), request.time
    flat = _flat(df, keys, request)
    if not len(flat):
        raise ValueError("The table has no rows, so there are no performances in it.")
    features = flat.drop(columns=[*keys, *([] if time is None else [time])])
    _check_features(features, keys, request)
    names = keys or [INDEX_NAMES[0]]
    if len(keys) > 1:
        index = pd.MultiIndex.from_frame(flat[keys])
    else:
        index = pd.Index(flat[keys[0]] if keys else np.zeros(len(flat), dtype=int))
    labels, parts = parts_of(index, names)
    if keys and len(flat) == len(labels):
        _refuse_wide(df, keys)
    if not keys and own_label(df)[0] is not None:
        label, names = own_label(df)
        labels = [label]
    if time is None:
        name = ROW if INDEX_NAMES[1] in names else None
        numbered = [_indexed(features, rows, pd.RangeIndex(len(rows), name=name)) for rows in parts]
        levels = (*names, name or INDEX_NAMES[1])
        return [
            called(x, label, levels, facts_at(df.attrs, rows, len(df)))
            for x, rows, label in zip(numbered, parts, labels, strict=True)
        ]
    clock = flat[time]
    if isinstance(clock.dtype, np.dtype) and clock.dtype.kind in "fiu":
        clock = clock.to_numpy(dtype=np.float64)
    timed = [
        _in_order(clock, rows, label, keys, request)
        for rows, label in zip(parts, labels, strict=True)
    ]
    _check_gaps([times for times, _ in timed], labels, request)
    sequences = []
    for (times, rows), label in zip(timed, labels, strict=True):
        grid = even_grid(times, request.frame_rate, f"Performance {label!r}")
        index = pd.Index(times if grid is None else grid, name=time)
        x = _indexed(features, rows, index if grid is None else None)
        if grid is not None:
            x = _resampled(x, times, grid, label).set_axis(index)
        facts = facts_at(df.attrs, rows, len(df), times, grid)
        sequences.append(called(x, label, (*names, time), facts, resampled=grid is not None))
    return sequences


def _indexed(features, rows, index=None):
    """Rows of a table, a copy, under an index of their own."""
    x = features.iloc[rows]
    if index is not None:
        # In place: set_axis would copy everything once more.
        x.index = index
    return x


def _flat(df, keys, request):
    """The table with the levels that are asked for as columns."""
    named = [*keys, *([] if request.time is None else [request.time])]
    levels = [name for name in df.index.names if name in named and name not in df.columns]
    flat = df
    if levels:
        # All at once: inserting into a table of many columns makes pandas warn.
        own = pd.DataFrame({name: df.index.get_level_values(name) for name in levels})
        flat = pd.concat([own, df.reset_index(drop=True)], axis=1)
    columns = list(flat.columns)
    missing = [key for key in named if key not in columns]
    if missing or (request.by is not None and not keys):
        known = [name for name in df.index.names if name is not None]
        raise ValueError(
            f"There is no column or index level {missing}; there are the columns "
            f"{list(df.columns)[:20]} and the levels {known}. Say which of them name the "
            "performance and the time: to_sequences(df, by=[...], time=...)."
        )
    if len(set(named)) < len(named) or any(columns.count(key) > 1 for key in named):
        raise ValueError(
            f"by={request.by!r} and time={request.time!r} must be different columns, each of "
            f"which comes once; there are {columns[:20]}."
        )
    return flat


def _refuse_wide(df, keys):
    """Say what to do with performances of one row each."""
    call = call_to_unfold(df.columns, [key for key in keys if key not in df.columns])
    how = (
        f"is the table wide, frames side by side in columns? Then {call}."
        if call
        else ("name fewer columns, that tell performances apart and not frames; the time is time=.")
    )
    raise ValueError(
        f"{keys} tell {len(df)} performances of one row each apart, and a performance has 2 "
        f"frames or more: {how}"
    )


def _check_features(features, keys, request):
    """What is no number is no feature, and mostly a key that was forgotten."""
    for name, column in features.items():
        drop = f"df.drop(columns=[{name!r}])"
        if column.dtype.kind in "Mm":
            raise ValueError(
                f"Column {name!r} holds dates or durations ({column.dtype}), which are no feature. "
                f"Say {request.call(time=name)}, or drop it: {drop}."
            )
        texts = [v for v in column if isinstance(v, str)] if column.dtype.kind in "OSUT" else []
        if texts and has_comma(texts[0]):
            raise ValueError(f"Column {name!r} {COMMA.format(texts[0])}")
        told = pd.Series(texts, dtype=object)
        odd = told[pd.to_numeric(told, errors="coerce").isna()].tolist()
        if 0 < len(odd) < column.notna().sum():
            raise ValueError(
                f"Column {name!r} holds text among its numbers, such as {odd[0][:40]!r}. If that "
                f"stands for gaps, df[{name!r}] = pd.to_numeric(df[{name!r}], errors='coerce') "
                "makes them NaN; if it is a row of units, pd.read_csv(path, skiprows=[1]) leaves "
                f"it out; if the column tells performances apart, say "
                f"{request.call(by=[*keys, name])}; otherwise drop it: {drop}."
            )
        if texts:
            raise ValueError(
                f"Column {name!r} holds text, such as {texts[0][:40]!r}, which is no feature. If "
                f"it tells performances apart, say {request.call(by=[*keys, name])}; otherwise "
                f"drop it: {drop}."
            )


def _in_order(column, rows, label, keys, request):
    """Times of a performance, increasing, and its rows in this order."""
    what = f"The time of performance {label!r}"
    if isinstance(column, np.ndarray):
        times = column[rows]
    else:
        times = as_times(column.iloc[rows], what, request.time)
    if not np.isfinite(times).all():
        row = rows[np.argmin(np.isfinite(times))]
        raise ValueError(
            f"{what} is missing (NaN) or infinite in row {row}. Drop such rows: "
            f"df.dropna(subset=[{request.time!r}])."
        )
    order = np.argsort(times, kind="stable")
    times = times[order]
    twice = times[:-1][np.diff(times) == 0]
    if len(twice):
        which = f"{twice[0]:.10g}" + (f" and {len(twice) - 1} more" if len(twice) > 1 else "")
        raise ValueError(
            f"Times of performance {label!r} come twice: {which}. If its rows are of several "
            "performances, name the columns that tell them apart: "
            f"{request.call(by=[*keys, '...'])}; otherwise drop what is double: "
            f"df.drop_duplicates({[*keys, request.time]!r})."
        )
    return times, rows[order]


def _check_gaps(timed, labels, request):
    """Refuse gaps in time: frames count as evenly spaced."""
    found, longest = [], 0.0
    for times, label in zip(timed, labels, strict=True):
        gaps, usual = gaps_of(times, request.max_gap)
        if not gaps:
            continue
        longest = max([longest, *(end - start for start, end in gaps)])
        where = ", ".join(f"from {start:.10g} to {end:.10g}" for start, end in gaps[:_SHOWN])
        more = f" and {len(gaps) - _SHOWN} more" if len(gaps) > _SHOWN else ""
        found.append(
            f"Performance {label!r} has {'a gap' if len(gaps) == 1 else 'gaps'} {where}{more}, "
            f"where frames are {usual:.4g} apart."
        )
    if found:
        if len(found) > _SHOWN:
            found = [*found[:_SHOWN], f"And {len(found) - _SHOWN} more."]
        raise ValueError(
            f"{' '.join(found)} Frames count as evenly spaced: bridge gaps by straight lines, "
            f"{request.call(max_gap=round_up(longest))}, or leave such performances out."
        )


def _resampled(x, times, grid, label):
    """All features of a performance at other times."""
    columns = {
        k: interpolated(as_numbers(x.iloc[:, k], f"Performance {label!r}"), times, grid)
        for k in range(x.shape[1])
    }
    return pd.DataFrame(columns, index=range(len(grid))).set_axis(x.columns, axis=1)
