"""CycleSegmenter: long takes of a movement that repeats, cut into its cycles."""

from __future__ import annotations

import warnings
from collections.abc import Sequence
from itertools import pairwise
from numbers import Integral, Real
from typing import Any, Literal, Self

import numpy as np
import pandas as pd
from scipy.fft import irfft, rfft
from sklearn.base import BaseEstimator, clone
from sklearn.utils._param_validation import Interval, StrOptions
from sklearn.utils.validation import check_is_fitted

from ..body.direction_cosines import DirectionCosines
from ..body.formats import SIDES
from ..body.joint_positions import JointPositions
from ..body.skeleton import Skeleton
from ..inputs.collections import as_collection
from ..inputs.facts import TIMELESS
from ..inputs.features import choose_features, names_of_features
from ..inputs.types import PerformancesLike
from ..inputs.validation import check_performances, names_of_input, warn_of_clocks
from ..matching.costs import StepTable, step_table
from ..matching.filters import smooth
from ..matching.trellis import Trellis
from ..matching.warps import normalise
from ..utils.atomic import atomic_fit, snapshot
from ..utils.doc_links import DocumentedMixin
from ..utils.parallel import LongWorkMixin
from ..utils.parameters import validated
from .cutting import as_takes, cut_takes
from .self_correlation import LEAST_CYCLES, correlate, rejection_reason

__all__ = [
    "CycleSegmenter",
    "as_learnt",
    "check_takes",
    "compared_names",
    "correlate_takes",
    "start_curves",
]

# A fit matches the takes to the template, and estimates it again, so many times.
_ROUNDS = 2
# Samples of a cycle, and positions per sample at which a path may stand.
PHASES, _SUBFRAMES = 32, 4
# Standard deviation, in samples, of the Gaussian derivative that gives velocities.
_WIDTH = 1
# Weight of (rho - 1)^2, for postures and velocities of mean square 1 each; the largest rate rho.
_SMOOTHNESS, _FASTEST = 0.3, 2
# Cycles are as long as the learnt ones up to the first ratio, and the same up to the second.
_AS_LONG, _SAME = 1.25, 1.001
# Cycles are warned of outside these shares of the period of their take. Right cuts last 0.68 to
# 1.31 of it, those through several repetitions more than 1.5 (``benchmarks/cycles.py``).
_SHORT, _LONG = 0.6, 1.5
# Largest offset of a path from the mean pace, in cycles: at its beginning, and more per cycle.
_BEGIN, _DRIFT = 0.55, 0.3
# Cycles of the portions in which long takes are matched, and of their overlap.
_PORTION, _OVERLAP = 16, 2
_COLUMNS = {"take": int, "start": int, "stop": int, "complete": bool, "score": float}


