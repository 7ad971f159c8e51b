"""PhaseDisplay: its artists agree with the estimator."""

import numpy as np
import pandas as pd
import pytest
from artists import edges, ends_of_bones, texts
from sklearn.pipeline import make_pipeline
from sklearn_motionsync import ASpace, DirectionCosines, LinearSynchronizer
from sklearn_motionsync.datasets import make_bending, make_gait
from sklearn_motionsync.display import PhaseDisplay
from sklearn_motionsync.live import OnlineSynchronizer

BUNCH = make_bending(8, n_frames=60, n_actors=2, random_state=0)
COSINES = DirectionCosines(BUNCH.skeleton).fit(BUNCH.data[:6])
NAMES = list(COSINES.get_feature_names_out())
X = COSINES.transform(BUNCH.data)
RATE, FRAME = 50, 25


@pytest.fixture(scope="module")
def live():
    return OnlineSynchronizer(LinearSynchronizer(50), frame_rate=RATE).fit(X[:6])


def drawn(live, x=X[6], **given):
    """The display of one trial, and its row."""
    display = PhaseDisplay.from_estimator(live, x, **given)
    return display, display.rows_[0]


def test_artists_agree_with_the_estimator(live):
    given = {"body": COSINES, "features": "neck_z", "frame": FRAME}
    display = PhaseDisplay.from_estimator(live, X[6:], names=["6", "7"], **given)
    last, k, past = live.n_frames_ - 1, NAMES.index("neck_z"), slice(FRAME + 1)
    for row, x, expected in zip(display.rows_, X[6:], live.track(X[6:]), strict=True):
        np.testing.assert_allclose(row.phase.get_xdata(), np.arange(FRAME + 1) / RATE)
        np.testing.assert_allclose(row.phase.get_ydata(), 100 * expected.phase[past] / last)
        percent = np.stack([expected.lower, expected.upper])[:, past] * 100 / last
        np.testing.assert_allclose(edges(row.interval), percent)
        np.testing.assert_allclose(edges(row.confidence)[1], 100 * expected.confidence[past])
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
        # The prediction lasts as long as the time left.
        live.reset()
        for frame in x[past]:
            live.step(frame)
        for line in (row.rest, curve.expected):
            assert np.ptp(line.get_xdata()) == pytest.approx(live.time_left())
    assert [display.axes_[i].get_title() for i in (0, 4)] == ["6", "7"]
    assert len(display.axes_) == 8
    assert display.axes_[-1].get_ylabel() == "neck_z"
    assert texts(display.axes_[2]) == ["confidence", "90 % band", "predicted", "phase"]


def test_bones_are_at_the_joints(live):
    """In the view from the right and the front, by 60 degrees from the front."""
    _, row = drawn(live, body=COSINES, frame=FRAME)
    joints = COSINES.inverse_transform(X[6])[FRAME].reshape(-1, 3)
    skeleton = COSINES.skeleton
    knee, ankle = (skeleton.joints.index(f"left_{name}") for name in ("knee", "ankle"))
    x, y, z = joints[[knee, ankle]].T
    bone = np.column_stack([x / 2 + z * np.sqrt(3) / 2, y])
    segments = np.round(ends_of_bones(row.body.bones["left"]), 9).tolist()
    assert np.round(bone, 9).tolist() in segments


def test_other_moments_and_animation(live):
    display = PhaseDisplay.from_estimator(live, X[6:], frame=0)
    assert [row.dial.share.get_text() for row in display.rows_] == ["0 %", "0 %"]
    # In the last frame the shorter trial has ended.
    animation = display.animate(seconds=0.2, fps=10)
    assert animation.to_jshtml().count("data:image") == 2
    times = [row.phase.get_xdata()[-1] for row in display.rows_]
    np.testing.assert_allclose(times, [(len(x) - 1) / RATE for x in X[6:]])
    assert len(display.rows_[0].rest.get_xdata()) == 0
    areas = [area for axis in display.axes_ for area in axis.collections]
    assert len(areas) == 4, "those of earlier pictures are gone"


def test_unknown_values_are_not_drawn(live):
    """Gaps, time stamps, tables, and univariate rows."""
    x = X[6].copy()
    x[10:20, :5] = np.nan
    times = np.arange(len(x)) / 25 + 3
    display, row = drawn(live, x, times=times, features=0, names=["half seen"], units="legs")
    assert display.axes_[2].get_ylabel() == "x0 (legs)"
    assert np.isnan(row.curves[0].seen.get_ydata()[10:20]).all()
    assert row.phase.get_xdata()[-1] == pytest.approx((len(x) - 1) / 25)
    assert display.axes_[1].get_xlabel() == "time (s)"
    table = pd.concat([pd.DataFrame(x) for x in X], keys=list("abcdefgh"))
    rows = PhaseDisplay.from_estimator(live, table).rows_
    assert [row.axes[0].get_title() for row in rows] == list("abcd")
    with pytest.raises(ValueError, match="got 2-D or other input"):
        PhaseDisplay.from_estimator(live, X[6][:, 0])


