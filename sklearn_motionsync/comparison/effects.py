"""compare_effects: each effect of a study with several factors, repeated conditions, covariates."""

from __future__ import annotations

from collections.abc import Mapping
from functools import reduce
from itertools import combinations, product
from math import prod
from typing import Any, NamedTuple

import numpy as np
import pandas as pd
from sklearn.base import BaseEstimator

from ..inputs.types import Features, Labels, NumbersLike, RandomState, TrialsLike, Unit
from ..inputs.wording import counted
from ..synchronizers.match import Match
from ..utils.groups import encode_groups
from .curves import AlignedCurves
from .groups import GroupComparison, compare_aligned
from .permutations import EffectDesign, GroupDesign, check_test
from .study import (
    OF_PEOPLE,
    Change,
    Study,
    changes_of_groups,
    check_covariate,
    check_people,
    check_units,
    means_of_people,
)


def compare_effects(
    estimator: BaseEstimator | Match,
    X: TrialsLike,
    data: pd.DataFrame | Mapping[str, Labels | NumbersLike],
    formula: str,
    *,
    groups: Labels | None = None,
    signals: TrialsLike | None = None,
    features: Features | None = None,
    level: float = 0.05,
    n_permutations: int = 1999,
    unit: Unit = "percent",
    random_state: RandomState = 0,
    n_jobs: int | None = None,
    verbose: int = 0,
    **params: Any,
) -> dict[str, GroupComparison]:
    """Test each effect of several factors, repeated conditions and covariates.

    As `compare_groups`, of which all that is not said here holds: shape and timing are tested
    together and apart, and people are the units.

    Parameters
    ----------
    estimator : synchronizer, Pipeline with one, or Match of X
        Fitted on all trials together.
    X : trials
        As the estimator takes them.
    data : DataFrame, or dict of columns
        One row a trial. Text, categories and truth values are factors, whose levels are in the
        order of the categories, or sorted; numbers are covariates. A factor that differs within
        people is a condition: every person needs trials of all combinations of conditions. A
        covariate is one of people, such as age.
    formula : str
        Names of columns, such as ``"group * condition + age"``: ``+`` adds effects, ``a:b`` is
        an interaction, and ``a * b`` both effects and their interaction.
    groups : sequence of length n_sequences, default=None
        The subject of each trial. By default every trial is of another person.
    signals, features : default=None
        What is compared, as for `compare_groups`.
    level : float, default=0.05
        Level of each effect.
    n_permutations : int, default=1999
        Number of random permutations, or of flips of signs.
    unit : {"percent", "frames", "seconds"}, default="percent"
        Of places and offsets.
    random_state : int, RandomState instance or None, default=0
        Draws the permutations.
    n_jobs : int, default=None
        Jobs that share the permutations, with the same result.
    verbose : int, default=0
        Above 0, print how far the permutations are, at most once a second.
    **params : dict
        What synchronizing X takes besides.

    Returns
    -------
    dict of str to GroupComparison
        By the effects, such as "group", "condition", "group:condition" and "age".

    Raises
    ------
    ValueError
        If the formula names no columns, or an interaction without its effects; if a person lacks
        a condition; if a covariate differs within people; if effects cannot be told apart; or as
        from `compare_groups`.

    See Also
    --------
    compare_groups : One factor, two conditions, or one covariate.

    Notes
    -----
    A person's trials become means of conditions. An effect of conditions is tested on the
    differences between each two of them, which count as signals of their own, so a cluster tells
    which two differ. The effects of people alone are on the means over the conditions, all
    conditions alike. What is exchanged under chance depends on the effect:

    - of conditions alone, the signs of the differences of a person, which are symmetric if no
      person has an effect, however people vary; tested is the mean over all people;
    - of one factor of people without other effects on the same values, people, as in
      `compare_groups`: groups may vary differently;
    - of all else, the signs of what the other effects leave of people, divided by the spread of
      their groups (De Santis and others, 2022).

    Effects of people are adjusted for each other, with groups that count alike, however many people
    they have (type III).

    Examples
    --------
    Group B pushes off later by 5 % of the cycle, and in new shoes all move by a fifth more:

    >>> from sklearn_motionsync import DenseSynchronizer
    >>> from sklearn_motionsync.comparison import compare_effects
    >>> from sklearn_motionsync.datasets import make_gait
    >>> gait = make_gait(16, timing=5, random_state=0)
    >>> data = {"group": gait.group, "shoe": ["old", "new", "old"] * 16}
    >>> new = [shoe == "new" for shoe in data["shoe"]]
    >>> X = [x * (1.2 if is_new else 1) for x, is_new in zip(gait.data, new)]
    >>> match = DenseSynchronizer(n_frames=101).fit(X).match(X)
    >>> effects = compare_effects(
    ...     match, X, data, "group * shoe", groups=gait.person, n_permutations=499
    ... )
    >>> for name, found in effects.items():
    ...     print(name, found.to_frame()["differs"].tolist())  # joint, shape, timing, linear
    group [True, False, True, True]
    shoe [True, True, False, True]
    group:shoe [False, False, False, False]
    """
    check_test(level, n_permutations)
    aligned = AlignedCurves.of(
        estimator, X, params, "compare_effects", signals=signals, features=features, unit=unit
    )
    return {
        name: compare_aligned(aligned, study, random_state, level, n_permutations, n_jobs, verbose)
        for name, study in studies_of(data, formula, groups, len(aligned.curves)).items()
    }


