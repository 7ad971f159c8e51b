"""Memory and time of many performances, as in docs/scaling.md.

Random bends of 100 frames as points of their aSpace, 16 features, single precision, which are made
once, in five minutes. Every line is of a process of its own. Memory is its peak above what it had
when it began, data in memory included; pages of a memory map that were looked at count, though the
system can take them back. Processor time of one thread. ``memory`` takes ten minutes, ``sample``
one, ``many`` ten, and ``classes`` (`ActionClassifier` of four actions) three.

    OMP_NUM_THREADS=1 python benchmarks/scaling.py [memory] [sample] [many] [classes]
"""

import subprocess
import sys
import tempfile
import time
from pathlib import Path

import numpy as np
from sklearn.pipeline import make_pipeline
from sklearn_motionsync import ActionClassifier, ASpace, DirectionCosines, LinearSynchronizer
from sklearn_motionsync.datasets import make_bending

FOLDER = Path(tempfile.gettempdir())
# So many performances are drawn, and written, at a time.
AT_ONCE = 1000
COMMON = """
import sys, time
import numpy as np
from sklearn_motionsync import DenseSynchronizer
def peak():
    with open("/proc/self/status") as status:
        return int(next(line for line in status if line.startswith("VmHWM")).split()[1]) * 1024
def forget_peak():
    with open("/proc/self/clear_refs", "w") as refs:
        refs.write("5")
class Files:
    def __init__(self, path, n):
        self.path, self.n = path, n
    def __len__(self):
        return self.n
    def __getitem__(self, i):
        held = np.load(self.path, mmap_mode="r")
        return np.array(held[i % len(held)])
path, mode, n, settings = sys.argv[1], sys.argv[2], int(sys.argv[3]), eval(sys.argv[4])
if mode == "files":
    X = Files(path, n)
elif mode == "maps":
    held = np.load(path, mmap_mode="r")
    X = [held[i % len(held)] for i in range(n)]
else:
    X = np.load(path, mmap_mode="r" if mode == "map" else None)[:n]
size = n * 100 * 16 * 4
"""
FIT = """
before, start = peak(), time.process_time()
sync = DenseSynchronizer(**settings).fit(X)
seconds = time.process_time() - start
print(f"{seconds:.1f} s | {(peak() - before) / size:.2f}", end=" | ")
forget_peak()
before, start = peak(), time.process_time()
sync.transform(X)
seconds = time.process_time() - start
print(f"{1e3 * seconds / n:.2f} ms | {(peak() - before) / size:.2f} |")
"""
SAMPLE = """
start = time.process_time()
sync = DenseSynchronizer(max_fit=500, **settings).fit(X)
seconds = time.process_time() - start
print(f"{seconds:.1f} s |")
"""
MANY = """
sync = DenseSynchronizer(max_fit=500, **settings).fit(X)
forget_peak()
before, start = peak(), time.process_time()
at_once = 1000 if mode == "maps" else n
for first in range(0, n, at_once):
    sync.transform(X if at_once == n else X[first : first + at_once])
seconds = time.process_time() - start
print(f"{seconds:.0f} s | {1e3 * seconds / n:.2f} ms | {(peak() - before) / 2**20:.0f} MB |")
"""


def bends(n=20_000):
    """A file of so many bends."""
    path = FOLDER / f"bends-{n}-single.npy"
    if path.exists():
        return path
    out = np.lib.format.open_memmap(path, "w+", np.float32, (n, 100, 16))
    first = make_bending(AT_ONCE, random_state=0)
    space = make_pipeline(DirectionCosines(first.skeleton), ASpace(16)).fit(first.data)
    clock = LinearSynchronizer(100).fit(space.transform(first.data))
    for start in range(0, n, AT_ONCE):
        some = make_bending(min(AT_ONCE, n - start), random_state=start).data
        out[start : start + AT_ONCE] = clock.transform(space.transform(some))
    return path


def measure(code, path, mode, n, settings):
    """What a process of its own prints."""
    command = [sys.executable, "-c", COMMON + code, path, mode, str(n), repr(settings)]
    return subprocess.run(command, check=True, capture_output=True, text=True).stdout.strip()


def memory():
    """Fit and transform of all, in memory and from a memory map."""
    print("| N | data | fit | above, x data | transform, each | above, x data |")
    print("|---|---|---|---|---|---|")
    for n in (1000, 5000, 20_000):
        for mode in ("memory", "map"):
            got = measure(FIT, bends(), mode, n, {})
            print(f"| {n} | {mode} | {got}", flush=True)


def sample():
    """Fit of a sample of 500."""
    print("| N | data | fit |")
    print("|---|---|---|")
    for n in (1000, 5000, 20_000):
        for mode in ("memory", "map", "files"):
            print(f"| {n} | {mode} | {measure(SAMPLE, bends(), mode, n, {})}", flush=True)


def many():
    """200,000 performances, a tenth of them different: 1000 maps at a time, and all files at once.

    The result of all is 1221 MB.
    """
    print("| N | data | transform | each | above |")
    print("|---|---|---|---|---|")
    for mode in ("maps", "files"):
        got = measure(MANY, bends(), mode, 200_000, {})
        print(f"| 200,000 | {mode} | {got}", flush=True)


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


def classes():
    """Fit and predictions of the classifier, compared with all performances and with landmarks."""
    print("| N | compared with | fit | one | a hundred, each | equal answers |")
    print("|---|---|---|---|---|---|")
    X, y, people = actions(1000, 0)
    new = actions(100, 1)[0]
    for n in (250, 500, 1000):
        found = []
        for n_landmarks in (None, ActionClassifier().n_landmarks):
            model = ActionClassifier(n_landmarks=n_landmarks)
            fit = seconds_of(lambda model=model, n=n: model.fit(X[:n], y[:n], groups=people[:n]))
            found.append(model.predict(new))
            one = np.median([seconds_of(lambda m=model, x=x: m.predict([x])) for x in new[:20]])
            hundred = seconds_of(lambda model=model: model.predict(new)) / 100
            same = np.mean(found[0] == found[-1])
            row = f"{fit:.1f} s | {1e3 * one:.0f} ms | {1e3 * hundred:.0f} ms | {100 * same:.0f} %"
            print(f"| {n} | {len(model.landmarks_)} | {row} |", flush=True)


if __name__ == "__main__":
    sections = {"memory": memory, "sample": sample, "many": many, "classes": classes}
    for name in sys.argv[1:] or sections:
        print(f"\n## {name}\n")
        sections[name]()
