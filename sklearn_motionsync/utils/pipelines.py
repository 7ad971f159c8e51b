"""The synchronizer of a pipeline, and the trials and parameters that are routed to it."""

import inspect
from contextlib import contextmanager
from contextvars import ContextVar
from copy import copy
from functools import lru_cache
from typing import NamedTuple

import numpy as np
import pandas as pd
from sklearn.compose import ColumnTransformer
from sklearn.pipeline import FeatureUnion, Pipeline, make_pipeline
from sklearn.utils import get_tags
from sklearn.utils.validation import check_is_fitted

from ..inputs.collections import Trials, as_collection, as_source
from ..inputs.keyframes import Keyframes
from ..inputs.resampling import as_frame_rates
from ..inputs.trial_facts import TrialFacts
from ..inputs.wording import counted

# Parameters of synchronizers that take key-frames.
_OF_KEYFRAMES = ("keyframes", "frame_rate")

# What is matched while a pipeline is fitted: by the id of each synchronizer, it and its match.
_matches: ContextVar[dict | None] = ContextVar("matches", default=None)


@contextmanager
def matches_of_a_fit(known=None):
    """Collect the matches of the synchronizers that are fitted in this context.

    The ``fit`` of scikit-learn's pipelines warps the training trials and hands on no match. What
    goes on with the same trials takes it from here and does not match them again. Those that are
    known already are given, and under ``"reference"`` those of a reference.
    """
    token = _matches.set({} if known is None else known)
    try:
        yield _matches.get()
    finally:
        _matches.reset(token)


def remembered_matches():
    """The matches of `matches_of_a_fit`; none outside of it."""
    return _matches.get() or {}


def remember_match(synchronizer, match):
    """Keep a match where `matches_of_a_fit` collects them; whether it does."""
    matches = _matches.get()
    if matches is not None and match is not None:
        matches[id(synchronizer)] = (synchronizer, match)
    return matches is not None


class Routed(NamedTuple):
    """A fitted synchronizer, and its input through the steps before.

    Attributes
    ----------
    before : Pipeline or None
        The steps before.
    synchronizer : estimator
    trials : Trials
        Checked: the methods of the synchronizer take them without checking again.
    params : dict
        Other arguments of its ``match``, such as ``keyframes``.
    facts : TrialFacts
        Of the trials as they were recorded.
    sums : ndarray, shape (n_sequences,), or None
        Of the values of the trials before the steps, which tell others of equal lengths; None
        where there are no steps.
    known : Match or None
        That of these trials, if they were matched before.
    """

    before: Pipeline | None
    synchronizer: object
    trials: Trials
    params: dict
    facts: TrialFacts
    sums: np.ndarray | None = None
    known: object = None

    @property
    def steps(self):
        """The steps before in order, and the synchronizer."""
        return [*([] if self.before is None else flat_steps(self.before)), self.synchronizer]

    @property
    def keyframes(self):
        """Key-frames that were given, as shares of the trials: a table by name, None without."""
        keyframes = self.params.get("keyframes")
        if keyframes is None:
            return None
        rows = Keyframes(keyframes, len(self.trials), self.params.get("frame_rate"))
        return pd.DataFrame(rows.shares(self.trials), columns=getattr(keyframes, "columns", None))

    def match(self):
        """The trials matched to the pattern."""
        if self.known is not None:
            return self.known
        match = self.synchronizer.match(self.trials, **self.params)
        if not hasattr(match, "of_trials"):
            # What a synchronizer gives in place of a match is refused where it is used.
            return match
        # Of this fit, also after another one.
        before = None if self.before is None else make_pipeline(*map(copy, self.steps[:-1]))
        fitted = self._replace(before=before, synchronizer=copy(self.synchronizer))
        return match.of_trials(self.facts, fitted)


