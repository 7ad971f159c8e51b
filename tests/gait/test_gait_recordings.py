"""Rows, frames and events of recordings, and walks whose positions and directions are known."""

from types import SimpleNamespace

import numpy as np
import pandas as pd
import pytest
from scipy.ndimage import gaussian_filter1d
from scipy.stats import norm
from sklearn_motionsync import Skeleton
from sklearn_motionsync.datasets import make_walk
from sklearn_motionsync.gait.recordings import Recordings, Walk, joints_of_feet

LEVELS = "subject", "trial", "frame"
COLUMNS = make_walk(1, n_strides=2, random_state=0).skeleton.column_names


def tables(units=("mm", "in")):
    """Every second frame from 4 on, of 100 a second; and frames 0 to 9."""
    out = []
    for label, unit, index in zip(
        [("a", 1), ("b", 2)], units, [range(4, 24, 2), range(10)], strict=True
    ):
        table = pd.DataFrame(np.zeros((10, 57)), list(index), COLUMNS)
        table.attrs |= {"frame_rate": 100.0, "units": unit, "trial": label, "levels": LEVELS}
        out.append(table)
    return out


def test_rows_frames_times_and_units_of_recordings():
    recordings = Recordings(tables())
    assert recordings.levels == ["subject", "trial"]
    np.testing.assert_allclose(recordings.frames_at(0, [0, 0.5, 9]), [4, 5, 22])
    np.testing.assert_allclose(recordings.times_at(0, [0, 0.5, 9]), [0.04, 0.05, 0.22])
    for row, frame in ((0.5, 5), (9, 22), (-0.7, 3.3), (9.4, 22.4)):
        assert recordings.row_of_frame(0, frame) == pytest.approx(row)
    assert recordings.row_of_time(0, 0.05) == pytest.approx(0.5)
    leg = SimpleNamespace(leg=2.0)
    assert [recordings.length_of_leg(i, leg) for i in range(2)] == [(0.002, "m"), (2.0, "")]
    leg = [Recordings(tables(("cm", "m"))).length_of_leg(i, leg) for i in range(2)]
    assert leg == [(0.02, "m"), (2.0, "m")]
    for rates in ([1.0, 10_000.0], 50):
        assert len(Recordings(tables(), frame_rate=rates)) == 2
    for rate in (0.99, 10_001):
        with pytest.raises(ValueError, match=f"has a frame rate of {rate:g}; recordings of people"):
            Recordings(tables(), frame_rate=[100, rate])


def test_events_of_a_table_go_to_their_recordings():
    columns = ["subject", "trial", "label", "context", "frame"]
    events = pd.DataFrame([
        ("b", 2, "Foot Off", "left", 9.5), ("b", 2, "Foot Off", " Right ", -0.5),
        ("a", 1, "Foot Strike", "LEFT", 5), ("a", 1, "Event", "Left", 5),
        ("a", 1, "Foot Off", "General", 5), ("b", 2, "Foot Off", "Left", np.nan),
    ], columns=columns)  # fmt: skip
    recordings = Recordings(tables())
    assert recordings.split_events(None) == [None, None]
    assert recordings.split_events(events) == [
        [("Foot Strike", "left", 0.5)],
        [("Foot Off", "right", -0.5), ("Foot Off", "left", 9.5)],
    ]
    seconds = events.assign(time=events["frame"] / 100).drop(columns="frame")
    (((_, _, row),), _) = recordings.split_events(seconds)
    assert row == pytest.approx(0.5)
    for frame in (-0.51, 9.51):
        with pytest.raises(ValueError, match=rf"Foot Off left at frame {frame} is outside of"):
            recordings.split_events(events.head(1).assign(frame=frame))
    with pytest.raises(ValueError, match=r"Foot Off left at time -0\.03 is outside of"):
        recordings.split_events(seconds.head(1).assign(time=-0.03))
    for name in ("trial", "context", "frame"):
        with pytest.raises(ValueError, match=f"there is no column '{name}'"):
            recordings.split_events(events.drop(columns=name))
    with pytest.raises(ValueError, match=r"recording \('b', 7\) is not in X, whose labels are"):
        recordings.split_events(events.head(1).assign(trial=7))
    one = Recordings(tables()[1:])
    assert one.split_events(events[:2].drop(columns="trial"))[0][1] == ("Foot Off", "left", 9.5)


