"""
Ground forces of walking people
===============================

Sixty steps of one person at three speeds. Fast steps push harder, their first peak comes earlier,
and their valley and second peak later, so that after time normalisation the valley of one lies
beside that of another, and the mean curve is flatter than any step. The forces are real: ten people
measured by Pataky et al. (2008), which come with `spm1d <https://spm1d.org>`_.
"""

from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np
import pandas as pd
import spm1d
from sklearn_motionsync import DenseSynchronizer
from sklearn_motionsync.display import SynchronizationDisplay

folder = Path(spm1d.__file__).parent / "data" / "datafiles"
person = 3
steps = np.load(folder / f"ex_grf_subj{person:03d}.npy")
speed = np.load(folder / "ex_grf_speeds_cond.npy")[:, person].astype(int)
speeds = np.array(["", "slow", "normal", "fast"])[speed]
print(steps.shape, pd.Series(speeds).value_counts().to_dict())

# %%
# Before and after
# ----------------
# Rows of equal length are univariate performances: nothing has to be said but the number of frames.

synchronizer = DenseSynchronizer(n_frames=101).fit(steps)
display = SynchronizationDisplay.from_estimator(synchronizer, steps, groups=speeds, unit="percent")
_ = display.axes_[0].set_ylabel("vertical force")

# %%
# The warps are a result: those of slow steps leave the diagonal about the valley, which comes early
# in them, and those of fast steps the other way.
#
# How far apart the peaks are
# ---------------------------
# First peak, valley and second peak of each step, where its own warp puts them on the clock.


def events(curve):
    """Frames of the first peak, the valley and the second peak."""
    first, second = 5 + np.argmax(curve[5:45]), 55 + np.argmax(curve[55:96])
    return [first, first + np.argmin(curve[first : second + 1]), second]


frames = np.array([events(curve) for curve in steps])
times = synchronizer.match(steps).times
clock = np.arange(times.shape[1])
placed = np.array([np.interp(at, tau, clock) for at, tau in zip(frames, times, strict=True)])
names = ["first peak", "valley", "second peak"]
table = pd.DataFrame({"linear": frames.std(axis=0), "one clock": placed.std(axis=0)}, index=names)
table.round(2)

# %%
# When that fails
# ---------------
# The paper's own cost compares heights. Those differ between speeds, so it looks for equal heights
# where there are none: the valley stays nearly as far apart as it was, and the first peak is worse.

paper = DenseSynchronizer.paper(n_frames=101).fit(steps)
times = paper.match(steps).times
placed = np.array([np.interp(at, tau, clock) for at, tau in zip(frames, times, strict=True)])
table["one clock, by height"] = placed.std(axis=0)
table.round(2)

# %%
# :doc:`/accuracy` has all ten people, and two other ways to register curves.

plt.show()
