"""
From a CSV file to a figure, and back
=====================================

You get aligned trials, a figure and two new tables from one CSV file. The file is as laboratories
keep it: a row for each frame, and a column for each signal. Further columns hold subject, trial and
time.
"""

import tempfile
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np
import pandas as pd
from sklearn.pipeline import make_pipeline
from sklearn.preprocessing import StandardScaler
from sklearn_motionsync import DenseSynchronizer, FrameWise, Match, to_frame, to_trials
from sklearn_motionsync.datasets import make_gait
from sklearn_motionsync.display import SynchronizationDisplay

# %%
# The file
# --------
# It is made here, so that the page runs everywhere. Replace it by your own.

folder = Path(tempfile.mkdtemp())
gait = make_gait(6, n_cycles=3, timing=5, random_state=0)
names = pd.MultiIndex.from_arrays([gait.person, gait.cycle], names=["subject", "trial"])
table = to_frame(gait.data, trials=names, columns=gait.feature_names)
table = table.rename_axis(["subject", "trial", "time"]).reset_index()
table["time"] /= gait.frame_rate
table.to_csv(folder / "trials.csv", index=False)
table.head()

# %%
# Read and align
# --------------
# ``by`` names the columns of subject and trial, and ``time`` that of the time. Degrees and body
# weights are first brought to one scale.

trials = to_trials(pd.read_csv(folder / "trials.csv"), by=["subject", "trial"], time="time")
pipe = make_pipeline(FrameWise(StandardScaler()), DenseSynchronizer(n_frames=101)).fit(trials)
match = Match.from_estimator(pipe, trials)

# %%
# The figure shows two of the four signals. How far apart are the trials in the peak of the knee?
# The spread is the standard deviation of its time.

aligned = match.warp(trials)
before = [100 * x["knee_flexion"].argmax() / (len(x) - 1) for x in trials]
after = aligned[:, :, 1].argmax(axis=1)

display = SynchronizationDisplay.from_estimator(
    match,
    trials,
    features=["knee_flexion", "vertical_force"],
    y=gait.group,
    unit="percent",
    xlabel="% gait cycle",
)
display.axes_[0].set_ylabel("knee flexion (degrees)")
display.axes_[2].set_ylabel("vertical force\n(body weights)")
display.figure_.suptitle(
    f"Aligned, the knee's peaks meet:\nspread {np.std(before):.1f} before, "
    f"{np.std(after):.1f} % of the cycle after"
)
display.figure_.savefig(folder / "trials.png")

# %%
# Back to a table
# ---------------
# The first table holds the aligned signals in their own units. The second one holds the time shifts
# in per cent of the cycle. A positive shift means later than the pattern.

curves = to_frame(aligned, trials=trials, columns=trials[0].columns)
curves.to_csv(folder / "aligned.csv")
timing = match.to_frame("percent", trials)
timing.to_csv(folder / "timing.csv")
timing["offset"].unstack()[[0, 20, 40, 60, 80, 100]].groupby("subject").mean().round(1)

# %%
# What is refused
# ---------------
# In this file, a stretch of one trial is missing. The reader does not stretch the rest over it:

broken = table.drop(index=table.index[40:60])
try:
    to_trials(broken, by=["subject", "trial"], time="time")
except ValueError as error:
    print(error)

plt.show()
