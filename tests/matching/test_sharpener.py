"""Sharpening: what one local match does to a rough warp."""

import numpy as np
import pytest
from scipy.ndimage import gaussian_filter1d
from sklearn_motionsync.matching.filters import noise_width
from sklearn_motionsync.matching.metric import Metric
from sklearn_motionsync.matching.sharpening import Sharpener

P = 101
FRAMES = np.arange(P)


def movement(times):
    """Two signals with turning points, at times in frames: (..., 2)."""
    phase = 2 * np.pi * np.asarray(times, dtype=float) / (P - 1)
    return np.stack([np.sin(1.5 * phase), np.cos(phase) + 0.5 * np.sin(2 * phase)], axis=-1)


def warps(n, size=4.0):
    """Smooth warps ``tau`` from the frames of the pattern to those of n trials, ends pinned."""
    phases = np.linspace(-1, 1, n)[:, np.newaxis]
    return FRAMES + size * phases * np.sin(np.pi * FRAMES / (P - 1))


def trials(times, noise=0.0, seed=0):
    """The trials that these warps lead to: x_m(tau(p)) is the movement at p."""
    clean = np.array([movement(np.interp(FRAMES, tau, FRAMES)) for tau in times])
    return clean + noise * np.random.default_rng(seed).standard_normal(clean.shape)


def plain_metric(n_features=2):
    """Every feature counts, and velocities are as they are."""
    axes = np.eye(n_features)
    return Metric(np.arange(n_features), 1.0, axes, axes)


def learnt(positions, times):
    return Sharpener.learn(plain_metric(), movement(FRAMES), positions, times)


def test_a_blurred_warp_becomes_sharp_and_a_right_one_stays():
    tau = warps(8)
    rough = tau + np.sin(np.pi * FRAMES / (P - 1)) * np.sin(FRAMES / 4) * 1.5
    rough = np.maximum.accumulate(np.clip(rough, 0, P - 1), axis=1)
    assert np.abs(rough - tau).mean() > 0.5
    found = learnt(trials(tau), rough)(trials(tau), rough, reach=25)
    assert np.abs(found - tau).mean() < 0.2
    sharpener = learnt(trials(tau), tau)
    assert sharpener.trust.shape == (P,)
    assert sharpener.trust.mean() > 0.8
    found = sharpener(trials(tau), tau, reach=25)
    assert np.abs(found - tau).max() < 0.5
    np.testing.assert_array_equal(found[:, [0, -1]], [[0, P - 1]] * 8)


def test_the_weight_of_a_feature_is_that_of_its_agreement():
    """The first feature is the movement, the second one of its own in every trial."""
    tau, rng = warps(10), np.random.default_rng(0)
    positions = trials(tau)
    positions[:, :, 1] = gaussian_filter1d(rng.standard_normal((10, P)), 5, axis=1) * 10
    sharpener = learnt(positions, tau)
    assert sharpener.agreement[0] > 0.95
    assert sharpener.agreement[1] < 0.5
    weights = np.linalg.norm(sharpener.axes, axis=1)
    assert weights[0] > 5 * weights[1]
    assert (sharpener.trust <= learnt(trials(tau), tau).trust + 0.05).all()


def test_without_agreement_nothing_is_sharpened():
    """Trials that go the other way, and such that stand still."""
    tau = np.tile(FRAMES.astype(float), (5, 1))
    assert learnt(-trials(tau), tau) is None
    still = np.zeros((5, P, 2))
    assert Sharpener.learn(plain_metric(), still[0], still, tau) is None


@pytest.mark.parametrize(("n_frames", "enough"), [(16, False), (17, True)])
def test_a_local_match_needs_frames(n_frames, enough):
    few = np.arange(n_frames)
    curve = np.sin(few / 3.0)[:, np.newaxis]
    tau = np.tile(few.astype(float), (3, 1))
    found = Sharpener.learn(plain_metric(1), curve, np.stack([curve] * 3), tau)
    assert (found is not None) == enough


@pytest.mark.parametrize("noise", [0.0, 0.1, 0.2])
def test_velocities_are_as_sharp_as_their_noise_allows(noise):
    """At least 1 % of the clip wide."""
    tau = warps(6)
    positions = trials(tau, noise)
    width = max(noise_width(positions) / (P - 1), 0.01)
    assert (width > 0.01) == (noise > 0)
    assert learnt(positions, tau).width == pytest.approx(width, rel=1e-12)


def test_long_trials_are_matched_at_fewer_frames():
    """At five times the frames the same warp is found, in frames of the shorter clock."""
    times = np.linspace(0, P - 1, 5 * (P - 1) + 4)
    tau = warps(8)
    fine = np.array([np.interp(times, FRAMES, row) for row in tau])
    scale = (len(times) - 1) / (P - 1)
    long = np.array([movement(np.interp(times, row, times)) for row in fine])
    rough = fine + np.sin(np.pi * times / (P - 1))
    rough = np.maximum.accumulate(np.clip(rough, 0, P - 1), axis=1)
    sharpener = Sharpener.learn(plain_metric(), movement(times), long, scale * rough)
    assert sharpener.bases.sequences.shape[1] < len(times)
    found = sharpener(long, scale * rough, reach=125) / scale
    assert np.abs(rough - fine).mean() > 0.5
    assert np.abs(found - fine).mean() < 0.2


@pytest.mark.parametrize("n_frames", [P, 375])
def test_a_warp_to_itself_is_exact(n_frames):
    """Rough curves: a pattern that is sampled elsewhere than the trial would not fit."""
    times = np.linspace(0, P - 1, n_frames)
    rough = movement(times) + 0.05 * np.random.default_rng(0).standard_normal((n_frames, 2))
    own = np.arange(float(n_frames))[np.newaxis]
    sharpener = Sharpener.learn(plain_metric(), rough, rough[np.newaxis], own)
    np.testing.assert_allclose(sharpener(rough[np.newaxis], own, reach=125), own, atol=1e-9)


def test_where_nothing_changes_warps_stay():
    """In the middle both signals go on evenly, with noise: there no moment can be told."""
    rng, still = np.random.default_rng(0), slice(42, 59)

    def curve(times):
        ends = np.minimum(times, 30) + np.maximum(times - 70, 0)
        return np.stack([np.sin(ends / 5) + times / 40, np.cos(ends / 5) - times / 50], axis=-1)

    tau = np.tile(FRAMES.astype(float), (8, 1))
    positions = curve(tau) + 0.02 * rng.standard_normal((8, P, 2))
    sharpener = Sharpener.learn(plain_metric(), curve(FRAMES), positions, tau)
    assert sharpener.trust[still].mean() < 0.5 * sharpener.trust[10:25].mean()
    found = sharpener(positions, tau, reach=25)
    assert np.abs(found - tau)[:, still].mean() < 0.3
