"""compare_groups: whether groups differ in shape or in timing, where, and by how much."""

from __future__ import annotations

from dataclasses import dataclass
from numbers import Integral, Real
from typing import Any, Literal

import numpy as np
import pandas as pd
from scipy.stats import f as fisher
from scipy.stats import linregress, norm
from scipy.stats import t as student
from sklearn.base import BaseEstimator
from sklearn.utils import check_random_state

from ..inputs.features import choose_features, names_of_features
from ..inputs.numbers import as_numbers, check_finite
from ..inputs.types import Features, Labels, PerformancesLike, RandomState, ValuesLike
from ..inputs.validation import read_collection
from ..inputs.wording import counted
from ..synchronizers.match import match_of_times
from ..utils.groups import encode_groups
from ..utils.pipelines import route_to_synchronizer

__all__ = ["GroupComparison", "compare_groups"]

# -- the statistics ------------------------------------------------------------------------

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
    """Values (n_units, P, n_features) of squared length 1 over the units; 0 where none vary."""
    values = values - values.mean(axis=0) if centred else values
    length = np.sqrt(np.square(values).sum(axis=0))
    varies = length > _VARIES * length.max(axis=0)
    return np.where(varies, values / np.where(varies, length, 1), 0)


def enhanced(deviates):
    """Threshold-free cluster enhancement along the frames, with signs: the shape of ``deviates``.

    The sum, over heights h below a value, of ``extent^0.5 h^2``; the extent is the number of frames
    around it that are above h.
    """
    n, n_frames, n_features = deviates.shape
    # A column for each curve and sign.
    both = np.concatenate([deviates, -deviates]).astype(np.float32)
    curves = both.transpose(1, 0, 2).reshape(n_frames, -1)
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
        for here, out in zip(above, extent, strict=True):
            run = np.multiply(run + 1, here, out=out)
        for here, out in zip(above[::-1], extent[::-1], strict=True):
            run = np.multiply(np.maximum(run, out), here, out=out)
        total[:, columns] += extent**_EXTENT * (height**_HEIGHT * _STEP)
    higher, lower = total.reshape(n_frames, 2, n, n_features).transpose(1, 2, 0, 3)
    return higher - lower


class Family:
    """The permutation distribution of the largest enhanced value of some curves.

    Attributes
    ----------
    found : ndarray, shape (P, n_features)
        Enhanced values of the design itself, with signs.
    largest : ndarray, shape (1 + n_permutations,)
        The largest absolute value of each draw, that of the design first.
    ranks : ndarray, shape (1 + n_permutations,)
        The share of draws that are at least as large.
    """

    def __init__(self, design, values, draws):
        units, largest = scaled(values, not design.flips), []
        for start in range(0, len(draws), _BATCH):
            maps = enhanced(design.deviates(draws[start : start + _BATCH], units))
            if start == 0:
                self.found = maps[0]
            largest.append(np.abs(maps).max(axis=(1, 2)))
        self.largest = np.concatenate(largest)
        self.ranks = self.shares(self.largest)

    @property
    def p_value(self):
        """Of the largest value of all."""
        return float(self.ranks[0])

    def shares(self, values):
        """The share of draws whose largest value is at least as large as each value."""
        ordered = np.sort(self.largest)
        below = ordered.searchsorted(np.asarray(values) * (1 - _ROUNDING))
        return (len(ordered) - below) / len(ordered)


# -- the result ----------------------------------------------------------------------------


