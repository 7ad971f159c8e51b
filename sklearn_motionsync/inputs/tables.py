"""Tables of frames: cut into performances that know what they are called, and put together again.

The index of a table has two or more levels: the last is the frame, those before it together name
the performance. Every performance that is cut out carries its label and the names of the levels in
``attrs``, so that lists keep them, however they are sliced.
"""

import re
import warnings
from collections import Counter

import numpy as np
import pandas as pd
from pandas.api.types import is_hashable

__all__ = [
    "FRAME",
    "INDEX_NAMES",
    "ROW",
    "as_pandas",
    "call_to_unfold",
    "called",
    "cut",
    "frame_labels",
    "frame_name",
    "full_names",
    "index_of",
    "label_of_part",
    "labels_given",
    "labels_of",
    "name_performance",
    "own_label",
    "parts_of",
    "stack_frame",
]

INDEX_NAMES = ("performance", "frame")
# What numbers the rows where "frame" tells performances apart.
ROW = "row"
# The innermost level of an index.
FRAME = INDEX_NAMES[1]
# Where a DataFrame keeps what it is called.
_LABEL, _LEVELS = "performance", "levels"
# What no performance is called by.
_TIMES = ("frame", "time")
# So many times as many numbered columns as frames are rather frames themselves.
_MANY = 5


def cut(df):
    """The performances of a table whose index names performance and frame."""
    if df.index.nlevels < 2:
        raise ValueError(
            "to_sequences needs a DataFrame whose index has the levels (performance, frame), or "
            f"more that name the performance, got an index of {df.index.nlevels} level(s). Say "
            "which columns name the performance and the time: to_sequences(df, by=['subject', "
            "'trial'], time='time'), or build the index with "
            "df.set_index(['performance', 'frame'])."
        )
    keys, frames = df.index.droplevel(-1), df.index.get_level_values(-1)
    levels = full_names(df.index.names)
    labels, parts = parts_of(keys, list(levels[:-1]), "df.reset_index()")
    _check_order(levels)
    _check_wide(df, levels, parts)
    if len(df) == len(labels) > 1 and len(levels) > 2:
        raise ValueError(
            f"An index of {len(levels)} levels names the performance by {list(levels[:-1])} and "
            f"the frame by {levels[-1]!r}: so each of the {len(labels)} performances has one "
            "frame. Say which columns or levels are which: to_sequences(df, "
            f"by={list(levels[:-2])!r}, time={levels[-2]!r}), or drop a level: "
            f"df.droplevel({levels[-1]!r})."
        )
    sequences = []
    for label, rows in zip(labels, parts, strict=True):
        own = frames[rows]
        if not own.is_monotonic_increasing or not own.is_unique:
            raise ValueError(
                f"The frames of performance {label!r} do not increase. Sort the frame with "
                "df.sort_index() and drop the frames that come twice; or say which level is the "
                f"time, to_sequences(df, time={levels[-1]!r}), which puts them in order."
            )
        sequences.append(called(df.iloc[rows].set_axis(own), label, levels, df.attrs))
    return sequences


def _check_order(levels):
    """Refuse an index whose first level tells frames, as ``pd.wide_to_long`` may make one."""
    if levels[0] in _TIMES and levels[-1] not in (*_TIMES, ROW):
        raise ValueError(
            f"An index of the levels {list(levels)} names the performance by {levels[0]!r} and the "
            f"frame by {levels[-1]!r}, and it is rather the other way round. Say which is which: "
            f"to_sequences(df, by={list(levels[1:])!r}, time={levels[0]!r})."
        )


def _check_wide(df, levels, parts):
    """Tell a table of trials in rows, whose last key would be taken for the frame."""
    longest = max(map(len, parts), default=0)
    numbers, _ = numbered_columns(df.columns) if longest < df.shape[1] else ({}, [])
    n_frames = min(numbers.values(), default=0)
    if n_frames < _MANY * max(longest, 2):
        return
    call = call_to_unfold(df.columns, list(levels))
    if call is None:
        return
    warnings.warn(
        f"A table of {len(df)} rows is read as {len(parts)} performances of {longest} frames or "
        f"less, by its index {list(levels)}, the last of which is the frame. But its columns are "
        f"numbered, up to {n_frames} of a kind: if they are the frames, make it long, {call}.",
        UserWarning,
        stacklevel=2,
    )


