"""Departures of trials from a model: the table of what is wrong with them."""

from __future__ import annotations

from contextlib import suppress
from functools import cached_property
from numbers import Real
from typing import Any, NamedTuple

import numpy as np
import pandas as pd
from sklearn.base import BaseEstimator, is_classifier

from ..body.axes import direction_of
from ..body.limbs import part_of_limb
from ..inputs.features import choose_features
from ..inputs.types import Features, TrialsLike
from ..matching.counting import ROUNDING, first_largest, whole
from ..matching.gaps import fill_with_mean
from ..matching.warps import at_times
from ..synchronizers.linear import LinearSynchronizer
from ..utils.pipelines import find_step, find_synchronizer, flat_steps, matches_of_a_fit
from .action_model import KEPT, ActionModel
from .detector import ActionDetector
from .faults import FaultFinder, Part, expected_trial
from .views import View, limbs_of, view_of
from .whole_body import WholeBody, WholeFault

# A floor of the variance of limbs, in units of that outside of the components that hold so much.
# Chosen on HDM05 and two exercises of UI-PRMD.
_OUTSIDE, _HELD = 8, 0.95
# Of residuals, as a share of the clock.
_CORRELATION_TIME = 0.1
# Frames around a peak belong to it if they deviate by so much of it.
_OF_PEAK = 0.5
# What a row of the whole body is about. Each of its limits refuses a share of the trials that the
# model refuses.
WHOLE, _N_OF_WHOLE = "whole body", 6
# Tests of a detector that are kinds of departures of the whole body, below and above their limits.
_OF_DETECTOR = {
    "duration": ("too fast", "too slow"),
    "mirror": (None, "on the other side"),
    "arms": (None, "with the other arm"),
}
# At most so many rows of a trial.
_MOST_ROWS = 5


