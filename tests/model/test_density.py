"""The density of whole trials: against a dense covariance matrix, and on people left out."""

import numpy as np
import pytest
from scipy.stats import multivariate_normal, norm
from sklearn.covariance import ledoit_wolf
from sklearn.pipeline import make_pipeline
from sklearn_motionsync import ActionModel, ASpace, DenseSynchronizer, DirectionCosines
from sklearn_motionsync.model.density import shrinkage_of, smooth_basis


def loadings():
    """What four hidden numbers of a person do to three shapes of three features."""
    return np.random.default_rng(7).standard_normal((4, 3, 3))


def curves(n=30, n_frames=24, seed=0):
    """Smooth trials of three features that vary together, with a little noise."""
    rng = np.random.default_rng(seed)
    t = np.linspace(0, 1, n_frames)
    shapes = np.stack([np.ones_like(t), np.sin(6 * t), np.cos(9 * t)])
    of_people = np.einsum("nw,wfs->nfs", rng.standard_normal((n, 4)), loadings())
    smooth = np.einsum("nfs,st->ntf", of_people, shapes)
    return smooth * [1, 0.1, 30] + 0.05 * rng.standard_normal((n, n_frames, 3)) * [1, 0.2, 30]


def dense_density(X, spread):
    """The mean and the covariance matrix (P n_features, P n_features) of trials, step by step."""
    n, n_frames, width = X.shape
    mean = X.mean(axis=0)
    std = np.sqrt(np.maximum(((X - mean) ** 2).mean(axis=(0, 1)), 1e-9 * spread))
    z = (X - mean) / std
    n_bumps = min(16, (n_frames + 1) // 2)
    centres = -0.05 + 1.1 * np.arange(n_bumps) / (n_bumps - 1)
    t = np.arange(n_frames) / (n_frames - 1)
    bumps = np.exp(-(((t[:, None] - centres) * (n_bumps - 1) / 1.1) ** 2) / 2)
    onto = bumps @ np.linalg.pinv(bumps)
    noise = [((z[..., f] - z[..., f] @ onto) ** 2).sum() / n for f in range(width)]
    noise = np.array(noise) / (n_frames - n_bumps) + 1e-4
    basis = np.linalg.qr(bumps)[0]
    weights = np.array([(basis.T @ x).ravel() for x in z])
    share = ledoit_wolf(weights, assume_centered=True)[1]
    of_bumps = (weights.reshape(n, n_bumps, width) ** 2).mean(axis=(0, 2))
    to_values = np.kron(basis, np.eye(width))
    together = (1 - share) * weights.T @ weights / (n - 1)
    alone = share * np.kron(np.diag(of_bumps), np.eye(width))
    covariance = to_values @ (together + alone) @ to_values.T + np.diag(np.tile(noise, n_frames))
    scale = np.tile(std, n_frames)
    return mean, covariance * np.outer(scale, scale)


@pytest.mark.parametrize("n_frames", [24, 40, 9])
def test_densities_equal_those_of_a_dense_matrix(n_frames):
    X, new = curves(n_frames=n_frames), curves(5, n_frames, seed=1)
    model = ActionModel().fit(X)
    spread = max(X[..., f].var() for f in range(3))
    mean, covariance = dense_density(X, spread)
    expected = multivariate_normal(mean.ravel(), covariance).logpdf(new.reshape(5, -1))
    np.testing.assert_allclose(model.score_samples(new), expected, rtol=1e-7)
    np.testing.assert_allclose(model.score(new), expected.mean(), rtol=1e-7)
    # What was not seen is left out: frames, a feature, and single values.
    new[0, 3:7], new[1, :, 1], new[2, 4, 2] = np.nan, np.nan, np.nan
    for x, density in zip(new, model.score_samples(new), strict=True):
        seen = np.flatnonzero(~np.isnan(x.ravel()))
        marginal = multivariate_normal(mean.ravel()[seen], covariance[np.ix_(seen, seen)])
        np.testing.assert_allclose(density, marginal.logpdf(x.ravel()[seen]), rtol=1e-7)


@pytest.mark.parametrize(("n", "width"), [(3, 50), (40, 7), (20, 300)])
def test_the_share_is_that_of_ledoit_and_wolf(n, width):
    rng = np.random.default_rng(n)
    rows = rng.standard_normal((n, width)) * rng.uniform(0.1, 2, width) + rng.standard_normal(
        (n, 1)
    )
    np.testing.assert_allclose(shrinkage_of(rows), ledoit_wolf(rows, assume_centered=True)[1])
    assert shrinkage_of(np.zeros((4, 6))) == 1


@pytest.mark.parametrize("n_frames", [1, 2, 3, 31, 32, 200])
def test_smooth_curves_are_orthonormal(n_frames):
    basis = smooth_basis(n_frames)
    assert basis.shape == (n_frames, min(16, (n_frames + 1) // 2))
    np.testing.assert_allclose(basis.T @ basis, np.eye(basis.shape[1]), atol=1e-10)


def test_the_density_of_new_people_is_far_above_that_of_independent_values(bends):
    """Real bends, each actor left out; and the same poses in another order of time."""
    gains, told = [], []
    for actor in np.unique(bends.actor):
        known = [x for x, a in zip(bends.data, bends.actor, strict=True) if a != actor]
        new = [x for x, a in zip(bends.data, bends.actor, strict=True) if a == actor]
        steps = DirectionCosines(bends.skeleton), ASpace(0.95), DenseSynchronizer(60)
        pipe = make_pipeline(*steps).fit(known)
        X, Y = pipe.transform(known), pipe.transform(new)
        model = ActionModel().fit(X)
        alone = norm(X.mean(axis=0), X.std(axis=0)).logpdf(Y).sum(axis=(1, 2))
        gains += list((model.score_samples(Y) - alone) / X[0].size)
        shuffled = Y[:, np.random.default_rng(0).permutation(60)]
        told += list(model.score_samples(Y) > model.score_samples(shuffled))
    assert np.mean(gains) > 1
    assert np.mean(told) == 1
