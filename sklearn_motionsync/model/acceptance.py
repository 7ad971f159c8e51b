"""What new people are expected to do at most, by logarithms, and the tests of a detector."""

from dataclasses import dataclass, field

import numpy as np
from scipy.special import stdtr
from scipy.stats import t as student

from ..utils.groups import mean_of_others

# Variance of the logarithm over trials of one action (16 actions of people); it weighs as
# much as that of so many trials. That of a dissimilarity is the mean over 21 actions.
_PRIOR_VARIANCE, PRIOR_COUNT = 0.07, 3
DISSIMILARITY_VARIANCE = 0.12
# Smaller dissimilarities, and energies as a share of the total variance, are rounding.
LEAST = 1e-9
# The weight of tests but the main one. With it the area under the curve is .97 and .91 of wrong
# trials (HDM05, UTKinect) and .94 of exercises done wrong (UI-PRMD); with 1 it is .96, .91
# and .92, with 0 .96, .86 and .95.
_WEIGHT = 0.15
# Prior variance of the score, which is about 1, and of a contrast.
_SCORE_VARIANCE, _CONTRAST_VARIANCE = 0.3, 0.02
# The share of the variance of differences that is added to the squared length of their mean.
_NOISE = 0.3
# A contrast counts if its mean is at least so many of its standard deviations, and the mean
# difference changes by at least such a share of the movement: 0.1 and less in hops, sitting down
# and waving, and 0.2 and more where an action has a side (HDM05, UTKinect).
_CLEAR, _LARGE = 2, 0.1


@dataclass(frozen=True)
class LogMoments:
    """Number, mean and sum of squared deviations of the logarithms of values; they add up."""

    n: int = 0
    mean: float = 0.0
    squares: float = 0.0

    @classmethod
    def of(cls, values):
        """Those of values (n,) above 0."""
        if not len(values):
            return cls()
        return cls.of_logs(np.log(values))

    @classmethod
    def of_logs(cls, logs):
        """Those of values with these logarithms (n,)."""
        mean = logs.mean()
        return cls(len(logs), float(mean), float(np.square(logs - mean).sum()))

    def __add__(self, other):
        if not self.n or not other.n:
            return self if self.n else other
        n, apart = self.n + other.n, other.mean - self.mean
        squares = self.squares + other.squares + apart**2 * self.n * other.n / n
        return LogMoments(n, self.mean + apart * other.n / n, squares)

    def upper_limit(self, coverage, prior_variance=_PRIOR_VARIANCE):
        """What a new value stays below with this probability."""
        limit = t_prediction_limit(self.n, self.squares, coverage, prior_variance)
        return float(np.exp(self.mean + limit))

    def tail(self, value, prior_variance=_PRIOR_VARIANCE):
        """The probability that a new value is above this one."""
        freedom, scale = _prediction(self.n, self.squares, prior_variance)
        apart = np.log(max(value, np.finfo(float).tiny)) - self.mean
        return float(student.sf(apart / scale, freedom))

    def scale(self, prior_variance=_PRIOR_VARIANCE):
        """The standard error of the logarithm of a new value less the mean."""
        return _prediction(self.n, self.squares, prior_variance)[1]

    def standardize(self, values, prior_variance=_PRIOR_VARIANCE):
        """Deviations of the logarithms of values from the mean, in standard deviations."""
        squares = self.squares + PRIOR_COUNT * prior_variance
        return (np.log(values) - self.mean) / np.sqrt(squares / (self.n + PRIOR_COUNT))


def log_moments(dissimilarities):
    """The `LogMoments` of dissimilarities, of which those below 1e-9 are rounding."""
    return LogMoments.of(np.maximum(dissimilarities, LEAST))


