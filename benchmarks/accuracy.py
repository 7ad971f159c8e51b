"""How accurate: known warps and real people, against other packages.

    pip install . dtaidistance tslearn gdtw fdasrsf aeon
    python benchmarks/accuracy.py DATA_FOLDER

DATA_FOLDER holds hdm05/hdm05_positions.npz and utkinect/utkinect_positions.npz; without it
only known warps are run. Every peer is fed postures and velocities (smoothed as ours) and is
reported at the best of its settings, for each number of each cell by itself; ours have one
setting for all. Peers that are
not installed are left out. Prints Markdown.
"""

import importlib.metadata
import sys
import time
import warnings
from pathlib import Path

import numpy as np
import peers
from scipy.ndimage import gaussian_filter1d
from sklearn.model_selection import GroupKFold
from sklearn_motionsync import (
    ASpace,
    DenseSynchronizer,
    DirectionCosines,
    KeyframeSynchronizer,
    LinearSynchronizer,
    __version__,
)
from sklearn_motionsync.datasets import load_performances, make_bending
from sklearn_motionsync.matching.costs import cost_features
from sklearn_motionsync.matching.filters import SMOOTHING, smooth
from sklearn_motionsync.metrics import group_timing_error, keyframe_error, timing_error

P = 100
PAPER = {"cost": "posture", "max_rate": 2, "subframes": 1, "consensus": 0}
OURS = {
    "linear normalisation": lambda **kw: LinearSynchronizer(P, **kw),
    "the paper's method": lambda **kw: DenseSynchronizer(P, **PAPER, **kw),
    "`DenseSynchronizer()`": lambda **kw: DenseSynchronizer(P, **kw),
    "`consensus=0`": lambda **kw: DenseSynchronizer(P, consensus=0, **kw),
    "`velocity_smoothing=0.1`": lambda **kw: DenseSynchronizer(P, velocity_smoothing=0.1, **kw),
    '`cost="elastic"`': lambda **kw: DenseSynchronizer(P, cost="elastic", **kw),
    "`refine=True` (single source)": lambda **kw: DenseSynchronizer(P, refine=True, **kw),
    "`warp_smoothing=0`": lambda **kw: DenseSynchronizer(P, warp_smoothing=0, **kw),
    "`refine=False`": lambda **kw: DenseSynchronizer(P, refine=False, **kw),
}

# -- known warps ------------------------------------------------------------------------

CELLS = [
    (lowest, highest, noise)
    for lowest, highest in ((0.5, 2.0), (0.75, 1.35))
    for noise in (0.005, 0.05, 0.2)
]


def random_warp(rng, lowest, highest):
    """tau on [0, 1] with rates between the two."""
    t = np.linspace(0, 1, 2001)
    while True:
        wave = sum(
            rng.standard_normal() / k * np.sin(np.pi * k * t + rng.uniform(0, 2 * np.pi))
            for k in (1, 2, 3)
        )
        wave = np.tanh(1.5 * wave)
        rate = np.where(wave > 0, highest, 1 / lowest) ** wave
        tau = np.concatenate([[0], np.cumsum((rate[1:] + rate[:-1]) / 2)])
        tau /= tau[-1]
        rates = np.diff(tau) * (len(t) - 1)
        if rates.min() >= lowest and rates.max() <= highest:
            return t, tau


def known_warps(seed, lowest, highest, noise, n=8, n_features=16, gain=0.05):
    """Warped copies of a random movement, and the time of each that shows what copy 0 shows."""
    rng = np.random.default_rng(seed)
    waves = np.arange(1, 7)[:, np.newaxis]
    size = rng.standard_normal((n_features, 6)) / np.arange(1, 7) ** 0.7
    shift = rng.uniform(0, 2 * np.pi, (n_features, 6, 1))

    def movement(phase):
        return np.einsum("fk,fkt->tf", size, np.sin(np.pi * waves * phase + shift))

    frames = np.linspace(0, 1, P)
    spread = movement(np.linspace(0, 1, 400)).std()
    X, truth = [], []
    for m in range(n):
        t, tau = random_warp(rng, lowest, highest) if m else (np.linspace(0, 1, 2001),) * 2
        x = movement(np.interp(frames, tau, t))
        gains = 1 + gain * rng.standard_normal(n_features) if m else 1
        X.append(x * gains + noise * spread * rng.standard_normal(x.shape))
        truth.append(np.interp(frames, t, tau) * (P - 1))
    return X, np.array(truth)


