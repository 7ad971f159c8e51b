"""
Long takes cut into cycles
==========================

You get single gait cycles from takes of several steps, without any event marked by hand. The
self-correlation of a take gives the period, if there is one. Dense matching to a pattern cycle
then finds where each cycle begins. The true moments are known here, so both can be judged.
"""

import matplotlib.pyplot as plt
import numpy as np
from sklearn.pipeline import make_pipeline
from sklearn.preprocessing import StandardScaler
from sklearn_motionsync import ActionModel, DenseSynchronizer, FrameWise
from sklearn_motionsync.datasets import make_bending, make_gait
from sklearn_motionsync.display import ActionModelDisplay, CycleDisplay
from sklearn_motionsync.takes import CycleSegmenter

gait = make_gait(6, n_cycles=4, takes=True, warp=2, random_state=0)
takes = FrameWise(StandardScaler()).fit_transform(gait.data)  # degrees and body weights

# %%
# The period, and the cuts
# ------------------------
# Half of the people give the pattern of one cycle. It begins where the hip is flexed most. The
# takes of the others are cut at the same moment. The upper panel shows the self-correlation of one
# take, and the lower one its hip.

segmenter = CycleSegmenter(start=0).fit(takes[:3])
new, times = takes[3:], gait.times[3:]
display = CycleDisplay.from_estimator(segmenter, new, unit="seconds", frame_rate=gait.frame_rate)
display.axes_[1].set_ylabel("hip flexion\n(standard deviations)")
_ = display.figure_.suptitle("Each cycle of a new person is cut\nwhere the hip is flexed most")

# %%
# How well the cuts agree
# -----------------------
# All cuts should be at the same moment of the cycle. The figure shows the true moment of each cut,
# as its distance from the median. Cuts that follow the first one at a constant period, that of the
# self-correlation, drift, because the pace changes from cycle to cycle.


def places_of_cuts(starts):
    """The true moments of starts in takes, in per cent of a cycle from their median."""
    phases = np.concatenate([times[take][frames] % 1 for take, frames in starts.items()])
    return 100 * ((phases - np.median(phases) + 0.5) % 1 - 0.5)


_, origin = segmenter.segment(new)
starts = {take: rows["start"].to_numpy() for take, rows in origin.groupby("take")}
periods = segmenter.report(new)["period"]
steady = {
    take: np.round(frames[0] + periods[take] * np.arange(len(frames))).astype(int)
    for take, frames in starts.items()
}
cuts = {"constant period": places_of_cuts(steady), "dense matching": places_of_cuts(starts)}
figure, axis = plt.subplots(figsize=(6.4, 2.6), layout="constrained")
for row, (places, color) in enumerate(zip(cuts.values(), ("#D55E00", "#0072B2"), strict=True)):
    axis.plot(places, np.full(len(places), row), "o", color=color, alpha=0.6, markersize=9)
axis.set_yticks([0, 1], [f"{name}:\nspread {places.std():.1f} %" for name, places in cuts.items()])
axis.set_ylim(1.6, -0.6)
axis.set_xlabel("true moment of the cut, from the median (% of a cycle)")
_ = axis.set_title("Dense matching cuts closer to the same moment")

# %%
# Standing is no cycle
# --------------------
# This person stands, walks, stands again and walks on. Only the stretches in which the take repeats
# are cut. They are shaded.

still = np.repeat(new[0][:1], 250, axis=0) + 0.05 * np.random.default_rng(0).normal(size=(250, 4))
walk = np.concatenate([still, new[0], still, new[1][:330], still])
display = CycleDisplay.from_estimator(segmenter, [walk], unit="seconds", frame_rate=100)
display.axes_[1].set_ylabel("hip flexion\n(standard deviations)")
_ = display.figure_.suptitle("Two stretches of walking are found, and cut by themselves")

# %%
# From cycles to a model
# ----------------------
# The cycles are trials for any pipeline. ``locations`` holds the take of each. Given as groups, it
# keeps the cycles of one person together.

cycles, locations = segmenter.segment(takes)
print(locations.head(3))
pipe = make_pipeline(DenseSynchronizer(101), ActionModel()).fit(
    cycles, actionmodel__groups=locations["take"]
)
display = ActionModelDisplay.from_estimator(pipe, cycles, features=[0, 1], unit="percent")
for axis, joint in zip(display.axes_, ("hip", "knee"), strict=True):
    axis.set_ylabel(f"{joint} flexion\n(standard deviations)")
_ = display.figure_.suptitle(f"{len(cycles)} cycles of six people, aligned: none leaves the band")

# %%
# What is refused
# ---------------
# A bend is no cycle. Its self-correlation falls, and has no second peak. A walk of one cycle and a
# half is too short to show that it repeats.

bend = make_bending(1, random_state=0)
display = CycleDisplay.from_estimator(CycleSegmenter(bend.skeleton), bend.data)
display.axes_[1].set_ylabel("left ankle ahead\n(leg lengths)")
display.figure_.suptitle("A bend does not repeat, and is refused")
short = takes[0][: int(1.5 * segmenter.periods_[0])]
for estimator, take in ((CycleSegmenter(bend.skeleton), bend.data[0]), (CycleSegmenter(), short)):
    try:
        estimator.fit(take)
    except ValueError as error:
        print(error)
plt.show()
