"""The mirror image: left and right exchanged, by landmarks and by names, of any kind of input."""

import re

import numpy as np
import pandas as pd
import polars as pl
import pytest
from sklearn_motionsync import DirectionCosines, Skeleton, to_frame
from sklearn_motionsync.body import mirror
from sklearn_motionsync.body.formats import FORMATS
from sklearn_motionsync.body.mirror import exchange_of_sides
from sklearn_motionsync.datasets import make_bending

from made_bodies import columns_of

PAPER = Skeleton.paper()
BUNCH = make_bending(3, random_state=1)


def other_side(name):
    side, _, part = name.partition("_")
    return {"left": f"right_{part}", "right": f"left_{part}"}.get(side, name)


@pytest.mark.parametrize("reference", ["heading", "parent", "world"])
def test_cosines_of_the_mirror_image_are_those_of_the_other_side(reference):
    for landmarks in (PAPER.joints, [j for j in PAPER.joints if j.endswith(("hip", "knee"))]):
        skeleton = Skeleton(PAPER.joints, PAPER.parents, {j: j for j in landmarks})
        cosines = DirectionCosines(skeleton, reference).set_output(transform="pandas")
        plain = cosines.fit_transform(BUNCH.data)
        mirrored = cosines.fit_transform(mirror(BUNCH.data, skeleton))
        for name in plain:
            limb, axis = name[:-2], name[-1]
            # Hips and shoulders go from right to left: so does what is seen in the mirror.
            flipped = "yz" if limb in ("hip", "shoulder") else "x"
            sign = -1 if axis in flipped and name != "pelvis_height" else 1
            np.testing.assert_allclose(mirrored[name], sign * plain[other_side(name)], atol=1e-9)


@pytest.mark.parametrize("name", FORMATS)
def test_counterparts_of_all_formats(name):
    skeleton = getattr(Skeleton, name)()
    joints = list(skeleton.joints)
    x = np.random.default_rng(0).normal(size=(4, 3 * len(joints)))
    x.reshape(4, -1, 3)[..., 0] *= [_split(j)[1] != "" for j in joints]
    found = mirror(x, skeleton).reshape(4, -1, 3) * [-1, 1, 1]
    for j, joint in enumerate(joints):
        (same,) = np.flatnonzero((found[:, [j]] == x.reshape(4, -1, 3)).all(axis=(0, 2)))
        assert _split(joints[same])[0] == _split(joint)[0]
        assert (same == j) == (_split(joint)[1] == "")


def _split(joint):
    """A name without its side, and the side, as the formats write them."""
    if joint in ("root", "lowerback", "lowerneck"):
        return joint, ""
    forms = ("(?i)left|right", "_[lr]$", "^[lrLR]")
    side = next((found[0] for form in forms if (found := re.search(form, joint))), "")
    return joint.replace(side, "", 1).lower(), side.strip("_").lower()[:1]


# -- kinds of input -----------------------------------------------------------------------


def test_mirror_returns_the_kind_that_was_given():
    X = BUNCH.data
    expected = mirror(X, PAPER)
    names = PAPER.column_names
    for x, right in zip(X, expected, strict=True):
        np.testing.assert_array_equal(mirror(x, PAPER), right)
        np.testing.assert_array_equal(mirror(x.tolist(), PAPER), right)
        assert mirror(x.astype("f4"), PAPER).dtype == np.float32
    stack = np.stack([x[:40] for x in X])
    np.testing.assert_array_equal(mirror(stack, PAPER), [x[:40] for x in expected])
    table = to_frame(X, trials=["a", "b", "c"], columns=names)
    table.attrs["up"] = "y"
    found = mirror(table, PAPER)
    pd.testing.assert_frame_equal(found, to_frame(expected, trials=["a", "b", "c"], columns=names))
    assert found.attrs == {"up": "y"}
    frames = [columns_of(x).rename_axis("time") for x in X]
    for df, right in zip(mirror(frames, PAPER), expected, strict=True):
        assert (list(df.columns), df.index.name) == (names, "time")
        np.testing.assert_array_equal(df, right)
    # Of polars as well, one and several, in single precision too.
    tables = [pl.DataFrame(dict(zip(names, x.T, strict=True))) for x in (X[0], X[1].astype("f4"))]
    alone, several = mirror(tables[0], PAPER), mirror(tables, PAPER)
    np.testing.assert_array_equal(alone.to_numpy(), expected[0])
    assert [df.schema for df in (alone, *several)] == [df.schema for df in (tables[0], *tables)]
    gap = X[0].copy()
    gap[4, 6:9] = np.nan
    kept = gap.copy()
    assert np.isnan(mirror(gap, PAPER)).sum() == 3
    np.testing.assert_array_equal(gap, kept)


def test_negated_axis_is_horizontal_or_across_the_picture():
    x = BUNCH.data[0]
    for up, axis in (("y", 0), ("z", 0), ("-y", 0), ("-z", 0), ("x", 1)):
        skeleton = Skeleton(PAPER.joints, PAPER.parents, up=up)
        changed = mirror(x, skeleton).reshape(-1, 15, 3)[:, 0] != x.reshape(-1, 15, 3)[:, 0]
        assert changed.any(axis=0).tolist() == [k == axis for k in range(3)]
    skeleton = Skeleton.coco(n_dims=2)
    x = np.random.default_rng(0).normal(size=(5, 34))
    found = mirror(x, skeleton).reshape(5, 17, 2)
    left, right = (skeleton.index_of(f"{side}_ankle") for side in ("left", "right"))
    np.testing.assert_array_equal(found[:, left], x.reshape(5, 17, 2)[:, right] * [-1, 1])
    np.testing.assert_array_equal(found[:, 0], x.reshape(5, 17, 2)[:, 0] * [-1, 1])


