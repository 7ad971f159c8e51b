"""Where the synchronizer of a pipeline is, and what reaches it: performances, and key-frames."""

import inspect
from contextlib import contextmanager
from typing import NamedTuple

from sklearn.pipeline import FeatureUnion, Pipeline
from sklearn.utils.validation import check_is_fitted

__all__ = [
    "MissingMetadata",
    "Reached",
    "asking",
    "find_classifier",
    "find_step",
    "find_synchronizer",
    "flat_steps",
    "how_to_give",
    "index_of_pattern",
    "parts_of",
    "reach_synchronizer",
    "steps_to_fit",
    "taken_by",
    "transform_through",
]


class MissingMetadata(ValueError):
    """A synchronizer was not given what it needs besides performances.

    Parameters
    ----------
    reason : str
        What is missing, and why it is needed; it goes on with how to give it.
    name : str
        Of the parameter.
    how : str, default="{name}=[...]"
        How to give it to the function that was called.
    """

    def __init__(self, reason, name, how="{name}=[...]"):
        super().__init__(reason, name, how)

    def __str__(self):
        reason, name, how = self.args
        return f"{reason}, {how.format(name=name)}."


class Reached(NamedTuple):
    """A fitted synchronizer, and what reaches it through the steps before.

    Attributes
    ----------
    before : Pipeline or None
        The steps before.
    synchronizer : estimator
    performances : sequence of ndarray (n_frames_i, n_features)
        Checked: the methods of the synchronizer take them without checking again.
    params : dict
        What else its ``match`` was given, such as ``keyframes``.
    how : str
        How to give that to the function that was called.
    """

    before: Pipeline | None
    synchronizer: object
    performances: tuple
    params: dict
    how: str

    @property
    def takes_params(self):
        """Whether its ``match`` takes more than performances."""
        return len(inspect.signature(self.synchronizer.match).parameters) > 1

    def match(self):
        """The performances matched to the pattern."""
        with asking(self.how):
            return self.synchronizer.match(self.performances, **self.params)


def find_step(estimator, kind):
    """The steps before the first one of a kind, and that one; an estimator is its own only step.

    Parameters
    ----------
    estimator : estimator or Pipeline
        Pipelines within pipelines are searched, the best estimators of searches, and what detectors
        have fitted.
    kind : class

    Returns
    -------
    before : Pipeline or None
    step : estimator
    """
    return _first(estimator, lambda step: isinstance(step, kind), kind.__name__)


def find_synchronizer(estimator):
    """The same for whatever matches performances."""

    def matches(step):
        return hasattr(step, "match") and hasattr(step, "check_performances")

    return _first(estimator, matches, "synchronizer")


def find_classifier(estimator):
    """The same for a classifier that has a model of each class; None if there is none."""
    return _search(estimator, lambda step: hasattr(step, "model_of"))


def reach_synchronizer(estimator, X, params, caller, *, kind=None, uses=("match",), hint=""):
    """The synchronizer of an estimator, and what reaches it of raw performances.

    Parameters
    ----------
    estimator : synchronizer, or Pipeline with one
    X : performances, as the estimator takes them
    params : dict
        What is given besides, by name: to ``match``, and to ``transform`` of the steps before,
        whichever takes it. None is nothing given.
    caller : str
        Whom the user has called with (estimator, X), for messages.
    kind : class, default=None
        Of the synchronizer; by default any.
    uses : tuple of str, default=("match",)
        Methods of the synchronizer that the caller gives params to.
    hint : str, default=""
        Other ways to give params.

    Returns
    -------
    Reached

    Raises
    ------
    TypeError
        If nobody takes what was given.
    """
    found = find_synchronizer(estimator) if kind is None else find_step(estimator, kind)
    before, synchronizer = found
    check_is_fitted(synchronizer)
    also = [getattr(synchronizer, name) for name in uses]
    features = transform_through(before, X, params, caller, hint=hint, also=also)
    performances = synchronizer.check_performances(features)
    taken = taken_by(synchronizer.match, params)
    return Reached(before, synchronizer, performances, taken, how_to_give(caller, hint))


def transform_through(before, X, params, caller, *, hint="", also=()):
    """Performances after the steps of a pipeline, each given what its ``transform`` takes.

    Parameters
    ----------
    before : Pipeline or None
    X, params, caller, hint : as for `reach_synchronizer`
    also : list of callable, default=()
        Who else takes params, after the last step.

    Returns
    -------
    performances, as the last step gives them
    """
    methods = [] if before is None else [step.transform for step in flat_steps(before)]
    takers = [*methods, *also]
    unknown = set(params).difference(*(taken_by(method, params) for method in takers))
    for name in params:
        if name in unknown and params[name] is not None:
            names = [_name_of(method) for method in takers]
            raise TypeError(
                f"{caller} got {name!r}, which is no argument of its own, and is not taken by "
                f"{' or '.join(names) or 'a step before'}."
            )
    with asking(how_to_give(caller, hint)):
        for method in methods:
            X = method(X, **taken_by(method, params))
    return X


