"""DenseSynchronizer with a learnt metric: noise, when none is learnt, and what it sharpens."""

import numpy as np
import pytest
from sklearn_motionsync import DenseSynchronizer, LinearSynchronizer
from sklearn_motionsync.datasets import make_gait
from sklearn_motionsync.matching.sharpening import Sharpener


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


# -- what sharpening brings: single curves, several signals, noise ---------------------


P = 101


def warps(X, n_frames=P, **params):
    """Warps with sharpening, and without."""
    sync = DenseSynchronizer(n_frames, refine=False, **params)
    sharpened = sync.fit(X).match(X).times
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(Sharpener, "learn", lambda *arguments: None)
        return sharpened, sync.fit(X).match(X).times


def vertices(curves, first, last):
    """Frames of the maxima between two frames, by a parabola."""
    found = []
    for curve in curves:
        top = first + int(np.argmax(curve[first:last]))
        before, here, after = curve[top - 1 : top + 2]
        found.append(top + (before - after) / (2 * (before - 2 * here + after)))
    return np.array(found)


def spread(times, moments):
    """Standard deviation of moments of trials on the clock of the pattern."""
    frames = np.arange(times.shape[1])
    tilted = times + 1e-9 * frames
    return np.std([np.interp(m, t, frames) for m, t in zip(moments, tilted, strict=True)], ddof=1)


@pytest.mark.parametrize(("noise", "share"), [(0.005, 0.6), (0.05, 1.05), (0.2, 1.05)])
def test_known_warps_of_a_single_curve(noise, share, known_warps):
    """Clean curves gain much; noise is not followed."""
    cases = [known_warps(seed, noise, n_features=1) for seed in range(4)]
    errors = [
        [np.abs(times - truth)[1:].mean() for times in warps(X, 100, pattern=0)]
        for X, truth in cases
    ]
    with_it, without = np.mean(errors, axis=0)
    assert with_it < share * without


def test_moments_of_several_signals_come_closer():
    gait = make_gait(timing=6, random_state=0)
    moments = gait.keyframes * (P - 1) / (np.array([len(x) for x in gait.data])[:, np.newaxis] - 1)
    spreads = [[spread(times, each) for each in moments.T] for times in warps(gait.data)]
    with_it, without = np.array(spreads)
    assert (with_it < without).all()
    assert with_it.mean() < 0.6 * without.mean()


@pytest.mark.parametrize(
    ("file", "first", "last", "most"),
    [("Besier2009-vastus", 8, 45, 0.6), ("Pataky2014-mediolateral", 35, 80, 0.4)],
)
def test_peaks_of_single_curves_of_people(file, first, last, most, real_data):
    """In per cent; without sharpening 1.7 and 0.7, with time normalisation alone 4.7 and 7.1."""
    curves = np.loadtxt(real_data / "nlreg1d" / f"{file}.csv", delimiter=",")[:, 1:]
    X = LinearSynchronizer(P).fit_transform(curves[:, :, np.newaxis])
    moments = vertices(X[:, :, 0], first, last)
    with_it, without = warps(list(X))
    assert spread(with_it, moments) < most
    still, before = (np.mean(np.diff(times, axis=1) < 0.1) for times in (with_it, without))
    assert still < before + 0.005


def test_what_sharpens_is_told(known_warps):
    X, _ = known_warps(0, 0.005, n_features=2)
    noise = np.random.default_rng(0).standard_normal((len(X), 100, 1))
    X = [np.concatenate([x, 0.3 * own], axis=1) for x, own in zip(X, noise, strict=True)]
    sync = DenseSynchronizer(refine=False).fit(X)
    found = sync.sharpening_
    assert found.width == 0.01
    assert (found.agreement[:2] > 0.9).all()
    assert np.isnan(found.agreement[2])
    assert found.trust.shape == (100,)
    assert ((found.trust >= 0) & (found.trust <= 1)).all()
    assert found.trust.mean() > 0.5


@pytest.mark.parametrize(
    "params", [{"metric": None}, {"consensus": 0}, {"refine": True}, {"cost": "elastic"}], ids=str
)
def test_nothing_sharpens_without_a_metric_and_where_warps_are_refined(params, known_warps):
    X, _ = known_warps(0, 0.005, n_features=1)
    assert DenseSynchronizer(**{"refine": False, **params}).fit(X).sharpening_ is None


def test_sharpened_warps_stay_in_the_band(known_warps):
    X, _ = known_warps(0, 0.05, n_features=2)
    sync = DenseSynchronizer(100, max_offset=0.03, refine=False).fit(X)
    assert sync.sharpening_ is not None
    times = sync.match(X).times
    assert np.abs(times - np.arange(100)).max() <= 3
    assert (np.diff(times, axis=1) >= 0).all()
