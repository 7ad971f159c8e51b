"""Running sequences: rows against all paths and the offline trellis; causal velocities."""

import itertools

import numpy as np
import pytest
from sklearn_motionsync.live.causal import (
    CausalDerivative,
    CausalTrellis,
    causal_velocity,
)
from sklearn_motionsync.matching.costs import step_table
from sklearn_motionsync.matching.trellis import Trellis

from oracle import path_cost, step_costs

SUBFRAMES, MU = 2, 0.4


def best_to_every_end(base, moving, costs, seen=None):
    """Cheapest path to every position that the last sample may meet, of all there are.

    Of each sample these features count, or all.
    """
    best = {}
    for taken in itertools.product(sorted(costs), repeat=len(base) - 1):
        path = np.concatenate([[0], np.cumsum(taken)]).astype(int)
        if path[-1] < len(moving):
            total = path_cost(base, moving, path, costs, MU, SUBFRAMES)
            for p, columns in enumerate(seen or []):
                b, g, _ = costs[SUBFRAMES if p == 0 else taken[p - 1]]
                x, y = (np.delete(z, columns) for z in (base[p], moving[path[p]]))
                total -= x @ x + b * (y @ y) - g * (x @ y)
            if total < best.get(path[-1], (np.inf,))[0]:
                best[path[-1]] = total, path
    return best


@pytest.mark.parametrize("n_streams", [1, 3])
def test_running_path_equals_all_paths(n_streams):
    rng, costs = np.random.default_rng(0), step_costs("velocity", 2, SUBFRAMES)
    bases, moving = rng.standard_normal((n_streams, 5, 2)), rng.standard_normal((9, 2))
    trellis = Trellis(step_table("velocity", 2, SUBFRAMES), MU, 4, running=True)
    live = CausalTrellis(trellis, moving, n_streams)
    for p in range(5):
        live.advance(bases[:, p])
        paths = trellis.paths(bases[:, : p + 1], moving[np.newaxis])[:, 0]
        again = trellis.paths(bases[:, : p + 1], moving[np.newaxis], max_bytes=0)[:, 0]
        np.testing.assert_array_equal(again, paths)
        for n in range(n_streams):
            best = best_to_every_end(bases[n, : p + 1], moving, costs)
            for q in range(9):
                known = best.get(q, (np.inf, None))[0]
                np.testing.assert_allclose(live.costs[n, q], known, atol=1e-12)
            end = min(best, key=lambda q: best[q][0])
            assert live.best()[0][n] == end
            np.testing.assert_array_equal(paths[n], best[end][1])
    assert live.n_samples == 5


def test_missing_features_cost_nothing():
    rng, costs = np.random.default_rng(2), step_costs("velocity", 1, SUBFRAMES)
    base, moving = rng.standard_normal((5, 3)), rng.standard_normal((9, 3))
    seen = [[0, 1, 2], [0, 2], [], [1], [0, 1, 2]]
    trellis = Trellis(step_table("velocity", 1, SUBFRAMES), MU, 4, running=True)
    live = CausalTrellis(trellis, moving, 2)
    for x, columns in zip(base, seen, strict=True):
        parts = (x[np.newaxis, columns], moving[:, columns]) if columns else None
        # The second stream sees everything, and is not changed by the first.
        live.advance(np.stack([x, x]), {(0,): parts} if len(columns) < 3 else None)
    for found, features in zip(live.costs, (seen, None), strict=True):
        best = best_to_every_end(base, moving, costs, features)
        expected = [best.get(q, (np.inf,))[0] for q in range(9)]
        np.testing.assert_allclose(found, expected, atol=1e-12)


@pytest.mark.parametrize(("sample", "place"), [(1.0, 1.0), (1.0, 0.0), (0.0, 1.0)])
def test_best_end_is_the_earliest_of_equal_ones(sample, place):
    trellis = Trellis(step_table(max_rate=2), 0.0, 8, running=True)
    live = CausalTrellis(trellis, np.full((9, 3), place))
    for p in range(4):
        live.advance(np.full((1, 3), sample))
        assert live.best() == (0, (p + 1) * 3 * (sample - place) ** 2)


