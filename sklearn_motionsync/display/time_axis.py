"""Time axes of performances and of the clock, and the key-frames on them."""

import numpy as np
import pandas as pd

from ..inputs.keyframes import Keyframes
from ..inputs.numbers import as_numbers
from ..inputs.resampling import as_frame_rates
from ..synchronizers.match import UNITS, check_unit
from ..utils.pipelines import find_synchronizer

__all__ = [
    "TimeAxis",
    "check_own_keyframes",
    "check_pattern_keyframes",
    "clock_rate",
    "draw_keyframes",
    "draw_own_keyframes",
    "keyframes_of_estimator",
    "named_keyframes",
    "offset_label",
    "own_keyframes",
    "text_of_keyframe",
]

_PERFORMANCE_LABELS = {
    "frames": "frame of the trial",
    "percent": "% of the trial",
    "seconds": "time of the trial (s)",
}
_CLOCK_LABELS = {
    "frames": "frame of the template",
    "percent": "% of the template",
    "seconds": "time of the median trial (s)",
}
# The height of ticks, as a share of the panel.
_TICK = 0.05


class TimeAxis:
    """The times of frames in a unit.

    Parameters
    ----------
    unit : {"frames", "percent", "seconds"}
    n_frames : int
        The length of the clock.
    lengths : sequence of int, default=None
        The number of frames of each performance. None if unknown; ``frame_rate`` is then that of
        the clock.
    frame_rate : float, or array-like of shape (n_sequences,), default=None
        Frames a second, for seconds only.
    label : str, default=None
        In place of the axis labels.

    Attributes
    ----------
    unit : str
    clock : ndarray, shape (P,)
        The times of the frames of the clock. In seconds the clock lasts as long as the median
        performance.
    label, performance_label : str
        Axis labels of the clock and of the performances.
    """

    def __init__(self, unit, n_frames, lengths=None, frame_rate=None, label=None):
        self.unit = check_unit(unit)
        self.label, self.performance_label = _CLOCK_LABELS[unit], _PERFORMANCE_LABELS[unit]
        if label is not None:
            self.label = self.performance_label = label
        self._lengths, self._rates = lengths, None
        clock = np.arange(n_frames)
        self.clock = clock
        if unit == "percent":
            self.clock = 100 * clock / (n_frames - 1)
        if unit == "seconds":
            self._rates = _frame_rates(frame_rate, lengths)
            durations = (np.array(lengths or [n_frames]) - 1) / self._rates
            self.clock = np.median(durations) * clock / (n_frames - 1)

    @classmethod
    def of_clock(cls, unit, clock, label=None):
        """The axis of a clock whose frames have these times, in the unit."""
        return cls(unit, len(clock), None, clock_rate(clock), label)

    def performances(self):
        """The times of the frames of each performance: list of ndarray (n_frames_i,)."""
        return self.own([np.arange(n) for n in self._lengths])

    def own(self, frames):
        """Frames of each performance, whole or not, in the unit: list of ndarray."""
        if self.unit == "percent":
            return [100 * f / (n - 1) for f, n in zip(frames, self._lengths, strict=True)]
        if self.unit == "seconds":
            return [f / rate for f, rate in zip(frames, self._rates, strict=True)]
        return list(frames)

    def convert(self, frames):
        """Frames of the clock, whole or not, in the unit."""
        scale = self.clock[-1] / (len(self.clock) - 1)
        return frames if self.unit == "frames" else frames * scale


def clock_rate(clock):
    """Frames of the clock in a unit of time, such as a second."""
    return (len(clock) - 1) / clock[-1]


def offset_label(unit):
    """The label of an axis of offsets."""
    return f"offset ({UNITS[unit]}),\nlater is above"


def _frame_rates(frame_rate, lengths):
    """A frame rate for each performance; one for the clock without performances."""
    count = 1 if lengths is None else len(lengths)
    if frame_rate is None:
        raise ValueError("unit='seconds' needs frame_rate, frames a second of the performances.")
    return np.broadcast_to(as_frame_rates(frame_rate, count), (count, 1))[:, 0]


# -- key-frames: lines on the clock, and ticks of each performance ---------------------------


def named_keyframes(synchronizer, keyframes):
    """The key-frames of a fitted synchronizer, with the names that a table of them has.

    Parameters
    ----------
    synchronizer : estimator
    keyframes : DataFrame with a column a key-frame, or anything, or None

    Returns
    -------
    Series, indexed by names, or None
        In frames of the clock, None without key-frames. Those without a name are numbered.
    """
    frames = getattr(synchronizer, "keyframes_", None)
    if frames is None:
        return None
    named = isinstance(keyframes, pd.DataFrame) and len(keyframes.columns) == len(frames)
    return pd.Series(frames, index=keyframes.columns if named else None)


