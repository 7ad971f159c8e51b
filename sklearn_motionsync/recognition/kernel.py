"""MotionKernel: how alike trials are, and the multinomial regression with it."""

import numpy as np
import pandas as pd
from scipy.linalg import eigh
from scipy.optimize import minimize_scalar
from scipy.spatial.distance import cdist
from scipy.special import log_softmax
from sklearn.linear_model import LogisticRegression
from sklearn.model_selection import GroupKFold

from ..matching.counting import first_largest
from .distances import PairwiseDistance, normalise_time, pairwise_distances

# The costs of the distances: two of velocities, which make the view of shape, and one of poses.
_COSTS = "velocity", "elastic", "pose"
# Largest offset of the distances, as a share of the clock.
_MAX_OFFSET = 0.4
# Standard deviations below this share of the size of the data are rounding.
_ROUNDING = 2.0**-44
# Frames that are averaged for the start and the end of a trial.
_N_END_FRAMES = 3
# Changes are those over these shares of the clock before and after a frame.
_REACHES = 0.04, 0.16
# Levels whose excess is counted, in mean absolute changes, and how soft the count is.
_LEVELS, _SOFTNESS = np.array([-2, -1, -0.3, 0, 0.3, 1, 2]), 0.5
# The weight of a view is this power of its alignment with the classes.
_POWER = 6


