"""Phases of takes along a pattern, and the cycles between them: each step by itself."""

from types import SimpleNamespace

import numpy as np
import pytest
from sklearn_motionsync.takes.stretches import (
    PHASES,
    average_cycle,
    circular_peak,
    locate_cycles,
    match_phases,
)

ANGLES = 2 * np.pi * np.arange(PHASES) / PHASES
PATTERN = np.column_stack([np.sin(ANGLES), np.cos(ANGLES), np.sin(2 * ANGLES)])


def test_mean_cycle_is_that_of_every_sample_at_its_phase():
    """Samples half-way between those of the cycle are on straight lines."""
    rng = np.random.default_rng(0)
    first, second = rng.normal(size=(70, 2)), rng.normal(size=(41, 2))
    places = [np.arange(70) + 5, np.arange(41) + 7.5]
    found = average_cycle([first, second], [place / PHASES for place in places])
    for k in range(PHASES):
        values = [first[i] for i in range(70) if (i + 5) % PHASES == k]
        values += [(second[i] + second[i + 1]) / 2 for i in range(40) if (i + 8) % PHASES == k]
        np.testing.assert_allclose(found[k], np.mean(values, axis=0), atol=1e-12)


@pytest.mark.parametrize("place", [0.2, 5.0, 13.37, 31.6])
def test_maximum_of_a_closed_curve_lies_between_samples(place):
    found = circular_peak(np.cos(ANGLES - 2 * np.pi * place / PHASES))
    assert (found - place + 5) % PHASES - 5 == pytest.approx(0, abs=0.01)
    assert circular_peak(np.zeros(PHASES)) == 0


def test_portions_of_a_long_take_are_joined_in_the_middle_of_their_overlap():
    """Beyond it the phases are those of the later portion alone, but for whole cycles."""
    values = np.random.default_rng(7).normal(size=(19 * PHASES, 3))
    whole, overlap = 16 * PHASES, 2 * PHASES
    joined = match_phases(PATTERN, SimpleNamespace(values=values))
    early = match_phases(PATTERN, SimpleNamespace(values=values[: whole + overlap]))
    late = match_phases(PATTERN, SimpleNamespace(values=values[whole:]))
    middle = whole + overlap // 2
    np.testing.assert_array_equal(joined[:middle], early[:middle])
    # Noise fits anywhere: the portions meet at different phases, the later one behind.
    apart = late[overlap // 2] - early[middle]
    assert abs(apart - np.round(apart)) > 0.05
    expected = late[overlap // 2 :] - np.round(apart)
    assert expected[0] < early[middle - 1]
    np.testing.assert_array_equal(joined[middle:], np.maximum(expected, early[middle - 1]))


def test_cycles_end_where_their_phase_is_reached_and_are_scored_by_themselves():
    times, phases = np.arange(0, 320, 2.0), np.linspace(0.25, 5.25, 160)
    # It stands at phase 2.
    phases[np.abs(phases - 2) < 0.2] = 2
    values = PATTERN[np.round(phases * PHASES).astype(int) % PHASES]
    values[phases >= 4] = np.random.default_rng(0).normal(size=((phases >= 4).sum(), 3))
    take = SimpleNamespace(times=times, values=values, begins=False, ends=False)
    rows = list(locate_cycles(take, phases, PATTERN, incomplete=True))
    stands = int(times[phases == 2][0])
    starts = [0, round(np.interp(1, phases, times)), stands]
    # Phase 4 is reached at 238.5 frames: from a half it is the later one.
    np.testing.assert_allclose(np.interp(4, phases, times), 238.5, rtol=1e-12)
    starts += [round(np.interp(3, phases, times)), 239, round(np.interp(5, phases, times))]
    assert [row[0] for row in rows] == starts
    assert [row[1] for row in rows] == [start + 1 for start in [*starts[1:], 318]]
    # The last but one is whole, and does not follow the pattern.
    assert [row[2] for row in rows] == [False, True, True, True, False, False]
    assert all(row[3] > 0.99 for row in rows[:4])
    assert max(row[3] for row in rows[4:]) < 0.5
    whole = list(locate_cycles(take, phases, PATTERN, incomplete=False))
    assert whole == rows[1:4]


@pytest.mark.parametrize("side", ["begins", "ends"])
def test_a_cycle_that_begins_or_ends_in_standing_is_no_whole_one(side):
    """Only where the take goes on there: else it was cut off in motion."""
    phases, stands = np.linspace(0.25, 4.75, 145), (0.95, 1.2) if side == "begins" else (3.8, 4.05)
    values = PATTERN[np.round(phases * PHASES).astype(int) % PHASES]
    values = np.concatenate([values, np.roll(values, -8, axis=0)], axis=1)
    pattern = np.concatenate([PATTERN, np.roll(PATTERN, -8, axis=0)], axis=1)
    values[(phases > stands[0]) & (phases < stands[1]), 3:] *= 0.1
    take = SimpleNamespace(times=np.arange(145.0), values=values, begins=False, ends=False)
    rows = list(locate_cycles(take, phases, pattern, incomplete=False))
    assert len(rows) == 3
    setattr(take, side, True)
    rest = rows[1:] if side == "begins" else rows[:-1]
    assert list(locate_cycles(take, phases, pattern, incomplete=False)) == rest
    pieces = list(locate_cycles(take, phases, pattern, incomplete=True))
    assert [row[:3] for row in pieces if row[2]] == [row[:3] for row in rest]
    longest = max(row[1] - row[0] for row in pieces if not row[2])
    assert longest > 33


def test_no_part_is_empty_where_a_take_begins_and_ends_with_a_whole_phase():
    phases = np.linspace(1, 3, 65)
    values = np.tile(PATTERN, (3, 1))[:65]
    take = SimpleNamespace(times=np.arange(65.0), values=values, begins=False, ends=False)
    rows = list(locate_cycles(take, phases, PATTERN, incomplete=True))
    assert [row[:3] for row in rows] == [(0, 33, True), (32, 65, True)]
