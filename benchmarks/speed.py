"""Time and memory, side by side with peers, as Markdown tables (docs/speed.md).

Ours and the peers run in alternation, one thread each, the peers in an environment of their own;
times are of the processor but for cold starts, workers and the tables of memory. Each figure is a
median, each ratio a median of ratios within a round, with its quartiles.

    python -m venv peers && peers/bin/pip install dtaidistance aeon tslearn gdtw fdasrsf affinewarp
    python benchmarks/speed.py --peers peers/bin/python --data ../shared/data

The C recurrence needs a C compiler named cc. ``--only pair,pairs`` runs some of the sections.
"""

import os

for _name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "NUMBA_NUM_THREADS"):
    os.environ[_name] = "1"

import argparse
import ctypes
import platform
import subprocess
import sys
import tempfile
import time
from functools import partial
from pathlib import Path

import joblib
import numpy as np
import sklearn_motionsync
from jobs import random_walks
from sklearn.pipeline import make_pipeline
from sklearn_motionsync import ASpace, DenseSynchronizer, DirectionCosines, LinearSynchronizer
from sklearn_motionsync.datasets import load_performances, make_bending
from sklearn_motionsync.matching.costs import step_table
from sklearn_motionsync.matching.tile import Bases
from sklearn_motionsync.matching.trellis import Trellis

HERE = Path(__file__).resolve().parent
PAPER = {"cost": "posture", "max_rate": 2, "consensus": 0}
ARCHIVES = {
    "hdm05": "hdm05",
    "utkinect": "utkinect",
    "cmu07_walk": "cmu07_walk",
    "uiprmd": "uiprmd_odd",
}
FOLDER = Path(tempfile.mkdtemp(prefix="motionsync-speed-"))


# -- data, and the three kinds of runners ------------------------------------------------


def walks(n=40, n_frames=100, n_features=16, seed=0):
    """Random walks about a common mean, and their file."""
    path = FOLDER / f"{n}-{n_frames}-{n_features}-{seed}.npy"
    if not path.exists():
        np.save(path, random_walks(n, n_frames, n_features, seed))
    return np.load(path), path


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


class Recurrence:
    """The recurrence in C, compiled on the spot."""

    def __init__(self):
        library = FOLDER / "recurrence.so"
        command = ["cc", "-O3", "-march=native", "-shared", "-fPIC", "-o", str(library)]
        subprocess.run([*command, str(HERE / "recurrence.c"), "-lm"], check=True)
        self._library = ctypes.CDLL(str(library))

    def __call__(self, X, reach, mu):
        """All ordered pairs."""
        X = np.ascontiguousarray(X)
        transposed = np.ascontiguousarray(X.transpose(0, 2, 1))
        out = np.empty((len(X), len(X)), dtype=X.dtype)
        single = X.dtype == np.float32
        name, real = ("float", ctypes.c_float) if single else ("double", ctypes.c_double)
        pointers = [ctypes.c_void_p(a.ctypes.data) for a in (X, transposed, out)]
        function = getattr(self._library, f"all_pairs_{name}")
        function(*pointers, *map(ctypes.c_int, (*X.shape, reach)), real(mu))
        return out


def products(trellis, X):
    """The matrix products of all pairs, and nothing else."""
    for _, _, tile in trellis.tiles_of(Bases(trellis, X), X):
        for _ in tile.costs_of_samples(0, X.shape[1], *trellis.windows(X.shape[1])):
            pass


# -- tables --------------------------------------------------------------------------------


def compare(title, jobs, rounds, against=None, note=""):
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
    print(f"\n## {title}\n")
    if note:
        print(note + "\n")
    print(f"| | ms | times {against} |\n|---|---|---|")
    for name in names:
        values, base = np.array(seconds[name]), np.array(seconds[against])
        if np.isnan(values).all():
            continue
        low, middle, high = np.percentile(values / base, [25, 50, 75])
        print(
            f"| {name} | {1e3 * np.median(values):.4g} | {middle:.3g} ({low:.3g} to {high:.3g}) |"
        )
    sys.stdout.flush()
    return {name: float(np.median(values)) for name, values in seconds.items()}


def fit(X, clock=time.process_time, **settings):
    """A job: fit."""
    return lambda: timed(lambda: DenseSynchronizer(**settings).fit(X), clock)


