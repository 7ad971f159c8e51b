"""The one input contract: what a set of performances is, and nothing else.

A set of performances is a plain list of 2-D arrays ``(n_frames_i, n_features)``. A
3-D array, a 1-D object array, a list of DataFrames (of pandas or polars) and a DataFrame
indexed by performance, in one level or more, and frame are the same thing. A 2-D array is
read by rows: postures for the posture-level estimators, univariate sequences for the
sequence-level ones.
"""

import numpy as np
import pandas as pd
from scipy.sparse import issparse

from .even_times import warn_of_uneven
from .gate import as_numbers, check_finite, names_of
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

__all__ = ["ACCEPTED", "NOT_ONE", "as_collection", "check_members", "to_frame"]

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
    arrays, names = check_members(sequences, finite=False)
    labels, levels = labels_of(sequences)
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
    return stack_frame(arrays, labels, frame_labels(sequences), columns, levels)


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
    if isinstance(X, (set, frozenset, str, bytes)) or hasattr(X, "__next__"):
        raise ValueError(f"{ACCEPTED}, got {type(X).__name__}. Use list(...) of the arrays.")
    if isinstance(X, np.ndarray):
        if X.ndim == 3:
            return list(X)
        if X.ndim > 3:
            raise ValueError(f"{ACCEPTED}, got an array of shape {X.shape}.")
        X = list(X) if X.dtype == object and X.ndim == 1 else None
    if isinstance(X, (list, tuple)):
        items = [as_pandas(x) for x in X]
        return items if len(items) == 0 or _holds_matrices(items) else None
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


def check_members(sequences, *, finite=True):
    """Arrays of one dtype, and the column names they share (None without names).

    ``finite`` is True, False, or "allow-nan" as in scikit-learn.
    """
    if len(sequences) == 0:
        raise ValueError(f"Found 0 performances (n_samples=0), at least 1 is needed. {ACCEPTED}.")
    called = [name_performance(i, label) for i, label in enumerate(labels_of(sequences)[0])]
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
            check_finite(array, f"{what}, frame", names, frames, allow_nan=finite == "allow-nan")
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
