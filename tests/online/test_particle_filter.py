"""The tracker's filter and smoother against formulas of Gaussian processes, and their parts."""

import numpy as np
import pytest
from scipy.stats import multivariate_normal
from sklearn_motionsync import LinearSynchronizer, MotionTracker
from sklearn_motionsync.online.particle_filter import (
    Particles,
    systematic_resampling,
    weighted_median,
)
from sklearn_motionsync.online.state_space import CausalSlopes, Clock, MaternProcess, RateProcess


@pytest.fixture(scope="module")
def fitted():
    """With one particle, whose phases are those of the track."""
    rng = np.random.default_rng(0)
    t = np.linspace(0, 1, 25)[:, np.newaxis]
    training = [np.sin(4 * t + rng.uniform(0, 1, 3)) * rng.uniform(0.7, 1.3, 3) for _ in range(6)]
    return MotionTracker(LinearSynchronizer(), 1, noise=0.1, random_state=1).fit(training)


def sample_body(tracker, times, rng):
    """A body drawn from the model, at the phases of the one particle."""
    phases = tracker.track(np.full((len(times), 3), np.nan), times=times).phases
    mean = [np.interp(phases, np.arange(len(m)), m) for m in tracker.mean_.T]
    covariance = matern_covariance(tracker, times, times)
    drawn = multivariate_normal.rvs(cov=covariance, random_state=rng)
    return np.column_stack(mean) + drawn.reshape(len(times), 3)


@pytest.fixture(scope="module")
def seen(fitted):
    """Observations at uneven times, before the end of the movement."""
    rng = np.random.default_rng(1)
    times = np.cumsum(rng.uniform(0.5, 1.5, 14))
    return sample_body(fitted, times, rng) + 0.1 * rng.standard_normal((14, 3)), times


def with_gaps(values):
    values = values.copy()
    values[np.random.default_rng(3).random(values.shape) < 0.3] = np.nan
    values[5] = np.nan
    return values


def matern_covariance(tracker, before, after):
    """Matern-3/2 of elapsed time, times the covariance of the features."""
    scaled = np.sqrt(3) * np.abs(before[:, None] - after) / tracker.length_scale_
    return np.kron((1 + scaled) * np.exp(-scaled), tracker.covariance_)


def posterior(tracker, phases, values, times, matrix, offset, frame, upto):
    """Mean and covariance at a frame, given the observations up to another: one normal."""
    frames = np.arange(len(tracker.mean_))
    mean = np.column_stack([np.interp(phases, frames, m) for m in tracker.mean_.T])
    here = ~np.isnan(values[: upto + 1]).ravel()
    whole = np.kron(np.eye(upto + 1), matrix)[here]
    among = whole @ matern_covariance(tracker, times[: upto + 1], times[: upto + 1]) @ whole.T
    among += tracker.noise**2 * np.eye(len(whole))
    across = matern_covariance(tracker, times[[frame]], times[: upto + 1]) @ whole.T
    expected = (mean[: upto + 1] @ matrix.T + offset).ravel()[here]
    off = values[: upto + 1].ravel()[here] - expected
    gain = across @ np.linalg.inv(among)
    return mean[frame] + gain @ off, tracker.covariance_ - gain @ across.T


PROJECTION = np.array([[1.0, 0.2, 0.0], [0.0, -1.0, 0.5]]), np.array([0.3, -1.0])


@pytest.mark.parametrize("projection", [None, PROJECTION])
@pytest.mark.parametrize("method", ["track", "smooth"])
def test_postures_equal_gaussian_process_posterior(fitted, seen, method, projection):
    values, times = seen
    matrix, offset = (np.eye(3), np.zeros(3)) if projection is None else projection
    values = with_gaps(values @ matrix.T + offset)
    track = getattr(fitted, method)(values, times=times, projection=projection)
    assert track.phases[-1] < fitted.n_frames_ - 1
    assert not track.lost.any()
    for i in range(len(times)):
        upto = i if method == "track" else len(times) - 1
        given = fitted, track.phases, values, times, matrix, offset
        mean, covariance = posterior(*given, i, upto)
        np.testing.assert_allclose(track.postures[i], mean, rtol=0, atol=1e-9)
        np.testing.assert_allclose(track.covariances[i], covariance, rtol=0, atol=1e-9)


def test_smooth_of_several_blocks_equals_posterior(fitted):
    rng = np.random.default_rng(5)
    times = np.cumsum(rng.uniform(0.03, 0.07, 230))
    blind = fitted.track(np.full((230, 3), np.nan), times=times)
    values = with_gaps(blind.postures + 0.1 * rng.standard_normal((230, 3)))
    values[95:105] = np.nan
    track = fitted.smooth(values, times=times)
    given = fitted, track.phases, values, times, np.eye(3), np.zeros(3)
    for i in (0, 99, 100, 199, 229):
        mean, covariance = posterior(*given, i, 229)
        np.testing.assert_allclose(track.postures[i], mean, rtol=0, atol=1e-9)
        np.testing.assert_allclose(track.covariances[i], covariance, rtol=0, atol=1e-9)