def t_prediction_limit(n, squares, coverage, prior_variance=_PRIOR_VARIANCE):
    """Upper prediction limit of a new normal value, less the mean, by Student's t distribution.

    Parameters
    ----------
    n : int
        Number of values.
    squares : float
        Sum of their squared deviations from the mean.
    coverage : float
        Probability that a new value is below the limit.
    prior_variance : float, default=0.07
        Counts like the variance of three values.

    Returns
    -------
    float
    """
    freedom, scale = _prediction(n, squares, prior_variance)
    return float(student.ppf(coverage, freedom) * scale)


def _prediction(n, squares, prior_variance):
    """Degrees of freedom, and standard error of a new value less the mean."""
    freedom = n - 1 + PRIOR_COUNT
    squares = squares + PRIOR_COUNT * prior_variance
    return freedom, np.sqrt(squares / freedom * (1 + 1 / n))


# -- the tests of a detector


def dissimilarity_tails(held_out, new=None):
    """The logarithm of the probability of dissimilarities as large, or larger.

    Parameters
    ----------
    held_out : ndarray (n,)
        Of training trials to those of other people.
    new : ndarray (n_new,), default=None
        By default those held out.
    """
    moments = log_moments(held_out)
    values = np.maximum(held_out if new is None else new, LEAST)
    deviations = moments.standardize(values, DISSIMILARITY_VARIANCE)
    return _log_tail(deviations / np.sqrt(1 + 1 / moments.n), moments.n - 1 + PRIOR_COUNT)


def _log_tail(deviations, freedom):
    """Logarithms of the probabilities of larger deviations, by Student's t distribution."""
    with np.errstate(divide="ignore"):
        return np.log(stdtr(freedom, -deviations))


