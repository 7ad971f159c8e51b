"""MotionKernel: how alike performances are, by several costs and without warps."""

import numpy as np
from scipy.linalg import eigh
from scipy.optimize import minimize_scalar
from scipy.spatial.distance import cdist
from scipy.special import log_softmax
from sklearn.linear_model import LogisticRegression
from sklearn.model_selection import GroupKFold

from .distances import distances_of, on_clock

__all__ = ["MotionKernel", "deal", "decide", "learn", "threshold"]

# So many times the training set, what differs in it is lost beside a performance.
_FAR = 1e30
# What differs by less than this share of the size of all is rounding.
_STILL = 2.0**-44
# Frames that are averaged for the start and the end of a performance.
_ENDS = 3


class MotionKernel:
    """The mean of kernels ``exp(-gamma D / median(D))``, medians over the training pairs.

    One is of the synchronisation distances of each comparison. One is of what is seen without any
    warp: of every feature mean, standard deviation, smallest and largest value, start and end, each
    in standard deviations of the training set.

    Parameters
    ----------
    comparisons : list of PairwiseDistance
    gamma : float
    summaries : bool
        Whether the last one is there.
    """

    def __init__(self, comparisons, gamma, summaries):
        self.comparisons, self.gamma, self.summaries = comparisons, gamma, summaries

    def learn(self, performances, **work):
        """The kernel within the training set: (n, n).

        Parameters
        ----------
        performances : sequence of ndarray (n_frames_i, n_features)
        **work : dict
            ``n_jobs`` and ``progress``.
        """
        frames = [x.astype(np.float64) for x in performances]
        self._centre = np.concatenate(frames).mean(axis=0)
        spread = [np.square(x - self._centre).sum(axis=1).mean() for x in frames]
        # About 1 on average, clip by clip; what does not move at all has no unit.
        self._unit = np.sqrt(np.mean(spread)) or 1.0
        scaled = self._scaled(performances)
        self._known = self._features(scaled)
        distances = [
            distances_of(c, known, name=f" by {c.cost}", **work)
            for c, known in zip(self.comparisons, self._known, strict=True)
        ]
        if self.summaries:
            seen = np.array([summary(x) for x in scaled])
            self._mean, self._std = seen.mean(axis=0), seen.std(axis=0)
            rounding = _STILL * max(1.0, np.abs(self._centre).max() / self._unit)
            # What all have in common tells nothing, not even of those who do not have it.
            self._std = np.where(self._std > rounding, self._std, np.inf)
            self._summaries = (seen - self._mean) / self._std
            distances.append(cdist(self._summaries, self._summaries, "sqeuclidean"))
        pairs = np.triu_indices(len(scaled), 1)
        self._medians = [_typical(d[pairs]) for d in distances]
        return self._mean_kernel(distances)

    def __call__(self, performances, **work):
        """The kernel of other performances and the training set: (n_other, n)."""
        scaled = self._scaled(performances)
        features = self._features(scaled)
        distances = [
            distances_of(c, new, known, name=f" by {c.cost}", **work)
            for c, new, known in zip(self.comparisons, features, self._known, strict=True)
        ]
        if self.summaries:
            seen = np.array([summary(x) for x in scaled])
            distances.append(cdist((seen - self._mean) / self._std, self._summaries, "sqeuclidean"))
        return self._mean_kernel(distances)

    def _scaled(self, performances):
        """Performances about the mean posture, in the unit of the training set."""
        scaled = []
        for i, x in enumerate(performances):
            with np.errstate(over="ignore"):
                x = (x.astype(np.float64) - self._centre) / self._unit
            if not np.abs(x).max() < _FAR:
                raise ValueError(
                    f"Performance {i} is more than {_FAR:.0e} times as large as the training set: "
                    "give it in the same unit."
                )
            scaled.append(x)
        return scaled

    def _features(self, scaled):
        if not self.comparisons:
            return []
        clock = on_clock(scaled, self.comparisons[0].n_frames)
        return [c.features(clock) for c in self.comparisons]

    def _mean_kernel(self, distances):
        kernels = (
            np.exp(-self.gamma * d / median)
            for d, median in zip(distances, self._medians, strict=True)
        )
        return sum(kernels) / len(distances)


def summary(x):
    """What is seen of a performance (n_frames, n_features) without its course."""
    ends = x[:_ENDS].mean(axis=0), x[-_ENDS:].mean(axis=0)
    parts = [x.mean(axis=0), x.std(axis=0), x.min(axis=0), x.max(axis=0), *ends]
    return np.concatenate(parts)


def _typical(distances):
    """The median; if that is 0, the mean, and if that is, 1."""
    if not distances.size:
        return 1.0
    return float(np.median(distances)) or float(distances.mean()) or 1.0


# -- logistic regression in the space of a kernel, and what it says of performances held out