class CycleSegmenter(DocumentedMixin, LongWorkMixin, BaseEstimator):
    """Cut long takes of walking, running, or any movement that repeats, into its cycles.

    A take is one recording of several repetitions. A cycle is one repetition: it becomes one trial
    (performance).

    1. `self_correlation` gives the period of each take, and whether it is cyclic.
    2. The template of one cycle is the mean of the cycles of all takes at constant period.
    3. Dense matching aligns every take with the template, repeated periodically: a path may begin
       and end at any phase. The template is averaged again, twice.
    4. The template begins where a foot is farthest ahead, or where a feature is largest.
    5. Takes are cut where their phase is a whole number.

    The pieces before the first cut and after the last one are left out, without a warning. Such a
    piece can hold almost a whole repetition. ``incomplete=True`` returns both pieces, too.

    Takes that are segmented later are aligned with the template of ``fit``, so all are cut at the
    same phase. A take gives several performances, hence `segment` and no ``transform``.

    Parameters
    ----------
    skeleton : Skeleton, default=None
        Skeleton of joint positions: then directions of limbs are compared, independent of path and
        heading, and the positions are cut as they are. None compares the features themselves, each
        weighted by its variance.
    start : {"left", "right", "ahead"}, str or int, default=None
        Where cycles begin. With a skeleton ``"left"`` or ``"right"``: where that ankle is farthest
        ahead of the pelvis, about when the foot strikes; ``"ahead"``: the same for the foot that
        comes farther. Or a compared feature, by name or index: where it is largest. In
        pictures, where y runs down, the y of a hip is largest where the hip is lowest; change its
        sign to cut where the hip is highest. None is ``"ahead"`` if the skeleton has feet in space,
        otherwise the feature that repeats best: see ``start_``.
    threshold : float, default=0.4
        The self-correlation from which a take is cyclic, from 0 to 1. The limit is higher where
        chance correlations are larger: for movements in few directions (``breadth`` of
        `self_correlation`) up to ``(1 + 2 threshold) / 3`` for a single feature; below two cycles
        it is divided by ``sqrt(n_cycles - 1)``.
    refine : bool, default=True
        Whether takes are matched to the template; False cuts at their constant mean period.
    incomplete : bool, default=False
        Whether to return the pieces before the first and after the last whole cycle, too. They are
        trials with ``complete`` False in the table of `segment`. False leaves them out.
    not_cyclic : {"raise", "skip"}, default="raise"
        What to do with a take that is not cyclic, or has fewer than 1.6 cycles.
    period : (float, float), default=None
        Least and largest number of frames of a cycle, for takes in which several cycles fit: a step
        and two, where every second one is stronger. None takes the shortest of those that repeat
        best, and warns of the others. After ``fit`` it is the only one as long as the cycles that
        were learnt, within a quarter, if there is one, without a warning.

    Attributes
    ----------
    template_ : ndarray, shape (32, 2 * n_compared)
        The mean cycle from its start on: postures less the mean of their take, and velocities, each
        divided by its root mean square.
    start_ : str
        What begins a cycle: ``"left"``, ``"right"``, or the name of a feature.
    periods_ : ndarray, shape (n_takes,)
        Frames of a cycle of each take; NaN for takes that were skipped.
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

    A cycle lasts at least half the mean period of its take. The pace may change slowly, by a fifth
    and more. Fit takes of different movements separately, as they have no common template. Scale
    features of different units before, with ``FrameWise(StandardScaler())``.

    Examples
    --------
    >>> from sklearn_motionsync import CycleSegmenter
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
    ) -> None:
        self.skeleton = skeleton
        self.start = start
        self.threshold = threshold
        self.refine = refine
        self.incomplete = incomplete
        self.not_cyclic = not_cyclic
        self.period = period

    @atomic_fit
    @validated
    def fit(self, X: PerformancesLike, y: object = None) -> Self:
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
        given, takes = check_takes(self, X, reset=True)
        with self._progress(fits=True) as progress:
            step = progress.stage("correlating takes", len(takes))
            features, found = correlate_takes(self, given, takes, step)
            kept = self._select_cyclic(takes, found)
            if not kept:
                n = len(takes)
                none = "The take is not" if n == 1 else f"None of the {n} takes is"
                raise ValueError(
                    f"{none} cyclic. See report(X); give takes that repeat, or another threshold."
                )
            curves = start_curves(self, [given[i] for i in kept], [features[i] for i in kept])
            sampled = [SampledTake(features[i], found[i].period) for i in kept]
            phases = self._learn_phases(sampled, progress)
            self.start_, start = self._find_start(curves, sampled, phases)
            self.template_ = average_cycle([t.values for t in sampled], [p - start for p in phases])
            self.periods_ = np.full(len(takes), np.nan)
            self.periods_[kept] = [found[i].period for i in kept]
        return self

    @snapshot
    def segment(self, X: PerformancesLike) -> tuple[list[Any], pd.DataFrame]:
        """Cut takes into cycles.

        Every cycle begins at the phase that `start` defines: about the frame where a foot is
        farthest ahead, or where the feature is largest. What precedes the first such frame of a
        take, and what follows the last one, is left out; ``incomplete=True`` returns it, too.

        Parameters
        ----------
        X : list of arrays (n_frames_i, n_features), 3-D array, or one take (n_frames, n_features)
            Takes.

        Returns
        -------
        performances : list of ndarray, or of DataFrame, (n_frames_i, n_features)
            The cycles, one trial each, take by take, in order of time. The last frame of a cycle is
            the first of the next one, so both show the same phase. Cycles of DataFrames are
            labelled by the label of the take and their number, and `to_frame` makes one table of
            them.
        locations : DataFrame
            One row a performance: ``take``, index or label of the take, to group by; ``start`` and
            ``stop``, frames of the take, ``stop`` excluded; ``complete``, whether it is a whole
            cycle; ``score``, its cosine similarity to the template, at most 1.

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
        check_is_fitted(self)
        given, takes = check_takes(self, X, reset=False)
        rows, periods = [], np.full(len(takes), np.nan)
        for i, take, phases, found in self._phases(given, takes):
            # Where several cycles fit there was a warning of that.
            periods[i] = found.period if len(found.periods) == 1 else np.nan
            rows += [
                (i, *row) for row in locate_cycles(take, phases, self.template_, self.incomplete)
            ]
        table = pd.DataFrame(rows, columns=list(_COLUMNS)).astype(_COLUMNS)
        _warn_of_lengths(takes, table[table["complete"]], periods)
        return cut_takes(given, takes, table)

    @snapshot
    def phases(self, X: PerformancesLike) -> list[np.ndarray]:
        """The phase of every frame.

        Parameters
        ----------
        X : list of arrays (n_frames_i, n_features), 3-D array, or one take (n_frames, n_features)
            Takes.

        Returns
        -------
        list of ndarray (n_frames_i,)
            In cycles: whole numbers where a cycle begins, from 0 to 1 at the first frame. NaN for
            takes that are skipped.
        """
        check_is_fitted(self)
        given, takes = check_takes(self, X, reset=False)
        out = [np.full(len(take), np.nan) for take in takes]
        for i, take, phases, _ in self._phases(given, takes):
            out[i] = np.interp(np.arange(len(takes[i])), take.times, phases)
        return out

    def report(self, X: PerformancesLike) -> pd.DataFrame:
        """Whether takes are cyclic, by their self-correlation; no fit is needed.

        Parameters
        ----------
        X : list of arrays (n_frames_i, n_features), 3-D array, or one take (n_frames, n_features)
            Takes.

        Returns
        -------
        DataFrame
            One row a take, indexed by its label: ``n_frames``; ``period``, frames of a cycle, NaN
            without any; ``n_cycles``; ``strength``, the self-correlation at the period; ``cyclic``,
            whether it can be segmented; the ``reason`` why not; and ``periods``, of all cycles that
            fit.
        """
        self._validate_params()
        given, takes = check_takes(clone(self), X, reset=True)
        _, found = correlate_takes(self, given, takes)
        reasons = [rejection_reason(f, self.threshold) for f in found]
        rows = [
            (len(x), f.period, f.n_cycles, f.strength, not reason, reason, f.periods.tolist())
            for x, f, reason in zip(takes, found, reasons, strict=True)
        ]
        columns = ["n_frames", "period", "n_cycles", "strength", "cyclic", "reason", "periods"]
        index = pd.Index(takes.labels, tupleize_cols=False, name="take")
        return pd.DataFrame(rows, columns=columns, index=index)

    def _select_cyclic(self, takes, found):
        """Indices of the takes that are cyclic; an error if others are not to be skipped."""
        reasons = [rejection_reason(f, self.threshold) for f in found]
        kept = [i for i, reason in enumerate(reasons) if not reason]
        if len(kept) < len(takes) and self.not_cyclic == "raise":
            i = next(i for i, reason in enumerate(reasons) if reason)
            within = "" if self.period is None else f" within period={self.period}"
            raise ValueError(
                f"{takes.called(i)}: {reasons[i]}{within}. Its self-correlation is "
                f"{found[i].strength:.2f} at {found[i].n_cycles:.2f} cycles; "
                f"threshold={self.threshold:g} and at least {LEAST_CYCLES} cycles are required. "
                'Leave it out, give a longer take, or set not_cyclic="skip"; see report(X).'
            )
        several = [i for i in kept if len(found[i].periods) > 1]
        if several:
            i = several[0]
            periods = ", ".join(f"{period:.1f}" for period in found[i].periods)
            warnings.warn(
                f"{takes.called(i)}: several cycles fit, of {periods} frames; "
                f"{found[i].period:.1f} is taken. This holds for {len(several)} of {len(takes)} "
                "takes. Give period=(least, largest), in frames, to choose; report(X)['periods'] "
                "lists what fits.",
                UserWarning,
                stacklevel=5,
            )
        return kept

    def _phases(self, given, takes):
        """Yield index, samples, their phases, and self-correlation of every take that is cyclic."""
        features, found = correlate_takes(self, given, takes)
        found = [as_learnt(self, x, f) for x, f in zip(features, found, strict=True)]
        align = match_phases if self.refine else constant_phases
        for i in self._select_cyclic(takes, found):
            take = SampledTake(features[i], found[i].period)
            phases = align(self.template_, take)
            yield i, take, phases - np.floor(phases[0]), found[i]

    def _learn_phases(self, sampled, progress):
        """Phases of takes without a template: at constant pace one by one, then matched."""
        values, phases = [take.values for take in sampled], []
        for k, take in enumerate(sampled):
            phases.append(
                constant_phases(average_cycle(values[:k], phases), take) if k else take.mean_phases
            )
        rounds = _ROUNDS if self.refine else 0
        step = progress.stage("matching takes", rounds * len(sampled))
        for _ in range(rounds):
            template, phases = average_cycle(values, phases), []
            for take in sampled:
                phases.append(match_phases(template, take))
                step()
        return phases

    def _find_start(self, curves, sampled, phases):
        """The name of what begins a cycle, and its phase in the template."""
        if curves is None:
            width = sampled[0].values.shape[1] // 2
            values = [take.values[:, :width] for take in sampled]
            mean = average_cycle(values, phases)
            repeats = np.square(mean).mean(axis=0)
            moves = np.square(np.concatenate(values)).mean(axis=0)
            best = int(np.argmax(repeats / np.where(moves > 0, moves, np.inf)))
            return compared_names(self)[best], circular_peak(mean[:, best]) / PHASES
        cycles = {
            name: average_cycle(
                [take.sample(c[:, np.newaxis]) for take, c in zip(sampled, of_all, strict=True)],
                phases,
            )[:, 0]
            for name, of_all in curves.items()
        }
        name = max(cycles, key=lambda name: cycles[name].max())
        return name, circular_peak(cycles[name]) / PHASES


