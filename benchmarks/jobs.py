"""The jobs that `compare.py` times, and the process that runs them for one version of the package.

    python benchmarks/compare.py BASE

Every job goes by the public names of this checkout. `JOBS` has a function for each, which takes the
`Data` and makes everything ready; the `Work` that it returns is what is timed. As a process, this
file reads requests from its standard input, a line each, and answers each with a line of JSON:
``list`` gives the names of the jobs and where the package is, ``prepare NAME`` makes one job ready
and runs it once, and ``run`` runs it and gives the milliseconds of the processor.

    python benchmarks/jobs.py [--data ../shared/data]
"""

import os

for _name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "NUMBA_NUM_THREADS"):
    os.environ[_name] = "1"
os.environ["MPLBACKEND"] = "Agg"

import argparse
import json
import sys
import tempfile
import time
import warnings
from collections.abc import Callable
from functools import cached_property, partial
from pathlib import Path
from typing import NamedTuple

import numpy as np
import sklearn_motionsync
from harness import DATA, P, known_warps
from sklearn.pipeline import make_pipeline
from sklearn_motionsync import (
    ActionClassifier,
    ActionDetector,
    ActionModel,
    ASpace,
    DenseSynchronizer,
    DirectionCosines,
    LinearSynchronizer,
    PartSynchronizer,
)
from sklearn_motionsync.comparison import compare_groups, compare_to_norm
from sklearn_motionsync.datasets import load_trials, make_bending
from sklearn_motionsync.display import SynchronizationDisplay
from sklearn_motionsync.io import read_motion
from sklearn_motionsync.live import MotionTracker, OnlineSynchronizer
from sklearn_motionsync.model import find_departures
from sklearn_motionsync.recognition import synchronization_distances
from sklearn_motionsync.report import write_report
from sklearn_motionsync.synchronizers import blend_trials
from sklearn_motionsync.takes import CycleSegmenter, find_trials

ROOT = Path(__file__).resolve().parents[1]

# -- made data --------------------------------------------------------------------------


def random_walks(n=40, n_frames=P, n_features=16, seed=0):
    """Random walks about a common mean: (n, n_frames, n_features)."""
    rng = np.random.default_rng(seed)
    X = np.cumsum(rng.standard_normal((n, n_frames, n_features)), axis=1)
    return X - X.mean(axis=(0, 1))


def warped_sines(n, seed=0, movement=0, n_features=16):
    """Sums of eight sines, of sizes that vary by trial, weakly warped: (n, P, n_features).

    Sets of the same ``movement`` show the same one.
    """
    sizes = np.random.default_rng(movement).standard_normal((8, n_features))
    rng, phase = np.random.default_rng(seed), np.linspace(0, 1, P)
    out = np.empty((n, P, n_features))
    for x in out:
        shifts = 0.08 * rng.standard_normal(3)
        waves = sum(a * np.sin(np.pi * k * phase) / k for k, a in enumerate(shifts, start=1))
        sines = np.sin(np.pi * np.outer(phase + waves, np.arange(1, 9)))
        x[:] = sines @ (sizes * (1 + 0.15 * rng.standard_normal((8, n_features))))
        x += 0.03 * rng.standard_normal(x.shape)
    return out


def three_actions(n_each, seed):
    """Trials of three actions, one after the other, and their actions."""
    X = [warped_sines(n_each, seed=seed + k, movement=k) for k in range(3)]
    return np.concatenate(X), np.repeat(np.arange(3), n_each)


def long_take(n=20_000):
    """A random walk from 0 to 0 that shows a trial of 100 frames every 1000 frames."""
    x = np.cumsum(0.1 * np.random.default_rng(0).standard_normal((n, 16)), axis=0)
    x -= np.linspace(0, 1, n)[:, np.newaxis] * x[-1]
    for start in range(500, n - 200, 1000):
        x[start : start + P] = warped_sines(1, seed=start)[0]
    return x


