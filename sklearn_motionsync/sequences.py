"""The one input contract: what a set of performances is, and nothing else.

A set of performances is a plain list of 2-D arrays ``(n_frames_i, n_features)``. A
3-D array, a 1-D object array, a list of DataFrames and a ``(performance, frame)``
MultiIndex DataFrame are the same thing. A 2-D array is read by rows: postures for
the posture-level estimators, univariate sequences for the sequence-level ones.
"""

import numpy as np
import pandas as pd
from scipy.sparse import issparse

from .gate import as_numbers, check_finite, names_of

__all__ = [
    "ACCEPTED",
    "NOT_ONE",
    "as_collection",
    "check_members",
    "frame_labels",
    "stack_frame",
    "to_frame",
    "to_sequences",
]

ACCEPTED = (
    "A set of performances is a list of 2-D arrays (n_frames, n_features), a 3-D array "
    "(n_sequences, n_frames, n_features) or a DataFrame indexed by (performance, frame)"
)
NOT_ONE = f"{ACCEPTED}; got a single 2-D input. Wrap one performance as [X]."
_INDEX_NAMES = ("performance", "frame")


def to_sequences(df):
    """Turn a ``(performance, frame)`` MultiIndex frame into a list of performances.

    Do this *before* cross-validation: scikit-learn would split the frame by row.

    Parameters
    ----------
    df : DataFrame
        Its index has two levels: the performance, and the frame within it,
        increasing within each performance. Its columns are the features.

    Returns
    -------
    list of DataFrame
        One ``(n_frames_i, n_features)`` frame a performance, in order of first
        appearance, indexed by the frame level alone.

    Raises
    ------
    ValueError
        If the index has not two levels, or the frames of a performance do not increase.

    See Also
    --------
    to_frame : The way back.

    Examples
    --------
    >>> import pandas as pd
    >>> from sklearn_motionsync import to_sequences
    >>> index = pd.MultiIndex.from_product([["a", "b"], range(3)])
    >>> df = pd.DataFrame({"knee": [0.0, 1.0, 0.0, 0.0, 2.0, 0.0]}, index=index)
    >>> [x.shape for x in to_sequences(df)]
    [(3, 1), (3, 1)]
    """
    if not isinstance(df, pd.DataFrame) or df.index.nlevels != 2:
        levels = df.index.nlevels if isinstance(df, pd.DataFrame) else None
        got = f"an index of {levels} level(s)" if levels else type(df).__name__
        raise ValueError(
            "to_sequences needs a DataFrame whose index has the two levels (performance, "
            f"frame), got {got}. Build one with df.set_index(['performance', 'frame'])."
        )
    sequences = []
    for label, part in df.groupby(level=0, sort=False, dropna=False):
        sequence = part.droplevel(0)
        if not sequence.index.is_monotonic_increasing or not sequence.index.is_unique:
            raise ValueError(
                f"The frames of performance {label!r} do not increase. Sort the frame with "
                "df.sort_index() and drop the frames that come twice."
            )
        sequences.append(sequence)
    return sequences


def to_frame(sequences, *, performances=None, columns=None):
    """Turn performances into one ``(performance, frame)`` MultiIndex frame.

    Parameters
    ----------
    sequences : list of 2-D arrays or DataFrames, or 3-D array
        Performances ``(n_frames_i, n_features)``.
    performances : sequence of length n_sequences, default=None
        Labels of the first index level; by default 0, 1, ...
    columns : sequence of str, default=None
        Names of the features; by default those of the DataFrames, or 0, 1, ...

    Returns
    -------
    DataFrame
        The concatenated performances; the index levels are ``performance`` and
        ``frame``. The frames of DataFrames keep their labels.

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
    >>> from sklearn_motionsync import to_frame
    >>> df = to_frame([np.zeros((2, 1)), np.ones((3, 1))], columns=["knee"])
    >>> df.loc[1, "knee"].tolist()
    [1.0, 1.0, 1.0]
    """
    sequences = as_collection(sequences)
    if sequences is None:
        raise ValueError(NOT_ONE)
    arrays, names = check_members(sequences, finite=False)
    labels = range(len(arrays)) if performances is None else list(performances)
    if len(labels) != len(arrays) or len(set(labels)) != len(labels):
        raise ValueError(
            f"performances must be {len(arrays)} different labels, one a performance, "
            f"got {len(labels)} of which {len(set(labels))} differ."
        )
    columns = names if columns is None else columns
    return stack_frame(arrays, labels, frame_labels(sequences), columns)


