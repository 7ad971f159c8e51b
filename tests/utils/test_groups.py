"""Groups and classes: every public method that takes them encodes and refuses the same."""

import inspect
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
import pandas as pd
import pytest
from sklearn.pipeline import make_pipeline
from sklearn_motionsync import (
    ActionClassifier,
    ActionDetector,
    ActionModel,
    DenseSynchronizer,
    LinearSynchronizer,
    PartSynchronizer,
)
from sklearn_motionsync.comparison import (
    compare_effects,
    compare_events,
    compare_groups,
    compare_to_norm,
    plan_study,
)
from sklearn_motionsync.display import GroupDisplay, LagDisplay, SynchronizationDisplay
from sklearn_motionsync.live import MotionTracker
from sklearn_motionsync.report import write_report
from sklearn_motionsync.takes import find_trials
from sklearn_motionsync.utils.groups import encode_classes, encode_groups, names_of_groups

from public import functions

N, T = 6, np.linspace(0, 1, 20)
X = np.stack([a * np.column_stack([np.sin(5 * T), T**2]) for a in (0.8, 0.9, 1.0, 1.1, 1.2, 1.3)])
PARTS = PartSynchronizer({"arm": [0]}, synchronizer=DenseSynchronizer(10)).fit(X)
SYNC = LinearSynchronizer(10).fit(X)
PIPE = make_pipeline(LinearSynchronizer(10), ActionModel()).fit(X)
EVENTS = [[k + 3, 15] for k in range(N)]
Y, FEW = [0, 0, 0, 1, 1, 1], {"n_permutations": 19}


def report(**given):
    with TemporaryDirectory() as folder:
        write_report(Path(folder) / "report.html", SYNC, X, **given)


def shown(display, estimator, name):
    """The call of a display with labels, which needs no two of them."""
    return lambda labels: display.from_estimator(estimator, X, **{name: labels}), False


# What each method does with groups of the N trials; whether it needs two of them.
METHODS = {
    "ActionModel.fit(groups)": (lambda g: ActionModel().fit(X, groups=g), True),
    "ActionModel.partial_fit(groups)": (lambda g: ActionModel().partial_fit(X, groups=g), False),
    "ActionDetector.fit(groups)": (lambda g: ActionDetector(PIPE).fit(X, groups=g), True),
    "ActionClassifier.fit(groups)": (
        lambda g: ActionClassifier(n_frames=10).fit(X, [0, 1] * 3, groups=g),
        True,
    ),
    "ActionClassifier.fit(y)": (lambda y: ActionClassifier(n_frames=10).fit(X, y), True),
    "MotionTracker.fit(groups)": (lambda g: MotionTracker(SYNC, 20).fit(X, groups=g), True),
    "PartSynchronizer.lags(groups)": (lambda g: PARTS.lags(X, groups=g), False),
    "compare_effects(groups)": (
        lambda p: compare_effects(SYNC, X, {"y": list("ababab")}, "y", groups=p, **FEW),
        True,
    ),
    "compare_events(y)": (lambda g: compare_events(X, EVENTS, g, **FEW), True),
    "compare_events(groups)": (lambda p: compare_events(X, EVENTS, Y, groups=p, **FEW), True),
    "compare_groups(y)": (lambda g: compare_groups(SYNC, X, g, **FEW), True),
    "compare_groups(groups)": (lambda p: compare_groups(SYNC, X, Y, groups=p, **FEW), True),
    "compare_to_norm(y)": (lambda g: compare_to_norm(SYNC, X, g, norm=next(iter(g))), True),
    "compare_to_norm(groups)": (lambda p: compare_to_norm(SYNC, X, Y, norm=0, groups=p), True),
    "plan_study(y)": (lambda g: plan_study(SYNC, X, g, n_studies=10), True),
    "plan_study(groups)": (lambda p: plan_study(SYNC, X, Y, groups=p, n_studies=10), True),
    "write_report(y)": (lambda g: report(y=g), True),
    "write_report(groups)": (lambda p: report(groups=p), False),
    "find_trials(groups)": (lambda g: find_trials(SYNC, X[0], groups=g), True),
    "GroupDisplay.from_estimator(y)": shown(GroupDisplay, SYNC, "y"),
    "GroupDisplay.from_estimator(groups)": shown(GroupDisplay, SYNC, "groups"),
    "LagDisplay.from_estimator(groups)": shown(LagDisplay, PARTS, "groups"),
    "SynchronizationDisplay.from_estimator(y)": shown(SynchronizationDisplay, SYNC, "y"),
}
REFUSED = [
    ([*"abcde", None], r"\[5\] is missing, None"),
    (np.array([0, 1, np.nan, 3, 4, 5]), r"\[2\] is missing, nan"),
    (pd.to_datetime(["2020-01-01"] * 4 + [None] * 2), r"\[4\] is missing, NaT"),
    (pd.Series([1, 2, None] * 2, dtype="Int64"), r"\[2\] is missing, <NA>"),
    ([1, 2, 3, "b", 5, 6], r"\[3\] is 'b', {0}\[0\] is 1: labels must be of one type"),
    (list("abcde"), "{0} must have one label for each trial, got 5 for 6"),
    ("abcdef", "{0} must be a list or 1-D array .* got 'abcdef'"),
    (dict.fromkeys(range(6)), "{0} must be a list or 1-D array .* got {{"),
    (np.zeros((6, 2)), r"{0} must be a list or 1-D array .* got shape \(6, 2\)"),
    ([["a"], ["b"]] * 3, r"{0}\[0\] is \['a'\]: a label is one"),
    ([0, 1, 2, 3, [4], 5], r"{0}\[4\] is \[4\]: a label is one"),
]


