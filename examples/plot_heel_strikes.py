"""
Heel strikes as key-frames
==========================

Long takes of walking, cut into gait cycles at the heel strikes and put on one clock: by the other
event that the lab has marked, toe-off, and by dense matching, which needs no event. Then a
model of healthy gait is shown cycles that it should not accept.
"""

import matplotlib.pyplot as plt
import numpy as np
import pandas as pd
from sklearn.preprocessing import StandardScaler
from sklearn_motionsync import (
    ActionModel,
    DenseSynchronizer,
    FrameWise,
    KeyframeSynchronizer,
    LinearSynchronizer,
    find_departures,
)
from sklearn_motionsync.datasets import make_gait
from sklearn_motionsync.display import ActionModelDisplay
from sklearn_motionsync.io import cut_at_events

gait = make_gait(12, n_cycles=4, takes=True, random_state=0)


def as_recording(gait, i):
    """A take with its events in ``attrs``, as read_motion gives it for a C3D file."""
    take = pd.DataFrame(gait.data[i], columns=gait.feature_names)
    take.attrs = {
        "events": gait.events[i],
        "frame_rate": gait.frame_rate,
        "performance": gait.person[i],
    }
    return take


takes = [as_recording(gait, i) for i in range(len(gait.data))]

# %%
# A take and its events
# ---------------------
# It begins in one swing and ends in a later stance; the force under the foot tells which.

take = takes[0]
seconds = np.arange(len(take)) / gait.frame_rate
figure, axes = plt.subplots(2, 1, figsize=(8, 4.4), sharex=True, layout="constrained")
for axis, name, unit in zip(axes, take.columns[[1, 3]], ("degrees", "body weights"), strict=True):
    axis.plot(seconds, take[name], color="black")
    for event in take.attrs["events"]:
        strike = event["label"] == "Foot Strike"
        color, line = ("#0072B2", "-") if strike else ("#D55E00", "--")
        axis.axvline(event["time"], color=color, linestyle=line, linewidth=1)
    axis.set_ylabel(f"{name.replace('_', ' ')}\n({unit})")
axes[1].set_xlabel("seconds")
_ = figure.legend(
    [axes[0].lines[1], axes[0].lines[2]],
    ["heel strike", "toe-off"],
    loc="outside upper center",
    ncols=2,
    frameon=False,
)

# %%
# Cycles
# ------
# From each heel strike to the next. What was marked in between comes along, so toe-off is a
# key-frame of each cycle.

cycles = [cycle for take in takes for cycle in cut_at_events(take, "Foot Strike")]
person = [cycle.attrs["performance"][0] for cycle in cycles]
toe_off = [[event["frame"] for event in cycle.attrs["events"]] for cycle in cycles]
print(len(cycles), "cycles of", [len(cycle) for cycle in cycles[:6]], "... frames")
print("toe-off at frame", np.round(np.ravel(toe_off[:6]), 1), "...")

# %%
# One clock
# ---------
# Degrees and body weights cannot be compared, so every feature is scaled, by one number for all
# cycles.

scaler = FrameWise(StandardScaler())
scaled = scaler.fit_transform(cycles)
dense = DenseSynchronizer(101).fit(scaled)
toe_off_only = KeyframeSynchronizer(101).fit(scaled, keyframes=toe_off)
matches = {
    "linear": LinearSynchronizer(101).fit(scaled).match(scaled),
    "toe-off as key-frame": toe_off_only.match(scaled, keyframes=toe_off),
    "dense": dense.match(scaled),
}

# %%
# The takes are synthetic, so it is known when five moments of each cycle come. How far apart do
# they lie on each clock? The spread (standard deviation) between the cycles, in per cent:

moments = gait.keyframes[:, :-1].reshape(len(takes), -1, 6)[:, :, 1:].reshape(len(cycles), 5)
names = [name.removesuffix(" 1") for name in gait.keyframe_names[1:6]]
first = np.array([cycle.attrs["rows"][0] for cycle in cycles])
ends = np.array([len(cycle) - 1 for cycle in cycles])
on_linear_clock = 100 * (moments - first[:, np.newaxis]) / ends[:, np.newaxis]
spreads = {}
for name, match in matches.items():
    clock = np.arange(101)
    landed = [
        np.interp(at, tau, clock) for at, tau in zip(on_linear_clock, match.times, strict=True)
    ]
    spreads[name] = np.std(landed, axis=0)
pd.DataFrame(spreads, index=names).round(2)

# %%
# Linear normalisation leaves every moment as far apart as people's paces are. The key-frame settles
# itself and what is next to it. Dense matching brings all of them together, the rest of stance
# closer, but toe-off itself not as well as who was told.
#
# Who is outside of the band
# --------------------------
# A model of the synchronised curves, in degrees and body weights, which knows that cycles of one
# person are not independent.


def on_clock(cycles):
    """Curves of the pattern's clock, with their names."""
    match = dense.match(scaler.transform(cycles))
    return [pd.DataFrame(x, columns=gait.feature_names) for x in match.warp(cycles)]


model = ActionModel().fit(on_clock(cycles), groups=person)

# %%
# Four new cycles: of somebody healthy; of the same with a knee that flexes 36 degrees less in
# swing, and 12 degrees less; and one whose last heel strike was not detected, so that it is two
# cycles long.


def somebody_new(amplitude=0):
    return as_recording(make_gait(2, 2, takes=True, amplitude=amplitude, random_state=5), 1)


healthy = somebody_new()
missed = healthy.copy()
strikes = [event for event in healthy.attrs["events"] if event["label"] == "Foot Strike"]
missed.attrs["events"] = [event for event in healthy.attrs["events"] if event is not strikes[1]]
shown = {
    "healthy": cut_at_events(healthy, "Foot Strike")[0],
    "stiff knee": cut_at_events(somebody_new(-36), "Foot Strike")[0],
    "a little stiff": cut_at_events(somebody_new(-12), "Foot Strike")[0],
    "heel strike missed": cut_at_events(missed, "Foot Strike")[0],
}
new = on_clock(list(shown.values()))
pd.DataFrame({"model": model.predict(new), "frames": [len(x) for x in shown.values()]}, index=shown)

# %%
# Where they leave the band that holds 95 % of the whole cycles of new people: violet.

display = ActionModelDisplay.from_estimator(model, new, band="performances")

# %%
# The worst departure of each feature, of those that are rare among healthy people:

departures = find_departures(model, new)
departures[departures["rare"]].groupby(["performance", "feature"]).head(1).round(1)

# %%
# The knee that is a little stiff is accepted and leaves no trace: healthy people differ by as
# much. A lab that wants to see it has to ask about groups, or about the same person before and
# after; :doc:`plot_two_groups` does.

plt.show()
