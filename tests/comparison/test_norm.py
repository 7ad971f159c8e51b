"""compare_to_norm: level, what is found, its numbers against slow versions, refusals."""

import numpy as np
import pandas as pd
import pytest
from scipy import stats
from sklearn.pipeline import make_pipeline
from sklearn.preprocessing import StandardScaler
from sklearn_motionsync import DenseSynchronizer, FrameWise, LinearSynchronizer, Match
from sklearn_motionsync.comparison import compare_to_norm
from sklearn_motionsync.datasets import make_gait

P = 61


def studied(**params):
    gait = make_gait(24, 2, random_state=1, **params)
    norm = [x for x, group in zip(gait.data, gait.group, strict=True) if group == "A"]
    pipe = make_pipeline(FrameWise(StandardScaler()), DenseSynchronizer(P)).fit(norm)
    return gait, pipe


@pytest.fixture(scope="module")
def late():
    return studied(timing=6)


def compared(gait, pipe, **params):
    return compare_to_norm(pipe, gait.data, gait.group, norm="A", groups=gait.person, **params)


def test_late_patients_are_late_and_keep_their_shape(late):
    found = compared(*late, level=0.1)
    assert found.n_people == 12
    assert found.verdicts["differs"].mean() > 0.8
    assert (found.verdicts["n_trials"] == 2).all()
    assert set(found.departures["what"]) == {"timing"}
    assert set(found.departures["direction"]) == {"later"}
    assert found.departures["peak"].between(30, 85).all()
    assert found.departures["size"].between(2, 10).all()
    assert found.departures.groupby("subject").size().max() <= 5
    # The toe-off is made 6 % later: a row begins before it and ends after it.
    row = found.departures.iloc[0]
    assert row["start"] < 62 < row["end"]
    assert "later, at" in found.describe(row["subject"])


def test_weak_patients_are_weak():
    found = compared(*studied(amplitude=-25), level=0.1, features=[0, 1])
    shape = found.departures[found.departures["what"] == "shape"]
    assert found.verdicts["p_shape"].median() < 0.05
    assert set(shape["feature"]) == {"x1"}
    assert set(shape["direction"]) == {"below"}
    assert shape["peak"].between(60, 85).all()
    assert shape["size"].between(-40, -12).all()  # degrees


def test_as_many_people_of_the_norm_differ_as_the_level_says():
    """By chance 10 of 100; more than 20 come in one of 2,000 series."""
    rng, wrong = np.random.default_rng(0), []
    for _ in range(20):
        X = np.cumsum(rng.standard_normal((20, 30, 2)), axis=1)
        sync = LinearSynchronizer(30).fit(X)
        found = compare_to_norm(sync, X, ["n"] * 15 + ["p"] * 5, norm="n", level=0.1)
        wrong += (found.verdicts["p_shape"] <= 0.1).tolist()
    assert 2 <= sum(wrong) <= 20


def test_numbers_equal_a_slow_version(late):
    gait, pipe = late
    found = compared(gait, pipe, features=[1])
    match = Match.from_estimator(pipe, gait.data)
    offsets = match.offsets_in("percent")
    people = list(dict.fromkeys(gait.person))
    groups = dict(zip(gait.person, gait.group, strict=True))
    trials = {p: offsets[gait.person == p] for p in people}
    norm = [p for p in people if groups[p] == "A"]

    def reference(some):
        means = np.array([trials[p].mean(axis=0) for p in some])
        n = len(means)
        others = (means.sum(axis=0) - means) / (n - 1)
        squares = np.square(means - others).mean(axis=0)
        variance = ((n - 1) * squares + 20 * squares.mean()) / (n + 19) * (1 + 1 / n)
        spread = means.var()
        return means.mean(axis=0), np.sqrt(np.maximum(variance, 1e-9 * spread))

    logs = []
    for p in norm:
        mean, std = reference([other for other in norm if other != p])
        logs.append(np.log(np.abs((trials[p].mean(axis=0) - mean) / std).max()))
    n, freedom = len(logs), len(logs) + 2
    scale = np.sqrt((np.var(logs) * n + 3 * 0.1) / freedom * (1 + 1 / n))
    mean, std = reference(norm)
    for subject, row in found.verdicts.iterrows():
        z = np.abs((trials[subject].mean(axis=0) - mean) / std).max()
        p = stats.t.sf((np.log(z) - np.mean(logs)) / scale, freedom)
        assert row["p_timing"] == pytest.approx(p, rel=1e-6)
    limit = np.exp(np.mean(logs) + stats.t.ppf(0.975, freedom) * scale)
    np.testing.assert_allclose(found.limits[:, -1], limit)
    # The profile: root mean squares of differences from the mean of the norm.
    warped = match.warp(gait.data)[:, :, 1]
    of = {p: warped[gait.person == p].mean(axis=0) for p in people}
    middle = np.mean([of[p] for p in norm], axis=0)
    for subject in found.verdicts.index:
        row = found.profile.loc[(subject, "x1")]
        assert row["aligned"] == pytest.approx(np.sqrt(np.square(of[subject] - middle).mean()))
    even = np.array([np.interp(np.linspace(0, len(x) - 1, P), np.arange(len(x)), x[:, 1])
                     for x in gait.data])  # fmt: skip
    of = {p: even[gait.person == p].mean(axis=0) for p in people}
    middle = np.mean([of[p] for p in norm], axis=0)
    subject = found.verdicts.index[0]
    row = found.profile.loc[(subject, "x1")]
    assert row["linear"] == pytest.approx(np.sqrt(np.square(of[subject] - middle).mean()), rel=1e-3)
    assert np.isnan(found.profile.loc[(subject, "offset"), "linear"])


