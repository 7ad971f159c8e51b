"""From trials on the common clock to their warps: match, vote, smooth, finish.

What becomes known while a synchronizer is fitted is one object after the other: `Features`, before
anything was matched; `Matcher`, which matches any two; `Warper`, which knows the pattern, and how
warps are finished.
"""

import math
from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np
from scipy.ndimage import gaussian_filter1d
from scipy.special import ndtri

from .anchors import KeyframeColumns
from .consensus import exemplars_of_each, smooth_warps, vote
from .costs import COSTS
from .counting import ROUNDING
from .filters import SMOOTHING, smooth
from .gaps import UNSEEN
from .metric import Metric, energy_shares, metric_of_matches
from .refinement import Refiner
from .sharpening import Sharpener
from .sizes import BATCH_NUMBERS, FRAMES
from .tile import Bases
from .trellis import Coupling, Trellis
from .uncertainty import uncertainty_of_paths
from .units import Unit
from .warps import evaluate_warps, normalise

# By how many times fewer frames than all are worth it where only the median is wanted.
_WORTH = 1.5


class PathSettings(NamedTuple):
    """What a path may do, as of the parameters of `DenseSynchronizer`."""

    smoothness: float
    max_offset: float
    max_rate: float


def cost_features(on_clock, cost, smoothing=SMOOTHING, velocity=None, pace=1.0):
    """Features of normalised trials under a cost.

    Parameters
    ----------
    on_clock : ndarray, shape (n_trials, P, n_features)
        Linearly normalised trials.
    cost : str
        A key of ``costs.COSTS``.
    smoothing : float, default=0.03
        Width of the smoothing of velocities, as a share of the clip.
    velocity : ndarray, default=None
        Their velocities by the frame; by default smoothed derivatives.
    pace : float, default=1.0
        Samples a frame, if velocities are computed here.

    Returns
    -------
    ndarray, shape (n_trials, P, n_features)
    """
    features, compared = on_clock, COSTS[cost]
    if compared.of_velocity:
        if velocity is None:
            velocity = smooth(on_clock, smoothing * (on_clock.shape[1] - 1), order=1)
            velocity *= pace
        features = velocity
    return features if compared.transform is None else compared.transform(features)


class Features(NamedTuple):
    """The features of trials that are compared.

    Attributes
    ----------
    cost : str
        A key of ``costs.COSTS``.
    velocity_smoothing : float
        Width of the smoothing of velocities, as a share of the clip.
    unit : Unit
    metric : Metric or None
        Learnt from velocities and poses.
    pace : float, default=1.0
        Samples a frame, by which velocities are counted.
    frames : int, default=None
        Only so many frames are compared, evenly spaced.
    single : bool, default=False
        Whether features are in single precision, whatever that of the poses.
    anchors : KeyframeColumns, default=None
        Columns of positions and features behind their own.
    weighs : bool, default=False
        Whether a column of weights follows those of the unit: see `gaps`.
    """

    cost: str
    velocity_smoothing: float
    unit: Unit
    metric: Metric | None = None
    pace: float = 1.0
    frames: int | None = None
    single: bool = False
    anchors: KeyframeColumns | None = None
    weighs: bool = False

    def __call__(self, positions):
        """Features of poses in the unit: (n_trials, P, n_compared).

        Columns of weights and key-frames follow them.
        """
        if self.single:
            positions = positions.astype(np.float32, copy=False)
        poses = self.plain(positions)
        features = cost_features(poses, self.cost, self.velocity_smoothing, pace=self.pace)
        if self.metric is not None:
            features = self.metric(features, poses)
        if poses is not positions:
            features = np.concatenate([features, self.beside(positions)], axis=2)
        if self.frames is not None:
            features = features[:, _evenly(features.shape[1], self.frames)]
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

    @property
    def degree(self):
        """Power of the unit of the data in squares of features."""
        return COSTS[self.cost].degree if self.metric is None else 0

    def back(self, squares):
        """Squares of features in the unit of the data, in double precision."""
        return np.asarray(squares, dtype=np.float64) * self.unit.size**self.degree

    def for_search(self, n_frames):
        """The features by which the median is searched for.

        With a learnt metric: at fewer frames and in single precision, if that is much faster.
        """
        enough = self.enough_frames(n_frames)
        if self.metric is None or enough == n_frames:
            return self
        return self._replace(frames=enough, single=True)

    def enough_frames(self, n_frames):
        """How many frames suffice to choose the median, or all if not many fewer do.

        As many as the smoothing of velocities leaves independent.
        """
        smoothing = self.velocity_smoothing
        return (
            n_frames if n_frames * smoothing < _WORTH else 1 + math.ceil(1 / smoothing - ROUNDING)
        )

    def part(self, columns, on_clock):
        """The features of some columns alone; None if these do not move.

        Columns that the metric takes for noise are left out; if it takes all of them for noise,
        they are compared without it.

        Parameters
        ----------
        columns : ndarray of int
        on_clock : ndarray, shape (n_trials, P, n_features)
            The training set with all columns, not in the unit.
        """
        unit = self.unit.part(columns)
        plain = Features(self.cost, self.velocity_smoothing, unit)
        compared = plain(unit(on_clock[:, :, columns]))
        if not np.ptp(compared, axis=1).any():
            return None
        if self.metric is None:
            return plain
        return plain._replace(metric=self.metric.part(self.unit.originals[columns], compared))

    def positions(self, arrays, n_frames):
        """Trials on the clock (Eq. 7), in the unit."""
        positions = normalise(arrays, n_frames)
        return self.unit(positions, out=positions)


