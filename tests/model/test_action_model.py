"""The action model against scipy's distributions and closed forms."""

import numpy as np
import pytest
from scipy.stats import norm, truncnorm
from sklearn_motionsync import ActionModel


@pytest.fixture(scope="module")
def performances():
    """200 performances of 15 frames x 3 features, smooth, of unequal variance."""
    rng = np.random.default_rng(0)
    t = np.linspace(0, 1, 15)
    shapes = np.stack([np.ones_like(t), t, t**2])
    weights = rng.standard_normal((200, 3, 3)) * [[[1.0], [0.5], [0.2]]]
    return np.sin(3 * t)[:, None] + np.einsum("npk,kt->ntp", weights, shapes)


@pytest.fixture(scope="module")
def model(performances):
    return ActionModel().fit(performances)


def test_mean_and_variance(model, performances):
    np.testing.assert_allclose(model.mean_, performances.mean(axis=0))
    np.testing.assert_allclose(model.variance_, performances.var(axis=0))
    lower, upper = model.envelope()
    np.testing.assert_allclose(upper - lower, 6 * performances.std(axis=0))
    np.testing.assert_allclose((upper + lower) / 2, model.mean_)


def test_density_is_that_of_normal_distributions(model, performances):
    expected = norm(performances.mean(axis=0), performances.std(axis=0)).logpdf(performances)
    np.testing.assert_allclose(model.score_samples(performances), expected.sum(axis=(1, 2)))
    np.testing.assert_allclose(model.score(performances), expected.sum(axis=(1, 2)).mean())


def test_accepts_what_is_inside_in_every_feature(model):
    mean, std = model.mean_[4], np.sqrt(model.variance_[4])
    postures = [mean, mean + 2.99 * std, mean - 2.99 * std, mean + [0, 0, 3.01] * std]
    assert model.accepts(postures, 4).tolist() == [True, True, True, False]
    assert model.accepts(np.array(postures), np.int64(4)).dtype == bool


# -- sampling ---------------------------------------------------------------------------


def test_a_score_counts_performances_by_their_weight(model, performances):
    weights = np.arange(5.0)
    expected = (weights * model.score_samples(performances[:5])).sum() / weights.sum()
    np.testing.assert_allclose(model.score(performances[:5], sample_weight=weights), expected)
    with pytest.raises(ValueError, match="inconsistent numbers of samples"):
        model.score(performances[:5], sample_weight=[1, 2])


@pytest.mark.parametrize("n_std", [0.3, 1.5, 3.0])
def test_sampled_postures_are_accepted_and_cut_off_normal(performances, n_std):
    model = ActionModel(n_std).fit(performances)
    postures = model.sample(4000, frame=7, random_state=0)
    assert postures.shape == (4000, 3)
    assert model.accepts(postures, 7).all()
    std = np.sqrt(model.variance_[7])
    expected = std * truncnorm(-n_std, n_std).std()
    np.testing.assert_allclose(postures.std(axis=0), expected, rtol=0.05)
    np.testing.assert_allclose(postures.mean(axis=0), model.mean_[7], atol=0.06 * std.max())


def test_sampled_performances_vary_like_the_training_ones(model, performances):
    drawn = model.sample(5000, random_state=0)
    assert drawn.shape == (5000, 15, 3)
    assert (model.predict(drawn) == 1).all()
    np.testing.assert_allclose(drawn.var(axis=0), model.variance_, rtol=0.1)
    # As smooth as people are: frame to frame changes as large as in the training set.
    steps = [np.diff(x, axis=1).std() for x in (drawn - model.mean_, performances - model.mean_)]
    np.testing.assert_allclose(*steps, rtol=0.1)


@pytest.mark.parametrize("n_std", [0.01, 0.5])
def test_a_narrow_model_still_samples_inside(performances, n_std):
    model = ActionModel(n_std).fit(performances)
    assert (model.predict(model.sample(50, random_state=0)) == 1).all()


def test_sampling_repeats_with_its_random_state(model):
    for frame in (None, 3):
        a = model.sample(5, frame=frame, random_state=4)
        np.testing.assert_array_equal(a, model.sample(5, frame=frame, random_state=4))
        assert not np.array_equal(a, model.sample(5, frame=frame, random_state=5))
    assert model.sample(random_state=0).shape == (1, 15, 3)


def test_rows_are_univariate_performances(performances):
    rows = performances[:, :, 0]
    model = ActionModel().fit(rows)
    assert model.mean_.shape == (15, 1)
    assert model.sample(4, random_state=0).shape == (4, 15)
    columns = ActionModel().fit(performances[:, :, :1])
    expected = columns.score_samples(performances[:, :, :1])
    np.testing.assert_array_equal(model.score_samples(rows), expected)


