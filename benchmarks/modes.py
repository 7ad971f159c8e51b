"""Modes: how often sets of one action are split, how often mixed sets are told, and what it brings.

    python benchmarks/modes.py DATA_FOLDER

Ordinary sets are the actions of events.py, whole and as random subsets. Mixed sets hold clips of an
action beside clips in which it is done twice, one clip of the same person after another; or clips
of two actions. A mixed set is told if its modes agree with the truth (adjusted Rand index above
0.8). Where it is told, moments are compared with those of a fit that takes all for one mode:
errors in frames of 100 of the template's own mode, and standard deviations on its clock of the
other mode's. Prints Markdown.
"""

import sys
from itertools import combinations
from unittest.mock import patch

import numpy as np
from events import EVENTS, P, read_actions
from sklearn.metrics import adjusted_rand_score
from sklearn_motionsync import ASpace, DenseSynchronizer, DirectionCosines
from sklearn_motionsync.matching.modes import DistanceTable, Modes

SIZES, DRAWS = (6, 8, 10, 12, 16), 20
MIXES = (12, 12), (12, 4), (4, 12)


def points(clips, skeleton):
    """Points of the clips in an aSpace of their own."""
    return ASpace().fit_transform(DirectionCosines(skeleton).fit_transform(clips))


def labels(X):
    """The modes of a set."""
    return DenseSynchronizer(P, refine=False).fit(X).modes_.labels


def spread(n, count):
    """Indices of so many of n, evenly spaced."""
    return np.unique(np.linspace(0, n - 1, min(n, count)).astype(int))


def twice(action):
    """Clips of the same people one after the other, and the moments of both, {event: (n, 2)}."""
    up, clips, moments = "xyz".index(action.skeleton.up), [], {e: [] for e in action.moments}
    for actor in dict.fromkeys(action.actors):
        own = np.flatnonzero(np.asarray(action.actors) == actor)
        for i, j in zip(own[::2], own[1::2], strict=False):
            first, second = (action.data[k].reshape(len(action.data[k]), -1, 3) for k in (i, j))
            shift = first[-1].mean(axis=0) - second[0].mean(axis=0)
            shift[up] = 0
            joined = np.concatenate([first, second[1:] + shift])
            clips.append(joined.reshape(len(joined), -1))
            cut, end = len(first) - 1, len(joined) - 1
            for event, at in action.moments.items():
                both = at[i] * cut, cut * (P - 1) + at[j] * (end - cut)
                moments[event].append(np.array(both) / end)
    return clips, {event: np.array(both) for event, both in moments.items()}


def ordinary_table(actions):
    """Shares of ordinary sets that are split."""
    sets = [points(a.data, a.skeleton) for a in actions]
    rng = np.random.default_rng(0)
    print("| clips | sets | split |\n|---|---|---|")
    whole = [labels(X).any() for X in sets]
    print(f"| all | {len(whole)} | {np.mean(whole):.1%} |")
    for size in SIZES:
        found = []
        for X in sets:
            for _ in range(DRAWS if len(X) > size else 0):
                some = np.sort(rng.permutation(len(X))[:size])
                found.append(labels([X[i] for i in some]).any())
        print(f"| {size} | {len(found)} | {np.mean(found):.1%} |")


def told(X, truth):
    """Whether modes are found, and are the true ones."""
    found = labels(X)
    return found.any(), adjusted_rand_score(truth, found) > 0.8


def placed(X, truth, moments, home):
    """Error of the moments of mode ``home`` by a template of it, and spread of the other's."""
    members = np.flatnonzero(truth == home)
    template = members[len(members) // 2]
    times = DenseSynchronizer(P, pattern=int(template), refine=False).fit(X).match(X).times
    tilted = times + 1e-9 * np.arange(P)
    errors, spreads = [], []
    for mode, events in enumerate(moments):
        own = np.flatnonzero(truth == mode)
        for at in events:
            pairs = zip(at, tilted[own], strict=True)
            on_clock = [np.interp(t, tau, np.arange(P)) for t, tau in pairs]
            if mode == home:
                wanted = at[own == template][0]
                errors.append(np.nanmean(np.abs(np.delete(on_clock, own == template) - wanted)))
            elif np.isfinite(on_clock).sum() > 2:
                spreads.append(np.nanstd(on_clock))
    return np.nanmean(errors), np.nanmean(spreads)


def mixed_tables(actions):
    """How often mixed sets are told, and what that brings."""
    once_twice, two, gains = [], [], []
    for action in actions:
        clips, both = twice(action)
        for n, m in MIXES:
            first, second = spread(len(action.data), n), spread(len(clips), m)
            X = [action.data[i] for i in first] + [clips[i] for i in second]
            X, truth = points(X, action.skeleton), np.repeat([0, 1], [len(first), len(second)])
            once_twice.append(told(X, truth))
            if not once_twice[-1][1]:
                continue
            of_twice = [x[second, k] for x in both.values() for k in (0, 1)]
            moments = [at[first] for at in action.moments.values()], of_twice
            for home in (0, 1):
                now = placed(X, truth, moments, home)
                with patch.object(DistanceTable, "modes", lambda self, n, store: Modes.single(n)):
                    before = placed(X, truth, moments, home)
                gains.append((home, *before, *now))
    for a, b in combinations(actions, 2):
        if a.archive == b.archive:
            for n, m in MIXES[:2]:
                some = [a.data[i] for i in spread(len(a.data), n)]
                some += [b.data[i] for i in spread(len(b.data), m)]
                truth = np.repeat([0, 1], [len(some) - min(m, len(b.data)), min(m, len(b.data))])
                two.append(told(points(some, a.skeleton), truth))
    print("\n| mixed sets | number | several modes found | the true ones |\n|---|---|---|---|")
    for name, found in (("once and twice", once_twice), ("two actions", two)):
        several, right = np.mean(found, axis=0)
        print(f"| {name} | {len(found)} | {several:.0%} | {right:.0%} |")
    print("\n| template does it | sets | own error | by modes | other's spread | by modes |")
    print("|---|---|---|---|---|---|")
    for home, name in enumerate(("once", "twice")):
        of_home = [row[1:] for row in gains if row[0] == home]
        error, other, error_now, other_now = np.mean(of_home, axis=0)
        cells = f"{error:.2f} | {error_now:.2f} | {other:.2f} | {other_now:.2f}"
        print(f"| {name} | {len(of_home)} | {cells} |")


if __name__ == "__main__":
    people = read_actions(sys.argv[1], EVENTS)
    ordinary_table(people)
    mixed_tables(people)
