"""Metric: velocity and pose, weighted by how well they tell a moment of the action.

Without a metric noisy directions of the features count as much as reliable ones.
`metric_of_matches` estimates their reliability from the training set, `Metric` applies it. The
distance of two moments stays that of two points, so the trellis is the same.
"""

from typing import NamedTuple

import numpy as np
from scipy.fft import irfft, next_fast_len, rfft

from .costs import RATE_WEIGHT
from .counting import ROUNDING
from .warps import evaluate_warps, sample


class Metric(NamedTuple):
    """How velocities and poses become the points that are compared.

    Attributes
    ----------
    features : ndarray of int, shape (n_used,)
        Reliable features; the others are left out.
    energy : float
        Mean squared speed of the training set, in these features.
    velocity : ndarray, shape (n_used, n_compared)
        Applied to compressed velocities.
    pose : ndarray, shape (n_used, n_compared)
        Applied to poses less their own mean over time: the place of a subject, or a limb held
        still, identifies no moment.
    """

    features: np.ndarray
    energy: float
    velocity: np.ndarray
    pose: np.ndarray

    def __call__(self, velocity, positions):
        """Features of sequences in the metric: (n_sequences, Q, n_compared).

        Parameters
        ----------
        velocity, positions : ndarray, shape (n_sequences, Q, n_features)
            In the unit.
        """
        fast, poses = self._parts(velocity, positions)
        return self.of_parts(fast, poses)

    def of_parts(self, velocity, poses):
        """The same of compressed velocities and centred poses (..., n_used)."""
        dtype = poses.dtype
        # Products of one sequence each: results do not depend on the other sequences.
        out = velocity @ self.velocity.astype(dtype, copy=False)
        out += poses @ self.pose.astype(dtype, copy=False)
        return out

    def shares(self, velocity, positions):
        """The share of every feature in what is compared; that of noise is about 0."""
        fast, poses = self._parts(velocity, positions)
        compared, shares = self.of_parts(fast, poses), np.zeros(positions.shape[2])
        compared = compared.reshape(-1, compared.shape[2])
        for curves, weights in ((fast, self.velocity), (poses, self.pose)):
            frames = curves.reshape(-1, curves.shape[2])
            shares[self.features] += (frames.T @ compared * weights).sum(axis=1)
        return shares / shares.sum()

    def part(self, columns, velocity):
        """The metric of some features, by their indices; None if they are noise or constant.

        A part is compressed by its own mean squared speed.

        Parameters
        ----------
        columns : ndarray of int, shape (n_columns,)
        velocity : ndarray, shape (n_sequences, Q, n_columns)
            Velocities of these features in the training set.
        """
        place = {int(feature): row for row, feature in enumerate(self.features)}
        used = np.array([i for i, k in enumerate(columns) if int(k) in place], dtype=np.intp)
        rows = [place[int(k)] for k in columns[used]]
        speed = np.square(velocity[:, :, used]).sum(axis=2, dtype=np.float64)
        energy = float(speed.mean())
        return Metric(used, energy, self.velocity[rows], self.pose[rows]) if energy else None

    def _parts(self, velocity, positions):
        fast = compressed(velocity[:, :, self.features], self.energy)
        return fast, without_mean(positions[:, :, self.features])


def energy_shares(velocity):
    """The share of every feature in the energy of velocities."""
    energy = np.square(velocity).sum(axis=(0, 1), dtype=np.float64)
    return energy / energy.sum()


def without_mean(positions):
    """Sequences less their own mean over time."""
    return positions - positions.mean(axis=1, keepdims=True)


def compressed(velocity, energy):
    """Velocities whose large speeds are compressed to their square root.

    Slow moments, such as the turning point of a limb, count more beside fast ones, and differences
    of pace between people less.

    Parameters
    ----------
    velocity : ndarray, shape (..., n_features)
    energy : float
        The mean squared speed. At its root the compression is halfway between linear and root.
    """
    scaled = velocity / np.sqrt(energy).astype(velocity.dtype)
    scaled /= np.sqrt(1 + np.sqrt(np.vecdot(scaled, scaled)))[..., np.newaxis]
    return scaled


