"""The classifier: against its kernel written out, of few trials, of unknown actions."""

import copy
import json

import numpy as np
import pytest
from scipy.special import softmax
from sklearn import clone, config_context
from sklearn.exceptions import NotFittedError
from sklearn.linear_model import LogisticRegression
from sklearn.metrics import log_loss, roc_auc_score
from sklearn.model_selection import GridSearchCV, GroupKFold, cross_validate
from sklearn.pipeline import make_pipeline
from sklearn_motionsync import (
    ActionClassifier,
    DirectionCosines,
    to_frame,
)
from sklearn_motionsync.datasets import load_trials, make_bending
from sklearn_motionsync.display import SkeletonDisplay
from sklearn_motionsync.model import find_departures
from sklearn_motionsync.recognition.classifier import choose_landmarks
from sklearn_motionsync.recognition.distances import (
    PairwiseDistance,
    normalise_time,
    pairwise_distances,
)
from sklearn_motionsync.recognition.kernel import (
    KernelRegression,
    align_weights,
    decision_values,
    fit_temperature,
)
from sklearn_motionsync.utils.parallel import Progress

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


# -- the kernel, written out -----------------------------------------------------------


def slow_views(X, new, landmarks):
    """Kernels (4, n_new, n_landmarks) by distances of each cost, and by summaries one by one."""
    is_pair = ~np.eye(len(X), dtype=bool)[:, landmarks]
    frames = np.concatenate(X)
    centre = frames.mean(axis=0)
    unit = np.sqrt(np.mean([((x - centre) ** 2).sum(axis=1).mean() for x in X]))
    X, new = ([(x - centre) / unit for x in some] for some in (X, new))
    kernels = {}
    for cost in ("velocity", "elastic", "pose"):
        comparison = PairwiseDistance(cost, normalize=cost != "pose", n_frames=30, max_offset=0.4)
        mine, others = (comparison.features(normalise_time(some, 30)) for some in (X, new))
        apart, asked = (
            pairwise_distances(comparison, some, mine[landmarks], progress=Progress(None, 0))
            for some in (mine, others)
        )
        kernels[cost] = np.exp(-asked / np.median(apart[is_pair]))

    def seen(x):
        ends = np.mean(x[:3], axis=0), np.mean(x[-3:], axis=0)
        return np.r_[x.mean(axis=0), x.std(axis=0), x.min(axis=0), x.max(axis=0), *ends]

    def changes(x):
        # Reaches of 4 and 16 % of 30 frames.
        x = [np.interp(np.linspace(0, 1, 30), np.linspace(0, 1, len(x)), f) for f in x.T]
        return [np.r_[f[r:], [f[-1]] * r] - np.r_[[f[0]] * r, f[:-r]] for r in (1, 5) for f in x]

    units = np.mean([[np.mean(np.abs(c)) for c in changes(x)] for x in X], axis=0)

    def extremes(x):
        return np.array([pick(c) for c in changes(x) for pick in (np.min, np.max)])

    def shares(x):
        curves = [c / unit for c, unit in zip(changes(x), units, strict=True)]
        levels = -2, -1, -0.3, 0, 0.3, 1, 2
        return np.array([np.mean(np.tanh(2 * (c - level))) for c in curves for level in levels])

    for summarise in (seen, extremes, shares):
        Z, z = (np.array([summarise(x) for x in some]) for some in (X, new))
        mean, std = Z.mean(axis=0), Z.std(axis=0)
        Z, z = (Z - mean) / std, (z - mean) / std
        apart, asked = (
            np.array([[((a - b) ** 2).sum() for b in Z[landmarks]] for a in some])
            for some in (Z, z)
        )
        kernels[summarise.__name__] = np.exp(-asked / np.median(apart[is_pair]))
    names = ("velocity", "elastic"), ("pose",), ("seen",), ("extremes", "shares")
    return np.array([np.mean([kernels[name] for name in some], axis=0) for some in names])


