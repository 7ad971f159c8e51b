"""Hidden joints: their limbs are NaN, the heading is estimated, and nothing else changes."""

import numpy as np
import pytest
from sklearn.utils import get_tags
from sklearn_motionsync import DirectionCosines, JointPositions, Skeleton
from sklearn_motionsync.body.axes import fill_heading, heading_axes
from sklearn_motionsync.datasets import make_bending

from made_bodies import standing, turned, turned_over

PAPER = Skeleton.paper()
JOINTS = list(PAPER.joints)
REFERENCES = ["heading", "parent", "world"]
# Joints from end to end, and the limb each hangs on, written out once more.
ENDS = {
    "hip": ("right_hip", "left_hip", None),
    "torso": ("pelvis", "neck", "hip"),
    "shoulder": ("right_shoulder", "left_shoulder", "torso"),
    "neck": ("neck", "head", "torso"),
    **{f"{s}_thigh": (f"{s}_hip", f"{s}_knee", "hip") for s in ("left", "right")},
    **{f"{s}_leg": (f"{s}_knee", f"{s}_ankle", f"{s}_thigh") for s in ("left", "right")},
    **{f"{s}_arm": (f"{s}_shoulder", f"{s}_elbow", "shoulder") for s in ("left", "right")},
    **{f"{s}_forearm": (f"{s}_elbow", f"{s}_wrist", f"{s}_arm") for s in ("left", "right")},
}


def without(positions, hidden, n_dims=3):
    """Positions in which the joints of a mask (n_frames, n_joints) are NaN."""
    x = positions.reshape(len(positions), -1, n_dims).copy()
    x[hidden] = np.nan
    return x.reshape(len(x), -1)


def hide(positions, frames, *joints):
    mask = np.zeros((len(positions), 15), dtype=bool)
    for joint in joints:
        mask[frames, JOINTS.index(joint)] = True
    return without(positions, mask)


def limb(cosines, poses, name):
    first = list(cosines.get_feature_names_out()).index(f"{name}_x")
    return poses[:, first : first + 3]


@pytest.fixture(scope="module")
def recordings():
    return make_bending(2, random_state=1).data


@pytest.fixture
def fitted(recordings):
    return lambda reference="heading": DirectionCosines(PAPER, reference, "nan").fit(recordings)


# -- visible limbs are unchanged ----------------------------------------------------------


@pytest.mark.parametrize("dtype", ["f4", "f8"])
@pytest.mark.parametrize("n_dims", [2, 3])
@pytest.mark.parametrize("reference", REFERENCES)
def test_limbs_with_a_hidden_end_are_nan_and_others_unchanged(reference, n_dims, dtype, recordings):
    x = recordings[0].reshape(-1, 15, 3)[..., :n_dims].reshape(len(recordings[0]), -1)
    x = x.astype(dtype)
    skeleton = Skeleton.paper(n_dims=n_dims)
    cosines = DirectionCosines(skeleton, reference, "nan").fit([x])
    hidden = np.random.default_rng(0).random((len(x), 15)) < 0.2
    # The hips give the heading in every frame.
    if reference != "world" and n_dims == 3:
        hidden[:, [JOINTS.index("left_hip"), JOINTS.index("right_hip")]] = False
    given = without(x, hidden, n_dims)
    # One coordinate is enough.
    given[0, n_dims * JOINTS.index("head")] = np.nan
    hidden[0, JOINTS.index("head")] = True
    before = given.copy()
    poses, whole = cosines.transform([given])[0], cosines.transform([x])[0]
    np.testing.assert_array_equal(given, before)
    lost = {None: np.zeros(len(x), dtype=bool)}
    for name, (start, end, above) in ENDS.items():
        lost[name] = hidden[:, JOINTS.index(start)] | hidden[:, JOINTS.index(end)]
        if reference == "parent":
            lost[name] |= lost[above]
    expected = whole[:, 1:].reshape(len(x), 12, n_dims).copy()
    expected[np.column_stack([lost[name] for name in ENDS])] = np.nan
    np.testing.assert_array_equal(poses[:, 1:], expected.reshape(len(x), -1))
    assert poses.dtype == dtype
    np.testing.assert_array_equal(np.isnan(poses[:, 0]), hidden[:, 0])


