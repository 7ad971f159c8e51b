"""CycleDisplay: the self-correlation of a take, and where it is cut into cycles."""

import numpy as np

from ..body.formats import SIDES
from ..inputs.features import choose_features
from ..inputs.numbers import is_integer
from ..segmentation.cycles import (
    CycleSegmenter,
    check_takes,
    compared_names,
    correlate_takes,
    start_curves,
)
from ..segmentation.self_correlation import required_strength
from .drawing import COLORS, panels
from .given import as_drawn, as_index, is_number
from .time_axis import TimeAxis

__all__ = ["CycleDisplay"]


class CycleDisplay:
    """Whether a take repeats, after which time, and where it is cut.

    Above the self-correlation over the lag: its peaks, the period, and the threshold. Below a curve
    of the take, with its cuts. Use `from_estimator`.

    Parameters
    ----------
    correlation : ndarray, shape (n_lags,)
    peaks : array-like of int
        Lags of its peaks.
    curve : ndarray, shape (n_frames,)
    cuts : array-like of int, default=()
        Frames in which cycles begin and end.
    threshold : float, default=0.4
    period : float, default=None
        Frames of a cycle; None if there is none.
    name, reason : str, default=""
        What the curve shows, and why the take cannot be segmented.

    Attributes
    ----------
    figure_ : Figure
    axes_ : list of Axes
        Of the self-correlation, and of the take.
    correlation_, curve_, peaks_ : Line2D
    threshold_ : Line2D
    period_ : Line2D or None
    cuts_ : LineCollection

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
        self, correlation, peaks, curve, cuts=(), *, threshold=0.4, period=None, name="", reason=""
    ):
        self.correlation = as_drawn(correlation, "The correlation", ("n_lags",))
        self.curve = as_drawn(curve, "The curve", ("n_frames",))
        self.peaks = _indices(peaks, len(self.correlation), "peaks")
        self.cuts = _indices(cuts, len(self.curve), "cuts")
        if not is_number(threshold):
            raise ValueError(f"threshold must be a number, got {threshold!r}.")
        if period is not None and not is_number(period, 0, len(self.correlation) - 1):
            raise ValueError(
                f"period must be a lag from 0 to {len(self.correlation) - 1}, or None if there is "
                f"none; got {period!r}."
            )
        self.threshold, self.period = float(threshold), period
        self.name, self.reason = str(name), str(reason)

    def __repr__(self):
        return f"CycleDisplay({len(self.curve)} frames, {self._describe()})"

    @classmethod
    def from_estimator(
        cls, estimator, X, *, take=0, feature=None, unit="frames", frame_rate=None, ax=None
    ):
        """Draw what a segmenter makes of a take.

        Parameters
        ----------
        estimator : CycleSegmenter
            Without a fit no cuts are drawn, but why there may be none.
        X : takes, as the estimator takes them
        take : int, default=0
            Which of them.
        feature : int or str, default=None
            A feature of what is compared, by index or name. By default the curve that begins a
            cycle: a foot ahead of the pelvis, in leg lengths, or a feature.
        unit : {"frames", "percent", "seconds"}, default="frames"
            The unit of time; ``"percent"`` is of the take.
        frame_rate : float, default=None
            Frames a second, for seconds.
        ax : Axes, or two of them, default=None

        Returns
        -------
        CycleDisplay

        Raises
        ------
        ValueError
            If there is no such take or feature, or the takes break the contract.
        """
        if not isinstance(estimator, CycleSegmenter):
            raise ValueError(f"Give a CycleSegmenter, got {type(estimator).__name__}.")
        fitted = hasattr(estimator, "template_")
        segmenter = CycleSegmenter(**estimator.get_params()).set_params(not_cyclic="skip")
        given, takes = check_takes(segmenter, X, reset=True)
        i = as_index(take, len(takes), "take")
        (x,), (found,) = correlate_takes(given[i : i + 1], takes[i : i + 1], segmenter.skeleton)
        row = segmenter.report(given[i : i + 1]).iloc[0]
        name, curve = _curve_of(segmenter, estimator if fitted else None, given[i], x, feature)
        cuts = np.array([], dtype=int)
        if fitted and row["cyclic"]:
            _, origin = estimator.segment(given[i : i + 1])
            whole = origin[origin["complete"]]
            cuts = np.unique([whole["start"], whole["stop"] - 1])
        period = found.period if row["period"] > 0 else None
        display = cls(
            found.correlation,
            found.peaks,
            curve,
            cuts,
            threshold=float(required_strength(np.inf, found.breadth, segmenter.threshold)),
            period=period,
            name=name,
            reason=row["reason"],
        )
        return display.plot(ax, unit=unit, frame_rate=frame_rate)

    def plot(self, ax=None, *, unit="frames", frame_rate=None):
        """Draw.

        Parameters
        ----------
        ax : Axes, or two of them, default=None
        unit : {"frames", "percent", "seconds"}, default="frames"
        frame_rate : float, default=None

        Returns
        -------
        self
        """
        axis = TimeAxis(unit, len(self.curve), [len(self.curve)], frame_rate)
        (times,), label = axis.own(), axis.label_of_performances.replace("performance", "take")
        self.figure_, self.axes_ = panels(ax, [0, 1], 2, 1, (7, 5))
        upper, lower = self.axes_
        lags = times[: len(self.correlation)]
        blue, black, orange = (COLORS[k] for k in ("performance", "pattern", "mean"))
        (self.correlation_,) = upper.plot(lags, self.correlation, color=blue)
        at, values = lags[self.peaks], self.correlation[self.peaks]
        (self.peaks_,) = upper.plot(at, values, "o", color=blue, fillstyle="none", label="peaks")
        # More is asked of takes of less than two cycles; of narrow movements it is already.
        cycles = len(self.curve) / np.arange(1, len(lags))
        asked = required_strength(cycles, np.inf, self.threshold)
        (self.threshold_,) = upper.plot(
            lags[1:], asked, color="0.4", linestyle="--", linewidth=1, label="threshold"
        )
        self.period_ = None
        if self.period is not None:
            period = np.interp(self.period, np.arange(len(lags)), lags)
            self.period_ = upper.axvline(period, color=orange, linewidth=1, label="period")
        upper.set_xlim(0, times[-1])
        upper.set_ylim(min(-0.5, self.correlation.min() - 0.05), 1.05)
        upper.set_xlabel(
            f"lag ({'%' if unit == 'percent' else 's' if unit == 'seconds' else unit})"
        )
        upper.set_ylabel("self-correlation")
        upper.set_title(self._describe(), fontsize="medium")
        upper.legend(loc="upper right", fontsize="small")
        (self.curve_,) = lower.plot(times, self.curve, color=blue)
        self.cuts_ = lower.vlines(
            times[self.cuts], 0, 1, transform=lower.get_xaxis_transform(), color=black, linewidth=1
        )
        lower.set_xlim(0, times[-1])
        lower.set_xlabel(label)
        lower.set_ylabel(self.name)
        return self

    def _describe(self):
        cycles = max(len(self.cuts) - 1, 0)
        cut = f"{cycles} whole cycle{'s' * (cycles != 1)}" if len(self.cuts) else ""
        found = "" if self.period is None else f"period {self.period:.1f} frames"
        return ", ".join(filter(None, [self.reason, found, cut])) or "no period"


def _indices(indices, count, what):
    listed = list(np.ravel(np.asarray(indices)))
    if not all(is_integer(i) and 0 <= i < count for i in listed):
        raise ValueError(f"{what} must be whole numbers from 0 to {count - 1}, got {listed!r}.")
    return np.array(listed, dtype=int)


def _curve_of(segmenter, fitted, take, x, feature):
    """What is drawn of a take, and what to call it."""
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
