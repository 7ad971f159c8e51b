"""Synchronizer: what a subclass inherits that only defines match."""

import inspect
import pickle

import numpy as np
import pandas as pd
import pytest
from sklearn.exceptions import NotFittedError
from sklearn.model_selection import cross_val_score
from sklearn.pipeline import make_pipeline
from sklearn_motionsync import (
    ActionModel,
    ASpace,
    DenseSynchronizer,
    DirectionCosines,
    LinearSynchronizer,
    Match,
)
from sklearn_motionsync.display import SynchronizationDisplay, TrellisDisplay
from sklearn_motionsync.metrics import SpreadScorer
from sklearn_motionsync.synchronizers import Synchronizer

from shift_synchronizer import ShiftSynchronizer


@pytest.fixture(scope="module")
def shifted():
    """One bump, early or late."""
    t = np.linspace(0, 1, 81)[:, np.newaxis]
    centres = (0.5, 0.4, 0.55, 0.6, 0.475)
    return [np.exp(-(((t - c) / 0.1) ** 2)) * [1.0, -2.0, 0.5] for c in centres]


def test_short_subclass_finds_shifts(shifted):
    assert len(inspect.getsource(ShiftSynchronizer).splitlines()) <= 15
    sync = ShiftSynchronizer(pattern=0).fit(shifted)
    offsets = sync.match(shifted).offsets[:, 40]
    np.testing.assert_array_equal(offsets.round(), [0, -8, 4, 8, -2])
    out = sync.transform(shifted)
    np.testing.assert_allclose(out[:, 20:60], np.repeat(out[:1, 20:60], 5, axis=0), atol=0.15)


def test_subclass_works_in_pipelines_and_displays(bending):
    data, steps = bending.data[:8], (DirectionCosines(bending.skeleton), ASpace())
    pipe = make_pipeline(*steps, ShiftSynchronizer(50), ActionModel()).fit(data)
    assert pipe.predict(data).shape == (8,)
    display = SynchronizationDisplay.from_estimator(pipe, data, features=["aspace0"])
    np.testing.assert_array_equal(display.match.times, Match.from_estimator(pipe, data).times)
    assert np.isfinite(cross_val_score(pipe[:3], data, cv=2, scoring=SpreadScorer())).all()
    with pytest.raises(ValueError, match="There is no DenseSynchronizer in Pipeline"):
        TrellisDisplay.from_estimator(pipe, data)


@pytest.mark.parametrize(
    ("answer", "message"),
    [
        (lambda X: np.zeros((5, 30)), r"got ndarray with \(\)"),
        (lambda X: Match(np.zeros((5, 7))), r"here \(5, 30\); got Match with \(5, 7\)"),
        (lambda X: Match(np.zeros((2, 30))), r"here \(5, 30\); got Match with \(2, 30\)"),
    ],
)
def test_transform_refuses_wrong_answers_of_match(answer, message, shifted):
    class Wrong(Synchronizer):
        def match(self, X):
            return answer(X)

    with pytest.raises(ValueError, match=f"Wrong.match must return a Match .*{message}"):
        Wrong(30).fit_transform(shifted)


def test_match_must_be_defined(shifted):
    class Silent(Synchronizer):
        pass

    sync = Silent().fit(shifted)
    assert sync.n_frames_ == 81
    with pytest.raises(NotImplementedError, match=r"Silent does not define match\(self, X\)"):
        sync.transform(shifted)


@pytest.mark.parametrize("estimator", [ShiftSynchronizer, DenseSynchronizer])
def test_normalize_is_linear_normalisation(estimator, shifted):
    with pytest.raises(NotFittedError):
        estimator().normalize(shifted)
    expected = LinearSynchronizer(30).fit_transform(shifted)
    np.testing.assert_array_equal(estimator(30).fit(shifted).normalize(shifted), expected)
    rows = np.stack([x[:, 0] for x in shifted])
    assert estimator(30).fit(rows).normalize(rows).shape == (5, 30, 1)


def test_checked_trials_are_not_checked_again(shifted):
    sync = DenseSynchronizer(30).fit(shifted)
    checked = sync.check_trials(shifted)
    assert sync.check_trials(checked) is checked
    assert [len(x) for x in checked] == [81] * 5
    some = sync.match(checked.take([1, 2]))
    np.testing.assert_array_equal(some.times, sync.match(shifted[1:3]).times)
    rows = np.stack([x[:, 0] for x in shifted])
    univariate = DenseSynchronizer(30).fit(rows)
    some = univariate.match(univariate.check_trials(rows).take(slice(1, 3)))
    np.testing.assert_array_equal(some.times, univariate.match(rows[1:3]).times)
    np.testing.assert_array_equal(sync.match(checked).times, sync.match(shifted).times)
    # Those checked by another estimator are.
    narrow = LinearSynchronizer().fit([x[:, :2] for x in shifted])
    with pytest.raises(ValueError, match="Trial 0 has 3 features a frame"):
        narrow.transform(checked)


def test_pattern_is_pickled_without_names():
    X = [pd.DataFrame(np.eye(9)[:, :2] * k, columns=["hip", "knee"]) for k in (1, 2, 3)]
    sync = LinearSynchronizer(pattern=X[1]).fit(X)
    loaded = pickle.loads(pickle.dumps(sync))
    assert isinstance(sync.pattern, pd.DataFrame)
    assert type(loaded.pattern) is np.ndarray
    np.testing.assert_array_equal(loaded.transform(X), sync.transform(X))
