"""Key-frames in every form that users have, through pipelines, searches, scorers and storage."""

import numpy as np
import pandas as pd
import pytest
from sklearn import config_context
from sklearn.base import clone
from sklearn.model_selection import KFold, cross_val_score
from sklearn.pipeline import make_pipeline
from sklearn.preprocessing import StandardScaler
from sklearn_motionsync import (
    ActionDetector,
    ActionModel,
    DenseSynchronizer,
    FrameWise,
    LinearSynchronizer,
    Match,
    PartSynchronizer,
    TimingChannel,
    to_frame,
)
from sklearn_motionsync.datasets import make_gait
from sklearn_motionsync.display import ActionModelDisplay, SynchronizationDisplay, TrellisDisplay
from sklearn_motionsync.metrics import FeatureHoldoutScorer, SpreadScorer
from sklearn_motionsync.model import find_departures
from sklearn_motionsync.synchronizers import blend_trials

GAIT = make_gait(4, 3, random_state=0)
N = len(GAIT.data)
X = FrameWise(StandardScaler()).fit_transform(GAIT.data)
# Force peak and toe-off, of which the others may be unknown.
ALL = GAIT.keyframes[:, [0, 3]]
SOME = ALL.copy()
SOME[1], SOME[5, 0] = np.nan, np.nan
LABELS = [(person, int(cycle)) for person, cycle in zip(GAIT.person, GAIT.cycle, strict=True)]
TABLES = [pd.DataFrame(x, columns=GAIT.feature_names) for x in X]
for table, label in zip(TABLES, LABELS, strict=True):
    table.attrs = {"trial": label, "levels": ("person", "cycle", "frame")}
INDEX = pd.MultiIndex.from_tuples(LABELS, names=["person", "cycle"])

SYNCHRONIZERS = {
    "exact": (DenseSynchronizer(40), SOME),
    "parts": (PartSynchronizer({"leg": [0, 1]}, synchronizer=DenseSynchronizer(40)), SOME),
    "linear": (LinearSynchronizer(40), SOME),
}


def as_objects(rows):
    out = np.empty(len(rows), dtype=object)
    out[:] = rows
    return out


FORMS = {
    "list of lists": lambda K: K.tolist(),
    "list of arrays": list,
    "None for a row": lambda K: [None if np.isnan(row).all() else row for row in K],
    "object array": lambda K: K.astype(object),
    "array of arrays": lambda K: as_objects([np.array(row) for row in K]),
    "table": pd.DataFrame,
    "labelled table": lambda K: pd.DataFrame(K, index=INDEX),
    "nullable table": lambda K: pd.DataFrame(K).astype("Float64"),
}


@pytest.fixture(scope="module", params=SYNCHRONIZERS)
def case(request):
    """A synchronizer, its key-frames, and what it makes of the gait cycles."""
    sync, K = SYNCHRONIZERS[request.param]
    return sync, K, clone(sync).fit(X, keyframes=K).transform(X, keyframes=K)


@pytest.mark.parametrize("form", FORMS)
def test_forms_of_keyframes_are_one(form):
    sync, K = SYNCHRONIZERS["linear"]
    expected = clone(sync).fit_transform(X, keyframes=K)
    found = clone(sync).fit_transform(X, keyframes=FORMS[form](K))
    np.testing.assert_array_equal(found, expected)


@pytest.mark.parametrize("make", [lambda X: TABLES, lambda X: to_frame(TABLES)])
def test_forms_of_trials_are_one(case, make):
    sync, K, expected = case
    K = pd.DataFrame(K, index=INDEX)
    found = clone(sync).fit_transform(make(X), keyframes=K)
    np.testing.assert_array_equal(np.asarray(found).reshape(expected.shape), expected)


# -- routed as metadata -----------------------------------------------------------------------


