"""The estimators together, in scikit-learn's own tools, and the main example."""

import runpy
import sys
from pathlib import Path

import matplotlib as mpl
import numpy as np
import pytest
from sklearn import clone, config_context
from sklearn.exceptions import NotFittedError
from sklearn.model_selection import GridSearchCV
from sklearn.pipeline import Pipeline, make_pipeline
from sklearn_motionsync import (
    ActionModel,
    ASpace,
    DenseSynchronizer,
    DirectionCosines,
    LinearSynchronizer,
    Match,
)
from sklearn_motionsync.datasets import make_bending
from sklearn_motionsync.display import (
    ActionModelDisplay,
    SkeletonDisplay,
    SynchronizationDisplay,
    TrellisDisplay,
)
from sklearn_motionsync.metrics import FeatureHoldoutScorer, SpreadScorer

EXAMPLE = Path(__file__).resolve().parents[1] / "examples" / "plot_bending.py"


# -- pipelines within pipelines ---------------------------------------------------------


FEW = make_bending(5, n_frames=40, random_state=2)
COSINES, ASPACE, MODEL = DirectionCosines(FEW.skeleton), ASpace(4), ActionModel()
SYNC = DenseSynchronizer(40)
SEARCH = GridSearchCV(SYNC, {"n_frames": [40]}, cv=2, scoring=SpreadScorer())
BETWEEN = Pipeline([("a", ASPACE), ("b", None), ("c", SYNC)])
# The same pipeline, with pipelines and searches as steps.
NESTINGS = {
    "deep": make_pipeline(make_pipeline(COSINES, make_pipeline(ASPACE, SYNC, MODEL))),
    "nothing between": make_pipeline(COSINES, "passthrough", BETWEEN, MODEL),
    "search": make_pipeline(COSINES, ASPACE, SEARCH, MODEL),
}


@pytest.fixture(scope="module")
def flat():
    """The pipeline of one level, fitted, and what is said of it."""
    pipe = clone(make_pipeline(COSINES, ASPACE, SYNC, MODEL)).fit(FEW.data)
    return pipe, said_of(pipe, FEW.data)


def said_of(pipe, X):
    scores = [scorer(pipe, X) for scorer in (SpreadScorer(), FeatureHoldoutScorer())]
    model = ActionModelDisplay.from_estimator(pipe, X, features="pelvis_height")
    return [scores, Match.from_estimator(pipe, X).times, model.trials]


@pytest.mark.parametrize("name", NESTINGS)
def test_synchronizer_is_found_in_nested_pipelines(name, flat):
    pipe = clone(NESTINGS[name]).fit(FEW.data)
    for one, other in zip(flat[1], said_of(pipe, FEW.data), strict=True):
        np.testing.assert_array_equal(one, other)
    if name != "deep":
        return
    figures = SynchronizationDisplay.from_estimator(pipe, FEW.data)
    assert figures.ylabels == ["aspace0", "aspace1", "aspace2", "aspace3"]
    assert TrellisDisplay.from_estimator(pipe, FEW.data).space.costs.shape[0] == 40
    assert len(SkeletonDisplay.from_estimator(pipe, FEW.data).axes_) == 2
    assert len(SkeletonDisplay.from_model(pipe).axes_) == 4


def test_absent_step_of_a_nested_pipeline_is_refused():
    pipe = make_pipeline(make_pipeline(COSINES, ASPACE), MODEL)
    message = r"no synchronizer in Pipeline; its steps are \['DirectionCosines', 'ASpace', 'Action"
    with pytest.raises(ValueError, match=message):
        SpreadScorer()(pipe, FEW.data)
    with pytest.raises(NotFittedError):
        SpreadScorer()(NESTINGS["deep"], FEW.data)


# -- key-frames along with trials -------------------------------------------------


@pytest.fixture(scope="module")
def marked():
    """Pipelines fitted with key-frames: of one level, and nested."""
    sync = LinearSynchronizer(40)
    with config_context(enable_metadata_routing=True):
        sync.set_fit_request(keyframes=True).set_transform_request(keyframes=True)
        steps = make_pipeline(COSINES, ASPACE, sync)
        pipes = [clone(make_pipeline(*some, MODEL)) for some in (steps, [steps])]
        return [pipe.fit(FEW.data, keyframes=FEW.keyframes) for pipe in pipes]


@pytest.fixture(scope="module")
def points():
    return clone(make_pipeline(COSINES, ASPACE)).fit_transform(FEW.data)


# What takes a pipeline and trials, with whatever goes along with these.
OF_PIPELINES = {
    each.__name__: each.from_estimator
    for each in (Match, SynchronizationDisplay, SkeletonDisplay, ActionModelDisplay, TrellisDisplay)
}


