"""
When it helps little
====================

You get three sets of trials that alignment cannot bring together. They hold two ways to do a task,
a stroke too many, and a different movement. Each has a figure, a number that shows it in your own
data too, and a way out. The trials are made up, so their true moments are known.
"""

import matplotlib.pyplot as plt
import numpy as np
from sklearn_motionsync import DenseSynchronizer

BLUE, ORANGE = "#0072B2", "#D55E00"
percent = np.arange(101)


def bell(phase, at, width):
    return np.exp(-0.5 * ((phase - at) / width) ** 2)


def record(movement, rng, n_frames=80):
    """One trial at a pace of its own, and the phase of the movement in each of its frames."""
    t = np.linspace(0, 1, n_frames)
    phase = t + 0.08 * rng.uniform(-1, 1) * np.sin(np.pi * t)
    x = movement(phase) * rng.normal(1, 0.04)
    return x + 0.01 * rng.standard_normal(x.shape), phase


# %%
# Two ways to do one task
# -----------------------
# Something is picked up from the floor. Seven trials bend the trunk. Seven kneel, and lean forward
# only on the way down. The hand touches the floor at a known phase.


def bend(phase):
    return np.column_stack([bell(phase, 0.5, 0.14), 0.5 * bell(phase, 0.5, 0.2)])


def kneel(phase):
    down = np.tanh((phase - 0.3) / 0.06) - np.tanh((phase - 0.85) / 0.06)
    return np.column_stack([0.4 * bell(phase, 0.35, 0.1), 0.6 * down])


rng = np.random.default_rng(0)
kneels = np.repeat([False, True], 7)
TOUCH = {bend: 0.5, kneel: 0.65}
ways = [kneel if one else bend for one in kneels]
two_ways, phases = zip(*(record(way, rng) for way in ways), strict=True)
touches = np.array(
    [
        np.interp(TOUCH[way], phase, np.linspace(0, 100, len(phase)))
        for way, phase in zip(ways, phases, strict=True)
    ]
)

# %%
# All trials are aligned with one pattern, and then each way with a pattern of its own. The
# spread is the standard deviation of the touch on the time line of the pattern.


def spread_of_touch(chosen):
    """The spread of the touch in per cent of the pattern, and the match."""
    trials = [x for x, one in zip(two_ways, chosen, strict=True) if one]
    match = DenseSynchronizer(n_frames=101).fit(trials).match(trials)
    pairs = zip(match.times, touches[chosen], strict=True)
    return np.std([np.interp(at, tau, percent) for tau, at in pairs], ddof=1), match


together, match_of_ways = spread_of_touch(np.full(14, True))
print(f"spread of the touch, not aligned: {touches.std(ddof=1):.1f} %")
print(f"all aligned together: {together:.1f} %")
for name, chosen in (("bends", ~kneels), ("kneels", kneels)):
    print(f"{name} aligned alone: {spread_of_touch(chosen)[0]:.1f} %")

aligned = match_of_ways.warp(two_ways)
figure, axes = plt.subplots(2, 1, figsize=(6.4, 5), sharex=True, layout="constrained")
for axis, curves, name in zip(axes, aligned.T, ("trunk lean", "knee flexion"), strict=True):
    axis.plot(curves[:, ~kneels], color=BLUE, linewidth=0.8)
    axis.plot(curves[:, kneels], color=ORANGE, linewidth=0.8)
    axis.plot(curves.mean(axis=1), "k--", linewidth=2)
    axis.set_ylabel(f"{name} (no unit)")
for color, label in ((BLUE, "bends"), (ORANGE, "kneels")):
    axes[0].plot([], [], color=color, label=label)
axes[0].plot([], [], "k--", label="mean of all")
axes[0].legend(frameon=False, fontsize="small")
axes[1].set_xlabel("% of the pattern")
_ = figure.suptitle("The mean is half a bend and half a kneel: no trial looks so")

