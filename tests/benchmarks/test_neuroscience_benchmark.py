"""Trials of spike counts, as the benchmark makes and judges them."""

import numpy as np
import pytest


@pytest.fixture(scope="module")
def neuroscience(benchmark):
    return benchmark("neuroscience")


def test_pattern_is_sampled_between_bins_and_held_beyond_its_ends(neuroscience):
    rng = np.random.default_rng(0)
    pattern = rng.random((neuroscience.BINS, 3))
    positions = rng.uniform(-20, neuroscience.BINS + 20, (4, 50))
    bins = np.arange(neuroscience.BINS)
    expected = [[np.interp(one, bins, neuron) for neuron in pattern.T] for one in positions]
    found = neuroscience.sample(pattern, positions)
    np.testing.assert_allclose(found, np.swapaxes(expected, 1, 2), rtol=0, atol=1e-12)


def test_average_of_trials_without_warp_is_their_smoothed_mean(neuroscience):
    counts, positions = neuroscience.make_trials(0, "no warp")
    mean = counts.mean(axis=0)
    width = neuroscience.AVERAGED
    kernel = np.exp(-0.5 * (np.arange(-4, 5) / width) ** 2)
    expected = np.apply_along_axis(np.convolve, 0, mean, kernel / kernel.sum(), mode="valid")
    found = neuroscience.average(counts, positions)[4:-4]
    np.testing.assert_allclose(found, expected, rtol=0, atol=1e-3)


@pytest.mark.parametrize("kind", ["one knot", "shift"])
def test_true_warps_explain_most_of_counts_that_were_held_out(neuroscience, kind):
    counts, positions = neuroscience.make_trials(1, kind)
    assert (np.diff(positions, axis=1) >= 0).all()
    true = neuroscience.held_out_r2(counts, positions)
    wrong = neuroscience.held_out_r2(counts, positions[::-1])
    assert true > 5 * max(wrong, neuroscience.held_out_r2(counts, neuroscience.unaligned(counts)))


def test_held_out_share_equals_its_definition(neuroscience):
    rng = np.random.default_rng(2)
    counts = rng.poisson(0.5, (10, neuroscience.BINS, 2)).astype(float)
    positions = neuroscience.unaligned(counts)
    missed = total = 0.0
    for k in range(neuroscience.FOLDS):
        known = np.delete(counts, slice(k, None, neuroscience.FOLDS), axis=0)
        pattern = neuroscience.average(known, positions[: len(known)])
        for trial in counts[k :: neuroscience.FOLDS]:
            missed += ((trial - pattern) ** 2).sum()
            total += ((trial - known.mean(axis=(0, 1))) ** 2).sum()
    assert neuroscience.held_out_r2(counts, positions) == pytest.approx(1 - missed / total)
    assert missed > total  # there is nothing to be explained
