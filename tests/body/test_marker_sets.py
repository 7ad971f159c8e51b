"""Landmarks of the marker sets of laboratories; those that are expected were written by hand."""

import numpy as np
import pandas as pd
import pytest
from sklearn_motionsync import Skeleton
from sklearn_motionsync.body.landmarks import guess_feet
from sklearn_motionsync.datasets import make_bending

# The names of the left side and of the middle, and what they mean.
SETS = {
    "Plug-in Gait": ("LASI LPSI LTHI LKNE LTIB LANK LHEE LTOE LSHO LELB LWRA LWRB LFIN", {
        "hip": "LASI", "knee": "LKNE", "ankle": "LANK", "shoulder": "LSHO", "elbow": "LELB",
        "wrist": "LWRA LWRB", "pelvis": "LASI RASI LPSI RPSI", "heel": "LHEE", "toe": "LTOE"}),
    "joint centres": ("LHJC LKJC LAJC LASI LPSI LKNE LANK", {
        "hip": "LHJC", "knee": "LKJC", "ankle": "LAJC"}),
    "CGM2": ("LASI LPSI LTHI LKNE LKNM LTIB LANK LMED LHEE LTOE", {
        "hip": "LASI", "knee": "LKNE LKNM", "ankle": "LANK LMED"}),
    "Helen Hayes": ("L.ASIS V.Sacral L.Thigh L.Knee L.Shank L.Ankle L.Heel L.Toe L.Shoulder "
                    "L.Elbow L.Wrist", {
        "hip": "L.ASIS", "knee": "L.Knee", "ankle": "L.Ankle", "shoulder": "L.Shoulder",
        "pelvis": "L.ASIS R.ASIS V.Sacral"}),
    "IOR": ("LASIS LPSIS LGT LLE LME LHF LTT LLM LMM LCA LFM LVM", {
        "hip": "LASIS", "knee": "LLE LME", "ankle": "LLM LMM", "heel": "LCA"}),
    "CAST": ("L_IAS L_IPS L_FTC L_FLE L_FME L_FAL L_TAM L_FCC L_FM1 L_FM2 L_FM5 L_SAE L_HLE L_HME "
             "L_RSP L_USP", {
        "hip": "L_IAS", "knee": "L_FLE L_FME", "ankle": "L_FAL L_TAM", "shoulder": "L_SAE",
        "elbow": "L_HLE L_HME", "wrist": "L_RSP L_USP", "heel": "L_FCC", "toe": "L_FM2",
        "pelvis": "L_IAS R_IAS L_IPS R_IPS"}),
    "Visual3D": ("LASIS LPSIS LLFC LMFC LLMAL LMMAL LLFE", {
        "hip": "LASIS", "knee": "LLFC LMFC", "ankle": "LLMAL LMMAL"}),
    "femoral epicondyles": ("LASI LPSI LLFE LMFE LLM LMM", {
        "knee": "LLFE LMFE", "ankle": "LLM LMM"}),
    "Qualisys Sports": ("HeadL HeadFront LShoulderTop LElbowOut LElbowIn LWristOut LWristIn "
                        "WaistLFront WaistLBack LKneeOut LKneeIn LAnkleOut LAnkleIn LHeelBack "
                        "LForefoot2", {
        "head": "HeadL HeadR", "shoulder": "LShoulderTop", "elbow": "LElbowOut LElbowIn",
        "wrist": "LWristOut LWristIn", "hip": "WaistLFront", "knee": "LKneeOut LKneeIn",
        "ankle": "LAnkleOut LAnkleIn", "heel": "LHeelBack", "toe": "LForefoot2"}),
    "OpenCap": ("L.ASIS_study L.PSIS_study L_knee_study L_mknee_study L_ankle_study "
                "L_mankle_study L_calc_study L_toe_study L_shoulder_study L_lelbow_study "
                "L_melbow_study L_lwrist_study L_mwrist_study LKnee LAnkle", {
        "hip": "L.ASIS_study", "knee": "L_knee_study L_mknee_study",
        "ankle": "L_ankle_study L_mankle_study", "elbow": "L_lelbow_study L_melbow_study",
        "wrist": "L_lwrist_study L_mwrist_study", "shoulder": "L_shoulder_study",
        "heel": "L_calc_study", "toe": "L_toe_study"}),
    "OpenSim": ("L.ASIS V.Sacral L.Acromium L.Elbow L.Wrist.Lat L.Wrist.Med L.Knee.Lat L.Knee.Med "
                "L.Ankle.Lat L.Ankle.Med L.Heel L.Toe.Tip Top.Head", {
        "shoulder": "L.Acromium", "wrist": "L.Wrist.Lat L.Wrist.Med", "head": "Top.Head",
        "knee": "L.Knee.Lat L.Knee.Med", "ankle": "L.Ankle.Lat L.Ankle.Med", "toe": "L.Toe.Tip"}),
    "Pose2Sim": ("LASI LPSI LKneeLat LKneeMed LAnkleLat LAnkleMed LxHeel LBigToe", {
        "knee": "LKneeLat LKneeMed", "ankle": "LAnkleLat LAnkleMed", "heel": "LxHeel"}),
    "OptiTrack": ("HeadTop WaistLFront WaistLBack LShoulderTop LElbowOut LWristOut LWristIn LThigh "
                  "LKneeOut LShin LAnkleOut LToeOut LToeIn LHeel", {
        "head": "HeadTop", "hip": "WaistLFront", "knee": "LKneeOut", "ankle": "LAnkleOut",
        "wrist": "LWristOut LWristIn", "toe": "LToeOut LToeIn", "heel": "LHeel"}),
    "ISB": ("L.ASIS L.PSIS L.LE L.ME L.LM L.MM L.AC L.EL L.EM L.RS L.US", {
        "knee": "L.LE L.ME", "ankle": "L.LM L.MM", "elbow": "L.EL L.EM", "wrist": "L.RS L.US"}),
    "CMU": ("LFWT LBWT LKNE LANK LHEE LTOE LSHO LELB LWRA LWRB LFHD", {
        "hip": "LFWT", "pelvis": "LFWT RFWT LBWT RBWT", "head": "LFHD RFHD"}),
    "side at the end": ("ASISl PSISl KneeLatL KneeMedL AnkleL AcromionL LateralEpicondyleL", {
        "hip": "ASISl", "knee": "KneeLatL KneeMedL", "ankle": "AnkleL", "shoulder": "AcromionL",
        "elbow": "LateralEpicondyleL"}),
    # Bones have their names from their near ends, markers from the middle of a segment.
    "markers on segments": ("LASIS LPSIS LTHIGH LKNE LSHANK LANK LFOREARM LARM LELB", {
        "hip": "LASIS", "knee": "LKNE", "elbow": "LELB", "shoulder": ""}),
}  # fmt: skip


