"""Time, side by side with other packages, as Markdown tables (docs/speed.md).

    pip install . dtaidistance aeon tslearn gdtw
    python benchmarks/speed.py [--only pair,pairs]

Ours and the others run in turns on one thread; times are of the processor but for cold starts. Each
figure is a median, each ratio a median of ratios within a round, with its quartiles. Packages that
are not installed are left out. What changes from one version to the next is timed by compare.py.
"""

import os

for _name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "NUMBA_NUM_THREADS"):
    os.environ[_name] = "1"

import argparse
import contextlib
import io
import platform
import subprocess
import sys
import time
import warnings
from functools import partial

import numpy as np
from harness import print_head, print_row, print_versions
from jobs import random_walks
from sklearn_motionsync import DenseSynchronizer

PAPER = {"cost": "pose", "max_rate": 2, "consensus": 0}
DEFAULTS, PAPERS = "defaults", "the paper's settings"
PACKAGES = ("dtaidistance", "aeon", "tslearn", "gdtw")

# -- the other packages: each gives a job on trials (n, n_frames, n_features) -------------


def dtaidistance_pairs(X):
    from dtaidistance import dtw_ndim

    window, trials = X.shape[1] // 4 + 1, list(X)
    return lambda: dtw_ndim.distance_matrix_fast(trials, window=window, only_triu=True)


def dtaidistance_path(X):
    from dtaidistance import dtw_ndim

    window = X.shape[1] // 4 + 1
    return lambda: dtw_ndim.warping_path(X[0], X[1], window=window, use_c=True)


def dtaidistance_average(X):
    from dtaidistance import dtw_barycenter

    trials = list(X)
    return lambda: dtw_barycenter.dba_loop(trials, trials[0], max_it=10, use_c=True)


def aeon_pairs(X):
    from aeon.distances import dtw_pairwise_distance

    channels = np.ascontiguousarray(X.transpose(0, 2, 1))
    return lambda: dtw_pairwise_distance(channels, window=0.25)


def aeon_path(X):
    from aeon.distances import dtw_alignment_path

    channels = np.ascontiguousarray(X.transpose(0, 2, 1))
    return lambda: dtw_alignment_path(channels[0], channels[1], window=0.25)


