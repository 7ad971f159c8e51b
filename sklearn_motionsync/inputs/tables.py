"""Tables of frames are split into trials that carry their labels, and put together again.

The index of a table has two or more levels: the last is the frame, those before it together name
the trial. Every trial that is split off carries its label and the names of the levels
in ``attrs``, so that lists keep them, however they are sliced.

Other packages have nested tables, with a row a trial and a column a feature, whose cells are
series, as sktime; and labelled arrays, whose dimensions have names and labels, as xarray.
"""

import numpy as np
import pandas as pd
from pandas.api.types import is_hashable

from .wording import counted

# Names of the levels of an index; the last is that of the frames.
INDEX_NAMES = TRIAL, FRAME = "trial", "frame"
# The level of the frames where "frame" names trials.
ROW = "row"
# Keys of ``attrs``.
_LABEL, _LEVELS = "trial", "levels"
# Names of levels of frames.
_TIMES = ("frame", "time")
# What to do with a table that does not tell its trials apart.
SPLIT = "Name the columns or levels of the trial and of the time: to_trials(df, by=..., time=...)."


def split_table(df):
    """The trials of a table whose index names trial and frame."""
    if df.index.nlevels < 2:
        raise ValueError(f"An index of 1 level(s) does not name trial and frame. {SPLIT}")
    keys, frames = df.index.droplevel(-1), df.index.get_level_values(-1)
    levels = full_names(df.index.names)
    if levels[0] in _TIMES and levels[-1] not in (*_TIMES, ROW):
        raise ValueError(
            f"An index of the levels {list(levels)} has the frame in its last level, and "
            f"{levels[0]!r} is its first. {SPLIT}"
        )
    labels, rows_by_label = rows_of_labels(keys, list(levels[:-1]))
    sequences = []
    for label, rows in zip(labels, rows_by_label, strict=True):
        index = frames[rows]
        if not index.is_monotonic_increasing or not index.is_unique:
            raise ValueError(
                f"The frames of trial {label!r} do not increase. Drop the frames that come "
                f"twice and sort the table by df.sort_index(), or by its time: {SPLIT}"
            )
        sequences.append(labelled(df.iloc[rows].set_axis(index), label, levels, df.attrs))
    return sequences


