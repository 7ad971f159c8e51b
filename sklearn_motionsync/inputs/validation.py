"""Input checks of estimators, and outputs of the same kind as the input."""

from __future__ import annotations

import re
import warnings
from typing import Any

import numpy as np
import pandas as pd
from sklearn.base import BaseEstimator, TransformerMixin
from sklearn.utils import get_tags
from sklearn.utils._set_output import _get_output_config
from sklearn.utils.validation import check_is_fitted, validate_data

from .collections import ACCEPTED, NOT_ONE, Trials, as_collection, check_members
from .facts import check_facts, facts_of
from .findings import warn_of_findings
from .numbers import (
    FLOATS,
    as_numbers,
    check_finite,
    check_magnitude,
    check_names,
    column_names,
    refuse_non_numeric,
)
from .tables import FRAME, SPLIT, TRIAL, as_pandas, stack_frame
from .types import Transformed, TrialsLike
from .wording import counted

# Attribute of estimators: ``feature_names_in_``, but of any type.
_NAMES = "_names_in"
# A straight line over so many frames is no accident.
_CLOCK_FRAMES = 8
# Above this ratio of `_smoothness` the second axis may be the time. Sets of real trials of 10
# to 50 frames have 0.002 to 0.2, or 0.9 with features of unit variance; with their axes exchanged
# they have 5.7 and more; noise has 1.
_NO_TIME = 0.9
# Below this one the first axis is the time. Six features of one trial have 0.0001 to 0.008,
# one feature of many trials 0.3 and more.
_TIME = 0.05
# So many trials tell.
_ENOUGH = 100
_EXCHANGED = (
    " If it is (n_features, n_frames), exchange the axes: give np.swapaxes(X, 1, 2), or "
    "[x.T for x in X]."
)


class SequenceLevelMixin:
    """Input checks of estimators whose samples are whole trials."""

    # How `check_trials` treats NaN; "allow-nan" admits gaps.
    _finite: bool | str = True
    n_features_in_: int

    def check_trials(self, X: TrialsLike) -> Trials:
        """Check trials against the input contract, and against those of ``fit``.

        Parameters
        ----------
        X : list of arrays (n_frames_i, n_features), 3-D array, or 2-D array
            The rows of a 2-D array are univariate trials.

        Returns
        -------
        sequence of ndarray (n_frames_i, n_features)
            All of one dtype, float32 or float64; not to be written to. Methods of this estimator
            take it without checking again; its method ``take(indices)`` gives some of them.

        Raises
        ------
        ValueError
            If the input breaks the contract, or differs from that of ``fit`` in kind, width or
            names.
        """
        on_rows = self._read_rows_in_fit()
        if isinstance(X, Trials) and (X.kind == "rows") is on_rows and len(X):
            same = X.names is getattr(self, "feature_names_in_", None)
            if same and X[0].shape[not on_rows] == self.n_features_in_:
                return X
        return check_input(
            self, X, reset=False, level="sequence", on_rows=on_rows, finite=self._finite
        )

    def _read_rows_in_fit(self):
        """Whether it was fitted on 2-D input; an error if it was not fitted."""
        on_rows = self.__dict__.get("_fitted_on_rows")
        # After a fit that failed its input is known, and nothing else.
        is_fitted = getattr(self, "__sklearn_is_fitted__", None)
        if on_rows is None or (is_fitted is not None and not is_fitted()):
            check_is_fitted(self)
        return on_rows

    def _check_training_set(self, X, numbers=None, looks=True):
        """Check the input of ``fit``: all trials, or some with their numbers.

        Where a confidence hides a part of them, nothing is told of what their numbers mean.
        """
        trials = check_input(
            self, X, reset=True, level="sequence", numbers=numbers, finite=self._finite
        )
        self._fitted_on_rows = trials.kind == "rows"
        if looks and not self._fitted_on_rows:
            warn_of_findings(trials, names_of_input(self))
        return trials


