"""
Between two people
==================

Two people bend down, each in a way and at a pace of their own. What would somebody do who is
between them? And what somebody who exaggerates?
"""

import matplotlib.pyplot as plt
import numpy as np
from sklearn.pipeline import make_pipeline
from sklearn_motionsync import (
    ASpace,
    DenseSynchronizer,
    DirectionCosines,
    Match,
    blend_performances,
)
from sklearn_motionsync.datasets import make_bending
from sklearn_motionsync.display import SkeletonDisplay

bunch = make_bending(8, style=2, random_state=11)
pipe = make_pipeline(DirectionCosines(bunch.skeleton), ASpace(0.95), DenseSynchronizer())
pipe.fit(bunch.data)

# The slowest and the fastest.
lengths = [len(x) for x in bunch.data]
X = [bunch.data[np.argmax(lengths)], bunch.data[np.argmin(lengths)]]

# %%
# In the middle
# -------------
# The blend takes the mean of their times, and what happens in it happens when it happens on
# average. Directions of limbs are averaged on the sphere, so that limbs are as long as the mean of
# both.

blend = blend_performances(pipe, X, [0.5, 0.5])
print("frames:", len(X[0]), len(blend), len(X[1]))

display = SkeletonDisplay.from_performances(
    [X[0], blend, X[1]], bunch.skeleton, names=["one", "half of each", "the other"]
)
animation = display.animate(seconds=3, fps=8)
plt.close()  # the player below shows it
animation

# %%
# Beyond, and at another one's pace
# ---------------------------------
# Weights of sum 1 may leave 0 and 1: what tells one from the other is then exaggerated. And
# timing has weights of its own.

beyond = blend_performances(pipe, X, [1.7, -0.7])
moved = blend_performances(pipe, X, [1, 0], timing=[0, 1])
print("frames:", len(beyond), len(moved))

display = SkeletonDisplay.from_performances(
    [beyond, X[0], moved],
    bunch.skeleton,
    names=["more than one", "one", "at the other's pace"],
    at=0.5,
)

# %%
# What goes wrong
# ---------------
# Averaged as numbers, positions of people who do not face the same way make nobody's body. That is
# what comes of a match without a skeleton, which cannot know what the numbers are.

numbers = blend_performances(Match.from_estimator(pipe, X), X, [0.5, 0.5])


def limb(x, start, end):
    joints = x.reshape(len(x), -1, 3)
    near, far = (joints[:, bunch.skeleton.index_of(name)] for name in (start, end))
    return np.linalg.norm(near - far, axis=1)


for name, x in (("as bodies", blend), ("as numbers", numbers)):
    length = limb(x, "left_shoulder", "right_shoulder")
    print(f"width of the shoulders {name}: {length.min():.2f} to {length.max():.2f} m")

SkeletonDisplay.from_performances(
    [blend, numbers], bunch.skeleton, names=["as bodies", "as numbers"], at=0.5
)
plt.show()