def route_to_synchronizer(estimator, X, params, caller, *, kind=None, uses=("match",)):
    """The synchronizer of an estimator, and its input made of raw trials.

    Parameters
    ----------
    estimator : synchronizer, Pipeline with one, or Match of the same trials
    X : trials, as the estimator takes them
    params : dict
        Other arguments by name, of ``match`` and of ``transform`` of the steps before; each method
        is given those that it accepts. None is as not given. ``frame_rate`` is a fact of the
        trials, with which key-frames are seconds.
    caller : str
        The function that the user called with (estimator, X), for messages.
    kind : class, default=None
        Of the synchronizer; by default any.
    uses : tuple of str, default=("match",)
        Methods of the synchronizer that the caller gives params to.

    Returns
    -------
    Routed

    Raises
    ------
    TypeError
        If no method accepts one of the params.
    """
    if hasattr(estimator, "reached"):
        return _of_match(estimator, X, params, caller, kind)
    before, synchronizer = (
        find_synchronizer(estimator) if kind is None else find_step(estimator, kind)
    )
    check_is_fitted(synchronizer)
    also = [getattr(synchronizer, name) for name in uses]
    features = transform_through(before, X, params, caller, also=also)
    trials = synchronizer.check_trials(features)
    accepted = accepted_params(synchronizer.match, params)
    facts = TrialFacts.of(X, params.get("frame_rate"), checked=trials)
    trials, keyframes = facts.label(trials), accepted.get("keyframes")
    if isinstance(keyframes, pd.DataFrame):
        # In the order of the trials, whose labels are lost where a match is made again of parts.
        rows = Keyframes(keyframes, len(trials)).in_order(trials)
        accepted["keyframes"] = pd.DataFrame(rows, columns=keyframes.columns)
    sums = None if before is None else _sums_of(X, trials)
    return Routed(before, synchronizer, trials, accepted, facts, sums)


def _sums_of(X, trials):
    """The sum of the values of each trial, of checked ones where X is read once."""
    is_read = isinstance(X, Trials) or as_source(X) is not None
    sequences = trials if is_read else as_collection(X)
    sequences = np.asarray(X) if sequences is None else sequences
    return np.array([np.sum(np.asarray(x, dtype=np.float64)) for x in sequences])


def _of_match(match, X, params, caller, kind):
    """What reached the synchronizer that made a match of the trials X."""
    reached = match.reached
    if reached is None:
        raise ValueError(
            f"{caller} got a Match without the synchronizer and the trials that it was made of: "
            "one of given warps, of trials that were read in parts, or from a file. Give the "
            "estimator, or Match.from_estimator(estimator, X)."
        )
    if kind is not None and not isinstance(reached.synchronizer, kind):
        raise ValueError(
            f"{caller} needs a Match by a {kind.__name__}, and got one by a "
            f"{type(reached.synchronizer).__name__}."
        )
    beside = [k for k, value in params.items() if value is not None and k != "frame_rate"]
    if beside:
        raise TypeError(
            f"{caller} got {beside[0]!r} beside a Match, which was made with arguments of its own: "
            f"give {beside[0]} to match, or the estimator to {caller}."
        )
    sums = _sums_of(reached.trials, reached.trials) if reached.sums is None else reached.sums
    of_these = _sums_of(X, reached.trials)
    if len(of_these) != len(sums) or not np.allclose(of_these, sums, 1e-9, equal_nan=True):
        raise ValueError(
            f"{caller} got a Match of {counted(len(sums), 'trial')}, and X are other ones, or in "
            "another order. Give the X that were matched."
        )
    rate = params.get("frame_rate")
    facts = match.facts if rate is None else match.facts.at(rate)
    known = match.of_trials(facts, reached)
    return reached._replace(facts=facts, known=known)


def transform_through(before, X, params, caller, *, also=()):
    """Trials after the steps of a pipeline, each given the params that it accepts.

    Parameters
    ----------
    before : Pipeline or None
    X, params, caller : as for `route_to_synchronizer`
    also : list of callable, default=()
        Methods after the last step that are given params, too.

    Returns
    -------
    trials, as the last step gives them
    """
    methods = [] if before is None else [step.transform for step in flat_steps(before)]
    refuse_params([*methods, *also], params, caller)
    for method in methods:
        X = method(X, **accepted_params(method, params))
    return X


def refuse_params(takers, params, caller):
    """Refuse params of a caller that none of some methods accepts."""
    accepted = {name for method in takers for name in accepted_params(method, params)}
    for name, value in params.items():
        if name == "frame_rate" and value is not None:
            # A fact of the trials, which not every synchronizer needs to know.
            as_frame_rates(value)
        elif name not in accepted and value is not None:
            names = [f"{type(method.__self__).__name__}.{method.__name__}" for method in takers]
            raise TypeError(
                f"{caller} got {name!r}, which is no argument of its own, and is not taken by "
                f"{' or '.join(names) or 'a step before'}."
            )


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
    names = _names_beside_X(getattr(method, "__func__", method), owner is not None)
    if names is None:
        return values
    return {name: value for name, value in values.items() if name in names}


@lru_cache(maxsize=256)
def _names_beside_X(function, is_method):
    """Names of the parameters of a function behind X; None if it takes any."""
    _, *others = list(inspect.signature(function).parameters.values())[is_method:]
    if any(parameter.kind is parameter.VAR_KEYWORD for parameter in others):
        return None
    return frozenset(parameter.name for parameter in others)


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
