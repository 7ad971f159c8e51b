"""Times of frames: the frame rate of even ones, whatever their digits, and what is not even."""

import warnings
from contextlib import nullcontext

import numpy as np
import pytest
from sklearn_motionsync.io.motion import describe_times

STEP = 0.02


def described(times, **params):
    """The attrs, which name no uneven times, without a warning."""
    facts = describe_times("a.trc", np.asarray(times, dtype=float), **params)
    assert "times" not in facts
    return facts


@pytest.mark.parametrize(("rate", "digits"), [(60, 2), (51.2, 2), (119.88, 3), (240, 3)])
@pytest.mark.parametrize("decimals", [None, 17])
def test_few_digits_are_even_and_show_each_lost_frame(rate, digits, decimals):
    times, of_file = np.round(12.34 + np.arange(60) / rate, digits), decimals or digits
    mean = 59 / (times[-1] - times[0])
    assert described(times, decimals=of_file)["frame_rate"] == pytest.approx(mean, rel=1e-5)
    stated = rate if decimals is None else None
    with pytest.warns(UserWarning, match="uneven"):
        describe_times("a", np.delete(times, 30), stated=stated, decimals=of_file)


@pytest.mark.parametrize("rate", [0.5, 23.976, 59.94, 120, 1000])
@pytest.mark.parametrize(("n_frames", "start"), [(2, 417), (3, -1), (1000, 417)])
def test_even_times_have_their_rate(rate, n_frames, start):
    times = start + np.arange(n_frames) / rate
    for decimals in (4, 6, 17):
        written = np.round(times, decimals)
        facts = described(written, decimals=decimals)
        blur = rate * 10.0**-decimals / (n_frames - 1)
        assert facts["frame_rate"] == pytest.approx(rate, rel=1.1 * blur + 1e-5)
        assert facts["first_time"] == written[0]
        # The stated one has more digits, and one per cent is no contradiction.
        for stated in (rate, 0.995 * rate, 1.005 * rate):
            facts = described(written, decimals=decimals, stated=stated)
            assert facts["frame_rate"] == stated


@pytest.mark.parametrize("share", [0.5, 0.98, 1.02, 2])
@pytest.mark.parametrize("n_frames", [2, 40])
def test_exact_times_count_more_than_another_stated_rate(share, n_frames):
    times = np.arange(n_frames) * STEP
    message = rf"^a\.trc: it says {50 * share:g} frames a second, but by its times there are 50, "
    with pytest.warns(UserWarning, match=message):
        facts = describe_times("a.trc", times, stated=50 * share)
    assert facts == {"frame_rate": 50, "first_time": 0}
    # The caller's rate replaces all others.
    given = described(times, stated=50 * share, frame_rate=7)["frame_rate"]
    assert (given, type(given)) == (7.0, float)


@pytest.mark.parametrize("decimals", [2, 3])
@pytest.mark.parametrize("n_frames", [2, 3, 5, 12])
def test_the_digits_bound_how_well_times_contradict_a_rate(decimals, n_frames):
    """A digit more or less of the duration is no contradiction, up to a quarter of a step."""
    for rate in (11, 24, 30, 60):
        times = np.round(3 + np.arange(n_frames) / rate, decimals)
        step = (times[-1] - times[0]) / (n_frames - 1)
        tolerance = min(10.0**-decimals / (n_frames - 1), step / 4)
        for share in (-1.1, -0.9, -0.3, 0.3, 0.9, 1.1):
            stated = 1 / (step + share * tolerance)
            agrees = abs(share) < 1 or abs(step * stated - 1) < 0.01
            with warnings.catch_warnings():
                warnings.simplefilter("ignore")
                found = describe_times("a", times, decimals=decimals, stated=stated)["frame_rate"]
            if not agrees:
                assert found != stated
            elif np.diff(times).max() < 1.9 * step:
                assert found == stated


@pytest.mark.parametrize("lost", [1, 2, 17, 38])
@pytest.mark.parametrize("stated", [None, 50])
def test_a_lost_frame_makes_times_uneven(lost, stated):
    times = np.delete(np.arange(41) * STEP, lost)
    message = r"^a\.trc: its times are uneven, in steps of 0\.02 to 0\.04 s, but frames count as"
    with pytest.warns(UserWarning, match=message):
        facts = describe_times("a.trc", times, stated=stated, decimals=3)
    assert facts == {"frame_rate": None, "first_time": 0.0, "times": times.tolist()}
    facts = describe_times("a.trc", times, stated=stated, decimals=3, frame_rate=50)
    assert facts == {"frame_rate": 50.0, "first_time": 0.0, "times": times.tolist()}


@pytest.mark.parametrize(("decimals", "most"), [(17, 0.1), (2, 0.35), (1, 0.45)])
def test_even_times_miss_their_places_by_a_tenth_of_a_step_and_half_a_digit(decimals, most):
    """At most by 0.45 of a step."""
    for off, even in ((most - 0.01, True), (most + 0.01, False)):
        times = (np.arange(41) + off * (-1.0) ** np.arange(41)) * STEP
        with nullcontext() if even else pytest.warns(UserWarning, match="uneven"):
            facts = describe_times("a.trc", times, decimals=decimals)
        assert facts["frame_rate"] == (50 if even else None)


def test_the_stated_rate_is_kept_in_steps_without_a_gap():
    """Times of a rate that jitter more than a tenth of a step."""
    for gap, kept in ((1.85, True), (1.95, False)):
        steps = np.full(40, STEP)
        steps[10:12] = gap * STEP, (2 - gap) * STEP
        with nullcontext() if kept else pytest.warns(UserWarning, match="uneven"):
            facts = describe_times("a.trc", np.r_[0, np.cumsum(steps)], stated=50.0)
        assert facts["frame_rate"] == (50 if kept else None)


def test_times_without_a_duration_have_the_stated_rate():
    for times in ([3.0], [3.0, 3.0], np.zeros(9), np.arange(9) * 1e-10):
        assert described(times, stated=50.0) == {"frame_rate": 50.0, "first_time": times[0]}
    assert described([3.0]) == {"frame_rate": None, "first_time": 3.0}
    with pytest.warns(UserWarning, match="in steps of 0 to 0 s"):
        facts = describe_times("a.trc", np.zeros(2))
    assert facts == {"frame_rate": None, "first_time": 0.0, "times": [0.0, 0.0]}
    assert described(np.arange(9) * 2e-9)["frame_rate"] == 5e8
