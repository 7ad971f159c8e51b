"""
From a CSV file to a figure, and back
=====================================

A table as laboratories keep it: one row a frame, columns that say whose it is and when it was, and
one column a signal. What comes out is a table again, with the names that went in.
"""

import tempfile
from pathlib import Path

import matplotlib.pyplot as plt
import pandas as pd
from sklearn.pipeline import make_pipeline
from sklearn.preprocessing import StandardScaler
from sklearn_motionsync import DenseSynchronizer, FrameWise, Match, to_frame, to_sequences
from sklearn_motionsync.datasets import make_gait
from sklearn_motionsync.display import SynchronizationDisplay

# %%
# The file
# --------
# Made up here, so that the page needs nothing; yours is there already.

folder = Path(tempfile.mkdtemp())
gait = make_gait(6, n_cycles=3, timing=5, random_state=0)
names = pd.MultiIndex.from_arrays([gait.person, gait.cycle], names=["subject", "trial"])
table = to_frame(gait.data, performances=names, columns=gait.feature_names)
table = table.rename_axis(["subject", "trial", "time"]).reset_index()
table["time"] /= gait.frame_rate
table.to_csv(folder / "trials.csv", index=False)
table.head()

# %%
# Trials, on one clock
# --------------------
# Which columns are what is said once. Degrees and body weights are brought to one scale first.

trials = to_sequences(pd.read_csv(folder / "trials.csv"), by=["subject", "trial"], time="time")
pipe = make_pipeline(FrameWise(StandardScaler()), DenseSynchronizer(n_frames=101)).fit(trials)
match = Match.from_estimator(pipe, trials)
display = SynchronizationDisplay.from_predictions(
    trials, match.times, groups=gait.group, unit="percent"
)
display.figure_.savefig(folder / "trials.png")

# %%
# Back to a table
# ---------------
# The curves in the unit in which they were measured, and the timing in per cent: positive is later
# than the pattern.

curves = to_frame(match.warp(trials), performances=trials, columns=trials[0].columns)
curves.to_csv(folder / "on_one_clock.csv")
timing = match.to_frame("percent", trials)
timing.to_csv(folder / "timing.csv")
timing["offset"].unstack()[[0, 20, 40, 60, 80, 100]].groupby("subject").mean().round(1)

# %%
# What goes wrong
# ---------------
# A file in which a stretch of a trial is missing is not stretched over the hole:

broken = table.drop(index=table.index[40:60])
try:
    to_sequences(broken, by=["subject", "trial"], time="time")
except ValueError as error:
    print(error)

plt.show()
