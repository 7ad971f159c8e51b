"""Exercises done right and wrong: learnt from right trials of other people, one person left out.

    python benchmarks/exercises.py DATA_FOLDER [right-or-wrong] [patients] [sides]

DATA_FOLDER holds uiprmd/uiprmd_odd_positions.npz: five exercises of ten people. Everything is
learnt from the right trials with odd numbers of nine people and judges all trials of the tenth but
the first three right ones, which are the reference where there is one. The baseline is the mean
squared z of cosines after linear normalisation. All five exercises were looked at while the weights
of the tests were chosen. *Patients*: four exercises of IntelliRehabDS (irds/), a fifth of people
left out, learnt from 40 right trials of healthy people and patients. *Sides*: trials of HDM05 and
UTKinect, of people left out, mirrored, with the arms exchanged, and backwards. Prints Markdown.
"""

import warnings
from pathlib import Path

import numpy as np
import pandas as pd
from harness import command_line, percent, print_head, print_row, run_tables
from sklearn.metrics import roc_auc_score
from sklearn.pipeline import make_pipeline
from sklearn_motionsync import (
    ActionDetector,
    ActionModel,
    ASpace,
    DenseSynchronizer,
    DirectionCosines,
    LinearSynchronizer,
    Skeleton,
)
from sklearn_motionsync.body import mirror
from sklearn_motionsync.body.limbs import PARTS
from sklearn_motionsync.body.mirror import exchange_of_sides
from sklearn_motionsync.datasets import load_trials

from model import BACKWARDS, SPOILT, as_clips

P, N_OWN = 60, 3
LANDMARKS = {
    "pelvis": ("LASI", "RASI", "LPSI", "RPSI"),
    "neck": ("C7", "CLAV"),
    "head": ("LFHD", "RFHD", "LBHD", "RBHD"),
    **{f"{side}_{joint}": tuple(letter + name for name in names)
       for side, letter in (("left", "L"), ("right", "R"))
       for joint, names in {
           "shoulder": ("SHO",), "elbow": ("ELB",), "wrist": ("WRA", "WRB"),
           "hip": ("ASI", "PSI"), "knee": ("KNE",), "ankle": ("ANK",),
       }.items()},
}  # fmt: skip


# People who use the other side.
OTHER_SIDE = {
    "inline lunge": ("s02", "s07", "s10"),
    "shoulder abduction": ("s07", "s10"),
    "shoulder rotation": ("s07", "s10"),
}


def read_positions(folder):
    """Markers, the table of trials, and the skeleton; those of the other side are mirrored."""
    path = Path(folder) / "uiprmd" / "uiprmd_odd_positions.npz"
    bunch = load_trials(path)
    skeleton = Skeleton(bunch.joints, bunch.skeleton.parents, LANDMARKS, up="z")
    with np.load(path) as file:
        table = pd.DataFrame({k: file[k] for k in ("label", "actor", "correct", "take")})
    trials = [x.astype(float) for x in bunch.data]
    return turned(trials, table, OTHER_SIDE, skeleton), table, skeleton


def turned(trials, table, other_side, skeleton):
    """Trials, of which those of people who use the other side are mirrored."""
    pairs = zip(table["label"], table["actor"], strict=True)
    is_other = [actor in other_side.get(name, ()) for name, actor in pairs]
    images = iter(mirror([x for x, k in zip(trials, is_other, strict=True) if k], skeleton))
    return [next(images) if k else x for x, k in zip(trials, is_other, strict=True)]


def read_exercises(folder):
    """Name, poses, people, whether it is right, and number of the trial, of each exercise."""
    trials, table, skeleton = read_positions(folder)
    trials = DirectionCosines(skeleton).fit_transform(trials)
    for name, rows in table.groupby("label"):
        columns = [rows[column].to_numpy() for column in ("actor", "correct", "take")]
        yield name, [trials[i] for i in rows.index], *columns


# -- right or wrong ---------------------------------------------------------------------


def pipeline():
    return make_pipeline(ASpace(0.95), DenseSynchronizer(P), ActionModel())


def by_model(known, groups, own, tested):
    return -pipeline().fit(known, actionmodel__groups=groups).decision_function(tested)


def by_detector(known, groups, own, tested):
    detector = ActionDetector(pipeline()).fit(known, groups=groups)
    return -detector.decision_function(tested, reference=own or None)


def by_z(known, groups, own, tested):
    """Mean squared z, of the variance within and between people or within and of own ones."""
    linear = LinearSynchronizer(P).fit(known)
    known, tested = (np.stack(linear.transform(x)) for x in (known, tested))
    people = [known[groups == g] for g in np.unique(groups)]
    variance = np.mean([p.var(axis=0, ddof=1) for p in people], axis=0)
    if own:
        own = np.stack(linear.transform(own))
        centre, variance = own.mean(axis=0), variance * (1 + 1 / len(own))
    else:
        centre = known.mean(axis=0)
        variance = variance + np.var([p.mean(axis=0) for p in people], axis=0, ddof=1)
    return (np.square(tested - centre) / (variance + 0.05 * variance.mean(axis=0))).mean((1, 2))


def judge(way, trials, people, right, takes, n_own):
    """Area under the curve over all people, right ones accepted, wrong ones found."""
    wrong, scores = [], []
    for person in np.unique(people):
        known = np.flatnonzero((people != person) & right & (takes % 2 == 1))
        own = np.flatnonzero((people == person) & right)[:N_OWN]
        tested = np.setdiff1d(np.flatnonzero(people == person), own)
        chosen = [[trials[i] for i in rows] for rows in (known, own[:n_own], tested)]
        scores.append(way(chosen[0], people[known], *chosen[1:]))
        wrong.append(~right[tested])
    wrong, scores = np.concatenate(wrong), np.concatenate(scores)
    accepted, found = (scores[~wrong] <= 0).mean(), (scores[wrong] > 0).mean()
    return roc_auc_score(wrong, scores), 100 * accepted, 100 * found


