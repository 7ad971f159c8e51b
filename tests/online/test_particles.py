"""The parts of the tracker by themselves: causal slopes, systematic draws, the way particles go."""

import numpy as np
import pytest
from sklearn_motionsync.online.particle_filter import Particles, systematic, weighted_median
from sklearn_motionsync.online.tracker_model import Clock, Pace, Process
from sklearn_motionsync.online.velocity import Slopes


def test_slopes_are_those_of_weighted_lines():
    """Against a fit of all values so far, and the noise that its coefficients pass on."""
    rng = np.random.default_rng(0)
    times = np.cumsum(rng.uniform(0.3, 2, 12))
    values, seen = rng.standard_normal((12, 4, 3)), rng.random((12, 3)) < 0.7
    seen[-1], slopes = [True, True, False], Slopes(4, 3, 2.5)
    for i, t in enumerate(times):
        slopes.wait(t - times[i - 1] if i else 0.0)
        slopes.add(values[i][:, seen[i]], seen[i])
    known = slopes.known(seen[-1])
    assert known.tolist() == [True, True, False]
    found, noise = slopes.of(known)
    for k in range(2):
        here = seen[:, k]
        weights = np.exp((times[here] - times[-1]) / 2.5)
        design = np.vander(times[here], 2)
        solve = np.linalg.solve(design.T * weights @ design, design.T * weights)[0]
        np.testing.assert_allclose(found[:, k], solve @ values[here, :, k], rtol=1e-9)
        np.testing.assert_allclose(noise[k], np.square(solve).sum(), rtol=1e-9)


def test_values_may_be_shifted_afterwards():
    rng = np.random.default_rng(1)
    values, by = rng.standard_normal((6, 2, 2)), np.array([3.0, -1.0])
    late, early = Slopes(2, 2, 3.0), Slopes(2, 2, 3.0)
    all_seen, second = np.ones(2, dtype=bool), np.array([False, True])
    for x in values:
        late.wait(1.0)
        early.wait(1.0)
        late.add(x, all_seen)
        early.add(x + second[:, np.newaxis] * by, all_seen)
    late.shift(second, by)
    np.testing.assert_allclose(late.values, early.values, rtol=1e-12)


@pytest.mark.parametrize("start", [0.0, 0.3, 1 - 1e-12])
def test_draws_come_as_often_as_their_share(start):
    weights = np.array([0.0, 0.31, 0.0, 0.05, 0.64, 0.0])
    counts = np.bincount(systematic(weights, start, 10), minlength=6)
    assert counts.sum() == 10
    assert (np.abs(counts - 10 * weights) < 1).all()


def test_the_median_is_where_half_of_the_weight_lies():
    values = np.array([5.0, 1.0, 3.0])
    assert weighted_median(values, np.array([0.2, 0.5, 0.3])) == 1
    assert weighted_median(values, np.array([0.2, 0.4, 0.4])) == 3
    assert weighted_median(values, np.array([0.6, 0.2, 0.2])) == 5


def test_rates_keep_their_spread_and_memory():
    pace, clock = Pace(0.4, 5.0), Clock(1e9, 1e9)
    rng = np.random.default_rng(0)
    particles = Particles(np.zeros(4000), pace.begin(rng, 4000))
    before = particles.logs
    particles.move(5.0, pace, clock, rng)
    assert abs(particles.logs.std() - 0.4) < 0.02
    assert abs(np.corrcoef(before, particles.logs)[0, 1] - np.exp(-1)) < 0.05
    assert abs(np.median(particles.phases) / 5 - 1) < 0.02


def test_what_is_over_begins_anew_as_often_in_one_step_as_in_many():
    pace, clock, rng = Pace(0.0, 1.0), Clock(50.0, 100.0), np.random.default_rng(0)
    shares = []
    for steps in (1, 10):
        over = np.ones(5000, dtype=bool)
        for _ in range(steps):
            particles = Particles(np.full(5000, 50.0), np.zeros(5000))
            over &= ~particles.move(10 / steps, pace, clock, rng)
        shares.append(over.mean())
    np.testing.assert_allclose(shares, 0.99**10, atol=0.02)


def test_a_process_is_found_again():
    """Drawn with a length scale of 8 frames, and told in steps of half a frame."""
    rng, times = np.random.default_rng(0), np.arange(120.0) / 2
    scaled = np.sqrt(3) * np.abs(times[:, np.newaxis] - times) / 8
    root = np.linalg.cholesky((1 + scaled) * np.exp(-scaled) + 1e-9 * np.eye(120))
    mixing = np.array([[1.0, 0.0], [0.8, 0.6]])
    drawn = root @ rng.standard_normal((60, 120, 2)) @ mixing.T
    process = Process.learn(drawn, 0.5)
    assert abs(process.length_scale - 8) < 1.5
    flat = drawn.reshape(-1, 2)
    moments = flat.T @ flat / len(flat)
    expected = (moments + np.diag(np.diag(moments))) / 2
    np.testing.assert_allclose(process.covariance, expected, rtol=1e-12)
