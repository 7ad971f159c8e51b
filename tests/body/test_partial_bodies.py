"""Bodies that lack landmarks, and landmarks that are means of joints."""

import numpy as np
import pandas as pd
import pytest
from sklearn_motionsync import DirectionCosines, JointPositions, Skeleton
from sklearn_motionsync.datasets import make_bending
from sklearn_motionsync.io import read_motion

from made_bodies import columns_of, standing, turned

PAPER = Skeleton.paper()
LEGS = ["pelvis", *(f"{s}_{j}" for s in ("left", "right") for j in ("hip", "knee", "ankle"))]
ARMS = ["neck", *(f"{s}_{j}" for s in ("left", "right") for j in ("shoulder", "elbow", "wrist"))]
LEFT = ["left_hip", "left_knee", "left_ankle"]
PARTS = {
    "legs": LEGS,
    "no head": [j for j in PAPER.joints if j != "head"],
    "no arms": [*LEGS, "neck", "head"],
    "no wrists": [j for j in PAPER.joints if "wrist" not in j],
    "upper body": ["pelvis", *ARMS, "head"],
    "arms": ARMS,
    "left half": ["pelvis", "neck", "head", *(j for j in PAPER.joints if j.startswith("left"))],
    "left leg": LEFT,
    "forearm and leg": ["left_elbow", "left_wrist", "right_knee", "right_ankle"],
}


def without(*joints):
    x = make_bending(1, random_state=1).data[0]
    return columns_of(x).drop(columns=[f"{j}_{a}" for j in joints for a in "xyz"])


def only(joints, of=PAPER):
    """The skeleton of a whole body that knows these landmarks only."""
    return Skeleton(of.joints, of.parents, {j: of.landmarks[j] for j in joints}, of.up)


@pytest.fixture(params=["made", "utkinect"], scope="module")
def people(request):
    if request.param == "made":
        bunch = make_bending(3, random_state=0)
        return bunch.skeleton, bunch.data
    bunch = request.getfixturevalue(request.param)
    return bunch.skeleton, bunch.data[::25]


# -- cosines of the limbs that are there --------------------------------------------------


@pytest.mark.parametrize(
    ("part", "reference"),
    [
        *((part, "heading") for part in PARTS),
        *((part, "parent") for part in ("legs", "arms", "left half")),
        *((part, "world") for part in ("legs", "arms", "left half")),
    ],
)
def test_cosines_equal_those_of_the_whole_body_and_can_be_inverted(people, part, reference):
    skeleton, X = people
    whole = DirectionCosines(skeleton, reference).fit(X)
    some = DirectionCosines(only(PARTS[part], skeleton), reference).fit(X)
    names, all_names = (list(e.get_feature_names_out()) for e in (some, whole))
    assert set(names) < set(all_names)
    assert ("pelvis_height" in names) is ({"pelvis", *LEFT} <= set(PARTS[part]))
    limbs = some.skeleton.limbs
    assert names[-3 * len(limbs) :] == [f"{limb}_{axis}" for limb in limbs for axis in "xyz"]
    lengths = dict(zip(whole.skeleton.limbs, whole.limb_lengths_, strict=True))
    np.testing.assert_array_equal(some.limb_lengths_, [lengths[limb] for limb in limbs])
    same = names
    if reference != "world" and "hip" not in limbs:
        same = ["pelvis_height"] if "pelvis_height" in names else []  # the heading is another
    if reference == "parent" and "hip" in limbs:
        same = [n for n in names if "shoulder" not in n or "torso" in limbs]
    if part == "left half":
        same = [n for n in same if n != "pelvis_height"]  # of one leg, not the mean of both
    columns, own = ([list(of).index(n) for n in same] for of in (all_names, names))
    poses = some.transform(X)
    for a, b in zip(whole.transform(X), poses, strict=True):
        np.testing.assert_array_equal(b[:, own], a[:, columns])
    # Poses of the positions that are made of them are the same.
    body = some.skeleton.body()
    assert set(body.joints) == set(body.landmarks) <= set(PARTS[part])
    assert body.limbs == limbs
    again = DirectionCosines(body, reference).fit_transform(some.inverse_transform(poses))
    # If limbs change their length, the shift of the hips limits the heights.
    moves = part == "left half" or "HipLeft" in skeleton.joints
    kept = [n for n in names if n != "pelvis_height" or not moves]
    columns = [names.index(n) for n in kept]
    for a, b in zip(poses, again, strict=True):
        np.testing.assert_allclose(b[:, columns], a[:, columns], atol=1e-5)


