"""The common clock: what every synchronizer does alike (Eqs. 6, 7, 18)."""

from numbers import Integral

import numpy as np
from sklearn.base import BaseEstimator, TransformerMixin, _fit_context
from sklearn.utils._param_validation import Interval, StrOptions
from sklearn.utils.validation import check_is_fitted

from .median import Median, first_smallest
from .notebook import DocumentedMixin
from .sampling import sample
from .sequences import check_performances, restore


class Synchronizer(DocumentedMixin, TransformerMixin, BaseEstimator):
    """What all synchronizers share: clock, pattern, and warping along matched times.

    A subclass matches performances to the pattern (``_match``); it may choose the median in a way
    of its own (``_choose_median``), and learn something before (``_prepare``) and after
    (``_learn``). ``extra`` is what it takes besides performances.
    """

    _parameter_constraints: dict = {
        "n_frames": [Interval(Integral, 2, None, closed="left"), None],
        "pattern": [
            StrOptions({"median"}),
            Interval(Integral, 0, None, closed="left"),
            "array-like",
        ],
    }

    @_fit_context(prefer_skip_nested_validation=True)
    def fit(self, X, y=None):
        """Choose the pattern, the performance whose clock all others will follow.

        Parameters
        ----------
        X : list of arrays (n_frames_i, n_features), 3-D array, or 2-D array
            Performances; the rows of a 2-D array are univariate ones.
        y : ignored

        Returns
        -------
        self

        Raises
        ------
        ValueError
            If the input breaks the contract, or the pattern does not exist or fit.
        """
        return self._fit(check_performances(self, X, reset=True, level="sequence").arrays)

    def transform(self, X):
        """Warp performances onto the clock of the pattern (Eq. 18).

        Parameters
        ----------
        X : list of arrays (n_frames_i, n_features), 3-D array, or 2-D array

        Returns
        -------
        ndarray, shape (n_sequences, P, n_features)
            ``(n_sequences, P)`` for 2-D input; a ``(performance, frame)`` frame under
            ``set_output(transform="pandas")``.
        """
        check_is_fitted(self)
        return self._warp(check_performances(self, X, reset=False, level="sequence"))

    def match(self, X):
        """Match performances to the pattern.

        Parameters
        ----------
        X : list of arrays (n_frames_i, n_features), 3-D array, or 2-D array

        Returns
        -------
        Match
            ``offsets`` Delta(p) and ``times`` tau(p), shape (n_sequences, P), in frames of
            the pattern, both on performances linearly normalised to its length (Eq. 7), and
            ``distances``, shape (n_sequences,). tau is non-decreasing, ``tau(0) = 0``,
            ``tau(P-1) = P-1``.
        """
        check_is_fitted(self)
        return self._match(check_performances(self, X, reset=False, level="sequence").arrays)

    def _fit(self, arrays, **extra):
        try:
            return self._fit_clock(arrays, **extra)
        except BaseException:
            # Half a fit is none: whatever stopped it, the estimator is not fitted.
            for name in [name for name in vars(self) if name.endswith("_")]:
                delattr(self, name)
            raise

    def _fit_clock(self, arrays, **extra):
        given = self._given_pattern(arrays)
        self.n_frames_ = self._choose_n_frames(arrays, given)
        on_clock = self._normalise(arrays, np.arange(self.n_frames_))
        features = self._prepare(arrays, on_clock, **extra)
        wanted = isinstance(self.pattern, str)
        median = self._choose_median(features, wanted)
        self.global_distances_ = median.distances
        self.pattern_index_ = median.index if wanted else None
        if not wanted and given is None:
            self.pattern_index_ = int(self.pattern)
        source = arrays[self.pattern_index_] if given is None else given
        self.pattern_ = self._normalise([source], np.arange(self.n_frames_))[0]
        self._learn(arrays, on_clock, source, median.estimates)
        return self

    def _warp(self, performances, **extra):
        times = self._match(performances.arrays, **extra).times
        out = sample(performances.arrays, times, self.n_frames_)
        if performances.kind == "rows":
            return out[:, :, 0]
        return restore(self, performances, out, frames=range(self.n_frames_))

    def _prepare(self, arrays, on_clock):
        """What performances are to be compared by."""
        return on_clock

    def _choose_median(self, features, wanted):
        """The median performance (Eq. 19); or only what else is needed of it if not wanted."""
        if not wanted:
            unknown = np.full(len(features), np.nan)
            return Median(None, unknown, unknown, False, 0)
        sums = distances_to_all(features)
        rounding = rounding_of(features - features.mean(axis=(0, 1)))
        return Median(first_smallest(sums, rounding), sums, sums, True, 0)

    def _learn(self, arrays, on_clock, source, estimates):
        pass

    def get_feature_names_out(self, input_features=None):
        """Names of the outputs: the features of a frame; for 2-D input, one name a frame.

        Parameters
        ----------
        input_features : array-like of str, default=None
            Names of the features, by default those seen in ``fit``, or x0, x1, ...

        Returns
        -------
        ndarray of str
        """
        check_is_fitted(self)
        names = getattr(self, "feature_names_in_", None)
        if input_features is not None:
            if len(input_features) != self.n_features_in_:
                raise ValueError(
                    "input_features should have length equal to number of features "
                    f"({self.n_features_in_}), got {len(input_features)}."
                )
            if names is not None and not np.array_equal(names, input_features):
                raise ValueError("input_features is not equal to feature_names_in_.")
            names = input_features
        if self._fitted_on_rows:
            names = [f"{type(self).__name__.lower()}{p}" for p in range(self.n_frames_)]
        elif names is None:
            names = [f"x{i}" for i in range(self.n_features_in_)]
        return np.asarray(names, dtype=object)

    def __sklearn_tags__(self):
        tags = super().__sklearn_tags__()
        tags.input_tags.three_d_array = True
        tags.transformer_tags.preserves_dtype = ["float64", "float32"]
        return tags

    def _given_pattern(self, arrays):
        """The pattern as an array, if that is what was given; indices are checked."""
        pattern = self.pattern
        if isinstance(pattern, str):
            return None
        if isinstance(pattern, Integral):
            if pattern >= len(arrays):
                raise ValueError(
                    f"pattern={pattern} is out of range: there are {len(arrays)} performances, the "
                    f"last has index {len(arrays) - 1}."
                )
            return None
        pattern = np.asarray(pattern, dtype=arrays[0].dtype)
        pattern = pattern[:, np.newaxis] if pattern.ndim == 1 else pattern
        width = arrays[0].shape[1]
        if pattern.ndim != 2 or len(pattern) < 2 or pattern.shape[1] != width:
            raise ValueError(
                f"A pattern given as an array must have shape (n_frames, {width}) with at least 2 "
                f"frames, like the performances; got {pattern.shape}."
            )
        if not np.isfinite(pattern).all():
            raise ValueError("The pattern has NaN or infinite values; interpolate its gaps.")
        return pattern

    def _choose_n_frames(self, arrays, given):
        if self.n_frames is not None:
            return int(self.n_frames)
        if given is not None:
            return len(given)
        return int(np.median([len(a) for a in arrays]))

    def _find_pattern(self, arrays):
        """The index of the pattern among performances; None if it is not one of them."""
        index = self.pattern_index_
        if index is None or index >= len(arrays):
            return None
        same = self._normalise([arrays[index]], np.arange(self.n_frames_))[0]
        return index if np.array_equal(same, self.pattern_) else None

    def _normalise(self, arrays, times):
        """Linear normalisation (Eq. 7): every performance at the same times of its course."""
        # As many times as frames on the clock are its frames.
        if len(times) == self.n_frames_ and all(len(x) == self.n_frames_ for x in arrays):
            return np.stack(arrays)
        return sample(arrays, np.broadcast_to(times, (len(arrays), len(times))), self.n_frames_)


def rounding_of(deviations):
    """How far rounding can move a global distance of such sequences, given without their mean."""
    energy = np.einsum("npk,npk->", deviations, deviations, dtype=np.float64)
    return 8 * np.finfo(deviations.dtype).eps * energy


def distances_to_all(on_clock):
    """``sum_m |x_n - x_m|^2`` for every n: N |x_n - mean|^2 and a constant, without pairs."""
    deviations = (on_clock - on_clock.mean(axis=0)).reshape(len(on_clock), -1)
    squares = np.einsum("ij,ij->i", deviations, deviations, dtype=np.float64)
    return len(on_clock) * squares + squares.sum()
