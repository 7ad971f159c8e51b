"""Why the defaults are what they are: one setting at a time, on real people.

    python benchmarks/choices.py DATA_FOLDER

The 16 events of harness.py that peers were measured on: geometric means over the events of the mean
and of the median error, in frames of 100. Of all ordered pairs with six patterns an action, and of
all pairs on the one common time line that a fit gives, as a set is used.
Health of the warps, in the mean over actions: share of frames that stand still (rate below 0.1)
and that hurry (above 2), and the spread of velocities after synchronising over that after linear
normalisation. Then the events at which linear normalisation misses less than the paper's method or
the defaults, and how exact global distances at fewer frames are. What the numbers in the code are
worth is the question of constants.py. Takes two minutes. Prints Markdown.
"""

from collections import ChainMap

import numpy as np
from harness import (
    EVENTS,
    P,
    command_line,
    figures,
    geometric_means,
    print_head,
    print_row,
    read_people,
    show_pair,
)
from sklearn_motionsync import DenseSynchronizer, LinearSynchronizer

CHOICES = {
    "metric": [None],
    "max_offset": [0.25, 0.33, 0.4, 0.5],
    "smoothness": [0.001, 0.003, 0.01, 0.03, 0.1],
    "max_rate": [2, 4, 6],
    "consensus": [0, 4, 8, 16],
}
PATTERNS = 6


def cells_of(people, **params):
    """One line of the table."""

    def times_to(X, n):
        return DenseSynchronizer(P, pattern=n, refine=False, **params).fit(X).match(X).times

    judged = [one.to_patterns(times_to) for one in people]
    errors = ChainMap(*(one.errors() for one in judged))
    lines = ChainMap(*(one.to_time_line(lambda X: times_to(X, "median")) for one in people))
    on_lines = figures({event: errors for event, (errors, _) in lines.items()})
    still, hurry, spread = np.mean([one.health() for one in judged], axis=0)
    pairs = [show_pair(geometric_means(of)) for of in (figures(errors), on_lines)]
    return [*pairs, f"{still:.0%}", f"{hurry:.0%}", f"{spread:.2f}"]


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
    print_head("event", makes)
    for event in sorted(worse[0] | worse[1]):
        print_row(", ".join(event), [show_pair(one[event]) for one in found.values()])


def distances_at_fewer_frames(people):
    """Global distances by fewer frames, over those by all frames."""
    print_head("median by fewer frames", ["C_n over exact, least", "most", "the same median"])
    for one in people:
        sync = DenseSynchronizer(P).fit(one.X)
        every = range(len(one.X))
        fits = (DenseSynchronizer(P, pattern=n, refine=False).fit(one.X) for n in every)
        exact = np.array([fit.match(one.X).distances.sum() for fit in fits])
        ratios, same = sync.global_distances_ / exact, sync.pattern_index_ == exact.argmin()
        ends = [f"{ratios.min():.2f}", f"{ratios.max():.2f}"]
        print_row(one.name, [*ends, "yes" if same else "no"])


def times_of(make):
    """tau of all performances to one of them, by a synchronizer of this kind."""
    return lambda X, n: make(n_frames=P, pattern=n).fit(X).match(X).times


def setting_table(people):
    """The defaults, and one parameter changed at a time."""
    header = ["all ordered pairs", "one common time line", "stand still", "hurry"]
    print_head("setting", [*header, "spread of velocity"])
    of_defaults = cells_of(people)
    print_row("defaults", of_defaults)
    for name, values in CHOICES.items():
        for value in values:
            is_default = value == getattr(DenseSynchronizer(), name)
            cells = of_defaults if is_default else cells_of(people, **{name: value})
            print_row(f"`{name}={value}`", cells)


if __name__ == "__main__":
    folder = command_line(__doc__).parse_args().folder
    setting_table(read_people(folder, [event for event in EVENTS if event.peers], PATTERNS))
    everyone = read_people(folder, patterns=PATTERNS)
    beside_linear(everyone)
    distances_at_fewer_frames(everyone)
