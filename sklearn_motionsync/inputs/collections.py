"""The input contract: what a set of trials is.

A set of trials is a list of 2-D arrays ``(n_frames_i, n_features)``. A 3-D array, a 1-D
object array, a list of DataFrames (of pandas or polars) and a DataFrame indexed by trial, in
one level or more, and frame are the same thing; so are a table with a series in each cell, and a
DataArray of xarray (`tables`). A 2-D array is read by rows: poses for the pose-level
estimators, univariate sequences for the sequence-level ones.

Any other sequence that gives trials by index, ``len(X)`` and ``X[i]``, such as one that opens
a file for each, or a 3-D data set on disk, is a list of them, too: each is read once, one after the
other. Synchronizers read it, and memory maps, in parts when they transform and match, and only what
they need for a fit to a sample (``max_fit``); other estimators read it into memory. The first
trial that is read in parts sets the precision of all: after single precision, double
precision is refused.
"""

from collections import Counter
from collections.abc import Mapping, Sequence
from numbers import Number
from os import PathLike

import numpy as np
import pandas as pd
from scipy.sparse import issparse

from .facts import facts_of
from .numbers import (
    FLOATS,
    LARGEST,
    SMALLEST,
    as_numbers,
    check_finite,
    check_magnitude,
    check_names,
    column_names,
    difference,
    listed,
)
from .recorded import warn_of_rows
from .tables import (
    INDEX_NAMES,
    as_pandas,
    as_table,
    check_dimensions,
    is_nested,
    labels_of,
    name_trial,
    split_nested,
    split_table,
)
from .wording import counted, within

ACCEPTED = (
    "A set of trials is a list of 2-D arrays (n_frames, n_features), a 3-D array "
    "(n_sequences, n_frames, n_features) or a DataFrame indexed by (trial, frame)"
)
NOT_ONE = f"{ACCEPTED}; got a single 2-D input. Wrap one trial as [X]."


class Trials(tuple):
    """Checked trials: arrays of one dtype, and what it takes to give the same kind back.

    The arrays are views of the input where its dtype allows: never write to them.

    The kind is "rows", "array", "list" or "frame": 2-D, 3-D, a list, or a table with a MultiIndex.
    The labels are those of the trials, tuples where several levels name them, and ``frames`` the
    labels of the frames of each trial of a table, empty where they are numbered. ``names`` are
    those of the features, or None; after `check_trials` they are ``feature_names_in_`` of the
    estimator. ``levels`` are the names of the levels of an index, of which the last is that of the
    frames. ``numbers`` are the indices in all that was given, and ``facts`` what the tables say of
    each, from `facts_of`, empty without tables. ``weights`` (n_frames_i,) are those of the frames
    of each, if gaps were filled, and ``confidence`` (n_frames_i, n_features) is how sure it is what
    was seen, if that is given.
    """

    kind: str
    labels: list
    frames: Sequence
    names: Sequence[str] | None
    levels: tuple[str, ...]
    numbers: Sequence[int]
    facts: Sequence[dict] = ()
    weights: list[np.ndarray] | None = None
    confidence: list[np.ndarray] | None = None

    def __new__(cls, arrays, kind, labels, frames=(), names=None, levels=INDEX_NAMES, numbers=None):
        self = super().__new__(cls, arrays)
        self.kind, self.labels, self.frames, self.names = kind, labels, frames, names
        self.levels = levels
        self.numbers = range(len(self)) if numbers is None else numbers
        return self

    def called(self, i):
        """The name of one of them in messages."""
        return name_trial(self.numbers[i], self.labels[i])

    def replace(self, arrays):
        """Other arrays of the same trials."""
        out = Trials(
            arrays, self.kind, self.labels, self.frames, self.names, self.levels, self.numbers
        )
        out.facts = self.facts
        return out

    def take(self, indices):
        """Some of them, by a slice or a sequence of indices: rows, or a list."""
        if isinstance(indices, slice):
            indices = range(len(self))[indices]
        kind = "rows" if self.kind == "rows" else "list"
        arrays, labels, numbers, frames = (
            [values[i] for i in indices] if values else ()
            for values in (self, self.labels, self.numbers, self.frames)
        )
        return Trials(arrays, kind, labels, frames, self.names, self.levels, numbers)


