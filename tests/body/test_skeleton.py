"""Skeletons of what was read, and how they show themselves."""

import pandas as pd
import pytest
from sklearn.base import clone
from sklearn_motionsync import DirectionCosines, Skeleton


def positions_of(skeleton, **attrs):
    df = pd.DataFrame(0.0, index=range(2), columns=skeleton.column_names)
    df.attrs = attrs
    return df


def without(df, *joints):
    return df.drop(columns=[f"{name}_{axis}" for name in joints for axis in "xyz"])


def test_skeleton_of_a_frame():
    known = Skeleton.acclaim()
    attrs = {"joints": list(known.joints), "parents": list(known.parents), "up": "z"}
    skeleton = Skeleton.from_frame(positions_of(known, **attrs))
    assert skeleton.parents == known.parents
    assert skeleton.landmarks == known.landmarks
    assert skeleton.up == "z"
    assert Skeleton.from_frame(positions_of(known, **attrs), up="y") == known
    bare = Skeleton.from_frame(positions_of(known))
    assert set(bare.parents) == {-1}
    assert bare.up == "y"
    assert Skeleton.from_frame(positions_of(known, up=None)).up == "y"


def test_skeleton_of_some_columns():
    """The parent is the nearest ancestor that is left."""
    known = Skeleton.acclaim()
    df = positions_of(known, joints=list(known.joints), parents=list(known.parents))
    gone = ("lowerback", "upperback", "lfoot", "lhipjoint")
    with pytest.raises(ValueError, match=r"landmarks \['left_hip'\]; give landmarks="):
        Skeleton.from_frame(without(df, *gone))
    skeleton = Skeleton.from_frame(without(df, *gone), landmarks={"left_hip": "lfemur"})
    assert skeleton.landmarks == known.landmarks | {"left_hip": "lfemur"}
    parent = dict(zip(skeleton.joints, skeleton.parents, strict=True))
    for name, above in (("thorax", "root"), ("ltoes", "ltibia"), ("lfemur", "root")):
        assert skeleton.joints[parent[name]] == above
    assert parent["root"] == -1
    # Without attrs, the landmarks' names alone tell whose they are.
    assert Skeleton.from_frame(without(positions_of(known), "ltoes")).landmarks == known.landmarks


def test_skeleton_with_some_landmarks():
    known = Skeleton.paper()
    df = positions_of(known).rename(columns=lambda c: c.replace("pelvis", "bottom"))
    with pytest.raises(ValueError, match=r"landmarks \['pelvis'\]; give landmarks="):
        Skeleton.from_frame(df)
    skeleton = Skeleton.from_frame(df, landmarks={"pelvis": "bottom", "left_hip": "right_hip"})
    assert skeleton.landmarks == known.landmarks | {"pelvis": "bottom", "left_hip": "right_hip"}
    with pytest.raises(ValueError, match=r"landmarks must be among .* got \['nose'\]"):
        Skeleton.from_frame(df, landmarks={"nose": "head"})
    with pytest.raises(ValueError, match=r"columns must be .* select them with df\[skeleton"):
        Skeleton.from_frame(df.iloc[:, 1:])


def test_skeleton_of_renamed_columns():
    known, paper = Skeleton.acclaim(), Skeleton.paper()
    df = positions_of(paper, joints=list(known.joints), parents=list(known.parents))
    assert Skeleton.from_frame(df).landmarks == paper.landmarks


def test_parents_in_a_circle():
    df = positions_of(Skeleton.paper(), joints=["p", "q", "head"], parents=[1, 0, 0])
    assert Skeleton.from_frame(df).parents[2] == -1


def test_a_short_repr():
    for name in ("acclaim", "kinect", "paper"):
        skeleton = getattr(Skeleton, name)()
        assert repr(skeleton) == f"Skeleton.{name}()"
        assert repr(DirectionCosines(skeleton)) == f"DirectionCosines(skeleton=Skeleton.{name}())"
    known = Skeleton.paper()
    other = Skeleton(known.joints, known.parents, known.landmarks, "z")
    assert repr(other) == "Skeleton(<15 joints>, up='z')"
    assert clone(DirectionCosines(other)).skeleton == other
