"""Scorers and key-frames: given by hand, and routed by scikit-learn; what cannot be scored."""

import pickle

import numpy as np
import pytest
from sklearn import config_context
from sklearn.base import clone
from sklearn.exceptions import UnsetMetadataPassedError
from sklearn.model_selection import (
    GridSearchCV,
    KFold,
    LeaveOneOut,
    cross_val_score,
    cross_validate,
)
from sklearn.pipeline import make_pipeline
from sklearn_motionsync import (
    ActionModel,
    ASpace,
    DenseSynchronizer,
    DirectionCosines,
    KeyframeSynchronizer,
    LinearSynchronizer,
)
from sklearn_motionsync.datasets import make_bending
from sklearn_motionsync.metrics import FeatureHoldoutScorer, SpreadScorer, least_squares

from shift_synchronizer import ShiftSynchronizer

SCORERS = [SpreadScorer, FeatureHoldoutScorer]


@pytest.fixture(scope="module")
def bunch():
    return make_bending(8, n_frames=40, random_state=1)


@pytest.fixture(scope="module")
def points(bunch):
    postures = DirectionCosines(bunch.skeleton).fit_transform(bunch.data)
    return ASpace(6).fit_transform(postures)


def as_objects(keyframes):
    out = np.empty(len(keyframes), dtype=object)
    out[:] = list(keyframes)
    return out


KINDS = {"array": np.asarray, "list": list, "tuple": tuple, "objects": as_objects}


@pytest.fixture
def routing():
    with config_context(enable_metadata_routing=True):
        yield


def asking(scorer):
    return scorer().set_score_request(keyframes=True)


def asking_sync(**params):
    sync = KeyframeSynchronizer(40, **params)
    return sync.set_fit_request(keyframes=True).set_transform_request(keyframes=True)


# -- by hand ----------------------------------------------------------------------------


def test_spread_with_key_frames_is_the_ratio(bunch, points):
    K = bunch.keyframes
    sync = KeyframeSynchronizer(40).fit(points, keyframes=K)
    linear = LinearSynchronizer(40).fit_transform(points)
    expected = -least_squares(linear, sync.transform(points, keyframes=K))
    assert SpreadScorer()(sync, points, keyframes=K) == pytest.approx(expected)
    for kind in KINDS.values():
        assert SpreadScorer()(sync, points, None, keyframes=kind(K)) == pytest.approx(expected)
    found = KeyframeSynchronizer(40).fit(points)
    assert SpreadScorer()(found, points) == SpreadScorer()(found, points, keyframes=None)


def test_features_held_out_are_judged_with_the_same_key_frames(bunch, points):
    """Refits by curvature are something else: the score is that of refits with key-frames."""
    K = bunch.keyframes
    sync = KeyframeSynchronizer(40).fit(points, keyframes=K)
    dealt, scores = np.random.RandomState(0).permutation(6), []
    for held in np.array_split(dealt, 3):
        shown = [np.delete(x, held, axis=1) for x in points]
        hidden = [x[:, held] for x in points]
        blind = KeyframeSynchronizer(40).fit(shown, keyframes=K)
        match = blind.match(shown, keyframes=K)
        scores.append(-least_squares(blind.fit(hidden).normalize(hidden), match.warp(hidden)))
    score = FeatureHoldoutScorer()(sync, points, keyframes=K)
    assert score == pytest.approx(np.mean(scores))
    found = KeyframeSynchronizer(40).fit(points)
    assert FeatureHoldoutScorer()(found, points) < score


@pytest.mark.parametrize("scorer", SCORERS)
def test_forgotten_key_frames_are_asked_for(scorer, bunch, points):
    sync = KeyframeSynchronizer(40).fit(points, keyframes=bunch.keyframes)
    name = scorer.__name__
    with pytest.raises(ValueError, match="fitted with key-frames") as error:
        scorer()(sync, points)
    for words in (
        f"{name}()(estimator, X, keyframes=[...])",
        f"scoring={name}().set_score_request(keyframes=True)",
        "params={'keyframes': [...]}",
    ):
        assert words in str(error.value)
    assert str(pickle.loads(pickle.dumps(error.value))) == str(error.value)
    with pytest.raises(ValueError, match="list of 8 arrays"):
        scorer()(sync, points, keyframes=bunch.keyframes[:3])


