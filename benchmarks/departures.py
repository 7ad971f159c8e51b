"""What `find_departures` says of faults that were put into trials of people held out.

    python benchmarks/departures.py DATA_FOLDER [hdm05] [uiprmd] [whole] [whole_unseen]

DATA_FOLDER holds hdm05/hdm05_positions.npz and uiprmd/uiprmd_odd_positions.npz. Every subject of
each class is held out in turn; everything is learnt from right trials of the others. Three trials
of the subject are the reference, the next ones are tested: as they are, and, four at most, with a
fault. A limb is turned about its upper joint, with all below it. Eight kinds: one limb 20, 30 or 40
degrees off in 40 % of the time, a forearm or shank 30, the trunk 20; a limb late by 12 % of the
time, or with 0.5 or 1.6 times its amplitude. What is judged is the most important row, whatever its
evidence; overlap is that of the time, of faults with the right region. Choices were made on HDM05
and these two exercises of UI-PRMD. The tables of whole bodies have trials that pause, start late,
stop early or move too little as a whole, also of two exercises that nothing was chosen on. Prints
Markdown, in per cent.
"""

from pathlib import Path
from typing import NamedTuple

import numpy as np
import pandas as pd
from exercises import read_positions
from harness import at_frames, command_line, percent, print_head, print_row, run_tables
from scipy.spatial.transform import Rotation
from sklearn.pipeline import make_pipeline
from sklearn_motionsync import (
    ActionModel,
    ASpace,
    DenseSynchronizer,
    DirectionCosines,
    LinearSynchronizer,
    Match,
    Skeleton,
)
from sklearn_motionsync.datasets import load_trials
from sklearn_motionsync.model import find_departures

P = 60
BODY = Skeleton.paper()
CHOSEN, UNSEEN = ("inline lunge", "shoulder rotation"), ("deep squat", "sit to stand")
# Most trials of a subject that get faults.
SPOILT = 4
# Upper and lower joint, what is below the lower one, and the part of the body.
LIMBS = {"torso": ("pelvis", "neck", ["head"], "trunk")}
for _side in ("left", "right"):
    LIMBS[f"{_side}_arm"] = (
        f"{_side}_shoulder",
        f"{_side}_elbow",
        [f"{_side}_wrist"],
        f"{_side} arm",
    )
    LIMBS[f"{_side}_forearm"] = (f"{_side}_elbow", f"{_side}_wrist", [], f"{_side} arm")
    LIMBS[f"{_side}_thigh"] = (f"{_side}_hip", f"{_side}_knee", [f"{_side}_ankle"], f"{_side} leg")
    LIMBS[f"{_side}_leg"] = (f"{_side}_knee", f"{_side}_ankle", [], f"{_side} leg")
    LIMBS["torso"][2].extend(f"{_side}_{joint}" for joint in ("shoulder", "elbow", "wrist"))
MOVABLE = [limb for limb in LIMBS if limb != "torso"]
DISTAL = [limb for limb in MOVABLE if limb.endswith(("forearm", "leg"))]
# Degrees that a limb deviates from its mean direction, root mean square, to be late or small.
MOVES = 20
KINDS = {
    "20 degrees": ("angle", MOVABLE, 20),
    "30 degrees": ("angle", MOVABLE, 30),
    "40 degrees": ("angle", MOVABLE, 40),
    "forearm, shank 30": ("angle", DISTAL, 30),
    "trunk 20": ("angle", ["torso"], 20),
    "late 12 %": ("late", MOVABLE, 0.12),
    "amplitude x 0.5": ("too small", MOVABLE, 0.5),
    "amplitude x 1.6": ("too large", MOVABLE, 1.6),
}


class Fault(NamedTuple):
    """A trial with a fault: which, where, and when, as shares of the time."""

    trial: np.ndarray
    kind: str
    limb: str
    start: float
    stop: float


