"""Metrics against plain loops over their formulas, and scorers inside scikit-learn."""

import itertools

import numpy as np
import pytest
from sklearn.model_selection import GridSearchCV, cross_val_score
from sklearn.pipeline import make_pipeline
from sklearn_motionsync import ASpace, DenseSynchronizer, DirectionCosines, LinearSynchronizer
from sklearn_motionsync.datasets import make_bending
from sklearn_motionsync.metrics import (
    FeatureHoldoutScorer,
    SpreadScorer,
    group_timing_error,
    inverse_consistency,
    keyframe_error,
    least_squares,
    pairwise_correlation,
    pause_share,
    roughness,
    sobolev_least_squares,
    timing_error,
)


@pytest.fixture(scope="module")
def pair():
    rng = np.random.default_rng(0)
    return rng.standard_normal((4, 20, 3)), rng.standard_normal((4, 20, 3))


@pytest.fixture(scope="module")
def times():
    rng = np.random.default_rng(1)
    steps = rng.uniform(0, 2, (5, 19)) * (rng.uniform(size=(5, 19)) > 0.2)
    tau = np.concatenate([np.zeros((5, 1)), np.cumsum(steps, axis=1)], axis=1)
    return 19 * tau / tau[:, -1:]


def integral(f):
    """Trapezoidal rule over [0, 1]."""
    return sum((a + b) / 2 for a, b in itertools.pairwise(f)) / (len(f) - 1)


def test_least_squares(pair):
    x, y = pair
    ratios = []
    for i in range(4):
        rest = [j for j in range(4) if j != i]
        new = sum(integral((y[i, :, k] - y[rest, :, k].mean(axis=0)) ** 2) for k in range(3))
        old = sum(integral((x[i, :, k] - x[rest, :, k].mean(axis=0)) ** 2) for k in range(3))
        ratios.append(new / old)
    np.testing.assert_allclose(least_squares(x, y), np.mean(ratios))


def test_sobolev(pair):
    def total(z):
        slopes = np.stack([np.gradient(z[i, :, k]) for i in range(4) for k in range(3)])
        slopes = slopes.reshape(4, 3, 20)
        return sum(
            integral((slopes[i, k] - slopes[:, k].mean(axis=0)) ** 2)
            for i in range(4)
            for k in range(3)
        )

    np.testing.assert_allclose(sobolev_least_squares(*pair), total(pair[1]) / total(pair[0]))


def test_pairwise_correlation(pair):
    def total(z):
        flat = [(x - x.mean(axis=0)).ravel() for x in z]
        return sum(a @ b / np.sqrt((a @ a) * (b @ b)) for a in flat for b in flat if a is not b)

    np.testing.assert_allclose(pairwise_correlation(*pair), total(pair[1]) / total(pair[0]))
    univariate = pair[0][:, :, :1]
    old = np.corrcoef(univariate[:, :, 0])
    off = ~np.eye(4, dtype=bool)
    expected = 1 / old[off].mean()
    np.testing.assert_allclose(pairwise_correlation(univariate, univariate[[0] * 4]), expected)


def test_closed_forms_of_spread(pair):
    x, _ = pair
    for measure in (least_squares, sobolev_least_squares, pairwise_correlation):
        np.testing.assert_allclose(measure(x, x), 1)
    mean = x.mean(axis=0)
    halved = mean + (x - mean) / 2
    np.testing.assert_allclose(least_squares(x, halved), 0.25)
    np.testing.assert_allclose(sobolev_least_squares(x, halved), 0.25)
    same = np.stack([mean] * 4)
    assert least_squares(x, same) < 1e-30
    assert least_squares(same, same) == 1


def test_timing_error(times):
    truth = np.tile(np.arange(20.0), (5, 1))
    errors = [abs(a - b) for a, b in zip(times.ravel(), truth.ravel(), strict=True)]
    np.testing.assert_allclose(timing_error(times, truth), sum(errors) / len(errors))
    np.testing.assert_allclose(timing_error(times, truth, quantile=0.95), np.percentile(errors, 95))
    assert timing_error(times, times) == 0


