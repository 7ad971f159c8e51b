"""What a model of an action says of whole performances: how dense they are, and if they are it."""

from numbers import Real

import numpy as np
from sklearn.utils import check_consistent_length

from ..fitting import of_one_state
from .likeness import portions

__all__ = ["JudgingMixin"]


class JudgingMixin:
    """What a model of an action says of performances: their density, and whether they are it."""

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
        performances, std = self.check_performances(X), self._std()
        # What is too far away for any number has the density 0.
        with np.errstate(over="ignore"):
            squares = [
                np.square((some - self.mean_) / std).sum(axis=(1, 2))
                for _, some in portions(performances)
            ]
        return self._log_density(np.concatenate(squares))

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
        self._check_learnt()
        if not (isinstance(coverage, Real) and 0 < coverage < 1):
            raise ValueError(f"coverage must be a share between 0 and 1, got {coverage!r}.")
        return self._neighbours.border(self._unlike, coverage)

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

    def _std(self):
        return np.sqrt(np.maximum(self.variance_, self._floor))

    def _log_density(self, squares):
        """Log-density of performances with these sums of squared standard deviations."""
        log_std = np.log(self._std()).sum(dtype=np.float64)
        return -0.5 * squares - log_std - 0.5 * self.mean_.size * np.log(2 * np.pi)
