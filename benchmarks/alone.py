"""Whether warps depend on what else is warped (docs/design.md).

Performances whose costs tie are matched all together, and again one by one, in threes and in
thirteens: counts the cases in which a warp, or a distance, is not the same to the last bit. Real
bends are read from an archive.

    python benchmarks/alone.py ../shared/data/hdm05/hdm05_positions.npz
"""

import os

for _name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"):
    os.environ[_name] = "1"

import itertools
import sys

import numpy as np
from sklearn.pipeline import make_pipeline
from sklearn_motionsync import ASpace, DenseSynchronizer, DirectionCosines
from sklearn_motionsync.datasets import load_performances, make_bending

PAPER = {"cost": "posture", "max_rate": 2, "consensus": 0}
SETTINGS = {
    "defaults": {},
    "paper": PAPER,
    "paper, smoothness=0": {**PAPER, "smoothness": 0},
    "elastic": {"cost": "elastic"},
    "refined": {"refine": True},
    "posture, voted on": {"cost": "posture"},
    "no vote": {"consensus": 0},
}


def held(X):
    """All of one length, the last frame held."""
    n_frames = max(map(len, X)) + 20
    return [np.concatenate([x, np.repeat(x[-1:], n_frames - len(x), axis=0)]) for x in X]


KINDS = {
    "as they are": list,
    "held": held,
    "rounded": lambda X: [x.round(1) for x in X],
    "held and rounded": lambda X: held([x.round(1) for x in X]),
    "piecewise constant": lambda X: [x[np.arange(len(x)) // 8 * 8] for x in X],
    "whole numbers": lambda X: [x.round() for x in X],
}


def sets(path):
    """Synthetic bends, real bends, random walks."""
    bunch = make_bending(random_state=0)
    steps = DirectionCosines(bunch.skeleton), ASpace(6)
    yield make_pipeline(*steps).fit_transform(bunch.data)
    bunch = load_performances(path)
    bends = [x for x, t in zip(bunch.data, bunch.target, strict=True) if t == "depositFloorR"]
    yield make_pipeline(DirectionCosines(bunch.skeleton), ASpace()).fit_transform(bends)
    rng = np.random.default_rng(0)
    lengths = rng.integers(30, 60, size=60)
    yield [np.cumsum(rng.standard_normal((n, 5)), axis=0) for n in lengths]


def differs(X, settings, n_frames):
    """Whether times and distances differ, and the largest difference of times."""
    sync = DenseSynchronizer(n_frames, **settings).fit(X)
    together, moved, changed, most = sync.match(X), False, False, 0.0
    for size in (1, 3, 13):
        for i in range(0, len(X), size):
            few, rows = sync.match(X[i : i + size]), slice(i, i + size)
            moved |= few.times.tobytes() != together.times[rows].tobytes()
            changed |= few.distances.tobytes() != together.distances[rows].tobytes()
            most = max(most, np.abs(few.times - together.times[rows]).max())
    return moved, changed, most


def main():
    """Print a table."""
    print("| performances | cases | other warps | other distances | largest difference, frames |")
    print("|---|---|---|---|---|")
    data = list(sets(sys.argv[1]))
    for name, kind in KINDS.items():
        rows = [
            differs([x.astype(dtype) for x in kind(X)], settings, n_frames)
            for X, dtype, settings, n_frames in itertools.product(
                data, (np.float64, np.float32), SETTINGS.values(), (None, 100)
            )
        ]
        moved, changed, most = np.array(rows, dtype=float).T
        counts = f"{len(rows)} | {moved.sum():.0f} | {changed.sum():.0f}"
        print(f"| {name} | {counts} | {most.max():.3g} |", flush=True)


if __name__ == "__main__":
    main()