@pytest.mark.parametrize("scorer", SCORERS)
def test_who_takes_no_key_frames_says_so(scorer, bunch, points):
    for sync in (DenseSynchronizer(40), LinearSynchronizer(40), ShiftSynchronizer(40)):
        message = f"got 'keyframes'.*not taken by {type(sync).__name__}.match"
        with pytest.raises(TypeError, match=message):
            scorer()(sync.fit(points), points, keyframes=bunch.keyframes)
    with pytest.raises(TypeError, match="got 'key_frames'"):
        scorer()(sync, points, key_frames=bunch.keyframes)


class EventSynchronizer(KeyframeSynchronizer):
    """One that takes metadata by another name, and insists on it."""

    def fit(self, X, y=None, *, events):
        return super().fit(X, keyframes=events)

    def match(self, X, *, events):
        return super().match(X, keyframes=events)


@pytest.mark.parametrize("scorer", SCORERS)
def test_metadata_of_any_name(scorer, bunch, points, routing):
    K = bunch.keyframes
    sync = EventSynchronizer(40).fit(points, events=K)
    plain = KeyframeSynchronizer(40).fit(points, keyframes=K)
    expected = scorer()(plain, points, keyframes=K)
    assert scorer()(sync, points, events=K) == expected
    scores = cross_val_score(
        EventSynchronizer(40).set_fit_request(events=True),
        points,
        cv=2,
        scoring=scorer().set_score_request(events=True),
        params={"events": K},
        error_score="raise",
    )
    assert np.isfinite(scores).all()


class WeighingSynchronizer(LinearSynchronizer):
    """One whose fit alone takes metadata, and says what it got."""

    seen = []

    def fit(self, X, y=None, *, weights=None):
        self.seen.append(weights)
        return super().fit(X)


def test_clones_are_fitted_with_what_only_a_fit_takes(points):
    sync, weights = WeighingSynchronizer(40).fit(points), np.ones(len(points))
    sync.seen.clear()
    FeatureHoldoutScorer(n_folds=2)(sync, points, weights=weights)
    assert [w is weights for w in sync.seen] == [True, True]
    with pytest.raises(TypeError, match="got 'weights'"):
        SpreadScorer()(sync, points, weights=weights)


# -- routed -----------------------------------------------------------------------------


@pytest.mark.usefixtures("routing")
@pytest.mark.parametrize("scorer", SCORERS)
@pytest.mark.parametrize("kind", KINDS.values(), ids=KINDS)
def test_key_frames_are_split_with_the_performances(scorer, kind, bunch, points):
    K, expected = bunch.keyframes, []
    for train, test in KFold(3).split(points):
        seen, new = ([points[i] for i in part] for part in (train, test))
        sync = KeyframeSynchronizer(40).fit(seen, keyframes=K[train])
        expected.append(scorer()(sync, new, keyframes=K[test]))
    scores = cross_val_score(
        asking_sync(),
        points,
        cv=KFold(3),
        scoring=asking(scorer),
        params={"keyframes": kind(K)},
        error_score="raise",
    )
    np.testing.assert_allclose(scores, expected)


@pytest.mark.usefixtures("routing")
@pytest.mark.parametrize("scorer", SCORERS)
@pytest.mark.parametrize("ends_in_model", [False, True])
def test_grid_search_with_key_frames_in_a_pipeline(scorer, ends_in_model, bunch):
    steps = [DirectionCosines(bunch.skeleton), ASpace(4), asking_sync()]
    pipe = make_pipeline(*steps, *([ActionModel()] if ends_in_model else []))
    grid = {"aspace__n_components": [3, 5]}
    search = GridSearchCV(pipe, grid, cv=2, scoring=asking(scorer), error_score="raise")
    search.fit(bunch.data, keyframes=list(bunch.keyframes))
    assert np.isfinite(search.cv_results_["mean_test_score"]).all()
    score = search.score(bunch.data, keyframes=bunch.keyframes)
    assert score == scorer()(search, bunch.data, keyframes=bunch.keyframes)
    if ends_in_model:
        accepted = search.best_estimator_.predict(bunch.data, keyframes=bunch.keyframes)
        assert accepted.shape == (8,)


@pytest.mark.usefixtures("routing")
def test_several_scorers_names_of_ones_own_and_jobs(bunch, points):
    scoring = {
        "spread": SpreadScorer("sobolev").set_score_request(keyframes="marks"),
        "blind": FeatureHoldoutScorer(n_folds=2).set_score_request(keyframes="marks"),
    }
    results = [
        cross_validate(
            KeyframeSynchronizer(40).set_fit_request(keyframes="marks"),
            points,
            cv=2,
            scoring=scoring,
            params={"marks": bunch.keyframes},
            n_jobs=n_jobs,
            error_score="raise",
        )
        for n_jobs in (1, 2)
    ]
    for name in ("test_spread", "test_blind"):
        np.testing.assert_array_equal(results[0][name], results[1][name])


