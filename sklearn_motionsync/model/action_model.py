"""The action model: mean trial, variance at every pose, envelope (section 4)."""

from __future__ import annotations

import warnings
from dataclasses import replace
from numbers import Integral, Real
from typing import Self

import numpy as np
from sklearn.base import BaseEstimator
from sklearn.exceptions import NotFittedError
from sklearn.utils import check_consistent_length, check_random_state
from sklearn.utils._param_validation import Interval
from sklearn.utils.validation import check_is_fitted

from ..inputs.collections import Trials
from ..inputs.numbers import as_numbers, check_finite, check_names
from ..inputs.types import Labels, RandomState, TrialLike, TrialsLike, ValuesLike
from ..inputs.validation import SequenceLevelMixin, names_of_input
from ..inputs.wording import counted
from ..matching.gaps import fill_with_mean, is_gappy
from ..synchronizers.learning import SynchronizationWarning
from ..synchronizers.match import STANDARD, Match
from ..utils.groups import encode_groups, group_counts, refuse_classes_as_people
from ..utils.parallel import LongWorkMixin
from ..utils.parameters import validated
from .acceptance import LEAST, log_moments
from .similarity import Neighbours, TrialStream, learn_weights
from .variation import (
    clock_error,
    mean_band,
    predictive_variance,
    sample_poses,
    sample_trials,
    simultaneous_factor,
)

# Attribute of fitted models: what was learnt of them when departures were first asked for.
KEPT = "_expected"

# Smallest variance of a density, as a share of the variance of all the data: a deviation in a
# constant feature is not infinitely improbable.
_VARIANCE_FLOOR = 1e-9
# From so many trials on two groups are told to be few, as they may be conditions.
_MANY_OF_TWO = 20


