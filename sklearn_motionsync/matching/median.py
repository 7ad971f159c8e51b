"""The median trial (Eq. 19): the one with the smallest sum of distances to all others.

Of up to 100 trials every sum is over all matches. Of more it is estimated from matches with at most
100 of them, drawn at random, the same for all trials: differences between trials are then known
better than the sums themselves.
"""

from typing import NamedTuple

import numpy as np

from .counting import first_smallest
from .sizes import BATCH
from .warps import even_slices

# Most trials that every other one is matched with.
MOST_REFERENCES = 100


class Median(NamedTuple):
    """The trial with the smallest global distance.

    Attributes
    ----------
    trial : int
        Its index.
    distances : ndarray, shape (n_trials,)
        ``C_n`` of Eq. 19, or its estimate, of every trial.
    """

    trial: int
    distances: np.ndarray


def draw_references(n, random_state):
    """Indices of the trials that every trial is matched with: all, or 100 drawn at random.

    Parameters
    ----------
    n : int
    random_state : RandomState
    """
    if n <= MOST_REFERENCES:
        return np.arange(n)
    return np.sort(random_state.permutation(n)[:MOST_REFERENCES])


def median_of_sums(sums, references, rounding):
    """The median, given sums of distances to references.

    Parameters
    ----------
    sums : ndarray, shape (n_trials,)
        Of the distances to all references; a trial has the distance 0 from itself.
    references : ndarray of int
        Indices of trials.
    rounding : float
        Largest rounding of a sum.
    """
    n = len(sums)
    counts = np.full(n, len(references))
    counts[references] -= 1
    scale = (n - 1) / np.maximum(counts, 1)
    distances = sums * scale
    return Median(first_smallest(distances, rounding * scale.max()), distances)


def linear_median(sequences):
    """The median by squared distances of sequences on one clock, without matching.

    ``sum_m |x_n - x_m|^2`` is ``N |x_n - mean|^2`` and a constant, so no pair is compared.
    """
    typical, centre = sequences.mean(axis=0), sequences.mean(axis=(0, 1))
    squares, energy = np.empty(len(sequences)), 0.0
    for rows in even_slices(len(sequences), BATCH):
        deviations = (sequences[rows] - typical).reshape(rows.stop - rows.start, -1)
        squares[rows] = np.einsum("ij,ij->i", deviations, deviations, dtype=np.float64)
        energy += np.square(sequences[rows] - centre).sum(dtype=np.float64)
    sums = len(sequences) * squares + squares.sum()
    return Median(first_smallest(sums, rounding_bound(sequences.dtype, energy)), sums)


def rounding_bound(dtype, energy):
    """Largest rounding of a global distance of sequences, given the sum of their squares."""
    return 8 * np.finfo(dtype).eps * energy
