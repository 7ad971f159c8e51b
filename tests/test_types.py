"""Types of public signatures: complete, equal to what is checked, and found wrong by mypy."""

import inspect
import os
import re
import subprocess
import sys
import types
import typing
from collections.abc import Hashable
from importlib.resources import files
from pathlib import Path

import pytest
import sklearn_motionsync
from sklearn.utils._param_validation import StrOptions
from sklearn_motionsync.body.formats import FORMATS

from estimators import EVERY
from test_docstrings import CALLABLES, described, for_each

ROOT = Path(__file__).resolve().parents[1]


def annotations(each):
    """The annotations of a function, a method, or the constructor of a class."""
    if inspect.isclass(each) and issubclass(each, tuple):
        return typing.get_type_hints(each)
    each = each.__init__ if inspect.isclass(each) else each
    return typing.get_type_hints(inspect.unwrap(getattr(each, "__func__", each)))


def alternatives(annotation):
    """The types of a union, and the values of its literals."""
    if typing.get_origin(annotation) in (typing.Union, types.UnionType):
        return [part for each in typing.get_args(annotation) for part in alternatives(each)]
    if typing.get_origin(annotation) is typing.Literal:
        return list(typing.get_args(annotation))
    return [annotation]


def strings(annotation):
    return {each for each in alternatives(annotation) if isinstance(each, str)}


def admits_none(annotation):
    return bool({type(None), typing.Any, object, Hashable} & {*alternatives(annotation)})


# -- signatures -----------------------------------------------------------------------------


ESTIMATORS = {type(estimator).__name__: type(estimator) for estimator in EVERY}


@for_each(CALLABLES)
def test_every_public_signature_is_annotated(name, each):
    hints = annotations(each)
    known = inspect.signature(each).parameters.values()
    assert {p.name for p in known} - {"self", "cls"} <= set(hints)
    if not inspect.isclass(each):
        assert "return" in hints
    for parameter in known:
        if parameter.default is None:
            assert admits_none(hints[parameter.name]), parameter.name


@for_each(CALLABLES)
def test_help_shows_the_names_of_types_and_not_what_they_stand_for(name, each):
    members = vars(each).values() if inspect.isclass(each) else ()
    for shown in [each, *filter(inspect.isfunction, members)]:
        assert "inputs.types" not in str(inspect.signature(shown))


@for_each(ESTIMATORS)
def test_help_speaks_of_trials(name, each):
    for method in dir(each):
        if not method.startswith(("_", "set_", "get_")):
            doc = inspect.getdoc(getattr(each, method)) or ""
            assert "(n_samples, n_features)" not in doc, method


@for_each(CALLABLES)
def test_docstrings_name_the_strings_that_are_annotated(name, each):
    hints = annotations(each)
    for key, kind in described(inspect.getdoc(each)).items():
        kind = re.sub(r",? *default=.*", "", kind)
        if key in hints and str not in alternatives(hints[key]) and not kind.startswith("str "):
            named = set(re.findall(r'"([\w-]+)"', kind))
            assert named == strings(hints[key]), key


@for_each(ESTIMATORS)
def test_annotations_are_the_constraints_of_estimators(name, each):
    hints, constraints = annotations(each), each._parameter_constraints
    assert set(hints) - {"return"} == set(constraints)
    for key, allowed in constraints.items():
        options = [each.options for each in allowed if isinstance(each, StrOptions)]
        assert strings(hints[key]) == set().union(*options), key
        takes_none = None in allowed or "random_state" in allowed
        assert admits_none(hints[key]) == takes_none, key


def test_skeletons_of_formats_are_declared():
    hints = typing.get_type_hints(sklearn_motionsync.Skeleton)
    declared = {name for name, each in hints.items() if typing.get_origin(each) is typing.ClassVar}
    assert declared == set(FORMATS)


def test_the_package_is_marked_as_typed():
    assert files(sklearn_motionsync).joinpath("py.typed").is_file()


# -- mypy -------------------------------------------------------------------------------------

