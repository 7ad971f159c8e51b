"""Samples of an action: their moments, that they are inside, and that they are bodies."""

import numpy as np
import pytest
from scipy.stats import truncnorm
from sklearn.pipeline import make_pipeline
from sklearn_motionsync import ActionModel, DenseSynchronizer, DirectionCosines
from sklearn_motionsync.model.variation import (
    TangentSpace,
    directions_in,
    sample_poses,
    sample_trials,
)


def moments(X):
    return X.mean(axis=0), X.var(axis=0), X - X.mean(axis=0)


def poses_of(X, n=20_000, n_std=3.0):
    return sample_poses(*moments(X), n, n_std, np.random.RandomState(0))


def trials_of(X, n=200, dissimilarity=lambda Y: np.zeros(len(Y)), threshold=np.inf):
    return sample_trials(*moments(X), n, dissimilarity, threshold, np.random.RandomState(0))


def to_nearest(X):
    """Root-mean-square distance to the nearest training trial."""
    return lambda Y: np.sqrt(np.square(Y[:, None] - X).mean(axis=(2, 3)).min(axis=1))


def waves(n=200, seed=0):
    """Trials of 15 frames x 3 features, smooth, of unequal variance."""
    rng = np.random.default_rng(seed)
    t = np.linspace(0, 1, 15)
    shapes = np.stack([np.ones_like(t), t, t**2])
    weights = rng.standard_normal((n, 3, 3)) * [[[1.0], [0.5], [0.2]]]
    return np.sin(3 * t)[:, None] + np.einsum("npk,kt->ntp", weights, shapes)


def two_styles(n=20, seed=0):
    """Trials that end up or down, none near the mean."""
    X = 0.05 * waves(n, seed)
    X[::2] += np.linspace(0, 1, 15)[:, None]
    X[1::2] -= np.linspace(0, 1, 15)[:, None]
    return X


def inside(poses, X, n_std):
    reach = n_std * np.sqrt(X.var(axis=0))
    return (poses >= X.mean(axis=0) - reach).all() and (poses <= X.mean(axis=0) + reach).all()


# -- poses ---------------------------------------------------------------------------


def test_poses_have_the_covariance_of_the_training_ones():
    """Shrunk by a fiftieth: features that go together do so in the samples."""
    rng = np.random.default_rng(0)
    X = rng.standard_normal((30, 4)) @ rng.standard_normal((4, 4)) + 5
    covariance = np.cov(X.T, bias=True)
    expected = 0.98 * covariance + 0.02 * np.diag(np.diag(covariance))
    drawn = poses_of(X, 200_000, n_std=50)
    size = np.sqrt(np.outer(X.var(axis=0), X.var(axis=0)))
    assert np.abs((np.cov(drawn.T) - expected) / size).max() < 0.01
    assert np.abs((drawn.mean(axis=0) - X.mean(axis=0)) / X.std(axis=0)).max() < 0.01


def test_deviations_of_a_part_of_the_training_set_are_centred():
    """Those kept may have another mean than all."""
    mean, variance, deviations = moments(np.random.default_rng(0).standard_normal((12, 3)) + 5)
    drawn = [
        sample_poses(mean, variance, some, 500, 3.0, np.random.RandomState(0))
        for some in (deviations + [1, -2, 7], deviations)
    ]
    np.testing.assert_allclose(*drawn, rtol=1e-12)


@pytest.mark.parametrize("n_std", [0.3, 1.5])
def test_normal_features_are_cut_off_like_normal_distributions(n_std):
    X = np.random.default_rng(0).standard_normal((1000, 2)) @ [[1.0, 0.9], [0.0, 0.1]]
    drawn = poses_of(X, 8000, n_std)
    assert inside(drawn, X, n_std)
    expected = X.std(axis=0) * truncnorm(-n_std, n_std).std()
    np.testing.assert_allclose(drawn.std(axis=0), expected, rtol=0.03)
    # What belongs together still does, however little is left of it.
    assert np.corrcoef(drawn.T)[0, 1] > 0.95 * np.corrcoef(X.T)[0, 1]


@pytest.mark.parametrize("n_std", [1e-6, 0.01, 3.0, 1e3])
@pytest.mark.parametrize("dtype", [np.float32, np.float64])
def test_every_pose_is_inside(n_std, dtype):
    rng = np.random.default_rng(1)
    for X in (
        rng.standard_normal((9, 5)) ** 3,
        np.array([[0.0, 1], [1, -1]]),  # two trials
        rng.standard_normal((5, 1)) + 1e4,  # one feature
        np.column_stack([np.full(6, 0.1), rng.standard_normal(6)]),  # a constant feature
        np.full((4, 3), 0.1),
        np.concatenate([np.zeros((4000, 1)), np.ones((1, 1))]),  # an outlier, 63 deviations away
    ):
        X = X.astype(dtype)
        drawn = poses_of(X, 500, n_std)
        assert (drawn.dtype, drawn.shape) == (dtype, (500, X.shape[1]))
        assert np.isfinite(drawn).all()
        assert inside(drawn, X, n_std)


