"""What a step costs, which steps there are, and the filters under which features are taken."""

import numpy as np
import pytest
from sklearn_motionsync import DenseSynchronizer
from sklearn_motionsync.matching.costs import step_table

PATHS = {"cost": "posture", "smoothness": 0, "consensus": 0, "max_offset": 1}


@pytest.mark.parametrize(
    ("max_rate", "subframes", "fastest"),
    [(1, 1, 1), (1.9, 1, 1), (2, 1, 2), (1.4, 2, 1), (1.5, 2, 1.5), (2.9, 3, 8 / 3), (3.5, 4, 3.5)],
)
def test_no_step_is_faster_than_the_largest_rate(max_rate, subframes, fastest):
    """A movement that is late runs as fast as it may, and no faster."""
    x = np.zeros((2, 41, 1))
    x[0, 8:], x[1, 28:] = 1, 1
    x[:, 33:] = np.arange(2, 10)[:, np.newaxis]
    sync = DenseSynchronizer(pattern=0, max_rate=max_rate, subframes=subframes, **PATHS).fit(x)
    assert np.diff(sync.match(x[1:]).times).max() == pytest.approx(fastest)
    table = step_table(max_rate=max_rate, subframes=subframes)
    assert sorted(table.steps) == [s for s in range(99) if s <= max_rate * subframes]
