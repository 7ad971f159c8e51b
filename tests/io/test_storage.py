"""MOT and STO: columns, units, times, and errors of wrong files."""

import numpy as np
import pandas as pd
import pytest
from sklearn_motionsync.io import read_motion

from motion_files import put, storage

VALUES = np.random.default_rng(0).normal(0, 30, (50, 3)).round(6)
LABELS = ["pelvis_tilt", "knee_angle_r", "/jointset/hip_r/hip_flexion_r/value"]
FORCES = ["R_ground_force_vx", "R_ground_torque_x", "1_ground_moment"]
PLAIN = "version=1\nnRows={n}\nnColumns={m}\n"
TEXT = storage(VALUES, LABELS)


def read(tmp_path, text, name="a.mot", **params):
    return read_motion(put(tmp_path, text, name), **params)


def test_columns_and_times_are_read(tmp_path):
    df = read(tmp_path, TEXT)
    np.testing.assert_array_equal(df, VALUES)
    facts = {"format": "mot", "kind": "coordinates", "units": None, "up": None}
    facts |= {"frame_rate": 100.0, "channels": LABELS, "first_time": 0.0}
    facts["report"] = "50 frames of 3 channels (coordinates) at 100 Hz."
    assert df.attrs == facts | {"trial": "a", "levels": ["recording", "frame"]}


@pytest.mark.parametrize(
    ("said", "labels", "units"),
    [
        ("inDegrees=yes", LABELS, "deg"),
        ("indegrees = NO", LABELS, "rad"),
        ("inDegrees yes", LABELS, "deg"),
        ("inDegrees\t=\tn", LABELS, "rad"),
        ("inDegrees=perhaps", LABELS, None),
        ("inDegrees=yes", FORCES, None),
    ],
)
def test_header_and_labels_give_units_and_kind(tmp_path, said, labels, units):
    df = read(tmp_path, storage(VALUES, labels, header=PLAIN + said + "\n"))
    assert df.attrs["units"] == units
    assert df.attrs["kind"] == ("forces" if labels == FORCES else "coordinates")


@pytest.mark.parametrize(
    "text",
    [
        TEXT.replace("\n", "\t\t\n"),
        TEXT.replace("endheader\n", "EndHeader   \n\n"),
        # The header of SIMM, and none but its end.
        storage(VALUES, LABELS, header="\n# SIMM\nname x\ndatacolumns {m}\ndatarows {n}\n"),
        storage(VALUES, LABELS, header="\n"),
        TEXT.replace("nColumns=4", "nColumns=3"),
        TEXT.replace("\t", "    \t  "),
        TEXT.replace("\t", " "),
        TEXT.replace("time\t", "  Time\t"),
    ],
)
def test_variants_of_programs_are_the_same(tmp_path, text):
    pd.testing.assert_frame_equal(read(tmp_path, text), read(tmp_path, TEXT))


@pytest.mark.parametrize(
    ("kind", "ends"),
    [("Vec3", "xyz"), ("Quaternion", "wxyz"), ("vec2", "xy"), ("SpatialVec", "123456")],
)
@pytest.mark.parametrize("form", ["{}", "~[{}]"])
def test_vectors_become_columns(tmp_path, kind, ends, form):
    values = np.random.default_rng(0).normal(size=(20, 2, len(ends)))
    cells = [[form.format(",".join(map(str, cell))) for cell in row] for row in values]
    header = f"DataRate=100.000000\nDataType={kind}\nversion=3\n"
    df = read(tmp_path, storage(cells, ["a_imu", "b_imu"], header=header), "a.sto")
    np.testing.assert_array_equal(df, values.reshape(20, -1))
    assert list(df.columns) == [f"{name}_imu_{end}" for name in "ab" for end in ends]


@pytest.mark.parametrize("nothing", ["nan", "-NaN", "1.#QNAN", "-nan(ind)", "inf", "-Infinity", ""])
def test_missing_values_are_nan_with_a_warning(tmp_path, nothing):
    text = TEXT.replace(f"\t{VALUES[7, 1]}\t", f"\t{nothing}\t")
    with pytest.warns(UserWarning, match=r"a\.mot: 0\.67 % .* of 1 of 3 coordinates \(knee_a"):
        df = read(tmp_path, text)
    expected = VALUES.copy()
    expected[7, 1] = np.nan
    np.testing.assert_array_equal(df, expected)


@pytest.mark.parametrize("stated", [0, 49, 51])
def test_stated_rows_that_contradict_those_that_are_there_are_a_warning(tmp_path, stated):
    for key in ("nRows", "datarows"):
        text = TEXT.replace("nRows=50", f"{key}={stated}")
        with pytest.warns(UserWarning, match=rf"a\.mot: {key} says {stated}, but 50 frames follow"):
            np.testing.assert_array_equal(read(tmp_path, text), VALUES)
        with pytest.raises(ValueError, match=rf"{key} says {stated}, .* the file is not complete"):
            read(tmp_path, text[:-1])


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (("endheader", "end"), r"line 56: the file ends where 'endheader' should follow"),
        (("time\t", "t\t"), r"line 6: expected 'time' and the names of the other columns, got 't"),
        (("\tknee_angle_r", "\t"), "line 6: expected 'time' and the names"),
        (("nRows=50", "nRows=x"), "nRows needs a whole number, 0 or more, got 'x'"),
        (("\n0.08000000\t", "\n0.08000000\t7\t"), "line 15: a row needs its time and 3 columns"),
        (("\n0.08000000\t", "\n0.08000000\t0,"), "line 15: a frame needs numbers, .* got '0,"),
        (("\n0.08000000\t", "\n0.06000000\t"), "line 15: the time .* got 0.06 after 0.07"),
        (("version=1", "DataType=Vec3"), "line 7: a row needs .* 3 columns of 3 numbers, w"),
        ((TEXT[TEXT.index("\n0.00") :], "\n"), "ends where frames should follow"),
    ],
)
def test_wrong_files_are_refused(tmp_path, change, message):
    with pytest.raises(ValueError, match=rf"a\.sto, (line \d+: )?.*{message}"):
        read(tmp_path, TEXT.replace(*change), "a.sto")
