"""Time stamps of frames: one a frame, and they increase."""

import numpy as np
import pytest
from sklearn_motionsync.online.times import as_stamps


def test_without_times_one_frame_follows_another():
    assert as_stamps(None, 3).tolist() == [0, 1, 2]
    assert as_stamps(None, 2, after=4.5).tolist() == [5.5, 6.5]


def test_seconds_are_frames_of_the_training_performances():
    assert as_stamps([0.5, 1], 2, frame_rate=30).tolist() == [15, 30]
    assert as_stamps([0.5, 1], 2).tolist() == [0.5, 1]
    assert as_stamps(2, 1, after=1.0).tolist() == [2]


@pytest.mark.parametrize(
    ("times", "after", "said"),
    [
        ([0, 1], None, r"one a frame, shape \(3,\), got \(2,\)"),
        ([0, np.nan, 1], None, "time of frame 1 is nan"),
        ([0, 1, 1], None, "1 follows 1"),
        ([2, 1, 3], None, "1 follows 2"),
        ([2, 3, 4], 20.0, "2 follows 2"),
        (["a", "b", "c"], None, "times"),
    ],
)
def test_other_times_are_refused(times, after, said):
    with pytest.raises(ValueError, match=said):
        as_stamps(times, 3, frame_rate=None if after is None else 10, what="Take 4", after=after)
