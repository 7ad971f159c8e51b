"""What the trials tell of their warps: whether ``evidence_`` knows when alignment does not help.

    pip install .
    python benchmarks/evidence.py DATA_FOLDER

Every action of events.py, and random subsets of its clips, are aligned to the time line of their
template. The gain is the mean error of a moment there, over that after linear normalisation, in
geometric mean over the moments of a set. Sets are sorted by what `DenseSynchronizer` says of them
without knowing the moments. Prints Markdown.
"""

import sys
import warnings
from itertools import pairwise

import numpy as np
from events import P
from people import on_time_line, read_people
from sklearn_motionsync import DenseSynchronizer, SynchronizationWarning

SIZES, DRAWS = (4, 8, 12), 4
EDGES = (0.0, 0.3, 0.5, 0.6, 0.7, 1.0, np.inf)


def judge(points, moments):
    """The evidence of a set, and its gain; NaN if no moment is shown by two clips."""
    sync = DenseSynchronizer(P).fit(points)
    times, logs = sync.match(points).times, []
    linear = np.tile(np.arange(float(P)), (len(points), 1))
    for at in moments.values():
        if np.isfinite(at).sum() > 1:
            ours, without = (on_time_line(tau, at)[0].mean() for tau in (times, linear))
            logs.append(np.log((ours + 0.05) / (without + 0.05)))
    gain = np.exp(np.mean(logs)) if logs else np.nan
    evidence = sync.evidence_
    return evidence.remaining, evidence.inconsistency, evidence.weak, gain


def subsets(people, rng):
    """Yield the size of a set, its points and its moments."""
    for one in people:
        for size in SIZES:
            for _ in range(DRAWS if size < len(one.X) else 0):
                some = np.sort(rng.choice(len(one.X), size, replace=False))
                moments = {event: at[some] for event, at in one.moments.items()}
                yield size, [one.X[i] for i in some], moments


def show(found):
    """Number of sets, mean gain, and the share of sets that are worse than linear."""
    gains = found[np.isfinite(found)]
    if not len(gains):
        return "-"
    worse = np.mean(gains > 1)
    return f"{len(gains)}: {np.exp(np.log(gains).mean()):.2f}, {worse:.0%} worse"


def main():
    warnings.simplefilter("ignore", SynchronizationWarning)
    people = read_people(sys.argv[1])
    print("| action | clips | remaining | inconsistency | weak | error over linear |")
    print("|---" * 6 + "|")
    for one in people:
        remaining, inconsistency, weak, gain = judge(one.X, one.moments)
        found = f"{remaining:.2f} | {inconsistency:.2f} | {'yes' if weak else 'no'} | {gain:.2f}"
        print(f"| `{one.name}` | {len(one.X)} | {found} |", flush=True)
    rows = subsets(people, np.random.default_rng(0))
    found = np.array([(size, *judge(X, moments)) for size, X, moments in rows])
    for column, name in ((1, "remaining"), (2, "inconsistency")):
        print(f"\n| {name} | " + " | ".join(f"{size} clips" for size in SIZES) + " |")
        print("|---" * (1 + len(SIZES)) + "|")
        for low, high in pairwise(EDGES):
            inside = (low <= found[:, column]) & (found[:, column] < high)
            cells = [show(found[inside & (found[:, 0] == size), 4]) for size in SIZES]
            print(f"| {low} to {high} | " + " | ".join(cells) + " |")
    for weak, name in ((0, "not weak"), (1, "weak")):
        cells = [show(found[(found[:, 3] == weak) & (found[:, 0] == size), 4]) for size in SIZES]
        print(f"| {name} | " + " | ".join(cells) + " |")


if __name__ == "__main__":
    main()
