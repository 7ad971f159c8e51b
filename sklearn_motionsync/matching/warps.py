"""Warps: sequences sampled along them (Eqs. 7 and 18), and warps read at other times."""

import itertools
import math

import numpy as np

__all__ = ["at_times", "even_slices", "follow", "normalise", "sample"]

# Sequences sampled together: bounds the memory of what stands in between.
_SAMPLED_AT_ONCE = 64


def normalise(arrays, n_frames, subframes=1):
    """Linear normalisation (Eq. 7): every sequence at the same times of its course.

    Parameters
    ----------
    arrays : list of ndarray (n_frames_i, n_features)
    n_frames : int
        ``P``, frames of the clock.
    subframes : int, default=1
        Positions a frame.

    Returns
    -------
    ndarray, shape (n_sequences, (P - 1) * subframes + 1, n_features)
    """
    if subframes == 1 and all(len(x) == n_frames for x in arrays):
        return np.concatenate(arrays).reshape(len(arrays), n_frames, -1)
    times = np.arange((n_frames - 1) * subframes + 1) / subframes
    return sample(arrays, np.broadcast_to(times, (len(arrays), len(times))), n_frames)


def sample(arrays, times, n_frames):
    """Sequences at times on a clock of ``n_frames``, the first and last frame being theirs too.

    Parameters
    ----------
    arrays : list of ndarray (n_frames_i, n_features), or 3-D ndarray
    times : ndarray, shape (n_sequences, n_times)
        From 0 to ``n_frames - 1``.
    n_frames : int

    Returns
    -------
    ndarray, shape (n_sequences, n_times, n_features)
    """
    out = np.empty((len(arrays), times.shape[1], arrays[0].shape[1]), dtype=arrays[0].dtype)
    for rows in even_slices(len(arrays), _SAMPLED_AT_ONCE):
        _sample(arrays[rows], times[rows], n_frames, out[rows])
    return out


def _sample(arrays, times, n_frames, out):
    last = np.array([len(x) for x in arrays])[:, np.newaxis] - 1
    # In this order a whole number of frames stays whole.
    at = times * last / (n_frames - 1)
    left = np.minimum(at.astype(np.intp), last - 1)
    weight = (at - left).astype(out.dtype)[:, :, np.newaxis]
    is_one = isinstance(arrays, np.ndarray)
    frames = arrays.reshape(-1, arrays.shape[2]) if is_one else np.concatenate(arrays)
    left += np.cumsum(last + 1)[:, np.newaxis] - (last + 1)
    with np.errstate(over="ignore", invalid="ignore"):
        has_gaps = not np.isfinite(frames.sum())
        # All are there; looking twice whether they are takes a copy.
        frames.take(left, axis=0, out=out, mode="clip")
        out *= 1 - weight
        left += 1
        following = frames.take(left, axis=0)
        following *= weight
        out += following
    if has_gaps:
        # Where a frame is met its neighbours have no say: nothing times infinity is no number.
        for at, met in ((left - 1, weight == 0), (left, weight == 1)):
            np.copyto(out, frames.take(at, axis=0), where=met)


def even_slices(n, size):
    """Slices that cover ``n`` items: as few as can be of at most ``size``, of even sizes."""
    count = -(-n // size)
    edges = [i * n // count for i in range(count + 1)] if count else []
    return [slice(start, stop) for start, stop in itertools.pairwise(edges)]


def follow(warps, times):
    """Piecewise-linear warps ``(..., P)`` read at times ``(..., P')`` in frames.

    Both have as many axes; along all but the last the times are as many, or one for all.
    """
    *shape, n_frames = warps.shape
    left = np.clip(times.astype(np.intp), 0, n_frames - 2)
    weight = (times - left).astype(warps.dtype, copy=False)
    flat = np.ascontiguousarray(warps).reshape(-1)
    at = left + n_frames * np.arange(math.prod(shape)).reshape(*shape, 1)
    out = flat.take(at) * (1 - weight)
    at += 1
    out += flat.take(at) * weight
    return out


def at_times(sequence, times):
    """A sequence at times in frames, on straight lines; beyond its ends it holds.

    Parameters
    ----------
    sequence : ndarray, shape (n_frames, n_features)
    times : ndarray, any shape

    Returns
    -------
    ndarray, shape (*times.shape, n_features)
        In double precision.
    """
    times = np.clip(times, 0, len(sequence) - 1)
    left = np.minimum(times.astype(np.intp), len(sequence) - 2)
    weight = (times - left)[..., np.newaxis]
    return sequence[left] * (1 - weight) + sequence[left + 1] * weight
