"""
Bending down, by many people, on one clock
==========================================

From joint positions to a model of an action: the postures of all performances become
points of an aSpace, dense matching puts them on the clock of the median performance, and what
they have in common is learnt. The figures are those of the paper: the first dimensions of
the aSpace before and after (Fig. 3), and mean and sampled postures (Fig. 4).

Without arguments the embedded data set is used. For an archive of real performances::

    python examples/plot_bending.py --data hdm05_positions.npz --action depositFloorR
"""

import argparse
import time
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np
from sklearn_motionsync import (
    ActionModel,
    ASpace,
    DenseSynchronizer,
    DirectionCosines,
    LinearSynchronizer,
    Skeleton,
)
from sklearn_motionsync.datasets import load_performances, make_bending
from sklearn_motionsync.metrics import keyframe_error, sobolev_least_squares

# %%
# The performances
# ----------------
# Lists of arrays, one a performance, each with its own number of frames.


def read_performances(path=None, action=None):
    """Performances of one action, as a Bunch."""
    if path is None:
        return make_bending(random_state=0)
    bunch = load_performances(path)
    actions = sorted(set(bunch.target))
    if action is None and len(actions) > 1:
        raise SystemExit(f"Choose one with --action: {', '.join(actions)}.")
    chosen = np.flatnonzero(bunch.target == (action or actions[0]))
    if len(chosen) < 2:
        raise SystemExit(f"There are {len(chosen)} performances of {action!r}; choose {actions}.")
    if bunch.skeleton is None:
        raise SystemExit("The names of the joints do not tell which ones are the body's.")
    bunch.data = [bunch.data[i] for i in chosen]
    for name in ("target", "actor", "take"):
        bunch[name] = bunch[name][chosen]
    return bunch


# %%
# From performances to a model
# ----------------------------


def synchronise(bunch, n_frames=100):
    """The four steps, one after the other so that each can be looked at."""
    cosines = DirectionCosines(bunch.skeleton).fit(bunch.data)
    postures = cosines.transform(bunch.data)
    aspace = ASpace(0.95).fit(postures)
    points = aspace.transform(postures)
    linear = LinearSynchronizer(n_frames).fit(points)
    dense = DenseSynchronizer(n_frames)
    start = time.perf_counter()
    dense.fit(points)
    fitted = time.perf_counter()
    synchronised = dense.transform(points)
    warped = time.perf_counter()
    model = ActionModel().fit(synchronised)
    return {
        "cosines": cosines,
        "aspace": aspace,
        "points": points,
        "linear": linear.transform(points),
        "dense": dense,
        "synchronised": synchronised,
        "model": model,
        "fit_seconds": fitted - start,
        "warp_seconds": warped - fitted,
    }


# %%
# The report
# ----------


def spread(performances):
    """RMS distance from the mean of the performances still running at each frame."""
    longest = max(len(x) for x in performances)
    total = count = 0
    for frame in range(longest):
        now = np.array([x[frame] for x in performances if len(x) > frame])
        total += np.square(now - now.mean(axis=0)).sum()
        count += len(now)
    return np.sqrt(total / count)


def key_frame_rows(bunch, result):
    """How closely known key-frames are hit, if they are known."""
    if "keyframes" not in bunch:
        return []
    linear = LinearSynchronizer(result["dense"].n_frames_).fit(result["points"])
    lengths, rows = [len(x) for x in bunch.data], []
    for name, synchronizer in (("linear", linear), ("dense", result["dense"])):
        n = synchronizer.pattern_index_
        on_clock = bunch.keyframes[n] * (synchronizer.n_frames_ - 1) / (lengths[n] - 1)
        times = synchronizer.match(result["points"]).times
        error = keyframe_error(times, bunch.keyframes, on_clock, lengths)
        rows.append((f"key-frames missed by, {name}", f"{error:.2f} frames", "-"))
    return rows


def report(bunch, result):
    """Print what was found, beside the figures of the paper."""
    lengths = [len(x) for x in bunch.data]
    aspace, dense = result["aspace"], result["dense"]
    n = len(lengths)
    order = np.argsort(dense.global_distances_)
    margin = dense.global_distances_[order[1]] / dense.global_distances_[order[0]] - 1
    # Among many performances, only the best few are compared with all others.
    lead = f"{margin:.1%} below the next" if np.isfinite(margin) else "the others: rejected sooner"
    raw = spread(result["points"])
    median = dense.pattern_index_
    rows = [
        ("performances", f"{n} of {bunch.target[0]}", "40 of bending"),
        ("actors", f"{len(set(bunch.actor))}", "-"),
        (
            "frames (min / median / max)",
            f"{min(lengths)} / {np.median(lengths):.0f} / {max(lengths)}",
            "100 on average",
        ),
        ("eigenvectors b", f"{aspace.n_components_}", "16"),
        ("variance kept", f"{aspace.explained_variance_ratio_.sum():.1%}", "95%"),
        (
            "median performance",
            f"number {median} (actor {bunch.actor[median]}, take {bunch.take[median]})",
            "-",
        ),
        ("its global distance", lead, "-"),
        ("refined by postures", "yes" if dense.refines_ else "no: styles differ", "-"),
        ("spread before", f"{raw:.3f}", "-"),
        ("spread, linear", f"{spread(result['linear']):.3f}", "-"),
        ("spread, dense", f"{spread(result['synchronised']):.3f}", "-"),
        (
            "spread of velocity, dense",
            f"{sobolev_least_squares(result['linear'], result['synchronised']):.0%} of linear",
            "-",
        ),
        *key_frame_rows(bunch, result),
        ("time of fit", f"{1e3 * result['fit_seconds']:.0f} ms", "-"),
        ("the same, a match", f"{1e3 * result['fit_seconds'] / dense.n_matches_:.3f} ms", "15 ms"),
        ("time of warping all", f"{1e3 * result['warp_seconds']:.0f} ms", "600 ms"),
    ]
    width = max(len(value) for _, value, _ in rows)
    print(f"{'':28s} {'here':{width}s}  paper")
    for name, value, paper in rows:
        print(f"{name:28s} {value:{width}s}  {paper}")