class MotionKernel:
    """A weighted mean of kernels ``exp(-D / median(D))``, medians over the training pairs.

    There are four views of trials. Distances by costs of velocities make the first, and by the cost
    of poses the second. The third is of `summary_statistics`, the last of extremes of changes and
    `change_shares`: squared Euclidean distances, in standard deviations of the training set. A
    view is the mean of its kernels.

    Trials are compared with landmarks of the training set. If these are not all of it, the
    views are not added up, but stand side by side: each then has a regression of its own, which
    comes nearer to that of all pairs.

    Parameters
    ----------
    n_frames : int
        Of the clock.

    Attributes
    ----------
    weights : ndarray, shape (4,)
        By `align_weights`.
    """

    def __init__(self, n_frames):
        self.n_frames = n_frames
        # Poses keep the unit of the training set. A kernel needs no more than single precision:
        # six digits of a distance.
        self._comparisons = [
            PairwiseDistance(
                cost,
                n_frames=n_frames,
                normalize=cost != "pose",
                max_offset=_MAX_OFFSET,
                dtype=np.float32,
            )
            for cost in _COSTS
        ]

    def fit(self, trials, landmarks, codes, groups=None, **jobs):
        """Estimate units, medians and weights from the training set, and return its kernel.

        Landmarks are indices of trials, and classes and groups (n,) are counted from 0. ``jobs``
        are ``n_jobs`` and ``progress``. The kernel is (n, n), or (n, 4 * n_landmarks).
        """
        frames = [x.astype(np.float64, copy=False) for x in trials]
        self._center = np.concatenate(frames).mean(axis=0)
        variances = [np.square(x - self._center).sum(axis=1).mean() for x in frames]
        self._unit = np.sqrt(np.mean(variances)) or 1.0
        scaled = self._scale(trials)
        on_clock = normalise_time(scaled, self.n_frames)
        features = [c.features(on_clock) for c in self._comparisons]
        self._features = [f[landmarks] for f in features]
        # Landmarks among themselves, so that no pair is compared twice, and the others with them.
        is_other = np.ones(len(scaled), dtype=bool)
        is_other[landmarks] = False
        summaries_from = len(features)
        distances = np.empty((summaries_from + 3, len(scaled), len(landmarks)))
        for i, (c, f) in enumerate(zip(self._comparisons, features, strict=True)):
            d, known, name = distances[i], self._features[i], f" by {c.cost}"
            d[landmarks] = pairwise_distances(c, known, name=name, **jobs)
            if is_other.any():
                d[is_other] = pairwise_distances(c, f[is_other], known, name=name, **jobs)
        rounding = _ROUNDING * max(1.0, np.abs(self._center).max() / self._unit)
        # Mean absolute changes (n_reaches, n_features), infinite if rounding.
        sizes = np.mean([np.abs(changes_of(x)).mean(axis=1) for x in on_clock], axis=0)
        self._change_units = np.where(sizes > rounding, sizes, np.inf)
        self._scalings, self._summaries = [], []
        for d, statistics in zip(
            distances[summaries_from:], self._summarised(scaled, on_clock), strict=True
        ):
            mean, std = statistics.mean(axis=0), statistics.std(axis=0)
            # Statistics that are constant in the training set have no weight.
            self._scalings.append((mean, np.where(std > rounding, std, np.inf)))
            statistics = (statistics - mean) / self._scalings[-1][1]
            self._summaries.append(statistics[landmarks])
            d[:] = cdist(statistics, self._summaries[-1], "sqeuclidean")
        is_pair = np.ones(distances[0].shape, dtype=bool)
        is_pair[landmarks, np.arange(len(landmarks))] = False
        # Where the median is 0 it is the mean, and where that is, or there is no pair, 1.
        pairs = [d[is_pair] for d in distances]
        self._medians = [
            (float(np.median(d)) or float(d.mean()) or 1.0) if d.size else 1.0 for d in pairs
        ]
        self._side_by_side = bool(is_other.any())
        views = self._as_views(distances)
        groups = np.arange(len(scaled)) if groups is None else groups
        self.weights = align_weights(views, codes, groups, landmarks)
        return self._combined(views)

    def __call__(self, trials, **jobs):
        """The kernel of other trials and the landmarks."""
        scaled = self._scale(trials)
        on_clock = normalise_time(scaled, self.n_frames)
        distances = [
            pairwise_distances(c, c.features(on_clock), known, name=f" by {c.cost}", **jobs)
            for c, known in zip(self._comparisons, self._features, strict=True)
        ]
        distances += [
            cdist((statistics - mean) / std, known, "sqeuclidean")
            for statistics, (mean, std), known in zip(
                self._summarised(scaled, on_clock),
                self._scalings,
                self._summaries,
                strict=True,
            )
        ]
        return self._combined(self._as_views(distances))

    def _scale(self, trials):
        """Trials about the mean pose, in the unit of the training set."""
        return [(x.astype(np.float64) - self._center) / self._unit for x in trials]

    def _summarised(self, scaled, on_clock):
        """Statistics (n, n_statistics) of values, extremes of changes, and shares of the clock."""
        # One trial at a time: no result depends on the others.
        changes = [changes_of(x) for x in on_clock]
        units = self._change_units
        return [
            np.array([summary_statistics(x) for x in scaled]),
            np.array([np.concatenate([c.min(axis=1), c.max(axis=1)], axis=None) for c in changes]),
            np.array([change_shares(c, units) for c in changes]),
        ]

    def _as_views(self, distances):
        """The mean kernel of each view: (4, n, n_landmarks)."""
        velocity, elastic, pose, summaries, extremes, shares = (
            np.exp(-d / median) for d, median in zip(distances, self._medians, strict=True)
        )
        return np.stack([(velocity + elastic) / 2, pose, summaries, (extremes + shares) / 2])

    def _combined(self, views):
        weighted = [weight * view for weight, view in zip(self.weights, views, strict=True)]
        return np.hstack(weighted) if self._side_by_side else sum(weighted)


def align_weights(views, codes, groups, landmarks):
    """Weights (n_views,) of kernels, the larger the better these tell classes across groups.

    They are powers of the alignment of a kernel (n, n_landmarks) with the classes: of the
    correlation, over pairs of different groups, of the kernel and of whether a pair is of one
    class, both centred by row and by column. They sum to 1. Kernels that are not aligned have no
    weight; if none is, all have the same.
    """
    is_pair = groups[:, np.newaxis] != groups[landmarks]
    same = _centred(codes[:, np.newaxis] == codes[landmarks])[is_pair]
    alignments = np.zeros(len(views))
    for i, view in enumerate(views):
        centred = _centred(view)[is_pair]
        size = np.sqrt(np.square(centred).sum() * np.square(same).sum())
        alignments[i] = max((centred * same).sum() / size, 0) if size else 0
    if not alignments.any():
        return np.full(len(views), 1 / len(views))
    weights = (alignments / alignments.max()) ** _POWER
    return weights / weights.sum()


def _centred(matrix):
    """A matrix less means of rows and of columns."""
    matrix = matrix - np.mean(matrix, axis=0)
    return matrix - matrix.mean(axis=1, keepdims=True)


