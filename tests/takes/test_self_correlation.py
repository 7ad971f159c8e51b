"""self_correlation: by its formula, and on takes of known period."""

import numpy as np
import pandas as pd
import pytest
from scipy.ndimage import gaussian_filter1d
from sklearn_motionsync import to_frame
from sklearn_motionsync.takes import self_correlation
from sklearn_motionsync.takes.self_correlation import correlate, rejection_reason

import oracle


def waves(n_frames, period, n_features=4, seed=0):
    rng = np.random.default_rng(seed)
    t = np.arange(n_frames)[:, np.newaxis] / period
    return sum(
        rng.normal(size=n_features) / k * np.sin(2 * np.pi * (k * t + rng.uniform(size=n_features)))
        for k in (1, 2, 3)
    )


def by_the_formula(x, lag):
    a, b = x[: len(x) - lag], x[lag:]
    a, b = a - a.mean(axis=0), b - b.mean(axis=0)
    return (a * b).sum() / np.sqrt((a * a).sum() * (b * b).sum())


@pytest.mark.parametrize("drift", [0.0, 3.0, 40.0])
def test_correlation_of_a_drifting_curve_is_pearsons_at_every_lag(drift):
    """Of the curve smoothed as docs/design.md says, and of its derivative."""
    t = np.arange(400) / 400
    x = np.sin(14 * np.pi * t) + 0.5 * np.cos(28 * np.pi * t**1.1) + drift * (t - t**2 / 3)
    found = self_correlation(x[:, np.newaxis])
    assert len(found.correlation) == 0.7 * 400 + 1
    np.testing.assert_array_equal(found.correlation, (found.pose + found.velocity) / 2)
    change, bend = (np.square(np.diff(x, k)).mean() for k in (1, 2))
    width = np.sqrt(x.var() / (change - bend / 3)) / 4
    for order, correlation in enumerate((found.pose, found.velocity)):
        y = oracle.slow_filter(x[:, np.newaxis], width, order)[:, 0]
        expected = [np.corrcoef(y[: 400 - lag], y[lag:])[0, 1] for lag in range(len(correlation))]
        np.testing.assert_allclose(correlation, expected, atol=1e-5)


@pytest.mark.parametrize("period", [9.6, 37.3, 250.0])
@pytest.mark.parametrize("n_cycles", [1.65, 12.0])
def test_period_of_waves(period, n_cycles):
    found = self_correlation(waves(round(n_cycles * period), period))
    assert found.period == pytest.approx(period, rel=0.02)
    assert found.n_cycles == pytest.approx(n_cycles, rel=0.03)
    assert found.strength > 0.9


def test_unit_offset_and_precision_do_not_change_the_period():
    x = waves(200, 41)
    expected = self_correlation(x)
    for other in (1e-6 * x, x + 1e6, x.astype(np.float32), pd.DataFrame(x)):
        found = self_correlation(other)
        assert found.period == pytest.approx(expected.period, rel=1e-4)
        assert found.strength == pytest.approx(expected.strength, rel=1e-4)


def test_noise_is_not_cyclic():
    noise = np.random.default_rng(1).normal(size=(400, 4))
    assert self_correlation(noise).strength < 0.3
    drift = gaussian_filter1d(np.random.default_rng(2).normal(size=(400, 4)), 60, axis=0)
    assert self_correlation(drift / drift.std() + 0.05 * noise).strength < 0.3


@pytest.mark.parametrize(("size", "lost"), [(0.3, 0.02), (0.6, 0.07)])
def test_strength_is_robust_to_white_noise(size, lost):
    rng = np.random.default_rng(4)
    path = gaussian_filter1d(rng.normal(size=(320, 4)), 12, axis=0)
    x = waves(320, 80)
    x = x / x.std() + 0.8 * path / path.std()
    expected = self_correlation(x)
    noisy = x + size * x.std() * rng.normal(size=x.shape)
    found = self_correlation(noisy)
    assert 0.6 < expected.strength < 0.8
    assert found.strength == pytest.approx(expected.strength, abs=lost)
    assert found.period == pytest.approx(expected.period, rel=0.02)
    assert rejection_reason(correlate(noisy), 0.4) == ""


def test_peaks_are_positive_maxima_after_a_fall():
    """Below half their height, of the poses; ripples on the way down are none."""
    noise = np.random.default_rng(3).normal(size=(300, 2))
    ripple = np.sin(np.arange(300)[:, np.newaxis] / 1.7 + np.arange(2))
    left_out = 0
    for x in (waves(300, 250, 2) + 0.1 * ripple, waves(300, 60, 2) + 0.8 * noise, noise):
        found = self_correlation(x)
        r, expected = found.correlation, []
        for lag in range(1, len(r) - 1):
            if r[lag - 1] < r[lag] >= r[lag + 1]:
                fallen = min(found.pose[: lag + 1]) < 0.5 * r[lag]
                expected += [lag] if r[lag] > 0 and fallen else []
                left_out += not (r[lag] > 0 and fallen)
        assert found.peaks.tolist() == expected
    assert left_out > 3


