"""Joint positions against closed forms and a slow computation, and in a union with cosines."""

import math
from statistics import median

import numpy as np
import pandas as pd
import pytest
from sklearn import clone, config_context
from sklearn.pipeline import make_union
from sklearn_motionsync import (
    DirectionCosines,
    JointPositions,
    Skeleton,
    to_frame,
    to_trials,
)
from sklearn_motionsync.datasets import load_trials, make_bending

from made_bodies import standing

PAPER = Skeleton.paper()
LANDMARKS = list(PAPER.joints)[1:]


def places(body, reference="heading"):
    """Landmark: where it is, of a body of one pose."""
    features = JointPositions(PAPER, reference).fit_transform([np.vstack([body, body])])[0][0]
    return dict(zip(LANDMARKS, map(tuple, features.reshape(14, 3).round(9) + 0.0), strict=True))


# -- closed forms -------------------------------------------------------------------------


@pytest.mark.parametrize("size", [1, 2.5])
@pytest.mark.parametrize("reference", ["heading", "world"])
def test_positions_of_a_known_body(reference, size):
    """Its legs are 1 long, and it looks along z."""
    at = places(
        size * standing(left_wrist=(0.2, 1.2, 0.3), right_ankle=(-0.1, 0.5, -0.5)), reference
    )
    assert at["neck"] == (0, 0.5, 0)
    assert at["head"] == (0, 0.7, 0)
    assert at["left_hip"] == (0.1, 0, 0)
    assert at["left_ankle"] == (0.1, -1, 0)
    assert at["left_wrist"] == (0.2, 0.2, 0.3)
    assert at["right_ankle"] == (-0.1, -0.5, -0.5)


@pytest.mark.parametrize("dtype", [float, "f4"])
def test_unit_is_the_median_leg_of_the_trial(dtype):
    """Of several poses, some of them with legs that are measured too long."""
    long = standing(left_ankle=(0.1, -3, 0), right_ankle=(-0.1, -3, 0))
    X = np.vstack([long, standing(), standing(), standing(), long]).astype(dtype)
    features = JointPositions(PAPER).fit_transform([2 * X])[0]
    assert features.dtype == dtype
    np.testing.assert_allclose(features[:, 3 * LANDMARKS.index("neck") + 1], 0.5, rtol=1e-6)
    np.testing.assert_allclose(features[0, -2], -4, rtol=1e-6)


def test_transform_needs_nothing_of_fit_without_gaps(bending):
    fitted = JointPositions(bending.skeleton).fit(bending.data[:2])
    stored = {name for name in vars(fitted) if name.endswith("_")}
    assert stored == {"n_features_in_", "limb_lengths_"}
    other = clone(fitted).fit([3 * x for x in bending.data[2:]])
    for x, y in zip(fitted.transform(bending.data), other.transform(bending.data), strict=True):
        np.testing.assert_array_equal(x, y)


def test_other_joints_have_no_influence(bends):
    x = bends.data[0].reshape(-1, 31, 3).copy()
    expected = JointPositions(bends.skeleton).fit_transform([x.reshape(len(x), -1)])[0]
    others = [j for j, name in enumerate(bends.skeleton.joints)
              if name not in bends.skeleton.landmarks.values()]  # fmt: skip
    x[:, others] += 5
    changed = JointPositions(bends.skeleton).fit_transform([x.reshape(len(x), -1)])[0]
    np.testing.assert_array_equal(changed, expected)


# -- real people --------------------------------------------------------------------------


