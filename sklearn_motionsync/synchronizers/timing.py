"""TimingChannel: synchronised performances, with their timing as one feature more."""

from numbers import Real

import numpy as np
from sklearn import get_config
from sklearn.base import BaseEstimator, MetaEstimatorMixin, TransformerMixin, _fit_context, clone
from sklearn.utils._param_validation import Interval, StrOptions
from sklearn.utils.metadata_routing import (
    MetadataRouter,
    MethodMapping,
    get_routing_for_object,
    process_routing,
)
from sklearn.utils.validation import check_is_fitted

from ..inputs.validation import restore
from ..utils.atomic import atomic_fit, snapshot
from ..utils.doc_links import DocumentedMixin
from .base import Synchronizer
from .match import UNITS, check_answer

__all__ = ["TimingChannel"]


class TimingChannel(DocumentedMixin, MetaEstimatorMixin, TransformerMixin, BaseEstimator):
    """Synchronised performances, with how they are timed as one feature more.

    Synchronising takes the differences in timing out of the curves. This puts them beside the
    curves, so that whatever comes next, such as principal components, a test along the clock, or a
    classifier, sees shape and timing.

    Parameters
    ----------
    synchronizer : Synchronizer
        Such as ``DenseSynchronizer()``; a clone of it is fitted.
    channel : {"offset", "log_rate"}, default="offset"
        What is appended: how much later than the pattern a performance is
        (``Match.offsets_in(unit)``), or the log rate (``np.log(Match.rates)``), which has no unit
        and is positive where a performance is slower.
    unit : {"percent", "frames", "seconds"}, default="percent"
        Of the offset: per cent of the clock, frames of the pattern, or seconds of each
        performance.
    frame_rate : float, default=None
        Frames a second of the performances, for seconds only.

    Attributes
    ----------
    synchronizer_ : Synchronizer
        Fitted.
    pattern_ : ndarray, shape (P, n_features)
        Of the synchronizer, without the channel, as are all that follow.
    pattern_index_ : int or None
    n_frames_ : int
    n_features_in_ : int
    feature_names_in_ : ndarray of str
        Only if the input had names.

    See Also
    --------
    Match : Offsets and rates as arrays, and as a table.
    metrics.amplitude_phase_variance : How much of the spread is timing.

    Notes
    -----
    The channel has a unit of its own. Scale the features before they are compared with it or
    summed over, as in principal components.

    What the synchronizer takes besides, such as ``keyframes``, is given to ``fit`` and
    ``transform`` by name; with scikit-learn's metadata routing as it asks for it, by
    ``set_fit_request`` and ``set_transform_request`` of the synchronizer.

    Examples
    --------
    The second performance reaches its peak at 60 % instead of 50 % of the time.

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

    _parameter_constraints: dict = {
        "synchronizer": [Synchronizer],
        "channel": [StrOptions({"offset", "log_rate"})],
        "unit": [StrOptions(set(UNITS))],
        "frame_rate": [Interval(Real, 0, None, closed="neither"), None],
    }

    def __init__(self, synchronizer, channel="offset", unit="percent", frame_rate=None):
        self.synchronizer = synchronizer
        self.channel = channel
        self.unit = unit
        self.frame_rate = frame_rate

    @atomic_fit
    @_fit_context(prefer_skip_nested_validation=False)
    def fit(self, X, y=None, **params):
        """Fit a clone of the synchronizer.

        Parameters
        ----------
        X : list of arrays (n_frames_i, n_features), 3-D array, or 2-D array
            Performances; the rows of a 2-D array are univariate ones.
        y : ignored, but for synchronizers that use it
        **params : dict
            What the ``fit`` of the synchronizer takes besides, such as ``keyframes``.

        Returns
        -------
        self

        Raises
        ------
        ValueError
            If the frame rate for seconds is missing, or a feature is called as the channel would
            be; and as from the ``fit`` of the synchronizer.
        """
        if self.channel == "offset" and self.unit == "seconds" and self.frame_rate is None:
            raise ValueError("unit='seconds' needs frame_rate, frames a second of X.")
        given = self._for_synchronizer("fit", params)
        self.synchronizer_ = clone(self.synchronizer).fit(X, y, **given)
        if self.channel in getattr(self, "feature_names_in_", ()):
            raise ValueError(
                f"A feature of X is called {self.channel!r}, as the channel would be: rename it, "
                "or leave it out."
            )
        self._fitted_on_rows = self.synchronizer_.check_performances(X).kind == "rows"
        return self

    @atomic_fit
    def fit_transform(self, X, y=None, **params):
        """Fit, and transform the same performances.

        Parameters
        ----------
        X, y, **params : as for ``fit``

        Returns
        -------
        As ``transform``
        """
        if not _routes_metadata():
            return self.fit(X, y, **params).transform(X, **params)
        router = get_routing_for_object(self)
        fits, warps = (set(router.consumes(method, params)) for method in ("fit", "transform"))
        # What nobody asks for is refused in fit.
        to_fit = {name: params[name] for name in params if name in fits or name not in warps}
        return self.fit(X, y, **to_fit).transform(X, **{name: params[name] for name in warps})

    @snapshot
    def transform(self, X, **params):
        """Warp performances onto the clock of the pattern, and append the channel.

        Parameters
        ----------
        X : list of arrays (n_frames_i, n_features), 3-D array, or 2-D array
        **params : dict
            What the ``match`` of the synchronizer takes besides, such as ``keyframes``.

        Returns
        -------
        ndarray, shape (n_sequences, P, n_features + 1)
            The channel is the last feature. Of 2-D input ``(n_sequences, 2 P)``: each row is its
            curve, then its channel. A ``(performance, frame)`` frame under
            ``set_output(transform="pandas")``.
        """
        performances = self.check_performances(X)
        match = self.match(performances, **self._for_synchronizer("transform", params))
        check_answer(match, len(performances), self.n_frames_, type(self.synchronizer_).__name__)
        curves = match.warp(performances)
        channel = self._channel(match, performances).astype(curves.dtype)
        if performances.kind == "rows":
            return np.concatenate([curves[:, :, 0], channel], axis=1)
        out = np.concatenate([curves, channel[:, :, np.newaxis]], axis=2)
        return restore(self, performances, out, frames=range(self.n_frames_))

    def match(self, X, **params):
        """Match performances to the pattern, as the synchronizer does.

        Parameters
        ----------
        X : list of arrays (n_frames_i, n_features), 3-D array, or 2-D array
        **params : dict
            What the ``match`` of the synchronizer takes besides, such as ``keyframes``.

        Returns
        -------
        Match
        """
        check_is_fitted(self)
        return self.synchronizer_.match(X, **params)

    def normalize(self, X):
        """Normalise performances linearly to the clock of the pattern (Eq. 7).

        Parameters
        ----------
        X : list of arrays (n_frames_i, n_features), 3-D array, or 2-D array

        Returns
        -------
        ndarray, shape (n_sequences, P, n_features)
            Without the channel.
        """
        check_is_fitted(self)
        return self.synchronizer_.normalize(X)

    def check_performances(self, X):
        """Check performances as the synchronizer does.

        Parameters
        ----------
        X : list of arrays (n_frames_i, n_features), 3-D array, or 2-D array

        Returns
        -------
        sequence of ndarray (n_frames_i, n_features)
        """
        check_is_fitted(self)
        return self.synchronizer_.check_performances(X)

    def get_feature_names_out(self, input_features=None):
        """Names of the outputs: those of the synchronizer, and ``"offset"`` or ``"log_rate"``.

        Parameters
        ----------
        input_features : array-like of str, default=None
            Names of the features, by default those seen in ``fit``, or x0, x1, ...

        Returns
        -------
        ndarray of str
            For 2-D input one name a frame of the curve, then one a frame of the channel.
        """
        check_is_fitted(self)
        names = self.synchronizer_.get_feature_names_out(input_features)
        own = [self.channel]
        if self._fitted_on_rows:
            own = [f"{self.channel}{p}" for p in range(self.n_frames_)]
        return np.concatenate([names, np.asarray(own, dtype=object)])

    def get_metadata_routing(self):
        """What is handed on to the synchronizer.

        Returns
        -------
        MetadataRouter
        """
        mapping = MethodMapping()
        for method in ("fit", "transform"):
            mapping.add(caller=method, callee=method)
        router = MetadataRouter(owner=type(self).__name__)
        return router.add(synchronizer=self.synchronizer, method_mapping=mapping)

    @property
    def pattern_(self):
        return self.synchronizer_.pattern_

    @property
    def pattern_index_(self):
        return self.synchronizer_.pattern_index_

    @property
    def n_frames_(self):
        return self.synchronizer_.n_frames_

    @property
    def n_features_in_(self):
        return self.synchronizer_.n_features_in_

    @property
    def feature_names_in_(self):
        return self.synchronizer_.feature_names_in_

    def __sklearn_tags__(self):
        tags = super().__sklearn_tags__()
        tags.input_tags.three_d_array = True
        tags.transformer_tags.preserves_dtype = ["float64", "float32"]
        return tags

    def _for_synchronizer(self, method, params):
        if not params or not _routes_metadata():
            return params
        return process_routing(self, method, **params).synchronizer[method]

    def _channel(self, match, performances):
        if self.channel == "log_rate":
            return np.log(match.rates)
        lengths = [len(x) for x in performances]
        return match.offsets_in(self.unit, lengths, self.frame_rate)


def _routes_metadata():
    return get_config()["enable_metadata_routing"]
