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
    "INDEX_NAMES",
    "NOT_ONE",
    "as_collection",
    "check_members",
    "frame_labels",
    "frame_name",
    "stack_frame",
    "to_frame",
    "to_sequences",
]

ACCEPTED = (
    "A set of performances is a list of 2-D arrays (n_frames, n_features), a 3-D array "
    "(n_sequences, n_frames, n_features) or a DataFrame indexed by (performance, frame)"
)
NOT_ONE = f"{ACCEPTED}; got a single 2-D input. Wrap one performance as [X]."
# Steps of time this much longer than the usual one are gaps.
_GAP = 1.9
INDEX_NAMES = ("performance", "frame")


def to_sequences(df, by=None, time=None):
    """Turn a table of frames into a list of performances.

    Do this *before* cross-validation: scikit-learn would split the table by row.

    Parameters
    ----------
    df : DataFrame
        One row a frame. Without ``by`` and ``time`` its index has two levels: the performance,
        and the frame within it, increasing within each performance.
    by : str or list of str, default=None
        Columns or index levels that together tell performances apart; rows of one performance
        need not be neighbours.
    time : str, default=None
        The column or index level that tells the time of frames, evenly sampled. By default rows
        are frames in the order they come in.

    Returns
    -------
    list of DataFrame
        One ``(n_frames_i, n_features)`` frame a performance, in order of first appearance, indexed
        by the frame level, the time, or 0, 1, ... What ``by`` and ``time`` name are no features.

    Raises
    ------
    ValueError
        If there is no such column or level, the index has not two levels, or the frames or times of
        a performance do not increase, or have gaps.

    See Also
    --------
    to_frame : The way back.

    Examples
    --------
    >>> import pandas as pd
    >>> from sklearn_motionsync import to_sequences
    >>> df = pd.DataFrame({"trial": ["a", "a", "b", "b"], "time": [0, 1, 0, 1], "knee": range(4)})
    >>> [x.shape for x in to_sequences(df, by="trial", time="time")]
    [(2, 1), (2, 1)]
    >>> indexed = df.set_index(["trial", "time"])
    >>> [x.shape for x in to_sequences(indexed)]
    [(2, 1), (2, 1)]
    """
    if not isinstance(df, pd.DataFrame):
        raise ValueError(f"to_sequences needs a DataFrame, got {type(df).__name__}.")
    if by is not None:
        df = _indexed(df, [by] if isinstance(by, str) else list(by), time)
    elif time is not None:
        raise ValueError(f"time={time!r} goes with by=: say which columns name the performance.")
    if df.index.nlevels != 2:
        raise ValueError(
            "to_sequences needs a DataFrame whose index has the two levels (performance, frame), "
            f"got an index of {df.index.nlevels} level(s). Say which columns name the performance "
            "and the time: to_sequences(df, by=['subject', 'trial'], time='time'), or build the "
            "index with df.set_index(['performance', 'frame'])."
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


def _indexed(df, by, time):
    """The table indexed by performance and time; the columns that say so are no features."""
    keys = [*by, *([] if time is None else [time])]
    flat = df.reset_index([level for level in df.index.names if level in keys])
    missing = [key for key in keys if key not in flat.columns]
    if missing or not by:
        raise ValueError(
            f"There is no column or index level {missing}; there are {list(df.columns)} and "
            f"{[name for name in df.index.names if name is not None]}."
        )
    if len(set(keys)) < len(keys):
        raise ValueError(f"by={by} and time={time!r} must be different columns.")
    groups = flat.groupby(by, sort=False, dropna=False)
    label = groups.ngroup() if len(by) > 1 else flat[by[0]]
    if len(by) > 1:
        names = list(flat[by].drop_duplicates().itertuples(index=False, name=None))
        label = pd.Index(names, tupleize_cols=False).take(label)
    frame = groups.cumcount() if time is None else flat[time]
    index = pd.MultiIndex.from_arrays(
        [label, frame], names=["/".join(map(str, by)), INDEX_NAMES[1] if time is None else time]
    )
    features = flat.drop(columns=keys).set_axis(index)
    if time is not None:
        _check_sampling(features)
    return features


def _check_sampling(df):
    """Refuse times with gaps: frames count as evenly spaced."""
    for label, part in df.groupby(level=0, sort=False, dropna=False):
        times = as_numbers(
            part.index.get_level_values(1).to_numpy(), f"The time of performance {label!r}"
        )
        steps = np.diff(times)
        if not np.isfinite(times).all() or (steps <= 0).any():
            i = int(np.argmax(~(steps > 0))) + 1
            raise ValueError(
                f"The times of performance {label!r} do not increase: {times[i]:g} follows "
                f"{times[i - 1]:g}. Sort the table by time, and drop what comes twice."
            )
        if len(steps) > 1 and steps.max() > _GAP * np.median(steps):
            i = int(steps.argmax())
            raise ValueError(
                f"Performance {label!r} has a gap from {times[i]:g} to {times[i + 1]:g}, where "
                f"frames are {np.median(steps):g} apart. Interpolate it, or leave the performance "
                "out: frames count as evenly spaced."
            )


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
        ``frame``. The frames of DataFrames keep their labels, and what they are called.

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
    columns = names if columns is None else list(columns)
    if columns is not None and len(columns) != arrays[0].shape[1]:
        raise ValueError(
            f"columns must name the {arrays[0].shape[1]} features, one each; got {len(columns)}."
        )
    levels = INDEX_NAMES[0], frame_name(sequences) or INDEX_NAMES[1]
    return stack_frame(arrays, labels, frame_labels(sequences), columns, levels)


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


def frame_name(sequences):
    """What frames of DataFrames are called; None if they are not called anything."""
    names = {x.index.name if isinstance(x, pd.DataFrame) else None for x in sequences}
    return names.pop() if len(names) == 1 else None


def stack_frame(arrays, labels, frames, columns, levels=INDEX_NAMES):
    """Arrays below each other under a MultiIndex of performance and frame."""
    lengths = [len(a) for a in arrays]
    index = pd.MultiIndex.from_arrays(
        [
            pd.Index(list(labels), tupleize_cols=False).repeat(lengths),
            np.concatenate([np.asarray(f) for f in frames]),
        ],
        names=levels,
    )
    return pd.DataFrame(np.concatenate(list(arrays)), index=index, columns=columns)
