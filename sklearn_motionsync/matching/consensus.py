"""Consensus: warps by way of other performances outvote a path that took a wrong valley."""

import numpy as np

from .filters import smooth
from .warps import even_slices, follow

__all__ = ["choose_exemplars", "smoothed", "vote"]

# How fast the say of a route falls with its length: exp(-1.5) for one of typical length beside
# one without any distance. Measured in docs/method.md.
_FALL = 1.5
# Share of the weight by which rounding may move a half.
_ROUNDING = {np.dtype(np.float64): 2.0**-40, np.dtype(np.float32): 2.0**-18}
# Comparisons that are made at once: they stay in the cache.
_COMPARED = 200_000


def choose_exemplars(global_distances, n_exemplars, pattern_index):
    """Indices of performances to go by: evenly spread over the more typical half.

    Parameters
    ----------
    global_distances : ndarray, shape (n_sequences,)
        ``C_n`` of Eq. 19; typical performances have small ones.
    n_exemplars : int
    pattern_index : int or None
        Never chosen.

    Returns
    -------
    ndarray of int, shape (min(n_exemplars, n_sequences - 1 or n_sequences),)
    """
    order = np.argsort(global_distances, kind="stable")
    order = order[order != pattern_index]
    half = order[: max(n_exemplars, len(order) // 2)]
    count = min(n_exemplars, len(half))
    spread = (np.arange(count) + 0.5) / max(count, 1) * len(half) - 0.5
    return half[np.round(spread).astype(np.intp)]


def vote(direct, to_exemplars, from_exemplars, lengths):
    """The weighted median over all routes from the pattern to each sequence.

    The time p of the pattern n reaches the sequence m straight, as ``tau_nm(p)``, or by way
    of an exemplar k, as ``tau_km(tau_nk(p))``. A route along which performances are alike is right
    more often than a long one, and has more say. The median of non-decreasing warps with pinned
    ends, with weights that are the same at all times, is one itself.

    Parameters
    ----------
    direct : ndarray, shape (n_sequences, P)
        ``tau_nm``.
    to_exemplars : ndarray, shape (n_exemplars, n_sequences or 1, P)
        ``tau_nk``, of every sequence or of all.
    from_exemplars : ndarray, shape (n_exemplars, n_sequences, P)
        ``tau_km``.
    lengths : ndarray, shape (1 + n_exemplars, n_sequences)
        ``D_{n,m}``, and ``D_{n,k} + D_{k,m}`` of every exemplar.

    Returns
    -------
    ndarray, shape (n_sequences, P)
    """
    by_way = follow(from_exemplars, to_exemplars)
    routes = np.concatenate([direct[np.newaxis], by_way])
    # The median; that of NumPy takes as long as following all routes.
    ranked, n = np.sort(lengths, axis=0), len(lengths)
    typical = (ranked[(n - 1) // 2] + ranked[n // 2]) / 2
    typical = np.where(typical > 0, typical, 1)
    weights, out = np.exp(-_FALL * lengths / typical), np.empty_like(direct)
    for some in even_slices(len(out), max(1, _COMPARED // (len(routes) ** 2 * out.shape[1]))):
        out[some] = _weighted_median(routes[:, some], weights[:, some])
    return out


def _weighted_median(values, weights):
    """Median over the first axis of (n, n_sequences, P), with weights (n, n_sequences).

    Between the two values that halve the weight exactly it is their mean, as without weights. Few
    values are sooner compared with each other than sorted.
    """
    n, n_sequences, _ = values.shape
    values, weights = np.ascontiguousarray(values.swapaxes(0, 1)), weights.T[:, np.newaxis]
    below = (values[:, :, np.newaxis] <= values[:, np.newaxis]).astype(weights.dtype)
    held = np.matmul(weights, below.reshape(n_sequences, n, -1)).reshape(values.shape)
    half, rounding = weights.sum(axis=2, keepdims=True) / 2, _ROUNDING[weights.dtype]
    # The smallest value up to which there is half of the weight, and up to which there is more.
    low = np.where(held >= half * (1 - rounding), values, np.inf).min(axis=1)
    high = np.where(held > half * (1 + rounding), values, np.inf).min(axis=1)
    return (low + high) / 2


def smoothed(times, reach, width, about=0.0):
    """Warps (n_sequences, P) whose offsets are smoothed and in the band, pinned, non-decreasing.

    Parameters
    ----------
    times : ndarray, shape (n_sequences, P)
    reach : int
        Largest offset.
    width : float
        Standard deviation of the Gaussian, as a share of the clip.
    about : ndarray, shape (n_sequences, P), default=0.0
        Offsets that are smooth as they are: what differs from them is smoothed.
    """
    n_frames = times.shape[1]
    frames, sigma = np.arange(n_frames), width * (n_frames - 1)
    offsets = times - frames - about
    if sigma > 1 / 3:
        offsets = smooth(offsets[:, :, np.newaxis], sigma)[:, :, 0]
        offsets[:, [0, -1]] = 0
    times = frames + np.clip(offsets + about, -reach, reach)
    return np.maximum.accumulate(np.clip(times, 0, n_frames - 1), axis=1)
