"""Dissimilarity of trials to training trials, and which of these are kept."""

import warnings
from dataclasses import dataclass, field, replace
from typing import NamedTuple

import numpy as np

from ..inputs.wording import counted
from ..matching.filters import smooth
from ..matching.gaps import fill_with_mean, is_gappy
from ..matching.warps import even_slices
from ..synchronizers.learning import SynchronizationWarning
from ..utils.groups import encode_groups, mean_of_others, sums_of_groups
from ..utils.parallel import one_blas_thread
from .acceptance import DISSIMILARITY_VARIANCE, LEAST, LogMoments, log_moments
from .variation import within_variance

# A dissimilarity is the mean over so many nearest neighbours: a single one may be an outlier.
_N_NEAREST, _N_NEAREST_LEARNT = 2, 3
# Weight of the mean pose: people stand differently, but an action elsewhere is another action.
# Where it is learnt it is at most this.
_MEAN_WEIGHT = 0.1
# The share of a typical dissimilarity that mean poses make: of people among each other, and of
# the trials of a person, whose mean pose tells more.
_MEAN_SHARE, _OWN_MEAN_SHARE = 0.05, 0.2
# The least variance of a feature that is weighted, as a share of the largest.
_LEAST_VARIANCE = 0.01
# Standard deviation of the Gaussian under which velocities are estimated, as a share of the clock.
_VELOCITY_SMOOTHING = 0.01
# Standing still has the dissimilarity 1 and is never accepted.
_STILL_LIMIT = 1 - 1e-6
# Trials compared at a time: bounds the memory. Matrix products take rows in tiles of one
# size, so that no result depends on the other trials.
_BATCH, _TILE = 64, 8
# Most trials that are kept: the time of a prediction is proportional to their number.
_MAX_KEPT = 64
# The golden ratio's fractional part in 64 bits: its multiples modulo 1 are evenly spread.
_GOLDEN = np.uint64(0x9E3779B97F4A7C15)
_LATER = np.uint64(1 << 63)


