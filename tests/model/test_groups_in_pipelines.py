"""Groups reach the model through pipelines, cross-validation and searches."""

import numpy as np
import pytest
from sklearn import config_context
from sklearn.model_selection import GridSearchCV, GroupKFold, cross_validate
from sklearn.pipeline import make_pipeline
from sklearn_motionsync import (
    ActionModel,
    ASpace,
    DenseSynchronizer,
    DirectionCosines,
    SynchronizationWarning,
)
from sklearn_motionsync.datasets import make_bending

BUNCH = make_bending(12, n_frames=30, style=1, random_state=0)
GROUPS = np.array([3, 1, 2, 1, 3, 2, 3, 1, 2, 1, 3, 2])
CV = GroupKFold(3)


def make(model=None):
    steps = DirectionCosines(BUNCH.skeleton), ASpace(3), DenseSynchronizer(20)
    return make_pipeline(*steps, ActionModel() if model is None else model)


@pytest.fixture(scope="module")
def expected():
    """The thresholds of the folds, and of all: fitted by hand."""
    folds = [train for train, _ in CV.split(BUNCH.data, groups=GROUPS)]
    found = []
    for train in [*folds, range(12)]:
        some = [BUNCH.data[i] for i in train]
        found.append(make().fit(some, actionmodel__groups=GROUPS[train])[-1].threshold_)
    return found


def test_groups_are_routed(expected):
    with config_context(enable_metadata_routing=True):
        pipe = make(ActionModel().set_fit_request(groups=True))
        assert pipe.fit(BUNCH.data, groups=GROUPS)[-1].threshold_ == expected[-1]
        found = cross_validate(
            pipe, BUNCH.data, cv=CV, params={"groups": GROUPS}, return_estimator=True
        )
        assert [p[-1].threshold_ for p in found["estimator"]] == expected[:3]
        assert np.isfinite(found["test_score"]).all()
        search = GridSearchCV(pipe, {"actionmodel__coverage": [0.95]}, cv=CV)
        search.fit(BUNCH.data, groups=GROUPS)
        assert search.best_estimator_[-1].threshold_ == expected[-1]


def test_conditions_in_the_place_of_people_are_told():
    X = np.random.default_rng(0).standard_normal((40, 20, 2)).cumsum(axis=1)
    condition, person = ["before", "after"] * 20, np.arange(40) // 4
    with pytest.warns(SynchronizationWarning, match="groups names two people for 40 trials"):
        wide = ActionModel().fit(X, groups=condition)
    assert ActionModel().fit(X, groups=person).threshold_ < wide.threshold_
    with pytest.raises(ValueError, match="the same 2 sets of trials apart as y"):
        ActionModel().fit(X, condition, groups=condition)