def find_departures(
    estimator: BaseEstimator,
    X: TrialsLike,
    *,
    reference: TrialsLike | None = None,
    features: Features | None = None,
    limit: float | None = None,
    **params: Any,
) -> pd.DataFrame:
    """What is wrong with trials: the limb, the kind of fault, when, and how large.

    A fault changes one limb, or one feature where there are no limbs: by an angle over a window of
    time, by a lag, or in its amplitude; or it is one of the whole body, which starts late, pauses,
    or moves backwards or too little. The most important fault is that with the largest gain in
    the log likelihood; it is taken away, and the next one is sought, up to five. A limb is judged
    along the axes of its parent limb, so an arm does not depart because the trunk leans. Lags are
    sought before synchronisation, which takes them away.

    Parameters
    ----------
    estimator : ActionModel, Pipeline with one, or ActionDetector
        Fitted. With a detector the rows are the reasons for its verdict: a trial that it accepts
        has none, and one that it refuses has at least one.
    X : trials
        As the estimator takes them.
    reference : trials, default=None
        One to five right trials of the same person, as the estimator takes them. What is
        expected is then a weighted mean of theirs and of the model's: the posterior mean, with the
        variance within people, which is learnt from the groups of the model. They are synchronised
        without ``params``.
    features : int, str or list of them, default=None
        Features of the model, or of the poses before its `ASpace`, by index or name: each is
        judged by itself. By default the limbs of `DirectionCosines`, if they lead to the model,
        otherwise all features: those of poses before an `ASpace`, or of the model.
    limit : float, default=None
        Largest deviation that is no departure, in standard deviations. By default the evidence
        decides: two in three correct trials of new people have a fault with as much. A fault
        also counts that exceeds `ActionModel.simultaneous_factor`. With a limit, trials have rows
        whatever a detector says of them.
    **params : dict
        What synchronizing X takes besides, such as ``keyframes``.

    Returns
    -------
    DataFrame
        One row a fault, by trial and then the most important first:

        - ``trial``, its number or label, a tuple if an index has several levels.
        - ``kind``: ``"angle"`` of a limb, ``"value"`` of a feature, ``"late"``, ``"early"``,
          ``"too small"`` or ``"too large"``, of the amplitude. Of the whole body also ``"starts
          late"``, ``"starts early"``, ``"stops late"``, ``"stops early"``, ``"pauses"`` and
          ``"backwards"``; a detector also tells ``"too fast"``, ``"too slow"``, ``"on the other
          side"``, ``"with the other arm"``, and ``"another movement"`` where nothing else is known.
        - ``limb``, such as ``"left_forearm"``, and ``region``, such as ``"left arm"`` or
          ``"trunk"``; None of other features. ``"whole body"`` in both is sought where there is a
          synchronizer before the model, and no `ASpace`, and ``features`` are not given.
        - ``direction``: where the limb points instead, in the axes of its parent: ``"flexed"`` or
          ``"extended"`` of forearms, legs and thighs, ``"abducted"`` or ``"adducted"``,
          ``"raised"`` or ``"lowered"``, ``"forward"`` or ``"backward"``, ``"to the left"`` or
          ``"to the right"``, ``"turned"``; ``"higher"`` or ``"lower"`` of values; else None.
        - ``feature``: the one with the largest deviation.
        - ``first``, ``last`` and ``peak``, the frame of the largest deviation: frames of the
          model, counted from 0. Lags and amplitudes are those of the whole movement.
        - ``start`` and ``end``, the first and last frame in the recording, counted from 0, and
          ``start_time`` and ``end_time``, the same in seconds; NaN if the frame rate is not known.
        - ``size`` and ``unit``: the angle in ``"degrees"``; the lag in ``"percent"`` of the clock;
          the ``"ratio"`` of the amplitude to the expected one; the height of the pelvis in
          ``"leg lengths"``; other features differ so much on average, in their own unit, an empty
          text.
        - ``deviation``, in standard deviations of people: negative below the mean, early, and too
          small.
        - ``rare``: whether the evidence exceeds what a share of ``coverage`` of the trials of
          new people does in no limb and by no kind of fault. It is calibrated by leaving groups
          out of the training set; with a reference, every trial of a person, the others
          being the reference.
        - ``timing``, whether the clock may be the reason: inside the intervals of 90 % of its times
          (`Match.interval`) the trial has values within the limit, or
          ``n_std`` standard deviations. False of the whole body, and where no `DenseSynchronizer`
          tells.

    Raises
    ------
    ValueError
        If there is no ActionModel, no such feature, or the limit is not above 0.

    See Also
    --------
    compare_to_norm : A verdict of each subject, also on timing.
    sklearn_motionsync.display.SkeletonDisplay.from_departures : Draws them as stick figures.

    Notes
    -----
    An `ASpace` keeps no residuals of the training set, so limbs are named better without one: see
    `What is wrong with this trial </howto/faults>` and `Accuracy </accuracy>`.

    Examples
    --------
    >>> import numpy as np
    >>> from sklearn_motionsync import ActionModel
    >>> from sklearn_motionsync.model import find_departures
    >>> t = np.linspace(0, 1, 50)[:, np.newaxis]
    >>> model = ActionModel().fit([a * np.sin(3 * t) for a in (0.8, 0.9, 1.0, 1.1, 1.2)])
    >>> new = np.sin(3 * t)
    >>> new[20:25] += 3
    >>> found = find_departures(model, [np.sin(3 * t), new])
    >>> found[["trial", "kind", "first", "last", "size", "deviation", "rare"]].round(0)
       trial   kind  first  last  size  deviation  rare
    0            1  value     20    24   3.0       19.0  True
    """
    is_number = isinstance(limit, Real) and not isinstance(limit, bool)
    if limit is not None and not (is_number and 0 < limit < np.inf):
        raise ValueError(f"limit must be a number above 0, or None; got {limit!r}.")
    judged = judge(estimator, X, params, "find_departures", features=features, reference=reference)
    return _table_of(judged, limit)


def _table_of(judged, limit):
    """The table of departures of all trials."""
    space, labels = judged.space, judged.view.labels
    rows = [row for i in range(len(labels)) for row in judged.rows(i, limit)]
    table = pd.DataFrame(rows, columns=_COLUMNS, dtype=object).astype(_DTYPES)
    # A label may be a tuple, which an array would unpack.
    table["trial"] = pd.Series([labels[row.trial] for row in rows], dtype=object)
    of_features = [None if row.feature is None else space.names[row.feature] for row in rows]
    table["feature"] = pd.Series(of_features, dtype=object)
    table["timing"] = np.zeros(len(rows), dtype=bool)
    match = judged.view.curves.match
    of_parts = [k for k, row in enumerate(rows) if row.feature is not None]
    if of_parts and match is not None and match.intervals is not None:
        reach = (judged.view.model.n_std if limit is None else limit) * judged.std
        lower, upper = judged.mean - reach, judged.mean + reach
        rows_of_parts = [rows[k] for k in of_parts]
        table.loc[of_parts, "timing"] = explained_by_timing(
            rows_of_parts, judged.curves, lower, upper, match
        )
    return table.infer_objects()


