"""GaitDisplay: what is drawn is what gait_events finds."""

import numpy as np
import pandas as pd
import pytest
from sklearn_motionsync.datasets import make_walk
from sklearn_motionsync.display import GaitDisplay
from sklearn_motionsync.gait import gait_events

WALK = make_walk(2, n_strides=4, random_state=0)
EVENTS = gait_events(WALK.data, WALK.skeleton, frame_rate=100)


def drawn(**given):
    return GaitDisplay.from_positions(WALK.data, WALK.skeleton, frame_rate=100, **given)


def test_lines_and_bars_are_at_the_events():
    shown = drawn(recording=1)
    expected = EVENTS[EVENTS["trial"] == 1]
    for axis, context in zip(shown.axes_, ("Left", "Right"), strict=False):
        times = sorted(line.get_xdata()[0] for line in axis.lines[2:])
        np.testing.assert_allclose(times, expected[expected["context"] == context]["time"])
    for side, spans in shown.stances_.items():
        of_side = expected[expected["context"] == side.capitalize()]
        strikes = of_side["time"][of_side["label"] == "Foot Strike"]
        np.testing.assert_allclose([begin for begin, _ in spans if begin > 0], strikes)
        whole = [length for begin, length in spans if 0 < begin < strikes.iloc[-1]]
        np.testing.assert_allclose(whole, 0.68, atol=0.08)


def test_heights_are_above_the_floor_in_metres():
    df = pd.DataFrame(100 * WALK.data[0], columns=WALK.skeleton.column_names)
    df.attrs |= {"frame_rate": 100.0, "units": "cm", "up": "y"}
    shown = GaitDisplay.from_positions(df)
    heel = shown.heights["left_heel"]
    assert heel.min() >= 0
    assert 0.1 < heel.max() < 0.35
    assert [axis.get_ylabel() for axis in shown.axes_] == ["height (m)", "height (m)", "foot"]


def test_events_of_the_user_are_drawn_and_other_recordings_refused():
    assert repr(drawn(events=EVENTS.iloc[:3])) == "GaitDisplay(2 strikes, 1 foot-off)"
    with pytest.raises(ValueError, match="recording must be from 0 to 1, got"):
        drawn(recording=2)
