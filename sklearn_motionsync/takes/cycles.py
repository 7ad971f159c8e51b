"""CycleSegmenter: long takes of a movement that repeats, cut into its cycles."""

from __future__ import annotations

import warnings
from collections.abc import Sequence
from numbers import Integral, Real
from typing import Any, Literal, Self

import numpy as np
import pandas as pd
from sklearn.base import BaseEstimator, clone
from sklearn.utils._param_validation import Interval, StrOptions
from sklearn.utils.validation import check_is_fitted

from ..body.direction_cosines import DirectionCosines
from ..body.formats import SIDES
from ..body.joint_positions import JointPositions
from ..body.skeleton import Skeleton
from ..gait.events import LEAST_STEP, events_of
from ..gait.recordings import FOOT_STRIKE, Recordings
from ..inputs.collections import as_collection
from ..inputs.facts import TIMELESS
from ..inputs.features import choose_features, names_of_features
from ..inputs.findings import warn_of_findings
from ..inputs.resampling import as_frame_rates
from ..inputs.types import TrialsLike, ValuesLike
from ..inputs.validation import check_input, names_of_input
from ..matching.counting import ROUNDING, first_largest
from ..utils.parallel import LongWorkMixin
from ..utils.parameters import FRAME_RATE, validated
from .cutting import as_takes, cut_takes
from .self_correlation import LEAST_CYCLES, correlate, rejection_reason
from .stretches import (
    FOLLOWS,
    PHASES,
    SampledStretch,
    Stretch,
    average_cycle,
    circular_peak,
    constant_phases,
    find_repeats,
    locate_cycles,
    match_phases,
    move_to_events,
    similarity,
    summary_of,
)

# A fit matches the takes to the pattern, and estimates it again, so many times.
_ROUNDS = 2
# Cycles are as long as the learnt ones up to the first ratio, and the same up to the second.
_AS_LONG, _SAME = 1.25, 1.001
# Cycles are warned of outside these shares of the period of their take. Right cuts of walks, jogs
# and exercises lasted 0.68 to 1.31 of it, and those through several repetitions more than 1.5.
_SHORT, _LONG = 0.6, 1.5
_COLUMNS = {
    "take": int,
    "stretch": int,
    "start": int,
    "stop": int,
    "complete": bool,
    "score": float,
}


# The foot whose strike begins a cycle.
STRIKES = {f"{side} strike": side for side in SIDES}


