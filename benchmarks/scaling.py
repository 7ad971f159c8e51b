"""Memory and time of many trials, as in docs/scaling.md.

    OMP_NUM_THREADS=1 python benchmarks/scaling.py [memory] [many] [classes] [--size 20000]

Random bends of 100 frames as points of their aSpace, 16 features, single precision, which are made
once, in five minutes. Every line of *memory* and *many* is of a process of its own (Linux). Memory
is its peak above what it had when it began, data in memory included; pages of a memory map that
were looked at count, though the system can take them back. *Many* trials are ten times as many, a
tenth of them different, by memory maps, 1000 at a time, and a fit of 500. *Classes* are those of
`ActionClassifier`, compared with all trials and with landmarks. Processor time of one thread.
"""

import argparse
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import numpy as np
from harness import print_head, print_row
from sklearn.pipeline import make_pipeline
from sklearn_motionsync import ActionClassifier, ASpace, DirectionCosines, LinearSynchronizer
from sklearn_motionsync.datasets import make_bending

# So many trials are drawn, written or transformed at a time.
AT_ONCE = 1000
MEASURE = """
import sys, time
import numpy as np
from sklearn_motionsync import DenseSynchronizer
def peak():
    with open("/proc/self/status") as status:
        return int(next(line for line in status if line.startswith("VmHWM")).split()[1]) / 1024
def forget_peak():
    with open("/proc/self/clear_refs", "w") as refs:
        refs.write("5")
path, mode, n, max_fit, at_once = sys.argv[1], sys.argv[2], *map(eval, sys.argv[3:])
held = np.load(path, mmap_mode=None if mode == "memory" else "r")
X = held[:n] if n <= len(held) else [held[i % len(held)] for i in range(n)]
before, start = peak(), time.process_time()
sync = DenseSynchronizer(max_fit=max_fit).fit(X)
print(time.process_time() - start, peak() - before)
forget_peak()
before, start = peak(), time.process_time()
for first in range(0, n, at_once):
    sync.transform(X[first : first + at_once])
print(time.process_time() - start, peak() - before)
"""


def bends(n):
    """A file of so many bends."""
    path = Path(tempfile.gettempdir()) / f"bends-{n}-single.npy"
    if path.exists():
        return path
    first = make_bending(AT_ONCE, random_state=0)
    space = make_pipeline(DirectionCosines(first.skeleton), ASpace(16)).fit(first.data)
    clock = LinearSynchronizer(100).fit(space.transform(first.data))
    out = np.lib.format.open_memmap(path, "w+", np.float32, (n, 100, 16))
    for start in range(0, n, AT_ONCE):
        drawn = make_bending(min(AT_ONCE, n - start), random_state=start).data
        out[start : start + AT_ONCE] = clock.transform(space.transform(drawn))
    return path


def measured(size, mode, n, max_fit=None, at_once=None):
    """Cells of a process: seconds of the fit, milliseconds of a transform, and their memory."""
    arguments = [str(bends(size)), mode, str(n), str(max_fit), str(at_once or n)]
    command = [sys.executable, "-c", MEASURE, *arguments]
    answer = subprocess.run(command, check=True, capture_output=True, text=True).stdout
    fit, fit_peak, transform, peak = map(float, answer.split())
    return [f"{fit:.1f}", f"{fit_peak:.0f}", f"{1e3 * transform / n:.2f}", f"{peak:.0f}"]


HEADER = ["fit, s", "MB", "transform, each, ms", "MB"]


def memory(size):
    """Fit and transform of all, in memory and from a memory map."""
    print_head("N, data", HEADER)
    for n in (size // 20, size // 4, size):
        for mode in ("memory", "map"):
            print_row(f"{n}, {mode}", measured(size, mode, n))


def many(size):
    print_head("N, data", HEADER)
    cells = measured(size, "map", 10 * size, max_fit=500, at_once=AT_ONCE)
    print_row(f"{10 * size}, maps", cells)


def actions(n, seed):
    """Bends, halves of them and their reverse, as cosines of limbs: data, actions, people."""
    bunch = make_bending(n, n_actors=20, random_state=seed)
    X = list(DirectionCosines(bunch.skeleton).fit_transform(bunch.data))
    parts = [lambda x: x, lambda x: x[: len(x) // 2], lambda x: x[len(x) // 2 :], lambda x: x[::-1]]
    return [parts[i % 4](x) for i, x in enumerate(X)], np.arange(n) % 4, bunch.actor


def seconds_of(function):
    """Processor time."""
    start = time.process_time()
    function()
    return time.process_time() - start


def classes(size):
    """Fit and predictions of the classifier."""
    print_head("N, compared with", ["fit", "one", "a hundred, each", "equal answers"])
    X, y, people = actions(1000, 0)
    new = actions(100, 1)[0]
    for n in (250, 500, 1000):
        answers = []
        for n_landmarks in (None, ActionClassifier().n_landmarks):
            model = ActionClassifier(n_landmarks=n_landmarks)
            fit = seconds_of(lambda model=model, n=n: model.fit(X[:n], y[:n], groups=people[:n]))
            answers.append(model.predict(new))
            one = np.median([seconds_of(lambda m=model, x=x: m.predict([x])) for x in new[:20]])
            hundred = seconds_of(lambda model=model: model.predict(new)) / 100
            same = np.mean(answers[0] == answers[-1])
            cells = [f"{fit:.1f} s", f"{1e3 * one:.0f} ms", f"{1e3 * hundred:.0f} ms"]
            print_row(f"{n}, {len(model.landmarks_)}", [*cells, f"{same:.0%}"])


if __name__ == "__main__":
    sections = {"memory": memory, "many": many, "classes": classes}
    parser = argparse.ArgumentParser(description=__doc__.split("\n", maxsplit=1)[0])
    parser.add_argument("sections", nargs="*", default=list(sections))
    parser.add_argument("--size", type=int, default=20_000, help="bends that are made")
    options = parser.parse_args()
    for name in options.sections:
        sections[name](options.size)
