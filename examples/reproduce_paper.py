"""The paper's figures, times and claim, on the bends of HDM05.

    python examples/reproduce_paper.py --data hdm05_positions.npz --output FOLDER

Figures 1 to 4 of "3D Human Motion Sequences Synchronization Using Dense Matching Algorithm" with
the paper's settings, and the defaults of the package beside them. The paper has 40 bends of its
own; here are 24, of four people. Five key-frames a bend, which the paper marks by hand where the
curvature is largest, are found by geometry, and once more by curvature. Moments that are no
key-frames judge all methods. ``benchmarks/hdm05.py`` makes the archive.
"""

import argparse
import time
from itertools import combinations
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np
from scipy.ndimage import gaussian_filter1d
from scipy.signal import find_peaks
from scipy.spatial.distance import cdist
from sklearn.pipeline import make_pipeline
from sklearn_motionsync import (
    ActionModel,
    ASpace,
    DenseSynchronizer,
    DirectionCosines,
    LinearSynchronizer,
)
from sklearn_motionsync.datasets import load_trials
from sklearn_motionsync.display import SkeletonDisplay, TrellisDisplay

P, ACTION, SHARE = 100, "depositFloorR", 0.95
# Shares of its range that the head passes on its way down and up.
LEVELS = 0.75, 0.25
JUDGES = "pelvis lowest", "head lowest", "pelvis falls", "pelvis rises"


def find_moments(x, skeleton):
    """Five key-frames of a bend, and the frames of other moments by name."""
    heights = gaussian_filter1d(x.reshape(len(x), -1, 3)[:, :, 1].astype(float), 4, axis=0)
    head, pelvis = (heights[:, skeleton.indices_of(at)].mean(axis=1) for at in ("head", "pelvis"))
    hands = [heights[:, skeleton.index_of(f"{side}_wrist")] for side in ("left", "right")]
    down, up = zip(*[passes(head, level) for level in LEVELS], strict=True)
    keyframes = [*down, int(np.minimum(*hands).argmin()), *up[::-1]]
    lowest = [int(pelvis.argmin()), int(head.argmin())]
    return keyframes, dict(zip(JUDGES, [*lowest, *passes(pelvis, 0.5)], strict=True))


def passes(height, level):
    """The last frame above a level before the lowest one, and the first above it afterwards."""
    lowest = int(height.argmin())
    above = height > height.min() + level * np.ptp(height)
    return lowest - int(np.argmax(above[lowest::-1])), lowest + int(np.argmax(above[lowest:]))


def curvature(x):
    """The curvature of the path of a bend on the clock, damped where it rests."""
    v, a = (gaussian_filter1d(x, 0.03 * len(x), axis=0, order=k, mode="nearest") for k in (1, 2))
    vv, aa, va = (v**2).sum(axis=1), (a**2).sum(axis=1), (v * a).sum(axis=1)
    return np.sqrt(np.maximum(vv * aa - va**2, 0)) / (vv + 0.1 * vv.mean()) ** 1.5


def most_curved(x, count):
    """Frames of largest curvature in order of time, some way from each other and from the ends."""
    gap, chosen = len(x) / (count + 1) / 3, [0, len(x) - 1]
    for frame in np.argsort(-curvature(x), kind="stable"):
        if len(chosen) < count + 2 and np.abs(np.array(chosen) - frame).min() > gap:
            chosen.append(int(frame))
    return np.sort(chosen)[1:-1]


def same_moments(pattern, keyframes, x):
    """The peaks of curvature of a bend nearest to the key-frames of the pattern, in their order."""
    peaks = np.union1d(find_peaks(curvature(x))[0], most_curved(x, len(keyframes)))
    distances = cdist(pattern[keyframes], x[peaks], "sqeuclidean")
    orders = np.array(list(combinations(range(len(peaks)), len(keyframes))))
    return peaks[orders[distances[np.arange(len(keyframes)), orders].sum(axis=1).argmin()]]


def error(times, moments):
    """Mean distance, in per cent of the clock, of the moment of one bend from that of another."""
    clock = np.linspace(0, 100, times.shape[1])
    tilted = times + 1e-7 * np.arange(times.shape[1])
    placed = [np.interp(at, tau, clock) for at, tau in zip(moments, tilted, strict=True)]
    return np.mean([abs(a - b) for a, b in combinations(placed, 2)])


def median_time(call, n=5):
    """The median of several runs, in milliseconds."""
    spent = []
    for _ in range(n):
        start = time.perf_counter()
        call()
        spent.append(time.perf_counter() - start)
    return 1e3 * float(np.median(spent))


def draw_first_figure(points, synchronised):
    """Fig. 1: a dimension of two bends as recorded, linearly normalised, and by key-frames."""
    figure, axes = plt.subplots(1, 3, figsize=(10, 3), sharey=True, layout="constrained")
    linear, by_keyframes = synchronised["linear"], synchronised["key-frames"]
    pair = [0, int(np.argmax([len(x) for x in points]))]
    for i in pair:
        axes[0].plot(points[i][:, 0])
        axes[1].plot(linear[i, :, 0])
        axes[2].plot(by_keyframes[i, :, 0])
    titles = "as recorded", "linearly normalised", "by key-frames"
    for axis, title, letter in zip(axes, titles, "abc", strict=True):
        axis.set(title=f"({letter}) {title}", xlabel="frame")
    axes[0].set_ylabel("first dimension of the aSpace")
    return figure


