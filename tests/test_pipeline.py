"""The estimators together, in scikit-learn's own tools, on synthetic and on real people."""

import runpy
import sys
from pathlib import Path

import matplotlib as mpl
import numpy as np
import pytest
from sklearn.model_selection import GridSearchCV, GroupKFold, cross_val_score
from sklearn.pipeline import make_pipeline
from sklearn_motionsync import (
    ActionModel,
    ASpace,
    DenseSynchronizer,
    DirectionCosines,
    LinearSynchronizer,
)

EXAMPLE = Path(__file__).resolve().parents[1] / "examples" / "plot_bending.py"
PARAMETERS = {
    "aspace__n_components": [4, 8],
    "densesynchronizer__smoothness": [0.01, 0.1],
    "densesynchronizer__max_offset": [0.15, 0.25],
}


def make_pipe(skeleton, synchronizer=None):
    synchronizer = synchronizer or DenseSynchronizer(n_frames=60)
    return make_pipeline(DirectionCosines(skeleton), ASpace(8), synchronizer, ActionModel())


@pytest.fixture(params=["bending", "bends"])
def people(request):
    """A list of performances of unequal length: synthetic, and real."""
    bunch = request.getfixturevalue(request.param)
    assert isinstance(bunch.data, list)
    assert len({len(x) for x in bunch.data}) > 10
    return bunch


def test_pipeline_scores_predicts_and_samples(people):
    pipe = make_pipe(people.skeleton).fit(people.data)
    assert (pipe.predict(people.data) == 1).mean() > 0.9
    assert pipe.score_samples(people.data).shape == (len(people.data),)
    assert pipe[-1].sample(5, random_state=0).shape == (5, 60, 8)


def test_cross_val_score(people):
    scores = cross_val_score(make_pipe(people.skeleton), people.data, cv=4, error_score="raise")
    assert np.isfinite(scores).all()


def test_group_k_fold_by_actor(people):
    scores = cross_val_score(
        make_pipe(people.skeleton),
        people.data,
        groups=people.actor,
        cv=GroupKFold(4),
        error_score="raise",
    )
    assert np.isfinite(scores).all()


def test_grid_search(people):
    search = GridSearchCV(make_pipe(people.skeleton), PARAMETERS, cv=2, error_score="raise")
    search.fit(people.data)
    assert set(search.best_params_) == set(PARAMETERS)
    assert np.isfinite(search.cv_results_["mean_test_score"]).all()
    assert search.predict(people.data[:3]).shape == (3,)


def test_dense_beats_linear_on_actors_not_seen(bends):
    """Synchronised performances of new people are more probable under the model."""

    def score(synchronizer):
        pipe = make_pipe(bends.skeleton, synchronizer)
        cv = GroupKFold(4)
        return cross_val_score(pipe, bends.data, groups=bends.actor, cv=cv).mean()

    assert score(DenseSynchronizer(60)) > score(LinearSynchronizer(60))


def test_a_model_tells_another_action(bends, real_data):
    from sklearn_motionsync.datasets import load_performances

    bunch = load_performances(real_data / "hdm05" / "hdm05_positions.npz")
    others = [x for x, t in zip(bunch.data, bunch.target, strict=True) if t.startswith("hop")]
    pipe = make_pipe(bends.skeleton).fit(bends.data)
    assert pipe.score_samples(others).max() < pipe.score_samples(bends.data).min()


# -- the main job -----------------------------------------------------------------------


def run_example(monkeypatch, capsys, *arguments):
    mpl.use("Agg")
    monkeypatch.setattr(sys, "argv", [str(EXAMPLE), *map(str, arguments)])
    runpy.run_path(str(EXAMPLE), run_name="__main__")
    mpl.pyplot.close("all")
    return capsys.readouterr().out


def assert_figures(folder):
    for name in ("bending_dimensions.png", "bending_postures.png"):
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
def test_what_the_example_cannot_do_it_says_in_a_line(monkeypatch, capsys, arguments, message):
    monkeypatch.setattr(sys, "argv", [str(EXAMPLE), *arguments])
    with pytest.raises(SystemExit) as end:
        runpy.run_path(str(EXAMPLE), run_name="__main__")
    out, err = capsys.readouterr()
    assert end.value.code == 2
    assert out == ""
    assert err.count("\n") == 1
    assert err.startswith("plot_bending.py: ")
    assert message in err


def test_the_example_in_a_notebook_has_no_arguments(monkeypatch, capsys, tmp_path):
    """Those of the kernel are not for it."""
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(sys, "argv", ["ipykernel_launcher.py", "-f", "kernel.json"])
    exec(compile(EXAMPLE.read_text(), "cell", "exec"), {"__name__": "__main__"})
    assert "40 of bending" in capsys.readouterr().out
    assert_figures(tmp_path)


def test_example_on_the_embedded_data(monkeypatch, capsys, tmp_path):
    out = run_example(monkeypatch, capsys, "--output", tmp_path)
    for words in (
        "40 of bending",
        "median performance",
        "spread, dense",
        "key-frames missed",
        "time of warping all",
    ):
        assert words in out
    assert_figures(tmp_path)


def test_example_on_real_people(monkeypatch, capsys, tmp_path, real_data):
    path = real_data / "hdm05" / "hdm05_positions.npz"
    out = run_example(
        monkeypatch, capsys, "--data", path, "--action", "depositFloorR", "--output", tmp_path
    )
    assert "24 of depositFloorR" in out
    assert_figures(tmp_path)


def test_example_says_which_actions_there_are(monkeypatch, capsys, real_data):
    path = real_data / "hdm05" / "hdm05_positions.npz"
    with pytest.raises(SystemExit, match="depositFloorR"):
        run_example(monkeypatch, capsys, "--data", path)
    with pytest.raises(SystemExit, match="0 performances of 'bowing'"):
        run_example(monkeypatch, capsys, "--data", path, "--action", "bowing")
