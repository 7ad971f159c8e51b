"""Paired tests of performances by what a few references say, and what is known of all others.

Every performance is compared with the same landmarks, so it is known how those that are no
references differ from those that are. How much farther k is from m than the leader is depends on
where m stands; a regression on that tells what all other m would say, and only what it leaves
is doubt (the regression estimator of survey sampling: Cochran, "Sampling Techniques", ch. 7; of a
larger population, in two phases: ch. 12).
"""

from typing import NamedTuple

import numpy as np

from .warps import even_slices

__all__ = ["Comparison", "PairedTests"]

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


class Comparison(NamedTuple):
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
        return Comparison(
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
