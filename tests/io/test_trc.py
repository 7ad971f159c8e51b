"""Reading TRC: what programs write, markers that were not seen, and where the file is wrong."""

import json

import numpy as np
import pandas as pd
import pytest
from sklearn_motionsync.io import read_motion

from motion_files import put, tracks, trc

NAMES = ["LASI", "R.Knee Lat", "V_Sacral"]


def read(tmp_path, text, **params):
    return read_motion(put(tmp_path, text, "a.trc"), **params)


def test_what_is_read(tmp_path):
    df = read(tmp_path, trc(tracks(), NAMES))
    np.testing.assert_array_equal(df, tracks().reshape(40, 9))
    assert list(df.columns) == [f"{name}_{axis}" for name in NAMES for axis in "xyz"]
    assert df.index.equals(pd.RangeIndex(40))
    assert df.index.name == "frame"
    facts = {"format": "trc", "kind": "markers", "units": "mm", "up": None, "frame_rate": 50.0}
    facts |= {"joints": NAMES, "parents": [-1] * 3, "first_frame": 1, "first_time": 0.0}
    facts |= {"performance": "a", "levels": ["recording", "frame"]}
    assert df.attrs == facts
    assert json.loads(json.dumps(df.attrs)) == df.attrs
    assert read(tmp_path, trc(tracks(), NAMES, units="m")).attrs["units"] == "m"
    assert read(tmp_path, trc(tracks(), NAMES), frame_rate=25).attrs["frame_rate"] == 25.0


TEXT = trc(tracks(), NAMES)
HEAD, BODY = TEXT.split("\n\n")
LABELS, AXES = HEAD.split("\n")[3:5]


@pytest.mark.parametrize(
    "text",
    [
        TEXT.replace("\n", "\r\n"),
        "\ufeff" + TEXT,
        TEXT.replace("\n\n", "\n"),
        TEXT.replace("\n", "\t\n"),
        TEXT[:-1],
        # OpenSim's interface: two tabs to a name, one too many in front.
        TEXT.replace(LABELS, "Frame#\tTimes\t\t" + "\t\t".join(NAMES)).replace(AXES, "\t" + AXES),
        TEXT.replace(LABELS, "Frame# \t Time\t" + "\t\t\t".join(NAMES)),
        TEXT.replace("X2\tY2\tZ2", "X17\tY17\tZ17").replace("X1\tY1\tZ1", "x0\ty0\tz0"),
        TEXT.replace(AXES + "\n", ""),
        # Fewer words in the header, blanks in it, and numbers that were never brought up to date.
        TEXT.replace("\tOrigNumFrames", "").replace("\t1\t40\nFrame", "\t1\nFrame"),
        TEXT.replace("mm\t50.00", "mm   50.00"),
        TEXT.replace("\t3\tmm", "\t41\tmm"),
        TEXT.replace("DataRate\t", "datarate\t").replace("PathFileType\t4", "PATHFILETYPE 4"),
        # Between blanks.
        trc(tracks(), ["LASI", "R.Knee_Lat", "V_Sacral"]).replace("\t", "  "),
    ],
)
def test_as_programs_write_it(tmp_path, text):
    df = read(tmp_path, text.encode())
    expected = read(tmp_path, TEXT)
    if "\t" not in text:
        expected.columns = [c.replace("Knee Lat", "Knee_Lat") for c in expected.columns]
    pd.testing.assert_frame_equal(df, expected)
    assert df.attrs["units"] == "mm"


def test_names(tmp_path):
    df = read(tmp_path, trc(tracks(), ["Anna:KNEE", "Anna:KNEE", "*12"]))
    assert df.attrs["joints"] == ["Anna:KNEE", "Anna:KNEE_2", "*12"]
    df = read(tmp_path, trc(tracks(), ["a", "", "f\xfc\xdf"]).encode("latin-1"))
    assert df.attrs["joints"] == ["a", "marker_2", "f\xfc\xdf"]


