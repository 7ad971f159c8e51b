"""The trellis against versions that share no code with it."""

import tracemalloc

import numpy as np
import pytest
from sklearn_motionsync.matching import rows
from sklearn_motionsync.matching import trellis as narrow
from sklearn_motionsync.matching import trellis as tiling
from sklearn_motionsync.matching.costs import StepTable, step_table
from sklearn_motionsync.matching.rows import Coupling
from sklearn_motionsync.matching.trellis import Trellis

from oracle import all_free_paths, all_paths, brute_force, path_cost, plain_loops


def posture_costs(max_rate, subframes):
    """(b, g, phi) of every step, from the text of Eq. 16."""
    steps = range(int(max_rate * subframes) + 1)
    return {s: (1.0, 2.0, abs(s / subframes - 1)) for s in steps}


def rate_weighted_costs(max_rate, subframes):
    """Weights that differ from step to step, as those of the Fisher-Rao distance do."""
    steps = range(int(max_rate * subframes) + 1)
    return {s: (s / subframes, 2 * np.sqrt(s / subframes), 0.1 * s) for s in steps}


def table_of(costs, subframes):
    steps = np.array(sorted(costs, key=lambda s: (abs(s - subframes), s)))
    b, g, phi = np.array([costs[s] for s in steps]).T
    return StepTable(steps, b, g, phi, subframes)


def draw(rng, n, n_frames, subframes=1, n_features=2, whole=False):
    """Bases and moving sequences; whole numbers make ties."""
    shapes = (n, n_frames, n_features), (n + 1, (n_frames - 1) * subframes + 1, n_features)
    if whole:
        return [rng.integers(0, 2, shape).astype(float) for shape in shapes]
    return [rng.standard_normal(shape) for shape in shapes]


CASES = [
    # n_frames, max_rate, subframes, max_disparity, mu
    (6, 2, 1, 2, 0.3),
    (7, 2, 1, 6, 0.0),
    (7, 3, 1, 3, 0.7),
    (5, 2, 2, 2, 0.4),
    (5, 1.5, 2, 4, 0.1),
    (4, 4, 2, 3, 1.3),
    (5, 2, 1, 0, 0.5),
    (2, 2, 1, 1, 0.5),
    (6, 1, 1, 3, 0.2),
]


@pytest.mark.parametrize("make_costs", [posture_costs, rate_weighted_costs])
@pytest.mark.parametrize("case", CASES)
@pytest.mark.parametrize("whole", [False, True], ids=["reals", "ties"])
@pytest.mark.parametrize("dtype", [np.float64, np.float32])
@pytest.mark.parametrize("narrow_bytes", [0, 10**6], ids=["wide", "narrow"])
def test_equals_every_admissible_path(case, make_costs, whole, dtype, narrow_bytes, monkeypatch):
    monkeypatch.setattr(narrow, "NARROW_BYTES", [narrow_bytes] * 2)
    n_frames, max_rate, subframes, reach, mu = case
    costs = make_costs(max_rate, subframes)
    bases, moving = draw(np.random.default_rng(n_frames), 3, n_frames, subframes, whole=whole)
    bases, moving = bases.astype(dtype), moving.astype(dtype)
    trellis = Trellis(table_of(costs, subframes), mu, reach)
    distances = trellis.distances(bases, moving)
    assert distances.dtype == dtype
    close = {"rtol": 1e-10, "atol": 1e-12} if dtype == np.float64 else {"rtol": 1e-4, "atol": 1e-4}
    disparities = trellis.paths(bases, moving)
    for n, base in enumerate(bases):
        from_paths = trellis.costs(base, moving, disparities[n])
        assert from_paths.dtype == dtype
        np.testing.assert_allclose(from_paths, distances[n], **close)
        for m, sequence in enumerate(moving):
            x, y = base.astype(float), sequence.astype(float)
            best, paths = brute_force(x, y, costs, mu, subframes, reach)
            np.testing.assert_allclose(distances[n, m], best, **close)
            path = disparities[n, m] + subframes * np.arange(n_frames)
            if dtype == np.float64:
                assert tuple(path) in paths
            else:
                cost = path_cost(x, y, path, costs, mu, subframes)
                np.testing.assert_allclose(cost, best, **close)


