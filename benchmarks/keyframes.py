"""Key-frames: what one known moment does for the others, and wrong labels.

    python benchmarks/keyframes.py DATA_FOLDER [given] [wrong]

*Given*: of every two moments of an action that peers were measured on (harness.py) one is given,
and the error of the other is judged on the pairs of clips that show both; with people who had no
part in the fit, too. *Wrong*: in one clip of five the moment that is given is wrong by a tenth of
the clip. Errors are in frames of 100, mean and median. Prints Markdown.
"""

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
    run_tables,
    show_pair,
)
from sklearn.model_selection import GroupKFold
from sklearn_motionsync import ASpace, DenseSynchronizer, LinearSynchronizer

FRAMES = np.arange(P)


def own_frames(at, X):
    """Moments in frames of 100 as key-frames of clips, one row each."""
    return (np.asarray(at) / (P - 1) * (np.array([len(x) for x in X]) - 1))[:, np.newaxis]


# -- the methods: warps of some clips to a template, after a fit to others ----------------------


def nothing(X, at, template, others, of_others):
    return DenseSynchronizer(P, pattern=template).fit(X).match(others).times


def anchored(std):
    """Dense matching with key-frames of this standard deviation."""

    def times(X, at, template, others, of_others):
        sync = DenseSynchronizer(P, pattern=template, keyframe_std=std)
        sync.fit(X, keyframes=own_frames(at, X))
        return sync.match(others, keyframes=own_frames(of_others, others)).times

    return times


def piecewise_linear(X, at, template, others, of_others):
    sync = LinearSynchronizer(P, pattern=template)
    sync.fit(X, keyframes=own_frames(at, X))
    return sync.match(others, keyframes=own_frames(of_others, others)).times


METHODS = {
    "nothing": nothing,
    "exact": anchored(0),
    "`keyframe_std=3`": anchored(3),
    "piecewise linear": piecewise_linear,
}


# -- what is judged -----------------------------------------------------------------------------


def cases(folder):
    """(one, given, judged) of every two moments of an action."""
    for one in read_people(folder, [event for event in EVENTS if event.peers]):
        for given, judged in permutations(one.moments, 2):
            yield one, given, judged


def errors_to_templates(one, given, judged, method):
    """Errors of the other moment, and of the given one, to every template that shows both."""
    at, wanted = one.moments[given], one.moments[judged]
    seen = np.flatnonzero(np.isfinite(at + wanted))
    X, at, wanted = [one.X[i] for i in seen], at[seen], wanted[seen]
    out = []
    for template in range(len(seen)):
        if seen[template] in one.patterns:
            times = np.delete(method(X, at, template, X, at), template, axis=0)
            out.append(missed(times, template, at, wanted, np.arange(len(seen)) != template))
    return np.concatenate(out, axis=1)


def errors_of_others(one, given, judged, method):
    """The same of the clips of people that had no part in the fit."""
    at, wanted = one.moments[given], one.moments[judged]
    seen = np.flatnonzero(np.isfinite(at + wanted))
    postures, at, wanted = [one.postures[i] for i in seen], at[seen], wanted[seen]
    actors, out = np.asarray(one.actors)[seen], []
    for train, test in GroupKFold(min(FOLDS, len(set(actors)))).split(seen, groups=actors):
        space = ASpace().fit([postures[i] for i in train])
        points = space.transform(postures)
        known, others = [points[i] for i in train], [points[i] for i in test]
        for row, template in enumerate(train):
            if seen[template] in one.patterns:
                times = method(known, at[train], row, others, at[test])
                out.append(missed(times, template, at, wanted, test))
    return np.concatenate(out, axis=1)


def missed(times, template, at, wanted, rows):
    """Distances from the other moment and from the given one: (2, n_clips)."""
    return np.array(
        [
            np.abs([np.interp(x[template], FRAMES, tau) for tau in times] - x[rows])
            for x in (wanted, at)
        ]
    )


def mislabelled(method, is_wrong):
    """The method given moments of which every fifth is a tenth of the clip early or late."""

    def moved(at, seed):
        rng, at = np.random.default_rng(seed), np.array(at)
        some = rng.permutation(len(at))[: round(len(at) / 5)]
        at[some] += 0.1 * (P - 1) * rng.choice([-1, 1], len(some))
        return np.clip(at, 5, P - 6)

    def times(X, at, template, others, of_others):
        if is_wrong:
            at, of_others = moved(at, template), moved(of_others, template + 1000)
        return method(X, at, template, others, of_others)

    return times


def given_table(folder):
    """A line of every case, and the means, over all pairs and of people held out."""
    for title, errors in (("", errors_to_templates), (", people held out", errors_of_others)):
        print_head(f"given{title}", ["judged", "pairs", *METHODS])
        rows = {}
        for one, given, judged in cases(folder):
            found = [errors(one, given, judged, method)[0] for method in METHODS.values()]
            rows[one.name, given, judged] = [(np.mean(x), np.median(x)) for x in found]
            cells = [judged, str(len(found[0])), *map(show_pair, rows[one.name, given, judged])]
            print_row(f"{one.name}: {given}", cells)
        hops = {key: row for key, row in rows.items() if "hop" in key[0]}
        for name, some in (("geometric mean", rows), ("of hops", hops)):
            pairs = [dict(enumerate(each)) for each in zip(*some.values(), strict=True)]
            print_row(f"**{name}**", ["", "", *(show_pair(geometric_means(x)) for x in pairs)])


def wrong_table(folder):
    """One given moment of five is wrong: errors of the other moment, of people held out."""
    print_head("given", ["mean / median"])
    methods = {name: METHODS[name] for name in ("nothing", "exact", "`keyframe_std=3`")}
    for name, method in methods.items():
        for is_wrong in (False, True) if name != "nothing" else (False,):
            pairs = {}
            for one, given, judged in cases(folder):
                other, _ = errors_of_others(one, given, judged, mislabelled(method, is_wrong))
                pairs[one.name, given, judged] = np.mean(other), np.median(other)
            title = f"{name}, one of five wrong" if is_wrong else name
            print_row(title, [show_pair(geometric_means(pairs))])


if __name__ == "__main__":
    run_tables({"given": given_table, "wrong": wrong_table}, command_line(__doc__))