PREAMBLE = """\
from functools import partial
import numpy as np
import pandas as pd
from sklearn.pipeline import make_pipeline
from sklearn_motionsync import *
from sklearn_motionsync.body import *
from sklearn_motionsync.comparison import *
from sklearn_motionsync.display import *
from sklearn_motionsync.datasets import make_bending, make_gait
from sklearn_motionsync.gait import *
from sklearn_motionsync.io import keyframes_from_events, read_motion
from sklearn_motionsync.live import *
from sklearn_motionsync.metrics import FeatureHoldoutScorer, group_timing_error, least_squares
from sklearn_motionsync.model import *
from sklearn_motionsync.recognition import *
from sklearn_motionsync.synchronizers import *
from sklearn_motionsync.takes import *
X = list(np.random.RandomState(0).standard_normal((3, 20, 2)).cumsum(axis=1))
tables = [pd.DataFrame(x) for x in X]
sync = LinearSynchronizer().fit(X)
"""

# Each of these is right: it runs, and mypy has nothing to say about it.
RIGHT = """\
DenseSynchronizer(n_frames=30, cost="pose", metric=None, refine=False, max_offset=0.2)
DenseSynchronizer(pattern=X[0], random_state=np.random.RandomState(0), max_fit=None)
DenseSynchronizer.paper(n_frames=30).fit(X).pattern_.mean(axis=0)
LinearSynchronizer(pattern=sync.pattern_index_).fit(X)
sync.transform(np.stack(X)).shape
sync.transform([x.tolist() for x in X]).shape
LinearSynchronizer().fit(tables).match(tables).to_frame("percent", tables)
LinearSynchronizer().fit(to_frame(tables)).set_output(transform="pandas")
LinearSynchronizer().fit(np.stack(X)[:, :, 0])
LinearSynchronizer().fit([[1.0, 2.0, 4.0], [1.0, 3.0, 4.0]])
LinearSynchronizer().fit(np.array([*X, X[0][:9]], dtype=object))
sync.match(X).times.shape
sync.match(X).offsets_in("seconds", X, frame_rate=50)[0].tolist()
Match.from_estimator(make_pipeline(sync), X).warp(X).shape
LinearSynchronizer().fit(X, keyframes=[[5, 9], [6, 8], np.array([4, 9])])
DenseSynchronizer(keyframe_std=2.5).fit(X, keyframes=[[5.5], None, np.array([np.nan])])
DenseSynchronizer().fit_transform(X, keyframes=pd.DataFrame({"a": [0.5, 0.6, 0.7]}), frame_rate=10)
keyframes_from_events(X, pd.DataFrame({"trial": [0], "event": "a", "frame": 5}), ["a"]).loc[0, "a"]
TimingChannel(LinearSynchronizer()).fit_transform(X).shape
ActionModel(coverage=0.9).fit(X, groups=["ann", "ann", "bob"]).envelope()[0].shape
ActionModel().fit(X, groups=pd.Series([0, 1, 2])).sample(2, random_state=0).tolist()
ActionClassifier(n_landmarks=None, n_jobs=1)
Skeleton.coco(n_dims=2, up="-y").landmarks["pelvis"]
Skeleton(["hip", "knee"], [-1, 0], {"left_hip": "hip", "left_knee": ["knee"]}).column_names
DirectionCosines(Skeleton.paper(), hidden="nan")
FrameWise(sync)
PartSynchronizer({"arm": [0], "leg": [1]}, synchronizer=DenseSynchronizer(n_frames=20))
FeatureHoldoutScorer()(sync, X) + least_squares(np.stack(X), np.stack(X))
group_timing_error(sync.match(X).times.tolist(), [[0, 0.5, 1]] * 3)
make_gait(2, takes=True).data[0].shape
partial(read_motion, "trial.amc", asf="trial.asf")
to_trials(pd.DataFrame({"trial": [1, 1, 2, 2], "x": [0.0, 1, 0, 1]}), by="trial")
"""

