"""How well trials are synchronised: timing errors, where the truth is known.

Warps are the ``times`` of a `Match`: tau(p), shape (n_sequences, P), from 0 to P - 1, in frames of
the common clock. They may decrease.
"""

from __future__ import annotations

import numpy as np
import pandas as pd

from ..inputs.numbers import as_numbers, as_warps
from ..inputs.recorded import refuse_seconds
from ..inputs.types import Indexed, NumbersLike, ValuesLike
from ..inputs.wording import counted
from ..matching.counting import ROUNDING
from ..matching.warps import evaluate_warps


def group_timing_error(
    times: NumbersLike,
    moments: Indexed[ValuesLike],
) -> float:
    """Mean absolute difference of the moments that a group shows at the same frame of the clock.

    With ``phi_m`` the true share of the action that is completed at each frame of trial m:
    ``(P-1) mean_{m,p} |phi_m(tau_m(p)) - mean_m phi_m(tau_m(p))|``. It needs no pattern. It is 0 if
    and only if all trials show the same moment at every frame; of one trial alone it
    is 0.

    Parameters
    ----------
    times : array-like, shape (n_sequences, P)
        Warps, from 0 to P - 1.
    moments : list of array-like (n_frames_i,)
        ``phi``, from 0 to 1 and never decreasing, at the trials' own frames, such as
        ``make_bending().times``.

    Returns
    -------
    float
        The error in frames of the clock.

    Raises
    ------
    ValueError
        If times are not all from 0 to P - 1, the numbers of warps and of moments differ, or
        moments are no shares of an action.

    Examples
    --------
    >>> from sklearn_motionsync.metrics import group_timing_error
    >>> group_timing_error([[0, 1, 2], [0, 1, 2]], [[0, 0.5, 1], [0, 0.7, 1]])
    0.0666...
    """
    times = as_warps(times)
    rows = _as_rows(moments, "moments")
    if len(rows) != len(times) or not rows:
        raise ValueError(
            f"Got {counted(len(times), 'warp')} and {counted(len(rows), 'set')} of moments."
        )
    last, shown = times.shape[1] - 1, np.empty(times.shape)
    for i, (tau, phi) in enumerate(zip(times, rows, strict=True)):
        is_one_a_frame = phi.ndim == 1 and len(phi) >= 2
        if not (is_one_a_frame and _is_inside(phi, 1).all() and np.diff(phi).min() >= -ROUNDING):
            raise ValueError(
                f"Trial {i}: moments must be shares of the action, one a frame of the trial and at "
                f"least 2, from 0 to 1, and must not decrease; got {phi.tolist()!r:.200}. For "
                "seconds give (t - t[0]) / (t[-1] - t[0])."
            )
        moments_of_frames = np.clip(phi, 0, 1)
        shown[i] = np.interp(tau * (len(phi) - 1) / last, np.arange(len(phi)), moments_of_frames)
    return float(last * np.abs(shown - shown.mean(axis=0)).mean())


def keyframe_error(
    times: NumbersLike,
    keyframes: NumbersLike,
    pattern_keyframes: ValuesLike,
    n_frames: ValuesLike,
) -> float:
    """Mean absolute difference between matched and true key-frames.

    ``mean_{m,k} |tau_m(k_n) - k_m|``, with all key-frames on the clock: frame f of F is
    ``f (P-1) / (F-1)``.

    Parameters
    ----------
    times : array-like, shape (n_sequences, P)
        Warps, from 0 to P - 1.
    keyframes : array-like, shape (n_sequences, n_keyframes)
        True key-frames, in the trials' own frames, from 0 to ``n_frames_i - 1``, increasing.
    pattern_keyframes : array-like, shape (n_keyframes,)
        Those of the pattern, in frames of the clock, from 0 to ``P - 1``, increasing.
    n_frames : array-like of int, shape (n_sequences,)
        Lengths of the trials, at least 2.

    Returns
    -------
    float
        The error in frames of the clock.

    Raises
    ------
    ValueError
        If the numbers of warps, key-frames and lengths differ, or a key-frame is outside its trial.

    Examples
    --------
    >>> from sklearn_motionsync.metrics import keyframe_error
    >>> keyframe_error([[0, 1, 2, 3, 4]], [[5]], [2], [9])
    0.5
    """
    times = as_warps(times)
    n_sequences, P = times.shape
    lengths = as_numbers(n_frames, "n_frames", dtype=np.float64)
    valid = (lengths >= 2) & (lengths == np.floor(lengths)) & np.isfinite(lengths)
    if lengths.shape != (n_sequences,) or not (n_sequences and valid.all()):
        raise ValueError(
            f"n_frames must be the lengths of the {counted(n_sequences, 'trial')}, such as "
            f"[len(x) for x in X], whole numbers of at least 2; got {lengths.tolist()!r:.200}, "
            f"wrong for the trials {np.flatnonzero(~valid).tolist()}."
        )
    pattern = as_numbers(pattern_keyframes, "pattern_keyframes", dtype=np.float64)
    rows = _as_rows(keyframes, "keyframes")
    shapes = [row.shape for row in rows]
    if pattern.ndim != 1 or len(pattern) < 1 or shapes != [pattern.shape] * n_sequences:
        raise ValueError(
            "pattern_keyframes must have shape (n_keyframes,), with at least one, and keyframes "
            f"as many numbers for each of the {counted(n_sequences, 'warp')}; got the shapes "
            f"{pattern.shape} and {shapes}."
        )
    pattern = _in_order(pattern, P - 1, "The pattern", "frames of the clock")
    frames = []
    for i, (row, length) in enumerate(zip(rows, lengths, strict=True)):
        refuse_seconds(row, int(length), f"Trial {i}")
        frames.append(_in_order(row, length - 1, f"Trial {i}", "its own frames"))
    frames_per_step = (lengths[:, np.newaxis] - 1) / (P - 1)
    matched = evaluate_warps(times, np.tile(pattern, (n_sequences, 1)))
    return float(np.abs(matched - np.stack(frames) / frames_per_step).mean())


# -- checks of arguments ------------------------------------------------------------------


def _in_order(frames, last, whose, unit):
    """Key-frames of one trial, if they are inside it and increase."""
    if not (_is_inside(frames, last).all() and (np.diff(frames) > 0).all()):
        raise ValueError(
            f"{whose}: key-frames must increase and be from 0 to {last:.10g}, in {unit}, got "
            f"{frames.tolist()}."
        )
    return np.clip(frames, 0, last)


def _as_rows(values, what):
    """The entries of a list or the rows of a table as arrays, one a trial."""
    if isinstance(values, pd.DataFrame):
        values = as_numbers(values, what)
    if isinstance(values, (str, bytes, dict)) or not np.iterable(values):
        raise ValueError(
            f"{what} must be a list of arrays, one a trial, got {type(values).__name__}."
        )
    return [as_numbers(row, f"Trial {i}: {what}", dtype=np.float64) for i, row in enumerate(values)]


def _is_inside(array, last):
    # False for NaN.
    return (array >= -ROUNDING) & (array <= last + ROUNDING)
