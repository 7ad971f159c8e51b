"""The phase of a running movement: how far it is from what the whole clip says, beside peers.

    python benchmarks/live.py DATA_FOLDER

Every actor is held out in turn: aSpace, synchronizer and mean are learnt of the others, P = 100.
The reference is the phase of a whole clip, ``DenseSynchronizer(n_frames=100).match(clip)``, read
the other way round. Errors are in frames of 100, of all frames after the first fifth of a clip, up
to its last. Takes ten minutes.

1. Phase, median and 90 % quantile of an action.    2. Key moments, those of harness.py.
3. No look-ahead.    4. Speed.    5. Other frame rates, hidden features, frames that are missing.
6. What is no such movement; who waits or stops.    7. Time to finish.
"""

import os

for _name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"):
    os.environ[_name] = "1"

import argparse
import time

import numpy as np
from harness import EVENTS, P, read_actions
from live_peers import PEERS, sampled
from live_people import held_out
from sklearn.metrics import roc_auc_score
from sklearn_motionsync import DenseSynchronizer, OnlineSynchronizer

ARCHIVES = {"hdm05": "HDM05", "utkinect": "UTKinect"}
OURS = "OnlineSynchronizer"
VARIANTS = {
    f"{OURS}, metric=None": {"metric": None},
    f"{OURS}, cost='posture'": {"cost": "posture"},
}
# Frames a second of HDM05: who stands for a second stands for so many.
SECOND = 120

# -- lines of tables --------------------------------------------------------------------


def head(title, folds, *more):
    columns = ["", *folds, "mean", *more]
    print(f"\n{title}\n| " + " | ".join(columns) + " |\n|" + "---|" * len(columns))


def line(name, errors):
    """Median / 90 % quantile of the errors of each action {action: list of arrays}, and means."""
    rows = [np.quantile(np.concatenate(some), [0.5, 0.9]) for some in errors.values()]
    cells = ["{:.1f} / {:.1f}".format(*row) for row in rows]
    cells.append("{:.2f} / {:.2f}".format(*np.mean(rows, axis=0)))
    print(f"| {name} | " + " | ".join(cells) + " |", flush=True)


def told(errors):
    return f"{np.mean(errors):.2f} / {np.median(errors):.2f}"


# -- how right it is --------------------------------------------------------------------


def phases_of(fold, method):
    """The phases of the clips of a fold, by ours or by a peer."""
    if method == OURS:
        return fold.phases
    if method in VARIANTS:
        return fold.phases_with(**VARIANTS[method])
    return [PEERS[method](fold.known, clip) for clip in fold.clips]


def show_phase(name, folds, methods):
    """The errors of each action, a line a method; and how far from the end clips end."""
    head(f"1. Phase, {name}: median / 90 % quantile of errors (frames of {P})", folds)
    for method in methods:
        found = {}
        for action, some in folds.items():
            found[action] = [e for fold in some for e in fold.errors(phases_of(fold, method))]
        line(method, found)
    ends = {
        action: [[P - 1 - phase[-1]] for fold in some for phase in fold.phases]
        for action, some in folds.items()
    }
    line(f"{OURS}: P - 1 less the phase of the last frame", ends)


def show_moments(name, folds):
    """Errors of the phase at key moments: live, of the whole clip, and their ratio."""
    print(f"\n2. Key moments, {name}: mean / median error of the phase (frames of {P})")
    print("| action: event | clips | live | whole clip | ratio of means |\n|---|---|---|---|---|")
    rows = []
    for action, some in folds.items():
        for event in some[0].moments:
            live, whole = np.concatenate([moment_errors(fold, event) for fold in some]).T
            rows.append([[live.mean(), np.median(live)], [whole.mean(), np.median(whole)]])
            cells = f"{len(live)} | {told(live)} | {told(whole)} | {live.mean() / whole.mean():.2f}"
            print(f"| {action}: {event} | {cells} |", flush=True)
    means, rows = np.mean(rows, axis=0), np.array(rows)
    cells = " | ".join("{:.2f} / {:.2f}".format(*mean) for mean in means)
    ratios = means[0] / means[1]
    print(f"| mean of {len(rows)} events | | {cells} | {ratios[0]:.2f} |")
    above = (rows[:, 0] > 2 * rows[:, 1]).sum(axis=0)
    print(f"of medians {ratios[1]:.2f}; events above 2: {above[0]} by mean, {above[1]} by median")


