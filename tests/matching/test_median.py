"""The median: the sequential search against all matches, on matrices of distances and on people."""

from functools import partial

import numpy as np
import pytest
from scipy.stats import t as student
from sklearn.base import clone
from sklearn_motionsync import DenseSynchronizer, LinearSynchronizer
from sklearn_motionsync.matching.median import (
    PairedTests,
    estimate_distances,
    exhaustive_median,
    sampled_median,
)

PAPER = {"cost": "posture", "max_rate": 2, "subframes": 1, "consensus": 0}
BUDGET = 150


class Matrix:
    """Compares by looking up, in uneven pieces, and counts the matches."""

    def __init__(self, distances):
        self.distances, self.n_matches = distances, 0

    def __call__(self, bases, moving):
        self.n_matches += len(bases) * len(moving)
        for rows in (slice(0, 7), slice(7, None)):
            yield rows, slice(None), self.distances[np.ix_(bases[rows], moving)]


def search(distances, seed=0, rounding=0.0, population=None):
    """The result of a search by a table of distances."""
    random_state = np.random.RandomState(seed)
    return sampled_median(Matrix(distances), len(distances), rounding, random_state, population)


class InOrder:
    """Draws the references in order."""

    @staticmethod
    def permutation(n):
        return np.arange(n)


# -- distances ----------------------------------------------------------------------------


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
    """Distances without coordinates."""
    distances = rng.uniform(1, 2, size=(n, n))
    np.fill_diagonal(distances, 0)
    return distances


def two_groups(n, rng):
    points = rng.standard_normal((n, 5))
    points[rng.random(n) < 0.1, 0] += 15
    return between(points, rng, 0.2)


def outlying(n, rng):
    """One of a hundred is far from all others, and outweighs them."""
    points = rng.standard_normal((n, 4))
    points[rng.random(n) < 0.01] *= 30
    return between(points, rng, 0.1)


HARD = [line, plane, structureless, two_groups, outlying]


def styles(rng, n, n_styles=4, spread=1.0):
    """Distances between points of several clouds, with noise of their own in each direction."""
    points = rng.standard_normal((n_styles, 6))[rng.integers(n_styles, size=n)]
    points = points + spread * rng.standard_normal((n, 6))
    distances = np.square(points[:, np.newaxis] - points).sum(axis=2)
    distances *= rng.uniform(0.8, 1.2, size=distances.shape)
    np.fill_diagonal(distances, 0)
    return distances


# -- the search ---------------------------------------------------------------------------


@pytest.mark.parametrize("n", [200, 300, 400])
def test_search_finds_the_exhaustive_median_by_few_matches(n):
    wrong, certified = 0, 0
    for seed in range(20):
        distances = styles(np.random.default_rng(seed), n)
        compare = Matrix(distances)
        median = sampled_median(compare, n, 0.0, np.random.RandomState(seed))
        right = median.index == distances.sum(axis=1).argmin()
        wrong += not right
        certified += median.certified
        assert right or not median.certified
        assert median.n_matches == compare.n_matches < 0.7 * n * n
        exact = ~np.isnan(median.distances)
        assert exact[median.index]
        np.testing.assert_allclose(median.distances[exact], distances.sum(axis=1)[exact])
    assert wrong <= 1
    assert certified >= 10


def test_search_among_many_needs_less_than_a_tenth_of_all_matches():
    n = 2000
    distances = styles(np.random.default_rng(0), n)
    median = search(distances)
    assert median.index == distances.sum(axis=1).argmin()
    assert median.n_matches < 0.1 * n * n
    # The estimates suffice to choose exemplars.
    assert np.corrcoef(median.estimates, distances.sum(axis=1))[0, 1] > 0.95


@pytest.mark.parametrize("n", [1, 2, 31, 32, 33, 500])
def test_equal_performances_give_the_first(n):
    """Differences within rounding reject none; ties go to the smallest index."""
    noise = 1e-13 * np.random.default_rng(0).standard_normal((n, n))
    distances = np.ones((n, n)) - np.eye(n) + noise
    assert search(distances, rounding=1e-9).index == 0
    assert exhaustive_median(Matrix(distances), n, 1e-9).index == 0