class CycleSegmenter(LongWorkMixin, BaseEstimator):
    """Cut long takes of walking, running, or any movement that repeats, into its cycles.

    A take is one recording of several repetitions. A cycle is one repetition: it becomes one trial
    (trial).

    1. Stretches are the parts of a take in which it repeats. Standing, turning, starting and
       stopping are in none. `self_correlation` of a stretch gives its period. A take with a stretch
       is cyclic.
    2. The pattern of one cycle is the mean of the cycles of all stretches at constant period.
    3. Dense matching aligns every stretch with the pattern, repeated periodically: a path may
       begin and end at any phase. The pattern is averaged again, twice.
    4. The pattern begins where a foot is farthest ahead, in gait, or where a feature is largest.
    5. Stretches are cut where their phase is a whole number.

    What is in no stretch is left out. So are the pieces of a stretch before the first cut and after
    the last one, and cycles that do not follow the pattern; ``incomplete=True`` returns these. A
    piece can hold almost a whole repetition.

    Takes that are segmented later are aligned with the pattern of ``fit``, so all are cut at the
    same phase. A take gives several trials, hence `segment` and no ``transform``.

    Parameters
    ----------
    skeleton : Skeleton, default=None
        Skeleton of joint positions: then directions of limbs are compared, independent of path and
        heading, and the positions are cut as they are. None compares the features themselves, each
        weighted by its variance.
    start : {"left", "right", "ahead", "left strike", "right strike"}, str or int, default=None
        Where cycles begin. With a skeleton ``"left"`` or ``"right"``: where that ankle is farthest
        ahead of the pelvis, some hundredths of a second before the foot strikes; ``"ahead"``: the
        same for the foot that comes farther; ``"left strike"`` or ``"right strike"``: where that
        foot strikes, by `gait_events`, which needs the frame rate. Or a compared feature, by name
        or index: where it is largest. In pictures, where y runs down, the y of a hip is largest
        where the hip is lowest; change its sign to cut where the hip is highest. None is
        ``"ahead"`` for gait: the skeleton has feet in space, and in the mean cycle their places
        ahead of the pelvis, left less right, change by at least 0.15 leg lengths. For other
        movements it is the feature that repeats best: see ``start_``.
    threshold : float, default=0.4
        The self-correlation from which a stretch is cyclic, from 0 to 1. The limit is higher where
        chance correlations are larger: for movements in few directions (``breadth`` of
        `self_correlation`) up to ``(1 + 2 threshold) / 3`` for a single feature; below two cycles
        it is divided by ``sqrt(n_cycles - 1)``; and if the take moves in other places, too.
    refine : bool, default=True
        Whether stretches are matched to the pattern; False cuts at their constant mean period.
    incomplete : bool, default=False
        Whether to return the pieces of a stretch before its first and after its last whole cycle,
        and cycles that do not follow the pattern, too. They are trials with ``complete`` False in
        the table of `segment`. False leaves them out.
    not_cyclic : {"raise", "skip"}, default="raise"
        What to do with a take without a stretch of at least 1.6 cycles.
    period : (float, float), default=None
        Least and largest number of frames of a cycle, for takes in which several cycles fit: a step
        and two, where every second one is stronger. None takes the shortest of those that repeat
        best, and warns of the others. After ``fit`` it is the only one as long as the cycles that
        were learnt, within a quarter, if there is one, without a warning.
    frame_rate : float, or array-like of shape (n_takes,), default=None
        Frames a second, for strikes; by default what tables tell.

    Attributes
    ----------
    pattern_ : ndarray, shape (32, 2 * n_compared)
        The mean cycle from its start on: poses less the mean of their take, and velocities, each
        divided by its root mean square.
    start_ : str
        What begins a cycle: ``"left"``, ``"right"``, ``"left strike"``, ``"right strike"``, or the
        name of a feature.
    periods_ : ndarray, shape (n_takes,)
        Frames of a cycle of each take, in its longest stretch; NaN for takes that were skipped.
    n_features_in_ : int
        Features of a frame.
    feature_names_in_ : ndarray of str
        Names of the columns; only if the input had names.

    See Also
    --------
    self_correlation : The first step by itself.
    io.cut_at_events : Where events are known.

    Notes
    -----
    Gaps (NaN) are refused: fill them before, as by `io.fill_gaps`.

    A cycle lasts at least half the mean period of its stretch. The pace may change slowly, by a
    fifth and more. Fit takes of different movements separately, as they have no common pattern;
    stretches that do not follow it are left out. Scale features of different units before, with
    ``FrameWise(StandardScaler())``.

    Examples
    --------
    >>> from sklearn_motionsync.takes import CycleSegmenter
    >>> from sklearn_motionsync.datasets import make_gait
    >>> bunch = make_gait(4, n_cycles=5, takes=True, random_state=0)
    >>> segmenter = CycleSegmenter(start=0).fit(bunch.data[:3])
    >>> cycles, locations = segmenter.segment(bunch.data[3:])
    >>> len(cycles), cycles[0].shape[1]
    (5, 4)
    >>> locations[["take", "start", "stop"]].iloc[0].tolist()
    [0, 18, 119]
    >>> segmenter.report([bunch.data[3], bunch.data[3][:155]])["reason"].tolist()
    ['', 'holds 1.55 cycles']
    """

    _parameter_constraints: dict = {
        "skeleton": [Skeleton, None],
        "start": [str, Integral, None],
        "threshold": [Interval(Real, 0, 1, closed="both")],
        "refine": ["boolean"],
        "incomplete": ["boolean"],
        "not_cyclic": [StrOptions({"raise", "skip"})],
        "period": [tuple, list, np.ndarray, None],
        "frame_rate": [FRAME_RATE, "array-like", None],
    }

    def __init__(
        self,
        skeleton: Skeleton | None = None,
        start: str | int | None = None,
        threshold: float = 0.4,
        refine: bool = True,
        incomplete: bool = False,
        not_cyclic: Literal["raise", "skip"] = "raise",
        period: Sequence[float] | np.ndarray | None = None,
        frame_rate: float | ValuesLike | None = None,
    ) -> None:
        self.skeleton = skeleton
        self.start = start
        self.threshold = threshold
        self.refine = refine
        self.incomplete = incomplete
        self.not_cyclic = not_cyclic
        self.period = period
        self.frame_rate = frame_rate

    @validated
    def fit(self, X: TrialsLike, y: object = None) -> Self:
        """Learn one cycle, and where it begins.

        Parameters
        ----------
        X : list of arrays (n_frames_i, n_features), 3-D array, or one take (n_frames, n_features)
            Takes.
        y : ignored
            Present for API consistency.

        Returns
        -------
        self : CycleSegmenter
            The fitted segmenter.

        Raises
        ------
        ValueError
            If the input breaks the contract; a take is not cyclic or too short and
            ``not_cyclic="raise"``; no take is left; or there is no such `start`.
        """
        collection, takes = check_takes(self, X, reset=True)
        if self.frame_rate is not None:
            as_frame_rates(self.frame_rate, len(takes))
        strikes = strikes_of(self, collection) if self.start in STRIKES else None
        with self._progress(fits=True) as progress:
            step = progress.stage("correlating takes", len(takes))
            features, repeats = correlate_takes(self, collection, takes, step)
            cyclic = self._select_cyclic(takes, repeats)
            if not cyclic:
                n = len(takes)
                none = "The take is not" if n == 1 else f"None of the {n} takes is"
                raise ValueError(
                    f"{none} cyclic. See report(X); give takes that repeat, or another threshold."
                )
            stretches = [(i, stretch) for i in cyclic for stretch in repeats[i].stretches]
            sampled = [SampledStretch(features[i], stretch) for i, stretch in stretches]
            phases = self._learn_phases(sampled, progress)
            pattern = average_cycle([t.values for t in sampled], phases)
            follow = [
                k
                for k, (t, p) in enumerate(zip(sampled, phases, strict=True))
                if similarity(pattern, t, p) >= FOLLOWS
            ]
            if 0 < len(follow) < len(stretches):
                # The others show another movement.
                stretches = [stretches[k] for k in follow]
                sampled = [sampled[k] for k in follow]
                phases = self._learn_phases(sampled, progress)
            cyclic = sorted({i for i, _ in stretches})
            takes_of = [cyclic.index(i) for i, _ in stretches]
            if strikes is not None:
                frames = [strikes[i] for i, _ in stretches]
                name, start = self.start, _phase_of(self.start, frames, sampled, phases)
            else:
                curves = start_curves(
                    self, [collection[i] for i in cyclic], [features[i] for i in cyclic]
                )
                name, start = self._find_start(curves, sampled, takes_of, phases)
            pattern = average_cycle([t.values for t in sampled], [p - start for p in phases])
            periods = np.full(len(takes), np.nan)
            for i in cyclic:
                summary = summary_of([stretch for k, stretch in stretches if k == i])
                periods[i] = summary.correlation.period
        self.start_, self.pattern_, self.periods_ = name, pattern, periods
        return self

    def segment(self, X: TrialsLike) -> tuple[list[Any], pd.DataFrame]:
        """Cut takes into cycles.

        Every cycle begins at the phase that `start` defines: about the frame where a foot is
        farthest ahead, or where the feature is largest. What precedes the first such frame of a
        stretch, and what follows the last one, is left out; ``incomplete=True`` returns it, too.

        Parameters
        ----------
        X : list of arrays (n_frames_i, n_features), 3-D array, or one take (n_frames, n_features)
            Takes.

        Returns
        -------
        trials : list of ndarray, or of DataFrame, (n_frames_i, n_features)
            The cycles, one trial each, take by take, in order of time. The last frame of a cycle is
            the first of the next one, so both show the same phase. Cycles of DataFrames are
            labelled by the label of the take and their number, and `to_frame` makes one table of
            them.
        locations : DataFrame
            One row a trial: ``take``, index or label of the take, to group by; ``stretch``,
            the number of the stretch in the take, from 0; ``start`` and ``stop``, frames of the
            take, ``stop`` excluded; ``complete``, whether it is a whole cycle that follows the
            pattern; ``score``, its cosine similarity to the pattern, at most 1. A cycle follows
            the pattern from a score of 0.5 on. The first and the last cycle of a stretch also move
            at 0.85 of its speed where they begin and end, if the take goes on there.

        Raises
        ------
        ValueError
            As from ``fit``; but the lists are empty if no take is left.

        Warns
        -----
        UserWarning
            If a whole cycle lasts less than 0.6 or more than 1.5 periods of its stretch. A long one
            may hold several repetitions, or a rest; a short one may be a part of a repetition. A
            take in which several cycles fit has the warning of ``fit`` instead.
        """
        check_is_fitted(self, "pattern_")
        collection, takes = check_takes(self, X, reset=False)
        rows, periods = [], []
        for i, number, stretch, sampled, phases in self._phases(collection, takes):
            cycles = locate_cycles(sampled, phases, self.pattern_, self.incomplete)
            cycles_of_stretch = [(i, number, *row) for row in cycles]
            rows += cycles_of_stretch
            # Where several cycles fit there was a warning of that.
            correlation = stretch.correlation
            periods += [correlation.period if len(correlation.periods) == 1 else np.nan] * len(
                cycles_of_stretch
            )
        table = pd.DataFrame(rows, columns=list(_COLUMNS)).astype(_COLUMNS)
        # Whole cycles that are far longer or far shorter than the period of their stretch.
        shares = ((table["stop"] - 1 - table["start"]) / np.array(periods))[table["complete"]]
        odd = shares[(shares < _SHORT) | (shares > _LONG)]
        if not odd.empty:
            row = odd.index[0]
            i, start, stop = table.loc[row, ["take", "start", "stop"]]
            content = "only a part of a repetition"
            if odd[row] > 1:
                content = "several repetitions, or a rest"
            warnings.warn(
                f"{takes.called(i)}: the cycle from start {start} to stop {stop} has "
                f"{stop - start} frames, but the period of the take is {periods[row]:.1f}. It may "
                f"hold {content}. This holds for {len(odd)} of {len(shares)} whole cycles. Look at "
                "the cuts with CycleDisplay, leave such cycles out by 'start' and 'stop' of the "
                "table, or cut by other features.",
                UserWarning,
                stacklevel=2,
            )
        return cut_takes(collection, takes, table)

    def report(self, X: TrialsLike) -> pd.DataFrame:
        """Whether takes are cyclic, and where, by their self-correlation; no fit is needed.

        Parameters
        ----------
        X : list of arrays (n_frames_i, n_features), 3-D array, or one take (n_frames, n_features)
            Takes.

        Returns
        -------
        DataFrame
            One row a take, indexed by its label: ``n_frames``; ``period``, frames of a cycle, NaN
            without any; ``n_cycles``, of all stretches; ``strength``, the self-correlation at the
            period; ``cyclic``, whether it can be segmented; the ``reason`` why not; ``periods``, of
            all cycles that fit; and ``stretches``, a list of their first frames and of the frames
            after their last ones. Period, strength and periods are those of the longest stretch, or
            of the take if it has none.
        """
        self._validate_params()
        collection, takes = check_takes(clone(self), X, reset=True)
        rows = []
        for x, (stretches, correlation, reason) in zip(
            takes, correlate_takes(self, collection, takes)[1], strict=True
        ):
            measures = correlation.period, correlation.n_cycles, correlation.strength
            ends = [(stretch.start, stretch.stop) for stretch in stretches]
            rows.append((len(x), *measures, not reason, reason, correlation.periods.tolist(), ends))
        columns = ["n_frames", "period", "n_cycles", "strength", "cyclic", "reason", "periods"]
        columns.append("stretches")
        index = pd.Index(takes.labels, tupleize_cols=False, name="take")
        return pd.DataFrame(rows, columns=columns, index=index)

    def _select_cyclic(self, takes, repeats):
        """Indices of the takes that are cyclic; an error if others are not to be skipped."""
        cyclic = [i for i, (_, _, reason) in enumerate(repeats) if not reason]
        if len(cyclic) < len(takes) and self.not_cyclic == "raise":
            i, (_, best, reason) = next((i, r) for i, r in enumerate(repeats) if r.reason)
            within = "" if self.period is None else f" within period={self.period}"
            raise ValueError(
                f"{takes.called(i)}: {reason}{within}. Its self-correlation is "
                f"{best.strength:.2f} at {best.n_cycles:.2f} cycles; "
                f"threshold={self.threshold:g} and at least {LEAST_CYCLES} cycles are required. "
                'Leave it out, give a longer take, or set not_cyclic="skip"; see report(X).'
            )
        several = {
            i: stretch.correlation
            for i in reversed(cyclic)
            for stretch in repeats[i].stretches
            if len(stretch.correlation.periods) > 1
        }
        if several:
            i, first = min(several.items(), key=lambda item: item[0])
            periods = ", ".join(f"{period:.1f}" for period in first.periods)
            warnings.warn(
                f"{takes.called(i)}: several cycles fit, of {periods} frames; "
                f"{first.period:.1f} is taken. This holds for {len(several)} of {len(takes)} "
                "takes. Give period=(least, largest), in frames, to choose; report(X)['periods'] "
                "lists what fits.",
                UserWarning,
                stacklevel=4,
            )
        return cyclic

    def _phases(self, collection, takes):
        """Yield, for every stretch of every cyclic take, what is known of it.

        Index of the take, number of the stretch in it, the stretch, its samples, and their phases.
        """
        features, repeats = correlate_takes(self, collection, takes)
        repeats = [as_learnt(self, x, f) for x, f in zip(features, repeats, strict=True)]
        align = match_phases if self.refine else constant_phases
        strikes = strikes_of(self, collection) if self.start_ in STRIKES else None
        for i in self._select_cyclic(takes, repeats):
            for number, stretch in enumerate(repeats[i].stretches):
                sampled = SampledStretch(features[i], stretch)
                phases = align(self.pattern_, sampled)
                if strikes is not None:
                    phases = move_to_events(sampled.times, phases, strikes[i])
                yield i, number, stretch, sampled, phases

    def _learn_phases(self, sampled, progress):
        """Phases of takes without a pattern: at constant pace one by one, then matched."""
        values, phases = [take.values for take in sampled], []
        for k, take in enumerate(sampled):
            phases.append(
                constant_phases(average_cycle(values[:k], phases), take) if k else take.mean_phases
            )
        rounds = _ROUNDS if self.refine else 0
        step = progress.stage("matching takes", rounds * len(sampled))
        for _ in range(rounds):
            pattern, phases = average_cycle(values, phases), []
            for take in sampled:
                phases.append(match_phases(pattern, take))
                step()
        return phases

    def _find_start(self, curves, sampled, takes_of, phases):
        """The name of what begins a cycle, and its phase in the pattern."""
        cycles = {
            name: average_cycle(
                [
                    stretch.sample(of_all[k][stretch.inside, np.newaxis])
                    for stretch, k in zip(sampled, takes_of, strict=True)
                ],
                phases,
            )[:, 0]
            for name, of_all in (curves or {}).items()
        }
        # In gait the feet step, by their places ahead of the pelvis.
        if not cycles or (
            self.start is None and np.ptp(cycles[SIDES[0]] - cycles[SIDES[1]]) < LEAST_STEP
        ):
            width = sampled[0].values.shape[1] // 2
            values = [take.values[:, :width] for take in sampled]
            mean = average_cycle(values, phases)
            repeats = np.square(mean).mean(axis=0)
            moves = np.square(np.concatenate(values)).mean(axis=0)
            # What moves less is rounding.
            moves = np.where(moves > ROUNDING * moves.max(), moves, np.inf)
            best = first_largest(repeats / moves)
            return compared_names(self)[best], circular_peak(mean[:, best]) / PHASES
        name = list(cycles)[first_largest([cycle.max() for cycle in cycles.values()])]
        return name, circular_peak(cycles[name]) / PHASES


