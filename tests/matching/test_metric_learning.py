"""The learnt metric against loops over pairs and frames; reliable and unreliable features."""

from itertools import combinations

import numpy as np
import pytest
from scipy.ndimage import gaussian_filter1d
from sklearn_motionsync.matching.metric import Evidence, Metric, metric_matrix, metric_of_matches

P = 24


@pytest.fixture
def curves():
    """Five trials of a movement of three features, and their velocities."""
    rng, t = np.random.default_rng(0), np.linspace(0, 1, P)
    X = []
    for _ in range(5):
        phase = t + rng.uniform(-0.1, 0.1) * np.sin(np.pi * t)
        x = np.column_stack([np.sin(5 * phase), np.cos(4 * phase), phase**2])
        X.append(x + 0.1 * gaussian_filter1d(rng.standard_normal((P, 3)), 2, axis=0) + 1)
    positions = np.stack(X)
    return positions, np.gradient(positions, axis=1)


def slow_compressed(velocity, energy=None):
    energy = energy or np.mean([v @ v for x in velocity for v in x])
    return np.array(
        [[v / np.sqrt(energy + np.sqrt(energy) * np.sqrt(v @ v)) for v in x] for x in velocity]
    )


def slow_matrix(block, differences):
    """(R + a)^-1 - (2 S + a)^-1 without its negative part, to the power 0.6, at equal energy."""
    frames = np.concatenate(list(block))
    spread = sum(np.outer(x, x) for x in frames) / len(frames)
    r = np.concatenate(differences)
    covariance = sum(np.outer(x, x) for x in r) / len(r)
    a = 0.03 * np.trace(spread) / len(spread) * np.eye(len(spread))
    ratio = np.linalg.inv(covariance + a) - np.linalg.inv(2 * spread + a)
    values, vectors = np.linalg.eigh(ratio)
    plain = vectors @ np.diag(np.clip(values, 0, None)) @ vectors.T
    out = vectors @ np.diag(np.clip(values, 0, None) ** 0.6) @ vectors.T
    return out * np.trace(plain @ spread) / np.trace(out @ spread)


def slow_differences(block, times, weight, compress=lambda x: x):
    """Of all pairs of an odd number of trials, in a circle, at the times of the later one."""
    out, frames = [], np.arange(P)
    for n, base in enumerate(compress(block)):
        for m, other in enumerate(block):
            if 0 < (m - n) % len(block) <= len(block) // 2:
                tau = times[n, m]
                moving = np.column_stack([np.interp(tau, frames, c) for c in other.T])
                (moving,) = compress([moving])
                rates = 1 - weight + weight * np.gradient(tau)
                out.append(base - rates[:, np.newaxis] * moving)
    return out


def slow_length(differences):
    """1 + 2 times the sum of the autocorrelations up to 0.3 of the clip, as far as they are > 0."""
    lags = range(1 + int(0.3 * P))
    r = [sum((x[: P - k] * x[k:]).sum() for x in differences) for k in lags]
    total = 1
    for value in r[1:]:
        if value <= 0:
            break
        total += 2 * value / r[0]
    return total


def some_times(n):
    rng, t = np.random.default_rng(1), np.linspace(0, 1, P)
    return np.array([[(P - 1) * t ** rng.uniform(0.8, 1.25) for _ in range(n)] for _ in range(n)])


def fixed_match(times):
    """A match with these times, whatever the features."""
    return lambda features, others: np.take_along_axis(times, others[:, :, np.newaxis], axis=1)


def test_metric_equals_loops_over_pairs_and_frames(curves):
    positions, velocity = curves
    times, seen = some_times(len(positions)), []

    def match(features, others):
        seen.append(features)
        assert sorted(map(sorted, pairs_of(others))) == sorted(map(list, combinations(range(5), 2)))
        return fixed_match(times)(features, others)

    metric, evidence = metric_of_matches(match, positions, velocity)
    fast = slow_compressed(velocity)
    unmatched = np.broadcast_to(np.arange(P, dtype=float), times.shape)
    first = slow_matrix(fast, slow_differences(fast, unmatched, 0))
    np.testing.assert_allclose(inner(seen[0]), fast_inner(fast, first), atol=1e-9)
    poses = np.array([x - x.mean(axis=0) for x in positions])
    energy = np.mean([v @ v for x in velocity for v in x])
    of_fast = slow_differences(velocity, times, 0.2, lambda x: slow_compressed(x, energy))
    of_poses = slow_differences(poses, times, 0)
    weight = slow_length(of_fast) / slow_length(of_poses)
    by_fast, by_poses = slow_matrix(fast, of_fast), slow_matrix(poses, of_poses)
    gram = fast_inner(fast, by_fast) + weight * fast_inner(poses, by_poses)
    # The largest of its principal parts that make 99 %, three at most.
    values, vectors = np.linalg.eigh(gram)
    count = min(3, 1 + np.searchsorted(np.cumsum(values[::-1]), 0.99 * values.sum()))
    expected = (vectors[:, -count:] * values[-count:]) @ vectors[:, -count:].T
    np.testing.assert_allclose(inner(metric(velocity, positions)), expected, atol=1e-9)
    assert metric.velocity.shape == metric.pose.shape == (3, count)
    after = total(of_fast, by_fast) + weight * total(of_poses, by_poses)
    before = total(slow_differences(fast, unmatched, 0), by_fast)
    before += weight * total(slow_differences(poses, unmatched, 0), by_poses)
    assert evidence.remaining == pytest.approx(after / before)


