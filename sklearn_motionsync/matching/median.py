"""The median performance (Eq. 19): by all matches, or by as few as it takes to be sure.

Searching among many: every performance is compared with the same few references, drawn at random;
whoever is worse than the leader beyond doubt is out; the others meet twice as many references,
and so on until one is left or all references are used. Differences to the leader
are taken reference by reference, so that a reference that is far from everybody does not
count (Baharav and Tse, "Ultra fast medoid identification via correlated sequential halving"), and
adjusted for where the references happen to stand.
"""

from typing import NamedTuple

import numpy as np
from scipy.special import stdtrit

from .warps import even_slices

__all__ = [
    "Median",
    "estimate_distances",
    "first_smallest",
    "median_of",
    "rounding_of",
    "search_median",
    "sum_all",
]

# What rounding may be of the smallest global distance.
_SHARP = 0.01
# Sequences that are looked at together.
_AT_ONCE = 256
# References of the first round: enough for a paired t test of anybody against the leader, and to
# know where everybody stands.
_REFERENCES = 32
# Probability, at most, that any rejection in a search is an error.
_ERROR = 0.01
# Matches a search may spend, a performance; of them the last two, who meet all, need two.
_BUDGET, _LAST = 150, 2


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
    in_doubt : int
        How many other performances no test rejected: 0 if certified. Of a population, how many
        may be better in all of it.
    excess : float
        With 99 % probability the global distance is at most ``1 + excess`` times that of
        the true median (of a population: in it, of the best of these); 0 if certified.
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
        """Nobody asked which of n performances is the median."""
        nothing = np.full(n, np.nan)
        return cls(None, nothing, nothing, False, n_matches, n, np.nan)

    def is_blurred(self, rounding):
        """Whether rounding is as large as what tells the typical ones apart."""
        return bool(rounding > _SHARP * self.estimates.min())

    @property
    def achieved(self):
        """What can be said of the choice, by name."""
        names = "n_matches", "certified", "in_doubt", "excess"
        return {name: getattr(self, name) for name in names}


def median_of(sequences):
    """The median by squared distances of sequences on one clock, without matching.

    ``sum_m |x_n - x_m|^2`` is ``N |x_n - mean|^2`` and a constant, so no pair is compared.
    """
    typical, centre = sequences.mean(axis=0), sequences.mean(axis=(0, 1))
    squares, energy = np.empty(len(sequences)), 0.0
    for rows in even_slices(len(sequences), _AT_ONCE):
        deviations = (sequences[rows] - typical).reshape(rows.stop - rows.start, -1)
        squares[rows] = np.einsum("ij,ij->i", deviations, deviations, dtype=np.float64)
        energy += np.square(sequences[rows] - centre).sum(dtype=np.float64)
    sums = len(sequences) * squares + squares.sum()
    index = first_smallest(sums, rounding_of(sequences.dtype, energy))
    return Median(index, sums, sums, True, 0, 0, 0.0)


def rounding_of(dtype, energy):
    """How far rounding can move a global distance of sequences, given the sum of their squares."""
    return 8 * np.finfo(dtype).eps * energy


