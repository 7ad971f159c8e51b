"""
Which action it is, and whether it is any of them
=================================================

You get the name of the action of each trial, or the answer that it is none of them. Five actions of
eight people are learnt, and people are held out. Then come trials that are none of the five, with
the reason why one is rejected.
"""

import matplotlib.pyplot as plt
import numpy as np
import pandas as pd
from sklearn.metrics import ConfusionMatrixDisplay, roc_auc_score
from sklearn.model_selection import GroupKFold, cross_val_predict
from sklearn.pipeline import make_pipeline
from sklearn_motionsync import (
    ActionClassifier,
    ActionModel,
    DenseSynchronizer,
    DirectionCosines,
)
from sklearn_motionsync.datasets import make_bending
from sklearn_motionsync.display import SkeletonDisplay
from sklearn_motionsync.model import find_departures

# %%
# Five actions
# ------------
# All five are made of one: a person bends, puts something on the floor, and rises. Backwards,
# that is to pick it up. In some trials the person rests at the bottom. A bow turns back half-way
# down.

bunch = make_bending(40, n_actors=8, n_frames=50, style=4, random_state=1)
rng = np.random.default_rng(0)


def with_rest(x, first, share):
    """The same, with a rest for a share of its length."""
    frame = int(first * len(x))
    return np.insert(x, [frame] * int(share * len(x)), x[frame], axis=0)


def bow(x, depth):
    """The same until some frame, and back."""
    frame = int(depth * len(x))
    return np.concatenate([x[:frame], x[frame::-1]])


makers = {
    "put down": lambda x: x,
    "put down, rest": lambda x: with_rest(x, rng.uniform(0.46, 0.5), rng.uniform(0.1, 0.4)),
    "put down twice": lambda x: np.concatenate([x, x]),
    "pick up": lambda x: x[::-1],
    "bow": lambda x: bow(x, rng.uniform(0.25, 0.42)),
}
actions = list(makers)
y = np.repeat(actions, 8)  # a trial of each action by each person
X = [makers[action](x) for action, x in zip(y, bunch.data, strict=True)]

# %%
# New people
# ----------
# Two of the eight are held out at a time.

pipe = make_pipeline(DirectionCosines(bunch.skeleton), ActionClassifier(n_frames=30))
said = cross_val_predict(pipe, X, y, groups=bunch.actor, cv=GroupKFold(4))
matrix = ConfusionMatrixDisplay.from_predictions(
    y, said, labels=actions, cmap="Purples", colorbar=False, xticks_rotation=20
)
matrix.figure_.set_size_inches(6.4, 5)
matrix.ax_.set(xlabel="recognised as", ylabel="true action")
missed = int(((y == "put down, rest") & (said == "put down")).sum())
matrix.ax_.set_title(
    f"{(said == y).mean():.0%} of {len(y)} trials are right: {missed} rests are missed"
)
matrix.figure_.tight_layout()

# %%
# Most trials with a rest are taken for trials without. After alignment, a short rest is a
# slow moment at the bottom, which each trial has. Alignment removes differences that are only in
# the pace. Differences in the poses, or in their order, are recognised.
#
# :doc:`/accuracy` has ten actions of ten real people, UTKinect.

# %%
# None of the five
# ----------------
# By default each trial gets one of the classes. With ``reject_below`` a trial may also be rejected.
# ``"auto"`` sets a threshold that keeps 95 % of the trials of new people. It holds out people in
# the fit, so ``groups`` must name them. The following trials are of a new person.

pipe.set_params(actionclassifier__reject_below="auto")
pipe.fit(X, y, actionclassifier__groups=bunch.actor)

new = make_bending(1, n_frames=50, style=4, random_state=106).data[0]
n = len(new)


def lift_left_arm(x, first, last):
    """The same with the left arm held up straight for a while."""
    joint = bunch.skeleton.index_of
    points = x.reshape(len(x), -1, 3).copy()
    while_up = slice(int(first * len(x)), int(last * len(x)))
    arm = points[while_up, joint("left_elbow")] - points[while_up, joint("left_shoulder")]
    length = np.linalg.norm(arm, axis=1, keepdims=True)
    for name in ("left_elbow", "left_wrist"):
        points[while_up, joint(name)] += [0, 1, 0] * length - arm
    return points.reshape(len(x), -1)