# Each of these is wrong: it raises an error, and mypy reports it. What strings estimators take is
# tested above.
WRONG = """\
DenseSynchronizer(n_frames="many").fit(X)
DenseSynchronizer(cost="posure").fit(X)
DenseSynchronizer(30, "median", "auto").fit(X)
DenseSynchronizer(frames=30).fit(X)
DenseSynchronizer().fit(X, keyframes=5)
DenseSynchronizer().fit(X, keyframes=[["5"], ["6"], ["7"]])
keyframes_from_events(X, by=3)
DenseSynchronizer().fit("trials.csv")
DenseSynchronizer().fit({"ann": X[0], "bob": X[1]})
LinearSynchronizer().fit([1.0, 2.0, 3.0])
LinearSynchronizer().fit(X).match("trials.csv")
LinearSynchronizer().fit()
sync.match(X).offsets_in("minutes")
sync.match(X).seconds(X, frame_rate="fast")
Match("0 1 2")
ActionModel(n_std="three").fit(X)
ActionModel().fit(X, groups=3)
ActionModel().fit(X).sample("all")
OnlineSynchronizer(DenseSynchronizer).fit(X)
Skeleton.paper(n_dims=4)
Skeleton.papers()
JointPositions(Skeleton.paper(), "parent").fit(np.ones((3, 9, 45)))
make_bending(frame_rate="50 Hz")
read_motion("trial.c3d", ends="cut")
synchronization_distances(X, cost="euclidean")
find_trials(sync, X, threshold="mean")
to_trials(tables[0], by=0)
"""


# What mypy says that each of these is.
REVEALED = {
    "DenseSynchronizer().fit(X)": "DenseSynchronizer",
    "DenseSynchronizer.paper()": "DenseSynchronizer",
    "TimingChannel(sync).fit(X)": "TimingChannel",
    "ActionModel().partial_fit(X)": "ActionModel",
    "sync.match(X)": "Match",
    "sync.match(X).rates": "ndarray",
    "sync.match(X).to_frame()": "DataFrame|Any",
    "Skeleton.paper()": "Skeleton",
    "TrellisDisplay.from_estimator(sync, X)": "TrellisDisplay",
}


# One set of options, so that the package is read once. No type of what is skipped is public.
SETTINGS = """\
[mypy]
ignore_missing_imports = true
follow_imports = silent
[mypy-IPython.*,PIL.*,prompt_toolkit.*,pyparsing.*,traitlets.*]
follow_imports = skip
"""


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """Where mypy runs, with what it has read of other packages."""
    folder = tmp_path_factory.mktemp("mypy")
    (folder / "mypy.ini").write_text(SETTINGS, encoding="utf-8")
    return folder


def run_mypy(folder, *arguments):
    """What mypy says of the code beside these tests, line by line."""
    command = [sys.executable, "-m", "mypy", "--no-error-summary", "--cache-dir", str(folder)]
    done = subprocess.run(
        [*command, *arguments],
        cwd=folder,
        env={**os.environ, "MYPYPATH": str(ROOT)},
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.stderr == ""
    return done.stdout.splitlines()


@pytest.fixture(scope="module")
def messages(folder):
    """The messages of mypy about each line of RIGHT, WRONG and REVEALED."""
    lines = [*RIGHT.splitlines(), *WRONG.splitlines(), *(f"reveal_type({x})" for x in REVEALED)]
    script = folder / "script.py"
    script.write_text(PREAMBLE + "\n".join(lines) + "\n", encoding="utf-8")
    first, found = PREAMBLE.count("\n") + 1, {line: [] for line in lines}
    for message in run_mypy(folder, script.name):
        file, number, kind, text = re.fullmatch(r"(.+?):(\d+): (\w+): (.*)", message).groups()
        assert file == script.name or kind == "note", message
        if file == script.name:
            found[lines[int(number) - first]].append(text)
    return found


def test_mypy_has_nothing_to_say_about_the_package(folder):
    assert run_mypy(folder, "-p", "sklearn_motionsync") == []


def test_mypy_reports_every_wrong_line_and_no_right_one(messages):
    assert {line: messages[line] for line in RIGHT.splitlines() if messages[line]} == {}
    assert [line for line in WRONG.splitlines() if not messages[line]] == []


def test_mypy_knows_what_methods_return(messages):
    for line, kind in REVEALED.items():
        (message,) = messages[f"reveal_type({line})"]
        assert re.search(rf'Revealed type is "[\w.]*\b({kind})\b', message), line


def test_right_lines_run_and_wrong_lines_raise_errors():
    names = {}
    exec(PREAMBLE, names)
    for line in RIGHT.splitlines():
        exec(line, dict(names))
    accepted = []
    for line in WRONG.splitlines():
        try:
            exec(line, dict(names))
        except (AttributeError, TypeError, ValueError):
            continue
        accepted.append(line)
    assert accepted == []
