"""aSpace against the eigenvalue equation itself."""

import numpy as np
import pytest
from sklearn_motionsync import ASpace


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
