"""Trials as other packages keep them: nested tables and labelled arrays.

The objects are made by hand, as sktime, aeon, xarray and polars make them.
"""

import numpy as np
import pandas as pd
import polars as pl
import pytest
import xarray as xr
from sklearn_motionsync import DenseSynchronizer, LinearSynchronizer, Match, to_frame, to_trials

NAMES = ["hip", "knee", "ankle"]


def sync():
    return DenseSynchronizer(n_frames=30)


@pytest.fixture(scope="module")
def trials():
    """Arrays of 24 to 35 frames."""
    rng = np.random.default_rng(0)
    return [np.cumsum(rng.normal(size=(n, 3)), axis=0) for n in range(24, 36)]


def nested(trials, index=None, cell=pd.Series):
    return pd.DataFrame({n: [cell(x[:, k]) for x in trials] for k, n in enumerate(NAMES)}, index)


def same_bits(found, expected):
    assert len(found) == len(expected)
    for a, b in zip(found, expected, strict=True):
        a = np.asarray(a)
        assert a.dtype == b.dtype
        assert a.tobytes() == np.ascontiguousarray(b).tobytes()


# -- nested tables --------------------------------------------------------------------------


@pytest.mark.parametrize("cell", [pd.Series, np.asarray, list], ids=["Series", "array", "list"])
def test_a_nested_table_is_a_trial_a_row(trials, cell):
    people = pd.Index([f"person {i}" for i in range(12)], name="person")
    table = nested(trials, people, cell)
    found = to_trials(table)
    same_bits(found, trials)
    assert [list(x.columns) for x in found] == [NAMES] * 12
    assert [x.attrs["trial"] for x in found] == list(people)
    whole = to_frame(table)
    assert list(whole.index.names) == ["person", "frame"]
    same_bits([whole.to_numpy()], [np.concatenate(trials)])
    aligned = sync().set_output(transform="pandas").fit(table).transform(table)
    assert aligned.index.names == ["person", "frame"]


def test_cells_keep_times_types_and_labels_of_several_levels(trials):
    clock = pd.date_range("2026-01-01", periods=24, freq="10ms", name="clock")
    single = [x[:24].astype(np.float32) for x in trials[:2]]
    index = pd.MultiIndex.from_tuples([("ann", 1), ("ann", 2)], names=["person", "trial"])
    found = to_trials(nested(single, index, lambda x: pd.Series(x, clock)))
    same_bits(found, single)
    assert [x.attrs["trial"] for x in found] == [("ann", 1), ("ann", 2)]
    assert to_frame(found).index.names == ["person", "trial", "clock"]
    assert all(x.index.equals(clock) for x in found)
    assert to_frame(found).attrs == {}
    match = sync().fit(found).match(found)
    assert match.to_frame("seconds", found)["time"].max() == pytest.approx(0.23)


def test_a_sample_of_a_nested_table(trials):
    sample = DenseSynchronizer(n_frames=20, max_fit=5, random_state=0)
    same_bits([sample.fit(nested(trials)).pattern_], [sample.fit(trials).pattern_])


def test_lists_in_a_table_of_polars(trials):
    cells = {name: [x[:, k].tolist() for x in trials] for k, name in enumerate(NAMES)}
    table = pl.DataFrame(cells)
    same_bits(to_trials(table), trials)


# -- arrays with channels before frames, as aeon and sktime have them -----------------------------


def test_exchanged_axes_are_named(trials):
    """Those of one feature, and after a fit."""
    X = np.stack([x[:24] for x in trials])
    with pytest.raises(ValueError, match=r"shape \(1, 24\).*\[x.T for x in X\]"):
        sync().fit(list(X[:, :, :1].swapaxes(1, 2)))
    with pytest.raises(ValueError, match=r"expecting 3 features .*np.swapaxes\(X, 1, 2\)"):
        sync().fit(X).transform(X.swapaxes(1, 2))


# -- labelled arrays of xarray ----------------------------------------------------------------


def labelled(trials, **more):
    """A DataArray of 24 frames of each, at 50 Hz."""
    return xr.DataArray(
        np.stack([x[:24] for x in trials]),
        dims=("trial", "time", "angle"),
        coords={
            "trial": [f"walk {i}" for i in range(len(trials))],
            "time": np.arange(24) / 50,
            "angle": NAMES,
            **more,
        },
        attrs={"units": "deg"},
    )


