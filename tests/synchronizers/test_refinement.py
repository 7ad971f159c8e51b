"""Refinement: one number tells copies of one source from people; and what refining brings."""

import numpy as np
import pytest
from sklearn_motionsync import ASpace, DenseSynchronizer, DirectionCosines
from sklearn_motionsync.datasets import make_gait
from sklearn_motionsync.matching.filters import white_noise
from sklearn_motionsync.matching.refinement import SAME_SOURCE, curvature, unexplained_variance

P = 100


def error(X, truth, **params):
    sync = DenseSynchronizer(P, pattern=0, **params).fit(X)
    return np.abs(sync.match(X).times - truth)[1:].mean()


@pytest.mark.parametrize(
    ("noise", "n_features", "most"),
    [
        (0.005, 1, np.inf),
        (0.05, 4, np.inf),
        (0.2, 2, np.inf),
        (0.005, 16, 0.03),
        (0.05, 16, 0.12),
        (0.2, 16, 0.35),
    ],
)
def test_copies_of_one_source_are_refined(n_features, noise, most, known_warps):
    """At any noise, and refining them is right: with many features errors are small."""
    errors = []
    for seed in range(2):
        X, truth = known_warps(seed, noise, n_features)
        sync = DenseSynchronizer(P, pattern=0).fit(X)
        assert sync.refines_
        assert 0 <= sync.unexplained_variance_ < SAME_SOURCE
        errors.append(np.abs(sync.match(X).times - truth)[1:].mean())
        assert errors[-1] == error(X, truth, refine=True)
        assert errors[-1] < 0.85 * error(X, truth, refine=False)
    assert np.mean(errors) < most


def test_number_equals_its_formula(known_warps):
    X, _ = known_warps(0, 0.05, 3)
    sync = DenseSynchronizer(80, metric=None).fit(X)
    voted = DenseSynchronizer(80, metric=None, refine=False).fit(X)
    others = np.delete(np.arange(len(X)), sync.pattern_index_)
    noise = white_noise([X[k] for k in (sync.pattern_index_, *others)])
    aligned, left = voted.transform([X[k] for k in others]), []
    for warped in aligned:
        variance = np.square(warped - sync.pattern_).mean(axis=0) - (1 + 2 / 3) * noise
        left.append(np.maximum(variance, 0).sum())
    moving = np.maximum(sync.pattern_.var(axis=0) - noise, 0).sum()
    expected = np.median(left) / moving
    assert unexplained_variance(sync.pattern_, aligned, noise) == pytest.approx(expected)
    # Direct paths tell as much as voted ones.
    assert sync.unexplained_variance_ == pytest.approx(expected, rel=0.3)
    assert sync.refines_ == (sync.unexplained_variance_ < 0.025)


@pytest.mark.parametrize("params", [{"refine": True}, {"refine": False}, {"consensus": 0}], ids=str)
def test_there_is_no_number_unless_it_decides(params, known_warps):
    sync = DenseSynchronizer(P, **params).fit(known_warps(0, 0.05)[0])
    assert np.isnan(sync.unexplained_variance_)
    assert sync.refines_ == (params == {"refine": True})


def test_there_is_no_number_of_one_trial_and_of_gaps_everywhere(known_warps):
    X, _ = known_warps(0, 0.05)
    holes = [x.copy() for x in X]
    for i, x in enumerate(holes):
        x[10 + i : 40 + i] = np.nan
    for trials in (X[:1], holes):
        sync = DenseSynchronizer(P, pattern=0).fit(trials)
        assert np.isnan(sync.unexplained_variance_)
        assert not sync.refines_
    # Those without gaps decide.
    some = DenseSynchronizer(P, pattern=7).fit([*holes[:5], *X[5:]])
    assert some.refines_


def test_trials_too_short_for_their_noise_are_not_refined(known_warps):
    X = [np.sin(np.linspace(0, 3, n))[:, np.newaxis] for n in (4, 5, 6, 5)]
    assert not DenseSynchronizer().fit(X).refines_
    # Equal trials are copies.
    sync = DenseSynchronizer(P).fit([known_warps(0, 0.0)[0][0]] * 3)
    assert sync.unexplained_variance_ == 0
    assert sync.refines_


@pytest.mark.parametrize("n_frames", [5, 6, 30])
def test_curvature_equals_the_sum_of_squared_second_differences(n_frames):
    """With pinned ends: tau' A tau + 2 b' tau + a constant, A as an upper band."""
    band, border = curvature(n_frames)
    inner = np.zeros((n_frames - 2, n_frames - 2))
    for k in range(min(3, n_frames - 2)):
        diagonal = np.diag(band[2 - k, k:], k)
        inner += diagonal + (diagonal.T if k else 0)
    rng = np.random.default_rng(0)
    values = []
    for free in rng.standard_normal((2, n_frames - 2)):
        tau = np.concatenate([[0], free, [n_frames - 1]])
        whole = np.square(np.diff(tau, 2)).sum()
        values.append(whole - free @ inner @ free - 2 * border @ free)
    np.testing.assert_allclose(values[0], values[1])


# -- people ---------------------------------------------------------------------------------


def assert_not_refined(X):
    sync = DenseSynchronizer(P).fit(X)
    assert not sync.refines_
    assert sync.unexplained_variance_ > SAME_SOURCE


def test_made_gait_is_not_refined():
    assert_not_refined(make_gait(random_state=0).data)


@pytest.mark.parametrize("file", ["Besier2009-vastus", "Pataky2014-mediolateral"])
def test_forces_of_people_are_not_refined(file, real_data):
    curves = np.loadtxt(real_data / "nlreg1d" / f"{file}.csv", delimiter=",")[:, 1:]
    assert_not_refined(list(curves[:, :, np.newaxis]))


@pytest.mark.parametrize("action", ["depositFloorR", "grabHighR"])
def test_people_are_not_refined(action, hdm05):
    """All actors and each by himself, all features and the first few: refining misleads there.

    A single curve of one actor may be as alike as copies are.
    """
    chosen = np.flatnonzero(hdm05.target == action)
    poses = DirectionCosines(hdm05.skeleton).fit_transform([hdm05.data[i] for i in chosen])
    for actor, counts in ((None, (None, 2, 1)), ("bd", (None, 2)), ("tr", (None, 2))):
        mine = [x for x, i in zip(poses, chosen, strict=True) if actor in (None, hdm05.actor[i])]
        points = ASpace().fit_transform(mine)
        for n_features in counts:
            assert_not_refined([x[:, :n_features] for x in points])
