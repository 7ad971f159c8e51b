"""Permutations of a design, and the largest cluster-enhanced statistic of each."""

from __future__ import annotations

import math
from collections import Counter
from copy import copy
from functools import lru_cache
from numbers import Integral, Real

import numpy as np
from scipy.stats import f as fisher
from scipy.stats import norm
from scipy.stats import t as student

from ..utils.parallel import run

# Rounding of sums that are equal.
_ROUNDING = 1e-9
# A value varies if its spread is more than this share of the largest of its feature.
_VARIES = 1e-3
# Heights of a cluster enhancement are this far apart, in standard normal deviates, and the powers
# of extent and height (Smith and Nichols 2009).
_STEP, _EXTENT, _HEIGHT = 0.1, 0.5, 2.0
# Largest standard normal deviate.
_LARGEST = 8.0
# The least factor of the variance of a group: one that does not vary has no other.
LEAST_FACTOR = 1e-3
# The spread of a group relative to the others is smoothed by a Gaussian of this share of the clock.
_OF_CLOCK = 0.2
# Steps of the regression of spreads, which hardly changes after five.
_REGRESSION = 10
# Permutations that are looked at together.
_BATCH = 250


class Design:
    """What differs between units: rows of orthonormal columns, which are permuted.

    Parameters
    ----------
    columns : ndarray, shape (n_units, n_columns)
        Centred, unless signs are flipped.
    flips : bool, default=False
        Whether the signs of rows are flipped, as of paired differences, instead of a permutation.

    Attributes
    ----------
    floor : float
        No p is below it.
    """

    floor = 0.0

    def __init__(self, columns, flips=False):
        rows, triangle = np.linalg.qr(columns)
        self.rows, self.flips = rows * np.sign(np.diagonal(triangle)), flips
        self.n_tested = columns.shape[1]
        self.left = len(columns) - self.n_tested - (not flips)

    @property
    def smallest_p(self):
        """The share of the arrangements of units that differ as much as the most extreme one.

        With all signs flipped, with groups of one size exchanged, and with a symmetric covariate
        reversed, units differ as much.
        """
        n, rows = len(self.rows), np.round(self.rows, 9)
        if self.flips:
            return 2 / 2**n
        sizes = np.unique(rows, axis=0, return_counts=True)[1].tolist()
        ends = np.sort(rows, axis=0)
        alike = 2 if np.allclose(ends, -ends[::-1], atol=1e-8) else 1
        return alike * math.prod(map(math.factorial, sizes)) / math.factorial(n)

    def rearranged(self, order):
        """The same of units in another order."""
        design = copy(self)
        design.rows = self.rows[order]
        return design

    def scale_of(self, values):
        """The spread of each unit by which units are weighed; None if all count alike."""
        return None

    @property
    def observed(self):
        """The arrangement of the units themselves, as of `permuted`."""
        return self.rows

    def prepare(self, values):
        """What `deviates` takes of values (n_units, P, n_features)."""
        return scaled(values, not self.flips)

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
        k = self.n_tested
        by_column = np.einsum("dnk,npf->dkpf", rows, units, optimize=True)
        explained = np.minimum(np.square(by_column).sum(axis=1), 1 - _ROUNDING)
        ratio = explained / (1 - explained) * (self.left / k)
        if k == 1:
            return self._of_t(np.sqrt(ratio) * np.sign(by_column[:, 0]))
        return self._of_f(ratio, k)

    def critical(self, z, freedom):
        """The t of any difference between levels, where a deviate z is that of all of them."""
        k = self.n_tested
        if k == 1:
            return student.isf(norm.sf(z), freedom)
        # Scheffe's method.
        return np.sqrt(k * fisher.isf(norm.sf(z), k, freedom))

    def _of_t(self, t):
        """Deviates of t, by a table that is even in a variable to which they are nearly linear."""
        spacing, deviates, slopes = _deviates_of_t(self.left)
        place = np.minimum(_even_in_t(t, self.left) / spacing, len(slopes))
        before = np.minimum(place.astype(np.intp), len(slopes) - 1)
        place -= before
        place *= slopes.take(before)
        place += deviates.take(before)
        return np.copysign(place, t)

    def _of_f(self, ratio, k):
        deviates = np.linspace(0, _LARGEST, 8001)
        return np.interp(ratio, _f_of_deviates(self.left, k), deviates)


