"""Scorers: scores against plain computations, key-frames given and routed, and refusals."""

import pickle

import numpy as np
import pytest
from sklearn import config_context
from sklearn.base import clone
from sklearn.exceptions import UnsetMetadataPassedError
from sklearn.model_selection import GridSearchCV, cross_val_score
from sklearn.pipeline import make_pipeline
from sklearn_motionsync import ASpace, DenseSynchronizer, DirectionCosines, LinearSynchronizer
from sklearn_motionsync.datasets import make_bending
from sklearn_motionsync.metrics import (
    FeatureHoldoutScorer,
    SpreadScorer,
    least_squares,
)

from shift_synchronizer import ShiftSynchronizer

SCORERS = [SpreadScorer, FeatureHoldoutScorer]


@pytest.fixture(scope="module")
def bunch():
    return make_bending(8, n_frames=40, random_state=1)


@pytest.fixture(scope="module")
def points(bunch):
    poses = DirectionCosines(bunch.skeleton).fit_transform(bunch.data)
    return ASpace(6).fit_transform(poses)


@pytest.fixture
def routing():
    with config_context(enable_metadata_routing=True):
        yield


def requesting_sync():
    sync = LinearSynchronizer(40)
    return sync.set_fit_request(keyframes=True).set_transform_request(keyframes=True)


# -- scores -------------------------------------------------------------------------------


@pytest.mark.parametrize("scorer", SCORERS)
def test_dense_matching_scores_better_than_linear(scorer, bending):
    """Without y, in a pipeline, in cross_val_score."""
    scores = []
    for sync in (
        LinearSynchronizer(40),
        DenseSynchronizer(40, max_offset=0),
        DenseSynchronizer(40),
    ):
        pipe = make_pipeline(DirectionCosines(bending.skeleton), ASpace(6), sync)
        scoring = {"cv": 2, "scoring": scorer(), "error_score": "raise"}
        scores.append(cross_val_score(pipe, bending.data[:10], **scoring).mean())
    assert scores[0] == scores[1] < scores[2]


def test_holdout_score_does_not_reward_over_warping():
    """Of pure noise: warping lowers the spread of the features that were matched alone."""
    rng = np.random.default_rng(0)
    X = [rng.standard_normal((60, 6)) for _ in range(8)]
    sync = DenseSynchronizer.paper(smoothness=0).fit(X)
    assert SpreadScorer()(sync, X) > -0.8
    assert FeatureHoldoutScorer()(sync, X) < -0.95


def test_holdout_judges_parameters_and_spread_the_fitted_pattern(points):
    train, test = points[:4], points[4:]
    syncs = [
        DenseSynchronizer(40).fit(train),
        DenseSynchronizer(40, pattern=points[0]).fit(train),
        DenseSynchronizer(40).fit(test),
    ]
    assert len({FeatureHoldoutScorer()(sync, test) for sync in syncs}) == 1
    assert len({SpreadScorer()(sync, test) for sync in syncs}) == 3


def test_holdout_score_has_no_unit_and_hardly_depends_on_frames(points):
    def score(n_frames, unit):
        X, scoring = [unit * x for x in points], FeatureHoldoutScorer()
        return cross_val_score(DenseSynchronizer(n_frames), X, cv=2, scoring=scoring).mean()

    assert score(90, 1) == pytest.approx(score(30, 1), rel=0.1)
    assert score(30, 1000) == pytest.approx(score(30, 1))


# -- key-frames given as arguments --------------------------------------------------------


def test_spread_score_with_key_frames_is_the_negative_ratio(bunch, points):
    K = bunch.keyframes
    sync = LinearSynchronizer(40).fit(points, keyframes=K)
    linear = LinearSynchronizer(40).fit_transform(points)
    expected = -least_squares(linear, sync.transform(points, keyframes=K))
    assert SpreadScorer()(sync, points, keyframes=K) == pytest.approx(expected)
    found = LinearSynchronizer(40).fit(points)
    assert SpreadScorer()(found, points) == SpreadScorer()(found, points, keyframes=None)


