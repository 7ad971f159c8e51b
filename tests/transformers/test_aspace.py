"""aSpace against the eigenvalue equation itself, and poses with gaps against conditional normal
distributions written out.
"""

from contextlib import nullcontext

import numpy as np
import pandas as pd
import pytest
from sklearn.decomposition import PCA
from sklearn_motionsync import ASpace, DirectionCosines
from sklearn_motionsync.matching.gaps import SHRINKAGE, Filler, moments_of_seen


@pytest.fixture(scope="module")
def poses():
    rng = np.random.default_rng(0)
    scales = np.array([5.0, 3.0, 1.0, 0.5, 0.1])
    rotation = np.linalg.qr(rng.standard_normal((5, 5)))[0]
    X = [(rng.standard_normal((n, 5)) * scales) @ rotation + 7 for n in (40, 60, 25)]
    return X


def test_eigenvectors_of_the_pooled_covariance(poses):
    aspace = ASpace(1.0).fit(poses)
    covariance = np.cov(np.concatenate(poses).T)
    for value, vector in zip(aspace.explained_variance_, aspace.components_, strict=True):
        np.testing.assert_allclose(covariance @ vector, value * vector, atol=1e-10)
    np.testing.assert_allclose(aspace.mean_, np.concatenate(poses).mean(axis=0))


@pytest.mark.parametrize("share", [0.3, 0.5, 0.9, 0.95, 0.99, 1.0])
def test_smallest_b_that_reaches_the_share(poses, share):
    values = np.linalg.eigvalsh(np.cov(np.concatenate(poses).T))[::-1]
    shares = np.cumsum(values) / values.sum()
    expected = next(b for b in range(1, 6) if shares[b - 1] >= share - 1e-12)
    aspace = ASpace(share).fit(poses)
    assert aspace.n_components_ == expected
    np.testing.assert_allclose(aspace.residual_variance_, values[expected:].sum(), atol=1e-10)
    kept = aspace.explained_variance_.sum()
    np.testing.assert_allclose(kept + aspace.residual_variance_, values.sum())


def test_residual_variance_is_the_reconstruction_error(poses):
    aspace = ASpace(2).fit(poses)
    back = aspace.inverse_transform(aspace.transform(poses))
    error = np.concatenate(back) - np.concatenate(poses)
    np.testing.assert_allclose(np.square(error).sum() / (len(error) - 1), aspace.residual_variance_)
    by_parameter = np.square(error).sum(axis=0) / (len(error) - 1)
    np.testing.assert_allclose(aspace.left_out_variance_, by_parameter)


def test_constant_features_and_constant_data(poses):
    X = [np.column_stack([x, np.full(len(x), 3.0)]) for x in poses]
    aspace = ASpace(1.0).fit(X)
    np.testing.assert_allclose(aspace.inverse_transform(aspace.transform(X))[0], X[0], atol=1e-12)
    still = ASpace().fit([np.ones((4, 3))])
    assert still.n_components_ == 1
    assert still.explained_variance_ratio_.tolist() == [0]
    np.testing.assert_array_equal(still.transform([np.ones((2, 3))])[0], np.zeros((2, 1)))


@pytest.mark.parametrize(
    ("n_components", "X", "message"),
    [
        (6, [np.zeros((9, 5))], "n_components=6 is more than the 9 poses of 5 features"),
        (4, [np.zeros((3, 5))], "use at most 3"),
        (0.95, np.zeros((1, 5)), "at least 2 poses"),
    ],
)
def test_fit_refuses_too_few_poses_or_features(n_components, X, message):
    with pytest.raises(ValueError, match=message):
        ASpace(n_components).fit(X)


def test_inverse_transform_refuses_wrong_width(poses):
    aspace = ASpace(2).fit(poses)
    with pytest.raises(ValueError, match="Trial 0 has 3 features a frame, but ASpace"):
        aspace.inverse_transform([np.zeros((4, 3))])


# -- gaps -----------------------------------------------------------------------------------


def low_rank(n_trials, n_frames=60, rank=2, n_features=6, noise=0.01, seed=0):
    """Smooth trials of few dimensions, and a little noise."""
    rng = np.random.default_rng(seed)
    mixing = np.random.default_rng(99).standard_normal((rank, n_features))
    t = np.linspace(0, 1, n_frames)[:, np.newaxis]
    X = []
    for _ in range(n_trials):
        phase, pace = rng.uniform(0, 6, rank), rng.uniform(3, 9, rank)
        x = np.sin(pace * t + phase) @ mixing + 5
        X.append(x + noise * rng.standard_normal(x.shape))
    return X