class ActionModel(LongWorkMixin, SequenceLevelMixin, BaseEstimator):
    """The mean movement, how much people vary about it, and whether a trial is that movement.

    It learns from aligned trials. Those that are unlike them are refused:

    >>> import numpy as np
    >>> from sklearn_motionsync import ActionModel
    >>> t = np.linspace(0, 1, 20)[:, np.newaxis]
    >>> trials = [a * np.sin(3 * t) for a in (0.9, 1.0, 1.1, 1.2)]
    >>> model = ActionModel().fit(trials)
    >>> model.predict([1.05 * np.sin(3 * t), 0 * t, np.sin(6 * t)]).tolist()
    [1, -1, -1]
    >>> model.accepts([[0.15], [0.9]], frame=19).tolist()
    [True, False]

    Parameters
    ----------
    n_std : float, default=3.0
        Half-width of the envelope, in standard deviations.
    coverage : float, default=0.95
        Share of trials of new people that ``predict`` is to accept, between 0 and 1.

    Attributes
    ----------
    mean_ : ndarray, shape (P, n_features)
        The mean trial.
    variance_ : ndarray, shape (P, n_features)
        The variance of the trials (divided by their number) at every pose.
    predictive_variance_ : ndarray, shape (P, n_features)
        The variance to be expected of a new person about the mean: estimated by leaving groups
        out, shrunk a little towards its mean over the frames, never 0.
    missing_ : ndarray, shape (P, n_features)
        The share of the trials of which a value was missing (NaN).
    deviations_ : ndarray, shape (n_kept, P, n_features)
        Training trials less the mean: those that others are compared with and drawn from.
        At most 64, one of every group and the rest evenly spread. In a gap they go on in a straight
        line from one end to the other.
    groups_ : ndarray of int, shape (n_kept,)
        The groups of these, counted from 0 in the order of their first appearance.
    dissimilarities_ : ndarray, shape (n_sequences,)
        Of every training trial to those of other groups that are kept; after
        ``partial_fit``, of those of its last call.
    n_samples_seen_ : int
        Trials in all calls.
    threshold_ : float
        The largest dissimilarity that is accepted.
    n_frames_ : int
        ``P``.
    n_features_in_ : int
        Features of a frame (columns, for 2-D input).
    feature_names_in_ : ndarray of str
        Names of the features; only if the input had names.

    See Also
    --------
    DenseSynchronizer : Makes the input of this model.

    Notes
    -----
    1. The mean trial and the variance of every pose give the density of a trial, by independent
       normal distributions (Fig. 3d).
    2. The envelope is the mean, plus and minus ``n_std`` standard deviations. A pose is accepted at
       a frame if all of its features lie inside. Of new people it holds about 97 % of single values
       with 3 standard deviations, and 55 % of the whole poses, as many features may leave it.
    3. The dissimilarity of a trial y is the mean over the three most similar training trials y_i
       of

       ``r(y, y_i) = |y - y_i|^2 / (|y|^2 + |y_i|^2)``.

       Half of it is of poses less their own mean over time, to which a share of the squared
       distance of these means is added. Half of it is of velocities. 0 is equal, and 1 as
       dissimilar as standing still. The training set tells what counts: a feature has the factor
       ``v^(-1/4)`` with its variance v among trials, at most 3.2 times the least factor. The
       distance of mean poses makes a twentieth of a typical r, with a weight of at most 0.1.
    4. For the threshold every training trial is compared with those of *other groups*. A trial of a
       new person stays below it with probability ``coverage``. Standing still is always above,
       unless no training trial moves.

    **Gaps.** NaN is what was not seen, in training and after it. Mean and variances are those of
    what was seen at each frame, feature by feature; every value must have been seen in two groups.
    A density is that of what was seen (`score_samples`). A dissimilarity compares what was seen of
    both trials: it is a ratio, so trials with and without gaps have one threshold. Bands hold what
    is seen of a trial. Samples have no gaps.

    Give ``groups``, such as subjects, whenever people come more than once. Without them new people
    are rejected too often (docs/accuracy.md). In a pipeline: ``pipe.fit(X,
    actionmodel__groups=groups)``, or with scikit-learn's metadata routing ``pipe.fit(X,
    groups=groups)`` after ``set_fit_request(groups=True)``.
    """

    _parameter_constraints: dict = {
        "n_std": [Interval(Real, 0, None, closed="neither")],
        "coverage": [Interval(Real, 0, 1, closed="neither")],
    }
    _finite = "allow-nan"

    def __init__(self, n_std: float = 3.0, coverage: float = 0.95) -> None:
        self.n_std = n_std
        self.coverage = coverage

    # -- fitting ------------------------------------------------------------------------------

    @validated
    def fit(self, X: TrialsLike, y: object = None, groups: Labels | None = None) -> Self:
        """Estimate the mean trial, the variances and the threshold.

        Parameters
        ----------
        X : array, shape (n_sequences, P, n_features), or list of arrays (P, n_features)
            Synchronised trials; NaN where something was not seen. The rows of a 2-D array
            are univariate ones.
        y : array-like, shape (n_sequences,), default=None
            What the trials are told apart by. Nothing is learnt of it; it refuses ``groups`` that
            tell the same trials apart.
        groups : array-like, shape (n_sequences,), default=None
            The subject of each trial, or what else makes trials resemble each other,
            such as a session. By default every trial is a group of its own.

        Returns
        -------
        self : ActionModel
            The fitted model.

        Raises
        ------
        ValueError
            If the trials have different lengths, or there is only one, or all are of one
            group, or there is not a group for each; if nothing of a trial was seen, or a
            value was seen in fewer than two groups.
        """
        trials = _check_synchronised(self._check_training_set(X))
        if len(trials) < 2:
            raise ValueError(
                "A model of how trials vary needs at least 2 trials, got n_samples = 1."
            )
        codes, _ = encode_groups(groups, len(trials), at_least=2)
        if groups is not None and y is not None:
            refuse_classes_as_people(encode_groups(y, len(trials), name="y")[0], codes)
        if groups is not None and codes.max() == 1 and len(trials) >= _MANY_OF_TWO:
            warnings.warn(
                f"groups names two people for {counted(len(trials), 'trial')}: how people vary is "
                "learnt from two, which makes borders wide. If groups are conditions, give the "
                "person of each trial instead.",
                SynchronizationWarning,
                stacklevel=3,
            )
        with self._progress(fits=True):
            stream = TrialStream.starting_at(trials[0])
            learnt = self._learn(stream, trials, groups)
            if learnt["_unseen"]:
                raise ValueError(
                    f"{learnt['_unseen']}. Give more trials, leave out the feature, or fill "
                    "gaps before, as by fill_gaps of sklearn_motionsync.io."
                )
        self.__dict__.update(learnt)
        return self

    @validated
    def partial_fit(self, X: TrialsLike, y: object = None, groups: Labels | None = None) -> Self:
        """Update the model with more trials.

        For more data than memory holds, and for data that come in later. The model keeps at most
        64 trials, so a call takes the same time however many came before, and the labels of
        all groups. Mean, variances and the trials that are kept equal those of one ``fit``
        on all, to the last bit, however they are divided into calls. So does the threshold of up
        to 64 trials; of more, those of earlier calls enter it with the dissimilarity that
        they had when they were last compared.

        Parameters
        ----------
        X : array, shape (n_sequences, P, n_features), or list of arrays (P, n_features)
            Synchronised trials, at least one, on the clock of the earlier ones. The rows of a
            2-D array are univariate ones.
        y : ignored
            Present for API consistency.
        groups : array-like, shape (n_sequences,), default=None
            The subject of each trial. A label is the same subject in all calls. By default
            every trial is a group of its own.

        Returns
        -------
        self : ActionModel
            The updated model. As long as all trials are of one group, or a value was seen in
            one group only, only ``mean_`` and ``variance_`` are known, and other methods raise
            `NotFittedError`.

        Raises
        ------
        ValueError
            If the trials have different lengths, or another length than the earlier ones;
            if there is not a group for each; if a parameter has become invalid. The model does not
            change then.

        Examples
        --------
        Pipelines have no ``partial_fit``: fit the steps before the model on some trials, and
        give it what they make of all, portion by portion.

        >>> from sklearn.pipeline import make_pipeline
        >>> from sklearn_motionsync import ActionModel, ASpace, LinearSynchronizer
        >>> from sklearn_motionsync.datasets import make_bending
        >>> portions = [make_bending(10, random_state=seed).data for seed in range(3)]
        >>> before = make_pipeline(ASpace(3), LinearSynchronizer(50)).fit(portions[0])
        >>> model = ActionModel()
        >>> for portion in portions:
        ...     model = model.partial_fit(before.transform(portion))
        >>> model.n_samples_seen_
        30
        """
        # Scikit-learn validates parameters in the first call only.
        self._validate_params()
        if hasattr(self, "_stream"):
            trials, stream = self._check_clock(X), self._stream
        else:
            trials = _check_synchronised(self._check_training_set(X))
            stream = TrialStream.starting_at(trials[0])
        self.__dict__.update(self._learn(stream, trials, groups))
        return self

    @property
    def deviations_(self) -> np.ndarray:
        """Training trials that are kept, less the mean: (n_kept, P, n_features)."""
        check_is_fitted(self, "mean_")
        return fill_with_mean(self._stream.kept, self.mean_) - self.mean_

    def check_trials(self, X: TrialsLike) -> Trials:
        """Check that trials are synchronised, and to the clock of the model.

        Parameters
        ----------
        X : array, shape (n_sequences, P, n_features), or list of arrays (P, n_features)
            Synchronised trials. The rows of a 2-D array are univariate ones.

        Returns
        -------
        sequence of ndarray (P, n_features)
            All of one dtype, float32 or float64; not to be written to.

        Raises
        ------
        ValueError
            If the input breaks the contract, or trials have another length than the model.
        """
        self._check_groups_seen()
        return self._check_clock(X)

    # -- whole trials -------------------------------------------------------------------

    def score_samples(self, X: TrialsLike) -> np.ndarray:
        """Log-density of trials: independent normal distributions at every pose.

        For the choice between models of different actions. Not for whether a trial is the
        action at all, which `predict` tells: standing still at the mean pose is dense.

        It is a sum over all frames and features, in the unit of the data. Compare it only between
        models of equal ``P``, features and scaling. See `score` for what to use instead.

        With gaps (NaN) it is the density of what was seen, the marginal one: a sum over fewer
        values. It compares models of one trial as it does without gaps. Two trials with
        different gaps have sums of different length: compare their `dissimilarity`.

        Parameters
        ----------
        X : array, shape (n_sequences, P, n_features), or list of arrays (P, n_features)
            Synchronised trials.

        Returns
        -------
        ndarray, shape (n_sequences,)
            The natural logarithm of the density.
        """
        trials = self.check_trials(X)
        std = np.sqrt(np.maximum(self.variance_, self._variance_floor))
        densities = np.empty(len(trials))
        for i, x in enumerate(trials):
            # Of what was seen.
            seen, squares = ~np.isnan(x), np.nansum(np.square((x - self.mean_) / std))
            log_std = np.log(std[seen]).sum(dtype=np.float64)
            densities[i] = -0.5 * squares - log_std - 0.5 * seen.sum() * np.log(2 * np.pi)
        return densities

    def score(
        self,
        X: TrialsLike,
        y: object = None,
        sample_weight: ValuesLike | None = None,
    ) -> float:
        """Mean log-density of trials, to compare models of equal ``P``, features and scaling.

        It is a sum over all frames and features: twice the frames double it, and another unit
        changes it. To choose ``n_frames`` and the parameters of a synchronizer, give the search
        ``scoring=FeatureHoldoutScorer()``, which has no unit and hardly depends on ``P``. To choose
        features or scaling, score decisions, as the example of `ActionDetector` does.

        Parameters
        ----------
        X : array, shape (n_sequences, P, n_features), or list of arrays (P, n_features)
            Synchronised trials.
        y : ignored
            Present for API consistency.
        sample_weight : array-like, shape (n_sequences,), default=None
            The weight of each trial; by default all are equal.

        Returns
        -------
        float
            The weighted mean of `score_samples`.
        """
        densities = self.score_samples(X)
        if sample_weight is not None:
            check_consistent_length(densities, sample_weight)
        return float(np.average(densities, weights=sample_weight))

    def dissimilarity(self, X: TrialsLike) -> np.ndarray:
        """Mean dissimilarity of trials to the three most similar training trials.

        Parameters
        ----------
        X : array, shape (n_sequences, P, n_features), or list of arrays (P, n_features)
            Synchronised trials.

        Returns
        -------
        ndarray, shape (n_sequences,)
            0 for equal trials, 1 for standing still.
        """
        trials = self.check_trials(X)
        return self._neighbours.dissimilarity(trials)

    def decision_function(self, X: TrialsLike) -> np.ndarray:
        """How far below the threshold the dissimilarity of trials is, as a logarithm.

        Parameters
        ----------
        X : array, shape (n_sequences, P, n_features), or list of arrays (P, n_features)
            Synchronised trials.

        Returns
        -------
        ndarray, shape (n_sequences,)
            ``log(threshold / dissimilarity)``: negative for trials that are rejected.
        """
        dissimilarity = np.maximum(self.dissimilarity(X), LEAST)
        return np.log(self.threshold_ / dissimilarity)

    def predict(self, X: TrialsLike) -> np.ndarray:
        """Whether trials are the action, by their movement alone.

        An `ActionDetector` also looks at the pace and the size, and at good trials of the person.

        Parameters
        ----------
        X : array, shape (n_sequences, P, n_features), or list of arrays (P, n_features)
            Synchronised trials.

        Returns
        -------
        ndarray of int, shape (n_sequences,)
            1 if the dissimilarity is at most the threshold, else -1.
        """
        return np.where(self.decision_function(X) >= 0, 1, -1)

    # -- poses, bands and samples ----------------------------------------------------------

    def accepts(self, poses: TrialLike, frame: int) -> np.ndarray:
        """Whether poses lie inside the envelope at a frame.

        For a tracker, which prunes poses that are not possible at this instant. It does not
        tell whether a trial is the action: `predict` does.

        Parameters
        ----------
        poses : array-like, shape (n_poses, n_features)
            Poses, in the features of the model. One that was not seen (NaN) rejects nothing.
        frame : int
            Frame of the model, 0 to P - 1.

        Returns
        -------
        ndarray of bool, shape (n_poses,)
            Whether all features of a pose lie inside.
        """
        self._check_groups_seen()
        frame = self._check_frame(frame)
        names = names_of_input(self)
        check_names(poses, names, "poses")
        poses = as_numbers(poses, "poses", dtype=self.mean_.dtype)
        width = self.mean_.shape[1]
        if poses.ndim != 2 or poses.shape[1] != width:
            raise ValueError(
                f"poses must have shape (n_poses, {width}), got {poses.shape}. Give one "
                "pose as [pose]."
            )
        check_finite(poses, "poses, row", names, allow_nan=True)
        mean, half_width = self.mean_[frame], self.n_std * np.sqrt(self.variance_[frame])
        outside = (poses < mean - half_width) | (poses > mean + half_width)
        return ~outside.any(axis=1)

    def envelope(self, simultaneous: bool = False) -> tuple[np.ndarray, np.ndarray]:
        """A band about the mean trial, for poses or for whole trials.

        Parameters
        ----------
        simultaneous : bool, default=False
            False: ``n_std`` standard deviations of the training trials on both sides. At 3
            it holds about 97 % of the *values* of new people and 55 % of their *poses*, but hardly
            a whole trial. True: it holds ``coverage`` of the *whole trials* of new people,
            at all frames and in all features: `simultaneous_factor` predicted standard deviations.

        Returns
        -------
        lower, upper : ndarray, shape (P, n_features)
            The bounds of the band.

        See Also
        --------
        mean_envelope : A confidence band of the mean.
        """
        self._check_groups_seen()
        if simultaneous:
            half_width = self.simultaneous_factor() * np.sqrt(self.predictive_variance_)
        else:
            half_width = self.n_std * np.sqrt(self.variance_)
        return self.mean_ - half_width, self.mean_ + half_width

    def mean_envelope(
        self, random_state: RandomState = 0, match: Match | None = None
    ) -> tuple[np.ndarray, np.ndarray]:
        """A confidence band of the population's mean, at all frames and in all features.

        It holds that mean with probability ``coverage``, by a bootstrap over groups: the mean to
        be expected if other people had been recorded, as many with as many trials. Of more
        than 64 trials it is the band of those that are kept, which is wider.

        The bootstrap takes the clock for exact. With a match the variance of a wrong clock is
        added: the squared slope of the mean times the squared standard error of the times.

        Parameters
        ----------
        random_state : int, RandomState instance or None, default=0
            Draws the bootstrap samples.
        match : Match, default=None
            Of the training trials, by the `DenseSynchronizer` that the model was fitted after.

        Returns
        -------
        lower, upper : ndarray, shape (P, n_features)
            The bounds of the band.

        Raises
        ------
        ValueError
            If the match is on another clock, or does not tell how sure it is (`Match.interval`).
        """
        self._check_groups_seen()
        training = self._stream.kept.astype(np.float64)
        half_width = mean_band(training, self.groups_, self.coverage, random_state)
        if match is not None:
            if match.times.shape[1] != self.n_frames_:
                raise ValueError(
                    f"The match has {match.times.shape[1]} frames, the model {self.n_frames_}: "
                    "give the match of the synchronizer that the model was fitted after."
                )
            half_width = np.hypot(half_width, clock_error(self.mean_, *match.interval(STANDARD)))
        half_width = half_width.astype(self.mean_.dtype)
        return self.mean_ - half_width, self.mean_ + half_width

    def simultaneous_factor(self) -> float:
        """How many predicted standard deviations the trials of new people stay within.

        Whole trials, at all frames and in all features, with probability ``coverage``:
        estimated from the largest deviation of each trial when its group is left out.

        Returns
        -------
        float
            The half-width of the simultaneous band.
        """
        self._check_groups_seen()
        return simultaneous_factor(
            self._stream.kept.astype(np.float64), self.groups_, self.coverage
        )

    def sample(
        self, n: int = 1, frame: int | None = None, random_state: RandomState = None
    ) -> np.ndarray:
        """Draw accepted poses at a frame (Fig. 4), or whole trials.

        Poses are drawn about those of training trials chosen at random, and are truncated at the
        envelope. Trials are those of new people, about as far from training trials as these. Both
        have the mean, variance and covariance of all, so that features keep their correlations.
        Trials are accepted by `predict`; one that would be rejected is moved towards a training
        trial. Features that are directions, such as those of
        `DirectionCosines`, are mixed on the sphere and keep the length 1. Dimensions of an `ASpace`
        are no directions: there, limbs get their length from ``inverse_transform`` of the cosines.

        Parameters
        ----------
        n : int, default=1
            Number of samples.
        frame : int, default=None
            Frame of the model, 0 to P - 1; None for whole trials.
        random_state : int, RandomState instance or None, default=None
            Draws the samples.

        Returns
        -------
        ndarray, shape (n, n_features) or (n, P, n_features)
            (n, P) for whole trials of a model fitted on 2-D input.

        See Also
        --------
        blend_trials : Mixtures of one's own, in timing too.
        """
        self._check_groups_seen()
        if not isinstance(n, Integral) or n < 1:
            raise ValueError(f"n must be a whole number of samples, at least 1; got {n!r}.")
        random_state = check_random_state(random_state)
        mean, variance, deviations = self.mean_, self.variance_, self.deviations_
        if frame is not None:
            k = self._check_frame(frame)
            return sample_poses(mean[k], variance[k], deviations[:, k], n, self.n_std, random_state)
        dissimilarity, limit = self._neighbours.dissimilarity, self.threshold_
        samples = sample_trials(mean, variance, deviations, n, dissimilarity, limit, random_state)
        return samples[:, :, 0] if self._fitted_on_rows else samples

    # -- helpers ------------------------------------------------------------------------------

    def __getstate__(self):
        return {name: value for name, value in super().__getstate__().items() if name != KEPT}

    def __sklearn_tags__(self):
        tags = super().__sklearn_tags__()
        tags.input_tags.three_d_array = True
        tags.input_tags.allow_nan = True
        return tags

    def _learn(self, before, trials, groups):
        """The attributes that are known after more trials than those of a stream."""
        stream, codes, is_kept = before.extend(trials, groups)
        dtype, unseen = stream.kept.dtype, self._describe_unseen(stream)
        spread = float((stream.variance.mean(axis=0) + stream.mean.var(axis=0)).max().astype(dtype))
        learnt = {
            "n_samples_seen_": stream.n,
            "n_frames_": len(stream.origin),
            "mean_": stream.mean.astype(dtype),
            "variance_": stream.variance.astype(dtype),
            "missing_": stream.missing,
            "groups_": stream.groups,
            "_variance_floor": _VARIANCE_FLOOR * (spread if spread > 0 else 1.0),
            "_stream": stream,
            "_unseen": unseen,
        }
        if stream.n_groups < 2 or unseen:
            return learnt
        if stream.kept is before.kept:
            neighbours, compared_before = self._neighbours, self._kept_dissimilarities
        else:
            training = stream.kept.astype(np.float64)
            variance = predictive_variance(training, stream.groups)
            learnt["predictive_variance_"] = variance.astype(dtype)
            weights = learn_weights(fill_with_mean(training, stream.mean), stream.groups)
            neighbours = Neighbours(training, stream.groups, mean=stream.mean, weights=weights)
            compared_before = neighbours.dissimilarity(before.kept, before.groups)
        dissimilarities = neighbours.dissimilarity(trials, codes)
        compared = np.concatenate([compared_before, dissimilarities])
        moments = stream.dropped + log_moments(compared)
        return learnt | {
            "dissimilarities_": dissimilarities,
            "threshold_": neighbours.limit(moments, self.coverage),
            "_neighbours": neighbours,
            "_kept_dissimilarities": compared[is_kept],
            "_log_moments": moments,
            "_stream": replace(stream, dropped=stream.dropped + log_moments(compared[~is_kept])),
        }

    def _describe_unseen(self, stream):
        """A text about a value that the trials of fewer than two groups show; or none."""
        if stream.n_groups < 2 or not stream.missing.any():
            return ""
        n_groups = (group_counts(stream.kept, stream.groups) > 0).sum(axis=0)
        if n_groups.min() > 1:
            return ""
        frame, feature = np.argwhere(n_groups < 2)[0]
        names = names_of_input(self)
        name = "" if names is None else f" ({names[feature]!r})"
        groups = "trial" if stream.n_groups == stream.n else "group"
        return (
            f"Frame {frame}, feature {feature}{name} was seen in "
            f"{counted(int(n_groups[frame, feature]), groups)}, and at least 2 tell how it varies: "
            f"{counted(int((n_groups < 2).sum()), 'value')} of {n_groups.size} are so"
        )

    def _check_frame(self, frame):
        if not isinstance(frame, Integral) or not 0 <= frame < self.n_frames_:
            raise ValueError(
                f"frame must be a whole number from 0 to {self.n_frames_ - 1}, got {frame!r}."
            )
        return int(frame)

    def _check_clock(self, X):
        trials = _check_synchronised(super().check_trials(X))
        if len(trials[0]) != self.n_frames_:
            raise ValueError(
                f"The trials have {len(trials[0])} frames, the model "
                f"{self.n_frames_}: synchronise them with the synchronizer that the model was "
                "fitted after."
            )
        return trials

    def _check_groups_seen(self):
        check_is_fitted(self, "mean_")
        if self._unseen:
            raise NotFittedError(f"{self._unseen}. Give others to partial_fit.")
        if not hasattr(self, "threshold_"):
            raise NotFittedError(
                "A model of how trials vary needs at least 2 trials, of different "
                f"groups; it has seen {self.n_samples_seen_}, of one group. Give others to "
                "partial_fit, or no groups."
            )


def _check_synchronised(trials):
    """Refuse trials of several lengths, and those that show nothing."""
    for i, x in enumerate(trials):
        if len(x) != len(trials[0]):
            raise ValueError(
                f"Trial {i} has {len(x)} frames, trial 0 has {len(trials[0])}: a "
                "model needs synchronised trials. Put a DenseSynchronizer before it."
            )
        if is_gappy(x) and np.isnan(x).all():
            raise ValueError(
                f"{trials.called(i)} is NaN in every frame and feature: nothing of it was "
                "seen. Drop the trial."
            )
    return trials
