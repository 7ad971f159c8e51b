"""How far key moments are missed where parts of the bodies were not seen.

    python benchmarks/gaps.py DATA_FOLDER

Gaps are cut into the joint positions of the clips that constants were chosen on (harness.py). The
true moments come from the positions without gaps. Three kinds:

- limb: an arm or a leg is hidden for a second in 30 % of the clips, for half of a shorter clip;
- joints: each joint is hidden in 10 % of the frames, in runs of about a twentieth of a second;
- frames: a tenth of all frames are gone, in runs of about a tenth of a second.

Directions of limbs of which an end is hidden are NaN. They are matched as they are, or filled
first: positions by `io.fill_gaps`, held beyond what was seen.
Figures are geometric means over the events of mean and median errors, over those without gaps. A
gain or a loss of 3 % may be chance. The last table has errors of positions, in centimetres, where
an arm, a leg or a joint is hidden for some frames of a clip.
"""

import warnings

import numpy as np
import pandas as pd
from harness import (
    EVENTS,
    Judged,
    P,
    People,
    command_line,
    figures,
    geometric_means,
    print_head,
    print_row,
    read_actions,
    show_pair,
)
from sklearn_motionsync import DenseSynchronizer, DirectionCosines
from sklearn_motionsync.io import fill_gaps

KINDS = ("limb", "joints", "frames")
JUDGED = [event for event in EVENTS if event.chosen]
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


WAYS = {"as they are": as_they_are, "fill_gaps": by_fill_gaps}


def to_cosines(action, positions):
    return DirectionCosines(action.skeleton, hidden="nan").fit_transform(positions)


def by_components(df):
    """By eight principal components of the whole frames, joined to what was seen by lines."""
    whole, seen = df.dropna(), df.notna().all().to_numpy()
    axes = np.linalg.svd(whole - whole.mean(), full_matrices=False)[2][:8]
    apart = (df - whole.mean()).to_numpy()[:, seen]
    expected = np.linalg.lstsq(axes[:, seen].T, apart.T)[0].T @ axes + whole.mean().to_numpy()
    return expected + (df - expected).interpolate()


# -- the tables -------------------------------------------------------------------------------


def distances(action, hidden, length):
    """{way: distances in cm} of joints hidden in each clip that is twice as long as the gap."""
    rng, found, joints = np.random.default_rng(length), {}, action.skeleton.joints
    for x in [x for x in action.data if len(x) > 2 * length + 10]:
        whole = pd.DataFrame(x, columns=action.skeleton.column_names, dtype=float)
        chosen, gappy = np.isin(joints, rng.choice(hidden or joints).split()), whole.copy()
        start = rng.integers(len(x) // 8, len(x) * 7 // 8 - length)
        gone = whole.columns[np.repeat(chosen, 3)]
        gappy.loc[start : start + length - 1, gone] = np.nan
        ways = {w: gappy[gone].interpolate(w) for w in ("linear", "akima", "cubicspline")}
        ways |= {"components": by_components(gappy), "fill_gaps": fill_gaps(gappy, length)}
        for name, filled in ways.items():
            apart = (filled[gone] - whole[gone]).to_numpy()[start : start + length]
            apart = apart.reshape(length, -1, 3)
            found.setdefault(name, []).append(100 * np.linalg.norm(apart, axis=2).mean())
    return found


def compare(people, actions, kind, seed, ways=WAYS):
    """{way: geometric means} of all actions, with gaps of a kind."""
    found: dict = {}
    for i, (one, action) in enumerate(zip(people, actions, strict=True)):
        positions = hide(action, kind, [seed, i]) if kind else action.data
        cosines = to_cosines(action, positions)
        for name, way in ways.items():
            X = way(cosines, action, positions)
            syncs = [DenseSynchronizer(P, pattern=int(n)).fit(X) for n in one.patterns]
            errors = Judged(one, [sync.match(X).times for sync in syncs]).errors()
            found.setdefault(name, {}).update(figures(errors))
    return {name: geometric_means(of_events) for name, of_events in found.items()}


def main():
    folder = command_line(__doc__).parse_args().folder
    warnings.simplefilter("ignore")
    actions = read_actions(folder, JUDGED)
    people = [People(action, patterns=4) for action in actions]
    whole = compare(people, actions, None, 0, {"as they are": as_they_are})["as they are"]
    for kind in KINDS:
        print_head(f"{kind}, errors over those without gaps", ["mean / median"])
        for name, missed in compare(people, actions, kind, 0).items():
            print_row(name, [show_pair(missed / whole)])
    arms, legs = LIMBS["hdm05"][:2], LIMBS["hdm05"][2:]
    for kind, hidden in {"arm": arms, "leg": legs, "joint": ()}.items():
        for n in (10, 20, 40):
            found = [distances(a, hidden, n) for a in actions if a.archive == "hdm05"]
            print_head(f"{kind}, {n} frames of HDM05, cm", found[0])
            means = [np.mean(np.concatenate([d[way] for d in found])) for way in found[0]]
            print_row("mean", [f"{x:.2f}" for x in means])


if __name__ == "__main__":
    main()
