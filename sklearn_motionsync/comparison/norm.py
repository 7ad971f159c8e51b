"""compare_to_norm: whether single subjects differ from a norm in shape or in timing, and where."""

from __future__ import annotations

from collections.abc import Hashable
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
import pandas as pd
from sklearn.base import BaseEstimator

from ..inputs.types import Features, Labels, TrialsLike, Unit
from ..inputs.wording import counted
from ..matching.counting import ROUNDING, first_largest, runs_of, whole
from ..model.acceptance import LEAST, LogMoments
from ..model.variation import predictive_variance
from ..synchronizers.match import UNITS, Match
from ..utils.groups import encode_groups, refuse_classes_as_people
from .curves import AlignedCurves
from .permutations import check_level

# The variance at a frame is shrunk to the mean over the frames, which weighs as many people.
_SHRINKAGE = 20
# Widths of bumps, as standard deviations and shares of the clock: of signals, and of the offset;
# and the frames on which they are sought, at most.
_WIDTHS, _MOST_FRAMES = (0.1, 0.2), 34
# The share of independent frames in the correlations between all frames and signals.
_INDEPENDENT = 0.5
# Prior variances of the logarithm of a measure, as of `simultaneous_factor`, and of the largest
# of four standardised ones.
_PRIOR_VARIANCE, _PRIOR_OF_LARGEST = 0.1, 0.7
# Departures of one feature are one if between them the deviation stays above this share of the
# limit.
_BETWEEN = 0.5
# Most departures of a subject.
_MOST = 5
_COLUMNS = ["subject", "what", "feature", "start", "end", "peak"]
_COLUMNS += ["direction", "size", "unit", "deviation"]
# Fewest people of a norm.
_FEWEST = 3


@dataclass(frozen=True, eq=False)
class NormComparison:
    """What `compare_to_norm` found.

    Parameters
    ----------
    verdicts : DataFrame
        One row a subject: ``group``, ``n_trials``; ``p``, that a new person of the norm deviates as
        much, in shape or in timing; ``p_shape`` and ``p_timing`` alone; and ``differs``.
    departures : DataFrame
        Where: one row a stretch or a bump, of each subject that differs the clearest first, five at
        most. ``subject``; ``what``, "shape" or "timing"; ``feature``; ``start``, ``end`` and
        ``peak``, in the unit of time; ``direction``; ``size``, the difference from the mean of the
        norm at the peak, in its ``unit``, or the height of a bump beside what the rest of the curve
        lets expect; ``deviation``, the same in standard deviations of people.
    profile : DataFrame
        One row a subject and feature: root mean square over the frames of the difference from the
        mean of the norm. ``aligned``; ``linear``, after linear normalisation; ``norm``, the median
        of the people of the norm, aligned, each against the others; ``unit``.
    level : float
        As given.
    n_people : int
        Of the norm.
    unit : {"frames", "percent", "seconds"}
        Of time.
    clock : ndarray, shape (P,)
        Times of the frames of the pattern.
    features, units : list of str
        Names and units of the signals, and of the offset at last.
    mean, std : ndarray, shape (P, n_signals + 1)
        Of the norm: mean, and standard deviation predicted for a new person.
    limits : ndarray, shape (n_subjects, n_signals + 1)
        The largest deviation of a frame that is no departure, in these standard deviations.
    limits_of_bumps : ndarray, shape (n_subjects, 2)
        The largest gain of a bump that is no departure, of the signals and of the offset.
    curves : ndarray, shape (n_subjects, P, n_signals + 1)
        Mean of the trials of each subject, in the order of ``verdicts``.

    Examples
    --------
    >>> from sklearn_motionsync import DenseSynchronizer
    >>> from sklearn_motionsync.comparison import compare_to_norm
    >>> from sklearn_motionsync.datasets import make_gait
    >>> gait = make_gait(20, timing=6, random_state=0)
    >>> in_norm = gait.group == "A"
    >>> norm = [x for x, one in zip(gait.data, in_norm) if one]
    >>> sync = DenseSynchronizer(n_frames=101).fit(norm)
    >>> found = compare_to_norm(sync, gait.data, gait.group, norm="A", groups=gait.person)
    >>> bool(found.verdicts["differs"].mean() > 0.8)
    True
    """

    verdicts: pd.DataFrame
    departures: pd.DataFrame
    profile: pd.DataFrame
    level: float
    n_people: int
    unit: Unit
    clock: np.ndarray
    features: list
    units: list
    mean: np.ndarray
    std: np.ndarray
    limits: np.ndarray
    limits_of_bumps: np.ndarray
    curves: np.ndarray

    def __repr__(self):
        return f"NormComparison({self.describe()!r})"

    def describe(self, subject: Hashable | None = None) -> str:
        """The answer in a sentence.

        Parameters
        ----------
        subject : label of a subject, default=None
            By default all of them are counted.

        Returns
        -------
        str
            How many differ; or whether the subject does, with p and its largest departure.
        """
        norm = f"the norm of {self.n_people} people"
        if subject is None:
            n = int(self.verdicts["differs"].sum())
            word = "differs" if n == 1 else "differ"
            return f"{n} of {counted(len(self.verdicts), 'subject')} {word} from {norm}."
        row = self.verdicts.loc[[subject]].iloc[0]
        if not row["differs"]:
            return f"{subject} stays within {norm}, p = {row['p']:.2g}."
        largest = self.departures[self.departures["subject"] == subject].iloc[0]
        where = "" if largest["what"] == "timing" else f" in {largest['feature']}"
        size = f"{abs(largest['size']):.3g} {largest['unit']}".strip()
        return (
            f"{subject} differs from {norm}, p = {row['p']:.2g}: {size} {largest['direction']}"
            f"{where}, at {largest['peak']:.3g} {UNITS[self.unit]}."
        )


