"""Good trials of the person as the reference: against loops, on made people and on real ones."""

import numpy as np
import pytest
from sklearn.pipeline import make_pipeline
from sklearn_motionsync import (
    ActionDetector,
    ActionModel,
    ASpace,
    DenseSynchronizer,
    DirectionCosines,
    Match,
)
from sklearn_motionsync.model.similarity import PersonalReference
from test_similarity import slow_ratio, slow_threshold, slow_weights
from test_variation import slow_within

P = 40


def people(n_people, n_times, seed=0, style=0.5, repeat=0.05):
    """Trials of people with a style, who repeat themselves nearly; (n, P, 2), and who."""
    rng = np.random.default_rng(seed)
    t = np.linspace(0, 1, P)
    base = np.stack([np.sin(2 * np.pi * t), np.cos(3 * t)], axis=1)
    parts = np.stack([np.ones(P), t, t**2, np.sin(4 * np.pi * t)], axis=1)

    def drawn(size, n):
        return size * np.einsum("tk,nkf->ntf", parts, rng.standard_normal((n, 4, 2)))

    styles = np.repeat(drawn(style, n_people), n_times, axis=0)
    return base + styles + drawn(repeat, n_people * n_times), np.repeat(range(n_people), n_times)


X, GROUPS = people(6, 5)
NEW, PERSONS = people(4, 8, seed=1)


def slow_factors(X, groups, m):
    """Between over between and within over m, of each feature; variances are means over frames."""
    within, people = slow_within(X, groups).mean(axis=0), [X[groups == g] for g in set(groups)]
    between = np.var([x.mean(0) for x in people], axis=0, ddof=1).mean(0)
    between = np.maximum(between - within * np.mean([1 / len(x) for x in people]), 0)
    return between / (between + within / m)


@pytest.mark.parametrize("m", [1, 3])
def test_dissimilarity_and_threshold_equal_slow_loops(m):
    own, new = NEW[PERSONS == 2][:m], NEW[PERSONS == 2][m:]
    person = PersonalReference(X, GROUPS, X.mean(axis=0), own)
    weights, factors = slow_weights(X, GROUPS, within=True), slow_factors(X, GROUPS, m)

    def moved(some, mean):
        return some + (factors - 1) * (some.mean(axis=0) - mean)

    def nearest(y, some, mean):
        return min(slow_ratio(y, z, weights) for z in moved(some, mean))

    expected = [nearest(y, own, X.mean(axis=0)) for y in new]
    np.testing.assert_allclose(person.dissimilarity(new), expected, rtol=1e-9)
    left = []
    for i, y in enumerate(X):
        others = [5 * (i // 5) + (i + k) % 5 for k in range(1, m + 1)]
        left.append(nearest(y, X[others], X[GROUPS[i] != GROUPS].mean(axis=0)))
    np.testing.assert_allclose(person.limit(0.9), slow_threshold(left, 0.9), rtol=1e-8)


def test_gaps_and_other_trials_change_nothing_else():
    own = NEW[PERSONS == 1].copy()
    person = PersonalReference(X, GROUPS, X.mean(axis=0), own[:3])
    together = person.dissimilarity(own[3:])
    for y, value in zip(own[3:], together, strict=True):
        assert person.dissimilarity(y[np.newaxis])[0] == value
    own[0, 10:12, 1] = np.nan
    gappy = PersonalReference(X, GROUPS, X.mean(axis=0), own[:3])
    np.testing.assert_allclose(gappy.dissimilarity(own[3:]), together, rtol=0.2)


def test_a_reference_needs_people_who_come_twice():
    pipe = make_pipeline(DenseSynchronizer(30), ActionModel())
    detector = ActionDetector(pipe).fit(raw(X[::5]), groups=GROUPS[::5])
    for ask in (detector.predict, detector.report, detector.decision_function):
        with pytest.raises(ValueError, match="no group of the training set has two trials"):
            ask(raw(X), reference=raw(NEW[:2]))


def test_people_with_one_trial_are_left_out_of_the_limit():
    rows = [0, *range(5, 30)]
    known = PersonalReference(X[rows], GROUPS[rows], X[rows].mean(axis=0), NEW[:2])
    assert np.isnan(known.held_out[0])
    assert known.moments.n == 25


# -- the detector -------------------------------------------------------------------------


def raw(some, seed=0):
    """Of different lengths."""
    rng = np.random.default_rng(seed)
    t, n = np.linspace(0, 1, P), rng.integers(36, 46, len(some))
    return [
        np.column_stack([np.interp(np.linspace(0, 1, k), t, column) for column in x.T])
        for k, x in zip(n, some, strict=True)
    ]


def test_a_detector_takes_a_reference_as_it_was_recorded():
    pipe = make_pipeline(ASpace(2), DenseSynchronizer(30), ActionModel())
    detector = ActionDetector(pipe).fit(raw(X), groups=GROUPS)
    mine = NEW[PERSONS == 1]
    bent = mine[3:] + 0.4 * np.sin(np.linspace(0, 6 * np.pi, P))[:, np.newaxis]
    good, new = raw(mine[:3], 6), raw([*mine[3:], *bent], 5)
    report = detector.report(new, reference=good)
    assert list(report.columns)[:3] == ["movement", "own", "course"]
    assert (report["reason"][:5] == "").sum() >= 4
    assert report["reason"][5:].str.contains("unlike the reference").all()
    predicted = detector.predict(new, reference=good)
    np.testing.assert_array_equal(predicted, np.where(report["reason"] == "", 1, -1))
    # The statistic is that of the poses, with the limit of its share.
    curves, own, warped = (
        Match.from_estimator(detector.estimator_, some).warp(some) for some in (raw(X), good, new)
    )
    curves, own, warped = map(np.stack, (curves, own, warped))
    person = PersonalReference(curves, GROUPS, curves.mean(axis=0), own)
    unlike = person.dissimilarity(warped) / person.limit(1 - 0.05 / 4)
    np.testing.assert_allclose(report["own"], unlike, rtol=1e-8)


# -- exercises of people ------------------------------------------------------------------


@pytest.mark.filterwarnings("ignore::sklearn_motionsync.TrialWarning")
def test_exercises_of_people_done_right_and_wrong(benchmark, real_data):
    """A person held out; shoulder rotation, where people differ more than right from wrong."""
    markers, table, skeleton = benchmark("exercises").read_positions(real_data)
    rows = table[table["label"] == "shoulder rotation"]
    poses = DirectionCosines(skeleton).fit_transform([markers[i] for i in rows.index])
    people, correct, takes = (rows[name].to_numpy() for name in ("actor", "correct", "take"))
    train = np.flatnonzero((people != "s03") & correct & (takes % 2 == 1))
    mine = np.flatnonzero(people == "s03")
    right, rest = mine[correct[mine]][:3], np.setdiff1d(mine, mine[correct[mine]][:3])

    def trials(rows):
        return [poses[i] for i in rows]

    pipe = make_pipeline(ASpace(0.95), DenseSynchronizer(40), ActionModel())
    detector = ActionDetector(pipe).fit(trials(train), groups=people[train])
    accepted_by = [
        detector.predict(trials(rest), reference) == 1 for reference in (None, trials(right))
    ]
    is_right = correct[rest]
    assert all(accepted[is_right].all() for accepted in accepted_by)
    of_others, of_own = (accepted[~is_right].mean() for accepted in accepted_by)
    assert of_own < 0.3 < of_others
