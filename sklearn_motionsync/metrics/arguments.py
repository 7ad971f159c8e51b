"""What measures take: every argument of every measure is checked here, and nowhere else."""

from typing import NamedTuple

import numpy as np
import pandas as pd

from ..inputs.collections import as_collection
from ..inputs.numbers import as_numbers, check_finite

__all__ = [
    "Movements",
    "as_frame_rates",
    "as_keyframes",
    "as_lengths",
    "as_moments",
    "as_movements",
    "as_quantile",
    "as_times",
    "check_same_shape",
]

# Bounds may be missed by as much, in frames: whoever made the warps has rounded.
_ROUNDING = 1e-9


class Movements(NamedTuple):
    """Movements on one clock, in units of a power of two in which the largest value is near 1.

    Attributes
    ----------
    values : ndarray, shape (n_sequences, P, n_features)
        Of magnitude 1 or less: their squares are neither too large nor too small.
    exponent : int
        They were given as ``values * 2**exponent``.
    rounding : float
        What does not differ by more is the same.
    """

    values: np.ndarray
    exponent: int
    rounding: float


def as_times(times, what="times"):
    """Warps, shape (n_sequences >= 1, P >= 2), from 0 to P - 1; they may step back."""
    times = _as_double(times, what)
    if times.ndim != 2 or times.shape[0] < 1 or times.shape[1] < 2:
        raise ValueError(
            f"{what} must have shape (n_sequences, P), one row a performance and P at least 2, "
            f"got {times.shape}."
        )
    last = times.shape[1] - 1
    sound = _inside(times, last)
    if not sound.all():
        i, p = np.argwhere(~sound)[0]
        raise ValueError(
            f"Performance {i}: {what} must be from 0 to P - 1 = {last}, in frames of the clock, "
            f"got {times[i, p]:.10g} at frame {p}."
        )
    return np.clip(times, 0, last)


def as_moments(moments, n_sequences):
    """Shares of the action that are over, one array (n_frames_i >= 2,) a warp, from 0 to 1."""
    rows = _as_rows(moments, "moments")
    if len(rows) != n_sequences:
        raise ValueError(f"There are {n_sequences} warps and {len(rows)} sets of moments.")
    out = []
    for i, row in enumerate(rows):
        phi = _as_double(row, f"Performance {i}: moments")
        if phi.ndim != 1 or len(phi) < 2:
            raise ValueError(
                f"Performance {i}: moments must have shape (n_frames,), one a frame of the "
                f"performance and at least 2, got {phi.shape}."
            )
        if not _inside(phi, 1).all():
            p = int(np.argmin(_inside(phi, 1)))
            raise ValueError(
                f"Performance {i}: moments are shares of the action, from 0 to 1, got {phi[p]:.10g}"
                f" at frame {p}. For seconds give (t - t[0]) / (t[-1] - t[0])."
            )
        back = np.diff(phi) < -_ROUNDING
        if back.any():
            raise ValueError(
                f"Performance {i}: moments must not decrease, since what is over stays over; they "
                f"do after frame {int(np.argmax(back))}."
            )
        out.append(np.clip(phi, 0, 1))
    return out


def as_lengths(n_frames, n_sequences):
    """Lengths of clips as float numbers, whole ones of at least 2, one a warp."""
    lengths = _as_double(n_frames, "n_frames")
    if lengths.shape != (n_sequences,):
        raise ValueError(
            f"n_frames must hold the lengths of the {n_sequences} performances, such as "
            f"[len(x) for x in X], which do not go with shape {lengths.shape}."
        )
    sound = (lengths >= 2) & (lengths == np.floor(lengths)) & np.isfinite(lengths)
    if not sound.all():
        i = int(np.argmin(sound))
        raise ValueError(
            f"Performance {i}: n_frames must be a whole number of at least 2, got "
            f"{lengths[i]:.10g}."
        )
    return lengths


def as_keyframes(keyframes, pattern_keyframes, lengths, n_frames):
    """Key-frames of performances and of the pattern: increasing, and inside the clips.

    Parameters
    ----------
    keyframes : array-like, shape (n_sequences, n_keyframes)
    pattern_keyframes : array-like, shape (n_keyframes,)
    lengths : ndarray, shape (n_sequences,)
    n_frames : int
        Of the clock.

    Returns
    -------
    keyframes : ndarray, shape (n_sequences, n_keyframes)
    pattern_keyframes : ndarray, shape (n_keyframes,)
    """
    pattern = _as_double(pattern_keyframes, "pattern_keyframes")
    if pattern.ndim != 1 or len(pattern) < 1:
        raise ValueError(
            "pattern_keyframes must have shape (n_keyframes,), with at least one, got "
            f"{pattern.shape}."
        )
    rows = [
        _as_double(row, f"Performance {i}: keyframes")
        for i, row in enumerate(_as_rows(keyframes, "keyframes"))
    ]
    shapes = [row.shape for row in rows]
    if shapes != [pattern.shape] * len(lengths):
        odd = next((i for i, shape in enumerate(shapes) if shape != pattern.shape), None)
        which = "" if odd is None else f", of which performance {odd} has shape {shapes[odd]}"
        raise ValueError(
            f"{len(lengths)} warps and {len(pattern)} key-frames of the pattern do not go with "
            f"keyframes of {len(rows)} performances{which}."
        )
    pattern = _in_order(pattern, n_frames - 1, "The pattern", "frames of the clock")
    frames = [
        _in_order(row, length - 1, f"Performance {i}", "its own frames")
        for i, (row, length) in enumerate(zip(rows, lengths, strict=True))
    ]
    return np.stack(frames), pattern


