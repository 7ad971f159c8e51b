"""The decoder of takes: each step by itself, against paths that are found in another way."""

from types import SimpleNamespace

import numpy as np
import pytest
from scipy.sparse import coo_array
from scipy.sparse.csgraph import dijkstra
from sklearn_motionsync.takes.decoder import (
    PHASES,
    Stretch,
    average_cycle,
    cheapest_path,
    circular_peak,
    cut_cycles,
    move_to_events,
    slowest_near,
)

ANGLES = 2 * np.pi * np.arange(PHASES) / PHASES
POSES = np.column_stack([np.sin(ANGLES), np.cos(ANGLES), np.sin(2 * ANGLES)]) / np.sqrt(1.5)
VELOCITIES = np.column_stack([np.cos(ANGLES), -np.sin(ANGLES), 2 * np.cos(2 * ANGLES)]) / np.sqrt(3)
PATTERN = np.concatenate([POSES, VELOCITIES], axis=1)
REST = np.concatenate([POSES[0], np.zeros(3)])


def stretch_of(values, phases, times=None):
    """A stretch whose samples are known."""
    times = np.arange(len(values), dtype=float) if times is None else times
    take = SimpleNamespace(times=times, values=values)
    return Stretch(take, slice(0, len(values)), phases)


def following(phases):
    """Samples that are equal to the pattern at phases, between its samples on straight lines."""
    closed = np.concatenate([PATTERN, PATTERN[:1]])
    places = PHASES * (np.asarray(phases) % 1)
    return np.stack([np.interp(places, np.arange(PHASES + 1), x) for x in closed.T], axis=1)


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


def cheapest(values):
    """The cost of the cheapest path by Dijkstra's algorithm, over a graph of samples and states.

    States are the positions of the cycle, and last the one beside it.
    """
    cycle = following(np.arange(4 * PHASES) / (4 * PHASES))
    n, beside = len(values), len(cycle)
    local = np.square(values[:, np.newaxis] - cycle).sum(axis=2) / 2
    other = 0.3 * (np.square(values).sum(axis=1) + 2)
    local = np.column_stack([local, np.minimum(other, np.square(values[:, 3:]).sum(axis=1))])
    rows, columns, costs = [], [], []

    def connect(k, state, following_state, cost):
        rows.append(1 + (k - 1) * (beside + 1) + state)
        columns.append(1 + k * (beside + 1) + following_state)
        costs.append(cost + local[k, following_state])

    for k in range(1, n):
        for state in range(beside):
            for step in range(9):
                pace = 0.15 * (step / 4 - 1) ** 2
                connect(k, state, (state + step) % beside, pace)
            connect(k, state, beside, 4)
            connect(k, beside, state, 4)
        connect(k, beside, beside, 0)
    # A node before the first sample, at which every state may begin. Zeros would be no edges.
    rows += [0] * (beside + 1)
    columns += list(range(1, beside + 2))
    costs += local[0].tolist()
    graph = coo_array((np.array(costs) + 1, (rows, columns)), shape=[n * (beside + 1) + 1] * 2)
    return dijkstra(graph.tocsr(), indices=0)[-(beside + 1) :].min() - n


def cost_of(values, stretches):
    """The cost of a path, added up by itself."""
    n = len(values)
    other = 0.3 * (np.square(values).sum(axis=1) + 2)
    beside = np.minimum(other, np.square(values[:, 3:]).sum(axis=1))
    total = beside.sum()
    for where, phases in stretches:
        inside = values[where]
        total += np.square(inside - following(phases)).sum() / 2 - beside[where].sum()
        total += 0.15 * np.square(PHASES * np.diff(phases) - 1).sum()
        total += 4 * ((where.start > 0) + (where.stop < n))
    return total


@pytest.mark.parametrize("seed", range(4))
def test_the_path_is_the_cheapest_one(seed):
    rng = np.random.default_rng(seed)
    phases = rng.random() + np.cumsum(rng.uniform(0, 2, 45)) / PHASES
    values = following(phases)
    if seed % 2:
        values[:9], values[-9:] = REST, rng.normal(size=(9, 6))
    values += 0.3 * rng.normal(size=values.shape)
    stretches = cheapest_path(values, PATTERN)
    assert cost_of(values, stretches) == pytest.approx(cheapest(values), rel=1e-9)


def test_phases_of_a_known_warp_are_found_and_rest_and_other_movements_are_left_out():
    t = np.linspace(0, 1, 160)
    phases = 0.3 + 5 * t + 0.1 * np.sin(3 * np.pi * t)
    rng = np.random.default_rng(0)
    other = np.concatenate([rng.normal(size=(60, 3)), rng.normal(size=(60, 3))], axis=1)
    values = np.concatenate([np.tile(REST, (50, 1)), following(phases), other])
    ((where, found),) = cheapest_path(values, PATTERN)
    assert (abs(where.start - 50), abs(where.stop - 210)) < (4, 4)
    inside = slice(max(where.start, 50), min(where.stop, 210))
    errors = found[inside.start - where.start : inside.stop - where.start]
    errors = errors - phases[inside.start - 50 : inside.stop - 50]
    assert np.abs(errors - np.round(errors.mean())).max() < 0.02
    ((everywhere, _),) = cheapest_path(values, PATTERN, everywhere=True)
    assert everywhere == slice(0, len(values))


