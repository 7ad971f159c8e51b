"""
A movement followed while it runs
=================================

Where is somebody in a movement who has not finished it, and what will come? People who bent down
before are synchronised; their mean is what a new person is matched to, frame by frame. Here the
true moments are known, so the answers can be judged, and so can those about people who do
something else.
"""

import matplotlib.pyplot as plt
import numpy as np
from sklearn_motionsync import DirectionCosines, OnlineSynchronizer
from sklearn_motionsync.datasets import make_bending
from sklearn_motionsync.display import PhaseDisplay

known = make_bending(24, n_actors=6, style=2, random_state=0)
new = make_bending(6, n_actors=6, style=2, random_state=7)  # six others
cosines = DirectionCosines(known.skeleton).fit(known.data)
X, strangers = cosines.transform(known.data), cosines.transform(new.data)
live = OnlineSynchronizer(frame_rate=known.frame_rate).fit(X)

# %%
# Frame by frame
# --------------
# ``step`` takes a frame and says where it is: at which phase, at which rate, and how sure that is.

person = strangers[0]
for k, frame in enumerate(person):
    here = live.step(frame, time=k / known.frame_rate)
    if k % 20 == 10:
        phase = 100 * here.phase / (live.n_frames_ - 1)
        print(
            f"{k / known.frame_rate:.1f} s: {phase:3.0f} %, rate {here.rate:.1f}, confidence "
            f"{here.confidence:.2f}, about {live.time_left():.1f} s to go"
        )
live.reset()

# %%
# The dial, and the rest
# ----------------------
# ``follow`` says the same of performances that are there already, and looks at no frame before its
# time. The arc outside the dial ends where the person will be soon, as does the pale body. Orange
# is the mean of the people who are known, from this phase on, with a band that holds nine of ten;
# the dashed curve is what came.

display = PhaseDisplay.from_estimator(
    live,
    person,
    training=X,
    body=cosines,
    features=["torso_y", "left_forearm_z"],
    names=["half-way up"],
    frame=60,
)

# %%
# How far off it is
# -----------------
# Errors against the true moments, of all strangers, after the first fifth. Who waits until it is
# over knows better; who only knows how long it takes others knows far less.

frames = live.synchronizer_.match(X).frames(X)
moments = np.mean(
    [np.interp(f, np.arange(len(t)), t) for f, t in zip(frames, known.times, strict=True)], axis=0
)


def report(name, phases):
    clock = np.arange(live.n_frames_)
    off = [
        100 * np.abs(np.interp(phase, clock, moments) - true)[len(true) // 5 :]
        for phase, true in zip(phases, new.times, strict=True)
    ]
    median, most = np.quantile(np.concatenate(off), [0.5, 0.9])
    print(f"{name:22} median {median:4.1f}, nine of ten below {most:4.1f} % of the action")


def afterwards(x, tau):
    return np.interp(np.linspace(0, tau[-1], len(x)), tau, np.arange(len(tau)))


end, taus = live.n_frames_ - 1, live.synchronizer_.match(strangers).times
report("live", [said.phase for said in live.track(strangers)])
report("known afterwards", [afterwards(x, tau) for x, tau in zip(strangers, taus, strict=True)])
report("by the mean duration", [end * np.arange(len(x)) / live.duration_ for x in strangers])

# %%
# Somebody who stops half-way
# ---------------------------
# Nothing says beforehand that a person will stop. The phase stands still soon after, the confidence
# falls, and the rest that is predicted does not come. The path that is known afterwards is no truth
# here: it takes for granted that everybody gets to the end.

stopped = np.concatenate([person[:50], np.repeat(person[49:50], 60, axis=0)])
both = PhaseDisplay.from_estimator(
    live,
    [person, stopped],
    training=X,
    body=cosines,
    features="left_forearm_z",
    names=["a bend", "stops half-way"],
)
animation = both.animate(seconds=2.5, fps=6)
plt.close()  # the player below shows it
animation

# %%
# What goes wrong
# ---------------
# The pattern is all that is known: whatever is done, the phase is that where the pattern is most
# like it. Both arms waved over a bend are followed as if they did not matter, and who waits before
# the beginning is taken for somebody who has begun. Only the confidence tells.

joints = known.skeleton.joints
arms = [k for k, name in enumerate(joints) if name.endswith(("elbow", "wrist"))]
waving = new.data[0].reshape(len(person), -1, 3).copy()
waving[:, arms, 1] += 0.8 * np.abs(np.sin(np.linspace(0, 4 * np.pi, len(waving))))[:, np.newaxis]
others = {
    "a bend": person,
    "stops half-way": stopped,
    "waves both arms": cosines.transform(waving.reshape(len(waving), -1)),
    "waits for a second": np.concatenate([np.repeat(person[:1], 50, axis=0), person]),
    "does it backwards": person[::-1],
}
for name, said in zip(others, live.track(list(others.values())), strict=True):
    at = np.linspace(0, len(said.phase) - 1, 5).round().astype(int)[1:]
    phases = " ".join(f"{100 * phase / end:3.0f} %" for phase in said.phase[at])
    print(f"{name:19} {phases}   confidence", " ".join(f"{c:.2f}" for c in said.confidence[at]))

PhaseDisplay.from_estimator(
    live,
    [others["waves both arms"], others["waits for a second"]],
    training=X,
    body=cosines,
    features="left_arm_y",
    names=["waves both arms", "waits for a second"],
    frame=40,
)
plt.show()
