"""The models inside fitted estimators: in chosen features, and in limbs."""

from types import MappingProxyType
from typing import NamedTuple

import numpy as np
from sklearn.base import clone
from sklearn.pipeline import FeatureUnion, make_pipeline
from sklearn.utils.validation import check_is_fitted

from ..body.axes import convert_to_parent_axes
from ..body.direction_cosines import DirectionCosines
from ..body.limbs import LIMB_NAMES, limb_indices, unit_vectors
from ..inputs.collections import Trials, as_collection
from ..inputs.features import as_features, names_of_features
from ..inputs.trial_facts import TrialFacts
from ..inputs.validation import check_input
from ..synchronizers.match import Match
from ..transformers.aspace import ASpace
from ..utils.pipelines import (
    Routed,
    accepted_params,
    find_step,
    find_synchronizer,
    flat_steps,
    refuse_params,
    remembered_matches,
    union_transformers,
)
from .action_model import ActionModel

# Residual variance of a new person at a frame, in units of the mean residual variance of the
# training poses after the aSpace: with this 93 and 94 % of held-out actors have no rare
# departure (HDM05, UTKinect; nominal 95 %), with 1 it was 80 and 84 %.
_RESIDUAL_FACTOR = 4


class Curves(NamedTuple):
    """Trials on the clock of a model, each matched once.

    Attributes
    ----------
    whole : ndarray (n_sequences, P, n_features)
        The poses before an aSpace, if there is one; otherwise the features of the model.
    points : trials
        In the features of the model, checked.
    match : Match or None
        By the first synchronizer; None without one.
    facts : TrialFacts
        Of the trials as they were recorded.
    route : _Route
        The steps to the model.
    known : dict
        The match of each synchronizer, as `matches_of_a_fit` gives it.
    """

    whole: np.ndarray
    points: Trials
    match: Match | None
    facts: TrialFacts
    route: object
    known: dict

    @property
    def names(self):
        """The features of ``whole``."""
        return self.route.names_of_poses()


