"""Variances and bands of new people: against loops, closed forms and simulated people."""

import numpy as np
import pytest
from scipy.stats import t as student
from sklearn_motionsync.model.variation import (
    mean_band,
    predictive_variance,
    simultaneous_factor,
    within_variance,
)

GROUPS = np.array([3, 0, 0, 7, 7, 7, 3, 1])


def people(sizes, seed=0, n_frames=15, n_features=2, own=0.5):
    """Smooth trials of people who differ, with a mean of 0, and whose they are."""
    rng = np.random.default_rng(seed)
    t = np.linspace(0, 1, n_frames)
    waves = np.stack([np.ones_like(t), np.sin(3 * t), np.cos(5 * t), np.sin(8 * t)])
    groups = np.repeat(np.arange(len(sizes)), sizes)
    persons, moods = (
        np.einsum("nkf,kp->npf", rng.standard_normal((n, 4, n_features)), waves)
        for n in (len(sizes), len(groups))
    )
    amplitudes = (1 + 0.6 * np.sin(4 * t))[:, np.newaxis] * 10.0 ** np.arange(n_features)
    return (persons[groups] + own * moods) * amplitudes, groups


def hidden(X):
    """A copy with gaps: in some values the second trial of a group is alone, or none is seen."""
    X = X.copy()
    X[[0, 1, 3, 4, 5], :6, 1] = np.nan
    X[2, 9:, 0] = np.nan
    return X


def slow_variance(X, groups):
    """Value by value, of what is shown of the trial and of any other one."""
    squares = np.full(X.shape, np.nan)
    for i, p, k in np.ndindex(X.shape):
        others = X[groups != groups[i], p, k]
        if not np.isnan(others).all():
            squares[i, p, k] = (X[i, p, k] - np.nanmean(others)) ** 2
    n, s2 = (~np.isnan(squares)).sum(axis=0), np.nanmean(squares, axis=0)
    return ((n - 1) * s2 + 5 * s2.mean(axis=0)) / (n + 4) * (1 + 1 / n)


def slow_factor(X, groups, coverage):
    logs = []
    for group in set(groups):
        others, whose = X[groups != group], groups[groups != group]
        mean, std = np.nanmean(others, axis=0), np.sqrt(slow_variance(others, whose))
        logs += [np.log(np.nanmax(np.abs((x - mean) / std))) for x in X[groups == group]]
    n = len(logs)
    variance = ((n - 1) * np.var(logs, ddof=1) + 3 * 0.1) / (n + 2)
    return np.exp(np.mean(logs) + student(n + 2).ppf(coverage) * np.sqrt(variance * (1 + 1 / n)))


def inside(new, X, groups, coverage):
    """The share of new trials that lie within the simultaneous band as a whole."""
    reach = simultaneous_factor(X, groups, coverage) * np.sqrt(predictive_variance(X, groups))
    return (np.abs(new - X.mean(axis=0)) <= reach).all(axis=(1, 2)).mean()


# -- formulas -------------------------------------------------------------------------


@pytest.mark.parametrize("groups", [GROUPS, np.arange(8)])
def test_predictive_variance_and_simultaneous_factor_equal_slow_loops(groups):
    X, _ = people([1] * 8)
    for some in (X, hidden(X)):
        np.testing.assert_allclose(predictive_variance(some, groups), slow_variance(some, groups))
    some = X.copy()
    some[1, 3:6, 0] = some[4, 9, 1] = np.nan
    for coverage in (0.5, 0.8, 0.95, 0.99):
        for given in (X, some):
            found = simultaneous_factor(given, groups, coverage)
            np.testing.assert_allclose(found, slow_factor(given, groups, coverage))


def slow_within(X, groups):
    """Value by value, of what is shown."""
    s2, d = np.full(X.shape[1:], np.nan), np.zeros(X.shape[1:])
    for p, k in np.ndindex(s2.shape):
        total = 0
        for group in set(groups):
            seen = [x[p, k] for x in X[groups == group] if not np.isnan(x[p, k])]
            if len(seen) > 1:
                total += np.square(np.array(seen) - np.mean(seen)).sum()
                d[p, k] += len(seen) - 1
        if d[p, k]:
            s2[p, k] = total / d[p, k]
    mean = np.nanmean(s2, axis=0)
    return np.where(d > 0, (d * np.nan_to_num(s2) + 5 * mean) / (d + 5), mean)


def test_within_variance_equals_slow_loop():
    X, _ = people([1] * 8)
    for some, groups in ((X, GROUPS), (X, np.zeros(8, dtype=int)), (hidden(X), GROUPS)):
        np.testing.assert_allclose(within_variance(some, groups), slow_within(some, groups))


def test_without_two_trials_of_anyone_the_variance_within_is_a_share():
    X, groups = people([1] * 6)
    np.testing.assert_allclose(within_variance(X, groups), 0.32 * predictive_variance(X, groups))
    # The second feature is never seen twice in a group.
    groups, X = np.array([0, 0, 1, 1, 2, 2]), X.copy()
    X[::2, :, 1] = np.nan
    expected = 0.32 * predictive_variance(X, groups)[:, 1]
    np.testing.assert_allclose(within_variance(X, groups)[:, 1], expected)
    expected = slow_within(X[..., :1], groups)[:, 0]
    np.testing.assert_allclose(within_variance(X, groups)[:, 0], expected)