def check_members(
    sequences,
    *,
    finite=True,
    training=True,
    numbers=None,
    dtype=None,
    names=None,
    timed=False,
    advice=None,
):
    """Check the trials of a collection in one pass.

    Parameters
    ----------
    sequences : list
    finite : {True, False, "allow-nan"}, default=True
        As in scikit-learn. False: their magnitude is free, too.
    training : bool, default=True
        Whether to refuse a set of tiny values only; large values are always refused.
    numbers : sequence of int, default=None
        The index of each in all that was given; by default 0, 1, ...
    dtype : dtype, default=None
        Of those before: by default single precision if all of these are.
    names : list, default=None
        The columns of tables, in the order that is wanted; by default those of the first. A table
        that has them in another order is brought into this one.
    timed : bool, default=False
        Whether the times of frames are given, so that the index need not tell them.
    advice : str, default=None
        What to do about NaN, as for `check_finite`.

    Returns
    -------
    Trials
        Of the kind "list", with the names of the columns (None without names).
    """
    if len(sequences) == 0:
        raise ValueError(f"Found 0 trials (n_samples=0), at least 1 is needed. {ACCEPTED}.")
    numbers = range(len(sequences)) if numbers is None else numbers
    labels, levels, frames, fitted = list(numbers), INDEX_NAMES, [], names
    tables = any([issubclass(kind, pd.DataFrame) for kind in set(map(type, sequences))])
    if tables:
        labels, levels = labels_of(sequences, numbers)
        first = column_names(sequences[0])
        if first is not None and len(set(first)) < len(first):
            name, count = Counter(first).most_common(1)[0]
            raise ValueError(
                f"{name_trial(numbers[0], labels[0])} has {count} columns of the name "
                f"{name!r}: rename them, as in x.set_axis(names, axis=1)."
            )
        names = first if fitted is None or first is None else fitted
        frames = [x.index if isinstance(x, pd.DataFrame) else range(len(x)) for x in sequences]
    names = names if tables else None
    arrays, largest, holder = [], 0.0, 0

    def what(i):
        return name_trial(numbers[i], labels[i])

    for i, x in enumerate(sequences):
        columns = column_names(x) if tables else None
        if columns != names and Counter(columns) == Counter(names):
            x, columns = x[names], names
        # For a plain array nothing but NumPy itself is called.
        plain = type(x) is np.ndarray and x.dtype in FLOATS
        array = x if plain else as_numbers(x, what(i))
        if array.ndim != 2 or array.shape[0] < 2 or array.shape[1] < 1:
            raise ValueError(
                f"{what(i)} has shape {array.shape}, expected (n_frames, n_features) with at least "
                "2 frames and 1 feature. Give a univariate trial as a column, "
                "x[:, np.newaxis]; if all are (n_features, n_frames), give [x.T for x in X]; "
                "positions (n_frames, n_joints, n_dims) are given as x.reshape(len(x), -1)."
            )
        if columns != names and fitted is not None and names is fitted:
            check_names(x, names, what(i))
        elif columns != names:
            raise ValueError(
                f"{what(i)} has the columns {listed(columns)}, and {within(what(0))} has "
                f"{listed(names)}{difference(columns, names)}. All need the same columns: select "
                "them by x[names]; of files, read_motion(paths, columns='common') leaves out those "
                "that some lack."
            )
        arrays.append(array)
        if array.shape[1] != arrays[0].shape[1]:
            turned = all(len(other) == len(arrays[0]) < min(other.shape[1:]) for other in arrays)
            raise ValueError(
                f"{what(i)} has {counted(array.shape[1], 'feature')} a frame, trial "
                f"{numbers[0]} has {arrays[0].shape[1]}. All trials need the same features "
                "in the same order."
                + (" If they are (n_features, n_frames), give [x.T for x in X]." if turned else "")
            )
        if dtype == np.float32 and array.dtype != dtype:
            raise ValueError(
                f"{what(i)} is {array.dtype}, and those before are float32: what is read in parts "
                "has the precision of the first. Give all as x.astype(np.float32)."
            )
        if not finite:
            continue
        high, low = array.max(), -array.min()
        peak = high if high > low else low
        if not peak <= LARGEST:
            where, index = f"{what(i)}, frame", frames[i] if tables else None
            allow_nan = finite == "allow-nan"
            check_finite(array, where, names, index, allow_nan=allow_nan, advice=advice)
            peak = np.fmax.reduce(np.abs(array), axis=None, initial=0)
        if peak > largest:
            largest, holder = peak, i
    if not SMALLEST <= largest <= LARGEST:
        check_magnitude(largest, what(holder), training=training)
    if dtype is None:
        dtype = np.float32 if {a.dtype for a in arrays} == {np.dtype(np.float32)} else np.float64
    # Row by row in memory, so that no result depends on the layout of the input.
    arrays = [np.ascontiguousarray(a, dtype=dtype) for a in arrays]
    trials = Trials(arrays, "list", labels, frames, names, levels, numbers)
    if tables:
        trials.facts = [facts_of(x) for x in sequences]
        if not timed:
            warn_of_rows(sequences, what)
    return trials


# -- kinds of collections -----------------------------------------------------------


