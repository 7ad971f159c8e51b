"""The benchmark of recognition: folds of people, probabilities, and the tables without peers."""

import json
from functools import partial
from itertools import compress

import numpy as np
import pytest
from joblib import parallel_config
from sklearn.pipeline import make_pipeline, make_union
from sklearn_motionsync import ActionClassifier, DirectionCosines, JointPositions
from sklearn_motionsync.datasets import make_bending
from threadpoolctl import threadpool_limits


@pytest.fixture(scope="module")
def recognition(benchmark):
    return benchmark("recognition")


@pytest.fixture(scope="module")
def bunch():
    """Three people: each bends twice, gets up twice, and does both backwards."""
    bunch = make_bending(6, n_actors=3, n_frames=24, random_state=0)
    rising = [x[len(x) // 2 :] for x in bunch.data]
    bunch.data = bunch.data + rising + [x[::-1] for x in rising]
    bunch.target = np.repeat(["bending", "rising", "sinking"], 6)
    bunch.actor = np.tile(["s01", "s02", "s03"], 6)
    return bunch


@pytest.fixture(scope="module")
def recordings(recognition, bunch):
    return recognition.as_recordings("few", bunch)


# -- folds ------------------------------------------------------------------------------


def test_published_splits_are_disjoint(recognition, tmp_path):
    path = tmp_path / "splits.json"
    path.write_text(json.dumps({"train_actors": [[2, 10]], "test_actors": [[1, 3]]}))
    actors = np.array(["s01", "s02", "s10", "s03", "s01"])
    ((train, test),) = recognition.published_splits(path, actors)
    assert (train.tolist(), test.tolist()) == ([1, 2], [0, 3, 4])


def test_leave_one_actor_out_splits(recognition):
    splits = recognition.actors_left_out(np.array(["b", "a", "b", "c"]))
    left_out = [(train.tolist(), test.tolist()) for train, test in splits]
    assert left_out == [([0, 2, 3], [1]), ([1, 3], [0, 2]), ([0, 1, 2], [3])]


# -- figures ----------------------------------------------------------------------------


def test_auc_of_an_unknown_action(recognition, recordings):
    """By scores of one number a clip, which are known."""
    seen, train, test = [], np.arange(0, 12, 2), np.arange(1, 12, 2)

    def decide(train, test):
        seen.append((set(train), set(test)))
        return np.array(["bending"]), np.where(test < 6, 0.0, -9.0)[:, np.newaxis]

    args = recognition.Scored(decide), recordings.actions, "rising", train
    assert recognition.unknown_area(*args, test) == 1
    assert seen == [({0, 2, 4}, set(test))]
    assert np.isnan(recognition.unknown_area(*args, test[3:]))


# -- recognition ------------------------------------------------------------------------


def test_fourier_amplitudes_of_sine_waves(recognition):
    t = np.arange(40) / 40
    X = (3 + 2 * np.cos(2 * np.pi * 4 * t))[np.newaxis, :, np.newaxis]
    found = recognition.fourier_pyramid(X, n_levels=2, n_frequencies=5)[0]
    # Four waves in the whole are two in either half.
    np.testing.assert_allclose(found, [3, 0, 0, 0, 1] + 2 * [3, 0, 1, 0, 0], atol=1e-12)


def test_benchmarked_pipeline_is_that_of_the_manual(recognition, bunch, recordings):
    train, test = np.flatnonzero(bunch.actor != "s03"), np.flatnonzero(bunch.actor == "s03")
    views = make_union(DirectionCosines(bunch.skeleton), JointPositions(bunch.skeleton))
    pipe = make_pipeline(views.set_output(transform="pandas"), ActionClassifier())
    groups = bunch.actor[train]
    pipe.fit([bunch.data[i] for i in train], bunch.target[train], actionclassifier__groups=groups)
    expected = -pipe.score_samples([bunch.data[i] for i in test])
    one = recognition.Classifier(recordings, view=recognition.BOTH)
    np.testing.assert_allclose(one.novelty(train, test), expected, rtol=1e-6)
    np.testing.assert_array_equal(one.predict(train, test), bunch.target[test])


# -- tables -----------------------------------------------------------------------------


def test_all_tables_of_a_tiny_set_without_peers(recognition, recordings, capsys, monkeypatch):
    hasty = partial(ActionClassifier, n_frames=12)
    monkeypatch.setattr(recognition, "version_of", lambda package: None)
    monkeypatch.setattr(recognition, "ActionClassifier", hasty)
    splits = recognition.actors_left_out(recordings.actors)[:1]
    two = recordings.actors != "s03"
    few = recognition.Recordings(
        "two people",
        {view: list(compress(some, two)) for view, some in recordings.views.items()},
        recordings.actions[two],
        recordings.actors[two],
    )
    with threadpool_limits(1), parallel_config(backend="sequential"):
        recognition.recognition_table(recordings, splits)
        recognition.rejection_tables(recordings, few, splits)
    tables = capsys.readouterr().out.strip().split("\n\n")
    rows = [[line.strip("| ").split(" | ") for line in table.splitlines()] for table in tables]
    for head, _, *body in rows:
        assert {len(row) for row in body} == {len(head)}
    assert [len(body) - 2 for body in rows] == [3, 8, 8, 8]
    ours = {row[0]: row[1:] for row in rows[0][2:]}["`ActionClassifier`, cosines"]
    assert ours[:3] == ["100.0"] * 3
