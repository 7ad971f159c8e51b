"""Cycles of real people: their period against foot geometry, and where a recording repeats.

    python benchmarks/cycles.py DATA_FOLDER [single] [several] [standing]
        [counts] [joined] [gestures]

A foot strikes where its ankle is farthest ahead of the pelvis, seen along the hips; such
a maximum stands out by 0.3 of the whole swing. A step is the time from one strike to the next, of
either foot. A period is held against twice the median step: the jogs begin from standing, and their
first stride is longer. *Single* actions are not to be cyclic.

*Several* cycles fit where every second or fourth repetition differs: exercises of UI-PRMD, chained
from repetitions of one person, some of them done wrong. A period is right within 10 % of the mean
repetition of its stretch, or of two or four where one in so many is wrong. Elsewhere right periods
that are warned of are false alarms.

*Standing*: walks and jogs have so many times as much standing around them, half of it before, half
behind. ``freeze`` repeats the first and the last frame. ``sway`` turns within half a second to a
pose of standing and back, and sways by 1 cm, below about 1 Hz, with 1 mm of noise. ``noise`` has
1 cm of white noise in all joints as well. A cycle is inside if it begins and ends within the walk;
a cut is inside alike. *Counts*: three, five or eight repetitions of a person, done right, are
joined, ten frames between them, and a segmenter that learnt from other people counts them.
Exercises of UI-PRMD and jumping jacks of Kinder-Gator, which stand around and are counted by the
wrists, were looked at when the numbers of the decoder were chosen, those of IntelliRehabDS were
not. *Joined* are single actions, with a jog in the middle. A *gesture* in a long take is found if
more than half of a stretch lies within its label. Prints Markdown.
"""

import copy
import functools
from pathlib import Path

import numpy as np
from exercises import read_positions, read_rehabilitation
from harness import at_frames, command_line, print_head, print_row, run_tables, vertex
from scipy.ndimage import gaussian_filter1d
from scipy.signal import find_peaks
from sklearn_motionsync import DirectionCosines
from sklearn_motionsync.datasets import load_trials
from sklearn_motionsync.takes import CycleSegmenter

CYCLIC = {"cmu07_walk": "walk", "hdm05": "jogLeftCircle4StepsRstart"}
SINGLE = {
    "hdm05": (
        "depositFloorR",
        "grabHighR",
        "hopBothLegs1hops",
        "elbowToKnee1RepsLelbowStart",
        "sneak2StepsLStart",
    ),
    "utkinect": ("sitDown", "standUp", "pickUp", "throw", "push", "pull"),
}
# Standard deviation, in seconds, of the filter before maxima are looked for; least time between.
SMOOTHING, APART = 0.02, 0.3
# Of so many repetitions in a chain every so many is one done wrong; 0 is none.
CHAIN, EVERY, DRAWS = 12, (0, 2, 4), 3
GESTURES = ("waveHands", "clapHands")
# Repetitions of a take that is joined, and frames from one to the next.
COUNTS, BETWEEN = (3, 5, 8), 10
# Seconds of the turn to a pose of standing, and of the filter of the sway; sway and noise in m.
TURN, SLOW, SWAY, NOISE = 0.5, 0.25, 0.01, 0.001


# -- cycles -----------------------------------------------------------------------------


def read(folder, archive, label):
    """The takes of an action: positions, actors, frames a second, skeleton."""
    bunch = copy.copy(_load(Path(folder) / archive / f"{archive}_positions.npz"))
    # Of fewer than 8 frames nothing can be said.
    chosen = [i for i in np.flatnonzero(bunch.target == label) if len(bunch.data[i]) >= 8]
    bunch.data = [bunch.data[i] for i in chosen]
    bunch.actor, bunch.take = bunch.actor[chosen], bunch.take[chosen]
    bunch.frame_rate = bunch.frame_rate[chosen]
    return bunch


@functools.cache
def _load(path):
    return load_trials(path)


