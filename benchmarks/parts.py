"""Lags of parts of the body: put into real clips and found again, taken away, and of people.

    python benchmarks/parts.py DATA_FOLDER

1. A smooth lag of 3, 6 and 10 frames of 100 is put into one arm of the clips of an actor, and the
   report of lags without it is taken off the report with it: median and mean error in frames, and
   the share of errors above 3 frames. Once against the pattern of the other actors, behind the rest
   of the body and behind the whole body; and once against the same clip as it was, of every eighth.
2. How far parts are from the body, and what is found of a lag of 6 frames, against the coupling.
3. Lags as people have them: their spread within and between people, and ICC(1,1).
4. One or two parts are shifted by 4 to 6 % of the clip: median error of their lag, and of what goes
   to parts that are not touched, behind the rest and behind the whole body, in %; and the spread
   of lags where nothing is shifted. Also of UTKinect's throws, half of the people held out.

Every actor is held out in turn: nothing that is matched was in the training set, but in 3., where
all lags are of the training set itself.
"""

import argparse

import numpy as np
from events import P, read_archive
from sklearn_motionsync import DenseSynchronizer, DirectionCosines, PartSynchronizer

ACTIONS = ("depositFloorR", "grabHighR", "elbowToKnee1RepsLelbowStart")
ARMS = ("right arm", "left arm")
SIZES = (3, 6, 10)
SHIFTS = (4, 5, 6)
SHIFTED = (
    *(("right arm",), ("left arm",), ("right leg",), ("right arm", "left arm")),
    *(("right arm", "left leg"), ("right arm", "trunk"), ("left leg", "right leg")),
)
COUPLINGS = (0, 1e-4, 3e-4, 1e-3, 3e-3, 1e-2, 3e-2, 1e-1)


def delayed(x, columns, size):
    """A performance, with features that come late by up to ``size`` frames of 100."""
    frames = np.arange(len(x))
    share = frames / frames[-1]
    at = frames - size * np.sin(np.pi * share) ** 2 * frames[-1] / (P - 1)
    out = x.copy()
    for k in columns:
        out[:, k] = np.interp(at, frames, x[:, k])
    return out


def put_in(times, size):
    """What was met at times of the clock is met so much later: s - lag(s) = times, solved for s."""
    s = np.linspace(0, P - 1, 100 * P)
    return np.interp(times, s - size * np.sin(np.pi * s / (P - 1)) ** 2, s) - times


def errors_of(sync, clips, part, size, against):
    """Errors of the lag that was put in, at every frame: the report with it less that without."""
    late = [delayed(x, sync.parts_[part], size) for x in clips]
    lags = sync.lags([*clips, *late], against=against)
    values = lags.values[:, lags.parts.index(part)]
    truth = put_in(sync.match_parts(clips)[part].times, size)
    return np.abs(values[len(clips) :] - values[: len(clips)] - truth)


def errors_of_warps(sync, clips, part, size):
    """The same of the warps of the part, which the coupling draws to the body."""
    late = [delayed(x, sync.parts_[part], size) for x in clips]
    found, before = (sync.match_parts(x)[part].times for x in (late, clips))
    return np.abs(found - before - put_in(before, size))


def held_out(postures, actors, **params):
    """A synchronizer of all other actors, and the clips, for each actor in turn."""
    for actor in np.unique(actors):
        others = [x for x, a in zip(postures, actors, strict=True) if a != actor]
        clips = [x for x, a in zip(postures, actors, strict=True) if a == actor]
        yield PartSynchronizer(synchronizer=DenseSynchronizer(P), **params).fit(others), clips


def told(errors):
    errors = np.concatenate([x.ravel() for x in errors])
    return f"{np.median(errors):.2f} / {errors.mean():.2f} / {100 * np.mean(errors > 3):.0f} %"


def show_recovery(postures, actors):
    print("1. lag put in and found: median / mean error in frames / above 3 frames")
    folds = list(held_out(postures, actors))
    for arm in ARMS:
        for size in SIZES:
            cells = {
                against: told([errors_of(*fold, arm, size, against) for fold in folds])
                for against in ("rest", "body")
            }
            sync = PartSynchronizer(synchronizer=DenseSynchronizer(P))
            same = []
            for i in range(0, len(postures), 8):
                sync.set_params(synchronizer__pattern=i).fit(postures)
                late = [delayed(postures[i], sync.parts_[arm], size)]
                found = sync.match_parts(late)[arm].offsets
                same.append(np.abs(found - put_in(np.arange(P), size)))
            cells["same clip"] = told(same)
            line = "".join(f"  {name}: {cell}" for name, cell in cells.items())
            print(f"   {arm:9} {size:2}{line}", flush=True)


