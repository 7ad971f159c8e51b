"""Text exports of Vicon Nexus, Qualisys QTM and OptiTrack Motive, against the numbers written."""

import re

import numpy as np
import pytest
from sklearn_motionsync import Skeleton
from sklearn_motionsync.io import read_motion

from motion_files import cells, motive, nexus, part, put, qtm, tracks, vicon

XYZ = tracks().reshape(40, 9)


def read(tmp_path, text, name="a.csv", **params):
    return read_motion(put(tmp_path, text, name), **params)


# -- Vicon Nexus ------------------------------------------------------------------------


@pytest.mark.parametrize("separator", [",", ";", "\t"])
@pytest.mark.parametrize("order", [(0, 1, 2, 3, 4), (2, 4, 3, 1, 0), (4, 3, 2, 1, 0)])
def test_sections_of_nexus_are_read_in_any_order(tmp_path, separator, order):
    text, values, forces = nexus()
    parts = re.split(r"\n(?=Gait|Model|Trajectories|Devices)", text)
    text = "\n\n".join(parts[k].strip("\n") for k in order) + "\n"
    if separator == ";":
        text = text.replace(",", ";").replace(".", ",").replace("N,mm", "N.mm")
    text = text.replace(",", separator) if separator == "\t" else text
    df = read(tmp_path, text)
    np.testing.assert_array_equal(df, values[1])
    facts = {"joints": ["LASI", "RASI"], "subject": "Ann", "units": "mm", "frame_rate": 100}
    facts |= {"first_frame": 101, "first_time": 1.0, "kind": "markers", "format": "vicon"}
    assert facts.items() <= df.attrs.items()
    assert [(e["label"], e["context"], e["time"], e["frame"]) for e in df.attrs["events"]] == [
        ("Foot Off", "Left", 1.1, 10.0),
        ("Foot Strike", "Right", 1.23, 23.0),
    ]
    for said in ("1 angle", "1 moment", "2 analog channels at 400 Hz", "'Gait Cycle Parameters'"):
        assert said in df.attrs["left_out"]
    angles = read(tmp_path, text, group="angles")
    np.testing.assert_array_equal(angles, values[0][:, :3])
    assert (angles.attrs["joints"], angles.attrs["units"]) == (["LKneeAngles"], "deg")
    moments = read(tmp_path, text, group="moments")
    np.testing.assert_array_equal(moments, values[0][:, 3:])
    facts = {"channels": ["Fx", "EMG"], "units": ["N", "V"], "frame_rate": 400, "first_time": 1.0}
    for group in ("analog", "devices"):
        analog = read(tmp_path, text, group=group)
        np.testing.assert_array_equal(analog, forces)
        assert facts.items() <= analog.attrs.items()
        assert [event["frame"] for event in analog.attrs["events"]] == [40.0, 92.0]


@pytest.mark.parametrize(
    ("unit", "name", "group"),
    [
        ("deg", "x", "angles"),
        ("N/kg", "x", "forces"),
        ("N.mm/kg", "x", "moments"),
        ("Nm", "x", "moments"),
        ("W/kg", "LHipPower", "powers"),
        ("mm", "CentreOfMass", "positions"),
        ("", "RHipMoment", "moments"),
        ("", "LElbowAngles", "angles"),
        ("", "Index", "scalars"),
        ("mm/s", "Speed", "scalars"),
    ],
)
def test_model_outputs_are_known_by_their_units_and_names(tmp_path, unit, name, group):
    text = vicon("Model Outputs", 100, [name, "Other"], XYZ[:, :6], units=[unit] * 3 + ["lx"] * 3)
    n = 3 + 3 * (group == "scalars")
    df = read(tmp_path, text, group=group)
    np.testing.assert_array_equal(df, XYZ[:, :n])
    assert df.attrs["units"] == (unit or None if n == 3 else None)
    with pytest.raises(ValueError, match=rf"a\.csv: there are no markers .* reads .*'{group}' \("):
        read(tmp_path, text)