def test_period_and_strength_are_those_of_the_parabola_through_a_peak():
    found = self_correlation(waves(200, 11.4))
    at = found.peaks[np.abs(found.peaks - found.period).argmin()]
    a, b, c = np.polyfit([-1, 0, 1], found.correlation[at - 1 : at + 2], 2)
    assert found.period == pytest.approx(at - b / (2 * a))
    assert found.strength == pytest.approx(c - b * b / (4 * a))
    assert found.strength > found.correlation[at] + 1e-3


def test_at_most_half_of_a_sum_is_noise():
    """Of a slow wave under noise, whose velocities are mostly noise."""
    x = waves(1800, 900, 3) + 0.3 * np.random.default_rng(0).normal(size=(1800, 3))
    found = self_correlation(x)
    change, bend = (np.square(np.diff(x, k, axis=0)).sum() / (1800 - k) for k in (1, 2))
    width = np.sqrt(x.var(axis=0).sum() / max(change - bend / 3, change / 100)) / 4
    velocity = oracle.slow_filter(x, width, 1)
    for lag in (300, 450, 600):
        assert found.velocity[lag] == pytest.approx(2 * by_the_formula(velocity, lag), rel=1e-6)


def test_standing_still_correlates_with_nothing():
    """Rounding errors of what stands do not count."""
    moving = waves(200, 40)
    x = np.concatenate([np.repeat(moving[:1], 200, axis=0), moving]) + 1e6 / 3
    found = self_correlation(x)
    # Beyond, the earlier frames of an overlap stand still, but for the reach of the filter.
    assert (found.correlation[240:] == 0).all()


@pytest.mark.parametrize("n_frames", [2, 3, 4, 7])
def test_still_or_very_short_takes_have_no_period(n_frames):
    for x in (np.zeros((n_frames, 2)), np.full((n_frames, 1), 1e9), waves(n_frames, 50)):
        found = self_correlation(x)
        assert np.isnan(found.period)
        assert (found.strength, found.n_cycles, len(found.peaks)) == (0, 0, 0)
        assert np.isfinite(found.correlation).all()


@pytest.mark.parametrize(
    ("take", "message"),
    [
        (np.zeros(5), r"shape \(5,\)"),
        (np.zeros((1, 3)), "at least 2 frames"),
        (np.full((9, 2), np.nan), "NaN"),
        (np.zeros((2, 9, 2)), "Give one take, .* got 2 trials"),
        ([np.zeros((9, 2)), np.zeros((7, 2))], "got 2 trials; for several"),
        (to_frame([np.zeros((9, 2)), np.ones((7, 2))]), "got 2 trials"),
        ([["a"], ["b"]], "numeric"),
    ],
)
def test_refuses_other_than_one_take(take, message):
    with pytest.raises(ValueError, match=message):
        self_correlation(take)


def test_breadth_is_the_effective_number_of_dimensions():
    """Of poses: the velocities of the two waves have the variances 1 and 4."""
    found = correlate(np.eye(8)[np.arange(160) // 5 % 8])
    assert 5 < found.breadth <= 7
    assert correlate(np.sin(np.arange(100.0))[:, np.newaxis]).breadth == pytest.approx(1)
    t = 2 * np.pi * np.arange(1000) / 200
    found = self_correlation(np.column_stack([np.sin(t), np.sin(2 * t)]))
    assert found.breadth == pytest.approx(2, abs=0.05)


# -- several cycles fit -------------------------------------------------------------------------


def beats(strengths, period=40, n_steps=16, seed=0):
    """Steps of one shape, whose strengths repeat."""
    step = waves(period, period, seed=seed)
    return np.concatenate([strengths[k % len(strengths)] * step for k in range(n_steps)])


@pytest.mark.parametrize(
    ("strengths", "expected"),
    [
        ((1,), [40]),
        ((1, 0.3), [40, 80]),
        ((1, 0.25, 0.45, 0.25), [40, 80, 160]),
        # The strength of two steps is within a tenth of that of three, of which it is no multiple.
        ((1, 1, 0.2), [40, 120]),
    ],
)
@pytest.mark.parametrize("seed", [0, 1, 2])
def test_periods_are_those_of_all_cycles_that_fit(strengths, expected, seed):
    found = self_correlation(beats(strengths, seed=seed))
    np.testing.assert_allclose(found.periods, expected, rtol=0.03)
    assert found.period in found.periods


def test_ripples_and_multiples_are_no_other_cycles():
    noise = np.random.default_rng(0).normal(size=(600, 4))
    for size in (0.1, 0.5):
        found = self_correlation(waves(600, 60) + size * noise)
        assert found.periods.tolist() == [found.period]
    assert self_correlation(np.zeros((30, 2))).periods.tolist() == []


@pytest.mark.parametrize(
    ("limits", "expected"), [((20, 60), 40), ((60, 100), 80), ((140, 180), 160)]
)
def test_limits_select_the_period(limits, expected):
    found = correlate(beats((1, 0.25, 0.45, 0.25)), limits)
    assert found.period == pytest.approx(expected, rel=0.02)
    assert found.periods.tolist() == [found.period]
    assert np.isnan(correlate(beats((1,)), (3, 9)).period)
