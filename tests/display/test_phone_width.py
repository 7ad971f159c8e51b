"""Every figure fits on a phone: it is narrow, and none of its text is cut or hidden."""

import numpy as np
import pytest
from matplotlib.text import Text
from sklearn.pipeline import make_pipeline
from sklearn_motionsync import (
    ActionModel,
    ASpace,
    DenseSynchronizer,
    DirectionCosines,
    PartSynchronizer,
    display,
)
from sklearn_motionsync.comparison import compare_to_norm
from sklearn_motionsync.datasets import make_bending, make_gait, make_walk
from sklearn_motionsync.live import MotionTracker, OnlineSynchronizer
from sklearn_motionsync.takes import CycleSegmenter

# At 388 pixels, the width of a page on a phone, letters of 10 points are still 8 pixels high.
LARGEST_WIDTH = 6.5
BUNCH = make_bending(8, n_frames=50, random_state=0)
WALK = make_walk(1, random_state=0)
STEPS = DirectionCosines(BUNCH.skeleton), ASpace(4), DenseSynchronizer(30), ActionModel()


@pytest.fixture(scope="module")
def pipe():
    return make_pipeline(*STEPS).fit(BUNCH.data)


@pytest.fixture(scope="module")
def poses(pipe):
    return pipe[0].transform(BUNCH.data)


def departures(pipe, poses):
    return display.SkeletonDisplay.from_departures(pipe, [BUNCH.data[0][::-1]])


def lags(pipe, poses):
    parts = PartSynchronizer(synchronizer=DenseSynchronizer(30)).fit(poses)
    return display.LagDisplay.from_estimator(parts, poses, groups=BUNCH.actor)


def norm(pipe, poses):
    groups = ["norm"] * 6 + ["new"] * 2
    found = compare_to_norm(pipe, BUNCH.data, groups, norm="norm")
    return display.NormDisplay.from_comparison(found, 6)


def search(pipe, poses):
    takes = [np.concatenate([poses[0]] * 3), poses[1]]
    model = make_pipeline(*pipe[1:]).fit(poses)
    segments = [(0, 0, len(poses[0]))]
    return display.SearchDisplay.from_estimator(model, takes, segments=segments)


def cycles(pipe, poses):
    gait = make_gait(3, n_cycles=4, takes=True, random_state=0)
    segmenter = CycleSegmenter(start=0).fit(gait.data)
    return display.CycleDisplay.from_estimator(
        segmenter, gait.data, unit="seconds", frame_rate=gait.frame_rate
    )


def phases(pipe, poses):
    live = OnlineSynchronizer(frame_rate=50).fit(poses)
    features = ["torso_y", "left_forearm_z"]
    return display.PhaseDisplay.from_estimator(
        live, poses[:2], body=pipe[0], features=features, frame=30
    )


def tracking(pipe, poses):
    seen = poses[0].copy()
    seen[10:25, 6:20] = np.nan
    names = list(pipe[0].get_feature_names_out())
    tracker = MotionTracker(noise=0.05, random_state=0).fit(poses)
    return display.TrackingDisplay.from_estimator(tracker, seen, truth=poses[0], names=names)


def of_pipeline(name, method="from_estimator", X=BUNCH.data, **given):
    """What draws a display of the pipeline, and of trials if there are any."""
    trials = () if X is None else (X,)

    def draw(pipe, poses):
        return getattr(getattr(display, name), method)(pipe, *trials, **given)

    return draw


AGES = ["young"] * 4 + ["old"] * 4
DRAWN = {
    "synchronization": of_pipeline("SynchronizationDisplay", y=BUNCH.actor),
    "synchronization in seconds": of_pipeline(
        "SynchronizationDisplay", features=[0], unit="seconds", frame_rate=50
    ),
    "model": of_pipeline("ActionModelDisplay", band="trials"),
    "poses": lambda *_: display.SkeletonDisplay.from_positions(BUNCH.data[0], BUNCH.skeleton),
    "poses of a model": of_pipeline("SkeletonDisplay", "from_model", None, random_state=0),
    "departures": departures,
    "bodies": of_pipeline("SkeletonDisplay"),
    "groups": of_pipeline("GroupDisplay", y=AGES, units="m", features=range(4)),
    "lags": lags,
    "gait": lambda *_: display.GaitDisplay.from_positions(WALK.data, WALK.skeleton, frame_rate=100),
    "trellis": of_pipeline("TrellisDisplay", trial=1),
    "norm": norm,
    "search": search,
    "cycles": cycles,
    "phases": phases,
    "tracking": tracking,
}


@pytest.mark.parametrize("kind", DRAWN)
def test_new_figures_are_narrow_and_show_all_their_text(pipe, poses, kind):
    figure = DRAWN[kind](pipe, poses).figure_
    figure.draw_without_rendering()
    assert figure.get_size_inches()[0] <= LARGEST_WIDTH
    axes = [axis for panel in figure.axes for axis in (panel.xaxis, panel.yaxis)]
    # Matplotlib keeps tick labels beyond the limits of an axis, and does not draw them.
    ticks = {label for axis in axes for label in axis.get_ticklabels()}
    inner = figure.bbox.padded(1)
    for text in set(figure.findobj(Text)) - ticks:
        if text.get_visible() and text.get_text().strip():
            box = text.get_window_extent()
            assert inner.x0 <= box.x0, text
            assert box.x1 <= inner.x1, text
            assert inner.y0 <= box.y0, text
            assert box.y1 <= inner.y1, text
