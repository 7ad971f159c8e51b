"""Near-optimal paths against all admissible paths, and standard errors against repeated noise."""

import numpy as np
import pytest
from sklearn_motionsync.matching.costs import COSTS
from sklearn_motionsync.matching.matcher import Features, Matcher
from sklearn_motionsync.matching.refinement import Refiner
from sklearn_motionsync.matching.trellis import Trellis
from sklearn_motionsync.matching.uncertainty import coverage_factor, uncertainty_of_paths

from oracle import all_paths, path_cost, step_costs

P, REACH, MU = 7, 3, 0.4


def matcher_of(cost, n_frames=P):
    trellis = Trellis.on_clock(cost, n_frames, MU, max_offset=REACH / P, max_rate=2)
    return Matcher(Features(cost, 1, 0.0, None), trellis)


def expected(x, y, cost, times):
    """Mean distance of paths from times, the best one through each cell, by all of them."""
    costs, last = step_costs(cost, 2, 1), P - 1
    forward, backward = {}, {}
    for path in all_paths(P, range(3), 1, REACH):
        for p, q in enumerate(path):
            to = path_cost(x[: p + 1], y, path[: p + 1], costs, MU, 1)
            # The way from a cell is that of the reversed sequences.
            back = path_cost(x[::-1][: P - p], y[::-1], last - path[::-1][: P - p], costs, MU, 1)
            forward[p, q] = min(to, forward.get((p, q), np.inf))
            backward[p, q] = min(back, backward.get((p, q), np.inf))
    best = min(path_cost(x, y, path, costs, MU, 1) for path in all_paths(P, range(3), 1, REACH))
    out = []
    for p in range(P):
        cells = {q: forward[p, q] + backward[p, q] for q in range(P) if (p, q) in forward}
        least = min(cells.values())
        weights = {q: np.exp(-(c - least) / (0.1 * best)) for q, c in cells.items()}
        distance = sum(w * abs(q - times[p]) for q, w in weights.items())
        out.append(distance / sum(weights.values()))
    return np.array(out), best / (np.square(x).sum() + np.square(y).sum())


@pytest.mark.parametrize("cost", COSTS)
def test_spread_equals_that_of_all_paths(cost):
    rng = np.random.default_rng(0)
    base, moving = rng.standard_normal((1, P, 2)), rng.standard_normal((3, P, 2))
    times = np.sort(rng.uniform(0, P - 1, (3, P)), axis=1)
    times[:, 0], times[:, -1] = 0, P - 1
    found = uncertainty_of_paths(matcher_of(cost), base, moving, times)
    for y, tau, widths, share in zip(moving, times, found.half_widths, found.shares, strict=True):
        spread, best = expected(base[0], y, cost, tau)
        np.testing.assert_allclose(widths, 2.2 * spread, rtol=1e-9, atol=1e-9)
        np.testing.assert_allclose(share, best, rtol=1e-9)
    widest = np.minimum(2 * found.half_widths.max(axis=1) / (P - 1), 1)
    np.testing.assert_allclose(found.widest, widest)
    assert not found.is_normal.any()


def test_long_clocks_are_compared_at_81_frames():
    rng, shape = np.random.default_rng(0), (161, 3)
    base, moving = (np.cumsum(rng.standard_normal((n, *shape)), axis=1) for n in (1, 70))
    times = np.sort(rng.uniform(0, 160, (70, 161)), axis=1)
    found = uncertainty_of_paths(matcher_of("pose", 161), base, moving, times)
    half = uncertainty_of_paths(
        matcher_of("pose", 81), base[:, ::2], moving[:, ::2], times[:, ::2] / 2
    )
    widths = 2 * half.half_widths
    np.testing.assert_allclose(found.half_widths[:, ::2], widths, rtol=1e-9)
    between = (widths[:, 1:] + widths[:, :-1]) / 2
    np.testing.assert_allclose(found.half_widths[:, 1::2], between, rtol=1e-9)
    np.testing.assert_allclose(found.shares, half.shares, rtol=1e-9)
    np.testing.assert_allclose(found.widest, half.widest, rtol=1e-9)


def test_half_widths_grow_with_the_coverage():
    is_normal = np.array([True, False])
    np.testing.assert_allclose(coverage_factor(0.9, is_normal), 1)
    normal = coverage_factor(0.8, is_normal)[0], coverage_factor(0.95, is_normal)[0]
    np.testing.assert_allclose(normal, [1.2816 / 1.6449, 1.96 / 1.6449], rtol=1e-4)
    assert (coverage_factor(0.5, is_normal) < 1).all()
    np.testing.assert_allclose(coverage_factor(0.99, is_normal)[1], 2**1.2)


@pytest.mark.parametrize(("noise", "width"), [(0.02, 0.0), (0.3, 1.5)])
def test_standard_errors_are_those_of_repeated_noise(noise, width):
    """The root mean square of the errors of a warp whose noise is drawn anew."""
    n_frames, rng = 80, np.random.default_rng(0)
    t = np.linspace(0, 1, n_frames)[:, np.newaxis]
    true = t + 0.05 * np.sin(np.pi * t) * np.sin(2 * np.pi * t)
    waves, shift = np.arange(1, 9), np.linspace(0, 5, 8)

    def movement(phase):
        return np.sin(3 * waves * phase + shift)

    draws = noise * rng.standard_normal((2, 60, n_frames, 8))
    base, moving = movement(true) + draws[0], movement(t) + draws[1]
    times = np.tile((n_frames - 1) * true[:, 0], (60, 1))
    errors, stated = np.empty(times.shape), np.empty(times.shape)
    for i, (x, y) in enumerate(zip(base, moving, strict=True)):
        refiner = Refiner.of(x, width)
        refined = refiner(y[np.newaxis], times[i : i + 1], 20)
        errors[i] = refined[0] - times[i]
        stated[i] = refiner.standard_errors(y[np.newaxis], refined)[0]
    middle = slice(8, -8)
    found = np.sqrt(np.square(errors).mean(axis=0))[middle].mean()
    ratio = np.median(stated[:, middle].mean(axis=1)) / found
    assert 0.8 < ratio < 1.4
    assert (stated[:, [0, -1]] == 0).all()


def test_standard_errors_of_stretches_that_stand_still():
    """Where nothing moves the errors are largest; equal sequences have none."""
    t = np.clip(np.linspace(-1, 1.0, 80), 0, None)[:, np.newaxis]
    base = np.hstack([np.sin(4 * t), t**2])
    noise = 0.01 * np.random.default_rng(0).standard_normal((1, 80, 2))
    times = np.arange(80.0)[np.newaxis]
    refiner = Refiner.of(base, 0.0)
    errors = refiner.standard_errors(base + noise * (t > 0), times)[0]
    assert np.isfinite(errors).all()
    assert errors[10:35].mean() > 3 * errors[45:70].mean() > 0
    np.testing.assert_allclose(refiner.standard_errors(base[np.newaxis], times), 0, atol=1e-8)
    still = np.ones((1, 80, 2))
    none = Refiner.of(still[0], 0.0).standard_errors(still, times)
    np.testing.assert_array_equal(none, 0)
