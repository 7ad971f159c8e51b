"""Bad inputs, one a line: the input, the estimators, and words of the error message."""

import numpy as np
import pandas as pd
import pytest
from scipy.sparse import csr_array
from sklearn.base import clone
from sklearn_motionsync import (
    ActionModel,
    ASpace,
    DenseSynchronizer,
    LinearSynchronizer,
    Match,
    TimingChannel,
    to_frame,
)

from estimators import by_name
from shift_synchronizer import ShiftSynchronizer

SYNCHRONIZERS = [LinearSynchronizer(), DenseSynchronizer(), ShiftSynchronizer()]
# Input is checked in one place: an estimator of rows and one of sequences stand for all others.
SEQUENCES = [LinearSynchronizer()]
ALL = [ASpace(), *SEQUENCES]
OF_EACH_KIND = [ASpace(), *SYNCHRONIZERS, TimingChannel(LinearSynchronizer()), ActionModel()]

NAMES = ["hip", "knee", "ankle"]
RNG = np.random.default_rng(0)
X = [np.cumsum(RNG.standard_normal((20, 3)), axis=0) for _ in range(5)]
FRAMES = [pd.DataFrame(x, columns=NAMES) for x in X]
TURNED = [df[NAMES[::-1]] for df in FRAMES]
MORE = [df.assign(toe=df["hip"]) for df in FRAMES]
TWICE = FRAMES[2].set_axis(["hip", "knee", "hip"], axis=1)
NUMBERED = [pd.DataFrame(x, columns=[10, 20, 30]) for x in X]
MIXED = [pd.DataFrame(x, columns=["hip", 1, 2]) for x in X]
LABELLED = to_frame(FRAMES, trials=["ann", "bob", "cem", "dov", "eva"])
LONG = LABELLED.reset_index().rename(columns={"trial": "trial", "frame": "time"})
DATES = pd.date_range("2020", periods=20)
CALL = "to_trials(df, by=..., time=...)"


def one(change, i=2):
    """The trials, one of them changed."""
    return [change(x.copy()) if k == i else x for k, x in enumerate(X)]


def put(value, x=None):
    def change(x):
        x = x.astype(np.result_type(x, type(value)) if not isinstance(value, str) else object)
        x[4, 1] = value
        return x

    return change if x is None else change(x)


class FDataGrid:
    """Samples, each of its own kind, as those of scikit-fda."""

    __module__ = "skfda.representation.grid"

    def __len__(self):
        return 5

    def __getitem__(self, i):
        return self


class Dataset:
    """A mapping of arrays, as that of xarray."""

    __module__ = "xarray.core.dataset"


NESTED = pd.DataFrame({name: [df[name] for df in FRAMES] for name in NAMES})


def masked(x):
    return np.ma.masked_where(np.arange(x.size).reshape(x.shape) == 7, x)


def refuses(call, words, error=(ValueError, TypeError)):
    with pytest.raises(error) as caught:
        call()
    message = str(caught.value)
    missing = [word for word in words if word not in message]
    assert not missing, f"{missing} not in: {message}"
    assert len(message) < 1000


# -- trials -------------------------------------------------------------------------