def test_segments_have_positions_and_single_columns_are_channels(tmp_path):
    axes = ["RX", "RY", "RZ", "TX", "TY", "TZ"]
    text = vicon("Segments", 50, ["Ann:HED"], XYZ[:, :6], axes, units=["deg"] * 3 + ["mm"] * 3)
    text += "\n" + vicon("Model Outputs", 50, ["Ann:Load"], XYZ[:, :1], ["X"], units="J")
    df = read(tmp_path, text, group="segments")
    np.testing.assert_array_equal(df, XYZ[:, 3:6])
    assert df.attrs["left_out"] == "1 scalar, 1 rotation"
    np.testing.assert_array_equal(read(tmp_path, text, group="scalars"), XYZ[:, :1])
    # Those of several plates have the names of their plates.
    text = vicon("Devices", 50, ["Plate 1", "Plate 2"], XYZ[:, :4], ["Fx", "Fy"], units="N")
    text += "\n" + vicon("Devices", 200, ["EMG"], XYZ[:, :1], ["1"], units="V", per_frame=4)
    df = read(tmp_path, text, group="analog")
    assert list(df) == ["Plate 1 Fx", "Plate 1 Fy", "Plate 2 Fx", "Plate 2 Fy"]
    np.testing.assert_array_equal(df, XYZ[:, :4])
    assert read(tmp_path, text, group="analog_2").attrs["frame_rate"] == 200


@pytest.mark.parametrize("blank", ["nan", "0.0"])
def test_blank_cells_of_nexus_are_hidden_markers(tmp_path, blank):
    values = XYZ.copy()
    values[3:9, 3:6] = float(blank)
    text = vicon("Trajectories", 100, ["Ann:LASI", "Bob:LASI", "*12"], values)
    lines = text.split("\n")
    # A program for tables leaves out blank cells at the end, and fills rows up with them.
    lines[0] += ",,,"
    lines[7] += ",,"
    with pytest.warns(UserWarning, match=r" are missing .* of 1 of 3 markers \(Bob:LASI\)"):
        df = read(tmp_path, "\n".join(lines))
    values[3:9, 3:6] = np.nan
    np.testing.assert_array_equal(df, values)
    values[4, 6:] = np.nan
    lines[9] = ",".join(lines[9].split(",")[:-3])
    with pytest.warns(UserWarning, match=r"of 2 of 3 markers"):
        np.testing.assert_array_equal(read(tmp_path, "\n".join(lines)), values)
    cut = "\n".join(lines[:10])
    with pytest.raises(ValueError, match=r"a\.csv, line 10: a row needs 11 fields, got 8"):
        read(tmp_path, cut)


def test_export_of_older_programs_has_one_column_of_frames_and_no_units(tmp_path):
    rows = np.column_stack([np.arange(1, 41), XYZ])
    head = [["Title"], ["Date:"], ["Notes:", '""'], ["TRAJECTORIES"], [100, "Hz"]]
    head += [["", "LASI", "", "", "RASI", "", "", "SACR", "", ""], ["Field #", *"XYZ" * 3]]
    df = read(tmp_path, cells(*head, rows))
    np.testing.assert_array_equal(df, XYZ)
    assert (df.attrs["frame_rate"], df.attrs["units"]) == (100, None)
    lost = np.delete(rows, 17, axis=0)
    with pytest.warns(UserWarning, match="its times are uneven"):
        assert read(tmp_path, cells(*head, lost)).attrs["frame_rate"] is None


# -- Qualisys QTM -----------------------------------------------------------------------

NAMES = ["LASI", "R Knee", "SACR"]


