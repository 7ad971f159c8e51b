"""C3D: numbers of every processor, groups, channels, events, a peer, and errors of wrong files."""

import struct
import warnings

import numpy as np
import pandas as pd
import pytest
from sklearn_motionsync.io import read_motion

from motion_files import analog_parameters, c3d, event_parameters, floats, put, texts, tracks, words


@pytest.mark.parametrize("machine", [84, 85, 86])
@pytest.mark.parametrize("real", [True, False])
def test_files_of_every_processor_are_the_same(tmp_path, machine, real):
    path = put(tmp_path, c3d(tracks(), machine, real), "a.C3D")
    df = read_motion(path)
    np.testing.assert_array_equal(df.to_numpy().reshape(40, 3, 3), tracks())
    facts = {"joints": ["M0", "M1", "M2"], "units": "mm", "up": "z", "kind": "markers"}
    facts |= {"frame_rate": 50.0, "first_frame": 1, "events": [], "left_out": ""}
    facts |= {"groups": {"markers": {"n": 3, "units": "mm", "frame_rate": 50.0}}}
    assert facts.items() <= df.attrs.items()


def test_missing_parameters_have_defaults(tmp_path):
    nothing = dict.fromkeys(("LABELS", "UNITS", "Y_SCREEN", "RATE", "DATA_START", "FRAMES"))
    df = read_motion(put(tmp_path, c3d(tracks(), changes=nothing), "a.c3d"))
    facts = {"joints": ["marker_1", "marker_2", "marker_3"], "frame_rate": 50}
    assert (facts | {"units": None, "up": None}).items() <= df.attrs.items()
    changes = {"LABELS": (-1, [4, 2], b"kneekn\0 "), "LABELS2": (-1, [4, 1], b"knee")}
    df = read_motion(put(tmp_path, c3d(tracks(), changes=changes), "a.c3d"))
    assert df.attrs["joints"] == ["knee", "kn", "knee_2"]


@pytest.mark.parametrize("machine", [84, 85, 86])
def test_a_parameter_may_have_its_length_in_the_other_byte_order(tmp_path, machine):
    others = {"LONG": {"NOTE": texts("x" * 250, "y" * 250)}}
    others["FORCE_PLATFORM"] = {"USED": (1, [], b"\2")}
    content = c3d(tracks(), machine, others=others)
    for name in (b"LABELS", b"UNITS", b"NOTE"):
        at = content.index(name) + len(name)
        content = content[:at] + content[at : at + 2][::-1] + content[at + 2 :]
    df = read_motion(put(tmp_path, content, "a.c3d"))
    pd.testing.assert_frame_equal(df, read_motion(put(tmp_path, c3d(tracks(), machine), "a.c3d")))
    assert (df.attrs["joints"], df.attrs["units"]) == (["M0", "M1", "M2"], "mm")
    assert df.attrs["left_out"] == "the geometry of 2 force plates"


def test_of_two_scales_that_of_the_header_is_used_with_a_warning(tmp_path):
    other = {"SCALE": floats(0.25)}
    path = put(tmp_path, c3d(tracks(), real=False, changes=other), "a.c3d")
    message = (
        r"^a\.c3d: the header says scale 0\.5, .*SCALE says 0\.25\. .* multiply them by 0\.5\.$"
    )
    with pytest.warns(UserWarning, match=message):
        df = read_motion(path)
    np.testing.assert_array_equal(df.to_numpy().reshape(40, 3, 3), tracks())
    # They may differ by rounding.
    path = put(tmp_path, c3d(tracks(), real=False, changes={"SCALE": floats(0.50004)}), "a.c3d")
    np.testing.assert_allclose(read_motion(path), tracks().reshape(40, 9), rtol=1e-4)


def entry(name, group, block=b"", step=None):
    """A parameter, or a group of a negative number, without a description."""
    step = 2 + len(block) if step is None else step
    return bytes([len(name), group % 256]) + name + struct.pack("<H", step) + block


