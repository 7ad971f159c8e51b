"""The models inside fitted estimators: in chosen features, in limbs, and of each class."""

from typing import NamedTuple

import numpy as np
from sklearn.base import clone
from sklearn.pipeline import FeatureUnion, Pipeline
from sklearn.utils.validation import check_is_fitted

from ..body.axes import convert_to_parent_axes
from ..body.direction_cosines import DirectionCosines
from ..body.limbs import LIMB_NAMES, limb_indices, unit_vectors
from ..inputs.collections import Trials, as_collection
from ..inputs.features import as_features, names_of_features
from ..inputs.validation import check_trials, labels_of_input, names_of_input
from ..matching.counting import first_largest
from ..synchronizers.dense import DenseSynchronizer
from ..synchronizers.linear import LinearSynchronizer
from ..synchronizers.match import Match
from ..transformers.aspace import ASpace
from ..utils.pipelines import (
    accepted_params,
    explain_missing,
    find_classifier,
    find_step,
    find_synchronizer,
    flat_steps,
    transform_through,
    union_transformers,
)
from .action_model import ActionModel

__all__ = [
    "ClassModel",
    "Curves",
    "LimbColumns",
    "View",
    "curves_of",
    "limbs_of",
    "models_of_classes",
    "view_of",
]

# Residual variance of a new person at a frame, in units of the mean residual variance of the
# training poses after the aSpace: with this 93 and 94 % of held-out actors have no rare
# departure (HDM05, UTKinect; nominal 95 %), with 1 it was 80 and 84 %.
_RESIDUAL_FACTOR = 4


class Curves(NamedTuple):
    """Trials on the clock of a model, each matched once.

    Attributes
    ----------
    names : list of str
        The features of ``whole``.
    whole : ndarray (n_sequences, P, n_features)
        The poses before an aSpace, if there is one; otherwise the features of the model.
    points : trials
        In the features of the model, checked.
    match : Match or None
        By the first synchronizer; None without one.
    """

    names: list
    whole: np.ndarray
    points: Trials
    match: Match | None


def curves_of(estimator, X, params, caller):
    """Trials on the clock of the model of an estimator, with what an aSpace leaves out.

    Parameters
    ----------
    estimator : ActionModel, or Pipeline with one
        Fitted.
    X : trials, as the estimator takes them
    params : dict
        What synchronizing X takes besides, such as ``keyframes``.
    caller : str
        The public function that the user called with (estimator, X), for messages.

    Returns
    -------
    Curves
    """
    before, model = find_step(estimator, ActionModel)
    names = names_of_features(before, model, model.mean_.shape[1])
    route = _Route.without_aspace(None) if before is None else _Route.to(before, names)
    return route.curves(model, X, params, caller, names)


class View(NamedTuple):
    """A model in chosen features, and the trials that reach it.

    Attributes
    ----------
    model : ActionModel
        Fitted.
    names : list of str
        Its features.
    synchronised : ndarray (n_sequences, P, n_features) or None
        Trials in these features.
    whole : ndarray (n_sequences, P, n_features) or None
        The same with the residuals of an aSpace.
    labels : list
        Of these trials.
    curves : Curves or None
        The same trials as they reach the model of the estimator.
    model_of_points : ActionModel
        That model.
    residual_variance : ndarray (n_features,)
        Variance of a new person outside the aSpace.
    in_linear_time : ndarray (n_examples, P, n_known) or None
        Training trials before synchronisation, linearly normalised, in the first of these
        features, as many as the synchronizer takes. None without a synchronizer that keeps some.
    """

    model: ActionModel
    names: list
    synchronised: np.ndarray | None
    whole: np.ndarray | None
    labels: list
    curves: Curves | None
    model_of_points: ActionModel
    residual_variance: np.ndarray
    in_linear_time: np.ndarray | None

    @property
    def training(self):
        """Training trials that are kept, about the mean of all: (n_kept, P, n_features)."""
        return _training_of(self.model)

    @property
    def predicted(self):
        """Predicted standard deviations of whole trials of a new person."""
        return np.sqrt(self.model.predictive_variance_ + self.residual_variance)


