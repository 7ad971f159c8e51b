"""Partitions in, partitions out, on a Dask cluster: the model is sent to every worker once.

    python stream_dask.py model.joblib trials/ synchronized/ --scheduler tcp://head:8786

reads portions here, sends each to one worker, and writes what comes back: files, restarts and
promises are those of ``stream_files.py``, but that it stops at a portion that is refused.
Use this if the workers do not see your files, and `give` and `on_worker` for bags and arrays.
"""

import argparse
import sys
from collections import deque
from pathlib import Path

import joblib
from dask.distributed import Client, WorkerPlugin, get_worker

import stream_files

# Portions that are sent before a result is awaited, for each thread of the workers.
_AHEAD = 2


class Fitted(WorkerPlugin):
    """A model that every worker holds, those that come later too.

    Parameters
    ----------
    model : estimator
        Fitted.
    """

    def __init__(self, model):
        self.model = model


def give(client, model, name="model"):
    """Send a fitted model to all workers, in the place of what had the name before."""
    client.register_plugin(Fitted(model), name=name)


def on_worker(trials, method="transform", model="model"):
    """What the model that a worker was given under this name says of trials.

    Partitions of bags may be iterators, and of those that are filtered some may be empty.
    """
    fitted = get_worker().plugins.get(model)
    if fitted is None:
        raise ValueError(f"The workers were given no {model!r}: give(client, fitted, {model!r}).")
    if hasattr(trials, "__next__"):
        trials = list(trials)
    if isinstance(trials, list) and not trials:
        return []
    return stream_files.answer(fitted.model, method, trials)


def stream(client, portions, method="transform", model="model"):
    """Yield what the workers say of portions, in order.

    Parameters
    ----------
    client : distributed.Client
    portions : iterable of lists of arrays (n_frames_i, n_features), or of 3-D arrays
        Taken as workers get free, so that any number of them passes through little memory.
    method : {"transform", "match", "score_samples"}, default="transform"
    model : str, default="model"
        The name under which the workers were given it.

    Yields
    ------
    ndarray, or dict of ndarrays for "match"
    """
    waiting = deque()
    for portion in portions:
        # Within the task, which Dask keeps until it is done: so it survives its worker.
        waiting.append(client.submit(on_worker, portion, method, model, pure=False))
        while len(waiting) > _AHEAD * max(1, sum(client.nthreads().values())):
            yield waiting.popleft().result()
    while waiting:
        yield waiting.popleft().result()


def main(arguments=None):
    """What the command line asks for; for the shell, what was wrong with it."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0], allow_abbrev=False)
    parser.add_argument("model", type=Path, help="a fitted pipeline, by joblib.dump")
    parser.add_argument("portions", type=Path, help="folder of .npy or .npz files")
    parser.add_argument("results", type=Path, help="folder, made if there is none")
    parser.add_argument("--method", choices=stream_files.METHODS, default="transform")
    parser.add_argument("--scheduler", help="address (default: a cluster on this machine)")
    given = parser.parse_args(arguments)
    unread = []

    def read(sources):
        for source in sources:
            try:
                portion = stream_files.read(source)
            except ValueError as error:
                # Those before it are still to be answered.
                unread.append(error)
                return
            yield portion

    source = None
    try:
        missing = list(stream_files.left(given.portions, given.results, given.method))
        stream_files.claim(given.results, given.model, given.method)
        with Client(given.scheduler) as client:
            for module in (stream_files.__file__, __file__):
                client.upload_file(module)
            give(client, joblib.load(given.model))
            answers = stream(client, read(source for source, _ in missing), given.method)
            for source, target in missing:
                answer = next(answers, None)
                if answer is None:
                    raise unread[0]
                stream_files.write(target, answer)
                print(f"{source.name}: done", flush=True)
    except ValueError as error:
        return f"{source}: {error}" if source else str(error)
    return None


if __name__ == "__main__":
    # By its name: what workers are given of this module they find there.
    from stream_dask import main

    sys.exit(main())
