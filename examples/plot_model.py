"""
The action, or something else
=============================

You get a verdict for each new trial: the action that was learnt, or something else. The model
learns how two dozen bends look, and how much people differ. It then judges a bend of a new
person, and eight altered versions of it.
"""

import matplotlib.pyplot as plt
import numpy as np
import pandas as pd
from sklearn.pipeline import make_pipeline
from sklearn_motionsync import (
    ActionDetector,
    ActionModel,
    ASpace,
    DenseSynchronizer,
    DirectionCosines,
)
from sklearn_motionsync.datasets import make_bending
from sklearn_motionsync.display import ActionModelDisplay, SkeletonDisplay
from sklearn_motionsync.model import find_departures

bunch = make_bending(24, random_state=0)
steps = DirectionCosines(bunch.skeleton), ASpace(0.95), DenseSynchronizer(100), ActionModel()
pipe = make_pipeline(*steps).fit(bunch.data, actionmodel__groups=bunch.actor)

# %%
# Right and wrong
# ---------------
# All nine are made of one bend. Its person is not in the training set.

bend = make_bending(1, random_state=1).data[0]
n = len(bend)


def lift_left_arm(x, first, last):
    """The same with the left arm held up straight for a while."""
    joint = bunch.skeleton.index_of
    points = x.reshape(len(x), -1, 3).copy()
    while_up = slice(int(first * len(x)), int(last * len(x)))
    arm = points[while_up, joint("left_elbow")] - points[while_up, joint("left_shoulder")]
    length = np.linalg.norm(arm, axis=1, keepdims=True)
    for name in ("left_elbow", "left_wrist"):
        points[while_up, joint(name)] += [0, 1, 0] * length - arm
    return points.reshape(len(x), -1)


shown = {
    "a bend": bend,
    "at half speed": np.repeat(bend, 2, axis=0),
    "backwards": bend[::-1],
    "first half": bend[: n // 2],
    "twice in a row": np.concatenate([bend, bend]),
    "standing still": np.repeat(bend[:1], n, axis=0),
    "a rest in the middle": np.insert(bend, [n // 2] * (n // 2), bend[n // 2], axis=0),
    "ends cut off": bend[n // 6 : -(n // 6)],
    "left arm lifted": lift_left_arm(bend, 0.4, 0.65),
}
trials = list(shown.values())

# %%
# The model compares aligned trials. Alignment removes the pace, so the model accepts a bend at half
# speed. The detector also looks at the pace, and gives a reason for each refusal.

detector = ActionDetector(pipe).fit(bunch.data, groups=bunch.actor)
verdicts = pd.DataFrame(
    {
        "model": pipe.predict(trials),
        "detector": detector.predict(trials),
        "reason": detector.report(trials)["reason"].to_numpy(),
    },
    index=list(shown),
)
verdicts

# %%
# ``score_samples`` is the log likelihood of each trial. The distance from the best one shows how
# clear each verdict of the model is.

unlike = pipe.score_samples(trials)
unlike = unlike.max() - unlike + 1
rows = np.argsort(unlike)
colors = np.where(verdicts["model"] == 1, "#0072B2", "#D55E00")
figure, axis = plt.subplots(figsize=(6.4, 3.4), layout="constrained")
axis.barh(np.arange(len(rows)), unlike[rows], color=colors[rows])
axis.set_yticks(np.arange(len(rows)), np.array(list(shown))[rows])
axis.set_xscale("log")
axis.invert_yaxis()
axis.set_xlabel("how unlike a bend (log likelihood below the best, plus 1)")
refused = int((verdicts["model"] == -1).sum())
_ = figure.suptitle(f"The model refuses {refused} of {len(shown)} (orange)")

# %%
# What is wrong
# -------------
# The table tells which limb departs, when, and by how many degrees. A departure is rare if 95 % of
# new people have none with as much evidence.

departures = find_departures(pipe, [shown["left arm lifted"]])
departures.head().round(1)

# %%
# The same as stick figures. Violet limbs depart; the mean is pale.

display = SkeletonDisplay.from_departures(pipe, [shown["left arm lifted"]], frames=[25, 50, 62, 85])
_ = display.heading_.set_text(
    "The left arm is held up for a while, and found (violet).\nPale: the mean bend"
)

# %%
# The same as curves. The band holds 95 % of the whole trials of new people.

display = ActionModelDisplay.from_estimator(
    pipe,
    [bend, shown["left arm lifted"]],
    features=["left_arm_y", "torso_z"],
    band="trials",
    unit="percent",
)
for axis, name in zip(display.axes_, ("left arm upwards", "torso forward"), strict=True):
    axis.set_ylabel(f"{name} (cosine)")
_ = display.figure_.suptitle("The left arm leaves the band; the torso does not")

# %%
# Where it fails
# --------------
# Synthetic bends differ little. In real bends of HDM05 the way down is much like the way up. This
# command counts what a model of the other people accepts: ``python examples/plot_bending.py
# --data hdm05_positions.npz --action depositFloorR``. It accepts 23 of 24 bends as they are, but
# also 22 backwards. It accepts no first half, and none standing still. :doc:`/accuracy` has
# sixteen actions of real people, and other detectors.

plt.show()
