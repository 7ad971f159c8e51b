"""What measures refuse, what they answer where little can be said, and that units are nothing."""

import numpy as np
import pandas as pd
import pytest
from sklearn_motionsync import to_frame
from sklearn_motionsync.metrics import (
    amplitude_phase_variance,
    group_timing_error,
    inverse_consistency,
    keyframe_error,
    least_squares,
    pairwise_correlation,
    pause_share,
    roughness,
    sobolev_least_squares,
    timing_error,
)

NAN, INF = np.nan, np.inf
SPREADS = [least_squares, sobolev_least_squares, pairwise_correlation]
STRAIGHT = [[0, 1, 2, 3, 4.0]]
# Each measure of warps, as a function of warps on five frames.
OF_TIMES = {
    "timing_error": lambda times: timing_error(times, np.zeros(np.shape(times))),
    "true_times": lambda times: timing_error(np.zeros(np.shape(times)), times),
    "group": lambda times: group_timing_error(times, [[0, 0.5, 1]]),
    "keyframe_error": lambda times: keyframe_error(times, [[5]], [2], [9]),
    "pause_share": pause_share,
    "roughness": roughness,
    "inverse": lambda times: inverse_consistency(times, np.zeros(np.shape(times))),
    "back": lambda times: inverse_consistency(np.zeros(np.shape(times)), times),
}

BAD_TIMES = [
    ([[0, NAN, 2, 3, 4]], r"Performance 0: .*times|back.* must be from 0 to P - 1 = 4.*nan at"),
    ([[NAN] * 5], "got nan at frame 0"),
    ([[0, 1, 2, 3, INF]], "got inf at frame 4"),
    ([[0, 1, 2, 3, 4.1]], "got 4.1 at frame 4"),
    ([[-0.1, 1, 2, 3, 4]], "got -0.1 at frame 0"),
    ([0, 1, 2, 3, 4], r"shape \(n_sequences, P\).*got \(5,\)"),
    ([[0]], r"P at least 2, got \(1, 1\)"),
    (np.zeros((0, 5)), r"got \(0, 5\)"),
    (np.zeros((1, 5, 1)), r"got \(1, 5, 1\)"),
    ([["0", "1", "2", "3", "4"]], "not a numeric array"),
    ([[0, 1j, 2, 3, 4]], "complex"),
    (np.ma.masked_equal(STRAIGHT, 2), "masked"),
    (np.array(STRAIGHT).astype("m8[s]"), "dates or durations"),
]


@pytest.mark.parametrize("measure", OF_TIMES.values(), ids=OF_TIMES)
@pytest.mark.parametrize(("times", "message"), BAD_TIMES)
def test_warps_are_checked_by_every_measure_of_them(measure, times, message):
    with pytest.raises(ValueError, match=message):
        measure(times)


@pytest.mark.parametrize("measure", OF_TIMES.values(), ids=OF_TIMES)
def test_warps_of_any_kind(measure):
    times = np.array([[0, 0, 2, 3, 4]])
    expected = measure(times)
    frozen = times.astype(np.float64)
    frozen.flags.writeable = False
    kinds = [times.tolist(), pd.DataFrame(times), times.astype(object), times.astype(np.float32)]
    for kind in [*kinds, np.asfortranarray(times), np.ma.array(times), frozen]:
        assert measure(kind) == expected
    # What rounding has done to somebody's warps is none of our business.
    assert measure(times + [[-1e-15, 0, 0, 0, 1e-15]]) == pytest.approx(expected, abs=1e-12)


def test_warps_may_step_back():
    assert pause_share([[0, 2, 2 - 1e-12, 1, 4]]) == 0.5
    assert roughness([[0, 2, 1, 3, 4]]) == pytest.approx(np.sqrt((9 + 9 + 1) / 3))
    assert inverse_consistency([[0, 2, 1, 3, 4]], STRAIGHT) == pytest.approx(0.4)


def test_two_frames_have_one_rate():
    assert roughness([[0, 1]]) == pause_share([[0, 1]]) == 0


