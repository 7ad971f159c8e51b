"""Known skeletons: their joints, how their names are recognised, and their bodies."""

import numpy as np
import pandas as pd
import pytest
from sklearn_motionsync import Skeleton
from sklearn_motionsync.body.formats import FORMATS
from sklearn_motionsync.datasets import make_bending

from made_bodies import columns_of

PAPER = Skeleton.paper()
# Number of joints, some joints by their index, the vertical axis in space, and some landmarks.
EXPECTED = {
    "paper": (15, {0: "pelvis"}, "y", {}),
    "acclaim": (31, {0: "root"}, "y", {"left_knee": "lfemur"}),
    "kinect": (20, {3: "Head", 19: "FootRight"}, "y", {"neck": "ShoulderCenter"}),
    "kinect_v2": (
        25,
        {0: "SpineBase", 4: "ShoulderLeft", 16: "HipRight", 20: "SpineShoulder", 24: "ThumbRight"},
        "y",
        {"pelvis": "SpineBase", "neck": "SpineShoulder", "right_ankle": "AnkleRight"},
    ),
    "openpose": (
        25,
        {0: "Nose", 4: "RWrist", 8: "MidHip", 14: "LAnkle", 18: "LEar", 19: "LBigToe", 24: "RHeel"},
        "y",
        {"pelvis": "MidHip", "neck": "Neck", "head": "Nose", "left_hip": "LHip"},
    ),
    "coco": (
        17,
        {0: "nose", 5: "left_shoulder", 16: "right_ankle"},
        "y",
        {"pelvis": ("left_hip", "right_hip"), "neck": ("left_shoulder", "right_shoulder")},
    ),
    "mediapipe": (
        33,
        {0: "nose", 8: "right_ear", 11: "left_shoulder", 23: "left_hip", 32: "right_foot_index"},
        "-y",
        {"pelvis": ("left_hip", "right_hip"), "head": "nose", "left_wrist": "left_wrist"},
    ),
    "plug_in_gait": (15, {0: "PELO", 1: "LHJC"}, "z", {"left_elbow": "LEJC", "neck": "TRXO"}),
}  # fmt: skip


@pytest.mark.parametrize("name", FORMATS)
def test_joints_landmarks_axes_and_repr(name):
    assert name in EXPECTED, f"The format {name!r} lacks an entry in EXPECTED of {__file__}."
    count, places, up, landmarks = EXPECTED[name]
    skeleton = getattr(Skeleton, name)()
    assert (len(skeleton.joints), skeleton.up, skeleton.n_dims) == (count, up, 3)
    assert {j: skeleton.joints[j] for j in places} == places
    assert skeleton.landmarks == {**skeleton.landmarks, **landmarks}
    assert len(skeleton.limbs) == 12
    assert skeleton.parents.count(-1) <= 3
    picture, other = (getattr(Skeleton, name)(**each) for each in ({"n_dims": 2}, {"up": "-x"}))
    assert (picture.joints, picture.landmarks) == (skeleton.joints, skeleton.landmarks)
    assert picture.up == ("y" if name in ("paper", "acclaim") else "-y")
    assert picture.column_names[:2] == [f"{skeleton.joints[0]}_x", f"{skeleton.joints[0]}_y"]
    assert len(picture.column_names) == 2 * len(skeleton.joints)
    assert other.up == "-x"
    # The repr is the constructor, where there is one.
    assert repr(skeleton) == f"Skeleton.{name}()"
    assert repr(picture) == f"Skeleton.{name}(n_dims=2)"
    assert repr(other).startswith("Skeleton(<")


@pytest.mark.parametrize(
    ("name", "spelling", "n_dims"),
    [
        *((name, str.lower, 3) for name in FORMATS),
        *((name, "subject 1:{}".format, 2) for name in FORMATS),
        ("kinect", str.upper, 3),
        ("openpose", str, 2),
    ],
)
def test_landmarks_are_recognised_in_any_spelling_and_among_other_joints(name, spelling, n_dims):
    known = getattr(Skeleton, name)(n_dims=n_dims)
    # A synthetic person as the format shows it: other joints lie at the neck.
    (x,) = make_bending(1, random_state=1).data
    points = dict(zip(PAPER.joints, np.moveaxis(x.reshape(-1, 15, 3), 1, 0), strict=True))
    at = {j: points[n] for n, j in known.landmarks.items() if isinstance(j, str)}
    places = [at.get(joint, points["neck"])[:, :n_dims] for joint in known.joints]
    df = columns_of(np.concatenate(places, axis=1), known)
    names = [spelling(joint) for joint in known.joints]
    as_written = dict(zip(known.joints, names, strict=True))
    axes = "xyz"[:n_dims]
    df.columns = [f"{joint}_{axis}" for joint in names for axis in axes]
    df[[f"{spelling('Extra')}_{axis}" for axis in axes]] = 0.0
    expected = {
        landmark: as_written[at] if isinstance(at, str) else tuple(as_written[j] for j in at)
        for landmark, at in known.landmarks.items()
    }
    skeleton = Skeleton.from_frame(df)
    assert skeleton.landmarks == expected
    assert (skeleton.up, skeleton.n_dims) == ("y", n_dims)
    assert Skeleton(skeleton.joints, skeleton.parents).landmarks == expected


@pytest.mark.parametrize(
    ("joints", "landmarks"),
    [
        # Joint centres alone, as of a lower body.
        ("LHJC RHJC LKJC RKJC LAJC RAJC", {"pelvis": ("LHJC", "RHJC"), "left_knee": "LKJC"}),
        ("PELO LFEP RFEP LFEO RFEO LTIO RTIO", {"left_hip": "LFEP", "left_ankle": "LTIO"}),
        ("Hip LThigh RThigh LShin RShin LFoot RFoot", {"pelvis": "Hip", "right_hip": "RThigh"}),
        # Segments named after their near ends.
        ("pelvis head l_thigh r_thigh l_shank r_shank l_foot r_foot l_uarm r_uarm l_larm r_larm",
         {"left_knee": "l_shank", "right_elbow": "r_larm", "left_ankle": "l_foot"}),
        ("Hips Spine Head LeftUpLeg RightUpLeg LeftLeg RightLeg LeftShoulder RightShoulder LeftArm "
         "RightArm", {"left_shoulder": "LeftArm", "right_knee": "RightLeg", "pelvis": "Hips"}),
        # A key-point format with a neck and a head of its own.
        ("left_shoulder right_shoulder left_elbow right_elbow nose head neck",
         {"neck": "neck", "head": "head"}),
        ("LShoulder RShoulder LElbow RElbow LEar REar", {"head": ("LEar", "REar")}),
        ("LShoulder RShoulder LElbow RElbow HeadTop", {"head": "HeadTop"}),
        ("LFHD RFHD LBHD RBHD C7 CLAV LSHO LELB LWRA LWRB LFIN RSHO RELB RWRA RWRB RFIN",
         {"neck": ("LSHO", "RSHO"), "head": ("LFHD", "RFHD"), "left_elbow": "LELB",
          "right_wrist": ("RWRA", "RWRB")}),
    ],
)  # fmt: skip
def test_landmarks_of_other_names_are_guessed(joints, landmarks):
    joints = joints.split()
    df = pd.DataFrame(0.0, index=[0], columns=[f"{j}_{a}" for j in joints for a in "xyz"])
    found = Skeleton.from_frame(df).landmarks
    assert found == {**found, **landmarks}
