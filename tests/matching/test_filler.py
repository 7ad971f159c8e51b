"""Gaps in the trellis against all admissible paths, and what fills them against slow versions."""

import numpy as np
import pandas as pd
import pytest
from scipy.interpolate import Akima1DInterpolator, CubicSpline
from sklearn_motionsync.matching import tile as module
from sklearn_motionsync.matching.anchors import KeyframeColumns, add_ramps
from sklearn_motionsync.matching.costs import COSTS, step_table
from sklearn_motionsync.matching.gaps import (
    SHRINKAGE,
    Filler,
    fill_by_take,
    interpolate_gaps,
    moments_of_seen,
)
from sklearn_motionsync.matching.trellis import Trellis

from oracle import known_paths, step_costs

KEPT = {"rows": (0, 10**9), "choices": (0, 0), "small": (10**6, 0)}


@pytest.fixture(params=KEPT)
def kept(request, monkeypatch):
    """What is kept of a tile."""
    small_bytes, row_bytes = KEPT[request.param]
    monkeypatch.setattr(module, "SMALL_BYTES", [small_bytes] * 2)
    monkeypatch.setattr(module, "ROW_BYTES", row_bytes)


def cost_of(path, base, other, costs, mu, unseen, subframes=1):
    """The cost of one path with gaps, added up frame by frame; weights are the last column."""
    total = 0.0
    for p, q in enumerate(path):
        b, g, phi = costs[subframes if p == 0 else q - path[p - 1]]
        x, y, w = base[p, :2], other[q, :2], base[p, 2] * other[q, 2]
        total += w * (x @ x + b * (y @ y) - g * (x @ y)) + (1 - w) * unseen + (p > 0) * mu * phi
    return total


def draw(seed, n_frames, subframes, exact):
    """Bases and moving sequences with a column of weights.

    Exact ones are multiples of powers of two, so that no sum is rounded.
    """
    rng, out = np.random.default_rng(seed), []
    for n, length in ((3, n_frames), (4, (n_frames - 1) * subframes + 1)):
        if exact:
            x, w = rng.integers(-3, 4, (n, length, 2)) / 2, rng.integers(0, 3, (n, length)) / 2
        else:
            x, w = rng.standard_normal((n, length, 2)), rng.random((n, length))
            # Whole frames that were not seen, and such that were.
            w[rng.random(w.shape) < 0.3], w[rng.random(w.shape) < 0.3] = 0, 1
        out.append(np.concatenate([x, w[:, :, np.newaxis]], axis=2))
    return out


CASES = [(6, 2, 1, 2, 0.5, 0.25), (6, 3, 1, 3, 0.75, 0.5), (5, 2, 2, 2, 0.5, 1.0)]


@pytest.mark.parametrize("case", CASES)
@pytest.mark.parametrize("cost", [*COSTS, "exact"])
def test_best_path_with_gaps_equals_all_admissible_paths(case, cost, kept):
    n_frames, max_rate, subframes, reach, mu, unseen = case
    exact, cost = cost == "exact", "pose" if cost == "exact" else cost
    bases, moving = draw(n_frames, n_frames, subframes, exact)
    costs = step_costs(cost, max_rate, subframes)
    trellis = Trellis(step_table(cost, max_rate, subframes), mu, reach, unseen=unseen)
    distances = trellis.distances(bases, moving)
    disparities, lengths = trellis.paths_and_costs(bases, moving)
    for n, base in enumerate(bases):
        given = trellis.costs(base, moving, disparities[n])
        for m, other in enumerate(moving):
            totals = {
                tuple(path): cost_of(path, base, other, costs, mu, unseen, subframes)
                for path in known_paths(n_frames, tuple(sorted(costs)), subframes, reach)
            }
            best, path = min(totals.values()), disparities[n, m] + subframes * np.arange(n_frames)
            assert totals[tuple(path)] <= best + 1e-9 * max(1.0, best)
            if exact:
                # To the last bit.
                assert distances[n, m] == lengths[n, m] == given[m] == best
            found = [distances[n, m], lengths[n, m], given[m]]
            np.testing.assert_allclose(found, best, rtol=1e-12, atol=1e-12)


