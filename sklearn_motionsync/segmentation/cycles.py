"""CycleSegmenter: long takes of a movement that repeats, cut into its cycles."""

from numbers import Integral, Real

import numpy as np
import pandas as pd
from scipy.fft import irfft, rfft
from sklearn.base import BaseEstimator, _fit_context, clone
from sklearn.utils._param_validation import Interval, StrOptions
from sklearn.utils.validation import check_is_fitted

from ..body.direction_cosines import DirectionCosines
from ..body.formats import SIDES
from ..body.joint_positions import JointPositions
from ..body.skeleton import Skeleton
from ..inputs.collections import as_collection
from ..inputs.features import choose_features, names_of_features
from ..inputs.numbers import as_numbers
from ..inputs.tables import as_pandas
from ..inputs.validation import check_performances
from ..matching.costs import StepTable, step_table
from ..matching.filters import smooth
from ..matching.trellis import Trellis
from ..matching.warps import normalise
from ..utils.atomic import atomic_fit, snapshot
from ..utils.doc_links import DocumentedMixin
from .cutting import cut_takes
from .self_correlation import LEAST_CYCLES, correlate, lack_of, reason_of

__all__ = ["CycleSegmenter", "examined", "names_of_compared", "start_curves", "taken"]

# How often the takes are matched to the template in a fit, which is estimated again each time.
_ROUNDS = 2
_COLUMNS = {"take": int, "start": int, "stop": int, "complete": bool, "score": float}


