"""ActionClassifier: which of several actions a performance is, and whether it is any of them."""

import warnings
from functools import partial
from numbers import Integral, Real

import numpy as np
import pandas as pd
from scipy.special import softmax
from sklearn.base import BaseEstimator, ClassifierMixin, _fit_context
from sklearn.pipeline import Pipeline
from sklearn.utils import assert_all_finite, check_consistent_length, column_or_1d
from sklearn.utils._param_validation import Interval, StrOptions
from sklearn.utils.multiclass import check_classification_targets
from sklearn.utils.validation import check_is_fitted

from ..inputs.validation import SequenceLevelMixin
from ..matching.costs import COSTS
from ..matching.pairwise import PairwiseDistance
from ..model.action_model import ActionModel
from ..model.similarity import as_codes
from ..synchronizers.dense import DenseSynchronizer
from ..utils.atomic import atomic_fit, snapshot
from ..utils.doc_links import DocumentedMixin
from ..utils.parallel import LongWorkMixin, run
from .distances import SETTINGS
from .kernel import MotionKernel, deal, decide, learn, threshold

__all__ = ["ActionClassifier"]

# Parts that performances are dealt out into, to learn of those held out.
_FOLDS = 5
# The share of performances of known actions that reject_below="auto" is to keep.
_KEPT = 0.95