def sectioned(*entries, n_blocks=0):
    """A file with these entries and the data in the next block."""
    whole = c3d(tracks())
    section = bytes([1, 0x50, n_blocks, 84]) + b"".join(entries)
    n = -(-len(section) // 512)
    head = whole[:16] + struct.pack("<H", 2 + n) + whole[18:512]
    return head + section.ljust(512 * n, b"\0") + whole[512 * (whole[16] - 1) :]


POINT = entry(b"POINT", -1, b"\0")
LABELS = entry(b"LABELS", 1, bytes([255, 2, 4, 3]) + b"LANKRANKLTOE")
# The section has 4 bytes before the first entry; a name of one letter has 5 beside its block.
FULL = 512 - 4 - len(POINT + LABELS)


def filler(n_left):
    """A parameter that leaves so many bytes of the block."""
    return entry(b"X", 1, bytes([255, 2, 1, 99]) + b"x" * (FULL - 9 - n_left))


@pytest.mark.parametrize("n_blocks", [0, 1, 2, 255])
@pytest.mark.parametrize(
    "entries",
    [
        (POINT, LABELS),
        (LABELS, POINT),
        # A group of 2 bytes behind its name, and a parameter of no texts.
        (entry(b"POINT", -1), LABELS),
        (POINT, LABELS, entry(b"NONE", 1, bytes([255, 2, 4, 0]))),
        # The first of a name counts.
        (POINT, LABELS, entry(b"LABELS", 1, b"\xff\2\1\3abc"), entry(b"OTHER", -1)),
        # The last says 0 where the next is, or ends where the data begin.
        (POINT, entry(b"LABELS", 1, bytes([255, 2, 4, 3]) + b"LANKRANKLTOE", step=0)),
        (POINT, LABELS, filler(0)),
        (POINT, LABELS, filler(5), entry(b"Y", -2, step=0)),
        # Four bytes of any value are too few for a parameter.
        (POINT, LABELS, filler(4), b"\1\1\1\1"),
    ],
    ids=range(9),
)
def test_parameters_are_found_to_their_end(tmp_path, entries, n_blocks):
    df = read_motion(put(tmp_path, sectioned(*entries, n_blocks=n_blocks), "a.c3d"))
    assert df.attrs["joints"] == ["LANK", "RANK", "LTOE"]


def test_what_follows_the_stated_blocks_is_no_parameter(tmp_path):
    content = sectioned(POINT, LABELS, filler(0), b"\1\1" + b"\xff" * 99, n_blocks=1)
    df = read_motion(put(tmp_path, content, "a.c3d"))
    assert df.attrs["joints"] == ["LANK", "RANK", "LTOE"]
    with pytest.raises(ValueError, match="at byte 1024 leads out of the parameters"):
        read_motion(put(tmp_path, content[:514] + b"\2" + content[515:], "a.c3d"))


@pytest.mark.parametrize(
    ("entries", "message"),
    [
        ((POINT, entry(b"X", 1, b"\xff\0x", step=1), LABELS), "at byte 526 leads out of the par"),
        # Three numbers are said, one is there; the next parameter does not belong to it.
        ((POINT, entry(b"RATE", 1, b"\4\1\3" + bytes(4)), LABELS), "says 12 bytes of type 4, wh"),
        ((POINT, entry(b"RATE", 1, b"\4\2\1"), LABELS), "is not complete, or no parameter"),
        # Five bytes may be a parameter of one letter, and its end lies in the data.
        ((POINT, LABELS, filler(5), b"\1\xfeA\xff\1"), "leads out of the parameters"),
        ((POINT, entry(b"RATE", 1, b"\4"), LABELS), "is not complete, or no parameter"),
        ((POINT, entry(b"RATE", 1, b"\3\0" + bytes(9)), LABELS), "says 3 bytes of type 3, which"),
        ((POINT, entry(b"RATE", 1, b"\0\0" + bytes(9)), LABELS), "says 0 bytes of type 0, which"),
        ((POINT, entry(b"RATE", 1, b"\4\x08" + bytes(9)), LABELS), "is not complete, or no par"),
    ],
)
def test_wrong_parameters_are_refused(tmp_path, entries, message):
    with pytest.raises(ValueError, match=message):
        read_motion(put(tmp_path, sectioned(*entries), "a.c3d"))


@pytest.mark.parametrize("rate", [0.5, 29.97, -3.0, 0.0, np.inf, np.nan])
def test_a_rate_is_any_number_above_0_of_up_to_seven_dimensions(tmp_path, rate):
    parameter = entry(b"RATE", 1, b"\4\7" + b"\1" * 7 + struct.pack("<f", rate))
    df = read_motion(put(tmp_path, sectioned(POINT, parameter, LABELS), "a.c3d"))
    assert df.attrs["frame_rate"] == (pytest.approx(rate) if 0 < rate < np.inf else None)


def test_numbers_that_are_none_are_nan(tmp_path):
    """Not-a-numbers that signal, infinite analog values, and zero as DEC machines wrote it."""
    content = c3d(tracks(), analog=np.full((40, 1, 2), 7))
    data = 512 * (content[16] - 1)

    def patched(content, at, number):
        return put(tmp_path, content[: data + at] + number + content[data + at + 4 :], "a.c3d")

    for number in (b"\1\0\x80\x7f", struct.pack("<f", np.inf)):
        with pytest.warns(UserWarning, match=r"of 1 of 3 markers \(M0\): 1 gap"):
            assert read_motion(patched(content, 4, number)).iloc[0, :3].isna().all()
        with pytest.warns(UserWarning, match=r"of 1 of 2 analog \(channel_1\)"):
            df = read_motion(patched(content, 48, number), group="analog")
        assert df.isna().to_numpy().nonzero() == ([0], [0])
    df = read_motion(patched(c3d(tracks(), 85), 0, b"\x7f\0\xff\xff"))
    assert df.iloc[0, 0] == 0
    assert df.iloc[0, 1] == tracks()[0, 0, 1]


@pytest.mark.parametrize(("machine", "order"), [(86, "<"), (84, ">")])
@pytest.mark.parametrize("real", [True, False])
def test_integers_may_have_another_byte_order_than_floats(tmp_path, machine, order, real):
    analog = np.random.default_rng(0).integers(-300, 300, (40, 2, 2))
    content = c3d(tracks(gap=(3, 5)), machine, real, analog=analog, order=order)
    path = put(tmp_path, content, "a.c3d")
    with pytest.warns(UserWarning, match="1 gap, "):
        df = read_motion(path)
    np.testing.assert_array_equal(df.to_numpy().reshape(40, 3, 3), tracks(gap=(3, 5)))
    np.testing.assert_array_equal(read_motion(path, group="analog"), analog.reshape(80, 2))


@pytest.mark.parametrize("real", [True, False])
def test_points_at_the_origin_without_a_camera_are_nan(tmp_path, real):
    positions, words = tracks(), np.full((40, 3), 257.0)
    positions[5:9, 0] = positions[20:22, 1] = positions[30, 2] = 0
    words[5:9, 0], words[12:15, 0], words[30, 2] = 0, 0, -1
    expected = positions.copy()
    expected[5:9, 0] = expected[30, 2] = np.nan
    path = put(tmp_path, c3d(positions, real=real, words=words), "a.c3d")
    with pytest.warns(UserWarning, match=r"of 2 of 3 markers \(M0, M2\): 2 gaps"):
        df = read_motion(path)
    np.testing.assert_array_equal(df.to_numpy().reshape(40, 3, 3), expected)


def test_other_marks_of_unseen_points_are_nan(tmp_path):
    positions, words = tracks(), np.zeros((40, 3))
    positions[5:9, 0], words[5:9, 0] = 0, [65535, 32768, 0, 0.5]  # 16 bits, the first the sign
    words[8, 0] = -0.5
    positions[12:14, 0], words[12:14, 0] = 0, [1, 32767]  # of cameras
    positions[20:22, 1] = 9999999
    with pytest.warns(UserWarning, match=r"of 2 of 3 markers \(M0, M1\): 2 gaps, .* of 4 frames"):
        df = read_motion(put(tmp_path, c3d(positions, words=words), "a.c3d"))
    assert (df.iloc[12:14, :3] == 0).all(axis=None)


def with_scale(header, parameter):
    content = c3d(tracks(), changes={"SCALE": floats(parameter)})
    return content[:12] + struct.pack("<f", header) + content[16:]


@pytest.mark.parametrize(
    ("content", "message"),
    [
        (b"", "byte 1 must be hexadecimal 50 and the file 1024 bytes or more, got nothing and 0"),
        (b"\x02\x51" + bytes(2000), "got 51 and 2002 bytes; it is no C3D file"),
        (b"\x02\x50" + bytes(1021), "got 50 and 1023 bytes; it is no C3D file"),
        (b"\x02\x50" + bytes(1022), "byte 515 says processor 0"),
        (b"\x01\x50" + bytes(2000), "parameters begin in block 1, but the file has 3 blocks"),
        (b"\xff\x50" + bytes(2000), "parameters begin in block 255, but the file has 3 blocks"),
        (c3d(tracks(), machine=87), "says processor 87; 84 .Intel., 85 .DEC. and 86 .MIPS."),
        (c3d(tracks(), header={"points": 9}), "header says 9 markers, POINT:USED says 3"),
        (c3d(tracks(0), header={"points": 0}), "header says 0 markers"),
        (c3d(tracks(), header={"start": 900}), "data begin at byte 460288, POINT:DATA_START"),
        (c3d(tracks(), header={"start": 2}, changes={"DATA_START": None}), "begin at byte 512, PO"),
        (with_scale(np.inf, -1.0), "the header says scale inf, POINT:SCALE says -1; both must be"),
        (with_scale(-1.0, 0.0), "the header says scale -1, POINT:SCALE says 0; both must be"),
        (c3d(tracks(), header={"last": 9999}, changes={"FRAMES": None}), "it says 9999 frames of"),
        (c3d(tracks(40))[:2000], "it says 40 frames of 48 bytes, but holds 9.7 frames; it is not"),
        (c3d(tracks(), header={"last": 200}, tail=b"x" * 700), "it says 40 or 200 frames"),
    ],
)
def test_wrong_files_are_refused(tmp_path, content, message):
    with pytest.raises(ValueError, match=rf"a\.c3d: .*{message}.*Export the recording again\.$"):
        read_motion(put(tmp_path, content, "a.c3d"))


# -- groups of points ------------------------------------------------------------------


MODELLED = {
    "LABELS": texts("LKNE", "LKneeAngles", "LKneeMoment", "RKNE", "LKneePower", "Sway"),
    "ANGLES": texts("LKneeAngles", ""),
    "MOMENTS": texts("Other"),
    "MOMENTS2": texts("LKNEEMOMENT"),
    "POWERS": texts("LKneePower"),
    "SWAYS": texts("Sway"),
    "ANGLE_UNITS": texts("deg"),
    "MOMENT_UNITS": texts("Nmm"),
    "SWAY_UNITS": texts("cm"),
    # Centres of joints have the unit of markers and belong to them.
    "CENTRES": texts("RKNE"),
    "CENTRE_UNITS": texts("mm"),
}


def test_groups_of_points_are_read_with_their_units(tmp_path):
    positions = np.random.default_rng(0).integers(-900, 900, (40, 6, 3)) / 2
    positions[4:6, 1] = 0  # an angle of zero is not missing
    path = put(tmp_path, c3d(positions, changes=MODELLED), "a.c3d")
    expected = {
        "markers": (["LKNE", "RKNE"], [0, 3], "mm"),
        "angles": (["LKneeAngles"], [1], "deg"),
        "moments": (["LKneeMoment"], [2], "Nmm"),
        "powers": (["LKneePower"], [4], None),
        "sways": (["Sway"], [5], "cm"),
    }
    for group, (joints, points, units) in expected.items():
        df = read_motion(path, group=group)
        np.testing.assert_array_equal(df, positions[:, points].reshape(40, -1))
        assert (df.attrs["kind"], df.attrs["joints"], df.attrs["units"]) == (group, joints, units)
        assert list(df.columns) == [f"{joint}_{axis}" for joint in joints for axis in "xyz"]
        assert df.attrs["groups"] == {
            name: {"n": len(points), "units": units, "frame_rate": 50.0}
            for name, (_, points, units) in expected.items()
        }
    df = read_motion(path)
    pd.testing.assert_frame_equal(df, read_motion(path, group="markers"))
    assert df.attrs["left_out"] == "1 angle, 1 moment, 1 power, 1 sway"


def test_missing_groups_are_refused(tmp_path):
    content = c3d(tracks(), changes={"ANGLES": texts("M1")}, analog=np.zeros((40, 2, 3)))
    path = put(tmp_path, content, "a.c3d")
    message = r"a\.c3d: there are no forces in this file; .* 'markers' \(2\), .*'analog' \(3\)\."
    with pytest.raises(ValueError, match=message):
        read_motion(path, group="forces")
    path = put(tmp_path, c3d(tracks(), changes={"ANGLES": texts("M0", "M1", "M2")}), "a.c3d")
    with pytest.raises(ValueError, match=r"no markers in this file; .* reads 'angles' \(3\)\."):
        read_motion(path)


# -- analog channels --------------------------------------------------------------------


@pytest.mark.parametrize("real", [True, False])
def test_analog_channels_are_scaled(tmp_path, real):
    raw = np.random.default_rng(0).integers(-2000, 2000, (40, 4, 3))
    content = c3d(tracks(), real=real, analog=raw, others={"ANALOG": analog_parameters()})
    path = put(tmp_path, content, "a.c3d")
    df = read_motion(path, group="analog")
    expected = (raw.reshape(160, 3) - [10, -20, 0]) * [0.125, 0.5, -0.25]
    np.testing.assert_allclose(df, expected)
    assert list(df.columns) == df.attrs["channels"] == ["Fx", "EMG", "EMG_2"]
    assert (df.attrs["kind"], df.attrs["frame_rate"]) == ("analog", 200)
    assert df.attrs["units"] == ["N", "V", None]
    assert df.attrs["left_out"] == "3 markers"
    assert read_motion(path).attrs["left_out"] == "3 analog channels at 200 Hz"
    assert read_motion(path).attrs["groups"]["analog"]["n"] == 3


def test_analog_channels_may_be_unsigned(tmp_path):
    raw = np.random.default_rng(0).integers(0, 65536, (40, 2, 1))
    changes = {"FORMAT": texts("UNSIGNED"), "OFFSET": words(40000), "GEN_SCALE": None}
    others = {"ANALOG": analog_parameters(1, **changes)}
    path = put(tmp_path, c3d(tracks(), real=False, analog=raw, others=others), "a.c3d")
    df = read_motion(path, group="analog")
    np.testing.assert_array_equal(df["Fx"], (raw.ravel() - 40000) * 0.5)


@pytest.mark.parametrize("real", [True, False])
@pytest.mark.parametrize(("header", "used"), [(3, 3), (9, 3), (12, 9), (12, 2.5), (12, -3)])
def test_of_two_numbers_of_analog_values_the_size_tells_the_right_one(tmp_path, real, header, used):
    raw = np.random.default_rng(0).integers(-2000, 2000, (40, 4, 3))
    used = floats(used) if used % 1 or used < 0 else words(used)
    others = {"ANALOG": analog_parameters(USED=used)}
    content = c3d(tracks(), real=real, analog=raw, others=others, header={"analog": header})
    path = put(tmp_path, content, "a.c3d")
    right = put(
        tmp_path,
        c3d(tracks(), real=real, analog=raw, others={"ANALOG": analog_parameters()}),
        "b.c3d",
    )
    size = (40 * 12 + raw.size) * (4 if real else 2)
    exact = put(tmp_path, content[: 512 * (content[16] - 1) + size], "c.c3d")  # no padding
    for group in ("analog", "markers"):
        for given in (path, exact):
            found = read_motion(given, group=group)
            np.testing.assert_array_equal(found, read_motion(right, group=group))


@pytest.mark.parametrize(("header", "used"), [(9, 7), (24, 4)])
def test_two_numbers_of_analog_values_that_do_not_fit_are_refused(tmp_path, header, used):
    raw = np.ones((40, 4, 3))
    content = c3d(
        tracks(), analog=raw, others={"ANALOG": analog_parameters(used)}, header={"analog": header}
    )
    message = rf"a\.c3d: the header says {header} analog values .* ANALOG:USED says {used} channels"
    with pytest.raises(ValueError, match=message):
        read_motion(put(tmp_path, content, "a.c3d"))


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"SCALE": floats(1, 2)}, r"ANALOG:SCALE has 2 numbers for 3 channels"),
        ({"OFFSET": words(1)}, r"ANALOG:OFFSET has 1 numbers for 3 channels"),
        ({"GEN_SCALE": floats(0)}, r"ANALOG:GEN_SCALE must not be 0"),
        ({"SCALE": floats(1, np.nan, 1)}, r"must be finite, got GEN_SCALE 0\.25, SCALE from "),
    ],
)
def test_wrong_scales_are_refused_for_analog_channels_only(tmp_path, changes, message):
    content = c3d(
        tracks(), analog=np.ones((40, 2, 3)), others={"ANALOG": analog_parameters(**changes)}
    )
    path = put(tmp_path, content, "a.c3d")
    assert len(read_motion(path)) == 40
    with pytest.raises(ValueError, match=rf"a\.c3d: .*{message}.*Export the recording again\.$"):
        read_motion(path, group="analog")


