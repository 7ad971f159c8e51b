"""Match: warps, frames and seconds, warping of other recordings, and timing."""

import pickle
from functools import partial

import numpy as np
import pandas as pd
import pytest
from IPython.core.formatters import HTMLFormatter
from sklearn_motionsync import (
    ASpace,
    DenseSynchronizer,
    LinearSynchronizer,
    Match,
    to_frame,
)

from pages import Page


@pytest.fixture(scope="module")
def matched(bending):
    points = ASpace(3).fit_transform(bending.data[:6])
    synchronizer = DenseSynchronizer(40).fit(points)
    return points, synchronizer, synchronizer.match(points)


def test_warp_takes_recordings_of_another_frame_rate(matched):
    points, _, match = matched
    rng = np.random.default_rng(0)
    forces = [rng.normal(size=(10 * len(x) - 3, 2)) for x in points]
    warped = match.warp([pd.DataFrame(x) for x in forces])
    for x, times, out in zip(forces, match.times, warped, strict=True):
        at = times / 39 * (len(x) - 1)
        expected = np.array([np.interp(at, np.arange(len(x)), column) for column in x.T]).T
        np.testing.assert_allclose(out, expected, atol=1e-12)


def test_warp_refuses_other_sequences(matched):
    points, _, match = matched
    with pytest.raises(ValueError, match="6 matched trials, but 5 sequences"):
        match.warp(points[:5])
    with pytest.raises(ValueError, match="Trial 1 has 2 features a frame, trial 0 has"):
        match.warp([points[0], np.zeros((9, 2)), *points[2:]])
    with pytest.raises(ValueError, match=r"wrap|Wrap one trial as \[X\]"):
        match.warp(np.zeros((6, 9)))


def test_match_unpacks_and_pickles(matched):
    match = matched[2]
    assert match.times.shape == match.offsets.shape == (6, 40)
    np.testing.assert_array_equal(match.offsets, match.times - np.arange(40))
    copied = pickle.loads(pickle.dumps(match))
    np.testing.assert_array_equal(copied.times, match.times)
    np.testing.assert_array_equal(copied.distances, match.distances)
    assert repr(match) == "Match(6 trials on 40 frames)"


def test_frames_and_seconds(matched):
    points, _, match = matched
    frames = match.frames(points)
    for x, times, own in zip(points, match.times, frames, strict=True):
        np.testing.assert_allclose(own, np.interp(times, [0, 39], [0, len(x) - 1]), atol=1e-12)
    # warp samples at these frames.
    clocks = [np.arange(len(x), dtype=float)[:, np.newaxis] for x in points]
    np.testing.assert_allclose(match.warp(clocks)[:, :, 0], frames, atol=1e-12)
    lengths = [len(x) for x in points]
    for X in (lengths, np.array(lengths, dtype=float), pd.Series(lengths)):
        np.testing.assert_array_equal(match.frames(X), frames)
    frame = to_frame([pd.DataFrame(x) for x in points])
    np.testing.assert_array_equal(match.frames(frame), frames)
    np.testing.assert_array_equal(match.seconds(points, 120), frames / 120)
    rates = np.array([120, 120, 30, 60, 50, 100])
    np.testing.assert_array_equal(match.seconds(points, rates), frames / rates[:, np.newaxis])


def test_tables_tell_their_frame_rate():
    rng = np.random.default_rng(0)
    seconds = [pd.Index(np.arange(n) / 50 + 3, name="time") for n in (30, 40, 50)]
    tables = [pd.DataFrame({"knee": rng.normal(size=len(t)).cumsum()}, index=t) for t in seconds]
    recorded = pd.DataFrame({"knee": rng.normal(size=90).cumsum()})
    recorded.attrs["frame_rate"] = 120.0
    X, rates = [*tables, recorded, recorded.iloc[::2]], [50, 50, 50, 120, 60]
    with pytest.warns(UserWarning, match="Trial 3 has 120 frames a second"):
        match = LinearSynchronizer(20).fit(X).match(X)
    lengths = list(map(len, X))
    expected = match.to_frame("seconds", lengths, rates)
    # It knows its trials; what was recorded with them, by frames of any rate, lasts as long.
    for given in ((), (X,)):
        pd.testing.assert_frame_equal(match.to_frame("seconds", *given), expected)
        offsets = match.offsets_in("seconds", *given).ravel()
        np.testing.assert_array_equal(offsets, expected["offset"])
    forces = [np.zeros((10 * n - 9, 1)) for n in lengths]
    np.testing.assert_allclose(match.seconds(forces), match.seconds(), rtol=1e-12)
    # One that is given counts.
    given = match.to_frame("seconds", lengths, 10)
    pd.testing.assert_frame_equal(match.to_frame("seconds", X, 10), given)
    long = to_frame(X[:3])
    np.testing.assert_allclose(Match(match.times[:3]).seconds(long)[:, -1], [0.58, 0.78, 0.98])
    of_warps = Match(match.times)
    for unknown in ([*X[:4], X[0].to_numpy()], [*X[:4], recorded.drop(index=5)], lengths):
        for call in (of_warps.seconds, partial(of_warps.to_frame, "seconds")):
            with pytest.raises(ValueError, match=r"The frame rate of trial \d is not known"):
                call(unknown)


