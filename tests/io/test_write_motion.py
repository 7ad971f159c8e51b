"""write_motion: files are read back, by another reader too, and bones keep their length."""

import numpy as np
import pandas as pd
import pytest
from sklearn.pipeline import make_pipeline
from sklearn_motionsync import ActionModel, ASpace, DenseSynchronizer, DirectionCosines, Skeleton
from sklearn_motionsync.datasets import make_bending, make_walk
from sklearn_motionsync.io import read_motion, write_motion
from sklearn_motionsync.synchronizers import blend_trials

from motion_files import body, put
from plain_readers import plain_bvh

BENDING = make_bending(6, random_state=0)
LEG = 0.85
BRACE = pd.DataFrame(0.0, [0, 1], ["a{_x", "a{_y", "a{_z"])
BRACE.attrs |= {"joints": ["a{"], "parents": [-1]}
MIXED = pd.DataFrame({"knee": [0.1, 0.2], "hip": [1.0, 2.0]})
MIXED.attrs["units"] = ["rad", "deg"]
MARKERS = pd.DataFrame(BENDING.data[0], columns=BENDING.skeleton.column_names)


def written(tmp_path, X, *args, name="out.bvh", **how):
    write_motion(tmp_path / name, X, *args, **how)
    return read_motion(tmp_path / name)


def joints_of(df, skeleton):
    return df[skeleton.column_names].to_numpy().reshape(len(df), -1, 3)


@pytest.mark.parametrize("order", ["XYZ", "XZY", "YXZ", "YZX", "ZXY", "ZYX"])
def test_bvh_is_read_back(tmp_path, order):
    """Hinges, which turn about all axes then, joints that move in their parents or not at all."""
    df = read_motion(put(tmp_path, body(order)))
    again = written(tmp_path, df)
    assert again.columns.tolist() == df.columns.tolist()
    for new, old in zip(again.attrs["rig"]["channels"], df.attrs["rig"]["channels"], strict=True):
        assert new[: len(old)] == old
        assert len(set(new) - {"Xposition", "Yposition", "Zposition"}) == 3 * bool(old)
    np.testing.assert_allclose(again, df, atol=1e-4)
    assert again.attrs["frame_rate"] == pytest.approx(50)
    plain = plain_bvh(tmp_path / "out.bvh")
    np.testing.assert_allclose(plain.reshape(len(df), -1), again, atol=1e-9)


def test_file_of_people_is_read_back(tmp_path, real_data):
    """142 joints; positions within 1e-4 of a leg, also by a reader that shares no code."""
    (path,) = (real_data / "original_files" / "bvh").glob("*.bvh")
    df = read_motion(path).iloc[:60]
    again = written(tmp_path, df)
    assert again.columns.tolist() == df.columns.tolist()
    leg = 90
    assert np.abs(again.to_numpy() - df.to_numpy()).max() < 1e-4 * leg
    plain = plain_bvh(tmp_path / "out.bvh")
    np.testing.assert_allclose(plain.reshape(len(df), -1), df, atol=1e-4 * leg)
    part = written(tmp_path, df.iloc[20:60:2])
    assert part.attrs["frame_rate"] == pytest.approx(df.attrs["frame_rate"] / 2)
    np.testing.assert_allclose(part, df.iloc[20:60:2], atol=1e-4 * leg)


@pytest.fixture(scope="module")
def bodies():
    """Bodies that were synchronised, blended and sampled, and a walk with feet."""
    steps = DirectionCosines(BENDING.skeleton), ASpace(), DenseSynchronizer(40), ActionModel()
    pipe = make_pipeline(*steps).fit(BENDING.data, actionmodel__groups=BENDING.actor)
    skeleton = BENDING.skeleton.body()
    back = pipe[:2].inverse_transform(pipe[:-1].transform(BENDING.data[:1]))
    sample = pipe[:2].inverse_transform(pipe[-1].sample(1, random_state=0))
    blend = blend_trials(pipe[:-1], BENDING.data[:2], weights=[0.5, 0.5])
    walk = make_walk(1, noise=0, random_state=0)
    return {
        "synchronised": (back[0], skeleton),
        "sampled": (sample[0], skeleton),
        "blended": (np.asarray(blend), skeleton),
        "walk": (walk.data[0], walk.skeleton),
    }


