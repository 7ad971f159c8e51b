"""The one input contract: what a set of performances is, and nothing else.

A set of performances is a plain list of 2-D arrays ``(n_frames_i, n_features)``. A
3-D array, a 1-D object array, a list of DataFrames and a ``(performance, frame)``
MultiIndex DataFrame are the same thing. A 2-D array is read by rows: postures for
the posture-level estimators, univariate sequences for the sequence-level ones.
"""

from typing import NamedTuple

import numpy as np
import pandas as pd
from scipy.sparse import issparse
from sklearn.base import BaseEstimator
from sklearn.utils._set_output import _get_output_config
from sklearn.utils.validation import validate_data

__all__ = ["to_frame", "to_sequences"]

_ACCEPTED = (
    "A set of performances is a list of 2-D arrays (n_frames, n_features), a 3-D array "
    "(n_sequences, n_frames, n_features) or a DataFrame indexed by (performance, frame)"
)
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
    sequences, arrays, names = read_collection(sequences)
    labels = range(len(arrays)) if performances is None else list(performances)
    if len(labels) != len(arrays) or len(set(labels)) != len(labels):
        raise ValueError(
            f"performances must be {len(arrays)} different labels, one a performance, "
            f"got {len(labels)} of which {len(set(labels))} differ."
        )
    columns = names if columns is None else columns
    return _stack(arrays, labels, _frame_labels(sequences), columns)


def read_collection(X):
    """Members, arrays and column names of a collection of any kind, which may have gaps.

    For what comes along with performances; their estimators use ``check_performances``.
    """
    sequences = as_collection(X)
    if sequences is None:
        raise ValueError(f"{_ACCEPTED}; got a single 2-D input. Wrap one performance as [X].")
    return sequences, *_check_members(sequences, finite=False)


class Performances(NamedTuple):
    """A checked set of performances and what it takes to give the same kind back.

    ``arrays`` hold views of the input where its dtype allows: never write to them.
    """

    arrays: list
    kind: str
    labels: list
    frames: list


def check_performances(estimator, X, *, reset, level):
    """Check the input of an estimator against the contract.

    Parameters
    ----------
    estimator : estimator
        Gets ``n_features_in_`` (features of a frame) and ``feature_names_in_``.
    X : the input, of any kind the contract names
    reset : bool
        True in ``fit``.
    level : {"posture", "sequence"}
        How a 2-D input is read.

    Returns
    -------
    Performances
        ``kind`` is "rows" (2-D), "array" (3-D), "list" or "frame" (MultiIndex).
    """
    sequences = as_collection(X)
    if sequences is None:
        return _check_rows(estimator, X, reset=reset, level=level)
    name = type(estimator).__name__
    if not reset and getattr(estimator, "_fitted_on_rows", False):
        raise ValueError(
            f"{name} was fitted on a 2-D array of univariate sequences (n_sequences, "
            f"{estimator.n_features_in_}) and got a collection of performances. Give it 2-D "
            "input, or fit it on a collection."
        )
    arrays, names = _check_members(sequences)
    if not reset and arrays[0].shape[1] != estimator.n_features_in_:
        raise ValueError(
            f"Performance 0 has {arrays[0].shape[1]} features a frame, but {name} is "
            f"expecting {estimator.n_features_in_} features as input."
        )
    first = arrays[0] if names is None else pd.DataFrame(arrays[0], columns=names)
    validate_data(estimator, first, reset=reset, skip_check_array=True)
    if reset and level == "sequence":
        estimator._fitted_on_rows = False
    if isinstance(X, pd.DataFrame):
        kind, labels = "frame", list(X.index.unique(level=0))
    else:
        kind, labels = "list", list(range(len(arrays)))
        if getattr(X, "ndim", 1) == 3:
            kind = "array"
    return Performances(arrays, kind, labels, _frame_labels(sequences))


def check_transformed(estimator, X, n_features):
    """Check the input of ``inverse_transform``: postures of ``n_features`` values."""
    space = type(type(estimator).__name__, (BaseEstimator,), {})()
    space.n_features_in_ = n_features
    return check_performances(space, X, reset=False, level="posture")


def restore(estimator, performances, arrays, *, frames=None, columns=None):
    """Give transformed arrays back as the kind of the input, or as a MultiIndex frame.

    ``frames`` replaces the frame labels of the input where its time was changed,
    ``columns`` the names of the estimator's outputs.
    """
    if performances.kind == "rows":
        return arrays[0]
    container = _get_output_config("transform", estimator)["dense"]
    if container == "pandas":
        labels = performances.frames if frames is None else [frames] * len(arrays)
        columns = estimator.get_feature_names_out() if columns is None else columns
        return _stack(arrays, performances.labels, labels, columns)
    if container != "default":
        raise ValueError(
            f"{type(estimator).__name__} has no {container!r} output for a collection of "
            "performances; use set_output(transform='pandas') or 'default'."
        )
    if performances.kind == "array" or isinstance(arrays, np.ndarray):
        return np.stack(arrays) if isinstance(arrays, list) else arrays
    return arrays


# -- how the kinds are told apart ---------------------------------------------------


