"""Where in a take a movement repeats: walks with standing around them, actions, gestures, noise.

    python benchmarks/stretches.py DATA_FOLDER

Walks of `cmu07_walk`, jogs of `hdm05` and takes of `make_gait` have so many times as much standing
around them, half of it before, half behind. ``freeze`` repeats the first and the last frame.
``sway`` turns within half a second to a posture of standing (hdm05: the first frame of a bend of
the person; cmu: the frame in which the ankles are closest) and back, and sways by 1 cm, below about
1 Hz, with 1 mm of noise. ``noise`` has 1 cm of white noise in all joints as well.

A cycle is inside if it begins and ends within the walk; a cut is inside alike. Templates are those
of other actors or, where there is one actor, of other takes. Cycles begin with either foot. A
period is right within 5 % of twice the median step of the walk alone.

A gesture in a long take is found if more than half of a stretch lies within its label. Stretches
that lie in no label of something that repeats are wrong.
"""

import argparse

import numpy as np
from cycles import CYCLIC, SINGLE, foot_strikes, read, references
from scipy.ndimage import gaussian_filter1d
from sklearn_motionsync import CycleSegmenter
from sklearn_motionsync.datasets import load_performances, make_gait

FACTORS, KINDS = (0, 1, 2, 4), ("freeze", "sway", "noise")
RATES = (120, 60, 30, 25)
GESTURES = ("waveHands", "clapHands")
# Seconds of the turn to a posture of standing, and of the filter of the sway; sway and noise in m.
TURN, SLOW, SWAY, NOISE = 0.5, 0.25, 0.01, 0.001


def turned(pose, other, skeleton):
    """A posture, turned and shifted so that its pelvis and hips are those of another."""
    hips = [skeleton.index_of(f"{side}_hip") for side in ("left", "right")]
    pelvis = skeleton.index_of("pelvis")
    across = [x[hips[0]] - x[hips[1]] for x in (pose, other)]
    angle = np.subtract(*(np.arctan2(x[2], x[0]) for x in across[::-1]))
    cos, sin = np.cos(angle), np.sin(angle)
    turn = np.array([[cos, 0, -sin], [0, 1, 0], [sin, 0, cos]])
    return (pose - pose[pelvis]) @ turn.T + other[pelvis]


def blended(start, end, n):
    """Postures from one to another, the first excluded, at rest at both."""
    share = np.minimum(np.arange(1, n + 1) / n, 1)[:, np.newaxis, np.newaxis]
    return start + share**2 * (3 - 2 * share) * (end - start)


def with_standing(walk, factor, kind, rng):
    """A walk with standing around it, and where in it the walk begins and ends."""
    points, rate, n = walk["points"], walk["rate"], len(walk["points"])
    count = round(factor * n / 2)
    sides = []
    for end in (points[0], points[-1]):
        stands = np.repeat(end[np.newaxis], count, axis=0)
        if kind != "freeze":
            pose = turned(walk["pose"], end, walk["skeleton"])
            turn = blended(end, pose, max(round(TURN * rate), 1))
            stands = np.concatenate([turn, np.repeat(pose[np.newaxis], count, axis=0)])[:count]
        sides.append(stands)
    take = np.concatenate([sides[0][::-1], points, sides[1]]).reshape(2 * count + n, -1)
    if kind != "freeze":
        outside = np.ones(len(take))
        outside[count : count + n] = 0
        slow = gaussian_filter1d(rng.normal(size=take.shape), SLOW * rate, axis=0)
        slow *= SWAY * walk["unit"] / slow.std()
        take = take + slow * gaussian_filter1d(outside, 0.1 * rate)[:, np.newaxis]
        noise = SWAY if kind == "noise" else NOISE
        take = take + noise * walk["unit"] * rng.normal(size=take.shape)
    return take, (count, count + n)


def walks(folder):
    """Walks and jogs, each with a posture of standing, and the unit of a metre."""
    for archive, label in CYCLIC.items():
        bunch = read(folder, archive, label)
        poses = {}
        if archive == "hdm05":
            bends = read(folder, archive, "depositFloorR")
            poses = {actor: x[0] for x, actor in zip(bends.data, bends.actor, strict=True)}
        groups = bunch.actor if len(set(bunch.actor)) > 1 else np.arange(len(bunch.data))
        for x, rate, actor, group in zip(
            bunch.data, bunch.frame_rate, bunch.actor, groups, strict=True
        ):
            points = np.asarray(x, dtype=float).reshape(len(x), -1, 3)
            ankles = [bunch.skeleton.index_of(f"{s}_ankle") for s in ("left", "right")]
            apart = np.linalg.norm(points[:, ankles[0]] - points[:, ankles[1]], axis=1)
            pose = np.asarray(poses.get(actor, points[apart.argmin()]), dtype=float)
            yield {
                "label": label,
                "points": points,
                "rate": float(rate),
                "skeleton": bunch.skeleton,
                "pose": pose.reshape(-1, 3),
                "unit": 100.0 if archive == "cmu07_walk" else 1.0,
                "group": group,
                "period": references(foot_strikes(x, bunch.skeleton, rate))[0],
            }


