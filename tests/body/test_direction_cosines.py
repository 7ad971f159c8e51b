"""Postures against what is known of bodies: invariances, hand-made limbs, the way back."""

import numpy as np
import pytest
from sklearn_motionsync import DirectionCosines, Skeleton
from sklearn_motionsync.datasets import make_bending

REFERENCES = ["heading", "parent", "world"]


def turned(positions, degrees):
    a = np.deg2rad(degrees)
    turn = np.array([[np.cos(a), 0, np.sin(a)], [0, 1, 0], [-np.sin(a), 0, np.cos(a)]])
    return (positions.reshape(-1, 3) @ turn.T).reshape(positions.shape)


def moved(positions, shift):
    return (positions.reshape(-1, 3) + shift).reshape(positions.shape)


@pytest.fixture(scope="module")
def recording():
    return make_bending(1, random_state=1).data[0]


@pytest.mark.parametrize("reference", REFERENCES)
def test_moving_and_growing_change_nothing(reference, recording):
    cosines = DirectionCosines(Skeleton.paper(), reference)
    expected = cosines.fit_transform([recording])[0]
    for changed in (moved(recording, [3.0, -7.0, 2.0]), 1.3 * recording, 100 * recording):
        np.testing.assert_allclose(cosines.fit_transform([changed])[0], expected, atol=1e-9)


@pytest.mark.parametrize("degrees", [30, 90, 179, -135])
def test_heading_changes_nothing_but_world(degrees, recording):
    for reference in REFERENCES:
        cosines = DirectionCosines(Skeleton.paper(), reference)
        straight, other = cosines.fit_transform([recording, turned(recording, degrees)])
        same = np.allclose(straight, other, atol=1e-9)
        assert same is (reference != "world")


def test_real_people_turn_and_move_without_changing(bends):
    for reference in ("heading", "parent"):
        cosines = DirectionCosines(bends.skeleton, reference)
        X = [x.astype(float) for x in bends.data[:3]]
        changed = [1.2 * moved(turned(x, 77), [1.0, 2.0, 3.0]) for x in X]
        for a, b in zip(cosines.fit_transform(X), cosines.transform(changed), strict=True):
            np.testing.assert_allclose(a, b, atol=1e-9)


def test_a_jump_shows_and_sitting_shows(recording):
    up = recording.reshape(-1, 15, 3).copy()
    up[40:60, :, 1] += 0.3
    cosines = DirectionCosines(Skeleton.paper())
    ground, jump = cosines.fit_transform([recording, up.reshape(len(up), -1)])
    assert np.all(jump[40:60, 0] > ground[40:60, 0] + 0.3)
    np.testing.assert_allclose(ground[:40], jump[:40])


def standing(**moves):
    """One posture in metres, facing z: standing straight with the arms hanging, or moved."""
    at = {
        "pelvis": (0, 1, 0),
        "neck": (0, 1.5, 0),
        "head": (0, 1.7, 0),
        "left_shoulder": (0.2, 1.5, 0),
        "left_elbow": (0.2, 1.2, 0),
        "left_wrist": (0.2, 0.9, 0),
        "right_shoulder": (-0.2, 1.5, 0),
        "right_elbow": (-0.2, 1.2, 0),
        "right_wrist": (-0.2, 0.9, 0),
        "left_hip": (0.1, 1, 0),
        "left_knee": (0.1, 0.5, 0),
        "left_ankle": (0.1, 0, 0),
        "right_hip": (-0.1, 1, 0),
        "right_knee": (-0.1, 0.5, 0),
        "right_ankle": (-0.1, 0, 0),
    } | moves
    return np.array([at[j] for j in Skeleton.paper().joints], float).reshape(1, -1)


def named(cosines, positions):
    values = cosines.fit_transform([np.vstack([positions, positions])])[0][0]
    names = cosines.get_feature_names_out()
    return {
        str(name)[:-2]: tuple(values[i : i + 3].round(9))
        for i, name in enumerate(names)
        if name.endswith("_x")
    } | {"u": round(values[0], 9)}


def test_cosines_of_a_body_made_by_hand():
    body = named(DirectionCosines(Skeleton.paper()), standing(left_wrist=(0.2, 1.2, 0.3)))
    assert body["u"] == 1
    assert body["hip"] == (1, 0, 0)
    assert body["torso"] == (0, 1, 0)
    assert body["right_forearm"] == (0, -1, 0)
    assert body["left_forearm"] == (0, 0, 1)


def test_parent_cosines_turn_with_the_parent():
    """A leg that stays stretched says the same however the thigh swings."""
    swung = standing(left_knee=(0.1, 0.7, 0.4), left_ankle=(0.1, 0.4, 0.8))
    for body in (standing(), swung):
        limbs = named(DirectionCosines(Skeleton.paper(), "parent"), body)
        assert limbs["left_leg"] == (0, -1, 0)
        assert limbs["right_forearm"][0] == -1
    assert limbs["left_thigh"] == (0, -0.6, 0.8)