def as_pandas(table):
    """A table of polars as one of pandas; anything else as it is.

    Raises
    ------
    ValueError
        If it is lazy.
    """
    kind = type(table)
    if kind.__module__.partition(".")[0] != "polars":
        return table
    if kind.__name__ == "LazyFrame":
        raise ValueError("Got a polars LazyFrame, which holds no data yet: give df.collect().")
    if kind.__name__ != "DataFrame":
        return table
    return pd.DataFrame({name: table[name].to_numpy() for name in table.columns})


# -- what performances are called --------------------------------------------------------


def name_performance(i, label):
    """What to call a performance in messages and figures."""
    if isinstance(label, tuple):
        return f"Performance {i} {label!r}"
    return f"Performance {i}" if label == i else f"Performance {i} ({label!r})"


def labels_of(sequences, numbers=None):
    """Labels of performances, and the names of the levels of an index of them.

    Those that a list carries, if it does so throughout and they differ; otherwise their numbers,
    0, 1, ... by default.
    """
    frame = frame_name(sequences) or INDEX_NAMES[1]
    found = [own_label(x) for x in sequences]
    labels = [label for label, _ in found]
    names = {levels for _, levels in found}
    if len(names) == 1 and None not in names and len(set(labels)) == len(labels):
        return labels, (*names.pop(), frame)
    return list(range(len(sequences)) if numbers is None else numbers), (INDEX_NAMES[0], frame)


def own_label(x):
    """The label that a DataFrame carries, and its level names without the last; None if none."""
    if not isinstance(x, pd.DataFrame):
        return None, None
    label, levels = x.attrs.get(_LABEL), x.attrs.get(_LEVELS, INDEX_NAMES)
    if label is None or not isinstance(levels, (tuple, list)):
        return None, None
    levels = tuple(levels)[:-1]
    fits = len(levels) == 1 or (isinstance(label, tuple) and len(levels) == len(label))
    return (label, levels) if fits and is_hashable((label, levels)) else (None, None)


def label_of_part(whole, part, level, levels=()):
    """The label of a part of a recording, behind that of the recording, as ``attrs``.

    Parameters
    ----------
    whole : hashable
        What the recording is called; a tuple has several levels.
    part : hashable
    level : str
        What the level of parts is called, unless the recording has one of that name.
    levels : sequence of str, default=()
        Names of the levels of the recording, with that of the frames, if it has any.
    """
    before = whole if isinstance(whole, tuple) else (whole,)
    names = tuple(levels)[:-1]
    if len(names) != len(before):
        several = len(before) > 1
        names = tuple(f"recording_{k}" if several else "recording" for k in range(len(before)))
    last = level if level not in names else f"{level}_{len(names) + 1}"
    return {_LABEL: (*before, part), _LEVELS: (*names, last, FRAME)}


def labels_given(performances):
    """Labels that somebody gave, of performances that have them or by themselves, and level names.

    Parameters
    ----------
    performances : list of labels, Index, or list of DataFrame
    """
    if isinstance(performances, pd.Index):
        names = [*performances.names, None]
        return [_plain(label) for label in performances], full_names(names)[:-1]
    labels = list(performances)
    if labels and all(isinstance(x, pd.DataFrame) for x in labels):
        labels, levels = labels_of(labels)
        return labels, levels[:-1]
    return labels, INDEX_NAMES[:1]


def frame_labels(sequences):
    return [x.index if isinstance(x, pd.DataFrame) else range(len(x)) for x in sequences]


def frame_name(sequences):
    """What frames of DataFrames are called; None if they are not called anything."""
    names = {x.index.name if isinstance(x, pd.DataFrame) else None for x in sequences}
    return names.pop() if len(names) == 1 else None


def index_of(labels, names):
    """An index of labels; of several levels if there are several names."""
    if len(names) == 1:
        return pd.Index(list(labels), tupleize_cols=False, name=names[0])
    return pd.MultiIndex.from_tuples(list(labels), names=names)