# -- takes, and what is compared of them --------------------------------------------------


def check_takes(segmenter, X, *, reset):
    """Takes as they were given, a single one as a list, and checked."""
    X = as_takes(X)
    # A period is that of its take, at any frame rate.
    facts = TIMELESS if segmenter.period is None else None
    takes = check_performances(segmenter, X, reset=reset, level="sequence", facts=facts)
    if reset:
        warn_of_clocks(takes, names_of_input(segmenter))
    return as_collection(X), takes


def correlate_takes(segmenter, given, takes, step=None):
    """The compared features of takes, in float64, and their self-correlations.

    The features are the directions of limbs if there is a skeleton, else those of the takes.
    """
    limits = _check_period(segmenter.period)
    if segmenter.skeleton is not None:
        cosines = DirectionCosines(segmenter.skeleton).set_output(transform="default")
        takes = cosines.fit_transform(given)
    features = [np.asarray(x, dtype=np.float64) for x in takes]
    found = []
    for x in features:
        found.append(correlate(x, limits))
        if step is not None:
            step()
    return features, found


def as_learnt(segmenter, features, found):
    """The self-correlation of a take at the only cycle that is as long as those of the fit.

    It is returned as found if one cycle fits, or none or several are as long.
    """
    learnt, fits = segmenter.periods_, found.periods
    near = (fits >= np.nanmin(learnt) / _AS_LONG) & (fits <= np.nanmax(learnt) * _AS_LONG)
    if len(fits) < 2 or near.sum() != 1:
        return found
    (period,) = fits[near]
    chosen = correlate(features, (period / _SAME, period * _SAME))
    return found if rejection_reason(chosen, segmenter.threshold) else chosen


