"""What the workers of a Dask cluster hold: sent once to each, however many runs use it.

Left to itself Dask sends an argument with every task, or once for every run, and drops what several
workers hold as soon as few tasks wait for it. So every worker gets a copy under a name of its own,
which lives as long as the `Held` that had it sent. Nothing here imports Dask unless it is in use.
"""

import uuid

__all__ = ["Held", "Name", "client_of"]


def client_of(backend):
    """The client of the cluster that a joblib backend works on; None if there is none."""
    client = getattr(backend, "client", None)
    return client if hasattr(client, "scatter") else None


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
