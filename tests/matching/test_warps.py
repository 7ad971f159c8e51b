"""Warps read between frames, and the routes that vote on them."""

import numpy as np
import pytest
from sklearn_motionsync import DenseSynchronizer, Match
from sklearn_motionsync.metrics import inverse_consistency, keyframe_error


def random_warps(rng, n, n_frames):
    """Non-decreasing, with pinned ends, bent at every frame."""
    steps = rng.uniform(0, 1, (n, n_frames - 1)) ** 3
    tau = np.concatenate([np.zeros((n, 1)), np.cumsum(steps, axis=1)], axis=1)
    return (n_frames - 1) * tau / tau[:, -1:]


@pytest.mark.parametrize("n_frames", [2, 3, 4, 30])
def test_a_warp_is_a_straight_line_between_two_frames(n_frames):
    """Between the first two and the last two as well."""
    rng = np.random.default_rng(n_frames)
    there, back = random_warps(rng, 5, n_frames), random_warps(rng, 5, n_frames)
    frames = np.arange(n_frames)
    returned = [np.interp(tau, frames, b) for tau, b in zip(there, back, strict=True)]
    expected = np.abs(np.array(returned) - frames).mean()
    np.testing.assert_allclose(inverse_consistency(there, back), expected, atol=1e-12)
    for at in np.linspace(0, n_frames - 1, 23):
        landed = np.mean([np.interp(at, frames, tau) for tau in there])
        error = keyframe_error(there, np.zeros((5, 1)), [at], [n_frames] * 5)
        np.testing.assert_allclose(error, landed, atol=1e-12)


@pytest.fixture(scope="module")
def people():
    """Forty performances of one movement, each of a style and a pace of its own."""
    rng, t = np.random.default_rng(0), np.linspace(0, 1, 30)
    X = []
    for _ in range(40):
        phase = t + rng.uniform(-0.1, 0.1) * np.sin(np.pi * t)
        style = 1 + 0.2 * rng.standard_normal(3)
        X.append(np.column_stack([np.sin(5 * phase), np.cos(4 * phase), phase**2]) * style)
    return X


@pytest.mark.parametrize("n", [1, 2, 5, 9, 10, 40])
def test_the_pattern_is_no_exemplar(n, people):
    """It would vote for the direct path a second time."""
    for pattern in ("median", 0, n - 1):
        sync = DenseSynchronizer(pattern=pattern).fit(people[:n])
        exemplars = sync.exemplars_.tolist()
        assert sync.pattern_index_ not in exemplars
        assert len(set(exemplars)) == len(exemplars) == min(8, n - 1)
