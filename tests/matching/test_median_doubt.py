"""What a search for the median says of itself, on matrices of distances: doubt, excess, budget."""

from functools import partial

import numpy as np
import pytest
from sklearn_motionsync import DenseSynchronizer
from sklearn_motionsync.matching.median import Median, PairedTests, search_median, sum_all

BUDGET = 150


def compare_in(distances):
    """A comparison that looks up, and the distances."""

    def compare(bases, moving):
        yield slice(None), slice(None), distances[np.ix_(bases, moving)]

    return compare


def between(points, rng, noise):
    """Squared distances, each with noise of its own, in proportion."""
    squares = np.square(points).sum(axis=1)
    distances = squares[:, np.newaxis] + squares - 2 * points @ points.T
    distances = np.maximum(distances, 0) * rng.uniform(1 - noise, 1 + noise, distances.shape)
    np.fill_diagonal(distances, 0)
    return distances


def cloud(n, rng, size=5, noise=0.2):
    return between(rng.standard_normal((n, size)), rng, noise)


def line(n, rng):
    """Many that are nearly equally typical."""
    return between(rng.uniform(size=(n, 1)), rng, 0.2)


def plane(n, rng):
    return between(rng.standard_normal((n, 2)), rng, 0.5)


def structureless(n, rng):
    """Where somebody stands tells nothing."""
    distances = rng.uniform(1, 2, size=(n, n))
    np.fill_diagonal(distances, 0)
    return distances


def two_groups(n, rng):
    points = rng.standard_normal((n, 5))
    points[rng.random(n) < 0.1, 0] += 15
    return between(points, rng, 0.2)


def outlying(n, rng):
    """One of a hundred is far from everybody, and outweighs all others."""
    points = rng.standard_normal((n, 4))
    points[rng.random(n) < 0.01] *= 30
    return between(points, rng, 0.1)


HARD = [line, plane, structureless, two_groups, outlying]


@pytest.mark.parametrize("kind", HARD)
def test_the_excess_holds_and_doubt_is_told(kind):
    """Of 30 searches none may miss by more than it says: 1 % is what is allowed."""
    n, certified = 300, 0
    for seed in range(30):
        distances = kind(n, np.random.default_rng(seed))
        sums = distances.sum(axis=1)
        median = search_median(compare_in(distances), n, 0.0, np.random.RandomState(seed))
        better = (sums < sums[median.index]).sum()
        assert better <= median.in_doubt
        assert sums[median.index] <= (1 + median.excess) * sums.min() * (1 + 1e-12)
        assert median.certified == (median.in_doubt == 0)
        assert (median.excess == 0) == median.certified
        certified += median.certified
    if kind is structureless:
        assert certified == 0


@pytest.mark.parametrize("n", [1000, 2500])
@pytest.mark.parametrize("kind", [line, structureless])
def test_the_budget_grows_with_n(n, kind):
    distances = kind(n, np.random.default_rng(0)).astype(np.float32)
    median = search_median(compare_in(distances), n, 0.0, np.random.RandomState(0))
    sums = distances.sum(axis=1, dtype=np.float64)
    assert median.n_matches <= BUDGET * n
    # Next to the best, though most is in doubt.
    assert not median.certified
    assert sums[median.index] < 1.02 * sums.min()
    assert sums[median.index] <= (1 + median.excess) * sums.min()


def test_what_is_known_of_all_spares_matches():
    """Differences that follow from where the references stand leave next to nothing in doubt."""
    n = 1000
    for seed in range(3):
        distances = cloud(n, np.random.default_rng(seed), size=3, noise=0.0)
        median = search_median(compare_in(distances), n, 0.0, np.random.RandomState(seed))
        assert median.certified
        assert median.index == distances.sum(axis=1).argmin()
        assert median.n_matches < 36 * n


@pytest.mark.parametrize("seed", range(3))
def test_equal_ones_differ_by_rounding_only(seed):
    """Copies of a few performances: whichever of them it is, nothing is better."""
    n, rng = 600, np.random.default_rng(seed)
    points = rng.standard_normal((8, 6))[rng.integers(8, size=n)]
    distances = between(points, rng, 0.0)
    rounding = 1e-12 * distances.sum(axis=1).max()
    median = search_median(compare_in(distances), n, rounding, np.random.RandomState(seed))
    assert median.excess < 1e-9
    sums = distances.sum(axis=1)
    assert sums[median.index] <= sums.min() + rounding


# -- the tests themselves -----------------------------------------------------------------


@pytest.mark.parametrize("leader", [None, 3, 40])
def test_means_are_those_of_a_regression(leader):
    """Least squares for each performance alone, by the references that count, at all others."""
    n, rng = 200, np.random.default_rng(0)
    distances = cloud(n, rng)
    references = rng.permutation(n)[:64]
    tests = PairedTests(distances[:, references[:32]], references[:32])
    alive, table = np.arange(50), distances[:50, references]
    if leader is None:
        means, base = tests.means(table, alive, references), np.zeros(n)
    else:
        base = distances[leader]
        means = tests.against(leader, base[references], table, alive, references, n).mean
    places = np.column_stack([np.ones(n), tests.places[:, :8]])
    for k in alive[alive != leader]:
        met = [m for m in references if m not in (k, leader)]
        others = [m for m in range(n) if m not in (k, leader)]
        weights = np.linalg.lstsq(places[met], (distances[k] - base)[met], rcond=None)[0]
        assert means[k] == pytest.approx((places[others] @ weights).mean(), rel=1e-9)


