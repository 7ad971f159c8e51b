"""Frames to lists and back; what the contract tests of the estimators do not reach."""

import numpy as np
import pandas as pd
import pytest
from sklearn_motionsync import DenseSynchronizer, to_frame, to_sequences


@pytest.fixture
def frame():
    index = pd.MultiIndex.from_tuples(
        [("b", 0), ("b", 1), ("a", 3), ("a", 5), ("a", 9)], names=["trial", "t"]
    )
    return pd.DataFrame({"x": [1.0, 2, 3, 4, 5], "y": [5.0, 4, 3, 2, 1]}, index=index)


def test_to_sequences_keeps_order_names_and_frames(frame):
    first, second = to_sequences(frame)
    assert first["x"].tolist() == [1, 2]
    assert second.index.tolist() == [3, 5, 9]
    assert list(second.columns) == ["x", "y"]


def test_interleaved_rows_are_sorted_out(frame):
    mixed = frame.iloc[[2, 0, 3, 1, 4]]
    first, second = to_sequences(mixed)
    assert first["x"].tolist() == [3, 4, 5]
    assert second["x"].tolist() == [1, 2]


def test_round_trip(frame):
    back = to_frame(to_sequences(frame), performances=["b", "a"])
    pd.testing.assert_frame_equal(back, frame.rename_axis(["performance", "t"]))


def test_round_trip_of_arrays():
    X = [np.arange(6.0).reshape(3, 2), np.ones((2, 2))]
    df = to_frame(X)
    assert df.index.names == ["performance", "frame"]
    for a, b in zip(to_sequences(df), X, strict=True):
        np.testing.assert_array_equal(a, b)


def test_gaps_travel():
    """Frames are where gaps are filled, so the way there must not refuse them."""
    assert np.isnan(to_frame([np.array([[1.0], [np.nan]])]).iloc[1, 0])


@pytest.mark.parametrize(
    ("df", "message"),
    [
        (pd.DataFrame({"x": [1.0]}), r"an index of 1 level\(s\)"),
        (np.zeros((3, 2)), "got ndarray"),
    ],
    ids=["flat", "array"],
)
def test_to_sequences_wants_two_levels(df, message):
    with pytest.raises(ValueError, match=message):
        to_sequences(df)


@pytest.mark.parametrize("rows", [[0, 1, 3, 2, 4], [0, 1, 2, 2, 4]], ids=["back", "twice"])
def test_frames_must_increase(frame, rows):
    with pytest.raises(ValueError, match="frames of performance 'a' do not increase"):
        to_sequences(frame.iloc[rows])


@pytest.mark.parametrize("labels", [["a"], ["a", "a"], ["a", "b", "c"]])
def test_labels_must_fit(labels):
    with pytest.raises(ValueError, match="2 different labels"):
        to_frame([np.zeros((2, 1))] * 2, performances=labels)


def test_to_frame_wants_a_collection():
    with pytest.raises(ValueError, match=r"Wrap one performance as \[X\]"):
        to_frame(np.zeros((3, 2)))
    with pytest.raises(ValueError, match="0 performances"):
        to_frame([])


# -- tables that are not indexed ------------------------------------------------------------


@pytest.fixture
def table():
    """Two subjects, two trials each, rows of the trials mixed but in order of time."""
    rng = np.random.default_rng(0)
    lengths = {("ann", 2): 4, ("ann", 1): 5, ("bob", 1): 3, ("bob", 2): 4}
    parts = [
        pd.DataFrame(
            {"subject": who, "trial": k, "time": 0.1 * np.arange(n), "knee": rng.random(n)}
        )
        for (who, k), n in lengths.items()
    ]
    return pd.concat(parts).sort_values("time", kind="stable", ignore_index=True)


@pytest.mark.parametrize("levels", [[], ["subject"], ["trial", "time"]])
def test_performances_by_columns_or_levels(table, levels):
    df = table.set_index(levels) if levels else table
    found = to_sequences(df, by=["subject", "trial"], time="time")
    keys = list(table[["subject", "trial"]].drop_duplicates().itertuples(index=False, name=None))
    assert len(found) == len(keys) == 4
    for x, (who, k) in zip(found, keys, strict=True):
        rows = table[(table["subject"] == who) & (table["trial"] == k)]
        assert list(x.columns) == ["knee"]
        assert x.index.name == "time"
        np.testing.assert_array_equal(x["knee"], rows["knee"])
        np.testing.assert_array_equal(x.index, rows["time"])


def test_without_a_time_rows_are_in_order(table):
    found = to_sequences(table.drop(columns=["time", "trial"]), by="subject")
    assert [x.index.tolist() for x in found] == [list(range(9)), list(range(7))]


def test_jitter_is_no_gap(table):
    rng = np.random.default_rng(0)
    table["time"] += rng.uniform(-0.02, 0.02, len(table))
    assert len(to_sequences(table, by=["subject", "trial"], time="time")) == 4


@pytest.mark.parametrize("shape", [(1, 2), (0, 2), (5, 0)])
def test_a_performance_has_frames_and_features(shape):
    """None of either is no performance, wherever it stands."""
    for take in (to_frame, DenseSynchronizer().fit):
        with pytest.raises(ValueError, match=r"Performance 1 .* at least 2 frames and 1 feature"):
            take([np.zeros((5, 2)), np.zeros(shape)])
        with pytest.raises(ValueError, match=r"Performance 0 .* at least 2 frames and 1 feature"):
            take([np.zeros(shape)] * 3)


@pytest.mark.parametrize("rows", [[[1.0, 2.0], [3.0]], [[1.0, 2.0], []]])
def test_rows_of_several_lengths_are_no_performances(rows):
    with pytest.raises(ValueError, match="Performance 0 has 2 values in one dimension and others"):
        to_frame(rows)


@pytest.mark.parametrize("kind", ["dict_values", "map", "set", "Series"])
def test_what_gives_nothing_by_number_is_to_be_a_list(kind):
    X = {k: np.zeros((5, 2)) for k in "abc"}
    given = {"dict_values": X.values(), "map": map(X.get, X), "set": set(X), "Series": pd.Series(X)}
    for fit in (DenseSynchronizer().fit, DenseSynchronizer(max_fit=2).fit):
        with pytest.raises(ValueError, match=rf"got {kind}. Use list\(...\) of the arrays"):
            fit(given[kind])
