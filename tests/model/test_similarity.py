"""Dissimilarity and threshold of the model: against slow loops and closed forms, with gaps too."""

import numpy as np
import pandas as pd
import pytest
from scipy.ndimage import gaussian_filter1d
from scipy.stats import t as student
from sklearn_motionsync import ActionModel
from sklearn_motionsync.model.acceptance import log_moments


def curves(n, seed=0, n_frames=40, spread=0.2):
    """Smooth trials of two features, of different amplitudes and shapes."""
    rng = np.random.default_rng(seed)
    t = np.linspace(0, 1, n_frames)
    base = np.stack([np.sin(2 * np.pi * t), np.cos(3 * t)], axis=1)
    parts = np.stack([t, t**2, np.sin(4 * np.pi * t)], axis=1)
    return base * rng.uniform(0.8, 1.2, (n, 1, 1)) + spread * np.einsum(
        "tk,nkf->ntf", parts, rng.standard_normal((n, 3, 2))
    )


def hide(X, share=0.3, length=12, seed=0):
    """Copies of trials: some features of some are hidden for a while."""
    rng, X = np.random.default_rng(seed), X.copy()
    for x in X:
        for k in range(X.shape[2]):
            if rng.random() < share:
                start = rng.integers(0, len(x) - length)
                x[start : start + length, k] = np.nan
    return X


# -- the dissimilarity, written out -----------------------------------------------------


def filled(x, mean):
    """Deviations from the mean go on in straight lines."""
    if not np.isnan(x).any():
        return x
    gaps = pd.DataFrame(x - mean).interpolate(limit_direction="both").fillna(0)
    return mean + gaps.to_numpy()


def slow_velocity(x):
    """A Gaussian's derivative of a hundredth of the clock, over point reflections at the ends."""
    n = len(x)
    long = np.concatenate([2 * x[0] - x[:0:-1], x, 2 * x[-1] - x[-2::-1]])
    sigma = max(0.01 * (n - 1), 1 / 3)
    return gaussian_filter1d(long, sigma, axis=0, order=1, mode="nearest")[n - 1 : 2 * n - 1]


def slow_weights(X, groups, within=False):
    """The factor of each feature, and the weight of mean poses, by loops.

    Pairs are of different groups; within groups factors are 1, and mean poses weigh more.
    """
    X, scale, apart, offset = np.asarray(X), 1.0, [], []
    if not within:
        variances = np.var(X - X.mean(axis=1, keepdims=True), axis=0).mean(axis=0)
        largest = variances.max()
        scale = np.array([(largest / max(v, largest / 100)) ** 0.25 for v in variances])
    for i, y in enumerate(X):
        for j, z in enumerate(X[:i]):
            if (groups[i] == groups[j]) == within:
                a, b = (scale * (x - x.mean(0)) for x in (y, z))
                energy = (a**2).sum() + (b**2).sum()
                apart.append(((a - b) ** 2).sum() / energy)
                offset.append(len(y) * ((scale * (y.mean(0) - z.mean(0))) ** 2).sum() / energy)
    share = 0.2 if within else 0.05
    return scale, min(0.1, share * np.median(apart) / np.median(offset))


def slow_ratio(y, z, weights, mean=0):
    """In sums over what was seen of both trials, which are filled by the mean."""
    scale, mean_weight = weights
    both = ~np.isnan(y) & ~np.isnan(z)
    y, z = (scale * filled(x, mean) for x in (y, z))
    a, b = y - y.mean(0), z - z.mean(0)
    apart = ((a - b) ** 2)[both].sum()
    apart += mean_weight * (both.sum(0) * (y.mean(0) - z.mean(0)) ** 2).sum()
    moved = (a**2 + b**2)[both].sum()
    v, w = slow_velocity(y), slow_velocity(z)
    return apart / moved / 2 + ((v - w) ** 2)[both].sum() / (v**2 + w**2)[both].sum() / 2


def slow_dissimilarity(y, others, weights, mean=0):
    return np.mean(sorted(slow_ratio(y, z, weights, mean) for z in others)[:3])


def slow_threshold(values, coverage, prior=0.12):
    logs, n = np.log(values), len(values)
    variance = (((logs - logs.mean()) ** 2).sum() + 3 * prior) / (n - 1 + 3)
    quantile = student(n + 2).ppf(coverage)
    return np.exp(logs.mean() + quantile * np.sqrt(variance + variance / n))


