"""
Several people, moving together
===============================

You get an animation of four people: above as they were recorded, below aligned. Aligned, all of
them reach the floor at the same moment.
"""

import matplotlib.pyplot as plt
import numpy as np
from sklearn.pipeline import make_pipeline
from sklearn_motionsync import ASpace, DenseSynchronizer, DirectionCosines
from sklearn_motionsync.datasets import make_bending
from sklearn_motionsync.display import SkeletonDisplay, SynchronizationDisplay

bunch = make_bending(12, random_state=5)
pipe = make_pipeline(DirectionCosines(bunch.skeleton), ASpace(0.95), DenseSynchronizer())
pipe.fit(bunch.data)

# %%
# In motion
# ---------
# The principal components of the poses are matched. The joint positions then follow the same
# warps. The leftmost trial is the pattern, which the others are aligned with.

display = SkeletonDisplay.from_estimator(
    pipe, bunch.data, trials=[pipe[-1].pattern_index_, 0, 1, 2]
)
display.figure_.suptitle("Aligned (below), all of them reach the floor together")
animation = display.animate(seconds=4, fps=12)
plt.close()  # the player below shows it
animation

# %%
# In curves
# ---------
# The height of the pelvis and the lean of the torso are part of the pose. A pipeline without an
# aSpace shows them.

poses = make_pipeline(DirectionCosines(bunch.skeleton), DenseSynchronizer()).fit(bunch.data)
display = SynchronizationDisplay.from_estimator(
    poses, bunch.data, features=["pelvis_height", "torso_z"], y=bunch.actor
)
display.axes_[0].set_ylabel("pelvis height\n(1: upright)")
display.axes_[2].set_ylabel("torso forward\n(cosine)")
curves = poses.transform(bunch.data)[:, :, 0]
lowest = [100 * x[:, 0].argmin() / (len(x) - 1) for x in poses[:-1].transform(bunch.data)]
aligned = 100 * curves.argmin(axis=1) / (curves.shape[1] - 1)
_ = display.figure_.suptitle(
    f"The lowest points meet:\nspread {np.std(lowest):.1f} before, "
    f"{np.std(aligned):.1f} % of the time after"
)

# %%
# One trial
# ---------

display = SkeletonDisplay.from_positions(bunch.data[0], bunch.skeleton, frames=4)
_ = display.figure_.suptitle("One bend, from upright to upright")

# %%
# What is refused
# ---------------
# A recording that was cut off does not end where the others end. Nothing can show that in advance,
# so it is aligned as well, and its last pose meets the end of the pattern. A trial whose joints
# are missing is refused:

try:
    pipe.transform([bunch.data[0][:, :-3]])
except ValueError as error:
    print(error)
plt.show()
