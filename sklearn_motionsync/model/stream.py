"""What is kept of performances that come one after the other, however many there are."""

from dataclasses import dataclass, field, replace

import numpy as np

from ..utils.groups import encode_groups
from .similarity import Logs, portions

__all__ = ["PerformanceStream", "spread_out"]

# Most performances that others are compared with: predicting takes time and memory in proportion.
_MOST_KEPT = 64
# Multiples of the golden ratio, less their whole part, in 64 bits: those below any bound come at
# three distances only, which are no round numbers.
_GOLDEN = np.uint64(0x9E3779B97F4A7C15)
_LATER = np.uint64(1 << 63)


@dataclass(frozen=True, eq=False)
class PerformanceStream:
    """Performances that came: mean and variance of all, and some of them.

    Nothing but ``gone`` depends on the portions in which they came, to the last bit; nor does who
    is kept depend on what is still to come.

    Attributes
    ----------
    n : int
        Performances that came.
    n_groups : int
        Groups of these.
    labels : tuple of pairs
        Labels of the groups that have one, and their numbers: from 0, in the order in which groups
        came.
    origin : ndarray, shape (P, n_features), float64
        The first one. Means are taken of what others differ by from it: those are small numbers,
        however far away the origin of the data is.
    away, squares : ndarray, shape (P, n_features), float64
        Mean of all less the origin, and the sum of the squared deviations from the mean.
    bounds : tuple of two ndarray, shape (n_features,)
        The least and the largest number of each feature.
    kept : ndarray, shape (n_kept, P, n_features)
        At most 64: one of every group, then evenly spread; in the order in which they came.
    groups : ndarray of int, shape (n_kept,)
        Whose these are.
    turns : ndarray of uint64, shape (n_kept,)
        Why they are kept rather than others: theirs are the lowest.
    gone : Logs
        How unlike those were that came and are not kept, as far as they could be compared.
    """

    n: int = 0
    n_groups: int = 0
    labels: tuple = ()
    origin: np.ndarray = None
    away: np.ndarray = 0.0
    squares: np.ndarray = 0.0
    bounds: tuple = (np.inf, -np.inf)
    kept: np.ndarray = ()
    groups: np.ndarray = field(default_factory=lambda: np.array([], dtype=np.intp))
    turns: np.ndarray = field(default_factory=lambda: np.array([], dtype=np.uint64))
    gone: Logs = field(default_factory=Logs)

    @property
    def mean(self):
        """Of all performances, (P, n_features)."""
        return self.origin + self.away

    @property
    def variance(self):
        """Of all performances at every posture, (P, n_features), divided by their number."""
        return self.squares / self.n

    @property
    def spread(self):
        """The largest variance of a feature over all frames of all performances."""
        return (self.variance.mean(axis=0) + self.mean.var(axis=0)).max()

    def after(self, performances, groups=None):
        """What is kept when these have come, too.

        Parameters
        ----------
        performances : sequence of ndarray (P, n_features)
        groups : list of labels, default=None
            None: each is of a group of its own.

        Returns
        -------
        later : Stream
            Its ``gone`` are still those from before.
        codes : ndarray of int, shape (n_sequences,)
            Whose the performances are.
        stay : ndarray of bool, shape (n_kept_before + n_sequences,)
            Which of those kept before, and of these, are kept now.
        """
        codes, labels, n_groups = self._number(groups, len(performances))
        come, where = np.unique(codes, return_index=True)
        first = np.zeros(len(codes), dtype=bool)
        first[where[come >= self.n_groups]] = True
        turns = np.concatenate([self.turns, _turns(codes, first, self.n)])
        chosen, n_before = _lowest(turns), len(self.kept)
        stay = np.zeros(len(turns), dtype=bool)
        stay[chosen] = True
        later = replace(self, n_groups=n_groups, labels=labels, **self._add(performances))
        # Double precision as soon as anything came in it.
        dtype = later.bounds[0].dtype
        if stay[n_before:].any() or self.kept.dtype != dtype:
            old = [self.kept[i] for i in chosen[chosen < n_before]]
            new = [performances[i - n_before] for i in chosen[chosen >= n_before]]
            whose = np.concatenate([self.groups, codes])[chosen]
            kept = np.stack(old + new).astype(dtype, copy=False)
            later = replace(later, kept=kept, groups=whose, turns=turns[chosen])
        return later, codes, stay

    def _number(self, groups, n):
        """The groups of performances as numbers; the labels, and how many there are, with them."""
        if groups is None:
            n_groups = self.n_groups + n
            return np.arange(self.n_groups, n_groups), self.labels, n_groups
        codes, given = encode_groups(groups, n)
        labels, n_groups = dict(self.labels), self.n_groups
        for label in given:
            if label not in labels:
                labels[label] = n_groups
                n_groups += 1
        numbers = np.array([labels[label] for label in given])
        return numbers[codes], tuple(labels.items()), n_groups

    def _add(self, performances):
        """Number, mean and variance by Welford's recurrence: one after the other, in doubles."""
        n, (least, most) = self.n, self.bounds
        origin = performances[0].astype(np.float64) if self.origin is None else self.origin
        mean, squares = (np.zeros(origin.shape) + x for x in (self.away, self.squares))
        # What is beyond all numbers is refused when all have come.
        with np.errstate(over="ignore", invalid="ignore"):
            for _, some in portions(performances):
                least = np.minimum(some.min(axis=(0, 1)), least)
                most = np.maximum(some.max(axis=(0, 1)), most)
                for x in some:
                    n += 1
                    away = x - origin
                    step = away - mean
                    mean += step / n
                    squares += step * (away - mean)
        moments = {"n": n, "origin": origin, "away": mean, "squares": squares}
        return moments | {"bounds": (least, most)}


def spread_out(groups):
    """Which performances are kept: at most 64, one of every group, then evenly spread, in order.

    Parameters
    ----------
    groups : ndarray of int (n,)
        From 0, in the order in which they come.

    Returns
    -------
    ndarray of int
    """
    first = np.zeros(len(groups), dtype=bool)
    first[np.unique(groups, return_index=True)[1]] = True
    return _lowest(_turns(groups, first, 0))


def _turns(codes, first, start):
    """Who is kept rather than others: the lower the number, the rather.

    The first of every group come before all others, and are spread over the groups, the others
    over all performances.
    """
    numbers = np.where(first, codes, np.arange(start, start + len(codes))).astype(np.uint64)
    turns = numbers * _GOLDEN >> np.uint64(1)
    return np.where(first, turns, turns | _LATER)


def _lowest(turns):
    return np.sort(np.argsort(turns, kind="stable")[:_MOST_KEPT])
