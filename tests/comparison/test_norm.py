"""compare_to_norm: level, what is found, its numbers against slow versions, refusals."""

from itertools import groupby

import numpy as np
import pandas as pd
import pytest
from scipy import stats
from sklearn.pipeline import make_pipeline
from sklearn.preprocessing import FunctionTransformer, StandardScaler
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


def test_as_many_people_of_the_norm_differ_as_the_level_says():
    """By chance 10 of 100; more than 20 come in one of 2,000 series."""
    rng, wrong = np.random.default_rng(0), []
    for _ in range(20):
        X = np.cumsum(rng.standard_normal((20, 30, 2)), axis=1)
        sync = LinearSynchronizer(30).fit(X)
        found = compare_to_norm(sync, X, ["n"] * 15 + ["p"] * 5, norm="n", level=0.1)
        wrong += (found.verdicts["p_shape"] <= 0.1).tolist()
    assert 2 <= sum(wrong) <= 20


def root_mean_square(differences):
    return np.sqrt(np.square(differences).mean(axis=0))


def test_numbers_equal_a_slow_version(late):
    """A person of the norm has a single trial, and so have some of the subjects."""
    gait, pipe = late
    rare = [gait.person[0], *gait.person[gait.group == "B"][::4]]
    keep = [k for k in range(len(gait.data)) if k % 2 == 0 or gait.person[k] not in rare]
    X, person, group = [gait.data[k] for k in keep], gait.person[keep], gait.group[keep]
    found = compare_to_norm(pipe, X, group, norm="A", groups=person, features=[1, 2])
    match = Match.from_estimator(pipe, X)
    warped, offsets = match.warp(X)[..., 1:3], match.offsets_in("percent")[..., np.newaxis]
    everything = np.concatenate([warped, offsets], axis=2)
    people = list(dict.fromkeys(person))
    norm = [p for p in people if group[person == p][0] == "A"]
    counts = found.verdicts["n_trials"]
    assert counts.to_dict() == {p: np.sum(person == p) for p in people if p not in norm}
    assert set(counts) == {1, 2}

    def reference(trials, some):
        means = np.array([trials[p].mean(axis=0) for p in some])
        n = len(means)
        others = (means.sum(axis=0) - means) / (n - 1)
        squares = np.square(means - others).mean(axis=0)
        variance = ((n - 1) * squares + 20 * squares.mean(axis=0)) / (n + 19) * (1 + 1 / n)
        return means.mean(axis=0), np.sqrt(np.maximum(variance, 1e-9 * means.var(axis=(0, 1))))

    def of_new_person(trials, k):
        """Mean and scale of the logarithm of the largest deviation, of the mean of k trials."""
        logs, weights, n = [], [], len(norm)
        for p in norm:
            mean, std = reference(trials, [other for other in norm if other != p])
            m = len(trials[p])
            for first in range(m):
                some = [trials[p][(first + j) % m] for j in range(min(k, m))]
                logs.append(np.log(np.abs((np.mean(some, axis=0) - mean) / std).max()))
                weights.append(1 / m)
        mean = np.average(logs, weights=weights)
        variance = np.average((logs - mean) ** 2, weights=weights)
        return mean, np.sqrt((variance * n + 3 * 0.1) / (n + 2) * (1 + 1 / n))

    for what, part in (("shape", slice(0, 2)), ("timing", slice(2, 3))):
        trials = {p: everything[person == p][..., part] for p in people}
        mean, std = reference(trials, norm)
        np.testing.assert_allclose(found.mean[:, part], mean)
        np.testing.assert_allclose(found.std[:, part], std)
        for i, (subject, row) in enumerate(found.verdicts.iterrows()):
            curve = trials[subject].mean(axis=0)
            np.testing.assert_allclose(found.curves[i][:, part], curve)
            middle, scale = of_new_person(trials, row["n_trials"])
            z = np.abs((curve - mean) / std).max()
            p = stats.t.sf((np.log(z) - middle) / scale, len(norm) + 2)
            assert row[f"p_{what}"] == pytest.approx(p, rel=1e-6)
            limit = np.exp(middle + stats.t.ppf(0.975, len(norm) + 2) * scale)
            np.testing.assert_allclose(found.limits[i, part], limit)
    # The profile: root mean squares of differences from the mean of the norm.
    even = [[np.interp(np.linspace(0, len(x) - 1, P), np.arange(len(x)), x[:, k]) for k in (1, 2)]
            for x in X]  # fmt: skip
    even = np.moveaxis(even, 1, 2)
    for values, column, names in (
        (everything, "aligned", ["x1", "x2", "offset"]), (even, "linear", ["x1", "x2"])
    ):  # fmt: skip
        of = {p: values[person == p].mean(axis=0) for p in people}
        middle = np.mean([of[p] for p in norm], axis=0)
        for subject in found.verdicts.index:
            expected = root_mean_square(of[subject] - middle)
            rows = found.profile.loc[[(subject, name) for name in names], column]
            np.testing.assert_allclose(rows, expected, rtol=1e-3)
            if column == "aligned":
                each = [root_mean_square(of[p] - np.mean([of[q] for q in norm if q != p], axis=0))
                        for p in norm]  # fmt: skip
                np.testing.assert_allclose(found.profile.loc[subject, "norm"], np.median(each, 0))
    assert found.profile["linear"].xs("offset", level="feature").isna().all()


