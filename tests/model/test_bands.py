"""Bands of the model, and departures from them."""

import numpy as np
import pandas as pd
import pytest
from sklearn.pipeline import make_pipeline
from sklearn.preprocessing import FunctionTransformer
from sklearn_motionsync import (
    ActionModel,
    ASpace,
    DenseSynchronizer,
    DirectionCosines,
    to_frame,
)
from sklearn_motionsync.datasets import make_bending
from sklearn_motionsync.model import find_departures
from sklearn_motionsync.model.variation import (
    mean_band,
    predictive_variance,
    simultaneous_factor,
)
from test_variation import people

X, GROUPS = people([3] * 8, 2, n_frames=30)
MODEL = ActionModel().fit(X, groups=GROUPS)


def test_bands_of_the_model_equal_those_of_the_functions():
    variance = predictive_variance(X, GROUPS)
    np.testing.assert_allclose(MODEL.predictive_variance_, variance)
    factor = simultaneous_factor(X, GROUPS, 0.95)
    np.testing.assert_allclose(MODEL.simultaneous_factor(), factor)
    bands = [
        (MODEL.envelope(), 3 * X.std(axis=0)),
        (MODEL.envelope(simultaneous=True), factor * np.sqrt(variance)),
        (MODEL.mean_envelope(random_state=3), mean_band(X, GROUPS, 0.95, 3)),
    ]
    for (lower, upper), half in bands:
        np.testing.assert_allclose(upper - lower, 2 * half)
        np.testing.assert_allclose(upper + lower, 2 * X.mean(axis=0))
    other = ActionModel(coverage=0.8).fit(X, groups=GROUPS)
    expected = simultaneous_factor(X, GROUPS, 0.8)
    np.testing.assert_allclose(other.simultaneous_factor(), expected)


# -- departures -------------------------------------------------------------------------


def departing():
    """The mean, and two that leave it: one at two places, one in both features."""
    std = np.sqrt(MODEL.predictive_variance_)
    two, both = MODEL.mean_.copy(), MODEL.mean_.copy()
    two[3:6, 0] += 30 * std[3:6, 0]
    two[4, 0] += std[4, 0]
    two[20:30, 0] -= 50 * std[20:30, 0]
    two[25, 0] -= std[25, 0]
    both[7] += [20, -40] * std[7]
    return [MODEL.mean_, two, both]


def test_departures_are_runs_of_frames_the_worst_first():
    table = find_departures(MODEL, departing())
    rows = [
        (1, "x0", 20, 29, 25, -51),
        (1, "x0", 3, 5, 4, 31),
        (2, "x1", 7, 7, 7, -40),
        (2, "x0", 7, 7, 7, 20),
    ]
    names = ["trial", "feature", "first", "last", "peak", "deviation"]
    expected = pd.DataFrame(rows, columns=names).assign(rare=True, timing=False)
    expected = expected.assign(kind="value", unit="")
    pd.testing.assert_frame_equal(
        table[expected.columns], expected, check_dtype=False, check_like=True, rtol=1e-9
    )
    assert table["direction"].tolist() == ["lower", "higher", "lower", "higher"]
    # Without a synchronizer frames of the recording are those of the model.
    for of_recording, of_model in (("start", "first"), ("end", "last")):
        assert table[of_recording].tolist() == table[of_model].tolist()
    assert table[["start_time", "end_time", "limb", "region"]].isna().all(axis=None)
    # In the unit of the feature.
    std = np.sqrt(MODEL.predictive_variance_)
    sizes = [-50 * std[20:30, 0].mean(), 30 * std[3:6, 0].mean(), -40 * std[7, 1], 20 * std[7, 0]]
    np.testing.assert_allclose(table["size"], sizes, rtol=0.03)
    assert table.dtypes[["trial", "first", "last", "peak"]].eq(np.int64).all()