@pytest.mark.parametrize(
    ("name", "scorer", "form"),
    [
        ("exact", FeatureHoldoutScorer(n_folds=2), "array of arrays"),
        ("parts", SpreadScorer(), "labelled table"),
        ("linear", SpreadScorer(), "list of lists"),
    ],
)
def test_cross_validation_gives_each_fold_its_own(name, scorer, form):
    sync, K = SYNCHRONIZERS[name]
    folds = list(KFold(3, shuffle=True, random_state=0).split(X))
    expected = [
        scorer(
            clone(sync).fit([X[i] for i in train], keyframes=K[train]),
            [X[i] for i in test],
            keyframes=K[test],
        )
        for train, test in folds
    ]
    with config_context(enable_metadata_routing=True):
        found = cross_val_score(
            clone(sync).set_fit_request(keyframes=True),
            TABLES,
            cv=folds,
            scoring=clone(scorer).set_score_request(keyframes=True),
            params={"keyframes": FORMS[form](K)},
            error_score="raise",
        )
    np.testing.assert_allclose(found, expected)


@pytest.mark.parametrize("known", [[], [0]])
def test_features_are_held_out_where_a_fold_lacks_labels(known):
    sync = DenseSynchronizer(40).fit(X, keyframes=SOME)
    few = np.full((4, 2), np.nan)
    few[:, known] = ALL[:4, known]
    given = {"keyframes": few[:, known]} if known else {}
    plain = DenseSynchronizer(40).fit(X, **({"keyframes": ALL[:, known]} if known else {}))
    scorer = FeatureHoldoutScorer(n_folds=2)
    expected = scorer(plain, X[:4], **given)
    assert scorer(sync, X[:4], keyframes=few) == expected
    seconds = {"keyframes": few / 100, "frame_rate": 100}
    np.testing.assert_allclose(scorer(sync, X[:4], **seconds), expected)


def test_what_comes_after_takes_them(case):
    sync, K, _ = case
    name = type(sync).__name__.lower()
    pipe = make_pipeline(FrameWise(StandardScaler()), clone(sync))
    pipe.fit(TABLES, **{f"{name}__keyframes": K})
    points = FrameWise(StandardScaler()).fit_transform(TABLES)
    fitted = clone(sync).fit(points, keyframes=K)
    times = fitted.match(points, keyframes=K).times
    match = Match.from_estimator(pipe, TABLES, keyframes=K)
    np.testing.assert_array_equal(match.times, times)
    display = SynchronizationDisplay.from_estimator(pipe, TABLES, keyframes=K)
    np.testing.assert_array_equal(display.match.times, times)
    blend = blend_trials(pipe, TABLES, {0: 0.5, 2: 0.5}, keyframes=K)
    pd.testing.assert_frame_equal(blend, blend_trials(match, TABLES, {0: 0.5, 2: 0.5}))
    channel = TimingChannel(clone(sync)).fit(X, keyframes=K)
    curves = clone(sync).fit(X, keyframes=K).match(X, keyframes=K).warp(X)
    np.testing.assert_array_equal(channel.transform(X, keyframes=K)[:, :, :-1], curves)
    if isinstance(sync, DenseSynchronizer):
        trellis = TrellisDisplay.from_estimator(pipe, TABLES, trial=3, keyframes=K)
        np.testing.assert_array_equal(trellis.warp, match.offsets[3])


def test_models_of_anchored_trials_take_them(case):
    sync, K, expected = case
    with config_context(enable_metadata_routing=True):
        asking = clone(sync).set_fit_request(keyframes=True).set_transform_request(keyframes=True)
        pipe = make_pipeline(asking, ActionModel()).fit(X, keyframes=K)
    model = ActionModel().fit(expected)
    display = ActionModelDisplay.from_estimator(pipe, X, keyframes=K, features=0)
    np.testing.assert_array_equal(display.trials, expected[:, :, :1])
    found, others = find_departures(pipe, X, keyframes=K), find_departures(model, list(expected))
    # A model by itself does not tell what timing explains.
    differing = ["feature", "timing"]
    pd.testing.assert_frame_equal(found.drop(columns=differing), others.drop(columns=differing))
    assert not others["timing"].any()
    detector = ActionDetector(pipe)
    name = type(sync).__name__.lower()
    detector.fit(X, groups=GAIT.person, **{f"{name}__keyframes": K})
    found = detector.report(X, keyframes=K)["movement"]
    of_model = detector.estimator_[-1].dissimilarity(expected)
    np.testing.assert_allclose(found, of_model / detector.borders_["movement"][1])