# -- velocities -----------------------------------------------------------------------------


def run(samples, width):
    derivative = CausalDerivative(width, samples[0].shape)
    return np.array([derivative.step(x) for x in samples])


def test_step_equals_two_exponential_filters():
    rng = np.random.default_rng(0)
    x, width = rng.standard_normal(40), 3.0
    differences = np.diff(x, prepend=x[0])
    kernel = np.exp(-np.arange(40) / width) * (1 - np.exp(-1 / width))
    once = np.convolve(differences, kernel)[:40]
    found = run(x[:, None, None], width)[:, 0, 0]
    np.testing.assert_allclose(found, np.convolve(once, kernel)[:40], atol=1e-12)


@pytest.mark.parametrize("subframes", [1, 3])
def test_positions_are_filtered_as_frames(subframes):
    rng = np.random.default_rng(1)
    x = rng.standard_normal((20 * subframes + 1, 2))
    found = causal_velocity(x, subframes, 2.0)
    for k in range(subframes):
        lane = x[k::subframes]
        # A stream that comes from rest at the first position.
        before = np.concatenate([x[:1], lane])
        expected = run(before[:, None], 2.0)[1:, 0]
        np.testing.assert_allclose(found[k::subframes], expected, atol=1e-12)
    np.testing.assert_array_equal(
        causal_velocity(x[: 8 * subframes + 1], subframes, 2.0), found[: 8 * subframes + 1]
    )


def test_constant_velocity_survives_gaps():
    x = 0.5 * np.arange(100.0)[:, None, None] * np.ones((1, 1, 2))
    x[60:64, 0, 0] = np.nan  # short
    x[70:90, 0, 0] = np.nan  # long
    found = run(x, 2.0)[:, 0]
    np.testing.assert_allclose(found[50:, 1], 0.5, atol=1e-6)
    assert np.isnan(found[60:64, 0]).all()
    np.testing.assert_allclose(found[64:70, 0], 0.5, atol=1e-6)
    # The first sample after a long gap has no velocity yet.
    assert np.isnan(found[70:91, 0]).all()
    np.testing.assert_allclose(found[91:, 0], 0.5, atol=1e-12)


# -- cycles, and attempts that begin anew ---------------------------------------------------


def test_path_around_a_cycle_equals_all_paths():
    """The path goes on round the cycle, from any position on; the last position is the first."""
    rng, costs = np.random.default_rng(4), step_costs("velocity", 2, SUBFRAMES)
    base, cycle = rng.standard_normal((6, 2)), rng.standard_normal((6, 2))
    moving = np.concatenate([cycle, cycle[:1]])
    trellis = Trellis(step_table("velocity", 2, SUBFRAMES), MU, 3, running=True)
    live = CausalTrellis(trellis, moving, cyclic=True)
    repeated = np.tile(cycle, (6, 1))
    for p in range(6):
        live.advance(base[p : p + 1])
        best = np.full(6, np.inf)
        for first, *taken in itertools.product(range(6), *[sorted(costs)] * p):
            path = first + np.concatenate([[0], np.cumsum(taken)]).astype(int)
            total = path_cost(base[: p + 1], repeated, path, costs, MU, SUBFRAMES)
            best[path[-1] % 6] = min(best[path[-1] % 6], total)
        np.testing.assert_allclose(live.costs[0], best, atol=1e-12)
        assert live.best()[0][0] == best.argmin()
        np.testing.assert_allclose(live.best()[1][0], best.min(), atol=1e-12)


