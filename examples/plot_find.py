"""
Where in a recording it happens
===============================

You get the frames where an action begins and ends in long recordings. The pipeline learns the
action from trials that were cut out by hand. It then finds the action in takes of new people.
"""

import matplotlib.pyplot as plt
import numpy as np
from sklearn.pipeline import make_pipeline
from sklearn_motionsync import ActionModel, ASpace, DenseSynchronizer, DirectionCosines
from sklearn_motionsync.datasets import make_bending
from sklearn_motionsync.display import SearchDisplay
from sklearn_motionsync.takes import find_trials

# %%
# What to look for
# ----------------
# The pipeline learns from twelve bends of four people. ``groups`` names the person of each, and the
# threshold of the search follows from how much people differ.

bending = make_bending(12, random_state=0)
cosines = DirectionCosines(bending.skeleton)
pipe = make_pipeline(ASpace(0.95), DenseSynchronizer(50), ActionModel())
pipe.fit(cosines.fit_transform(bending.data), actionmodel__groups=bending.actor)

# %%
# Two takes of others
# -------------------
# The first take holds three bends, two of them in direct succession. It also holds standing, and
# one nod, which is a quarter of a bend. The second take holds no whole bend: two stop half-way.

new = cosines.transform(make_bending(3, random_state=1).data)
rng = np.random.default_rng(0)


def standing(n_frames):
    still = np.repeat(new[0][:1], n_frames, axis=0)
    return still + 0.01 * rng.standard_normal(still.shape)


def nod(bend):
    return bend[:1] + 0.25 * (bend - bend[:1])


def half(bend):
    return bend[: len(bend) // 2]


parts = [standing(90), new[0], standing(60), nod(new[1]), standing(50), new[1], new[2]]
edges = np.cumsum([0, *map(len, parts), 70])
first = np.concatenate([*parts, standing(70)])
true = [(0, int(edges[i]), int(edges[i + 1])) for i in (1, 5, 6)]
second = [standing(80), half(new[0]), standing(90), nod(new[2]), standing(70), half(new[1])]
second = np.concatenate([*second, standing(100)])

# %%
# What is found
# -------------
# The score is 1 for a trial that equals the two most similar bends of the training set. It is 0.37
# for one that differs from them as much as standing still.

trials, locations = find_trials(pipe, [first, second])
print(locations.round(2).to_string())
print("true:", [part[1:] for part in true])

# %%
# The trials that were found can be aligned, or written to a table, as any others.

print("frames of each:", [len(x) for x in trials])
print("aligned:", pipe[:-1].transform(trials).shape)

# %%
# What is refused
# ---------------
# Grey segments are below the threshold: these bends stop half-way. The nods are too unlike a bend
# to be drawn at all.

display = SearchDisplay.from_estimator(pipe, [first, second], segments=true)
_ = display.figure_.suptitle("All three bends are found, and both half bends are refused")
plt.show()
