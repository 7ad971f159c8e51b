"""Joint positions against closed forms, and against a slow computation on people."""

import math
from statistics import median

import numpy as np
import pytest
from sklearn_motionsync import JointPositions, Skeleton

from made_bodies import standing

PAPER = Skeleton.paper()
LANDMARKS = list(PAPER.joints)[1:]


# -- closed forms -------------------------------------------------------------------------


@pytest.mark.parametrize("size", [1, 2.5])
@pytest.mark.parametrize("reference", ["heading", "world"])
def test_positions_of_a_known_body(reference, size):
    """Its legs are 1 long, and it looks along z."""
    body = size * standing(left_wrist=(0.2, 1.2, 0.3), right_ankle=(-0.1, 0.5, -0.5))
    features = JointPositions(PAPER, reference).fit_transform(np.vstack([body, body]))[0]
    places = (features.reshape(14, 3).round(9) + 0.0).tolist()
    at = dict(zip(LANDMARKS, map(tuple, places), strict=True))
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


@pytest.mark.parametrize("people", ["hdm05", "utkinect"])
@pytest.mark.parametrize("reference", ["heading", "world"])
def test_features_of_people_equal_a_slow_computation(request, people, reference):
    """A clip of each of several people and actions."""
    bunch = request.getfixturevalue(people)
    X = [x.astype(float) for x in bunch.data[::17]]
    found = JointPositions(bunch.skeleton, reference).fit_transform(X)
    for features, x in zip(found, X, strict=True):
        np.testing.assert_allclose(features, slowly(x, bunch.skeleton, reference), atol=1e-12)
