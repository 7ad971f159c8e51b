"""LagDisplay: its artists agree with the tables of the lags."""

import matplotlib.pyplot as plt
import numpy as np
import pandas as pd
from artists import edges, texts, ys
from sklearn.pipeline import make_pipeline
from sklearn_motionsync import DenseSynchronizer, DirectionCosines, PartSynchronizer
from sklearn_motionsync.datasets import make_bending
from sklearn_motionsync.display import LagDisplay
from sklearn_motionsync.synchronizers import Lags

# Twelve trials of four people; the arm is late in the second half, the leg never.
VALUES = np.random.default_rng(0).normal(0, 0.3, (12, 2, 21))
VALUES[:, 0, 11:] += 5
LAGS = Lags(VALUES, ["arm", "leg"], "frames", np.repeat(range(4), 3))


def test_curves_show_mean_interval_and_standard_deviation():
    display = LagDisplay(LAGS, "% gait cycle").plot()
    assert [axis.get_xlabel() for axis in display.axes_] == ["% gait cycle"] * 2
    assert [axis.get_ylabel() for axis in display.axes_] == ["late by\n(frames)", ""]
    for i, part in enumerate(["arm", "leg"]):
        table = LAGS.over_time().loc[part]
        np.testing.assert_array_equal(display.means_[i].get_xdata(), range(21))
        np.testing.assert_array_equal(display.means_[i].get_ydata(), table["mean"])
        ends = [table["mean"] - table["sd"], table["mean"] + table["sd"]]
        np.testing.assert_allclose(ys(display.spreads_[i]), ends)
        bounds = table[["low", "high"]].T
        np.testing.assert_allclose(edges(display.intervals_[i]), bounds)
        low, high = display.axes_[i].get_ylim()
        assert low == -high < -5
    icc = LAGS.summary()["icc"]
    titles = [f"arm, ICC {icc['arm']:.2f}", f"leg, ICC {icc['leg']:.2f}"]
    assert [axis.get_title() for axis in display.axes_] == titles
    labels = ["mean, 12 trials of 4 people", "95 % interval (people)", "± 1 SD of trials"]
    assert texts(display.axes_[0]) == labels


def test_a_single_trial_has_no_interval():
    display = LagDisplay(Lags(VALUES[:1], LAGS.parts, "percent")).plot()
    assert texts(display.axes_[0])[:2] == ["mean, 1 trial", "95 % interval (trials)"]
    assert display.intervals_[0].get_paths() == []
    np.testing.assert_allclose(ys(display.spreads_[1]), [VALUES[0, 1]] * 2)
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
    assert [a.get_title() for a in display.axes_] == display.lags.parts
    tables = [pd.DataFrame(x, columns=bunch.skeleton.column_names) for x in bunch.data]
    for x in tables:
        x.attrs["frame_rate"] = 50.0
    told = LagDisplay.from_estimator(pipe.fit(tables), tables, unit="seconds")
    asked = sync.lags(X, unit="seconds", frame_rate=50)
    np.testing.assert_allclose(told.lags.values, asked.values)
    assert np.abs(asked.values).max() > 0
