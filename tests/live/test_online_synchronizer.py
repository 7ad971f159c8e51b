"""OnlineSynchronizer: phases of running trials against known warps and the offline path."""

import copy
import pickle

import numpy as np
import pandas as pd
import pytest
from scipy.special import log_softmax
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
    at = times[0]
    for k, (frame, time) in enumerate(zip(frames, times, strict=True)):
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
                values, since = frames[: k + 1, stream, feature], times[: k + 1]
                before = np.flatnonzero(~np.isnan(values[:-1]))
                # Where nothing was seen before, or too long ago, it is hidden but at the frame.
                last = before[-1] if len(before) else 0
                expected = np.interp(at, since[[last, -1]], values[[last, -1]])
                if time - since[last] > quarter and at < time - 1e-9:
                    expected = np.nan
                np.testing.assert_allclose(sample[stream, feature], expected, atol=1e-9)
            at += step
        assert resampler.elapsed == pytest.approx((time - at) / step + 1, abs=1e-6)


def test_time_without_frames_equals_frames_of_nan(fitted, live):
    x, _ = trial(60, 0.0, 0.02, 3)
    gap = x.copy()
    gap[20:45] = np.nan
    kept = np.r_[:20, 45:60]
    n = round(fitted.duration_) + 1
    hidden, blind = fitted.track([gap, np.full((n, 3), np.nan)])
    (late,) = fitted.track([x[kept]], [kept])
    np.testing.assert_allclose(late.phase[25:], hidden.phase[50:], atol=1)
    # If nothing is seen from the start on, the phase goes on at the mean pace.
    expected = np.arange(n) / fitted.duration_ * (P - 1)
    np.testing.assert_allclose(blind.phase, np.minimum(expected, P - 1), atol=0.6)
    assert blind.confidence.max() < 0.5
    # A long gap ends in bounded time.
    assert np.isfinite(step_all(live, x[:3], [0, 1, 1e6])[-1]).all()


def test_phase_stays_at_beginning_and_end_during_rests(fitted):
    x, phase = trial(60, 0.2, 0.0)
    (found,) = fitted.track([np.repeat(x, [41] + [1] * 58 + [41], axis=0)])
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


def test_copies_continue_independently(live):
    x, _ = trial(60, 0.4, 0.02, 8)
    expected = step_all(live, x)
    live.reset()
    step_all(live, x[:30])
    for copied in (pickle.loads(pickle.dumps(live)), live):
        assert step_all(copied, x[30:]) == expected[30:]


def test_frames_of_single_precision_are_interpolated_in_double(fitted, live):
    x, times = trial(50, 0.3)[0].astype(np.float32), 0.7 * np.arange(50)
    assert step_all(live, x, times) == step_all(copy.deepcopy(fitted), x.astype(float), times)


def test_frames_and_results_may_be_overwritten(fitted, live):
    x, _ = trial(50, 0.3)
    expected, buffer = step_all(copy.deepcopy(fitted), np.stack([x, x], axis=1)), np.empty((2, 3))
    for frame, right in zip(x, expected, strict=True):
        buffer[:] = frame
        step = live.step(buffer)
        np.testing.assert_array_equal(step, right)
        for values in step:
            values[:] = 99


# -- training sets ------------------------------------------------------------------------


def test_constant_and_equal_training_trials():
    x, _ = trial(40)
    constant = OnlineSynchronizer(LinearSynchronizer()).fit([np.ones((40, 3))] * 2)
    assert all(np.isfinite(found).all() for found in constant.track([x, np.ones((40, 3))]))
    equal = OnlineSynchronizer(LinearSynchronizer()).fit([x] * 3)
    found, unlike = equal.track([x, trial(40, 0.4)[0][::-1]])
    np.testing.assert_array_equal(found.phase, np.arange(40))
    assert found.confidence.min() > 0.9
    assert np.median(found.upper - found.lower) <= 2.1
    assert unlike.confidence[20:].max() < 0.1


@pytest.mark.parametrize("bends", [(0.3,), (-0.2, 0.0, 0.3), (0.0, 0.0, 0.0)])
def test_confidences_and_intervals_do_not_depend_on_the_unit(bends):
    told = []
    for unit in (1, 2.0**-20):
        X = [unit * trial(40 + 5 * i, bend)[0] for i, bend in enumerate(bends)]
        live = OnlineSynchronizer(LinearSynchronizer()).fit(X)
        told.append(np.concatenate(live.track([unit * trial(45, 0.1)[0], X[0][::-1]]), axis=1))
    np.testing.assert_allclose(*told, rtol=1e-6, atol=1e-6)
    phase, lower, upper = told[0][[0, 3, 4]]
    assert ((lower >= 0) & (lower <= phase) & (phase <= upper)).all()


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


