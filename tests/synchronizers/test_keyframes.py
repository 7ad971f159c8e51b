"""KeyframeSynchronizer: given key-frames, found ones, and metadata routing."""

import numpy as np
import pandas as pd
import pytest
from sklearn import config_context
from sklearn.model_selection import cross_validate
from sklearn.pipeline import make_pipeline
from sklearn_motionsync import (
    ActionModel,
    ASpace,
    DenseSynchronizer,
    DirectionCosines,
    KeyframeSynchronizer,
    LinearSynchronizer,
)
from sklearn_motionsync.metrics import group_timing_error, keyframe_error
from sklearn_motionsync.synchronizers.keyframes import curvature_keyframes

from oracle import slow_filter


def test_given_keyframes_coincide(bending, bending_aspace):
    sync = KeyframeSynchronizer(100).fit(bending_aspace, keyframes=bending.keyframes)
    offsets, times, _ = sync.match(bending_aspace, keyframes=bending.keyframes)
    lengths = [len(x) for x in bending_aspace]
    pattern = bending.keyframes[sync.pattern_index_] * 99 / (lengths[sync.pattern_index_] - 1)
    np.testing.assert_allclose(sync.keyframes_, pattern)
    # Key-frames lie between whole frames, where warps have a corner.
    assert keyframe_error(times, bending.keyframes, pattern, lengths) < 0.15
    assert not offsets[sync.pattern_index_].any()
    assert (np.diff(times) >= 0).all()


def test_whole_keyframes_coincide_exactly():
    X = [np.arange(11.0)[:, None] ** 2, np.arange(21.0)[:, None]]
    sync = KeyframeSynchronizer(11, pattern=0).fit(X, keyframes=[[4, 6], [10, 16]])
    times = sync.match(X, keyframes=[[4, 6], [10, 16]]).times[1]
    np.testing.assert_allclose(times, np.interp(np.arange(11), [0, 4, 6, 10], [0, 5, 8, 10]))
    out = sync.transform(X, keyframes=[[4, 6], [10, 16]])
    np.testing.assert_allclose(out[1][[0, 4, 6, 10], 0], [0, 10, 16, 20])


def test_pattern_is_the_median_after_matching_by_keyframes(bending, bending_aspace):
    X, K = bending_aspace[:6], bending.keyframes[:6]
    sync = KeyframeSynchronizer(60).fit(X, keyframes=K)
    knots = np.array([k * 59 / (len(x) - 1) for k, x in zip(K, X, strict=True)])
    centre, p = knots.mean(axis=0), np.arange(60)
    matched = []
    for x, k in zip(X, knots, strict=True):
        tau = np.interp(p, [0, *centre, 59], [0, *k, 59])
        own = np.linspace(0, 59, len(x))
        matched.append(np.column_stack([np.interp(tau, own, column) for column in x.T]))
    D = [[np.square(a - b).sum() for b in matched] for a in matched]
    np.testing.assert_allclose(sync.global_distances_, np.sum(D, axis=1))
    assert sync.pattern_index_ == np.argmin(np.sum(D, axis=1))


def test_timing_errors_of_given_and_found_keyframes(bending, bending_aspace):
    key = KeyframeSynchronizer(100).fit(bending_aspace, keyframes=bending.keyframes)
    times = {
        "keyframes": key.match(bending_aspace, keyframes=bending.keyframes).times,
        "dense": DenseSynchronizer(100).fit(bending_aspace).match(bending_aspace).times,
        "found": KeyframeSynchronizer(100).fit(bending_aspace).match(bending_aspace).times,
        "linear": LinearSynchronizer(100).fit(bending_aspace).match(bending_aspace).times,
    }
    errors = {name: group_timing_error(t, bending.times) for name, t in times.items()}
    assert errors["keyframes"] < 0.5
    assert errors["dense"] < 0.3
    assert errors["found"] < errors["linear"]


def test_curvature_keyframes_are_corners():
    """A path along three edges of a box has two corners."""
    t = np.linspace(0, 3, 91)[:, None]
    path = np.hstack([np.clip(t, 0, 1), np.clip(t - 1, 0, 1), np.clip(t - 2, 0, 1)])
    np.testing.assert_allclose(curvature_keyframes(path, 2), [30, 60], atol=1)


