"""Hidden joints of people who were left out: `MotionTracker` beside a filter without a phase.

    python benchmarks/tracking.py DATA_FOLDER

Six actions of HDM05 at 30 frames a second, each actor held out in turn. Joints are moved by 1 cm in
every coordinate, and some are hidden: *arm*, an elbow and its wrist; *legs*, knees and ankles;
*gap*, all for 20 frames, half of the take where that is shorter. *moved*: all are seen, and moved
by 5 cm. Two takes of each actor.

The peer is a Kalman filter of a Matern-3/2 process about the mean pose of the training people,
which knows no phase. It is told the covariance of the noise, simulated on training people, and has
the best of its settings for each column, chosen by the result. The tracker has `JointNoise`. Mean
error of the joints that are hidden (or moved), over takes, then over actions; and the share of
hidden cosines within bands of 90 %. Prints Markdown.
"""

from itertools import product
from typing import NamedTuple

import numpy as np
from harness import P, command_line, percent, print_head, print_row, read_archive
from scipy.linalg import cho_factor, cho_solve
from sklearn_motionsync import DenseSynchronizer, DirectionCosines
from sklearn_motionsync.body import JointNoise
from sklearn_motionsync.live import MotionTracker

KINDS = ("arm", "legs", "gap", "moved")
SMALL, LARGE, GAP, TAKES, STEP = 0.01, 0.05, 20, 2, 4
# What keeps covariances of features that never move invertible: a twentieth of a degree.
LEAST = 1e-6
# Length scales of the peer, in frames, and shares by which its covariance is drawn to its diagonal.
SETTINGS = list(product((5, 12, 27), (0.1, 0.5)))

# -- the peer ---------------------------------------------------------------------------


class Linear(NamedTuple):
    """``x' = transition x + N(0, drive)`` from N(0, spread); its first entries are seen."""

    transition: np.ndarray
    drive: np.ndarray
    spread: np.ndarray


def matern(takes, length, share):
    """The mean pose of takes, and a Matern-3/2 process in time about it."""
    frames = np.concatenate(takes)
    rate, d = np.sqrt(3) / length, frames.shape[1]
    C = np.cov(frames.T, bias=True) + LEAST * np.eye(d)
    C = (1 - share) * C + share * np.diag(np.diag(C))
    step = np.exp(-rate) * np.array([[1 + rate, 1], [-(rate**2), 1 - rate]])
    rest = np.diag([1, rate**2])
    drive = np.kron(rest - step @ rest @ step.T, C) + 1e-9 * np.eye(2 * d)
    return frames.mean(axis=0), Linear(np.kron(step, np.eye(d)), drive, np.kron(rest, C))


def kalman(model, y, noise):
    """Means of a take ``y`` (n_frames, d), NaN where hidden, of what was seen until then.

    ``noise`` is the covariance of what is seen.
    """
    F, means = model.transition, []
    x, C = np.zeros(len(model.spread)), model.spread
    for t, row in enumerate(y):
        if t:
            x, C = F @ x, F @ C @ F.T + model.drive
        seen = np.flatnonzero(~np.isnan(row))
        if len(seen):
            S = C[np.ix_(seen, seen)] + noise[np.ix_(seen, seen)]
            gain = cho_solve(cho_factor(S), C[seen])
            x, C = x + (row[seen] - x[seen]) @ gain, C - C[:, seen] @ gain
            C = (C + C.T) / 2
        means.append(x[: y.shape[1]])
    return np.array(means)


# -- people -----------------------------------------------------------------------------


