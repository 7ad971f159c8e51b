"""The trial of refining: what it looks at first, and what it need not look at then."""

import numpy as np
import pytest
from scipy.ndimage import gaussian_filter1d
from sklearn_motionsync import DenseSynchronizer
from sklearn_motionsync.matching.refinement_test import RefinementTest


@pytest.fixture
def looks(monkeypatch):
    """How many performances were refined, by how many steps at most, each time."""
    seen, misfits = [], RefinementTest.misfits

    def noted(self, positions, *steps):
        seen.append((len(positions), *steps))
        return misfits(self, positions, *steps)

    monkeypatch.setattr(RefinementTest, "misfits", noted)
    return seen


def one_source(n, noise=0.01):
    """Trials of one source of four features, at paces of their own."""
    rng, t = np.random.default_rng(0), np.linspace(0, 1, 60)
    curves = gaussian_filter1d(rng.standard_normal((300, 4)), 15, axis=0)
    curves /= curves.std()
    at = [t + b * np.sin(2 * np.pi * t) for b in rng.uniform(-0.05, 0.05, n)]
    frames = np.linspace(0, 1, 300)
    X = [np.column_stack([np.interp(s, frames, c) for c in curves.T]) for s in at]
    return [x + noise * rng.standard_normal(x.shape) for x in X]


def test_without_hope_one_look_is_enough(looks):
    """Walks that have nothing to do with each other; every second one of ten others."""
    rng = np.random.default_rng(0)
    sync = DenseSynchronizer(60).fit(np.cumsum(rng.standard_normal((11, 60, 4)), axis=1))
    assert looks == [(5, 3)]
    assert not sync.refines_
    assert sync.refinement_.p_value > 0.1
    assert np.isnan([sync.misfit_, sync.refinement_.ratio_to_all]).all()


@pytest.mark.parametrize(
    ("n", "expected"), [(11, [(5, 3), (10,)]), (5, [(4, 3), (4,)]), (4, [(3, 3), (3,)])]
)
def test_with_hope_all_are_tried_to_the_end(n, expected, looks):
    sync = DenseSynchronizer(60).fit(one_source(n))
    assert looks == expected
    assert sync.refines_
    assert sync.refinement_.ratio < 0.5


def test_few_are_tried_at_once(looks):
    DenseSynchronizer(60).fit(one_source(3))
    assert looks == [(2,)]
