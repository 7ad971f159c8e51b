"""TrackingDisplay: its artists agree with the track."""

import matplotlib.pyplot as plt
import numpy as np
import pandas as pd
import pytest
from sklearn_motionsync import DirectionCosines, LinearSynchronizer, MotionTracker, Track
from sklearn_motionsync.datasets import make_bending
from sklearn_motionsync.display import TrackingDisplay

BUNCH = make_bending(5, n_frames=24, random_state=0)
COSINES = DirectionCosines(BUNCH.skeleton).fit(BUNCH.data)
NAMES = list(COSINES.get_feature_names_out())
X = COSINES.transform(BUNCH.data)
HIDDEN = [k for k, name in enumerate(NAMES) if name.startswith(("left_arm", "left_forearm"))]
SPAN = slice(8, 15)
SEEN = X[4].copy()
SEEN[SPAN, HIDDEN] = np.nan


@pytest.fixture(scope="module")
def tracker():
    sync = LinearSynchronizer(24)
    return MotionTracker(sync, n_particles=20, frame_rate=30, random_state=0).fit(X[:4])


@pytest.fixture(scope="module")
def display(tracker):
    return TrackingDisplay.from_estimator(tracker, SEEN, truth=X[4], names=NAMES)


def test_artists_agree_with_the_track_of_hidden_features(tracker, display):
    track = tracker.track(SEEN)
    names = [axis.get_ylabel() for axis in display.axes_]
    assert names[4:] == ["phase (%)", "rate"]
    shown = [NAMES.index(name) for name in names[:4]]
    variance = track.postures.var(axis=0)
    assert shown == sorted(HIDDEN, key=lambda k: -variance[k])[:4]
    times = np.arange(len(SEEN)) / 30
    for i, k in enumerate(shown):
        np.testing.assert_allclose(display.estimates_[i].get_xdata(), times)
        np.testing.assert_array_equal(display.estimates_[i].get_ydata(), track.postures[:, k])
        np.testing.assert_array_equal(display.truths_[i].get_ydata(), X[4][:, k])
        np.testing.assert_array_equal(display.observed_[i].get_ydata(), SEEN[:, k])
        half = 1.645 * np.sqrt(track.covariances[:, k, k])
        n = len(times)
        upper_and_lower = display.bands_[i].get_paths()[0].vertices[:, 1]
        assert upper_and_lower.max() == pytest.approx((track.postures[:, k] + half).max())
        assert upper_and_lower.min() == pytest.approx((track.postures[:, k] - half).min())
        assert len(upper_and_lower) > 2 * n
    np.testing.assert_allclose(display.phase_.get_ydata(), 100 * track.phases / 23)
    np.testing.assert_array_equal(display.rate_.get_ydata(), track.rates)
    for spans in display.hidden_:
        (span,) = spans
        ends = span.get_window_extent().transformed(span.axes.transData.inverted()).intervalx
        np.testing.assert_allclose(ends, [7.5 / 30, 14.5 / 30])


def test_lost_intervals_and_chosen_features(tracker):
    track = tracker.smooth(X[4])
    lost = np.zeros(len(track.lost), dtype=bool)
    lost[[3, 4, 9]] = True
    track = Track(*track[:5], lost)
    display = TrackingDisplay.from_predictions(track, features=[1, 36])
    assert [len(spans) for spans in display.lost_] == [2, 2, 2, 2]
    assert [len(spans) for spans in display.hidden_] == [0, 0, 0, 0]
    assert (display.truths_, display.observed_) == ([], [])
    assert [axis.get_ylabel() for axis in display.axes_] == ["x1", "x36", "phase (frame)", "rate"]
    axes = display.axes_
    assert display.plot(axes, features=[2, 3]).axes_ == axes
    assert axes[0].get_ylabel() == "x2"
    legend = [text.get_text() for text in axes[0].get_legend().get_texts()]
    assert legend == ["90 %", "estimate", "lost"]