@pytest.mark.parametrize("columns", [True, False])
@pytest.mark.parametrize("blank", ["nan", "0.0"])
@pytest.mark.parametrize("end", ["", "\t"])
def test_markers_of_qtm_with_and_without_frame_and_time(tmp_path, columns, blank, end):
    values = XYZ.copy()
    values[3:9, 6:] = float(blank)
    values[20] = float("nan")  # a row of tabs
    text = qtm(NAMES, values, columns, {"EVENT": "Step\t12\t0.11000", "TRAJECTORY_TYPES": "Mixed"})
    values[3:9, 6:] = np.nan
    with pytest.warns(UserWarning, match="positions are missing"):
        df = read(tmp_path, text.replace("\n", end + "\n"), "a.tsv")
    np.testing.assert_array_equal(df, values)
    facts = {"joints": NAMES, "frame_rate": 100, "units": "mm", "first_frame": 1, "format": "qtm"}
    assert facts.items() <= df.attrs.items()
    step = {"label": "Step", "context": None, "time": 0.11, "frame": 11.0}
    assert df.attrs["events"] == [step]


def test_bodies_of_qtm_have_positions(tmp_path):
    for width, columns in ((16, False), (7, True)):
        values = np.random.default_rng(0).integers(1, 99, (9, 2 * width)) / 4
        text = qtm(["Head", "Cup"], values, columns, contents="6D")
        df = read(tmp_path, text, "a.tsv")
        expected = values.reshape(9, 2, width)[:, :, :3].reshape(9, 6)
        np.testing.assert_array_equal(df, expected)
        assert (df.attrs["kind"], df.attrs["left_out"]) == ("joints", "2 rotations")


def test_counts_of_qtm_that_contradict_the_rows_are_warnings(tmp_path):
    text = qtm(NAMES, XYZ, header={"NO_OF_FRAMES": 900, "NO_OF_MARKERS": 2})
    markers = pytest.warns(UserWarning, match="NO_OF_MARKERS says 2, but 3 markers follow")
    with markers, pytest.warns(UserWarning, match="FRAMES says 900, but 40 frames f"):
        np.testing.assert_array_equal(read(tmp_path, text, "a.tsv"), XYZ)
    with pytest.raises(ValueError, match=r"a\.tsv, line 49: NO_OF_FRAMES says 900, .*not compl"):
        read(tmp_path, text[:-1], "a.tsv")
    for change, message in (
        (("\tSACR\n", "\n"), "MARKER_NAMES names 2, each with 3 columns, .* got 11 columns"),
        (("INCLUDED\t3D", "INCLUDED\tAngle"), "expected DATA_INCLUDED 3D .* got 'Angle'"),
        (("\n3\t0.02000\t", "\n3\t0.02000\t7\t"), "line 12: a row needs 11 fields, got 12"),
        (("\n3\t0.02000\t", "\n3\t0.00500\t"), "line 12: the time of a row must be a number"),
    ):
        with pytest.raises(ValueError, match=rf"a\.tsv, line \d+: .*{message}|a\.tsv, {message}"):
            read(tmp_path, text.replace(*change), "a.tsv")


# -- OptiTrack Motive -------------------------------------------------------------------

BONES = ("Hip", "Ab", "LThigh")


def take(values, parents=None, more=(), **facts):
    columns = [column for j, x in enumerate(BONES, 1) for column in part("Bone", f"S:{x}", j)]
    parents = parents and [parent for parent in parents for _ in range(7)]
    return motive([*columns, *more], values, parents=parents, **facts)


def moved(n=21):
    return np.random.default_rng(0).integers(-99, 99, (30, n)) / 8


@pytest.mark.parametrize(
    ("parents", "expected"),
    [
        (None, [-1, -1, -1]),
        ([0, 1, 1], [-1, 0, 0]),
        (["", "S:Hip", "Hip"], [-1, 0, 0]),
        ([2, 3, 0], [1, 2, -1]),
    ],
)
def test_bones_of_motive_have_positions_and_parents(tmp_path, parents, expected):
    df = read(tmp_path, take(moved(), parents, first=240))
    places = [7 * j + 4 + k for j in range(3) for k in range(3)]
    np.testing.assert_array_equal(df, moved()[:, places])
    facts = {"joints": list(BONES), "parents": expected, "subject": "S", "frame_rate": 120}
    facts |= {"units": "m", "up": "y", "kind": "joints", "left_out": "3 rotations"}
    facts |= {"first_frame": 240, "first_time": 2.0, "format": "motive"}
    assert facts.items() <= df.attrs.items()