def _check_period(period):
    """The least and the largest number of frames of a cycle, or None."""
    if period is None:
        return None
    pair = tuple(period)
    good = len(pair) == 2 and all(isinstance(n, Real) for n in pair)
    if not (good and 2 <= pair[0] <= pair[1]):
        raise ValueError(
            "period must be two numbers of frames, the least, at least 2, and the largest, of a "
            f"cycle; got {period!r}."
        )
    return pair


def compared_names(segmenter):
    """Names of the compared features."""
    if segmenter.skeleton is not None:
        return list(DirectionCosines(segmenter.skeleton).get_feature_names_out())
    return names_of_features(None, segmenter, segmenter.n_features_in_)


def start_curves(segmenter, X, features):
    """Curves of takes; a cycle begins at the maximum of the one with the largest maximum.

    Returns
    -------
    dict of str to list of ndarray (n_frames_i,)
        By name; None where any feature will do.
    """
    start, skeleton = segmenter.start, segmenter.skeleton
    has_feet = _has_feet(skeleton)
    if start is None and not has_feet:
        return None
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


def _has_feet(skeleton):
    """Whether a skeleton shows how far each foot is ahead of the pelvis."""
    if skeleton is None or skeleton.n_dims == 2:
        return False
    shows_heading = bool({"hip", "shoulder"} & set(skeleton.limbs))
    return shows_heading and {"pelvis", "left_ankle", "right_ankle"} <= set(skeleton.landmarks)