@pytest.mark.parametrize("n_frames", [20, 40, 101])
def test_first_keyframe_has_the_largest_curvature(n_frames):
    """sqrt(|v|^2 |a|^2 - (v.a)^2) / |v|^3, with a tenth of the mean |v|^2 added to |v|^2."""
    rng, t, cases = np.random.default_rng(n_frames), np.linspace(0, 1, n_frames), 0
    for _ in range(40):
        waves = np.sin(np.outer(t, rng.uniform(2, 20, 3)) + rng.uniform(0, 6, 3))
        path = waves @ rng.standard_normal((3, 3))
        path -= path.mean(axis=0)
        v, a = (slow_filter(path, 0.03 * (n_frames - 1), order) for order in (1, 2))
        vv = (v**2).sum(axis=1)
        bend = np.linalg.norm(np.cross(v, a), axis=1) / (vv + 0.1 * vv.mean()) ** 1.5
        # Key-frames keep a distance from both ends.
        if n_frames / 6 < bend.argmax() < n_frames - 1 - n_frames / 6:
            cases += 1
            sync = KeyframeSynchronizer(n_keyframes=1).fit([path])
            assert sync.keyframes_.tolist() == [bend.argmax()]
    assert cases > 10


@pytest.mark.parametrize("n_keyframes", [2, 5, 9])
def test_reversed_path_has_the_same_keyframes(n_keyframes):
    rng = np.random.default_rng(0)
    for n_frames in range(30, 70):
        path = np.cumsum(rng.standard_normal((n_frames, 3)), axis=0)
        there, back = (
            KeyframeSynchronizer(n_keyframes=n_keyframes).fit([x]).keyframes_
            for x in (path, path[::-1])
        )
        assert len(there) == n_keyframes
        np.testing.assert_array_equal(back, n_frames - 1 - there[::-1])


def test_equal_postures_are_matched_in_order():
    """Twice around a triangle: each corner is passed twice."""
    corners = np.array([[0.0, 0], [1, 0], [0.5, 0.8], [0, 0], [1, 0], [0.5, 0.8], [0, 0]])
    turns = [20, 40, 60, 80, 100], [24, 36, 66, 76, 98], [14, 40, 52, 88, 106]
    X = [
        np.column_stack([np.interp(np.arange(121), [0, *k, 120], way) for way in corners.T])
        for k in turns
    ]
    sync = KeyframeSynchronizer(pattern=0, n_keyframes=5).fit(X)
    np.testing.assert_allclose(sync.keyframes_, turns[0], atol=1)
    times = sync.match(X).times[:, sync.keyframes_.astype(int)]
    np.testing.assert_allclose(times, turns, atol=4)


def test_shifted_path_has_the_same_keyframes():
    """Twice around an ellipse that is shifted: key-frames are at the same ends."""
    t = np.linspace(0, 1, 121)
    phase = np.pi / 2 + 4 * np.pi * np.stack([t, t + 0.03 * np.sin(2 * np.pi * t)])
    pattern, other = np.stack([2 * np.cos(phase), np.sin(phase)], axis=2)
    sync = KeyframeSynchronizer(pattern=0, n_keyframes=4).fit([pattern, other + [0, 0.5]])
    np.testing.assert_allclose(sync.keyframes_, [15, 45, 75, 105], atol=1)
    landed = sync.match([pattern, other + [0, 0.5]]).times[:, sync.keyframes_.astype(int)]
    shown = [np.interp(f, np.arange(121), p) for f, p in zip(landed, phase, strict=True)]
    np.testing.assert_allclose(shown, [np.pi * np.arange(1, 5)] * 2, atol=0.15)


def test_tremor_at_rest_is_no_keyframe():
    t, rng = np.linspace(0, 3, 151)[:, None], np.random.default_rng(0)
    path = np.hstack([np.clip(t, 0, 1), np.clip(t - 1, 0, 1)])
    path[100:] += 0.003 * rng.standard_normal((51, 2))
    sync = KeyframeSynchronizer(n_keyframes=1).fit([path])
    np.testing.assert_allclose(sync.keyframes_, [50], atol=1)


@pytest.mark.parametrize("n_frames", [3, 5, 9])
def test_number_of_keyframes_is_limited_by_the_frames(n_frames):
    X = [np.random.default_rng(i).standard_normal((n_frames, 2)) for i in range(3)]
    sync = KeyframeSynchronizer(n_keyframes=20).fit(X)
    assert len(sync.keyframes_) == n_frames - 2
    np.testing.assert_allclose(sync.transform(X), X)


# -- metadata routing -------------------------------------------------------------------


def make_pipe(bunch):
    sync = KeyframeSynchronizer(60)
    sync.set_fit_request(keyframes=True).set_transform_request(keyframes=True)
    return make_pipeline(DirectionCosines(bunch.skeleton), ASpace(4), sync, ActionModel())


def test_keyframes_are_routed_in_a_pipeline(bending):
    with config_context(enable_metadata_routing=True):
        pipe = make_pipe(bending).fit(bending.data, keyframes=bending.keyframes)
        points = pipe[:-2].transform(bending.data)
        direct = KeyframeSynchronizer(60).fit_transform(points, keyframes=bending.keyframes)
        np.testing.assert_array_equal(pipe[-1].mean_, ActionModel().fit(direct).mean_)
        out = pipe[:-1].transform(bending.data, keyframes=bending.keyframes)
        np.testing.assert_array_equal(out, direct)


