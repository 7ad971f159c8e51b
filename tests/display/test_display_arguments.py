"""Arguments of displays: those that are refused name the argument, its value, and what is valid."""

from functools import partial

import numpy as np
import pandas as pd
import pytest
from artists import segments
from sklearn.exceptions import NotFittedError
from sklearn.pipeline import make_pipeline
from sklearn.preprocessing import FunctionTransformer
from sklearn_motionsync import (
    ActionModel,
    ASpace,
    DenseSynchronizer,
    DirectionCosines,
    LinearSynchronizer,
    Match,
    PartSynchronizer,
    Skeleton,
    display,
)
from sklearn_motionsync.datasets import make_bending
from sklearn_motionsync.display import (
    SkeletonDisplay,
    SynchronizationDisplay,
    TrellisDisplay,
)
from sklearn_motionsync.live import MotionTracker, OnlineSynchronizer

PAPER = Skeleton.paper()
NAMES = PAPER.column_names
BUNCH = make_bending(4, n_frames=20, random_state=2)
POSITIONS = BUNCH.data
X = [x[:, :3] for x in POSITIONS]
TIMES = np.tile(np.linspace(0, 9, 10), (4, 1))
# The kind of estimator that each display draws. A search needs no fit, nor does a segmenter.
ESTIMATORS = {
    "ActionModelDisplay": ActionModel(),
    "CycleDisplay": None,
    "GroupDisplay": DenseSynchronizer(),
    "LagDisplay": PartSynchronizer(),
    "PhaseDisplay": OnlineSynchronizer(),
    "SearchDisplay": None,
    "SkeletonDisplay": make_pipeline(DirectionCosines(PAPER), DenseSynchronizer()),
    "SynchronizationDisplay": DenseSynchronizer(),
    "TrackingDisplay": MotionTracker(),
    "TrellisDisplay": DenseSynchronizer(),
}


def with_one(x, value, at=(3, 1)):
    x = np.array(x)
    x[at] = value
    return x


@pytest.fixture(scope="module")
def pipe():
    steps = DirectionCosines(BUNCH.skeleton), ASpace(3), DenseSynchronizer(20), ActionModel()
    return make_pipeline(*steps).fit(POSITIONS)


def refuses(call, message):
    with pytest.raises(ValueError, match=message):
        call()


def test_nan_is_drawn_as_a_gap():
    gaps = [with_one(X[0], np.nan, slice(0, 4)), *X[1:]]
    display = SynchronizationDisplay.from_estimator(LinearSynchronizer(10).fit(X), gaps)
    assert np.isnan(segments(display.before_[0])[0][:4, 1]).all()
    assert np.isnan(display.after[0, 0]).all()
    display.figure_.canvas.draw()


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"ax": []}, r"ax must be Axes of matplotlib, got \[\]"),
        ({"ax": "left"}, "ax must be Axes of matplotlib, got 'left'"),
        ({"features": []}, "at least one feature"),
        *(
            ({"features": bad}, "There is no feature .*there are 3: aspace0, aspace1, aspace2")
            for bad in (3, -1, 1.5, True, "aspace9", [0, "x1"])
        ),
    ],
)
def test_synchronization_refuses(pipe, arguments, message):
    refuses(lambda: SynchronizationDisplay.from_estimator(pipe, POSITIONS, **arguments), message)


@pytest.mark.parametrize("trial", [4, -1, 1.5, "1", None])
def test_trellis_refuses_unknown_trial(pipe, trial):
    message = "is out of range: there are 4 trials"
    refuses(lambda: TrellisDisplay.from_estimator(pipe, POSITIONS, trial=trial), message)


def test_every_display_is_drawn_of_an_estimator_but_those_of_a_comparison_and_of_gait():
    assert set(ESTIMATORS) == set(display.__all__) - {"GaitDisplay", "NormDisplay"}


@pytest.mark.parametrize("name", ESTIMATORS)
def test_from_estimator_refuses_other_and_unfitted_estimators(name):
    from_estimator = getattr(display, name).from_estimator
    if name != "SearchDisplay":
        refuses(lambda: from_estimator(3, [POSITIONS]), "got int|There is no .* in int")
    if ESTIMATORS[name] is not None:
        with pytest.raises(NotFittedError):
            from_estimator(ESTIMATORS[name], [POSITIONS])


# -- stick figures --------------------------------------------------------------------------


