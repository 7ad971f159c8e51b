"""How sure a warp is: the coverage of `Match.interval`, and whom `Match.doubtful` names.

    pip install .
    python benchmarks/intervals.py DATA_FOLDER

The key moments of harness.py, on people that had no part in the fit; the moment of the pattern is to
lie inside the interval of each clip. Then trials that are wrong (repeated, cut off, backwards, held
still, of another action) among trials that are right, known warps, what departures and bands make
of intervals, and the time they take. Prints Markdown.
"""

import sys
import time
import warnings
from functools import partial

import numpy as np
from accuracy import CELLS, known_warps
from harness import EVENTS, THROW, P, fewer_clips, read_people
from joblib import Parallel, delayed
from scipy.stats import spearmanr
from sklearn.model_selection import GroupKFold
from sklearn.pipeline import make_pipeline
from sklearn_motionsync import (
    ActionModel,
    ASpace,
    DenseSynchronizer,
    DirectionCosines,
    find_departures,
)
from sklearn_motionsync.datasets import make_bending

NOMINAL = (0.8, 0.9, 0.95)
FEWEST = 20


# -- people held out --------------------------------------------------------------------


def judge(one):
    """Errors, half-widths, whether each interval holds its moment, by event; doubts by clip.

    Errors are absolute, in frames of 100.
    """
    warnings.simplefilter("ignore")
    found = {event: [] for event in one.moments}
    for row, test, match in one.matches_of_strangers(partial(DenseSynchronizer, P)):
        n = one.patterns[row]
        bounds, doubtful = [match.interval(c) for c in NOMINAL], match.doubtful
        for event, at in one.moments.items():
            for j, i in enumerate(test):
                if np.isfinite(at[n] + at[i]):
                    read = partial(np.interp, at[n], np.arange(P))
                    held = [read(low[j]) <= at[i] <= read(high[j]) for low, high in bounds]
                    low, high = bounds[1]
                    width = (read(high[j]) - read(low[j])) / 2
                    error = abs(read(match.times[j]) - at[i])
                    found[event].append((error, width, doubtful[j], *held))
    return {event: np.array(rows, dtype=float) for event, rows in found.items() if rows}


def rank_correlation(events):
    """Mean over events of Spearman's correlation of half-width and error, inside the event."""
    several = [rows for rows in events if len(rows) >= FEWEST]
    return np.mean([spearmanr(rows[:, 1], rows[:, 0])[0] for rows in several])


def people_table(people):
    """Coverage of each action, and of all pairs."""
    done = Parallel(n_jobs=-1)(delayed(judge)(one) for one in people)
    print("| people held out | pairs | mean error | half-width of 90 % | 80 % | 90 % | 95 % |")
    print("|---|---|---|---|---|---|---|")
    for one, events in zip(people, done, strict=True):
        show(f"{one.archive}: `{one.name}`", np.concatenate(list(events.values())))
    events = [rows for some in done for rows in some.values()]
    rows = np.concatenate(events)
    show("**all**", rows)
    equal = np.mean([row.mean(axis=0) for row in events], axis=0)
    print(f"| each event alike | {len(events)} events | " + cells(equal) + " |")
    print(f"\nA constant half-width of 90 %: {np.quantile(rows[:, 0], 0.9):.1f} frames.")
    overall = spearmanr(rows[:, 1], rows[:, 0])[0]
    print(f"Spearman over all {overall:.2f}, inside an event {rank_correlation(events):.2f}.")
    means = [rows[rows[:, 2] == d, 0].mean() for d in (0, 1)]
    print(f"Mean error {means[0]:.1f} frames, of doubtful trials {means[1]:.1f}.")
    parts = np.array_split(rows[np.argsort(rows[:, 1])], 4)
    quarters = " ".join(f"{part[:, 0].mean():.1f}" for part in parts)
    print(f"Mean errors by quarter of half-width: {quarters}.\n", flush=True)
    return done


def show(name, rows):
    print(f"| {name} | {len(rows)} | " + cells(rows.mean(axis=0)) + " |")


