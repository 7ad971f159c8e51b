"""What the display of running performances draws, read back from its artists."""

import matplotlib.pyplot as plt
import numpy as np
import pandas as pd
import pytest
from sklearn.exceptions import NotFittedError
from sklearn.pipeline import make_pipeline
from sklearn_motionsync import (
    ASpace,
    DirectionCosines,
    LinearSynchronizer,
    LivePhase,
    OnlineSynchronizer,
)
from sklearn_motionsync.datasets import make_bending
from sklearn_motionsync.display import PhaseDisplay

BUNCH = make_bending(8, n_frames=60, n_actors=2, random_state=0)
COSINES = DirectionCosines(BUNCH.skeleton).fit(BUNCH.data[:6])
X = COSINES.transform(BUNCH.data)
RATE, FRAME = 50, 25


@pytest.fixture(scope="module")
def live():
    return OnlineSynchronizer(LinearSynchronizer(50), frame_rate=RATE).fit(X[:6])


@pytest.fixture(scope="module")
def display(live):
    return PhaseDisplay.from_estimator(
        live, X, performances=[6, 7], training=X[:6], body=COSINES, features="neck_z", frame=FRAME
    )


def test_it_draws_what_was_said(live, display):
    last = live.n_frames_ - 1
    k = list(COSINES.get_feature_names_out()).index("neck_z")
    for row, x, said in zip(display.rows_, X[6:], live.track(X[6:]), strict=True):
        past = slice(FRAME + 1)
        times = np.arange(len(x)) / RATE
        np.testing.assert_allclose(row.phase.get_xdata(), times[past])
        np.testing.assert_allclose(row.phase.get_ydata(), 100 * said.phase[past] / last)
        surface = row.confidence.get_paths()[0].vertices
        np.testing.assert_allclose(surface[past, 1], 100 * said.confidence[past])
        # With a linear synchronizer the path that is known afterwards is a straight line.
        np.testing.assert_allclose(
            row.afterwards.get_ydata(), np.linspace(0, 100, len(x)), atol=1e-6
        )
        share = said.phase[FRAME] / last
        assert row.dial.share.get_text() == f"{100 * share:.0f} %"
        assert row.dial.passed.theta1 == pytest.approx(90 - 360 * share)
        soon = min(share + said.rate[FRAME] / 10, 1)
        assert row.dial.ahead.theta1 == pytest.approx(90 - 360 * soon)
        (curve,) = row.curves
        np.testing.assert_array_equal(curve.seen.get_ydata(), x[past, k])
        np.testing.assert_array_equal(curve.to_come.get_ydata(), x[:, k])
        now = np.interp(said.phase[FRAME], np.arange(last + 1), live.mean_[:, k])
        ends = curve.expected.get_ydata()[[0, -1]]
        np.testing.assert_allclose(ends, [now, live.mean_[-1, k]])
        clock = np.linspace(0, 1, last + 1)
        warped = [np.interp(clock, np.linspace(0, 1, len(y)), y[:, k]) for y in X[:6]]
        end = live.mean_[-1, k] + 1.645 * np.array([1, -1]) * np.std(warped, axis=0)[-1]
        vertices = curve.band.get_paths()[0].vertices
        n = len(curve.expected.get_xdata())
        np.testing.assert_allclose(vertices[[n - 1, n], 1], end)
    titles = [display.axes_[i].get_title() for i in (0, 4)]
    assert (titles, len(display.axes_)) == (["6", "7"], 8)
    assert display.axes_[-1].get_ylabel() == "neck_z"


def test_the_rest_is_as_long_as_the_estimator_guesses(live, display):
    live.reset()
    for frame in X[6][: FRAME + 1]:
        live.step(frame)
    left = live.time_left()
    live.reset()
    for line in (display.rows_[0].rest, display.rows_[0].curves[0].expected):
        times = line.get_xdata()
        assert times[-1] - times[0] == pytest.approx(left)


