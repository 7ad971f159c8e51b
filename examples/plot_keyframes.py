"""
Heel strikes in, toe-offs judged
================================

You get walks that are aligned by one weak signal, with and without the heel strikes of a pressure
mat. Toe-offs are not given to either, so they judge both. The last section shows what wrong labels
do.
"""

import matplotlib.pyplot as plt
import numpy as np
import pandas as pd
from sklearn_motionsync import DenseSynchronizer, to_trials
from sklearn_motionsync.datasets import make_gait
from sklearn_motionsync.display import SynchronizationDisplay
from sklearn_motionsync.io import keyframes_from_events


def record_walks(random_state, signals=("ankle_dorsiflexion",), **walks):
    """Walks of two strides: the trials, and the true moments of all of them."""
    gait = make_gait(16, 2, takes=True, random_state=random_state, **walks)
    curves = [pd.DataFrame(x, columns=gait.feature_names)[list(signals)] for x in gait.data]
    table = pd.concat(curves, keys=gait.person, names=["person", "frame"])
    person = pd.Index(gait.person, name="person")
    moments = pd.DataFrame(gait.keyframes, columns=gait.keyframe_names, index=person)
    return to_trials(table), moments


different = {"style": 6, "warp": 3, "noise": 3}
trials, moments = record_walks(3, **different)

# %%
# Heel strikes, as the mat gives them
# -----------------------------------
# The 16 people walk very differently, and only the ankle angle was recorded. The mat has a table of
# events, in seconds, at 100 frames a second. One call makes key-frames of it: a row for each trial,
# in frames.

seconds = (moments.filter(like="heel strike") / 100).rename_axis(columns="event")
events = seconds.stack().rename("seconds").reset_index()
keyframes = keyframes_from_events(trials, events, frame_rate=100)
keyframes.head(3).round(1)

# %%
# Align without them and with them
# --------------------------------


def match_trials(trials, keyframes=None, keyframe_std=0):
    sync = DenseSynchronizer(151, keyframe_std=keyframe_std)
    sync.fit(trials, keyframes=keyframes)
    return sync.match(trials, keyframes=keyframes)


def landed(match, trials, moments):
    """Where true moments are after the alignment, in per cent of the pattern."""
    percent, true = np.linspace(0, 100, match.times.shape[1]), moments.to_numpy()
    return [np.interp(own, f, percent) for own, f in zip(true, match.frames(trials), strict=True)]


def apart(match, trials, moments, name):
    return np.std(landed(match, trials, moments.filter(like=name)), axis=0).mean()


toe_off = moments.filter(like="toe-off")
figure, axes = plt.subplots(2, 1, figsize=(6.4, 5), sharex=True, layout="constrained")
for axis, given in zip(axes, (None, keyframes), strict=True):
    match = match_trials(trials, given)
    percent, curves = np.linspace(0, 100, 151), match.warp(trials)[:, :, 0]
    axis.plot(percent, curves.T, color="#0072B2", linewidth=0.7, alpha=0.6)
    for at, curve in zip(landed(match, trials, toe_off), curves, strict=True):
        (dots,) = axis.plot(at, np.interp(at, percent, curve), "o", color="#D55E00", markersize=4)
    spread = apart(match, trials, moments, "toe-off")
    name = "nothing given" if given is None else "heel strikes given"
    axis.set_title(f"{name}: toe-offs have a deviation of {spread:.1f} %", fontsize="medium")
    axis.set_ylabel("ankle (degrees)")
axes[1].set_xlabel("% of the pattern")
axes[0].legend([dots], ["true toe-off"], frameon=False, loc="upper left")
_ = figure.suptitle("Heel strikes bring back the walk that went astray")

# %%
# Nothing given, one walk is half a stride off: its toe-offs are on the bump after the others.
#
# Displays draw what was given: lines on the time axis of the pattern, ticks below the trials.

sync = DenseSynchronizer(151).fit(trials, keyframes=keyframes)
display = SynchronizationDisplay.from_estimator(
    sync, trials, keyframes=keyframes, unit="percent", units="degrees", warps=False
)
_ = display.figure_.suptitle("Lines and ticks are the heel strikes that were given")

# %%
# Five sets
# ---------
# One set says little. Here are five, with other people each. Heel strikes are given to all trials,
# exact or soft, or to every fourth trial. The table judges by toe-offs and by the largest knee
# flexion, which were never given.


def every_fourth(labels):
    few = labels.copy()
    few.iloc[np.arange(len(labels)) % 4 > 0] = np.nan
    return few


ways = {
    "nothing given": lambda labels: (None, 0),
    "a quarter labelled": lambda labels: (every_fourth(labels), 0),
    "soft labels": lambda labels: (labels, 3),
    "exact labels": lambda labels: (labels, 0),
}
rows = []
for number in range(5):
    walks, true = record_walks(number, **different)
    strikes = true.filter(like="heel strike")
    for way, choose in ways.items():
        match = match_trials(walks, *choose(strikes))
        spreads = [apart(match, walks, true, name) for name in ("toe-off", "knee")]
        rows.append({"set": number, "way": way, "toe-off": spreads[0], "knee flexed": spreads[1]})
results = pd.DataFrame(rows)
typical = results.groupby("way", sort=False)[["toe-off", "knee flexed"]].agg(
    lambda values: np.exp(np.log(values).mean())
)
typical.round(2)

# %%

figure, axis = plt.subplots(figsize=(6.4, 3.2), layout="constrained")
for place, way in enumerate(ways):
    values = results.loc[results["way"] == way, "toe-off"]
    axis.plot(values, np.full(len(values), place), "o", color="#0072B2", alpha=0.6)
    axis.plot(typical.loc[way, "toe-off"], place, "|", color="black", markersize=22)
axis.set_yticks(range(len(ways)), ways)
axis.set_xscale("log")
axis.set_xticks([1, 2, 5, 10], ["1", "2", "5", "10"])
axis.set_xlabel("deviation of toe-offs (% of the pattern); line: geometric mean")
_ = figure.suptitle("Exact labels halve it; a few labels help, too")

# %%
# Where it fails
# --------------
# These people walk alike, and hip, knee and ankle were recorded. The signals alone are enough. Then
# every fifth label of the second heel strike is moved by a tenth of the trial.

walks, true = record_walks(
    0, ("hip_flexion", "knee_flexion", "ankle_dorsiflexion"), style=1, warp=3, noise=1
)
right = true.filter(like="heel strike")
wrong, lengths = right.copy(), np.array([len(x) for x in walks])
wrong.iloc[::5, 1] += 0.1 * lengths[::5]
cases = {
    "nothing given": (None, 0),
    "right labels, exact": (right, 0),
    "wrong labels, exact": (wrong, 0),
    "wrong labels, soft": (wrong, 3),
}
pd.Series(
    {
        name: apart(match_trials(walks, *given), walks, true, "toe-off")
        for name, given in cases.items()
    },
    name="deviation of toe-offs (%)",
).round(2)

# %%
# Warps go through exact labels, right or wrong, and pull the moments beside them along. Soft
# labels count little where they contradict the signals. ``keyframe_std`` is their deviation.

plt.show()