def compare_to_norm(
    estimator: BaseEstimator | Match,
    X: TrialsLike,
    y: Labels,
    *,
    norm: Hashable,
    groups: Labels | None = None,
    signals: TrialsLike | None = None,
    features: Features | None = None,
    level: float = 0.05,
    unit: Unit = "percent",
    **params: Any,
) -> NormComparison:
    """Tell of single subjects whether they differ from a norm, in shape or in timing, and where.

    All trials are on the clock of one pattern. A subject is compared by the mean of the trials,
    in the aligned curves and in the offsets.

    Parameters
    ----------
    estimator : synchronizer, Pipeline with one, or Match of X
        Fitted on the norm, or on all trials.
    X : trials
        Those of the norm and of the subjects, as the estimator takes them.
    y : sequence of length n_sequences
        What the trials are told apart by: a label for each, of which one is the norm.
    norm : label
        That of the norm. The people of all others are compared with it.
    groups : sequence of length n_sequences, default=None
        The subject of each trial. By default every trial is of another person.
    signals : trials, default=None
        What is compared, as in `compare_groups`: by default X in its own units, or what reaches the
        synchronizer.
    features : int, str or list of them, default=None
        Those of the signals that are compared; by default all.
    level : float, default=0.05
        Share of new people of the norm that are called different.
    unit : {"percent", "frames", "seconds"}, default="percent"
        Of places and offsets.
    **params : dict
        What synchronizing X takes besides: ``frame_rate``, frames a second of X, which seconds need
        where tables do not tell; ``keyframes``, which are seconds where a frame rate is given.

    Returns
    -------
    NormComparison
        A verdict of each subject; departures, one row a stretch; and mean deviations by feature.

    Raises
    ------
    ValueError
        If ``y`` has no such label, or no other one; a person has several labels; the norm
        has fewer than three people; and as from `compare_groups`.

    See Also
    --------
    compare_groups : Tests whether groups differ.
    find_departures : Departures of trials from an `ActionModel`.
    sklearn_motionsync.display.NormDisplay : Draws a subject before the norm.

    Notes
    -----
    1. Deviations z are in standard deviations predicted for a new person. The variance at a frame
       is shrunk to the mean over the frames, which weighs as much as 20 people.
    2. Four measures are taken of a subject, two of the shape and two of the timing. The largest
       ``|z|`` over all frames and signals, and over all frames of the offset, sees what is far from
       all people. The largest gain of a bump sees what is unusual for *this* curve: with the
       covariance C of z over all frames and signals, half of which is that of independent frames,
       and of the offset with them, a bump b has the gain ``b' C^-1 z / sqrt(b' C^-1 b)`` and the
       height ``b' C^-1 z / (b' C^-1 b)``. A bump changes one signal, as a Gaussian with a standard
       deviation of a tenth of the clock, or the offset with a fifth of it.
    3. Every person of the norm is left out in turn and compared with the others, in as many trials
       as the subject has. So each measure gets its mean and scale, in the logarithm, and the
       largest of the four standardised ones its own: they predict that of a new person by Student's
       t. So p has its level, whatever the number of signals.

    Examples
    --------
    >>> from sklearn_motionsync import DenseSynchronizer
    >>> from sklearn_motionsync.comparison import compare_to_norm
    >>> from sklearn_motionsync.datasets import make_gait
    >>> gait = make_gait(24, timing=7, random_state=0)
    >>> norm = [x for x, group in zip(gait.data, gait.group) if group == "A"]
    >>> sync = DenseSynchronizer(n_frames=101).fit(norm)
    >>> found = compare_to_norm(sync, gait.data, gait.group, norm="A", groups=gait.person)
    >>> bool(found.verdicts["differs"].mean() > 0.8)
    True
    >>> found.departures["direction"].unique().tolist()
    ['later']
    """
    check_level(level)
    aligned = AlignedCurves.of(
        estimator, X, params, "compare_to_norm", signals=signals, features=features, unit=unit
    )
    norm_trials, subjects = _people_of_norm(y, norm, groups, len(aligned.curves))
    timing = aligned.offsets[:, :, np.newaxis]
    values = np.concatenate([aligned.curves, timing], axis=2).astype(np.float64, copy=False)
    of_norm = [values[trials] for trials in norm_trials]
    people = _People(np.stack([x.mean(axis=0) for x in of_norm]))
    curves = np.stack([values[trials].mean(axis=0) for *_, trials in subjects])
    verdicts, limits = _verdicts(subjects, people.measures(curves), of_norm, float(level))
    names, units = [*aligned.names, "offset"], [*aligned.units, UNITS[aligned.unit]]
    return NormComparison(
        verdicts=verdicts,
        departures=_departures(people, curves, limits, verdicts, names, units, aligned.clock),
        profile=_profile(curves, of_norm, aligned, norm_trials, subjects, names, units),
        level=float(level),
        n_people=len(of_norm),
        unit=aligned.unit,
        clock=aligned.clock,
        features=names,
        units=units,
        mean=people.mean,
        std=people.std,
        limits=np.repeat(limits[:, ::2], [len(names) - 1, 1], axis=1),
        limits_of_bumps=limits[:, 1::2],
        curves=curves,
    )