def rows_with_attempts(base, moving, costs, restart_cost, moves):
    """Costs of every row, and the attempt in which it is, cell by cell."""
    n, (unit, _, _) = len(moving), (SUBFRAMES, 0, 0)

    def local(x, q, step):
        b, g, phi = costs[step]
        return x @ x + b * (moving[q] @ moving[q]) - g * (x @ moving[q]) + MU * phi

    now, other, attempt = np.full(n, np.inf), np.full(n, np.inf), 0
    now[0] = local(base[0], 0, unit)
    yield now, attempt
    for x, moved in zip(base[1:], moves[1:], strict=True):
        # Where an attempt begins, the position before the first one has the least cost so far.
        before = dict(enumerate(now)), dict(enumerate(other)) | {-unit: now.min() + restart_cost}
        rows = [
            np.array(
                [min(row.get(q - s, np.inf) + local(x, q, s) for s in costs) for q in range(n)]
            )
            for row in before
        ]
        if not moved:
            rows[1] = other + rows[0].min() - now.min()
        now, other = rows
        if other.min() < now.min():
            now, other, attempt = other, np.full(n, np.inf), attempt + 1
        yield now, attempt


@pytest.mark.parametrize("still", [False, True])
def test_attempts_equal_a_slow_version(still):
    rng, costs = np.random.default_rng(5), step_costs("velocity", 2, SUBFRAMES)
    moving = np.cumsum(rng.standard_normal((13, 3)), axis=0)
    # Twice the first half, whole frame by whole frame, and all of it.
    base = np.concatenate([moving[[0, 2, 4, 6]], moving[[0, 2, 4, 6]], moving[::2]])
    base = base + 0.1 * rng.standard_normal(base.shape)
    moves = np.ones((2, len(base)), dtype=bool)
    if still:
        moves[0, 3:6] = False
    trellis = Trellis(step_table("velocity", 2, SUBFRAMES), MU, 6, running=True)
    live = CausalTrellis(trellis, moving, 2, restart_cost=2.0)
    # The second stream begins nothing anew, and is not changed by the first.
    steady = np.concatenate([moving[::2], np.repeat(moving[-1:], len(base) - 7, axis=0)])
    never = rows_with_attempts(steady, moving, costs, np.inf, moves[1])
    attempts = []
    expected = rows_with_attempts(base, moving, costs, 2.0, moves[0])
    for p, ((row, attempt), (other, _)) in enumerate(zip(expected, never, strict=True)):
        live.advance(np.stack([base[p], steady[p]]), moves=moves[:, p])
        np.testing.assert_allclose(live.costs, [row, other], atol=1e-9)
        assert live.attempts.tolist() == [attempt, 0]
        attempts.append(attempt)
    assert attempts[-1] == (1 if still else 2)


def test_velocity_of_a_cycle_is_that_after_many_cycles():
    cycle = np.random.default_rng(7).standard_normal((40, 2))
    positions = np.concatenate([cycle, cycle[:1]])
    repeated = np.concatenate([cycle] * 30 + [cycle[:1]])
    found = causal_velocity(positions, 2, 3.0, cyclic=True)
    np.testing.assert_allclose(found, causal_velocity(repeated, 2, 3.0)[-41:], atol=1e-12)
    np.testing.assert_allclose(found[0], found[-1], atol=1e-12)


def test_velocity_is_unknown_at_the_first_sample_unless_from_rest():
    samples = np.random.default_rng(8).standard_normal((30, 1, 2))
    samples[0, 0, 1] = np.nan
    derivative = CausalDerivative(2.0, (1, 2), from_rest=False)
    found = np.array([derivative.step(sample) for sample in samples])[:, 0]
    assert np.isnan(found[0]).all()
    assert np.isnan(found[1]).tolist() == [False, True]
    keep = np.exp(-0.5)
    for column, first in enumerate((0, 1)):
        x = samples[first:, 0, column]
        # Of all differences since the first sample, weighted by their age, twice.
        velocity = np.diff(x)
        for _ in range(2):
            weights = [keep ** np.arange(k, -1, -1.0) for k in range(len(velocity))]
            velocity = [w @ velocity[: len(w)] / w.sum() for w in weights]
        np.testing.assert_allclose(found[first + 1 :, column], velocity)
    # After a long gap as at the beginning.
    for _ in range(20):
        assert np.isnan(derivative.step(np.full((1, 2), np.nan))).all()
    assert np.isnan(derivative.step(samples[5])).all()
    np.testing.assert_allclose(derivative.step(samples[6]), samples[6] - samples[5])