def test_bodies_stand_where_their_joints_are(live, display):
    """Seen from the left, z is to the left and y up."""
    display = PhaseDisplay.from_estimator(live, X[6], body=COSINES, frame=FRAME, azimuth=90)
    joints = COSINES.inverse_transform(X[6])[FRAME].reshape(-1, 3)
    skeleton = COSINES.skeleton
    knee, ankle = (skeleton.joints.index(f"left_{name}") for name in ("knee", "ankle"))
    segments = np.round(display.rows_[0].figure.bones["left"].get_segments(), 9).tolist()
    assert np.round(joints[[knee, ankle]][:, [2, 1]] * [-1, 1], 9).tolist() in segments


def test_at_other_frames_and_in_motion(live, display):
    axes, shown = display.axes_, display.rows_[0]
    assert display.plot(axes, frame=0).axes_ == axes
    assert [row.dial.share.get_text() for row in display.rows_] == ["0 %", "0 %"]
    # The last: the shorter one has stopped where it ended.
    display.plot(axes)
    times = [row.phase.get_xdata()[-1] for row in display.rows_]
    np.testing.assert_allclose(times, [(len(x) - 1) / RATE for x in X[6:]])
    assert len(display.rows_[0].rest.get_xdata()) == 0
    assert shown is not display.rows_[0]
    display = PhaseDisplay.from_predictions(live.track(X[6:7]), live.n_frames_)
    animation = display.animate(seconds=0.2, fps=10)
    assert animation.to_jshtml().count("data:image") == 2
    assert len(display.rows_[0].phase.get_xdata()) == len(X[6])


def test_what_is_not_known_is_not_drawn(live):
    """Gaps, streams, time stamps, rows, and phases without anything else."""
    x = X[6].copy()
    x[10:20, :5] = np.nan
    times = np.arange(len(x)) / 25 + 3
    display = PhaseDisplay.from_estimator(live, x, times=times, features=0, names=["half seen"])
    (row,) = display.rows_
    assert row.afterwards is None
    assert np.isnan(row.curves[0].seen.get_ydata()[10:20]).all()
    assert row.phase.get_xdata()[-1] == pytest.approx((len(x) - 1) / 25)
    assert display.axes_[1].get_xlabel() == "time (s)"
    live.reset()
    for frames in zip(X[6], X[7], strict=False):
        live.step(frames)
    assert repr(PhaseDisplay(live.history, live.n_frames_)) == "PhaseDisplay(2 performances)"
    live.reset()
    rows = np.array([np.sin(np.linspace(0, size, 30)) for size in (3, 3.1, 3.2)])
    univariate = OnlineSynchronizer(LinearSynchronizer()).fit(rows)
    table = pd.DataFrame(rows, index=list("abc"))
    (row,) = PhaseDisplay.from_estimator(univariate, table, performances=2, training=rows).rows_
    np.testing.assert_array_equal(row.curves[0].to_come.get_ydata(), rows[2])
    assert row.axes[0].get_title() == "c"
    with pytest.raises(ValueError, match=r"2-D; got an array of shape \(30,\)"):
        PhaseDisplay.from_estimator(univariate, rows[0])


def test_bodies_have_gaps_where_they_are_not_seen(live):
    """Limb by limb; of points of a space, which come from all limbs, the whole body."""
    x = X[6].copy()
    names = list(COSINES.get_feature_names_out())
    x[20:30, [names.index(f"left_leg_{axis}") for axis in "xyz"]] = np.nan
    row = PhaseDisplay.from_estimator(live, x, body=COSINES, frame=FRAME, features=0).rows_[0]
    gaps = {
        side: sum(np.isnan(path.vertices).any() for path in row.figure.bones[side].get_paths())
        for side in ("left", "right")
    }
    assert gaps == {"left": 1, "right": 0}
    space = make_pipeline(DirectionCosines(BUNCH.skeleton), ASpace()).fit(BUNCH.data[:6])
    points = space.transform(BUNCH.data)
    on_space = OnlineSynchronizer(LinearSynchronizer(50)).fit(points[:6])
    points[6][FRAME, 0] = np.nan
    display = PhaseDisplay.from_estimator(on_space, points[6], body=space, frame=FRAME)
    for frame, nothing in ((FRAME, True), (FRAME + 1, False)):
        bones = display.plot(display.axes_, frame=frame).rows_[0].figure.bones["left"]
        assert all(np.isnan(path.vertices).all() == nothing for path in bones.get_paths())


