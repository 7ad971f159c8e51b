"""The synchronizer of a pipeline, and the trials and parameters that are routed to it."""

import inspect
from contextlib import contextmanager
from typing import NamedTuple

import numpy as np
from sklearn.compose import ColumnTransformer
from sklearn.pipeline import FeatureUnion, Pipeline
from sklearn.utils import get_tags
from sklearn.utils.validation import check_is_fitted

__all__ = [
    "MissingMetadata",
    "Routed",
    "accepted_params",
    "explain_missing",
    "find_classifier",
    "find_step",
    "find_synchronizer",
    "flat_steps",
    "index_of_pattern",
    "route_to_synchronizer",
    "steps_to_fit",
    "takes_gaps",
    "transform_through",
    "union_transformers",
    "with_frame_rate",
]


# Parameters of synchronizers that take key-frames.
_OF_KEYFRAMES = ("keyframes", "frame_rate")


class MissingMetadata(ValueError):
    """A synchronizer needs more than trials, such as key-frames.

    Parameters
    ----------
    reason : str
        What is missing, and why it is needed; the message goes on with the usage.
    name : str
        Of the parameter.
    usage : str, default="{name}=[...]"
        How to give the parameter to the function that was called.
    """

    def __init__(self, reason, name, usage="{name}=[...]"):
        super().__init__(reason, name, usage)

    def __str__(self):
        reason, name, usage = self.args
        return f"{reason}, {usage.format(name=name)}."


@contextmanager
def explain_missing(caller, hint=""):
    """Let a `MissingMetadata` state the usage of a caller with the arguments (estimator, X).

    Parameters
    ----------
    caller : str
        The function that the user called.
    hint : str, default=""
        Other ways to give the parameter.
    """
    try:
        yield
    except MissingMetadata as error:
        reason, name, _ = error.args
        usage = f"{caller}(estimator, X, {{name}}=[...]){hint}"
        raise MissingMetadata(reason, name, usage) from error


class Routed(NamedTuple):
    """A fitted synchronizer, and its input through the steps before.

    Attributes
    ----------
    before : Pipeline or None
        The steps before.
    synchronizer : estimator
    trials : sequence of ndarray (n_frames_i, n_features)
        Checked: the methods of the synchronizer take them without checking again.
    params : dict
        Other arguments of its ``match``, such as ``keyframes``.
    caller, hint : str
        As of `explain_missing`.
    """

    before: Pipeline | None
    synchronizer: object
    trials: tuple
    params: dict
    caller: str
    hint: str

    @property
    def takes_params(self):
        """Whether ``match`` takes more than trials."""
        return len(inspect.signature(self.synchronizer.match).parameters) > 1

    def match(self):
        """The trials matched to the pattern."""
        with explain_missing(self.caller, self.hint):
            return self.synchronizer.match(self.trials, **self.params)


def route_to_synchronizer(estimator, X, params, caller, *, kind=None, uses=("match",), hint=""):
    """The synchronizer of an estimator, and its input made of raw trials.

    Parameters
    ----------
    estimator : synchronizer, or Pipeline with one
    X : trials, as the estimator takes them
    params : dict
        Other arguments by name, of ``match`` and of ``transform`` of the steps before; each method
        is given those that it accepts. None is as not given.
    caller : str
        The function that the user called with (estimator, X), for messages.
    kind : class, default=None
        Of the synchronizer; by default any.
    uses : tuple of str, default=("match",)
        Methods of the synchronizer that the caller gives params to.
    hint : str, default=""
        Other ways to give params.

    Returns
    -------
    Routed

    Raises
    ------
    TypeError
        If no method accepts one of the params.
    """
    before, synchronizer = (
        find_synchronizer(estimator) if kind is None else find_step(estimator, kind)
    )
    check_is_fitted(synchronizer)
    also = [getattr(synchronizer, name) for name in uses]
    features = transform_through(before, X, params, caller, hint=hint, also=also)
    trials = synchronizer.check_trials(features)
    accepted = accepted_params(synchronizer.match, params)
    return Routed(before, synchronizer, trials, accepted, caller, hint)


def with_frame_rate(params, frame_rate):
    """Params of ``match``, by the frame rate that a caller needs for itself, too.

    With a frame rate key-frames are seconds, in every function as in ``match``.
    """
    if frame_rate is None or params.get("keyframes") is None:
        return params
    return params | {"frame_rate": frame_rate}


def transform_through(before, X, params, caller, *, hint="", also=()):
    """Trials after the steps of a pipeline, each given the params that it accepts.

    Parameters
    ----------
    before : Pipeline or None
    X, params, caller, hint : as for `route_to_synchronizer`
    also : list of callable, default=()
        Methods after the last step that are given params, too.

    Returns
    -------
    trials, as the last step gives them
    """
    methods = [] if before is None else [step.transform for step in flat_steps(before)]
    takers = [*methods, *also]
    accepted = {name for method in takers for name in accepted_params(method, params)}
    for name, value in params.items():
        if name not in accepted and value is not None:
            names = [f"{type(method.__self__).__name__}.{method.__name__}" for method in takers]
            raise TypeError(
                f"{caller} got {name!r}, which is no argument of its own, and is not taken by "
                f"{' or '.join(names) or 'a step before'}."
            )
    with explain_missing(caller, hint):
        for method in methods:
            X = method(X, **accepted_params(method, params))
    return X