def test_the_factor_of_two_trials():
    """Of one there is no variance to judge the other by: the log's is taken to be large."""
    X, groups = people([1, 1])
    z = np.abs(X[0] - X[1]) / np.sqrt(slow_variance(X, groups))
    expected = z.max() * np.exp(student(4).ppf(0.9) * np.sqrt(3 / 4 * 1.5))
    np.testing.assert_allclose(simultaneous_factor(X, groups, 0.9), expected)


@pytest.mark.parametrize("n", [3, 8, 30])
def test_band_of_one_number_is_the_t_interval(n):
    """One frame of one feature of people who come once: mean +- t s / sqrt(n)."""
    x = np.random.default_rng(n).standard_normal((n, 1, 1))
    found = np.mean([mean_band(x, np.arange(n), 0.9, seed) for seed in range(10)])
    expected = student(n - 1).ppf(0.95) * x.std(ddof=1) / np.sqrt(n)
    np.testing.assert_allclose(found, expected, rtol=0.02)


@pytest.mark.parametrize("sizes", [[1] * 6, [2] * 6, [4, 1, 2, 3, 1, 2]])
def test_band_is_proportional_to_the_jackknife_error(sizes):
    """By the mean without a group, drawn to its mean over the frames; times one factor."""
    X, groups = people(sizes)
    # Far from the origin, which has no part in it.
    X += 100
    gappy, factors = X.copy(), []
    gappy[: sizes[0], 4, 1] = np.nan
    for some in (X, gappy):
        moved = [np.nanmean(some[groups != g], axis=0) for g in range(len(sizes))]
        moved -= np.nanmean(some, axis=0)
        # A group that does not show a value moves nothing.
        n = len(sizes) - np.isnan(some).any(axis=0)
        squares = (n - 1) / n * np.square(moved).sum(axis=0)
        shrunk = ((n - 1) * squares + 5 * squares.mean(axis=0)) / (n + 4)
        factors.append(mean_band(some, groups, 0.95, 0) / np.sqrt(shrunk))
        np.testing.assert_allclose(factors[-1], factors[-1][0, 0])
    pointwise = student(len(sizes) - 1).ppf(0.975)
    assert 0.8 * pointwise < factors[0][0, 0] < 5 * pointwise
    # Where a group is not seen, the largest |t| is larger.
    assert 1 < factors[1][0, 0] / factors[0][0, 0] < 1.1


def test_a_band_of_the_mean_repeats_with_its_random_state():
    X, groups = people([2] * 6)
    a, b, c = (mean_band(X, groups, 0.95, seed) for seed in (1, 1, 2))
    np.testing.assert_array_equal(a, b)
    assert not np.array_equal(a, c)
    np.testing.assert_allclose(a, c, rtol=0.1)
    # It says where the mean is, not where people are.
    c = simultaneous_factor(X, groups, 0.95)
    assert (a < c * np.sqrt(predictive_variance(X, groups))).all()


# -- limits -----------------------------------------------------------------------------


def test_variance_of_identical_trials_is_the_floor():
    X = np.repeat(people([1])[0], 5, axis=0)
    v = predictive_variance(X, np.arange(5))
    np.testing.assert_allclose(v, np.broadcast_to(1e-9 * X[0].var(axis=0), v.shape))
    # Rounding is not a departure, anything else is.
    assert inside(X[:1] * (1 + 1e-12), X, np.arange(5), 0.95) == 1
    assert inside(X[:1] * 1.01, X, np.arange(5), 0.95) == 0
    assert (mean_band(X, np.arange(5), 0.95, 0) <= 1e-12).all()
    assert (within_variance(X, np.array([0, 0, 0, 1, 1])) > 0).all()
    # Nor is there any movement.
    assert (predictive_variance(np.zeros((3, 4, 1)), np.arange(3)) == 1e-9).all()


@pytest.mark.parametrize("unit", [1, 1e-3])
def test_a_constant_feature_does_not_change_the_others(unit):
    X, groups = people([2] * 4)
    X *= unit
    Y = np.concatenate([X, np.full((8, 15, 1), 0.1)], axis=2)
    v = predictive_variance(Y, groups)
    np.testing.assert_allclose(v[:, :2], predictive_variance(X, groups))
    np.testing.assert_allclose(v[:, 2], 1e-9 * X.var(axis=(0, 1)).max())
    c = simultaneous_factor(X, groups, 0.95)
    np.testing.assert_allclose(simultaneous_factor(Y, groups, 0.95), c)
    expected = mean_band(X, groups, 0.95, 0)
    np.testing.assert_allclose(mean_band(Y, groups, 0.95, 0)[:, :2], expected)


@pytest.mark.parametrize("shape", [(2, 1, 1), (2, 6, 3), (3, 1, 4), (5, 9, 1)])
@pytest.mark.parametrize("whose", [np.arange, np.zeros, lambda n: np.arange(n) > 0])
def test_bands_of_small_arrays_are_finite(shape, whose):
    X, groups = np.random.default_rng(0).standard_normal(shape), whose(shape[0])
    for found in (predictive_variance(X, groups), mean_band(X, groups, 0.95, 0)):
        assert found.shape == shape[1:]
        assert (found > 0).all()
        assert np.isfinite(found).all()
    assert 1 < simultaneous_factor(X, groups, 0.95) < 100
