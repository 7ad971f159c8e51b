"""Trials that are cut out of takes."""

import numpy as np
import pandas as pd
import pytest
from sklearn_motionsync import LinearSynchronizer, to_frame, to_trials
from sklearn_motionsync.inputs.validation import check_input
from sklearn_motionsync.takes.cutting import cut_takes

ROWS = pd.DataFrame(
    {"take": [1, 0, 1], "start": [4, 0, 0], "stop": [9, 3, 4], "score": [0.3, 0.2, 0.1]}
)
TAKES = [np.arange(12.0).reshape(6, 2), np.arange(20, dtype=np.float32).reshape(10, 2)]


def cut(X):
    takes = check_input(LinearSynchronizer(), X, reset=True, level="sequence")
    return cut_takes(X, takes, ROWS)


def test_arrays_are_copied():
    parts, locations = cut(TAKES)
    for part, (_, row) in zip(parts, ROWS.iterrows(), strict=True):
        take = TAKES[int(row["take"])]
        np.testing.assert_array_equal(part, take[int(row["start"]) : int(row["stop"])])
        assert not np.shares_memory(part, take)
    pd.testing.assert_frame_equal(locations, ROWS)


def test_tables_keep_columns_and_attrs():
    tables = [pd.DataFrame(x, columns=["hip", "knee"]) for x in TAKES]
    for table in tables:
        table.attrs["fps"] = 60
    parts, _ = cut(tables)
    assert [part.attrs["trial"] for part in parts] == [(1, 1), (0, 0), (1, 0)]
    assert all(part.attrs["fps"] == 60 for part in parts)
    df = to_frame(parts)
    assert df.index.names == ["take", "part", "frame"]
    assert list(df.columns) == ["hip", "knee"]
    assert df.sort_index().loc[(1, 1)]["hip"].tolist() == [8, 10, 12, 14, 16]


@pytest.mark.parametrize("step", [1, 2])
def test_events_and_times_are_those_of_the_trial(step):
    number = np.arange(20.0 * step)
    table = pd.DataFrame({"number": number, "knee": number**2})
    table.attrs = {"frame_rate": 120.0, "first_time": 2.0, "first_frame": 7, "rows": [0, 9]}
    table.attrs["events"] = [{"label": "off", "frame": x} for x in (1.0, 5.5 * step, 30.0 * step)]
    timed = table.set_index(pd.Index(number / 50, name="time"))
    later, first, _ = cut([table.iloc[::step], table.iloc[::step]])[0]
    assert later["number"].tolist() == [step * k for k in range(4, 9)]
    assert later.attrs["events"] == [{"label": "off", "frame": 1.5}]
    assert later.attrs["frame_rate"] == 120 / step
    assert later.attrs["first_time"] == 2 + 4 * step / 120
    assert later.attrs["first_frame"] == 7 + 4 * step
    assert (first.attrs["first_frame"], first.attrs["first_time"]) == (7, 2.0)
    # An index in seconds tells a frame rate, but not where the events are.
    with pytest.warns(UserWarning, match=r"index has .* frames a second, .* is 120"):
        part = cut([timed.iloc[::step]] * 2)[0][0]
    assert part.attrs["frame_rate"] == pytest.approx(50 / step)
    assert "events" not in part.attrs


def test_trials_are_labelled_by_their_take():
    long = pd.concat({("ann", 1): pd.DataFrame(TAKES[0]), ("bob", 1): pd.DataFrame(TAKES[1])})
    long.index.names = ["subject", "trial", "frame"]
    parts, locations = cut(to_trials(long))
    assert parts[0].attrs["trial"] == ("bob", 1, 1)
    assert to_frame(parts).index.names == ["subject", "trial", "part", "frame"]
    assert locations["take"].tolist() == [("bob", 1), ("ann", 1), ("bob", 1)]
