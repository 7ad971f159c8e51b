"""FrameWise: transformers of rows, applied to frames of performances."""

import numpy as np
import pandas as pd
import pytest
from sklearn import clone, config_context
from sklearn.compose import make_column_transformer
from sklearn.decomposition import PCA
from sklearn.ensemble import RandomForestClassifier
from sklearn.feature_selection import SelectKBest, VarianceThreshold
from sklearn.impute import KNNImputer, SimpleImputer
from sklearn.model_selection import GridSearchCV
from sklearn.pipeline import make_pipeline, make_union
from sklearn.preprocessing import (
    FunctionTransformer,
    MinMaxScaler,
    Normalizer,
    OneHotEncoder,
    StandardScaler,
)
from sklearn.utils import estimator_checks
from sklearn.utils.estimator_checks import parametrize_with_checks
from sklearn_motionsync import (
    ActionModel,
    ASpace,
    DenseSynchronizer,
    DirectionCosines,
    FrameWise,
    JointPositions,
    LinearSynchronizer,
    find_departures,
    to_frame,
    to_sequences,
)
from sklearn_motionsync.display import SkeletonDisplay

from estimators import by_name
from test_contract import EXTRA_CHECKS

CHECKED = [
    FrameWise(transformer)
    for transformer in (
        StandardScaler(),
        PCA(),
        SimpleImputer(),
        VarianceThreshold(),
        make_pipeline(SimpleImputer(), StandardScaler()),
    )
]


@parametrize_with_checks(CHECKED)
def test_scikit_learn_checks(estimator, check):
    check(estimator)


@pytest.mark.filterwarnings("ignore:X does not have valid feature names:UserWarning")
@pytest.mark.filterwarnings("ignore:X has feature names, but:UserWarning")
@pytest.mark.parametrize("estimator", CHECKED[:2], ids=by_name)
@pytest.mark.parametrize("name", EXTRA_CHECKS)
def test_scikit_learn_checks_that_are_not_in_the_automatic_list(estimator, name):
    getattr(estimator_checks, name)("FrameWise", clone(estimator))


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


def test_frames_are_pooled_for_the_fit(X):
    """A performance by itself need be neither centred nor scaled."""
    scaled = FrameWise(StandardScaler()).fit(X[:2]).transform(X)
    expected = StandardScaler().fit(np.concatenate(X[:2]))
    for x, y in zip(X, scaled, strict=True):
        np.testing.assert_array_equal(y, expected.transform(x))
    assert abs(scaled[2].mean()) > 1e-6


def test_kinds_are_given_back(X, frames):
    framewise = FrameWise(StandardScaler()).fit(X)
    expected = np.stack(framewise.transform(X))
    for given in (np.stack(X), X, to_frame(frames)):
        out = clone(framewise).fit(given).transform(given)
        assert isinstance(
            out, np.ndarray if given is not X and hasattr(given, "ndim") else list
        ) or (isinstance(given, pd.DataFrame))
        np.testing.assert_array_equal(np.stack(out), expected)
    np.testing.assert_array_equal(framewise.transform(X[1]), expected[1])


def test_names_are_those_of_the_transformer(frames):
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
def test_what_the_transformer_gives_out_does_not_matter(container, frames):
    expected = FrameWise(StandardScaler()).fit_transform(frames)
    inner = StandardScaler().set_output(transform=container)
    np.testing.assert_array_equal(FrameWise(inner).fit_transform(frames), expected)
    with config_context(transform_output=container):
        framewise = FrameWise(StandardScaler()).set_output(transform="default")
        np.testing.assert_array_equal(framewise.fit_transform(frames), expected)


def test_labels_stay():
    t = np.tile(np.arange(12), 2)
    df = pd.DataFrame({"who": np.repeat(["ann", "bob"], 12), "k": 1, "t": t, "x": t**2, "y": -t})
    X = to_sequences(df, by=["who", "k"], time="t")
    pipe = make_pipeline(FrameWise(StandardScaler()), DenseSynchronizer(8))
    out = pipe.set_output(transform="pandas").fit_transform(X)
    assert out.index.names == ["who", "k", "frame"]
    assert out.index.droplevel(2).unique().tolist() == [("ann", 1), ("bob", 1)]
    assert list(out.columns) == ["x", "y"]


def test_the_way_back(X, frames):
    for transformer in (StandardScaler(), PCA(), make_pipeline(StandardScaler(), PCA())):
        framewise = FrameWise(transformer).fit(frames)
        back = framewise.inverse_transform(framewise.transform(frames))
        np.testing.assert_allclose(back, X, atol=1e-9)
        framewise.set_output(transform="pandas")
        points = framewise.transform(frames)
        back = framewise.inverse_transform(points)
        assert list(back.columns) == NAMES
        np.testing.assert_allclose(np.stack(to_sequences(back)), X, atol=1e-9)
        with pytest.raises(ValueError, match="should match"):
            framewise.inverse_transform(points[points.columns[::-1]])


def test_there_is_a_way_back_only_if_the_transformer_has_one(X):
    assert not hasattr(FrameWise(Normalizer()), "inverse_transform")
    # It has the method, but only with indicators.
    assert not hasattr(FrameWise(SimpleImputer()).fit(X), "inverse_transform")
    assert hasattr(FrameWise(StandardScaler()), "inverse_transform")


@pytest.mark.parametrize("dtype", ["f4", "f8", "i4"])
def test_precision_is_that_of_the_transformer(dtype, X):
    X = [x.astype(dtype) for x in X]
    expected = "f4" if dtype == "f4" else "f8"
    assert {x.dtype for x in FrameWise(StandardScaler()).fit_transform(X)} == {np.dtype(expected)}


