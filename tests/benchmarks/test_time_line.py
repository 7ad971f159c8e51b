"""The score of moments on one common time line, of warps and moments that are known."""

import numpy as np
import pytest

FRAMES = np.arange(100.0)


@pytest.fixture(scope="module")
def harness(benchmark):
    return benchmark("harness")


@pytest.fixture(scope="module")
def accuracy(benchmark):
    return benchmark("accuracy")


@pytest.fixture
def powers():
    """Warps of four clips: frame p of the template is frame 99 (p / 99)^k of a clip."""
    return np.array([99 * (FRAMES / 99) ** k for k in (0.5, 0.8, 1.25, 2.0)])


def test_true_warps_have_no_error_and_no_spread(harness, powers):
    for at in (7, 50, 93):
        errors, spread = harness.on_time_line(powers, powers[:, at])
        assert len(errors) == 12
        np.testing.assert_allclose(errors, 0, rtol=0, atol=1e-4)
        assert spread == pytest.approx(0, abs=1e-4)


def test_warps_that_are_late_miss_by_what_they_are_late(harness):
    moments, late = np.array([40.0, 44, 49, 61]), np.array([0.0, 3, 9, 17])
    # On the time line: 40, 41, 40 and 44. The six distances, each of two pairs, are 0 to 4.
    errors, spread = harness.on_time_line(FRAMES + late[:, np.newaxis], moments)
    np.testing.assert_allclose(np.sort(errors)[::2], [0, 1, 1, 3, 4, 4], rtol=0, atol=1e-4)
    np.testing.assert_allclose(np.sort(errors)[1::2], [0, 1, 1, 3, 4, 4], rtol=0, atol=1e-4)
    # The mean is 41.25; squares of the departures sum to 10.75.
    assert spread == pytest.approx(np.sqrt(10.75 / 3), abs=1e-4)


def test_error_is_counted_in_the_frames_of_the_clip_it_lands_in(harness):
    # The second clip is twice as fast: its frame 30 is frame 60 of the time line.
    times = np.array([FRAMES, FRAMES / 2])
    errors, spread = harness.on_time_line(times, np.array([50.0, 30.0]))
    np.testing.assert_allclose(np.sort(errors), [5, 10], rtol=0, atol=1e-4)
    assert spread == pytest.approx(10 / np.sqrt(2), abs=1e-4)


def test_clips_without_the_moment_are_left_out(harness, powers):
    moments = np.where([True, False, True, True], powers[:, 30], np.nan)
    errors, spread = harness.on_time_line(powers, moments)
    assert len(errors) == 6
    assert spread == pytest.approx(0, abs=1e-4)


def test_moment_at_which_a_warp_stands_still_lies_within_the_pause(harness):
    pause = np.concatenate([FRAMES[:41], np.full(20, 40.0), np.linspace(40, 99, 39)])
    errors, spread = harness.on_time_line(np.array([FRAMES, pause]), np.array([50.0, 40.0]))
    # From the pause to the other clip: frames 40 to 60, so at most 10 from its moment.
    assert max(errors) <= 10 + 1e-4
    assert spread <= 10 / np.sqrt(2) + 1e-4


@pytest.mark.parametrize(
    ("after", "sd", "expected"),
    [([1.0, 2], 3.0, ""), ([1.0, 4], 3.0, "error"), ([1.0, 2], 3.5, "spread")],
)
def test_moments_that_are_harmed_are_named(accuracy, after, sd, expected):
    assert accuracy.harm((np.array([1.0, 3]), 3.2), (np.array(after), sd)) == expected
