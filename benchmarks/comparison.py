"""Whether `compare_groups` keeps its level, and what it finds, on made gait with known differences.

    python benchmarks/comparison.py [N_STUDIES [N_JOBS]]
    python benchmarks/comparison.py level [N_STUDIES [N_JOBS [FOLDER]]]

Studies of `make_gait` with two strides a person, all four signals. In null studies nothing differs;
groups, pairs, or a covariate are drawn at random. Signals are scaled for the match and compared in
their units, by 399 permutations at 5 %. *Level* has null studies alone, 1000 by default: of 8 to 30
people, one to four signals, and templates of group A alone; and of people drawn from the forces of
a muscle in FOLDER, ../shared/data/nlreg1d, in groups at random. By 199 permutations.

Prints Markdown: per cent of the studies in which each answer is given. *Called* is what the
clusters say, if shape and timing together differ.
"""

import os
import sys

for _name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"):
    os.environ.setdefault(_name, "1")

import warnings
from pathlib import Path

import numpy as np
from joblib import Parallel, delayed
from sklearn.pipeline import make_pipeline
from sklearn.preprocessing import StandardScaler
from sklearn_motionsync import DenseSynchronizer, FrameWise, compare_groups
from sklearn_motionsync.datasets import make_gait

P, PERMUTATIONS, LEVEL = 101, 399, 0.05
PEOPLE = (10, 20)
# What differs, and what is compared.
STUDIES = {
    "nothing, two groups": ({}, "two"),
    "nothing, three groups": ({}, "three"),
    "nothing, paired": ({}, "paired"),
    "nothing, covariate": ({}, "covariate"),
    "nothing, covariate within people": ({}, "within"),
    "timing, 2 %": ({"timing": 2}, "two"),
    "timing, 3 %": ({"timing": 3}, "two"),
    "timing, 5 %": ({"timing": 5}, "two"),
    "shape, 8 degrees": ({"amplitude": 8}, "two"),
    "shape, 15 degrees": ({"amplitude": 15}, "two"),
    "both, 3 % and 15 degrees": ({"timing": 3, "amplitude": 15}, "two"),
}
ANSWERS = ("joint", "shape", "timing", "linear", "called shape", "called timing")


def compared(gait, kind, rng):
    """Arguments of `compare_groups`: what is compared."""
    persons = list(dict.fromkeys(gait.person))
    if kind == "two":
        return {"groups": gait.group}
    if kind == "three":
        of = dict(zip(persons, rng.permutation(np.arange(len(persons)) % 3).tolist(), strict=True))
        return {"groups": [of[person] for person in gait.person]}
    if kind == "paired":
        flips = dict(zip(persons, rng.integers(2, size=len(persons)).tolist(), strict=True))
        second = [k % 2 for k in range(len(gait.person))]
        pairs = zip(second, gait.person, strict=True)
        return {"groups": [k ^ flips[person] for k, person in pairs], "paired": True}
    if kind == "within":
        return {"covariate": rng.normal(size=len(gait.person))}
    of = dict(zip(persons, rng.normal(size=len(persons)).tolist(), strict=True))
    return {"covariate": [of[person] for person in gait.person]}


def study(seed, n_people, params, kind):
    """Whether each answer is given, of one study."""
    warnings.simplefilter("ignore")
    gait = make_gait(n_people, 2, random_state=seed, **params)
    pipe = make_pipeline(FrameWise(StandardScaler()), DenseSynchronizer(P)).fit(gait.data)
    given = compared(gait, kind, np.random.default_rng(seed))
    given |= {"people": gait.person, "n_permutations": PERMUTATIONS}
    found = compare_groups(pipe, gait.data, **given, random_state=seed)
    differs = found.to_frame()["differs"].tolist()
    called = set(found.clusters["what"]) if differs[0] else set()
    return [*differs, "shape" in called, "timing" in called]


