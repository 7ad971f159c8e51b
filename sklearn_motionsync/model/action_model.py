"""The action model: mean performance, variance at every posture, envelope (section 4)."""

from dataclasses import replace
from numbers import Integral, Real

import numpy as np
from sklearn.base import BaseEstimator, _fit_context
from sklearn.exceptions import NotFittedError
from sklearn.utils import check_consistent_length, check_random_state
from sklearn.utils._param_validation import Interval
from sklearn.utils.validation import check_is_fitted

from ..inputs.numbers import as_numbers, check_finite, check_names, check_squares
from ..inputs.validation import SequenceLevelMixin, names_of_input
from ..utils.atomic import atomic_fit, atomic_partial_fit, snapshot
from ..utils.doc_links import DocumentedMixin
from ..utils.groups import encode_groups
from .sampling import sample_performances, sample_postures
from .similarity import Logs, Neighbours, portions
from .stream import PerformanceStream
from .variation import mean_band, predictive_variance, simultaneous_factor

__all__ = ["ActionModel"]

# -- what a model of an action says of whole performances: how dense they are, and if they are it


class JudgingMixin:
    """What a model of an action says of performances: their density, and whether they are it."""

    @snapshot
    def score_samples(self, X):
        """Log-density of performances: independent normal distributions at every posture.

        It tells which of two models fits a performance better; it is not what ``predict`` asks,
        as doing nothing is dense.

        Parameters
        ----------
        X : array, shape (n_sequences, P, n_features), or list of arrays (P, n_features)
            Synchronised performances.

        Returns
        -------
        ndarray, shape (n_sequences,)
        """
        performances, std = self.check_performances(X), self._std()
        # What is too far away for any number has the density 0.
        with np.errstate(over="ignore"):
            squares = [
                np.square((some - self.mean_) / std).sum(axis=(1, 2))
                for _, some in portions(performances)
            ]
        return self._log_density(np.concatenate(squares))

    @snapshot
    def score(self, X, y=None, sample_weight=None):
        """Mean log-density of performances.

        Parameters
        ----------
        X : as for ``score_samples``
        y : ignored
        sample_weight : array-like, shape (n_sequences,), default=None
            How much each performance counts; by default all alike.

        Returns
        -------
        float
        """
        densities = self.score_samples(X)
        if sample_weight is not None:
            check_consistent_length(densities, sample_weight)
        return float(np.average(densities, weights=sample_weight))

    @snapshot
    def dissimilarity(self, X):
        """How unlike performances are to the most similar training performances.

        Parameters
        ----------
        X : as for ``score_samples``

        Returns
        -------
        ndarray, shape (n_sequences,)
            0 equal, 1 as unlike as standing still.
        """
        performances = self.check_performances(X)
        return self._neighbours.dissimilarity(performances)

    @snapshot
    def threshold_at(self, coverage):
        """The border of another coverage.

        Parameters
        ----------
        coverage : float
            Share of performances of people not seen to be accepted, between 0 and 1.

        Returns
        -------
        float
            ``threshold_`` for the ``coverage`` of the model.

        Raises
        ------
        ValueError
            If it is no share.
        """
        self._check_learnt()
        if not (isinstance(coverage, Real) and 0 < coverage < 1):
            raise ValueError(f"coverage must be a share between 0 and 1, got {coverage!r}.")
        return self._neighbours.border(self._unlike, coverage)

    @snapshot
    def decision_function(self, X):
        """How far inside the border performances are: ``threshold_`` less their dissimilarity.

        Parameters
        ----------
        X : as for ``score_samples``

        Returns
        -------
        ndarray, shape (n_sequences,)
            Negative outside.
        """
        found = self.dissimilarity(X)
        return self.threshold_ - found

    @snapshot
    def predict(self, X):
        """Whether performances are the action: at most as unlike as people are expected to be.

        Parameters
        ----------
        X : as for ``score_samples``

        Returns
        -------
        ndarray of int, shape (n_sequences,)
            1 inside, -1 outside.
        """
        return np.where(self.decision_function(X) >= 0, 1, -1)

    def _std(self):
        return np.sqrt(np.maximum(self.variance_, self._floor))

    def _log_density(self, squares):
        """Log-density of performances with these sums of squared standard deviations."""
        log_std = np.log(self._std()).sum(dtype=np.float64)
        return -0.5 * squares - log_std - 0.5 * self.mean_.size * np.log(2 * np.pi)


