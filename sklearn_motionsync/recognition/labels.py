"""Labels of classes: whole numbers for the learning, and one for what is none of them."""

import numpy as np
import pandas as pd
from sklearn.utils import assert_all_finite, check_consistent_length, column_or_1d
from sklearn.utils.multiclass import check_classification_targets

__all__ = ["check_labels", "label_of_unknown"]


def check_labels(name, performances, y):
    """The classes, and the class of every performance as a whole number from 0.

    Parameters
    ----------
    name : str
        Of the classifier, for messages.
    performances : sequence
    y : array-like, shape (n_sequences,)

    Returns
    -------
    classes : ndarray, shape (n_classes,)
    codes : ndarray of int, shape (n_sequences,)
    """
    if y is None:
        raise ValueError(f"{name} requires y to be passed, but the target y is None.")
    y = column_or_1d(y, warn=True)
    check_consistent_length(performances, y)
    assert_all_finite(y, input_name="y")
    if (without := pd.isna(y)).any():
        raise ValueError(f"y has no label for performance {int(without.argmax())}.")
    check_classification_targets(y)
    classes, codes = np.unique(y, return_inverse=True)
    if len(classes) < 2:
        raise ValueError(
            f"{name} needs performances of at least 2 classes, got one class: "
            f"{classes.tolist()[0]!r}. Whether performances are one action is what an "
            "ActionDetector learns."
        )
    return classes, codes


def label_of_unknown(label, classes):
    """What performances are called that are none of the classes: of the same type as these.

    Parameters
    ----------
    label : str, number or None
        None is "unknown", or -1 among numbers.
    classes : ndarray, shape (n_classes,)
    """
    kind = classes.dtype.kind
    is_text = kind in "US" or (kind == "O" and isinstance(classes[0], str))
    if label is None:
        label = "unknown" if is_text else -1
    if label in classes.tolist():
        raise ValueError(
            f"unknown_label={label!r} is one of the classes: choose another label for those that "
            "are rejected."
        )
    if is_text != isinstance(label, str):
        raise ValueError(
            f"unknown_label={label!r} must be {'text' if is_text else 'a number'}, like the "
            f"classes {classes.tolist()}."
        )
    return np.array(label, dtype=object) if kind == "O" else label