@pytest.mark.parametrize("reference", REFERENCES)
def test_joint_positions_come_back(reference, recording):
    """Exactly, but for place and heading: the embedded body is built like the inverse's."""
    bunch = make_bending(1, noise=0, random_state=1)
    cosines = DirectionCosines(bunch.skeleton, reference)
    postures = cosines.fit_transform(bunch.data)
    back = cosines.inverse_transform(postures)
    assert back[0].shape == bunch.data[0].shape
    original = bunch.data[0].reshape(-1, 15, 3)
    rebuilt = back[0].reshape(-1, 15, 3)
    if reference == "world":
        original = original - original[:, :1] * [1, 0, 1]
        np.testing.assert_allclose(rebuilt, original, atol=1e-9)
    gaps = [np.linalg.norm(x[:, :, None] - x[:, None], axis=-1) for x in (original, rebuilt)]
    np.testing.assert_allclose(gaps[1], gaps[0], atol=1e-9)
    np.testing.assert_allclose(rebuilt[..., 1], original[..., 1], atol=1e-9)
    again = DirectionCosines(Skeleton.paper(), reference).fit_transform(back)
    np.testing.assert_allclose(again[0], postures[0], atol=1e-9)


def test_given_limb_lengths_are_used(recording):
    cosines = DirectionCosines(Skeleton.paper()).fit(recording)
    back = cosines.inverse_transform(cosines.transform(recording), 2 * cosines.limb_lengths_)
    again = DirectionCosines(Skeleton.paper()).fit(back)
    np.testing.assert_allclose(again.limb_lengths_, 2 * cosines.limb_lengths_)
    with pytest.raises(ValueError, match="one length for each"):
        cosines.inverse_transform(cosines.transform(recording), [1.0])


def test_z_up(recording):
    x, y, z = np.moveaxis(recording.reshape(-1, 15, 3), 2, 0)
    z_up = np.stack([x, -z, y], axis=2).reshape(len(recording), -1)
    paper = Skeleton.paper()
    upright = Skeleton(paper.joints, paper.parents, up="z")
    np.testing.assert_allclose(
        DirectionCosines(upright).fit_transform(z_up),
        DirectionCosines(paper).fit_transform(recording),
        atol=1e-12,
    )


def test_a_limb_without_length_is_named(recording):
    X = recording.copy()
    joints = Skeleton.paper().joints
    knee, ankle = joints.index("left_knee"), joints.index("left_ankle")
    X[7, 3 * ankle : 3 * ankle + 3] = X[7, 3 * knee : 3 * knee + 3]
    message = r"Performance 1, frame 7: the limb 'left_leg' has no length"
    with pytest.raises(ValueError, match=message):
        DirectionCosines(Skeleton.paper()).fit_transform([recording, X])


def test_hips_above_each_other_have_no_heading():
    lying = standing(left_hip=(0, 1.1, 0), right_hip=(0, 0.9, 0))
    assert np.isfinite(DirectionCosines(Skeleton.paper()).fit_transform(lying)).all()


def test_wrong_number_of_joints():
    with pytest.raises(ValueError, match="31 joints need 93"):
        DirectionCosines(Skeleton.acclaim()).fit([np.zeros((4, 45))])


# -- Skeleton ---------------------------------------------------------------------------


def test_ready_skeletons_are_those_of_the_archives(real_data):
    archives = {"hdm05/hdm05": Skeleton.acclaim(), "utkinect/utkinect": Skeleton.kinect()}
    for name, skeleton in archives.items():
        with np.load(real_data / f"{name}_positions.npz") as archive:
            assert skeleton.joints == tuple(archive["joints"])
            assert skeleton.parents == tuple(archive["parents"])


def test_landmarks_are_guessed_from_names(real_data):
    with np.load(real_data / "cmu07_walk" / "cmu07_walk_positions.npz") as archive:
        skeleton = Skeleton.from_names(archive["joints"], archive["parents"])
    assert skeleton.landmarks["left_hip"] == "CC_Base_L_Thigh"
    assert skeleton.landmarks["right_elbow"] == "CC_Base_R_Forearm"
    assert skeleton.landmarks["pelvis"] == "CC_Base_Hip"


def test_landmarks_of_common_names():
    left = [
        "LeftUpLeg",
        "LeftLeg",
        "LeftFoot",
        "LeftShoulder",
        "LeftArm",
        "LeftForeArm",
        "LeftHand",
    ]
    joints = ["Hips", "Spine", "Neck", "Head", *left, *(n.replace("Left", "Right") for n in left)]
    skeleton = Skeleton(joints, [-1] + [0] * (len(joints) - 1))
    assert skeleton.landmarks["left_shoulder"] == "LeftArm"
    assert skeleton.landmarks["right_knee"] == "RightLeg"
    assert skeleton.landmarks["left_wrist"] == "LeftHand"


def test_bones_and_columns():
    skeleton = Skeleton.kinect()
    assert len(skeleton.bones) == 19
    assert skeleton.column_names[:3] == ["HipCenter_x", "HipCenter_y", "HipCenter_z"]