K = [[5]], [2], [9]


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (([[NAN]], [2], [9]), r"Performance 0: key-frames .* from 0 to 8, in its own .*nan"),
        (([[8.5]], [2], [9]), r"from 0 to 8.*\[8.5\]"),
        (([[-1]], [2], [9]), "Performance 0: key-frames"),
        (([[5, 4]], [1, 2], [9]), "Performance 0: key-frames must increase"),
        (([[4, 5]], [2, 1], [9]), "The pattern: key-frames must increase"),
        (([[5]], [4.5], [9]), "The pattern: .* from 0 to 4, in frames of the clock"),
        (([[5]], [NAN], [9]), "The pattern"),
        (([[5]], 2, [9]), r"pattern_keyframes must have shape \(n_keyframes,\)"),
        (([[]], [], [9]), "at least one"),
        (([[5], [5]], [2], [9]), "do not go with keyframes of 2 performances"),
        (([5], [2], [9]), r"performance 0 has shape \(\)"),
        (([[5, 6]], [2], [9]), r"performance 0 has shape \(2,\)"),
        ((5, [2], [9]), "list of arrays, one a performance, got int"),
        (("lift", [2], [9]), "got str"),
        (([["lift"]], [2], [9]), "Performance 0: keyframes is not a numeric"),
        (([np.ma.masked_equal([5], 5)], [2], [9]), "masked"),
        (([[5]], [2], [1]), "Performance 0: n_frames must be a whole number of at least 2, got 1"),
        (([[5]], [2], [9.5]), "got 9.5"),
        (([[5]], [2], [NAN]), "got nan"),
        (([[5]], [2], [INF]), "got inf"),
        (([[5]], [2], [9, 9]), "n_frames must hold the lengths of the 1 performances"),
        (([[5]], [2], 9), "n_frames must hold the lengths"),
    ],
)
def test_key_frames_are_inside_their_clips(arguments, message):
    with pytest.raises(ValueError, match=message):
        keyframe_error(STRAIGHT, *arguments)


@pytest.mark.parametrize("frame_rate", [0, -5, NAN, INF, [50, 50], [], "fast", 1j, 1e-320])
def test_frame_rates_are_above_0(frame_rate):
    with pytest.raises(ValueError, match=r"frame_rate"):
        keyframe_error(STRAIGHT, *K, frame_rate=frame_rate)


def test_frame_rates_one_a_performance_and_key_frames_of_any_kind():
    times = STRAIGHT * 2
    expected = (0.1 + 0.2) / 2
    objects = np.empty(2, dtype=object)
    objects[:] = [np.array([5]), [5]]
    for keyframes in ([[5], [5]], objects, pd.DataFrame([[5], [5]]), np.full((2, 1), 5, "i4")):
        error = keyframe_error(times, keyframes, [2], [9, 9], frame_rate=[10, 5])
        assert error == pytest.approx(expected)
    assert keyframe_error(STRAIGHT, [[0, 8]], [0, 4], [9]) == 0


@pytest.mark.parametrize("quantile", [-0.1, 1.1, NAN, [0.5], "median"])
def test_quantiles_are_shares(quantile):
    for measure in (
        lambda q: timing_error(STRAIGHT, STRAIGHT, quantile=q),
        lambda q: group_timing_error(STRAIGHT, [[0, 1]], quantile=q),
        lambda q: keyframe_error(STRAIGHT, *K, quantile=q),
    ):
        with pytest.raises(ValueError, match="quantile"):
            measure(quantile)


@pytest.mark.parametrize(
    ("moments", "message"),
    [
        ([[0, 1.5]], "Performance 0: moments are shares.*got 1.5 at frame 1"),
        ([[-0.5, 1]], "got -0.5 at frame 0"),
        ([[0, NAN, 1]], "got nan at frame 1"),
        ([[0, 0.5, 0.4, 1]], "must not decrease.*after frame 1"),
        ([[0]], r"at least 2, got \(1,\)"),
        ([[[0, 1]]], r"got \(1, 2\)"),
        ([0, 1], "1 warps and 2 sets"),
        ([["0", "1"]], "Performance 0: moments is not a numeric"),
        ({"a": [0, 1]}, "got dict"),
        (None, "got NoneType"),
    ],
)
def test_moments_are_shares_of_the_action(moments, message):
    with pytest.raises(ValueError, match=message):
        group_timing_error(STRAIGHT, moments)


def test_moments_of_any_kind():
    times = STRAIGHT * 2
    moments = np.array([[0, 0.5, 1], [0, 0.7, 1]])
    expected = group_timing_error(times, moments.tolist())
    for kind in (moments, pd.DataFrame(moments), tuple(moments), iter(moments)):
        assert group_timing_error(times, kind) == expected
    assert group_timing_error(STRAIGHT, [[0, 0.2, 1]]) == 0


# -- spread -----------------------------------------------------------------------------


def wavy(n=4, n_frames=20, n_features=3):
    rng = np.random.default_rng(5)
    base = np.cumsum(rng.standard_normal((n_frames, n_features)), axis=0)
    return base + 0.3 * rng.standard_normal((n, n_frames, n_features))


def with_gap(value):
    x = wavy()
    x[2, 7, 1] = value
    return x


@pytest.mark.parametrize("measure", [*SPREADS, amplitude_phase_variance])
@pytest.mark.parametrize(
    ("bad", "message"),
    [
        (with_gap(NAN), "before, performance 2, frame 7, feature 1 is NaN"),
        (with_gap(INF), "is infinity"),
        (np.ma.masked_invalid(with_gap(NAN)), "masked"),
        (wavy() + 1j, "complex"),
        (wavy().astype(str), "not a numeric array"),
        (wavy().astype("M8[s]"), "dates"),
        (wavy()[:, :1], "of at least 2 sequences, 2 frames"),
        (wavy()[:1], "at least 2 sequences"),
        (wavy()[:, :, :0], "1 feature"),
        (wavy()[:, :, 0], r"x\[:, :, np.newaxis\]"),
        (np.empty((0, 20, 3)), "at least 2 sequences"),
        ([], "at least 2 sequences"),
        ([x[:k] for x, k in zip(wavy(), (20, 19, 18, 17), strict=True)], "on one clock"),
        ([x[:k].tolist() for x, k in zip(wavy(), (9, 8, 7, 6), strict=True)], "not a numeric"),
        (None, "must have one shape"),
    ],
)
def test_movements_are_checked_by_every_measure_of_spread(measure, bad, message):
    with pytest.raises(ValueError, match=message):
        measure(bad, bad)
    with pytest.raises(ValueError, match=r"before|after"):
        measure(wavy(), bad)


