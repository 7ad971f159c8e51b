"""Key-points of trackers and tables of joints: numbers that the tests wrote, names, clocks."""

import contextlib
import json
import re
import sys
import types

import numpy as np
import pandas as pd
import pytest
from sklearn_motionsync import Skeleton
from sklearn_motionsync.io import read_motion

from motion_files import deeplabcut, landmarks, npy, openpose, put, sleap, table, tracked

MISSING = pytest.mark.filterwarnings("ignore:.*are missing:UserWarning")
SEVERAL = pytest.mark.filterwarnings("ignore:.* holds 2 subjects:UserWarning")
ANIMALS, JOINTS = ["ann", "bob"], ["hip", "knee"]
BOTH = [f"{animal}:{joint}" for animal in ANIMALS for joint in JOINTS]
TRACKED = tracked(7, 2, 2, 3)


def positions(df):
    """Positions (n_frames, n_joints, n_axes)."""
    return df.to_numpy().reshape(len(df), len(df.attrs["joints"]), -1)


def check(df, expected, joints):
    np.testing.assert_array_equal(positions(df), expected)
    assert df.attrs["joints"] == list(joints)


# -- trackers ---------------------------------------------------------------------------


@SEVERAL
@MISSING
def test_deeplabcut_of_one_animal_and_of_several(tmp_path):
    one = put(tmp_path, deeplabcut(TRACKED[:, 0], JOINTS), "one.csv")
    df = read_motion(one, frame_rate=30)
    check(df, TRACKED[:, 0, :, :2], JOINTS)
    facts = {"format": "deeplabcut", "units": "px", "up": "-y", "frame_rate": 30.0}
    assert facts.items() <= df.attrs.items()
    path = put(tmp_path, deeplabcut(TRACKED.reshape(7, 4, 3), JOINTS, ANIMALS), "both.csv")
    both = read_motion(path)
    check(both, TRACKED.reshape(7, 4, 3)[..., :2], BOTH)
    limit = float(np.median(TRACKED[:, 1, :, 2]))
    bob = read_motion(path, subject="bob", min_confidence=limit, quality="keep")
    np.testing.assert_array_equal(bob[["hip_confidence", "knee_confidence"]], TRACKED[:, 1, :, 2])
    seen = np.where(TRACKED[:, 1, :, 2:] >= limit, TRACKED[:, 1, :, :2], np.nan)
    check(bob.iloc[:, :4].copy(), seen, JOINTS)
    assert np.isnan(seen).any()


def test_hdf5_of_deeplabcut_is_that_of_its_csv(tmp_path, monkeypatch):
    path = put(tmp_path, b"\x89HDF\r\n\x1a\n", "a.h5")
    monkeypatch.setitem(sys.modules, "tables", None)
    with pytest.raises(ValueError, match=r"a\.h5 needs the package tables \(pip install tables"):
        read_motion(path)
    monkeypatch.setitem(sys.modules, "tables", types.ModuleType("tables"))
    columns = pd.MultiIndex.from_product([["net"], ["ann"], JOINTS, ["x", "y", "likelihood"]])
    df = pd.DataFrame(TRACKED[:, 0].reshape(7, 6), columns=columns)
    monkeypatch.setattr(pd, "read_hdf", lambda path: df)
    found = read_motion(path)
    expected = read_motion(put(tmp_path, deeplabcut(TRACKED[:, 0], JOINTS, ["ann"]), "a.csv"))
    pd.testing.assert_frame_equal(found, expected)
    assert found.attrs == expected.attrs
    monkeypatch.setattr(pd, "read_hdf", lambda path: df.iloc[:, 0] / 0)
    with pytest.raises(ValueError, match=r"a\.h5 needs .* a table of DeepLabCut"):
        read_motion(path)


