"""Where the synchronizer of a pipeline is, and what reaches it."""

from sklearn.pipeline import Pipeline
from sklearn.utils.validation import check_is_fitted

from .clock import Synchronizer
from .sequences import check_performances

__all__ = ["find_step", "reach_synchronizer"]


def find_step(estimator, kind, name):
    """The steps before the first one of a kind, and that one; an estimator is its own only step.

    Parameters
    ----------
    estimator : estimator or Pipeline
    kind : class
    name : str
        What to call it, if there is none.

    Returns
    -------
    before : Pipeline or None
    step : estimator
    """
    steps = estimator.steps if isinstance(estimator, Pipeline) else [("", estimator)]
    for i, (_, step) in enumerate(steps):
        if isinstance(step, kind):
            return (estimator[:i] if i else None), step
    names = [type(step).__name__ for _, step in steps]
    raise ValueError(f"There is no {name} in {type(estimator).__name__}; its steps are {names}.")


def reach_synchronizer(estimator, X, kind=Synchronizer, name="synchronizer"):
    """The steps before the synchronizer of an estimator, it, and the performances that reach it."""
    before, step = find_step(estimator, kind, name)
    check_is_fitted(step)
    features = X if before is None else before.transform(X)
    return before, step, check_performances(step, features, reset=False, level="sequence").arrays
