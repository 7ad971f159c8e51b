"""Permutations of a design, and the largest cluster-enhanced statistic of each."""

from __future__ import annotations

from numbers import Integral, Real

import numpy as np
from scipy.stats import f as fisher
from scipy.stats import norm
from scipy.stats import t as student

from ..utils.parallel import run

__all__ = [
    "Design",
    "Family",
    "check_level",
    "check_test",
    "enhanced",
    "families",
    "scaled",
    "share_at_most",
]

# A value varies if its spread is more than this share of the largest of its feature.
_VARIES = 1e-3
# Heights of a cluster enhancement are this far apart, in standard normal deviates, and the powers
# of extent and height (Smith and Nichols 2009).
_STEP, _EXTENT, _HEIGHT = 0.1, 0.5, 2.0
# Largest standard normal deviate.
_LARGEST = 8.0
# Permutations that are looked at together.
_BATCH = 250
# Rounding of sums that are equal.
_ROUNDING = 1e-9


class Design:
    """What differs between units: rows of orthonormal columns, which are permuted.

    Parameters
    ----------
    columns : ndarray, shape (n_units, n_columns)
        Centred, unless signs are flipped.
    flips : bool, default=False
        Whether the signs of rows are flipped, as of paired differences, instead of a permutation.
    """

    def __init__(self, columns, flips=False):
        rows, triangle = np.linalg.qr(columns)
        self.rows, self.flips = rows * np.sign(np.diagonal(triangle)), flips
        self.left = len(columns) - columns.shape[1] - (not flips)

    def permuted(self, random_state):
        """The rows after one random permutation."""
        n = len(self.rows)
        if self.flips:
            return self.rows * random_state.choice([-1.0, 1.0], size=(n, 1))
        return self.rows[random_state.permutation(n)]

    def deviates(self, rows, units):
        """Standard normal deviates with the tail probabilities of F, or of a signed t.

        Parameters
        ----------
        rows : ndarray, shape (n_draws, n_units, n_columns)
        units : ndarray, shape (n_units, P, n_features)
            As of `scaled`.

        Returns
        -------
        ndarray, shape (n_draws, P, n_features)
        """
        k = rows.shape[2]
        by_column = np.einsum("dnk,npf->dkpf", rows, units, optimize=True)
        explained = np.minimum(np.square(by_column).sum(axis=1), 1 - _ROUNDING)
        ratio = explained / (1 - explained) * (self.left / k)
        if k == 1:
            t = np.sqrt(ratio) * np.sign(by_column[:, 0])
            return np.sign(t) * np.minimum(norm.isf(student.sf(np.abs(t), self.left)), _LARGEST)
        return np.clip(norm.isf(fisher.sf(ratio, k, self.left)), 0, _LARGEST)


def scaled(values, centred):
    """Values (n_units, P, n_features) of squared length 1 over the units; 0 where none vary.

    What is not known (NaN) becomes the mean.
    """
    is_known = ~np.isnan(values)
    if centred:
        counts = np.maximum(is_known.sum(axis=0), 1)
        values = values - np.where(is_known, values, 0).sum(axis=0) / counts
    values = np.where(is_known, values, 0)
    length = np.sqrt(np.square(values).sum(axis=0))
    varies = length > _VARIES * length.max(axis=0)
    return np.where(varies, values / np.where(varies, length, 1), 0)


