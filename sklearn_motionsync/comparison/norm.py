"""compare_to_norm: whether single subjects differ from a norm in shape or in timing, and where."""

from __future__ import annotations

from collections.abc import Hashable
from dataclasses import dataclass
from typing import Any

import numpy as np
import pandas as pd
from sklearn.base import BaseEstimator

from ..inputs.types import Features, Labels, TrialsLike, Unit
from ..inputs.wording import counted
from ..matching.counting import first_largest, runs_of
from ..model.acceptance import LogMoments
from ..model.variation import predictive_variance
from ..synchronizers.match import UNITS, Match
from ..utils.groups import encode_groups, refuse_classes_as_people
from .curves import AlignedCurves
from .study import check_level

# The variance at a frame is shrunk to the mean over the frames, which weighs as many people.
_SHRINKAGE = 20
# Prior variance of the logarithm of the largest deviation, as of `simultaneous_factor`.
_PRIOR_VARIANCE = 0.1
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
        Where: one row a stretch, of each subject the largest first, five at most. ``subject``;
        ``what``, "shape" or "timing"; ``feature``; ``start``, ``end`` and ``peak``, in the unit of
        time; ``direction``; ``size``, the difference from the mean of the norm at the peak, in its
        ``unit``; ``deviation``, the same in standard deviations of people.
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
        The largest deviation that is no departure, in these standard deviations.
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
    1. Deviations are in standard deviations predicted for a new person. The variance at a frame is
       shrunk to the mean over the frames, which weighs as much as 20 people.
    2. The largest deviation, over all frames and signals, is that of shape; over all frames of the
       offset, that of timing.
    3. Every person of the norm is left out in turn and compared with the others, in as many trials
       as the subject has. The logarithms of their largest deviations predict that of a new
       person by Student's t. So p of shape and timing have their level, whatever the number of
       signals. p is twice the smaller one.

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
    mean, std = _of_norm(np.stack([x.mean(axis=0) for x in of_norm]))
    curves = np.stack([values[trials].mean(axis=0) for *_, trials in subjects])
    z = (curves - mean) / std
    counts = [len(trials) for *_, trials in subjects]
    p, limits = _chances(z, counts, of_norm, float(level))
    verdicts = _verdicts(subjects, counts, p, level)
    names, units = [*aligned.names, "offset"], [*aligned.units, UNITS[aligned.unit]]
    return NormComparison(
        verdicts=verdicts,
        departures=_departures(z, curves - mean, limits, verdicts, names, units, aligned),
        profile=_profile(curves, of_norm, aligned, norm_trials, subjects, names, units),
        level=float(level),
        n_people=len(of_norm),
        unit=aligned.unit,
        clock=aligned.clock,
        features=names,
        units=units,
        mean=mean,
        std=std,
        limits=limits,
        curves=curves,
    )


def _of_norm(means):
    """Mean, and standard deviation of a new person, of those of people (n_people, P, n)."""
    variance = predictive_variance(means, np.arange(len(means)), _SHRINKAGE)
    return means.mean(axis=0), np.sqrt(variance)


def _chances(z, counts, of_norm, level):
    """Probabilities (n, 2) of deviations in shape and in timing, and limits (n, n_features).

    Parameters
    ----------
    z : ndarray, shape (n, P, n_features)
        Deviations of the means of subjects.
    counts : list of int, length n
        Of their trials.
    of_norm : list of ndarray, shape (n_trials_i, P, n_features)
        The trials of each person of the norm.
    level : float
    """
    p, limits = np.empty((len(z), 2)), np.empty((len(z), z.shape[2]))
    for j, columns in enumerate((slice(0, -1), slice(-1, None))):
        of_part = [x[:, :, columns] for x in of_norm]
        of_new = {k: _largest_deviations(of_part, k) for k in set(counts)}
        for i, k in enumerate(counts):
            p[i, j] = of_new[k].tail(np.abs(z[i][:, columns]).max(), _PRIOR_VARIANCE)
            limits[i, columns] = of_new[k].upper_limit(1 - level / 2, _PRIOR_VARIANCE)
    return p, limits


def _largest_deviations(of_people, k):
    """The `LogMoments` of the largest deviation of a new person, of the mean of k trials.

    Parameters
    ----------
    of_people : list of ndarray, shape (n_trials_i, P, n_features)
    k : int
    """
    means = np.stack([x.mean(axis=0) for x in of_people])
    logs, weights = [], []
    for i, x in enumerate(of_people):
        mean, std = _of_norm(np.delete(means, i, axis=0))
        # Means of k trials, of which each begins with another one.
        n_starts = len(x) if k < len(x) else 1
        curves = [np.roll(x, start, axis=0)[:k].mean(axis=0) for start in range(n_starts)]
        z = np.abs((np.stack(curves) - mean) / std).max(axis=(1, 2))
        logs.append(np.log(np.maximum(z, np.finfo(float).tiny)))
        weights.append(np.full(len(z), 1 / len(z)))
    logs, weights = np.concatenate(logs), np.concatenate(weights)
    mean = np.average(logs, weights=weights)
    return LogMoments(len(means), float(mean), float(weights @ np.square(logs - mean)))


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


def _verdicts(subjects, counts, p, level):
    """The table of verdicts of subjects, from the probabilities p (n, 2) in shape and in timing."""
    joint = np.minimum(1, 2 * p.min(axis=1))
    columns = {"group": [group for _, group, _ in subjects], "n_trials": counts, "p": joint}
    columns |= {"p_shape": p[:, 0], "p_timing": p[:, 1], "differs": joint <= level}
    return pd.DataFrame(columns, index=pd.Index([label for label, *_ in subjects], name="subject"))


def _departures(z, differences, limits, verdicts, names, units, aligned):
    """The table of departures, at most five a subject."""
    rows = []
    size = np.abs(z)
    for i, label in enumerate(verdicts.index):
        departures = []
        # Stretches above a share of the limit, in which it is exceeded somewhere.
        above_share = size[i] / limits[i] > _BETWEEN
        stretches = [
            (k, slice(*stretch))
            for k in range(len(names))
            for stretch in runs_of(above_share[:, k])
        ]
        for feature, stretch in stretches:
            sizes = size[i, stretch, feature]
            beyond = stretch.start + np.flatnonzero(sizes > limits[i, feature])
            if not len(beyond):
                continue
            peak = stretch.start + first_largest(sizes)
            is_timing = feature == len(names) - 1
            above, below = ("later", "earlier") if is_timing else ("above", "below")
            departures.append(
                {
                    "subject": label,
                    "what": "timing" if is_timing else "shape",
                    "feature": names[feature],
                    "start": aligned.clock[beyond[0]],
                    "end": aligned.clock[beyond[-1]],
                    "peak": aligned.clock[peak],
                    "direction": above if z[i, peak, feature] > 0 else below,
                    "size": differences[i, peak, feature],
                    "unit": units[feature],
                    "deviation": z[i, peak, feature],
                }
            )
        rows += sorted(departures, key=lambda row: -abs(row["deviation"]))[:_MOST]
    return pd.DataFrame(rows, columns=_COLUMNS)


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
