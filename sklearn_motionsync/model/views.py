"""A model seen in the features that are asked for: its own, or those of postures."""

from typing import NamedTuple

import numpy as np
from sklearn.base import clone
from sklearn.pipeline import Pipeline
from sklearn.utils.validation import check_is_fitted

from ..inputs.collections import as_collection
from ..inputs.features import as_features, names_of
from ..inputs.validation import check_performances, labels_as_given
from ..transformers.aspace import ASpace
from ..utils.pipelines import (
    asking,
    find_step,
    flat_steps,
    how_to_give,
    taken_by,
    transform_through,
)
from .action_model import ActionModel

__all__ = ["View", "view_of"]

# What an aSpace leaves out of a new person at a frame, in units of what it leaves out of the
# training postures on average: with this 93 and 94 % of actors held out depart rarely nowhere
# (HDM05, UTKinect; nominal 95 %), with 1 it was 80 and 84 %.
_NEWCOMER = 4


class View(NamedTuple):
    """A model in some features, and what reaches it.

    Attributes
    ----------
    model : ActionModel
        Fitted.
    names : list of str
        Its features.
    synchronised : ndarray (n_sequences, P, n_features) or None
        Performances in these features, as the model sees them.
    whole : ndarray (n_sequences, P, n_features) or None
        The same with what an aSpace leaves out.
    labels : list
        Of these performances.
    own : ActionModel
        The model of the estimator, in its own features.
    given : sequence of ndarray (P, n_own_features) or None
        Performances in those, checked: the methods of that model take them as they are.
    left_out : ndarray (n_features,)
        Variance to be expected of a new person that the model knows nothing of, as its aSpace
        leaves it out.
    """

    model: ActionModel
    names: list
    synchronised: np.ndarray | None
    whole: np.ndarray | None
    labels: list
    own: ActionModel
    given: tuple | None
    left_out: np.ndarray

    @property
    def scores(self):
        """How far the whole performances are from the mean, in predicted standard deviations."""
        with np.errstate(over="ignore"):
            return (self.whole - self.model.mean_) / self.predicted

    @property
    def predicted(self):
        """The standard deviations to be expected of whole performances of a new person."""
        return np.sqrt(self.model.predictive_variance_ + self.left_out)


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
    check_is_fitted(model, "threshold_")
    names, params = names_of(before, model, model.mean_.shape[1]), params or {}
    asked = any(isinstance(f, str) and f not in names for f in as_features(features))
    way = None
    if before is not None and (asked or postures):
        way = _way_back(before, names, must=asked)
    given, points, whole, labels = None, None, None, []
    if X is not None:
        if way is None:
            given = model.check_performances(transform_through(before, X, params, caller))
        else:
            synchronised, whole = way.follow(X, params, caller)
            given = model.check_performances(synchronised)
        points, labels = np.stack(given), labels_as_given(X, given)[0]
    if way is None:
        nothing = np.zeros(len(names))
        return View(model, names, points, points, labels, model, given, nothing)
    beside = names[len(way.aspace.components_) :]
    names = [*names_of(way.before, way.aspace, way.aspace.n_features_in_), *beside]
    seen = None if points is None else way.back(points)
    left_out = np.append(_NEWCOMER * way.aspace.left_out_variance_, np.zeros(len(beside)))
    return View(_seen(model, way.back), names, seen, whole, labels, model, given, left_out)


def _seen(model, through):
    """A model in features that are linear in its own, of the performances that it keeps."""
    # About the mean of all training performances, not of those that were kept.
    kept = model.mean_ + model.deviations_ - model.deviations_.mean(axis=0)
    return clone(model).fit(through(kept), groups=model.groups_)


class _Way(NamedTuple):
    """The aSpace of a pipeline, the steps before it, and the synchronizers after it.

    What these put beside the points of the aSpace, such as a `TimingChannel`, stays there.
    """

    before: Pipeline | None
    aspace: ASpace
    after: list

    def back(self, points):
        """Postures of points of the aSpace."""
        components, mean = self.aspace.components_, self.aspace.mean_
        points, beside = np.split(points, [len(components)], axis=2)
        return np.concatenate([points @ components + mean, beside], axis=2)

    def follow(self, X, params, caller):
        """What reaches the model, and the postures of it, whole, on the same clock."""
        takers = [method for step in self.after for method in (step.match, step.transform)]
        postures = transform_through(self.before, X, params, caller, also=takers)
        whole = check_performances(self.aspace, postures, reset=False, level="posture")
        points = self.aspace.transform(postures)
        with asking(how_to_give(caller)):
            for step in self.after:
                whole = step.match(points, **taken_by(step.match, params)).warp(whole)
                points = step.transform(points, **taken_by(step.transform, params))
        beside = np.stack(as_collection(points))[:, :, len(self.aspace.components_) :]
        return points, np.concatenate([np.stack(whole), beside], axis=2)


def _way_back(before, names, must):
    """The way from a model back to postures; None if there is none and need be none."""
    try:
        before_aspace, aspace = find_step(before, ASpace)
    except ValueError:
        if must:
            raise
        return None
    steps = flat_steps(before)
    after = steps[steps.index(aspace) + 1 :]
    strange = [step for step in after if not hasattr(step, "match")]
    if strange and must:
        raise ValueError(
            f"Between ASpace and ActionModel stands {strange[0]}, which has no inverse: choose "
            f"features of the model, {', '.join(names)}."
        )
    return None if strange else _Way(before_aspace, aspace, after)
