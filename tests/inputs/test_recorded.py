"""Which frames of a recording the rows of a table are, and their frame rate."""

import contextlib
import re
import warnings

import numpy as np
import pandas as pd
import pytest
from sklearn.base import clone
from sklearn_motionsync import LinearSynchronizer, to_frame
from sklearn_motionsync.inputs.recorded import (
    Recorded,
    frame_rate_of_rows,
    recorded_frames,
    refuse_moved_events,
    refuse_seconds,
    timeless,
)

from estimators import all_of, by_name, data_for

RATE = 120.0
SECONDS = np.arange(60) / RATE


def recording(index=None):
    df = pd.DataFrame({"knee": np.arange(60.0)}, index=index)
    df.attrs = {"frame_rate": RATE}
    return df


ROWS = [
    ("all", slice(None), RATE),
    ("behind", slice(10, None), RATE),
    ("thinned out", slice(3, None, 4), RATE / 4),
    ("reversed", slice(None, None, -1), RATE),
    ("thinned out backwards", slice(None, None, -3), RATE / 3),
    ("one", slice(7, 8), RATE),
    ("two", [3, 8], RATE / 5),
    ("the same two", [3, 3], None),
    ("with a hole", [0, 1, 2, 5, 6], None),
    ("shuffled", [4, 0, 2, 1, 3], None),
]


@pytest.mark.parametrize(("rows", "rate"), [row[1:] for row in ROWS], ids=[row[0] for row in ROWS])
@pytest.mark.parametrize("name", [None, "frame", "row"])
def test_rows_that_pandas_selects_are_frames_of_the_recording(rows, rate, name):
    frames = pd.RangeIndex(60, name=name)
    for index in (frames, pd.MultiIndex.from_product([["ann"], frames])):
        part = recording(index).iloc[rows]
        assert frame_rate_of_rows(part) == rate
        assert recorded_frames(part).tolist() == part["knee"].tolist()
    # Whole numbers one by one are frames under any name.
    numbers = pd.Index(frames.to_numpy() + 3, name=name or "time")
    assert recorded_frames(recording(numbers)).tolist() == list(range(3, 63))


@pytest.mark.parametrize(
    "index",
    [
        pd.Index(2 + SECONDS, name="Time (s)"),
        pd.Index(SECONDS.round(4), name="seconds"),
        pd.to_timedelta(SECONDS, unit="s"),
        pd.Timestamp("2020-02-02") + pd.to_timedelta(SECONDS, unit="s"),
    ],
    ids=lambda index: str(index.dtype),
)
@pytest.mark.parametrize("step", [1, 2, -3])
def test_an_index_in_seconds_has_a_frame_rate(index, step):
    df = recording(index).iloc[::step]
    for attrs in ({}, {"frame_rate": 1000.0}, {"frame_rate": None}):
        df.attrs = attrs
        assert frame_rate_of_rows(df) == pytest.approx(RATE / abs(step), rel=1e-3)
    assert frame_rate_of_rows(df.drop(df.index[5])) is None
    assert frame_rate_of_rows(df.iloc[:2]) == pytest.approx(RATE / abs(step), rel=0.02)
    assert frame_rate_of_rows(df.iloc[:1]) is None


@pytest.mark.parametrize(
    ("first", "step", "rate"),
    # Steps of a second are of another unit, and 0 to 1 are shares of a movement.
    [(0, 0.999, 1 / 0.999), (0, 1.0, None), (0, 1 / 8, None), (1, 1 / 8, 8), (0, 0.0, None)],
)
def test_numbers_that_may_be_seconds_are_in_steps_below_one(first, step, rate):
    seconds = first + np.arange(9) * step
    for times in (seconds, seconds[::-1]):
        found = frame_rate_of_rows(pd.DataFrame({"knee": times}, index=pd.Index(times, name="t")))
        assert found == (rate if rate is None else pytest.approx(rate, rel=1e-8))


@pytest.mark.parametrize(
    "index",
    [
        pd.Index(SECONDS),
        pd.Index(SECONDS, name="phase"),
        pd.Index(1000 * SECONDS, name="time"),
        pd.Index(2 * np.arange(60), name="time"),
        pd.Index(np.arange(60.0), name="time"),
        pd.RangeIndex(-3, 57),
        pd.Index([np.nan, *SECONDS[1:]], name="time"),
        pd.Index([None, *range(59)], dtype="Int64"),
        pd.Index(list(map(str, range(60)))),
    ],
    ids=str,
)
def test_what_the_index_does_not_tell_is_not_known(index):
    assert recorded_frames(recording(index)) is None
    assert frame_rate_of_rows(recording(index)) is None
    # Nor is a rate that is no number above 0, or that of an array.
    df = recording()
    for rate in (None, 0, np.inf, "120", True):
        df.attrs["frame_rate"] = rate
        assert frame_rate_of_rows(df) is None
    assert frame_rate_of_rows(np.zeros((9, 2))) is None


# -- rows that are not even steps of time are told of, by estimators of all kinds ---------------


