"""From performances on the common clock to their warps: match, vote, smooth, refine.

What becomes known while a synchronizer is fitted is one object after the other: `Features`, before
anything was compared; `Matcher`, which compares any two; `Warper`, which knows the pattern;
`RefinedWarper`, which also knows the noise.
"""

import math
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from sklearn import get_config

from .consensus import vote
from .costs import COSTS, cost_features, step_table
from .filters import smooth
from .refinement import refine_warps
from .rows import Bases
from .trellis import Trellis
from .units import Unit
from .warps import normalise

__all__ = ["Features", "Matcher", "RefinedWarper", "Warper"]

# A picture of a disparity space has no use for more cells.
DRAWN_CELLS = 4_000_000


class Features(NamedTuple):
    """What is compared of performances.

    Attributes
    ----------
    cost : str
        A key of ``costs.COSTS``.
    subframes : int
        Positions a frame.
    velocity_smoothing : float
    unit : Unit
    """

    cost: str
    subframes: int
    velocity_smoothing: float
    unit: Unit

    def __call__(self, positions):
        """Features, at every position, of postures in the unit: (n_sequences, Q, n_features)."""
        return cost_features(positions, self.cost, self.subframes, self.velocity_smoothing)

    def positions(self, arrays, n_frames):
        """Performances at every position of the clock (Eq. 7), in the unit."""
        return self.unit(normalise(arrays, n_frames, self.subframes))

    def back(self, squares):
        """Squares of features in the unit of the data."""
        return self.unit.back(squares, COSTS[self.cost].degree)


class Matcher(NamedTuple):
    """Matches performances to each other: what is compared, and the trellis."""

    features: Features
    trellis: Trellis

    @classmethod
    def learn(cls, features, positions, *, smoothness, max_offset, max_rate):
        """The matcher of a training set, at all positions in the unit, and what it compares of it.

        The weight of changes of pace, ``mu``, is ``smoothness`` times the mean squared norm of the
        features, so that it does not depend on their unit.
        """
        compared, subframes = features(positions), features.subframes
        n_frames = (compared.shape[1] - 1) // subframes + 1
        energy = np.einsum("npk,npk->", compared, compared, dtype=np.float64)
        mu = float(smoothness * energy / np.prod(compared.shape[:2]))
        # Whole frames; 0.29 * 100 must not lose one to rounding.
        reach = int(np.floor(max_offset * n_frames * (1 + 1e-12)))
        # No step is longer than the clip.
        table = step_table(features.cost, min(max_rate, n_frames - 1), subframes)
        return cls(features, Trellis(table, mu, min(reach, n_frames - 1))), compared

    def distances(self, features, bases, moving, tiles):
        """Synchronisation distances ``D_{n,m}`` of the tiles of the pairs of two index arrays."""
        return [
            (rows, columns, self._tile(features, bases[rows], moving[columns]))
            for rows, columns in tiles
        ]

    def _tile(self, features, bases, moving):
        bases = features[bases, :: self.trellis.table.subframes]
        return self.trellis.distances(bases, features[moving])

    def paths(self, bases, moving):
        """Disparities of the best paths: (n_bases, n_moving, P)."""
        max_bytes = get_config()["working_memory"] * 2**20 // 2
        return self.trellis.paths(bases, moving, max_bytes)

    def times(self, disparities):
        """``tau``, in frames, of disparities."""
        frames = np.arange(disparities.shape[-1])
        return frames + disparities / self.trellis.table.subframes