class Factor(NamedTuple):
    """A column of the data.

    Attributes
    ----------
    name : str
    labels : list of str
        Of its levels; empty for a covariate.
    of_trials : ndarray, shape (n_sequences,)
        Codes of the levels, or numbers.
    is_within : bool
        Whether it differs within people.
    """

    name: str
    labels: list
    of_trials: np.ndarray
    is_within: bool

    @classmethod
    def of(cls, name, column, persons):
        """A factor or covariate of trials, whose people are given by their codes."""
        values = pd.Series(column, name=name).reset_index(drop=True)
        if len(values) != len(persons):
            raise ValueError(
                f"data must have one row for each of {counted(len(persons), 'trial')}; its column "
                f"{name!r} has {len(values)}."
            )
        is_number = pd.api.types.is_numeric_dtype(values) and values.dtype.kind != "b"
        if not is_number:
            codes, labels = encode_groups(list(values), len(values), name=f"data[{name!r}]")
            if len(labels) < 2:
                raise ValueError(f"data: all trials have {labels[0]!r} in {name!r}.")
            # In the order of categories, or sorted: whatever that of the trials is.
            ranks = values.cat.categories if hasattr(values, "cat") else sorted(labels, key=str)
            order = np.argsort([list(ranks).index(label) for label in labels])
            codes, labels = np.argsort(order)[codes], [labels[k] for k in order]
            first = codes[np.unique(persons, return_index=True)[1]]
            return cls(name, [str(x) for x in labels], codes, bool((codes != first[persons]).any()))
        numbers = check_covariate(values.to_numpy(dtype=float), len(values), f"data[{name!r}]")
        of_people = means_of_people(persons) @ numbers
        within = np.sqrt(np.square(numbers - of_people[persons]).mean())
        if within > OF_PEOPLE * of_people.std():
            raise ValueError(
                f"data: {name!r} differs within people, by {within:.3g}, and between them by "
                f"{of_people.std():.3g}. Numbers are covariates: give conditions as text, such as "
                f"data[{name!r}].astype(str); give all trials of a person the same number, such as "
                "the mean; or test slopes within people by compare_groups(..., covariate=True)."
            )
        return cls(name, [], of_people[persons], False)

    def codes(self, persons):
        """Columns (n_people, n_levels - 1) that sum to 0 over the levels, or a centred number."""
        of_people = self.of_trials[np.unique(persons, return_index=True)[1]]
        return self.levels[of_people] if self.labels else (of_people - of_people.mean())[:, None]

    @property
    def levels(self):
        """The columns of each level, or those of one unit of a number."""
        n = len(self.labels)
        return np.vstack([-np.ones(n - 1), np.eye(n - 1)]) if n else np.ones((1, 1))


