"""The contract of every public estimator: input, output, errors, storage."""

import functools
import io
import pickle
from concurrent.futures import ThreadPoolExecutor

import joblib
import numpy as np
import pandas as pd
import pytest
import skops.io
import xarray as xr
from sklearn import clone, config_context
from sklearn.exceptions import NotFittedError
from sklearn.utils import estimator_checks, get_tags
from sklearn.utils.estimator_checks import parametrize_with_checks
from sklearn_motionsync import (
    ActionClassifier,
    ASpace,
    DirectionCosines,
    JointPositions,
    LinearSynchronizer,
    Skeleton,
    to_frame,
    to_trials,
)

from estimators import (
    BODY,
    ESTIMATORS,
    EVERY,
    INSTANCES,
    NAMES,
    SEQUENCE_LEVEL,
    SYNCHRONIZERS,
    TRANSFORMERS,
    WIDTH,
    all_of,
    by_name,
    data_for,
    make_trials,
    outputs,
    public_estimators,
)
from shift_synchronizer import ShiftSynchronizer

# Of few frames, so that the checks take less time.
OF_FEW_FRAMES = ActionClassifier(n_landmarks=10, n_frames=2)
# FrameWise is as wide as its transformer: tests/transformers/test_framewise.py checks several.
OTHERWISE = [*BODY, *all_of("FrameWise", "ActionClassifier")]
ROW_ESTIMATORS = [e for e in ESTIMATORS if e not in OTHERWISE] + [OF_FEW_FRAMES]
# What is checked in one place is tested whole on these two, one of rows and one of sequences.
ROWS_AND_SEQUENCES = all_of("ASpace", "LinearSynchronizer")

EXTRA_CHECKS = [
    "check_dataframe_column_names_consistency",
    "check_param_validation",
    "check_transformer_get_feature_names_out",
    "check_transformer_get_feature_names_out_pandas",
    "check_set_output_transform",
    "check_set_output_transform_pandas",
    "check_global_output_transform_pandas",
    "check_set_output_transform_polars",
    "check_global_set_output_transform_polars",
]


def test_every_public_estimator_is_in_the_contract():
    missing = public_estimators() - set(INSTANCES)
    assert not missing, f"give each an instance in INSTANCES of tests/estimators.py: {missing}"


# Their rows are noise.
NO_SUPPORT = pytest.mark.filterwarnings("ignore::sklearn_motionsync.SynchronizationWarning")


@NO_SUPPORT
@parametrize_with_checks(ROW_ESTIMATORS)
def test_scikit_learn_checks(estimator, check):
    check(estimator)


# The output checks give arrays to estimators fitted on frames on purpose.
@NO_SUPPORT
@pytest.mark.filterwarnings("ignore:X does not have valid feature names:UserWarning")
@pytest.mark.filterwarnings("ignore:X has feature names, but:UserWarning")
@pytest.mark.parametrize(
    ("estimator", "name"),
    [
        (estimator, name)
        for estimator in ROW_ESTIMATORS
        for name in EXTRA_CHECKS
        if hasattr(estimator, "transform") or "transform" not in name
    ]
    + [(estimator, "check_param_validation") for estimator in BODY],
    ids=by_name,
)
def test_scikit_learn_checks_that_are_not_in_the_automatic_list(estimator, name):
    getattr(estimator_checks, name)(type(estimator).__name__, clone(estimator))


# -- collections: every kind is the same thing ------------------------------------------


@pytest.fixture(scope="module")
def trials():
    """Six trials of equal length, so that they can be a 3-D array, and a model's input."""
    return make_trials(6)


KINDS = {
    "list": list,
    "tuple": tuple,
    "array": np.stack,
    "object": lambda X: np.fromiter(X, dtype=object),
    "object of equal shapes": lambda X: np.array(X, dtype=object),
    "frames": lambda X: [pd.DataFrame(x, columns=NAMES) for x in X],
    "nested lists": lambda X: [x.tolist() for x in X],
    "multiindex": lambda X: to_frame(X, columns=NAMES),
    "nested table": lambda X: pd.DataFrame({n: [x[:, k] for x in X] for k, n in enumerate(NAMES)}),
    "labelled array": lambda X: xr.DataArray(
        np.stack(X), dims=("trial", "time", "axis"), coords={"axis": NAMES}
    ),
    "read-only": lambda X: [np.broadcast_to(x, x.shape) for x in X],
    "column order": lambda X: [np.asfortranarray(x) for x in X],
}


