"""How sure a warp is: the coverage of `Match.interval`, and whom `Match.doubtful` names.

    python benchmarks/intervals.py DATA_FOLDER [people] [doubts]

*People*: the key moments of harness.py, on people that had no part in the fit; the moment of the
pattern is to lie inside the interval of each clip. *Doubts*: trials that are wrong (repeated, cut
off, backwards, held still, of another action) among trials that are right. Prints Markdown.
"""

import warnings
from functools import partial

import numpy as np
from harness import P, command_line, percent, print_head, print_row, read_people, run_tables
from joblib import Parallel, delayed
from scipy.stats import spearmanr
from sklearn.model_selection import GroupKFold
from sklearn_motionsync import ASpace, DenseSynchronizer

NOMINAL = (0.8, 0.9, 0.95)
FIGURES = ("mean error", "half-width of 90 %", "80 %", "90 %", "95 %")
FEWEST = 20


# -- people held out --------------------------------------------------------------------


def judge(one):
    """Absolute errors in frames of 100, half-widths, whether each interval holds, by event."""
    warnings.simplefilter("ignore")
    found = {event: [] for event in one.moments}
    for row, test, match in one.matches_of_strangers(partial(DenseSynchronizer, P)):
        n = one.patterns[row]
        bounds = [match.interval(c) for c in NOMINAL]
        for event, at in one.moments.items():
            for j, i in enumerate(test):
                if np.isfinite(at[n] + at[i]):
                    read = partial(np.interp, at[n], np.arange(P))
                    held = [read(low[j]) <= at[i] <= read(high[j]) for low, high in bounds]
                    low, high = bounds[1]
                    width = (read(high[j]) - read(low[j])) / 2
                    error = abs(read(match.times[j]) - at[i])
                    found[event].append((error, width, *held))
    return {event: np.array(rows, dtype=float) for event, rows in found.items() if rows}


def rank_correlation(events):
    """Mean over events of Spearman's correlation of half-width and error, inside the event."""
    several = [rows for rows in events if len(rows) >= FEWEST]
    return np.mean([spearmanr(rows[:, 1], rows[:, 0])[0] for rows in several])


def people_table(folder):
    """Coverage of each action, and of all pairs."""
    people = read_people(folder)
    done = Parallel(n_jobs=-1)(delayed(judge)(one) for one in people)
    print_head("people held out", ["pairs", *FIGURES])
    for one, events in zip(people, done, strict=True):
        rows = np.concatenate(list(events.values()))
        show(f"{one.archive}: `{one.name}`", len(rows), rows.mean(axis=0))
    events = [rows for some in done for rows in some.values()]
    rows = np.concatenate(events)
    show("**all**", len(rows), rows.mean(axis=0))
    print(f"\nA constant half-width of 90 %: {np.quantile(rows[:, 0], 0.9):.1f} frames.")
    overall = spearmanr(rows[:, 1], rows[:, 0])[0]
    print(f"Spearman over all {overall:.2f}, inside an event {rank_correlation(events):.2f}.")
    parts = np.array_split(rows[np.argsort(rows[:, 1])], 4)
    quarters = " ".join(f"{part[:, 0].mean():.1f}" for part in parts)
    print(f"Mean errors by quarter of half-width: {quarters}.\n", flush=True)


def show(name, count, means):
    error, width, *held = means
    print_row(name, [str(count), f"{error:.1f}", f"{width:.1f}", *(f"{h:.0%}" for h in held)])


# -- doubtful trials --------------------------------------------------------------------

WRONG = {
    "as recorded": lambda x: x,
    "repeated": lambda x: np.concatenate([x, x]),
    "the first half": lambda x: x[: max(2, len(x) // 2)],
    "backwards": lambda x: x[::-1],
    "held still": lambda x: x[:1] + 1e-3 * np.sin(np.arange(30.0))[:, np.newaxis],
}


OTHER = "another action"


def doubts(one, others):
    """Shares of doubtful trials of people held out, by what was done to them.

    ``others`` are the actions of the same archive; of those the same people's trials are tried.
    """
    warnings.simplefilter("ignore")
    shares, is_weak = {kind: [] for kind in [*WRONG, OTHER]}, []
    folds = GroupKFold(min(4, len(set(one.actors))))
    for train, test in folds.split(one.X, groups=one.actors):
        space = ASpace().fit([one.poses[i] for i in train])
        points = space.transform(one.poses)
        sync = DenseSynchronizer(P).fit([points[i] for i in train])
        is_weak.append(sync.evidence_.weak)
        for kind, change in WRONG.items():
            shares[kind].extend(sync.match([change(points[i]) for i in test]).doubtful)
        people = set(one.actors[test])
        wrong = [
            x
            for other in others
            for x, a in zip(other.poses, other.actors, strict=True)
            if a in people
        ]
        if wrong:
            shares[OTHER].extend(sync.match(space.transform(wrong)).doubtful)
    return [np.mean(some) if some else np.nan for some in shares.values()], np.mean(is_weak)


def doubts_table(folder):
    people = read_people(folder)
    work = []
    for one in people:
        others = [x for x in people if x is not one and x.archive == one.archive]
        work.append(delayed(doubts)(one, others))
    done = Parallel(n_jobs=-1)(work)
    print_head("doubtful, %, people held out", [*WRONG, OTHER])
    supported = []
    for one, (shares, weak) in zip(people, done, strict=True):
        supported += [shares] * bool(weak == 0)
        mark = " (not supported)" * bool(weak > 0)
        print_row(f"{one.archive}: `{one.name}`{mark}", map(percent, shares))
    print_row("**mean of those supported**", map(percent, np.nanmean(supported, axis=0)))


if __name__ == "__main__":
    warnings.simplefilter("ignore")
    run_tables({"people": people_table, "doubts": doubts_table}, command_line(__doc__))
