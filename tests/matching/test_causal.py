"""Causal velocities: closed forms, no look-ahead, and gaps."""

import numpy as np
import pytest
from sklearn_motionsync.matching.causal import CausalDerivative, causal_velocity


def run(samples, width):
    derivative = CausalDerivative(width, samples[0].shape)
    return np.array([derivative.step(x) for x in samples])


def test_is_two_exponential_filters_of_differences():
    rng = np.random.default_rng(0)
    x, width = rng.standard_normal(40), 3.0
    differences = np.diff(x, prepend=x[0])
    kernel = np.exp(-np.arange(40) / width) * (1 - np.exp(-1 / width))
    once = np.convolve(differences, kernel)[:40]
    found = run(x[:, None, None], width)[:, 0, 0]
    np.testing.assert_allclose(found, np.convolve(once, kernel)[:40], atol=1e-12)


@pytest.mark.parametrize("subframes", [1, 3])
def test_positions_of_a_sequence_are_filtered_as_its_frames_are(subframes):
    rng = np.random.default_rng(1)
    x = rng.standard_normal((20 * subframes + 1, 2))
    found = causal_velocity(x, subframes, 2.0)
    for k in range(subframes):
        lane = x[k::subframes]
        # A stream that comes from rest at the first position.
        before = np.concatenate([x[:1], lane])
        expected = run(before[:, None], 2.0)[1:, 0]
        np.testing.assert_allclose(found[k::subframes], expected, atol=1e-12)
    np.testing.assert_array_equal(
        causal_velocity(x[: 8 * subframes + 1], subframes, 2.0), found[: 8 * subframes + 1]
    )


def test_an_even_movement_has_its_velocity_across_short_gaps_and_after_long_ones():
    x = 0.5 * np.arange(100.0)[:, None, None] * np.ones((1, 1, 2))
    x[60:64, 0, 0] = np.nan  # short
    x[70:90, 0, 0] = np.nan  # long
    found = run(x, 2.0)[:, 0]
    np.testing.assert_allclose(found[50:, 1], 0.5, atol=1e-6)
    assert np.isnan(found[60:64, 0]).all()
    np.testing.assert_allclose(found[64:70, 0], 0.5, atol=1e-6)
    # The first sample after a long gap has no velocity yet.
    assert np.isnan(found[70:91, 0]).all()
    np.testing.assert_allclose(found[91:, 0], 0.5, atol=1e-12)


def test_what_was_lost_is_not_what_is_found_again():
    x = np.concatenate([np.arange(30.0), np.full(30, np.nan), 100 - np.arange(30.0)])
    found = run(x[:, None, None], 3.0).ravel()
    np.testing.assert_allclose(found[61:], -1, atol=1e-12)


def test_streams_begin_anew_alone():
    x = np.random.default_rng(2).standard_normal((20, 2, 3))
    derivative = CausalDerivative(2.0, (2, 3))
    for sample in x[:10]:
        derivative.step(sample)
    derivative.restart(1)
    found = np.array([derivative.step(sample) for sample in x[10:]])
    np.testing.assert_array_equal(found[:, 1], run(x[10:, 1:], 2.0)[:, 0])
    np.testing.assert_array_equal(found[:, 0], run(x[:, :1], 2.0)[10:, 0])