def right_or_wrong(folder):
    exercises = list(read_exercises(folder))
    header = [*(name for name, *_ in exercises), "mean", "accepted", "found"]
    print_head("area under the curve, pooled over people", header)
    ways = {"`ActionModel`": by_model, "`ActionDetector`": by_detector, "z, linear": by_z}
    for n_own in (0, 1, 2, 3):
        for name, way in ways.items():
            if way is by_model and n_own:
                continue
            found = np.array([judge(way, *rest, n_own) for _, *rest in exercises])
            mean = found.mean(axis=0)
            cells = [f"{x:.3f}" for x in (*found[:, 0], mean[0])]
            # No border comes with z.
            cells += [f"{x:.0f}" if way is not by_z else "-" for x in mean[1:]]
            print_row(f"{name}, {n_own} of the person" if n_own else name, cells)


# -- healthy people and patients ----------------------------------------------------------

# The right trials of this patient are those of the other arm.
OTHER_ARM = {"shoulder abduction left": ("202",)}
N_LEARNT, N_TESTED, N_FOLDS = 40, 120, 5


def read_rehabilitation(folder):
    """Joints of IntelliRehabDS, the table of trials, and the skeleton; turned as above."""
    path = Path(folder) / "irds" / "irds_left_positions.npz"
    with np.load(path) as file:
        table = pd.DataFrame({k: file[k] for k in ("label", "actor", "correct", "patient")})
    # Joints that were lost are zeros.
    trials = [np.where(x == 0, np.nan, x) for x in load_trials(path).data]
    skeleton = Skeleton.kinect_v2()
    return turned(trials, table, OTHER_ARM, skeleton), table, skeleton


def patients(folder):
    """Of every exercise: the area under the curve, right ones accepted, wrong ones found."""
    trials, table, skeleton = read_rehabilitation(folder)
    trials = DirectionCosines(skeleton, hidden="nan").fit_transform(trials)
    print_head("IntelliRehabDS", ["area", "healthy accepted", "patients accepted", "found"])
    judged = []
    for name, rows in table.groupby("label"):
        random_state, right = np.random.default_rng(0), rows["correct"].to_numpy(bool)
        for fold in np.array_split(random_state.permutation(rows["actor"].unique()), N_FOLDS):
            held = rows["actor"].isin(fold).to_numpy()
            known, tested = rows.index[~held & right], rows.index[held]
            known = np.sort(random_state.choice(known, min(N_LEARNT, len(known)), replace=False))
            tested = np.sort(random_state.choice(tested, min(N_TESTED, len(tested)), replace=False))
            scores = by_detector(
                [trials[i] for i in known], table["actor"][known], [], [trials[i] for i in tested]
            )
            judged.append(table.loc[tested].assign(score=scores))
        print_row(name, rates(pd.concat(judged[-N_FOLDS:])))
    print_row("all", rates(pd.concat(judged)))


def rates(judged):
    """Cells of a row: the area under the curve, and shares in per cent."""
    right, patient = (judged[k].astype(bool) for k in ("correct", "patient"))
    accepted = judged["score"] <= 0
    shares = accepted[right & ~patient], accepted[right & patient], ~accepted[~right]
    area = roc_auc_score(~right, judged["score"])
    return [f"{area:.3f}", *(f"{100 * share.mean():.0f}" for share in shares)]


# -- the wrong side, and the way back -----------------------------------------------------


def exchange(columns, signs):
    return lambda x: signs * x[:, columns]


def wrong_sides(clips, names):
    """Of every action: right ones accepted, their images refused."""
    arms = PARTS["left arm"] + PARTS["right arm"]
    images = {
        "mirrored": exchange(*exchange_of_sides(names)),
        "arms exchanged": exchange(*exchange_of_sides(names, arms)),
        BACKWARDS: SPOILT[BACKWARDS],
    }
    print_head(f"{clips.name}: accepted / refused", ["right", *images])
    for action in dict.fromkeys(clips.actions):
        shares = {}
        for actor in dict.fromkeys(clips.actors[clips.actions == action]):
            is_it, is_held = clips.actions == action, clips.actors == actor
            detector = ActionDetector(pipeline())
            detector.fit(clips.some(is_it & ~is_held), groups=clips.actors[is_it & ~is_held])
            own = clips.some(is_it & is_held)
            tried = {"right": own, **{k: [image(x) for x in own] for k, image in images.items()}}
            for name, some in tried.items():
                accepted = detector.predict(some) == 1
                shares.setdefault(name, []).extend(accepted if name == "right" else ~accepted)
        print_row(f"`{action}`", [percent(np.mean(of_kind)) for of_kind in shares.values()])


def sides(folder):
    for archive, name in (("hdm05", "HDM05"), ("utkinect", "UTKinect")):
        bunch = load_trials(folder / archive / f"{archive}_positions.npz")
        names = DirectionCosines(bunch.skeleton).fit(bunch.data).get_feature_names_out()
        wrong_sides(as_clips(name, bunch), names)


if __name__ == "__main__":
    warnings.simplefilter("ignore")
    tables = {"right-or-wrong": right_or_wrong, "patients": patients, "sides": sides}
    run_tables(tables, command_line(__doc__))
