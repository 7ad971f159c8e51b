"""OnlineSynchronizer: the phase of running performances, against what is known of them."""

import copy
import pickle

import numpy as np
import pandas as pd
import pytest
from sklearn.base import clone
from sklearn_motionsync import DenseSynchronizer, LinearSynchronizer, OnlineSynchronizer
from sklearn_motionsync.matching.causal import CausalDerivative
from sklearn_motionsync.matching.costs import step_table
from sklearn_motionsync.matching.matcher import Features
from sklearn_motionsync.matching.trellis import Trellis
from sklearn_motionsync.matching.units import Unit
from sklearn_motionsync.online.features import LiveFeatures
from sklearn_motionsync.online.stream import UNKNOWN, Course, Stream

P = 60


def movement(phase):
    """Three features of a movement from phase 0 to 1, whose every moment tells itself."""
    phase = np.asarray(phase)[..., np.newaxis]
    return np.concatenate(
        [np.cos(np.pi * phase), np.sin(2 * np.pi * phase), np.sin(np.pi * phase) ** 2], axis=-1
    )


def performed(n_frames, bend=0.0, noise=0.0, seed=0):
    """A performance and the phase of its frames, from 0 to 1."""
    t = np.linspace(0, 1, n_frames)
    phase = t + bend * np.sin(2 * np.pi * t) / (2 * np.pi)
    rng = np.random.default_rng(seed)
    return movement(phase) + noise * rng.standard_normal((n_frames, 3)), phase


@pytest.fixture(scope="module")
def live():
    bends = np.linspace(-0.4, 0.4, 9)
    X = [performed(50 + 5 * (i % 5), b, 0.02, i)[0] for i, b in enumerate(bends)]
    return OnlineSynchronizer(DenseSynchronizer(P)).fit(X)


def runs(live, frames, times=None):
    live = copy.deepcopy(live)
    live.reset()
    times = [None] * len(frames) if times is None else times
    return [live.step(x, t) for x, t in zip(frames, times, strict=True)], live


def error(found, phase):
    return np.abs(np.asarray(found.phase) - phase * (P - 1))