def _warn_of_lengths(takes, table, periods):
    """Warn of whole cycles that are far longer or far shorter than the period of their take."""
    shares = (table["stop"] - 1 - table["start"]) / periods[table["take"]]
    odd = shares[(shares < _SHORT) | (shares > _LONG)]
    if odd.empty:
        return
    row = odd.index[0]
    i, start, stop = table.loc[row, ["take", "start", "stop"]]
    several = "several repetitions, or a rest" if odd[row] > 1 else "only a part of a repetition"
    warnings.warn(
        f"{takes.called(i)}: the cycle from start {start} to stop {stop} has {stop - start} "
        f"frames, but the period of the take is {periods[i]:.1f}. It may hold {several}. This "
        f"holds for {len(odd)} of {len(table)} whole cycles. Look at the cuts with CycleDisplay, "
        "leave such cycles out by 'start' and 'stop' of the table, or cut by other features.",
        UserWarning,
        stacklevel=4,
    )


# -- phases of a take: matching with one cycle that is repeated periodically ---------------


class SampledTake:
    """A take with about `PHASES` samples a cycle.

    Parameters
    ----------
    features : ndarray, shape (n_frames, n_features)
    period : float
        Mean number of frames of a cycle.

    Attributes
    ----------
    times : ndarray, shape (n_samples,)
        Frames of the samples, from the first to the last.
    values : ndarray, shape (n_samples, 2 * n_features)
        Postures less their mean, and velocities; each of mean square 1.
    mean_phases : ndarray, shape (n_samples,)
        Phases at the mean pace, 0 at the first frame.
    """

    def __init__(self, features, period):
        last = len(features) - 1
        n_samples = max(round(last / period * PHASES), 1) + 1
        self.times = np.linspace(0, last, n_samples)
        self.mean_phases = self.times / period
        postures = self.sample(smooth(features[np.newaxis], period / PHASES / 2)[0])
        velocities = smooth(postures[np.newaxis], _WIDTH, 1)[0]
        self.values = np.concatenate([_standardise(postures), _standardise(velocities)], axis=1)

    def sample(self, values):
        """Values of frames (n_frames, n) at the samples."""
        return normalise([np.ascontiguousarray(values, dtype=np.float64)], len(self.times))[0]


def _standardise(x):
    x = x - x.mean(axis=0)
    size = np.sqrt(np.square(x).sum() / len(x))
    return x / size if size > 0 else x


def average_cycle(many_values, many_phases):
    """The mean cycle of values (n_samples, n) of known phases: (PHASES, n).

    Each sample of the cycle is the mean over all cycles of all takes that have it.
    """
    sums = np.zeros((PHASES, many_values[0].shape[1]))
    counts = np.zeros(PHASES)
    for values, phases in zip(many_values, many_phases, strict=True):
        places = PHASES * phases
        wanted = np.arange(np.ceil(places[0]), np.floor(places[-1]) + 1)
        after = np.clip(np.searchsorted(places, wanted), 1, len(places) - 1)
        gaps = places[after] - places[after - 1]
        share = ((wanted - places[after - 1]) / np.where(gaps > 0, gaps, 1))[:, np.newaxis]
        found = (1 - share) * values[after - 1] + share * values[after]
        at = wanted.astype(int) % PHASES
        np.add.at(sums, at, found)
        counts += np.bincount(at, minlength=PHASES)
    return sums / np.maximum(counts, 1)[:, np.newaxis]