@dataclass(frozen=True)
class Acceptance:
    """The score of all tests and its limit, by training trials held out.

    ``score^2 = - sum_k w_k log p_k``: Fisher's combination of the probabilities ``p_k`` of
    deviations as large, weighted, as tests differ in what they tell. The limit is the prediction
    limit of the scores of training trials, by Student's t distribution, or the mean score of the
    two people farthest from the others, if that is larger. Where patients are among the people,
    some right trials are far from all others, and the distribution alone has too near a limit: it
    accepts 72 to 77 % of the right trials of new patients, and with the two people 80 to 81 %
    (IntelliRehabDS, four draws of the people left out; of healthy ones 98 %). With the farthest one
    alone it would be 84 to 87 %, but then 69 % of exercises done wrong are found where it is 74 now
    (UI-PRMD), and trials of one person may have been judged wrongly.

    Parameters
    ----------
    held_out : dict of str to ndarray (n,)
        The logarithms of the probabilities of every test, of training trials.
    groups : ndarray of int (n,)
        Their people. Scores of one person are alike, so the error of the mean is that of people.
    coverage : float
        Share of new trials that are accepted.
    main : str, default="movement"
        The test with weight 1.

    Attributes
    ----------
    limit : float
        The largest score that is accepted, of those that are no ratio.
    """

    held_out: dict
    groups: np.ndarray
    coverage: float
    main: str = "movement"
    limit: float = field(init=False)

    def scores(self, tails):
        """Scores in units of the limit: at most 1 is accepted."""
        return self._root(tails) / self.limit

    def __post_init__(self):
        known = self._root(self.held_out)
        n, n_groups = len(known), len(np.unique(self.groups))
        squares = np.square(known - known.mean()).sum()
        reach = t_prediction_limit(n, squares, self.coverage, _SCORE_VARIANCE)
        # The error of the mean is that of so many people.
        reach *= np.sqrt((1 + 1 / n_groups) / (1 + 1 / n))
        codes = np.unique(self.groups, return_inverse=True)[1]
        farthest = np.sort(np.bincount(codes, known) / np.bincount(codes))[-2:]
        object.__setattr__(self, "limit", float(max(known.mean() + reach, farthest.mean())))

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
    prior_variance : float, default=0.07
        Of the logarithms; it weighs as much as that of three values.

    Attributes
    ----------
    lower, upper : float
    end : float
        Half of the interval, in standard deviations of the logarithms.
    deviations : ndarray (n_sequences,)
        Of training values from the mean of the other groups, on the scale of `standardize`.
    """

    def __init__(self, values, groups, coverage, prior_variance=_PRIOR_VARIANCE):
        logs, n = np.log(values), len(values)
        self._mean = float(logs.mean())
        # The uncertainty of the mean of the others is in the deviations, and in the limit.
        deviations = (logs - mean_of_others(logs, groups)) * np.sqrt((n - 1) / (n + 1))
        squares = np.square(deviations).sum()
        self._half_width = t_prediction_limit(n, squares, (1 + coverage) / 2, prior_variance)
        self._freedom, self._error = n - 1 + PRIOR_COUNT, np.sqrt(1 + 1 / n)
        self.end = student.ppf((1 + coverage) / 2, self._freedom) * self._error
        self.deviations = deviations / self._half_width
        ends = np.exp([self._mean - self._half_width, self._mean + self._half_width])
        self.lower, self.upper = map(float, ends)

    def standardize(self, values):
        """Values on the scale on which the interval is -1 to 1."""
        return (np.log(values) - self._mean) / self._half_width

    def ratio(self, deviation):
        """The ratio of a value on this scale to the geometric mean of the training values."""
        return np.exp(deviation * self._half_width)

    def tails(self, deviations):
        """The logarithm of the probability of deviations on this scale as large to either side."""
        size = np.abs(self.end * deviations)
        return _log_tail(size / self._error, self._freedom) + np.log(2)


class Contrast:
    """How much a trial is the action rather than its image under an exchange.

    An exchange is one that undoes itself, such as left for right. The differences ``d`` of training
    trials from their images have a mean ``m``. The contrast of a trial is ``<d, m> / (|m|^2 + c)``:
    about 1 for the action and -1 for its image, and 0 where the action is its own image. ``c`` is a
    share of the variance of d, so that a mean that is noise counts little.

    Parameters
    ----------
    trials : ndarray (n, P, n_features)
        Of training, without gaps.
    exchange : callable
        Makes images (n, P, n_features).
    groups : ndarray of int (n,)
        Each contrast of training is that with the mean of other groups.

    Attributes
    ----------
    middle : float
        The mean contrast of training trials.
    is_clear : bool
        Whether the action and its image differ clearly: whether it is two standard deviations, and
        ``|m|^2``, less the mean over time, a tenth of the squared movement.
    """

    def __init__(self, trials, exchange, groups):
        self._exchange = exchange
        d = self._differences(trials)
        self._mean = d.mean(axis=0)
        moved = np.square(trials - trials.mean(axis=1, keepdims=True))
        # Above 0, and no rounding.
        least = LEAST * moved.sum() / len(d) + np.finfo(float).tiny
        self._noise = _NOISE * np.square(d - self._mean).sum() / len(d) + least
        held_out = self._contrasts(d, mean_of_others(d, groups))
        self.middle = float(held_out.mean())
        squares = np.square(held_out - self.middle).sum() + PRIOR_COUNT * _CONTRAST_VARIANCE
        std = np.sqrt(squares / (len(d) - 1 + PRIOR_COUNT))
        changes = np.square(self._mean - self._mean.mean(axis=0))
        is_large = changes.sum() >= _LARGE * moved.sum() / len(d)
        self.is_clear = bool(is_large and self.middle >= _CLEAR * std)

    def standardize(self, trials):
        """Contrasts on the scale on which 0 is the action, 1 as much the image, 2 the image."""
        return 1 - self._contrasts(self._differences(trials), self._mean) / self.middle

    def _differences(self, trials):
        return trials - self._exchange(trials)

    def _contrasts(self, d, mean):
        d, mean = (x.reshape(-1, d[0].size) for x in (d, mean))
        # Row by row, so that no contrast depends on other trials.
        products, length = np.vecdot(d, mean), np.vecdot(mean, mean) + self._noise
        return products / length


def backwards(trials):
    """The image of trials (n, P, n_features) on the way back."""
    return trials[:, ::-1]
