"""The one input contract: what a set of performances is, and nothing else.

A set of performances is a plain list of 2-D arrays ``(n_frames_i, n_features)``. A
3-D array, a 1-D object array, a list of DataFrames (of pandas or polars) and a DataFrame
indexed by performance, in one level or more, and frame are the same thing. A 2-D array is
read by rows: postures for the posture-level estimators, univariate sequences for the
sequence-level ones.

Any other sequence that gives performances by index, ``len(X)`` and ``X[i]``, such as one that opens
a file for each, or a 3-D data set on disk, is a list of them, too: each is read once, one after the
other. Synchronizers read it, and memory maps, in parts when they transform and match, and only what
they need for a fit to a sample (``max_fit``); everybody else takes it into memory. The first
performance that is read in parts tells the precision of all: beside single precision, double
precision is refused.
"""

from collections.abc import Mapping

import numpy as np
import pandas as pd
from scipy.sparse import issparse

from .numbers import (
    FLOATS,
    LARGEST,
    SMALLEST,
    as_numbers,
    check_finite,
    names_of,
    refuse_magnitude,
)
from .resampling import warn_of_uneven
from .tables import (
    INDEX_NAMES,
    as_pandas,
    cut,
    frame_labels,
    labels_given,
    labels_of,
    name_performance,
    stack_frame,
)

__all__ = [
    "ACCEPTED",
    "NOT_ONE",
    "Performances",
    "as_collection",
    "as_source",
    "check_members",
    "count_of",
    "gives_rows",
    "taken",
    "to_frame",
]

ACCEPTED = (
    "A set of performances is a list of 2-D arrays (n_frames, n_features), a 3-D array "
    "(n_sequences, n_frames, n_features) or a DataFrame indexed by (performance, frame)"
)
NOT_ONE = f"{ACCEPTED}; got a single 2-D input. Wrap one performance as [X]."


def to_frame(sequences, *, performances=None, columns=None):
    """Turn performances into one frame that is indexed by performance and frame.

    Parameters
    ----------
    sequences : list of 2-D arrays or DataFrames, or 3-D array
        Performances ``(n_frames_i, n_features)``.
    performances : sequence of length n_sequences, default=None
        Labels, or an index of one level or several, whose names are taken; or the DataFrames of
        `to_sequences`, whose labels and names are. By default those that the sequences have from
        there, or 0, 1, ...
    columns : sequence of str, default=None
        Names of the features; by default those of the DataFrames, or 0, 1, ...

    Returns
    -------
    DataFrame
        The concatenated performances. The index levels are ``performance`` and ``frame``, or what
        they are called in the table that labels and frames come from.

    Raises
    ------
    ValueError
        If the performances do not agree in width or names, or a label is missing or
        given twice.

    See Also
    --------
    to_sequences : The way back.

    Examples
    --------
    >>> import numpy as np
    >>> import pandas as pd
    >>> from sklearn_motionsync import to_frame
    >>> X = [np.zeros((2, 1)), np.ones((3, 1))]
    >>> df = to_frame(X, columns=["knee"])
    >>> df.loc[1, "knee"].tolist()
    [1.0, 1.0, 1.0]
    >>> labels = pd.MultiIndex.from_tuples([("ann", 1), ("ann", 2)], names=["who", "trial"])
    >>> to_frame(X, performances=labels, columns=["knee"]).loc["ann"].loc[2].shape
    (3, 1)
    """
    sequences = as_collection(sequences)
    if sequences is None:
        raise ValueError(NOT_ONE)
    arrays = check_members(sequences, finite=False)
    labels, levels, names = arrays.labels, arrays.levels, arrays.names
    if performances is not None:
        labels, outer = labels_given(performances)
        levels = (*outer, levels[-1])
    if len(labels) != len(arrays) or len(set(labels)) != len(labels):
        raise ValueError(
            f"performances must be {len(arrays)} different labels, one a performance, "
            f"got {len(labels)} of which {len(set(labels))} differ."
        )
    columns = names if columns is None else list(columns)
    if columns is not None and len(columns) != arrays[0].shape[1]:
        raise ValueError(
            f"columns must name the {arrays[0].shape[1]} features, one each; got {len(columns)}."
        )
    return stack_frame(arrays, labels, arrays.frames, columns, levels)


# -- how the kinds are told apart ---------------------------------------------------


