"""
People fall into step
=====================

The same performances above as they were recorded, below on one clock: play it, and see who waits
for whom.
"""

import matplotlib.pyplot as plt
from sklearn.pipeline import make_pipeline
from sklearn_motionsync import ASpace, DenseSynchronizer, DirectionCosines
from sklearn_motionsync.datasets import make_bending
from sklearn_motionsync.display import SkeletonDisplay, SynchronizationDisplay

bunch = make_bending(12, random_state=5)
pipe = make_pipeline(DirectionCosines(bunch.skeleton), ASpace(0.95), DenseSynchronizer()).fit(
    bunch.data
)

# %%
# In motion
# ---------
# Matching is done in the aSpace; the joint positions follow along the same warps. The leftmost
# performance is the pattern, whose clock the others take over.

display = SkeletonDisplay.from_estimator(
    pipe, bunch.data, performances=[pipe[-1].pattern_index_, 0, 1, 2]
)
animation = display.animate(seconds=4, fps=12)
plt.close()  # the player below shows it
animation

# %%
# In curves
# ---------
# The height of the pelvis and the lean of the torso are postures, not dimensions of the aSpace;
# a synchronizer without an aSpace shows them.

postures = make_pipeline(DirectionCosines(bunch.skeleton), DenseSynchronizer()).fit(bunch.data)
SynchronizationDisplay.from_estimator(
    postures, bunch.data, features=["pelvis_height", "torso_z"], groups=bunch.actor
)

# %%
# A strip of one of them
# ----------------------

SkeletonDisplay.from_positions(bunch.data[0], bunch.skeleton, frames=6)
plt.show()
