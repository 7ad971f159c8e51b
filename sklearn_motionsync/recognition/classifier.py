"""ActionClassifier: which of several actions a trial is, and whether it is any of them."""

from __future__ import annotations

from numbers import Integral, Real
from typing import Literal, Self

import numpy as np
import pandas as pd
from scipy.special import softmax
from sklearn.base import BaseEstimator, ClassifierMixin
from sklearn.utils._param_validation import Interval, StrOptions
from sklearn.utils.validation import check_is_fitted

from ..inputs.types import Labels, TrialsLike, ValuesLike
from ..inputs.validation import SequenceLevelMixin
from ..matching.counting import first_largest
from ..utils.groups import (
    encode_classes,
    encode_groups,
    refuse_classes_as_people,
)
from ..utils.parallel import LongWorkMixin, one_blas_thread
from ..utils.parameters import validated
from .kernel import MotionKernel, assign_folds, decision_values, fit_regression

# The coverage of reject_below="auto".
_COVERAGE = 0.95
# The golden ratio less 1.
_GOLDEN = (5**0.5 - 1) / 2


class ActionClassifier(LongWorkMixin, SequenceLevelMixin, ClassifierMixin, BaseEstimator):
    """Which of several movements trials are, and whether they are any of them.

    It learns bends and half bends, and is given one of each, and standing still, of a new person:

    >>> import numpy as np
    >>> from sklearn.pipeline import make_pipeline
    >>> from sklearn_motionsync import ActionClassifier, DirectionCosines
    >>> from sklearn_motionsync.datasets import make_bending
    >>> bunch = make_bending(12, n_actors=4, n_frames=40, random_state=0)
    >>> X = bunch.data + [x[: len(x) // 2] for x in bunch.data]
    >>> y = np.repeat(["bend", "half"], 12)
    >>> pipe = make_pipeline(DirectionCosines(bunch.skeleton), ActionClassifier())
    >>> pipe = pipe.fit(X, y, actionclassifier__groups=np.tile(bunch.actor, 2))
    >>> new = make_bending(1, n_frames=40, random_state=7).data[0]
    >>> still = new[:1].repeat(40, axis=0)
    >>> pipe.predict([new, new[:20], still]).tolist()
    ['bend', 'half', 'half']

    A trial of neither gets the more likely class, unless unknown movements are rejected:

    >>> pipe[-1].set_params(reject_below="auto").predict(
    ...     pipe[:-1].transform([new, new[:20], still])
    ... ).tolist()
    ['bend', 'half', 'unknown']

    Parameters
    ----------
    C : float, default=10
        Inverse strength of the penalty of the regression.
    n_landmarks : int or None, default=250
        If there are more than twice as many trials, they are compared with so many of them
        only, chosen evenly from all classes and groups (Nyström's method). None compares all.
    n_frames : int, default=50
        ``P``, frames of the common clock. Time grows with its square.
    reject_below : float, "auto" or None, default=None
        Trials whose largest decision value is below get "unknown" among text, -1 among numbers, NaT
        among dates, which must be none of the classes; None rejects nothing. ``"auto"`` is
        ``threshold_at(0.95)``. ``fit`` does not use it: it can be set afterwards.
    n_jobs : int, default=None
        How many jobs share the comparisons, in ``fit`` and after it. None means 1 unless in a
        ``joblib.parallel_config`` context, -1 all cores. Results are the same to the last bit.
    verbose : int, default=0
        Above 0, print how far a long job is, at most once a second.

    Attributes
    ----------
    classes_ : ndarray, shape (n_classes,)
        The classes, sorted.
    landmarks_ : ndarray of int, shape (n_landmarks,)
        The training trials that others are compared with: their indices, rising.
    weights_ : ndarray, shape (4,)
        The weights of shape, poses, summaries and changes. They sum to 1.
    temperature_ : float
        The factor of decision values in probabilities, estimated from held-out trials.
    held_out_ : ndarray, shape (n_sequences,)
        The largest decision value of each training trial when it and all of its group
        (without groups a fifth of every class) are held out; NaN where one class is left.
    held_out_gain_ : float
        What decision values gain from the fold that was held out, extrapolated from another: with
        ``G`` folds, usually 5, ``(G - 2) / G`` of what a second held-out fold takes from
        ``held_out_``, in the median of trials that were given their class.
    n_features_in_ : int
        Features of a frame (columns, for 2-D input).
    feature_names_in_ : ndarray of str
        Names of the features; only if the input had names.

    See Also
    --------
    synchronization_distances : One of the distances, for neighbours, clusters and maps.
    ActionDetector : Whether trials are one action, fitted on that action alone.
    find_departures : Where trials depart from the model of a class.

    Notes
    -----
    The similarity of two trials is a weighted mean of four kernels. The first is that of shape, by
    the synchronisation distances of velocities, each divided by its own energy; the second that of
    poses. The third compares mean, standard deviation, minimum, maximum, start and end of every
    feature. The fourth compares its changes over 4 and 16 % of the clock: minimum, maximum, and for
    how much of the clock they exceed levels. Summaries are not warped. The weight of a kernel,
    ``weights_``, is the sixth power of its alignment with the classes, over pairs of different
    groups. A multinomial logistic regression with this kernel separates the classes. Trials are not
    warped to the pattern of a class: that makes unknown movements resemble it.

    Two classes may be a movement done right and done wrong. Give ``groups`` then: what tells people
    apart gets little weight.

    Gaps (NaN) are refused. An `ASpace` before it takes them: ``ASpace(1.0)`` keeps all features.

    Give ``groups``, such as subjects, whenever people come more than once: probabilities
    and thresholds are then those of new people. Under metadata routing
    ``set_fit_request(groups=True)``; otherwise a pipeline takes ``actionclassifier__groups``.

    Time and memory of a fit grow with the square of the number of trials where all are
    compared, and with their number where landmarks are; those of a prediction with ``landmarks_``.
    """

    _parameter_constraints: dict = {
        "C": [Interval(Real, 0, None, closed="neither")],
        "n_landmarks": [Interval(Integral, 2, None, closed="left"), None],
        "n_frames": [Interval(Integral, 2, None, closed="left")],
        "reject_below": [Interval(Real, None, None, closed="neither"), StrOptions({"auto"}), None],
        "n_jobs": [Integral, None],
        "verbose": ["verbose"],
    }
    _on_gaps = (
        "Put ASpace(1.0) before it, which expects what was hidden, or interpolate the gap, as by "
        "sklearn_motionsync.io.fill_gaps(x, max_gap=10)"
    )

    def __init__(
        self,
        *,
        C: float = 10,
        n_landmarks: int | None = 250,
        n_frames: int = 50,
        reject_below: float | Literal["auto"] | None = None,
        n_jobs: int | None = None,
        verbose: int = 0,
    ) -> None:
        self.C = C
        self.n_landmarks = n_landmarks
        self.n_frames = n_frames
        self.reject_below = reject_below
        self.n_jobs = n_jobs
        self.verbose = verbose

    @validated
    def fit(self, X: TrialsLike, y: Labels, groups: Labels | None = None) -> Self:
        """Fit the kernel, the regression and the temperature.

        Parameters
        ----------
        X : list of arrays (n_frames_i, n_features), 3-D array, or 2-D array
            Trials; the rows of a 2-D array are univariate ones.
        y : array-like, shape (n_sequences,)
            The class of each trial.
        groups : array-like, shape (n_sequences,), default=None
            The subject of each trial, or what else makes trials resemble each other.

        Returns
        -------
        self : ActionClassifier
            The fitted classifier.

        Raises
        ------
        ValueError
            If the input breaks the contract, there are not two classes, there is not a class or
            group for each trial, or groups tell the same trials apart as classes.
        """
        kernel = MotionKernel(int(self.n_frames))
        trials = self._check_training_set(X)
        classes, codes = encode_classes(y, trials, type(self).__name__)
        if groups is not None:
            groups, _ = encode_groups(groups, len(trials), at_least=2)
            refuse_classes_as_people(codes, groups)
        landmarks = choose_landmarks(codes, groups, self.n_landmarks)
        with self._progress(fits=True) as progress:
            matrix = kernel.fit(
                trials, landmarks, codes, groups, n_jobs=self.n_jobs, progress=progress
            )
            folds = assign_folds(codes, groups)
            step = progress.stage("regression", 1)
            with one_blas_thread():
                regression, temperature, held_out, gain = fit_regression(
                    self.C, folds, landmarks, matrix, codes
                )
            step()
        self.classes_, self.landmarks_ = classes, landmarks
        self._regression, self.temperature_ = regression, temperature
        self.held_out_, self.held_out_gain_ = held_out, gain
        self._kernel, self.weights_ = kernel, kernel.weights
        return self

    def predict(self, X: TrialsLike) -> np.ndarray:
        """The class of each trial.

        Parameters
        ----------
        X : list of arrays (n_frames_i, n_features), 3-D array, or 2-D array
            Trials; the rows of a 2-D array are univariate ones.

        Returns
        -------
        ndarray, shape (n_sequences,)
            Classes, and "unknown", -1 or NaT for those that ``reject_below`` rejects.
        """
        decisions = self._decisions(X)
        codes = first_largest(decisions, axis=1)
        threshold = self.reject_below
        if threshold is None:
            return self.classes_[codes]
        if isinstance(threshold, str):
            threshold = self.threshold_at(_COVERAGE)
        codes[decisions.max(axis=1) < threshold] = len(self.classes_)
        kind, labels = self.classes_.dtype.kind, self.classes_.tolist()
        if kind in "Mm":
            return np.append(self.classes_, np.array("NaT", self.classes_.dtype))[codes]
        label = "unknown" if kind in "UO" else -1
        if label in labels:
            raise ValueError(
                f"{label!r} is one of the classes, and what trials are called that are rejected: "
                "give the class another name, or set reject_below=None."
            )
        if kind in "UO":
            return np.append(self.classes_, label)[codes]
        numbers = np.array([*labels, label])
        is_exact = numbers.tolist() == [*labels, label]
        return numbers[codes] if is_exact else np.array([*labels, label], dtype=object)[codes]

    def score(self, X: TrialsLike, y: Labels, sample_weight: ValuesLike | None = None) -> float:
        """Share of trials that are given their class.

        Parameters
        ----------
        X : list of arrays (n_frames_i, n_features), 3-D array, or 2-D array
            Trials; the rows of a 2-D array are univariate ones.
        y : array-like, shape (n_sequences,)
            Their classes.
        sample_weight : array-like, shape (n_sequences,), default=None
            The weight of each trial; by default all are equal.

        Returns
        -------
        float
            From 0 to 1. One that ``reject_below`` rejects is a mistake.
        """
        return float(super().score(X, y, sample_weight))

    def predict_proba(self, X: TrialsLike) -> np.ndarray:
        """The probability of each class, given that a trial is one of them.

        Parameters
        ----------
        X : list of arrays (n_frames_i, n_features), 3-D array, or 2-D array
            Trials; the rows of a 2-D array are univariate ones.

        Returns
        -------
        ndarray, shape (n_sequences, n_classes)
            Columns as in ``classes_``.
        """
        decisions = self._decisions(X)
        return softmax(self.temperature_ * decisions, axis=1)

    def decision_function(self, X: TrialsLike) -> np.ndarray:
        """Decision values of the classes.

        Parameters
        ----------
        X : list of arrays (n_frames_i, n_features), 3-D array, or 2-D array
            Trials; the rows of a 2-D array are univariate ones.

        Returns
        -------
        ndarray, shape (n_sequences, n_classes), or (n_sequences,) for two classes
            Values of all classes sum to 0. Of two classes their difference, above 0 for the second.
        """
        decisions = self._decisions(X)
        return decisions if len(self.classes_) > 2 else decisions[:, 1] - decisions[:, 0]

    def score_samples(self, X: TrialsLike) -> np.ndarray:
        """The largest decision value of trials: their similarity to any class.

        Parameters
        ----------
        X : list of arrays (n_frames_i, n_features), 3-D array, or 2-D array
            Trials; the rows of a 2-D array are univariate ones.

        Returns
        -------
        ndarray, shape (n_sequences,)
            ``reject_below`` rejects trials below it.
        """
        return self._decisions(X).max(axis=1)

    def threshold_at(self, coverage: float) -> float:
        """The ``reject_below`` that keeps a share of trials of the known actions.

        Parameters
        ----------
        coverage : float
            The share, between 0 and 1, of trials; of new people if groups were given.

        Returns
        -------
        float
            The quantile of ``held_out_`` that as many exceed, interpolated, and
            ``held_out_gain_``.

        Raises
        ------
        ValueError
            If it is no share, or no trial could be held out.
        """
        check_is_fitted(self, "classes_")
        if not (isinstance(coverage, Real) and 0 < coverage < 1):
            raise ValueError(f"coverage must be a share between 0 and 1, got {coverage!r}.")
        known = self.held_out_[np.isfinite(self.held_out_)]
        if not len(known):
            raise ValueError(
                "There is no threshold, as no trial could be held out: give at least two "
                "trials, and two groups, of two classes, or a number as reject_below."
            )
        return float(np.quantile(known, 1 - coverage) + self.held_out_gain_)

    def __sklearn_tags__(self):
        tags = super().__sklearn_tags__()
        tags.input_tags.three_d_array = True
        return tags

    def _decisions(self, X):
        """Decision values of trials: (n_sequences, n_classes)."""
        check_is_fitted(self, "classes_")
        trials = self.check_trials(X)
        with self._progress(fits=False) as progress:
            kernel = self._kernel(trials, n_jobs=self.n_jobs, progress=progress)
        return decision_values(kernel, *self._regression)


def choose_landmarks(codes, groups, n_landmarks):
    """Trials of all classes, and of all groups of each, in numbers as even as possible.

    Classes and groups (n,) are counted from 0; groups may be None. The results are indices, rising:
    those of all trials if these are at most twice as many as landmarks, or if there is no number of
    landmarks.
    """
    n = len(codes)
    if n_landmarks is None or n <= 2 * n_landmarks:
        return np.arange(n)
    groups = np.zeros(n, dtype=np.intp) if groups is None else groups
    # Multiples of the golden ratio, modulo 1, are evenly spread over the trials of a group,
    # and over the groups of a class.
    spread = (np.arange(n) * _GOLDEN) % 1
    in_group = pd.Series(spread).groupby([codes, groups]).rank("first") - 1
    keys = in_group + (groups + codes) * _GOLDEN % 1
    in_class = keys.groupby(codes).rank("first")
    return np.sort(np.lexsort((codes, in_class))[:n_landmarks])
