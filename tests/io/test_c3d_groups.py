"""C3D beside the markers: groups of points, events, the first frame, analog channels."""

import struct

import numpy as np
import pandas as pd
import pytest
from sklearn_motionsync import KeyframeSynchronizer
from sklearn_motionsync.io import read_motion

from motion_files import c3d, put, texts, tracks


def floats(*values):
    return 4, [len(values)], struct.pack(f"<{len(values)}f", *values)


def words(*values):
    return 2, [len(values)], struct.pack(f"<{len(values)}H", *(v % 65536 for v in values))


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
    # Centres of joints, in the unit of markers, are as good as these.
    "CENTRES": texts("RKNE"),
    "CENTRE_UNITS": texts("mm"),
}


def modelled(**params):
    rng = np.random.default_rng(0)
    changes = MODELLED | params.pop("changes", {})
    return c3d(rng.integers(-900, 900, (40, 6, 3)) / 2, changes=changes, **params)


def test_points_that_are_no_markers(tmp_path):
    """What the file says are angles, moments, powers are no markers, and have their units."""
    path = put(tmp_path, modelled(), "a.c3d")
    positions = np.random.default_rng(0).integers(-900, 900, (40, 6, 3)) / 2
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
    assert pd.concat([df, df]).attrs == df.attrs


def test_angles_of_zero_are_angles(tmp_path):
    positions = tracks()
    positions[4:6, :2] = 0
    changes = {"ANGLES": texts("M1")}
    path = put(tmp_path, c3d(positions, changes=changes), "a.c3d")
    assert (read_motion(path, group="angles").iloc[4:6] == 0).all(axis=None)
    with pytest.warns(UserWarning, match=r"of 1 of 2 markers \(M0\)"):
        read_motion(path)


def test_groups_that_are_not_there(tmp_path):
    path = put(tmp_path, modelled(analog=np.zeros((40, 2, 3))), "a.c3d")
    message = r"a\.c3d: there are no forces in this file; .* 'markers' \(2\), .*'analog' \(3\)\."
    with pytest.raises(ValueError, match=message):
        read_motion(path, group="forces")
    with pytest.raises(
        ValueError, match=r"max_gap goes with positions, got max_gap=3 frames for the an"
    ):
        read_motion(path, group="analog", max_gap=3)
    with pytest.raises(ValueError, match=r"group= goes with \.c3d files only, got group='angles'"):
        read_motion(put(tmp_path, "", "a.bvh"), group="angles")
    path = put(tmp_path, c3d(tracks(), changes={"ANGLES": texts("M0", "M1", "M2")}), "a.c3d")
    with pytest.raises(ValueError, match=r"no markers in this file; .* 'angles' \(3\)\."):
        read_motion(path)


# -- analog channels --------------------------------------------------------------------


def analog_parameters(n=3, **changes):
    return {
        "ANALOG": {
            "USED": words(n),
            "LABELS": texts("Fx", "EMG"),
            "LABELS2": texts("EMG"),
            "UNITS": texts("N", "V"),
            "SCALE": floats(0.5, 2, -1),
            "OFFSET": words(10, -20, 0),
            "GEN_SCALE": floats(0.25),
        }
        | changes
    }


@pytest.mark.parametrize("real", [True, False])
def test_analog_channels(tmp_path, real):
    raw = np.random.default_rng(0).integers(-2000, 2000, (40, 4, 3))
    content = c3d(tracks(), real=real, analog=raw, others=analog_parameters())
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


def test_analog_channels_without_a_sign(tmp_path):
    raw = np.random.default_rng(0).integers(0, 65536, (40, 2, 1))
    changes = {"FORMAT": texts("UNSIGNED"), "OFFSET": words(40000), "GEN_SCALE": None}
    others = analog_parameters(1, **changes)
    path = put(tmp_path, c3d(tracks(), real=False, analog=raw, others=others), "a.c3d")
    df = read_motion(path, group="analog")
    np.testing.assert_array_equal(df["Fx"], (raw.ravel() - 40000) * 0.5)


def test_analog_channels_alone(tmp_path):
    path = put(tmp_path, c3d(np.zeros((40, 0, 3)), analog=np.ones((40, 2, 2))), "a.c3d")
    df = read_motion(path, group="analog")
    assert df.shape == (80, 2)
    assert df.attrs["channels"] == ["channel_1", "channel_2"]
    with pytest.raises(ValueError, match=r"no markers in this file; .* 'analog' \(2\)\."):
        read_motion(path)


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"SCALE": floats(1, 2)}, r"ANALOG:SCALE has 2 numbers for 3 channels"),
        ({"OFFSET": words(1)}, r"ANALOG:OFFSET has 1 numbers for 3 channels"),
        ({"GEN_SCALE": floats(0)}, r"ANALOG:GEN_SCALE must not be 0"),
        ({"SCALE": floats(1, np.nan, 1)}, r"must be finite, got GEN_SCALE 0\.25, SCALE from "),
    ],
)
def test_bad_scales(tmp_path, changes, message):
    """They are in the way of the channels only."""
    content = c3d(tracks(), analog=np.ones((40, 2, 3)), others=analog_parameters(**changes))
    path = put(tmp_path, content, "a.c3d")
    assert len(read_motion(path)) == 40
    with pytest.raises(ValueError, match=rf"a\.c3d: .*{message}.*Export the recording again\.$"):
        read_motion(path, group="analog")


