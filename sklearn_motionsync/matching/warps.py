"""Warps: sequences sampled along them (Eqs. 7 and 18), and warps evaluated at other times."""

import itertools
import math

import numpy as np

from .sizes import BATCH


def normalise(arrays, n_frames, subframes=1):
    """Linear time normalisation of sequences to a common number of frames (Eq. 7).

    Parameters
    ----------
    arrays : sequence of ndarray (n_frames_i, n_features)
    n_frames : int
        ``P``, frames of the clock.
    subframes : int, default=1
        Positions a frame.

    Returns
    -------
    ndarray, shape (n_sequences, (P - 1) * subframes + 1, n_features)
    """
    arrays = list(arrays)
    if subframes == 1 and {len(x) for x in arrays} == {n_frames}:
        return np.concatenate(arrays).reshape(len(arrays), n_frames, -1)
    times = np.arange((n_frames - 1) * subframes + 1) / subframes
    return sample(arrays, np.broadcast_to(times, (len(arrays), len(times))), n_frames)


def sample(arrays, times, n_frames):
    """Linear interpolation of sequences at times on a clock of ``n_frames``.

    Parameters
    ----------
    arrays : sequence of ndarray (n_frames_i, n_features), or 3-D ndarray
        Their first and last frames are those of the clock. NaN and inf affect only the times
        between frames next to them.
    times : ndarray, shape (n_sequences, n_times)
        From 0 to ``n_frames - 1``.
    n_frames : int

    Returns
    -------
    ndarray, shape (n_sequences, n_times, n_features)
    """
    is_one = isinstance(arrays, np.ndarray)
    arrays = arrays if is_one else list(arrays)
    out = np.empty((len(arrays), times.shape[1], arrays[0].shape[1]), dtype=arrays[0].dtype)
    for start in range(0, len(arrays), BATCH):
        rows = slice(start, start + BATCH)
        batch, target = arrays[rows], out[rows]
        last = np.array([len(x) for x in batch])[:, np.newaxis] - 1
        # In this order a whole number of frames stays whole.
        at = times[rows] * last / (n_frames - 1)
        before = np.minimum(at.astype(np.intp), last - 1)
        weight = (at - before).astype(out.dtype)[:, :, np.newaxis]
        frames = batch.reshape(-1, batch.shape[2]) if is_one else np.concatenate(batch)
        before += np.cumsum(last + 1)[:, np.newaxis] - (last + 1)
        with np.errstate(over="ignore", invalid="ignore"):
            has_gaps = not np.isfinite(frames.sum())
            # Indices are valid; mode="clip" only spares NumPy a copy of the result.
            frames.take(before, axis=0, out=target, mode="clip")
            target *= 1 - weight
            before += 1
            following = frames.take(before, axis=0)
            following *= weight
            target += following
        if has_gaps:
            # Where a time is a whole frame, its neighbour must not count: 0 * inf is NaN.
            for at, is_exact in ((before - 1, weight == 0), (before, weight == 1)):
                np.copyto(target, frames.take(at, axis=0), where=is_exact)
    return out


def even_slices(n, size):
    """Slices that cover ``n`` items: as few as possible of at most ``size``, of even sizes."""
    count = -(-n // size)
    edges = [i * n // count for i in range(count + 1)] if count else []
    return [slice(start, stop) for start, stop in itertools.pairwise(edges)]


def evaluate_warps(warps, times):
    """Piecewise-linear warps ``(..., P)`` at times ``(..., P')`` in frames.

    Both have the same number of axes; all axes of the times but the last may be broadcast.
    """
    *leading, n_frames = warps.shape
    before = np.clip(times.astype(np.intp), 0, n_frames - 2)
    weight = (times - before).astype(warps.dtype, copy=False)
    flat = np.ascontiguousarray(warps).reshape(-1)
    at = before + n_frames * np.arange(math.prod(leading)).reshape((*leading, 1))
    out = flat.take(at) * (1 - weight)
    at += 1
    out += flat.take(at) * weight
    return out


def at_times(sequence, times):
    """Linear interpolation of one sequence at times in frames; constant beyond its ends.

    Parameters
    ----------
    sequence : ndarray, shape (n_frames, ...)
    times : ndarray, any shape

    Returns
    -------
    ndarray, shape (*times.shape, ...)
        In double precision.
    """
    times = np.clip(times, 0, len(sequence) - 1)
    before = np.minimum(times.astype(np.intp), len(sequence) - 2)
    weight = (times - before).reshape(*times.shape, *(1,) * (sequence.ndim - 1))
    return sequence[before] * (1 - weight) + sequence[before + 1] * weight
