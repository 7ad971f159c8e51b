"""
Choosing parameters with GridSearchCV
=====================================

You get the best parameters of a pipeline by cross-validation, as for any scikit-learn estimator.
Two scores answer two questions. ``ActionModel.score``, the default, is how probable new trials are.
``FeatureHoldoutScorer`` is how well signals agree that were not used in the matching.
"""

import matplotlib.pyplot as plt
from sklearn.model_selection import GridSearchCV, GroupKFold
from sklearn.pipeline import make_pipeline
from sklearn_motionsync import ActionModel, ASpace, DenseSynchronizer, DirectionCosines
from sklearn_motionsync.datasets import make_bending
from sklearn_motionsync.metrics import FeatureHoldoutScorer, group_timing_error

bunch = make_bending(16, n_frames=60, random_state=1)

# %%
# How probable new trials are
# ---------------------------
# Whole subjects are held out, because a model should hold for new people. The number of dimensions
# is fixed: likelihoods in spaces of different dimensions cannot be compared.

pipe = make_pipeline(
    DirectionCosines(bunch.skeleton), ASpace(6), DenseSynchronizer(n_frames=60), ActionModel()
)
grid = {
    "densesynchronizer__smoothness": [0.0003, 0.03],
    "densesynchronizer__max_offset": [0.05, 0.25],
}
search = GridSearchCV(pipe, grid, cv=GroupKFold(3)).fit(bunch.data, groups=bunch.actor)
search.best_params_

# %%
# How well held-out signals agree
# -------------------------------
# More warping always makes the matched signals more alike, so they cannot judge it.
# `FeatureHoldoutScorer` matches by some signals and judges by the others. The true timing is known
# here, and shows whether the choice is right.

poses = DirectionCosines(bunch.skeleton).fit_transform(bunch.data)
offsets = [0, 0.03, 0.06, 0.12, 0.25]
blind = GridSearchCV(
    DenseSynchronizer(n_frames=60), {"max_offset": offsets}, cv=2, scoring=FeatureHoldoutScorer()
).fit(poses)
error = [
    group_timing_error(
        DenseSynchronizer(n_frames=60, max_offset=m).fit(poses).match(poses).times,
        bunch.times,
    )
    for m in offsets
]
chosen = blind.best_params_["max_offset"]

figure, (upper, lower) = plt.subplots(2, 1, figsize=(6.4, 5), sharex=True, layout="constrained")
upper.plot(offsets, -blind.cv_results_["mean_test_score"], "o-", color="#0072B2")
upper.set_ylabel("spread of held-out signals\n(share of that before)")
lower.plot(offsets, error, "o-", color="#D55E00")
lower.set_ylabel("true timing error\n(frames)")
lower.set_xlabel("max_offset (share of the length); dashed: chosen")
for axis in (upper, lower):
    axis.axvline(chosen, color="0.6", linestyle="--", zorder=0)
    axis.set_ylim(bottom=0)
_ = figure.suptitle(
    f"The score chooses {chosen}, without knowing the timing:\n"
    f"error {error[blind.best_index_]:.2f}, the smallest possible is {min(error):.2f} frames"
)

# %%
# What is refused
# ---------------
# A name that no step has, or a value out of range, fails in the search as in a fit:

try:
    pipe.set_params(densesynchronizer__max_offset=2).fit(bunch.data)
except ValueError as refusal:
    print(refusal)
plt.show()
