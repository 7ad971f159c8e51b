"""FrameWise: transformers of rows, applied to frames of trials."""

import numpy as np
import pandas as pd
import pytest
from sklearn import clone, config_context
from sklearn.compose import make_column_transformer
from sklearn.decomposition import PCA
from sklearn.ensemble import RandomForestClassifier
from sklearn.feature_selection import SelectKBest, VarianceThreshold
from sklearn.impute import KNNImputer, SimpleImputer
from sklearn.pipeline import make_pipeline, make_union
from sklearn.preprocessing import (
    FunctionTransformer,
    Normalizer,
    OneHotEncoder,
    StandardScaler,
)
from sklearn.utils.estimator_checks import parametrize_with_checks
from sklearn_motionsync import (
    ActionModel,
    ASpace,
    DenseSynchronizer,
    DirectionCosines,
    FrameWise,
    to_frame,
    to_trials,
)
from sklearn_motionsync.display import SkeletonDisplay
from sklearn_motionsync.model import find_departures
from sklearn_motionsync.takes import CycleSegmenter

CHECKED = [FrameWise(make_pipeline(SimpleImputer(), StandardScaler()))]


@parametrize_with_checks(CHECKED)
def test_scikit_learn_checks(estimator, check):
    """Of a transformer that takes gaps; one that takes none is in the contract."""
    check(estimator)


@pytest.fixture
def X():
    """Degrees, newtons, and a third feature that never moves."""
    rng = np.random.default_rng(0)
    times = [np.linspace(0, 1, n) for n in (30, 30, 30, 30)]
    return [
        np.column_stack([30 * np.sin(4 * t), 900 * np.cos(3 * t), 5 + 0 * t])
        + rng.normal(0, [1, 20, 0], (len(t), 3))
        for t in times
    ]


NAMES = ["knee", "force", "box"]


@pytest.fixture
def frames(X):
    return [pd.DataFrame(x, columns=NAMES) for x in X]


def test_fit_pools_the_frames(X):
    scaled = FrameWise(StandardScaler()).fit(X[:2]).transform(X)
    expected = StandardScaler().fit(np.concatenate(X[:2]))
    for x, y in zip(X, scaled, strict=True):
        np.testing.assert_array_equal(y, expected.transform(x))
    assert abs(scaled[2].mean()) > 1e-6


def test_feature_names_are_those_of_the_transformer(frames):
    for transformer, names in (
        (StandardScaler(), NAMES),
        (VarianceThreshold(1e-9), NAMES[:2]),
        (PCA(2), ["pca0", "pca1"]),
        (FunctionTransformer(np.tanh), NAMES),
        (FunctionTransformer(lambda table: table[["force"]]), ["force"]),
        (FunctionTransformer(np.array), ["framewise0", "framewise1", "framewise2"]),
        (FunctionTransformer(np.tanh, feature_names_out="one-to-one"), NAMES),
        (make_column_transformer((PCA(1), ["force", "knee"])), ["pca__pca0"]),
    ):
        framewise = FrameWise(transformer).set_output(transform="pandas")
        out = framewise.fit_transform(frames)
        assert list(out.columns) == list(framewise.get_feature_names_out()) == names
    plain = FrameWise(StandardScaler()).fit([x.to_numpy() for x in frames])
    assert plain.get_feature_names_out().tolist() == ["x0", "x1", "x2"]
    assert plain.get_feature_names_out(NAMES).tolist() == NAMES


@pytest.mark.parametrize("container", ["default", "pandas", "polars"])
def test_output_container_of_the_transformer_does_not_matter(container, frames):
    expected = FrameWise(StandardScaler()).fit_transform(frames)
    inner = StandardScaler().set_output(transform=container)
    np.testing.assert_array_equal(FrameWise(inner).fit_transform(frames), expected)
    with config_context(transform_output=container):
        framewise = FrameWise(StandardScaler()).set_output(transform="default")
        np.testing.assert_array_equal(framewise.fit_transform(frames), expected)


def test_inverse_transform_gives_the_input(X, frames):
    for transformer in (StandardScaler(), PCA(), make_pipeline(StandardScaler(), PCA())):
        framewise = FrameWise(transformer).fit(frames)
        back = framewise.inverse_transform(framewise.transform(frames))
        np.testing.assert_allclose(back, X, atol=1e-9)
        framewise.set_output(transform="pandas")
        points = framewise.transform(frames)
        back = framewise.inverse_transform(points)
        assert list(back.columns) == NAMES
        np.testing.assert_allclose(np.stack(to_trials(back)), X, atol=1e-9)
        with pytest.raises(ValueError, match="should match"):
            framewise.inverse_transform(points[points.columns[::-1]])