@pytest.mark.usefixtures("routing")
@pytest.mark.parametrize("scorer", SCORERS)
def test_key_frames_that_were_not_asked_for(scorer, bunch, points):
    def score(scoring):
        return cross_val_score(
            asking_sync(),
            points,
            cv=2,
            scoring=scoring,
            params={"keyframes": bunch.keyframes},
            error_score="raise",
        )

    with pytest.raises(UnsetMetadataPassedError, match=f"{scorer.__name__}.set_score_request"):
        score(scorer())
    with pytest.raises(ValueError, match="fitted with key-frames"):
        score(scorer().set_score_request(keyframes=False))
    with pytest.raises(ValueError, match="alias"):
        scorer().set_score_request(keyframes=5)


@pytest.mark.parametrize("scorer", SCORERS)
def test_requests_need_routing(scorer):
    with pytest.raises(RuntimeError, match="enable_metadata_routing=True"):
        scorer().set_score_request(keyframes=True)


@pytest.mark.usefixtures("routing")
@pytest.mark.parametrize("scorer", SCORERS)
def test_scorers_are_cloned_pickled_and_shown(scorer, bunch, points):
    scoring = scorer("sobolev").set_score_request(keyframes=True)
    sync = KeyframeSynchronizer(40).fit(points, keyframes=bunch.keyframes)
    expected = scoring(sync, points, keyframes=bunch.keyframes)
    nested = clone(GridSearchCV(sync, {"n_frames": [40]}, scoring=scoring)).scoring
    for copy in (clone(scoring), pickle.loads(pickle.dumps(scoring)), nested):
        assert copy is not scoring
        assert copy(sync, points, keyframes=bunch.keyframes) == expected
        assert copy.get_metadata_routing().score.requests == {"keyframes": True}
        assert repr(copy) == repr(scoring) == f"{scorer.__name__}(spread='sobolev')"
    # A copy's requests are its own.
    clone(scoring).set_score_request(keyframes=False)
    assert scoring.get_metadata_routing().score.requests == {"keyframes": True}


# -- what cannot be scored --------------------------------------------------------------


@pytest.mark.parametrize("scorer", SCORERS)
def test_one_performance_has_no_spread(scorer, points):
    with pytest.raises(ValueError, match=r"at least 2: instead of LeaveOneOut use"):
        scorer()(LinearSynchronizer(40).fit(points), points[:1])
    with pytest.raises(ValueError, match=f"{scorer.__name__} tells .* got one alone"):
        cross_val_score(
            LinearSynchronizer(40),
            points,
            cv=LeaveOneOut(),
            scoring=scorer(),
            error_score="raise",
        )


def test_one_feature_cannot_be_held_out():
    rows = np.stack([np.sin(np.linspace(0, 3, 30) ** p) for p in (1, 1.1, 0.9)])
    sync = LinearSynchronizer().fit(rows)
    with pytest.raises(ValueError, match="rows of a 2-D array: use SpreadScorer"):
        FeatureHoldoutScorer()(sync, rows)
    assert SpreadScorer()(sync, rows) == -1


@pytest.mark.parametrize("n_folds", [1, 7, 2.5, "3", None])
def test_hands_are_whole(n_folds, points):
    sync = LinearSynchronizer(40).fit(points)
    with pytest.raises(ValueError, match=f"n_folds={n_folds!r} must be between 2 and the 6"):
        FeatureHoldoutScorer(n_folds=n_folds)(sync, points)


@pytest.mark.parametrize("scorer", SCORERS)
def test_parameters_set_later_are_checked_too(scorer, points):
    for spread in ("variance", None, ["sobolev"]):
        with pytest.raises(ValueError, match="is unknown; use one of"):
            scorer().set_params(spread=spread)(LinearSynchronizer(40).fit(points), points)


@pytest.mark.parametrize("spread", ["least_squares", "sobolev", "correlation"])
@pytest.mark.parametrize("dtype", [np.float32, np.float64])
def test_features_that_never_change_are_no_gain(spread, dtype, points):
    """Hidden alone, a constant has nothing to gain: interpolation does not make it noise."""
    X = [np.full((len(x), 2), 0.1, dtype) for x in points]
    sync = DenseSynchronizer(40).fit(X)
    sign = 1 if spread == "correlation" else -1
    assert SpreadScorer(spread)(sync, X) == FeatureHoldoutScorer(spread, 2)(sync, X) == sign
