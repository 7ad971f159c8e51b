"""GaitDisplay: what is drawn is what gait_events finds."""

import numpy as np
import pandas as pd
import pytest
from sklearn_motionsync.datasets import make_walk
from sklearn_motionsync.display import GaitDisplay
from sklearn_motionsync.gait import gait_events


@pytest.fixture(scope="module")
def walk():
    return make_walk(2, n_strides=4, random_state=0)


def test_lines_and_bars_are_at_the_events(walk):
    shown = GaitDisplay.from_positions(walk.data, walk.skeleton, recording=1, frame_rate=100)
    events = gait_events(walk.data, walk.skeleton, frame_rate=100)
    own = events[events["trial"] == 1]
    for axis, context in zip(shown.axes_, ("Left", "Right"), strict=False):
        times = sorted(line.get_xdata()[0] for line in axis.lines[2:])
        np.testing.assert_allclose(times, own[own["context"] == context]["time"])
    for side, spans in shown.stances_.items():
        strikes = own[(own["context"] == side.capitalize()) & (own["label"] == "Foot Strike")]
        begins = [begin for begin, _ in spans if begin > 0]
        np.testing.assert_allclose(begins, strikes["time"])
        whole = [length for begin, length in spans if 0 < begin < strikes["time"].iloc[-1]]
        np.testing.assert_allclose(whole, 0.68, atol=0.08)


def test_heights_are_above_the_floor_in_metres(walk):
    df = pd.DataFrame(100 * walk.data[0], columns=walk.skeleton.column_names)
    df.attrs |= {"frame_rate": 100.0, "units": "cm", "up": "y"}
    shown = GaitDisplay.from_positions(df)
    assert shown.unit == "m"
    heel = shown.heights["left_heel"]
    assert heel.min() >= 0
    assert 0.1 < heel.max() < 0.35


def test_refused(walk):
    with pytest.raises(ValueError, match="recording"):
        GaitDisplay.from_positions(walk.data, walk.skeleton, recording=2, frame_rate=100)


def test_events_of_the_user_are_drawn(walk):
    events = gait_events(walk.data, walk.skeleton, frame_rate=100).iloc[:3]
    shown = GaitDisplay.from_positions(
        walk.data, walk.skeleton, events=events, frame_rate=100, xlabel="since the start (s)"
    )
    assert shown.axes_[-1].get_xlabel() == "since the start (s)"
    assert repr(shown) == "GaitDisplay(2 strikes, 1 foot-off)"
