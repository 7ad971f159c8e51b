"""From performances on the common clock to their warps: match, vote, smooth, refine.

What becomes known while a synchronizer is fitted is one object after the other: `Features`, before
anything was compared; `Matcher`, which compares any two; `Warper`, which knows the pattern;
`RefinedWarper`, which also knows the noise.
"""

import math
from dataclasses import dataclass

import numpy as np

from .consensus import smoothed, vote
from .filters import smooth
from .matcher import Matcher
from .refinement import refine_warps
from .rows import Bases

__all__ = ["RefinedWarper", "Warper"]

# A picture of a disparity space has no use for more cells.
DRAWN_CELLS = 4_000_000


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
    to_lengths : ndarray, shape (n_exemplars,)
        Distances of these paths.
    votes : bool
        Whether direct paths are voted on and smoothed.
    warp_smoothing : float
        Width of the smoothing of offsets, as a share of the clip.
    """

    matcher: Matcher
    pattern: np.ndarray
    bases: Bases
    to_exemplars: np.ndarray
    to_lengths: np.ndarray
    votes: bool
    warp_smoothing: float

    @classmethod
    def to_pattern(cls, matcher, pattern, chosen, votes, warp_smoothing, coupling=None, **own):
        """The warper to a pattern: its postures, and it and its exemplars at all positions.

        What draws its paths to the exemplars, and what a kind of warpers has of its own.
        """
        features = matcher.features(chosen)
        # A copy: the whole of the features is not to be kept alive.
        bases = Bases(matcher.trellis, features[:, :: matcher.features.subframes].copy())
        disparities = matcher.paths(bases.part(slice(1)), features[1:], coupling)[0]
        lengths = matcher.trellis.costs(bases.sequences[0], features[1:], disparities)
        times = _times(matcher, bases, disparities[np.newaxis], coupling)
        if coupling is not None:
            lengths = (lengths + coupling.cost(times))[0]
        return cls(matcher, pattern, bases, times[0], lengths, votes, warp_smoothing, **own)

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

    def voted(self, positions, coupling=None):
        """Distances of the direct paths, and smoothed times after the vote of the exemplars.

        A coupling draws the paths, and what they pay for it makes a route long; it is no part of
        the distances.
        """
        moving, trellis = self.matcher.features(positions), self.matcher.trellis
        bases = self.bases
        if moving.dtype != bases.sequences.dtype:
            bases = Bases(trellis, bases.sequences.astype(moving.dtype))
        base = bases.sequences[0]
        disparities, lengths = self.matcher.paths_and_costs(bases, moving, coupling)
        routes = _times(self.matcher, bases, disparities, coupling)
        distances, times = trellis.costs(base, moving, disparities[0]), routes[0]
        if not self.votes:
            return distances, times
        if len(self.to_exemplars):
            if coupling is not None:
                pairs = zip(bases.sequences, disparities, strict=True)
                costs = np.stack([trellis.costs(x, moving, d) for x, d in pairs])
                lengths = costs + coupling.cost(routes)
            lengths[1:] += self.to_lengths[:, np.newaxis].astype(lengths.dtype)
            times = vote(times, self.to_exemplars[:, np.newaxis], routes[1:], lengths)
        if coupling is None:
            times = smoothed(times, trellis.reach, self.warp_smoothing)
        else:
            share, others = _share(bases, coupling), coupling.offsets[0]
            times = smoothed(times, trellis.reach, self.warp_smoothing, share * others)
            # A strong coupling leaves nothing, also where the body's warp is steeper than a path.
            times += share**2 * (others + np.arange(times.shape[1]) - times)
        # A path without any distance is right: the pattern keeps its own pace.
        rounding = 64 * np.finfo(positions.dtype).eps * np.square(base).sum()
        return distances, np.where((distances <= rounding)[:, np.newaxis], routes[0], times)


def _times(matcher, bases, disparities, coupling):
    """``tau`` of paths: (n_bases, n_moving, P).

    A path stands at whole steps. Of the way to what it is drawn to, half a step at most, it goes
    the share of the coupling.
    """
    times = matcher.times(disparities)
    if coupling is None:
        return times
    half = 0.5 / matcher.trellis.table.subframes
    way = coupling.offsets + np.arange(times.shape[-1]) - times
    return times + _share(bases, coupling) * np.clip(way, -half, half)


def _share(bases, coupling):
    """w / (w + c): what a coupling of the weight w has beside features of mean squared slope c."""
    slope = np.square(np.diff(bases.sequences, axis=1)).sum(axis=2).mean(dtype=np.float64)
    return coupling.weight / (coupling.weight + slope)


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
