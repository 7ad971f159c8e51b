"""
Two groups: shape or timing?
============================

Two groups of people walk, and their curves differ. Do the joints of one group move differently, or
do they the same at another time? After time normalisation to 101 points the two cannot be told
apart: a peak that comes later and a curve that is higher look alike there. Nonlinear registration
to one clock separates them into a curve and an offset, and statistical parametric mapping
(`spm1d <https://spm1d.org>`_) tests both together, and then each alone.
"""

import matplotlib.pyplot as plt
import numpy as np
import pandas as pd
import spm1d
from sklearn.pipeline import make_pipeline
from sklearn.preprocessing import StandardScaler
from sklearn_motionsync import DenseSynchronizer, FrameWise, LinearSynchronizer, Match
from sklearn_motionsync.datasets import make_gait

COLORS = {"A": "#0072B2", "B": "#D55E00"}

# %%
# Ten people a group, two gait cycles each
# ----------------------------------------
# Flexion of hip, knee and ankle, and the vertical force, from heel strike to heel strike. They are
# synthetic, so how the groups differ is known, and will be looked up at the end.

gait = make_gait(20, n_cycles=2, timing=3, random_state=1)
print(len(gait.data), "cycles of", [len(x) for x in gait.data[:6]], "... frames")

# %%
# Cycles of one person are no independent samples, so what is compared are the means of people.


def of_people(values, bunch=gait):
    """Means of people in group A and B: two arrays (n_people, 101, ...)."""
    people = pd.unique(bunch.person)
    means = np.stack([values[bunch.person == who].mean(axis=0) for who in people])
    group = np.array([bunch.group[bunch.person == who][0] for who in people])
    return means[group == "A"], means[group == "B"]


# %%
# Time normalisation to 101 points
# --------------------------------
# What labs do: every cycle is stretched evenly to 0 to 100 %.

linear = LinearSynchronizer(101).fit_transform(gait.data)

# %%
# One clock for both groups
# -------------------------
# The pattern is learnt from all cycles *together*: had each group its own, a difference in
# timing would be lost, and a fit that knows the groups would find one where there is none.
# Degrees and body weights cannot be compared, so every feature is divided by its spread before it
# is matched. The warps then carry the curves as they were measured. How much later
# than in the pattern each moment comes in a cycle, in per cent of it, is a curve, too: the offset.


def synchronise(bunch):
    pipe = make_pipeline(FrameWise(StandardScaler()), DenseSynchronizer(101)).fit(bunch.data)
    match = Match.from_estimator(pipe, bunch.data)
    return match.warp(bunch.data), match.offsets_in("percent")


curves, offsets = synchronise(gait)

HIP, KNEE = gait.feature_names.index("hip_flexion"), gait.feature_names.index("knee_flexion")
shown = {
    "hip flexion, time-normalised (degrees)": linear[:, :, HIP],
    "hip flexion, on one clock (degrees)": curves[:, :, HIP],
    "offset (% of the cycle)": offsets,
}
figure, axes = plt.subplots(2, 2, figsize=(8, 6), layout="constrained")
for axis, (name, values) in zip(axes.flat, shown.items(), strict=False):
    for group, some in zip("AB", of_people(values), strict=True):
        mean, sd = some.mean(axis=0), some.std(axis=0, ddof=1)
        axis.plot(some.T, color=COLORS[group], linewidth=0.5, alpha=0.5)
        axis.plot(mean, color=COLORS[group], linewidth=2, label=f"group {group}: mean ± SD")
        axis.fill_between(np.arange(101), mean - sd, mean + sd, color=COLORS[group], alpha=0.15)
    axis.set_title(name, fontsize="medium")
    axis.set_xlabel("% of each cycle" if axis is axes[0, 0] else "% of the pattern's cycle")
axes[1, 1].axis("off")
axes[1, 1].legend(*axes[0, 0].get_legend_handles_labels(), loc="center left", frameon=False)