def pair(peers):
    """One pair with its path, and one sequence to a fitted pattern."""
    X, path = walks()
    trellis = Trellis(step_table(), 1.0, 25)
    paper, ours = DenseSynchronizer(**PAPER).fit(X), DenseSynchronizer().fit(X)
    direct = DenseSynchronizer(consensus=0).fit(X)
    # Next to nothing to compute: what is left are calls.
    two, one_frame = X[:, :, :2], {"max_offset": 1 / X.shape[1]}
    bare = DenseSynchronizer(**one_frame).fit(two)
    bare_paper = DenseSynchronizer(**PAPER, **one_frame).fit(two)
    compare(
        "One pair of 100 x 16 with its path",
        {
            "trellis, the paper's settings": lambda: timed(lambda: trellis.paths(X[:1], X[1:2])),
            "`transform`, the paper's settings": lambda: timed(lambda: paper.transform(X[1:2])),
            "`transform`, defaults without consensus": lambda: timed(
                lambda: direct.transform(X[1:2])
            ),
            "`transform`, defaults": lambda: timed(lambda: ours.transform(X[1:2])),
            "the paper's settings, two features, one frame of offset": lambda: timed(
                lambda: bare_paper.transform(two[1:2])
            ),
            "defaults, two features, one frame of offset": lambda: timed(
                lambda: bare.transform(two[1:2])
            ),
            "one of 40 in `transform`, defaults": lambda: timed(lambda: ours.transform(X)) / 40,
            **{
                job: partial(peers, job, path)
                for job in ("aeon path", "tslearn path", "dtaidistance path", "gdtw path")
            },
        },
        rounds=21,
        against="`transform`, defaults",
    )
    wide = Trellis(step_table("velocity", 4), 0.01, 40)
    compare(
        "Forty trials to a fitted template of 100 x 16",
        {
            "its trellis, the paper's settings": lambda: timed(lambda: trellis.paths(X[:1], X)),
            "`transform` of 40, the paper's settings": lambda: timed(lambda: paper.transform(X)),
            "its trellis, defaults: nine bases": lambda: timed(lambda: wide.paths(X[:9], X)),
            "`transform` of 40, defaults": lambda: timed(lambda: ours.transform(X)),
        },
        rounds=21,
    )
    compare(
        "One pair, fdasrsf",
        {
            "`transform`, defaults": lambda: timed(lambda: ours.transform(X[1:2])),
            "fdasrsf path": partial(peers, "fdasrsf path", path),
        },
        rounds=5,
    )


def pairs(peers, title, rounds=15, **size):
    """All pairs of a set."""
    X, path = walks(**size)
    single, n_frames = X.astype(np.float32), X.shape[1]
    reach = n_frames // 4
    trellis, recurrence = Trellis(step_table(), 1.0, reach), Recurrence()
    np.testing.assert_allclose(
        recurrence(X, reach, 1.0), trellis.distances(X, X), rtol=1e-8, atol=1e-6
    )
    jobs = {
        "dtaidistance, upper half": partial(peers, "dtaidistance pairs", path),
        "matrix products alone, float64": lambda: timed(lambda: products(trellis, X)),
        "trellis, float64": lambda: timed(lambda: trellis.distances(X, X)),
        "C recurrence, float64": lambda: timed(lambda: recurrence(X, reach, 1.0)),
        "`fit`, the paper's settings, float64": fit(X, **PAPER),
        "trellis, float32": lambda: timed(lambda: trellis.distances(single, single)),
        "C recurrence, float32": lambda: timed(lambda: recurrence(single, reach, 1.0)),
        "`fit`, the paper's settings, float32": fit(single, **PAPER),
        "`fit`, defaults, float64": fit(X),
        "`fit`, defaults, float32": fit(single),
        "aeon": partial(peers, "aeon pairs", path),
        "tslearn": partial(peers, "tslearn pairs", path),
    }
    if len(X) > 40 or X.shape[1:] != (100, 16):
        for name in ("aeon", "tslearn"):
            del jobs[name]
    if not peers.python:
        del jobs["dtaidistance, upper half"]
    compare(title, jobs, rounds)


def one_source(n=40, n_frames=100, n_features=16, noise=0.05):
    """Trials of a single source: one movement, each with timing and noise of its own."""
    rng, t = np.random.default_rng(0), np.linspace(0, 1, n_frames)
    knots = np.linspace(0, 1, 12)
    curves = [np.interp(t, knots, x) for x in rng.standard_normal((n_features, len(knots)))]
    warps = t + 0.05 * np.sin(np.pi * t) * rng.standard_normal((n, 1))
    X = np.array([[np.interp(warp, t, x) for x in curves] for warp in warps]).swapaxes(1, 2)
    return X + noise * X.std() * rng.standard_normal(X.shape)


