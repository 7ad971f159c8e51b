"""Public functions that take a frame rate refuse what is none, also where it does not matter."""

import inspect
import re
from contextlib import suppress
from functools import partial

import numpy as np
import pandas as pd
from sklearn.pipeline import make_pipeline
from sklearn_motionsync import (
    ActionModel,
    DenseSynchronizer,
    LinearSynchronizer,
    PartSynchronizer,
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
MODEL = make_pipeline(DENSE, ActionModel()).fit(X)
METHODS = ("fit", "fit_transform", "match", "transform")


def with_files(tmp_path):
    """For each function a call that takes ``frame_rate``, or what it calls it."""
    path, page = tmp_path / "a.trc", tmp_path / "a.html"
    io.write_motion(path, WALK.data[0], WALK.skeleton, frame_rate=100)
    norm = {"norm": "A", "groups": GAIT.person}
    calls = {
        "compare_effects": partial(
            comparison.compare_effects, DENSE, X, {"group": GAIT.group}, "group"
        ),
        "compare_events": partial(comparison.compare_events, X, EVENTS),
        "compare_groups": partial(comparison.compare_groups, DENSE, X, GAIT.group),
        "compare_to_norm": partial(comparison.compare_to_norm, DENSE, X, GAIT.group, **norm),
        "plan_study": partial(comparison.plan_study, DENSE, X, GAIT.group, n_studies=10),
        "make_bending": partial(datasets.make_bending, 2),
        "make_gait": partial(datasets.make_gait, 2),
        "make_walk": partial(datasets.make_walk, 1),
        "GaitDisplay.from_positions": partial(
            display.GaitDisplay.from_positions, WALK.data[0], WALK.skeleton
        ),
        "gait_events": partial(gait.gait_events, WALK.data, WALK.skeleton),
        "gait_parameters": partial(gait.gait_parameters, WALK.data, WALK.skeleton),
        "keyframes_from_events": partial(io.keyframes_from_events, X, EVENTS),
        "read_motion": partial(io.read_motion, path),
        "from_poses": partial(io.from_poses, None),
        "write_motion": partial(io.write_motion, path, WALK.data[0], WALK.skeleton),
        "MotionTracker": lambda **k: live.MotionTracker(**k).fit(X),
        "OnlineSynchronizer": lambda **k: live.OnlineSynchronizer(**k).fit(X),
        "write_player": partial(report.write_player, page, WALK.data, WALK.skeleton),
        "write_report": partial(report.write_report, page, DENSE, X),
        "DenseSynchronizer.calibrate": partial(DENSE.calibrate, X, GAIT.keyframes),
        "DenseSynchronizer.disparity_space": partial(DENSE.disparity_space, X),
        "Match.facts_of": partial(MATCH.facts_of, X),
        "Match.interval": MATCH.interval,
        "Match.offsets_in": partial(MATCH.offsets_in, "percent"),
        "Match.seconds": partial(MATCH.seconds, X),
        "Match.to_frame": MATCH.to_frame,
        "PartSynchronizer.lags": partial(PARTS.lags, X, unit="frames"),
        "PartSynchronizer.match_parts": partial(PARTS.match_parts, X),
        "CycleSegmenter": lambda **k: takes.CycleSegmenter(**k).fit(X),
        "find_trials": lambda frame_rate: takes.find_trials(
            DENSE, X, frame_rate=50, pattern_rate=frame_rate
        ),
        "to_trials": partial(to_trials, TIMED, time="t"),
    }
    for kind, estimator, trials in (
        (display.ActionModelDisplay, MODEL, X),
        (display.CycleDisplay, CYCLES, X[:1]),
        (display.GroupDisplay, DENSE, X),
        (display.LagDisplay, PARTS, X),
        (display.SynchronizationDisplay, DENSE, X),
    ):
        calls[f"{kind.__name__}.from_estimator"] = partial(kind.from_estimator, estimator, trials)
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
