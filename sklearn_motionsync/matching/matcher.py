"""From performances on the common clock to their warps: match, vote, smooth, refine.

What becomes known while a synchronizer is fitted is one object after the other: `Features`, before
anything was matched; `Matcher`, which matches any two; `Warper`, which knows the pattern;
`RefinedWarper`, which also knows the noise, `SharpenedWarper`, which knows what trials agree in, or
`LinearWarper`, if warps would harm.
"""

import math
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from scipy.ndimage import gaussian_filter1d

from .anchors import KeyframeColumns
from .consensus import choose_exemplars, smooth_warps, vote
from .costs import COSTS
from .factors import Bases
from .filters import SMOOTHING, smooth
from .gaps import UNSEEN
from .metric import Metric, energy_shares, learn_metric
from .refinement import refine_warps, standard_errors
from .sharpening import Sharpener
from .trellis import Trellis
from .uncertainty import refined_uncertainty, uncertainty_of_paths
from .units import Unit
from .warps import evaluate_warps, normalise

__all__ = ["Features", "Matcher", "RefinedWarper", "SharpenedWarper", "Warper", "cost_features"]

# The metric is learnt from at most so many frames of a clip.
LEARNING_FRAMES = 100
# Frames in the reach of a band from which on finer ones do not change the median, and by how
# many times fewer frames than all are worth it.
_REACH, _WORTH = 8, 1.5
# Most cells of a disparity space that is returned to be drawn.
DRAWN_CELLS = 4_000_000


def cost_features(on_clock, cost, subframes=1, smoothing=SMOOTHING, velocity=None):
    """Features of normalised sequences under a cost.

    Parameters
    ----------
    on_clock : ndarray, shape (n_sequences, Q, n_features)
        Linearly normalised sequences, ``subframes`` positions a frame.
    cost : str
        A key of ``costs.COSTS``.
    subframes : int, default=1
    smoothing : float, default=0.03
        Width of the smoothing of velocities, as a share of the clip.
    velocity : ndarray, default=None
        Their velocities by the frame; by default smoothed derivatives.

    Returns
    -------
    ndarray, shape (n_sequences, Q, n_features)
    """
    features, compared = on_clock, COSTS[cost]
    if compared.of_velocity and velocity is None:
        features = smooth(on_clock, smoothing * (on_clock.shape[1] - 1), order=1)
        features *= subframes
    elif compared.of_velocity:
        features = velocity
    return features if compared.transform is None else compared.transform(features)


def _spread(n, count):
    """Indices of so many of n, evenly spaced, the first and the last among them."""
    return np.round(np.linspace(0, n - 1, count)).astype(np.intp)