@pytest.mark.parametrize(
    ("frame", "time", "message"),
    [
        (np.zeros(2), None, r"The frame has shape \(2,\), expected \(3,\) or \(n, 3\)"),
        ([0.0, 0.0, np.inf], None, "The frame, frame 0, feature 2 is infinity"),
        (["a", "b", "c"], None, "The frame"),
        (np.zeros((2, 3)), None, r"had the shape \(3,\), this one has \(2, 3\)"),
        ([0.0, 0.0, 1e10], None, r"largest magnitude of all, 1e\+10"),
        ([np.nan, -1e10, 0.0], None, r"largest magnitude of all, 1e\+10"),
        (np.zeros(3), 9.0, "time stamps must increase"),
        (np.zeros(3), np.nan, "must be finite"),
    ],
)
def test_refused_frame_changes_nothing(fitted, live, frame, time, message):
    x, _ = trial(20)
    expected = step_all(copy.deepcopy(fitted), x)
    step_all(live, x[:10])
    with pytest.raises(ValueError, match=message):
        live.step(frame, time)
    assert step_all(live, x[10:]) == expected[10:]


@pytest.mark.parametrize("method", ["reset", "time_left", "step"])
def test_methods_before_fit_are_refused(method):
    with pytest.raises(NotFittedError):
        getattr(OnlineSynchronizer(), method)(*[[0.0]] * (method == "step"))


def test_wrong_times_are_refused(fitted):
    x, _ = trial(9)
    for X, times, message in (
        ([x], [None, None], r"one sequence of times .*, got 2 for 1"),
        ([x] * 2, [range(9), range(8)], "Trial 1: times must be one a frame"),
    ):
        with pytest.raises(ValueError, match=message):
            fitted.track(X, times)


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


@pytest.mark.parametrize(
    ("times", "rate", "after", "message"),
    [
        ([0, 1], None, None, r"Take 4: times must be one a frame, shape \(3,\), got \(2,\)"),
        ([0, np.nan, 1], None, None, "time of frame 1 is nan"),
        ([0, 1e300, 2], 1e10, None, "must be finite"),
        ([0, 1, 1], None, None, "1 follows 1"),
        ([2, 1, 3], None, None, "1 follows 2"),
        ([2, 3, 4], 10, 20.0, "2 follows 2"),
        ([0, 1e-12, 1], None, None, r"increase, by 1e-09 to 1e\+09 frames, but 1e-12 follows 0"),
        ([0, 1, 1e300], None, None, r"by 1e-09 to 1e\+09 frames, but 1e\+300 follows 1"),
        ([-1.7e308, 1.7e308, 0], None, None, r"increase, by 1e-09 to 1e\+09 frames, but"),
        (["a", "b", "c"], None, None, "times"),
    ],
)
def test_check_times_refuses(times, rate, after, message):
    with pytest.raises(ValueError, match=message):
        check_times(times, 3, frame_rate=rate, what="Take 4", after=after)


def test_check_times_returns_frames_of_the_training_trials():
    assert check_times(None, 3).tolist() == [0, 1, 2]
    assert check_times(None, 2, after=4.5).tolist() == [5.5, 6.5]
    assert check_times([0.5, 1], 2, frame_rate=30).tolist() == [15, 30]
    assert check_times([0.5, 1], 2).tolist() == [0.5, 1]
    assert check_times(2, 1, after=1.0).tolist() == [2]
    # Seconds that are rounded are compared as frames, at any frame rate.
    for seconds in np.random.default_rng(0).uniform(0, 100, 40):
        (frames,) = check_times(seconds, 1, 29.97)
        with pytest.raises(ValueError, match="must increase"):
            check_times(seconds, 1, 29.97, after=frames)
        assert check_times(seconds + 1e-3, 1, 29.97, after=frames) > frames


def test_times_of_another_unit_are_warned_of():
    """Milliseconds where seconds are meant, and seconds where frames are."""
    X, seconds = [trial(8)[0] for _ in range(3)], np.arange(8) / 50
    live = OnlineSynchronizer(LinearSynchronizer(), frame_rate=50).fit(X)
    with pytest.warns(UserWarning, match="Trial 0: times are in seconds, and 20 of them"):
        live.track(X[:1], [1000 * seconds])
    live.track(X[:1] * 2, [seconds / 10, 10 * seconds])
    live.set_params(frame_rate=None)
    with pytest.warns(UserWarning, match="are in frames of the training trials, and 0.02 of"):
        live.track(X[:1], [seconds])
