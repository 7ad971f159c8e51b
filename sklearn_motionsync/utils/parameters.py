"""scikit-learn's checks of parameters, as decorators that keep the type of what they decorate."""

from collections.abc import Callable
from typing import Any, TypeVar, cast

from sklearn.base import _fit_context
from sklearn.utils._param_validation import validate_params

__all__ = ["validated", "validated_function", "validated_with_nested"]

_Function = TypeVar("_Function", bound=Callable[..., Any])


def validated(method: _Function) -> _Function:
    """Decorate a ``fit`` so that it checks its parameters; estimators within it need not."""
    return cast(_Function, _fit_context(prefer_skip_nested_validation=True)(method))


def validated_with_nested(method: _Function) -> _Function:
    """Decorate a ``fit`` so that it checks its parameters, and estimators within it theirs."""
    return cast(_Function, _fit_context(prefer_skip_nested_validation=False)(method))


def validated_function(constraints: dict[str, list]) -> Callable[[_Function], _Function]:
    """Decorate a function so that it checks its parameters.

    Parameters
    ----------
    constraints : dict of str to list
        As in ``_parameter_constraints`` of an estimator.
    """
    return validate_params(constraints, prefer_skip_nested_validation=True)