def _even_in_t(t, left):
    """The variable of Wallace (*Ann. Math. Stat.* 30, 1959): deviates are nearly linear in it."""
    with np.errstate(over="ignore"):
        return np.sqrt(left * np.log1p(np.square(t) / left))


@lru_cache(maxsize=32)
def _deviates_of_t(left):
    """The spacing of an even table of deviates of t, 0 to 8; the deviates; their differences."""
    deviates = np.linspace(0, _LARGEST, 8001)
    places = _even_in_t(student.isf(norm.sf(deviates), left), left)
    spacing = places[-1] / 4000
    even = np.interp(spacing * np.arange(4001), places, deviates)
    return spacing, even, np.diff(even)


@lru_cache(maxsize=32)
def _f_of_deviates(left, k):
    """Values of F with k degrees of freedom, at deviates from 0 to 8."""
    return fisher.isf(norm.sf(np.linspace(0, _LARGEST, 8001)), k, left)


class GroupDesign(Design):
    """Groups of units, which may vary differently.

    Each group has a factor of its variance, at each frame and in each feature: its ratio to that
    of all groups, smoothed along the clock. Groups are compared by t or F with these factors. A
    unit is permuted as its deviation from the common mean, divided by the root of the factor of its
    own group and multiplied by that of the place it gets. Deviations of a finite set sum to 0 in
    all permutations, so what is common to all places is drawn as well, by random signs. Where all
    groups vary alike it cancels out, and the test is the usual one.

    Parameters
    ----------
    groups : ndarray of int, shape (n_units,)

    Attributes
    ----------
    floor : float
        The share of the arrangements of units that differ as much as the most extreme one: draws of
        what is common would allow less, but a few units cannot tell more.
    """

    def __init__(self, groups):
        self.counts = np.bincount(groups)
        alike = math.prod(map(math.factorial, Counter(self.counts.tolist()).values()))
        arranged = math.prod(map(math.factorial, self.counts.tolist()))
        self.floor = alike * arranged / math.factorial(len(groups))
        members = (groups[:, np.newaxis] == np.arange(len(self.counts))).astype(float)
        super().__init__(members[:, 1:] - members[:, 1:].mean(axis=0))
        self.members = members

    @property
    def smallest_p(self):
        return self.floor

    def rearranged(self, order):
        design = super().rearranged(order)
        design.members = self.members[order]
        return design

    @property
    def observed(self):
        return np.column_stack([self.members, np.zeros(len(self.members))])

    def permuted(self, random_state):
        """The members after one permutation, and the weights of what is common to all places."""
        n = len(self.members)
        places = self.members[random_state.permutation(n)]
        signs = random_state.choice([-1.0, 1.0], size=n)
        return np.column_stack([places, signs / np.sqrt(n * (n - 1))])

    def prepare(self, values):
        """Deviations with a common variance, whether they are known, and factors of variances."""
        values = values - np.nanmean(values, axis=0)
        known = np.isfinite(values) & _varies(np.sqrt(np.nansum(np.square(values), axis=0)))
        # Usually all is known, and people are counted once for all values.
        known = known[:, :1, :1] if known.all() else known
        values = np.where(known, values, 0)
        counts, means, variances = self._moments(self.members[np.newaxis], values, known)
        factors = self._factors(counts, variances)[0]
        weights = counts[0] / factors
        middle = (weights * means[0]).sum(axis=0) / weights.sum(axis=0)
        groups = self.members.argmax(axis=1)
        deviations = np.where(known, (values - middle) / np.sqrt(factors[groups]), 0)
        common = deviations.sum(axis=0) / np.maximum(known.sum(axis=0), 1)
        return np.where(known, deviations - common, 0), known, factors, common

    def deviates(self, rows, units):
        """As of a `Design`, of members and weights (n_draws, n_units, n_groups + 1)."""
        z, known, factors, common = units
        counts, means, variances = self._moments(rows[..., :-1], z, known)
        # The units themselves have their own common mean.
        shared = np.einsum("dn,npf->dpf", rows[..., -1], z, optimize=True)
        shared[~rows[..., -1].any(axis=1)] = common
        means = (means + shared[:, np.newaxis]) * np.sqrt(factors)
        variances = variances * factors
        factors = self._factors(counts, variances)
        freedom, k = np.maximum(counts - 1, 0), len(self.counts) - 1
        variance = (freedom * variances / factors).sum(axis=1) / np.maximum(freedom.sum(axis=1), 1)
        weights = counts / factors
        if k == 1:
            size = means[:, 1] - means[:, 0]
            error = np.sqrt(variance * (1 / weights).sum(axis=1))
            return self._of_t(_ratio(size, error))
        middle = (weights * means).sum(axis=1) / weights.sum(axis=1)
        explained = (weights * np.square(means - middle[:, np.newaxis])).sum(axis=1) / k
        return self._of_f(_ratio(explained, variance), k)

    def _moments(self, members, values, known):
        """Counts, means and variances (n_draws, n_groups, P, n_features) of groups."""
        counts = np.maximum(
            np.einsum("dng,npf->dgpf", members, known.astype(float), optimize=True), 1
        )
        means = np.einsum("dng,npf->dgpf", members, values, optimize=True) / counts
        squares = np.einsum("dng,npf->dgpf", members, np.square(values), optimize=True) / counts
        variances = np.maximum(squares - np.square(means), 0) * counts / np.maximum(counts - 1, 1)
        return counts, means, variances

    def _factors(self, counts, variances):
        """The variance of each group relative to that of all, smoothed along the clock."""
        freedom = np.maximum(counts - 1, 0)
        total = np.maximum(freedom.sum(axis=1, keepdims=True), 1)
        pooled = (freedom * variances).sum(axis=1, keepdims=True) / total
        ratios = np.divide(variances, pooled, out=np.ones_like(variances), where=pooled > 0)
        frames = np.arange(variances.shape[2])
        apart = (frames - frames[:, np.newaxis]) / max(_OF_CLOCK * frames[-1], 1)
        kernel = np.exp(-0.5 * np.square(apart))
        smoothed = (kernel / kernel.sum(axis=1, keepdims=True)) @ ratios
        return np.maximum(smoothed, LEAST_FACTOR)


