"""Where a performance departs from what is expected: runs of frames beyond a limit."""

from typing import NamedTuple

import numpy as np

__all__ = ["Runs", "runs"]


class Runs(NamedTuple):
    """Runs of consecutive frames beyond a limit, by performance, feature and frame.

    Attributes
    ----------
    performance, feature : ndarray of int, shape (n_runs,)
    first, last : ndarray of int, shape (n_runs,)
        Frames, both of the run.
    peak : ndarray of int, shape (n_runs,)
        The frame of the largest score, the first of several.
    score : ndarray, shape (n_runs,)
        The score there, with its sign.
    """

    performance: np.ndarray
    feature: np.ndarray
    first: np.ndarray
    last: np.ndarray
    peak: np.ndarray
    score: np.ndarray


def runs(scores, limit):
    """Where scores are beyond a limit, in runs of consecutive frames of one feature.

    Parameters
    ----------
    scores : ndarray, shape (n, P, n_features)
        Standard deviations from the mean.
    limit : float
        Positive; a score is beyond if its absolute value is larger.

    Returns
    -------
    Runs
    """
    scores = np.moveaxis(scores, 1, 2)
    size = np.abs(scores)
    edges = np.diff(size > limit, axis=2, prepend=False, append=False)
    # Each run gives two edges: its first frame and the one after its last.
    performance, feature, frame = (at.reshape(-1, 2).T for at in np.nonzero(edges))
    first, last = frame[0], frame[1] - 1
    lengths = last - first + 1
    of = np.repeat(np.arange(len(first)), lengths)
    frames = np.arange(len(of)) - np.repeat(np.cumsum(lengths) - lengths - first, lengths)
    inside = size[performance[0][of], feature[0][of], frames]
    # By run, the largest first, of equal ones the first frame.
    order = np.lexsort((frames, -inside, of))[np.cumsum(lengths) - lengths]
    peak = frames[order]
    score = scores[performance[0], feature[0], peak]
    return Runs(performance[0], feature[0], first, last, peak, score)