class TrialTransformerMixin(TransformerMixin):
    """scikit-learn's mixin of transformers, for those whose samples are trials."""

    def fit_transform(self, X: TrialsLike, y: object = None, **fit_params: Any) -> Transformed:
        """Fit to trials, then transform them.

        Parameters
        ----------
        X : trials
            As for ``fit``.
        y : array-like, default=None
            As for ``fit``.
        **fit_params : dict
            What ``fit`` takes besides.

        Returns
        -------
        ndarray, list of ndarray or DataFrame
            As from ``transform``.
        """
        return super().fit_transform(X, y, **fit_params)


def check_input(
    estimator,
    X,
    *,
    reset,
    level,
    on_rows=None,
    finite=True,
    numbers=None,
    dtype=None,
    facts=None,
    timed=False,
):
    """Check the input of an estimator against the contract.

    Parameters
    ----------
    estimator : estimator
        Gets ``n_features_in_`` (features of a frame) and ``feature_names_in_``. Its ``_on_gaps``,
        if it has one, is what to do about NaN that it refuses.
    X : the input, of any kind the contract names
    reset : bool
        True in ``fit``.
    level : {"pose", "sequence"}
        How a 2-D input is read.
    on_rows : bool, default=None
        Whether the estimator was fitted on 2-D input and takes nothing else; None: it takes both.
    finite : {True, "allow-nan"}, default=True
        Whether NaN is refused, too.
    numbers, dtype : default=None
        Of some of those that were given, as for `check_members`.
    facts : sequence of str, default=None
        The known facts that matter, as for `check_facts`.
    timed : bool, default=False
        As for `check_members`.

    Returns
    -------
    Trials
    """
    sequences = as_collection(X)
    if sequences is None:
        rows = _check_rows(
            estimator, X, reset=reset, level=level, on_rows=on_rows, finite=finite, numbers=numbers
        )
        rows.facts = [facts_of(X)]
        check_facts(estimator, rows.facts, rows.called, reset=reset, which=facts)
        return rows
    name = type(estimator).__name__
    if on_rows:
        raise ValueError(
            f"{name} was fitted on a 2-D array of univariate sequences (n_sequences, "
            f"{estimator.n_features_in_}) and got a collection of trials. Give it 2-D "
            "input, or fit it on a collection."
        )
    out = check_members(
        sequences,
        finite=finite,
        training=reset,
        numbers=numbers,
        dtype=dtype,
        names=None if reset else names_of_input(estimator),
        timed=timed,
        advice=getattr(estimator, "_on_gaps", None),
    )
    width = out[0].shape[1]
    if not reset and width != estimator.n_features_in_:
        raise ValueError(
            f"Trial {out.numbers[0]} has {counted(width, 'feature')} a frame, but {name} is "
            f"expecting {estimator.n_features_in_} features as input."
            + (_EXCHANGED if {len(x) for x in out} == {estimator.n_features_in_} else "")
        )
    if reset:
        vars(estimator)[_NAMES] = column_names(sequences[0])
    named = out.names is not None and any([isinstance(name, str) for name in out.names])
    # Arrays were checked above, all but those given after a fit on tables.
    if reset or named or hasattr(estimator, "feature_names_in_"):
        first = pd.DataFrame(out[0], columns=out.names) if named else out[0]
        validate_data(estimator, first, reset=reset, skip_check_array=True)
    if getattr(X, "ndim", 1) == 3:
        out.kind = "array"
    elif isinstance(X, pd.DataFrame):
        out.kind = "frame"
    out.names = getattr(estimator, "feature_names_in_", None)
    # A skeleton says how many features there are.
    free = reset and not named and getattr(estimator, "skeleton", None) is None
    if free and all(len(x) < width for x in out):
        _warn_of_exchanged_axes(out)
    if reset or out.facts:
        check_facts(estimator, out.facts, out.called, reset=reset, which=facts)
    if reset and level == "pose":
        warn_of_findings(out, names_of_input(estimator), clocks=False)
    return out


def names_of_input(estimator):
    """Names of the features that an estimator was fitted on, of any type; None without any."""
    return vars(estimator).get(_NAMES)