@pytest.mark.parametrize(
    ("lengths", "rate", "message"),
    [
        ([40] * 5, 1, "6 matched trials, but 5 lengths"),
        ([40, 40, 1, 40, 40, 40], 1, "Trial 2 has 1 frame; give the trials"),
        ([40, 40, 40, 40, 40.5, 40], 1, "Trial 4 has 40.5 frames"),
        (np.zeros((6, 9)), 1, r"Wrap one trial .* \[X.shape\[1\]\] \* len\(X\)"),
        ({"a": np.zeros((6, 9))}, 1, "got dict"),
        (map(len, ["ab"] * 6), 1, "got map"),
        (5, 1, "A set of trials is .*got int"),
        ([40] * 6, [1, 2, 3, np.inf, 5, 6], r"inf.*: trial 3\."),
        ([40] * 6, [1, 2], "for each of the 6 trials"),
    ],
)
def test_seconds_refuses_invalid_lengths_and_rates(matched, lengths, rate, message):
    with pytest.raises(ValueError, match=message):
        matched[2].seconds(lengths, rate)


@pytest.mark.parametrize(
    ("times", "distances", "message"),
    [
        (np.zeros(5), None, r"got \(5,\)"),
        (np.zeros((5, 1)), None, "at least 2"),
        ([[0.0, 1.0], [0.0, 1.5]], None, "Trial 1: .* 0 to P - 1 = 1, .* got 1.5 at frame 1"),
        ([[0.0, 1.0]], ["near"], "distances is not a numeric array: got str, 'near'"),
        ([[0.0, np.nan]], None, "from 0 to P - 1"),
        ([[0.0, 1.0]], [1.0, 2.0], r"each of the 1 trial, got shape \(2,\)"),
    ],
)
def test_match_refuses_invalid_times_and_distances(times, distances, message):
    with pytest.raises(ValueError, match=message):
        Match(times, distances)


def test_match_copies_given_times():
    match = Match([[0, 2, 2, 3]])
    assert match.times.dtype == np.float64
    assert match.offsets.tolist() == [[0, 1, 0, 0]]
    assert np.isnan(match.distances).all()
    times = np.array([[0.0, 1.0, 2.0]])
    match = Match(times)
    times[0, 1] = 9
    assert not match.offsets.any()


@pytest.mark.parametrize(
    ("gap", "frame"), [(np.nan, 0), (np.nan, 5), (np.nan, 9), (np.inf, 8), (-np.inf, 5)]
)
def test_gaps_stay_where_they_are(gap, frame):
    """At whole frames only that frame counts; between frames both neighbours do."""
    x = np.arange(10.0)[:, np.newaxis].repeat(2, axis=1)
    x[frame, 1] = gap
    np.testing.assert_array_equal(Match([np.arange(10)]).warp([x])[0], x)
    half = Match([np.minimum(np.arange(10) + 0.5, 9)]).warp([x])[0]
    near = [k for k in range(10) if gap in (x[k, 1], x[min(k + 1, 9), 1]) or frame in (k, k + 1)]
    np.testing.assert_array_equal(np.flatnonzero(~np.isfinite(half[:, 1])), near)
    np.testing.assert_array_equal(half[near, 1], [gap] * len(near))
    # Frames away from all times have no influence.
    if 0 < frame < 9:
        skips = np.where(np.arange(10) < frame, frame - 1.0, frame + 1.0)
        assert np.isfinite(Match([skips]).warp([x])).all()


# -- timing as a result ------------------------------------------------------------------


@pytest.fixture
def late():
    """Peaks at frames 7 and 4, where the pattern has its peak at frame 5 of 11."""
    return Match([np.interp(np.arange(11), [0, 5, 10], [0, peak, 10]) for peak in (7, 4)])