def long_walk(n=5000):
    """Eight harmonics of steps of about 110 frames, whose pace changes every 200 frames."""
    rng, knots = np.random.default_rng(0), np.arange(0, n + 200, 200)
    pace = 1 + 0.02 * np.interp(np.arange(n), knots, rng.standard_normal(len(knots)))
    phase = np.cumsum(2 * np.pi / 110 * pace)
    harmonics = np.column_stack([np.sin(k * phase + k) / k for k in range(1, 9)])
    return harmonics + 0.05 * rng.standard_normal((n, 8))


class Data:
    """Trials by their names; each is read, or made, when it is first asked for."""

    def __init__(self, folder):
        self.folder = Path(folder)

    @cached_property
    def hdm05(self):
        """The archive of real motion capture."""
        return load_trials(self.folder / "hdm05" / "hdm05_positions.npz")

    @cached_property
    def hop_positions(self):
        """33 hops of four people: joint positions."""
        pairs = zip(self.hdm05.data, self.hdm05.target, strict=True)
        return [x for x, target in pairs if target == "hopBothLegs1hops"]

    @cached_property
    def hops(self):
        """The hops as points of their aSpace."""
        poses = DirectionCosines(self.hdm05.skeleton).fit_transform(self.hop_positions)
        points = ASpace(0.95).fit_transform(poses)
        return [np.ascontiguousarray(x, dtype=float) for x in points]

    @cached_property
    def hops_on_clock(self):
        """The same on 100 frames."""
        return list(LinearSynchronizer(P).fit_transform(self.hops))

    @cached_property
    def hop_feature(self):
        """The first feature of these."""
        return [x[:, :1] for x in self.hops_on_clock]

    @cached_property
    def simulated(self):
        """40 bends of the embedded action."""
        return make_bending(40, random_state=0)

    @cached_property
    def copies(self):
        """40 warped copies of a single source."""
        return list(known_warps(0, 0.5, 2.0, 0.02, n=40)[0])

    @cached_property
    def walks(self):
        """40 random walks."""
        return list(random_walks())

    def recorded(self, name):
        """The path of a file as it was recorded."""
        return str(self.folder / "original_files" / name)


# -- what jobs are made of --------------------------------------------------------------


class Work(NamedTuple):
    """What is timed, and the number of equal parts that it has: times are those of one part."""

    run: Callable[[], object]
    parts: int = 1


def dense():
    """The synchronizer of most jobs."""
    return DenseSynchronizer(n_frames=P)


def paper():
    """The one with the settings of the paper."""
    return DenseSynchronizer.paper(n_frames=P)


def fit(make, *training):
    """A fit of a new estimator."""
    return Work(lambda: make().fit(*training))


def of_all(estimator, X, method="transform"):
    """A method of an estimator that is fitted to the same trials."""
    return Work(partial(getattr(estimator.fit(X), method), X))


def lone(estimator, X, method="transform"):
    """A method of an estimator that is fitted to all, of one trial at a time, ten times."""
    method = getattr(estimator.fit(X), method)

    def run():
        for i in range(10):
            method(X[i : i + 1])

    return Work(run, 10)


def with_model():
    """A synchronizer and a model."""
    return make_pipeline(dense(), ActionModel())


def on_model(data, method):
    """A method of the fitted pipeline of synchronizer and model."""
    pipe = with_model().fit(data.hops_on_clock)
    return Work(partial(method, pipe))


def detector():
    """A detector of what is on the clock."""
    return ActionDetector(with_model())


def online(data):
    """A fitted synchronizer of running movements."""
    return OnlineSynchronizer(dense(), frame_rate=120).fit(data.hops)


def tracker():
    """A tracker of hidden and noisy joints."""
    return MotionTracker(dense(), frame_rate=120, random_state=0)


def steps(estimator, frames):
    """A whole trial, frame by frame."""

    def run():
        estimator.reset()
        for frame in frames:
            estimator.step(frame)

    return Work(run, len(frames))