# -- events -----------------------------------------------------------------------------


@pytest.mark.parametrize("group", ["EVENT", "EVENTS"])
@pytest.mark.parametrize("used", [words(3), floats(-3), floats(0.5), floats(np.nan)])
def test_events_have_times_of_the_trial_and_frames_of_the_file(tmp_path, group, used):
    """A number of them that is none is ignored."""
    header = {"first": 101, "last": 140, "events": [("OLD", 0.2)]}
    content = c3d(tracks(), header=header, others={group: event_parameters(USED=used)})
    df = read_motion(put(tmp_path, content, "a.c3d"))
    assert df.attrs["first_frame"] == 101
    assert df.attrs["events"] == [
        {"label": "Foot Strike", "context": "Right", "time": 2.2, "frame": 10.0},
        {"label": "Foot Off", "context": "Left", "time": 2.5, "frame": 25.0},
        {"label": "Turn", "context": None, "time": 60.5, "frame": 2925.0},
    ]
    assert df.attrs["left_out"] == ""


def test_events_of_the_header_count_from_the_first_frame(tmp_path):
    header = {"first": 101, "last": 140, "events": [("RHS", 0.5), ("RTO", 0.11)]}
    for others in (None, {"EVENT": {"USED": words(0)}}):
        df = read_motion(put(tmp_path, c3d(tracks(), header=header, others=others), "a.c3d"))
        assert df.attrs["events"] == [
            {"label": "RTO", "context": None, "time": 2.11, "frame": 5.5},
            {"label": "RHS", "context": None, "time": 2.5, "frame": 25.0},
        ]