# -- takes, and what is compared of them --------------------------------------------------


def check_takes(segmenter, X, *, reset):
    """Takes as they were given, a single one as a list, and checked."""
    X = as_takes(X)
    # A period is that of its take, at any frame rate.
    facts = TIMELESS if segmenter.period is None else None
    takes = check_input(segmenter, X, reset=reset, level="sequence", facts=facts)
    if reset:
        warn_of_findings(takes, names_of_input(segmenter))
    return as_collection(X), takes


def correlate_takes(segmenter, collection, takes, step=None):
    """The compared features of takes, in float64, and what repeats in them.

    The features are the directions of limbs if there is a skeleton, else those of the takes.
    """
    limits = segmenter.period
    if limits is not None:
        limits = tuple(limits)
        good = len(limits) == 2 and all(isinstance(n, Real) for n in limits)
        if not (good and 2 <= limits[0] <= limits[1]):
            raise ValueError(
                "period must be two numbers of frames, the least, at least 2, and the largest, of "
                f"a cycle; got {segmenter.period!r}."
            )
    if segmenter.skeleton is not None:
        cosines = DirectionCosines(segmenter.skeleton).set_output(transform="default")
        takes = cosines.fit_transform(collection)
    features = [np.asarray(x, dtype=np.float64) for x in takes]
    repeats = []
    for x in features:
        repeats.append(find_repeats(x, segmenter.threshold, limits))
        if step is not None:
            step()
    return features, repeats