def foot_strikes(positions, skeleton, frame_rate):
    """Frames, with fractions, in which the left and the right ankle are farthest ahead."""
    points = np.asarray(positions, dtype=float).reshape(len(positions), -1, 3)

    def at(landmark):
        return points[:, skeleton.index_of(landmark)]

    across = (at("left_hip") - at("right_hip")) * [1, 0, 1]
    forward = np.cross(across, [0, 1, 0])
    forward /= np.linalg.norm(forward, axis=1, keepdims=True)
    strikes = []
    for side in ("left", "right"):
        ahead = ((at(f"{side}_ankle") - at("pelvis")) * forward).sum(axis=1)
        ahead = gaussian_filter1d(ahead, SMOOTHING * frame_rate, mode="nearest")
        apart = max(1, int(APART * frame_rate))
        k, _ = find_peaks(ahead, prominence=0.3 * np.ptp(ahead), distance=apart)
        strikes.append(np.array([vertex(ahead, frame) for frame in k]))
    return strikes


def period_of_strikes(x, skeleton, frame_rate):
    """Twice the median step, in frames."""
    return 2 * np.median(np.diff(np.sort(np.concatenate(foot_strikes(x, skeleton, frame_rate)))))


def read_exercises(folder):
    """The archive of UI-PRMD, and its trials about the mean of the markers."""
    file = np.load(Path(folder) / "uiprmd" / "uiprmd_odd_positions.npz")
    positions = file["positions"] - file["positions"].mean(axis=1, keepdims=True)
    return file, np.split(positions.reshape(len(positions), -1), file["offsets"][1:-1])


def chains(folder, every):
    """Repetitions of a person and an exercise, one after the other, and where each begins."""
    file, parts = read_exercises(folder)
    rng = np.random.default_rng(0)
    for label in np.unique(file["label"]):
        for actor in np.unique(file["actor"]):
            own = (file["label"] == label) & (file["actor"] == actor)
            right, wrong = (np.flatnonzero(own & (file["correct"] == k)) for k in (True, False))
            if len(right) < 8 or len(wrong) < 5:
                continue
            for _ in range(DRAWS):
                good, bad = (np.resize(rng.permutation(k), CHAIN) for k in (right, wrong))
                chosen = [bad[k] if every and k % every == 0 else good[k] for k in range(CHAIN)]
                chain = [parts[k] for k in chosen]
                yield np.concatenate(chain), np.cumsum([0, *map(len, chain)])


def several_fit(pairs, segmenter=None, every=0):
    """Of cyclic takes: how many periods are right, warned of; not right, and warned of.

    ``pairs`` are takes and their periods, or where repetitions begin: then the period of the
    longest stretch is held against the mean of the repetitions in it, and against ``every`` times
    that.
    """
    takes, expected = zip(*pairs, strict=True)
    report = (segmenter or CycleSegmenter()).report(list(takes))
    right = np.zeros(len(report), dtype=bool)
    for i, (row, known) in enumerate(zip(report.itertuples(), expected, strict=True)):
        if np.ndim(known):
            start, stop = max(row.stretches, key=lambda ends: ends[1] - ends[0], default=(0, 0))
            middles = (known[1:] + known[:-1]) / 2
            inside = (start <= middles) & (middles < stop)
            known = np.diff(known)[inside].mean() if inside.any() else np.nan
        right[i] = any(abs(row.period / (known * k) - 1) < 0.1 for k in {1, every or 1})
    warned, cyclic = report["periods"].map(len) > 1, report["cyclic"]
    return [int((cyclic & k & w).sum()) for k in (right, ~right) for w in (True, warned)]


def warnings_of(folder):
    """Names of sets of takes, and what `several_fit` counts."""
    for names in CYCLIC.items():
        bunch = read(folder, *names)
        segmenter = CycleSegmenter(bunch.skeleton)
        periods = segmenter.report(bunch.data)["period"]
        yield names[1], several_fit(zip(bunch.data, periods, strict=True), segmenter)
    for every in EVERY:
        name = f"exercises, 1 of {every} wrong" if every else "exercises, none wrong"
        yield name, several_fit(chains(folder, every), every=every)