def taken_by(method, params):
    """Those params that a method takes by name, or all if it takes any; None is not given."""
    given = {name: value for name, value in params.items() if value is not None}
    owner = getattr(method, "__self__", None)
    if isinstance(owner, FeatureUnion):
        # It takes anything by its signature, and hands on what its transformers take.
        parts = [taken_by(part.transform, given) for part in parts_of(owner)]
        return {name: value for part in parts for name, value in part.items()}
    # Who only adds to what a synchronizer gives hands on what that takes.
    method = getattr(_inside(owner), method.__name__, method)
    accepted = list(inspect.signature(method).parameters.values())
    if any(parameter.kind is parameter.VAR_KEYWORD for parameter in accepted):
        return given
    # The first one is X.
    names = {parameter.name for parameter in accepted[1:]}
    return {name: value for name, value in given.items() if name in names}


def flat_steps(estimator):
    """The steps of a pipeline and of those within it, in order; an estimator is its own only one.

    Steps that pass everything through are left out.
    """
    estimator = _what_was_fitted(estimator)
    if not isinstance(estimator, Pipeline):
        return [estimator]
    steps = [step for _, step in estimator.steps if step is not None and step != "passthrough"]
    return [inner for step in steps for inner in flat_steps(step)]


def parts_of(step):
    """The transformers that a union puts side by side; any other step is its own only one."""
    if not isinstance(step, FeatureUnion):
        return [step]
    views = [view for _, view in step.transformer_list if view not in ("drop", "passthrough")]
    return [part for view in views for inner in flat_steps(view) for part in parts_of(inner)]


def steps_to_fit(estimator, prefix=""):
    """The same before a fit, each with what the names of its params begin with in that fit.

    Searches are looked into, not fitted.

    Parameters
    ----------
    estimator : estimator, Pipeline or search
    prefix : str, default=""
        What the names of its own params begin with.

    Returns
    -------
    list of (str, estimator)
    """
    if isinstance(estimator, Pipeline):
        steps = [(name, s) for name, s in estimator.steps if s is not None and s != "passthrough"]
        return [found for name, step in steps for found in steps_to_fit(step, f"{prefix}{name}__")]
    inner = getattr(estimator, "estimator", None)
    return [(prefix, estimator)] if inner is None else steps_to_fit(inner, prefix)


def index_of_pattern(synchronizer, performances):
    """The index of the pattern among checked performances; None if it is not one of them."""
    index = synchronizer.pattern_index_
    if index is None or index >= len(performances):
        return None
    same = synchronizer.normalize(performances.take([index]))[0]
    return index if (same == synchronizer.pattern_).all() else None


def how_to_give(caller, hint=""):
    """How to give what is missing to a function that is called with (estimator, X)."""
    return f"{caller}(estimator, X, {{name}}=[...]){hint}"


@contextmanager
def asking(how):
    """Whoever misses something in here says how to give it to the function that was called."""
    try:
        yield
    except MissingMetadata as error:
        reason, name, _ = error.args
        raise MissingMetadata(reason, name, how) from error


# -- helpers ------------------------------------------------------------------------------


def _what_was_fitted(estimator):
    """What a search found best, or what a detector has fitted; else the estimator itself."""
    for name in ("best_estimator_", "estimator_"):
        estimator = getattr(estimator, name, estimator)
    return estimator


def _inside(step):
    """The synchronizer within a step that adds to what it gives, fitted if that is; or the step."""
    return getattr(step, "synchronizer_", getattr(step, "synchronizer", step))


def _first(estimator, fits, name):
    found = _search(estimator, fits)
    if found is None:
        # What a search found.
        estimator = _what_was_fitted(estimator)
        names = [type(step).__name__ for step in flat_steps(estimator)]
        raise ValueError(
            f"There is no {name} in {type(estimator).__name__}; its steps are {names}."
        )
    return found


def _search(estimator, fits):
    """The steps before the first one that fits, and that one; None if there is none."""
    estimator = _what_was_fitted(estimator)
    if not isinstance(estimator, Pipeline):
        return next(((None, step) for step in (_inside(estimator), estimator) if fits(step)), None)
    for i, (name, step) in enumerate(estimator.steps):
        found = _search(step, fits)
        if found is not None:
            inner, fitting = found
            before = estimator.steps[:i] + ([] if inner is None else [(name, inner)])
            return (Pipeline(before) if before else None), fitting
    return None


def _name_of(method):
    return f"{type(method.__self__).__name__}.{method.__name__}"
