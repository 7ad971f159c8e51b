"""The tracker's filter and smoother against formulas of Gaussian processes, and their parts."""

from copy import deepcopy
from types import SimpleNamespace

import numpy as np
import pytest
from scipy.stats import multivariate_normal
from sklearn_motionsync import LinearSynchronizer
from sklearn_motionsync.live import MotionTracker, members
from sklearn_motionsync.live.members import (
    ParticleFilter,
    Particles,
    RunningTake,
    pool,
    systematic_resampling,
)
from sklearn_motionsync.live.state_space import (
    CausalSlopes,
    Clock,
    MaternProcess,
    RateProcess,
    TrackerModel,
)

RNG, T = np.random.default_rng(0), np.linspace(0, 1, 25)[:, np.newaxis]
X = np.stack([np.sin(4 * T + RNG.uniform(0, 1, 3)) * RNG.uniform(0.7, 1.3, 3) for _ in range(6)])
NOISE = 0.01 * np.eye(3)


def of_uneven_rates(duration):
    """What is learnt of the trials, whose rates vary, by 60 particles."""
    rates = np.exp(0.2 * np.random.default_rng(1).standard_normal((6, 25)))
    return TrackerModel.learn(X, rates, np.arange(6), Clock(24.0, duration), NOISE, 60)


@pytest.fixture(autouse=True)
def phases_alone(monkeypatch):
    """What the member tells that knows phases."""
    monkeypatch.setattr(members, "pool", lambda estimates, evidence, model: estimates[0])


@pytest.fixture(scope="module")
def fitted():
    """With one particle, whose phases are those of the track."""
    return MotionTracker(LinearSynchronizer(), 1, noise=0.1, random_state=1).fit(X)


@pytest.fixture(scope="module")
def model(fitted):
    """What it has learnt, of one particle."""
    warped, clock = fitted.synchronizer_.transform(X), Clock(24.0, 24.0)
    assert (fitted.n_frames_, fitted.duration_) == (25, 24)
    return TrackerModel.learn(warped, np.ones((6, 25)), np.arange(6), clock, NOISE, 1)


def sample_body(tracker, times, rng):
    """A body drawn from the model, at the phases of the one particle."""
    phases = tracker.track(np.full((len(times), 3), np.nan), times=times).phases
    covariance = matern_covariance(tracker, times, times)
    drawn = multivariate_normal.rvs(cov=covariance, random_state=rng)
    return mean_at(tracker, phases) + drawn.reshape(len(times), 3)


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


def mean_at(tracker, phases):
    frames = np.arange(len(tracker.mean_))
    return np.column_stack([np.interp(phases, frames, m) for m in tracker.mean_.T])


def posterior(tracker, mean, values, times, frame, upto):
    """Mean and covariance at a frame, given the observations up to another: one normal."""
    here = ~np.isnan(values[: upto + 1]).ravel()
    whole = np.eye(here.size)[here]
    among = whole @ matern_covariance(tracker, times[: upto + 1], times[: upto + 1]) @ whole.T
    among += tracker.noise**2 * np.eye(len(whole))
    across = matern_covariance(tracker, times[[frame]], times[: upto + 1]) @ whole.T
    off = (values[: upto + 1] - mean[: upto + 1]).ravel()[here]
    gain = across @ np.linalg.inv(among)
    return mean[frame] + gain @ off, tracker.covariance_ - gain @ across.T


def assert_posterior(tracker, track, method, mean, values, times, frames=None):
    """A track has the mean and the covariance of the posterior at these frames, or at all."""
    for i in range(len(times)) if frames is None else frames:
        upto = i if method == "track" else len(times) - 1
        expected, covariance = posterior(tracker, mean, values, times, i, upto)
        np.testing.assert_allclose(track.poses[i], expected, rtol=0, atol=1e-9)
        np.testing.assert_allclose(track.covariances[i], covariance, rtol=0, atol=1e-9)


