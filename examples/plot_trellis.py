"""
The path through the trellis (Fig. 2)
=====================================

You get a picture of how dense matching finds a warp. It compares each frame p of the pattern with
the trial at each offset d. Dynamic programming then finds the cheapest path from the first to the
last frame. That path is the warp. The figure is the paper's second.
"""

import matplotlib.pyplot as plt
import numpy as np
from sklearn_motionsync import ASpace, DenseSynchronizer, DirectionCosines, LinearSynchronizer
from sklearn_motionsync.datasets import make_bending
from sklearn_motionsync.display import TrellisDisplay

bunch = make_bending(12, random_state=2)
poses = DirectionCosines(bunch.skeleton).fit_transform(bunch.data)
points = ASpace(0.95).fit_transform(poses)

# %%
# As in the paper
# ---------------
# Poses are compared (Eq. 12). The trial may advance by 0, 1 or 2 frames at each frame of the
# pattern (Eq. 13).

paper = DenseSynchronizer.paper(n_frames=100).fit(points)
trial = int(np.abs(paper.match(points).offsets).mean(axis=1).argmax())
display = TrellisDisplay.from_estimator(paper, points, trial=trial)
_ = display.figure_.suptitle("The warp is the cheapest path through the dark valley")

# %%
# With the defaults
# -----------------
# Velocities and poses are compared, with weights learnt from all trials. Rates reach from 0 to 4.
# The final warp is voted on by several paths. The valley is narrow where the body moves. It is
# wide where the body rests; there a penalty on changes of pace decides.

dense = DenseSynchronizer(100, pattern=paper.pattern_index_).fit(points)
display = TrellisDisplay.from_estimator(dense, points, trial=trial)
_ = display.figure_.suptitle("With the defaults, the warp in the end is smooth")

# %%
# The true offsets
# ----------------
# The synthetic trials come with the share of the action that is done at each frame. The true
# offsets follow from it.

pattern, moving = (bunch.times[i] for i in (paper.pattern_index_, trial))
clock = np.linspace(0, 1, 100)
shown = np.interp(clock, np.linspace(0, 1, len(pattern)), pattern)
true = 99 * np.interp(shown, moving, np.linspace(0, 1, len(moving))) - np.arange(100)

figure, axis = plt.subplots(figsize=(6.4, 3.2), layout="constrained")
axis.plot(true, color="0.6", linewidth=5, label="true")
errors = []
for name, color, synchronizer in (("paper", "#D55E00", paper), ("defaults", "#0072B2", dense)):
    offsets = synchronizer.match([points[trial]]).offsets[0]
    errors.append(np.abs(offsets - true).mean())
    axis.plot(offsets, color=color, label=f"{name}: {errors[-1]:.2f} frames off")
axis.set_xlabel("frame p of the pattern")
axis.set_ylabel("offset d of the trial (frames)")
axis.legend(frameon=False)
_ = axis.set_title(f"Both paths are true to {max(errors):.1f} frames")

# %%
# What is refused
# ---------------
# Linear normalisation compares no frames, so there is nothing to draw:

try:
    TrellisDisplay.from_estimator(LinearSynchronizer(100).fit(points), points)
except ValueError as error:
    print(error)
plt.show()
