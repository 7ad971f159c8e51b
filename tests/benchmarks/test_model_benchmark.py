"""The benchmark of action models: wrong trials, people held out, and the tables."""

import numpy as np
import pytest
from joblib import parallel_config
from sklearn_motionsync.datasets import make_bending
from threadpoolctl import threadpool_limits


@pytest.fixture(scope="module")
def model(benchmark):
    return benchmark("model")


@pytest.fixture(scope="module")
def clips(model):
    """Nine bends of three people, three each, and the same backwards."""
    clips = model.as_clips("few", make_bending(9, n_actors=3, n_frames=40, random_state=0))
    poses = clips.poses + [x[::-1] for x in clips.poses]
    return model.Clips("few", poses, np.repeat(["bending", "rising"], 9), np.tile(clips.actors, 2))


X = np.array([[0.0, 1], [2, 3], [4, 5], [6, 7], [13, 14]])


@pytest.mark.parametrize(
    ("kind", "expected"),
    [
        ("standing still", [[0, 1]] * 5),
        ("amplitude x 0.3", [[3.5, 4.5], [4.1, 5.1], [4.7, 5.7], [5.3, 6.3], [7.4, 8.4]]),
        ("first half", [[0, 1], [2, 3], [4, 5]]),
        ("twice in a row", [*X, *X]),
        ("halves exchanged", [[4, 5], [6, 7], [13, 14], [0, 1], [2, 3]]),
        ("backwards", [[13, 14], [6, 7], [4, 5], [2, 3], [0, 1]]),
    ],
)
def test_faults_are_put_into_correct_trials(model, kind, expected):
    given = X.copy()
    np.testing.assert_allclose(model.SPOILT[kind](given), expected)
    np.testing.assert_array_equal(given, X)


def test_tested_subjects_are_not_in_the_training_set(model, clips):
    assert clips.folds() == [(a, k) for a in ("bending", "rising") for k in clips.actors[:3]]
    held = clips.actors[0]
    fold = model.hold_out(clips, "bending", held)
    assert held not in fold.groups
    assert len(fold.train) == len(fold.groups) == len(fold.on_clock) == 6
    assert list(fold.raw) == list(fold.synchronised) == [model.OWN, *model.KINDS]
    for some in fold.synchronised.values():
        assert some.shape == (3, model.P, fold.on_clock.shape[2])
    # The other action of the same person is in the same space, there the right one backwards.
    for right, wrong in zip(fold.raw["own"], fold.raw["other actions"], strict=True):
        np.testing.assert_allclose(wrong, right[::-1])
    # Changing the held-out subjects changes nothing that is learnt.
    changed = [x + (clips.actors[i] == held) for i, x in enumerate(clips.poses)]
    changed = model.Clips(clips.name, changed, clips.actions, clips.actors)
    again = model.hold_out(changed, "bending", held)
    np.testing.assert_array_equal(again.on_clock, fold.on_clock)
    assert np.abs(again.raw["own"][0] - fold.raw["own"][0]).max() > 0.1


def test_small_training_set_has_at_least_two_subjects(model, clips):
    rng = np.random.default_rng(0)
    held = clips.actors[0]
    for _ in range(10):
        on_clock, groups, own = model.hold_out_few(clips, "bending", held, 2, rng)
        assert len(on_clock) == len(set(groups)) == 2
        assert held not in groups
        assert len(own) == 3
    assert model.hold_out_few(clips, "bending", held, 7, rng) is None


def test_summary_figures_are_means_over_actions(model):
    actions = {
        "a": {"own": np.array([1.0, 2, -1, 3]), "backwards": np.array([-2.0, 1.5])},
        "b": {"own": np.array([1.0])},
        "bending": {"own": np.array([1.0, -1]), "backwards": np.array([0.0])},
    }
    assert model.accepted(actions) == {"a": 0.75, "b": 1.0, "bending": 0.5}
    assert model.refused(actions, "backwards") == pytest.approx((0.5 + 0) / 2)
    assert model.refused(actions, "backwards", model.THERE_AND_BACK) == 0.5
    assert np.isnan(model.refused(actions, "other actions"))


def test_all_tables_of_a_tiny_set(model, clips, capsys, monkeypatch):
    for name, value in (("FEW", (5,)), ("DRAWS", 1)):
        monkeypatch.setattr(model, name, value)
    # Of three people one is held out, with both actions.
    folds = [fold for fold in clips.folds() if fold[1] == clips.actors[0]]
    assert len(folds) == 2
    monkeypatch.setattr(type(clips), "folds", lambda self: folds)
    with threadpool_limits(1), parallel_config(backend="sequential"):
        model.print_tables([clips])
    tables = capsys.readouterr().out.strip().split("\n\n")
    rows = [[line.strip("| ").split(" | ") for line in table.splitlines()] for table in tables]
    for head, _, *body in rows:
        assert len(body) > 0
        assert {len(row) for row in body} == {len(head)}
    verdicts = {row[0]: row[1:] for row in rows[0][2:]}
    own, lowest, *wrong = verdicts["`ActionModel`"]
    assert int(own) >= 80
    assert int(lowest) <= int(own)
    assert wrong[1] == "100"
