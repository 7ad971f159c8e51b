"""The design of a study: what differs between its units, and how trials make them."""

from __future__ import annotations

import math
from collections import Counter
from dataclasses import dataclass

import numpy as np
from scipy.stats import linregress
from scipy.stats import t as student

from ..inputs.numbers import as_numbers
from ..inputs.wording import counted
from ..matching.counting import first_largest, first_smallest
from ..utils.groups import encode_groups
from .permutation import Design

__all__ = ["GroupsOfPeople", "Study", "band_of_mean"]

# Fewest units: people, or trials without people.
_FEWEST = 4
# Rounding of a covariate that is equal within people, as a share of its range.
_ROUNDING = 1e-9


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
        """Values (n_units, ...) of those of the performances; NaN where one of these is."""
        missing = np.isnan(values)
        of_units = np.tensordot(self.maker, np.where(missing, 0.0, values), 1)
        if missing.any():
            of_units[np.tensordot(self.maker != 0, missing, 1) > 0] = np.nan
        return of_units

    @classmethod
    def of(cls, groups, covariate, people, paired, n):
        """The study of groups or of a covariate."""
        if (groups is None) == (covariate is None):
            raise ValueError("Give either groups or a covariate.")
        persons, names = encode_groups(people, n, name="people", at_least=2)
        if covariate is not None:
            if paired:
                raise ValueError("paired=True needs two groups, not a covariate.")
            return cls._of_covariate(_check_covariate(covariate, n), persons)
        codes, labels = encode_groups(groups, n, at_least=2)
        labels = [str(label) for label in labels]
        if paired:
            return cls._of_pairs(codes, labels, persons, None if people is None else names)
        for person in range(persons.max() + 1):
            if len(set(codes[persons == person])) > 1:
                raise ValueError(
                    f"people: {names[person]!r} has trials in several "
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
        listed = f"{', '.join(labels[:-1])} and {labels[-1]}"
        words = f"{listed}, {counted(len(of_units), 'unit')}"
        design = Design(columns - columns.mean(axis=0))
        return cls(design, maker, of_units, None, labels, words)

    @classmethod
    def _of_pairs(cls, codes, labels, persons, names):
        """Differences between the second and the first group, person by person."""
        if names is None or len(labels) != 2:
            raise ValueError(
                f"paired=True needs people and two groups, got {counted(len(labels), 'group')}"
                f"{'' if names is not None else ' and no people'}."
            )
        makers = [_means(persons, codes == k) for k in (0, 1)]
        for maker, label in zip(makers, labels, strict=True):
            missing = np.flatnonzero(~maker.any(axis=1))
            if len(missing):
                name = names[missing[0]]
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

    @property
    def smallest_p(self):
        """The share of the arrangements of units that differ as much as the most extreme one.

        With both signs flipped, with groups of one size exchanged, and with a symmetric covariate
        reversed, units differ as much.
        """
        n = len(self.maker)
        if self.design.flips:
            return 2 / 2**n
        if self.groups is not None:
            sizes = np.bincount(self.groups).tolist()
            alike = math.prod(map(math.factorial, Counter(sizes).values()))
        else:
            values = np.sort(self.covariate)
            sizes = np.unique(values, return_counts=True)[1].tolist()
            is_symmetric = np.allclose(values + values[::-1], values[0] + values[-1])
            alike = 2 if is_symmetric else 1
        return alike * math.prod(map(math.factorial, sizes)) / math.factorial(n)

    def size(self, values, what):
        """Direction in words, size, and its interval of 95 %, of a value a unit; NaN is unknown."""
        is_known = ~np.isnan(values)
        values = values[is_known]
        if self.covariate is not None:
            line = linregress(self.covariate[is_known], values)
            return self._interval(line.slope, line.stderr, len(values) - 2, what, [])
        if self.groups is None:
            n = len(values)
            error = values.std(ddof=1) / np.sqrt(n)
            return self._interval(values.mean(), error, n - 1, what, self.labels)
        of_groups = [values[self.groups[is_known] == k] for k in range(len(self.labels))]
        means = [x.mean() for x in of_groups]
        low, high = (0, 1) if len(means) == 2 else (first_smallest(means), first_largest(means))
        a, b = of_groups[low], of_groups[high]
        # Welch's test, for groups that vary differently.
        shares = np.array([x.var(ddof=1) / len(x) for x in (a, b)])
        degrees = np.sum(shares**2 / [len(a) - 1, len(b) - 1])
        freedom = shares.sum() ** 2 / degrees if degrees > 0 else len(a) + len(b) - 2
        labels = [self.labels[low], self.labels[high]]
        return self._interval(b.mean() - a.mean(), np.sqrt(shares.sum()), freedom, what, labels)

    def _interval(self, size, error, freedom, what, labels):
        half = student.ppf(0.975, freedom) * error
        higher = "later" if what == "timing" else "above" if labels else "higher"
        lower = "earlier" if what == "timing" else "below" if labels else "lower"
        word = higher if size > 0 else lower
        if not labels:
            direction = f"{word} with the covariate"
        else:
            than = " than" if what == "timing" else ""
            direction = f"{labels[1]} {word}{than} {labels[0]}"
        return direction, size, size - half, size + half


@dataclass(frozen=True, eq=False)
class GroupsOfPeople:
    """The means of people in each group, such as for a figure or a table.

    Attributes
    ----------
    labels : list of str
        Of the groups; without groups one, empty.
    makers : list of ndarray, shape (n_people_k, n_sequences)
        For each group, the matrix whose product with values is the mean of each of its people.
    people : list of ndarray of int
        For each group, the codes of its people.
    counts : list of int
        Performances of each group.
    """

    labels: list
    makers: list
    people: list
    counts: list

    @classmethod
    def of(cls, groups, people, n):
        """Those of n performances; without people, every performance is of another person."""
        codes, labels = encode_groups(groups, n)
        if groups is None:
            codes, labels = np.zeros(n, dtype=int), [""]
        persons, _ = encode_groups(people, n, name="people")
        makers, members_of, counts = [], [], []
        for k in range(len(labels)):
            means = _means(persons, codes == k)
            members = np.flatnonzero(means.any(axis=1))
            makers.append(means[members])
            members_of.append(members)
            counts.append(int((codes == k).sum()))
        return cls([str(label) for label in labels], makers, members_of, counts)

    @property
    def are_pairs(self):
        """Whether all groups have the same people, and there are several."""
        return len(self.people) > 1 and all(
            np.array_equal(people, self.people[0]) for people in self.people
        )

    def describe(self, named):
        """The entry of each group in a legend; whether people are named."""
        entries = []
        for label, count, people in zip(self.labels, self.counts, self.people, strict=True):
            text = counted(count, "trial")
            if named:
                text += f" of {len(people)} {'person' if len(people) == 1 else 'people'}"
            entries.append(f"{label}: {text}" if label else text)
        return entries

    def means(self, values):
        """Means (n_people_k, ...) of people in each group, of the known values of performances."""
        is_known = ~np.isnan(values)
        means = []
        for maker in self.makers:
            weights = np.tensordot(maker, is_known.astype(float), 1)
            sums = np.tensordot(maker, np.where(is_known, values, 0.0), 1)
            means.append(np.where(weights > 0, sums / np.where(weights > 0, weights, 1), np.nan))
        return means

    def fill(self, values):
        """Values of performances, those that are not known by the mean of the same person."""
        filled = np.array(values, dtype=float)
        for maker, means in zip(self.makers, self.means(values), strict=True):
            for row, mean in zip(maker > 0, means, strict=True):
                filled[row] = np.where(np.isnan(filled[row]), mean, filled[row])
        return filled


def band_of_mean(values, statistic, coverage):
    """Mean and half-width of a band, over the first axis.

    Parameters
    ----------
    values : ndarray, shape (n_people, ...)
    statistic : {"sd", "se", "interval"}
        Standard deviation, standard error, or the interval of the mean by t.
    coverage : float
        Of the interval.
    """
    n = len(values)
    if n < 2:
        return values.mean(axis=0), np.full(values.shape[1:], np.nan)
    spread = values.std(axis=0, ddof=1)
    if statistic != "sd":
        spread = spread / np.sqrt(n)
    if statistic == "interval":
        spread = spread * student.ppf((1 + coverage) / 2, n - 1)
    return values.mean(axis=0), spread


def _means(persons, some=None):
    """The matrix whose product with values is the mean of each person, (n_people, n_sequences)."""
    belongs = persons == np.arange(persons.max() + 1)[:, np.newaxis]
    belongs = belongs if some is None else belongs & some
    return belongs / np.maximum(belongs.sum(axis=1, keepdims=True), 1)


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
