"""Functions that take a synchronizer and its arguments find what ``match`` finds with them."""

import inspect
import json
import re

import numpy as np
import pandas as pd
import pytest
from sklearn.pipeline import make_pipeline
from sklearn_motionsync import ActionModel, DenseSynchronizer, PartSynchronizer, display
from sklearn_motionsync.comparison import compare_events, compare_groups, compare_to_norm
from sklearn_motionsync.datasets import make_gait
from sklearn_motionsync.report import write_report

from public import functions

GAIT = make_gait(8, timing=5, n_frames=60, random_state=0)
X, GROUP, PERSON = GAIT.data, GAIT.group, GAIT.person
K = GAIT.keyframes[:, 3:4]


@pytest.fixture(scope="module")
def sync():
    return DenseSynchronizer(n_frames=51).fit(X, keyframes=K)


@pytest.fixture(scope="module")
def model(sync):
    return make_pipeline(sync, ActionModel()).fit(X, densesynchronizer__keyframes=K)


def report_of(estimator, trials, **params):
    """The offsets of a report, as they are offered."""
    path = write_report(params.pop("path"), estimator, trials, **params)
    data = re.search(r'id="data">(.*?)</script>', path.read_text(encoding="utf-8"), re.DOTALL)
    return json.loads(data[1])["files"]["timing.csv"]


# What depends on the match, of every function that takes a synchronizer, its arguments, and a frame
# rate of its own.
FUNCTIONS = {
    "compare_groups": lambda sync, _, path, **k: compare_groups(
        sync, X, GROUP, groups=PERSON, n_permutations=49, random_state=0, unit="frames", **k
    ).to_frame(),
    "compare_to_norm": lambda sync, _, path, **k: (
        compare_to_norm(sync, X, GROUP, norm="A", groups=PERSON, **k).verdicts
    ),
    "write_report": lambda sync, _, path, **k: report_of(sync, X, path=path, unit="frames", **k),
    "ActionModelDisplay.from_estimator": lambda _, model, path, **k: (
        display.ActionModelDisplay.from_estimator(model, X, **k).trials
    ),
    "GroupDisplay.from_estimator": lambda sync, _, path, **k: (
        display.GroupDisplay.from_estimator(sync, X, GROUP, **k).offsets
    ),
    "SynchronizationDisplay.from_estimator": lambda sync, _, path, **k: (
        display.SynchronizationDisplay.from_estimator(sync, X, **k).times
    ),
}
# It refuses key-frames: see below.
WITHOUT_KEYFRAMES = {"LagDisplay.from_estimator"}


def test_every_function_has_its_row():
    names = set()
    for name, function in functions():
        if inspect.isfunction(function) or inspect.ismethod(function):
            parameters = inspect.signature(function).parameters
            takes_any = any(p.kind is p.VAR_KEYWORD for p in parameters.values())
            if takes_any and "frame_rate" in parameters:
                names.add(name)
    assert names == set(FUNCTIONS) | WITHOUT_KEYFRAMES


@pytest.mark.parametrize("name", FUNCTIONS)
def test_seconds_are_frames(name, sync, model, tmp_path):
    path = tmp_path / "report.html"
    frames = FUNCTIONS[name](sync, model, path, keyframes=K)
    seconds = FUNCTIONS[name](sync, model, path, keyframes=K / 12, frame_rate=12.0)
    without = FUNCTIONS[name](sync, model, path)
    if isinstance(frames, pd.DataFrame):
        pd.testing.assert_frame_equal(seconds, frames)
        assert not without.equals(frames)
    elif isinstance(frames, str):
        assert seconds == frames != without
    else:
        np.testing.assert_allclose(seconds, frames, rtol=0, atol=1e-9)
        assert not np.allclose(without, frames)


def test_lags_take_no_keyframes():
    """They are of the whole body, on which lags do not depend."""
    sync = PartSynchronizer({"leg": [0, 1]}, synchronizer=DenseSynchronizer(51)).fit(X, keyframes=K)
    with pytest.raises(TypeError, match=r"LagDisplay\.from_estimator got 'keyframes'"):
        display.LagDisplay.from_estimator(sync, X, keyframes=K)


@pytest.mark.parametrize("method", ["fit", "match", "transform"])
def test_a_table_in_another_order_is_refused(method, sync):
    table = pd.DataFrame(K)
    np.testing.assert_array_equal(
        sync.transform(X, keyframes=table), sync.transform(X, keyframes=K)
    )
    with pytest.raises(ValueError, match=r"rows of keyframes are labelled .* in another order"):
        getattr(sync, method)(X, keyframes=table.sort_values(0, ascending=False))


@pytest.mark.parametrize("frame_rate", [True, -1, 0, np.nan, np.inf, "x", [100.0, -1.0]])
def test_a_wrong_frame_rate_is_refused_where_it_does_not_matter(frame_rate, sync):
    match = sync.match(X)
    for call in (
        lambda: sync.match(X, frame_rate=frame_rate),
        lambda: DenseSynchronizer(51).fit(X, frame_rate=frame_rate),
        lambda: match.offsets_in("percent", frame_rate=frame_rate),
        lambda: compare_groups(sync, X, GROUP, frame_rate=frame_rate),
        lambda: compare_events(X, GAIT.keyframes, unit="percent", frame_rate=frame_rate),
        lambda: display.SynchronizationDisplay.from_estimator(sync, X, frame_rate=frame_rate),
    ):
        with pytest.raises(
            ValueError, match=r"frame_rate (must be one number above 0|is not a numeric)"
        ):
            call()


def test_a_keyframe_that_only_late_trials_know():
    """Where it is in the pattern is learnt from those that know it, as many as of any other."""
    trials, keyframes = X * 2, np.full((2 * len(X), 2), np.nan)
    keyframes[1:, 0] = np.tile(GAIT.keyframes[:, 0], 2)[1:]
    keyframes[-6:, 1] = GAIT.keyframes[-6:, 3]
    sync = DenseSynchronizer(51, pattern=0).fit(trials, keyframes=keyframes)
    alone = DenseSynchronizer(51, pattern=0).fit(trials, keyframes=keyframes[:, 1:])
    assert len(trials) > 40
    np.testing.assert_allclose(sync.keyframes_[1], alone.keyframes_[0], atol=1.5)
