"""White noise and the smoothing that suits it, on noise that is known."""

import math

import numpy as np
import pytest
from scipy.ndimage import gaussian_filter1d
from sklearn_motionsync.matching.filters import noise_width, white_noise

P = 101
FRAMES = np.arange(P)


def curves(n, noise=0.0, n_features=1, seed=0):
    """Trials of a sine of unit size at slightly different paces, with white noise."""
    rng = np.random.default_rng(seed)
    phases = np.linspace(-0.5, 0.5, n)[:, np.newaxis, np.newaxis] + np.arange(n_features)
    clean = np.sin(3 * np.pi * FRAMES[:, np.newaxis] / (P - 1) + phases)
    return clean + noise * rng.standard_normal(clean.shape)


# -- its variance ---------------------------------------------------------------------------


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


@pytest.mark.parametrize("dtype", [np.float64, np.float32])
def test_white_noise_is_told_from_the_movement(dtype):
    """Within the error of 40 trials of 101 frames, at sizes from a thousandth to half."""
    sizes = np.array([0.001, 0.02, 0.5])
    noise = sizes * np.random.default_rng(1).standard_normal((40, P, 3))
    found = white_noise(list((curves(40, n_features=3) + noise).astype(dtype)))
    np.testing.assert_allclose(found, sizes**2, rtol=0.1)
    assert (white_noise(curves(40, n_features=3)) < 1e-9).all()


# -- the width that smooths it --------------------------------------------------------------


@pytest.mark.parametrize("noise", [0.02, 0.05, 0.1])
def test_under_its_width_noise_has_one_per_cent_of_the_energy(noise):
    """By noise that is drawn and filtered; widths from one frame to three."""
    X = curves(40, noise)
    width = noise_width(X)
    assert 1 < width < 3.5
    drawn = noise * np.random.default_rng(1).standard_normal((400, 3 * P))
    inner = slice(20, -20)
    of_noise = gaussian_filter1d(drawn, width, order=1, axis=1)[:, inner]
    of_curves = gaussian_filter1d(curves(40)[:, :, 0], 2, order=1, axis=1)[:, inner]
    share = np.square(of_noise).mean() / np.square(of_curves).mean()
    # A sine has less energy without its ends.
    assert share == pytest.approx(0.01, rel=0.25)


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