def moment_errors(fold, event):
    """Errors of the phase at an event, (n_clips that show it, 2): live and of the whole clip."""
    found = []
    for phase, truth, moment in zip(fold.phases, fold.truths, fold.moments[event], strict=True):
        if np.isfinite(moment + fold.landed[event]):
            frame, frames = moment * (len(truth) - 1) / (P - 1), np.arange(len(truth))
            at = np.array([np.interp(frame, frames, phases) for phases in (phase, truth)])
            found.append(np.abs(at - fold.landed[event]))
    return np.reshape(found, (-1, 2))


def show_no_look_ahead(folds, cuts=8):
    """How many answers change once later frames are known, and by ``step``."""
    changed = cases = 0
    for fold in (fold for some in folds.values() for fold in some):
        clip, online = fold.clips[0], fold.online
        whole = np.array(online.track([clip])[0])
        parts = [
            np.array(online.track([clip[: end + 1]])[0])
            for end in np.unique(np.linspace(1, len(clip) - 1, cuts).astype(int))
        ]
        online.reset()
        parts.append(np.array([online.step(frame) for frame in clip]).T)
        changed += sum(x.tobytes() != whole[:, : x.shape[1]].tobytes() for x in parts)
        cases += len(parts)
    print(f"\n3. No look-ahead: {changed} of {cases} answers differ in a bit from the whole clip's")


def show_speed(name, fold):
    """Frames a second of one processor, by ``step`` and by ``follow``; what a fit adds."""
    online, clip = fold.online, fold.clips[0]
    cells = []
    for n_streams in (None, 10, 100):
        frames = clip if n_streams is None else np.repeat(clip[:, np.newaxis], n_streams, axis=1)
        took = []
        for _ in range(3):
            online.reset()
            begin = time.process_time()
            for frame in frames:
                online.step(frame)
            took.append(time.process_time() - begin)
        count = n_streams or 1
        cells.append(f"step, streams: {count}: {len(clip) * count / np.median(took):,.0f}")
    begin = time.process_time()
    online.track(fold.clips)
    rate = sum(map(len, fold.clips)) / (time.process_time() - begin)
    cells.append(f"follow, clips: {len(fold.clips)}: {rate:,.0f}")
    print(f"   {name}, {clip.shape[1]} features: {'; '.join(cells)} frames a second", flush=True)
    # As many clips as the calibration takes at most, and more.
    training, took = (fold.training * 50)[:50], []
    for _ in range(3):
        begin = time.process_time()
        sync = DenseSynchronizer(n_frames=P).fit(training)
        sync.match(training)
        between = time.process_time()
        OnlineSynchronizer(DenseSynchronizer(n_frames=P)).fit(training)
        took.append(time.process_time() - between - (between - begin))
    print(f"   fit of 50 clips: {np.median(took):.2f} s beyond its synchronizer", flush=True)


# -- what is seen otherwise -------------------------------------------------------------


