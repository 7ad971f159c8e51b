"""The median performance (Eq. 19): by all matches, or by a sequential test on few of them.

Sequential search among many: every performance is matched with the same few references, drawn at
random; performances that are significantly worse than the leader are rejected; the others are
matched with twice as many references, and so on until one is left or all references are used.
Tests are paired: differences to the leader are taken reference by reference, so that a
reference that is far from all performances does not count (Baharav and Tse, "Ultra fast medoid
identification via correlated sequential halving"), and adjusted by regression on the places of the
references.
"""

from typing import NamedTuple

import numpy as np
from scipy.special import stdtrit

from .warps import even_slices

__all__ = [
    "Median",
    "estimate_distances",
    "exhaustive_median",
    "first_smallest",
    "linear_median",
    "rounding_bound",
    "sampled_median",
]

# Largest rounding, as a share of the smallest global distance, that tells distances apart.
_LARGEST_ROUNDING = 0.01
# Sequences processed at a time.
_BATCH = 256
# References of the first round: enough for a paired t test against the leader, and for the
# coordinates of all performances.
_REFERENCES = 32
# Family-wise error rate of the rejections of a search.
_ERROR = 0.01
# Matches a search may spend, a performance; the last two performances, matched with all, need two.
_BUDGET, _LAST = 150, 2


class Median(NamedTuple):
    """The performance with the smallest global distance.

    Attributes
    ----------
    index : int or None
        None if only distances were estimated.
    distances : ndarray, shape (n_sequences,)
        ``C_n`` of Eq. 19 where all matches were made, else NaN.
    estimates : ndarray, shape (n_sequences,)
        ``C_n``, or its estimate from the matches that were made.
    certified : bool
        Whether this is the median of Eq. 19: by all matches, or because paired tests, with a
        family-wise error rate of 1 %, rejected every other performance.
    n_matches : int
    in_doubt : int
        Number of other performances that no test rejected: 0 if certified. For a sample, of those
        that may be more typical of the population.
    excess : float
        With 99 % probability the global distance is at most ``1 + excess`` times that of
        the true median (for a sample: in the population, of the best of the sample); 0 if
        certified.
    """

    index: int | None
    distances: np.ndarray
    estimates: np.ndarray
    certified: bool
    n_matches: int
    in_doubt: int
    excess: float

    @classmethod
    def unknown(cls, n, n_matches=0):
        """The result for n performances if the median is not searched for."""
        unknown = np.full(n, np.nan)
        return cls(None, unknown, unknown, False, n_matches, n, np.nan)

    def is_blurred(self, rounding):
        """Whether rounding is too large to tell the most typical performances apart."""
        return bool(rounding > _LARGEST_ROUNDING * self.estimates.min())


def linear_median(sequences):
    """The median by squared distances of sequences on one clock, without matching.

    ``sum_m |x_n - x_m|^2`` is ``N |x_n - mean|^2`` and a constant, so no pair is compared.
    """
    typical, centre = sequences.mean(axis=0), sequences.mean(axis=(0, 1))
    squares, energy = np.empty(len(sequences)), 0.0
    for rows in even_slices(len(sequences), _BATCH):
        deviations = (sequences[rows] - typical).reshape(rows.stop - rows.start, -1)
        squares[rows] = np.einsum("ij,ij->i", deviations, deviations, dtype=np.float64)
        energy += np.square(sequences[rows] - centre).sum(dtype=np.float64)
    sums = len(sequences) * squares + squares.sum()
    index = first_smallest(sums, rounding_bound(sequences.dtype, energy))
    return Median(index, sums, sums, True, 0, 0, 0.0)


def rounding_bound(dtype, energy):
    """Largest rounding of a global distance of sequences, given the sum of their squares."""
    return 8 * np.finfo(dtype).eps * energy


def exhaustive_median(compare, n, rounding, population=None):
    """The median by all matches (Eq. 19).

    Parameters
    ----------
    compare : callable
        ``compare(bases, moving)`` yields ``(rows, columns, distances)`` that cover all pairs of
        the two arrays of indices.
    n : int
        Number of performances.
    rounding : float
        Largest rounding of a global distance.
    population : int, default=None
        Size of the population of which these are a random sample; by default these are all. The
        median of a larger population needs tests, for which all distances are stored.
    """
    if population is not None and population > n:
        all_indices = np.arange(n)
        table = _matrix(compare, all_indices, all_indices)
        search = _SequentialTests(table[:, :_REFERENCES], all_indices, rounding, population)
        search.postpone(all_indices, table)
        sums = table.sum(axis=1)
        index = first_smallest(sums, rounding)
        return Median(index, sums, sums, *search.outcome(index, table[index], n * n))
    sums = np.zeros(n)
    for rows, _, block in compare(np.arange(n), np.arange(n)):
        sums[rows] += block.sum(axis=1, dtype=np.float64)
    return Median(first_smallest(sums, rounding), sums, sums, True, n * n, 0, 0.0)


