"""Why the defaults are what they are: one setting at a time, on real people.

    python benchmarks/choices.py DATA_FOLDER

The 16 events of harness.py that peers were measured on: geometric means over the events of the mean
and of the median error, in frames of 100. Of all ordered pairs with six patterns an action, and of
all pairs on the one common time line that a fit gives, as a set is used.
Health of the warps, in the mean over actions: share of frames that stand still (rate below 0.1)
and that hurry (above 2), and the spread of velocities after synchronising over that after linear
normalisation. Then the constants that are no parameters, other ways to do a step, and the events at
which linear normalisation misses less than the paper's method or the defaults, and how exact global
distances at fewer frames are. Takes two minutes. Prints Markdown.
"""

import sys
from collections import ChainMap
from contextlib import ExitStack
from pathlib import Path
from unittest.mock import patch

import numpy as np
from harness import EVENTS, P, figures, geometric_means, read_people
from sklearn_motionsync import DenseSynchronizer, LinearSynchronizer
from sklearn_motionsync.matching import consensus, costs, metric
from sklearn_motionsync.synchronizers import learning

CHOICES = {
    "metric": [None],
    "max_offset": [0.25, 0.33, 0.4, 0.5],
    "smoothness": [0.001, 0.003, 0.01, 0.03, 0.1],
    "max_rate": [2, 4, 6],
    "consensus": [0, 4, 8, 16],
}
PATTERNS = 6


def most_typical(distances, count, pattern=None):
    """Exemplars that are nearest to all others."""
    ranking = np.argsort(distances, kind="stable")
    return ranking[ranking != pattern][:count]


def at_random(distances, count, pattern=None):
    """Exemplars that are drawn."""
    drawn = np.random.default_rng(0).permutation(len(distances))
    return drawn[drawn != pattern][:count]


def not_compressed(velocity, energy):
    """Velocities whose speeds are left as they are."""
    return velocity / np.sqrt(energy).astype(velocity.dtype)


# Not parameters: what is replaced, where, and by what.
CONSTANTS = [
    ("smoothing of velocities and offsets", "FINE_SMOOTHING", (learning,), [0.0, 0.01, 0.03, 0.05]),
    ("weight w of the rate", "RATE_WEIGHT", (costs, metric), [0.0, 0.1, 0.3, 1.0]),
    ("power of the metric's eigenvalues", "_SHRINKAGE", (metric,), [0.3, 1.0]),
    ("standard errors to believe a feature", "_RELIABLE", (metric,), [-np.inf, 3.0]),
    ("speeds of the metric", "compressed", (metric,), [not_compressed]),
    ("largest offset while learning", "_LEARNING_OFFSET", (learning,), [0.12, 0.25]),
    ("performances the metric is learnt from", "MOST_LEARNT", (learning,), [12, 16]),
    ("exemplars", "choose_exemplars", (learning, consensus), [most_typical, at_random]),
]


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
    lines = ChainMap(
        *(one.to_time_line(lambda X: times_to(X, "median", **params)) for one in people)
    )
    on_lines = figures({event: errors for event, (errors, _) in lines.items()})
    pairs = (geometric_means(of) for of in (figures(errors), on_lines))
    still, hurry, spread = np.mean([one.health() for one in judged], axis=0)
    errors = " | ".join(f"{mean:.2f} / {median:.2f}" for mean, median in pairs)
    found = f"{errors} | {still:.0%} | {hurry:.0%} | {spread:.2f}"
    print(f"| {label} | {found} |", flush=True)
    return found


def beside_linear(people):
    """Events at which the paper's method, or the defaults, miss more than linear normalisation."""
    makes = {
        "linear normalisation": LinearSynchronizer,
        "the paper's method": DenseSynchronizer.paper,
        "`DenseSynchronizer()`": DenseSynchronizer,
    }
    found = {
        name: figures(ChainMap(*(one.to_patterns(times_of(make)).errors() for one in people)))
        for name, make in makes.items()
    }
    linear, *others = found.values()
    worse = [{event for event in linear if one[event][0] > linear[event][0]} for one in others]
    counts = " and ".join(str(len(events)) for events in worse)
    print(f"\nThe paper's method and the defaults miss more at {counts} of {len(linear)} events:\n")
    print("| event | " + " | ".join(makes) + " |\n" + "|---" * 4 + "|")
    for event in sorted(worse[0] | worse[1]):
        cells = (f"{one[event][0]:.2f} / {one[event][1]:.2f}" for one in found.values())
        print(f"| {', '.join(event)} | " + " | ".join(cells) + " |")


def distances_at_fewer_frames(people):
    """Global distances by fewer frames, over those by all frames."""
    print("\n| median by fewer frames | C_n over exact, least | most | the same median |")
    print("|---" * 4 + "|")
    for one in people:
        sync = DenseSynchronizer(P).fit(one.X)
        every = range(len(one.X))
        fits = (DenseSynchronizer(P, pattern=n, refine=False).fit(one.X) for n in every)
        exact = np.array([fit.match(one.X).distances.sum() for fit in fits])
        ratios, same = sync.global_distances_ / exact, sync.pattern_index_ == exact.argmin()
        print(
            f"| {one.name} | {ratios.min():.2f} | {ratios.max():.2f} | {'yes' if same else 'no'} |"
        )


def times_of(make):
    """tau of all performances to one of them, by a synchronizer of this kind."""
    return lambda X, n: make(n_frames=P, pattern=n).fit(X).match(X).times


def main():
    """Print the tables."""
    folder = Path(sys.argv[1])
    people = read_people(folder, [event for event in EVENTS if event.peers], PATTERNS)
    header = "all ordered pairs | one common time line | stand still | hurry | spread of velocity"
    print(f"| setting | {header} |\n" + "|---" * 6 + "|")
    of_defaults = row("defaults", people)
    for name, values in CHOICES.items():
        for value in values:
            if value == getattr(DenseSynchronizer(), name):
                print(f"| `{name}={value}` | {of_defaults} |")
            else:
                row(f"`{name}={value}`", people, **{name: value})
    for label, name, modules, values in CONSTANTS:
        for value in values:
            with ExitStack() as stack:
                for module in modules:
                    stack.enter_context(patch.object(module, name, value))
                row(f"{label}: {getattr(value, '__name__', value)}", people)
    for rounds in (1, 3):
        label = f"no vote, re-matched to the running mean, rounds: {rounds}"
        row(label, people, rematched_to_mean, rounds=rounds)
    everyone = read_people(folder, patterns=PATTERNS)
    beside_linear(everyone)
    distances_at_fewer_frames(everyone)


if __name__ == "__main__":
    main()