class ActionClassifier(
    DocumentedMixin, LongWorkMixin, SequenceLevelMixin, ClassifierMixin, BaseEstimator
):
    """Which of several actions performances are, and whether they are any of them.

    How alike two performances are is told by their synchronisation distances under all three
    costs, each performance's own energy divided out of the velocities, and by what is seen of
    them without any warp. These four kernels are averaged, and a multinomial logistic
    regression in the space of the mean tells the classes apart. It does not warp performances to
    the pattern of a class: that makes strangers look like it.

    Parameters
    ----------
    costs : {"velocity", "elastic", "posture"} or list of them, default=all three
        The costs of the distances, each once; none, if ``summaries``, takes away all warps.
    C : float, default=10
        Inverse strength of the penalty of the regression.
    gamma : float, default=1
        A kernel is ``exp(-gamma D / median(D))``, the median over all training pairs.
    summaries : bool, default=True
        Whether mean, standard deviation, smallest and largest value, start and end of every
        feature make a kernel, too.
    n_frames : int, default=50
        ``P``, frames of the common clock. Time grows with its square.
    velocity_smoothing : float, default=0.06
        Standard deviation of the Gaussian under which velocities are taken, as a share of the clip.
    max_offset : float, default=0.4
        Largest offset, as a share of the clock, in [0, 1].
    smoothness : float, default=0.003
        Weight of changes of pace, in units of the mean squared norm of what is compared.
    max_rate : float, default=4
        Largest local rate of a path.
    reject_below : float, "auto" or None, default=None
        Performances whose largest decision value is below get ``unknown_label``; None rejects
        nothing. ``"auto"`` is ``threshold_at(0.95)``. ``fit`` does not use it: it can be set
        afterwards.
    unknown_label : label, default=None
        By default "unknown", if the classes are text, and -1, if they are numbers.
    n_jobs : int, default=None
        How many jobs share the comparisons, in ``fit`` and after it. None means 1 unless in a
        ``joblib.parallel_config`` context, -1 all cores. Results are the same to the last bit.
    verbose : int, default=0
        Above 0, print how far a long job is, at most once a second.

    Attributes
    ----------
    classes_ : ndarray, shape (n_classes,)
    temperature_ : float
        By what decision values are multiplied for probabilities, learnt of performances held out.
    held_out_ : ndarray, shape (n_sequences,)
        The largest decision value of each training performance, when it and all of its group
        (without groups a fifth of every class) were held out; NaN where too few were left.
    n_features_in_ : int
        Features of a frame (columns, for 2-D input).
    feature_names_in_ : ndarray of str
        Names of the features; only if the input had names.

    See Also
    --------
    synchronization_distances : One of the distances, for neighbours, clusters and maps.
    ActionDetector : Whether performances are one action, learnt of that action alone.
    find_departures : Where performances depart from the class they were given.

    Notes
    -----
    Give ``groups``, such as who performed, whenever people come more than once: probabilities
    and thresholds are then those of people not seen. Under metadata routing
    ``set_fit_request(groups=True)``; otherwise a pipeline takes ``actionclassifier__groups``.

    Training takes time and memory with the square of the number of performances.

    Examples
    --------
    Bends and half bends, told apart in somebody whom it has not seen.

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

    Who does neither is still given the more likely class, unless unknown actions are rejected.

    >>> pipe[-1].set_params(reject_below="auto").predict(
    ...     pipe[:-1].transform([new, new[:20], still])
    ... ).tolist()
    ['bend', 'half', 'unknown']
    """

    _parameter_constraints: dict = {
        "costs": ["array-like", StrOptions(set(COSTS))],
        "C": [Interval(Real, 0, None, closed="neither")],
        "gamma": [Interval(Real, 0, None, closed="neither")],
        "summaries": ["boolean"],
        **SETTINGS,
        "reject_below": [Interval(Real, None, None, closed="neither"), StrOptions({"auto"}), None],
        "unknown_label": [str, Integral, Real, None],
    }

    def __init__(
        self,
        costs=("velocity", "elastic", "posture"),
        *,
        C=10,
        gamma=1,
        summaries=True,
        n_frames=50,
        velocity_smoothing=0.06,
        max_offset=0.4,
        smoothness=0.003,
        max_rate=4,
        reject_below=None,
        unknown_label=None,
        n_jobs=None,
        verbose=0,
    ):
        self.costs = costs
        self.C = C
        self.gamma = gamma
        self.summaries = summaries
        self.n_frames = n_frames
        self.velocity_smoothing = velocity_smoothing
        self.max_offset = max_offset
        self.smoothness = smoothness
        self.max_rate = max_rate
        self.reject_below = reject_below
        self.unknown_label = unknown_label
        self.n_jobs = n_jobs
        self.verbose = verbose

    @atomic_fit
    @_fit_context(prefer_skip_nested_validation=True)
    def fit(self, X, y, groups=None):
        """Learn the classes.

        Parameters
        ----------
        X : list of arrays (n_frames_i, n_features), 3-D array, or 2-D array
            Performances; the rows of a 2-D array are univariate ones.
        y : array-like, shape (n_sequences,)
            What each is.
        groups : array-like, shape (n_sequences,), default=None
            Who performed, or what else makes performances resemble each other.

        Returns
        -------
        self

        Raises
        ------
        ValueError
            If the input breaks the contract, there are not two classes, there is not a label or
            group for each performance, or costs are unknown.
        """
        kernel = MotionKernel(self._comparisons(), self.gamma, self.summaries)
        performances = self._check_training_set(X)
        self.classes_, codes = check_labels(type(self).__name__, performances, y)
        people = None if groups is None else as_codes(groups, len(performances))
        with self._progress(fits=True) as progress:
            known = kernel.learn(performances, n_jobs=self.n_jobs, progress=progress)
        n_folds = _FOLDS if people is None else min(_FOLDS, people.max() + 1)
        learnt_of = partial(learn, self.C, deal(codes, people, n_folds))
        (learnt,) = run(learnt_of, [(known, codes)])
        self._regression, self.temperature_, self.held_out_ = learnt
        # Copies: what the user does with the arrays must not change what was learnt.
        self._kernel = kernel
        self._training = [np.array(x) for x in performances], codes, people
        return self

    @snapshot
    def predict(self, X):
        """The class of each performance.

        Parameters
        ----------
        X : list of arrays (n_frames_i, n_features), 3-D array, or 2-D array

        Returns
        -------
        ndarray, shape (n_sequences,)
            Classes, and ``unknown_label`` for those that ``reject_below`` rejects.
        """
        decisions = self._decide(X)
        labels = self.classes_[decisions.argmax(axis=1)]
        if self.reject_below is None:
            return labels
        border = self.reject_below
        if isinstance(border, str):
            border = self.threshold_at(_KEPT)
        return np.where(
            decisions.max(axis=1) < border,
            label_of_unknown(self.unknown_label, self.classes_),
            labels,
        )

    @snapshot
    def predict_proba(self, X):
        """The probability of each class, given that a performance is one of them.

        Parameters
        ----------
        X : list of arrays (n_frames_i, n_features), 3-D array, or 2-D array

        Returns
        -------
        ndarray, shape (n_sequences, n_classes)
            Columns as in ``classes_``.
        """
        decisions = self._decide(X)
        return softmax(self.temperature_ * decisions, axis=1)

    @snapshot
    def decision_function(self, X):
        """How much each class speaks for itself.

        Parameters
        ----------
        X : list of arrays (n_frames_i, n_features), 3-D array, or 2-D array

        Returns
        -------
        ndarray, shape (n_sequences, n_classes), or (n_sequences,) for two classes
            Values of all classes sum to 0. Of two classes their difference, above 0 for the second.
        """
        decisions = self._decide(X)
        return decisions if len(self.classes_) > 2 else decisions[:, 1] - decisions[:, 0]

    @snapshot
    def score_samples(self, X):
        """How much performances are like any class: the largest decision value.

        Parameters
        ----------
        X : list of arrays (n_frames_i, n_features), 3-D array, or 2-D array

        Returns
        -------
        ndarray, shape (n_sequences,)
            ``reject_below`` rejects what is below it. Pipelines that end here have it, too.
        """
        return self._decide(X).max(axis=1)

    @snapshot
    def novelty_scores(self, X):
        """How little performances are like any class: ``score_samples``, negated.

        Parameters
        ----------
        X : list of arrays (n_frames_i, n_features), 3-D array, or 2-D array

        Returns
        -------
        ndarray, shape (n_sequences,)
            The larger, the less it is one of the classes.
        """
        return -self.score_samples(X)

    @snapshot
    def threshold_at(self, coverage):
        """What ``reject_below`` must be to keep a share of performances of the known actions.

        Parameters
        ----------
        coverage : float
            The share, between 0 and 1, of performances of people not seen if groups were given.

        Returns
        -------
        float
            The quantile of ``held_out_`` that as many exceed; of few performances the smallest.

        Raises
        ------
        ValueError
            If it is no share, or nobody could be held out.
        """
        check_is_fitted(self)
        if not (isinstance(coverage, Real) and 0 < coverage < 1):
            raise ValueError(f"coverage must be a share between 0 and 1, got {coverage!r}.")
        return threshold(self.held_out_, coverage)

    @snapshot
    def model_of(self, label):
        """What performances of a class have in common: a pipeline, fitted on them now.

        It explains, and does not decide: performances of other classes that are synchronised
        to its pattern look like it.

        Parameters
        ----------
        label : one of ``classes_``

        Returns
        -------
        Pipeline
            A `DenseSynchronizer` and an `ActionModel`.

        Raises
        ------
        ValueError
            If there is no such class, or it has one performance only.
        """
        check_is_fitted(self)
        performances, codes, people = self._training
        match = np.flatnonzero(self.classes_ == label)
        if not len(match):
            raise ValueError(
                f"There is no class {label!r}; the classes are {self.classes_.tolist()}."
            )
        mine = np.flatnonzero(codes == match[0])
        if len(mine) < 2:
            raise ValueError(
                f"The class {label!r} has one performance: what varies in it is not known."
            )
        groups = None if people is None else people[mine]
        names = None if self._fitted_on_rows else getattr(self, "feature_names_in_", None)
        mine = as_given([performances[i] for i in mine], self._fitted_on_rows, names)
        return learn_model(mine, groups, self.n_frames, self.n_jobs)

    def __sklearn_tags__(self):
        tags = super().__sklearn_tags__()
        tags.input_tags.three_d_array = True
        return tags

    # -- steps of a fit ---------------------------------------------------------------------

    def _comparisons(self):
        """How performances are compared, by every cost."""
        costs = [self.costs] if isinstance(self.costs, str) else list(self.costs)
        unknown = [cost for cost in costs if cost not in COSTS]
        if unknown or len(set(costs)) < len(costs) or not (costs or self.summaries):
            raise ValueError(
                f"costs must be some of {list(COSTS)}, each once, and at least one of them without "
                f"summaries; got {self.costs!r}."
            )
        names = "velocity_smoothing", "max_offset", "smoothness", "max_rate"
        settings = {name: getattr(self, name) for name in names}
        settings["n_frames"] = int(self.n_frames)
        # Where the body is, is compared as it is, in one unit for all.
        return [PairwiseDistance(c, normalize=c != "posture", **settings) for c in costs]

    # -- what is decided --------------------------------------------------------------------

    def _decide(self, X):
        """(n_sequences, n_classes)"""
        performances = self.check_performances(X)
        with self._progress(fits=False) as progress:
            kernel = self._kernel(performances, n_jobs=self.n_jobs, progress=progress)
        return decide(kernel, *self._regression)


