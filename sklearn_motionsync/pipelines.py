"""Where the synchronizer of a pipeline is, and what reaches it."""

from sklearn.pipeline import Pipeline
from sklearn.utils.validation import check_is_fitted

__all__ = ["find_step", "find_synchronizer", "index_of_pattern", "reach_synchronizer"]


def find_step(estimator, kind):
    """The steps before the first one of a kind, and that one; an estimator is its own only step.

    Parameters
    ----------
    estimator : estimator or Pipeline
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


def reach_synchronizer(estimator, X, kind=None):
    """The steps before the synchronizer of an estimator, it, and the performances that reach it.

    The performances are checked: its methods take them without checking again. ``kind`` is a class
    of synchronizers, by default any.
    """
    found = find_synchronizer(estimator) if kind is None else find_step(estimator, kind)
    before, synchronizer = found
    check_is_fitted(synchronizer)
    features = X if before is None else before.transform(X)
    return before, synchronizer, synchronizer.check_performances(features)


def index_of_pattern(synchronizer, performances):
    """The index of the pattern among checked performances; None if it is not one of them."""
    index = synchronizer.pattern_index_
    if index is None or index >= len(performances):
        return None
    same = synchronizer.normalize(performances.take([index]))[0]
    return index if (same == synchronizer.pattern_).all() else None


def _first(estimator, fits, name):
    # What a search found.
    estimator = getattr(estimator, "best_estimator_", estimator)
    steps = estimator.steps if isinstance(estimator, Pipeline) else [("", estimator)]
    for i, (_, step) in enumerate(steps):
        if fits(step):
            return (estimator[:i] if i else None), step
    names = [type(step).__name__ for _, step in steps]
    raise ValueError(f"There is no {name} in {type(estimator).__name__}; its steps are {names}.")
