"""The phase of running performances of people that the synchronizer has not seen."""

import numpy as np
import pytest
from sklearn.pipeline import make_pipeline
from sklearn_motionsync import ASpace, DenseSynchronizer, DirectionCosines, OnlineSynchronizer
from sklearn_motionsync.datasets import load_performances

P = 100


@pytest.fixture(scope="module")
def clips(real_data):
    return load_performances(real_data / "hdm05" / "hdm05_positions.npz")


def of(clips, action, actor, held_out):
    """Clips of an action, at 30 frames a second, by one actor or by the others."""
    chosen = [
        i
        for i, (t, a) in enumerate(zip(clips.target, clips.actor, strict=True))
        if t == action and (a == actor) == held_out
    ]
    return [clips.data[i][::4] for i in chosen]


@pytest.mark.parametrize("action", ["depositFloorR", "grabHighR"])
def test_the_phase_of_a_stranger(clips, action):
    features = make_pipeline(DirectionCosines(clips.skeleton), ASpace())
    known = features.fit_transform(of(clips, action, "bk", held_out=False))
    X = features.transform(of(clips, action, "bk", held_out=True))
    live = OnlineSynchronizer(DenseSynchronizer(P)).fit(known)
    errors, right = [], live.follow(X)
    for x, times, found in zip(X, live.synchronizer_.match(X).times, right, strict=True):
        clock = np.linspace(0, P - 1, len(x))
        offline = np.interp(clock, times + 1e-9 * np.arange(P), np.arange(P))
        errors.append(np.abs(found.phase - offline)[clock >= P / 5])
    assert np.median(np.concatenate(errors)) < 3.5
    # Another action is believed half as much.
    other = {"depositFloorR": "grabHighR", "grabHighR": "depositFloorR"}[action]
    wrong = live.follow(features.transform(of(clips, other, "bk", held_out=True)))
    right, wrong = (
        np.median([found.confidence[len(found.phase) // 2 :].mean() for found in some])
        for some in (right, wrong)
    )
    assert wrong < right / 2
