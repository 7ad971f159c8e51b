"""Dissimilarity of windows of a take to training trials, and its threshold."""

import numpy as np
from scipy.signal import lfilter
from scipy.stats import norm

from ..matching.counting import first_largest
from ..matching.filters import SMOOTHING, smooth
from ..matching.warps import even_slices, normalise
from ..model.acceptance import LEAST, LogMoments, log_moments
from ..model.similarity import Neighbours, distances_by_differences, movement_energies
from ..utils.groups import encode_groups

# Weight of the squared standard scores of length and energy in the logarithm of the dissimilarity.
_LENGTH_ENERGY_WEIGHT = 0.05
# Largest logarithm of the factor by which they raise it.
_MAX_LOG_FACTOR = 3.0
# Standing still has the dissimilarity 1. The upper limit keeps the threshold below it, however much
# people differ; the lower one allows for noise in takes and windows that begin at whole frames.
_MAX_THRESHOLD, _MIN_THRESHOLD = 0.7, 0.1
# The threshold of a single trial, of which no variation can be learnt.
_DEFAULT_THRESHOLD = 0.5
# Random movements, and the share of them that may lie below the threshold.
_N_RANDOM, _RANDOM_QUANTILE = 1000, 0.005
# The threshold of a take is the best of so many, down to this factor of the limit. Each hit costs
# this share of the trials that are found, and each window about the threshold, in a Gaussian
# of this width of logarithms.
_N_THRESHOLDS, _LOWEST = 200, np.exp(-1.5)
_COST_OF_HIT, _COST_ABOUT, _ABOUT = 0.02, 0.1, 0.05
# Takes of more typical lengths than these have costs in proportion: one in which the action is
# repeated without end keeps the limit, as its hits cost at most 0.02 * 45 of what they gain.
_LONG_TAKE = 45
# Hits are so many times less dissimilar than trials cut out by hand, as their ends are moved
# to where they are least (1.3 to 1.7 for half of 55 actions of people, by medians).
_BY_ENDS = 1.5
# Windows that are compared at a time, which bounds the memory.
_WINDOW_BATCH = 256
# Largest number of positions of a window.
_MAX_POSITIONS = 100


def example_indices(synchronizer):
    """Indices in the training set of the examples that the synchronizer keeps, evenly spaced."""
    n_trials, n_examples = len(synchronizer.lengths_), len(synchronizer.examples_)
    return np.linspace(0, n_trials - 1, n_examples).round().astype(np.intp)