def null_study(seed):
    """Answers of each design, for a set in which nothing differs."""
    warnings.simplefilter("ignore")
    rng = np.random.default_rng(seed)
    n_people, signals = rng.choice([8, 10, 14, 20, 30]), rng.permutation(4)[: rng.integers(1, 5)]
    gait = make_gait(n_people, 2, random_state=seed)
    data = [x[:, signals] for x in gait.data]
    pipe = make_pipeline(FrameWise(StandardScaler()), DenseSynchronizer(P)).fit(data)
    one = make_pipeline(FrameWise(StandardScaler()), DenseSynchronizer(P))
    one.fit([x for x, group in zip(data, gait.group, strict=True) if group == "A"])
    rows = []
    for kind in ("two", "three", "paired", "covariate", "within", "template of A"):
        given = compared(gait, "two" if kind == "template of A" else kind, rng)
        given |= {"people": gait.person, "n_permutations": 199, "random_state": seed}
        found = compare_groups(one if kind == "template of A" else pipe, data, **given)
        rows.append(found.to_frame()["differs"].tolist())
    return rows


def null_study_of_forces(seed, curves):
    """The same of real curves, one a person."""
    warnings.simplefilter("ignore")
    rng = np.random.default_rng(seed)
    n = rng.choice([8, 10, 14, 20, 30])
    X = list(curves[rng.permutation(len(curves))[:n], :, np.newaxis])
    sync, rows = DenseSynchronizer(P).fit(X), []
    three, age = (np.arange(n) % 3).tolist(), rng.normal(size=n)
    for given in ({"groups": ["A", "B"] * (n // 2)}, {"groups": three}, {"covariate": age}):
        found = compare_groups(sync, X, **given, n_permutations=199, random_state=seed)
        rows.append(found.to_frame()["differs"].tolist())
    return rows


def levels(n_studies, n_jobs, folder=None):
    """Print how often each answer is given where nothing differs."""
    kinds = ["two groups", "three groups", "paired", "covariate", "covariate within people"]
    kinds.append("two groups, template of A alone")
    found = Parallel(n_jobs)(delayed(null_study)(seed) for seed in range(n_studies))
    rows = dict(zip(kinds, 100 * np.mean(found, axis=0), strict=True))
    if folder is not None:
        table = np.loadtxt(Path(folder) / "Besier2009-vastus.csv", delimiter=",")
        work = (delayed(null_study_of_forces)(seed, table[:, 1:]) for seed in range(n_studies))
        shares = 100 * np.mean(Parallel(n_jobs)(work), axis=0)
        names = [f"forces, {kind}" for kind in ("two groups", "three groups", "covariate")]
        rows |= dict(zip(names, shares, strict=True))
    print(f"\n| nothing differs, {n_studies} studies | " + " | ".join(ANSWERS[:4]) + " |")
    print("|---" * 5 + "|")
    for name, shares in rows.items():
        print(f"| {name} | " + " | ".join(f"{x:.1f}" for x in shares) + " |", flush=True)


def main():
    if sys.argv[1:2] == ["level"]:
        given = [1000, 2, None]
        given[: len(sys.argv) - 2] = sys.argv[2:]
        levels(int(given[0]), int(given[1]), given[2])
        return
    n_studies = int(sys.argv[1]) if len(sys.argv) > 1 else 400
    n_jobs = int(sys.argv[2]) if len(sys.argv) > 2 else 2
    for n_people in PEOPLE:
        print(f"\n| {n_people} people, differs by | " + " | ".join(ANSWERS) + " |")
        print("|---" * (1 + len(ANSWERS)) + "|")
        for name, (params, kind) in STUDIES.items():
            n = n_studies if not params else n_studies // 2
            work = (delayed(study)(seed, n_people, params, kind) for seed in range(n))
            shares = 100 * np.mean(Parallel(n_jobs)(work), axis=0)
            print(f"| {name} | " + " | ".join(f"{x:.1f}" for x in shares) + " |", flush=True)


if __name__ == "__main__":
    main()
