"""Refinement and its test: folds of features, the verdict, and the Gauss-Newton steps."""

import numpy as np
import pytest
from scipy.stats import ttest_1samp
from sklearn_motionsync.matching.filters import smooth
from sklearn_motionsync.matching.refinement import (
    refine_warps,
    slow_energy,
    typical_energy,
)
from sklearn_motionsync.matching.refinement_test import Verdict, split_features


def features(*columns):
    return np.stack(columns, axis=-1)[np.newaxis]


T = np.linspace(0, 1, 200)
SINE, COSINE, RAMP = np.sin(9 * T), np.cos(9 * T), T - 0.5


def test_correlated_features_are_in_one_fold():
    noise = np.random.default_rng(0).standard_normal((2, 200))
    folds = split_features(features(SINE, COSINE, SINE + 0.1 * noise[0], -3 * COSINE, 0 * T + 7))
    assert sorted(fold.tolist() for fold in folds) == [[0, 2], [1, 3]]


@pytest.mark.parametrize(
    "columns", [[SINE], [SINE, 0 * T], [SINE, -SINE], [0 * T, 0 * T], [SINE, SINE + 0.2 * COSINE]]
)
def test_correlated_features_give_no_folds(columns):
    assert split_features(features(*columns)) == []


def test_folds_are_of_equal_energy():
    folds = split_features(features(3 * SINE, 2.9 * COSINE, np.sin(31 * T), np.sin(57 * T)))
    assert sorted(fold.tolist() for fold in folds) == [[0, 3], [1, 2]]


def verdict(ratios, to_all=1.0):
    """Of the ratios of misfits after refining to those before, of pairs of folds."""
    ratios = np.reshape(ratios, (-1, 2))
    return Verdict.of(np.stack([ratios / to_all, np.ones_like(ratios), ratios]), 10.0)


def test_p_value_is_that_of_a_moderated_t_test():
    """With many values the prior hardly counts; with few it does."""
    rng = np.random.default_rng(0)
    ratios = np.exp(-0.05 + 0.4 * rng.standard_normal(400))
    expected = ttest_1samp(np.log(ratios), 0, alternative="less").pvalue
    assert verdict(ratios).p_value == pytest.approx(expected, rel=0.05)
    assert verdict(ratios).ratio == pytest.approx(np.exp(np.log(ratios).mean()))
    # Two values alike: variance of 0.1 ** 2 with 2 degrees, and none of their own with one.
    few = verdict([0.7, 0.7])
    t = np.log(0.7) / np.sqrt(2 * 0.1**2 / 3 / 2)
    exact = 0.5 - np.arctan(t / -np.sqrt(3)) / np.pi + t / np.sqrt(3) / (1 + t * t / 3) / np.pi
    assert few.p_value == pytest.approx(exact)


@pytest.mark.parametrize(
    ("ratios", "to_all", "helps"),
    [
        ([0.5] * 6, 1.0, True),
        ([0.5] * 6, 1.19, True),
        ([0.5] * 6, 1.21, False),
        ([1.1] * 6, 0.5, False),
        ([0.97, 1.02, 0.95, 1.01, 0.99, 1.0], 1.0, False),
        ([0.01, 0.02], 0.5, True),
    ],
)
def test_verdict_needs_significance_and_a_ratio(ratios, to_all, helps):
    assert verdict(ratios, to_all).helps is helps


def test_perfect_matches_have_no_p_value():
    for misfits in (np.zeros((3, 4, 2)), np.ones((3, 4, 2)) * [[[0]], [[1]], [[1]]]):
        found = Verdict.of(misfits, 1.0)
        assert np.isnan(found.p_value)
        assert not found.helps


def test_misfit_is_the_median_share():
    by_all = np.array([[1.0, 1.0], [2.0, 0.0], [5.0, 5.0]])
    assert Verdict.of(np.stack([by_all, by_all, by_all]), 4.0).misfit == 0.5


@pytest.mark.parametrize("width", [0.0, 1.0, 2.0, 4.0])
def test_typical_energy_is_that_of_independent_features(width):
    """Also if noise was smoothed, and of few frames."""
    rng = np.random.default_rng(0)
    noise = rng.standard_normal((100, 200, 8))
    # Away from the ends, where smoothing is another one.
    curves = (smooth(noise, width) if width else noise)[:, 40:160]
    independent = 120 / max(1, np.sqrt(2 * np.pi) * width)
    each = np.square(curves).sum(axis=1).mean()
    typical = typical_energy(curves, independent)
    assert typical.mean() == pytest.approx(each, rel=0.07)
    # Neither still features nor more of the same make a difference, if copies are 0.
    more = np.concatenate([curves, np.zeros((100, 120, 5))], axis=2)
    np.testing.assert_allclose(typical_energy(more, independent), typical)
    together = curves[:, :, :1] * np.ones(8)
    assert typical_energy(together).mean() == pytest.approx(8 * each, rel=0.1)


# -- the steps ------------------------------------------------------------------------------


def test_more_noise_gives_stiffer_warps():
    P = 41
    frames = np.arange(P, dtype=float)
    base = np.column_stack([np.sin(frames / 6), np.cos(frames / 5)])
    rng = np.random.default_rng(0)
    moving = base + 0.05 * rng.standard_normal(base.shape)
    start = frames[np.newaxis]
    rough = refine_warps(base, moving[np.newaxis], start, 10.0)[0] - frames
    exact = refine_warps(base, base[np.newaxis], start, 10.0)[0] - frames
    assert np.abs(exact).max() == 0
    assert 0 < np.abs(rough).max() < 2
    # Twice the noise, stiffer warps: the change of pace grows less than twice.
    noisier = base + 0.1 * (moving - base) / 0.05
    more = refine_warps(base, noisier[np.newaxis], start, 10.0)[0] - frames
    curved = [np.square(np.diff(x, 2)).sum() for x in (rough, more)]
    assert curved[1] < 4 * curved[0]


def test_constant_postures_leave_warps_unchanged():
    start = np.linspace(0, 29, 30)[np.newaxis] ** 1.1
    start *= 29 / start.max()
    still, moving = np.zeros((30, 2)), np.ones((1, 30, 2))
    np.testing.assert_array_equal(refine_warps(still, moving, start, 29.0), start)
    rng = np.random.default_rng(0)
    np.testing.assert_array_equal(
        refine_warps(rng.standard_normal((30, 2)), moving, start, 29.0), start
    )
    assert slow_energy(still, moving, start) == 0


@pytest.mark.parametrize("reach", [3.0, 39.0])
def test_refined_warps_stay_in_the_band(reach):
    """Also for unrelated postures."""
    rng = np.random.default_rng(0)
    frames = np.arange(40)
    base = np.cumsum(rng.standard_normal((40, 2)), axis=0)
    moving = np.cumsum(rng.standard_normal((60, 40, 2)), axis=1)
    # Half of them are the same, but late.
    moving[:30] = base[np.maximum(frames - 5, 0)]
    moving[:30] += 0.3 * rng.standard_normal((30, 40, 2))
    start = np.tile(frames.astype(float), (60, 1))
    times = refine_warps(base, moving, start, reach)
    assert (np.diff(times) >= 0).all()
    assert (times[:, [0, -1]] == [0, 39]).all()
    assert np.abs(times - frames).max() <= reach
    assert np.abs(times - frames)[:30].max() > 2.5