def stack_frame(arrays, labels, frames, columns, levels=INDEX_NAMES):
    """Arrays below each other under an index of performance, of one level or more, and frame.

    Without ``frames`` they are numbered.
    """
    counts = [len(a) for a in arrays]
    frames = frames or [range(n) for n in counts]
    keys = index_of(labels, levels[:-1]).repeat(counts)
    index = pd.MultiIndex.from_arrays(
        [
            *(keys.get_level_values(k) for k in range(keys.nlevels)),
            np.concatenate([np.asarray(f) for f in frames]),
        ],
        names=levels,
    )
    return pd.DataFrame(np.concatenate(list(arrays)), index=index, columns=columns)


def called(x, label, levels, attrs, **more):
    x.attrs = {**attrs, _LABEL: label, _LEVELS: tuple(levels), **more}
    return x


def full_names(names):
    """Names for the levels that have none."""
    usual = [INDEX_NAMES[0]] if len(names) == 2 else [f"level_{k}" for k in range(len(names) - 1)]
    usual.append(INDEX_NAMES[1])
    return tuple(other if name is None else name for name, other in zip(names, usual, strict=True))


# -- how they are cut out -----------------------------------------------------------------


def parts_of(keys, names, table="df"):
    """Labels in order of first appearance, and the rows of each."""
    for k, name in enumerate(names):
        missing = np.flatnonzero(pd.isna(keys.get_level_values(k)))
        if len(missing):
            raise ValueError(
                f"{name!r} is missing (NaN) in {len(missing)} of {len(keys)} rows, the first is "
                f"row {missing[0]}, which so belong to no performance. Drop them, "
                f"{table}.dropna(subset=[{name!r}]), or fill them in."
            )
    codes, labels = pd.factorize(keys)
    order = np.argsort(codes, kind="stable")
    ends = np.searchsorted(codes[order], np.arange(1, len(labels)))
    return [_plain(label) for label in labels], np.split(order, ends) if len(labels) else []


def _plain(label):
    """A label without NumPy's types, whose representation says what they are."""
    if isinstance(label, tuple):
        return tuple(map(_plain, label))
    return label.item() if isinstance(label, np.generic) else label


# -- wide tables: one row a performance, frames side by side in columns. Told, not read --

# What tells rows apart that no column does.
_KEY = "performance"


def numbered_columns(columns):
    """Which columns are numbered, such as ``knee_1``, ``knee_2``, ...

    Returns
    -------
    numbers : dict of (str, str) to int
        How many there are of each name and what is between name and number; two at least.
    others : list
        All other columns.
    """
    parts = {name: re.fullmatch(r"(.*?)([_\-. ]?)\d+", str(name)) for name in columns}
    counts = Counter(part.groups() for part in parts.values() if part)
    numbers = {key: count for key, count in counts.items() if count > 1}
    return numbers, [
        name for name in columns if not parts[name] or parts[name].groups() not in numbers
    ]


def call_to_unfold(columns, levels=()):
    """The call that makes a long table of one whose frames lie side by side in columns.

    Parameters
    ----------
    columns : Index
    levels : list of str
        Levels of the index that name the performance, beside columns that are not numbered.

    Returns
    -------
    str or None
        None if no columns are numbered, or not alike.
    """
    numbers, others = numbered_columns(columns)
    names, between = [name for name, _ in numbers], {sep for _, sep in numbers}
    if len(between) != 1 or ("" in names and len(names) > 1):
        return None
    keys, table = [*levels, *others], "df.reset_index()" if levels else "df"
    if not keys:
        keys, table = [_KEY], f"df.reset_index(names={_KEY!r})"
    if names == [""]:
        long = f"{table}.melt({keys}, var_name='frame', value_name='x').astype({{'frame': float}})"
        return f"to_sequences({long}.dropna(), by={keys}, time='frame')"
    long = f"pd.wide_to_long({table}, {names}, i={keys}, j='frame', sep={between.pop()!r})"
    return f"to_sequences({long}.dropna(), time='frame')"
