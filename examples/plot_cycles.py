"""
Long takes cut into cycles
==========================

A walk is recorded as one take of many cycles. Its self-correlation tells the period, and whether
there is one; dense matching to a repeated cycle then tells where each one begins. Here the moments
are known, so both can be judged.
"""

import matplotlib.pyplot as plt
import numpy as np
from sklearn.pipeline import make_pipeline
from sklearn.preprocessing import StandardScaler
from sklearn_motionsync import ActionModel, CycleSegmenter, DenseSynchronizer, FrameWise
from sklearn_motionsync.datasets import make_bending, make_gait
from sklearn_motionsync.display import ActionModelDisplay, CycleDisplay

gait = make_gait(6, n_cycles=4, takes=True, warp=2, random_state=0)
takes = FrameWise(StandardScaler()).fit_transform(gait.data)  # degrees and body weights

# %%
# The period, and the cuts
# ------------------------
# Half of the people give the template of one cycle, which begins where the hip is flexed most. The
# others are cut at the same phase. Above the self-correlation, below the hip of somebody new.

segmenter = CycleSegmenter(start=0).fit(takes[:3])
new, times = takes[3:], gait.times[3:]
CycleDisplay.from_estimator(segmenter, new, unit="seconds", frame_rate=gait.frame_rate)

# %%
# Self-correlation beside dense matching
# --------------------------------------
# How far the phase of every frame is from the true one, in hundredths of a cycle. A constant period
# drifts off as the pace changes from cycle to cycle, and knows nothing of the pace within one.

steady = CycleSegmenter(start=0, refine=False).fit(takes[:3])
figure, axis = plt.subplots(figsize=(7, 3), layout="constrained")
for name, color, each in (
    ("constant period", "#D55E00", steady),
    ("dense matching", "#0072B2", segmenter),
):
    off = [
        (phases - true + 0.5) % 1 - 0.5
        for phases, true in zip(each.phases(new), times, strict=True)
    ]
    middle = np.median(np.concatenate(off))
    for i, (x, true) in enumerate(zip(off, times, strict=True)):
        label = f"{name}: {100 * np.abs(np.concatenate(off) - middle).mean():.2f}"
        axis.plot(true, 100 * (x - middle), color=color, label=None if i else label)
axis.set_xlabel("true cycles since the first heel strike")
axis.set_ylabel("off the true phase (%)")
axis.legend()

# %%
# Cycles are performances
# -----------------------
# The cycles go into any pipeline; ``locations`` says which take each comes from, to keep the
# cycles of one person together in cross-validation.

cycles, locations = segmenter.segment(takes)
print(locations.head(3))
pipe = make_pipeline(DenseSynchronizer(101), ActionModel()).fit(
    cycles, actionmodel__groups=locations["take"]
)
ActionModelDisplay.from_estimator(pipe, cycles, features=[0, 1])

# %%
# What does not repeat
# --------------------
# A bend is no cycle: there is no time after which it is like itself. A walk of one cycle and a half
# is like itself, but too short to say that it repeats.

bend = make_bending(1, random_state=0)
display = CycleDisplay.from_estimator(CycleSegmenter(bend.skeleton), bend.data)
short = takes[0][: int(1.5 * segmenter.periods_[0])]
for estimator, take in ((CycleSegmenter(bend.skeleton), bend.data[0]), (CycleSegmenter(), short)):
    try:
        estimator.fit(take)
    except ValueError as error:
        print(error)
plt.show()