def sum_all(compare, n, rounding, population=None):
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
    population : int, default=None
        Of how many these were drawn at random; by default these are all. Who of them is the most
        typical of a larger one is a matter of tests, for which all distances are kept.
    """
    if population is not None and population > n:
        everybody = np.arange(n)
        table = _matrix(compare, everybody, everybody)
        race = _Race(table[:, :_REFERENCES], everybody, rounding, population)
        race.leave(everybody, table)
        sums = table.sum(axis=1)
        index = first_smallest(sums, rounding)
        return Median(index, sums, sums, *race.outcome(index, table[index], n * n))
    sums = np.zeros(n)
    for rows, _, block in compare(np.arange(n), np.arange(n)):
        sums[rows] += block.sum(axis=1, dtype=np.float64)
    return Median(first_smallest(sums, rounding), sums, sums, True, n * n, 0, 0.0)


def estimate_distances(compare, n, random_state):
    """Global distances by a few references, as for ``sum_all``; no median is chosen."""
    references = random_state.permutation(n)[:_REFERENCES]
    table = _matrix(compare, np.arange(n), references)
    itself = (references, np.arange(len(references)))
    table[itself] = 0
    met = np.full(n, len(references))
    met[references] -= 1
    estimates = (n - 1) * table.sum(axis=1) / np.maximum(met, 1)
    return Median(None, np.full(n, np.nan), estimates, False, table.size, n, np.nan)


def search_median(compare, n, rounding, random_state, population=None):
    """The median by as few matches as it takes; parameters as for ``sum_all``."""
    references = random_state.permutation(n)
    alive, seen = np.arange(n), min(_REFERENCES, n)
    table = _matrix(compare, alive, references[:seen])
    race = _Race(table, references, rounding, population or n)
    estimates, distances, spent = np.zeros(n), np.full(n, np.nan), table.size
    while seen < n:
        means = race.means(alive, table)
        estimates[alive] = (n - 1) * means
        keep = race.may_win(means.argmin(), alive, table)
        # Half of what is left for one round; what the last one needs is never touched.
        affordable = int(((_BUDGET - _LAST) * n - spent) / (2 * min(seen, n - seen)))
        if keep.sum() > max(affordable, _LAST):
            best = _best(np.where(keep, means, np.inf), max(affordable, _LAST), rounding / n)
            race.leave(alive[keep & ~best], table[keep & ~best])
            keep = best
        alive, table = alive[keep], table[keep]
        more = references[seen:] if len(alive) == 1 else references[seen : 2 * seen]
        table, seen = np.hstack([table, _matrix(compare, alive, more)]), seen + len(more)
        spent += len(alive) * len(more)
    distances[alive] = estimates[alive] = table.sum(axis=1)
    first = first_smallest(distances[alive], rounding)
    race.finish(alive, table)
    index = int(alive[first])
    return Median(index, distances, estimates, *race.outcome(index, table[first], spent))


def first_smallest(values, rounding):
    """The first index whose value is the smallest but for rounding."""
    return int(np.flatnonzero(values <= values.min() + rounding)[0])


def _matrix(compare, bases, moving):
    out = np.empty((len(bases), len(moving)))
    for rows, columns, block in compare(bases, moving):
        out[rows, columns] = block
    return out


def _best(values, count, rounding):
    """Which values are the smallest; of those that differ by rounding only the first ones."""
    order = np.argsort(np.maximum(values, values.min() + rounding), kind="stable")
    return np.isin(np.arange(len(values)), order[:count])


class _Race:
    """Who is out, and who left undecided.

    A test is of one of ``n`` performances, by the references of one of the rounds, against whoever
    leads: no more than ``n`` times the rounds can harm the median, and so many share the error.

    Parameters
    ----------
    table : ndarray, shape (n, n_landmarks)
        Distances of all to the first references.
    references : ndarray of int, shape (n,)
        In the order in which they are met.
    rounding : float
    population : int
        Whose median is sought; these n are all of them, or drawn at random.
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

    def may_win(self, leader, alive, table):
        """Which performances may still be the median of these n; the leader is a row's number."""
        n = len(self._references)
        out = self._least(alive[leader], table[leader], alive, table, n) > 0
        if self._population > n:
            self.leave(alive[out], table[out])
        return ~out

    def leave(self, alive, table):
        """These go, though nothing is proven yet."""
        self._undecided.append((alive, table))

    def finish(self, alive, table):
        """These have met all references: who is the best of them is no matter of tests."""
        if self._population > len(self._references):
            self.leave(alive, table)

    def outcome(self, index, row, n_matches):
        """The last fields of the `Median`: how sure it is after the tests of all who left.

        Parameters
        ----------
        index : int
            The one that was chosen.
        row : ndarray, shape (n,)
            Its distances to all references.
        n_matches : int

        Returns
        -------
        tuple (certified, n_matches, in_doubt, excess)
        """
        least = [np.empty(0)]
        for alive, table in self._undecided:
            others = alive != index
            least.append(self._least(index, row, alive[others], table[others], self._population))
        least = np.concatenate(least)
        in_doubt, gap = int((least <= 0).sum()), max(0.0, -least.min(initial=0))
        return in_doubt == 0, n_matches, in_doubt, self._excess(gap, row[self._references != index])

    def _excess(self, gap, distances):
        """What a gap is of the mean distance that remains if it is taken off."""
        if gap == 0:
            return 0.0
        n, mean = len(self._references), distances.mean()
        if self._population > n:
            error = distances.std() * np.sqrt(1 / n - 1 / self._population)
            mean -= stdtrit(max(n - 2, 1), 1 - self._error) * error
        return float(gap / (mean - gap)) if gap < mean else np.inf

    def _least(self, leader, row, alive, table, population):
        """By how much, at least, performances are farther from the others than the leader."""
        seen = table.shape[1]
        met = self._references[:seen]
        found = self._tests.against(leader, row[:seen], table, alive, met, population)
        doubt = stdtrit(found.freedom, 1 - self._error) * found.error
        return found.mean - doubt - self._rounding