def curves_of(estimator, X, params, caller, known=None):
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
    known : dict, default=None
        As `matches_of_a_fit` gives it, which is what is known by default.

    Returns
    -------
    Curves
    """
    before, model = find_step(estimator, ActionModel)
    known = remembered_matches() if known is None else known
    return _Route.to(before, model).curves(X, params, caller, known)


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
    route : _Route
        The steps to that model.
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
    route: object

    def of(self, X, params, caller):
        """The same with trials, as for `curves_of`."""
        curves = self.route.curves(X, params, caller)
        points, labels = np.stack(curves.points), curves.facts.labels
        synchronised = self.route.transform(points)
        whole = points if self.route.aspace is None else curves.whole
        return self._replace(synchronised=synchronised, whole=whole, labels=labels, curves=curves)

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
    route = _Route.without_aspace(before, model)
    names = route.names()
    is_needed = any(isinstance(f, str) and f not in names for f in as_features(features))
    if before is not None and (is_needed or poses):
        route = _Route.to(before, model, is_needed)
    linear = _examples(before, route, len(names))
    back, variance = model, np.zeros(len(names))
    if route.aspace is not None:
        names = route.names_of_poses()
        beside = len(names) - len(route.aspace.left_out_variance_)
        variance = np.append(_RESIDUAL_FACTOR * route.aspace.left_out_variance_, np.zeros(beside))
        back = clone(model).fit(route.transform(_training_of(model)), groups=model.groups_)
    view = View(back, names, None, None, [], None, model, variance, linear, route)
    return view if X is None else view.of(X, params or {}, caller)


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

    before: list
    aspace: ASpace | None
    after: list
    model: ActionModel

    @classmethod
    def to(cls, before, model, is_needed=False):
        """The route to a model, by way of an aSpace if there is one.

        One that is needed must have a way back: synchronizers alone stand behind it.
        """
        whole = cls.without_aspace(before, model)
        spaces = [step for step in whole.before if isinstance(step, ASpace)]
        if not spaces:
            if is_needed:
                # The error names the steps.
                find_step(before, ASpace)
            return whole
        place = whole.before.index(spaces[0])
        after = whole.before[place + 1 :]
        without_match = [step for step in after if not hasattr(step, "match")]
        if without_match and is_needed:
            raise ValueError(
                f"Between ASpace and ActionModel stands {without_match[0]}, which has no inverse: "
                f"choose features of the model, {', '.join(whole.names())}."
            )
        return whole if without_match else cls(whole.before[:place], spaces[0], after, model)

    @classmethod
    def without_aspace(cls, before, model):
        """The route by which all that stands before the model is its own."""
        return cls([] if before is None else flat_steps(before), None, [], model)

    def names(self):
        """The features of the model."""
        steps = [*self.before, *([self.aspace] if self.aspace else []), *self.after]
        return _names(steps, self.model, self.model.mean_.shape[1])

    def names_of_poses(self):
        """The features of poses, and those of the model beside the points of the aSpace."""
        if self.aspace is None:
            return self.names()
        of_poses = _names(self.before, self.aspace, self.aspace.n_features_in_)
        return [*of_poses, *self.names()[len(self.aspace.components_) :]]

    def transform(self, points):
        """Poses of points of the aSpace; the points without one."""
        if self.aspace is None:
            return points
        components, mean = self.aspace.components_, self.aspace.mean_
        points, beside = np.split(points, [len(components)], axis=2)
        return np.concatenate([points @ components + mean, beside], axis=2)

    def curves(self, X, params, caller, known=MappingProxyType({})):
        """The `Curves` of trials, each matched once."""
        steps = [*self.before, *self.after]
        methods = [(step, name) for step in steps for name in ("match", "transform")]
        takers = [getattr(step, name) for step, name in methods if hasattr(step, name)]
        refuse_params(takers, params, caller)
        points, whole, matches, known = X, None, [], dict(known)
        for step in self.before:
            points = _through(step, points, params, matches, X, known)
        if self.aspace is not None:
            whole = check_input(self.aspace, points, reset=False, level="pose", finite="allow-nan")
            points = self.aspace.transform(points)
        for step in self.after:
            points = _through(step, points, params, matches, X, known)
            whole = whole if whole is None else matches[-1].warp(whole)
        checked, match = self.model.check_trials(points), matches[0] if matches else None
        rate = params.get("frame_rate")
        facts = TrialFacts.of(X, rate, checked=checked) if match is None else match.facts
        if whole is None:
            return Curves(np.stack(checked), checked, match, facts, self, known)
        beside = np.stack(as_collection(points))[:, :, len(self.aspace.components_) :]
        whole = np.concatenate([np.stack(whole), beside], axis=2)
        return Curves(whole, checked, match, facts, self, known)


def _names(steps, estimator, n_features):
    """The features that reach an estimator behind some steps."""
    return names_of_features(make_pipeline(*steps) if steps else None, estimator, n_features)


def _through(step, points, params, matches, X, known):
    """Trials X after a step; if it matches them, it warps them by this match, which is appended.

    What is matched here is known from then on.
    """
    if not hasattr(step, "match"):
        return step.transform(points, **accepted_params(step.transform, params))
    _, synchronizer = find_synchronizer(step)
    trials = synchronizer.check_trials(points)
    facts = TrialFacts.of(X, params.get("frame_rate"), checked=trials)
    accepted = accepted_params(synchronizer.match, params)
    _, match = known.get(id(synchronizer), (None, None))
    if match is None:
        match = synchronizer.match(facts.label(trials), **accepted)
        known[id(synchronizer)] = synchronizer, match
    # What is hidden by a confidence is hidden in the trials of the match.
    seen = trials if match.reached is None else match.reached.trials
    reached = Routed(None, synchronizer, seen, accepted, facts)
    matches.append(match.of_trials(facts, reached))
    if not hasattr(step, "transform_matched"):
        # One that is not derived from `Synchronizer` matches again.
        return step.transform(points, **accepted_params(step.transform, params))
    return step.transform_matched(seen, match, **accepted_params(step.transform_matched, params))


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
