"""Parts of takes, and where they come from."""

import numpy as np
import pandas as pd
from sklearn_motionsync import LinearSynchronizer, to_frame, to_sequences
from sklearn_motionsync.inputs.validation import check_performances
from sklearn_motionsync.segmentation.cutting import cut_takes

ROWS = pd.DataFrame(
    {"take": [1, 0, 1], "start": [4, 0, 0], "stop": [9, 3, 4], "score": [0.3, 0.2, 0.1]}
)
TAKES = [np.arange(12.0).reshape(6, 2), np.arange(20, dtype=np.float32).reshape(10, 2)]


def cut(X):
    taken = check_performances(LinearSynchronizer(), X, reset=True, level="sequence")
    return cut_takes(X, taken, ROWS)


def test_arrays_give_arrays():
    parts, origin = cut(TAKES)
    for part, (_, row) in zip(parts, ROWS.iterrows(), strict=True):
        take = TAKES[int(row["take"])]
        np.testing.assert_array_equal(part, take[int(row["start"]) : int(row["stop"])])
        assert not np.shares_memory(part, take)
    pd.testing.assert_frame_equal(origin, ROWS)


def test_tables_keep_columns_attrs_and_names():
    tables = [pd.DataFrame(x, columns=["hip", "knee"]) for x in TAKES]
    for table in tables:
        table.attrs["fps"] = 60
    parts, _ = cut(tables)
    assert [part.attrs["performance"] for part in parts] == [(1, 1), (0, 0), (1, 0)]
    assert all(part.attrs["fps"] == 60 for part in parts)
    df = to_frame(parts)
    assert df.index.names == ["take", "part", "frame"]
    assert list(df.columns) == ["hip", "knee"]
    assert df.sort_index().loc[(1, 1)]["hip"].tolist() == [8, 10, 12, 14, 16]


def test_parts_are_called_after_their_take():
    long = pd.concat({("ann", 1): pd.DataFrame(TAKES[0]), ("bob", 1): pd.DataFrame(TAKES[1])})
    long.index.names = ["who", "trial", "frame"]
    parts, origin = cut(to_sequences(long))
    assert parts[0].attrs["performance"] == ("bob", 1, 1)
    assert to_frame(parts).index.names == ["who", "trial", "part", "frame"]
    assert origin["take"].tolist() == [("bob", 1), ("ann", 1), ("bob", 1)]


def test_nothing_is_cut_out_of_nothing():
    taken = check_performances(LinearSynchronizer(), TAKES, reset=True, level="sequence")
    parts, origin = cut_takes(TAKES, taken, ROWS[:0])
    assert parts == []
    assert list(origin.columns) == list(ROWS.columns)
