"""The detector: against loops, closed forms and real people."""

import numpy as np
import pandas as pd
import pytest
from scipy.stats import t as student
from sklearn import clone, config_context
from sklearn.model_selection import GridSearchCV, cross_val_score
from sklearn.pipeline import Pipeline, make_pipeline
from sklearn_motionsync import (
    ActionDetector,
    ActionModel,
    ASpace,
    DenseSynchronizer,
    DirectionCosines,
    LinearSynchronizer,
    Match,
    to_frame,
)
from sklearn_motionsync.body.mirror import exchange_of_sides
from sklearn_motionsync.datasets import make_bending
from sklearn_motionsync.metrics import SpreadScorer
from sklearn_motionsync.model import find_departures
from sklearn_motionsync.model.acceptance import Contrast
from sklearn_motionsync.model.similarity import movement_energies

TESTS = ["movement", "course", "duration", "energy"]


def make(synchronizer=None, **params):
    synchronizer = DenseSynchronizer(30) if synchronizer is None else synchronizer
    return ActionDetector(make_pipeline(synchronizer, ActionModel()), **params)


def wave(n_frames=60, size=1.0, middle=0.5):
    """A movement there and, at a time of its own, half back again; two features."""
    t = np.linspace(0, 1, n_frames)
    t = np.interp(t, [0, middle, 1], [0, 0.5, 1])
    return size * np.stack([np.sin(1.5 * np.pi * t), 1 - np.cos(2 * np.pi * t)], axis=1)


def people(n=20, seed=0):
    """Trials of five people, who differ in what each does alike."""
    rng = np.random.default_rng(seed)
    groups = np.arange(n) % 5
    length, size = 60 * np.exp(0.1 * rng.standard_normal(5)), np.exp(0.1 * rng.standard_normal(5))
    X = []
    for g in groups:
        x = wave(int(length[g] * rng.uniform(0.9, 1.1)), size[g] * rng.uniform(0.9, 1.1))
        t = np.linspace(0, np.pi, len(x))[:, np.newaxis]
        for k in (1, 2, 3):
            x += 0.3 * rng.standard_normal(2) * np.sin(k * t)
        X.append(x)
    return X, groups


X, GROUPS = people()


@pytest.fixture(scope="module")
def detector():
    return make().fit(X, groups=GROUPS)


# -- the tests and their score ----------------------------------------------------------


def slow_interval(values, groups, coverage):
    """The mean logarithm, the half-width of the prediction interval, and what is left out."""
    logs = np.log(values)
    left = [x - np.mean(logs[groups != g]) for x, g in zip(logs, groups, strict=True)]
    n = len(logs)
    left = np.array(left) * np.sqrt((n - 1) / (n + 1))
    variance = (np.sum(np.square(left)) + 3 * 0.07) / (n + 2)
    return (
        logs.mean(),
        student(n + 2).ppf((1 + coverage) / 2) * np.sqrt(variance * (1 + 1 / n)),
        left,
    )


def slow_tail(held_out, values):
    """-log of the probability of new dissimilarities as large, by a t distribution of logs."""
    logs, n = np.log(held_out), len(held_out)
    std = np.sqrt((((logs - logs.mean()) ** 2).sum() + 3 * 0.12) / (n + 3))
    std = std * np.sqrt(1 + 1 / n)
    return [-np.log(student(n + 2).sf((np.log(x) - logs.mean()) / std)) for x in values]


def slow_reversal(X, groups, new):
    """1 less the projection on the mean difference from the reversed curves, over its mean."""
    d = [x - x[::-1] for x in X]
    noise = 0.3 * np.mean([((a - np.mean(d, axis=0)) ** 2).sum() for a in d])

    def project(a, mean):
        return (a * mean).sum() / ((mean**2).sum() + noise)

    others = [
        np.mean([b for b, h in zip(d, groups, strict=True) if h != g], axis=0) for g in groups
    ]
    middle = np.mean([project(a, mean) for a, mean in zip(d, others, strict=True)])
    return [1 - project(x - x[::-1], np.mean(d, axis=0)) / middle for x in new]


