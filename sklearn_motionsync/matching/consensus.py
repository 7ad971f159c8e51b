"""Consensus: warps by way of other performances outvote a path that took a wrong valley."""

import numpy as np

from .filters import smooth
from .warps import follow

__all__ = ["choose_exemplars", "smoothed", "vote"]

# How fast the say of a route falls with its length: exp(-1.5) for one of typical length beside
# one without any distance. Measured in docs/method.md.
_FALL = 1.5
# Share of the weight by which rounding may move a half.
_ROUNDING = 2.0**-40


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
    to_exemplars : ndarray, shape (n_exemplars, P)
        ``tau_nk``.
    from_exemplars : ndarray, shape (n_exemplars, n_sequences, P)
        ``tau_km``.
    lengths : ndarray, shape (1 + n_exemplars, n_sequences)
        ``D_{n,m}``, and ``D_{n,k} + D_{k,m}`` of every exemplar.

    Returns
    -------
    ndarray, shape (n_sequences, P)
    """
    at = np.broadcast_to(to_exemplars[:, np.newaxis], from_exemplars.shape)
    routes = np.concatenate([direct[np.newaxis], follow(from_exemplars, at)])
    typical = np.median(lengths, axis=0)
    typical = np.where(typical > 0, typical, 1)
    return _weighted_median(routes, np.exp(-_FALL * lengths / typical))


def _weighted_median(values, weights):
    """Median over the first axis of (n, n_sequences, P), with weights (n, n_sequences).

    Between the two values that halve the weight exactly it is their mean, as without weights.
    """
    values = np.moveaxis(values, 0, -1)
    order = np.argsort(values, axis=-1)
    values = np.take_along_axis(values, order, axis=-1)
    weights = np.broadcast_to(weights.T[:, np.newaxis], values.shape)
    held = np.cumsum(np.take_along_axis(weights, order, axis=-1), axis=-1)
    half = held[..., -1:] / 2
    low, high = (held < half * (1 - _ROUNDING)), (held <= half * (1 + _ROUNDING))
    at = np.stack([low.sum(axis=-1), high.sum(axis=-1)], axis=-1)
    return np.take_along_axis(values, at, axis=-1).mean(axis=-1)


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
