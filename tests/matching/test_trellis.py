"""The trellis against versions that share no code with it."""

import tracemalloc

import numpy as np
import pytest
from sklearn_motionsync.matching import tile as module
from sklearn_motionsync.matching import trellis as trellis_module
from sklearn_motionsync.matching.costs import COSTS, step_table
from sklearn_motionsync.matching.trellis import Coupling, Trellis

from oracle import all_free_paths, all_paths, brute_force, path_cost, plain_loops, step_costs

KEPT = {"rows": (0, 10**9), "choices": (0, 0), "small": (10**6, 0)}


@pytest.fixture(params=KEPT)
def kept(request, monkeypatch):
    """What is kept of a tile."""
    small_bytes, row_bytes = KEPT[request.param]
    monkeypatch.setattr(module, "SMALL_BYTES", [small_bytes] * 2)
    monkeypatch.setattr(module, "ROW_BYTES", row_bytes)


def draw(rng, n, n_frames, subframes=1, n_features=2, whole=False):
    """Bases and moving sequences; whole numbers make ties."""
    shapes = (n, n_frames, n_features), (n + 1, (n_frames - 1) * subframes + 1, n_features)
    if whole:
        return [rng.integers(0, 2, shape).astype(float) for shape in shapes]
    return [rng.standard_normal(shape) for shape in shapes]


CASES = [
    # n_frames, max_rate, subframes, max_disparity, mu
    (6, 2, 1, 2, 0.3),
    (6, 2, 1, 5, 0.0),
    (6, 3, 1, 3, 0.7),
    (5, 2, 2, 2, 0.4),
    (5, 1.5, 2, 4, 0.1),
    (4, 4, 2, 3, 1.3),
    (5, 2, 1, 0, 0.5),
    (2, 2, 1, 1, 0.5),
    (6, 1, 1, 3, 0.2),
]


@pytest.mark.parametrize("cost", COSTS)
@pytest.mark.parametrize(
    ("case", "whole", "dtype"),
    [
        *((case, True, np.float64) for case in CASES),
        *((case, False, np.float64) for case in CASES[3:6]),
        *((case, False, np.float32) for case in CASES[4:5]),
    ],
)
def test_best_path_equals_all_admissible_paths(case, cost, whole, dtype, kept):
    n_frames, max_rate, subframes, reach, mu = case
    costs = step_costs(cost, max_rate, subframes)
    bases, moving = draw(np.random.default_rng(n_frames), 3, n_frames, subframes, whole=whole)
    bases, moving = bases.astype(dtype), moving.astype(dtype)
    trellis = Trellis(step_table(cost, max_rate, subframes), mu, reach)
    distances = trellis.distances(bases, moving)
    close = {"rtol": 1e-10, "atol": 1e-12} if dtype == np.float64 else {"rtol": 1e-4, "atol": 1e-4}
    disparities = trellis.paths(bases, moving)
    for n, base in enumerate(bases):
        from_paths = trellis.costs(base, moving, disparities[n])
        assert from_paths.dtype == distances.dtype == dtype
        np.testing.assert_allclose(from_paths, distances[n], **close)
        for m, sequence in enumerate(moving):
            x, y = base.astype(float), sequence.astype(float)
            best, _ = brute_force(x, y, costs, mu, subframes, reach)
            np.testing.assert_allclose(distances[n, m], best, **close)
            path = disparities[n, m] + subframes * np.arange(n_frames)
            found = path_cost(x, y, path, costs, mu, subframes)
            np.testing.assert_allclose(found, best, **close)