def test_gaps_go_to_those_who_take_them(X):
    gaps = [x.copy() for x in X]
    gaps[2][5, 1] = np.nan
    pipe = make_pipeline(SimpleImputer(), PCA(2))
    for imputer in (SimpleImputer(), KNNImputer(), pipe, make_pipeline("passthrough", pipe)):
        given = (gaps, np.stack(gaps), to_frame(gaps), gaps[2])
        for some in given:
            assert np.isfinite(np.stack(FrameWise(imputer).fit_transform(some))).all()
    columns = make_column_transformer((SimpleImputer(), [1]), remainder="passthrough")
    for transformer in (columns, FunctionTransformer(np.nan_to_num), make_union(SimpleImputer())):
        for some in given[:2]:
            assert np.isfinite(np.stack(FrameWise(transformer).fit_transform(some))).all()
    scaled = FrameWise(StandardScaler()).fit_transform(gaps)
    assert np.isnan(scaled[2]).sum() == 1
    halves = FrameWise(make_union(StandardScaler(), PCA(2)))
    for estimator in (
        FrameWise(PCA(2)),
        halves,
        make_pipeline(FrameWise(StandardScaler()), ASpace()),
        make_pipeline(FrameWise(FunctionTransformer(np.tanh)), ASpace()),
    ):
        with pytest.raises(ValueError, match="Performance 2, frame 5, feature 1 is NaN"):
            estimator.fit(gaps)
    gaps[2][5, 1] = np.inf
    with pytest.raises(ValueError, match="Performance 2, frame 5, feature 1 is infinity"):
        FrameWise(SimpleImputer()).fit(gaps)


def test_transformers_that_write_to_their_input_do_not_write_to_ours(X):
    before = [x.copy() for x in X]
    for given in (X, X[:1], X[0]):
        framewise = FrameWise(StandardScaler(copy=False)).fit(given)
        framewise.inverse_transform(framewise.transform(given))
    np.testing.assert_array_equal(X, before)


def test_parameters_are_nested(X):
    pipe = make_pipeline(FrameWise(StandardScaler()), DenseSynchronizer(10))
    pipe.set_params(framewise__transformer__with_mean=False)
    assert "framewise__transformer__with_std" in pipe.get_params()
    grid = {"framewise__transformer": [StandardScaler(), MinMaxScaler()]}
    search = GridSearchCV(pipe, grid, scoring=lambda e, X, y=None: 0.0, cv=2).fit(X)
    assert search.best_estimator_[0].transformer is not pipe[0].transformer


@pytest.mark.parametrize(
    ("transformer", "words"),
    [
        (SelectKBest(k=2), ["SelectKBest", "y"]),
        (RandomForestClassifier(), ["'transformer'", "'transform'"]),
        (
            FunctionTransformer(lambda x: x[::2]),
            ["Performance 0 has 30 frames", "(15, 3)", "change"],
        ),
        (FunctionTransformer(lambda x: x[:, 0]), ["Performance 0", "(30,)"]),
        (FunctionTransformer(lambda x: x.astype(str)), ["Performance 0", "FunctionTransformer"]),
        (OneHotEncoder(handle_unknown="ignore"), ["OneHotEncoder", "sparse_output=False"]),
        ("scale", ["'transformer'", "'scale'"]),
    ],
    ids=lambda given: type(given).__name__,
)
def test_transformers_that_do_not_fit(transformer, words, X):
    framewise = FrameWise(transformer)
    with pytest.raises((TypeError, ValueError)) as caught:
        framewise.fit(X)
    assert [word for word in words if word not in str(caught.value)] == [], str(caught.value)
    assert not hasattr(framewise, "transformer_")


# -- bodies -------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def pipelines(bending):
    """The same model of cosines, with and without scaling them."""
    steps = [DirectionCosines(bending.skeleton)], [ASpace(), DenseSynchronizer(60), ActionModel()]
    plain = make_pipeline(*steps[0], *steps[1])
    scaled = make_pipeline(*steps[0], FrameWise(StandardScaler()), *steps[1])
    return [pipe.fit(bending.data) for pipe in map(clone, (plain, scaled))]


def test_departures_are_named_as_before(pipelines, bending):
    plain, scaled = (find_departures(pipe, bending.data, limit=1) for pipe in pipelines)
    names = set(DirectionCosines(bending.skeleton).fit(bending.data).get_feature_names_out())
    assert set(scaled["feature"]) <= names
    assert set(scaled["feature"]) & set(plain["feature"])


def bodies_of(display):
    return np.concatenate([x for scene in display.scenes for x in scene])


def test_figures_show_bodies_not_scaled_numbers(pipelines, bending):
    import matplotlib.pyplot as plt

    plain, scaled = (
        SkeletonDisplay.from_departures(pipe, bending.data, performance=1, frames=[0, 59])
        for pipe in pipelines
    )
    np.testing.assert_allclose(bodies_of(scaled), bodies_of(plain), atol=0.15)
    np.testing.assert_allclose(*([x.behind[0][0] for x in (scaled, plain)]), atol=0.15)
    plain, scaled = (SkeletonDisplay.from_model(pipe, n_samples=2) for pipe in pipelines)
    np.testing.assert_allclose(scaled.scenes[0], plain.scenes[0], atol=0.15)
    plt.close("all")


def test_limbs_that_are_scaled_within_a_union_are_not_drawn(bending):
    views = make_union(
        make_pipeline(DirectionCosines(bending.skeleton), FrameWise(StandardScaler())),
        JointPositions(bending.skeleton),
    ).set_output(transform="pandas")
    pipe = make_pipeline(views, LinearSynchronizer(30), ActionModel()).fit(bending.data)
    with pytest.raises(ValueError, match=r"lead back to limbs.*FeatureUnion"):
        SkeletonDisplay.from_departures(pipe, bending.data)
