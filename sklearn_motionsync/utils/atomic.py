"""Atomic fits: a fit works on a copy of the estimator, and its state is taken over in one step."""

import functools
import threading
from collections.abc import Callable
from typing import Any, TypeVar, cast

from sklearn.base import TransformerMixin

__all__ = ["atomic_fit", "atomic_partial_fit", "snapshot", "whole_fit_transform"]

# The decorated method has the type of the method.
_Method = TypeVar("_Method", bound=Callable[..., Any])


# Held while an estimator takes over a state.
_LOCK = threading.Lock()


def atomic_fit(method: _Method) -> _Method:
    """Decorate a ``fit`` or ``fit_transform``, so that other threads never see a partial state.

    Several threads may fit one estimator: each call has a state of its own, and the last to end
    stays. A fit that fails, or is interrupted, leaves the estimator unfitted.

    Parameters
    ----------
    method : callable
        May set attributes as it goes; its ``self`` is a copy without fitted attributes.

    Returns
    -------
    callable
    """

    @functools.wraps(method)
    def fit_copy(self, *args, **kwargs):
        before = vars(self)
        unfitted = _unfitted(before)
        copy = _with_state(self, dict(unfitted))
        try:
            result = method(copy, *args, **kwargs)
        except BaseException:
            # A fit of another thread meanwhile stays.
            with _LOCK:
                if vars(self) is before:
                    self.__dict__ = unfitted
            raise
        with _LOCK:
            _take_over(self, copy, unfitted)
        return self if result is copy else result

    return cast(_Method, fit_copy)


# scikit-learn's, of performances.
whole_fit_transform = atomic_fit(TransformerMixin.fit_transform)
whole_fit_transform.__doc__ = """Fit to performances, then transform them.

Parameters
----------
X : performances
    As for ``fit``.
y : array-like, default=None
    As for ``fit``.
**fit_params : dict
    What ``fit`` takes besides.

Returns
-------
ndarray, list of ndarray or DataFrame
    As from ``transform``.
"""


def atomic_partial_fit(method: _Method) -> _Method:
    """Decorate a ``partial_fit``, so that a portion is learnt as a whole, once, or not at all.

    Several threads may give portions to one estimator: a portion that ends second is learnt again,
    on top of the first. A call that fails, or is interrupted, leaves the estimator as it was.

    Parameters
    ----------
    method : callable
        May set attributes as it goes, but never changes their values. Its ``self`` is a copy, which
        it returns.

    Returns
    -------
    callable
    """

    @functools.wraps(method)
    def partial_fit_copy(self, *args, **kwargs):
        while True:
            before = vars(self)
            copy = _with_state(self, dict(before))
            method(copy, *args, **kwargs)
            with _LOCK:
                if vars(self) is before:
                    _take_over(self, copy, _unfitted(before))
                    return self

    return cast(_Method, partial_fit_copy)


def snapshot(method: _Method) -> _Method:
    """Decorate a method so that all it reads is of one fit, also if another thread fits meanwhile.

    Its ``self`` has the state at the call, and must not be written to.
    """

    @functools.wraps(method)
    def call_on_snapshot(self, *args, **kwargs):
        # A fit replaces the state, and never writes to it.
        return method(_with_state(self, vars(self)), *args, **kwargs)

    return cast(_Method, call_on_snapshot)


def _take_over(estimator, copy, unfitted):
    """Replace the fitted attributes of an estimator by those that a copy got since ``unfitted``."""
    learnt = {k: v for k, v in vars(copy).items() if k not in unfitted or v is not unfitted[k]}
    learnt.pop("_learnt", None)
    estimator.__dict__ = {**_unfitted(vars(estimator)), **learnt, "_learnt": tuple(learnt)}


def _with_state(estimator, state):
    copy = object.__new__(type(estimator))
    copy.__dict__ = state
    return copy


def _unfitted(state):
    """A copy of an estimator's state without its fitted attributes."""
    learnt = {"_learnt", *state.get("_learnt", ())}
    return {name: value for name, value in state.items() if name not in learnt}