def assert_same(answers, expected):
    assert len(answers) == len(expected)
    for a, b in zip(answers, expected, strict=True):
        np.testing.assert_array_equal(a, b)


@functools.cache
def fit_once(estimator):
    """An estimator that is fitted once, for tests that leave it as it was."""
    return clone(estimator).fit(data_for(estimator))


@functools.cache
def expected_of(estimator):
    """All results of an estimator for what it was fitted on."""
    return outputs(fit_once(estimator), data_for(estimator))


@pytest.mark.parametrize(
    ("estimator", "kind"),
    [
        (estimator, kind)
        for estimator in ESTIMATORS
        for kind in KINDS
        if estimator in ROWS_AND_SEQUENCES or kind in ("array", "frames", "multiindex")
    ],
    ids=by_name,
)
def test_every_kind_of_collection_gives_equal_results(estimator, kind, trials):
    X = KINDS[kind](trials)
    fitted = clone(estimator).fit(X)
    assert_same(outputs(fitted, X), expected_of(estimator))
    assert fitted.n_features_in_ == WIDTH
    named = kind in ("frames", "multiindex", "nested table", "labelled array")
    assert hasattr(fitted, "feature_names_in_") is named
    if named:
        assert list(fitted.feature_names_in_) == NAMES


@pytest.mark.parametrize("estimator", EVERY, ids=by_name)
def test_methods_in_several_threads_change_neither_estimator_nor_input(estimator):
    X = data_for(estimator)
    fitted = clone(estimator).fit(X)
    before = pickle.dumps(fitted.__dict__)
    with ThreadPoolExecutor(3) as pool:
        for answers in pool.map(lambda _: outputs(fitted, X), range(3)):
            assert_same(answers, expected_of(estimator))
    assert pickle.dumps(fitted.__dict__) == before
    assert_same(X, data_for(estimator))


@pytest.mark.parametrize("estimator", EVERY, ids=by_name)
def test_a_refit_of_a_clone_leaves_nothing_of_an_earlier_fit(estimator):
    """Of names least of all."""
    X = data_for(estimator)
    tables = [pd.DataFrame(x, columns=NAMES[: x.shape[1]]) for x in X[::-1]]
    fitted = clone(fit_once(estimator)).fit(tables)
    assert fitted.feature_names_in_.tolist() == list(tables[0])
    assert vars(fitted.fit(X)).keys() == vars(fit_once(estimator)).keys()
    assert not hasattr(fitted, "feature_names_in_")
    assert_same(outputs(fitted, X), expected_of(estimator))


def through_pickle(estimator):
    return pickle.loads(pickle.dumps(estimator))


def through_joblib(estimator):
    file = io.BytesIO()
    joblib.dump(estimator, file)
    file.seek(0)
    return joblib.load(file)


def through_skops(estimator):
    data = skops.io.dumps(estimator)
    types = skops.io.get_untrusted_types(data=data)
    ours = ("sklearn_motionsync.", "estimators.", "shift_synchronizer.", "sklearn.", "collections.")
    assert all(name.startswith(ours) for name in types)
    return skops.io.loads(data, trusted=types)


@pytest.mark.parametrize("estimator", EVERY, ids=by_name)
def test_a_stored_estimator_gives_equal_results(estimator):
    for through_storage in (through_pickle, through_joblib, through_skops):
        stored = through_storage(fit_once(estimator))
        assert_same(outputs(stored, data_for(estimator)), expected_of(estimator))


@pytest.mark.parametrize("estimator", ESTIMATORS, ids=by_name)
def test_subsets_and_order_do_not_matter(estimator, trials):
    """The results of a trial depend on no other trial."""
    fitted, whole = fit_once(estimator), expected_of(estimator)
    last = outputs(fitted, trials[-1:])
    backwards = outputs(fitted, trials[::-1])
    if hasattr(estimator, "transform"):
        np.testing.assert_allclose(last[0], whole[len(trials) - 1], rtol=1e-12)
        np.testing.assert_allclose(backwards[0], whole[len(trials) - 1], rtol=1e-12)
    else:
        np.testing.assert_allclose(last[0][0], whole[0][-1], rtol=1e-12)
        for one, same in zip(backwards[0], whole[0][::-1], strict=True):
            np.testing.assert_allclose(one, same, rtol=1e-12)


