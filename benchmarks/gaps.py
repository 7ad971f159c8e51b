"""How far key moments are missed where parts of the bodies were not seen.

    python benchmarks/gaps.py DATA [draws [patterns]]

DATA is the folder with hdm05/ and utkinect/. Every action is matched to so many of its clips, by
default 4, with so many draws of the gaps, by default 1: that takes three minutes. Gaps are cut into
the joint positions of the clips of harness.py that have a peer. The true moments come from the
positions without gaps. Three kinds:

- limb: an arm or a leg is hidden for a second in 30 % of the clips, for half of a shorter clip;
- joints: each joint is hidden in 10 % of the frames, in runs of about a twentieth of a second;
- frames: a tenth of all frames are gone, in runs of about a tenth of a second.

Directions of limbs of which an end is hidden are NaN. They are matched as they are, or filled
first: positions by Akima's polynomials (`io.fill_gaps`, held beyond what was seen), directions by
cubic splines over time, or by the mean of each. DTW-AROW is what a user of DTW would take. Figures
are geometric means over the events of mean and median errors, over those without gaps. A gain or a
loss of 3 % may be chance: see the spread of two draws.
"""

import sys
import warnings

import numpy as np
import pandas as pd
from harness import EVENTS, Judged, P, People, figures, geometric_means, read_actions
from scipy.interpolate import CubicSpline
from sklearn_motionsync import ASpace, DenseSynchronizer, DirectionCosines
from sklearn_motionsync.io import fill_gaps
from sklearn_motionsync.matching.warps import normalise

KINDS = ("limb", "joints", "frames")
JUDGED = [event for event in EVENTS if event.peers]
FRAME_RATE = {"hdm05": 120, "utkinect": 30}
LIMBS = {
    "hdm05": (
        "rradius rwrist rhand rfingers rthumb",
        "lradius lwrist lhand lfingers lthumb",
        "rfemur rtibia rfoot rtoes",
        "lfemur ltibia lfoot ltoes",
    ),
    "utkinect": (
        "ElbowRight WristRight HandRight",
        "ElbowLeft WristLeft HandLeft",
        "KneeRight AnkleRight FootRight",
        "KneeLeft AnkleLeft FootLeft",
    ),
}

# -- gaps ---------------------------------------------------------------------------------