class _People:
    """The people of a norm, and how far curves are from theirs.

    Parameters
    ----------
    means : ndarray, shape (n_people, P, n_features)
        Of the trials of each person; the last feature is the offset.

    Attributes
    ----------
    mean, std : ndarray, shape (P, n_features)
        Of the people, and predicted for a new person.
    bumps : list of _Bumps
        Of the signals, and of the offset.
    """

    def __init__(self, means):
        variance = predictive_variance(means, np.arange(len(means)), _SHRINKAGE)
        self.mean, self.std = means.mean(axis=0), np.sqrt(variance)
        z = self.deviations(means)
        # An offset may be unusual beside the curves; the shape is judged whatever the timing is.
        self.bumps = [
            _Bumps(z[..., :-1], self.std[:, :-1], _WIDTHS[0]),
            _Bumps(z, self.std[:, -1:], _WIDTHS[1]),
        ]

    def deviations(self, curves):
        """Curves (n, P, n_features) less the mean, in standard deviations."""
        return (curves - self.mean) / self.std

    def gains(self, z):
        """The gains of bumps of the signals, and of the offset, and their heights."""
        of_signals, of_offset = self.bumps
        return of_signals.explain(z[..., :-1]), of_offset.explain(z)

    def measures(self, curves):
        """How far curves are: (n, 4), of shape, of its bumps, of timing, and of its bumps."""
        z = self.deviations(curves)
        (of_signals, _), (of_offset, _) = self.gains(z)
        each = z[..., :-1], of_signals, z[..., -1:], of_offset
        return np.column_stack([np.abs(x).max(axis=(1, 2)) for x in each])


