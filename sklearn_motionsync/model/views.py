"""A model seen in the features that are asked for: its own, or those of postures."""

from typing import NamedTuple

import numpy as np
from sklearn.base import clone
from sklearn.pipeline import Pipeline
from sklearn.utils.validation import check_is_fitted

from ..aspace import ASpace
from ..features import as_features, names_of
from ..performances import check_performances
from ..pipelines import find_step, flat_steps, taken_by, transform_through
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
            return (self.whole - self.model.mean_) / self._predicted

    @property
    def band(self):
        """Lower and upper bounds that hold a share of whole performances of new people."""
        reach = self.model.simultaneous_factor() * self._predicted
        return self.model.mean_ - reach, self.model.mean_ + reach

    @property
    def _predicted(self):
        return np.sqrt(self.model.predictive_variance_ + self.left_out)

    def only(self, chosen):
        """The same in some of the features, by index."""
        if list(chosen) == list(range(len(self.names))):
            return self

        def some(values):
            return None if values is None else values[..., chosen]

        return self._replace(
            model=_seen(self.model, some),
            names=[self.names[i] for i in chosen],
            synchronised=some(self.synchronised),
            whole=some(self.whole),
            left_out=some(self.left_out),
        )


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
    way = None
    if before is not None and (asked or postures):
        way = _way_back(before, names, must=asked)
    if way is None:
        nothing = np.zeros(len(names))
        return View(model, names, points, points, labels, model, given, nothing)
    names = names_of(way.before, way.aspace, way.aspace.n_features_in_)
    synchronised = whole = None
    if X is not None:
        synchronised = way.back(points)
        whole = synchronised + way.residuals(X, params or {}, caller)
    left_out = _NEWCOMER * way.aspace.left_out_variance_
    seen = _seen(model, way.back)
    return View(seen, names, synchronised, whole, labels, model, given, left_out)


def _seen(model, through):
    """A model in features that are linear in its own, of the performances that it keeps."""
    # About the mean of all training performances, not of those that were kept.
    kept = model.mean_ + model.deviations_ - model.deviations_.mean(axis=0)
    return clone(model).fit(through(kept), groups=model.groups_)


class _Way(NamedTuple):
    """The aSpace of a pipeline, the steps before it, and the synchronizers after it."""

    before: Pipeline | None
    aspace: ASpace
    after: list

    def back(self, points):
        """Postures of points of the aSpace."""
        return points @ self.aspace.components_ + self.aspace.mean_

    def residuals(self, X, params, caller):
        """What the aSpace leaves out of performances, on the clock: (n, P, n_features)."""
        postures = transform_through(self.before, X, params, caller, also=self._takers())
        arrays = check_performances(self.aspace, postures, reset=False, level="posture")
        seen = [(x - self.aspace.mean_) @ self.aspace.components_.T for x in arrays]
        left = [x - self.back(p) for x, p in zip(arrays, seen, strict=True)]
        points = self.aspace.transform(postures)
        for step in self.after:
            left = step.match(points, **taken_by(step.match, params)).warp(left)
            points = step.transform(points, **taken_by(step.transform, params))
        return np.asarray(left)

    def _takers(self):
        methods = [(step.match, step.transform) for step in self.after]
        return [method for pair in methods for method in pair]


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
            f"Between ASpace and ActionModel stands {strange[0]}: the model cannot be taken back "
            f"to postures. Choose features of the model: {', '.join(names)}."
        )
    return None if strange else _Way(before_aspace, aspace, after)
