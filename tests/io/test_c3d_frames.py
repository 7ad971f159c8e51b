"""C3D: numbers of frames that contradict each other or 16 bits, and files of rotations."""

import struct
import warnings

import numpy as np
import pytest
from sklearn_motionsync.io import cut_at_events, read_motion

from motion_files import c3d, floats, poses, put, rotation_parameters, texts, tracks, words

MANY = 70_000


def long_file(n_points, first=1, trial=None, garbage=b"", **changes):
    """A file of many frames, whose numbers come from NumPy; x of a point is its frame."""
    last = (first + MANY - 1) % 65536 if changes.pop("wrapped", False) else 65535
    others = {"TRIAL": trial} if trial else None
    fields = {"points": n_points, "first": first, "last": last}
    data = np.ones((MANY, n_points, 4), "<f4")
    data[..., 0] = np.arange(MANY)[:, None]
    labels = texts(*(f"M{i}" for i in range(n_points)))
    stated = {"USED": words(n_points), "LABELS": labels} | changes
    head = c3d(np.zeros((0, 1, 3)), changes=stated, others=others, header=fields)
    content = data.tobytes()
    return head + content + (garbage + bytes(512))[: -len(content) % 512]


def actual(first, last):
    return {
        "ACTUAL_START_FIELD": words(first, first >> 16),
        "ACTUAL_END_FIELD": words(last, last >> 16),
    }


def read_with_warnings(path):
    """The table of a file, and what was warned of."""
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        df = read_motion(path)
    assert all(warning.filename == __file__ for warning in caught)
    return df, [str(warning.message) for warning in caught]


# What the header states, and what is warned of.
DOCUMENTED = [
    # The words of the trial, floats, and LONG_FRAMES.
    ({"FRAMES": words(65535), "trial": actual(1, MANY)}, None),
    ({"FRAMES": floats(MANY)}, None),
    ({"FRAMES": words(65535), "LONG_FRAMES": floats(MANY)}, None),
    ({"FRAMES": words(MANY), "LONG_FRAMES": floats(MANY), "wrapped": True}, None),
    ({"FRAMES": words(-1), "trial": actual(500, MANY + 499), "first": 500}, None),
]
FROM_THE_DATA = [
    ({"FRAMES": words(65535)}, "it says 65535 frames, and its data hold 70000, which are read"),
    ({"FRAMES": words(MANY), "wrapped": True}, "it says 4464 frames, and its data hold 70000"),
    ({"FRAMES": None, "wrapped": True, "first": 65000}, "it says 4464 frames, and its"),
    ({"FRAMES": words(65535), "wrapped": True}, "it says 4464 or 65535 frames, and its data"),
    ({"FRAMES": floats(69_000), "trial": actual(1, MANY)}, "it says 69000 or 70000 frames"),
]
# A frame of 40 points is longer than what may fill the last block; its number is exact.
CASES = [(1, *case) for case in DOCUMENTED + FROM_THE_DATA]
CASES += [(40, *case) for case in FROM_THE_DATA]


@pytest.mark.parametrize(("n_points", "stated", "message"), CASES)
def test_no_frame_beyond_16_bits_is_lost(tmp_path, n_points, stated, message):
    df, said = read_with_warnings(put(tmp_path, long_file(n_points, **stated), "a.c3d"))
    np.testing.assert_array_equal(df["M0_x"], np.arange(MANY))
    assert [message in text for text in said] == [True] * bool(message)


@pytest.mark.parametrize(
    ("last", "stated", "warns"),
    [
        (40, {}, False),
        (4, {}, True),
        (40, {"FRAMES": words(39)}, True),
        (4, {"FRAMES": words(39), "LONG_FRAMES": floats(40)}, True),
        (40, {"FRAMES": words(40), "LONG_FRAMES": floats(39.5)}, False),
        (40, {"FRAMES": words(40), "LONG_FRAMES": floats(np.inf)}, False),
        (9999, {}, True),
        (20, {"FRAMES": words(20)}, True),
    ],
)
@pytest.mark.parametrize("tail", [b"", bytes(511), bytes(5000)])
def test_the_number_of_frames_that_fits_the_data_is_read(tmp_path, last, stated, warns, tail):
    content = c3d(tracks(), header={"last": last}, changes=stated, tail=tail)
    df, said = read_with_warnings(put(tmp_path, content, "a.c3d"))
    np.testing.assert_array_equal(df.to_numpy().reshape(40, 3, 3), tracks())
    assert ["hold 40, which" in text for text in said] == [True] * warns