# -- paired tests of performances by what a few references say, and what is known of all others

# Where a performance stands: at most so many coordinates, and so many references for each.
_COORDINATES, _EACH = 16, 8
# Coordinates of less than this share of the largest are rounding.
_SMALLEST = 1e-4
# Beyond quartiles by so many times what lies between them, distances count as equally far.
_FENCE = 3
# References that vary by less than this share of all tell nothing of a coordinate.
_VARIES = 0.1
# What a residual tells of the doubt where the fit is free to go through the point.
_FREE = 1e-3
# Where performances stand tells nothing if some are so much farther away than the references
# (mean squares): too few of them are met.
_BEYOND = 2
# Performances that are tested together: what is kept meanwhile stays small.
_ROWS = 1024


class PairedComparison(NamedTuple):
    """How much farther performances are from all others than the leader is.

    Attributes
    ----------
    mean : ndarray, shape (n_alive,)
        Mean difference to the leader over all others, estimated.
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
        Which ones, drawn at random; they are the first references, too.
    """

    def __init__(self, table, landmarks):
        self.n = len(table)
        self.places = _places(table, landmarks)
        # How far performances are from the others, squared: so large differences can be.
        self.sizes = np.square(table).mean(axis=1)

    def means(self, table, alive, references):
        """Mean distance of performances to all n but themselves, estimated; arguments as below."""
        return self._compared(table, alive, references)[0]

    def against(self, leader, row, table, alive, references, population):
        """Performances against a leader, all differences taken reference by reference.

        Parameters
        ----------
        leader : int
        row : ndarray, shape (n_references,)
            Distances of the leader to the references.
        table : ndarray, shape (n_alive, n_references)
            Those of the performances.
        alive : ndarray of int, shape (n_alive,)
            Which performances.
        references : ndarray of int, shape (n_references,)
            Which references, drawn at random without replacement. Neither the leader nor a
            performance is its own reference.
        population : int
            The others they are compared with: all n, or more, of which these n were drawn.

        Returns
        -------
        Comparison
        """
        others = references != leader
        differences = table[:, others] - row[others]
        return PairedComparison(
            *self._compared(differences, alive, references[others], leader, population)
        )

    def _compared(self, table, alive, references, leader=None, population=None):
        if len(references) < 3 or len(alive) == 0:
            few = len(alive)
            return np.zeros(few), np.full(few, np.inf), np.ones(few, dtype=int)
        # The doubt grows if the references happen to be less far from the others than all are.
        beyond = max(1, self.sizes.mean() / (self.sizes[references].mean() or 1))
        fit = _Fit(self.places if beyond < _BEYOND else self.places[:, :0], references, leader)
        parts = [fit(table[rows], alive[rows]) for rows in even_slices(len(alive), _ROWS)]
        mean, variance, gain, spread, freedom = (
            np.concatenate(x) for x in zip(*parts, strict=True)
        )
        # First what the references leave of the n, then what the n leave of the population.
        variance = beyond * variance * np.maximum(gain - 1 / fit.n_targets, 0)
        variance += spread * (1 / self.n - 1 / (population or self.n))
        error = np.where(freedom < 1, np.inf, np.sqrt(variance))
        return mean, error, np.maximum(freedom, 1)


