"""PartSynchronizer: a warp for each part of the body, coupled to the warp of the whole body."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import replace
from numbers import Real
from typing import NamedTuple

import numpy as np
import pandas as pd
from scipy.stats import t as student
from sklearn.base import clone
from sklearn.utils._param_validation import Interval

from ..body.limbs import names_of_poses, parts_of_names
from ..inputs.features import choose_features
from ..inputs.trial_facts import TrialFacts
from ..inputs.types import (
    Features,
    Indexed,
    Labels,
    SupportsArray,
    TrialsLike,
    Unit,
    ValuesLike,
)
from ..inputs.validation import names_of_input
from ..inputs.wording import counted
from ..matching.anchors import add_ramps
from ..matching.counting import whole
from ..matching.gaps import add_weights
from ..matching.matcher import PartWarper
from ..matching.warps import normalise
from ..utils.groups import encode_groups
from ..utils.parallel import Progress, one_blas_thread, run
from ..utils.parameters import validated_with_nested
from .base import AnchoredSynchronizer
from .dense import DenseSynchronizer
from .learning import MOST_LEARNT, warp_in_portions
from .match import Match

# What is in no part; no part may have this name.
_REST = "rest"
# Fitted attributes of the synchronizer of the whole body that are also those of the parts.
_SHARED = (
    "pattern_",
    "pattern_index_",
    "n_frames_",
    "global_distances_",
    "lengths_",
    "examples_",
    "features_",
    "keyframes_",
    "n_features_in_",
    "feature_names_in_",
    "_names_in",
    "_facts_in",
    "_fitted_on_rows",
    "_filler",
)


class PartSynchronizer(AnchoredSynchronizer):
    """Synchronise parts of the body, each by a warp of its own, coupled to the body's warp.

    A single warp for the whole body cannot show that an arm is late while the legs are not: the
    delay stays in the synchronised poses. Here every part has its own warp, and ``lags`` reports
    how much later each part is than it usually is, and than the others are.

    1. A `DenseSynchronizer` matches the whole body to the pattern: tau_body.
    2. Each part is matched to the same pattern by way of the same exemplars, by its own features,
       weighted as in the learnt metric. A coupling term is added to the local cost of Eq. 12::

           lambda (d - d_body)^2

       where d_body is the body's offset between the same two trials, and lambda is ``coupling``
       times the mean squared norm of the part's features, with d in per cent of the clock.
    3. ``transform`` samples every part at its own times. Features that belong to no part follow the
       body.

    Parameters
    ----------
    parts : dict of str to features, default=None
        The features of each part, by name or index. No feature may be in two parts. By default both
        arms, both legs and the trunk, if the features are direction cosines: recognised by their
        names, or as whole poses without names. For other features the default is no parts, and
        all of them follow the body. ``Skeleton.parts()`` gives the parts of an incomplete body.
        For joint positions, name the columns of each part.
    coupling : float, default=0.001
        Strength of the coupling of a part to the body, a pure number: 0 matches each part
        independently, infinity makes all parts follow the body. Useful values lie between 0.0001
        and 0.01; use 0 to measure lags of parts that move clearly.
    synchronizer : DenseSynchronizer, default=None
        Matches the whole body; a clone of it is fitted. Its settings hold for the parts too, except
        ``refine``. None is ``DenseSynchronizer()``.

    Attributes
    ----------
    synchronizer_ : DenseSynchronizer
        The fitted synchronizer of the whole body.
    parts_ : dict of str to ndarray of int
        Indices of the features of every part.
    pattern_ : ndarray, shape (P, n_features)
        The pattern on the common clock.
    pattern_index_ : int or None
        Index of the pattern in the training set; None if it was given as an array.
    n_frames_ : int
        ``P``.
    global_distances_ : ndarray, shape (n_sequences,)
        Global distances of the whole body, as of `DenseSynchronizer`.
    lengths_, examples_, features_, keyframes_
        Those of ``synchronizer_``.
    n_features_in_ : int
        Features of a frame (columns, for 2-D input).
    feature_names_in_ : ndarray of str
        Names of the features; only if the input had names.

    See Also
    --------
    DenseSynchronizer : One warp for the whole body.
    sklearn_motionsync.display.LagDisplay : Draws the lags.

    Notes
    -----
    ``match`` is that of the whole body, so scorers and displays give the same as for a
    `DenseSynchronizer`. Key-frames are those of the whole body, too, and a confidence weighs its
    frames. Parts are coupled to its warp, and may be early or late.

    A part that hardly moves, such as the idle arm of a grab, carries no information about timing:
    without coupling its warp and its lag are random. `Lags.summary` shows this as a large spread.
    The coupling reduces the mean distance of a part from the body; a single trial may still jump.

    References
    ----------
    A. Nakazawa, S. Nakaoka, K. Ikeuchi, "Matching and Blending Human Motions Using Temporal
    Scaleable Dynamic Programming", IROS 2004.

    Examples
    --------
    The right arm of the last of six bends is late, by 5 % of its time in the middle.

    >>> import numpy as np
    >>> from sklearn_motionsync import DenseSynchronizer, DirectionCosines, PartSynchronizer
    >>> from sklearn_motionsync.datasets import make_bending
    >>> bunch = make_bending(6, n_frames=100, random_state=0)
    >>> X = DirectionCosines(bunch.skeleton).fit_transform(bunch.data)
    >>> body = DenseSynchronizer(n_frames=100, pattern=0)
    >>> sync = PartSynchronizer(coupling=0, synchronizer=body).fit(X)
    >>> t, last = np.linspace(0, 1, len(X[5])), X[5].copy()
    >>> for k in sync.parts_["right arm"]:
    ...     last[:, k] = np.interp(t - 0.05 * np.sin(np.pi * t) ** 2, t, X[5][:, k])
    >>> lags = sync.lags([X[5], last], unit="percent")
    >>> change = lags.values[1] - lags.values[0]
    >>> dict(zip(lags.parts, change.max(axis=1).round(1).tolist()))
    {'left arm': 0.0, 'right arm': 5.3, 'left leg': 0.0, 'right leg': 0.0, 'trunk': 0.0}
    """

    _parameter_constraints: dict = {
        "parts": [Mapping, None],
        "coupling": [Interval(Real, 0, None, closed="both")],
        "synchronizer": [DenseSynchronizer, None],
    }

    def __init__(
        self,
        parts: Mapping[str, Features] | None = None,
        coupling: float = 0.001,
        synchronizer: DenseSynchronizer | None = None,
    ) -> None:
        self.parts = parts
        self.coupling = coupling
        self.synchronizer = synchronizer

    @validated_with_nested
    def _fit(self, X, keyframes, frame_rate, confidence):
        body = clone(DenseSynchronizer() if self.synchronizer is None else self.synchronizer)
        with self._progress(fits=True) as progress:
            with progress.fitting(body, "learning the body"):
                training = fit_body(body, X, keyframes, frame_rate, confidence)
            parts = choose_parts(self.parts, training.trials, names_of_input(body))
            warpers, usual, apart = learn_parts(body, training, parts, self.coupling, progress)
        shared = {name: value for name, value in vars(body).items() if name in _SHARED}
        self.__dict__.pop("feature_names_in_", None)
        self.__dict__.update(
            shared,
            synchronizer_=body,
            parts_=parts,
            _warpers=warpers,
            _usual=usual,
            _apart=apart,
        )

    def _match(self, trials, keyframes=None, frame_rate=None):
        return self.synchronizer_.match(trials, keyframes, frame_rate)

    def match_parts(
        self,
        X: TrialsLike,
        keyframes: Indexed[ValuesLike | None] | SupportsArray | None = None,
        frame_rate: float | ValuesLike | None = None,
    ) -> dict[str, Match]:
        """Match every part of trials to that of the pattern.

        Parameters
        ----------
        X : list of arrays (n_frames_i, n_features), 3-D array, or 2-D array
            Trials; the rows of a 2-D array are univariate ones.
        keyframes, frame_rate : default=None
            Of these trials, as for ``fit``.

        Returns
        -------
        dict of str to Match
            By part. ``distances`` are those of the part's own features, without the coupling; NaN
            for parts that only follow the body.
        """
        trials = self.check_trials(X)
        body = self.match(trials, **self._given(X, keyframes, frame_rate))
        return self._match_parts(trials, body, self.parts_)

    def lags(
        self,
        X: TrialsLike,
        groups: Labels | None = None,
        *,
        unit: Unit = "frames",
        frame_rate: float | ValuesLike | None = None,
    ) -> Lags:
        """How much later than the rest of the body each part is, at every frame of the pattern.

        Offsets of every part are counted from their mean over training trials: where people
        move an arm late, an arm that is as late has no lag. The rest of the body is late by what
        the other parts that move have in common, features of no part among them. So one part that
        is late, or two, leave the lags of the others as they are. How many parts must agree is
        learnt: all of them where parts of the training trials differ as much as they share, a
        majority where they move together.
        Coupling would draw late parts back, and others along: lags are those of parts that are
        matched without it, unlike those of `match_parts`. An infinite coupling leaves none.

        Parameters
        ----------
        X : list of arrays (n_frames_i, n_features), 3-D array, or 2-D array
            Trials; the rows of a 2-D array are univariate ones.
        groups : array-like of shape (n_sequences,), default=None
            The subject of each trial: then the report separates the spread within and
            between subjects.
        unit : {"frames", "percent", "seconds"}, default="frames"
            Unit of the lags, as in ``Match.offsets_in``.
        frame_rate : float, or array-like of shape (n_sequences,), default=None
            Frames per second of X, for seconds; by default what tables tell, as in
            `Match.to_frame`.

        Returns
        -------
        Lags
            One curve a trial and part.

        Raises
        ------
        ValueError
            If there are no parts, or not one group a trial.
        """
        trials = self.check_trials(X)
        if not self.parts_:
            raise ValueError(
                "There are no parts: they are not given, and the features are not recognised as "
                "direction cosines. Fit again with parts={name: features}, or skeleton.parts()."
            )
        if groups is not None:
            groups, _ = encode_groups(groups, len(trials))
        # Free of coupling, no part is drawn to the body, and its warp is not needed.
        even = np.tile(np.arange(self.n_frames_, dtype=np.float64), (len(trials), 1))
        matches = self._match_parts(trials, Match(even), self._warpers, free=True)
        facts, offsets = TrialFacts.of(trials, frame_rate), {}
        for name, match in matches.items():
            usual = Match(np.broadcast_to(self._usual[name], match.times.shape))
            offsets[name] = match.of_trials(facts).offsets_in(unit)
            offsets[name] -= usual.of_trials(facts).offsets_in(unit)
        moving = [name for name, warper in self._warpers.items() if warper is not None]
        # What does not move has no lag.
        lags = [
            offsets[name] - common_delay([offsets[x] for x in moving if x != name], self._apart)
            if name in moving
            else np.zeros_like(offsets[name])
            for name in self.parts_
        ]
        values = np.stack(lags, axis=1)
        return Lags(values, [*self.parts_], unit, groups)

    def _warped(self, trials, match):
        out = match.warp(trials)
        for name, of_part in self._match_parts(trials, match, self.parts_).items():
            columns = self.parts_[name]
            out[:, :, columns] = of_part.warp([x[:, columns] for x in trials])
        return out

    def _match_parts(self, trials, body, names, free=False):
        """Matches of parts by their names, perhaps free of the coupling to the body.

        What does not move has the warp of the body.
        """
        matches, sync = {}, self.synchronizer_
        trials = self._without_gaps(trials)
        for name in names:
            warper = self._warpers[name]
            if warper is None:
                matches[name] = Match(body.times)
                continue
            distances, times = warp_in_portions(
                replace(warper, weight=0.0) if free else warper,
                trials,
                body.times,
                n_jobs=sync.n_jobs,
                begin=lambda fits: Progress(self, sync.verbose),
                name=f"warping {name}",
            )
            matches[name] = Match(times, warper.matcher.features.back(distances))
        return matches


def fit_body(self, X, keyframes, frame_rate, confidence):
    """Fit the synchronizer of the whole body, a `DenseSynchronizer`: its `TrainingSet`."""
    return self._fit(X, keyframes, frame_rate, confidence)


def learn_parts(self, training, parts, coupling, progress):
    """Learn the warpers of parts, and how parts of the training trials move.

    Parameters
    ----------
    self : DenseSynchronizer
        Of the whole body, fitted.
    training : TrainingSet
        That it was fitted on.
    parts : dict of str to ndarray of int
        Indices of the features of every part.
    coupling : float
    progress : Progress

    Returns
    -------
    warpers : dict of str to PartWarper or None
        Of every part by name, and of all features of no part as ``"rest"``, if there are any. None
        for what does not move, and for an infinite coupling.
    usual : dict of str to ndarray (P,)
        The mean warp of each of them.
    apart : float
        As of `share_apart`.
    """
    trials, warper, n_frames = training.trials, self._warper, self.n_frames_
    n_exemplars = len(warper.to_exemplars)
    place = {number: row for row, number in enumerate(trials.numbers)}
    rows = [place[number] for number in self.exemplars_.tolist()]
    evenly = np.linspace(0, len(trials) - 1, min(len(trials), MOST_LEARNT))
    rows += evenly.round().astype(np.intp).tolist()
    index = None if self.pattern_index_ is None else place[self.pattern_index_]
    source = self.pattern_ if index is None else trials[index]
    # In double precision, as all that is warped.
    arrays = [x.astype(np.float64, copy=False) for x in [source, *(trials[k] for k in rows)]]
    columns = arrays
    if trials.weights is not None:
        weights = np.ones(len(source)) if index is None else trials.weights[index]
        columns = add_weights(columns, [weights, *(trials.weights[k] for k in rows)])
    if training.keyframes is not None:
        shares = self.keyframes_ / (n_frames - 1)
        columns = add_ramps(columns, [shares, *training.keyframes[rows]])
    with one_blas_thread():
        times = warper.warps(warper.positions(columns))[1]
    # The pattern keeps its own pace.
    times[0] = np.arange(n_frames)
    from_bases, body_times = np.split(times, [1 + n_exemplars])
    chosen, people = np.split(normalise(arrays, n_frames), [1 + n_exemplars])
    features_of = dict(parts)
    everything = np.arange(trials[0].shape[1])
    of_no_part = np.setdiff1d(everything, np.concatenate([*parts.values(), []]))
    if len(of_no_part):
        features_of[_REST] = of_no_part
    warpers = dict.fromkeys(features_of)
    warps = dict.fromkeys(features_of, body_times)
    if coupling < math.inf:
        on_clock = normalise(trials, n_frames)
        portions = [
            (features, warper, from_bases, on_clock, chosen, coupling, self._settings)
            for features in features_of.values()
        ]
        step = progress.stage("learning parts", len(portions))
        learnt = run(PartWarper.of, portions, n_jobs=self.n_jobs, prefer="threads", step=step)
        warpers = dict(zip(features_of, learnt, strict=True))
        moving = [name for name in features_of if warpers[name] is not None]
        portions = [(replace(warpers[name], weight=0.0), people, body_times) for name in moving]
        step = progress.stage("warping parts", len(portions))
        warped = run(_warps_of_part, portions, n_jobs=self.n_jobs, prefer="threads", step=step)
        warps |= dict(zip(moving, warped, strict=True))
    mean = {name: each.mean(axis=0) for name, each in warps.items()}
    apart = [warps[name] - mean[name] for name in features_of if warpers[name] is not None]
    share = share_apart(np.stack(apart)) if apart else 1.0
    return warpers, mean, share


def choose_parts(parts, trials, names):
    """Indices of the features of every part, by its name.

    Parameters
    ----------
    parts : mapping of str to features, or None
        Given by the user; None to recognise them by their names or as poses.
    trials : Trials
    names : sequence or None
        Of their features.
    """
    if parts is None:
        known = parts_of_names(names_of_poses(trials) if names is None else names)
        # Joints may be called neck or hip, too, which are of the trunk.
        return {} if [*known] == ["trunk"] else {part: np.array(k) for part, k in known.items()}
    names = [f"x{i}" for i in range(trials[0].shape[1])] if names is None else [*names]
    chosen, owner = {}, {}
    for part, features in parts.items():
        if not isinstance(part, str) or part == _REST:
            raise ValueError(
                f"The name of a part must be a string other than {_REST!r}; got {part!r}."
            )
        try:
            indices = choose_features([] if features is None else features, names)
        except ValueError as error:
            raise ValueError(f"Part {part!r}: {error}") from None
        for k in indices:
            if k in owner:
                raise ValueError(
                    f"Feature {names[k]!r} is in part {owner[k]!r} and again in {part!r}: a "
                    "feature has one warp. Name it once."
                )
            owner[k] = part
        chosen[part] = np.array(indices, dtype=np.intp)
    return chosen


def _warps_of_part(warper, positions, body):
    return warper.warps(positions, body)[1]


# -- lags, and what parts have in common --------------------------------------------------

# Level of the confidence intervals.
_CONFIDENCE = 0.95


class Lags(NamedTuple):
    """How much later than the rest of the body each part is, at every frame of the pattern.

    `PartSynchronizer.lags` returns them. Lags are counted from the mean of the training trials.
    Their spread shows whether a lag is a habit of subjects or varies from trial to trial.

    Parameters
    ----------
    values : ndarray, shape (n_sequences, n_parts, P)
        The lags: positive where a part is late, negative where it leads.
    parts : list of str
        Names of the parts.
    unit : {"frames", "percent", "seconds"}
        Unit of the values.
    groups : ndarray of int, shape (n_sequences,), default=None
        The subject of every trial, counted from 0.

    Examples
    --------
    Two subjects, two trials each. The arm of the second is always late by 4 frames.

    >>> import numpy as np
    >>> from sklearn_motionsync.synchronizers import Lags
    >>> values = np.repeat([0.0, 0.2, 4.0, 4.4], 5).reshape(4, 1, 5)
    >>> groups = np.array([0, 0, 1, 1])
    >>> lags = Lags(values, ["arm"], "frames", groups)
    >>> lags.summary()[["mean", "sd_within", "sd_between", "icc"]].round(2)
          mean  sd_within  sd_between   icc
    part
    arm   2.15       0.22        2.89  0.99

    Two subjects do not determine the mean of the population:

    >>> lags.summary()[["low", "high"]].round().to_numpy().tolist()
    [[-24.0, 28.0]]
    """

    values: np.ndarray
    parts: list[str]
    unit: Unit
    groups: np.ndarray | None = None

    def summary(self) -> pd.DataFrame:
        """The mean lag of a trial over the clock, and its spread, part by part.

        Returns
        -------
        DataFrame
            A row a part. ``mean`` over trials, or with groups over the means of subjects;
            ``sd`` over trials; ``low`` and ``high``, the 95 % confidence interval of the
            mean, by the t distribution over subjects, or over trials without groups. With
            groups also a one-way analysis of variance: ``sd_within`` and ``sd_between`` subjects,
            and ``icc``, the share of the variance between subjects, ICC(1,1): near 1 for a habit,
            near 0 for a lag that varies. NaN where there are too few trials or subjects.
        """
        columns = self._spread(self.values.mean(axis=2))
        return pd.DataFrame(columns, index=pd.Index(self.parts, name="part"))

    def over_time(self) -> pd.DataFrame:
        """The lag at every frame of the pattern, and its spread.

        Returns
        -------
        DataFrame
            A row a part and frame, columns as in ``summary``. Intervals are pointwise: at 5 % of
            the frames they miss the mean by chance.
        """
        n_frames = self.values.shape[2]
        index = pd.MultiIndex.from_product([self.parts, range(n_frames)], names=["part", "frame"])
        columns = self._spread(self.values.reshape(len(self.values), -1))
        return pd.DataFrame(columns, index=index)

    def __repr__(self):
        n_sequences, n_parts, n_frames = self.values.shape
        return (
            f"Lags({counted(n_parts, 'part')} of {counted(n_sequences, 'trial')} on "
            f"{n_frames} frames, in {self.unit})"
        )

    def _spread(self, values):
        """Mean and spread of columns of values (n_sequences, n_columns), by name."""
        if self.groups is None:
            mean, sd, n = values.mean(axis=0), _sd(values), len(values)
            return {"mean": mean, "sd": sd, **_interval(mean, sd, n)}
        counts = np.bincount(self.groups)
        means = np.stack([values[self.groups == g].mean(axis=0) for g in range(len(counts))])
        mean = means.mean(axis=0)
        within, between = _components(values, means, self.groups, counts)
        with np.errstate(invalid="ignore"):
            icc = between / (between + within)
        return {
            "mean": mean,
            "sd": _sd(values),
            **_interval(mean, _sd(means), len(means)),
            "sd_within": np.sqrt(within),
            "sd_between": np.sqrt(between),
            "icc": icc,
        }


def common_delay(offsets, apart):
    """What several parts have in common: what nearly all of them are late by, or early; or 0.

    It minimises the sum of the distances from all offsets, and, ``apart`` times as often, from 0;
    of equally good ones it is the farthest from 0. So a part that is shifted hardly moves it.

    Parameters
    ----------
    offsets : list of ndarray, shape (n_sequences, P)
        Of each part, counted from their means.
    apart : float
        From 0, where all parts of people have one offset, to 1, where they differ as much as they
        share.

    Returns
    -------
    ndarray, shape (n_sequences, P); or 0.0, if there are no parts
    """
    if not offsets:
        return 0.0
    count = len(offsets)
    agree = max(whole((1 + apart) / 2 * count, "up"), count // 2 + 1)
    ranked = np.sort(offsets, axis=0)
    return np.maximum(ranked[count - agree], 0) + np.minimum(ranked[agree - 1], 0)


def share_apart(offsets):
    """How far parts are from what they have in common, as a share of that; at most 1.

    Parameters
    ----------
    offsets : ndarray, shape (n_parts, n_sequences, P)
        Counted from their means.
    """
    common = np.median(offsets, axis=0)
    apart, shared = np.abs(offsets - common).mean(), np.abs(common).mean()
    return float(apart / shared) if apart < shared else 1.0


def _sd(values):
    """Standard deviations, NaN of fewer than two."""
    return values.std(axis=0, ddof=1) if len(values) > 1 else np.full(values.shape[1], np.nan)


def _interval(mean, sd, n):
    """The confidence interval of a mean."""
    quantile = student.ppf((1 + _CONFIDENCE) / 2, n - 1) if n > 1 else np.nan
    reach = quantile * sd / np.sqrt(n)
    return {"low": mean - reach, "high": mean + reach}


def _components(values, own, groups, counts):
    """Variances within and between groups of unequal counts, by a one-way analysis of variance.

    NaN if no group has two trials, or there is only one group.
    """
    n_groups, n = len(counts), len(values)
    within = between = np.full(values.shape[1], np.nan)
    if n > n_groups:
        within = np.square(values - own[groups]).sum(axis=0) / (n - n_groups)
    if n > n_groups > 1:
        squares = np.square(own - values.mean(axis=0))
        mean_square = (counts[:, np.newaxis] * squares).sum(axis=0) / (n_groups - 1)
        typical = (n - np.square(counts).sum() / n) / (n_groups - 1)
        between = np.maximum(mean_square - within, 0) / typical
    return within, between
