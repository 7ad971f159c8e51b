"""scikit-learn's checks of parameters as decorators."""

from collections.abc import Callable
from numbers import Real
from typing import Any, TypeVar, cast

from sklearn.base import _fit_context
from sklearn.utils._param_validation import Interval, validate_params

from ..matching.sizes import RATES

_Function = TypeVar("_Function", bound=Callable[..., Any])


class Rate(Interval):
    """The constraint of a frame rate: a number, and no truth value, from one border to another."""

    def __init__(self, least, largest):
        super().__init__(Real, least, largest, closed="both")

    def is_satisfied_by(self, val):
        return not isinstance(val, bool) and super().is_satisfied_by(val)


FRAME_RATE = Rate(*RATES)


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
