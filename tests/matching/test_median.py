"""The median: all pairs against an oracle; of many, matches with a hundred drawn ones."""

import numpy as np
import pytest
from sklearn_motionsync import DenseSynchronizer, LinearSynchronizer
from sklearn_motionsync.matching import median as of_median
from sklearn_motionsync.matching.median import MOST_REFERENCES, draw_references, median_of_sums

from made_people import made_people

# Those of the paper; nothing is smoothed or compared at fewer frames.
PAPER = {"cost": "pose", "max_rate": 2, "consensus": 0}


@pytest.mark.parametrize("n", [1, 2, 100, 500])
def test_ties_go_to_the_first(n):
    """Differences within rounding reject none."""
    noise = 1e-13 * np.random.default_rng(0).standard_normal(n)
    references = draw_references(n, np.random.RandomState(0))
    sums = np.full(n, len(references), dtype=float)
    sums[references] -= 1
    assert median_of_sums(sums + noise, references, 1e-9).trial == 0
    sums[n // 2] -= 0.01
    assert median_of_sums(sums + noise, references, 1e-9).trial == n // 2


@pytest.mark.parametrize("dtype", [np.float64, np.float32])
@pytest.mark.parametrize("method", [LinearSynchronizer, DenseSynchronizer])
def test_rounding_does_not_choose_the_pattern(method, dtype):
    """Two trials have equal global distances: the first is the median."""
    rng, settings = np.random.default_rng(0), {}
    if method is DenseSynchronizer:
        settings = {**PAPER, "max_offset": 0}
    for _ in range(20):
        X = (rng.standard_normal((2, 20, 3)) + 5).astype(dtype)
        assert method(**settings).fit(X).pattern_index_ == 0


def test_references_are_all_or_a_hundred_drawn_ones():
    draws = [draw_references(400, np.random.RandomState(seed)) for seed in (0, 0, 1)]
    for references in draws:
        assert len(np.unique(references)) == MOST_REFERENCES == 100
        assert (np.diff(references) > 0).all()
    np.testing.assert_array_equal(draws[0], draws[1])
    assert set(draws[0]) != set(draws[2])
    np.testing.assert_array_equal(draw_references(100, np.random.RandomState(0)), np.arange(100))
    # Each trial is drawn as often as another one.
    counts = np.zeros(400)
    random_state = np.random.RandomState(0)
    for _ in range(400):
        counts[draw_references(400, random_state)] += 1
    assert np.abs(counts - 100).max() < 5 * np.sqrt(400 * 0.25 * 0.75)


@pytest.fixture(scope="module")
def table():
    """Distances between 300 points, each with noise of its own in both directions."""
    rng = np.random.default_rng(0)
    points = rng.standard_normal((300, 5))
    distances = np.square(points[:, np.newaxis] - points).sum(axis=2)
    return distances * rng.uniform(0.8, 1.2, distances.shape)


def test_estimates_of_sums_are_means_over_the_drawn_ones(table):
    """Of which none is the trial itself, times 299."""
    n, sums = len(table), table.sum(axis=1)
    for seed in range(9):
        references = draw_references(n, np.random.RandomState(seed))
        of_drawn = table[:, references].sum(axis=1)
        index, estimates = median_of_sums(of_drawn, references, 0.0)
        counts = 100 - np.isin(np.arange(n), references)
        np.testing.assert_allclose(estimates, of_drawn * (n - 1) / counts)
        assert index == estimates.argmin()
        assert sums[index] < 1.1 * sums.min()


@pytest.fixture(scope="module")
def many():
    return made_people(130)


@pytest.mark.parametrize("settings", [PAPER, {}], ids=["paper", "defaults"])
def test_median_of_many_is_nearly_the_most_typical(many, settings, monkeypatch):
    with monkeypatch.context() as patch:
        patch.setattr(of_median, "MOST_REFERENCES", len(many))
        sums = DenseSynchronizer(**settings).fit(many).global_distances_
    draws = []
    for seed in range(3):
        sync = DenseSynchronizer(random_state=seed, **settings).fit(many)
        assert np.isfinite(sync.global_distances_).all()
        assert sync.pattern_index_ == sync.global_distances_.argmin()
        assert sums[sync.pattern_index_] <= 1.05 * sums.min()
        ratios = sync.global_distances_ / sums
        assert np.abs(np.median(ratios) - 1) < 0.1
        assert np.std(ratios) < 0.1
        draws.append(sync.global_distances_.tobytes())
    assert len(set(draws)) == 3
    again = DenseSynchronizer(random_state=0, **settings).fit(many)
    assert again.global_distances_.tobytes() == draws[0]


def test_given_pattern_needs_matches_for_exemplars_only(many):
    sync = DenseSynchronizer(pattern=3).fit(many)
    assert np.isnan(sync.global_distances_).all()
    every = DenseSynchronizer().fit(many)
    order = np.argsort(every.global_distances_)
    ranks = [int(np.flatnonzero(order == k)[0]) for k in sync.exemplars_]
    assert len(ranks) == 8
    assert max(ranks) <= len(many) // 2
    assert 3 not in sync.exemplars_


@pytest.mark.parametrize("noise", [1e-3, 1e-6])
def test_median_of_nearly_equal_trials_is_found(noise):
    """Also where single precision does not tell them apart."""
    t, rng = np.linspace(0, 1, 80), np.random.default_rng(0)
    source = np.column_stack([np.cos(4 * t), np.sin(4 * t), t**2])
    noises = noise * (1 + (3 * np.arange(10) + 2) % 10)
    X = [source + sigma * rng.standard_normal(source.shape) for sigma in noises]
    sync = DenseSynchronizer(refine=False).fit(X)
    assert sync.pattern_index_ == noises.argmin() == 6
    exact = sync.match(X).distances.sum()
    assert sync.global_distances_[6] == pytest.approx(exact, rel=0.2)
