"""The search for the median against the exhaustive rule, on matrices of distances and on people."""

import numpy as np
import pytest
from scipy.stats import t as student
from sklearn_motionsync import DenseSynchronizer, LinearSynchronizer
from sklearn_motionsync.datasets import make_bending
from sklearn_motionsync.matching.median import estimate_distances, search_median, sum_all

PAPER = {"cost": "posture", "max_rate": 2, "subframes": 1, "consensus": 0}


class Matrix:
    """Compares by looking up, in uneven pieces, and counts what was asked for."""

    def __init__(self, distances):
        self.distances, self.asked = distances, 0

    def __call__(self, bases, moving):
        self.asked += len(bases) * len(moving)
        for rows in (slice(0, 7), slice(7, None)):
            yield rows, slice(None), self.distances[np.ix_(bases[rows], moving)]


def styles(rng, n, n_styles=4, spread=1.0):
    """Distances between points of several clouds, with noise of their own in each direction."""
    points = rng.standard_normal((n_styles, 6))[rng.integers(n_styles, size=n)]
    points = points + spread * rng.standard_normal((n, 6))
    distances = np.square(points[:, np.newaxis] - points).sum(axis=2)
    distances *= rng.uniform(0.8, 1.2, size=distances.shape)
    np.fill_diagonal(distances, 0)
    return distances


@pytest.mark.parametrize("n", [200, 300, 400])
def test_finds_the_exhaustive_choice_by_few_matches(n):
    wrong, certified = 0, 0
    for seed in range(20):
        distances = styles(np.random.default_rng(seed), n)
        compare = Matrix(distances)
        median = search_median(compare, n, 0.0, np.random.RandomState(seed))
        right = median.index == distances.sum(axis=1).argmin()
        wrong += not right
        certified += median.certified
        assert right or not median.certified
        assert median.n_matches == compare.asked < 0.7 * n * n
        exact = ~np.isnan(median.distances)
        assert exact[median.index]
        np.testing.assert_allclose(median.distances[exact], distances.sum(axis=1)[exact])
    assert wrong <= 1
    assert certified >= 10


def test_many_performances_need_less_than_a_tenth():
    n = 2000
    distances = styles(np.random.default_rng(0), n)
    median = search_median(Matrix(distances), n, 0.0, np.random.RandomState(0))
    assert median.index == distances.sum(axis=1).argmin()
    assert median.n_matches < 0.1 * n * n
    # The others are known as well as choosing exemplars takes.
    correlation = np.corrcoef(median.estimates, distances.sum(axis=1))[0, 1]
    assert correlation > 0.95


def test_says_so_if_it_cannot_be_sure():
    """Performances that differ by next to nothing: the budget ends before the doubt."""
    n = 1000
    rng = np.random.default_rng(0)
    distances = rng.uniform(1, 2, size=(n, n))
    np.fill_diagonal(distances, 0)
    median = search_median(Matrix(distances), n, 0.0, np.random.RandomState(0))
    assert not median.certified
    assert median.n_matches <= 0.15 * n * n
    assert median.distances[median.index] == pytest.approx(distances[median.index].sum())


@pytest.mark.parametrize("n", [1, 2, 31, 32, 33, 500])
def test_equal_performances_give_the_first(n):
    """Differences within rounding reject nobody; ties go to the smallest index."""
    noise = 1e-13 * np.random.default_rng(0).standard_normal((n, n))
    compare = Matrix(np.ones((n, n)) - np.eye(n) + noise)
    assert search_median(compare, n, 1e-9, np.random.RandomState(0)).index == 0
    assert sum_all(compare, n, 1e-9).index == 0


class InOrder:
    """Draws the references in order, so that it is known which ones are met first."""

    @staticmethod
    def permutation(n):
        return np.arange(n)


