"""Units: numbers about 1, whatever the data; what stands still, and what is there twice."""

import numpy as np
import pytest
from sklearn_motionsync.matching import units
from sklearn_motionsync.matching.units import Unit, exponent_of, squared_distances


@pytest.fixture
def sequences():
    return np.random.default_rng(0).standard_normal((4, 30, 5)) + np.arange(5)


@pytest.mark.parametrize("exponent", [0, 1, 7, -40, 1000, -1000])
def test_numbers_are_about_one_and_lose_no_bit(sequences, exponent):
    X = np.ldexp(sequences, exponent)
    unit = Unit.of(X)
    scaled = unit(X)
    assert 1 / 4 <= np.abs(scaled).max() < 1
    assert unit.exponent % 2 == 0
    # Two units that differ by a power of four give the very same numbers.
    np.testing.assert_array_equal(Unit.of(4 * X)(4 * X), scaled)
    expected = np.ldexp(X - X.mean(axis=(0, 1)), -unit.exponent)
    np.testing.assert_allclose(scaled, expected, atol=1e-14)


def test_back_in_the_unit_of_the_data(sequences):
    unit = Unit.of(1e3 * sequences)
    scaled = unit(1e3 * sequences)
    squares = np.square(1e3 * (sequences - sequences.mean(axis=(0, 1)))).sum()
    np.testing.assert_allclose(unit.back(np.square(scaled).sum()), squares)
    np.testing.assert_allclose(unit.back(np.abs(scaled).max(), 1) ** 2, unit.back(scaled**2).max())
    assert Unit.of(1e200 * sequences).back(1.0) == np.inf
    assert Unit.of(1e-200 * sequences).back(1.0) == 0


@pytest.mark.parametrize("value", [0.0, 0.1, -1e6, 1e12])
def test_what_stands_still_is_exactly_zero(sequences, value):
    sequences[:, :, 2] = value * (1 + 1e-16 * np.arange(30))
    unit = Unit.of(sequences)
    assert (unit(sequences)[:, :, 2] == 0).all()
    np.testing.assert_array_equal(np.flatnonzero(unit.rounding), [2] if value else [])
    # If it moves in another performance, it is no longer rounding.
    sequences[0, 3, 2] = value + 1
    assert unit(sequences)[0, 3, 2] == pytest.approx(2.0**-unit.exponent, rel=1e-3)
    # Constant features, however large, do not set the unit.
    assert unit.exponent == Unit.of(sequences[:, :, [0, 1, 3, 4]]).exponent


def test_copies_count_once(sequences):
    X = sequences[:, :, [0, 1, 0, 2, 1, 0]]
    unit = Unit.of(X)
    assert sorted(group.tolist() for group in unit.copies) == [[0, 2, 5], [1, 4]]
    expected = Unit.of(sequences[:, :, :3])(sequences[:, :, :3])
    np.testing.assert_allclose(unit(X)[:, :, [0, 1, 3]], expected, atol=1e-14)
    assert (unit(X)[:, :, [2, 4, 5]] == 0).all()
    # Where they differ after all, all of them have a say.
    X[0, 0, 2] += 3
    shift = unit(X)[0, 0, 0] - expected[0, 0, 0]
    assert shift == pytest.approx(np.ldexp(1.0, -unit.exponent))


def test_portions_make_no_difference(sequences, monkeypatch):
    """One sequence at a time, the last with something of its own."""
    sequences[:, :, 1] = 0.1
    X = sequences[:, :, [0, 1, 0, 2, 3]]
    X[3, 7, 4] = 40
    whole = Unit.of(X)
    expected = whole(X)
    monkeypatch.setattr(units, "AT_ONCE", 200)
    unit = Unit.of(X)
    assert unit.exponent == whole.exponent
    np.testing.assert_allclose(unit.centre, whole.centre, rtol=1e-13)
    np.testing.assert_array_equal(unit.rounding, whole.rounding)
    assert [group.tolist() for group in unit.copies] == [[0, 2]]
    filled = X.copy()
    assert unit.fill(filled) is filled
    np.testing.assert_allclose(filled, expected, atol=1e-14)
    np.testing.assert_array_equal(filled, unit(X))


def test_much_alike_and_of_equal_energy_is_no_copy(sequences):
    u, v = np.linalg.qr((sequences - sequences.mean(axis=(0, 1))).reshape(-1, 5))[0][:, :2].T
    pair = np.stack([2 * u + v, 2 * u - v], axis=1).reshape(4, 30, 2)
    assert Unit.of(pair).copies == []


def test_equal_energy_is_no_copy(sequences):
    """Nor the same backwards, nor the opposite, nor with a little noise."""
    x = sequences[:, :, :1]
    rng = np.random.default_rng(1)
    others = [x[:, ::-1], -x, x + 1e-3 * rng.standard_normal(x.shape), 2 * x]
    assert Unit.of(np.concatenate([x, *others], axis=2)).copies == []


def test_squared_distances_in_any_unit(sequences):
    base = sequences[0] + 1
    expected = np.square(sequences - base).sum(axis=(1, 2))
    for scale in (1.0, 1e100, 1e-100):
        found = squared_distances(scale * sequences, scale * base)
        np.testing.assert_allclose(found / scale**2, expected)
    assert (squared_distances(1e300 * sequences, 1e300 * base) == np.inf).all()
    assert exponent_of(np.array([-5.0, 3.0])) == 3
    assert exponent_of(np.array([])) == 0


@pytest.mark.parametrize(
    ("dtype", "power", "beyond"),
    [
        *((np.float64, power, 1e30) for power in (-300, -160, -37, 0, 37, 150, 270)),
        *((np.float32, power, 1e30) for power in (-36, -20, 0, 5)),
        *((np.float32, power, 1e3) for power in (-34, 0, 20, 34)),
    ],
)
def test_the_first_array_beyond(sequences, dtype, power, beyond):
    unit = Unit.of((10.0**power * sequences).astype(dtype))
    near = np.full((50, 5), 0.999 * np.ldexp(beyond, unit.exponent), dtype)
    still, far = np.zeros((50, 5), dtype), near.copy()
    far[7, 3] *= -1.01
    assert unit.first_beyond(beyond, [near, still, -near]) is None
    assert unit.first_beyond(beyond, [near, still, far, near, far]) == 2