def other(name):
    """A name with its sides exchanged."""
    if name in ("V.Sacral", "Top.Head", "HeadFront", "HeadTop"):
        return name
    k = 0 if name[0] == "L" and name[:3] != "Lat" else len(name) - 1
    k = 5 if name.startswith("Waist") else k
    return name[:k] + {"L": "R", "l": "r"}[name[k]] + name[k + 1 :]


@pytest.mark.parametrize("name", SETS)
@pytest.mark.parametrize("prefix", ["", "Ann:"])
@pytest.mark.parametrize("seed", [None, 0])
def test_landmarks_and_feet_of_marker_sets(name, prefix, seed):
    names, meaning = SETS[name]
    joints = list(dict.fromkeys([*names.split(), *map(other, names.split())]))
    if seed is not None:
        joints = list(np.random.default_rng(seed).permutation(joints))
    skeleton = Skeleton([prefix + joint for joint in joints], [-1] * len(joints))
    found = {**skeleton.landmarks, **guess_feet(skeleton.joints, skeleton.landmarks)}
    for part, expected in meaning.items():
        sides = {"": expected.split()}
        if part not in ("pelvis", "head"):
            sides = {"left": expected.split(), "right": list(map(other, expected.split()))}
        for side, of_side in sides.items():
            at = found.get(f"{side}_{part}".lstrip("_"), ())
            at = (at,) if isinstance(at, str) else at
            assert sorted(at) == sorted(prefix + joint for joint in of_side), (side, part)


def test_markers_that_were_taken_off_after_a_static_trial_stand_for_nothing():
    names = [f"{s}{m}" for s in "LR" for m in ("ASI", "KNE", "KNM", "ANK", "MED")]
    columns = [f"{name}_{axis}" for name in names for axis in "xyz"]
    df = pd.DataFrame(np.random.default_rng(0).random((9, 30)), columns=columns)
    assert Skeleton.from_frame(df, up="z").landmarks["left_knee"] == ("LKNE", "LKNM")
    df.loc[:, df.columns.str.contains("KNM|MED")] = np.nan
    landmarks = Skeleton.from_frame(df, up="z").landmarks
    assert (landmarks["left_knee"], landmarks["right_ankle"]) == ("LKNE", "RANK")


def test_letters_at_the_end_that_are_no_sides():
    """Lateral and medial, radial and ulnar markers of one arm are not of the left and right."""
    names = ["ASISl", "ASISr", "PSISl", "PSISr", "EPICl", "EPICm", "STYLr", "STYLu"]
    assert set(Skeleton(names, [-1] * 8).landmarks) == {"pelvis", "left_hip", "right_hip"}


def test_a_person_is_found_beside_an_object_and_two_people_are_refused():
    legs = [f"{s}{m}" for s in "LR" for m in ("ASI", "KNE", "ANK")]
    person = [f"Ann:{name}" for name in legs]
    skeleton = Skeleton([*person, "Stick:1", "Stick:2", "Puck:1"], [-1] * 9)
    assert skeleton.landmarks["left_knee"] == "Ann:LKNE"
    with pytest.raises(ValueError, match="No joint stands for"):
        Skeleton([*person, *(f"Bob:{name}" for name in legs)], [-1] * 12)


def test_sides_that_positions_contradict_are_warned_of():
    bends = make_bending(1, random_state=0)
    df, knees = pd.DataFrame(), []
    x = bends.data[0].reshape(len(bends.data[0]), -1, 3)
    for side in ("left", "right"):
        for part, marker in (("hip", "ASI"), ("knee", "KNE"), ("ankle", "ANK")):
            names = [f"{side[0].upper()}{marker}_{axis}" for axis in "xyz"]
            df[names] = x[:, bends.skeleton.index_of(f"{side}_{part}")]
        knees += [f"{side[0].upper()}KNE_{axis}" for axis in "xyz"]
    assert Skeleton.from_frame(df).landmarks["left_knee"] == "LKNE"
    df[knees] = df[knees[3:] + knees[:3]].to_numpy()
    with pytest.warns(UserWarning, match="Left and right may be exchanged: of .*'left_knee': 'LK"):
        Skeleton.from_frame(df)