def as_collection(X):
    """The performances of a collection as a list; None for what scikit-learn calls 2-D."""
    X = as_pandas(X)
    if isinstance(X, pd.DataFrame):
        if X.index.nlevels < 2:
            return None
        sequences = cut(X)
        warn_of_uneven(sequences)
        return sequences
    if issparse(X):
        return None
    if isinstance(X, dict):
        raise ValueError(
            f"{ACCEPTED}, got dict. Use list(X.values()); or, of tables, pd.concat(X, "
            f"names={list(INDEX_NAMES)}), which keeps what they are called."
        )
    if isinstance(X, (set, frozenset, str, bytes)) or _has_no_order(X):
        raise ValueError(f"{ACCEPTED}, got {type(X).__name__}. Use list(...) of the arrays.")
    if isinstance(X, np.ndarray):
        if X.ndim == 3:
            return list(X)
        if X.ndim > 3:
            raise ValueError(f"{ACCEPTED}, got an array of shape {X.shape}.")
        X = list(X) if X.dtype == object and X.ndim == 1 else None
    if isinstance(X, (list, tuple)):
        plain = set(map(type, X)) == {np.ndarray}
        if plain and max([x.ndim for x in X]) >= 2:
            return list(X)
        items = [as_pandas(x) for x in X]
        return items if len(items) == 0 or _holds_matrices(items) else None
    source = as_source(X)
    return None if source is None else [source[i] for i in range(len(source))]


def as_source(X):
    """What is better read in parts: given by index, or memory maps; None for all else.

    It is looked at for no longer than it takes to tell.
    """
    if isinstance(X, np.ndarray):
        return X if isinstance(X, np.memmap) and X.ndim == 3 else None
    if isinstance(X, (list, tuple)):
        return X if len(X) and all(isinstance(x, np.memmap) and x.ndim == 2 for x in X) else None
    # A matrix, or a column of objects, is what it says it is.
    if not _has_items(X) or (hasattr(X, "__array__") and getattr(X, "ndim", 0) != 3):
        return None
    first = as_pandas(X[0]) if len(X) else None
    return _Source(X, first) if first is None or _depth(first) >= 2 else None


def gives_rows(X):
    """Whether what is no list and no array gives the rows of a matrix by index."""
    if not _has_items(X):
        return False
    if hasattr(X, "__array__"):
        return getattr(X, "ndim", 0) == 2
    return len(X) > 0 and _depth(X[0]) == 1


def _has_no_order(X):
    """Whether an object has items, but does not give them by number, or not how many there are."""
    if isinstance(X, pd.Series):
        return X.dtype == object and any(_depth(x) >= 2 for x in X)
    has = [hasattr(X, name) for name in ("__iter__", "__len__", "__getitem__")]
    return not hasattr(X, "__array__") and any(has) and not all(has[1:])


def _has_items(X):
    """Whether an object gives something by index, and is not of a kind that has other items."""
    other = isinstance(X, (Mapping, set, frozenset, str, bytes, pd.DataFrame)) or issparse(X)
    if other or not (hasattr(X, "__len__") and hasattr(X, "__getitem__")):
        return False
    return not isinstance(as_pandas(X), pd.DataFrame)


class _Source:
    """A sequence that gives performances by index, of which the first has been read."""

    def __init__(self, given, first):
        self._given, self._first = given, first

    def __len__(self):
        return len(self._given)

    def __getitem__(self, i):
        if i == 0 and self._first is not None:
            first, self._first = self._first, None
            return first
        return as_pandas(self._given[i])


def count_of(X):
    """How many performances there are, or rows."""
    return X.shape[0] if hasattr(X, "shape") else len(X)


def taken(X, indices):
    """Some performances, or rows, by their indices; nothing else is read."""
    if isinstance(X, np.ndarray):
        return X[indices]
    if isinstance(X, pd.DataFrame):
        return X.iloc[indices]
    return [X[int(i)] for i in indices]


def _holds_matrices(items):
    """Whether a list holds performances rather than the rows of a matrix."""
    depths = [_depth(item) for item in items]
    if max(depths, default=0) >= 2:
        return True
    lengths = {len(item) for item, depth in zip(items, depths, strict=True) if depth == 1}
    if len(lengths) > 1:
        raise ValueError(
            f"{ACCEPTED}. Performance 0 has {len(items[0])} values in one dimension and others "
            "have other lengths: give univariate performances as columns, x[:, np.newaxis]."
        )
    return False


def _depth(item):
    if hasattr(item, "ndim"):
        return item.ndim
    if isinstance(item, (list, tuple)):
        return 1 + max((_depth(inner) for inner in item), default=0)
    return np.ndim(item) if hasattr(item, "__array__") else 0


# -- checks -------------------------------------------------------------------------