@pytest.mark.parametrize("cost", COSTS)
@pytest.mark.parametrize("case", [(5, 2, 1, 2, 0.3), (4, 2, 2, 1, 0.4), (2, 3, 1, 4, 0.0)])
@pytest.mark.parametrize("n_bases", [1, 2])
def test_free_ends_equal_all_paths(case, cost, n_bases):
    n_frames, max_rate, subframes, reach, mu = case
    costs, rng = step_costs(cost, max_rate, subframes), np.random.default_rng(0)
    bases = rng.standard_normal((n_bases, n_frames, 2))
    moving = rng.standard_normal((3, (n_frames - 1) * subframes + 1 + 2 * reach * subframes, 2))
    trellis = Trellis(step_table(cost, max_rate, subframes), mu, reach, free=True)
    to_all = trellis.ends(bases, moving)
    best = trellis.paths(bases, moving)
    again = trellis.paths(bases, moving, max_bytes=0)
    np.testing.assert_array_equal(again, best)
    np.testing.assert_allclose(trellis.distances(bases, moving), to_all.min(axis=2))
    paths = list(all_free_paths(n_frames, sorted(costs), subframes, reach))
    for n, base in enumerate(bases):
        for m, sequence in enumerate(moving):
            totals = [path_cost(base, sequence, path, costs, mu, subframes) for path in paths]
            for i, end in enumerate(trellis.ends_at):
                last = trellis.lead + (n_frames - 1) * subframes + end
                known = [t for q, t in zip(paths, totals, strict=True) if q[-1] == last]
                np.testing.assert_allclose(to_all[n, m, i], min(known), atol=1e-12)
            known = {tuple(q): t for q, t in zip(paths, totals, strict=True)}
            path = tuple(trellis.lead + best[n, m] + subframes * np.arange(n_frames))
            np.testing.assert_allclose(known[path], min(totals), atol=1e-12)
            added_up = trellis.costs(base, sequence[np.newaxis], best[n, m, np.newaxis])
            np.testing.assert_allclose(added_up, known[path], atol=1e-12)


def test_equal_free_ends_give_the_middle():
    trellis = Trellis(step_table(), 1.0, 4, free=True)
    assert not trellis.paths(np.zeros((1, 6, 2)), np.zeros((1, 14, 2))).any()


@pytest.mark.parametrize("cost", COSTS)
@pytest.mark.parametrize("n_bases", [1, 2])
def test_coupled_paths_equal_all_paths(cost, n_bases, kept):
    costs, rng = step_costs(cost, 2, 2), np.random.default_rng(0)
    bases, moving = rng.standard_normal((n_bases, 5, 2)), rng.standard_normal((3, 9, 2))
    coupling = Coupling(0.7, rng.uniform(-1, 1, (n_bases, 3, 5)))
    trellis = Trellis(step_table(cost, 2, 2), 0.2, 2)
    disparities = trellis.paths(bases, moving, coupling=coupling)
    np.testing.assert_array_equal(
        trellis.paths(bases, moving, max_bytes=0, coupling=coupling), disparities
    )
    diagonal = 2 * np.arange(5)
    for n, base in enumerate(bases):
        for m, sequence in enumerate(moving):
            totals = {}
            for path in all_paths(5, sorted(costs), 2, 2):
                drawn = 0.7 * np.square((path - diagonal) / 2 - coupling.offsets[n, m]).sum()
                totals[tuple(path)] = path_cost(base, sequence, path, costs, 0.2, 2) + drawn
            found = totals[tuple(diagonal + disparities[n, m])]
            np.testing.assert_allclose(found, min(totals.values()), atol=1e-12)


@pytest.mark.parametrize("cost", COSTS)
@pytest.mark.parametrize("case", [(40, 2, 1, 10, 0.5), (33, 3, 2, 6, 0.2), (13, 4, 4, 4, 1.0)])
def test_distances_equal_plain_loops(case, cost):
    n_frames, max_rate, subframes, reach, mu = case
    costs = step_costs(cost, max_rate, subframes)
    bases, moving = draw(np.random.default_rng(1), 2, n_frames, subframes, n_features=5)
    distances = Trellis(step_table(cost, max_rate, subframes), mu, reach).distances(bases, moving)
    expected = [[plain_loops(x, y, costs, mu, subframes, reach) for y in moving] for x in bases]
    np.testing.assert_allclose(distances, expected, rtol=1e-10)


