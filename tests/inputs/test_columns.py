"""Columns of positions: one parser of the spellings of all programs."""

import numpy as np
import pandas as pd
import pytest
from sklearn_motionsync.inputs.columns import find_clock, parse_columns

JOINTS = ["LeftHip", "R_Knee 2", "New 0001", "V.Sacral", "Ann:LASI", "x", "Vis"]


@pytest.mark.parametrize("axes", ["xy", "xyz"])
@pytest.mark.parametrize(
    "spelling",
    ["{}_{}", "{} {}", "{}.{}", "{}:{}", "{}[{}]", "{} ({})", "{}-{}", "{}_{} (mm)", "{}_pos_{}"]
    + ["{1}_{0}", "{1} {0}", "{1}.{0}"],
)
@pytest.mark.parametrize("case", [str.lower, str.upper])
def test_joints_and_axes_of_every_spelling(spelling, axes, case):
    tails = [*axes, "likelihood", "error"]
    labels = [spelling.format(joint, case(tail)) for joint in JOINTS for tail in tails]
    order = np.random.default_rng(0).permutation(len(labels))
    found = parse_columns(["frame", *(labels[i] for i in order), "instance.score"])
    assert sorted(found.joints) == sorted(JOINTS)
    assert found.axes == axes
    for k, joint in enumerate(found.joints):
        first = len(tails) * JOINTS.index(joint)
        expected = [1 + order.tolist().index(first + i) for i in range(len(tails))]
        assert [*found.places[k], found.confidence[k]] == expected[:-1]
    assert found.rest == [0, 1 + len(labels)]
    assert found.units == ("mm" if "mm" in spelling else None)


@pytest.mark.parametrize(
    ("labels", "joints"),
    [
        ("LASIX LASIY LASIZ RASIX RASIY RASIZ", "LASI RASI"),
        ("noseX noseY noseConfidence", "nose"),
        ("x0 y0 z0 v0 x1 y1 z1 v1", "0 1"),
        ("JOINT_LEFT_HIP.real.x JOINT_LEFT_HIP.real.y JOINT_LEFT_HIP.real.z", "JOINT_LEFT_HIP"),
        ("a_x a_y a_x a_y", "a a"),
        # A quaternion, an acceleration, an angle, and joints without all axes are no positions.
        ("q_w q_x q_y q_z leftAcc_x leftAcc_y leftAcc_z b_x b_y b_z c_x c_y d_x", "b"),
        ("knee_angle_x knee_angle_y knee_angle_z", ""),
        ("x y z max may knee_flexion time", ""),
    ],
)
def test_joints_of_lists_of_columns(labels, joints):
    found = parse_columns(labels.split())
    assert found.joints == joints.split()
    there = {*found.places.flat, *found.confidence, *found.rest} - {-1}
    assert there == set(range(len(labels.split())))


def test_labels_of_several_levels():
    animals, joints, tails = ["m1", "m2"], ["nose", "paw"], ["x", "y", "likelihood"]
    for levels in ([joints, tails], [["net"], joints, tails], [["net"], animals, joints, tails]):
        columns = pd.MultiIndex.from_product(levels)
        found = parse_columns([("frame",) + ("",) * (columns.nlevels - 1), *columns])
        n = 2 * len(levels[-3]) if len(levels) > 2 else 2
        assert (found.axes, found.joints) == ("xy", ["nose", "paw"] * (n // 2))
        assert found.subjects == (["m1", "m1", "m2", "m2"] if n == 4 else ["", ""])
        np.testing.assert_array_equal(found.places, 3 * np.arange(n)[:, None] + [1, 2])
        assert found.confidence == [3 * k + 3 for k in range(n)]
        assert found.rest == [0]


def test_of_several_qualities_the_best_is_the_confidence():
    found = parse_columns(
        ["a_x", "a_y", "a_presence", "a_visibility", "b_x", "b_y", "b_error", "c_x", "c_y"]
    )
    assert (found.confidence, found.rest) == ([3, -1, -1], [])


@pytest.mark.parametrize(
    ("labels", "clock"),
    [
        (["a_x", "frame", "t"], (1, 2, None)),
        (["Frame#", "Time (ms)"], (0, 1, 1e-3)),
        (["timestamp_ms", "fnum"], (1, 0, 1e-3)),
        (["Time (Seconds)", "timer"], (None, 0, 1.0)),
        (["milliseconds", "frame_idx"], (1, 0, 1e-3)),
        (["frametime", "times_x"], (None, None, None)),
        ([("frame", "", ""), ("net", "a", "x")], (0, None, None)),
    ],
)
def test_columns_of_frames_and_times(labels, clock):
    assert find_clock(labels) == clock