def test_body_without_hips_has_the_heading_of_its_shoulders():
    faces_x = turned(standing(left_wrist=(0.2, 1.2, 0.3)), 90)
    features = DirectionCosines(only(ARMS)).fit_transform(faces_x)[0]
    at = dict(zip(DirectionCosines(only(ARMS)).get_feature_names_out(), features, strict=True))
    np.testing.assert_allclose([at[f"shoulder_{a}"] for a in "xyz"], [1, 0, 0], atol=1e-12)
    np.testing.assert_allclose([at[f"left_forearm_{a}"] for a in "xyz"], [0, 0, 1], atol=1e-12)
    leg = DirectionCosines(only(LEFT)).fit_transform(turned(standing(), 90))
    np.testing.assert_allclose(leg, [[0, -1, 0, 0, -1, 0]], atol=1e-12)


# -- places of the landmarks that are there -----------------------------------------------


@pytest.mark.parametrize("part", ["legs", "no head", "no arms", "no wrists", "left half"])
def test_positions_equal_those_of_the_whole_body(people, part):
    skeleton, X = people
    whole = JointPositions(skeleton, "world").fit(X)
    some = JointPositions(only(PARTS[part], skeleton), "world").fit(X)
    assert [n[:-2] for n in some.get_feature_names_out()[::3]] == [
        j for j in PAPER.joints if j in PARTS[part] and j != "pelvis"
    ]
    columns = [list(whole.get_feature_names_out()).index(n) for n in some.get_feature_names_out()]
    for a, b in zip(whole.transform(X), some.transform(X), strict=True):
        if part == "left half":  # whose unit is one leg
            a, b = (y / np.linalg.norm(y) for y in (a[:, columns], b))
            np.testing.assert_allclose(b, a, atol=1e-6)
        else:
            np.testing.assert_array_equal(b, a[:, columns])


def test_origin_and_unit_without_a_pelvis_or_a_leg():
    x = np.vstack([standing()] * 2)
    hips = JointPositions(only(LEGS[1:]))
    at = dict(zip(hips.get_feature_names_out(), hips.fit_transform(x)[0], strict=True))
    assert (at["left_hip_x"], at["left_hip_y"], at["left_ankle_y"]) == (0.1, 0, -1)
    # From the neck, in lengths of all limbs: 0.4 of shoulders, and 0.6 of each arm.
    arms = JointPositions(only(ARMS))
    at = dict(zip(arms.get_feature_names_out(), arms.fit_transform(x)[0], strict=True))
    assert "neck_x" not in at
    np.testing.assert_allclose([at["left_wrist_x"], at["left_wrist_y"]], [0.125, -0.375])
    leg = JointPositions(only(LEFT))
    assert list(leg.get_feature_names_out()[::3]) == ["left_knee_x", "left_ankle_x"]
    np.testing.assert_allclose(leg.fit_transform(x)[0], [0, -0.5, 0, 0, -1, 0])


# -- landmarks that are means -------------------------------------------------------------


def test_landmark_of_two_joints_is_their_mean():
    x = make_bending(1, random_state=1).data[0]
    df, knees = columns_of(x), {}
    # Each knee is the middle of two markers, one to each side of it.
    for side in ("left", "right"):
        knees[f"{side}_knee"] = (f"{side}_in", f"{side}_out")
        for name, shift in (("in", -0.05), ("out", 0.05)):
            for axis in "xyz":
                df[f"{side}_{name}_{axis}"] = df[f"{side}_knee_{axis}"] + shift * (axis == "z")
    skeleton = Skeleton.from_frame(df, landmarks=knees)
    assert skeleton.landmarks == {**PAPER.landmarks, **knees}
    for kind in (DirectionCosines, JointPositions):
        expected = kind(PAPER).fit_transform(x)
        np.testing.assert_allclose(kind(skeleton).fit_transform(df), expected, atol=1e-12)
    with pytest.raises(ValueError, match=r"'left_knee' is the mean of .* indices_of gives all"):
        skeleton.index_of("left_knee")
    assert skeleton.indices_of("left_knee") == (15, 16)
    with pytest.raises(ValueError, match=r"lacks the landmark 'head'; it has \['left_hip'"):
        only(LEFT).index_of("head")


def test_missing_pelvis_and_neck_are_the_middle_of_their_pairs():
    df = without("pelvis", "neck")
    skeleton = Skeleton.from_frame(df)
    assert skeleton.landmarks["pelvis"] == ("left_hip", "right_hip")
    assert skeleton.landmarks["neck"] == ("left_shoulder", "right_shoulder")
    # The made people have their pelvis and neck in the middle.
    expected = DirectionCosines(PAPER).fit_transform(without())
    np.testing.assert_allclose(DirectionCosines(skeleton).fit_transform(df), expected, atol=0.05)
    told = Skeleton.from_frame(df, landmarks={"left_hip": ("left_hip", "left_knee")})
    assert told.landmarks["pelvis"] == ("left_hip", "left_knee", "right_hip")
    assert "pelvis" not in Skeleton.from_frame(df, landmarks={"pelvis": None}).landmarks


