"""Key-frames of a performance: where its path bends most (Figs. 1c and 3c)."""

import numpy as np

from .filters import SMOOTHING, smooth
from .units import Unit

__all__ = ["curvature_keyframes", "match_keyframes"]

# Weight of the distance in time, which only decides between postures that are equally close.
_TIE = 1e-9


def curvature_keyframes(on_clock, count):
    """The frames of maximum curvature of one performance, in order of time.

    Frames closer than a third of their mean distance to one already chosen, or to an end, are
    passed over while there are others.

    Parameters
    ----------
    on_clock : ndarray, shape (P, n_features)
    count : int

    Returns
    -------
    ndarray, shape (min(count, P - 2),)
    """
    n_frames = len(on_clock)
    count = min(count, n_frames - 2)
    order = 1 + np.argsort(-_curvature(on_clock)[1:-1], kind="stable")
    gap = n_frames / (count + 1) / 3
    chosen = []
    for near in (gap, 0):
        for frame in order:
            taken = [0, n_frames - 1, *chosen]
            if len(chosen) < count and min(abs(frame - other) for other in taken) > near:
                chosen.append(int(frame))
    return np.sort(np.array(chosen, dtype=np.float64))


def match_keyframes(pattern, keyframes, on_clock):
    """The frames of a performance that show the key-frames of the pattern.

    Among the frames where its own curvature peaks, and those that would be its key-frames, the ones
    in the same order whose postures are closest in sum, found by dynamic programming. Of postures
    that are equally close those at the time of the pattern's: so the pattern matches itself.

    Parameters
    ----------
    pattern : ndarray, shape (P, n_features)
    keyframes : ndarray, shape (n_keyframes,)
    on_clock : ndarray, shape (P, n_features)

    Returns
    -------
    ndarray, shape (n_keyframes,)
    """
    n_frames = len(on_clock)
    curvature = _curvature(on_clock)
    inner = curvature[1:-1]
    peaks = 1 + np.flatnonzero((inner >= curvature[:-2]) & (inner > curvature[2:]))
    own = curvature_keyframes(on_clock, len(keyframes)).astype(np.intp)
    peaks = np.union1d(peaks, own)
    unit = Unit.of(pattern[np.newaxis])
    wanted, shown = unit(pattern[keyframes.astype(np.intp)]), unit(on_clock[peaks])
    costs = np.square(wanted[:, np.newaxis] - shown).sum(axis=2, dtype=np.float64)
    costs += _TIE * np.square((keyframes[:, np.newaxis] - peaks) / n_frames)
    best, choices = np.zeros(len(peaks)), []
    for cost in costs:
        # best[j]: the key-frames so far, all of them before peak j.
        total = best + cost
        choices.append(np.concatenate([[-1], _running_argmin(total)]))
        best = np.concatenate([[np.inf], np.minimum.accumulate(total)[:-1]])
    found, end = [], len(peaks)
    for choice in choices[::-1]:
        end = choice[end]
        found.append(peaks[end])
    return np.array(found[::-1], dtype=np.float64)


def _running_argmin(values):
    """Index of the first smallest value up to each position."""
    smallest = np.minimum.accumulate(values)
    is_new = np.concatenate([[True], smallest[1:] < smallest[:-1]])
    return np.maximum.accumulate(np.where(is_new, np.arange(len(values)), 0))


def _curvature(on_clock):
    """``sqrt(|v|^2 |a|^2 - (v.a)^2) / |v|^3`` of the path, damped where the movement rests."""
    sigma = SMOOTHING * (len(on_clock) - 1)
    on_clock = on_clock[np.newaxis]
    scaled = Unit.of(on_clock)(on_clock)
    v, a = (smooth(scaled, sigma, order)[0].astype(np.float64) for order in (1, 2))
    vv, aa, va = np.square(v).sum(1), np.square(a).sum(1), (v * a).sum(1)
    rest = 0.1 * vv.mean()
    if rest == 0:
        # What never moves bends nowhere.
        return np.zeros_like(vv)
    return np.sqrt(np.maximum(vv * aa - va**2, 0)) / (vv + rest) ** 1.5
