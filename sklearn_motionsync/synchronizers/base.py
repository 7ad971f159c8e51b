"""Synchronizer: the clock, the pattern and the warp to it, which all share (Eqs. 6, 7, 18).

`AnchoredSynchronizer` is the base of those that take key-frames, too.
"""

from __future__ import annotations

from copy import copy
from numbers import Integral
from types import MethodType
from typing import Any, Literal, Self

import numpy as np
from sklearn.base import (
    BaseEstimator,
    OneToOneFeatureMixin,
)
from sklearn.utils._param_validation import Interval, StrOptions
from sklearn.utils.validation import check_is_fitted

from ..inputs.collections import Trials, as_source, count_of
from ..inputs.features import check_input_features
from ..inputs.keyframes import Keyframes
from ..inputs.recorded import refuse_moved_events
from ..inputs.resampling import as_frame_rates
from ..inputs.trial_facts import TrialFacts
from ..inputs.types import (
    Indexed,
    NamesLike,
    NumbersLike,
    SupportsArray,
    Transformed,
    TrialLike,
    TrialsLike,
    ValuesLike,
)
from ..inputs.validation import (
    SequenceLevelMixin,
    TrialTransformerMixin,
    names_of_input,
    read_source,
    restore,
)
from ..matching.filters import SMOOTHING
from ..matching.gaps import is_gappy
from ..matching.matcher import Features
from ..matching.median import Median, linear_median
from ..matching.warps import normalise, sample
from ..utils.parallel import LongWorkMixin
from ..utils.parameters import validated
from ..utils.pipelines import Routed, remember_match
from .intervals import Intervals, joined
from .match import Match, check_match
from .training import (
    TrainingSet,
    check_pattern,
    fill_trials,
    fill_warped,
    learn_filler,
    pattern_of,
    put_on_clock,
    with_confidence,
)