def test_hidden_nan_without_gaps_equals_hidden_raise(recordings, fitted):
    for reference in REFERENCES:
        plain, live = DirectionCosines(PAPER, reference).fit(recordings), fitted(reference)
        poses = plain.transform(recordings[0])
        np.testing.assert_array_equal(live.transform(recordings[0]), poses)
        np.testing.assert_array_equal(live.inverse_transform(poses), plain.inverse_transform(poses))


def test_mean_of_joints_is_hidden_with_any_of_them():
    markers = Skeleton(
        ["hip", "in", "out", "ankle"],
        [-1] * 4,
        {"left_hip": "hip", "left_knee": ("in", "out"), "left_ankle": "ankle"},
    )
    x = np.tile([0, 2.0, 0, 0.1, 1, 0, -0.1, 1, 0, 0, 0, 0], (3, 1))
    x[1, 3] = np.nan
    poses = DirectionCosines(markers, hidden="nan").fit(x).transform(x)
    assert np.isnan(poses).any(axis=1).tolist() == [False, True, False]
    np.testing.assert_array_equal(poses[2], [0, -1, 0, 0, -1, 0])


# -- the heading --------------------------------------------------------------------------


def turn_of_x(directions):
    """By how many degrees about y the x axis is turned into the level parts of directions."""
    return np.rad2deg(np.arctan2(-directions[:, 2], directions[:, 0]))


def turn_of_z(directions):
    return np.rad2deg(np.arctan2(directions[:, 0], directions[:, 2]))


def turning(headings, twists):
    """Bodies that face so many degrees from z, the shoulders turned further by the twists."""
    bodies = []
    for heading, twist in zip(headings, twists, strict=True):
        at = {
            f"{side}_shoulder": turned(np.array([[x, 1.5, 0.0]]), twist)[0]
            for side, x in (("left", 0.2), ("right", -0.2))
        }
        bodies.append(turned(standing(**at, head=(0, 1.7, 0.2)), heading))
    return np.concatenate(bodies)


def test_shoulders_give_the_heading_with_the_last_seen_twist_and_else_it_stays(fitted):
    x = turning([0, 10, 30, 50, 80, 90], [10, 20, 25, 30, -5, -5])
    cosines, shoulder = fitted(), hide(hide(x, [2, 3], "left_hip"), [3], "right_shoulder")
    given = hide(x, [2, 3], "left_hip")
    angles = turn_of_x(limb(cosines, cosines.transform(given), "shoulder"))
    np.testing.assert_allclose(angles, [10, 20, 20, 20, -5, -5], atol=1e-9)
    # The head is forward of the neck: its direction shows the estimated heading.
    for seen, expected in ((given, [0, 0, -5, -10, 0, 0]), (shoulder, [0, 0, -5, 15, 0, 0])):
        faces = turn_of_z(limb(cosines, cosines.transform(seen), "neck"))
        np.testing.assert_allclose(faces, expected, atol=1e-9)
    # Of a body without hips the heading is that of its shoulders.
    names = [name for name in JOINTS if "hip" not in name and "knee" not in name]
    trunk = Skeleton(names, [-1] * len(names), {name: name for name in names})
    x = turning([0, 30, 60, 90], [0] * 4).reshape(4, 15, 3)
    x = x[:, [JOINTS.index(name) for name in names]]
    cosines = DirectionCosines(trunk, hidden="nan").fit(x.reshape(4, -1))
    x[2, names.index("left_shoulder")] = np.nan
    faces = turn_of_z(limb(cosines, cosines.transform(x.reshape(4, -1)), "neck"))
    np.testing.assert_allclose(faces, [0, 0, 30, 0], atol=1e-9)