class Departure(NamedTuple):
    """A row of the table; ``feature`` is an index, None of the whole body."""

    trial: int
    kind: str
    limb: str | None
    region: str | None
    direction: str | None
    feature: int | None
    first: int
    last: int
    peak: int
    start: int
    end: int
    start_time: float
    end_time: float
    size: float
    unit: str
    deviation: float
    rare: bool


_COLUMNS = list(Departure.__annotations__)
_FRAMES = dict.fromkeys(["first", "last", "peak", "start", "end"], np.intp)
_NUMBERS = dict.fromkeys(["start_time", "end_time", "size", "deviation"], np.float64)
_DTYPES = {**_FRAMES, **_NUMBERS, "rare": bool}


class Judged(NamedTuple):
    """Trials beside what is expected of them.

    Attributes
    ----------
    view : View
    space : FaultSpace
    curves : ndarray (n, P, n_features)
        The trials on the clock, in the features of ``space.names``; NaN in gaps.
    mean, std : ndarray (P, n_features)
        What is expected of them.
    scores : ndarray (n, P, n_features)
        Deviations from the mean in standard deviations.
    faults : list of list of FoundFault
    of_whole : list of list of WholeFault
        Faults of the whole body, in linear time.
    refused : ndarray of bool (n,) or None
        The verdict of a detector; None without one.
    usual_score, rare_score : float
        Scores of faults that are listed, and that nearly all of new people do not exceed.
    far : float
        `ActionModel.simultaneous_factor`.
    """

    view: View
    space: FaultSpace
    curves: np.ndarray
    mean: np.ndarray
    std: np.ndarray
    scores: np.ndarray
    faults: list
    of_whole: list
    refused: np.ndarray | None
    usual_score: float
    rare_score: float
    far: float

    def rows(self, i, limit):
        """The rows of a trial, the most important first.

        Those beyond a limit of the deviation. If it is None, those with more evidence than usual,
        and those that are far away: a body that is wrong altogether has no limb that is. The
        verdict of a detector decides whether there are any.
        """
        is_refused = limit is None and self.refused is not None and bool(self.refused[i])
        if limit is None and self.refused is not None and not is_refused:
            return []
        # Rows, and how far their evidence is beyond what is rare.
        rows, evidence, strength = [], [], np.inf
        for fault in self.faults[i]:
            row = self._row(i, fault)
            if row is None or not abs(row.deviation) > (limit or 0):
                continue
            far = abs(self.scores[i, row.peak, row.feature]) > self.far
            is_listed = far or is_refused or fault.score > self.usual_score
            if limit is None and not is_listed:
                continue
            same = [r for r in rows if r.feature == row.feature and r.unit == row.unit]
            if not any(r.first <= row.peak <= r.last for r in same):
                # The order stays in which parts were found, each without the one before.
                rows.append(row)
                strength = min(strength, fault.score / self.rare_score)
                evidence.append(strength)
        for fault in self.of_whole[i]:
            if np.isnan(fault.deviation) or abs(fault.deviation) > (limit or 0):
                rows.append(self._row_of_whole(i, fault))
                evidence.append(fault.rarity)
        order = np.argsort(-np.array(evidence), kind="stable")
        rows = [rows[k] for k in order]
        if is_refused and not rows:
            another = WholeFault("another movement", 0.0, 1.0, np.nan, "", 1.0, 1.0, np.nan)
            rows = [self._row_of_whole(i, another)]
        return [row._replace(rare=row.rare or is_refused) for row in rows[:_MOST_ROWS]]

    def _row_of_whole(self, i, fault):
        """The row of a fault of the whole body, whose place is in the time of the recording."""
        last_frame = self.scores.shape[1] - 1
        start, stop = fault.start * last_frame, fault.stop * last_frame
        match = self.view.curves.match
        frames = np.arange(last_frame + 1)
        times = frames if match is None else match.times[i]
        first, last = (whole(x) for x in np.interp([start, stop], times, frames))
        return Departure(
            i, fault.kind, WHOLE, WHOLE, None, None, first, last, (first + last) // 2,
            *self._in_recording(i, start, stop), fault.size, fault.unit, fault.deviation,
            fault.rarity > 1,
        )  # fmt: skip

    def _in_recording(self, i, start, stop):
        """Frames, and seconds, of a recording of times on the clock before it was matched."""
        facts, last_frame = self.view.curves.facts, self.scores.shape[1] - 1
        frames = [whole(x / last_frame * (facts.lengths[i] - 1)) for x in (start, stop)]
        return *frames, *(frame / facts.frame_rates[i] for frame in frames)

    def _row(self, i, fault):
        part, last_frame = self.space.parts[fault.part], self.scores.shape[1] - 1
        first, last = whole(fault.start * last_frame), whole(fault.stop * last_frame)
        inside = np.abs(self.scores[i, first : last + 1, part.features])
        # Without a value there is no departure.
        if np.isnan(inside).all():
            return None
        of, frame = np.unravel_index(first_largest(inside), inside.shape)
        feature, peak = part.features[of], first + int(frame)
        deviation, kind, size, direction = fault.deviation, fault.kind, fault.size, None
        is_limb = part.region is not None and len(part.columns) > 1
        if kind == "off":
            deviation, kind = float(self.scores[i, peak, feature]), "angle" if is_limb else "value"
            if is_limb:
                direction = self.space.direction(part, size, self.mean[peak])
                chord = np.linalg.norm(size)
                size, unit = float(np.degrees(2 * np.arcsin(min(chord / 2, 1)))), "degrees"
            else:
                first, last = around_peak(self.scores[i, :, feature], peak)
                off = (self.curves[i] - self.mean)[first : last + 1, feature]
                size, unit = float(np.nanmean(off)), "leg lengths" if part.region else ""
                direction = "higher" if size > 0 else "lower"
        elif kind in ("late", "early"):
            size, unit = 100 * abs(size) / last_frame, "percent"
        else:
            unit = "ratio"
        match = self.view.curves.match
        times = np.arange(last_frame + 1) if match is None else match.times[i]
        limb = None if part.region is None else part.name
        return Departure(
            i, kind, limb, part.region, direction, feature, first, last, peak,
            *self._in_recording(i, times[first], times[last]), size, unit, deviation,
            fault.score > self.rare_score,
        )  # fmt: skip


