"""Scorers of synchronizers that need no truth, for ``cross_val_score`` and grid searches."""

from copy import deepcopy
from numbers import Integral

import numpy as np
from sklearn import get_config
from sklearn.base import BaseEstimator, clone
from sklearn.utils import check_random_state
from sklearn.utils.metadata_routing import MetadataRequest

from ..matching.warps import normalise
from ..utils.pipelines import accepted_params, route_to_synchronizer
from .spread import least_squares, pairwise_correlation, sobolev_least_squares

__all__ = ["FeatureHoldoutScorer", "SpreadScorer"]

_SPREADS = {
    "least_squares": (least_squares, -1),
    "sobolev": (sobolev_least_squares, -1),
    "correlation": (pairwise_correlation, 1),
}


class _SynchronizerScorer(BaseEstimator):
    """What scorers share: a measure of spread, and the metadata that they ask for."""

    def get_metadata_routing(self):
        """What the scorer asks cross-validation and searches for, besides performances.

        Returns
        -------
        MetadataRequest
        """
        request = MetadataRequest(owner=type(self).__name__)
        for name, alias in self._asked_for().items():
            request.score.add_request(param=name, alias=alias)
        return request

    def set_score_request(self, **requests):
        """Ask for metadata, such as key-frames, in cross-validation and searches.

        It takes scikit-learn's metadata routing,
        ``sklearn.set_config(enable_metadata_routing=True)``.

        Parameters
        ----------
        **requests : dict of bool, None or str
            By the name of the metadata: True asks for it, False does without, None makes it an
            error to give it, and a string is the name under which it is given.

        Returns
        -------
        self

        Examples
        --------
        >>> from sklearn import config_context
        >>> from sklearn.model_selection import cross_val_score
        >>> from sklearn_motionsync import KeyframeSynchronizer
        >>> from sklearn_motionsync.datasets import make_bending
        >>> from sklearn_motionsync.metrics import SpreadScorer
        >>> bunch = make_bending(8, random_state=0)
        >>> with config_context(enable_metadata_routing=True):
        ...     scores = cross_val_score(
        ...         KeyframeSynchronizer(40).set_fit_request(keyframes=True),
        ...         bunch.data,
        ...         cv=2,
        ...         scoring=SpreadScorer().set_score_request(keyframes=True),
        ...         params={"keyframes": bunch.keyframes},
        ...     )
        >>> scores.shape
        (2,)
        """
        if not get_config()["enable_metadata_routing"]:
            raise RuntimeError(
                "Metadata is only routed to scorers when scikit-learn's metadata routing is "
                "enabled: sklearn.set_config(enable_metadata_routing=True)."
            )
        asked = {**self._asked_for(), **requests}
        for name, alias in requests.items():
            # Refuses what is no request.
            MetadataRequest(owner=type(self).__name__).score.add_request(param=name, alias=alias)
        self._requests = asked
        return self

    def __sklearn_clone__(self):
        return deepcopy(self)

    def _asked_for(self):
        # Key-frames that are given without being asked for, or declined, are an error.
        return getattr(self, "_requests", {"keyframes": None})

    def _measure(self):
        """The measure, and its sign: greater scores are better."""
        if not isinstance(self.spread, str) or self.spread not in _SPREADS:
            raise ValueError(f"spread={self.spread!r} is unknown; use one of {list(_SPREADS)}.")
        return _SPREADS[self.spread]

    def _score(self, before, after):
        measure, sign = self._measure()
        return sign * measure(before, after)

    def _reach(self, estimator, X, params, uses=("match",)):
        """The synchronizer and the performances, of which there must be two to differ."""
        self._measure()
        name = type(self).__name__
        hint = (
            f"; in cross_val_score and searches by metadata routing, sklearn.set_config("
            f"enable_metadata_routing=True), scoring={name}().set_score_request({{name}}=True), "
            "and params={{'{name}': [...]}} or search.fit(X, {name}=[...])"
        )
        reached = route_to_synchronizer(estimator, X, params, f"{name}()", uses=uses, hint=hint)
        if len(reached.performances) < 2:
            raise ValueError(
                f"{name} tells how much performances differ from each other, and got one alone. "
                "In cross-validation each test fold needs at least 2: instead of LeaveOneOut use "
                "fewer folds, such as cv=2 or KFold(len(X) // 2), or LeavePOut(2)."
            )
        return reached