# %%
# Aligned together, the touch spreads more than before. The way out: split the set by the way it is
# done, and fit one synchronizer to each part.
#
# A stroke too many
# -----------------
# Seven trials have two strokes, as in sawing or waving. One has three.


def strokes(count):
    def movement(phase):
        return np.column_stack(
            [np.sin(np.pi * count * phase) ** 2, 0.5 * np.sin(2 * np.pi * count * phase)]
        )

    return movement


rng = np.random.default_rng(1)
stroked = [record(strokes(count), rng)[0] for count in (2, 2, 2, 2, 2, 2, 2, 3)]
match = DenseSynchronizer(n_frames=101).fit(stroked).match(stroked)
typical = np.median(match.distances)
print(f"distance of the odd trial over the median: {match.distances[-1] / typical:.0f}")


def draw(axis, at, curves):
    """All trials in blue, the last one in orange."""
    for t, y in zip(at, curves, strict=True):
        is_last = y is curves[-1]
        axis.plot(t, y, color=ORANGE if is_last else BLUE, linewidth=1.8 if is_last else 0.8)


aligned = list(match.warp(stroked)[:, :, 0])
figure, axes = plt.subplots(2, 1, figsize=(6.4, 5), sharex=True, layout="constrained")
for color, label in ((BLUE, "two strokes"), (ORANGE, "three strokes")):
    axes[1].plot([], [], color=color, label=label)
axes[1].legend(frameon=False, fontsize="small")
draw(axes[0], [np.linspace(0, 100, len(x)) for x in stroked], [x[:, 0] for x in stroked])
draw(axes[1], [percent] * len(aligned), aligned)
axes[0].set_title("time normalised", fontsize="medium")
axes[1].set_title("aligned", fontsize="medium")
for axis in axes:
    axis.set_ylabel("position (no unit)")
axes[1].set_xlabel("% of the pattern")
_ = figure.suptitle("Two of three strokes share the place of one")

# %%
# A warp shifts and stretches. It leaves out nothing, so three strokes stay three. The way out: cut
# the recordings into single strokes, as :doc:`plot_cycles` does, and align these.
#
# A different movement
# --------------------
# Seven bends, and one throw that got into the folder by mistake.


def throw(phase):
    arm = bell(phase, 0.35, 0.08) - 0.5 * bell(phase, 0.6, 0.05)
    return np.column_stack([arm, bell(phase, 0.6, 0.1)])


rng = np.random.default_rng(2)
mixed = [record(movement, rng)[0] for movement in (*[bend] * 7, throw)]
match = DenseSynchronizer(n_frames=101).fit(mixed).match(mixed)
typical = np.median(match.distances)
print(f"distance of the throw over the median: {match.distances[-1] / typical:.0f}")

aligned = match.warp(mixed)
figure, axes = plt.subplots(2, 1, figsize=(6.4, 5), sharex=True, layout="constrained")
draw(axes[0], [percent] * len(mixed), list(match.times))
draw(axes[1], [percent] * len(mixed), list(aligned[:, :, 1]))
for color, label in ((BLUE, "bends"), (ORANGE, "throw")):
    axes[0].plot([], [], color=color, label=label)
axes[0].legend(frameon=False, fontsize="small")
axes[0].set_ylabel("time in the trial (%)")
axes[1].set_ylabel("second signal (no unit)")
axes[1].set_xlabel("% of the pattern")
_ = figure.suptitle("The warp of the throw looks like any other,\nits curve does not")

# %%
# Any two movements get a warp, whether they correspond or not. The way out: learn an
# :class:`~sklearn_motionsync.ActionDetector` from good trials. It refuses such a trial.
#
# Where it fails
# --------------
# A large distance shows one odd trial. It does not show two ways of the same size, since half of
# the set is then odd. So look at the trials themselves, such as in the first figure.

for name, distances in (("two ways", match_of_ways.distances), ("one throw", match.distances)):
    print(f"{name}: largest distance over the median {distances.max() / np.median(distances):.1f}")
plt.show()
