"""Any number of trials, from files to files, whatever is killed on the way.

    python stream_files.py model.joblib trials/ synchronized/ --n-jobs 8

A file of the first folder is a portion: ``.npy`` an array (n_trials, n_frames, n_features),
``.npz`` one array (n_frames, n_features) a trial, in the order in which they were saved. What
the model answers goes into a file of the same name in the second: ``transform`` and
``score_samples`` into an ``.npy``, times and distances of ``match`` into an ``.npz``.

A result gets its name when it is whole. So after Ctrl-C, or a kill, or a power cut, the same
command goes on where it stopped; portions that are newer than their results are computed again.
Results of another model are never mixed in. A portion that cannot be read, or that the model
refuses, is named, with the reason, and the others go on.

With ``--scheduler tcp://...`` the workers of a Dask cluster do the work; they read the same files.
"""

import argparse
import functools
import hashlib
import json
import os
import sys
import uuid
import zipfile
import zlib
from contextlib import ExitStack
from pathlib import Path

import joblib
import numpy as np
import pandas as pd
import scipy
import sklearn
import sklearn_motionsync
from sklearn_motionsync import Match, to_trials

METHODS = ("transform", "match", "score_samples")


def stream(model, portions, results, method="transform", n_jobs=None):
    """Compute what is missing, and yield for every portion of that its file and what was wrong.

    Parameters
    ----------
    model : path
        A fitted estimator or pipeline, written by `joblib.dump`.
    portions : path
        The folder of trials.
    results : path
        The folder of results; made if there is none. One run at a time works on it.
    method : {"transform", "match", "score_samples"}, default="transform"
    n_jobs : int, default=None
        Portions at a time; None means 1, unless ``joblib.parallel_config`` says otherwise.

    Yields
    ------
    (Path, str or None)
        A portion, and why it was refused; None if its result is there.

    Raises
    ------
    ValueError
        If the results are those of something else, the model has no such method, there are no
        portions, two have one name, or results would lie among them.
    """
    missing = list(left(portions, results, method))
    digest = claim(results, model, method)
    tasks = (joblib.delayed(answer_file)(str(model), digest, method, *pair) for pair in missing)
    # One portion a task: what is killed loses no more than it has in hand.
    share_out = functools.partial(joblib.Parallel, n_jobs=n_jobs, batch_size=1)
    try:
        answers = share_out(return_as="generator")(tasks)
    except ValueError:
        # Joblib before 1.4 tells how a cluster is getting on only when all is done.
        answers = share_out()(tasks)
    for (source, _), wrong in zip(missing, answers, strict=True):
        yield source, wrong


def answer_file(model, digest, method, source, target):
    """Read a portion, compute its result, and write it; what was wrong with it, if anything."""
    try:
        result = answer(loaded(model, digest), method, read(source))
    except ValueError as error:
        return str(error)
    write(target, result)
    return None


def answer(model, method, trials):
    """What a model says of trials, on this core alone."""
    with joblib.parallel_config(backend="sequential"):
        if method == "match":
            match = Match.from_estimator(model, trials)
            return {"times": match.times, "distances": match.distances}
        return as_array(getattr(model, method)(trials))


def as_array(found):
    """Answers as one array, also if the model gives tables (``set_output``)."""
    if isinstance(found, pd.DataFrame):
        many = found.index.nlevels > 1
        found = [x.to_numpy() for x in to_trials(found)] if many else found.to_numpy()
    if isinstance(found, list) and len({len(x) for x in found}) > 1:
        raise ValueError(
            "What the model makes of trials has different lengths: give one that has a "
            "synchronizer."
        )
    return np.asarray(found)


def check(model, method):
    """Refuse a model that has no answer to this, before anything is begun."""
    steps = [step for _, step in getattr(model, "steps", [])] if method == "match" else []
    if not any(hasattr(each, method) for each in [model, *steps]):
        last = type(getattr(model, "steps", [(None, model)])[-1][1]).__name__
        raise ValueError(
            f"The model ends in {last} and has no {method}: give another --method, or another part "
            "of the pipeline, such as pipe[:-1]."
        )


@functools.lru_cache(maxsize=1)
def loaded(path, digest):
    """The model, once a process; its arrays are memory maps, which processes share."""
    return joblib.load(path, mmap_mode="r")


