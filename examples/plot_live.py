"""
A movement followed while it runs
=================================

You get the phase of a movement while it runs, a prediction of the rest, and a confidence. The
movement is learnt from 24 bends. New frames are then matched to their mean, one by one. The true
moments are known here, so the answers can be judged.
"""

import matplotlib.pyplot as plt
import numpy as np
from sklearn_motionsync import DirectionCosines
from sklearn_motionsync.datasets import make_bending
from sklearn_motionsync.display import PhaseDisplay
from sklearn_motionsync.live import OnlineSynchronizer

known = make_bending(24, n_actors=6, style=2, random_state=0)
new = make_bending(6, n_actors=6, style=2, random_state=7)  # six others
cosines = DirectionCosines(known.skeleton).fit(known.data)
X, trials = cosines.transform(known.data), cosines.transform(new.data)
live = OnlineSynchronizer(frame_rate=known.frame_rate).fit(X)
end = live.n_frames_ - 1

# %%
# Frame by frame
# --------------
# ``step`` takes one frame. It returns the phase, the rate and the confidence. A rate of 1.2 is 1.2
# times as fast as the mean.

person = trials[1]
for k, frame in enumerate(person):
    here = live.step(frame, time=k / known.frame_rate)
    if k % 20 == 10:
        print(
            f"{k / known.frame_rate:.1f} s: {100 * here.phase / end:3.0f} %, rate {here.rate:.1f}, "
            f"confidence {here.confidence:.2f}, about {live.time_left():.1f} s to go"
        )
live.reset()

# %%
# How exact it is
# ---------------
# ``track`` does the same for whole trials, and never uses a later frame. The error is
# the difference from the true phase, after the first fifth of each trial. Two other answers are
# compared. One is known only when the trial is over. The other assumes the mean duration.

frames = live.synchronizer_.match(X).frames(X)
moments = np.mean(
    [np.interp(f, np.arange(len(t)), t) for f, t in zip(frames, known.times, strict=True)], axis=0
)


def percent_done(phase):
    """Phases as the share of the action that is done."""
    return 100 * np.interp(phase, np.arange(live.n_frames_), moments)


def after_the_end(x, tau):
    return np.interp(np.linspace(0, tau[-1], len(x)), tau, np.arange(len(tau)))


taus = live.synchronizer_.match(trials).times
phases = {
    "live": [found.phase for found in live.track(trials)],
    "known after the end": [after_the_end(x, tau) for x, tau in zip(trials, taus, strict=True)],
    "by the mean duration": [end * np.arange(len(x)) / live.duration_ for x in trials],
}
medians = {}
for name, of_trials in phases.items():
    off = [
        np.abs(percent_done(phase) - 100 * true)[len(true) // 5 :]
        for phase, true in zip(of_trials, new.times, strict=True)
    ]
    medians[name], most = np.quantile(np.concatenate(off), [0.5, 0.9])
    print(f"{name:22} median {medians[name]:4.1f}, nine of ten below {most:4.1f} % of the action")

figure, axis = plt.subplots(figsize=(6.4, 4), layout="constrained")
for name, color in (("by the mean duration", "#E69F00"), ("live", "#0072B2")):
    for phase, true in zip(phases[name], new.times, strict=True):
        axis.plot(100 * true, percent_done(phase), color=color, alpha=0.7)
    axis.plot([], [], color=color, label=f"{name}: {medians[name]:.1f} % off")
axis.plot([0, 100], [0, 100], "k--", linewidth=1, label="true")
axis.set_xlabel("done in truth (% of the action)")
axis.set_ylabel("done as estimated\n(% of the action)")
axis.legend(frameon=False)
_ = axis.set_title(f"Live, the phase of six new people is {medians['live']:.1f} % off (median)")

# %%
# The end is less certain. It is predicted from the mean duration and the pace so far. Half-way, how
# many seconds is it off for each of the six?

seconds_off = []
for x in trials:
    half = len(x) // 2
    for k, row in enumerate(x[:half]):
        live.step(row, time=k / known.frame_rate)
    seconds_off.append(live.time_left() - (len(x) - half) / known.frame_rate)
    live.reset()
print(np.round(seconds_off, 2))

# %%
# The dial, and the rest
# ----------------------
# The arc outside the dial ends at the phase a moment later, as does the pale body. Orange is
# predicted: the mean of the known people. The dashed curve is what came.

frame = 45
done = percent_done(live.track([person])[0].phase)[frame]
display = PhaseDisplay.from_estimator(
    live,
    person,
    body=cosines,
    features=["torso_y", "left_forearm_z"],
    names=["on the way up"],
    frame=frame,
)
display.axes_[3].set_ylabel("torso upwards (cosine)")
display.axes_[4].set_ylabel("left forearm forward\n(cosine)")
_ = display.figure_.suptitle(
    f"After {frame / known.frame_rate:.1f} s: {done:.0f} % done, in truth "
    f"{100 * new.times[1][frame]:.0f} %"
)

# %%
# A person who stops half-way
# ---------------------------
# The phase stands still soon after the person does. The confidence falls, and the predicted rest
# does not come.

stopped = np.concatenate([person[:45], np.repeat(person[44:45], 60, axis=0)])
both = PhaseDisplay.from_estimator(
    live,
    [person, stopped],
    body=cosines,
    features="left_forearm_z",
    names=["a bend", "stops half-way"],
)
for axis in both.axes_[3::4]:
    axis.set_ylabel("left forearm forward\n(cosine)")
animation = both.animate(seconds=2.5, fps=6)
plt.close()  # the player below shows it
animation

# %%
# Where it fails
# --------------
# The method knows only one movement. Whatever comes, it gives the phase where the mean bend is
# most similar. A bend with waving arms gets a phase as usual. Only the confidence shows that
# something is wrong.

bend = trials[0]
joints = known.skeleton.joints
arms = [k for k, name in enumerate(joints) if name.endswith(("elbow", "wrist"))]
waving = new.data[0].reshape(len(bend), -1, 3).copy()
waving[:, arms, 1] += 0.8 * np.abs(np.sin(np.linspace(0, 4 * np.pi, len(waving))))[:, np.newaxis]
others = {
    "a bend": bend,
    "waits for a second first": np.concatenate([np.repeat(bend[:1], 50, axis=0), bend]),
    "stops half-way": np.concatenate([bend[:50], np.repeat(bend[49:50], 60, axis=0)]),
    "waves both arms": cosines.transform(waving.reshape(len(waving), -1)),
    "backwards": bend[::-1],
}
figure, axis = plt.subplots(figsize=(6.4, 2.8), layout="constrained")
for row, found in enumerate(live.track(list(others.values()))):
    confidence = found.confidence.mean()
    axis.barh(row, confidence, color="#D55E00" if row > 1 else "#0072B2")
    last = f"{confidence:.2f}, last phase {100 * found.phase[-1] / end:.0f} %"
    axis.text(confidence + 0.01, row, last, va="center")
axis.set_yticks(range(len(others)), others)
axis.set_xlim(0, 1.45)
axis.invert_yaxis()
axis.set_xlabel("mean confidence (0 to 1)")
axis.set_title("The confidence falls where the movement is no bend")
plt.show()