class CycleSegmenter(DocumentedMixin, BaseEstimator):
    """Cut long takes of walking, running, or any movement that repeats, into its cycles.

    1. Find the period of each take from its self-correlation, and whether it has one:
       `self_correlation`.
    2. Average the cycles of all takes at constant period: the template of one cycle.
    3. Let every take follow the template, repeated without end, by dense matching: the phase wraps,
       and begins and ends anywhere. Average again, twice.
    4. Let the template begin where a foot is farthest ahead, or a feature has its maximum.
    5. Cut where the phase of a take is a whole number.

    Takes that are segmented later follow the template of ``fit``, so that all are cut at the same
    phase. One take makes several performances, which `transform` may not do: use `segment`.

    Parameters
    ----------
    skeleton : Skeleton, default=None
        That of takes of joint positions: directions of limbs are compared then, so that neither
        path nor heading matters, and the positions are cut as they are. None compares the features
        as they are, of which those with the largest variance count most.
    start : {"left", "right", "ahead"}, str or int, default=None
        Where cycles begin. With a skeleton ``"left"`` or ``"right"``: where that ankle is farthest
        ahead of the pelvis, about when the foot strikes; ``"ahead"``: that of the foot which comes
        farther. Or a feature of what is compared, by name or index: where it has its maximum.
        None is ``"ahead"`` where the skeleton has feet, otherwise the feature that repeats best.
    threshold : float, default=0.4
        The self-correlation from which a take is cyclic, from 0 to 1. More is asked where chance
        has it easy: of narrow movements up to ``(1 + 2 threshold) / 3``, which is for a single
        feature (``breadth`` of `self_correlation`), and of less than two cycles that, divided by
        ``sqrt(n_cycles - 1)``.
    refine : bool, default=True
        Whether takes follow the template; False cuts at their constant mean period.
    incomplete : bool, default=False
        Whether what comes before the first and after the last whole cycle is given, too.
    not_cyclic : {"raise", "skip"}, default="raise"
        What is done with a take without a cycle, or with fewer than 1.6 of them.

    Attributes
    ----------
    template_ : ndarray, shape (32, 2 * n_compared)
        The mean cycle from its start on: postures as deviations from the mean of a take, and
        velocities, both in units of their own size.
    start_ : str
        What begins a cycle: ``"left"``, ``"right"``, or the name of a feature.
    periods_ : ndarray, shape (n_takes,)
        Frames of a cycle of each take, NaN for those that were left out.
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
    A cycle lasts at least half of the mean one of its take. Pace may change slowly by a fifth and
    more. A template is not to be expected from takes of different movements: fit each by
    itself. Features of different units are to be scaled before, ``FrameWise(StandardScaler())``.

    Examples
    --------
    >>> from sklearn_motionsync import CycleSegmenter
    >>> from sklearn_motionsync.datasets import make_gait
    >>> bunch = make_gait(4, n_cycles=5, takes=True, random_state=0)
    >>> segmenter = CycleSegmenter(start=0).fit(bunch.data[:3])
    >>> cycles, origin = segmenter.segment(bunch.data[3:])
    >>> len(cycles), cycles[0].shape[1]
    (5, 4)
    >>> origin[["take", "start", "stop"]].iloc[0].tolist()
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
    }

    def __init__(
        self,
        skeleton=None,
        start=None,
        threshold=0.4,
        refine=True,
        incomplete=False,
        not_cyclic="raise",
    ):
        self.skeleton = skeleton
        self.start = start
        self.threshold = threshold
        self.refine = refine
        self.incomplete = incomplete
        self.not_cyclic = not_cyclic

    @atomic_fit
    @_fit_context(prefer_skip_nested_validation=True)
    def fit(self, X, y=None):
        """Learn one cycle, and where it begins.

        Parameters
        ----------
        X : list of arrays (n_frames_i, n_features), 3-D array, or one take (n_frames, n_features)
            Takes.
        y : ignored

        Returns
        -------
        self

        Raises
        ------
        ValueError
            If the input breaks the contract, a take is not cyclic or too short and
            ``not_cyclic="raise"``, or none is left; or there is no such `start`.
        """
        given, takes = taken(self, X, reset=True)
        features, found = examined(given, takes, self.skeleton)
        kept = self._kept(takes, found)
        if not kept:
            raise ValueError(
                f"None of the {len(takes)} takes is cyclic: take 0 is "
                f"{reason_of(found[0], self.threshold)!r}. See report(X); give takes that repeat, "
                "or another threshold."
            )
        curves = start_curves(self, [given[i] for i in kept], [features[i] for i in kept])
        sampled = [Sampled(features[i], found[i].period) for i in kept]
        values = [take.values for take in sampled]
        phases = self._together(sampled)
        self.start_, begin = self._begin(curves, sampled, phases)
        self.template_ = average(values, [p - begin for p in phases])
        self.periods_ = np.array([f.period for f in found])
        self.periods_[[i for i in range(len(takes)) if i not in kept]] = np.nan
        return self

    @snapshot
    def segment(self, X):
        """Cut takes into cycles.

        Parameters
        ----------
        X : list of arrays (n_frames_i, n_features), 3-D array, or one take (n_frames, n_features)

        Returns
        -------
        performances : list of ndarray, or of DataFrame, (n_frames_i, n_features)
            The cycles, take by take, by time. They hold the frame in which the next one begins,
            too: first and last frame show the same phase. Those of DataFrames are called by the
            label of the take and their number, so that `to_frame` makes one table of them.
        origin : DataFrame
            One row a performance: ``take``, index or label of the take, to group by; ``start`` and
            ``stop``, frames of the take, of which the last is excluded; ``complete``, whether it is
            a whole cycle; ``score``, its likeness to the template, 1 at most.

        Raises
        ------
        ValueError
            As from ``fit``; but the lists are empty if no take is left.
        """
        check_is_fitted(self)
        given, takes = taken(self, X, reset=False)
        rows = []
        for i, take, phases in self._phases(given, takes):
            rows += [(i, *row) for row in cycles_of(take, phases, self.template_, self.incomplete)]
        table = pd.DataFrame(rows, columns=list(_COLUMNS)).astype(_COLUMNS)
        return cut_takes(given, takes, table)

    @atomic_fit
    def fit_segment(self, X, y=None):
        """Fit, and cut the same takes.

        Parameters
        ----------
        X : as in ``fit``
        y : ignored

        Returns
        -------
        performances, origin
            As from ``segment``.
        """
        return self.fit(X).segment(X)

    @snapshot
    def phases(self, X):
        """The phase of every frame.

        Parameters
        ----------
        X : as in ``segment``

        Returns
        -------
        list of ndarray (n_frames_i,)
            In cycles: whole numbers where a cycle begins, from 0 to 1 at the first frame. NaN for
            takes that are skipped.
        """
        check_is_fitted(self)
        given, takes = taken(self, X, reset=False)
        out = [np.full(len(take), np.nan) for take in takes]
        for i, take, phases in self._phases(given, takes):
            out[i] = take.at_frames(phases)
        return out

    def report(self, X):
        """What the self-correlation says of takes; it needs no fit.

        Parameters
        ----------
        X : list of arrays (n_frames_i, n_features), 3-D array, or one take (n_frames, n_features)

        Returns
        -------
        DataFrame
            One row a take, indexed by its label: ``n_frames``; ``period``, frames of a cycle, NaN
            without any; ``n_cycles``; ``strength``, the self-correlation at the period; ``cyclic``,
            whether it can be segmented; and the ``reason`` why not.
        """
        self._validate_params()
        given, takes = taken(clone(self), X, reset=True)
        _, found = examined(given, takes, self.skeleton)
        reasons = [reason_of(f, self.threshold) for f in found]
        return pd.DataFrame(
            {
                "n_frames": [len(take) for take in takes],
                "period": [f.period for f in found],
                "n_cycles": [f.n_cycles for f in found],
                "strength": [f.strength for f in found],
                "cyclic": [not reason for reason in reasons],
                "reason": reasons,
            },
            index=pd.Index(takes.labels, tupleize_cols=False, name="take"),
        )

    def periods(self, X):
        """Mean frames of a cycle of each take, with fractions; NaN of takes that are not cyclic.

        Parameters
        ----------
        X : as in ``report``

        Returns
        -------
        ndarray, shape (n_takes,)
        """
        report = self.report(X)
        return report["period"].where(report["cyclic"]).to_numpy()

    def is_cyclic(self, X):
        """Whether takes can be segmented; it needs no fit.

        Parameters
        ----------
        X : as in ``report``

        Returns
        -------
        ndarray of bool, shape (n_takes,)
        """
        return self.report(X)["cyclic"].to_numpy()

    # -- what fit and answers share ---------------------------------------------------------

    def _kept(self, takes, found):
        """Indices of the takes that have cycles; a refusal, if others are not to be skipped."""
        reasons = [reason_of(f, self.threshold) for f in found]
        bad = next((i for i, reason in enumerate(reasons) if reason), None)
        if bad is not None and self.not_cyclic == "raise":
            why = (
                f"{reasons[bad]} of about {found[bad].period:.0f} frames, and {LEAST_CYCLES} are "
                "needed to see that it repeats. Give a longer take"
                if reasons[bad].startswith("holds")
                else f"is not cyclic, or has less than {LEAST_CYCLES} cycles: its self-correlation "
                f"{lack_of(found[bad], self.threshold)}. Leave it out"
            )
            what = f"{_name_take(takes, bad)} {why}"
            raise ValueError(f'{what}, or set not_cyclic="skip"; report(X) tells of all.')
        return [i for i, reason in enumerate(reasons) if not reason]

    def _phases(self, given, takes):
        """Yield the index of every take with cycles, its samples, and their phases."""
        features, found = examined(given, takes, self.skeleton)
        step = follow if self.refine else keep_pace
        for i in self._kept(takes, found):
            take = Sampled(features[i], found[i].period)
            phases = step(self.template_, take)
            yield i, take, phases - np.floor(phases[0])

    def _together(self, sampled):
        """Phases of takes that have no template yet: each makes that of the next ones better."""
        values, phases = [take.values for take in sampled], []
        for k, take in enumerate(sampled):
            known = keep_pace(average(values[:k], phases), take) if k else take.pace
            phases.append(known)
        for _ in range(_ROUNDS if self.refine else 0):
            template = average(values, phases)
            phases = [follow(template, take) for take in sampled]
        return phases

    def _begin(self, curves, sampled, phases):
        """What begins a cycle, and at which phase of the template."""
        if curves is None:
            width = sampled[0].values.shape[1] // 2
            values = [take.values[:, :width] for take in sampled]
            mean = average(values, phases)
            repeats = np.square(mean).mean(axis=0)
            moves = np.square(np.concatenate(values)).mean(axis=0)
            best = int(np.argmax(repeats / np.where(moves > 0, moves, np.inf)))
            return names_of_compared(self)[best], top_of(mean[:, best]) / PHASES
        cycles = {
            name: average(
                [take.sample(c[:, np.newaxis]) for take, c in zip(sampled, of_all, strict=True)],
                phases,
            )[:, 0]
            for name, of_all in curves.items()
        }
        name = max(cycles, key=lambda name: cycles[name].max())
        return name, top_of(cycles[name]) / PHASES


def taken(segmenter, X, *, reset):
    """Takes as they were given, a single one as a list, and checked."""
    X = X if as_collection(X) is not None else [_single(as_pandas(X))]
    takes = check_performances(segmenter, X, reset=reset, level="sequence")
    return as_collection(X), takes


def _single(X):
    """One take (n_frames, n_features)."""
    if isinstance(X, pd.DataFrame):
        return X
    take = as_numbers(X, "The take")
    if take.ndim != 2:
        raise ValueError(
            f"Expected 2D array, one take (n_frames, n_features), or a list of takes; got an array "
            f"of shape {take.shape}. Reshape your data: a single feature is a column, "
            "x[:, np.newaxis]."
        )
    return take


def examined(given, takes, skeleton):
    """What is compared of takes, and their self-correlations."""
    features = compared(given, takes, skeleton)
    return features, [correlate(x) for x in features]


def _name_take(takes, i):
    label = takes.labels[i]
    return f"Take {i}" if label == i else f"Take {i} ({label!r})"


# -- what of a take is compared, and the curves whose maximum begins a cycle -------------


def compared(X, takes, skeleton):
    """What is compared of takes: directions of limbs, or the features as they are, in float64."""
    if skeleton is not None:
        cosines = DirectionCosines(skeleton).set_output(transform="default")
        takes = cosines.fit_transform(X)
    return [np.asarray(x, dtype=np.float64) for x in takes]


def names_of_compared(segmenter):
    """Names of these features."""
    if segmenter.skeleton is not None:
        return list(DirectionCosines(segmenter.skeleton).get_feature_names_out())
    return names_of_features(None, segmenter, segmenter.n_features_in_)


def start_curves(segmenter, X, features):
    """Curves of takes, one of which begins a cycle at its maximum: the one that reaches farthest.

    Returns
    -------
    dict of str to list of ndarray (n_frames_i,)
        By what they are called; None where any feature will do.
    """
    start, skeleton = segmenter.start, segmenter.skeleton
    if start is None and not _shows_feet(skeleton):
        return None
    if start in (None, "ahead") or (start in SIDES and skeleton is not None):
        if not _shows_feet(skeleton):
            raise ValueError(
                f"start={start!r} needs a skeleton in space with a pelvis, hips or shoulders, and "
                f"both ankles; got skeleton={skeleton!r}. Give the name or index of a feature: "
                f"{', '.join(names_of_compared(segmenter))}."
            )
        return _feet(X, skeleton, [start] if start in SIDES else SIDES)
    names = names_of_compared(segmenter)
    (k,) = choose_features([start], names)
    return {names[k]: [x[:, k] for x in features]}


def _shows_feet(skeleton):
    """Whether a skeleton tells how far each foot is ahead of the pelvis."""
    if skeleton is None or skeleton.n_dims == 2:
        return False
    turns = {"hip", "shoulder"} & set(skeleton.limbs)
    return bool(turns) and {"pelvis", "left_ankle", "right_ankle"} <= set(skeleton.landmarks)


def _feet(X, skeleton, sides):
    """How far the ankles are ahead of the pelvis, in leg lengths."""
    positions = JointPositions(skeleton).set_output(transform="default").fit(X)
    names, places = list(positions.get_feature_names_out()), positions.transform(X)
    columns = {side: names.index(f"{side}_ankle_z") for side in sides}
    return {side: [x[:, k].astype(np.float64) for x in places] for side, k in columns.items()}


# -- circular dense matching: a take follows one cycle that is repeated without end ------

# Samples of a cycle, and positions between two of them.
PHASES, _SUBFRAMES = 32, 4
# Weight of (rho - 1)^2 where postures and velocities have a mean square of 1 each.
_SMOOTHNESS = 0.3
# Standard deviation, in samples, of the Gaussian under which velocities are derived.
_WIDTH = 1
# How far, in cycles, a part comes off the mean pace: for the phase it begins at, and by the cycle.
_BEGIN, _DRIFT = 0.55, 0.3
# Cycles of the parts in which long takes are matched, and by how many they overlap.
_PART, _OVERLAP = 16, 2
_FASTEST = 2


class Sampled:
    """A take with about `PHASES` samples a cycle, ready to be compared.

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
        Postures as deviations from their mean, and velocities; either has the mean square 1.
    pace : ndarray, shape (n_samples,)
        The phase at the mean pace, 0 at the first frame.
    """

    def __init__(self, features, period):
        last = len(features) - 1
        n_samples = max(round(last / period * PHASES), 1) + 1
        self.times = np.linspace(0, last, n_samples)
        self.pace = self.times / period
        fine = smooth(features[np.newaxis], period / PHASES / 2)[0]
        postures = self.sample(fine)
        velocities = smooth(postures[np.newaxis], _WIDTH, 1)[0]
        self.values = np.concatenate([_scaled(postures), _scaled(velocities)], axis=1)

    def sample(self, values):
        """Values of frames (n_frames, n) at the samples."""
        return normalise([np.ascontiguousarray(values, dtype=np.float64)], len(self.times))[0]

    def at_frames(self, phases):
        """Phases of the samples at whole frames."""
        return np.interp(np.arange(self.times[-1] + 1), self.times, phases)


def _scaled(x):
    x = x - x.mean(axis=0)
    size = np.sqrt(np.square(x).sum() / len(x))
    return x / size if size > 0 else x


def average(many_values, many_phases):
    """The mean cycle of values (n_samples, n) whose phases are known: (PHASES, n).

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


