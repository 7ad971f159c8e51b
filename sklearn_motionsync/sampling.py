"""Warps, and sequences sampled along them: linear between frames (Eqs. 7 and 18)."""

from typing import NamedTuple

import numpy as np

from .matching import even_slices
from .sequences import read_collection

__all__ = ["Match", "as_match", "sample"]

# Sequences sampled together: bounds the memory of what stands in between.
_SAMPLED_AT_ONCE = 64


class Match(NamedTuple):
    """Warps of a set of performances to the pattern.

    Attributes
    ----------
    offsets : ndarray, shape (n_sequences, P)
        ``Delta(p)``, in frames of the pattern.
    times : ndarray, shape (n_sequences, P)
        ``tau(p) = p + Delta(p)``, non-decreasing, ``tau(0) = 0``, ``tau(P-1) = P-1``.
    distances : ndarray, shape (n_sequences,)
        The synchronisation distance ``D_{n,m}`` of Eq. 12, of the path straight to the base.

    Examples
    --------
    >>> import numpy as np
    >>> from sklearn_motionsync import LinearSynchronizer
    >>> X = [np.arange(5.0)[:, None], np.arange(9.0)[:, None] / 2]
    >>> match = LinearSynchronizer(n_frames=5).fit(X).match(X)
    >>> match
    Match(2 performances on 5 frames)
    >>> forces = [np.arange(41.0)[:, None], np.arange(81.0)[:, None]]  # ten times the rate
    >>> match.warp(forces)[1].ravel().tolist()
    [0.0, 20.0, 40.0, 60.0, 80.0]
    """

    offsets: np.ndarray
    times: np.ndarray
    distances: np.ndarray

    def __repr__(self):
        n_sequences, n_frames = self.times.shape
        return f"Match({n_sequences} performances on {n_frames} frames)"

    def warp(self, X):
        """Whatever was recorded along with the performances, on the clock of the pattern (Eq. 18).

        Joint positions when the match was made in the aSpace, forces, muscle signals, at any rate:
        the first and last frame of each are those of the performance.

        Parameters
        ----------
        X : list of arrays (n_frames_i, n_features), 3-D array, or (performance, frame) frame
            One sequence a performance, in the same order. NaN stay where they are.

        Returns
        -------
        ndarray, shape (n_sequences, P, n_features)

        Raises
        ------
        ValueError
            If there is not one sequence a performance, or they break the contract for
            performances.
        """
        _, arrays, _ = read_collection(X)
        n_sequences, n_frames = self.times.shape
        if len(arrays) != n_sequences:
            raise ValueError(
                f"There are {n_sequences} matched performances, but {len(arrays)} sequences to "
                "warp: give one for each, in the same order."
            )
        return sample(arrays, self.times, n_frames)


def as_match(times, n_sequences):
    """Warps that somebody made, checked, as a match without distances."""
    times = np.asarray(times, dtype=np.float64)
    if times.ndim != 2 or len(times) != n_sequences or times.shape[1] < 2:
        raise ValueError(
            f"times must have shape (n_sequences, P), one row for each of the {n_sequences} "
            f"performances; got {times.shape}."
        )
    last = times.shape[1] - 1
    # Not a number fails the comparison, too.
    if not ((times >= 0) & (times <= last)).all():
        raise ValueError(
            f"times must be from 0 to P - 1 = {last}, in frames of the pattern, got "
            f"{times.min():g} to {times.max():g}."
        )
    return Match(times - np.arange(last + 1), times, np.full(n_sequences, np.nan))


def sample(arrays, times, n_frames):
    """Sequences at times on a clock of ``n_frames``, the first and last frame being theirs too.

    Parameters
    ----------
    arrays : list of ndarray (n_frames_i, n_features)
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
    frames = np.concatenate(arrays)
    left += np.cumsum(last + 1)[:, np.newaxis] - (last + 1)
    np.multiply(frames[left], 1 - weight, out=out)
    left += 1
    out += frames[left] * weight
