"""Drawing: a fit to some of many performances, and what it tells of all of them."""

from numbers import Integral

import numpy as np
import pandas as pd
from scipy.special import betaincinv
from sklearn.utils import check_random_state

from ..inputs.collections import as_collection, as_source, count_of, gives_rows, select
from ..inputs.tables import as_pandas

__all__ = ["draw", "typical_share"]

# Probability with which the pattern is among the most typical ones that are stated.
_SURE = 0.95


def draw(X, size, pattern, random_state):
    """Some performances, drawn at random; nobody else is read.

    Parameters
    ----------
    X : performances of any kind
    size : int or None
        How many; None for all.
    pattern : as of a synchronizer
        One that is told by its index is always among them.
    random_state : as of a synchronizer

    Returns
    -------
    some : performances of any kind
    sample : ndarray of int or None
        Their indices, which increase; None if they are all.
    population : int or None
        Of how many they were drawn.
    """
    if size is None:
        return X, None, None
    given = _by_index(as_pandas(X))
    population = 0 if given is None else count_of(given)
    is_index = isinstance(pattern, Integral) and not isinstance(pattern, bool)
    if size >= population or (is_index and pattern >= population):
        return X if given is None else given, None, None
    # A stream of its own: the search draws from the same state.
    seed = check_random_state(random_state).randint(np.iinfo(np.int32).max)
    drawn = np.random.RandomState(seed).permutation(population)
    if is_index:
        drawn = np.concatenate([[pattern], drawn[drawn != pattern]])
    sample = np.sort(drawn[:size])
    return select(given, sample), sample, population


def _by_index(X):
    """Performances, or rows, of a kind that gives them by index; None of what has to be refused."""
    source = as_source(X)
    if source is not None:
        return source
    if isinstance(X, pd.DataFrame):
        return X if X.index.nlevels == 1 else as_collection(X)
    known = isinstance(X, (list, tuple)) or (isinstance(X, np.ndarray) and X.ndim > 0)
    return X if known or gives_rows(X) else None


def typical_share(in_doubt, n, population):
    """At most this share of a population is more typical than the pattern, with 95 % probability.

    Of a random sample of n at most ``in_doubt`` are more typical than its pattern, which is so one
    of the ``in_doubt + 1`` most typical ones of the sample. The share of the population that is
    more typical than the last of these follows a beta distribution if the sample was drawn with
    replacement; it is smaller if it was not.

    Parameters
    ----------
    in_doubt : int
    n, population : int
        If they are equal there is nothing to be estimated.
    """
    if n == population:
        return in_doubt / n
    return float(betaincinv(in_doubt + 1, n - in_doubt, _SURE)) if in_doubt < n else 1.0
