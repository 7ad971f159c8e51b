"""The views of trials and their weights: against convolutions and loops."""

import numpy as np
import pytest
from sklearn.preprocessing import scale
from sklearn_motionsync.recognition.kernel import (
    align_weights,
    change_extremes,
    change_shares,
    changes_of,
)


def walk(n_frames=50, n_features=3, seed=0):
    return np.random.default_rng(seed).standard_normal((n_frames, n_features)).cumsum(axis=0)


def convolved(x, reach):
    """The changes of one feature (P,), which stands still before and after."""
    still = np.r_[np.full(reach, x[0]), x, np.full(reach, x[-1])]
    return np.convolve(still, [1, *[0] * (2 * reach - 1), -1], mode="valid")


# -- changes ----------------------------------------------------------------------------


@pytest.mark.parametrize(("n_frames", "reaches"), [(50, (2, 8)), (100, (4, 16)), (2, (1, 1))])
def test_changes_equal_convolutions(n_frames, reaches):
    x = walk(n_frames)
    expected = [np.column_stack([convolved(f, r) for f in x.T]) for r in reaches]
    np.testing.assert_allclose(changes_of(x), expected, atol=1e-12)


def test_extremes_and_shares_equal_loops():
    x, units = walk(), np.array([[1, 2, 0.5], [4, 3, 2]])
    curves = [(convolved(f, r), r, i) for r in (2, 8) for i, f in enumerate(x.T)]
    lowest, highest = [c.min() for c, *_ in curves], [c.max() for c, *_ in curves]
    np.testing.assert_allclose(change_extremes(changes_of(x)), [*lowest, *highest])
    expected = []
    for level in (-2, -1, -0.3, 0, 0.3, 1, 2):
        for curve, reach, i in curves:
            unit = units[0 if reach == 2 else 1, i]
            # Twice a logistic function, less 1.
            over = [2 / (1 + np.exp(-4 * (c / unit - level))) - 1 for c in curve]
            expected.append(np.mean(over))
    np.testing.assert_allclose(change_shares(changes_of(x), units), expected, atol=1e-12)


def test_a_feature_that_does_not_change_in_the_training_set_has_one_share_always():
    units = np.ones((2, 3))
    units[:, 1] = np.inf
    still = [change_shares(changes_of(walk(seed=s)), units).reshape(7, 2, 3) for s in (1, 2)]
    np.testing.assert_array_equal(still[0][..., 1], still[1][..., 1])
    assert (still[0][..., 0] != still[1][..., 0]).all()


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