class _Bumps:
    """Bumps of curves, and how much of a curve each explains beside what people vary.

    Parameters
    ----------
    of_people : ndarray, shape (n_people, P, n_features)
        Deviations of the people, in standard deviations.
    std : ndarray, shape (P, n_columns)
        Of the last features, in which bumps are sought.
    width : float
        The standard deviation of a bump, as a share of the clock.
    """

    def __init__(self, of_people, std, width):
        n_people, n_frames = of_people.shape[:2]
        last = n_frames - 1
        self._at = whole(np.linspace(0, last, min(n_frames, _MOST_FRAMES)))
        self._last, self._sigma = last, width * last
        self._middles = np.linspace(0, last, round(1 / width) + 1)
        # The inverse covariance of all frames and signals is I - Z' K Z, divided by the share of
        # independent frames, for the deviations Z of the people (Woodbury).
        z = of_people[:, self._at]
        self._of_people = z.reshape(n_people, -1)
        ratio = (n_people - 1) * _INDEPENDENT / (1 - _INDEPENDENT)
        products = self._of_people @ self._of_people.T
        self._kernel = np.linalg.inv(products + ratio * np.eye(n_people))
        bumps = np.exp(-0.5 * np.square((self._at - self._middles[:, np.newaxis]) / self._sigma))
        self._bumps = bumps[:, :, np.newaxis] / std[self._at]
        on_people = np.einsum("ckf,nkf->cfn", self._bumps, z[..., -std.shape[1] :])
        known = np.einsum("cfn,nm,cfm->cf", on_people, self._kernel, on_people)
        self._squares = (np.square(self._bumps).sum(axis=1) - known) / _INDEPENDENT

    @cached_property
    def places(self):
        """First and last frame above half of the height, and the centre: (n_centres, 3)."""
        reach = np.sqrt(2 * np.log(2)) * self._sigma
        ends = np.clip([self._middles - reach, self._middles + reach], 0, self._last)
        return whole(np.column_stack([*ends, self._middles]))

    def explain(self, z):
        """Gains and heights, with signs, of bumps in deviations z (n, P, n_features).

        Returns
        -------
        gains, heights : ndarray, shape (n, n_centres, n_columns)
        """
        z = z[:, self._at]
        rows = z.reshape(len(z), -1)
        weighed = rows - (rows @ self._of_people.T) @ self._kernel @ self._of_people
        weighed = weighed.reshape(z.shape)[..., -self._bumps.shape[2] :] / _INDEPENDENT
        sums = np.einsum("ckf,nkf->ncf", self._bumps, weighed)
        return sums / np.sqrt(self._squares), sums / self._squares