def in_seconds(df, rate, start=0.0):
    return df.set_axis(pd.Index(start + np.arange(len(df)) / rate, name="time"))


def in_dates(df):
    return df.set_axis(pd.date_range("2024-05-01", periods=len(df), freq="10ms", name="time"))


UNEVEN = [
    (lambda df: df.iloc[::-1], "not in order of time.*'frame'.* follows.*sort_index"),
    (lambda df: pd.concat([df.iloc[20:], df.iloc[:20]]), "0 follows"),
    (lambda df: in_seconds(df, 30).iloc[::-1], "not in order of time.*'time'"),
    (lambda df: df.drop(df.index[5:7]), "not even: from 4 to 7 it is 3, mostly 1"),
    (lambda df: in_seconds(df, 30).drop(5 / 30), "level 'time' .* not even"),
    (lambda df: in_dates(df).drop(in_dates(df).index[5]), "level 'time' .* not even"),
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


def warns(estimator, X, message):
    """A fit warns of this, among others, in few words."""
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        # A few rows may not be cyclic.
        with contextlib.suppress(ValueError):
            clone(estimator).fit(X)
    said = [str(warning.message) for warning in caught]
    assert any(re.match(message, text) for text in said), said
    assert max(map(len, said)) < 600


@pytest.mark.parametrize(("change", "message"), UNEVEN)
def test_rows_that_are_not_even_steps_of_time_are_warned_of(change, message):
    X = recordings(LinearSynchronizer())
    X[-1] = change(X[-1])
    warns(LinearSynchronizer(), X, f"Trial {len(X) - 1}: .*{message}")


@pytest.mark.parametrize("change", EVEN)
def test_rows_that_are_even_steps_of_time_pass(change):
    """Warnings are errors here."""
    df = change(pd.DataFrame({"knee": np.arange(60.0)}).rename_axis(index="frame"))
    df.attrs["frame_rate"] = 30
    to_frame([df])


SPLIT = r"Trial \d.*: rows look split, as by cross-validation of rows.*to_trials\(table\)"


@pytest.mark.parametrize(
    ("estimator", "rate"),
    [
        *((each, None) for each in all_of("ASpace", "DenseSynchronizer", "CycleSegmenter")),
        (LinearSynchronizer(), 30),
    ],
    ids=by_name,
)
def test_rows_split_by_cross_validation_are_warned_of(estimator, rate):
    rng, split = np.random.default_rng(0), []
    for df in recordings(estimator):
        split.append(df.sample(frac=2 / 3, random_state=rng).sort_index())
    for df in split:
        df.attrs = {"frame_rate": rate} if rate else {}
    warns(estimator, split, SPLIT)


@pytest.mark.parametrize(
    "frames",
    [
        [*range(20), *range(23, 40), *range(47, 60)],
        range(0, 60, 7),
        # Milliseconds of a camera.
        np.round(np.arange(60) / 0.03).astype(int),
        np.cumsum([0, *np.random.default_rng(0).integers(28, 39, 59)]),
    ],
    ids=["two gaps", "thinned out", "milliseconds", "of uneven steps"],
)
def test_whole_numbers_of_unknown_rate_with_few_gaps_pass(frames):
    to_frame([pd.DataFrame({"knee": np.sin(np.arange(len(frames)))}, index=pd.Index(frames))])


# -- the attrs of some rows ---------------------------------------------------------------------

EVENTS = [
    {"label": "Strike", "frame": frame} for frame in (-1.0, 0.0, 12.5, None, 30.0, 59.0, 61.0)
]


def described(index=None, **facts):
    df = recording(index)
    df.attrs = {"units": "mm", "frame_rate": RATE, "first_time": 2.0} | facts
    return df


@pytest.mark.parametrize("stated", [RATE, None])
@pytest.mark.parametrize(
    ("index", "rate"),
    # Text tells nothing; seconds tell the rate of rows that follow each other.
    [(list(map(str, range(60))), None), (pd.Index(SECONDS, name="time"), RATE)],
)
def test_where_the_index_does_not_tell_frames_only_the_rate_is_kept(index, rate, stated):
    part = Recorded(described(index, events=EVENTS, first_frame=1, frame_rate=stated))
    nothing = {"units": "mm", "frame_rate": None}
    assert part.attrs_of(np.arange(4, 9)) == nothing | {"frame_rate": rate}
    for rows in ([4, 6, 8], [4, 5, 7], [5, 4]):
        assert part.attrs_of(np.array(rows)) == nothing
    times = np.arange(5) / 60
    assert part.attrs_of(np.arange(4, 9), times, times) == nothing


def test_a_table_without_a_rate_gets_none():
    seconds = pd.Index(SECONDS, name="time")
    for index, rate in (
        (list(map(str, range(60))), {}),
        (seconds, {"frame_rate": RATE}),
        (None, {}),
    ):
        df = recording(index)
        df.attrs = {"units": "mm"}
        assert Recorded(df).attrs_of(np.arange(4, 9)) == {"units": "mm"} | rate
        assert Recorded(df).attrs_of(np.array([4, 6])) == {"units": "mm"}


@pytest.mark.parametrize(
    ("first", "stop", "step"), [(0, 60, 1), (0, 59, 1), (0, 60, 2), (10, 50, 1), (7, 46, 3)]
)
def test_rows_have_the_events_and_the_clock_of_their_frames(first, stop, step):
    """Straight from the frames: an event is at its frame less the first, in steps."""
    rows = np.arange(first, stop, step)
    df = described(events=EVENTS, first_frame=5, rows=[100, 159])
    for table, places in ((df, rows), (df.iloc[rows], np.arange(len(rows)))):
        facts = Recorded(table).attrs_of(places)
        assert facts["units"] == "mm"
        assert facts["first_time"] == pytest.approx(2 + first / RATE)
        assert facts["first_frame"] == 5 + first
        # A whole table may hold several trials, rows mixed, and the rate is that of each.
        assert facts["frame_rate"] == (RATE if len(table) == 60 else RATE / step)
        moved = [x if x is None else (x - first) / step for x in (e["frame"] for e in EVENTS)]
        if len(places) < len(table):
            moved = [x for x in moved if x is None or 0 <= x <= len(rows) - 1]
        assert [e["frame"] for e in facts["events"]] == [
            x if x is None else pytest.approx(x, abs=1e-5) for x in moved
        ]
        # Those of a trimmed recording stay while all rows are there.
        assert facts.get("rows") == (
            [100, 159] if first == 0 and len(places) == len(table) else None
        )


def test_rows_out_of_order_have_no_events_and_rows_of_no_rate_no_first_time():
    rows = np.array([5, 4, 3])
    facts = Recorded(described(events=EVENTS)).attrs_of(rows)
    assert "events" not in facts
    assert facts["first_time"] == pytest.approx(2 + 5 / RATE)
    unknown = Recorded(described(events="none", frame_rate=None))
    assert "first_time" not in unknown.attrs_of(np.arange(5, 9))
    assert unknown.attrs_of(np.arange(9)) == {"units": "mm", "frame_rate": None, "first_time": 2}


def test_even_times_become_a_rate_and_others_stay():
    uneven = 2 + np.cumsum(np.arange(60) % 3 + 1.0) / 100
    even = 2 + SECONDS
    for seconds, rate in ((uneven, None), (even, RATE)):
        df = described(times=seconds.tolist(), frame_rate=None)
        facts = Recorded(df).attrs_of(np.arange(10, 31))
        assert facts["first_time"] == seconds[10]
        assert facts["frame_rate"] == (rate if rate is None else pytest.approx(rate))
        assert facts.get("times") == (seconds[10:31].tolist() if rate is None else None)
        (one,) = Recorded(df).attrs_of(np.array([7]))["times"]
        assert one == seconds[7]
    # Fewer times than frames are of another table.
    df = described(times=even[:20].tolist())
    assert Recorded(df).attrs_of(np.arange(20))["first_time"] == 2
    facts = Recorded(df).attrs_of(np.arange(21))
    assert (facts["frame_rate"], facts["first_time"]) == (RATE, 2)


def test_attrs_that_are_true_of_any_rows():
    df = described(events=EVENTS, times=SECONDS.tolist(), first_frame=1, rows=[0, 59], clock=(0, 1))
    assert timeless(df.iloc[::2]) == {"units": "mm", "frame_rate": RATE / 2}
    df.attrs = {"units": "mm", "rows": [0, 59]}
    assert timeless(df) == {"units": "mm"}


# -- key-frames that cannot be meant ------------------------------------------------------------


def test_key_frames_are_seconds_if_all_are_in_the_first_fiftieth():
    """Or below 1, in ten frames or more."""
    for frames, n in (
        ([0.5], 9),
        ([0.1, 1.0], 20),
        ([0.5, 4.0], 201),
        ([0.0, 1.0], 1000),
        ([], 99),
    ):
        refuse_seconds(np.array(frames), n, "Trial 3")
    for frames, n in (([0.5], 10), ([0.1, 0.999], 20), ([0.5, 3.99], 201)):
        with pytest.raises(ValueError, match=rf"^Trial 3: its key-frames .* has {n} frame"):
            refuse_seconds(np.array(frames), n, "Trial 3")


def test_events_of_other_rows_are_refused_by_row_and_frame():
    good = described(events=EVENTS)
    unknown = described(list(map(str, range(60))), events=EVENTS)
    for X in ([good, unknown], (good,), [good.iloc[:20]], None, np.zeros((2, 9, 1)), [[0.0]], good):
        refuse_moved_events(X)
    silent = good.iloc[5:].copy()
    silent.attrs = {}
    refuse_moved_events([silent])
    for rows, row, frame in (
        (slice(5, None), 0, 5),
        ([0, 1, 2, 9], 3, 9),
        (slice(None, None, 2), 1, 2),
    ):
        with pytest.raises(ValueError, match=f"^Trial 2: by its index row {row} is frame {frame} "):
            refuse_moved_events([good, np.zeros((9, 1)), good.iloc[rows]])