def test_names_and_the_last_guess_have_room(live):
    name = "a name that is longer than its panel is wide, for $5"
    display = PhaseDisplay.from_estimator(live, X[6], names=[name], features=[0, 1])
    row = display.rows_[0]
    assert [axis.get_legend() is None for axis in display.axes_] == [True, False, False, True]
    display.figure_.draw_without_rendering()
    extent = row.axes[0].title.get_window_extent()
    assert extent.x0 >= 0
    assert extent.y1 <= display.figure_.bbox.y1
    # Who stops is expected to need half of what is left.
    stops = LivePhase(np.full(90, 25), np.zeros(90), np.ones(90))
    (row,) = PhaseDisplay.from_predictions(stops, 51, duration=60).rows_
    assert row.rest.get_xdata()[-1] == 89 + 15
    assert row.axes[1].get_xlim()[1] > 89 + 15
    PhaseDisplay.from_predictions(LivePhase([0], [1], [1]), 51)


def test_what_is_refused(live):
    for change, message in (
        ({"performances": 8}, "performances must be from 0 to 7"),
        ({"features": "tail_x"}, "no feature 'tail_x'"),
        ({"frame": 900}, "frame must be from 0 to"),
        ({"frame": [1, 2]}, "frame must be one number from 0 to"),
        ({"times": [np.arange(3)]}, "There are 8 performances, but times of 1"),
        ({"times": 3}, "There are 8 performances, but times of 3"),
        ({"times": [np.arange(3)] * 8, "performances": 5}, "Performance 5: times must be one a"),
        ({"names": ["one"]}, "names must be a list of text"),
    ):
        with pytest.raises(ValueError, match=message):
            PhaseDisplay.from_estimator(live, X, **change)
    with pytest.raises(ValueError, match="estimator must be an OnlineSynchronizer, got int"):
        PhaseDisplay.from_estimator(1, X)
    with pytest.raises(NotFittedError):
        PhaseDisplay.from_estimator(OnlineSynchronizer(), X)
    with pytest.raises(ValueError, match="Found 0 performances"):
        PhaseDisplay.from_estimator(live, [])
    body = np.zeros((3, len(BUNCH.skeleton.joints), 3))
    moving = {"bodies": [body], "skeleton": BUNCH.skeleton}
    rates, sure = [1, 1, 1], [1, 0.5, 0.2]
    good, rows = LivePhase([0, 1, 2], rates, sure), np.zeros((3, 1))
    for phases, known, message in (
        ([1], {}, "phases must be a LivePhase"),
        (LivePhase([0, 1, 50], rates, sure), {}, "Performance 0: the phase must be from 0 to 49"),
        (LivePhase([0, 1, 2], [1, 1], sure), {}, "Performance 0: the rate must have the shape"),
        (good, {"times": [[0, 2, 1]]}, "times must increase"),
        (good, {"seen": [np.zeros((2, 1))]}, "Performance 0: seen must have the shape"),
        (good, {"seen": [rows], "mean": np.zeros((3, 1))}, "The mean must have the shape"),
        (good, {"mean": np.zeros((50, 1))}, "mean is of what is drawn; give seen, too"),
        (good, {"seen": [rows], "spread": np.zeros((50, 1))}, "spread is of what is drawn"),
        ([good, good], {"seen": [rows, np.zeros((3, 2))]}, "Performance 1: seen must have"),
        (good, moving, "give mean_body and skeleton"),
        (good, moving | {"mean_body": body}, "The mean body must have the shape"),
        (good, moving | {"bodies": [body[1:]], "mean_body": body}, "Performance 0: bodies must"),
        (good, {"duration": 0}, "duration must be"),
        (good, {"unit": "hours"}, "unit must be one of"),
    ):
        with pytest.raises(ValueError, match=message):
            PhaseDisplay(phases, 50, **known)
    with pytest.raises(ValueError, match="n_frames must be"):
        PhaseDisplay(good, 1)
    plt.close("all")
