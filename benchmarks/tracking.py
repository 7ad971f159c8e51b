"""Hidden limbs of real people: `MotionTracker` beside filters and smoothers that know less or more.

    python benchmarks/tracking.py DATA_FOLDER [--actions ...] [--seeds 10] [--takes 2]

HDM05, postures of 37 numbers at 30 frames a second, noise of 0.05 on what is seen. Each actor is
held out in turn, and everything is learnt from the others. Hidden is *half*: 6 limbs of 12 drawn at
random, all the time; *gap*: everything for a second, a third of the take where that is shorter;
*halfgap*: 6 limbs for as long. A gap lies anywhere but at the ends. A seed draws two takes of
each actor, noise, what is hidden, and the particles. Settings of peers are chosen on training
people who are left out for that.

1. Degrees between true and estimated direction of hidden limbs, mean over hidden frames and limbs
   of a take, then over takes; mean and standard deviation over seeds. Filters and smoothers apart.
   *Known phase* is given the path of the whole clean clip, which no filter can know: the ceiling.
2. The tracker's phase: |phase - that path| in frames of 100, after the first fifth.
3. Bands of filters: hidden cosines within the mean and 1.645 standard deviations, of 90 % meant.
4. Frames that the tracker calls lost: of right takes, and of what is none of the action.
5. Its errors to those it is held against, mean over actions and kinds of hiding.
6. Speed, in frames a second, one frame after the other, with 500 particles.
"""

import argparse
import time
from collections import defaultdict

import numpy as np
import trackers
from hidden_limbs import KINDS, N_LIMBS, NOISE, RATE, SMOOTHER, TRACKER, Fold, angles, examine, read
from threadpoolctl import threadpool_limits

# Named before any result was looked at; --actions takes the other two, which are cyclic.
ACTIONS = ("depositFloorR", "elbowToKnee1RepsLelbowStart", "grabHighR", "hopBothLegs1hops")
# Ratios of errors, and what they are to be at most.
BARS = (
    (TRACKER, "pooled Matern", 1.0),
    (TRACKER, "VAR(2)", 0.9),
    (TRACKER + SMOOTHER, "constant velocity" + SMOOTHER, 0.9),
)