@dataclass(frozen=True, eq=False)
class GroupComparison:
    """What `compare_groups` found.

    Parameters
    ----------
    p_joint : float
        That shape and timing together differ so much by chance.
    p_shape, p_timing : float
        The same of the aligned curves alone, and of the offsets alone.
    p_linear : float
        The same of the curves after linear normalisation, without any warp, for comparison.
    clusters : DataFrame
        Where: one row a stretch of frames with p at most ``level``, the smallest p first.
        ``what``, "shape" or "timing"; ``feature``; ``start``, ``end`` and ``peak``, in the unit;
        ``p``, corrected over all frames, all features, and both of shape and timing;
        ``direction``; ``size``, the mean difference there, in the unit of the signal or of the
        offsets, with the ``lower`` and ``upper`` end of its interval of 95 %.
    n_units : int
        People, or trials without ``people``.
    level : float
        As given.
    design : str
        What was compared, in words.
    unit : str
        Of start, end, peak, and of the sizes of timing.

    Examples
    --------
    >>> import numpy as np
    >>> from sklearn_motionsync import LinearSynchronizer, compare_groups
    >>> rng, t = np.random.default_rng(0), np.linspace(0, 1, 50)
    >>> low = [np.sin(3 * t) + rng.normal(0, 0.1) for _ in range(8)]
    >>> high = [x + 0.3 * t for x in low]
    >>> X = np.array(low + high)[:, :, np.newaxis]
    >>> sync = LinearSynchronizer(50).fit(X)
    >>> found = compare_groups(sync, X, ["before"] * 8 + ["after"] * 8)
    >>> found.clusters["direction"].tolist()
    ['after above before']
    """

    p_joint: float
    p_shape: float
    p_timing: float
    p_linear: float
    clusters: pd.DataFrame
    n_units: int
    level: float
    design: str
    unit: str

    def __repr__(self):
        return f"GroupComparison({self.describe()!r})"

    def to_frame(self) -> pd.DataFrame:
        """The four p-values as a table.

        Returns
        -------
        DataFrame
            Columns ``p`` and ``differs``, rows joint, shape, timing and linear.
        """
        names = ["joint", "shape", "timing", "linear"]
        p = np.array([self.p_joint, self.p_shape, self.p_timing, self.p_linear])
        index = pd.Index(names, name="test")
        return pd.DataFrame({"p": p, "differs": p <= self.level}, index=index)

    def describe(self) -> str:
        """The answer in one sentence.

        Returns
        -------
        str
            What was compared, whether it differs, and three p-values.
        """
        found = self.clusters["what"].unique().tolist() if self.p_joint <= self.level else []
        answer = {
            (): "no difference is found",
            ("shape",): "they differ in shape",
            ("timing",): "they differ in timing",
        }.get(tuple(sorted(found)), "they differ in shape and timing")
        values = f"joint p = {self.p_joint:.3f}, shape {self.p_shape:.3f}"
        return f"{self.design}: {answer} ({values}, timing {self.p_timing:.3f})."


# -- the function --------------------------------------------------------------------------