def check_transformed(estimator, X, names, *, finite=True):
    """Check the input of ``inverse_transform``: poses of features of these names."""
    space = type(type(estimator).__name__, (BaseEstimator,), {})()
    space.n_features_in_ = len(names)
    sequences = as_collection(X)
    first = X if sequences is None else next(iter(sequences), None)
    named = column_names(first)
    if named is not None and isinstance(named[0], str):
        space.feature_names_in_ = np.asarray(names, dtype=object)
    return check_input(space, X, reset=False, level="pose", finite=finite)


def restore(estimator, trials, arrays, *, frames=None, columns=None):
    """Give transformed arrays back as the kind of the input, or as a MultiIndex frame.

    ``frames`` replaces the frame labels of the input where its time was changed,
    ``columns`` the names of the estimator's outputs.
    """
    if trials.kind == "rows":
        return arrays[0]
    container = _get_output_config("transform", estimator)["dense"]
    if container == "pandas":
        labels_of_frames, levels = trials.frames, trials.levels
        if frames is not None:
            labels_of_frames, levels = [frames] * len(arrays), (*levels[:-1], FRAME)
        columns = estimator.get_feature_names_out() if columns is None else columns
        return stack_frame(arrays, trials.labels, labels_of_frames, columns, levels)
    if container != "default":
        raise ValueError(
            f"{type(estimator).__name__} has no {container!r} output for a collection of "
            "trials, as such a table has no index to tell them apart. Use "
            "set_output(transform='pandas'), and pl.DataFrame(table.reset_index().to_dict('list')) "
            "on its result."
        )
    if trials.kind == "array" or isinstance(arrays, np.ndarray):
        return np.stack(arrays) if isinstance(arrays, list) else arrays
    return arrays


def read_collection(X):
    """Arrays and column names of a collection of any kind, which may have gaps.

    For what comes along with trials; their estimators use ``check_trials``.
    """
    if isinstance(X, Trials):
        return X, None
    sequences = as_collection(X)
    if sequences is None:
        raise ValueError(NOT_ONE)
    arrays = check_members(sequences, finite=False)
    return list(arrays), arrays.names


def _check_rows(estimator, X, *, reset, level, on_rows, finite, numbers):
    """A 2-D input: rows are poses, or univariate sequences."""
    if on_rows is False:
        raise ValueError(
            f"{type(estimator).__name__} was fitted on a collection of trials and got 2-D or "
            f"other input: wrap one sequence as [X]. {ACCEPTED}."
        )
    if reset and level == "sequence" and isinstance(as_pandas(X), pd.DataFrame):
        _refuse_long_table(type(estimator).__name__, as_pandas(X))
    refuse_non_numeric(X, "The input")
    index = X.index if isinstance(X, pd.DataFrame) else None
    out = validate_data(
        estimator, X, reset=reset, dtype=list(FLOATS), order="C", ensure_all_finite=False
    )
    if reset:
        vars(estimator)[_NAMES] = column_names(X)
    else:
        check_names(X, names_of_input(estimator), "The input")
    names = getattr(estimator, "feature_names_in_", None)
    labels = index if index is not None else numbers
    advice = getattr(estimator, "_on_gaps", None)
    allow_nan = finite == "allow-nan"
    check_finite(out, "Row", names, labels, allow_nan=allow_nan, advice=advice)
    size = np.maximum(
        np.fmax.reduce(out, axis=1, initial=0), -np.fmin.reduce(out, axis=1, initial=0)
    )
    row = int(size.argmax())
    row_name = f"Row {row if numbers is None else numbers[row]}"
    check_magnitude(size[row], row_name, training=reset)
    if level == "pose":
        levels = TRIAL, getattr(index, "name", None) or FRAME
        return Trials([out], "rows", [0], levels=levels)
    if out.shape[1] < 2:
        raise ValueError(
            "Each row of a 2-D input is one univariate sequence and needs at least 2 frames, got "
            f"n_features = {out.shape[1]}. For trials of several features use a list."
        )
    if reset:
        _warn_of_one_trial(out)
    rows = [row[:, np.newaxis] for row in out]
    labels = list(range(len(out)) if numbers is None else numbers)
    return Trials(rows, "rows", labels, names=names, numbers=numbers)


