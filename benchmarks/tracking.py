"""Hidden limbs of real people: `MotionTracker` beside filters and smoothers that know less or more.

    python benchmarks/tracking.py DATA_FOLDER [--actions ...] [--seeds 10]

HDM05, postures of 37 numbers at 30 frames a second, noise of 0.05 on what is seen. Each actor is
held out in turn, and everything is learnt from the others. Hidden is *half*: 6 limbs of 12 drawn at
random, all the time; *gap*: everything for a second, a third of the take where that is shorter;
*halfgap*: 6 limbs for as long. A gap lies anywhere but at the ends.

1. Degrees between true and estimated direction of hidden limbs, mean over hidden frames and limbs
   of a take, then over takes; mean and standard deviation over seeds, which draw noise, what is
   hidden, and particles. Filters and smoothers apart. *Known phase* is given the path of the whole
   clean clip, which no filter can know: the ceiling.
2. The tracker's error to those it is held against, mean over actions and kinds of hiding.
3. Its phase: |phase - that path| in frames of 100, median and 90 % after the first fifth.
4. Its band: hidden cosines within the mean and 1.645 standard deviations, of 90 % meant.
5. Frames it calls lost: of right takes, and of what is none of the action.
6. Speed, in frames a second, one frame after the other, with 500 particles.
"""

import argparse
import time
from collections import defaultdict
from itertools import product
from typing import NamedTuple

import numpy as np
import trackers
from events import P, read_archive
from sklearn_motionsync import DenseSynchronizer, DirectionCosines, MotionTracker
from threadpoolctl import threadpool_limits

# Named before any result was looked at; --actions takes the other two, which are cyclic.
ACTIONS = ("depositFloorR", "elbowToKnee1RepsLelbowStart", "grabHighR", "hopBothLegs1hops")
KINDS = ("half", "gap", "halfgap")
NOISE, RATE, STEP, N_LIMBS = 0.05, 30, 4, 12
TRACKER, SMOOTHER = "MotionTracker", ", smoother"
# Ratios of errors, and what they are to be at most.
BARS = (
    (TRACKER, "pooled Matern", 1.0),
    (TRACKER, "VAR(2)", 0.9),
    (TRACKER + SMOOTHER, "constant velocity" + SMOOTHER, 0.9),
)

PEERS = (
    ("constant velocity", trackers.constant_velocity, [(x,) for x in trackers.FACTORS]),
    ("VAR(2)", trackers.autoregression, [(x,) for x in trackers.RIDGES]),
    ("pooled Matern", trackers.pooled_matern, list(product(trackers.LENGTHS, trackers.SHARES))),
)

# -- takes, and what of them is hidden --------------------------------------------------


class Action(NamedTuple):
    name: str
    takes: list
    actors: np.ndarray


def read(folder, names):
    bunch = read_archive(folder, "hdm05")
    for name in names:
        chosen = np.flatnonzero(bunch.target == name)
        positions = [bunch.data[i].astype(float)[::STEP] for i in chosen]
        takes = DirectionCosines(bunch.skeleton).fit_transform(positions)
        yield Action(name, takes, bunch.actor[chosen])


def columns_of(limbs):
    return np.concatenate([[1 + 3 * i, 2 + 3 * i, 3 + 3 * i] for i in limbs])


