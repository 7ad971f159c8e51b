"""Properties of all synchronizers, on trials that hypothesis draws.

Invariances of warps; bounds are in frames, for rounding in double precision.
"""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from sklearn.base import clone
from sklearn_motionsync import DenseSynchronizer, LinearSynchronizer

# Waves of random sizes: one may be much larger than all others, with a warning.
pytestmark = pytest.mark.filterwarnings("ignore:Feature .* of the energy:UserWarning")

PAPER = {"cost": "pose", "max_rate": 2, "consensus": 0}
SYNCHRONIZERS = [
    LinearSynchronizer(),
    DenseSynchronizer(),
    DenseSynchronizer(refine=True),
    DenseSynchronizer(**PAPER),
]
every_synchronizer = pytest.mark.parametrize("estimator", SYNCHRONIZERS, ids=str)
# The same examples everywhere.
few = settings(max_examples=6, deadline=None, derandomize=True, database=None)
ROUNDING = 1e-6


@st.composite
def trials(draw):
    """A few smooth movements of one kind, each at its own pace, with noise or without."""
    rng = np.random.default_rng(draw(st.integers(0, 2**32 - 1)))
    n, n_features = draw(st.integers(3, 6)), draw(st.integers(2, 4))
    noise = draw(st.sampled_from([0.0, 0.01, 0.1]))
    size, shift = rng.standard_normal((2, n_features, 3))
    X = []
    for _ in range(n):
        t = np.linspace(0, 1, draw(st.integers(15, 40)))
        phase = t + rng.uniform(-0.1, 0.1) * np.sin(2 * np.pi * t)
        waves = np.sin(np.pi * np.arange(1, 4) * phase[:, np.newaxis, np.newaxis] + shift)
        x = (size * waves).sum(axis=2)
        X.append(x + noise * rng.standard_normal(x.shape))
    return X


def times(estimator, X, **params):
    return clone(estimator).set_params(n_frames=30, **params).fit(X).match(X).times


def assert_close(a, b, bound=ROUNDING):
    assert np.abs(a - b).max() <= bound


@every_synchronizer
@few
@given(trials(), st.floats(-1e3, 1e3))
def test_warps_do_not_depend_on_the_origin(estimator, X, shift):
    offset = shift * np.arange(1, 1 + X[0].shape[1])
    assert_close(
        times(estimator, [x + offset for x in X], pattern=0), times(estimator, X, pattern=0)
    )


@every_synchronizer
@few
@given(trials(), st.floats(-5, 5), st.integers(-16, 16))
def test_warps_do_not_depend_on_the_unit(estimator, X, exponent, binary):
    """To the last bit if the units differ by a power of two."""
    expected = times(estimator, X)
    assert_close(times(estimator, [np.ldexp(x, binary) for x in X]), expected, 0)
    assert_close(times(estimator, [10.0**exponent * x for x in X]), expected)


@pytest.mark.parametrize("seed", range(3))
def test_the_last_bits_of_a_metric_do_not_show_in_sharpened_warps(seed):
    rng = np.random.default_rng(seed)
    X = [np.cumsum(rng.standard_normal((n, 2)), axis=0) for n in (15, 22, 28, 33, 39)]
    expected = times(DenseSynchronizer(), X)
    assert_close(times(DenseSynchronizer(), [32 * x for x in X]), expected, 0)


@every_synchronizer
@few
@given(trials(), st.floats(-5, 5))
def test_warps_hardly_depend_on_the_unit_in_single_precision(estimator, X, exponent):
    X = [x.astype(np.float32) for x in X]
    factor = np.float32(10.0**exponent)
    scaled = [(x.astype(np.float64) * factor).astype(np.float32) for x in X]
    # A warp may change where float32 cannot tell two paths apart.
    moved = np.abs(times(estimator, scaled, pattern=0) - times(estimator, X, pattern=0))
    assert np.median(moved) <= 1e-3


@every_synchronizer
@few
@given(trials(), st.randoms(use_true_random=False))
def test_warps_do_not_depend_on_the_order_of_features(estimator, X, random):
    order = random.sample(range(X[0].shape[1]), X[0].shape[1])
    assert_close(times(estimator, [x[:, order] for x in X]), times(estimator, X))


@every_synchronizer
@few
@given(trials(), st.floats(-1e6, 1e6), st.integers(1, 30))
def test_constant_features_change_no_warp(estimator, X, value, count):
    still = [np.hstack([x, np.full((len(x), count), value)]) for x in X]
    assert_close(times(estimator, still), times(estimator, X))


@every_synchronizer
@few
@given(trials(), st.integers(0, 1), st.integers(1, 3))
def test_copies_of_features_change_no_warp(estimator, X, which, copies):
    if isinstance(estimator, LinearSynchronizer):
        copies, which = 1, slice(None)
    twice = [np.hstack([x, *[x[:, which].reshape(len(x), -1)] * copies]) for x in X]
    assert_close(times(estimator, twice), times(estimator, X))


@every_synchronizer
@few
@given(trials(), st.integers(2, 4))
def test_warps_do_not_depend_on_the_frame_rate(estimator, X, factor):
    def resampled(x):
        fine = np.linspace(0, len(x) - 1, factor * (len(x) - 1) + 1)
        return np.column_stack([np.interp(fine, np.arange(len(x)), column) for column in x.T])

    assert_close(times(estimator, [resampled(x) for x in X]), times(estimator, X))