def disturbed(clip, rng):
    """A clip of cosines as others see it: {name: (frames, stamps, frames that they are)}."""
    n, frames = len(clip), np.arange(float(len(clip)))
    jitter = np.clip(frames + rng.uniform(-0.4, 0.4, n), 0, n - 1)
    third = rng.random(clip.shape) < 1 / 3
    # The first cosine is the height of the pelvis; every limb has three.
    limbs = np.insert(np.repeat(rng.permutation((clip.shape[1] - 1) // 3), 3) < 4, 0, False)
    kept = rng.random(n) >= 0.3
    kept[[0, -1]] = True
    return {
        "every frame": (clip, None, frames),
        "every fourth frame": (clip[::4], frames[::4], frames[::4]),
        "stamps that jitter by up to 0.4 frames": (sampled(clip, jitter), jitter, jitter),
        "30 % of the frames left out": (clip[kept], frames[kept], frames[kept]),
        "30 % of the frames NaN": (np.where(kept[:, np.newaxis], clip, np.nan), None, frames),
        "a third of the features NaN, others in each frame": (
            np.where(third, np.nan, clip),
            None,
            frames,
        ),
        "4 of the 12 limbs NaN all the time": (np.where(limbs, np.nan, clip), None, frames),
    }


def show_disturbed(name, folds):
    """Errors of what is seen at another rate, or in part."""
    rng, found = np.random.default_rng(0), {}
    for action, some in folds.items():
        for fold in some:
            for clip, truth in zip(fold.clips, fold.truths, strict=True):
                for kind, (seen, stamps, at) in disturbed(clip, rng).items():
                    times = None if stamps is None else [stamps]
                    phase = fold.online.track([seen], times=times)[0].phase
                    errors = np.abs(phase - np.interp(at, np.arange(len(truth)), truth))
                    errors = errors[at >= len(truth) / 5]
                    found.setdefault(kind, {}).setdefault(action, []).append(errors)
    head(f"5. Seen otherwise, {name}: median / 90 % quantile of errors (frames of {P})", folds)
    for kind, errors in found.items():
        line(kind, errors)


# -- who does not do it -----------------------------------------------------------------


def show_negatives(name, folds):
    """How well confidence tells the action from what is none, at half of a clip and at its end."""
    title = "at half the clip and at its end: median phase; confidence, its quantiles 10, 50, 90 %"
    print(f"\n6. Confidence, {name}, {title}, and AUC against clips of the action")
    print("| | phase | confidence | AUC | phase | confidence | AUC | AUC at the end, by action |")
    print("|" + "---|" * 8)
    found = {}
    for action, some in folds.items():
        for fold in some:
            kinds = {
                "the action": fold.live,
                "another action": fold.online.track(fold.wrong[::3]),
                "standing still": fold.online.track([x[[0] * len(x)] for x in fold.clips]),
                "backwards": fold.online.track([x[::-1] for x in fold.clips]),
            }
            for kind, lives in kinds.items():
                said = [np.array(live)[[0, 2]][:, [live.phase.size // 2, -1]] for live in lives]
                found.setdefault(kind, {}).setdefault(action, []).extend(said)
    right = found["the action"]
    for kind, wrong in found.items():
        phases, confidences = np.concatenate(list(wrong.values())).transpose(1, 2, 0)
        cells = []
        for when, (phase, confidence) in enumerate(zip(phases, confidences, strict=True)):
            aucs = [auc(right[a], wrong[a], when) for a in right]
            quantiles = " ".join(f"{q:.2f}" for q in np.quantile(confidence, [0.1, 0.5, 0.9]))
            cells += [f"{np.median(phase):.0f}", quantiles, f"{np.mean(aucs):.2f}"]
        cells.append(" ".join(f"{a:.2f}" for a in aucs))
        print(f"| {kind} | " + " | ".join(cells) + " |", flush=True)


def auc(right, wrong, when):
    scores = [said[1, when] for said in (*right, *wrong)]
    return roc_auc_score(np.repeat([1, 0], [len(right), len(wrong)]), scores)


def show_pauses(folds):
    """Errors of those who stand for a second before they begin, or in the middle."""
    title = "   Standing for a second, while it lasts and after: median / 90 % quantile of errors"
    head(title, folds)
    for where, share in (("before the beginning", 0), ("in the middle", 0.5)):
        found = {"while": {}, "after": {}}
        for action, some in folds.items():
            for fold in some:
                for clip, truth in zip(fold.clips, fold.truths, strict=True):
                    k = round(share * (len(clip) - 1))
                    order = np.insert(np.arange(len(clip)), k, np.full(SECOND, k))
                    errors = np.abs(fold.online.track([clip[order]])[0].phase - truth[order])
                    after = errors[SECOND + max(k, len(clip) // 5) :]
                    for when, part in (("while", errors[k : k + SECOND]), ("after", after)):
                        found[when].setdefault(action, []).append(part)
        for when, errors in found.items():
            line(f"{where}, {when}", errors)


# -- time to finish ---------------------------------------------------------------------


def time_left(known, elapsed, phase, rate):
    """Frames until the end, by every way to tell: {name: frames}, of frames elapsed."""
    left = P - 1 - phase
    usual = left * known.tick
    less = np.maximum(known.duration - 1 - elapsed, 0)
    out = {
        "mean duration less elapsed": less,
        "phase left, at the mean pace": usual,
        "phase left, at the rate": usual / np.maximum(rate, 0.2),
    }
    for prior in (0, 100):
        # As if so many frames of the pattern had passed at the mean pace before.
        pace = (elapsed + prior * known.tick) / np.maximum(phase + prior, 1)
        out[f"phase left, at the pace so far and of {prior} frames before"] = left * pace
    out["mean of the first two"] = (less + usual) / 2
    share = phase / (P - 1)
    out["the first two, the second by the share of phase: `time_left`"] = (
        1 - share
    ) * less + share * usual
    return out


def show_finish(name, folds):
    """Mean absolute errors, in % of the clip, at 25, 50 and 75 % of it."""
    found = {}
    for action, some in folds.items():
        for fold in some:
            for clip, live in zip(fold.clips, fold.live, strict=True):
                last = len(clip) - 1
                at = np.round(np.array([0.25, 0.5, 0.75]) * last).astype(int)
                for kind, frames in time_left(
                    fold.known, at, live.phase[at], live.rate[at]
                ).items():
                    errors = 100 * np.abs(frames - (last - at)) / last
                    found.setdefault(kind, {}).setdefault(action, []).append(errors)
    title = f"7. Time to finish, {name}: mean absolute error in % of the clip at 25, 50, 75 % of it"
    head(title, folds, "better on")
    tables = {kind: [np.mean(x, axis=0) for x in some.values()] for kind, some in found.items()}
    first = np.mean(next(iter(tables.values())), axis=1)
    for kind, rows in tables.items():
        cells = [" ".join(f"{x:.1f}" for x in row) for row in (*rows, np.mean(rows, axis=0))]
        better = f"{np.sum(np.mean(rows, axis=1) < first)} of {len(rows)}"
        print(f"| {kind} | " + " | ".join([*cells, better]) + " |")


def main():
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("folder", help="folder of hdm05 and utkinect")
    parser.add_argument("--tables", nargs="*", type=int, default=range(1, 8))
    args = parser.parse_args()
    actions = read_actions(args.folder, [e for e in EVENTS if e.archive in ARCHIVES])
    points = {
        name: held_out([a for a in actions if a.archive == archive])
        for archive, name in ARCHIVES.items()
    }
    cosines = held_out([a for a in actions if a.archive == "hdm05"], space=False)
    bends = "depositFloorR"
    tables = {
        1: lambda: (
            show_phase("HDM05", points["HDM05"], [OURS, *VARIANTS, *PEERS]),
            show_phase("UTKinect", points["UTKinect"], [OURS, *PEERS]),
            show_phase("HDM05, cosines", cosines, [OURS]),
        ),
        2: lambda: [show_moments(name, folds) for name, folds in points.items()],
        3: lambda: show_no_look_ahead(points["HDM05"]),
        4: lambda: (
            print("\n4. Speed"),
            show_speed("aSpace", points["HDM05"][bends][0]),
            show_speed("cosines", cosines[bends][0]),
        ),
        5: lambda: show_disturbed("HDM05, cosines", cosines),
        6: lambda: (
            [show_negatives(name, folds) for name, folds in points.items()],
            show_pauses(points["HDM05"]),
        ),
        7: lambda: [show_finish(name, folds) for name, folds in points.items()],
    }
    for number in args.tables:
        tables[number]()


if __name__ == "__main__":
    main()
