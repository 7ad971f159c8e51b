"""Cycles of real people: their period against foot geometry, what is not cyclic, foot strikes.

    python benchmarks/cycles.py DATA_FOLDER

A foot strikes where its ankle is farthest ahead of the pelvis, seen along the hips; such a maximum
stands out by 0.3 of the whole swing. A step is the time from one strike to the next, of either
foot; a stride that to the next of the same foot. A period is held against twice the median step:
the jogs begin from standing, and their first stride is longer. The mean stride is shown beside.
Deviations of foot strikes are those of their phases from the mean phase of the foot, in hundredths
of a cycle, within takes and within all takes of an action, of strikes within the stretches that
repeat. Takes are cut by what was learnt from
other actors or, where there is one actor, from the other takes.

Several cycles fit where every second or fourth repetition differs: exercises of UI-PRMD, chained
from repetitions of one person, some of them done wrong. A period is right within 10 % of the mean
repetition of its stretch, or of two or four where one in so many is wrong. Elsewhere right periods
that are warned of are false alarms, as for walks and jogs, whole, and for their single limbs, whose
period is that of the whole body.

A cut is right if it holds 0.7 to 1.3 repetitions, from foot strike to foot strike or along a chain.
Its length is a share of the period of its take. Takes in which several cycles fit are left out:
they have their own warning. In shallow chains the last but one repetitions have a part of their
size, and the path of the phase may stand still through them.
"""

import argparse
import copy
import functools
import warnings
from pathlib import Path

import numpy as np
from scipy.ndimage import gaussian_filter1d
from scipy.signal import find_peaks
from sklearn.model_selection import LeaveOneGroupOut
from sklearn_motionsync import CycleSegmenter, DirectionCosines
from sklearn_motionsync.datasets import load_performances, make_gait

CYCLIC = {"cmu07_walk": "walk", "hdm05": "jogLeftCircle4StepsRstart"}
ONE_CYCLE = "sneak2StepsLStart"
SINGLE = {
    "hdm05": (
        "depositFloorR",
        "grabHighR",
        "hopBothLegs1hops",
        "elbowToKnee1RepsLelbowStart",
        ONE_CYCLE,
    ),
    "utkinect": ("sitDown", "standUp", "pickUp", "throw", "push", "pull"),
}
# Standard deviation, in seconds, of the filter before maxima are looked for; least time between.
SMOOTHING, APART = 0.02, 0.3
# Of so many repetitions in a chain every so many is one done wrong; 0 is none.
CHAIN, EVERY, DRAWS = 12, (0, 2, 4), 3
# Sizes of the shallow repetitions of a chain, and how many there are before the last one.
SHALLOW, N_SHALLOW = (1, 0.4, 0.2), 2
# A cut holds one repetition if it holds so much more or less of one.
RIGHT = 0.3


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
    return load_performances(path)


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
        before, here, after = ahead[k - 1], ahead[k], ahead[k + 1]
        strikes.append(k + (before - after) / (2 * (before - 2 * here + after)))
    return strikes


def references(strikes):
    """Twice the median step, and the mean stride, in frames."""
    steps = np.diff(np.sort(np.concatenate(strikes)))
    return 2 * np.median(steps), np.concatenate([np.diff(s) for s in strikes]).mean()


def deviations(phases, strikes):
    """Mean deviations of the phases of foot strikes, in hundredths of a cycle: within takes, all.

    Parameters
    ----------
    phases : list of ndarray (n_frames_i,)
    strikes : list of [left, right]
    """
    found = []
    for p, of_take in zip(phases, strikes, strict=True):
        at = [np.interp(s, np.arange(len(p)), p) for s in of_take]
        found.append([k[np.isfinite(k)] for k in at])
    within = [around(foot) for of_take in found for foot in of_take if len(foot) > 1]
    whole = [around(np.concatenate(of_foot)) for of_foot in zip(*found, strict=True)]
    return [100 * np.abs(np.concatenate(d)).mean() for d in (within, whole)]


