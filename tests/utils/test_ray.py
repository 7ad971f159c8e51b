"""Tasks of Ray, by a stand-in: results in any order, all arguments pickled."""

import pickle
import sys
from types import SimpleNamespace

import joblib
import numpy as np
import pytest
from joblib.parallel import ParallelBackendBase, register_parallel_backend
from sklearn_motionsync import DenseSynchronizer
from sklearn_motionsync.utils.parallel import SharedArgument, run

N_JOBS = 3


class RayBackend(ParallelBackendBase):
    """The parts of Ray's joblib backend that are used."""

    ray_remote_args = {"resources": {"room": 1}}

    def effective_n_jobs(self, n_jobs):
        return n_jobs

    def apply_async(self, func, callback=None):
        raise AssertionError("joblib itself runs no tasks")

    submit = apply_async


RayBackend.__module__ = "ray.util.joblib.ray_backend"


class RayTaskError(Exception):
    """The exception of a task, as ``cause``."""

    def __init__(self, cause):
        self.cause = cause


class Ray:
    """The functions of Ray that are used: tasks run when waited for, the last one first."""

    exceptions = SimpleNamespace(RayTaskError=RayTaskError)

    def __init__(self):
        self.stored, self.waiting, self.n_most, self.sent = {}, {}, 0, 0
        self.options, self.actor = [], None

    def get_runtime_context(self):
        return SimpleNamespace(get_actor_id=lambda: self.actor)

    def put(self, value):
        reference = f"reference {len(self.stored)}"
        self.stored[reference] = pickle.dumps(value)
        return reference

    def remote(self, function):
        def submit(*arguments):
            reference = f"task {self.sent}, {id(function)}"
            self.waiting[reference] = pickle.dumps((function, arguments))
            self.sent += len(self.waiting[reference])
            self.n_most = max(self.n_most, len(self.waiting))
            return reference

        def options(**given):
            self.options.append(given)
            return SimpleNamespace(remote=submit)

        return SimpleNamespace(options=options)

    def wait(self, references, num_returns):
        assert num_returns == 1
        done = next(r for r in reversed(references))
        self._do(done)
        return [done], [r for r in references if r != done]

    def get(self, reference):
        if reference in self.waiting:
            self._do(reference)
        result = pickle.loads(self.stored[reference])
        if isinstance(result, RayTaskError):
            raise result
        return result

    def cancel(self, reference):
        self.waiting.pop(reference, None)

    def _do(self, reference):
        if reference not in self.waiting:
            return
        function, arguments = pickle.loads(self.waiting.pop(reference))
        known = [isinstance(a, str) and a in self.stored for a in arguments]
        values = [self.get(a) if k else a for a, k in zip(arguments, known, strict=True)]
        try:
            result = function(*values)
        except Exception as error:
            result = RayTaskError(error)
        self.stored[reference] = pickle.dumps(result)


@pytest.fixture
def ray(monkeypatch):
    ray = Ray()
    monkeypatch.setitem(sys.modules, "ray", ray)
    register_parallel_backend("ray", RayBackend)
    with joblib.parallel_config(backend="ray", n_jobs=N_JOBS):
        yield ray


def squares(common, i):
    if i == 7:
        raise KeyError("seven")
    return i, common[i] ** 2


def test_results_are_in_order_with_at_most_n_jobs_tasks(ray):
    common = SharedArgument(np.arange(20.0))
    found = list(run(squares, [(i,) for i in range(7)], common=(common,)))
    assert found == [(i, i**2) for i in range(7)]
    assert 1 < ray.n_most <= N_JOBS
    assert ray.options == [{"resources": {"room": 1}}]


def test_error_of_the_function_is_raised_and_tasks_are_cancelled(ray):
    results = run(squares, [(i,) for i in range(5, 20)], common=(SharedArgument(np.arange(20.0)),))
    assert [next(results), next(results)] == [(5, 25), (6, 36)]
    with pytest.raises(KeyError, match="seven"):
        next(results)
    assert not ray.waiting


def test_closed_generator_cancels_tasks(ray):
    results = run(squares, [(i,) for i in range(7)], common=(SharedArgument(np.arange(20.0)),))
    next(results)
    results.close()
    assert not ray.waiting


def test_tasks_of_an_actor_need_no_processors(ray):
    ray.actor = "actor"
    assert len(list(run(squares, [(1,), (2,)], common=(SharedArgument(np.arange(20.0)),)))) == 2
    assert ray.options == [{"num_cpus": 0, "resources": {"room": 1}}]


def test_fit_stores_performances_once(ray):
    X = np.cumsum(np.random.default_rng(0).standard_normal((300, 30, 6)), axis=1)
    sync = DenseSynchronizer().fit(X)
    tasks = sum(reference.startswith("task") for reference in ray.stored)
    large = [v for r, v in ray.stored.items() if r.startswith("ref") and len(v) > X.nbytes / 2]
    # All portions share the stored value, and tasks carry indices.
    assert tasks >= 5
    assert len(large) == 1
    with joblib.parallel_config(backend="sequential"):
        alone = DenseSynchronizer().fit(X)
    for name in ("global_distances_", "pattern_", "exemplars_", "unexplained_variance_"):
        assert (
            np.asarray(getattr(sync, name)).tobytes() == np.asarray(getattr(alone, name)).tobytes()
        )
