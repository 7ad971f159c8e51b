"""Key-frames in every form that users have, and in folds."""

import numpy as np
import pandas as pd
import pytest
from sklearn import config_context
from sklearn.base import clone
from sklearn.model_selection import KFold, cross_val_score
from sklearn.preprocessing import StandardScaler
from sklearn_motionsync import DenseSynchronizer, FrameWise, LinearSynchronizer
from sklearn_motionsync.datasets import make_gait
from sklearn_motionsync.metrics import FeatureHoldoutScorer, SpreadScorer

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
        (DenseSynchronizer(40), FeatureHoldoutScorer(n_folds=2), "array of arrays"),
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
    scorer = FeatureHoldoutScorer(n_folds=2)
    expected = scorer(plain, X[:4], **given)
    assert scorer(sync, X[:4], keyframes=few) == expected
    seconds = {"keyframes": few / 100, "frame_rate": 100}
    np.testing.assert_allclose(scorer(sync, X[:4], **seconds), expected)