# -- guessed from names -------------------------------------------------------------------


def test_landmark_guessed_on_one_side_only_is_refused():
    message = r"landmarks \['right_knee'\]; give landmarks=.*several of them for their mean"
    with pytest.raises(ValueError, match=message):
        Skeleton.from_frame(without("right_knee"))
    given = {joint: joint for joint in LEFT}
    right = [j for j in PAPER.joints if j.startswith("right")]
    with pytest.raises(ValueError, match="right_shoulder"):
        Skeleton.from_frame(without(*right), landmarks=given)
    others = without(*right, *(j for j in PAPER.joints if j in ARMS))
    assert Skeleton.from_frame(others, landmarks=given).limbs == ["left_thigh", "left_leg"]
    # Or it is said that it lacks.
    skeleton = Skeleton.from_frame(without("right_knee"), landmarks={"right_knee": None})
    assert "right_thigh" not in skeleton.limbs
    assert "left_thigh" in skeleton.limbs


@pytest.mark.parametrize("spelling", ["left_{}", "L_{}", "Anna:Left_{}"])
def test_side_in_all_names_is_not_a_prefix(spelling):
    joints = [spelling.format(part) for part in ("hip", "knee", "ankle", "toe")]
    df = pd.DataFrame(0.0, index=[0], columns=[f"{j}_{a}" for j in joints for a in "xyz"])
    given = dict(zip(("left_hip", "left_knee", "left_ankle"), joints, strict=False))
    assert Skeleton.from_frame(df, landmarks=given).landmarks == given
    with pytest.raises(ValueError, match=r"landmarks \['right_hip', 'right_knee', 'right_ankle'\]"):
        Skeleton.from_frame(df)


def test_names_without_landmarks_are_refused_with_advice():
    df = pd.DataFrame(0.0, index=[0], columns=[f"M{i}_{a}" for i in range(3) for a in "xyz"])
    message = r"\['pelvis', 'neck', .*joints \['M0', 'M1', 'M2'\].*\{'pelvis': \('LASI', 'RASI'\)\}"
    with pytest.raises(ValueError, match=message):
        Skeleton.from_frame(df)


# -- real markers -------------------------------------------------------------------------


@pytest.mark.filterwarnings("ignore:.*(missing|attrs):UserWarning")
def test_landmarks_of_marker_clusters_in_a_file(real_data):
    df = read_motion(real_data / "original_files" / "c3d" / "Eb015pr.c3d", max_gap=20)
    df = df.dropna()
    with pytest.warns(UserWarning, match="several markers on each segment, but none at a joint"):
        guessed = Skeleton.from_frame(df).landmarks
    assert guessed["right_knee"] == ("RSK1", "RSK2", "RSK3", "RSK4")
    clusters = {"hip": ("TH1", "TH2"), "knee": ("SK1", "SK2"), "ankle": ("FT1", "FT2")}
    landmarks = {}
    for joint, (a, b) in clusters.items():
        landmarks |= {f"left_{joint}": (f"L{a}", f"L{b}"), f"right_{joint}": (f"R{a}", f"R{b}")}
    skeleton = Skeleton.from_frame(df, landmarks=landmarks)
    assert skeleton.up == df.attrs["up"] == "z"
    assert skeleton.landmarks["pelvis"] == ("LTH1", "LTH2", "RTH1", "RTH2")
    cosines = DirectionCosines(skeleton).set_output(transform="pandas")
    table = cosines.fit_transform(df)
    assert list(table.columns[:2]) == ["pelvis_height", "hip_x"]
    places = df[[f"{joint}_{axis}" for joint in ("LFT1", "LFT2", "LSK1", "LSK2") for axis in "xyz"]]
    places = places.to_numpy().reshape(-1, 2, 2, 3).mean(axis=2)
    shin = places[:, 0] - places[:, 1]
    # Up is z, and the cosine with it is the same whichever way the person faces.
    expected = shin[:, 2] / np.linalg.norm(shin, axis=1)
    np.testing.assert_allclose(table["left_leg_y"], expected, atol=1e-12)


def test_body_has_the_landmarks_that_limbs_join():
    """No head without a neck, and no pelvis that is not given."""
    legs = [f"{side}_{part}" for side in ("left", "right") for part in ("hip", "knee", "ankle")]
    given = Skeleton([*legs, "head"], [-1] * 7, {name: name for name in [*legs, "head"]})
    assert given.body().joints == tuple(legs)
    assert Skeleton(legs, [-1] * 6).body().joints == ("pelvis", *legs)