def test_group_timing_error_needs_no_pattern(bending):
    """True warps to any clock at all are without error; a shift of one shows."""
    own = [np.arange(len(phi)) * 99 / (len(phi) - 1) for phi in bending.times]
    for power in (1.0, 1.7):
        clock = np.linspace(0, 1, 100) ** power
        true = np.stack(
            [np.interp(clock, phi, f) for phi, f in zip(bending.times, own, strict=True)]
        )
        assert group_timing_error(true, bending.times) < 1e-10
    assert group_timing_error(np.tile(np.arange(100.0), (40, 1)), bending.times) > 2


def test_keyframe_error(times):
    lengths = [30, 40, 20, 25, 55]
    pattern, rng = np.array([4.0, 9.5]), np.random.default_rng(2)
    keyframes = np.sort(rng.uniform(1, 18, (5, 2)), axis=1)
    clock, seconds = [], []
    for tau, own, length in zip(times, keyframes, lengths, strict=True):
        for p, k in zip(pattern, own, strict=True):
            landed = tau[int(p)] * (1 - p % 1) + tau[int(p) + 1] * (p % 1)
            clock.append(abs(landed - k * 19 / (length - 1)))
            seconds.append(abs(landed * (length - 1) / 19 - k) / 50)
    arguments = times, keyframes, pattern, lengths
    np.testing.assert_allclose(keyframe_error(*arguments), np.mean(clock))
    np.testing.assert_allclose(keyframe_error(*arguments, frame_rate=50), np.mean(seconds))
    np.testing.assert_allclose(keyframe_error(*arguments, quantile=0.5), np.median(clock))


def test_path_health(times):
    n, P = times.shape
    stops = sum(times[i, p + 1] == times[i, p] for i in range(n) for p in range(P - 1))
    np.testing.assert_allclose(pause_share(times), stops / (n * (P - 1)))
    bends = [
        times[i, p + 1] - 2 * times[i, p] + times[i, p - 1]
        for i in range(n)
        for p in range(1, P - 1)
    ]
    np.testing.assert_allclose(roughness(times), np.sqrt(np.mean(np.square(bends))))
    straight = np.tile(np.arange(20.0), (5, 1))
    assert roughness(straight) == pause_share(straight) == 0


def test_inverse_consistency(times):
    straight = np.tile(np.arange(20.0), (5, 1))
    np.testing.assert_allclose(
        inverse_consistency(times, straight), np.abs(times - straight).mean()
    )
    smooth = 19 * np.linspace(0, 1, 20) ** 1.5
    back = 19 * np.linspace(0, 1, 20) ** (1 / 1.5)
    assert inverse_consistency([smooth], [back]) < 0.2


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda: timing_error([[0, 1]], [[0, 1, 2]]), "differ in shape"),
        (lambda: timing_error([0, 1], [0, 1]), r"shape \(n_sequences, P\)"),
        (lambda: inverse_consistency([[0, 1]], [[0, 1, 2]]), "differ in shape"),
        (lambda: group_timing_error([[0, 1]], []), "1 warps and 0 sets"),
        (lambda: keyframe_error([[0, 1]], [[1, 2]], [1], [5]), "do not go"),
        (lambda: least_squares(np.zeros((1, 5, 2)), np.zeros((1, 5, 2))), "at least 2"),
        (lambda: least_squares(np.zeros((2, 5, 2)), np.zeros((2, 6, 2))), "one shape"),
        (lambda: SpreadScorer("variance"), "'variance' is unknown"),
        (lambda: FeatureHoldoutScorer("variance"), "'variance' is unknown"),
    ],
)
def test_what_does_not_go_together(call, message):
    with pytest.raises(ValueError, match=message):
        call()


# -- scorers ----------------------------------------------------------------------------