def compare_groups(
    estimator: BaseEstimator,
    X: PerformancesLike,
    groups: Labels | None = None,
    *,
    covariate: ValuesLike | None = None,
    people: Labels | None = None,
    paired: bool = False,
    signals: PerformancesLike | None = None,
    features: Features | None = None,
    level: float = 0.05,
    n_permutations: int = 1999,
    unit: Literal["percent", "frames"] = "percent",
    random_state: RandomState = 0,
    **params: Any,
) -> GroupComparison:
    """Test whether groups differ in the shape of their curves, in their timing, and where.

    All trials are on the clock of one template. The aligned curves hold the shape, the offsets the
    timing. Both are tested together and apart, by permutations of people.

    Parameters
    ----------
    estimator : synchronizer, or Pipeline with one
        Fitted on the trials of all groups together, so that no group has a template of its own.
    X : performances
        As the estimator takes them.
    groups : sequence of length n_sequences, default=None
        The group of each performance: two or more.
    covariate : array-like of numbers, shape (n_sequences,), default=None
        Such as speed or age, instead of groups: a regression.
    people : sequence of length n_sequences, default=None
        The subject of each performance. The mean of the trials of a person, in a group, is one
        unit. By default every performance is of another person.
    paired : bool, default=False
        Whether every person has trials in both of two groups, such as before and after.
    signals : performances, default=None
        What is compared, such as joint angles in degrees: one sequence a performance, at any frame
        rate. By default the features that reach the synchronizer, in their unit.
    features : int, str or list of them, default=None
        Those of the signals that are compared; by default all.
    level : float, default=0.05
        Level of the tests, of all answers together.
    n_permutations : int, default=1999
        Number of random permutations, or of flips of signs if paired.
    unit : {"percent", "frames"}, default="percent"
        Of places and offsets.
    random_state : int, RandomState instance or None, default=0
        Draws the permutations.
    **params : dict
        What synchronizing X takes besides, such as ``keyframes``.

    Returns
    -------
    GroupComparison
        Four p-values, and a table of where, what and how much.

    Raises
    ------
    ValueError
        If there are neither groups nor a covariate, or both; too few people; people in several
        groups without ``paired``, or with it in one only; gaps; no such unit or feature.

    See Also
    --------
    TimingChannel : Curves and offsets for a test or a model of your own.

    Notes
    -----
    1. Values at every frame are compared by t, or F of several groups, and become standard normal
       deviates z of the same tail probability. So features and offsets count alike.
    2. Neighbouring frames add up by threshold-free cluster enhancement (Smith and Nichols,
       *NeuroImage* 44, 2009): the sum over heights h below z of ``extent^0.5 h^2``.
    3. The largest value over all frames and features, in each permutation, gives p of shape; over
       all frames of the offset, p of timing. The smaller of both, in each permutation, gives the
       joint p (Tippett). Clusters are corrected by it.

    Frames at which nothing varies do not count, such as both ends of the offset.
    Offsets depend on the features that were matched. A difference in the shape of all
    of them may move warps, and one in timing that no warp can follow stays in the curves.

    Examples
    --------
    Group B pushes off later, by 5 % of the gait cycle.

    >>> from sklearn_motionsync import DenseSynchronizer, compare_groups
    >>> from sklearn_motionsync.datasets import make_gait
    >>> gait = make_gait(16, timing=5, random_state=0)
    >>> sync = DenseSynchronizer(n_frames=101).fit(gait.data)
    >>> found = compare_groups(sync, gait.data, gait.group, people=gait.person, n_permutations=499)
    >>> found.to_frame()["differs"].tolist()  # joint, shape, timing, linear
    [True, False, True, True]
    >>> found.clusters[["what", "direction"]].drop_duplicates().values.tolist()
    [['timing', 'B later than A']]
    """
    _check_numbers(level, n_permutations, unit)
    reached = route_to_synchronizer(estimator, X, params, "compare_groups")
    match, n, last = reached.match(), len(reached.performances), reached.synchronizer.n_frames_ - 1
    names, given = _signals(reached, signals, features)
    study = Study.of(groups, covariate, people, paired, n)
    scale = 100 / last if unit == "percent" else 1.0
    curves, offsets = match.warp(given), scale * match.offsets[:, :, np.newaxis]
    even = match_of_times(np.tile(np.arange(last + 1.0), (n, 1)), n).warp(given)
    curves, offsets, even = map(study.units, (curves, offsets, even))
    rng, design = check_random_state(random_state), study.design
    draws = np.stack([design.rows, *(design.permuted(rng) for _ in range(n_permutations))])
    shape, timing, linear = (Family(design, x, draws) for x in (curves, offsets, even))
    least = np.minimum(shape.ranks, timing.ranks)
    rows = [
        *_clusters("shape", shape, curves, names, study, least, level),
        *_clusters("timing", timing, offsets, ["offset"], study, least, level),
    ]
    table = pd.DataFrame(rows, columns=_COLUMNS).sort_values("p", kind="stable", ignore_index=True)
    table[["start", "end", "peak"]] *= scale
    return GroupComparison(
        p_joint=float(_share_at_most(least, least[0])),
        p_shape=shape.p_value,
        p_timing=timing.p_value,
        p_linear=linear.p_value,
        clusters=table,
        n_units=len(design.rows),
        level=float(level),
        design=study.words,
        unit=unit,
    )


_COLUMNS = ["what", "feature", "start", "end", "peak", "p", "direction", "size", "lower", "upper"]


def _clusters(what, family, values, names, study, least, level):
    """Rows of the table: stretches of frames with a corrected p of the level at most."""
    # The share of permutations in which shape or timing has a p as small.
    p = _share_at_most(least, family.shares(np.abs(family.found)))
    for k, feature in enumerate(names):
        edges = np.flatnonzero(np.diff(p[:, k] <= level, prepend=False, append=False))
        for first, end in edges.reshape(-1, 2).tolist():
            here = slice(first, end)
            peak = first + int(np.abs(family.found[here, k]).argmax())
            size = study.size(values[:, here, k].mean(axis=1), what)
            yield [what, feature, first, end - 1, peak, p[here, k].min(), *size]


def _share_at_most(draws, values):
    """The share of draws that are at most as large as each value."""
    ordered = np.sort(draws)
    return ordered.searchsorted(np.asarray(values) + _ROUNDING, "right") / len(ordered)