class EffectDesign(Design):
    """An effect beside others: signs are flipped of what the others leave of units.

    Units are divided by their spread, whose logarithm is a sum over some columns: it is estimated
    from all frames and features together. The flipped rows are standardised by what the others
    leave of them (De Santis and others, *arXiv* 2209.13918, 2022).

    Parameters
    ----------
    columns : ndarray, shape (n_units, n_columns)
        Those of the effect.
    others : ndarray, shape (n_units, n_others)
        Columns that are not tested, a constant among them.
    spreads : ndarray, shape (n_units, n_spreads)
        Columns of the logarithm of the spread, a constant among them.
    """

    def __init__(self, columns, others, spreads):
        super().__init__(_apart(columns, np.linalg.qr(others)[0]), flips=True)
        self.columns, self.others, self.spreads = columns, others, spreads
        self.left -= others.shape[1]

    def rearranged(self, order):
        design = super().rearranged(order)
        design.columns, design.others = self.columns[order], self.others[order]
        design.spreads = self.spreads[order]
        return design

    @property
    def observed(self):
        return np.ones((len(self.rows), 1))

    def permuted(self, random_state):
        """Signs of the units."""
        return random_state.choice([-1.0, 1.0], size=(len(self.rows), 1))

    def prepare(self, values):
        """Scaled units without the others, orthonormal rows of the effect, and of the others."""
        scale = self.scale_of(values)[:, np.newaxis]
        others = np.linalg.qr(self.others / scale)[0]
        rows = np.linalg.qr(_apart(self.columns / scale, others))[0]
        rows *= np.sign(np.sum(rows * self.rows, axis=0))
        units = _apart(values / scale[:, np.newaxis], others)
        return scaled(units, centred=False), rows, others

    def scale_of(self, values):
        """The spread of each unit, by a gamma regression of mean squares with a log link."""
        fitted = np.linalg.qr(np.hstack([self.others, self.columns]))[0]
        squares = np.square(_apart(values, fitted))
        total = squares.mean(axis=0)
        squares = np.divide(squares, total, out=np.zeros_like(squares), where=total > 0)
        of_units = squares.mean(axis=(1, 2)) / np.maximum(1 - np.square(fitted).sum(axis=1), 0.1)
        of_units = np.maximum(of_units, LEAST_FACTOR)
        logs, inverse = np.zeros(len(of_units)), np.linalg.pinv(self.spreads)
        for _ in range(_REGRESSION):
            logs = self.spreads @ (inverse @ (logs + of_units / np.exp(logs) - 1))
            logs = np.clip(logs, np.log(LEAST_FACTOR), -np.log(LEAST_FACTOR))
        return np.exp(logs / 2)

    def deviates(self, rows, units):
        """As of a `Design`, of signs (n_draws, n_units, 1)."""
        values, tested, others = units
        flipped = rows * tested
        left = flipped - others @ (others.T @ flipped)
        _, spread, turned = np.linalg.svd(left, full_matrices=False)
        turned = np.swapaxes(turned, 1, 2) / np.maximum(spread, _ROUNDING)[:, np.newaxis]
        if self.n_tested == 1:
            turned = np.abs(turned)
        return super().deviates(flipped @ turned, values)


