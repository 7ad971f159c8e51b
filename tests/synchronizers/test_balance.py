"""DenseSynchronizer warns of a feature with nearly all of the compared energy."""

import warnings

import numpy as np
import pandas as pd
import pytest
from sklearn.pipeline import make_pipeline
from sklearn.preprocessing import StandardScaler
from sklearn_motionsync import ASpace, DenseSynchronizer, DirectionCosines, FrameWise
from sklearn_motionsync.synchronizers import training

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