# -- walks ---------------------------------------------------------------------------------------

NAMES = ["pelvis", "left_hip", "right_hip", "left_heel", "right_heel", "left_toe", "right_toe"]


def moving_points(t, toes=0.2):
    """Points of NAMES, cubic polynomials of time; hips are apart along x, toes ahead along z."""
    pelvis, left, right = (
        np.polynomial.polynomial.polyval(t / 4, np.random.default_rng(k).standard_normal((4, 3))).T
        for k in range(3)
    )
    pelvis[:, 1] += 20
    points = [pelvis, pelvis + [0.1, 0, 0], pelvis - [0.2, 0, 0], left, right]
    return np.stack([*points, left + [0, 0, toes], right + [0, 0, toes]], axis=1)


def walk_of(points, names=NAMES, *, frame_rate=60, landmarks=None, feet=None):
    """A walk by names of joints, the first three of which are landmarks."""
    landmarks = {(landmarks or {}).get(name, name): name for name in names[:3]}
    body = Skeleton(names, [-1] * len(names), landmarks, n_dims=points.shape[2])
    feet = joints_of_feet(body, feet)
    return Walk(points.reshape(len(points), -1), body, feet, frame_rate, "Walk")


@pytest.mark.parametrize("toes", [0.2, -0.2])
@pytest.mark.parametrize(("rate", "per_frame"), [(30, 8), (100, 3), (240, 1), (500, 1)])
def test_samples_between_frames_lie_on_cubic_polynomials(rate, per_frame, toes):
    n_frames = rate
    # A movement that runs backwards goes the other way.
    times = np.arange(n_frames) / rate if toes > 0 else np.arange(n_frames)[::-1] / rate
    walk = walk_of(moving_points(times, toes), frame_rate=rate)
    assert (walk.per_frame, walk.rate) == (per_frame, rate * per_frame)
    assert walk.n_samples == (n_frames - 1) * per_frame + 1
    times = np.linspace(times[0], times[-1], walk.n_samples)
    expected = moving_points(times, toes)
    leg = np.median(expected[:, 0, 1] - expected[:, 3:5, 1].min(axis=1))
    assert walk.leg == pytest.approx(leg, rel=1e-9)
    assert walk.has_heel == {"left": True, "right": True}
    expected /= leg
    high = expected[1:, 3:5, 1] - expected[1:, :1, 1]
    speed = np.diff(expected[:, 3:5, 2] - expected[:, :1, 2], axis=0)
    sense = np.sign(((high - high.mean(axis=0)) * speed).sum())
    np.testing.assert_allclose(walk.forward, np.tile([0, sense], (walk.n_samples, 1)), atol=1e-12)
    ends = [3, 4, 5, 6] if sense * toes > 0 else [5, 6, 3, 4]
    np.testing.assert_allclose(walk.pelvis, expected[:, 0], atol=1e-9)
    for k, end in zip(ends, [*walk.heels.values(), *walk.toes.values()], strict=True):
        np.testing.assert_allclose(end, expected[:, k], atol=1e-9)
    ahead = sense * (expected[:, 3] - expected[:, 0])[:, 2]
    np.testing.assert_allclose(walk.ahead(expected[:, 3]), ahead, atol=1e-9)


@pytest.mark.parametrize("order", [0, 1, 2])
def test_filtered_waves_have_the_response_of_a_gaussian(order):
    rate, width, frequency = 500, 0.02, 9.0
    t = np.arange(1000) / rate
    walk = walk_of(moving_points(t), frame_rate=rate)
    gain = np.exp(-((frequency * width) ** 2) / 2) * frequency**order
    waves = np.sin(np.outer(t, [frequency, 1]) + np.array([0, order * np.pi / 2]))
    found = walk.filtered(waves, width, order)[100:-100, 0]
    expected = gain * np.sin(frequency * t + order * np.pi / 2)[100:-100]
    np.testing.assert_allclose(found, expected, atol=0.02 * gain)
    waves[[4, 7, 11]] = np.nan
    found = walk.filtered(waves[:15, 0], width, order)
    assert np.flatnonzero(np.isnan(found)).tolist() == [4, 5, 6, 7, 11]