def constant_phases(template, take):
    """Phases at the mean pace, shifted to the best circular correlation with the template."""
    own = average_cycle([take.values], [take.mean_phases])
    products = rfft(template, axis=0) * rfft(own, axis=0).conj()
    correlation = irfft(products.sum(axis=1), PHASES)
    return take.mean_phases + correlation.argmax() / PHASES


def match_phases(template, take):
    """Phases of the best path of a take along the repeated template (Eqs. 12-17).

    Takes of many cycles are matched in overlapping portions, so that time and memory grow linearly.
    The phases of a portion end in the middle of the overlap with the next one.
    """
    values, cycle = take.values, _upsample(template)
    whole, overlap = _PORTION * PHASES, _OVERLAP * PHASES
    phases = _match_portion(cycle, values[: whole + overlap])
    for start in range(whole, len(values) - overlap, whole):
        portion = _match_portion(cycle, values[start : start + whole + overlap])
        middle = overlap // 2
        portion += np.round(phases[start + middle] - portion[middle])
        phases = np.concatenate([phases[: start + middle], portion[middle:]])
    return np.maximum.accumulate(phases)


def _match_portion(cycle, values):
    steps, moving, inner, _, _ = step_table("posture", _FASTEST, _SUBFRAMES)
    table = StepTable(steps, moving, inner, np.square(steps / _SUBFRAMES - 1), _SUBFRAMES)
    reach = int(np.ceil(PHASES * _BEGIN + _DRIFT * len(values)))
    trellis = Trellis(table, _SMOOTHNESS, reach, free=True)
    last = (len(values) - 1) * _SUBFRAMES
    positions = np.arange(-trellis.width, last + 1 + trellis.width)
    repeated = cycle[positions % len(cycle)]
    (path,) = trellis.paths(values[np.newaxis], repeated[np.newaxis])[0]
    return (np.arange(0, last + 1, _SUBFRAMES) + path) / len(cycle)


def _upsample(template):
    """The closed template at `_SUBFRAMES` positions per sample, by linear interpolation."""
    share = (np.arange(_SUBFRAMES) / _SUBFRAMES)[:, np.newaxis]
    following = np.roll(template, -1, axis=0)[:, np.newaxis]
    fine = (1 - share) * template[:, np.newaxis] + share * following
    return fine.reshape(-1, template.shape[1])


def circular_peak(curve):
    """Where a closed curve has its maximum, between samples, by a parabola."""
    k = int(curve.argmax())
    before, here, after = (curve[(k + j) % len(curve)] for j in (-1, 0, 1))
    bend = before - 2 * here + after
    return k + ((before - after) / (2 * bend) if bend < 0 else 0.0)


def locate_cycles(take, phases, template, incomplete):
    """Yield start, stop, completeness, and similarity to the template, of cycles of a take."""
    last = int(take.times[-1])
    whole = np.arange(np.ceil(phases[0]), np.floor(phases[-1]) + 1)
    # np.interp needs phases that rise.
    rising = phases + np.linspace(0, 1e-9, len(phases))
    frames = np.round(np.interp(whole, rising, take.times)).astype(int)
    ends = list(zip(whole, frames.tolist(), strict=True))
    if incomplete:
        ends = [(phases[0], 0), *ends, (phases[-1], last)]
    for (first, start), (following, stop) in pairwise(ends):
        if stop > start:
            score = _similarity(template, take, phases, first, following)
            yield start, stop + 1, bool(following - first > 1 - 1e-6), score


def _similarity(template, take, phases, first, last):
    """Cosine similarity of a take to the template, from one phase to another."""
    inside = (phases >= first) & (phases < last)
    cycle = _upsample(template)
    expected = cycle[np.round(phases[inside] * len(cycle)).astype(int) % len(cycle)].ravel()
    values = take.values[inside].ravel()
    size = np.sqrt((values @ values) * (expected @ expected))
    return float(values @ expected / size) if size > 0 else 0.0