@pytest.mark.parametrize("make_costs", [posture_costs, rate_weighted_costs])
@pytest.mark.parametrize("case", [(5, 2, 1, 2, 0.3), (4, 2, 2, 1, 0.4), (2, 3, 1, 4, 0.0)])
@pytest.mark.parametrize("n_bases", [1, 2])
def test_free_ends_equal_every_path(case, make_costs, n_bases):
    n_frames, max_rate, subframes, reach, mu = case
    costs, rng = make_costs(max_rate, subframes), np.random.default_rng(0)
    bases = rng.standard_normal((n_bases, n_frames, 2))
    moving = rng.standard_normal((3, (n_frames - 1) * subframes + 1 + 2 * reach * subframes, 2))
    trellis = Trellis(table_of(costs, subframes), mu, reach, free=True)
    to_all = trellis.ends(bases, moving)
    disparities = trellis.paths_to(trellis.ends_at, bases, moving)
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
                known = {tuple(q): t for q, t in zip(paths, totals, strict=True) if q[-1] == last}
                np.testing.assert_allclose(to_all[n, m, i], min(known.values()), atol=1e-12)
                d = disparities[n, m, i]
                path = tuple(trellis.lead + d + subframes * np.arange(n_frames))
                np.testing.assert_allclose(known[path], min(known.values()), atol=1e-12)
                added_up = trellis.costs(base, sequence[np.newaxis], d[np.newaxis])
                np.testing.assert_allclose(added_up, known[path], atol=1e-12)
            np.testing.assert_array_equal(best[n, m], disparities[n, m, to_all[n, m].argmin()])


def test_equal_free_ends_are_in_the_middle():
    trellis = Trellis(step_table(), 1.0, 4, free=True)
    assert not trellis.paths(np.zeros((1, 6, 2)), np.zeros((1, 14, 2))).any()


@pytest.mark.parametrize("make_costs", [posture_costs, rate_weighted_costs])
@pytest.mark.parametrize("n_bases", [1, 2])
@pytest.mark.parametrize("narrow_bytes", [0, 10**6], ids=["wide", "narrow"])
def test_coupled_paths_equal_every_path(make_costs, n_bases, narrow_bytes, monkeypatch):
    monkeypatch.setattr(narrow, "NARROW_BYTES", [narrow_bytes] * 2)
    costs, rng = make_costs(2, 2), np.random.default_rng(0)
    bases, moving = rng.standard_normal((n_bases, 5, 2)), rng.standard_normal((3, 9, 2))
    coupling = Coupling(0.7, rng.uniform(-1, 1, (n_bases, 3, 5)))
    trellis = Trellis(table_of(costs, 2), 0.2, 2)
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


@pytest.mark.parametrize("make_costs", [posture_costs, rate_weighted_costs])
@pytest.mark.parametrize("case", [(40, 2, 1, 10, 0.5), (33, 3, 2, 6, 0.2), (25, 4, 4, 8, 1.0)])
def test_equals_plain_loops(case, make_costs):
    n_frames, max_rate, subframes, reach, mu = case
    costs = make_costs(max_rate, subframes)
    bases, moving = draw(np.random.default_rng(1), 2, n_frames, subframes, n_features=5)
    distances = Trellis(table_of(costs, subframes), mu, reach).distances(bases, moving)
    expected = [[plain_loops(x, y, costs, mu, subframes, reach) for y in moving] for x in bases]
    np.testing.assert_allclose(distances, expected, rtol=1e-10)


def test_step_table_is_the_papers():
    table = step_table("posture", max_rate=2, subframes=1)
    costs = {
        s: (b, g, phi)
        for s, b, g, phi in zip(table.steps, table.moving, table.inner, table.penalty, strict=True)
    }
    assert costs == posture_costs(2, 1)


def test_ties_keep_the_pace():
    """Between paths of equal cost the diagonal wins: standing still says nothing of time."""
    still = np.zeros((1, 9, 2))
    for mu in (0.0, 1.0):
        trellis = Trellis(step_table(), mu, 4)
        assert trellis.distances(still, still) == 0
        assert not trellis.paths(still, still).any()


@pytest.mark.parametrize("subframes", [1, 3])
def test_paths_are_pinned_monotone_and_in_the_band(subframes):
    bases, moving = draw(np.random.default_rng(2), 4, 50, subframes)
    table = step_table("posture", max_rate=3, subframes=subframes)
    disparities = Trellis(table, 0.01, 7).paths(bases, moving)
    assert (disparities[..., [0, -1]] == 0).all()
    assert np.abs(disparities).max() <= 7 * subframes
    steps = np.diff(disparities) + subframes
    assert steps.min() >= 0
    assert steps.max() <= 3 * subframes


TABLES = [step_table(), step_table("velocity", max_rate=4, subframes=2)]


