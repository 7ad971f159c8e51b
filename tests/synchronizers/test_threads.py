"""One estimator in the hands of several threads."""

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
    KeyframeSynchronizer,
    LinearSynchronizer,
    Skeleton,
)

from shift_synchronizer import ShiftSynchronizer

ESTIMATORS = [
    DenseSynchronizer(),
    DenseSynchronizer(n_jobs=2, consensus=2),
    KeyframeSynchronizer(),
    LinearSynchronizer(),
    ShiftSynchronizer(),
    ASpace(),
    ActionModel(),
    DirectionCosines(Skeleton.paper()),
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
    """All that a fit learnt, and that a user can see."""
    names = [name for name in vars(estimator) if name.endswith("_")]
    return {name: np.asarray(getattr(estimator, name)).tobytes() for name in sorted(names)}


@pytest.mark.parametrize("estimator", ESTIMATORS, ids=by_name)
def test_fits_at_once(estimator, sets):
    """No call fails, and in the end the estimator is that of one call, whole."""
    expected = [state(clone(estimator).fit(X)) for X in sets]
    shared, start = clone(estimator), threading.Barrier(len(sets))

    def fit(X):
        start.wait()
        return [shared.fit(X) for _ in range(5)]

    with ThreadPoolExecutor(len(sets)) as pool:
        results = list(pool.map(fit, sets))
    assert all(result is shared for fits in results for result in fits)
    assert state(shared) in expected


@pytest.mark.parametrize(
    "estimator", [e for e in ESTIMATORS if hasattr(e, "transform")], ids=by_name
)
def test_each_fit_transform_is_right(estimator, sets):
    expected = [clone(estimator).fit_transform(X) for X in sets]
    shared, start = clone(estimator), threading.Barrier(len(sets))

    def fit_transform(X):
        start.wait()
        return [shared.fit_transform(X) for _ in range(5)]

    with ThreadPoolExecutor(len(sets)) as pool:
        results = list(pool.map(fit_transform, sets))
    for outputs, right in zip(results, expected, strict=True):
        for output in outputs:
            for x, y in zip(output, right, strict=True):
                np.testing.assert_array_equal(x, y)


def test_transforms_while_it_is_fitted_again(sets):
    """Each transform is that of the old state or of the new one."""
    first, second = sets[:2]
    sync = DenseSynchronizer(30).fit(first)
    right = [sync.transform(first), clone(sync).fit(second).transform(first)]
    with ThreadPoolExecutor(2) as pool:
        fits = pool.submit(lambda: [sync.fit(X) for X in (second, first) * 10])
        outputs = list(pool.map(lambda _: sync.transform(first), range(50)))
        fits.result()
    for output in outputs:
        assert any(np.array_equal(output, expected) for expected in right)


@pytest.mark.parametrize("estimator", ESTIMATORS, ids=by_name)
def test_a_fit_that_fails_leaves_nothing_fitted(estimator, sets):
    fitted = clone(estimator).fit(sets[0])
    parameters = fitted.get_params()
    with pytest.raises(ValueError, match="Performance 1"):
        fitted.fit([sets[1][0], sets[1][1] * np.nan])
    with pytest.raises(NotFittedError):
        check_is_fitted(fitted)
    assert fitted.get_params() == parameters
    assert state(fitted.fit(sets[2])) == state(clone(estimator).fit(sets[2]))


def test_what_an_earlier_fit_alone_learnt_is_gone(sets):
    """Names of features are learnt of frames only."""
    sync = LinearSynchronizer().fit([pd.DataFrame(x).add_prefix("f") for x in sets[0]])
    assert hasattr(sync, "feature_names_in_")
    assert not hasattr(sync.fit(sets[1]), "feature_names_in_")
