"""A Dask cluster: the bits of a single core, and data are sent to every worker once."""

import gc
import os
import pickle
import re
import signal
import sys
import time
import warnings
from pathlib import Path

import distributed
import joblib
import numpy as np
import pytest
import sklearn_motionsync
from sklearn_motionsync import DenseSynchronizer

import stream_dask
import stream_files

# Random walks are no movement.
pytestmark = pytest.mark.filterwarnings("ignore::sklearn_motionsync.SynchronizationWarning")
N_WORKERS = 2


class Counting(distributed.WorkerPlugin):
    """Counts the bytes that a worker receives."""

    def setup(self, worker):
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


@pytest.fixture(scope="module")
def client():
    """Two worker processes that count the bytes they receive."""
    package = Path(sklearn_motionsync.__file__).parents[1]
    examples = Path(stream_dask.__file__).parent
    found = [str(package), str(examples), os.environ.get("PYTHONPATH", "")]
    settings = {"n_workers": N_WORKERS, "threads_per_worker": 1, "protocol": "tcp://"}
    with pytest.MonkeyPatch.context() as patch:
        # Also for workers that replace a killed one.
        patch.setenv("PYTHONPATH", os.pathsep.join(found))
        with (
            distributed.LocalCluster(**settings, dashboard_address=":0") as local,
            distributed.Client(local) as client,
        ):
            client.register_plugin(Counting(), name="counting")
            yield client


def received(client):
    """Bytes that each worker has read from its connections so far."""

    def n_bytes():
        from tornado.iostream import IOStream

        return IOStream.n_bytes

    return np.array(list(client.run(n_bytes).values()))


def moved(client):
    """Bytes of data that each worker has fetched from another one so far."""

    def n_bytes(dask_worker):
        return sum(fetched["total"] for fetched in dask_worker.transfer_incoming_log)

    return np.array(list(client.run(n_bytes).values()))


def wait_until(condition):
    for _ in range(600):
        if condition():
            return
        time.sleep(0.1)
    pytest.fail("waited for a minute")


def walks(n, n_frames, n_features):
    steps = np.random.default_rng(0).standard_normal((n, n_frames, n_features))
    return np.cumsum(steps, axis=1)


def bits(sync, X):
    match = sync.match(X[:5])
    results = [sync.global_distances_, sync.pattern_, sync.exemplars_, sync.unexplained_variance_]
    return [np.asarray(x).tobytes() for x in [*results, match.times, match.distances]]


@pytest.mark.parametrize("shape", [(100, 40, 48), (300, 40, 16)], ids=["all pairs", "drawn ones"])
def test_fit_sends_trials_to_every_worker_once(client, shape):
    X = walks(*shape)
    expected = bits(DenseSynchronizer().fit(X), X)
    with distributed.get_task_stream(client), joblib.parallel_config(backend="dask"):
        before = received(client)
        sync = DenseSynchronizer().fit(X)
        sent = received(client) - before
        ran_fit = {task["worker"] for task in client.get_task_stream()}
        assert bits(sync, X) == expected
    assert len(ran_fit) == N_WORKERS
    # The data were sent at all: of all pairs features at fewer frames, in single precision.
    assert sent.max() > 0.2 * X.nbytes
    assert sent.sum() <= 1.5 * N_WORKERS * X.nbytes


def test_busy_workers_keep_no_data_after_a_fit(client, request):
    """Also where no garbage is collected."""
    gc.disable()
    request.addfinalizer(gc.enable)
    X = walks(60, 40, 4)
    busy = [client.submit(time.sleep, 1.5, workers=[w], pure=False) for w in client.nthreads()]
    with joblib.parallel_config(backend="dask"):
        DenseSynchronizer().fit(X)
    del busy
    loaded = client.run(lambda: (os.getpid(), "sklearn_motionsync.matching" in sys.modules))
    assert os.getpid() not in {pid for pid, _ in loaded.values()}
    assert all(matching for _, matching in loaded.values())

    # The workers release data after a moment.
    wait_until(lambda: not any(client.run(lambda dask_worker: len(dask_worker.data)).values()))