def drawn(draw):
    """A figure, drawn and closed."""
    import matplotlib.pyplot as plt

    def run():
        draw()
        plt.close("all")

    return Work(run)


# -- jobs of more than one line ---------------------------------------------------------


def part_sync(data):
    n_features = data.hops_on_clock[0].shape[1]
    halves = {"a": range(n_features // 2), "b": range(n_features // 2, n_features)}
    parts = {name: list(columns) for name, columns in halves.items()}
    return fit(lambda: PartSynchronizer(parts=parts), data.hops_on_clock)


def clf_predict30(data):
    classifier = ActionClassifier().fit(*three_actions(20, 0))
    return Work(partial(classifier.predict, three_actions(10, 50)[0]))


def searched(query):
    """The search for a trial in a long take."""
    return Work(partial(find_trials, query, long_take()))


def aspace_fit(data):
    poses = DirectionCosines(data.hdm05.skeleton).fit_transform(data.hop_positions)
    return Work(lambda: ASpace(0.95).fit_transform(poses))


def read_c3d(data):
    paths = [data.recorded(f"c3d/Eb015{take}.c3d") for take in ("pi", "pr", "si")]
    return Work(lambda: [read_motion(path) for path in paths])


def cycles_segment(data):
    segmenter = CycleSegmenter(start=0).fit([long_walk(3000)])
    take = long_walk()
    return Work(lambda: segmenter.segment([take]))


def disp_sync(data):
    sync = dense().fit(data.hops_on_clock)
    return drawn(lambda: SynchronizationDisplay.from_estimator(sync, data.hops_on_clock))


def of_match(data, method):
    """A method of the match of the hops."""
    match = dense().fit(data.hops_on_clock).match(data.hops_on_clock)
    return Work(getattr(match, method))


def blend(data):
    bunch = data.simulated
    pipe = make_pipeline(DirectionCosines(bunch.skeleton), ASpace(16), dense()).fit(bunch.data)
    pair = bunch.data[:2]
    return Work(lambda: blend_trials(pipe, pair, [0.5, 0.5], skeleton=bunch.skeleton))


def compare_groups40(data):
    X, groups = warped_sines(40), np.repeat([0, 1], 20)
    sync = dense().fit(X)
    return Work(lambda: compare_groups(sync, X, groups))


def compare_norm(data):
    X, groups = warped_sines(40), ["n"] * 30 + list("abcdefghij")
    sync = dense().fit(X[:30])
    return Work(lambda: compare_to_norm(sync, X, groups, norm="n"))


def report40(data):
    X, folder = warped_sines(40), tempfile.TemporaryDirectory()
    sync = dense().fit(X)
    return Work(lambda: write_report(Path(folder.name) / "report.html", sync, X))


# -- all jobs ---------------------------------------------------------------------------

JOBS = {
    "fit_source40": lambda data: fit(dense, data.copies),
    "fit_walks40": lambda data: fit(dense, data.walks),
    "fit_hops33": lambda data: fit(dense, data.hops_on_clock),
    "fit_curves400": lambda data: fit(dense, warped_sines(400)),
    "fit_n10": lambda data: fit(dense, data.hops_on_clock[:10]),
    "fit_1feature": lambda data: fit(dense, data.hop_feature),
    "paper64_source": lambda data: fit(paper, data.copies),
    "paper64_walks": lambda data: fit(paper, data.walks),
    "paper32_walks": lambda data: fit(paper, np.float32(data.walks)),
    "lone_hops": lambda data: lone(dense(), data.hops_on_clock),
    "lone_source": lambda data: lone(dense(), data.copies),
    "lone_paper": lambda data: lone(paper(), data.walks),
    "lone_1feature": lambda data: lone(dense(), data.hop_feature),
    "all_hops33": lambda data: of_all(dense(), data.hops_on_clock),
    "part_sync": part_sync,
    "linear_ft": lambda data: Work(lambda: LinearSynchronizer(P).fit_transform(data.hops_on_clock)),
    "model_only_fit": lambda data: fit(ActionModel, dense().fit_transform(data.hops_on_clock)),
    "model_predict": lambda data: of_all(with_model(), data.hops_on_clock, "predict"),
    "model_sample": lambda data: on_model(data, lambda pipe: pipe[-1].sample(20, random_state=0)),
    "departures": lambda data: on_model(
        data, lambda pipe: find_departures(pipe, data.hops_on_clock[:5])
    ),
    "detector_fit": lambda data: fit(detector, data.hops_on_clock),
    "detector_predict": lambda data: of_all(detector(), data.hops_on_clock, "predict"),
    "detector_lone": lambda data: lone(detector(), data.hops_on_clock, "predict"),
    "clf_fit60": lambda data: fit(ActionClassifier, *three_actions(20, 0)),
    "clf_predict30": clf_predict30,
    "clf_reject_fit60": lambda data: fit(
        partial(ActionClassifier, reject_below="auto"), *three_actions(20, 0)
    ),
    "search_20000": lambda data: searched(warped_sines(1)[0]),
    "search_sync_20000": lambda data: searched(dense().fit(warped_sines(20))),
    "live_step": lambda data: steps(online(data), data.hops[0]),
    "live_fit": lambda data: fit(partial(OnlineSynchronizer, dense(), frame_rate=120), data.hops),
    "tracker_fit": lambda data: fit(tracker, data.hops),
    "tracker_track": lambda data: Work(
        partial(tracker().fit(data.hops).track, data.hops[:1]), len(data.hops[0])
    ),
    "tracker_smooth": lambda data: Work(
        partial(tracker().fit(data.hops).smooth, data.hops[:1]), len(data.hops[0])
    ),
    "cosines_hops": lambda data: of_all(
        DirectionCosines(data.hdm05.skeleton), list(data.hdm05.data)
    ),
    "aspace_fit": aspace_fit,
    "read_bvh": lambda data: Work(partial(read_motion, data.recorded("bvh/007_01.bvh"))),
    "read_c3d": read_c3d,
    "cycles_fit": lambda data: fit(partial(CycleSegmenter, start=0), [long_walk()]),
    "cycles_segment": cycles_segment,
    "pairwise_velocity": lambda data: Work(partial(synchronization_distances, data.hops_on_clock)),
    "disp_sync": disp_sync,
    "to_frame_match": lambda data: of_match(data, "to_frame"),
    "blend": blend,
    "compare_groups40": compare_groups40,
    "compare_norm": compare_norm,
    "report40": report40,
    "interval33": lambda data: of_match(data, "interval"),
}

# -- the process ------------------------------------------------------------------------


def answer(request, data, work):
    """The answer to a request, and the job that is ready then."""
    match request.split():
        case ["list"]:
            return {"jobs": list(JOBS), "package": sklearn_motionsync.__file__}, work
        case ["prepare", name]:
            work = JOBS[name](data)
            work.run()
            return {}, work
        case ["run"]:
            start = time.process_time()
            work.run()
            return {"ms": 1e3 * (time.process_time() - start) / work.parts}, work
    raise ValueError(f"{request!r} is no request; use list, prepare NAME or run.")


def main():
    """Answer the requests on the standard input."""
    parser = argparse.ArgumentParser(description=__doc__.split("\n", maxsplit=1)[0])
    parser.add_argument("--data", type=Path, default=DATA)
    data, work = Data(parser.parse_args().data), None
    warnings.simplefilter("ignore")
    # Answers alone go to the standard output; what a job prints goes to that of errors.
    answers = os.fdopen(os.dup(sys.stdout.fileno()), "w")
    os.dup2(sys.stderr.fileno(), sys.stdout.fileno())
    for request in sys.stdin:
        try:
            reply, work = answer(request, data, work)
        except Exception as error:
            reply = {"error": f"{type(error).__name__}: {error}"}
        print(json.dumps(reply), file=answers, flush=True)


if __name__ == "__main__":
    main()
