"""
An arm that was hidden for a while
==================================

You get aligned trials in which markers were lost. An arm is hidden for half of every third trial.
The gaps stay as they are. You see how well those trials are aligned, what can fill a gap, and where
it fails. The trials are made up, so their true timing is known.
"""

import matplotlib.pyplot as plt
import numpy as np
import pandas as pd
from sklearn_motionsync import DenseSynchronizer, DirectionCosines
from sklearn_motionsync.datasets import make_bending

BLUE, ORANGE, GREY = "#0072B2", "#D55E00", "0.6"
bends = make_bending(12, n_actors=4, random_state=0)
cosines = DirectionCosines(bends.skeleton, hidden="nan").fit(bends.data)
whole = [np.asarray(x) for x in cosines.transform(bends.data)]

# %%
# The gap
# -------
# The right elbow and wrist are hidden for 50 frames, about half of the trial. ``hidden="nan"``
# makes NaN of the directions that need them. All other limbs are seen.

first, last = 40, 90
joints = list(bends.skeleton.joints)
arm = [joints.index("right_elbow"), joints.index("right_wrist")]
lost = list(range(1, 12, 3))
positions = [np.array(x, dtype=float) for x in bends.data]
for i in lost:
    positions[i].reshape(len(positions[i]), -1, 3)[first:last, arm] = np.nan
gappy = [np.asarray(x) for x in cosines.transform(positions)]
print({i: f"{np.isnan(gappy[i]).mean():.0%} hidden" for i in lost})

# %%
# Aligned as they are
# -------------------
# Every pose is at a known phase of the bend. So the frame of a trial that corresponds to each frame
# of the pattern is known, too.

FRAMES = 100


def phases_of(i):
    return bends.times[i] / bends.times[i][-1]


def true_times(i, pattern=0):
    """Times of a trial, in frames of the pattern, by the known phases."""
    own, wanted = phases_of(i), phases_of(pattern)
    clock = np.linspace(0, 1, FRAMES)
    phase = np.interp(clock, np.linspace(0, 1, len(wanted)), wanted)
    return np.interp(phase, own, np.linspace(0, FRAMES - 1, len(own)))


def errors(trials):
    """Mean timing error of the trials with a gap, in per cent, and the synchronizer."""
    sync = DenseSynchronizer(FRAMES, pattern=0).fit(trials)
    times = sync.match(trials).times
    return [np.abs(times[i] - true_times(i)).mean() for i in lost], sync


mean = np.nanmean(np.concatenate(gappy), axis=0)
ways = {
    "nothing hidden": whole,
    "as they are": gappy,
    "straight lines": [pd.DataFrame(x).interpolate().ffill().bfill().to_numpy() for x in gappy],
    "mean pose": [np.where(np.isnan(x), mean, x) for x in gappy],
}
found = {name: errors(trials) for name, trials in ways.items()}
for name, (of_trials, _) in found.items():
    print(f"{name:15s} {np.mean(of_trials):.2f} % of the trial, at worst {max(of_trials):.2f}")

# %%
# What fills the gap
# ------------------
# ``transform`` leaves NaN where the arm was hidden. ``fill="model"`` puts in the mean of the
# aligned trials at that moment. It is right as far as this trial is like the others.

sync = found["as they are"][1]
feature = list(cosines.get_feature_names_out()).index("right_forearm_y")
shown = lost[-1]
aligned = sync.transform(gappy)[shown][:, feature]
filled = sync.transform(gappy, fill="model")[shown][:, feature]
truth = sync.transform(whole)[shown][:, feature]

figure, (left, right) = plt.subplots(1, 2, figsize=(6.4, 3), layout="constrained")
left.plot(truth, color=GREY, linestyle="--", label="true")
left.plot(np.where(np.isnan(aligned), filled, np.nan), color=ORANGE, label="filled")
left.plot(aligned, color=BLUE, label="seen")
left.set(xlabel="frame of the pattern", ylabel="forearm, upwards", title=f"trial {shown}, aligned")
left.legend(frameon=False, fontsize="small")
place = np.arange(len(found))
right.bar(place, [np.mean(e) for e, _ in found.values()], color=[GREY, BLUE, GREY, GREY])
for x, (of_trials, _) in zip(place, found.values(), strict=True):
    right.plot([x] * len(lost), of_trials, "o", color="black", markersize=3)
right.set_xticks(place, [name.replace(" ", "\n") for name in found], fontsize="small")
right.set(ylabel="timing error (%)", title="trials with a hidden arm")
plt.show()

# %%
# Where it fails
# --------------
# Nothing at all is seen of these trials for a while. Then only the frames beside tell the time, and
# the error grows with the gap. No warning says so.

for length in (10, 30, 50):
    gone = [x.copy() for x in whole]
    for i in lost:
        gone[i][first : first + length] = np.nan
    of_trials, _ = errors(gone)
    print(f"{length} frames gone: {np.mean(of_trials):.2f} %, at worst {max(of_trials):.2f}")

# %%
# A trial of which nothing was seen is refused.

gone[1][:] = np.nan
try:
    sync.transform(gone)
except ValueError as error:
    print(error)