class Synchronizer(LongWorkMixin, SequenceLevelMixin, TrialTransformerMixin, BaseEstimator):
    """Base class of all synchronizers: a subclass defines ``match``.

    It inherits ``fit``, which chooses the pattern after linear normalisation,
    ``transform``, pandas output, and what scorers and displays need. These call ``match`` with
    a sequence of checked arrays, users with any collection; ``normalize`` and
    ``check_trials`` take both. A subclass with further parameters defines ``__init__``, as
    in scikit-learn, with ``n_frames`` and ``pattern`` among them.

    Parameters
    ----------
    n_frames : int, default=None
        Frames of the common clock; by default the median length of the trials, or
        the length of a pattern given as an array.
    pattern : "median", int or array (n_frames, n_features), default="median"
        The trial with the smallest sum of squared distances to all others after linear
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
        Sum of the squared distances of each trial to all others; NaN if the pattern was given.
    lengths_ : ndarray of int, shape (n_sequences,)
        Numbers of frames of the training trials.
    examples_ : ndarray, shape (min(n_sequences, 64), P, n_features)
        Training trials linearly normalised: all, or 64 of them, evenly spaced.
    features_ : callable
        Turns poses on the clock into the features that are compared.
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
    >>> from sklearn_motionsync import Match
    >>> from sklearn_motionsync.synchronizers import Synchronizer
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
    _SMALLER = "fewer frames or trials"

    def __init__(
        self,
        n_frames: int | None = None,
        pattern: TrialLike | int | Literal["median"] = "median",
    ) -> None:
        self.n_frames = n_frames
        self.pattern = pattern

    @validated
    def fit(self, X: TrialsLike, y: object = None) -> Self:
        """Choose the pattern, the trial to whose clock all others are warped.

        Parameters
        ----------
        X : list of arrays (n_frames_i, n_features), 3-D array, or 2-D array
            Trials; the rows of a 2-D array are univariate ones.
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
            learnt = self._learn(self._read_training_set(X), progress)
        self.__dict__.update(learnt)
        return self

    def transform(self, X: TrialsLike, *, fill: Literal["model"] | None = None) -> Transformed:
        """Warp trials onto the clock of the pattern (Eq. 18).

        Parameters
        ----------
        X : list of arrays (n_frames_i, n_features), 3-D array, or 2-D array
            Trials. Memory maps, and collections that give trials by index, are read in
            parts, once each; rows of a matrix are loaded into memory.
        fill : {None, "model"}, default=None
            What becomes of NaN, which is what was hidden. None: it stays NaN, feature by feature.
            "model": it is filled from the mean of the warped training set (``examples_``) at the
            same moment, moved by how far the trial is from the mean around the gap, and in
            the features that are seen.

        Returns
        -------
        ndarray, shape (n_sequences, P, n_features)
            ``(n_sequences, P)`` for 2-D input; a ``(trial, frame)`` frame under
            ``set_output(transform="pandas")``.

        Raises
        ------
        ValueError
            If the input breaks the contract, or there is no such ``fill``.
        """
        return self._warp(X, fill)

    def transform_matched(
        self, X: TrialsLike, match: Match, *, fill: Literal["model"] | None = None
    ) -> Transformed:
        """Warp trials whose match is known, so that they are matched once.

        Parameters
        ----------
        X : trials
            As for ``match``, which was given the same.
        match : Match
            That of X.
        fill : {None, "model"}, default=None
            As for ``transform``.

        Returns
        -------
        ndarray, shape (n_sequences, P, n_features)
            What ``transform`` gives for X.

        Raises
        ------
        ValueError
            If the match is of another number of trials, or on another clock.

        Examples
        --------
        >>> from sklearn_motionsync import DenseSynchronizer
        >>> from sklearn_motionsync.datasets import make_gait
        >>> gait = make_gait(6, random_state=0)
        >>> sync = DenseSynchronizer(n_frames=51).fit(gait.data)
        >>> match = sync.match(gait.data)
        >>> aligned = sync.transform_matched(gait.data, match)
        >>> bool((aligned == sync.transform(gait.data)).all())
        True
        """
        _check_fill(fill)
        trials = self.check_trials(X)
        check_match(match, len(trials), self.n_frames_, type(self).__name__)
        # What was hidden in the match is hidden here, too.
        matched = trials if match.reached is None else match.reached.trials
        trials = with_confidence(trials, matched.confidence)
        return self._restored(trials, self._warped(trials, match), fill)

    def match(self, X: TrialsLike) -> Match:
        """Match trials to the pattern.

        Parameters
        ----------
        X : list of arrays (n_frames_i, n_features), 3-D array, or 2-D array
            Trials; the rows of a 2-D array are univariate ones.

        Returns
        -------
        Match
            ``offsets`` Delta(p) and ``times`` tau(p), shape (n_sequences, P), in frames of the
            pattern, both of trials linearly normalised to its length (Eq. 7), and ``distances``,
            shape (n_sequences,). tau is non-decreasing, ``tau(0) = 0``, ``tau(P-1) = P-1``.
        """
        raise NotImplementedError(
            f"{type(self).__name__} does not define match(self, X), which returns a Match."
        )

    def normalize(self, X: TrialsLike) -> np.ndarray:
        """Normalise trials linearly to the clock of the pattern, without matching (Eq. 7).

        Parameters
        ----------
        X : list of arrays (n_frames_i, n_features), 3-D array, or 2-D array
            Trials; the rows of a 2-D array are univariate ones.

        Returns
        -------
        ndarray, shape (n_sequences, P, n_features)
            One feature for the rows of a 2-D array.
        """
        return normalise(self.check_trials(X), self.n_frames_)

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

    def __sklearn_is_fitted__(self):
        return hasattr(self, "pattern_")

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

    def _learn(self, training, progress):
        """What a fit learns from a `TrainingSet`, by the names of attributes."""
        pattern = check_pattern(self.pattern, training.trials, names_of_input(self))
        clock = self._put_on_clock(training, pattern)
        return self._learnt(training, clock, pattern, clock.poses)

    def _warp(self, X, fill=None, **params):
        _check_fill(fill)
        # Further parameters are given for all trials at once.
        source = None if params else self._read_in_parts(X)
        if source is None:
            trials = self._seen(self.check_trials(X), params)
            out = self._warped(trials, self._match(trials, **params))
        else:
            n_trials, portions = source
            trials, out = self._warp_parts(n_trials, portions)
        return self._restored(trials, out, fill)

    def _seen(self, trials, params):
        """Trials without what is hidden; what hides it is taken out of the params of a match."""
        return trials

    def _warped(self, trials, match):
        """Checked trials at the times of their match (Eq. 18)."""
        return sample(trials, match.times, self.n_frames_)

    def _restored(self, trials, out, fill):
        """Warped trials as ``transform`` gives them."""
        if fill == "model" and is_gappy(out):
            examples = Trials(list(self.examples_), "list", list(range(len(self.examples_))))
            fill_warped(out, self._warped(examples, self._match(examples)))
        if trials.kind == "rows":
            return out[:, :, 0]
        return restore(self, trials, out, frames=range(out.shape[1]))

    def _match(self, trials, **params):
        """The match of checked trials."""
        match = self.match(trials, **params)
        check_match(match, len(trials), self.n_frames_, type(self).__name__)
        return match

    def _warp_parts(self, n_sequences, portions):
        """Labels of trials that are read in portions, and these warped."""
        out, facts, start = None, [], 0
        for trials in portions:
            warped = self._warped(trials, self._match(trials))
            if out is None:
                out = np.empty((n_sequences, *warped.shape[1:]), warped.dtype)
            out[start : start + len(trials)] = warped
            start += len(trials)
            facts.append(TrialFacts.of(trials))
        facts = TrialFacts.joined(facts)
        return Trials((), "list", facts.labels, names=trials.names, levels=facts.levels), out

    def _read_in_parts(self, X):
        """The number of trials, and checked portions of them; None if all are in memory."""
        source = None if isinstance(X, Trials) else as_source(X)
        if source is None or len(source) == 0:
            return None
        return len(source), read_source(self, source, self._read_rows_in_fit())

    def _match_in_parts(self, X, frame_rate, source):
        """The match of trials that are read in parts."""
        matches, facts, tells = [], [], False
        for trials in source[1]:
            match = self._match(trials)
            tells = match.intervals is not None
            matches.append((match.times, match.distances))
            facts.append(TrialFacts.of(trials))
        times, distances = map(np.concatenate, zip(*matches, strict=True))
        intervals = None
        if tells:
            # Of this fit, also after another one.
            measured = MethodType(self._measured_in_parts.__func__, copy(self))
            intervals = Intervals(times, lambda: measured(X))
        known = TrialFacts.joined(facts)
        known = known if frame_rate is None else known.at(frame_rate)
        return Match(times, distances, intervals).of_trials(known)

    def _measured_in_parts(self, X):
        """What the intervals of trials need, which are read and matched once more."""
        return joined(
            self._match(trials).intervals.measured() for trials in self._read_in_parts(X)[1]
        )

    def _without_gaps(self, trials):
        """Checked trials, filled where they are NaN."""
        if not _hold_gaps(trials):
            return trials
        filler = self._filler or learn_filler(self.examples_)
        return fill_trials(filler, trials)

    # -- steps of a fit ---------------------------------------------------------------------

    def _read_training_set(self, X, numbers=None, population=None, confidence=None):
        """Check the input of ``fit``, and fill gaps: a `TrainingSet`.

        ``numbers`` are the indices of a sample of so large a population.
        """
        checked = self._check_training_set(X, numbers, looks=confidence is None)
        trials, filler = with_confidence(checked, confidence), None
        if _hold_gaps(trials):
            filler = learn_filler(trials, names_of_input(self))
            trials = fill_trials(filler, trials)
        return TrainingSet(trials, filler, population or len(trials))

    def _put_on_clock(self, training, pattern, keyframe_std=0.0):
        """The `CommonClock` of a training set."""
        array = pattern if isinstance(pattern, np.ndarray) else None
        return put_on_clock(training, self.n_frames, array, self._SMALLER, keyframe_std)

    def _learnt(self, training, clock, pattern, comparable):
        """Fitted attributes by their names.

        The median, if it is wanted, is that of sequences that are comparable without matching, in
        the unit of the clock.
        """
        median = linear_median(comparable) if isinstance(pattern, str) else None
        if median is not None:
            median = Median(median.trial, median.distances * clock.unit.size**2)
        chosen = pattern_of(training, pattern, median)
        return {
            "pattern_": normalise([chosen.array], clock.n_frames)[0],
            "pattern_index_": chosen.trial,
            "n_frames_": clock.n_frames,
            "global_distances_": chosen.distances,
            "lengths_": clock.lengths,
            "examples_": clock.examples,
            "features_": Features("velocity", SMOOTHING, clock.unit),
            "_filler": training.filler,
        }