def estimate_distances(compare, n, random_state):
    """Estimates of global distances from a few references; arguments as of `exhaustive_median`."""
    references = random_state.permutation(n)[:_REFERENCES]
    table = _matrix(compare, np.arange(n), references)
    table[references, np.arange(len(references))] = 0
    counts = np.full(n, len(references))
    counts[references] -= 1
    estimates = (n - 1) * table.sum(axis=1) / np.maximum(counts, 1)
    return Median(None, np.full(n, np.nan), estimates, False, table.size, n, np.nan)


def sampled_median(compare, n, rounding, random_state, population=None):
    """The median by a sequential search; arguments as of `exhaustive_median`."""
    references = random_state.permutation(n)
    alive, seen = np.arange(n), min(_REFERENCES, n)
    table = _matrix(compare, alive, references[:seen])
    search = _SequentialTests(table, references, rounding, population or n)
    estimates, distances, spent = np.zeros(n), np.full(n, np.nan), table.size
    while seen < n:
        means = search.means(alive, table)
        estimates[alive] = (n - 1) * means
        keep = search.is_in_doubt(means.argmin(), alive, table)
        # Half of the remaining budget for one round, without the reserve of the last one.
        affordable = int(((_BUDGET - _LAST) * n - spent) / (2 * min(seen, n - seen)))
        if keep.sum() > max(affordable, _LAST):
            best = _best(np.where(keep, means, np.inf), max(affordable, _LAST), rounding / n)
            search.postpone(alive[keep & ~best], table[keep & ~best])
            keep = best
        alive, table = alive[keep], table[keep]
        more = references[seen:] if len(alive) == 1 else references[seen : 2 * seen]
        table, seen = np.hstack([table, _matrix(compare, alive, more)]), seen + len(more)
        spent += len(alive) * len(more)
    distances[alive] = estimates[alive] = table.sum(axis=1)
    first = first_smallest(distances[alive], rounding)
    if population is not None and population > n:
        search.postpone(alive, table)
    index = int(alive[first])
    return Median(index, distances, estimates, *search.outcome(index, table[first], spent))


def first_smallest(values, rounding):
    """The first index whose value is within rounding of the smallest."""
    return int(np.flatnonzero(values <= values.min() + rounding)[0])


def _matrix(compare, bases, moving):
    out = np.empty((len(bases), len(moving)))
    for rows, columns, block in compare(bases, moving):
        out[rows, columns] = block
    return out


def _best(values, count, rounding):
    """Mask of the ``count`` smallest values; of those within rounding the first ones."""
    order = np.argsort(np.maximum(values, values.min() + rounding), kind="stable")
    return np.isin(np.arange(len(values)), order[:count])


class _SequentialTests:
    """Rejections of a search for the median.

    Tests are of one of ``n`` performances, by the references of one round, against the leader: the
    error rate is divided (Bonferroni) by ``n`` times the number of rounds.

    Parameters
    ----------
    table : ndarray, shape (n, n_landmarks)
        Distances of all to the first references.
    references : ndarray of int, shape (n,)
        In the order of their use.
    rounding : float
    population : int
        Size of the population; the n performances are all of it, or a random sample.
    """

    def __init__(self, table, references, rounding, population):
        n = len(table)
        rounds = int(np.ceil(np.log2(max(n / _REFERENCES, 1)))) + 1
        self._tests = PairedTests(table, references[: table.shape[1]])
        self._references, self._population = references, max(population, n)
        self._error, self._rounding = _ERROR / (n * rounds), rounding / n
        self._undecided = []

    def means(self, alive, table):
        """Mean distances to all others, estimated."""
        return self._tests.means(table, alive, self._references[: table.shape[1]])

    def is_in_doubt(self, leader, alive, table):
        """Which performances may be the median of these n; the leader is a row of the table."""
        n = len(self._references)
        rejected = self._lower_bounds(alive[leader], table[leader], alive, table, n) > 0
        if self._population > n:
            self.postpone(alive[rejected], table[rejected])
        return ~rejected

    def postpone(self, alive, table):
        """Test these performances against the median, in the population, once it is chosen."""
        self._undecided.append((alive, table))

    def outcome(self, index, row, n_matches):
        """The last fields of the `Median`, after the postponed tests.

        Parameters
        ----------
        index : int
            The median.
        row : ndarray, shape (n,)
            Its distances to all references.
        n_matches : int

        Returns
        -------
        tuple (certified, n_matches, in_doubt, excess)
        """
        bounds = [np.empty(0)]
        for alive, table in self._undecided:
            keep = alive != index
            some = alive[keep], table[keep], self._population
            bounds.append(self._lower_bounds(index, row, *some))
        bounds = np.concatenate(bounds)
        in_doubt, gap = int((bounds <= 0).sum()), max(0.0, -bounds.min(initial=0))
        if gap == 0:
            return in_doubt == 0, n_matches, in_doubt, 0.0
        distances = row[self._references != index]
        n, mean = len(self._references), distances.mean()
        if self._population > n:
            error = distances.std() * np.sqrt(1 / n - 1 / self._population)
            mean -= stdtrit(max(n - 2, 1), 1 - self._error) * error
        excess = float(gap / (mean - gap)) if gap < mean else np.inf
        return in_doubt == 0, n_matches, in_doubt, excess

    def _lower_bounds(self, leader, row, alive, table, population):
        """Lower confidence bounds of the mean differences of performances to the leader."""
        seen = table.shape[1]
        references = self._references[:seen]
        found = self._tests.against(leader, row[:seen], table, alive, references, population)
        return found.mean - stdtrit(found.freedom, 1 - self._error) * found.error - self._rounding


