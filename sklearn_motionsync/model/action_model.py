"""The action model: mean performance, variance at every posture, envelope (section 4)."""

from dataclasses import replace
from numbers import Real

import numpy as np
from sklearn.base import BaseEstimator, _fit_context
from sklearn.exceptions import NotFittedError
from sklearn.utils._param_validation import Interval
from sklearn.utils.validation import check_is_fitted

from ..fitting import at_once, carried_on, of_one_state
from ..gate import check_squares
from ..notebook import DocumentedMixin
from ..performances import SequenceLevelMixin
from .envelope import EnvelopeMixin
from .judging import JudgingMixin
from .likeness import Logs, Neighbours, as_codes
from .stream import Stream
from .variation import predictive_variance

__all__ = ["ActionModel"]

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

    @at_once
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
        as_codes(groups, len(performances))
        self._learn(performances, groups, Stream())
        return self

    @carried_on
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
            performances, seen = _alike(self._check_training_set(X)), Stream()
        self._learn(performances, groups, seen)
        return self

    @property
    @of_one_state
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