# -- learning the metric from a training set -----------------------------------------------


class Evidence(NamedTuple):
    """What the warps of a training set tell of themselves; NaN if they are hardly any.

    Attributes
    ----------
    inconsistency : float
        Mean distance of the warp by way of a third sequence from the warp itself, over the mean
        offset. Warps of noise contradict each other: about 1.
    remaining : float
        Energy of the differences of matched moments, over that at equal times, in the metric.
    """

    inconsistency: float
    remaining: float

    @classmethod
    def of(cls, times, remaining):
        """The evidence of warps (n_sequences, n_others, P) to the next ones in a circle."""
        n_others, n_frames = times.shape[1:]
        # Warps are smooth: a quarter of the frames tells as much.
        frames = np.arange(0, n_frames, 4)
        coarse = times[:, :, frames]
        offset = np.abs(coarse - frames).mean(dtype=np.float64)
        if n_others < 2 or offset < _LEAST_OFFSET * n_frames:
            return cls(np.nan, np.nan)
        distance, count = 0.0, 0
        # From every base by way of the i-th after it to all after that one.
        for i in range(n_others - 1):
            onwards = np.roll(times, -i - 1, axis=0)[:, : n_others - i - 1]
            direct = coarse[:, i + 1 :]
            by_way = evaluate_warps(onwards, coarse[:, i : i + 1])
            distance += np.abs(by_way - direct).sum(dtype=np.float64)
            count += direct.size
        return cls(float(distance / count / offset), remaining)


# Standard errors of the agreement between trials from which on a feature is reliable.
_RELIABLE = 2.0
# Share of a feature's mean variance that is added to all of them, before anything is inverted.
RIDGE = 0.03
# Eigenvalues of a metric are raised to this power: half-way to equal weights of all directions,
# the prior. Measured in docs/design.md.
_SHRINKAGE = 0.6
# Share of the variance of the features that principal axes retain.
RETAINED = 0.99
# Warps whose mean offset is smaller, as a share of the clip, are no evidence.
_LEAST_OFFSET = 0.01
# Largest lag, as a share of the clip, of the autocorrelation of differences.
LONGEST_LAG = 0.3