@pytest.mark.parametrize("kind", ["synchronised", "sampled", "blended", "walk"])
def test_bones_keep_their_length_and_joints_their_place(tmp_path, bodies, kind):
    x, skeleton = bodies[kind]
    df = written(tmp_path, x, skeleton, frame_rate=30)
    found, given = joints_of(df, skeleton), x.reshape(len(x), -1, 3)
    for a, b in skeleton.bones:
        length = np.linalg.norm(found[:, a] - found[:, b], axis=1)
        assert np.ptp(length) < 1e-3 * length.mean()
    exact = kind in ("synchronised", "sampled")
    assert np.linalg.norm(found - given, axis=2).max() < (1e-4 if exact else 0.01) * LEG


def test_hips_hang_on_their_middle(tmp_path):
    """Hips 8 cm below the pelvis, whatever way they tilt: all joints are where they were."""
    t = np.linspace(0, 3, 40)
    tilt = 0.1 * np.stack([np.cos(t), np.sin(t), 0 * t], axis=1)
    pelvis = np.stack([t, 1 + 0 * t, 0 * t], axis=1)
    left, right = (pelvis - [0, 0.08, 0] + sign * tilt for sign in (1, -1))
    knees = [hip - [0, 0.4, 0.1] for hip in (left, right)]
    names = ["pelvis", "left_hip", "right_hip", "left_knee", "right_knee"]
    x = np.concatenate([pelvis, left, right, *knees], axis=1)
    skeleton = Skeleton(names, [-1, 0, 0, 1, 2])
    df = written(tmp_path, x, skeleton, frame_rate=30)
    np.testing.assert_allclose(df[skeleton.column_names], x, atol=1e-5)
    assert df.attrs["joints"].count("pelvis_middle") == 1
    # Without the pair each keeps its mean distance.
    x[:, 6:9] += 0.02 * np.sin(7 * t)[:, np.newaxis] * [0, 1, 0]
    df = written(tmp_path, x, skeleton, frame_rate=30)
    assert "pelvis_middle" not in df.attrs["joints"]


def test_on_the_rig_of_another_file(tmp_path):
    """Joints, offsets' directions and channels are those of the file, lengths those of the body."""
    other, *_, mine = BENDING.data
    rig = written(tmp_path, other, BENDING.skeleton, frame_rate=30, name="rig.bvh")
    for like in (rig, tmp_path / "rig.bvh"):
        df = written(tmp_path, 1.2 * mine, BENDING.skeleton, frame_rate=60, like=like)
        assert df.columns.tolist() == rig.columns.tolist()
        assert df.attrs["rig"]["channels"] == rig.attrs["rig"]["channels"]
        off = joints_of(df, BENDING.skeleton) - 1.2 * mine.reshape(len(mine), -1, 3)
        assert np.linalg.norm(off, axis=2).mean() < 0.005
    part = pd.DataFrame(mine, columns=BENDING.skeleton.column_names).iloc[:, 3:]
    part.attrs |= {"frame_rate": 30.0}
    with pytest.raises(ValueError, match=r"X lacks the joints \['pelvis'\] of the rig"):
        written(tmp_path, part, like=rig)


def test_axes_and_place(tmp_path):
    """z up becomes y up; in place the root stays where it begins, and its height moves."""
    walk = make_walk(1, noise=0, random_state=0)
    skeleton, names = walk.skeleton, walk.skeleton.column_names
    df = pd.DataFrame(walk.data[0], columns=names)
    places = walk.data[0].reshape(len(df), -1, 3)[..., [2, 0, 1]]
    turned = pd.DataFrame(places.reshape(df.shape), columns=names)
    turned.attrs |= {"frame_rate": 100.0, "up": "z"}
    turned.attrs |= {"joints": list(skeleton.joints), "parents": list(skeleton.parents)}
    found = written(tmp_path, turned)
    # A rotation: x forward, y left, z up become z forward ... as `to_y_up` has it.
    np.testing.assert_allclose(found["head_y"], df["head_y"], atol=0.01)
    still = written(tmp_path, walk.data[0], skeleton, frame_rate=100, in_place=True)
    assert np.ptp(still[["pelvis_x", "pelvis_z"]].to_numpy(), axis=0).max() < 1e-5
    np.testing.assert_allclose(still["pelvis_y"], df["pelvis_y"], atol=1e-5)