def around(phases):
    """Deviations from the mean direction of phases."""
    mean = np.angle(np.exp(2j * np.pi * phases).mean()) / (2 * np.pi)
    return (phases - mean + 0.5) % 1 - 0.5


def phases_of_others(bunch, **params):
    """Phases of every take, by a segmenter that knows the takes of other people only."""
    groups = bunch.actor if len(set(bunch.actor)) > 1 else bunch.take
    out = [None] * len(bunch.data)
    for train, test in LeaveOneGroupOut().split(bunch.data, groups=groups):
        # Which foot is farther ahead depends on who is left out.
        segmenter = CycleSegmenter(bunch.skeleton, start="right", **params)
        segmenter.fit([bunch.data[i] for i in train])
        for i, phases in zip(test, segmenter.phases([bunch.data[i] for i in test]), strict=True):
            out[i] = phases
    return out


def limbs(bunch):
    """Single limbs of takes, in directions, and the periods of the whole bodies."""
    periods = CycleSegmenter(bunch.skeleton).report(bunch.data)["period"]
    cosines = DirectionCosines(bunch.skeleton).fit_transform(bunch.data)
    for x, period in zip(cosines, periods, strict=True):
        for k in range(0, x.shape[1] - 2, 3):
            yield x[:, k : k + 3], period


def chains(folder, every):
    """Repetitions of a person and an exercise, one after the other, and where each begins."""
    for chain in _repetitions(folder, every):
        yield np.concatenate(chain), np.cumsum([0, *map(len, chain)])


def _repetitions(folder, every):
    file = np.load(Path(folder) / "uiprmd" / "uiprmd_odd_positions.npz")
    positions = file["positions"] - file["positions"].mean(axis=1, keepdims=True)
    parts = np.split(positions.reshape(len(positions), -1), file["offsets"][1:-1])
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
                yield [parts[k] for k in chosen]


def shallow_chains(folder, size):
    """Chains whose last but one repetitions are shallow, and the frames at which each begins."""
    for chain in _repetitions(folder, 0):
        for k in range(CHAIN - 1 - N_SHALLOW, CHAIN - 1):
            x = chain[k]
            line = np.linspace(x[0], x[-1], len(x))
            chain[k] = line + size * (x - line)
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
        yield "  single limbs", several_fit(limbs(bunch))
    for every in EVERY:
        name = f"exercises, 1 of {every} wrong" if every else "exercises, none wrong"
        yield name, several_fit(chains(folder, every), every=every)


def lengths(triples):
    """Shares of the period that right cuts have, and counts of takes: right, warned; wrong, warned.

    Parameters
    ----------
    triples : iterable of (take, frames at which its repetitions begin, segmenter)
    """
    shares, counts = [], np.zeros((2, 2), dtype=int)
    for take, begins, segmenter in triples:
        (row,) = segmenter.report([take]).itertuples()
        if not row.cyclic or len(row.periods) > 1 or len(begins) < 2:
            continue
        with warnings.catch_warnings(record=True) as caught:
            warnings.simplefilter("always")
            table = segmenter.fit([take]).segment([take])[1]
        first, last = table["start"].to_numpy(), table["stop"].to_numpy() - 1
        # Before the first repetition that is known, and after the last, at the mean pace.
        begins = [begins[0] - row.period, *begins, begins[-1] + row.period]
        held = np.subtract(*(np.interp(k, begins, np.arange(len(begins))) for k in (last, first)))
        inside = (first >= begins[0]) & (last <= begins[-1])
        right = np.abs(held - 1) < RIGHT
        shares += ((last - first) / row.period)[inside & right].tolist()
        counts[int(not right[inside].all())] += [1, any("whole cycles" in str(w) for w in caught)]
    return shares, counts.ravel().tolist()