def test_keyframes_are_split_in_cross_validation(bending):
    with config_context(enable_metadata_routing=True):
        result = cross_validate(
            make_pipe(bending)[:-1],
            bending.data,
            cv=3,
            scoring=lambda estimator, X, y=None: len(estimator[-1].keyframes_),
            params={"keyframes": list(bending.keyframes)},
            error_score="raise",
        )
    assert result["test_score"].tolist() == [5, 5, 5]


# -- bad key-frames -----------------------------------------------------------------------


@pytest.mark.parametrize(
    ("keyframes", "message"),
    [
        ([[2, 5]], r"list of 2 arrays .*; got \[\[2, 5\]\]"),
        (3, "list of 2 arrays .*; got 3"),
        (
            [[2, 5], [5, 2]],
            r"Performance 1: key-frames must be 2 increasing frames between 0 and 9",
        ),
        ([[2, 5], [2, 5, 7]], "Performance 1: key-frames must be 2"),
        ([[2, 5], [2, 9]], "Performance 1: .* both excluded"),
        ([[0, 5], [2, 5]], "Performance 0: "),
        ([[2, 5], [2, np.nan]], "Performance 1: "),
        ([[2, 5], 3], "Performance 1: "),
    ],
)
def test_fit_refuses_invalid_keyframes(keyframes, message):
    X = [np.arange(10.0)[:, None]] * 2
    with pytest.raises(ValueError, match=message):
        KeyframeSynchronizer().fit(X, keyframes=keyframes)


def test_transform_needs_keyframes_after_a_fit_with_them(bending):
    sync = KeyframeSynchronizer().fit(bending.data, keyframes=bending.keyframes)
    with pytest.raises(ValueError, match="give those of these performances too"):
        sync.transform(bending.data)
    with pytest.raises(ValueError, match="must be 5 increasing"):
        sync.transform(bending.data, keyframes=bending.keyframes[:, :4])


# -- what counts frames in another way ------------------------------------------------------


@pytest.mark.parametrize(
    ("n_frames", "frames", "is_refused"),
    [
        (100, [0.62], True),
        (100, [0.31, 0.62], True),
        (12, [0.25, 0.9], True),
        (300, [0.62, 1.4, 2.5], True),
        # Whole frames, few frames, and frames further back.
        (300, [1, 4], False),
        (3, [0.5], False),
        (100, [0.5, 1.99], False),
        (300, [2.5, 6.1], False),
    ],
)
def test_keyframes_in_seconds_are_refused(n_frames, frames, is_refused):
    X = [np.arange(50.0)[:, None] ** 2, np.arange(float(n_frames))[:, None]]
    late = [20 + 5 * k for k in range(len(frames))]
    sync = KeyframeSynchronizer().fit(X[:1] * 2, keyframes=[late, late])
    calls = [
        lambda: KeyframeSynchronizer().fit(X, keyframes=[late, frames]),
        lambda: sync.match(X, keyframes=[late, frames]),
        lambda: sync.transform(X, keyframes=[late, frames]),
        lambda: keyframe_error([range(50)] * 2, [late, frames], late, [50, n_frames]),
    ]
    for call in calls:
        if is_refused:
            with pytest.raises(ValueError, match=r"Performance 1: .* look like seconds, .*_rate"):
                call()
        else:
            call()


def test_events_of_other_rows_are_no_keyframes():
    rng = np.random.default_rng(0)
    takes = [pd.DataFrame({"knee": rng.normal(size=60).cumsum()}) for _ in range(3)]
    for x in takes:
        x.attrs["events"] = [{"label": "off", "frame": 30.5}]
    keyframes = [[x.attrs["events"][0]["frame"]] for x in takes]
    sync = KeyframeSynchronizer().fit(takes, keyframes=keyframes)
    for rows, words in (
        (slice(10, None), "row 0 is frame 10"),
        (slice(0, None, 2), "1 is frame 2"),
    ):
        X = [*takes[:2], takes[2].iloc[rows]]
        for call in (KeyframeSynchronizer().fit, sync.match, sync.transform):
            with pytest.raises(ValueError, match=f"Performance 2: .*{words} of the recording"):
                call(X, keyframes=keyframes)
            table = pd.concat(X, keys=range(3))
            table.attrs = takes[0].attrs
            with pytest.raises(ValueError, match=f"Performance 2: .*{words} of the recording"):
                call(table, keyframes=keyframes)
            call([x.reset_index(drop=True) for x in X], keyframes=[[30.5], [30.5], [20.5]])
        # Without key-frames, or events to take them from, rows count.
        KeyframeSynchronizer().fit(X)
        X[2].attrs = {}
        sync.match(X, keyframes=[[30.5], [30.5], [20.5]])