class Features(NamedTuple):
    """The features of performances that are compared.

    Attributes
    ----------
    cost : str
        A key of ``costs.COSTS``.
    subframes : int
        Positions a frame.
    velocity_smoothing : float
    unit : Unit
    metric : Metric or None
        Learnt from velocities and postures.
    frames : int, default=None
        Only so many frames are compared, evenly spaced.
    single : bool, default=False
        Whether features are in single precision, whatever that of the postures.
    anchors : KeyframeColumns, default=None
        Columns of positions and features behind their own.
    weighs : bool, default=False
        Whether a column of weights follows those of the unit: see `gaps`.
    """

    cost: str
    subframes: int
    velocity_smoothing: float
    unit: Unit
    metric: Metric | None = None
    frames: int | None = None
    single: bool = False
    anchors: KeyframeColumns | None = None
    weighs: bool = False

    def __call__(self, positions):
        """Features, at every position, of postures in the unit: (n_sequences, Q, n_compared).

        Columns of weights and key-frames follow them.
        """
        if self.single:
            positions = positions.astype(np.float32, copy=False)
        postures = self.plain(positions)
        features = cost_features(postures, self.cost, self.subframes, self.velocity_smoothing)
        if self.metric is not None:
            features = self.metric(features, postures)
        if postures is not positions:
            features = np.concatenate([features, self.beside(positions)], axis=2)
        if self.frames is not None:
            features = features[:, _spread(features.shape[1], self.frames)]
        return features

    def plain(self, columns):
        """Positions or features (..., n_columns) without columns of weights and key-frames."""
        columns = columns if self.anchors is None else self.anchors.features(columns)
        return columns[..., :-1] if self.weighs else columns

    def beside(self, positions):
        """The columns of weights, smoothed as velocities are, and of key-frames."""
        columns = positions[..., len(self.unit.centre) :]
        if not self.weighs:
            return columns
        sigma = self.velocity_smoothing * (positions.shape[1] - 1)
        weights = gaussian_filter1d(columns[..., :1], sigma, axis=1, mode="nearest")
        return np.concatenate([weights, columns[..., 1:]], axis=2)

    def replace(self, **changes):
        """The same features but for these attributes."""
        return self._replace(**changes)

    @property
    def degree(self):
        """Power of the unit of the data in squares of features."""
        return COSTS[self.cost].degree if self.metric is None else 0

    def back(self, squares):
        """Squares of features in the unit of the data, in double precision."""
        return np.asarray(squares, dtype=np.float64) * self.unit.size**self.degree

    def for_search(self, n_frames, max_offset):
        """The features by which the median is searched for.

        With a learnt metric: at fewer frames and in single precision, if that is much faster.
        """
        enough = self._enough(n_frames, max_offset)
        if self.metric is None or enough == n_frames:
            return self
        return self._replace(frames=enough, single=True)

    def _enough(self, n_frames, max_offset):
        """How many frames suffice to choose the median, or all if not many fewer do.

        As many as the smoothing of velocities leaves independent, and the band needs.
        """
        finest = min(self.velocity_smoothing, max_offset / _REACH)
        return n_frames if n_frames * finest < _WORTH else 1 + math.ceil(1 / finest)

    def at_pace(self, subframes, smoothing=None):
        """The same features with so many positions a frame, under this smoothing or its own."""
        smoothing = self.velocity_smoothing if smoothing is None else smoothing
        return self._replace(subframes=subframes, velocity_smoothing=smoothing)

    def learn(self, positions, *, consensus, warp_smoothing, **settings):
        """These features with the metric of a training set, at all positions in the unit.

        At most ``LEARNING_FRAMES`` frames of each are used, which lose nothing under the smoothing
        of velocities, a share of the clip; they are matched by as many as suffice.

        Returns
        -------
        tuple (Features, shares, energy, Evidence), or None
            The share of every feature in what is compared, and in the energy of velocities. None
            if there is nothing to learn.
        """
        # Rounding changes a metric much less than noise.
        positions = positions.astype(np.float32, copy=False)
        positions, beside = self.plain(positions), self.beside(positions)
        velocity = cost_features(positions, self.cost, self.subframes, self.velocity_smoothing)
        n_frames = (positions.shape[1] - 1) // self.subframes + 1
        some = _spread(positions.shape[1], min(n_frames, LEARNING_FRAMES))
        few = _spread(len(some), self._enough(len(some), settings["max_offset"]))
        settings["max_rate"] = min(settings["max_rate"], len(few) - 1)
        # Where all frames lie among the few.
        within = np.interp(np.arange(len(some)), few, np.arange(len(few)))

        def match(compared, others):
            compared = np.concatenate([compared, beside], axis=2)[:, few]
            matcher = Matcher.of(self.at_pace(1), compared, **settings)
            times = matcher.match_others(compared, others, consensus, warp_smoothing)
            times = np.interp(times, np.arange(len(few)), few)
            return evaluate_warps(times, within[np.newaxis, np.newaxis])

        # Which one of a pair is the base does not depend on the order of performances.
        order = np.argsort(np.einsum("npk,npk->n", velocity, velocity), kind="stable")
        parts = positions, velocity, beside
        positions, velocity, beside = (x[np.ix_(order, some)] for x in parts)
        learnt = learn_metric(match, positions, velocity)
        if learnt is None:
            return None
        metric, evidence = learnt
        shares = metric.shares(velocity, positions), energy_shares(velocity)
        return self._replace(metric=metric), *shares, evidence

    def part(self, columns, on_clock):
        """The features of some columns alone; None if these do not move.

        Columns that the metric takes for noise are left out; if it takes all of them for noise,
        they are compared without it.

        Parameters
        ----------
        columns : ndarray of int
        on_clock : ndarray, shape (n_sequences, Q, n_features)
            The training set at all positions, with all columns and not in the unit.
        """
        unit = self.unit.part(columns)
        plain = Features(self.cost, self.subframes, self.velocity_smoothing, unit)
        compared = plain(unit(on_clock[:, :, columns]))
        if not np.ptp(compared, axis=1).any():
            return None
        if self.metric is None:
            return plain
        return plain.replace(metric=self.metric.part(self.unit.originals[columns], compared))

    def positions(self, arrays, n_frames):
        """Performances at every position of the clock (Eq. 7), in the unit."""
        positions = normalise(arrays, n_frames, self.subframes)
        return self.unit(positions, out=positions)


