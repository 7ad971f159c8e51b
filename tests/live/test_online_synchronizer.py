"""OnlineSynchronizer: phases of running trials against known warps and the offline path."""

import copy
import pickle

import numpy as np
import pandas as pd
import pytest
from scipy.special import log_softmax
from sklearn.base import clone
from sklearn.exceptions import NotFittedError
from sklearn_motionsync import DenseSynchronizer, LinearSynchronizer
from sklearn_motionsync.live import OnlineSynchronizer
from sklearn_motionsync.live.causal import CausalDerivative
from sklearn_motionsync.live.stream import Resampler, Streams, check_times, gains_of, phase_bounds
from sklearn_motionsync.live.synchronizer import Reference, calibrate
from sklearn_motionsync.matching.matcher import Features
from sklearn_motionsync.matching.units import Unit
from sklearn_motionsync.utils.parallel import Progress

P = 60


def movement(phase):
    """Three features of a movement from phase 0 to 1, different at every phase."""
    phase = np.asarray(phase)[..., np.newaxis]
    return np.concatenate(
        [np.cos(np.pi * phase), np.sin(2 * np.pi * phase), np.sin(np.pi * phase) ** 2], axis=-1
    )


def trial(n_frames, bend=0.0, noise=0.0, seed=0):
    """A trial and the phase of its frames, from 0 to 1."""
    t = np.linspace(0, 1, n_frames)
    phase = t + bend * np.sin(2 * np.pi * t) / (2 * np.pi)
    rng = np.random.default_rng(seed)
    return movement(phase) + noise * rng.standard_normal((n_frames, 3)), phase


@pytest.fixture(scope="module")
def fitted():
    bends = np.linspace(-0.4, 0.4, 9)
    X = [trial(50 + 5 * (i % 5), b, 0.02, i)[0] for i, b in enumerate(bends)]
    return OnlineSynchronizer(DenseSynchronizer(P)).fit(X)


@pytest.fixture
def live(fitted):
    return copy.deepcopy(fitted)


def step_all(live, frames, times=None):
    times = [None] * len(frames) if times is None else times
    return [live.step(x, t) for x, t in zip(frames, times, strict=True)]


def error(found, phase):
    return np.abs(np.asarray(found.phase) - phase * (P - 1))


# -- phases -------------------------------------------------------------------------------