@pytest.mark.parametrize("n_landmarks", [None, 12])
def test_weights_and_decisions_equal_those_of_slow_kernels(known, new, n_landmarks):
    X, y, people = known
    classifier = ActionClassifier(n_frames=30, C=3, n_landmarks=n_landmarks)
    landmarks = classifier.fit(X, y, groups=people).landmarks_
    assert len(landmarks) == (n_landmarks or len(X))
    codes, views = np.unique(y, return_inverse=True)[1], slow_views(X, X, landmarks)
    weights = align_weights(views, codes, people, landmarks)
    np.testing.assert_allclose(classifier.weights_, weights, rtol=1e-4)
    # Trials of two frames, which are fewer than are averaged for the ends, are no exception.
    asked = [*new[0], new[0][0][:2]]
    kernels = [weights[:, None, None] * each for each in (views, slow_views(X, asked, landmarks))]
    # Of some landmarks the kernels stand side by side.
    kernel, kernel_of_new = (np.hstack(k) if n_landmarks else k.sum(axis=0) for k in kernels)
    A, b = KernelRegression(kernel, 3, landmarks).fit(codes)
    expected = decision_values(kernel_of_new, A, b)
    np.testing.assert_allclose(classifier.decision_function(asked), expected, atol=2e-4)


def test_predictions_agree_with_each_other(fitted, new):
    X, y, _ = new
    decisions = fitted.decision_function(X)
    assert fitted.classes_.tolist() == sorted(KINDS)
    np.testing.assert_allclose(decisions.sum(axis=1), 0, atol=1e-4)
    np.testing.assert_array_equal(fitted.predict(X), fitted.classes_[decisions.argmax(axis=1)])
    expected = softmax(fitted.temperature_ * decisions, axis=1)
    np.testing.assert_allclose(fitted.predict_proba(X), expected)
    np.testing.assert_array_equal(fitted.score_samples(X), decisions.max(axis=1))
    assert fitted.score(X, y) == 1


def test_two_classes_have_one_decision_value(known, new):
    X, y, _ = known
    two = y != "turn"
    classifier = ActionClassifier(n_frames=20).fit([X[i] for i in np.flatnonzero(two)], y[two])
    decisions = classifier.decision_function(new[0])
    assert decisions.shape == (12,)
    expected = np.where(decisions > 0, "wave", "rise")
    np.testing.assert_array_equal(classifier.predict(new[0]), expected)
    wave = classifier.predict_proba(new[0])[:, 1]
    np.testing.assert_allclose(wave, 1 / (1 + np.exp(-classifier.temperature_ * decisions)))
    np.testing.assert_allclose(classifier.score_samples(new[0]), np.abs(decisions) / 2)


# -- invariances ------------------------------------------------------------------------


def with_constant(x, constant):
    """A feature more, which is constant but for the last bit."""
    ulps = np.random.default_rng(len(x)).integers(-1, 2, (len(x), 1))
    return np.column_stack([x, constant + np.spacing(constant) * ulps])


@pytest.mark.parametrize(
    ("change", "tolerance"),
    [
        (lambda x: 2.0**-26 * x, 0),
        (lambda x: 2.0**25 * x, 0),
        (lambda x: x + 1000, 1e-3),
        (lambda x: with_constant(x, 0.1), 1e-3),
        (lambda x: with_constant(x, -1e6 / 3), 1e-3),
    ],
)
def test_decisions_do_not_depend_on_unit_origin_or_constants(known, fitted, new, change, tolerance):
    X, y, people = known
    other = ActionClassifier(n_frames=30).fit([change(x) for x in X], y, groups=people)
    found = other.decision_function([change(x) for x in new[0]])
    np.testing.assert_allclose(found, fitted.decision_function(new[0]), rtol=0, atol=tolerance)


def test_fitted_classifier_does_not_share_the_training_arrays(known):
    X, y, _ = known
    mine = [x.copy() for x in X]
    classifier = ActionClassifier(n_frames=20).fit(mine, y)
    before = classifier.predict_proba(X)
    for x in mine:
        x[:] = 0
    np.testing.assert_array_equal(classifier.predict_proba(X), before)