@pytest.mark.parametrize(("duration", "n_tests", "grouped"), [(True, 4, True), (False, 3, False)])
def test_report_equals_slow_loops(duration, n_tests, grouped):
    groups = GROUPS if grouped else None
    codes = GROUPS if grouped else np.arange(len(X))
    found = make(coverage=0.9, duration=duration).fit(X, groups=groups)
    new = [wave(80), wave(30, 0.5), wave(middle=0.7), *people(7, seed=1)[0], wave()[::-1]]
    report = found.report(new)
    each = 1 - 0.1 / n_tests
    squares, of_training = 0, 0
    for name, steps, weight in (
        ("movement", make_pipeline(DenseSynchronizer(30)), 1),
        ("course", LinearSynchronizer(30), 0.15),
    ):
        on_clock = steps.fit_transform(X)
        model = ActionModel(coverage=each).fit(on_clock, groups=groups)
        unlike = model.dissimilarity(steps.transform(new))
        np.testing.assert_allclose(report[name], unlike / model.threshold_, rtol=1e-9)
        np.testing.assert_allclose(found.borders_[name], [0, model.threshold_], rtol=1e-9)
        known = model.dissimilarities_
        squares = squares + weight * np.array(slow_tail(known, unlike))
        of_training = of_training + weight * np.array(slow_tail(known, known))
    warped = make_pipeline(DenseSynchronizer(30)).fit(X)
    curves = warped.transform(X), codes, warped.transform(new)
    np.testing.assert_allclose(report["reversal"], slow_reversal(*curves), rtol=1e-7)

    def energy(trials):
        on_clock = LinearSynchronizer(30).fit(X).transform(trials)
        return np.array([((x - x.mean(axis=0)) ** 2).sum(axis=1).mean() for x in on_clock])

    def frames(trials):
        return np.array([len(x) for x in trials])

    for name, measure in [("energy", energy), *([("duration", frames)] if duration else [])]:
        middle, reach, left = slow_interval(measure(X), codes, each)
        np.testing.assert_allclose(report[name], (np.log(measure(new)) - middle) / reach)
        ends = np.exp([middle - reach, middle + reach])
        np.testing.assert_allclose(found.borders_[name], ends)
        t = student(len(X) + 2)
        end = t.ppf((1 + each) / 2)
        squares = squares - 0.15 * np.log(2 * t.sf(end * np.abs(report[name])))
        of_training = of_training - 0.15 * np.log(2 * t.sf(end * np.abs(left / reach)))
    names = [name for name in TESTS if duration or name != "duration"]
    assert list(report.columns) == [*names, "reversal", "score", "reason"]
    assert found.images_ == ["reversal"]
    known, n, n_people = np.sqrt(of_training), len(X), len(set(codes))
    variance = (known.var() * n + 3 * 0.3) / (n + 2)
    limit = known.mean() + student(n + 2).ppf(0.9) * np.sqrt(variance * (1 + 1 / n_people))
    *_, second, farthest = sorted(known[codes == code].mean() for code in set(codes))
    limit = max(limit, (second + farthest) / 2)
    alone = np.maximum(report[names].abs().max(axis=1) / 1.5, report["reversal"])
    score = np.where(
        alone > 1, np.maximum(np.sqrt(squares) / limit, alone), np.sqrt(squares) / limit
    )
    np.testing.assert_allclose(report["score"], score, rtol=1e-7)
    np.testing.assert_array_equal(found.score_samples(new), -report["score"])
    np.testing.assert_array_equal(found.decision_function(new), -report["score"] - found.offset_)
    np.testing.assert_array_equal(found.predict(new), np.where(score <= 1, 1, -1))
    assert ((report["reason"] == "") == (score <= 1)).all()
    assert set(found.predict(new)) == {-1, 1}


WRONG = {
    "too long": wave(120),
    "too short": wave(30),
    "too weak": wave(size=0.54),
    "too strong": wave(size=2),
    "another course": wave(middle=0.828),
    "too short, too weak": wave(20, size=0.54),
    "another movement": wave()[:, ::-1],
    "another movement, the other way": wave()[::-1],
    "another movement, too weak": 0 * wave(),
}


