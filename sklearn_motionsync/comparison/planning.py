"""plan_study: how many people a study needs to find what a pilot study shows."""

from __future__ import annotations

from numbers import Integral, Real
from typing import Any, Literal

import numpy as np
import pandas as pd
from scipy.stats import norm
from sklearn.base import BaseEstimator
from sklearn.utils import check_random_state

from ..inputs.types import Features, Labels, RandomState, TrialsLike
from ..synchronizers.match import Match
from ..utils.parallel import Progress
from .curves import AlignedCurves
from .permutations import (
    Design,
    Family,
    GroupDesign,
    check_level,
    enhanced,
    families,
    order_of_values,
    share_at_most,
)
from .study import Study

# Numbers of people that are tried; studies of each, in which there is nothing to find and of whose
# people so many draws tell what chance does; and the power above which no more are tried.
_SIZES = (4, 5, 6, 8, 10, 12, 15, 20, 25, 30, 40, 50, 65, 80, 100)
_NULL_STUDIES, _DRAWS = 20, 50
_ENOUGH = 0.97


def plan_study(
    estimator: BaseEstimator | Match,
    X: TrialsLike,
    y: Labels,
    *,
    groups: Labels | None = None,
    covariate: bool = False,
    paired: bool = False,
    signals: TrialsLike | None = None,
    features: Features | None = None,
    what: Literal["joint", "shape", "timing"] = "joint",
    change: float = 1.0,
    power: float = 0.8,
    level: float = 0.05,
    n_studies: int = 400,
    random_state: RandomState = 0,
    **params: Any,
) -> pd.DataFrame:
    """How many people `compare_groups` needs to find the difference that a pilot study shows.

    Studies of more and more people are simulated. Their curves and offsets are normal, with the
    means and covariances of the pilot, group by group, at all frames and in all signals at once.

    Parameters
    ----------
    estimator : synchronizer, Pipeline with one, or Match of X
        As for `compare_groups`, fitted on the trials of the pilot.
    X : trials
        Those of the pilot.
    y : sequence of length n_sequences
        What they are told apart by, as for `compare_groups`.
    groups : sequence of length n_sequences, default=None
        The subject of each trial. By default every trial is of another person.
    covariate, paired : bool, default=False
        As for `compare_groups`.
    signals, features : default=None
        What is compared, as for `compare_groups`.
    what : {"joint", "shape", "timing"}, default="joint"
        The answer that is to be found.
    change : float, default=1.0
        How large the difference is, in differences of the pilot. The differences of few people are
        too large by chance, so plan for less, such as 0.7.
    power : float, default=0.8
        The probability to find it.
    level : float, default=0.05
        Level of the tests, of all answers together.
    n_studies : int, default=400
        Simulated studies of each number of people. With 400, a power of 0.8 has a standard error
        of 0.02.
    random_state : int, RandomState instance or None, default=0
        Draws people and permutations.
    **params : dict
        What synchronizing X takes besides.

    Returns
    -------
    DataFrame
        ``power`` by ``people``: in each group, or in all for pairs and covariates. In ``attrs``,
        ``people`` is the least number with the power, or None above 100.

    Raises
    ------
    ValueError
        As from `compare_groups`; or if power or change are no such numbers.

    Notes
    -----
    What chance does is learnt from permutations of other simulated studies of the same size, which
    is nearly as good as permutations of each study and much faster. Between the numbers of people
    that are tried the power is interpolated: its normal deviate is close to linear in the root of
    the number.

    Examples
    --------
    Ten people of a pilot, and a push-off later by 3 % of the gait cycle in group B. A third of
    the difference needs more people:

    >>> from sklearn_motionsync import DenseSynchronizer
    >>> from sklearn_motionsync.comparison import plan_study
    >>> from sklearn_motionsync.datasets import make_gait
    >>> gait = make_gait(10, timing=3, random_state=0)
    >>> match = DenseSynchronizer(n_frames=101).fit(gait.data).match(gait.data)
    >>> given = {"groups": gait.person, "n_studies": 50}
    >>> all_of_it = plan_study(match, gait.data, gait.group, **given)
    >>> a_third = plan_study(match, gait.data, gait.group, change=1 / 3, **given)
    >>> all_of_it.attrs["people"] < a_third.attrs["people"]
    True
    """
    check_level(level)
    for name, value, most in (("power", power, 1), ("change", change, np.inf)):
        if isinstance(value, bool) or not (isinstance(value, Real) and 0 < value < most):
            raise ValueError(f"{name} must be a number above 0 and below {most}, got {value!r}.")
    if not (isinstance(n_studies, Integral) and n_studies >= 10):
        raise ValueError(f"n_studies must be a whole number of at least 10, got {n_studies!r}.")
    if what not in ("joint", "shape", "timing"):
        raise ValueError(f"what must be 'joint', 'shape' or 'timing', got {what!r}.")
    aligned = AlignedCurves.of(
        estimator, X, params, "plan_study", signals=signals, features=features, unit="percent"
    )
    study = Study.of(y, groups, covariate=covariate, paired=paired, n=len(aligned.curves))
    values = [study.units(x) for x in (aligned.curves, aligned.offsets[:, :, np.newaxis])]
    rng, powers, pilot = check_random_state(random_state), {}, Pilot(study, values, change)
    for n in _SIZES:
        powers[n] = power_of(pilot, n, what, level, n_studies, rng)
        if powers[n] >= _ENOUGH:
            break
    table = pd.Series(powers, name="power").rename_axis("people").to_frame()
    table.attrs["people"] = least_people(table["power"], power, n_studies)
    return table


