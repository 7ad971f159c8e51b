"""CycleDisplay: the self-correlation of a take, its stretches, and the cuts between cycles."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Self

import numpy as np
from sklearn.base import BaseEstimator

from ..body.formats import SIDES
from ..inputs.facts import units_of_columns
from ..inputs.trial_facts import TrialFacts
from ..inputs.types import TrialsLike, Unit
from ..inputs.wording import counted
from ..synchronizers.match import UNITS
from ..takes.cycles import (
    CycleSegmenter,
    as_learnt,
    check_takes,
    compared_names,
    correlate_takes,
    start_curves,
)
from ..takes.self_correlation import SelfCorrelation, required_strength
from .arguments import labels_of_signals
from .base import COLORS, WIDTH, AxesLike, Display, TimeAxis, legend_above


class CycleDisplay(Display):
    """The self-correlation of a take, where it repeats, and the cuts between its cycles.

    Above the self-correlation of the longest stretch over the lag: its peaks, the period, and the
    threshold. Below a curve of the take, its stretches shaded, and its cuts. Use `from_estimator`.

    Attributes
    ----------
    repeats : SelfCorrelation
        The self-correlation, its peaks, and the period of the longest stretch.
    cuts : ndarray of int
        The frames at which cycles begin and end.
    stretches : list of (int, int)
        The first frames of stretches that repeat, and the frames after their last ones.
    axes_ : list of Axes
        The panels of the self-correlation and of the take.
    correlation_, curve_, peaks_, threshold_ : Line2D
        The curves, the markers at the peaks, and the threshold.
    period_ : Line2D or None
        The line at the period.
    cuts_ : LineCollection
        The lines at the cuts.
    stretches_ : list of Rectangle
        The shades of the stretches.

    Examples
    --------
    >>> from sklearn_motionsync.takes import CycleSegmenter
    >>> from sklearn_motionsync.display import CycleDisplay
    >>> from sklearn_motionsync.datasets import make_gait
    >>> bunch = make_gait(3, n_cycles=4, takes=True, random_state=0)
    >>> segmenter = CycleSegmenter(start=0).fit(bunch.data)
    >>> CycleDisplay.from_estimator(segmenter, bunch.data[1:]).cuts.tolist()
    [99, 202, 306, 410]
    """

    repeats: SelfCorrelation
    curve: np.ndarray  # of the take, (n_frames,)
    label: str  # of the curve
    axis: TimeAxis
    cuts: np.ndarray
    stretches: Sequence[tuple[int, int]]
    threshold: float  # the self-correlation that a cyclic take needs
    title: str

    def __repr__(self):
        return f"CycleDisplay({len(self.curve)} frames, {self.title})"

    @classmethod
    def from_estimator(
        cls,
        estimator: BaseEstimator,
        X: TrialsLike,
        *,
        unit: Unit = "frames",
        frame_rate: float | None = None,
        units: str | Mapping[str, str] | None = None,
        ax: AxesLike | None = None,
    ) -> Self:
        """Draw the self-correlation and the cuts of a take.

        Parameters
        ----------
        estimator : CycleSegmenter
            Before a fit the self-correlation is drawn without cuts.
        X : takes
            As the estimator takes them; the first one is drawn. Its curve is the one that defines
            the beginning of a cycle: the distance of a foot ahead of the pelvis in leg lengths, or
            a feature.
        unit : {"frames", "percent", "seconds"}, default="frames"
            The unit of time; ``"percent"`` is of the take.
        frame_rate : float, default=None
            Frames a second, for seconds; by default what tables tell, as in `Match.to_frame`.
        units : str or dict, default=None
            The unit of the curve; by default what tables tell in ``attrs["units"]``.
        ax : Axes or array-like of Axes, default=None
            See `plot`.

        Returns
        -------
        CycleDisplay
            The display, drawn.

        Raises
        ------
        ValueError
            If the takes break the contract.
        """
        if not isinstance(estimator, CycleSegmenter):
            raise ValueError(f"Give a CycleSegmenter, got {type(estimator).__name__}.")
        fitted = hasattr(estimator, "pattern_")
        segmenter = CycleSegmenter(**estimator.get_params()).set_params(not_cyclic="skip")
        recordings, takes = check_takes(segmenter, X, reset=True)
        facts = TrialFacts.of([recordings[0]], frame_rate)
        (x,), (repeats,) = correlate_takes(segmenter, recordings[:1], takes[:1])
        longest = (as_learnt(estimator, x, repeats) if fitted else repeats).correlation
        row = estimator.report(recordings[:1]).iloc[0]
        segmenter.set_params(start=estimator.start_ if fitted else estimator.start)
        name, curve = _curve_of(segmenter, recordings[0], x)
        cuts, cycles = np.array([], dtype=int), ""
        if fitted and row["cyclic"]:
            _, origin = estimator.segment(recordings[:1])
            whole = origin[origin["complete"]]
            cuts = np.unique([whole["start"], whole["stop"] - 1])
            cycles = counted(len(whole), "whole cycle")
        lasting = facts.durations() if unit == "seconds" else None
        (label,) = labels_of_signals([name], units_of_columns(recordings[0]), units)
        period = f"period {longest.period:.1f} frames" if row["period"] > 0 else ""
        several = f"{len(row['stretches'])} stretches" if len(row["stretches"]) > 1 else ""
        return cls._of(
            repeats=longest if row["period"] > 0 else longest._replace(period=np.nan),
            curve=curve,
            label=label,
            axis=TimeAxis(unit, len(curve), [len(curve)], lasting),
            cuts=cuts,
            stretches=row["stretches"],
            threshold=float(required_strength(np.inf, longest.breadth, segmenter.threshold)),
            title=", ".join(filter(None, [row["reason"], several, period, cycles])) or "no period",
        ).plot(ax)

    def _layout(self):
        return [0, 1], (2, 1), (WIDTH, 4.8)

    def _draw(self):
        upper, lower = self.axes_
        (times,) = self.axis.trials()
        blue, black, orange = (COLORS[k] for k in ("trial", "pattern", "mean"))
        correlation, peaks = self.repeats.correlation, self.repeats.peaks
        lags = times[: len(correlation)]
        (self.correlation_,) = upper.plot(lags, correlation, color=blue)
        (self.peaks_,) = upper.plot(
            lags[peaks], correlation[peaks], "o", color=blue, fillstyle="none", label="peaks"
        )
        # The threshold is higher at lags of which a stretch holds less than two.
        longest = max((stop - start for start, stop in self.stretches), default=len(self.curve))
        asked = required_strength(longest / np.arange(1, len(lags)), np.inf, self.threshold)
        (self.threshold_,) = upper.plot(
            lags[1:], asked, color="0.4", linestyle="--", linewidth=1, label="threshold"
        )
        self.period_ = None
        if np.isfinite(self.repeats.period):
            at = np.interp(self.repeats.period, np.arange(len(lags)), lags)
            self.period_ = upper.axvline(at, color=orange, linewidth=1, label="period")
        upper.set_ylim(min(-0.5, correlation.min() - 0.05), 1.05)
        upper.set_title(self.title, fontsize="medium")
        lag = f"lag ({UNITS[self.axis.unit]})"
        self._label_axes([upper], ["self-correlation"], lag, ends=(0, times[longest - 1]))
        (self.curve_,) = lower.plot(times, self.curve, color=blue)
        self.stretches_ = [
            lower.axvspan(
                times[start],
                times[stop - 1],
                color=orange,
                alpha=0.15,
                linewidth=0,
                label="repeats",
            )
            for start, stop in self.stretches
        ]
        handles, _ = upper.get_legend_handles_labels()
        legend_above([upper], [*handles, *self.stretches_[:1]])
        self.cuts_ = lower.vlines(
            times[self.cuts], 0, 1, transform=lower.get_xaxis_transform(), color=black, linewidth=1
        )
        time = self.axis.trial_label.replace("trial", "take")
        self._label_axes([lower], [self.label], time, ends=times)


def _curve_of(segmenter, take, x):
    """The name and the values of the curve of a take."""
    curves = start_curves(segmenter, [take], [x])
    if curves is None:
        return compared_names(segmenter)[0], x[:, 0]
    name, (curve,) = next(iter(curves.items()))
    is_foot = segmenter.skeleton is not None and name in SIDES
    return f"{name} ankle ahead (legs)" if is_foot else name, curve