def hide(X, share, seed=0, run=1):
    """Copies with runs of single features hidden."""
    rng = np.random.default_rng(seed)
    out = []
    for x in X:
        starts = rng.random(x.shape) < share / run
        hidden = np.zeros(x.shape, dtype=bool)
        for k in range(run):
            hidden[k:] |= starts[: len(x) - k]
        out.append(np.where(hidden, np.nan, x))
    return out


def shrunk(covariance):
    return covariance + SHRINKAGE * np.diag(np.diag(covariance))


def conditional(x, mean, covariance):
    """Expectation and covariance of one vector given its values that are not NaN."""
    hidden, x, left = np.isnan(x), x.copy(), np.zeros_like(covariance)
    seen = ~hidden
    weights = covariance[np.ix_(hidden, seen)] @ np.linalg.pinv(covariance[np.ix_(seen, seen)])
    x[hidden] = mean[hidden] + weights @ (x[seen] - mean[seen])
    left[np.ix_(hidden, hidden)] = (
        covariance[np.ix_(hidden, hidden)] - weights @ covariance[np.ix_(seen, hidden)]
    )
    return x, left


def test_components_are_those_of_the_covariance_of_what_was_seen():
    """Every covariance is that of the poses that show both features, by pandas."""
    X = hide(low_rank(3, n_features=5, noise=0.3), 0.2)
    rows = np.concatenate(X)
    aspace = ASpace(1.0).fit(X)
    np.testing.assert_allclose(aspace.mean_, np.nanmean(rows, axis=0), rtol=1e-12)
    covariance = (aspace.components_.T * aspace.explained_variance_) @ aspace.components_
    centred = rows - aspace.mean_
    both = np.isfinite(rows)
    slow = np.empty((5, 5))
    for i in range(5):
        for j in range(5):
            shown = both[:, i] & both[:, j]
            slow[i, j] = (centred[shown, i] * centred[shown, j]).mean()
    seen = both.any(axis=1).sum()
    values, vectors = np.linalg.eigh(slow * seen / (seen - 1))
    slow = (vectors * np.abs(values)) @ vectors.T
    np.testing.assert_allclose(covariance, slow, rtol=1e-9, atol=1e-12)


def test_without_gaps_nothing_is_estimated_otherwise(monkeypatch):
    monkeypatch.delattr("sklearn_motionsync.transformers.aspace.moments_of_seen")
    monkeypatch.delattr(Filler, "expect")
    X = low_rank(3)
    aspace, pca = ASpace(3).fit(X), PCA(svd_solver="auto").fit(np.concatenate(X))
    np.testing.assert_array_equal(aspace.components_, pca.components_[:3])
    np.testing.assert_array_equal(aspace.mean_, pca.mean_)
    np.testing.assert_array_equal(aspace.missing_, np.zeros(6))
    for x, points in zip(X, aspace.transform(X), strict=True):
        np.testing.assert_array_equal(points, (x - pca.mean_) @ aspace.components_.T)


@pytest.mark.parametrize("fitted_on", ["whole", "gaps"])
def test_rows_are_the_conditional_expectation_of_each_pose(fitted_on):
    X = low_rank(4)
    gaps = hide(X, 0.3)
    rows = np.concatenate(X if fitted_on == "whole" else gaps)
    aspace = ASpace(1.0).fit(rows)
    covariance = (aspace.components_.T * aspace.explained_variance_) @ aspace.components_
    new = np.concatenate(hide(low_rank(2, seed=5), 0.5, seed=1))
    points = aspace.transform(new)
    for x, point in zip(new, points, strict=True):
        if np.isnan(x).all():
            assert np.isnan(point).all()
            continue
        whole, _ = conditional(x, aspace.mean_, shrunk(covariance))
        np.testing.assert_allclose(point, aspace.components_ @ (whole - aspace.mean_), atol=1e-9)


def test_correlation_time_is_where_the_autocorrelation_falls_to_one_over_e():
    def time_of(trials):
        return Filler.of(*moments_of_seen(trials), trials).times[0]

    rng = np.random.default_rng(0)
    decay = np.exp(-1 / 12)
    X = []
    for _ in range(60):
        x = [rng.standard_normal(3)]
        for _ in range(300):
            x.append(decay * x[-1] + np.sqrt(1 - decay**2) * rng.standard_normal(3))
        X.append(np.array(x))
    assert 10 < time_of(X) < 14
    assert 10 < time_of(hide(X, 0.2)) < 14
    assert time_of([rng.standard_normal((99, 3))]) < 1


