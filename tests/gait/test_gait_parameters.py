"""gait_parameters: made walks have known lengths and times."""

import numpy as np
import pandas as pd
import pytest
from sklearn_motionsync.datasets import make_walk
from sklearn_motionsync.gait import gait_events, gait_parameters


@pytest.mark.parametrize("treadmill", [False, True])
def test_known_lengths_and_times(treadmill):
    walk = make_walk(4, n_strides=8, treadmill=treadmill, random_state=0)
    table = gait_parameters(walk.data, walk.skeleton, frame_rate=walk.frame_rate)
    for i in range(4):
        own = table.loc[i]["mean"]
        assert own["speed"] == pytest.approx(walk.speed[i], rel=0.03)
        assert own["stride length"] == pytest.approx(walk.stride_length[i], rel=0.03)
        assert own["step length"] == pytest.approx(walk.stride_length[i] / 2, rel=0.05)
        assert own["step width"] == pytest.approx(walk.step_width[i], abs=0.01)
        events = pd.DataFrame(walk.events[i])
        strikes = events[events["label"] == "Foot Strike"].sort_values("time")
        strides = strikes.groupby("context")["time"].diff()
        assert own["stride time"] == pytest.approx(strides.mean(), rel=0.01)
        steps = strikes["time"].diff()
        assert own["cadence"] == pytest.approx(60 / steps.mean(), rel=0.01)


def test_given_events_count():
    walk = make_walk(2, random_state=0)
    events = gait_events(walk.data, walk.skeleton, frame_rate=100)
    expected = gait_parameters(walk.data, walk.skeleton, frame_rate=100)
    assert expected.loc[0].loc["stride length", "unit"] == "", "arrays tell none"
    for columns in (["label", "context", "frame"], ["label", "context", "time"]):
        found = gait_parameters(
            walk.data, walk.skeleton, events=events[["trial", *columns]], frame_rate=100
        )
        pd.testing.assert_frame_equal(found, expected)
    unknown = events.head(1).assign(time=np.nan)
    found = gait_parameters(
        walk.data, walk.skeleton, events=pd.concat([events, unknown]).drop(columns="frame"),
        frame_rate=100,
    )  # fmt: skip
    pd.testing.assert_frame_equal(found, expected)
    for lost in ({"frame": np.nan}, {"label": "RHS"}, {"context": "General"}):
        with pytest.raises(ValueError, match=rf"none of {len(events)} rows has a label"):
            gait_parameters(walk.data, walk.skeleton, events=events.assign(**lost), frame_rate=100)
    # A strike that is missing leaves its strides out; it does not make long ones.
    strikes = events.index[(events["label"] == "Foot Strike") & (events["context"] == "Left")]
    fewer = events.drop(strikes[2])
    found = gait_parameters(walk.data, walk.skeleton, events=fewer, frame_rate=100)
    times = [table.loc[0].loc["stride time"] for table in (found, expected)]
    assert times[0]["left"] == pytest.approx(times[1]["left"], rel=0.03)
    assert times[0]["n"] == times[1]["n"] - 2


def test_a_body_that_stands_has_a_table_all_the_same():
    walk = make_walk(1, random_state=0)
    still = np.repeat(walk.data[0][:1], 300, axis=0)
    table = gait_parameters([still], walk.skeleton, frame_rate=100).loc[0]
    assert (table["n"] == 0).all()
    assert table["mean"].isna().all()
