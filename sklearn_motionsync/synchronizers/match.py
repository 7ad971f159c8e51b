"""Match: warps of trials to the pattern, the result of every synchronizer."""

from __future__ import annotations

import html
import reprlib
from copy import copy
from numbers import Real
from typing import Any, Self

import numpy as np
import pandas as pd
from sklearn.base import BaseEstimator

from ..inputs.long_tables import to_frame
from ..inputs.numbers import as_numbers, as_warps
from ..inputs.resampling import as_frame_rates
from ..inputs.trial_facts import TrialFacts
from ..inputs.types import (
    Labels,
    NumbersLike,
    Transformed,
    TrialsLike,
    Unit,
    ValuesLike,
)
from ..inputs.validation import read_collection
from ..inputs.wording import counted
from ..matching.counting import ROUNDING, first_largest
from ..matching.warps import sample
from ..utils.pipelines import Routed, route_to_synchronizer
from .intervals import Intervals

# Coverage of one standard error to both sides, of a normal distribution.
STANDARD = 0.6827
# Units of time of the clock of the pattern, and their symbols.
UNITS = {"frames": "frames", "percent": "%", "seconds": "s"}
# Trials in the table for notebooks.
_SHOWN = 10
# The smallest rate, so that logarithms are finite.
_SLOWEST = 0.01


