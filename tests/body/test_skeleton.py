"""Skeletons: wrong arguments, skeletons of tables, copies and representations."""

import copy
import pickle

import joblib
import numpy as np
import pandas as pd
import pytest
from sklearn.base import clone
from sklearn_motionsync import DirectionCosines, Skeleton
from sklearn_motionsync.datasets import make_bending

from made_bodies import with_still_root


def positions_of(skeleton, **attrs):
    df = pd.DataFrame(0.0, index=range(2), columns=skeleton.column_names)
    df.attrs = attrs
    return df


def without(df, *joints):
    return df.drop(columns=[f"{name}_{axis}" for name in joints for axis in "xyz"])


def test_from_frame_reads_joints_parents_and_up():
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


def test_parent_in_from_frame_is_the_nearest_ancestor_with_columns():
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


def test_given_landmarks_complete_the_guessed_ones():
    known = Skeleton.paper()
    df = positions_of(known).rename(columns=lambda c: c.replace("pelvis", "bottom"))
    assert Skeleton.from_frame(df).landmarks["pelvis"] == ("left_hip", "right_hip")
    skeleton = Skeleton.from_frame(df, landmarks={"pelvis": "bottom", "left_hip": "right_hip"})
    assert skeleton.landmarks == known.landmarks | {"pelvis": "bottom", "left_hip": "right_hip"}
    with pytest.raises(ValueError, match=r"landmarks must be among .* got \['nose'\]"):
        Skeleton.from_frame(df, landmarks={"nose": "head"})
    with pytest.raises(ValueError, match=r"columns must be .* select them with df\[skeleton"):
        Skeleton.from_frame(df.iloc[:, 1:])


def test_attrs_of_other_joints_and_cycles_of_ancestors_tell_nothing():
    known, paper = Skeleton.acclaim(), Skeleton.paper()
    df = positions_of(paper, joints=list(known.joints), parents=list(known.parents))
    assert Skeleton.from_frame(df).landmarks == paper.landmarks
    df = positions_of(paper, joints=["p", "q", "head"], parents=[1, 0, 0])
    assert Skeleton.from_frame(df).parents[2] == -1


def test_repr_is_short():
    cosines = DirectionCosines(Skeleton.kinect())
    assert repr(cosines) == "DirectionCosines(skeleton=Skeleton.kinect())"
    known = Skeleton.paper()
    other = Skeleton(known.joints, known.parents, known.landmarks, "z")
    assert repr(other) == "Skeleton(<15 joints>, up='z')"


# -- wrong arguments ----------------------------------------------------------------------

PAPER = Skeleton.paper()


def with_parents(**parents):
    """The parents of the paper's joints, some of them otherwise."""
    return [parents.get(j, p) for j, p in zip(PAPER.joints, PAPER.parents, strict=True)]


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ((["a", "a"], [-1, 0]), "different joint names"),
        ((["a", "b"], [-1]), "one parent each"),
        ((["a", "b"], [-1, 5]), "parents must be"),
        ((["a", "b"], [-1, 0]), "No joint stands for the landmarks"),
        *(
            ((PAPER.joints, PAPER.parents, None, up), r"up must be among .*'-x'\], got")
            for up in ("w", "-", ["y"], None)
        ),
        (
            (PAPER.joints, PAPER.parents, None, "z", 2),
            r"up must be among \['y', '-y', 'x', '-x'\], got 'z'",
        ),
        *(
            ((PAPER.joints, PAPER.parents, None, "y", n_dims), "n_dims must be 3, or 2 for")
            for n_dims in (1, 4, True, "3", None, [3], 2.5)
        ),
        *(
            ((PAPER.joints, PAPER.parents, {"pelvis": at}), "landmark 'pelvis' must be a joint's")
            for at in (3, ("neck", "neck"), (), ["neck", 1], {"neck"})
        ),
        ((PAPER.joints, PAPER.parents, {"pelvis": ("neck", "tail")}), r"landmarks \['pelvis'\] \("),
        ((PAPER.joints, PAPER.parents, {"pelvis": "pelvis"}), "both ends of one limb"),
        ((PAPER.joints, PAPER.parents, {"pelvis": "tail"}), "'neck'"),
        ((PAPER.joints, PAPER.parents, ["pelvis"]), "landmarks must be a mapping"),
        (
            (PAPER.joints, PAPER.parents, {"nose": "head"}),
            r"landmarks must be among .* got \['nose'\]",
        ),
        *(
            ((joints, PAPER.parents), "joints must be the names")
            for joints in ("pelvis", None, set(PAPER.joints), [*PAPER.joints[:-1], np.nan])
        ),
        *(
            ((PAPER.joints, parents), "parents must be a list")
            for parents in (0, "0" * 15, np.array(0))
        ),
        *(
            ((PAPER.joints, with_parents(head=parent)), "list of whole numbers, the index of each")
            for parent in (1.5, "1", True, np.nan, np.inf, None, np.ma.masked, 1j, [1])
        ),
        ((PAPER.joints, with_parents(pelvis=2)), r"cycle: pelvis > head > neck > pelvis\. The"),
        ((PAPER.joints, with_parents(neck=2)), "cycle: neck > head > neck"),
        ((PAPER.joints, with_parents(head=2)), "cycle: head > head"),
    ],
)
def test_skeleton_refuses_wrong_arguments(arguments, message):
    with pytest.raises(ValueError, match=message):
        Skeleton(*arguments)