def test_departures_of_chosen_features_and_limits():
    """Features are listed by size, whatever their order was."""
    for given, expected in (
        ({"features": 0}, ["x0", "x0", "x0"]),
        ({"features": "x1"}, ["x1"]),
        ({"features": [1, 0]}, ["x0", "x0", "x1", "x0"]),
        ({"limit": 35}, ["x0", "x1"]),
    ):
        assert find_departures(MODEL, departing(), **given)["feature"].tolist() == expected
    none = find_departures(MODEL, departing(), limit=1e6)
    assert len(none) == 0
    assert list(none.columns) == list(find_departures(MODEL, departing()).columns)


def test_few_new_people_have_rare_departures():
    new, _ = people([1] * 100, 77, n_frames=30)
    table = find_departures(MODEL, new)
    of_some = table.groupby("trial")["rare"].any()
    # Two in three people have evidence that is listed, and 5 % rare evidence.
    assert 0.3 * 100 < len(of_some) < 0.8 * 100
    assert of_some.sum() < 0.12 * 100


@pytest.fixture(scope="module")
def pipe():
    bunch = make_bending(12, n_frames=40, random_state=0)
    steps = DirectionCosines(bunch.skeleton), ASpace(0.95), DenseSynchronizer(30), ActionModel()
    return bunch, make_pipeline(*steps).fit(bunch.data, actionmodel__groups=bunch.actor)


def test_departures_of_a_pipeline_are_those_of_limbs(pipe):
    """A bend in which the left arm is lifted for a while."""
    bunch, pipe = pipe
    x = bunch.data[0].reshape(len(bunch.data[0]), -1, 3).copy()
    joint = {name: i for i, name in enumerate(bunch.skeleton.joints)}
    middle = slice(int(0.4 * len(x)), int(0.6 * len(x)))
    arm = x[middle, joint["left_elbow"]] - x[middle, joint["left_shoulder"]]
    lifted = np.linalg.norm(arm, axis=1)[:, np.newaxis] * [0, 1, 0]
    for name in ("left_elbow", "left_wrist"):
        x[middle, joint[name]] += lifted - arm
    table = find_departures(pipe, [bunch.data[0], x.reshape(len(x), -1)])
    # Though it is no movement of the four-dimensional aSpace.
    rare = table[table["rare"]]
    assert set(rare["trial"]) == {1}
    assert set(rare["feature"]) <= {
        f"left_{limb}_{axis}" for limb in ("arm", "forearm") for axis in "xyz"
    }
    assert 8 < rare.iloc[0]["peak"] < 22
    own = find_departures(pipe, [x.reshape(len(x), -1)], features=["aspace0", "aspace1"], limit=1)
    assert set(own["feature"]) <= {"aspace0", "aspace1"}


def test_departures_keep_the_labels_of_trials():
    model = ActionModel().fit(to_frame(X, columns=["hip", "knee"]), groups=GROUPS)
    table = to_frame(departing()[:2], columns=["hip", "knee"], trials=["walk", "run"])
    found = find_departures(model, table)
    assert set(found["trial"]) == {"run"}
    assert set(found["feature"]) == {"hip"}


@pytest.mark.parametrize("limit", [0, -1, np.inf, np.nan, "3", True])
def test_find_departures_refuses_invalid_limits(limit):
    with pytest.raises(ValueError, match="limit must be a number above 0, or None"):
        find_departures(MODEL, X, limit=limit)


def test_departures_behind_an_unknown_step_are_in_features_of_the_model(pipe):
    bunch, _ = pipe
    steps = DirectionCosines(bunch.skeleton), ASpace(3), FunctionTransformer()
    other = make_pipeline(*steps, DenseSynchronizer(30), ActionModel()).fit(bunch.data)
    found = find_departures(other, bunch.data[:2], limit=1e-3)
    assert found["feature"].nunique() == 3
    with pytest.raises(ValueError, match="no inverse"):
        find_departures(other, bunch.data[:2], features="left_leg_y")
    with pytest.raises(ValueError, match="There is no feature 'elbow'"):
        find_departures(MODEL, X, features="elbow")
    with pytest.raises(ValueError, match="no ActionModel in ASpace"):
        find_departures(ASpace(2).fit(X), X)
