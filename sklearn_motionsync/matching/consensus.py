"""Consensus: warps by way of other performances outvote a path that took a wrong valley."""

import numpy as np

from .filters import smooth
from .warps import evaluate_warps

__all__ = ["choose_exemplars", "smooth_warps", "vote"]

# Decay of the weight of a route with its length: exp(-1.5) for one of typical length beside
# one without any distance. Measured in docs/design.md.
_DECAY = 1.5
# Share of the weight by which rounding may move a half.
_ROUNDING = {np.dtype(np.float64): 2.0**-40, np.dtype(np.float32): 2.0**-18}
# Comparisons that are made at once: they stay in the cache.
_BATCH_SIZE = 200_000


def choose_exemplars(global_distances, n_exemplars, patterns):
    """Indices of exemplars for each of some patterns: evenly spread over the more typical half.

    Parameters
    ----------
    global_distances : ndarray, shape (n_sequences,)
        ``C_n`` of Eq. 19; typical performances have small ones.
    n_exemplars : int
    patterns : iterable of int or None
        Indices of patterns. A pattern is never its own exemplar.

    Returns
    -------
    ndarray of int, shape (min(n_exemplars, n_sequences - 1 or n_sequences), n_patterns)
    """
    ranking, chosen = np.argsort(global_distances, kind="stable"), []
    for pattern in patterns:
        order = ranking[ranking != pattern]
        half = order[: max(n_exemplars, len(order) // 2)]
        count = min(n_exemplars, len(half))
        spread = (np.arange(count) + 0.5) / max(count, 1) * len(half) - 0.5
        chosen.append(half[np.round(spread).astype(np.intp)])
    return np.stack(chosen, axis=1)


def vote(direct, to_exemplars, from_exemplars, lengths):
    """The weighted median over all routes from the pattern to each sequence.

    The time p of the pattern n reaches the sequence m directly, as ``tau_nm(p)``, or by way
    of an exemplar k, as ``tau_km(tau_nk(p))``. A route along similar performances is right
    more often than a long one, and has a larger weight. The median of non-decreasing warps with
    pinned ends, with weights that are the same at all times, is one itself.

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
        Between two values that halve the weight exactly it is their mean.
    """
    indirect = evaluate_warps(from_exemplars, to_exemplars)
    # Few values are compared with each other faster than sorted.
    routes = np.ascontiguousarray(np.concatenate([direct[np.newaxis], indirect]).swapaxes(0, 1))
    # The median of the lengths; np.median takes as long as all routes.
    ranked, n = np.sort(lengths, axis=0), len(lengths)
    typical = (ranked[(n - 1) // 2] + ranked[n // 2]) / 2
    typical = np.where(typical > 0, typical, 1)
    weights = np.exp(-_DECAY * lengths / typical).T[:, np.newaxis]
    out, rounding = np.empty_like(direct), _ROUNDING[weights.dtype]
    size = max(1, _BATCH_SIZE // (n**2 * out.shape[1]))
    for start in range(0, len(out), size):
        rows = slice(start, start + size)
        values, own = routes[rows], weights[rows]
        below = (values[:, :, np.newaxis] <= values[:, np.newaxis]).astype(own.dtype)
        held = np.matmul(own, below.reshape(len(own), n, -1)).reshape(values.shape)
        half = own.sum(axis=2, keepdims=True) / 2
        # The smallest value up to which there is half of the weight, and up to which there is more.
        low = np.where(held >= half * (1 - rounding), values, np.inf).min(axis=1)
        high = np.where(held > half * (1 + rounding), values, np.inf).min(axis=1)
        out[rows] = (low + high) / 2
    return out


def smooth_warps(times, reach, width, about=0.0):
    """Warps (n_sequences, P) with smoothed offsets in the band, pinned and non-decreasing.

    Parameters
    ----------
    times : ndarray, shape (n_sequences, P)
    reach : int
        Largest offset.
    width : float
        Standard deviation of the Gaussian, as a share of the clip.
    about : ndarray, shape (n_sequences, P), default=0.0
        Offsets that are smooth already: only deviations from them are smoothed.
    """
    n_frames = times.shape[1]
    frames, sigma = np.arange(n_frames), width * (n_frames - 1)
    offsets = times - frames - about
    if sigma > 1 / 3:
        offsets = smooth(offsets[:, :, np.newaxis], sigma)[:, :, 0]
        offsets[:, [0, -1]] = 0
    times = frames + np.clip(offsets + about, -reach, reach)
    return np.maximum.accumulate(np.clip(times, 0, n_frames - 1), axis=1)
