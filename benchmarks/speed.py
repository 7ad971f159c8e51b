"""Time and memory, side by side with peers, as Markdown tables (docs/speed.md).

Ours and the peers run in alternation, one thread each, the peers in an environment of their own;
times are of the processor but for cold starts and the table of memory. Each figure is a median,
each ratio a median of ratios within a round, with its quartiles.

    python -m venv peers && peers/bin/pip install dtaidistance aeon tslearn gdtw fdasrsf affinewarp
    python benchmarks/speed.py --peers peers/bin/python

``--only pair,pairs`` runs some of the sections. What changes from one version to the next is timed
by compare.py, and thousands of trials by scaling.py.
"""

import os

for _name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "NUMBA_NUM_THREADS"):
    os.environ[_name] = "1"

import argparse
import platform
import subprocess
import sys
import tempfile
import time
from functools import partial
from pathlib import Path

import numpy as np
import sklearn_motionsync
from jobs import random_walks
from sklearn_motionsync import DenseSynchronizer

HERE = Path(__file__).resolve().parent
PAPER = {"cost": "posture", "max_rate": 2, "consensus": 0}
FOLDER = Path(tempfile.mkdtemp(prefix="motionsync-speed-"))


# -- data and runners --------------------------------------------------------------------


def walks(n=40, n_frames=100, n_features=16):
    """Random walks about a common mean, and their file."""
    X, path = random_walks(n, n_frames, n_features), FOLDER / f"{n}-{n_frames}-{n_features}.npy"
    np.save(path, X)
    return X, path


def timed(function, clock=time.process_time):
    """Seconds of one run: of the processor, which other work on the machine moves less."""
    start = clock()
    function()
    return clock() - start


class Peers:
    """A process in the peers' environment."""

    def __init__(self, python):
        self.python, self.process = python, None
        if python:
            self.process = subprocess.Popen(
                [python, "-W", "ignore", str(HERE / "speed_peers.py")],
                stdin=subprocess.PIPE,
                stdout=subprocess.PIPE,
                stderr=subprocess.DEVNULL,
                text=True,
            )

    def __call__(self, job, path):
        """Seconds of one run, or nan."""
        if self.process is None:
            return np.nan
        self.process.stdin.write(f"{job}\t{path}\n")
        self.process.stdin.flush()
        answer = self.process.stdout.readline().strip()
        try:
            return float(answer)
        except ValueError:
            print(f"{job}: {answer}", file=sys.stderr)
            return np.nan

    def versions(self):
        """What is installed there."""
        if not self.python:
            return "no peers"
        command = [self.python, "-W", "ignore", str(HERE / "speed_peers.py"), "versions"]
        return subprocess.run(command, capture_output=True, text=True, check=True).stdout.strip(
            ", "
        )


# -- tables --------------------------------------------------------------------------------


def compare(title, jobs, rounds, against=None):
    """Run jobs in alternation and print a table; ``jobs`` give seconds."""
    names = list(jobs)
    against = against or names[0]
    seconds = {name: [] for name in names}
    for job in jobs.values():
        if rounds > 1:
            job()
    for _ in range(rounds):
        for name, job in jobs.items():
            seconds[name].append(job())
    # Without peers there are no figures of theirs.
    measured = {name: np.array(some) for name, some in seconds.items() if not np.isnan(some).all()}
    against = against if against in measured else next(iter(measured))
    print(f"\n## {title}\n\n| | ms | times {against} |\n|---|---|---|")
    for name, values in measured.items():
        base = measured[against]
        low, middle, high = np.percentile(values / base, [25, 50, 75])
        print(
            f"| {name} | {1e3 * np.median(values):.4g} | {middle:.3g} ({low:.3g} to {high:.3g}) |"
        )
    sys.stdout.flush()


def fit(X, **settings):
    """A job: fit."""
    return lambda: timed(lambda: DenseSynchronizer(**settings).fit(X))


def transform(sync, X):
    """A job: transform."""
    return lambda: timed(lambda: sync.transform(X))