# %%
# Fig. 3: the first dimensions of the aSpace
# -------------------------------------------


def draw_dimensions(result):
    """Performances before and after, and the learnt model with its envelope."""
    n_dims = min(4, result["aspace"].n_components_)
    figure, axes = plt.subplots(
        n_dims, 3, figsize=(11, 2.1 * n_dims), sharey="row", squeeze=False, layout="constrained"
    )
    model = result["model"]
    lower, upper = model.envelope()
    columns = [("Performances", result["points"]), ("Synchronised", result["synchronised"])]
    for row, axis_row in enumerate(axes):
        for axis, (title, performances) in zip(axis_row[:2], columns, strict=True):
            for x in performances:
                axis.plot(x[:, row], color="C0", alpha=0.35, linewidth=0.8)
            axis.set_title(title if row == 0 else "")
        pattern = result["dense"].pattern_[:, row]
        axis_row[1].plot(pattern, color="black", linewidth=1.4, label="median performance")
        model_axis = axis_row[2]
        for x in result["synchronised"]:
            model_axis.plot(x[:, row], "--", color="C0", alpha=0.3, linewidth=0.6)
        frames = np.arange(model.n_frames_)
        label = f"mean ± {model.n_std:g} std"
        model_axis.fill_between(frames, lower[:, row], upper[:, row], color="0.85", label=label)
        for bound in (lower, upper):
            model_axis.plot(bound[:, row], color="black", linewidth=0.8)
        model_axis.plot(model.mean_[:, row], color="C3", linewidth=1.8, label="mean")
        model_axis.set_title("Model" if row == 0 else "")
        axis_row[0].set_ylabel(f"aSpace {row + 1}")
    for axis in axes[-1]:
        axis.set_xlabel("frame")
    axes[0, 1].legend(loc="best", fontsize="small")
    axes[0, 2].legend(loc="best", fontsize="small")
    return figure


# %%
# Fig. 4: mean postures, and postures that the model accepts
# -----------------------------------------------------------


def draw_postures(result, frames=(0.1, 0.4, 0.6), n_samples=12):
    """Stick figures at some shares of the action: the mean, and random accepted postures."""
    model, aspace, cosines = result["model"], result["aspace"], result["cosines"]
    frames = [round(share * (model.n_frames_ - 1)) for share in frames]

    def positions(points):
        return cosines.inverse_transform(aspace.inverse_transform(points))

    figure, axes = plt.subplots(
        1, 2 * len(frames), figsize=(11, 3.6), sharex=True, sharey=True, layout="constrained"
    )
    for frame, (mean_axis, sample_axis) in zip(frames, axes.reshape(-1, 2), strict=True):
        mean = positions(model.mean_[[frame]])
        draw_body(mean_axis, mean[0], linewidth=2.2)
        mean_axis.set_title(f"frame {frame}\nmean posture", fontsize="medium")
        samples = model.sample(n_samples, frame=frame, random_state=frame)
        for posture in positions(samples):
            draw_body(sample_axis, posture, linewidth=0.8, alpha=0.5)
        accepted = model.accepts(samples, frame).sum()
        sample_axis.set_title(f"frame {frame}\n{accepted} accepted samples", fontsize="medium")
    axes[0].set_ylabel("height (unit of the recording)")
    for axis in axes:
        axis.set_aspect("equal")
        axis.set_xticks([])
    handles = [plt.Line2D([], [], color=c, label=n) for n, c in SIDES.items()]
    figure.legend(handles=handles, loc="outside lower center", ncols=3, fontsize="small")
    return figure


SIDES = {"left": "C0", "middle": "0.3", "right": "C1"}


def draw_body(axis, positions, **style):
    """A stick figure of the fifteen joints, seen half from the side."""
    skeleton = Skeleton.paper()
    x, y, z = positions.reshape(-1, 3).T
    across = 0.8 * z - 0.6 * x
    for a, b in skeleton.bones:
        side = skeleton.joints[b].split("_")[0]
        color = SIDES[side if side in SIDES else "middle"]
        axis.plot([across[a], across[b]], [y[a], y[b]], color=color, **style)


# %%
# All of it
# ---------


def main(arguments=None):
    """Print the report and write the figures."""
    parser = argparse.ArgumentParser(description="Synchronise and model performances of an action.")
    parser.add_argument("--data", help="archive of performances (.npz); by default synthetic ones")
    parser.add_argument("--action", help="which action of the archive")
    parser.add_argument("--output", default=".", help="folder of the figures")
    options = parser.parse_args(arguments)
    bunch = read_performances(options.data, options.action)
    result = synchronise(bunch)
    report(bunch, result)
    output = Path(options.output)
    output.mkdir(parents=True, exist_ok=True)
    for name, draw in (("dimensions", draw_dimensions), ("postures", draw_postures)):
        path = output / f"bending_{name}.png"
        draw(result).savefig(path, dpi=120)
        print(f"figure written: {path}")


if __name__ == "__main__":
    main()