# -- unknown actions ---------------------------------------------------------------------


def test_unknown_actions_are_rejected(fitted, new):
    X, y, _ = new
    rng = np.random.default_rng(0)
    still = [np.full((30, 2), 0.3), np.full((9, 2), -1.0)]
    shaking = [rng.standard_normal((40, 2)) for _ in range(4)]
    unknown = [*still, *shaking, *(x[::-1] for x in X[8:])]
    assert fitted.score_samples(unknown).max() < fitted.score_samples(X).min()
    careful = copy.copy(fitted).set_params(reject_below="auto")
    assert (careful.predict(unknown) == "unknown").mean() > 0.8
    assert (careful.predict(X) == y).all()
    # Rejecting changes no probability.
    np.testing.assert_array_equal(careful.predict_proba(X), fitted.predict_proba(X))


def refitted(X, codes, out, n):
    """Decision values of those left out, by scikit-learn on columns of a Cholesky factor."""
    # C is relative to the mean loss of all n.
    model = LogisticRegression(C=10 * n / (~out).sum(), max_iter=10_000, tol=1e-7)
    return model.fit(X[~out], codes[~out]).decision_function(X[out])


def test_threshold_and_temperature_are_those_of_explicit_refits():
    X, y, people = movements(noise=0.35)
    # Some are not given their class, and do not count for the gain.
    y[[3, 14, 27]] = y[[14, 27, 3]]
    codes, n = np.unique(y, return_inverse=True)[1], len(y)
    classifier = ActionClassifier(n_frames=30).fit(X, y, groups=np.array(list("edcba"))[people])
    K = np.tensordot(classifier.weights_, slow_views(X, X, np.arange(n)), 1)
    Z = np.linalg.cholesky(K + 1e-8 * np.eye(n))
    decisions, losses = np.empty((n, 3)), []
    for person in range(5):
        out = people == person
        decisions[out] = refitted(Z, codes, out, n)
    values, right = decisions.max(axis=1), decisions.argmax(axis=1) == codes
    temperature = fit_temperature(decisions, codes)
    assert classifier.temperature_ == pytest.approx(temperature, rel=5e-3)
    for person in range(5):
        out = np.isin(people, [person, (person + 1) % 5])
        losses.append((values[out] - refitted(Z, codes, out, n).max(axis=1))[right[out]])
    np.testing.assert_allclose(classifier.held_out_, values, atol=2e-3)
    assert 0.7 < right.mean() < 1
    gain = np.median(np.concatenate(losses)) * 3 / 5
    assert classifier.held_out_gain_ == pytest.approx(gain, abs=2e-3)
    assert gain > 0.01
    for coverage in (0.6, 0.95):
        border = np.quantile(values, 1 - coverage) + gain
        assert classifier.threshold_at(coverage) == pytest.approx(border, abs=4e-3)


def test_of_two_people_nothing_is_extrapolated():
    X, y, people = movements(noise=0.3, n_people=2)
    classifier = ActionClassifier(n_frames=10).fit(X, y, groups=people)
    assert classifier.held_out_gain_ == 0
    expected = np.quantile(classifier.held_out_, 0.1)
    assert classifier.threshold_at(0.9) == pytest.approx(expected)
    for wrong in (0, 1, "0.9", np.nan):
        with pytest.raises(ValueError, match="coverage must be a share between 0 and 1, got"):
            classifier.threshold_at(wrong)
    with pytest.raises(NotFittedError):
        clone(classifier).threshold_at(0.9)


# -- large training sets ----------------------------------------------------------------


