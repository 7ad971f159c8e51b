"""Public functions that take a frame rate refuse what is none, also where it does not matter."""

import inspect
import re
from contextlib import suppress

import numpy as np
import pandas as pd
from sklearn.pipeline import make_pipeline
from sklearn_motionsync import (
    ActionModel,
    DenseSynchronizer,
    LinearSynchronizer,
    PartSynchronizer,
    TimingChannel,
    comparison,
    datasets,
    display,
    gait,
    io,
    live,
    report,
    takes,
    to_trials,
)

from public import functions

GAIT = datasets.make_gait(4, n_frames=40, random_state=0)
X, N = GAIT.data, len(GAIT.data)
WALK = datasets.make_walk(2, n_strides=2, random_state=0)
TIMED = pd.DataFrame({"t": np.arange(9) / 9, "knee": range(9)})
EVENTS = pd.DataFrame({"trial": range(N), "event": "toe-off", "frame": 20.0})
DENSE, LINEAR = (sync.fit(X) for sync in (DenseSynchronizer(21), LinearSynchronizer(21)))
PARTS = PartSynchronizer({"leg": [0, 1]}, synchronizer=DENSE).fit(X)
MATCH = DENSE.match(X)
CYCLES = takes.CycleSegmenter(not_cyclic="drop")
CHANNEL = TimingChannel(LINEAR)
MODEL = make_pipeline(DENSE, ActionModel()).fit(X)
METHODS = ("fit", "fit_transform", "match", "transform")


def with_files(tmp_path):
    """For each function a call that takes ``frame_rate``, or what it calls it."""
    path = tmp_path / "a.trc"
    io.write_motion(path, WALK.data[0], WALK.skeleton, frame_rate=100)
    calls = {
        "compare_events": lambda **k: comparison.compare_events(X, EVENTS, **k),
        "compare_groups": lambda **k: comparison.compare_groups(DENSE, X, GAIT.group, **k),
        "compare_to_norm": lambda **k: comparison.compare_to_norm(
            DENSE, X, GAIT.group, norm="A", groups=GAIT.person, **k
        ),
        "make_bending": lambda **k: datasets.make_bending(2, **k),
        "make_gait": lambda **k: datasets.make_gait(2, **k),
        "make_walk": lambda **k: datasets.make_walk(1, **k),
        "ActionModelDisplay.from_estimator": lambda **k: display.ActionModelDisplay.from_estimator(
            MODEL, X, **k
        ),
        "CycleDisplay.from_estimator": lambda **k: display.CycleDisplay.from_estimator(
            CYCLES, X[:1], **k
        ),
        "GaitDisplay.from_positions": lambda **k: display.GaitDisplay.from_positions(
            WALK.data[0], WALK.skeleton, **k
        ),
        "GroupDisplay.from_estimator": lambda **k: display.GroupDisplay.from_estimator(
            DENSE, X, **k
        ),
        "LagDisplay.from_estimator": lambda **k: display.LagDisplay.from_estimator(PARTS, X, **k),
        "SynchronizationDisplay.from_estimator": lambda **k: (
            display.SynchronizationDisplay.from_estimator(DENSE, X, **k)
        ),
        "gait_events": lambda **k: gait.gait_events(WALK.data, WALK.skeleton, **k),
        "gait_parameters": lambda **k: gait.gait_parameters(WALK.data, WALK.skeleton, **k),
        "keyframes_from_events": lambda **k: io.keyframes_from_events(X, EVENTS, **k),
        "read_motion": lambda **k: io.read_motion(path, **k),
        "from_poses": lambda **k: io.from_poses(None, **k),
        "write_motion": lambda **k: io.write_motion(path, WALK.data[0], WALK.skeleton, **k),
        "MotionTracker": lambda **k: live.MotionTracker(**k).fit(X),
        "OnlineSynchronizer": lambda **k: live.OnlineSynchronizer(**k).fit(X),
        "write_player": lambda **k: report.write_player(
            tmp_path / "a.html", WALK.data, WALK.skeleton, **k
        ),
        "write_report": lambda **k: report.write_report(tmp_path / "a.html", DENSE, X, **k),
        "DenseSynchronizer.calibrate": lambda **k: DENSE.calibrate(X, GAIT.keyframes, **k),
        "DenseSynchronizer.disparity_space": lambda **k: DENSE.disparity_space(X, **k),
        "Match.facts_of": lambda **k: MATCH.facts_of(X, **k),
        "Match.interval": lambda **k: MATCH.interval(**k),
        "Match.offsets_in": lambda **k: MATCH.offsets_in("percent", **k),
        "Match.seconds": lambda **k: MATCH.seconds(X, **k),
        "Match.to_frame": lambda **k: MATCH.to_frame(**k),
        "PartSynchronizer.lags": lambda **k: PARTS.lags(X, unit="frames", **k),
        "PartSynchronizer.match_parts": lambda **k: PARTS.match_parts(X, **k),
        "TimingChannel": lambda **k: CHANNEL.set_params(**k).fit(X),
        "CycleSegmenter": lambda **k: takes.CycleSegmenter(**k).fit(X),
        "find_trials": lambda frame_rate: takes.find_trials(
            DENSE, X, frame_rate=50, pattern_rate=frame_rate
        ),
        "to_trials": lambda **k: to_trials(TIMED, time="t", **k),
    }
    for sync in (DENSE, LINEAR, PARTS):
        name = type(sync).__name__
        calls |= {f"{name}.{method}": getattr(sync, method) for method in METHODS}
    return calls


def test_what_is_no_frame_rate_is_refused(tmp_path):
    """No infinity, truth value or text, nor rates of fewer trials, by any function."""
    calls = with_files(tmp_path)
    for name, function in functions():
        with suppress(ValueError):  # of what Python's warnings have
            parameters = inspect.signature(function).parameters
            takes_one = {"frame_rate", "pattern_rate"} & set(parameters)
            assert name in calls or not takes_one, f"{name} has no call"
            # Some hand it on to the match.
            handed_on = any(each.kind is each.VAR_KEYWORD for each in parameters.values())
            assert takes_one or handed_on or name not in calls, f"{name} takes none"
    wrong = [True, -1, 0, np.nan, np.inf, -np.inf, 1e300, 5e-324, 10**400, "50", 1j, [], {}]
    wrong += [[50.0] * (N + 1), [50.0, -1.0], np.full((N, 1), 50.0), np.ones(N, dtype=bool)]
    for name, call in calls.items():
        given = (X,) if name.rpartition(".")[2] in METHODS else ()
        for frame_rate in wrong:
            message = "it was taken"
            try:
                call(*given, frame_rate=frame_rate)
            except ValueError as error:
                message = str(error)
            assert re.search("frame_rate|pattern_rate", message), (name, frame_rate, message)
            assert len(message) < 700
