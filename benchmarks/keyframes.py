"""Key-frames: what one known moment does for the others.

    python benchmarks/keyframes.py DATA_FOLDER

Of every two moments of an action that constants were chosen on (harness.py) one is given, and the
error of the other is judged on the pairs of clips that show both, with people who had no part in
the fit. Errors are in frames of 100, mean and median. Prints Markdown.
"""

from functools import partial
from itertools import permutations

import numpy as np
from harness import (
    EVENTS,
    FOLDS,
    P,
    command_line,
    geometric_means,
    print_head,
    print_row,
    read_people,
    show_pair,
)
from sklearn.model_selection import GroupKFold
from sklearn_motionsync import ASpace, DenseSynchronizer, LinearSynchronizer

FRAMES = np.arange(P)


# What makes a synchronizer of a pattern; "nothing" is told no key-frames.
METHODS = {
    "nothing": partial(DenseSynchronizer, P),
    "exact": partial(DenseSynchronizer, P, keyframe_std=0),
    "`keyframe_std=3`": partial(DenseSynchronizer, P, keyframe_std=3),
    "piecewise linear": partial(LinearSynchronizer, P),
}


def told(name, at, X):
    """What a method is told of clips: moments in frames of 100 as key-frames, one row each."""
    keyframes = at[:, np.newaxis] / (P - 1) * (np.array([[len(x)] for x in X]) - 1)
    return {} if name == "nothing" else {"keyframes": keyframes}


# -- what is judged -----------------------------------------------------------------------------


def cases(folder):
    """(one, given, judged) of every two moments of an action."""
    for one in read_people(folder, [event for event in EVENTS if event.chosen]):
        for given, judged in permutations(one.moments, 2):
            yield one, given, judged


def errors_of_others(one, given, judged, name):
    """Errors of the other moment, of people that had no part in the fit."""
    at, wanted = one.moments[given], one.moments[judged]
    seen = np.flatnonzero(np.isfinite(at + wanted))
    poses, at, wanted = [one.poses[i] for i in seen], at[seen], wanted[seen]
    actors, out = np.asarray(one.actors)[seen], []
    for train, test in GroupKFold(min(FOLDS, len(set(actors)))).split(seen, groups=actors):
        space = ASpace().fit([poses[i] for i in train])
        points = space.transform(poses)
        known, others = [points[i] for i in train], [points[i] for i in test]
        for row, pattern in enumerate(train):
            if seen[pattern] in one.patterns:
                sync = METHODS[name](pattern=row).fit(known, **told(name, at[train], known))
                times = sync.match(others, **told(name, at[test], others)).times
                landed = [np.interp(wanted[pattern], FRAMES, tau) for tau in times]
                out.append(np.abs(landed - wanted[test]))
    return np.concatenate(out)


def given_table(folder):
    """A line of every case, and the means."""
    print_head("given", ["judged", "pairs", *METHODS])
    rows = {}
    for one, given, judged in cases(folder):
        found = [errors_of_others(one, given, judged, name) for name in METHODS]
        rows[one.name, given, judged] = [(np.mean(x), np.median(x)) for x in found]
        cells = [judged, str(len(found[0])), *map(show_pair, rows[one.name, given, judged])]
        print_row(f"{one.name}: {given}", cells)
    hops = {key: row for key, row in rows.items() if "hop" in key[0]}
    for name, some in (("geometric mean", rows), ("of hops", hops)):
        pairs = [dict(enumerate(each)) for each in zip(*some.values(), strict=True)]
        print_row(f"**{name}**", ["", "", *(show_pair(geometric_means(x)) for x in pairs)])


if __name__ == "__main__":
    given_table(command_line(__doc__).parse_args().folder)