@pytest.mark.parametrize("worse", [True, False])
def test_search_rejects_by_paired_t_tests(worse):
    """Of 1 % in all: of 64 performances, in 2 rounds, the first by 32 references.

    References are drawn without replacement: a mean over half of all has half the variance.
    Rounding of a mean counts, too.
    """
    n, leader, rival, few, rounding = 64, 40, 50, 32, 6.4
    differences = np.tile([1.0, -1.0], n // 2)
    error = differences[:few].std(ddof=1) * np.sqrt((1 - few / n) / few)
    doubt = student.ppf(1 - 0.01 / (n * 2), few - 1) * error + rounding / n
    distances = np.full((n, n), 100.0)
    distances[leader] = 10
    distances[rival] = 10 + differences + doubt * (1.001 if worse else 0.999)
    np.fill_diagonal(distances, 0)
    median = sampled_median(Matrix(distances), n, rounding, InOrder)
    assert median.index == leader
    assert median.certified
    assert median.n_matches == n * few + (1 if worse else 2) * few


def test_estimates_are_means_over_the_references():
    distances = styles(np.random.default_rng(1), 300)
    compare = Matrix(distances)
    median = estimate_distances(compare, 300, InOrder)
    assert median.index is None
    assert compare.n_matches == median.n_matches == 32 * 300
    np.testing.assert_allclose(median.estimates, distances.sum(axis=1), rtol=0.5)
    # No performance is its own reference.
    others = [[j for j in range(32) if j != i] for i in range(300)]
    expected = [299 * distances[i, js].mean() for i, js in enumerate(others)]
    np.testing.assert_allclose(median.estimates, expected)


@pytest.mark.parametrize("kind", HARD)
def test_excess_and_doubt_hold(kind):
    """In 30 searches; 1 % may fail."""
    n, certified = 300, 0
    for seed in range(30):
        distances = kind(n, np.random.default_rng(seed))
        sums = distances.sum(axis=1)
        median = search(distances, seed)
        better = (sums < sums[median.index]).sum()
        assert better <= median.in_doubt
        assert median.n_matches <= BUDGET * n
        assert sums[median.index] <= (1 + median.excess) * sums.min() * (1 + 1e-12)
        assert median.certified == (median.in_doubt == 0)
        assert (median.excess == 0) == median.certified
        certified += median.certified
    if kind is structureless:
        assert certified == 0


# -- the paired tests ----------------------------------------------------------------------


@pytest.mark.parametrize("leader", [None, 3, 40])
def test_means_equal_those_of_a_regression(leader):
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
def test_standard_errors_are_calibrated(kind):
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
    "search": lambda compare, n, N: sampled_median(compare, n, 0.0, np.random.RandomState(0), N),
    "all": lambda compare, n, N: exhaustive_median(compare, n, 0.0, N),
}


@pytest.mark.parametrize("way", WAYS)
@pytest.mark.parametrize("kind", [cloud, plane, two_groups])
@pytest.mark.parametrize("n", [40, 150])
def test_doubt_of_a_sample_holds_in_the_population(way, kind, n):
    population, in_doubt = 1000, []
    table = kind(population, np.random.default_rng(0))
    for seed in range(12):
        drawn = np.random.default_rng(seed).choice(population, n, replace=False)
        sums, distances = (
            table[drawn].sum(axis=1),
            table[np.ix_(drawn, drawn)],
        )
        median = WAYS[way](Matrix(distances), n, population)
        assert median.index == distances.sum(axis=1).argmin()
        assert (sums < sums[median.index]).sum() <= median.in_doubt
        assert sums[median.index] <= (1 + median.excess) * sums.min() * (1 + 1e-12)
        assert median.certified == (median.in_doubt == 0)
        alone = WAYS[way](Matrix(distances), n, n)
        assert (alone.index, alone.certified, alone.excess) == (median.index, True, 0)
        in_doubt.append(median.in_doubt)
    assert 0 < np.mean(in_doubt) < 0.95 * n


