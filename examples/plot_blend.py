"""
Between two people
==================

You get a movement that lies between those of two people. One of them bends slowly, the other one
fast, and each in an individual way. The blend has the mean of their timing and of their poses.
"""

import matplotlib.pyplot as plt
import numpy as np
from sklearn.pipeline import make_pipeline
from sklearn_motionsync import ASpace, DenseSynchronizer, DirectionCosines
from sklearn_motionsync.datasets import make_bending
from sklearn_motionsync.display import SkeletonDisplay
from sklearn_motionsync.synchronizers import blend_trials

bunch = make_bending(8, style=2, random_state=11)
pipe = make_pipeline(DirectionCosines(bunch.skeleton), ASpace(0.95), DenseSynchronizer())
pipe.fit(bunch.data)

# The slowest and the fastest.
lengths = [len(x) for x in bunch.data]
X = [bunch.data[np.argmax(lengths)], bunch.data[np.argmin(lengths)]]

# %%
# In the middle
# -------------
# Weights of one half each give the mean of both. Directions of limbs are averaged on the sphere, so
# each limb keeps the mean of both lengths.

blend = blend_trials(pipe, X, [0.5, 0.5])

display = SkeletonDisplay.from_trials(
    [X[0], blend, X[1]], bunch.skeleton, names=["slow", "blend", "fast"]
)
animation = display.animate(seconds=3, fps=8)
plt.close()  # the player below shows it
animation

# %%
# Where the trials have different times, the blend has the mean time:


def joint_of(x, name):
    """Positions (n_frames, 3) of a joint, in metres."""
    return x.reshape(len(x), -1, 3)[:, bunch.skeleton.index_of(name)]


def pelvis_height(x):
    return (joint_of(x, "left_hip")[:, 1] + joint_of(x, "right_hip")[:, 1]) / 2


def seconds(x):
    return np.arange(len(x)) / bunch.frame_rate


figure, axis = plt.subplots(figsize=(6.4, 3.2), layout="constrained")
styles = {"slow": "#0072B2", "blend": "black", "fast": "#D55E00"}
lowest = []
for (name, color), x in zip(styles.items(), (X[0], blend, X[1]), strict=True):
    height = pelvis_height(x)
    axis.plot(seconds(x), height, color=color, label=name)
    lowest.append(seconds(x)[height.argmin()])
    axis.plot(lowest[-1], height.min(), "o", color=color)
axis.set_xlabel("time (s)")
axis.set_ylabel("height of the pelvis (m)")
axis.legend(loc="lower right", frameon=False)
_ = axis.set_title(
    f"The blend is lowest at {lowest[1]:.2f} s,\n"
    f"between {lowest[2]:.2f} s (fast) and {lowest[0]:.2f} s (slow)"
)

# %%
# Exaggerated, and at the other pace
# ----------------------------------
# Weights add up to 1, but may be below 0 or above 1. The differences between both people are then
# exaggerated. The timing can have weights of its own.

beyond = blend_trials(pipe, X, [1.7, -0.7])
moved = blend_trials(pipe, X, [1, 0], timing=[0, 1])
figure, axis = plt.subplots(figsize=(6.4, 3.2), layout="constrained")
curves = {
    "slow": (X[0], "#0072B2", "-"),
    "slow, exaggerated": (beyond, "#0072B2", ":"),
    "slow, at the fast pace": (moved, "#0072B2", "--"),
    "fast": (X[1], "#D55E00", "-"),
}
for name, (x, color, line) in curves.items():
    axis.plot(seconds(x), pelvis_height(x), line, color=color, label=name)
axis.set_xlabel("time (s)")
axis.set_ylabel("height of the pelvis (m)")
axis.set_ylim(bottom=axis.get_ylim()[0] - 0.25)
axis.legend(loc="lower right", frameon=False, ncols=2)
_ = axis.set_title(
    f"{len(X[0])} frames at the own pace, {len(moved)} at the other,\n{len(beyond)} exaggerated"
)

# %%
# Where it fails
# --------------
# A synchronizer of positions has no skeleton, and averages them as numbers. These two people do not
# face the same way, and the mean is no human body: its shoulders are too narrow.

numbers = blend_trials(DenseSynchronizer().fit(X), X, [0.5, 0.5])
figure, axis = plt.subplots(figsize=(6.4, 3.2), layout="constrained")
for name, x, color in (
    ("slow", X[0], "#0072B2"),
    ("fast", X[1], "#D55E00"),
    ("blend with a skeleton", blend, "black"),
    ("blend as numbers", numbers, "#A000F0"),
):
    ends = joint_of(x, "left_shoulder"), joint_of(x, "right_shoulder")
    width = 100 * np.linalg.norm(ends[0] - ends[1], axis=1)
    axis.plot(np.linspace(0, 100, len(x)), width, color=color, label=name)
    print(f"{name}: shoulders {width.min():.0f} to {width.max():.0f} cm")
axis.set_ylim(0, 1.5 * width.max())
axis.set_xlabel("% of the time")
axis.set_ylabel("width of the shoulders (cm)")
axis.legend(loc="lower right", frameon=False)
axis.set_title("Averaged as numbers, the shoulders get too narrow")
plt.show()
