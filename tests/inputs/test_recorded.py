"""Which frames of a recording the rows of a table are, and their frame rate."""

import contextlib
import re
import warnings

import numpy as np
import pandas as pd
import pytest
from sklearn.base import clone
from sklearn_motionsync import MotionTracker, OnlineSynchronizer, find_performances, to_frame
from sklearn_motionsync.inputs.recorded import frame_rate_of_rows, recorded_frames

from estimators import EVERY, by_name, data_for, outputs

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


# -- rows that are not even steps of time are told of, by estimators of all kinds ---------------


def in_seconds(df, rate, start=0.0):
    return df.set_axis(pd.Index(start + np.arange(len(df)) / rate, name="time"))


UNEVEN = [
    (lambda df: df.iloc[::-1], "not in order of time.*'frame'.* follows.*sort_index"),
    (lambda df: df.sample(frac=1, random_state=0), "not in order of time"),
    (lambda df: pd.concat([df.iloc[20:], df.iloc[:20]]), "0 follows"),
    (lambda df: in_seconds(df, 30).iloc[::-1], "not in order of time.*'time'"),
    (lambda df: df.drop(df.index[5:7]), "not even: from 4 to 7 it is 3, mostly 1"),
    (lambda df: in_seconds(df, 30).drop(5 / 30), "level 'time' .* not even"),
    (lambda df: in_seconds(df, 60), "index has 60 frames a second, and .* is 30"),
    (lambda df: in_seconds(df, 20), "index has 20 frames a second, and .* is 30"),
]
EVEN = [
    lambda df: df,
    lambda df: df.iloc[::2],
    lambda df: df.iloc[5:],
    lambda df: in_seconds(df, 30),
    lambda df: in_seconds(df, 30, 1e5).iloc[::3],
    lambda df: in_seconds(df, 29.97).round(3),
    lambda df: df.reset_index(drop=True),
    lambda df: df.set_axis([f"row {i}" for i in range(len(df))]),
    lambda df: df.set_axis(np.zeros(len(df), dtype=int)),
]


def recordings(estimator):
    takes = [pd.DataFrame(x) for x in data_for(estimator)]
    for df in takes:
        df.index.name, df.attrs["frame_rate"] = "frame", 30
    return takes


@pytest.mark.parametrize(("change", "message"), UNEVEN)
@pytest.mark.parametrize("estimator", EVERY, ids=by_name)
def test_rows_that_are_not_even_steps_of_time_are_warned_of(estimator, change, message):
    X = recordings(estimator)
    fitted = clone(estimator).fit(X)
    X[-1] = change(X[-1])
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        # A take out of order is not cyclic.
        with contextlib.suppress(ValueError):
            outputs(fitted, X)
    words = re.compile(f"Performance {len(X) - 1}: .*{message}")
    assert any(words.match(str(warning.message)) for warning in caught)
    assert max(len(str(warning.message)) for warning in caught) < 600


@pytest.mark.parametrize("change", EVEN)
def test_rows_that_are_even_steps_of_time_pass(change):
    df = change(pd.DataFrame({"knee": np.arange(60.0)}).rename_axis(index="frame"))
    df.attrs["frame_rate"] = 30
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        to_frame([df])


def test_a_take_backwards_is_warned_of_where_it_is_searched():
    t = np.arange(200) / 30
    take = pd.DataFrame({"knee": np.sin(t), "hip": np.cos(1.7 * t)})
    with pytest.warns(UserWarning, match="Performance 0: its rows are not in order of time"):
        find_performances(take.iloc[50:90], take.iloc[::-1])


def test_rows_of_tracks_are_even_steps_unless_their_times_are_given():
    t = np.arange(60) / 30
    X = [pd.DataFrame({"knee": np.sin(t + k), "hip": np.cos(2 * t + k)}) for k in (0, 0.1, 0.2)]
    for df in X:
        df.index, df.attrs = pd.Index(t, name="time"), {"frame_rate": 30}
    some = [df.drop(df.index[20:25]) for df in X]
    for live in (OnlineSynchronizer(frame_rate=30), MotionTracker(frame_rate=30, n_particles=10)):
        tracks = [live.fit(X).track]
        tracks += [live.smooth] if hasattr(live, "smooth") else []
        for track in tracks:
            track(some, times=[df.index for df in some])
            with pytest.warns(UserWarning, match="Performance 0: .* not even"):
                track(some)
            with pytest.warns(UserWarning, match="Performance 0: .* order of time"):
                track([df.iloc[::-1] for df in X])


def test_the_order_of_rows_may_be_meant():
    df = pd.DataFrame({"knee": np.arange(60.0)}).iloc[::-1].reset_index(drop=True)
    assert to_frame([df])["knee"].iloc[0] == 59