def _evenly(n, count):
    """Indices of so many of n, evenly spaced, the first and the last among them."""
    return np.round(np.linspace(0, n - 1, count)).astype(np.intp)


class Matcher(NamedTuple):
    """Matches trials to each other: the features that are compared, and the trellis."""

    features: Features
    trellis: Trellis

    @classmethod
    def of(cls, features, compared, settings):
        """The matcher of a training set.

        The weight of changes of pace, ``mu``, is ``smoothness`` times the mean squared norm of the
        features, so that it does not depend on their unit.

        Parameters
        ----------
        features : Features
        compared : ndarray, shape (n_trials, n_frames, n_columns)
            The features of the training set, or of some of it.
        settings : PathSettings
        """
        n_trials, n_frames, _ = compared.shape
        mean = float(features_energy(features, compared) / (n_trials * n_frames))
        unseen = UNSEEN * mean if features.weighs else None
        anchors = features.anchors and features.anchors.on_clock(n_frames, mean)
        mu = settings.smoothness * mean
        return cls(features, _trellis(features.cost, n_frames, mu, settings, unseen, anchors))

    def on_clock(self, features, n_frames, settings):
        """The matcher that is this one but for its features and the frames of its clock."""
        mu, unseen, anchors = self.trellis.mu, self.trellis.unseen, self.trellis.anchors
        anchors = anchors and anchors.at(n_frames)
        return Matcher(features, _trellis(features.cost, n_frames, mu, settings, unseen, anchors))

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
        times = times_of(disparities).astype(costs.dtype)
        typical = costs.sum(axis=1, dtype=np.float64)
        # The base, the other and, (n_exemplars, n_pairs), the exemplars of every pair.
        n, m = np.repeat(np.arange(len(others)), others.shape[1]), others.ravel()
        k = exemplars_of_each(typical, n_exemplars)[:, n]
        voted = vote(times[n, m], times[n, k], times[k, m])
        smoothed = smooth_warps(voted, self.trellis.reach, warp_smoothing)
        return smoothed.reshape(*others.shape, -1)


def features_energy(features, compared):
    """The sum of the squares of features, without columns beside them."""
    plain = features.plain(compared)
    return np.einsum("npk,npk->", plain, plain, dtype=np.float64)


def times_of(disparities):
    """``tau``, in frames, of disparities in frames."""
    return disparities + np.arange(disparities.shape[-1], dtype=np.float64)


def _trellis(cost, n_frames, mu, settings, unseen, anchors):
    return Trellis.on_clock(
        cost,
        n_frames,
        mu,
        max_offset=settings.max_offset,
        max_rate=settings.max_rate,
        unseen=unseen,
        anchors=anchors,
    )


# -- the metric of a training set, which is learnt from matches in a first one --------------------