class Pilot:
    """People like those of a pilot study.

    Parameters
    ----------
    study : Study
    values : list of ndarray, shape (n_units, P, n_columns)
        Of the units, such as aligned curves and offsets.
    change : float
        How large the difference is, in those of the pilot.
    """

    def __init__(self, study, values, change):
        # Draws depend on neither the order of trials nor the names of people and groups.
        order = order_of_values(values, study.design.flips)
        self.design, self.fitted, self.deviations = study.design.rearranged(order), [], []
        self.codes = np.zeros(len(order), int) if study.groups is None else study.groups[order]
        # The units of each group, or all: deviations of these are mixed.
        self.members = [np.flatnonzero(self.codes == k) for k in dict.fromkeys(self.codes)]
        columns = (self.codes[:, np.newaxis] == np.unique(self.codes)).astype(float)
        if study.model is not None:
            columns = study.model[order]
        freedom = 1 if study.groups is not None else columns.shape[1]
        for x in (of_units[order] for of_units in values):
            fitted = np.tensordot(columns @ np.linalg.pinv(columns), x, 1)
            middle = 0.0 if study.design.flips else fitted.mean(axis=0)
            self.fitted.append(middle + change * (fitted - middle))
            self.deviations.append(
                [(x - fitted)[rows] / np.sqrt(len(rows) - freedom) for rows in self.members]
            )

    def draw(self, n, rng):
        """The design of n new people in each group, and the values of these people."""
        chosen = np.concatenate([rng.choice(rows, size=n) for rows in self.members])
        weights = [rng.standard_normal((n, len(rows))) for rows in self.members]
        values = [
            fitted[chosen]
            + np.concatenate([np.tensordot(w, d, 1) for w, d in zip(weights, each, strict=True)])
            for fitted, each in zip(self.fitted, self.deviations, strict=True)
        ]
        if len(self.members) > 1:
            return GroupDesign(self.codes[chosen]), values
        tested = self.design.rows[chosen]
        if self.design.flips:
            return Design(tested, flips=True), values
        return Design(tested - tested.mean(axis=0)), values


def power_of(pilot, n, what, level, n_studies, rng):
    """The share of studies of n people in which the answer is found."""
    quiet, tables = Progress(None, 0), []
    for _ in range(_NULL_STUDIES):
        design, values = pilot.draw(n, rng)
        tables.append(families(design, values, _DRAWS, rng, progress=quiet))
    # The first of each are the people themselves.
    shape, timing = (
        Family(None, np.concatenate([each[k].largest[1:] for each in tables]), None)
        for k in range(2)
    )
    deviates, floors = [[], []], []
    for _ in range(n_studies):
        design, values = pilot.draw(n, rng)
        floors.append(max(design.smallest_p, 1 / len(shape.ranks)))
        for of_curves, x in zip(deviates, values, strict=True):
            of_curves.append(design.deviates(design.observed[np.newaxis], design.prepare(x)))
    largest = [np.abs(enhanced(np.concatenate(x))).max(axis=(1, 2)) for x in deviates]
    p = {"shape": shape.shares(largest[0]), "timing": timing.shares(largest[1])}
    least = np.minimum(shape.ranks, timing.ranks)
    p["joint"] = share_at_most(least, np.minimum(p["shape"], p["timing"]))
    return float(np.mean(np.maximum(p[what], floors) <= level))


def least_people(powers, power, n_studies):
    """The least number of people with a power, or None."""
    roots = np.sqrt(powers.index.to_numpy(dtype=float))
    edge = 0.5 / n_studies
    deviates = np.maximum.accumulate(norm.ppf(np.clip(powers.to_numpy(), edge, 1 - edge)))
    wanted = norm.ppf(power)
    if deviates[-1] < wanted:
        return None
    k = int(np.argmax(deviates >= wanted))
    if k == 0:
        return int(powers.index[0])
    share = (wanted - deviates[k - 1]) / (deviates[k] - deviates[k - 1])
    return int(np.ceil((roots[k - 1] + share * (roots[k] - roots[k - 1])) ** 2 - 1e-9))