def warnings_of_lengths(folder, seeds=8, sizes=SHALLOW):
    """Names of sets of takes, and what `lengths` gives."""
    gait = [make_gait(6, n_cycles=6, takes=True, random_state=seed) for seed in range(seeds)]
    takes = [(x, np.linspace(0, len(x), 7)) for bunch in gait for x in bunch.data]
    yield "make_gait", lengths((x, begins, CycleSegmenter(start=0)) for x, begins in takes)
    for names in CYCLIC.items():
        bunch = read(folder, *names)
        pairs = list(zip(bunch.data, bunch.frame_rate, strict=True))
        yield (
            names[1],
            lengths(
                (x, begins, CycleSegmenter(bunch.skeleton, start=side))
                for x, rate in pairs
                for side, begins in zip(
                    ("left", "right"), foot_strikes(x, bunch.skeleton, rate), strict=True
                )
            ),
        )
    for size in sizes:
        pairs = shallow_chains(folder, size)
        name = "exercises" if size == 1 else f"exercises, {N_SHALLOW} of size {size}"
        yield name, lengths((x, begins, CycleSegmenter()) for x, begins in pairs)


def main():
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("data", help="folder of hdm05, cmu07_walk and utkinect")
    folder = parser.parse_args().data
    inside = {"steps": [], "strides": []}
    for archive, label in CYCLIC.items():
        bunch = read(folder, archive, label)
        report = CycleSegmenter(bunch.skeleton).report(bunch.data)
        print(f"{label}\n  actor   frames  period  strength  cycles  error: steps  strides (%)")
        strikes = []
        for x, rate, actor, row in zip(
            bunch.data, bunch.frame_rate, bunch.actor, report.itertuples(), strict=True
        ):
            strikes.append(foot_strikes(x, bunch.skeleton, rate))
            errors = [100 * (row.period / period - 1) for period in references(strikes[-1])]
            for name, error in zip(inside, errors, strict=True):
                inside[name].append(row.cyclic and abs(error) <= 5)
            print(
                f"  {actor:6} {row.n_frames:7d} {row.period:7.1f} {row.strength:9.2f}"
                f" {row.n_cycles:7.2f} {errors[0]:13.1f} {errors[1]:8.1f}"
            )
        print("  deviation of foot strikes:    within takes   all takes (hundredths of a cycle)")
        found = {}
        for refine in (False, True):
            found[refine] = deviations(phases_of_others(bunch, refine=refine), strikes)
            name = "circular matching" if refine else "constant period"
            print(f"    {name:20} {found[refine][0]:18.2f} {found[refine][1]:11.2f}")
        ratio = np.divide(found[True], found[False])
        print(f"    {'ratio':20} {ratio[0]:18.2f} {ratio[1]:11.2f}")
    for name, good in inside.items():
        print(f"period within 5 % by {name}: {sum(good)} of {len(good)}")
    print("\nnot to be cyclic                takes  called cyclic  highest strength")
    for archive, labels in SINGLE.items():
        for label in labels:
            bunch = read(folder, archive, label)
            report = CycleSegmenter(bunch.skeleton).report(bunch.data)
            called, strongest = report["cyclic"].sum(), report["strength"].max()
            print(f"  {label:30} {len(report):4d} {called:14d} {strongest:17.2f}")
    print("\nseveral cycles fit         period right, warned of; not right, warned of")
    for name, counts in warnings_of(folder):
        print(f"  {name:28}" + "".join(f"{count:8d}" for count in counts))
    print(
        "\nlengths of cycles    right cuts: number, shares of the period; takes right, warned of;"
    )
    print("                     takes with wrong cuts, warned of")
    for name, (shares, counts) in warnings_of_lengths(folder):
        print(f"  {name:28}{len(shares):6d} {min(shares):6.2f} {max(shares):6.2f}", end="")
        print("".join(f"{count:8d}" for count in counts))


if __name__ == "__main__":
    main()