def view_of(estimator, X=None, params=None, caller="", *, features=None, poses=False):
    """The model of an estimator in chosen features: its own, or those of poses.

    Parameters
    ----------
    estimator, X, params, caller : as for `curves_of`, default=None
        Without X there is the model alone.
    features : int, str or list of them, default=None
        If one of them is no feature of the model, the model is transformed back to the poses
        before its `ASpace`, by a fit on its training trials there, at most 64.
    poses : bool, default=False
        Whether to do so whenever there is such an aSpace.

    Returns
    -------
    View

    Raises
    ------
    ValueError
        If a step between them has no inverse.
    """
    before, model = find_step(estimator, ActionModel)
    check_is_fitted(model, "threshold_")
    names = names_of_features(before, model, model.mean_.shape[1])
    is_needed = any(isinstance(f, str) and f not in names for f in as_features(features))
    route = _Route.without_aspace(before)
    if before is not None and (is_needed or poses):
        route = _Route.to(before, names, is_needed)
    curves, points, labels = None, None, []
    if X is not None:
        curves = route.curves(model, X, params or {}, caller, names)
        points, labels = np.stack(curves.points), labels_of_input(X, curves.points)[0]
    linear = _examples(before, route, len(names))
    if route.aspace is None:
        variance = np.zeros(len(names))
        return View(model, names, points, points, labels, curves, model, variance, linear)
    variance = _RESIDUAL_FACTOR * route.aspace.left_out_variance_
    names = route.names(names)
    variance = np.append(variance, np.zeros(len(names) - len(variance)))
    back = clone(model).fit(route.transform(_training_of(model)), groups=model.groups_)
    synchronised, whole = (None, None) if X is None else (route.transform(points), curves.whole)
    return View(back, names, synchronised, whole, labels, curves, model, variance, linear)


def _training_of(model):
    """Training trials that a model kept, about the mean of all, not of these."""
    deviations = model.deviations_
    return model.mean_ + deviations - deviations.mean(axis=0)


def _examples(before, route, n_features):
    """Training trials in linear time, in features of the model or in poses; or None."""
    try:
        synchronizer = find_synchronizer(before)[1] if before is not None else None
    except ValueError:
        return None
    inner = getattr(synchronizer, "synchronizer_", synchronizer)
    examples = getattr(synchronizer, "examples_", getattr(inner, "examples_", None))
    if examples is None:
        return None
    if route.aspace is None:
        steps = flat_steps(before)
        return examples if steps[-1] is synchronizer and examples.shape[2] <= n_features else None
    fits = examples.shape[2] == len(route.aspace.components_)
    return route.transform(examples) if fits else None


