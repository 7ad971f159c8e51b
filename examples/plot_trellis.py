"""
The path through the trellis (Fig. 2)
=====================================

What dense matching sees: for every frame p of the pattern and every offset d, how much the two
performances differ. Dynamic programming finds the cheapest path from the first to the last frame
whose rate stays within bounds; that path is the warp.
"""

import matplotlib.pyplot as plt
import numpy as np
from sklearn_motionsync import ASpace, DenseSynchronizer, DirectionCosines
from sklearn_motionsync.datasets import make_bending
from sklearn_motionsync.display import TrellisDisplay

bunch = make_bending(12, random_state=2)
postures = DirectionCosines(bunch.skeleton).fit_transform(bunch.data)
points = ASpace(0.95).fit_transform(postures)

# %%
# As the paper has it
# -------------------
# Postures are compared (Eq. 12), the rate is 0, 1 or 2 (Eq. 13), and nothing else is done to
# the path.

paper = DenseSynchronizer.paper(n_frames=100).fit(points)
performance = int(np.abs(paper.match(points).offsets).mean(axis=1).argmax())
TrellisDisplay.from_estimator(paper, points, performance=performance)

# %%
# With the defaults
# -----------------
# Velocities and postures are compared in the metric that was learnt of the set, rates reach from 0
# to 4, and the path is only one of several votes.
# The valley is narrower where the body moves and wide where it rests: there the penalty on
# changes of pace decides.

dense = DenseSynchronizer(100, pattern=paper.pattern_index_).fit(points)
TrellisDisplay.from_estimator(dense, points, performance=performance)

# %%
# The true offsets
# ----------------
# Here they are known: the synthetic performances come with the share of the action that is over
# at each frame.

pattern, moving = (bunch.times[i] for i in (paper.pattern_index_, performance))
clock = np.linspace(0, 1, 100)
shown = np.interp(clock, np.linspace(0, 1, len(pattern)), pattern)
true = 99 * np.interp(shown, moving, np.linspace(0, 1, len(moving))) - np.arange(100)

figure, axis = plt.subplots(figsize=(7, 3), layout="constrained")
axis.plot(true, color="0.6", linewidth=5, label="true")
for name, color, synchronizer in (("paper", "#D55E00", paper), ("defaults", "#0072B2", dense)):
    offsets = synchronizer.match([points[performance]]).offsets[0]
    error = np.abs(offsets - true).mean()
    axis.plot(offsets, color=color, label=f"{name}: {error:.2f} frames off")
axis.set_xlabel(f"frame p of the pattern ({paper.pattern_index_})")
axis.set_ylabel(f"offset of performance {performance}")
axis.legend()
plt.show()