def cells(means, digits=1):
    error, width, _, *held = means
    return " | ".join([f"{x:.{digits}f}" for x in (error, width)] + [f"{h:.0%}" for h in held])


def constants_table(people, done):
    """By what half-widths would have to be multiplied, and the coverage elsewhere with that."""
    archives = sorted({one.archive for one in people})
    print("| fitted on | half-widths times | coverage there | on the others |\n|---|---|---|---|")
    for archive in archives:
        own, others = [], []
        for one, events in zip(people, done, strict=True):
            (own if one.archive == archive else others).extend(events.values())
        ratios = np.concatenate([rows[:, 0] / np.maximum(rows[:, 1], 1e-9) for rows in own])
        factor = np.quantile(ratios, 0.9)
        shares = [
            np.mean(np.concatenate([rows[:, 0] <= factor * rows[:, 1] for rows in some]))
            for some in (own, others)
        ]
        print(f"| {archive} | {factor:.2f} | {shares[0]:.2f} | {shares[1]:.2f} |")
    print(flush=True)


# -- doubtful trials --------------------------------------------------------------------

WRONG = {
    "as recorded": lambda x: x,
    "repeated": lambda x: np.concatenate([x, x]),
    "the first half": lambda x: x[: max(2, len(x) // 2)],
    "backwards": lambda x: x[::-1],
    "held still": lambda x: x[:1] + 1e-3 * np.sin(np.arange(30.0))[:, np.newaxis],
}


OTHER = "another action"


def doubts(one, others):
    """Shares of doubtful trials of people held out, by what was done to them.

    ``others`` are the actions of the same archive; of those the same people's trials are tried.
    """
    warnings.simplefilter("ignore")
    shares, is_weak = {kind: [] for kind in [*WRONG, OTHER]}, []
    folds = GroupKFold(min(4, len(set(one.actors))))
    for train, test in folds.split(one.X, groups=one.actors):
        space = ASpace().fit([one.postures[i] for i in train])
        points = space.transform(one.postures)
        sync = DenseSynchronizer(P).fit([points[i] for i in train])
        is_weak.append(sync.evidence_.weak)
        for kind, change in WRONG.items():
            shares[kind].extend(sync.match([change(points[i]) for i in test]).doubtful)
        people = set(one.actors[test])
        wrong = [
            x
            for other in others
            for x, a in zip(other.postures, other.actors, strict=True)
            if a in people
        ]
        if wrong:
            shares[OTHER].extend(sync.match(space.transform(wrong)).doubtful)
    return [np.mean(some) if some else np.nan for some in shares.values()], np.mean(is_weak)


def doubts_table(people):
    work = []
    for one in people:
        others = [x for x in people if x is not one and x.archive == one.archive]
        work.append(delayed(doubts)(one, others))
    done = Parallel(n_jobs=-1)(work)
    print("| doubtful, people held out | " + " | ".join([*WRONG, OTHER]) + " |")
    print("|---" * (2 + len(WRONG)) + "|")
    supported = []
    for one, (shares, weak) in zip(people, done, strict=True):
        supported += [shares] * bool(weak == 0)
        mark = " (not supported)" * bool(weak > 0)
        print(f"| {one.archive}: `{one.name}`{mark} | " + percent(shares) + " |")
    means = np.nanmean(supported, axis=0)
    print(f"| **mean of those supported** | {percent(means)} |\n", flush=True)


def percent(shares):
    return " | ".join("-" if np.isnan(share) else f"{share:.0%}" for share in shares)


def time_line_table(people):
    """The doubtful among all trials of a fit, and how far their moments lie from the median."""
    print("| one time line | trials | doubtful | their error | error of the others |")
    print("|---|---|---|---|---|")
    for one in people:
        match = DenseSynchronizer(P).fit(one.X).match(one.X)
        frames, errors = np.arange(P), []
        for at in one.moments.values():
            pairs = zip(at, match.times, strict=True)
            there = np.array([np.interp(m, t + 1e-7 * frames, frames) for m, t in pairs])
            errors.append(np.abs(there - np.nanmedian(there)))
        error, wrong = np.nanmean(errors, axis=0), match.doubtful
        means = [
            f"{np.nanmean(error[w]):.1f}" if np.isfinite(error[w]).any() else "-"
            for w in (wrong, ~wrong)
        ]
        print(f"| {one.archive}: `{one.name}` | {len(wrong)} | {wrong.sum()} | ", end="")
        print(" | ".join(means) + " |", flush=True)
    print()


# -- known warps ------------------------------------------------------------------------


def held(match, truth, rows):
    """Coverages, mean error and half-width of some rows, without the first and last frames."""
    some = slice(3, -3)
    true, out = truth[rows][:, some], []
    for nominal in NOMINAL:
        low, high = (bound[rows][:, some] for bound in match.interval(nominal))
        out.append(((low - 1e-9 <= true) & (true <= high + 1e-9)).mean())
    low, high = match.interval(0.9)
    width = (high - low)[rows].mean() / 2
    return [
        np.abs(match.times[rows] - truth[rows]).mean(),
        width,
        match.doubtful[rows].mean(),
        *out,
    ]


def known_table(seeds=range(6)):
    print("| known warps | refined | mean error | half-width of 90 % | 80 % | 90 % | 95 % |")
    print("|---|---|---|---|---|---|---|")
    for n_features in (1, 4, 16):
        for low, high, noise in CELLS:
            rows, refined = [], []
            for seed in seeds:
                X, truth = known_warps(seed, low, high, noise, n_features=n_features)
                sync = DenseSynchronizer(P, pattern=0).fit(X)
                rows.append(held(sync.match(X), truth, slice(1, None)))
                refined.append(sync.refines_)
            name = f"{n_features} features, rates {low}-{high}, noise {noise:.1%}"
            print(f"| {name} | {np.mean(refined):.0%} | {cells(np.mean(rows, axis=0), 2)} |")
    for noise in (0.002, 0.005, 0.01, 0.02, 0.05):
        rows, refined = [], []
        for seed in seeds:
            bunch = make_bending(20, noise=noise, random_state=seed)
            X = ASpace().fit_transform(DirectionCosines(bunch.skeleton).fit_transform(bunch.data))
            sync = DenseSynchronizer(P).fit(X)
            others = np.delete(np.arange(20), sync.pattern_index_)
            truth = warps_of_phases(bunch.times, sync.pattern_index_)
            rows.append(held(sync.match(X), truth, others))
            refined.append(sync.refines_)
        name = f"`make_bending(noise={noise})`"
        print(f"| {name} | {np.mean(refined):.0%} | {cells(np.mean(rows, axis=0), 2)} |")
    print(flush=True)


def warps_of_phases(phases, pattern):
    """When all trials show what one of them does, of the phase of each frame of each."""
    clocks = [np.linspace(0, P - 1, len(phase)) for phase in phases]
    at = np.interp(np.arange(P), clocks[pattern], phases[pattern])
    return np.array([np.interp(at, *pair) for pair in zip(phases, clocks, strict=True)])


# -- what uses them ---------------------------------------------------------------------


def departures_table(people, degrees=(20, 30, 40), random_state=0):
    """The share of departures that timing may explain: as recorded, and of limbs turned away.

    In every trial of people held out one of the twelve limbs is turned for 40 % of the time.
    """
    rng, found = np.random.default_rng(random_state), {angle: [] for angle in (0, *degrees)}
    for one in people:
        for train, test in GroupKFold(4).split(one.X, groups=one.actors):
            pipe = make_pipeline(ASpace(), DenseSynchronizer(P), ActionModel())
            known = [one.postures[i] for i in train]
            pipe.fit(known, actionmodel__groups=np.asarray(one.actors)[train])
            for angle, tables in found.items():
                turned = [turn(one.postures[i], angle, rng) for i in test]
                table = find_departures(pipe, [x for x, _ in turned])
                limbs = table["performance"].map(dict(enumerate(limb for _, limb in turned)))
                own = (table["feature"].str[1:].astype(int) - 1) // 3 == limbs.astype(int)
                tables.append(table["timing"][own] if angle else table["timing"])
    print("| departures, people held out | number | timing may explain |\n|---|---|---|")
    for angle, tables in found.items():
        timing = np.concatenate(tables).astype(float)
        name = f"of a limb turned by {angle} degrees" if angle else "as recorded"
        print(f"| {name} | {len(timing)} | {timing.mean():.0%} |")
    print(flush=True)


def turn(postures, degrees, rng):
    """Cosines of one limb, drawn at random, turned about a random axis; and the limb."""
    limb, start, out = int(rng.integers(12)), rng.uniform(0.1, 0.5), postures.copy()
    axis = rng.standard_normal(3)
    axis /= np.linalg.norm(axis)
    share = np.linspace(0, 1, len(out))
    there = np.clip(np.minimum(share - start, start + 0.4 - share) / 0.05, 0, 1)
    angle, own = np.deg2rad(degrees) * there[:, np.newaxis], slice(1 + 3 * limb, 4 + 3 * limb)
    x = out[:, own]
    along = (x @ axis)[:, np.newaxis] * axis
    out[:, own] = along + np.cos(angle) * (x - along) + np.sin(angle) * np.cross(axis, x)
    return out, limb


def bands_table(sizes=(8, 16, 40), n_fits=40):
    """How often a band of 95 % holds the mean of 400 made bends, by fits to some of them."""
    everybody = make_bending(400, random_state=0)
    postures = DirectionCosines(everybody.skeleton).fit_transform(everybody.data)
    pairs, shares = list(zip(postures, everybody.times, strict=True)), np.linspace(0, 1, P)
    mean = np.mean([at_phases(*pair, shares) for pair in pairs], axis=0)
    print("| mean inside a band of 95 %, bends | without | with the match | true warps |")
    print("|---|---|---|---|")
    for size in sizes:
        held_by = []
        for seed in range(n_fits):
            chosen = np.random.default_rng(seed).permutation(len(pairs))[:size]
            some = [pairs[i] for i in chosen]
            curves = [x for x, _ in some]
            points = ASpace().fit_transform(curves)
            sync = DenseSynchronizer(P).fit(points)
            match, phase = sync.match(points), some[sync.pattern_index_][1]
            at = np.interp(shares, np.linspace(0, 1, len(phase)), phase)
            target = at_phases(mean, shares, at)
            model = ActionModel().fit(match.warp(curves))
            true = ActionModel().fit([at_phases(*pair, at) for pair in some])
            bands = model.mean_envelope(), model.mean_envelope(match=match), true.mean_envelope()
            held_by.append([((low <= target) & (target <= high)).all() for low, high in bands])
        print(f"| {size} of 400 | {percent(np.mean(held_by, axis=0))} |", flush=True)
    print()


def at_phases(x, phase, at):
    """A trial with these phases of its frames, at other phases."""
    frames = np.interp(at, phase, np.arange(len(x)))
    return np.stack([np.interp(frames, np.arange(len(x)), column) for column in x.T], axis=1)


# -- time -------------------------------------------------------------------------------


def cost_table(people, repeats=15):
    """The interval of a match over the match itself: medians of ratios, side by side."""
    print("| time of `interval` over that of `match` | all trials | one trial |\n|---|---|---|")
    for one in people:
        sync = DenseSynchronizer(P).fit(one.X)
        shares = [np.median([ratio(sync, X) for _ in range(repeats)]) for X in (one.X, one.X[:1])]
        print(f"| `{one.name}`, {len(one.X)} trials | {shares[0]:.2f} | {shares[1]:.2f} |")


def ratio(sync, X):
    start = time.perf_counter()
    match = sync.match(X)
    matched = time.perf_counter()
    match.interval()
    return (time.perf_counter() - matched) / (matched - start)


def main():
    warnings.simplefilter("ignore")
    folder = sys.argv[1]
    people = read_people(folder)
    constants_table(people, people_table(people))
    doubts_table(people)
    throws = [event for event in EVENTS if event[:2] == THROW]
    time_line_table([*people, fewer_clips(folder, throws, 12)])
    known_table()
    departures_table([one for one in people if one.archive == "hdm05"][:4])
    bands_table()
    cost_table(people[:3])


if __name__ == "__main__":
    main()