def slowly(x, skeleton, reference):
    """Frame by frame, joint by joint, the heading as an angle."""
    frames = [
        {name: frame.reshape(-1, 3)[skeleton.joints.index(joint)].tolist()
         for name, joint in skeleton.landmarks.items()}
        for frame in x
    ]  # fmt: skip
    segments = [(f"{side}_{a}", f"{side}_{b}") for side in ("left", "right")
                for a, b in (("hip", "knee"), ("knee", "ankle"))]  # fmt: skip
    leg = sum(median(math.dist(at[a], at[b]) for at in frames) for a, b in segments) / 2
    rows = []
    for at in frames:
        (rx, _, rz), (lx, _, lz) = at["right_hip"], at["left_hip"]
        angle = math.atan2(lz - rz, lx - rx) if reference == "heading" else 0
        cos, sin = math.cos(angle) / leg, math.sin(angle) / leg
        row = []
        for name in LANDMARKS:
            dx, dy, dz = (p - q for p, q in zip(at[name], at["pelvis"], strict=True))
            row += [dx * cos + dz * sin, dy / leg, dz * cos - dx * sin]
        rows.append(row)
    return np.array(rows)


@pytest.fixture(params=["hdm05/hdm05", "utkinect/utkinect"])
def people(request, real_data):
    """A skeleton, and a clip of each of several people and actions."""
    bunch = load_trials(real_data / f"{request.param}_positions.npz")
    return bunch.skeleton, [x.astype(float) for x in bunch.data[::17]]


@pytest.mark.parametrize("reference", ["heading", "world"])
def test_features_of_people_equal_a_slow_computation(people, reference):
    skeleton, X = people
    found = JointPositions(skeleton, reference).fit_transform(X)
    for features, x in zip(found, X, strict=True):
        np.testing.assert_allclose(features, slowly(x, skeleton, reference), atol=1e-12)


# -- side by side with the cosines --------------------------------------------------------

BUNCH = make_bending(8, n_frames=40, random_state=3)
EQUAL = [x[:30] for x in BUNCH.data]
NAMES = BUNCH.skeleton.column_names
LABELS = [f"{actor} {take}" for actor, take in zip(BUNCH.actor, BUNCH.take, strict=True)]


def views():
    return make_union(DirectionCosines(BUNCH.skeleton), JointPositions(BUNCH.skeleton))


def in_pandas():
    return views().set_output(transform="pandas")


def expected_of(X):
    both = DirectionCosines(BUNCH.skeleton), JointPositions(BUNCH.skeleton)
    return [np.hstack(pair) for pair in zip(*(e.fit_transform(X) for e in both), strict=True)]


@pytest.mark.parametrize(
    ("X", "plain"),
    [
        (BUNCH.data, BUNCH.data),
        (EQUAL, EQUAL),
        (np.stack(EQUAL), EQUAL),
        ([pd.DataFrame(x, columns=NAMES) for x in BUNCH.data], BUNCH.data),
        (to_frame(BUNCH.data, trials=LABELS, columns=NAMES), BUNCH.data),
        ([x.astype("f4") for x in BUNCH.data], [x.astype("f4") for x in BUNCH.data]),
    ],
    ids=["list", "equal lengths", "3-D", "frames", "MultiIndex", "float32"],
)
def test_union_of_both_features_of_every_kind_of_collection(X, plain):
    fitted = in_pandas().fit(X)
    with config_context(transform_output="pandas"):
        everywhere = views().fit_transform(X)
    for table in (fitted.transform(X), in_pandas().fit_transform(X), everywhere):
        assert list(table.columns) == list(fitted.get_feature_names_out())
        assert table.index.names == ["trial", "frame"]
        if isinstance(X, pd.DataFrame):
            assert table.index.equals(X.index)
        for found, right in zip(to_trials(table), expected_of(plain), strict=True):
            assert found.shape[1] == 79
            assert set(found.dtypes) == {plain[0].dtype}
            np.testing.assert_array_equal(found, right)


def test_feature_names_of_a_union_are_unique():
    names = list(in_pandas().fit(BUNCH.data).get_feature_names_out())
    assert len(set(names)) == 79
    assert {"directioncosines__neck_x", "jointpositions__neck_x"} < set(names)


def test_union_without_pandas_output_refuses_trials():
    for X in (BUNCH.data, EQUAL, np.stack(EQUAL)):
        with pytest.raises(ValueError, match=r"shape|dimension"):
            views().fit_transform(X)
    rows = views().fit_transform(BUNCH.data[0])
    np.testing.assert_array_equal(rows, expected_of(BUNCH.data[:1])[0])
