"""What a step costs, which steps there are, and the filters under which features are taken."""

import numpy as np
import pytest
from sklearn import config_context
from sklearn_motionsync import DenseSynchronizer
from sklearn_motionsync.matching.costs import cost_features, step_table
from sklearn_motionsync.matching.filters import smooth

from oracle import slow_filter

PATHS = {"cost": "posture", "smoothness": 0, "consensus": 0, "max_offset": 1}


@pytest.mark.parametrize(
    ("max_rate", "subframes", "fastest"),
    [(1, 1, 1), (1.9, 1, 1), (2, 1, 2), (1.4, 2, 1), (1.5, 2, 1.5), (2.9, 3, 8 / 3), (3.5, 4, 3.5)],
)
def test_no_step_is_faster_than_the_largest_rate(max_rate, subframes, fastest):
    """A movement that is late runs as fast as it may, and no faster."""
    x = np.zeros((2, 41, 1))
    x[0, 8:], x[1, 28:] = 1, 1
    x[:, 33:] = np.arange(2, 10)[:, np.newaxis]
    sync = DenseSynchronizer(pattern=0, max_rate=max_rate, subframes=subframes, **PATHS).fit(x)
    assert np.diff(sync.match(x[1:]).times).max() == pytest.approx(fastest)
    table = step_table(max_rate=max_rate, subframes=subframes)
    assert sorted(table.steps) == [s for s in range(99) if s <= max_rate * subframes]


@pytest.mark.parametrize("subframes", [1, 3])
def test_weights_of_steps(subframes):
    """docs/method.md: b, g and phi at the rate rho."""
    weights = {
        "posture": lambda rho: (1, 2, abs(rho - 1)),
        "velocity": lambda rho: ((0.8 + 0.2 * rho) ** 2, 1.6 + 0.4 * rho, (rho - 1) ** 2),
        "elastic": lambda rho: (rho, 2 * rho**0.5, (rho - 1) ** 2),
    }
    for cost, expected in weights.items():
        steps, *found, sub = step_table(cost, max_rate=4, subframes=subframes)
        assert sub == subframes
        assert sorted(steps) == list(range(4 * subframes + 1))
        # Those that change the pace least come first, the slower of two before the faster.
        assert list(steps) == sorted(steps, key=lambda s: (abs(s - subframes), s))
        np.testing.assert_allclose(np.transpose(found), [expected(s / subframes) for s in steps])
    assert list(step_table().steps) == [1, 0, 2]
    with pytest.raises(ValueError, match=r"cost='dtw' is unknown; use one of .*'posture'"):
        step_table("dtw")


@pytest.mark.parametrize("order", [0, 1, 2])
@pytest.mark.parametrize("sigma", [0, 0.3, 2.4, 9.9, 10.1, 14.5, 40])
@pytest.mark.parametrize("n_frames", [2, 3, 25, 90])
def test_filters_are_explicit_sums(n_frames, sigma, order):
    """Narrow or wide, of sequences longer or shorter than the filter reaches."""
    x = 5 + np.random.default_rng(0).standard_normal((2, n_frames, 2))
    expected = [slow_filter(sequence, sigma, order) for sequence in x]
    found = smooth(x, sigma, order)
    np.testing.assert_allclose(found, expected, atol=1e-11)
    with config_context(working_memory=1e-4):
        np.testing.assert_array_equal(smooth(x, sigma, order), found)


@pytest.mark.parametrize("smoothing", [0.01, 0.1, 0.3, 0.9])
def test_an_offset_of_a_performance_is_no_velocity(smoothing):
    """Nor with filters wider than the clip."""
    x = np.cumsum(np.random.default_rng(0).standard_normal((1, 60, 2)), axis=1)
    for cost in ("velocity", "elastic"):
        lower, upper = (cost_features(z, cost, smoothing=smoothing) for z in (x, x + [30, -8]))
        np.testing.assert_allclose(upper, lower, atol=1e-10)


@pytest.mark.parametrize("cost", ["velocity", "elastic"])
def test_rest_is_no_movement(cost):
    """Its direction is not known, and must not become NaN."""
    assert not cost_features(np.ones((2, 30, 3)), cost).any()


@pytest.mark.parametrize("subframes", [1, 4])
def test_velocities_are_by_the_frame(subframes):
    p = np.arange(0, 20 + 1e-9, 1 / subframes)[np.newaxis, :, np.newaxis]
    slope = np.array([3.0, -4.0])
    found = cost_features(p * slope, "velocity", subframes, smoothing=0.1)
    np.testing.assert_allclose(found[0], np.tile(slope, (p.size, 1)), rtol=1e-3)
    # As long as the root of the speed, so that its squared length is the way.
    found = cost_features(p * slope, "elastic", subframes, smoothing=0.1)
    np.testing.assert_allclose(found[0], np.tile(slope / 5**0.5, (p.size, 1)), rtol=1e-3)
