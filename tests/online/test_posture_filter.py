"""Filter and smoother against the formulas of Gaussian processes, at known phases."""

import numpy as np
import pytest
from scipy.stats import multivariate_normal
from sklearn_motionsync import LinearSynchronizer, MotionTracker


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


def dense_filter(tracker, phases, values, times):
    """A textbook Kalman filter: number by number, its noise integrated over time."""
    decay, width = np.sqrt(3) / tracker.length_scale_, values.shape[1]
    drift = np.array([[0.0, 1.0], [-(decay**2), -2 * decay]])
    state, out = np.zeros(2 * width), []
    spread = np.kron(tracker.covariance_, np.diag([1.0, decay**2]))
    for i, row in enumerate(values):
        if i:
            dt = times[i] - times[i - 1]
            move = np.kron(np.eye(width), _exponential(drift * dt))
            grid, weights = np.polynomial.legendre.leggauss(20)
            noise = np.zeros((2, 2))
            for node, weight in zip((grid + 1) / 2 * dt, weights / 2 * dt, strict=True):
                pushed = _exponential(drift * node)[:, 1]
                noise += 4 * decay**3 * weight * np.outer(pushed, pushed)
            state = move @ state
            spread = move @ spread @ move.T + np.kron(tracker.covariance_, noise)
        mean = [np.interp(phases[i], np.arange(len(m)), m) for m in tracker.mean_.T]
        for k in np.flatnonzero(~np.isnan(row)):
            look = np.eye(2 * width)[2 * k]
            gain = spread @ look / (look @ spread @ look + tracker.noise**2)
            state = state + gain * (row[k] - mean[k] - state[2 * k])
            spread = spread - np.outer(gain, look @ spread)
        out.append((mean + state[::2], spread[::2, ::2]))
    return out


def _exponential(matrix):
    """exp of a matrix with one double eigenvalue, whose logarithm is half its trace."""
    value = np.trace(matrix) / 2
    return np.exp(value) * (np.eye(2) + matrix - value * np.eye(2))


def test_track_equals_textbook_kalman_filter(fitted, seen):
    values, times = with_gaps(seen[0]), seen[1]
    track = fitted.track(values, times=times)
    assert not track.lost.any()
    expected = dense_filter(fitted, track.phases, values, times)
    for posture, covariance, (mean, spread) in zip(*track[:2], expected, strict=True):
        np.testing.assert_allclose(posture, mean, rtol=0, atol=1e-9)
        np.testing.assert_allclose(covariance, spread, rtol=0, atol=1e-9)


def test_spread_of_rates_widens_covariances(fitted, seen):
    values, times = seen
    X = fitted.mean_ + np.linspace(-0.2, 0.2, 4)[:, np.newaxis, np.newaxis]
    many = MotionTracker(LinearSynchronizer(), 200, noise=0.1, random_state=0).fit(X)
    paced = [x[:: 1 + i % 2] for i, x in enumerate(X)]
    uneven = MotionTracker(LinearSynchronizer(25), 200, noise=0.1, random_state=0).fit(paced)
    blind = np.full_like(values, np.nan)
    # Without a spread of rates particles that begin at the first frame stay together.
    assert many.rate_spread_ == 0 < uneven.rate_spread_
    variances = [np.trace(t.track(blind, times=times).covariances[-1]) for t in (many, uneven)]
    assert variances[1] > variances[0]


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