class Matcher(NamedTuple):
    """Matches performances to each other: the features that are compared, and the trellis."""

    features: Features
    trellis: Trellis

    @classmethod
    def learn(cls, features, positions, **settings):
        """The matcher of a training set, at all positions in the unit, and its features.

        Parameters
        ----------
        features : Features
        positions : ndarray, shape (n_sequences, Q, n_features)
        **settings : dict
            ``smoothness``, ``max_offset`` and ``max_rate``.
        """
        compared = features(positions)
        return cls.of(features, compared, **settings), compared

    @classmethod
    def of(cls, features, compared, **settings):
        """The matcher of a training set with these features, an array."""
        plain = features.plain(compared)
        energy = np.einsum("npk,npk->", plain, plain, dtype=np.float64)
        return cls.of_energy(features, compared.shape, energy, **settings)

    @classmethod
    def of_energy(cls, features, shape, energy, *, smoothness, max_offset, max_rate):
        """The matcher of a training set, given the shape and energy of its features.

        The weight of changes of pace, ``mu``, is ``smoothness`` times the mean squared norm of the
        features, so that it does not depend on their unit.
        """
        n_sequences, n_positions, _ = shape
        mu = float(smoothness * energy / (n_sequences * n_positions))
        mean = float(energy / (n_sequences * n_positions))
        subframes = features.subframes if features.frames is None else 1
        n_frames = (n_positions - 1) // subframes + 1
        reach = {"max_offset": max_offset, "max_rate": max_rate, "subframes": subframes}
        if features.weighs:
            reach["unseen"] = UNSEEN * mean
        if features.anchors is not None:
            reach["anchors"] = features.anchors.on_clock(n_frames, mean)
        return cls(features, Trellis.on_clock(features.cost, n_frames, mu, **reach))

    def on_clock(self, features, n_frames, *, max_offset, max_rate):
        """The matcher that is this one but for its features and the frames of its clock."""
        reach = {"max_offset": max_offset, "max_rate": max_rate, "subframes": features.subframes}
        reach["unseen"] = self.trellis.unseen
        if self.trellis.anchors is not None:
            reach["anchors"] = self.trellis.anchors.at(n_frames)
        trellis = Trellis.on_clock(features.cost, n_frames, self.trellis.mu, **reach)
        return Matcher(features, trellis)

    def distances(self, features, bases, moving, tiles):
        """Synchronisation distances ``D_{n,m}`` of the tiles of the pairs of two index arrays."""
        subframes = self.trellis.table.subframes
        return [
            (
                rows,
                columns,
                self.trellis.distances(
                    features[bases[rows], ::subframes], features[moving[columns]]
                ),
            )
            for rows, columns in tiles
        ]

    def times(self, disparities):
        """``tau``, in frames, of disparities."""
        frames = np.arange(disparities.shape[-1])
        return frames + disparities / self.trellis.table.subframes

    def match_others(self, sequences, others, n_exemplars, warp_smoothing):
        """Warps after the vote of every sequence to others of its own.

        Parameters
        ----------
        sequences : ndarray, shape (n_sequences, P, n_compared)
        others : ndarray of int, shape (n_sequences, n_others)
        n_exemplars : int
        warp_smoothing : float

        Returns
        -------
        ndarray, shape (n_sequences, n_others, P)
        """
        disparities, costs = self.trellis.paths_and_costs(sequences, sequences)
        times = self.times(disparities).astype(costs.dtype)
        typical = costs.sum(axis=1, dtype=np.float64)
        chosen = choose_exemplars(typical, n_exemplars, range(len(typical)))
        # The base, the other and, (n_exemplars, n_pairs), the exemplars of every pair.
        n, m = np.repeat(np.arange(len(others)), others.shape[1]), others.ravel()
        k = chosen[:, n]
        lengths = np.concatenate([costs[n, m][np.newaxis], costs[n, k] + costs[k, m]])
        out = vote(times[n, m], times[n, k], times[k, m], lengths)
        return smooth_warps(out, self.trellis.reach, warp_smoothing).reshape(*others.shape, -1)


