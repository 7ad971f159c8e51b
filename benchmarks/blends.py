"""Blends of real people: limbs, feet, whether a blend of two is the action, and samples.

    python benchmarks/blends.py --data ../shared/data
    python benchmarks/blends.py --data ../shared/data --feet

For each action of the archives, whole or in halves of the people. (1) Pairs of different people at
equal weights: the share of limbs that are shorter than 0.9 where directions are averaged as
numbers, and as `blend_performances` does; how far lengths of limbs are from the average of both;
how far one performance is from itself with the weight 1. (2) Feet: how fast ankles go along the
floor, in legs a frame, while they stand in both performances, and how far the lower one is from its
average height. (3) A model of one half of the people: the share of the other half's performances it
accepts, of blends of two of them, of blends that are as much beyond one as 0.5, and of blends of
this action with another one. (4) Samples of postures, as numbers and on the sphere: the share of
short limbs, and the energy score about the people left out.

With ``--feet``, of 20 pairs of takes a set: how far feet that stand drift along the floor in a
stance, the largest distance from their median place in cm: mean, 90 % quantile and largest of all
stances, of the blends and then of the takes themselves. A stance lasts 0.1 s or more, in which a
landmark goes below 0.3 legs a second, and is within 0.1 legs of the 5 % quantile of its height: in
both takes at the matched frames, or, with the weights 1.5 and -0.5, in the first one. The ankle
moves while the heel rises, the toe while the foot comes down, so both are counted. Then heights: of
standing feet, off those of the takes with positive weights, root mean square, and the lowest one
below the floor, mean over blends. Then the largest second difference of a joint from frame to
frame, and the largest change of a knee in degrees a frame: means over blends.
"""

import argparse
from itertools import combinations, permutations
from pathlib import Path

import numpy as np
from sklearn.model_selection import GroupKFold
from sklearn.pipeline import make_pipeline
from sklearn_motionsync import (
    ActionModel,
    ASpace,
    CycleSegmenter,
    DenseSynchronizer,
    DirectionCosines,
    Match,
    blend_performances,
)
from sklearn_motionsync.datasets import load_performances

P, PAIRS, SHORT, STANDS = 60, 20, 0.9, 0.004
SPEED, LOW, LEAST = 0.3, 0.1, 0.1
ENDS = [("hip", "knee"), ("knee", "ankle"), ("shoulder", "elbow"), ("elbow", "wrist")]
LIMBS = [(f"{s}_{a}", f"{s}_{b}") for s in ("left", "right") for a, b in ENDS]
LIMBS += [("left_hip", "right_hip"), ("left_shoulder", "right_shoulder"), ("pelvis", "neck")]


def read(folder, archive):
    bunch = load_performances(folder / archive / f"{archive}_positions.npz")
    enough = [i for i, x in enumerate(bunch.data) if len(x) >= 8]
    X = [np.asarray(bunch.data[i], dtype=float) for i in enough]
    return X, bunch.target[enough], bunch.actor[enough], bunch.skeleton


def pairs_of(actors, seed=0):
    pairs = [(i, j) for i, j in combinations(range(len(actors)), 2) if actors[i] != actors[j]]
    chosen = np.random.default_rng(seed).permutation(len(pairs))[:PAIRS]
    return [pairs[k] for k in chosen]


def at(x, skeleton, name):
    return x.reshape(len(x), -1, 3)[:, skeleton.indices_of(name)].mean(axis=1)


def lengths(x, skeleton):
    pairs = [(at(x, skeleton, a), at(x, skeleton, b)) for a, b in LIMBS]
    return np.stack([np.linalg.norm(a - b, axis=1) for a, b in pairs], axis=1)


def speeds(x, skeleton, leg):
    ankles = np.stack([at(x, skeleton, f"{s}_ankle") for s in ("left", "right")], axis=1)
    return np.linalg.norm(np.gradient(ankles[..., [0, 2]], axis=0), axis=2) / leg


def lower(x, skeleton):
    return np.minimum(*(at(x, skeleton, f"{s}_ankle")[:, 1] for s in ("left", "right")))