class _Route(NamedTuple):
    """The steps to a model: those before an aSpace or a synchronizer, the aSpace, and the others.

    Without an aSpace there is no way back from the model. Features that synchronizers append to
    the points of an aSpace, such as a `TimingChannel`, are kept on the way.
    """

    before: Pipeline | None
    aspace: ASpace | None
    after: list

    @classmethod
    def to(cls, before, names, is_needed=False):
        """The route to a model of these features, by way of an aSpace if there is one.

        One that is needed must have a way back: synchronizers alone stand behind it.
        """
        try:
            before_aspace, aspace = find_step(before, ASpace)
        except ValueError:
            if is_needed:
                raise
            return cls.without_aspace(before)
        steps = flat_steps(before)
        after = steps[steps.index(aspace) + 1 :]
        without_match = [step for step in after if not hasattr(step, "match")]
        if without_match and is_needed:
            raise ValueError(
                f"Between ASpace and ActionModel stands {without_match[0]}, which has no inverse: "
                f"choose features of the model, {', '.join(names)}."
            )
        return cls.without_aspace(before) if without_match else cls(before_aspace, aspace, after)

    @classmethod
    def without_aspace(cls, before):
        """The route by which all that stands before the model is its own."""
        steps = [] if before is None else flat_steps(before)
        first = [k for k, step in enumerate(steps) if hasattr(step, "match")]
        count = first[0] if first else len(steps)
        named = [(f"step{k}", step) for k, step in enumerate(steps[:count])]
        return cls(Pipeline(named) if named else None, None, steps[count:])

    def names(self, names_of_model):
        """The features of poses, and those of the model beside the points of the aSpace."""
        aspace = self.aspace
        of_poses = names_of_features(self.before, aspace, aspace.n_features_in_)
        return [*of_poses, *names_of_model[len(aspace.components_) :]]

    def transform(self, points):
        """Poses of points of the aSpace."""
        components, mean = self.aspace.components_, self.aspace.mean_
        points, beside = np.split(points, [len(components)], axis=2)
        return np.concatenate([points @ components + mean, beside], axis=2)

    def curves(self, model, X, params, caller, names):
        """The `Curves` of trials."""
        methods = [(step, name) for step in self.after for name in ("match", "transform")]
        takers = [getattr(step, name) for step, name in methods if hasattr(step, name)]
        points = transform_through(self.before, X, params, caller, also=takers)
        whole, first = None, None
        if self.aspace is not None:
            whole = check_trials(self.aspace, points, reset=False, level="pose", finite="allow-nan")
            points = self.aspace.transform(points)
        # Names are those of tables, which a match does not make.
        once = names_of_input(model) is None
        with explain_missing(caller):
            for step in self.after:
                points, match = _through(step, points, params, once)
                whole = whole if whole is None or match is None else match.warp(whole)
                first = match if first is None else first
        checked = model.check_trials(points)
        if whole is None:
            return Curves(names, np.stack(checked), checked, first)
        beside = np.stack(as_collection(points))[:, :, len(self.aspace.components_) :]
        whole = np.concatenate([np.stack(whole), beside], axis=2)
        return Curves(self.names(names), whole, checked, first)


def _through(step, points, params, once):
    """Trials after a step, and their match if it makes one.

    Synchronizers that only warp match them once, where tables are not asked for.
    """
    match, accepted = None, accepted_params(step.transform, params)
    if hasattr(step, "match"):
        only_warps = isinstance(step, DenseSynchronizer | LinearSynchronizer)
        if once and only_warps and type(points) in (list, np.ndarray):
            points = step.check_trials(points)
        match = step.match(points, **accepted_params(step.match, params))
        if isinstance(points, Trials) and points.kind != "rows":
            return match.warp(points), match
    return step.transform(points, **accepted), match


# -- limbs -----------------------------------------------------------------------------------


class LimbColumns(NamedTuple):
    """The direction cosines among the features of a view, and the way back to them.

    Attributes
    ----------
    cosines : DirectionCosines
    columns : slice
        The columns of the cosines.
    steps : list of transformer
        The steps between the cosines and the features, such as scalers.
    """

    cosines: DirectionCosines
    columns: slice
    steps: list

    def invert(self, features):
        """The cosines of features of the view, (n, 37)."""
        for step in reversed(self.steps):
            # Features that were appended later, such as a `TimingChannel`, are none of the step.
            width = getattr(step, "n_features_in_", features.shape[1])
            features = np.asarray(step.inverse_transform(features[:, :width]))
        return features[:, self.columns]

    def in_parent_axes(self, trials):
        """The height, if there is one, and the cosines along the axes of the parent limbs.

        Parameters
        ----------
        trials : ndarray (n, P, n_features)
            In features of the view, without gaps.

        Returns
        -------
        ndarray (n, P, n_cosines)
            Cosines of length 1.
        """
        skeleton = self.cosines.skeleton
        limbs, n_dims, first = skeleton.limbs, skeleton.n_dims, int(skeleton.has_height)
        n, n_frames, width = trials.shape
        columns = self.invert(trials.reshape(-1, width))
        vectors = columns[:, first:].reshape(len(columns), -1, n_dims)
        cosines = np.zeros((len(vectors), len(LIMB_NAMES), n_dims))
        cosines[:, limb_indices(limbs)] = unit_vectors(vectors)
        if self.cosines.reference != "parent":
            cosines = convert_to_parent_axes(cosines, limbs)
        vectors = cosines[:, limb_indices(limbs)].reshape(len(columns), -1)
        return np.column_stack([columns[:, :first], vectors]).reshape(n, n_frames, -1)