def test_offsets_in_units(late):
    np.testing.assert_array_equal(late.offsets_in("frames"), late.offsets)
    assert late.offsets_in("percent")[:, 5].tolist() == [20, -10]
    X = [np.zeros((21, 1)), np.zeros((41, 1))]
    # Two seconds and one, of which 20 per cent and 10.
    for given in (X, [21, 41]):
        seconds = late.offsets_in("seconds", given, frame_rate=[10, 40])
        np.testing.assert_allclose(seconds[:, 5], [0.4, -0.1])
    even = np.linspace(0, 1, 11) * np.array([[2], [1]])
    np.testing.assert_allclose(seconds, late.seconds(X, [10, 40]) - even, atol=1e-12)


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda m: m.offsets_in("ms"), r"unit must be one of \['frames', .*got 'ms'"),
        (lambda m: m.offsets_in("seconds"), "needs X, .* and frame_rate"),
        (lambda m: m.offsets_in("seconds", frame_rate=5), "needs X, .* and frame_rate"),
        (lambda m: m.offsets_in("seconds", [5], 5), "2 matched trials, but 1 length:"),
        (lambda m: m.offsets_in("percent", [5]), "2 matched trials, but 1 length:"),
        (lambda m: m.to_frame(labels=["a"]), "2 matched trials, but 1 label:"),
        (lambda m: m.to_frame(labels=["a", "a"]), "2 different labels"),
        (lambda m: m.to_frame("hours"), "unit must be one of"),
    ],
)
def test_refuses_invalid_units_and_labels(late, call, message):
    with pytest.raises(ValueError, match=message):
        call(late)


def test_rates_are_the_slope_of_the_warp(late):
    rates = late.rates
    np.testing.assert_allclose(
        rates[:, [0, 3, 7, 10]], [[1.4] * 2 + [0.6] * 2, [0.8] * 2 + [1.2] * 2]
    )
    np.testing.assert_allclose(rates[:, 5], [1, 1])
    assert (Match([np.arange(9)]).rates == 1).all()
    still = Match([[0, 0, 0, 3, 3]]).rates
    assert np.isfinite(np.log(still)).all()
    assert still[0, 0] == still.min() == 0.01


def test_to_frame_gives_timing_with_labels(late):
    X = to_frame([np.zeros((21, 1)), np.zeros((41, 1))], trials=["ann", "bob"])
    table = late.to_frame("seconds", X, frame_rate=[10, 40])
    assert list(table.columns) == ["time", "offset", "rate"]
    np.testing.assert_allclose(table.loc[("bob", 5)], [0.4, -0.1, 1])
    named = late.to_frame(X=X.rename_axis(["trial", "sample"]))
    assert named.index.names == table.index.names == ["trial", "frame"]
    table = late.to_frame()
    np.testing.assert_array_equal(table["offset"].unstack(), late.offsets)
    np.testing.assert_array_equal(table["time"].unstack(), late.times)
    np.testing.assert_array_equal(table["rate"].unstack(), late.rates)
    for given, labels in (
        ({"X": X}, ["ann", "bob"]),
        ({"labels": pd.Series(["x", "y"])}, ["x", "y"]),
        ({"X": X, "labels": ["x", "y"]}, ["x", "y"]),
        ({"X": [21, 41]}, [0, 1]),
        ({"X": pd.Series([21, 41], index=[3, 3])}, [0, 1]),
    ):
        assert list(late.to_frame("percent", **given).index.unique(0)) == labels


# -- the table that notebooks show ---------------------------------------------------------


def curves_of(page):
    points = [attributes["points"].split() for tag, attributes in page.tags if tag == "polyline"]
    return [np.array([point.split(",") for point in curve], dtype=float) for curve in points]


def test_offsets_are_told_and_drawn():
    page = Page(HTMLFormatter()(Match([[0, 2, 3, 3.5, 4], [0, 0.5, 1.5, 3, 4]])))
    assert "25.0 % late, at 25 %" in page.text
    assert "12.5 % early, at 25 %" in page.text
    first, second = curves_of(page)
    np.testing.assert_allclose(first[:, 0], np.linspace(0, 120, 5))
    np.testing.assert_allclose(first[:, 1], [12, 1, 1, 6.5, 12])
    # Early is below the line, on the same scale.
    np.testing.assert_allclose(second[:, 1], [12, 17.5, 17.5, 12, 12], atol=0.06)
    assert not {"script", "link", "img"} & {tag for tag, _ in page.tags}


@pytest.mark.parametrize(("count", "shown"), [(0, 0), (1, 1), (10, 10), (25, 10)])
def test_first_trials_are_shown(count, shown):
    page = Page(HTMLFormatter()(Match(np.tile([0.0, 1.0, 2.0], (count, 1)))))
    assert len(curves_of(page)) == shown
    more = [text for text in page.shown if text.startswith("and ")]
    assert more == (["and 15 trials more"] if count == 25 else [])