def _signals(reached, signals, features):
    """Names of the chosen features, and arrays (n_frames_i, n_chosen) of every performance."""
    if signals is None:
        given = reached.performances
        names = names_of_features(reached.before, reached.synchronizer, given[0].shape[1])
    else:
        given, names = read_collection(signals)
        n = len(reached.performances)
        if len(given) != n:
            raise ValueError(
                f"signals must have one sequence for each of {counted(n, 'performance')}, got "
                f"{len(given)}."
            )
        names = names or [f"x{i}" for i in range(given[0].shape[1])]
    chosen = choose_features(features, names)
    names = [names[i] for i in chosen]
    given = [x[:, chosen] for x in given]
    for i, x in enumerate(given):
        check_finite(x, f"Performance {i}, frame", names)
    return names, given


def _check_numbers(level, n_permutations, unit):
    is_number = isinstance(level, Real) and not isinstance(level, bool)
    if not (is_number and 0 < level < 1):
        raise ValueError(f"level must be a number between 0 and 1, such as 0.05; got {level!r}.")
    is_whole = isinstance(n_permutations, Integral) and not isinstance(n_permutations, bool)
    if not (is_whole and n_permutations >= 1 / level - 1):
        raise ValueError(
            f"n_permutations must be a whole number of at least {1 / level - 1:.0f} at this level, "
            f"such as 1999; got {n_permutations!r}."
        )
    if unit not in ("percent", "frames"):
        raise ValueError(f"unit must be 'percent' or 'frames', got {unit!r}.")


# -- the design of a study -----------------------------------------------------------------

# Fewest units: people, or trials without people.
_FEWEST = 4