def test_holdout_refits_with_the_given_key_frames(bunch, points):
    """Refits without them score less."""
    K = bunch.keyframes
    sync = LinearSynchronizer(40).fit(points, keyframes=K)
    order, scores = np.random.RandomState(0).permutation(6), []
    for held in np.array_split(order, 3):
        shown = [np.delete(x, held, axis=1) for x in points]
        hidden = [x[:, held] for x in points]
        blind = LinearSynchronizer(40).fit(shown, keyframes=K)
        match = blind.match(shown, keyframes=K)
        scores.append(-least_squares(blind.fit(hidden).normalize(hidden), match.warp(hidden)))
    score = FeatureHoldoutScorer()(sync, points, keyframes=K)
    assert score == pytest.approx(np.mean(scores))
    found = LinearSynchronizer(40).fit(points)
    assert FeatureHoldoutScorer()(found, points) < score


@pytest.mark.parametrize("scorer", SCORERS)
def test_missing_key_frames_are_refused_with_advice(scorer, bunch, points):
    sync = LinearSynchronizer(40).fit(points, keyframes=bunch.keyframes)
    message = r"fitted with key-frames.*set_score_request\(keyframes=True\)"
    with pytest.raises(ValueError, match=message):
        scorer()(sync, points)
    with pytest.raises(ValueError, match="list of 8 arrays"):
        scorer()(sync, points, keyframes=bunch.keyframes[:3])


@pytest.mark.parametrize("scorer", SCORERS)
def test_key_frames_are_refused_if_match_does_not_accept_them(scorer, bunch, points):
    for sync in (DenseSynchronizer(40), LinearSynchronizer(40), ShiftSynchronizer(40)):
        message = f"got 'keyframes'.*not taken by {type(sync).__name__}.match"
        with pytest.raises(TypeError, match=message):
            scorer()(sync.fit(points), points, keyframes=bunch.keyframes)
    with pytest.raises(TypeError, match="got 'key_frames'"):
        scorer()(sync, points, key_frames=bunch.keyframes)


class EventSynchronizer(LinearSynchronizer):
    """A synchronizer that requires metadata of another name, and in its fit records weights."""

    seen = []

    def fit(self, X, y=None, *, events, weights=None):
        self.seen.append(weights)
        return super().fit(X, keyframes=events)

    def match(self, X, *, events):
        return super().match(X, keyframes=events)


@pytest.mark.parametrize("scorer", SCORERS)
def test_metadata_may_have_any_name(scorer, bunch, points):
    K, weights = bunch.keyframes, np.ones(len(points))
    sync = EventSynchronizer(40).fit(points, events=K)
    plain = LinearSynchronizer(40).fit(points, keyframes=K)
    expected = scorer()(plain, points, keyframes=K)
    assert scorer()(sync, points, events=K) == expected
    # What a fit alone accepts reaches the clones that are fitted.
    if scorer is SpreadScorer:
        with pytest.raises(TypeError, match="got 'weights'"):
            scorer()(sync, points, events=K, weights=weights)
    else:
        sync.seen.clear()
        scorer()(sync, points, events=K, weights=weights)
        assert [w is weights for w in sync.seen] == [True, True, True]


# -- key-frames routed by scikit-learn ----------------------------------------------------


@pytest.mark.usefixtures("routing")
@pytest.mark.parametrize("scorer", SCORERS)
def test_key_frames_that_were_not_requested_are_refused(scorer, bunch, points):
    def score(scoring):
        return cross_val_score(
            requesting_sync(), points, cv=2, scoring=scoring,
            params={"keyframes": bunch.keyframes}, error_score="raise",
        )  # fmt: skip

    with pytest.raises(UnsetMetadataPassedError, match=f"{scorer.__name__}.set_score_request"):
        score(scorer())
    with pytest.raises(ValueError, match="fitted with key-frames"):
        score(scorer().set_score_request(keyframes=False))
    with pytest.raises(ValueError, match="alias"):
        scorer().set_score_request(keyframes=5)