def learn_features(features, positions, settings, n_exemplars, warp_smoothing):
    """Features with the metric of a training set.

    At most 100 frames of each trial are used, which lose nothing under the smoothing of velocities,
    a share of the clip; they are matched by as many as suffice.

    Parameters
    ----------
    features : Features
        Without a metric.
    positions : ndarray, shape (n_trials, P, n_columns)
        In the unit.
    settings : PathSettings
    n_exemplars : int
    warp_smoothing : float

    Returns
    -------
    tuple (Features, share, energy, Evidence), or None
        Features with the metric, and shares (n_features,) of every feature in what is compared and
        in the energy of velocities. None if there is nothing to learn.
    """
    # Rounding changes a metric much less than noise.
    positions = positions.astype(np.float32, copy=False)
    poses, beside = features.plain(positions), features.beside(positions)
    velocity = cost_features(poses, features.cost, features.velocity_smoothing)
    frames = _evenly(positions.shape[1], min(positions.shape[1], FRAMES))
    few = _evenly(len(frames), features.enough_frames(len(frames)))
    max_rate = min(settings.max_rate, len(few) - 1)
    settings = PathSettings(settings.smoothness, settings.max_offset, max_rate)
    # Where all frames lie among the few.
    within = np.interp(np.arange(len(frames)), few, np.arange(len(few)))

    def match(compared, others):
        compared = np.concatenate([compared, beside], axis=2)[:, few]
        matcher = Matcher.of(features, compared, settings)
        times = matcher.match_others(compared, others, n_exemplars, warp_smoothing)
        times = np.interp(times, np.arange(len(few)), few)
        return evaluate_warps(times, within[np.newaxis, np.newaxis])

    # Which one of a pair is the base does not depend on the order of trials.
    order = np.argsort(np.einsum("npk,npk->n", velocity, velocity), kind="stable")
    rows = np.ix_(order, frames)
    poses, velocity, beside = poses[rows], velocity[rows], beside[rows]
    learnt = metric_of_matches(match, poses, velocity)
    if learnt is None:
        return None
    metric, evidence = learnt
    shares = metric.shares(velocity, poses), energy_shares(velocity)
    return features._replace(metric=metric), *shares, evidence


# -- warps to the pattern ----------------------------------------------------------------------


