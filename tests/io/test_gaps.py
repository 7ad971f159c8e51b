"""find_gaps and fill_gaps."""

import re

import numpy as np
import pandas as pd
import pytest
from sklearn_motionsync.io import fill_gaps, find_gaps
from sklearn_motionsync.io.gaps import warn_of_gaps


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


def test_find_gaps_lists_joint_frames_and_place():
    expected = [["a", 10, 14, 5, True], ["a", 30, 30, 1, True]]
    expected += [["c", 0, 3, 4, False], ["c", 50, 59, 10, False]]
    gaps = find_gaps(with_gaps())
    assert gaps.to_numpy().tolist() == expected
    assert list(gaps.columns) == ["joint", "first", "last", "n_frames", "inside"]
    assert find_gaps(with_gaps().dropna()).empty
    for table in (gaps, find_gaps(with_gaps().dropna())):
        assert [dtype.kind for dtype in table.dtypes] == ["O", "i", "i", "i", "b"]


def test_fill_gaps_fills_inner_gaps_up_to_max_gap():
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
    pd.testing.assert_frame_equal(fill_gaps(df[:0], 4), df[:0])


def test_two_known_frames_are_joined_by_a_line_and_none_stay_missing():
    df = pd.DataFrame({f"a_{axis}": [np.nan, 4.0, np.nan, np.nan, 7.0] for axis in "xyz"})
    np.testing.assert_allclose(fill_gaps(df, 2)["a_z"], [np.nan, 4, 5, 6, 7])
    # No line leads beyond them.
    ends = pd.DataFrame({f"a_{axis}": [np.nan, 4.0, np.nan, 7.0, np.nan] for axis in "xyz"})
    np.testing.assert_allclose(fill_gaps(ends, 9)["a_x"], [np.nan, 4, 5.5, 7, np.nan])
    df[:] = np.nan
    assert fill_gaps(df, 9).isna().all(axis=None)
    assert find_gaps(df).to_numpy().tolist() == [["a", 0, 4, 5, False]]
    # In the plane, too.
    plane = ends[["a_x", "a_y"]]
    pd.testing.assert_frame_equal(fill_gaps(plane, 9), fill_gaps(ends, 9)[["a_x", "a_y"]])


def test_other_columns_are_refused():
    for columns in (["a_x"], ["a_y", "b_x"], ["a_x", "b_y"], ["a_x", "a_y", "b_z"], []):
        with pytest.raises(ValueError, match="columns must be <joint>_x, <joint>_y, <joint>_z"):
            find_gaps(pd.DataFrame(0.0, index=range(2), columns=columns))


def test_missing_values_of_other_dtypes_are_gaps():
    df = with_gaps()
    for other in (df.convert_dtypes(), df.astype(object).where(df.notna(), None)):
        pd.testing.assert_frame_equal(find_gaps(other), find_gaps(df))
        pd.testing.assert_frame_equal(fill_gaps(other, 9), fill_gaps(df, 9))
    single = df.astype("f4")
    pd.testing.assert_frame_equal(fill_gaps(single, 9), fill_gaps(single.astype("f8"), 9))


def one_changed(value):
    df = with_gaps().astype(object)
    df.iloc[7, 4] = value
    return df


@pytest.mark.parametrize(
    ("df", "message"),
    [
        (np.zeros((5, 3)), "must be a DataFrame, as read_motion returns it, got ndarray; "),
        (one_changed(np.inf).astype(float), r"frame 7, feature 4 \('b_y'\) is infinity"),
        (one_changed("far"), "column 'b_y', is not a numeric array: got str, 'far'"),
        (with_gaps().astype(complex), "complex data are not supported"),
        (with_gaps().astype("M8[ns]"), "column 'a_x', holds dates"),
        (pd.concat({"p": with_gaps(), "q": with_gaps()}), "of one trial, got a table of 2"),
    ],
)
def test_other_input_is_refused(df, message):
    with pytest.raises(ValueError, match=message):
        find_gaps(df)
    with pytest.raises(ValueError, match=message):
        fill_gaps(df, 3)


def test_the_warning_says_how_much_is_missing_of_what():
    for kind, n_missing, words in (
        ("markers", 996, r"99\.6 % of the positions"),
        ("joints", 1000, "100 % of the positions"),
        ("angles", 250, r"25 % of the values are .*, of 1 of 1 angles \(a\): 1 gap, the"),
        ("moments", 1, r"0\.1 % of the values .*: 1 gap, the longest of 1 frame; 1 touch"),
    ):
        df = pd.DataFrame({f"a_{axis}": np.zeros(1000) for axis in "xyz"})
        df.iloc[:n_missing] = np.nan
        df.attrs["kind"] = kind
        with pytest.warns(UserWarning, match=words):
            warn_of_gaps(df, "a.c3d")


def test_the_warning_names_four_joints_of_the_most_gaps_in_their_order():
    names = [f"{k:02d}{'n' * (38 + k % 3)}" for k in range(40)]
    df = pd.DataFrame({f"{name}_{axis}": np.zeros(10) for name in names for axis in "xyz"})
    df.iloc[3] = np.nan
    df.iloc[5:7, -3:] = np.nan
    shown = ", ".join(re.escape(name[:40]) for name in [names[-1], *names[:3]])
    message = rf"of 40 of 40 joints \({shown}, \.\.\.\): 41 gaps, the longest of 2 frames\. Inter"
    with pytest.warns(UserWarning, match=message):
        warn_of_gaps(df, "a.c3d")


# -- ends -----------------------------------------------------------------------------------


def test_a_recording_is_trimmed_to_the_frames_that_show_all_joints():
    df, before = with_gaps(), with_gaps()
    trimmed = fill_gaps(df, 4, ends="trim")
    pd.testing.assert_frame_equal(df, before)
    pd.testing.assert_frame_equal(trimmed, fill_gaps(df, 4).iloc[4:50], check_flags=False)
    # The index tells which frames they are.
    assert trimmed.attrs == {"kind": "markers"}
    assert find_gaps(fill_gaps(df, 5, ends="trim")).empty
    whole = df.dropna()
    pd.testing.assert_frame_equal(fill_gaps(whole, 0, ends="trim"), whole)
    # A gap that is not filled and reaches into what is left out: the end is behind it.
    df.iloc[2:9, 0] = np.nan
    assert fill_gaps(df, 4, ends="trim").index.tolist() == list(range(109, 150))
    df["d_x"] = df["d_y"] = df["d_z"] = np.nan  # never seen
    assert fill_gaps(df, 4, ends="trim").index.tolist() == list(range(109, 150))


def test_what_cannot_be_trimmed_is_refused_by_name():
    df = with_gaps()
    df.attrs["trial"] = "walk7"
    with pytest.raises(ValueError, match="ends must be 'keep' or 'trim', got 'cut'"):
        fill_gaps(df, 3, ends="cut")
    df[["b_x"]] = np.where(np.arange(60) == 20, 0, np.nan)[:, None]
    message = r"^The recording 'walk7' cannot be trimmed: 1 of 60 frames show all joints\."
    with pytest.raises(ValueError, match=message):
        fill_gaps(df, 9, ends="trim")
    df[:] = np.nan
    with pytest.raises(ValueError, match="cannot be trimmed: 0 of 60"):
        fill_gaps(df, 9, ends="trim")