# -- events -----------------------------------------------------------------------------


def event_parameters(**changes):
    return {
        "USED": words(3),
        "LABELS": texts("Foot Off", "Foot Strike", "Turn"),
        "CONTEXTS": texts("Left", "Right"),
        "TIMES": (4, [2, 3], struct.pack("<6f", 0, 2.5, 0, 2.2, 1, 0.5)),
    } | changes


@pytest.mark.parametrize("group", ["EVENT", "EVENTS"])
def test_events(tmp_path, group):
    """Minutes and seconds since frame 1 of the trial, of which the file may be a part."""
    header = {"first": 101, "last": 140, "events": [("OLD", 0.2)]}
    content = c3d(tracks(), header=header, others={group: event_parameters()})
    df = read_motion(put(tmp_path, content, "a.c3d"))
    assert df.attrs["first_frame"] == 101
    assert df.attrs["events"] == [
        {"label": "Foot Strike", "context": "Right", "time": 2.2, "frame": 10.0},
        {"label": "Foot Off", "context": "Left", "time": 2.5, "frame": 25.0},
        {"label": "Turn", "context": None, "time": 60.5, "frame": 2925.0},
    ]
    assert df.attrs["left_out"] == ""
    assert pd.concat([df, df]).attrs == df.attrs


def test_events_of_the_header(tmp_path):
    """Seconds since the first frame of the file."""
    header = {"first": 101, "last": 140, "events": [("RHS", 0.5), ("RTO", 0.11)]}
    for others in (None, {"EVENT": {"USED": words(0)}}):
        df = read_motion(put(tmp_path, c3d(tracks(), header=header, others=others), "a.c3d"))
        assert df.attrs["events"] == [
            {"label": "RTO", "context": None, "time": 2.11, "frame": 5.5},
            {"label": "RHS", "context": None, "time": 2.5, "frame": 25.0},
        ]


def test_the_first_frame(tmp_path):
    """Trials of more than 65535 frames say it in two words, and some count from 0."""
    trial = {"ACTUAL_START_FIELD": words(10, 2), "ACTUAL_END_FIELD": words(49, 2)}
    others = {"TRIAL": trial, "EVENT": event_parameters()}
    header = {"first": 65535, "last": 65535}
    df = read_motion(put(tmp_path, c3d(tracks(), header=header, others=others), "a.c3d"))
    assert df.attrs["first_frame"] == 2 * 65536 + 10
    assert df.attrs["events"][0]["frame"] == 2.2 * 50 - (2 * 65536 + 9)
    header = {"first": 0, "last": 39}
    others = {"EVENT": event_parameters()}
    df = read_motion(put(tmp_path, c3d(tracks(), header=header, others=others), "a.c3d"))
    assert df.attrs["first_frame"] == 0
    assert df.attrs["events"][0]["frame"] == 110


def test_events_without_a_time_or_a_clock(tmp_path):
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


@pytest.mark.parametrize("used", [-3, 0.5, 1e30, np.nan, np.inf])
def test_numbers_of_events_that_are_none(tmp_path, used):
    others = {"EVENT": event_parameters(USED=floats(used))}
    df = read_motion(put(tmp_path, c3d(tracks(), others=others), "a.c3d"))
    assert [event["frame"] for event in df.attrs["events"]] == [110, 125, 3025]


def test_events_are_keyframes(tmp_path):
    recordings = []
    for strike, off in ((0.2, 0.5), (0.3, 0.6)):
        times = struct.pack("<6f", 0, strike, 0, off, 0, 0.7)
        others = {"EVENT": event_parameters(TIMES=(4, [2, 3], times))}
        recordings.append(read_motion(put(tmp_path, c3d(tracks(), others=others), "a.c3d")))
    keyframes = [[event["frame"] for event in df.attrs["events"]] for df in recordings]
    assert keyframes == [[10, 25, 35], [15, 30, 35]]
    sync = KeyframeSynchronizer(n_frames=40).fit(recordings, keyframes=keyframes)
    assert sync.transform(recordings, keyframes=keyframes).shape == (2, 40, 9)