@pytest.mark.parametrize(
    "blank", ["", " ", "NaN", "nan", "0.000", "-0", "9999999.0", "-1.#IND", "NA"]
)
@pytest.mark.parametrize("end", ["", "\t\t"])
def test_markers_that_were_not_seen(tmp_path, blank, end):
    text = trc(tracks(gap=(3, 9)), NAMES, blank=blank).replace("\n", end + "\n")
    path = put(tmp_path, text, "a.trc")
    with pytest.warns(
        UserWarning, match=r"a\.trc: 5 % .* of 1 of 3 markers \(R\.Knee Lat\): 1 gaps"
    ):
        df = read_motion(path)
    np.testing.assert_array_equal(df, tracks(gap=(3, 9)).reshape(40, 9))
    assert not read_motion(path, max_gap=6).isna().any(axis=None)


def test_a_part_of_a_marker_is_none(tmp_path):
    positions, lines = tracks(), TEXT.split("\n")
    fields = lines[9].split("\t")
    lines[9] = "\t".join([*fields[:3], "", *fields[4:]])
    positions[3, 0] = np.nan
    with pytest.warns(UserWarning, match="positions are missing"):
        df = read(tmp_path, "\n".join(lines))
    np.testing.assert_array_equal(df, positions.reshape(40, 9))


def test_blank_columns_that_an_editor_took(tmp_path):
    """A row may end behind a marker, but not within one, nor where the file does."""
    positions = tracks()
    positions[:20, 2] = np.nan
    lines = trc(positions, NAMES).split("\n")
    with pytest.warns(UserWarning, match=r"\(V_Sacral\)"):
        df = read(tmp_path, "\n".join(line.rstrip() for line in lines))
    np.testing.assert_array_equal(df, positions.reshape(40, 9))
    for n in (1, 2):
        cut = [*lines[:30], "\t".join(lines[30].split("\t")[:-n]), *lines[31:]]
        with pytest.raises(ValueError, match=r"line 31: a frame needs its number, its time and 3"):
            read(tmp_path, "\n".join(cut))
    whole = TEXT.split("\n")
    with pytest.raises(ValueError, match=r"line 46: .* 11 in all, got 8"):
        read(tmp_path, "\n".join([*whole[:45], "\t".join(whole[45].split("\t")[:-3])]))


def test_all_at_the_origin(tmp_path):
    assert (read(tmp_path, trc(np.zeros((9, 1, 3)), ["a"])) == 0).all(axis=None)


# -- the clock --------------------------------------------------------------------------


@pytest.mark.parametrize("rate", [23.976, 25, 30, 59.94, 60, 120, 250, 1000])
@pytest.mark.parametrize("digits", [3, 6])
def test_times_with_few_digits(tmp_path, rate, digits):
    times = 417 + np.arange(40) / rate
    df = read(tmp_path, trc(tracks(), NAMES, rate, times, digits=digits))
    assert df.attrs["frame_rate"] == pytest.approx(rate, abs=0.005)
    assert df.attrs["first_time"] == 417
    unsaid = trc(tracks(), NAMES, rate, times, digits=digits).replace("DataRate\tC", "Rate\tC")
    assert read(tmp_path, unsaid).attrs["frame_rate"] == pytest.approx(rate, rel=0.002)


@pytest.mark.parametrize("n_frames", [3, 5, 12])
def test_the_stated_rate_counts_where_few_digits_tell_less(tmp_path, n_frames):
    df = read(tmp_path, trc(tracks()[:n_frames], NAMES, 30, digits=2))
    assert df.attrs["frame_rate"] == 30


def test_the_data_rate_counts_not_that_of_the_cameras(tmp_path):
    df = read(tmp_path, trc(tracks(), NAMES, CameraRate="200.00", OrigDataRate="200.00"))
    assert df.attrs["frame_rate"] == 50


def test_a_rate_that_the_times_contradict(tmp_path):
    """As programs do that write the same rate into every file."""
    text = trc(tracks(), NAMES, DataRate="120")
    with pytest.warns(UserWarning, match=r"a\.trc: it says 120 frames a second, but .* are 50"):
        df = read(tmp_path, text)
    assert df.attrs["frame_rate"] == 50
    assert read(tmp_path, text, frame_rate=50).attrs["frame_rate"] == 50


