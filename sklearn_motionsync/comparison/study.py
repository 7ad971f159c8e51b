"""The design of a study: what differs between its units, and how trials make them."""

from __future__ import annotations

import warnings
from dataclasses import dataclass
from itertools import combinations
from typing import NamedTuple

import numpy as np
from scipy.stats import f as fisher
from scipy.stats import t as student

from ..inputs.numbers import as_numbers
from ..inputs.wording import counted
from ..matching.counting import first_largest, first_smallest
from ..utils.groups import encode_groups, refuse_classes_as_people
from .permutations import LEAST_FACTOR, Design, GroupDesign

# Fewest units: people, or trials without people.
_FEWEST = 4
# A covariate that differs within people by less than this share of its spread between them is one
# of people; and people in whom it differs by less than this share of what is usual have no slope.
OF_PEOPLE = 0.1
# From so large a ratio of variances on, the answer tells it.
_UNEQUAL = 2.0


class Change(NamedTuple):
    """A difference between two levels of what is compared, or a slope.

    Attributes
    ----------
    labels : list of str
        Of the first and the second level; of a slope, what it is along.
    prefix : str, default=""
        What differences are compared, if these are no values as they are.
    levels : tuple of int, default=(0, 1)
        The two groups of units, if groups are compared.
    columns : ndarray, shape (n_columns,), default=None
        Else the change of the columns of the model.
    """

    labels: list
    prefix: str = ""
    levels: tuple = (0, 1)
    columns: np.ndarray | None = None

    @property
    def name(self):
        """In words, such as "B less A"."""
        words = " less ".join(self.labels[::-1])
        words = words if len(self.labels) > 1 else f"slope with {words}"
        return f"{self.prefix}: {words}" if self.prefix else words

    def direction(self, size, what):
        """In words, such as "B above A"."""
        slope = len(self.labels) == 1
        higher = "later" if what == "timing" else "higher" if slope else "above"
        lower = "earlier" if what == "timing" else "lower" if slope else "below"
        word = higher if size > 0 else lower
        than = " than" if what == "timing" else ""
        first, *second = self.labels
        words = f"{word} with {first}" if slope else f"{second[0]} {word}{than} {first}"
        return f"{self.prefix}: {words}" if self.prefix else words


def changes_of_groups(labels, prefix=""):
    """The `Change` between each two groups."""
    pairs = combinations(range(len(labels)), 2)
    return [Change([labels[low], labels[high]], prefix, (low, high)) for low, high in pairs]