def test_squared_distances_in_covariances_are_chi_square(fitted):
    """Of bodies drawn from the model."""
    rng, times, distances = np.random.default_rng(2), np.arange(15.0), []
    for _ in range(20):
        body = sample_body(fitted, times, rng)
        values = body + 0.1 * rng.standard_normal(body.shape)
        values[4:9, 1:] = np.nan
        for track in (fitted.track(values), fitted.smooth(values)):
            if not track.lost.any():
                off = body[6] - track.postures[6]
                distances.append(off @ np.linalg.solve(track.covariances[6], off))
    assert len(distances) > 30
    assert 2.4 < np.mean(distances) < 3.6


# -- parts ---------------------------------------------------------------------------------


def test_causal_slopes_equal_weighted_regression():
    rng = np.random.default_rng(0)
    times = np.cumsum(rng.uniform(0.3, 2, 12))
    values, seen = rng.standard_normal((12, 4, 3)), rng.random((12, 3)) < 0.7
    seen[-1], slopes = [True, True, False], CausalSlopes(4, 3, 2.5)
    for i, t in enumerate(times):
        slopes.advance(t - times[i - 1] if i else 0.0)
        slopes.add(values[i][:, seen[i]], seen[i])
    known = slopes.have_slopes(seen[-1])
    assert known.tolist() == [True, True, False]
    found, noise = slopes.fit(known)
    for k in range(2):
        here = seen[:, k]
        weights = np.exp((times[here] - times[-1]) / 2.5)
        design = np.vander(times[here], 2)
        solve = np.linalg.solve(design.T * weights @ design, design.T * weights)[0]
        np.testing.assert_allclose(found[:, k], solve @ values[here, :, k], rtol=1e-9)
        np.testing.assert_allclose(noise[k], np.square(solve).sum(), rtol=1e-9)


def test_shift_equals_shifted_values():
    rng = np.random.default_rng(1)
    values, by = rng.standard_normal((6, 2, 2)), np.array([3.0, -1.0])
    late, early = CausalSlopes(2, 2, 3.0), CausalSlopes(2, 2, 3.0)
    all_seen, second = np.ones(2, dtype=bool), np.array([False, True])
    for x in values:
        late.advance(1.0)
        early.advance(1.0)
        late.add(x, all_seen)
        early.add(x + second[:, np.newaxis] * by, all_seen)
    late.shift(second, by)
    np.testing.assert_allclose(late.values, early.values, rtol=1e-12)


@pytest.mark.parametrize("start", [0.0, 0.3, 1 - 1e-12])
def test_systematic_resampling_rounds_shares_of_weights(start):
    weights = np.array([0.0, 0.31, 0.0, 0.05, 0.64, 0.0])
    counts = np.bincount(systematic_resampling(weights, start, 10), minlength=6)
    assert counts.sum() == 10
    assert (np.abs(counts - 10 * weights) < 1).all()


def test_weighted_median_has_half_of_the_weight():
    values = np.array([5.0, 1.0, 3.0])
    for weights, median in (([0.2, 0.5, 0.3], 1), ([0.2, 0.4, 0.4], 3), ([0.6, 0.2, 0.2], 5)):
        assert weighted_median(values, np.array(weights)) == median


def test_moves_keep_spread_and_memory_of_log_rates():
    process, clock = RateProcess(0.4, 5.0), Clock(1e9, 1e9)
    rng = np.random.default_rng(0)
    before = Particles.uniform(np.zeros(4000), process.draw(rng, 4000))
    after = before.move(5.0, process, clock, rng)
    assert abs(after.log_rates.std() - 0.4) < 0.02
    assert abs(np.corrcoef(before.log_rates, after.log_rates)[0, 1] - np.exp(-1)) < 0.05
    assert abs(np.median(after.phases) / 5 - 1) < 0.02


def test_restarts_do_not_depend_on_the_number_of_steps():
    process, clock, rng = RateProcess(0.0, 1.0), Clock(50.0, 100.0), np.random.default_rng(0)
    particles, shares = Particles.uniform(np.full(5000, 50.0), np.zeros(5000)), []
    for steps in (1, 10):
        at_end = np.ones(5000, dtype=bool)
        for _ in range(steps):
            at_end &= ~particles.move(10 / steps, process, clock, rng).restarted
        shares.append(at_end.mean())
    np.testing.assert_allclose(shares, 0.99**10, atol=0.02)


def test_matern_process_recovers_length_scale_and_covariance():
    """Drawn with a length scale of 8 frames, in steps of half a frame."""
    rng, times = np.random.default_rng(0), np.arange(120.0) / 2
    scaled = np.sqrt(3) * np.abs(times[:, np.newaxis] - times) / 8
    root = np.linalg.cholesky((1 + scaled) * np.exp(-scaled) + 1e-9 * np.eye(120))
    mixing = np.array([[1.0, 0.0], [0.8, 0.6]])
    drawn = root @ rng.standard_normal((60, 120, 2)) @ mixing.T
    process = MaternProcess.learn(drawn, 0.5)
    assert abs(np.sqrt(3) / process.decay - 8) < 1.5
    flat = drawn.reshape(-1, 2)
    moments = flat.T @ flat / len(flat)
    expected = (moments + np.diag(np.diag(moments))) / 2
    np.testing.assert_allclose(process.covariance, expected, rtol=1e-12)
