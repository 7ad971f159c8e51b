"""Parallel work: equal bits on any workers, progress, and interruption."""

import contextlib
import os
import signal
import subprocess
import sys
import textwrap
import time
import warnings
from pathlib import Path

import joblib
import numpy as np
import pytest
import sklearn
import sklearn_motionsync
import threadpoolctl
from sklearn_motionsync import DenseSynchronizer
from sklearn_motionsync.matching.trellis import Trellis
from sklearn_motionsync.utils.parallel import run

# Random walks are no movement.
pytestmark = pytest.mark.filterwarnings("ignore::sklearn_motionsync.SynchronizationWarning")

SETTINGS = {
    "paper": {"cost": "pose", "max_rate": 2, "consensus": 0},
    "defaults": {},
    "refined": {"refine": True, "consensus": 3},
}


@pytest.fixture(scope="module")
def walks():
    """300 trials, whose fit and warps take several portions."""
    rng = np.random.default_rng(0)
    return [np.cumsum(rng.standard_normal((n, 3)), axis=0) for n in rng.integers(16, 20, size=300)]


def bits(X, **settings):
    """All results of a fit and of warping, byte for byte."""
    sync = DenseSynchronizer(**settings).fit(X)
    match = sync.match(X)
    results = [sync.global_distances_, sync.pattern_, sync.exemplars_, sync.transform(X)]
    return [np.asarray(x).tobytes() for x in [*results, match.times, match.distances]]


@pytest.fixture(scope="module")
def references(walks):
    """The bits of one job, by the name of the settings."""
    return {name: bits(walks, **settings) for name, settings in SETTINGS.items()}


CONTEXTS = {
    "2 jobs": (2, contextlib.nullcontext),
    "3 threads": (3, lambda: joblib.parallel_config(backend="threading")),
    "2 processes": (2, lambda: joblib.parallel_config(backend="loky")),
    "no memory": (None, lambda: sklearn.config_context(working_memory=0)),
    "little memory": (None, lambda: sklearn.config_context(working_memory=0.3)),
    "1 BLAS thread": (None, lambda: threadpoolctl.threadpool_limits(limits=1)),
    "2 BLAS threads": (None, lambda: threadpoolctl.threadpool_limits(limits=2)),
}


@pytest.mark.parametrize(
    ("settings", "name"),
    [
        *(("defaults", name) for name in CONTEXTS),
        *(("paper", name) for name in ("3 threads", "no memory")),
        *(("refined", name) for name in ("3 threads", "no memory")),
    ],
)
def test_results_are_equal_to_the_last_bit_in_any_context(walks, references, settings, name):
    n_jobs, context = CONTEXTS[name]
    with context():
        assert bits(walks, n_jobs=n_jobs, **SETTINGS[settings]) == references[settings]


def test_all_matching_runs_on_one_blas_thread(walks, monkeypatch):
    """Also in portions too small to be shared out."""
    seen, method = [], {name: getattr(Trellis, name) for name in ("distances", "paths_and_costs")}

    def watched(name):
        def call(self, *args):
            pools = threadpoolctl.threadpool_info()
            seen.append((name, {p["num_threads"] for p in pools if p["user_api"] == "blas"}))
            return method[name](self, *args)

        return call

    for name in method:
        monkeypatch.setattr(Trellis, name, watched(name))
    with threadpoolctl.threadpool_limits(limits=2):
        DenseSynchronizer().fit(walks[:20]).transform(walks[:3])
    assert {name for name, _ in seen} == {"distances", "paths_and_costs"}
    assert all(threads == {1} for _, threads in seen)


# -- run ---------------------------------------------------------------------------------


@pytest.mark.parametrize("n_jobs", [None, 1, 2])
@pytest.mark.parametrize("n_portions", [0, 1, 5])
def test_run_keeps_order_calls_step_and_passes_shared_arguments_first(n_jobs, n_portions):
    steps, portions = [], [(i,) for i in range(n_portions)]
    settings = {"n_jobs": n_jobs, "common": ("a", "b"), "step": lambda: steps.append(1)}
    found = run("{}{}{}".format, portions, prefer="threads", **settings)
    assert list(found) == [f"ab{i}" for i in range(n_portions)]
    assert len(steps) == n_portions


def test_run_keeps_warning_filters_and_passes_the_configuration_of_scikit_learn():
    before = [*warnings.filters]
    for _ in range(5):
        list(run(time.sleep, [(1e-3 * (i % 3),) for i in range(20)], n_jobs=2, prefer="threads"))
    assert warnings.filters == before
    with sklearn.config_context(working_memory=77):
        seen = list(run(sklearn.get_config, [()] * 5, n_jobs=2, prefer="threads"))
    assert {config["working_memory"] for config in seen} == {77}


def test_run_works_with_backends_without_generators():
    with joblib.parallel_config(backend="multiprocessing"):
        assert list(run(pow, [(1,), (2,), (3,)], common=(2,), n_jobs=2)) == [2, 4, 8]


# -- progress -------------------------------------------------------------------------------


def test_verbose_prints_the_progress_of_stages(walks, capsys, monkeypatch):
    # On a slow machine there are more lines, one a second.
    monkeypatch.setattr(time, "perf_counter", lambda: 0.0)
    DenseSynchronizer().fit(walks).transform(walks)
    assert capsys.readouterr().out == ""
    DenseSynchronizer(verbose=1).fit(walks).transform(walks)
    lines = capsys.readouterr().out.splitlines()
    assert all(line.startswith("[DenseSynchronizer] ") for line in lines)
    assert "comparing 300 with 100 trials: 100 %" in lines[-2]
    assert "warping: 100 %" in lines[-1]


# -- interruption -----------------------------------------------------------------------------


@pytest.mark.skipif(sys.platform == "win32", reason="signals of POSIX")
def test_ctrl_c_ends_a_long_fit():
    """Hours of work of two processes, interrupted after a moment."""
    # In the background of a shell the signal may be ignored.
    script = """
        import signal, sys
        import numpy as np
        from sklearn.exceptions import NotFittedError
        from sklearn_motionsync import DenseSynchronizer
        assert "matplotlib" not in sys.modules, "what draws is imported on drawing only"
        signal.signal(signal.SIGINT, signal.default_int_handler)
        X = np.random.default_rng(0).standard_normal((3000, 200, 8))
        sync = DenseSynchronizer(n_jobs=2)
        try:
            print("begin", flush=True)
            sync.fit(X)
        except KeyboardInterrupt:
            try:
                sync.transform(X[:1])
            except NotFittedError:
                print("unfitted", flush=True)
    """
    root = Path(sklearn_motionsync.__file__).parents[1]
    process = subprocess.Popen(
        [sys.executable, "-c", textwrap.dedent(script)],
        stdout=subprocess.PIPE,
        text=True,
        env={**os.environ, "PYTHONPATH": str(root)},
    )
    try:
        assert process.stdout.readline() == "begin\n"
        time.sleep(0.5)
        process.send_signal(signal.SIGINT)
        assert process.stdout.readline() == "unfitted\n"
        assert process.wait(timeout=10) == 0
    finally:
        process.kill()
        process.stdout.close()
        process.wait()
