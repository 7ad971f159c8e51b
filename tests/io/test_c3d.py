"""Reading C3D: as every machine wrote it, against a peer, and where the file is wrong."""

import struct
import warnings

import numpy as np
import pandas as pd
import pytest
from sklearn_motionsync import Skeleton
from sklearn_motionsync.io import fill_gaps, read_motion

from motion_files import c3d, put, texts, tracks


@pytest.mark.parametrize("machine", [84, 85, 86])
@pytest.mark.parametrize("real", [True, False])
def test_c3d_of_every_machine(tmp_path, machine, real):
    path = put(tmp_path, c3d(tracks(), machine, real), "a.C3D")
    df = read_motion(path)
    np.testing.assert_array_equal(df.to_numpy().reshape(40, 3, 3), tracks())
    assert df.attrs == {
        "format": "c3d",
        "frame_rate": 50.0,
        "units": "mm",
        "up": "z",
        "kind": "markers",
        "joints": ["M0", "M1", "M2"],
        "parents": [-1, -1, -1],
        "first_frame": 1,
        "events": [],
        "groups": {"markers": {"n": 3, "units": "mm", "frame_rate": 50.0}},
        "left_out": "",
        "performance": "a",
        "levels": ["recording", "frame"],
    }


def test_c3d_with_gaps(tmp_path):
    path = put(tmp_path, c3d(tracks(gap=(10, 14))), "a.c3d")
    message = (
        r"^a\.c3d: 3\.3 % of the positions are missing \(NaN\), of 1 of 3 markers \(M1\): 1 gaps, "
        r"the longest of 4 frames\. Interpolate short gaps with read_motion\(\.\.\., max_gap="
    )
    with pytest.warns(UserWarning, match=message) as caught:
        df = read_motion(path)
    assert len(caught) == 1
    assert caught[0].filename == __file__
    np.testing.assert_array_equal(df.to_numpy().reshape(40, 3, 3), tracks(gap=(10, 14)))
    filled = read_motion(path, max_gap=4)
    pd.testing.assert_frame_equal(filled, fill_gaps(df, 4))
    assert filled.attrs == df.attrs
    path = put(tmp_path, c3d(tracks(gap=(35, 40))), "a.c3d")
    with pytest.warns(UserWarning, match="5 frames; 1 touch an end and cannot be interpolated"):
        read_motion(path, max_gap=40)


def test_c3d_that_says_little(tmp_path):
    nothing = dict.fromkeys(("LABELS", "UNITS", "Y_SCREEN", "RATE", "DATA_START", "FRAMES"))
    df = read_motion(put(tmp_path, c3d(tracks(), changes=nothing), "a.c3d"))
    assert df.attrs["joints"] == ["marker_1", "marker_2", "marker_3"]
    assert df.attrs["units"] is None
    assert df.attrs["up"] is None
    assert df.attrs["frame_rate"] == 50
    changes = {"LABELS": (-1, [4, 2], b"kneekn\0 "), "LABELS2": (-1, [4, 1], b"knee")}
    df = read_motion(put(tmp_path, c3d(tracks(), changes=changes), "a.c3d"))
    assert df.attrs["joints"] == ["knee", "kn", "knee_2"]


def test_c3d_longer_than_its_header_can_say(tmp_path):
    """The statement that fits the size of the file is taken."""
    n = 70000
    positions = np.zeros((n, 1, 3))
    changes = {"LONG_FRAMES": (4, [], struct.pack("<f", n))}
    path = put(tmp_path, c3d(positions, changes=changes), "a.c3d")
    assert len(read_motion(path)) == n


def test_scales_of_floats_do_not_matter(tmp_path):
    """Writers leave any negative number there, not always the same twice."""
    positions = tracks()
    other = {"SCALE": (4, [], struct.pack("<f", -0.1))}
    df = read_motion(put(tmp_path, c3d(positions, changes=other), "a.c3d"))
    np.testing.assert_allclose(df, positions.reshape(len(df), -1), rtol=1e-6)