# Directions with less than this share of the largest eigenvalue are rounding.
_ROUNDING = 1e-10
_MOST_ITERATIONS, _TOLERANCE = 10_000, 1e-6
# The temperature that is expected before anything is held out, and the standard deviation of its
# logarithm, which counts as one performance: on UTKinect it is 3.3 to 4.4.
_USUAL, _SPREAD = 4.0, 1.0


class KernelRegression:
    """Multinomial logistic regression, ``f = K A + b``, with one column a class that sum to 0.

    Parameters
    ----------
    kernel : ndarray, shape (n, n)
        Of the training set, positive semidefinite but for rounding.
    C : float
        Inverse strength of the penalty ``|f|^2 / 2``, for all of them.
    """

    def __init__(self, kernel, C):
        self.C = C
        values, vectors = eigh(kernel)
        kept = values > _ROUNDING * max(values[-1], 0)
        roots = np.sqrt(values[kept])
        # K = Z Z', and f = Z w.
        self._z, self._back = vectors[:, kept] * roots, vectors[:, kept] / roots

    def fit(self, codes, rows=slice(None)):
        """Learn of the classes (n,), whole numbers from 0, of some performances.

        Returns
        -------
        A : ndarray, shape (n, n_classes)
        b : ndarray, shape (n_classes,)
            Classes that are none of theirs have minus infinity.
        """
        n_classes = codes.max() + 1
        # As strong a penalty, beside the mean loss, as if all were there.
        C = self.C * len(codes) / len(codes[rows])
        model = LogisticRegression(C=C, max_iter=_MOST_ITERATIONS, tol=_TOLERANCE)
        model.fit(self._z[rows], codes[rows])
        weights, intercepts = model.coef_, model.intercept_
        if len(weights) == 1:
            # Of two classes it learns the difference.
            weights = np.concatenate([-weights, weights]) / 2
            intercepts = np.concatenate([-intercepts, intercepts]) / 2
        A, b = np.zeros((len(codes), n_classes)), np.full(n_classes, -np.inf)
        A[:, model.classes_] = self._back @ weights.T
        b[model.classes_] = intercepts
        return A, b


def decide(kernel, A, b):
    """Decision values (m, n_classes) of a kernel (m, n), each row by itself."""
    return np.vecdot(kernel[:, np.newaxis], A.T) + b


def deal(codes, groups, n_folds):
    """The fold of every performance, such that no group is in two.

    Without groups the performances of every class are dealt out one after the other.
    """
    if groups is None:
        order = np.argsort(codes, kind="stable")
        starts = np.searchsorted(codes[order], codes[order])
        folds = np.empty(len(codes), dtype=np.intp)
        folds[order] = (np.arange(len(codes)) - starts) % n_folds
        return folds
    folds = np.empty(len(codes), dtype=np.intp)
    for fold, (_, out) in enumerate(GroupKFold(n_folds).split(codes, groups=groups)):
        folds[out] = fold
    return folds


def held_out(regression, kernel, codes, folds):
    """Decision values (n, n_classes) of every performance, learnt of the other folds.

    NaN where these have fewer than two classes, and minus infinity for classes they do not have.
    """
    found = np.full((len(codes), codes.max() + 1), np.nan)
    for fold in np.unique(folds):
        out = folds == fold
        if len(np.unique(codes[~out])) > 1:
            found[out] = decide(kernel[out], *regression.fit(codes, ~out))
    return found


def learn_temperature(decisions, codes):
    """By what decision values are to be multiplied for the best probabilities of those held out.

    Parameters
    ----------
    decisions : ndarray, shape (n, n_classes)
        Of performances held out, as `held_out` gives them.
    codes : ndarray of int, shape (n,)

    Returns
    -------
    float
    """
    right = decisions[np.arange(len(codes)), codes]
    known = np.isfinite(right)
    decisions, codes = decisions[known], codes[known]

    def loss(log_ratio):
        logs = log_softmax(_USUAL * np.exp(log_ratio) * decisions, axis=1)
        own = logs[np.arange(len(codes)), codes]
        return (log_ratio / _SPREAD) ** 2 / 2 - own.sum()

    found = minimize_scalar(loss, bounds=(-5, 5), method="bounded", options={"xatol": 1e-6})
    return float(_USUAL * np.exp(found.x))


def learn(C, folds, kernel, codes):
    """The regression (A, b), its temperature, and how sure it is of performances held out (n,)."""
    regression = KernelRegression(kernel, C)
    decisions = held_out(regression, kernel, codes, folds)
    A, b = regression.fit(codes)
    temperature = learn_temperature(decisions, codes)
    return (np.ascontiguousarray(A.T).T, b), temperature, decisions.max(axis=1)


def threshold(held_out, coverage):
    """The value that a share of new ones exceeds, by those held out; of few the smallest."""
    known = np.sort(held_out[np.isfinite(held_out)])
    if not len(known):
        raise ValueError(
            "No threshold can be learnt, as nobody could be held out: give at least two "
            "performances, and two groups, of two classes, or a number as reject_below."
        )
    rank = int((1 - coverage) * (len(known) + 1))
    return float(known[max(rank - 1, 0)])