def test_ties_take_the_same_step_in_every_way_of_back_tracking(monkeypatch):
    bases, moving = draw(3, 7, 1, exact=True)
    trellis = Trellis(step_table("pose", 2, 1), 0.25, 3, unseen=0.5)
    found = []
    for small_bytes, row_bytes in KEPT.values():
        monkeypatch.setattr(module, "SMALL_BYTES", [small_bytes] * 2)
        monkeypatch.setattr(module, "ROW_BYTES", row_bytes)
        found.append(trellis.paths(bases, moving))
    np.testing.assert_array_equal(found[0], found[1])
    np.testing.assert_array_equal(found[0], found[2])


def test_gaps_and_keyframes_together_equal_all_admissible_paths():
    bases, moving = draw(5, 6, 1, exact=False)
    keyframes = np.array([[0.4], [0.2], [np.nan]]), np.array([[0.6], [np.nan], [0.2], [0.8]])
    bases, moving = (
        np.array(add_ramps(list(x), k)) for x, k in zip((bases, moving), keyframes, strict=True)
    )
    mu, unseen, costs = 0.3, 0.6, step_costs("velocity", 2, 1)
    anchors = KeyframeColumns(1, 0.0).on_clock(6, 0.1)
    trellis = Trellis(step_table("velocity", 2, 1), mu, 3, anchors=anchors, unseen=unseen)
    shares, penalties = anchors.left(bases)[..., 0], anchors.right(moving)[..., 0]
    distances = trellis.distances(bases, moving)
    for n, base in enumerate(bases):
        for m, other in enumerate(moving):
            totals = []
            for path in known_paths(6, tuple(sorted(costs)), 1, 3):
                only = cost_of(path, base, other, costs, mu, unseen)
                totals.append(only + shares[n] @ penalties[m, path])
            np.testing.assert_allclose(distances[n, m], min(totals), rtol=1e-12)


# -- what fills gaps ------------------------------------------------------------------------


def curves(n=6, n_frames=80, seed=0):
    """Trials of five features: three that move by two hidden ones, and these."""
    rng, t = np.random.default_rng(seed), np.linspace(0, 1, n_frames)
    out = []
    for _ in range(n):
        a = np.sin(2 * np.pi * (1.5 * t + 0.1 * rng.random()))
        b = np.cos(2 * np.pi * (2.5 * t + 0.1 * rng.random()))
        out.append(np.column_stack([a, b, a + b, a - 2 * b, 3 * b + 0.5]))
    return out


def correlations(n_frames, value_time, velocity_time):
    """Of the frames of an autoregression of second order, by the roots of its polynomial."""
    p, q = np.exp(-1 / value_time), np.exp(-1 / velocity_time)
    lags = np.abs(np.subtract.outer(np.arange(n_frames), np.arange(n_frames)))
    of_p, of_q = p ** (lags + 1) * (1 - q**2), q ** (lags + 1) * (1 - p**2)
    return (of_p - of_q) / ((p - q) * (1 + p * q))


def of_times(value_time, velocity_time):
    learnt = Filler.learn(curves())
    times = value_time, velocity_time
    return Filler(learnt.mean, learnt.scale, learnt.precision, learnt.variance, times)


@pytest.mark.parametrize("velocity_time", [0.3, 1.9])
def test_hidden_values_are_the_conditional_expectation_of_all_their_values(velocity_time):
    """Against one covariance of all values of a trial: frames times features."""
    filler = of_times(12.0, velocity_time)
    array, rng = curves(1, 30, seed=7)[0], np.random.default_rng(2)
    hidden = np.zeros(array.shape, dtype=bool)
    for feature in range(5):
        for first in rng.integers(1, 24, 2):
            # Gaps of one frame are interpolated.
            hidden[first : first + rng.integers(2, 6), feature] = True
    hidden[:9, 1], hidden[25:, 2], hidden[14:16] = True, True, True
    hidden[:, 4] |= ~hidden[:, 4] & np.roll(hidden[:, 4], 1)
    array[hidden] = np.nan
    covariance = np.kron(correlations(30, 12.0, velocity_time), np.linalg.inv(filler.precision))
    z, gone = ((array - filler.mean) / filler.scale).ravel(), hidden.ravel()
    across = covariance[np.ix_(gone, ~gone)]
    z[gone] = across @ np.linalg.solve(covariance[np.ix_(~gone, ~gone)], z[~gone])
    expected = z.reshape(array.shape) * filler.scale + filler.mean
    np.testing.assert_allclose(filler.expect(array), expected, atol=1e-7)
    np.testing.assert_array_equal(filler(array)[0], filler.expect(array))


