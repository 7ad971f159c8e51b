"""The action model against scipy's distributions and closed forms, with gaps and without."""

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
    SynchronizationWarning,
)
from sklearn_motionsync.datasets import make_bending
from sklearn_motionsync.model import find_departures, similarity
from test_sampling import waves
from test_similarity import hide


@pytest.fixture(scope="module")
def trials():
    return waves()


@pytest.fixture(scope="module")
def model(trials):
    return ActionModel().fit(trials)


@pytest.mark.parametrize("share", [0, 0.4])
def test_moments_and_density_are_those_of_what_was_seen(trials, share):
    """Of trials with gaps it is the marginal density."""
    X = hide(trials, share, length=5)
    model, (mean, std) = ActionModel().fit(X), (np.nanmean(X, axis=0), np.nanstd(X, axis=0))
    np.testing.assert_allclose(model.mean_, mean, rtol=1e-12, atol=1e-14)
    np.testing.assert_allclose(model.variance_, std**2, rtol=1e-10)
    np.testing.assert_array_equal(model.missing_, np.isnan(X).mean(axis=0))
    expected = np.nansum(norm(mean, std).logpdf(X), axis=(1, 2))
    np.testing.assert_allclose(model.score_samples(X), expected)
    np.testing.assert_allclose(model.score(X), expected.mean())
    weighted = model.score(X[:5], sample_weight=[0, 1, 2, 3, 4])
    np.testing.assert_allclose(weighted, np.arange(5) @ expected[:5] / 10)
    with pytest.raises(ValueError, match="inconsistent numbers of samples"):
        model.score(X[:5], sample_weight=[1, 2])


def test_accepts_poses_inside_in_every_feature(model):
    mean, std = model.mean_[4], np.sqrt(model.variance_[4])
    poses = [mean, mean + 2.99 * std, mean - 2.99 * std, mean + [0, 0, 3.01] * std]
    assert model.accepts(poses, 4).tolist() == [True, True, True, False]
    assert model.accepts(np.array(poses), np.int64(4)).dtype == bool


def test_poses_are_compared_in_the_precision_of_the_model(trials):
    """One at the bound is accepted, however many digits it is given with."""
    model = ActionModel().fit(trials.astype("f4"))
    lower, upper = (bound[4].astype("f8") for bound in model.envelope())
    assert model.accepts([lower - 1e-12, upper + 1e-12], 4).all()
    assert not model.accepts([lower - 1e-3, upper + 1e-3], 4).any()


@pytest.mark.parametrize("n_std", [0.3, 3.0])
def test_samples_are_accepted(trials, n_std):
    model = ActionModel(n_std).fit(trials)
    assert model.accepts(model.sample(400, frame=7, random_state=0), 7).all()
    drawn = model.sample(400, random_state=0)
    assert drawn.shape == (400, 15, 3)
    assert (model.predict(drawn) == 1).all()
    np.testing.assert_array_equal(drawn[:1], model.sample(400, random_state=0)[:1])
    assert model.sample(random_state=0).shape == (1, 15, 3)


# -- limits -----------------------------------------------------------------------------


def test_a_constant_feature_does_not_hide_the_others(trials):
    X = trials.copy()
    X[:, :, 1] = 5.0
    model = ActionModel().fit(X)
    assert np.isfinite(model.score_samples(X)).all()
    assert (model.variance_[:, 1] == 0).all()
    # A billionth of the variance of the feature that varies most, over time and trials.
    floor = 1e-9 * max(X[:, :, k].var() for k in range(3))
    std = np.sqrt(np.maximum(X.var(axis=0), floor))
    expected = norm(X.mean(axis=0), std).logpdf(X).sum(axis=(1, 2))
    np.testing.assert_allclose(model.score_samples(X), expected)
    other = X[:1] + [0, 0.5, 0]
    assert model.score_samples(other)[0] < model.score_samples(X).min() - 1e6
    assert not model.accepts(other[0], 0).any()
    # It does not change dissimilarities.
    expected = ActionModel().fit(X[:, :, [0, 2]]).dissimilarity(X[:, :, [0, 2]])
    np.testing.assert_allclose(model.dissimilarity(X), expected, atol=1e-12)
    assert model.accepts(model.sample(5, frame=2, random_state=0), 2).all()


@pytest.mark.parametrize("value", [0.0, 1.0, 1e6])
def test_model_of_identical_trials(value):
    X = [np.full((5, 2), value)] * 3
    model = ActionModel().fit(X)
    assert np.isfinite(model.score_samples(X)).all()
    assert model.predict(X).tolist() == [1, 1, 1]
    np.testing.assert_array_equal(model.sample(2, random_state=0), X[:2])
    assert model.predict([np.full((5, 2), value + 1 + value)]).tolist() == [-1]


