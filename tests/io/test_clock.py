"""One clock: the same instant has the same seconds in a file, in parts of it, and written again.

The first column of these recordings is the time of the row itself, from the number of its frame.
"""

import numpy as np
import pandas as pd
import pytest
from sklearn_motionsync import to_trials
from sklearn_motionsync.datasets import make_walk
from sklearn_motionsync.gait import gait_events
from sklearn_motionsync.io import (
    cut_at_events,
    fill_gaps,
    keyframes_from_events,
    read_motion,
    write_motion,
)

from motion_files import AMC, ASF, EXAMPLES, body, c3d, floats, put, storage, texts, trc, words

FIRST, RATE, N = 695, 50.0, 60
SECONDS = (FIRST - 1 + np.arange(N)) / RATE


def cropped(**params):
    """A C3D file that begins at frame 695; markers at x are the seconds of each frame."""
    positions = np.tile(SECONDS[:, None, None], (1, 2, 3)) + [0, 1, 2]
    events = {"USED": words(3), "LABELS": texts(*["Foot Strike"] * 3)}
    events["TIMES"] = 4, [2, 3], floats(0, 14.2, 0, 14.6, 0, 14.9)[2]
    others = {"EVENT": events} | params.pop("others", {})
    header = {"first": FIRST, "last": FIRST + N - 1}
    return c3d(positions, header=header, others=others, **params)


def written(ending):
    def write(df, folder):
        write_motion(folder / f"b{ending}", df)
        return [read_motion(folder / f"b{ending}")]

    return write


WAYS = {
    "whole": lambda df, folder: [df],
    "rows": lambda df, folder: [df.iloc[7:40]],
    "every second": lambda df, folder: [df.iloc[5::2]],
    "cut": lambda df, folder: cut_at_events(df, "Foot Strike"),
    "cut from rows": lambda df, folder: cut_at_events(df.iloc[2:], "Foot Strike"),
    "cut twice": lambda df, folder: [cut.iloc[3:] for cut in cut_at_events(df, "Foot Strike")],
    "trimmed": lambda df, folder: [fill_gaps(df[3:].reindex(df.index), 0, ends="trim")],
    "another rate": lambda df, folder: to_trials(df, frame_rate=20),
    "rows at another rate": lambda df, folder: to_trials(df.iloc[9:], frame_rate=80),
    "TRC": written(".trc"),
    "MOT": written(".mot"),
    "TRC of rows": lambda df, folder: written(".trc")(df.iloc[7:], folder),
    "TRC of a cut": lambda df, folder: written(".trc")(cut_at_events(df, "Foot Strike")[0], folder),
}


@pytest.mark.parametrize("way", WAYS)
def test_a_moment_is_in_the_row_of_its_seconds(tmp_path, way):
    df = read_motion(put(tmp_path, cropped(), "a.c3d"))
    assert df.attrs["first_time"] == (FIRST - 1) / RATE
    for part in WAYS[way](df, tmp_path):
        seconds = part.iloc[:, 0].to_numpy()
        at = seconds[1] + 0.37 * (seconds[-1] - seconds[1])
        if "TRC" in way:
            assert part.attrs["first_frame"] == round(1 + RATE * seconds[0])
            assert part.attrs["first_time"] == pytest.approx(seconds[0], abs=1e-6)
        frames = part.index if part.index.name == "frame" else np.arange(len(part))
        step = (seconds[1] - seconds[0]) / (frames[1] - frames[0])
        for event in part.attrs.pop("events", ()):
            time = seconds[0] + (event["frame"] - frames[0]) * step
            assert time == pytest.approx(event["time"], abs=1e-4)
        part.attrs |= {"trial": "x", "levels": ["trial", "frame"]}
        table = pd.DataFrame({"trial": ["x"], "event": ["e"], "seconds": [at]})
        (row,) = keyframes_from_events([part], table)["e"]
        assert np.interp(row, np.arange(len(seconds)), seconds) == pytest.approx(at, abs=1e-4)


@pytest.mark.parametrize("start", [0, 3.5])
def test_the_times_of_a_column_are_the_clock_of_its_trials(tmp_path, start):
    df = read_motion(put(tmp_path, cropped(), "a.c3d"))
    seconds = start + np.arange(N) / RATE
    for rate in (None, 40):
        (trial,) = to_trials(df.assign(time=seconds), time="time", frame_rate=rate)
        assert trial.attrs["first_time"] == start
        for event, before in zip(trial.attrs["events"], df.attrs["events"], strict=True):
            assert event["time"] == pytest.approx(start + before["frame"] / RATE)
            assert event["frame"] == pytest.approx(before["frame"] * (rate or RATE) / RATE)
    assert df.attrs["events"][0]["time"] == 14.2
    # In milliseconds a column tells no seconds.
    (trial,) = to_trials(df.assign(ms=1000 * seconds), time="ms")
    assert trial.attrs["first_time"] == (FIRST - 1) / RATE
    assert trial.attrs["events"] == df.attrs["events"]
    # The frame rate stays one a second.
    (trial,) = to_trials(df.assign(ms=1000 * seconds), time="ms", frame_rate=0.025)
    assert trial.attrs["frame_rate"] == 25
    assert trial.attrs["events"][0]["frame"] == df.attrs["events"][0]["frame"] / 2