@dataclass(frozen=True, eq=False)
class Study:
    """What differs between units, how they are made of trials, and what a size is.

    Attributes
    ----------
    design : Design
    makers : ndarray, shape (n_contrasts, n_units, n_sequences)
        The values of a unit are such a matrix times those of the trials: a mean, a difference
        of means, or a slope. Of several conditions there is a contrast for each two.
    changes : list of list of Change
        Of each contrast, what is compared.
    words : str
    groups : ndarray of int, shape (n_units,), or None
        Of each unit, if groups of units are compared that may vary differently.
    model : ndarray, shape (n_units, n_columns), or None
        Else sizes are by least squares, with these columns.
    """

    design: Design
    makers: np.ndarray
    changes: list
    words: str
    groups: np.ndarray | None = None
    model: np.ndarray | None = None

    def units(self, values):
        """Values (n_units, P, n_contrasts * n_features) of those (n_sequences, P, n_features).

        NaN where one of these is.
        """
        missing = np.isnan(values)
        of_units = self._stacked(np.tensordot(self.makers, np.nan_to_num(values), 1))
        if missing.any():
            of_units[self._stacked(np.tensordot(self.makers != 0, missing, 1)) > 0] = np.nan
        return of_units

    def _stacked(self, products):
        """Contrasts (n_contrasts, n_units, P, n_features) one behind the other."""
        _, n_units, n_frames, _ = products.shape
        return np.moveaxis(products, 0, 2).reshape(n_units, n_frames, -1)

    @classmethod
    def of(cls, y, groups, *, covariate, paired, n):
        """The study of groups of trials ``y`` or of a covariate ``y``, of the people ``groups``."""
        if y is None:
            raise ValueError(
                "y is needed: the group of each trial, or a number for each with covariate=True."
            )
        persons, names = encode_groups(groups, n, at_least=2)
        if covariate:
            if paired:
                raise ValueError("paired=True needs two groups of trials, not a covariate.")
            return cls._of_covariate(check_covariate(y, n), persons, groups is not None)
        _refuse_measures(y)
        codes, labels = encode_groups(y, n, name="y", at_least=2)
        if groups is not None:
            refuse_classes_as_people(codes, persons)
        labels = [str(label) for label in labels]
        if paired:
            return cls._of_pairs(codes, labels, persons, None if groups is None else names)
        for person, name in enumerate(names):
            if len(set(codes[persons == person])) > 1:
                raise ValueError(
                    f"groups: {name!r} has trials of several labels in y. Set paired=True "
                    "for two labels with the same people; otherwise each person has one label."
                )
        maker = means_of_people(persons)
        of_units = codes[_firsts(persons)]
        check_people(of_units, labels)
        listed = f"{', '.join(labels[:-1])} and {labels[-1]}"
        words = f"{listed}, {_count_units(len(of_units), n, groups is not None)}"
        changes = [changes_of_groups(labels)]
        return cls(GroupDesign(of_units), maker[np.newaxis], changes, words, of_units)

    @classmethod
    def _of_pairs(cls, codes, labels, persons, names):
        """Differences between the second and the first group, person by person."""
        if names is None or len(labels) != 2:
            raise ValueError(
                f"paired=True needs two labels in y, got {len(labels)}, and groups=, whose the "
                f"trials are{'' if names is not None else ', which are missing'}. Of more "
                "conditions use compare_effects."
            )
        makers = [means_of_people(persons, codes == k) for k in (0, 1)]
        for maker, label in zip(makers, labels, strict=True):
            missing = np.flatnonzero(~maker.any(axis=1))
            if len(missing):
                name = names[missing[0]]
                raise ValueError(
                    f"groups: {name!r} has no trial of {label!r} in y: leave them out."
                )
        maker = makers[1] - makers[0]
        words = f"{labels[1]} less {labels[0]}, {len(maker)} people"
        return cls.of_differences(maker[np.newaxis], [Change(labels)], words)

    @classmethod
    def of_differences(cls, makers, changes, words):
        """Differences or slopes of people, one a contrast, whose mean is compared with 0."""
        ones = np.ones((makers.shape[1], 1))
        check_units(len(ones))
        changes = [[change._replace(columns=np.ones(1))] for change in changes]
        return cls(Design(ones, flips=True), makers, changes, words, model=ones)

    @classmethod
    def _of_covariate(cls, covariate, persons, named):
        """A regression on what differs between people, or slopes of what differs within them."""
        maker = means_of_people(persons)
        of_units = maker @ covariate
        within = covariate - of_units[persons]
        spread, between = np.sqrt(np.square(within).mean()), of_units.std()
        if spread <= OF_PEOPLE * between:
            check_units(len(maker))
            centred = (of_units - of_units.mean())[:, np.newaxis]
            words = f"Regression, {_count_units(len(maker), len(covariate), named)}"
            changes = [[Change(["the covariate"], columns=np.array([0.0, 1.0]))]]
            model = np.hstack([np.ones((len(maker), 1)), centred])
            return cls(Design(centred), maker[np.newaxis], changes, words, model=model)
        if spread < between:
            warnings.warn(
                f"y differs by {spread:.3g} within people, and by {between:.3g} between them. "
                "Slopes within people are tested, and differences between people do not count. To "
                "test these, give all trials of a person the same number, such as the mean.",
                UserWarning,
                stacklevel=4,
            )
        squares = np.bincount(persons, within**2)
        slopes = np.where(persons == np.arange(len(maker))[:, np.newaxis], within, 0)
        varies = squares > np.square(OF_PEOPLE * spread) * np.bincount(persons)
        maker = slopes[varies] / squares[varies, np.newaxis]
        words = f"Regression within {len(maker)} people"
        return cls.of_differences(maker[np.newaxis], [Change(["the covariate"])], words)

    def spread(self, values):
        """In words, if the variance of one group is twice that of another, and not by chance.

        ``values`` (n_units, P, n_columns) count by their variance over all groups.
        """
        if self.groups is None:
            return ""
        variances = np.array(
            [values[self.groups == k].var(axis=0, ddof=1) for k in np.unique(self.groups)]
        )
        whole = variances.mean(axis=0)
        shares = np.divide(variances, whole, out=np.ones_like(variances), where=whole > 0)
        of_groups = shares.mean(axis=(1, 2))
        low, high = first_smallest(of_groups), first_largest(of_groups)
        ratio = of_groups[high] / max(of_groups[low], LEAST_FACTOR)
        freedom = np.bincount(self.groups)[[high, low]] - 1
        if ratio < max(_UNEQUAL, fisher.isf(0.025, *freedom)):
            return ""
        change = next(x for x in self.changes[0] if {*x.levels} == {low, high})
        labels = dict(zip(change.levels, change.labels, strict=True))
        return f", variance of {labels[high]} {ratio:.2g} times that of {labels[low]}"

    def size(self, values, what, contrast=0, scale=None):
        """Direction in words, size, and its interval of 95 %, of a value a unit; NaN is unknown.

        Of several changes, the largest.
        """
        changes = self.changes[contrast]
        found = [self.change(values, change, scale) for change in changes]
        k = first_largest([abs(size) for size, *_ in found])
        change, (size, error, freedom) = changes[k], map(float, found[k])
        if len(changes) > 1 and size < 0:
            change, size = change._replace(labels=change.labels[::-1]), -size
        half = float(student.ppf(0.975, freedom) * error)
        return change.direction(size, what), size, size - half, size + half

    def change(self, values, change, scale=None):
        """The size of a change, its standard error and degrees of freedom.

        Parameters
        ----------
        values : ndarray, shape (n_units,) or (n_units, ...)
            NaN, which is unknown, of single values only.
        change : Change
        scale : ndarray, shape (n_units,), default=None
            Spread of the units, by which they are weighed.
        """
        is_known = ~np.isnan(values) if values.ndim == 1 else slice(None)
        values = values[is_known]
        if self.groups is not None:
            # Welch's test, for groups that vary differently.
            a, b = (values[self.groups[is_known] == k] for k in change.levels)
            shares = np.stack([x.var(axis=0, ddof=1) / len(x) for x in (a, b)])
            degrees = shares[0] ** 2 / (len(a) - 1) + shares[1] ** 2 / (len(b) - 1)
            total = shares.sum(axis=0)
            freedom = np.divide(
                total**2, degrees, out=np.full_like(degrees, np.inf), where=degrees > 0
            )
            return b.mean(axis=0) - a.mean(axis=0), np.sqrt(total), freedom
        weights = 1 / (np.ones(len(self.model)) if scale is None else scale)[is_known]
        values = (values.T * weights).T
        rows, triangle = np.linalg.qr(self.model[is_known] * weights[:, np.newaxis])
        influence = rows @ np.linalg.solve(triangle.T, change.columns)
        left = values - np.tensordot(rows, np.tensordot(rows.T, values, 1), 1)
        freedom = len(values) - rows.shape[1]
        error = np.sqrt(np.square(left).sum(axis=0) / freedom * (influence @ influence))
        return np.tensordot(influence, values, 1), error, freedom


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
        Trials of each group.
    """

    labels: list
    makers: list
    people: list
    counts: list

    @classmethod
    def of(cls, y, groups, n):
        """Those of n trials; without groups, every trial is of another person."""
        codes, labels = encode_groups(y, n, name="y")
        persons, _ = encode_groups(groups, n)
        if y is None:
            codes, labels = np.zeros(n, dtype=int), [""]
        elif groups is not None:
            refuse_classes_as_people(codes, persons)
        makers, members_of, counts = [], [], []
        for k in range(len(labels)):
            means = means_of_people(persons, codes == k)
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
        """Means (n_people_k, ...) of people in each group, of the known values of trials."""
        is_known = ~np.isnan(values)
        means = []
        for maker in self.makers:
            weights = np.tensordot(maker, is_known.astype(float), 1)
            sums = np.tensordot(maker, np.nan_to_num(values), 1)
            unknown = np.full(sums.shape, np.nan)
            means.append(np.divide(sums, weights, out=unknown, where=weights > 0))
        return means

    def fill(self, values):
        """Values of trials, those that are not known by the mean of the same person."""
        filled = np.array(values, dtype=float)
        for maker, means in zip(self.makers, self.means(values), strict=True):
            for row, mean in zip(maker > 0, means, strict=True):
                filled[row] = np.where(np.isnan(filled[row]), mean, filled[row])
        return filled


def means_of_people(persons, in_group=None):
    """The matrix whose product with values is the mean of each person, (n_people, n_sequences)."""
    belongs = persons == np.arange(persons.max() + 1)[:, np.newaxis]
    belongs = belongs if in_group is None else belongs & in_group
    return belongs / np.maximum(belongs.sum(axis=1, keepdims=True), 1)


def _firsts(persons):
    """The index of the first trial of each person."""
    return np.unique(persons, return_index=True)[1]


def _count_units(n, n_trials, named):
    """What differs: people, or trials of which each counts as a person."""
    if not named:
        return counted(n, "trial")
    return f"{n} people" + (" of one trial each" if n == n_trials else "")


def _refuse_measures(y):
    """Refuse numbers that are no labels."""
    values = np.asarray(y)
    if values.dtype.kind == "f" and np.any(values[np.isfinite(values)] % 1):
        raise ValueError(
            f"y has numbers such as {values[values % 1 != 0][0]:.6g}, which are no labels of "
            "groups. Set covariate=True for a regression on them, or give labels."
        )


def check_people(groups, labels):
    """Refuse groups of fewer than two people."""
    counts = np.bincount(groups)
    if counts.min() < 2:
        of = ", ".join(f"{c} in {name!r}" for c, name in zip(counts, labels, strict=True))
        raise ValueError(f"At least two people a group are needed, got {of}.")


def check_units(n):
    """Refuse too few people."""
    if n < _FEWEST:
        raise ValueError(f"At least {_FEWEST} people are needed, got {n}.")


def check_covariate(covariate, n, name="y"):
    """The numbers of trials, if they are finite and differ."""
    values = as_numbers(covariate, name, dtype=np.float64)
    if values.shape != (n,):
        raise ValueError(
            f"{name} must have one number for each of {counted(n, 'trial')}, got shape "
            f"{values.shape}."
        )
    if not np.isfinite(values).all() or np.ptp(values) == 0:
        raise ValueError(
            f"{name} must be finite, and must differ between trials, if it is a covariate."
        )
    return values
