"""Two versions of the package side by side: the jobs of `jobs.py` in turns, old and new.

    python benchmarks/compare.py BASE [--jobs fit_hops33,lone_hops] [--rounds 9]

BASE is a revision, such as ``main`` or ``HEAD~3``; the new version is this checkout as it is. Each
has a process of its own, which runs one thread, and the old one the jobs of its own revision, or
these if it has none. Of each job: the least milliseconds of the processor, old and new; the ratio
of the least ones; and the median of the ratios within a round, with its quartiles. On a busy
machine believe a change only where both ratios show it. At last come the jobs that are slower by
more than 5 % in both. All jobs take about five minutes.
"""

import argparse
import io
import json
import subprocess
import sys
import tarfile
import tempfile
import time
from os import environ
from pathlib import Path

import numpy as np
from jobs import DATA, ROOT

# A job ends after so many seconds, but not before so many rounds.
SECONDS, FEWEST = 6, 3
SLOWER = 1.05


class Worker:
    """The process that runs the jobs of a checkout."""

    def __init__(self, checkout, jobs, data):
        self._process = subprocess.Popen(
            [sys.executable, str(jobs), "--data", str(data)],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            text=True,
            env={**environ, "PYTHONPATH": str(checkout)},
        )
        listed = self.ask("list")
        self.jobs, package = listed["jobs"], Path(listed["package"]).resolve()
        if not package.is_relative_to(Path(checkout).resolve()):
            self.close()
            raise SystemExit(f"The process of {checkout} has imported {package}.")

    def ask(self, request):
        """The answer to a request: see `jobs.py`."""
        self._process.stdin.write(f"{request}\n")
        self._process.stdin.flush()
        line = self._process.stdout.readline()
        if not line:
            raise SystemExit(f"The process that was asked to {request} has ended.")
        return json.loads(line)

    def close(self):
        """End the process, which has no more requests to answer."""
        self._process.communicate()


def export(revision, folder):
    """Write the package and the benchmarks of a revision to a folder."""
    command = ["git", "archive", revision, "sklearn_motionsync", "benchmarks"]
    archive = subprocess.run(command, cwd=ROOT, check=True, stdout=subprocess.PIPE).stdout
    with tarfile.open(fileobj=io.BytesIO(archive)) as files:
        files.extractall(folder, filter="data")


def time_job(workers, name, rounds):
    """Milliseconds (rounds, 2) of a job, old and new; or what went wrong, as text."""
    ready = [worker.ask(f"prepare {name}") for worker in workers]
    errors = [
        f"{side}: {reply['error']}"
        for side, reply in zip(("old", "new"), ready, strict=True)
        if "error" in reply
    ]
    if errors:
        return "; ".join(errors)
    times, start = [], time.perf_counter()
    while len(times) < rounds and (len(times) < FEWEST or time.perf_counter() - start < SECONDS):
        times.append([worker.ask("run")["ms"] for worker in workers])
    return np.array(times)


def ratios(times):
    """The ratio of the least times, and the quartiles of the ratios within a round."""
    old, new = times.T
    return new.min() / old.min(), *np.quantile(new / old, [0.25, 0.5, 0.75])


def compare(workers, names, rounds):
    """Print a line a job, and then the jobs that are slower."""
    slower = []
    for name in names:
        times = time_job(workers, name, rounds)
        if isinstance(times, str):
            print(f"{name}: {times}", flush=True)
            continue
        least, low, middle, high = ratios(times)
        old, new = times.min(axis=0)
        print(
            f"{name}: {old:.3f} -> {new:.3f} ms, {least:.2f}; pairs {middle:.2f} "
            f"({low:.2f} to {high:.2f}, {len(times)} rounds)",
            flush=True,
        )
        if min(least, middle) > SLOWER:
            slower.append(f"{name} ({least:.2f}, {middle:.2f})")
    print(f"slower by more than {SLOWER - 1:.0%}: {', '.join(slower) or 'none'}")


def main():
    parser = argparse.ArgumentParser(description=__doc__.split("\n", maxsplit=1)[0])
    parser.add_argument("base", help="the revision to compare with")
    parser.add_argument("--jobs", help="some jobs, separated by commas; by default all")
    parser.add_argument("--rounds", type=int, default=9)
    parser.add_argument("--data", type=Path, default=DATA, help="the folder of the recordings")
    options = parser.parse_args()
    with tempfile.TemporaryDirectory(prefix="motionsync-base-") as folder:
        export(options.base, folder)
        here = Path(__file__).with_name("jobs.py")
        there = Path(folder) / "benchmarks" / "jobs.py"
        old = Worker(folder, there if there.exists() else here, options.data.resolve())
        new = Worker(ROOT, here, options.data.resolve())
        names = options.jobs.split(",") if options.jobs else new.jobs
        compare((old, new), names, options.rounds)
        for worker in (old, new):
            worker.close()


if __name__ == "__main__":
    main()