def known_table():
    """Mean error in frames of 100, copy 0 against the others, four random sets a cell."""
    sets = {cell: [known_warps(seed, *cell) for seed in range(4)] for cell in CELLS}

    def row(times_of):
        return [
            np.mean([timing_error(times_of(X)[1:], truth[1:]) for X, truth in sets[cell]])
            for cell in CELLS
        ]

    rows = {name: row(lambda X, m=m: ours_to(m, X, 0)) for name, m in OURS.items()}
    rows |= best_of_peers(lambda align, kind: row(lambda X: peer_to(align, kind, X, 0)))
    header = [f"{low}-{high}, noise {noise:.1%}" for low, high, noise in CELLS]
    print_table("known warps: rates, noise", header, rows, show_mean)


# -- real people ------------------------------------------------------------------------

EVENTS = {
    # archive, action, joint, extreme of its height: the same moment in every clip
    "bend, lowest pelvis": ("hdm05", "depositFloorR", "root", np.argmin),
    "bend, lowest hand": ("hdm05", "depositFloorR", "rhand", np.argmin),
    "elbow to knee, highest ankle": ("hdm05", "elbowToKnee1RepsLelbowStart", "rtibia", np.argmax),
    "grab high, highest hand": ("hdm05", "grabHighR", "rhand", np.argmax),
    "hop, highest ankle": ("hdm05", "hopBothLegs1hops", "rtibia", np.argmax),
    "sneak, highest ankle": ("hdm05", "sneak2StepsLStart", "rtibia", np.argmax),
    "Kinect pick up, lowest hand": ("utkinect", "pickUp", "HandRight", np.argmin),
}
ALL_PAIRS = list(EVENTS)[:3]


class Clips:
    """The clips of an event: points of their aSpace, when it happens, who performs."""

    _archives: dict = {}

    def __init__(self, folder, archive, action, joint, extreme):
        if archive not in self._archives:
            path = folder / archive / f"{archive}_positions.npz"
            self._archives[archive] = load_performances(path)
        bunch = self._archives[archive]
        chosen = np.flatnonzero(bunch.target == action)
        clips = [bunch.data[i] for i in chosen]
        column = 3 * bunch.joints.index(joint) + 1
        heights = [x[:, column].astype(float) for x in clips]
        self.moments = np.array(
            [extreme(gaussian_filter1d(h, 0.015 * len(h))) / (len(h) - 1) for h in heights]
        ) * (P - 1)
        self.actors = bunch.actor[chosen]
        postures = DirectionCosines(bunch.skeleton).fit_transform(clips)
        self.X = [x.astype(float) for x in ASpace().fit_transform(postures)]

    def errors(self, n, times, others):
        """Frames between where the moment of n lands in others, and where it is."""
        landed = np.array([np.interp(self.moments[n], np.arange(P), tau) for tau in times])
        return np.abs(landed - self.moments[others])

    def all_pairs(self, times_to):
        """Errors of all ordered pairs."""
        everyone = np.arange(len(self.X))
        errors = [np.delete(self.errors(n, times_to(self.X, n), everyone), n) for n in everyone]
        return np.concatenate(errors)

    def held_out_actors(self, make):
        """Errors on actors that had no part in the choice of pattern and exemplars."""
        errors = []
        for train, test in self.folds():
            sync = make().fit([self.X[i] for i in train])
            times = sync.match([self.X[i] for i in test]).times
            errors.append(self.errors(train[sync.pattern_index_], times, test))
        return np.concatenate(errors)

    def held_out_pairs(self, align, kind):
        """The same for a peer: from our pattern to the held-out clips."""
        features, errors = peer_features(self.X, kind), []
        for train, test in self.folds():
            sync = DenseSynchronizer(P).fit([self.X[i] for i in train])
            n = train[sync.pattern_index_]
            times = [align(features[n], features[i]) for i in test]
            errors.append(self.errors(n, times, test))
        return np.concatenate(errors)

    def folds(self):
        folds = min(4, len(set(self.actors)))
        return GroupKFold(folds).split(self.X, groups=self.actors)