@pytest.mark.parametrize(("grouped", "coverage"), [(False, 0.8), (True, 0.95)])
@pytest.mark.parametrize("share", [0, 0.4])
def test_dissimilarity_and_threshold_equal_slow_loops(grouped, coverage, share):
    """Of new trials some have gaps, whether those of the model have some or not."""
    X, new = hide(curves(12), share), curves(70, seed=1, spread=0.4)
    new[50:] = hide(new[50:], share=0.8, seed=4)
    groups = np.array(list("aabbbcddddee")) if grouped else None
    model = ActionModel(coverage=coverage).fit(X, groups=groups)
    codes, mean = np.arange(12) if groups is None else groups, np.nanmean(X, axis=0)
    weights = slow_weights([filled(x, mean) for x in X], codes)
    held_out = zip(X, codes, strict=True)
    left = [slow_dissimilarity(x, X[codes != c], weights, mean) for x, c in held_out]
    np.testing.assert_allclose(model.dissimilarities_, left, rtol=1e-9)
    np.testing.assert_allclose(model.threshold_, slow_threshold(left, coverage), rtol=1e-9)
    expected = np.array([slow_dissimilarity(x, X, weights, mean) for x in new])
    np.testing.assert_allclose(model.dissimilarity(new), expected, rtol=1e-9)
    decisions = np.log(model.threshold_) - np.log(expected)
    np.testing.assert_allclose(model.decision_function(new), decisions, atol=1e-8)
    inside = expected <= model.threshold_
    assert 5 < inside.sum() < 65
    np.testing.assert_array_equal(model.predict(new), np.where(inside, 1, -1))


def test_a_single_neighbour_of_another_group_decides_alone():
    X = curves(3)
    model = ActionModel().fit(X, groups=["a", "b", "b"])
    weights = slow_weights(X, ["a", "b", "b"])
    others = [slow_ratio(X[0], x, weights) for x in X[1:]]
    expected = [np.mean(others), *others]
    np.testing.assert_allclose(model.dissimilarities_, expected, rtol=1e-9)


def test_dissimilarity_of_equal_still_opposite_and_distant_trials():
    X = curves(10)
    X -= X.mean(axis=1, keepdims=True)
    model = ActionModel().fit(X)
    new = [X[0], 0 * X[0], -model.mean_, 100 * X[0], X[0] + 1e6]
    equal, still, opposite, huge, elsewhere = model.dissimilarity(new)
    assert equal < min(ActionModel().fit(X[1:]).dissimilarity(X[:1]))
    np.testing.assert_allclose(still, 1)
    assert 1.5 < opposite <= 2
    assert 0.9 < huge < 1
    assert elsewhere > 1e6
    assert model.predict(new).tolist() == [1, -1, -1, -1, -1]


# -- the threshold ----------------------------------------------------------------------


@pytest.mark.parametrize(("n", "coverage"), [(1, 0.8), (2, 0.8), (20, 0.95)])
def test_upper_limit_of_few_values_has_a_smaller_prior_variance(n, coverage):
    values = np.exp(np.random.default_rng(n).standard_normal(n))
    expected = slow_threshold(values, coverage, prior=0.07)
    assert log_moments(values).upper_limit(coverage) == pytest.approx(expected)


# -- alone or together ------------------------------------------------------------------


@pytest.mark.parametrize(("n_features", "share"), [(1, 0), (16, 0), (3, 0.2)])
def test_dissimilarity_does_not_depend_on_other_trials(n_features, share):
    """Nor on their gaps."""
    rng = np.random.default_rng(0)
    X = np.cumsum(rng.standard_normal((30, 57, n_features)), axis=1)
    new = hide(np.cumsum(rng.standard_normal((75, 57, n_features)), axis=1), share)
    model, order = ActionModel().fit(X), rng.permutation(75)
    together = model.dissimilarity(new)
    alone = np.concatenate([model.dissimilarity([x]) for x in new])
    np.testing.assert_array_equal(alone, together)
    np.testing.assert_array_equal(model.dissimilarity(new[order]), together[order])


def test_single_precision_is_compared_in_double():
    """Trials of float32 and the same numbers as float64 have equal dissimilarities."""
    X, new = (curves(n, seed=n).astype("f4") for n in (9, 70))
    model, double = ActionModel().fit(X), ActionModel().fit(X.astype("f8"))
    np.testing.assert_array_equal(model.dissimilarity(new), double.dissimilarity(new.astype("f8")))
    assert model.threshold_ == double.threshold_


# -- limits -----------------------------------------------------------------------------


def test_dissimilarity_of_static_trials_is_that_of_their_poses():
    """A tenth of the squared distance, as a share of the variance of all poses."""
    held = np.array([0.9, 1.0, 1.1, 1.2, 1.3])

    def still(values):
        return [np.full((7, 2), v) + [0, 10] for v in values]

    found = ActionModel().fit(still(held)).dissimilarity(still([1.15, 1.3, 5.0]))
    nearest = np.array([[0.05, 0.05, 0.15], [0, 0.1, 0.2], [3.7, 3.8, 3.9]])
    expected = 0.1 * np.square(nearest).mean(axis=1) / held.var()
    np.testing.assert_allclose(found, expected, rtol=1e-9)


def test_standing_still_is_rejected_however_people_differ():
    noise = np.random.default_rng(0).standard_normal((12, 30, 3))
    model = ActionModel(coverage=0.999).fit(noise)
    assert model.threshold_ < 1
    assert model.predict([np.zeros((30, 3)), np.ones((30, 3))]).tolist() == [-1, -1]