def test_inverse_transform_exists_only_if_the_transformer_has_one(X):
    assert not hasattr(FrameWise(Normalizer()), "inverse_transform")
    # Imputers invert with indicators only.
    assert not hasattr(FrameWise(SimpleImputer()).fit(X), "inverse_transform")
    assert hasattr(FrameWise(StandardScaler()), "inverse_transform")


def with_gap(X, value=np.nan):
    gaps = [x.copy() for x in X]
    gaps[2][5, 1] = value
    return gaps


IMPUTERS = make_pipeline(SimpleImputer(), PCA(2)), make_column_transformer((SimpleImputer(), [1]))


@pytest.mark.parametrize(
    "transformer",
    [
        KNNImputer(),
        *IMPUTERS,
        make_pipeline("passthrough", IMPUTERS[0]),
        FunctionTransformer(np.nan_to_num),
        make_union(SimpleImputer()),
    ],
    ids=lambda given: type(given).__name__,
)
def test_gaps_pass_to_transformers_that_accept_them(transformer, X):
    gaps = with_gap(X)
    for given in (gaps, np.stack(gaps), to_frame(gaps)):
        assert np.isfinite(np.stack(FrameWise(transformer).fit_transform(given))).all()
    assert np.isnan(FrameWise(StandardScaler()).fit_transform(gaps)[2]).sum() == 1
    with pytest.raises(ValueError, match="Trial 2, frame 5, feature 1 is infinity"):
        FrameWise(transformer).fit(with_gap(X, np.inf))


@pytest.mark.parametrize(
    "estimator",
    [
        FrameWise(PCA(2)),
        FrameWise(make_union(StandardScaler(), PCA(2))),
        make_pipeline(FrameWise(StandardScaler()), CycleSegmenter()),
    ],
    ids=str,
)
def test_gaps_are_refused_where_a_step_does_not_accept_them(estimator, X):
    with pytest.raises(ValueError, match="Trial 2, frame 5, feature 1 is NaN"):
        estimator.fit(with_gap(X))


def test_input_is_not_written_to(X):
    before = [x.copy() for x in X]
    for given in (X, X[:1], X[0]):
        framewise = FrameWise(StandardScaler(copy=False)).fit(given)
        framewise.inverse_transform(framewise.transform(given))
    np.testing.assert_array_equal(X, before)


@pytest.mark.parametrize(
    ("transformer", "words"),
    [
        (SelectKBest(k=2), ["requires y"]),
        (RandomForestClassifier(), ["'transformer'", "'transform'"]),
        (
            FunctionTransformer(lambda x: x[::2]),
            ["Trial 0 has 30 frames", "(15, 3)", "change"],
        ),
        (FunctionTransformer(lambda x: x[:, 0]), ["Trial 0", "(30,)"]),
        (FunctionTransformer(lambda x: x.astype(str)), ["Trial 0", "FunctionTransformer"]),
        (OneHotEncoder(handle_unknown="ignore"), ["OneHotEncoder", "sparse_output=False"]),
        ("scale", ["'transformer'", "'scale'"]),
    ],
    ids=lambda given: type(given).__name__,
)
def test_fit_refuses_transformers(transformer, words, X):
    framewise = FrameWise(transformer)
    with pytest.raises((TypeError, ValueError)) as caught:
        framewise.fit(X)
    assert [word for word in words if word not in str(caught.value)] == [], str(caught.value)
    assert not hasattr(framewise, "transformer_")


def test_departures_and_figures_show_poses_before_scaling(bending):
    cosines, data = DirectionCosines(bending.skeleton), bending.data[:8]
    steps = ASpace(), DenseSynchronizer(30), ActionModel()
    plain = make_pipeline(cosines, *steps).fit(data)
    scaled = make_pipeline(cosines, FrameWise(StandardScaler()), *map(clone, steps))
    pipes = plain, scaled.fit(data)
    found = [set(find_departures(pipe, data, limit=1)["feature"]) for pipe in pipes]
    assert found[1] <= set(plain[0].get_feature_names_out())
    assert found[0] & found[1]
    displays = [
        SkeletonDisplay.from_departures(pipe, data, trial=1, frames=[0, 29]) for pipe in pipes
    ]
    bodies = [np.concatenate([x for scene in d.scenes for x in scene]) for d in displays]
    np.testing.assert_allclose(*bodies, atol=0.15)