def test_weights_are_what_is_known_of_a_step_in_the_middle_of_a_gap():
    """Against the covariance of all values of a trial, given what was seen."""
    filler = of_times(12.0, 3.0)
    array = curves(1, 30, seed=7)[0]
    gaps = {(8, 15): [1, 3], (20, 29): [0], (3, 3): [2]}
    for (first, last), features in gaps.items():
        array[first : last + 1, features] = np.nan
    in_time, covariance = correlations(30, 12.0, 3.0), np.linalg.inv(filler.precision)
    unknown = np.zeros((30, 5))
    for (first, last), features in gaps.items():
        gone, seen = np.arange(first, last + 1), np.delete(np.arange(30), range(first, last + 1))
        # Of a feature that is hidden at these frames alone, given it at all others.
        across = in_time[np.ix_(gone, seen)]
        left = np.zeros((30, 30))
        left[np.ix_(gone, gone)] = in_time[np.ix_(gone, gone)] - across @ np.linalg.solve(
            in_time[np.ix_(seen, seen)], across.T
        )
        # The trellis smooths by a frame of thirty.
        step = np.zeros(30)
        middle = (first + last + 1) // 2
        step[[middle - 1, middle + 1]] = -1, 1
        others = np.setdiff1d(range(5), features)
        across = covariance[np.ix_(features, others)]
        share = covariance[np.ix_(features, features)] - across @ np.linalg.solve(
            covariance[np.ix_(others, others)], across.T
        )
        # The noise of a feature is no movement.
        share = share.diagonal() - SHRINKAGE
        unknown[first : last + 1, features] = share * (step @ left @ step) / (step @ in_time @ step)
    expected = 1 - unknown @ filler.variance / filler.variance.sum()
    np.testing.assert_allclose(filler(array)[1], expected, atol=1e-9)
    assert expected[3] == 1 > expected[[8, 20]].max()


def test_moments_are_those_of_the_poses_that_show_them():
    rng = np.random.default_rng(3)
    arrays = [rng.standard_normal((n, 4)).cumsum(axis=0) for n in (30, 50)]
    for array in arrays:
        array[rng.random(array.shape) < 0.2] = np.nan
    mean, covariance = moments_of_seen(arrays)
    rows = np.concatenate(arrays)
    np.testing.assert_allclose(mean, np.nanmean(rows, axis=0), rtol=1e-12)
    slow = np.empty((4, 4))
    for i in range(4):
        for j in range(4):
            slow[i, j] = np.nanmean((rows[:, i] - mean[i]) * (rows[:, j] - mean[j]))
    assert np.linalg.eigvalsh(slow).min() > 0
    np.testing.assert_allclose(covariance, slow, rtol=1e-10)


def test_moments_have_no_negative_variance():
    """Three features, no two of which are seen together but in ways that exclude each other."""
    a = np.array([1.0, -1.0, 2.0, -2.0])
    nothing = np.full(4, np.nan)
    pairs = [[a, a, nothing], [a, nothing, a], [nothing, a, -a]]
    _, covariance = moments_of_seen([np.stack(columns, axis=1) for columns in pairs])
    expected = 2.5 * np.array([[1, 1, 1], [1, 1, -1], [1, -1, 1]])
    values, vectors = np.linalg.eigh(expected)
    assert values[0] < 0
    np.testing.assert_allclose(covariance, (vectors * np.abs(values)) @ vectors.T)


# -- interpolation ------------------------------------------------------------------------


@pytest.mark.parametrize(("way", "method"), [("akima",) * 2, ("cubic",) * 2, ("line", "index")])
def test_gaps_are_interpolated_column_by_column(way, method):
    """Against pandas, which calls SciPy's polynomials, or NumPy's lines."""
    rng = np.random.default_rng(0)
    values = rng.standard_normal((60, 6)).cumsum(axis=0)
    values[rng.random(values.shape) < 0.4] = np.nan
    values[:, 4], values[3:, 5], values[:3, 5] = np.nan, np.nan, [1, np.nan, 2]
    before = values.copy()
    times = np.cumsum(rng.integers(1, 3, 60)).astype(float)
    table = pd.DataFrame(values, index=times)
    expected = pd.DataFrame(index=times, columns=table.columns, dtype=float)
    for k in range(6):
        by = method if table[k].count() > 2 else "index"
        column = table[k].interpolate(by, limit_area="inside") if table[k].count() else table[k]
        expected[k] = column
    filled = interpolate_gaps(values, times=times, way=way)
    np.testing.assert_allclose(filled, expected, rtol=1e-12)
    held = interpolate_gaps(values, times=times, held=True, way=way)
    np.testing.assert_allclose(held, expected.ffill().bfill(), rtol=1e-12)
    np.testing.assert_array_equal(values, before)