@pytest.mark.parametrize("study", ["late", "weak", "healthy", "noise"])
def test_departures_and_sentences_equal_a_slow_version(late, study):
    if study == "noise":  # many departures, and a norm of three people
        X = np.random.default_rng(0).standard_normal((6, 30, 9)).cumsum(axis=1)
        X[4:] *= 4
        sync = LinearSynchronizer(30).fit(X)
        found = compare_to_norm(sync, X, [*"nnnpqq"], norm="n", level=0.9, unit="frames")
    else:
        amplitude = -25 if study == "weak" else 0
        found = compared(*(late if study == "late" else studied(amplitude=amplitude)), level=0.3)
    rows = []
    for i, (subject, curves) in enumerate(zip(found.verdicts.index, found.curves, strict=True)):
        of_subject, z = [], (curves - found.mean) / found.std
        for k, name in enumerate(found.features):
            limit, is_timing = found.limits[i, k], k == len(found.features) - 1
            words = ("later", "earlier") if is_timing else ("above", "below")
            size = np.abs(z[:, k])
            for _, frames in groupby(range(len(z)), key=lambda f: size[f] > limit / 2):
                frames = list(frames)
                beyond = [f for f in frames if size[f] > limit]
                if beyond:
                    peak = frames[size[frames].argmax()]
                    row = [subject, "timing" if is_timing else "shape", name]
                    row += [found.clock[f] for f in (beyond[0], beyond[-1], peak)]
                    row += [words[int(z[peak, k] < 0)], (curves - found.mean)[peak, k]]
                    of_subject.append([*row, found.units[k], z[peak, k]])
        rows += sorted(of_subject, key=lambda row: abs(row[-1]), reverse=True)[:5]
        row = found.verdicts.iloc[i]
        assert row["p"] == min(1, 2 * min(row["p_shape"], row["p_timing"]))
        assert row["differs"] == (row["p"] <= found.level) == bool(of_subject)
        norm = f"the norm of {found.n_people} people, p = {row['p']:.2g}"
        sentence = f"{subject} stays within {norm}."
        if of_subject:
            _, what, name, _, _, peak, word, size, unit, _ = rows[-min(len(of_subject), 5)]
            where = f" in {name}" * (what == "shape")
            size = f"{abs(size):.3g} {unit}".rstrip()
            time = "frames" if study == "noise" else "%"
            sentence = f"{subject} differs from {norm}: {size} {word}{where}, at {peak:.3g} {time}."
        assert found.describe(subject) == sentence
    expected = pd.DataFrame(rows, columns=list(found.departures))
    pd.testing.assert_frame_equal(found.departures, expected)
    groups = ["p", "q", "q"] if study == "noise" else ["B"] * 12
    assert found.verdicts["group"].tolist() == groups
    n = len(set(expected["subject"]))
    words = f"{n} of {len(groups)} subjects {'differs' if n == 1 else 'differ'}"
    assert found.describe() == f"{words} from the norm of {found.n_people} people."
    assert study != "noise" or (expected.groupby("subject").size() == 5).any()
    assert study != "healthy" or found.verdicts["p"].max() == 1


def test_a_verdict_has_rows_just_if_it_differs(late):
    found = compared(*late, level=0.3).verdicts
    least = found["p"].min()
    at_level = compared(*late, level=least)
    assert at_level.verdicts["differs"].tolist() == (found["p"] == least).tolist()
    assert "1 of 12 subjects differs from" in at_level.describe()
    within = compared(*late, level=1e-9)
    assert len(within.departures) == 0
    assert "0 of 12 subjects differ" in repr(within)
    assert "stays within the norm of 12 people" in within.describe("person1")


def test_without_people_names_units_and_seconds():
    gait, _ = studied(timing=6)
    tables = [pd.DataFrame(x, columns=gait.feature_names) for x in gait.data]
    for x in tables:
        x.attrs["units"] = list(gait.units)
    # Every other frame reaches the synchronizer; times are those of the recordings.
    halved = FunctionTransformer(lambda X: [x.iloc[::2] for x in X])
    sync = make_pipeline(halved, DenseSynchronizer(P)).fit(tables)
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
        ({"groups": ["a", "b"] * 24, "y": ["A", "B"] * 24}, "the same 2 sets of trials apart"),
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
