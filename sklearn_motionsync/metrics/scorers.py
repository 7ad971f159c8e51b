"""Scorers of synchronizers that need no truth, for ``cross_val_score`` and grid searches."""

import numpy as np
from sklearn.base import clone
from sklearn.utils import check_random_state

from ..matching.warps import normalise
from ..pipelines import reach_synchronizer
from .spread import least_squares, pairwise_correlation, sobolev_least_squares

__all__ = ["FeatureHoldoutScorer", "SpreadScorer"]

_SPREADS = {
    "least_squares": (least_squares, -1),
    "sobolev": (sobolev_least_squares, -1),
    "correlation": (pairwise_correlation, 1),
}


class _SpreadMeasure:
    """Which measure a scorer takes, and its sign: greater scores are better."""

    def __init__(self, spread):
        if spread not in _SPREADS:
            raise ValueError(f"spread={spread!r} is unknown; use one of {list(_SPREADS)}.")
        self.spread = spread

    def _score(self, before, after):
        measure, sign = _SPREADS[self.spread]
        return sign * measure(before, after)


class SpreadScorer(_SpreadMeasure):
    """Scorer of a synchronizer, or of a pipeline with one: how alike it makes performances.

    Parameters
    ----------
    spread : {"least_squares", "sobolev", "correlation"}, default="least_squares"
        The measure; greater is better, so the first two are negated.

    Notes
    -----
    In-sample spread rewards over-warping: prefer `FeatureHoldoutScorer` to choose parameters.

    Examples
    --------
    >>> from sklearn.model_selection import cross_val_score
    >>> from sklearn_motionsync import DenseSynchronizer, DirectionCosines
    >>> from sklearn_motionsync.datasets import make_bending
    >>> from sklearn_motionsync.metrics import SpreadScorer
    >>> bunch = make_bending(8, random_state=0)
    >>> X = DirectionCosines(bunch.skeleton).fit_transform(bunch.data)
    >>> scores = cross_val_score(DenseSynchronizer(40), X, cv=2, scoring=SpreadScorer())
    >>> scores.shape
    (2,)
    """

    def __init__(self, spread="least_squares"):
        super().__init__(spread)

    def __call__(self, estimator, X, y=None):
        """Score a fitted estimator on performances.

        Parameters
        ----------
        estimator : a synchronizer, or a Pipeline with one
        X : performances, as the estimator takes them
        y : ignored

        Returns
        -------
        float
        """
        _, synchronizer, performances = reach_synchronizer(estimator, X)
        before = synchronizer.normalize(performances)
        after = synchronizer.match(performances).warp(performances)
        return self._score(before, after)


class FeatureHoldoutScorer(_SpreadMeasure):
    """Scorer that aligns on some features and judges by the others.

    Features are dealt into ``n_folds`` hands. For each hand a clone of the synchronizer is
    fitted without it, to a median pattern, and its warps are judged by the spread of the hand
    alone. Warping more than the time tells does not help features that had no say.

    Parameters
    ----------
    spread : {"least_squares", "sobolev", "correlation"}, default="least_squares"
        The measure; greater is better, so the first two are negated.
    n_folds : int, default=3
        At least 2, and at most the number of features.
    random_state : int, RandomState instance or None, default=0
        How features are dealt.

    Examples
    --------
    >>> from sklearn.model_selection import GridSearchCV
    >>> from sklearn_motionsync import DenseSynchronizer, DirectionCosines
    >>> from sklearn_motionsync.datasets import make_bending
    >>> from sklearn_motionsync.metrics import FeatureHoldoutScorer
    >>> bunch = make_bending(8, random_state=0)
    >>> X = DirectionCosines(bunch.skeleton).fit_transform(bunch.data)
    >>> grid = {"max_offset": [0, 0.25]}
    >>> search = GridSearchCV(DenseSynchronizer(40), grid, cv=2, scoring=FeatureHoldoutScorer())
    >>> search.fit(X).best_params_
    {'max_offset': 0.25}
    """

    def __init__(self, spread="least_squares", n_folds=3, random_state=0):
        super().__init__(spread)
        self.n_folds = n_folds
        self.random_state = random_state

    def __call__(self, estimator, X, y=None):
        """Score a fitted estimator on performances.

        Parameters
        ----------
        estimator : a synchronizer, or a Pipeline with one
        X : performances, as the estimator takes them
        y : ignored

        Returns
        -------
        float
        """
        _, synchronizer, performances = reach_synchronizer(estimator, X)
        n_features = performances[0].shape[1]
        if not 2 <= self.n_folds <= n_features:
            raise ValueError(
                f"n_folds={self.n_folds} must be between 2 and the {n_features} features there are."
            )
        dealt = check_random_state(self.random_state).permutation(n_features)
        scores = []
        for held in np.array_split(dealt, self.n_folds):
            shown = np.setdiff1d(dealt, held)
            blind = clone(synchronizer).set_params(
                n_frames=synchronizer.n_frames_, pattern="median"
            )
            seen, hidden = ([x[:, part] for x in performances] for part in (shown, held))
            match = blind.fit(seen).match(seen)
            before = normalise(hidden, synchronizer.n_frames_)
            scores.append(self._score(before, match.warp(hidden)))
        return float(np.mean(scores))