def many_texts(n):
    return {"NOTES": {f"N{i}": texts("x" * 255, "y" * 255) for i in range(n)}}


def test_parameters_longer_than_they_count(tmp_path):
    """The beginning of the data bounds them, and what lies behind their end may be anything."""
    for n_blocks in (1, 2, 255):
        content = c3d(tracks(), others=many_texts(5), n_blocks=n_blocks)
        path = put(tmp_path, content, "a.c3d")
        np.testing.assert_array_equal(read_motion(path).to_numpy().reshape(40, 3, 3), tracks())
    path = put(tmp_path, c3d(tracks(), others=many_texts(300), n_blocks=45), "a.c3d")
    assert len(read_motion(path)) == 40
    end = content.index(b"N4") - 2
    junk = content[:end] + b"\0\0" + b"\xff" * 100 + content[end + 102 :]
    assert len(read_motion(put(tmp_path, junk, "a.c3d"))) == 40


@pytest.mark.parametrize(("machine", "order"), [(86, "<"), (84, ">")])
@pytest.mark.parametrize("real", [True, False])
def test_integers_in_the_order_of_another_machine(tmp_path, machine, order, real):
    analog = np.random.default_rng(0).integers(-300, 300, (40, 2, 2))
    content = c3d(tracks(gap=(3, 5)), machine, real, analog=analog, order=order)
    path = put(tmp_path, content, "a.c3d")
    with pytest.warns(UserWarning, match="1 gaps"):
        df = read_motion(path)
    np.testing.assert_array_equal(df.to_numpy().reshape(40, 3, 3), tracks(gap=(3, 5)))
    np.testing.assert_array_equal(read_motion(path, group="analog"), analog.reshape(80, 2))


@pytest.mark.parametrize("real", [True, False])
def test_points_at_the_origin_that_nobody_saw(tmp_path, real):
    """No camera and no residual is no sight of the origin; a camera is."""
    positions, words = tracks(), np.full((40, 3), 257.0)
    positions[5:9, 0] = positions[20:22, 1] = positions[30, 2] = 0
    words[5:9, 0], words[12:15, 0], words[30, 2] = 0, 0, -1
    expected = positions.copy()
    expected[5:9, 0] = expected[30, 2] = np.nan
    path = put(tmp_path, c3d(positions, real=real, words=words), "a.c3d")
    with pytest.warns(UserWarning, match=r"of 2 of 3 markers \(M0, M2\): 2 gaps"):
        df = read_motion(path)
    np.testing.assert_array_equal(df.to_numpy().reshape(40, 3, 3), expected)


def test_other_signs_of_points_that_nobody_saw(tmp_path):
    positions, words = tracks(), np.zeros((40, 3))
    positions[5:9, 0], words[5:9, 0] = 0, 65535  # -1 in 16 bits
    positions[20:22, 1] = 9999999
    with pytest.warns(UserWarning, match=r"of 2 of 3 markers \(M0, M1\): 2 gaps"):
        read_motion(put(tmp_path, c3d(positions, words=words), "a.c3d"))