@pytest.mark.parametrize("estimator", TRANSFORMERS, ids=by_name)
def test_transform_returns_new_arrays_of_the_kind_of_its_input(estimator, trials):
    fitted = fit_once(estimator)
    stacked = fitted.transform(np.stack(trials))
    assert isinstance(stacked, np.ndarray)
    assert stacked.ndim == 3
    out = fitted.transform(trials)
    assert_same(clone(estimator).fit_transform(trials), out)
    assert not any(np.shares_memory(one, x) for one in out for x in trials)
    if hasattr(fitted, "n_frames_"):
        assert out.shape == (6, fitted.n_frames_, len(fitted.get_feature_names_out()))
    else:
        assert isinstance(out, list)
        np.testing.assert_allclose(fitted.transform(trials[0]), out[0], rtol=1e-12)


@pytest.mark.parametrize(
    ("estimator", "dtype"),
    [
        (estimator, dtype)
        for estimator in ESTIMATORS
        for dtype in ("float32", "int32", "float64", "float16", "bool")
        if estimator in ROWS_AND_SEQUENCES or dtype in ("float32", "int32")
    ],
    ids=by_name,
)
def test_float32_is_kept_and_other_types_become_float64(estimator, dtype, trials):
    used = "float32" if dtype == "float32" else "float64"
    X = [x > 0 if dtype == "bool" else (100 * x).astype(dtype) for x in trials]
    fitted = clone(estimator).fit(X)
    for name in ("components_", "mean_", "pattern_", "variance_", "limb_lengths_"):
        if hasattr(fitted, name):
            assert getattr(fitted, name).dtype == used, name
    if hasattr(fitted, "transform"):
        assert all(x.dtype == used for x in fitted.transform(X))
    if dtype == "float32":
        double = clone(estimator).fit([x.astype(float) for x in X])
        single, double = outputs(fitted, X), outputs(double, [x.astype(float) for x in X])
        for a, b in zip(single, double, strict=True):
            np.testing.assert_allclose(a, b, rtol=2e-3, atol=2e-3 * np.abs(b).max())


@pytest.mark.parametrize("estimator", SYNCHRONIZERS, ids=by_name)
@pytest.mark.parametrize("pattern", ["median", 0, 3])
def test_pattern_matches_itself_by_the_identity(estimator, pattern, trials, request):
    """Frame by frame: synthetic ones, those that never move, and people."""
    still = [np.full((12, 2), k) for k in range(5)]
    people = request.getfixturevalue("bends").data[::3] if pattern == "median" else []
    # A cross-correlation finds no shift of what never moves.
    others = [] if isinstance(estimator, ShiftSynchronizer) else [still]
    for X in (trials, *([people] if people else []), *others):
        name = "pattern" if "pattern" in estimator.get_params() else "synchronizer__pattern"
        sync = clone(estimator).set_params(**{name: pattern}).fit(X)
        own = sync.match([X[sync.pattern_index_]]).times[0]
        np.testing.assert_array_equal(own, np.arange(sync.n_frames_))


# -- pandas in and out ----------------------------------------------------------------


@pytest.mark.parametrize("estimator", TRANSFORMERS, ids=by_name)
@pytest.mark.parametrize(("kind", "setting"), [("list", "local"), ("multiindex", "global")])
def test_pandas_output_of_collections(estimator, kind, setting, trials):
    X = KINDS[kind](trials)
    plain, estimator = fit_once(estimator).transform(trials), clone(estimator)
    if setting == "local":
        out = estimator.set_output(transform="pandas").fit_transform(X)
    else:
        with config_context(transform_output="pandas"):
            out = estimator.fit_transform(X)
    assert isinstance(out, pd.DataFrame)
    assert out.index.names == ["trial", "frame"]
    assert list(out.columns) == list(estimator.get_feature_names_out())
    for frame, expected in zip(to_trials(out), plain, strict=True):
        np.testing.assert_array_equal(frame, expected)


@pytest.mark.parametrize("estimator", TRANSFORMERS, ids=by_name)
def test_names_of_input_features_are_one_each(estimator, trials):
    fitted, n = fit_once(estimator), trials[0].shape[1]
    with pytest.raises(ValueError, match=f"must name every feature once, but 'zz' comes {n} times"):
        fitted.get_feature_names_out(["zz"] * n)
    with pytest.raises(ValueError, match="input_features should have length equal"):
        fitted.get_feature_names_out(["zz"])
    assert len(fitted.get_feature_names_out([f"c{k}" for k in range(n)]))
    named = clone(estimator).fit([pd.DataFrame(x, columns=NAMES) for x in trials])
    with pytest.raises(ValueError, match="input_features is not equal to feature_names_in_"):
        named.get_feature_names_out([f"c{k}" for k in range(n)])


