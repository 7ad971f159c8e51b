"""DenseSynchronizer with a learnt metric: noise, and when no metric is learnt."""

import numpy as np
import pytest
from sklearn_motionsync import DenseSynchronizer


@pytest.fixture(scope="module")
def trials():
    """Twelve trials of one movement of three features, each at a pace of its own."""
    rng, t = np.random.default_rng(0), np.linspace(0, 1, 60)
    X, phases = [], []
    for _ in range(12):
        phases.append(t + rng.uniform(-0.1, 0.1) * np.sin(np.pi * t))
        style = 1 + 0.2 * rng.standard_normal(3)
        x = [np.sin(7 * phases[-1]), np.cos(5 * phases[-1]), np.sin(3 * phases[-1])]
        X.append(np.transpose(x) * style)
    return X, np.array(phases)


def with_noise(X, seed=0):
    """As many columns again, of white noise of the same energy."""
    rng = np.random.default_rng(seed)
    energy = np.concatenate(X).std(axis=0)
    return [np.hstack([x, energy * rng.standard_normal(x.shape)]) for x in X]


def test_noise_has_a_small_share(trials):
    X, noisy = trials[0], with_noise(trials[0])
    sync = DenseSynchronizer(60).fit(noisy)
    assert sync.metric_.share.sum() == pytest.approx(1)
    assert sync.metric_.energy.sum() == pytest.approx(1)
    assert sync.metric_.energy[3:].sum() > 0.2
    assert sync.metric_.share[3:].sum() < 0.2 * sync.metric_.energy[3:].sum()

    def moved(**settings):
        settings = {"n_frames": 60, "pattern": 0, "refine": False, **settings}
        clean, found = (DenseSynchronizer(**settings).fit(x).match(x).times for x in (X, noisy))
        return np.abs(found - clean)[1:].mean()

    assert moved() < 1
    assert moved() < 0.5 * moved(metric=None)


def test_energy_is_the_share_of_velocities(trials):
    X = [x * [1, 2, 3] for x in trials[0]]
    energy = np.array([DenseSynchronizer(60).fit(x).metric_.energy for x in (trials[0], X)])
    assert energy.shape == (2, 3)
    grown = energy[0] * [1, 4, 9]
    # It is learnt in single precision.
    np.testing.assert_allclose(energy[1], grown / grown.sum(), rtol=1e-6)


@pytest.mark.parametrize(
    ("settings", "n"),
    [
        ({"metric": None}, 12),
        ({"consensus": 0}, 12),
        ({"cost": "pose"}, 12),
        ({"cost": "elastic"}, 12),
        ({}, 2),
        ({}, 1),
    ],
    ids=str,
)
def test_no_metric_equals_metric_none(settings, n, trials):
    """Off without a vote, for other costs, and for fewer than three trials."""
    X = trials[0][:n]
    sync, plain = DenseSynchronizer(60, **settings), DenseSynchronizer(60, **settings)
    sync.fit(X)
    plain.set_params(metric=None, max_offset=0.25).fit(X)
    assert sync.metric_ is None
    np.testing.assert_array_equal(sync.match(X).times, plain.match(X).times)
    np.testing.assert_array_equal(sync.match(X).distances, plain.match(X).distances)


def test_metric_of_many_is_learnt_from_twenty(trials):
    X = [x for x in trials[0] for _ in range(5)]
    rng = np.random.default_rng(0)
    X = [x + 0.01 * rng.standard_normal(x.shape) for x in X]
    used = DenseSynchronizer(60).fit(X).metric_.trials
    assert len(used) == 20
    assert (used[0], used[-1]) == (0, 59)
    assert set(np.diff(used)) == {3, 4} or set(np.diff(used)) == {3}
    np.testing.assert_array_equal(DenseSynchronizer(60).fit(X[:12]).metric_.trials, range(12))


def test_metric_hardly_depends_on_the_number_of_frames(trials):
    X = trials[0]
    short, long = (DenseSynchronizer(p, max_offset=0.1).fit(X).metric_ for p in (100, 401))
    np.testing.assert_allclose(short.share, long.share, atol=0.05)