def enhanced(deviates):
    """Threshold-free cluster enhancement along the frames, with signs: the shape of ``deviates``.

    The sum, over heights h below a value, of ``extent^0.5 h^2``; the extent is the number of frames
    around it that are above h. A single frame has no extent, and keeps its value.
    """
    if deviates.shape[1] == 1:
        return deviates
    n, n_frames, n_features = deviates.shape
    # A column for each curve and sign.
    signed = np.concatenate([deviates, -deviates]).astype(np.float32)
    curves = signed.transpose(1, 0, 2).reshape(n_frames, -1)
    total, columns, height = np.zeros_like(curves), np.arange(curves.shape[1]), 0.0
    while True:
        height += _STEP
        high = curves.max(axis=0) >= height
        if not high.any():
            break
        curves, columns = curves[:, high], columns[high]
        above, extent = curves >= height, np.zeros_like(curves)
        # Frames since the last one below, and then the largest of each run.
        run = np.zeros(len(columns), dtype=np.float32)
        for is_above, out in zip(above, extent, strict=True):
            run = np.multiply(run + 1, is_above, out=out)
        for is_above, out in zip(above[::-1], extent[::-1], strict=True):
            run = np.multiply(np.maximum(run, out), is_above, out=out)
        total[:, columns] += extent**_EXTENT * (height**_HEIGHT * _STEP)
    higher, lower = total.reshape(n_frames, 2, n, n_features).transpose(1, 2, 0, 3)
    return higher - lower


class Family:
    """The permutation distribution of the largest enhanced value of some curves.

    Parameters
    ----------
    found : ndarray, shape (P, n_features)
        Enhanced values of the design itself, with signs.
    largest : ndarray, shape (1 + n_permutations,)
        The largest absolute value of each draw, that of the design first.

    Attributes
    ----------
    ranks : ndarray, shape (1 + n_permutations,)
        The share of draws that are at least as large.
    """

    def __init__(self, found, largest):
        self.found, self.largest = found, largest
        self.ranks = self.shares(largest)

    @property
    def p_value(self):
        """Of the largest value of all."""
        return float(self.ranks[0])

    def shares(self, values):
        """The share of draws whose largest value is at least as large as each value."""
        ordered = np.sort(self.largest)
        below = ordered.searchsorted(np.asarray(values) * (1 - _ROUNDING))
        return (len(ordered) - below) / len(ordered)


def families(design, curves, n_permutations, random_state, *, n_jobs=None, progress):
    """The families of several sets of curves, under the same permutations.

    Parameters
    ----------
    design : Design
    curves : list of ndarray, shape (n_units, P, n_features)
    n_permutations : int
    random_state : RandomState
    n_jobs : int, default=None
    progress : Progress

    Returns
    -------
    list of Family
    """
    draws = [design.rows, *(design.permuted(random_state) for _ in range(n_permutations))]
    portions = [np.stack(draws[k : k + _BATCH]) for k in range(0, len(draws), _BATCH)]
    units = [scaled(values, not design.flips) for values in curves]
    work = [(design, rows, values) for values in units for rows in portions]
    step = progress.stage("permutations", len(work))
    results = list(run(_enhanced_draws, work, n_jobs=n_jobs, prefer="threads", step=step))
    n = len(portions)
    by_curves = [results[k : k + n] for k in range(0, len(results), n)]
    return [Family(p[0][0], np.concatenate([largest for _, largest in p])) for p in by_curves]


def _enhanced_draws(design, rows, units):
    """Enhanced values of the first of some draws, and the largest absolute one of each."""
    maps = enhanced(design.deviates(rows, units))
    return maps[0], np.abs(maps).max(axis=(1, 2))


def share_at_most(draws, values):
    """The share of draws that are at most as large as each value."""
    ordered = np.sort(draws)
    return ordered.searchsorted(np.asarray(values) + _ROUNDING, "right") / len(ordered)


def check_level(level):
    """Refuse a level outside of (0, 1)."""
    is_number = isinstance(level, Real) and not isinstance(level, bool)
    if not (is_number and 0 < level < 1):
        raise ValueError(f"level must be a number between 0 and 1, such as 0.05; got {level!r}.")


def check_test(level, n_permutations):
    """Refuse such a level, and too few permutations for it."""
    check_level(level)
    is_whole = isinstance(n_permutations, Integral) and not isinstance(n_permutations, bool)
    if not (is_whole and n_permutations >= 1 / level - 1):
        raise ValueError(
            f"n_permutations must be a whole number of at least {1 / level - 1:.0f} at this level, "
            f"such as 1999; got {n_permutations!r}."
        )