def test_landmarks_are_chosen_evenly_from_classes_and_groups():
    rng = np.random.default_rng(0)
    codes, groups = rng.choice(4, 900, p=[0.6, 0.3, 0.09, 0.01]), rng.integers(0, 7, 900)
    chosen = choose_landmarks(codes, groups, 100)
    assert (np.diff(chosen) > 0).all()
    assert len(chosen) == 100
    rare = (codes == 3).sum()
    assert rare < 25
    # A class that has fewer than its share is chosen whole, the others have as many.
    share = (100 - rare) / 3
    counts = np.bincount(codes[chosen])
    assert counts[3] == rare
    assert np.abs(counts[:3] - share).max() < 1
    for code in range(2):
        of_groups = np.bincount(groups[chosen[codes[chosen] == code]], minlength=7)
        assert np.ptp(of_groups) <= 1
    without = choose_landmarks(codes, None, 100)
    assert (np.bincount(codes[without]) == counts).all()
    # Spread over a class, as trials of one person come one after the other.
    many = np.flatnonzero(codes == 0)
    at = np.searchsorted(many, without[codes[without] == 0])
    assert np.diff(at, prepend=0, append=len(many)).max() < 3 * len(many) / len(at)
    # Groups that a class has not enough landmarks for are not those of the other classes.
    codes, groups = np.repeat([0, 1], 300), np.tile(np.arange(100), 6)
    halves = choose_landmarks(codes, groups, 100)
    assert len(set(groups[halves])) > 60
    for n_landmarks, n in ((None, 600), (300, 600), (299, 299)):
        assert len(choose_landmarks(codes, groups, n_landmarks)) == n


def test_fit_and_predict_compare_with_landmarks_only(monkeypatch):
    """Pairs of both directions and of all three costs are counted."""
    counts, block = [], PairwiseDistance.block

    def counted(self, bases, moving):
        # Six digits of a distance are enough of a kernel, in half the memory.
        assert bases.dtype == moving.dtype == np.float32
        counts.append(len(bases) * len(moving))
        return block(self, bases, moving)

    monkeypatch.setattr(PairwiseDistance, "block", counted)
    X, y, people = movements(20)
    classifier = ActionClassifier(n_frames=8, n_landmarks=10)
    for work, expected in (
        (lambda: classifier.fit(X, y, groups=people), 3 * (10 * 10 + 2 * 10 * 50)),
        (lambda: classifier.predict(X[:1]), 3 * 2 * 10),
        (lambda: classifier.predict(X[:7]), 3 * 2 * 10 * 7),
        (lambda: ActionClassifier(n_frames=8, n_landmarks=None).fit(X, y), 3 * 60 * 60),
    ):
        counts.clear()
        work()
        assert sum(counts) == expected


# -- small training sets ---------------------------------------------------------------


def test_one_trial_a_class(known, new):
    X, y = known[0][::10], known[1][::10]
    classifier = ActionClassifier(n_frames=30).fit(X, y)
    assert classifier.score(new[0], new[1]) > 0.9
    assert np.isfinite(classifier.predict_proba(new[0])).all()
    two = ActionClassifier(n_frames=8).fit(X[:2], y[:2])
    assert two.temperature_ == pytest.approx(4)
    with pytest.raises(ValueError, match="There is no threshold, as no trial could be held"):
        two.threshold_at(0.95)


def test_a_class_of_one_group_is_held_out(known, new):
    X, y, _ = known
    people = np.where(y == "turn", 0, np.arange(30) % 3)
    classifier = ActionClassifier(n_frames=20).fit(X, y, groups=people)
    assert classifier.score(new[0], new[1]) == 1
    # The class is unknown when that group is held out; the others are not.
    assert np.isfinite(classifier.held_out_).all()
    with pytest.raises(ValueError, match="the same 3 sets of trials apart as y"):
        ActionClassifier(n_frames=20).fit(X, y, groups=[f"of {label}" for label in y])


def test_identical_trials_have_equal_probabilities(known):
    for X in ([known[0][0]] * 4, [np.full((5, 2), 3.0)] * 4):
        classifier = ActionClassifier(n_frames=8).fit(X, [0, 0, 1, 1])
        np.testing.assert_allclose(classifier.predict_proba(X), 0.5, atol=1e-3)


