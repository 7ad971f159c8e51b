"""TrellisDisplay: the disparity space agrees with brute force, the image with both."""

import numpy as np
import pytest
from sklearn.pipeline import make_pipeline
from sklearn_motionsync import DenseSynchronizer, LinearSynchronizer
from sklearn_motionsync.display import TrellisDisplay


def reachable(n_frames, width, steps):
    """The (p, d) that pinned paths within the band pass, by enumeration."""
    forward = [{0}]
    for _ in range(n_frames - 1):
        forward.append({d + s - 1 for d in forward[-1] for s in steps if abs(d + s - 1) <= width})
    passed = [{0}]
    for before in forward[-2::-1]:
        passed.append({d for d in before if any(d + s - 1 in passed[-1] for s in steps)})
    return passed[::-1]


@pytest.mark.parametrize("max_rate", [2, 3])
def test_disparity_space_agrees_with_brute_force(bunch, pipe, max_rate):
    points = pipe[:2].transform(bunch.data)
    dense = DenseSynchronizer.paper(n_frames=16, max_rate=max_rate, pattern=2).fit(points)
    display = TrellisDisplay.from_estimator(dense, points, trial=5)
    grid = np.arange(16)
    base, moving = (
        np.array([np.interp(grid, np.linspace(0, 15, len(x)), k) for k in x.T]).T
        for x in (points[2], points[5])
    )
    passed = reachable(16, 4, range(max_rate + 1))
    expected = np.full((16, 9), np.nan)
    for p, offsets in enumerate(passed):
        for d in offsets:
            difference = base[p] - moving[p + d]
            expected[p, d + 4] = difference @ difference
    np.testing.assert_allclose(display.space.costs, expected, atol=1e-12)
    np.testing.assert_array_equal(display.space.offsets, np.arange(-4, 5))
    # The image is the space, the best path its cheapest way through, as match tells.
    np.testing.assert_array_equal(display.image_.get_array().T.filled(np.nan), display.space.costs)
    path = display.path_.get_ydata()
    at = (path + 4).round().astype(int)
    rates = np.diff(np.arange(16) + path)
    total = display.space.costs[np.arange(16), at].sum() + dense.mu_ * np.abs(rates - 1).sum()
    match = dense.match([points[5]])
    np.testing.assert_allclose(total, match.distances[0])
    np.testing.assert_array_equal(display.warp_.get_ydata(), match.offsets[0])
    np.testing.assert_array_equal(display.warp_.get_ydata(), path)


def test_cells_of_the_image_are_centred_on_offsets(bunch, pipe):
    display = TrellisDisplay.from_estimator(pipe, bunch.data, trial=1)
    left, right, bottom, top = display.image_.get_extent()
    assert (left, right) == (-0.5, 29.5)
    assert (bottom, top) == (display.space.offsets[0] - 0.5, display.space.offsets[-1] + 0.5)
    assert f"pattern {pipe[2].pattern_index_}" in display.axes_[0].get_xlabel()
    assert "trial 1" in display.axes_[0].get_title()
    points = pipe[:2].transform(bunch.data)
    np.testing.assert_array_equal(display.warp_.get_ydata(), pipe[2].match(points).offsets[1])


def test_trellis_of_the_second_synchronizer(bunch):
    """The trials are those that the first synchronizer returns, which has no trellis."""
    X = [x[:, :3] for x in bunch.data]
    linear, dense = LinearSynchronizer(25), DenseSynchronizer(20)
    pipe = make_pipeline(linear, dense).fit(X)
    display = TrellisDisplay.from_estimator(pipe, X, trial=4)
    expected = TrellisDisplay.from_estimator(dense, linear.transform(X), trial=4)
    np.testing.assert_array_equal(display.space.costs, expected.space.costs)
    np.testing.assert_array_equal(display.warp_.get_ydata(), expected.warp_.get_ydata())
    with pytest.raises(ValueError, match="no DenseSynchronizer in LinearSynchronizer"):
        TrellisDisplay.from_estimator(linear, X)


def test_disparity_space_of_long_takes_is_subsampled(bunch, pipe, monkeypatch):
    points = pipe[:2].transform(bunch.data)
    whole = TrellisDisplay.from_estimator(pipe[2], points, trial=1)
    monkeypatch.setattr(
        "sklearn_motionsync.matching.matcher.BATCH_NUMBERS", whole.space.costs.size // 7
    )
    thin = TrellisDisplay.from_estimator(pipe[2], points, trial=1)
    np.testing.assert_array_equal(thin.space.frames, np.arange(0, 30, 3))
    np.testing.assert_array_equal(thin.space.offsets, np.arange(-12, 13, 3))
    columns = np.searchsorted(whole.space.offsets, thin.space.offsets)
    np.testing.assert_array_equal(thin.space.costs, whole.space.costs[::3, columns])
    np.testing.assert_array_equal(thin.path_.get_xydata(), whole.path_.get_xydata())
    assert thin.image_.get_extent() == [-1.5, 28.5, -13.5, 13.5]