def put_fault(x, name, rng):
    """A trial (n_frames, 45) of `BODY` with a fault of a kind, or None if no limb moves enough."""
    kind, limbs, size = KINDS[name]
    x = x.reshape(len(x), -1, 3)
    if kind != "angle":
        limbs = [limb for limb in limbs if _spread(_directions(x, limb)) >= MOVES]
        if not limbs:
            return None
    limb = limbs[rng.integers(len(limbs))]
    t, d = np.linspace(0, 1, len(x)), _directions(x, limb)
    start, stop = 0.0, 1.0
    if kind == "angle":
        start = rng.uniform(0.05, 0.55)
        stop = start + 0.4
        # Half of the angle at both ends.
        weight = _ramp((t - start) / 0.08 + 0.5) * _ramp((stop - t) / 0.08 + 0.5)
        middle = d[(t > start) & (t < stop)].mean(axis=0)
        axis = np.cross(middle, rng.standard_normal(3))
        turns = np.radians(size) * weight[:, np.newaxis] * axis / np.linalg.norm(axis)
    elif kind == "late":
        return Fault(_late(x, limb, size).reshape(len(x), -1), kind, limb, start, stop)
    else:
        mean = d.mean(axis=0) / np.linalg.norm(d.mean(axis=0))
        axis = np.cross(mean, d)
        sine, cosine = np.linalg.norm(axis, axis=1), d @ mean
        axis /= np.maximum(sine, 1e-9)[:, np.newaxis]
        turns = (size - 1) * np.arctan2(sine, cosine)[:, np.newaxis] * axis
    moved, upper, below = x.copy(), *_joints(limb)
    turn = Rotation.from_rotvec(turns)
    for joint in below:
        moved[:, joint] = x[:, upper] + turn.apply(x[:, joint] - x[:, upper])
    return Fault(moved.reshape(len(x), -1), kind, limb, start, stop)


def _late(x, limb, share):
    """All below the upper joint of a limb as it was before a share of the time."""
    moved, upper, below = x.copy(), *_joints(limb)
    before = np.clip(np.arange(len(x)) - share * (len(x) - 1), 0, None)
    for joint in below:
        moved[:, joint] = x[:, upper] + at_frames(x[:, joint] - x[:, upper], before)
    return moved


def _ramp(share):
    share = np.clip(share, 0, 1)
    return share**2 * (3 - 2 * share)


def _joints(limb):
    upper, lower, below, _ = LIMBS[limb]
    return BODY.joints.index(upper), [BODY.joints.index(name) for name in (lower, *below)]


def _directions(x, limb):
    upper, below = _joints(limb)
    d = x[:, below[0]] - x[:, upper]
    return d / np.linalg.norm(d, axis=1, keepdims=True)


def _spread(directions):
    mean = directions.mean(axis=0)
    cosines = np.clip(directions @ mean / np.linalg.norm(mean), -1, 1)
    return np.degrees(np.sqrt(np.square(np.arccos(cosines)).mean()))


# -- trials -----------------------------------------------------------------------------


class Trials(NamedTuple):
    """Right trials of a class on `BODY`, and their subjects and takes."""

    name: str
    data: list
    actors: np.ndarray
    takes: np.ndarray


def classes_of_hdm05(folder):
    bunch = load_trials(Path(folder) / "hdm05" / "hdm05_positions.npz")
    data = as_bodies(bunch.data, bunch.skeleton)
    for name in np.unique(bunch.target):
        rows = np.flatnonzero(bunch.target == name)
        # No odd and even takes: all of the others are learnt from.
        yield Trials(
            name, [data[i] for i in rows], bunch.actor[rows], np.ones(len(rows), dtype=int)
        )


def exercises_of_uiprmd(folder, wanted):
    markers, table, skeleton = read_positions(folder)
    for name in wanted:
        rows = table[(table["label"] == name) & table["correct"]]
        data = as_bodies([markers[i] for i in rows.index], skeleton)
        yield Trials(name, data, rows["actor"].to_numpy(), rows["take"].to_numpy())


def as_bodies(data, skeleton):
    """Trials as joint positions of `BODY`: cosines, and limbs of the mean body."""
    cosines = DirectionCosines(skeleton)
    return [np.asarray(x) for x in cosines.inverse_transform(cosines.fit_transform(data))]


