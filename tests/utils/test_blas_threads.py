"""One thread for the linear algebra of a portion; afterwards the process is as before."""

import threading

import pytest
import threadpoolctl
from sklearn_motionsync.utils.parallel import one_blas_thread, run


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
    """A thread that stays in the context until its end is called."""

    def __init__(self):
        super().__init__()
        self.inside, self.ended = threading.Event(), threading.Event()
        self.start()
        assert self.inside.wait(10)

    def run(self):
        with one_blas_thread():
            self.inside.set()
            self.ended.wait(10)

    def end(self):
        self.ended.set()
        self.join()


@pytest.mark.parametrize("order", [(0, 1, 2), (2, 1, 0), (1, 2, 0)])
def test_the_last_of_several_threads_restores_the_limit(found, order):
    holders = [Holder() for _ in range(3)]
    for i in order:
        assert set(blas_threads().values()) == {1}
        holders[i].end()
    assert blas_threads() == found


def test_the_first_thread_may_still_run_when_the_last_restores_the_limit(found):
    with one_blas_thread():
        holder = Holder()
    assert set(blas_threads().values()) == {1}
    holder.end()
    assert blas_threads() == found


def test_contexts_may_be_nested_and_end_by_an_error(found):
    with one_blas_thread():
        for error in (KeyboardInterrupt, ValueError):
            with pytest.raises(error), one_blas_thread():
                raise error
            assert set(blas_threads().values()) == {1}
    assert blas_threads() == found
    # Other threads can set threads afterwards.
    in_thread(threadpoolctl.threadpool_limits, 3, "blas")
    assert set(blas_threads().values()) == {3}


def test_portions_run_on_one_thread_under_limits_of_the_user(found):
    with threadpoolctl.threadpool_limits(limits=3, user_api="blas"):
        seen = []
        in_thread(lambda: seen.extend(run(blas_threads, [()])))
        seen += run(blas_threads, [()] * 6, n_jobs=2, prefer="threads")
        assert set(blas_threads().values()) == {3}
    assert {n for threads in seen for n in threads.values()} == {1}
    assert blas_threads() == found