@pytest.mark.parametrize("width", [2, 4])
@pytest.mark.parametrize("n", [0, 1, 17, 18, 19])
def test_the_header_has_up_to_18_events(tmp_path, n, width):
    labels = [f"{i:02d}ab"[:width] for i in range(n)]
    content = c3d(tracks(), header={"events": [(label, 0.02) for label in labels]})
    if width == 2:
        tail = "".join(labels).encode().ljust(116, b"\0")[:116]
        content = content[:298] + bytes(2) + content[300:396] + tail + content[512:]
    events = read_motion(put(tmp_path, content[:512] + content[-len(content) + 512 :], "a.c3d"))
    events = events.attrs["events"]
    assert [event["label"] for event in events] == (labels if n < 19 else [])
    assert {event["frame"] for event in events} <= {1.0}


def test_first_frame_may_take_one_word_or_two_or_be_0(tmp_path):
    trial = {"ACTUAL_START_FIELD": words(10, 2), "ACTUAL_END_FIELD": words(49, 2)}
    events = {"EVENT": event_parameters()}
    one_word = {"ACTUAL_START_FIELD": words(7)}
    for first, others, expected in (
        (65535, {"TRIAL": trial}, 2 * 65536 + 10),
        (1, {"TRIAL": one_word}, 7),
        (101, {"TRIAL": {"ACTUAL_START_FIELD": floats(-5)}}, 101),
        (0, {}, 0),
    ):
        header = {"first": first, "last": min(first + 39, 65535)}
        content = c3d(tracks(), header=header, others=others | events)
        df = read_motion(put(tmp_path, content, "a.c3d"))
        assert df.attrs["first_frame"] == expected
        assert df.attrs["events"][0]["frame"] == 110 - max(expected - 1, 0)


