"""The benchmark of trackers: its peer against the joint Gaussian."""

import numpy as np
import pytest
from scipy.linalg import block_diag


@pytest.fixture(scope="module")
def tracking(benchmark):
    return benchmark("tracking")


def joint(model, n, d):
    """Covariance of what can be seen in n frames, one long vector."""
    F, s = model.transition, len(model.transition)
    drives = block_diag(model.spread, *[model.drive] * (n - 1))
    # Each state is the sum of all that was added before, carried on.
    L = np.zeros((n * s, n * s))
    for t in range(n):
        for u in range(t + 1):
            L[t * s : (t + 1) * s, u * s : (u + 1) * s] = np.linalg.matrix_power(F, t - u)
    shown = np.kron(np.eye(n), np.eye(d, s))
    return shown @ L @ drives @ L.T @ shown.T


def conditioned(C, y, noise):
    """Mean of all, given what of y is no NaN."""
    seen = ~np.isnan(y)
    return C[:, seen] @ np.linalg.solve((C + noise)[np.ix_(seen, seen)], y[seen])


@pytest.mark.parametrize(("length", "share"), [(4, 0.25), (12, 0.5)])
def test_filter_equals_conditioning_of_the_joint_gaussian(tracking, length, share):
    rng = np.random.default_rng(3)
    takes = [np.cumsum(rng.standard_normal((20, 2)), axis=0) for _ in range(3)]
    mean, model = tracking.matern(takes, length, share)
    np.testing.assert_allclose(mean, np.concatenate(takes).mean(axis=0))
    noise, y = np.array([[0.09, 0.02], [0.02, 0.05]]), rng.standard_normal((6, 2))
    y[0, 1] = y[2] = y[4, 0] = np.nan
    live = tracking.kalman(model, y, noise)
    C, noises = joint(model, 6, 2), np.kron(np.eye(6), noise)
    for t in range(6):
        past = np.where(np.arange(6)[:, np.newaxis] <= t, y, np.nan)
        expected = conditioned(C, past.ravel(), noises).reshape(6, 2)
        assert live[t] == pytest.approx(expected[t], abs=1e-8)
