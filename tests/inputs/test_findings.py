"""What numbers of trials mean: made faults are found and mended, and untouched trials have none."""

import re
import warnings

import numpy as np
import pandas as pd
import pytest
from scipy.spatial.transform import Rotation
from sklearn.decomposition import PCA
from sklearn_motionsync import (
    ASpace,
    DenseSynchronizer,
    FrameWise,
    LinearSynchronizer,
    TrialWarning,
    check_trials,
    mend_trials,
)
from sklearn_motionsync.datasets import load_trials, make_bending, make_gait, make_walk

GAIT = [np.asarray(x) for x in make_gait(timing=6, random_state=0).data]
BENDS = [np.asarray(x) for x in make_bending(8, random_state=0).data]


def beside(column):
    """The angles of gait with one column more, a function of the frame's share and the trial."""
    shares = [np.linspace(0, 1, len(x)) for x in GAIT]
    return [
        np.column_stack([x, column(t, i)])
        for i, (x, t) in enumerate(zip(GAIT, shares, strict=True))
    ]


def named(trials, name):
    """Tables of them, whose last column has this name."""
    return [pd.DataFrame(x, columns=["hip", "knee", "ankle", "force", name]) for x in trials]


def yaw(t, i):
    return (170 + (25 + i % 3) * np.sin(np.pi * t) + 180) % 360 - 180


def quaternion(t, i):
    turns = np.column_stack([0.5 * np.sin(3 * t), 0.3 * np.cos(2 * t + 0.1 * i), 1.5 + t])
    return Rotation.from_rotvec(turns).as_quat() * np.where(t > 0.4, -1, 1)[:, np.newaxis]


def with_one(trials, i, change):
    return [change(x.copy()) if k == i else x for k, x in enumerate(trials)]


def put(x, place, value):
    x[place] = value
    return x


WIDTH = GAIT[0].shape[1]
# Kind, trials, and what the row says of it.
MADE = {
    "wrapping": (beside(yaw), {"feature": WIDTH, "value": 360, "n_trials": len(GAIT)}),
    "wrapping in radians": (
        beside(lambda t, i: np.deg2rad(yaw(t, i))),
        {"kind": "wrapping", "feature": WIDTH, "value": 2 * np.pi},
    ),
    "quaternion": (beside(quaternion), {"feature": WIDTH, "n_trials": len(GAIT)}),
    "quality": (
        named(beside(lambda t, i: 0.8 + 0.2 * np.sin(9 * t + i)), "nose_likelihood"),
        {"feature": "nose_likelihood"},
    ),
    "fill value": (
        with_one(BENDS, 2, lambda x: put(x, np.s_[20:30, 3:6], 0)),
        {"trial": 2, "first": 20, "last": 29, "value": 0},
    ),
    "clock": (beside(lambda t, i: t), {"feature": WIDTH}),
    "named clock": (named(beside(lambda t, i: t), "time"), {"kind": "clock", "feature": "time"}),
    "constant": (beside(lambda t, i: 0 * t + 3), {"feature": WIDTH}),
    "zeros at the end": (
        with_one(GAIT, 4, lambda x: np.vstack([x, np.zeros((9, WIDTH))])),
        {"trial": 4, "first": len(GAIT[4]), "last": len(GAIT[4]) + 8},
    ),
    "missing at the end": (
        with_one(GAIT, 4, lambda x: np.vstack([x, np.full((9, WIDTH), np.nan)])),
        {"trial": 4, "first": len(GAIT[4])},
    ),
    "held at the end": (
        with_one(GAIT, 4, lambda x: np.vstack([x, np.repeat(x[-1:], 9, axis=0)])),
        {"trial": 4, "first": len(GAIT[4]), "last": len(GAIT[4]) + 8},
    ),
    "frozen": (
        with_one(GAIT, 1, lambda x: put(x, np.s_[20:35], x[20])),
        {"trial": 1, "first": 21, "last": 34},
    ),
    "factor": (with_one(BENDS, 3, lambda x: 1000 * x), {"trial": 3, "value": 1000}),
    "factor of angles": (
        with_one(GAIT, 3, np.deg2rad), {"kind": "factor", "trial": 3, "value": 57.3},
    ),
    "exchanged axes": (
        with_one(BENDS, 5, lambda x: x.reshape(len(x), -1, 3)[..., [0, 2, 1]].reshape(len(x), -1)),
        {"trial": 5},
    ),
    "other rate": (with_one(GAIT, 6, lambda x: np.repeat(x, 4, axis=0)), {"trial": 6, "value": 4}),
}  # fmt: skip


