"""Putting performances on one clock (Eqs. 7, 18, 19)."""

from numbers import Integral, Real

import numpy as np
from sklearn.base import BaseEstimator, TransformerMixin, _fit_context
from sklearn.utils._param_validation import Interval, StrOptions
from sklearn.utils.validation import check_is_fitted

from .matching import Match, Trellis, step_table
from .sequences import check_performances, restore

__all__ = ["DenseSynchronizer", "LinearSynchronizer"]

# Bases handled between two looks at the result: bounds the memory of all pairs.
_BASES_AT_ONCE = 256


class _Synchronizer(TransformerMixin, BaseEstimator):
    """What all synchronizers share: clock, pattern, and warping along matched times.

    A subclass says how performances are compared (``_prepare``, ``_global_distances``) and
    matched to the pattern (``_match``).
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
        arrays = check_performances(self, X, reset=True, level="sequence").arrays
        given = self._given_pattern(arrays)
        self.n_frames_ = self._choose_n_frames(arrays, given)
        on_clock = self._normalise(arrays, np.arange(self.n_frames_))
        self._prepare(on_clock)
        self.global_distances_ = np.full(len(arrays), np.nan)
        if given is not None:
            self.pattern_index_ = None
            self.pattern_ = self._normalise([given], np.arange(self.n_frames_))[0]
            return self
        if isinstance(self.pattern, str):
            self.global_distances_ = self._global_distances(arrays, on_clock)
            self.pattern_index_ = _first_smallest(self.global_distances_, self._rounding(on_clock))
        else:
            self.pattern_index_ = int(self.pattern)
        self.pattern_ = on_clock[self.pattern_index_].copy()
        return self

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
        performances = check_performances(self, X, reset=False, level="sequence")
        times = self._match(performances.arrays).times
        out = self._sample(performances.arrays, times)
        if performances.kind == "rows":
            return out[:, :, 0]
        return restore(self, performances, out, frames=range(self.n_frames_))

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

    def _normalise(self, arrays, times):
        """Linear normalisation (Eq. 7): every performance at the same times of its course."""
        return self._sample(arrays, np.broadcast_to(times, (len(arrays), len(times))))

    def _sample(self, arrays, times):
        """Performances at times in pattern frames, linear between their own frames (Eq. 18)."""
        out = np.empty((len(arrays), times.shape[1], arrays[0].shape[1]), dtype=arrays[0].dtype)
        for i, x in enumerate(arrays):
            # In this order a whole number of frames stays whole.
            at = times[i] * (len(x) - 1) / (self.n_frames_ - 1)
            left = np.minimum(at.astype(np.intp), len(x) - 2)
            weight = (at - left).astype(x.dtype)[:, np.newaxis]
            out[i] = x[left] * (1 - weight) + x[left + 1] * weight
        return out

    def _rounding(self, on_clock):
        """How far rounding can move a global distance."""
        energy = np.square(on_clock - on_clock.mean(axis=(0, 1))).sum(dtype=np.float64)
        return 8 * np.finfo(on_clock.dtype).eps * energy


class LinearSynchronizer(_Synchronizer):
    """Linear normalisation (Eq. 7): the same number of frames, no matching.

    The baseline that every other synchronizer is held against: each performance is
    stretched evenly to ``n_frames``; the pattern only serves as reference.

    Parameters
    ----------
    n_frames : int, default=None
        Frames of the common clock; by default the median length of the performances, or
        the length of a pattern given as an array.
    pattern : "median", int or array (n_frames, n_features), default="median"
        The reference of ``match``: the performance with the smallest sum of distances
        (Eq. 19, without matching), one chosen by its index, or another one.

    Attributes
    ----------
    pattern_ : ndarray, shape (P, n_features)
        The pattern on the common clock.
    pattern_index_ : int or None
        Its index in the training set; None if it was given as an array.
    n_frames_ : int
        ``P``.
    global_distances_ : ndarray, shape (n_sequences,)
        ``C_n`` of Eq. 19 for every performance; NaN if the pattern was given.
    n_features_in_ : int
        Features of a frame (columns, for 2-D input).
    feature_names_in_ : ndarray of str
        Names of the features; only if the input had names.

    See Also
    --------
    DenseSynchronizer : Follows the changes of pace within a performance.

    Examples
    --------
    >>> import numpy as np
    >>> from sklearn_motionsync import LinearSynchronizer
    >>> X = [np.arange(5.0)[:, None], np.arange(9.0)[:, None] / 2]
    >>> LinearSynchronizer(n_frames=5).fit_transform(X)[1].ravel().tolist()
    [0.0, 1.0, 2.0, 3.0, 4.0]
    """

    def __init__(self, n_frames=None, pattern="median"):
        self.n_frames = n_frames
        self.pattern = pattern

    def _prepare(self, on_clock):
        pass

    def _global_distances(self, arrays, on_clock):
        # sum_m |x_n - x_m|^2 = N |x_n - mean|^2 + a constant: no pairs are needed.
        deviations = (on_clock - on_clock.mean(axis=0)).reshape(len(on_clock), -1)
        squares = np.einsum("ij,ij->i", deviations, deviations, dtype=np.float64)
        return len(arrays) * squares + squares.sum()

    def _match(self, arrays):
        clock = np.arange(self.n_frames_, dtype=np.float64)
        on_clock = self._normalise(arrays, clock)
        distances = np.square(on_clock - self.pattern_).sum(axis=(1, 2))
        times = np.tile(clock, (len(arrays), 1))
        return Match(np.zeros_like(times), times, distances)


class DenseSynchronizer(_Synchronizer):
    """Synchronise performances by dense matching to the median one.

    1. Normalise all performances linearly to ``P`` frames (Eq. 7).
    2. Match every ordered pair: dynamic programming finds the offsets Delta(p) that
       minimise the synchronisation distance ``D_{n,m}`` (Eqs. 12-17)::

           sum_p |x_n(p) - x_m(p + Delta(p))|^2 + mu sum_p |Delta(p+1) - Delta(p)|

       with both ends pinned and the local rate between 0 and ``max_rate``.
    3. The pattern is the performance with the smallest global distance
       ``C_n = sum_m D_{n,m}`` (Eq. 19), the "median" one.
    4. ``transform`` matches performances to the pattern and samples them at
       ``tau(p) = p + Delta(p)`` (Eq. 18).

    Parameters
    ----------
    n_frames : int, default=None
        ``P``, frames of the common clock; by default the median length of the performances,
        or the length of a pattern given as an array. Time and memory grow with its square.
    pattern : "median", int or array (n_frames, n_features), default="median"
        The median performance, one chosen by its index, or another one.
    cost : {"posture"}, default="posture"
        What is compared: the aSpace points.
    smoothness : float, default=0.05
        Weight of the changes of pace, a pure number: ``mu`` is ``smoothness`` times the
        mean squared distance of the training postures from their mean.
    max_offset : float, default=0.25
        Largest offset, as a share of ``n_frames``, in [0, 1].
    max_rate : float, default=2
        Largest local rate; 2 is the limit of Eq. 13.
    subframes : int, default=1
        Positions a frame at which a path may stand; 1 in the paper.

    Attributes
    ----------
    pattern_ : ndarray, shape (P, n_features)
        The pattern on the common clock.
    pattern_index_ : int or None
        Its index in the training set; None if it was given as an array.
    n_frames_ : int
        ``P``.
    global_distances_ : ndarray, shape (n_sequences,)
        ``C_n`` of Eq. 19 for every performance; NaN if the pattern was given.
    mu_ : float
        The absolute weight of the changes of pace.
    n_features_in_ : int
        Features of a frame (columns, for 2-D input).
    feature_names_in_ : ndarray of str
        Names of the features; only if the input had names.

    See Also
    --------
    LinearSynchronizer : The baseline without matching.
    ActionModel : What the synchronised performances have in common.

    References
    ----------
    M. Mozerov, I. Rius, X. Roca, J. Gonzalez, "3D Human Motion Sequences Synchronization
    Using Dense Matching Algorithm".

    Examples
    --------
    A known warp is found again: the second performance runs late in its first half.

    >>> import numpy as np
    >>> from sklearn_motionsync import DenseSynchronizer
    >>> t = np.linspace(0, 1, 101)
    >>> def circle(phase):
    ...     return np.column_stack([np.cos(4 * phase), np.sin(4 * phase)])
    >>> X = [circle(t), circle(t**1.3)]
    >>> sync = DenseSynchronizer(pattern=0, smoothness=0.001).fit(X)
    >>> late = sync.match(X).offsets[1]
    >>> bool(np.abs(late - 100 * (t ** (1 / 1.3) - t)).max() <= 1)
    True
    >>> sync.transform(X).shape
    (2, 101, 2)
    """

    _parameter_constraints: dict = {
        **_Synchronizer._parameter_constraints,
        "cost": [StrOptions({"posture"})],
        "smoothness": [Interval(Real, 0, None, closed="left")],
        "max_offset": [Interval(Real, 0, 1, closed="both")],
        "max_rate": [Interval(Real, 1, None, closed="left")],
        "subframes": [Interval(Integral, 1, None, closed="left")],
    }

    def __init__(
        self,
        n_frames=None,
        pattern="median",
        cost="posture",
        smoothness=0.05,
        max_offset=0.25,
        max_rate=2,
        subframes=1,
    ):
        self.n_frames = n_frames
        self.pattern = pattern
        self.cost = cost
        self.smoothness = smoothness
        self.max_offset = max_offset
        self.max_rate = max_rate
        self.subframes = subframes

    def _prepare(self, on_clock):
        # Centred features keep the inner products of the trellis small.
        self._centre = on_clock.mean(axis=(0, 1))
        spread = np.square(on_clock - self._centre).sum(axis=2).mean(dtype=np.float64)
        self.mu_ = float(self.smoothness * spread)

    def _trellis(self):
        table = step_table(self.cost, self.max_rate, self.subframes)
        # A product such as 0.29 * 100 must not lose a frame to rounding.
        reach = int(np.floor(self.max_offset * self.n_frames_ * (1 + 1e-12)))
        return Trellis(table, self.mu_, min(reach, self.n_frames_ - 1))

    def _moving(self, arrays):
        """Centred features at every sub-position."""
        n_positions = (self.n_frames_ - 1) * self.subframes + 1
        return self._normalise(arrays, np.arange(n_positions) / self.subframes) - self._centre

    def _global_distances(self, arrays, on_clock):
        trellis, bases = self._trellis(), on_clock - self._centre
        moving = bases if self.subframes == 1 else self._moving(arrays)
        sums = [
            trellis.distances(bases[i : i + _BASES_AT_ONCE], moving).sum(axis=1, dtype=np.float64)
            for i in range(0, len(bases), _BASES_AT_ONCE)
        ]
        return np.concatenate(sums)

    def _match(self, arrays):
        base = self.pattern_ - self._centre
        distances, disparities = self._trellis().paths(base, self._moving(arrays))
        offsets = disparities / self.subframes
        return Match(offsets, np.arange(self.n_frames_) + offsets, distances)


def _first_smallest(values, rounding):
    """The first index whose value is the smallest but for rounding."""
    return int(np.flatnonzero(values <= values.min() + rounding)[0])
