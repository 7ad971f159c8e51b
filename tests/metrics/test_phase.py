"""The decomposition of Kneip and Ramsay against closed forms."""

import numpy as np
import pytest
from sklearn_motionsync.metrics import amplitude_phase_variance

T = np.linspace(0, 1, 2001)


def integral(f):
    return float(np.sum((f[1:] + f[:-1]) / 2) / (len(f) - 1))


def warped(a):
    """Curves s(h(t)) of one shape, h = t +- a sin(2 pi t) / 2 pi, whose mean is an even pace."""
    h = [T + sign * a * np.sin(2 * np.pi * T) / (2 * np.pi) for sign in (-1, 1)]
    return np.stack(h), np.stack([np.sin(np.pi * k) for k in h])[:, :, np.newaxis]


def test_differences_of_timing_alone_are_phase_and_of_shape_alone_amplitude():
    _, x = warped(0.5)
    same = np.tile(np.sin(np.pi * T)[:, np.newaxis], (2, 1, 1))
    found = amplitude_phase_variance(x, same)
    assert found.amplitude == 0
    assert found.phase_share == 1
    heights = np.array([0.8, 1.0, 1.2])[:, np.newaxis, np.newaxis] * same[0]
    found = amplitude_phase_variance(heights, heights)
    np.testing.assert_allclose(found.phase, 0, atol=1e-15)
    # The variance of the heights, times int sin^2 = 1 / 2.
    np.testing.assert_allclose(found.amplitude, np.var([0.8, 1, 1.2]) / 2)
    assert found.constant == 1


def test_scaled_and_shifted_waves_have_their_closed_form():
    """Heights c_i of a bump that a linear clock shifts: cos(2 pi (t - s_i)), whole periods."""
    c, s = np.array([1.0, 1.5, 2.0, 0.5]), np.array([0.02, -0.05, 0.1, -0.07])
    x = (c * np.cos(2 * np.pi * (T[:, np.newaxis] - s))).T[:, :, np.newaxis]
    y = (c * np.cos(2 * np.pi * T[:, np.newaxis])).T[:, :, np.newaxis]
    found = amplitude_phase_variance(x, y)
    mean = np.abs(np.mean(c * np.exp(2j * np.pi * s)))
    np.testing.assert_allclose(found.constant, 1)
    np.testing.assert_allclose(found.amplitude, c.var() / 2)
    np.testing.assert_allclose(found.phase, (c.mean() ** 2 - mean**2) / 2)
    np.testing.assert_allclose(found.total, (np.mean(c**2) - mean**2) / 2)


def test_constant_equals_the_formula_of_the_paper():
    """1 + sum cov(h', y^2) / sum int y^2, where the mean of the warps is an even pace."""
    inverse, _ = warped(0.6)
    heights = np.array([1.0, 2.0])
    # y_i(t) = x_i(h_i(t)), so that h_i is the inverse of what warps the shape.
    y = heights[:, np.newaxis] * (1 + np.sin(np.pi * T)) * np.linspace(1, 2, len(T))
    h = inverse
    x = np.stack([np.interp(T, a, b) for a, b in zip(h, y, strict=True)])
    rates = np.gradient(h, T, axis=1, edge_order=2)
    np.testing.assert_allclose(rates.mean(axis=0), 1)
    covariance = sum(
        integral((rate - 1) * (of_one - (y**2).mean(axis=0)))
        for rate, of_one in zip(rates, y**2, strict=True)
    )
    expected = 1 + covariance / sum(integral(of_one) for of_one in y**2)
    assert abs(expected - 1) > 0.01
    found = amplitude_phase_variance(x[:, :, np.newaxis], y[:, :, np.newaxis])
    np.testing.assert_allclose(found.constant, expected, rtol=1e-5)


def test_decomposition_of_identical_trials():
    same = np.ones((3, 9, 2))
    for x in (same, 0 * same):
        found = amplitude_phase_variance(x, x)
        assert (*found[:3], found.constant) == (0, 0, 0, 1)
        assert np.isnan(found.phase_share)
    for pair in ((same, 0 * same), (0 * same, same)):
        with pytest.raises(ValueError, match="zero everywhere, and the other is not"):
            amplitude_phase_variance(*pair)
