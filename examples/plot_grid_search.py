"""
Choosing parameters with GridSearchCV
=====================================

A pipeline with a synchronizer is searched like any other. Two questions have two kinds of score:
how probable new performances are under the model (``ActionModel.score``, the default), and how
well features that had no say in the matching agree afterwards (``FeatureHoldoutScorer``).
"""

import matplotlib.pyplot as plt
import numpy as np
from sklearn.model_selection import GridSearchCV, GroupKFold
from sklearn.pipeline import make_pipeline
from sklearn_motionsync import ActionModel, ASpace, DenseSynchronizer, DirectionCosines
from sklearn_motionsync.datasets import make_bending
from sklearn_motionsync.metrics import FeatureHoldoutScorer, group_timing_error

bunch = make_bending(24, n_frames=60, random_state=1)

# %%
# How many dimensions, how long a clock
# -------------------------------------
# Whole actors are held out: a model of people should know people it has not seen. Scores of
# different dimensions are densities of different spaces and cannot be compared, so b is fixed
# here.

pipe = make_pipeline(
    DirectionCosines(bunch.skeleton), ASpace(6), DenseSynchronizer(n_frames=60), ActionModel()
)
grid = {
    "densesynchronizer__smoothness": [0.0003, 0.003, 0.03, 0.3],
    "densesynchronizer__max_offset": [0.05, 0.15, 0.25],
}
search = GridSearchCV(pipe, grid, cv=GroupKFold(4)).fit(bunch.data, groups=bunch.actor)
search.best_params_

# %%
# A score that over-warping does not please
# -----------------------------------------
# The postures of a set can always be made more alike by warping more. `FeatureHoldoutScorer`
# matches by some of the features and judges by the others. Here the true timing is known, so
# both can be held against it.

postures = DirectionCosines(bunch.skeleton).fit_transform(bunch.data)
offsets = [0, 0.03, 0.06, 0.1, 0.15, 0.25, 0.4]
blind = GridSearchCV(
    DenseSynchronizer(n_frames=60), {"max_offset": offsets}, cv=2, scoring=FeatureHoldoutScorer()
).fit(postures)
error = [
    group_timing_error(
        DenseSynchronizer(n_frames=60, max_offset=m).fit(postures).match(postures).times,
        bunch.times,
    )
    for m in offsets
]

figure, (left, right) = plt.subplots(1, 2, figsize=(9, 3.2), layout="constrained")
left.plot(offsets, -blind.cv_results_["mean_test_score"], "o-", color="#0072B2")
left.set_ylabel("spread of the features held out,\nas a share of that before")
right.plot(offsets, error, "o-", color="#D55E00")
right.set_ylabel("true timing error, frames")
for axis in (left, right):
    axis.axvline(blind.best_params_["max_offset"], color="0.6", linestyle="--", zorder=0)
    axis.set_xlabel("max_offset (dashed: chosen)")
    axis.set_ylim(bottom=0)

# %%

print(f"chosen: {blind.best_params_}, error there {error[blind.best_index_]:.2f} frames,")
print(f"smallest error {min(error):.2f} frames at max_offset={offsets[int(np.argmin(error))]}")
plt.show()