class Match:
    """Warps of a set of trials to the pattern.

    The ``match`` of a synchronizer returns one, and `from_estimator` that of a whole pipeline.

    Parameters
    ----------
    times : array-like, shape (n_sequences, P)
        ``tau(p)``, from 0 to ``P - 1``: the frame that corresponds to frame p of the pattern, in
        trials that are linearly normalised to its length.
    distances : array-like, shape (n_sequences,), default=None
        Distance of each trial from the pattern; NaN by default.
    intervals : Intervals, default=None
        What `DenseSynchronizer` gives for ``interval`` and ``doubtful``.

    Attributes
    ----------
    times : ndarray, shape (n_sequences, P)
        ``tau(p) = p + Delta(p)``, non-decreasing; from synchronizers of this package
        ``tau(0) = 0``, ``tau(P-1) = P-1``.
    distances : ndarray, shape (n_sequences,)
        From a `DenseSynchronizer` the synchronisation distance ``D_{n,m}`` of Eq. 12, of the path
        straight to the base; from others the squared distance to the pattern.
    intervals : Intervals or None
        As given; ``interval`` asks it.
    facts : TrialFacts or None
        What is known of the trials that were matched: their lengths, frame rates and labels. None
        of warps that are given.
    reached : Routed or None
        The trials and the synchronizer that matched them, so that comparisons, figures and reports
        take the match in place of the estimator. None of warps that are given, of trials that were
        read in parts, and after unpickling.

    Raises
    ------
    ValueError
        If times are not of shape (n_sequences, P) with at least two frames, decrease, or are not
        within the clock; or if there is not one distance a trial.

    Examples
    --------
    >>> import numpy as np
    >>> from sklearn_motionsync import LinearSynchronizer
    >>> X = [np.arange(5.0)[:, None], np.arange(9.0)[:, None] / 2]
    >>> match = LinearSynchronizer(n_frames=5).fit(X).match(X)
    >>> match
    Match(2 trials on 5 frames)
    >>> match.frames()[1].tolist()  # the second trial has nine frames
    [0.0, 2.0, 4.0, 6.0, 8.0]
    >>> match.seconds(frame_rate=4)[1].tolist()
    [0.0, 0.5, 1.0, 1.5, 2.0]
    >>> forces = [np.arange(41.0)[:, None], np.arange(81.0)[:, None]]  # ten times the rate
    >>> match.warp(forces)[1].ravel().tolist()
    [0.0, 20.0, 40.0, 60.0, 80.0]

    Timing is a result, too: this trial is late by up to a quarter of the clock.

    >>> late = Match([[0, 2, 3, 3.5, 4]])
    >>> late.offsets_in("percent").tolist()
    [[0.0, 25.0, 25.0, 12.5, 0.0]]
    >>> late.rates.tolist()
    [[2.0, 1.5, 0.75, 0.5, 0.5]]
    """

    __slots__ = ("distances", "facts", "intervals", "reached", "times")

    def __init__(
        self,
        times: NumbersLike,
        distances: ValuesLike | None = None,
        intervals: Intervals | None = None,
    ) -> None:
        times = as_warps(times)
        n_sequences, n_frames = times.shape
        back = np.diff(times) < -ROUNDING * n_frames
        if back.any():
            i, p = np.argwhere(back)[0]
            raise ValueError(
                f"Trial {i}: times must not decrease, but {times[i, p + 1]:g} at frame "
                f"{p + 1} follows {times[i, p]:g}."
            )
        np.maximum.accumulate(times, axis=1, out=times)
        if distances is None:
            distances = np.full(n_sequences, np.nan)
        distances = np.array(as_numbers(distances, "distances"))
        if distances.shape != (n_sequences,):
            raise ValueError(
                f"distances must be one for each of the {counted(n_sequences, 'trial')}, got "
                f"shape {distances.shape}."
            )
        self.times, self.distances = times, distances
        self.intervals = intervals
        self.facts: TrialFacts | None = None
        self.reached: Routed | None = None

    def __getstate__(self):
        state = {name: getattr(self, name) for name in self.__slots__}
        return None, state | {"reached": None}

    def of_trials(self, facts: TrialFacts, reached: Routed | None = None) -> Match:
        """The same warps, with what is known of the trials that were matched.

        Parameters
        ----------
        facts : TrialFacts
            Their lengths, frame rates and labels.
        reached : Routed, default=None
            The trials and the synchronizer.

        Returns
        -------
        Match
            A copy that knows them.
        """
        known = copy(self)
        known.facts, known.reached = facts, reached
        return known

    @property
    def offsets(self) -> np.ndarray:
        """``Delta(p) = tau(p) - p``, in frames of the pattern: (n_sequences, P).

        Positive where a trial is later than the pattern, negative where it is earlier.
        """
        return self.times - np.arange(self.times.shape[1])

    @property
    def rates(self) -> np.ndarray:
        """Local rates ``d tau / dp``: (n_sequences, P).

        Central differences of ``times``, one-sided at both ends, and at least 0.01. The log rate,
        ``np.log(match.rates)``, is 0 at the pace of the pattern, positive where a trial is
        slower and its offset grows, negative where it is faster.
        """
        return np.maximum(np.gradient(self.times, axis=1), _SLOWEST)

    def interval(
        self,
        coverage: float = 0.9,
        unit: Unit = "frames",
        X: TrialsLike | ValuesLike | None = None,
        frame_rate: float | ValuesLike | None = None,
    ) -> tuple[np.ndarray, np.ndarray]:
        """How sure ``times`` are: where a trial shows the moments of the pattern.

        For a key moment of the pattern, the interval holds the time of the same moment of a trial
        with this probability. It is pointwise: of many moments a share of ``1 - coverage`` is
        outside. Its width follows from the paths of the trellis that cost hardly more than the best
        one, and from the share of the movement that no warp explains. Constants turn them into per
        cent. They were fitted to key moments of people, or ``DenseSynchronizer.calibrate`` fits
        them to yours. Of warps that are refined the width follows from the noise.

        Parameters
        ----------
        coverage : float, default=0.9
            Probability, above 0 and below 1.
        unit : {"frames", "percent", "seconds"}, default="frames"
            Of the bounds, from the beginning of each trial, as in ``offsets_in``.
        X, frame_rate : default=None
            For seconds, as in ``offsets_in``.

        Returns
        -------
        lower, upper : ndarray, shape (n_sequences, P)
            Non-decreasing, inside the trial, and on both sides of ``times``. They meet at
            both ends, and at exact key-frames, which pin a warp.

        Raises
        ------
        ValueError
            If the match does not tell, because it is not from a `DenseSynchronizer`; if there is no
            such coverage; and as from ``offsets_in``.

        Notes
        -----
        It is computed when it, or ``doubtful``, is first asked for, in less time than the match
        took. Until then the trials must not be changed in place.

        Examples
        --------
        >>> from sklearn_motionsync import ASpace, DenseSynchronizer, DirectionCosines
        >>> from sklearn_motionsync.datasets import make_bending
        >>> bunch = make_bending(12, random_state=0)
        >>> X = ASpace().fit_transform(DirectionCosines(bunch.skeleton).fit_transform(bunch.data))
        >>> match = DenseSynchronizer(n_frames=101).fit(X).match(X)
        >>> lower, upper = match.interval(0.9, "percent")
        >>> float((upper - lower).mean().round(1)) < 5
        True
        >>> bool((lower <= match.times).all() and (match.times <= upper).all())
        True
        """
        lower, upper = self._known_intervals().bounds(check_coverage(coverage))
        return self._in_unit(lower, unit, X, frame_rate), self._in_unit(upper, unit, X, frame_rate)

    @property
    def doubtful(self) -> np.ndarray:
        """Which trials to look at before their warps are used, bool: (n_sequences,).

        Those with much movement that no warp explains and a wide interval: cut off, repeated, or
        another movement. And all trials if the training set did not support its warps.
        ``reasons`` says which. Raises as ``interval``.
        """
        return np.array([reason is not None for reason in self.reasons], dtype=bool)

    @property
    def reasons(self) -> list[str | None]:
        """Why each trial is doubtful, in words; None if it is not."""
        return list(self._known_intervals().measured()[2])

    def offsets_in(
        self,
        unit: Unit,
        X: TrialsLike | ValuesLike | None = None,
        frame_rate: float | ValuesLike | None = None,
    ) -> np.ndarray:
        """How much later than the pattern trials are at every frame of it, in a unit of time.

        Offsets are relative to linear normalisation: all trials begin and end with the
        pattern, and one that is uniformly slower is not late.

        Parameters
        ----------
        unit : {"frames", "percent", "seconds"}
            Frames of the pattern, as ``offsets``; per cent of the clock, ``100 Delta / (P - 1)``;
            or seconds of each trial as recorded.
        X : trials, or array-like of numbers, shape (n_sequences,), default=None
            For seconds: the trials, or how many frames each has. By default those that were
            matched.
        frame_rate : float, or array-like of shape (n_sequences,), default=None
            For seconds: frames per second of X. By default what tables tell: an index in seconds,
            or ``attrs["frame_rate"]`` of `io.read_motion`; or else what ``match`` was told.

        Returns
        -------
        ndarray, shape (n_sequences, P)
            Positive where a trial is later than the pattern.

        Raises
        ------
        ValueError
            If there is no such unit, or trials or their frame rate are not known for seconds; and
            as from ``seconds``.
        """
        return self._in_unit(self.offsets, unit, X, frame_rate)

    def to_frame(
        self,
        unit: Unit = "frames",
        X: TrialsLike | ValuesLike | None = None,
        frame_rate: float | ValuesLike | None = None,
        labels: Labels | None = None,
        *,
        coverage: float | None = None,
    ) -> pd.DataFrame:
        """The timing of all trials as a table, such as for a CSV file.

        Parameters
        ----------
        unit : {"frames", "percent", "seconds"}, default="frames"
            Of ``time`` and ``offset``, as in ``offsets_in``.
        X, frame_rate : default=None
            For seconds, as in ``offsets_in``.
        labels : sequence of length n_sequences, or Index, default=None
            Labels of the trials; by default those of X, or of the trials that were matched. A
            MultiIndex makes several levels.
        coverage : float, default=None
            Probability of the intervals of ``interval``, such as 0.9. None for none.

        Returns
        -------
        DataFrame
            Indexed by the label of the trial and the frame of the pattern. Columns: ``time``,
            tau(p) in the unit, from the beginning of each trial; ``offset``; ``rate``; and with a
            coverage ``lower`` and ``upper``, between which the time lies, and ``doubtful``.

        Raises
        ------
        ValueError
            As from ``offsets_in``, and with a coverage as from ``interval``; or if there is not one
            label a trial.

        Examples
        --------
        >>> from sklearn_motionsync import Match
        >>> match = Match([[0, 2, 3, 3.5, 4]])
        >>> match.to_frame("percent", labels=["ann"]).loc["ann"].round(1)
                time  offset  rate
        frame
        0        0.0     0.0   2.0
        1       50.0    25.0   1.5
        2       75.0    25.0   0.8
        3       87.5    12.5   0.5
        4      100.0     0.0   0.5
        >>> csv = match.to_frame("percent", labels=["ann"]).to_csv()
        """
        columns = {
            "time": self._in_unit(self.times, unit, X, frame_rate),
            "offset": self.offsets_in(unit, X, frame_rate),
            "rate": self.rates,
        }
        if labels is not None:
            self._check_count(labels, "label")
        elif X is not None or self.facts is not None:
            labels = self.facts_of(X, frame_rate).index
        if coverage is not None:
            columns["lower"], columns["upper"] = self.interval(coverage, unit, X, frame_rate)
        tables = [
            pd.DataFrame(np.column_stack(of_trial), columns=list(columns))
            for of_trial in zip(*columns.values(), strict=True)
        ]
        table = to_frame(tables, trials=labels)
        if coverage is not None:
            table["doubtful"] = np.repeat(self.doubtful, self.times.shape[1])
        return table

    @classmethod
    def from_estimator(cls, estimator: BaseEstimator, X: TrialsLike, **params: Any) -> Self:
        """Match raw trials by a fitted synchronizer, or by a pipeline with one.

        Parameters
        ----------
        estimator : synchronizer, or Pipeline with one
            Fitted.
        X : list of arrays (n_frames_i, n_features), or other collection
            Trials, as the estimator takes them.
        **params : dict
            Metadata for the ``match`` of the synchronizer, such as ``keyframes``, and for the
            ``transform`` of the steps before it.

        Returns
        -------
        Match
            The warps of X.

        Raises
        ------
        ValueError
            If the estimator has no synchronizer, or key-frames that it needs are missing.
        TypeError
            If no step takes one of the params.

        Examples
        --------
        >>> from sklearn.pipeline import make_pipeline
        >>> from sklearn_motionsync import ASpace, DenseSynchronizer, DirectionCosines, Match
        >>> from sklearn_motionsync.datasets import make_bending
        >>> bunch = make_bending(6, random_state=0)
        >>> pipe = make_pipeline(DirectionCosines(bunch.skeleton), ASpace(), DenseSynchronizer(50))
        >>> Match.from_estimator(pipe.fit(bunch.data), bunch.data)
        Match(6 trials on 50 frames)
        """
        return route_to_synchronizer(estimator, X, params, f"{cls.__name__}.from_estimator").match()

    def warp(self, X: TrialsLike) -> Transformed:
        """Warp sequences recorded with the trials onto the clock of the pattern (Eq. 18).

        Such as joint positions when the match was made in the aSpace, forces, or muscle signals, at
        any frame rate: the first and last frame of each are those of the trial.

        Parameters
        ----------
        X : list of arrays (n_frames_i, n_features), 3-D array, or (trial, frame) frame
            One sequence a trial, in the same order. Samples interpolated from NaN or
            infinite values are such, too.

        Returns
        -------
        ndarray, shape (n_sequences, P, n_features)
            The sequences at ``times``.

        Raises
        ------
        ValueError
            If there is not one sequence a trial, or they break the contract for trials.
        """
        arrays, _ = read_collection(X)
        self._check_count(arrays, "sequence")
        return sample(arrays, self.times, self.times.shape[1])

    def frames(self, X: TrialsLike | ValuesLike | None = None) -> np.ndarray:
        """The frame of each trial that corresponds to each frame of the pattern.

        Parameters
        ----------
        X : trials, or array-like of numbers, shape (n_sequences,), default=None
            The trials, sequences recorded with them, or how many frames each has; by default the
            trials that were matched. For univariate trials in rows give
            ``[X.shape[1]] * len(X)``.

        Returns
        -------
        ndarray, shape (n_sequences, P)
            From 0 to ``n_frames_i - 1``, with fractions.

        Raises
        ------
        ValueError
            If there is not one a trial, or one has fewer than two frames.
        """
        return self._stretched(self.times, self.facts_of(X))

    def seconds(
        self,
        X: TrialsLike | ValuesLike | None = None,
        frame_rate: float | ValuesLike | None = None,
    ) -> np.ndarray:
        """The time in each trial that corresponds to each frame of the pattern.

        Parameters
        ----------
        X, frame_rate : default=None
            The trials and their frame rate, as in ``offsets_in``.

        Returns
        -------
        ndarray, shape (n_sequences, P)
            Seconds from the first frame of each trial.

        Raises
        ------
        ValueError
            As from ``frames``; or if a rate is not above 0 or not known, or there is not one a
            trial.
        """
        return self._in_unit(self.times, "seconds", X, frame_rate)

    def facts_of(
        self,
        X: TrialsLike | ValuesLike | None = None,
        frame_rate: float | ValuesLike | None = None,
    ) -> TrialFacts:
        """What is known of trials that are given, or else of those that were matched.

        Parameters
        ----------
        X, frame_rate : default=None
            As in ``offsets_in``.

        Returns
        -------
        TrialFacts
            Their lengths, frame rates and labels. What was recorded with a trial lasts as long.

        Raises
        ------
        ValueError
            If X is not given, and the match does not know its trials; or as from ``frames``.
        """
        if X is not None:
            facts = TrialFacts.of(X, frame_rate)
            self._check_count(facts.lengths, "length")
            if not facts.are_timed and self.facts is not None and self.facts.are_timed:
                facts = facts.at((facts.lengths - 1) / self.facts.durations())
            return facts
        if self.facts is None:
            raise ValueError(
                "unit='seconds' needs X, the trials or how many frames each has, and frame_rate: "
                "this match is of warps that were given, and does not know its trials."
            )
        return self.facts if frame_rate is None else self.facts.at(frame_rate)

    def _known_intervals(self):
        if self.intervals is None:
            raise ValueError(
                "This match does not tell how sure it is: only DenseSynchronizer.match does, and "
                "Match.from_estimator of a pipeline with one."
            )
        return self.intervals

    def _in_unit(self, frames, unit, X, frame_rate):
        """Times or offsets in frames of the pattern, in a unit of time."""
        is_given = X is not None or (frame_rate is not None and self.facts is not None)
        if check_unit(unit) == "seconds" or is_given:
            facts = self.facts_of(X, frame_rate)
        elif frame_rate is not None:
            as_frame_rates(frame_rate, len(self.times))
        if unit == "seconds":
            return self._stretched(frames, facts) / facts.known_rates()[:, np.newaxis]
        return frames * (100 / (self.times.shape[1] - 1) if unit == "percent" else 1)

    def _stretched(self, times, facts):
        """Frames of the pattern in frames of each trial."""
        return times * (facts.lengths[:, np.newaxis] - 1) / (self.times.shape[1] - 1)

    def __repr__(self):
        n_sequences, n_frames = self.times.shape
        return f"Match({counted(n_sequences, 'trial')} on {n_frames} frames)"

    def _repr_html_(self):
        """A table for notebooks: how late each of the first trials is, and when."""
        percent = 100 * self.offsets / (self.times.shape[1] - 1)
        largest = max(np.abs(percent).max(initial=0), 1e-9)
        rows = []
        for i, offsets in enumerate(percent[:_SHOWN]):
            at = first_largest(np.abs(offsets))
            word = "late" if offsets[at] > 0 else "early"
            when = f"{abs(offsets[at]):.1f} % {word}, at {100 * at / (len(offsets) - 1):.0f} %"
            rows.append(
                f"<tr><td>{i}</td><td>{when}</td><td>{_sparkline(offsets, largest)}</td></tr>"
            )
        more = len(percent) - len(rows)
        tail = f"<p>and {counted(more, 'trial')} more</p>" if more else ""
        return (
            f"<p>{html.escape(repr(self))}; offsets of at most {largest:.1f} % of the pattern</p>"
            "<table><thead><tr><th></th><th>largest offset</th><th>offset, late is up</th></tr>"
            f"</thead><tbody>{''.join(rows)}</tbody></table>{tail}"
        )

    def _check_count(self, given, noun):
        if len(given) != len(self.times):
            raise ValueError(
                f"{counted(len(self.times), 'matched trial')}, but "
                f"{counted(len(given), noun)}: give one for each, in the same order."
            )