@pytest.mark.parametrize(
    ("ask", "message"),
    [
        *((lambda m, f=f: m.accepts([[0.0, 0, 0]], f), "from 0 to 14") for f in (-1, 15, 2.5)),
        *((lambda m, f=f: m.sample(2, frame=f), "from 0 to 14") for f in (-1, 15, "3")),
        (lambda m: m.accepts([0.0, 0, 0], 0), r"poses must have shape \(n_poses, 3\)"),
        (lambda m: m.accepts([[0.0, 0]], 0), r"poses must have shape \(n_poses, 3\)"),
        (lambda m: m.accepts([[np.inf, 0, 0]], 0), "poses, row 0.* infinity"),
        *((lambda m, n=n: m.sample(n), "whole number of samples") for n in (0, -1, 2.5)),
    ],
)
def test_what_is_no_frame_pose_or_number_is_refused(model, ask, message):
    with pytest.raises(ValueError, match=message):
        ask(model)


# -- groups -----------------------------------------------------------------------------


def test_conditions_in_the_place_of_people_are_told():
    X = np.random.default_rng(0).standard_normal((40, 20, 2)).cumsum(axis=1)
    condition, person = ["before", "after"] * 20, np.arange(40) // 4
    with pytest.warns(SynchronizationWarning, match="groups names two people for 40 trials"):
        wide = ActionModel().fit(X, groups=condition)
    assert ActionModel().fit(X, groups=person).threshold_ < wide.threshold_
    with pytest.raises(ValueError, match="the same 2 sets of trials apart as y"):
        ActionModel().fit(X, condition, groups=condition)


# -- gaps -------------------------------------------------------------------------------


def test_without_gaps_nothing_goes_the_other_way(monkeypatch):
    X, names = waves(8), ["fill_with_mean", "group_counts"]
    whole = ActionModel().fit(X)
    for module in ("action_model", "similarity", "variation"):
        for name in names:
            monkeypatch.setattr(f"sklearn_motionsync.model.{module}.{name}", None, raising=False)
    monkeypatch.setattr("sklearn_motionsync.model.action_model.fill_with_mean", lambda x, _: x)
    monkeypatch.delattr(similarity.Neighbours, "_ratios_of_seen")
    again = ActionModel().fit(X)
    assert again.threshold_ == whole.threshold_
    np.testing.assert_array_equal(again.dissimilarity(X), whole.dissimilarity(X))


def test_bands_samples_and_poses_of_trials_with_gaps():
    model = ActionModel().fit(hide(waves(12), share=0.4, length=5))
    found = [model.deviations_, model.sample(3, random_state=0), *model.mean_envelope()]
    found += [model.sample(3, frame=5, random_state=0), *model.envelope(simultaneous=True)]
    assert all(np.isfinite(each).all() for each in found)
    mean = model.mean_[7]
    poses = [mean, mean + [0, 9, 0], [np.nan, *mean[1:]], [np.nan, *(mean[1:] + 9)], [np.nan] * 3]
    assert model.accepts(poses, frame=7).tolist() == [True, False, True, False, True]


def test_a_value_that_one_trial_shows_is_refused():
    X = waves(6)
    X[1:, 10:14, 2] = np.nan
    message = "Frame 10, feature 2 was seen in 1 trial, and at least 2 tell how .* 4 values of 45"
    with pytest.raises(ValueError, match=message):
        ActionModel().fit(X)
    with pytest.raises(ValueError, match=r"Frame 10, feature 2 \('c'\)"):
        ActionModel().fit([pd.DataFrame(x, columns=list("abc")) for x in X])
    X[1, 10:14, 2] = 1
    ActionModel().fit(X)
    with pytest.raises(ValueError, match="seen in 1 group, and"):
        ActionModel().fit(X, groups=[0, 0, 1, 1, 2, 2])


def test_a_value_that_is_not_known_yet_waits_for_others():
    X = waves(6)
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
    X = waves(6)
    model = ActionModel().fit(X)
    X[4] = np.nan
    with pytest.raises(ValueError, match="Trial 4 is NaN in every frame and feature"):
        clone(model).fit(X) if when == "fit" else model.predict(X)


@pytest.mark.parametrize(
    ("hidden", "expected"),
    [
        (slice(0), [4, 11]),
        # A fault lasts over a gap, and begins and ends in what was seen.
        (slice(7, 9), [4, 11]),
        (slice(4, 9), [9, 11]),
    ],
)
def test_departures_are_those_of_what_was_seen(hidden, expected):
    model, new = ActionModel().fit(waves(10)), waves(1, seed=5)
    new[0, 4:12, 1] += 5
    new[0, hidden, 1] = np.nan
    table = find_departures(model, new)
    runs = table[table["feature"] == "x1"][["first", "last"]].to_numpy().tolist()
    assert [run for run in runs if run[1] == 11] == [expected]


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
