"""Means of directions, against the formula for two and a search for the least squares."""

import numpy as np
import pytest
from scipy.optimize import minimize
from sklearn_motionsync.body.sphere import mean_direction, mean_vector


def directions(n, dims, around=None, seed=0):
    x = np.random.default_rng(seed).normal(size=(n, dims))
    x = x if around is None else np.eye(dims)[0] + around * x
    return x / np.linalg.norm(x, axis=1, keepdims=True)


@pytest.mark.parametrize("dims", [2, 3])
@pytest.mark.parametrize("share", [-0.7, -0.1, 0.0, 0.25, 0.5, 1.0, 1.3])
def test_mean_of_two_directions_is_on_their_great_circle(dims, share):
    """(sin((1 - t) a) u + sin(t a) v) / sin(a), before, between and beyond them."""
    for seed in range(20):
        u, v = directions(2, dims, seed=seed)
        angle = np.arccos(u @ v)
        expected = (np.sin((1 - share) * angle) * u + np.sin(share * angle) * v) / np.sin(angle)
        found = mean_direction(np.stack([u, v]), np.array([1 - share, share]))
        np.testing.assert_allclose(found, expected, atol=1e-9)


@pytest.mark.parametrize("around", [0.01, 0.3])
def test_mean_minimises_squared_angles(around):
    u, weights = directions(6, 3, around), np.arange(1, 7) / 21

    def squares(x):
        return weights @ np.arccos(np.clip(u @ (x / np.linalg.norm(x)), -1, 1)) ** 2

    found = mean_direction(u, weights)
    best = minimize(squares, u[0], method="Nelder-Mead", options={"xatol": 1e-10, "fatol": 1e-16})
    assert squares(found) <= best.fun + 1e-14
    np.testing.assert_allclose(found, best.x / np.linalg.norm(best.x), atol=1e-6)
    # There the weighted tangents to all of them add up to 0.
    across = u - np.outer(u @ found, found)
    ways = np.arccos(u @ found) / np.linalg.norm(across, axis=1)
    np.testing.assert_allclose((weights * ways) @ across, 0, atol=1e-12)


def test_mean_is_continuous_where_a_weight_becomes_negative():
    u = directions(3, 3)
    before, after = (mean_direction(u, np.array([0.4, 0.6 + w, -w])) for w in (-1e-9, 1e-9))
    np.testing.assert_allclose(before, after, atol=1e-8)


def test_mean_of_opposites_is_the_one_with_the_larger_weight():
    u = np.array([[0.6, 0.8, 0], [-0.6, -0.8, 0]])
    for weights, expected in (([0.5, 0.5], 0), ([0.7, 0.3], 0), ([0.3, 0.7], 1), ([0, 1], 1)):
        np.testing.assert_allclose(mean_direction(u, np.array(weights)), u[expected], atol=1e-15)


def test_means_of_an_array_equal_single_means():
    u = np.stack([directions(5, 3, seed=s) for s in range(3)])
    weights = np.random.default_rng(0).dirichlet([1, 1, 1], size=5).T
    found = mean_direction(u, weights)
    for k in range(5):
        alone = mean_direction(u[:, k], weights[:, k])
        np.testing.assert_allclose(found[k], alone, atol=1e-13)
    for dims in (2, 3):
        assert mean_direction(np.empty((2, 0, dims)), np.full((2, 1), 0.5)).shape == (0, dims)


def test_length_of_a_mean_vector_is_the_mean_length():
    u = directions(2, 3)
    found = mean_vector(u * [[1.0], [3.0]], np.array([0.25, 0.75]))
    np.testing.assert_allclose(np.linalg.norm(found), 2.5, rtol=1e-15)
    # Extrapolated lengths stay above 0: they are at least half the shortest.
    assert np.linalg.norm(mean_vector(u * [[4.0], [9.0]], np.array([2, -1]))) == pytest.approx(2)