@pytest.mark.parametrize("member", ["phases", "pooled"])
@pytest.mark.parametrize("method", ["track", "smooth"])
def test_poses_equal_gaussian_process_posterior(fitted, model, seen, method, member, monkeypatch):
    """That of the pooled member about the mean of all frames, whatever the phase."""
    body, level = fitted, fitted.mean_.mean(axis=0)
    if member == "pooled":
        monkeypatch.setattr(members, "pool", lambda estimates, evidence, model: estimates[1])
        warped = fitted.synchronizer_.transform(X)
        off = (warped - level).reshape(-1, 3)
        pooled, moments = model.pooled, off.T @ off / len(off)
        expected = 0.85 * moments + 0.15 * np.diag(np.diag(moments))
        np.testing.assert_allclose(pooled.covariance, expected, rtol=1e-9)
        length_scale = np.sqrt(3) / pooled.decay
        body = SimpleNamespace(
            length_scale_=length_scale, covariance_=pooled.covariance, noise=fitted.noise
        )
    values, times = with_gaps(seen[0]), seen[1]
    track = getattr(fitted, method)(values, times=times)
    assert track.phases[-1] < fitted.n_frames_ - 1
    assert not track.lost.any()
    mean = mean_at(fitted, track.phases)
    if member == "pooled":
        mean = np.tile(level, (len(times), 1))
    assert_posterior(body, track, method, mean, values, times)


@pytest.mark.parametrize("method", ["track", "smooth"])
def test_poses_of_many_particles_equal_the_posterior_where_no_phase_matters(seen, method):
    """The mean is constant."""
    rng = np.random.default_rng(8)
    t = np.linspace(0, 1, 25)[:, np.newaxis]
    waves = [np.sin(5 * t + rng.uniform(0, 6, 3)) for _ in range(4)]
    even = [5 + sign * wave for wave in waves for sign in (1, -1)]
    level = MotionTracker(LinearSynchronizer(), 30, noise=0.1).fit(even)
    np.testing.assert_allclose(level.mean_, 5, atol=1e-12)
    values, times = with_gaps(seen[0]), seen[1]
    values += 5 - np.nanmean(values)
    track = getattr(level, method)(values, times=times)
    assert not track.lost.any()
    assert_posterior(level, track, method, np.full((len(times), 3), 5.0), values, times)


@pytest.mark.parametrize("method", ["track", "smooth"])
def test_restarts_leave_the_body_where_it_is(method):
    """As a mean whose jump, from the last frame to the first, fades as deviations do."""
    times, rng, t = np.arange(130.0), np.random.default_rng(4), np.linspace(0, 6.1, 25)
    cycles = [a * np.sin(t[:, np.newaxis] + [0, 1, 2]) for a in (0.8, 0.9, 1.1, 1.2)]
    fitted = MotionTracker(LinearSynchronizer(), 1, noise=0.1, random_state=1).fit(cycles)
    phases = fitted.track(np.full((130, 3), np.nan), times=times).phases
    mean, restarts = mean_at(fitted, phases), np.flatnonzero(np.diff(phases) < 0) + 1
    assert len(restarts) > 0
    for k in restarts:
        faded = np.sqrt(3) * (times[k:] - times[k]) / fitted.length_scale_
        jump = fitted.mean_[-1] - fitted.mean_[0]
        mean[k:] += ((1 + faded) * np.exp(-faded))[:, np.newaxis] * jump
    values = mean + 0.1 * rng.standard_normal(mean.shape)
    values[rng.random(mean.shape) < 0.3] = np.nan
    track = getattr(fitted, method)(values, times=times)
    np.testing.assert_array_equal(track.phases, phases)
    frames = sorted({0, 99, 100, 129} | {k + j for k in restarts.tolist() for j in (0, 5)})
    assert_posterior(fitted, track, method, mean, values, times, frames=frames)


# -- mixtures of particles, and limits -----------------------------------------------------


@pytest.mark.parametrize("method", ["track", "smooth"])
def test_first_frame_unseen_is_the_mixture_of_first_phases(method):
    """Of 20 particles two begin elsewhere, evenly spread; each is on a path of the smoother."""
    tracker = MotionTracker(LinearSynchronizer(), 20, noise=0.1).fit(X)
    last, mean = tracker.n_frames_ - 1, tracker.mean_
    track = getattr(tracker, method)(np.full((2, 3), np.nan))
    phases = np.append(np.zeros(18), [9 / 19 * last, last])
    poses = np.column_stack([np.interp(phases, np.arange(last + 1), m) for m in mean.T])
    np.testing.assert_allclose(track.poses[0], poses.mean(axis=0), atol=1e-12)
    between = np.cov(poses.T, bias=True)
    np.testing.assert_allclose(track.covariances[0], tracker.covariance_ + between, atol=1e-12)
    assert track.phases[0] == 0


