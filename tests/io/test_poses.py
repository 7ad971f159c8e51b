"""from_poses: xarray Datasets as `movement` makes them."""

import json

import numpy as np
import pandas as pd
import pytest
import xarray as xr
from sklearn_motionsync import to_frame
from sklearn_motionsync.io import fill_gaps, find_gaps, from_poses

DIMS = ("time", "space", "keypoint", "individual")
OLD = {"keypoint": "keypoints", "individual": "individuals"}
POSITIONS = np.random.default_rng(0).normal(size=(40, 2, 3, 2))
CONFIDENCE = np.random.default_rng(1).uniform(size=(40, 3, 2))


def poses(positions=POSITIONS, fps=50.0, unit="seconds", times=None, **attrs):
    n_frames, n_dims = positions.shape[:2]
    if times is None:
        times = np.arange(n_frames) / (fps if unit == "seconds" else 1)
    coords = {"space": list("xyz"[:n_dims]), "keypoint": ["hip", "left knee", "toe"]}
    coords |= {"time": times, "individual": ["ann", "bob"]}
    variables = {"position": (DIMS, positions), "confidence": ((DIMS[0], *DIMS[2:]), CONFIDENCE)}
    attrs = {"fps": fps, "time_unit": unit, "ds_type": "poses", "source_software": "SLEAP"} | attrs
    return xr.Dataset(variables, coords, {k: v for k, v in attrs.items() if v is not None})


def test_recordings_hold_the_positions_and_attrs_of_each_individual():
    ann, bob = from_poses(poses())
    for i, df in enumerate((ann, bob)):
        expected = POSITIONS[:, :, :, i].swapaxes(1, 2).reshape(40, 6)
        np.testing.assert_array_equal(df, expected)
        assert df.index.equals(pd.RangeIndex(40))
        assert df.index.name == "frame"
    joints = ["hip", "left knee", "toe"]
    assert list(ann.columns) == [f"{joint}_{axis}" for joint in joints for axis in "xy"]
    facts = {"format": "poses", "frame_rate": 50.0, "units": None, "up": "-y", "kind": "keypoints"}
    facts |= {"joints": joints, "parents": [-1] * 3, "first_time": 0.0}
    assert ann.attrs == facts | {"trial": "ann", "levels": ("individual", "frame")}
    assert bob.attrs["trial"] == "bob"
    json.dumps(ann.attrs)
    _, bob = from_poses(poses(), trial="trial1")
    assert bob.attrs["trial"] == ("trial1", "bob")
    assert bob.attrs["levels"] == ("recording", "individual", "frame")
    assert len(to_frame([ann, bob])) == 80
    # In space there are three columns a joint, and which way is up is not known.
    positions = np.random.default_rng(0).normal(size=(40, 3, 3, 2))
    ann = from_poses(poses(positions))[0]
    np.testing.assert_array_equal(ann, positions[..., 0].swapaxes(1, 2).reshape(40, 9))
    assert ann.attrs["up"] is None


@pytest.mark.parametrize(
    "change",
    [
        lambda ds: ds.rename(OLD),
        lambda ds: ds.transpose("individual", "space", "time", "keypoint"),
        lambda ds: ds.transpose("keypoint", "time", "individual", "space").rename(OLD),
        lambda ds: ds.isel(space=[1, 0]),
        lambda ds: ds.drop_vars("space"),
        lambda ds: ds.drop_vars("confidence"),
        lambda ds: ds.position.assign_attrs(ds.attrs),
        # As read again from a NetCDF file.
        lambda ds: ds.assign_attrs(fps=np.int64(50)),
        lambda ds: ds.assign_coords(time=pd.to_timedelta(ds.time.values, unit="s")),
        # Without the attrs of the Dataset the times give the frame rate.
        lambda ds: ds.position,
    ],
)
def test_variants_of_datasets_are_the_same(change):
    for df, expected in zip(from_poses(change(poses())), from_poses(poses()), strict=True):
        pd.testing.assert_frame_equal(df, expected)
        assert df.attrs == expected.attrs


@pytest.mark.parametrize("start", [pd.Timestamp("2024-01-01"), pd.Timedelta(7, "s")])
def test_dates_count_from_the_first_frame_and_durations_from_0(start):
    for df in from_poses(poses(times=start + pd.to_timedelta(np.arange(40) / 50, "s"))):
        assert df.attrs["first_time"] == (0 if isinstance(start, pd.Timestamp) else 7)
        assert df.attrs["frame_rate"] == 50


def test_selected_individuals_and_keypoints_keep_their_names():
    expected = from_poses(poses())[1]
    for ds in (poses().sel(individual="bob"), poses().rename(OLD).sel(individuals="bob")):
        (bob,) = from_poses(ds, min_confidence=0)
        pd.testing.assert_frame_equal(bob, expected)
        assert bob.attrs["trial"] == "bob"
    (knee,) = from_poses(poses().sel(individual="bob", keypoint="left knee"))
    pd.testing.assert_frame_equal(knee, expected[["left knee_x", "left knee_y"]])
    nameless = from_poses(poses().drop_vars(["individual", "keypoint"]))
    assert [df.attrs["trial"] for df in nameless] == ["individual_0", "individual_1"]
    assert nameless[0].attrs["joints"] == ["keypoint_0", "keypoint_1", "keypoint_2"]


