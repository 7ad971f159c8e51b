"""Faults: what is expected, gains against dense matrices, and faults that were put in."""

import numpy as np
import pytest
from sklearn_motionsync.model.faults import (
    Expectation,
    FaultFinder,
    Part,
    expected_trial,
    windows_of,
)
from sklearn_motionsync.model.variation import predictive_variance, within_variance

K = 30
PARTS = [Part("one", [0, 1], [0, 1], None), Part("two", [2], [2], None)]


def people(n_people, n_own, seed=0):
    """Smooth trials with three columns about a common mean, and whose they are."""
    rng = np.random.default_rng(seed)
    t = np.linspace(0, 1, K)[:, np.newaxis]
    mean = np.column_stack([np.sin(6 * t), np.cos(6 * t), 2 * np.sin(3 * t)])
    waves = np.stack([np.ones_like(t), np.sin(9 * t), np.cos(7 * t)])[..., 0]
    groups = np.repeat(np.arange(n_people), n_own)
    persons, moods = (
        np.einsum("nkf,kp->npf", rng.standard_normal((n, 3, 3)), waves)
        for n in (n_people, len(groups))
    )
    return mean + 0.1 * persons[groups] + 0.03 * moods, groups


def test_the_expected_mean_lies_between_others_and_the_reference():
    X, groups = people(6, 4)
    mean, variance = expected_trial(X, groups)
    np.testing.assert_array_equal(mean, X.mean(axis=0))
    np.testing.assert_array_equal(variance, predictive_variance(X, groups))
    within = within_variance(X, groups)
    between = variance - within
    for n in (1, 3):
        own = np.repeat(X[:1] + 0.2, n, axis=0)
        share = between / (between + within / n)
        expected, spread = expected_trial(X, groups, own)
        np.testing.assert_allclose(expected, mean + share * (own[0] - mean))
        np.testing.assert_allclose(spread, within * (1 + share / n))


def test_a_reference_that_disagrees_counts_less():
    X, groups = people(6, 4)
    own = X[:2] + 0.2
    apart = own + np.array([0.3, -0.3])[:, np.newaxis, np.newaxis]
    near, far = (expected_trial(X, groups, r) for r in (own, apart))
    mean = X.mean(axis=0)
    assert (np.abs(far[0] - mean) < np.abs(near[0] - mean)).mean() > 0.95
    assert (far[1] > near[1]).all()


@pytest.fixture(scope="module")
def expectation():
    rng = np.random.default_rng(0)
    over_time, between = (
        np.linalg.inv(x @ x.T / (2 * len(x)) + np.eye(len(x)))
        for x in (rng.standard_normal((n, 2 * n)) for n in (K, 3))
    )
    mean, variance = people(2, 1)[0][0], rng.uniform(0.5, 2, (K, 3))
    windows, lags = windows_of(K)[0], np.array([-3, 2])
    made = Expectation(mean, variance, over_time, between, PARTS, windows[:40], lags)
    return made, np.kron(over_time, between), 1 / np.sqrt(variance)


def test_gains_equal_those_of_the_whole_precision_matrix(expectation):
    made, precision, scale = expectation
    windows, _ = windows_of(K)
    deviations = np.random.default_rng(1).standard_normal((K, 3))
    z, weighed = (deviations * scale).ravel(), made.weigh(deviations)
    gains, changes = made.of_windows(weighed)
    for w, k in ((0, 0), (7, 1), (39, 0)):
        design = np.zeros((K, 3, len(PARTS[k].columns)))
        for j, column in enumerate(PARTS[k].columns):
            design[:, column, j] = windows[w] * scale[:, column]
        design = design.reshape(3 * K, -1)
        b = design.T @ precision @ z
        change = np.linalg.solve(design.T @ precision @ design, b)
        np.testing.assert_allclose(gains[w, k], b @ change, rtol=1e-6)
        np.testing.assert_allclose(changes[w, PARTS[k].columns], change, rtol=1e-6)
    frames = np.arange(K)
    gain, lag = made.of_lags(weighed)
    for k, part in enumerate(PARTS):
        found = [0.0]
        for d in (-3, 2):
            effect = np.zeros((K, 3))
            late = made.mean[np.clip(frames - d, 0, K - 1)] - made.mean
            effect[:, part.columns] = (late * scale)[:, part.columns]
            effect = effect.ravel()
            found.append(2 * effect @ precision @ z - effect @ precision @ effect)
        np.testing.assert_allclose(gain[k], max(found))
        assert lag[k] == [0, -3, 2][int(np.argmax(found))]


@pytest.fixture(scope="module")
def finder():
    return FaultFinder(*people(8, 4), PARTS)


def late(x):
    x = x.copy()
    x[:, 2] = x[np.clip(np.arange(K) - 4, 0, None), 2]
    return x


def large(x):
    x = x.copy()
    x[:, 2] += 0.8 * (x[:, 2] - x[:, 2].mean())
    return x


def off(x):
    x = x.copy()
    x[10:20, :2] += 0.6, -0.4
    return x


@pytest.mark.parametrize(
    ("spoil", "part", "kind"), [(late, 1, "late"), (large, 1, "too large"), (off, 0, "off")]
)
def test_faults_that_were_put_in_come_first(finder, spoil, part, kind):
    faults = [finder.find(spoil(x))[0] for x in people(9, 1, seed=9)[0]]
    for fault in faults:
        assert (fault.part, fault.kind) == (part, kind)
        assert fault.score > finder.rare_score
        if kind == "late":
            assert 2 <= fault.size <= 6
        elif kind == "too large":
            assert 1.5 < fault.size < 2.2
    if kind == "off":
        sizes, starts, stops = (
            np.median([np.ravel(getattr(fault, name)) for fault in faults], axis=0)
            for name in ("size", "start", "stop")
        )
        np.testing.assert_allclose(sizes, [0.6, -0.4], atol=0.15)
        np.testing.assert_allclose([*starts, *stops], [10 / K, 20 / K], atol=0.1)


def test_few_new_people_are_rare(finder):
    scores = [max(f.score for f in finder.find(x)) for x in people(100, 1, seed=5)[0]]
    assert np.mean(np.array(scores) > finder.rare_score) < 0.1
    assert 0.2 < np.mean(np.array(scores) > finder.usual_score) < 0.9