def test_a_verdict_has_rows_just_if_it_differs(late):
    found = compared(*late, level=0.3)
    assert found.verdicts["differs"].mean() > 0
    has_rows = found.verdicts.index.isin(found.departures["subject"])
    np.testing.assert_array_equal(has_rows, found.verdicts["differs"])
    within = compared(*late, level=1e-9)
    assert len(within.departures) == 0
    assert "0 of 12 subjects differ" in repr(within)
    assert "stays within the norm of 12 people" in within.describe("person1")


def test_fewer_trials_are_compared_with_as_many(late):
    """One trial varies more than the mean of two, and so do single trials of the norm."""
    gait, pipe = late
    keep = [k for k in range(len(gait.data)) if gait.group[k] == "A" or k % 2 == 0]
    one = compare_to_norm(
        pipe,
        [gait.data[k] for k in keep],
        gait.group[keep],
        norm="A",
        groups=gait.person[keep],
    )
    two = compared(gait, pipe)
    assert (one.limits[0] > two.limits[0]).all()
    np.testing.assert_allclose(one.std, two.std)


def test_without_people_names_units_and_seconds():
    gait, _ = studied(timing=6)
    tables = [pd.DataFrame(x, columns=gait.feature_names) for x in gait.data]
    for x in tables:
        x.attrs["units"] = list(gait.units)
    sync = DenseSynchronizer(P).fit(tables)
    found = compare_to_norm(
        sync, tables, gait.group, norm="A", unit="seconds", frame_rate=100, features="hip_flexion"
    )
    assert found.n_people == 24
    assert found.verdicts["n_trials"].unique().tolist() == [1]
    assert found.features == ["hip_flexion", "offset"]
    assert found.units == ["deg", "s"]
    assert found.clock[-1] == pytest.approx((np.median([len(x) for x in tables]) - 1) / 100)


@pytest.mark.parametrize(
    ("given", "message"),
    [
        ({"norm": "C"}, r"norm='C' is none of the labels \['A', 'B'\] in y"),
        ({"y": ["A"] * 48}, "y: all labels are equal"),
        ({"y": ["A"] * 4 + ["B"] * 44}, "needs at least 3 people, got 2 in 'A'"),
        ({"groups": [0] * 48}, "groups: all labels are equal"),
        (
            {"y": ["A", "B"] * 24},
            r"'person0' has trials of the labels \['A', 'B'\] in y\. Give people one name a label",
        ),
        ({"level": 2}, "level must be a number between 0 and 1"),
        ({"unit": "hours"}, "unit must be one of"),
        ({"features": "elbow"}, "There is no feature 'elbow'"),
    ],
)
def test_refused_arguments(late, given, message):
    gait, pipe = late
    defaults = {"y": gait.group, "norm": "A", "groups": gait.person}
    with pytest.raises(ValueError, match=message):
        compare_to_norm(pipe, gait.data, **(defaults | given))