@pytest.mark.parametrize("kind", [cloud, plane, two_groups])
def test_errors_are_as_large_as_they_are_said_to_be(kind):
    """Over random references: estimates scatter about the truth by about their standard errors."""
    n, off = 400, []
    for seed in range(25):
        rng = np.random.default_rng(seed)
        distances = kind(n, rng)
        sums = distances.sum(axis=1)
        leader, references = sums.argmin(), rng.permutation(n)[:64]
        tests = PairedTests(distances[:, references[:32]], references[:32])
        alive, row = np.flatnonzero(np.arange(n) != leader), distances[leader]
        found = tests.against(
            leader, row[references], distances[alive][:, references], alive, references, n
        )
        truth = sums[alive] - distances[alive, leader] - sums[leader] + row[alive]
        off.append((found.mean - truth / (n - 2)) / found.error)
    assert 0.5 < np.sqrt(np.square(off).mean()) < 1.15
    assert abs(np.mean(off)) < 0.25


# -- performances drawn from many more ----------------------------------------------------

WAYS = {
    "search": lambda compare, n, N: search_median(compare, n, 0.0, np.random.RandomState(0), N),
    "all": lambda compare, n, N: sum_all(compare, n, 0.0, N),
}


@pytest.mark.parametrize("way", WAYS)
@pytest.mark.parametrize("kind", [cloud, plane, two_groups])
@pytest.mark.parametrize("n", [40, 150])
def test_of_a_population(way, kind, n):
    """A sample's own median, and what is in doubt of it in all of the population."""
    population, in_doubt = 1000, []
    everybody = kind(population, np.random.default_rng(0))
    for seed in range(12):
        drawn = np.random.default_rng(seed).choice(population, n, replace=False)
        sums, distances = everybody[drawn].sum(axis=1), everybody[np.ix_(drawn, drawn)]
        median = WAYS[way](compare_in(distances), n, population)
        assert median.index == distances.sum(axis=1).argmin()
        assert (sums < sums[median.index]).sum() <= median.in_doubt
        assert sums[median.index] <= (1 + median.excess) * sums.min() * (1 + 1e-12)
        assert median.certified == (median.in_doubt == 0)
        alone = WAYS[way](compare_in(distances), n, n)
        assert (alone.index, alone.certified, alone.excess) == (median.index, True, 0)
        in_doubt.append(median.in_doubt)
    # It is no empty statement, but some doubt there must be.
    assert 0 < np.mean(in_doubt) < 0.95 * n


@pytest.mark.parametrize("population", [256, 10**9])
def test_rivals_of_a_sample(population):
    """All 128 references met: what is left of the doubt is that of drawing them, paired."""
    n, leader = 128, 5
    differences = np.tile([1.0, -1.0], n // 2)
    error = np.sqrt(1 / n - 1 / population)
    distances = np.full((n, n), 100.0)
    distances[leader] = 10
    for rival, errors in ((7, 2.0), (8, 4.0), (9, 6.0), (10, 8.0)):
        distances[rival] = 10 + differences + errors * error
    np.fill_diagonal(distances, 0)
    median = sum_all(compare_in(distances), n, 0.0, population)
    assert median.index == leader
    # Of 384 tests 1 % in all: 4.1 standard errors and a little more by Student's distribution.
    assert median.in_doubt == 2
    assert not median.certified


@pytest.mark.parametrize("n", [1, 2, 3, 5, 20])
@pytest.mark.parametrize("way", WAYS)
def test_few_of_many_are_all_in_doubt(way, n):
    distances = structureless(n, np.random.default_rng(0))
    median = WAYS[way](compare_in(distances), n, 1000)
    assert median.index == distances.sum(axis=1).argmin()
    assert median.in_doubt == n - 1
    assert median.certified == (n == 1)


# -- through the estimator ----------------------------------------------------------------


def test_the_estimator_tells():
    rng = np.random.default_rng(0)
    X = np.cumsum(rng.standard_normal((120, 20, 2)), axis=1)
    fit = partial(DenseSynchronizer, cost="posture", consensus=0)
    every = fit(search="exhaustive").fit(X)
    assert dict(every.search_) == {
        "n_matches": 120**2,
        "certified": True,
        "in_doubt": 0,
        "excess": 0.0,
    }
    found = fit(search="sampled").fit(X)
    assert found.search_.n_matches == found.n_matches_ < every.n_matches_
    assert found.search_.certified is found.certified_ is True
    assert (found.search_.in_doubt, found.search_.excess) == (0, 0)
    # Nobody asked who is the median: all matches of few, some of many, none without a vote.
    for given in (fit(pattern=3), fit(pattern=3, consensus=8), fit(pattern=X[0], consensus=8)):
        for some in (X[:20], X):
            search = given.fit(some).search_
            assert search.n_matches == given.n_matches_
            assert search.certified is False
            assert search.in_doubt == len(some)
            assert np.isnan(search.excess)


def test_nobody_asked():
    unknown = Median.unknown(7)
    assert (unknown.in_doubt, unknown.certified) == (7, False)
    assert np.isnan(unknown.excess)