@pytest.mark.parametrize("scorer", [SpreadScorer, FeatureHoldoutScorer])
@pytest.mark.parametrize("spread", ["least_squares", "sobolev", "correlation"])
def test_scorers_prefer_matching(scorer, spread, bending):
    """Without y, in a pipeline, in cross_val_score and in a grid search."""

    def pipe(synchronizer):
        return make_pipeline(DirectionCosines(bending.skeleton), ASpace(6), synchronizer)

    scoring, X = scorer(spread), bending.data[:16]
    linear, dense = (
        cross_val_score(pipe(s), X, cv=2, scoring=scoring, error_score="raise").mean()
        for s in (LinearSynchronizer(40), DenseSynchronizer(40))
    )
    assert dense > linear
    grid = {"densesynchronizer__max_offset": [0.0, 0.25]}
    search = GridSearchCV(
        pipe(DenseSynchronizer(40)), grid, scoring=scoring, cv=2, error_score="raise"
    )
    assert search.fit(X).best_params_ == {"densesynchronizer__max_offset": 0.25}


def test_spread_scorer_is_the_ratio(bending_aspace):
    sync = DenseSynchronizer(50).fit(bending_aspace)
    linear = LinearSynchronizer(50).fit_transform(bending_aspace)
    expected = least_squares(linear, sync.transform(bending_aspace))
    np.testing.assert_allclose(SpreadScorer()(sync, bending_aspace), -expected)


def test_scorers_take_every_kind_of_input(bending_aspace):
    rows = np.stack([np.sin(np.linspace(0, 3, 30) ** p) for p in (1, 1.1, 0.9)])
    columns = list(rows[:, :, np.newaxis])
    scores = [SpreadScorer()(DenseSynchronizer().fit(X), X) for X in (rows, columns)]
    assert scores[0] == scores[1]
    by_index = DenseSynchronizer(40, pattern=30).fit(bending_aspace)
    by_array = DenseSynchronizer(40, pattern=bending_aspace[30]).fit(bending_aspace)
    few = bending_aspace[:6]
    assert FeatureHoldoutScorer()(by_index, few) == FeatureHoldoutScorer()(by_array, few)


def test_only_hidden_features_see_through_over_warping():
    """Features of pure noise: warping lowers their spread, but not that of the others."""
    rng = np.random.default_rng(0)
    X = [rng.standard_normal((60, 6)) for _ in range(8)]
    sync = DenseSynchronizer(
        cost="posture",
        smoothness=0,
        max_rate=2,
        subframes=1,
        consensus=0,
    ).fit(X)
    assert SpreadScorer()(sync, X) > -0.8
    assert FeatureHoldoutScorer()(sync, X) < -0.95


def test_holdout_judges_by_every_feature(bending_aspace):
    """One feature a hand: what is dealt first does not matter, each is judged by the others."""
    X = [x[:, :4] for x in bending_aspace[:8]]
    sync = DenseSynchronizer(40).fit(X)
    scores = []
    for k in range(4):
        seen, hidden = [np.delete(x, k, axis=1) for x in X], [x[:, [k]] for x in X]
        after = DenseSynchronizer(40).fit(seen).match(seen).warp(hidden)
        before = LinearSynchronizer(40).fit_transform(hidden)
        scores.append(-least_squares(before, after))
    assert np.ptp(scores) > 0.1
    for seed in range(3):
        found = FeatureHoldoutScorer(n_folds=4, random_state=seed)(sync, X)
        np.testing.assert_allclose(found, np.mean(scores))


def test_holdout_needs_features(bending_aspace):
    sync = DenseSynchronizer(40).fit([x[:, :1] for x in bending_aspace])
    with pytest.raises(ValueError, match="n_folds=3 must be between 2 and the 1 features"):
        FeatureHoldoutScorer()(sync, [x[:, :1] for x in bending_aspace])


def test_scorers_need_a_synchronizer(bending_aspace):
    with pytest.raises(ValueError, match="no synchronizer in ASpace"):
        SpreadScorer()(ASpace(2).fit(bending_aspace), bending_aspace)


def test_scorers_clone_and_repeat():
    bunch = make_bending(6, random_state=0)
    X = DirectionCosines(bunch.skeleton).fit_transform(bunch.data)
    sync = DenseSynchronizer(40).fit(X)
    before = sync.pattern_.copy()
    a, b = (FeatureHoldoutScorer(random_state=3)(sync, X) for _ in range(2))
    assert a == b
    np.testing.assert_array_equal(sync.pattern_, before)
