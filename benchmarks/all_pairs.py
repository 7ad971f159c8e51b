"""All ordered pairs of 40 performances of 100 x 16 against dtaidistance's compiled matrix.

One thread, alternating runs in one process. Needs `pip install dtaidistance`.

    python benchmarks/all_pairs.py
"""

import os

for _name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"):
    os.environ[_name] = "1"

import time

import numpy as np
from dtaidistance import dtw_ndim
from sklearn_motionsync import DenseSynchronizer
from sklearn_motionsync.matching import Trellis, step_table

N, P, B, REACH, ROUNDS = 40, 100, 16, 25, 21
PAPER = {"cost": "posture", "max_rate": 2, "subframes": 1, "consensus": 0}


def main():
    """Print medians and ratios."""
    rng = np.random.default_rng(0)
    X = np.cumsum(rng.standard_normal((N, P, B)), axis=1)
    X -= X.mean(axis=(0, 1))
    single = X.astype(np.float32)
    peer_input = list(X)
    trellis = Trellis(step_table(), mu=1.0, max_disparity=REACH)
    jobs = {
        "dtaidistance, its upper half": lambda: dtw_ndim.distance_matrix_fast(
            peer_input, window=REACH + 1, only_triu=True
        ),
        "trellis float64": lambda: trellis.distances(X, X),
        "trellis float32": lambda: trellis.distances(single, single),
        "fit, the paper's settings, float64": lambda: DenseSynchronizer(**PAPER).fit(X),
        "fit, the paper's settings, float32": lambda: DenseSynchronizer(**PAPER).fit(single),
        "fit, defaults": lambda: DenseSynchronizer().fit(X),
        "fit_transform, defaults": lambda: DenseSynchronizer().fit_transform(X),
    }
    seconds = {name: [] for name in jobs}
    for job in jobs.values():
        job()
    for _ in range(ROUNDS):
        for name, job in jobs.items():
            start = time.perf_counter()
            job()
            seconds[name].append(time.perf_counter() - start)
    peer = np.array(seconds["dtaidistance, its upper half"])
    print(f"{N} x {N} pairs of {P} x {B}, medians of {ROUNDS} alternating runs")
    for name, values in seconds.items():
        ratios = np.percentile(np.array(values) / peer, [25, 50, 75])
        print(
            f"{name:36s} {1e3 * np.median(values):7.2f} ms   "
            f"ratio {ratios[1]:.2f} ({ratios[0]:.2f} to {ratios[2]:.2f})"
        )


if __name__ == "__main__":
    main()
