"""The classifier of actions: its kernel written out, few performances, strangers, and people."""

import json
import pickle

import matplotlib.pyplot as plt
import numpy as np
import pandas as pd
import pytest
from scipy.special import softmax
from sklearn import config_context
from sklearn.calibration import CalibratedClassifierCV
from sklearn.ensemble import StackingClassifier
from sklearn.exceptions import NotFittedError
from sklearn.linear_model import LogisticRegression
from sklearn.metrics import log_loss, roc_auc_score
from sklearn.model_selection import (
    GridSearchCV,
    GroupKFold,
    cross_val_predict,
    cross_val_score,
    cross_validate,
)
from sklearn.pipeline import make_pipeline
from sklearn_motionsync import (
    ActionClassifier,
    ActionModel,
    ASpace,
    DenseSynchronizer,
    DirectionCosines,
    find_departures,
    synchronization_distances,
    to_frame,
)
from sklearn_motionsync.datasets import load_performances, make_bending
from sklearn_motionsync.display import SkeletonDisplay
from sklearn_motionsync.recognition.kernel import KernelRegression, deal, decide

KINDS = ("wave", "rise", "turn")


def movements(n=10, seed=0, n_people=5, noise=0.05):
    """Three movements of some people, each at its own pace: data, labels, people."""
    rng = np.random.default_rng(seed)
    X, people = [], np.arange(3 * n) % n_people
    for i in range(3 * n):
        t = np.linspace(0, 1, rng.integers(20, 60)) ** rng.uniform(0.8, 1.25)
        wave, ramp = np.sin(9 * t), 2 * t
        curves = ([wave, 0 * t], [ramp, wave], [np.cos(6 * t), ramp])[i // n]
        x = rng.uniform(0.8, 1.2) * np.column_stack(curves) + 0.1 * people[i]
        X.append(x + noise * rng.standard_normal(x.shape))
    return X, np.repeat(KINDS, n), people


@pytest.fixture(scope="module")
def known():
    return movements()


@pytest.fixture(scope="module")
def new():
    return movements(4, seed=1)


@pytest.fixture(scope="module")
def fitted(known):
    X, y, people = known
    return ActionClassifier(n_frames=30).fit(X, y, groups=people)


def few(X, y, n):
    """The first n performances of every class."""
    chosen = [i for kind in KINDS for i in np.flatnonzero(y == kind)[:n]]
    return [X[i] for i in chosen], y[chosen]


# -- what is decided, written out -------------------------------------------------------


def slow_kernel(X, new, gamma):
    """By the public distances of each cost, and by summaries one by one."""
    frames = np.concatenate(X)
    centre = frames.mean(axis=0)
    unit = np.sqrt(np.mean([((x - centre) ** 2).sum(axis=1).mean() for x in X]))
    X, new = ([(x - centre) / unit for x in some] for some in (X, new))
    kernels = []
    for cost in ("velocity", "elastic", "posture"):
        settings = {"cost": cost, "normalize": cost != "posture", "n_frames": 30, "max_offset": 0.4}
        D = synchronization_distances(X, **settings)
        median = np.median(D[np.triu_indices(len(X), 1)])
        kernels.append(np.exp(-gamma * synchronization_distances(new, X, **settings) / median))

    def seen(x):
        ends = np.mean(x[:3], axis=0), np.mean(x[-3:], axis=0)
        return np.r_[x.mean(axis=0), x.std(axis=0), x.min(axis=0), x.max(axis=0), *ends]

    Z, z = (np.array([seen(x) for x in some]) for some in (X, new))
    mean, std = Z.mean(axis=0), Z.std(axis=0)
    Z, z = (Z - mean) / std, (z - mean) / std
    apart = [[((a - b) ** 2).sum() for b in Z] for a in Z]
    median = np.median(np.array(apart)[np.triu_indices(len(X), 1)])
    kernels.append(np.exp([[-gamma * ((a - b) ** 2).sum() / median for b in Z] for a in z]))
    return np.mean(kernels, axis=0)


@pytest.mark.parametrize("gamma", [1, 0.3])
def test_decisions_are_those_of_the_kernels_written_out(known, new, gamma):
    X, y, people = known
    codes = np.unique(y, return_inverse=True)[1]
    classifier = ActionClassifier(n_frames=30, gamma=gamma, C=3).fit(X, y, groups=people)
    A, b = KernelRegression(slow_kernel(X, X, gamma), 3).fit(codes)
    expected = decide(slow_kernel(X, new[0], gamma), A, b)
    np.testing.assert_allclose(classifier.decision_function(new[0]), expected, atol=2e-4)


def test_what_is_said_agrees(fitted, new):
    X, y, _ = new
    decisions = fitted.decision_function(X)
    assert fitted.classes_.tolist() == sorted(KINDS)
    np.testing.assert_allclose(decisions.sum(axis=1), 0, atol=1e-4)
    np.testing.assert_array_equal(fitted.predict(X), fitted.classes_[decisions.argmax(axis=1)])
    expected = softmax(fitted.temperature_ * decisions, axis=1)
    np.testing.assert_allclose(fitted.predict_proba(X), expected)
    np.testing.assert_array_equal(fitted.score_samples(X), decisions.max(axis=1))
    np.testing.assert_array_equal(fitted.novelty_scores(X), -decisions.max(axis=1))
    assert fitted.score(X, y) == 1


def test_of_two_classes_the_difference_decides(known, new):
    X, y, _ = known
    two = y != "turn"
    classifier = ActionClassifier(n_frames=20).fit([X[i] for i in np.flatnonzero(two)], y[two])
    decisions = classifier.decision_function(new[0])
    assert decisions.shape == (12,)
    expected = np.where(decisions > 0, "wave", "rise")
    np.testing.assert_array_equal(classifier.predict(new[0]), expected)
    wave = classifier.predict_proba(new[0])[:, 1]
    np.testing.assert_allclose(wave, 1 / (1 + np.exp(-classifier.temperature_ * decisions)))
    np.testing.assert_allclose(classifier.novelty_scores(new[0]), -np.abs(decisions) / 2)


def test_people_held_out_tell_how_sure_to_be(known, fitted):
    """Who is among the others is recognised too well to know how well strangers are."""
    X, y, _ = movements(noise=0.4)
    people = np.arange(30) % 10 // 2
    X = [x + 2 * np.sin(5 * p) for x, p in zip(X, people, strict=True)]
    named = ActionClassifier(n_frames=20).fit(X, y, groups=people)
    unnamed = ActionClassifier(n_frames=20).fit(X, y)
    assert named.temperature_ != unnamed.temperature_
    assert named.threshold_at(0.9) < unnamed.threshold_at(0.9)
    assert named.held_out_.mean() < 0.95 * unnamed.held_out_.mean()
    X, y, people = known
    # Of many people several are held out at a time, one fold of five.
    many = np.arange(30) % 7
    dealt = deal(np.unique(y, return_inverse=True)[1], many, 5)
    both = [ActionClassifier(n_frames=8).fit(X, y, groups=g) for g in (many, dealt)]
    np.testing.assert_array_equal(both[0].held_out_, both[1].held_out_)
    # Labels of groups are labels.
    again = ActionClassifier(n_frames=30).fit(X, y, groups=np.array(list("edcba"))[people])
    assert again.temperature_ == pytest.approx(fitted.temperature_)


# -- nothing else counts ----------------------------------------------------------------


def test_alone_or_together_and_by_any_number_of_jobs(known, fitted, new):
    decisions = fitted.decision_function(new[0])
    for i in (0, 5):
        np.testing.assert_array_equal(fitted.decision_function([new[0][i]])[0], decisions[i])
    np.testing.assert_array_equal(fitted.decision_function(new[0][::-1]), decisions[::-1])
    X, y, people = known
    two = ActionClassifier(n_frames=30, n_jobs=2).fit(X, y, groups=people)
    np.testing.assert_array_equal(two.decision_function(new[0]), decisions)
    assert two.temperature_ == fitted.temperature_
    again = pickle.loads(pickle.dumps(fitted))
    np.testing.assert_array_equal(again.decision_function(new[0]), decisions)


@pytest.mark.parametrize("scale", [2.0**-400, 2.0**30])
def test_the_unit_does_not_count(known, fitted, new, scale):
    X, y, people = known
    other = ActionClassifier(n_frames=30).fit([scale * x for x in X], y, groups=people)
    found = other.decision_function([scale * x for x in new[0]])
    np.testing.assert_array_equal(found, fitted.decision_function(new[0]))
    with pytest.raises(ValueError, match=r"Performance 1 is more than 1e\+30 times as large"):
        other.predict([scale * X[0], scale * X[1] * 1e40])


def test_a_place_elsewhere_does_not_count(known, fitted, new):
    X, y, people = known
    other = ActionClassifier(n_frames=30).fit([x + 1000 for x in X], y, groups=people)
    found = other.decision_function([x + 1000 for x in new[0]])
    np.testing.assert_allclose(found, fitted.decision_function(new[0]), atol=1e-3)


def test_what_the_user_does_afterwards_does_not_count(known):
    X, y, _ = known
    mine = [x.copy() for x in X]
    classifier = ActionClassifier(n_frames=20).fit(mine, y)
    before = classifier.model_of("rise")[-1].mean_, classifier.predict_proba(X)
    for x in mine:
        x[:] = 0
    np.testing.assert_array_equal(classifier.model_of("rise")[-1].mean_, before[0])
    np.testing.assert_array_equal(classifier.predict_proba(X), before[1])


# -- strangers --------------------------------------------------------------------------


def test_what_is_none_of_the_classes_is_rejected(fitted, new):
    X, y, _ = new
    rng = np.random.default_rng(0)
    still = [np.full((30, 2), 0.3), np.full((9, 2), -1.0)]
    shaking = [rng.standard_normal((40, 2)) for _ in range(4)]
    strangers = [*still, *shaking, *(x[::-1] for x in X[8:])]
    assert fitted.novelty_scores(strangers).min() > fitted.novelty_scores(X).max()
    careful = ActionClassifier(**fitted.get_params()).set_params(reject_below="auto")
    vars(careful).update({k: v for k, v in vars(fitted).items() if k not in fitted.get_params()})
    assert (careful.predict(strangers) == "unknown").mean() > 0.8
    assert (careful.predict(X) == y).all()
    # Rejecting changes no probability, and only what is below.
    np.testing.assert_array_equal(careful.predict_proba(X), fitted.predict_proba(X))
    largest = fitted.decision_function(X).max(axis=1)
    border = np.median(largest)
    careful.set_params(reject_below=float(border), unknown_label="?")
    np.testing.assert_array_equal(careful.predict(X) == "?", largest < border)


def test_the_threshold_keeps_the_share_it_says():
    X, y, people = movements(15, noise=0.5)
    classifier = ActionClassifier(n_frames=15).fit(X, y, groups=people)
    assert classifier.held_out_.shape == (45,)
    for coverage in (0.5, 0.8, 0.95, 0.999):
        kept = classifier.held_out_ >= classifier.threshold_at(coverage)
        assert coverage <= kept.mean() <= min(coverage + 2 / 45, 1)
    new, _, _ = movements(40, seed=3, noise=0.5)
    decisions = classifier.decision_function(new).max(axis=1)
    assert abs(np.mean(decisions >= classifier.threshold_at(0.8)) - 0.8) < 0.12
    for wrong in (0, 1, "0.9", np.nan):
        with pytest.raises(ValueError, match="coverage must be a share between 0 and 1, got"):
            classifier.threshold_at(wrong)


@pytest.mark.parametrize(
    ("labels", "unknown", "expected"),
    [
        (["a", "b"], None, "unknown"),
        ([1, 2], None, -1),
        ([1, 2], 0, 0),
        ([1.0, 2.0], None, -1.0),
        ([True, False], None, -1),
        (np.array(["a", "bc"], dtype=object), "?", "?"),
        (np.array(["a", "a much longer name"]), None, "unknown"),
    ],
)
def test_the_label_of_strangers_is_of_the_same_type(known, labels, unknown, expected):
    X = known[0][:10] + known[0][20:]
    y = np.repeat(labels, 10)
    classifier = ActionClassifier(n_frames=8, reject_below=1e9, unknown_label=unknown).fit(X, y)
    assert classifier.predict(X[:2]).tolist() == [expected] * 2
    found = classifier.set_params(reject_below=-1e9).predict(X)
    assert set(found.tolist()) == set(np.asarray(labels).tolist())


@pytest.mark.parametrize(
    ("labels", "unknown", "message"),
    [
        (["a", "unknown"], None, "unknown_label='unknown' is one of the classes"),
        ([-1, 1], None, "unknown_label=-1 is one of the classes"),
        (["a", "b"], 3, "unknown_label=3 must be text, like the classes"),
        ([1, 2], "new", "unknown_label='new' must be a number, like the classes"),
    ],
)
def test_a_label_that_cannot_be_told_apart(known, labels, unknown, message):
    X = known[0][:10] + known[0][20:]
    classifier = ActionClassifier(n_frames=8, reject_below="auto", unknown_label=unknown)
    with pytest.raises(ValueError, match=message):
        classifier.fit(X, np.repeat(labels, 10)).predict(X)


# -- few, short, odd --------------------------------------------------------------------


def test_one_performance_a_class(known, new):
    X, y = few(*known[:2], 1)
    classifier = ActionClassifier(n_frames=30).fit(X, y)
    assert classifier.score(new[0], new[1]) > 0.9
    assert np.isfinite(classifier.predict_proba(new[0])).all()
    with pytest.raises(ValueError, match="The class 'rise' has one performance: what varies"):
        classifier.model_of("rise")
    two = ActionClassifier(n_frames=8).fit(X[:2], y[:2])
    assert two.temperature_ == pytest.approx(4)
    with pytest.raises(ValueError, match="No threshold can be learnt, as nobody could be held"):
        two.threshold_at(0.95)


def test_unfitted():
    for ask in (lambda c: c.model_of("wave"), lambda c: c.threshold_at(0.9)):
        with pytest.raises(NotFittedError):
            ask(ActionClassifier())


def test_clips_of_three_frames_and_of_two(known, new):
    for n in (3, 2):
        X, tried = (
            [x[np.linspace(0, len(x) - 1, n).astype(int)] for x in some[0]] for some in (known, new)
        )
        classifier = ActionClassifier(n_frames=9).fit(X, known[1], groups=known[2])
        assert classifier.score(tried, new[1]) > 0.7
        assert np.isfinite(classifier.predict_proba(tried)).all()


def test_a_class_that_only_one_person_does(known, new):
    X, y, _ = known
    people = np.where(y == "turn", 0, np.arange(30) % 3)
    classifier = ActionClassifier(n_frames=20).fit(X, y, groups=people)
    assert classifier.score(new[0], new[1]) == 1
    # Nobody knows it when that person is held out; the others are told apart.
    assert np.isfinite(classifier.held_out_).all()
    # One class each: nothing can be learnt without either of them.
    two = y != "rise"
    X = [X[i] for i in np.flatnonzero(two)]
    classifier = ActionClassifier(n_frames=20).fit(X, y[two], groups=y[two])
    assert np.isnan(classifier.held_out_).all()
    assert classifier.temperature_ == pytest.approx(4)


def test_all_alike(known):
    X = [known[0][0]] * 4
    classifier = ActionClassifier(n_frames=8).fit(X, [0, 0, 1, 1])
    np.testing.assert_allclose(classifier.predict_proba(X), 0.5, atol=1e-3)
    X = [np.full((5, 2), 3.0)] * 4
    classifier = ActionClassifier(n_frames=8).fit(X, [0, 0, 1, 1])
    np.testing.assert_allclose(classifier.predict_proba(X), 0.5, atol=1e-3)


@pytest.mark.parametrize("constant", [0.1, -1e6 / 3])
def test_a_constant_feature_does_not_count(known, fitted, new, constant):
    def wider(X):
        return [np.column_stack([x, np.full(len(x), constant)]) for x in X]

    X, y, people = known
    classifier = ActionClassifier(n_frames=30).fit(wider(X), y, groups=people)
    found = classifier.decision_function(wider(new[0]))
    np.testing.assert_allclose(found, fitted.decision_function(new[0]), atol=1e-3)


def test_costs_one_by_one_and_none(known, new):
    X, y, _ = known
    for costs in ("elastic", ("posture", "velocity"), np.array(["velocity"]), []):
        classifier = ActionClassifier(costs, n_frames=15).fit(X, y)
        assert classifier.score(new[0], new[1]) > 0.8
    bare = ActionClassifier(["elastic"], summaries=False, n_frames=15).fit(X, y)
    assert bare.score(new[0], new[1]) > 0.8


@pytest.mark.parametrize(
    ("params", "y", "groups", "message"),
    [
        ({"costs": ["speed"]}, None, None, r"costs must be some of \['velocity', 'elastic', 'p"),
        ({"costs": ["elastic"] * 2}, None, None, "each once"),
        ({"costs": [], "summaries": False}, None, None, "at least one of them without summaries"),
        ({"C": 0}, None, None, "'C' parameter of ActionClassifier"),
        ({"reject_below": "never"}, None, None, "'reject_below' parameter"),
        ({}, ["a"] * 30, None, "at least 2 classes, got one class: 'a'.* ActionDetector learns"),
        ({}, ["a"] * 29, None, "inconsistent numbers of samples"),
        ({}, [*["a", None] * 15], None, "y has no label for performance 1"),
        ({}, np.linspace(0, 1, 30), None, "Unknown label type: continuous"),
        ({}, [[1, 2]] * 30, None, "1d array"),
        ({}, None, ["x"] * 30, "All performances are of the group 'x'"),
        ({}, None, ["x", "y"], "groups has 2 labels, and there are 30 performances"),
    ],
)
def test_what_is_refused(known, params, y, groups, message):
    X, right, _ = known
    classifier = ActionClassifier(**{"n_frames": 8, **params})
    with pytest.raises(ValueError, match=message):
        classifier.fit(X, right if y is None else y, groups=groups)


# -- among others of scikit-learn -------------------------------------------------------


@pytest.fixture(scope="module")
def bends():
    """Bends and half bends of four people: data, labels, people, a pipeline."""
    bunch = make_bending(12, n_actors=4, n_frames=30, random_state=0)
    X = bunch.data + [x[: len(x) // 2] for x in bunch.data]
    pipe = make_pipeline(DirectionCosines(bunch.skeleton), ActionClassifier(n_frames=15))
    return X, np.repeat(["bend", "half"], 12), np.tile(bunch.actor, 2), pipe


def test_cross_validation_searches_and_ensembles(bends):
    X, y, people, pipe = bends
    assert cross_val_score(pipe, X, y, groups=people, cv=GroupKFold(4)).mean() > 0.9
    proba = cross_val_predict(pipe, X, y, method="predict_proba", cv=3)
    assert log_loss(y, proba) < 0.5
    calibrated = CalibratedClassifierCV(pipe, cv=3).fit(X, y)
    assert calibrated.score(X, y) > 0.9
    world = make_pipeline(DirectionCosines(pipe[0].skeleton, "world"), ActionClassifier(n_frames=8))
    stack = StackingClassifier([("a", pipe), ("b", world)], LogisticRegression(), cv=3)
    assert stack.fit(X, y).score(X, y) > 0.9
    reached = pipe.fit(X, y, actionclassifier__groups=people)[-1].temperature_
    with config_context(enable_metadata_routing=True):
        routed = make_pipeline(pipe[0], ActionClassifier(n_frames=15).set_fit_request(groups=True))
        assert routed.fit(X, y, groups=people)[-1].temperature_ == reached
        cv = GroupKFold(4)
        scores = cross_validate(routed, X, y, params={"groups": people}, cv=cv)["test_score"]
        assert scores.mean() > 0.9
        search = GridSearchCV(routed, {"actionclassifier__C": [1, 10]}, cv=GroupKFold(2))
        assert search.fit(X, y, groups=people).best_score_ > 0.9


def test_tables_are_the_same(bends):
    X, y, _, pipe = bends
    expected = pipe.fit(X, y).predict_proba(X)
    table = to_frame(X, columns=pipe[0].skeleton.column_names)
    framed = make_pipeline(*pipe).set_output(transform="pandas").fit(table, y)
    np.testing.assert_array_equal(framed.predict_proba(table), expected)
    assert list(framed[-1].feature_names_in_)[:2] == ["pelvis_height", "hip_x"]
    assert list(framed[-1].model_of("half")[0].feature_names_in_)[:1] == ["pelvis_height"]


# -- why --------------------------------------------------------------------------------


def test_a_class_is_explained_by_its_own_performances(bends):
    X, y, people, pipe = bends
    pipe.fit(X, y, actionclassifier__groups=people)
    mine = [X[i] for i in np.flatnonzero(y == "half")]
    expected = make_pipeline(pipe[0], DenseSynchronizer(15), ActionModel())
    expected.fit(mine, actionmodel__groups=people[y == "half"])
    explained = pipe[-1].model_of("half")
    np.testing.assert_array_equal(explained[-1].mean_, expected[-1].mean_)
    assert explained[-1].threshold_ == expected[-1].threshold_
    with pytest.raises(ValueError, match=r"no class 'jump'; the classes are \['bend', 'half'\]"):
        pipe[-1].model_of("jump")


@pytest.mark.parametrize("kind", ["list", "table"])
def test_departures_are_those_from_the_class_that_is_given(bends, kind):
    X, y, people, pipe = bends
    steps = pipe[0], ASpace(0.99), ActionClassifier(n_frames=15, reject_below=1e9)
    columns = steps[0].skeleton.column_names
    known = to_frame(X, columns=columns) if kind == "table" else X
    output = "pandas" if kind == "table" else "default"
    pipe = (
        make_pipeline(*steps)
        .set_output(transform=output)
        .fit(known, y, actionclassifier__groups=people)
    )
    new = [X[13], X[0], X[14], X[1] + 0.0]
    joints = new[0].reshape(len(new[0]), -1, 3)
    wrist = steps[0].skeleton.index_of("left_wrist")
    new[0] = joints.copy().reshape(len(joints), -1)
    new[0][5:12, 3 * wrist + 1] += 0.4
    given = new
    if kind == "table":
        given = to_frame(new, performances=list("pqrs"), columns=columns)
    found = find_departures(pipe, given, limit=1)
    labels = list("pqrs") if kind == "table" else [0, 1, 2, 3]
    classes = found.groupby("performance", sort=False)["class"].unique()
    assert {k: v.tolist() for k, v in classes.items()} == {
        labels[0]: ["half"],
        labels[1]: ["bend"],
        labels[2]: ["half"],
        labels[3]: ["bend"],
    }
    assert list(found["performance"]) == sorted(found["performance"])
    worst = found[found["performance"] == labels[0]].iloc[0]
    assert worst["feature"].startswith("left_forearm")
    half = make_pipeline(*pipe[:-1], *pipe[-1].model_of("half"))
    mine = [new[0], new[2]]
    mine = [pd.DataFrame(x, columns=columns) for x in mine] if kind == "table" else mine
    expected = find_departures(half, mine, limit=1)
    mine = found[found["class"] == "half"].drop(columns=["class", "performance"])
    expected = expected.drop(columns="performance")
    pd.testing.assert_frame_equal(mine.reset_index(drop=True), expected)
    if kind == "table":
        return
    display = SkeletonDisplay.from_departures(pipe, given, performance=2, limit=1)
    assert display.heading.startswith("Performance 2, most like 'half', is accepted by the model")
    alone = SkeletonDisplay.from_departures(half, [new[2]], limit=1)
    assert display.titles == alone.titles
    np.testing.assert_allclose(np.array(display.scenes), np.array(alone.scenes))
    plt.close("all")
    with pytest.raises(ValueError, match=r"performance must be from 0 to 3, got \[7\]"):
        SkeletonDisplay.from_departures(pipe, given, performance=7)


def test_departures_of_curves_and_of_params_nobody_takes(known, fitted):
    x = known[0][3].copy()
    x[10:14, 1] += 4
    found = find_departures(fitted, [x])
    assert found.loc[0, ["performance", "class", "feature"]].tolist() == [0, "wave", "x1"]
    rows = np.stack([np.sin(np.linspace(0, k, 30)) for k in (3, 3.1, 3.2, 8, 8.1, 8.2)])
    classifier = ActionClassifier(n_frames=15).fit(rows, [0, 0, 0, 1, 1, 1])
    assert set(find_departures(classifier, rows, limit=0.5)["class"]) == {0, 1}
    with pytest.raises(TypeError, match="find_departures got 'keyframes', which is no argument"):
        find_departures(fitted, [x], keyframes=[[3]])


# -- people -----------------------------------------------------------------------------


def test_people_who_were_not_seen(real_data):
    """The first of the published halves of ten people, an action left out, and what is rejected."""
    folder = real_data / "utkinect"
    bunch = load_performances(folder / "utkinect_positions.npz")
    splits = json.loads((folder / "utkinect_splits.json").read_text())
    X = DirectionCosines(bunch.skeleton).fit_transform(bunch.data)
    number = np.array([int(actor[1:]) for actor in bunch.actor])
    tried = np.flatnonzero(np.isin(number, splits["test_actors"][0]))
    for left_out in ("", "sitDown"):
        train = np.isin(number, splits["train_actors"][0]) & (bunch.target != left_out)
        train = np.flatnonzero(train)
        classifier = ActionClassifier(n_frames=30)
        classifier.fit([X[i] for i in train], bunch.target[train], groups=number[train])
        new, truth = [X[i] for i in tried], bunch.target[tried]
        if left_out:
            assert roc_auc_score(truth == left_out, classifier.novelty_scores(new)) > 0.85
            continue
        proba = classifier.predict_proba(new)
        assert np.mean(classifier.classes_[proba.argmax(axis=1)] == truth) > 0.92
        assert log_loss(truth, proba) < 0.25
        kept = classifier.set_params(reject_below="auto").predict(new) != "unknown"
        assert kept.mean() > 0.9
        still = classifier.novelty_scores([x[:1].repeat(len(x), axis=0) for x in new])
        moving = classifier.novelty_scores(new)
        strange = np.repeat([0, 1], [len(moving), len(still)])
        assert roc_auc_score(strange, np.concatenate([moving, still])) > 0.95