class _Expected:
    """The measures that are expected of a new person of a norm, by the mean of k trials.

    Parameters
    ----------
    of_people : list of ndarray, shape (n_trials_i, P, n_features)
        The trials of each person; the last feature is the offset.
    k : int
    """

    def __init__(self, of_people, k):
        means = np.stack([x.mean(axis=0) for x in of_people])
        logs, weights = [], []
        for i, x in enumerate(of_people):
            # Means of k trials, of which each begins with another one.
            n_starts = len(x) if k < len(x) else 1
            curves = [np.roll(x, start, axis=0)[:k].mean(axis=0) for start in range(n_starts)]
            logs.append(_logs(_People(np.delete(means, i, axis=0)).measures(np.stack(curves))))
            weights.append(np.full(n_starts, 1 / n_starts))
        logs, weights = np.concatenate(logs), np.concatenate(weights)
        of_each = [_moments(x, weights) for x in logs.T]
        self._middle = np.array([moments.mean for moments in of_each])
        self._scale = np.array([moments.scale(_PRIOR_VARIANCE) for moments in of_each])
        largest = self._standardized(logs)
        # Of all four, of those of the shape, and of the timing.
        self._largest = [
            _moments(largest[:, chosen].max(axis=1), weights)
            for chosen in (slice(None), slice(0, 2), slice(2, 4))
        ]

    def chances(self, measures):
        """That a new person has measures (4,) as large: of all, of shape, and of timing."""
        all_four = self._standardized(_logs(measures))
        each = all_four.max(), all_four[:2].max(), all_four[2:].max()
        pairs = zip(self._largest, np.exp(each), strict=True)
        return [moments.tail(value, _PRIOR_OF_LARGEST) for moments, value in pairs]

    def limits(self, level):
        """The largest measures (4,) that are no departure."""
        largest = np.log(self._largest[0].upper_limit(1 - level, _PRIOR_OF_LARGEST))
        return np.exp(self._middle + largest * self._scale)

    def _standardized(self, logs):
        return (logs - self._middle) / self._scale


def _logs(measures):
    return np.log(np.maximum(measures, LEAST))


def _moments(logs, weights):
    """The `LogMoments` of values of people, by their logarithms (n,); weights of one add to 1."""
    mean = np.average(logs, weights=weights)
    n_people = round(weights.sum())
    return LogMoments(n_people, float(mean), float(weights @ np.square(logs - mean)))


def _people_of_norm(y, norm, groups, n):
    """The trials of each person of the norm, and the label, the group and those of each subject."""
    codes, names = encode_groups(y, n, name="y", at_least=2)
    if norm not in names:
        raise ValueError(f"norm={norm!r} is none of the labels {names[:6]} in y.")
    persons, labels = encode_groups(groups, n, at_least=2)
    if groups is not None:
        refuse_classes_as_people(codes, persons)
    of_norm, subjects = [], []
    for person, label in enumerate(labels):
        trials = np.flatnonzero(persons == person)
        several = [names[code] for code in sorted(set(codes[trials]))]
        if len(several) > 1:
            raise ValueError(
                f"groups: {label!r} has trials of the labels {several} in y. Give people one "
                f"name a label, such as '{label} {several[0]}'."
            )
        if several[0] == norm:
            of_norm.append(trials)
        else:
            subjects.append((label, several[0], trials))
    if len(of_norm) < _FEWEST:
        raise ValueError(
            f"The norm needs at least {_FEWEST} people, got {len(of_norm)} in {norm!r}."
        )
    return of_norm, subjects


def _verdicts(subjects, measures, of_norm, level):
    """The table of verdicts of subjects by their measures (n, 4), and the limits of these."""
    counts = [len(trials) for *_, trials in subjects]
    expected = {k: _Expected(of_norm, k) for k in set(counts)}
    p = np.array([expected[k].chances(x) for k, x in zip(counts, measures, strict=True)])
    # A p that is the level but for rounding is at the level, and differs.
    limits = (1 - ROUNDING) * np.array([expected[k].limits(level) for k in counts])
    columns = {"group": [group for _, group, _ in subjects], "n_trials": counts, "p": p[:, 0]}
    columns |= {"p_shape": p[:, 1], "p_timing": p[:, 2]}
    columns["differs"] = (measures > limits).any(axis=1)
    index = pd.Index([label for label, *_ in subjects], name="subject")
    return pd.DataFrame(columns, index=index), limits