def test_a_limb_of_people_that_is_hidden_for_a_second(bends):
    """An arm of eight of 24 bends: nearer than the mean, straight lines and no order in time."""
    joints = [3 * bends.skeleton.index_of(f"left_{name}") for name in ("elbow", "wrist")]
    gaps = [x.copy() for x in bends.data]
    for i in range(0, 24, 3):
        for k in joints:
            gaps[i][100:220, k : k + 3] = np.nan
    cosines = DirectionCosines(bends.skeleton, hidden="nan").fit(gaps)
    truth, poses = cosines.transform(bends.data), cosines.transform(gaps)
    hidden = np.isnan(np.concatenate(poses))

    def error(filled):
        return np.sqrt(np.square(np.concatenate(filled) - np.concatenate(truth))[hidden].mean())

    aspace = ASpace(1.0).fit(poses)
    found = error(aspace.inverse_transform(aspace.transform(poses)))
    rows = [aspace.transform(x) for x in poses]
    lines = [pd.DataFrame(x).interpolate().to_numpy() for x in poses]
    means = [np.where(np.isnan(x), aspace.mean_, x) for x in poses]
    assert found < 0.9 * error(lines)
    assert found < 0.6 * error(means)
    assert found < 0.8 * error(aspace.inverse_transform(rows))


# -- what is missing, and what is refused -------------------------------------------------


def test_missing_is_the_share_of_the_poses():
    X = [x.copy() for x in low_rank(2, n_frames=50)]
    X[0][:20, 3] = np.nan
    X[1][7] = np.nan
    np.testing.assert_allclose(ASpace().fit(X).missing_, [0.01, 0.01, 0.01, 0.21, 0.01, 0.01])


@pytest.mark.parametrize("named", [False, True])
def test_a_feature_that_was_never_seen_is_refused_by_its_name(named):
    X = low_rank(3)
    for x in X:
        x[:, 4] = np.nan
    if named:
        X = [pd.DataFrame(x, columns=list("abcdef")) for x in X]
    where = r"Feature 4 \('e'\)" if named else "Feature 4"
    with pytest.raises(
        ValueError, match=f"{where} was never seen\\. Of 6 features 1 was seen in fewer"
    ):
        ASpace().fit(X)
    X = [np.array(x) for x in X]
    X[1][9, 4] = 5
    with pytest.raises(ValueError, match="Feature 4 was seen in one pose only"):
        ASpace().fit(X)


def test_a_feature_that_was_hardly_ever_seen_is_warned_of():
    whole = low_rank(2, n_frames=9, noise=0.3)
    X = [x.copy() for x in whole]
    for x in X[1:]:
        x[:, 4] = np.nan
    X[0][5:, 4] = np.nan
    with pytest.warns(UserWarning, match="Feature 4 was seen in 5 poses of 18, and a"):
        ASpace().fit(X)
    X[0][5, 4] = whole[0][5, 4]
    ASpace().fit(X)


@pytest.mark.parametrize("n", [2, 5])
def test_constant_features_and_few_poses(n):
    X = [np.column_stack([x[:n], np.full(n, 3.0)]) for x in low_rank(2, noise=0.3)]
    gaps = [x.copy() for x in X]
    gaps[0][0, 6] = gaps[0][0, 1] = gaps[1][1, 2] = np.nan
    with pytest.warns(UserWarning, match="fewer poses than features") if n == 2 else nullcontext():
        aspace = ASpace(1.0).fit(gaps)
    back = aspace.inverse_transform(aspace.transform(gaps))
    np.testing.assert_allclose(back[0][:, 6], 3, atol=1e-9)
    assert all(np.isfinite(x).all() for x in back)
    still = ASpace().fit([np.array([[1.0, np.nan], [1, 2], [1, 2]])])
    np.testing.assert_allclose(still.transform([np.array([[np.nan, 2.0], [1, 2]])])[0], 0)


def test_nan_points_become_nan_poses():
    aspace = ASpace(2).fit(low_rank(3))
    points = aspace.transform(low_rank(1))
    points[0][3, 1] = np.nan
    (back,) = aspace.inverse_transform(points)
    assert np.isnan(back[3]).all()
    assert np.isfinite(np.delete(back, 3, axis=0)).all()
