"""A fit is all or nothing: it works on a copy of the estimator, whose state is taken over whole."""

import copy
import functools

__all__ = ["at_once"]


def at_once(method):
    """Decorate a ``fit`` or ``fit_transform`` so that no half of it can ever be seen.

    Several threads may fit one estimator: each call sees its own state only, and the one that ends
    last wins. A fit that fails, or is interrupted, leaves the estimator unfitted.

    Parameters
    ----------
    method : callable
        May set attributes as it goes; of ``self`` it gets a copy that was never fitted.

    Returns
    -------
    callable
    """

    @functools.wraps(method)
    def on_a_copy(self, *args, **kwargs):
        twin = copy.copy(self)
        _forget(twin, _fitted(twin))
        try:
            result = method(twin, *args, **kwargs)
        except BaseException:
            _forget(self, _fitted(self))
            raise
        stale = _fitted(self) - _fitted(twin)
        # One step: who reads in between sees the old state or the new one.
        vars(self).update({k: v for k, v in vars(twin).items() if k[0] == "_" or k[-1] == "_"})
        _forget(self, stale)
        return self if result is twin else result

    return on_a_copy


def _fitted(estimator):
    """Names of the attributes that a fit sets, by scikit-learn's convention."""
    return {name for name in list(vars(estimator)) if name[-1] == "_"}


def _forget(estimator, names):
    for name in names:
        vars(estimator).pop(name, None)