# Labels of anything are checked there as here; of these y is not used, or what scikit-learn checks.
OF_OTHERS = {"ActionDetector.fit(y)", "ActionModel.fit(y)", "ActionModel.partial_fit(y)"}
OF_OTHERS |= {"MotionTracker.fit(y)"}


def methods_with_labels():
    """Public methods and functions that take labels of trials, as METHODS names them."""
    for name, each in functions():
        if inspect.isfunction(each) or inspect.ismethod(each):
            parameters = inspect.signature(each).parameters
            if "groups" in parameters:
                yield from (f"{name}({p})" for p in ("y", "groups") if p in parameters)
            elif "y" in parameters and parameters["y"].annotation == "Labels | None":
                yield f"{name}(y)"


def test_every_public_method_with_labels_is_tested():
    assert set(methods_with_labels()) - OF_OTHERS == set(METHODS) - OF_OTHERS


@pytest.mark.parametrize(("labels", "message"), REFUSED)
def test_what_is_no_label_for_each_trial_is_refused(labels, message):
    with pytest.raises(ValueError, match=message.format("groups")):
        encode_groups(labels, N)
    # The shape of y is checked as in scikit-learn.
    if "missing" in message or "one type" in message:
        with pytest.raises(ValueError, match=message.format("y")):
            encode_classes(labels, range(N), "Name")


@pytest.mark.parametrize("method", METHODS)
def test_methods_refuse_labels_by_the_name_of_their_parameter(method):
    call, parameter = METHODS[method][0], method.partition("(")[2].rstrip(")")
    with pytest.raises(ValueError, match=rf"{parameter}\[5\] is missing, None"):
        call([*"abcde", None])
    if parameter != "y":
        with pytest.raises(ValueError, match=f"{parameter} must have one label .* got 5 for 6"):
            call(list("abcde"))


@pytest.mark.usefixtures("without_pictures")
@pytest.mark.parametrize("method", METHODS)
def test_methods_refuse_a_single_group_where_two_are_needed(method):
    fit, needs_two = METHODS[method]
    if needs_two:
        message = r"all labels are equal \('a'\): give at least two groups, or none|one class: 'a'"
        with pytest.raises(ValueError, match=message):
            fit(["a"] * N)
    else:
        fit(["a"] * N)


@pytest.mark.usefixtures("without_pictures")
@pytest.mark.parametrize("method", METHODS)
def test_methods_accept_numbers_in_columns(method):
    # People with one label of y each.
    labels = [3, 1] * 3 if method.endswith("(y)") else [3, 1, 4, 0, 5, 2]
    METHODS[method][0](pd.Series(labels))


def test_codes_follow_first_appearance_or_the_sorted_labels():
    letters = ["c", "a", "c", "b"]
    for kind in (list, np.array, pd.Series, lambda labels: np.array(labels, dtype=object)):
        codes, labels = encode_groups(kind(letters), 4)
        assert (codes.tolist(), labels) == ([0, 1, 0, 2], ["c", "a", "b"])
        assert all(type(label) is str for label in labels)
    codes, labels = encode_groups(letters, 4, sort=True)
    assert (codes.tolist(), labels) == ([2, 0, 2, 1], ["a", "b", "c"])
    dates = pd.date_range("2020", periods=3)
    for given in ([2.5, -1, True], pd.Categorical(["u", "t", "s"]), dates):
        assert encode_groups(given, 3)[0].tolist() == [0, 1, 2]
    codes, labels = encode_groups(None, 3, at_least=2)
    assert (codes.tolist(), labels) == ([0, 1, 2], [0, 1, 2])
    assert names_of_groups([2, 1], 2) == ["2", "1"]


@pytest.mark.parametrize("labels", [["b", "a"], [2, 1], [True, False], np.array([2, 1], np.int8)])
def test_classes_keep_their_type_and_are_sorted(labels):
    y = np.tile(labels, 2)
    classes, codes = encode_classes(y, range(4), "Name")
    np.testing.assert_array_equal(classes[codes], y)
    assert classes.dtype == y.dtype
    assert classes.tolist() == sorted(np.asarray(labels).tolist())