def met(y, tracks, match, pair, weights=(0.5, 0.5)):
    """Tracks of two performances where they meet at the frames of their blend."""
    frames = match.frames([len(z) for z in pair])
    steps = np.diff(frames, axis=1)
    steps = np.maximum(weights @ steps, 0.5 * steps.min(axis=0))
    passed = np.concatenate([[0], np.cumsum(steps)])
    share = np.interp(np.linspace(0, passed[-1], len(y)), passed, np.arange(len(passed)))
    found = []
    for track, own in zip(tracks, frames, strict=True):
        f = np.interp(share, np.arange(len(own)), own)
        columns = track.reshape(len(track), -1).T
        found.append(np.stack([np.interp(f, np.arange(len(track)), c) for c in columns], axis=1))
    return found


def bodies(X, actors, skeleton):
    """Of one action: short limbs, errors, feet."""
    cosines = DirectionCosines(skeleton).fit(X)
    pipe = make_pipeline(cosines, ASpace(0.95), DenseSynchronizer(n_frames=P)).fit(X)
    match, postures = Match.from_estimator(pipe, X), cosines.transform(X)
    rows = []
    for i, j in pairs_of(actors):
        pair, own = [X[i], X[j]], Match(match.times[[i, j]])
        y = blend_performances(own, pair, [0.5, 0.5], skeleton=skeleton)
        linear = blend_performances(own, [postures[i], postures[j]], [0.5, 0.5])
        sphere = cosines.transform(y)
        norms = [np.linalg.norm(c[:, 1:].reshape(len(c), -1, 3), axis=2) for c in (linear, sphere)]
        limbs = met(y, [lengths(x, skeleton) for x in pair], own, pair)
        apart = np.abs(lengths(y, skeleton) - sum(limbs) / 2)[:, :8].max()
        legs = [np.median(lengths(x, skeleton)[:, :2], axis=0).sum() for x in pair]
        back = blend_performances(own, pair, [1, 0], skeleton=skeleton)
        again = np.abs(np.subtract(*cosines.transform([back, X[i]]))).max()
        goes = met(y, [speeds(x, skeleton, g) for x, g in zip(pair, legs, strict=True)], own, pair)
        slides = speeds(y, skeleton, np.mean(legs))
        stands = (goes[0] < STANDS) & (goes[1] < STANDS)
        feet = met(y, [lower(x, skeleton)[:, None] for x in pair], own, pair)
        rows.append([
            (norms[0] < SHORT).mean(), (norms[1] < SHORT).mean(), apart / np.mean(legs),
            np.abs(back - X[i]).max() / legs[0], again,
            np.mean((goes[0] + goes[1])[stands] / 2) if stands.any() else np.nan,
            slides[stands].mean() if stands.any() else np.nan,
            np.abs(lower(y, skeleton) - sum(feet)[:, 0] / 2).mean() / np.mean(legs),
        ])  # fmt: skip
    return rows


def accepted(X, target, actors, skeleton, action):
    """Shares accepted by a model of the other half of the people."""
    own = np.flatnonzero(target == action)
    found = {name: [] for name in ("people", "blends", "beyond", "two actions")}
    for train, test in GroupKFold(2).split(own, groups=actors[own]):
        train, test = own[train], own[test]
        pipe = make_pipeline(
            DirectionCosines(skeleton), ASpace(0.95), DenseSynchronizer(n_frames=P), ActionModel()
        ).fit([X[i] for i in train], actionmodel__groups=actors[train])
        pairs = [(test[a], test[b]) for a, b in pairs_of(actors[test])]
        rng = np.random.default_rng(0)
        wrong = np.flatnonzero((target != action) & np.isin(actors, actors[test]))
        found["people"] += pipe.predict([X[i] for i in test]).tolist()
        for name, weights, some in (
            ("blends", [0.5, 0.5], pairs),
            ("beyond", [1.5, -0.5], pairs),
            ("two actions", [0.5, 0.5], [(a, rng.choice(wrong)) for a, _ in pairs]),
        ):
            blends = [blend_performances(pipe, [X[a], X[b]], weights) for a, b in some]
            found[name] += pipe.predict(blends).tolist()
    return [np.mean(np.array(v) == 1) for v in found.values()]


