"""Which features of a step of a pipeline are meant, by name or index."""

from numbers import Integral

import pandas as pd
from sklearn.base import OneToOneFeatureMixin

# Features shown when none are named.
_FEW = 4


def choose_features(features, names):
    """Indices of features given by index or name; by default the first few."""
    names = list(names)
    if features is None:
        return list(range(min(_FEW, len(names))))
    chosen = [_index_of(feature, names) for feature in as_features(features)]
    if not chosen:
        raise ValueError("features must name at least one feature.")
    return chosen


def _index_of(feature, names):
    if isinstance(feature, str) and names.count(feature) > 1:
        raise ValueError(f"The feature {feature!r} comes {names.count(feature)} times; say which.")
    if isinstance(feature, str) and feature in names:
        return names.index(feature)
    is_index = isinstance(feature, Integral) and not isinstance(feature, bool)
    if not (is_index and 0 <= feature < len(names)):
        raise ValueError(
            f"There is no feature {feature!r}; there are {len(names)}: {', '.join(names)}."
        )
    return int(feature)


def as_features(features):
    """Features by index or name as a list, of one or several; empty for None."""
    if features is None:
        return []
    single = isinstance(features, str) or not hasattr(features, "__iter__")
    return [features] if single or getattr(features, "ndim", 1) == 0 else list(features)


def check_input_features(estimator, input_features):
    """Refuse ``input_features`` that are not one name each, or not those seen in fit."""
    if input_features is None:
        return
    if hasattr(estimator, "n_features_in_"):
        OneToOneFeatureMixin.get_feature_names_out(estimator, input_features)
    counts = pd.Series(list(input_features), dtype=object).value_counts()
    if (counts > 1).any():
        raise ValueError(
            f"input_features must name every feature once, but {counts.index[0]!r} comes "
            f"{counts.iloc[0]} times."
        )


def names_of_features(before, step, width):
    """Names of the ``width`` features that reach a step of a pipeline, after those before it."""
    names = getattr(step, "feature_names_in_", None)
    if names is None and before is not None:
        try:
            names = before.get_feature_names_out()
        except AttributeError:  # of a pipeline in which some step does not name its features
            names = None
    if names is None or len(names) != width:
        names = [f"x{i}" for i in range(width)]
    return [str(name) for name in names]
