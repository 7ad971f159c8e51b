"""Tasks of Ray, by a stand-in of its own rules: results in any order, everything pickled."""

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
    """As joblib has it from Ray, as far as it is asked."""

    ray_remote_args = {"resources": {"room": 1}}

    def effective_n_jobs(self, n_jobs):
        return n_jobs

    def apply_async(self, func, callback=None):
        raise AssertionError("joblib hands out nothing itself")

    submit = apply_async


RayBackend.__module__ = "ray.util.joblib.ray_backend"


class RayTaskError(Exception):
    """What a task raised, as its ``cause``."""

    def __init__(self, cause):
        self.cause = cause


class Ray:
    """What the package calls of Ray: tasks run when somebody waits, the last one first."""

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


def test_results_come_in_order_a_few_at_a_time(ray):
    common = SharedArgument(np.arange(20.0))
    found = list(run(squares, [(i,) for i in range(7)], common=(common,)))
    assert found == [(i, i**2) for i in range(7)]
    assert 1 < ray.n_most <= N_JOBS
    assert ray.options == [{"resources": {"room": 1}}]


def test_an_error_is_the_function_s_own_and_the_rest_is_called_off(ray):
    results = run(squares, [(i,) for i in range(5, 20)], common=(SharedArgument(np.arange(20.0)),))
    assert [next(results), next(results)] == [(5, 25), (6, 36)]
    with pytest.raises(KeyError, match="seven"):
        next(results)
    assert not ray.waiting


def test_who_stops_calls_the_rest_off(ray):
    results = run(squares, [(i,) for i in range(7)], common=(SharedArgument(np.arange(20.0)),))
    next(results)
    results.close()
    assert not ray.waiting


def test_an_actor_asks_for_no_processors_as_it_keeps_its_own(ray):
    ray.actor = "somebody"
    assert len(list(run(squares, [(1,), (2,)], common=(SharedArgument(np.arange(20.0)),)))) == 2
    assert ray.options == [{"num_cpus": 0, "resources": {"room": 1}}]


def test_a_fit_stores_the_performances_once(ray):
    X = np.cumsum(np.random.default_rng(0).standard_normal((300, 30, 6)), axis=1)
    sync = DenseSynchronizer().fit(X)
    tasks = sum(reference.startswith("task") for reference in ray.stored)
    large = [v for r, v in ray.stored.items() if r.startswith("ref") and len(v) > X.nbytes / 2]
    # All rounds of the search share what is stored, and tasks carry indices.
    assert tasks > 10
    assert len(large) == 1
    with joblib.parallel_config(backend="sequential"):
        alone = DenseSynchronizer().fit(X)
    for name in ("global_distances_", "pattern_", "exemplars_", "misfit_"):
        assert (
            np.asarray(getattr(sync, name)).tobytes() == np.asarray(getattr(alone, name)).tobytes()
        )
