"""Synchronizer: the clock, the pattern and the warp to it, which all share (Eqs. 6, 7, 18)."""

from __future__ import annotations

from numbers import Integral
from typing import Any, ClassVar, Literal, NamedTuple, Self

import numpy as np
from sklearn.base import (
    BaseEstimator,
    OneToOneFeatureMixin,
    TransformerMixin,
)
from sklearn.utils._param_validation import Interval, StrOptions
from sklearn.utils.validation import check_is_fitted

from ..inputs.collections import Performances, as_source
from ..inputs.features import check_input_features
from ..inputs.numbers import as_numbers, check_finite, check_magnitude, check_names
from ..inputs.types import FitTransform, NamesLike, PerformanceLike, PerformancesLike, Transformed
from ..inputs.validation import (
    SequenceLevelMixin,
    labels_of_parts,
    names_of_input,
    read_source,
    restore,
)
from ..inputs.wording import counted
from ..matching.filters import SMOOTHING
from ..matching.matcher import Features
from ..matching.median import Median, linear_median
from ..matching.units import Unit
from ..matching.warps import normalise
from ..utils.atomic import atomic_fit, snapshot, whole_fit_transform
from ..utils.doc_links import DocumentedMixin
from ..utils.parallel import LongWorkMixin
from ..utils.parameters import validated
from .gaps import (
    check_fill,
    fill_performances,
    fill_warped,
    hold_gaps,
    learn_filler,
    with_confidence,
)
from .intervals import Intervals, joined
from .match import Match, check_match

__all__ = ["Synchronizer", "TrainingSet"]

# Most bytes of a training set on the clock; a fit holds several copies.
MOST_BYTES = 4 * 2**30
# Most performances in ``examples_``.
_MOST_EXAMPLES = 64


class TrainingSet(NamedTuple):
    """A training set, as given and on the common clock.

    Attributes
    ----------
    performances : Performances
    unit : Unit
        Their centre and scale.
    scaled : ndarray, shape (n_sequences, P, n_features)
        Linearly normalised (Eq. 7), in this unit.
    given : ndarray, shape (n_frames, n_features), or None
        The pattern, if it was given as an array.
    """

    performances: Performances
    unit: Unit
    scaled: np.ndarray
    given: np.ndarray | None


