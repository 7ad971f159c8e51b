"""Faults of the whole body: put in, and as a plain computation finds them; those of real people."""

import numpy as np
import pytest
from sklearn.pipeline import make_pipeline
from sklearn_motionsync import (
    ActionDetector,
    ActionModel,
    ASpace,
    DenseSynchronizer,
    DirectionCosines,
)
from sklearn_motionsync.datasets import make_bending
from sklearn_motionsync.model import find_departures
from sklearn_motionsync.model.whole_body import WholeBody

P = 120
T = np.linspace(0, 1, P)


def rise(start, stop, size=1.0):
    """A smooth step of two columns from one time to another, and a column that stands still."""
    x = np.clip((T - start) / (stop - start), 0, 1)
    step = size * x**2 * (3 - 2 * x)
    return np.column_stack([step, 3 - 5 * step, np.full(P, 2.0)])


def people(n=20, seed=0):
    rng = np.random.default_rng(seed)
    times = rng.normal([0.2, 0.8, 1.0], [0.02, 0.02, 0.05], size=(n, 3))
    return np.stack([rise(*each) for each in times]), np.arange(n) // 2


@pytest.fixture(scope="module")
def judge():
    X, groups = people()
    return WholeBody(X, groups, X, groups, 0.99)


@pytest.mark.parametrize(
    ("trial", "kind", "size", "place"),
    [
        (rise(0.45, 0.85), "starts late", 22, (0, 0.5)),
        (rise(0.02, 0.75), "starts early", 14, (0, 0.1)),
        (rise(0.15, 0.55), "stops early", 22, (0.5, 1)),
        (rise(0.25, 0.99), "stops late", 14, (0.9, 1)),
        (rise(0.2, 0.8, 0.4), "too small", 0.4, (0, 1)),
        (rise(0.2, 0.8, 1.8), "too large", 1.8, (0, 1)),
        (rise(0.2, 0.8)[::-1], "backwards", None, (0, 1)),
    ],
)
def test_faults_that_were_put_in(judge, trial, kind, size, place):
    faults = {fault.kind: fault for fault in judge.find(trial, trial)}
    fault = faults[kind]
    assert fault.excess > 1
    np.testing.assert_allclose([fault.start, fault.stop], place, atol=0.12)
    if size is None:
        assert np.isnan(fault.size)
    else:
        np.testing.assert_allclose(fault.size, size, rtol=0.25)
        assert (fault.deviation > 0) == (kind in ("starts late", "stops early", "too large"))


def test_a_pause_is_found_where_it_is(judge):
    whole = rise(0.2, 0.8)
    half = int(0.5 * P)
    held = np.concatenate([whole[:half], whole[half : half + 1].repeat(30, 0), whole[half:]])
    paused = np.apply_along_axis(
        lambda x: np.interp(np.linspace(0, 1, P), np.linspace(0, 1, len(held)), x), 0, held
    )
    (pause,) = (fault for fault in judge.find(paused, whole) if fault.kind == "pauses")
    np.testing.assert_allclose([pause.start, pause.stop], [60 / 150, 90 / 150], atol=0.03)
    np.testing.assert_allclose(pause.size, 20, atol=3)


def test_standing_still_is_too_small_and_not_backwards(judge):
    still = np.tile(rise(0.2, 0.8)[:1], (P, 1)) + 1e-9 * np.random.default_rng(0).random((P, 3))
    kinds = [fault.kind for fault in judge.find(still, still)]
    assert "too small" in kinds
    assert "backwards" not in kinds


def test_right_trials_of_new_people_have_few_faults(judge):
    told = [bool(judge.find(x, x)) for x in people(200, seed=1)[0]]
    assert np.mean(told) < 0.06


def test_units_and_what_stands_still_do_not_matter(judge):
    X, groups = people()
    scale, shift = np.array([1000.0, 0.01, 1.0]), np.array([5.0, -3.0, 100.0])
    scaled = WholeBody(X * scale + shift, groups, X * scale + shift, groups, 0.99)
    trial = rise(0.45, 0.85)
    for one, other in zip(
        judge.find(trial, trial),
        scaled.find(trial * scale + shift, trial * scale + shift),
        strict=True,
    ):
        assert one.kind == other.kind
        np.testing.assert_allclose(one[1:4], other[1:4], rtol=1e-6)
    still = np.full((6, P, 2), 3.0)
    assert WholeBody(still, np.arange(6), still, np.arange(6), 0.95).find(still[0], still[0]) == []