def test_hips_stay_at_the_pelvis_where_no_ankle_is_seen(recordings, fitted):
    cosines = fitted()
    poses = cosines.transform(recordings[0])
    for side in ("left", "right"):
        limb(cosines, poses, f"{side}_leg")[:] = np.nan
    body = cosines.inverse_transform(poses).reshape(len(poses), 15, 3)
    pelvis, left, right = (body[:, JOINTS.index(j)] for j in ("pelvis", "left_hip", "right_hip"))
    assert np.isfinite(pelvis).all()
    np.testing.assert_allclose((left + right) / 2, pelvis, atol=1e-12)


@pytest.mark.parametrize("size", [0, 1e-9])
def test_vertical_hips_show_no_heading(size):
    """What is left of them across is rounding: the heading before them stays, not that."""
    hips = np.array([[0.6, 0, 0.8], [-size, 1, size], [np.nan] * 3])
    np.testing.assert_allclose(heading_axes(fill_heading(hips))[2, 0], hips[0])


def test_limbs_before_the_first_heading_are_nan(fitted):
    x = turning([20, 20, 20, 20], [15, 15, 15, 15])
    x = hide(hide(x, [0, 1], "left_hip"), [0], "left_shoulder")
    for reference in ("heading", "parent"):
        poses = fitted(reference).transform(x)
        assert np.isnan(poses[0, 1:]).all()
    cosines = fitted()
    poses = cosines.transform(x)
    assert np.isfinite(poses[:, 0]).all()
    # Without hips so far, as of a body that has none.
    angles = turn_of_x(limb(cosines, poses, "shoulder"))
    np.testing.assert_allclose(angles[1:], [0, 15, 15], atol=1e-9)
    assert np.isfinite(limb(fitted("world"), fitted("world").transform(x), "neck")).all()


