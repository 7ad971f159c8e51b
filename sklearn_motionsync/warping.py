"""From performances on the common clock to their warps: match, vote, smooth, refine."""

import math
from typing import NamedTuple

import numpy as np
from sklearn import get_config

from .consensus import vote
from .features import cost_features, smooth
from .matching import Trellis
from .refinement import misfit, refine_warps

__all__ = ["Warper"]

# A picture of a disparity space has no use for more cells.
_DRAWN_CELLS = 4_000_000


class Warper(NamedTuple):
    """All it takes to warp performances to a pattern, in portions and in other processes.

    Attributes
    ----------
    cost : str
    subframes : int
        Positions a frame.
    velocity_smoothing : float
    centre : ndarray, shape (n_features,)
        Mean posture of the training set.
    reach : int
        Largest offset, in frames.
    warp_smoothing : float
    trellis : Trellis
    bases : ndarray, shape (1 + n_exemplars, P, n_features)
        Features of the pattern and of the exemplars.
    to_exemplars : ndarray, shape (n_exemplars, P)
        Times of the pattern on the clocks of the exemplars.
    votes : bool
        Whether direct paths are voted on and smoothed.
    pattern : ndarray, shape (P, n_features)
        Postures, to refine by.
    noise_width : float or None
        Smoothing of postures before refining, in frames; None if warps are not refined.
    """

    cost: str
    subframes: int
    velocity_smoothing: float
    centre: np.ndarray
    reach: int
    warp_smoothing: float
    trellis: Trellis | None = None
    bases: np.ndarray | None = None
    to_exemplars: np.ndarray | None = None
    votes: bool = False
    pattern: np.ndarray | None = None
    noise_width: float | None = None

    def features(self, positions):
        """What is compared, at every position: (n_sequences, Q, n_features)."""
        return cost_features(
            positions - self.centre, self.cost, self.subframes, self.velocity_smoothing
        )

    def with_pattern(self, pattern, chosen, votes):
        """The warper to a pattern, given it and its exemplars at all positions."""
        features = self.features(chosen)
        # A copy: the whole of the features is not to be kept alive.
        bases = features[:, :: self.subframes].copy()
        self = self._replace(bases=bases, votes=votes, pattern=pattern)
        times = self._paths(bases[:1], features[1:])[1][0]
        return self._replace(to_exemplars=times)

    def disparity_space(self, positions):
        """E(p, d) of the pattern and one performance at the pattern's rate (Eq. 12), and the path.

        Returns the frames p and the offsets d of the costs, all of them or evenly spaced ones of
        many; the costs (n_frames, n_offsets), NaN where no path may pass; and the path (P,).
        """
        (base, *_), (moving,) = self.bases, self.features(positions)
        width, sub = self.trellis.width, self.subframes
        lows, highs = map(np.array, self.trellis.windows(len(base)))
        every = math.ceil(math.sqrt(len(base) * (2 * width + 1) / _DRAWN_CELLS))
        frames = np.arange(0, len(base), every)
        disparities = every * np.arange(-(width // every), width // every + 1)
        costs = np.full((len(frames), len(disparities)), np.nan)
        for row, p in zip(costs, frames, strict=True):
            inside = (lows[p] <= disparities) & (disparities <= highs[p])
            window = moving[p * sub + disparities[inside]]
            row[inside] = np.square(base[p] - window).sum(axis=1)
        path = self._paths(self.bases[:1], moving[np.newaxis])[1][0, 0]
        return frames, disparities / sub, costs, path - np.arange(len(base))

    def distances(self, features, bases, moving, tiles):
        """Synchronisation distances ``D_{n,m}`` of the tiles of the pairs of two index arrays."""
        return [
            (rows, columns, self._tile(features, bases[rows], moving[columns]))
            for rows, columns in tiles
        ]

    def _tile(self, features, bases, moving):
        return self.trellis.distances(features[bases, :: self.subframes], features[moving])

    def warps(self, positions, rows):
        """Distances of the direct paths to the pattern, and times ``tau``, of some performances."""
        positions = positions[rows]
        distances, times = self._voted(positions)
        if self.noise_width is not None:
            curves = np.concatenate([self.pattern[np.newaxis], positions[:, :: self.subframes]])
            if self.noise_width > 0:
                curves = smooth(curves, self.noise_width)
            times = refine_warps(curves[0], curves[1:], times, self.reach)
        return distances, times

    def misfits(self, positions, rows):
        """Misfits of matched postures, before any refinement."""
        positions = positions[rows]
        times = self._voted(positions)[1]
        return misfit(self.pattern, positions[:, :: self.subframes], times)

    def _voted(self, positions):
        """Distances of the direct paths, and smoothed times after the vote of the exemplars."""
        moving = self.features(positions)
        distances, routes = self._paths(self.bases, moving)
        distances, times = distances[0], routes[0]
        if not self.votes:
            return distances, times
        direct = times
        if len(self.to_exemplars):
            times = vote(direct, self.to_exemplars, routes[1:])
        times = self._smoothed(times)
        # A path without any distance is right: the pattern keeps its own pace.
        rounding = 64 * np.finfo(moving.dtype).eps * np.square(self.bases[0]).sum()
        return distances, np.where((distances <= rounding)[:, np.newaxis], direct, times)

    def _smoothed(self, times):
        """Warps whose offsets are smoothed and in the band, pinned and non-decreasing."""
        n_frames = times.shape[1]
        frames, sigma = np.arange(n_frames), self.warp_smoothing * (n_frames - 1)
        offsets = times - frames
        if sigma > 1 / 3:
            offsets = smooth(offsets[:, :, np.newaxis], sigma)[:, :, 0]
            offsets[:, [0, -1]] = 0
        times = frames + np.clip(offsets, -self.reach, self.reach)
        return np.maximum.accumulate(np.clip(times, 0, n_frames - 1), axis=1)

    def _paths(self, bases, moving):
        max_bytes = get_config()["working_memory"] * 2**20 // 2
        distances, disparities = self.trellis.paths(bases, moving, max_bytes)
        return distances, np.arange(bases.shape[1]) + disparities / self.subframes
