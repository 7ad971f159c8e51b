"""Pipelines that begin with a union of views: parameters routed past it, and figures."""

import numpy as np
import pytest
from sklearn import clone, config_context
from sklearn.pipeline import make_pipeline, make_union
from sklearn_motionsync import (
    ActionModel,
    ASpace,
    DenseSynchronizer,
    DirectionCosines,
    JointPositions,
    LinearSynchronizer,
    Match,
)
from sklearn_motionsync.datasets import make_bending
from sklearn_motionsync.display import SkeletonDisplay, SynchronizationDisplay
from sklearn_motionsync.metrics import SpreadScorer

BUNCH = make_bending(7, n_frames=40, random_state=2)
K = list(BUNCH.keyframes)
COSINES = DirectionCosines(BUNCH.skeleton)
POSITIONS = JointPositions(BUNCH.skeleton)


def union_of(*views):
    return make_union(*views).set_output(transform="pandas")


BOTH = union_of(COSINES, POSITIONS)
# The same union in other forms.
OF_PIPELINES = union_of(make_pipeline(COSINES), make_pipeline("passthrough", POSITIONS))
UNIONS = {
    "nested, of pipelines": make_pipeline(OF_PIPELINES),
    "of unions": union_of(union_of(COSINES), POSITIONS),
}


@pytest.fixture(params=UNIONS)
def union(request):
    return clone(UNIONS[request.param])


# -- parameters routed past a union ---------------------------------------------------------


@pytest.mark.parametrize("routing", [False, True])
def test_keyframes_are_routed_past_a_union(union, routing):
    sync = LinearSynchronizer(30)
    pipe = make_pipeline(union, sync).fit(BUNCH.data, linearsynchronizer__keyframes=K)
    points = union.fit_transform(BUNCH.data)
    expected = LinearSynchronizer(30).fit(points, keyframes=K).match(points, keyframes=K)
    with config_context(enable_metadata_routing=routing):
        match = Match.from_estimator(pipe, BUNCH.data, keyframes=K)
        display = SynchronizationDisplay.from_estimator(pipe, BUNCH.data, keyframes=K)
        score = SpreadScorer()(pipe, BUNCH.data, keyframes=K)
    for times in (match.times, display.match.times):
        np.testing.assert_array_equal(times, expected.times)
    assert score == SpreadScorer()(pipe[-1], points, keyframes=K)


def test_unknown_params_are_refused_after_a_union(union):
    pipe = make_pipeline(union, DenseSynchronizer(20)).fit(BUNCH.data)
    with pytest.raises(TypeError, match=r"got 'keyframes', .* not taken by FeatureUnion\.tr"):
        Match.from_estimator(pipe, BUNCH.data, keyframes=K)


# -- figures --------------------------------------------------------------------------------


@pytest.mark.parametrize("view", [POSITIONS, *UNIONS.values()])
def test_synchronized_bodies_are_drawn_for_any_view(view):
    pipe = make_pipeline(view, LinearSynchronizer(20)).fit(BUNCH.data)
    shown = SkeletonDisplay.from_estimator(pipe, BUNCH.data, trials=[1, 0])
    plain = make_pipeline(COSINES, LinearSynchronizer(20)).fit(BUNCH.data)
    expected = SkeletonDisplay.from_estimator(plain, BUNCH.data, trials=[1, 0])
    for bodies, right in zip(shown.scenes, expected.scenes, strict=True):
        for one, other in zip(bodies, right, strict=True):
            np.testing.assert_array_equal(one, other)


@pytest.mark.parametrize("reduced", [False, True])
def test_departures_of_a_raised_arm_mark_its_limbs(reduced):
    odd = BUNCH.data[0].reshape(-1, 15, 3).copy()
    parts = ("wrist", "elbow", "shoulder")
    wrist, elbow, shoulder = (BUNCH.skeleton.index_of(f"left_{part}") for part in parts)
    # It waves, raised.
    angle = 0.4 * np.sin(np.linspace(0, 6 * np.pi, len(odd)))
    up = np.column_stack([np.sin(angle), np.cos(angle), 0 * angle])
    odd[:, elbow] = odd[:, shoulder] + 0.3 * up
    odd[:, wrist] = odd[:, elbow] + 0.25 * up
    X = [BUNCH.data[0], odd.reshape(len(odd), -1)]
    steps = ASpace(0.95) if reduced else "passthrough", LinearSynchronizer(20), ActionModel()
    pipe, plain = (clone(make_pipeline(view, *steps)).fit(BUNCH.data) for view in (BOTH, COSINES))
    good, bad = (SkeletonDisplay.from_departures(pipe, X, trial=i) for i in (0, 1))
    assert "is accepted" in good.heading
    assert not any(good.marked)
    # An aSpace of bends hardly shows that an arm waves, but its residuals do.
    assert reduced or "not accepted" in bad.heading
    arms = {(shoulder, elbow), (elbow, wrist)}
    assert all(arms & set(bones) for bones in bad.marked)
    expected = SkeletonDisplay.from_departures(plain, X, trial=1, frames=[3, 12])
    shown = SkeletonDisplay.from_departures(pipe, X, trial=1, frames=[3, 12])
    np.testing.assert_allclose(shown.scenes[1][0], expected.scenes[1][0], atol=1e-9)


def test_figures_without_a_body_are_refused():
    union = UNIONS["of unions"]
    steps = LinearSynchronizer(20), ActionModel()
    with pytest.raises(ValueError, match="need steps with inverse_transform before"):
        SkeletonDisplay.from_model(make_pipeline(union, *steps).fit(BUNCH.data))
    two = union_of(COSINES, DirectionCosines(BUNCH.skeleton, "world"))
    for view in (POSITIONS, two):
        pipe = make_pipeline(view, *steps).fit(BUNCH.data)
        with pytest.raises(ValueError, match="Limbs that depart need a pipeline of DirectionCos"):
            SkeletonDisplay.from_departures(pipe, BUNCH.data)