def resampled(take, step):
    """A take at every so many frames, by straight lines."""
    at = np.arange(0, len(take) - 1, step)
    return np.stack([np.interp(at, np.arange(len(take)), x) for x in take.T], axis=1)


def standing(every, factor, kind, rate=None, seed=0):
    """Counts of walks: cyclic, right periods; of cycles, inside; of cuts, inside; of stretches."""
    rng, counts = np.random.default_rng(seed), np.zeros(7, dtype=int)
    for label in CYCLIC.values():
        own = [walk for walk in every if walk["label"] == label]
        takes, ends, periods = [], [], []
        for walk in own:
            take, place = with_standing(walk, factor, kind, rng)
            step = 1 if rate is None else walk["rate"] / rate
            takes.append(take if rate is None else resampled(take, step))
            ends.append(np.array(place) / step)
            periods.append(walk["period"] / step)
        skeleton = own[0]["skeleton"]
        report = CycleSegmenter(skeleton).report(takes)
        counts[0] += report["cyclic"].sum()
        counts[1] += (np.abs(report["period"] / periods - 1) < 0.05)[report["cyclic"]].sum()
        if "stretches" in report:
            counts[6] += report["stretches"].map(len).sum()
        groups = np.array([walk["group"] for walk in own])
        for group in np.unique(groups):
            test = np.flatnonzero(groups == group)
            others = [takes[i] for i in np.flatnonzero(groups != group)]
            for side in ("left", "right"):
                segmenter = CycleSegmenter(skeleton, start=side, not_cyclic="skip").fit(others)
                table = segmenter.segment([takes[i] for i in test])[1]
                for i, row in zip(test[table["take"]], table.itertuples(), strict=True):
                    (first, last), cuts = ends[i], (row.start, row.stop - 1)
                    inside = [first - 1 <= cut <= last for cut in cuts]
                    counts[2:6] += [1, all(inside), 2, sum(inside)]
    return counts


def gaits(factor, kind):
    """Takes of `make_gait` with standing: how many; cyclic; cycles; inside."""
    rng, counts = np.random.default_rng(0), np.zeros(4, dtype=int)
    for seed in range(4):
        takes, ends = [], []
        for x in make_gait(6, 4, takes=True, random_state=seed).data:
            count = round(factor * len(x) / 2)
            take = np.concatenate([np.repeat(x[:1], count, 0), x, np.repeat(x[-1:], count, 0)])
            if kind != "freeze":
                size = np.array([0.3, 0.3, 0.3, 0.003])
                take = take + size * rng.normal(size=take.shape)
            takes.append(take / [20, 20, 8, 0.4])
            ends.append((count, count + len(x)))
        segmenter = CycleSegmenter(start=0, not_cyclic="skip").fit(takes[:3])
        counts[:2] += [len(takes), segmenter.report(takes)["cyclic"].sum()]
        table = segmenter.segment(takes[3:])[1]
        for i, row in zip(table["take"] + 3, table.itertuples(), strict=True):
            counts[2:] += [1, ends[i][0] - 1 <= row.start and row.stop - 1 <= ends[i][1]]
    return counts


def joined(clips, skeleton, rate=120, turn=0.4):
    """Clips, one after the other, and where each begins and ends."""
    parts, places, n = [], [], 0
    for x in clips:
        points = np.asarray(x, dtype=float).reshape(len(x), -1, 3)
        if parts:
            last = parts[-1][-1]
            parts.append(blended(last, turned(points[0], last, skeleton), round(turn * rate))[:-1])
            n += len(parts[-1])
        parts.append(points)
        places.append((n, n + len(points)))
        n += len(points)
    return np.concatenate(parts).reshape(n, -1), places


def among_actions(folder, n_actions, draws=24, jogs=False):
    """Takes of different single actions of a person, with a jog in the middle or none.

    Takes; called cyclic; with the jog found; stretches that are not half of the jog.
    """
    rng, counts = np.random.default_rng(n_actions), np.zeros(4, dtype=int)
    actions = {label: read(folder, "hdm05", label) for label in SINGLE["hdm05"]}
    bunch = read(folder, "hdm05", CYCLIC["hdm05"])
    for k in range(len(bunch.data) if jogs else draws):
        actor = bunch.actor[k] if jogs else rng.choice(np.unique(bunch.actor))
        labels = rng.choice(list(actions), n_actions, replace=False)
        clips = []
        for label in labels:
            own = np.flatnonzero(actions[label].actor == actor)
            clips.append(actions[label].data[rng.choice(own)])
        middle = n_actions // 2
        if jogs:
            clips.insert(middle, bunch.data[k])
        take, places = joined(clips, bunch.skeleton)
        (row,) = CycleSegmenter(bunch.skeleton).report([take]).itertuples()
        first, last = places[middle] if jogs else (0, 0)
        shares = [
            max(min(stop, last) - max(start, first), 0) / (stop - start)
            for start, stop in row.stretches
        ]
        good = [share > 0.5 for share in shares]
        counts += [1, row.cyclic, any(good), len(good) - sum(good)]
    return counts