def test_hidden_limbs_are_gaps(live):
    """Cosines hide single limbs; points of a space depend on all limbs and hide the body."""
    x = X[6].copy()
    x[20:30, [NAMES.index(f"left_leg_{axis}") for axis in "xyz"]] = np.nan
    _, row = drawn(live, x, body=COSINES, frame=FRAME, features=0)
    hidden = [np.isnan(ends_of_bones(row.body.bones[side])).any((1, 2)) for side in row.body.bones]
    assert [of_side.sum() for of_side in hidden] == [1, 0, 0]
    space = make_pipeline(DirectionCosines(BUNCH.skeleton), ASpace()).fit(BUNCH.data[:6])
    points = space.transform(BUNCH.data)
    on_space = OnlineSynchronizer(LinearSynchronizer(50)).fit(points[:6])
    points[6][FRAME, 0] = np.nan
    for frame, nothing in ((FRAME, True), (FRAME + 1, False)):
        _, row = drawn(on_space, points[6], body=space, frame=frame)
        assert np.isnan(ends_of_bones(row.body.bones["left"])).all() == nothing


def test_titles_and_predictions_fit_into_the_figure(live):
    name = "a name that is longer than its panel is wide, for $5"
    display, row = drawn(live, names=[name], features=[0, 1])
    assert [axis.get_legend() is None for axis in display.axes_] == [True, False, False, True]
    display.figure_.draw_without_rendering()
    extent = row.axes[0].title.get_window_extent()
    assert extent.x0 >= 0
    assert extent.y1 <= display.figure_.bbox.y1
    # A trial that stops has not ended, and the axis holds the time that it still needs.
    stops = np.concatenate([X[6][:30], np.repeat(X[6][30:31], 40, axis=0)])
    _, row = drawn(live, stops)
    assert row.rest.get_xdata()[-1] > 69 / RATE
    assert row.axes[1].get_xlim()[1] > row.rest.get_xdata()[-1]


def test_cycles_are_drawn_round_by_round():
    strides, walk = make_gait(4, random_state=0), make_gait(5, 8, takes=True, random_state=0)
    live = OnlineSynchronizer(LinearSynchronizer(50), frame_rate=100, cyclic=True)
    live.fit(strides.data)
    x, frame = walk.data[4], 700
    (found,) = live.track([x])
    _, row = drawn(live, x, features=1, frame=frame)
    times, phase, past = np.arange(len(x)) / 100, 100 * found.phase / 49, slice(frame + 1)
    # A line and a band for each cycle.
    ys = row.phase.get_ydata()
    assert np.isnan(ys).sum() == found.cycle[frame] == len(row.interval.get_paths()) - 1
    np.testing.assert_allclose(ys[~np.isnan(ys)], phase[past])
    assert row.dial.state.get_text().startswith(f"cycle {found.cycle[frame]}, rate ")
    # Beyond the end of the cycle the arc goes on.
    near_end = int(np.flatnonzero((found.phase > 47) & (times > 3))[0])
    _, row = drawn(live, x, features=1, frame=near_end)
    ahead = found.phase[near_end] / 49 + found.rate[near_end] / 10
    assert row.dial.ahead.theta1 == pytest.approx(90 - 360 * ahead)
    assert ahead > 1
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
    _, row = drawn(live, x)
    assert found.cycle[-1] == np.isnan(row.phase.get_ydata()).sum() == 1
    assert "cycle" not in row.dial.state.get_text()


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"features": "tail_x"}, "no feature 'tail_x'"),
        ({"frame": 900}, "frame must be from 0 to"),
        ({"frame": [1, 2]}, "frame must be one number from 0 to"),
        ({"times": [np.arange(3)]}, "times"),
        ({"times": [np.arange(3)] * 8}, "Trial 0: times must be one a"),
        ({"names": ["one"]}, "names must be a list of text"),
        ({"X": []}, "Found 0 trials"),
    ],
)
def test_from_estimator_refuses(live, change, message):
    with pytest.raises(ValueError, match=message):
        PhaseDisplay.from_estimator(live, **({"X": X} | change))