# -- what performances of a class have in common, for those who ask why ------------------


def learn_model(performances, groups, n_frames, n_jobs):
    """A synchronizer and a model of performances that belong together.

    Parameters
    ----------
    performances : list of arrays or tables, or 2-D array
        At least two.
    groups : ndarray of int, shape (n_sequences,), or None
        How they differ is only learnt of several groups.
    n_frames : int
        Of their clock.
    n_jobs : int or None

    Returns
    -------
    Pipeline
        Fitted.
    """
    if groups is not None and len(np.unique(groups)) < 2:
        groups = None
    synchronizer, model = DenseSynchronizer(n_frames, n_jobs=n_jobs), ActionModel()
    with warnings.catch_warnings():
        # One class may move one feature only; units are a matter of all classes.
        warnings.filterwarnings("ignore", ".* of the energy that is compared", UserWarning)
        synchronized = synchronizer.fit_transform(performances)
    model.fit(synchronized, groups=groups)
    return Pipeline([("densesynchronizer", synchronizer), ("actionmodel", model)])


def as_given(arrays, on_rows, names):
    """Performances as they were given, for estimators that have not seen any."""
    if on_rows:
        return np.stack([x[:, 0] for x in arrays])
    return arrays if names is None else [pd.DataFrame(x, columns=names) for x in arrays]


