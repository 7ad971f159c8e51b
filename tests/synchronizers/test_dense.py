"""DenseSynchronizer and LinearSynchronizer: clock, pattern, warp, known warps, key-frames."""

import numpy as np
import pandas as pd
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
    times = sync.match(warps).times
    assert (times[:, 0] == 0).all()
    assert (times[:, -1] == 39).all()
    rates = np.diff(times)
    assert rates.min() >= 0
    assert rates.max() <= 3 + 1e-9 or consensus or refine
    assert np.abs(times - np.arange(40)).max() <= max_offset * 40


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


# -- LinearSynchronizer between key-frames ---------------------------------------------


def test_whole_keyframes_coincide_exactly():
    X = [np.arange(11.0)[:, None] ** 2, np.arange(21.0)[:, None]]
    sync = LinearSynchronizer(11, pattern=0).fit(X, keyframes=[[4, 6], [10, 16]])
    times = sync.match(X, keyframes=[[4, 6], [10, 16]]).times[1]
    np.testing.assert_allclose(times, np.interp(np.arange(11), [0, 4, 6, 10], [0, 5, 8, 10]))
    out = sync.transform(X, keyframes=[[4, 6], [10, 16]])
    np.testing.assert_allclose(out[1][[0, 4, 6, 10], 0], [0, 10, 16, 20])


def test_pattern_is_the_median_after_matching_by_keyframes(bending, bending_aspace):
    X, p = bending_aspace[:6], np.arange(60)
    K = bending.keyframes[:6]
    sync = LinearSynchronizer(60).fit(X, keyframes=K)
    knots = np.array([k * 59 / (len(x) - 1) for k, x in zip(K, X, strict=True)])
    centre = knots.mean(axis=0)
    matched = []
    for x, k in zip(X, knots, strict=True):
        tau = np.interp(p, [0, *centre, 59], [0, *k, 59])
        own = np.linspace(0, 59, len(x))
        matched.append(np.column_stack([np.interp(tau, own, column) for column in x.T]))
    D = [[np.square(a - b).sum() for b in matched] for a in matched]
    np.testing.assert_allclose(sync.global_distances_, np.sum(D, axis=1))
    assert sync.pattern_index_ == np.argmin(np.sum(D, axis=1))


def test_a_key_frame_that_is_not_known_is_left_out():
    """The pattern lacks the second one: the others meet it at 9, 10 and 12, by the first."""
    rows = [[4, np.nan], [8, 18], [8, 19], [6, 17]]
    X = [np.arange(float(n))[:, None] for n in (21, 41, 41, 31)]
    sync = LinearSynchronizer(21, pattern=0).fit(X, keyframes=rows)
    lengths = [41, 41, 31]
    met = [
        np.interp(k * 20 / (n - 1), [0, a * 20 / (n - 1), 20], [0, 4, 20])
        for (a, k), n in zip(rows[1:], lengths, strict=True)
    ]
    np.testing.assert_allclose(sync.keyframes_, [4, np.median(met)])
    shown = [[np.nan, 20], None]
    times = sync.match(X[1:3], keyframes=shown).times
    expected = np.interp(np.arange(21), [0, sync.keyframes_[1], 20], [0, 10, 20])
    np.testing.assert_allclose(times[0], expected)
    np.testing.assert_array_equal(times[1], np.arange(21))


def test_gaps_and_key_frames_together(bending, bending_aspace):
    X, K = [x.copy() for x in bending_aspace[:6]], bending.keyframes[:6]
    X[2][10:20, 1] = np.nan
    sync = LinearSynchronizer(60).fit(X, keyframes=K)
    expected = LinearSynchronizer(60, pattern=sync.pattern_index_).fit(X, keyframes=K)
    match = sync.match(X, keyframes=K)
    np.testing.assert_array_equal(match.times, expected.match(X, keyframes=K).times)
    warped = sync.transform(X, keyframes=K)
    assert np.isnan(warped).sum() == np.isnan(warped[2, :, 1]).sum() > 0
    filled = sync.transform(X, keyframes=K, fill="model")
    assert np.isfinite(filled).all()
    np.testing.assert_array_equal(filled[~np.isnan(warped)], warped[~np.isnan(warped)])


def test_events_of_other_rows_are_no_keyframes():
    """Which rows are others, tests/inputs/test_recorded.py tries."""
    rng = np.random.default_rng(0)
    takes = [pd.DataFrame({"knee": rng.normal(size=60).cumsum()}) for _ in range(3)]
    for x in takes:
        x.attrs["events"] = [{"label": "off", "frame": 30.5}]
    keyframes = [[30.5]] * 3
    sync = LinearSynchronizer().fit(takes, keyframes=keyframes)
    X = [*takes[:2], takes[2].iloc[10:]]
    table = pd.concat(X, keys=range(3))
    table.attrs = takes[0].attrs
    for call in (LinearSynchronizer().fit, sync.match, sync.transform):
        for given in (X, table):
            with pytest.raises(ValueError, match=r"Trial 2: .*row 0 is frame 10 of the recording"):
                call(given, keyframes=keyframes)
        call([x.reset_index(drop=True) for x in X], keyframes=[[30.5], [30.5], [20.5]])
    # Without key-frames, or events to take them from, rows count.
    LinearSynchronizer().fit(X)
    X[2].attrs = {}
    sync.match(X, keyframes=[[30.5], [30.5], [20.5]])
