"""
Before and after
================

You get a test of the same people before and after a training, in the shape and in the timing of
their movement. Each person is compared with himself or herself, so differences between people do
not count.
"""

import matplotlib.pyplot as plt
import numpy as np
import pandas as pd
from sklearn.pipeline import make_pipeline
from sklearn.preprocessing import StandardScaler
from sklearn_motionsync import DenseSynchronizer, FrameWise
from sklearn_motionsync.comparison import compare_groups
from sklearn_motionsync.datasets import make_gait
from sklearn_motionsync.display import GroupDisplay

# %%
# Twelve people, two strides before and two after
# -----------------------------------------------
# The strides are synthetic. After the training, people push off 2 % of the cycle later.

gait = make_gait(12, n_cycles=4, random_state=0)
session = ["before" if cycle < 3 else "after" for cycle in gait.cycle]


def later(x, by=0.02):
    t = np.linspace(0, 1, len(x))
    return np.stack([np.interp(t - by * np.sin(np.pi * t) ** 2, t, column) for column in x.T], 1)


strides = [later(x) if when == "after" else x for x, when in zip(gait.data, session, strict=True)]
trials = [pd.DataFrame(x, columns=gait.feature_names) for x in strides]

# %%
# The test
# --------
# ``paired=True`` compares each person's means before and after.

pipe = make_pipeline(FrameWise(StandardScaler()), DenseSynchronizer(101)).fit(trials)
found = compare_groups(pipe, trials, session, groups=gait.person, paired=True)
print(found.describe())
found.clusters.round(2)

# %%
# In the figure, lines join the two dots of a person.

display = GroupDisplay.from_estimator(
    pipe,
    trials,
    session,
    groups=gait.person,
    comparison=found,
    features=["knee_flexion", "vertical_force"],
    units=["degrees", "body weights"],
)
_ = display.figure_.suptitle("After the training, people push off later")

# %%
# Where it fails
# --------------
# Without ``paired``, one person cannot be in two groups. And if people are named anew for each
# session, the pairs are lost. Then people differ more than the training changes them:

try:
    compare_groups(pipe, trials, session, groups=gait.person)
except ValueError as error:
    print(error)
names = [f"{person} {when}" for person, when in zip(gait.person, session, strict=True)]
lost = compare_groups(pipe, trials, session, groups=names)
print(f"p of timing: {found.p_timing:.3f} in pairs, {lost.p_timing:.3f} without")

plt.show()