def read(source):
    """The trials of a portion; those of an ``.npy`` stay on the disk until they are used."""
    try:
        if Path(source).suffix == ".npy":
            return np.load(source, mmap_mode="r")
        # NumPy leaves a file open that is no archive.
        with open(source, "rb") as file, np.load(file) as archive:
            return [archive[name] for name in archive.files]
    except (ValueError, OSError, EOFError, zipfile.BadZipFile, zlib.error) as error:
        raise ValueError(f"It cannot be read, is it whole? {error}") from error


def write(target, result):
    """Write a file that is there as a whole, or not at all."""
    # A name of its own: two workers may have the same portion, if one was believed dead.
    part = target.with_name(f"{target.name}.{uuid.uuid4().hex}.part")
    with open(part, "xb") as file:
        if isinstance(result, dict):
            np.savez(file, **result)
        else:
            np.save(file, result)
        file.flush()
        os.fsync(file.fileno())
    os.replace(part, target)


def left(portions, results, method):
    """Yield the portions that have no result, each with the file for it."""
    sources = sorted(p for p in Path(portions).glob("*.np[yz]") if not p.name.startswith("."))
    if not sources:
        raise ValueError(f"There are no portions in {portions}: files .npy or .npz.")
    if Path(results).resolve() == Path(portions).resolve():
        raise ValueError(f"Results among the portions in {portions}: give another folder for them.")
    names = [source.stem for source in sources]
    if len(set(names)) < len(names):
        twice = next(name for name in names if names.count(name) > 1)
        raise ValueError(f"{twice}.npy and {twice}.npz would have one result: rename one of them.")
    for source in sources:
        target = Path(results) / f"{source.stem}{'.npz' if method == 'match' else '.npy'}"
        if not target.exists() or target.stat().st_mtime < source.stat().st_mtime:
            yield source, target


def claim(results, model, method):
    """Say in the folder of results whose they are, or refuse to mix; the model's hash."""
    with open(model, "rb") as file:
        digest = hashlib.file_digest(file, "sha256").hexdigest()
    check(loaded(str(model), digest), method)
    packages = (sklearn_motionsync, sklearn, np, scipy)
    whose = {"model": digest, "method": method}
    whose |= {package.__name__: package.__version__ for package in packages}
    note = Path(results) / "made_by.json"
    before = json.loads(note.read_text(encoding="utf-8")) if note.exists() else {}
    other = [name for name in whose if whose[name] != before.get(name)]
    if before and other and any(Path(results).glob("*.np[yz]")):
        raise ValueError(
            f"{results} holds results of another {' and another '.join(other)} (made_by.json): "
            "give another folder, or empty this one."
        )
    if other:
        note.parent.mkdir(parents=True, exist_ok=True)
        part = note.with_suffix(".part")
        part.write_text(json.dumps(whose, indent=1) + "\n", encoding="utf-8")
        os.replace(part, note)
    for part in Path(results).glob("*.part"):
        # Of a run that was killed.
        part.unlink(missing_ok=True)
    return digest


def main(arguments=None):
    """What the command line asks for; for the shell, 1 if portions were refused, or why not."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0], allow_abbrev=False)
    parser.add_argument("model", type=Path, help="a fitted pipeline, by joblib.dump")
    parser.add_argument("portions", type=Path, help="folder of .npy or .npz files")
    parser.add_argument("results", type=Path, help="folder, made if there is none")
    parser.add_argument("--method", choices=METHODS, default=METHODS[0])
    parser.add_argument("--n-jobs", type=int, help="portions at a time (default: 1)")
    parser.add_argument("--scheduler", help="address of a Dask cluster")
    given = parser.parse_args(arguments)
    refused = 0
    with ExitStack() as stack:
        if given.scheduler:
            from dask.distributed import Client

            client = stack.enter_context(Client(given.scheduler))
            client.upload_file(__file__)
            stack.enter_context(joblib.parallel_config(backend="dask"))
        # By their whole names, as workers may be somewhere else.
        files = given.model.resolve(), given.portions.resolve(), given.results.resolve()
        try:
            for source, wrong in stream(*files, given.method, given.n_jobs):
                refused += wrong is not None
                print(f"{source.name}: {wrong or 'done'}", flush=True)
        except ValueError as error:
            return str(error)
    return min(refused, 1)


if __name__ == "__main__":
    # By its name: what workers are given of this module they find there, and keep the model.
    from stream_files import main

    sys.exit(main())