@pytest.mark.parametrize("name", MADE)
def test_a_made_fault_is_the_only_finding(name):
    trials, expected = MADE[name]
    table = check_trials(trials)
    kind = expected.get("kind", name)
    assert set(table["kind"]) == {kind}
    row = table.iloc[0]
    for key, value in expected.items():
        assert row[key] == pytest.approx(value, rel=0.02) if key == "value" else row[key] == value
    # What mends it is a line that can be run, or says what to do.
    assert row["why"]
    assert row["mend"]
    assert "{" not in row["mend"]


@pytest.mark.parametrize(
    "trials",
    [
        GAIT,
        BENDS,
        [np.asarray(x) for x in make_walk(4, random_state=0).data],
        [np.where(np.arange(len(x))[:, np.newaxis] // 9 == 3, np.nan, x) for x in GAIT],
        # What is no clock in every trial, or is all there is.
        beside(lambda t, i: t if i else -t),
        beside(lambda t, i: t if i else t**1.2),
        beside(lambda t, i: t if i else np.where(t > 0.5, t - t[1], t)),
        [np.linspace(0, 1, len(x))[:, np.newaxis] for x in GAIT],
    ],
    ids=["gait", "bending", "walk", "gaps", "back", "uneven", "twice", "alone"],
)
def test_nothing_of_made_movement(trials):
    assert check_trials(trials).empty


@pytest.mark.parametrize("name", ["hdm05/hdm05", "utkinect/utkinect", "cmu07_walk/cmu07_walk"])
def test_recordings_of_people_have_few_findings(real_data, name):
    """The end of one clip repeats its pose in the file; nothing else is found."""
    bunch, kinds = load_trials(real_data / f"{name}_positions.npz"), []
    for label in np.unique(bunch.target):
        trials = [bunch.data[i] for i in np.flatnonzero(bunch.target == label)]
        kinds += check_trials(trials)["kind"].tolist()
    assert kinds == ["held at the end"] * (name == "hdm05/hdm05")


def test_markers_at_zero_in_a_public_set_are_fill_values(real_data):
    """UI-PRMD writes 0, 0, 0 for a marker that was not seen; what is found is nothing else."""
    with np.load(real_data / "uiprmd" / "uiprmd_odd_positions.npz") as z:
        takes, labels = np.split(z["positions"], z["offsets"][1:-1]), z["label"]
    squats = [takes[i] for i in np.flatnonzero(labels == "deep squat")]
    table = check_trials([x.reshape(len(x), -1) for x in squats])
    assert set(table["kind"]) == {"fill value"}
    for _, row in table.iterrows():
        joint = squats[row["trial"]][row["first"] : row["last"] + 1, row["feature"] // 3]
        assert (joint == 0).all()


@pytest.mark.parametrize(
    "estimator", [LinearSynchronizer(51), DenseSynchronizer(51), ASpace(), FrameWise(PCA(2))]
)
@pytest.mark.parametrize(
    ("name", "words"),
    [
        ("wrapping", rf"Feature {WIDTH} in trial 0, frame \d+: angles jump by 360, .* period=360"),
        ("quaternion", rf"Feature {WIDTH} in trial 0.* sign of a quaternion"),
        ("quality", "Feature 'nose_likelihood': values from 0 to 1 that are named"),
        ("fill value", r"Features \[3, 4, 5\] in trial 2, frame 20: exactly 0"),
        ("zeros at the end", r"Trial 4: all features are zero from frame \d+ on"),
        ("factor of angles", r"Trial 3: about 57\.3 times .*degrees and radians"),
    ],
)
def test_a_fit_warns_once(estimator, name, words):
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        estimator.fit(MADE[name][0])
    told = [str(each.message) for each in caught if issubclass(each.category, TrialWarning)]
    assert len(told) == 1
    assert re.match(words, told[0])
    assert "check_trials(X)" in told[0]


@pytest.mark.parametrize(("name", "feature"), [("clock", WIDTH), ("named clock", "'time'")])
def test_a_clock_is_warned_of_where_trials_are_matched(name, feature):
    with pytest.warns(UserWarning, match=f"Feature {feature}: increases evenly in every trial"):
        LinearSynchronizer(51).fit(MADE[name][0])


@pytest.mark.parametrize("name", ["wrapping", "quaternion", "fill value", "zeros at the end"])
def test_what_was_mended_has_no_finding(name):
    trials = MADE[name][0]
    before = [np.array(x) for x in trials]
    mended = mend_trials(trials, [name])
    assert check_trials(mended).empty
    for x, y in zip(trials, before, strict=True):
        np.testing.assert_array_equal(x, y)
    if name == "wrapping":
        # On the circle nothing moved.
        turns = np.concatenate([(a - b)[:, WIDTH] for a, b in zip(mended, trials, strict=True)])
        np.testing.assert_allclose(turns / 360, np.rint(turns / 360), atol=1e-9)
    if name == "quaternion":
        # Nor is another rotation meant.
        for pair in zip(mended, trials, strict=True):
            turns = [Rotation.from_quat(x[:, WIDTH:]).as_matrix() for x in pair]
            np.testing.assert_allclose(*turns, atol=1e-12)
    if name == "fill value":
        assert np.isnan(mended[2][20:30, 3:6]).all()
    if name == "zeros at the end":
        np.testing.assert_array_equal(mended[4], GAIT[4])


def test_means_of_mended_angles_are_those_of_angles_that_do_not_wrap():
    aligned = DenseSynchronizer(51).fit_transform(mend_trials(MADE["wrapping"][0]))
    unwrapped = beside(lambda t, i: 170 + (25 + i % 3) * np.sin(np.pi * t))
    truth = DenseSynchronizer(51).fit_transform(unwrapped)
    np.testing.assert_allclose((aligned - truth)[..., WIDTH] % 360 % 359.999, 0, atol=1e-3)


def test_tables_stay_tables_with_their_attrs():
    tables = [pd.DataFrame(x) for x in MADE["wrapping"][0]]
    tables[0].attrs["frame_rate"] = 100.0
    mended = mend_trials(tables)
    assert mended[0].attrs == {"frame_rate": 100.0}
    assert mended[0].columns.equals(tables[0].columns)
    with pytest.raises(ValueError, match=r"kinds are \['fill value', 'wrapping', .*got 'all'"):
        mend_trials(tables, "all")
    with pytest.raises(ValueError, match="Wrap one trial as"):
        check_trials(np.zeros((9, 3)))


def test_circular_features_that_are_named_are_averaged_on_the_circle():
    """Headings near half a turn, some on either side of it, of which none wraps by itself."""
    t = np.linspace(0, 1, 60)[:, np.newaxis]
    rng = np.random.default_rng(0)
    headings = [179 + 4 * rng.standard_normal() + np.sin(3 * t) for _ in range(8)]
    trials = [np.hstack([(h + 180) % 360 - 180, np.cos(5 * t)]) for h in headings]
    trials = [x for x in trials if np.abs(np.diff(x[:, 0])).max() < 10]
    starts = np.array([x[0, 0] for x in trials])
    assert starts.min() < 0 < starts.max()
    assert len(check_trials(trials)) == 0
    circular = np.angle(np.mean([np.exp(1j * np.radians(x[:, 0])) for x in trials], axis=0))
    for period in ({0: 360}, {"x0": 360.0}):
        mended = mend_trials(trials, period=period)
        mean = np.radians(np.mean([x[:, 0] for x in mended], axis=0))
        np.testing.assert_allclose(np.exp(1j * mean), np.exp(1j * circular), atol=2e-3)
        # Other features stay, and those with another period are of another kind.
        for old, new in zip(trials, mended, strict=True):
            np.testing.assert_array_equal(new[:, 1], old[:, 1])
    everything = mend_trials([x[:, :1] for x in trials], period=360)
    np.testing.assert_allclose([x[:, 0] for x in everything], [x[:, 0] for x in mended])
    for bad in (0, -360, np.inf, {0: 0}):
        with pytest.raises(ValueError, match="period must be above 0"):
            mend_trials(trials, period=bad)
    with pytest.raises(ValueError, match="There is no feature 'yaw'"):
        mend_trials(trials, period={"yaw": 360})