def test_a_movement_turns_where_it_is_slow():
    """A squat turns where it is lowest and where it is highest."""
    height = np.column_stack([np.cos(ANGLES), np.cos(ANGLES)])
    speed = np.column_stack([-np.sin(ANGLES), -np.sin(ANGLES)])
    squat = np.concatenate([height, speed], axis=1)
    assert slowest_near(squat, np.array([0.9, 0.9])) == 0
    assert slowest_near(squat, np.array([-0.5, -0.5])) == PHASES // 2
    # A wheel never turns back.
    wheel = np.column_stack([np.cos(ANGLES), np.sin(ANGLES), -np.sin(ANGLES), np.cos(ANGLES)])
    assert slowest_near(wheel, np.ones(2)) is None


def test_cycles_end_where_their_phase_is_reached_and_are_scored_by_themselves():
    times, phases = np.arange(0, 320, 2.0), np.linspace(0.25, 5.25, 160)
    # It stands at phase 2.
    phases[np.abs(phases - 2) < 0.2] = 2
    values = PATTERN[np.round(phases * PHASES).astype(int) % PHASES]
    values[phases >= 4] = np.random.default_rng(0).normal(size=((phases >= 4).sum(), 6))
    rows = cut_cycles(stretch_of(values, phases, times), PATTERN)
    stands = int(times[phases == 2][0])
    starts = [0, round(np.interp(1, phases, times)), stands]
    # Phase 4 is reached at 238.5 frames: from a half it is the later one.
    np.testing.assert_allclose(np.interp(4, phases, times), 238.5, rtol=1e-12)
    starts += [round(np.interp(3, phases, times)), 239, round(np.interp(5, phases, times))]
    assert [row.start for row in rows] == starts
    assert [row.stop for row in rows] == [start + 1 for start in [*starts[1:], 318]]
    # The last but one is whole, and does not follow the pattern.
    assert [row.complete for row in rows] == [False, True, True, True, False, False]
    assert all(row.score > 0.99 for row in rows[:4])
    assert max(row.score for row in rows[4:]) < 0.5


@pytest.mark.parametrize(("first", "last", "count"), [(0.1, 2.9, 3), (0.3, 2.9, 2), (0.3, 2.7, 1)])
def test_a_piece_that_lacks_only_rest_is_a_whole_cycle(first, last, count):
    """Of this movement the energy of the first and the last eighth of a cycle is 1 per cent."""
    heights = (1 - np.cos(ANGLES)) / 2
    speeds = np.where(np.abs(ANGLES - np.pi) < 0.75 * np.pi, np.sin(ANGLES), 0.1 * np.sin(ANGLES))
    pattern = np.column_stack([heights - heights.mean(), speeds])
    phases = np.linspace(first, last, 100)
    values = pattern[np.round(phases * PHASES).astype(int) % PHASES]
    rows = cut_cycles(stretch_of(values, phases), pattern)
    assert [row.complete for row in rows].count(True) == count
    assert len(rows) == 3


def test_no_part_is_empty_where_a_take_begins_and_ends_with_a_whole_phase():
    values = np.tile(PATTERN, (3, 1))[:65]
    rows = cut_cycles(stretch_of(values, np.linspace(1, 3, 65)), PATTERN)
    assert [row[:3] for row in rows] == [(0, 33, True), (32, 65, True)]


@pytest.mark.parametrize("size", [1e-6, 1e6])
def test_score_is_the_cosine_with_the_pattern(size):
    pattern = np.random.default_rng(0).normal(size=(PHASES, 6))
    plain = size * pattern[np.arange(8 * PHASES + 1) % PHASES]
    phases = np.arange(len(plain)) / PHASES
    assert [row.score for row in cut_cycles(stretch_of(plain, phases), pattern)] == pytest.approx(
        [1] * 8
    )
    # A cycle has the sample at its first frame, and not that of the next one.
    odd = plain.copy()
    odd[: len(odd) // 2 : PHASES] *= -1
    inside = np.square(pattern).sum(axis=1)
    first = 1 - 2 * inside[0] / inside.sum()
    scores = [row.score for row in cut_cycles(stretch_of(odd, phases), pattern)]
    np.testing.assert_allclose(scores, [first] * 4 + [1] * 4)
    for factor in (-1, 0):
        rows = cut_cycles(stretch_of(factor * plain, phases), pattern)
        np.testing.assert_allclose([row.score for row in rows], factor)
        assert not any(row.complete for row in rows)


def test_events_far_from_a_beginning_do_not_count():
    stretch = stretch_of(np.zeros((101, 2)), np.arange(101) / 25)
    moved = move_to_events(stretch, np.array([27.0, 40.0, 74.0])).phases
    np.testing.assert_allclose(moved[[27, 74]], [1, 3], atol=1e-9)
    assert (np.diff(moved) >= 0).all()
    # Neither does one far away, nor do two near one beginning: none of them is sure.
    for events in ([40.0], [24.0, 27.0]):
        same = move_to_events(stretch, np.array(events)).phases
        np.testing.assert_array_equal(same, stretch.phases)