def hide(takes, kind, rng):
    """Masks, True where hidden; ``kind`` is None where all is seen."""
    masks = []
    for x in takes:
        mask = np.zeros(x.shape, dtype=bool)
        limbs = columns_of(rng.choice(N_LIMBS, N_LIMBS // 2, replace=False))
        gap = RATE if len(x) >= 2 * RATE else len(x) // 3
        begin = rng.integers(1, len(x) - gap)
        if kind == "half":
            mask[:, limbs] = True
        elif kind == "gap":
            mask[begin : begin + gap] = True
        elif kind == "halfgap":
            mask[begin : begin + gap, limbs] = True
        masks.append(mask)
    return masks


def angles(estimate, truth, mask):
    """Degrees between directions of the limbs that are hidden, mean of a take."""
    a, b = (x[:, 1:].reshape(len(x), N_LIMBS, 3) for x in (estimate, truth))
    cosine = (a * b).sum(-1) / (np.linalg.norm(a, axis=-1) * np.linalg.norm(b, axis=-1) + 1e-12)
    hidden = mask[:, 1:].reshape(len(truth), N_LIMBS, 3)[..., 0]
    return np.degrees(np.arccos(np.clip(cosine, -1, 1)))[hidden].mean()


def phases_of(times, n_frames):
    """Where the path of a take is at each of its frames; the middle of where it stands still."""
    at, first, counts = np.unique(times, return_index=True, return_counts=True)
    middle = first + (counts - 1) / 2
    middle[0], middle[-1] = 0, len(times) - 1
    return np.interp(np.linspace(0, len(times) - 1, n_frames), at, middle)


def phases(sync, takes):
    """The paths of takes."""
    times = sync.match(takes).times
    return [phases_of(t, len(x)) for t, x in zip(times, takes, strict=True)]


def on_path(clock, phases):
    """A course of the clock (P, n_features) at these phases."""
    return np.stack([np.interp(phases, np.arange(len(clock)), c) for c in clock.T], axis=1)


def examine(takes, kinds, rng):
    """What is seen of takes, and what is hidden of them."""
    masks = [hide([x], kind, rng)[0] for x, kind in zip(takes, kinds, strict=True)]
    given = trackers.noisy(takes, NOISE, rng)
    return [np.where(m, np.nan, x) for m, x in zip(masks, given, strict=True)], masks


def choose(make, people, settings):
    """The best setting of a filter and of its smoother, for people left out of the training set.

    Three takes of each are looked at, one a kind of hiding.
    """
    rng, totals = np.random.default_rng(0), np.zeros((len(settings), 2))
    for k, takes in enumerate(people):
        takes = takes[: len(KINDS)]
        seen, masks = examine(takes, KINDS[: len(takes)], rng)
        for row, setting in zip(totals, settings, strict=True):
            found = make(trackers.all_but(people, k), *setting).run(seen, NOISE)
            row += [
                sum(map(angles, estimates, takes, masks))
                for estimates in ([e.means for e in found], [e.smoothed for e in found])
            ]
    return [settings[i] for i in totals.argmin(axis=0)]


# -- what an actor's takes are met with -------------------------------------------------


class Fold:
    """An actor held out: all that is learnt from the others, and the paths of the takes."""

    def __init__(self, action, actor):
        out = action.actors == actor
        self.takes = [x for x, o in zip(action.takes, out, strict=True) if o]
        train = [x for x, o in zip(action.takes, out, strict=True) if not o]
        of = action.actors[~out]
        self.train = train
        self.people = [[x for x, a in zip(train, of, strict=True) if a == b] for b in np.unique(of)]
        sync = DenseSynchronizer(n_frames=P).fit(train)
        warped = sync.transform(train)
        self.mean = warped.mean(axis=0)
        self.paths = phases(sync, self.takes)
        self.means = [on_path(self.mean, path) for path in self.paths]
        paces = np.log([(P - 1) / (len(x) - 1) for x in train])
        self.learn_peers(sync, warped, of, paces)
        self.tracker = MotionTracker(DenseSynchronizer(n_frames=P), noise=NOISE).fit(train)

    def learn_peers(self, sync, warped, of, paces):
        self.peers, self.chosen = {}, {}
        for name, make, settings in PEERS:
            chosen = self.chosen[name] = choose(make, self.people, settings)
            peers = {setting: make(self.train, *setting) for setting in chosen}
            self.peers[name] = [peers[setting] for setting in chosen]
        # Deviations of a training take from the mean of other people, at the phase of its path.
        paths = zip(phases(sync, self.train), of, strict=True)
        means = [on_path(warped[of != a].mean(axis=0), path) for path, a in paths]
        rests = [x - m for x, m in zip(self.train, means, strict=True)]
        self.peers["known phase + Matern"] = [trackers.deviation_process(rests, NOISE)] * 2
        self.particles = trackers.PostureParticles(warped, self.train, paces, NOISE)

    def answers(self, seen, rng):
        """Names and estimates of every peer: filters, then smoothers."""
        yield "mean at known phase", self.means
        yield "imputation", trackers.imputation(self.train, seen, NOISE)
        for name, (peer, other) in self.peers.items():
            means = self.means if name.startswith("known") else None
            smoothed = other.run(seen, NOISE, means)
            found = smoothed if peer is other else peer.run(seen, NOISE, means, smooth=False)
            yield name, [e.means for e in found]
            yield name + SMOOTHER, [e.smoothed for e in smoothed]
        yield "particles over postures", self.particles.run(seen, rng)

    def tracked(self, seen, seed, smooth=False):
        """What the tracker says of takes, as for this seed."""
        tracker = self.tracker.set_params(random_state=seed)
        return (tracker.smooth if smooth else tracker.track)(seen)


# -- one action, all seeds --------------------------------------------------------------


class Report:
    """What came out of an action: lists by row, kind of hiding and seed."""

    def __init__(self):
        self.errors, self.phases = defaultdict(list), defaultdict(list)
        self.inside, self.lost = defaultdict(list), defaultdict(list)

    def take_in(self, fold, seed, kind, rng):
        """An actor's takes, with something hidden."""
        seen, masks = examine(fold.takes, [kind] * len(fold.takes), rng)
        for name, found in fold.answers(seen, rng):
            self._score(name, kind, seed, found, fold, masks)
        tracks = fold.tracked(seen, seed)
        self._score(TRACKER, kind, seed, [t.postures for t in tracks], fold, masks)
        self._look(fold, tracks, kind)
        self._count(tracks, masks, fold, kind, TRACKER)
        tracks = fold.tracked(seen, seed, smooth=True)
        name = TRACKER + SMOOTHER
        self._score(name, kind, seed, [t.postures for t in tracks], fold, masks)
        self._count(tracks, masks, fold, kind, name)

    def take_all(self, fold, seed, rng):
        """An actor's takes, nothing hidden."""
        tracks = fold.tracked(trackers.noisy(fold.takes, NOISE, rng), seed)
        self._look(fold, tracks, "nothing")

    def take_wrong(self, fold, others, seed, rng):
        """What is none of the action, or not for long."""
        wrong = {"another action": others, "upside down": [upside_down(x) for x in fold.takes]}
        wrong["stands still for 4 s"] = [np.tile(x[0], (4 * RATE, 1)) for x in fold.takes]
        wrong["stops half-way for 4 s"] = [
            np.tile(x[len(x) // 2], (4 * RATE, 1)) for x in fold.takes
        ]
        for name, takes in wrong.items():
            for track in fold.tracked(trackers.noisy(takes, NOISE, rng), seed):
                self.lost[name].append(track.lost.mean())

    def _score(self, name, kind, seed, found, fold, masks):
        self.errors[name, kind, seed] += map(angles, found, fold.takes, masks)

    def _look(self, fold, tracks, kind):
        for track, path in zip(tracks, fold.paths, strict=True):
            self.phases[kind] += np.abs(track.phases - path)[len(path) // 5 :].tolist()
            self.lost[f"right takes, {kind} hidden"].append(track.lost.mean())

    def _count(self, tracks, masks, fold, kind, name):
        for track, truth, mask in zip(tracks, fold.takes, masks, strict=True):
            std = np.sqrt(np.diagonal(track.covariances, axis1=1, axis2=2))
            inside = np.abs(track.postures - truth) <= 1.645 * std
            self.inside[name, kind].append(inside[mask].mean())

    def means(self, name):
        """Mean errors (n_seeds, n_kinds)."""
        seeds = sorted({seed for _, _, seed in self.errors})
        return np.array([[np.mean(self.errors[name, k, s]) for k in KINDS] for s in seeds])

    def tell(self):
        names = list(dict.fromkeys(name for name, _, _ in self.errors))
        for smoothers in (False, True):
            print("   " + ("smoothers" if smoothers else "filters").ljust(32), *KINDS, sep="     ")
            for name in names:
                if name.endswith(SMOOTHER) == smoothers:
                    means = self.means(name)
                    pairs = zip(means.mean(axis=0), means.std(axis=0), strict=True)
                    cells = "".join(f"   {m:5.2f} +- {s:4.2f}" for m, s in pairs)
                    print(f"   {name:32}{cells}")
        for kind, found in self.phases.items():
            median, most = np.quantile(found, [0.5, 0.9])
            print(f"   phase, {kind} hidden: median {median:.2f}, 90 % {most:.1f} frames")
        for (name, kind), found in self.inside.items():
            print(f"   {name}, {kind} hidden: {100 * np.mean(found):.0f} % within the 90 % band")
        for name, found in self.lost.items():
            print(f"   called lost, {name}: {100 * np.mean(found):.0f} % of the frames")


def upside_down(x):
    """Every limb points down where it pointed up."""
    return x * np.concatenate([[1], np.tile([1, -1, 1], N_LIMBS)])


def run(action, others, seeds):
    """The report of an action; ``others``: takes of other actions, by actor."""
    report = Report()
    for k, actor in enumerate(np.unique(action.actors)):
        fold = Fold(action, actor)
        print(f"   without {actor}, chosen: {fold.chosen}", flush=True)
        for seed in range(seeds):
            rng = np.random.default_rng([seed, k])
            for kind in KINDS:
                report.take_in(fold, seed, kind, rng)
            report.take_all(fold, seed, rng)
        report.take_wrong(fold, others[actor], 0, rng)
    return report, fold


def show_ratios(reports):
    """Mean over actions and kinds of the ratio of mean errors; over seeds, mean and spread."""
    for name, to, most in BARS:
        ratios = np.array([report.means(name) / report.means(to) for report in reports])
        by_seed = ratios.mean(axis=(0, 2))
        each = ", ".join(f"{x:.2f}" for x in ratios.mean(axis=(1, 2)))
        print(
            f"{name} to {to}: {by_seed.mean():.3f} +- {by_seed.std():.3f} (at most {most};", end=""
        )
        print(f" by action {each})")


def show_speed(fold):
    """Frames a second."""
    x = trackers.noisy(fold.takes, NOISE, np.random.default_rng(0))
    frames = sum(map(len, x))

    def one_by_one():
        for take in x:
            fold.tracker.reset()
            for frame in take:
                fold.tracker.step(frame)

    rows = {f"{TRACKER}.step": one_by_one}
    rows[f"{TRACKER}.track"] = lambda: fold.tracker.track(x)
    rows[f"{TRACKER}.smooth"] = lambda: fold.tracker.smooth(x)
    for name, (peer, _) in fold.peers.items():
        rows[name] = lambda peer=peer: peer.run(x, NOISE, smooth=False)
    for name, work in rows.items():
        times = []
        for _ in range(3):
            begun = time.perf_counter()
            work()
            times.append(time.perf_counter() - begun)
        print(f"   {name:30} {frames / min(times):8.0f} frames a second")


def main():
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("folder")
    parser.add_argument("--actions", nargs="*", default=ACTIONS)
    parser.add_argument("--seeds", type=int, default=10)
    args = parser.parse_args()
    actions, reports = list(read(args.folder, args.actions)), []
    wrong = list(read(args.folder, [a for a in ACTIONS if a not in args.actions] or ACTIONS))
    for action in actions:
        others = defaultdict(list)
        for other in (*actions, *wrong):
            if other.name != action.name:
                for actor in np.unique(action.actors):
                    others[actor] += [
                        x for x, a in zip(other.takes, other.actors, strict=True) if a == actor
                    ][:2]
        print(f"{action.name}: {len(action.takes)} takes of {len(np.unique(action.actors))} people")
        report, fold = run(action, others, args.seeds)
        report.tell()
        reports.append(report)
    show_ratios(reports)
    show_speed(fold)


if __name__ == "__main__":
    with threadpool_limits(1):
        main()
