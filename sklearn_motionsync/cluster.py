"""What the workers of a cluster hold: sent once to each, however many runs use it.

Left to itself Dask sends an argument with every task, or once for every run, and drops what several
workers hold as soon as few tasks wait for it. So every worker gets a copy under a name of its own,
which lives as long as the `Held` that had it sent.

Joblib's backend for Ray starts new processes for every run, and pickles all arguments with every
task. So Ray gets tasks of its own, whose processes stay, and what they share lies in its store.
Nothing here imports Dask or Ray unless it is in use.
"""

import sys
import uuid
from collections import deque

__all__ = ["Held", "Name", "client_of", "ray_of", "results_of_ray"]


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