# -- standing, and other actions --------------------------------------------------------


def turned(points, angles):
    """Points (n_frames, n, 3) turned about the vertical."""
    c, s = np.cos(angles)[:, np.newaxis], np.sin(angles)[:, np.newaxis]
    x, y, z = np.moveaxis(points, 2, 0)
    return np.stack([c * x + s * z, y, c * z - s * x], axis=2)


def placed_on(pose, other, skeleton):
    """A pose, turned and shifted so that its pelvis and hips are those of another."""
    hips = [skeleton.index_of(f"{side}_hip") for side in ("left", "right")]
    pelvis = skeleton.index_of("pelvis")
    across = [x[hips[0]] - x[hips[1]] for x in (pose, other)]
    angle = np.subtract(*(np.arctan2(x[2], x[0]) for x in across[::-1]))
    return turned(pose[np.newaxis] - pose[pelvis], -angle[np.newaxis])[0] + other[pelvis]


def blended(start, end, n):
    """Poses from one to another, the first excluded, at rest at both."""
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
            pose = placed_on(walk["pose"], end, walk["skeleton"])
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
    """Walks and jogs, each with a pose of standing, and the unit of a metre."""
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
                "period": period_of_strikes(x, bunch.skeleton, rate),
            }


def standing(every, factor, kind, rate=None, seed=0):
    """Counts of walks: cyclic, right periods; of cycles, inside; of cuts, inside; of stretches."""
    rng, counts = np.random.default_rng(seed), np.zeros(7, dtype=int)
    for label in CYCLIC.values():
        own = [walk for walk in every if walk["label"] == label]
        takes, ends, periods = [], [], []
        for walk in own:
            take, place = with_standing(walk, factor, kind, rng)
            step = 1 if rate is None else walk["rate"] / rate
            frames = np.arange(0, len(take) - 1, step)
            takes.append(take if rate is None else at_frames(take, frames))
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


def joined(clips, skeleton, rate=120, turn=0.4):
    """Clips, one after the other, and where each begins and ends."""
    parts, places, n = [], [], 0
    for x in clips:
        points = np.asarray(x, dtype=float).reshape(len(x), -1, 3)
        if parts:
            last = parts[-1][-1]
            pose = placed_on(points[0], last, skeleton)
            parts.append(blended(last, pose, round(turn * rate))[:-1])
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
    bunch = load_trials(f"{folder}/utkinect/utkinect_takes.npz")
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


# -- counts -----------------------------------------------------------------------------


def repetitions(trials, table):
    """Of every exercise: its name, joined takes, their people, and their counts."""
    right = table["correct"] & np.array([np.isfinite(x).all() for x in trials])
    for name, rows in table[right].groupby("label"):
        takes, people, counts, rng = [], [], [], np.random.default_rng(0)
        for person, own in rows.groupby("actor").groups.items():
            for count in COUNTS:
                if len(own) >= count:
                    chosen = [trials[i] for i in rng.choice(own, count, replace=False)]
                    parts = [chosen[0]]
                    for x in chosen[1:]:
                        turn = blended(parts[-1][-1][np.newaxis], x[:1], BETWEEN)
                        parts += [turn[:-1, 0], x]
                    takes.append(np.concatenate(parts))
                    people.append(person)
                    counts.append(count)
        yield name, takes, np.array(people), np.array(counts)


def jumping_jacks(folder):
    """Takes, people, and how often both wrists are highest."""
    bunch = load_trials(Path(folder) / "kinder_gator" / "kinder_gator_even.npz")
    wanted = np.flatnonzero(np.asarray(bunch.target) == "Do-two-jumping-jacks")
    wrists = [list(bunch.joints).index(f"Wrist{side}") for side in ("Left", "Right")]
    takes, counts = [bunch.data[i] for i in wanted], []
    for x in takes:
        heights = gaussian_filter1d(x.reshape(len(x), -1, 3)[:, wrists, 1].mean(axis=1), 1.5)
        peaks, _ = find_peaks(heights, prominence=0.35 * np.ptp(heights), distance=8)
        counts.append(len(peaks))
    takes = DirectionCosines(bunch.skeleton).fit_transform(takes)
    return takes, np.asarray(bunch.actor)[wanted], np.array(counts)


