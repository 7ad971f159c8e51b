"""How many patients `compare_to_norm` finds, and how many people of the norm it calls different.

    python benchmarks/norm.py DATA_FOLDER [made] [people] [children]

*Made*: 24 norms of `make_gait`, of 18 people with 53 strides, or 10 with 30. Twelve new people of
each kind, with one stride or three: normal; late, toe-off 3 or 5 % of the cycle later; weak, knee
flexion 15 or 20 degrees less in swing, or a force that is 15 % less. Per cent of them that differ,
at a level of 10 %; the largest and the mean number of rows of departures, of those that have some.

*People*: exercises of UI-PRMD. The norm are the right repetitions of nine people; new is the tenth,
by one, five or ten repetitions drawn at random: done right, done wrong, and the right ones made 5
and 10 % late. Those of people who use the other side are mirrored. Compared are the dimensions of
an aSpace of limb directions. Per cent that differ at a level of 10 %, by exercise.

*Children*: hip and knee of 39 children (Ramsay and Silverman, from fdatools), each left out once:
as they are, 5 % late, with 10 and 15 degrees less knee flexion in swing, and with 10 degrees more
hip flexion. Per cent that differ at a level of 10 %, and those whose first row is of timing. Prints
Markdown.
"""

import warnings

import numpy as np
from exercises import read_exercises
from forces import read_children
from harness import at_frames, command_line, print_head, print_row, run_tables
from joblib import Parallel, delayed
from sklearn.pipeline import make_pipeline
from sklearn.preprocessing import StandardScaler
from sklearn_motionsync import ASpace, DenseSynchronizer, FrameWise
from sklearn_motionsync.comparison import compare_to_norm
from sklearn_motionsync.datasets import make_gait

P, NEW, NORMS = 101, 12, 24
KINDS = {
    "normal": {},
    "late, 3 %": {"timing": 3},
    "late, 5 %": {"timing": 5},
    "weak, 15 degrees": {"amplitude": -15},
    "weak, 20 degrees": {"amplitude": -20},
    "weak, force": {},
}


def new_people(kind, n_cycles, seed):
    """Trials and subjects of one kind."""
    gait = make_gait(2 * NEW, n_cycles, random_state=seed, **KINDS[kind])
    own = np.flatnonzero(gait.group == "B")
    trials = [gait.data[i].copy() for i in own]
    if kind == "weak, force":
        for x in trials:
            x[:, 3] *= 0.85
    return trials, [f"{kind} {gait.person[i]}" for i in own]


def study(seed, n_people, n_strides, n_cycles):
    """The figures of each kind, for one norm."""
    warnings.simplefilter("ignore")
    gait = make_gait(n_people, 3, random_state=seed)
    data, people = gait.data[:n_strides], list(gait.person[:n_strides])
    pipe = make_pipeline(FrameWise(StandardScaler()), DenseSynchronizer(P)).fit(data)
    rows = []
    for k, kind in enumerate(KINDS):
        trials, subjects = new_people(kind, n_cycles, 1000 + len(KINDS) * seed + k)
        groups = ["norm"] * len(data) + ["new"] * len(trials)
        given = {"norm": "norm", "groups": people + subjects, "level": 0.1}
        found = compare_to_norm(pipe, data + trials, groups, **given)
        counts = found.departures.groupby("subject").size()
        rows.append([100 * found.verdicts["differs"].mean(), counts.max(), counts.mean()])
    return rows


def made_late(x, largest):
    """A trial whose middle is later by a share of its time."""
    t = np.linspace(0, 1, len(x))
    return at_frames(x, (len(x) - 1) * (t - largest * np.sin(np.pi * t) ** 2))


def people(folder):
    kinds = ("right", "5 % late", "10 % late", "wrong")
    counts, rng = (1, 5, 10), np.random.default_rng(0)
    rows = {}
    for name, trials, actors, right, _ in read_exercises(folder):
        rows[name] = np.zeros((len(counts), len(kinds)))
        for actor in np.unique(actors):
            norm = np.flatnonzero((actors != actor) & right)
            whose = actors == actor
            good, bad = (rng.permutation(np.flatnonzero(whose & (right == k))) for k in (1, 0))
            pipe = make_pipeline(ASpace(0.95), DenseSynchronizer(P)).fit([trials[i] for i in norm])
            for k, count in enumerate(counts):
                own = [trials[i] for i in good[:count]]
                late = [[made_late(x, share) for x in own] for share in (0.05, 0.1)]
                new = [own, *late, [trials[i] for i in bad[:count]]]
                X = [trials[i] for i in norm] + [x for some in new for x in some]
                kind = [name for name, some in zip(kinds, new, strict=True) for _ in some]
                given = {"norm": "norm", "groups": actors[norm].tolist() + kind, "level": 0.1}
                found = compare_to_norm(pipe, X, ["norm"] * len(norm) + kind, **given)
                rows[name][k] += found.verdicts["differs"].reindex(kinds).to_numpy(dtype=float)
        rows[name] *= 100 / len(np.unique(actors))
    rows["all"] = np.mean(list(rows.values()), axis=0)
    for k, count in enumerate(counts):
        print_head(f"{count} repetition(s)", kinds)
        for name, shares in rows.items():
            print_row(name, [f"{x:.0f}" for x in shares[k]])


def made(folder):
    for n_people, n_strides, n_cycles in ((18, 53, 1), (18, 53, 3), (10, 30, 3)):
        work = (delayed(study)(s, n_people, n_strides, n_cycles) for s in range(NORMS))
        figures = np.array(Parallel(2)(work), dtype=float)
        columns = ["differ, %", "most rows", "mean rows"]
        print_head(f"norm of {n_people}, {n_cycles} stride(s)", columns)
        for k, kind in enumerate(KINDS):
            differ, _, mean = np.nanmean(figures[:, k], axis=0)
            most = np.nanmax(figures[:, k, 1])
            print_row(kind, [f"{x:.1f}" for x in (differ, most, mean)])


def child(angles, i):
    """Whether each kind differs, and whether its first row is of timing: (n_kinds, 2)."""
    warnings.simplefilter("ignore")
    x, norm = angles[i], list(np.delete(angles, i, axis=0))
    swing = np.exp(-0.5 * ((np.linspace(0, 1, P) - 0.72) / 0.12) ** 2)[:, np.newaxis]
    new = [x, made_late(x, 0.05), x - [0, 10] * swing, x - [0, 15] * swing, x + [10, 0]]
    pipe = make_pipeline(FrameWise(StandardScaler()), DenseSynchronizer(P)).fit(norm)
    y = ["norm"] * len(norm) + ["new"] * len(new)
    found = compare_to_norm(pipe, norm + new, y, norm="norm", level=0.1)
    first = found.departures.groupby("subject")["what"].first().reindex(found.verdicts.index)
    return np.column_stack([found.verdicts["differs"], first == "timing"])


def children(folder):
    angles = read_children()
    shares = np.mean(Parallel(2)(delayed(child)(angles, i) for i in range(len(angles))), axis=0)
    kinds = "as they are", "5 % late", "knee - 10 degrees", "knee - 15 degrees", "hip + 10 degrees"
    print_head("39 children", ["differ, %", "timing first, %"])
    for kind, row in zip(kinds, shares, strict=True):
        print_row(kind, [f"{100 * x:.0f}" for x in row])


if __name__ == "__main__":
    warnings.simplefilter("ignore")
    tables = {"made": made, "people": people, "children": children}
    run_tables(tables, command_line(__doc__))