def test_samples_near_an_outlier_are_as_far_away_as_it_is():
    """10 deviations; the envelope of 50 does not change them."""
    X = np.eye(100)[:, :1]
    near = [x for x in poses_of(X, 5000, n_std=50)[:, 0] if x > 0.5]
    assert 20 < len(near) < 100
    # The share of one training pose in the variance, 0.84, and of a mixture and noise, 0.16.
    expected = X.mean() + np.sqrt(0.84) * (1 - X.mean())
    np.testing.assert_allclose(np.mean(near), expected, atol=0.02)
    np.testing.assert_allclose(np.std(near), np.sqrt(0.16) * X.std(), rtol=0.3)


def test_samples_of_two_styles_avoid_their_mean():
    X = two_styles()[:, -1]
    drawn = poses_of(X)
    share = (np.abs(drawn[:, 0] - X[:, 0].mean()) < 0.2 * X[:, 0].std()).mean()
    assert share < 0.05  # 16 % of a normal distribution
    # And a person is of one style in all features.
    signs = np.sign(drawn - X.mean(axis=0))
    assert (np.abs(signs.sum(axis=1)) == 3).mean() > 0.95


# -- whole trials -----------------------------------------------------------------


@pytest.mark.parametrize("share", [1e-6, 0.05, 0.3, 0.7])
def test_trials_are_inside(share):
    """Also where the mean is not, and where hardly anything is."""
    for X in (waves(20), two_styles()):
        unlike = to_nearest(X)
        threshold = share * unlike(X.mean(axis=0, keepdims=True))[0]
        drawn = trials_of(X, dissimilarity=unlike, threshold=threshold)
        assert (unlike(drawn) <= threshold).all()


def test_outliers_are_no_centres_of_samples():
    X = two_styles()
    X[3] += 50
    drawn = trials_of(X, dissimilarity=lambda Y: np.abs(Y).max(axis=(1, 2)), threshold=2.0)
    assert np.abs(drawn).max() <= 2
    assert len(np.unique(drawn.round(6), axis=0)) > len(X) / 2


def test_without_any_inside_samples_are_the_most_typical_one():
    X = waves(6)
    drawn = trials_of(X, 3, lambda Y: 1 + np.abs(Y - X[4]).max(axis=(1, 2)), threshold=0.5)
    np.testing.assert_allclose(drawn, np.repeat(X[4:5], 3, axis=0))


@pytest.mark.parametrize(("threshold", "expected"), [(0.5, [6, 10, 10, 10, 10]), (1.5, [6, 10])])
def test_dissimilarity_is_evaluated_at_most_five_times(threshold, expected):
    evaluated = []
    trials_of(waves(6), 10, lambda Y: evaluated.append(len(Y)) or np.ones(len(Y)), threshold)
    assert evaluated == expected


@pytest.mark.parametrize("dtype", [np.float32, np.float64])
@pytest.mark.parametrize(
    "X", [np.full((3, 5, 2), 0.1), np.array([[[0.0]], [[1]]]), 3 + waves(2), waves(9)[:, :1]]
)
def test_degenerate_training_sets(X, dtype):
    X = X.astype(dtype)
    drawn = trials_of(X, 7, to_nearest(X), 1e-3)
    assert (drawn.dtype, drawn.shape) == (dtype, (7, *X.shape[1:]))
    assert (to_nearest(X)(drawn) <= 1e-3).all()


@pytest.mark.parametrize(
    ("factor", "expected"),
    [(1, 1), (1.5, 1.5), (0.9, 0.9), (100, 4), (0.001, 0.25), (0, 0.25)],
)
def test_trials_are_as_smooth_as_the_training_ones_and_vary_as_all(factor, expected):
    """Of those that are kept the variance is scaled, by at most four, to that of all."""
    mean, variance, deviations = moments(waves())
    given = mean, factor * variance, deviations + 0.5, 4000
    drawn = sample_trials(*given, lambda Y: np.zeros(len(Y)), 1, np.random.RandomState(0))
    np.testing.assert_allclose(drawn.var(axis=0), expected * variance, rtol=0.1)
    assert (np.abs(drawn.mean(axis=0) - mean) < 0.06 * drawn.std(axis=0)).all()
    steps = [np.diff(Y, axis=1).std() for Y in (drawn - mean, np.sqrt(expected) * deviations)]
    np.testing.assert_allclose(*steps, rtol=0.1)