@pytest.mark.parametrize(
    ("y", "message"),
    [
        (["a"] * 30, "at least 2 classes, got one class: 'a'.* ActionDetector"),
        (["a"] * 29, "inconsistent numbers of samples"),
        (np.linspace(0, 1, 30), "Unknown label type: continuous"),
        ([[1, 2]] * 30, "1d array"),
    ],
)
def test_fit_refuses_invalid_classes(known, y, message):
    with pytest.raises(ValueError, match=message):
        ActionClassifier(n_frames=8).fit(known[0], y)


# -- with scikit-learn -----------------------------------------------------------------


@pytest.fixture(scope="module")
def bends():
    """Bends and half bends of four people: data, labels, people, a fitted pipeline."""
    bunch = make_bending(12, n_actors=4, n_frames=30, random_state=0)
    X = bunch.data + [x[: len(x) // 2] for x in bunch.data]
    pipe = make_pipeline(DirectionCosines(bunch.skeleton), ActionClassifier(n_frames=15))
    y, people = np.repeat(["bend", "half"], 12), np.tile(bunch.actor, 2)
    return X, y, people, pipe.fit(X, y, actionclassifier__groups=people)


def test_groups_are_routed_in_cross_validation_and_searches(bends):
    X, y, people, pipe = bends
    with config_context(enable_metadata_routing=True):
        routed = make_pipeline(pipe[0], ActionClassifier(n_frames=15).set_fit_request(groups=True))
        assert routed.fit(X, y, groups=people)[-1].temperature_ == pipe[-1].temperature_
        given = {"params": {"groups": people}, "cv": GroupKFold(2)}
        assert cross_validate(routed, X, y, **given)["test_score"].mean() > 0.9
        search = GridSearchCV(routed, {"actionclassifier__C": [1, 10]}, cv=GroupKFold(2))
        assert search.fit(X, y, groups=people).best_score_ > 0.9


def test_tables_reach_the_classifier(bends):
    X, y, _, pipe = bends
    table = to_frame(X, columns=pipe[0].skeleton.column_names)
    framed = clone(pipe).set_output(transform="pandas").fit(table, y)
    assert list(framed[-1].feature_names_in_)[:2] == ["pelvis_height", "hip_x"]


def test_departures_need_the_model_of_one_class(bends):
    X, *_, pipe = bends
    with pytest.raises(ValueError, match=r"find_departures compares with one model, .*ActionModel"):
        find_departures(pipe, X[:1])
    with pytest.raises(ValueError, match=r"SkeletonDisplay.from_departures compares with one"):
        SkeletonDisplay.from_departures(pipe, X[:1])


# -- people -----------------------------------------------------------------------------


def test_new_people_and_an_unknown_action(real_data):
    """The first of the published halves of ten people, an action left out, and what is rejected."""
    folder = real_data / "utkinect"
    bunch = load_trials(folder / "utkinect_positions.npz")
    splits = json.loads((folder / "utkinect_splits.json").read_text())
    X = DirectionCosines(bunch.skeleton).fit_transform(bunch.data)
    number = np.array([int(actor[1:]) for actor in bunch.actor])
    tried = np.flatnonzero(np.isin(number, splits["test_actors"][0]))
    known = np.isin(number, splits["train_actors"][0])
    train = np.flatnonzero(known & (bunch.target != "sitDown"))
    classifier = ActionClassifier(n_frames=20)
    classifier.fit([X[i] for i in train], bunch.target[train], groups=number[train])
    scores = classifier.score_samples([X[i] for i in tried])
    is_known = bunch.target[tried] != "sitDown"
    assert roc_auc_score(is_known, scores) > 0.85
    tried, scores = tried[is_known], scores[is_known]
    new, truth = [X[i] for i in tried], bunch.target[tried]
    proba = classifier.predict_proba(new)
    assert np.mean(classifier.classes_[proba.argmax(axis=1)] == truth) > 0.92
    assert log_loss(truth, proba) < 0.25
    assert np.mean(scores > classifier.threshold_at(0.95)) > 0.9
    still = classifier.score_samples([x[:1].repeat(len(x), axis=0) for x in new[::4]])
    is_moving = np.repeat([1, 0], [len(scores), len(still)])
    assert roc_auc_score(is_moving, np.concatenate([scores, still])) > 0.95