@SEVERAL
@MISSING
def test_sleap_with_rows_in_any_order(tmp_path):
    header, *rows = sleap(TRACKED, ANIMALS, JOINTS, start=5).splitlines()
    lost = [row for row in rows if not row.startswith(("bob,6,", "ann,8,", "bob,8,"))]
    mixed = np.random.default_rng(0).permutation(lost).tolist()
    path = put(tmp_path, "\n".join([header, *mixed]), "a.csv")
    with pytest.warns(UserWarning, match=r"a\.csv skips 1 frame after frame 7, whose positions"):
        df = read_motion(path)
    expected = TRACKED[..., :2].copy()
    expected[1, 1], expected[3] = np.nan, np.nan
    check(df, expected.reshape(7, 4, 2), BOTH)
    assert (df.attrs["first_frame"], df.attrs["units"]) == (5, "px")
    assert df.attrs["left_out"] == "the columns ['instance.score']"
    # Without tracks the instances of a frame are counted.
    untracked = sleap(TRACKED, ["", ""], JOINTS)
    assert read_motion(put(tmp_path, untracked, "b.csv")).attrs["subject"] == ["0", "1"]
    with pytest.raises(ValueError, match=r"c\.csv: frame 0 comes twice"):
        read_motion(put(tmp_path, sleap(TRACKED, ["ann", "ann"], JOINTS), "c.csv"))


@SEVERAL
@pytest.mark.parametrize("matlab", [True, False])
def test_hdf5_of_sleap(tmp_path, monkeypatch, matlab):
    values, scores = TRACKED[..., :2], TRACKED[..., 2]

    content = {
        "node_names": np.array(JOINTS, "S"),
        "track_names": np.array(ANIMALS, "S"),
        "tracks": values.transpose(1, 3, 2, 0) if matlab else values,
        "point_scores": scores.transpose(1, 2, 0) if matlab else scores,
    }
    # What h5py gives of such a file.
    opened = types.SimpleNamespace(File=lambda path: contextlib.nullcontext(content))
    path = put(tmp_path, b"\x89HDF\r\n\x1a\n...node_names...tracks", "a.h5")
    monkeypatch.setitem(sys.modules, "h5py", None)
    with pytest.raises(ValueError, match=r"a\.h5 needs h5py \(pip install h5py\) and"):
        read_motion(path)
    monkeypatch.setitem(sys.modules, "h5py", opened)
    df = read_motion(path, quality="keep")
    check(df.iloc[:, :8].copy(), values.reshape(7, 4, 2), BOTH)
    np.testing.assert_array_equal(df.iloc[:, 8:], scores.reshape(7, 4))
    content.clear()
    with pytest.raises(ValueError, match=r"a\.h5 needs h5py .* and an analysis of SLEAP"):
        read_motion(path)


@SEVERAL
@MISSING
@pytest.mark.filterwarnings("ignore:.*in a frame:UserWarning")
@pytest.mark.parametrize("n_joints", [18, 25, 7])
def test_openpose_folder_with_people_gaps_and_empty_frames(tmp_path, n_joints):
    detected = tracked(4, n_joints, 3)
    detected[0, 2] = 0
    people = detected[..., :2]
    # Numbers count by their value, and not as text.
    files = openpose(
        [detected[:1], [], detected[1:3], [], detected[3:]], "a/cam_{}_keypoints.json", 9
    )
    del files["a/cam_12_keypoints.json"]
    for name, content in files.items():
        put(tmp_path, content, name)
    put(tmp_path, "{}", "a/notes.json")
    with pytest.warns(UserWarning, match="a skips 1 frame after frame 11"):
        df = read_motion(tmp_path / "a")
    expected = np.full((5, 2, n_joints, 2), np.nan)
    expected[0, 0], expected[2], expected[4, 0] = people[0], people[1:3], people[3]
    expected[0, 0, 2] = np.nan
    np.testing.assert_array_equal(positions(df), expected.reshape(5, -1, 2))
    assert df.attrs["subject"] == ["0", "1"]
    assert (df.attrs["first_frame"], df.attrs["units"], df.attrs["up"]) == (9, "px", "-y")
    names = [name.removeprefix("0:") for name in df.attrs["joints"][:n_joints]]
    expected = {7: [f"point_{k}" for k in range(7)], 25: [*Skeleton.openpose().joints]}
    expected[18] = "Nose Neck RShoulder RElbow RWrist LShoulder LElbow LWrist RHip RKnee RAnkle "
    expected[18] = (expected[18] + "LHip LKnee LAnkle REye LEye REar LEar").split()
    assert names == expected[n_joints]


def test_openpose_of_one_person_and_other_names(tmp_path):
    people = tracked(3, 25, 3)
    people[..., :2] /= 1000
    for name, content in openpose(people[:, None], "b/cam01.{:04d}.json").items():
        put(tmp_path, content.replace(b'"person_id": [-1], ', b"").replace(b"_2d", b""), name)
    df = read_motion(tmp_path / "b")
    check(df, people[..., :2], Skeleton.openpose().joints)
    assert df.attrs["units"] is None
    assert "subject" not in df.attrs


