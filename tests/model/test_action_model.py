"""The action model against scipy's distributions and closed forms."""

import numpy as np
import pytest
from scipy.stats import norm
from sklearn_motionsync import ActionModel, SynchronizationWarning


@pytest.fixture(scope="module")
def trials():
    """200 trials of 15 frames x 3 features, smooth, of unequal variance."""
    rng = np.random.default_rng(0)
    t = np.linspace(0, 1, 15)
    shapes = np.stack([np.ones_like(t), t, t**2])
    weights = rng.standard_normal((200, 3, 3)) * [[[1.0], [0.5], [0.2]]]
    return np.sin(3 * t)[:, None] + np.einsum("npk,kt->ntp", weights, shapes)


@pytest.fixture(scope="module")
def model(trials):
    return ActionModel().fit(trials)


def test_density_equals_that_of_normal_distributions(model, trials):
    densities = norm(trials.mean(axis=0), trials.std(axis=0)).logpdf(trials)
    expected = densities.sum(axis=(1, 2))
    np.testing.assert_allclose(model.score_samples(trials), expected)
    np.testing.assert_allclose(model.score(trials), expected.mean())
    weighted = model.score(trials[:5], sample_weight=[0, 1, 2, 3, 4])
    np.testing.assert_allclose(weighted, np.arange(5) @ expected[:5] / 10)
    with pytest.raises(ValueError, match="inconsistent numbers of samples"):
        model.score(trials[:5], sample_weight=[1, 2])


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


@pytest.mark.parametrize("scale", [1e-6, 1e6])
def test_the_unit_of_the_features_changes_nothing(trials, scale):
    """Densities change by the Jacobian, decisions do not; also of identical trials."""
    same = np.repeat(trials[:1], 4, axis=0)
    for X in (trials, same):
        model, other = ActionModel().fit(X), ActionModel().fit(scale * X)
        new = X[:3] + [[[0.0]], [[0.1]], [[5.0]]]
        change = X[0].size * np.log(scale)
        expected = model.score_samples(new) - change
        np.testing.assert_allclose(other.score_samples(scale * new), expected, rtol=1e-6)
        np.testing.assert_array_equal(other.predict(scale * new), model.predict(new))
    assert model.predict(new).tolist() == [1, -1, -1]


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