class SpreadScorer(_SynchronizerScorer):
    """Scorer of a synchronizer, or of a pipeline with one: how alike it makes performances.

    Parameters
    ----------
    spread : {"least_squares", "sobolev", "correlation"}, default="least_squares"
        The measure; greater is better, so the first two are negated.

    Notes
    -----
    In-sample spread rewards over-warping: prefer `FeatureHoldoutScorer` to choose parameters.

    What is scored are at least two performances: ``LeaveOneOut`` leaves nothing to compare.

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
        self.spread = spread
        self._measure()

    def __call__(self, estimator, X, y=None, **params):
        """Score a fitted estimator on performances.

        Parameters
        ----------
        estimator : a synchronizer, or a Pipeline with one
        X : performances, as the estimator takes them
            At least two.
        y : ignored
        **params : dict
            What the ``match`` of the synchronizer takes besides, such as ``keyframes``; in
            cross-validation asked for by `set_score_request`.

        Returns
        -------
        float

        Raises
        ------
        ValueError
            If there is no synchronizer, a single performance, or the synchronizer needs key-frames
            and gets none.
        TypeError
            If nobody takes one of the params.
        """
        reached = self._reach(estimator, X, params)
        before = reached.synchronizer.normalize(reached.performances)
        return self._score(before, reached.match().warp(reached.performances))


class FeatureHoldoutScorer(_SynchronizerScorer):
    """Scorer that aligns on some features and judges by the others.

    Features are dealt into ``n_folds`` hands. For each hand a clone of the synchronizer is
    fitted without it, to a median pattern, and its warps are judged by the spread of the hand
    alone. Warping more than the time tells does not help features that had no say. Key-frames of
    the performances that are scored go to the clones, too.

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
        self.spread = spread
        self.n_folds = n_folds
        self.random_state = random_state
        self._measure()

    def __call__(self, estimator, X, y=None, **params):
        """Score a fitted estimator on performances.

        Parameters
        ----------
        estimator : a synchronizer, or a Pipeline with one
        X : performances, as the estimator takes them
            At least two, of at least ``n_folds`` features.
        y : ignored
        **params : dict
            What the ``fit`` and ``match`` of the synchronizer take besides, such as ``keyframes``;
            in cross-validation asked for by `set_score_request`.

        Returns
        -------
        float

        Raises
        ------
        ValueError
            If there is no synchronizer, a single performance, a single feature, or the synchronizer
            needs key-frames and gets none.
        TypeError
            If nobody takes one of the params.
        """
        reached = self._reach(estimator, X, params, ("match", "fit"))
        synchronizer, performances = reached.synchronizer, reached.performances
        n_features = performances[0].shape[1]
        if n_features < 2:
            raise ValueError(
                "FeatureHoldoutScorer holds features out, and these performances have only one, as "
                "have all rows of a 2-D array: use SpreadScorer. "
                f"(n_folds={self.n_folds!r} must be between 2 and the 1 features there are.)"
            )
        if not isinstance(self.n_folds, Integral) or not 2 <= self.n_folds <= n_features:
            raise ValueError(
                f"n_folds={self.n_folds!r} must be between 2 and the {n_features} features there "
                "are, a whole number."
            )
        if reached.takes_params:
            # What it asks for here, its clones cannot do without.
            reached.match()
        fitting = accepted_params(synchronizer.fit, params)
        dealt = check_random_state(self.random_state).permutation(n_features)
        scores = []
        for held in np.array_split(dealt, self.n_folds):
            shown = np.setdiff1d(dealt, held)
            blind = clone(synchronizer).set_params(
                n_frames=synchronizer.n_frames_, pattern="median"
            )
            seen, hidden = ([x[:, part] for x in performances] for part in (shown, held))
            match = blind.fit(seen, **fitting).match(seen, **reached.params)
            before = normalise(hidden, synchronizer.n_frames_)
            scores.append(self._score(before, match.warp(hidden)))
        return float(np.mean(scores))