def keep_pace(template, take):
    """Phases at the mean pace, begun where the take is most like the template."""
    own = average([take.values], [take.pace])
    products = rfft(template, axis=0) * rfft(own, axis=0).conj()
    likeness_by_shift = irfft(products.sum(axis=1), PHASES)
    return take.pace + likeness_by_shift.argmax() / PHASES


def follow(template, take):
    """Phases of the best path of a take along the repeated template (Eqs. 12-17).

    Takes of many cycles are matched in parts that overlap, so that time grows with the take as
    memory does. In the middle of an overlap the phases of the next part go on.
    """
    values, cycle = take.values, _between(template)
    whole, overlap = _PART * PHASES, _OVERLAP * PHASES
    phases = _follow(cycle, values[: whole + overlap])
    for start in range(whole, len(values) - overlap, whole):
        part = _follow(cycle, values[start : start + whole + overlap])
        middle = overlap // 2
        part += np.round(phases[start + middle] - part[middle])
        phases = np.concatenate([phases[: start + middle], part[middle:]])
    return np.maximum.accumulate(phases)


def _follow(cycle, values):
    steps, moving, inner, _, _ = step_table("posture", _FASTEST, _SUBFRAMES)
    table = StepTable(steps, moving, inner, np.square(steps / _SUBFRAMES - 1), _SUBFRAMES)
    reach = int(np.ceil(PHASES * _BEGIN + _DRIFT * len(values)))
    trellis = Trellis(table, _SMOOTHNESS, reach, free=True)
    last = (len(values) - 1) * _SUBFRAMES
    positions = np.arange(-trellis.width, last + 1 + trellis.width)
    repeated = cycle[positions % len(cycle)]
    (path,) = trellis.paths(values[np.newaxis], repeated[np.newaxis])[0]
    return (np.arange(0, last + 1, _SUBFRAMES) + path) / len(cycle)