def draw_positions(x=POSITIONS[0], skeleton=PAPER, **arguments):
    return SkeletonDisplay.from_positions(x, skeleton, **arguments)


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"x": []}, "Found 0 trials"),
        ({"x": None}, "got NoneType"),
        ({"x": "walk.bvh"}, "A set of trials"),
        ({"x": POSITIONS[0][:, :6]}, r"15 joints are \(n_frames, 45\)"),
        ({"x": POSITIONS[0][:0]}, r"shape \(0, 45\)"),
        ({"x": [POSITIONS[0], np.ma.masked_greater(POSITIONS[1], 1)]}, "Trial 1 has masked values"),
        ({"x": with_one(POSITIONS[0], np.inf)}, "Trial 0, frame 3, feature 1 is infinity"),
        ({"x": POSITIONS[0] * np.nan}, "No frame shows the hips"),
        (
            {"x": pd.DataFrame(POSITIONS[0], columns=[NAMES[-1], *NAMES[1:-1], "chest"])},
            "column 0 is 'right_ankle_z'",
        ),
        ({"skeleton": "paper"}, "skeleton must be a Skeleton, .* or None .*; got str"),
        ({"skeleton": None, "x": POSITIONS[0][:, :7]}, r"joints are \(n_frames, 3 \* n_joints\)"),
        ({"skeleton": None, "x": POSITIONS[0] * np.nan}, "No frame shows the joints"),
        ({"skeleton": Skeleton.paper(n_dims=2)}, r"15 joints are \(n_frames, 30\)"),
        *(({"frames": bad}, "frames must be how many, a whole number from 1 to 1000")
          for bad in (0, 2.5, True, np.nan, 10**9)),
        *(({"frames": bad}, r"frames must be from 0 to \d+, got")
          for bad in ([-1], [99], [0.5], [], "03", [True], None, ["1"], [[1]], {3})),
    ],
)  # fmt: skip
def test_from_positions_refuses(arguments, message):
    refuses(lambda: draw_positions(**arguments), message)


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"names": ["a"]}, "names .* each of the 4 trials, got 1"),
        ({"match": Match(TIMES[:2])}, "2 matched trials, but 4"),
        ({"skeleton": 15}, "skeleton must be a Skeleton"),
        ({"X": [x[:, :9] for x in POSITIONS]}, "15 joints are"),
    ],
)
def test_from_trials_refuses(arguments, message):
    arguments = {"X": POSITIONS, "match": Match(TIMES), "skeleton": PAPER} | arguments
    refuses(lambda: SkeletonDisplay.from_trials(**arguments), message)


@pytest.mark.parametrize("at", [-0.1, 1.5, np.nan])
def test_plot_refuses_moments_beyond_the_trials(at):
    refuses(lambda: draw_positions().plot(at=at), "at must be a share of the time from 0 to 1, got")


@pytest.mark.parametrize("trials", [[99], [0.5], "01"])
def test_from_estimator_refuses_unknown_trials(pipe, trials):
    refuses(
        lambda: SkeletonDisplay.from_estimator(pipe, POSITIONS, trials=trials),
        "trials must be from 0 to 3, got",
    )


def test_from_model_takes_frames_and_shares(pipe):
    for frames in ([20], [1.5], None):
        draw = partial(SkeletonDisplay.from_model, pipe, frames=frames)
        refuses(draw, "frames, .* from 0 to 19")
    for frames in (0.5, [0.5], np.float32([0.5]), 10, [10.0]):
        titles = SkeletonDisplay.from_model(pipe, frames=frames).titles
        assert titles[0] == "frame 10\nmean pose"


def test_from_model_needs_inverse_transform():
    some = FunctionTransformer(lambda X: [x[:, :5] for x in X])
    steps = DirectionCosines(PAPER), some, LinearSynchronizer(9), ActionModel()
    pipe = make_pipeline(*steps).fit(POSITIONS)
    pipe.steps[1] = ("some", type("OneWay", (), {"transform": None})())
    message = r"steps with inverse_transform .* they are \['DirectionCosines', 'OneWay'\]"
    refuses(lambda: SkeletonDisplay.from_model(pipe), message)


def test_animate_refuses_impossible_durations():
    display = draw_positions()
    for arguments in ({"seconds": 0}, {"seconds": np.nan}, {"fps": -1}):
        refuses(partial(display.animate, **arguments), "seconds and fps must be above 0")
