"""Gaps of markers: found, filled, told."""

import numpy as np
import pandas as pd
import pytest
from sklearn_motionsync.datasets import fill_gaps, find_gaps


def with_gaps():
    t = np.arange(60.0)
    df = pd.DataFrame({f"{j}_{a}": np.sin(t / 9 + i) for i, j in enumerate("abc") for a in "xyz"})
    df.attrs = {"kind": "markers"}
    df.loc[10:14, ["a_x", "a_y", "a_z"]] = np.nan
    df.loc[30:30, "a_y"] = np.nan
    df.loc[0:3, "c_z"] = np.nan
    df.loc[50:59, "c_x"] = np.nan
    df.index = pd.Index(np.arange(60) + 100, name="frame")
    return df


def test_find_gaps():
    expected = [["a", 10, 14, 5, True], ["a", 30, 30, 1, True]]
    expected += [["c", 0, 3, 4, False], ["c", 50, 59, 10, False]]
    gaps = find_gaps(with_gaps())
    assert gaps.to_numpy().tolist() == expected
    assert list(gaps.columns) == ["joint", "first", "last", "n_frames", "inside"]
    assert find_gaps(with_gaps().dropna()).empty


def test_fill_gaps():
    df, before = with_gaps(), with_gaps()
    filled = fill_gaps(df, np.int64(4))
    pd.testing.assert_frame_equal(df, before)
    assert filled.attrs == df.attrs
    assert find_gaps(filled)["first"].tolist() == [10, 0, 50]
    known = df.notna().to_numpy()
    np.testing.assert_array_equal(filled.to_numpy()[known], df.to_numpy()[known])
    all_filled = fill_gaps(df, 100)
    assert find_gaps(all_filled)["inside"].tolist() == [False, False]
    error = all_filled["a_x"].to_numpy() - np.sin(np.arange(60) / 9)
    assert np.abs(error).max() < 6e-3
    pd.testing.assert_frame_equal(fill_gaps(df, 0), df)


def test_gaps_between_two_frames_and_of_nothing():
    df = pd.DataFrame({f"a_{axis}": [0.0, np.nan, np.nan, 3.0] for axis in "xyz"})
    np.testing.assert_allclose(fill_gaps(df, 2)["a_z"], [0, 1, 2, 3])
    df[:] = np.nan
    assert fill_gaps(df, 9).isna().all(axis=None)
    assert find_gaps(df).to_numpy().tolist() == [["a", 0, 3, 4, False]]


def test_columns_that_are_no_joints():
    for columns in (["a_x", "a_y"], ["a_x", "a_z", "a_y"], ["time", "a_x", "a_y"], []):
        with pytest.raises(ValueError, match="columns must be <joint>_x, <joint>_y, <joint>_z"):
            find_gaps(pd.DataFrame(0.0, index=range(2), columns=columns))