def accepted_params(method, params):
    """Those params that a method accepts by name, without None.

    A synchronizer that was fitted without key-frames accepts none.
    """
    values = {name: value for name, value in params.items() if value is not None}
    owner = getattr(method, "__self__", None)
    if getattr(_unwrapped(owner), "keyframes_", owner) is None:
        values = {name: value for name, value in values.items() if name not in _OF_KEYFRAMES}
    if isinstance(owner, FeatureUnion):
        # By its signature it accepts any, and passes on those that its transformers accept.
        accepted_by_each = [
            accepted_params(each.transform, values) for each in union_transformers(owner)
        ]
        return {name: value for each in accepted_by_each for name, value in each.items()}
    # A wrapper of a synchronizer passes on those that the synchronizer accepts.
    method = getattr(_unwrapped(owner), method.__name__, method)
    # The first one is X.
    _, *accepted = inspect.signature(method).parameters.values()
    if any(parameter.kind is parameter.VAR_KEYWORD for parameter in accepted):
        return values
    names = {parameter.name for parameter in accepted}
    return {name: value for name, value in values.items() if name in names}


def find_step(estimator, kind):
    """The first step of a class, and the steps before; an estimator is its own only step.

    Parameters
    ----------
    estimator : estimator or Pipeline
        Nested pipelines are searched, the best estimators of searches, and the fitted estimators of
        detectors.
    kind : class

    Returns
    -------
    before : Pipeline or None
    step : estimator
    """
    return _find(estimator, lambda step: isinstance(step, kind), kind.__name__)


def find_synchronizer(estimator):
    """The same for a step with ``match`` and ``check_trials``."""

    def matches(step):
        return hasattr(step, "match") and hasattr(step, "check_trials")

    return _find(estimator, matches, "synchronizer")


def find_classifier(estimator):
    """The same for a classifier that has a model of each class; None if there is none."""
    return _search(estimator, lambda step: hasattr(step, "model_of"))


def flat_steps(estimator):
    """The steps of a pipeline and of nested ones, in order; an estimator is its own only step.

    Steps that pass everything through are left out.
    """
    estimator = _fitted_estimator(estimator)
    if not isinstance(estimator, Pipeline):
        return [estimator]
    return [inner for _, step in _named_steps(estimator) for inner in flat_steps(step)]


def union_transformers(step):
    """The transformers of a union, and of nested ones; any other step is its own only one."""
    if not isinstance(step, FeatureUnion):
        return [step]
    views = [view for _, view in step.transformer_list if view not in ("drop", "passthrough")]
    return [
        each for view in views for inner in flat_steps(view) for each in union_transformers(inner)
    ]


def steps_to_fit(estimator, prefix=""):
    """The steps of an estimator before its fit, each with the prefix of its fit params.

    Parameters
    ----------
    estimator : estimator, Pipeline or search
        Of a search the estimator that it tunes.
    prefix : str, default=""
        The prefix of the estimator itself.

    Returns
    -------
    list of (str, estimator)
    """
    if isinstance(estimator, Pipeline):
        steps = _named_steps(estimator)
        return [each for name, step in steps for each in steps_to_fit(step, f"{prefix}{name}__")]
    inner = getattr(estimator, "estimator", None)
    return [(prefix, estimator)] if inner is None else steps_to_fit(inner, prefix)


def index_of_pattern(synchronizer, trials):
    """The index of the pattern among checked trials; None if it is not one of them."""
    index = synchronizer.pattern_index_
    if index is None or index >= len(trials):
        return None
    pattern = synchronizer.normalize(trials.take([index]))[0]
    # The gaps of the pattern are filled.
    same = (pattern == synchronizer.pattern_) | np.isnan(pattern)
    return index if same.all() else None


def _named_steps(pipeline):
    return [(name, step) for name, step in pipeline.steps if step not in (None, "passthrough")]


def _fitted_estimator(estimator):
    """The best estimator of a search, the fitted one of a detector; else the estimator itself."""
    for name in ("best_estimator_", "estimator_"):
        estimator = getattr(estimator, name, estimator)
    return estimator


def _unwrapped(step):
    """The synchronizer within a wrapper such as `TimingChannel`, fitted if that is; or the step."""
    return getattr(step, "synchronizer_", getattr(step, "synchronizer", step))


def _find(estimator, fits, name):
    located = _search(estimator, fits)
    if located is None:
        estimator = _fitted_estimator(estimator)
        names = [type(step).__name__ for step in flat_steps(estimator)]
        raise ValueError(
            f"There is no {name} in {type(estimator).__name__}; its steps are {names}."
        )
    return located


def _search(estimator, fits):
    """The steps before the first one that fits, and that one; None if there is none."""
    estimator = _fitted_estimator(estimator)
    if not isinstance(estimator, Pipeline):
        return next(
            ((None, step) for step in (_unwrapped(estimator), estimator) if fits(step)), None
        )
    for i, (name, step) in enumerate(estimator.steps):
        located = _search(step, fits)
        if located is not None:
            inner, fitting = located
            before = estimator.steps[:i] + ([] if inner is None else [(name, inner)])
            return (Pipeline(before) if before else None), fitting
    return None


def takes_gaps(transformer):
    """Whether a transformer accepts NaN, or passes its input on without a check."""
    if isinstance(transformer, Pipeline):
        steps = [step for _, step in transformer.steps if step not in (None, "passthrough")]
        return bool(steps) and takes_gaps(steps[0])
    if isinstance(transformer, FeatureUnion):
        transformers = [each for _, each in transformer.transformer_list if each != "drop"]
        return all(each == "passthrough" or takes_gaps(each) for each in transformers)
    if not hasattr(transformer, "__sklearn_tags__"):
        return False
    tags = get_tags(transformer)
    unchecked = tags.no_validation or isinstance(transformer, ColumnTransformer)
    return tags.input_tags.allow_nan or unchecked