class WindowDissimilarity:
    """Dissimilarity of windows to training trials: 0 equal, 1 as that of standing still.

    The mean over the two most similar training trials of::

        r(y, y_i) = |y - y_i|^2 / (|y|^2 + |y_i|^2),

    half of poses less their own mean over time, to which a tenth of the squared distance of
    these means is added, half of the features of the synchronizer; times e to a twentieth of the
    squared standard scores of the logarithms of length and energy.

    Parameters
    ----------
    synchronizer : fitted Synchronizer
    groups : array-like (n_examples,), default=None
        Of the training trials that it keeps; by default each is its own.

    Attributes
    ----------
    known : ndarray (n_examples,)
        That of the training trials, each compared with those of other groups.
    """

    def __init__(self, synchronizer, groups=None):
        lengths, examples = synchronizer.lengths_, synchronizer.examples_
        n_frames = synchronizer.n_frames_
        self._n_positions = min(n_frames, _MAX_POSITIONS)
        # The features at the pace of so many positions.
        pace = (self._n_positions - 1) / (n_frames - 1)
        self._features = synchronizer.features_._replace(pace=pace)
        self._length = LogMoments.of(lengths).standardize
        self._typical_length = np.exp(np.log(lengths).mean())
        count = len(examples)
        positions = self._positions(examples)
        energy, self._floor = movement_energies(positions)
        if energy.max() <= self._floor:
            raise ValueError(
                "The pattern does not move: it fits every moment of a take in which nothing moves. "
                "Give a pattern that moves, or fit on trials that do."
            )
        self._energy = LogMoments.of(energy).standardize
        codes, _ = encode_groups(groups, count, at_least=min(count, 2))
        self._neighbours = Neighbours(positions, codes, self._features, distances_by_differences)
        self._training, self.known = positions, np.empty(0)
        if count > 1:
            self.known = self._measure(positions, lengths[example_indices(synchronizer)], codes)

    def threshold(self, coverage):
        """The dissimilarity below which a share of the trials of new people lies.

        It is at most that of random movements.
        """
        if not len(self.known):
            return _DEFAULT_THRESHOLD
        learnt = min(log_moments(self.known).upper_limit(coverage), _MAX_THRESHOLD)
        portions = even_slices(_N_RANDOM, _WINDOW_BATCH)
        counts = [portion.stop - portion.start for portion in portions]
        of_random = [
            self._measure(movements, np.full(len(movements), self._typical_length))
            for movements in random_movements(self._training, counts)
        ]
        limit = float(np.quantile(np.concatenate(of_random), _RANDOM_QUANTILE))
        return max(min(learnt, limit), _MIN_THRESHOLD)

    def threshold_of_take(self, limit, hits, n_frames):
        """The threshold of a take: the limit, or a lower one where many windows are below it.

        It maximises the share of trials that are found, less costs of windows::

            Phi(z(1.5 T)) - (0.02 #{u < T} + 0.1 sum exp(-log(u / T)^2 / (2 * 0.05^2))) / n

        with the dissimilarities u (n_hits,) of the windows of the take that do not overlap, and
        standard scores z of logarithms among training trials. So it rejects what many windows are
        as similar as, and lies in a gap where there is one. n is 1, and grows with takes beyond 45
        typical lengths. The limit is that of ``threshold``.
        """
        if not len(self.known):
            return limit
        lowest = min(max(_LOWEST * limit, _MIN_THRESHOLD), limit)
        levels = np.geomspace(limit, lowest, _N_THRESHOLDS)
        apart = np.log(np.maximum(hits, LEAST)[:, np.newaxis] / levels)
        costs = _COST_OF_HIT * (apart < 0).sum(axis=0)
        costs += _COST_ABOUT * np.exp(-np.square(apart / _ABOUT) / 2).sum(axis=0)
        costs /= max(n_frames / (_LONG_TAKE * self._typical_length), 1)
        gains = norm.cdf(log_moments(self.known).standardize(_BY_ENDS * levels)) - costs
        # Of equally good ones the highest.
        return float(levels[first_largest(gains)])

    def __call__(self, take, windows, pace=1.0):
        """The dissimilarity of windows (n_windows, 2), start and stop, of a take.

        The pace is the number of its frames in a frame of the training trials.
        """
        out = np.empty(len(windows))
        for rows in even_slices(len(windows), _WINDOW_BATCH):
            positions = self._positions([take[start:stop] for start, stop in windows[rows]])
            lengths = (windows[rows, 1] - windows[rows, 0] - 1) / pace + 1
            out[rows] = self._measure(positions, lengths)
        return out

    def _positions(self, trials):
        """Trials at all positions, in the unit of the features, in double precision."""
        arrays = [np.asarray(x, dtype=np.float64) for x in trials]
        return self._features.unit(normalise(arrays, self._n_positions))

    def _measure(self, positions, lengths, groups=None):
        shape = self._neighbours.dissimilarity(positions, groups)
        energy, _ = movement_energies(positions, self._floor)
        scores = np.square(self._energy(energy)) + np.square(self._length(lengths))
        return shape * np.exp(np.minimum(_LENGTH_ENERGY_WEIGHT * scores, _MAX_LOG_FACTOR))


# -- random movements, which the threshold must reject -----------------------------------


def random_movements(positions, counts):
    """Movements with the mean and the covariance of poses, smooth as those of people.

    The trials (n_sequences, Q, n_features) are on the clock. Yields (count, Q, n_features) for each
    of the counts; always the same movements for the same counts.
    """
    _, n_positions, n_features = positions.shape
    poses = positions.reshape(-1, n_features)
    center = poses.mean(axis=0)
    _, spread, axes = np.linalg.svd(poses - center, full_matrices=False)
    axes *= spread[:, np.newaxis] / np.sqrt(len(poses))
    memory, rng = np.exp(-1 / n_positions), np.random.default_rng(0)
    for count in counts:
        steps = rng.standard_normal((count, n_positions, len(axes)))
        # Stationary from the first position on.
        steps[:, 1:] *= np.sqrt(1 - memory**2)
        course = lfilter([1], [1, -memory], steps, axis=1)
        yield smooth(course, SMOOTHING * (n_positions - 1)) @ axes + center