@pytest.mark.parametrize("reference", REFERENCES)
def test_cosines_do_not_depend_on_later_frames(reference, recordings, fitted):
    x = recordings[0]
    hidden = np.random.default_rng(1).random((len(x), 15)) < 0.5
    x = without(x, hidden)
    cosines = fitted(reference)
    whole = cosines.transform(x)
    assert 0.2 < np.isnan(whole).mean() < 0.95
    for k in (1, 2, 7, len(x) // 2):
        np.testing.assert_array_equal(cosines.transform(x[:k])[:, 1:], whole[:k, 1:])


# -- the height ---------------------------------------------------------------------------


def test_height_uses_the_ankles_and_legs_that_are_seen():
    x = np.concatenate([standing(), standing() + 0.3, standing()])
    cosines = DirectionCosines(PAPER, hidden="nan").fit(x)
    np.testing.assert_allclose(cosines.transform(x)[:, 0], [1, 1.3, 1])
    lost = hide(hide(x, [0], "left_ankle", "right_knee"), [2], "pelvis")
    np.testing.assert_allclose(cosines.transform(lost)[:, 0], [1, 1.3, np.nan])
    # A single frame does not show a jump.
    np.testing.assert_allclose(cosines.transform(x[1:2])[:, 0], [1])
    np.testing.assert_allclose(cosines.transform(hide(x[1:2], 0, "left_hip"))[:, 0], [1])
    feet = ("left_ankle", "right_ankle")
    assert np.isnan(cosines.transform(hide(x, slice(None), *feet))[:, 0]).all()
    # Legs never seen are scaled from fit, in any unit.
    unseen = hide(x, slice(None), "left_knee", "right_knee")
    for factor in (1, 100, 1e-6):
        np.testing.assert_allclose(cosines.transform(factor * unseen)[:, 0], [1, 1.3, 1])


# -- kinds of input, and refusals ---------------------------------------------------------


def test_hidden_joints_are_refused_unless_allowed(recordings, fitted):
    x = hide(recordings[0], [3], "head")
    infinite = x.copy()
    infinite[5, 0] = np.inf
    with pytest.raises(ValueError, match="Trial 0, frame 5, feature 0 is infinity"):
        fitted().transform([infinite])
    plain = DirectionCosines(PAPER).fit(recordings)
    with pytest.raises(ValueError, match=r"Trial 0, frame 3, .* is NaN"):
        plain.transform([x])
    with pytest.raises(ValueError, match="is NaN"):
        plain.inverse_transform(fitted().transform([x]))
    with pytest.raises(ValueError, match=r"Trial 0, frame 3, .* is NaN.*Set hidden='nan'"):
        JointPositions(PAPER).fit(recordings).transform([x])
    for kind in (DirectionCosines, JointPositions):
        assert get_tags(kind(PAPER, hidden="nan")).input_tags.allow_nan
        assert not get_tags(kind(PAPER)).input_tags.allow_nan
        with pytest.raises(ValueError, match="The 'hidden' parameter"):
            kind(PAPER, hidden="drop").fit(recordings)


@pytest.mark.parametrize("reference", ["heading", "world"])
def test_positions_of_hidden_joints_are_nan_and_others_unchanged(reference, recordings):
    x = recordings[0]
    positions = JointPositions(PAPER, reference, "nan").fit(recordings)
    (whole,) = positions.transform([x])
    np.testing.assert_array_equal(whole, JointPositions(PAPER, reference).fit_transform([x])[0])
    hidden = np.random.default_rng(0).random((len(x), 15)) < 0.2
    hidden[:, [JOINTS.index("left_hip"), JOINTS.index("right_hip")]] = False
    (found,) = positions.transform([without(x, hidden)])
    names = positions.get_feature_names_out()
    lost = hidden[:, [JOINTS.index(name[:-2]) for name in names]] | hidden[:, :1]
    np.testing.assert_array_equal(np.isnan(found), lost)
    # The unit is the median length of the leg, of fewer frames.
    np.testing.assert_allclose(found[~lost], whole[~lost], rtol=2e-3, atol=1e-9)


def test_positions_of_a_body_whose_legs_are_never_seen_have_the_unit_of_fit(recordings):
    positions = JointPositions(PAPER, hidden="nan").fit(recordings)
    x = 2 * recordings[0]
    frames = np.arange(len(x))
    (found,) = positions.transform([hide(x, frames, "left_knee", "right_knee")])
    (whole,) = positions.transform([x])
    seen = ~np.isnan(found)
    assert seen.any(axis=0).sum() == 36
    np.testing.assert_allclose(found[seen], whole[seen], rtol=0.05, atol=1e-9)
    with pytest.raises(ValueError, match=r"\['left_thigh', 'left_leg'\] are hidden in every frame"):
        JointPositions(PAPER, hidden="nan").fit([hide(x, frames, "left_knee")])


def test_visible_limbs_are_checked(recordings, fitted):
    hidden = np.random.default_rng(3).random((len(recordings[0]), 15)) < 0.1
    with pytest.raises(ValueError, match="Trial 0 is upside down"):
        fitted().transform([without(turned_over(recordings[0]), hidden)])
    legs = ("left_hip", "right_hip", "left_knee", "left_ankle", "right_knee", "right_ankle")
    trunk = hide(turned_over(np.concatenate([standing()] * 5)), slice(None), *legs)
    with pytest.raises(ValueError, match="upside down"):
        fitted().transform([trunk])
    # Legs in some frames, the trunk in others.
    x = turned_over(np.concatenate([standing()] * 6))
    x = hide(hide(x, slice(3), "neck", "head"), slice(3, 6), *legs[2:])
    shoulders = [f"{side}_shoulder" for side in ("left", "right")]
    with pytest.raises(ValueError, match="'-y' seems to be"):
        fitted().transform(hide(x, slice(3), *shoulders))
    x = hide(np.concatenate([standing(), standing(head=(0, 1.5, 0))]), [0, 1], "left_knee")
    with pytest.raises(ValueError, match="frame 1: the limb 'neck' has no length"):
        fitted().transform(x)


def test_everything_may_be_hidden_in_transform_and_not_in_fit(recordings, fitted):
    nothing = np.full_like(recordings[0], np.nan)
    for reference in REFERENCES:
        for given in (nothing, nothing[:1]):
            assert np.isnan(fitted(reference).transform(given)).all()
        assert np.isnan(fitted(reference).inverse_transform(nothing[:, :37])).all()
    cosines = DirectionCosines(PAPER, hidden="nan")
    with pytest.raises(ValueError, match=r"limbs \['hip', .* are hidden in every frame"):
        cosines.fit([nothing])
    wrist = hide(recordings[0], slice(None), "left_wrist")
    with pytest.raises(ValueError, match=r"limbs \['left_forearm'\] are hidden .* landmarks="):
        cosines.fit([wrist])
    tiny = 1e-6 * recordings[1]
    lengths = cosines.fit([tiny]).limb_lengths_
    np.testing.assert_array_equal(cosines.fit([nothing, tiny]).limb_lengths_, lengths)


# -- inverse_transform --------------------------------------------------------------------


@pytest.mark.parametrize("reference", REFERENCES)
def test_inverse_transform_hides_joints_below_a_hidden_limb(reference, recordings, fitted):
    cosines = fitted(reference)
    poses = cosines.transform(recordings[0])
    names = list(cosines.get_feature_names_out())
    whole = cosines.inverse_transform(poses).reshape(-1, 15, 3)
    # The frame in which the lowest ankle stands on the floor stays.
    ankles = [JOINTS.index(f"{side}_ankle") for side in ("left", "right")]
    floor = whole[:, ankles, 1].min(axis=1).argmin()
    arm, torso, height = np.flatnonzero(np.arange(len(poses)) != floor)[:3]
    lost = poses.copy()
    lost[arm, names.index("left_arm_y")] = np.nan
    lost[torso, names.index("torso_x")] = np.nan
    lost[height, 0] = np.nan
    back = cosines.inverse_transform(lost).reshape(-1, 15, 3)
    upper = ("neck", "head", "shoulder", "elbow", "wrist")
    expected = np.zeros((len(lost), 15), dtype=bool)
    expected[arm] = [joint in ("left_elbow", "left_wrist") for joint in JOINTS]
    expected[torso] = [joint.endswith(upper) for joint in JOINTS]
    expected[height] = True
    np.testing.assert_array_equal(back, np.where(expected[..., np.newaxis], np.nan, whole))


# -- real people --------------------------------------------------------------------------


def test_shoulders_halve_the_error_of_the_heading_of_turning_people(hdm05):
    """Joggers in a circle, hips hidden for a second, against the last heading."""
    errors = [], []
    for i in np.flatnonzero(hdm05.target == "jogLeftCircle4StepsRstart"):
        x = hdm05.data[i].astype(float).reshape(len(hdm05.data[i]), -1, 3)
        hips, shoulders = (across(x, hdm05.skeleton, part) for part in ("hip", "shoulder"))
        true = heading_axes(fill_heading(hips))[:, 0]
        for start in range(1, len(x) - 120, 60):
            gap = slice(start, start + 120)
            lost = hips.copy()
            lost[gap] = np.nan
            for each, given in zip(errors, ([lost, shoulders], [lost]), strict=True):
                found = heading_axes(fill_heading(*given))[:, 0]
                cosines = np.clip((true * found).sum(axis=1), -1, 1)
                each.append(np.rad2deg(np.arccos(cosines))[gap])
    error, held = (np.quantile(np.concatenate(each), 0.9) for each in errors)
    assert error < 0.5 * held
    assert error < 25


def across(x, skeleton, part):
    direction = x[:, skeleton.index_of(f"left_{part}")] - x[:, skeleton.index_of(f"right_{part}")]
    return direction / np.linalg.norm(direction, axis=1, keepdims=True)
