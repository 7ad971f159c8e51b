"""One estimator used by several threads at once."""

import threading
from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pandas as pd
import pytest
from sklearn import clone
from sklearn.exceptions import NotFittedError
from sklearn.utils.validation import check_is_fitted
from sklearn_motionsync import (
    ActionModel,
    ASpace,
    DenseSynchronizer,
    DirectionCosines,
    JointPositions,
    KeyframeSynchronizer,
    LinearSynchronizer,
    PartSynchronizer,
    Skeleton,
    TimingChannel,
)

from shift_synchronizer import ShiftSynchronizer

ESTIMATORS = [
    DenseSynchronizer(),
    DenseSynchronizer(n_jobs=2, consensus=2),
    PartSynchronizer({"first": [0]}, synchronizer=DenseSynchronizer(12, metric=None, consensus=1)),
    KeyframeSynchronizer(),
    LinearSynchronizer(),
    ShiftSynchronizer(),
    TimingChannel(LinearSynchronizer()),
    ASpace(),
    ActionModel(),
    DirectionCosines(Skeleton.paper()),
    JointPositions(Skeleton.paper()),
]


TRANSFORMERS = [e for e in ESTIMATORS if hasattr(e, "transform")]


def by_name(estimator):
    return type(estimator).__name__


@pytest.fixture(scope="module")
def sets():
    """Sets of 45 features that differ in number and length."""
    rng = np.random.default_rng(0)
    return [
        list(np.cumsum(rng.standard_normal((n, n_frames, 45)), axis=1))
        for n, n_frames in ((6, 30), (9, 40), (4, 25), (7, 50))
    ]


def state(estimator):
    """The public fitted attributes."""
    names = [name for name in vars(estimator) if name.endswith("_")]
    return {name: as_bytes(getattr(estimator, name)) for name in sorted(names)}


def as_bytes(value):
    if hasattr(value, "get_params"):
        return state(value)
    return repr(value) if isinstance(value, (dict, tuple)) else np.asarray(value).tobytes()


@pytest.mark.parametrize("estimator", ESTIMATORS, ids=by_name)
def test_concurrent_fits_leave_the_state_of_one(estimator, sets):
    # Only tables have names.
    sets = [*sets, [pd.DataFrame(x).add_prefix("f") for x in sets[0]]]
    expected = [state(clone(estimator).fit(X)) for X in sets]
    shared, start = clone(estimator), threading.Barrier(len(sets))

    def fit(X):
        start.wait()
        return [shared.fit(X) for _ in range(3)]

    with ThreadPoolExecutor(len(sets)) as pool:
        results = list(pool.map(fit, sets))
    assert all(result is shared for fits in results for result in fits)
    assert state(shared) in expected


@pytest.mark.parametrize("estimator", TRANSFORMERS, ids=by_name)
def test_concurrent_fit_transforms_are_right(estimator, sets):
    expected = [clone(estimator).fit_transform(X) for X in sets]
    shared, start = clone(estimator), threading.Barrier(len(sets))

    def fit_transform(X):
        start.wait()
        return [shared.fit_transform(X) for _ in range(3)]

    with ThreadPoolExecutor(len(sets)) as pool:
        results = list(pool.map(fit_transform, sets))
    for outputs, right in zip(results, expected, strict=True):
        for output in outputs:
            for x, y in zip(output, right, strict=True):
                np.testing.assert_array_equal(x, y)


@pytest.mark.parametrize("estimator", ESTIMATORS, ids=by_name)
def test_answers_during_a_fit_are_those_of_one_fit(estimator, sets):
    """Each answer is that of the old state or of the new one."""
    ask = "transform" if hasattr(estimator, "transform") else "score_samples"
    first, second = sets[0], [x[:30] for x in sets[1]] if ask == "score_samples" else sets[1]
    shared = clone(estimator).fit(first)
    right = [getattr(clone(estimator).fit(X), ask)(first) for X in (first, second)]

    def same(answer, expected):
        return all(np.array_equal(x, y) for x, y in zip(answer, expected, strict=True))

    with ThreadPoolExecutor(2) as pool:
        fits = pool.submit(lambda: [shared.fit(X) for X in (second, first) * 5])
        answers = list(pool.map(lambda _: getattr(shared, ask)(first), range(25)))
        fits.result()
    assert all(any(same(answer, expected) for expected in right) for answer in answers)


@pytest.mark.parametrize("estimator", ESTIMATORS, ids=by_name)
def test_failed_fit_leaves_nothing_fitted(estimator, sets):
    fitted = clone(estimator).fit(sets[0])
    parameters = fitted.get_params()
    with pytest.raises(ValueError, match="Performance 1"):
        fitted.fit([sets[1][0], sets[1][1] * np.inf])
    with pytest.raises(NotFittedError):
        check_is_fitted(fitted)
    assert fitted.get_params() == parameters
    assert state(fitted.fit(sets[2])) == state(clone(estimator).fit(sets[2]))


def test_failed_fit_keeps_the_fit_of_another_thread(sets):
    class Meeting(LinearSynchronizer):
        def _learn(self, performances, progress):
            if len(performances) == len(sets[1]):
                shared.fit(sets[0])
                raise ValueError("too late")
            super()._learn(performances, progress)

    shared = Meeting()
    with pytest.raises(ValueError, match="too late"):
        shared.fit(sets[1])
    assert shared.n_frames_ == 30


def test_learnt_attributes_may_have_any_name(sets):
    class Named(LinearSynchronizer):
        def __init__(self, n_frames=None, pattern="median", lambda_=1.0):
            super().__init__(n_frames, pattern)
            self.lambda_ = lambda_

        def _learn(self, performances, progress):
            super()._learn(performances, progress)
            self.weights = np.ones(self.n_frames_)

    named = Named(lambda_=2.0).fit(sets[0])
    assert named.weights.shape == (30,)
    assert named.fit(sets[2]).weights.shape == (25,)
    assert named.get_params()["lambda_"] == 2.0
    with pytest.raises(ValueError, match="0 performances"):
        named.fit([])
    assert vars(named) == {"n_frames": None, "pattern": "median", "lambda_": 2.0}


def test_second_fit_removes_attributes_of_the_first(sets):
    sync = LinearSynchronizer().fit([pd.DataFrame(x).add_prefix("f") for x in sets[0]])
    assert hasattr(sync, "feature_names_in_")
    assert not hasattr(sync.fit(sets[1]), "feature_names_in_")
