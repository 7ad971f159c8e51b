"""TrackingDisplay: its artists agree with the track."""

import matplotlib.pyplot as plt
import numpy as np
import pandas as pd
import pytest
from artists import edges, texts
from sklearn.base import clone
from sklearn_motionsync import DirectionCosines, LinearSynchronizer
from sklearn_motionsync.datasets import make_bending
from sklearn_motionsync.display import TrackingDisplay
from sklearn_motionsync.live import MotionTracker

BUNCH = make_bending(5, n_frames=24, random_state=0)
COSINES = DirectionCosines(BUNCH.skeleton).fit(BUNCH.data)
NAMES = list(COSINES.get_feature_names_out())
X = COSINES.transform(BUNCH.data)
HIDDEN = [k for k, name in enumerate(NAMES) if name.startswith(("left_arm", "left_forearm"))]
SEEN = X[4].copy()
SEEN[8:15, HIDDEN] = np.nan


@pytest.fixture(scope="module")
def tracker():
    sync = LinearSynchronizer(24)
    return MotionTracker(sync, n_particles=20, frame_rate=30, random_state=0).fit(X[:4])


def test_artists_agree_with_the_track_of_hidden_features(tracker):
    display = TrackingDisplay.from_estimator(tracker, SEEN, truth=X[4], names=NAMES)
    track, times = tracker.track(SEEN), np.arange(len(SEEN)) / 30
    names = [axis.get_ylabel() for axis in display.axes_]
    shown = [NAMES.index(name) for name in names[:4]]
    assert shown == sorted(HIDDEN, key=lambda k: -track.poses.var(axis=0)[k])[:4]
    assert names[4:] == ["phase (%)", "rate"]
    for i, k in enumerate(shown):
        np.testing.assert_allclose(display.estimates_[i].get_xdata(), times)
        np.testing.assert_array_equal(display.estimates_[i].get_ydata(), track.poses[:, k])
        np.testing.assert_array_equal(display.truths_[i].get_ydata(), X[4][:, k])
        np.testing.assert_array_equal(display.observed_[i].get_ydata(), SEEN[:, k])
        half = 1.645 * np.sqrt(track.covariances[:, k, k])
        bounds = track.poses[:, k] - half, track.poses[:, k] + half
        np.testing.assert_allclose(edges(display.bands_[i]), bounds)
    np.testing.assert_allclose(display.phase_.get_ydata(), 100 * track.phases / 23)
    np.testing.assert_array_equal(display.rate_.get_ydata(), track.rates)
    for spans in display.hidden_:
        (span,) = spans
        ends = span.get_window_extent().transformed(span.axes.transData.inverted()).intervalx
        np.testing.assert_allclose(ends, [7.5 / 30, 14.5 / 30])
    # Phase and rate are shaded where any feature that is drawn was hidden.
    display = TrackingDisplay.from_estimator(tracker, SEEN, features=[0, HIDDEN[0]])
    assert [len(spans) for spans in display.hidden_] == [0, 1, 1, 1]


def test_lost_intervals_and_chosen_features(tracker):
    display = TrackingDisplay.from_estimator(tracker, X[4], features=[1, 36])
    lost = np.isin(np.arange(len(X[4])), [3, 4, 9])
    display.track = display.track._replace(lost=lost)
    axes = display.axes_
    assert display.plot(axes).axes_ == axes
    assert [len(spans) for spans in display.lost_] == [2, 2, 2, 2]
    assert [len(spans) for spans in display.hidden_] == [0, 0, 0, 0]
    assert display.truths_ == []
    assert [axis.get_ylabel() for axis in axes] == ["x1", "x36", "phase (%)", "rate"]
    assert texts(axes[0]) == ["90 %", "estimate", "seen", "lost"]


def test_two_frames_long_names_and_shared_axes(tracker):
    names = [f"the flexion of the right upper extremity {k}" for k in range(X[0].shape[1])]
    display = TrackingDisplay.from_estimator(tracker, SEEN[:2], names=names)
    label = display.axes_[0].yaxis.label
    display.figure_.draw_without_rendering()
    assert label.get_window_extent().height < display.figure_.bbox.height / 6
    display = TrackingDisplay.from_estimator(tracker, SEEN, features=0)
    rates = display.track.rates
    _, axes = plt.subplots(3, 2, sharey="row")
    for column, factor in zip(axes.T, (1, 3), strict=True):
        display.track = display.track._replace(rates=factor * rates)
        display.plot(column)
    assert axes[2, 0].get_ylim()[1] > 3 * rates.max()


def test_times_units_and_tables(tracker):
    times = np.arange(len(SEEN)) / 15
    table = pd.DataFrame(SEEN, columns=NAMES)
    table.attrs["units"] = ["legs", *["1"] * 36]
    fitted = clone(tracker).fit([pd.DataFrame(x, columns=NAMES) for x in X[:2]])
    display = TrackingDisplay.from_estimator(fitted, table, times=times, features="pelvis_height")
    assert display.phase_.get_xdata()[-1] == times[-1]
    assert display.axes_[0].get_ylabel() == "pelvis_height\n(legs)"
    assert display.axes_[-1].get_xlabel() == "time (s)"


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"X": [SEEN, SEEN]}, "X must be one take, 2-D, got an array-like with 3 axes"),
        ({"features": "tail_x"}, "no feature 'tail_x'"),
        ({"truth": X[4][1:]}, "The truth must have the shape"),
        ({"names": ["one"]}, "names must be a list of text"),
        ({"times": np.arange(len(SEEN))[::-1]}, "time stamps must increase"),
    ],
)
def test_from_estimator_refuses(tracker, change, message):
    with pytest.raises(ValueError, match=message):
        TrackingDisplay.from_estimator(tracker, **({"X": SEEN} | change))
