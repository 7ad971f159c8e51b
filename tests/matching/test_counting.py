"""Counted and chosen with a tolerance: whole numbers, and the first of equal values."""

import numpy as np
import pytest
from sklearn_motionsync.matching.counting import first_largest, first_smallest, whole

# Rounding of sums of some hundred frames, and of frame rates with nine digits.
ROUNDINGS = [0.0, 1e-13, -1e-13, 3e-9, -3e-9]


@pytest.mark.parametrize("rounding", ROUNDINGS)
@pytest.mark.parametrize(
    ("way", "expected"),
    [
        ("nearest", [-2, -1, 0, 0, 1, 1, 1, 2, 3, 104, 105, 105]),
        ("down", [-3, -2, -1, 0, 0, 0, 1, 1, 2, 104, 104, 104]),
        ("up", [-2, -1, 0, 0, 1, 1, 1, 2, 3, 104, 105, 105]),
    ],
)
def test_whole_numbers_do_not_depend_on_rounding(way, expected, rounding):
    values = np.array([-2.5, -1.5, -0.5, 0, 0.5, 0.9, 1, 1.5, 2.5, 104, 104.5, 104.501])
    found = whole(values + rounding * np.maximum(np.abs(values), 1), way)
    assert found.dtype == np.intp
    assert found.tolist() == expected
    assert [whole(value, way) for value in values] == expected
    assert type(whole(values[0], way)) is int


def test_what_is_no_rounding_counts():
    assert [whole(104.5 - 1e-4), whole(7 - 1e-4, "down"), whole(7 + 1e-4, "up")] == [104, 6, 8]
    assert whole(1e9 + 0.75) == 1_000_000_001


@pytest.mark.parametrize("seed", range(4))
def test_of_values_that_rounding_tells_apart_the_first_is_chosen(seed):
    values = np.array([[3.0, 1.0, 1.0, 3.0], [-2.0, 5.0, -2.0, 5.0]])
    noisy = values * (1 + 1e-13 * np.random.default_rng(seed).uniform(-1, 1, values.shape))
    assert first_smallest(noisy, axis=1).tolist() == [1, 0]
    assert first_largest(noisy, axis=1).tolist() == [0, 1]
    assert (first_smallest(noisy), first_largest(noisy)) == (4, 5)
    assert type(first_smallest(noisy)) is int


def test_values_that_differ_are_told_apart_up_to_the_rounding_given():
    values = [np.nan, 1 + 1e-6, 1.0, 1 - 1e-6]
    assert (first_smallest(values), first_largest(values)) == (3, 1)
    assert (first_smallest(values, 1.5e-6), first_smallest(values, 1e-5)) == (2, 1)
    assert first_largest([-np.inf, 2.0, 3.0]) == 2
