"""MVNX of Xsens: the numbers that were written, times, memory, and wrong files."""

import tracemalloc

import numpy as np
import pytest
from sklearn_motionsync.io import read_motion

from motion_files import mvnx, put, tracks


def test_segments_and_angles_are_those_of_the_file(tmp_path):
    positions, angles = tracks(), np.random.default_rng(1).normal(size=(40, 2, 3)).round(4)
    path = put(tmp_path, mvnx(positions, angles), "a.xml")
    df = read_motion(path)
    np.testing.assert_array_equal(df.to_numpy().reshape(40, 3, 3), positions)
    facts = {"joints": ["Pelvis", "L5", "L3"], "parents": [-1, 0, 1], "units": "m", "up": "z"}
    facts |= {"kind": "segments", "subject": "Suit 1", "frame_rate": 60.0, "first_time": 0.0}
    assert {key: df.attrs[key] for key in facts} == facts
    assert "times" not in df.attrs
    assert df.attrs["left_out"] == (
        "orientations, joint angles, the calibration pose 'identity', the calibration pose 'tpose'"
    )
    df = read_motion(path, group="angles")
    np.testing.assert_array_equal(df.to_numpy().reshape(40, 2, 3), angles)
    assert list(df) == [f"{joint}_{axis}" for joint in ("jL5", "jL3") for axis in "xyz"]
    assert (df.attrs["kind"], df.attrs["units"], df.attrs["subject"]) == ("angles", "deg", "Suit 1")


@pytest.mark.parametrize("rate", [60, 120, 240])
def test_times_are_milliseconds(tmp_path, rate):
    times = [round(1000 * k / rate) for k in range(500, 540)]
    df = read_motion(put(tmp_path, mvnx(tracks(), rate=rate, times=times), "a.mvnx"))
    assert (df.attrs["frame_rate"], df.attrs["first_time"]) == (rate, times[0] / 1000)
    lost = times[:20] + [time + 50 for time in times[20:]]
    with pytest.warns(UserWarning, match=r"^a\.mvnx: its times are uneven"):
        df = read_motion(put(tmp_path, mvnx(tracks(), rate=rate, times=lost), "a.mvnx"))
    np.testing.assert_allclose(df.attrs["times"], np.array(lost) / 1000)
    df = read_motion(put(tmp_path, mvnx(tracks(), rate=rate, times=[None] * 40), "a.mvnx"))
    assert (df.attrs["frame_rate"], df.attrs["first_time"]) == (rate, 0)


def test_a_long_file_is_read_frame_by_frame(tmp_path):
    positions = np.random.default_rng(0).normal(size=(4000, 4, 3)).round(5)
    path = put(tmp_path, mvnx(positions), "a.mvnx")
    read_motion(path)
    tracemalloc.start()
    df = read_motion(path)
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    np.testing.assert_array_equal(df.to_numpy(), positions.reshape(4000, 12))
    # As a tree its elements would take more than 20 times its numbers.
    assert peak < 8 * positions.nbytes


BOMB = '<!DOCTYPE mvnx [<!ENTITY a "1 2 3"><!ENTITY b "&a;&a;&a;">]>'


@pytest.mark.parametrize(
    ("content", "message"),
    [
        (mvnx(tracks(), head=BOMB), "frame 0: it declares entities"),
        (mvnx(tracks(), head=BOMB).replace("UTF-8", "UTF-16").encode("utf-16"), "it declares enti"),
        (mvnx(tracks(), head="<!--" + "<mvnx" * 40_000 + "-->" + BOMB), "it declares entities"),
        (mvnx(tracks())[:-200], r"frame 3\d: .*; the file is damaged or not complete"),
        (mvnx(tracks()).replace("UTF-8", "none"), "unknown encoding.*; the file is damaged"),
        (b"", "the file is damaged or not complete"),
        (mvnx(tracks()[:0]), "frame 0: the file ends where frames should follow"),
        (mvnx(tracks()).replace('"L3"', '""'), None),
        (mvnx(tracks()).replace('label="T', ""), None),
        (mvnx(tracks(), more="<subject/>"), "a second subject begins"),
        (mvnx(tracks()).replace("</segments>", '<segment label="x"/></segments>'), "of 4 segm"),
        (mvnx(tracks(), times=range(40, 0, -1)), "frame 1: the time of a row .* got 39 after 40"),
    ],
)
def test_wrong_files_are_refused(tmp_path, content, message):
    path = put(tmp_path, content, "a.mvnx")
    if message is None:
        assert read_motion(path).shape == (40, 9)
        return
    with pytest.raises(ValueError, match=rf"a\.mvnx, .*{message}"):
        read_motion(path)


def test_groups_that_are_not_there_are_refused(tmp_path):
    path = put(tmp_path, mvnx(tracks()), "a.mvnx")
    with pytest.raises(ValueError, match=r"a\.mvnx, frame 0: <jointAngle> needs 3 numbers for ea"):
        read_motion(path, group="angles")
    with pytest.raises(ValueError, match=r"there are no forces in it; group= reads \['segments', "):
        read_motion(path, group="forces")
