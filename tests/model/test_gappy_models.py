"""Action models of trials with gaps, against marginal distributions and plain loops."""

import numpy as np
import pandas as pd
import pytest
from scipy import stats
from sklearn import clone
from sklearn.exceptions import NotFittedError
from sklearn.pipeline import make_pipeline
from sklearn_motionsync import (
    ActionModel,
    ASpace,
    DenseSynchronizer,
    DirectionCosines,
)
from sklearn_motionsync.datasets import make_bending
from sklearn_motionsync.matching.filters import smooth
from sklearn_motionsync.model import find_departures, similarity
from sklearn_motionsync.model.variation import mean_band, predictive_variance
from test_similarity import slow_weights

P = 40


def trials(n, seed=0, people=None):
    """Synchronised trials of three features; people differ in amplitude and offset."""
    rng = np.random.default_rng(seed)
    t = np.linspace(0, 1, P)[:, np.newaxis]
    codes = np.arange(n) if people is None else people
    own = 1 + 0.1 * rng.standard_normal((codes.max() + 1, 3))
    offset = 0.1 * rng.standard_normal((codes.max() + 1, 3))
    base = np.sin(t * [3, 5, 7])
    X = own[codes][:, np.newaxis] * base + offset[codes][:, np.newaxis]
    return X + 0.02 * smooth(rng.standard_normal(X.shape), 3)


def hide(X, seed=0, share=0.3, length=12):
    """Copies: a feature of every third trial or so is hidden for a while."""
    rng, X = np.random.default_rng(seed), X.copy()
    for x in X:
        for k in range(X.shape[2]):
            if rng.random() < share:
                start = rng.integers(0, P - length)
                x[start : start + length, k] = np.nan
    return X


@pytest.fixture(scope="module")
def gaps():
    return hide(trials(12), share=0.4)


# -- moments, density ---------------------------------------------------------------------


def test_mean_variance_and_share_are_those_of_what_was_seen(gaps):
    model = ActionModel().fit(gaps)
    np.testing.assert_allclose(model.mean_, np.nanmean(gaps, axis=0), rtol=1e-12, atol=1e-14)
    np.testing.assert_allclose(model.variance_, np.nanvar(gaps, axis=0), rtol=1e-10)
    np.testing.assert_array_equal(model.missing_, np.isnan(gaps).mean(axis=0))


def test_density_is_the_marginal_one_of_what_was_seen(gaps):
    model = ActionModel().fit(gaps)
    new = hide(trials(5, seed=3), seed=4, share=0.8)
    mean, variance = model.mean_.ravel(), model.variance_.ravel()
    expected = []
    for x in new.reshape(5, -1):
        seen = np.flatnonzero(~np.isnan(x))
        marginal = stats.multivariate_normal(mean[seen], np.diag(variance[seen]))
        expected.append(marginal.logpdf(x[seen]))
    np.testing.assert_allclose(model.score_samples(new), expected, rtol=1e-10)
    np.testing.assert_allclose(model.score(new), np.mean(expected), rtol=1e-10)
    # Others of the same call are as without gaps.
    whole = trials(2, seed=3)
    alone = model.score_samples(whole)
    np.testing.assert_array_equal(model.score_samples([*whole, new[0]])[:2], alone)


def test_without_gaps_nothing_goes_the_other_way(monkeypatch):
    X = trials(8)
    whole = ActionModel().fit(X)
    names = ["fill_with_mean", "group_counts"]
    for module in ("action_model", "similarity", "variation"):
        for name in names:
            monkeypatch.setattr(f"sklearn_motionsync.model.{module}.{name}", None, raising=False)
    monkeypatch.setattr("sklearn_motionsync.model.action_model.fill_with_mean", lambda x, _: x)
    monkeypatch.delattr(similarity.Neighbours, "_ratios_of_seen")
    again = ActionModel().fit(X)
    assert again.threshold_ == whole.threshold_
    np.testing.assert_array_equal(again.missing_, np.zeros((P, 3)))
    np.testing.assert_array_equal(again.dissimilarity(X), whole.dissimilarity(X))


def test_with_nearly_nothing_missing_results_are_nearly_those_without():
    """The way of gaps and the plain way are one: a value is hidden that hardly matters."""
    X = trials(12)
    gap = X.copy()
    gap[3, 17, 1] = np.nan
    a, b = ActionModel().fit(X), ActionModel().fit(gap)
    for name in ("mean_", "variance_", "predictive_variance_"):
        np.testing.assert_allclose(getattr(a, name), getattr(b, name), rtol=0.2, atol=0.01)
        others = np.ones((P, 3), dtype=bool)
        others[17, 1] = False
        if name != "predictive_variance_":
            np.testing.assert_array_equal(getattr(a, name)[others], getattr(b, name)[others])
    np.testing.assert_allclose(a.dissimilarities_, b.dissimilarities_, rtol=0.02)
    np.testing.assert_allclose(a.threshold_, b.threshold_, rtol=0.02)
    np.testing.assert_allclose(a.simultaneous_factor(), b.simultaneous_factor(), rtol=0.05)
    widths = [upper - lower for lower, upper in (a.mean_envelope(), b.mean_envelope())]
    np.testing.assert_allclose(*widths, rtol=0.1)


