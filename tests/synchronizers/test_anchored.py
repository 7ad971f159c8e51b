"""Key-frames that synchronizers are given: exact, soft, of a few trials, in any form, in folds."""

import numpy as np
import pandas as pd
import pytest
from sklearn import config_context
from sklearn.base import clone
from sklearn.model_selection import KFold, cross_val_score
from sklearn.preprocessing import StandardScaler
from sklearn_motionsync import (
    ASpace,
    DenseSynchronizer,
    DirectionCosines,
    FrameWise,
    LinearSynchronizer,
    PartSynchronizer,
)
from sklearn_motionsync.datasets import make_bending, make_gait
from sklearn_motionsync.metrics import FeatureHoldoutScorer, SpreadScorer

P = 60


@pytest.fixture(scope="module")
def bunch():
    bunch = make_bending(9, random_state=0)
    poses = DirectionCosines(bunch.skeleton).fit_transform(bunch.data)
    bunch.data = ASpace(3).fit_transform(poses)
    return bunch


def shares(bunch, keyframes):
    return np.array(keyframes) / (np.array([len(x) for x in bunch.data])[:, np.newaxis] - 1)


def at_keyframes(sync, match):
    """The times, as shares, at which trials meet the key-frames of the pattern."""
    frames = np.arange(match.times.shape[1])
    return np.array([np.interp(sync.keyframes_, frames, t) for t in match.times]) / frames[-1]


@pytest.mark.parametrize("params", [{}, {"refine": True}, {"metric": None}])
def test_exact_keyframes_are_met(bunch, params):
    K = bunch.keyframes[:, [1, 3]]
    sync = DenseSynchronizer(P, **params).fit(bunch.data, keyframes=K)
    match = sync.match(bunch.data, keyframes=K)
    np.testing.assert_allclose(at_keyframes(sync, match), shares(bunch, K), atol=1e-9)
    assert (np.diff(match.times) >= 0).all()
    own = shares(bunch, K)[sync.pattern_index_] * (P - 1)
    np.testing.assert_allclose(sync.keyframes_, own)
    warped = sync.transform(bunch.data, keyframes=K)
    np.testing.assert_array_equal(warped, match.warp(bunch.data))
    again = DenseSynchronizer(P, **params).fit_transform(bunch.data, keyframes=K)
    np.testing.assert_array_equal(again, warped)


def test_nothing_given_and_nothing_known_give_the_same(bunch):
    # Without a metric, which is learnt in single precision.
    plain = DenseSynchronizer(P, pattern=2, metric=None).fit(bunch.data)
    assert plain.keyframes_ is None
    K = np.full((9, 1), np.nan)
    K[2] = bunch.keyframes[2, 2]
    sync = clone(plain).fit(bunch.data, keyframes=K)
    # Only the pattern has one, which anchors no pair.
    np.testing.assert_allclose(sync.match(bunch.data).times, plain.match(bunch.data).times)
    np.testing.assert_allclose(sync.transform(bunch.data), plain.transform(bunch.data))


@pytest.mark.parametrize("pattern", [4, "array"])
def test_keyframes_of_a_pattern_without_any_are_learnt(bunch, pattern):
    K, truth = bunch.keyframes[:, 1:4].copy(), shares(bunch, bunch.keyframes[:, 1:4])[4]
    K[4] = np.nan
    if pattern == "array":
        pattern = np.asarray(bunch.data[4])
    sync = DenseSynchronizer(P, pattern=pattern).fit(bunch.data, keyframes=K)
    np.testing.assert_allclose(sync.keyframes_ / (P - 1), truth, atol=0.015)
    known = np.arange(9) != 4
    met = at_keyframes(sync, sync.match(bunch.data, keyframes=K))
    np.testing.assert_allclose(met[known], shares(bunch, K)[known], atol=1e-9)


