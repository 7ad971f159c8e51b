"""DenseSynchronizer and LinearSynchronizer: clock, pattern, warp, known warps."""

import numpy as np
import pytest
from sklearn_motionsync import DenseSynchronizer, LinearSynchronizer

from oracle import slow_filter

BOTH = [LinearSynchronizer, DenseSynchronizer]
# The settings at which DenseSynchronizer is the paper's method.
PAPER = {"cost": "pose", "max_rate": 2, "consensus": 0}


def curve(phase):
    """A closed curve in space that never passes a point twice at the same speed."""
    return np.column_stack([np.cos(3 * phase), np.sin(4 * phase), phase**2])


def warped(n_frames, power):
    return curve(np.linspace(0, 1, n_frames) ** power)


@pytest.fixture(scope="module")
def warps():
    return [warped(n, power) for n, power in ((60, 1.0), (80, 1.2), (50, 0.85), (70, 1.1))]


@pytest.mark.parametrize("estimator", BOTH)
def test_clock_is_given_or_the_median_length(estimator, warps):
    sync = estimator().fit(warps)
    assert sync.n_frames_ == 65
    for n_frames in (None, 30, 2):
        shape = estimator(n_frames=n_frames).fit_transform(warps).shape
        assert shape == (4, n_frames or 65, 3)


def test_linear_median_is_the_smallest_sum_of_distances(warps):
    sync = LinearSynchronizer(40).fit(warps)
    X = sync.transform(warps)
    D = np.square(X[:, None] - X[None]).sum(axis=(2, 3))
    np.testing.assert_allclose(sync.global_distances_, D.sum(axis=1))
    np.testing.assert_allclose(sync.match(warps).distances, D[sync.pattern_index_], atol=1e-9)
    assert sync.pattern_index_ == np.argmin(D.sum(axis=1))


@pytest.mark.parametrize("estimator", BOTH)
def test_pattern_by_index_or_array(estimator, warps):
    by_index = estimator(n_frames=40, pattern=2).fit(warps)
    assert by_index.pattern_index_ == 2
    assert np.isnan(by_index.global_distances_).all()
    by_array = estimator(pattern=by_index.pattern_).fit(warps)
    assert by_array.n_frames_ == 40
    assert by_array.pattern_index_ is None
    np.testing.assert_allclose(by_array.transform(warps), by_index.transform(warps), atol=0.02)
    by_list = estimator(pattern=by_index.pattern_.tolist(), n_frames=20).fit(warps)
    assert by_list.pattern_.shape == (20, 3)


@pytest.mark.parametrize("max_offset", [0.1, 1])
@pytest.mark.parametrize(("consensus", "refine"), [(0, False), (8, False), (8, True)])
def test_warps_are_pinned_monotone_and_bounded(refine, consensus, max_offset, warps):
    settings = {"max_offset": max_offset, "consensus": consensus, "refine": refine}
    sync = DenseSynchronizer(40, max_rate=3, **settings).fit(warps)
    offsets, times, _ = sync.match(warps)
    np.testing.assert_array_equal(times, np.arange(40) + offsets)
    assert (times[:, 0] == 0).all()
    assert (times[:, -1] == 39).all()
    rates = np.diff(times)
    assert rates.min() >= 0
    assert rates.max() <= 3 + 1e-9 or consensus or refine
    assert np.abs(offsets).max() <= max_offset * 40


def test_no_offset_is_linear_normalisation(warps):
    dense = DenseSynchronizer(40, max_offset=0).fit(warps)
    linear = LinearSynchronizer(40).fit(warps)
    assert dense.pattern_index_ == linear.pattern_index_
    np.testing.assert_array_equal(dense.transform(warps), linear.transform(warps))