# -- variances and bands ------------------------------------------------------------------


def slow_predictive_variance(X, groups):
    squares = np.full((P, 3), np.nan)
    n = np.zeros((P, 3))
    for p in range(P):
        for k in range(3):
            found = []
            for i in range(len(X)):
                others = X[groups != groups[i], p, k]
                if not np.isnan(X[i, p, k]) and not np.isnan(others).all():
                    found.append((X[i, p, k] - np.nanmean(others)) ** 2)
            squares[p, k], n[p, k] = np.mean(found), len(found)
    shrunk = ((n - 1) * squares + 5 * squares.mean(axis=0)) / (n + 4)
    return shrunk * (1 + 1 / n)


@pytest.mark.parametrize("people", [None, np.arange(12) // 2])
def test_predictive_variance_leaves_groups_out_value_by_value(people):
    X = hide(trials(12, people=people), share=0.4)
    groups = np.arange(12) if people is None else people
    np.testing.assert_allclose(
        predictive_variance(X, groups), slow_predictive_variance(X, groups), rtol=1e-10
    )


def test_bands_of_the_mean_hold_it_and_are_wider_where_few_were_seen():
    truth = trials(4000, seed=99).mean(axis=0)
    held = []
    for seed in range(20):
        X = trials(8, seed=seed)
        X[:5, 10:20, 1] = np.nan
        half = mean_band(X, np.arange(8), 0.9, 0)
        held.append((np.abs(np.nanmean(X, axis=0) - truth) <= half).all())
    assert np.mean(held) >= 0.75
    assert half[10:20, 1].mean() > 1.2 * np.delete(half[:, 1], range(10, 20)).mean()


# -- dissimilarity ------------------------------------------------------------------------


def slow_dissimilarity(y, known, mean):
    """Of one trial to each known one: sums over what was seen of both, frame by frame."""

    def fill(x):
        x = pd.DataFrame(x - mean).interpolate(limit_direction="both").fillna(0).to_numpy()
        return x + mean

    scale, weight = slow_weights([fill(x) for x in known], range(len(known)))
    found = []
    for other in known:
        both = ~np.isnan(y) & ~np.isnan(other)
        a, b = scale * fill(y), scale * fill(other)
        size = np.square(a - a.mean(axis=0))[both].sum() + np.square(b - b.mean(axis=0))[both].sum()
        apart = np.square(a - a.mean(axis=0) - (b - b.mean(axis=0)))[both].sum()
        apart += weight * (both.sum(axis=0) * np.square(a.mean(axis=0) - b.mean(axis=0))).sum()
        va, vb = (smooth(x[np.newaxis], 0.01 * (P - 1), order=1)[0] for x in (a, b))
        fast = np.square(va)[both].sum() + np.square(vb)[both].sum()
        found.append((apart / size + np.square(va - vb)[both].sum() / fast) / 2)
    return np.sort(found)[:3].mean()


def test_dissimilarity_compares_what_was_seen_of_both(gaps):
    model = ActionModel().fit(gaps)
    new = [*hide(trials(4, seed=3), seed=4, share=0.8), *trials(2, seed=8)]
    expected = [slow_dissimilarity(y, gaps, model.mean_) for y in new]
    np.testing.assert_allclose(model.dissimilarity(new), expected, rtol=1e-9)
    # A model that was fitted without gaps.
    whole = ActionModel().fit(trials(12))
    expected = [slow_dissimilarity(y, trials(12), whole.mean_) for y in new]
    np.testing.assert_allclose(whole.dissimilarity(new), expected, rtol=1e-9)
    np.testing.assert_array_equal(whole.dissimilarity(new)[4:], whole.dissimilarity(new[4:]))


def test_gaps_neither_accept_nor_reject():
    """Of new people, as many are accepted with gaps; what is another movement stays refused."""
    accepted = {"whole": [], "gaps": [], "backwards": [], "still": []}
    for seed in range(6):
        X = trials(30, seed=seed)
        model = ActionModel(coverage=0.9).fit(hide(X[:10], seed=seed))
        new = X[10:]
        kinds = {
            "whole": new,
            "gaps": hide(new, seed=50 + seed),
            "backwards": hide(new[:, ::-1], seed=50 + seed),
            "still": hide(np.repeat(new[:, :1], P, axis=1), seed=50 + seed),
        }
        for name, some in kinds.items():
            accepted[name].append((model.predict(some) == 1).mean())
    shares = {name: np.mean(found) for name, found in accepted.items()}
    assert 0.85 < shares["whole"] < 0.97
    assert abs(shares["gaps"] - shares["whole"]) < 0.05
    assert shares["backwards"] == shares["still"] == 0


def test_one_path_a_trial(gaps):
    model = ActionModel().fit(gaps)
    together = model.dissimilarity(gaps)
    for x, value in zip(gaps, together, strict=True):
        assert model.dissimilarity([x])[0] == value


# -- the rest of the interface ------------------------------------------------------------


def test_scores_poses_and_samples(gaps):
    model = ActionModel().fit(gaps)
    assert np.isfinite(model.deviations_).all()
    assert np.isfinite(model.sample(3, random_state=0)).all()
    assert np.isfinite(model.sample(3, frame=5, random_state=0)).all()
    assert all(np.isfinite(band).all() for band in model.envelope(simultaneous=True))
    mean = model.mean_[7]
    poses = [
        mean,
        mean + [0, 9, 0],
        [np.nan, *mean[1:]],
        [np.nan, *(mean[1:] + 9)],
        [np.nan] * 3,
    ]
    assert model.accepts(poses, frame=7).tolist() == [True, False, True, False, True]


def test_portions_give_the_same_to_the_last_bit(gaps):
    whole, parts = ActionModel().fit(gaps), ActionModel()
    for portion in (gaps[:1], gaps[1:5], gaps[5:]):
        parts.partial_fit(portion)
    for name in ("mean_", "variance_", "predictive_variance_", "missing_", "deviations_"):
        np.testing.assert_array_equal(getattr(parts, name), getattr(whole, name))
    np.testing.assert_allclose(parts.threshold_, whole.threshold_, rtol=1e-12)


# -- what is refused ----------------------------------------------------------------------


def test_a_value_that_one_trial_shows_is_refused():
    X = trials(6)
    X[1:, 10:14, 2] = np.nan
    message = (
        "Frame 10, feature 2 was seen in 1 trial, and at least 2 tell how it varies: "
        "4 values of 120 are so"
    )
    with pytest.raises(ValueError, match=message):
        ActionModel().fit(X)
    with pytest.raises(ValueError, match=r"Frame 10, feature 2 \('c'\)"):
        ActionModel().fit([pd.DataFrame(x, columns=list("abc")) for x in X])
    X[1, 10:14, 2] = 1
    ActionModel().fit(X)
    with pytest.raises(ValueError, match="seen in 1 group, and"):
        ActionModel().fit(X, groups=[0, 0, 1, 1, 2, 2])


def test_a_value_that_is_not_known_yet_waits_for_others():
    X = trials(6)
    X[:3, 10:14, 2] = np.nan
    model = ActionModel().partial_fit(X[:3])
    assert np.isnan(model.mean_[10:14, 2]).all()
    assert np.isfinite(np.delete(model.mean_[:, 2], range(10, 14))).all()
    with pytest.raises(NotFittedError, match=r"was seen in 0 trials.*Give others to partial_fit"):
        model.predict(X)
    model.partial_fit(X[3:])
    assert model.predict(X).shape == (6,)
    np.testing.assert_array_equal(model.mean_, ActionModel().fit(X).mean_)


@pytest.mark.parametrize("when", ["fit", "after"])
def test_a_trial_that_shows_nothing_is_refused(when):
    X = trials(6)
    model = ActionModel().fit(X)
    X[4] = np.nan
    with pytest.raises(ValueError, match="Trial 4 is NaN in every frame and feature"):
        clone(model).fit(X) if when == "fit" else model.predict(X)


# -- departures ---------------------------------------------------------------------------


def test_departures_are_those_of_what_was_seen():
    X = trials(10)
    model = ActionModel().fit(X)
    new = trials(3, seed=5)
    new[1, 10:20, 1] += 5
    new[2, 10:20, 1] += 5
    new[2, 13:16, 1] = np.nan
    table = find_departures(model, new)
    runs = table[table["feature"] == "x1"][["trial", "first", "last"]].to_numpy().tolist()
    assert [1, 10, 19] in runs
    # A fault lasts over a gap, and begins and ends in what was seen.
    assert [2, 10, 19] in runs
    new[2, 10:13, 1] = np.nan
    table = find_departures(model, new)
    runs = table[table["feature"] == "x1"][["trial", "first", "last"]].to_numpy().tolist()
    assert [2, 16, 19] in runs
    assert [2, 10, 19] not in runs


def test_departures_of_a_pipeline_are_those_of_limbs_that_were_seen():
    """The aSpace expects a hidden arm; a departure is nevertheless only where it was seen."""
    bunch = make_bending(12, random_state=0)
    cosines = DirectionCosines(bunch.skeleton, hidden="nan")
    pipe = make_pipeline(cosines, ASpace(0.95), DenseSynchronizer(30), ActionModel())
    pipe.fit(bunch.data)
    wrist = 3 * bunch.skeleton.index_of("right_wrist")
    new = bunch.data[2].copy()
    new[40:70, wrist : wrist + 3] += [0.6, 0.3, 0]
    assert find_departures(pipe, [new])["feature"].str.startswith("right_forearm").any()
    new[35:75, wrist : wrist + 3] = np.nan
    table = find_departures(pipe, [new])
    assert not table["feature"].str.startswith("right_forearm").any()
