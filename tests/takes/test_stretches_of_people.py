"""Stretches of real takes: walks between standing, jogs among actions, gestures, single actions."""

import numpy as np
import pytest


@pytest.fixture(scope="module")
def stretches(benchmark):
    return benchmark("cycles")


@pytest.fixture(scope="module")
def walks(stretches, real_data):
    """Every sixth one: walks and jogs."""
    return list(stretches.walks(real_data))[::6]


def test_walks_between_standing_are_found_and_cut_inside(stretches, walks):
    """All of them, with nine tenths of the cuts in the walk."""
    cyclic, right, _, inside, cuts, good, found = stretches.standing(walks, 2, "noise", 30)
    assert cyclic == right == len(walks) == 5
    assert good >= 0.9 * cuts
    assert inside >= 12
    assert found <= len(walks) + 1


def test_jogs_among_single_actions_are_found(stretches, real_data):
    takes, _, found, others = stretches.among_actions(real_data, 4, jogs=True)
    assert found >= 0.9 * takes
    assert others == 0


def test_single_actions_one_after_the_other_are_not_cyclic(stretches, real_data):
    assert stretches.among_actions(real_data, 3)[1] == 0
    file = np.load(real_data / "uiprmd" / "uiprmd_odd_positions.npz")
    points = file["positions"] - file["positions"].mean(axis=1, keepdims=True)
    takes = np.split(points.reshape(len(points), -1), file["offsets"][1:-1])[::40]
    assert not stretches.CycleSegmenter().report(takes)["cyclic"].any()


def test_gestures_are_found(stretches, real_data):
    """In clips, and in recordings of ten actions, where no other stretch is found."""
    *rows, (_, others) = stretches.gestures(real_data)
    counts = {label: tuple(numbers) for label, *numbers in rows}
    n_clips, cyclic, n_labels, found = counts["waveHands"]
    assert (n_clips, n_labels) == (20, 20)
    assert cyclic >= 0.9 * n_clips
    assert cyclic + found >= 0.8 * (n_clips + n_labels)
    assert others == 0


def test_cycles_of_walks_between_standing_score_high(stretches, walks):
    """The other frames of the take would score about 0.3."""
    walk = next(w for w in walks if w["label"] == "walk")
    others = [w["points"].reshape(len(w["points"]), -1) for w in walks if w["label"] == "walk"][1:]
    take, (first, last) = stretches.with_standing(walk, 4, "sway", np.random.default_rng(0))
    segmenter = stretches.CycleSegmenter(walk["skeleton"], start="left").fit(others)
    table = segmenter.segment([take])[1]
    assert len(table) >= 1
    assert table["score"].min() > 0.9
    assert table["start"].min() >= first - 1
    assert table["stop"].max() <= last + 1
