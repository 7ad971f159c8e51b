"""A fit to a random sample of many performances: the sample, and what it says of all of them."""

from numbers import Integral

import numpy as np
import pandas as pd
from scipy.special import betaincinv
from sklearn.utils import check_random_state

from ..inputs.collections import as_collection, as_source, count_of, gives_rows, select
from ..inputs.tables import as_pandas

__all__ = ["subsample", "typical_share"]

# Confidence of ``typical_share_``.
_CONFIDENCE = 0.95


def subsample(X, size, pattern, random_state):
    """A random sample of performances; the others are not read.

    Parameters
    ----------
    X : performances of any kind
    size : int or None
        Size of the sample; None for all.
    pattern : as of a synchronizer
        A pattern given by its index is always in the sample.
    random_state : as of a synchronizer

    Returns
    -------
    some : performances of any kind
    sample : ndarray of int or None
        Their indices, which increase; None if they are all.
    population : int or None
        Size of the population.
    """
    if size is None:
        return X, None, None
    given = _indexable(as_pandas(X))
    population = 0 if given is None else count_of(given)
    is_index = isinstance(pattern, Integral) and not isinstance(pattern, bool)
    if size >= population or (is_index and pattern >= population):
        return X if given is None else given, None, None
    # An independent stream: the search uses the same state.
    seed = check_random_state(random_state).randint(np.iinfo(np.int32).max)
    drawn = np.random.RandomState(seed).permutation(population)
    if is_index:
        drawn = np.concatenate([[pattern], drawn[drawn != pattern]])
    sample = np.sort(drawn[:size])
    return select(given, sample), sample, population


def _indexable(X):
    """Performances, or rows, by index; None for input that has to be refused."""
    source = as_source(X)
    if source is not None:
        return source
    if isinstance(X, pd.DataFrame):
        return X if X.index.nlevels == 1 else as_collection(X)
    known = isinstance(X, (list, tuple)) or (isinstance(X, np.ndarray) and X.ndim > 0)
    return X if known or gives_rows(X) else None


def typical_share(in_doubt, n, population):
    """Upper 95 % confidence bound of the share of a population more typical than the pattern.

    At most ``in_doubt`` of a random sample of n are more typical than its pattern: it is one
    of the ``in_doubt + 1`` most typical of the sample. The share of the population that is
    more typical than the last of these follows a beta distribution if the sample is drawn with
    replacement; it is smaller without.

    Parameters
    ----------
    in_doubt : int
    n, population : int
        If they are equal nothing is estimated.
    """
    if n == population:
        return in_doubt / n
    return float(betaincinv(in_doubt + 1, n - in_doubt, _CONFIDENCE)) if in_doubt < n else 1.0
