"""Why the defaults are what they are: one setting at a time, on real people.

    python benchmarks/choices.py DATA_FOLDER

The 16 events of events.py that peers were measured on, all ordered pairs with six patterns an
action: geometric means over the events of the mean and of the median error, in frames of 100.
Health of the warps, in the mean over actions: share of frames that stand still (rate below 0.1)
and that hurry (above 2), and the spread of velocities after synchronising over that after linear
normalisation. Prints Markdown.
"""

import sys
from collections import ChainMap
from pathlib import Path

import numpy as np
from events import EVENTS, P
from people import figures, geometric_means, read_people
from sklearn_motionsync import DenseSynchronizer
from sklearn_motionsync.matching import costs
from sklearn_motionsync.matching import metric as learning

CHOICES = {
    "metric": [None],
    "velocity_smoothing": [0.01, 0.02, 0.03, 0.06, 0.1],
    "max_offset": [0.25, 0.33, 0.4, 0.5],
    "smoothness": [0.001, 0.003, 0.01, 0.03, 0.1],
    "max_rate": [2, 4, 6],
    "subframes": [1, 2, 4],
    "consensus": [0, 4, 8, 16],
    "warp_smoothing": [0, 0.02, 0.03, 0.05],
}
PATTERNS = 6
# Not a parameter: w of the velocity cost, costs.step_table.
RATE_WEIGHTS = [0.0, 0.1, 0.2, 0.3, 1.0]


def matched(X, n, **params):
    """tau of all performances to one of them."""
    return DenseSynchronizer(P, pattern=n, refine=False, **params).fit(X).match(X).times


def rematched_to_mean(X, n, rounds):
    """The usual alternative to a vote: match again to the mean of the synchronised set."""
    sync = DenseSynchronizer(P, pattern=n, consensus=0).fit(X)
    for _ in range(rounds):
        mean = sync.transform(X).mean(axis=0)
        sync = DenseSynchronizer(P, pattern=mean, consensus=0).fit(X)
    return sync.match(X).times


def row(label, people, times_to=matched, **params):
    """One line of the table."""
    judged = [one.to_patterns(lambda X, n: times_to(X, n, **params)) for one in people]
    errors = ChainMap(*(one.errors() for one in judged))
    mean, median = geometric_means(figures(errors))
    still, hurry, spread = np.mean([one.health() for one in judged], axis=0)
    found = f"{mean:.2f} / {median:.2f} | {still:.0%} | {hurry:.0%} | {spread:.2f}"
    print(f"| {label} | {found} |", flush=True)
    return found


def main():
    """Print the table."""
    people = read_people(Path(sys.argv[1]), [event for event in EVENTS if event.peers], PATTERNS)
    print("| setting | error | stands still | hurries | spread of velocity |\n" + "|---" * 5 + "|")
    of_defaults = row("defaults", people)
    for name, values in CHOICES.items():
        for value in values:
            if value == getattr(DenseSynchronizer(), name):
                print(f"| `{name}={value}` | {of_defaults} |")
            else:
                row(f"`{name}={value}`", people, **{name: value})
    default = costs.RATE_WEIGHT
    for weight in RATE_WEIGHTS:
        costs.RATE_WEIGHT = learning.RATE_WEIGHT = weight
        row(f"w = {weight}", people)
    costs.RATE_WEIGHT = learning.RATE_WEIGHT = default
    for rounds in (1, 3):
        label = f"no vote, re-matched to the running mean, rounds: {rounds}"
        row(label, people, rematched_to_mean, rounds=rounds)


if __name__ == "__main__":
    main()