def as_collection(X):
    """The trials of a collection as a list; None for what scikit-learn calls 2-D."""
    # What other packages keep trials in, alone or in a list.
    for kind in set(map(type, X if isinstance(X, (list, tuple)) else [X])):
        if way := _CONTAINERS.get((kind.__module__.partition(".")[0], kind.__name__)):
            raise ValueError(f"{ACCEPTED}, got {kind.__name__}. {way}")
    if isinstance(X, (list, tuple)):
        return _members(X)
    X = as_pandas(X)
    if isinstance(X, pd.DataFrame):
        if is_nested(X):
            return split_nested(X)
        return split_table(X) if X.index.nlevels > 1 else None
    if isinstance(X, np.ndarray):
        if X.ndim == 3:
            return list(X)
        if X.ndim > 3:
            raise ValueError(
                f"{ACCEPTED}, got an array of shape {X.shape}. Positions (n_trials, n_frames, "
                "n_joints, n_dims) are given as [x.reshape(len(x), -1) for x in X]."
            )
        return _members(list(X)) if X.dtype == object and X.ndim == 1 else None
    if issparse(X):
        return None
    if isinstance(X, (dict, set, frozenset, str, bytes)) or _has_no_order(X):
        raise ValueError(
            f"{ACCEPTED}, got {type(X).__name__}. Give a list of the arrays; of tables, "
            f"pd.concat(tables, names={list(INDEX_NAMES)})."
        )
    source = as_source(X)
    return None if source is None else [source[i] for i in range(len(source))]


# Containers of other packages, by package and class, and the way from them to a list.
_CONTAINERS = {
    ("xarray", "Dataset"): "sklearn_motionsync.io.from_poses(X) gives the trials of one; of "
    "several, [x for poses in X for x in from_poses(poses)]. Of variables that are features, "
    "to_trials(X.to_dataframe(dim_order=[..., 'time'])).",
    ("skfda", "FDataGrid"): "Give list(X.data_matrix).",
}


def _members(X):
    """The trials of a list; None for the rows of a matrix."""
    if set(map(type, X)) == {np.ndarray} and max([x.ndim for x in X]) >= 2:
        return list(X)
    items = [as_table(x) for x in X]
    for i, item in enumerate(items):
        if not _depth(item) and not isinstance(item, (Number, str, bytes, PathLike, np.generic)):
            raise ValueError(f"Trial {i} is of type {type(item).__name__}. {ACCEPTED}.")
    depths = [_depth(item) for item in items]
    if not items or max(depths) >= 2:
        return items
    if len({len(item) for item, depth in zip(items, depths, strict=True) if depth == 1}) > 1:
        raise ValueError(
            f"{ACCEPTED}. Trial 0 has {counted(len(items[0]), 'value')} in one dimension and "
            "others have other lengths: give univariate trials as columns, x[:, np.newaxis]."
        )
    return None


def _depth(item):
    if hasattr(item, "ndim"):
        return item.ndim
    if isinstance(item, (list, tuple)):
        return 1 + max((_depth(inner) for inner in item), default=0)
    return np.ndim(item) if hasattr(item, "__array__") else 0


def as_source(X):
    """A collection to be read in parts: one given by index, or memory maps; None for all else."""
    if isinstance(X, np.ndarray):
        return X if isinstance(X, np.memmap) and X.ndim == 3 else None
    if isinstance(X, (list, tuple)):
        maps = set(map(type, X)) == {np.memmap} and all([x.ndim == 2 for x in X])
        return X if maps else None
    # An array-like of other dimensions is no collection.
    if not _has_items(X) or (hasattr(X, "__array__") and getattr(X, "ndim", 0) != 3):
        return None
    check_dimensions(X)
    first = as_table(X[0]) if len(X) else None
    return _Source(X, first) if first is None or _depth(first) >= 2 else None


def _has_no_order(X):
    """Whether an object gives neither the number of its items nor an item by its number."""
    if isinstance(X, pd.Series):
        return X.dtype == object and any(_depth(x) >= 2 for x in X)
    has = [hasattr(X, name) for name in ("__len__", "__getitem__")]
    return not hasattr(X, "__array__") and not all(has)


def _has_items(X):
    """Whether an object gives something by index, and is not of a kind that has other items."""
    other = isinstance(X, (Mapping, set, frozenset, str, bytes, pd.DataFrame)) or issparse(X)
    if other or not (hasattr(X, "__len__") and hasattr(X, "__getitem__")):
        return False
    return not isinstance(as_pandas(X), pd.DataFrame)


class _Source:
    """A sequence that gives trials by index, of which the first has been read."""

    def __init__(self, collection, first):
        self._collection, self._first = collection, first

    def __len__(self):
        return len(self._collection)

    def __getitem__(self, i):
        if i == 0 and self._first is not None:
            first, self._first = self._first, None
            return first
        return as_table(self._collection[i])


def count_of(X):
    """The number of trials, or of rows; None of what has none."""
    if isinstance(X, pd.DataFrame) and X.index.nlevels > 1:
        return X.index.droplevel(-1).nunique()
    shape = getattr(X, "shape", ()) or (len(X) if hasattr(X, "__len__") else None,)
    return shape[0]


def select(X, indices):
    """Some trials, or rows, by their indices; nothing else is read."""
    if isinstance(X, np.ndarray):
        return X[indices]
    if isinstance(X, pd.DataFrame):
        return X.iloc[indices]
    return [X[int(i)] for i in indices]