def judge(estimator, X, params, caller, *, features=None, reference=None, only=None):
    """Trials of an estimator beside what is expected of them, and their faults.

    Parameters
    ----------
    estimator, X, params, caller
        As for `view_of`.
    features : int, str or list of them, default=None
        Those that are judged, each by itself; by default limbs, or all.
    reference : trials, default=None
        Right ones of the person.
    only : callable, default=None
        Gives the index of the trial whose faults are sought, of their number; by default
        those of all are.

    Returns
    -------
    Judged

    Raises
    ------
    ValueError
        If the estimator is a classifier, or as from `view_of`.
    """
    classifier = flat_steps(estimator)[-1]
    if is_classifier(classifier):
        raise ValueError(
            f"{caller} compares with one model, and {type(classifier).__name__} has several "
            "classes. Fit one on the trials of a class: make_pipeline(*pipe[:-1], "
            "DenseSynchronizer(), ActionModel())."
        )
    expected = _Expected.of(estimator, features)
    view = expected.view.of(X, params, caller)
    n, match = len(view.labels), view.curves.match
    sought = range(n) if only is None else [only(n)]
    mean, std, of_person, of_person_in_time = expected.mean, expected.std, None, None
    if reference is not None:
        theirs = expected.view.of(reference, {}, caller)
        of_person = expected.filled(theirs.whole)
        of_person_in_time = expected.in_linear_time(of_person, theirs.curves.match)
        mean, variance = expected_trial(expected.training, view.model.groups_, of_person)
        std = np.sqrt(variance + expected.left_out * (1 + 1 / len(of_person)))
    finder = expected.finder(of_person, of_person_in_time)
    curves, filled = view.whole[..., expected.chosen], expected.filled(view.whole)
    converted, later = expected.space.convert(filled), expected.in_linear_time(filled, match)
    faults = [[] for _ in range(n)]
    for i in sought:
        faults[i] = finder.find(converted[i], None if later is None else later[i])
    of_whole = expected.faults_of_whole(converted, later)
    if reference is not None:
        # What the person does in most right trials is no fault.
        converted_of_person = expected.space.convert(of_person)
        usual = expected.faults_of_whole(converted_of_person, of_person_in_time)
        kinds = [fault.kind for faults_of_one in usual for fault in faults_of_one]
        is_usual = {kind: kinds.count(kind) > len(usual) / 2 for kind in kinds}
        of_whole = [[f for f in of_one if not is_usual.get(f.kind)] for of_one in of_whole]
    refused, detector = None, getattr(estimator, "best_estimator_", estimator)
    if isinstance(detector, ActionDetector):
        known = dict(view.curves.known)
        if reference is not None:
            known["reference"] = theirs.curves.known
        with matches_of_a_fit(known):
            report = detector.report(X, reference, **params)
        refused, of_detector = report["score"].to_numpy() > 1, _of_detector(detector, report)
        of_whole = [a + b for a, b in zip(of_whole, of_detector, strict=True)]
    return Judged(
        view=view,
        space=expected.space,
        curves=curves,
        mean=mean,
        std=std,
        scores=(curves - mean) / std,
        faults=faults,
        of_whole=of_whole,
        refused=refused,
        usual_score=finder.usual_score,
        rare_score=finder.rare_score,
        far=expected.far,
    )