class Fold(NamedTuple):
    """Right trials of others and their subjects; the reference, the tested ones, their faults."""

    training: list
    groups: np.ndarray
    reference: list
    tested: list
    faults: list


def folds(trials):
    """A fold of each subject with more trials than the three of the reference."""
    for number, actor in enumerate(np.unique(trials.actors)):
        own = np.flatnonzero(trials.actors == actor)
        if len(own) <= 3:
            continue
        others = np.flatnonzero((trials.actors != actor) & (trials.takes % 2 == 1))
        reference, tested = own[:3], own[3:]
        rng = np.random.default_rng([0, number])
        some = lambda rows: [trials.data[i] for i in rows]  # noqa: E731
        faults = [put_fault(x, name, rng) for x in some(tested[:SPOILT]) for name in KINDS]
        faults = [fault for fault in faults if fault is not None]
        yield Fold(some(others), trials.actors[others], some(reference), some(tested), faults)


# -- what is said of them ---------------------------------------------------------------


class Said(NamedTuple):
    """Of a trial with a fault, or without one (``kind`` is then None)."""

    kind: str | None
    region: bool = False
    limb: bool = False
    overlap: float = np.nan
    told: str = ""
    rare: bool = False


def departures_of(fold, pipe, reference, limit=0.1):
    """What `find_departures` says first, whatever the evidence."""
    trials = [fault.trial for fault in fold.faults]
    given = {"reference": reference} if reference else {}
    tables = [find_departures(pipe, X, limit=limit, **given) for X in (trials, fold.tested)]
    firsts = tables[0].groupby("trial").head(1).set_index("trial")
    rare = [set(table.loc[table["rare"], "trial"]) for table in tables]
    times = Match.from_estimator(pipe, trials).times / (P - 1)
    said = [Said(None, rare=i in rare[1]) for i in range(len(fold.tested))]
    for i, fault in enumerate(fold.faults):
        if i not in firsts.index:
            said.append(Said(fault.kind, rare=i in rare[0]))
            continue
        row = firsts.loc[i]
        found = row["limb"], times[i][row["first"]], times[i][row["last"]]
        said.append(judged(fault, *found, row["kind"], i in rare[0]))
    return said


def plain_scores(fold):
    """The baseline: the largest z of cosines after linear normalisation, and its run beyond 3."""
    cosines, linear = DirectionCosines(BODY).fit(fold.training), LinearSynchronizer(P)
    synchronised = linear.fit(cosines.transform(fold.training)).transform
    model = ActionModel().fit(synchronised(cosines.transform(fold.training)), groups=fold.groups)
    names = cosines.get_feature_names_out()[1:]
    curves = synchronised(cosines.transform([fault.trial for fault in fold.faults]))
    said = []
    scores = (curves - model.mean_) / np.sqrt(model.predictive_variance_)
    for fault, z in zip(fold.faults, scores, strict=True):
        z = np.abs(z[:, 1:])
        peak, feature = np.unravel_index(z.argmax(), z.shape)
        within = z[:, feature] > 3
        first = peak - np.argmin(np.append(within[:peak][::-1], False))
        last = peak + np.argmin(np.append(within[peak + 1 :], False))
        limb = names[feature].rpartition("_")[0]
        said.append(judged(fault, limb, first / (P - 1), last / (P - 1), "angle", False))
    return said


def judged(fault, limb, start, stop, told, is_rare):
    """What is said of a trial, beside the truth."""
    regions = {limb: region for limb, (*_, region) in LIMBS.items()}
    regions |= dict.fromkeys(("hip", "shoulder", "neck", "pelvis_height"), "trunk")
    regions["whole body"] = "whole body"
    is_region = regions[limb] == regions[fault.limb]
    overlap = np.nan
    if fault.kind == "angle" and is_region:
        both = max(0, min(stop, fault.stop) - max(start, fault.start))
        overlap = both / (max(stop, fault.stop) - min(start, fault.start))
    is_limb = limb == fault.limb
    return Said(fault.kind, is_region, is_limb, overlap, told, is_rare)