@pytest.mark.parametrize(("n_frames", "bend"), [(60, 0.0), (45, 0.5), (80, -0.5), (100, 0.3)])
def test_known_warps_are_followed(live, n_frames, bend):
    x, phase = performed(n_frames, bend, 0.02, 77)
    (found,) = live.follow([x])
    errors = error(found, phase)
    # At another pace the filters come late by another part of the movement: 1.8 frames times the
    # difference in rate, twice.
    assert np.median(errors) < 1.8
    assert errors.max() < 4.5
    # The rate is the mean of the last tenth of the clock.
    lag = 0.1 * live.duration_
    before = np.interp(np.arange(n_frames) - lag, np.arange(n_frames), phase)
    rate = (phase - before) * live.duration_ / lag
    assert np.median(np.abs(found.rate - rate)[n_frames // 4 :]) < 0.25
    # Paces and bends beyond those of the training set are believed less.
    assert np.mean(found.confidence) > (0.8 if bend == 0 else 0.3)


def test_frame_by_frame_is_the_same_and_nothing_looks_ahead(live):
    x, _ = performed(70, 0.4, 0.05, 5)
    whole, part = live.follow([x, x[:40]])
    said, session = runs(live, x)
    for values, name in zip(whole, ("phase", "rate", "confidence"), strict=True):
        np.testing.assert_array_equal(values, [getattr(here, name) for here in said])
        np.testing.assert_array_equal(values[:40], getattr(part, name))
        np.testing.assert_array_equal(values, getattr(session.history, name))
    assert all(isinstance(value, float) for value in said[0])


def test_at_the_end_it_is_the_offline_path_to_the_last_bit():
    mean, x = movement(np.linspace(0, 1, P)), performed(75, 0.4, 0.05)[0]
    unit = Unit.of(mean[np.newaxis])
    features = LiveFeatures(Features("velocity", 1, 0.03, unit), mean, 2, 1.8)
    trellis = Trellis(step_table("velocity", 3, 2), 0.01, P - 1 + features.rest, running=True)
    stream = Stream(Course(P, trellis, features, 1.8, 1.0, UNKNOWN), 1, 3)
    derivative = CausalDerivative(1.8, (1, 3))
    said = [stream.take(frame[np.newaxis], float(k)) for k, frame in enumerate(x)]
    postures = unit(x)
    base = np.array([features(derivative.step(y), y)[0] for y in postures[:, np.newaxis]])
    costs = trellis.ends(base[np.newaxis], features.moving[np.newaxis])[0]
    np.testing.assert_array_equal(stream.running.costs, costs)
    path = trellis.paths(base[np.newaxis], features.moving[np.newaxis])[0, 0] / 2
    assert said[-1].phase[0] == min(path[-1], P - 1)


@pytest.mark.parametrize("every", [1, 2, 4])
def test_any_frame_rate_with_time_stamps(live, every):
    _, phase = performed(241, 0.4)
    rng = np.random.default_rng(1)
    kept = np.arange(0, 241, every)
    # From 0 to 60 frames of the training performances, not evenly.
    times = kept / 4 + np.where(kept % 240 == 0, 0, rng.uniform(-0.05, 0.05, len(kept)))
    shaken = np.interp(times * 4, np.arange(241), phase)
    (found,) = live.follow([movement(shaken)], [times])
    assert np.median(error(found, shaken)) < 1
    seconds = copy.deepcopy(live).set_params(frame_rate=30)
    (same,) = seconds.follow([movement(shaken)], [times / 30 + 1000])
    np.testing.assert_allclose(same.phase, found.phase, atol=0.6)


def test_what_is_hidden_is_not_compared(live):
    x, phase = performed(60, 0.3, 0.02, 9)
    rng = np.random.default_rng(2)
    hidden = np.where(rng.random(x.shape) < 0.3, np.nan, x)
    (found,) = live.follow([hidden])
    assert np.median(error(found, phase)) < 1.5
    some = x.copy()
    some[:, 1] = np.nan
    some[20:26] = np.nan
    (found,) = live.follow([some])
    assert np.median(error(found, phase)) < 2
    assert (error(found, phase) < 8).all()


def test_what_is_never_seen_goes_on_at_the_mean_pace(live):
    n = round(live.duration_) + 1
    (found,) = live.follow([np.full((n, 3), np.nan)])
    expected = np.arange(n) / live.duration_ * (P - 1)
    np.testing.assert_allclose(found.phase, np.minimum(expected, P - 1), atol=0.6)
    # Nobody knows, and that is what it says.
    assert found.confidence.max() < 0.5


def test_time_without_frames_is_as_frames_without_anything(live):
    x, _ = performed(60, 0.0, 0.02, 3)
    gap = x.copy()
    gap[20:45] = np.nan
    kept = np.r_[:20, 45:60]
    (hidden,) = live.follow([gap])
    (late,) = live.follow([x[kept]], [kept])
    np.testing.assert_allclose(late.phase[25:], hidden.phase[50:], atol=1)
    # An hour later nothing is left of it, and nobody waits for that hour.
    said, _ = runs(live, [x[0], x[1], x[2]], [0, 1, 1e6])
    assert np.isfinite(said[-1]).all()


def test_who_waits_has_not_begun_and_who_is_done_stays_at_the_end(live):
    x, phase = performed(60, 0.2, 0.0)
    rest = [np.repeat(x[:1], 40, axis=0), x, np.repeat(x[-1:], 40, axis=0)]
    (found,) = live.follow([np.concatenate(rest)])
    assert found.phase[:40].max() < 2
    assert np.median(np.abs(found.phase[40:100] - phase * (P - 1))) < 1.5
    np.testing.assert_array_equal(found.phase[-30:], P - 1)
    np.testing.assert_allclose(found.rate[-20:], 0, atol=1e-12)


def test_another_movement_is_not_believed(live):
    x, _ = performed(60, 0.2, 0.02, 4)
    right, backwards, other = live.follow([x, x[::-1], np.roll(x, 1, axis=1)])
    assert right.confidence[30:].mean() > 0.8
    assert backwards.confidence[30:].mean() < 0.3
    assert other.confidence[30:].mean() < 0.3


def test_several_performances_side_by_side(live):
    x, y = performed(60, 0.4, 0.02, 1)[0], performed(60, -0.4, 0.02, 2)[0]
    x[10, 2] = np.nan
    both, session = runs(live, np.stack([x, y], axis=1))
    alone = live.follow([x, y])
    for i, one in enumerate(alone):
        np.testing.assert_allclose([here.phase[i] for here in both], one.phase, atol=1e-9)
        np.testing.assert_allclose([here.confidence[i] for here in both], one.confidence, atol=1e-9)
    assert session.history.phase.shape == (60, 2)
    session.reset(1)
    again = [session.step(np.stack([x[-1], frame])) for frame in y[:30]]
    assert all(here.phase[0] == P - 1 for here in again[5:])
    np.testing.assert_allclose([here.phase[1] for here in again], alone[1].phase[:30], atol=1.5)


def test_a_frame_that_is_refused_changes_nothing(live):
    x, _ = performed(50)
    said, _ = runs(live, x)
    live = copy.deepcopy(live)
    live.reset()
    for k, frame in enumerate(x):
        for bad, time, message in [
            (frame[:2], None, r"must have shape \(3,\), or \(n_streams, 3\)"),
            (np.append(frame[:2], np.inf), None, "Feature 2 of the frame is infinite"),
            (["a", "b", "c"], None, "The frame"),
            (np.ma.masked_array(frame, [0, 0, 1]), None, "The frame .* mask"),
            (np.stack([frame, frame]), None, r"had the shape \(3,\), this one has \(2, 3\)"),
            (frame, k - 1.0, "time stamps must increase"),
            (frame, np.nan, "must be finite"),
        ]:
            if k:
                with pytest.raises(ValueError, match=message):
                    live.step(bad, time)
        assert live.step(frame) == said[k]


def test_only_what_runs_begins_anew(live):
    live = copy.deepcopy(live)
    live.reset()
    with pytest.raises(ValueError, match="0 performances run"):
        live.reset(0)
    live.step(np.zeros((2, 3)))
    live.reset([])
    for stream in (2, -3, "a", 0.5):
        with pytest.raises(ValueError, match="2 performances run"):
            live.reset(stream)
    with pytest.raises(ValueError, match="times of 2"):
        live.follow([performed(9)[0]], [None, None])
    with pytest.raises(ValueError, match="Performance 1: times must be one a frame"):
        live.follow([performed(9)[0]] * 2, [range(9), range(8)])


def test_a_copy_goes_on_from_where_it_was(live):
    x, _ = performed(60, 0.4, 0.02, 8)
    said, _ = runs(live, x)
    live = copy.deepcopy(live)
    live.reset()
    assert len(live.history.phase) == 0
    for frame in x[:30]:
        live.step(frame)
    other = pickle.loads(pickle.dumps(live))
    assert [other.step(frame) for frame in x[30:]] == said[30:]
    assert [live.step(frame) for frame in x[30:]] == said[30:]
    assert not hasattr(clone(live), "mean_")


def test_single_curves_and_plain_synchronizers():
    rng = np.random.default_rng(0)
    t = np.linspace(0, 1, 50)
    rows = np.array([np.sin(np.pi * t**b) for b in rng.uniform(0.8, 1.25, 8)])
    live = OnlineSynchronizer(LinearSynchronizer()).fit(rows)
    assert live.mean_.shape == (50, 1)
    (found,) = live.follow(rows[:1])
    said, _ = runs(live, rows[0])
    np.testing.assert_array_equal(found.phase, [here.phase for here in said])
    assert np.median(np.abs(found.phase - np.arange(50))) < 5


def test_single_precision_and_one_training_performance():
    X = [performed(50, b)[0].astype(np.float32) for b in (0.0, 0.3)]
    live = OnlineSynchronizer(DenseSynchronizer(P, metric=None, refine=False)).fit(X[:1])
    (found,) = live.follow(X[1:])
    assert np.median(error(found, performed(50, 0.3)[1])) < 1.5
    # How people differ cannot be told of one of them.
    assert found.confidence.mean() > 0.5


def test_what_does_not_move_or_does_not_differ_is_followed():
    x, _ = performed(40)
    still = OnlineSynchronizer(LinearSynchronizer()).fit([np.ones((40, 3))] * 2)
    for y in (x, np.ones((40, 3))):
        assert np.isfinite(still.follow([y])[0]).all()
    alike = OnlineSynchronizer(LinearSynchronizer()).fit([x] * 3)
    (found,) = alike.follow([x])
    np.testing.assert_array_equal(found.phase, np.arange(40))
    assert found.confidence.min() > 0.9


def test_no_step_is_longer_than_the_pattern(live):
    X = [performed(20, bend)[0] for bend in (0.0, 0.3)]
    a, b = (OnlineSynchronizer(DenseSynchronizer(20), max_rate=r).fit(X) for r in (19, 1e9))
    np.testing.assert_array_equal(a.follow(X), b.follow(X))


def test_names_of_features_are_kept_to():
    X = [pd.DataFrame(performed(30, bend)[0], columns=list("abc")) for bend in (0.0, 0.3)]
    live = OnlineSynchronizer(DenseSynchronizer(30)).fit(X)
    said = live.step(X[0].iloc[0])
    live.reset()
    assert live.step(X[0].to_numpy()[0]) == said
    for row in (X[0].iloc[1][::-1], X[0].iloc[1:3, ::-1]):
        with pytest.raises(ValueError, match=r"The frame has the columns .*'c', 'b', 'a'"):
            live.step(row)


def test_frames_may_all_be_written_to_one_place_and_answers_written_to(live):
    x, _ = performed(50, 0.3)
    said, _ = runs(live, np.stack([x, x], axis=1))
    live, place = copy.deepcopy(live), np.empty((2, 3))
    live.reset()
    for frame, right in zip(x, said, strict=True):
        place[:] = frame
        here = live.step(place)
        np.testing.assert_array_equal(here, right)
        for values in here:
            values[:] = 99
    np.testing.assert_array_equal(live.history.rate, [right.rate for right in said])


def test_who_begins_anew_does_not_come_from_where_it_was(live):
    """Ticks between the last frame of a performance and the first of the next see the latter."""
    x, _ = performed(60, 0.0, 0.02, 6)
    times = 1.7 * np.arange(20)
    first, second = x[::3], x[1::3]
    _, session = runs(live, np.stack([first, first], axis=1), times)
    session.reset(1)
    late = [
        session.step(np.stack([first[-1], frame]), times[-1] + 1.7 * (k + 1)).phase[1]
        for k, frame in enumerate(second)
    ]
    (alone,) = live.follow([second], [times])
    np.testing.assert_allclose(late, alone.phase, atol=2)


def test_the_time_that_is_left(live):
    """A mean of what is left of the mean duration, and of the phase at the mean pace."""
    live = copy.deepcopy(live).set_params(frame_rate=10)
    live.reset()
    assert live.time_left() == pytest.approx(live.duration_ / 10)
    x, _ = performed(60)
    for k, frame in enumerate(x):
        phase = live.step(frame, 100 + k / 10).phase
        mean = live.duration_ / 10
        assert live.time_left() == pytest.approx(
            (1 - phase / (P - 1)) * (max(mean - k / 10, 0) + mean * phase / (P - 1))
        )
    live.reset()
    live.step(x[[0, 0]], 0)
    live.step(x[[9, 9]], 0.9)
    live.reset(0)
    assert live.time_left()[0] == pytest.approx(live.duration_ / 10)
    live.step(x[[0, 10]], 1.0)
    first, second = live.time_left()
    assert first == pytest.approx(live.duration_ / 10, abs=0.2)
    assert second < first - 0.5
