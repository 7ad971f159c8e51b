"""Parallel work in fixed portions: on one core, on many, or on a cluster, with progress.

The portions, such as a tile of pairs or a set of warps, do not depend on the number of workers, and
the linear algebra of a portion runs on one thread. So results are equal to the last bit however the
portions are shared out.
"""

import contextlib
import functools
import threading
import time
from typing import Any

from joblib import Parallel, delayed, effective_n_jobs
from joblib.parallel import get_active_backend
from sklearn import config_context, get_config
from threadpoolctl import ThreadpoolController

from .doc_links import DocumentedMixin

try:
    from sklearn.callback import CallbackSupportMixin
except ImportError:  # scikit-learn before 1.9 has no callbacks
    CallbackSupportMixin = object

# Seconds between two lines of a verbose estimator.
_INTERVAL = 1.0
# Most tasks of a stage that callbacks see.
_TASKS = 100


def run(function, portions, *, common=(), n_jobs=None, prefer=None, step=None):
    """Yield ``function(*common, *portion)`` for every portion, in order.

    Where the generator is closed early, or interrupted, other threads end the portions that they
    have begun.

    Parameters
    ----------
    function : callable
        Something that can be pickled, if there are several jobs.
    portions : list of tuples
        The arguments of each portion. Large arrays reach other processes as read-only memory maps.
    common : tuple, default=()
        First arguments, which all portions share; each worker of a Dask cluster is sent them once.
    n_jobs : int, default=None
        As everywhere in scikit-learn: None means 1, unless ``joblib.parallel_config`` says
        otherwise.
    prefer : {"threads", "processes"}, default=None
        Threads, unless the user chose a backend, are good for portions that spend their time
        in long NumPy calls.
    step : callable, default=None
        Called after every portion.
    """
    for result in _results(function, portions, common, n_jobs, prefer):
        if step is not None:
            step()
        yield result


def _results(function, portions, common, n_jobs, prefer):
    if len(portions) < 2 or effective_n_jobs(n_jobs) == 1:
        return (_call_portion(function, *common, *portion) for portion in portions)
    backend, _ = get_active_backend(prefer=prefer)
    client = getattr(backend, "client", None)
    if common and hasattr(client, "scatter"):
        # Dask would forget a value whose key is made of its content if two tasks send it.
        common = client.scatter(list(common), broadcast=True, hash=False)
    # scikit-learn's own Parallel has threads that restore each other's warning filters. Other
    # threads have a configuration of their own, so each call is given that of this thread.
    config = get_config()
    tasks = (delayed(_call_configured)(config, function, *common, *portion) for portion in portions)
    try:
        parallel = Parallel(n_jobs=n_jobs, prefer=prefer, return_as="generator")
    except ValueError:
        # Some backends, such as Ray's, return all results at once only.
        return (result for result in Parallel(n_jobs=n_jobs, prefer=prefer)(tasks))
    return parallel(tasks)


def _call_configured(config, *arguments):
    with config_context(**config):
        return _call_portion(*arguments)


def _call_portion(function, *arguments):
    with one_blas_thread():
        return function(*arguments)


# -- linear algebra on one thread --------------------------------------------------------

# A thread that holds the lock may collect garbage that leaves a context, and takes it again.
_blas_lock = threading.RLock()
# One object for every context that has not ended, and the limit that the first of them set.
_blas_contexts: set[object] = set()
_blas_limits: list[Any] = []


@contextlib.contextmanager
def one_blas_thread():
    """A context in which the linear algebra of the whole process runs on one thread.

    Contexts of several threads may overlap: the first one sets the limit, and the last one to end
    restores what was before.
    """
    context = object()
    try:
        with _blas_lock:
            if not _blas_contexts:
                _allow_any_thread()
                _blas_limits.append(_blas().limit(limits=1))
            _blas_contexts.add(context)
        yield
    finally:
        with _blas_lock:
            _blas_contexts.discard(context)
            while _blas_limits and not _blas_contexts:
                _allow_any_thread()
                _blas_limits.pop().restore_original_limits()
                _allow_any_thread()


@functools.cache
def _blas():
    """The libraries that compute the linear algebra of NumPy and SciPy."""
    return ThreadpoolController().select(user_api="blas")


def _allow_any_thread():
    """Let any thread set limits: since 3.8 threadpoolctl ignores all but the first that did."""
    for library in _blas().lib_controllers:
        if hasattr(library, "clear_controlling_thread"):
            library.clear_controlling_thread(force=True)


# -- progress ----------------------------------------------------------------------------


class LongWorkMixin(DocumentedMixin, CallbackSupportMixin):
    """Progress of estimators: callbacks, and lines of text where there is a ``verbose``."""

    def _progress(self, *, fits):
        """The `Progress` of a job; callbacks only belong to ``fit``."""
        begin = getattr(self, "_init_callback_context", None) if fits else None
        return Progress(self, getattr(self, "verbose", 0), begin)


class Progress:
    """The progress of a long job of an estimator: printed if verbose, and given to its callbacks.

    A context manager; ``stage`` begins the next part of the job and gives the function to call
    after each of its portions. ``fitting`` is a part in which another estimator is fitted.

    Parameters
    ----------
    estimator : estimator
    verbose : int
        Above 0 prints at most one line a second.
    begin : callable, default=None
        Begins scikit-learn's callbacks; None without callbacks.
    """

    def __init__(self, estimator, verbose, begin=None):
        self._estimator, self._verbose, self._begin = estimator, verbose, begin
        self._tasks = []

    def __enter__(self):
        if self._begin is not None:
            self._begin_task(self._begin(max_subtasks=None))
        return self

    def __exit__(self, kind, error, traceback):
        if kind is None:
            self._end_tasks(0)

    def stage(self, name, n_portions):
        """Begin a stage of so many portions."""
        stage = None
        if self._tasks:
            self._end_tasks(1)
            n_tasks = min(n_portions, _TASKS)
            stage = self._tasks[0].subcontext(task_name=name, max_subtasks=n_tasks)
            stage = self._begin_task(stage)
        begin = printed = time.perf_counter()
        done = 0

        def step():
            nonlocal done, printed
            done += 1
            if stage and done * n_tasks // n_portions > (done - 1) * n_tasks // n_portions:
                self._begin_task(stage.subcontext(task_name="portion"))
                self._end_tasks(2)
            now = time.perf_counter()
            if self._verbose > 0 and (now - printed >= _INTERVAL or done == n_portions):
                printed = now
                print(
                    f"[{type(self._estimator).__name__}] {name}: {100 * done // n_portions:3d} %, "
                    f"{now - begin:.1f} s",
                    flush=True,
                )

        return step

    @contextlib.contextmanager
    def fitting(self, estimator, name):
        """A stage in which another estimator is fitted, with these callbacks if it supports any."""
        if not self._tasks:
            yield
            return
        self._end_tasks(1)
        context = self._tasks[0].subcontext(task_name=name)
        supports = hasattr(estimator, "set_callbacks")
        propagates = context.propagate_callback_context(estimator) if supports else None
        with propagates or contextlib.nullcontext():
            self._begin_task(context)
            yield
            self._end_tasks(1)

    def _begin_task(self, context):
        self._tasks.append(context.call_on_fit_task_begin(estimator=self._estimator))
        return self._tasks[-1]

    def _end_tasks(self, depth):
        """End the tasks begun within this depth, the last one first."""
        while len(self._tasks) > depth:
            self._tasks.pop().call_on_fit_task_end(estimator=self._estimator)
