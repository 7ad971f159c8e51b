"""The benchmark of trackers: its filters against the joint Gaussian, and what it hides."""

import numpy as np
import pytest
from scipy.linalg import block_diag
from scipy.stats import multivariate_normal


@pytest.fixture(scope="module")
def trackers(benchmark):
    return benchmark("trackers")


def joint(model, n, d):
    """Mean and covariance of what can be seen in n frames, one long vector."""
    F = np.asarray(model.transition @ np.eye(len(model.start)))
    drives = block_diag(model.spread, *[model.drive] * (n - 1))
    # Each state is the sum of all that was added before, carried on.
    s = len(F)
    L = np.zeros((n * s, n * s))
    for t in range(n):
        for u in range(t + 1):
            L[t * s : (t + 1) * s, u * s : (u + 1) * s] = np.linalg.matrix_power(F, t - u)
    shown = np.kron(np.eye(n), np.eye(d, s))
    mean = shown @ L @ np.concatenate([model.start, np.zeros((n - 1) * s)])
    return mean, shown @ L @ drives @ L.T @ shown.T


def conditioned(mean, C, y, noise):
    """Mean and variance of all, given what of y is no NaN."""
    seen = ~np.isnan(y)
    S = C[np.ix_(seen, seen)] + noise**2 * np.eye(seen.sum())
    K = np.linalg.solve(S, C[seen]).T
    return mean + K @ (y[seen] - mean[seen]), np.diag(C - K @ C[seen])


@pytest.fixture(params=["constant_velocity", "autoregression", "pooled_matern"])
def case(request, trackers):
    """A model of two features, with a start, and two takes of six frames and of four."""
    rng = np.random.default_rng(3)
    takes = [np.cumsum(rng.standard_normal((20, 2)), axis=0) for _ in range(3)]
    settings = {"constant_velocity": (1,), "autoregression": (1,), "pooled_matern": (4, 0.25)}
    peer = getattr(trackers, request.param)(takes, *settings[request.param])
    model = trackers.Linear(*peer.model[:2], rng.standard_normal(4), peer.model.spread)
    return model, rng.standard_normal((6, 2)), rng.standard_normal((4, 2))


def test_filter_and_smoother_equal_conditioning_of_the_joint_gaussian(trackers, case):
    model, y, _ = case
    y[0, 1] = y[2] = y[4, 0] = np.nan
    found = trackers.kalman(model, y, 0.3, smooth=True)
    mean, C = joint(model, 6, 2)
    for t in range(6):
        past = y.copy()
        past[t + 1 :] = np.nan
        expected, variances = conditioned(mean, C, past.ravel(), 0.3)
        assert found.means[t] == pytest.approx(expected.reshape(6, 2)[t], abs=1e-9)
        assert found.variances[t] == pytest.approx(variances.reshape(6, 2)[t], abs=1e-9)
    expected, _ = conditioned(mean, C, y.ravel(), 0.3)
    assert found.smoothed == pytest.approx(expected.reshape(6, 2), abs=1e-7)


def test_likelihood_equals_that_of_the_joint_gaussian(trackers, case):
    model, *takes = case
    expected = 0
    for y in takes:
        mean, C = joint(model, len(y), 2)
        S = C + 0.3**2 * np.eye(len(C))
        expected += multivariate_normal.logpdf(y.ravel(), mean, S)
    assert trackers.log_likelihood(model, takes, 0.3) == pytest.approx(expected, rel=1e-9)


def test_imputation_equals_conditioning_of_the_posture(trackers):
    rng = np.random.default_rng(0)
    takes = [rng.standard_normal((50, 3)) @ rng.standard_normal((3, 3))]
    y = rng.standard_normal((4, 3))
    y[0, 1] = y[1, :2] = y[2] = np.nan
    mean, C = trackers.moments_of(takes)
    expected = [conditioned(mean, C, row, 0.3)[0] for row in y]
    assert trackers.imputation(takes, [y], 0.3)[0] == pytest.approx(np.array(expected))


def test_particles_track_a_partly_hidden_posture(trackers):
    rng = np.random.default_rng(0)
    phases = np.linspace(0, np.pi, 60)
    warped = np.stack([np.sin(phases), np.cos(phases), np.sin(phases)], axis=1)
    warped = warped + 0.02 * rng.standard_normal((5, 1, 3))
    takes = list(warped[:, ::2])
    paces = np.log([2.0, 1.9, 2.1])
    particles = trackers.PostureParticles(warped, takes, paces, 0.05)
    y = takes[0].copy()
    y[10:, 2] = np.nan
    (found,) = particles.run([y], rng)
    assert np.abs(found - takes[0]).mean() < 0.05


@pytest.fixture(scope="module")
def hidden(benchmark):
    return benchmark("hidden_limbs")


@pytest.mark.parametrize(("n_frames", "gap"), [(70, 30), (31, 10)])
def test_hidden_intervals_last_a_second_and_avoid_both_ends(hidden, n_frames, gap):
    takes, rng = [np.zeros((n_frames, 37))] * 40, np.random.default_rng(0)
    half, all_of, some = (np.array(hidden.hide(takes, kind, rng)) for kind in hidden.KINDS)
    for masks in (half, some):
        limbs = masks[..., 1:].reshape(40, n_frames, 12, 3)
        assert not masks[..., 0].any()
        assert (limbs.all(axis=-1) == limbs.any(axis=-1)).all()
        assert set(limbs[..., 0].any(axis=1).sum(axis=-1)) == {6}
    assert half.all(axis=1).sum() == 40 * 18
    assert (all_of.any(axis=2) == all_of.all(axis=2)).all()
    for masks in (all_of, some):
        times = masks.any(axis=2)
        assert set(times.sum(axis=1)) == {gap}
        assert not times[:, [0, -1]].any()


def test_angle_error_uses_hidden_limbs_and_ignores_length(hidden):
    truth, estimate, mask = np.zeros((2, 37)), np.zeros((2, 37)), np.zeros((2, 37), dtype=bool)
    truth[:, 1::3], estimate[:, 1::3] = 1, 7
    # A quarter turn of the second limb in the first frame; of the third, in the second, unseen.
    estimate[0, 4:7], estimate[1, 7:10] = (0, 0.1, 0), (0, 1, 0)
    mask[:, 4:7] = True
    assert hidden.angles(estimate, truth, mask) == pytest.approx(45, abs=1e-3)


def test_phase_of_a_path_is_the_middle_of_a_pause(hidden):
    times = np.array([0, 1, 1, 1, 4.0])
    assert hidden.phases_of(times, 5) == pytest.approx([0, 2, 2 + 2 / 3, 2 + 4 / 3, 4])