def real_sets(data):
    """Real performances as points of their aSpace, by archive, action, and the people in the set.

    The sets of an action are all people together, and each person with three or more.
    """
    for archive, name in ARCHIVES.items():
        bunch = load_performances(Path(data) / archive / f"{name}_positions.npz")
        if archive == "uiprmd":  # markers: about their mean
            shaped = [x.reshape(len(x), -1, 3) for x in bunch.data]
            postures = [(x - x.mean(axis=1, keepdims=True)).reshape(len(x), -1) for x in shaped]
        else:
            postures = DirectionCosines(bunch.skeleton).fit_transform(bunch.data)
        labels, actors = np.asarray(bunch.target), np.asarray(bunch.actor)
        for label in np.unique(labels):
            own = np.flatnonzero(labels == label)
            for actor in [None, *np.unique(actors[own])]:
                some = own if actor is None else own[actors[own] == actor]
                alone = len(np.unique(actors[own])) == 1
                if len(some) >= 3 and not (alone and actor is None):
                    X = ASpace(16).fit_transform([postures[i] for i in some])
                    yield archive, label, actor, X


def sources(peers, data):
    """Where refining is on, and where it is not."""
    sets, counts = {"one source, 40": one_source()}, {}
    sets["simulated bends, 40"] = np.load(bends(40)).astype(float)
    sets["random walks, 40"] = walks()[0]
    for archive, label, actor, X in real_sets(data):
        key = archive, "all people" if actor is None else "each person"
        refines = DenseSynchronizer(100).fit(X).refines_
        counts[key] = np.add(counts.get(key, 0), (refines, 1))
        if actor is None and len(X) > 23:
            X = LinearSynchronizer(100).fit_transform(X[:: max(1, len(X) // 40)])[:40]
            sets[f"{archive}, {label}, {len(X)}"] = X.astype(float)
    print("\n## Trials of one source, and of people\n")
    print(
        "| trials of 100 x 16 | refined | dtaidistance, pairs, ms | `fit`, ms | ratio ",
        end="",
    )
    print(
        "| dtaidistance, path, ms | `transform` of one, ms | of all, each, ms |\n"
        + 8 * "|---"
        + "|"
    )
    for k, (name, X) in enumerate(sets.items()):
        np.save(path := FOLDER / f"set-{k}.npy", X)
        sync = DenseSynchronizer().fit(X)
        jobs = (
            partial(peers, "dtaidistance pairs", path),
            fit(X),
            partial(peers, "dtaidistance path", path),
            lambda s=sync, x=X[1:2]: timed(lambda: s.transform(x)),
            lambda s=sync, x=X: timed(lambda: s.transform(x)) / len(x),
        )
        seconds = np.array([[job() for job in jobs] for _ in range(16)])[1:]
        pairs_, fits, *others = (f"{1e3 * x:.3g}" for x in np.median(seconds, axis=0))
        low, ratio, high = np.percentile(seconds[:, 1] / seconds[:, 0], [25, 50, 75])
        cells = [name, "yes" if sync.refines_ else "no", pairs_, fits]
        cells += [f"{ratio:.2f} ({low:.2f} to {high:.2f})", *others]
        print(f"| {' | '.join(cells)} |", flush=True)
    print("\n| real sets | | refined | of |\n|---|---|---|---|")
    for (archive, kind), (refined, of) in counts.items():
        print(f"| {archive} | {kind} | {refined} | {of} |")


def whole(peers):
    """Pattern and all warps of a set."""
    X, path = walks()
    ours = {
        "`fit_transform`, the paper's settings": lambda: timed(
            lambda: DenseSynchronizer(**PAPER).fit_transform(X)
        ),
        "`fit_transform`, defaults": lambda: timed(lambda: DenseSynchronizer().fit_transform(X)),
    }
    jobs = ("dtaidistance DBA", "tslearn DBA", "aeon DBA")
    title = "The whole job: template and all warps of 40 trials of 100 x 16"
    compare(
        title,
        {**ours, **{job: partial(peers, job, path) for job in jobs}},
        rounds=11,
        against="`fit_transform`, defaults",
        note="DBA gives a mean, 10 iterations, without the warps.",
    )
    slow = ("affinewarp fit", "fdasrsf Karcher mean")
    compare(
        "The whole job, slow peers",
        {**ours, **{job: partial(peers, job, path) for job in slow}},
        rounds=3,
        against="`fit_transform`, defaults",
    )


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


def bends(n):
    """Bends of the embedded action on 100 frames, as points of their aSpace."""
    path = FOLDER / f"bends-{n}.npy"
    bunch = make_bending(n, random_state=0)
    points = make_pipeline(DirectionCosines(bunch.skeleton), ASpace(16)).fit_transform(bunch.data)
    np.save(path, LinearSynchronizer(100).fit_transform(points))
    return path


def many(peers):
    """Thousands of performances."""
    print("\n## Many trials of 100 x 16: time, memory\n")
    print("| N | settings | fit, s | transform, s | peak MB | MB before |")
    print("|---|---|---|---|---|---|")
    for n in (100, 200, 400, 1000, 2000, 5000, 10000):
        path = bends(n)
        for name, settings in (("paper", PAPER), ("defaults", {})):
            fitted, warped, after, before = map(float, measure(path, settings))
            print(
                f"| {n} | {name} | {fitted:.2f} | {warped:.2f} | {after:.0f} | {before:.0f} |",
                flush=True,
            )


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
    if not peers.python:
        del jobs["dtaidistance long path"]
    compare("Two takes of 20,000 frames x 16, `max_offset=0.05`", jobs, rounds=3)
    print("\n| settings | fit, s | transform of both, s | peak MB |\n|---|---|---|---|")
    for name, settings in (("paper", PAPER), ("defaults", {})):
        got = list(map(float, measure(path, {**given, **settings})[:3]))
        print(f"| {name} | {got[0]:.2f} | {got[1]:.2f} | {got[2]:.0f} |", flush=True)


def growth(peers):
    """How time grows: slopes on log-log axes."""
    print("\n## Growth of `fit`: slope of log time against log size\n")
    print("| | sizes | paper | defaults |\n|---|---|---|---|")
    axes = {
        "n": (50, 100, 200, 400, 800),
        "n_frames": (50, 100, 200, 400),
        "n_features": (4, 16, 64),
    }
    for axis, sizes in axes.items():
        slopes = []
        for settings in (PAPER, {}):
            seconds = []
            for size in sizes:
                X, _ = walks(**{"n": 24, axis: size})
                job = fit(X, **settings)
                seconds.append(np.median([job() for _ in range(5)]))
            slopes.append(np.polyfit(np.log(sizes), np.log(seconds), 1)[0])
        shown = ", ".join(map(str, sizes))
        print(f"| {axis} | {shown} | {slopes[0]:.2f} | {slopes[1]:.2f} |", flush=True)


def workers(peers):
    """One and two workers, the same job."""
    for name, settings, n in (("defaults", {}, 600), ("the paper's settings", PAPER, 1200)):
        X, _ = walks(n=n)
        settings = {**settings, "clock": time.perf_counter}
        shared = fit(X, n_jobs=2, **settings)

        def in_processes(shared=shared):
            with joblib.parallel_config(backend="loky"):
                return shared()

        jobs = {
            "1 worker": fit(X, **settings),
            "`n_jobs=2`: threads": shared,
            "`n_jobs=2`: processes, already running": in_processes,
        }
        compare(f"Workers: `fit` of {n} trials, {name}", jobs, rounds=3)


SECTIONS = {
    "pair": pair,
    "pairs": partial(pairs, title="All pairs of 40 trials of 100 x 16"),
    "n10": partial(pairs, title="All pairs of 10 trials", n=10),
    "n100": partial(pairs, title="All pairs of 100 trials", n=100, rounds=5),
    "n200": partial(pairs, title="All pairs of 200 trials", n=200, rounds=3),
    "frames": partial(pairs, title="All pairs of 40 trials of 200 x 16", n_frames=200),
    "features": partial(pairs, title="All pairs of 40 trials of 100 x 60", n_features=60),
    "sources": sources,
    "whole": whole,
    "cold": cold,
    "long": long,
    "many": many,
    "growth": growth,
    "workers": workers,
}


def main():
    """Print the tables."""
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--peers", help="the Python of the peers' environment")
    parser.add_argument("--data", help="the folder of the real recordings")
    parser.add_argument("--only", help="sections, separated by commas", default=",".join(SECTIONS))
    options = parser.parse_args()
    peers = Peers(options.peers)
    print(
        f"{platform.machine()}, {os.cpu_count()} cores, Python {platform.python_version()}, NumPy "
        f"{np.__version__}, sklearn_motionsync {sklearn_motionsync.__version__}; "
        f"{peers.versions()}."
    )
    for name in options.only.split(","):
        SECTIONS[name](*[peers, options.data][: 1 + (name == "sources")])


if __name__ == "__main__":
    main()
