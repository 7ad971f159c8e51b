"""The kernel: views of trials, their weights, and the regression; against loops and objectives."""

import numpy as np
import pytest
from scipy.optimize import minimize
from scipy.special import logsumexp, softmax
from sklearn.preprocessing import scale
from sklearn_motionsync.recognition.kernel import (
    KernelRegression,
    align_weights,
    assign_folds,
    changes_of,
    decision_values,
    fit_temperature,
    fold_gain,
    held_out_decisions,
)


# What summaries and shares are made of changes, tests/recognition/test_classifier.py writes out.
@pytest.mark.parametrize(("n_frames", "reaches"), [(50, (2, 8)), (100, (4, 16)), (2, (1, 1))])
def test_changes_equal_convolutions(n_frames, reaches):
    """Of trials that stand still before and after."""
    x = np.random.default_rng(0).standard_normal((n_frames, 3)).cumsum(axis=0)
    for changes, reach in zip(changes_of(x), reaches, strict=True):
        still = np.pad(x, ((reach, reach), (0, 0)), mode="edge")
        kernel = [1, *[0] * (2 * reach - 1), -1]
        for found, curve in zip(changes.T, still.T, strict=True):
            expected = np.convolve(curve, kernel, mode="valid")
            np.testing.assert_allclose(found, expected, atol=1e-12)


# -- weights ----------------------------------------------------------------------------


def views_and_labels(n=40, seed=0):
    """Kernels of classes, of people, and of neither, and noise in all of them."""
    rng = np.random.default_rng(seed)
    codes, groups = np.arange(n) % 3, np.arange(n) // 8
    points = [np.eye(3)[codes], np.eye(5)[groups], np.zeros((n, 1))]
    points = [np.hstack([p, 0.2 * rng.standard_normal((n, 4))]) for p in points]
    apart = [((p[:, np.newaxis] - p) ** 2).sum(axis=2) for p in points]
    return np.stack([np.exp(-d) for d in apart]), codes, groups


@pytest.mark.parametrize("landmarks", [np.arange(40), np.arange(1, 40, 2)])
def test_weights_are_powers_of_correlations_over_pairs_of_different_groups(landmarks):
    views, codes, groups = views_and_labels()
    views = 0.6 * views + 0.4 * views[[1, 2, 0]]
    views = views[:, :, landmarks]
    pairs = [
        (i, j)
        for i in range(40)
        for j, landmark in enumerate(landmarks)
        if groups[i] != groups[landmark]
    ]
    same = (codes[:, None] == codes[landmarks]).astype(float)
    alignments = []
    for view in views:
        # Both ways of centring, by the library: columns, then rows.
        k, t = (scale(scale(m, with_std=False), axis=1, with_std=False) for m in (view, same))
        kt, kk, tt = (sum(a[p] * b[p] for p in pairs) for a, b in ((k, t), (k, k), (t, t)))
        alignments.append(max(kt / np.sqrt(kk * tt), 0))
    expected = np.array(alignments) ** 6
    found = align_weights(views, codes, groups, landmarks)
    np.testing.assert_allclose(found, expected / expected.sum(), rtol=1e-6)
    assert found.sum() == pytest.approx(1)
    constant = np.ones((2, 40, len(landmarks)))
    np.testing.assert_array_equal(align_weights(constant, codes, groups, landmarks), [0.5, 0.5])


# -- the regression ----------------------------------------------------------------------


def points(n=24, n_classes=3, seed=0):
    """A kernel of points of overlapping classes, and their classes."""
    rng = np.random.default_rng(seed)
    codes = np.arange(n) % n_classes
    X = rng.standard_normal((n, 2)) + 1.5 * np.column_stack([np.cos(2 * codes), np.sin(2 * codes)])
    squares = ((X[:, np.newaxis] - X) ** 2).sum(axis=2)
    return np.exp(-squares / 4), codes


@pytest.mark.parametrize("n_classes", [2, 3])
@pytest.mark.parametrize("C", [0.3, 10])
def test_regression_minimises_its_objective(n_classes, C):
    """Over f = K A + b: C times the log-loss and half the squared norm in the kernel's space."""
    K, codes = points(n_classes=n_classes)
    n = len(K)

    # Of two classes the library penalises the difference, half as much.
    weight = 1 if n_classes > 2 else 2

    def objective(z):
        A, b = z[:-n_classes].reshape(n, n_classes), z[-n_classes:]
        f = K @ A + b
        loss = (logsumexp(f, axis=1) - f[np.arange(n), codes]).sum()
        by_f = C * (softmax(f, axis=1) - np.eye(n_classes)[codes])
        slope = np.r_[(K @ (by_f + weight * A)).ravel(), by_f.sum(axis=0)]
        return C * loss + weight * np.einsum("nk,nm,mk->", A, K, A) / 2, slope

    start = np.zeros(n * n_classes + n_classes)
    best = minimize(objective, start, jac=True, options={"maxiter": 5000})
    A, b = KernelRegression(K, C).fit(codes)
    assert objective(np.r_[A.ravel(), b])[0] <= best.fun * (1 + 1e-6)
    np.testing.assert_allclose(decision_values(K, A, b).sum(axis=1), 0, atol=1e-6)


def test_a_kernel_of_zeros_adds_nothing():
    K, codes = points()
    landmarks = np.arange(0, len(K), 2)
    own = K[:, landmarks]
    expected = decision_values(own, *KernelRegression(own, 5, landmarks).fit(codes))
    both = np.hstack([own, np.zeros_like(own)])
    found = decision_values(both, *KernelRegression(both, 5, landmarks).fit(codes))
    np.testing.assert_allclose(found, expected, atol=1e-9)