def keyframes_of_estimator(estimator, n_frames, keyframes):
    """The same of the synchronizer of a pipeline; None also without one on that many frames."""
    try:
        _, synchronizer = find_synchronizer(estimator)
    except ValueError:
        return None
    same = getattr(synchronizer, "n_frames_", None) == n_frames
    return named_keyframes(synchronizer, keyframes) if same else None


def own_keyframes(synchronizer, performances, params):
    """Key-frames (n_sequences, n_keyframes) of performances, in their frames, None if not given."""
    keyframes, on_clock = params.get("keyframes"), getattr(synchronizer, "keyframes_", None)
    if keyframes is None or on_clock is None:
        return None
    rows = Keyframes(keyframes, len(performances), params.get("frame_rate"))
    last = np.array([[len(x) - 1] for x in performances])
    return rows.shares(performances, len(on_clock)) * last


def check_own_keyframes(keyframes, n_sequences):
    """Key-frames (n_sequences, n_keyframes) of performances; None if none are given."""
    if keyframes is None:
        return None
    keyframes = as_numbers(keyframes, "keyframes", dtype=np.float64)
    if keyframes.ndim != 2 or len(keyframes) != n_sequences:
        raise ValueError(
            f"keyframes must have shape ({n_sequences}, n_keyframes), one row a performance, with "
            f"NaN where one is not known; got {keyframes.shape}."
        )
    return keyframes


def check_pattern_keyframes(keyframes, n_frames):
    """Key-frames on the clock as a Series; None if none are given."""
    if keyframes is None:
        return None
    series = pd.Series(keyframes, dtype=np.float64)
    inside = series.between(0, n_frames - 1) | series.isna()
    if not inside.all():
        raise ValueError(
            f"pattern_keyframes must be frames of the pattern, from 0 to {n_frames - 1}; got "
            f"{series[~inside].iloc[0]:g}."
        )
    return series


def text_of_keyframe(name):
    """The text of a name, or of a pair such as label and context; empty for a number."""
    if isinstance(name, (int, np.integer)):
        return ""
    text = ", ".join(map(str, name)) if isinstance(name, tuple) else str(name)
    return text.replace("$", r"\$")


def draw_keyframes(axis, times, names=(), *, by_diagonal=False):
    """Draw key-frames as vertical lines, with their names beside them.

    Parameters
    ----------
    axis : Axes
    times : array-like, shape (n_keyframes,)
        In the unit of the axis.
    names : sequence, default=()
        Text, or pairs of text; numbers are not drawn.
    by_diagonal : bool, default=False
        Whether curves follow the diagonal, and names stay away from it.

    Returns
    -------
    list of Line2D
    """
    lines = [
        axis.axvline(at, color="0.35", linewidth=0.9, linestyle=(0, (2, 2)), zorder=1.5)
        for at in times
        if np.isfinite(at)
    ]
    middle = np.mean(axis.get_xlim())
    for at, name in zip(times, names, strict=False):
        if not (text := text_of_keyframe(name)) or not np.isfinite(at):
            continue
        at_top = by_diagonal and at < middle
        height = (0.78 if at_top else 0.22) if by_diagonal else 0.04
        axis.annotate(
            text,
            (at, height),
            xycoords=axis.get_xaxis_transform(),
            xytext=(2, 0),
            textcoords="offset points",
            rotation=90,
            va="top" if at_top else "bottom",
            fontsize="small",
            color="0.2",
            zorder=6,
            bbox={"facecolor": "white", "alpha": 0.7, "edgecolor": "none", "pad": 0.5},
        )
    return lines


def draw_own_keyframes(axis, times, colors):
    """Draw the key-frames of performances as ticks along the lower edge.

    Parameters
    ----------
    axis : Axes
    times : list of array-like (n_keyframes,)
        In the unit of the axis; NaN where one is not known.
    colors : color, or list of one a performance

    Returns
    -------
    LineCollection
    """
    from matplotlib.collections import LineCollection

    segments, of_ticks = [], []
    for i, row in enumerate(times):
        places = np.asarray(row)[np.isfinite(row)]
        segments += [[(at, 0), (at, _TICK)] for at in places]
        of_ticks += [colors if isinstance(colors, str) else colors[i]] * len(places)
    transform = axis.get_xaxis_transform()
    ticks = LineCollection(segments, colors=of_ticks, linewidths=1, transform=transform)
    return axis.add_collection(ticks, autolim=False)