# -- how the kinds are told apart ---------------------------------------------------


def as_collection(X):
    """The performances of a collection as a list; None for what scikit-learn calls 2-D."""
    if isinstance(X, pd.DataFrame):
        return to_sequences(X) if X.index.nlevels == 2 else None
    if issparse(X):
        return None
    if isinstance(X, (dict, set, frozenset, str, bytes)) or hasattr(X, "__next__"):
        raise ValueError(f"{ACCEPTED}, got {type(X).__name__}. Use list(...) of the arrays.")
    if isinstance(X, np.ndarray):
        if X.ndim == 3:
            return list(X)
        if X.ndim > 3:
            raise ValueError(f"{ACCEPTED}, got an array of shape {X.shape}.")
        is_collection = X.dtype == object and X.ndim == 1 and _holds_matrices(X)
        return list(X) if is_collection else None
    if isinstance(X, (list, tuple)):
        return list(X) if len(X) == 0 or _holds_matrices(X) else None
    return None


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


def check_members(sequences, *, finite=True, labels=None):
    """Arrays of one dtype, and the column names they share (None without names)."""
    if len(sequences) == 0:
        raise ValueError(f"Found 0 performances (n_samples=0), at least 1 is needed. {ACCEPTED}.")
    called = [f"Performance {i}" for i in range(len(sequences))]
    if labels is not None:
        called = [f"{name} ({label!r})" for name, label in zip(called, labels, strict=True)]
    arrays = [_as_matrix(what, x) for what, x in zip(called, sequences, strict=True)]
    names, width = names_of(sequences[0]), arrays[0].shape[1]
    for what, x, array in zip(called, sequences, arrays, strict=True):
        if array.shape[1] != width:
            raise ValueError(
                f"{what} has {array.shape[1]} features a frame, performance 0 has "
                f"{width}. All performances need the same features in the same order."
            )
        if names_of(x) != names:
            raise ValueError(
                f"{what} has the columns {names_of(x)}, performance 0 has {names}. "
                "All performances need the same columns in the same order."
            )
        if finite:
            frames = x.index if isinstance(x, pd.DataFrame) else None
            check_finite(array, f"{what}, frame", names, frames)
    dtype = np.float32 if all(a.dtype == np.float32 for a in arrays) else np.float64
    # Row by row in memory, so that no result depends on the layout of the input.
    return [np.ascontiguousarray(a, dtype=dtype) for a in arrays], names


def _as_matrix(what, x):
    """One performance as a float array (n_frames, n_features) of at least 2 frames."""
    array = as_numbers(x, what)
    if array.ndim != 2:
        raise ValueError(
            f"{what} has shape {array.shape}, expected (n_frames, n_features). Give a "
            "univariate performance as a column, x[:, np.newaxis]."
        )
    if array.shape[0] < 2 or array.shape[1] < 1:
        raise ValueError(
            f"{what} has shape {array.shape}; a performance needs at least 2 frames and "
            "1 feature. Drop it from the list."
        )
    return array


def frame_labels(sequences):
    return [x.index if isinstance(x, pd.DataFrame) else range(len(x)) for x in sequences]


def stack_frame(arrays, labels, frames, columns):
    """Arrays below each other under a (performance, frame) MultiIndex."""
    lengths = [len(a) for a in arrays]
    index = pd.MultiIndex.from_arrays(
        [
            pd.Index(list(labels)).repeat(lengths),
            np.concatenate([np.asarray(f) for f in frames]),
        ],
        names=_INDEX_NAMES,
    )
    return pd.DataFrame(np.concatenate(list(arrays)), index=index, columns=columns)
