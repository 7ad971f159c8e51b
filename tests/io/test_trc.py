"""TRC: variants of programs, unseen markers, times, and errors of wrong files."""

import numpy as np
import pandas as pd
import pytest
from sklearn_motionsync.io import read_motion

from motion_files import put, tracks, trc

NAMES = ["LASI", "R.Knee Lat", "V_Sacral"]


def read(tmp_path, text, **params):
    return read_motion(put(tmp_path, text, "a.trc"), **params)


def test_positions_and_attrs_are_read(tmp_path):
    df = read(tmp_path, trc(tracks(), NAMES))
    np.testing.assert_array_equal(df, tracks().reshape(40, 9))
    assert list(df.columns) == [f"{name}_{axis}" for name in NAMES for axis in "xyz"]
    facts = {"format": "trc", "kind": "markers", "units": "mm", "up": None, "frame_rate": 50.0}
    facts |= {"joints": NAMES, "parents": [-1] * 3, "first_frame": 1, "first_time": 0.0}
    facts |= {"trial": "a", "levels": ["recording", "frame"]}
    facts["report"] = "40 frames of 3 joints (markers) at 50 Hz in mm."
    assert df.attrs == facts
    # Markers that are all at the origin are seen.
    assert (read(tmp_path, trc(np.zeros((9, 1, 3)), ["a"])) == 0).all(axis=None)


TEXT = trc(tracks(), NAMES)
HEAD, BODY = TEXT.split("\n\n")
LABELS, AXES = HEAD.split("\n")[3:5]


@pytest.mark.parametrize(
    "text",
    [
        "\ufeff" + TEXT,
        TEXT.replace("\n\n", "\n"),
        TEXT.replace("\n", "\t\n"),
        TEXT[:-1],
        # OpenSim's interface: two tabs to a name, one too many in front.
        TEXT.replace(LABELS, "Frame#\tTimes\t\t" + "\t\t".join(NAMES)).replace(AXES, "\t" + AXES),
        TEXT.replace(LABELS, "Frame# \t Time\t" + "\t\t\t".join(NAMES)),
        TEXT.replace("X2\tY2\tZ2", "X17\tY17\tZ17").replace("X1\tY1\tZ1", "x0\ty0\tz0"),
        TEXT.replace(AXES + "\n", ""),
        TEXT.replace(AXES + "\n", "").replace("NumMarkers", "Markers"),
        TEXT.replace("NumMarkers", "Markers"),
        # Fewer words in the header, blanks in it, and numbers that were never brought up to date.
        TEXT.replace("\tOrigNumFrames", "").replace("\t1\t40\nFrame", "\t1\nFrame"),
        TEXT.replace("mm\t50.00", "mm   50.00"),
        TEXT.replace("DataRate\t", "datarate\t").replace("PathFileType\t4", "PATHFILETYPE 4"),
        # Between blanks.
        trc(tracks(), ["LASI", "R.Knee_Lat", "V_Sacral"]).replace("\t", "  "),
    ],
)
def test_variants_of_programs_are_the_same(tmp_path, text):
    df = read(tmp_path, text.encode())
    expected = read(tmp_path, TEXT)
    if "\t" not in text:
        expected.columns = [c.replace("Knee Lat", "Knee_Lat") for c in expected.columns]
    pd.testing.assert_frame_equal(df, expected)
    assert df.attrs["units"] == "mm"


@pytest.mark.parametrize("axes", ["", AXES + "\n"])
@pytest.mark.parametrize("stated", [0, 2, 41])
def test_stated_markers_that_contradict_names_and_columns_are_a_warning(tmp_path, axes, stated):
    text = TEXT.replace(AXES + "\n", axes).replace("\t3\tmm", f"\t{stated}\tmm")
    with pytest.warns(UserWarning, match=f"NumMarkers says {stated}, but 3 mark"):
        df = read(tmp_path, text)
    pd.testing.assert_frame_equal(df, read(tmp_path, TEXT))


@pytest.mark.parametrize("n", [1, 12, 39])
def test_rows_that_were_cut_are_a_warning(tmp_path, n):
    rows = BODY.splitlines(keepends=True)
    for stated in (0, 900):
        text = HEAD.replace("\t40\t3\tmm", f"\t{stated}\t3\tmm") + "\n\n" + "".join(rows[-n:])
        message = rf"^a\.trc: NumFrames says {stated}, but {n} frames? follows?; what is there is"
        with pytest.warns(UserWarning, match=message):
            df = read(tmp_path, text)
        np.testing.assert_array_equal(df, tracks()[-n:].reshape(n, 9))
        # The last number may lack digits.
        with pytest.raises(ValueError, match=rf"{stated}, but {n} frames? .* the last line has no"):
            read(tmp_path, text[:-1])


def test_names_are_unique_and_complete(tmp_path):
    df = read(tmp_path, trc(tracks(), ["Anna:KNEE", "Anna:KNEE", "f\xfc\xdf"]).encode("latin-1"))
    assert df.attrs["joints"] == ["KNEE", "KNEE_2", "f\xfc\xdf"]
    assert df.attrs["subject"] == "Anna"


