"""LinearSynchronizer between key-frames, metadata routing, and key-frames that are refused."""

import numpy as np
import pandas as pd
import pytest
from sklearn_motionsync import LinearSynchronizer


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