@dataclass(frozen=True, eq=False)
class Study:
    """What differs between units, how they are made of performances, and what a size is.

    Attributes
    ----------
    design : Design
    maker : ndarray, shape (n_units, n_sequences)
        The values of a unit are this matrix times those of the performances: a mean, a difference
        of means, or a slope.
    groups : ndarray of int, shape (n_units,), or None
        Of each unit, if units are of several groups.
    covariate : ndarray, shape (n_units,), or None
        Of each unit, if units differ in it.
    labels : list of str
        Of the groups.
    words : str
    """

    design: Design
    maker: np.ndarray
    groups: np.ndarray | None
    covariate: np.ndarray | None
    labels: list
    words: str

    def units(self, values):
        """Values (n_units, ...) of those of the performances."""
        return np.tensordot(self.maker, values.astype(np.float64, copy=False), 1)

    @classmethod
    def of(cls, groups, covariate, people, paired, n):
        """The study of groups or of a covariate."""
        if (groups is None) == (covariate is None):
            raise ValueError("Give either groups or a covariate.")
        persons, _ = encode_groups(people, n, name="people", at_least=2)
        if covariate is not None:
            if paired:
                raise ValueError("paired=True needs two groups, not a covariate.")
            return cls._of_covariate(_check_covariate(covariate, n), persons)
        codes, labels = encode_groups(groups, n, at_least=2)
        labels = [str(label) for label in labels]
        if paired:
            return cls._of_pairs(codes, labels, persons, people)
        for person in range(persons.max() + 1):
            if len(set(codes[persons == person])) > 1:
                raise ValueError(
                    f"people: {people[int(np.argmax(persons == person))]!r} has trials in several "
                    "groups. Set paired=True for two groups with the same people; otherwise each "
                    "person belongs to one group."
                )
        maker = _means(persons)
        of_units = codes[_firsts(persons)]
        counts = np.bincount(of_units)
        if counts.min() < 2:
            of = ", ".join(f"{c} in {name!r}" for c, name in zip(counts, labels, strict=True))
            raise ValueError(f"At least two people a group are needed, got {of}.")
        columns = (of_units[:, np.newaxis] == np.arange(1, len(labels))).astype(float)
        words = f"{' and '.join(labels)}, {counted(len(of_units), 'unit')}"
        design = Design(columns - columns.mean(axis=0))
        return cls(design, maker, of_units, None, labels, words)

    @classmethod
    def _of_pairs(cls, codes, labels, persons, people):
        """Differences between the second and the first group, person by person."""
        if people is None or len(labels) != 2:
            raise ValueError(
                f"paired=True needs people and two groups, got {counted(len(labels), 'group')}"
                f"{'' if people is not None else ' and no people'}."
            )
        makers = [_means(persons, codes == k) for k in (0, 1)]
        for maker, label in zip(makers, labels, strict=True):
            missing = np.flatnonzero(~maker.any(axis=1))
            if len(missing):
                name = people[int(np.argmax(persons == missing[0]))]
                raise ValueError(
                    f"people: {name!r} has no trial in group {label!r}: leave them out."
                )
        maker = makers[1] - makers[0]
        _check_units(len(maker))
        words = f"{labels[1]} less {labels[0]}, {len(maker)} people"
        return cls(Design(np.ones((len(maker), 1)), flips=True), maker, None, None, labels, words)

    @classmethod
    def _of_covariate(cls, covariate, persons):
        """A regression on what differs between people, or slopes of what differs within them."""
        maker = _means(persons)
        of_units = maker @ covariate
        within = covariate - of_units[persons]
        if np.abs(within).max() <= _ROUNDING * np.ptp(covariate):
            _check_units(len(maker))
            design = Design((of_units - of_units.mean())[:, np.newaxis])
            words = f"Regression, {counted(len(maker), 'unit')}"
            return cls(design, maker, None, of_units, [], words)
        squares = np.bincount(persons, within**2)
        slopes = np.where(persons == np.arange(len(maker))[:, np.newaxis], within, 0)
        varies = squares > 0
        maker = slopes[varies] / squares[varies, np.newaxis]
        _check_units(len(maker))
        design = Design(np.ones((len(maker), 1)), flips=True)
        words = f"Regression within {len(maker)} people"
        return cls(design, maker, None, None, [], words)

    def size(self, values, what):
        """Direction in words, size, and its interval of 95 %, of one value a unit."""
        if self.covariate is not None:
            line = linregress(self.covariate, values)
            return self._interval(line.slope, line.stderr, len(values) - 2, what, [])
        if self.groups is None:
            n = len(values)
            error = values.std(ddof=1) / np.sqrt(n)
            return self._interval(values.mean(), error, n - 1, what, self.labels)
        means = [values[self.groups == k].mean() for k in range(len(self.labels))]
        low, high = (0, 1) if len(means) == 2 else (int(np.argmin(means)), int(np.argmax(means)))
        a, b = (values[self.groups == k] for k in (low, high))
        # Welch's test, for groups that vary differently.
        shares = np.array([x.var(ddof=1) / len(x) for x in (a, b)])
        degrees = np.sum(shares**2 / [len(a) - 1, len(b) - 1])
        left = shares.sum() ** 2 / degrees if degrees > 0 else len(a) + len(b) - 2
        labels = [self.labels[low], self.labels[high]]
        return self._interval(b.mean() - a.mean(), np.sqrt(shares.sum()), left, what, labels)

    def _interval(self, size, error, left, what, labels):
        half = student.ppf(0.975, left) * error
        higher = "later" if what == "timing" else "above" if labels else "higher"
        lower = "earlier" if what == "timing" else "below" if labels else "lower"
        word = higher if size > 0 else lower
        if not labels:
            direction = f"{word} with the covariate"
        else:
            than = " than" if what == "timing" else ""
            direction = f"{labels[1]} {word}{than} {labels[0]}"
        return direction, size, size - half, size + half


def _means(persons, some=None):
    """The matrix whose product with values is the mean of each person, (n_people, n_sequences)."""
    own = persons == np.arange(persons.max() + 1)[:, np.newaxis]
    own = own if some is None else own & some
    return own / np.maximum(own.sum(axis=1, keepdims=True), 1)


def _firsts(persons):
    """The index of the first performance of each person."""
    return np.unique(persons, return_index=True)[1]


def _check_units(n):
    if n < _FEWEST:
        raise ValueError(f"At least {_FEWEST} people are needed, got {n}.")


def _check_covariate(covariate, n):
    values = as_numbers(covariate, "covariate", dtype=np.float64)
    if values.shape != (n,):
        raise ValueError(
            f"covariate must have one number for each of {counted(n, 'performance')}, got shape "
            f"{values.shape}."
        )
    if not np.isfinite(values).all() or np.ptp(values) == 0:
        raise ValueError("covariate must be finite, and must differ between performances.")
    return values