def as_learnt(segmenter, features, repeats):
    """What repeats in a take, at the only cycle that is as long as those of the fit.

    A stretch stays as it is if one cycle fits, or none or several are as long.
    """
    learnt, stretches = segmenter.periods_, []
    for stretch in repeats.stretches:
        fits = stretch.correlation.periods
        near = (fits >= np.nanmin(learnt) / _AS_LONG) & (fits <= np.nanmax(learnt) * _AS_LONG)
        if len(fits) > 1 and near.sum() == 1:
            (period,) = fits[near]
            inside = features[stretch.start : stretch.stop]
            chosen = correlate(inside, (period / _SAME, period * _SAME))
            if not rejection_reason(chosen, segmenter.threshold):
                stretches.append(Stretch(stretch.start, stretch.stop, chosen))
                continue
        stretches.append(stretch)
    return summary_of(stretches) if stretches else repeats


def compared_names(segmenter):
    """Names of the compared features."""
    if segmenter.skeleton is not None:
        return list(DirectionCosines(segmenter.skeleton).get_feature_names_out())
    return names_of_features(None, segmenter, segmenter.n_features_in_)


def start_curves(segmenter, X, features):
    """Curves of takes; a cycle begins at the maximum of the one with the largest maximum.

    They are lists by name, with one curve (n_frames_i,) a take; None where any feature will do.
    """
    start, skeleton = segmenter.start, segmenter.skeleton
    # Whether the skeleton shows how far each foot is ahead of the pelvis.
    has_feet = (
        skeleton is not None
        and skeleton.n_dims == 3
        and bool({"hip", "shoulder"} & set(skeleton.limbs))
        and {"pelvis", "left_ankle", "right_ankle"} <= set(skeleton.landmarks)
    )
    if start is None and not has_feet:
        return None
    start = STRIKES.get(start, start)
    if start in (None, "ahead") or (start in SIDES and skeleton is not None):
        if not has_feet:
            raise ValueError(
                f"start={start!r} needs a skeleton in space with a pelvis, hips or shoulders, and "
                f"both ankles; got skeleton={skeleton!r}. Give the name or index of a feature: "
                f"{', '.join(compared_names(segmenter))}."
            )
        positions = JointPositions(skeleton).set_output(transform="default").fit(X)
        names, places = list(positions.get_feature_names_out()), positions.transform(X)
        columns = {s: names.index(f"{s}_ankle_z") for s in ([start] if start in SIDES else SIDES)}
        return {side: [x[:, k].astype(np.float64) for x in places] for side, k in columns.items()}
    names = compared_names(segmenter)
    (k,) = choose_features([start], names)
    return {names[k]: [x[:, k] for x in features]}


