"""The score of intervals: true warps of phases, what an interval holds, ranks inside events."""

from types import SimpleNamespace

import numpy as np
import pytest

FRAMES = np.arange(100.0)


@pytest.fixture(scope="module")
def intervals(benchmark):
    return benchmark("intervals")


def test_true_warps_of_phases(intervals):
    """A trial whose phase is the square of time shows the phase of the other at its root."""
    shares = np.linspace(0, 1, 5001)
    (same, late) = intervals.warps_of_phases([shares, shares**2], 0)
    np.testing.assert_allclose(same, FRAMES, atol=1e-9)
    np.testing.assert_allclose(late, 99 * np.sqrt(FRAMES / 99), atol=1e-2)


def test_what_intervals_hold(intervals):
    """Of errors of one to four frames those of up to two are inside."""
    errors = np.array([1.0, 2, 3, 4])[:, np.newaxis]
    match = SimpleNamespace(times=FRAMES + errors, doubtful=np.array([False, False, False, True]))
    match.interval = lambda coverage: (match.times - 2, match.times + 2)
    truth = np.tile(FRAMES, (4, 1))
    error, width, doubtful, *held = intervals.held(match, truth, slice(None))
    assert (error, width, doubtful) == (2.5, 2, 0.25)
    assert held == [0.5] * 3


def test_ranks_are_taken_inside_each_event(intervals):
    """Both events rank errors rightly, though the widths of one are those of the other doubled."""
    errors = np.arange(1.0, 31)
    small, large = (np.column_stack([errors, width * errors]) for width in (1, 2))
    assert intervals.rank_correlation([small, large, small[:5, ::-1]]) == pytest.approx(1)
    assert intervals.rank_correlation([small * [1, -1], large]) == pytest.approx(0)
