"""One thread for the linear algebra of a portion; afterwards the process is as before."""

import gc
import multiprocessing
import os
import signal
import sys
import threading
import time
import types
import warnings

import pytest
import threadpoolctl
from sklearn_motionsync.utils import threads as blas
from sklearn_motionsync.utils.parallel import run
from sklearn_motionsync.utils.threads import Limit, on_one_thread


def blas_threads():
    pools = threadpoolctl.threadpool_info()
    return {p["filepath"]: p["num_threads"] for p in pools if p["user_api"] == "blas"}


def in_thread(function, *arguments):
    """In a thread that ends: threadpoolctl lets one living thread alone set OpenBLAS."""
    thread = threading.Thread(target=function, args=arguments)
    thread.start()
    thread.join()


@pytest.fixture(autouse=True)
def found():
    """Two threads, also where there is one core only."""
    before = min(blas_threads().values())

    in_thread(threadpoolctl.threadpool_limits, 2, "blas")
    threads = blas_threads()
    assert set(threads.values()) == {2}
    yield threads
    in_thread(threadpoolctl.threadpool_limits, before, "blas")


class Holder(threading.Thread):
    """A thread that stays in a portion until its end is called."""

    def __init__(self):
        super().__init__()
        self.inside, self.ended = threading.Event(), threading.Event()
        self.start()
        assert self.inside.wait(10)

    def run(self):
        on_one_thread(self.hold)

    def hold(self):
        self.inside.set()
        self.ended.wait(10)

    def end(self):
        self.ended.set()
        self.join()


@pytest.mark.parametrize("order", [(0, 1, 2), (2, 1, 0), (1, 2, 0)])
def test_last_holder_restores_threads(found, order):
    holders = [Holder() for _ in range(3)]
    for i in order:
        assert set(blas_threads().values()) == {1}
        holders[i].end()
    assert blas_threads() == found


def test_nested_calls_keep_one_thread(found):
    inner = []
    on_one_thread(lambda: inner.append(on_one_thread(blas_threads)) or inner.append(blas_threads()))
    assert [set(threads.values()) for threads in inner] == [{1}, {1}]
    assert blas_threads() == found


def test_portions_run_on_one_thread_under_limits_of_the_user(found):
    with threadpoolctl.threadpool_limits(limits=3, user_api="blas"):
        seen = []
        in_thread(on_one_thread, lambda: seen.append(blas_threads()))
        seen += run(blas_threads, [()] * 6, n_jobs=2, prefer="threads")
        assert set(blas_threads().values()) == {3}
    assert {n for threads in seen for n in threads.values()} == {1}
    assert blas_threads() == found


def test_changes_by_others_meanwhile_stay(found):
    in_thread(on_one_thread, threadpoolctl.threadpool_limits, 3, "blas")
    assert set(blas_threads().values()) == {3}
    # A limit that began before and ends before restores the number before both.
    entered, leave = threading.Event(), threading.Event()

    def limit():
        with threadpoolctl.threadpool_limits(limits=1, user_api="blas"):
            entered.set()
            leave.wait(10)

    other = threading.Thread(target=limit)
    other.start()
    assert entered.wait(10)
    holder = Holder()
    leave.set()
    other.join()
    holder.end()
    assert set(blas_threads().values()) == {3}


def test_other_threads_can_set_threads_afterwards(found):
    on_one_thread(int)
    in_thread(threadpoolctl.threadpool_limits, 3, "blas")
    assert set(blas_threads().values()) == {3}


# -- interruption -----------------------------------------------------------------------------


# Python ignores an interruption while an object is deleted.
@pytest.mark.filterwarnings("ignore::pytest.PytestUnraisableExceptionWarning")
@pytest.mark.skipif(not hasattr(signal, "setitimer"), reason="signals of POSIX")
@pytest.mark.parametrize("others", [False, True])
def test_ctrl_c_at_any_moment_restores_threads(found, others):
    """Most interruptions come while the limit is acquired or released."""
    pools = threadpoolctl.ThreadpoolController().select(user_api="blas")
    holder, inside = (Holder(), 1) if others else (None, 2)
    before = signal.signal(signal.SIGALRM, signal.default_int_handler)
    interrupted = 0
    try:
        for i in range(1000):
            try:
                signal.setitimer(signal.ITIMER_REAL, 1e-5 + 1e-7 * i)
                for _ in range(1000):
                    on_one_thread(int)
            except KeyboardInterrupt:
                interrupted += 1
            assert {pool["num_threads"] for pool in pools.info()} == {inside}
    finally:
        signal.setitimer(signal.ITIMER_REAL, 0)
        signal.signal(signal.SIGALRM, before)
    assert interrupted > 900
    if others:
        holder.end()
    assert blas_threads() == found