@pytest.mark.parametrize("reason", WRONG)
def test_report_gives_the_reason(reason, detector):
    assert detector.report([wave(), WRONG[reason]])["reason"].tolist() == ["", reason]
    assert detector.predict([wave(), WRONG[reason]]).tolist() == [1, -1]
    if reason in ("too long", "too short"):
        assert detector.estimator_.predict([WRONG[reason]]).tolist() == [1]


def test_duration_false_accepts_any_duration(detector):
    """As where frame rates differ."""
    blind = clone(detector).set_params(duration=False).fit(X, groups=GROUPS)
    assert blind.predict([wave(), wave(120), wave(30)]).tolist() == [1, 1, 1]
    assert blind.predict([wave(120, size=0.4)]).tolist() == [-1]
    assert "duration" not in blind.borders_


# -- real people ------------------------------------------------------------------------


def test_bends_of_a_new_person_are_accepted_and_altered_ones_rejected(bends):
    """A whole actor held out; twice in a row, half of it, slow motion and weak copies."""
    new = bends.actor == bends.actor[0]
    bodies = DirectionCosines(bends.skeleton).fit(bends.data)
    points = ASpace(0.95).fit_transform(bodies.transform(bends.data))
    known = [x for x, n in zip(points, new, strict=True) if not n]
    detector = make(DenseSynchronizer(60)).fit(known, groups=bends.actor[~new])
    own = [x for x, n in zip(points, new, strict=True) if n]
    assert (detector.predict(own) == 1).mean() >= 0.8
    wrong = {
        "twice": [np.concatenate([x, x]) for x in own],
        "half": [x[: len(x) // 2] for x in own],
        "weak": [x.mean(axis=0) + 0.4 * (x - x.mean(axis=0)) for x in own],
        "still": [np.repeat(x[:1], len(x), axis=0) for x in own],
        "in slow motion": [np.repeat(x, 4, axis=0) for x in own],
    }
    for name, trials in wrong.items():
        assert (detector.predict(trials) == -1).mean() > 0.9, name
    slow = detector.report(wrong["in slow motion"])
    assert (slow["reason"] == "too long").mean() > 0.9


# -- at any depth, with groups and key-frames -------------------------------------------

BUNCH = make_bending(12, n_frames=30, style=1, random_state=0)
ACTORS = np.array([3, 1, 2, 1, 3, 2, 3, 1, 2, 1, 3, 2])
GRID = {"actionmodel__n_std": [3.0]}


def nestings(synchronizer):
    steps = DirectionCosines(BUNCH.skeleton), ASpace(3), synchronizer, ActionModel()
    search = GridSearchCV(synchronizer, {"n_frames": [20]}, cv=2, scoring=SpreadScorer())
    return {
        "flat": make_pipeline(*steps),
        "inside": make_pipeline(make_pipeline(*steps[:2]), make_pipeline(*steps[2:])),
        "across": make_pipeline(steps[0], make_pipeline(*steps[1:3]), steps[3]),
        "nothing between": Pipeline([("a", make_pipeline(*steps)), ("b", None)][:1]),
        "more after": make_pipeline(*steps[:3], ASpace(3), steps[3]),
        "search": make_pipeline(*steps[:2], search, steps[3]),
        "searched": GridSearchCV(make_pipeline(*steps), GRID, cv=2),
    }


@pytest.fixture(scope="module")
def flat_report():
    pipe = nestings(DenseSynchronizer(20))["flat"]
    return ActionDetector(pipe).fit(BUNCH.data, groups=ACTORS).report(BUNCH.data)


@pytest.mark.parametrize(
    ("name", "routed"), [*((name, False) for name in [*nestings(None)][1:]), ("across", True)]
)
def test_pipelines_of_any_depth(name, routed, flat_report):
    pipes, expected = nestings(DenseSynchronizer(20)), flat_report
    with config_context(enable_metadata_routing=routed):
        found = ActionDetector(pipes[name]).fit(BUNCH.data, groups=ACTORS)
        report = found.report(BUNCH.data)
    if name != "more after":
        np.testing.assert_allclose(report[TESTS], expected[TESTS], rtol=1e-9)
    np.testing.assert_allclose(report[TESTS[1:]], expected[TESTS[1:]], rtol=1e-9)
    assert not hasattr(pipes[name], "n_features_in_")


def test_groups_reach_the_model_and_the_detector():
    pipe = nestings(DenseSynchronizer(20))["flat"]
    given = pipe.fit(BUNCH.data, actionmodel__groups=ACTORS)[-1]
    detector = ActionDetector(pipe).fit(BUNCH.data, groups=ACTORS)
    model = detector.estimator_[-1]
    assert model.threshold_ == given.threshold_
    np.testing.assert_array_equal(model.groups_, given.groups_)
    # By the name that the model's have in the pipeline, too.
    other = ActionDetector(pipe).fit(BUNCH.data, actionmodel__groups=ACTORS)
    assert detector.borders_ == other.borders_
    assert detector.borders_ != ActionDetector(pipe).fit(BUNCH.data).borders_


def test_detector_in_cross_validation_with_wrong_trials(detector):
    wrong = [wave(middle=m) for m in np.linspace(0.85, 0.95, 10)]
    y = np.repeat([1, -1], [len(X), len(wrong)])
    own = np.arange(len(X))
    # Wrong ones are in no training set.
    folds = [
        (np.flatnonzero(g != GROUPS), np.append(own[g == GROUPS], 20 + np.arange(10)))
        for g in range(2)
    ]
    scores = cross_val_score(make(), X + wrong, y, cv=folds, scoring="roc_auc")
    assert (scores == 1).all()
    search = GridSearchCV(make(), {"duration": [True, False]}, cv=folds, scoring="accuracy")
    assert search.fit(X + wrong, y).best_score_ > 0.9


@pytest.mark.parametrize("routed", [False, True])
def test_key_frames_reach_the_synchronizer(routed):
    marked = make_bending(8, random_state=0)
    how = "keyframes" if routed else "linearsynchronizer__keyframes"
    with config_context(enable_metadata_routing=routed):
        sync = LinearSynchronizer(30)
        if routed:
            sync.set_fit_request(keyframes=True).set_transform_request(keyframes=True)
        steps = DirectionCosines(marked.skeleton), ASpace(3), sync, ActionModel()
        detector = ActionDetector(make_pipeline(*steps))
        detector.fit(marked.data, groups=marked.actor, **{how: marked.keyframes})
        report = detector.report(marked.data, keyframes=marked.keyframes)
        cosines, space, synchronizer, _ = (step for _, step in detector.estimator_.steps)
        bodies = cosines.transform(marked.data)
        match = synchronizer.match(space.transform(bodies), keyframes=marked.keyframes)
        model = ActionModel().fit(match.warp(bodies), groups=marked.actor)
        expected = model.dissimilarity(match.warp(bodies)) / detector.borders_["movement"][1]
        np.testing.assert_allclose(report["movement"], expected, rtol=1e-9, atol=1e-9)
        with pytest.raises(ValueError, match=r"keyframes=\[...\] beside X"):
            detector.predict(marked.data)
    with pytest.raises(TypeError, match=r"ActionDetector.report got 'weights', which is no"):
        detector.report(marked.data, weights=[1] * 8)


# -- as an estimator ---------------------------------------------------------------------


def test_report_keeps_the_labels_of_a_table(detector):
    table = to_frame([wave(), wave(120)], trials=[("ann", 1), ("bob", 2)])
    table.columns = ["x", "y"]
    named = to_frame(X)
    named.columns = ["x", "y"]
    found = make().fit(named.rename_axis(["trial", "frame"]), groups=GROUPS)
    report = found.report(table.rename_axis(["trial", "frame"]))
    assert list(report.index) == [("ann", 1), ("bob", 2)]
    assert report.index.name == "trial"
    assert report["reason"].tolist() == ["", "too long"]
    assert list(found.feature_names_in_) == ["x", "y"]
    with config_context(transform_output="pandas"):
        pandas = make().fit(X, groups=GROUPS).report([wave(), wave(120)])
    assert pandas.equals(detector.report([wave(), wave(120)]))
    assert list(pandas.index) == [0, 1]


def test_coverage_of_the_pipeline_does_not_count(detector):
    own = make_pipeline(DenseSynchronizer(30), ActionModel(coverage=0.5)).fit(X, None)
    found = ActionDetector(clone(own)).fit(X, groups=GROUPS)
    assert found.borders_ == detector.borders_
    assert found.estimator_[-1].coverage == 0.5


def test_rows_of_departures_are_the_reasons_of_a_detector(detector):
    trials = [*X[:6], X[0][::-1], X[1][::4], X[2] * 3, np.zeros((40, 2)), X[3] + [0.0, 2.0]]
    refused = detector.predict(trials) == -1
    assert refused.any()
    assert not refused.all()
    found = find_departures(detector, trials)
    assert set(found["trial"]) == set(np.flatnonzero(refused))
    assert found["rare"].all()
    assert found.groupby("trial").size().max() <= 5
    # With a limit the rows are those beyond it, of all trials.
    pipe = detector.estimator_
    by_limit = find_departures(detector, trials, limit=0.5)
    assert set(by_limit["trial"]) > set(found["trial"])
    of_parts = by_limit[by_limit["feature"].notna()].drop(columns="rare")
    expected = find_departures(pipe, trials, limit=0.5).drop(columns="rare")
    expected = expected[expected["feature"].notna()]
    assert len(of_parts.merge(expected)) == len(of_parts)


def test_match_takes_a_detector(detector):
    pipe = detector.estimator_
    times = Match.from_estimator(pipe, X).times
    np.testing.assert_array_equal(Match.from_estimator(detector, X).times, times)


@pytest.mark.parametrize(
    ("training", "own"),
    [
        ([wave(40), wave(44)], wave(40)),
        ([wave(40)] * 4, wave(40)),
        (people(80)[0], wave()),
        ([np.full((n, 2), 3.0) for n in (20, 22, 24)], np.full((22, 2), 3.0)),
        ([x[:, :1] for x in X], wave()[:, :1]),
        ([x.astype(np.float32) for x in X], wave().astype(np.float32)),
        ([np.stack([0.1 * np.ones(2), k + np.ones(2)]) for k in range(4)], np.ones((2, 2))),
    ],
    ids=["two", "identical", "many", "still", "univariate", "float32", "two frames"],
)
def test_detector_of_small_and_degenerate_training_sets(training, own):
    """Warnings are errors here."""
    found = make(LinearSynchronizer()).fit(training)
    numbers = found.report([*training, own])[TESTS]
    assert np.isfinite(numbers).all(axis=None)
    assert np.isfinite(list(found.borders_.values())).all()
    if len(own) > 2:
        assert found.predict([own]).tolist() == [1]
        assert found.predict([own + np.linspace(0, 99, len(own))[:, None]]).tolist() == [-1]


def test_energy_of_standing_still_is_the_floor():
    energy, floor = movement_energies(np.zeros((3, 5, 2)))
    assert floor > 0
    assert (energy == floor).all()
    energy, floor = movement_energies(np.stack([wave(20), 0 * wave(20)]))
    assert energy[1] == floor < 1e-8 * energy[0]


@pytest.mark.parametrize(
    ("estimator", "message"),
    [
        (make_pipeline(ASpace(), ActionModel()), r"got the steps \['ASpace', 'ActionModel'\]"),
        (make_pipeline(ASpace(), DenseSynchronizer()), r"ends in an ActionModel .*; got the steps"),
        (ActionModel(), r"got the steps \['ActionModel'\]"),
        (Pipeline([("a", "passthrough")]), r"got the steps \[\]"),
        (make_pipeline(ActionModel(), DenseSynchronizer()), r"such as make_pipeline\(DenseSync"),
    ],
)
def test_detector_refuses_pipelines_without_model_or_synchronizer(estimator, message):
    with pytest.raises(ValueError, match=message):
        ActionDetector(estimator).fit(X)


# -- images of the movement ---------------------------------------------------------------


def arms(n, side, seed=0):
    """Bends of people who raise an arm to the side meanwhile: "right", "left" or "both"."""
    bunch = make_bending(n, n_actors=n // 2, n_frames=40, style=1, random_state=seed)
    cosines = DirectionCosines(bunch.skeleton).fit(bunch.data)
    names, rng = list(cosines.get_feature_names_out()), np.random.default_rng(seed)
    X = [np.asarray(x).copy() for x in cosines.transform(bunch.data)]
    for x in X:
        angle = rng.uniform(0.8, 1.2) * np.sin(np.linspace(0, np.pi, len(x))) ** 2
        for name, sign in (("left", 1), ("right", -1)):
            if side not in (name, "both"):
                continue
            for limb in ("arm", "forearm"):
                at = names.index(f"{name}_{limb}_x")
                x[:, at] = sign * np.sin(angle)
                x[:, at + 1], x[:, at + 2] = -np.cos(angle), 0
    return X, bunch.actor, names


def swapped(X, names, limbs=None):
    columns, signs = exchange_of_sides(names, limbs)
    return [signs * x[:, columns] for x in X]


BOTH_ARMS = [f"{side}_{limb}" for side in ("left", "right") for limb in ("arm", "forearm")]


def test_the_other_side_is_refused_where_the_movement_has_one():
    X, people, names = arms(12, "right")
    new = arms(6, "right", seed=1)[0]
    pipe = make_pipeline(ASpace(0.95), DenseSynchronizer(30), ActionModel())
    found = ActionDetector(pipe).fit(X, groups=people)
    assert found.images_[:2] == ["mirror", "arms"]
    assert (found.predict(new) == 1).all()
    for some in (swapped(new, names), swapped(new, names, BOTH_ARMS)):
        report = found.report(some)
        assert (found.predict(some) == -1).all()
        assert report["reason"].str.contains("the other side, the other arm").all()
        assert (report[["mirror", "arms"]] > 1).all(axis=None)
    blind = clone(found).set_params(sides=False).fit(X, groups=people)
    assert not {"mirror", "arms"} & set(blind.images_)
    # With names, and behind the step that makes the cosines, it is the same.
    tables = [pd.DataFrame(x, columns=names) for x in X]
    named = clone(found).fit(tables, groups=people)
    assert named.images_ == found.images_


def test_sides_do_not_matter_where_both_arms_move():
    X, people, names = arms(12, "both")
    new = arms(6, "both", seed=1)[0]
    pipe = make_pipeline(ASpace(0.95), DenseSynchronizer(30), ActionModel())
    found = ActionDetector(pipe).fit(X, groups=people)
    assert not {"mirror", "arms"} & set(found.images_)
    for some in (new, swapped(new, names, BOTH_ARMS)):
        assert (found.predict(some) == 1).all()
    # Nor where people use either side.
    right = arms(12, "right")[0]
    mixed = ActionDetector(pipe).fit([*right, *swapped(right, names)], groups=[*people] * 2)
    assert not {"mirror", "arms"} & set(mixed.images_)


def test_sides_need_limbs():
    with pytest.raises(ValueError, match=r"sides=True needs limbs .* The features are x0, x1"):
        make(sides=True).fit(X, groups=GROUPS)


def test_a_person_who_does_it_the_other_way_is_judged_by_the_reference():
    X, people, names = arms(12, "right")
    pipe = make_pipeline(ASpace(0.95), DenseSynchronizer(30), ActionModel())
    found = ActionDetector(pipe).fit(X, groups=people)
    mine = swapped(arms(6, "right", seed=4)[0], names)
    assert (found.report(mine[3:])["mirror"] > 1).all()
    assert "mirror" not in found.report(mine[3:], reference=mine[:3])


@pytest.mark.parametrize("symmetric", [True, False])
def test_a_contrast_is_one_for_the_action_and_minus_one_for_its_image(symmetric):
    rng = np.random.default_rng(0)
    t = np.linspace(0, 1, 30)
    base = np.sin(np.pi * t) if symmetric else t**2
    curves = base[:, np.newaxis] * rng.uniform(0.9, 1.1, (20, 1, 1))
    curves = curves + 0.01 * rng.standard_normal((20, 30, 1))
    contrast = Contrast(curves, lambda x: x[:, ::-1], np.arange(20) % 5)
    assert contrast.is_clear is not symmetric
    if not symmetric:
        new = base[np.newaxis, :, np.newaxis]
        statistics = contrast.standardize(np.concatenate([new, new[:, ::-1], 0 * new]))
        np.testing.assert_allclose(statistics, [0, 2, 1], atol=0.05)