# -- paired tests by a few references, adjusted by regression on coordinates of all performances

# Most coordinates of a performance, and references for each of them.
_COORDINATES, _EACH = 16, 8
# Coordinates of less than this share of the largest are rounding.
_SMALLEST = 1e-4
# Distances are clipped at so many interquartile ranges beyond the quartiles.
_FENCE = 3
# Smallest variation of a coordinate among the references, as a share of that among all.
_VARIES = 0.1
# Smallest 1 - leverage of a residual.
_LEAST_FREE = 1e-3
# Coordinates are not used if the mean square distance of all performances is so many times that of
# the references: too few of the distant ones are among these.
_BEYOND = 2
# Performances tested at a time: bounds the memory of intermediate arrays.
_ROWS = 1024


class PairedDifferences(NamedTuple):
    """Differences of the mean distances of performances to that of the leader.

    Attributes
    ----------
    mean : ndarray, shape (n_alive,)
        Estimated mean difference over all others.
    error : ndarray, shape (n_alive,)
        Its standard error; infinite if there are too few references.
    freedom : ndarray of int, shape (n_alive,)
        Degrees of freedom of the error, at least 1.
    """

    mean: np.ndarray
    error: np.ndarray
    freedom: np.ndarray


class PairedTests:
    """Estimates of mean distances, and of their differences, by a few references.

    Parameters
    ----------
    table : ndarray, shape (n, n_landmarks)
        Distances of all performances to some of them.
    landmarks : ndarray of int, shape (n_landmarks,)
        Their indices, drawn at random; they are the first references, too.
    """

    def __init__(self, table, landmarks):
        self.n = len(table)
        self.places = _coordinates(table, landmarks)
        self.sizes = np.square(table).mean(axis=1)

    def means(self, table, alive, references):
        """Estimated mean distance of performances to all others; arguments as of `against`."""
        return self._estimate(table, alive, references)[0]

    def against(self, leader, row, table, alive, references, population):
        """Estimate the differences of performances to a leader, reference by reference.

        Parameters
        ----------
        leader : int
        row : ndarray, shape (n_references,)
            Distances of the leader to the references.
        table : ndarray, shape (n_alive, n_references)
            Those of the performances.
        alive : ndarray of int, shape (n_alive,)
            Indices of the performances.
        references : ndarray of int, shape (n_references,)
            Indices of the references, drawn at random without replacement. Neither the leader nor a
            performance is its own reference.
        population : int
            Size of the population: n, or more if the n are a random sample.

        Returns
        -------
        PairedDifferences
        """
        others = references != leader
        differences = table[:, others] - row[others]
        found = self._estimate(differences, alive, references[others], leader, population)
        return PairedDifferences(*found)

    def _estimate(self, table, alive, references, leader=None, population=None):
        if len(references) < 3 or len(alive) == 0:
            few = len(alive)
            return np.zeros(few), np.full(few, np.inf), np.ones(few, dtype=int)
        # The variance is larger if the references happen to be nearer to the others than all are.
        beyond = max(1, self.sizes.mean() / (self.sizes[references].mean() or 1))
        fit = _Fit(self.places if beyond < _BEYOND else self.places[:, :0], references, leader)
        parts = [fit(table[rows], alive[rows]) for rows in even_slices(len(alive), _ROWS)]
        mean, variance, gain, spread, freedom = (
            np.concatenate(x) for x in zip(*parts, strict=True)
        )
        # The variance of drawing the references from the n, then of the n from the population.
        variance = beyond * variance * np.maximum(gain - 1 / fit.n_targets, 0)
        variance += spread * (1 / self.n - 1 / (population or self.n))
        error = np.where(freedom < 1, np.inf, np.sqrt(variance))
        return mean, error, np.maximum(freedom, 1)