def pair(peers):
    """One pair with its path, and one sequence to a fitted pattern."""
    X, path = walks()
    paper, ours = DenseSynchronizer(**PAPER).fit(X), DenseSynchronizer().fit(X)
    # Next to nothing to compute: what is left are calls.
    two, one_frame = X[:, :, :2], {"max_offset": 1 / X.shape[1]}
    bare = DenseSynchronizer(**one_frame).fit(two)
    bare_paper = DenseSynchronizer(**PAPER, **one_frame).fit(two)
    one, defaults = X[1:2], "`transform`, defaults"
    jobs = {
        "`transform`, the paper's settings": transform(paper, one),
        "`transform`, defaults without consensus": transform(
            DenseSynchronizer(consensus=0).fit(X), one
        ),
        defaults: transform(ours, one),
        "the paper's settings, two features, one frame of offset": transform(bare_paper, two[1:2]),
        "defaults, two features, one frame of offset": transform(bare, two[1:2]),
        "one of 40 in `transform`, defaults": lambda: transform(ours, X)() / 40,
    }
    names = ("aeon path", "tslearn path", "dtaidistance path", "gdtw path")
    jobs |= {name: partial(peers, name, path) for name in names}
    compare("One pair of 100 x 16 with its path", jobs, 21, defaults)
    slow = {defaults: transform(ours, one), "fdasrsf path": partial(peers, "fdasrsf path", path)}
    compare("One pair, fdasrsf", slow, 5)
    jobs = {
        "`transform` of 40, the paper's settings": transform(paper, X),
        "`transform` of 40, defaults": transform(ours, X),
    }
    compare("Forty trials to a fitted template of 100 x 16", jobs, 21)


def pairs(peers, title, rounds=15, **size):
    """All pairs of a set."""
    X, path = walks(**size)
    jobs = {"dtaidistance, upper half": partial(peers, "dtaidistance pairs", path)}
    for kind, some in (("float64", X), ("float32", X.astype(np.float32))):
        jobs[f"`fit`, the paper's settings, {kind}"] = fit(some, **PAPER)
        jobs[f"`fit`, defaults, {kind}"] = fit(some)
    if X.shape == (40, 100, 16):
        jobs |= {name: partial(peers, f"{name} pairs", path) for name in ("aeon", "tslearn")}
    compare(title, jobs, rounds)


def whole(peers):
    """Pattern and all warps of a set."""
    X, path = walks()
    base, ours = "`fit_transform`, defaults", {}
    for name, settings in (("the paper's settings", PAPER), ("defaults", {})):
        make = partial(DenseSynchronizer, **settings)
        ours[f"`fit_transform`, {name}"] = partial(timed, lambda make=make: make().fit_transform(X))
    title = "The whole job: template and all warps of 40 trials of 100 x 16"
    for names, rounds in (
        (("dtaidistance DBA", "tslearn DBA", "aeon DBA"), 11),
        (("affinewarp fit", "fdasrsf Karcher mean"), 3),
    ):
        jobs = {**ours, **{name: partial(peers, name, path) for name in names}}
        compare(title, jobs, rounds, base)
    print("\nDBA gives a mean, 10 iterations, without the warps.")


def cold(peers):
    """Import and first result in a new process."""
    _, path = walks()
    ours = (
        "import sys, numpy; from sklearn_motionsync import DenseSynchronizer;"
        "DenseSynchronizer().fit_transform(numpy.load(sys.argv[1]))"
    )
    base = (
        "import sklearn.decomposition, sklearn.pipeline, sklearn.utils.parallel, pandas,"
        "scipy.signal, scipy.interpolate"
    )

    def run(*command):
        subprocess.run(command, check=True, capture_output=True)

    jobs = {
        "ours, defaults, template and all warps": [sys.executable, "-c", ours, str(path)],
        "`import sklearn_motionsync`": [sys.executable, "-c", "import sklearn_motionsync"],
        "importing what it needs of scikit-learn, pandas, scipy": [sys.executable, "-c", base],
    }
    if peers.python:
        server = [peers.python, "-W", "ignore", str(HERE / "speed_peers.py")]
        names = ("dtaidistance DBA", "tslearn path", "tslearn DBA", "aeon path", "aeon DBA")
        names += ("gdtw path", "fdasrsf path", "affinewarp fit")
        jobs |= {name: [*server, name, str(path)] for name in names}
    clock = time.perf_counter
    table = {name: partial(timed, partial(run, *job), clock) for name, job in jobs.items()}
    compare("Cold start: a new process to its first result", table, rounds=3)