def test_pandas_output_keeps_what_levels_are_called(trials):
    X = to_frame(trials, columns=NAMES).rename_axis(["trial", "sample"])
    frames = [df.rename_axis("sample") for df in to_trials(X)]
    for estimator in (ASpace(2), LinearSynchronizer(20)):
        pandas = clone(estimator).set_output(transform="pandas")
        # Frames of a clock are no samples of a trial.
        last = "frame" if hasattr(estimator, "n_frames") else "sample"
        assert pandas.fit_transform(X).index.names == ["trial", last]
        assert pandas.fit_transform(frames).index.names == ["trial", last]


def test_inverse_transform_takes_pandas_output(trials):
    """Warnings are errors here."""
    for estimator in (ASpace(2), DirectionCosines(Skeleton.paper())):
        fitted = clone(estimator).fit(trials)
        expected = np.concatenate(fitted.inverse_transform(fitted.transform(trials)))
        fitted.set_output(transform="pandas")
        points = fitted.transform(trials)
        np.testing.assert_array_equal(fitted.inverse_transform(points), expected)
        with pytest.raises(ValueError, match="should match"):
            fitted.inverse_transform(points[points.columns[::-1]])


@pytest.mark.parametrize("estimator", TRANSFORMERS, ids=by_name)
def test_polars_output_of_a_collection_is_refused(estimator, trials):
    fitted = clone(estimator).fit(trials).set_output(transform="polars")
    with pytest.raises(ValueError, match="'polars'") as caught:
        fitted.transform(trials)
    for word in ("pl.DataFrame(", "'pandas'"):
        assert word in str(caught.value)


# -- bad input --------------------------------------------------------------------------


def put(value):
    def change(x):
        x = x.copy()
        x[3, 2] = value
        return x

    return change


# They take gaps of a running movement, though not in a fit.
FOLLOWING = all_of("OnlineSynchronizer")
# What else is refused, tests/inputs/test_bad_inputs.py tries on an estimator of each kind.
BAD = {
    "NaN": (put(np.nan), r"Trial 4, frame [23], feature 2 is NaN"),
    "infinity": (put(np.inf), r"Trial 4, frame 3, feature 2 is infinity"),
    "one frame": (lambda x: x[:1], r"Trial 4 has shape \(1, 45\), .* at least 2 frames"),
    "wrong width": (lambda x: x[:, 1:], r"Trial 4 has 44 features .* trial 0 has 45"),
}


@pytest.mark.parametrize("estimator", ESTIMATORS, ids=by_name)
@pytest.mark.parametrize("fault", BAD)
@pytest.mark.parametrize("when", ["fit", "after"])
def test_bad_trial_is_refused_by_its_index(estimator, fault, when, trials):
    change, message = BAD[fault]
    bad = [change(x) if i == 4 else x for i, x in enumerate(trials)]
    takes_gaps = get_tags(estimator).input_tags.allow_nan
    if fault == "NaN" and (takes_gaps or (when == "after" and estimator in FOLLOWING)):
        # What was not seen; the other trials are as without it.
        fitted = clone(estimator).fit(bad) if when == "fit" else fit_once(estimator)
        np.testing.assert_array_equal(outputs(fitted, bad)[0][0], outputs(fitted, bad[:1])[0][0])
        return
    with pytest.raises(ValueError, match=message):
        clone(estimator).fit(bad) if when == "fit" else outputs(fit_once(estimator), bad)


@pytest.mark.parametrize("estimator", ESTIMATORS, ids=by_name)
def test_other_kinds_widths_and_names_are_refused(estimator, trials):
    for X, message in (([], "0 trials"), ({"a": np.zeros((3, WIDTH))}, "got dict")):
        with pytest.raises(ValueError, match=message):
            clone(estimator).fit(X)
    with pytest.raises(ValueError, match=r"Trial 0 has 42 features a frame.*expecting 45"):
        outputs(fit_once(estimator), [x[:, 3:] for x in trials])
    frames = KINDS["frames"](trials)
    fitted = clone(estimator).fit(frames)
    with pytest.raises(ValueError, match="feature names should match"):
        outputs(fitted, [x.add_prefix("other ") for x in frames])


