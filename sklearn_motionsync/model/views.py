"""A model seen in the features that are asked for: its own, or those of postures."""

from typing import NamedTuple

import numpy as np
from sklearn.base import clone
from sklearn.utils.validation import check_is_fitted

from ..aspace import ASpace
from ..features import as_features, names_of
from ..pipelines import find_step, flat_steps, transform_through
from .action_model import ActionModel

__all__ = ["View", "view_of"]


class View(NamedTuple):
    """A model in some features, and what reaches it.

    Attributes
    ----------
    model : ActionModel
        Fitted.
    names : list of str
        Its features.
    synchronised : ndarray (n_sequences, P, n_features) or None
        Performances in these features.
    labels : list
        Of these performances.
    """

    model: ActionModel
    names: list
    synchronised: np.ndarray | None
    labels: list


def view_of(estimator, X=None, params=None, caller="", *, features=None, postures=False):
    """The model of an estimator in the features that are asked for.

    Parameters
    ----------
    estimator : ActionModel, or Pipeline with one
        Fitted.
    X : performances, as the estimator takes them, default=None
    params : dict, default=None
        What synchronizing X takes besides, such as ``keyframes``.
    caller : str, default=""
        Whom the user has called with (estimator, X), for messages.
    features : int, str or list of them, default=None
        If one of them is no feature of the model, the model is taken back out of the `ASpace`
        before it: fitted anew on its training performances, of which it keeps 64 at most.
    postures : bool, default=False
        Take it back whenever there is such an aSpace.

    Returns
    -------
    View

    Raises
    ------
    ValueError
        If a step between them cannot be taken back.
    """
    before, model = find_step(estimator, ActionModel)
    check_is_fitted(model)
    synchronised, labels = None, []
    if X is not None:
        performances = model.check_performances(transform_through(before, X, params or {}, caller))
        synchronised, labels = np.stack(performances), performances.labels
    names = names_of(before, model, model.mean_.shape[1])
    asked = any(isinstance(f, str) and f not in names for f in as_features(features))
    aspace = None
    if before is not None and (asked or postures):
        aspace, names = _space_before(before, names, must=asked)
    if aspace is None:
        return View(model, names, synchronised, labels)

    def back(points):
        return points @ aspace.components_ + aspace.mean_

    # About the mean of all training performances, not of those that were kept.
    kept = model.mean_ + model.deviations_ - model.deviations_.mean(axis=0)
    in_postures = clone(model).fit(back(kept), groups=model.groups_)
    return View(in_postures, names, None if X is None else back(synchronised), labels)


def _space_before(before, names, must):
    """The ASpace before the model and the names of its postures; None and the names without."""
    try:
        before_aspace, aspace = find_step(before, ASpace)
    except ValueError:
        if must:
            raise
        return None, names
    steps = flat_steps(before)
    between = [s for s in steps[steps.index(aspace) + 1 :] if not hasattr(s, "match")]
    if between and must:
        raise ValueError(
            f"Between ASpace and ActionModel stands {between[0]}: the model cannot be taken back "
            f"to postures. Choose features of the model: {', '.join(names)}."
        )
    if between:
        return None, names
    return aspace, names_of(before_aspace, aspace, aspace.n_features_in_)