@pytest.mark.parametrize("outlier", [False, True])
@pytest.mark.parametrize("duration", [24.0, 100.0])
def test_limits_of_the_nis_equal_their_definition(outlier, duration):
    """By regression lines and a Kalman filter, take by take."""
    warped, noise, width = X.copy(), 0.05, 3
    if outlier:
        warped[2, 10:16] += [5, 0, -5]
    clock, step, R = Clock(24.0, duration), duration / 24, noise**2 * np.eye(3)
    model = TrackerModel.learn(warped, np.ones((6, 25)), np.arange(6), clock, R, 50)
    deviations = (warped - warped.mean(axis=0)) * 6 / 5
    window, times = max(0.03 * duration, 1.0), step * np.arange(25)
    slopes, noises = np.empty((6, 24, width)), []
    for p in range(1, 25):
        weights, design = np.exp((times[: p + 1] - times[p]) / window), np.vander(times[: p + 1], 2)
        line = np.linalg.solve(design.T * weights @ design, design.T * weights)[0]
        slopes[:, p - 1] = np.einsum("t,ntk->nk", line, deviations[:, : p + 1])
        noises.append(np.square(line).sum() * noise**2)

    def shrunk(values):
        moments = np.einsum("npi,npj->ij", values, values) / values[..., 0].size
        return (moments + np.diag(np.diag(moments))) / 2

    def largest(values, variances):
        nis, most, left = np.ones(6), 1.0, np.exp(-step / (3 * window))
        for p, variance in enumerate(variances):
            inverse = np.linalg.inv(shrunk(values) + variance * np.eye(width))
            squares = np.einsum("ni,ij,nj->n", values[:, p], inverse, values[:, p])
            nis = left * nis + (1 - left) * (squares + variance * np.trace(inverse)) / width
            most = max(most, nis.max())
        return most

    velocity = max(4 * (largest(slopes, noises) - 1), 8 * np.sqrt(2 / (3 * width)))
    pose = max(2 * (largest(deviations, [noise**2] * 25) - 1), 8.0)
    np.testing.assert_allclose(model.nis_limits, [1 + velocity, 1 + pose], rtol=1e-9)
    np.testing.assert_allclose(model.velocities, shrunk(slopes), rtol=1e-9)
    innovations, process = [], model.process
    for x in deviations:
        means, covariance = np.zeros((2, 1, width)), process.stationary
        for p in range(25):
            if p:
                means, covariance = process.predict(means, covariance, step)
            S = covariance[:width, :width] + noise**2 * np.eye(width)
            off = x[p] - means[0, 0]
            innovations.append(off @ np.linalg.solve(S, off) / width)
            gain = covariance[:, :width] @ np.linalg.inv(S)
            means = means + (gain @ off).reshape(2, 1, width)
            covariance = covariance - gain @ S @ gain.T
    assert model.gate == pytest.approx(max(100, 10 * max(innovations)), rel=1e-6)
    assert (model.gate > 100) == (pose > 8) == outlier


def test_estimates_are_those_of_the_weighted_particles():
    """Law of total variance, weighted medians, effective size; and of rates at the end, 0."""
    running, mean = RunningTake(of_uneven_rates(24.0), 3, 0.0), X.mean(axis=0)
    for p in range(25):
        track = running.step(X[2, p], float(p))
        particles, deviations = running.phases.particles, running.phases.deviations
        weights = np.exp(particles.log_weights)
        assert weights.sum() == pytest.approx(1)
        poses = np.column_stack([np.interp(particles.phases, np.arange(25), m) for m in mean.T])
        poses += deviations.means[0]
        np.testing.assert_allclose(track.poses, weights @ poses)
        between = np.cov(poses.T, aweights=weights, ddof=0)
        np.testing.assert_allclose(track.covariances, deviations.covariance[:3, :3] + between)
        assert particles.effective_size == pytest.approx(1 / np.square(weights).sum())
        paces = np.where(particles.phases < 24, np.exp(particles.log_rates), 0)
        for found, values in ((track.phases, particles.phases), (track.rates, paces)):
            assert weights[values < found].sum() <= 0.5 + 1e-9
            assert weights[values > found].sum() <= 0.5 + 1e-9
    assert np.ptp(weights) > 1e-4