def summary_statistics(x):
    """Mean, standard deviation, extremes and ends of a trial (n_frames, n_features)."""
    ends = x[:_N_END_FRAMES].mean(axis=0), x[-_N_END_FRAMES:].mean(axis=0)
    parts = [x.mean(axis=0), x.std(axis=0), x.min(axis=0), x.max(axis=0), *ends]
    return np.concatenate(parts)


def changes_of(x):
    """Changes of a trial (P, n_features) on the clock: (n_reaches, P, n_features).

    That at a frame is the value some frames later less that as many earlier. Before its start and
    after its end a trial stands still.
    """
    frames = np.arange(len(x))
    reaches = [max(round(share * len(x)), 1) for share in _REACHES]
    return np.stack(
        [x[np.minimum(frames + r, frames[-1])] - x[np.maximum(frames - r, 0)] for r in reaches]
    )


def change_shares(changes, units):
    """For how much of the clock changes exceed levels, of every feature, reach and level.

    The changes (n_reaches, P, n_features) are compared in units (n_reaches, n_features). A frame
    counts ``tanh`` of its excess, from -1 to 1, so that no count jumps with rounding.
    """
    levels = _LEVELS[:, np.newaxis, np.newaxis, np.newaxis]
    excess = (changes / units[:, np.newaxis] - levels) / _SOFTNESS
    return np.tanh(excess).mean(axis=2).ravel()


# -- multinomial logistic regression with a kernel -------------------------------------------------

# Folds of the cross-validation in a fit.
_N_FOLDS = 5
# Eigenvalues below these shares of the largest are left out: of all trials what is rounding,
# of landmarks what says little of other trials.
_ALL_ROUNDING, _LEAST = 1e-10, 1e-5
_MOST_ITERATIONS, _TOLERANCE = 10_000, 1e-6
# Prior temperature, and the standard deviation of its logarithm, which counts as one trial:
# on UTKinect it is 3.3 to 4.4.
_PRIOR_TEMPERATURE, _PRIOR_STD = 4.0, 1.0


class KernelRegression:
    """Multinomial logistic regression, ``f = K A + b``, with one column a class that sum to 0.

    Parameters
    ----------
    kernel : ndarray, shape (n, n_kernels * n_landmarks)
        Kernels of the training set and its landmarks, side by side; each is positive semidefinite
        but for rounding.
    C : float
        Inverse strength of the penalty ``|f|^2 / 2``, for all of them.
    landmarks : ndarray of int, shape (n_landmarks,), default=None
        None: all of the training set.
    """

    def __init__(self, kernel, C, landmarks=None):
        self.C = C
        self.landmarks = np.arange(len(kernel)) if landmarks is None else landmarks
        # (n_kernels, n, n_landmarks)
        self._kernels = kernel.reshape(len(kernel), -1, len(self.landmarks)).swapaxes(0, 1)

    def fit(self, codes, chosen=None):
        """Fit to the classes (n,), integers from 0, of some trials.

        They have the mask ``chosen``, by default all; the others are no landmarks, either. Returns
        ``A`` (n_kernels * n_landmarks, n_classes), and ``b`` (n_classes,), which is minus infinity
        for classes that none of them has.
        """
        n_classes = codes.max() + 1
        chosen = np.ones(len(codes), dtype=bool) if chosen is None else chosen
        columns = np.flatnonzero(chosen[self.landmarks])
        # The features of each kernel: K = Z Z' of landmarks, f = Z w, and Z = K back of all.
        least = _ALL_ROUNDING if len(self.landmarks) == len(codes) else _LEAST
        backs = []
        for k in self._kernels:
            values, vectors = eigh(k[np.ix_(self.landmarks[columns], columns)])
            is_large = values > least * max(values[-1], 0)
            backs.append(vectors[:, is_large] / np.sqrt(values[is_large]))
        known = self._kernels[:, chosen][:, :, columns]
        z = np.hstack([k @ back for k, back in zip(known, backs, strict=True)])
        # The same penalty, relative to the mean loss, as for all.
        C = self.C * len(codes) / len(z)
        model = LogisticRegression(C=C, max_iter=_MOST_ITERATIONS, tol=_TOLERANCE)
        model.fit(z, codes[chosen])
        weights, intercepts = model.coef_, model.intercept_
        if len(weights) == 1:
            # Of two classes scikit-learn fits the difference.
            weights = np.concatenate([-weights, weights]) / 2
            intercepts = np.concatenate([-intercepts, intercepts]) / 2
        A = np.zeros((len(backs), len(self.landmarks), n_classes))
        edges = np.cumsum([back.shape[1] for back in backs])[:-1]
        for a, back, w in zip(A, backs, np.split(weights.T, edges), strict=True):
            a[np.ix_(columns, model.classes_)] = back @ w
        b = np.full(n_classes, -np.inf)
        b[model.classes_] = intercepts
        return A.reshape(-1, n_classes), b