def test_longer_gaps_stay_hidden():
    values = np.arange(20.0)[:, np.newaxis] * [1, 2]
    values[4:6, 0] = values[9:12, 0] = values[:2, 1] = values[17:, 1] = np.nan
    hidden = np.isnan(interpolate_gaps(values, 2))
    assert np.flatnonzero(hidden[:, 0]).tolist() == [9, 10, 11]
    assert np.flatnonzero(hidden[:, 1]).tolist() == [0, 1, 17, 18, 19]
    held = interpolate_gaps(values, 2, held=True)
    np.testing.assert_array_equal(held[:2, 1], [4, 4])
    assert np.isnan(held[17:, 1]).all()
    # Frames that were dropped count.
    times = np.where(np.arange(20) < 5, 0, 1) + np.arange(20)
    assert np.isnan(interpolate_gaps(values, 2, times)[4:6, 0]).all()
    filled = interpolate_gaps(values, 3, times, way="line")
    np.testing.assert_allclose(filled[4:6, 0], [3 + 3 / 4, 3 + 9 / 4])


def test_ends_are_held_and_a_feature_never_seen_has_its_mean():
    flat = [np.full((30, 2), 3.0) + np.arange(2) for _ in range(4)]
    filler = Filler.learn(flat)
    gappy = flat[0].copy()
    gappy[:8, 0], gappy[:, 1] = np.nan, np.nan
    filled, _ = filler(gappy)
    np.testing.assert_allclose(filled, flat[0])


# -- a take by its own frames ---------------------------------------------------------------


def cut(points, *gaps):
    """A copy of points (n_frames, n_points, n_dims) with gaps (first, end, points)."""
    out = points.copy()
    for first, end, chosen in gaps:
        out[first:end, chosen] = np.nan
    return out


def walking(seed, n_frames=120, n_points=6, n_sources=3):
    """Points that all follow a few smooth sources."""
    rng = np.random.default_rng(seed)
    sources = interpolate_gaps(
        np.where(np.arange(n_frames)[:, None] % 6, np.nan, rng.normal(size=(n_frames, n_sources))),
        held=True,
        way="cubic",
    )
    return (sources @ rng.normal(size=(n_sources, 3 * n_points))).reshape(n_frames, n_points, 3)


def guesses_slowly(points, chosen, others, first, end):
    """By least squares with one row more for each penalty, and splines of the frames around."""
    n, others = len(points), points[:, others]
    middle, trends = others.mean(axis=1, keepdims=True), [np.zeros((n, 3 * len(chosen)))]
    for place in (0 * middle, middle):
        wanted = (points[:, chosen] - place).reshape(n, -1)
        poses = (others - place).reshape(n, -1)
        seen, poses = ~np.isnan(wanted).any(axis=1), poses - poses.mean(axis=0)
        energy, wanted = np.square(poses[seen]).sum(), wanted - wanted[seen].mean(axis=0)
        poses = np.column_stack([poses, np.full(n, np.sqrt(energy / seen.sum()))])
        seen[first:end] = False
        for ridge in (1e-1, 1e-3, 1e-6):
            penalties = np.sqrt(ridge * energy / poses.shape[1]) * np.eye(poses.shape[1])
            left = np.vstack([poses[seen], penalties])
            right = np.vstack([wanted[seen], np.zeros((len(penalties), wanted.shape[1]))])
            slopes = np.linalg.lstsq(left, right, rcond=None)[0]
            trends.append(poses @ slopes + np.tile(place[:, 0], len(chosen)))
    wanted, gap = points[:, chosen].reshape(n, -1), np.arange(first, end)
    joins = [np.interp, lambda x, *known: Akima1DInterpolator(*known)(x)]
    joins.append(lambda x, *known: CubicSpline(*known)(x))
    guesses = np.empty((3, len(trends), len(gap), wanted.shape[1]))
    for g, trend in enumerate(trends):
        for c, rest in enumerate((wanted - trend).T):
            near = [t for t in range(max(0, first - 10), min(n, end + 10)) if np.isfinite(rest[t])]
            near = [t for t in near if t not in gap]
            for way, join in enumerate(joins):
                guesses[way, g, :, c] = trend[gap, c] + join(gap, near, rest[near])
    return guesses.reshape(-1, len(gap), wanted.shape[1]), wanted


