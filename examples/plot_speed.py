"""
What changes with speed
=======================

You get a regression of a movement on a covariate, such as speed or age: in its shape and in its
timing, with slopes in the units of the signals.
"""

import matplotlib.pyplot as plt
import numpy as np
from sklearn.pipeline import make_pipeline
from sklearn.preprocessing import StandardScaler
from sklearn_motionsync import DenseSynchronizer, FrameWise, Match
from sklearn_motionsync.comparison import compare_groups
from sklearn_motionsync.datasets import make_gait

# %%
# Each of ten people walks at six speeds
# --------------------------------------
# The strides are synthetic. For each m/s, toe-off is 5 % of the cycle earlier, and the force varies
# by 30 % more.

gait = make_gait(10, n_cycles=6, random_state=0)
speed = np.tile(np.linspace(0.9, 1.9, 6), 10)


def at_speed(x, v):
    t = np.linspace(0, 1, len(x))
    moments = t + 0.05 * (v - 1.4) * np.sin(np.pi * t) ** 2
    x = np.stack([np.interp(moments, t, column) for column in x.T], axis=1)
    force = x[:, 3]
    x[:, 3] = force + 0.3 * (v - 1.4) * (force - 0.95) * (force > 0.5)
    return x


trials = [at_speed(*one) for one in zip(gait.data, speed, strict=True)]

# %%
# The test
# --------
# The speed differs within people. So each person has a slope of her own, and slopes are tested.

pipe = make_pipeline(FrameWise(StandardScaler()), DenseSynchronizer(101)).fit(trials)
found = compare_groups(pipe, trials, y=speed, covariate=True, groups=gait.person)
print(found.describe())
found.clusters.round(2)

# %%
# The figure: the offsets of all strides in the colours of their speeds.

offsets = Match.from_estimator(pipe, trials).offsets_in("percent")
figure, axis = plt.subplots(figsize=(6.4, 3.4), layout="constrained")
colors = plt.colormaps["viridis"]
for v in np.unique(speed):
    mean = offsets[speed == v].mean(axis=0)
    axis.plot(mean, color=colors((v - 0.9) / 1.1), label=f"{v:.1f} m/s")
axis.set_ylabel("mean offset (%), later is above")
axis.set_xlabel("% of the pattern")
axis.legend(frameon=False, fontsize="small", ncols=2)
_ = axis.set_title("The faster, the earlier", fontsize="medium")

# %%
# Where it fails
# --------------
# A slope is a straight line. If a movement changes at middle speeds alone, the slopes are near 0,
# and nothing is found. Take groups of speeds then:

bent = [at_speed(x, 1.4 + (abs(v - 1.4) < 0.2)) for x, v in zip(gait.data, speed, strict=True)]
pipe = make_pipeline(FrameWise(StandardScaler()), DenseSynchronizer(101)).fit(bent)
print(compare_groups(pipe, bent, y=speed, covariate=True, groups=gait.person).describe())
middle = ["middle" if abs(v - 1.4) < 0.2 else "other" for v in speed]
print(compare_groups(pipe, bent, middle, groups=gait.person, paired=True).describe())

plt.show()
