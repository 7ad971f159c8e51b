"""LagDisplay: its artists agree with the tables of the lags."""

import matplotlib.pyplot as plt
import numpy as np
import pandas as pd
import pytest
from sklearn.pipeline import make_pipeline
from sklearn_motionsync import DenseSynchronizer, DirectionCosines, PartSynchronizer
from sklearn_motionsync.datasets import make_bending
from sklearn_motionsync.display import LagDisplay
from sklearn_motionsync.synchronizers import Lags

N_FRAMES = 21


@pytest.fixture(scope="module")
def lags():
    """Twelve trials of four subjects; the arm is late in the second half, the leg never."""
    rng, groups = np.random.default_rng(0), np.repeat(range(4), 3)
    values = rng.normal(0, 0.3, (12, 2, N_FRAMES))
    values[:, 0, 11:] += 5
    return Lags(values, ["arm", "leg"], "frames", groups, list("abcd"))


def test_map_shows_the_mean_and_hatches_intervals_around_zero(lags):
    display = LagDisplay(lags).plot()
    table = lags.over_time()
    np.testing.assert_array_equal(display.map_.get_array().ravel(), table["mean"])
    low, high = display.map_.get_clim()
    assert low == -high == -table["mean"].abs().max()
    arm, leg = (patch.get_paths() for patch in display.unsure_)
    assert max(path.vertices[:, 0].max() for path in arm) < 12
    assert max(path.vertices[:, 0].max() for path in leg) > 15
    assert all(patch.get_hatch() for patch in display.unsure_)
    title = "2 parts behind the rest of the body, 12 trials of 4 people"
    assert display.axes_[0].get_title() == title
    names = [label.get_text() for label in display.axes_[0].get_yticklabels()]
    icc = lags.summary()["icc"]
    assert names == [f"arm\nICC {icc['arm']:.2f}", f"leg\nICC {icc['leg']:.2f}"]


def test_curves_show_mean_interval_and_standard_deviation(lags):
    display = LagDisplay(lags, "% gait cycle").plot()
    assert {axis.get_xlabel() for axis in display.axes_} == {"% gait cycle"}
    for i, part in enumerate(["arm", "leg"]):
        table = lags.over_time().loc[part]
        np.testing.assert_array_equal(display.means_[i].get_ydata(), table["mean"])
        drawn = [np.array(line)[:, 1] for line in display.spreads_[i].get_segments()]
        np.testing.assert_allclose(
            drawn, [table["mean"] - table["sd"], table["mean"] + table["sd"]]
        )
        heights = display.intervals_[i].get_paths()[0].vertices[:, 1]
        assert (heights.min(), heights.max()) == pytest.approx(
            (table["low"].min(), table["high"].max())
        )
    assert "people" in display.axes_[1].get_legend().get_texts()[1].get_text()


def test_a_single_trial_has_no_interval(lags):
    display = LagDisplay(Lags(lags.values[:1], lags.parts, "percent")).plot()
    assert display.axes_[0].get_title() == "2 parts behind the rest of the body, 1 trial"
    assert display.unsure_[0].get_paths()
    assert display.axes_[0].get_xlim() == (0, 100)


def test_from_estimator_of_a_pipeline_on_axes_of_the_user():
    bunch = make_bending(4, n_frames=30, random_state=0)
    body = DenseSynchronizer(n_frames=30, metric=None, consensus=1)
    sync = PartSynchronizer(coupling=0.01, synchronizer=body)
    pipe = make_pipeline(DirectionCosines(bunch.skeleton), sync).fit(bunch.data)
    ax = plt.figure().subplots(1, 2)[1]
    display = LagDisplay.from_estimator(pipe, bunch.data, unit="frames", ax=ax)
    X = pipe[:-1].transform(bunch.data)
    np.testing.assert_array_equal(display.lags.values, sync.lags(X).values)
    assert display.figure_ is ax.figure
    assert [a.get_title() for a in display.axes_[1:]] == display.lags.parts
    tables = [pd.DataFrame(x, columns=bunch.skeleton.column_names) for x in bunch.data]
    for x in tables:
        x.attrs["frame_rate"] = 50.0
    told = LagDisplay.from_estimator(pipe.fit(tables), tables, unit="seconds")
    asked = sync.lags(X, unit="seconds", frame_rate=50)
    np.testing.assert_allclose(told.lags.values, asked.values)
    assert np.abs(asked.values).max() > 0
