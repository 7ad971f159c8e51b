"""The score of intervals: ranks inside events."""

import numpy as np
import pytest


@pytest.fixture(scope="module")
def intervals(benchmark):
    return benchmark("intervals")


def test_ranks_are_taken_inside_each_event(intervals):
    """Both events rank errors rightly, though the widths of one are those of the other doubled."""
    errors = np.arange(1.0, 31)
    small, large = (np.column_stack([errors, width * errors]) for width in (1, 2))
    assert intervals.rank_correlation([small, large, small[:5, ::-1]]) == pytest.approx(1)
    assert intervals.rank_correlation([small * [1, -1], large]) == pytest.approx(0)