def studies_of(data, formula, groups, n):
    """The `Study` of each effect of a formula, by its name.

    Parameters
    ----------
    data, formula, groups : as of `compare_effects`
    n : int
        Number of trials.
    """
    persons, people = encode_groups(groups, n, at_least=2)
    if not isinstance(data, (pd.DataFrame, Mapping)):
        raise ValueError(
            f"data must be a DataFrame or a dict of columns, one row a trial; got "
            f"{type(data).__name__}."
        )
    terms = _terms(formula, list(data))
    names = dict.fromkeys(name for term in terms for name in term)
    factors = {name: Factor.of(name, data[name], persons) for name in names}
    parts = [
        tuple(
            tuple(name for name in term if factors[name].is_within == is_within)
            for is_within in (True, False)
        )
        for term in terms
    ]
    cells = _Cells.of([f for f in factors.values() if f.is_within], persons, people)
    studies = {}
    for term, (within, between) in zip(terms, parts, strict=True):
        # Effects of people on the same differences.
        others = [b for w, b in parts if w == within and b and b != between]
        studies[":".join(term)] = _study(
            ":".join(term),
            cells,
            [factors[name] for name in within],
            [factors[name] for name in between],
            [[factors[name] for name in other] for other in others],
        )
    return studies


def _terms(formula, columns):
    """The effects of a formula, as tuples of names: fewest names first."""
    terms, mentioned = [], []
    for part in str(formula).split("+"):
        separator = "*" if "*" in part else ":"
        names = list(dict.fromkeys(name.strip() for name in part.split(separator)))
        for name in names:
            if name not in columns:
                raise ValueError(
                    f"formula={formula!r}: {name!r} is no column of data, which has "
                    f"{', '.join(map(repr, columns))}. Write 'a + b', 'a:b' or 'a * b', without "
                    "'y ~' and '1'; rename columns that are no text, or hold +, * or :."
                )
        mentioned += names
        sizes = range(1, len(names) + 1) if separator == "*" else [len(names)]
        terms += [term for size in sizes for term in combinations(names, size)]
    terms = [tuple(sorted(term, key=mentioned.index)) for term in terms]
    terms = sorted(dict.fromkeys(terms), key=len)
    for term in terms:
        for fewer in combinations(term, len(term) - 1):
            if fewer and fewer not in terms:
                raise ValueError(
                    f"formula={formula!r} has {':'.join(term)} without {':'.join(fewer)}: write "
                    f"{' * '.join(term)}, which has both."
                )
    return terms


class _Cells(NamedTuple):
    """Combinations of conditions, and the means of each person in them.

    Attributes
    ----------
    persons : ndarray of int, shape (n_sequences,)
    conditions : list of Factor
    levels : list of tuple of int
        The codes of the conditions, cell by cell.
    makers : ndarray, shape (n_cells, n_people, n_sequences)
    """

    persons: np.ndarray
    conditions: list
    levels: list
    makers: np.ndarray

    @classmethod
    def of(cls, conditions, persons, people):
        levels = list(product(*(range(len(f.labels)) for f in conditions)))
        makers = []
        for codes in levels:
            in_cell = np.ones(len(persons), dtype=bool)
            for factor, code in zip(conditions, codes, strict=True):
                in_cell &= factor.of_trials == code
            makers.append(means_of_people(persons, in_cell))
            missing = np.flatnonzero(~makers[-1].any(axis=1))
            if len(missing):
                labels = [f.labels[code] for f, code in zip(conditions, codes, strict=True)]
                names = ", ".join(repr(factor.name) for factor in conditions)
                raise ValueError(
                    f"groups: {people[missing[0]]!r} has no trial of {', '.join(labels)}. What "
                    f"differs within any person is a condition, here {names}, of which all people "
                    "need trials. Mend labels that are wrong, or leave out people or a condition."
                )
        return cls(persons, conditions, levels, np.array(makers))

    def contrasts(self, within):
        """Differences of conditions: matrices as of a `Study`, and the pairs of labels of each."""
        makers, pairs = [], []
        at = [self.conditions.index(factor) for factor in within]
        alike = prod(len(f.labels) for f in self.conditions if f not in within)
        for chosen in product(*(combinations(range(len(f.labels)), 2) for f in within)):
            signs = [
                prod(
                    (codes[k] == high) - (codes[k] == low)
                    for k, (low, high) in zip(at, chosen, strict=True)
                )
                for codes in self.levels
            ]
            makers.append(np.tensordot(np.array(signs) / alike, self.makers, 1))
            pairs.append(
                [(f.labels[a], f.labels[b]) for f, (a, b) in zip(within, chosen, strict=True)]
            )
        return np.array(makers), pairs