def decision_values(kernel, A, b):
    """Decision values (m, n_classes) of a kernel (m, n), each row by itself."""
    return np.vecdot(kernel[:, np.newaxis], A.T) + b


def assign_folds(codes, groups, n_folds=_N_FOLDS):
    """The fold of each trial, with no group in two folds.

    Without groups the trials of each class are divided evenly, in order.
    """
    if groups is None:
        return pd.Series(codes).groupby(codes).cumcount().to_numpy() % n_folds
    folds = np.empty(len(codes), dtype=np.intp)
    splits = GroupKFold(min(n_folds, groups.max() + 1)).split(codes, groups=groups)
    for fold, (_, out) in enumerate(splits):
        folds[out] = fold
    return folds


def held_out_decisions(regression, kernel, codes, folds):
    """Decision values (n, n_classes) of each trial, fitted on the other folds.

    NaN where these have fewer than two classes, or no landmark, and minus infinity for classes they
    do not have.
    """
    decisions = np.full((len(codes), codes.max() + 1), np.nan)
    for fold in np.unique(folds):
        out = folds == fold
        if len(np.unique(codes[~out])) > 1 and (~out)[regression.landmarks].any():
            decisions[out] = decision_values(kernel[out], *regression.fit(codes, ~out))
    return decisions


def fit_temperature(decisions, codes):
    """The factor of decision values with the largest posterior density (temperature scaling).

    The decisions (n, n_classes) are those of held-out trials, of `held_out_decisions`.
    """
    known = np.isfinite(decisions[np.arange(len(codes)), codes])
    decisions, codes = decisions[known], codes[known]

    def loss(log_ratio):
        logs = log_softmax(_PRIOR_TEMPERATURE * np.exp(log_ratio) * decisions, axis=1)
        of_class = logs[np.arange(len(codes)), codes]
        return (log_ratio / _PRIOR_STD) ** 2 / 2 - of_class.sum()

    best = minimize_scalar(loss, bounds=(-5, 5), method="bounded", options={"xatol": 1e-6})
    return float(_PRIOR_TEMPERATURE * np.exp(best.x))


def fold_gain(regression, kernel, codes, folds, decisions):
    """What the largest decision value of a trial gains from one more fold, in the median.

    Held-out values, the decisions of `held_out_decisions`, come from all folds but one, those of
    new trials from all ``G`` of them. Fits without two neighbouring folds tell what the last but
    one brings. The error of a fit falls with the inverse of what it learns from, so the last fold
    brings ``(G - 2) / G`` of that. It is 0 with two folds, or if no fit without two of them knows
    two classes.
    """
    numbers = np.unique(folds)
    right = first_largest(decisions, axis=1) == codes
    losses = []
    for pair in zip(numbers, np.roll(numbers, -1), strict=True) if len(numbers) > 2 else ():
        out = np.isin(folds, pair)
        told = out & right & np.isfinite(decisions).any(axis=1)
        if len(np.unique(codes[~out])) > 1 and (~out)[regression.landmarks].any():
            less = decision_values(kernel[told], *regression.fit(codes, ~out))
            losses.extend(decisions[told].max(axis=1) - less.max(axis=1))
    return float(np.median(losses)) * (1 - 2 / len(numbers)) if losses else 0.0


def fit_regression(C, folds, landmarks, kernel, codes):
    """Fit the regression, and others without one fold and without two.

    Returns the regression ``(A, b)``, its temperature, the largest held-out decision values (n,),
    and what they gain from the last fold.
    """
    regression = KernelRegression(kernel, C, landmarks)
    decisions = held_out_decisions(regression, kernel, codes, folds)
    gain = fold_gain(regression, kernel, codes, folds, decisions)
    A, b = regression.fit(codes)
    temperature = fit_temperature(decisions, codes)
    return (np.ascontiguousarray(A.T).T, b), temperature, decisions.max(axis=1), gain
