"""Distances between trials: against plain loops, closed forms and people."""

import itertools

import numpy as np
import pandas as pd
import pytest
from joblib import parallel_config
from sklearn_motionsync import to_frame
from sklearn_motionsync.recognition import distances, synchronization_distances
from sklearn_motionsync.recognition.distances import (
    BLOCK,
    PairwiseDistance,
    blocks_of_pairs,
    normalise_time,
)
from sklearn_motionsync.utils.parallel import Progress, run

import oracle


def walks(n, n_features=3, seed=0, shortest=3, longest=60):
    """Random walks of any lengths."""
    rng = np.random.default_rng(seed)
    lengths = rng.integers(shortest, longest, n)
    return [np.cumsum(rng.standard_normal((k, n_features)), axis=0) for k in lengths]


# -- the distance, written out ----------------------------------------------------------

COSTS = "pose", "velocity", "elastic"


def slow_features(x, cost, n_frames, normalize):
    at = np.linspace(0, len(x) - 1, n_frames)
    x = np.column_stack([np.interp(at, np.arange(len(x)), column) for column in x.T])
    x = oracle.FEATURES[cost](x, 1.0, 0.06 * (n_frames - 1))
    return x / np.sqrt((x**2).sum(axis=1).mean()) if normalize else x


def slow_distance(x, y, cost, n_frames, normalize, mu=0.003):
    a, b = (slow_features(z, cost, n_frames, normalize) for z in (x, y))
    settings = oracle.step_costs(cost, 4, 1), mu, 1, int(0.25 * n_frames)
    return (oracle.plain_loops(a, b, *settings) + oracle.plain_loops(b, a, *settings)) / 2


def distances_between(X, Y, cost, n_frames, **settings):
    """Those of features in any unit, too, as the classifier compares poses."""
    comparison = PairwiseDistance(cost, n_frames=n_frames, **settings)
    features = [comparison.features(normalise_time(Z, n_frames)) for Z in (X, Y)]
    return distances.pairwise_distances(comparison, *features, progress=Progress(None, 0))


@pytest.mark.parametrize("cost", COSTS)
@pytest.mark.parametrize("normalize", [True, False])
def test_distances_equal_plain_loops(cost, normalize):
    X, Y = walks(4), walks(3, seed=1)
    expected = [[slow_distance(x, y, cost, 14, normalize) for y in Y] for x in X]
    found = distances_between(X, Y, cost, 14, normalize=normalize)
    np.testing.assert_allclose(found, expected, rtol=1e-9)
    if normalize:
        settings = {"cost": cost, "n_frames": 14}
        np.testing.assert_array_equal(synchronization_distances(X, Y, **settings), found)
        within = synchronization_distances(X, **settings)
        assert (np.diag(within) == 0).all()
        np.testing.assert_allclose(within, synchronization_distances(X, X, **settings))
        assert (within == within.T).all()


# -- independence of other pairs --------------------------------------------------------


@pytest.mark.parametrize("cost", COSTS)
@pytest.mark.parametrize("normalize", [True, False])
def test_distance_depends_on_the_pair_alone(cost, normalize):
    X = walks(2 * BLOCK + 7, n_features=5)
    settings = {"cost": cost, "normalize": normalize, "n_frames": 30}
    D = distances_between(X, X, **settings)
    order = np.random.default_rng(0).permutation(len(X))
    mixed = [X[i] for i in order]
    again = distances_between(mixed, mixed, **settings)
    np.testing.assert_array_equal(again, D[np.ix_(order, order)])
    part = distances_between(X[3:20], X[30:], **settings)
    np.testing.assert_array_equal(part, D[3:20, 30:])
    assert distances_between([X[5]], [X[33]], **settings) == D[5, 33]


# Of 13 bases, and of 8 moving sequences.
PARTS = slice(0, 5), slice(5, 13)


@pytest.mark.parametrize("cost", COSTS)
@pytest.mark.parametrize("dtype", [np.float64, np.float32])
@pytest.mark.parametrize(("n_features", "n_frames"), [(3, 2), (41, 17), (1, 33)])
def test_blocks_of_any_shape_have_the_same_bits(cost, dtype, n_features, n_frames):
    shared = {"normalize": True, "n_frames": n_frames, "max_offset": 0.4, "dtype": dtype}
    comparison = PairwiseDistance(cost, **shared)
    X = comparison.features(normalise_time(walks(21, n_features), n_frames))
    bases, moving = X[:13], X[13:]
    D = comparison.block(bases, moving)
    assert X.dtype == D.dtype == dtype
    rows = np.concatenate([comparison.block(bases[i : i + 1], moving) for i in range(13)])
    columns = np.hstack([comparison.block(bases, moving[i : i + 1]) for i in range(8)])
    parts = np.block([[comparison.block(bases[a], moving[b]) for b in PARTS] for a in PARTS])
    for found in (rows, columns, parts):
        np.testing.assert_array_equal(found, D)


