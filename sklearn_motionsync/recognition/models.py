"""What performances of a class have in common, for those who ask why."""

import warnings

import numpy as np
import pandas as pd
from sklearn.pipeline import Pipeline

from ..model.action_model import ActionModel
from ..synchronizers.dense import DenseSynchronizer

__all__ = ["as_given", "learn_model"]


def learn_model(performances, groups, n_frames, n_jobs):
    """A synchronizer and a model of performances that belong together.

    Parameters
    ----------
    performances : list of arrays or tables, or 2-D array
        At least two.
    groups : ndarray of int, shape (n_sequences,), or None
        How they differ is only learnt of several groups.
    n_frames : int
        Of their clock.
    n_jobs : int or None

    Returns
    -------
    Pipeline
        Fitted.
    """
    if groups is not None and len(np.unique(groups)) < 2:
        groups = None
    synchronizer, model = DenseSynchronizer(n_frames, n_jobs=n_jobs), ActionModel()
    with warnings.catch_warnings():
        # One class may move one feature only; units are a matter of all classes.
        warnings.filterwarnings("ignore", ".* of the energy that is compared", UserWarning)
        synchronized = synchronizer.fit_transform(performances)
    model.fit(synchronized, groups=groups)
    return Pipeline([("densesynchronizer", synchronizer), ("actionmodel", model)])


def as_given(arrays, on_rows, names):
    """Performances as they were given, for estimators that have not seen any."""
    if on_rows:
        return np.stack([x[:, 0] for x in arrays])
    return arrays if names is None else [pd.DataFrame(x, columns=names) for x in arrays]