def test_markers_of_motive_are_a_group_of_a_file_with_bones(tmp_path):
    kinds = [("Marker", "S:HTop"), ("Marker", "Unlabeled 1036"), ("Bone Marker", "S:Hip_1")]
    more = [column for kind, name in kinds for column in part(kind, name, "A1", turns=False)]
    values = moved(30)
    values[:5, 27:] = values[7:9, 21:24] = np.nan
    path = put(tmp_path, take(values, more=more), "a.csv")
    assert read_motion(path).attrs["left_out"] == (
        "1 marker, 3 rotations, 1 unlabelled marker, 1 bone marker"
    )
    with pytest.warns(UserWarning, match="1 of 1 marker"):
        df = read_motion(path, group="markers")
    np.testing.assert_array_equal(df, values[:, 21:24])
    assert df.attrs["joints"] == ["HTop"]
    # Without bones the markers are read.
    text = motive(more, values[:, 21:], **{"Length Units": "Millimeters"})
    with pytest.warns(UserWarning, match="1 of 1 marker"):
        alone = read(tmp_path, text)
    np.testing.assert_array_equal(alone, df)
    assert alone.attrs["units"] == "mm"
    with pytest.raises(ValueError, match=r"a\.csv: there are no markers .* not its 1 unlabelled m"):
        read(tmp_path, motive(more[3:], values[:, 24:]))


def test_skeleton_of_motive_is_made_of_its_bones(tmp_path):
    bones = ["Shoulder", "UArm", "FArm", "Hand", "Thigh", "Shin", "Foot", "Toe"]
    names = ["Hip", "Ab", "Chest", "Neck", "Head", *(side + x for side in "LR" for x in bones)]
    columns = [x for j, name in enumerate(names) for x in part("Bone", f"Ann:{name}", j, False)]
    df = read(tmp_path, motive(columns, moved(3 * len(names))))
    landmarks, parts = Skeleton.from_frame(df).landmarks, ("shoulder", "wrist", "hip", "ankle")
    assert [landmarks[f"left_{x}"] for x in parts] == ["LUArm", "LHand", "LThigh", "LFoot"]
    assert len(landmarks) == 15
    assert "Subject: Ann." in df.attrs["report"]


@pytest.mark.parametrize(
    ("parents", "change", "message"),
    [
        ([0, 1, 1], ("Name,", "Label,"), "line 8: expected rows of Type, Name, ID and 'Frame,Ti"),
        ([0, 1, 1], ("Space,Global", "Space,Local"), "are those in the parent bone; export them a"),
        ([0, 3, 2], ("", ""), "a bone that is below itself"),
        ([0, 1, 1], ("\n9,0.075000,", "\n9,0.075000,7,"), "line 18: a row needs 23 fields, got 24"),
        ([0, 1, 1], ("\n9,0.075000,", "\n9,x,"), "line 18: a frame needs numbers, .* got 'x"),
    ],
)
def test_wrong_files_of_motive_are_refused(tmp_path, parents, change, message):
    text = take(moved(), parents).replace(*change)
    with pytest.raises(ValueError, match=rf"a\.csv, .*{message}"):
        read(tmp_path, text)


def test_exported_frames_that_contradict_the_rows_are_a_warning(tmp_path):
    text = take(moved(), **{"Total Exported Frames": 31})
    with pytest.warns(UserWarning, match="Total Exported Frames says 31, but 30 frames follow"):
        assert len(read(tmp_path, text)) == 30