def _of_detector(detector, report):
    """What a detector alone tells of whole trials, a list of WholeFault each, by its report."""
    faults = [[] for _ in range(len(report))]
    for name, kinds in _OF_DETECTOR.items():
        for i, value in enumerate(report.get(name, ())):
            kind = kinds[int(value > 0)]
            if abs(value) <= 1 or kind is None:
                continue
            size, unit = np.nan, ""
            if name == "duration":
                lower, upper = detector.borders_[name]
                size, unit = float((upper / lower) ** (value / 2)), "ratio"
            faults[i].append(WholeFault(kind, 0.0, 1.0, size, unit, abs(value), np.inf, np.nan))
    return faults


class _Expected:
    """What a fitted estimator expects of trials, which is learnt when it is first asked.

    Attributes
    ----------
    view : View
        Without trials.
    space : FaultSpace
    chosen : ndarray of int
        The features of the view that are judged.
    training : ndarray (n_kept, P, n_chosen)
    mean, std : ndarray (P, n_chosen)
        Of trials of new people.
    left_out : ndarray (n_chosen,)
        The variance outside of the aSpace.
    """

    def __init__(self, estimator, features):
        self.view = view = view_of(estimator, features=features, poses=features is None)
        names, self.chosen = view.names, np.arange(len(view.names))
        limbs = before = synchronizer = None
        with suppress(ValueError):
            before, synchronizer = find_synchronizer(estimator)
        if features is None:
            limbs = limbs_of(before, names)
        else:
            self.chosen = np.array(choose_features(features, names))
        chosen = self.chosen
        self.space = FaultSpace([names[i] for i in chosen], limbs)
        self.training = view.training[..., chosen].astype(np.float64)
        self.mean, self.std = view.model.mean_[:, chosen], view.predicted[:, chosen]
        self.left_out = view.residual_variance[chosen]
        examples, self._width, self._linear, self._finder = view.in_linear_time, 0, None, None
        if examples is not None and not _is_linear(synchronizer):
            # Features that come last are unknown in linear time, such as a `TimingChannel`.
            self._width = int((chosen < examples.shape[2]).sum())
        if self._width:
            padded = np.zeros((*examples.shape[:2], len(names)))
            padded[..., : examples.shape[2]] = examples
            whose = view.model_of_points.groups_
            if not len(examples) == len(whose) == view.model_of_points.n_samples_seen_:
                whose = np.arange(len(examples))
            examples = with_residuals(padded[..., chosen], whose, self.left_out)
            self._linear = self._known_in_time(examples), whose
        # Only what has a time of its own starts late or pauses. In an aSpace new people do: what
        # they begin with is left out.
        in_aspace = view.route.aspace is not None
        self._has_body = features is None and synchronizer is not None and not in_aspace

    @cached_property
    def whole_body(self):
        """What whole trials do in linear time; None where that is not known."""
        if not self._has_body:
            return None
        coverage = 1 - (1 - self.view.model.coverage) / _N_OF_WHOLE
        on_clock, groups = self.space.convert(self.training), self.view.model.groups_
        in_time = (on_clock, groups) if self._linear is None else self._linear
        return WholeBody(*in_time, on_clock[..., : in_time[0].shape[2]], groups, coverage)

    def faults_of_whole(self, on_clock, in_time):
        """The faults of whole trials (n, P, n_columns), a list of each."""
        if self.whole_body is None:
            return [[] for _ in on_clock]
        in_time = on_clock if in_time is None else in_time
        pairs = zip(in_time, on_clock[..., : in_time.shape[2]], strict=True)
        return [self.whole_body.find(*pair) for pair in pairs]

    @cached_property
    def far(self):
        """How far all trials are from the mean at most, in standard deviations."""
        return self.view.model.simultaneous_factor()

    @classmethod
    def of(cls, estimator, features):
        """That of an estimator, which is kept until one of its steps is fitted again."""
        steps = flat_steps(estimator)
        state = [v for step in steps for name, v in vars(step).items() if name != KEPT]
        by_features = vars(find_step(estimator, ActionModel)[1]).setdefault(KEPT, {})
        before, expected = by_features.get(repr(features), ([], None))
        same = len(before) == len(state) and all(a is b for a, b in zip(before, state, strict=True))
        if not same:
            expected = cls(estimator, features)
            by_features[repr(features)] = state, expected
        return expected

    def filled(self, whole):
        """The chosen features of trials, with the mean in their gaps."""
        return fill_with_mean(whole[..., self.chosen].astype(np.float64), self.mean)

    def in_linear_time(self, filled, match):
        """Trials on the clock as they were before they were matched, where that is known."""
        return self._known_in_time(unwarped(filled, match.times)) if self._width else None

    def _known_in_time(self, trials):
        return self.space.convert(trials)[..., : self._width]

    def finder(self, of_person=None, in_linear_time=None):
        """The finder of faults, perhaps by right trials of the person; without them it is kept."""
        if of_person is None and self._finder is not None:
            return self._finder
        view, space = self.view, self.space
        converted = space.convert(with_residuals(self.training, view.model.groups_, self.left_out))
        finder = FaultFinder(
            converted,
            view.model.groups_,
            space.parts,
            None if of_person is None else space.convert(of_person),
            coverage=view.model.coverage,
            floor=space.outside(converted),
            linear=None if self._linear is None else (*self._linear, in_linear_time),
        )
        if of_person is None:
            self._finder = finder
        return finder