@dataclass(frozen=True, eq=False)
class Warper:
    """Warps performances to a pattern, in portions and in other processes.

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
        """The warper to a pattern.

        Parameters
        ----------
        matcher : Matcher
        pattern : ndarray, shape (P, n_features)
            Its postures, in the unit.
        chosen : ndarray, shape (1 + n_exemplars, Q, n_features)
            The pattern and its exemplars, at all positions in the unit.
        votes : bool
        warp_smoothing : float
        coupling : Coupling, default=None
            Of the paths from the pattern to the exemplars.
        **own : dict
            Attributes of a subclass.
        """
        features = matcher.features(chosen)
        # A copy, so that the features at all positions are not kept alive.
        bases = Bases(matcher.trellis, features[:, :: matcher.features.subframes].copy())
        base, trellis = bases.sequences[:1], matcher.trellis
        disparities = trellis.paths(base, features[1:], None, coupling)
        lengths = trellis.costs(base[0], features[1:], disparities[0])
        times = matcher.times(disparities)
        if coupling is not None:
            times = _towards(matcher, bases, times, coupling)
            lengths = (lengths + coupling.cost(times))[0]
        return cls(matcher, pattern, bases, times[0], lengths, votes, warp_smoothing, **own)

    def positions(self, arrays):
        """Performances in the unit at every sub-position of the clock (Eq. 7), in double precision.

        There rounding decides nothing, so that the warp of a performance does not depend on the
        others.
        """
        arrays = [x.astype(np.float64, copy=False) for x in arrays]
        return self.matcher.features.positions(arrays, len(self.pattern))

    def warps(self, positions, coupling=None):
        """Warps of performances: match, vote and smooth.

        Parameters
        ----------
        positions : ndarray, shape (n_sequences, Q, n_features)
            Performances at all positions, in the unit.
        coupling : Coupling, default=None
            It draws the paths. Its costs count for the length of a route, and not for the
            distances.

        Returns
        -------
        distances : ndarray, shape (n_sequences,)
            Of the direct paths.
        times : ndarray, shape (n_sequences, P)
            ``tau`` after the vote and smoothing.
        """
        matcher, trellis, bases = self.matcher, self.matcher.trellis, self.bases
        moving = matcher.features(positions)
        if moving.dtype != bases.sequences.dtype:
            bases = Bases(trellis, bases.sequences.astype(moving.dtype))
        base = bases.sequences[0]
        disparities, lengths = trellis.paths_and_costs(bases, moving, None, coupling)
        routes = matcher.times(disparities)
        if coupling is not None:
            routes = _towards(matcher, bases, routes, coupling)
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
            times = smooth_warps(times, trellis.reach, self.warp_smoothing)
        else:
            share, others = _share(bases, coupling), coupling.offsets[0]
            times = smooth_warps(times, trellis.reach, self.warp_smoothing, share * others)
            # A strong coupling leaves nothing, also where the given warp is steeper than a path.
            times += share**2 * (others + np.arange(times.shape[1]) - times)
        # A path without any distance is right: the pattern keeps its own pace.
        rounding = 64 * np.finfo(positions.dtype).eps * bases.energy[0]
        if trellis.unseen is not None:
            seen = trellis.costs(base, moving, disparities[0], unseen=0.0)
            return distances, np.where((seen <= rounding)[:, np.newaxis], routes[0], times)
        return distances, np.where((distances <= rounding)[:, np.newaxis], routes[0], times)

    def uncertainty(self, positions, times):
        """The `Uncertainty` of the warps of performances.

        Parameters
        ----------
        positions : ndarray, shape (n_sequences, Q, n_features)
            Performances at all positions, in the unit.
        times : ndarray, shape (n_sequences, P)
            Their warps.
        """
        base, moving = self.bases.sequences[:1], self.matcher.features(positions)
        return uncertainty_of_paths(self.matcher, base, moving, times)

    def disparity_space(self, positions):
        """E(p, d) of the pattern and one performance at the pattern's rate (Eq. 12), and the path.

        Returns
        -------
        frames, offsets : ndarray
            Those of the costs: all of them, or evenly spaced ones of many.
        costs : ndarray, shape (n_frames, n_offsets)
            NaN where no path may pass.
        path : ndarray, shape (P,)
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
            squares = np.square(trellis.features(base[p] - window)).sum(axis=1)
            row[inside] = trellis.weighed(squares, base[p], window)
        path = trellis.paths(base[np.newaxis], moving)[0, 0] / sub
        return frames, disparities / sub, costs, path