# -- directions -------------------------------------------------------------------------


def turning(n=24, seed=0):
    """A height, two directions in space that turn with people, and a number: (n, 15, 8)."""
    rng = np.random.default_rng(seed)
    t = np.linspace(0, 1, 15)
    (a, b), (c, d) = rng.normal(scale=0.4, size=(2, 2, n, 1))
    cones = [
        np.stack([np.cos(x), np.sin(x) * np.cos(y), np.sin(x) * np.sin(y)], axis=2)
        for x, y in ((1 + a + t, 2 * t + b), (0.8 + b - t, t + d))
    ]
    number, height = (c + t)[..., np.newaxis], (1 + 0.1 * d * t)[..., np.newaxis]
    return np.concatenate([height, *cones, number], axis=2)


def test_directions_keep_their_length_and_vary_as_those_of_people():
    X = turning(200)
    drawn = trials_of(X, 4000)
    for columns in (slice(1, 4), slice(4, 7)):
        np.testing.assert_allclose(np.linalg.norm(drawn[..., columns], axis=-1), 1, atol=1e-12)
    # Numbers beside them have the variance of all, and so have angles from any direction.
    np.testing.assert_allclose(drawn[..., 7].var(axis=0), X[..., 7].var(axis=0), rtol=0.1)
    angles = [np.arccos(np.clip(Y[..., 1], -1, 1)) for Y in (drawn, X)]
    np.testing.assert_allclose(*(a.std(axis=0) for a in angles), rtol=0.15)


def test_tangent_space_inverts_itself_and_leaves_out_what_is_no_tangent():
    """Coordinates along a direction change nothing; what they are about is the mean direction."""
    X = turning(12).astype(np.float64)
    mean = X.mean(axis=0)
    space = TangentSpace(mean, X - mean)
    back = space.trials(space.coordinates)
    np.testing.assert_allclose(back, X, atol=1e-12)
    about, along = space.trials(np.zeros_like(X)), space.coordinates.copy()
    along[..., 1:7] += 0.7 * about[..., 1:7]
    np.testing.assert_allclose(space.trials(along), back, atol=1e-12)


def test_directions_in_finds_unit_vectors():
    X = turning()
    found = [(c.start, c.stop) for c in directions_in(X)]
    assert found == [(1, 4), (4, 7)]
    # In the plane two; shortened a little by a warp, they still are.
    plane = X[..., 1:3] / np.linalg.norm(X[..., 1:3], axis=2, keepdims=True)
    both = np.concatenate([X[..., :1], plane, 0.999 * X[..., 1:4]], axis=2)
    assert [(c.start, c.stop) for c in directions_in(both)] == [(1, 3), (3, 6)]
    for numbers in (X[..., [0, 7]], 2 * X, waves(9), X[..., [1, 3, 2, 5]] + 0.01):
        assert not [c for c in directions_in(numbers) if c.stop - c.start == 3]
    assert directions_in(waves(9)) == directions_in(np.ones((2, 3, 1))) == []


@pytest.mark.parametrize(
    ("share", "length", "is_direction"),
    [
        # Some may be short, as where a tracker jumps, while most are not.
        (0.4, 0.06, True),
        (0.4, 0.0011, True),
        (0.4, 0.0009, False),
        (0.6, 0.991, True),
        (0.6, 0.989, False),
        (0.01, 1.0009, True),
        (0.01, 1.0011, False),
    ],
)
def test_directions_have_the_length_1_but_for_short_ones(share, length, is_direction):
    X = turning().astype(np.float64)[..., 1:4]
    X /= np.linalg.norm(X, axis=2, keepdims=True)
    flat = X.reshape(-1, 3)
    flat[: int(np.ceil(share * len(flat)))] *= length
    assert directions_in(flat.reshape(X.shape)) == ([slice(0, 3)] if is_direction else [])


# -- people -----------------------------------------------------------------------------


def test_sampled_trials_of_cosines_have_whole_limbs(bends):
    """Of people who bend: inside, and no limb shrinks; 3.9 % did below 0.9, mixed as numbers."""
    poses = make_pipeline(DirectionCosines(bends.skeleton), DenseSynchronizer(n_frames=50))
    model = ActionModel().fit(poses.fit_transform(bends.data), groups=bends.actor)
    drawn = model.sample(40, random_state=0)
    assert (model.predict(drawn) == 1).all()
    lengths = np.linalg.norm(drawn[..., 1:].reshape(40, 50, 12, 3), axis=3)
    np.testing.assert_allclose(lengths, 1, atol=1e-6)
