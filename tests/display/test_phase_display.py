"""PhaseDisplay: its artists agree with the estimator."""

import numpy as np
import pandas as pd
import pytest
from artists import ends_of_bones
from sklearn.pipeline import make_pipeline
from sklearn_motionsync import ASpace, DirectionCosines, LinearSynchronizer
from sklearn_motionsync.datasets import make_bending, make_gait
from sklearn_motionsync.display import PhaseDisplay
from sklearn_motionsync.live import OnlineSynchronizer

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
        live, X[6:], names=["6", "7"], training=X[:6], body=COSINES, features="neck_z", frame=FRAME
    )


def test_artists_agree_with_the_estimator(live, display):
    last = live.n_frames_ - 1
    k = list(COSINES.get_feature_names_out()).index("neck_z")
    for row, x, expected in zip(display.rows_, X[6:], live.track(X[6:]), strict=True):
        past = slice(FRAME + 1)
        times = np.arange(len(x)) / RATE
        np.testing.assert_allclose(row.phase.get_xdata(), times[past])
        np.testing.assert_allclose(row.phase.get_ydata(), 100 * expected.phase[past] / last)
        surface = row.confidence.get_paths()[0].vertices
        np.testing.assert_allclose(surface[past, 1], 100 * expected.confidence[past])
        # One way along the upper bounds, and back along the lower ones.
        band = row.interval.get_paths()[0].vertices[: 2 * (FRAME + 1), 1]
        bounds = np.concatenate([expected.upper[past], expected.lower[past][::-1]])
        np.testing.assert_allclose(band, 100 * bounds / last)
        # The final phases of a linear synchronizer are a straight line.
        np.testing.assert_allclose(
            row.afterwards.get_ydata(), np.linspace(0, 100, len(x)), atol=1e-6
        )
        share = expected.phase[FRAME] / last
        assert row.dial.share.get_text() == f"{100 * share:.0f} %"
        assert row.dial.passed.theta1 == pytest.approx(90 - 360 * share)
        soon = min(share + expected.rate[FRAME] / 10, 1)
        assert row.dial.ahead.theta1 == pytest.approx(90 - 360 * soon)
        (curve,) = row.curves
        np.testing.assert_array_equal(curve.seen.get_ydata(), x[past, k])
        np.testing.assert_array_equal(curve.to_come.get_ydata(), x[:, k])
        now = np.interp(expected.phase[FRAME], np.arange(last + 1), live.mean_[:, k])
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


def test_prediction_lasts_as_long_as_time_left(live, display):
    live.reset()
    for frame in X[6][: FRAME + 1]:
        live.step(frame)
    left = live.time_left()
    live.reset()
    for line in (display.rows_[0].rest, display.rows_[0].curves[0].expected):
        times = line.get_xdata()
        assert times[-1] - times[0] == pytest.approx(left)


def test_bones_are_at_the_joints(live, display):
    """In the view from the right and the front, by 60 degrees from the front."""
    display = PhaseDisplay.from_estimator(live, X[6], body=COSINES, frame=FRAME)
    joints = COSINES.inverse_transform(X[6])[FRAME].reshape(-1, 3)
    skeleton = COSINES.skeleton
    knee, ankle = (skeleton.joints.index(f"left_{name}") for name in ("knee", "ankle"))
    x, y, z = joints[[knee, ankle]].T
    bone = np.column_stack([x / 2 + z * np.sqrt(3) / 2, y])
    segments = np.round(ends_of_bones(display.rows_[0].body.bones["left"]), 9).tolist()
    assert np.round(bone, 9).tolist() in segments


def test_other_frames_and_animation(live, display):
    axes, shown = display.axes_, display.rows_[0]
    assert display.plot(axes, frame=0).axes_ == axes
    assert [row.dial.share.get_text() for row in display.rows_] == ["0 %", "0 %"]
    # In the last frame the shorter trial has ended.
    display.plot(axes)
    times = [row.phase.get_xdata()[-1] for row in display.rows_]
    np.testing.assert_allclose(times, [(len(x) - 1) / RATE for x in X[6:]])
    assert len(display.rows_[0].rest.get_xdata()) == 0
    assert shown is not display.rows_[0]
    display = PhaseDisplay.from_estimator(live, X[6:7])
    animation = display.animate(seconds=0.2, fps=10)
    assert animation.to_jshtml().count("data:image") == 2
    assert len(display.rows_[0].phase.get_xdata()) == len(X[6])


def test_unknown_values_are_not_drawn(live):
    """Gaps, time stamps, tables, and univariate rows."""
    x = X[6].copy()
    x[10:20, :5] = np.nan
    times = np.arange(len(x)) / 25 + 3
    given = {"times": times, "features": 0, "names": ["half seen"], "xlabel": "since the start"}
    display = PhaseDisplay.from_estimator(live, x, ylabel="pelvis", units="legs", **given)
    assert display.axes_[2].get_ylabel() == "pelvis (legs)"
    (row,) = display.rows_
    assert row.afterwards is None
    assert np.isnan(row.curves[0].seen.get_ydata()[10:20]).all()
    assert row.phase.get_xdata()[-1] == pytest.approx((len(x) - 1) / 25)
    assert display.axes_[1].get_xlabel() == "since the start"
    table = pd.concat([pd.DataFrame(x) for x in X], keys=list("abcdefgh"))
    rows = PhaseDisplay.from_estimator(live, table).rows_
    assert [row.axes[0].get_title() for row in rows] == list("abcd")
    with pytest.raises(ValueError, match="got 2-D or other input"):
        PhaseDisplay.from_estimator(live, X[6][:, 0])