def as_frame_rates(frame_rate, n_sequences):
    """Frames a second, one number or a column of one a performance."""
    rate = _as_double(frame_rate, "frame_rate")
    sound = (rate > 0) & np.isfinite(rate)
    if rate.shape not in ((), (n_sequences,)) or not sound.all():
        which = f" for performance {int(np.argmin(sound))}" if rate.ndim and rate.size else ""
        raise ValueError(
            "frame_rate must be one number above 0, in frames a second, or one for each of the "
            f"{n_sequences} performances, got {frame_rate!r}: wrong{which}."
        )
    return rate[..., np.newaxis]


def as_quantile(quantile):
    """A number from 0 to 1; None stays."""
    if quantile is None:
        return None
    number = _as_double(quantile, "quantile")
    if number.ndim != 0 or not 0 <= number <= 1:
        raise ValueError(f"quantile must be a number from 0 to 1, or None, got {quantile!r}.")
    return float(number)


def as_movements(before, after):
    """The same movements before and after, on one clock, each in a unit of its own."""
    pair = [_on_clock(z, what) for z, what in ((before, "before"), (after, "after"))]
    shape = pair[0].shape
    sound = len(shape) == 3 and shape[0] >= 2 and shape[1] >= 2 and shape[2] >= 1
    if not sound or pair[1].shape != shape:
        raise ValueError(
            "before and after must have one shape (n_sequences, P, n_features), of at least 2 "
            f"sequences, 2 frames and 1 feature; got {shape} and {pair[1].shape}. Give univariate "
            "ones as x[:, :, np.newaxis]."
        )
    for z, what in zip(pair, ("before", "after"), strict=True):
        for i, x in enumerate(z):
            check_finite(x, f"{what}, performance {i}, frame")
    return tuple(map(_in_own_unit, pair))


def check_same_shape(times, others, what):
    if times.shape != others.shape:
        raise ValueError(f"times {times.shape} and {what} {others.shape} differ in shape.")


# -- helpers ------------------------------------------------------------------------------


def _as_double(values, what):
    return as_numbers(values, what, dtype=np.float64)


def _as_rows(values, what):
    """The entries of a list, the rows of a table: one a performance."""
    if isinstance(values, pd.DataFrame):
        values = as_numbers(values, what)
    if isinstance(values, (str, bytes, dict)) or not np.iterable(values):
        raise ValueError(
            f"{what} must be a list of arrays, one a performance, got {type(values).__name__}."
        )
    return list(values)


def _inside(array, last):
    # NaN fails the comparison, too.
    return (array >= -_ROUNDING) & (array <= last + _ROUNDING)


def _in_order(frames, last, whose, unit):
    """Key-frames of one clip, if they are inside it and increase."""
    sound = _inside(frames, last).all() and (np.diff(frames) > 0).all()
    if not sound:
        raise ValueError(
            f"{whose}: key-frames must increase and be from 0 to {last:.10g}, in {unit}, got "
            f"{frames.tolist()}."
        )
    return np.clip(frames, 0, last)


def _on_clock(values, what):
    """An array of whatever holds performances on one clock."""
    if isinstance(values, pd.DataFrame) and values.index.nlevels >= 2:
        values = as_collection(values)
    if isinstance(values, np.ndarray) and values.dtype == object and values.ndim == 1:
        values = list(values)
    if isinstance(values, (list, tuple)):
        shapes = [np.shape(x) for x in values if hasattr(x, "shape")]
        if len(set(shapes)) > 1:
            raise ValueError(
                f"{what} must be performances on one clock, all of one shape (P, n_features), got "
                f"{shapes[0]} and {next(s for s in shapes if s != shapes[0])}: give those that "
                "transform or normalize return."
            )
    return as_numbers(values, what)


def _in_own_unit(array):
    exact = np.finfo(np.float64).eps
    rounding = 4 * (np.finfo(array.dtype).eps + len(array) * exact)
    values = array.astype(np.float64)
    exponent = int(np.frexp(np.abs(values).max(initial=0))[1])
    return Movements(np.ldexp(values, -exponent), exponent, rounding)