def test_warping_sends_every_trial_to_one_worker(client):
    X = walks(30, 60, 150)
    many = np.concatenate([X] * 20)
    sync = DenseSynchronizer(n_frames=40).fit(X)
    expected = sync.transform(many)
    before = received(client) - moved(client)
    with warnings.catch_warnings(record=True) as caught, joblib.parallel_config(backend="dask"):
        warnings.simplefilter("always")
        warped = sync.transform(many)
    # joblib chooses the worker of a portion; if that one is busy, Dask moves it.
    assert (received(client) - moved(client) - before).sum() <= 1.1 * many.nbytes
    # Ahead of their tasks: Dask warns of tasks of more than 10 MB, through its scheduler.
    assert [str(each.message) for each in caught if "graph" in str(each.message)] == []
    assert warped.tobytes() == expected.tobytes()


# -- streams of portions ------------------------------------------------------------------------


@pytest.fixture(scope="module")
def fitted():
    return DenseSynchronizer(n_jobs=-1).fit(walks(60, 60, 8))


@pytest.fixture(scope="module")
def portions_of_walks():
    return np.split(walks(480, 60, 8), 12)


@pytest.fixture(scope="module")
def expected(fitted, portions_of_walks):
    return [stream_files.answer(fitted, "transform", each) for each in portions_of_walks]


def test_stream_sends_model_and_portions_once(client, fitted, portions_of_walks, expected):
    """The model to every worker, a portion to one."""
    data = sum(portion.nbytes for portion in portions_of_walks)
    with distributed.get_task_stream(client) as tasks:
        before = received(client)
        stream_dask.give(client, fitted)
        answers = list(stream_dask.stream(client, portions_of_walks))
        sent = (received(client) - before).sum()
    assert [answer.tobytes() for answer in answers] == [each.tobytes() for each in expected]
    assert data < sent <= 1.2 * (N_WORKERS * len(pickle.dumps(fitted)) + data)
    assert len(tasks.data) == len(portions_of_walks)
    assert len({task["worker"] for task in tasks.data}) == N_WORKERS


def test_files_are_sent_by_the_script(
    client, fitted, portions_of_walks, expected, capsys, tmp_path
):
    (tmp_path / "walks").mkdir()
    joblib.dump(fitted, tmp_path / "model.joblib")
    for i, portion in enumerate([*portions_of_walks[:4], np.full((2, 60, 8), np.nan)]):
        np.save(tmp_path / "walks" / f"{i}.npy", portion)
    files = [str(tmp_path / name) for name in ("model.joblib", "walks", "warped")]
    arguments = [*files, "--scheduler", client.scheduler.address]
    assert re.match(r".*4\.npy: Trial 0.*NaN", stream_dask.main(arguments), re.DOTALL)
    assert capsys.readouterr().out.split("\n")[3:] == ["3.npy: done", ""]
    (tmp_path / "walks" / "4.npy").unlink()
    (tmp_path / "warped" / "2.npy").unlink()
    assert stream_dask.main(arguments) is None
    assert capsys.readouterr().out == "2.npy: done\n"
    for i, each in enumerate(expected[:4]):
        assert np.load(tmp_path / "warped" / f"{i}.npy").tobytes() == each.tobytes()


def test_killed_worker_changes_no_bit(client, fitted, portions_of_walks, expected):
    stream_dask.give(client, fitted)
    pids, workers = client.run(os.getpid), set(client.nthreads())
    answers = stream_dask.stream(client, portions_of_walks)
    found = [next(answers)]
    os.kill(next(iter(pids.values())), getattr(signal, "SIGKILL", signal.SIGTERM))
    found += answers
    assert [answer.tobytes() for answer in found] == [each.tobytes() for each in expected]
    # The worker that replaces it has the model, too.
    wait_until(lambda: set(client.nthreads()) - workers)
    client.wait_for_workers(N_WORKERS, timeout=60)
    call = stream_dask.on_worker, portions_of_walks[0]
    for worker in client.nthreads():
        task = client.submit(*call, workers=[worker], pure=False)
        assert task.result().tobytes() == expected[0].tobytes()