def test_set_score_request_needs_metadata_routing():
    with pytest.raises(RuntimeError, match="enable_metadata_routing=True"):
        SpreadScorer().set_score_request(keyframes=True)


@pytest.mark.usefixtures("routing")
@pytest.mark.parametrize("scorer", SCORERS)
def test_scorer_keeps_requests_when_cloned_and_pickled(scorer, bunch, points):
    scoring = scorer().set_score_request(keyframes=True)
    requests = {"keyframes": True, "frame_rate": False, "confidence": False}
    sync = LinearSynchronizer(40).fit(points, keyframes=bunch.keyframes)
    expected = scoring(sync, points, keyframes=bunch.keyframes)
    nested = clone(GridSearchCV(sync, {"n_frames": [40]}, scoring=scoring)).scoring
    for copy in (clone(scoring), pickle.loads(pickle.dumps(scoring)), nested):
        assert copy is not scoring
        assert copy(sync, points, keyframes=bunch.keyframes) == expected
        assert copy.get_metadata_routing().score.requests == requests
        assert repr(copy) == repr(scoring) == f"{scorer.__name__}()"
    # A copy's requests are its own.
    clone(scoring).set_score_request(keyframes=False)
    assert scoring.get_metadata_routing().score.requests == requests


# -- refusals -----------------------------------------------------------------------------


@pytest.mark.parametrize("scorer", SCORERS)
def test_scorer_refuses_one_trial(scorer, points):
    message = f"{scorer.__name__} measures how much .* at least 2: instead of LeaveOneOut use"
    with pytest.raises(ValueError, match=message):
        scorer()(LinearSynchronizer(40).fit(points), points[:1])


def test_holdout_refuses_one_feature():
    rows = np.stack([np.sin(np.linspace(0, 3, 30) ** p) for p in (1, 1.1, 0.9)])
    sync = LinearSynchronizer().fit(rows)
    with pytest.raises(ValueError, match="of the rows of a 2-D array, use SpreadScorer"):
        FeatureHoldoutScorer()(sync, rows)
    assert SpreadScorer()(sync, rows) == -1


def test_score_of_constant_features_is_minus_1(points):
    """Interpolation does not turn a constant into noise."""
    X = [np.full((len(x), 2), 0.1, "f4") for x in points]
    sync = DenseSynchronizer(40).fit(X)
    assert SpreadScorer()(sync, X) == FeatureHoldoutScorer()(sync, X) == -1


# -- gaps -----------------------------------------------------------------------------------


def spread_of_seen(z):
    """The squared differences of every sequence from the mean of the others, where it is seen."""
    out = []
    for i, x in enumerate(z):
        others = np.nanmean(np.delete(z, i, axis=0), axis=0)
        out.append(np.nanmean(np.square(x - others)) * x[0].size)
    return np.array(out)


def test_hidden_values_do_not_count_in_the_spread():
    rng = np.random.default_rng(0)
    before = rng.standard_normal((6, 201, 3))
    after = 0.5 * before + rng.standard_normal((201, 3))
    before[1, 20:50], after[2, 30:60, 1] = np.nan, np.nan
    found = least_squares(before, after)
    expected = np.mean(spread_of_seen(after) / spread_of_seen(before))
    assert abs(found - expected) < 0.02 * expected
    # As without gaps, nearly.
    assert abs(found - 0.25) < 0.02


@pytest.mark.parametrize("scorer", [SpreadScorer(), FeatureHoldoutScorer()])
def test_scores_of_trials_with_gaps(scorer):
    X = [x[:, 6:18] for x in make_bending(8, random_state=0).data]
    gappy = [x.copy() for x in X]
    for i, x in enumerate(gappy):
        x[len(x) // 3 : len(x) // 2, (i % 3) : (i % 3) + 3] = np.nan
    sync = DenseSynchronizer(40)
    expected, found = (cross_val_score(sync, given, cv=2, scoring=scorer) for given in (X, gappy))
    assert np.abs(found - expected).max() < 0.25 * np.abs(expected).max()