@dataclass(frozen=True, eq=False)
class Warper:
    """All it takes to warp performances to a pattern, in portions and in other processes.

    Attributes
    ----------
    matcher : Matcher
    pattern : ndarray, shape (P, n_features)
        Its postures, in the unit.
    bases : Bases
        Features of the pattern and of the exemplars, in double precision.
    to_exemplars : ndarray, shape (n_exemplars, P)
        Times of the pattern on the clocks of the exemplars.
    votes : bool
        Whether direct paths are voted on and smoothed.
    warp_smoothing : float
        Width of the smoothing of offsets, as a share of the clip.
    """

    matcher: Matcher
    pattern: np.ndarray
    bases: Bases
    to_exemplars: np.ndarray
    votes: bool
    warp_smoothing: float

    @classmethod
    def to_pattern(cls, matcher, pattern, chosen, votes, warp_smoothing):
        """The warper to a pattern: its postures, and it and its exemplars at all positions."""
        features = matcher.features(chosen)
        # A copy: the whole of the features is not to be kept alive.
        bases = Bases(matcher.trellis, features[:, :: matcher.features.subframes].copy())
        to_exemplars = matcher.times(matcher.paths(bases.part(slice(1)), features[1:])[0])
        return cls(matcher, pattern, bases, to_exemplars, votes, warp_smoothing)

    def positions(self, arrays):
        """Performances in the unit at every sub-position of the clock (Eq. 7), in double precision.

        There rounding decides nothing, so that the warp of a performance does not depend on those
        it comes with.
        """
        arrays = [x.astype(np.float64, copy=False) for x in arrays]
        return self.matcher.features.positions(arrays, len(self.pattern))

    def warps(self, positions, rows):
        """Distances of the direct paths to the pattern, and times ``tau``, of some performances."""
        return self.voted(positions[rows])

    def disparity_space(self, positions):
        """E(p, d) of the pattern and one performance at the pattern's rate (Eq. 12), and the path.

        Returns the frames p and the offsets d of the costs, all of them or evenly spaced ones of
        many; the costs (n_frames, n_offsets), NaN where no path may pass; and the path (P,).
        """
        trellis, moving = self.matcher.trellis, self.matcher.features(positions)
        base, width, sub = self.bases.sequences[0], trellis.width, trellis.table.subframes
        lows, highs = map(np.array, trellis.windows(len(base)))
        every = math.ceil(math.sqrt(len(base) * (2 * width + 1) / DRAWN_CELLS))
        frames = np.arange(0, len(base), every)
        disparities = every * np.arange(-(width // every), width // every + 1)
        costs = np.full((len(frames), len(disparities)), np.nan)
        for row, p in zip(costs, frames, strict=True):
            inside = (lows[p] <= disparities) & (disparities <= highs[p])
            window = moving[0, p * sub + disparities[inside]]
            row[inside] = np.square(base[p] - window).sum(axis=1)
        path = self.matcher.paths(self.bases.part(slice(1)), moving)[0, 0] / sub
        return frames, disparities / sub, costs, path

    def voted(self, positions):
        """Distances of the direct paths, and smoothed times after the vote of the exemplars."""
        moving, trellis = self.matcher.features(positions), self.matcher.trellis
        bases = self.bases
        if moving.dtype != bases.sequences.dtype:
            bases = Bases(trellis, bases.sequences.astype(moving.dtype))
        base, disparities = bases.sequences[0], self.matcher.paths(bases, moving)
        distances = trellis.costs(base, moving, disparities[0])
        routes = self.matcher.times(disparities)
        times = direct = routes[0]
        if not self.votes:
            return distances, times
        if len(self.to_exemplars):
            times = vote(direct, self.to_exemplars, routes[1:])
        times = self._smoothed(times)
        # A path without any distance is right: the pattern keeps its own pace.
        rounding = 64 * np.finfo(positions.dtype).eps * np.square(base).sum()
        return distances, np.where((distances <= rounding)[:, np.newaxis], direct, times)

    def _smoothed(self, times):
        """Warps whose offsets are smoothed and in the band, pinned and non-decreasing."""
        n_frames, reach = times.shape[1], self.matcher.trellis.reach
        frames, sigma = np.arange(n_frames), self.warp_smoothing * (n_frames - 1)
        offsets = times - frames
        if sigma > 1 / 3:
            offsets = smooth(offsets[:, :, np.newaxis], sigma)[:, :, 0]
            offsets[:, [0, -1]] = 0
        times = frames + np.clip(offsets, -reach, reach)
        return np.maximum.accumulate(np.clip(times, 0, n_frames - 1), axis=1)


@dataclass(frozen=True, eq=False)
class RefinedWarper(Warper):
    """A warper of repeated trials of a single source, whose postures place every moment.

    Attributes
    ----------
    noise_width : float
        Smoothing of postures before refining, in frames; 0 for none.
    """

    noise_width: float

    def warps(self, positions, rows):
        """As those of `Warper`, refined by postures."""
        distances, times = super().warps(positions, rows)
        base, moving = self.postures(positions[rows])
        reach = self.matcher.trellis.reach
        return distances, refine_warps(base, moving, times, reach, self.noise_width)

    def postures(self, positions):
        """Postures of the pattern and of performances, smoothed as the noise asks for."""
        postures = positions[:, :: self.matcher.features.subframes]
        if self.noise_width <= 0:
            return self.pattern, postures
        curves = smooth(np.concatenate([self.pattern[np.newaxis], postures]), self.noise_width)
        return curves[0], curves[1:]