class FaultSpace:
    """The features in which faults are sought: limbs along their parents' axes, and others.

    Parameters
    ----------
    names : list of str
        Features of the view.
    limbs : LimbColumns or None
        None if each feature is judged by itself.
    """

    def __init__(self, names, limbs):
        self.names, self.limbs = names, limbs
        self.parts = []
        remaining = list(range(len(names)))
        if limbs is not None:
            skeleton, start = limbs.cosines.skeleton, limbs.columns.start
            first, n_dims = int(skeleton.has_height), skeleton.n_dims
            spans = [("pelvis_height", [0])] if first else []
            for k, limb in enumerate(skeleton.limbs):
                spans.append((limb, list(range(first + n_dims * k, first + n_dims * (k + 1)))))
            for limb, columns in spans:
                in_view = [start + k for k in columns]
                self.parts.append(Part(limb, columns, in_view, part_of_limb(limb)))
            remaining = [k for k in remaining if not start <= k < limbs.columns.stop]
        self._others, n_cosines = remaining, len(names) - len(remaining)
        self.parts += [Part(names[k], [n_cosines + j], [k], None) for j, k in enumerate(remaining)]

    def direction(self, part, change, mean):
        """Where a limb departs to by a change of its cosines, by the mean (n_features,) there."""
        expected = self.convert(mean[np.newaxis, np.newaxis])[0, 0, part.columns]
        return direction_of(part.name, change, expected)

    def convert(self, trials):
        """Trials (n, P, n_features) of the view, without gaps: (n, P, n_columns)."""
        if self.limbs is None:
            return trials
        cosines = self.limbs.in_parent_axes(trials)
        return np.concatenate([cosines, trials[..., self._others]], axis=2)

    def outside(self, known):
        """A floor of the variance of limbs, of each column.

        It is eight times the variance outside of the components that hold 95 % of that of the known
        trials (n, P, n_columns): new people do what none of these did.
        """
        floor = np.zeros(known.shape[2])
        if self.limbs is not None:
            n_cosines = known.shape[2] - len(self._others)
            poses = known[..., :n_cosines].reshape(-1, n_cosines)
            values, vectors = np.linalg.eigh(np.cov(poses, rowvar=False))
            left_out = np.cumsum(values) <= (1 - _HELD) * values.sum()
            squares = np.square(vectors[:, left_out]) @ np.maximum(values[left_out], 0)
            floor[:n_cosines] = _OUTSIDE * squares
        return floor


