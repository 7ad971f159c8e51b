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
    own : ActionModel
        The model of the estimator, in its own features.
    given : sequence of ndarray (P, n_own_features) or None
        Performances in those, checked: the methods of that model take them as they are.
    """

    model: ActionModel
    names: list
    synchronised: np.ndarray | None
    labels: list
    own: ActionModel
    given: tuple | None

    @property
    def scores(self):
        """The `ActionModel.standard_scores` of the performances."""
        with np.errstate(over="ignore"):
            away = self.synchronised - self.model.mean_
            return away / np.sqrt(self.model.predictive_variance_)

    def only(self, chosen):
        """The same in some of the features, by index."""
        if list(chosen) == list(range(len(self.names))):
            return self
        some = None if self.synchronised is None else self.synchronised[:, :, chosen]
        model = _seen(self.model, lambda points: points[:, :, chosen])
        names = [self.names[i] for i in chosen]
        return self._replace(model=model, names=names, synchronised=some)


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
    given, points, labels = None, None, []
    if X is not None:
        given = model.check_performances(transform_through(before, X, params or {}, caller))
        points, labels = np.stack(given), given.labels
    names = names_of(before, model, model.mean_.shape[1])
    asked = any(isinstance(f, str) and f not in names for f in as_features(features))
    aspace = None
    if before is not None and (asked or postures):
        aspace, names = _space_before(before, names, must=asked)
    if aspace is None:
        return View(model, names, points, labels, model, given)

    def back(points):
        return points @ aspace.components_ + aspace.mean_

    synchronised = None if X is None else back(points)
    return View(_seen(model, back), names, synchronised, labels, model, given)


def _seen(model, through):
    """A model in features that are linear in its own, of the performances that it keeps."""
    # About the mean of all training performances, not of those that were kept.
    kept = model.mean_ + model.deviations_ - model.deviations_.mean(axis=0)
    return clone(model).fit(through(kept), groups=model.groups_)


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