def measure(classes):
    """Everything that is said of all folds: {way: list of Said}."""
    found = {}
    for trials in classes:
        for fold in folds(trials):
            found.setdefault("plain z, linear", []).extend(plain_scores(fold))
            for aspace in (None, 0.95):
                steps = [] if aspace is None else [ASpace(aspace)]
                pipe = make_pipeline(
                    DirectionCosines(BODY), *steps, DenseSynchronizer(P), ActionModel()
                ).fit(fold.training, actionmodel__groups=fold.groups)
                for n in (0, 1, 3) if aspace is None else (0, 3):
                    way = f"{'no aSpace' if aspace is None else 'ASpace(0.95)'}, reference of {n}"
                    said = departures_of(fold, pipe, fold.reference[3 - n :])
                    found.setdefault(way, []).extend(said)
    return found


def fault_table(title, classes):
    columns = ["region", "limb", "overlap", "late told", "rare found", "rare, untouched"]
    print_head(title, columns)
    found = {way: pd.DataFrame(said) for way, said in measure(classes).items()}
    for way, table in found.items():
        faults, right = table[table["kind"].notna()], table[table["kind"].isna()]
        late = faults["told"][faults["kind"] == "late"] == "late"
        cells = [percent(faults["region"].mean()), percent(faults["limb"].mean())]
        cells += [f"{faults['overlap'].mean():.2f}", percent(late.mean())]
        print_row(way, [*cells, percent(faults["rare"].mean()), percent(right["rare"].mean(), 1)])


# -- whole bodies -----------------------------------------------------------------------


def spoil_whole(x, kind):
    """A trial that is held for a fifth of its time, or is half as large."""
    if kind == "too small":
        return x.mean(axis=0) + 0.5 * (x - x.mean(axis=0))
    frame = {"starts late": 0, "pauses": len(x) // 2, "stops early": len(x) - 1}[kind]
    held = np.repeat(x[frame : frame + 1], len(x) // 4, axis=0)
    return np.concatenate([x[:frame], held, x[frame:]])


def whole_table(title, classes):
    """How often a row of the whole body has the kind that was put in; and any, of right trials."""
    kinds, told = ("starts late", "pauses", "stops early", "too small"), []
    for trials in classes:
        for fold in folds(trials):
            pipe = make_pipeline(DirectionCosines(BODY), DenseSynchronizer(P), ActionModel())
            pipe.fit(fold.training, actionmodel__groups=fold.groups)
            for kind in kinds:
                table = find_departures(pipe, [spoil_whole(x, kind) for x in fold.tested[:6]])
                is_so = table["trial"][(table["kind"] == kind) & (table["limb"] == "whole body")]
                told += [{kind: i in set(is_so)} for i in range(len(fold.tested[:6]))]
            table = find_departures(pipe, fold.tested)
            of_whole, rare = table["limb"] == "whole body", table["rare"]
            for name, rows in (("any, untouched", of_whole), ("rare, untouched", of_whole & rare)):
                wrong = set(table["trial"][rows])
                told += [{name: i in wrong} for i in range(len(fold.tested))]
    shares = pd.DataFrame(told).mean()
    print_head(title, list(shares.index))
    print_row("told", [percent(share, 1) for share in shares])


TABLES = {
    "hdm05": lambda folder: fault_table("HDM05", classes_of_hdm05(folder)),
    "uiprmd": lambda folder: fault_table(" and ".join(CHOSEN), exercises_of_uiprmd(folder, CHOSEN)),
    "whole": lambda folder: whole_table(
        "HDM05 and " + " and ".join(CHOSEN),
        [*classes_of_hdm05(folder), *exercises_of_uiprmd(folder, CHOSEN)],
    ),
    "whole_unseen": lambda folder: whole_table(
        " and ".join(UNSEEN), exercises_of_uiprmd(folder, UNSEEN)
    ),
}

if __name__ == "__main__":
    run_tables(TABLES, command_line(__doc__))