# -- what postures are possible at a frame of the action, and new ones (Fig. 3d, Fig. 4) -


class EnvelopeMixin:
    """What a model of an action says of postures: those it accepts, bounds for them, samples."""

    @snapshot
    def accepts(self, postures, frame):
        """Whether postures lie inside the envelope at a frame.

        For the pruning of a tracker, which asks for postures that are possible at this instant. It
        does not tell whether a performance is the action: ``predict`` does.

        Parameters
        ----------
        postures : array-like, shape (n_postures, n_features)
        frame : int
            Frame of the model, 0 to P - 1.

        Returns
        -------
        ndarray of bool, shape (n_postures,)
        """
        self._check_learnt()
        frame = self._check_frame(frame)
        check_names(postures, names_of_input(self), "postures")
        postures = as_numbers(postures, "postures", dtype=self.mean_.dtype)
        width = self.mean_.shape[1]
        if postures.ndim != 2 or postures.shape[1] != width:
            raise ValueError(
                f"postures must have shape (n_postures, {width}), got {postures.shape}. Give one "
                "posture as [posture]."
            )
        check_finite(postures, "postures, row", names_of_input(self))
        mean, reach = self.mean_[frame], self.n_std * np.sqrt(self.variance_[frame])
        return ((postures >= mean - reach) & (postures <= mean + reach)).all(axis=1)

    @snapshot
    def envelope(self, simultaneous=False):
        """A band about the mean performance, for postures or for whole performances.

        Parameters
        ----------
        simultaneous : bool, default=False
            False: ``n_std`` standard deviations of the training performances on both sides. At 3
            it holds nearly all *postures* of people, but few whole performances: those leave it
            somewhere. True: it holds ``coverage`` of the *whole performances* of new people, at
            all frames and in all features: `simultaneous_factor` predicted standard deviations.

        Returns
        -------
        lower, upper : ndarray, shape (P, n_features)

        See Also
        --------
        mean_envelope : Holds the mean, not performances.
        """
        self._check_learnt()
        if simultaneous:
            reach = self.simultaneous_factor() * np.sqrt(self.predictive_variance_)
        else:
            reach = self.n_std * np.sqrt(self.variance_)
        return self.mean_ - reach, self.mean_ + reach

    @snapshot
    def mean_envelope(self, random_state=None):
        """A band that holds the mean of all people at all frames and in all features.

        With probability ``coverage``, by a bootstrap over groups: what is to be expected
        of the mean if other people had been recorded, as many with as many performances. Of more
        than 64 performances it is the band of those that are kept, wider than need be.

        Parameters
        ----------
        random_state : int, RandomState instance or None, default=None

        Returns
        -------
        lower, upper : ndarray, shape (P, n_features)
        """
        self._check_learnt()
        reach = mean_band(self._known(), self.groups_, self.coverage, random_state)
        reach = reach.astype(self.mean_.dtype)
        return self.mean_ - reach, self.mean_ + reach

    @snapshot
    def simultaneous_factor(self):
        """How many predicted standard deviations the performances of new people stay within.

        Whole performances, at all frames and in all features, with probability ``coverage``:
        learnt by leaving out group by group, of the largest deviation of each performance.

        Returns
        -------
        float
        """
        self._check_learnt()
        return simultaneous_factor(self._known(), self.groups_, self.coverage)

    @snapshot
    def standard_scores(self, X):
        """How far performances are from the mean, in standard deviations predicted for new people.

        Parameters
        ----------
        X : array, shape (n_sequences, P, n_features), or list of arrays (P, n_features)
            Synchronised performances.

        Returns
        -------
        ndarray, shape (n_sequences, P, n_features)
            Negative below the mean; the root of ``predictive_variance_`` is 1.

        See Also
        --------
        find_departures : Where they are large, as a table.
        """
        performances = np.stack(self.check_performances(X))
        # What is too far away for any number is infinitely far.
        with np.errstate(over="ignore"):
            return (performances - self.mean_) / np.sqrt(self.predictive_variance_)

    @snapshot
    def sample(self, n=1, frame=None, random_state=None):
        """Draw accepted postures at a frame (Fig. 4), or whole performances.

        Both are drawn about those of training performances chosen at random, with mean, variance
        and covariance of all: what belongs together stays together, and styles stay apart.
        Postures are cut off at the envelope. Performances are inside for ``predict``; one that
        would fall outside is drawn in to its training performance. Features of theirs that are
        directions, such as those of `DirectionCosines`, are mixed on the sphere and keep the
        length 1. Dimensions of an `ASpace` are no directions: limbs drawn there get their length
        from ``inverse_transform`` of the cosines.

        Parameters
        ----------
        n : int, default=1
            How many.
        frame : int, default=None
            Frame of the model, 0 to P - 1; None for whole performances.
        random_state : int, RandomState instance or None, default=None

        Returns
        -------
        ndarray, shape (n, n_features) or (n, P, n_features)
            (n, P) for whole performances of a model fitted on 2-D input.

        See Also
        --------
        blend_performances : Mixtures of one's own, in timing too.
        """
        self._check_learnt()
        if not isinstance(n, Integral) or n < 1:
            raise ValueError(f"n must be a whole number of samples, at least 1; got {n!r}.")
        random_state = check_random_state(random_state)
        if frame is not None:
            frame = self._check_frame(frame)
            of_frame = self.mean_[frame], self.variance_[frame], self.deviations_[:, frame]
            return sample_postures(*of_frame, n, self.n_std, random_state)
        samples = sample_performances(
            self.mean_,
            self.variance_,
            self.deviations_,
            n,
            self._neighbours.dissimilarity,
            self.threshold_,
            random_state,
        )
        return samples[:, :, 0] if self._fitted_on_rows else samples

    def _known(self):
        """The training performances that are kept."""
        return self._seen.kept.astype(np.float64)

    def _check_frame(self, frame):
        if not isinstance(frame, Integral) or not 0 <= frame < self.n_frames_:
            raise ValueError(
                f"frame must be a whole number from 0 to {self.n_frames_ - 1}, got {frame!r}."
            )
        return int(frame)


