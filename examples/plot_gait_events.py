"""
Foot strikes and a gait report
==============================

You get heel strikes, foot-offs and a table of gait parameters from marker positions alone, without
force plates. The walks are made up, so the true events are known. Half of the people limp.
"""

import matplotlib.pyplot as plt
import numpy as np
import pandas as pd
from sklearn_motionsync.datasets import make_walk
from sklearn_motionsync.display import GaitDisplay
from sklearn_motionsync.gait import gait_events, gait_parameters

even = make_walk(5, random_state=0)
limping = make_walk(5, asymmetry=6, random_state=1)  # the left foot strikes late
walks = [*even.data, *limping.data]
truth = [*even.events, *limping.events]
skeleton, rate = even.skeleton, even.frame_rate

# %%
# Strikes and foot-offs
# ---------------------
# Heels and toes are known by their names. Lines are strikes, dotted lines foot-offs. Where the bars
# overlap, both feet are on the ground. A table tells the unit of its positions.

columns = [f"{joint}_{axis}" for joint in skeleton.joints for axis in "xyz"]
walk = pd.DataFrame(limping.data[0], columns=columns)
walk.attrs["units"] = "m"
display = GaitDisplay.from_positions([walk], skeleton, frame_rate=rate)
_ = display.figure_.suptitle("A limp: the left foot strikes late")

# %%
# How far they are from the truth
# -------------------------------
# A centimetre of noise is much more than that of optical markers.

events = gait_events(walks, skeleton, frame_rate=rate)
rng = np.random.default_rng(0)
noisy = gait_events([x + rng.normal(0, 0.01, x.shape) for x in walks], skeleton, frame_rate=rate)


def errors(found, label):
    """Milliseconds from each true event to the nearest one of the same foot."""
    out = []
    for i, true in enumerate(truth):
        own = found[(found["trial"] == i) & (found["label"] == label)]
        for event in true:
            if event["label"] == label:
                times = own.loc[own["context"] == event["context"], "time"].to_numpy()
                off = times - event["time"]
                out.append(1000 * off[np.abs(off).argmin()])
    return np.array(out)


figure, axis = plt.subplots(figsize=(6.4, 2.6), layout="constrained")
rows = [
    (f"{label}\n{name}", errors(found, label), color)
    for label in ("Foot Strike", "Foot Off")
    for name, found, color in (("markers", events, "#0072B2"), ("1 cm of noise", noisy, "#D55E00"))
]
for k, (_, off, color) in enumerate(rows):
    axis.plot(off, np.full(len(off), k), "o", color=color, alpha=0.3)
axis.set_yticks(range(4), [name for name, *_ in rows])
axis.set_ylim(3.6, -0.6)
axis.set_xlabel("from the true event (ms)")
_ = axis.set_title("Noise moves events by some milliseconds")

# %%
# The report
# ----------
# Steps are those of the left and the right foot. ``asymmetry`` is left minus right in per cent.

table = gait_parameters(walks, skeleton, frame_rate=rate)
print(table.loc[5].drop(columns=["sd", "n"]).round(2))
limp = table.xs("step time", level="parameter")["asymmetry"]
figure, axis = plt.subplots(figsize=(6.4, 2.4), layout="constrained")
axis.bar(range(10), limp, color=["#0072B2"] * 5 + ["#D55E00"] * 5)
axis.axhline(0, color="black", linewidth=0.8)
axis.set_xticks(range(10))
axis.set_xlabel("person (5 to 9 limp)")
axis.set_ylabel("asymmetry\nof step times (%)")
_ = axis.set_title("Five people limp, and it shows")

# %%
# Where it fails
# --------------
# Nothing is found of people who stand. Key-points of a video may be 5 cm off in every frame: then
# errors are large, and some events are missed or made up.

still = np.repeat(walks[0][:1], 300, axis=0)
print(len(gait_events([still], skeleton, frame_rate=rate)), "events of a person who stands")
poor = [x[::4] + rng.normal(0, 0.05, x[::4].shape) for x in walks]
found = gait_events(poor, skeleton, frame_rate=rate / 4)
for label in ("Foot Strike", "Foot Off"):
    off = errors(found, label)
    n_true = sum(event["label"] == label for events in truth for event in events)
    print(
        f"{label}: {(found['label'] == label).sum()} found of {n_true}, "
        f"{np.abs(off).mean():.0f} ms off on average"
    )
plt.show()
