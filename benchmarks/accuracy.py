"""How closely key moments are hit, by smoothness: synthetic bending and real clips.

    python benchmarks/accuracy.py ARCHIVE

ARCHIVE is hdm05_positions.npz; without it only the synthetic part is run.
"""

import sys

import numpy as np
from scipy.ndimage import gaussian_filter1d
from sklearn_motionsync import ASpace, DenseSynchronizer, DirectionCosines, LinearSynchronizer
from sklearn_motionsync.datasets import load_performances, make_bending

P = 100
METHODS = {
    "linear": lambda **kw: LinearSynchronizer(P, **kw),
    **{
        f"dense, smoothness {s}": lambda s=s, **kw: DenseSynchronizer(P, smoothness=s, **kw)
        for s in (0.001, 0.01, 0.02, 0.05, 0.1, 0.2, 0.5)
    },
}
# Action, joint, axis, and which extreme of it: the same moment in every clip.
EVENTS = {
    "pelvis": ("depositFloorR", "root", 1, np.argmin),
    "hand": ("depositFloorR", "rhand", 1, np.argmin),
    "ankle": ("elbowToKnee1RepsLelbowStart", "rtibia", 1, np.argmax),
}


def errors_to(n, times, moments):
    """Frames between where the moments of n land in every other performance, and where they are."""
    landed = np.array([np.interp(moments[n], np.arange(P), t) for t in times])
    return np.abs(np.delete(landed - moments, n, axis=0))


def on_clock(frames, X):
    return np.array([f * (P - 1) / (len(x) - 1) for f, x in zip(frames, X, strict=True)])


def synthetic(make, n_sets=12):
    """Mean error, and the smallest and mean improvement on linear normalisation."""
    errors = []
    for seed in range(n_sets):
        bunch = make_bending(random_state=seed)
        X = ASpace().fit_transform(DirectionCosines(bunch.skeleton).fit_transform(bunch.data))
        sync = make().fit(X)
        moments = on_clock(bunch.keyframes, X)
        errors.append(errors_to(sync.pattern_index_, sync.match(X).times, moments).mean())
    return np.array(errors)


def real(make, bunch, action, joint, axis, extreme):
    """Mean and median over all ordered pairs."""
    chosen = [x for x, t in zip(bunch.data, bunch.target, strict=True) if t == action]
    column = 3 * bunch.joints.index(joint) + axis
    smooth = [gaussian_filter1d(x[:, column].astype(float), 0.015 * len(x)) for x in chosen]
    X = ASpace().fit_transform(DirectionCosines(bunch.skeleton).fit_transform(chosen))
    moments = on_clock([extreme(s) for s in smooth], X)
    errors = [errors_to(n, make(pattern=n).fit(X).match(X).times, moments) for n in range(len(X))]
    return f"{np.mean(errors):.2f} / {np.median(errors):.2f}"


def main():
    """Print the table in Markdown."""
    bunch = load_performances(sys.argv[1]) if len(sys.argv) > 1 else None
    events = EVENTS if bunch else {}
    print("| | " + " | ".join(["bending, mean", "times better than linear (min)", *events]) + " |")
    print("|---|" + "---|" * (2 + len(events)))
    linear = synthetic(METHODS["linear"])
    for name, make in METHODS.items():
        errors = synthetic(make)
        gain = linear / errors
        cells = [f"{errors.mean():.2f}", f"{linear.mean() / errors.mean():.1f} ({gain.min():.1f})"]
        cells += [real(make, bunch, *event) for event in events.values()]
        print(f"| {name} | " + " | ".join(cells) + " |")


if __name__ == "__main__":
    main()
