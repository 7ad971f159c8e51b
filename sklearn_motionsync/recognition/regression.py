"""Multinomial logistic regression with a kernel, its folds and its probabilities."""

from typing import NamedTuple

import numpy as np
from scipy.linalg import eigh
from scipy.optimize import minimize_scalar
from scipy.special import log_softmax
from sklearn.linear_model import LogisticRegression
from sklearn.model_selection import GroupKFold

from ..matching.counting import first_largest

__all__ = [
    "Fitted",
    "KernelRegression",
    "assign_folds",
    "decision_values",
    "fit_regression",
    "fit_temperature",
    "fold_gain",
    "held_out_decisions",
]

# Folds of the cross-validation in a fit.
_N_FOLDS = 5
# Eigenvalues below these shares of the largest are left out: of all performances what is rounding,
# of landmarks what says little of other performances.
_ROUNDING, _LEAST = 1e-10, 1e-5
_MOST_ITERATIONS, _TOLERANCE = 10_000, 1e-6
# Prior temperature, and the standard deviation of its logarithm, which counts as one performance:
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
        """Fit to the classes (n,), integers from 0, of some performances.

        Parameters
        ----------
        codes : ndarray of int, shape (n,)
        chosen : ndarray of bool, shape (n,), default=None
            Which performances; the others are no landmarks, either. None: all.

        Returns
        -------
        A : ndarray, shape (n_kernels * n_landmarks, n_classes)
        b : ndarray, shape (n_classes,)
            Minus infinity for classes that none of them has.
        """
        n_classes = codes.max() + 1
        chosen = np.ones(len(codes), dtype=bool) if chosen is None else chosen
        columns = np.flatnonzero(chosen[self.landmarks])
        # The features of each kernel: K = Z Z' of landmarks, f = Z w, and Z = K back of all.
        least = _ROUNDING if len(self.landmarks) == len(codes) else _LEAST
        rows = self.landmarks[columns]
        backs = [_inverse_root(k[np.ix_(rows, columns)], least) for k in self._kernels]
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


def _inverse_root(kernel, least):
    """The inverse square root (n, n_kept) of a kernel (n, n), without its smallest eigenvalues."""
    values, vectors = eigh(kernel)
    kept = values > least * max(values[-1], 0)
    return vectors[:, kept] / np.sqrt(values[kept])


def decision_values(kernel, A, b):
    """Decision values (m, n_classes) of a kernel (m, n), each row by itself."""
    return np.vecdot(kernel[:, np.newaxis], A.T) + b


def assign_folds(codes, groups, n_folds=_N_FOLDS):
    """The fold of each performance, with no group in two folds.

    Without groups the performances of each class are divided evenly, in order.
    """
    folds = np.empty(len(codes), dtype=np.intp)
    if groups is None:
        order = np.argsort(codes, kind="stable")
        starts = np.searchsorted(codes[order], codes[order])
        folds[order] = (np.arange(len(codes)) - starts) % n_folds
        return folds
    splits = GroupKFold(min(n_folds, groups.max() + 1)).split(codes, groups=groups)
    for fold, (_, out) in enumerate(splits):
        folds[out] = fold
    return folds


def held_out_decisions(regression, kernel, codes, folds):
    """Decision values (n, n_classes) of each performance, fitted on the other folds.

    NaN where these have fewer than two classes, or no landmark, and minus infinity for classes they
    do not have.
    """
    found = np.full((len(codes), codes.max() + 1), np.nan)
    for fold in np.unique(folds):
        out = folds == fold
        if len(np.unique(codes[~out])) > 1 and (~out)[regression.landmarks].any():
            found[out] = decision_values(kernel[out], *regression.fit(codes, ~out))
    return found


def fit_temperature(decisions, codes):
    """The factor of decision values with the largest posterior density (temperature scaling).

    Parameters
    ----------
    decisions : ndarray, shape (n, n_classes)
        Of held-out performances, as `held_out_decisions` returns them.
    codes : ndarray of int, shape (n,)

    Returns
    -------
    float
    """
    known = np.isfinite(decisions[np.arange(len(codes)), codes])
    decisions, codes = decisions[known], codes[known]

    def loss(log_ratio):
        logs = log_softmax(_PRIOR_TEMPERATURE * np.exp(log_ratio) * decisions, axis=1)
        own = logs[np.arange(len(codes)), codes]
        return (log_ratio / _PRIOR_STD) ** 2 / 2 - own.sum()

    found = minimize_scalar(loss, bounds=(-5, 5), method="bounded", options={"xatol": 1e-6})
    return float(_PRIOR_TEMPERATURE * np.exp(found.x))


def fold_gain(regression, kernel, codes, folds, decisions):
    """What the largest decision value of a performance gains from one more fold, in the median.

    Held-out values come from all folds but one, those of new performances from all ``G`` of them.
    Fits without two neighbouring folds tell what the last but one brings. The error of a fit falls
    with the inverse of what it learns from, so the last fold brings ``(G - 2) / G`` of that.

    Parameters
    ----------
    regression : KernelRegression
    kernel : ndarray, shape (n, n_kernels * n_landmarks)
    codes, folds : ndarray of int, shape (n,)
    decisions : ndarray, shape (n, n_classes)
        As `held_out_decisions` returns them.

    Returns
    -------
    float
        0 with two folds, or if no fit without two of them knows two classes.
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


class Fitted(NamedTuple):
    """A regression ``(A, b)``, its temperature, the largest held-out decision values (n,), and
    what they gain from the last fold.
    """

    regression: tuple
    temperature: float
    held_out: np.ndarray
    gain: float


def fit_regression(C, folds, landmarks, kernel, codes):
    """Fit the regression, and others without one fold and without two."""
    regression = KernelRegression(kernel, C, landmarks)
    decisions = held_out_decisions(regression, kernel, codes, folds)
    gain = fold_gain(regression, kernel, codes, folds, decisions)
    A, b = regression.fit(codes)
    regression = np.ascontiguousarray(A.T).T, b
    return Fitted(regression, fit_temperature(decisions, codes), decisions.max(axis=1), gain)
