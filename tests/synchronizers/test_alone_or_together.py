"""A warp depends on its trial and the fitted synchronizer only, also where costs tie."""

import numpy as np
import pytest
from sklearn_motionsync import ASpace, DenseSynchronizer, DirectionCosines
from sklearn_motionsync.matching.costs import COSTS, step_table
from sklearn_motionsync.matching.trellis import Trellis

PAPER = {"cost": "pose", "max_rate": 2, "consensus": 0}
SETTINGS = {
    "no metric": {"metric": None},
    "paper": PAPER,
    "paper, free changes of pace": {**PAPER, "smoothness": 0},
    **{cost: {"cost": cost} for cost in COSTS},
    "refined": {"refine": True},
}


def held(X):
    """All of one length, the last frame held: all ways to spend the remaining time tie."""
    n_frames = max(map(len, X)) + 20
    return [np.concatenate([x, np.repeat(x[-1:], n_frames - len(x), axis=0)]) for x in X]


def piecewise(X):
    """Constant over eight frames at a time."""
    return [x[np.arange(len(x)) // 8 * 8] for x in X]


TIES = {
    "held": held,
    "held and rounded": lambda X: held([x.round(1) for x in X]),
    "piecewise constant": piecewise,
    "whole numbers": lambda X: [x.round() for x in X],
    "as they are": list,
}


@pytest.fixture(scope="module")
def real_aspace(bends):
    """Real bends as points of their aSpace."""
    return ASpace().fit_transform(DirectionCosines(bends.skeleton).fit_transform(bends.data))


@pytest.mark.parametrize(
    ("ties", "settings", "dtype"),
    [
        *(("held", settings, np.float64) for settings in SETTINGS),
        *((ties, "paper", np.float64) for ties in TIES if ties != "held"),
        ("as they are", "refined", np.float64),
        ("as they are", "velocity", np.float64),
        ("held and rounded", "refined", np.float32),
    ],
)
def test_match_has_equal_bits_alone_and_in_groups(real_aspace, ties, settings, dtype):
    """Six alone, three, thirteen, and all: tiles of different shapes."""
    X = [x.astype(dtype) for x in TIES[ties](real_aspace[:14])]
    n_frames = 40 if ties != "as they are" else None
    sync = DenseSynchronizer(n_frames, **SETTINGS[settings]).fit(X)
    together = sync.match(X)
    assert together.distances.dtype == np.float64
    for size, last in ((1, 6), (3, len(X)), (13, len(X))):
        groups = [sync.match(X[i : i + size]) for i in range(0, last, size)]
        for name in ("times", "distances"):
            parts = [getattr(match, name) for match in groups]
            assert np.concatenate(parts).tobytes() == getattr(together, name)[:last].tobytes()


@pytest.mark.parametrize("settings", ["paper", "refined", "velocity"])
def test_single_precision_warps_are_equal_among_double(bending_aspace, settings):
    X = [x.astype(np.float32) for x in bending_aspace[:9]]
    sync = DenseSynchronizer(40, **SETTINGS[settings]).fit(X)
    alone = sync.match(X).times
    among = sync.match([*X, bending_aspace[0]]).times[:-1]
    np.testing.assert_array_equal(among, alone)


@pytest.mark.parametrize("cost", COSTS)
@pytest.mark.parametrize("n_others", [0, 3, 60])
def test_ties_go_to_the_first_entry_of_the_step_table(cost, n_others):
    """Rest, move three frames late, rest: many paths tie.

    The back-tracking keeps the pace for as long as that costs nothing.
    """
    rng = np.random.default_rng(0)
    P, start, stop, late = 60, 12, 30, 3
    x, y = np.zeros((2, 1, P, 2))
    x[0, start:stop] = rng.integers(1, 9, (stop - start, 2))
    y[0, start + late : stop + late] = x[0, start:stop]
    others = rng.standard_normal((n_others, P, 2))
    trellis = Trellis(step_table(cost, max_rate=2), 0.01, 10)
    offsets = trellis.paths(x, np.concatenate([y, others]))[0, 0]
    expected = np.zeros(P)
    # At rate 0 the elastic cost does not count what the moving sequence does: a frame earlier.
    until = stop if cost == "elastic" else stop + 1
    expected[: until + 3] = [0, 1, 2, *[late] * (until - 3), 2, 1, 0]
    np.testing.assert_array_equal(offsets, expected)


def test_small_differences_decide():
    rng = np.random.default_rng(1)
    poses = rng.standard_normal((1, 25, 4)).repeat(2, axis=1)
    moving = poses.copy()
    moving[:, 1::2] += 1e-4  # the second of two like poses is the one of the base
    trellis = Trellis(step_table("pose", max_rate=2), 0.0, 5)
    q = trellis.paths(poses + 1e-4, moving)[0, 0] + np.arange(50)
    assert (q[1:] % 2 == 1).all()