class Performances(tuple):
    """Checked performances: arrays of one dtype, and what it takes to give the same kind back.

    The arrays are views of the input where its dtype allows: never write to them.

    Attributes
    ----------
    kind : {"rows", "array", "list", "frame"}
        2-D, 3-D, list, MultiIndex frame.
    labels : list
        Of the performances; tuples where several levels name them.
    frames : list
        Labels of the frames of each performance of a table; empty where they are numbered.
    names : sequence of str or None
        Names of the features; after `check_performances` ``feature_names_in_`` of the estimator.
    levels : tuple of str
        Names of the levels of an index; the last is that of the frames.
    numbers : sequence of int
        The index of each in all that was given.
    """

    def __new__(cls, arrays, kind, labels, frames=(), names=None, levels=INDEX_NAMES, numbers=None):
        self = super().__new__(cls, arrays)
        self.kind, self.labels, self.frames, self.names = kind, labels, frames, names
        self.levels = levels
        self.numbers = range(len(self)) if numbers is None else numbers
        return self

    def __getitem__(self, index):
        if isinstance(index, slice):
            return self.take(range(len(self))[index])
        return super().__getitem__(index)

    def called(self, i):
        """What to call one of them in messages."""
        return name_performance(self.numbers[i], self.labels[i])

    def take(self, indices):
        """Some of them: rows, or a list."""
        kind = "rows" if self.kind == "rows" else "list"
        frames = [self.frames[i] for i in indices] if self.frames else []
        labels = [self.labels[i] for i in indices]
        numbers = [self.numbers[i] for i in indices]
        some = map(super().__getitem__, indices)
        return Performances(some, kind, labels, frames, self.names, self.levels, numbers)


def check_members(sequences, *, finite=True, training=True, numbers=None, dtype=None):
    """Check the performances of a collection in one pass.

    Parameters
    ----------
    sequences : list
    finite : {True, False, "allow-nan"}, default=True
        As in scikit-learn. False: their magnitude is free, too.
    training : bool, default=True
        Whether to refuse a set all of whose values are tiny; large ones always are.
    numbers : sequence of int, default=None
        The index of each in all that was given; by default 0, 1, ...
    dtype : dtype, default=None
        Of those before: by default single precision if all of these are.

    Returns
    -------
    Performances
        Of the kind "list", with the names of the columns (None without names).
    """
    if len(sequences) == 0:
        raise ValueError(f"Found 0 performances (n_samples=0), at least 1 is needed. {ACCEPTED}.")
    numbers = range(len(sequences)) if numbers is None else numbers
    labels, levels, frames, names = list(numbers), INDEX_NAMES, [], None
    tables = any([issubclass(kind, pd.DataFrame) for kind in set(map(type, sequences))])
    if tables:
        labels, levels = labels_of(sequences, numbers)
        frames, names = frame_labels(sequences), names_of(sequences[0])
    arrays, width, largest, holder = [], None, 0.0, 0
    for i, x in enumerate(sequences):
        # Nothing is called for a plain array but NumPy itself.
        if type(x) is np.ndarray and x.dtype in FLOATS:
            array = x
        else:
            array = as_numbers(x, name_performance(numbers[i], labels[i]))
        if array.ndim != 2 or array.shape[0] < 2 or array.shape[1] < 1:
            _refuse_shape(array, name_performance(numbers[i], labels[i]))
        if width is None:
            width = array.shape[1]
        if array.shape[1] != width:
            raise ValueError(
                f"{name_performance(numbers[i], labels[i])} has {array.shape[1]} features a frame, "
                f"performance {numbers[0]} has {width}. All performances need the same features "
                "in the same order."
            )
        if tables and names_of(x) != names:
            raise ValueError(
                f"{name_performance(numbers[i], labels[i])} has the columns {names_of(x)}, "
                f"performance {numbers[0]} has {names}. All performances need the same columns in "
                "the same order."
            )
        if dtype == np.float32 and array.dtype != dtype:
            raise ValueError(
                f"{name_performance(numbers[i], labels[i])} is {array.dtype}, and those before are "
                "float32: what is read in parts has the precision of the first. Give all as "
                "x.astype(np.float32)."
            )
        if finite:
            high, low = array.max(), -array.min()
            peak = high if high > low else low
            if not peak <= LARGEST:
                what = f"{name_performance(numbers[i], labels[i])}, frame"
                own = frames[i] if tables else None
                check_finite(array, what, names, own, allow_nan=finite == "allow-nan")
                peak = np.fmax.reduce(np.abs(array), axis=None, initial=0)
            if peak > largest:
                largest, holder = peak, i
        arrays.append(array)
    if largest > LARGEST or (training and 0 < largest < SMALLEST):
        refuse_magnitude(largest, name_performance(numbers[holder], labels[holder]))
    if dtype is None:
        dtype = np.float32 if {a.dtype for a in arrays} == {np.dtype(np.float32)} else np.float64
    # Row by row in memory, so that no result depends on the layout of the input.
    arrays = [np.ascontiguousarray(a, dtype=dtype) for a in arrays]
    return Performances(arrays, "list", labels, frames, names, levels, numbers)


def _refuse_shape(array, what):
    if array.ndim != 2:
        raise ValueError(
            f"{what} has shape {array.shape}, expected (n_frames, n_features). Give a "
            "univariate performance as a column, x[:, np.newaxis]."
        )
    raise ValueError(
        f"{what} has shape {array.shape}; a performance needs at least 2 frames and "
        "1 feature. Drop it from the list."
    )