@pytest.mark.parametrize("order", [("trial", "time", "angle"), ("trial", "angle", "time")])
def test_a_labelled_array_keeps_names_times_and_units(trials, order):
    array = labelled(trials)
    given = array.transpose(*order)
    expected = [x[:24] for x in trials]
    for found in (to_trials(given), to_trials(to_frame(list(given)))):
        same_bits(found, expected)
        assert [x.attrs["trial"] for x in found] == array["trial"].values.tolist()
        assert list(found[0].columns) == NAMES
        assert found[0].index.tolist() == array["time"].values.tolist()
        assert found[0].attrs["units"] == "deg"
    # pandas sorts the labels.
    back = to_frame(given).to_xarray().to_dataarray("angle").sel(trial=array["trial"])
    xr.testing.assert_equal(back.transpose("trial", "time", "angle"), array)
    aligned = sync().set_output(transform="pandas").fit(given).transform(given)
    assert aligned.index.names == ["trial", "frame"]
    assert list(aligned.columns) == NAMES


def test_the_time_of_a_labelled_array_is_that_of_warps(trials):
    array = labelled(trials)
    match = Match.from_estimator(LinearSynchronizer().fit(array), array)
    assert match.to_frame("seconds", array)["time"].max() == pytest.approx(23 / 50)
    slower = to_trials(array, frame_rate=25)
    assert {len(x) for x in slower} == {12}
    np.testing.assert_allclose([x.index for x in slower], [np.arange(12) / 25] * 12)


def test_one_trial_of_a_labelled_array(trials):
    array = labelled(trials)
    (one,) = to_trials(array.sel(trial="walk 3").transpose("angle", "time"))
    same_bits([one], [trials[3][:24]])
    assert one.attrs["trial"] == "walk 3"
    several = [array.isel(trial=[i]).squeeze() for i in range(12)]
    same_bits([sync().fit(several).transform(several)], [sync().fit(array).transform(array)])


def test_coordinates_name_a_trial_several_or_none(trials):
    people = ("trial", [f"person {i % 4}" for i in range(12)])
    array = labelled(trials, person=people, rep=("trial", range(12))).drop_vars("trial")
    found = to_trials(array.set_index(trial=["person", "rep"]))
    assert found[5].attrs["trial"] == ("person 1", 5)
    assert to_frame(found).index.names == ["person", "rep", "time"]
    found = to_trials(xr.DataArray(array.values, dims=("trial", "sample", "angle")))
    same_bits(found, [x[:24] for x in trials])
    assert [x.attrs["trial"] for x in found] == list(range(12))
    assert list(found[0].columns) == [0, 1, 2]


def test_frames_that_only_fill_up_a_labelled_array(trials):
    array = to_frame(trials, columns=NAMES).to_xarray().to_dataarray("angle")
    array = array.transpose("trial", "frame", "angle")
    assert array.shape == (12, 35, 3)
    with pytest.raises(ValueError, match="is NaN from frame 24 to its end, frame 34"):
        sync().fit(array)
    padded = np.full((2, 35, 3), np.nan)
    padded[0], padded[1, :20] = trials[0][:1], trials[1][:20]
    padded[0] += np.sin(np.arange(35))[:, np.newaxis]
    with pytest.raises(ValueError, match=r"Trial 1 is NaN from frame 20 .* list\(X\)"):
        sync().fit(padded)
    # An end that was not seen.
    assert np.isnan(sync().fit_transform(list(padded))[1, -5:]).all()
    same_bits(to_trials(to_frame(array).dropna(how="all")), trials)


def test_frames_in_the_first_dimension_are_refused(trials):
    array = labelled(trials).transpose("time", "trial", "angle")
    for call in (sync().fit, to_trials, to_frame, LinearSynchronizer().fit):
        with pytest.raises(ValueError, match=r"X.transpose\('trial', 'time', 'angle'\)"):
            call(array)


def test_rows_of_a_labelled_array_of_two_dimensions_are_univariate(trials):
    array = labelled(trials).sel(angle="knee", drop=True)
    expected = LinearSynchronizer().fit_transform(array.values)
    np.testing.assert_array_equal(LinearSynchronizer().fit_transform(array), expected)