def test_a_gap_is_the_mean_of_guesses_weighed_by_their_errors_elsewhere():
    rng = np.random.default_rng(1)
    points = walking(0, 60) + 0.3 * rng.normal(size=(60, 6, 3)).cumsum(axis=0)
    gappy = cut(points, (20, 29, [1, 4]), (45, 46, [1]))
    filled = fill_by_take(gappy)
    errors, others = [], [0, 2, 3, 5]
    seen = ~np.isnan(gappy[:, [1, 4]]).any(axis=(1, 2))
    for length in (9, 5):
        starts = [k for k in range(2, 59 - length) if seen[k - 2 : k + length + 2].all()]
        for place in np.linspace(0, len(starts) - 1, 10):
            k = starts[int(place + 0.5)]
            guesses, wanted = guesses_slowly(gappy, [1, 4], others, k, k + length)
            apart = guesses - wanted[k : k + length]
            errors.append(np.sqrt(np.square(apart).mean(axis=(1, 2))))
    weights = np.exp(np.log(errors).mean(axis=0)) ** -12.0
    weights /= weights.sum()
    guesses, _ = guesses_slowly(gappy, [1, 4], others, 20, 29)
    expected = np.einsum("g,gtc->tc", weights, guesses)
    assert np.sort(weights)[-3] > 0.05
    np.testing.assert_allclose(filled[20:29, [1, 4]].reshape(9, -1), expected, rtol=1e-7)
    np.testing.assert_array_equal(filled[~np.isnan(gappy)], gappy[~np.isnan(gappy)])


def test_what_follows_the_other_points_is_filled_exactly():
    points = walking(3)
    gappy = cut(points, (30, 70, [0, 2]), (50, 58, [4]), (100, 103, [1]))
    error = np.abs(fill_by_take(gappy) - points).max()
    assert error < 2e-3 < 1 < np.abs(fill_by_take(gappy[:, [0]]) - points[:, [0]]).max()
    moved = fill_by_take(1000 * gappy + 5e4) / 1000 - 50
    np.testing.assert_allclose(moved, fill_by_take(gappy), atol=1e-7)


def test_what_no_other_point_tells_is_left_to_the_line():
    """Random walks, of which the line is what is expected."""
    errors = {"filled": [], "line": []}
    for seed in range(20):
        points = np.random.default_rng(seed).normal(size=(200, 4, 3)).cumsum(axis=0)
        gappy = cut(points, (90, 110, [1]))
        line = interpolate_gaps(gappy.reshape(200, -1), way="line").reshape(points.shape)
        for name, filled in (("filled", fill_by_take(gappy)), ("line", line)):
            errors[name].append(np.square(filled - points).sum())
    assert np.sum(errors["filled"]) < 1.05 * np.sum(errors["line"])


def test_a_wrong_frame_near_a_gap_does_not_ring_in_it():
    """A cubic spline through it would be 480 away, and Akima's polynomials are 0.4."""
    rng, t = np.random.default_rng(0), np.linspace(0, 1, 300)[:, np.newaxis, np.newaxis]
    frequencies, phases = rng.uniform(3, 6, (5, 3)), rng.uniform(0, 6, (5, 3))
    points = np.sin(2 * np.pi * frequencies * t + phases)
    given = points.copy()
    given[141, 0, 0] += 100
    given[120:140, 0] = np.nan
    assert np.abs(fill_by_take(given) - points)[120:140, 0].max() < 0.4


def test_gaps_that_are_long_or_touch_an_end_stay_and_short_takes_are_interpolated():
    points = walking(5)
    gappy = cut(points, (0, 4, [1]), (40, 49, [2]), (60, 70, [3]), (115, 120, [1]), (0, 120, [5]))
    hidden = np.isnan(fill_by_take(gappy, 9)).all(axis=2)
    assert [np.flatnonzero(hidden[:, k]).size for k in range(6)] == [0, 9, 0, 10, 0, 120]
    # A frame that was dropped counts.
    times = np.arange(120) + (np.arange(120) > 43)
    assert np.isnan(fill_by_take(gappy, 9, times)[40:49, 2]).all()
    short = cut(points[:12], (3, 9, [0]))
    by_itself = interpolate_gaps(short.reshape(12, -1)).reshape(short.shape)
    np.testing.assert_array_equal(fill_by_take(short), by_itself)