@pytest.mark.parametrize(
    ("n_frames", "max_offset", "reach"),
    [(100, 0.29, 29), (100, 0.285, 28), (41, 0.25, 10), (60, 0.01, 0), (60, 1, 45)],
)
def test_offsets_reach_max_offset(n_frames, max_offset, reach):
    x = np.zeros((2, n_frames, 1))
    x[0, 5:], x[1, 5 + 3 * n_frames // 4 :] = 1, 1
    settings = {**PAPER, "smoothness": 0, "max_rate": n_frames}
    sync = DenseSynchronizer(pattern=0, max_offset=max_offset, **settings).fit(x)
    assert np.abs(sync.match(x).offsets).max() == reach


@pytest.mark.parametrize(
    "settings",
    [
        {},
        {"n_frames": 15},
        {"n_frames": 18},
        {"consensus": 2},
        {"max_offset": 0.04},
        {"cost": "pose", "max_rate": 3},
    ],
    ids=str,
)
def test_warps_equal_smoothed_votes_of_paths(settings, warps):
    """Paths to the pattern and to its exemplars, by synchronizers with each as the pattern.

    Less than a third of a frame is no smoothing.
    """
    settings = {"n_frames": 40, "metric": None, "max_offset": 0.25, **settings}
    X = [x + 0.1 * np.sin(3 * x[:, ::-1]) * i for i, x in enumerate(warps)]
    sync = DenseSynchronizer(pattern=1, refine=False, **settings).fit(X)
    P = sync.n_frames_
    frames, reach, sigma = np.arange(P), int(sync.max_offset * P), 0.02 * (P - 1)
    direct, *others = (
        DenseSynchronizer(pattern=int(k), **{**settings, "consensus": 0}).fit(X).match(X)
        for k in (1, *sync.exemplars_)
    )
    np.testing.assert_array_equal(sync.match(X).distances, direct.distances)
    for m in range(len(X)):
        routes = [direct.times[m]]
        for k, other in zip(sync.exemplars_, others, strict=True):
            routes.append(np.interp(direct.times[k], frames, other.times[m]))
        offsets = np.median(routes, axis=0) - frames
        if sigma > 1 / 3:
            offsets = slow_filter(offsets, sigma, 0)
            offsets[[0, -1]] = 0
        times = np.clip(frames + np.clip(offsets, -reach, reach), 0, P - 1)
        expected = np.maximum.accumulate(times) if m != 1 else frames
        np.testing.assert_allclose(sync.match(X).times[m], expected, atol=1e-9)


def test_max_rate_beyond_the_clip_changes_nothing(warps):
    P = 30
    most = DenseSynchronizer(P, max_rate=P - 1).fit(warps)
    beyond = DenseSynchronizer(P, max_rate=1e6).fit(warps)
    np.testing.assert_array_equal(beyond.match(warps).times, most.match(warps).times)


@pytest.mark.parametrize("dtype", [np.float64, np.float32])
@pytest.mark.parametrize("n_features", [1, 2])
@pytest.mark.parametrize("n", [1, 2, 3])
def test_few_trials(n, n_features, dtype, warps):
    X = [x[:, :n_features].astype(dtype) for x in warps[:n]]
    sync = DenseSynchronizer().fit(X)
    assert (sync.metric_ is None) == (n < 3)
    assert sync.evidence_.weak is False
    assert sync.global_distances_.shape == (n,)
    assert len(sync.exemplars_) == n - 1
    assert np.isnan(sync.unexplained_variance_) == (n == 1)
    times, aligned = sync.match(X).times, sync.transform(X)
    np.testing.assert_array_equal(times[sync.pattern_index_], np.arange(sync.n_frames_))
    assert (np.diff(times, axis=1) >= 0).all()
    assert sync.pattern_.dtype == aligned.dtype == dtype
    before = LinearSynchronizer(pattern=sync.pattern_index_).fit_transform(X)
    off, linear = (np.abs(x - sync.pattern_).mean() for x in (aligned, before))
    assert off <= linear


@pytest.mark.parametrize("dtype", [np.float64, np.float32])
def test_constant_signals_count_for_nothing(dtype, warps):
    """Those that are no multiples of powers of two have roundings of their own."""
    X = [x.astype(dtype) for x in warps]
    still = [np.concatenate([x, np.full((len(x), 2), [0.1, -3], dtype)], axis=1) for x in X]
    sync, plain = DenseSynchronizer().fit(still), DenseSynchronizer().fit(X)
    assert sync.pattern_index_ == plain.pattern_index_
    np.testing.assert_array_equal(sync.metric_.share[3:], 0)
    np.testing.assert_allclose(sync.match(still).times, plain.match(X).times, atol=0.1)
    nothing = [x[:, 3:] for x in still]
    sync = DenseSynchronizer().fit(nothing)
    assert not sync.match(nothing).offsets.any()
    assert not sync.refines_
