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


def slow_moments(means):
    """Mean, and predicted standard deviation, of people (n, P, n_features)."""
    n = len(means)
    others = (means.sum(axis=0) - means) / (n - 1)
    squares = np.square(means - others).mean(axis=0)
    variance = ((n - 1) * squares + 20 * squares.mean(axis=0)) / (n + 19) * (1 + 1 / n)
    floor = 1e-9 * means.var(axis=(0, 1))
    # An offset of linear normalisation never varies.
    return means.mean(axis=0), np.sqrt(
        np.maximum(variance, np.where(floor > 0, floor, floor.max()))
    )


def slow_gains(means, curve, context, columns, width):
    """Gains and heights of bumps, by the inverse covariance: dicts by centre and column."""
    mean, std = slow_moments(means)
    frames = [round(x) for x in np.linspace(0, P - 1, 34)]
    z, known = ((x - mean)[..., frames, context] / std[frames, context] for x in (curve, means))
    known = known.reshape(len(means), -1)
    covariance = 0.5 * known.T @ known / (len(means) - 1) + 0.5 * np.eye(known.shape[1])
    gains, heights = {}, {}
    for centre in np.linspace(0, P - 1, round(1 / width) + 1):
        for k in columns:
            bump = np.zeros_like(std)
            bump[:, k] = np.exp(-0.5 * ((np.arange(P) - centre) / (width * (P - 1))) ** 2)
            bump = (bump / std)[frames, context].ravel()
            weighed = np.linalg.solve(covariance, bump)
            heights[centre, k] = weighed @ z.ravel() / (weighed @ bump)
            gains[centre, k] = heights[centre, k] * np.sqrt(weighed @ bump)
    return gains, heights


def slow_bumps(means, curve):
    """Those of the signals, and of the offset beside the signals."""
    last = means.shape[2] - 1
    of_signals = slow_gains(means, curve, slice(0, last), range(last), 0.1)
    return of_signals, slow_gains(means, curve, slice(None), [last], 0.2)


def slow_measures(means, curve):
    """Of the shape, of its bumps, of the timing, and of its bumps."""
    mean, std = slow_moments(means)
    z = np.abs((curve - mean) / std)
    of_signals, of_offset = (max(map(abs, gains.values())) for gains, _ in slow_bumps(means, curve))
    return [z[:, :-1].max(), of_signals, z[:, -1].max(), of_offset]


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

    trials = {p: everything[person == p] for p in people}
    means = np.array([trials[p].mean(axis=0) for p in norm])
    np.testing.assert_allclose((found.mean, found.std), slow_moments(means))

    def of_new_person(values, weights, prior):
        """Mean, and scale of a new value."""
        mean, n = np.average(values, axis=0, weights=weights), len(norm)
        variance = np.average((values - mean) ** 2, axis=0, weights=weights)
        return mean, np.sqrt((variance * n + 3 * prior) / (n + 2) * (1 + 1 / n))

    for k in set(counts):
        logs, weights = [], []
        for i, p in enumerate(norm):
            m = len(trials[p])
            for first in range(m):
                some = [trials[p][(first + j) % m] for j in range(min(k, m))]
                others = np.delete(means, i, axis=0)
                logs.append(np.log(slow_measures(others, np.mean(some, axis=0))))
                weights.append(1 / m)
        middle, scale = of_new_person(np.array(logs), weights, 0.1)
        held_out = (logs - middle) / scale
        for i in np.flatnonzero(counts == k):
            curve = trials[counts.index[i]].mean(axis=0)
            np.testing.assert_allclose(found.curves[i], curve)
            new = (np.log(slow_measures(means, curve)) - middle) / scale
            for name, chosen in (
                ("p", slice(None)), ("p_shape", slice(0, 2)), ("p_timing", slice(2, 4))
            ):  # fmt: skip
                mean, width = of_new_person(held_out[:, chosen].max(axis=1), weights, 0.7)
                p = stats.t.sf((new[chosen].max() - mean) / width, len(norm) + 2)
                assert found.verdicts[name].iloc[i] == pytest.approx(p, rel=1e-6)
                if name == "p":
                    largest = mean + stats.t.ppf(0.95, len(norm) + 2) * width
            limits = np.exp(middle + largest * scale)[[0, 0, 2]]
            np.testing.assert_allclose(found.limits[i], limits)
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
        X = np.random.default_rng(0).standard_normal((6, P, 9)).cumsum(axis=1)
        X[4:] *= 4
        sync = LinearSynchronizer(P).fit(X)
        y, groups = np.array([*"nnnpqq"]), np.arange(6)
        found = compare_to_norm(sync, X, y, norm="n", level=0.9, unit="frames")
    else:
        gait, sync = late if study == "late" else studied(amplitude=-25 * (study == "weak"))
        X, y, groups = gait.data, gait.group, gait.person
        found = compared(gait, sync, level=0.3)
    match = Match.from_estimator(sync, X)
    everything = np.concatenate(
        [match.warp(X), match.offsets_in(found.unit)[..., np.newaxis]], axis=2
    )
    of_norm = [everything[groups == g].mean(axis=0) for g in dict.fromkeys(groups[y == y[0]])]
    rows, last = [], len(found.features) - 1
    for i, (subject, curves) in enumerate(zip(found.verdicts.index, found.curves, strict=True)):
        of_subject, z = [], (curves - found.mean) / found.std
        bumps = slow_bumps(np.array(of_norm), curves)
        for k in range(last + 1):
            limit, size = found.limits[i, k], np.abs(z[:, k])
            for _, frames in groupby(range(P), key=lambda f: size[f] > limit / 2):
                frames = list(frames)
                beyond = [f for f in frames if size[f] > limit]
                if beyond:
                    peak = frames[size[frames].argmax()]
                    ends = beyond[0], beyond[-1]
                    of_subject.append((size[peak] / limit, k, *ends, peak, z[peak, k]))
            gains, heights = ({c: v for (c, j), v in x.items() if j == k} for x in bumps[k == last])
            centre = max(gains, key=lambda c: abs(gains[c]))
            peak, half = round(centre), np.sqrt(2 * np.log(2)) * (0.1 + 0.1 * (k == last)) * (P - 1)
            first, end = round(max(centre - half, 0)), round(min(centre + half, P - 1))
            excess = abs(gains[centre]) / found.limits_of_bumps[i, int(k == last)]
            is_told = any(row[1] == k and row[2] <= end and first <= row[3] for row in of_subject)
            if excess > 1 and not is_told:
                deviation = heights[centre] / found.std[peak, k]
                of_subject.append((excess, k, first, end, peak, deviation))
        for _, k, first, end, peak, deviation in sorted(of_subject, reverse=True)[:5]:
            words = ("later", "earlier") if k == last else ("above", "below")
            row = [subject, "timing" if k == last else "shape", found.features[k]]
            row += [found.clock[f] for f in (first, end, peak)]
            row += [words[int(deviation < 0)], deviation * found.std[peak, k]]
            rows.append([*row, found.units[k], deviation])
        row = found.verdicts.iloc[i]
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
