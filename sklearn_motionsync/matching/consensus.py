"""Consensus: warps by way of other trials outvote a path that took a wrong valley."""

import numpy as np

from .counting import ROUNDING
from .filters import LEAST_SIGMA, smooth
from .warps import evaluate_warps


def choose_exemplars(global_distances, n_exemplars, pattern=None):
    """Indices of exemplars: evenly spread over the more typical half of the trials.

    Parameters
    ----------
    global_distances : ndarray, shape (n_trials,)
        ``C_n`` of Eq. 19; typical trials have small ones.
    n_exemplars : int
    pattern : int, default=None
        Index of the pattern, which is never its own exemplar.

    Returns
    -------
    ndarray of int, shape (min(n_exemplars, n_trials - 1 or n_trials),)
    """
    # Equal distances but for rounding are in the order of the trials.
    shares = global_distances / (global_distances.max(initial=0) or 1)
    order = np.argsort(np.round(shares / ROUNDING), kind="stable")
    order = order[order != pattern]
    half = order[: max(n_exemplars, len(order) // 2)]
    count = min(n_exemplars, len(half))
    evenly = (np.arange(count) + 0.5) / max(count, 1) * len(half) - 0.5
    return half[np.round(evenly).astype(np.intp)]


def exemplars_of_each(global_distances, n_exemplars):
    """Exemplars of every trial, if it were the pattern: (n_exemplars, n_trials)."""
    patterns = range(len(global_distances))
    chosen = [choose_exemplars(global_distances, n_exemplars, n) for n in patterns]
    return np.stack(chosen, axis=1)


def vote(direct, to_exemplars, from_exemplars):
    """The median over all routes from the pattern to each trial.

    The time p of the pattern n reaches the trial m directly, as ``tau_nm(p)``, or by way of an
    exemplar k, as ``tau_km(tau_nk(p))``. The median of non-decreasing warps with pinned ends is one
    itself.

    Parameters
    ----------
    direct : ndarray, shape (n_trials, P)
        ``tau_nm``.
    to_exemplars : ndarray, shape (n_exemplars, n_trials or 1, P)
        ``tau_nk``, of every trial or of all.
    from_exemplars : ndarray, shape (n_exemplars, n_trials, P)
        ``tau_km``.

    Returns
    -------
    ndarray, shape (n_trials, P)
        The mean of the two middle values if there are two.
    """
    indirect = evaluate_warps(from_exemplars, to_exemplars)
    routes = np.sort(np.concatenate([direct[np.newaxis], indirect]), axis=0)
    return (routes[(len(routes) - 1) // 2] + routes[len(routes) // 2]) / 2


def smooth_warps(times, reach, width, about=0.0):
    """Warps (n_trials, P) with smoothed offsets in the band, pinned and non-decreasing.

    Parameters
    ----------
    times : ndarray, shape (n_trials, P)
    reach : int
        Largest offset.
    width : float
        Standard deviation of the Gaussian, as a share of the clip.
    about : ndarray, shape (n_trials, P), default=0.0
        Offsets that are smooth already: only deviations from them are smoothed.
    """
    n_frames = times.shape[1]
    frames, sigma = np.arange(n_frames), width * (n_frames - 1)
    offsets = times - frames - about
    if sigma > LEAST_SIGMA:
        offsets = smooth(offsets[:, :, np.newaxis], sigma)[:, :, 0]
        offsets[:, [0, -1]] = 0
    times = frames + np.clip(offsets + about, -reach, reach)
    return np.maximum.accumulate(np.clip(times, 0, n_frames - 1), axis=1)
