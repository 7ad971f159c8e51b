"""FrameWise: any transformer of rows, applied to the frames of trials."""

from __future__ import annotations

from typing import Self

import numpy as np
import pandas as pd
from sklearn.base import BaseEstimator, clone
from sklearn.utils import get_tags
from sklearn.utils._param_validation import HasMethods
from sklearn.utils.metaestimators import available_if
from sklearn.utils.validation import check_is_fitted

from ..inputs.features import check_input_features
from ..inputs.numbers import as_numbers, column_names
from ..inputs.types import NamesLike, Transformed, TrialsLike
from ..inputs.validation import (
    TrialTransformerMixin,
    check_input,
    check_transformed,
    restore,
)
from ..utils.parallel import LongWorkMixin
from ..utils.parameters import validated_with_nested
from ..utils.pipelines import takes_gaps


def _goes_back(self):
    """Whether the transformer inverts; fit tries, as some do so with some settings only."""
    return self.__dict__.get("_inverts", hasattr(self.transformer, "inverse_transform"))


class FrameWise(LongWorkMixin, TrialTransformerMixin, BaseEstimator):
    """Apply a transformer of rows, such as ``StandardScaler``, to the frames of trials.

    The transformer is fitted on the pooled frames of all trials. A scaler therefore scales a
    feature by one number for all trials, and the differences between subjects remain.

    Parameters
    ----------
    transformer : transformer of scikit-learn
        It takes a row a frame and gives one a frame: scalers, imputers, ``PCA``,
        ``VarianceThreshold``, a pipeline of such. It is cloned. Frames have no ``y``.

    Attributes
    ----------
    transformer_ : transformer
        Fitted on the pooled frames.
    n_features_in_ : int
        Features of a frame.
    feature_names_in_ : ndarray of str
        Names of the columns; only if the input had names.

    See Also
    --------
    ASpace : Principal components of poses.

    Notes
    -----
    A gap (NaN) is accepted if the transformer accepts it, as imputers and scalers do; infinity is
    refused. A pipeline accepts what its first step accepts, a union what all its parts accept; a
    ``ColumnTransformer`` and a ``FunctionTransformer`` accept any.

    Examples
    --------
    Degrees and newtons, which would count a hundred times as much:

    >>> import numpy as np
    >>> from sklearn.pipeline import make_pipeline
    >>> from sklearn.preprocessing import StandardScaler
    >>> from sklearn_motionsync import DenseSynchronizer, FrameWise
    >>> t = np.linspace(0, 1, 50)
    >>> X = [np.column_stack([9 * np.sin(5 * x), 900 * np.cos(4 * x)]) for x in (t, t**1.2)]
    >>> scaled = FrameWise(StandardScaler()).fit_transform(X)
    >>> np.concatenate(scaled).std(axis=0).round(3).tolist()
    [1.0, 1.0]
    >>> pipe = make_pipeline(FrameWise(StandardScaler()), DenseSynchronizer(n_frames=40))
    >>> pipe.fit_transform(X).shape
    (2, 40, 2)
    """

    _parameter_constraints: dict = {"transformer": [HasMethods(["fit", "transform"])]}

    def __init__(self, transformer: BaseEstimator) -> None:
        self.transformer = transformer

    @validated_with_nested
    def fit(self, X: TrialsLike, y: object = None) -> Self:
        """Fit a clone of the transformer on all frames.

        Parameters
        ----------
        X : list of arrays (n_frames_i, n_features), 3-D array, or 2-D array
            Trials, or poses in rows.
        y : ignored
            Present for API consistency.

        Returns
        -------
        FrameWise
            The fitted estimator.

        Raises
        ------
        ValueError
            If the input breaks the contract, the transformer needs a ``y``, or its output is not a
            row of numbers a frame.
        """
        trials = check_input(self, X, reset=True, level="pose", finite=self._finite())
        transformer, name = clone(self.transformer), "fitting the transformer"
        with self._progress(fits=True) as progress, progress.fitting(transformer, name):
            transformer.fit(self._named(np.concatenate(trials)))
        table = transformer.transform(self._named(trials[0]))
        rows = self._as_rows(table, trials, 0)
        inverts = _inverts(transformer, rows[:1])
        self.transformer_ = transformer
        # The names of FunctionTransformer are those of the table that it returns.
        self._names_out = column_names(table)
        self._n_features_out = rows.shape[1]
        self._inverts = inverts
        return self

    def transform(self, X: TrialsLike) -> Transformed:
        """Transform the frames of trials.

        Parameters
        ----------
        X : list of arrays (n_frames_i, n_features), 3-D array, or 2-D array
            Trials, or poses in rows.

        Returns
        -------
        list of ndarray (n_frames_i, n_features_out), or ndarray
            Transformed frames, of the same kind as ``X``; a ``(trial, frame)`` frame under
            ``set_output(transform="pandas")``.
        """
        check_is_fitted(self, "transformer_")
        trials = check_input(self, X, reset=False, level="pose", finite=self._finite())
        arrays = [
            self._as_rows(self.transformer_.transform(self._named(x)), trials, i)
            for i, x in enumerate(trials)
        ]
        return restore(self, trials, arrays)

    @available_if(_goes_back)
    def inverse_transform(self, X: TrialsLike) -> Transformed:
        """Invert the transform of frames, if the transformer can.

        Parameters
        ----------
        X : list of arrays (n_frames_i, n_features_out), 3-D array, or 2-D array
            Transformed frames.

        Returns
        -------
        list of ndarray (n_frames_i, n_features), or ndarray
            Frames with the features before the transformer, of the same kind as ``X``.
        """
        check_is_fitted(self, "transformer_")
        names = self.get_feature_names_out()
        trials = check_transformed(self, X, names, finite=self._finite())
        arrays = [
            self._as_rows(self.transformer_.inverse_transform(x.copy()), trials, i)
            for i, x in enumerate(trials)
        ]
        columns = getattr(self, "feature_names_in_", range(self.n_features_in_))
        return restore(self, trials, arrays, columns=columns)

    def get_feature_names_out(self, input_features: NamesLike | None = None) -> np.ndarray:
        """Names of the features that the transformer gives.

        Parameters
        ----------
        input_features : array-like of str, default=None
            Names of the features before it; by default those seen in ``fit``, or x0, x1, ...

        Returns
        -------
        ndarray of str
            Those that the transformer gives, or the table it makes; framewise0, framewise1, ... if
            there are none.
        """
        check_is_fitted(self, "transformer_")
        check_input_features(self, input_features)
        if hasattr(self.transformer_, "get_feature_names_out"):
            if input_features is None:
                input_features = getattr(self, "feature_names_in_", None)
            names = self.transformer_.get_feature_names_out(input_features)
        elif self._names_out is not None and isinstance(self._names_out[0], str):
            names = self._names_out
        else:
            names = [f"framewise{k}" for k in range(self._n_features_out)]
        return np.asarray(names, dtype=object)

    def __sklearn_tags__(self):
        tags = super().__sklearn_tags__()
        tags.input_tags.three_d_array = True
        if not hasattr(self.transformer, "__sklearn_tags__"):
            return tags
        inner = get_tags(self.transformer)
        tags.input_tags.allow_nan = self._finite() == "allow-nan"
        tags.input_tags.positive_only = inner.input_tags.positive_only
        tags.non_deterministic = inner.non_deterministic
        if inner.transformer_tags is not None:
            tags.transformer_tags.preserves_dtype = list(inner.transformer_tags.preserves_dtype)
        return tags

    # -- frames to the transformer, and back ------------------------------------------------

    def _finite(self):
        """What the input must be: NaN is allowed if the transformer accepts it."""
        return "allow-nan" if takes_gaps(self.transformer) else True

    def _named(self, frames):
        """A copy of frames with their names: a transformer may write to it."""
        names = getattr(self, "feature_names_in_", None)
        frames = frames.copy()
        # Row by row in memory with names, too: sums do not depend on them.
        return frames if names is None else pd.DataFrame(frames, columns=names, copy=False)

    def _as_rows(self, rows, trials, i):
        """The output of the transformer for a trial, checked: a row of numbers a frame."""
        what, n_frames = trials.called(i), len(trials[i])
        name = type(self.transformer).__name__
        rows = as_numbers(rows, f"{what}, transformed by {name},")
        if rows.ndim != 2 or len(rows) != n_frames:
            raise ValueError(
                f"{what} has {n_frames} frames, of which {name} made the shape {rows.shape}: "
                "in FrameWise a transformer gives one row a frame. What changes the number of "
                "frames is applied before, [change(x) for x in X]."
            )
        return np.ascontiguousarray(rows)


def _inverts(transformer, rows):
    """Whether a fitted transformer inverts rows."""
    try:
        transformer.inverse_transform(rows.copy())
    except (AttributeError, NotImplementedError, TypeError, ValueError):
        return False
    return True