def show_coupling(postures, actors):
    print(
        "2. coupling: mean |d_part - d_body| of all parts; lag of 6 frames in the warps: median / "
        "mean / above 3"
    )
    for coupling in COUPLINGS:
        apart, found = [], {arm: [] for arm in ARMS}
        for sync, clips in held_out(postures, actors, coupling=coupling):
            body = sync.match(clips).times
            parts = sync.match_parts(clips).values()
            apart.append(np.abs([part.times - body for part in parts]).ravel())
            for arm in ARMS:
                found[arm].append(errors_of_warps(sync, clips, arm, 6))
        cells = "".join(f"  {arm}: {told(x)}" for arm, x in found.items())
        print(f"   {coupling:7g}  {np.concatenate(apart).mean():5.2f}{cells}", flush=True)


def show_people(postures, actors):
    print("3. lags of people, behind the rest of the body, mean over the clock")
    sync = PartSynchronizer(synchronizer=DenseSynchronizer(P)).fit(postures)
    print(sync.lags(postures, actors).summary().round(2).to_string())
    if {"left leg", "right leg"} <= set(sync.parts_):
        legs = sync.lags(postures, actors, against="right leg").summary().loc["left leg"]
        print("   left leg behind right leg:", legs.round(2).to_dict())


def shifted(x, columns, percent):
    """A performance, with features that come late by a share of it; the first frame is held."""
    frames, out = np.arange(len(x)), x.copy()
    for k in columns:
        out[:, k] = np.interp(frames - percent / 100 * frames[-1], frames, x[:, k])
    return out


def show_shifts(folds):
    print("4. shifted by 4 to 6 %: median error of parts that are shifted / that are not, in %")
    inner = slice(P // 10, -P // 10)
    for late in SHIFTED:
        errors = {against: ([], []) for against in ("rest", "body")}
        for sync, clips in folds:
            columns = np.concatenate([sync.parts_[part] for part in late])
            own = {name: m.times * 100 / (P - 1) for name, m in sync.match_parts(clips).items()}
            for against, (of_late, of_others) in errors.items():
                before = sync.lags(clips, against=against, unit="percent")
                for percent in SHIFTS:
                    after = sync.lags(
                        [shifted(x, columns, percent) for x in clips],
                        against=against,
                        unit="percent",
                    )
                    change = (after.values - before.values)[:, :, inner]
                    for k, name in enumerate(before.parts):
                        # What is met at the end of a clip has no room to be late.
                        truth = np.minimum(percent, 100 - own[name][:, inner])
                        error = np.abs(change[:, k] - (truth if name in late else 0))
                        (of_late if name in late else of_others).append(error.ravel())
        cells = "".join(
            f"  {against}: " + " / ".join(f"{np.median(np.concatenate(x)):.2f}" for x in both)
            for against, both in errors.items()
        )
        print(f"   {' and '.join(late):22}{cells}", flush=True)
    for against in ("rest", "body"):
        values = [sync.lags(x, against=against, unit="percent").values for sync, x in folds]
        print(f"   nothing, {against}: spread {np.concatenate(values)[:, :, inner].std():.1f}")


def main():
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("folder")
    parser.add_argument("--actions", nargs="*", default=ACTIONS)
    args = parser.parse_args()
    bunch = read_archive(args.folder, "hdm05")
    for action in args.actions:
        chosen = np.flatnonzero(bunch.target == action)
        cosines = DirectionCosines(bunch.skeleton)
        postures = cosines.fit_transform([bunch.data[i].astype(float) for i in chosen])
        actors = bunch.actor[chosen]
        print(f"{action}: {len(postures)} clips of {len(np.unique(actors))} people")
        show_recovery(postures, actors)
        show_coupling(postures, actors)
        show_people(postures, actors)
        show_shifts(list(held_out(postures, actors)))
    bunch = read_archive(args.folder, "utkinect")
    chosen = [i for i in np.flatnonzero(bunch.target == "throw") if len(bunch.data[i]) >= 8]
    postures = DirectionCosines(bunch.skeleton).fit_transform([bunch.data[i] for i in chosen])
    people = np.unique(bunch.actor[chosen], return_inverse=True)[1]
    print(f"throw: {len(postures)} clips of {people.max() + 1} people")
    show_shifts(list(held_out(postures, people % 2)))


if __name__ == "__main__":
    main()