def test_lost_frames(tmp_path):
    times = np.delete(np.arange(41) / 50, 17)
    text = trc(tracks(), NAMES, times=times)
    with pytest.warns(UserWarning, match=r"steps of 0.02 to 0.04 s, .*to_sequences\(df\.assign"):
        df = read(tmp_path, text)
    assert df.attrs["frame_rate"] is None
    np.testing.assert_allclose(df.attrs["times"], times)
    df = read(tmp_path, text, frame_rate=50)
    assert df.attrs["frame_rate"] == 50


def test_a_single_frame(tmp_path):
    assert read(tmp_path, trc(tracks(1), NAMES)).attrs["frame_rate"] == 50


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (("PathFileType", "Path"), "line 1: expected 'PathFileType', with which .* got 'Path 4"),
        (("DataRate\tCameraRate\tNumFrames", "a\tb\tc"), "line 2: expected 'DataRate Camera"),
        (("\t40\t3\tmm", "\t41\t3\tmm"), "NumFrames says 41, but 40 frames follow"),
        (("\t40\t3\tmm", "\t39\t3\tmm"), "NumFrames says 39, but 40 frames follow"),
        (
            ("\t40\t3\tmm", "\tmany\t3\tmm"),
            "line 3: NumFrames needs a whole number above 0, got 'm",
        ),
        (("Frame#\tTime", "LASI\tRASI"), "line 4: expected 'Frame# Time' and the names"),
        (("Knee Lat", "Knee Lat\tand"), "line 5: line 4 names 4 markers, .* columns for 3"),
        (("\tV_Sacral", "\t"), None),
        (("X2\tY2", "Y2\tX2"), "line 5: expected X1 Y1 Z1 X2 Y2 Z2 ..., got 'X1 Y1 Z1 Y2 X2 Z2"),
        (("\tZ3", ""), "line 5: expected X1 Y1 Z1"),
        (("\n9\t0.160\t", "\n9\t\t"), "line 15: the time of a row must be a number"),
        (("\n9\t0.160\t", "\n9\t0.130\t"), "line 15: .* got 0.13 after 0.14"),
        (("\n9\t0.160\t", "\n9\t0.160\t7\t"), "line 15: .* 11 in all, got 12"),
        (("\n9\t0.160\t", "\n9\t0.160\tx"), "line 15: a frame needs numbers, or nothing .* got 'x"),
        (("\n9\t0.160\t", "\n9\t0.160\t1_"), "got '1_"),
        (("\n9\t0.160\t", "\n9\t0.160\t1e999"), "got '1e999"),
        ((BODY, ""), "line 5: the file ends where frames should follow; it is not complete"),
        ((TEXT, ""), "line 0: expected 'PathFileType'"),
        ((TEXT, "\0\xff"), "line 1: expected 'PathFileType'"),
    ],
)
def test_bad_trc(tmp_path, change, message):
    text = TEXT.replace(*change)
    if message is None:
        assert read(tmp_path, text).attrs["joints"] == [*NAMES[:2], "marker_3"]
        return
    with pytest.raises(ValueError, match=rf"a\.trc, line \d+: .*{message[8:]}|a\.trc, {message}"):
        read(tmp_path, text)


def test_a_small_file_of_a_huge_result(tmp_path):
    names = [f"m{i}" for i in range(2000)]
    head = trc(np.zeros((1, 2000, 3)), names).split("\n\n")[0].replace("\t1\t2000", "\t5000\t2000")
    rows = "".join(f"{i}\t{i / 50:.2f}\n" for i in range(5000))
    with pytest.raises(ValueError, match=r"a\.trc: 5000 frames of 2000 joints would take 229 MB"):
        read(tmp_path, head + "\n" + rows)


def test_wrong_calls(tmp_path):
    path = put(tmp_path, TEXT, "a.TRC")
    assert read_motion(path).attrs["format"] == "trc"
    with pytest.raises(ValueError, match=r"group= goes with \.c3d files only"):
        read_motion(path, group="angles")
    with pytest.raises(ValueError, match=r"asf= goes with \.amc files only"):
        read_motion(path, asf="a.asf")