MEASURE = """
import sys, time
import numpy as np
from sklearn_motionsync import DenseSynchronizer
def peak():
    with open("/proc/self/status") as status:
        return int(next(line for line in status if line.startswith("VmHWM")).split()[1])
X = np.load(sys.argv[1])
before = peak()
start = time.perf_counter()
sync = DenseSynchronizer({settings}).fit(X)
fitted = time.perf_counter()
sync.transform(X)
after = peak()
print(fitted - start, time.perf_counter() - fitted, after / 1024, before / 1024)
"""


def measure(path, settings):
    """Seconds of fit and transform and peak memory of a process of its own."""
    code = MEASURE.format(settings=", ".join(f"{k}={v!r}" for k, v in settings.items()))
    command = [sys.executable, "-c", code, str(path)]
    return subprocess.run(command, check=True, capture_output=True, text=True).stdout.split()


def long(peers):
    """Two takes of 20,000 frames."""
    rng = np.random.default_rng(0)
    n_frames = 20_000
    t = np.linspace(0, 1, n_frames)
    knots = np.linspace(0, 1, 400)
    curve = np.column_stack([np.interp(t, knots, rng.standard_normal(400)) for _ in range(16)])
    warp = t + 0.02 * np.sin(2 * np.pi * t)
    other = np.column_stack([np.interp(warp, t, c) for c in curve.T])
    X = np.stack([curve, other]) + 0.05 * rng.standard_normal((2, n_frames, 16))
    path = FOLDER / "long.npy"
    np.save(path, X)
    given = {"pattern": 0, "max_offset": 0.05}
    jobs = {
        "dtaidistance long path": partial(peers, "dtaidistance long path", path),
        "`fit` and `match`, the paper's settings": lambda: timed(
            lambda: DenseSynchronizer(**given, **PAPER).fit(X).match(X[1:])
        ),
        "`fit` and `match`, defaults": lambda: timed(
            lambda: DenseSynchronizer(**given).fit(X).match(X[1:])
        ),
    }
    compare("Two takes of 20,000 frames x 16, `max_offset=0.05`", jobs, rounds=3)
    print("\n| settings | fit, s | transform of both, s | peak MB |\n|---|---|---|---|")
    for name, settings in (("paper", PAPER), ("defaults", {})):
        got = list(map(float, measure(path, {**given, **settings})[:3]))
        print(f"| {name} | {got[0]:.2f} | {got[1]:.2f} | {got[2]:.0f} |", flush=True)


SECTIONS = {
    "pair": pair,
    "pairs": partial(pairs, title="All pairs of 40 trials of 100 x 16"),
    "n10": partial(pairs, title="All pairs of 10 trials", n=10),
    "n100": partial(pairs, title="All pairs of 100 trials", n=100, rounds=5),
    "frames": partial(pairs, title="All pairs of 40 trials of 200 x 16", n_frames=200),
    "features": partial(pairs, title="All pairs of 40 trials of 100 x 60", n_features=60),
    "whole": whole,
    "cold": cold,
    "long": long,
}


def main():
    """Print the tables."""
    parser = argparse.ArgumentParser(description=__doc__.split("\n", maxsplit=1)[0])
    parser.add_argument("--peers", help="the Python of the peers' environment")
    parser.add_argument("--only", help="sections, separated by commas", default=",".join(SECTIONS))
    options = parser.parse_args()
    peers = Peers(options.peers)
    print(
        f"{platform.machine()}, {os.cpu_count()} cores, Python {platform.python_version()}, NumPy "
        f"{np.__version__}, sklearn_motionsync {sklearn_motionsync.__version__}; "
        f"{peers.versions()}."
    )
    for name in options.only.split(","):
        SECTIONS[name](peers)


if __name__ == "__main__":
    main()