def hide(action, kind, seed):
    """Joint positions of the clips of an action with gaps of a kind: NaN where hidden."""
    rng, rate = np.random.default_rng(seed), FRAME_RATE[action.archive]
    joints = list(action.skeleton.joints)
    limbs = [[joints.index(j) for j in names.split()] for names in LIMBS[action.archive]]
    out = []
    for x in action.data:
        points = x.reshape(len(x), -1, 3).astype(float)
        n = len(points)
        if kind == "limb" and rng.random() < 0.3:
            length = min(rate, n // 2)
            first, limb = rng.integers(n - length + 1), limbs[rng.integers(len(limbs))]
            points[first : first + length, limb] = np.nan
        elif kind == "joints":
            for joint in range(points.shape[1]):
                points[runs(rng, n, 0.1, rate / 20), joint] = np.nan
        elif kind == "frames":
            points[runs(rng, n, 0.1, rate / 10)] = np.nan
        out.append(points.reshape(n, -1))
    return out


def runs(rng, n, share, length):
    """A mask of n frames, of which a share is True, in runs of this mean length."""
    leave = min(1 / length, 1)
    enter = share * leave / (1 - share)
    mask, state = np.zeros(n, dtype=bool), rng.random() < share
    for i in range(n):
        mask[i] = state
        state = rng.random() >= leave if state else rng.random() < enter
    return mask if (~mask).sum() >= 3 else np.zeros(n, dtype=bool)


# -- what is done about them --------------------------------------------------------------


def as_they_are(cosines, action, positions):
    return cosines


def by_fill_gaps(cosines, action, positions):
    names = [f"{joint}_{axis}" for joint in action.skeleton.joints for axis in "xyz"]
    tables = [pd.DataFrame(x, columns=names) for x in positions]
    filled = [fill_gaps(df, len(df)).ffill().bfill() for df in tables]
    return to_cosines(action, filled)


def by_splines(cosines, action, positions):
    return by_mean([along_time(x) for x in cosines], action, positions)


def along_time(x):
    """Cubic splines through what was seen, held beyond; a feature never seen stays NaN."""
    x, frames = x.copy(), np.arange(len(x))
    for column in x.T:
        seen = frames[np.isfinite(column)]
        if 3 <= len(seen) < len(column):
            spline = CubicSpline(seen, column[seen])
            hidden = np.isnan(column)
            column[hidden] = spline(np.clip(frames[hidden], seen[0], seen[-1]))
    return x


def by_mean(cosines, action, positions):
    mean = np.nanmean(np.concatenate(cosines), axis=0)
    return [np.where(np.isnan(x), mean, x) for x in cosines]


SPACES = "cosines", "aSpace"
WAYS = {
    "as they are": as_they_are,
    "fill_gaps": by_fill_gaps,
    "splines": by_splines,
    "mean": by_mean,
}


def to_cosines(action, positions):
    return DirectionCosines(action.skeleton, hidden="nan").fit_transform(positions)


# -- warps ------------------------------------------------------------------------------------


def dense(X, patterns):
    """Warps of all clips to every pattern."""
    syncs = (DenseSynchronizer(P, pattern=int(n)).fit(X) for n in patterns)
    return np.array([sync.match(X).times for sync in syncs])


def dtw_arow(X, patterns):
    """The same by DTW-AROW: a hidden frame costs nothing, and has no pause before or after it.

    Frames of which a part is hidden cost as much more as they show less.
    """
    curves = normalise(X, P)
    base, moving = curves[patterns], curves
    cost = np.empty((P, P, len(base), len(moving)))
    for p in range(P):
        differences = base[:, p, np.newaxis] - moving.swapaxes(0, 1)[:, np.newaxis]
        seen = np.isfinite(differences)
        share = seen.mean(axis=3)
        squares = np.where(seen, np.square(differences), 0).sum(axis=3)
        cost[p] = np.where(share > 0, squares / np.where(share > 0, share, 1), np.nan)
    return paths_of(cost.reshape(P, P, -1)).reshape(len(base), len(moving), P)


def paths_of(cost):
    """Mean positions (n_pairs, P) that best paths meet, of costs (P, P, n_pairs); NaN is hidden."""
    pad = ((1, 0), (1, 0), (0, 0))
    blocked = np.pad(np.isnan(cost), pad)
    cost, pairs = np.nan_to_num(cost), np.arange(cost.shape[2])
    total = np.full((P + 1, P + 1, len(pairs)), np.inf)
    total[0, 0] = 0
    came = np.zeros(total.shape, dtype=np.int8)
    for diagonal in range(2, 2 * P + 1):
        p = np.arange(max(1, diagonal - P), min(P, diagonal - 1) + 1)
        q, here = diagonal - p, blocked[p, diagonal - p]
        ways = [total[p - 1, q - 1]]
        for before in ((p - 1, q), (p, q - 1)):
            ways.append(np.where(here | blocked[before], np.inf, total[before]))
        total[p, q] = cost[p - 1, q - 1] + np.min(ways, axis=0)
        came[p, q] = np.argmin(ways, axis=0)
    p, q = np.full((2, len(pairs)), P)
    met, count = np.zeros((2, len(pairs), P))
    for _ in range(2 * P - 1):
        going = (p > 0) & (q > 0)
        met[pairs[going], p[going] - 1] += q[going] - 1
        count[pairs[going], p[going] - 1] += 1
        # At an end there is one way left; the other end is the last.
        step = np.where(p == 1, np.where(q == 1, 0, 2), np.where(q == 1, 1, came[p, q, pairs]))
        p, q = np.where(step == 2, p, p - 1), np.where(step == 1, q, q - 1)
        p, q = np.where(going, p, 0), np.where(going, q, 0)
    return met / count


# -- the table --------------------------------------------------------------------------------


def errors_of(people, X, warps=dense):
    """Mean and median error of every event of an action."""
    return figures(Judged(people, warps(X, people.patterns)).errors())


def compare(people, actions, kind, seed, ways=WAYS, spaces=SPACES, peer=True):
    """{(way, space): geometric means} of all actions, with gaps of a kind."""
    found: dict = {}
    for i, (one, action) in enumerate(zip(people, actions, strict=True)):
        positions = hide(action, kind, [seed, i]) if kind else action.data
        cosines = to_cosines(action, positions)
        for name, way in ways.items():
            X = way(cosines, action, positions)
            for space in spaces:
                given = ASpace().fit_transform(X) if space == "aSpace" else X
                found.setdefault((name, space), {}).update(errors_of(one, given))
        if peer:
            arow = errors_of(one, cosines, dtw_arow)
            found.setdefault(("DTW-AROW", "cosines"), {}).update(arow)
    return {key: geometric_means(of_events) for key, of_events in found.items()}


def main(folder, draws=1, patterns=4):
    warnings.simplefilter("ignore")
    actions = read_actions(folder, JUDGED)
    people = [People(action, patterns) for action in actions]
    whole = compare(people, actions, None, 0, {"as they are": as_they_are})
    print("without gaps: mean and median error, in frames of 100")
    for (name, space), pair in whole.items():
        print(f"  {name:12s} {space:8s} {pair[0]:6.2f} {pair[1]:6.2f}", flush=True)
    print(f"with gaps, over those without: mean, median (spread of {draws} draws)")
    for kind in KINDS:
        runs_of = [compare(people, actions, kind, seed) for seed in range(draws)]
        for name, space in runs_of[0]:
            base = whole["DTW-AROW" if name == "DTW-AROW" else "as they are", space]
            ratios = np.array([found[name, space] / base for found in runs_of])
            (mean, median), (up, down) = ratios.mean(axis=0), np.ptp(ratios, axis=0)
            print(
                f"  {kind:7s} {name:12s} {space:8s} {mean:5.2f} {median:5.2f}   "
                f"({up:.2f} {down:.2f})",
                flush=True,
            )


if __name__ == "__main__":
    main(sys.argv[1], *map(int, sys.argv[2:4]))
