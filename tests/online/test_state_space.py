"""Parts of the state-space model: slopes, resampling, moves of particles, processes."""

import numpy as np
import pytest
from sklearn_motionsync.online.particle_filter import (
    Particles,
    systematic_resampling,
    weighted_median,
)
from sklearn_motionsync.online.state_space import CausalSlopes, Clock, MaternProcess, RateProcess


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
    assert weighted_median(values, np.array([0.2, 0.5, 0.3])) == 1
    assert weighted_median(values, np.array([0.2, 0.4, 0.4])) == 3
    assert weighted_median(values, np.array([0.6, 0.2, 0.2])) == 5


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