class _Fit:
    """A regression on where references stand, the same for all rows of a table."""

    def __init__(self, places, references, leader):
        n, count = len(places), len(references)
        self.count = count
        places = places[:, : min(places.shape[1], -(-count // _EACH))]
        of = places[references]
        centre = of.mean(axis=0)
        left, size, right = np.linalg.svd(of - centre, full_matrices=False)
        kept = size > _VARIES * np.sqrt(count)
        # An orthonormal basis over the references, and the coordinates of all others in it.
        self.basis = np.column_stack([np.full(count, count**-0.5), left[:, kept]])
        self.leverage = np.square(self.basis).sum(axis=1)
        place = (places - centre) @ (right[kept].T / size[kept])
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
        basis, left = self.basis[columns], np.maximum(1 - self.leverage[columns], _FREE)
        found = table @ self.basis
        # Nobody is a reference of itself: what the fit to the others says stands there.
        fitted = np.einsum("ij,ij->i", found[rows], basis)
        missing = known + (fitted - known) / left
        found[rows] += (missing - known)[:, np.newaxis] * basis
        table[rows, columns] = missing
        own = np.zeros(len(alive), dtype=int)
        own[rows] = 1
        freedom = self.count - self.basis.shape[1] - own
        mean = np.einsum("ij,ij->i", target, found)
        gain = np.einsum("ij,ij->i", target, target)
        gain[rows] += np.square(np.einsum("ij,ij->i", target[rows], basis)) / left
        deviations = table - found[:, :1] * self.basis[0, 0]
        spread = np.square(deviations).sum(axis=1) / np.maximum(self.count - 1 - own, 1)
        squares = np.square(table - found @ self.basis.T)
        plain = squares.sum(axis=1) / np.maximum(freedom, 1)
        # The weights of the references in the mean, and residuals as if each were left out.
        weights = np.square(self.basis @ target.mean(axis=0))
        outer = squares @ (weights / np.square(np.maximum(1 - self.leverage, _FREE)))
        robust = outer / weights.sum() * self.count / (self.count - own)
        return mean, np.maximum(plain, robust), gain, spread, freedom


def _places(table, landmarks):
    """Where performances stand: coordinates of mean 0 and variance 1, the principal ones first."""
    n, count = table.shape
    low, middle, high = np.quantile(table, [0.25, 0.5, 0.75], axis=0)
    reach = _FENCE * (high - low)
    far = np.clip(table, low - reach, high + reach) - middle
    own, columns = (landmarks, np.arange(count)), np.arange(min(count // 4, n - 1))
    # What a landmark would be from another one at its own place: the others tell, twice over.
    far[own] = 0
    for _ in range(3):
        far -= far.mean(axis=0)
        energy, axes = np.linalg.eigh(far.T @ far)
        energy, axes = energy[::-1], axes[:, ::-1]
        far[own] = ((far[landmarks] @ axes[:, columns]) * axes[:, columns]).sum(axis=1)
    kept = np.flatnonzero(energy > _SMALLEST**2 * max(energy[0], np.finfo(float).tiny))
    axes = axes[:, kept[:_COORDINATES]]
    places = (far - far.mean(axis=0)) @ axes
    size = np.sqrt(np.square(places).mean(axis=0))
    return places / np.where(size > 0, size, 1)