def samples(X, actors, skeleton):
    """Short limbs, as numbers and on the sphere, and the ratio of their energy scores."""
    from samples import closeness

    rows = []
    postures = DirectionCosines(skeleton).fit_transform(X)
    for train, test in GroupKFold(4).split(X, groups=actors):
        points = make_pipeline(ASpace(0.95), DenseSynchronizer(n_frames=P))
        points.fit([postures[i] for i in train])
        known, new = (
            Match.from_estimator(points, some).warp(some)
            for some in ([postures[i] for i in part] for part in (train, test))
        )
        model = ActionModel().fit(known, groups=actors[train])
        rng = np.random.default_rng(0)
        weights = (
            0.6 * rng.normal(size=(150, len(model.deviations_))) / len(model.deviations_) ** 0.5
        )
        weights[np.arange(150), rng.integers(len(model.deviations_), size=150)] += 0.8
        linear = model.mean_ + np.tensordot(weights, model.deviations_, axes=1)
        drawn = model.sample(150, random_state=0)
        short = [
            (np.linalg.norm(y[..., 1:].reshape(150, P, -1, 3), axis=3) < SHORT).mean()
            for y in (linear, drawn)
        ]
        scores = [
            closeness(y.reshape(150, -1), new.reshape(len(new), -1))[0] for y in (linear, drawn)
        ]
        rows.append([*short, scores[1] / scores[0], (model.predict(drawn) == 1).mean()])
    return np.mean(rows, axis=0)


# -- feet that stand ------------------------------------------------------------------------


def walks(folder):
    """Sets of takes: a name, takes, their match, skeleton, frames a second, cm a unit, toes."""
    for name, action, rate, unit, toes in (
        ("cmu07_walk", "walk", 60, 1, ("CC_Base_L_ToeBase", "CC_Base_R_ToeBase")),
        ("hdm05", "sneak2StepsLStart", 120, 100, ("lfoot", "rfoot")),
        ("hdm05", "jogLeftCircle4StepsRstart", 120, 100, ("lfoot", "rfoot")),
        ("hdm05", "depositFloorR", 120, 100, ("lfoot", "rfoot")),
        ("hdm05", "grabHighR", 120, 100, ("lfoot", "rfoot")),
        ("hdm05", "hopBothLegs1hops", 120, 100, ("lfoot", "rfoot")),
        ("hdm05", "elbowToKnee1RepsLelbowStart", 120, 100, ("lfoot", "rfoot")),
        # Its frame rate is not known; about 10 frames a second differ.
        ("utkinect", "walk", 10, 100, ("FootLeft", "FootRight")),
    ):
        X, target, _, skeleton = read(folder, name)
        X = [x for x, label in zip(X, target, strict=True) if label == action]
        sets = [(f"{name} {action}", X)]
        if name == "cmu07_walk":
            cycles, table = CycleSegmenter(
                start="left strike", skeleton=skeleton, frame_rate=rate
            ).fit(X).segment(X)  # fmt: skip
            first = table.reset_index().groupby("take")["index"].first()
            sets.append(("cmu07_walk, a cycle of each", [np.asarray(cycles[i]) for i in first]))
        for title, takes in sets:
            steps = DirectionCosines(skeleton), ASpace(0.95), DenseSynchronizer(120)
            pipe = make_pipeline(*steps).fit(takes)
            yield title, takes, Match.from_estimator(pipe, takes), skeleton, rate, unit, toes


def stands(p, rate, leg):
    """Frames of a landmark (n_frames, 3) that stands."""
    speed = np.linalg.norm(np.gradient(p[:, [0, 2]], axis=0), axis=1) * rate
    return (speed < SPEED * leg) & (p[:, 1] < np.quantile(p[:, 1], 0.05) + LOW * leg)


def stretches(mask, least):
    edges = np.flatnonzero(np.diff(np.concatenate([[0], mask, [0]])))
    return [slice(*edge) for edge in edges.reshape(-1, 2) if np.diff(edge)[0] >= least]


def drift(p):
    return np.linalg.norm(p[:, [0, 2]] - np.median(p[:, [0, 2]], axis=0), axis=1).max()


def knees(x, skeleton):
    """Degrees of both knees, (n_frames, 2)."""
    angles = []
    for side in ("left", "right"):
        a, b, c = (at(x, skeleton, f"{side}_{name}") for name in ("hip", "knee", "ankle"))
        u, v = ((w.T / np.linalg.norm(w, axis=1)).T for w in (b - a, c - b))
        angles.append(np.degrees(np.arccos(np.clip((u * v).sum(axis=1), -1, 1))))
    return np.stack(angles, axis=1)