def real_table(folder):
    """All ordered pairs."""
    clips = {}
    for name in ALL_PAIRS:
        clips[name] = Clips(folder, *EVENTS[name])

    def row(times_to):
        done, cells = {}, []
        for name in ALL_PAIRS:
            # Two events of one action are judged on the same warps.
            action = EVENTS[name][1]
            if action not in done:
                X = clips[name].X
                done[action] = [times_to(X, n) for n in range(len(X))]
            cells.append(clips[name].all_pairs(lambda X, n, a=action: done[a][n]))
        return cells

    rows = {name: row(lambda X, n, m=m: ours_to(m, X, n)) for name, m in OURS.items()}
    rows |= best_of_peers(lambda align, kind: row(lambda X, n: peer_to(align, kind, X, n)))
    header = [f"{name} ({len(clips[name].X)} clips)" for name in ALL_PAIRS]
    print_table("all ordered pairs", header, rows, show_errors)


def actor_table(folder):
    """GroupKFold by actor."""
    clips = {name: Clips(folder, *event) for name, event in EVENTS.items()}
    rows = {name: [c.held_out_actors(make) for c in clips.values()] for name, make in OURS.items()}
    rows |= best_of_peers(
        lambda align, kind: [c.held_out_pairs(align, kind) for c in clips.values()]
    )
    print_table("held-out actors", list(clips), rows, show_errors)


def refinement_table(folder):
    """What refine="auto" finds out, and what refining really does to the error."""
    head = "| data | misfit | ratio | p | ratio to all | refines | error without | error with |"
    print(f"\n{head}\n|---|---|---|---|---|---|---|---|")
    for name, X, pattern, error in refinement_cases(folder):
        sync = DenseSynchronizer(P, pattern).fit(X)
        found = [sync.misfit_, *(sync.refinement_[k] for k in ("ratio", "p_value", "ratio_to_all"))]
        texts = [f"{value:.3f}" if np.isfinite(value) else "-" for value in found]
        texts += ["yes" if sync.refines_ else "no"]
        for refine in (False, True):
            sync = DenseSynchronizer(P, sync.pattern_index_, refine=refine).fit(X)
            texts += [f"{error(sync.match(X).times, sync.pattern_index_):.2f}"]
        print(f"| {name} | " + " | ".join(texts) + " |", flush=True)


def refinement_cases(folder):
    """Name, performances, pattern, and the error of times to a pattern."""
    for n_features in (16, 4, 2, 1):
        for cell in CELLS[:3]:
            X, truth = known_warps(0, *cell, n_features=n_features)
            name = f"known warps, {n_features} features, noise {cell[2]:.1%}"
            yield name, X, 0, lambda times, n, truth=truth: timing_error(times[1:], truth[1:])
    for style in (1.0, 4.0):
        bunch = make_bending(24, style=style, random_state=0)
        postures = DirectionCosines(bunch.skeleton).fit_transform(bunch.data)
        points = ASpace().fit_transform(postures)
        name = f"make_bending, style {style:g}"
        yield name, points, "median", lambda times, n, b=bunch: group_timing_error(times, b.times)
    for name, event in EVENTS.items() if folder is not None else ():
        clips = Clips(folder, *event)
        everyone = np.arange(len(clips.X))
        for n_features in (None, 3, 2, 1):
            some = "" if n_features is None else f", {n_features} dimension(s)"
            X = [x[:, :n_features] for x in clips.X]
            yield name + some, X, "median", event_error(clips, everyone)
        for actor in sorted(set(clips.actors)) if event[0] == "hdm05" else ():
            own = np.flatnonzero(clips.actors == actor)
            X = [clips.X[i] for i in own]
            yield f"{name}, actor {actor} alone", X, "median", event_error(clips, own)


def event_error(clips, chosen):
    """The mean error of chosen clips, given their times to one of them."""

    def error(times, n):
        return np.delete(clips.errors(chosen[n], times, chosen), n).mean()

    return error