def test_gaps_of_a_fifth_of_a_second_are_filled_and_short_pieces_left_out():
    points = moving_points(np.arange(120) / 60)
    for first, last in [(20, 32), (47, 60), (75, 88), (102, 115)]:
        points[first:last, [3, 5]] = np.nan
    seen = ~np.isnan(walk_of(points).heels["left"]).any(axis=1)
    assert seen.nonzero()[0].tolist() == [*range(4 * 46 + 1), *range(4 * 60, 4 * 74 + 1)]
    for rate, n_frames in ((60, 15), (10, 4)):
        walk_of(points[:n_frames], frame_rate=rate)
        with pytest.raises(ValueError, match=f"Walk has {n_frames - 1} frames"):
            walk_of(points[: n_frames - 1], frame_rate=rate)


def test_noise_of_heels_is_that_of_their_heights():
    points, rng = moving_points(np.arange(600) / 60), np.random.default_rng(0)
    points[:, 3:5, 1] = [0.01, 0.03] * rng.standard_normal((600, 2))
    points[100:110, 3] = np.nan
    walk = walk_of(points)
    for side, heights in zip(("left", "right"), points[:, 3:5, 1].T, strict=True):
        third = np.abs(heights[3:] - 3 * heights[2:-1] + 3 * heights[1:-2] - heights[:-3])
        expected = np.nanpercentile(third, 25) / norm.ppf(0.625) / np.sqrt(1 + 9 + 9 + 1)
        assert walk.noise[side] * walk.leg == pytest.approx(expected, rel=1e-3)
    points[::3, 3] = np.nan
    assert walk_of(points).noise["left"] == 0


def test_hidden_markers_keep_their_way_from_the_others():
    t = np.arange(100) / 60
    points = moving_points(t)
    beside = points[:, 3] + np.outer(np.clip(t, 0.25, 1.2), [0.1, 0.2, 0.3]) + 0.1
    never = np.full_like(beside, np.nan)
    points = np.concatenate([points, np.stack([beside, never], axis=1)], axis=1)
    names, feet = [*NAMES, "beside", "never"], {"left_heel": ("left_heel", "beside", "never")}
    whole = walk_of(points, names, feet=feet)
    np.testing.assert_allclose(
        whole.heels["left"][::4] * whole.leg, (points[:, 3] + beside) / 2, atol=1e-9
    )
    for k, first, last in ((7, 30, 60), (3, 30, 60), (7, 0, 10), (7, 80, 100)):
        hidden = points.copy()
        hidden[first:last, k] = np.nan
        walk = walk_of(hidden, names, feet=feet)
        np.testing.assert_allclose(walk.heels["left"], whole.heels["left"], atol=1e-9)


def test_directions():
    """Across hips or shoulders, else along the feet, else where they come apart."""
    points = moving_points(np.arange(400) / 100)
    turns = 0.8 * np.sin(np.arange(400) / 60)
    across = np.column_stack([np.cos(turns), 0 * turns, np.sin(turns)])
    points[:, 1], points[:, 2] = points[:, 0] + across, points[:, 0] - across
    finer = np.interp(np.arange(1198) / 3, np.arange(400), turns)
    expected = gaussian_filter1d(np.column_stack([-np.sin(finer), np.cos(finer)]), 60, axis=0)
    expected /= np.linalg.norm(expected, axis=1, keepdims=True)
    shoulders = [name.replace("hip", "shoulder") for name in NAMES]
    for names in (NAMES, shoulders):
        found = walk_of(points, names, frame_rate=100).forward[300:-300]
        found = found * np.sign(found[0] @ expected[300])
        np.testing.assert_allclose(found, expected[300:-300], atol=1e-3)
    points[:, 5:] = points[:, 3:5] + [[0.3, 0.2, 0.4], [0.6, -0.1, 0.8]]
    knee = {"right_hip": "left_knee"}
    along = walk_of(points, landmarks=knee, frame_rate=100).forward
    np.testing.assert_allclose(np.abs(along), np.tile([0.6, 0.8], (len(along), 1)), atol=1e-9)
    points[:, 3:5] = points[:, :1] + np.sin(np.arange(800)).reshape(400, 2, 1) * [0.8, 1.0, -0.6]
    points[:, 3:5] += [1.5, -3, 2]
    no_toes = {"left_toe": None, "right_toe": None}
    apart = walk_of(points, landmarks=knee, frame_rate=100, feet=no_toes).forward
    apart = apart * np.sign(apart[:, :1])
    np.testing.assert_allclose(apart, np.tile([0.8, -0.6], (len(apart), 1)), atol=1e-9)