TABLES = [step_table(), step_table("velocity", max_rate=4, subframes=2)]


@pytest.mark.parametrize("table", TABLES, ids=["one group", "several"])
@pytest.mark.parametrize("n_bases", [1, 5])
def test_tile_sizes_change_no_result(n_bases, table, monkeypatch):
    bases, moving = draw(np.random.default_rng(3), n_bases, 30, table.subframes, n_features=4)
    trellis = Trellis(table, 0.5, 8)
    whole = trellis.distances(bases, moving)
    paths = trellis.paths(bases, moving)
    monkeypatch.setattr(trellis_module, "TILE_PRODUCT", 1)
    monkeypatch.setattr(trellis_module, "TILE_BASES", 2)
    monkeypatch.setattr(trellis_module, "LONG_ROW", 1)
    monkeypatch.setattr(module, "PRODUCT_ROWS", 3)
    monkeypatch.setattr(trellis_module, "ROW_BYTES", 1)
    monkeypatch.setattr(module, "SMALL_BYTES", [0, 0])
    np.testing.assert_allclose(trellis.distances(bases, moving), whole, rtol=1e-12)
    np.testing.assert_array_equal(trellis.paths(bases, moving), paths)


@pytest.mark.parametrize("table", TABLES, ids=["one group", "several"])
@pytest.mark.parametrize("whole", [False, True], ids=["reals", "ties"])
@pytest.mark.parametrize("ends", [{}, {"free": True}], ids=["pinned", "free"])
@pytest.mark.parametrize("max_bytes", [None, 0])
def test_choices_give_the_paths_and_costs_of_rows(table, whole, ends, max_bytes, monkeypatch):
    """Several sequences in a tile: to the last bit."""
    monkeypatch.setattr(module, "SMALL_BYTES", [0, 0])
    trellis = Trellis(table, 0.5, 12, **ends)
    bases, moving = draw(np.random.default_rng(6), 3, 70, table.subframes, whole=whole)
    if ends:
        moving = np.pad(moving, ((0, 0), (trellis.width, trellis.width), (0, 0)))
    coupling = Coupling(0.1, np.random.default_rng(7).uniform(-3, 3, (3, 4, 70)))
    for drawn in (None, coupling):
        kept = trellis.paths_and_costs(bases, moving, None, drawn)
        with monkeypatch.context() as patch:
            patch.setattr(module, "ROW_BYTES", 0)
            chosen = trellis.paths_and_costs(bases, moving, max_bytes, drawn)
        for got, expected in zip(chosen, kept, strict=True):
            np.testing.assert_array_equal(got, expected)


@pytest.mark.parametrize("sizes", [(1, 1), (3, 100), (50, 7), (97, 203)])
@pytest.mark.parametrize("reach", [5, 25, 900])
def test_tiles_cover_every_pair_once(sizes, reach):
    trellis = Trellis(step_table(), 0.5, reach)
    count = np.zeros(sizes, dtype=int)
    for some, columns in trellis.tiles(*sizes, n_features=16):
        count[some, columns] += 1
        shape = count[some, columns].shape
        alone = list(trellis.tiles(*shape, n_features=16))
        assert alone == [(slice(0, shape[0]), slice(0, shape[1]))]
    assert (count == 1).all()


def test_memory_grows_with_the_band():
    """2000 frames in a band of 81: a full matrix of float64 would take 32 MB."""
    bases, moving = draw(np.random.default_rng(5), 1, 2000, n_features=3)
    trellis = Trellis(step_table(), 0.5, 40)
    tracemalloc.start()
    trellis.paths(bases, moving[:1])
    everything = tracemalloc.get_traced_memory()[1]
    tracemalloc.reset_peak()
    trellis.paths(bases, moving[:1], max_bytes=0)
    little = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert everything < 2.5e6
    assert little < 0.6e6