# Smallest variance of a density, as a share of the variance of all the data: a feature
# in which nobody differed is not infinitely improbable to differ.
_VARIANCE_FLOOR = 1e-9


class ActionModel(DocumentedMixin, JudgingMixin, EnvelopeMixin, SequenceLevelMixin, BaseEstimator):
    """What an action looks like at every instant, and how much people vary there.

    1. The mean performance and the variance of every posture, over synchronised
       performances (Fig. 3d), and with them the density of a performance: independent normal
       distributions.
    2. The envelope: the mean, plus and minus ``n_std`` standard deviations. A posture is
       accepted at a frame if all of its features lie inside.
    3. Whether a performance is the action: its dissimilarity is the mean over the two most similar
       training performances of

       ``r(y, y_i) = |y - y_i|^2 / (|y|^2 + |y_i|^2)``,

       half of postures less their own mean over time, to which a tenth of the squared distance of
       these means is added, half of velocities: 0 is equal, 1 as unlike as standing still.
    4. The border: every training performance is compared with those of *other people*, and the
       border is what a new person stays below with probability ``coverage``. Standing still is
       never inside, unless nobody moves.

    Parameters
    ----------
    n_std : float, default=3.0
        Half-width of the envelope, in standard deviations.
    coverage : float, default=0.95
        Share of performances of people not seen that ``predict`` is to accept, between 0 and 1.

    Attributes
    ----------
    mean_ : ndarray, shape (P, n_features)
        The mean performance.
    variance_ : ndarray, shape (P, n_features)
        The variance of the performances (divided by their number) at every posture.
    predictive_variance_ : ndarray, shape (P, n_features)
        The variance to be expected of a new person about the mean: learnt by leaving groups out,
        drawn a little towards its mean over the frames, never 0.
    deviations_ : ndarray, shape (n_kept, P, n_features)
        Training performances less the mean: those that others are compared with and drawn from.
        At most 64, one of every group and the rest evenly spread.
    groups_ : ndarray of int, shape (n_kept,)
        The groups of these, counted from 0 in the order in which they come.
    dissimilarities_ : ndarray, shape (n_sequences,)
        Of every training performance to those of other groups that are kept; after
        ``partial_fit``, of those of its last call.
    n_samples_seen_ : int
        Performances in all calls.
    threshold_ : float
        The border: performances with a dissimilarity up to this are inside.
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
    Give ``groups``, such as who performed, whenever people come more than once. Without them a
    person's other performances tell how unlike performances are, and people not seen are refused
    too often: docs/accuracy.md. In a pipeline they are given as
    ``pipe.fit(X, actionmodel__groups=groups)``, or with scikit-learn's metadata routing as
    ``pipe.fit(X, groups=groups)`` after ``set_fit_request(groups=True)``.

    Examples
    --------
    >>> import numpy as np
    >>> from sklearn_motionsync import ActionModel
    >>> t = np.linspace(0, 1, 20)[:, np.newaxis]
    >>> performances = [a * np.sin(3 * t) for a in (0.9, 1.0, 1.1, 1.2)]
    >>> model = ActionModel().fit(performances)
    >>> model.predict([1.05 * np.sin(3 * t), 0 * t, np.sin(6 * t)]).tolist()
    [1, -1, -1]
    >>> model.accepts([[0.15], [0.9]], frame=19).tolist()
    [True, False]
    """

    _parameter_constraints: dict = {
        "n_std": [Interval(Real, 0, None, closed="neither")],
        "coverage": [Interval(Real, 0, 1, closed="neither")],
    }

    def __init__(self, n_std=3.0, coverage=0.95):
        self.n_std = n_std
        self.coverage = coverage

    @atomic_fit
    @_fit_context(prefer_skip_nested_validation=True)
    def fit(self, X, y=None, groups=None):
        """Learn the mean performance, the variances, and how unlike people may be.

        Parameters
        ----------
        X : array, shape (n_sequences, P, n_features), or list of arrays (P, n_features)
            Synchronised performances. The rows of a 2-D array are univariate ones.
        y : ignored
        groups : array-like, shape (n_sequences,), default=None
            Who performed, or what else makes performances resemble each other, such as a
            session. By default every performance counts for itself.

        Returns
        -------
        self

        Raises
        ------
        ValueError
            If the performances have different lengths, or there is only one, or their unit is such
            that variances are beyond the precision; if all are of one group, or there is not a
            group for each performance.
        """
        performances = _alike(self._check_training_set(X))
        if len(performances) < 2:
            raise ValueError(
                "A model of how performances vary needs at least 2 performances, got n_samples = 1."
            )
        encode_groups(groups, len(performances), at_least=2)
        self._learn(performances, groups, PerformanceStream())
        return self

    @atomic_partial_fit
    @_fit_context(prefer_skip_nested_validation=True)
    def partial_fit(self, X, y=None, groups=None):
        """Learn of more performances, after those of earlier calls or of ``fit``.

        For more than memory holds, and for those that come in later. Of the performances themselves
        only 64 are kept, so that a call costs the same however many came before; labels of groups
        are kept all.
        Mean, variances, and who is kept are those of one ``fit`` on all, to the last bit,
        whatever the portions. So is the border of up to 64 in all; of more, those that came
        before are as unlike as they were to the ones that were kept when they came, or left.

        Parameters
        ----------
        X : array, shape (n_sequences, P, n_features), or list of arrays (P, n_features)
            Synchronised performances, at least one, on the clock of the earlier ones. The rows of a
            2-D array are univariate ones.
        y : ignored
        groups : array-like, shape (n_sequences,), default=None
            Who performed. The same label is the same person in all calls. By default every
            performance counts for itself.

        Returns
        -------
        self
            As long as all performances are one, or of one group, only ``mean_``, ``variance_``
            and what is kept: how people vary is not known, and questions raise `NotFittedError`.

        Raises
        ------
        ValueError
            If the performances have different lengths, or others than the earlier ones; if their
            unit is such that variances are beyond the precision, or there is not a group for each;
            if a parameter has become invalid. The model is as it was then.

        Examples
        --------
        Pipelines have no ``partial_fit``: fit the steps before the model on some performances, and
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
        # Scikit-learn leaves this out of all calls but the first.
        self._validate_params()
        if hasattr(self, "_seen"):
            performances, seen = self._check_clock(X), self._seen
        else:
            performances, seen = _alike(self._check_training_set(X)), PerformanceStream()
        self._learn(performances, groups, seen)
        return self

    @property
    @snapshot
    def deviations_(self):
        """Training performances that are kept, less the mean: (n_kept, P, n_features)."""
        check_is_fitted(self)
        return self._seen.kept - self.mean_

    def check_performances(self, X):
        """Check that performances are synchronised, and to the clock of the model.

        Parameters
        ----------
        X : array, shape (n_sequences, P, n_features), or list of arrays (P, n_features)
            Synchronised performances. The rows of a 2-D array are univariate ones.

        Returns
        -------
        sequence of ndarray (P, n_features)
            All of one dtype, float32 or float64; not to be written to.

        Raises
        ------
        ValueError
            If the input breaks the contract, performances have different lengths, or others than
            the model.
        """
        self._check_learnt()
        return self._check_clock(X)

    def __sklearn_tags__(self):
        tags = super().__sklearn_tags__()
        tags.input_tags.three_d_array = True
        return tags

    def _learn(self, performances, groups, before):
        """Learn of performances that came after others."""
        seen, codes, stay = before.after(performances, groups)
        self.n_samples_seen_, self.n_frames_ = seen.n, len(seen.origin)
        with np.errstate(over="ignore", invalid="ignore"):
            self.mean_, self.variance_, spread = (
                np.asarray(x, dtype=seen.kept.dtype)
                for x in (seen.mean, seen.variance, seen.spread)
            )
        spread = float(spread)
        check_squares(np.stack(seen.bounds), spread, "variances")
        self._floor = _VARIANCE_FLOOR * (spread if spread > 0 else 1.0)
        self.groups_, self._seen = seen.groups, seen
        if seen.n_groups < 2:
            # Nobody can be compared with others yet.
            return
        known_before = self._of_kept if seen.kept is before.kept else None
        if known_before is None:
            known = seen.kept.astype(np.float64)
            variance = predictive_variance(known, seen.groups)
            self.predictive_variance_ = variance.astype(seen.kept.dtype)
            self._neighbours = Neighbours(known, seen.groups)
            known_before = self._neighbours.dissimilarity(before.kept, before.groups)
        self.dissimilarities_ = self._neighbours.dissimilarity(performances, codes)
        at_hand = np.concatenate([known_before, self.dissimilarities_])
        self._of_kept = at_hand[stay]
        self._unlike = seen.gone + Logs.of(at_hand)
        # Those that go are not seen again: this is what stays of them.
        self._seen = replace(seen, gone=seen.gone + Logs.of(at_hand[~stay]))
        self.threshold_ = self._neighbours.border(self._unlike, self.coverage)

    def _check_clock(self, X):
        """Performances on the clock of the model."""
        performances = _alike(super().check_performances(X))
        if len(performances[0]) != self.n_frames_:
            raise ValueError(
                f"The performances have {len(performances[0])} frames, the model "
                f"{self.n_frames_}: synchronise them with the synchronizer that the model was "
                "fitted after."
            )
        return performances

    def _check_learnt(self):
        """Whether it is known how people vary."""
        check_is_fitted(self)
        if not hasattr(self, "threshold_"):
            raise NotFittedError(
                "A model of how performances vary needs at least 2 performances, of different "
                f"groups; so far came {self.n_samples_seen_}, of one group. Give others to "
                "partial_fit, or no groups, and every performance counts for itself."
            )


def _alike(performances):
    """Performances, all of the same length."""
    n_frames = len(performances[0])
    for i, x in enumerate(performances):
        if len(x) != n_frames:
            raise ValueError(
                f"Performance {i} has {len(x)} frames, performance 0 has {n_frames}: a model "
                "needs synchronised performances. Put a DenseSynchronizer before it."
            )
    return performances