@pytest.mark.parametrize(("nested", "routing"), [(False, True), (True, False)])
def test_displays_and_scorers_take_key_frames(nested, routing, marked, points):
    pipe, K = marked[nested], list(FEW.keyframes)
    sync = LinearSynchronizer(40).fit(points, keyframes=K)
    expected = sync.match(points, keyframes=K)
    with config_context(enable_metadata_routing=routing):
        match = Match.from_estimator(pipe, FEW.data, keyframes=K)
        display = SynchronizationDisplay.from_estimator(pipe, FEW.data, keyframes=K, features=0)
        model = ActionModelDisplay.from_estimator(pipe, FEW.data, keyframes=K, features=0)
        people = SkeletonDisplay.from_estimator(pipe, FEW.data, keyframes=K)
    np.testing.assert_array_equal(match.times, expected.times)
    np.testing.assert_array_equal(display.match.times, expected.times)
    after = sync.transform(points, keyframes=K)[:, :, :1]
    np.testing.assert_array_equal(display.after, after)
    np.testing.assert_array_equal(model.trials, after)
    assert len(people.axes_) == 2


@pytest.mark.parametrize("name", OF_PIPELINES)
def test_unknown_parameter_is_refused(name, flat):
    for given in ({"keyframes": FEW.keyframes}, {"feature": "aspace0"}):
        message = f"{name}.* got '{next(iter(given))}', .*DenseSynchronizer"
        with pytest.raises(TypeError, match=message):
            OF_PIPELINES[name](flat[0], FEW.data, **given)


def test_key_frames_reach_a_step_before_the_synchronizer(points):
    """Dense matching of what coincides in its key-frames already."""
    K = FEW.keyframes
    steps = LinearSynchronizer(40), DenseSynchronizer(30)
    pipe = make_pipeline(*steps).fit(points, linearsynchronizer__keyframes=K)
    marked = steps[0].transform(points, keyframes=K)
    display = TrellisDisplay.from_estimator(pipe, points, trial=2, keyframes=K)
    expected = TrellisDisplay.from_estimator(steps[1], marked, trial=2)
    np.testing.assert_array_equal(display.space.costs, expected.space.costs)
    with pytest.raises(ValueError, match=r"keyframes=\[...\] beside X"):
        TrellisDisplay.from_estimator(pipe, points)


# -- the main job -----------------------------------------------------------------------


def assert_figures(folder):
    for name in ("bending_dimensions.png", "bending_poses.png"):
        assert mpl.pyplot.imread(folder / name).std() > 0.05


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["--dta", "x"], "unrecognized arguments: --dta x"),
        (["--act", "bend"], "unrecognized arguments: --act bend"),
        (["archive.npz"], "unrecognized arguments: archive.npz"),
        (["--action", "bend"], "give --data, too"),
        (["--data", "missing.npz"], "no archive at missing.npz"),
        (["--data", str(EXAMPLE)], "cannot be read"),
        (["--data", str(EXAMPLE.parent)], "--data"),
        (["--output", str(EXAMPLE)], "--output must be a folder"),
    ],
)
def test_example_reports_bad_arguments_in_one_line(monkeypatch, capsys, arguments, message):
    monkeypatch.setattr(sys, "argv", [str(EXAMPLE), *arguments])
    with pytest.raises(SystemExit) as end:
        runpy.run_path(str(EXAMPLE), run_name="__main__")
    out, err = capsys.readouterr()
    assert end.value.code == 2
    assert out == ""
    assert err.count("\n") == 1
    assert err.startswith("plot_bending.py: ")
    assert message in err


def test_example_in_a_notebook_on_the_embedded_data(monkeypatch, capsys, tmp_path):
    """Arguments of the kernel are not for it. CI runs it as a script."""
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(sys, "argv", ["ipykernel_launcher.py", "-f", "kernel.json"])
    code = EXAMPLE.read_text()
    assert code.count("make_bending(random_state=0)") == 1
    code = code.replace("make_bending(", "make_bending(9, n_actors=3, n_frames=40, ")
    exec(compile(code, "cell", "exec"), {"__name__": "__main__"})
    out = capsys.readouterr().out
    for words in ("9 of bending", "pattern", "spread, dense", "key-frames missed", "time of warp"):
        assert words in out
    assert_figures(tmp_path)


def test_example_on_real_people(monkeypatch, capsys, tmp_path, real_data):
    """Without an action, or with one that is not there, it lists those that are."""
    given = [str(EXAMPLE), "--data", str(real_data / "hdm05" / "hdm05_positions.npz")]
    for action, message in (
        ([], "depositFloorR"),
        (["--action", "bowing"], "0 trials of 'bowing'"),
    ):
        monkeypatch.setattr(sys, "argv", given + action)
        with pytest.raises(SystemExit, match=message):
            runpy.run_path(str(EXAMPLE), run_name="__main__")
    action = ["--action", "sneak2StepsLStart", "--output", str(tmp_path)]
    monkeypatch.setattr(sys, "argv", given + action)
    runpy.run_path(str(EXAMPLE), run_name="__main__")
    assert "13 of sneak2StepsLStart" in capsys.readouterr().out
    assert_figures(tmp_path)