def test_what_fills_the_last_block_is_no_frame(tmp_path):
    content = c3d(tracks())
    end = 512 * (content[16] - 1) + 40 * 48
    path = put(tmp_path, content[:end] + b"\7" * (len(content) - end), "a.c3d")
    assert len(read_motion(path)) == 40


# -- rotations ----------------------------------------------------------------------------------


@pytest.mark.parametrize("machine", [84, 85, 86])
def test_a_file_of_rotations_gives_the_origins_of_its_segments(tmp_path, machine):
    matrices = poses()
    matrices[5:9, 1, 16], matrices[20, 0] = -1, 0
    expected = matrices[..., 12:15].copy()
    expected[5:9, 1] = expected[20, 0] = np.nan
    used = (2, [], struct.pack(">H" if machine == 86 else "<H", 2))
    others = {"ROTATION": rotation_parameters(USED=used)}
    content = c3d(np.zeros((40, 0, 3)), machine, others=others, rotations=matrices)
    with pytest.warns(UserWarning, match="positions are missing .*, of 2 of 2 segments"):
        df = read_motion(put(tmp_path, content, "a.c3d"))
    np.testing.assert_array_equal(df.to_numpy().reshape(40, 2, 3), expected)
    facts = {"joints": ["pelvis", "l_thigh"], "parents": [-1, -1], "kind": "segments"}
    facts |= {"units": "mm", "left_out": "the rotations of 2 segments"}
    assert facts.items() <= df.attrs.items()
    with pytest.raises(ValueError, match=r"no markers in this file; .* reads 'segments' \(2\)\."):
        read_motion(tmp_path / "a.c3d", group="markers")


def test_a_file_of_angles_and_rotations_gives_its_segments(tmp_path):
    others, changes = {"ROTATION": rotation_parameters()}, {"ANGLES": texts("M0", "M1", "M2")}
    content = c3d(tracks(), changes=changes, others=others, rotations=poses())
    df = read_motion(put(tmp_path, content, "a.c3d"))
    np.testing.assert_array_equal(df.to_numpy().reshape(40, 2, 3), poses()[..., 12:15])
    assert df.attrs["left_out"] == "3 angles, the rotations of 2 segments"


@pytest.mark.parametrize("ratio", [None, 1, 2])
def test_markers_and_rotations_are_two_groups(tmp_path, ratio):
    rows = 40 * (ratio or 1)
    changes = {} if ratio is None else {"RATIO": words(ratio), "RATE": floats(50 * ratio)}
    events = {"USED": words(2), "LABELS": texts("Turn", "Turn"), "TIMES": floats(0, 2.2, 0, 2.6)}
    others = {"ROTATION": rotation_parameters(**changes), "EVENT": events}
    header = {"first": 101, "last": 140}
    content = c3d(tracks(), others=others, header=header, rotations=poses(rows))
    path = put(tmp_path, content, "a.c3d")
    markers = read_motion(path)
    np.testing.assert_array_equal(markers.to_numpy().reshape(40, 3, 3), tracks())
    assert markers.attrs["left_out"] == "the origins and rotations of 2 segments"
    segments = read_motion(path, group="segments")
    np.testing.assert_array_equal(segments.to_numpy().reshape(rows, 2, 3), poses(rows)[..., 12:15])
    assert segments.attrs["frame_rate"] == 50 * (ratio or 1)
    assert segments.attrs["left_out"] == "3 markers, the rotations of 2 segments"
    (cut,) = cut_at_events(segments, "Turn")
    assert (len(cut), cut.attrs["first_time"]) == (20 * (ratio or 1) + 1, pytest.approx(2.2))
    assert cut.attrs["first_frame"] == 111


def test_the_frames_of_rotations_may_be_fewer_or_not_there(tmp_path):
    others = {"ROTATION": rotation_parameters(FRAMES=words(30))}
    path = put(tmp_path, c3d(tracks(), others=others, rotations=poses(30)), "a.c3d")
    with pytest.warns(UserWarning, match="it says 30 or 40 frames, and its data hold 30, which"):
        assert len(read_motion(path, group="segments")) == 30
    others = {"ROTATION": rotation_parameters(LABELS=None) | {"DATA_START": words(0)}}
    path = put(tmp_path, c3d(tracks(), others=others), "a.c3d")
    assert len(read_motion(path)) == 40
    with pytest.raises(ValueError, match=r"a\.c3d: ROTATION:DATA_START says byte 0, and the rot"):
        read_motion(path, group="segments")