def test_events_without_a_time_are_left_out_and_have_no_frame_without_a_rate(tmp_path):
    others = {"EVENT": event_parameters(TIMES=(4, [2, 2], struct.pack("<4f", 0, np.nan, 0, 0.2)))}
    df = read_motion(put(tmp_path, c3d(tracks(), others=others), "a.c3d"))
    assert [event["frame"] for event in df.attrs["events"]] == [10]
    assert df.attrs["left_out"] == "2 events without a time"
    others = {"EVENT": event_parameters()}
    changes = {"RATE": floats(0)}
    df = read_motion(put(tmp_path, c3d(tracks(), changes=changes, others=others), "a.c3d"))
    assert [event["frame"] for event in df.attrs["events"]] == [None] * 3
    df = read_motion(put(tmp_path, c3d(tracks(), others=others), "a.c3d"), frame_rate=25)
    assert df.attrs["events"][0]["frame"] == 110  # the file's own clock


def test_events_at_any_time_have_frames_of_five_decimals(tmp_path):
    times = np.random.default_rng(0).uniform(0, 60, 18).astype("f4")
    changes = {"RATE": floats(59.94)}
    labels = "abcdefghijklmnopqr"
    columns = {"USED": words(18), "LABELS": texts(*labels), "CONTEXTS": None}
    minutes = [number for time in times for number in (0, time)]
    columns["TIMES"] = floats(*minutes, 3.0)  # half a pair is none
    content = c3d(tracks(), changes=changes, others={"EVENT": columns})
    events = read_motion(put(tmp_path, content, "a.c3d")).attrs["events"]
    assert [event["label"] for event in events] == [labels[i] for i in times.argsort()]
    for event, time in zip(events, np.sort(times).tolist(), strict=True):
        assert event["time"] == round(time, 6)
        assert event["frame"] == pytest.approx(time * float(np.float32(59.94)), abs=5e-5)
        assert event["frame"] == round(event["frame"], 5)