TRIALS = [
    # input, estimators, words
    (one(masked), OF_EACH_KIND, ["Trial 2", "masked", "interpolate"]),
    (one(lambda x: list(masked(x))), ALL, ["Trial 2", "masked"]),
    (one(lambda x: masked(x).astype(object)), ALL, ["Trial 2", "masked"]),
    (one(put(1j)), ALL, ["Trial 2", "complex"]),
    (one(put("1.5")), ALL, ["Trial 2", "'1.5'", "numbers"]),
    (one(lambda x: x.astype(str)), ALL, ["Trial 2", "not a numeric array"]),
    (one(lambda x: x.astype("m8[s]")), ALL, ["Trial 2", "durations", "seconds"]),
    (one(lambda x: x.astype("M8[s]")), ALL, ["Trial 2", "dates", "seconds"]),
    (one(lambda x: FRAMES[2].assign(hip=DATES)), ALL, ["Trial 2", "'hip'", "dates"]),
    (one(lambda x: FRAMES[2].assign(hip="a")), ALL, ["Trial 2", "'hip'", "'a'"]),
    (one(lambda x: csr_array(x)), ALL, ["Trial 2", "sparse", "toarray"]),
    (one(lambda x: x.astype(np.longdouble) * np.longdouble("1e400")), ALL, ["2", "infinity"]),
    (one(lambda x: [[10**400, 1, 2]] * 20), ALL, ["Trial 2", "too large"]),
    (one(put(-2e9)), ALL, ["Trial 2", "2e+09", "between 1e-09 and 1e+09", "unit"]),
    (one(lambda x: (1e30 * x).astype("f4")), ALL, ["Trial 2", "e+3", "another unit"]),
    ([1e-12 * x for x in X], ALL, ["between 1e-09 and 1e+09", "unit"]),
    (np.full((4, 9), 2e9), ALL, ["Row 0", "2e+09", "unit"]),
    (one(lambda x: x[:0]), ALL, ["Trial 2 has shape (0, 3)", "at least 2 frames"]),
    (one(lambda x: x[:, :0]), ALL, ["Trial 2", "(20, 0)", "1 feature"]),
    (one(lambda x: x[:, 0]), ALL, ["Trial 2 has shape (20,), expected (n_frames"]),
    (np.zeros((2, 3, 4, 5)), ALL, ["shape (2, 3, 4, 5)"]),
    (np.zeros(5), ALL, ["xpected 2D array"]),
    ((x for x in X), ALL, ["got generator"]),
    (one(lambda x: [[1, 2, 3], [4, 5]]), ALL, ["Trial 2", "parts differ in", "times of spikes"]),
    (
        LABELLED.mask(LABELLED["knee"] == X[1][4, 1]),
        SYNCHRONIZERS[2:],
        ["'bob'", "frame 4", "'hip'", "NaN"],
    ),
    ([*FRAMES[:2], FRAMES[2][NAMES[:2]]], ALL, ["Trial 2", "it lacks ['ankle']", "common"]),
    ([*FRAMES[:2], MORE[2]], ALL, ["Trial 2", "has besides ['toe']", "columns='common'"]),
    ([*FRAMES[:2], X[2]], ALL, ["Trial 2 has the columns None", "['hip',"]),
    ([*FRAMES[:2], TWICE], ALL, ["Trial 2", "['hip', 'knee', 'hip']", "lacks ['ankle']"]),
    ([*NUMBERED[:2], NUMBERED[2].add_prefix("n")], ALL, ["Trial 2", "'n10'", "[10, 20, 30]"]),
    (MIXED, ALL, ["['int', 'str']", "astype(str)"]),
    (["a.csv", "b.csv"], ALL, ["'a.csv'", "pd.read_csv(path) reads files"]),
    (["a.bvh", "b.bvh"], ALL, ["'a.bvh'", "read_motion(path) reads files"]),
    ("a.csv", ALL, ["got str"]),
    (np.ma.masked_less(X[0], 0), ALL, ["masked"]),
    (LONG.drop(columns="trial"), SEQUENCES, [CALL, "'time'"]),
    (FRAMES[0], SEQUENCES, ["'hip'", "to_trials", "to_numpy()"]),
    (LONG, ALL, ["'trial'", "'ann'"]),
    (LABELLED.assign(k=1).set_index("k", append=True), SEQUENCES, ["(1, 3)", "at least 2 frames"]),
    (X[0].tolist()[:2] + [[1.0]], ALL, ["Trial 0 has 3 values", "x[:, np.newaxis]"]),
    (pd.Series({"a": X[0]}), ALL, ["got Series", "list"]),
    ([x for _, x in LONG.groupby("trial")], ALL, ["'ann'", "'trial'", CALL]),
    ([x.T[:, : 15 + i] for i, x in enumerate(X)], ALL, ["Trial 1 has 16", "[x.T for x in X]"]),
    (
        one(lambda x: x.view("f8,f8,f8")[:, 0]),
        ALL,
        ["Trial 2", "not a numeric array", "('f2', '<f8')"],
    ),
    (one(lambda x: dict(enumerate(x))), ALL, ["Trial 2 is of type dict"]),
    ([df.set_axis([*"aab"], axis=1) for df in FRAMES], ALL, ["Trial 0", "2 columns", "'a'"]),
    (FDataGrid(), ALL, ["got FDataGrid", "list(X.data_matrix)"]),
    ([Dataset(), Dataset()], ALL, ["got Dataset", "from_poses(poses)]"]),
    (Dataset(), ALL, ["got Dataset", "from_poses(X)"]),
    (NESTED.assign(age=30), ALL, ["Column 'age' of trial 0 holds 30", "drop"]),
    (NESTED.assign(knee=NESTED["knee"].map(lambda x: x[:9])), ALL, ["'knee' of trial 0", "9"]),
    (NESTED.assign(hip=[x.set_axis(x.index + 1) for x in NESTED["hip"]]), ALL, ["same frames"]),
]