class Fold:
    """An actor held out of an action, and what is learnt from the takes of the others."""

    def __init__(self, action, takes, actors, held, skeleton):
        self.action, self.skeleton = action, skeleton
        self.test = [x for x, a in zip(takes, actors, strict=True) if a == held][:TAKES]
        self.train = [x for x, a in zip(takes, actors, strict=True) if a != held]
        self.cosines = DirectionCosines(skeleton, hidden="nan").fit(self.train)
        self.poses = self.cosines.transform(self.train)
        self.groups = actors[actors != held]
        self.joints = list(self.cosines.skeleton.body().joints)
        self.trackers = {sd: self.tracker(sd) for sd in (SMALL, LARGE)}
        self.covariances = {sd: self.covariance(sd) for sd in (SMALL, LARGE)}

    def tracker(self, sd):
        sync = DenseSynchronizer(P).fit(self.poses)
        tracker = MotionTracker(sync, noise=JointNoise(sd, self.cosines), random_state=0)
        return tracker.fit(self.poses, groups=self.groups)

    def covariance(self, sd):
        """Of the errors of cosines of training people whose joints are moved."""
        rng = np.random.default_rng(1)
        moved = [x + sd * rng.standard_normal(x.shape) for x in self.train]
        off = np.concatenate(self.cosines.transform(moved)) - np.concatenate(self.poses)
        return off.T @ off / len(off) + LEAST * np.eye(off.shape[1])

    def case(self, x, kind, rng):
        """What is seen of a take, and the joints that count (n_frames, n_joints)."""
        moved = x + (LARGE if kind == "moved" else SMALL) * rng.standard_normal(x.shape)
        counts = np.zeros((len(x), len(self.joints)), dtype=bool)
        points, frames, hidden = moved.reshape(len(x), -1, 3), slice(None), []
        if kind == "arm":
            side = rng.choice(["left", "right"])
            hidden = [f"{side}_elbow", f"{side}_wrist"]
        elif kind == "legs":
            hidden = [f"{s}_{joint}" for s in ("left", "right") for joint in ("knee", "ankle")]
        elif kind == "gap":
            length = min(GAP, len(x) // 2)
            begin = rng.integers(1, len(x) - length)
            frames, hidden = slice(begin, begin + length), self.joints
            points[frames] = np.nan
        for name in hidden:
            points[frames, list(self.skeleton.indices_of(name))] = np.nan
            counts[frames, self.joints.index(name)] = True
        return self.cosines.transform([moved])[0], counts | (kind == "moved")

    def place(self, poses, x):
        """Joints (n_frames, n_joints, 3) of poses of a person, the hips beside the pelvis."""
        points = DirectionCosines(self.skeleton).fit([x]).inverse_transform([poses])[0]
        points, at = points.reshape(len(poses), -1, 3), self.joints.index
        hips = points[:, [at("left_hip"), at("right_hip")], 1].mean(axis=1)
        # Legs were moved onto the floor.
        legs = [k for k, name in enumerate(self.joints) if name.endswith(("hip", "knee", "ankle"))]
        points[:, legs, 1] -= (hips - points[:, at("pelvis"), 1])[:, np.newaxis]
        return points

    def error(self, poses, x, counts):
        """Of joints, in cm."""
        truth = self.place(self.cosines.transform([x])[0], x)
        return 100 * np.linalg.norm(self.place(poses, x) - truth, axis=2)[counts].mean()


def folds_of(folder):
    """Every action with its actors held out in turn."""
    bunch = read_archive(folder, "hdm05")
    for action in np.unique(bunch.target):
        chosen = np.flatnonzero(bunch.target == action)
        takes = [np.asarray(bunch.data[i], dtype=float)[::STEP] for i in chosen]
        for held in np.unique(bunch.actor[chosen]):
            yield Fold(action, takes, bunch.actor[chosen], held, bunch.skeleton)


# -- the table --------------------------------------------------------------------------


def table(folder):
    """Errors of ours and of the peer, and bands."""
    errors, bands = {}, {}
    for k, fold in enumerate(folds_of(folder)):
        models = {setting: matern(fold.poses, *setting) for setting in SETTINGS}
        for i, (x, kind) in enumerate(product(fold.test, KINDS)):
            sd = LARGE if kind == "moved" else SMALL
            seen, counts = fold.case(x, kind, np.random.default_rng([k, i]))
            live, truth = fold.trackers[sd].track(seen), fold.cosines.transform([x])[0]
            answers = {"`MotionTracker`": live.poses}
            for setting, (mean, model) in models.items():
                answers[setting] = mean + kalman(model, seen - mean, fold.covariances[sd])
            for name, poses in answers.items():
                rows = errors.setdefault(name, {}).setdefault(kind, {})
                rows.setdefault(fold.action, []).append(fold.error(poses, x, counts))
            wide = 1.645 * np.sqrt(np.diagonal(live.covariances, axis1=1, axis2=2))
            hidden = np.isnan(seen)
            if hidden.any():
                inside = np.abs(live.poses - truth) <= wide
                bands.setdefault(kind, []).append(inside[hidden].mean())
    print_head("cm", KINDS)
    means = {
        name: [np.mean([np.mean(rows) for rows in by_kind[kind].values()]) for kind in KINDS]
        for name, by_kind in errors.items()
    }
    rows = {"`MotionTracker`": means.pop("`MotionTracker`")}
    rows["without a phase, the best setting"] = np.min(list(means.values()), axis=0)
    for name, found in rows.items():
        print_row(name, [f"{x:.2f}" for x in found])
    print_row(
        "bands of 90 % hold, %", [percent(np.mean(bands.get(kind, np.nan))) for kind in KINDS]
    )


if __name__ == "__main__":
    table(command_line(__doc__).parse_args().folder)