# -- real files -------------------------------------------------------------------------


def test_real_files_agree_with_the_package_c3d(real_data):
    import c3d as peer

    frames = {}
    for path in sorted((real_data / "original_files" / "c3d").glob("*.c3d")):
        with pytest.warns(UserWarning, match=r"1\.9 % of the positions are missing .* of 26 mark"):
            df = frames[path.stem] = read_motion(path)
        channels = read_motion(path, group="analog")
        with path.open("rb") as file, warnings.catch_warnings():
            warnings.simplefilter("ignore")
            _, points, values = zip(*peer.Reader(file).read_frames(copy=True), strict=True)
        points = np.array(points)
        expected = np.where(points[..., 3:4] < 0, np.nan, points[..., :3])
        np.testing.assert_allclose(df, expected.reshape(450, -1), rtol=1e-6, atol=1e-4)
        expected = np.concatenate(values, axis=1).T
        np.testing.assert_allclose(channels, expected, rtol=1e-6, atol=1e-4)
        assert channels.attrs["frame_rate"] == 200
        assert channels.attrs["units"][:4] == ["nt", "nt", "nt", "ntmm"]
        assert channels.attrs["events"][0]["frame"] == 4 * 136
    assert len(frames) == 6
    first = frames["Eb015pi"]
    for name, df in frames.items():
        np.testing.assert_allclose(df, first, atol=1e-3)
        assert df.attrs == first.attrs | {"trial": name}
    assert first.attrs["joints"][:3] == ["RFT1", "RFT2", "RFT3"]
    events = [(event["label"], event["time"], event["frame"]) for event in first.attrs["events"]]
    assert events == [("RIC", 2.72, 136), ("RHS", 5.4, 270), ("RTO", 7.32, 366)]
    assert first.attrs["left_out"] == "16 analog channels at 200 Hz, the geometry of 2 force plates"


def test_prefixes_of_markers_are_their_subject(tmp_path):
    labels = texts("Ann:LASI", "Ann:RASI", "*3")
    df = read_motion(put(tmp_path, c3d(tracks(), changes={"LABELS": labels}), "one.c3d"))
    assert (df.attrs["joints"], df.attrs["subject"]) == (["LASI", "RASI", "*3"], "Ann")
    # The angles are of a subject by the names of the markers.
    changes = {"LABELS": texts("Ann:LASI", "Ann:RASI", "Ann:LKneeAngles")}
    changes |= {"ANGLES": texts("Ann:LKneeAngles"), "ANGLE_UNITS": texts("deg")}
    path = put(tmp_path, c3d(tracks(), changes=changes), "angles.c3d")
    assert read_motion(path, group="angles").attrs["joints"] == ["LKneeAngles"]
