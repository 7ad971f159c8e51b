"""CycleSegmenter: long takes of a movement that repeats, cut into its cycles."""

from __future__ import annotations

import warnings
from collections.abc import Sequence
from itertools import chain
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
from .decoder import (
    AS_LONG,
    PHASES,
    Stretch,
    circular_peak,
    cut_cycles,
    follow,
    learn_cycle,
    mean_of,
    move_to_events,
    period_of,
    slowest_near,
)
from .self_correlation import (
    LEAST_CYCLES,
    Repetition,
    correlate,
    find_repeats,
    rejection_reason,
    summary_of,
)

# A fit follows the pattern in the takes, and estimates it again, so many times.
_ROUNDS = 2
# Cycles are the same up to this ratio.
_SAME = 1.001
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


# Why a take is refused after a fit.
_UNLIKE = "does not follow the pattern"
# The foot whose strike begins a cycle.
STRIKES = {f"{side} strike": side for side in SIDES}


class CycleSegmenter(LongWorkMixin, BaseEstimator):
    """Cut long takes of walking, running, or any movement that repeats, into its cycles.

    A take is one recording of several repetitions. A cycle is one repetition, which becomes one
    trial.

    1. Where a take repeats, `self_correlation` gives its period. A take that does is cyclic.
    2. The pattern of one cycle is the mean of the cycles of all takes, first at constant period,
       then matched.
    3. Every frame of a take is rest, another movement, or the cycle at some phase. Dynamic
       programming finds the cheapest path. Its stretches of the cycle are the parts of the take
       that are cut. Standing, turning and other movements are in none. The pattern is averaged
       again over them, twice; so a take that repeats too seldom by itself teaches, too.
    4. The pattern begins where a foot is farthest ahead, in gait; where the movement rests or
       turns; or where a feature is largest.
    5. Stretches are cut where their phase is a whole number.

    The first and the last repetition of a stretch are whole if at most 2 % of the movement of the
    pattern is missing at an end, by the energy of its velocities; 5 % if cycles begin where the
    movement rests or turns. Shorter pieces are left out; ``incomplete=True`` returns them.

    Takes that are segmented later are aligned with the pattern of ``fit``, so all are cut at the
    same phase. A take gives several trials, hence `segment` and no ``transform``.

    Parameters
    ----------
    skeleton : Skeleton, default=None
        Skeleton of joint positions: then directions of limbs are compared, independent of path and
        heading, and the positions are cut as they are. None compares the features themselves, each
        weighted by its variance.
    start : str or int, default=None
        Where cycles begin. With a skeleton ``"left"`` or ``"right"``: where that ankle is farthest
        ahead of the pelvis, some hundredths of a second before the foot strikes; ``"ahead"``: the
        same for the foot that comes farther; ``"left strike"`` or ``"right strike"``: where that
        foot strikes, by `gait_events`, which needs the frame rate. ``"rest"``: where the movement
        turns, of several such phases where the pose is most like those at the ends of stretches. Or
        a compared feature, by name or index: where it is largest. In pictures, where y runs down,
        the y of a hip is largest where the hip is lowest; change its sign to cut where the hip is
        highest. None is ``"ahead"`` for gait: the skeleton has feet in space, and in the mean cycle
        their places ahead of the pelvis, left less right, change by at least 0.15 leg lengths. For
        other movements it is ``"rest"``; for those that never turn, in which no squared velocity
        falls below a fourth of the mean, it is the feature that repeats best: see ``start_``.
    threshold : float, default=0.4
        The self-correlation from which a stretch is cyclic, from 0 to 1. The limit is higher where
        chance correlations are larger: for movements in few directions (``breadth`` of
        `self_correlation`) up to ``(1 + 2 threshold) / 3`` for a single feature; below two cycles
        it is divided by ``sqrt(n_cycles - 1)``; and if the take moves in other places, too.
    incomplete : bool, default=False
        Whether to return the pieces of a stretch before its first and after its last whole cycle,
        and cycles that do not follow the pattern, too. They are trials with ``complete`` False in
        the table of `segment`. False leaves them out.
    not_cyclic : {"raise", "skip"}, default="raise"
        What to do with a take in which nothing follows the pattern.
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
        What begins a cycle: ``"left"``, ``"right"``, ``"left strike"``, ``"right strike"``,
        ``"rest"``, or the name of a feature.
    periods_ : ndarray, shape (n_takes,)
        Median frames of a cycle of each take; NaN for takes that were skipped.
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

    A cycle lasts at least half the period of its take. A rest of more than about two periods parts
    two stretches; a shorter one lengthens the cycle that it is in. Fit takes of different movements
    separately, as they have no common pattern, and a movement of one side of the body for each
    side. Scale features of different units before, with ``FrameWise(StandardScaler())``.

    A take of one or two features must repeat by itself, as nearly all that goes up and down follows
    a cycle of these: give more features if it may hold a single repetition.

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
    [0, 19, 119]
    >>> segmenter.report([bunch.data[3], bunch.data[3][:155]])["n_cycles"].round(1).tolist()
    [5.5, 1.5]
    """

    _parameter_constraints: dict = {
        "skeleton": [Skeleton, None],
        "start": [str, Integral, None],
        "threshold": [Interval(Real, 0, 1, closed="both")],
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
        incomplete: bool = False,
        not_cyclic: Literal["raise", "skip"] = "raise",
        period: Sequence[float] | np.ndarray | None = None,
        frame_rate: float | ValuesLike | None = None,
    ) -> None:
        self.skeleton = skeleton
        self.start = start
        self.threshold = threshold
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
            followed: list[list[Stretch]] = [[] for _ in takes]
            learnt = learn_cycle(features, repeats, progress)
            for _ in range(_ROUNDS if learnt else 0):
                step = progress.stage("following the pattern", len(takes))
                followed = []
                for x, of_take in zip(features, repeats, strict=True):
                    followed.append(follow(x, of_take.stretches, *learnt))
                    step()
                if not any(followed):
                    break
                learnt = mean_of(followed), learnt[1]
            self._check_cyclic(takes, repeats, followed, fits=True)
            if not any(followed):
                n = len(takes)
                none = "The take is not" if n == 1 else f"None of the {n} takes is"
                raise ValueError(
                    f"{none} cyclic. See report(X); give takes that repeat, or another threshold."
                )
            name, start = self._find_start(collection, features, followed, strikes)
        self.start_, self.periods_ = name, np.array([period_of(each) for each in followed])
        self.pattern_ = mean_of(followed, start)
        return self

    def segment(self, X: TrialsLike) -> tuple[list[Any], pd.DataFrame]:
        """Cut takes into cycles.

        Every cycle begins at the phase that `start` defines: about the frame where a foot is
        farthest ahead, where the movement rests, or where the feature is largest. What precedes the
        first such frame of a stretch, and what follows the last one, is left out unless it is a
        whole cycle but for a rest; ``incomplete=True`` returns it, too.

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
            the pattern from a score of 0.5 on.

        Raises
        ------
        ValueError
            As from ``fit``; but the lists are empty if no take is left.

        Warns
        -----
        UserWarning
            If a whole cycle lasts less than 0.6 or more than 1.5 periods of its take. A long one
            may hold several repetitions, or a rest; a short one may be a part of a repetition. A
            take in which several cycles fit has the warning of ``fit`` instead.
        """
        check_is_fitted(self, "pattern_")
        collection, takes = check_takes(self, X, reset=False)
        rows, periods = [], []
        followed, repeats = self._follow(collection, takes)
        self._check_cyclic(takes, repeats, followed, fits=False)
        for i, stretches in enumerate(followed):
            # Where several cycles fit there was a warning of that.
            several = len(repeats[i].correlation.periods) > 1
            period = np.nan if several else period_of(stretches)
            for number, stretch in enumerate(stretches):
                pieces = cut_cycles(stretch, self.pattern_)
                pieces = [piece for piece in pieces if piece.complete or self.incomplete]
                rows += [(i, number, *piece) for piece in pieces]
                periods += [period] * len(pieces)
        table = pd.DataFrame(rows, columns=list(_COLUMNS)).astype(_COLUMNS)
        # Whole cycles that are far longer or far shorter than the period of their take.
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
        """Whether takes are cyclic, and where: what `segment` will cut.

        No fit is needed. Without one a take is judged by its self-correlation alone; after one,
        stretches and the number of cycles are those that follow the pattern.

        Parameters
        ----------
        X : list of arrays (n_frames_i, n_features), 3-D array, or one take (n_frames, n_features)
            Takes.

        Returns
        -------
        DataFrame
            One row a take, indexed by its label: ``n_frames``; ``period``, frames of a cycle, NaN
            without any; ``n_cycles``, of all stretches, with fractions; ``strength``, the
            self-correlation at the period; ``cyclic``, whether it can be segmented; the ``reason``
            why not; ``periods``, of all cycles that fit; and ``stretches``, a list of their first
            frames and of the frames after their last ones. Period, strength and periods are those
            of the longest stretch in which the take repeats by itself, or of the take if there is
            none.
        """
        self._validate_params()
        fitted = hasattr(self, "pattern_")
        collection, takes = check_takes(self if fitted else clone(self), X, reset=not fitted)
        if fitted:
            followed, repeats = self._follow(collection, takes)
        else:
            repeats = correlate_takes(self, collection, takes)[1]
        rows = []
        for i, (stretches, correlation, reason) in enumerate(repeats):
            n_cycles = correlation.n_cycles
            ends = [(stretch.start, stretch.stop) for stretch in stretches]
            if fitted:
                ends = [stretch.ends for stretch in followed[i]]
                n_cycles = sum(stretch.n_cycles for stretch in followed[i])
                reason = "" if ends else _UNLIKE
            measures = correlation.period, n_cycles, correlation.strength
            fits = correlation.periods.tolist()
            rows.append((len(takes[i]), *measures, not reason, reason, fits, ends))
        columns = ["n_frames", "period", "n_cycles", "strength", "cyclic", "reason", "periods"]
        columns.append("stretches")
        index = pd.Index(takes.labels, tupleize_cols=False, name="take")
        return pd.DataFrame(rows, columns=columns, index=index)

    def _follow(self, collection, takes):
        """What of takes follows the learnt cycle, a list for each, and what repeats in them."""
        features, repeats = correlate_takes(self, collection, takes)
        repeats = [as_learnt(self, x, each) for x, each in zip(features, repeats, strict=True)]
        period = float(np.nanmedian(self.periods_))
        followed = [
            follow(x, each.stretches, self.pattern_, period)
            for x, each in zip(features, repeats, strict=True)
        ]
        if self.start_ in STRIKES:
            followed = [
                [move_to_events(stretch, of_foot) for stretch in stretches]
                for stretches, of_foot in zip(followed, strikes_of(self, collection), strict=True)
            ]
        return followed, repeats

    def _check_cyclic(self, takes, repeats, followed, *, fits):
        """An error if a take, or all of them, follow no cycle; a warning if several cycles fit."""
        missing = [i for i, stretches in enumerate(followed) if not stretches]
        if missing and self.not_cyclic == "raise":
            i, (_, best, reason) = missing[0], repeats[missing[0]]
            within = "" if self.period is None else f" within period={self.period}"
            required = (
                f"Its self-correlation is {best.strength:.2f} at {best.n_cycles:.2f} cycles; "
                f"threshold={self.threshold:g} and at least {LEAST_CYCLES} cycles are required"
            )
            if not fits:
                reason = _UNLIKE
                required = "A whole cycle with a score of at least 0.5 is required"
            raise ValueError(
                f"{takes.called(i)}: {reason or _UNLIKE}{within}. {required}. Leave it out, give a "
                'longer take, or set not_cyclic="skip"; see report(X).'
            )
        several = {
            i: stretch.correlation
            for i in reversed(range(len(takes)))
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
                stacklevel=4 if fits else 3,
            )

    def _find_start(self, collection, features, followed, strikes):
        """The name of what begins a cycle, and its phase in the pattern."""
        if strikes is not None:
            return self.start, _phase_of(self.start, strikes, followed)
        curves = start_curves(self, collection, features) or {}
        cycles = {name: mean_of(followed, curves=of_all)[:, 0] for name, of_all in curves.items()}
        # In gait the feet step, by their places ahead of the pelvis.
        if cycles and (
            self.start is not None or np.ptp(cycles[SIDES[0]] - cycles[SIDES[1]]) >= LEAST_STEP
        ):
            name = list(cycles)[first_largest([cycle.max() for cycle in cycles.values()])]
            return name, circular_peak(cycles[name]) / PHASES
        pattern = mean_of(followed)
        poses = pattern[:, : pattern.shape[1] // 2]
        values = [stretch.values for stretch in chain(*followed)]
        slowest = slowest_near(pattern, np.mean([each[[0, -1]] for each in values], axis=(0, 1)))
        if slowest is not None:
            return "rest", slowest / PHASES
        if self.start == "rest":
            raise ValueError(
                "start='rest', but the movement never turns or rests: give a feature, or None."
            )
        repeats = np.square(poses).mean(axis=0)
        moves = np.square(np.concatenate(values)[:, : poses.shape[1]]).mean(axis=0)
        # What moves less is rounding.
        moves = np.where(moves > ROUNDING * moves.max(), moves, np.inf)
        best = first_largest(repeats / moves)
        return compared_names(self)[best], circular_peak(poses[:, best]) / PHASES


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
        near = (fits >= np.nanmin(learnt) / AS_LONG) & (fits <= np.nanmax(learnt) * AS_LONG)
        if len(fits) > 1 and near.sum() == 1:
            (period,) = fits[near]
            inside = features[stretch.start : stretch.stop]
            chosen = correlate(inside, (period / _SAME, period * _SAME))
            if not rejection_reason(chosen, segmenter.threshold):
                stretches.append(Repetition(stretch.start, stretch.stop, chosen))
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
    if start == "rest" or (start is None and not has_feet):
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


def _phase_of(start, strikes, followed):
    """The phase at which feet strike, in the mean of stretches."""
    at = []
    for of_foot, stretches in zip(strikes, followed, strict=True):
        for stretch in stretches:
            times = stretch.times
            inside = of_foot[(of_foot >= times[0]) & (of_foot <= times[-1])]
            at.append(np.interp(inside, times, stretch.phases))
    at = np.concatenate(at)
    if not len(at):
        raise ValueError(f"No {start} is found where the takes repeat; look at gait_events(X).")
    return float(np.angle(np.exp(2j * np.pi * at).mean()) / (2 * np.pi))
