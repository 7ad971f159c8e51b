"""The picture of the README and the start page: ``python docs/picture.py``.

Above, five performances at one instant; below, one feature of all performances over time. From
left to right: as recorded, on one clock, and what was learnt.
"""

from pathlib import Path

import matplotlib.pyplot as plt
from sklearn.pipeline import make_pipeline
from sklearn_motionsync import (
    ActionModel,
    ActionModelDisplay,
    ASpace,
    DenseSynchronizer,
    DirectionCosines,
    SkeletonDisplay,
    SynchronizationDisplay,
)
from sklearn_motionsync.datasets import make_bending

AT = 0.4
TITLES = ["recordings, each at its own pace", "on one clock", "the action, and how people vary"]


def main():
    """Draw it."""
    bunch = make_bending(40, random_state=0)
    steps = DirectionCosines(bunch.skeleton), ASpace(0.95), DenseSynchronizer(100), ActionModel()
    pipe = make_pipeline(*steps).fit(bunch.data)

    figure = plt.figure(figsize=(11, 4.6), layout="constrained")
    grid = figure.add_gridspec(3, 3, height_ratios=[0.1, 0.7, 1])
    heads, people, below = (
        [figure.add_subplot(grid[row, column]) for column in range(3)] for row in range(3)
    )

    SkeletonDisplay.from_estimator(
        pipe, bunch.data, performances=[0, 2, 7, 9, 15], at=AT, ax=people[:2]
    )
    _, apart = plt.subplots(1, 8)
    samples = SkeletonDisplay.from_model(
        pipe, frames=(0.05, 0.3, 0.45, 0.65), random_state=0, ax=apart
    )
    moments = SkeletonDisplay(samples.scenes[1::2], samples.skeleton, [""] * 4).plot(people[2])
    for axis in moments.axes_:
        axis.set_ylim(people[0].get_ylim())
        axis.set_anchor("S")

    SynchronizationDisplay.from_estimator(
        pipe, bunch.data, features=["aspace1"], warps=False, ax=below[:2]
    )
    ActionModelDisplay.from_estimator(pipe, features=["aspace1"], ax=below[2])
    for axis, title in zip(heads, TITLES, strict=True):
        axis.set_axis_off()
        axis.text(0.5, 0.5, title, fontsize="large", ha="center", va="center")
    for axis in people:
        axis.set_title("")
        axis.set_anchor("S")
        axis.set_xticks([])
    for axis in below:
        axis.set_title("")
        axis.set_ylabel("")
        axis.set_yticks([])
    below[0].set_ylabel("second dimension\nof the aSpace")
    below[2].sharey(below[1])
    below[2].get_legend().set_title(None)
    below[2].get_legend().set_bbox_to_anchor(None)
    below[2].get_legend().set_loc("lower right")
    figure.savefig(Path(__file__).parent / "_static" / "bends.png", dpi=110)


if __name__ == "__main__":
    main()
