"""A Dask cluster: the bits of a single core, and every worker is sent what it needs once."""

import gc
import os
import sys
import time
from pathlib import Path

import distributed
import joblib
import numpy as np
import pytest
import sklearn_motionsync
from sklearn_motionsync import DenseSynchronizer
from sklearn_motionsync.cluster import Held, Name
from sklearn_motionsync.synchronizers import portions

N_WORKERS = 2


@pytest.fixture(scope="module")
def client():
    """Two worker processes that count the bytes they receive, from whomever."""
    package = Path(sklearn_motionsync.__file__).parents[1]

    def count():
        from tornado.iostream import IOStream

        IOStream.n_bytes = 0

        def counting(name, size):
            method = getattr(IOStream, name)

            def read(self, what, *args, **kwargs):
                IOStream.n_bytes += size(what)
                return method(self, what, *args, **kwargs)

            setattr(IOStream, name, read)

        counting("read_bytes", int)
        counting("read_into", lambda buffer: memoryview(buffer).nbytes)

    settings = {"n_workers": N_WORKERS, "threads_per_worker": 1, "protocol": "tcp://"}
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("PYTHONPATH", f"{package}{os.pathsep}{os.environ.get('PYTHONPATH', '')}")
        local = distributed.LocalCluster(**settings, dashboard_address=":0")
    with local, distributed.Client(local) as client:
        client.run(count)
        yield client


def received(client):
    """Bytes that each worker has read from its connections so far."""

    def n_bytes():
        from tornado.iostream import IOStream

        return IOStream.n_bytes

    return np.array(list(client.run(n_bytes).values()))


def walks(n, n_frames, n_features):
    steps = np.random.default_rng(0).standard_normal((n, n_frames, n_features))
    return np.cumsum(steps, axis=1)


def bits(sync, X):
    results = [sync.global_distances_, sync.pattern_, sync.exemplars_, sync.misfit_]
    return [np.asarray(result).tobytes() for result in [*results, *sync.match(X[:5])]]


# All pairs; a search in several rounds; so many portions as long takes have, whose misfits are
# shared out, with few exemplars and with so many that sending them is not worth it.
LONG = {"refine": "auto", "search": "exhaustive"}
FITS = {
    "all pairs": ((90, 40, 48), {"search": "exhaustive"}),
    "search": ((300, 40, 16), {}),
    "long takes": ((60, 80, 30), {**LONG, "consensus": 20}),
    "many exemplars": ((60, 80, 30), {**LONG, "consensus": 50}),
}


@pytest.mark.parametrize("name", FITS)
def test_a_fit_sends_the_performances_to_every_worker_once(client, name, monkeypatch):
    """Data: the arrays that are given, which are on the clock already."""
    shape, settings = FITS[name]
    if "consensus" in settings:
        monkeypatch.setattr(portions, "PORTION_CELLS", 300_000)
    X = walks(*shape)
    expected = bits(DenseSynchronizer(**settings).fit(X), X)
    with distributed.get_task_stream(client), joblib.parallel_config(backend="dask"):
        before = received(client)
        sync = DenseSynchronizer(**settings).fit(X)
        sent = received(client) - before
        ran_fit = {task["worker"] for task in client.get_task_stream()}
        assert bits(sync, X) == expected
    assert len(ran_fit) == N_WORKERS
    # The counter counts: not all of them can do without the data.
    assert sent.max() > X.nbytes
    assert sent.sum() <= 1.5 * N_WORKERS * X.nbytes


@pytest.fixture
def no_garbage_is_collected():
    gc.disable()
    yield
    gc.enable()


@pytest.mark.usefixtures("no_garbage_is_collected")
def test_the_workers_work_and_keep_nothing(client):
    """They are at something else when they are sent their copies, and forget them after the fit."""
    X = walks(60, 40, 4)
    busy = [client.submit(time.sleep, 1.5, workers=[w], pure=False) for w in client.nthreads()]
    with joblib.parallel_config(backend="dask"):
        DenseSynchronizer().fit(X)
    del busy
    loaded = client.run(lambda: (os.getpid(), "sklearn_motionsync.matching" in sys.modules))
    assert os.getpid() not in {pid for pid, _ in loaded.values()}
    assert all(matching for _, matching in loaded.values())

    def has_data(dask_worker):
        return len(dask_worker.data) > 0

    # They are told when the client has forgotten, which takes a moment.
    deadline = time.monotonic() + 60
    while any(client.run(has_data).values()) and time.monotonic() < deadline:
        time.sleep(0.05)
    if any(client.run(has_data).values()):
        pytest.fail("the workers still hold something")


def test_warping_sends_every_performance_to_one_worker(client):
    X = walks(100, 60, 8)
    many = np.concatenate([X] * 15)
    sync = DenseSynchronizer(search="sampled").fit(X)
    expected = sync.transform(many)
    before = received(client)
    with joblib.parallel_config(backend="dask"):
        warped = sync.transform(many)
    assert (received(client) - before).sum() <= 1.5 * many.nbytes
    assert warped.tobytes() == expected.tobytes()


def test_a_worker_that_comes_later(client):
    """It fetches what the others hold, once."""
    value = np.random.default_rng(0).standard_normal(200_000)
    held, largest = Held(client, value), []
    name = held.name()
    unknown = Name(name.first, "came before it")
    for worker in client.nthreads():
        task = {"workers": [worker], "pure": False}
        largest += [client.submit(lambda n: n.value().max(), name, **task).result()]
        before = received(client)
        for _ in range(5):
            largest += [client.submit(lambda n: n.value().max(), unknown, **task).result()]
        assert (received(client) - before).sum() < 1.2 * value.nbytes
    assert set(largest) == {value.max()}
