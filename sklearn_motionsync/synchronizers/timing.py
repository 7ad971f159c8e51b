"""TimingChannel: synchronised trials with their timing as an additional feature."""

from __future__ import annotations

from typing import Any, Self

import numpy as np
from sklearn import get_config
from sklearn.base import BaseEstimator, MetaEstimatorMixin, TransformerMixin, clone
from sklearn.utils import get_tags
from sklearn.utils.metadata_routing import (
    MetadataRouter,
    MethodMapping,
    get_routing_for_object,
    process_routing,
)
from sklearn.utils.validation import check_is_fitted

from ..inputs.types import NamesLike, Transformed, TrialsLike
from ..inputs.validation import restore
from ..utils.parallel import LongWorkMixin
from ..utils.parameters import validated_with_nested
from .base import Synchronizer
from .match import Match, check_match
from .training import with_confidence

# The appended feature.
_OFFSET = "offset"
# Fitted attributes of the synchronizer that are also those of the channel.
_SHARED = "n_frames_", "n_features_in_", "feature_names_in_", "_fitted_on_rows"


class TimingChannel(LongWorkMixin, MetaEstimatorMixin, TransformerMixin, BaseEstimator):
    """Synchronised trials, with their timing as an additional feature.

    Synchronisation removes differences in timing from the curves. Here they are appended to the
    curves, as how much later than the pattern a trial is, in per cent of the clock. So later
    steps, such as principal components, a test along the clock, or a classifier, use both shape
    and timing.

    Parameters
    ----------
    synchronizer : Synchronizer
        Such as ``DenseSynchronizer()``; a clone of it is fitted.

    Attributes
    ----------
    synchronizer_ : Synchronizer
        The fitted synchronizer.
    n_frames_ : int
        ``P``, frames of the common clock.
    n_features_in_ : int
        Features of a frame (columns, for 2-D input).
    feature_names_in_ : ndarray of str
        Names of the features; only if the input had names.

    See Also
    --------
    Match : Offsets and rates as arrays, and as a table; how sure they are.
    Match.offsets_in : The offsets in frames and seconds.

    Notes
    -----
    The unit of the offset differs from those of the features. Scale them before they are combined,
    as in principal components.

    Metadata of the synchronizer, such as ``keyframes``, are arguments of ``fit`` and ``transform``;
    with scikit-learn's metadata routing they are requested by ``set_fit_request`` and
    ``set_transform_request`` of the synchronizer.

    Examples
    --------
    The second trial reaches its peak at 60 % instead of 50 % of the time.

    >>> import numpy as np
    >>> from sklearn_motionsync import DenseSynchronizer, TimingChannel
    >>> t = np.linspace(0, 1, 101)[:, np.newaxis]
    >>> late = np.interp(t, [0, 0.6, 1], [0, 0.5, 1])
    >>> X = [np.sin(np.pi * t), np.sin(np.pi * late)]
    >>> channel = TimingChannel(DenseSynchronizer(pattern=0)).fit(X)
    >>> channel.get_feature_names_out().tolist()
    ['x0', 'offset']
    >>> channel.transform(X)[1, 50].round().tolist()  # the peak, and how late it is: 10 in truth
    [1.0, 9.0]
    """

    _parameter_constraints: dict = {"synchronizer": [Synchronizer]}

    def __init__(self, synchronizer: Synchronizer) -> None:
        self.synchronizer = synchronizer

    @validated_with_nested
    def fit(self, X: TrialsLike, y: object = None, **params: Any) -> Self:
        """Fit a clone of the synchronizer.

        Parameters
        ----------
        X : list of arrays (n_frames_i, n_features), 3-D array, or 2-D array
            Trials; the rows of a 2-D array are univariate ones.
        y : ignored
            Passed to the ``fit`` of the synchronizer.
        **params : dict
            Metadata for the ``fit`` of the synchronizer, such as ``keyframes``.

        Returns
        -------
        self : TimingChannel
            The fitted transformer.

        Raises
        ------
        ValueError
            If a feature has the name of the offset; and as from the ``fit`` of the synchronizer.
        """
        sync, given = clone(self.synchronizer), self._route("fit", params)
        with self._progress(fits=True) as progress, progress.fitting(sync, "synchronizing"):
            sync.fit(X, y, **given)
        if _OFFSET in getattr(sync, "feature_names_in_", ()):
            raise ValueError(f"A feature of X has the name of the offset, {_OFFSET!r}: rename it.")
        self.__dict__.pop("feature_names_in_", None)
        shared = {name: value for name, value in vars(sync).items() if name in _SHARED}
        self.__dict__.update(shared, synchronizer_=sync)
        return self

    def fit_transform(self, X: TrialsLike, y: object = None, **params: Any) -> Transformed:
        """Fit, and transform the same trials.

        Parameters
        ----------
        X : list of arrays (n_frames_i, n_features), 3-D array, or 2-D array
            Trials; the rows of a 2-D array are univariate ones.
        y : ignored
            Passed to the ``fit`` of the synchronizer.
        **params : dict
            Metadata for ``fit`` and ``match`` of the synchronizer, such as ``keyframes``.

        Returns
        -------
        ndarray, shape (n_sequences, P, n_features + 1)
            As from ``transform``.
        """
        if not _routes_metadata():
            return self.fit(X, y, **params).transform(X, **params)
        router = get_routing_for_object(self)
        fits, warps = (set(router.consumes(method, params)) for method in ("fit", "transform"))
        # Metadata that no method requests are refused in fit.
        to_fit = {name: params[name] for name in params if name in fits or name not in warps}
        return self.fit(X, y, **to_fit).transform(X, **{name: params[name] for name in warps})

    def transform(self, X: TrialsLike, **params: Any) -> Transformed:
        """Warp trials onto the clock of the pattern, and append the offset.

        Parameters
        ----------
        X : list of arrays (n_frames_i, n_features), 3-D array, or 2-D array
            Trials; the rows of a 2-D array are univariate ones.
        **params : dict
            Metadata for the ``match`` of the synchronizer, such as ``keyframes``.

        Returns
        -------
        ndarray, shape (n_sequences, P, n_features + 1)
            The offset is the last feature. For 2-D input ``(n_sequences, 2 P)``: each row is a
            curve, then its offset. A ``(trial, frame)`` frame under
            ``set_output(transform="pandas")``.
        """
        check_is_fitted(self)
        trials = self.synchronizer_.check_trials(X)
        match = self.synchronizer_.match(trials, **self._route("transform", params))
        return self.transform_matched(trials, match)

    def transform_matched(self, X: TrialsLike, match: Match) -> Transformed:
        """Warp trials whose match is known, and append the offset.

        Parameters
        ----------
        X : trials
            As for ``match``, which was given the same.
        match : Match
            That of X.

        Returns
        -------
        ndarray, shape (n_sequences, P, n_features + 1)
            What ``transform`` gives for X.
        """
        check_is_fitted(self)
        trials = self.synchronizer_.check_trials(X)
        check_match(match, len(trials), self.n_frames_, type(self.synchronizer_).__name__)
        # What was hidden in the match is hidden here, too.
        hidden = None if match.reached is None else match.reached.trials.confidence
        curves = match.warp(with_confidence(trials, hidden))
        offsets = match.offsets_in("percent").astype(curves.dtype)
        if trials.kind == "rows":
            return np.concatenate([curves[:, :, 0], offsets], axis=1)
        out = np.concatenate([curves, offsets[:, :, np.newaxis]], axis=2)
        return restore(self, trials, out, frames=range(self.n_frames_))

    def match(self, X: TrialsLike, **params: Any) -> Match:
        """Match trials to the pattern, as the synchronizer does.

        Parameters
        ----------
        X : list of arrays (n_frames_i, n_features), 3-D array, or 2-D array
            Trials; the rows of a 2-D array are univariate ones.
        **params : dict
            Metadata for the ``match`` of the synchronizer, such as ``keyframes``.

        Returns
        -------
        Match
            The warps of X.
        """
        check_is_fitted(self)
        return self.synchronizer_.match(X, **params)

    def get_feature_names_out(self, input_features: NamesLike | None = None) -> np.ndarray:
        """Names of the outputs: those of the synchronizer, then ``"offset"``.

        Parameters
        ----------
        input_features : array-like of str, default=None
            Names of the features, by default those seen in ``fit``, or x0, x1, ...

        Returns
        -------
        ndarray of str
            For 2-D input a name for each frame of the curve, then for each of the offset.
        """
        check_is_fitted(self)
        names = self.synchronizer_.get_feature_names_out(input_features)
        of_timing = [_OFFSET]
        if self._fitted_on_rows:
            of_timing = [f"{_OFFSET}{p}" for p in range(self.n_frames_)]
        return np.concatenate([names, np.asarray(of_timing, dtype=object)])

    def get_metadata_routing(self):
        """Metadata routing of this object.

        Returns
        -------
        MetadataRouter
            Metadata of ``fit`` and ``transform`` are those of the same methods of the synchronizer.
        """
        mapping = MethodMapping()
        for method in ("fit", "transform"):
            mapping.add(caller=method, callee=method)
            # scikit-learn 1.6 asks a step of a pipeline for this one.
            mapping.add(caller="fit_transform", callee=method)
        router = MetadataRouter(owner=type(self).__name__)
        return router.add(synchronizer=self.synchronizer, method_mapping=mapping)

    def __sklearn_tags__(self):
        tags = super().__sklearn_tags__()
        tags.input_tags.three_d_array = True
        tags.input_tags.allow_nan = get_tags(self.synchronizer).input_tags.allow_nan
        tags.transformer_tags.preserves_dtype = ["float64", "float32"]
        return tags

    def _route(self, method, params):
        """The metadata that a method of the synchronizer is given."""
        if not params or not _routes_metadata():
            return params
        return process_routing(self, method, **params).synchronizer[method]


def _routes_metadata():
    return get_config()["enable_metadata_routing"]