def feet(X, match, skeleton, rate, unit, toes, weights):
    """Drifts by landmark and kind of stance, heights, and jumps of a set of takes."""
    pairs = list(permutations(range(len(X)), 2))
    pairs = [pairs[k] for k in np.random.default_rng(0).permutation(len(pairs))[:PAIRS]]
    kinds = ("both", "first") if min(weights) < 0 else ("both",)
    drifts = {(part, kind): [] for part in ("ankle", "toe") for kind in kinds}
    off, lowest, jumps = [], [], []
    positive = np.maximum(weights, 0) / np.maximum(weights, 0).sum()
    least = max(3, round(LEAST * rate))
    for i, j in pairs:
        pair, own = [X[i], X[j]], Match(match.times[[i, j]])
        y = blend_performances(own, pair, weights, skeleton=skeleton)
        joints = y.reshape(len(y), -1, 3)
        second = np.linalg.norm(np.diff(joints, 2, axis=0), axis=2).max() * unit
        jumps.append([second, np.abs(np.diff(knees(y, skeleton), axis=0)).max()])
        legs = [np.median(lengths(x, skeleton)[:, :2], axis=0).sum() for x in pair]
        for k, side in enumerate(("left", "right")):
            for part in ("ankle", "toe"):
                name = f"{side}_ankle"
                place = [
                    at(x, skeleton, name) if part == "ankle"
                    else x.reshape(len(x), -1, 3)[:, skeleton.joints.index(toes[k])]
                    for x in [*pair, y]
                ]  # fmt: skip
                still = [
                    stands(p, rate, leg).astype(float)[:, np.newaxis]
                    for p, leg in zip(place, legs, strict=False)
                ]
                still = [m[:, 0] > 0.999 for m in met(y, still, own, pair, weights)]
                there = met(y, place[:2], own, pair, weights)
                for kind in kinds:
                    mask = still[0] & (still[1] | (kind == "first"))
                    for r in stretches(mask, least):
                        takes = [drift(p[r]) for p in (there if kind == "both" else there[:1])]
                        drifts[part, kind].append([drift(place[2][r]), np.mean(takes)])
                floors = [p[:, 1].min() for p in place[:2]]
                height = place[2][:, 1] - np.dot(weights, floors)
                should = positive @ [p[:, 1] - f for p, f in zip(there, floors, strict=True)]
                off += list((height - should)[still[0] & still[1]])
                lowest.append(min(height.min(), 0))
    off = np.sqrt(np.mean(np.square(off)))
    return drifts, off * unit, np.mean(lowest) * unit, np.mean(jumps, axis=0)


def show_feet(folder):
    for title, X, match, skeleton, rate, unit, toes in walks(folder):
        for weights in ([0.5, 0.5], [1.5, -0.5]):
            drifts, off, lowest, jumps = feet(X, match, skeleton, rate, unit, toes, weights)
            for (part, kind), rows in drifts.items():
                rows = np.array(rows) * unit
                values = [len(rows)]
                for own in rows.T:
                    values += [own.mean(), np.quantile(own, 0.9), own.max()]
                show(f"{title}, {weights}, {part}, {kind}", values)
            show(f"{title}, {weights}, heights and jumps", [off, lowest, *jumps])


def show(title, rows):
    print(f"| {title} |", " | ".join(f"{x:.3g}" for x in rows), "|", flush=True)


def main():
    parser = argparse.ArgumentParser(description=__doc__.split("\n", maxsplit=1)[0])
    parser.add_argument("--data", type=Path, required=True)
    parser.add_argument("--feet", action="store_true", help="only how far standing feet drift")
    args = parser.parse_args()
    folder = args.data
    if args.feet:
        show_feet(folder)
        return
    tables = {"bodies": {}, "accepted": {}, "samples": {}}
    for archive in ("hdm05", "utkinect"):
        X, target, actors, skeleton = read(folder, archive)
        for action in np.unique(target):
            own = np.flatnonzero(target == action)
            some, who = [X[i] for i in own], actors[own]
            rows = bodies(some, who, skeleton)
            mean = np.nanmean(rows, axis=0)
            # Of what is to be 0 the worst counts.
            mean[2:5] = np.max(rows, axis=0)[2:5]
            for name, row in (
                ("bodies", mean),
                ("accepted", accepted(X, target, actors, skeleton, action)),
                ("samples", samples(some, who, skeleton)),
            ):
                show(f"{archive} {action}, {name}", row)
                tables[name].setdefault(archive, []).append(row)
    for name, of in tables.items():
        for archive, rows in of.items():
            worst = np.nanmean(rows, axis=0)
            if name == "bodies":
                worst[2:5] = np.max(rows, axis=0)[2:5]
            show(f"{archive}, {name}", worst)


if __name__ == "__main__":
    main()