class _Fit:
    """A regression on the coordinates of the references, the same for all rows of a table."""

    def __init__(self, places, references, leader):
        n, count = len(places), len(references)
        self.count = count
        places = places[:, : min(places.shape[1], -(-count // _EACH))]
        of = places[references]
        centre = of.mean(axis=0)
        left, size, right = np.linalg.svd(of - centre, full_matrices=False)
        used = size > _VARIES * np.sqrt(count)
        # An orthonormal basis over the references, and the coordinates of all others in it.
        self.basis = np.column_stack([np.full(count, count**-0.5), left[:, used]])
        self.leverage = np.square(self.basis).sum(axis=1)
        place = (places - centre) @ (right[used].T / size[used])
        place = np.column_stack([np.full(n, count**-0.5), place])
        total, self.n_targets = place.sum(axis=0), n - 1
        if leader is not None:
            total, self.n_targets = total - place[leader], n - 2
        self._place, self._total = place, total
        self._column = np.full(n, -1)
        self._column[references] = np.arange(count)

    def __call__(self, table, alive):
        """Mean, residual variance, factor of it, plain variance, degrees of freedom of each row."""
        rows, columns = np.arange(len(alive)), self._column[alive]
        rows, columns = rows[columns >= 0], columns[columns >= 0]
        target = (self._total - self._place[alive]) / self.n_targets
        known, table = table[rows, columns], table.copy()
        basis, left = self.basis[columns], np.maximum(1 - self.leverage[columns], _LEAST_FREE)
        coefficients = table @ self.basis
        # No performance is a reference of itself: there stands the fit to the other references.
        fitted = np.einsum("ij,ij->i", coefficients[rows], basis)
        missing = known + (fitted - known) / left
        coefficients[rows] += (missing - known)[:, np.newaxis] * basis
        table[rows, columns] = missing
        own = np.zeros(len(alive), dtype=int)
        own[rows] = 1
        freedom = self.count - self.basis.shape[1] - own
        mean = np.einsum("ij,ij->i", target, coefficients)
        gain = np.einsum("ij,ij->i", target, target)
        gain[rows] += np.square(np.einsum("ij,ij->i", target[rows], basis)) / left
        deviations = table - coefficients[:, :1] * self.basis[0, 0]
        spread = np.square(deviations).sum(axis=1) / np.maximum(self.count - 1 - own, 1)
        squares = np.square(table - coefficients @ self.basis.T)
        plain = squares.sum(axis=1) / np.maximum(freedom, 1)
        # The weights of the references in the mean, and residuals as if each were left out.
        weights = np.square(self.basis @ target.mean(axis=0))
        outer = squares @ (weights / np.square(np.maximum(1 - self.leverage, _LEAST_FREE)))
        robust = outer / weights.sum() * self.count / (self.count - own)
        return mean, np.maximum(plain, robust), gain, spread, freedom


def _coordinates(table, landmarks):
    """Principal coordinates of performances, of mean 0 and variance 1."""
    n, count = table.shape
    low, middle, high = np.quantile(table, [0.25, 0.5, 0.75], axis=0)
    reach = _FENCE * (high - low)
    far = np.clip(table, low - reach, high + reach) - middle
    own, columns = (landmarks, np.arange(count)), np.arange(min(count // 4, n - 1))
    # The distance of a landmark to itself is imputed from the others, iteratively.
    far[own] = 0
    for _ in range(3):
        far -= far.mean(axis=0)
        energy, axes = np.linalg.eigh(far.T @ far)
        energy, axes = energy[::-1], axes[:, ::-1]
        far[own] = ((far[landmarks] @ axes[:, columns]) * axes[:, columns]).sum(axis=1)
    used = np.flatnonzero(energy > _SMALLEST**2 * max(energy[0], np.finfo(float).tiny))
    axes = axes[:, used[:_COORDINATES]]
    places = (far - far.mean(axis=0)) @ axes
    size = np.sqrt(np.square(places).mean(axis=0))
    return places / np.where(size > 0, size, 1)