def test_pool_multiplies_densities_by_their_weights(model):
    """The density of the pool is the product of Gaussian densities, each to its weight."""
    rng, scale = np.random.default_rng(7), np.diag(model.pooled.covariance)
    roots = rng.standard_normal((2, 3, 3)) * np.sqrt(scale) * np.array([0.2, 0.6])[:, None, None]
    estimates = [(rng.standard_normal(3), 0.1 * np.diag(scale) + a.T @ a) for a in roots]
    for evidence in ([0.5, 0.9], [1.0, 3.0], [40.0, 2.0]):
        excess = np.maximum(evidence, 1)
        sizes = excess * [np.mean(np.diag(C) / scale) for _, C in estimates]
        weights = np.array([3, 1]) / sizes / np.sum(np.array([3, 1]) / sizes)
        mean, covariance = pool(estimates, np.array(evidence), model)
        points = mean + rng.standard_normal((8, 3))
        logs = sum(
            w * multivariate_normal(m, e * C).logpdf(points)
            for w, e, (m, C) in zip(weights, excess, estimates, strict=True)
        )
        logs = logs - multivariate_normal(mean, covariance).logpdf(points)
        assert np.ptp(logs) < 1e-6 * np.abs(logs).max()


def test_evidence_is_the_average_nis_of_innovations(model, seen):
    """Of both members, by their distribution before each observation."""
    values, times = seen
    running = RunningTake(model, 1, times[0])
    evidence, before = np.ones(2), times[0]
    for y, time in zip(values, times, strict=True):
        running.phases.rng, again = np.random.default_rng(0), np.random.default_rng(0)
        other = deepcopy(running)
        other.phases.rng = again
        other.update(np.full(3, np.nan), time)
        left = np.exp(-(time - before) / model.clock.memory)
        for k, member in enumerate((other.phases, other.pooled)):
            mean, covariance = member.estimate
            off = y - mean
            nis = off @ np.linalg.solve(covariance + NOISE, off) / 3
            evidence[k] = left * evidence[k] + (1 - left) * nis
        running.update(y, time)
        np.testing.assert_allclose(running.evidence, evidence, rtol=1e-6)
        before = time
    assert (evidence != 1).all()


@pytest.mark.parametrize("rows", [[0, 2], [0, 1, 2]])
def test_weights_and_nis_equal_their_definitions(rows):
    """By the slopes of the particles; a NIS of few numbers varies as that of all features."""
    model, matrix = of_uneven_rates(48.0), np.eye(3)[rows]
    running, seen = ParticleFilter(model, 3, 0.0), np.isin(np.arange(3), rows)
    nis, n, share = np.ones(2), len(rows), min(np.sqrt(len(rows) / 3), 1)
    noise, frames = 0.01 * np.eye(n), np.arange(25)
    for p in range(25):
        before, dt = running.particles, 2.0 if p else 0.0
        y = matrix @ X[2, p] + 0.02 * np.cos(np.arange(n) + p)
        running.update(np.where(seen, matrix.T @ y, np.nan), 2.0 * p)
        now = running.particles
        if p:
            slopes, variances = running.slopes.fit(seen)
            known = matrix @ model.velocities @ matrix.T + 0.01 * np.diag(variances)
            distances = np.einsum("ni,ij,nj->n", slopes, np.linalg.inv(known), slopes)
            old = before.weights if before.effective_size >= 30 else np.full(60, 1 / 60)
            weights = old * np.exp(-0.5 * 100 * min(dt, 1.44) / 48 / 10 * distances)
            np.testing.assert_allclose(now.weights, weights / weights.sum(), rtol=1e-6)
        expected = np.column_stack([np.interp(now.phases, frames, m) for m in model.mean.T])
        # Poses are judged before the weights change.
        off = y - matrix @ (old @ expected if p else expected.mean(axis=0))
        spread = matrix @ model.process.covariance @ matrix.T + noise
        new = np.array([now.weights @ distances if p else n, off @ np.linalg.solve(spread, off)])
        left = np.exp(-dt / (3 * 1.44))
        nis = left * nis + (1 - left) * (1 + (new / n - 1) * share)
        np.testing.assert_allclose(running.nis, nis, rtol=1e-6)
        assert not running.lost


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
    process = MaternProcess.learn(drawn, 0.5, 0.5)
    assert abs(np.sqrt(3) / process.decay - 8) < 1.5
    flat = drawn.reshape(-1, 2)
    moments = flat.T @ flat / len(flat)
    expected = (moments + np.diag(np.diag(moments))) / 2
    np.testing.assert_allclose(process.covariance, expected, rtol=1e-12)
