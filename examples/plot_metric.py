"""
Which signals count in the matching
===================================

You get the weight of each signal in the matching, and see that noise gets none. Without weights, a
signal that moves much counts much, even if it is noise. From three trials on, dense matching learns
which signals agree at the same moment, and weights them accordingly.
"""

import matplotlib.pyplot as plt
import numpy as np
from scipy.ndimage import gaussian_filter1d
from sklearn_motionsync import DenseSynchronizer, DirectionCosines
from sklearn_motionsync.datasets import make_bending
from sklearn_motionsync.metrics import group_timing_error

bunch = make_bending(12, random_state=2)
cosines = DirectionCosines(bunch.skeleton).set_output(transform="pandas")
columns = ["pelvis_height", "torso_y", "torso_z", "left_thigh_y", "right_arm_y", "right_forearm_y"]
poses = cosines.fit_transform(bunch.data)[columns]

# %%
# Three columns of noise
# ----------------------
# Smooth noise is added as three more columns. It varies as much as the poses, and differs from
# trial to trial.


def drift(n_frames, random_state):
    """Three columns of smooth noise with a standard deviation of 1."""
    noise = np.random.default_rng(random_state).normal(size=(n_frames, 3))
    noise = gaussian_filter1d(noise, 3, axis=0)
    return noise / noise.std(axis=0)


def with_drift(draws):
    """The poses, and beside them the noise that is drawn for each trial."""
    table, spread = poses.copy(), poses.std().mean()
    both = zip(bunch.data, draws, strict=True)
    drifts = np.concatenate([drift(len(x), draw) for x, draw in both])
    table[["drift0", "drift1", "drift2"]] = spread * drifts
    return table


def draw_shares(metric, title):
    """Bars of what each signal is of all that is compared, with and without weights."""
    _, axis = plt.subplots(figsize=(6.4, 3.4), layout="constrained")
    rows = np.arange(len(noisy.columns))
    axis.barh(rows, metric.energy, height=0.8, color="0.75", label="without weights")
    axis.barh(rows, metric.share, height=0.4, color="#0072B2", label="with learnt weights")
    axis.set_yticks(rows, noisy.columns)
    axis.invert_yaxis()
    axis.set_xlabel("share of what is compared (0 to 1)")
    axis.set_title(title)
    axis.legend(frameon=False)


noisy = with_drift(draws=range(12))
learned = DenseSynchronizer(100).fit(noisy)
noise_share, noise_energy = learned.metric_.share[-3:].sum(), learned.metric_.energy[-3:].sum()
draw_shares(
    learned.metric_,
    f"The noise falls from {noise_energy:.0%} to {noise_share:.0%} of what is compared",
)

# %%
# The numbers are those of ``metric_``.

found = learned.metric_
for name, energy, share in zip(noisy.columns, found.energy, found.share, strict=True):
    print(f"{name:16s} {energy:5.2f} without weights, {share:5.2f} with learnt weights")

# %%
# How far noise moves the warps
# -----------------------------
# All fits have the same pattern. The true timing is known here. The error is how far apart the
# trials show the same moment, in frames.

base = learned.pattern_index_
errors, moves = {}, {}
for metric in ("learned", None):
    dense = DenseSynchronizer(100, pattern=base, metric=metric)
    clean, moved = (dense.fit(table).match(table).times for table in (poses, noisy))
    errors[metric] = [group_timing_error(times, bunch.times) for times in (clean, moved)]
    moves[metric] = np.abs(moved - clean).mean()

figure, axis = plt.subplots(figsize=(6.4, 3), layout="constrained")
for offset, metric, name, color in (
    (-0.2, None, "without weights", "0.65"),
    (0.2, "learned", "with learnt weights", "#0072B2"),
):
    bars = axis.bar(np.arange(2) + offset, errors[metric], width=0.38, color=color, label=name)
    axis.bar_label(bars, fmt="%.2f")
axis.set_xticks([0, 1], ["clean signals", "with three columns of noise"])
axis.set_ylabel("timing error (frames)")
axis.margins(y=0.15)
axis.legend(frameon=False, loc="upper left")
_ = axis.set_title(
    f"With weights, noise moves the warps by {moves['learned']:.2f} frames,\n"
    f"without by {moves[None]:.2f}"
)

# %%
# On the clean signals, too, the result with weights is better.
#
# Where it fails
# --------------
# Noise is recognised because it differs between trials. A sensor that settles in the same way
# after each start repeats in all trials. It gets weight, and the warps follow it. Leave such a
# column out.

same = with_drift(draws=[0] * 12)
fooled = DenseSynchronizer(100, pattern=base).fit(same)
share = fooled.metric_.share[-3:].sum()
draw_shares(fooled.metric_, f"Noise that repeats in all trials gets weight: {share:.0%}")
for name, table, dense in (("differs", noisy, learned), ("repeats", same, fooled)):
    error = group_timing_error(dense.match(table).times, bunch.times)
    print(f"the noise {name}: {error:.2f} frames apart")

# %%
# Two trials are too few: ``metric_`` is then None, and nothing is weighted.

pair = [x.to_numpy() for _, x in noisy.groupby(level="trial")][:2]
print(DenseSynchronizer(100).fit(pair).metric_)
plt.show()