class Report:
    """What came out of an action: lists by row, kind of hiding and seed."""

    def __init__(self):
        self.errors, self.phases = defaultdict(list), defaultdict(list)
        self.inside, self.lost = defaultdict(list), defaultdict(list)

    def take_in(self, fold, tracker, some, seed, kind, rng):
        """Some takes of an actor, with something hidden."""
        truth = [fold.takes[i] for i in some]
        seen, masks = examine(truth, [kind] * len(truth), rng)
        tracks, smooth = tracker.track(seen), tracker.smooth(seen)
        answers = list(fold.answers(some, seen, rng))
        answers += [(TRACKER, *_parts(tracks)), (TRACKER + SMOOTHER, *_parts(smooth))]
        for name, found, stds in answers:
            self.errors[name, kind, seed] += map(angles, found, truth, masks)
            if stds is not None:
                near = [
                    (np.abs(x - y) <= 1.645 * s)[m].mean()
                    for x, y, s, m in zip(found, truth, stds, masks, strict=True)
                ]
                self.inside[name, kind] += near
        self.look(fold, tracks, some, kind)

    def take_whole(self, fold, tracker, some, rng):
        """Some takes of an actor, nothing hidden."""
        takes = trackers.noisy([fold.takes[i] for i in some], NOISE, rng)
        self.look(fold, tracker.track(takes), some, "nothing")

    def look(self, fold, tracks, some, kind):
        for track, i in zip(tracks, some, strict=True):
            path = fold.paths[i]
            self.phases[kind] += np.abs(track.phases - path)[len(path) // 5 :].tolist()
            self.lost[f"right takes, {kind} hidden"].append(track.lost.mean())

    def take_wrong(self, fold, tracker, some, others, rng):
        """What is none of the action, or stands still for two seconds."""
        takes = [fold.takes[i] for i in some]
        wrong = {"another action": others, "upside down": [upside_down(x) for x in takes]}
        wrong["first posture, still"] = [np.tile(x[0], (2 * RATE, 1)) for x in takes]
        wrong["half-way, still"] = [np.tile(x[len(x) // 2], (2 * RATE, 1)) for x in takes]
        for name, given in wrong.items():
            tracks = tracker.track(trackers.noisy(given, NOISE, rng))
            self.lost[name] += [track.lost.mean() for track in tracks]

    def means(self, name):
        """Mean errors (n_seeds, n_kinds)."""
        seeds = sorted({seed for _, _, seed in self.errors})
        return np.array([[np.mean(self.errors[name, k, s]) for k in KINDS] for s in seeds])

    def tell(self):
        names = list(dict.fromkeys(name for name, _, _ in self.errors))
        for smoothers in (False, True):
            title = "smoothers" if smoothers else "filters"
            print(f"   {title:32}" + "".join(f"{kind:>16}" for kind in KINDS))
            for name in names:
                if name.endswith(SMOOTHER) == smoothers:
                    means = self.means(name)
                    pairs = zip(means.mean(axis=0), means.std(axis=0), strict=True)
                    print(f"   {name:32}" + "".join(f"   {m:5.2f} +- {s:4.2f}" for m, s in pairs))
        for kind, found in self.phases.items():
            median, most = np.quantile(found, [0.5, 0.9])
            print(f"   phase, {kind} hidden: median {median:.2f}, 90 % {most:.1f} frames")
        for name in names:
            if (name, KINDS[0]) in self.inside:
                cells = "".join(f"{100 * np.mean(self.inside[name, k]):5.0f}" for k in KINDS)
                print(f"   % within the band, {name:30}{cells}")
        for name, found in self.lost.items():
            print(f"   called lost, {name}: {100 * np.mean(found):.0f} % of the frames", flush=True)


def _parts(tracks):
    stds = [np.sqrt(np.diagonal(t.covariances, axis1=1, axis2=2)) for t in tracks]
    return [t.postures for t in tracks], stds


def upside_down(x):
    """Every limb points down where it pointed up."""
    return x * np.concatenate([[1], np.tile([1, -1, 1], N_LIMBS)])


def run(action, others, seeds, n_takes):
    """The report of an action, and the last fold; ``others``: takes of other actions by actor."""
    report = Report()
    for k, actor in enumerate(np.unique(action.actors)):
        fold = Fold(action, actor)
        print(f"   without {actor}, chosen: {fold.chosen}", flush=True)
        for seed in range(seeds):
            rng, tracker = np.random.default_rng([seed, k]), fold.tracker(seed)
            some = np.sort(rng.permutation(len(fold.takes))[:n_takes])
            for kind in KINDS:
                report.take_in(fold, tracker, some, seed, kind, rng)
            report.take_whole(fold, tracker, some, rng)
            if seed == 0:
                report.take_wrong(fold, tracker, some, others[actor], rng)
    return report, fold


def show_ratios(reports):
    """Mean over actions and kinds of the ratio of mean errors; over seeds, mean and spread."""
    print(f"{len(reports)} actions so far" if len(reports) > 1 else "one action so far")
    for name, to, most in BARS:
        ratios = np.array([report.means(name) / report.means(to) for report in reports])
        by_seed = ratios.mean(axis=(0, 2))
        each = ", ".join(f"{x:.2f}" for x in ratios.mean(axis=(1, 2)))
        print(
            f"{name} to {to}: {by_seed.mean():.3f} +- {by_seed.std():.3f} (at most {most};", end=""
        )
        print(f" by action {each})")
    for kind in ("nothing", "half"):
        medians = np.mean([np.median(report.phases[kind]) for report in reports])
        print(f"phase, {kind} hidden, mean of the medians of actions: {medians:.2f} (at most 4)")


def show_speed(fold):
    """Frames a second, the best of three."""
    x = trackers.noisy(fold.takes, NOISE, np.random.default_rng(0))
    frames, tracker = sum(map(len, x)), fold.tracker(0)

    def one_by_one():
        for take in x:
            tracker.reset()
            for frame in take:
                tracker.step(frame)

    works = {f"{TRACKER}.step": one_by_one}
    works[f"{TRACKER}.track"] = lambda: tracker.track(x)
    works[f"{TRACKER}.smooth"] = lambda: tracker.smooth(x)
    for name, (peer, _) in fold.peers.items():
        paths = fold.means if name.startswith("known") else None
        works[name] = lambda p=peer, m=paths: p.run(x, NOISE, m, smooth=False)
    for name, work in works.items():
        times = []
        for _ in range(3):
            begun = time.perf_counter()
            work()
            times.append(time.perf_counter() - begun)
        print(f"   {name:30} {frames / min(times):6.0f} frames a second")


def main():
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("folder")
    parser.add_argument("--actions", nargs="*", default=ACTIONS)
    parser.add_argument("--seeds", type=int, default=10)
    parser.add_argument("--takes", type=int, default=2)
    args = parser.parse_args()
    names = dict.fromkeys([*args.actions, *ACTIONS])
    actions, reports = {a.name: a for a in read(args.folder, names)}, []
    for name in args.actions:
        action, others = actions[name], defaultdict(list)
        for other in actions.values():
            for actor in np.unique(action.actors) if other is not action else ():
                others[actor].append(other.takes[np.flatnonzero(other.actors == actor)[0]])
        print(f"{name}: {len(action.takes)} takes of {len(np.unique(action.actors))} people")
        report, fold = run(action, others, args.seeds, args.takes)
        report.tell()
        reports.append(report)
        show_ratios(reports)
    show_speed(fold)


if __name__ == "__main__":
    with threadpool_limits(1):
        main()