@pytest.mark.parametrize(
    ("name", "content", "message"),
    [
        ("a_1_keypoints.json", *openpose([tracked(1, 25, 3)]).values(), "no other"),
        ("a_keypoints.json", b'{"people": []}', "its name needs a number"),
        ("a_2_keypoints.json", b'{"people": [{"pose_keypoints_2d": [1, 2]}]}', "needs 'people'"),
        ("a_2_keypoints.json", b'{"people": ', "needs 'people'"),
        ("a_2_keypoints.json", json.dumps({"people": [{"pose_keypoints_2d": [1] * 9}]}), "as many"),
    ],
)
def test_openpose_folders_that_are_wrong(tmp_path, name, content, message):
    first = openpose([tracked(1, 25, 3)], "b_{:02d}_keypoints.json", first=1)
    for file, text in (first | {name: content}).items():
        put(tmp_path, text, f"a/{file}")
    with pytest.raises(ValueError, match=rf"/a.*{message}"):
        read_motion(tmp_path / "a")


# -- tables and arrays ------------------------------------------------------------------


@pytest.mark.parametrize("spelling", ["{0}_{1}", "{0} {1}", "{1}_{0}", "{2}{3}"])
def test_mediapipe_in_several_spellings(tmp_path, spelling):
    """The spellings themselves are tested beside their parser."""
    names, values = Skeleton.mediapipe().joints, tracked(4, 33, 4)
    columns = [
        spelling.format(name.upper(), tail, name.title().replace("_", ""), tail.title())
        for name in names
        for tail in ("x", "y", "z", "visibility")
    ]
    path = put(tmp_path, table(columns, values.reshape(4, -1).tolist()), "a.csv")
    df = read_motion(path, quality="keep")
    check(df.iloc[:, :99].copy(), values[..., :3], list(names))
    np.testing.assert_array_equal(df.iloc[:, 99:], values[..., 3])
    assert (df.attrs["format"], df.attrs["up"]) == ("mediapipe", "-y")
    numbered = read_motion(put(tmp_path, landmarks(), "b.csv"))
    check(numbered, tracked(6, 33, 4)[..., :3], list(names))
    assert numbered.attrs["frame_rate"] == 50.0
    # 33 markers with numbers are no landmarks.
    markers = read_motion(put(tmp_path, re.sub(r"([xyzv])(\d+)", r"M\2_\1", landmarks()), "c.csv"))
    check(markers, tracked(6, 33, 4)[..., :3], [f"M{k}" for k in range(33)])


@pytest.mark.parametrize("n", [3, 33, 34, 553])
def test_arrays_have_the_names_of_freemocap(tmp_path, n):
    array = np.round(tracked(4, n, 3)).astype(np.int16)
    joints = [f"point_{k}" for k in range(n)]
    joints[:33] = Skeleton.mediapipe().joints if n in (33, 553) else joints[:33]
    check(read_motion(put(tmp_path, npy(array), "a.npy")), array, joints)


def test_other_arrays_are_refused(tmp_path):
    message = r"a\.npy needs an array of numbers \(n_frames, n_joints, 2 or 3\)"
    for shape, value in (((4, 3), 1), ((4, 3, 4), 1), ((1, 1), "a"), ((1,), None), ((0, 2, 3), 1)):
        with pytest.raises(ValueError, match=message):
            read_motion(put(tmp_path, npy(np.full(shape, value)), "a.npy"))


@pytest.mark.parametrize(
    ("scale", "told"),
    [(1, None), (1e3, "1000"), (1e6, r"1e\+06"), (1e7, r"1e\+07"), (1e9, r"1e\+09")],
)
def test_times_without_a_unit_are_known_by_their_steps(tmp_path, scale, told):
    values = tracked(40, 3).tolist()
    rows = [[round(k / 30 * scale, 3), *row] for k, row in enumerate(values)]
    path = put(tmp_path, table(["Timestamp", "Hip.X", "Hip.Y", "Hip.Z"], rows, "\t"), "a.tsv")
    message = rf"a\.tsv: the times of 'Timestamp' .* {told} a second"
    with pytest.warns(UserWarning, match=message) if told else contextlib.nullcontext():
        df = read_motion(path)
    assert df.attrs["frame_rate"] == pytest.approx(30, rel=1e-5)
    check(df, np.array(values)[:, None], ["Hip"])


