"""The phase of a running movement: how far it is from what the whole clip says, beside peers.

    python benchmarks/live.py DATA_FOLDER

Every actor is held out in turn: aSpace, synchronizer and mean are learnt of the others, P = 100.
The reference is the phase of a whole clip, ``DenseSynchronizer(n_frames=100).match(clip)``, read
the other way round. Errors are in frames of 100, of all frames after the first fifth of a clip, up
to its last.

1. Phase, median and 90 % quantile of an action.    2. Key moments, those of events.py.
3. No look-ahead.    4. Speed.    5. Other frame rates, hidden features, frames that are missing.
6. What is no such movement; who waits or stops.    7. Time to finish.
"""

import os

for _name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"):
    os.environ[_name] = "1"

import argparse
import time
from typing import NamedTuple

import numpy as np
from events import EVENTS, P, read_actions
from live_peers import PEERS, Known, sampled
from sklearn.metrics import roc_auc_score
from sklearn_motionsync import ASpace, DenseSynchronizer, DirectionCosines, OnlineSynchronizer

ARCHIVES = {"hdm05": "HDM05", "utkinect": "UTKinect"}
OURS = "OnlineSynchronizer"
# Frames a second of HDM05.
FRAME_RATE = 120

# -- people who are held out ------------------------------------------------------------