# -- labels of classes: whole numbers for the learning, and one for what is none of them -


def check_labels(name, performances, y):
    """The classes, and the class of every performance as a whole number from 0.

    Parameters
    ----------
    name : str
        Of the classifier, for messages.
    performances : sequence
    y : array-like, shape (n_sequences,)

    Returns
    -------
    classes : ndarray, shape (n_classes,)
    codes : ndarray of int, shape (n_sequences,)
    """
    if y is None:
        raise ValueError(f"{name} requires y to be passed, but the target y is None.")
    y = column_or_1d(y, warn=True)
    check_consistent_length(performances, y)
    assert_all_finite(y, input_name="y")
    if (without := pd.isna(y)).any():
        raise ValueError(f"y has no label for performance {int(without.argmax())}.")
    check_classification_targets(y)
    classes, codes = np.unique(y, return_inverse=True)
    if len(classes) < 2:
        raise ValueError(
            f"{name} needs performances of at least 2 classes, got one class: "
            f"{classes.tolist()[0]!r}. Whether performances are one action is what an "
            "ActionDetector learns."
        )
    return classes, codes


def label_of_unknown(label, classes):
    """What performances are called that are none of the classes: of the same type as these.

    Parameters
    ----------
    label : str, number or None
        None is "unknown", or -1 among numbers.
    classes : ndarray, shape (n_classes,)
    """
    kind = classes.dtype.kind
    is_text = kind in "US" or (kind == "O" and isinstance(classes[0], str))
    if label is None:
        label = "unknown" if is_text else -1
    if label in classes.tolist():
        raise ValueError(
            f"unknown_label={label!r} is one of the classes: choose another label for those that "
            "are rejected."
        )
    if is_text != isinstance(label, str):
        raise ValueError(
            f"unknown_label={label!r} must be {'text' if is_text else 'a number'}, like the "
            f"classes {classes.tolist()}."
        )
    return np.array(label, dtype=object) if kind == "O" else label