@pytest.mark.parametrize("population", [256, 10**9])
def test_sample_rivals_are_rejected_by_paired_errors(population):
    """With all 128 references only the error of drawing them is left, paired."""
    n, leader = 128, 5
    differences = np.tile([1.0, -1.0], n // 2)
    error = np.sqrt(1 / n - 1 / population)
    distances = np.full((n, n), 100.0)
    distances[leader] = 10
    for rival, errors in ((7, 2.0), (8, 4.0), (9, 6.0), (10, 8.0)):
        distances[rival] = 10 + differences + errors * error
    np.fill_diagonal(distances, 0)
    median = exhaustive_median(Matrix(distances), n, 0.0, population)
    assert median.index == leader
    # Of 384 tests 1 % in all: 4.1 standard errors and a little more by Student's distribution.
    assert median.in_doubt == 2
    assert not median.certified


@pytest.mark.parametrize("n", [1, 2, 3, 5, 20])
@pytest.mark.parametrize("way", WAYS)
def test_few_of_many_are_all_in_doubt(way, n):
    distances = structureless(n, np.random.default_rng(0))
    median = WAYS[way](Matrix(distances), n, 1000)
    assert median.index == distances.sum(axis=1).argmin()
    assert median.in_doubt == n - 1
    assert median.certified == (n == 1)


# -- through the estimator ----------------------------------------------------------------


@pytest.fixture(scope="module")
def many():
    """Performances of a few styles, short enough to compare them all."""
    rng = np.random.default_rng(0)
    t = np.linspace(0, 1, 30)
    styles = rng.standard_normal((5, 3))
    X = []
    for _ in range(160):
        phase = t + rng.uniform(-0.1, 0.1) * np.sin(np.pi * t)
        a, b, c = styles[rng.integers(5)] + 0.3 * rng.standard_normal(3)
        X.append(np.column_stack([np.sin(3 * phase + a), b * np.cos(4 * phase), c * phase]))
    return X


@pytest.mark.parametrize("settings", [PAPER, {}], ids=["paper", "defaults"])
def test_estimator_searches_among_many(many, settings):
    settings = {"unsupported": "warp", **settings}
    every = DenseSynchronizer(search="exhaustive", **settings).fit(many)
    assert every.certified_
    assert every.n_matches_ == len(many) ** 2
    assert np.isfinite(every.global_distances_).all()
    found = DenseSynchronizer(**settings).fit(many)
    assert found.pattern_index_ == every.pattern_index_
    assert found.n_matches_ < 0.8 * len(many) ** 2
    exact = np.isfinite(found.global_distances_)
    assert exact[found.pattern_index_]
    np.testing.assert_allclose(
        found.global_distances_[exact], every.global_distances_[exact], rtol=1e-10
    )
    again = DenseSynchronizer(search="sampled", **settings).fit(many)
    assert again.n_matches_ == found.n_matches_
    np.testing.assert_array_equal(found.transform(many[:3]), again.transform(many[:3]))


def test_up_to_100_performances_are_compared_exhaustively(many):
    sync = DenseSynchronizer(unsupported="warp").fit(many[:100])
    assert sync.certified_
    assert sync.n_matches_ == 100**2
    assert sync.fit(many[:101]).n_matches_ < 101**2


def test_given_pattern_needs_matches_for_exemplars_only(many):
    sync = DenseSynchronizer(pattern=3, unsupported="warp").fit(many)
    assert not sync.certified_
    assert sync.n_matches_ == 32 * len(many)
    assert len(sync.exemplars_) == 8
    assert np.isnan(sync.global_distances_).all()
    direct = DenseSynchronizer(pattern=3, **PAPER).fit(many)
    assert direct.n_matches_ == 0


def test_random_state_draws_the_references(many):
    settings = {"unsupported": "warp"}
    first, second = (DenseSynchronizer(random_state=i, **settings).fit(many) for i in (1, 2))
    assert first.pattern_index_ == second.pattern_index_
    assert first.n_matches_ != second.n_matches_


@pytest.mark.parametrize("dtype", [np.float64, np.float32])
@pytest.mark.parametrize("method", [LinearSynchronizer, DenseSynchronizer])
def test_rounding_does_not_choose_the_pattern(method, dtype):
    """Two performances have equal global distances: the first is the median."""
    rng, settings = np.random.default_rng(0), {}
    if method is DenseSynchronizer:
        settings = {**PAPER, "max_offset": 0}
    for _ in range(40):
        X = (rng.standard_normal((2, 20, 3)) + 5).astype(dtype)
        assert method(**settings).fit(X).pattern_index_ == 0


def test_estimator_reports_its_search():
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
    # Without a search: all matches of few, some of many, none without a vote.
    for given in (fit(pattern=3), fit(pattern=3, consensus=8), fit(pattern=X[0], consensus=8)):
        for some in (X[:20], X):
            search = given.fit(some).search_
            assert search.n_matches == given.n_matches_
            assert search.certified is False
            assert search.in_doubt == len(some)
            assert np.isnan(search.excess)


def test_search_among_variations_of_real_bends(bends):
    X = LinearSynchronizer(40).fit_transform(bends.data)[:, :, ::3]
    rng = np.random.default_rng(0)
    pairs, share = rng.integers(len(X), size=(2, 250)), rng.random((250, 1, 1))
    X = share * X[pairs[0]] + (1 - share) * X[pairs[1]]
    sync = DenseSynchronizer(unsupported="warp")
    every, found = (clone(sync).set_params(search=x).fit(X) for x in ("exhaustive", "sampled"))
    assert found.certified_
    assert found.pattern_index_ == every.pattern_index_
    assert found.n_matches_ < 0.6 * every.n_matches_
