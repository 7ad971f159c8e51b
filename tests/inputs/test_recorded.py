"""Which frames of a recording the rows of a table are, and their frame rate."""

import numpy as np
import pandas as pd
import pytest
from sklearn_motionsync.inputs.recorded import frame_rate_of_rows, recorded_frames

RATE = 120.0
SECONDS = np.arange(60) / RATE


def recording(index=None):
    df = pd.DataFrame({"knee": np.arange(60.0)}, index=index)
    df.attrs = {"frame_rate": RATE}
    return df


ROWS = [
    ("all", slice(None), RATE),
    ("behind", slice(10, None), RATE),
    ("before", slice(None, 20), RATE),
    ("thinned out", slice(3, None, 4), RATE / 4),
    ("reversed", slice(None, None, -1), RATE),
    ("thinned out backwards", slice(None, None, -3), RATE / 3),
    ("one", slice(7, 8), RATE),
    ("with a hole", [0, 1, 2, 5, 6], None),
    ("shuffled", [4, 0, 2, 1, 3], None),
    ("twice", [1, 1, 1], None),
]


@pytest.mark.parametrize(("rows", "rate"), [row[1:] for row in ROWS], ids=[row[0] for row in ROWS])
@pytest.mark.parametrize("name", [None, "frame", "row"])
def test_rows_that_pandas_selects_are_frames_of_the_recording(rows, rate, name):
    frames = pd.RangeIndex(60, name=name)
    for index in (frames, pd.MultiIndex.from_product([["ann"], frames])):
        part = recording(index).iloc[rows]
        assert frame_rate_of_rows(part) == rate
        assert recorded_frames(part).tolist() == part["knee"].tolist()


SECONDS_INDICES = [
    pd.Index(SECONDS, name="time"),
    pd.Index(2 + SECONDS, name="Time (s)"),
    pd.Index(SECONDS.round(4), name="seconds"),
    pd.to_timedelta(SECONDS, unit="s"),
    pd.Timestamp("2020-02-02") + pd.to_timedelta(SECONDS, unit="s"),
]


@pytest.mark.parametrize("index", SECONDS_INDICES, ids=lambda index: str(index.name))
@pytest.mark.parametrize("step", [1, 2, -3])
def test_an_index_in_seconds_has_a_frame_rate(index, step):
    df = recording(index).iloc[::step]
    for attrs in ({}, {"frame_rate": 1000.0}, {"frame_rate": None}):
        df.attrs = attrs
        assert frame_rate_of_rows(df) == pytest.approx(RATE / abs(step), rel=1e-3)
    assert frame_rate_of_rows(df.drop(df.index[5])) is None


@pytest.mark.parametrize(
    "index",
    [
        pd.Index(SECONDS),
        pd.Index(SECONDS, name="phase"),
        pd.Index(1000 * SECONDS, name="time"),
        pd.Index(10 * np.arange(60), name="time"),
        pd.Index(np.arange(60.0), name="time"),
        pd.RangeIndex(-3, 57),
        pd.Index([np.nan, *SECONDS[1:]], name="time"),
        pd.Index([np.inf, *SECONDS[1:]], name="time"),
        pd.Index([None, *range(59)], dtype="Int64"),
        pd.Index(list(map(str, range(60)))),
    ],
    ids=str,
)
def test_what_the_index_does_not_tell_is_not_known(index):
    assert recorded_frames(recording(index)) is None
    assert frame_rate_of_rows(recording(index)) is None


@pytest.mark.parametrize("rate", [None, 0, -1.0, np.nan, np.inf, "120", True, [120.0]])
def test_a_frame_rate_that_is_none_is_not_known(rate):
    df = recording()
    df.attrs["frame_rate"] = rate
    assert frame_rate_of_rows(df) is None


def test_only_tables_have_a_frame_rate():
    assert frame_rate_of_rows(np.zeros((9, 2))) is None
    assert frame_rate_of_rows(pd.DataFrame({"knee": range(9)})) is None
