"""How estimators take performances, and give the same kind back: checked once, by one contract."""

import re
import warnings

import numpy as np
import pandas as pd
from sklearn.base import BaseEstimator
from sklearn.utils._set_output import _get_output_config
from sklearn.utils.validation import check_is_fitted, validate_data

from .collections import (
    ACCEPTED,
    NOT_ONE,
    Performances,
    as_collection,
    as_source,
    check_members,
)
from .numbers import (
    LARGEST,
    SMALLEST,
    as_numbers,
    check_finite,
    check_names,
    names_of,
    refuse,
    refuse_magnitude,
)
from .tables import (
    INDEX_NAMES,
    as_pandas,
    call_to_unfold,
    labels_of,
    name_performance,
    stack_frame,
)

__all__ = [
    "Performances",
    "SequenceLevelMixin",
    "all_of",
    "check_performances",
    "check_transformed",
    "labels_as_given",
    "name_performance",
    "names_of_input",
    "parts_of_source",
    "read_collection",
    "restore",
]

# Attribute of estimators: ``feature_names_in_``, but of any type.
_NAMES = "_names_in"
# Frames from which on a straight line is no accident.
_CLOCK_FRAMES = 8


class SequenceLevelMixin:
    """What estimators share whose samples are whole performances: how they take input."""

    def check_performances(self, X):
        """Check performances against the input contract, and against those of ``fit``.

        Parameters
        ----------
        X : list of arrays (n_frames_i, n_features), 3-D array, or 2-D array
            The rows of a 2-D array are univariate performances.

        Returns
        -------
        sequence of ndarray (n_frames_i, n_features)
            All of one dtype, float32 or float64; not to be written to. Methods of this estimator
            take it without checking again.

        Raises
        ------
        ValueError
            If the input breaks the contract, or differs from that of ``fit`` in kind, width or
            names.
        """
        on_rows = self._read_rows_in_fit()
        if isinstance(X, Performances) and (X.kind == "rows") is on_rows and len(X):
            same = X.names is getattr(self, "feature_names_in_", None)
            if same and X[0].shape[not on_rows] == self.n_features_in_:
                return X
        return check_performances(self, X, reset=False, level="sequence", on_rows=on_rows)

    def _read_rows_in_fit(self):
        """Whether it was fitted on 2-D input; an error if it was not fitted."""
        on_rows = vars(self).get("_fitted_on_rows")
        if on_rows is None:
            check_is_fitted(self)
        return on_rows

    def _check_training_set(self, X, numbers=None):
        """The same in ``fit``, where it is learnt what to expect; of some, with their numbers."""
        performances = check_performances(self, X, reset=True, level="sequence", numbers=numbers)
        self._fitted_on_rows = performances.kind == "rows"
        if not self._fitted_on_rows:
            _warn_of_clocks(performances, names_of_input(self))
        return performances