def _between(template):
    """The template with positions between its samples, the last of which meets the first."""
    share = (np.arange(_SUBFRAMES) / _SUBFRAMES)[:, np.newaxis]
    following = np.roll(template, -1, axis=0)[:, np.newaxis]
    return ((1 - share) * template[:, np.newaxis] + share * following).reshape(
        -1, template.shape[1]
    )


def top_of(curve):
    """Where a closed curve has its maximum, between samples."""
    k = int(curve.argmax())
    before, here, after = (curve[(k + j) % len(curve)] for j in (-1, 0, 1))
    bend = before - 2 * here + after
    return k + ((before - after) / (2 * bend) if bend < 0 else 0.0)


def cycles_of(take, phases, template, incomplete):
    """Yield start, stop, whether it is whole, and likeness to the template, of cycles of a take."""
    last = int(take.times[-1])
    whole = np.arange(np.ceil(phases[0]), np.floor(phases[-1]) + 1)
    # Where the phase stands still the path is as good as vertical.
    rising = phases + np.linspace(0, 1e-9, len(phases))
    frames = np.round(np.interp(whole, rising, take.times)).astype(int)
    phase_of, frame_of = list(whole), list(frames)
    if incomplete:
        if not frame_of or frame_of[0] > 0:
            phase_of, frame_of = [phases[0], *phase_of], [0, *frame_of]
        if frame_of[-1] < last:
            phase_of, frame_of = [*phase_of, phases[-1]], [*frame_of, last]
    for k in range(len(frame_of) - 1):
        ends, rows = phase_of[k : k + 2], frame_of[k : k + 2]
        if rows[1] > rows[0]:
            score = _likeness(template, take, phases, *ends)
            yield rows[0], rows[1] + 1, bool(ends[1] - ends[0] > 1 - 1e-6), score


def _likeness(template, take, phases, first, last):
    """How like the template a take is from one phase to another: the cosine of their angle."""
    inside = (phases >= first) & (phases < last)
    cycle = _between(template)
    there = cycle[np.round(phases[inside] * len(cycle)).astype(int) % len(cycle)].ravel()
    here = take.values[inside].ravel()
    size = np.sqrt((here @ here) * (there @ there))
    return float(here @ there / size) if size > 0 else 0.0
