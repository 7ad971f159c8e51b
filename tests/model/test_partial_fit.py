"""partial_fit: against one fit on all trials, and against slow loops."""

import math
import pickle
import tracemalloc
from fractions import Fraction
from itertools import pairwise

import numpy as np
import pandas as pd
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from sklearn.exceptions import NotFittedError
from sklearn.utils.validation import check_is_fitted
from sklearn_motionsync import ActionModel, to_frame
from sklearn_motionsync.model import find_departures
from sklearn_motionsync.model.similarity import TrialStream
from test_similarity import curves, hide, slow_dissimilarity, slow_threshold, slow_weights

few = settings(max_examples=8, deadline=None, derandomize=True, database=None)


def in_portions(X, groups=None, cuts=()):
    model = ActionModel()
    for start, stop in pairwise([0, *sorted(cuts), len(X)]):
        if start < stop:
            some = None if groups is None else groups[start:stop]
            assert model.partial_fit(X[start:stop], groups=some) is model
    return model


# What does not depend on portions.
NAMES = "mean_", "variance_", "predictive_variance_", "missing_", "deviations_", "groups_"


def assert_same_state(model, expected):
    for name in (*NAMES, "n_samples_seen_", "n_frames_"):
        found, value = (np.asarray(getattr(each, name)) for each in (model, expected))
        np.testing.assert_array_equal(found, value, err_msg=name)
        assert found.dtype == value.dtype, name


# -- as one fit -------------------------------------------------------------------------


@few
@given(st.data())
def test_partial_fits_equal_one_fit_to_the_last_bit(data):
    n = data.draw(st.integers(2, 64))
    X = curves(n, seed=data.draw(st.integers(0, 99)), n_frames=12)
    X = X.astype(data.draw(st.sampled_from(["f4", "f8"])))
    groups = data.draw(st.none() | st.lists(st.sampled_from("abcde"), min_size=n, max_size=n))
    if groups is not None:
        groups[-1] = "another"
    cuts = data.draw(st.lists(st.integers(0, n)))
    model, expected = in_portions(X, groups, cuts), ActionModel().fit(X, groups=groups)
    assert_same_state(model, expected)
    assert model.threshold_ == expected.threshold_
    new = curves(5, seed=7, spread=0.4, n_frames=12).astype(X.dtype)
    for ask in (
        lambda m: m.decision_function(new),
        lambda m: m.score_samples(new),
        lambda m: m.sample(3, random_state=0),
        lambda m: m.sample(3, frame=4, random_state=0),
        lambda m: m.envelope(simultaneous=True),
    ):
        np.testing.assert_array_equal(ask(model), ask(expected))