@pytest.mark.parametrize("worse", [True, False])
def test_who_is_worse_beyond_doubt_is_out(worse):
    """Paired t tests of 1 % in all: of 64 performances, in 2 rounds, the first by 32 references.

    References are drawn without replacement: a mean over half of all has half the variance.
    What rounding may do to a mean counts as doubt, too.
    """
    n, leader, rival, few, rounding = 64, 40, 50, 32, 6.4
    differences = np.tile([1.0, -1.0], n // 2)
    error = differences[:few].std(ddof=1) * np.sqrt((1 - few / n) / few)
    doubt = student.ppf(1 - 0.01 / (n * 2), few - 1) * error + rounding / n
    distances = np.full((n, n), 100.0)
    distances[leader] = 10
    distances[rival] = 10 + differences + doubt * (1.001 if worse else 0.999)
    np.fill_diagonal(distances, 0)
    median = search_median(Matrix(distances), n, rounding, InOrder)
    assert median.index == leader
    assert median.certified
    assert median.n_matches == n * few + (1 if worse else 2) * few


def test_estimates_without_a_median():
    distances = styles(np.random.default_rng(1), 300)
    compare = Matrix(distances)
    median = estimate_distances(compare, 300, np.random.RandomState(0))
    assert median.index is None
    assert compare.asked == median.n_matches == 32 * 300
    np.testing.assert_allclose(median.estimates, distances.sum(axis=1), rtol=0.5)
    # Nobody is a reference of itself.
    others = [[j for j in range(32) if j != i] for i in range(300)]
    expected = [299 * distances[i, js].mean() for i, js in enumerate(others)]
    median = estimate_distances(compare, 300, InOrder)
    np.testing.assert_allclose(median.estimates, expected)


@pytest.mark.parametrize("dtype", [np.float64, np.float32])
@pytest.mark.parametrize("method", [LinearSynchronizer, DenseSynchronizer])
def test_rounding_does_not_choose_the_pattern(method, dtype):
    """Two performances are as far from each other as from each other: the first is the median."""
    rng, settings = np.random.default_rng(0), {}
    if method is DenseSynchronizer:
        settings = {**PAPER, "max_offset": 0}
    for _ in range(40):
        X = (rng.standard_normal((2, 20, 3)) + 5).astype(dtype)
        assert method(**settings).fit(X).pattern_index_ == 0


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


def test_few_are_compared_exhaustively(many):
    sync = DenseSynchronizer().fit(many[:100])
    assert sync.certified_
    assert sync.n_matches_ == 100**2
    assert DenseSynchronizer().fit(many[:101]).n_matches_ < 101**2


def test_a_given_pattern_needs_matches_for_exemplars_only(many):
    sync = DenseSynchronizer(pattern=3).fit(many)
    assert not sync.certified_
    assert sync.n_matches_ == 32 * len(many)
    assert len(sync.exemplars_) == 8
    assert np.isnan(sync.global_distances_).all()
    direct = DenseSynchronizer(pattern=3, **PAPER).fit(many)
    assert direct.n_matches_ == 0


def test_references_are_drawn_by_random_state(many):
    first, second = (DenseSynchronizer(random_state=seed).fit(many) for seed in (1, 2))
    assert first.pattern_index_ == second.pattern_index_
    assert first.n_matches_ != second.n_matches_


@pytest.mark.parametrize("seed", range(3))
def test_bends_of_a_random_set(seed):
    """200 short bends: the search agrees with all 40,000 matches."""
    bending = make_bending(200, random_state=seed)
    X = LinearSynchronizer(40).fit_transform(bending.data)[:, :, ::3]
    every, found = (
        DenseSynchronizer(search=search, **PAPER).fit(X) for search in ("exhaustive", "sampled")
    )
    assert found.pattern_index_ == every.pattern_index_
    assert found.n_matches_ < 0.7 * every.n_matches_


def test_real_bends_and_their_variations(bends):
    """Many variations of the bends of four people."""
    X = LinearSynchronizer(40).fit_transform(bends.data)[:, :, ::3]
    rng = np.random.default_rng(0)
    pairs, share = rng.integers(len(X), size=(2, 250)), rng.random((250, 1, 1))
    X = share * X[pairs[0]] + (1 - share) * X[pairs[1]]
    every, found = (DenseSynchronizer(search=search).fit(X) for search in ("exhaustive", "sampled"))
    assert found.certified_
    assert found.pattern_index_ == every.pattern_index_
    assert found.n_matches_ < 0.6 * every.n_matches_