def strikes_of(segmenter, X):
    """The frames of takes at which the foot of ``start`` strikes, with fractions."""
    if segmenter.skeleton is None:
        raise ValueError(
            f"start={segmenter.start!r} needs skeleton=, that of joint positions, and the frame "
            "rate: frame_rate=, or tables that tell it."
        )
    recordings = Recordings(X, segmenter.skeleton, None, segmenter.frame_rate)
    side, strikes = STRIKES[segmenter.start], []
    for i in range(len(recordings)):
        walk = recordings.walk(i)
        wanted = FOOT_STRIKE, side
        strikes.append(np.array([k for *kind, k in events_of(walk) if tuple(kind) == wanted]))
        strikes[-1] = strikes[-1] / walk.per_frame
    return strikes


def _phase_of(start, strikes, sampled, phases):
    """The phase at which feet strike, in the mean of stretches."""
    at = [
        np.interp(
            strikes_of_take[
                (strikes_of_take >= take.times[0]) & (strikes_of_take <= take.times[-1])
            ],
            take.times,
            of_take,
        )
        for strikes_of_take, take, of_take in zip(strikes, sampled, phases, strict=True)
    ]
    at = np.concatenate(at)
    if not len(at):
        raise ValueError(f"No {start} is found where the takes repeat; look at gait_events(X).")
    return float(np.angle(np.exp(2j * np.pi * at).mean()) / (2 * np.pi))
