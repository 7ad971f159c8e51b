"""Consensus: warps by way of other performances outvote a path that took a wrong valley."""

import numpy as np

from .warps import follow

__all__ = ["choose_exemplars", "vote"]


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


def vote(direct, to_exemplars, from_exemplars):
    """The median over all routes from the pattern to each sequence.

    The time p of the pattern n reaches the sequence m straight, as ``tau_nm(p)``, or by way
    of an exemplar k, as ``tau_km(tau_nk(p))``. The median of non-decreasing warps with pinned
    ends is one itself.

    Parameters
    ----------
    direct : ndarray, shape (n_sequences, P)
        ``tau_nm``.
    to_exemplars : ndarray, shape (n_exemplars, P)
        ``tau_nk``.
    from_exemplars : ndarray, shape (n_exemplars, n_sequences, P)
        ``tau_km``.

    Returns
    -------
    ndarray, shape (n_sequences, P)
    """
    at = np.broadcast_to(to_exemplars[:, np.newaxis], from_exemplars.shape)
    routes = np.concatenate([direct[np.newaxis], follow(from_exemplars, at)])
    return np.median(routes, axis=0)
