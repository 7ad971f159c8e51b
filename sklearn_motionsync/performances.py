"""How estimators take performances, and give the same kind back: checked once, by one contract."""

import numpy as np
import pandas as pd
from sklearn.base import BaseEstimator
from sklearn.utils._set_output import _get_output_config
from sklearn.utils.validation import check_is_fitted, validate_data

from .gate import check_finite
from .sequences import (
    ACCEPTED,
    NOT_ONE,
    as_collection,
    check_members,
    frame_labels,
    stack_frame,
)

__all__ = [
    "Performances",
    "SequenceLevelMixin",
    "check_performances",
    "check_transformed",
    "read_collection",
    "restore",
]


class Performances(tuple):
    """Checked performances: their arrays, and what it takes to give the same kind back.

    Whoever checked them takes them as they are. The arrays are views of the input where its dtype
    allows: never write to them.

    Attributes
    ----------
    kind : {"rows", "array", "list", "frame"}
        2-D, 3-D, list, MultiIndex frame.
    labels : list
        Of the performances.
    frames : list
        Labels of the frames of each performance; empty for univariate rows.
    names : ndarray of str or None
        ``feature_names_in_`` of the estimator that checked them.
    """

    def __new__(cls, arrays, kind, labels, frames, names=None):
        self = super().__new__(cls, arrays)
        self.kind, self.labels, self.frames, self.names = kind, labels, frames, names
        return self

    def __getitem__(self, index):
        if isinstance(index, slice):
            return self.take(range(len(self))[index])
        return super().__getitem__(index)

    def take(self, indices):
        """Some of them: rows, or a list."""
        kind = "rows" if self.kind == "rows" else "list"
        frames = [self.frames[i] for i in indices] if self.frames else []
        labels = [self.labels[i] for i in indices]
        return Performances([self[i] for i in indices], kind, labels, frames, self.names)

    def suits(self, n_features=None, on_rows=None, names=None):
        """Whether an estimator that was fitted on such input would take them."""
        is_rows = self.kind == "rows"
        fits = is_rows is on_rows and self.names is names and len(self) > 0
        return fits and self[0].shape[not is_rows] == n_features


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
        known = map(vars(self).get, ("n_features_in_", "_fitted_on_rows", "feature_names_in_"))
        if isinstance(X, Performances) and X.suits(*known):
            return X
        check_is_fitted(self)
        return check_performances(
            self, X, reset=False, level="sequence", on_rows=self._fitted_on_rows
        )

    def _check_training_set(self, X):
        """The same in ``fit``, where it is learnt what to expect."""
        performances = check_performances(self, X, reset=True, level="sequence")
        self._fitted_on_rows = performances.kind == "rows"
        return performances


def check_performances(estimator, X, *, reset, level, on_rows=None):
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

    Returns
    -------
    Performances
    """
    sequences = as_collection(X)
    if sequences is None:
        return _check_rows(estimator, X, reset=reset, level=level, on_rows=on_rows)
    name = type(estimator).__name__
    if on_rows:
        raise ValueError(
            f"{name} was fitted on a 2-D array of univariate sequences (n_sequences, "
            f"{estimator.n_features_in_}) and got a collection of performances. Give it 2-D "
            "input, or fit it on a collection."
        )
    arrays, names = check_members(sequences)
    if not reset and arrays[0].shape[1] != estimator.n_features_in_:
        raise ValueError(
            f"Performance 0 has {arrays[0].shape[1]} features a frame, but {name} is "
            f"expecting {estimator.n_features_in_} features as input."
        )
    first = arrays[0] if names is None else pd.DataFrame(arrays[0], columns=names)
    validate_data(estimator, first, reset=reset, skip_check_array=True)
    if isinstance(X, pd.DataFrame):
        kind, labels = "frame", list(X.index.unique(level=0))
    else:
        kind, labels = "list", list(range(len(arrays)))
        if getattr(X, "ndim", 1) == 3:
            kind = "array"
    names = getattr(estimator, "feature_names_in_", None)
    return Performances(arrays, kind, labels, frame_labels(sequences), names)


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
        return stack_frame(arrays, performances.labels, labels, columns)
    if container != "default":
        raise ValueError(
            f"{type(estimator).__name__} has no {container!r} output for a collection of "
            "performances; use set_output(transform='pandas') or 'default'."
        )
    if performances.kind == "array" or isinstance(arrays, np.ndarray):
        return np.stack(arrays) if isinstance(arrays, list) else arrays
    return arrays


def read_collection(X):
    """Arrays and column names of a collection of any kind, which may have gaps.

    For what comes along with performances; their estimators use ``check_performances``.
    """
    if isinstance(X, Performances):
        return X, None
    sequences = as_collection(X)
    if sequences is None:
        raise ValueError(NOT_ONE)
    return check_members(sequences, finite=False)


def _check_rows(estimator, X, *, reset, level, on_rows):
    """A 2-D input: rows are postures, or univariate sequences."""
    if on_rows is False:
        raise ValueError(
            f"{type(estimator).__name__} was fitted on a collection of performances and got 2-D or "
            f"other input: wrap one sequence as [X]. {ACCEPTED}."
        )
    X = validate_data(
        estimator,
        X,
        reset=reset,
        dtype=[np.float64, np.float32],
        order="C",
        ensure_all_finite=False,
    )
    check_finite(X, "Row")
    if level == "posture":
        return Performances([X], "rows", [0], [range(len(X))])
    if X.shape[1] < 2:
        raise ValueError(
            "Each row of a 2-D input is one univariate sequence and needs at least 2 frames, got "
            f"n_features = {X.shape[1]}. For performances of several features use a list."
        )
    rows, names = [row[:, np.newaxis] for row in X], getattr(estimator, "feature_names_in_", None)
    return Performances(rows, "rows", list(range(len(X))), [], names)