def _study(name, cells, within, between, others):
    """The study of one effect.

    Parameters
    ----------
    name : str
    cells : _Cells
    within, between : list of Factor
        The conditions, and the factors and covariates of people, of the effect.
    others : list of list of Factor
        Those of people in other effects on the same differences.
    """
    makers, pairs = cells.contrasts(within)
    n_people = makers.shape[1]
    words = f"{name}, {n_people} people"
    less = [[f"{high} less {low}" for low, high in pair] for pair in pairs]
    if not between:
        changes = [
            Change(list(pair[-1]), " and ".join(differences[:-1]))
            for pair, differences in zip(pairs, less, strict=True)
        ]
        return Study.of_differences(makers, changes, words)
    check_units(n_people)
    prefixes = [" and ".join(differences) for differences in less]
    if len(between) == 1 and not others and between[0].labels:
        labels = between[0].labels
        codes = between[0].of_trials[np.unique(cells.persons, return_index=True)[1]]
        check_people(codes, labels)
        changes = [changes_of_groups(labels, prefix) for prefix in prefixes]
        return Study(GroupDesign(codes), makers, changes, words, codes)
    tested = _columns(between, cells.persons)
    kept = np.hstack([np.ones((n_people, 1)), *(_columns(x, cells.persons) for x in others)])
    model = np.hstack([tested, kept])
    _check_apart(model, name)
    of_people = {f.name: f.codes(cells.persons) for f in sum(others, between) if f.labels}
    spreads = np.hstack([np.ones((n_people, 1)), *of_people.values()])
    changes = [list(_changes(between, prefix, model.shape[1])) for prefix in prefixes]
    return Study(EffectDesign(tested, kept, spreads), makers, changes, words, model=model)


def _changes(between, prefix, n_columns):
    """Each `Change` of an effect of people: differences, of several factors of differences."""
    factors = [factor for factor in between if factor.labels]
    slopes = " and ".join(factor.name for factor in between if not factor.labels)
    for chosen in product(*(combinations(range(len(f.labels)), 2) for f in factors)):
        pairs = dict(zip([f.name for f in factors], chosen, strict=True))
        differences = [
            f.levels[pairs[f.name][1]] - f.levels[pairs[f.name][0]] if f.labels else f.levels[0]
            for f in between
        ]
        columns = np.zeros(n_columns)
        tested = reduce(np.kron, differences)
        columns[: len(tested)] = tested
        if not factors:
            yield Change([slopes], prefix, columns=columns)
            continue
        named = [[f.labels[k] for k in pairs[f.name]] for f in factors]
        prefixes = [prefix, *(f"{high} less {low}" for low, high in named[:-1])]
        prefixes += [f"slope with {slopes}"] if slopes else []
        yield Change(named[-1], " and ".join(filter(None, prefixes)), columns=columns)


def _columns(factors, persons):
    """The columns of an effect of people: products of those of its factors."""
    columns = [factor.codes(persons) for factor in factors]
    return reduce(lambda a, b: (a[:, :, None] * b[:, None]).reshape(len(a), -1), columns)


def _check_apart(model, name):
    """Refuse effects that cannot be told apart, or leave nothing to compare them with."""
    n_people, n_columns = model.shape
    if np.linalg.matrix_rank(model) < n_columns or n_people <= n_columns:
        raise ValueError(
            f"The effect {name!r} cannot be told from the others with these {n_people} people: "
            "leave out effects, or a combination that no person has."
        )
