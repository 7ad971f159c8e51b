"""What a fit warns of: warps that trials do not support, and features in another unit."""

import warnings

import numpy as np
import pandas as pd
import pytest
from sklearn.pipeline import make_pipeline
from sklearn.preprocessing import StandardScaler
from sklearn_motionsync import (
    ASpace,
    DenseSynchronizer,
    DirectionCosines,
    FrameWise,
    SynchronizationWarning,
)
from sklearn_motionsync.matching.metric import Evidence
from sklearn_motionsync.synchronizers import training
from sklearn_motionsync.synchronizers.learning import weigh_evidence

P = 60


def chance(n):
    return list(np.random.default_rng(0).standard_normal((n, P, 3)))


def test_warps_of_noise_are_warned_of():
    with pytest.warns(
        SynchronizationWarning, match="1.[0-9]+ times a typical offset .* LinearSynchronizer"
    ):
        sync = DenseSynchronizer(P).fit(chance(12))
    assert sync.evidence_.weak
    assert sync.evidence_.remaining > 0.7
    assert sync.evidence_.inconsistency > 0.7
    assert not sync.refines_
    match = sync.match(chance(12))
    assert match.doubtful.all()
    assert "warps contradict each other" in " ".join(match.reasons)


@pytest.mark.parametrize(
    ("remaining", "inconsistency", "n_trials", "weak"),
    [
        (0.71, 0.41, 10, True),
        (0.69, 0.41, 10, False),
        (0.71, 0.39, 10, False),
        (0.71, 0.41, 9, False),
        (np.nan, np.nan, 20, False),
    ],
)
def test_limits_of_weak_evidence(remaining, inconsistency, n_trials, weak):
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        found = weigh_evidence(Evidence(remaining=remaining, inconsistency=inconsistency), n_trials)
    assert found.weak is weak
    assert [each.category for each in caught] == [SynchronizationWarning] * weak
    np.testing.assert_array_equal(
        [found.remaining, found.inconsistency], [remaining, inconsistency]
    )


@pytest.mark.parametrize("params", [{"metric": None}, {"consensus": 0}, {"cost": "pose"}])
def test_nothing_is_known_without_a_metric(params):
    evidence = DenseSynchronizer(P, **params).fit(chance(12)).evidence_
    assert np.isnan([evidence.inconsistency, evidence.remaining]).all()
    assert not evidence.weak


def test_aligned_trials_are_no_evidence():
    rng, t = np.random.default_rng(0), np.linspace(0, 1, P)
    curves = np.column_stack([np.sin(7 * t), np.cos(5 * t)])
    X = curves + 0.001 * rng.standard_normal((12, P, 2))
    assert np.isnan(DenseSynchronizer(P).fit(X).evidence_.remaining)


# Clips of a Kinect, and whether they are warned of.
KINECT = {"sitDown": False, "throw": True}


@pytest.mark.parametrize("action", KINECT)
def test_people_seen_by_a_kinect(action, utkinect):
    X = [
        x
        for x, t in zip(utkinect.data, utkinect.target, strict=True)
        if t == action and len(x) >= 8
    ]
    points = ASpace().fit_transform(DirectionCosines(utkinect.skeleton).fit_transform(X))
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        sync = DenseSynchronizer(P).fit(points)
    assert [w.category for w in caught] == [SynchronizationWarning] * KINECT[action]
    assert sync.evidence_.weak is KINECT[action]


def test_every_action_of_optical_recordings_is_supported(hdm05):
    for action in sorted(set(hdm05.target))[::2]:
        X = [x for x, t in zip(hdm05.data, hdm05.target, strict=True) if t == action]
        points = ASpace().fit_transform(DirectionCosines(hdm05.skeleton).fit_transform(X))
        evidence = DenseSynchronizer(P).fit(points).evidence_
        assert evidence.inconsistency < 0.5, action
        assert evidence.remaining < 0.7, action


# -- a feature with nearly all of the compared energy ----------------------------------


SETTINGS = [
    {},
    {"metric": None},
    {"cost": "elastic"},
    {"cost": "pose", "max_rate": 2, "consensus": 0},
]


def walks(units=(60, 900), n=5, n_frames=40):
    rng = np.random.default_rng(0)
    times = [np.linspace(0, 1, n_frames) ** rng.uniform(0.8, 1.25) for _ in range(n)]
    curves = [np.column_stack([np.sin(5 * t), 5 + np.cos(4 * t)]) for t in times]
    return [pd.DataFrame(x * units, columns=["knee", "force"]) for x in curves]


def is_quiet(X, **params):
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        DenseSynchronizer(n_frames=30, **params).fit(X)
    return True


@pytest.mark.parametrize("params", SETTINGS)
def test_warns_of_a_feature_in_another_unit(params):
    sync = DenseSynchronizer(n_frames=30, **params)
    with pytest.warns(UserWarning, match=r"Feature 'force' holds 9\d.* % of the energy") as warned:
        sync.fit(walks())
    assert "make_pipeline(FrameWise(StandardScaler()), DenseSynchronizer())" in str(
        warned[0].message
    )
    with pytest.warns(UserWarning, match=r"Feature 0 holds"):
        sync.fit([x.to_numpy() * [100, 1 / 900] for x in walks()])
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        make_pipeline(FrameWise(StandardScaler()), sync).fit(walks())


@pytest.mark.parametrize("params", SETTINGS)
def test_no_warning_for_balanced_or_single_features(params):
    one_unit = walks((1, 1))
    assert is_quiet(one_unit, **params)
    assert is_quiet([x[["force"]] for x in walks()], **params)
    still = [x.assign(knee=0.1) for x in walks()]
    assert is_quiet(still, **params)
    assert is_quiet([x * 0 for x in walks()], **params)


def test_warning_does_not_depend_on_batches(monkeypatch):
    monkeypatch.setattr(training, "BATCH", 2)
    components = ASpace(2).fit_transform([x.to_numpy() for x in walks()])
    assert is_quiet(components, metric=None)
    with pytest.warns(UserWarning, match=r"Feature 'force' holds 9\d.* % of the energy"):
        DenseSynchronizer(n_frames=30, metric=None).fit(walks())


@pytest.mark.parametrize(("name", "label"), [("hdm05", "depositFloorR"), ("utkinect", "standUp")])
def test_no_warning_for_recordings_and_principal_components(name, label, request):
    bunch = request.getfixturevalue(name)
    X = [bunch.data[i] for i in np.flatnonzero(bunch.target == label)[:12]]
    cosines = DirectionCosines(bunch.skeleton).fit_transform(X)
    for features in (X, cosines, ASpace().fit_transform(cosines), ASpace(2).fit_transform(X)):
        assert is_quiet(features)