def for_each_estimator(table):
    """The rows of a table, one for each of the estimators that a row names last but one."""
    return [(*row[:-2], each, row[-1]) for row in table for each in row[-2]]


@pytest.mark.parametrize(("given", "estimator", "words"), for_each_estimator(TRIALS), ids=by_name)
def test_fit_refuses(given, estimator, words):
    if given is LONG and estimator in SEQUENCES:
        words = [CALL]
    fresh = clone(estimator)
    refuses(lambda: fresh.fit(given), words)
    learnt = {name for name in vars(fresh) if name.endswith("_")}
    assert learnt <= {"n_features_in_", "feature_names_in_"}, "half fitted"


FITTED_ON = [
    # fitted on, input, estimators, words
    (FRAMES, [FRAMES[0], MORE[1]], ALL, ["Trial 1", "'toe'", "feature names should match"]),
    (NUMBERED, FRAMES, ALL, ["'hip'", "[10, 20, 30]"]),
    (X, one(masked), OF_EACH_KIND, ["Trial 2", "masked"]),
    (X, one(lambda x: x + 0j), ALL, ["Trial 2", "complex"]),
    (X, one(lambda x: 1e35 * x), ALL, ["Trial 2", "e+3", "another unit"]),
]


@pytest.mark.parametrize(
    ("training", "given", "estimator", "words"),
    for_each_estimator(FITTED_ON),
    ids=by_name,
)
def test_fitted_estimator_refuses(training, given, estimator, words):
    fitted = clone(estimator).fit(training)
    ask = fitted.transform if hasattr(fitted, "transform") else fitted.predict
    refuses(lambda: ask(given), words)


@pytest.mark.parametrize("estimator", OF_EACH_KIND, ids=by_name)
@pytest.mark.parametrize("tables", [FRAMES, NUMBERED], ids=["text", "numbers"])
def test_columns_are_aligned_by_name(estimator, tables):
    """To those of the first in fit, and to those of fit later: alone or together the same bits."""
    names, rng = list(tables[0]), np.random.default_rng(3)
    given = [tables[0], *(x[[names[k] for k in rng.permutation(3)]] for x in tables[1:])]
    assert any(list(x) != names for x in given)
    fitted, expected = clone(estimator).fit(given), clone(estimator).fit(tables)
    method = "transform" if hasattr(fitted, "transform") else "score_samples"
    ask, right = getattr(fitted, method), getattr(expected, method)(tables)
    for answers in (ask(given), ask(given[::-1])[::-1], [ask([x])[0] for x in given]):
        for answer, one in zip(answers, right, strict=True):
            np.testing.assert_array_equal(answer, one)


def test_messages_about_columns_are_short():
    """Two hundred columns of long names, as C3D files have them."""
    names = [
        f"{'a very long name of a marker ' * 3}{k}_{axis}" for k in range(70) for axis in "xyz"
    ]
    tables = [pd.DataFrame(np.ones((3, 210)), columns=names) for _ in range(2)]
    tables[1] = tables[1].add_prefix("x")
    for k, x in enumerate(tables):
        x.attrs["trial"] = "a recording of a long name" * 9 + str(k)
    fitted = ASpace().fit(tables[:1])
    for ask in (ASpace().fit, fitted.transform):
        with pytest.raises(ValueError, match="Trial 1") as caught:
            ask(tables)
        assert len(str(caught.value)) < 600


def test_message_names_the_columns_that_differ_from_those_of_fit():
    """Of hundreds of columns the first are alike."""
    names = [f"rig_{k}" for k in range(300)]
    x = pd.DataFrame(np.eye(300), columns=names)
    other = x.rename(columns={"rig_7": "rig2_7"})
    for given in ([x, other], [other]):
        with pytest.raises(ValueError, match=r"lacks \['rig_7'\]; it has besides \['rig2_7'\]"):
            ASpace().fit([x]).transform(given)


