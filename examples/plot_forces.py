"""
Ground forces of walking people
===============================

You get sixty real steps, aligned so that their peaks and valleys meet. One person walked at three
speeds. Fast steps have their first peak earlier, and their valley and second peak later. After time
normalisation the valley of one step therefore lies beside that of another. The mean curve is then
flatter than any step. Pataky et al. (2008) measured ten people; the data come with
`spm1d <https://spm1d.org>`_.
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
# How far apart the peaks are
# ---------------------------
# Each step has a first peak, a valley and a second peak. Their spread is the standard deviation of
# their times over the steps, in per cent of stance. It is measured before and after the alignment.

synchronizer = DenseSynchronizer(n_frames=101).fit(steps)
percent = np.arange(101)


def events(curve):
    """Frames of the first peak, the valley and the second peak."""
    first, second = 5 + np.argmax(curve[5:45]), 55 + np.argmax(curve[55:96])
    return [first, first + np.argmin(curve[first : second + 1]), second]


frames = np.array([events(curve) for curve in steps])


def spread(synchronizer):
    """The spread of each event where the warps put it on the pattern."""
    times = synchronizer.match(steps).times
    placed = [np.interp(at, tau, percent) for at, tau in zip(frames, times, strict=True)]
    return np.std(placed, axis=0)


names = ["first peak", "valley", "second peak"]
columns = {"time normalised": frames.std(axis=0), "aligned": spread(synchronizer)}
table = pd.DataFrame(columns, index=names)
table.round(2)

# %%
# Before and after
# ----------------
# The lower panel shows the warps. Those of slow steps leave the diagonal about the valley, which
# comes early in them. Those of fast steps leave it to the other side.

display = SynchronizationDisplay.from_estimator(synchronizer, steps, y=speeds, unit="percent")
display.axes_[0].set_ylabel("vertical force\n(body weights)")
valley = table.loc["valley"]
_ = display.figure_.suptitle(
    f"Aligned, the valleys meet:\nspread {valley['time normalised']:.1f} before, "
    f"{valley['aligned']:.1f} % of stance after"
)

# %%
# Where it fails
# --------------
# The paper's own method compares heights. Those differ between speeds, so no equal heights can be
# found. The valleys stay nearly as far apart as before, and the first peak gets worse.

table["by height"] = spread(DenseSynchronizer.paper(n_frames=101).fit(steps))
table.round(2)

# %%
# :doc:`/accuracy` has all ten people, and two other ways to register curves.

plt.show()