def _towards(matcher, bases, times, coupling):
    """Times (n_bases, n_moving, P) of coupled paths, between the steps of the trellis.

    Of the distance to the given offsets, half a step at most, they go the share of the coupling.
    """
    half = 0.5 / matcher.trellis.table.subframes
    distance = coupling.offsets + np.arange(times.shape[-1]) - times
    return times + _share(bases, coupling) * np.clip(distance, -half, half)


def _share(bases, coupling):
    """The share w / (w + c) of a coupling of weight w, for features of mean squared slope c."""
    slope = np.square(np.diff(bases.sequences, axis=1)).sum(axis=2).mean(dtype=np.float64)
    return coupling.weight / (coupling.weight + slope)


@dataclass(frozen=True, eq=False)
class LinearWarper(Warper):
    """A warper that only measures distances: warps are those of linear normalisation."""

    def warps(self, positions, coupling=None):
        """Distances as of `Warper`, and the frames of the clock for every performance."""
        distances, times = super().warps(positions, coupling)
        return distances, np.broadcast_to(np.arange(times.shape[1], dtype=times.dtype), times.shape)


@dataclass(frozen=True, eq=False)
class RefinedWarper(Warper):
    """A warper of repeated trials of a single source: postures refine its warps.

    Attributes
    ----------
    noise_width : float
        Smoothing of postures before refining, in frames; 0 for none.
    """

    noise_width: float

    def warps(self, positions):
        """Warps as of `Warper`, refined by postures."""
        distances, times = super().warps(positions)
        base, moving = self.postures(positions)
        reach = self.matcher.trellis.reach
        return distances, refine_warps(base, moving, times, reach, self.noise_width)

    def uncertainty(self, positions, times):
        """The uncertainty as of `Warper`, but for half-widths: by the noise of the postures."""
        errors = standard_errors(*self.postures(positions), times, self.noise_width)
        return refined_uncertainty(super().uncertainty(positions, times), errors)

    def postures(self, positions):
        """Postures of the pattern and of performances, smoothed by the width of the noise."""
        features = self.matcher.features
        postures = features.plain(positions)[:, :: features.subframes]
        if self.noise_width <= 0:
            return self.pattern, postures
        curves = smooth(np.concatenate([self.pattern[np.newaxis], postures]), self.noise_width)
        return curves[0], curves[1:]


@dataclass(frozen=True, eq=False)
class SharpenedWarper(Warper):
    """A warper whose warps a last local match sharpens.

    Attributes
    ----------
    sharpener : Sharpener
    """

    sharpener: Sharpener

    @classmethod
    def of(cls, warper, exemplars, width=None):
        """The same warper that sharpens, or None if exemplars do not agree with the pattern.

        Parameters
        ----------
        warper : Warper
            With a metric.
        exemplars : ndarray, shape (n_exemplars, Q, n_features)
            At all positions, in the unit and in double precision.
        width : float, default=None
            Smoothing of velocities; by default as their noise asks for.
        """
        matcher, features = warper.matcher, warper.matcher.features
        postures = features.plain(exemplars)[:, :: features.subframes]
        times = smooth_warps(warper.to_exemplars, matcher.trellis.reach, warper.warp_smoothing)
        metric = matcher.features.metric
        smoothing = warper.warp_smoothing
        sharpener = Sharpener.learn(metric, warper.pattern, postures, times, smoothing, width)
        return None if sharpener is None else cls(**vars(warper), sharpener=sharpener)

    def warps(self, positions):
        """Warps as of `Warper`, sharpened."""
        distances, times = super().warps(positions)
        features = self.matcher.features
        postures = features.plain(positions)[:, :: features.subframes]
        return distances, self.sharpener(postures, times, self.matcher.trellis.reach)