@pytest.mark.parametrize(("n_frames", "bend"), [(60, 0.0), (45, 0.5), (100, -0.3)])
def test_phase_and_rate_follow_known_warps(fitted, n_frames, bend):
    x, phase = trial(n_frames, bend, 0.02, 77)
    (found,) = fitted.track([x])
    errors = error(found, phase)
    # At another rate the delay of the filters differs: twice 1.8 frames times the difference.
    assert np.median(errors) < 1.8
    assert errors.max() < 4.5
    # The rate is the mean of the last tenth of the clock.
    lag = 0.1 * fitted.duration_
    before = np.interp(np.arange(n_frames) - lag, np.arange(n_frames), phase)
    rate = (phase - before) * fitted.duration_ / lag
    assert np.median(np.abs(found.rate - rate)[n_frames // 4 :]) < 0.25
    # Confidence is lower at paces and bends beyond those of the training set.
    assert np.mean(found.confidence) > (0.8 if bend == 0 else 0.3)


def test_costs_at_the_end_equal_offline_trellis_to_the_last_bit():
    mean, x = movement(np.linspace(0, 1, P)), trial(75, 0.4, 0.05)[0]
    unit = Unit.of(mean[np.newaxis])
    reference = Reference(Features("velocity", 0.03, unit), mean, P - 1)
    streams = Streams(reference, 1, 3)
    for frame in x:
        streams.update(frame[np.newaxis])
    derivative, trellis = CausalDerivative(reference.width, (1, 3)), reference.trellis
    base = [reference.features.compare(derivative.step(y), y)[0] for y in unit(x)[:, np.newaxis]]
    given = np.array(base)[np.newaxis], reference.moving[np.newaxis]
    np.testing.assert_array_equal(streams.trellis.costs, trellis.ends(*given)[0])
    assert streams.estimate(0.0).phase[0] == min(trellis.paths(*given)[0, 0][-1] / 2, P - 1)


@pytest.mark.parametrize("every", [1, 2, 4])
def test_times_give_the_same_phases_at_any_frame_rate(fitted, live, every):
    _, phase = trial(241, 0.4)
    rng = np.random.default_rng(1)
    kept = np.arange(0, 241, every)
    # From 0 to 60 frames of the training trials, not evenly.
    times = kept / 4 + np.where(kept % 240 == 0, 0, rng.uniform(-0.05, 0.05, len(kept)))
    truth = np.interp(times * 4, np.arange(241), phase)
    (found,) = fitted.track([movement(truth)], [times])
    assert np.median(error(found, truth)) < 1
    (same,) = live.set_params(frame_rate=30).track([movement(truth)], [times / 30 + 1000])
    np.testing.assert_allclose(same.phase, found.phase, atol=0.6)


@pytest.mark.parametrize("hidden", [0.0, 0.4])
def test_samples_lie_between_the_frames_that_show_a_feature(hidden):
    """Of each feature, from the last frame that showed it, in gaps of a quarter of the clock."""
    rng = np.random.default_rng(3)
    times = 50 + np.cumsum(rng.choice([0.3, 0.9, 1.7, 2.6, 9.0], 80))
    times[40:] += 2 * 3 * 60  # longer than three clocks: samples go on at that frame
    frames = rng.standard_normal((80, 2, 3))
    frames[rng.random(frames.shape) < hidden] = np.nan
    resampler, step, quarter = Resampler(1.25, 60, frames[0], times[0]), 1.25, 15 * 1.25
    restarts, begun, at = {20: 0, 60: 1}, [0, 0], times[0]
    for k, (frame, time) in enumerate(zip(frames, times, strict=True)):
        if k in restarts:
            resampler.restart(restarts[k])
            begun[restarts[k]] = k
        found = list(resampler.add(frame, time))
        if k == 40:
            assert len(found) == 3 * 60 + 1
            assert np.isnan(found[:-1]).all()
            np.testing.assert_array_equal(found[-1], frame)
            at = time + step
            continue
        for sample in found:
            assert times[k - 1] < at <= time + 1e-9 or k == 0
            for stream, feature in np.ndindex(2, 3):
                i, values = k - 1, frames[:, stream, feature]
                while i > begun[stream] and np.isnan(values[i]):
                    i -= 1
                expected = values[k]
                if k > begun[stream]:
                    line = values[i] + (at - times[i]) / (time - times[i]) * (values[k] - values[i])
                    expected = line if time - times[i] <= quarter else np.nan
                np.testing.assert_allclose(sample[stream, feature], expected, atol=1e-9)
            at += step
        assert resampler.elapsed == pytest.approx((time - at) / step + 1, abs=1e-6)


def test_phase_goes_on_at_mean_pace_without_observations(fitted):
    n = round(fitted.duration_) + 1
    (found,) = fitted.track([np.full((n, 3), np.nan)])
    expected = np.arange(n) / fitted.duration_ * (P - 1)
    np.testing.assert_allclose(found.phase, np.minimum(expected, P - 1), atol=0.6)
    assert found.confidence.max() < 0.5


def test_time_without_frames_equals_frames_of_nan(fitted, live):
    x, _ = trial(60, 0.0, 0.02, 3)
    gap = x.copy()
    gap[20:45] = np.nan
    kept = np.r_[:20, 45:60]
    (hidden,) = fitted.track([gap])
    (late,) = fitted.track([x[kept]], [kept])
    np.testing.assert_allclose(late.phase[25:], hidden.phase[50:], atol=1)
    # A long gap ends in bounded time.
    assert np.isfinite(step_all(live, x[:3], [0, 1, 1e6])[-1]).all()


def test_phase_stays_at_beginning_and_end_during_rests(fitted):
    x, phase = trial(60, 0.2, 0.0)
    rests = [np.repeat(x[:1], 40, axis=0), x, np.repeat(x[-1:], 40, axis=0)]
    (found,) = fitted.track([np.concatenate(rests)])
    assert found.phase[:40].max() < 2
    assert np.median(np.abs(found.phase[40:100] - phase * (P - 1))) < 1.5
    np.testing.assert_array_equal(found.phase[-30:], P - 1)
    np.testing.assert_allclose(found.rate[-20:], 0, atol=1e-12)


def test_time_left_is_weighted_mean_of_duration_and_phase(live):
    assert live.duration_ == np.mean([50 + 5 * (i % 5) for i in range(9)]) - 1
    live.set_params(frame_rate=10)
    mean = live.duration_ / 10
    assert live.time_left() == pytest.approx(mean)
    for k, frame in enumerate(trial(60)[0]):
        share = live.step(frame, 100 + k / 10).phase / (P - 1)
        expected = (1 - share) * (max(mean - k / 10, 0) + mean * share)
        assert live.time_left() == pytest.approx(expected)


@pytest.mark.parametrize("sync", [LinearSynchronizer(), DenseSynchronizer(P, metric=None)])
def test_constant_features_say_nothing_of_the_phase(sync):
    """Seen alone they are as nothing seen; beside others they change nothing."""

    def beside(x, value):
        return np.column_stack([x, np.full(len(x), value)])

    X = [beside(trial(50 + i, 0.1 * (i - 3), 0.02, i)[0], 5.0) for i in range(7)]
    live = OnlineSynchronizer(sync).fit(X)
    x, nothing = trial(60, 0.2, 0.02, 9)[0], np.full((60, 3), np.nan)
    seen, hidden, alone, blind = live.track(
        [beside(x, 5.0), beside(x, np.nan), beside(nothing, 5.0), beside(nothing, np.nan)]
    )
    np.testing.assert_allclose(hidden.phase, seen.phase, atol=1e-9)
    np.testing.assert_array_equal(alone, blind)
    assert alone.confidence[20:].max() < 0.1


def test_estimates_of_streams_equal_their_definitions():
    """Rate, confidence, bounds and mean cost of two streams, one of which is another movement that
    is hidden at times.
    """
    X = [trial(50 + i, 0.1 * (i - 3), 0.02, i)[0] for i in range(7)]
    live = OnlineSynchronizer(DenseSynchronizer(P, metric=None, refine=False)).fit(X)
    given = live.synchronizer_.features_, live.mean_, live.duration_
    reference = Reference(*given, 1e-4, typical_cost=5e-5, interval_temperature=3e-5)
    # The last pose is held until the filters, 1.77 frames wide, have forgotten the movement.
    assert len(reference.moving) == 2 * (P - 1) + 1 + 2 * 11
    streams = Streams(reference, 2, 3)
    x, y = trial(75, 0.3, 0.1, 8)[0], np.roll(trial(75, 0.0, 0.02, 9)[0], 1, axis=1)
    y[20:23] = y[40, :2] = y[50:53, 2] = np.nan
    phases, costs, shares, part = [], [], [], np.ones(2)
    for sample in np.stack([x, y], axis=1):
        known = streams.trellis.best()[1] if phases else np.zeros(2)
        streams.update(sample)
        ends, now = streams.trellis.best()
        phases.append(np.minimum(ends / 2, P - 1))
        costs.append(now - known)
        # A velocity is unknown in a gap, and at the first sample after a long one.
        shares.append((~np.isnan(sample)).mean(axis=1))
        found, n = streams.estimate(0.0), len(phases)
        window = min(n - 1, 6)
        moved = phases[-1] - phases[-1 - window] + 6 - window
        np.testing.assert_allclose(found.rate, np.clip(moved / 6, 0, 3), atol=1e-12)
        for i in range(2):
            mean_cost, share = 0.0, 1.0
            for k, (cost, seen) in enumerate(zip(costs, shares, strict=True)):
                weight = 1 / min(k + 1, 6)
                share += weight * ((seen[i] > 0) - share)
                if seen[i]:
                    mean_cost += weight * (cost[i] / seen[i] - mean_cost)
            assert streams.mean_cost[i] == pytest.approx(mean_cost)
            mass = np.exp(log_softmax(-streams.trellis.costs[i] / 1e-4))
            positions = np.minimum(np.arange(len(mass)) / 2, P - 1)
            mass = mass[np.abs(positions - phases[-1][i]) <= 0.05 * (P - 1)].sum()
            expected = share * mass / max(mean_cost / 5e-5, 1) ** 2
            assert found.confidence[i] == pytest.approx(expected)
        # Of the features, where anything is seen.
        part += (shares[-1] > 0) * (shares[-1] - part) / min(n, 6)
        excess = np.maximum(streams.mean_cost / 5e-5, 1)
        temperature = 3e-5 * excess / part**2 * np.maximum(excess / 4, 1) ** 2
        gains = gains_of(streams.trellis.costs)[:, ::2]
        bounds = phase_bounds(gains, temperature, found.phase, P - 1)
        np.testing.assert_allclose([found.lower, found.upper], bounds, atol=1e-9)
    # The other movement costs more than four times what is typical.
    assert streams.mean_cost[1] > 2e-4
    # Until the next sample they move with the phase.
    later = streams.estimate(0.5)
    for name in ("phase", "lower", "upper"):
        expected = np.minimum(getattr(found, name) + found.rate / 2, P - 1)
        np.testing.assert_allclose(getattr(later, name), expected)


# -- streams and sessions -----------------------------------------------------------------


def test_reset_of_one_stream_does_not_interpolate_from_its_last_frame(fitted, live):
    x, _ = trial(60, 0.0, 0.02, 6)
    times, first, second = 1.7 * np.arange(20), x[::3], x[1::3]
    step_all(live, np.stack([first, first], axis=1), times)
    live.reset(1)
    frames = np.stack([np.repeat(first[-1:], 20, axis=0), second], axis=1)
    late = [step.phase[1] for step in step_all(live, frames, times + times[-1] + 1.7)]
    (alone,) = fitted.track([second], [times])
    np.testing.assert_allclose(late, alone.phase, atol=2)


def test_time_left_begins_again_for_a_reset_stream(live):
    x, _ = trial(60)
    step_all(live, [x[[0, 0]], x[[9, 9]]], [0, 9])
    live.reset(0)
    assert live.time_left()[0] == pytest.approx(live.duration_)
    live.step(x[[0, 10]], 10)
    # Before its first sample it is at the beginning, and goes on at the mean pace.
    live.reset(0)
    ahead = live.step(x[[0, 10]], 10.1)
    assert 0 <= ahead.phase[0] < 1
    assert (ahead.rate[0], ahead.confidence[0]) == (1, 1)
    first, second = live.time_left()
    assert first == pytest.approx(live.duration_, abs=2)
    assert second < first - 5


def test_copies_continue_independently(live):
    x, _ = trial(60, 0.4, 0.02, 8)
    expected = step_all(live, x)
    live.reset()
    assert len(live.history.phase) == 0
    step_all(live, x[:30])
    other = pickle.loads(pickle.dumps(live))
    assert step_all(other, x[30:]) == expected[30:]
    assert step_all(live, x[30:]) == expected[30:]
    assert not hasattr(clone(live), "mean_")


def test_frames_and_results_may_be_overwritten(fitted, live):
    x, _ = trial(50, 0.3)
    expected, buffer = step_all(copy.deepcopy(fitted), np.stack([x, x], axis=1)), np.empty((2, 3))
    for frame, right in zip(x, expected, strict=True):
        buffer[:] = frame
        step = live.step(buffer)
        np.testing.assert_array_equal(step, right)
        for values in step:
            values[:] = 99
    np.testing.assert_array_equal(live.history.rate, [right.rate for right in expected])


# -- training sets ------------------------------------------------------------------------


def test_rows_and_linear_synchronizer():
    rng = np.random.default_rng(0)
    t = np.linspace(0, 1, 50)
    rows = np.array([np.sin(np.pi * t**b) for b in rng.uniform(0.8, 1.25, 8)])
    live = OnlineSynchronizer(LinearSynchronizer()).fit(rows)
    assert live.mean_.shape == (50, 1)
    (found,) = live.track(rows[:1])
    np.testing.assert_array_equal(found.phase, [step.phase for step in step_all(live, rows[0])])
    assert np.median(np.abs(found.phase - np.arange(50))) < 5


def test_single_precision_and_single_training_trial():
    X = [trial(50, b)[0].astype(np.float32) for b in (0.0, 0.3)]
    live = OnlineSynchronizer(DenseSynchronizer(P, metric=None, refine=False)).fit(X[:1])
    (found,) = live.track(X[1:])
    assert np.median(error(found, trial(50, 0.3)[1])) < 1.5
    assert found.confidence.mean() > 0.5
    # Frames of single precision are interpolated in double precision.
    times = 0.7 * np.arange(len(X[1]))
    again = copy.deepcopy(live)
    assert step_all(live, X[1], times) == step_all(again, X[1].astype(np.float64), times)


def test_constant_and_equal_training_trials():
    x, _ = trial(40)
    constant = OnlineSynchronizer(LinearSynchronizer()).fit([np.ones((40, 3))] * 2)
    for y in (x, np.ones((40, 3))):
        assert np.isfinite(constant.track([y])[0]).all()
    (found,) = OnlineSynchronizer(LinearSynchronizer()).fit([x] * 3).track([x])
    np.testing.assert_array_equal(found.phase, np.arange(40))
    assert found.confidence.min() > 0.9
    # Another movement is as unlike them in any unit.
    other = trial(40, 0.4)[0][::-1]
    many, few = (
        OnlineSynchronizer(LinearSynchronizer()).fit([x * unit] * 3).track([other * unit])[0]
        for unit in (1, 2.0**-20)
    )
    np.testing.assert_allclose(few.confidence, many.confidence, rtol=1e-6, atol=1e-9)
    assert many.confidence[20:].max() < 0.1


def test_calibration_equals_streams_matched_to_the_mean_of_the_others():
    """By frames of streams: the likeliest temperature, the median of the largest mean costs, and
    the lowest temperature whose intervals hold nine tenths of the phases.

    Of 30 trials 24 are matched; of a long one every second moment counts.
    """
    X = [trial(45 + i % 7, 0.03 * (i % 9 - 4), 0.02, i)[0] for i in range(30)]
    X[0] = trial(160, -0.2, 0.02)[0]
    live = OnlineSynchronizer(DenseSynchronizer(P, metric=None, refine=False)).fit(X)
    match = live.synchronizer_.match(X)
    warped, last = match.warp(X), P - 1

    def reference_of(mean):
        return Reference(live.synchronizer_.features_, mean, live.duration_)

    energy = np.square(reference_of(live.mean_).moving).sum(axis=1).mean()
    temperatures = energy * np.geomspace(0.01, 1e3, 41)
    scores, shares, largest = np.zeros(41), np.zeros(41), []
    for i in sorted({round(k * 29 / 23) for k in range(24)}):
        others, x = np.delete(warped, i, axis=0).mean(axis=0), X[i]
        streams, rows, mean_costs = Streams(reference_of(others), 1, 3), [], []
        times = np.arange(0, len(x) - 1 + 1e-6, live.duration_ / last)
        for t in times:
            sample = [np.interp(t, np.arange(len(x)), column) for column in x.T]
            streams.update(np.array([sample]))
            rows.append(streams.trellis.costs[0])
            mean_costs.append(streams.mean_cost[0])
        largest.append(max(mean_costs))
        clock = times / (len(x) - 1) * last
        phases = np.interp(clock, match.times[i] + 1e-9 * np.arange(P), np.arange(P))
        right = np.round(2 * phases).astype(int)
        told = np.minimum(np.argmin(rows, axis=1) / 2, last)
        gains, every = gains_of(np.array(rows))[:, ::2], 2 if i == 0 else 1
        for k, temperature in enumerate(temperatures):
            found = log_softmax(-np.array(rows) / temperature, axis=1)[np.arange(len(rows)), right]
            scores[k] += np.maximum(found[::every], np.log(1e-12)).mean()
            lower, upper = phase_bounds(gains, np.full(len(rows), temperature), told, last)
            shares[k] += np.mean(((lower <= right / 2) & (right / 2 <= upper))[::every]) / 24
    found = calibrate(reference_of, X, warped, match.times, Progress(None, verbose=0))
    expected = temperatures[scores.argmax()], np.median(largest)
    np.testing.assert_allclose(found[:2], expected, rtol=1e-6)
    assert found[2] == pytest.approx(1.5 * temperatures[np.flatnonzero(shares >= 0.9)[0]])


# -- refusals -----------------------------------------------------------------------------


def test_refused_frame_changes_nothing(fitted, live):
    x, _ = trial(20)
    expected = step_all(copy.deepcopy(fitted), x)
    assert live.step(x[0]) == expected[0]
    for k, frame in enumerate(x[1:], 1):
        for bad, time, message in [
            (frame[:2], None, r"The frame has shape \(2,\), expected \(3,\) or \(n, 3\)"),
            (np.append(frame[:2], np.inf), None, "The frame, frame 0, feature 2 is infinity"),
            (["a", "b", "c"], None, "The frame"),
            (np.stack([frame, frame]), None, r"had the shape \(3,\), this one has \(2, 3\)"),
            (np.append(frame[:2], 1e10), None, r"largest magnitude of all, 1e\+10"),
            ([np.nan, -1e10, 0.0], None, r"largest magnitude of all, 1e\+10"),
            (frame, k - 1.0, "time stamps must increase"),
            (frame, k - 1 + 1e-12, "by 1e-09 to 1e\\+09 frames"),
            (frame, 1e10, r"but 1e\+10 follows"),
            (frame, np.nan, "must be finite"),
        ]:
            with pytest.raises(ValueError, match=message):
                live.step(bad, time)
        assert live.step(frame) == expected[k]


def test_methods_before_fit_are_refused():
    live = OnlineSynchronizer()
    for call in (live.reset, live.time_left, lambda: live.history, lambda: live.step([0.0])):
        with pytest.raises(NotFittedError):
            call()


def test_unknown_streams_and_wrong_times_are_refused(fitted, live):
    with pytest.raises(ValueError, match="not among 0 running trials"):
        live.reset(0)
    live.step(np.zeros((2, 3)))
    live.reset([])
    for stream in (2, -3, "a", 0.5, [[0, 1]]):
        with pytest.raises(ValueError, match="not among 2 running trials"):
            live.reset(stream)
    with pytest.raises(ValueError, match=r"one sequence of times .*, got 2 for 1"):
        fitted.track([trial(9)[0]], [None, None])
    with pytest.raises(ValueError, match="Trial 1: times must be one a frame"):
        fitted.track([trial(9)[0]] * 2, [range(9), range(8)])


def test_time_stamps_that_come_twice_are_refused():
    """At any frame rate: seconds that are rounded are compared as frames."""
    for seconds in np.random.default_rng(0).uniform(0, 100, 40):
        (frames,) = check_times(seconds, 1, 29.97)
        with pytest.raises(ValueError, match="must increase"):
            check_times(seconds, 1, 29.97, after=frames)
        assert check_times(seconds + 1e-3, 1, 29.97, after=frames) > frames
    for times in ([0, 1e300], [-1.7e308, 1.7e308]):
        with pytest.raises(ValueError, match=r"must increase, by 1e-09 to 1e\+09 frames, but"):
            check_times(times, 2)
    with pytest.raises(ValueError, match="must be finite"):
        check_times([0, 1e300], 2, 1e10)


def test_phases_do_not_depend_on_the_origin_of_time():
    """1e17 is a time in nanoseconds, where the next number is 16 later."""
    x, _ = trial(20, 0.3, 0.02, 4)
    times = np.arange(0, 320, 16.0)
    slow = OnlineSynchronizer(LinearSynchronizer()).fit(
        [np.repeat(trial(18, b, 0.02, i)[0], 16, axis=0) for i, b in enumerate((-0.2, 0.2))]
    )
    (expected,), (found,) = slow.track([x], [times]), slow.track([x], [times + 1e17])
    np.testing.assert_array_equal(found.phase, expected.phase)


def test_feature_names_of_frames_are_checked():
    X = [pd.DataFrame(trial(30, bend)[0], columns=list("abc")) for bend in (0.0, 0.3)]
    live = OnlineSynchronizer(DenseSynchronizer(30)).fit(X)
    expected = live.step(X[0].iloc[0])
    live.reset()
    assert live.step(X[0].to_numpy()[0]) == expected
    for row in (X[0].iloc[1][::-1], X[0].iloc[1:3, ::-1]):
        with pytest.raises(ValueError, match=r"The frame has the columns .*'c', 'b', 'a'"):
            live.step(row)


def test_check_times_returns_frames_of_the_training_trials():
    assert check_times(None, 3).tolist() == [0, 1, 2]
    assert check_times(None, 2, after=4.5).tolist() == [5.5, 6.5]
    assert check_times([0.5, 1], 2, frame_rate=30).tolist() == [15, 30]
    assert check_times([0.5, 1], 2).tolist() == [0.5, 1]
    assert check_times(2, 1, after=1.0).tolist() == [2]


@pytest.mark.parametrize(
    ("times", "after", "message"),
    [
        ([0, 1], None, r"Take 4: times must be one a frame, shape \(3,\), got \(2,\)"),
        ([0, np.nan, 1], None, "time of frame 1 is nan"),
        ([0, 1, 1], None, "1 follows 1"),
        ([2, 1, 3], None, "1 follows 2"),
        ([2, 3, 4], 20.0, "2 follows 2"),
        (["a", "b", "c"], None, "times"),
    ],
)
def test_check_times_refuses(times, after, message):
    with pytest.raises(ValueError, match=message):
        check_times(times, 3, frame_rate=None if after is None else 10, what="Take 4", after=after)


def test_times_of_another_unit_are_warned_of():
    """Milliseconds where seconds are meant, and seconds where frames are."""
    X = [trial(30)[0] for _ in range(3)]
    live = OnlineSynchronizer(LinearSynchronizer(), frame_rate=50).fit(X)
    seconds = np.arange(30) / 50
    with pytest.warns(UserWarning, match="Trial 0: times are in seconds, and 20 of them"):
        live.track(X[:1], [1000 * seconds])
    live.track(X[:1], [seconds / 10])
    live.track(X[:1], [10 * seconds])
    in_frames = OnlineSynchronizer(LinearSynchronizer()).fit(X)
    with pytest.warns(UserWarning, match="are in frames of the training trials, and 0.02 of"):
        in_frames.track(X[:1], [seconds])