# %%
# Curve and offset together
# -------------------------
# Hotelling's T² at every instant, of the pair (curve, offset), with a threshold that the largest T²
# of the whole cycle exceeds in 5 % of all studies in which nothing differs. Both ends are left
# out: a cycle begins and ends with the heel strike by definition, so the offset is 0 there for
# everybody and has no variance. The random field theory behind the threshold supposes that what is
# left is smooth and normal. Permutations of people suppose less, but ``spm1d.stats.nonparam``
# (0.4.55) does not run on NumPy 2.4; ``benchmarks/groups.py`` has them in a dozen lines.

inside = slice(1, -1)


def tests(bunch, linear, curves, offsets, feature):
    """The inferences of spm1d at 5 %, by what is compared."""

    def t_test(values):
        a, b = of_people(values[:, inside], bunch)
        return spm1d.stats.ttest2(b, a).inference(0.05, two_tailed=True)

    a, b = of_people(np.stack([curves[:, :, feature], offsets], axis=2)[:, inside], bunch)
    return {
        "time-normalised curve": t_test(linear[:, :, feature]),
        "curve and offset": spm1d.stats.hotellings2(a, b).inference(0.05),
        "curve alone": t_test(curves[:, :, feature]),
        "offset alone": t_test(offsets),
    }


of_hip = tests(gait, linear, curves, offsets, HIP)
figure, axes = plt.subplots(2, 2, figsize=(8, 5.6), layout="constrained")
for axis, (name, found) in zip(axes.flat, of_hip.items(), strict=True):
    at = np.arange(1, 100)
    axis.plot(at, found.z, color="black")
    axis.axhline(found.zstar, color="#CC3311", linestyle="--")
    beyond = found.z > found.zstar
    if name != "curve and offset":
        axis.axhline(-found.zstar, color="#CC3311", linestyle="--")
        beyond |= found.z < -found.zstar
    axis.fill_between(at, 0, found.z, where=beyond, color="#CC3311", alpha=0.3)
    axis.set_title(f"{name}: {'differs' if found.h0reject else 'no difference'}", fontsize="medium")
    axis.set_ylabel("T²" if name == "curve and offset" else "t")
for axis in axes[1]:
    axis.set_xlabel("% of the cycle")

# %%
# Time normalisation sees nothing in the hip: people differ by more degrees than the timing moves.
# The joint test finds a difference. The two tests of its parts say which: it is the offset, around
# push-off and in swing, and not the curve. The same for hip and knee:


def table(bunch):
    linear = LinearSynchronizer(101).fit_transform(bunch.data)
    synchronised = synchronise(bunch)
    rows = {}
    for feature in (HIP, KNEE):
        found = tests(bunch, linear, *synchronised, feature)
        said = {what: "differs" if f.h0reject else "-" for what, f in found.items()}
        rows[bunch.feature_names[feature]] = said
    return pd.DataFrame(rows).T


table(gait)

# %%
# In the knee, which moves faster, time normalisation finds a difference; but it cannot tell that it
# is one of timing, and a paper would say that group B flexes its knee less in early swing.
#
# The truth
# ---------
# The joints of both groups do the same; toe-off comes 3 % of the cycle later in group B.

true_shape = np.abs(gait.group_curves[1] - gait.group_curves[0]).max()
true_timing = 100 * (gait.group_times[1] - gait.group_times[0])
found = [some.mean(axis=0) for some in of_people(offsets)]
print(f"largest true difference in shape: {true_shape:.1f} degrees")
for when in (14, 48, 62, 73):
    print(
        f"at {when} % of the cycle B is {true_timing[when]:.1f} % later, "
        f"found: {found[1][when] - found[0][when]:.1f} %"
    )

# %%
# The opposite, and nothing
# -------------------------
# A knee that is flexed 12 degrees further in swing, at the same time, is a difference in shape:

table(make_gait(20, n_cycles=2, amplitude=12, random_state=1))

# %%
# And of two groups between which nothing differs, nothing is found:

table(make_gait(20, n_cycles=2, random_state=1))

# %%
# One study proves little. :doc:`/accuracy` has how often each test finds what is there, and what is
# not, in 200 studies.

plt.show()