def check_performances(
    estimator, X, *, reset, level, on_rows=None, finite=True, numbers=None, dtype=None
):
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
    on_rows : bool, default=None
        Whether the estimator was fitted on 2-D input and takes nothing else; None: it takes both.
    finite : {True, "allow-nan"}, default=True
        Whether NaN is refused, too.
    numbers, dtype : default=None
        Of some of those that were given, as for `check_members`.

    Returns
    -------
    Performances
    """
    sequences = as_collection(X)
    if sequences is None:
        how = {"reset": reset, "level": level, "on_rows": on_rows, "finite": finite}
        return _check_rows(estimator, X, numbers=numbers, **how)
    name = type(estimator).__name__
    if on_rows:
        raise ValueError(
            f"{name} was fitted on a 2-D array of univariate sequences (n_sequences, "
            f"{estimator.n_features_in_}) and got a collection of performances. Give it 2-D "
            "input, or fit it on a collection."
        )
    arrays = check_members(sequences, finite=finite, training=reset, numbers=numbers, dtype=dtype)
    names = arrays.names
    if not reset and arrays[0].shape[1] != estimator.n_features_in_:
        width = arrays[0].shape[1]
        raise ValueError(
            f"Performance {arrays.numbers[0]} has {width} features a frame, but {name} is "
            f"expecting {estimator.n_features_in_} features as input."
        )
    _check_names(estimator, sequences[0], reset)
    told = names is not None and isinstance(names[0], str)
    # Of arrays there is nothing that was not checked above, if those of fit were arrays, too.
    if reset or told or hasattr(estimator, "feature_names_in_"):
        first = pd.DataFrame(arrays[0], columns=names) if told else arrays[0]
        validate_data(estimator, first, reset=reset, skip_check_array=True)
    if getattr(X, "ndim", 1) == 3:
        arrays.kind = "array"
    elif isinstance(X, pd.DataFrame):
        arrays.kind = "frame"
    arrays.names = getattr(estimator, "feature_names_in_", None)
    return arrays


def names_of_input(estimator):
    """The names of the features that an estimator was fitted on, of any type; None without any."""
    return vars(estimator).get(_NAMES)


def _check_names(estimator, x, reset):
    """Names of any type are kept to, as scikit-learn keeps to those that are text."""
    if reset:
        vars(estimator)[_NAMES] = names_of(x)
    else:
        check_names(x, names_of_input(estimator), "The input")


def check_transformed(estimator, X, names, *, finite=True):
    """Check the input of ``inverse_transform``: postures of features of these names."""
    space = type(type(estimator).__name__, (BaseEstimator,), {})()
    space.n_features_in_ = len(names)
    sequences = as_collection(X)
    some = X if sequences is None else next(iter(sequences), None)
    named = names_of(some)
    if named is not None and isinstance(named[0], str):
        space.feature_names_in_ = np.asarray(names, dtype=object)
    return check_performances(space, X, reset=False, level="posture", finite=finite)


def restore(estimator, performances, arrays, *, frames=None, columns=None):
    """Give transformed arrays back as the kind of the input, or as a MultiIndex frame.

    ``frames`` replaces the frame labels of the input where its time was changed,
    ``columns`` the names of the estimator's outputs.
    """
    if performances.kind == "rows":
        return arrays[0]
    container = _get_output_config("transform", estimator)["dense"]
    if container == "pandas":
        own, levels = performances.frames, performances.levels
        if frames is not None:
            own, levels = [frames] * len(arrays), (*levels[:-1], INDEX_NAMES[1])
        columns = estimator.get_feature_names_out() if columns is None else columns
        return stack_frame(arrays, performances.labels, own, columns, levels)
    if container != "default":
        raise ValueError(
            f"{type(estimator).__name__} has no {container!r} output for a collection of "
            "performances; use set_output(transform='pandas') or 'default'."
        )
    if performances.kind == "array" or isinstance(arrays, np.ndarray):
        return np.stack(arrays) if isinstance(arrays, list) else arrays
    return arrays


def labels_as_given(X, reached):
    """Labels and level names of performances as a user gave them.

    Parameters
    ----------
    X : performances, as the first step of a pipeline takes them
    reached : Performances
        What reaches a later step, maybe without labels.
    """
    known = isinstance(X, Performances) or as_source(X) is not None
    sequences = None if known else as_collection(X)
    if sequences is not None:
        labels, levels = labels_of(sequences)
        if labels != list(range(len(labels))) and len(labels) == len(reached):
            return labels, levels
    return reached.labels, reached.levels


def read_collection(X):
    """Arrays and column names of a collection of any kind, which may have gaps.

    For what comes along with performances; their estimators use ``check_performances``.
    """
    if isinstance(X, Performances):
        return X, None
    sequences = as_collection(X)
    if sequences is None:
        raise ValueError(NOT_ONE)
    arrays = check_members(sequences, finite=False)
    return list(arrays), arrays.names


def _check_rows(estimator, X, *, reset, level, on_rows, finite, numbers):
    """A 2-D input: rows are postures, or univariate sequences."""
    if on_rows is False:
        raise ValueError(
            f"{type(estimator).__name__} was fitted on a collection of performances and got 2-D or "
            f"other input: wrap one sequence as [X]. {ACCEPTED}."
        )
    if reset and level == "sequence" and isinstance(as_pandas(X), pd.DataFrame):
        _refuse_long_table(type(estimator).__name__, as_pandas(X))
    refuse(X, "The input")
    index = X.index if isinstance(X, pd.DataFrame) else None
    source, X = (
        X,
        validate_data(
            estimator,
            X,
            reset=reset,
            dtype=[np.float64, np.float32],
            order="C",
            ensure_all_finite=False,
        ),
    )
    _check_names(estimator, source, reset)
    names = getattr(estimator, "feature_names_in_", None)
    called = index if index is not None else numbers
    check_finite(X, "Row", names, called, allow_nan=finite == "allow-nan")
    size = np.fmax.reduce(np.abs(X), axis=1, initial=0)
    if size.max() > LARGEST or (reset and 0 < size.max() < SMALLEST):
        row = int(size.argmax())
        refuse_magnitude(size.max(), f"Row {row if numbers is None else numbers[row]}")
    if level == "posture":
        levels = INDEX_NAMES[0], getattr(index, "name", None) or INDEX_NAMES[1]
        return Performances([X], "rows", [0], levels=levels)
    if X.shape[1] < 2:
        raise ValueError(
            "Each row of a 2-D input is one univariate sequence and needs at least 2 frames, got "
            f"n_features = {X.shape[1]}. For performances of several features use a list."
        )
    rows = [row[:, np.newaxis] for row in X]
    labels = list(range(len(X)) if numbers is None else numbers)
    return Performances(rows, "rows", labels, names=names, numbers=numbers)


def _refuse_long_table(name, df):
    """Named columns are features, and rows frames, unless the names only number the frames."""
    texts = [c for c in df.columns if isinstance(c, str)]
    counts = not texts or _are_numbered(list(df.columns))
    if df.index.nlevels == 1 and counts and not _tells_time(df.index):
        return
    shown = ", ".join(map(repr, df.columns[:4])) + (", ..." if df.shape[1] > 4 else "")
    levels = "index does" if df.index.nlevels == 1 else f"index of {df.index.nlevels} levels does"
    unfold = call_to_unfold(df.columns, list(df.index.names) if df.index.nlevels > 1 else [])
    wide = "" if unfold is None else f"If columns are frames, make it long: {unfold}. "
    raise ValueError(
        f"{name} got a table of {len(df)} rows with the columns {shown}, whose {levels} not tell "
        "performances apart. If its rows are frames, say which columns name the performance and "
        "the time: to_sequences(df, by=[...], time=...), or index it by (performance, frame). "
        f"{wide}If every row is one univariate performance, give df.to_numpy(); if every column is "
        "one, df.T.to_numpy()."
    )


def _tells_time(index):
    """Whether an index increases in fractions, dates or durations, as the time of frames does."""
    if not index.is_monotonic_increasing or not index.is_unique:
        return False
    return index.dtype.kind in "mM" or (index.dtype.kind == "f" and bool((index % 1 != 0).any()))


def _are_numbered(names):
    """Whether names are one text with a number that goes up by one."""
    parts = [re.fullmatch(r"(.*?)(\d+)", name) if isinstance(name, str) else None for name in names]
    if not all(parts):
        return False
    numbers = [int(part[2]) for part in parts]
    together = numbers == list(range(numbers[0], numbers[0] + len(numbers)))
    return together and len({part[1] for part in parts}) == 1


def _warn_of_clocks(performances, names):
    """Say if a feature of several only tells the time."""
    n_features = performances[0].shape[1]
    if n_features == 1 or min(map(len, performances)) < _CLOCK_FRAMES:
        return
    ticks = np.ones(n_features, dtype=bool)
    for x in performances:
        ticks &= _is_even(x)
        if not ticks.any():
            return
    for k in np.flatnonzero(ticks):
        name = k if names is None else repr(names[k])
        warnings.warn(
            f"Feature {name} increases evenly in every performance: it is a clock, not a movement, "
            "and is matched like one. Leave it out, or give it as time= to to_sequences.",
            UserWarning,
            stacklevel=2,
        )


def _is_even(x):
    """Which features rise on a straight line, but for rounding to half a step: (n_features,)."""
    step = (x[-1] - x[0]) / (len(x) - 1)
    line = x[0] + step * np.arange(len(x))[:, np.newaxis]
    return (
        (step > 0)
        & (np.diff(x, axis=0) > 0).all(axis=0)
        & (np.abs(x - line) <= step / 2).all(axis=0)
    )


# -- performances that are read in parts, each checked once, so that few are in memory at a time

# Bytes of a number, at most.
_DOUBLE = 8
# A part ends with the performance that makes it so many bytes, or so many performances.
_BYTES, MANY = 1 << 25, 4096


def parts_of_source(estimator, X, on_rows):
    """The number of performances, and an iterator over checked parts; None if all are in memory.

    Parameters
    ----------
    estimator : fitted estimator
    X : performances of any kind
    on_rows : bool
        As for `check_performances`.
    """
    source = as_source(X)
    if source is None or len(source) == 0:
        return None
    return len(source), _read(estimator, source, on_rows)


def _read(estimator, source, on_rows):
    dtype = _dtype_of_maps(source)
    start, part, size = 0, [], 0
    for i in range(len(source)):
        part.append(source[i])
        size += _count(part[-1]) * _DOUBLE
        if size < _BYTES and len(part) < MANY and i + 1 < len(source):
            continue
        if dtype is None:
            dtype = as_numbers(part[0], "Performance 0").dtype
        how = {"on_rows": on_rows, "numbers": range(start, i + 1), "dtype": dtype}
        yield check_performances(estimator, part, reset=False, level="sequence", **how)
        start, part, size = i + 1, [], 0


def _count(x):
    """How many numbers; none of what is no array, and will be refused."""
    try:
        return int(np.prod(np.shape(x)))
    except ValueError:
        return 0


def _dtype_of_maps(source):
    """The precision of memory maps, which tell it unread; None of what has to be read."""
    kinds = {getattr(x, "dtype", None) for x in source} if isinstance(source, (list, tuple)) else ()
    kinds = {source.dtype} if isinstance(source, np.memmap) else kinds
    if not kinds:
        return None
    return np.dtype(np.float32 if kinds == {np.dtype(np.float32)} else np.float64)


def all_of(labels, levels, names):
    """What is known of performances that were read in parts: their labels, if they differ.

    Parameters
    ----------
    labels : list
    levels : set of tuple
        Those of the parts.
    names : ndarray of str or None
    """
    if len(levels) > 1 or len(set(labels)) < len(labels):
        labels, levels = list(range(len(labels))), {INDEX_NAMES}
    return Performances((), "list", labels, names=names, levels=levels.pop())
