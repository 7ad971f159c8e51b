"""Scorers of synchronizers without ground truth, for ``cross_val_score`` and grid searches."""

from __future__ import annotations

import inspect
from typing import Any

import numpy as np
import pandas as pd
from sklearn.base import BaseEstimator, clone
from sklearn.utils.metadata_routing import UNUSED

from ..inputs.keyframes import Keyframes
from ..inputs.types import TrialsLike
from ..matching.warps import normalise
from ..utils.pipelines import accepted_params, route_to_synchronizer
from .spread import least_squares

# Folds that features are divided into, and the seed of their order.
_FOLDS, _SEED = 3, 0


class _SynchronizerScorer(BaseEstimator):
    """Base of the scorers: the metadata that may be requested, and what is scored.

    A scorer has a ``_score(reached, params)``, of the synchronizer and of at least two trials that
    reach it; ``_uses`` names the methods whose metadata it takes.
    """

    _uses: tuple[str, ...] = ("match",)
    # Key-frames that are given but neither requested nor declined are an error.
    __metadata_request__score = {
        "estimator": UNUSED,
        "keyframes": None,
        "frame_rate": False,
        "confidence": False,
    }

    def __call__(
        self, estimator: BaseEstimator, X: TrialsLike, y: object = None, **params: Any
    ) -> float:
        """Score a fitted estimator on trials.

        Parameters
        ----------
        estimator : synchronizer or Pipeline
            Fitted; the pipeline has a synchronizer.
        X : list of arrays, 3-D array or DataFrame
            At least two trials, as for the estimator; to hold features out, of at least two
            features.
        y : ignored
            Present for API consistency.
        **params : dict
            Metadata of the synchronizer's ``match``, and of its ``fit`` where the scorer fits it
            anew, such as ``keyframes``; in cross-validation by ``set_score_request``.

        Returns
        -------
        float
            The score; greater is better.

        Raises
        ------
        ValueError
            If there is no synchronizer, a single trial, or the synchronizer needs key-frames
            and gets none; if features are held out of a single one.
        TypeError
            If the synchronizer does not accept one of the params.
        """
        name = type(self).__name__
        reached = route_to_synchronizer(estimator, X, params, f"{name}()", uses=self._uses)
        if len(reached.trials) < 2:
            raise ValueError(
                f"{name} measures how much trials differ from each other, and got one. "
                "In cross-validation each test fold needs at least 2: instead of LeaveOneOut use "
                "fewer folds, such as cv=2 or KFold(len(X) // 2), or LeavePOut(2)."
            )
        return self._score(reached, params)

    # Of a method of this name scikit-learn makes `set_score_request`.
    score = __call__


class SpreadScorer(_SynchronizerScorer):
    """Scorer of a synchronizer, or a pipeline with one, by the spread of all features.

    The score is `least_squares`, negated, since greater scores are better.

    Notes
    -----
    It judges the fitted pattern: trials are matched with it, and nothing is fitted anew. The
    spread of matched features rewards over-warping: prefer `FeatureHoldoutScorer` to choose
    parameters. Scores need at least two trials, so ``LeaveOneOut`` cannot be used.

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

    def _score(self, reached, params):
        """The negated spread of the trials that are matched with the fitted pattern."""
        before = reached.synchronizer.normalize(reached.trials)
        return -least_squares(before, reached.match().warp(reached.trials))


class FeatureHoldoutScorer(_SynchronizerScorer):
    """Scorer of the parameters of a synchronizer, by the spread of features that it does not see.

    It is right to choose parameters, as in a grid search. It ignores the pattern that was fitted,
    and ``pattern=``: clones of the synchronizer are fitted anew, on the trials that are
    scored. In cross-validation that is the test fold. Of a fit only ``n_frames_`` and the steps
    before the synchronizer count. To judge a fitted pattern by people held out, use `SpreadScorer`,
    or `group_timing_error` where the true moments are known.

    Features are divided into three folds, always the same ones; two features into two. For each
    fold a clone is fitted without it, to a median pattern. Its warps are scored by the spread of
    the fold alone, `least_squares` negated, which over-warping does not reduce. The clones are
    given the key-frames of the trials that are scored, but for those that none of these has.

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

    _uses = "match", "fit"

    def _score(self, reached, params):
        """The mean score of the folds, each by clones that are fitted without it."""
        synchronizer, trials = reached.synchronizer, reached.trials
        n_features = trials[0].shape[1]
        if n_features < 2:
            raise ValueError(
                "FeatureHoldoutScorer holds features out, and these trials have a single one. Of a "
                "single feature, as of the rows of a 2-D array, use SpreadScorer."
            )
        if len(inspect.signature(synchronizer.match).parameters) > 1:
            # Metadata that the estimator needs are missing for its clones, too.
            reached.match()
        params = known_keyframes(trials, params)
        fit_params, match_params = (
            accepted_params(method, params) for method in (synchronizer.fit, synchronizer.match)
        )
        order = np.random.RandomState(_SEED).permutation(n_features)
        scores = []
        for held_out in np.array_split(order, min(_FOLDS, n_features)):
            shown = np.setdiff1d(order, held_out)
            refitted = clone(synchronizer).set_params(
                n_frames=synchronizer.n_frames_, pattern="median"
            )
            seen, hidden = ([x[:, features] for x in trials] for features in (shown, held_out))
            match = refitted.fit(seen, **fit_params).match(seen, **match_params)
            before = normalise(hidden, synchronizer.n_frames_)
            scores.append(-least_squares(before, match.warp(hidden)))
        return float(np.mean(scores))


def known_keyframes(trials, params):
    """Metadata without the key-frames that are known in none of these trials.

    Where labels are few, a fold may have none.
    """
    if params.get("keyframes") is None:
        return params
    keyframes = Keyframes(params["keyframes"], len(trials), params.get("frame_rate"))
    shares = keyframes.shares(trials)
    is_known = np.isfinite(shares).any(axis=0)
    if is_known.all() and not isinstance(params["keyframes"], pd.DataFrame):
        return params
    metadata = {name: params[name] for name in params if name not in ("keyframes", "frame_rate")}
    last = np.array([[len(x) - 1] for x in trials])
    return metadata | ({"keyframes": (shares * last)[:, is_known]} if is_known.any() else {})
