"""CycleDisplay: the self-correlation of a take, its stretches, and the cuts between cycles."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Self

import numpy as np
from sklearn.base import BaseEstimator

from ..body.formats import SIDES
from ..inputs.features import choose_features
from ..inputs.types import PerformancesLike, Unit, ValuesLike
from ..segmentation.cycles import (
    CycleSegmenter,
    as_learnt,
    check_takes,
    compared_names,
    correlate_takes,
    start_curves,
)
from ..segmentation.self_correlation import required_strength
from ..synchronizers.match import UNITS, rates_of
from .arguments import AxesLike, as_index
from .drawing import COLORS, WIDTH, legend_above, panels
from .time_axis import TimeAxis

__all__ = ["CycleDisplay"]


class CycleDisplay:
    """The self-correlation of a take, where it repeats, and the cuts between its cycles.

    Above the self-correlation of the longest stretch over the lag: its peaks, the period, and the
    threshold. Below a curve of the take, its stretches shaded, and its cuts. Use `from_estimator`.

    Parameters
    ----------
    correlation : array-like, shape (n_lags,)
        The self-correlation at each lag in frames.
    peaks : array-like of int
        The lags of its peaks.
    curve : array-like, shape (n_frames,)
        A curve of the take.
    cuts : array-like of int, default=()
        The frames at which cycles begin and end.
    stretches : list of (int, int), default=()
        The first frames of stretches that repeat, and the frames after their last ones.
    n_cycles : int, default=None
        The number of whole cycles; None is one less than there are cuts.
    threshold : float, default=0.4
        The self-correlation that a cyclic take needs.
    period : float, default=None
        The length of a cycle in frames; None if there is none.
    name : str, default=""
        The name of the curve.
    reason : str, default=""
        Why the take cannot be segmented.

    Attributes
    ----------
    figure_ : Figure
        The figure of the last plot.
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
    >>> from sklearn_motionsync import CycleSegmenter
    >>> from sklearn_motionsync.display import CycleDisplay
    >>> from sklearn_motionsync.datasets import make_gait
    >>> bunch = make_gait(3, n_cycles=4, takes=True, random_state=0)
    >>> segmenter = CycleSegmenter(start=0).fit(bunch.data)
    >>> CycleDisplay.from_estimator(segmenter, bunch.data, take=1).cuts.tolist()
    [99, 202, 306, 410]
    """

    def __init__(
        self,
        correlation: ValuesLike,
        peaks: ValuesLike,
        curve: ValuesLike,
        cuts: ValuesLike = (),
        *,
        stretches: Sequence[tuple[int, int]] = (),
        n_cycles: int | None = None,
        threshold: float = 0.4,
        period: float | None = None,
        name: str = "",
        reason: str = "",
    ) -> None:
        self.correlation, self.curve = np.asarray(correlation), np.asarray(curve)
        self.peaks, self.cuts = np.asarray(peaks, dtype=int), np.asarray(cuts, dtype=int)
        self.n_cycles = max(len(self.cuts) - 1, 0) if n_cycles is None else n_cycles
        self.stretches = [(int(start), int(stop)) for start, stop in stretches]
        self.threshold, self.period, self.name, self.reason = threshold, period, name, reason

    def __repr__(self):
        return f"CycleDisplay({len(self.curve)} frames, {self._describe()})"

    @classmethod
    def from_estimator(
        cls,
        estimator: BaseEstimator,
        X: PerformancesLike,
        *,
        take: int = 0,
        feature: int | str | None = None,
        unit: Unit = "frames",
        frame_rate: float | None = None,
        ax: AxesLike | None = None,
    ) -> Self:
        """Draw the self-correlation and the cuts of a take.

        Parameters
        ----------
        estimator : CycleSegmenter
            Before a fit the self-correlation is drawn without cuts.
        X : takes
            As the estimator takes them.
        take : int, default=0
            The index of the take.
        feature : int or str, default=None
            A compared feature, by index or name. By default the curve that defines the beginning
            of a cycle: the distance of a foot ahead of the pelvis in leg lengths, or a feature.
        unit : {"frames", "percent", "seconds"}, default="frames"
            The unit of time; ``"percent"`` is of the take.
        frame_rate : float, default=None
            Frames a second, for seconds; by default what tables tell, as in `Match.to_frame`.
        ax : Axes, or two of them, default=None
            A subplot to be divided, or one axes a panel. None makes a figure.

        Returns
        -------
        CycleDisplay
            The display, drawn.

        Raises
        ------
        ValueError
            If there is no such take or feature, or the takes break the contract.
        """
        if not isinstance(estimator, CycleSegmenter):
            raise ValueError(f"Give a CycleSegmenter, got {type(estimator).__name__}.")
        fitted = hasattr(estimator, "template_")
        segmenter = CycleSegmenter(**estimator.get_params()).set_params(not_cyclic="skip")
        recordings, takes = check_takes(segmenter, X, reset=True)
        i = as_index(take, len(takes), "take")
        (x,), (repeats,) = correlate_takes(segmenter, recordings[i : i + 1], takes[i : i + 1])
        longest = (as_learnt(estimator, x, repeats) if fitted else repeats).correlation
        row = segmenter.report(recordings[i : i + 1]).iloc[0]
        learnt = estimator if fitted else None
        name, curve = _curve_of(segmenter, learnt, recordings[i], x, feature)
        cuts, n_cycles = np.array([], dtype=int), None
        if fitted and row["cyclic"]:
            _, origin = estimator.segment(recordings[i : i + 1])
            whole = origin[origin["complete"]]
            cuts, n_cycles = np.unique([whole["start"], whole["stop"] - 1]), len(whole)
        period = longest.period if row["period"] > 0 else None
        display = cls(
            longest.correlation,
            longest.peaks,
            curve,
            cuts,
            stretches=row["stretches"],
            n_cycles=n_cycles,
            threshold=float(required_strength(np.inf, longest.breadth, segmenter.threshold)),
            period=period,
            name=name,
            reason=row["reason"],
        )
        return display.plot(ax, unit=unit, frame_rate=rates_of([recordings[i]], frame_rate, unit))

    def plot(
        self, ax: AxesLike | None = None, *, unit: Unit = "frames", frame_rate: float | None = None
    ) -> Self:
        """Draw.

        Parameters
        ----------
        ax : Axes, or two of them, default=None
            A subplot to be divided, or one axes a panel. None makes a figure.
        unit : {"frames", "percent", "seconds"}, default="frames"
            The unit of time; ``"percent"`` is of the take.
        frame_rate : float, default=None
            Frames a second, for seconds.

        Returns
        -------
        CycleDisplay
            The display itself.
        """
        axis = TimeAxis(unit, len(self.curve), [len(self.curve)], frame_rate)
        (times,) = axis.performances()
        self.figure_, self.axes_ = panels(ax, [0, 1], 2, 1, (WIDTH, 4.8))
        upper, lower = self.axes_
        lags = times[: len(self.correlation)]
        blue, black, orange = (COLORS[k] for k in ("performance", "pattern", "mean"))
        (self.correlation_,) = upper.plot(lags, self.correlation, color=blue)
        at, values = lags[self.peaks], self.correlation[self.peaks]
        (self.peaks_,) = upper.plot(at, values, "o", color=blue, fillstyle="none", label="peaks")
        # The threshold is higher at lags of which a stretch holds less than two.
        longest = max((stop - start for start, stop in self.stretches), default=len(self.curve))
        cycles = longest / np.arange(1, len(lags))
        asked = required_strength(cycles, np.inf, self.threshold)
        (self.threshold_,) = upper.plot(
            lags[1:], asked, color="0.4", linestyle="--", linewidth=1, label="threshold"
        )
        self.period_ = None
        if self.period is not None:
            period = np.interp(self.period, np.arange(len(lags)), lags)
            self.period_ = upper.axvline(period, color=orange, linewidth=1, label="period")
        upper.set_xlim(0, times[longest - 1])
        upper.set_ylim(min(-0.5, self.correlation.min() - 0.05), 1.05)
        upper.set_xlabel(f"lag ({UNITS[unit]})")
        upper.set_ylabel("self-correlation")
        upper.set_title(self._describe(), fontsize="medium")
        (self.curve_,) = lower.plot(times, self.curve, color=blue)
        self.stretches_ = [
            lower.axvspan(times[start], times[stop - 1], color=orange, alpha=0.15, linewidth=0)
            for start, stop in self.stretches
        ]
        handles, labels = upper.get_legend_handles_labels()
        if self.stretches_:
            handles, labels = [*handles, self.stretches_[0]], [*labels, "repeats"]
        legend_above([upper], handles, labels)
        self.cuts_ = lower.vlines(
            times[self.cuts], 0, 1, transform=lower.get_xaxis_transform(), color=black, linewidth=1
        )
        lower.set_xlim(0, times[-1])
        lower.set_xlabel(axis.performance_label.replace("trial", "take"))
        lower.set_ylabel(self.name)
        return self

    def _describe(self):
        n = self.n_cycles
        cut = f"{n} whole cycle{'s' * (n != 1)}" if len(self.cuts) else ""
        period = "" if self.period is None else f"period {self.period:.1f} frames"
        several = f"{len(self.stretches)} stretches" if len(self.stretches) > 1 else ""
        return ", ".join(filter(None, [self.reason, several, period, cut])) or "no period"


def _curve_of(segmenter, fitted, take, x, feature):
    """The name and the values of the curve of a take."""
    names = compared_names(segmenter)
    if feature is None:
        start = segmenter.start if fitted is None else fitted.start_
        curves = start_curves(segmenter.set_params(start=start), [take], [x])
        if curves is not None:
            name, (curve,) = next(iter(curves.items()))
            is_foot = segmenter.skeleton is not None and name in SIDES
            return f"{name} ankle ahead (legs)" if is_foot else name, curve
    (k,) = choose_features([0 if feature is None else feature], names)
    return names[k], x[:, k]