@pytest.mark.parametrize("n_bases", [1, 16, 17, 1000])
@pytest.mark.parametrize("n_moving", [1, 3, 300])
def test_blocks_hold_every_pair_once_and_nothing_else(n_bases, n_moving):
    counts = np.zeros((n_bases, n_moving), dtype=int)
    blocks = blocks_of_pairs(n_bases, n_moving)
    for rows, columns in blocks:
        counts[rows, columns] += 1
    assert (counts == 1).all()
    sizes = [len(range(*r.indices(n_bases))) * len(range(*c.indices(n_moving))) for r, c in blocks]
    assert max(sizes) <= BLOCK**2
    # A single trial does not take more blocks than its share of many.
    if n_bases == 1:
        assert len(blocks) == -(-n_moving // BLOCK**2)


def test_single_precision_is_right_to_six_digits():
    """Time is normalised in double precision, whatever the trials have."""
    X = [x.astype(np.float32) for x in walks(20, 5)]
    on_clock = normalise_time([x.astype(np.float64) for x in X], 50)
    for one, double in zip(normalise_time(X, 50), on_clock, strict=True):
        assert one.dtype == np.float64
        np.testing.assert_array_equal(one, double)
    for cost, normalize in itertools.product(COSTS, (True, False)):
        both = []
        for dtype in (np.float64, np.float32):
            shared = {"normalize": normalize, "n_frames": 50, "max_offset": 0.4, "dtype": dtype}
            comparison = PairwiseDistance(cost, **shared)
            features = comparison.features(on_clock)
            both.append(comparison.block(features, features))
        assert (np.diag(both[1]) == 0).all()
        np.testing.assert_allclose(both[1], both[0], rtol=1e-5, atol=1e-6 * both[0].max())


def test_jobs_share_the_pairs_and_give_the_same_distances(monkeypatch):
    """None is compared twice."""
    X, blocks, jobs = walks(BLOCK * 8), [], []
    expected = synchronization_distances(X, n_frames=12)

    def recorded(function, portions, *, common, n_jobs, step):
        jobs.append(n_jobs)
        blocks.extend(str(block) for portion in portions for block in portion[0])
        return run(function, portions, common=common, n_jobs=n_jobs, step=step)

    monkeypatch.setattr(distances, "run", recorded)
    with parallel_config(backend="threading"):
        found = synchronization_distances(X, n_frames=12, n_jobs=2)
    np.testing.assert_array_equal(found, expected)
    assert jobs == [2]
    assert len(blocks) == len(set(blocks)) == 64


def test_verbose_prints_progress(capsys):
    synchronization_distances(walks(20), walks(3), n_frames=8, verbose=1)
    lines = capsys.readouterr().out.splitlines()
    assert [line.split(":")[0] for line in lines] == [
        "[synchronization_distances] comparing 20 with 3 trials",
        "[synchronization_distances] comparing 3 with 20 trials",
    ]


# -- units and still trials ------------------------------------------------------


@pytest.mark.parametrize("cost", COSTS)
def test_normalized_distances_do_not_depend_on_units(cost):
    X = walks(7)
    D = synchronization_distances(X, cost=cost)
    each = [x * 2.0 ** (4 * i) for i, x in enumerate(X)]
    np.testing.assert_array_equal(synchronization_distances(each, cost=cost), D)


@pytest.mark.parametrize("cost", ["velocity", "elastic"])
@pytest.mark.parametrize("at", [0, 1e6 / 3, -7e-9])
def test_still_trials_are_far_from_moving_ones(cost, at):
    X = walks(4, longest=30)
    still = [np.full((n, 3), at) for n in (2, 9, 40)]
    D = distances_between(still, [*X, *still], cost, 50, max_offset=0)
    np.testing.assert_allclose(D[:, :4], 100)
    assert (D[:, 4:] == 0).all()


# -- input ------------------------------------------------------------------------------


def test_every_kind_of_collection_gives_the_same_distances():
    X = walks(5, shortest=20, longest=21)
    D = synchronization_distances(X)
    table = to_frame(X, columns=list("abc"))
    names = [pd.DataFrame(x, columns=list("abc")) for x in X]
    for given in (np.stack(X), table, names, [x.tolist() for x in X]):
        np.testing.assert_array_equal(synchronization_distances(given), D)
        np.testing.assert_array_equal(synchronization_distances(given, given), D)
    rows = np.stack([x[:, 0] for x in X])
    expected = synchronization_distances([x[:, :1] for x in X])
    np.testing.assert_array_equal(synchronization_distances(rows), expected)
    np.testing.assert_array_equal(synchronization_distances(rows, rows[:2]), expected[:, :2])


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"Y": walks(2, 4)}, "Trial 0 has 4 features a frame, but synchronization_distances"),
        ({"Y": np.ones((2, 9))}, "wrap one sequence as"),
        ({"Y": [np.full((5, 3), np.nan)]}, "Trial 0, frame 0, feature 0 is NaN"),
        ({"X": []}, "0 trials"),
        ({"cost": "speed"}, "'cost' parameter of synchronization_distances"),
    ],
)
def test_invalid_input_is_refused(change, message):
    with pytest.raises(ValueError, match=message):
        synchronization_distances(**({"X": walks(3)} | change))


def test_two_frames():
    X = [np.array([[0.0], [1]]), np.array([[0.0], [-1]]), np.array([[5.0], [6], [7]])]
    for cost in COSTS:
        D = synchronization_distances(X, cost=cost, n_frames=2)
        assert np.isfinite(D).all()
    expected = [[0, 8, 0], [8, 0, 8], [0, 8, 0]]
    np.testing.assert_allclose(synchronization_distances(X, n_frames=2), expected)