def test_soft_keyframes_draw_where_nothing_else_tells():
    t = np.linspace(0, 1, 80)

    def steps(first, second):
        """Two quick steps and, between them, rest."""
        return 1 / (1 + np.exp(-(t[:, np.newaxis] - [first, second]) / 0.02))

    X = [steps(0.15 + 0.01 * i, 0.85 - 0.01 * i) for i in range(6)]
    # Labels of the rest, of which the last is 4.74 frames late.
    K = [[79 * 0.5]] * 5 + [[79 * 0.56]]
    for std in (1, 3):
        sync = DenseSynchronizer(80, pattern=0, keyframe_std=std).fit(X, keyframes=K)
        *others, moved = 79 * at_keyframes(sync, sync.match(X, keyframes=K))[:, 0]
        np.testing.assert_allclose(others, 39.5, atol=0.1)
        assert 39.5 + 3 < moved < 39.5 + 4.74
    # In the first step a label is wrong that says anything else.
    K = [[79 * (0.15 + 0.01 * i)] for i in range(5)] + [[79 * 0.3]]
    sync = DenseSynchronizer(80, pattern=0, keyframe_std=1).fit(X, keyframes=K)
    met = at_keyframes(sync, sync.match(X, keyframes=K))[:, 0]
    np.testing.assert_allclose(met, 0.15 + 0.01 * np.arange(6), atol=0.005)


def test_the_disparity_space_shows_the_anchored_path(bunch):
    K = bunch.keyframes[:, [2]].copy()
    K[8] += 9
    plain = DenseSynchronizer(P, pattern=0).fit(bunch.data, keyframes=K)
    space = plain.disparity_space(bunch.data, 8, keyframes=K)
    free = plain.disparity_space(bunch.data, 8)
    np.testing.assert_array_equal(space.costs, free.costs)
    moment = round(plain.keyframes_[0])
    wanted = shares(bunch, K)[8, 0] * (P - 1)
    assert abs(moment + space.path[moment] - wanted) <= 1
    assert abs(moment + free.path[moment] - wanted) > 1


def test_a_sample_takes_its_own_keyframes(bunch):
    K = bunch.keyframes[:, [2]]
    sync = DenseSynchronizer(P, max_fit=5).fit(bunch.data, keyframes=K)
    own = shares(bunch, K)[sync.pattern_index_] * (P - 1)
    np.testing.assert_allclose(sync.keyframes_, own)
    with pytest.raises(ValueError, match="list of 9 arrays"):
        DenseSynchronizer(P, max_fit=5).fit(bunch.data, keyframes=K[:5])


def test_parts_follow_a_body_that_is_anchored(bunch):
    K = bunch.keyframes[:, [2]]
    sync = PartSynchronizer({"a": [0, 1, 2]}, synchronizer=DenseSynchronizer(P))
    sync.fit(bunch.data, keyframes=K)
    body = DenseSynchronizer(P).fit(bunch.data, keyframes=K).match(bunch.data, keyframes=K)
    np.testing.assert_array_equal(sync.match(bunch.data, keyframes=K).times, body.times)
    parts = sync.match_parts(bunch.data, keyframes=K)
    warped = sync.transform(bunch.data, keyframes=K)
    np.testing.assert_array_equal(warped[..., 3:], body.warp(bunch.data)[..., 3:])
    assert np.isfinite(sync.lags(bunch.data).values).all()
    strong = clone(sync).set_params(coupling=np.inf).fit(bunch.data, keyframes=K)
    np.testing.assert_array_equal(strong.match_parts(bunch.data, K)["a"].times, body.times)
    # A weak coupling lets the part be early or late.
    assert np.abs(parts["a"].times - body.times).max() > 0.1


def test_every_trial_has_one_row_of_a_table(bunch):
    names = [f"trial {i}" for i in range(9)]
    X = pd.concat([pd.DataFrame(x) for x in bunch.data], keys=names)
    K = pd.DataFrame(bunch.keyframes[:, [2]], index=names)
    sync = LinearSynchronizer(P).fit(X, keyframes=K)
    for table, count in ((K[1:], 0), (pd.concat([K, K[:1]]), 2)):
        with pytest.raises(ValueError, match=f"labelled 'trial 0', and keyframes has {count} row"):
            sync.match(X, keyframes=table)


