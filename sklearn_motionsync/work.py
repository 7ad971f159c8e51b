"""Work in fixed portions: on one core, on many, or on a cluster, with progress.

What is computed together, in one tile of pairs or one set of warps, never depends on how many
workers there are, and the linear algebra of a portion runs on one thread: so results are equal to
the last bit however the portions are shared out.
"""

import threading
import time

from joblib import Parallel, delayed, effective_n_jobs
from joblib.parallel import get_active_backend
from sklearn import config_context, get_config

from .blas import on_one_thread
from .cluster import Held, Name, client_of, ray_of, results_of_ray

try:
    from sklearn.callback import CallbackSupportMixin
except ImportError:  # scikit-learn before 1.9

    class CallbackSupportMixin:
        """No callbacks."""


__all__ = ["Common", "LongWorkMixin", "Progress", "on_cluster", "run"]

# Seconds between two lines of a verbose estimator.
_INTERVAL = 1.0


def run(function, portions, *, common=(), n_jobs=None, prefer=None, step=None):
    """Yield ``function(*common, *portion)`` for every portion, in order.

    Whoever stops in between waits for the portions that other threads have begun.

    Parameters
    ----------
    function : callable
        Something that can be pickled, if there are several jobs.
    portions : list of tuples
        Arguments of a portion's own. Large arrays reach other processes as read-only memory maps.
    common : tuple of Common, default=()
        First arguments, which all portions share.
    n_jobs : int, default=None
        As everywhere in scikit-learn: None means 1, unless ``joblib.parallel_config`` says
        otherwise.
    prefer : {"threads", "processes"}, default=None
        Threads, unless the user chose a backend, are good for portions that spend their time
        in long NumPy calls.
    step : callable, default=None
        Called after every portion.
    """
    begun = _Begun()
    results = _results(function, portions, common, n_jobs, prefer, begun)
    try:
        for result in results:
            if step is not None:
                step()
            yield result
    finally:
        try:
            results.close()
        finally:
            begun.wait()


def _results(function, portions, common, n_jobs, prefer, begun):
    here = [shared.here for shared in common]
    if len(portions) < 2 or effective_n_jobs(n_jobs) == 1:
        return (on_one_thread(function, *here, *portion) for portion in portions)
    backend, _ = get_active_backend(prefer=prefer)
    if getattr(backend, "supports_sharedmem", False):
        call, shared = begun.call, here
    else:
        call, shared = on_one_thread, [shared.sent_to(backend) for shared in common]
    # Not by scikit-learn's own Parallel, whose threads restore each other's warning filters. The
    # configuration is this thread's: those that hand out portions have one of their own.
    config = get_config()
    calls = ((config, call, function, *shared, *portion) for portion in portions)
    if ray_of(backend) is not None:
        return results_of_ray(backend, _configured, calls, effective_n_jobs(n_jobs))
    tasks = (delayed(_configured)(*call) for call in calls)
    try:
        parallel = Parallel(n_jobs=n_jobs, prefer=prefer, return_as="generator")
    except ValueError:
        # Some backends can only hand over all results at once.
        return (result for result in Parallel(n_jobs=n_jobs, prefer=prefer)(tasks))
    return parallel(tasks)


def _configured(config, call, *arguments):
    arguments = [a.value() if isinstance(a, Name) else a for a in arguments]
    with config_context(**config):
        return call(*arguments)


class Common:
    """What all portions have in common, in however many runs.

    Parameters
    ----------
    here : object
        As portions get it on this machine.
    sent : object, default=None
        What is sent to the workers of a cluster, once to each; ``here`` by default.
    """

    def __init__(self, here, sent=None):
        self.here, self._sent = here, here if sent is None else sent
        self._held = self._stored = None

    def sent_to(self, backend):
        """What portions are given under a backend: on a cluster the name of what it holds."""
        client, ray = client_of(backend), ray_of(backend)
        if ray is not None:
            if self._stored is None:
                self._stored = ray.put(self.here)
            return self._stored
        if client is None:
            return self.here
        if self._held is None or self._held.client is not client:
            self._held = Held(client, self._sent)
        return self._held.name()


def on_cluster():
    """Whether work is shared out among machines that have to be sent everything."""
    return client_of(get_active_backend()[0]) is not None


class _Begun:
    """The portions that threads have begun: after an interruption they are still at work."""

    def __init__(self):
        self._threads, self._ended = set(), False
        # Entered by its lock, which an interruption leaves either taken or not.
        self._lock = threading.RLock()
        self._changed = threading.Condition(self._lock)

    def call(self, function, *arguments):
        """A portion; nothing, if nobody waits for its result any more."""
        me = threading.get_ident()
        try:
            with self._lock:
                if self._ended:
                    return None
                self._threads.add(me)
            return on_one_thread(function, *arguments)
        finally:
            with self._lock:
                self._threads.discard(me)
                self._changed.notify_all()

    def wait(self):
        """Let no more begin, and wait for all others than this thread."""
        with self._lock:
            self._ended = True
            me = {threading.get_ident()}
            self._changed.wait_for(lambda: self._threads <= me)


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