def with_residuals(trials, groups, variance):
    """Trials in an aSpace with residuals in place of those that it took.

    They are drawn, always the same ones: half of their variance is an offset of a group, the other
    half changes within a tenth of the clock.

    Parameters
    ----------
    trials : ndarray (n, P, n_features)
    groups : ndarray of int (n,)
    variance : ndarray (n_features,)
        Of the residuals; all 0 without an aSpace.
    """
    if not variance.any():
        return trials
    n, n_frames, width = trials.shape
    codes = np.unique(groups, return_inverse=True)[1].ravel()
    rng, t = np.random.default_rng(0), np.linspace(0, 1, n_frames)
    offsets = rng.standard_normal((codes.max() + 1, 1, width))[codes]
    kernel = np.exp(-0.5 * np.square((t[:, np.newaxis] - t) / _CORRELATION_TIME))
    factor = np.linalg.cholesky(kernel + 1e-6 * np.eye(n_frames))
    courses = factor @ rng.standard_normal((n, n_frames, width))
    return trials + np.sqrt(variance / 2) * (offsets + courses)


def around_peak(scores, peak):
    """First and last frame around a peak in which scores are at least half of it; gaps between."""
    enough = scores * np.sign(scores[peak]) >= (_OF_PEAK - ROUNDING) * abs(scores[peak])
    fits = enough | np.isnan(scores)
    first, last = peak, peak
    while first > 0 and fits[first - 1]:
        first -= 1
    while last < len(scores) - 1 and fits[last + 1]:
        last += 1
    # A run ends in what was seen.
    seen = np.flatnonzero(enough[first : last + 1])
    return first + int(seen[0]), first + int(seen[-1])


def unwarped(trials, times):
    """Trials (n, P, n_features) on the clock, in linear time, by their times (n, P)."""
    frames = np.arange(trials.shape[1])
    pairs = zip(trials, times, strict=True)
    return np.stack([at_times(x, np.interp(frames, of_one, frames)) for x, of_one in pairs])


def _is_linear(synchronizer):
    """Whether a synchronizer leaves time as it is."""
    synchronizer = getattr(synchronizer, "synchronizer_", synchronizer)
    return isinstance(synchronizer, LinearSynchronizer) and synchronizer.keyframes_ is None


def explained_by_timing(rows, curves, lower, upper, match):
    """Whether a wrong clock may be the reason of departures, (n_rows,).

    The time of every frame of one may then be another one inside its interval, where the
    trial has values between the bounds.

    Parameters
    ----------
    rows : list of Departure
    curves : ndarray, shape (n, P, n_features)
        Trials on the clock.
    lower, upper : ndarray, shape (P, n_features)
        Bounds of what is no departure.
    match : Match
        Of the trials.
    """
    n_frames, pairs = curves.shape[1], zip(match.times, *match.interval(), strict=True)
    # The frames of the clock whose times are inside the interval of a frame.
    spans = np.array([(t.searchsorted(a), t.searchsorted(b, "right")) for t, a, b in pairs])
    frames, explained = np.arange(n_frames), np.empty(len(rows), dtype=bool)
    starts, ends = np.minimum(spans[:, 0], frames), np.maximum(spans[:, 1], frames + 1)
    for k, row in enumerate(rows):
        i, feature = row.trial, row.feature
        curve, run = curves[i, :, feature], frames[row.first : row.last + 1]
        # A fault may last over a gap, in which nothing was seen.
        run = run[~np.isnan(curve[run])]
        seen = [curve[starts[i, p] : ends[i, p]] for p in run]
        low, high = (np.array([extreme(x) for x in seen]) for extreme in (np.nanmin, np.nanmax))
        explained[k] = np.all((low <= upper[run, feature]) & (high >= lower[run, feature]))
    return explained
