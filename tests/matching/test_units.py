"""The unit: numbers about 1 in any unit, constant features, and copies."""

import numpy as np
import pytest
from sklearn_motionsync.matching import units
from sklearn_motionsync.matching.units import Unit


@pytest.fixture
def sequences():
    return np.random.default_rng(0).standard_normal((4, 30, 5)) + np.arange(5)


@pytest.mark.parametrize("exponent", [0, 1, 7, -20, 20])
def test_unit_centres_and_scales_to_about_one_without_rounding(sequences, exponent):
    X = np.ldexp(sequences, exponent)
    unit = Unit.of(X)
    scaled = unit(X)
    assert 1 / 4 <= np.abs(scaled).max() < 1
    # Two units that differ by a power of four give the very same numbers.
    np.testing.assert_array_equal(Unit.of(4 * X)(4 * X), scaled)
    np.testing.assert_allclose(unit.size * scaled, X - X.mean(axis=(0, 1)), atol=1e-12 * unit.size)
    assert unit(X, out=X) is X
    np.testing.assert_array_equal(X, scaled)


@pytest.mark.parametrize("value", [0.0, 0.1, -1e6])
def test_constant_features_become_zero(sequences, value):
    sequences[:, :, 2] = value * (1 + 1e-16 * np.arange(30))
    unit = Unit.of(sequences)
    assert (unit(sequences)[:, :, 2] == 0).all()
    np.testing.assert_array_equal(np.flatnonzero(unit.rounding), [2] if value else [])
    # A new trial in which the feature varies.
    sequences[0, 3, 2] = value + 1
    assert unit(sequences)[0, 3, 2] == pytest.approx(1 / unit.size, rel=1e-3)
    assert unit.size == Unit.of(sequences[:, :, [0, 1, 3, 4]]).size


def test_copies_count_once(sequences):
    X = sequences[:, :, [0, 1, 0, 2, 1, 0]]
    unit = Unit.of(X)
    assert sorted(group.tolist() for group in unit.copies) == [[0, 2, 5], [1, 4]]
    np.testing.assert_array_equal(unit.originals, [0, 1, 0, 3, 1, 0])
    expected = Unit.of(sequences[:, :, :3])(sequences[:, :, :3])
    np.testing.assert_allclose(unit(X)[:, :, [0, 1, 3]], expected, atol=1e-14)
    assert (unit(X)[:, :, [2, 4, 5]] == 0).all()
    # Where they differ in a new trial, their mean counts.
    X[0, 0, 2] += 3
    assert unit(X)[0, 0, 0] - expected[0, 0, 0] == pytest.approx(1 / unit.size)


def test_batches_give_the_same_unit(sequences, monkeypatch):
    sequences[:, :, 1] = 0.1
    X = sequences[:, :, [0, 1, 0, 2, 3]]
    X[3, 7, 4] = 40
    whole = Unit.of(X)
    monkeypatch.setattr(units, "BATCH_NUMBERS", 200)
    unit = Unit.of(X)
    assert unit.size == whole.size
    np.testing.assert_allclose(unit.centre, whole.centre, rtol=1e-13)
    np.testing.assert_array_equal(unit.rounding, whole.rounding)
    assert [group.tolist() for group in unit.copies] == [[0, 2]]


def test_features_of_equal_energy_are_no_copies(sequences):
    """Not the same backwards, the opposite, with a little noise, nor correlated."""
    x = sequences[:, :, :1]
    rng = np.random.default_rng(1)
    others = [x[:, ::-1], -x, x + 1e-3 * rng.standard_normal(x.shape), 2 * x]
    assert Unit.of(np.concatenate([x, *others], axis=2)).copies == []
    u, v = np.linalg.qr((sequences - sequences.mean(axis=(0, 1))).reshape(-1, 5))[0][:, :2].T
    pair = np.stack([2 * u + v, 2 * u - v], axis=1).reshape(4, 30, 2)
    assert Unit.of(pair).copies == []