@pytest.mark.parametrize("ending", [".bvh", ".trc"])
def test_a_single_frame_is_a_pose(tmp_path, ending):
    pose = pd.DataFrame(BENDING.data[0][:1], columns=BENDING.skeleton.column_names)
    found = written(tmp_path, pose, BENDING.skeleton, frame_rate=30, name=f"pose{ending}")
    np.testing.assert_allclose(found[list(pose)], pose, atol=0.01)
    again = written(tmp_path, found, name=f"again{ending}")
    np.testing.assert_allclose(again, found, atol=1e-5)
    assert again.columns.equals(found.columns)


def test_trc_is_read_back(tmp_path):
    """Gaps stay gaps; times, units and names too."""
    x = pd.DataFrame(BENDING.data[0], columns=BENDING.skeleton.column_names)
    x.iloc[5:9, 3:6] = np.nan
    x.attrs |= {"frame_rate": 60.0, "units": "m", "up": "y"}
    with pytest.warns(UserWarning, match="missing"):
        found = written(tmp_path, x, name="out.trc")
    np.testing.assert_allclose(found, x, atol=1e-6)
    assert found.columns.tolist() == x.columns.tolist()
    assert (found.attrs["frame_rate"], found.attrs["units"]) == (60.0, "m")


@pytest.mark.parametrize("ending", [".mot", ".sto"])
def test_tables_of_opensim_are_read_back(tmp_path, ending):
    angles = pd.DataFrame({"knee": [1.5, 2.25, 3.0], "hip": [0.0, -1e-3, 4e5]})
    for rate in (0.5, 50, 59.94, 2400, 1e5, 1e7):
        found = written(tmp_path, angles, name=f"inDegrees=no{ending}", frame_rate=rate)
        np.testing.assert_allclose(found, angles)
        assert found.attrs["frame_rate"] == pytest.approx(rate, rel=1e-5)
        assert found.attrs["units"] is None


@pytest.mark.parametrize(
    ("units", "expected"),
    [
        *((unit, "rad") for unit in ("rad", "Radians", "rads", ["rad", "radian"], ["rad", "m"])),
        *((unit, "rad") for unit in ("rad/s", "radians/s", ["m", "rad/s²"])),
        *((unit, "deg") for unit in ("deg", "Degrees", "°", "deg/s", "°/s", ["m", "degrees/s"])),
        *((unit, None) for unit in (None, "mm", "N", "radial", "grad", ["m", "N"])),
    ],
)
def test_radians_stay_radians(tmp_path, units, expected):
    angles = pd.DataFrame({"knee": [0.1, 0.2, 0.3], "hip": [1.0, 2.0, 3.0]})
    angles.attrs["units"] = units
    found = written(tmp_path, angles, name="out.sto", frame_rate=50)
    assert found.attrs["units"] == expected


@pytest.mark.parametrize(
    ("how", "message"),
    [
        ({"name": "a.fbx"}, "for which there is no writer; the known endings are .bvh, .trc"),
        ({"frame_rate": np.inf}, "frame_rate must be frames a second, above 0, got inf"),
        ({"frame_rate": None}, "the frame rate is not known: give frame_rate="),
        ({"skeleton": None}, "an array does not name its joints: give a skeleton"),
        ({"X": np.full((4, 45), np.nan)}, "joint 'pelvis' is NaN in frame 0. Fill gaps first"),
        ({"X": np.zeros((4, 44))}, "X has 44 columns, and 15 joints need 45"),
        ({"name": "a.trc", "like": "b.bvh"}, "like= goes with .bvh files only"),
        ({"name": "a.mot"}, "give a DataFrame, whose columns have names"),
        *(
            ({"name": "a.sto", "X": pd.DataFrame({name: [1.0, 2]})}, "cannot have the name")
            for name in ("", " ", "a\tb", "a\nb")
        ),
        ({"name": "a.sto", "X": MIXED}, "'hip' is in degrees and 'knee' in radians"),
        ({"X": MARKERS, "skeleton": None}, "a BVH file has one root, got 15: give a skeleton"),
        ({"X": BRACE, "skeleton": None}, r"such a file cannot have the name 'a\{'"),
        ({"name": "a.sto", "X": MIXED / 0}, r"frame 0, feature 0 \('knee'\) is infinity"),
    ],
)
def test_refused(tmp_path, how, message):
    given = {"X": BENDING.data[0], "skeleton": BENDING.skeleton, "frame_rate": 30} | how
    name = given.pop("name", "a.bvh")
    with pytest.raises(ValueError, match=message):
        write_motion(tmp_path / name, given.pop("X"), **given)
    assert not (tmp_path / name).exists()