shown = {
    "put down": new,
    "pick up": new[::-1],
    "bow": bow(new, 0.35),
    "left arm lifted": lift_left_arm(new, 0.4, 0.65),
    "first half": new[: n // 2],
    "second half": new[n // 2 :],
    "standing still": np.repeat(new[:1], n, axis=0),
    "three times": np.concatenate([new, new, new]),
    "ends cut off": new[n // 5 : -(n // 5)],
    "at half speed": np.repeat(new, 2, axis=0),
}


def judge(trials):
    """The answer, the most similar class, and how unlike all classes a trial is."""
    features, classifier = pipe[:-1].transform(trials), pipe[-1]
    chances = classifier.predict_proba(features)
    return pd.DataFrame(
        {
            "answer": classifier.predict(features),
            "most like": classifier.classes_[chances.argmax(axis=1)],
            "probability": chances.max(axis=1).round(2),
            "novelty": -classifier.score_samples(features).round(2),
        }
    )


threshold = -pipe[-1].threshold_at(0.95)
print(f"threshold of the novelty: {threshold:.2f}")
judge(list(shown.values())).set_index(pd.Index(shown, name="trial"))

# %%
# The probabilities cannot show that a trial is none of the five: they always add up to 1. The
# novelty can. It is minus the largest decision value.
#
# Why it was rejected
# -------------------
# One of the rejected trials is compared with its most similar class. The table tells when it
# departs, with which limbs, and by how many standard deviations.

lifted = shown["left arm lifted"]
most_like = judge([lifted])["most like"].iloc[0]
of_class = make_pipeline(DirectionCosines(bunch.skeleton), DenseSynchronizer(30), ActionModel())
members = np.flatnonzero(y == most_like)
of_class.fit([X[i] for i in members], actionmodel__groups=bunch.actor[members])
find_departures(of_class, [lifted]).head().round(1)

# %%
# The same as stick figures. Violet limbs depart; the mean of the class is pale.

display = SkeletonDisplay.from_departures(of_class, [lifted], frames=4)
_ = display.heading_.set_text(
    "Rejected, because the left arm is lifted (violet).\nPale: the mean of the class"
)

# %%
# Where it fails
# --------------
# The bend at half speed is not rejected, because alignment removes the pace. An `ActionDetector`
# of the class also looks at the duration.
#
# How often an unknown action is rejected depends on the known ones. Below, each action is left
# out in turn. The classifiers know the four others, and not the people whom they judge.

poses = DirectionCosines(bunch.skeleton).fit_transform(X)


def novelty_of_new_people(action):
    """Novelty above the threshold, where neither the action nor the person is known."""
    above = np.empty(len(X))
    for train, test in GroupKFold(2).split(X, groups=bunch.actor):
        train = train[y[train] != action]
        four = ActionClassifier(n_frames=30)
        four.fit([poses[i] for i in train], y[train], groups=bunch.actor[train])
        scores = four.score_samples([poses[i] for i in test])
        above[test] = four.threshold_at(0.95) - scores
    return above


fig, ax = plt.subplots(figsize=(6.4, 4.4), layout="constrained")
labels, rejected = [], {}
for row, action in enumerate(actions):
    above, unknown = novelty_of_new_people(action), y == action
    ax.plot(above[~unknown], np.full(32, row - 0.12), "o", color="gray", alpha=0.3, mew=0)
    ax.plot(above[unknown], np.full(8, row + 0.12), "o", color="rebeccapurple", alpha=0.5, mew=0)
    rejected[action] = int((above[unknown] > 0).sum())
    area = roc_auc_score(unknown, above)
    labels.append(f"{action}\n{rejected[action]} of 8, AUC {area:.2f}")
ax.axvline(0, color="black", linewidth=0.8)
ax.set_yticks(range(len(actions)), labels)
ax.invert_yaxis()
ax.set_xlabel("novelty above the threshold (rejected on the right)")
ax.set_title("violet: the unknown action, grey: the four known", fontsize="medium")
_ = fig.suptitle(
    f"An unknown bow is always rejected ({rejected['bow']} of 8),\n"
    f"an unknown putting down never ({rejected['put down']} of 8)"
)

# %%
# A bow is unlike all others. Putting down is much like putting down with a rest, so it is not new
# to a classifier that knows the latter. With few people the threshold is also cautious: it
# rejects hardly any known action, where 5 % were asked for. :doc:`/howto/recognise` tells how to
# choose it.

plt.show()
