"""Key-points as labs have them: names in any spelling, quality beside them, an axis of joints."""

import numpy as np
import pandas as pd
import pytest
from sklearn_motionsync import DenseSynchronizer, DirectionCosines, JointPositions, Skeleton
from sklearn_motionsync.body import mirror
from sklearn_motionsync.body.columns import plain_positions
from sklearn_motionsync.datasets import make_bending, make_walk
from sklearn_motionsync.display import SkeletonDisplay
from sklearn_motionsync.gait import gait_events
from sklearn_motionsync.io import fill_gaps, find_gaps, read_motion, write_motion

BENDS = make_bending(3, random_state=0)
SKELETON, X = BENDS.skeleton, BENDS.data
JOINTS = list(SKELETON.joints)
LEVELS = pd.MultiIndex.from_product([["net"], JOINTS, ["x", "y", "z", "likelihood"]])
SPELLINGS = ["{}_{}", "{}_{X}", "{} {X}", "{}.{}", "{}:{X}", "{}.{X}", "Ann:{}_{}", "Ann:{} {X}"]


def spelt(x, spelling, joints=JOINTS):
    """A table of positions with these names, and one in two levels of names with qualities."""
    names = [spelling.format(j, a, X=a.upper()) for j in joints for a in "xyz"]
    return pd.DataFrame(x, columns=names)


def with_quality(x, levels=LEVELS):
    """Joints in another order, each with a likelihood that tells its number."""
    n_joints = x.shape[1] // 3
    parts = [np.c_[x[:, 3 * j : 3 * j + 3], np.full(len(x), (j + 1) / 20)] for j in range(n_joints)]
    table = pd.DataFrame(np.hstack(parts), columns=levels)
    return table.iloc[:, np.arange(4 * n_joints).reshape(-1, 4)[::-1].ravel()]


FORMS = [*(lambda x, s=s: spelt(x, s) for s in SPELLINGS), with_quality]
FORMS += [lambda x: x.reshape(len(x), -1, 3)]


@pytest.mark.parametrize("form", FORMS, ids=[*SPELLINGS, "levels", "array"])
def test_positions_of_any_form_are_the_same_positions(form):
    given = [form(x) for x in X]
    for kind in (DirectionCosines, JointPositions):
        expected = kind(SKELETON).fit_transform(X)
        fitted = kind(SKELETON).fit(given)
        for a, b in zip(fitted.transform(given), expected, strict=True):
            np.testing.assert_array_equal(a, b)
        np.testing.assert_array_equal(fitted.transform(given[1]), expected[1])
    for a, b, x in zip(mirror(given, SKELETON), mirror(X, SKELETON), given, strict=True):
        expected = form(b)
        assert np.shape(a) == np.shape(x)
        if isinstance(a, pd.DataFrame):
            places = [k for k, name in enumerate(a.columns) if name[-1] != "likelihood"]
            np.testing.assert_array_equal(a.iloc[:, places], expected.iloc[:, places])
            assert a.columns.equals(x.columns)
        else:
            np.testing.assert_array_equal(a, expected)
    shown, expected = (SkeletonDisplay.from_trials(each, SKELETON) for each in (given, X))
    for a, b in zip(shown.scenes[0], expected.scenes[0], strict=True):
        np.testing.assert_array_equal(a, b)


@pytest.mark.parametrize("form", FORMS[:-1], ids=[*SPELLINGS, "levels"])
def test_tables_of_any_spelling_tell_their_skeleton_and_gaps(form, tmp_path):
    x = X[0].copy()
    x[3:6, 3 * JOINTS.index("left_knee") + 1] = np.nan
    table = form(x)
    skeleton = Skeleton.from_frame(table)
    assert sorted(joint.rpartition(":")[2] for joint in skeleton.joints) == sorted(JOINTS)
    for landmark, joint in skeleton.landmarks.items():
        assert joint.rpartition(":")[2] == landmark
    (gap,) = find_gaps(table).to_dict("records")
    assert (gap["joint"].rpartition(":")[2], gap["first"], gap["last"]) == ("left_knee", 3, 5)
    filled, expected = fill_gaps(table, 5), form(fill_gaps(spelt(x, "{}_{}"), 5).to_numpy())
    pd.testing.assert_frame_equal(filled, expected)
    write_motion(tmp_path / "a.trc", filled, frame_rate=50)
    read = read_motion(tmp_path / "a.trc")
    numbers = form(np.arange(3.0 * len(JOINTS))[np.newaxis]).iloc[0].to_numpy()
    for k, joint in enumerate(JOINTS):
        name = next(name for name in read if name.endswith(f"{joint}_z"))
        place = int(np.argmax(numbers == 3 * k + 2))
        np.testing.assert_allclose(read[name], filled.iloc[:, place], atol=1e-5)


def test_gait_events_of_any_form():
    walk = make_walk(1, random_state=0)
    x, joints = walk.data[0], list(walk.skeleton.joints)
    expected = gait_events(x, walk.skeleton, frame_rate=walk.frame_rate)
    assert len(expected)
    levels = pd.MultiIndex.from_product([["net"], joints, ["x", "y", "z", "likelihood"]])
    whole = spelt(x, "{} {X}", joints), x.reshape(len(x), -1, 3)
    for given in (*whole, with_quality(x, levels)):
        found = gait_events(given, walk.skeleton, frame_rate=walk.frame_rate)
        pd.testing.assert_frame_equal(found, expected)
    found = gait_events(spelt(x, "Ann:{}_{X}", joints), frame_rate=walk.frame_rate)
    assert len(found) == len(expected)


def test_confidence_goes_to_the_other_side_with_its_joint():
    image = mirror(with_quality(X[0]), SKELETON)
    for joint in JOINTS:
        other = joint.replace("left", "LEFT").replace("right", "left").replace("LEFT", "right")
        expected = (JOINTS.index(other) + 1) / 20
        assert (image["net", joint, "likelihood"] == expected).all()


def test_trials_that_were_checked_stay_as_they_are():
    checked = DenseSynchronizer(20).fit(X).check_trials(X)
    assert plain_positions(checked, SKELETON) is checked


def test_stacks_of_arrays_of_joints_are_taken_where_a_skeleton_tells_that_they_fit():
    stack = np.stack([x[:40] for x in X])
    joints = stack.reshape(*stack.shape[:2], -1, 3)
    cosines = DirectionCosines(SKELETON)
    np.testing.assert_array_equal(cosines.fit_transform(joints), cosines.fit_transform(stack))
    image = mirror(joints, SKELETON)
    np.testing.assert_array_equal(image.reshape(stack.shape), mirror(stack, SKELETON))
    refused = (DenseSynchronizer(20), [*joints]), (DenseSynchronizer(20), joints)
    for estimator, given in (*refused, (cosines, [x[:, 1:] for x in joints])):
        with pytest.raises(ValueError, match=r"x\.reshape\(len\(x\), -1\)"):
            estimator.fit(given)


def test_columns_that_are_no_positions_are_named():
    table = spelt(X[0], "{} {X}").assign(force=1.0)
    with pytest.raises(ValueError, match=r"of which \['force'\] are no positions"):
        Skeleton.from_frame(table)
    assert Skeleton.from_frame(table.rename(columns={"force": "Time"})).joints == tuple(JOINTS)
    levels = pd.MultiIndex.from_product([["net"], ["a", "b"], ["nose", "hip"], ["x", "y"]])
    two = pd.DataFrame(np.zeros((2, 8)), columns=levels)
    with pytest.raises(ValueError, match=r"several subjects, \['a', 'b'\]; select"):
        find_gaps(two)
