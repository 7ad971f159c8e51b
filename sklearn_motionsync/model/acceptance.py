"""The tests of a detector, each learnt by leaving people out, and the score of all of them."""

from dataclasses import dataclass

import numpy as np
from scipy.stats import t as student

from ..utils.groups import mean_of_others
from .similarity import (
    DISSIMILARITY_VARIANCE,
    LEAST,
    log_moments,
    t_prediction_limit,
)

__all__ = ["Acceptance", "Contrast", "LogPredictionInterval", "log_tails", "standardised_logs"]

# The weight of tests but the main one. With it the area under the curve is .97 and .91 of wrong
# performances (HDM05, UTKinect) and .94 of exercises done wrong (UI-PRMD); with 1 it is .96, .91
# and .92, with 0 .96, .86 and .95.
_WEIGHT = 0.15
# Prior variance of the score, which is about 1, and of a contrast; as that of three performances.
_SCORE_VARIANCE, _CONTRAST_VARIANCE, _PRIOR_COUNT = 0.3, 0.02, 3
# The share of the variance of differences that is added to the squared length of their mean.
_NOISE = 0.3
# A contrast counts if its mean is at least so many of its standard deviations, and the mean
# difference changes by at least such a share of the movement: 0.1 and less in hops, sitting down
# and waving, and 0.2 and more where an action has a side (HDM05, UTKinect).
_CLEAR, _LARGE = 2, 0.1


def log_tails(deviations, n, two_sided=False):
    """The logarithm of the probability of a new deviation as large, or larger.

    Deviations are from the mean of n normal values, in standard deviations estimated from these.
    """
    freedom, error = n - 1 + _PRIOR_COUNT, np.sqrt(1 + 1 / n)
    if two_sided:
        return student.logsf(np.abs(deviations) / error, freedom) + np.log(2)
    return student.logsf(deviations / error, freedom)


def standardised_logs(held_out, new=None):
    """Deviations of the logarithms of dissimilarities from those of held-out ones."""
    moments = log_moments(held_out)
    values = np.maximum(held_out if new is None else new, LEAST)
    return moments.standardize(values, DISSIMILARITY_VARIANCE)


@dataclass(frozen=True)
class Acceptance:
    """The score of all tests and its limit, by training performances held out.

    ``score^2 = - sum_k w_k log p_k``: Fisher's combination of the probabilities ``p_k`` of
    deviations as large, weighted, as tests differ in what they tell. The limit is the prediction
    limit of the scores of training performances, by Student's t distribution.

    Parameters
    ----------
    held_out : dict of str to ndarray (n,)
        The `log_tails` of every test, of training performances.
    groups : ndarray of int (n,)
        Their people. Scores of one person are alike, so the error of the mean is that of people.
    coverage : float
        Share of new performances that are accepted.
    main : str, default="movement"
        The test with weight 1.
    """

    held_out: dict
    groups: np.ndarray
    coverage: float
    main: str = "movement"

    def scores(self, tails):
        """Scores in units of the limit: at most 1 is accepted."""
        return self._root(tails) / self.limit

    @property
    def limit(self):
        """The largest score that is accepted, of those that are no ratio."""
        known = self._root(self.held_out)
        n, n_groups = len(known), len(np.unique(self.groups))
        squares = np.square(known - known.mean()).sum()
        reach = t_prediction_limit(n, squares, self.coverage, _SCORE_VARIANCE)
        # The error of the mean is that of so many people.
        reach *= np.sqrt((1 + 1 / n_groups) / (1 + 1 / n))
        return float(known.mean() + reach)

    def shares(self, tails):
        """What each test adds to the squared score: (n, n_tests)."""
        return np.column_stack([-(1 if k == self.main else _WEIGHT) * v for k, v in tails.items()])

    def _root(self, tails):
        return np.sqrt(self.shares(tails).sum(axis=1))


class LogPredictionInterval:
    """Prediction interval of positive values of new people, by their logarithms.

    Its middle is the mean logarithm; its width follows from the deviations of values from the mean
    of the other groups.

    Parameters
    ----------
    values : ndarray (n_sequences,)
        Above 0.
    groups : ndarray of int (n_sequences,)
        From 0, at least two different ones.
    coverage : float
        Share of new values in the interval.

    Attributes
    ----------
    lower, upper : float
    deviations : ndarray (n_sequences,)
        Of training values from the mean of the other groups, on the scale of `standardize`.
    """

    def __init__(self, values, groups, coverage):
        logs, n = np.log(values), len(values)
        self._mean = float(logs.mean())
        # The uncertainty of the mean of the others is in the deviations, and in the limit.
        deviations = (logs - mean_of_others(logs, groups)) * np.sqrt((n - 1) / (n + 1))
        squares = np.square(deviations).sum()
        self._half_width = t_prediction_limit(n, squares, (1 + coverage) / 2)
        self.deviations = deviations / self._half_width
        ends = np.exp([self._mean - self._half_width, self._mean + self._half_width])
        self.lower, self.upper = map(float, ends)

    def standardize(self, values):
        """Values on the scale on which the interval is -1 to 1."""
        return (np.log(values) - self._mean) / self._half_width


class Contrast:
    """How much a performance is the action rather than its image under an exchange.

    An exchange is one that undoes itself, such as left for right. The differences ``d`` of training
    performances from their images have a mean ``m``. The contrast of a performance is
    ``<d, m> / (|m|^2 + c)``: about 1 for the action and -1 for its image, and 0 where the action
    is its own image. ``c`` is a share of the variance of d, so that a mean that is noise counts
    little.

    Parameters
    ----------
    performances : ndarray (n, P, n_features)
        Of training, without gaps.
    exchange : callable
        Makes images (n, P, n_features).
    groups : ndarray of int (n,)
        Each contrast of training is that with the mean of other groups.

    Attributes
    ----------
    middle : float
        The mean contrast of training performances.
    is_clear : bool
        Whether the action and its image differ clearly: whether it is two standard deviations, and
        ``|m|^2``, less the mean over time, a tenth of the squared movement.
    """

    def __init__(self, performances, exchange, groups):
        self._exchange = exchange
        d = self._differences(performances)
        self._mean = d.mean(axis=0)
        moved = np.square(performances - performances.mean(axis=1, keepdims=True))
        # Above 0, and no rounding.
        least = LEAST * moved.sum() / len(d) + np.finfo(float).tiny
        self._noise = _NOISE * np.square(d - self._mean).sum() / len(d) + least
        held_out = self._contrasts(d, mean_of_others(d, groups))
        self.middle = float(held_out.mean())
        squares = np.square(held_out - self.middle).sum() + _PRIOR_COUNT * _CONTRAST_VARIANCE
        std = np.sqrt(squares / (len(d) - 1 + _PRIOR_COUNT))
        changes = np.square(self._mean - self._mean.mean(axis=0))
        is_large = changes.sum() >= _LARGE * moved.sum() / len(d)
        self.is_clear = bool(is_large and self.middle >= _CLEAR * std)

    def standardize(self, performances):
        """Contrasts on the scale on which 0 is the action, 1 as much the image, 2 the image."""
        return 1 - self._contrasts(self._differences(performances), self._mean) / self.middle

    def _differences(self, performances):
        return performances - self._exchange(performances)

    def _contrasts(self, d, mean):
        d, mean = (x.reshape(-1, d[0].size) for x in (d, mean))
        # Row by row, so that no contrast depends on other performances.
        products, length = np.vecdot(d, mean), np.vecdot(mean, mean) + self._noise
        return products / length