def rows_of_labels(keys, names):
    """Labels in order of first appearance, and the rows of each."""
    for k, name in enumerate(names):
        missing = np.flatnonzero(pd.isna(keys.get_level_values(k)))
        if len(missing):
            raise ValueError(
                f"{name!r} is missing (NaN) in {len(missing)} of {counted(len(keys), 'row')}, the "
                f"first is row {missing[0]}. Drop these rows or fill them in: every row needs the "
                "name of its trial."
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


# -- labels of trials -----------------------------------------------------------


def name_trial(i, label):
    """The name of a trial in messages and figures."""
    name = repr(label) if isinstance(label, tuple) else "" if label == i else f"({label!r})"
    name = name if len(name) <= 60 else f"{name[:56]} ..."
    return f"Trial {i} {name}".rstrip()


def labels_of(sequences, numbers=None):
    """Labels of trials, and the names of the levels of an index of them.

    Those that a list carries, if it does so throughout and they differ; otherwise their numbers,
    0, 1, ... by default.
    """
    frames = {x.index.name if isinstance(x, pd.DataFrame) else None for x in sequences}
    frame = (frames.pop() if len(frames) == 1 else None) or FRAME
    carried = [own_label(x) for x in sequences]
    labels = [label for label, _ in carried]
    names = {levels for _, levels in carried}
    if len(names) == 1 and None not in names and len(set(labels)) == len(labels):
        return labels, (*names.pop(), frame)
    return list(range(len(sequences)) if numbers is None else numbers), (TRIAL, frame)


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

    A recording with several levels is called by a tuple, and ``levels`` are their names and that of
    the frames. The level of parts is called ``level``, unless the recording has one of that name.
    """
    before = whole if isinstance(whole, tuple) else (whole,)
    names = tuple(levels)[:-1]
    if len(names) != len(before):
        several = len(before) > 1
        names = tuple(f"recording_{k}" if several else "recording" for k in range(len(before)))
    last = level if level not in names else f"{level}_{len(names) + 1}"
    return {_LABEL: (*before, part), _LEVELS: (*names, last, FRAME)}


def labels_given(trials):
    """Labels, and the names of their levels, from labels or from trials that carry them.

    Parameters
    ----------
    trials : list of labels, Index, or list of DataFrame
    """
    if isinstance(trials, pd.Index):
        names = [*trials.names, None]
        return [_plain(label) for label in trials], full_names(names)[:-1]
    labels = list(trials)
    if labels and all(isinstance(x, pd.DataFrame) for x in labels):
        labels, levels = labels_of(labels)
        return labels, levels[:-1]
    return labels, (TRIAL,)


def index_of(labels, names):
    """An index of labels; of several levels if there are several names."""
    if len(names) == 1:
        return pd.Index(list(labels), tupleize_cols=False, name=names[0])
    return pd.MultiIndex.from_tuples(list(labels), names=names)


def stack_frame(arrays, labels, frames, columns, levels=INDEX_NAMES):
    """Arrays below each other under an index of trial, of one level or more, and frame.

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


def labelled(x, label, levels, attrs):
    """A trial with its label and the names of its levels in ``attrs``, beside other facts."""
    x.attrs = {**attrs, _LABEL: label, _LEVELS: tuple(levels)}
    return x


def full_names(names):
    """Names for the levels that have none."""
    default = [TRIAL] if len(names) == 2 else [f"level_{k}" for k in range(len(names) - 1)]
    default.append(FRAME)
    return tuple(d if name is None else name for name, d in zip(names, default, strict=True))


# -- nested tables, and labelled arrays of xarray -----------------------------------------------


def is_nested(df):
    """Whether the first cell of a table is a series."""
    if df.shape[0] == 0 or df.shape[1] == 0 or df.dtypes.iloc[0].kind != "O":
        return False
    return np.ndim(df.iat[0, 0]) == 1


def split_nested(df):
    """The trials of a nested table.

    Raises
    ------
    ValueError
        If a cell is no series, or the cells of a row differ in length or in frames.
    """
    labels, levels = labels_given(df.index)
    sequences = []
    for label, row in zip(labels, df.to_numpy(dtype=object), strict=True):
        frames = [getattr(cell, "index", None) for cell in row]
        first = frames[0] if isinstance(frames[0], pd.Index) else pd.RangeIndex(len(row[0]))
        for name, cell, index in zip(df.columns, row, frames, strict=True):
            if np.ndim(cell) != 1:
                raise ValueError(
                    f"Column {name!r} of trial {label!r} holds {cell!r:.60}, and others "
                    f"hold a series: leave it out, as in df.drop(columns=[{name!r}])."
                )
            if len(cell) != len(first) or (isinstance(index, pd.Index) and not index.equals(first)):
                raise ValueError(
                    f"Column {name!r} of trial {label!r} has {len(cell)} frames, which are "
                    f"not the {len(first)} frames of column {df.columns[0]!r}: resample them to "
                    "the same frames."
                )
        # Each column keeps its type; their names may be of any type.
        x = pd.DataFrame({k: np.asarray(cell) for k, cell in enumerate(row)}, index=first)
        x.columns = df.columns
        sequences.append(labelled(x, label, (*levels, first.name or FRAME), df.attrs))
    return sequences


def is_labelled_array(x):
    """Whether it is a DataArray of xarray."""
    kind = type(x)
    return (kind.__module__.partition(".")[0], kind.__name__) == ("xarray", "DataArray")


def as_table(x):
    """One trial of polars or xarray as a table of pandas; anything else as it is.

    The frames of an array lie along its dimension "time" or "frame", else along the first. Its
    coordinates name rows and columns, and those of a single value are its label.
    """
    if not is_labelled_array(x) or x.ndim != 2:
        return as_pandas(x)
    frames = next((dim for dim in _TIMES if dim in x.dims), x.dims[0])
    x = x.transpose(frames, ...)
    table = x.to_pandas()
    table.columns = table.columns.set_names([None] * table.columns.nlevels)
    table.attrs = dict(x.attrs)
    levels = {name: value.item() for name, value in x.coords.items() if value.ndim == 0}
    # Of several levels there is a tuple beside its items.
    levels = {name: value for name, value in levels.items() if not isinstance(value, tuple)}
    if not levels:
        return table
    label = tuple(levels.values()) if len(levels) > 1 else next(iter(levels.values()))
    return labelled(table, label, (*levels, frames), table.attrs)


def check_dimensions(x):
    """Refuse a 3-D DataArray whose first dimension is that of the frames."""
    if is_labelled_array(x) and x.dims[0] in _TIMES:
        time, second, third = x.dims
        raise ValueError(
            f"The dimensions of the DataArray are {x.dims}, and the first tells trials "
            f"apart: give X.transpose({second!r}, {time!r}, {third!r})."
        )