# -- in the table of departures ---------------------------------------------------------


@pytest.fixture(scope="module")
def bends():
    bends = make_bending(24, random_state=0)
    is_own = bends.actor == bends.actor[0]
    others = [x for x, own in zip(bends.data, is_own, strict=False) if not own]
    own = [x for x, is_of_person in zip(bends.data, is_own, strict=False) if is_of_person]
    pipe = make_pipeline(DirectionCosines(bends.skeleton), DenseSynchronizer(60), ActionModel())
    return pipe, others, own, bends.actor[~is_own]


def test_rows_of_the_whole_body_are_in_frames_and_seconds_of_the_recording(bends):
    pipe, others, own, groups = bends
    pipe.fit(others, actionmodel__groups=groups)
    x = own[3]
    n = len(x) // 4
    paused = np.concatenate([x[:1].repeat(n, axis=0), x])
    found = find_departures(pipe, [paused, x[::-1], x], frame_rate=50)
    first = found.groupby("trial").first()
    assert first.loc[0, ["kind", "limb", "region"]].tolist() == ["starts late", *["whole body"] * 2]
    assert first.loc[1, "kind"] == "backwards"
    assert first.loc[0, "start"] == 0
    assert n - 3 <= first.loc[0, "end"] <= n + 0.25 * len(x)
    times = found[["start_time", "end_time"]].to_numpy()
    np.testing.assert_allclose(times, found[["start", "end"]].to_numpy() / 50)
    assert (found["end"] < np.take([len(paused), len(x), len(x)], found["trial"])).all()
    # Chosen features are judged alone, and behind an aSpace new people seem to start late.
    assert not (find_departures(pipe, [paused], features=[0, 1])["limb"] == "whole body").any()
    reduced = make_pipeline(pipe[0], ASpace(0.95), *pipe[1:]).fit(others)
    assert not (find_departures(reduced, [paused])["limb"] == "whole body").any()


def test_a_detector_tells_what_recordings_alone_show(bends):
    pipe, others, own, groups = bends
    detector = ActionDetector(pipe).fit(others, groups=groups)
    slow = own[3].repeat(4, axis=0)
    found = find_departures(detector, [slow, own[4]])
    assert detector.predict([slow, own[4]]).tolist() == [-1, 1]
    assert set(found["trial"]) == {0}
    row = found[found["kind"] == "too slow"].iloc[0]
    lower, upper = detector.borders_["duration"]
    np.testing.assert_allclose(row["size"], len(slow) / np.sqrt(lower * upper))
    assert row[["limb", "unit"]].tolist() == ["whole body", "ratio"]


def test_a_detector_and_its_departures_match_each_trial_once(bends, monkeypatch):
    pipe, others, own, groups = bends
    detector = ActionDetector(pipe).fit(others, groups=groups)
    counts, match = [], DenseSynchronizer.match

    def counted(self, trials, **params):
        counts.append(len(trials))
        return match(self, trials, **params)

    monkeypatch.setattr(DenseSynchronizer, "match", counted)
    find_departures(detector, own[3:5], reference=own[:3])
    assert sorted(counts) == [2, 3]


def test_pauses_of_real_people_are_told(hdm05):
    """Hops of two people, each left out: a pause in the middle, and the hops as they are."""
    is_hop = hdm05.target == "hopBothLegs1hops"
    X = [x for x, of_action in zip(hdm05.data, is_hop, strict=True) if of_action]
    actors, skeleton = hdm05.actor[is_hop], hdm05.skeleton
    found = {"paused": [], "right": []}
    for actor in np.unique(actors)[::2]:
        known = [x for x, a in zip(X, actors, strict=True) if a != actor]
        pipe = make_pipeline(DirectionCosines(skeleton), DenseSynchronizer(60), ActionModel())
        pipe.fit(known, actionmodel__groups=actors[actors != actor])
        right = [x for x, a in zip(X, actors, strict=True) if a == actor][:4]
        half = [len(x) // 2 for x in right]
        paused = [
            np.concatenate([x[:h], x[h : h + 1].repeat(len(x) // 4, axis=0), x[h:]])
            for x, h in zip(right, half, strict=True)
        ]
        for name, trials in (("paused", paused), ("right", right)):
            rows = find_departures(pipe, trials)
            of_whole = set(rows.loc[rows["kind"] == "pauses", "trial"])
            found[name] += [i in of_whole for i in range(len(trials))]
    assert np.mean(found["paused"]) > 0.9
    assert np.mean(found["right"]) < 0.1