def test_hidden_limbs_are_gaps(live):
    """Cosines hide single limbs; points of a space depend on all limbs and hide the body."""
    x = X[6].copy()
    names = list(COSINES.get_feature_names_out())
    x[20:30, [names.index(f"left_leg_{axis}") for axis in "xyz"]] = np.nan
    row = PhaseDisplay.from_estimator(live, x, body=COSINES, frame=FRAME, features=0).rows_[0]
    gaps = {
        side: np.isnan(ends_of_bones(row.body.bones[side])).any(axis=(1, 2)).sum()
        for side in ("left", "right")
    }
    assert gaps == {"left": 1, "right": 0}
    space = make_pipeline(DirectionCosines(BUNCH.skeleton), ASpace()).fit(BUNCH.data[:6])
    points = space.transform(BUNCH.data)
    on_space = OnlineSynchronizer(LinearSynchronizer(50)).fit(points[:6])
    points[6][FRAME, 0] = np.nan
    display = PhaseDisplay.from_estimator(on_space, points[6], body=space, frame=FRAME)
    for frame, nothing in ((FRAME, True), (FRAME + 1, False)):
        bones = display.plot(display.axes_, frame=frame).rows_[0].body.bones["left"]
        assert np.isnan(ends_of_bones(bones)).all() == nothing


def test_titles_and_predictions_fit_into_the_figure(live):
    name = "a name that is longer than its panel is wide, for $5"
    display = PhaseDisplay.from_estimator(live, X[6], names=[name], features=[0, 1])
    row = display.rows_[0]
    assert [axis.get_legend() is None for axis in display.axes_] == [True, False, False, True]
    display.figure_.draw_without_rendering()
    extent = row.axes[0].title.get_window_extent()
    assert extent.x0 >= 0
    assert extent.y1 <= display.figure_.bbox.y1
    # A trial that stops has not ended, and the axis holds the time that it still needs.
    stops = np.concatenate([X[6][:30], np.repeat(X[6][30:31], 40, axis=0)])
    (row,) = PhaseDisplay.from_estimator(live, stops).rows_
    assert row.rest.get_xdata()[-1] > 69 / RATE
    assert row.axes[1].get_xlim()[1] > row.rest.get_xdata()[-1]


def test_cycles_are_drawn_round_by_round():
    strides, walk = make_gait(4, random_state=0), make_gait(5, 8, takes=True, random_state=0)
    live = OnlineSynchronizer(LinearSynchronizer(50), frame_rate=100, cyclic=True)
    live.fit(strides.data)
    x, frame = walk.data[4], 700
    (found,) = live.track([x])
    display = PhaseDisplay.from_estimator(live, x, features=1, frame=frame)
    (row,) = display.rows_
    times, phase, past = np.arange(len(x)) / 100, 100 * found.phase / 49, slice(frame + 1)
    # A line and a band for each cycle.
    ys = row.phase.get_ydata()
    assert np.isnan(ys).sum() == found.cycle[frame] == len(row.interval.get_paths()) - 1
    np.testing.assert_allclose(ys[~np.isnan(ys)], phase[past])
    assert row.afterwards is None
    assert row.dial.state.get_text().startswith(f"cycle {found.cycle[frame]}, rate ")
    # Beyond the end of the cycle the arc goes on.
    near_end = int(np.flatnonzero((found.phase > 47) & (times > 3))[0])
    display.plot(display.axes_, frame=near_end)
    (row,) = display.rows_
    share, rate = found.phase[near_end] / 49, found.rate[near_end]
    assert row.dial.ahead.theta1 == pytest.approx(90 - 360 * (share + rate / 10))
    assert share + rate / 10 > 1
    for one in x[: near_end + 1]:
        live.step(one)
    rest = row.rest.get_xdata()
    assert rest[-1] - rest[0] == pytest.approx(live.time_left())
    assert row.rest.get_ydata()[-1] == 100
    # The axis shows the last cycles.
    stop = times[near_end] + live.duration_ / 100
    for axis in row.axes[1:]:
        assert axis.get_xlim() == pytest.approx((max(0, stop - 5 * live.duration_ / 100), stop))


def test_a_second_attempt_is_another_line(live):
    x = np.concatenate([X[6][:30], X[6]])
    (found,) = live.track([x])
    (row,) = PhaseDisplay.from_estimator(live, x).rows_
    assert found.cycle[-1] == np.isnan(row.phase.get_ydata()).sum() == 1
    assert "cycle" not in row.dial.state.get_text()


def test_from_estimator_refuses(live):
    for change, message in (
        ({"features": "tail_x"}, "no feature 'tail_x'"),
        ({"frame": 900}, "frame must be from 0 to"),
        ({"frame": [1, 2]}, "frame must be one number from 0 to"),
        ({"times": [np.arange(3)]}, "times"),
        ({"times": [np.arange(3)] * 8}, "Trial 0: times must be one a"),
        ({"names": ["one"]}, "names must be a list of text"),
    ):
        with pytest.raises(ValueError, match=message):
            PhaseDisplay.from_estimator(live, X, **change)
    with pytest.raises(ValueError, match="Found 0 trials"):
        PhaseDisplay.from_estimator(live, [])
