"""Work in fixed portions: on one core, on many, or on a cluster, with progress.

What is computed together, in one tile of pairs or one set of warps, never depends on how many
workers there are, and the linear algebra of a portion runs on one thread: so results are equal to
the last bit however the portions are shared out.
"""

import sys
import threading
import time
import uuid
from collections import deque

from joblib import Parallel, delayed, effective_n_jobs
from joblib.parallel import get_active_backend
from sklearn import config_context, get_config

from .threads import on_one_thread

__all__ = ["Common", "LongWorkMixin", "Progress", "on_cluster", "run"]

try:
    from sklearn.callback import CallbackSupportMixin
except ImportError:  # scikit-learn before 1.9

    class CallbackSupportMixin:
        """No callbacks."""


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


# -- what the workers of a cluster hold: sent once to each, however many runs use it -----


def client_of(backend):
    """The client of the cluster that a joblib backend works on; None if there is none."""
    client = getattr(backend, "client", None)
    return client if hasattr(client, "scatter") else None


def ray_of(backend):
    """Ray, if that is what a joblib backend works on; None if not."""
    made_by = {each.__module__.partition(".")[0] for each in type(backend).__mro__}
    return sys.modules["ray"] if "ray" in made_by else None


def results_of_ray(backend, function, calls, n_jobs):
    """Yield ``function(*call)`` for every call, in order, by tasks of Ray.

    Parameters
    ----------
    backend : joblib backend
        Made by Ray; its ``ray_remote_args`` are options of the tasks.
    function : callable
    calls : iterable of tuples
        Arguments; what `ray.put` gave for one stands for it.
    n_jobs : int
        Tasks at a time.
    """
    ray = ray_of(backend)
    # A task gives its processors back while it waits for others; an actor keeps them.
    options = {"num_cpus": 0} if ray.get_runtime_context().get_actor_id() else {}
    options.update(getattr(backend, "ray_remote_args", None) or {})
    task = ray.remote(function).options(**options)
    waiting, at_work = deque(), []
    try:
        for call in calls:
            if len(at_work) == n_jobs:
                _, at_work = ray.wait(at_work, num_returns=1)
            waiting.append(task.remote(*call))
            at_work.append(waiting[-1])
            while waiting[0] not in at_work:
                yield _got(ray, waiting.popleft())
        while waiting:
            yield _got(ray, waiting.popleft())
    finally:
        for each in waiting:
            ray.cancel(each)


def _got(ray, reference):
    try:
        return ray.get(reference)
    except ray.exceptions.RayTaskError as error:
        # What the function raised, not what Ray makes of it.
        raise error.cause from error


class Held:
    """An object that the workers of a cluster hold.

    Parameters
    ----------
    client : distributed.Client
    value : object
        What is sent to them.
    """

    def __init__(self, client, value):
        self.client = client
        # Dask would forget a value whose name is made of its content if two tasks send it.
        (self._first,) = client.scatter([value], hash=False)
        self._name, self._copies = Name(self._first.key, uuid.uuid4().hex), {}

    def name(self):
        """What tasks are given: by this every worker finds its copy, the new ones too."""
        workers = self.client.nthreads()
        for worker in set(workers) - set(self._copies):
            where = {"key": self._name.at(worker), "workers": [worker]}
            self._copies[worker] = self.client.submit(_same, self._first, **where)
        self._wait()
        return self._name

    def _wait(self):
        """Until all have their copies, but for workers that are gone meanwhile."""
        from distributed import wait

        waiting = self._copies
        while waiting:
            try:
                wait(list(waiting.values()), timeout=1)
            except TimeoutError as late:
                # Dask keeps it in a circle: its frames would keep what is held until some day
                # garbage is collected.
                late.__traceback__ = None
            workers = self.client.nthreads()
            waiting = {w: f for w, f in waiting.items() if w in workers and not f.done()}


class Name:
    """The name of what workers hold.

    Parameters
    ----------
    first : str
        Dask's key of what was sent first.
    prefix : str
        Of the keys of the workers' copies.
    """

    def __init__(self, first, prefix):
        self.first, self.prefix = first, prefix

    def at(self, worker):
        """Dask's key of the copy of the worker of this address."""
        return f"copy-{self.prefix}-{worker}"

    def value(self):
        """What this worker holds."""
        from distributed import Future, get_client, get_worker

        worker = get_worker()
        try:
            return worker.data[self.at(worker.address)]
        except KeyError:
            # It came after the run had begun; it keeps the last such value.
            if self.first not in _late:
                first = Future(self.first, get_client(), state="memory")
                _late.clear()
                _late[self.first] = first.result()
            return _late[self.first]


# What a worker that came late has fetched, by its key.
_late = {}


def _same(value):
    return value