BAD = {
    "a number": (lambda K: 3, "list of 9 arrays .*; got 3"),
    "a number for a row": (lambda K: [K[0], 3, *K[2:]], "Trial 1: "),
    "too few rows": (lambda K: K[:4], "list of 9 arrays"),
    "another count": (lambda K: [*K[:3], [5.0], *K[4:]], "Trial 3: .* 2 increasing"),
    "falling": (lambda K: [*K[:2], K[2][::-1], *K[3:]], "Trial 2: .* increasing"),
    "first frame": (lambda K: [[0.0, 9.0], *K[1:]], "Trial 0: .* both excluded"),
    "outside": (lambda K: [*K[:8], [10.0, 1e4]], "Trial 8: .* between 0 and"),
    "none known": (lambda K: K * [1, np.nan], "key-frame 1 is known in no trial"),
    "no column": (lambda K: K[:, :0], "must be some increasing frames"),
    "no row": (lambda K: [None] * 9, "a key-frame is known in no trial"),
}


@pytest.mark.parametrize("name", BAD)
def test_bad_keyframes_are_refused(name, bunch):
    make, message = BAD[name]
    with pytest.raises(ValueError, match=message):
        DenseSynchronizer(P).fit(bunch.data, keyframes=make(bunch.keyframes[:, [1, 3]]))


def test_keyframes_need_a_fit_with_some(bunch):
    for sync in (DenseSynchronizer(P), LinearSynchronizer(P)):
        with pytest.raises(ValueError, match="fitted without any"):
            sync.fit(bunch.data).match(bunch.data, keyframes=bunch.keyframes)


# -- every form that users have, and folds ---------------------------------------------


GAIT = make_gait(4, 3, random_state=0)
X = FrameWise(StandardScaler()).fit_transform(GAIT.data)
ALL = GAIT.keyframes[:, [0, 3]]
SOME = ALL.copy()
SOME[1], SOME[5, 0] = np.nan, np.nan
LABELS = [(person, int(cycle)) for person, cycle in zip(GAIT.person, GAIT.cycle, strict=True)]
TABLES = [pd.DataFrame(x, columns=GAIT.feature_names) for x in X]
for table, label in zip(TABLES, LABELS, strict=True):
    table.attrs = {"trial": label, "levels": ("person", "cycle", "frame")}
INDEX = pd.MultiIndex.from_tuples(LABELS, names=["person", "cycle"])


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


@pytest.mark.parametrize("form", FORMS)
def test_forms_of_keyframes_are_one(form):
    expected = LinearSynchronizer(40).fit_transform(X, keyframes=SOME)
    found = LinearSynchronizer(40).fit_transform(X, keyframes=FORMS[form](SOME))
    np.testing.assert_array_equal(found, expected)


@pytest.mark.parametrize(
    ("sync", "scorer", "form"),
    [
        (DenseSynchronizer(40), FeatureHoldoutScorer(), "array of arrays"),
        (LinearSynchronizer(40), SpreadScorer(), "labelled table"),
    ],
)
def test_cross_validation_gives_each_fold_its_own(sync, scorer, form):
    folds, expected = list(KFold(3, shuffle=True, random_state=0).split(X)), []
    for train, test in folds:
        fitted = clone(sync).fit([X[i] for i in train], keyframes=SOME[train])
        expected.append(scorer(fitted, [X[i] for i in test], keyframes=SOME[test]))
    with config_context(enable_metadata_routing=True):
        found = cross_val_score(
            clone(sync).set_fit_request(keyframes=True),
            TABLES,
            cv=folds,
            scoring=clone(scorer).set_score_request(keyframes=True),
            params={"keyframes": FORMS[form](SOME)},
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
    scorer = FeatureHoldoutScorer()
    expected = scorer(plain, X[:4], **given)
    assert scorer(sync, X[:4], keyframes=few) == expected
    seconds = {"keyframes": few / 100, "frame_rate": 100}
    np.testing.assert_allclose(scorer(sync, X[:4], **seconds), expected)
