"""
Which features are listened to
==============================

A feature that moves much counts much, also if all that moves in it is noise. From three
performances on, dense matching therefore learns which features agree at the same moment of the
action, and weighs them by that. `MetricDisplay` shows what it made of each.
"""

import matplotlib.pyplot as plt
import numpy as np
from scipy.ndimage import gaussian_filter1d
from sklearn_motionsync import DenseSynchronizer, DirectionCosines
from sklearn_motionsync.datasets import make_bending
from sklearn_motionsync.display import MetricDisplay
from sklearn_motionsync.metrics import group_timing_error

bunch = make_bending(12, random_state=2)
cosines = DirectionCosines(bunch.skeleton).set_output(transform="pandas")
columns = ["pelvis_height", "torso_y", "torso_z", "left_thigh_y", "right_arm_y", "right_forearm_y"]
postures = cosines.fit_transform(bunch.data)[columns]

# %%
# Three columns of noise
# ----------------------
# They wander as far as the postures do, and otherwise in every performance.


def drift(n_frames, random_state):
    """Three columns of smooth noise with a standard deviation of 1."""
    noise = np.random.default_rng(random_state).normal(size=(n_frames, 3))
    noise = gaussian_filter1d(noise, 3, axis=0)
    return noise / noise.std(axis=0)


def with_drift(draws):
    """The postures, and beside them the drift that is drawn for every performance."""
    table, spread = postures.copy(), postures.std().mean()
    both = zip(bunch.data, draws, strict=True)
    drifts = np.concatenate([drift(len(x), draw) for x, draw in both])
    table[["drift0", "drift1", "drift2"]] = spread * drifts
    return table


noisy = with_drift(draws=range(12))
learned = DenseSynchronizer(100).fit(noisy)
MetricDisplay.from_estimator(learned)

# %%
# The light bars say how much of the plain velocities a column makes, the dark ones how much of what
# is compared: little, where no two performances agree. The same numbers are in ``metric_``.

found = learned.metric_
for name, energy, share in zip(noisy.columns, found.energy, found.share, strict=True):
    print(f"{name:16s} {energy:5.2f} of plain velocities, {share:5.2f} of what is compared")

# %%
# How far that moves the warps
# ----------------------------
# The same pattern, with noise and without; and since the true timing is known here, how far the
# performances are from showing the same moment at every frame. Without noise plain velocities do
# better on these few clean columns.

base = learned.pattern_index_
for metric in ("learned", None):
    dense = DenseSynchronizer(100, pattern=base, metric=metric)
    clean, moved = (dense.fit(table).match(table).times for table in (postures, noisy))
    errors = [group_timing_error(times, bunch.times) for times in (clean, moved)]
    print(
        f"metric={metric!r}: noise moves warps by {np.abs(moved - clean).mean():.2f} frames, "
        f"and {errors[0]:.2f} frames apart become {errors[1]:.2f}"
    )

# %%
# Where it fails
# --------------
# Noise is told by its being another one in every performance. What repeats in all of them from the
# first frame on, such as a sensor that settles after every start, agrees with itself at the wrong
# moments. It is listened to, and the warps follow it: leave such a column out.

same = with_drift(draws=[0] * 12)
fooled = DenseSynchronizer(100, pattern=base).fit(same)
MetricDisplay.from_estimator(fooled)
for name, table, dense in (("another drift in each", noisy, learned), ("the same", same, fooled)):
    share = dense.metric_.share[-3:].sum()
    error = group_timing_error(dense.match(table).times, bunch.times)
    print(f"{name:22s} {share:.2f} of what is compared, {error:.2f} frames apart")

# %%
# And of two performances nothing is learnt: what they disagree in may as well be a wrong path.

for name, table in (("without noise", postures), ("with noise", noisy)):
    pair = [x.to_numpy() for _, x in table.groupby(level="performance")][:2]
    dense = DenseSynchronizer(100).fit(pair)
    error = group_timing_error(dense.match(pair).times, bunch.times[:2])
    print(f"two {name}: metric_ is {dense.metric_}, {error:.2f} frames apart")
plt.show()
