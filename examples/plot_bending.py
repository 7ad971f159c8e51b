"""
Bending down, by many people, on one clock (Figs. 3 and 4)
==========================================================

From joint positions to a model of an action: the postures of all performances become points of an
aSpace, dense matching puts them on the clock of the median performance, and what they have in
common is learnt. The figures are the paper's third and fourth.

By default the performances are the embedded synthetic ones. As a script it also takes an archive
of real ones, ``python examples/plot_bending.py --data hdm05_positions.npz --action
depositFloorR``.
"""

import argparse
import sys
import time
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np
from sklearn.base import clone
from sklearn.model_selection import LeaveOneGroupOut
from sklearn.pipeline import make_pipeline
from sklearn_motionsync import (
    ActionModel,
    ASpace,
    DenseSynchronizer,
    DirectionCosines,
    KeyframeSynchronizer,
    LinearSynchronizer,
)
from sklearn_motionsync.datasets import load_performances, make_bending
from sklearn_motionsync.display import ActionModelDisplay, SkeletonDisplay, SynchronizationDisplay
from sklearn_motionsync.metrics import keyframe_error, sobolev_least_squares

parser = argparse.ArgumentParser(
    description="Synchronise and model performances of an action.", allow_abbrev=False
)
parser.add_argument("--data", help="archive of performances (.npz); by default synthetic ones")
parser.add_argument("--action", help="which action of the archive")
parser.add_argument("--output", default=".", help="folder of the figures")


def stop(reason):
    """End with one line that says why, and status 2."""
    print(f"{parser.prog}: {reason}", file=sys.stderr)
    end = SystemExit(reason)  # which a notebook shows
    end.code = 2
    raise end


parser.error = stop
# The arguments of a notebook are its own.
is_script = "__file__" in globals() or Path(sys.argv[0]).name == "plot_bending.py"
options = parser.parse_args(sys.argv[1:] if is_script else [])
output = Path(options.output)
if options.action and not options.data:
    stop("--action chooses among the performances of an archive: give --data, too.")
if output.exists() and not output.is_dir():
    stop(f"--output must be a folder, {output} is a file.")

# %%
# The performances
# ----------------
# A list of arrays, one a performance, each with its own number of frames. Each row holds x, y
# and z of every joint.


def read_performances(path=None, action=None):
    """Performances of one action, as a Bunch."""
    if path is None:
        return make_bending(random_state=0)
    try:
        bunch = load_performances(path)
    except (OSError, ValueError) as error:
        stop(f"--data {path}: {error}")
    actions = sorted(set(bunch.target))
    if action is None and len(actions) > 1:
        stop(f"Choose one with --action: {', '.join(actions)}.")
    chosen = np.flatnonzero(bunch.target == (action or actions[0]))
    if len(chosen) < 2:
        names = ", ".join(actions)
        stop(f"There are {len(chosen)} performances of {action or actions[0]!r} among {names}.")
    if bunch.skeleton is None:
        stop("The names of the joints do not tell which ones are the body's.")
    bunch.data = [bunch.data[i] for i in chosen]
    for name in ("target", "actor", "take"):
        bunch[name] = bunch[name][chosen]
    return bunch


bunch = read_performances(options.data, options.action)
lengths = [len(x) for x in bunch.data]
print(f"{len(bunch.data)} performances of {min(lengths)} to {max(lengths)} frames")

# %%
# From performances to a model
# ----------------------------
# Four steps: postures (Eq. 1), their principal components (Eqs. 3 to 5), one clock (Eqs. 7 to
# 19), and what the action looks like at every frame of it. ``pipe.fit(bunch.data)`` would do
# all of them; here the third is timed by itself.

pipe = make_pipeline(
    DirectionCosines(bunch.skeleton), ASpace(0.95), DenseSynchronizer(n_frames=100), ActionModel()
)
cosines, aspace, dense, model = (step for _, step in pipe.steps)
points = aspace.fit_transform(cosines.fit_transform(bunch.data))
start = time.perf_counter()
dense.fit(points)
fitted = time.perf_counter()
synchronised = dense.transform(points)
warped = time.perf_counter()
# Who performed tells the model how people differ.
groups = bunch.actor if len(set(bunch.actor)) > 2 else None
model.fit(synchronised, groups=groups)
pipe

# %%
# The report
# ----------
# Beside the figures of the paper, where it gives any.


def spread(performances):
    """RMS distance from the mean of the performances still running at each frame."""
    total = count = 0
    for frame in range(max(len(x) for x in performances)):
        now = np.array([x[frame] for x in performances if len(x) > frame])
        total += np.square(now - now.mean(axis=0)).sum()
        count += len(now)
    return np.sqrt(total / count)


def missed_by(synchronizer):
    """How far known key-frames are missed."""
    n = synchronizer.pattern_index_
    on_clock = bunch.keyframes[n] * (synchronizer.n_frames_ - 1) / (lengths[n] - 1)
    return keyframe_error(synchronizer.match(points).times, bunch.keyframes, on_clock, lengths)


