"""A fit is all or nothing: it works on a copy of the estimator, whose state is taken over whole."""

import functools
import threading

__all__ = ["atomic_fit", "atomic_partial_fit", "snapshot"]

# Held for the moment in which an estimator takes over what was learnt.
_TAKING_OVER = threading.Lock()


def atomic_fit(method):
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
        before = vars(self)
        blank = _unfitted(before)
        twin = _with_state(self, dict(blank))
        try:
            result = method(twin, *args, **kwargs)
        except BaseException:
            # What another thread has fitted meanwhile is not ours to forget.
            with _TAKING_OVER:
                if vars(self) is before:
                    self.__dict__ = blank
            raise
        with _TAKING_OVER:
            _take_over(self, twin, blank)
        return self if result is twin else result

    return on_a_copy


def atomic_partial_fit(method):
    """Decorate a ``partial_fit``, so that a portion is learnt whole, once, or not at all.

    Several threads may give portions to one estimator: one that comes second is learnt again, on
    top of the first. A call that fails, or is interrupted, leaves the estimator as it was.

    Parameters
    ----------
    method : callable
        May set attributes as it goes, but never changes their values; of ``self`` it gets a copy.
        Returns it.

    Returns
    -------
    callable
    """

    @functools.wraps(method)
    def on_a_copy(self, *args, **kwargs):
        while True:
            before = vars(self)
            blank = _unfitted(before)
            twin = _with_state(self, dict(before))
            method(twin, *args, **kwargs)
            with _TAKING_OVER:
                if vars(self) is before:
                    _take_over(self, twin, blank)
                    return self

    return on_a_copy


def snapshot(method):
    """Decorate an answer so that it is of one fit, also if another thread fits meanwhile.

    It is given the estimator as it was when it was asked, and must not write to it.
    """

    @functools.wraps(method)
    def of_a_snapshot(self, *args, **kwargs):
        # A fit replaces the state, it never writes to it.
        return method(_with_state(self, vars(self)), *args, **kwargs)

    return of_a_snapshot


def _take_over(estimator, twin, blank):
    """Replace what an estimator has learnt by what its twin has, who was blank."""
    after = _unfitted(vars(estimator))
    learnt = {k: v for k, v in vars(twin).items() if k not in blank or v is not blank[k]}
    learnt.pop("_learnt", None)
    estimator.__dict__ = {**after, **learnt, "_learnt": tuple(learnt)}


def _with_state(estimator, state):
    twin = object.__new__(type(estimator))
    twin.__dict__ = state
    return twin


def _unfitted(state):
    """A copy of an estimator's state without what the last fit learnt."""
    learnt = {"_learnt", *state.get("_learnt", ())}
    return {name: value for name, value in state.items() if name not in learnt}
