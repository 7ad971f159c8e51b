"""
One dimension of two performances (Fig. 1)
==========================================

Two performances of the same action as the paper shows them first: not synchronised, normalised
linearly, synchronised by key-frames, and by dense matching. The true timing is known here, so
each picture comes with the error it leaves.
"""

import matplotlib.pyplot as plt
import numpy as np
from sklearn_motionsync import (
    ASpace,
    DenseSynchronizer,
    DirectionCosines,
    KeyframeSynchronizer,
    LinearSynchronizer,
)
from sklearn_motionsync.datasets import make_bending
from sklearn_motionsync.metrics import group_timing_error

bunch = make_bending(12, random_state=2)
postures = DirectionCosines(bunch.skeleton).fit_transform(bunch.data)
points = ASpace(0.95).fit_transform(postures)

# %%
# Two of the twelve
# -----------------
# The pattern, and the performance whose pace differs most from it.

dense = DenseSynchronizer(n_frames=100).fit(points)
base = dense.pattern_index_
other = np.abs(dense.match(points).offsets).mean(axis=1).argmax()
pair = [base, other]
print(f"the pattern is performance {base}, the other one performance {other}")

# %%
# Four ways to compare them
# -------------------------
# The linear one assumes that the pace differs by one factor (Eq. 7). Key-frames, here the true
# ones, correct that in five moments; between them the pace is taken to be even. Dense matching
# finds a time for each frame (Eqs. 12 to 17).

linear = LinearSynchronizer(n_frames=100, pattern=base).fit(points)
manual = KeyframeSynchronizer(n_frames=100, pattern=base).fit(points, keyframes=bunch.keyframes)
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

figure, axes = plt.subplots(2, 2, figsize=(9, 5.2), sharey=True, layout="constrained")
styles = [("black", "-", f"pattern ({base})"), ("#0072B2", "--", f"performance {other}")]
for i, (color, line, label) in zip(pair, styles, strict=True):
    axes[0, 0].plot(points[i][:, 0], line, color=color, label=label)
    for axis, result in zip(axes.flat[1:], warped.values(), strict=True):
        axis.plot(result[i, :, 0], line, color=color)
axes[0, 0].set_title("(a) not synchronised")
for axis, (name, tau), letter in zip(axes.flat[1:], times.items(), "bcd", strict=True):
    error = group_timing_error(tau[pair], [bunch.times[i] for i in pair])
    axis.set_title(f"({letter}) {name}: {error:.2f} frames apart")
for axis in axes[1]:
    axis.set_xlabel("frame")
for axis in axes[:, 0]:
    axis.set_ylabel("first dimension of the aSpace")
axes[0, 0].legend()

# %%
# All twelve
# ----------
# How far all performances are from showing the same moment at every frame.

for name, tau in times.items():
    print(f"{name:16s} {group_timing_error(tau, bunch.times):.2f} frames")
plt.show()