def _sparkline(values, largest):
    """A curve as a small picture (SVG), from ``-largest`` to ``largest``."""
    xs, ys = np.linspace(0, 120, len(values)), 12 - 11 * values / largest
    points = " ".join(f"{x:.1f},{y:.1f}" for x, y in zip(xs, ys, strict=True))
    return (
        '<svg width="120" height="24" viewBox="0 0 120 24" role="img">'
        '<line x1="0" y1="12" x2="120" y2="12" stroke="currentColor" stroke-opacity="0.3"/>'
        f'<polyline points="{points}" fill="none" stroke="#0072B2" stroke-width="1.5"/></svg>'
    )


def check_coverage(coverage):
    """The coverage of an interval as a float, if it is a probability."""
    is_number = isinstance(coverage, Real) and not isinstance(coverage, bool)
    if not (is_number and 0 < coverage < 1):
        raise ValueError(
            f"coverage must be a probability above 0 and below 1, such as 0.9; got "
            f"{reprlib.repr(coverage)}."
        )
    return float(coverage)


def check_match(match, n_sequences, n_frames, name):
    """Refuse the match of a synchronizer of this name unless it has all trials."""
    shape = np.shape(getattr(match, "times", None))
    if shape != (n_sequences, n_frames):
        raise ValueError(
            f"{name}.match must return a Match with times of shape (n_sequences, P), here "
            f"{(n_sequences, n_frames)}; got {type(match).__name__} with {shape}."
        )


def check_unit(unit):
    """Refuse what is no unit of time."""
    if not (isinstance(unit, str) and unit in UNITS):
        raise ValueError(f"unit must be one of {list(UNITS)}, got {reprlib.repr(unit)}.")
    return unit