@pytest.mark.parametrize("n_jobs", [1, 2])
@pytest.mark.parametrize("error", [KeyboardInterrupt, ValueError])
def test_error_in_a_portion_waits_for_other_threads(found, n_jobs, error):
    at_work = threading.Event()

    def portion(i):
        if i == 0:
            if n_jobs == 2:
                assert at_work.wait(10)
            raise error
        at_work.set()
        time.sleep(0.3)

    with pytest.raises(error):
        list(run(portion, [(i,) for i in range(5)], n_jobs=n_jobs, prefer="threads"))
    assert blas_threads() == found


@pytest.mark.skipif(sys.platform == "win32", reason="signals of POSIX")
def test_ctrl_c_during_portions_of_threads_restores_threads(found):
    def portion(i):
        if i == 1:
            os.kill(os.getpid(), signal.SIGINT)
        time.sleep(0.2)

    # In the background of a shell the signal may be ignored; and Python drops what is raised while
    # garbage is collected, such as connections of other tests.
    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    gc.collect()
    gc.disable()
    try:
        with pytest.raises(KeyboardInterrupt):
            list(run(portion, [(i,) for i in range(20)], n_jobs=2, prefer="threads"))
    finally:
        gc.enable()
        signal.signal(signal.SIGINT, before)
    assert blas_threads() == found


# joblib warns of dropped portions.
@pytest.mark.filterwarnings("ignore:.*tasks:UserWarning")
@pytest.mark.parametrize("n_jobs", [1, 2])
@pytest.mark.parametrize("leave", ["close", "__del__"])
def test_closed_generator_restores_threads(found, n_jobs, leave):
    begun = []
    portions = [(0,), *[(0.2,)] * 20]
    work = {"n_jobs": n_jobs, "prefer": "threads"}
    results = run(lambda t: begun.append(t) or time.sleep(t), portions, **work)
    next(results)
    if leave == "close":
        results.close()
    else:
        del results
    assert blas_threads() == found
    assert len(begun) < 10


# -- forks, and libraries of other kinds ------------------------------------------------------


@pytest.mark.skipif(not hasattr(os, "fork"), reason="there are no forks")
def test_forked_child_does_not_inherit_the_limit(found):
    holder, forking = Holder(), multiprocessing.get_context("fork")
    answer = forking.Queue()
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", DeprecationWarning)
        child = forking.Process(target=answer_of_child, args=(answer,))
        child.start()
    assert answer.get(timeout=20) == [{2}, {1}, {2}]
    child.join()
    assert set(blas_threads().values()) == {1}
    holder.end()
    assert blas_threads() == found


def answer_of_child(answer):
    threads = blas_threads(), on_one_thread(blas_threads), blas_threads()
    answer.put([set(t.values()) for t in threads])


class Library:
    """A stand-in for a threadpoolctl.LibController."""

    user_api, filepath, threading_layer = "blas", "libblas.so", "pthreads"

    def __init__(self):
        self.num_threads, self.calls = 4, []

    def set_num_threads(self, n):
        self.calls.append(n)
        self.num_threads = n


class LibraryOnOpenMP(threading.local, Library):
    """A library with a setting for each thread."""

    threading_layer = "openmp"


def test_after_fork_does_not_wait_for_locks_of_other_threads():
    entered, go_on = threading.Event(), threading.Event()

    class Slow(Library):
        def set_num_threads(self, n):
            super().set_num_threads(n)
            if threading.current_thread() is not threading.main_thread():
                entered.set()
                go_on.wait()

    limit = Limit(Slow())
    thread = threading.Thread(target=limit.acquire, args=("holder",), daemon=True)
    thread.start()
    assert entered.wait(10)
    limit.after_fork()
    limit.acquire("child")
    limit.release("child")
    assert not go_on.is_set()
    go_on.set()
    thread.join()


def test_openmp_limits_are_of_each_thread():
    library = LibraryOnOpenMP()
    limit, seen = Limit(library), []

    def visit():
        limit.acquire("other")
        seen.append(library.num_threads)
        limit.release("other")
        seen.append(library.num_threads)

    limit.acquire("first")
    thread = threading.Thread(target=visit)
    thread.start()
    thread.join()
    assert seen == [1, 4]
    assert library.num_threads == 1
    limit.release("first")
    assert library.num_threads == 4


def test_release_without_acquire_changes_nothing():
    library = Library()
    limit = Limit(library)
    limit.release("other")
    assert library.calls == []
    limit.acquire("holder")
    limit.release("other")
    assert library.num_threads == 1
    limit.release("holder")
    limit.release("holder")
    assert library.calls == [1, 4]


def test_libraries_loaded_later_are_limited(monkeypatch):
    library = Library()
    on_one_thread(int)
    known = types.SimpleNamespace(lib_controllers=[library])
    monkeypatch.setattr(blas, "ThreadpoolController", lambda: known)
    monkeypatch.setitem(sys.modules, "module_with_another_blas", types.ModuleType("another"))
    assert on_one_thread(lambda: library.num_threads) == 1
    assert library.num_threads == 4
