"""White noise and the smoothing that suits it, on noise that is known."""

import math

import numpy as np
import pytest
from sklearn_motionsync.matching.filters import noise_width, white_noise

P = 101
FRAMES = np.arange(P)


def curves(n, noise=0.0, n_features=1, seed=0):
    """Trials of a sine of unit size at slightly different paces, with white noise."""
    rng = np.random.default_rng(seed)
    phases = np.linspace(-0.5, 0.5, n)[:, np.newaxis, np.newaxis] + np.arange(n_features)
    clean = np.sin(3 * np.pi * FRAMES[:, np.newaxis] / (P - 1) + phases)
    return clean + noise * rng.standard_normal(clean.shape)


def test_white_noise_equals_explicit_differences():
    rng = np.random.default_rng(0)
    arrays = [rng.standard_normal((length, 2)) for length in (6, 7, 20, 3)]
    weights = [(-1) ** k * math.comb(6, k) for k in range(7)]
    expected = np.zeros(2)
    for x in arrays[1:3]:
        differences = [sum(w * x[i + k] for k, w in enumerate(weights)) for i in range(len(x) - 6)]
        expected += np.square(differences).mean(axis=0) / 924 / 2
    np.testing.assert_allclose(white_noise(arrays), expected)
    assert np.isnan(white_noise([arrays[0], arrays[3]])).all()


def test_width_equals_its_closed_form():
    noise, rate = 0.05, 3 * np.pi / (P - 1)
    energy = rate**2 / 2
    expected = np.cbrt(noise**2 / energy / (4 * np.sqrt(np.pi)) / 0.01)
    assert noise_width(curves(60, noise)) == pytest.approx(expected, rel=0.05)


def test_noise_averages_out_over_features():
    one = curves(12, 0.05)
    for count in (4, 16):
        many = np.tile(one, (1, 1, count))
        assert noise_width(many) == pytest.approx(noise_width(one) / count ** (1 / 6))
    # What never moves does not count.
    still = np.concatenate([one, np.ones_like(one)], axis=2)
    assert noise_width(still) == pytest.approx(noise_width(one))


def test_width_has_no_unit_and_grows_with_the_noise():
    widths = [noise_width(curves(12, noise)) for noise in (0.0, 0.01, 0.05, 2.0)]
    assert widths[0] == 0
    # Of noise alone, in two features, whose velocities were smoothed by 2 % of the clip.
    widest = 0.02 * (P - 1) * np.cbrt(100 / np.sqrt(2))
    assert 0.9 * widest < widths[-1] < widest
    assert (np.diff(widths) > 0).all()
    assert noise_width(1000 * curves(12, 0.05) + 5) == pytest.approx(widths[2])
    assert noise_width(np.ones((3, P, 2))) == 0


def test_a_sharp_peak_is_no_noise():
    """A frame and a half wide: a Gaussian of 1 % takes much of it away, and it is no noise."""
    middles = np.linspace(40, 60, 12)[:, np.newaxis]
    peaks = np.exp(-0.5 * np.square((FRAMES - middles) / 1.5))[:, :, np.newaxis]
    assert noise_width(peaks) < 0.01 * (P - 1)