@pytest.mark.parametrize("table", TABLES, ids=["one group", "several"])
@pytest.mark.parametrize("n_bases", [1, 2, 5])
def test_tiles_do_not_change_the_answer(n_bases, table, monkeypatch):
    bases, moving = draw(np.random.default_rng(3), n_bases, 30, table.subframes, n_features=4)
    trellis = Trellis(table, 0.5, 8)
    whole = trellis.distances(bases, moving)
    paths = trellis.paths(bases, moving)
    monkeypatch.setattr(tiling, "TILE_PRODUCT", 1)
    monkeypatch.setattr(tiling, "TILE_BASES", 2)
    monkeypatch.setattr(tiling, "LONG_ROW", 1)
    monkeypatch.setattr(rows, "PRODUCT_ROWS", 3)
    monkeypatch.setattr(narrow, "NARROW_BYTES", [0, 0])
    np.testing.assert_allclose(trellis.distances(bases, moving), whole, rtol=1e-12)
    np.testing.assert_array_equal(trellis.paths(bases, moving), paths)


@pytest.mark.parametrize("table", TABLES, ids=["one group", "several"])
@pytest.mark.parametrize("n_bases", [1, 3])
@pytest.mark.parametrize("n_frames", [2, 16, 17, 150])
def test_rows_that_are_not_kept_are_computed_again(n_frames, n_bases, table, monkeypatch):
    """Little memory, the same bits."""
    monkeypatch.setattr(narrow, "NARROW_BYTES", [0, 0])
    bases, moving = draw(np.random.default_rng(3), n_bases, n_frames, table.subframes)
    trellis = Trellis(table, 0.5, min(40, n_frames - 1))
    paths = trellis.paths(bases, moving)
    np.testing.assert_array_equal(trellis.paths(bases, moving, max_bytes=0), paths)


@pytest.mark.parametrize("sizes", [(1, 1), (3, 100), (50, 7), (97, 203)])
@pytest.mark.parametrize("reach", [5, 25, 900])
def test_tiles_cover_every_pair_once_and_are_tiles_themselves(sizes, reach):
    trellis = Trellis(step_table(), 0.5, reach)
    count = np.zeros(sizes, dtype=int)
    for some, columns in trellis.tiles(*sizes, n_features=16):
        count[some, columns] += 1
        shape = count[some, columns].shape
        alone = list(trellis.tiles(*shape, n_features=16))
        assert alone == [(slice(0, shape[0]), slice(0, shape[1]))]
    assert (count == 1).all()


@pytest.mark.parametrize("sizes", [(60, 900), (400, 500), (1000, 40)])
@pytest.mark.parametrize("reach", [5, 25, 400])
def test_tiles_are_as_large_as_they_may_be(sizes, reach):
    """The product of a row, a cell for every pair and offset, fills its room, and no more."""
    trellis = Trellis(step_table(), 0.5, reach)
    shapes = [
        (some.stop - some.start, columns.stop - columns.start)
        for some, columns in trellis.tiles(*sizes, n_features=16)
    ]
    products = [n * m * (2 * reach + 1) * (16 + 2) for n, m in shapes]
    assert max(n for n, _ in shapes) <= tiling.TILE_BASES
    assert max(products) <= tiling.TILE_PRODUCT
    assert min(products) > tiling.TILE_PRODUCT / 3


@pytest.mark.parametrize(
    ("sizes", "reach", "n_bases"),
    [((7, 1024), 0, 1), ((7, 1023), 0, 7), ((8, 3000), 0, 8), ((7, 20), 26, 1), ((7, 19), 26, 7)],
)
def test_few_bases_with_long_rows_are_taken_one_by_one(sizes, reach, n_bases):
    """Less than 8 bases, 1024 cells and more."""
    tiles = Trellis(step_table(), 0.5, reach).tiles(*sizes, n_features=3)
    assert {some.stop - some.start for some, _ in tiles} == {n_bases}


def test_memory_grows_with_the_band_not_with_the_square():
    """4000 frames in a band of 81: a full matrix of float64 would take 128 MB."""
    bases, moving = draw(np.random.default_rng(5), 1, 4000, n_features=3)
    trellis = Trellis(step_table(), 0.5, 40)
    tracemalloc.start()
    trellis.paths(bases, moving[:1])
    everything = tracemalloc.get_traced_memory()[1]
    tracemalloc.reset_peak()
    trellis.paths(bases, moving[:1], max_bytes=0)
    little = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert everything < 5e6
    assert little < 1e6


def test_inputs_may_be_read_only_and_are_not_written():
    bases, moving = draw(np.random.default_rng(4), 2, 12)
    copies = bases.copy(), moving.copy()
    bases.flags.writeable = moving.flags.writeable = False
    trellis = Trellis(step_table(), 0.5, 4)
    trellis.distances(bases, moving)
    trellis.paths(bases, moving)
    np.testing.assert_array_equal(bases, copies[0])
    np.testing.assert_array_equal(moving, copies[1])