class Fold(NamedTuple):
    """What is known of an action from all actors but one, and the clips of that one."""

    archive: str
    action: str
    actor: str
    online: OnlineSynchronizer
    known: Known
    clips: list
    truths: list
    landed: dict
    moments: dict
    wrong: list
    training: tuple

    def errors(self, phases):
        """Absolute errors of the phases of all clips, each after its first fifth."""
        pairs = zip(phases, self.truths, strict=True)
        return [np.abs(phase - truth)[-(-len(truth) // 5) :] for phase, truth in pairs]


def phase_of(times, at):
    """When, on the clock of the pattern, a warp is ``at`` times: the middle of where it stays."""
    mirrored = len(times) - 1 - _first(len(times) - 1 - times[::-1], len(times) - 1 - at)
    return (_first(times, at) + mirrored) / 2


def _first(times, at):
    """The first moment at which a warp from 0 to P - 1 reaches ``at``."""
    after = np.minimum(np.searchsorted(times, at), len(times) - 1)
    before = np.maximum(after - 1, 0)
    part = (at - times[before]) / np.where(after > 0, times[after] - times[before], 1)
    return before + part


def truth_of(times, n_frames):
    """The phase of every frame of a clip, of its warp."""
    return phase_of(times, np.linspace(0, P - 1, n_frames))


def folds(actions, space=True):
    """Every action with every actor held out; in the aSpace of the others, or cosines."""
    postures = {
        (a.archive, a.name): DirectionCosines(a.skeleton).fit_transform(a.data) for a in actions
    }
    for action in actions:
        own = postures[action.archive, action.name]
        for actor in np.unique(action.actors):
            train, test = (np.flatnonzero((action.actors == actor) == held) for held in (0, 1))
            to_points = ASpace().fit([own[i] for i in train]).transform if space else list
            known, clips = to_points([own[i] for i in train]), to_points([own[i] for i in test])
            wrong = [
                postures[other.archive, other.name][i]
                for other in actions
                if other.archive == action.archive and other.name != action.name
                for i in np.flatnonzero(other.actors == actor)
            ]
            yield _learn(action, actor, train, test, known, clips, to_points(wrong))


def _learn(action, actor, train, test, training, clips, wrong):
    sync = DenseSynchronizer(n_frames=P).fit(training)
    online = OnlineSynchronizer(DenseSynchronizer(n_frames=P)).fit(training)
    seen, whole = sync.match(training).times, sync.match(clips).times
    landed = {}
    for event, moments in action.moments.items():
        shown = train[np.isfinite(moments[train])]
        rows = np.searchsorted(train, shown)
        found = [float(phase_of(seen[r], moments[i])) for r, i in zip(rows, shown, strict=True)]
        landed[event] = np.median(found) if found else np.nan
    return Fold(
        action.archive,
        action.name,
        actor,
        online,
        Known(sync.transform(training).mean(axis=0), sync.pattern_, np.mean([*map(len, training)])),
        clips,
        [truth_of(tau, len(x)) for tau, x in zip(whole, clips, strict=True)],
        landed,
        {event: moments[test] for event, moments in action.moments.items()},
        wrong,
        (training, seen),
    )


def phases_of(fold, method):
    """The phases of the clips of a fold, by ours or by a peer."""
    if method == OURS:
        return [live.phase for live in fold.online.follow(fold.clips)]
    return [PEERS[method](fold.known, clip) for clip in fold.clips]


# -- tables -----------------------------------------------------------------------------


def by_action(some):
    """The folds of each action, in order."""
    out = {}
    for fold in some:
        out.setdefault(fold.action, []).append(fold)
    return out


def show_phase(name, some, methods):
    """Median / 90 % quantile of the errors of each action, a line a method; and ours at the end."""
    actions = by_action(some)
    print(f"\n1. Phase, {name}: median / 90 % quantile of errors (frames of {P})")
    print("| | " + " | ".join(actions) + " | mean |\n|" + "---|" * (len(actions) + 2))
    for method in methods:
        row = []
        for of_action in actions.values():
            errors = [e for fold in of_action for e in fold.errors(phases_of(fold, method))]
            row.append(np.quantile(np.concatenate(errors), [0.5, 0.9]))
        _line(method, [*row, np.mean(row, axis=0)])
    row = []
    for of_action in actions.values():
        ends = [live.phase[-1] for f in of_action for live in f.online.follow(f.clips)]
        row.append(np.quantile(P - 1 - np.array(ends), [0.5, 0.9]))
    _line(f"{OURS}: P - 1 less the phase of the last frame", [*row, np.mean(row, axis=0)])


def _line(name, cells, form="{:.1f} / {:.1f}"):
    """A line of a table; means of medians are told to two places."""
    last = form.replace(".1f", ".2f").format(*np.atleast_1d(cells[-1]))
    told = [form.format(*np.atleast_1d(cell)) for cell in cells[:-1]]
    print(f"| {name} | " + " | ".join([*told, last]) + " |", flush=True)


def show_moments(name, some):
    """Mean / median errors of the phase at key moments: live, of the whole clip, and their ratio."""
    print(
        f"\n2. Key moments, {name}: mean / median error of the phase at the event (frames of {P})"
    )
    print("| action: event | clips | live | whole clip | ratio of means |\n|---|---|---|---|---|")
    rows = []
    for action, of_action in by_action(some).items():
        for event in of_action[0].moments:
            errors = np.concatenate([moment_errors(fold, event) for fold in of_action])
            live, whole = (np.array([e.mean(), np.median(e)]) for e in errors.T)
            rows.append((live, whole))
            cells = [f"{mean:.2f} / {median:.2f}" for mean, median in (live, whole)]
            ratio = f"{live[0] / whole[0]:.2f}"
            print(f"| {action}: {event} | {len(errors)} | {cells[0]} | {cells[1]} | {ratio} |")
    live, whole = np.mean(rows, axis=0)
    cells = [f"{mean:.2f} / {median:.2f}" for mean, median in (live, whole)]
    above = sum(a[0] > 2 * b[0] for a, b in rows)
    print(f"| mean of {len(rows)} events | | {cells[0]} | {cells[1]} | {live[0] / whole[0]:.2f} |")
    print(f"ratio of the medians {live[1] / whole[1]:.2f}; events above 2: {above} of {len(rows)}")


def moment_errors(fold, event):
    """Errors of the phase at an event, (n_clips that show it, 2): live and of the whole clip."""
    found = []
    answers = phases_of(fold, OURS)
    for phase, truth, moment in zip(answers, fold.truths, fold.moments[event], strict=True):
        if np.isfinite(moment + fold.landed[event]):
            frame, frames = moment * (len(truth) - 1) / (P - 1), np.arange(len(truth))
            at = np.array([np.interp(frame, frames, phases) for phases in (phase, truth)])
            found.append(np.abs(at - fold.landed[event]))
    return np.reshape(found, (-1, 2))


def show_no_look_ahead(some, cuts=8):
    """How many answers change once later frames are known, and by ``step``."""
    changed = cases = 0
    for fold in some:
        clip, online = fold.clips[0], fold.online
        whole = np.array(online.follow([clip])[0])
        for end in np.unique(np.linspace(1, len(clip) - 1, cuts).astype(int)):
            part = np.array(online.follow([clip[: end + 1]])[0])
            changed += part.tobytes() != whole[:, : end + 1].tobytes()
            cases += 1
        online.reset()
        steps = np.array([online.step(frame) for frame in clip]).T
        changed += steps.tobytes() != whole.tobytes()
        cases += 1
    print(f"\n3. No look-ahead: {changed} of {cases} answers differ in a bit from the whole clip's")


def show_speed(name, fold):
    """Frames a second of ``step`` and of ``follow``."""
    online, clip = fold.online, fold.clips[0]
    print(f"   {name}: {clip.shape[1]} features, {len(fold.clips)} clips", end="")
    for n_streams in (None, 10, 100):
        frames = clip if n_streams is None else np.repeat(clip[:, np.newaxis], n_streams, axis=1)
        rates = []
        for _ in range(3):
            online.reset(n_streams=n_streams)
            begin = time.perf_counter()
            for frame in frames:
                online.step(frame)
            rates.append(len(frames) * (n_streams or 1) / (time.perf_counter() - begin))
        print(f"; step, {n_streams or 'one'} at once {np.median(rates):,.0f}", end="")
    begin = time.perf_counter()
    online.follow(fold.clips)
    rate = sum(map(len, fold.clips)) / (time.perf_counter() - begin)
    print(f"; follow {rate:,.0f} frames a second", flush=True)


def disturbed(clip, rng):
    """The clip as other sensors see it: {name: (frames, times in frames of training, kept)}."""
    n, frames = len(clip), np.arange(float(len(clip)))
    jitter = np.clip(frames + rng.uniform(-0.4, 0.4, n), 0, n - 1)
    third = np.where(rng.random(clip.shape) < 1 / 3, np.nan, clip)
    # The first cosine is the height of the pelvis; every limb has three.
    limbs = np.insert(np.repeat(rng.permutation((clip.shape[1] - 1) // 3), 3) < 4, 0, False)
    kept = rng.random(n) >= 0.3
    kept[[0, -1]] = True
    return {
        "every frame": (clip, None, frames),
        "every fourth frame": (clip[::4], frames[::4], frames[::4]),
        "jittered by 0.4 frames": (sampled(clip, jitter), jitter, jitter),
        "30 % of the frames left out": (clip[kept], frames[kept], frames[kept]),
        "30 % of the frames NaN": (np.where(kept[:, np.newaxis], clip, np.nan), None, frames),
        "a third of the features NaN, anew each frame": (third, None, frames),
        "4 of the 12 limbs NaN all the time": (np.where(limbs, np.nan, clip), None, frames),
    }


def show_rates(name, some):
    """Median / 90 % quantile of errors of what is seen at another rate, or in part."""
    actions, rng = by_action(some), np.random.default_rng(0)
    print(f"\n5. Seen otherwise, {name}: median / 90 % quantile of errors (frames of {P})")
    print("| | " + " | ".join(actions) + " | mean |\n|" + "---|" * (len(actions) + 2))
    found = {}
    for action, of_action in actions.items():
        for fold in of_action:
            for clip, truth in zip(fold.clips, fold.truths, strict=True):
                for kind, (seen, times, at) in disturbed(clip, rng).items():
                    stamps = None if times is None else [times]
                    phase = fold.online.follow([seen], times=stamps)[0].phase
                    errors = np.abs(phase - np.interp(at, np.arange(len(truth)), truth))
                    late = at >= len(truth) / 5
                    found.setdefault(kind, {}).setdefault(action, []).append(errors[late])
    for kind, of_kind in found.items():
        row = [np.quantile(np.concatenate(errors), [0.5, 0.9]) for errors in of_kind.values()]
        _line(kind, [*row, np.mean(row, axis=0)])


def show_negatives(name, some):
    """How well confidence tells the action from what is none, at half of a clip and at its end."""
    print(f"\n6. Confidence, {name}: quantiles 10, 50, 90 % and AUC against clips of the action")
    print("| | half the clip | AUC | end | AUC | AUC at the end, by action |")
    print("|---|---|---|---|---|---|")
    found = {}
    for action, of_action in by_action(some).items():
        for fold in of_action:
            still = [np.repeat(x[:1], round(fold.known.duration), axis=0) for x in fold.clips]
            backwards = [x[::-1] for x in fold.clips]
            kinds = {"the action": fold.clips, "another action": fold.wrong}
            kinds |= {"standing still": still, "backwards": backwards}
            for kind, clips in kinds.items():
                said = [live.confidence[[len(x) // 2, -1]] for x, live in _followed(fold, clips)]
                found.setdefault(kind, {}).setdefault(action, []).extend(said)
    right = found["the action"]
    for kind, of_kind in found.items():
        said = np.concatenate(list(of_kind.values())).T
        aucs = np.array([[_auc(right[a], of_kind[a], when) for a in right] for when in (0, 1)])
        cells = []
        for quantiles, auc in zip(np.quantile(said, [0.1, 0.5, 0.9], axis=1).T, aucs, strict=True):
            cells.append(" ".join(f"{q:.2f}" for q in quantiles) + f" | {auc.mean():.2f}")
        print(
            f"| {kind} | {cells[0]} | {cells[1]} | " + " ".join(f"{a:.2f}" for a in aucs[1]) + " |"
        )


def _followed(fold, clips):
    return zip(clips, fold.online.follow(clips), strict=True)


def _auc(right, wrong, when):
    scores = [said[when] for said in (*right, *wrong)]
    return roc_auc_score(np.repeat([1, 0], [len(right), len(wrong)]), scores)


def show_pauses(some, pause=FRAME_RATE):
    """Errors of those who stand a second before they begin, or in the middle."""
    print("\n   Standing for a second: median / 90 % quantile of errors, while standing and after")
    print("| | " + " | ".join(by_action(some)) + " | mean |")
    print("|" + "---|" * (len(by_action(some)) + 2))
    for where, share in (("before it begins", 0), ("in the middle", 0.5)):
        rows = {"while": [], "after": []}
        for of_action in by_action(some).values():
            found = {"while": [], "after": []}
            for fold in of_action:
                for clip, truth in zip(fold.clips, fold.truths, strict=True):
                    k = round(share * (len(clip) - 1))
                    order = np.insert(np.arange(len(clip)), k, np.full(pause, k))
                    phase = fold.online.follow([clip[order]])[0].phase
                    errors = np.abs(phase - truth[order])
                    found["while"].append(errors[k : k + pause])
                    found["after"].append(errors[pause + max(k, len(clip) // 5) :])
            for when, errors in found.items():
                rows[when].append(np.quantile(np.concatenate(errors), [0.5, 0.9]))
        for when, row in rows.items():
            _line(f"{where}, {when}", [*row, np.mean(row, axis=0)])


# -- time to finish ---------------------------------------------------------------------

PRIORS = (25, 50, 100, 200)


def time_left(fold, elapsed, phase, rate):
    """Frames until the end, by every estimator, of frames elapsed, phase and rate: {name: frames}."""
    mean, left = fold.known.duration - 1, P - 1 - phase
    usual = left * fold.known.tick
    out = {"mean duration less elapsed": np.maximum(mean - elapsed, 0)}
    out["what is left, at the mean pace"] = usual
    out["what is left, at the current rate"] = usual / np.maximum(rate, 0.2)
    out["what is left, at the pace so far"] = left * elapsed / np.maximum(phase, 1)
    for prior in PRIORS:
        # As if so many frames of the pattern had gone at the mean pace before.
        pace = (elapsed + prior * fold.known.tick) / (phase + prior)
        out[f"pace so far and {prior} frames at the mean pace"] = left * pace
    out["mean of the first two"] = (out["mean duration less elapsed"] + usual) / 2
    return out


def show_finish(name, some):
    """Mean absolute errors, in % of the clip, at 25, 50 and 75 % of it."""
    actions, found = by_action(some), {}
    for action, of_action in actions.items():
        for fold in of_action:
            for clip, live in _followed(fold, fold.clips):
                last = len(clip) - 1
                at = np.round(np.array([0.25, 0.5, 0.75]) * last).astype(int)
                for kind, frames in time_left(fold, at, live.phase[at], live.rate[at]).items():
                    errors = 100 * np.abs(frames - (last - at)) / last
                    found.setdefault(kind, {}).setdefault(action, []).append(errors)
    print(
        f"\n7. Time to finish, {name}: mean absolute error in % of the clip at 25, 50, 75 % of it"
    )
    print("| | " + " | ".join(actions) + " | mean | better on |\n|" + "---|" * (len(actions) + 3))
    first = None
    for kind, of_kind in found.items():
        rows = np.array([np.mean(errors, axis=0) for errors in of_kind.values()])
        first = rows if first is None else first
        cells = [" ".join(f"{x:.1f}" for x in row) for row in (*rows, rows.mean(axis=0))]
        better = f"{np.sum(rows.mean(axis=1) < first.mean(axis=1))} of {len(rows)}"
        print(f"| {kind} | " + " | ".join(cells) + f" | {better} |")


def main():
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("folder", help="folder of hdm05 and utkinect")
    parser.add_argument("--tables", nargs="*", type=int, default=range(1, 8))
    args = parser.parse_args()
    tables = set(args.tables)
    events = [event for event in EVENTS if event.archive in ARCHIVES]
    actions = read_actions(args.folder, events)
    points = {
        name: list(folds([a for a in actions if a.archive == archive]))
        for archive, name in ARCHIVES.items()
    }
    cosines = list(folds([a for a in actions if a.archive == "hdm05"], space=False))
    for name, some in points.items():
        if 1 in tables:
            show_phase(name, some, [OURS, *PEERS])
    if 1 in tables:
        show_phase("HDM05, cosines", cosines, [OURS])
    for name, some in points.items():
        if 2 in tables:
            show_moments(name, some)
    if 3 in tables:
        show_no_look_ahead(points["HDM05"])
    if 4 in tables:
        print("\n4. Speed")
        show_speed("aSpace", points["HDM05"][0])
        show_speed("cosines", cosines[0])
    if 5 in tables:
        show_rates("HDM05, cosines", cosines)
    for name, some in points.items():
        if 6 in tables:
            show_negatives(name, some)
    if 6 in tables:
        show_pauses(points["HDM05"])
    for name, some in points.items():
        if 7 in tables:
            show_finish(name, some)


if __name__ == "__main__":
    main()