@MISSING
def test_kinect_with_states_and_anipose_with_errors(tmp_path):
    columns = ["frame", "JOINT_HIP.x", "JOINT_HIP.y", "JOINT_HIP.z", "JOINT_HIP.TrackingState"]
    rows = [[0, 1, 2, 3, "Tracked"], [1, 4, 5, 6, "Inferred"], [2, 0, 0, 0, "NotTracked"]]
    path = put(tmp_path, table(columns, rows), "a.csv")
    assert np.isnan(positions(read_motion(path))).any(axis=(1, 2)).tolist() == [False, False, True]
    limited = read_motion(path, min_confidence=0.6, quality="keep")
    assert np.isnan(limited["JOINT_HIP_x"]).tolist() == [False, True, True]
    assert limited["JOINT_HIP_confidence"].tolist() == [1, 0.5, 0]
    columns = [f"knee_{tail}" for tail in ("x", "y", "z", "error", "ncams", "score")]
    path = put(tmp_path, table([*columns, "fnum"], [[1, 2, 3, 9, 3, 0.7, 0]]), "b.csv")
    df = read_motion(path)
    check(df, np.array([[[1, 2, 3]]]), ["knee"])
    assert df.attrs["left_out"] == "the columns ['knee_error', 'knee_ncams']"
    assert (df.attrs["first_frame"], df.attrs["units"]) == (0, None)


@MISSING
def test_decimal_commas_quotes_units_blanks_and_texts(tmp_path):
    text = '"Hip_x (mm)";"Hip_y (mm)";"note"\n1,5;2,25;"a;b"\n;4;c\n\n7,125;8;\n'
    df = read_motion(put(tmp_path, text, "a.csv"))
    check(df, np.array([[[1.5, 2.25]], [[np.nan, 4]], [[7.125, 8]]]), ["Hip"])
    assert (df.attrs["units"], df.attrs["left_out"]) == ("mm", "the columns ['note']")


def test_columns_that_are_no_joints_are_values(tmp_path):
    text = table(["time (ms)", "knee", "EMG"], [[0, 1, 2], [20, 3, 4]])
    df = read_motion(put(tmp_path, text, "a.csv"))
    np.testing.assert_array_equal(df, [[1, 2], [3, 4]])
    facts = {"kind": "values", "channels": ["knee", "EMG"], "frame_rate": 50.0, "format": "table"}
    assert facts.items() <= df.attrs.items()


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("hip_x,hip_y\n1,2\n3,b4\n", r", line 3: column 'hip_y' needs numbers, .* got 'b4'"),
        ("hip_x,hip_y\n\n1,2\n3\n", r", line 4: a row needs 2 columns, .* got 1 \("),
        ("hip_x,hip_y\n", "the file ends where frames should follow"),
        ('hip_x,hip_y\n1,"2\n3,4\n', "holds rows that are no table"),
        ("1,2\n3,4\n", "line 1: a header needs a name above each column"),
        ("name,note,age\na,b,3\n", "no recording, most of its columns are text: .'name', 'n"),
        ("frame,hip_x,hip_y\n0,1,2\n0,3,4\n", "frame 0 comes twice. If it holds several trials"),
        ("frame,hip_x,hip_y\n0.5,1,2\n1,3,4\n", "frames need whole numbers"),
        ("time,hip_x,hip_y\n1,1,2\n0,3,4\n", "times of 'time' must not decrease"),
        ("frame,hip_x,hip_y\n0,1,2\n1,2,3\n99999999,3,4\n", "100000000 frames would take"),
    ],
)
def test_wrong_tables_are_refused_with_the_place(tmp_path, text, message):
    path = put(tmp_path, text, "a.csv")
    with pytest.raises(ValueError, match=message) as caught:
        read_motion(path)
    assert str(caught.value).startswith(str(path))


def test_the_confidence_is_cut_with_the_frames(tmp_path):
    text = "hip_x,hip_y,hip_likelihood\n,,0.1\n1,2,0.2\n3,4,0.3\n5,6,0.4\n"
    df = read_motion(put(tmp_path, text, "a.csv"), ends="trim", quality="keep")
    assert df["hip_confidence"].tolist() == [0.2, 0.3, 0.4]
