"""`write_motion`: files that are read, written and read again, and bodies that are put on a rig.

(1) Of the BVH files given: how many rigs they have (names and channels of joints), and by how much
positions differ that were read, written and read again, in legs; of bodies without guessed legs, in
0.45 of their extent. Up to 1500 frames a file. (2) Of optical archives: recorded bodies, and those
that were synchronised, blended and sampled, are written as BVH and read again. How much lengths of
bones vary, and how far joints are from where they were, in legs: largest, and root mean square.

    python benchmarks/writers.py --data ../shared/data ../shared/data/original_files/bvh/*.bvh
"""

import argparse
import tempfile
from collections import defaultdict
from pathlib import Path

import numpy as np
from blends import at, read
from sklearn.pipeline import make_pipeline
from sklearn_motionsync import (
    ActionModel,
    ASpace,
    DenseSynchronizer,
    DirectionCosines,
    Match,
    Skeleton,
    blend_performances,
)
from sklearn_motionsync.io import read_motion, write_motion

FRAMES, BODIES = 1500, 8
SETS = [
    ("cmu07_walk", "walk"),
    ("hdm05", "depositFloorR"),
    ("hdm05", "grabHighR"),
    ("hdm05", "hopBothLegs1hops"),
]


def leg_of(x, skeleton):
    a, b, c = (at(x, skeleton, f"left_{name}") for name in ("hip", "knee", "ankle"))
    return np.median(np.linalg.norm(a - b, axis=1) + np.linalg.norm(b - c, axis=1))


def again(path, folder):
    """The rig of a file, and what differs after it was written and read: positions, facts."""
    df = read_motion(path).iloc[:FRAMES]
    points = df.to_numpy().reshape(len(df), -1, 3)
    try:
        leg = leg_of(df.to_numpy(), Skeleton.from_frame(df))
    except (KeyError, ValueError):
        leg = 0.45 * np.ptp(points[0], axis=0).max()
    write_motion(folder / "again.bvh", df)
    found = read_motion(folder / "again.bvh")
    rates = found.attrs["frame_rate"] / df.attrs["frame_rate"]
    kept = list(found.columns) == list(df.columns) and abs(rates - 1) < 1e-6
    rig = tuple(df.attrs["joints"]), tuple(map(tuple, df.attrs["rig"]["channels"]))
    return rig, np.abs(found.to_numpy() - df.to_numpy()).max() / leg, kept


def show_files(paths, folder):
    rigs, refused, kept = defaultdict(list), [], []
    for path in paths:
        try:
            rig, error, same = again(path, folder)
        except ValueError as problem:
            refused.append(f"{path.name}: {problem}")
            continue
        rigs[rig].append(error)
        kept.append(same)
    errors = [max(of_rig) for of_rig in rigs.values()]
    print(f"{len(paths)} files, {len(rigs)} rigs, worst error {max(errors):.1e} legs;", end=" ")
    print(f"{sum(kept)} keep names and frame rate, {len(refused)} are refused", *refused, sep="\n")


def on_a_rig(x, skeleton, folder):
    """Relative range of bone lengths in the file, and distances of joints in legs."""
    write_motion(folder / "body.bvh", x, skeleton, frame_rate=60)
    df = read_motion(folder / "body.bvh")
    joints = df.to_numpy().reshape(len(df), -1, 3)
    bones = [(p, j) for j, p in enumerate(df.attrs["parents"]) if p >= 0]
    sizes = np.array([np.linalg.norm(joints[:, j] - joints[:, p], axis=1) for p, j in bones])
    sizes = sizes[sizes.mean(axis=1) > 1e-3 * sizes.max()]
    own = df[skeleton.column_names].to_numpy().reshape(len(df), -1, 3)
    apart = np.linalg.norm(own - x.reshape(own.shape), axis=2) / leg_of(x, skeleton)
    return (np.ptp(sizes, axis=1) / sizes.mean(axis=1)).max(), apart.max(), np.mean(apart**2)


def show_bodies(data, folder):
    print("| bodies | kind | bone lengths vary by | largest error, legs | root mean square |")
    for archive, action in SETS:
        X, target, _, skeleton = read(data, archive)
        X = [x for x, label in zip(X, target, strict=True) if label == action]
        steps = DirectionCosines(skeleton), ASpace(0.95), DenseSynchronizer(60), ActionModel()
        pipe = make_pipeline(*steps).fit(X)
        cosines, space, match = pipe[0], pipe[1], Match.from_estimator(pipe, X)
        back = [
            space.inverse_transform(some)
            for some in (pipe[:3].transform(X), pipe[-1].sample(BODIES, random_state=0))
        ]
        kinds = {"recorded": X[:BODIES], "half each": [], "1.5 and -0.5": []}
        for name, weights in (("half each", [0.5, 0.5]), ("1.5 and -0.5", [1.5, -0.5])):
            for i in range(BODIES):
                pair = [i, (i + 3) % len(X)]
                two = [X[k] for k in pair]
                own = Match(match.times[pair])
                kinds[name].append(blend_performances(own, two, weights, skeleton=skeleton))
        rows = {name: [on_a_rig(x, skeleton, folder) for x in of] for name, of in kinds.items()}
        for name, some in zip(("synchronised", "sampled"), back, strict=True):
            bodies = cosines.inverse_transform(some)[:BODIES]
            rows[name] = [on_a_rig(np.asarray(x), skeleton.body(), folder) for x in bodies]
        for name, of in rows.items():
            lengths, largest, squares = np.array(of).T
            square = np.sqrt(squares.mean())
            print(f"| {archive} {action} | {name} | {lengths.max():.0e} |", end=" ")
            print(f"{largest.max():.4f} | {square:.5f} |", flush=True)


def main():
    parser = argparse.ArgumentParser(description=__doc__.split("\n", maxsplit=1)[0])
    parser.add_argument("files", nargs="*", type=Path)
    parser.add_argument("--data", type=Path)
    args = parser.parse_args()
    with tempfile.TemporaryDirectory() as name:
        if args.files:
            show_files(args.files, Path(name))
        if args.data:
            show_bodies(args.data, Path(name))


if __name__ == "__main__":
    main()