# -- limits -----------------------------------------------------------------------------


def test_a_feature_in_which_nobody_differs(performances):
    """It must neither divide by zero nor hide the others."""
    X = performances.copy()
    X[:, :, 1] = 5.0
    model = ActionModel().fit(X)
    assert np.isfinite(model.score_samples(X)).all()
    assert (model.variance_[:, 1] == 0).all()
    # A billionth of the variance of the feature that varies most, over time and performances.
    floor = 1e-9 * max(X[:, :, k].var() for k in range(3))
    std = np.sqrt(np.maximum(X.var(axis=0), floor))
    expected = norm(X.mean(axis=0), std).logpdf(X).sum(axis=(1, 2))
    np.testing.assert_allclose(model.score_samples(X), expected)
    other = X[:1] + [0, 0.5, 0]
    assert model.score_samples(other)[0] < model.score_samples(X).min() - 1e6
    assert not model.accepts(other[0], 0).any()
    # It takes no part in what is alike.
    alike = ActionModel().fit(X[:, :, [0, 2]]).dissimilarity(X[:, :, [0, 2]])
    np.testing.assert_allclose(model.dissimilarity(X), alike, atol=1e-12)
    assert model.accepts(model.sample(5, frame=2, random_state=0), 2).all()


@pytest.mark.parametrize("scale", [1e-6, 1e-3, 1e3, 1e6])
def test_the_unit_of_the_features_changes_nothing(performances, scale):
    """Densities are those of the other unit; also where nobody differs, by the movement itself."""
    same = np.repeat(performances[:1], 4, axis=0)
    for X in (performances, same):
        model, other = ActionModel().fit(X), ActionModel().fit(scale * X)
        new = X[:3] + [[[0.0]], [[0.1]], [[5.0]]]
        change = X[0].size * np.log(scale)
        expected = model.score_samples(new) - change
        np.testing.assert_allclose(other.score_samples(scale * new), expected, rtol=1e-6)
        np.testing.assert_array_equal(other.predict(scale * new), model.predict(new))
    assert model.predict(new).tolist() == [1, -1, -1]


@pytest.mark.parametrize("value", [0.0, 1.0, 1e6])
def test_identical_performances(value):
    X = [np.full((5, 2), value)] * 3
    model = ActionModel().fit(X)
    assert np.isfinite(model.score_samples(X)).all()
    assert model.predict(X).tolist() == [1, 1, 1]
    np.testing.assert_array_equal(model.sample(2, random_state=0), X[:2])
    assert model.predict([np.full((5, 2), value + 1 + value)]).tolist() == [-1]


def test_one_performance_shows_no_variance():
    with pytest.raises(ValueError, match="at least 2 performances"):
        ActionModel().fit([np.ones((5, 2))])


def test_unsynchronised_performances():
    with pytest.raises(ValueError, match="Performance 1 has 6 frames, performance 0 has 5"):
        ActionModel().fit([np.ones((5, 2)), np.ones((6, 2))])


def test_performances_of_another_clock(model):
    with pytest.raises(ValueError, match="have 16 frames, the model 15"):
        model.score_samples(np.zeros((2, 16, 3)))


@pytest.mark.parametrize("frame", [-1, 15, 2.5, "3"])
def test_frames_that_do_not_exist(model, frame):
    for ask in (lambda: model.accepts([[0.0, 0, 0]], frame), lambda: model.sample(2, frame=frame)):
        with pytest.raises(ValueError, match="from 0 to 14"):
            ask()


@pytest.mark.parametrize("postures", [[0.0, 0, 0], [[0.0, 0]], [[np.nan, 0, 0]]])
def test_postures_that_are_none(model, postures):
    with pytest.raises(ValueError, match="postures"):
        model.accepts(postures, 0)


@pytest.mark.parametrize("n", [0, -1, 2.5])
def test_impossible_sample_sizes(model, n):
    with pytest.raises(ValueError, match="whole number of samples"):
        model.sample(n)


@pytest.mark.parametrize("n_std", [0, -1, "wide"])
def test_nonsense_parameters(performances, n_std):
    with pytest.raises(ValueError, match="'n_std' parameter"):
        ActionModel(n_std).fit(performances)


def test_two_performances_are_enough():
    """One says nothing of how they vary; two do."""
    model = ActionModel().fit([np.zeros((5, 2)), np.ones((5, 2))])
    np.testing.assert_array_equal(model.variance_, np.full((5, 2), 0.25))
    with pytest.raises(ValueError, match="at least 2 performances"):
        ActionModel().fit([np.zeros((5, 2))])
