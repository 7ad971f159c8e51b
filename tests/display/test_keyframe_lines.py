"""Key-frames in figures: where they are drawn, and by what name."""

import numpy as np
import pandas as pd
import pytest
from sklearn.pipeline import make_pipeline
from sklearn_motionsync import ActionModel, DenseSynchronizer
from sklearn_motionsync.datasets import make_gait
from sklearn_motionsync.display import ActionModelDisplay, SynchronizationDisplay

GAIT = make_gait(3, 2, random_state=0)
X = [x / x.std(axis=0) for x in GAIT.data]
LENGTHS = np.array([len(x) for x in X])
NAMES = ["force peak", ("Foot Off", "Right")]
K = pd.DataFrame(GAIT.keyframes[:, [0, 3]], columns=pd.Index(NAMES, tupleize_cols=False))
K.iloc[1] = np.nan


@pytest.fixture(scope="module")
def sync():
    return DenseSynchronizer(61).fit(X, keyframes=K)


def places(lines):
    return [line.get_xdata()[0] for line in lines]


def texts(axis):
    return [text.get_text() for text in axis.texts if "pattern" not in text.get_text()]


@pytest.mark.parametrize(
    ("unit", "scale"), [("frames", 1), ("percent", 100 / 60), ("seconds", None)]
)
def test_lines_on_the_clock_and_ticks_of_trials(sync, unit, scale):
    params = {"keyframes": K}
    if unit == "seconds":
        params = {"keyframes": K / 100, "frame_rate": 100}
    display = SynchronizationDisplay.from_estimator(sync, X, features=[0, 1], unit=unit, **params)
    scale = np.median(LENGTHS - 1) / 100 / 60 if scale is None else scale
    # Two panels of features and that of the warps.
    assert len(display.keyframes_) == 3
    for lines in display.keyframes_:
        np.testing.assert_allclose(places(lines), sync.keyframes_ * scale)
    assert [line.axes for lines in display.keyframes_ for line in lines[:1]] == [
        display.axes_[i] for i in (1, 3, 4)
    ]
    assert texts(display.axes_[4]) == ["force peak", "Foot Off, Right"]
    assert texts(display.axes_[1]) == []
    of_unit = {"frames": 1, "percent": 100 / (LENGTHS - 1), "seconds": 1 / 100}[unit]
    own = (K.to_numpy().T * of_unit).T
    ticks = [segment[0, 0] for segment in display.own_keyframes_[0].get_segments()]
    np.testing.assert_allclose(ticks, own[np.isfinite(own)])


def test_ticks_have_the_colours_of_groups(sync):
    given = {"features": 0, "y": GAIT.group, "warps": False}
    display = SynchronizationDisplay.from_estimator(sync, X, keyframes=K, **given)
    curves = display.before_[0].get_colors()[:, :3]
    (ticks,) = display.own_keyframes_
    np.testing.assert_array_equal(ticks.get_colors()[:, :3], curves[[0, 0, 2, 2, 3, 3, 4, 4, 5, 5]])
    assert texts(display.axes_[1]) == ["force peak", "Foot Off, Right"]


def test_key_frames_that_trials_lack_are_lines_without_names(sync):
    display = SynchronizationDisplay.from_estimator(sync, X, features=0)
    np.testing.assert_allclose(places(display.keyframes_[0]), sync.keyframes_)
    assert display.own_keyframes_ == []
    assert texts(display.axes_[-1]) == []
    plain = DenseSynchronizer(61).fit(X)
    assert SynchronizationDisplay.from_estimator(plain, X, features=0).keyframes_ == []


def test_the_model_of_a_pipeline_shows_them(sync):
    pipe = make_pipeline(DenseSynchronizer(61), ActionModel())
    pipe.fit(X, densesynchronizer__keyframes=K)
    for keyframes, names in (({"keyframes": K}, True), ({}, False)):
        display = ActionModelDisplay.from_estimator(
            pipe, X, features=[0, 1], unit="percent", **keyframes
        )
        for lines in display.keyframes_:
            np.testing.assert_allclose(places(lines), pipe[0].keyframes_ * 100 / 60)
        assert texts(display.axes_[0]) == ["force peak", "Foot Off, Right"] * names
        assert texts(display.axes_[1]) == []
    aligned = pipe[0].transform(X, keyframes=K)
    assert ActionModelDisplay.from_estimator(pipe[1], aligned).keyframes_ == []
