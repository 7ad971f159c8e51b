"""Running sequences against every admissible path, and against the trellis of what is over."""

import itertools

import numpy as np
import pytest
from sklearn_motionsync.matching.causal import CausalTrellis
from sklearn_motionsync.matching.costs import StepTable, step_table
from sklearn_motionsync.matching.trellis import Trellis

from oracle import path_cost

SUBFRAMES, MU = 2, 0.4


def costs_by_step(max_rate):
    """(b, g, phi) of every step, differing from step to step."""
    steps = range(max_rate * SUBFRAMES + 1)
    return {s: (1 + s / 4, 2 * np.sqrt(1 + s / 4), 0.3 * abs(s - SUBFRAMES)) for s in steps}


def table_of(costs):
    steps = np.array(sorted(costs, key=lambda s: (abs(s - SUBFRAMES), s)))
    return StepTable(steps, *np.array([costs[s] for s in steps]).T, SUBFRAMES)


def best_to_every_end(base, moving, costs):
    """Cheapest path to every position that the last sample may meet, of all there are."""
    best = {}
    for taken in itertools.product(sorted(costs), repeat=len(base) - 1):
        path = np.concatenate([[0], np.cumsum(taken)]).astype(int)
        if path[-1] < len(moving):
            total = path_cost(base, moving, path, costs, MU, SUBFRAMES)
            if total < best.get(path[-1], (np.inf,))[0]:
                best[path[-1]] = total, path
    return best


@pytest.mark.parametrize("n_streams", [1, 3])
def test_equals_every_path(n_streams):
    rng, costs = np.random.default_rng(0), costs_by_step(2)
    bases, moving = rng.standard_normal((n_streams, 5, 2)), rng.standard_normal((9, 2))
    trellis = Trellis(table_of(costs), MU, 4, running=True)
    live = CausalTrellis(trellis, moving, n_streams)
    for p in range(5):
        live.advance(bases[:, p])
        paths = trellis.paths(bases[:, : p + 1], moving[np.newaxis])[:, 0]
        for n in range(n_streams):
            best = best_to_every_end(bases[n, : p + 1], moving, costs)
            for q in range(9):
                known = best.get(q, (np.inf, None))[0]
                np.testing.assert_allclose(live.costs[n, q], known, atol=1e-12)
            end = min(best, key=lambda q: best[q][0])
            assert live.best()[0][n] == end
            np.testing.assert_array_equal(paths[n], best[end][1])


@pytest.mark.parametrize("n_streams", [1, 4])
def test_is_the_trellis_of_what_is_over_to_the_last_bit(n_streams):
    rng = np.random.default_rng(1)
    bases, moving = rng.standard_normal((n_streams, 90, 7)), rng.standard_normal((201, 7))
    trellis = Trellis(step_table("velocity", 3, 4), 0.7, 50, running=True)
    live = CausalTrellis(trellis, moving, n_streams)
    for p in range(90):
        live.advance(bases[:, p])
    assert live.n_samples == 90
    np.testing.assert_array_equal(live.costs, trellis.ends(bases, moving[np.newaxis])[:, 0])
    paths = trellis.paths(bases, moving[np.newaxis])[:, 0]
    np.testing.assert_array_equal(live.best()[0], paths[:, -1])
    again = trellis.paths(bases, moving[np.newaxis], max_bytes=0)[:, 0]
    np.testing.assert_array_equal(again, paths)


def test_what_is_not_seen_costs_nothing():
    rng, costs = np.random.default_rng(2), costs_by_step(1)
    base, moving = rng.standard_normal((5, 3)), rng.standard_normal((9, 3))
    seen = [[0, 1, 2], [0, 2], [], [1], [0, 1, 2]]
    trellis = Trellis(table_of(costs), MU, 4, running=True)
    live = CausalTrellis(trellis, moving, 2)
    for x, columns in zip(base, seen, strict=True):
        parts = (x[np.newaxis, columns], moving[:, columns]) if columns else None
        # The second stream sees everything, and is not changed by the first.
        live.advance(np.stack([x, x]), {(0,): parts} if len(columns) < 3 else None)
    best = {}
    for taken in itertools.product(sorted(costs), repeat=4):
        path = np.concatenate([[0], np.cumsum(taken)]).astype(int)
        total = 0.0
        for p, columns in enumerate(seen):
            b, g, phi = costs[SUBFRAMES if p == 0 else taken[p - 1]]
            x, y = base[p, columns], moving[path[p], columns]
            total += x @ x + b * (y @ y) - g * (x @ y) + (MU * phi if p else 0)
        best[path[-1]] = min(total, best.get(path[-1], np.inf))
    expected = [best.get(q, np.inf) for q in range(9)]
    whole = best_to_every_end(base, moving, costs)
    np.testing.assert_allclose(live.costs[1], [whole.get(q, (np.inf,))[0] for q in range(9)])
    np.testing.assert_allclose(live.costs[0], expected, atol=1e-12)


def test_a_stream_begins_anew_and_the_others_go_on():
    rng = np.random.default_rng(3)
    bases, moving = rng.standard_normal((2, 12, 4)), rng.standard_normal((17, 4))
    trellis = Trellis(step_table("velocity", 2, 2), 0.5, 8, running=True)
    both, alone, late = (CausalTrellis(trellis, moving, n) for n in (2, 1, 1))
    for p in range(12):
        if p == 5:
            both.restart(1)
        both.advance(bases[:, p])
        alone.advance(bases[:1, p])
        if p >= 5:
            late.advance(bases[1:, p])
    np.testing.assert_allclose(both.costs[0], alone.costs[0], atol=1e-12)
    np.testing.assert_allclose(both.costs[1], late.costs[0], atol=1e-12)


@pytest.mark.parametrize(("sample", "place"), [(1.0, 1.0), (1.0, 0.0), (0.0, 1.0)])
def test_of_equal_ends_it_is_the_earliest(sample, place):
    live = CausalTrellis(
        Trellis(step_table(max_rate=2), 0.0, 8, running=True), np.full((9, 3), place)
    )
    for p in range(4):
        live.advance(np.full((1, 3), sample))
        ends, costs = live.best()
        assert ends == 0
        assert costs == (p + 1) * 3 * (sample - place) ** 2