def counted(takes, people, counts):
    """Of takes: how many; counted right by a segmenter that knows other people, and by its report
    to the nearest whole number; repetitions that are found, and that are there.
    """
    whole, spans = np.zeros((2, len(takes)))
    for fold in np.array_split(np.unique(people), 5):
        held = np.isin(people, fold)
        known = [x for x, left_out in zip(takes, held, strict=True) if not left_out]
        segmenter = CycleSegmenter(not_cyclic="skip").fit(known)
        for i in np.flatnonzero(held):
            whole[i] = len(segmenter.segment([takes[i]])[0])
            spans[i] = segmenter.report([takes[i]])["n_cycles"].iloc[0]
    right = [(whole == counts).sum(), (np.round(spans) == counts).sum()]
    return map(str, [len(takes), *right, int(whole.sum()), counts.sum()])


# -- tables -----------------------------------------------------------------------------


def single_table(folder):
    print_head("not to be cyclic", ["takes", "called cyclic", "highest strength"])
    for archive, labels in SINGLE.items():
        for label in labels:
            bunch = read(folder, archive, label)
            report = CycleSegmenter(bunch.skeleton).report(bunch.data)
            counts = [len(report), report["cyclic"].sum()]
            print_row(label, [*map(str, counts), f"{report['strength'].max():.2f}"])
    report = CycleSegmenter().report(read_exercises(folder)[1])
    print_row("exercises", [str(len(report)), str(report["cyclic"].sum()), ""])


def several_table(folder):
    columns = ["period right, warned of", "not warned of", "not right, warned of", "not warned of"]
    print_head("several cycles fit", columns)
    for name, counts in warnings_of(folder):
        print_row(name, map(str, counts))


def standing_table(folder):
    every = list(walks(folder))
    columns = ["cyclic", "period right", "cycles", "inside", "cuts", "cuts inside", "stretches"]
    print_head(f"standing, {len(every)} walks", columns)
    cases = [
        (factor, kind, None) for kind in ("freeze", "sway", "noise") for factor in (0, 1, 2, 4)
    ]
    cases += [(2, kind, rate) for rate in (120, 60, 30, 25) for kind in ("sway", "noise")]
    for factor, kind, rate in cases:
        name = f"{factor} x, {kind}" + (f", {rate} Hz" if rate else "")
        print_row(name, map(str, standing(every, factor, kind, rate)))


def count_table(folder):
    head = ["takes", "counted right", "by the report", "repetitions found", "there"]
    print_head("counts", head)
    print_row("jumping jacks", counted(*jumping_jacks(folder)))
    for read_trials in (read_positions, read_rehabilitation):
        trials, table, skeleton = read_trials(folder)
        trials = DirectionCosines(skeleton, hidden="nan").fit_transform(trials)
        for name, *takes in repetitions(trials, table):
            print_row(name, counted(*takes))


def joined_table(folder):
    print_head("joined single actions", ["takes", "cyclic", "jog found", "other stretches"])
    for n_actions in (2, 3, 4, 5):
        for jogs in (False, True):
            counts = among_actions(folder, n_actions, jogs=jogs)
            print_row(f"{n_actions} actions{' and a jog' if jogs else ''}", map(str, counts))


def gesture_table(folder):
    print_head("utkinect", ["clips", "cyclic", "in takes", "found"])
    for name, *counts in gestures(folder):
        print_row(name, [*map(str, counts), *[""] * (4 - len(counts))])


TABLES = {
    "single": single_table,
    "several": several_table,
    "standing": standing_table,
    "counts": count_table,
    "joined": joined_table,
    "gestures": gesture_table,
}

if __name__ == "__main__":
    run_tables(TABLES, command_line(__doc__))
