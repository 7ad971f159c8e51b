"""Groups and class labels of trials: the one place that checks and encodes them."""

import reprlib
from collections.abc import Iterable, Mapping, Set, Sized
from numbers import Number

import numpy as np
import pandas as pd
from sklearn.utils import assert_all_finite, check_consistent_length, column_or_1d
from sklearn.utils.multiclass import check_classification_targets

from ..matching.gaps import is_gappy

# NumPy scalars that equal Python ones, as which they are kept.
_SCALARS = np.str_, np.number, np.bool_
_NOT_LISTS = str, bytes, Mapping, Set


def encode_groups(
    groups, n_trials, *, name="groups", at_least=1, sort=False
) -> tuple[np.ndarray, list]:
    """Encode the group of each trial as an integer from 0.

    Parameters
    ----------
    groups : array-like, shape (n_trials,), or None
        Text, numbers or dates. None: each trial is a group of its own.
    n_trials : int
    name : str, default="groups"
        The parameter's name, for messages.
    at_least : int, default=1
        Smallest number of different groups.
    sort : bool, default=False
        Whether codes follow the sorted labels; by default, the order of first appearance.

    Returns
    -------
    codes : ndarray of int, shape (n_trials,)
    labels : list
        The label of each code. Without groups, the trials' indices.

    Raises
    ------
    ValueError
        If there is not one label for each trial, a label is missing, labels do not sort, or
        there are too few different ones.

    Examples
    --------
    >>> from sklearn_motionsync.utils.groups import encode_groups
    >>> encode_groups(["bob", "ann", "bob"], 3)
    (array([0, 1, 0]), ['bob', 'ann'])
    """
    if groups is None:
        return np.arange(n_trials), list(range(n_trials))
    if (
        not (isinstance(groups, Iterable) and isinstance(groups, Sized))
        or isinstance(groups, _NOT_LISTS)
        or getattr(groups, "ndim", 1) != 1
    ):
        got = f"shape {groups.shape}" if hasattr(groups, "shape") else reprlib.repr(groups)
        raise ValueError(
            f"{name} must be a list or 1-D array with one label for each trial, such as its "
            f"subject; got {got}."
        )
    if len(groups) != n_trials:
        raise ValueError(
            f"{name} must have one label for each trial, got {len(groups)} for {n_trials}."
        )
    given = _check_labels(groups, name)
    labels = list(dict.fromkeys(given))
    if len(labels) < at_least:
        raise ValueError(
            f"{name}: all labels are equal ({labels[0]!r}): give at least two groups, or none."
        )
    if sort:
        labels.sort()
    code = {label: i for i, label in enumerate(labels)}
    return np.array([code[label] for label in given]), labels


def names_of_groups(groups, n_trials, *, name="groups"):
    """The group of each trial as text, a list; refuses what `encode_groups` refuses."""
    codes, labels = encode_groups(groups, n_trials, name=name)
    return [str(labels[code]) for code in codes]


def refuse_classes_as_people(classes, people):
    """Refuse groups that tell the same trials apart as y does.

    Parameters
    ----------
    classes, people : ndarray of int, shape (n_trials,)
        As `encode_groups` returns them, of y and of groups.
    """
    n_classes, n_people = len(np.unique(classes)), len(np.unique(people))
    n_both = len(np.unique(np.column_stack([classes, people]), axis=0))
    if n_both == n_classes == n_people < len(classes):
        raise ValueError(
            f"groups tells the same {n_people} sets of trials apart as y. y is what trials are "
            "told apart by, such as a condition, and groups is whose they are: give the person of "
            "each trial."
        )


def encode_classes(y, trials, estimator_name):
    """Encode the class of each trial as an integer from 0.

    Parameters
    ----------
    y : array-like, shape (n_sequences,)
    trials : sequence
    estimator_name : str
        For messages.

    Returns
    -------
    classes : ndarray, shape (n_classes,)
        Sorted.
    codes : ndarray of int, shape (n_sequences,)

    Raises
    ------
    ValueError
        If there is not one class for each trial, a class is missing, classes do not sort, or
        all are equal.
    """
    if y is None:
        raise ValueError(f"{estimator_name} requires y to be passed, but the target y is None.")
    if getattr(getattr(y, "dtype", None), "kind", None) == "T":
        # NumPy's text of any length, which scikit-learn does not take.
        y = y.astype(object)
    column = column_or_1d(y, warn=True)
    check_consistent_length(trials, column)
    # Of the input: an array of mixed types would be one of text.
    _check_labels(np.asarray(y, dtype=object).ravel(), "y")
    assert_all_finite(column, input_name="y")
    check_classification_targets(column)
    classes, codes = np.unique(column, return_inverse=True)
    if len(classes) < 2:
        raise ValueError(
            f"{estimator_name} needs trials of at least 2 classes, got one class: "
            f"{classes.tolist()[0]!r}. An ActionDetector learns a single action."
        )
    return classes, codes


def sums_of_groups(values, codes):
    """Sums (n_groups, ...) of values (n, ...) by group, and the counts, of as many dimensions."""
    counts = np.bincount(codes)
    sums = [values[codes == code].sum(axis=0) for code in range(len(counts))]
    return np.array(sums, dtype=np.float64), counts.reshape(-1, *[1] * (values.ndim - 1))


def mean_of_others(values, codes):
    """For each of the values (n, ...), the mean of those of all other groups.

    Gaps (NaN) count in no mean; one of nothing is NaN.
    """
    sums, counts = sums_of_groups(np.nan_to_num(values), codes)
    if is_gappy(values):
        counts = group_counts(values, codes)
    counts = counts.sum(axis=0) - counts
    means = np.full(sums.shape, np.nan)
    np.divide(sums.sum(axis=0) - sums, counts, out=means, where=counts > 0)
    return means[codes]


def group_counts(trials, codes):
    """How many trials of each group show each value: (n_groups, P, n_features)."""
    return sums_of_groups(~np.isnan(trials), codes)[0]


def _check_labels(labels, name):
    """The labels as Python objects: each is there, is one value, and sorts among the others."""
    labels = [label.item() if isinstance(label, _SCALARS) else label for label in labels]
    for i, label in enumerate(labels):
        if np.ndim(label):
            raise ValueError(
                f"{name}[{i}] is {reprlib.repr(label)}: a label is one text, number or date."
            )
        if pd.isna(label):
            raise ValueError(
                f"{name}[{i}] is missing, {label!r}: give trial {i} a label, or leave the "
                "trial out."
            )
    try:
        sorted(set(labels))
    except TypeError as error:
        kinds = [(isinstance(label, str), isinstance(label, Number)) for label in labels]
        i = next((i for i, kind in enumerate(kinds) if kind != kinds[0]), 0)
        raise ValueError(
            f"{name}[{i}] is {labels[i]!r}, {name}[0] is {labels[0]!r}: labels must be of one type "
            "that can be sorted, such as text."
        ) from error
    return labels