@pytest.mark.parametrize("order", [(0, 1, 2), (2, 0, 1)])
def test_positions_of_low_confidence_are_gaps(order):
    ds = poses()
    ds["confidence"] = ds.confidence.transpose(*(ds.confidence.dims[k] for k in order))
    ds["confidence"][{"time": 7}] = np.nan  # not known
    before = ds.copy(deep=True)
    least = 0.4
    for i, df in enumerate(from_poses(ds, min_confidence=least)):
        doubtful = CONFIDENCE[:, :, i] < least
        doubtful[7] = False
        assert doubtful.any()
        np.testing.assert_array_equal(df.isna(), np.repeat(doubtful, 2, axis=1))
        assert find_gaps(df)["n_frames"].sum() == doubtful.sum()
        filled = from_poses(ds, min_confidence=least, max_gap=3)[i]
        pd.testing.assert_frame_equal(filled, fill_gaps(df, 3))
        assert filled.attrs == df.attrs
    xr.testing.assert_identical(ds, before)
    assert not from_poses(ds)[0].isna().any(axis=None)


@pytest.mark.parametrize(
    ("ds", "rate"),
    [
        (poses(), 50),
        (poses(fps=30, unit="frames"), 30),
        (poses(fps=None, unit=None, times=np.arange(40) / 25), 25),
        (poses(fps=30, unit=None, times=np.arange(40)), 30),
        # Every second frame was selected; attrs["fps"] is that of all.
        (poses().isel(time=slice(0, None, 2)), 25),
        (poses(fps=30, unit="frames").isel(time=slice(1, None, 3)), 10),
        (poses(fps=30, unit="frames").assign_attrs(fps=" 29.97 "), 29.97),
        (poses(fps=30, unit="frames").assign_attrs(fps="not known"), None),
        *((poses(unit="frames").assign_attrs(fps=fps), None) for fps in (0, np.nan, [30, 30])),
        (poses(fps=0.5, unit="frames"), 0.5),
        (poses(times=pd.to_timedelta(7 + np.arange(40) / 50, "s"), fps=None), 50),
        (poses().drop_vars("time"), 50),
        (poses().isel(time=[3]), 50),
    ],
)
def test_frame_rate_follows_from_times_and_fps(ds, rate):
    df = from_poses(ds)[0]
    assert df.attrs["frame_rate"] == (rate if rate is None else pytest.approx(rate))
    assert "times" not in df.attrs
    assert from_poses(ds, frame_rate=12)[0].attrs["frame_rate"] == 12.0
    assert ("first_time" in df.attrs) == (rate is not None)


def test_times_that_contradict_fps_or_are_uneven_are_warned_of():
    for fps, rate in ((30, 60), (60, 25)):
        ds = poses(fps=fps, times=np.arange(40) / rate)
        message = rf"The poses: it says {fps} frames .* are {rate}, which"
        with pytest.warns(UserWarning, match=message):
            (ann, _) = from_poses(ds)
        assert ann.attrs["frame_rate"] == pytest.approx(rate)
        assert from_poses(ds, frame_rate=fps)[0].attrs["frame_rate"] == fps
    ds = poses(fps=50, unit="seconds").isel(time=[*range(20), *range(25, 40)])
    with pytest.warns(UserWarning, match=r"The poses: its times are uneven, .* s, but"):
        ann, bob = from_poses(ds)
    assert ann.attrs["frame_rate"] is None
    assert bob.attrs["times"] == ds.time.values.tolist()


@pytest.mark.parametrize(
    ("ds", "params", "message"),
    [
        (POSITIONS, {}, "needs an xarray Dataset or DataArray .*, got ndarray"),
        (poses().drop_vars("position"), {}, r"the variable 'position', got \['confidence'\]"),
        (poses().expand_dims(view=["a", "b"]), {}, r"got also \['view'\]; .*ds\.isel\(view=0\)"),
        (poses().isel(time=0, drop=True), {}, "needs the dimension 'time'"),
        (poses().isel(space=[0]), {}, r"must hold 'x', 'y' and optionally 'z', got \['x'\]"),
        (poses().isel(time=slice(0)), {}, "position of poses is empty: {'time': 0"),
        (poses().isel(time=slice(None, None, -1)), {}, r"must increase; sort them by ds\.sortby"),
        (poses(times=np.array(list("ab" * 20))), {}, "'time' of poses is text, such as 'a'"),
        (poses(unit="ms"), {}, "must be seconds or frames, but .* is 'ms'"),
        (poses().astype(str), {}, "The position of poses must be numbers, got <U"),
        (poses().position, {"min_confidence": 0.5}, "needs a Dataset with the variable 'confid"),
        (poses(), {"min_confidence": "high"}, r"must be a number such as 0\.6, got 'high'"),
        (poses(), {"max_gap": None}, "max_gap must be a whole number of frames"),
    ],
)
def test_wrong_poses_are_refused(ds, params, message):
    with pytest.raises(ValueError, match=message):
        from_poses(ds, **params)