def low_rank(n, n_kernels, rank=4, seed=3):
    """Kernels of few features each, side by side, and classes that they tell."""
    rng = np.random.default_rng(seed)
    Z = rng.standard_normal((n_kernels, n, rank))
    codes = (Z[0, :, 0] + Z[-1, :, 1] + 0.5 * rng.standard_normal(n) > 0).astype(int)
    return Z @ Z.swapaxes(1, 2), codes + (Z[0, :, 2] > 1)


@pytest.mark.parametrize("n_kernels", [1, 3])
def test_landmarks_that_span_the_kernels_lose_nothing(n_kernels):
    """Nyström's approximation is exact where the rank is not above the number of landmarks."""
    kernels, codes = low_rank(60, n_kernels)
    landmarks = np.arange(0, 60, 5)
    exact = KernelRegression(kernels.sum(axis=0), 2).fit(codes)
    expected = decision_values(kernels.sum(axis=0), *exact)
    wide = np.hstack(kernels[:, :, landmarks])
    found = KernelRegression(wide, 2, landmarks).fit(codes)
    np.testing.assert_allclose(decision_values(wide, *found), expected, atol=2e-3)
    # Of all as landmarks, in any order.
    order = np.random.default_rng(0).permutation(60)
    wide = np.hstack(kernels[:, :, order])
    found = KernelRegression(wide, 2, order).fit(codes)
    np.testing.assert_allclose(decision_values(wide, *found), expected, atol=2e-3)


def test_landmarks_that_are_held_out_are_not_compared_with():
    kernels, codes = low_rank(60, 2)
    landmarks = np.arange(0, 60, 3)
    wide = np.hstack(kernels[:, :, landmarks])
    regression = KernelRegression(wide, 2, landmarks)
    out = np.arange(60) % 4 == 0
    A, _ = regression.fit(codes, ~out)
    is_out = np.tile(out[landmarks], 2)
    assert (A[is_out] == 0).all()
    assert (A[~is_out] != 0).any(axis=1).all()
    folds = out.astype(int)
    np.testing.assert_array_equal(
        held_out_decisions(regression, wide, codes, folds)[out],
        decision_values(wide[out], *regression.fit(codes, ~out)),
    )
    # Without a landmark there is no decision.
    all_in_one = np.isin(np.arange(60), landmarks).astype(int)
    found = held_out_decisions(regression, wide, codes, all_in_one)
    assert np.isnan(found[landmarks]).all()
    assert np.isfinite(found[all_in_one == 0]).all()


def test_held_out_decisions_are_those_of_the_other_folds():
    K, codes = points()
    codes[codes == 2] = np.where(np.arange(8) < 4, 2, 1)
    folds = np.arange(24) % 5
    # The third class is in two of the folds only, all of one in the last.
    folds[codes == 2] = 1
    regression = KernelRegression(K, 5)
    found = held_out_decisions(regression, K, codes, folds)
    for fold in range(5):
        out = folds == fold
        expected = decision_values(K[out], *regression.fit(codes, ~out))
        np.testing.assert_array_equal(found[out], expected)
    assert (found[folds == 1, 2] == -np.inf).all()
    assert np.isfinite(found[folds != 1]).all()
    one_left = np.where(codes == 0, 0, 1)
    found = held_out_decisions(regression, K, codes, one_left)
    assert np.isnan(found[one_left == 1]).all()
    assert np.isfinite(found[one_left == 0, 1:]).all()


def test_a_fold_gains_nothing_where_no_two_can_be_held_out():
    """Of two folds, and where two of three hold all classes but one."""
    K, codes = points(n=30)
    regression = KernelRegression(K, 5)
    for folds in (np.arange(30) // 3 % 2, codes):
        decisions = held_out_decisions(regression, K, codes, folds)
        assert fold_gain(regression, K, codes, folds, decisions) == 0


def test_folds_do_not_divide_groups_and_divide_classes_evenly():
    groups = np.repeat(np.arange(7), [9, 1, 4, 4, 2, 8, 5])
    folds = assign_folds(np.zeros(len(groups), int), groups, 3)
    assert all(len(set(folds[groups == g])) == 1 for g in range(7))
    assert sorted(np.bincount(folds)) == [10, 11, 12]
    codes = np.array([0, 1, 0, 0, 1, 0, 0, 2, 0, 0, 0])
    assert assign_folds(codes, None).tolist() == [0, 0, 1, 2, 1, 3, 4, 0, 0, 1, 2]
    assert set(assign_folds(np.zeros(14, int), np.arange(14) // 2)) == set(range(5))


@pytest.mark.parametrize("temperature", [0.5, 4, 30])
def test_temperature_of_simulated_classes_is_recovered(temperature):
    rng = np.random.default_rng(0)
    f = rng.standard_normal((20_000, 4)) / temperature
    cumulated = softmax(temperature * f, axis=1).cumsum(axis=1)
    codes = (rng.uniform(size=(len(f), 1)) > cumulated).sum(axis=1)
    assert fit_temperature(f, codes) == pytest.approx(temperature, rel=0.05)
    unknown = np.full((5, 4), np.nan)
    more = np.concatenate([f, unknown, np.tile([-np.inf, 0, 0, 0], (3, 1))])
    given = np.concatenate([codes, np.zeros(8, int)])
    assert fit_temperature(more, given) == fit_temperature(f, codes)


def test_temperature_of_few_or_perfect_decisions_stays_near_the_prior():
    assert fit_temperature(np.full((3, 2), np.nan), np.zeros(3, int)) == pytest.approx(4)
    right = np.tile([1.0, -1], (50, 1))
    assert 4 < fit_temperature(right, np.zeros(50, int)) < 10
    assert 0.5 < fit_temperature(right[:1], np.ones(1, int)) < 4