class AnchoredSynchronizer(Synchronizer):
    """Base class of synchronizers whose methods take key-frames.

    A subclass defines ``_learn(training, progress)``, as `Synchronizer`, with the key-frames of the
    training set; and ``_match(trials, keyframes, frame_rate)``, which calls ``_shares`` for
    the same.
    """

    keyframes_: np.ndarray | None

    _finite = "allow-nan"

    def fit(
        self,
        X: TrialsLike,
        y: object = None,
        keyframes: Indexed[ValuesLike | None] | SupportsArray | None = None,
        frame_rate: float | ValuesLike | None = None,
        confidence: Indexed[NumbersLike] | None = None,
    ) -> Self:
        """Learn from trials, of which key-frames may be known.

        Parameters
        ----------
        X : list of arrays (n_frames_i, n_features), 3-D array, or 2-D array
            Trials; the rows of a 2-D array are univariate ones.
        y : ignored
            Present for API consistency.
        keyframes : list of arrays (n_keyframes,), 2-D array or DataFrame, default=None
            One row a trial, in its own frames, counted from its first row (fractions
            allowed), increasing. NaN, or None for a whole row, where one is not known.
        frame_rate : float, or array-like of shape (n_sequences,), default=None
            Frames per second of X. With it key-frames are seconds.
        confidence : list of arrays (n_frames_i,) or (n_frames_i, n_features), default=None
            How sure it is what was seen, from 0 to 1, such as of a markerless system. Below 0.5 is
            as NaN: not seen. Above, it is the weight of what was seen.

        Returns
        -------
        self : Synchronizer
            The fitted synchronizer.

        Raises
        ------
        ValueError
            If the input breaks the contract, or the pattern does not exist or fit. If key-frames
            are not increasing, inside their trial and equally many in all; if they look like
            seconds, all below 1 or in the first fiftieth of a trial and not whole; if no trial has
            one of them; or if trials have events whose frames are not their rows.
        """
        self._fit(X, keyframes, frame_rate, confidence)
        return self

    @validated
    def _fit(self, X, keyframes, frame_rate, confidence):
        """Fit, and return the `TrainingSet`."""
        with self._progress(fits=True) as progress:
            training = self._read_training_set(X, confidence=confidence)
            if keyframes is not None:
                refuse_moved_events(X)
                rows = Keyframes(keyframes, training.population, frame_rate)
                training = training._replace(keyframes=rows.known(training.trials))
            elif frame_rate is not None:
                as_frame_rates(frame_rate, training.population)
            learnt = self._learn(training, progress)
        self.__dict__.update(learnt)
        return training

    # scikit-learn's takes whatever ``fit`` takes, without its name.
    def fit_transform(  # type: ignore[override]
        self,
        X: TrialsLike,
        y: object = None,
        keyframes: Indexed[ValuesLike | None] | SupportsArray | None = None,
        frame_rate: float | ValuesLike | None = None,
        confidence: Indexed[NumbersLike] | None = None,
    ) -> Transformed:
        """Fit, and warp the same trials.

        Parameters
        ----------
        X : list of arrays (n_frames_i, n_features), 3-D array, or 2-D array
            Trials; the rows of a 2-D array are univariate ones.
        y : ignored
            Present for API consistency.
        keyframes, frame_rate, confidence : default=None
            Of these trials, as for ``fit``.

        Returns
        -------
        ndarray, shape (n_sequences, P, n_features)
            As from ``transform``.
        """
        self.fit(X, y, keyframes, frame_rate, confidence)
        if remember_match(self, None):
            return self.transform_matched(X, self.match(X, keyframes, frame_rate, confidence))
        return self.transform(X, keyframes, frame_rate, confidence)

    def transform(
        self,
        X: TrialsLike,
        keyframes: Indexed[ValuesLike | None] | SupportsArray | None = None,
        frame_rate: float | ValuesLike | None = None,
        confidence: Indexed[NumbersLike] | None = None,
        *,
        fill: Literal["model"] | None = None,
    ) -> Transformed:
        """Warp trials onto the clock of the pattern (Eq. 18).

        Parameters
        ----------
        X : list of arrays (n_frames_i, n_features), 3-D array, or 2-D array
            Trials. Memory maps, and collections that give trials by index, are read in
            parts, once each, if no key-frames are given; rows of a matrix are loaded into memory.
        keyframes, frame_rate, confidence : default=None
            Of these trials, as for ``fit``.
        fill : {None, "model"}, default=None
            What becomes of NaN, which is what was hidden. None: it stays NaN, feature by feature.
            "model": it is filled from the mean of the warped training set (``examples_``) at the
            same moment, moved by how far the trial is from the mean around the gap, and in
            the features that are seen.

        Returns
        -------
        ndarray, shape (n_sequences, P, n_features)
            ``(n_sequences, P)`` for 2-D input; a ``(trial, frame)`` frame under
            ``set_output(transform="pandas")``.
        """
        return self._warp(X, fill, **self._given(X, keyframes, frame_rate, confidence))

    def match(
        self,
        X: TrialsLike,
        keyframes: Indexed[ValuesLike | None] | SupportsArray | None = None,
        frame_rate: float | ValuesLike | None = None,
        confidence: Indexed[NumbersLike] | None = None,
    ) -> Match:
        """Match trials to the pattern: the warps of ``transform``.

        Parameters
        ----------
        X : list of arrays (n_frames_i, n_features), 3-D array, or 2-D array
            Trials; the rows of a 2-D array are univariate ones. Read in parts as by ``transform``.
        keyframes, frame_rate, confidence : default=None
            Of these trials, as for ``fit``.

        Returns
        -------
        Match
            ``offsets`` Delta(p) and ``times`` tau(p), shape (n_sequences, P), in frames of
            the pattern; ``distances``, shape (n_sequences,).
        """
        params = self._given(X, keyframes, frame_rate, confidence)
        if not params and (source := self._read_in_parts(X)) is not None:
            return self._match_in_parts(X, frame_rate, source)
        trials = self._seen(self.check_trials(X), params)
        facts = TrialFacts.of(trials, frame_rate)
        # Of this fit, also after another one.
        reached = Routed(None, copy(self), trials, params, facts)
        match = self._match(trials, **params).of_trials(facts, reached)
        remember_match(self, match)
        return match

    def _given(self, X, keyframes, frame_rate, confidence=None) -> dict[str, Any]:
        """What is given, as arguments of ``_seen`` and ``_match``."""
        params: dict[str, Any] = {}
        if keyframes is not None:
            refuse_moved_events(X)
            params |= {"keyframes": keyframes, "frame_rate": frame_rate}
        elif frame_rate is not None:
            as_frame_rates(frame_rate, count_of(X))
        if confidence is not None:
            params["confidence"] = confidence
        return params

    def _seen(self, trials, params):
        confidence = params.pop("confidence", None)
        return trials if confidence is None else with_confidence(trials, confidence)

    def _shares(self, trials, keyframes, frame_rate):
        """Key-frames of trials as shares of them, by those of the fit; None if none are."""
        if keyframes is None:
            return None
        if self.keyframes_ is None:
            raise ValueError(
                f"Key-frames are given, and this {type(self).__name__} was fitted without any, so "
                "it does not know where they are in the pattern. Fit it with keyframes=[...], too."
            )
        rows = Keyframes(keyframes, len(trials), frame_rate)
        return rows.shares(trials, len(self.keyframes_))


def _check_fill(fill):
    """Refuse a ``fill`` that there is not."""
    if fill is not None and not (isinstance(fill, str) and fill == "model"):
        raise ValueError(
            f"fill={fill!r} is unknown: use None to keep what was hidden as NaN, or 'model' to "
            "fill it from the mean of the warped training set."
        )


def _hold_gaps(trials):
    """Whether anything of trials is NaN, or not sure; they hold no infinity."""
    sums = [x.sum() for x in trials]
    return trials.confidence is not None or bool(np.isnan(sums).any())