def _refuse_long_table(name, df):
    """Refuse a table of frames. One whose columns are numbered may hold univariate rows."""
    index, texts = df.index, [c for c in df.columns if isinstance(c, str)]
    stems = {re.sub(r"\d+$", "", text) for text in texts}
    numbered = len(stems) == (len(texts) > 0) and stems.isdisjoint(texts)
    dates = index.dtype.kind in "mM"
    fractions = index.dtype.kind == "f" and (index % 1 != 0).any()
    timed = (dates or fractions) and index.is_monotonic_increasing and index.is_unique
    if not numbered or timed:
        raise ValueError(
            f"{name} got a table of {counted(len(df), 'row')} with the columns "
            f"{list(df.columns[:4])}, whose index does not tell trials apart. {SPLIT} If "
            "every row is one univariate trial, give df.to_numpy(); if every column is one, "
            "df.T.to_numpy()."
        )


def _warn_of_exchanged_axes(trials):
    """Warn of trials (n_features, n_frames), by their first axis, which is not smooth."""
    n_frames, width = trials[0].shape
    tested = trials[:_ENOUGH]
    if {len(x) for x in trials} != {n_frames} or not np.isfinite(np.stack(tested)).all():
        return
    if _smoothness(np.stack(tested)) > _NO_TIME:
        warnings.warn(
            f"Every trial has {n_frames} frames of {width} features, and its features change "
            f"more smoothly than its frames.{_EXCHANGED}",
            UserWarning,
            stacklevel=2,
        )


def _warn_of_one_trial(rows):
    """Warn of univariate trials in rows that are the frames of a single trial."""
    n_rows, n_columns = rows.shape
    if n_rows <= max(n_columns, _CLOCK_FRAMES) or not np.isfinite(rows).all():
        return
    if _smoothness(rows[np.newaxis]) < _TIME:
        warnings.warn(
            f"A 2-D input is taken as {counted(n_rows, 'univariate trial')} of "
            f"{n_columns} frames, and its rows change smoothly from one to the next. If it is one "
            f"trial of {n_rows} frames and {counted(n_columns, 'feature')}, wrap it as [X].",
            UserWarning,
            stacklevel=2,
        )


def _smoothness(arrays):
    """The mean squared step along the rows of arrays (n, a, b), over that along the columns.

    Steps are in units of the variance along the same axis. NaN of what is constant along one.
    """
    steps = []
    for axis in (1, 2):
        spread = np.square(arrays - arrays.mean(axis=axis, keepdims=True)).sum()
        steps.append(np.square(np.diff(arrays, axis=axis)).sum() / spread if spread > 0 else 0)
    return steps[0] / steps[1] if min(steps) > 0 else np.nan


# -- trials that are read in parts, so that few are in memory at a time ---------------

# Bytes of a number, at most.
_DOUBLE = 8
# A part ends with the trial that makes it so many bytes, or so many trials.
_BYTES, MANY = 1 << 25, 4096


def read_source(estimator, source, on_rows):
    """Yield checked parts of a source, few enough trials at a time for the memory.

    Parameters
    ----------
    estimator : fitted estimator
    source : as `as_source` returns it
    on_rows : bool
        As for `check_trials`.
    """
    # The precision of memory maps is known before they are read.
    kinds = {getattr(x, "dtype", None) for x in source} if isinstance(source, (list, tuple)) else ()
    kinds = {source.dtype} if isinstance(source, np.memmap) else kinds
    dtype = None
    if kinds:
        dtype = np.dtype(np.float32 if kinds == {np.dtype(np.float32)} else np.float64)
    start, portion, size = 0, [], 0
    for i in range(len(source)):
        portion.append(source[i])
        size += getattr(portion[-1], "size", 0) * _DOUBLE
        if size < _BYTES and len(portion) < MANY and i + 1 < len(source):
            continue
        if dtype is None:
            dtype = as_numbers(portion[0], "Trial 0").dtype
        yield check_input(
            estimator,
            portion,
            reset=False,
            level="sequence",
            on_rows=on_rows,
            finite="allow-nan" if get_tags(estimator).input_tags.allow_nan else True,
            numbers=range(start, i + 1),
            dtype=dtype,
        )
        start, portion, size = i + 1, [], 0