def accepted():
    """How many performances a model of the other actors accepts: as they are, and spoilt."""
    spoil = {
        "as they are": lambda x: x,
        "backwards": lambda x: x[::-1],
        "first half": lambda x: x[: len(x) // 2],
        "standing still": lambda x: np.repeat(x[:1], len(x), axis=0),
    }
    counts = dict.fromkeys(spoil, 0)
    folds = LeaveOneGroupOut().split(bunch.data, groups=groups)
    for train, test in folds:
        known = [bunch.data[i] for i in train]
        others = clone(pipe).fit(known, actionmodel__groups=groups[train])
        for name, change in spoil.items():
            counts[name] += np.sum(others.predict([change(bunch.data[i]) for i in test]) == 1)
    return counts


linear = LinearSynchronizer(n_frames=100).fit(points)
stretched = linear.transform(points)
calmer = sobolev_least_squares(stretched, synchronised)
median = dense.pattern_index_
order = np.argsort(dense.global_distances_)
margin = dense.global_distances_[order[1]] / dense.global_distances_[order[0]] - 1
# Among many performances, only the best few are compared with all others.
lead = f"{margin:.1%} below the next" if np.isfinite(margin) else "the others: rejected sooner"
rows = [
    ("performances", f"{len(points)} of {bunch.target[0]}", "40 of bending"),
    ("actors", f"{len(set(bunch.actor))}", "-"),
    ("frames, shortest", f"{min(lengths)}", "-"),
    ("frames, median", f"{np.median(lengths):.0f}", "100 on average"),
    ("frames, longest", f"{max(lengths)}", "-"),
    ("eigenvectors b", f"{aspace.n_components_}", "16"),
    ("variance kept", f"{aspace.explained_variance_ratio_.sum():.1%}", "95%"),
    ("median performance", f"{median} ({bunch.actor[median]}, take {bunch.take[median]})", "-"),
    ("its global distance", lead, "-"),
    ("refined by postures", "yes" if dense.refines_ else "no: no help", "-"),
    ("spread before", f"{spread(points):.3f}", "-"),
    ("spread, linear", f"{spread(stretched):.3f}", "-"),
    ("spread, dense", f"{spread(synchronised):.3f}", "-"),
    ("spread of velocity, dense", f"{calmer:.0%} of linear", "-"),
]
if "keyframes" in bunch:
    rows += [
        ("key-frames missed, linear", f"{missed_by(linear):.2f} frames", "-"),
        ("key-frames missed, dense", f"{missed_by(dense):.2f} frames", "-"),
    ]
if groups is not None:
    rows += [
        (f"accepted, {name}", f"{count} of {len(points)}, actors held out", "-")
        for name, count in accepted().items()
    ]
rows += [
    ("time of fit", f"{1e3 * (fitted - start):.0f} ms", "-"),
    ("the same, a match", f"{1e3 * (fitted - start) / dense.n_matches_:.3f} ms", "15 ms"),
    ("time of warping all", f"{1e3 * (warped - fitted):.0f} ms", "600 ms"),
]
width = max(len(value) for _, value, _ in rows)
print(f"{'':28s} {'here':{width}s}  paper")
for name, value, paper in rows:
    print(f"{name:28s} {value:{width}s}  {paper}")

# %%
# Fig. 3: the first dimensions of the aSpace
# -------------------------------------------
# As recorded; synchronised, the median performance in black; by hand, where key-frames are
# known: stretched evenly between them; and the learnt model. The dense matching knows nothing
# of the key-frames.

n_dims = min(4, aspace.n_components_)
dimensions, axes = plt.subplots(
    n_dims, 4, figsize=(12, 2.1 * n_dims), sharey="row", squeeze=False, layout="constrained"
)
SynchronizationDisplay.from_estimator(
    pipe, bunch.data, features=range(n_dims), warps=False, ax=axes[:, :2]
)
by_hand = KeyframeSynchronizer(n_frames=100).fit_transform(points, keyframes=bunch.get("keyframes"))
for row, axis in enumerate(axes[:, 2]):
    axis.plot(by_hand[:, :, row].T, color="#009E73", alpha=0.5, linewidth=0.9)
given = "given" if "keyframes" in bunch else "found"
axes[0, 2].set_title(f"with key-frames\n{given}, 5 in each", fontsize="medium")
axes[-1, 2].set_xlabel("frame of its pattern")
shown = ActionModelDisplay.from_estimator(pipe, bunch.data, features=range(n_dims), ax=axes[:, 3])
shown.axes_[0].get_legend().remove()
shown.axes_[0].set_title("the model\nmean, three standard deviations", fontsize="medium")
for axis in shown.axes_[:-1]:
    axis.set_xlabel("")
for axis in shown.axes_:
    axis.set_ylabel("")

# %%
# Fig. 4: mean postures, and postures that the model accepts
# -----------------------------------------------------------
# Each lies about a posture that somebody was in at that frame, within three standard deviations of
# the mean.

postures = SkeletonDisplay.from_model(pipe, frames=(0.1, 0.4, 0.6), random_state=0).figure_

# %%

output.mkdir(parents=True, exist_ok=True)
for name, figure in (("dimensions", dimensions), ("postures", postures)):
    path = output / f"bending_{name}.png"
    figure.savefig(path, dpi=120)
    print(f"figure written: {path.name}")