def bending_table():
    """make_bending, four random sets: key-frames missed, and timing error without a pattern."""
    given = "`KeyframeSynchronizer`, true key-frames"
    makers = {name: OURS[name] for name in list(OURS)[:4]}
    makers |= {given: lambda: KeyframeSynchronizer(P)}
    makers |= {"`KeyframeSynchronizer`, found ones": lambda: KeyframeSynchronizer(P)}
    rows = {name: ([], []) for name in makers}
    for seed in range(4):
        bunch = make_bending(random_state=seed)
        postures = DirectionCosines(bunch.skeleton).fit_transform(bunch.data)
        X, lengths = ASpace().fit_transform(postures), [len(x) for x in bunch.data]
        for name, make in makers.items():
            known = {"keyframes": bunch.keyframes} if name == given else {}
            sync = make().fit(X, **known)
            times, n = sync.match(X, **known).times, sync.pattern_index_
            pattern = bunch.keyframes[n] * (P - 1) / (lengths[n] - 1)
            rows[name][0].append(keyframe_error(times, bunch.keyframes, pattern, lengths))
            rows[name][1].append(group_timing_error(times, bunch.times))
    header = ["key-frames missed by", "timing error of the group"]
    cells = {name: [np.mean(values) for values in row] for name, row in rows.items()}
    print_table("make_bending", header, cells, show_mean)


# -- shared -----------------------------------------------------------------------------


def ours_to(make, X, n):
    return make(pattern=n).fit(X).match(X).times


def peer_features(X, kind):
    on_clock = LinearSynchronizer(P).fit_transform(X)
    on_clock = on_clock - on_clock.mean(axis=(0, 1))
    if kind == "velocity":
        return cost_features(on_clock, "velocity")
    return smooth(on_clock, SMOOTHING * (P - 1)) if kind == "smoothed" else on_clock


def peer_to(align, kind, X, n):
    features = peer_features(X, kind)
    clock = np.arange(P, dtype=float)
    return np.array([align(features[n], y) if m != n else clock for m, y in enumerate(features)])


def best_of_peers(row):
    """Rows of the installed peers: every cell holds one result a setting."""
    rows = {}
    for label in peers.PEERS:
        if peers.installed(label) is None:
            print(f"{label} is not installed", file=sys.stderr)
            continue
        found = []
        for text, kind, align in peers.settings(label):
            start = time.perf_counter()
            with warnings.catch_warnings():
                warnings.simplefilter("ignore")
                found.append(row(align, kind))
            seconds = time.perf_counter() - start
            print(f"{label}, {text}: {seconds:.0f} s", file=sys.stderr, flush=True)
        rows[label] = list(zip(*found, strict=True))
    return rows


def show_mean(settings):
    return f"{min(settings):.3f}"


def show_errors(settings):
    """Mean / median / share beyond five frames, each the best of the settings by itself."""
    mean = min(np.mean(errors) for errors in settings)
    median = min(np.median(errors) for errors in settings)
    gross = min(np.mean(errors > 5) for errors in settings)
    return f"{mean:.2f} / {median:.2f} / {gross:.0%}"


def print_table(corner, header, rows, show):
    """Markdown; a cell holds a tuple with one value a setting, or a single value."""
    print(f"\n| {corner} | " + " | ".join(header) + " |")
    print("|---|" + "---|" * len(header))
    for name, cells in rows.items():
        texts = [show(cell if isinstance(cell, tuple) else (cell,)) for cell in cells]
        print(f"| {name} | " + " | ".join(texts) + " |", flush=True)


def main():
    """Print the tables."""
    folder = Path(sys.argv[1]) if len(sys.argv) > 1 else None
    versions = {"sklearn_motionsync": __version__}
    for label in peers.PEERS:
        versions[peers.PEERS[label][0]] = peers.installed(label)
    for name in ("numpy", "scipy", "scikit-learn"):
        versions[name] = importlib.metadata.version(name)
    print(", ".join(f"{name} {version}" for name, version in versions.items() if version))
    refinement_table(folder)
    bending_table()
    known_table()
    if folder is not None:
        actor_table(folder)
        real_table(folder)


if __name__ == "__main__":
    main()