def _apart(values, others):
    """Values (n_units, ...) less what orthonormal columns tell of them."""
    return values - np.tensordot(others, np.tensordot(others.T, values, 1), 1)


def _ratio(size, error):
    """Sizes in units of an error; where there is none, 0 or infinite."""
    with np.errstate(divide="ignore", invalid="ignore"):
        return np.nan_to_num(size / error, nan=0.0)


def scaled(values, centred):
    """Values (n_units, P, n_features) of squared length 1 over the units; 0 where none vary.

    What is not known (NaN) becomes the mean.
    """
    if centred:
        values = values - np.nanmean(values, axis=0)
    values = np.nan_to_num(values)
    length = np.sqrt(np.square(values).sum(axis=0))
    return np.divide(values, length, out=np.zeros_like(values), where=_varies(length))


def _varies(spread):
    """Which values (P, n_features) vary among units; a feature may vary by rounding alone."""
    largest = spread.max(axis=0)
    return spread > np.maximum(_VARIES * largest, _ROUNDING * largest.max())


def enhanced(deviates):
    """Threshold-free cluster enhancement along the frames, with signs: the shape of ``deviates``.

    The sum, over heights h below a value, of ``extent^0.5 h^2``; the extent is the number of frames
    around it that are above h. A single frame has no extent, and keeps its value.
    """
    if deviates.shape[1] == 1:
        return deviates
    n, n_frames, n_features = deviates.shape
    # A row for each curve and sign, and a frame behind it in which every run has ended.
    signed = np.concatenate([deviates, -deviates]).transpose(0, 2, 1).reshape(-1, n_frames)
    rows = np.full((len(signed), n_frames + 1), -np.inf, dtype=np.float32)
    rows[:, :-1] = signed
    is_positive, numbers, changes = rows >= _STEP, np.arange(len(rows)), np.zeros(rows.size)
    width, height, tops = n_frames + 1, 0.0, rows.max(axis=1)
    while True:
        height += _STEP
        high = tops >= height
        if not high.any():
            break
        rows, numbers, tops = rows[high], numbers[high], tops[high]
        # Where runs of frames begin, and the first frames after them.
        edges = np.flatnonzero(np.diff((rows >= height).ravel(), prepend=False))
        row, frame = np.divmod(edges, width)
        places = numbers[row] * width + frame
        first, after = places[::2], places[1::2]
        weights = (after - first) ** _EXTENT * (height**_HEIGHT * _STEP)
        changes[first] += weights
        changes[after] -= weights
    total = np.cumsum(changes.reshape(-1, width), axis=1) * is_positive
    higher, lower = total[:, :-1].reshape(2, n, n_features, n_frames).transpose(0, 1, 3, 2)
    return higher - lower