@dataclass(frozen=True, eq=False)
class Warper:
    """Warps trials to a pattern, in portions and in other processes.

    Attributes
    ----------
    matcher : Matcher
    pattern : ndarray, shape (P, n_features)
        Its poses, in the unit.
    bases : Bases
        Features of the pattern and of the exemplars, in double precision.
    to_exemplars : ndarray, shape (n_exemplars, P)
        Times of the pattern on the clocks of the exemplars.
    smoothing : float or None
        Width of the smoothing of offsets after the vote, as a share of the clip. None: there is
        neither vote nor smoothing.
    finish : Sharpener, Refiner or None
        Changes warps after the vote.
    """

    matcher: Matcher
    pattern: np.ndarray
    bases: Bases
    to_exemplars: np.ndarray
    smoothing: float | None
    finish: Sharpener | Refiner | None = None

    @classmethod
    def to_pattern(cls, matcher, positions, smoothing):
        """The warper to a pattern, by way of exemplars.

        Parameters
        ----------
        matcher : Matcher
        positions : ndarray, shape (1 + n_exemplars, P, n_columns)
            The pattern and its exemplars, in the unit and in double precision.
        smoothing : float or None
        """
        bases = Bases(matcher.trellis, matcher.features(positions))
        pattern = matcher.features.plain(positions)[0]
        disparities = matcher.trellis.paths(bases.sequences[:1], bases.sequences[1:])
        return cls(matcher, pattern, bases, times_of(disparities)[0], smoothing)

    def positions(self, arrays):
        """Trials in the unit on the clock (Eq. 7), in double precision.

        There rounding decides nothing, so that the warp of a trial does not depend on the others.
        """
        arrays = [x.astype(np.float64, copy=False) for x in arrays]
        return self.matcher.features.positions(arrays, len(self.pattern))

    def warps(self, positions):
        """Warps of trials: match, vote, smooth and finish.

        Parameters
        ----------
        positions : ndarray, shape (n_trials, P, n_columns)
            Trials on the clock, in the unit.

        Returns
        -------
        distances : ndarray, shape (n_trials,)
            Of the direct paths.
        times : ndarray, shape (n_trials, P)
            ``tau``.
        """
        distances, times = self._matched(self.matcher.features(positions))
        if self.finish is not None:
            poses = self.matcher.features.plain(positions)
            times = self.finish(poses, times, self.matcher.trellis.reach)
        return distances, times

    def _matched(self, moving, coupling=None):
        """Distances of direct paths, and voted and smoothed times, of features of trials."""
        trellis, bases, base = self.matcher.trellis, self.bases, self.bases.sequences[0]
        disparities = trellis.paths(bases, moving, coupling=coupling)
        distances = trellis.costs(base, moving, disparities[0])
        routes = _towards(bases, times_of(disparities), coupling)
        if self.smoothing is None:
            return distances, routes[0]
        voted = vote(routes[0], self.to_exemplars[:, np.newaxis], routes[1:])
        if coupling is None:
            times = smooth_warps(voted, trellis.reach, self.smoothing)
        else:
            share, offsets = _share(bases, coupling), coupling.offsets[0]
            times = smooth_warps(voted, trellis.reach, self.smoothing, share * offsets)
            # A strong coupling leaves nothing, also where the given warp is steeper than a path.
            times += share**2 * (offsets + np.arange(times.shape[1]) - times)
        # A path without any distance is right: the pattern keeps its own pace.
        seen = distances
        if trellis.unseen is not None:
            seen = trellis.costs(base, moving, disparities[0], unseen=0.0)
        rounding = 64 * np.finfo(moving.dtype).eps * bases.energy[0]
        return distances, np.where((seen <= rounding)[:, np.newaxis], routes[0], times)

    def direct_warps(self, positions):
        """Warps of trials by their direct paths alone, smoothed: (n_trials, P)."""
        trellis, moving = self.matcher.trellis, self.matcher.features(positions)
        disparities = trellis.paths(self.bases.sequences[:1], moving)
        return smooth_warps(times_of(disparities)[0], trellis.reach, self.smoothing)

    def uncertainty(self, positions, times):
        """The `Uncertainty` of the warps of trials.

        Parameters
        ----------
        positions : ndarray, shape (n_trials, P, n_columns)
            Trials on the clock, in the unit.
        times : ndarray, shape (n_trials, P)
            Their warps.
        """
        base, moving = self.bases.sequences[:1], self.matcher.features(positions)
        by_paths = uncertainty_of_paths(self.matcher, base, moving, times)
        if not isinstance(self.finish, Refiner):
            return by_paths
        errors = self.finish.standard_errors(self.matcher.features.plain(positions), times)
        normal = np.ones(len(times), dtype=bool)
        return by_paths._replace(half_widths=ndtri(0.95) * errors, is_normal=normal)

    def disparity_space(self, positions):
        """E(p, d) of the pattern and one trial at the pattern's rate (Eq. 12), and the path.

        Returns
        -------
        frames, offsets : ndarray
            Those of the costs: all of them, or evenly spaced ones of many.
        costs : ndarray, shape (n_frames, n_offsets)
            NaN where no path may pass.
        path : ndarray, shape (P,)
        """
        trellis, moving = self.matcher.trellis, self.matcher.features(positions)
        base, width = self.bases.sequences[0], trellis.width
        lows, highs = map(np.array, trellis.windows(len(base)))
        every = math.ceil(math.sqrt(len(base) * (2 * width + 1) / BATCH_NUMBERS))
        frames = np.arange(0, len(base), every)
        offsets = every * np.arange(-(width // every), width // every + 1)
        costs = np.full((len(frames), len(offsets)), np.nan)
        for row, p in zip(costs, frames, strict=True):
            inside = (lows[p] <= offsets) & (offsets <= highs[p])
            window = moving[0, p + offsets[inside]]
            squares = np.square((base[p] - window)[..., trellis.plain]).sum(axis=1)
            row[inside] = trellis.weighed(squares, base[p], window)
        path = trellis.paths(base[np.newaxis], moving)[0, 0]
        return frames, offsets, costs, path


# -- the warper of a part -----------------------------------------------------------------

# A part with so strong a coupling has the warp of the body; a stronger one overflows.
_RIGID = 1e6


@dataclass(frozen=True, eq=False)
class PartWarper(Warper):
    """Warps some features to the pattern of the whole body, by way of its exemplars.

    Attributes
    ----------
    columns : ndarray of int
        The features.
    weight : float
        Of the coupling, in squared features of a frame per squared frame.
    back : ndarray, shape (1 + n_exemplars, P)
        Inverse warps of the body from the bases: the frame of the pattern that each of their frames
        meets.
    """

    columns: np.ndarray = field(kw_only=True)
    weight: float = field(kw_only=True)
    back: np.ndarray = field(kw_only=True)

    @classmethod
    def of(cls, columns, body, times, on_clock, chosen, coupling, settings):
        """The warper of a part; None if the part does not move.

        Parameters
        ----------
        columns : ndarray of int
            Features of the part.
        body : Warper
            Of the whole body.
        times : ndarray, shape (1 + n_exemplars, P)
            The body's warps of the pattern and its exemplars.
        on_clock, chosen : ndarray, shape (n_trials, P, n_features)
            The training set, and the pattern and its exemplars in double precision: whole, not in
            the unit.
        coupling : float
            ``lambda``, in mean squared features of the part, per squared per cent of the clock.
        settings : PathSettings
        """
        features = body.matcher.features.part(columns, on_clock)
        if features is None:
            return None
        compared = features(features.unit(on_clock[:, :, columns]))
        matcher, n_frames = Matcher.of(features, compared, settings), len(body.pattern)
        energy = np.square(compared).sum(axis=2, dtype=np.float64).mean()
        weight = float(min(coupling, _RIGID) * energy * (100 / (n_frames - 1)) ** 2)
        frames, positions = np.arange(n_frames), features.unit(chosen[:, :, columns])
        bases = Bases(matcher.trellis, features(positions))
        to_exemplars = Coupling(weight, times[np.newaxis, 1:] - frames) if weight else None
        disparities = matcher.trellis.paths(
            bases.sequences[:1], bases.sequences[1:], coupling=to_exemplars
        )
        return cls(
            matcher,
            features.plain(positions)[0],
            bases,
            _towards(bases, times_of(disparities), to_exemplars)[0],
            body.smoothing,
            columns=columns,
            weight=weight,
            back=np.stack([np.interp(frames, t, frames) for t in times]),
        )

    def positions(self, arrays):
        """Whole trials on the clock, in double precision, not in the unit."""
        arrays = [x.astype(np.float64, copy=False) for x in arrays]
        return normalise(arrays, len(self.pattern))

    def warps(self, positions, body_times):
        """Distances of the direct paths to the pattern, and times ``tau``, of some trials.

        The coupling draws the paths. Its costs do not count for the distances.

        Parameters
        ----------
        positions : ndarray, shape (n_trials, P, n_features)
            Whole trials on the clock, in double precision, not in the unit.
        body_times : ndarray, shape (n_trials, P)
            The warps of the whole bodies.
        """
        features = self.matcher.features
        moving = features(features.unit(positions[:, :, self.columns]))
        return self._matched(moving, self._coupling(body_times))

    def _coupling(self, body_times):
        """The coupling of the paths from all bases; None if there is none.

        A path from the pattern is coupled to the body's warp, and one from an exemplar to the
        body's warp from there.
        """
        if not self.weight:
            return None
        at = np.broadcast_to(self.back[:, np.newaxis], (len(self.back), *body_times.shape))
        from_bases = evaluate_warps(np.broadcast_to(body_times, at.shape), at)
        return Coupling(self.weight, from_bases - np.arange(body_times.shape[1]))


def _towards(bases, times, coupling):
    """Times (n_bases, n_trials, P) of coupled paths, between the steps of the trellis.

    Of the distance to the given offsets, half a step at most, they go the share of the coupling.
    """
    if coupling is None:
        return times
    distance = coupling.offsets + np.arange(times.shape[-1]) - times
    return times + _share(bases, coupling) * np.clip(distance, -0.5, 0.5)


def _share(bases, coupling):
    """The share w / (w + c) of a coupling of weight w, for features of mean squared slope c."""
    slope = np.square(np.diff(bases.sequences, axis=1)).sum(axis=2).mean(dtype=np.float64)
    return coupling.weight / (coupling.weight + slope)