class Synchronizer(
    DocumentedMixin, LongWorkMixin, SequenceLevelMixin, TransformerMixin, BaseEstimator
):
    """Base class of all synchronizers: a subclass defines ``match``.

    It inherits ``fit``, which chooses the pattern after linear normalisation,
    ``transform``, pandas output, and what scorers and displays need. These call ``match`` with
    a sequence of checked arrays, users with any collection; ``normalize`` and
    ``check_performances`` take both. A subclass with further parameters defines ``__init__``, as
    in scikit-learn, with ``n_frames`` and ``pattern`` among them.

    Parameters
    ----------
    n_frames : int, default=None
        Frames of the common clock; by default the median length of the performances, or
        the length of a pattern given as an array.
    pattern : "median", int or array (n_frames, n_features), default="median"
        The performance with the smallest sum of squared distances to all others after linear
        normalisation, one chosen by its index, or another one.

    Attributes
    ----------
    pattern_ : ndarray, shape (P, n_features)
        The pattern on the common clock.
    pattern_index_ : int or None
        Its index in the training set; None if it was given as an array.
    n_frames_ : int
        ``P``.
    global_distances_ : ndarray, shape (n_sequences,)
        Sum of the squared distances of each performance to all others; NaN if the pattern was
        given.
    lengths_ : ndarray of int, shape (n_sequences,)
        Numbers of frames of the training performances.
    examples_ : ndarray, shape (min(n_sequences, 64), P, n_features)
        Training performances linearly normalised: all, or 64 of them, evenly spaced.
    features_ : callable
        Turns postures on the clock into the features that are compared.
    n_features_in_ : int
        Features of a frame (columns, for 2-D input).
    feature_names_in_ : ndarray of str
        Names of the features; only if the input had names.

    See Also
    --------
    Match : The result of ``match``.
    DenseSynchronizer : The recommended synchronizer.

    Examples
    --------
    A synchronizer that lets the largest value of the first feature coincide.

    >>> import numpy as np
    >>> from sklearn_motionsync import Match, Synchronizer
    >>> class PeakSynchronizer(Synchronizer):
    ...     def match(self, X):
    ...         peaks = self.normalize(X)[:, 1:-1, 0].argmax(axis=1) + 1
    ...         peak, last = self.pattern_[1:-1, 0].argmax() + 1, self.n_frames_ - 1
    ...         frames = np.arange(self.n_frames_)
    ...         return Match([np.interp(frames, [0, peak, last], [0, p, last]) for p in peaks])
    >>> X = [np.eye(9)[[2]].T, np.eye(9)[[4]].T]
    >>> PeakSynchronizer(pattern=0).fit_transform(X).argmax(axis=1).ravel().tolist()
    [2, 2]
    """

    _parameter_constraints: dict = {
        "n_frames": [Interval(Integral, 2, None, closed="left"), None],
        "pattern": [
            StrOptions({"median"}),
            Interval(Integral, 0, None, closed="left"),
            "array-like",
        ],
    }

    pattern_: np.ndarray
    pattern_index_: Any
    n_frames_: int
    global_distances_: np.ndarray
    lengths_: np.ndarray
    examples_: np.ndarray

    # Advice of the error if the training set does not fit into memory.
    _SMALLER = "fewer frames or performances"

    def __init__(
        self,
        n_frames: int | None = None,
        pattern: PerformanceLike | int | Literal["median"] = "median",
    ) -> None:
        self.n_frames = n_frames
        self.pattern = pattern

    @atomic_fit
    @validated
    def fit(self, X: PerformancesLike, y: object = None) -> Self:
        """Choose the pattern, the performance to whose clock all others are warped.

        Parameters
        ----------
        X : list of arrays (n_frames_i, n_features), 3-D array, or 2-D array
            Performances; the rows of a 2-D array are univariate ones.
        y : ignored
            Present for API consistency.

        Returns
        -------
        self : Synchronizer
            The fitted synchronizer.

        Raises
        ------
        ValueError
            If the input breaks the contract, or the pattern does not exist or fit.
        """
        with self._progress(fits=True) as progress:
            self._learn(self._check_training_set(X), progress)
            self._number_as_given()
        return self

    fit_transform: ClassVar[FitTransform] = whole_fit_transform

    def transform(self, X: PerformancesLike, fill: Literal["model"] | None = None) -> Transformed:
        """Warp performances onto the clock of the pattern (Eq. 18).

        Parameters
        ----------
        X : list of arrays (n_frames_i, n_features), 3-D array, or 2-D array
            Performances. Memory maps, and collections that give performances by index, are read in
            parts, once each; rows of a matrix are loaded into memory.
        fill : {None, "model"}, default=None
            What becomes of NaN, which is what was hidden. None: it stays NaN, feature by feature.
            "model": it is filled from the mean of the warped training set (``examples_``) at the
            same moment, moved by how far the performance is from the mean around the gap, and in
            the features that are seen.

        Returns
        -------
        ndarray, shape (n_sequences, P, n_features)
            ``(n_sequences, P)`` for 2-D input; a ``(performance, frame)`` frame under
            ``set_output(transform="pandas")``.

        Raises
        ------
        ValueError
            If the input breaks the contract, or there is no such ``fill``.
        """
        return self._warp(X, fill)

    def match(self, X: PerformancesLike) -> Match:
        """Match performances to the pattern.

        Parameters
        ----------
        X : list of arrays (n_frames_i, n_features), 3-D array, or 2-D array
            Performances; the rows of a 2-D array are univariate ones.

        Returns
        -------
        Match
            ``offsets`` Delta(p) and ``times`` tau(p), shape (n_sequences, P), in frames of
            the pattern, both of performances linearly normalised to its length (Eq. 7), and
            ``distances``, shape (n_sequences,). tau is non-decreasing, ``tau(0) = 0``,
            ``tau(P-1) = P-1``.
        """
        raise NotImplementedError(
            f"{type(self).__name__} does not define match(self, X), which returns a Match."
        )

    @snapshot
    def normalize(self, X: PerformancesLike) -> np.ndarray:
        """Normalise performances linearly to the clock of the pattern, without matching (Eq. 7).

        Parameters
        ----------
        X : list of arrays (n_frames_i, n_features), 3-D array, or 2-D array
            Performances; the rows of a 2-D array are univariate ones.

        Returns
        -------
        ndarray, shape (n_sequences, P, n_features)
            One feature for the rows of a 2-D array.
        """
        return normalise(self.check_performances(X), self.n_frames_)

    def get_feature_names_out(self, input_features: NamesLike | None = None) -> np.ndarray:
        """Names of the outputs: the features of a frame; for 2-D input, one name a frame.

        Parameters
        ----------
        input_features : array-like of str, default=None
            Names of the features, by default those seen in ``fit``, or x0, x1, ...

        Returns
        -------
        ndarray of str
            As many as the columns of the pandas output.
        """
        check_is_fitted(self)
        check_input_features(self, input_features)
        names = OneToOneFeatureMixin.get_feature_names_out(self, input_features)
        if self._fitted_on_rows:
            names = [f"{type(self).__name__.lower()}{p}" for p in range(self.n_frames_)]
        return np.asarray(names, dtype=object)

    def __sklearn_tags__(self):
        tags = super().__sklearn_tags__()
        tags.input_tags.three_d_array = True
        tags.input_tags.allow_nan = self._finite == "allow-nan"
        tags.transformer_tags.preserves_dtype = ["float64", "float32"]
        return tags

    def __getstate__(self):
        # The names of a pattern have been checked when it was fitted; not everything stores tables.
        state = super().__getstate__()
        pattern = state.get("pattern")
        return {**state, "pattern": pattern.to_numpy()} if hasattr(pattern, "columns") else state

    def _learn(self, performances, progress):
        """Learn from checked performances."""
        training = self._set_clock(performances)
        self._set_pattern(training, self._plain_median(training.scaled))

    @snapshot
    def _warp(self, X, fill=None, **params):
        check_fill(fill)
        # Further parameters are given for all performances at once.
        read = None if params else self._read_in_parts(X)
        if read is None:
            performances = self.check_performances(X)
            out = self._warp_part(performances, **params)
        else:
            performances, out = self._warp_parts(*read)
        if fill == "model" and np.isnan(out.sum()):
            fill_warped(out, self._warp_part(self._checked_examples()))
        if performances.kind == "rows":
            return out[:, :, 0]
        return restore(self, performances, out, frames=range(out.shape[1]))

    def _checked_examples(self):
        """The examples as performances."""
        return Performances(list(self.examples_), "list", list(range(len(self.examples_))))

    def _warp_part(self, performances, **params):
        return self._match(performances, **params).warp(performances)

    def _match(self, performances, **params):
        """The match of checked performances."""
        match = self.match(performances, **params)
        check_match(match, len(performances), self.n_frames_, type(self).__name__)
        return match

    def _warp_parts(self, n_sequences, parts):
        """Labels of performances that are read in parts, and these warped."""
        out, labels, levels = None, [], set()
        for part in parts:
            warped, start = self._warp_part(part), len(labels)
            if out is None:
                out = np.empty((n_sequences, *warped.shape[1:]), warped.dtype)
            labels += part.labels
            levels.add(part.levels)
            out[start : len(labels)] = warped
        return labels_of_parts(labels, levels, part.names), out

    def _read_in_parts(self, X):
        """The number of performances, and checked parts of them; None if all are in memory."""
        source = None if isinstance(X, Performances) else as_source(X)
        if source is None or len(source) == 0:
            return None
        return len(source), read_source(self, source, self._read_rows_in_fit())

    def _match_in_parts(self, X):
        """The match of performances, which may be read in parts."""
        read = self._read_in_parts(X)
        if read is None:
            return self._match(self.check_performances(X))
        parts, tells = [], False
        for part in read[1]:
            match = self._match(part)
            tells = match.intervals is not None
            parts.append((match.times, match.distances, match.mode))
        match = Match(*map(np.concatenate, zip(*parts, strict=True)))
        if tells:
            match.intervals = Intervals(match.times, lambda: self._measured_in_parts(X))
        return match

    def _measured_in_parts(self, X):
        """What the intervals of performances need, which are read and matched once more."""
        return joined(self._match(part).intervals.measured() for part in self._read_in_parts(X)[1])

    def _without_gaps(self, performances):
        """Checked performances, filled where they are NaN."""
        if not hold_gaps(performances):
            return performances
        filler = self._filler or learn_filler(self.examples_)
        return fill_performances(filler, performances)

    # -- steps of a fit ---------------------------------------------------------------------

    def _check_training_set(self, X, numbers=None, confidence=None):
        performances, self._filler = super()._check_training_set(X, numbers), None
        performances = with_confidence(performances, confidence)
        if hold_gaps(performances):
            self._filler = learn_filler(performances, names_of_input(self))
        return self._without_gaps(performances)

    def _number_as_given(self):
        """Number performances as given, if the fit is to a sample."""

    def _set_clock(self, performances, subframes=1):
        """Set the number of frames of the clock; the performances on it.

        A subclass may need ``subframes`` positions a frame.
        """
        given = self._given_pattern(performances)
        self.lengths_ = np.array([len(x) for x in performances])
        if self.n_frames is not None:
            self.n_frames_ = int(self.n_frames)
        else:
            self.n_frames_ = int(np.median(self.lengths_)) if given is None else len(given)
        n, width = len(performances), performances[0].shape[1]
        n_bytes = 8 * n * ((self.n_frames_ - 1) * subframes + 1) * width
        if n_bytes > MOST_BYTES:
            positions = f" and subframes = {subframes}" if subframes > 1 else ""
            raise ValueError(
                f"{counted(n, 'performance')} at n_frames = {self.n_frames_}{positions} take "
                f"{n_bytes / 2**30:.0f} GB several times over; {MOST_BYTES / 2**30:.0f} GB is the "
                f"limit. Use {self._SMALLER}."
            )
        on_clock = normalise(performances, self.n_frames_)
        unit = Unit.of(on_clock)
        some = np.unique(np.linspace(0, n - 1, _MOST_EXAMPLES).round().astype(np.intp))
        self.examples_ = on_clock[some]
        self.features_ = Features("velocity", 1, SMOOTHING, unit)
        return TrainingSet(performances, unit, unit(on_clock, out=on_clock), given)

    def _given_pattern(self, performances):
        """The pattern as an array, if that is what was given; indices are checked."""
        pattern = self.pattern
        if isinstance(pattern, str):
            return None
        if isinstance(pattern, bool):
            raise ValueError(f"pattern must be 'median', an index or an array, got {pattern}.")
        if isinstance(pattern, Integral):
            if pattern not in performances.numbers:
                raise ValueError(
                    f"pattern={pattern} is out of range: there are {len(performances)} "
                    f"performances, the last has index {len(performances) - 1}."
                )
            return None
        check_names(pattern, names_of_input(self), "The pattern")
        pattern = as_numbers(pattern, "The pattern", dtype=performances[0].dtype)
        pattern = pattern[:, np.newaxis] if pattern.ndim == 1 else pattern
        width = performances[0].shape[1]
        if pattern.ndim != 2 or len(pattern) < 2 or pattern.shape[1] != width:
            raise ValueError(
                f"A pattern given as an array must have shape (n_frames, {width}) with at least 2 "
                f"frames, like the performances; got {pattern.shape}."
            )
        check_finite(pattern, "The pattern, frame", names_of_input(self))
        check_magnitude(float(np.abs(pattern).max()), "The pattern", training=True)
        return pattern

    @property
    def _wants_median(self):
        return isinstance(self.pattern, str)

    def _plain_median(self, sequences):
        """The median (Eq. 19) of scaled sequences without matching, if it is wanted."""
        if not self._wants_median:
            return Median.unknown(len(sequences))
        return linear_median(sequences)

    def _set_pattern(self, training, median, degree=2):
        """Set the pattern: the median, or as given. Returns it at its own pace.

        Distances are in the unit of the training set to this degree.
        """
        self.global_distances_ = median.distances * training.unit.size**degree
        self.pattern_index_ = median.index if self._wants_median else None
        if not self._wants_median and training.given is None:
            self.pattern_index_ = list(training.performances.numbers).index(self.pattern)
        source = training.given
        if source is None:
            source = training.performances[self.pattern_index_]
        self.pattern_ = normalise([source], self.n_frames_)[0]
        return source
