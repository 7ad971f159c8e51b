"""The models of a classifier: each performance is seen by that of the class it was given."""

from typing import NamedTuple

import numpy as np
from sklearn.pipeline import Pipeline

from ..inputs.collections import as_collection
from ..inputs.validation import labels_of_input
from ..utils.pipelines import find_classifier, transform_through

__all__ = ["ClassModel", "models_of_classes"]


class ClassModel(NamedTuple):
    """The model of a class, and the performances that were given this class.

    Attributes
    ----------
    label : label of the class
    estimator : Pipeline
        Fitted: the steps before the classifier, and those of ``model_of(label)``.
    performances : performances, as the estimator takes them
    indices : ndarray of int
        Which of all they are.
    labels : list
        What they are called.
    """

    label: object
    estimator: Pipeline
    performances: object
    indices: np.ndarray
    labels: list


def models_of_classes(estimator, X, params, caller, only=None):
    """The models of the classes that performances are given, whether rejected or not.

    Parameters
    ----------
    estimator : estimator or Pipeline
        Fitted.
    X : performances, as the estimator takes them
    params : dict
        What the steps before the classifier take besides.
    caller : str
        Whom the user has called with (estimator, X), for messages.
    only : callable, default=None
        Which performance is asked for, by how many there are; by default all.

    Returns
    -------
    list of ClassModel, or None
        None if there is no classifier that has models.
    """
    found = find_classifier(estimator)
    if found is None:
        return None
    before, classifier = found
    features = transform_through(before, X, params, caller)
    performances = classifier.check_performances(features)
    chosen = np.arange(len(performances))
    if only is not None:
        chosen = chosen[[only(len(performances))]]
    collection = as_collection(X)
    columns = classifier.predict_proba(performances.take(chosen)).argmax(axis=1)
    models, called = [], labels_of_input(X, performances)[0]
    for column in dict.fromkeys(columns.tolist()):
        indices, label = chosen[columns == column], classifier.classes_[column]
        steps = [] if before is None else before.steps
        some = _rows(X, indices) if collection is None else [collection[i] for i in indices]
        whole = Pipeline([*steps, *classifier.model_of(label).steps])
        labels = [called[i] for i in indices]
        models.append(ClassModel(label, whole, some, indices, labels))
    return models


def _rows(X, indices):
    return X.iloc[indices] if hasattr(X, "iloc") else np.asarray(X)[indices]
