"""
Bending down, by many people (Figs. 3 and 4)
============================================

You get a report, and two figures: forty bends before and after their alignment, and the poses that
a model of them accepts. The joint positions become principal components of poses, the aSpace.
Dense matching aligns them with the most typical trial, the pattern. `ActionModel` then learns the
mean and how much people vary. The figures are the paper's third and fourth.

The trials are synthetic by default. As a script it also takes an archive of real ones:
``python examples/plot_bending.py --data hdm05_positions.npz --action depositFloorR``.
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
    LinearSynchronizer,
)
from sklearn_motionsync.datasets import load_trials, make_bending
from sklearn_motionsync.display import ActionModelDisplay, SkeletonDisplay, SynchronizationDisplay
from sklearn_motionsync.metrics import keyframe_error

parser = argparse.ArgumentParser(
    description="Align and model trials of an action.", allow_abbrev=False
)
parser.add_argument("--data", help="archive of trials (.npz); by default synthetic ones")
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
    stop("--action chooses among the trials of an archive: give --data, too.")
if output.exists() and not output.is_dir():
    stop(f"--output must be a folder, {output} is a file.")

# %%
# The trials
# ----------
# They are a list of arrays, one for each trial, with any number of frames. Each row holds x, y
# and z of every joint.


def read_trials(path=None, action=None):
    """Trials of one action, as a Bunch."""
    if path is None:
        return make_bending(random_state=0)
    try:
        bunch = load_trials(path)
    except (OSError, ValueError) as error:
        stop(f"--data {path}: {error}")
    actions = sorted(set(bunch.target))
    if action is None and len(actions) > 1:
        stop(f"Choose one with --action: {', '.join(actions)}.")
    chosen = np.flatnonzero(bunch.target == (action or actions[0]))
    if len(chosen) < 2:
        names = ", ".join(actions)
        stop(f"There are {len(chosen)} trials of {action or actions[0]!r} among {names}.")
    if bunch.skeleton is None:
        stop("The names of the joints do not tell which ones are the body's.")
    bunch.data = [bunch.data[i] for i in chosen]
    for name in ("target", "actor", "take"):
        bunch[name] = bunch[name][chosen]
    return bunch


bunch = read_trials(options.data, options.action)
lengths = [len(x) for x in bunch.data]
print(f"{len(bunch.data)} trials of {min(lengths)} to {max(lengths)} frames")

# %%
# From trials to a model
# ----------------------
# The four steps are poses (Eq. 1), their principal components (Eqs. 3 to 5), alignment (Eqs. 7 to
# 19), and the model. ``pipe.fit(bunch.data)`` does all of them. Here they are called one by one, to
# time the third.

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
# The subjects tell the model how people differ.
groups = bunch.actor if len(set(bunch.actor)) > 2 else None
model.fit(synchronised, groups=groups)
pipe

# %%
# The report
# ----------
# The last column holds the numbers of the paper, where it has any.


def spread(trials):
    """RMS distance from the mean of the trials still running at each frame."""
    total = count = 0
    for frame in range(max(len(x) for x in trials)):
        now = np.array([x[frame] for x in trials if len(x) > frame])
        total += np.square(now - now.mean(axis=0)).sum()
        count += len(now)
    return np.sqrt(total / count)


def missed_by(synchronizer):
    """How far known key-frames are missed."""
    n = synchronizer.pattern_index_
    on_clock = bunch.keyframes[n] * (synchronizer.n_frames_ - 1) / (lengths[n] - 1)
    return keyframe_error(synchronizer.match(points).times, bunch.keyframes, on_clock, lengths)


def accepted():
    """How many trials a model of the other subjects accepts: as they are, and spoilt."""
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
median = dense.pattern_index_
order = np.argsort(dense.global_distances_)
margin = dense.global_distances_[order[1]] / dense.global_distances_[order[0]] - 1
rows = [
    ("trials", f"{len(points)} of {bunch.target[0]}", "40 of bending"),
    ("subjects", f"{len(set(bunch.actor))}", "-"),
    ("frames, shortest", f"{min(lengths)}", "-"),
    ("frames, median", f"{np.median(lengths):.0f}", "100 on average"),
    ("frames, longest", f"{max(lengths)}", "-"),
    ("eigenvectors b", f"{aspace.n_components_}", "16"),
    ("variance kept", f"{aspace.explained_variance_ratio_.sum():.1%}", "95%"),
    ("pattern", f"{median} ({bunch.actor[median]}, take {bunch.take[median]})", "-"),
    ("its global distance", f"{margin:.1%} below the next", "-"),
    ("left unexplained", f"{dense.unexplained_variance_:.3f}", "-"),
    ("refined by poses", "yes" if dense.refines_ else "no: people differ", "-"),
    ("spread before", f"{spread(points):.3f}", "-"),
    ("spread, linear", f"{spread(stretched):.3f}", "-"),
    ("spread, dense", f"{spread(synchronised):.3f}", "-"),
]
if "keyframes" in bunch:
    rows += [
        ("key-frames missed, linear", f"{missed_by(linear):.2f} frames", "-"),
        ("key-frames missed, dense", f"{missed_by(dense):.2f} frames", "-"),
    ]
if groups is not None:
    rows += [
        (f"accepted, {name}", f"{count} of {len(points)}, subjects held out", "-")
        for name, count in accepted().items()
    ]
rows += [
    ("time of fit", f"{1e3 * (fitted - start):.0f} ms", "-"),
    ("the same, a match", f"{1e3 * (fitted - start) / len(points) ** 2:.3f} ms", "15 ms"),
    ("time of warping all", f"{1e3 * (warped - fitted):.0f} ms", "600 ms"),
]
width = max(len(value) for _, value, _ in rows)
print(f"{'':28s} {'here':{width}s}  paper")
for name, value, paper in rows:
    print(f"{name:28s} {value:{width}s}  {paper}")

# %%
# What is refused
# ---------------
# The rows "accepted" judge each person by a model of the others. Trials that run backwards, stop
# half-way or stand still should be refused. On synthetic trials they are. Real bends are accepted
# backwards, because the way down is much like the way up.

# %%
# Fig. 3: the first dimensions of the aSpace
# -------------------------------------------
# The first row shows the trials as recorded, the second one aligned. For the third row, key-frames
# are known, and the trials are stretched evenly between them. The dense matching of the second row
# does not use them. The last row is the model.

n_dims = min(2, aspace.n_components_)
dimensions, axes = plt.subplots(
    4, n_dims, figsize=(6.4, 8.6), sharey="col", squeeze=False, layout="constrained"
)
SynchronizationDisplay.from_estimator(
    pipe, bunch.data, features=range(n_dims), warps=False, ax=axes[:2].T
)
keyframes = bunch.get("keyframes")
straight = LinearSynchronizer(n_frames=100).fit_transform(points, keyframes=keyframes)
for column, axis in enumerate(axes[2]):
    axis.plot(straight[:, :, column].T, color="#009E73", alpha=0.5, linewidth=0.9)
    axis.set_xlabel("frame of the pattern")
shown = ActionModelDisplay.from_estimator(
    pipe, bunch.data, features=range(n_dims), band="points", ax=axes[3]
)
shown.axes_[0].get_legend().remove()
titles = (
    f"as recorded: {len(points)} trials",
    "aligned by dense matching; black: the pattern",
    "stretched evenly" + ("" if keyframes is None else " between 5 key-frames in each"),
    "the model: mean and three standard deviations",
)
for place, (row, title) in enumerate(zip(axes, titles, strict=True)):
    for column, axis in enumerate(row):
        axis.set_title("")
        axis.set_xlabel(f"frame of the {'pattern' if place else 'trial'}")
        axis.set_ylabel("" if column else "first dimension")
    row[0].set_title(title, loc="left", fontsize="medium")
for axis in axes[:, 1:].flat:
    axis.set_ylabel("second dimension")
dimensions.suptitle(
    f"Aligned, the trials differ less:\nspread {spread(points):.2f} before, "
    f"{spread(synchronised):.2f} after"
)

# %%
# Fig. 4: mean poses, and poses that the model accepts
# ----------------------------------------------------
# The random poses lie within three standard deviations of the mean. Each is near a pose of a
# training trial at that frame.

display = SkeletonDisplay.from_model(pipe, frames=(0.1, 0.4), random_state=0)
poses = display.figure_
poses.suptitle("The model accepts poses that are close to its mean")

# %%

output.mkdir(parents=True, exist_ok=True)
for name, figure in (("dimensions", dimensions), ("poses", poses)):
    path = output / f"bending_{name}.png"
    figure.savefig(path, dpi=120)
    print(f"figure written: {path.name}")
