"""Hidden joints of people who were left out, in cm: `MotionTracker` beside filters without a phase.

    python benchmarks/hidden_joints.py DATA_FOLDER [--sets hdm05 cyclic uiprmd utkinect] [--takes 2]

*hdm05* are the four actions of tracking.py, at 30 frames a second; *cyclic* its two others;
*uiprmd* five exercises done right; *utkinect* ten actions of a Kinect. Each actor of HDM05 is held
out in turn, two of each action of the others. Joints are moved by 1 cm in every coordinate, and
some are hidden: *arm*, an elbow and its wrist; *legs*, knees and ankles; *gap*, all for 20 frames,
half of the take where that is shorter. *moved*: all are seen, and moved by 5 cm. *six*: head,
wrists, ankles and the height of the pelvis, along the axes of the body, by a projection with limbs
of the training people.

Pooled Matern and VAR(2) are told the same covariance of the noise, simulated on training people
(or, *0.05*, that standard deviation in every cosine); their settings are chosen on people left out
of these. The tracker has `JointNoise`.

1. Mean error of the joints that are hidden (or moved), mean over takes, then over actions.
2. Its ratio to the best of the filters that know no phase, the mean of actions; *before* is that of
   `MotionTracker(noise=0.05)`.
3. The same of other actions under the model, and shares of hidden cosines within bands of 90 %.
4. Frames called lost, in %, with joints moved by 1, 3 and 5 cm: of right takes, and of other
   actions under the same model.
"""

import argparse
from collections import defaultdict
from pathlib import Path

import exercises
import numpy as np
import trackers
from harness import P, read_archive
from hidden_limbs import PEERS, STEP, Fitted, choose
from sklearn_motionsync import DirectionCosines, JointNoise, MotionTracker, Skeleton
from sklearn_motionsync.datasets import load_performances
from threadpoolctl import threadpool_limits
from tracking import ACTIONS

KINDS = ("arm", "legs", "gap", "moved", "six")
SMALL, LARGE, GAP = 0.01, 0.05, 20
SIX = ("head", "left_wrist", "right_wrist", "left_ankle", "right_ankle")
SIDES, MODES = ("left", "right"), ("live", "smoothed")

# -- takes in metres --------------------------------------------------------------------


def read_set(folder, name):
    """Positions, actions, actors and the skeleton of a set."""
    if name == "uiprmd":
        file = Path(folder) / "uiprmd" / "uiprmd_odd_positions.npz"
        bunch, right = load_performances(file), np.load(file)["correct"]
        skeleton = Skeleton(bunch.joints, bunch.skeleton.parents, exercises.LANDMARKS, up="z")
        pairs = zip(bunch.target, bunch.actor, strict=True)
        own = [a not in exercises.OTHER_SIDE.get(t, ()) for t, a in pairs]
        chosen, unit, step = np.flatnonzero(right & own), 1e-3, 1
    else:
        bunch = read_archive(folder, "utkinect" if name == "utkinect" else "hdm05")
        skeleton, unit, step = bunch.skeleton, 1.0, 1 if name == "utkinect" else STEP
        named = np.isin(bunch.target, ACTIONS)
        chosen = np.flatnonzero(named if name == "hdm05" else ~named)
    data = [unit * np.asarray(bunch.data[i], dtype=float)[::step] for i in chosen]
    long = [k for k, x in enumerate(data) if len(x) >= 8]
    chosen = chosen[long]
    return [data[k] for k in long], bunch.target[chosen], bunch.actor[chosen], skeleton


def folds_of(folder, name):
    """Every action with some actors held out."""
    data, target, actor, skeleton = read_set(folder, name)
    rng = np.random.default_rng(0)
    for action in np.unique(target):
        own = np.flatnonzero(target == action)
        actors = np.unique(actor[own])
        for held in actors if len(actors) < 5 else rng.permutation(actors)[:2]:
            yield Fold(action, [data[i] for i in own], actor[own], held, skeleton)


