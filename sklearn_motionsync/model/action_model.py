"""The action model: mean performance, variance at every posture, envelope (section 4)."""

from numbers import Real

import numpy as np
from sklearn.base import BaseEstimator, _fit_context
from sklearn.utils import check_consistent_length
from sklearn.utils._param_validation import Interval
from sklearn.utils.validation import check_is_fitted

from ..fitting import at_once, of_one_state
from ..gate import check_squares
from ..notebook import DocumentedMixin
from ..performances import SequenceLevelMixin
from .envelope import EnvelopeMixin
from .likeness import Neighbours, as_codes, spread_out
from .variation import predictive_variance

__all__ = ["ActionModel"]

# Smallest variance of a density, as a share of the variance of all the data: a feature
# in which nobody differed is not infinitely improbable to differ.
_VARIANCE_FLOOR = 1e-9


class ActionModel(DocumentedMixin, EnvelopeMixin, SequenceLevelMixin, BaseEstimator):
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
        At most 64, one of every group and the rest evenly spaced.
    groups_ : ndarray of int, shape (n_kept,)
        The groups of these, counted from 0 in the order in which they come.
    dissimilarities_ : ndarray, shape (n_sequences,)
        Of every training performance to those of other groups that are kept.
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
        X = np.stack(_alike(self._check_training_set(X)))
        if len(X) < 2:
            raise ValueError(
                "A model of how performances vary needs at least 2 performances, got n_samples = 1."
            )
        groups = as_codes(groups, len(X))
        self.n_frames_ = X.shape[1]
        with np.errstate(over="ignore", invalid="ignore"):
            self.mean_ = X.mean(axis=0)
            self.variance_ = X.var(axis=0)
            spread = float(X.var(axis=(0, 1)).max())
        check_squares(X, spread, "variances")
        self._floor = _VARIANCE_FLOOR * (spread if spread > 0 else 1.0)
        kept = spread_out(groups)
        self.deviations_, self.groups_ = X[kept] - self.mean_, groups[kept]
        known = X[kept].astype(np.float64)
        self.predictive_variance_ = predictive_variance(known, self.groups_).astype(X.dtype)
        self._neighbours = Neighbours(known, self.groups_)
        self.dissimilarities_ = self._neighbours.dissimilarity(X, groups)
        self.threshold_ = self._neighbours.border(self.dissimilarities_, self.coverage)
        return self

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
        performances = _alike(super().check_performances(X))
        if len(performances[0]) != self.n_frames_:
            raise ValueError(
                f"The performances have {len(performances[0])} frames, the model "
                f"{self.n_frames_}: synchronise them with the synchronizer that the model was "
                "fitted after."
            )
        return performances

    @of_one_state
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
        X = np.stack(self.check_performances(X))
        # What is too far away for any number has the density 0.
        with np.errstate(over="ignore"):
            squares = np.square((X - self.mean_) / self._std()).sum(axis=(1, 2))
        return self._log_density(squares)

    @of_one_state
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

    @of_one_state
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

    @of_one_state
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
        check_is_fitted(self)
        if not (isinstance(coverage, Real) and 0 < coverage < 1):
            raise ValueError(f"coverage must be a share between 0 and 1, got {coverage!r}.")
        return self._neighbours.border(self.dissimilarities_, coverage)

    @of_one_state
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

    @of_one_state
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

    def __sklearn_tags__(self):
        tags = super().__sklearn_tags__()
        tags.input_tags.three_d_array = True
        return tags

    def _std(self):
        return np.sqrt(np.maximum(self.variance_, self._floor))

    def _log_density(self, squares):
        """Log-density of performances with these sums of squared standard deviations."""
        log_std = np.log(self._std()).sum(dtype=np.float64)
        return -0.5 * squares - log_std - 0.5 * self.mean_.size * np.log(2 * np.pi)


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