def gestures(folder):
    """Of clips of a gesture, how many are cyclic; of its labels in takes, how many are found."""
    file = np.load(f"{folder}/utkinect/utkinect_takes.npz")
    bunch = load_performances(f"{folder}/utkinect/utkinect_takes.npz")
    stretches = CycleSegmenter(bunch.skeleton).report(bunch.data)["stretches"].tolist()
    labels = [file[f"segment_{name}"].tolist() for name in ("take", "label", "start", "stop")]
    found, n_labels, right = {}, {}, set()
    numbers = {take: k for k, take in enumerate(dict.fromkeys(labels[0]))}
    for take, label, first, last in zip(*labels, strict=True):
        n_labels[label] = n_labels.get(label, 0) + 1
        for start, stop in stretches[numbers[take]]:
            if min(stop, last) - max(start, first) > 0.5 * (stop - start):
                found[label] = found.get(label, 0) + 1
                right.add((numbers[take], start))
                break
    for label in ("walk", *GESTURES):
        clips = read(folder, "utkinect", label)
        report = CycleSegmenter(clips.skeleton).report(clips.data)
        yield label, len(report), int(report["cyclic"].sum()), n_labels[label], found.get(label, 0)
    others = sum(n for label, n in found.items() if label not in ("walk", *GESTURES))
    yield "elsewhere in takes", sum(map(len, stretches)) - len(right) + others


def exercises(folder):
    """Exercises that are done once: how many, and how many are called cyclic."""
    file = np.load(f"{folder}/uiprmd/uiprmd_odd_positions.npz")
    positions = file["positions"] - file["positions"].mean(axis=1, keepdims=True)
    takes = np.split(positions.reshape(len(positions), -1), file["offsets"][1:-1])
    return len(takes), int(CycleSegmenter().report(takes)["cyclic"].sum())


def noise(n_takes=10):
    """Takes of noise in few features, and how many are called cyclic."""
    rng, counts = np.random.default_rng(1), {}
    for n_features in (1, 2, 4, 20):
        for n_frames in (200, 1000):
            white = rng.normal(size=(n_takes, n_frames, n_features))
            walk = np.cumsum(rng.normal(size=white.shape), axis=1)
            for name, takes in (("white", white), ("random walk", walk)):
                called = CycleSegmenter().report(list(takes))["cyclic"].sum()
                counts[name, n_features] = counts.get((name, n_features), 0) + called
    return counts


def main():
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("data", help="folder of hdm05, cmu07_walk, utkinect and uiprmd")
    folder = parser.parse_args().data
    every = list(walks(folder))
    print(
        "standing            walks  cyclic  period right  cycles  inside   cuts inside  stretches"
    )

    def line(name, counts):
        cyclic, right, n, inside, cuts, good, stretches = counts
        print(
            f"  {name:18}{len(every):5d}{cyclic:8d}{right:14d}{n:8d}{inside:8d}"
            f"{100 * good / max(cuts, 1):12.1f} %{stretches:10d}"
        )

    for kind in KINDS:
        for factor in FACTORS if kind == "freeze" else FACTORS[1:]:
            line(f"{factor} x, {kind}", standing(every, factor, kind))
    for rate in RATES:
        for kind in KINDS[1:]:
            line(f"2 x, {kind}, {rate} Hz", standing(every, 2, kind, rate))
    print("\nmake_gait           takes  cyclic  cycles  inside")
    for factor in FACTORS:
        for kind in ("freeze", "noise"):
            print(f"  {factor} x, {kind:13}" + "".join(f"{n:8d}" for n in gaits(factor, kind)))
    print("\njoined single actions     takes  cyclic  jog found  other stretches")
    for n_actions in (2, 3, 4, 5):
        for jogs in (False, True):
            counts = among_actions(folder, n_actions, jogs=jogs)
            name = f"{n_actions} actions{' and a jog' if jogs else ''}"
            print(f"  {name:22}" + "".join(f"{n:8d}" for n in counts))
    print("\nutkinect               clips  cyclic  in takes  found")
    for name, *counts in gestures(folder):
        print(f"  {name:18}" + "".join(f"{n:8d}" for n in counts))
    print(f"\nexercises done once, and called cyclic: {exercises(folder)}")
    print("\nnoise of so many features: called cyclic of 20")
    for (name, n_features), called in noise().items():
        print(f"  {name:12}{n_features:4d}{called:6d}")


if __name__ == "__main__":
    main()