def as_collection(X):
    """The performances of a collection as a list; None for what scikit-learn calls 2-D."""
    if isinstance(X, pd.DataFrame):
        return to_sequences(X) if X.index.nlevels == 2 else None
    if issparse(X):
        return None
    if isinstance(X, (dict, set, frozenset, str, bytes)) or hasattr(X, "__next__"):
        raise ValueError(f"{_ACCEPTED}, got {type(X).__name__}. Use list(...) of the arrays.")
    if isinstance(X, np.ndarray):
        if X.ndim == 3:
            return list(X)
        if X.ndim > 3:
            raise ValueError(f"{_ACCEPTED}, got an array of shape {X.shape}.")
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
            f"{_ACCEPTED}. Performance 0 has {len(items[0])} values in one dimension and others "
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


def _check_rows(estimator, X, *, reset, level):
    """A 2-D input: rows are postures, or univariate sequences."""
    name = type(estimator).__name__
    on_rows = getattr(estimator, "_fitted_on_rows", True)
    if level == "sequence" and not reset and not on_rows:
        raise ValueError(
            f"{name} was fitted on a collection of performances and got 2-D or other input: "
            f"wrap one sequence as [X]. {_ACCEPTED}."
        )
    X = validate_data(
        estimator,
        X,
        reset=reset,
        dtype=[np.float64, np.float32],
        order="C",
        ensure_all_finite=False,
    )
    _check_finite(X, "Row")
    if level == "posture":
        return Performances([X], "rows", [0], [range(len(X))])
    if X.shape[1] < 2:
        raise ValueError(
            "Each row of a 2-D input is one univariate sequence and needs at least 2 frames, got "
            f"n_features = {X.shape[1]}. For performances of several features use a list."
        )
    if reset:
        estimator._fitted_on_rows = True
    return Performances([row[:, np.newaxis] for row in X], "rows", list(range(len(X))), [])


def _check_members(sequences, *, finite=True):
    """Arrays of one dtype, and the column names they share (None without names)."""
    if len(sequences) == 0:
        raise ValueError(f"Found 0 performances (n_samples=0), at least 1 is needed. {_ACCEPTED}.")
    arrays = [_as_matrix(i, x) for i, x in enumerate(sequences)]
    names = _column_names(sequences[0])
    width = arrays[0].shape[1]
    for i, (x, array) in enumerate(zip(sequences, arrays, strict=True)):
        if array.shape[1] != width:
            raise ValueError(
                f"Performance {i} has {array.shape[1]} features a frame, performance 0 has "
                f"{width}. All performances need the same features in the same order."
            )
        if _column_names(x) != names:
            raise ValueError(
                f"Performance {i} has the columns {_column_names(x)}, performance 0 has {names}. "
                "All performances need the same columns in the same order."
            )
        if finite:
            _check_finite(array, f"Performance {i}, frame")
    dtype = np.float32 if all(a.dtype == np.float32 for a in arrays) else np.float64
    # Row by row in memory, so that no result depends on the layout of the input.
    return [np.ascontiguousarray(a, dtype=dtype) for a in arrays], names


def _as_matrix(i, x):
    """One performance as a float array (n_frames, n_features) of at least 2 frames."""
    if issparse(x):
        raise TypeError(f"Performance {i} is a sparse matrix; use x.toarray().")
    if isinstance(x, np.ma.MaskedArray) and np.ma.is_masked(x):
        raise ValueError(
            f"Performance {i} has masked values: interpolate the gaps, or drop the performance."
        )
    try:
        array = np.asarray(x)
        if array.dtype.kind not in "fc":
            array = array.astype(np.float64)
    except (TypeError, ValueError) as error:
        raise ValueError(
            f"Performance {i} is not a numeric array (n_frames, n_features): got "
            f"{type(x).__name__}, {error}."
        ) from error
    if array.dtype.kind == "c":
        raise ValueError(f"Performance {i}: complex data are not supported.")
    if array.ndim != 2:
        raise ValueError(
            f"Performance {i} has shape {array.shape}, expected (n_frames, n_features). Give a "
            "univariate performance as a column, x[:, np.newaxis]."
        )
    if array.shape[0] < 2 or array.shape[1] < 1:
        raise ValueError(
            f"Performance {i} has shape {array.shape}; a performance needs at least 2 frames and "
            "1 feature. Drop it from the list."
        )
    return array


def _check_finite(array, where):
    if np.isfinite(array).all():
        return
    frame, feature = np.argwhere(~np.isfinite(array))[0]
    what = "NaN" if np.isnan(array[frame, feature]) else "infinity"
    raise ValueError(
        f"{where} {frame}, feature {feature} is {what}; the input must be finite. Interpolate the "
        "gap, or drop the performance. (Input X contains NaN or infinity.)"
    )


def _frame_labels(sequences):
    return [x.index if isinstance(x, pd.DataFrame) else range(len(x)) for x in sequences]


def _column_names(x):
    columns = getattr(x, "columns", None)
    if columns is None or not all(isinstance(c, str) for c in columns):
        return None
    return list(columns)


def _stack(arrays, labels, frames, columns):
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