@pytest.mark.parametrize(
    ("content", "message"),
    [
        (b"", "byte 1 must be hexadecimal 50 and the file 1024 bytes or more, got nothing and 0"),
        (b"\x02\x51" + bytes(2000), "got 51 and 2002 bytes; it is no C3D file"),
        (b"\xff\x50" + bytes(2000), "parameters begin in block 255, but the file has 3 blocks"),
        (c3d(tracks(), machine=87), "says processor 87; 84 .Intel., 85 .DEC. and 86 .MIPS."),
        (c3d(tracks(), header={"points": 9}), "header says 9 markers, POINT:USED says 3"),
        (c3d(tracks(0), header={"points": 0}), "header says 0 markers"),
        (c3d(tracks(), header={"start": 900}), "data begin at byte 460288, POINT:DATA_START"),
        (c3d(tracks(), header={"start": 5}), "data begin at byte 2048, POINT:DATA_START says 1536"),
        (c3d(tracks(), header={"last": 9999}, changes={"FRAMES": None}), "it says 9999 frames of"),
        (c3d(tracks(40))[:2000], "it says 40 frames of 48 bytes, but holds 9.7 frames; it is not"),
        (c3d(tracks(), header={"last": 20}, tail=bytes(5000)), "it says 20 or 40 frames"),
        (c3d(tracks(), changes={"SCALE": (4, [], bytes(4))}), "the header says scale -1, POINT:S"),
        (c3d(tracks(), changes={"RATE": (4, [255] * 7, b"")}), "says .* bytes of type 4, which ar"),
        (c3d(tracks(), changes={"RATE": (4, [255] * 9, b"")}), "is not complete, or no parameter"),
        (c3d(tracks()).replace(b"UNITS\x0a\0", b"UNITS\xff\xff"), "leads out of the parameters"),
    ],
)
def test_bad_c3d(tmp_path, content, message):
    with pytest.raises(ValueError, match=rf"a\.c3d: .*{message}.*Export the recording again\.$"):
        read_motion(put(tmp_path, content, "a.c3d"))


def test_two_statements_that_both_fit(tmp_path):
    """A frame more may be padding, so the header is believed."""
    assert len(read_motion(put(tmp_path, c3d(tracks(), header={"last": 39}), "a.c3d"))) == 39
    assert len(read_motion(put(tmp_path, c3d(tracks(), header={"last": 4}), "a.c3d"))) == 40


def test_real_c3d(real_data):
    """All encodings are alike, and as the package c3d reads them."""
    import c3d as peer

    frames = {}
    for path in sorted((real_data / "original_files" / "c3d").glob("*.c3d")):
        with pytest.warns(UserWarning, match=r"1\.9 % of the positions are missing .* of 26 mark"):
            df = frames[path.stem] = read_motion(path)
        with path.open("rb") as file, warnings.catch_warnings():
            warnings.simplefilter("ignore")
            points = np.array([frame[1] for frame in peer.Reader(file).read_frames()])
        expected = np.where(points[..., 3:4] < 0, np.nan, points[..., :3])
        np.testing.assert_allclose(df, expected.reshape(450, -1), rtol=1e-6, atol=1e-4)
    assert len(frames) == 6
    first = frames["Eb015pi"]
    assert first.attrs["joints"][:3] == ["RFT1", "RFT2", "RFT3"]
    assert (len(first.attrs["joints"]), first.attrs["frame_rate"]) == (26, 50)
    assert (first.attrs["units"], first.attrs["up"]) == ("mm", "z")
    with pytest.raises(ValueError, match=r"No joint stands for the landmarks \['pelvis'"):
        Skeleton.from_frame(first)
    for name, df in frames.items():
        np.testing.assert_allclose(df, first, atol=1e-3)
        assert df.attrs == first.attrs | {"performance": name}
    events = [(event["label"], event["time"], event["frame"]) for event in first.attrs["events"]]
    assert events == [("RIC", 2.72, 136), ("RHS", 5.4, 270), ("RTO", 7.32, 366)]
    assert first.attrs["left_out"] == "16 analog channels at 200 Hz, the geometry of 2 force plates"


def test_real_analog(real_data):
    """All encodings are alike, and as the package c3d reads and scales them."""
    import c3d as peer

    for path in sorted((real_data / "original_files" / "c3d").glob("*.c3d")):
        df = read_motion(path, group="analog")
        with path.open("rb") as file, warnings.catch_warnings():
            warnings.simplefilter("ignore")
            values = [frame[2] for frame in peer.Reader(file).read_frames(copy=True)]
        np.testing.assert_allclose(df, np.concatenate(values, axis=1).T, rtol=1e-6, atol=1e-4)
        assert df.attrs["frame_rate"] == 200
        assert df.attrs["channels"] == list(df.columns)
        assert df.attrs["units"][:4] == ["nt", "nt", "nt", "ntmm"]
        assert df.attrs["events"][0]["frame"] == 4 * 136
