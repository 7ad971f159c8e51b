"""Every cost against its oracle: features and step weights; filters, and noise that is known."""

import math
from pathlib import Path

import numpy as np
import pytest
from sklearn import config_context
from sklearn_motionsync import DenseSynchronizer
from sklearn_motionsync.matching.costs import COSTS, step_table
from sklearn_motionsync.matching.filters import noise_width, smooth, white_noise
from sklearn_motionsync.matching.matcher import cost_features

from oracle import FEATURES, STEP_WEIGHTS, slow_filter

METHOD = Path(__file__).parents[2] / "docs" / "method.md"


@pytest.mark.parametrize("cost", COSTS)
def test_cost_has_oracles_and_documentation(cost):
    """A new entry of COSTS fails here until all of these exist."""
    method = METHOD.read_text(encoding="utf-8")
    exists = {
        f"STEP_WEIGHTS[{cost!r}] in tests/oracle.py": cost in STEP_WEIGHTS,
        f"FEATURES[{cost!r}] in tests/oracle.py": cost in FEATURES,
        "a row in the table of costs in docs/method.md": f'| `"{cost}"`' in method,
        f'a section in docs/method.md that names cost="{cost}"': f'cost="{cost}"' in method,
        "a description in DenseSynchronizer": f'``"{cost}"``' in DenseSynchronizer.__doc__,
    }
    missing = [name for name, there in exists.items() if not there]
    assert not missing, f"COSTS[{cost!r}] still needs {'; '.join(missing)}"


@pytest.mark.parametrize("cost", COSTS)
@pytest.mark.parametrize("subframes", [1, 3])
def test_step_table_equals_oracle(cost, subframes):
    steps, *found, sub = step_table(cost, max_rate=4, subframes=subframes)
    assert sub == subframes
    assert sorted(steps) == list(range(4 * subframes + 1))
    # Those that change the pace least come first, the slower of two before the faster.
    assert list(steps) == sorted(steps, key=lambda s: (abs(s - subframes), s))
    expected = [STEP_WEIGHTS[cost](s / subframes) for s in steps]
    np.testing.assert_allclose(np.transpose(found), expected)
    # The local cost is a square.
    np.testing.assert_allclose(found[1], 2 * np.sqrt(found[0]))


@pytest.mark.parametrize("cost", COSTS)
@pytest.mark.parametrize(("pace", "smoothing"), [(1, 0.03), (3, 0.1)])
def test_features_equal_oracle(cost, pace, smoothing):
    X = np.cumsum(np.random.default_rng(0).standard_normal((2, 61, 2)), axis=1)
    expected = [FEATURES[cost](x, pace, smoothing * 60) for x in X]
    np.testing.assert_allclose(cost_features(X, cost, smoothing, pace=pace), expected, atol=1e-9)
    velocity = pace * smooth(X, smoothing * 60, 1)
    found = cost_features(X, cost, velocity=velocity)
    np.testing.assert_allclose(found, expected, atol=1e-9)


@pytest.mark.parametrize("cost", ["velocity", "elastic"])
def test_velocities_of_rest_are_zero(cost):
    """The direction of a rest must not become NaN."""
    assert not cost_features(np.ones((2, 30, 3)), cost).any()


@pytest.mark.parametrize(
    ("max_rate", "subframes"), [(1, 1), (1.9, 1), (1.4, 2), (1.5, 2), (2.9, 3), (3.5, 4)]
)
def test_steps_are_those_up_to_the_largest_rate(max_rate, subframes):
    table = step_table(max_rate=max_rate, subframes=subframes)
    assert sorted(table.steps) == [s for s in range(99) if s <= max_rate * subframes]


@pytest.mark.parametrize("order", [0, 1, 2])
@pytest.mark.parametrize("sigma", [0, 0.3, 2.4, 9.9, 10.1, 14.5, 40])
@pytest.mark.parametrize("n_frames", [2, 3, 25, 90])
def test_filters_equal_explicit_sums(n_frames, sigma, order):
    """Narrow or wide, of sequences longer or shorter than the filter reaches."""
    x = 5 + np.random.default_rng(0).standard_normal((2, n_frames, 2))
    expected = [slow_filter(sequence, sigma, order) for sequence in x]
    found = smooth(x, sigma, order)
    np.testing.assert_allclose(found, expected, atol=1e-11)
    with config_context(working_memory=1e-4):
        np.testing.assert_array_equal(smooth(x, sigma, order), found)


# -- white noise, and the width that smooths it ----------------------------------------


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