def draw_third_figure(points, synchronised, model):
    """Fig. 3: four dimensions of all bends before and after, and the model."""
    columns = ["linear", "paper", "key-frames"]
    figure, axes = plt.subplots(4, 4, figsize=(12, 9), sharex="col", layout="constrained")
    for k in range(4):
        for axis, name in zip(axes[k], columns, strict=False):
            curves = [x[:, k] for x in points] if name == "linear" else synchronised[name][..., k]
            for curve in curves:
                axis.plot(curve, color="tab:blue", linewidth=0.6, alpha=0.7)
        axes[k, 0].set_ylabel(f"dimension {k + 1}")
        for curve in synchronised["paper"][..., k]:
            axes[k, 3].plot(curve, color="tab:blue", linewidth=0.6, linestyle="--", alpha=0.7)
        mean, std = model.mean_[:, k], np.sqrt(model.variance_[:, k])
        axes[k, 3].plot(mean, color="tab:red", linewidth=2)
        axes[k, 3].plot(np.c_[mean - 3 * std, mean + 3 * std], color="black", linewidth=1)
    titles = "as recorded", "paper's dense matching", "five key-frames", "mean and 3 std"
    for axis, title, letter in zip(axes[0], titles, "abcd", strict=True):
        axis.set_title(f"({letter}) {title}")
    for axis in axes[-1]:
        axis.set_xlabel("frame")
    return figure


def main():
    """Print the report, and write the figures."""
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--data", required=True, help="archive of HDM05 (.npz)")
    parser.add_argument("--output", default=".", help="folder of the figures")
    options = parser.parse_args()
    bunch, output = load_trials(options.data), Path(options.output)
    output.mkdir(exist_ok=True)
    X = [x for x, action in zip(bunch.data, bunch.target, strict=True) if action == ACTION]
    cosines, aspace = DirectionCosines(bunch.skeleton), ASpace(SHARE)
    points = aspace.fit_transform(cosines.fit_transform(X))
    print(f"{len(X)} bends of {min(map(len, X))} to {max(map(len, X))} frames")
    print(f"{aspace.n_components_} dimensions of the aSpace have {SHARE:.0%} of the variance\n")

    keyframes, moments = zip(*[find_moments(x, bunch.skeleton) for x in X], strict=True)
    paper = DenseSynchronizer.paper(n_frames=P).fit(points)
    pattern = paper.pattern_index_
    on_clock = paper.normalize(points)
    of_pattern = most_curved(on_clock[pattern], len(keyframes[0]))
    curved = [
        same_moments(on_clock[pattern], of_pattern, x) * (len(recorded) - 1) / (P - 1)
        for x, recorded in zip(on_clock, points, strict=True)
    ]
    methods = {
        "linear": LinearSynchronizer(P, pattern).fit(points),
        "key-frames": LinearSynchronizer(P, pattern).fit(points, keyframes=keyframes),
        "curvature": LinearSynchronizer(P, pattern).fit(points, keyframes=curved),
        "paper": paper,
        "defaults": DenseSynchronizer(P, pattern).fit(points),
    }
    given = {"key-frames": {"keyframes": keyframes}, "curvature": {"keyframes": curved}}
    matches = {name: sync.match(points, **given.get(name, {})) for name, sync in methods.items()}
    synchronised = {name: match.warp(points) for name, match in matches.items()}

    print("How far moments of two bends lie apart on the clock, per cent of it:\n")
    print(f"| | {' | '.join(JUDGES)} |\n|---|{'---|' * len(JUDGES)}")
    shares = [
        [(P - 1) * m[judge] / (len(x) - 1) for m, x in zip(moments, X, strict=True)]
        for judge in JUDGES
    ]
    for name, match in matches.items():
        print(f"| {name} | {' | '.join(f'{error(match.times, at):.1f}' for at in shares)} |")

    print("\nSpread of all dimensions on the clock, that of linear normalisation is 100:\n")
    spreads = {name: x.var(axis=0, ddof=1).sum() for name, x in synchronised.items()}
    for name, spread in spreads.items():
        print(f"    {name:12s}{100 * spread / spreads['linear']:6.1f}")

    print("\nMean distance of the warps from those of the key-frames, per cent of the clock:\n")
    for name, match in matches.items():
        apart = np.abs(match.times - matches["key-frames"].times).mean()
        print(f"    {name:12s}{100 * apart / (P - 1):6.1f}")

    pair = points[:2]
    settings = {"paper": DenseSynchronizer.paper, "defaults": DenseSynchronizer}
    print("\nTime, ms (paper, Pentium D: 15 a pair, 600 for 40 bends):\n")
    for name, make in settings.items():
        fitted = make(n_frames=P, pattern=0).fit(pair)
        one = median_time(lambda fitted=fitted: fitted.match(pair[1:]))
        whole = median_time(lambda make=make: make(n_frames=P).fit_transform(points))
        print(f"    {name:12s}a bend to the pattern {one:6.1f}, the set of {len(X)} {whole:7.1f}")

    model = ActionModel().fit(synchronised["paper"])
    draw_first_figure(points, synchronised).savefig(output / "figure_1.png", dpi=100)
    trellis = TrellisDisplay.from_estimator(methods["paper"], points, trial=1)
    trellis.figure_.savefig(output / "figure_2.png", dpi=100)
    draw_third_figure(points, synchronised, model).savefig(output / "figure_3.png", dpi=100)
    pipe = make_pipeline(cosines, aspace, methods["paper"], model)
    fourth = SkeletonDisplay.from_model(pipe, frames=(10, 40), random_state=0)
    fourth.figure_.savefig(output / "figure_4.png", dpi=100)


if __name__ == "__main__":
    main()
