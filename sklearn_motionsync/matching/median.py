"""The median performance (Eq. 19): by all matches, or by as few as it takes to be sure.

Searching among many: every performance is compared with the same few references, drawn at random;
whoever is worse than the leader beyond doubt is out; the others meet twice as many references,
and so on until one is left or all references are used. Differences to the leader
are taken reference by reference, so that a reference that is far from everybody does not
count (Baharav and Tse, "Ultra fast medoid identification via correlated sequential halving").
"""

from typing import NamedTuple

import numpy as np
from scipy.special import stdtrit

__all__ = [
    "Median",
    "estimate_distances",
    "first_smallest",
    "median_of",
    "rounding_of",
    "search_median",
    "sum_all",
]

# References of the first round: enough for a paired t test of anybody against the leader.
_REFERENCES = 32
# Probability, at most, that any rejection in a search is an error.
_ERROR = 0.01
# Matches a search may spend: this share of all, but at least so many a performance.
_SHARE, _EACH = 0.09, 150


class Median(NamedTuple):
    """The performance with the smallest global distance.

    Attributes
    ----------
    index : int or None
        None if only distances were wanted.
    distances : ndarray, shape (n_sequences,)
        ``C_n`` of Eq. 19 where all matches were made, else NaN.
    estimates : ndarray, shape (n_sequences,)
        ``C_n``, or its estimate from the matches that were made.
    certified : bool
        Whether this is the median of Eq. 19: by all matches, or because every other performance
        was worse in a paired test, all tests together erring with 1 % probability.
    n_matches : int
    """

    index: int | None
    distances: np.ndarray
    estimates: np.ndarray
    certified: bool
    n_matches: int

    @classmethod
    def unknown(cls, n):
        """Nobody asked which of n performances is the median."""
        nothing = np.full(n, np.nan)
        return cls(None, nothing, nothing, False, 0)


def median_of(sequences):
    """The median by squared distances of sequences on one clock, without matching.

    ``sum_m |x_n - x_m|^2`` is ``N |x_n - mean|^2`` and a constant, so no pair is compared.
    """
    deviations = (sequences - sequences.mean(axis=0)).reshape(len(sequences), -1)
    squares = np.einsum("ij,ij->i", deviations, deviations, dtype=np.float64)
    sums = len(sequences) * squares + squares.sum()
    rounding = rounding_of(sequences - sequences.mean(axis=(0, 1)))
    return Median(first_smallest(sums, rounding), sums, sums, True, 0)


def rounding_of(deviations):
    """How far rounding can move a global distance of such sequences, given without their mean."""
    energy = np.einsum("npk,npk->", deviations, deviations, dtype=np.float64)
    return 8 * np.finfo(deviations.dtype).eps * energy


def sum_all(compare, n, rounding):
    """The median by all matches.

    Parameters
    ----------
    compare : callable
        ``compare(bases, moving)`` yields ``(rows, columns, distances)`` that cover all pairs of
        the two arrays of indices.
    n : int
        Number of performances.
    rounding : float
        How far rounding can move a global distance.
    """
    sums = np.zeros(n)
    for rows, _, block in compare(np.arange(n), np.arange(n)):
        sums[rows] += block.sum(axis=1, dtype=np.float64)
    return Median(first_smallest(sums, rounding), sums, sums, True, n * n)


def estimate_distances(compare, n, random_state):
    """Global distances by a few references, as for ``sum_all``; no median is chosen."""
    references = random_state.permutation(n)[:_REFERENCES]
    table = _matrix(compare, np.arange(n), references)
    estimates = (n - 1) * _paired(table, np.arange(n), references).mean(axis=1).filled(0)
    return Median(None, np.full(n, np.nan), estimates, False, n * len(references))


def search_median(compare, n, rounding, random_state):
    """The median by as few matches as it takes; parameters as for ``sum_all``."""
    references = random_state.permutation(n)
    alive, table = np.arange(n), np.empty((n, 0))
    estimates, distances = np.zeros(n), np.full(n, np.nan)
    budget, spent, certified = max(_SHARE * n * n, _EACH * n), 0, True
    seen, rounds = min(_REFERENCES, n), int(np.ceil(np.log2(max(n / _REFERENCES, 1)))) + 1
    while True:
        more = references[table.shape[1] : seen]
        spent += len(alive) * len(more)
        table = np.hstack([table, _matrix(compare, alive, more)])
        paired = _paired(table, alive, references[:seen])
        means = paired.mean(axis=1).filled(0)
        estimates[alive] = (n - 1) * means
        if seen == n:
            break
        keep = _not_worse(paired, means.argmin(), n, rounds, rounding)
        # Half of what is left for one round; what the last one needs is never touched.
        affordable = (budget - spent) / (2 * min(seen, n - seen))
        if keep.sum() > max(affordable, 2):
            certified = False
            keep = _best(np.where(keep, means, np.inf), max(int(affordable), 2), rounding / n)
        alive, table = alive[keep], table[keep]
        seen = n if len(alive) == 1 else min(2 * seen, n)
    distances[alive] = estimates[alive] = table.sum(axis=1)
    index = int(alive[first_smallest(distances[alive], rounding)])
    return Median(index, distances, estimates, certified, spent)


def first_smallest(values, rounding):
    """The first index whose value is the smallest but for rounding."""
    return int(np.flatnonzero(values <= values.min() + rounding)[0])


def _matrix(compare, bases, moving):
    out = np.empty((len(bases), len(moving)))
    for rows, columns, block in compare(bases, moving):
        out[rows, columns] = block
    return out


def _paired(table, alive, references):
    """The matches of each performance with all references but itself."""
    return np.ma.array(table, mask=alive[:, np.newaxis] == references)


def _best(values, count, rounding):
    """Which values are the smallest; of those that differ by rounding only the first ones."""
    order = np.argsort(np.maximum(values, values.min() + rounding), kind="stable")
    return np.isin(np.arange(len(values)), order[:count])


def _not_worse(paired, leader, n, rounds, rounding):
    """Which performances may still be the median: paired t tests against the leader."""
    n_references = paired.shape[1]
    difference = paired - paired[leader]
    mean, count = difference.mean(axis=1), difference.count(axis=1)
    # The references are drawn without replacement from the n performances.
    error = difference.std(axis=1, ddof=1) * np.sqrt((1 - n_references / n) / count)
    critical = stdtrit(np.maximum(count - 1, 1), 1 - _ERROR / (n * rounds))
    beyond = mean > critical * error + rounding / n
    return ~beyond.filled(False)