# -- markers ------------------------------------------------------------------------------


def with_markers(names, middle=()):
    """A synthetic person with markers at the wrist or in the middle."""
    df = columns_of(BUNCH.data[0])
    for name in names:
        at = "pelvis" if name in middle else "left_wrist"
        for axis in "xyz":
            df[f"{name}_{axis}"] = df[f"{at}_{axis}"]
    return df


@pytest.mark.parametrize(
    ("one", "other"),
    [("LASI", "RASI"), ("l.ASIS_study", "R.ASIS_study"), ("Sub:L_toe", "Sub:R_toe"),
     ("ToeL", "ToeR"), ("mouthLeft", "mouthRight"), ("S:LTOE", "S:RTOE")],
)  # fmt: skip
def test_counterparts_by_name(one, other):
    df = with_markers([one, other])
    df[[f"{other}_{a}" for a in "xyz"]] += 1
    found = mirror(df, Skeleton.from_frame(df))
    np.testing.assert_array_equal(found[f"{one}_y"], df[f"{other}_y"])


def test_joints_of_means_are_paired_in_their_order():
    df = with_markers(["m1", "m2", "m3", "m4"])
    df[[f"m{i}_{a}" for i in (3, 4) for a in "xyz"]] += 1
    given = {"left_ankle": ("m1", "m2"), "right_ankle": ("m3", "m4")}
    found = mirror(df, Skeleton.from_frame(df, landmarks=given))
    np.testing.assert_array_equal(found["m2_y"], df["m4_y"])


def test_landmarks_go_before_names():
    names = ["L_a", "R_a", "L_b", "R_b"]
    df = with_markers(names)
    for i, name in enumerate(names):
        df[f"{name}_y"] += i
    given = {"left_knee": "L_a", "right_knee": "R_b", "left_ankle": "L_b", "right_ankle": "R_a"}
    found = mirror(df, Skeleton.from_frame(df, landmarks=given))
    for left, right in (("L_a", "R_b"), ("L_b", "R_a")):
        np.testing.assert_array_equal(found[f"{left}_y"], df[f"{right}_y"])
        np.testing.assert_array_equal(found[f"{right}_y"], df[f"{left}_y"])


def test_joint_without_counterpart_keeps_its_name_or_is_refused():
    df = with_markers(["RBAK", "C7"], middle=["C7"])
    found = mirror(df, Skeleton.from_frame(df))
    np.testing.assert_array_equal(found[["RBAK_x", "C7_x"]], -df[["RBAK_x", "C7_x"]])
    df = with_markers(["left_toe"])
    with pytest.raises(ValueError, match=r"'left_toe' is on one side, .* Leave its columns out"):
        mirror(df, Skeleton.from_frame(df))
    leg = ["left_hip", "left_knee", "left_ankle"]
    with pytest.raises(ValueError, match="'left_hip' is on one side, and has no"):
        mirror(np.zeros((2, 9)), Skeleton(leg, [-1, 0, 1], {j: j for j in leg}))


def test_mirror_refuses_wrong_input():
    with pytest.raises(ValueError, match=r"15 joints need 45"):
        mirror(np.zeros((4, 30)), PAPER)
    table = columns_of(BUNCH.data[0])
    with pytest.raises(ValueError, match="Trial 1: column 0 is 'neck_x'"):
        mirror([table, table[[*table.columns[3:], *table.columns[:3]]]], PAPER)
    with pytest.raises(ValueError, match="needs the Skeleton of the positions"):
        mirror(BUNCH.data, None)
    with pytest.raises(ValueError, match="Found 0 trials"):
        mirror([], PAPER)


# -- the mirror image of cosines --------------------------------------------------------------


@pytest.mark.parametrize("reference", ["heading", "parent"])
def test_the_exchange_of_cosines_is_that_of_positions(bending, reference):
    cosines = DirectionCosines(bending.skeleton, reference=reference).fit(bending.data)
    x = bending.data[1]
    columns, signs = exchange_of_sides(cosines.get_feature_names_out())
    expected = cosines.transform([mirror(x, bending.skeleton)])[0]
    np.testing.assert_allclose(signs * cosines.transform([x])[0][:, columns], expected, atol=1e-9)


def test_arms_alone_are_exchanged_and_nothing_without_both_sides(bending):
    names = list(DirectionCosines(bending.skeleton).fit(bending.data).get_feature_names_out())
    columns, signs = exchange_of_sides(names, ["left_arm", "right_arm"])
    moved = [names[k] for k in np.flatnonzero(columns != np.arange(len(names)))]
    assert moved == [f"{side}_arm_{axis}" for side in ("left", "right") for axis in "xyz"]
    assert [names[k] for k in np.flatnonzero(signs < 0)] == ["left_arm_x", "right_arm_x"]
    for names in (["a", "b"], ["left_arm_x"], ["torso_x", "torso_y"], []):
        assert exchange_of_sides(names) is None