@pytest.mark.parametrize("groups", [None, np.arange(80) ** 2 // 150])
@pytest.mark.parametrize(("size", "share"), [(1, 0), (50, 0), (50, 0.4)])
def test_kept_trials_do_not_depend_on_portions(groups, size, share):
    X = hide(curves(80, n_frames=10), share, length=3)
    model = in_portions(X, groups, range(0, 80, size))
    assert_same_state(model, ActionModel().fit(X, groups=groups))
    assert len(model.groups_) == 64


def test_mean_and_variance_are_exact_to_rounding():
    """Far from the origin, where sums of squares would have no digit left."""
    rng = np.random.default_rng(0)
    X = 1e7 + rng.standard_normal((300, 3, 2))
    for dtype, place, bound in (("f8", 0, 1e-14), ("f4", 1e7 - 100, 1e-7)):
        some = (X - place).astype(dtype)
        model = in_portions(some, cuts=[1, 2, 50, 51])
        for p, k in np.ndindex(3, 2):
            exact = [Fraction(float(v)) for v in some[:, p, k]]
            mean = sum(exact) / 300
            variance = sum((v - mean) ** 2 for v in exact) / 300
            assert math.isclose(model.mean_[p, k], mean, rel_tol=bound)
            assert math.isclose(model.variance_[p, k], variance, rel_tol=bound)


def test_partial_fit_continues_a_fit_and_fit_forgets():
    X = curves(20, n_frames=10)
    model = ActionModel().fit(X[:8])
    assert_same_state(model.partial_fit(X[8:]), ActionModel().fit(X))
    assert_same_state(model.fit(X[8:]), ActionModel().fit(X[8:]))
    assert not hasattr(model.fit(X), "feature_names_in_")
    np.testing.assert_array_equal(model.dissimilarities_, ActionModel().fit(X).dissimilarities_)
    again = pickle.loads(pickle.dumps(ActionModel().fit(X[:8])))
    assert_same_state(again.partial_fit(X[8:]), ActionModel().fit(X))


def test_a_label_is_the_same_group_in_all_calls():
    """Trials without a label are groups of their own, also in between."""
    X = curves(9, n_frames=10)
    model = ActionModel().partial_fit(X[:3], groups=["b", "a", "b"])
    model.partial_fit(X[3:5]).partial_fit(X[5:], groups=np.array(["a", "c", "b", "a"]))
    assert model.groups_.tolist() == [0, 1, 0, 2, 3, 1, 4, 0, 1]
    assert_same_state(model, ActionModel().fit(X, groups=list("bab12acba")))


# -- trials kept -------------------------------------------------------------------


def slow_choice(groups, most=64):
    """First of every group, then the others; each by its multiple of the golden ratio."""
    golden = math.isqrt(5 << 128) - (1 << 64) >> 1
    order, seen = [], []
    for i, group in enumerate(groups):
        first = group not in seen
        seen += [group] if first else []
        number = len(seen) - 1 if first else i
        order.append((not first, (number * (golden | 1)) % (1 << 64), i))
    return sorted(i for _, _, i in sorted(order)[:most])


@pytest.mark.parametrize("groups", [[0] * 500, list(range(300)), [i // 4 for i in range(700)]])
def test_kept_trials_are_evenly_spread(groups):
    X = np.zeros((len(groups), 2, 1))
    kept = np.flatnonzero(TrialStream.starting_at(X[0]).extend(X, groups)[2])
    assert kept.tolist() == slow_choice(groups)
    # At three distances, none of them above twice the mean.
    gaps = np.diff(np.array(groups)[kept] if len(set(groups)) > 64 else kept)
    assert len(set(gaps)) <= 3
    assert max(gaps) <= 2 * len(set(groups) if len(set(groups)) > 64 else groups) / 64


# -- the threshold ----------------------------------------------------------------------


@pytest.mark.parametrize(
    ("groups", "edges"),
    [
        # Two portions, the first with more than are kept.
        (np.arange(72) % 9, [0, 68, 72]),
        # What was dropped before the second group came has no dissimilarity.
        (np.repeat([0, 1], [90, 6]), [0, 70, 90, 96]),
    ],
)
def test_dropped_trials_keep_their_dissimilarity_in_the_threshold(groups, edges):
    """By loops."""
    X, kept, values = curves(len(groups), n_frames=8), [], {}
    for start, stop in pairwise(edges):
        compared = [*kept, *range(start, stop)]
        kept = slow_choice(groups[:stop])
        if len(set(groups[:stop])) > 1:
            weights = slow_weights(X[kept], groups[kept])
            for i in compared:
                others = [X[j] for j in kept if groups[j] != groups[i]]
                values[i] = slow_dissimilarity(X[i], others, weights)
    model = in_portions(X, groups, edges)
    np.testing.assert_array_equal(model.groups_, groups[kept])
    np.testing.assert_allclose(model.threshold_, slow_threshold(list(values.values()), 0.95))
    last = [values[i] for i in range(*edges[-2:])]
    np.testing.assert_allclose(model.dissimilarities_, last, rtol=1e-9)


@pytest.mark.parametrize("groups", [None, ["ann"] * 3])
def test_a_single_group_gives_moments_only(groups):
    X = curves(9, n_frames=10)
    n = 1 if groups is None else 3
    model = ActionModel().partial_fit(X[:n], groups=groups)
    check_is_fitted(model)
    np.testing.assert_allclose(model.mean_, X[:n].mean(axis=0))
    np.testing.assert_allclose(model.variance_, X[:n].var(axis=0), atol=1e-15)
    methods = dict.fromkeys(["predict", "score_samples", "dissimilarity"], (X,))
    methods |= {"accepts": [X[0, :2], 0], "check_trials": [X]}
    methods |= dict.fromkeys(["envelope", "mean_envelope", "simultaneous_factor", "sample"], ())
    for name, arguments in methods.items():
        with pytest.raises(NotFittedError, match=f"2 trials, .* has seen {n}, of one"):
            getattr(model, name)(*arguments)
    with pytest.raises(NotFittedError, match="not fitted yet"):
        find_departures(model, X)
    model.partial_fit(X[n:], groups=None if groups is None else ["bob"] * 6)
    groups = None if groups is None else groups + ["bob"] * 6
    assert_same_state(model, ActionModel().fit(X, groups=groups))


# -- all or nothing ---------------------------------------------------------------------


@pytest.mark.parametrize(
    ("X", "groups", "message"),
    [
        (curves(3, n_frames=11), None, "have 11 frames, the model 10"),
        ([np.zeros((10, 2)), np.zeros((9, 2))], None, "Trial 1 has 9 frames"),
        (np.full((3, 10, 2), np.nan), None, "Trial 0 is NaN in every frame and feature"),
        (np.zeros((3, 10, 3)), None, "3 features a frame, but ActionModel is expecting 2"),
        (curves(3, n_frames=10), ["a", None, "b"], r"groups\[1\] is missing, None"),
        (np.zeros((3, 10)), None, "wrap one sequence as"),
        ([], None, "Found 0 trials"),
    ],
)
def test_a_refused_portion_does_not_change_the_model(X, groups, message):
    model = ActionModel().partial_fit(curves(6, n_frames=10), groups=list("aabbcc"))
    before = pickle.dumps(model)
    with pytest.raises(ValueError, match=message):
        model.partial_fit(X, groups=groups)
    assert pickle.dumps(model) == before


def test_a_refused_first_portion_leaves_no_model():
    model, X = ActionModel(), curves(6, n_frames=12)
    with pytest.raises(ValueError, match="Trial 1 has 9 frames"):
        model.partial_fit([np.zeros((10, 2)), np.zeros((9, 2))])
    with pytest.raises(NotFittedError):
        model.score_samples(X)
    assert_same_state(model.partial_fit(X), ActionModel().fit(X))


def test_partial_fit_refuses_a_parameter_that_became_invalid():
    model = ActionModel().partial_fit(curves(6, n_frames=10))
    model.set_params(coverage=95)
    with pytest.raises(ValueError, match="'coverage' parameter of ActionModel must be"):
        model.partial_fit(curves(3, n_frames=10))
    assert model.n_samples_seen_ == 6


# -- kinds of input ---------------------------------------------------------------------


def test_partial_fit_takes_all_kinds_of_collections():
    X = curves(12, n_frames=10)
    tables = [pd.DataFrame(x, columns=["x", "y"]) for x in X]
    model = ActionModel().partial_fit(to_frame(tables[:5])).partial_fit(tables[5:])
    assert_same_state(model, ActionModel().fit(X))
    assert model.feature_names_in_.tolist() == ["x", "y"]
    with pytest.raises(ValueError, match="feature names should match"):
        model.partial_fit([x.rename(columns={"x": "z"}) for x in tables])
    model.partial_fit([x[["y", "x"]] for x in tables[:3]])
    assert_same_state(model, ActionModel().fit([*X, *X[:3]]))
    rows = ActionModel().partial_fit(X[:1, :, 0]).partial_fit(X[1:, :, 0])
    assert_same_state(rows, ActionModel().fit(X[:, :, 0]))
    assert rows.sample(2, random_state=0).shape == (2, 10)


def test_single_precision_becomes_double_with_the_first_double_portion():
    X = curves(12, n_frames=10)
    model = ActionModel().partial_fit(X[:6].astype("f4"))
    assert model.mean_.dtype == model.deviations_.dtype == np.float32
    model.partial_fit(X[6:])
    assert model.mean_.dtype == model.deviations_.dtype == np.float64
    both = np.concatenate([X[:6].astype("f4").astype("f8"), X[6:]])
    assert_same_state(model, ActionModel().fit(both))
    assert model.partial_fit(X[:6].astype("f4")).variance_.dtype == np.float64
    # Also if the only one in double precision is not kept.
    many = curves(77, n_frames=10).astype("f4").astype("f8")
    model = ActionModel().partial_fit(many[:76].astype("f4")).partial_fit(many[76:])
    assert_same_state(model, ActionModel().fit(many))
    assert 76 not in model.groups_


def test_memory_of_a_fit_does_not_grow_with_the_trials():
    """By at most a tenth of the 6400 bytes of each."""
    some = list(np.ascontiguousarray(curves(50, n_frames=200)[:, :, [0, 1] * 4], dtype="f4"))
    peaks = []
    for n in (300, 1300):
        tracemalloc.start()
        ActionModel().fit((some * 26)[:n])
        peaks.append(tracemalloc.get_traced_memory()[1])
        tracemalloc.stop()
    assert (peaks[1] - peaks[0]) / 1000 < 640
