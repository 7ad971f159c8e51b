"""What the benchmarks share: events of known curves and of clips, and moments on one time line."""

import numpy as np
import pytest

T, FRAMES = np.linspace(0, 1, 101), np.arange(100.0)


@pytest.fixture(scope="module")
def harness(benchmark):
    return benchmark("harness")


@pytest.fixture(scope="module")
def accuracy(benchmark):
    return benchmark("accuracy")


def bump(at, width=0.08, height=1.0):
    return height * np.exp(-(((T - at) / width) ** 2))


def ramp(at):
    return 1 / (1 + np.exp(-40 * (T - at)))


@pytest.mark.parametrize(
    ("curve", "kind", "at"),
    [
        (bump(0.3), "max", 0.3),
        (5 - 3 * bump(0.314), "min", 0.314),
        (bump(0.3) + bump(0.8, height=0.5), "max", 0.3),
        (bump(0.3) + bump(0.34, 0.01, 0.3), "max", 0.34),
        (ramp(0.426), "rise", 0.426),
        (7 - 2 * ramp(0.426), "fall", 0.426),
        (ramp(0.3) - ramp(0.7), "rise", 0.3),
        (ramp(0.3) - ramp(0.7), "fall", 0.7),
    ],
)
def test_event_time_is_interpolated_between_frames(harness, curve, kind, at):
    assert harness.moment(curve, kind) == pytest.approx(at, abs=0.004)


@pytest.mark.parametrize(
    ("curve", "kind"),
    [
        (np.clip(bump(0.5, 0.3), 0, 0.6), "max"),  # a plateau
        (bump(0.2) + bump(0.8, height=0.9), "max"),  # two rivals
        (-bump(0.2) - bump(0.8, height=0.9), "min"),
        (bump(0.02), "max"),  # at the end of the clip
        (T, "min"),
        (bump(0.5) + bump(1.0, 0.05, 0.9), "max"),  # the end is a rival
        (bump(0.2) + bump(0.8), "rise"),  # twice
        (bump(0.2) + bump(0.8), "fall"),
        (1 - T, "rise"),  # never
    ],
)
def test_ambiguous_event_is_refused(harness, curve, kind):
    assert np.isnan(harness.moment(curve, kind))


def test_turning_points_are_complete_or_missing(harness):
    wave = np.sin(2 * np.pi * 1.5 * T) + 0.05 * np.sin(2 * np.pi * 20 * T)
    found = harness.turning_points(wave, "max min max")
    np.testing.assert_allclose(found, [1 / 6, 1 / 2, 5 / 6], atol=0.03)
    for other in ("max min", "min max min", "max min max min"):
        assert np.isnan(harness.turning_points(wave, other)).all()


def test_clips_with_a_weak_event_are_left_out(harness):
    event = harness.Event("", "", "", "", "max")
    found = harness.find([bump(0.3), bump(0.5), 0.2 * bump(0.7)], event, smoothing=0.01)
    np.testing.assert_allclose(found, [29.7, 49.5, np.nan], atol=0.1)


def test_step_length_is_measured_along_the_heading(harness):
    # Who faces +x has the left hip at -z; the same body turned to -z has it at -x.
    ahead = np.array([[0.3, 0, 0], [-0.2, 0.5, 0.4]])
    turn = np.array([[0, 0, -1.0], [0, 1, 0], [1, 0, 0]])
    for rotation in (np.eye(3), turn):
        parts = {
            "left hip": [0, 1, -0.1] @ rotation,
            "right hip": [0, 1, 0.1] @ rotation,
            "left ankle": np.zeros((2, 3)),
            "right ankle": ahead @ rotation,
        }
        parts = {name: np.broadcast_to(at, (2, 3)) for name, at in parts.items()}
        np.testing.assert_allclose(harness.body_curve(parts, "step"), [0.3, -0.2], atol=1e-9)


# Clips of the action, and those that show each of its events, in the order of EVENTS.
CLIPS = {
    "depositFloorR": (24, [17, 24, 24]),
    "elbowToKnee1RepsLelbowStart": (25, [23, 18]),
    "grabHighR": (23, [23, 23]),
    "hopBothLegs1hops": (33, [32, 32, 32, 32]),
    "jogLeftCircle4StepsRstart": (14, [13, 13, 13, 13]),
    "sneak2StepsLStart": (13, [13, 13]),
    "pickUp": (20, [19, 19]),
    "sitDown": (20, [20, 20]),
    "standUp": (20, [20, 20, 19]),
    "throw": (17, [10]),
    "push": (14, [11, 14]),
    "pull": (19, [16]),
    "walk": (13, [13, 13, 13]),
}


def test_number_of_real_events_is_the_documented_one(harness, real_data):
    found = {}
    for action in harness.read_actions(real_data):
        assert len(action.actors) == len(action.data)
        shown = [int(np.isfinite(at).sum()) for at in action.moments.values()]
        found[action.name] = len(action.data), shown
    assert found == CLIPS
    assert sum(event.chosen for event in harness.EVENTS) == 16


# -- moments on one time line ------------------------------------------------------------


def test_warps_that_are_late_miss_by_what_they_are_late(harness):
    moments, late = np.array([40.0, 44, 49, 61]), np.array([0.0, 3, 9, 17])
    # On the time line: 40, 41, 40 and 44. The six distances, each of two pairs, are 0 to 4.
    errors, spread = harness.on_time_line(FRAMES + late[:, np.newaxis], moments)
    np.testing.assert_allclose(np.sort(errors)[::2], [0, 1, 1, 3, 4, 4], rtol=0, atol=1e-4)
    np.testing.assert_allclose(np.sort(errors)[1::2], [0, 1, 1, 3, 4, 4], rtol=0, atol=1e-4)
    # The mean is 41.25; squares of the departures sum to 10.75.
    assert spread == pytest.approx(np.sqrt(10.75 / 3), abs=1e-4)


@pytest.mark.parametrize(
    ("at", "shown", "n_pairs"),
    [(7, [True] * 4, 12), (93, [True] * 4, 12), (30, [True, False, True, True], 6)],
)
def test_true_warps_have_no_error_and_no_spread(harness, at, shown, n_pairs):
    """Frame p of the pattern is frame 99 (p / 99)^k of a clip; some do not show the moment."""
    powers = np.array([99 * (FRAMES / 99) ** k for k in (0.5, 0.8, 1.25, 2.0)])
    errors, spread = harness.on_time_line(powers, np.where(shown, powers[:, at], np.nan))
    assert len(errors) == n_pairs
    np.testing.assert_allclose(errors, 0, rtol=0, atol=1e-4)
    assert spread == pytest.approx(0, abs=1e-4)


@pytest.mark.parametrize(
    ("after", "sd", "expected"),
    [([1.0, 2], 3.0, ""), ([1.0, 4], 3.0, "error"), ([1.0, 2], 3.5, "spread")],
)
def test_moments_that_are_harmed_are_named(accuracy, after, sd, expected):
    assert accuracy.harm((np.array([1.0, 3]), 3.2), (np.array(after), sd)) == expected


def test_ranks_are_taken_inside_each_event(benchmark):
    """Both events rank errors rightly, though the widths of one are those of the other doubled."""
    rank_correlation, errors = benchmark("intervals").rank_correlation, np.arange(1.0, 31)
    small, large = (np.column_stack([errors, width * errors]) for width in (1, 2))
    assert rank_correlation([small, large, small[:5, ::-1]]) == pytest.approx(1)
    assert rank_correlation([small * [1, -1], large]) == pytest.approx(0)