def tslearn_pairs(X):
    from tslearn.metrics import cdist_dtw

    return lambda: cdist_dtw(X, sakoe_chiba_radius=X.shape[1] // 4)


def tslearn_path(X):
    from tslearn.metrics import dtw_path

    return lambda: dtw_path(X[0], X[1], sakoe_chiba_radius=X.shape[1] // 4)


def gdtw_path(X):
    import gdtw

    def run():
        solver = gdtw.GDTW()
        solver.set_params({"x": X[0], "y": X[1], "t": np.linspace(0, 1, X.shape[1])})
        return solver.run()

    return run


PATHS = {
    "aeon path": aeon_path,
    "tslearn path": tslearn_path,
    "dtaidistance path": dtaidistance_path,
    "gdtw path": gdtw_path,
}
MATRIX = "dtaidistance, upper half"
PAIRS = {MATRIX: dtaidistance_pairs, "aeon": aeon_pairs, "tslearn": tslearn_pairs}
AVERAGES = {"dtaidistance DBA": dtaidistance_average}


def installed(makers, X):
    """Jobs of the packages that can be imported, which print nothing."""
    jobs = {}
    for name, make in makers.items():
        try:
            jobs[name] = quiet(make(X))
        except ImportError as error:
            print(f"{name} is left out: {error}", file=sys.stderr)
    return jobs


def quiet(function):
    """A function whose output and warnings are not shown."""

    def run():
        with contextlib.redirect_stdout(io.StringIO()), warnings.catch_warnings():
            warnings.simplefilter("ignore")
            function()

    return run


# -- tables --------------------------------------------------------------------------------


def compare(title, jobs, rounds, against, clock=time.process_time):
    """Run jobs in turns, and print the milliseconds of each and its ratio to one of them."""
    for job in jobs.values() if rounds > 1 else ():
        job()
    seconds = {name: [] for name in jobs}
    for _ in range(rounds):
        for name, job in jobs.items():
            start = clock()
            job()
            seconds[name].append(clock() - start)
    against = against if against in jobs else next(iter(jobs))
    print_head(title, ["ms", f"times {against}"])
    for name, values in seconds.items():
        ratios = np.divide(values, seconds[against])
        low, middle, high = np.percentile(ratios, [25, 50, 75])
        median = f"{1e3 * np.median(values):.4g}"
        print_row(name, [median, f"{middle:.3g} ({low:.3g} to {high:.3g})"])


def pair():
    """One pair with its path, and one trial to a fitted pattern."""
    X = random_walks()
    paper, ours = DenseSynchronizer(**PAPER).fit(X), DenseSynchronizer().fit(X)
    # Next to nothing to compute: what is left are calls.
    bare = DenseSynchronizer(max_offset=1 / X.shape[1]).fit(X[:, :, :2])
    base = "`transform`, defaults"
    jobs = {
        f"`transform`, {PAPERS}": lambda: paper.transform(X[1:2]),
        base: lambda: ours.transform(X[1:2]),
        "two features, one frame of offset": lambda: bare.transform(X[1:2, :, :2]),
        f"`transform` of 40, {PAPERS}": lambda: paper.transform(X),
        f"`transform` of 40, {DEFAULTS}": lambda: ours.transform(X),
    }
    compare("one pair of 100 x 16", jobs | installed(PATHS, X), 21, base)


def pairs():
    """All pairs of sets of several sizes."""
    for n, n_frames, n_features in ((40, 100, 16), (10, 100, 16), (100, 100, 16), (40, 200, 60)):
        X = random_walks(n, n_frames, n_features)
        jobs = installed(PAIRS if n == 40 and n_frames == 100 else {MATRIX: PAIRS[MATRIX]}, X)
        for kind, trials in (("float64", X), ("float32", X.astype(np.float32))):
            jobs[f"`fit`, {PAPERS}, {kind}"] = partial(DenseSynchronizer(**PAPER).fit, trials)
            jobs[f"`fit`, {DEFAULTS}, {kind}"] = partial(DenseSynchronizer().fit, trials)
        title = f"all pairs of {n} trials of {n_frames} x {n_features}"
        compare(title, jobs, 5 if n == 100 else 15, MATRIX)


def whole():
    """Pattern and all warps of a set, beside an average without warps."""
    X, base = random_walks(), f"`fit_transform`, {DEFAULTS}"
    ours = {
        f"`fit_transform`, {PAPERS}": partial(DenseSynchronizer(**PAPER).fit_transform, X),
        base: partial(DenseSynchronizer().fit_transform, X),
    }
    title = "pattern and all warps of 40 trials of 100 x 16"
    compare(title, ours | installed(AVERAGES, X), 11, base)


def cold():
    """From the start of a new process to its first result."""
    ours = (
        "import numpy; from sklearn_motionsync import DenseSynchronizer;"
        "DenseSynchronizer().fit_transform(numpy.random.default_rng(0).random((40, 100, 16)))"
    )
    needed = (
        "import sklearn.decomposition, sklearn.pipeline, sklearn.utils.parallel, pandas,"
        "scipy.signal, scipy.interpolate"
    )
    base = "pattern and all warps, defaults"
    commands = {
        base: ["-c", ours],
        "`import sklearn_motionsync`": ["-c", "import sklearn_motionsync"],
        "importing what it needs of scikit-learn, pandas, SciPy": ["-c", needed],
    }
    run = partial(subprocess.run, check=True, capture_output=True)
    jobs = {name: partial(run, [sys.executable, *rest]) for name, rest in commands.items()}
    compare("a new process to its first result", jobs, 3, base, time.perf_counter)


SECTIONS = {"pair": pair, "pairs": pairs, "whole": whole, "cold": cold}


def main():
    parser = argparse.ArgumentParser(description=__doc__.split("\n", maxsplit=1)[0])
    parser.add_argument("--only", help="sections, separated by commas", default=",".join(SECTIONS))
    options = parser.parse_args()
    print(f"{platform.machine()}, {os.cpu_count()} cores, Python {platform.python_version()}")
    print_versions(*PACKAGES)
    for name in options.only.split(","):
        SECTIONS[name]()


if __name__ == "__main__":
    main()