def total(differences, matrix):
    return sum(x @ matrix @ x for one in differences for x in one)


def pairs_of(others):
    return [(n, m) for n, some in enumerate(others.tolist()) for m in some]


def inner(features):
    """Inner products of all frames of all trials."""
    frames = np.concatenate(list(features))
    return frames @ frames.T


def fast_inner(block, matrix):
    frames = np.concatenate(list(block))
    return frames @ matrix @ frames.T


def test_metric_matrix_of_unreliable_features_is_zero():
    rng = np.random.default_rng(0)
    block = rng.standard_normal((6, 50, 3))
    spread = np.einsum("npk,npl->kl", block, block) / 300
    np.testing.assert_array_equal(metric_matrix(block, 2 * spread), 0)
    reliable = metric_matrix(block, np.diag([0.1, 2, 2]) * spread)
    assert reliable[0, 0] > 20 * abs(reliable[1:, 1:]).max()
    np.testing.assert_array_equal(metric_matrix(0 * block, 0 * spread), 0)


def test_constant_trials_give_no_metric():
    still = np.ones((4, P, 2))
    assert metric_of_matches(None, still - 1, 0 * still) is None
    assert metric_of_matches(None, np.random.default_rng(0).normal(size=(1, P, 2)), still) is None


def test_shares_add_up_to_one(curves):
    positions, velocity = curves
    metric, _ = metric_of_matches(fixed_match(some_times(5)), positions, velocity)
    shares = metric.shares(velocity, positions)
    assert shares.sum() == pytest.approx(1)
    first = metric.velocity * [[1], [0], [0]], 0 * metric.pose
    only = Metric(metric.features, metric.energy, *first)
    np.testing.assert_allclose(only.shares(velocity, positions), [1, 0, 0], atol=1e-12)


def test_loud_noise_is_left_out(curves):
    positions, velocity = curves
    rng, times = np.random.default_rng(0), some_times(5)
    noise = 100 * rng.standard_normal((2, 5, P, 4))
    alone, _ = metric_of_matches(fixed_match(times), positions, velocity)
    loud, fast = (np.concatenate(x, axis=2) for x in zip(noise, (positions, velocity), strict=True))
    found, _ = metric_of_matches(fixed_match(times), loud, fast)
    np.testing.assert_array_equal(found.features, alone.features + 4)
    np.testing.assert_allclose(found(fast, loud), alone(velocity, positions), atol=1e-9)
    np.testing.assert_array_equal(found.shares(fast, loud)[:4], 0)


def test_feature_that_agrees_once_matched_is_used():
    """A ripple without any agreement before matching."""
    rng, t = np.random.default_rng(0), np.linspace(0, 1, 60)
    bends = rng.uniform(-0.12, 0.12, 10)
    phases = [t + b * np.sin(np.pi * t) for b in bends]

    def ripple(p):
        return np.sin(100 * p) * np.exp(-np.square((p - 0.5) / 0.15))

    x = np.array([np.column_stack([np.sin(3 * p), ripple(p)]) for p in phases])
    times = 59 * np.array([[np.interp(p, q, t) for q in phases] for p in phases])
    velocity = np.gradient(x, axis=1)
    even = np.broadcast_to(np.arange(60.0), times.shape)
    assert metric_of_matches(fixed_match(even), x, velocity)[0].features.tolist() == [0]
    assert metric_of_matches(fixed_match(times), x, velocity)[0].features.tolist() == [0, 1]


def circle(times):
    """Of warps of all ordered pairs, those to the next ones in a circle."""
    n = len(times)
    return np.array([[times[b, (b + i) % n] for i in range(1, n // 2 + 1)] for b in range(n)])


def inconsistency(times):
    return Evidence.of(circle(times), 0.5).inconsistency


@pytest.mark.parametrize("n", [4, 7])
def test_inconsistency_equals_loops(n):
    """All triples whose three warps are known."""
    times, gaps, offsets = some_times(n), [], []
    for base in range(n):
        for one in range(1, n // 2 + 1):
            known = times[base, (base + one) % n]
            offsets += [abs(known[p] - p) for p in range(0, P, 4)]
            for other in range(1, one):
                middle = (base + other) % n
                to_middle, onwards = times[base, middle], times[middle, (base + one) % n]
                by_way = np.interp(to_middle, range(P), onwards)
                gaps.append(np.abs(by_way - known)[::4].mean())
    assert inconsistency(times) == pytest.approx(np.mean(gaps) / np.mean(offsets))


def test_inconsistency_of_nothing_is_unknown():
    still = np.broadcast_to(np.arange(50.0), (6, 6, 50))
    assert np.isnan(Evidence.of(circle(still), 1.0)).all()
    assert np.isnan(Evidence.of(circle(some_times(3)), 1.0)).all()
