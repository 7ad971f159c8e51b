"""A person's own good performances as what others of that person are compared with."""

import numpy as np

from ..matching.gaps import fill_with_mean
from ..utils.groups import mean_of_others, sums_of_groups
from .similarity import Neighbours, learn_weights, log_moments
from .variation import within_variance

__all__ = ["PersonalReference"]


class PersonalReference:
    """Neighbours made of a person's own performances, and how alike people repeat themselves.

    Few performances tell a person's mean with an error, the variance within people over their
    number m. Therefore the mean of the own performances is moved towards that of all people,
    feature by feature: its deviation from that has the factor ``b / (b + w / m)``, with the
    variances ``b`` between and ``w`` within people (the posterior mean of normal distributions).

    Parameters
    ----------
    kept : ndarray (n_kept, P, n_features), float64
        Training performances; NaN in gaps.
    groups : ndarray of int (n_kept,)
        The person of each.
    mean : ndarray (P, n_features)
        Of all training performances.
    own : ndarray (m, P, n_features)
        Of the person; NaN in gaps.

    Attributes
    ----------
    moments : LogMoments
        Of the dissimilarities of training performances to m others of the same person.
    held_out : ndarray (n_kept,)
        These dissimilarities; NaN for people with one performance.
    """

    def __init__(self, kept, groups, mean, own):
        codes = np.unique(groups, return_inverse=True)[1].ravel()
        counts = np.bincount(codes)
        if counts.max() < 2:
            raise ValueError(
                "reference needs to know how people repeat themselves, but no group of the "
                "training set has two performances: give groups to fit, and several performances "
                "of some people."
            )
        filled = fill_with_mean(kept, mean)
        self._mean, self._weights = mean, learn_weights(filled, codes, own=True)
        self._within = within_variance(kept, codes).mean(axis=0)
        sums, sizes = sums_of_groups(filled, codes)
        of_means = (sums / sizes).var(axis=0, ddof=1).mean(axis=0)
        self._between = np.maximum(of_means - self._within * (1 / counts).mean(), 0)
        self._neighbours = self._near(own, mean)
        of_others = mean_of_others(filled, codes)
        self.held_out = np.full(len(kept), np.nan)
        for i, code in enumerate(codes):
            same = np.flatnonzero(codes == code)
            # The next ones, the first after the last.
            others = np.roll(same, -1 - np.searchsorted(same, i))[: min(len(own), len(same) - 1)]
            if len(others):
                near = self._near(kept[others], of_others[i])
                self.held_out[i] = near.dissimilarity(kept[[i]])[0]
        self.moments = log_moments(self.held_out[np.isfinite(self.held_out)])

    def dissimilarity(self, performances):
        """Dissimilarity of performances to the most similar own one, (n,)."""
        return self._neighbours.dissimilarity(performances)

    def limit(self, coverage):
        """Largest dissimilarity that a share of the person's performances is expected to have."""
        return self._neighbours.limit(self.moments, coverage)

    def _near(self, own, mean):
        """Neighbours of performances of one person, moved towards the mean of other people."""
        own = fill_with_mean(own, self._mean)
        ratio = self._between / (self._between + self._within / len(own))
        moved = own + (ratio - 1) * (own.mean(axis=0) - mean)
        one = np.zeros(len(own), dtype=np.intp)
        return Neighbours(moved, one, mean=self._mean, weights=self._weights)