def metric_of_matches(match, positions, velocity):
    """Learn the metric of a training set, or of some of it.

    Parameters
    ----------
    match : callable
        ``match(features, partners)``: voted times (n_sequences, n_partners, P) of all sequences as
        bases, each with partners of its own, by their indices (n_sequences, n_partners).
    positions, velocity : ndarray, shape (n_sequences, P, n_features)
        Poses on the clock and their velocities, in the unit.

    Returns
    -------
    tuple (Metric, Evidence), or None
        None if no feature moves.
    """
    # What is constant but for rounding does not move, and must not count as a feature.
    speeds = np.sqrt(np.square(velocity).sum(axis=(0, 1), dtype=np.float64))
    least = max(ROUNDING, 16 * np.finfo(velocity.dtype).eps)
    moves = positions.any(axis=(0, 1)) & (speeds > least * speeds.max(initial=0))
    if len(positions) < 2 or not moves.any():
        return None
    poses = without_mean(positions)
    block = np.concatenate([poses, velocity], axis=2)
    errors = _errors(block)
    used = moves & _are_reliable(_agreement(block), errors)
    used = used if used.any() else moves
    n, n_features = len(positions), len(moves)
    fast = compressed(velocity[:, :, used], _mean_square_speed(velocity[:, :, used]))
    first = _square_root(metric_matrix(fast, _unmatched_covariance(fast))).astype(fast.dtype)
    # Of any two sequences one is the base, both of those that are opposite in the circle: the two
    # directions carry nearly the same information.
    partners = (np.arange(n)[:, np.newaxis] + np.arange(1, n // 2 + 1)) % n
    times = match(fast @ first if first.any() else fast, partners)
    # For every sequence its partners at its times: (n_sequences, n_partners, P, n_features).
    n_frames = times.shape[-1]
    matched = sample(block[partners.ravel()], times.reshape(-1, n_frames), n_frames)
    matched = matched.reshape(*times.shape, 2 * n_features)
    if not used[moves].all():
        used |= moves & _are_reliable(_agreement(block, matched), errors)
    energy = _mean_square_speed(velocity[:, :, used])
    poses, fast = poses[:, :, used], compressed(velocity[:, :, used], energy)
    columns = slice(None) if used.all() else used
    matched_poses = matched[..., :n_features][..., columns]
    matched_velocity = matched[..., n_features:][..., columns]
    of_poses, pose_length = _differences(poses, matched_poses)
    of_fast, fast_length = _differences(fast, _at_rates(matched_velocity, energy, times))
    by_fast = _square_root(metric_matrix(fast, of_fast))
    # Differences of a longer correlation length are fewer independent observations.
    weight = np.sqrt(fast_length / pose_length)
    by_poses = _square_root(metric_matrix(poses, of_poses)) * weight
    axes = _principal_axes(np.concatenate([fast @ by_fast, poses @ by_poses], axis=2))
    if axes is None:
        return None
    n_used = len(by_fast)
    metric = Metric(np.flatnonzero(used), energy, by_fast @ axes[:n_used], by_poses @ axes[n_used:])
    roots = by_fast, by_poses
    before = _energy(roots, (_unmatched_covariance(fast), _unmatched_covariance(poses)))
    after = _energy(roots, (of_fast, of_poses))
    return metric, Evidence.of(times, after / before if before > 0 else np.nan)


def _energy(roots, covariances):
    """Mean squared differences of given covariances, in the metrics of these square roots."""
    return float(sum(np.vdot(a @ a.T, c) for a, c in zip(roots, covariances, strict=True)))


def _mean_square_speed(velocity):
    return float(np.square(velocity).sum(axis=2).mean())


def _are_reliable(agreement, errors):
    """Whether trials agree in a feature, in pose and velocity together: (n_features,)."""
    evidence = (agreement / errors).reshape(2, -1)
    return evidence.sum(axis=0) / np.sqrt(2) > _RELIABLE


def _agreement(block, matched=None):
    """Mean correlation of two trials in every feature: (n_features,).

    Parameters
    ----------
    block : ndarray, shape (n_sequences, P, n_features)
    matched : ndarray, shape (n_sequences, n_others, P, n_features), default=None
        For every sequence, others at its times; None: all, at the same times.
    """
    energy = np.square(block).sum(axis=0).sum(axis=0)
    if matched is None:
        norm = energy * (len(block) - 1)
        cross = np.square(block.sum(axis=0)).sum(axis=0) - energy
    else:
        together, squares = np.zeros(block.shape[1:]), np.zeros(block.shape[1:])
        for base, moving in zip(block, matched, strict=True):
            together += base * moving.sum(axis=0)
            squares += np.square(moving).sum(axis=0)
        norm = np.sqrt(energy * matched.shape[1] * squares.sum(axis=0))
        cross = together.sum(axis=0)
    return cross / np.where(norm > 0, norm, 1)


def _errors(block):
    """Standard errors of the agreement of independent series: (n_features,).

    The correlation of two independent series of autocorrelation r has the standard deviation
    ``sqrt((1 + 2 sum r^2) / P)``; all pairs of trials are taken as independent.
    """
    n_sequences, n_frames = block.shape[:2]
    # Power spectra along time, long enough for all lags.
    spectrum = rfft(block, 2 * next_fast_len(n_frames, real=True), axis=1)
    power = (np.square(spectrum.real) + np.square(spectrum.imag)).sum(axis=0)
    correlation = irfft(power, 2 * len(power) - 2, axis=0)[:n_frames]
    correlation /= np.where(correlation[0] > 0, correlation[0], 1)
    width = 1 + 2 * np.square(correlation[1:]).sum(axis=0)
    return np.sqrt(2 * width / (n_sequences * (n_sequences - 1) * n_frames))


def metric_matrix(block, covariance):
    """``(R + a I)^-1 - (2 S + a I)^-1``, shrunk: symmetric, without negative eigenvalues.

    Parameters
    ----------
    block : ndarray, shape (n_sequences, P, n_features)
        Features, about 0.
    covariance : ndarray, shape (n_features, n_features)
        R, of their differences at matched moments.

    Returns
    -------
    ndarray, shape (n_features, n_features)
    """
    total = _second_moments(block)
    a = RIDGE * np.trace(total) / len(total)
    if not a > 0:
        return np.zeros_like(total)
    ridge = a * np.eye(len(total))
    within = np.linalg.inv(covariance + ridge)
    difference = within - np.linalg.inv(2 * total + ridge)
    values, vectors = np.linalg.eigh((difference + difference.T) / 2)
    # Covariances are in single precision.
    rounding = 8 * np.finfo(np.float32).eps * np.trace(within)
    values = np.where(values > rounding, values, 0)
    variances = np.einsum("ki,kl,li->i", vectors, total, vectors)
    shrunk = values**_SHRINKAGE
    shrunk *= (values @ variances) / ((shrunk @ variances) or 1)
    return (vectors * shrunk) @ vectors.T


def _second_moments(block):
    """Mean outer product of features with themselves: S."""
    frames = block.reshape(-1, block.shape[2])
    return (frames.T @ frames).astype(np.float64) / len(frames)


def _square_root(matrix):
    """The matrix A with ``A A' = M``: squared distances after it are those of the metric M."""
    values, vectors = np.linalg.eigh(matrix)
    return vectors * np.sqrt(np.maximum(values, 0))


def _unmatched_covariance(block):
    """Covariance of the differences of all pairs at equal times, without any matching."""
    n_sequences = len(block)
    total = block.sum(axis=0)
    outer = total.T @ total / (n_sequences * block.shape[1])
    return 2 * (n_sequences * _second_moments(block) - outer) / (n_sequences - 1)


def _at_rates(matched, energy, times):
    """Yield matched velocities, compressed, with the weights of their rates."""
    weights = 1 + RATE_WEIGHT * (np.gradient(times, axis=2) - 1)
    for velocity, weight in zip(matched, weights, strict=True):
        fast = compressed(velocity, energy)
        fast *= weight[:, :, np.newaxis]
        yield fast


def _differences(block, matched):
    """Covariance R of differences at matched times, and their correlation length in frames.

    Parameters
    ----------
    block : ndarray, shape (n_sequences, P, n_features)
    matched : iterable of ndarray (n_others, P, n_features)
        For every sequence.
    """
    n_frames, n_features = block.shape[1:]
    covariance, lagged, count = np.zeros((n_features, n_features)), 0, 0
    for base, moving in zip(block, matched, strict=True):
        differences = base - moving
        flat = differences.reshape(-1, n_features)
        covariance += flat.T @ flat
        count += len(flat)
        # Products of all frames with all: their diagonals are the autocovariances.
        series = differences.swapaxes(0, 1).reshape(n_frames, -1)
        lagged = lagged + series @ series.T
    lags = range(1 + int(LONGEST_LAG * n_frames))
    autocovariance = np.array([np.trace(lagged, k) for k in lags])
    if not autocovariance[0] > 0:
        return covariance / count, 1.0
    correlation = autocovariance / autocovariance[0]
    # Up to the first lag without a positive correlation.
    ends = np.flatnonzero(correlation <= 0)
    last = ends[0] if len(ends) else len(correlation)
    return covariance / count, float(1 + 2 * correlation[1:last].sum())


def _principal_axes(compared):
    """Principal axes of features, (n_sequences, P, 2 n_features), as columns; None if all are 0.

    The fewest that retain nearly all variance, but at most as many as features, or two:
    matching by them takes no longer than without a metric.
    """
    values, vectors = np.linalg.eigh(_second_moments(compared))
    variance = np.cumsum(np.maximum(values[::-1], 0))
    if not variance[-1] > 0:
        return None
    count = 1 + int(np.searchsorted(variance, RETAINED * (1 - ROUNDING) * variance[-1]))
    return vectors[:, ::-1][:, : min(count, max(compared.shape[2] // 2, 2))]
