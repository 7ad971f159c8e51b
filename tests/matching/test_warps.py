"""Sequences sampled along warps, warps between frames, and the vote of the routes."""

import numpy as np
import pytest
from sklearn_motionsync import DenseSynchronizer, Match
from sklearn_motionsync.matching.consensus import vote
from sklearn_motionsync.matching.warps import evaluate_warps, even_slices, normalise

from made_people import made_people


def random_warps(rng, n, n_frames):
    """Non-decreasing, with pinned ends, bent at every frame."""
    steps = rng.uniform(0, 1, (n, n_frames - 1)) ** 3
    tau = np.concatenate([np.zeros((n, 1)), np.cumsum(steps, axis=1)], axis=1)
    return (n_frames - 1) * tau / tau[:, -1:]


@pytest.mark.parametrize("n_frames", [2, 3, 4, 30])
def test_warps_are_piecewise_linear(n_frames):
    """Between the first two and the last two as well."""
    rng = np.random.default_rng(n_frames)
    there, back = random_warps(rng, 5, n_frames), random_warps(rng, 5, n_frames)
    frames = np.arange(n_frames)
    returned = [np.interp(tau, frames, b) for tau, b in zip(there, back, strict=True)]
    np.testing.assert_allclose(evaluate_warps(back, there), returned, atol=1e-12)


@pytest.mark.parametrize("n", [1, 3, 65, 150])
def test_sampling_equals_linear_interpolation(n):
    """Along warps, and at even times of their course, each as if it were alone."""
    rng = np.random.default_rng(n)
    X = [rng.standard_normal((length, 2)) for length in rng.integers(2, 40, n)]
    times = random_warps(rng, n, 21)
    for n_positions, at, found in (
        (21, times, Match(times).warp(X)),
        (61, [np.linspace(0, 20, 61)] * n, normalise(X, 21, subframes=3)),
    ):
        assert found.shape == (n, n_positions, 2)
        for x, tau, out in zip(X, at, found, strict=True):
            own = np.linspace(0, 20, len(x))
            expected = np.column_stack([np.interp(tau, own, column) for column in x.T])
            np.testing.assert_allclose(out, expected, atol=1e-12)


def test_even_slices_are_few_and_even():
    for n in range(40):
        for size in (1, 2, 7, 64):
            slices = even_slices(n, size)
            assert [i for s in slices for i in range(n)[s]] == list(range(n))
            lengths = [s.stop - s.start for s in slices]
            assert len(lengths) == -(-n // size)
            assert not lengths or max(lengths) <= min(size, min(lengths) + 1)


# -- the vote -------------------------------------------------------------------------------


def test_vote_equals_the_median_of_all_routes():
    rng, frames = np.random.default_rng(0), np.arange(15)
    direct, there = random_warps(rng, 4, 15), random_warps(rng, 6, 15)
    back = np.stack([random_warps(rng, 4, 15) for _ in range(6)])
    for n_exemplars in (0, 1, 2, 6):
        found = vote(direct, there[:n_exemplars, np.newaxis], back[:n_exemplars])
        for m in range(4):
            indirect = [np.interp(there[k], frames, back[k, m]) for k in range(n_exemplars)]
            expected = np.median([direct[m], *indirect], axis=0)
            np.testing.assert_allclose(found[m], expected, atol=1e-12)
        assert (np.diff(found) >= 0).all()
        np.testing.assert_array_equal(found[:, [0, -1]], [[0, 14]] * 4)


@pytest.fixture(scope="module")
def people():
    return made_people(40)


@pytest.mark.parametrize("n", [1, 2, 5, 9, 10, 40])
def test_pattern_is_no_exemplar(n, people):
    """It would vote for the direct path a second time."""
    for pattern in ("median", 0, n - 1):
        sync = DenseSynchronizer(pattern=pattern).fit(people[:n])
        exemplars = sync.exemplars_.tolist()
        assert sync.pattern_index_ not in exemplars
        assert len(set(exemplars)) == len(exemplars) == min(8, n - 1)


@pytest.mark.parametrize("consensus", [1, 2, 3, 5, 8, 15, 25])
def test_exemplars_are_spread_over_the_typical_half(consensus, people):
    """Their ranks, by the distance to all, are as even as whole numbers can be."""
    sync = DenseSynchronizer(consensus=consensus).fit(people)
    order = [n for n in np.argsort(sync.global_distances_) if n != sync.pattern_index_]
    ranks = np.array([order.index(k) for k in sync.exemplars_])
    n_typical = max(consensus, len(order) // 2)
    assert len(ranks) == consensus
    assert ranks.min() >= 0
    assert ranks.max() < n_typical
    assert np.diff(ranks).min(initial=n_typical) >= n_typical // consensus
    assert np.diff(ranks).max(initial=1) <= -(-n_typical // consensus)
    assert abs(ranks.mean() - (n_typical - 1) / 2) <= 0.5