def limbs_of(before, names):
    """The limbs among the features of a view; None if they do not lead back to limbs.

    Parameters
    ----------
    before : Pipeline or None
        The steps before the synchronizer.
    names : list of str
        Features of the view.

    Returns
    -------
    LimbColumns or None
    """
    if before is None:
        return None
    steps = flat_steps(before)
    transformers = [each for step in steps for each in union_transformers(step)]
    cosines = [each for each in transformers if isinstance(each, DirectionCosines)]
    # With several of them the columns are ambiguous.
    columns = _columns_of(cosines[0], names) if len(cosines) == 1 else None
    places = [k for k, step in enumerate(steps) if cosines and _passes_on(step, cosines[0])]
    after = [step for step in steps[sum(places[:1]) + 1 :] if not isinstance(step, ASpace)]
    invertible = places and all(hasattr(step, "inverse_transform") for step in after)
    return LimbColumns(cosines[0], columns, after) if columns is not None and invertible else None


def _passes_on(step, cosines):
    """Whether a step, or a union, returns the features of cosines unchanged."""
    if not isinstance(step, FeatureUnion):
        return step is cosines
    views = [flat_steps(view) for _, view in step.transformer_list if not isinstance(view, str)]
    return any(_passes_on(inner[-1], cosines) for inner in views if inner)


def _columns_of(cosines, names):
    """The columns of the features of DirectionCosines, also in a union; None without them."""
    cosine_names = list(cosines.get_feature_names_out())
    for k, name in enumerate(names):
        prefix = name.removesuffix(cosine_names[0])
        if names[k : k + len(cosine_names)] == [f"{prefix}{x}" for x in cosine_names]:
            return slice(k, k + len(cosine_names))
    return None


# -- the models of a classifier ------------------------------------------------------------


class ClassModel(NamedTuple):
    """The model of a class, and the trials that are predicted to be of this class.

    Attributes
    ----------
    label : label of the class
    estimator : Pipeline
        Fitted: the steps before the classifier, and those of ``model_of(label)``.
    trials : trials, as the estimator takes them
    indices : ndarray of int
        Their indices among all.
    labels : list
        Their labels.
    """

    label: object
    estimator: Pipeline
    trials: object
    indices: np.ndarray
    labels: list


def models_of_classes(estimator, X, params, caller, only=None):
    """The models of the classes that a classifier predicts, before any rejection.

    Parameters
    ----------
    estimator : estimator or Pipeline
        Fitted.
    X : trials, as the estimator takes them
    params : dict
        What the steps before the classifier take besides.
    caller : str
        The public function that the user called with (estimator, X), for messages.
    only : callable, default=None
        Gives the index of a single trial, of their number; by default all.

    Returns
    -------
    list of ClassModel, or None
        None if there is no classifier that has models.
    """
    located = find_classifier(estimator)
    if located is None:
        return None
    before, classifier = located
    features = transform_through(before, X, params, caller)
    trials = classifier.check_trials(features)
    chosen = np.arange(len(trials))
    if only is not None:
        chosen = chosen[[only(len(trials))]]
    columns = first_largest(classifier.predict_proba(trials.take(chosen)), axis=1)
    collection, all_labels = as_collection(X), labels_of_input(X, trials)[0]
    steps, models = [] if before is None else before.steps, []
    for column in dict.fromkeys(columns.tolist()):
        indices, label = chosen[columns == column], classifier.classes_[column]
        if collection is not None:
            members = [collection[i] for i in indices]
        else:
            members = X.iloc[indices] if hasattr(X, "iloc") else np.asarray(X)[indices]
        pipe = Pipeline([*steps, *classifier.model_of(label).steps])
        models.append(ClassModel(label, pipe, members, indices, [all_labels[i] for i in indices]))
    return models