def _departures(people, curves, limits, verdicts, names, units, clock):
    """The table of departures, at most five a subject, the farthest beyond its limit first."""
    z, rows = people.deviations(curves), []
    explained = people.gains(z)
    for i, label in enumerate(verdicts.index):
        places = []
        for k in range(len(names)):
            is_timing = k == len(names) - 1
            limit, limit_of_bumps = limits[i, 2:] if is_timing else limits[i, :2]
            of_feature = [
                (abs(z[i, peak, k]) / limit, k, first, last, peak, z[i, peak, k])
                for first, last, peak in _stretches(np.abs(z[i, :, k]), limit)
            ]
            bumps = people.bumps[is_timing]
            gains, heights = (x[i, :, 0 if is_timing else k] for x in explained[is_timing])
            best = first_largest(np.abs(gains))
            first, last, peak = bumps.places[best]
            # A bump that is far from all people, too, is told once.
            is_told = any(a <= last and first <= b for _, _, a, b, *_ in of_feature)
            excess = abs(gains[best]) / limit_of_bumps
            if excess > 1 and not is_told:
                deviation = heights[best] / people.std[peak, k]
                of_feature.append((excess, k, first, last, peak, deviation))
            places += of_feature
        places.sort(key=lambda place: -place[0])
        for _, k, first, last, peak, deviation in places[:_MOST]:
            is_timing = k == len(names) - 1
            above, below = ("later", "earlier") if is_timing else ("above", "below")
            rows.append(
                {
                    "subject": label,
                    "what": "timing" if is_timing else "shape",
                    "feature": names[k],
                    "start": clock[first],
                    "end": clock[last],
                    "peak": clock[peak],
                    "direction": above if deviation > 0 else below,
                    "size": deviation * people.std[peak, k],
                    "unit": units[k],
                    "deviation": deviation,
                }
            )
    return pd.DataFrame(rows, columns=_COLUMNS)


def _stretches(sizes, limit):
    """First and last frame beyond a limit, and the peak, of stretches of sizes (P,)."""
    # They end where sizes fall below a share of the limit.
    for start, stop in runs_of(sizes > _BETWEEN * limit):
        beyond = start + np.flatnonzero(sizes[start:stop] > limit)
        if len(beyond):
            yield int(beyond[0]), int(beyond[-1]), start + first_largest(sizes[start:stop])


def _profile(curves, of_norm, aligned, norm_trials, subjects, names, units):
    """Root mean squares of differences from the mean of the norm, by subject and feature."""
    means = np.stack([x.mean(axis=0) for x in of_norm])
    even = aligned.even.astype(np.float64, copy=False)
    mean = np.mean([even[trials].mean(axis=0) for trials in norm_trials], axis=0)
    of_subjects = np.stack([even[trials].mean(axis=0) for *_, trials in subjects])
    linear = np.full((len(curves), len(names)), np.nan)
    linear[:, :-1] = _root_mean_squares(of_subjects - mean)
    n = len(means)
    without_one = (means.sum(axis=0) - means) / (n - 1)
    typical = np.median(_root_mean_squares(means - without_one), axis=0)
    labels = [label for label, *_ in subjects]
    index = pd.MultiIndex.from_product([labels, names], names=["subject", "feature"])
    return pd.DataFrame(
        {
            "aligned": _root_mean_squares(curves - means.mean(axis=0)).ravel(),
            "linear": linear.ravel(),
            "norm": np.tile(typical, len(curves)),
            "unit": np.tile(np.array(units, dtype=object), len(curves)),
        },
        index=index,
    )


def _root_mean_squares(differences):
    """Over the frames: (n, n_features)."""
    return np.sqrt(np.square(differences).mean(axis=1))
