"""Key-frames in figures: lines on the clock of the pattern, and ticks of each performance."""

import numpy as np
import pandas as pd

from ..inputs.keyframes import Keyframes
from ..inputs.numbers import as_numbers
from ..utils.pipelines import find_synchronizer

__all__ = [
    "check_own_keyframes",
    "check_pattern_keyframes",
    "draw_keyframes",
    "draw_own_keyframes",
    "keyframes_of_estimator",
    "named_keyframes",
    "own_keyframes",
    "text_of_keyframe",
]

# The height of ticks, as a share of the panel.
_TICK = 0.05


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
