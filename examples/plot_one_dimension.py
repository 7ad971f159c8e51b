"""
One dimension of two trials (Fig. 1)
====================================

You get four views of the same two trials: as recorded, and aligned in three ways. They are linear
normalisation, key-frames, and dense matching. The true timing is known here, so each view has its
error. The figure is the paper's first.
"""

import matplotlib.pyplot as plt
import numpy as np
from sklearn_motionsync import (
    ASpace,
    DenseSynchronizer,
    DirectionCosines,
    LinearSynchronizer,
)
from sklearn_motionsync.datasets import make_bending
from sklearn_motionsync.metrics import group_timing_error

bunch = make_bending(12, random_state=2)
poses = DirectionCosines(bunch.skeleton).fit_transform(bunch.data)
points = ASpace(0.95).fit_transform(poses)

# %%
# Two of the twelve
# -----------------
# They are the pattern, and the trial whose pace differs most from it.

dense = DenseSynchronizer(n_frames=100).fit(points)
base = dense.pattern_index_
other = np.abs(dense.match(points).offsets).mean(axis=1).argmax()
pair = [base, other]
print(f"the pattern is trial {base}, the other one trial {other}")

# %%
# Three alignments
# ----------------
# Linear normalisation assumes that the pace differs by one factor (Eq. 7). Five key-frames, here
# the true ones, correct five moments, and assume an even pace between them. Dense matching finds
# a time for each frame (Eqs. 12 to 17).

linear = LinearSynchronizer(n_frames=100, pattern=base).fit(points)
manual = LinearSynchronizer(n_frames=100, pattern=base).fit(points, keyframes=bunch.keyframes)
times = {
    "linear": linear.match(points).times,
    "five key-frames": manual.match(points, keyframes=bunch.keyframes).times,
    "dense": dense.match(points).times,
}
warped = {
    "linear": linear.transform(points),
    "five key-frames": manual.transform(points, keyframes=bunch.keyframes),
    "dense": dense.transform(points),
}

figure, axes = plt.subplots(2, 2, figsize=(6.4, 5), sharey=True, layout="constrained")
styles = [("black", "-", "pattern"), ("#0072B2", "--", "other trial")]
for i, (color, line, label) in zip(pair, styles, strict=True):
    axes[0, 0].plot(points[i][:, 0], line, color=color, label=label)
    for axis, result in zip(axes.flat[1:], warped.values(), strict=True):
        axis.plot(result[i, :, 0], line, color=color)
axes[0, 0].set_title("(a) as recorded", fontsize="medium")
for axis, (name, tau), letter in zip(axes.flat[1:], times.items(), "bcd", strict=True):
    error = group_timing_error(tau[pair], [bunch.times[i] for i in pair])
    axis.set_title(f"({letter}) {name}:\n{error:.2f} frames apart", fontsize="medium")
for axis in axes[1]:
    axis.set_xlabel("frame")
for axis in axes[:, 0]:
    axis.set_ylabel("first dimension")
axes[0, 0].legend(frameon=False, fontsize="small")
_ = figure.suptitle("Dense matching aligns two trials best")

# %%
# All twelve
# ----------
# The error is how far apart all trials show the same moment, on average over the frames.

for name, tau in times.items():
    print(f"{name:16s} {group_timing_error(tau, bunch.times):.2f} frames")

# %%
# Where it fails
# --------------
# A trial may be shifted by more than ``max_offset``, a share of the length. Dense matching then
# cannot reach the right frame.

for max_offset in (0.05, 0.4):
    narrow = DenseSynchronizer(n_frames=100, pattern=base, max_offset=max_offset).fit(points)
    error = group_timing_error(narrow.match(points).times, bunch.times)
    print(f"max_offset={max_offset}: {error:.2f} frames")
plt.show()