def test_a_single_frame_long_names_and_shared_axes(tracker):
    names = [f"the flexion of the right upper extremity {k}" for k in range(X[0].shape[1])]
    display = TrackingDisplay.from_estimator(tracker, SEEN[:1], names=names)
    label = display.axes_[0].yaxis.label
    display.figure_.draw_without_rendering()
    assert label.get_window_extent().height < display.figure_.bbox.height / 6
    track = tracker.track(SEEN)
    _, axes = plt.subplots(3, 2, sharey="row")
    for column, rates in zip(axes.T, (track.rates, 3 * track.rates), strict=True):
        of_rates = Track(*track[:3], rates, *track[4:])
        TrackingDisplay.from_predictions(of_rates, features=0, ax=column)
    assert axes[2, 0].get_ylim()[1] > 3 * track.rates.max()


def test_truth_has_the_form_of_the_takes(tracker):
    table = pd.concat(
        [pd.DataFrame(X[3]), pd.DataFrame(SEEN)], keys=["a", "b"], names=["take", "frame"]
    )
    display = TrackingDisplay.from_estimator(tracker, table, truth=table.fillna(0), take=1)
    np.testing.assert_array_equal(display.truth, np.nan_to_num(SEEN))
    rows = np.array([np.sin(np.linspace(0, size, 30)) for size in (3, 3.1, 3.2)])
    univariate = MotionTracker(LinearSynchronizer(), n_particles=20, random_state=0).fit(rows)
    display = TrackingDisplay.from_estimator(univariate, rows, truth=rows, take=1)
    np.testing.assert_array_equal(display.truth[:, 0], rows[1])


def test_bodies_of_strip_and_side_by_side(display):
    """Hidden limbs are violet, the truth is a shadow, and unobserved joints are missing."""
    strip = display.strip(COSINES, frames=[2, 10])
    skeleton = COSINES.skeleton.body()
    joints = [skeleton.joints.index(f"left_{name}") for name in ("shoulder", "elbow", "wrist")]
    arm = {tuple(joints[:2]), tuple(joints[1:])}
    assert [set(bones) for bones in strip.marked] == [set(), arm]
    np.testing.assert_allclose(
        strip.behind[1][0].reshape(-1), COSINES.inverse_transform(X[4])[10], atol=1e-12
    )
    people = display.side_by_side(COSINES)
    assert people.labels == ["seen", "estimate", "truth"]
    seen, estimate, _ = people.scenes[0]
    gaps = np.isnan(seen).any(axis=2)
    expected = np.zeros_like(gaps)
    expected[SPAN, joints[1:]] = True
    np.testing.assert_array_equal(gaps, expected)
    np.testing.assert_allclose(
        estimate.reshape(len(SEEN), -1), COSINES.inverse_transform(display.track.postures)
    )
    assert COSINES.hidden == "raise"


def test_takes_and_projections(tracker):
    takes, truth = [X[3], SEEN], [X[3], X[4]]
    display = TrackingDisplay.from_estimator(tracker, takes, truth=truth, take=1, smooth=True)
    np.testing.assert_array_equal(display.track.postures, tracker.smooth(takes)[1].postures)
    np.testing.assert_array_equal(display.truth, X[4])
    matrix, _ = COSINES.position_matrix()
    seen = X[4] @ matrix.T
    times = np.arange(len(seen)) / 15
    display = TrackingDisplay.from_estimator(tracker, seen, projection=matrix, times=times)
    assert display.observed is None
    assert display.phase_.get_xdata()[-1] == times[-1]


def test_from_estimator_refuses(tracker, display):
    for change, message in (
        ({"take": 1}, "take must be from 0 to 0"),
        ({"take": [0]}, "take must be one number from 0 to 0"),
        ({"features": "tail_x"}, "no feature 'tail_x'"),
        ({"truth": X[4][1:]}, "The truth must have the shape"),
        ({"names": ["one"]}, "names must be a list of text"),
    ):
        with pytest.raises(ValueError, match=message):
            TrackingDisplay.from_estimator(tracker, SEEN, **change)
    with pytest.raises(ValueError, match="There are 2 takes, but truth of 1"):
        TrackingDisplay.from_estimator(tracker, [SEEN, SEEN], truth=[X[4]])
    back = np.arange(len(SEEN))[::-1]
    with pytest.raises(ValueError, match="Performance 1: time stamps must increase"):
        TrackingDisplay.from_estimator(tracker, [SEEN, SEEN], take=1, times=[back, back])
    with pytest.raises(ValueError, match="cosines must be DirectionCosines, got int"):
        display.strip(1)
    with pytest.raises(ValueError, match="track must be the Track of one take"):
        TrackingDisplay.from_predictions([display.track])
