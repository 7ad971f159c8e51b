"""
Heel strikes as key-frames
==========================

You get gait cycles that are cut at their heel strikes, aligned, and compared with healthy gait.
Two alignments are shown: by toe-off, which the laboratory has marked, and by dense matching, which
needs no event. A model of healthy gait then finds two new cycles that are not normal.
"""

import matplotlib.pyplot as plt
import numpy as np
import pandas as pd
from sklearn.preprocessing import StandardScaler
from sklearn_motionsync import ActionModel, DenseSynchronizer, FrameWise, LinearSynchronizer
from sklearn_motionsync.datasets import make_gait
from sklearn_motionsync.display import ActionModelDisplay
from sklearn_motionsync.io import cut_at_events, keyframes_from_events
from sklearn_motionsync.model import find_departures

gait = make_gait(12, n_cycles=4, takes=True, random_state=0)


def as_recording(gait, i):
    """A take with its events in ``attrs``, as read_motion reads it from a C3D file."""
    take = pd.DataFrame(gait.data[i], columns=gait.feature_names)
    take.attrs = {
        "events": gait.events[i],
        "frame_rate": gait.frame_rate,
        "trial": gait.person[i],
    }
    return take


takes = [as_recording(gait, i) for i in range(len(gait.data))]

# %%
# A take and its events
# ---------------------
# The take begins in one swing and ends in a later stance. The force is above 0 in stance.

take = takes[0]
seconds = np.arange(len(take)) / gait.frame_rate
figure, axes = plt.subplots(2, 1, figsize=(6.4, 4.6), sharex=True, layout="constrained")
for axis, name, unit in zip(axes, take.columns[[1, 3]], ("degrees", "body weights"), strict=True):
    axis.plot(seconds, take[name], color="black")
    for event in take.attrs["events"]:
        strike = event["label"] == "Foot Strike"
        color, line = ("#0072B2", "-") if strike else ("#D55E00", "--")
        axis.axvline(event["time"], color=color, linestyle=line, linewidth=1)
    axis.set_ylabel(f"{name.replace('_', ' ')}\n({unit})")
axes[1].set_xlabel("time (s)")
figure.suptitle("Five heel strikes cut this take into four whole cycles")
_ = figure.legend(
    [axes[0].lines[1], axes[0].lines[2]],
    ["heel strike", "toe-off"],
    loc="outside lower center",
    ncols=2,
    frameon=False,
)

# %%
# Cycles
# ------
# A cycle lasts from each heel strike to the next. The events in between come along, so toe-off is a
# key-frame of each cycle.

cycles = [cycle for take in takes for cycle in cut_at_events(take, "Foot Strike")]
person = [cycle.attrs["trial"][0] for cycle in cycles]
toe_off = keyframes_from_events(cycles)
print(len(cycles), "cycles of", [len(cycle) for cycle in cycles[:6]], "... frames")
print("toe-off at frame", toe_off.iloc[:6, 0].round(1).tolist(), "...")

# %%
# Align them
# ----------
# Degrees and body weights cannot be compared. Every signal is therefore scaled, by one number for
# all cycles.

scaler = FrameWise(StandardScaler())
scaled = scaler.fit_transform(cycles)
dense = DenseSynchronizer(101).fit(scaled)
toe_off_only = LinearSynchronizer(101).fit(scaled, keyframes=toe_off)
matches = {
    "linear": LinearSynchronizer(101).fit(scaled).match(scaled),
    "toe-off as key-frame": toe_off_only.match(scaled, keyframes=toe_off),
    "dense": dense.match(scaled),
}

# %%
# The takes are synthetic, so the times of five moments of each cycle are known. The table holds
# their spread between the cycles after each alignment, as standard deviations in per cent of the
# cycle.

moments = gait.keyframes[:, :-1].reshape(len(takes), -1, 6)[:, :, 1:].reshape(len(cycles), 5)
names = [name.removesuffix(" 1") for name in gait.keyframe_names[1:6]]
first = np.array([cycle.attrs["rows"][0] for cycle in cycles])
ends = np.array([len(cycle) - 1 for cycle in cycles])
evenly = 100 * (moments - first[:, np.newaxis]) / ends[:, np.newaxis]
spreads = {}
for name, match in matches.items():
    percent = np.arange(101)
    landed = [np.interp(at, tau, percent) for at, tau in zip(evenly, match.times, strict=True)]
    spreads[name] = np.std(landed, axis=0)
pd.DataFrame(spreads, index=names).round(2)

# %%
# Linear normalisation keeps all differences of pace. The key-frame removes those at toe-off and
# nearby. Dense matching reduces all five, but is less exact at toe-off itself. It takes key-frames,
# too: :doc:`plot_keyframes`.
#
# What is outside the band
# ------------------------
# The model is fitted to the aligned curves, in degrees and body weights. ``groups`` names the
# person of each cycle, because cycles of one person are not independent.


def aligned(cycles):
    """Curves aligned with the pattern, with their names."""
    match = dense.match(scaler.transform(cycles))
    return [pd.DataFrame(x, columns=gait.feature_names) for x in match.warp(cycles)]


model = ActionModel().fit(aligned(cycles), groups=person)

# %%
# Four new cycles are compared with it. The first is healthy. In the second the knee flexes 36
# degrees less in swing, in the third 12 degrees less. In the fourth a heel strike was missed, so
# that it is two cycles long.


def new_person(amplitude=0):
    return as_recording(make_gait(2, 2, takes=True, amplitude=amplitude, random_state=5), 1)


healthy = new_person()
missed = healthy.copy()
strikes = [event for event in healthy.attrs["events"] if event["label"] == "Foot Strike"]
missed.attrs["events"] = [event for event in healthy.attrs["events"] if event is not strikes[1]]
shown = {
    "healthy": cut_at_events(healthy, "Foot Strike")[0],
    "stiff knee": cut_at_events(new_person(-36), "Foot Strike")[0],
    "a little stiff": cut_at_events(new_person(-12), "Foot Strike")[0],
    "heel strike missed": cut_at_events(missed, "Foot Strike")[0],
}
new = aligned(list(shown.values()))
pd.DataFrame({"model": model.predict(new), "frames": [len(x) for x in shown.values()]}, index=shown)

# %%
# The band holds 95 % of the whole cycles of new people. Violet parts are outside.

display = ActionModelDisplay.from_estimator(model, new, band="trials", unit="percent")
units = ("degrees", "degrees", "degrees", "body weights")
for axis, name, unit in zip(display.axes_, gait.feature_names, units, strict=True):
    axis.set_ylabel(f"{name.replace('_', ' ')}\n({unit})")
_ = display.figure_.suptitle(
    "Two of four new cycles leave the band:\na stiff knee, and a missed heel strike"
)

# %%
# The worst departure of each signal, of those that are rare among healthy people:

departures = find_departures(model, new)
departures[departures["rare"]].groupby(["trial", "feature"]).head(1).round(1)

# %%
# Where it fails
# --------------
# The model accepts the knee that is a little stiff. Healthy people differ by as much. To find
# such a change, compare groups, or the same person before and after: :doc:`plot_two_groups`.

plt.show()
