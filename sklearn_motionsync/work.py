"""Work in fixed portions: on one core, on many, or on a cluster, with progress.

What is computed together, in one tile of pairs or one set of warps, never depends on how many
workers there are, and the linear algebra of a portion runs on one thread: so results are equal to
the last bit however the portions are shared out.
"""

import functools
import time

from joblib import effective_n_jobs
from sklearn.utils.parallel import Parallel, delayed
from threadpoolctl import ThreadpoolController

try:
    from sklearn.callback import CallbackSupportMixin
except ImportError:  # scikit-learn before 1.9

    class CallbackSupportMixin:
        """No callbacks."""


__all__ = ["LongWorkMixin", "Progress", "run"]

# Seconds between two lines of a verbose estimator.
_INTERVAL = 1.0


def run(function, portions, *, n_jobs=None, prefer=None, step=None):
    """Yield ``function(*portion)`` for every portion, in order.

    Parameters
    ----------
    function : callable
        Something that can be pickled, if there are several jobs.
    portions : list of tuples
        Arguments. Large arrays among them reach other processes as read-only memory maps.
    n_jobs : int, default=None
        As everywhere in scikit-learn: None means 1, unless ``joblib.parallel_config`` says
        otherwise.
    prefer : {"threads", "processes"}, default=None
        Threads, unless the user chose a backend, are good for portions that spend their time
        in long NumPy calls.
    step : callable, default=None
        Called after every portion.
    """
    results = _results(function, portions, n_jobs, prefer)
    for result in results:
        if step is not None:
            step()
        yield result


def _results(function, portions, n_jobs, prefer):
    if len(portions) < 2 or effective_n_jobs(n_jobs) == 1:
        return (_on_one_thread(function, portion) for portion in portions)
    try:
        parallel = Parallel(n_jobs=n_jobs, prefer=prefer, return_as="generator")
    except ValueError:
        # Some backends can only hand over all results at once.
        parallel = Parallel(n_jobs=n_jobs, prefer=prefer)
    return parallel(delayed(_on_one_thread)(function, portion) for portion in portions)


def _on_one_thread(function, portion):
    with _thread_pools().limit(limits=1, user_api="blas"):
        return function(*portion)


@functools.cache
def _thread_pools():
    return ThreadpoolController()


class LongWorkMixin(CallbackSupportMixin):
    """What estimators share that take their time; they have a parameter ``verbose``."""

    def _progress(self, *, fits):
        """The `Progress` of a job; callbacks only belong to ``fit``."""
        begin = getattr(self, "_init_callback_context", None) if fits else None
        return Progress(self, self.verbose, begin)


class Progress:
    """How far a long job of an estimator is: printed if verbose, and told to its callbacks.

    A context manager; ``stage`` begins the next part of the job and gives the function to call
    after each of its portions.

    Parameters
    ----------
    estimator : estimator
        Whose job it is.
    verbose : int
        Above 0 prints at most one line a second.
    begin : callable, default=None
        Begins scikit-learn's callbacks; None if they are not told.
    """

    def __init__(self, estimator, verbose, begin=None):
        self._estimator, self._verbose, self._begin = estimator, verbose, begin
        self._tasks = []

    def __enter__(self):
        if self._begin is not None:
            root = self._begin(max_subtasks=None)
            self._tasks.append(root.call_on_fit_task_begin(estimator=self._estimator))
        return self

    def __exit__(self, kind, error, traceback):
        if kind is None:
            self._end_tasks(0)

    def _end_tasks(self, depth):
        """End the tasks that were begun within this depth, the last one first."""
        while len(self._tasks) > depth:
            self._tasks.pop().call_on_fit_task_end(estimator=self._estimator)

    def stage(self, name, n_portions):
        """Begin a stage of so many portions."""
        stage = None
        if self._tasks:
            self._end_tasks(1)
            stage = self._tasks[0].subcontext(task_name=name, max_subtasks=n_portions)
            self._tasks.append(stage.call_on_fit_task_begin(estimator=self._estimator))
        begin = printed = time.perf_counter()
        done = 0

        def step():
            nonlocal done, printed
            done += 1
            if stage is not None:
                leaf = stage.subcontext(task_name="portion")
                leaf.call_on_fit_task_begin(estimator=self._estimator)
                leaf.call_on_fit_task_end(estimator=self._estimator)
            now = time.perf_counter()
            if self._verbose > 0 and (now - printed >= _INTERVAL or done == n_portions):
                printed = now
                print(
                    f"[{type(self._estimator).__name__}] {name}: {100 * done // n_portions:3d} %, "
                    f"{now - begin:.1f} s",
                    flush=True,
                )

        return step