def test_from_frame_refuses_wrong_arguments():
    for given in (np.zeros((2, 45)), [[0.0] * 45], None, pd.Series([0.0])):
        with pytest.raises(ValueError, match=r"columns of a DataFrame, got \w+\. Use pd.DataFrame"):
            Skeleton.from_frame(given)
    df = positions_of(PAPER)
    with pytest.raises(ValueError, match=r"joints \['neck'\] are repeated"):
        Skeleton.from_frame(pd.concat([df, df[["neck_x", "neck_y", "neck_z"]]], axis=1))
    with pytest.raises(ValueError, match="landmarks must be a mapping"):
        Skeleton.from_frame(df, landmarks="pelvis")
    with pytest.raises(ValueError, match=r"landmark must be among .* got 'nose'"):
        PAPER.index_of("nose")
    attrs = {"joints": ["head"], "parents": [3]}
    with pytest.raises(ValueError, match="one parent, an index or -1"):
        Skeleton.from_frame(positions_of(PAPER, **attrs))
    for up in ("w", "", np.array(["y", "z"])):
        with pytest.raises(ValueError, match=r"up must be among \['y', 'z', 'x'"):
            Skeleton.from_frame(df, up=up)


# -- skeletons as keys, and copies --------------------------------------------------------


def test_equal_skeletons_have_equal_hashes():
    again = Skeleton(PAPER.joints, PAPER.parents, dict(reversed(PAPER.landmarks.items())))
    other = Skeleton(PAPER.joints, PAPER.parents, up="z")
    assert {PAPER: "paper"}[again] == "paper"
    assert len({PAPER, again, other, Skeleton.kinect()}) == 3


@pytest.mark.parametrize("skeleton", [PAPER, Skeleton.mediapipe(), Skeleton.coco(n_dims=2)])
def test_copies_are_equal(skeleton):
    copies = [copy.copy(skeleton), copy.deepcopy(skeleton), pickle.loads(pickle.dumps(skeleton))]
    copies += [clone(DirectionCosines(skeleton)).skeleton]
    for other in copies:
        assert other == skeleton
        assert hash(other) == hash(skeleton)
        assert joblib.hash(other) == joblib.hash(skeleton)
        with pytest.raises(TypeError, match="does not support item assignment"):
            other.landmarks["head"] = "neck"


def test_a_root_that_stands_still_is_joined_to_nothing_that_moves():
    bunch = make_bending(2, n_frames=30, random_state=0)
    walk = bunch.data[0].reshape(30, -1, 3) + np.arange(30)[:, np.newaxis, np.newaxis] / 50
    walk = walk.reshape(30, -1)
    paper = bunch.skeleton
    bones = [(a + 1, b + 1) for a, b in paper.bones]
    for place in ((0, 0, 0), (5, -3, 200)):
        assert Skeleton.from_frame(with_still_root(walk, paper, place)).bones == bones
    df = with_still_root(walk, paper)
    # One that moves along with the body, one that is a landmark, one at a fixed distance: joined.
    along = df.copy()
    along[["World_x", "World_z"]] = walk[:, [0, 2]]
    hips = with_still_root(walk, paper).rename(columns=lambda name: name.replace("World", "Hips"))
    hips.attrs = df.attrs | {"joints": ["Hips", *paper.joints]}
    still = with_still_root(walk - np.tile(walk[:, :3], 15) + 1, paper)
    expected = (-1, *(p + 1 for p in paper.parents))
    for x, given in ((along, None), (hips, {"pelvis": "Hips"}), (still, None)):
        assert Skeleton.from_frame(x, landmarks=given).parents == expected