@pytest.mark.parametrize("measure", SPREADS)
def test_movements_of_any_kind(measure):
    x = wavy().astype(np.float32)
    y = x + (x.mean(axis=0) - x) / np.float32(2)
    expected = measure(x, y)
    objects = np.empty(len(x), dtype=object)
    objects[:] = list(x)
    frozen = x.astype(np.float64)
    frozen.flags.writeable = False
    frames = [pd.DataFrame(part) for part in x]
    for kind in (x.tolist(), list(x), objects, frozen, frames, to_frame(x), np.asfortranarray(x)):
        assert measure(kind, y) == pytest.approx(expected, rel=1e-12)
    assert measure(np.rint(x * 9).astype(int), np.rint(x * 9).astype(int)) == pytest.approx(1)


@pytest.mark.parametrize("measure", SPREADS)
@pytest.mark.parametrize("scale", [2.0**1020, 2.0**530, 2.0**-660, 2.0**-1000])
def test_spread_has_no_unit(measure, scale):
    x = wavy() / 16
    y = x + (x.mean(axis=0) - x) / 2
    assert measure(x * scale, y * scale) == pytest.approx(measure(x, y), rel=1e-12)


@pytest.mark.parametrize("scale", [1e160, 1e-200, 1e300, 1e-320])
def test_closed_forms_at_any_scale(scale):
    x = np.zeros((2, 3, 1))
    x[1, 1:] = 2 * scale
    assert least_squares(x, x / 2) == pytest.approx(0.25, rel=1e-3)
    assert sobolev_least_squares(x, x / 2) == pytest.approx(0.25, rel=1e-3)
    flat = np.full((2, 3, 1), scale)
    assert least_squares(x, flat) == sobolev_least_squares(x, flat) == 0


def test_a_share_beyond_double_precision_is_refused():
    x = wavy()
    for measure in SPREADS[:2]:
        with pytest.raises(ValueError, match="give both in one unit"):
            measure(x * 1e-150, x * 1e150)
        assert measure(x * 1e150, x * 1e-150) == 0


SAME = np.stack([wavy(1)[0]] * 3)
CONSTANT = np.full((3, 20, 2), 0.1)
# Nothing to gain, though rounding says otherwise: sums of three tenths, curves moved up by 5.
NOTHING = {
    "constant": (CONSTANT, CONSTANT),
    "zero": (0 * CONSTANT, 0 * CONSTANT),
    "rounded": (CONSTANT, CONSTANT + [[[0]], [[1e-17]], [[2e-17]]]),
    "single": (CONSTANT.astype(np.float32), CONSTANT.astype(np.float32) * np.float32(1 + 1e-7)),
    "two frames": (CONSTANT[:, :2], CONSTANT[:, :2]),
}


@pytest.mark.parametrize("measure", SPREADS)
@pytest.mark.parametrize("name", NOTHING)
def test_what_has_nothing_to_gain_has_no_gain(measure, name):
    assert measure(*NOTHING[name]) == 1


def test_identical_performances_have_nothing_to_gain():
    assert least_squares(SAME, SAME) == sobolev_least_squares(SAME, SAME) == 1
    moved = SAME + np.array([0, 5, 0.7])[:, np.newaxis, np.newaxis]
    assert sobolev_least_squares(moved, SAME) == 1
    assert pairwise_correlation(moved, SAME) == pytest.approx(1)


def test_the_one_in_the_middle_does_not_count():
    """0.1, 0.2, 0.3: the middle is no different from the mean of the others but for rounding."""
    x = np.array([0.1, 0.2, 0.3])[:, np.newaxis, np.newaxis] * np.ones((3, 5, 2))
    assert least_squares(x, x[[0, 0, 2]]) == pytest.approx((4 / 9 + 16 / 9) / 2)


@pytest.mark.parametrize("measure", SPREADS)
def test_no_share_of_nothing(measure):
    with pytest.raises(ValueError, match="before and are not after"):
        measure(CONSTANT, wavy(3, n_features=2))


def test_who_stands_still_correlates_with_none():
    x = np.array([[0, 1, 2.0], [0, 2, 1.0], [7, 7, 7.0]])[:, :, np.newaxis]
    assert pairwise_correlation(x, x[[0, 0, 2]]) == pytest.approx(2)
    assert pairwise_correlation(x, x[[2, 2, 2]]) == 0