def distances_by_products(a, b):
    """Squared distances (n, n_known) of rows: faster for many trials."""
    squares = np.square(a).sum(axis=1)[:, np.newaxis] + np.square(b).sum(axis=1)
    tiles = np.zeros((-(-len(a) // _TILE), _TILE, a.shape[1]))
    tiles.reshape(-1, a.shape[1])[: len(a)] = a
    # Products of eight rows are too small to be shared by threads.
    with one_blas_thread():
        products = (tiles @ b.T).reshape(-1, len(b))[: len(a)]
    return np.maximum(squares - 2 * products, 0)


def distances_by_differences(a, b):
    """The same, exact for near ones."""
    return np.stack([_norms(a - row) for row in b], axis=1)


def _norms(a):
    return np.vecdot(a, a)


def _velocities(trials):
    return smooth(trials, _VELOCITY_SMOOTHING * (trials.shape[1] - 1), order=1)


class Weights(NamedTuple):
    """What counts how much in a dissimilarity.

    Attributes
    ----------
    scale : ndarray (n_features,) or float, default=1
        The factor of each feature.
    mean : float, default=0.1
        The weight of the squared distance of mean poses.
    n_nearest : int, default=2
        A dissimilarity is the mean over so many nearest neighbours.
    """

    scale: np.ndarray | float = 1.0
    mean: float = _MEAN_WEIGHT
    n_nearest: int = _N_NEAREST


_FIXED = Weights()


def learn_weights(trials, groups, within_groups=False):
    """Weights by how trials of an action differ.

    A feature has the factor ``v^(-1/4)``, where v is its variance among trials less their own
    mean pose, averaged over the frames: deviations where people agree count more. Mean poses
    make a twentieth of a typical dissimilarity, where their weight would not exceed a tenth.

    Parameters
    ----------
    trials : ndarray (n, P, n_features), float64
        Without gaps.
    groups : ndarray of int (n,)
    within_groups : bool, default=False
        Weights to compare a trial with others of its group, instead of those of other groups:
        features have equal factors, mean poses make a fifth, and the nearest one decides alone.

    Returns
    -------
    Weights
    """
    n, n_frames, _ = trials.shape
    share, n_nearest = (_OWN_MEAN_SHARE, 1) if within_groups else (_MEAN_SHARE, _N_NEAREST_LEARNT)
    energies, floor = movement_energies(trials)
    if energies.max() <= floor:
        # All stand still: mean poses alone tell them apart.
        return Weights(n_nearest=n_nearest)
    means = trials.mean(axis=1)
    moved = trials - means[:, np.newaxis]
    variance = moved.var(axis=0).mean(axis=0)
    largest = variance.max()
    scale = np.ones(len(variance))
    if not within_groups and largest > LEAST * np.square(moved).mean():
        scale = (largest / np.maximum(variance, _LEAST_VARIANCE * largest)) ** 0.25
    moved, means = (moved * scale).reshape(n, -1), means * scale
    is_pair = np.triu((groups[:, np.newaxis] == groups) == within_groups, 1)
    apart, offset = (
        distances_by_products(x, x)[is_pair] for x in (moved, means - means.mean(axis=0))
    )
    norms = _norms(moved)
    energy = np.maximum((norms[:, np.newaxis] + norms)[is_pair], floor * n_frames)
    typical, of_means = (np.median(x / energy) for x in (apart, offset))
    # So they do where movements do not differ.
    differ = typical > LEAST and of_means > 0
    weight = share * typical / (n_frames * of_means) if differ else _MEAN_WEIGHT
    return Weights(scale, float(min(weight, _MEAN_WEIGHT)), n_nearest)


class Neighbours:
    """Training trials that others are compared with.

    The dissimilarity of two trials is the mean of ``|y - y_i|^2 / (|y|^2 + |y_i|^2)`` of
    poses less their own mean over time, and of the same ratio of features: 0 for equal ones, 1
    if one of them stands still, 2 for opposite ones. The weighted squared distance of the mean
    poses is added to the first numerator.

    Parameters
    ----------
    trials : ndarray (n_kept, P, n_features), float64
    groups : ndarray of int (n_kept,)
    features : callable, default=velocities
        Makes features (n, P, n_compared) of trials (n, P, n_features).
    distances : callable, default=distances_by_products
        Squared distances of rows.
    mean : ndarray (P, n_features), default=None
        The mean trial, by which gaps (NaN) of trials are filled for their velocities
        and means. What was not seen of both trials of a pair counts in no sum of theirs.
    weights : Weights, default=Weights()

    Attributes
    ----------
    stand_still : bool
        Whether no training trial moves: then only poses are compared.
    """

    def __init__(
        self,
        trials,
        groups,
        features=_velocities,
        distances=distances_by_products,
        mean=None,
        weights=_FIXED,
    ):
        self._groups, self._features, self._distances = groups, features, distances
        self._mean, self._seen, self._weights = mean, None, weights
        if mean is not None and is_gappy(trials):
            self._seen = ~np.isnan(trials)
            trials = fill_with_mean(trials, mean)
        self._center = weights.scale * trials.mean(axis=(0, 1))
        self._known = self._parts(trials)
        energy, floor = movement_energies(weights.scale * trials)
        self.stand_still = bool(energy.max() <= floor)
        self._floor = floor * trials.shape[1]

    def dissimilarity(self, trials, groups=None):
        """Mean dissimilarity of trials to their nearest neighbours.

        Parameters
        ----------
        trials : sequence of ndarray (P, n_features)
        groups : ndarray of int (n,), default=None
            Their groups: then only neighbours of other groups count.

        Returns
        -------
        ndarray (n,)
        """
        dissimilarities = np.empty(len(trials))
        for rows in even_slices(len(trials), _BATCH):
            batch = np.asarray(trials[rows], dtype=np.float64)
            # The path of a trial depends on no other one.
            gaps = np.full(len(batch), self._seen is not None)
            if self._mean is not None:
                gaps |= np.isnan(batch.sum(axis=(1, 2)))
            ratios = np.empty((len(batch), len(self._groups)))
            if not gaps.all():
                ratios[~gaps] = self._ratios(batch[~gaps])
            for i in np.flatnonzero(gaps):
                ratios[i] = self._ratios_of_seen(batch[i])
            if groups is not None:
                ratios[groups[rows, np.newaxis] == self._groups] = np.inf
            nearest = np.sort(ratios, axis=1)[:, : self._weights.n_nearest]
            counts = np.isfinite(nearest)
            dissimilarities[rows] = np.where(counts, nearest, 0).sum(axis=1) / counts.sum(axis=1)
        return dissimilarities

    def limit(self, moments, coverage):
        """Largest dissimilarity that a share of new trials is expected to have.

        Parameters
        ----------
        moments : LogMoments
            Of the dissimilarities of trials to neighbours of other groups.
        coverage : float

        Returns
        -------
        float
            Below that of standing still, unless no training trial moves.
        """
        limit = moments.upper_limit(coverage, DISSIMILARITY_VARIANCE)
        return limit if self.stand_still else min(limit, _STILL_LIMIT)

    def _ratios(self, trials):
        """Dissimilarities of trials (n, P, n_features) to each neighbour: (n, n_kept)."""
        poses, energy, features, power = self._parts(trials)
        known_poses, known_energy, known_features, known_power = self._known
        apart = self._distances(poses, known_poses)
        if self.stand_still:
            return apart * LEAST / self._floor
        ratios = apart / np.maximum(energy[:, np.newaxis] + known_energy, self._floor)
        # Where neither moves, the distance is 0, too.
        sums = np.maximum(power[:, np.newaxis] + known_power, np.finfo(float).tiny)
        ratios += self._distances(features, known_features) / sums
        return ratios / 2

    def _ratios_of_seen(self, trial):
        """The same of one trial, (n_kept,), in sums over what was seen of both of a pair."""
        seen = ~np.isnan(trial)
        filled = fill_with_mean(trial[np.newaxis], self._mean)
        poses, _, features, _ = self._parts(filled)
        known_poses, _, known_features, _ = self._known
        n_kept, width = len(known_poses), trial.shape[1]
        both = np.broadcast_to(
            seen if self._seen is None else seen & self._seen, (n_kept, *seen.shape)
        )
        weights = both.reshape(n_kept, -1)
        moved, energy = _sums_over(weights, poses[:, :-width], known_poses[:, :-width])
        changed, power = _sums_over(weights, features, known_features)
        # Mean poses count by the share of the frames that are compared.
        shares = both.mean(axis=1)
        offsets = poses[:, -width:] - known_poses[:, -width:]
        moved += (shares * np.square(offsets)).sum(axis=1)
        if self.stand_still:
            ratios = 2 * moved * LEAST / self._floor
        else:
            ratios = moved / np.maximum(energy, self._floor)
            ratios += changed / np.maximum(power, np.finfo(float).tiny)
        return np.where(shares.any(axis=1), ratios / 2, np.inf)

    def _parts(self, trials):
        """Centred poses beside their weighted mean, features, and the squared norms of both."""
        n, n_frames, _ = trials.shape
        trials = self._weights.scale * trials
        mean = trials.mean(axis=1)
        moved = (trials - mean[:, np.newaxis]).reshape(n, -1)
        offset = np.sqrt(self._weights.mean * n_frames) * (mean - self._center)
        features = self._features(trials).reshape(n, -1)
        return np.hstack([moved, offset]), _norms(moved), features, _norms(features)


class PersonalReference:
    """Neighbours made of a person's own trials, and how alike people repeat themselves.

    Few trials tell a person's mean with an error, the variance within people over their
    number m. Therefore the mean of the own trials is moved towards that of all people,
    feature by feature: its deviation from that has the factor ``b / (b + w / m)``, with the
    variances ``b`` between and ``w`` within people (the posterior mean of normal distributions).

    Parameters
    ----------
    training : ndarray (n_kept, P, n_features), float64
        Training trials that are kept; NaN in gaps.
    groups : ndarray of int (n_kept,)
        The person of each.
    mean : ndarray (P, n_features)
        Of all training trials.
    reference : ndarray (m, P, n_features)
        Of the person; NaN in gaps.

    Attributes
    ----------
    moments : LogMoments
        Of the dissimilarities of training trials to m others of the same person.
    held_out : ndarray (n_kept,)
        These dissimilarities; NaN for people with one trial.
    """

    def __init__(self, training, groups, mean, reference):
        codes = np.unique(groups, return_inverse=True)[1].ravel()
        counts = np.bincount(codes)
        if counts.max() < 2:
            raise ValueError(
                "reference needs to know how people repeat themselves, but no group of the "
                "training set has two trials: give groups to fit, and several trials "
                "of some people."
            )
        filled = fill_with_mean(training, mean)
        self._mean, self._weights = mean, learn_weights(filled, codes, within_groups=True)
        self._within = within_variance(training, codes).mean(axis=0)
        sums, sizes = sums_of_groups(filled, codes)
        of_means = (sums / sizes).var(axis=0, ddof=1).mean(axis=0)
        self._between = np.maximum(of_means - self._within * (1 / counts).mean(), 0)
        self._neighbours = self._near(reference, mean)
        of_others = mean_of_others(filled, codes)
        self.held_out = np.full(len(training), np.nan)
        for i, code in enumerate(codes):
            same = np.flatnonzero(codes == code)
            # The next ones, the first after the last.
            count = min(len(reference), len(same) - 1)
            others = np.roll(same, -1 - np.searchsorted(same, i))[:count]
            if len(others):
                near = self._near(training[others], of_others[i])
                self.held_out[i] = near.dissimilarity(training[[i]])[0]
        self.moments = log_moments(self.held_out[np.isfinite(self.held_out)])

    def dissimilarity(self, trials):
        """Dissimilarity of trials to the most similar own one, (n,)."""
        return self._neighbours.dissimilarity(trials)

    def limit(self, coverage):
        """Largest dissimilarity that a share of the person's trials is expected to have."""
        return self._neighbours.limit(self.moments, coverage)

    def _near(self, reference, mean):
        """Neighbours of trials of one person, moved towards the mean of other people."""
        reference = fill_with_mean(reference, self._mean)
        ratio = self._between / (self._between + self._within / len(reference))
        moved = reference + (ratio - 1) * (reference.mean(axis=0) - mean)
        one = np.zeros(len(reference), dtype=np.intp)
        return Neighbours(moved, one, mean=self._mean, weights=self._weights)


def warn_of_reference(is_refused):
    """Warn if most trials of a person's reference (n,) are no right ones themselves."""
    if is_refused.mean() > 0.5:
        refused = ", ".join(map(str, np.flatnonzero(is_refused)))
        warnings.warn(
            f"Of the reference, {counted(int(is_refused.sum()), 'trial')} of {len(is_refused)} "
            f"would be refused without one (numbers {refused}). What is like them is accepted: "
            "give right trials of the person, or no reference.",
            SynchronizationWarning,
            stacklevel=3,
        )


def _sums_over(weights, a, b):
    """Squared distances of a row (1, m) and rows (n, m), and the sums of their squared norms."""
    distances = np.vecdot(weights, np.square(a - b))
    return distances, np.vecdot(weights, np.square(a) + np.square(b))


def movement_energies(on_clock, floor=None):
    """Mean squared distance of a trial's poses from their own mean pose.

    Parameters
    ----------
    on_clock : ndarray (n_sequences, P, n_features)
        NaN in gaps: the mean is that of what was seen, feature by feature.
    floor : float, default=None
        The energy of standing still; by default a billionth of the variance of all poses.

    Returns
    -------
    ndarray (n_sequences,)
        At least ``floor``.
    floor : float
        Above 0.
    """
    on_clock = np.asarray(on_clock, dtype=np.float64)
    energy, variance = _energies_of_seen(on_clock)
    if floor is None:
        rounding = np.square(64 * np.finfo(float).eps * np.nanmax(np.abs(on_clock)))
        floor = max(LEAST * variance, rounding * on_clock.shape[2], np.finfo(float).tiny)
    return np.maximum(energy, floor), float(floor)


def _energies_of_seen(on_clock):
    """Energies (n,) of trials, and the variance of all poses, by what was seen.

    A feature that a trial never shows has the share of the energy that it has in the others.
    """
    seen = ~np.isnan(on_clock)
    values, counts = np.where(seen, on_clock, 0), seen.sum(axis=1)
    means = values.sum(axis=1) / np.maximum(counts, 1)
    squares = np.where(seen, np.square(values - means[:, np.newaxis]), 0).sum(axis=1)
    shown = counts > 0
    of_features = np.where(shown, squares / np.maximum(counts, 1), 0)
    usual = of_features.sum(axis=0) / np.maximum(shown.sum(axis=0), 1)
    share = np.where(shown, usual, 0).sum(axis=1) / (usual.sum() or 1.0)
    centre = values.sum(axis=(0, 1)) / np.maximum(counts.sum(axis=0), 1)
    apart = np.where(seen, np.square(values - centre), 0).sum(axis=(0, 1))
    variance = (apart / np.maximum(counts.sum(axis=0), 1)).sum()
    return of_features.sum(axis=1) / np.where(share > 0, share, 1), variance


# -- trials that come one after the other: moments of all, and a sample of them --------


@dataclass(frozen=True, eq=False)
class TrialStream:
    """Mean and variance of trials, and a sample of at most 64 of them.

    All but ``dropped`` is the same, to the last bit, however trials are divided into portions.

    Attributes
    ----------
    origin : ndarray, shape (P, n_features), float64
        The first trial. Moments are those of differences from it, which are small.
    mean_offset, squares : ndarray, shape (P, n_features), float64
        Mean of all less the origin, and the sum of squared deviations from the mean.
    kept : ndarray, shape (n_kept, P, n_features)
        One of every group, then evenly spread; in order.
    n, n_groups : int
        Number of trials, and of their groups.
    counts : ndarray of int, shape (P, n_features)
        How many of them show each value.
    labels : tuple of pairs
        Labels of groups, and their numbers from 0 in the order of first appearance.
    groups : ndarray of int, shape (n_kept,)
        The groups of the trials that are kept.
    priorities : ndarray of uint64, shape (n_kept,)
        Those with the lowest are kept.
    dropped : LogMoments
        Of the dissimilarities of trials that are no longer kept.
    """

    origin: np.ndarray
    mean_offset: np.ndarray
    squares: np.ndarray
    counts: np.ndarray
    kept: np.ndarray
    n: int = 0
    n_groups: int = 0
    labels: tuple = ()
    groups: np.ndarray = field(default_factory=lambda: np.array([], dtype=np.intp))
    priorities: np.ndarray = field(default_factory=lambda: np.array([], dtype=np.uint64))
    dropped: LogMoments = field(default_factory=LogMoments)

    @classmethod
    def starting_at(cls, first):
        """An empty stream with a trial (P, n_features) as its origin."""
        zeros, origin = np.zeros(first.shape), first.astype(np.float64)
        seen = ~np.isnan(origin)
        means = np.nansum(origin, axis=0) / np.maximum(seen.sum(axis=0), 1)
        origin = np.where(seen, origin, means)
        counts, kept = zeros.astype(np.intp), np.empty((0, *first.shape), first.dtype)
        return cls(origin, zeros, zeros, counts, kept)

    @property
    def mean(self):
        """Of all trials, (P, n_features); NaN where none shows anything."""
        return np.where(self.counts > 0, self.origin + self.mean_offset, np.nan)

    @property
    def variance(self):
        """Of all trials at every pose, (P, n_features), divided by their number."""
        return np.where(self.counts > 0, self.squares / np.maximum(self.counts, 1), np.nan)

    @property
    def missing(self):
        """The share (P, n_features) of the trials that do not show a value."""
        return (self.n - self.counts) / self.n

    def extend(self, trials, groups=None):
        """The stream after more trials.

        Parameters
        ----------
        trials : sequence of ndarray (P, n_features)
        groups : array-like (n_sequences,), default=None
            None: each trial is a group of its own.

        Returns
        -------
        stream : TrialStream
            With the same ``dropped``.
        codes : ndarray of int, shape (n_sequences,)
            Groups of the trials.
        is_kept : ndarray of bool, shape (n_kept_before + n_sequences,)
            Which of those kept before, and of these, are kept now.
        """
        codes, given = encode_groups(groups, len(trials))
        labels, n_groups = dict(self.labels), self.n_groups
        if groups is None:
            codes, n_groups = codes + n_groups, n_groups + len(codes)
        else:
            for label in given:
                labels.setdefault(label, len(labels) + n_groups - len(self.labels))
            codes = np.array([labels[label] for label in given])[codes]
            n_groups += len(labels) - len(self.labels)
        priorities = np.concatenate([self.priorities, self._priorities(codes)])
        chosen = np.sort(np.argsort(priorities, kind="stable")[:_MAX_KEPT])
        is_kept, n_before = np.zeros(len(priorities), dtype=bool), len(self.kept)
        is_kept[chosen] = True
        moments = self._add(trials)
        stream = replace(self, n_groups=n_groups, labels=tuple(labels.items()), **moments)
        # Double precision as soon as any trial has it.
        dtype = np.result_type(self.kept, trials[0])
        if is_kept[n_before:].any() or self.kept.dtype != dtype:
            old = [self.kept[i] for i in chosen[chosen < n_before]]
            new = [trials[i - n_before] for i in chosen[chosen >= n_before]]
            kept = np.stack(old + new).astype(dtype, copy=False)
            groups = np.concatenate([self.groups, codes])[chosen]
            stream = replace(stream, kept=kept, groups=groups, priorities=priorities[chosen])
        return stream, codes, is_kept

    def _priorities(self, codes):
        """Priorities of new trials of these groups.

        The first trial of every group has priority over all others. Firsts are spread over
        the groups, others over all trials.
        """
        groups, first = np.unique(codes, return_index=True)
        is_first = np.zeros(len(codes), dtype=bool)
        is_first[first[groups >= self.n_groups]] = True
        numbers = np.where(is_first, codes, np.arange(self.n, self.n + len(codes)))
        priorities = numbers.astype(np.uint64) * _GOLDEN >> np.uint64(1)
        return np.where(is_first, priorities, priorities | _LATER)

    def _add(self, trials):
        """Number, mean and squares with more trials, by Welford's recurrence."""
        mean, squares, counts = self.mean_offset.copy(), self.squares.copy(), self.counts.copy()
        for x in trials:
            offset = x - self.origin
            seen = ~np.isnan(offset)
            counts += seen
            # A step of 0 changes neither.
            offset = np.where(seen, offset, mean)
            step = offset - mean
            mean += step / np.maximum(counts, 1)
            squares += step * (offset - mean)
        n = self.n + len(trials)
        return {"n": n, "mean_offset": mean, "squares": squares, "counts": counts}