# -- parameters -----------------------------------------------------------------------------

PARAMETERS = [
    # parameters, estimators, words
    ({"pattern": X[0][:, :2]}, SYNCHRONIZERS, ["shape (n_frames, 3)", "(20, 2)"]),
    ({"pattern": X[0][:1]}, SEQUENCES, ["at least 2 frames", "(1, 3)"]),
    ({"pattern": masked(X[0])}, SEQUENCES, ["pattern", "masked"]),
    ({"pattern": put(np.nan, X[0])}, SEQUENCES, ["pattern, frame 4", "NaN"]),
    ({"pattern": True}, SEQUENCES, ["pattern", "index", "True"]),
    ({"pattern": 5}, SYNCHRONIZERS, ["pattern=5", "5 trials"]),
    ({"pattern": 1e40 * X[0]}, SEQUENCES, ["The pattern", "another unit"]),
    ({"n_frames": 10**9}, SYNCHRONIZERS, ["n_frames = 1000000000", "GB"]),
    ({"n_frames": 10**5, "max_rate": 10**5}, SYNCHRONIZERS[1:2], ["max_rate = 100000 and max_o"]),
]


@pytest.mark.parametrize(
    ("params", "estimator", "words"), for_each_estimator(PARAMETERS), ids=by_name
)
def test_fit_refuses_parameters(params, estimator, words):
    refuses(lambda: clone(estimator).set_params(**params).fit(X), words)


@pytest.mark.parametrize("estimator", SYNCHRONIZERS, ids=by_name)
def test_pattern_of_a_table_must_have_the_names_in_order(estimator):
    turned = clone(estimator).set_params(pattern=TURNED[0])
    refuses(lambda: turned.fit(FRAMES), ["pattern", "['ankle', 'knee', 'hip']", "same order"])
    named = clone(estimator).set_params(pattern=FRAMES[0]).fit(FRAMES)
    np.testing.assert_array_equal(named.pattern_, X[0])


# -- everything else ------------------------------------------------------------------------

MODEL, FRAMED = ActionModel().fit(X), ActionModel().fit(FRAMES)
SPACE = ASpace(2).fit(FRAMES)
KEYS, KEYED = LinearSynchronizer(), LinearSynchronizer().fit(X, keyframes=[[5, 9]] * 5)
DENSE = DenseSynchronizer().fit(X)
MATCH = LinearSynchronizer().fit(X).match(X)
CALLS = [
    # call, words
    (lambda: MODEL.accepts(masked(X[0]), 0), ["poses", "masked"]),
    (lambda: MODEL.accepts(put(np.inf, X[0]), 0), ["poses, row 4, feature 1 is infinity"]),
    (lambda: FRAMED.accepts(put(np.inf, X[0]), 0), ["feature 1 ('knee') is infinity"]),
    (lambda: FRAMED.accepts(TURNED[0], 0), ["poses", "same order"]),
    (lambda: MODEL.accepts(X[0][0], 0), ["shape (n_poses, 3)", "[pose]"]),
    (lambda: MODEL.accepts(X[0], 20), ["frame", "0 to 19"]),
    (lambda: SPACE.inverse_transform(pd.DataFrame(X[0][:, :2], columns=list("ba"))), ["names"]),
    (lambda: KEYS.fit(X, keyframes="abcde"), ["keyframes", "not a numeric array"]),
    (lambda: KEYS.fit(X, keyframes=[DATES[:2]] * 5), ["Trial 0", "keyframes"]),
    (lambda: KEYS.fit(X, keyframes=[[0.31, 0.62]] * 5), ["Trial 0", "seconds * frame_rate"]),
    (lambda: KEYED.transform(X[:1], keyframes=[[0.3, 0.6]]), ["Trial 0", "[0.3, 0.6]"]),
    (lambda: KEYED.transform(X), ["fitted with key-frames", "keyframes=[...]"]),
    (lambda: Match([[0, 3, 1, 3]]), ["Trial 0", "must not decrease", "1 at frame 2"]),
    (lambda: Match(np.ma.masked_equal([[0, 1, 2]], 1)), ["times", "masked"]),
    (lambda: Match([[0, np.nan, 2]]), ["Trial 0", "times"]),
    (lambda: Match([[0, 1]], np.ma.masked_equal([1], 1)), ["distances", "masked"]),
    (lambda: MATCH.warp(one(masked)), ["Trial 2", "masked"]),
    (lambda: MATCH.seconds(X, "fast"), ["frame_rate", "'fast'"]),
    (lambda: MATCH.frames(["a"] * 5), ["lengths", "'a'"]),
    (lambda: to_frame(X[0]), ["single 2-D input", "[X]"]),
    (lambda: to_frame(X, columns=["a"]), ["3 features", "got 1"]),
    (lambda: to_frame([]), ["0 trials"]),
    (lambda: to_frame([X[0], X[0][:1]]), ["Trial 1", "at least 2 frames and 1 feature"]),
    (lambda: to_frame(X[:2], trials=["a", "a"]), ["2 different labels"]),
    (lambda: to_frame(X[:2], trials=["a", None]), ["Trial 1", "no label", "None"]),
    (lambda: to_frame(X[:2], trials=[("a", 1), ("a", pd.NA)]), ["Trial 1", "<NA>"]),
    (lambda: MATCH.to_frame(labels=[*"abcd", pd.NaT]), ["Trial 4", "no label", "NaT"]),
    (lambda: DENSE.disparity_space(X, trial=True), ["trial=True", "0 to 4"]),
]


