"""CycleSegmenter(start="left strike"): cycles begin where the foot strikes."""

import numpy as np
import pandas as pd
import pytest
from sklearn_motionsync.datasets import load_trials, make_walk
from sklearn_motionsync.gait import gait_events
from sklearn_motionsync.takes import CycleSegmenter

WALK = make_walk(4, n_strides=6, random_state=0)


def strikes(x, skeleton, context, rate):
    found = gait_events([x], skeleton, frame_rate=rate)
    rows = (found["label"] == "Foot Strike") & (found["context"] == context)
    return found.loc[rows, "frame"].to_numpy()


def test_cuts_of_people_not_seen_are_the_strikes():
    segmenter = CycleSegmenter(WALK.skeleton, start="right strike", frame_rate=100)
    _, table = segmenter.fit(WALK.data[:2]).segment(WALK.data[2:])
    assert segmenter.start_ == "right strike"
    for take, (x, events) in enumerate(zip(WALK.data[2:], WALK.events[2:], strict=True)):
        known = strikes(x, WALK.skeleton, "Right", 100)
        starts = table.loc[table["take"] == take, "start"]
        assert len(starts) == len(known) - 1
        assert np.abs(starts - known[:-1]).max() <= 0.5
        found = pd.DataFrame(events)
        rows = (found["label"] == "Foot Strike") & (found["context"] == "Right")
        assert np.abs(starts - found.loc[rows, "frame"].to_numpy()[:-1]).max() < 1.5


def test_tables_know_their_frame_rate():
    X = [pd.DataFrame(x, columns=WALK.skeleton.column_names) for x in WALK.data[:2]]
    for table in X:
        table.attrs |= {"frame_rate": 100.0, "up": "y"}
    segmenter = CycleSegmenter(WALK.skeleton, start="left strike").fit(X)
    _, table = segmenter.segment(X)
    for take, rows in table.groupby("take"):
        known = strikes(WALK.data[take], WALK.skeleton, "Left", 100)
        assert np.abs(rows["start"] - known[: len(rows)]).max() <= 0.5


def test_cuts_of_recorded_walks(real_data):
    bunch = load_trials(real_data / "cmu07_walk" / "cmu07_walk_positions.npz")
    segmenter = CycleSegmenter(bunch.skeleton, start="left strike", frame_rate=60)
    _, table = segmenter.fit(bunch.data[:6]).segment(bunch.data[6:])
    assert len(table) >= 12
    for take, start in zip(table["take"], table["start"], strict=True):
        known = strikes(bunch.data[6 + take], bunch.skeleton, "Left", 60)
        assert np.abs(known - start).min() <= 0.5


def test_refused():
    with pytest.raises(ValueError, match=r"start='left strike' needs skeleton="):
        CycleSegmenter(start="left strike").fit(WALK.data)
    with pytest.raises(ValueError, match="The frame rate of trial 0 is not known"):
        CycleSegmenter(WALK.skeleton, start="left strike").fit(WALK.data)