@pytest.mark.parametrize("estimator", SEQUENCE_LEVEL, ids=by_name)
def test_sequence_level_estimators_keep_to_the_kind_of_fit(estimator, trials):
    fitted = clone(estimator).fit(trials)
    with pytest.raises(ValueError, match=r"wrap one sequence as \[X\]"):
        outputs(fitted, trials[0])
    rows = np.stack([x[:, 0] for x in trials])
    fitted.fit(rows)
    assert fitted.n_features_in_ == 30
    with pytest.raises(ValueError, match="was fitted on a 2-D array"):
        outputs(fitted, trials)


@pytest.mark.parametrize("estimator", SYNCHRONIZERS, ids=by_name)
def test_rows_are_univariate_sequences(estimator, trials):
    rows = np.stack([x[:, 0] for x in trials])
    columns = [x[:, :1] for x in trials]
    expected = clone(estimator).fit(columns).transform(columns)[:, :, 0]
    np.testing.assert_array_equal(clone(estimator).fit(rows).transform(rows), expected)


# -- fits that fail ---------------------------------------------------------------------


def with_infinity(X):
    return [*X[:-1], np.where(np.arange(len(X[-1]))[:, np.newaxis] == 3, np.inf, X[-1])]


# By the name of the class: what has the form of its input, and tells it too little.
TOO_LITTLE = {
    **dict.fromkeys(
        ["DirectionCosines", "JointPositions"], (lambda X: [0 * x for x in X], "has no length")
    ),
    "ASpace": (lambda X: X[0][:1], "at least 2 poses"),
    "FrameWise": (lambda X: X[0][:1], "n_components=2 must be between"),
    **dict.fromkeys(
        ["ActionModel", "ActionDetector", "MotionTracker"], (lambda X: X[:1], "at least 2 trials")
    ),
    "ActionClassifier": (lambda X: X[:1], "at least 2 classes"),
    "CycleSegmenter": (lambda X: [x[:40] for x in X], "Trial 0: "),
}
FAILURES = [
    (estimator, *failure)
    for name, estimators in INSTANCES.items()
    for estimator in estimators
    for failure in [(with_infinity, "infinity"), TOO_LITTLE.get(name)]
    if failure is not None
]


@pytest.mark.parametrize(("estimator", "spoil", "message"), FAILURES, ids=by_name)
def test_a_fit_that_fails_leaves_the_earlier_fit_or_none(estimator, spoil, message):
    X, unfitted, fitted = data_for(estimator), clone(estimator), through_pickle(fit_once(estimator))
    for each in (unfitted, fitted):
        with pytest.raises(ValueError, match=message):
            each.fit(spoil(X))
    assert_same(outputs(fitted, X), expected_of(estimator))
    with pytest.raises(NotFittedError):
        outputs(unfitted, X)


# -- those whose width their skeleton fixes: scikit-learn's demands, written out ------------


@pytest.mark.parametrize(
    ("kind", "reference", "width"),
    [
        *((DirectionCosines, reference, 37) for reference in ("heading", "parent", "world")),
        *((JointPositions, reference, 42) for reference in ("heading", "world")),
    ],
)
def test_body_estimators_follow_scikit_learn_on_rows(kind, reference, width, trials):
    X = trials[0]
    estimator = kind(Skeleton.paper(), reference)
    params = estimator.get_params()
    assert estimator.fit(X, y=np.zeros(30)) is estimator
    assert estimator.get_params() == params
    out = estimator.transform(X)
    assert out.shape == (30, width)
    np.testing.assert_array_equal(clone(estimator).fit_transform(X.tolist()), out)
    np.testing.assert_allclose(estimator.transform(X[::-1]), out[::-1], rtol=1e-12)
    frame = pd.DataFrame(X, columns=NAMES, index=[f"i{k}" for k in range(30)])
    framed = clone(estimator).set_output(transform="pandas").fit_transform(frame)
    assert list(framed.index) == list(frame.index)
    assert list(framed.columns) == list(estimator.get_feature_names_out())
    np.testing.assert_array_equal(framed, out)
    for bad in (X[:, :-1], X[0], np.where(np.eye(30, WIDTH), np.nan, X), X + 1j, X[:0]):
        with pytest.raises(ValueError):  # noqa: PT011 - scikit-learn's own messages
            clone(estimator).fit(bad)