@pytest.mark.parametrize("blank", ["", " ", "NaN", "0.000", "-0", "9999999.0", "-1.#IND", "NA"])
@pytest.mark.parametrize("end", ["", "\t\t"])
def test_unseen_markers_are_nan_with_a_warning(tmp_path, blank, end):
    text = trc(tracks(gap=(3, 9)), NAMES, blank=blank).replace("\n", end + "\n")
    path = put(tmp_path, text, "a.trc")
    with pytest.warns(UserWarning, match=r"a\.trc: 5 % .* 1 of 3 markers \(R\.Knee Lat\): 1 gap, "):
        df = read_motion(path)
    np.testing.assert_array_equal(df, tracks(gap=(3, 9)).reshape(40, 9))
    assert not read_motion(path, max_gap=6).isna().any(axis=None)


def test_rows_may_end_behind_a_marker_but_the_last(tmp_path):
    positions = tracks()
    positions[:20, 2] = np.nan
    lines = trc(positions, NAMES).split("\n")
    with pytest.warns(UserWarning, match=r"\(V_Sacral\)"):
        df = read(tmp_path, "\n".join(line.rstrip() for line in lines))
    np.testing.assert_array_equal(df, positions.reshape(40, 9))
    for n in (1, 2):
        cut = [*lines[:30], "\t".join(lines[30].split("\t")[:-n]), *lines[31:]]
        with pytest.raises(ValueError, match=r"line 31: a row needs 11 fields, got"):
            read(tmp_path, "\n".join(cut))
    whole = TEXT.split("\n")
    with pytest.raises(ValueError, match=r"line 46: a row needs 11 fields, got 8"):
        read(tmp_path, "\n".join([*whole[:45], "\t".join(whole[45].split("\t")[:-3])]))


@pytest.mark.parametrize(
    ("change", "fact", "value"),
    [
        *(
            (("\n1\t0.000\t", f"\n{number}\t0.000\t"), "first_frame", first)
            for number, first in (("7", 7), ("0", 0), ("", None))
        ),
        *((("\tmm\t", f"\t{unit}\t"), "units", unit or None) for unit in ("m", "", "f\xfc\xdfe")),
        (("Units", "Other"), "units", None),
        # The rate of the data counts, and not that of the cameras.
        (("50.00\t50.00\t40", "50.00\t200.00\t40"), "frame_rate", 50),
    ],
)
def test_facts_are_those_of_header_and_rows(tmp_path, change, fact, value):
    assert change[0] in TEXT
    assert read(tmp_path, TEXT.replace(*change)).attrs[fact] == value


def test_contradiction_of_rate_and_times_is_a_warning(tmp_path):
    text = trc(tracks(), NAMES, DataRate="120")
    with pytest.warns(UserWarning, match=r"a\.trc: it says 120 frames a second, but .* are 50"):
        df = read(tmp_path, text)
    assert df.attrs["frame_rate"] == 50


@pytest.mark.parametrize("n", [1, 2])
@pytest.mark.parametrize("blank", [[], [0], [1]])
def test_one_marker_or_two(tmp_path, n, blank):
    """Between tabs a marker may have no name."""
    names = ["" if k in blank else f"M{k}" for k in range(n)]
    df = read(tmp_path, trc(tracks()[:, :n], names))
    np.testing.assert_array_equal(df, tracks()[:, :n].reshape(40, -1))
    assert df.attrs["joints"] == [name or f"marker_{k + 1}" for k, name in enumerate(names)]


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (("PathFileType", "Path"), "line 1: expected 'PathFileType', with which .* got 'Path 4"),
        (("DataRate\tCameraRate\tNumFrames", "a\tb\tc"), "line 2: expected 'DataRate Camera"),
        (("\t40\t3\tmm", "\tmany\t3\tmm"), "line 3: NumFrames needs a whole number, 0 or more, g"),
        (("Frame#\tTime", "LASI\tRASI"), "line 4: expected 'Frame# Time' and the names"),
        (("Knee Lat", "Knee Lat\tand"), "line 5: line 4 names 4 markers, .* columns for 3"),
        (("\tV_Sacral", "\t"), None),
        (("X2\tY2", "Y2\tX2"), "line 5: expected X1 Y1 Z1 X2 Y2 Z2 ..., got 'X1 Y1 Z1 Y2 X2 Z2"),
        (("\n9\t0.160\t", "\n9\t\t"), "line 15: the time of a row must be a number"),
        (("\n9\t0.160\t", "\n9\t0.160\t7\t"), "line 15: a row needs 11 fields, got 12"),
        (("\n9\t0.160\t", "\n9\t0.160\tx"), "line 15: a frame needs numbers, or nothing .* got 'x"),
        ((BODY, ""), "line 5: the file ends where frames should follow; it is not complete"),
        ((TEXT, ""), "line 0: expected 'PathFileType'"),
    ],
)
def test_wrong_files_are_refused(tmp_path, change, message):
    text = TEXT.replace(*change)
    if message is None:
        assert read(tmp_path, text).attrs["joints"] == [*NAMES[:2], "marker_3"]
        return
    with pytest.raises(ValueError, match=rf"a\.trc, line \d+: .*{message[8:]}|a\.trc, {message}"):
        read(tmp_path, text)
