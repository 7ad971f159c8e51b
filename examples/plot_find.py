"""
Where in a recording it happens
===============================

Recordings are long, and the action happens somewhere in them. A pipeline that was fitted on
performances, cut out by hand, finds it in takes of people it has never seen, and
cuts it out.
"""

import matplotlib.pyplot as plt
import numpy as np
from sklearn.pipeline import make_pipeline
from sklearn_motionsync import (
    ActionModel,
    ASpace,
    DenseSynchronizer,
    DirectionCosines,
    find_performances,
)
from sklearn_motionsync.datasets import make_bending
from sklearn_motionsync.display import SearchDisplay

# %%
# What to look for
# ----------------
# Twelve bends of four people. The groups say who performed: how people differ is the
# threshold of the search.

bending = make_bending(12, random_state=0)
cosines = DirectionCosines(bending.skeleton)
pipe = make_pipeline(ASpace(0.95), DenseSynchronizer(50), ActionModel())
pipe.fit(cosines.fit_transform(bending.data), actionmodel__groups=bending.actor)

# %%
# Two takes of others
# -------------------
# Both stand, bend and nod (a quarter of a bend). In the first there are three bends, two of
# them one right after the other. In the second everybody stops half-way: it holds no bend.

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
# A score of 1 is equal to the two most similar bends of the training set, 0.37 as unlike as
# standing still.

performances, locations = find_performances(pipe, [first, second])
print(locations.round(2).to_string())
print("true:", [part[1:] for part in true])

# %%
# The performances go on like any others: to the synchronizer, or into a data frame.

print("frames of each:", [len(x) for x in performances])
print("on the common clock:", pipe[:-1].transform(performances).shape)

# %%
# Along the takes
# ---------------
# Grey is what the threshold refuses: bends that stop half-way. Nods are too unlike to be seen.


SearchDisplay.from_estimator(pipe, [first, second], segments=true)
plt.show()