def test_analog_channels_have_the_clock_of_the_markers(tmp_path):
    analog = np.repeat(SECONDS, 4).reshape(N, 4, 1) + np.arange(4)[:, None] / (4 * RATE)
    others = {"ANALOG": {"USED": words(1)}}
    path = put(tmp_path, cropped(analog=analog, others=others), "a.c3d")
    df = read_motion(path, group="analog")
    assert df.attrs["first_time"] == (FIRST - 1) / RATE
    for part in (df, df.iloc[17:], *cut_at_events(df, "Foot Strike")):
        start = part.iloc[0, 0]
        assert part.attrs["first_time"] + part.index[0] / 200 == pytest.approx(start, abs=1e-5)
        for event in part.attrs["events"]:
            seconds = part.attrs["first_time"] + event["frame"] / 200
            assert seconds == pytest.approx(event["time"], abs=1e-5)
    for part in cut_at_events(df, "Foot Strike"):
        assert part.attrs["first_frame"] == 1 + int(RATE * part.iloc[0, 0] + 1e-3)


@pytest.mark.parametrize("rows", [slice(None), slice(11, None), slice(3, None, 2)])
def test_gait_events_have_the_seconds_of_the_events_of_the_file(tmp_path, rows):
    walk = make_walk(1, random_state=0)
    n, rate = len(walk.skeleton.joints), walk.frame_rate
    true = gait_events(walk.data, walk.skeleton, frame_rate=rate)["frame"].to_numpy()
    changes = {"RATE": floats(rate), "LABELS": texts(*walk.skeleton.joints)}
    positions = 1000 * np.asarray(walk.data[0]).reshape(-1, n, 3)
    header = {"first": FIRST, "last": FIRST + len(positions) - 1}
    path = put(tmp_path, c3d(positions, changes=changes, header=header), "a.c3d")
    found = gait_events(read_motion(path).iloc[rows], walk.skeleton)
    for time in found["time"]:
        assert np.abs((FIRST - 1 + true) / rate - time).min() < 0.02
    # A number of the first frame alone tells the same.
    df = read_motion(path)
    del df.attrs["first_time"]
    assert gait_events(df.iloc[rows], walk.skeleton).equals(found)


@pytest.mark.parametrize("frame_rate", [None, 25])
@pytest.mark.parametrize("key", ["c3d", "vicon", "qtm"])
def test_events_of_every_format_are_at_the_seconds_of_their_frames(tmp_path, key, frame_rate):
    path, *_ = [put(tmp_path, content, name) for name, content in EXAMPLES[key]().items()]
    attrs = read_motion(path, frame_rate=frame_rate, max_gap=9).attrs
    assert attrs["events"]
    for event in attrs["events"]:
        seconds = attrs["first_time"] + event["frame"] / attrs["frame_rate"]
        assert event["time"] == pytest.approx(seconds, abs=2e-5)


def test_another_rate_sets_the_times_of_frames_anew(tmp_path):
    path = put(tmp_path, cropped(), "a.c3d")
    df, slow = read_motion(path), read_motion(path, frame_rate=25)
    assert slow.attrs["first_time"] == (FIRST - 1) / 25
    for event, later in zip(df.attrs["events"], slow.attrs["events"], strict=True):
        assert later["frame"] == event["frame"]
        assert later["time"] == pytest.approx(2 * event["time"], abs=1e-5)
    # Times in rows are a clock of their own, and the rate of a file may be missing.
    late = storage(np.zeros((9, 1)), ["knee"], times=3 + np.arange(9) / 100)
    assert read_motion(put(tmp_path, late, "a.mot"), frame_rate=25).attrs["first_time"] == 3
    text = trc(np.ones((9, 1, 3)), ["M"], times=3 + np.arange(9) / 50)
    assert read_motion(put(tmp_path, text, "a.trc")).attrs["first_time"] == 3
    path = put(tmp_path, cropped(changes={"RATE": floats(0)}), "a.c3d")
    assert "first_time" not in read_motion(path).attrs
    assert read_motion(path, frame_rate=50).attrs["first_time"] == (FIRST - 1) / 50


@pytest.mark.parametrize(("number", "start"), [(0, 0), (1, 0), (101, 1)])
def test_formats_without_times_count_from_their_first_frame(tmp_path, number, start):
    put(tmp_path, ASF, "a.asf")
    amc = AMC.replace("\n1\n", f"\n{number}\n").replace("\n2\n", f"\n{number + 1}\n", 1)
    df = read_motion(put(tmp_path, amc, "a.amc"), frame_rate=100)
    assert (df.attrs["first_frame"], df.attrs["first_time"]) == (number, start)
    assert "first_time" not in read_motion(tmp_path / "a.amc").attrs
    assert read_motion(put(tmp_path, body())).attrs["first_time"] == 0
