"""LinearSynchronizer: linear normalisation, the baseline (Eq. 7)."""

from __future__ import annotations

import numpy as np

from ..inputs.types import PerformancesLike
from ..matching.sizes import BATCH
from ..matching.warps import normalise
from .base import Synchronizer
from .match import Match

__all__ = ["LinearSynchronizer"]


class LinearSynchronizer(Synchronizer):
    """Linear normalisation (Eq. 7): the same number of frames, no matching.

    The baseline of all other synchronizers: each performance is stretched evenly to
    ``n_frames``; the pattern is only the reference of the distances.

    Parameters
    ----------
    n_frames : int, default=None
        Frames of the common clock; by default the median length of the performances, or
        the length of a pattern given as an array.
    pattern : "median", int or array (n_frames, n_features), default="median"
        The reference of ``match``: the performance with the smallest sum of distances
        (Eq. 19, without matching), one chosen by its index, or another one.

    Attributes
    ----------
    pattern_ : ndarray, shape (P, n_features)
        The pattern on the common clock.
    pattern_index_ : int or None
        Its index in the training set; None if it was given as an array.
    n_frames_ : int
        ``P``.
    global_distances_ : ndarray, shape (n_sequences,)
        ``C_n`` of Eq. 19 for every performance; NaN if the pattern was given.
    n_features_in_ : int
        Features of a frame (columns, for 2-D input).
    lengths_ : ndarray of int, shape (n_sequences,)
        Numbers of frames of the training performances.
    examples_ : ndarray, shape (min(n_sequences, 64), P, n_features)
        Training performances linearly normalised: all, or 64 of them, evenly spaced.
    features_ : callable
        Turns postures on the clock into the features that searches compare.
    feature_names_in_ : ndarray of str
        Names of the features; only if the input had names.

    See Also
    --------
    DenseSynchronizer : Follows the changes of pace within a performance.

    Examples
    --------
    >>> import numpy as np
    >>> from sklearn_motionsync import LinearSynchronizer
    >>> X = [np.arange(5.0)[:, None], np.arange(9.0)[:, None] / 2]
    >>> LinearSynchronizer(n_frames=5).fit_transform(X)[1].ravel().tolist()
    [0.0, 1.0, 2.0, 3.0, 4.0]
    """

    _finite = "allow-nan"

    def match(self, X: PerformancesLike) -> Match:
        """Match performances to the pattern without any warp.

        Parameters
        ----------
        X : list of arrays (n_frames_i, n_features), 3-D array, or 2-D array
            Performances; the rows of a 2-D array are univariate ones.

        Returns
        -------
        Match
            Offsets of 0, and ``distances``, shape (n_sequences,): squared ones to the pattern.
        """
        return self._match_in_parts(X)

    def _match(self, performances):
        arrays, distances = list(self._without_gaps(performances)), np.empty(len(performances))
        for start in range(0, len(arrays), BATCH):
            rows = slice(start, start + BATCH)
            differences = normalise(arrays[rows], self.n_frames_) - self.pattern_
            distances[rows] = np.square(differences).sum(axis=(1, 2), dtype=np.float64)
        clock = np.arange(self.n_frames_, dtype=np.float64)
        return Match(np.tile(clock, (len(arrays), 1)), distances)