@pytest.mark.parametrize(("call", "words"), CALLS, ids=range(len(CALLS)))
def test_call_refuses(call, words):
    refuses(call, words)


@pytest.mark.parametrize("estimator", ALL, ids=by_name)
@pytest.mark.parametrize("kind", [np.stack, list, lambda X: [pd.DataFrame(x) for x in X]])
def test_fit_warns_of_exchanged_axes(estimator, kind):
    exchanged = kind([x.T for x in X])
    with pytest.warns(UserWarning, match=r"3 frames of 20 features.* \[x\.T for x in X\]"):
        clone(estimator).fit(exchanged)
    rng = np.random.default_rng(0)
    with pytest.warns(UserWarning, match="4 frames of 50 features"):
        clone(estimator).fit(kind(list(rng.standard_normal((5, 4, 50)))))
    # In the right order there may be fewer frames than features, and named columns are features.
    clone(estimator).fit(kind(list(np.cumsum(rng.standard_normal((5, 12, 40)), axis=1))))
    clone(estimator).fit([pd.DataFrame(x.T, columns=[f"c{i}" for i in range(20)]) for x in X])


@pytest.mark.filterwarnings("ignore::sklearn_motionsync.SynchronizationWarning")
@pytest.mark.parametrize("estimator", SEQUENCES, ids=by_name)
def test_fit_warns_of_one_trial_that_is_taken_as_many(estimator):
    rng = np.random.default_rng(0)
    trial = np.cumsum(rng.standard_normal((100, 6)), axis=0)
    with pytest.warns(UserWarning, match=r"100 univariate trials of 6 frames.* as \[X\]"):
        clone(estimator).fit(trial)
    bend = np.sin(np.linspace(0, 3, 30)) * rng.uniform(0.9, 1.1, (60, 1))
    clone(estimator).fit(bend + 0.01 * rng.standard_normal(bend.shape))


@pytest.mark.parametrize("estimator", OF_EACH_KIND, ids=by_name)
def test_fit_accepts_magnitudes_within_the_limits(estimator):
    """The lower limit is of a training set as a whole: single trials may be tiny."""
    for factor in (1e-8, 1e7):
        clone(estimator).fit([factor * x for x in X])
    fitted = clone(estimator).fit([*X, 1e-12 * X[0], 0 * X[0]])
    if hasattr(fitted, "transform"):
        # An answer for one trial does not depend on the others.
        fitted.transform([1e-12 * X[0]])


@pytest.mark.parametrize("columns", [["walk1", "walk2", "walk3"], [4, 5, 6]])
@pytest.mark.parametrize("index", [np.arange(20) / 50, DATES], ids=["seconds", "dates"])
def test_fit_refuses_a_table_of_numbered_trials_by_its_time(columns, index):
    wide = pd.DataFrame(X[0], columns=columns, index=index)
    refuses(lambda: DenseSynchronizer().fit(wide), [CALL, "df.T.to_numpy()"])