class Family:
    """The permutation distribution of the largest enhanced value of some curves.

    Parameters
    ----------
    observed : ndarray, shape (P, n_features)
        Enhanced values of the design itself, with signs.
    largest : ndarray, shape (1 + n_permutations,)
        The largest absolute value of each draw, that of the design first.
    peaks : ndarray, shape (1 + n_permutations,)
        The largest absolute deviate of each draw, before enhancement.
    floor : float, default=0
        No p is below it.

    Attributes
    ----------
    ranks : ndarray, shape (1 + n_permutations,)
        The share of draws that are at least as large.
    """

    def __init__(self, observed, largest, peaks, floor=0.0):
        self.observed, self.largest, self.peaks, self.floor = observed, largest, peaks, floor
        self.ranks = self.shares(largest)

    @property
    def p_value(self):
        """Of the largest value of all."""
        return max(float(self.ranks[0]), self.floor)

    def shares(self, values):
        """The share of draws whose largest value is at least as large as each value."""
        ordered = np.sort(self.largest)
        below = ordered.searchsorted(np.asarray(values) * (1 - _ROUNDING))
        return (len(ordered) - below) / len(ordered)


def families(design, curves, n_permutations, random_state, *, by=(), n_jobs=None, progress):
    """The families of several sets of curves, under the same permutations.

    Parameters
    ----------
    design : Design
    curves : list of ndarray, shape (n_units, P, n_features)
    n_permutations : int
    random_state : RandomState
    by : list of ndarray, shape (n_units, P, n_features), default=()
        Values in whose order units are permuted, the last first; by default the first curves.
    n_jobs : int, default=None
    progress : Progress

    Returns
    -------
    list of Family
    """
    order = order_of_values([curves[0], *by], design.flips)
    design, curves = design.rearranged(order), [values[order] for values in curves]
    draws = [design.observed, *(design.permuted(random_state) for _ in range(n_permutations))]
    portions = [np.stack(draws[k : k + _BATCH]) for k in range(0, len(draws), _BATCH)]
    units = [design.prepare(values) for values in curves]
    work = [(design, rows, values) for values in units for rows in portions]
    step = progress.stage("permutations", len(work))
    results = list(run(_enhanced_draws, work, n_jobs=n_jobs, prefer="threads", step=step))
    n = len(portions)
    by_curves = [results[k : k + n] for k in range(0, len(results), n)]
    return [
        Family(of_curves[0][0], *np.hstack([draws[1:] for draws in of_curves]), design.floor)
        for of_curves in by_curves
    ]


def order_of_values(curves, flips):
    """The order of units by their values: draws depend on neither trials' order nor people's names.

    The last of several sets of curves counts first.
    """
    keys = []
    for values in curves:
        # Weighted, as plain sums of different curves may be equal.
        weights = np.sin(1.0 + np.arange(values[0].size)).reshape(values[0].shape)
        sums = np.nansum(weights * values, axis=(1, 2))
        keys.append(np.abs(sums) if flips else sums)
    return np.lexsort(keys)


def _enhanced_draws(design, rows, units):
    """Enhanced values of the first of some draws, and of each the largest, and largest deviate."""
    deviates = design.deviates(rows, units)
    maps = enhanced(deviates)
    return maps[0], np.abs(maps).max(axis=(1, 2)), np.abs(deviates).max(axis=(1, 2))


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