class Fold:
    """An actor held out, and what is learnt from three takes of each of the others, or all."""

    def __init__(self, action, data, actor, held, skeleton):
        self.action, self.skeleton = action, skeleton
        self.test = [x for x, a in zip(data, actor, strict=True) if a == held]
        others = [a for a in np.unique(actor) if a != held]
        people = [[x for x, a in zip(data, actor, strict=True) if a == b] for b in others]
        if len(others) > 4:
            people = [takes[:3] for takes in people]
        self.train = [x for takes in people for x in takes]
        self.of = np.repeat(np.arange(len(people)), [len(takes) for takes in people])
        self.cosines = DirectionCosines(skeleton, hidden="nan").fit(self.train)
        self.postures = self.cosines.transform(self.train)
        self.sync = Fitted(n_frames=P).fit(self.postures)
        by_person = [self.cosines.transform(takes) for takes in people]
        self.peers = {
            name: [make(self.postures, *best) for best in choose(make, by_person[:4], settings)]
            for name, make, settings in PEERS
            if name != "constant velocity"
        }
        self.matrix, columns = self.cosines.position_matrix()
        self.joints = [column[:-2] for column in columns[::3]]
        self.known, self.trackers = {}, {}

    def covariance(self, sd):
        """Of cosines of training people whose joints are moved."""
        if sd not in self.known:
            rng = np.random.default_rng(1)
            moved = [x + sd * rng.standard_normal(x.shape) for x in self.train]
            off = np.concatenate(self.cosines.transform(moved)) - np.concatenate(self.postures)
            self.known[sd] = off.T @ off / len(off) + trackers.LEAST * np.eye(off.shape[1])
        return self.known[sd]

    def tracker(self, noise):
        if noise not in self.trackers:
            fitted = MotionTracker(self.sync, noise=noise).fit(self.postures, groups=self.of)
            self.trackers[noise] = fitted
        return self.trackers[noise]

    def case(self, x, kind, rng):
        """What is seen of a take, by which matrix (None: all), and the joints that count."""
        moved = x + (LARGE if kind == "moved" else SMALL) * rng.standard_normal(x.shape)
        counts = np.zeros((len(x), len(self.joints)), dtype=bool)
        if kind == "six":
            rows = [3 * self.joints.index(name) + k for name in SIX for k in range(3)]
            rows.append(3 * self.joints.index("pelvis") + 1)
            counts[:, [k for k, name in enumerate(self.joints) if name not in SIX]] = True
            seen = self.place(self.cosines.transform([x])[0], x).reshape(len(x), -1)[:, rows]
            return seen + SMALL * rng.standard_normal(seen.shape), self.matrix[rows], counts
        points, frames, hidden = moved.reshape(len(x), -1, 3), slice(None), []
        if kind == "arm":
            side = SIDES[rng.integers(2)]
            hidden = [f"{side}_elbow", f"{side}_wrist"]
        elif kind == "legs":
            hidden = [f"{side}_{joint}" for side in SIDES for joint in ("knee", "ankle")]
        elif kind == "gap":
            length = min(GAP, len(x) // 2)
            begin = rng.integers(1, len(x) - length)
            frames, hidden = slice(begin, begin + length), self.joints
            points[frames] = np.nan
        for name in hidden:
            points[frames, list(self.skeleton.indices_of(name))] = np.nan
            counts[frames, self.joints.index(name)] = True
        return self.cosines.transform([moved])[0], None, counts | (kind == "moved")

    def place(self, postures, x):
        """Joints (n_frames, n_joints, 3) of postures of a person with limbs of unit directions."""
        lengths = DirectionCosines(self.skeleton).fit([x]).limb_lengths_
        limbs = postures[:, 1:].reshape(len(postures), -1, 3)
        limbs = limbs / np.linalg.norm(limbs, axis=2, keepdims=True)
        whole = np.column_stack([postures[:, 0], limbs.reshape(len(limbs), -1)])
        return (whole @ self.cosines.position_matrix(lengths)[0].T).reshape(len(whole), -1, 3)

    def error(self, postures, x, counts):
        truth = self.place(self.cosines.transform([x])[0], x)
        return 100 * np.linalg.norm(self.place(postures, x) - truth, axis=2)[counts].mean()

    def answers(self, seen, shows, sd):
        """Of every filter its name, and postures live and smoothed."""
        for name, noise in (("MotionTracker", JointNoise(sd, self.cosines)), ("before", 0.05)):
            tracker = self.tracker(sd if shows is not None and name == "before" else noise)
            live, smooth = tracker.track, tracker.smooth
            yield name, (f(seen, projection=shows).postures for f in (live, smooth))
        for name, (filtering, smoothing) in self.peers.items():
            for label, noise in (("", self.covariance(sd)), (", 0.05", 0.05)):
                given = [seen], (noise if shows is None else sd)
                (a,) = filtering.run(*given, smooth=False, shows=shows)
                (b,) = smoothing.run(*given, shows=shows)
                yield name + label, (a.means, b.smoothed)


# -- tables -----------------------------------------------------------------------------


def measure(folds, n_takes):
    """Mean errors by name, mode, kind and action."""
    errors = defaultdict(list)
    for k, fold in enumerate(folds):
        for i, x in enumerate(fold.test[:n_takes]):
            for j, kind in enumerate(KINDS):
                seen, shows, counts = fold.case(x, kind, np.random.default_rng([k, i, j]))
                sd = LARGE if kind == "moved" else SMALL
                for name, found in fold.answers(seen, shows, sd):
                    for mode, postures in zip(MODES, found, strict=True):
                        error = fold.error(postures, x, counts)
                        errors[name, mode, kind, fold.action].append(error)
    return {key: np.mean(found) for key, found in errors.items()}


def show(errors):
    names, actions = (list(dict.fromkeys(key[k] for key in errors)) for k in (0, 3))
    peers = [name for name in names if name not in ("MotionTracker", "before")]
    for mode in MODES:
        print(f"   {mode:24}" + "".join(f"{kind:>8}" for kind in KINDS))
        table = {
            name: np.array([[errors[name, mode, k, a] for k in KINDS] for a in actions])
            for name in names
        }
        for name, found in table.items():
            print(f"   {name:24}" + "".join(f"{x:8.2f}" for x in found.mean(axis=0)))
        best = np.min([table[name].mean(axis=0) for name in peers], axis=0)
        hindsight = np.min([table[name] for name in peers], axis=0)
        for name in ("MotionTracker", "before"):
            ratios = table[name].mean(axis=0) / best, (table[name] / hindsight).mean(axis=0)
            for label, row in zip(("to the best", "action by action"), ratios, strict=True):
                print(f"   {name + ', ' + label:32}" + "".join(f"{x:7.3f} " for x in row))


def other_of(folds, k):
    """A fold of another action."""
    others = [fold for fold in folds if fold.action != folds[k].action]
    return others[(3 * k) % len(others)]


def show_bands(folds, n_takes):
    """Bands of 90 % live, right takes and other actions; and errors, beside the pooled process."""
    for name in ("right", "other"):
        for kind in ("arm", "legs", "gap"):
            inside, errors = [], []
            for k, fold in enumerate(folds):
                of = fold if name == "right" else other_of(folds, k)
                for i, x in enumerate(of.test[:n_takes]):
                    rng = np.random.default_rng([k, i, KINDS.index(kind)])
                    seen, _, counts = of.case(x, kind, rng)
                    track = fold.tracker(JointNoise(SMALL, fold.cosines)).track(seen)
                    (peer,) = fold.peers["pooled Matern"][0].run([seen], fold.covariance(SMALL))
                    wide = 1.645 * np.sqrt(np.diagonal(track.covariances, axis1=1, axis2=2))
                    off = np.abs(track.postures - of.cosines.transform([x])[0])
                    inside.append((off <= wide)[np.isnan(seen)].mean())
                    errors.append([of.error(y, x, counts) for y in (track.postures, peer.means)])
            own, pooled = np.mean(errors, axis=0)
            text = (
                f"{100 * np.mean(inside):.0f} % in bands, {own:.1f} cm, pooled Matern {pooled:.1f}"
            )
            print(f"   {name}, {kind} hidden: {text}", flush=True)


def show_lost(folds, n_takes):
    for sd in (0.01, 0.03, 0.05):
        lost = defaultdict(list)
        for k, fold in enumerate(folds):
            wrong = other_of(folds, k)
            given = [("right", fold, x) for x in fold.test[:n_takes]]
            for name, of, x in [*given, ("other", wrong, wrong.test[0])]:
                moved = x + sd * np.random.default_rng(k).standard_normal(x.shape)
                (seen,) = of.cosines.transform([moved])
                track = fold.tracker(JointNoise(sd, fold.cosines)).track(seen)
                lost[name].append(track.lost.mean())
        text = ", ".join(f"{name} {100 * np.mean(v):.1f} %" for name, v in lost.items())
        print(f"   called lost, joints moved by {100 * sd:.0f} cm: {text}", flush=True)


def main():
    parser = argparse.ArgumentParser(description=__doc__.split("\n", maxsplit=1)[0])
    parser.add_argument("folder")
    parser.add_argument("--sets", nargs="*", default=["hdm05", "cyclic", "uiprmd", "utkinect"])
    parser.add_argument("--takes", type=int, default=2)
    args = parser.parse_args()
    for name in args.sets:
        folds = list(folds_of(args.folder, name))
        print(f"{name}: {len(folds)} folds of {len({f.action for f in folds})} actions", flush=True)
        show(measure(folds, args.takes))
        show_bands(folds, args.takes)
        show_lost(folds, args.takes)


if __name__ == "__main__":
    with threadpool_limits(1):
        main()
