"""Warping what was recorded along with the performances."""

import numpy as np
import pandas as pd
import pytest
from sklearn_motionsync import ASpace, DenseSynchronizer, to_frame


@pytest.fixture(scope="module")
def matched(bending):
    points = ASpace(3).fit_transform(bending.data[:6])
    synchronizer = DenseSynchronizer(40).fit(points)
    return points, synchronizer, synchronizer.match(points)


def test_performances_are_warped_as_by_transform(matched):
    points, synchronizer, match = matched
    np.testing.assert_array_equal(match.warp(points), synchronizer.transform(points))


def test_other_recordings_at_another_rate(matched):
    points, _, match = matched
    rng = np.random.default_rng(0)
    forces = [rng.normal(size=(10 * len(x) - 3, 2)) for x in points]
    warped = match.warp([pd.DataFrame(x) for x in forces])
    for x, times, out in zip(forces, match.times, warped, strict=True):
        at = times / 39 * (len(x) - 1)
        expected = np.array([np.interp(at, np.arange(len(x)), column) for column in x.T]).T
        np.testing.assert_allclose(out, expected, atol=1e-12)


def test_dtype(matched):
    points, _, match = matched
    assert match.warp([x.astype(np.float32) for x in points]).dtype == np.float32
    mixed = [points[0].astype(np.float32), *points[1:]]
    assert match.warp(mixed).dtype == np.float64
    assert match.warp([np.arange(4)[:, np.newaxis]] * 6).dtype == np.float64


def test_what_cannot_be_warped(matched):
    points, _, match = matched
    with pytest.raises(ValueError, match="6 matched performances, but 5 sequences"):
        match.warp(points[:5])
    with pytest.raises(ValueError, match="Performance 1 has 2 features a frame, performance 0 has"):
        match.warp([points[0], np.zeros((9, 2)), *points[2:]])
    with pytest.raises(ValueError, match=r"wrap|Wrap one performance as \[X\]"):
        match.warp(np.zeros((6, 9)))


def test_every_kind_of_collection(matched):
    """The contract for performances holds for what comes along with them; gaps stay."""
    points, _, match = matched
    expected = match.warp(points)
    names = ["a", "b", "c"]
    frames = [pd.DataFrame(x, columns=names) for x in points]
    objects = np.empty(6, dtype=object)
    objects[:] = points
    for X in (frames, to_frame(frames), objects):
        np.testing.assert_array_equal(match.warp(X), expected)
    with_gap = [x.copy() for x in points]
    with_gap[2][5, 1] = np.nan
    warped = match.warp(with_gap)
    known = np.isfinite(warped)
    assert not known[2, :, 1].all()
    np.testing.assert_array_equal(warped[known], expected[known])
