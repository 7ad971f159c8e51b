"""Action models of trials with gaps: moments, densities, what waits and what is refused."""

import numpy as np
import pandas as pd
import pytest
from scipy.stats import norm
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
from test_similarity import hide

P = 40


def trials(n, seed=0):
    """Synchronised trials of three features, of people who differ in amplitude and offset."""
    rng = np.random.default_rng(seed)
    t = np.linspace(0, 1, P)[:, np.newaxis]
    amplitudes = 1 + 0.1 * rng.standard_normal((n, 1, 3))
    X = amplitudes * np.sin(t * [3, 5, 7]) + 0.1 * rng.standard_normal((n, 1, 3))
    return X + 0.02 * smooth(rng.standard_normal(X.shape), 3)


@pytest.fixture(scope="module")
def gaps():
    return hide(trials(12), share=0.4)


def test_mean_variance_and_share_are_those_of_what_was_seen(gaps):
    model = ActionModel().fit(gaps)
    np.testing.assert_allclose(model.mean_, np.nanmean(gaps, axis=0), rtol=1e-12, atol=1e-14)
    np.testing.assert_allclose(model.variance_, np.nanvar(gaps, axis=0), rtol=1e-10)
    np.testing.assert_array_equal(model.missing_, np.isnan(gaps).mean(axis=0))


def test_density_is_the_marginal_one_of_what_was_seen(gaps):
    model = ActionModel().fit(gaps)
    new = [*hide(trials(5, seed=3), seed=4, share=0.8), *trials(2, seed=3)]
    densities = norm(model.mean_, np.sqrt(model.variance_)).logpdf(new)
    expected = np.nansum(densities, axis=(1, 2))
    np.testing.assert_allclose(model.score_samples(new), expected, rtol=1e-10)
    np.testing.assert_allclose(model.score(new), np.mean(expected), rtol=1e-10)


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


def test_scores_poses_and_samples(gaps):
    model = ActionModel().fit(gaps)
    found = [model.deviations_, model.sample(3, random_state=0), *model.mean_envelope()]
    found += [model.sample(3, frame=5, random_state=0), *model.envelope(simultaneous=True)]
    assert all(np.isfinite(each).all() for each in found)
    mean = model.mean_[7]
    poses = [mean, mean + [0, 9, 0], [np.nan, *mean[1:]], [np.nan, *(mean[1:] + 9)], [np.nan] * 3]
    assert model.accepts(poses, frame=7).tolist() == [True, False, True, False, True]


# -- what is refused ----------------------------------------------------------------------


def test_a_value_that_one_trial_shows_is_refused():
    X = trials(6)
    X[1:, 10:14, 2] = np.nan
    message = "Frame 10, feature 2 was seen in 1 trial, and at least 2 tell how .* 4 values of 120"
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


@pytest.mark.parametrize(
    ("hidden", "expected"),
    [
        (slice(0), [10, 19]),
        # A fault lasts over a gap, and begins and ends in what was seen.
        (slice(13, 16), [10, 19]),
        (slice(10, 16), [16, 19]),
    ],
)
def test_departures_are_those_of_what_was_seen(hidden, expected):
    model, new = ActionModel().fit(trials(10)), trials(1, seed=5)
    new[0, 10:20, 1] += 5
    new[0, hidden, 1] = np.nan
    table = find_departures(model, new)
    runs = table[table["feature"] == "x1"][["first", "last"]].to_numpy().tolist()
    assert [run for run in runs if run[1] == 19] == [expected]


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
