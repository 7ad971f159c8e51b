"""The refinement test of a fit: its first pass, and its size."""

import numpy as np
import pytest
from scipy.ndimage import gaussian_filter1d
from sklearn_motionsync import DenseSynchronizer
from sklearn_motionsync.matching.refinement_test import RefinementTest


@pytest.fixture
def calls(monkeypatch):
    """Numbers of performances that are refined, and of steps, call by call."""
    seen, misfits = [], RefinementTest.misfits

    def recorded(self, positions, *steps):
        seen.append((len(positions), *steps))
        return misfits(self, positions, *steps)

    monkeypatch.setattr(RefinementTest, "misfits", recorded)
    return seen


def one_source(n, noise=0.01):
    """Trials of one source of four features, at different paces."""
    rng, t = np.random.default_rng(0), np.linspace(0, 1, 60)
    curves = gaussian_filter1d(rng.standard_normal((300, 4)), 15, axis=0)
    curves /= curves.std()
    at = [t + b * np.sin(2 * np.pi * t) for b in rng.uniform(-0.05, 0.05, n)]
    frames = np.linspace(0, 1, 300)
    X = [np.column_stack([np.interp(s, frames, c) for c in curves.T]) for s in at]
    return [x + noise * rng.standard_normal(x.shape) for x in X]


def test_hopeless_refinement_ends_after_the_first_pass(calls):
    """Unrelated walks; every second one of ten others."""
    rng = np.random.default_rng(0)
    sync = DenseSynchronizer(60).fit(np.cumsum(rng.standard_normal((11, 60, 4)), axis=1))
    assert calls == [(5, 3)]
    assert not sync.refines_
    assert sync.refinement_.p_value > 0.1
    assert np.isnan([sync.misfit_, sync.refinement_.ratio_to_all]).all()


@pytest.mark.parametrize(
    ("n", "expected"), [(11, [(5, 3), (10,)]), (5, [(4, 3), (4,)]), (4, [(3, 3), (3,)])]
)
def test_promising_refinement_is_tested_on_all(n, expected, calls):
    sync = DenseSynchronizer(60).fit(one_source(n))
    assert calls == expected
    assert sync.refines_
    assert sync.refinement_.ratio < 0.5


def test_few_performances_have_no_first_pass(calls):
    DenseSynchronizer(60).fit(one_source(3))
    assert calls == [(2,)]
