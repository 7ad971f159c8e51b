"""Metric: velocity and posture, weighted by how well they tell a moment of the action.

Noisy directions of the features count as much as reliable ones until the training set says which
are which: `learning` finds that out, and what it finds is applied here. The distance of two
moments stays that of two points, so the trellis knows nothing of it.
"""

from typing import NamedTuple

import numpy as np
from scipy.fft import irfft, next_fast_len, rfft

from .costs import RATE_WEIGHT
from .warps import sample

__all__ = ["Metric", "compressed", "energy_shares", "learn_metric", "without_mean"]


class Metric(NamedTuple):
    """How velocities and postures become the points that are compared.

    Attributes
    ----------
    features : ndarray of int, shape (n_told,)
        Features that tell the moments; the others are left out.
    energy : float
        Mean squared speed of the training set, in these features.
    velocity : ndarray, shape (n_told, n_compared)
        Applied to compressed velocities.
    posture : ndarray, shape (n_told, n_compared)
        Applied to postures less their own mean over time: where a person stands or how they hold
        an arm throughout tells no moment.
    """

    features: np.ndarray
    energy: float
    velocity: np.ndarray
    posture: np.ndarray

    def __call__(self, velocity, positions):
        """What is compared of sequences: (n_sequences, Q, n_compared).

        Parameters
        ----------
        velocity, positions : ndarray, shape (n_sequences, Q, n_features)
            In the unit.
        """
        return self.of_parts(*self._parts(velocity, positions))

    def of_parts(self, velocity, postures):
        """What is compared of compressed velocities and centred postures (..., n_told)."""
        dtype = postures.dtype
        # Products of one sequence each: what a sequence gives does not depend on its company.
        out = velocity @ self.velocity.astype(dtype, copy=False)
        out += postures @ self.posture.astype(dtype, copy=False)
        return out

    def shares(self, velocity, positions):
        """The share of every feature in what is compared; that of noise is about 0."""
        parts = self._parts(velocity, positions)
        compared, shares = _flat(self.of_parts(*parts)), np.zeros(positions.shape[2])
        for part, weights in zip(parts, (self.velocity, self.posture), strict=True):
            shares[self.features] += (_flat(part).T @ compared * weights).sum(axis=1)
        return shares / shares.sum()

    def part(self, columns, velocity):
        """That of some features alone, by their indices; None if it does not hear them move.

        A part has a mean squared speed of its own, and is compressed by that.

        Parameters
        ----------
        columns : ndarray of int, shape (n_columns,)
        velocity : ndarray, shape (n_sequences, Q, n_columns)
            Theirs, of the training set.
        """
        place = {int(feature): row for row, feature in enumerate(self.features)}
        heard = np.array([i for i, k in enumerate(columns) if int(k) in place], dtype=np.intp)
        rows = [place[int(k)] for k in columns[heard]]
        speed = np.square(velocity[:, :, heard]).sum(axis=2, dtype=np.float64)
        energy = float(speed.mean())
        return Metric(heard, energy, self.velocity[rows], self.posture[rows]) if energy else None

    def _parts(self, velocity, positions):
        fast = compressed(velocity[:, :, self.features], self.energy)
        return fast, without_mean(positions[:, :, self.features])


def _flat(block):
    """All frames of all sequences, one below the other."""
    return block.reshape(-1, block.shape[2])


def energy_shares(velocity):
    """The share of every feature in the energy of velocities."""
    energy = np.square(velocity).sum(axis=(0, 1), dtype=np.float64)
    return energy / energy.sum()


def without_mean(positions):
    """Sequences less their own mean over time."""
    return positions - positions.mean(axis=1, keepdims=True)


def compressed(velocity, energy):
    """Velocities whose large speeds are compressed to their square root.

    Slow moments, where a limb turns, count more beside fast ones, and the differences of pace
    between people less.

    Parameters
    ----------
    velocity : ndarray, shape (..., n_features)
    energy : float
        The mean squared speed: a speed that is the root of it is halfway between linear and root.
    """
    scaled = velocity / np.sqrt(energy).astype(velocity.dtype)
    scaled /= np.sqrt(1 + np.sqrt(np.vecdot(scaled, scaled)))[..., np.newaxis]
    return scaled


# -- learning the metric: a training set tells which of its features tell the moments ----

# Standard errors of the agreement between performances at which a feature is believed.
_DOUBT = 2.0
# Share of a feature's mean variance that is added to all of them, before anything is inverted.
_RIDGE = 0.03
# Eigenvalues of a metric are raised to this power: half-way to counting all directions alike,
# which is what is known before anything is learnt. Measured in docs/method.md.
_TRUST = 0.6
# Share of all eigenvalues that is what rounding leaves of a direction that tells nothing.
_NOTHING = 1e-6
# Directions that make so much of what is compared are enough.
_KEPT = 0.99
# Largest lag, as a share of the clip, at which differences are taken to be alike.
_LONGEST = 0.3


def learn_metric(match, positions, velocity):
    """Learn the metric of a training set, or of some of it.

    Parameters
    ----------
    match : callable
        ``match(features, others)``: voted times (n_sequences, n_others, P) of all sequences as
        bases, each with others of its own, by their indices (n_sequences, n_others).
    positions, velocity : ndarray, shape (n_sequences, P, n_features)
        Postures on the clock and their velocities, in the unit.

    Returns
    -------
    Metric or None
        None if nothing tells the moments.
    """
    moves = positions.any(axis=(0, 1)) & velocity.any(axis=(0, 1))
    if len(positions) < 2 or not moves.any():
        return None
    postures = without_mean(positions)
    both = np.concatenate([postures, velocity], axis=2)
    errors = _errors(both)
    told = moves & _believed(_agreement(both), errors)
    told = told if told.any() else moves
    fast = compressed(velocity[:, :, told], _energy(velocity[:, :, told]))
    first = _square_root(metric_matrix(fast, _unmatched(fast))).astype(fast.dtype)
    others = _others(len(positions))
    voted = match(fast @ first if first.any() else fast, others)
    matched = _matched(both, others, voted)
    if not told[moves].all():
        told |= moves & _believed(_agreement(both, matched), errors)
    energy = _energy(velocity[:, :, told])
    postures, fast = postures[:, :, told], compressed(velocity[:, :, told], energy)
    n_features = len(moves)
    there = matched[..., :n_features], matched[..., n_features:]
    there = there if told.all() else [x[..., told] for x in there]
    of_postures, longer = _differences(postures, there[0])
    of_fast, alike = _differences(fast, _paced(there[1], energy, voted))
    by_fast = _square_root(metric_matrix(fast, of_fast))
    # Differences that stay alike for longer are fewer pieces of evidence.
    by_postures = _square_root(metric_matrix(postures, of_postures)) * np.sqrt(alike / longer)
    turn = _turn(np.concatenate([fast @ by_fast, postures @ by_postures], axis=2))
    if turn is None:
        return None
    n_told = len(by_fast)
    maps = by_fast @ turn[:n_told], by_postures @ turn[n_told:]
    return Metric(np.flatnonzero(told), energy, *maps)


def _others(n):
    """Whom every sequence is a base for, so that of any two one is: (n, n // 2).

    The other way round they would tell nearly the same. Who is opposite in a circle is both.
    """
    return (np.arange(n)[:, np.newaxis] + np.arange(1, n // 2 + 1)) % n


def _energy(velocity):
    """Mean squared speed."""
    return float(np.square(velocity).sum(axis=2).mean())


def _believed(agreement, errors):
    """Whether performances agree in a feature, in posture and velocity together: (n_features,)."""
    evidence = (agreement / errors).reshape(2, -1)
    return evidence.sum(axis=0) / np.sqrt(2) > _DOUBT


def _agreement(block, matched=None):
    """Mean correlation of two performances in every feature: (n_features,).

    Parameters
    ----------
    block : ndarray, shape (n_sequences, P, n_features)
    matched : ndarray, shape (n_sequences, n_others, P, n_features), default=None
        For every sequence, others at its times; None: all, at the same times.
    """
    own = np.square(block).sum(axis=0).sum(axis=0)
    if matched is None:
        norm = own * (len(block) - 1)
        cross = np.square(block.sum(axis=0)).sum(axis=0) - own
    else:
        together, squares = np.zeros(block.shape[1:]), np.zeros(block.shape[1:])
        for base, moving in zip(block, matched, strict=True):
            together += base * moving.sum(axis=0)
            squares += np.square(moving).sum(axis=0)
        norm = np.sqrt(own * matched.shape[1] * squares.sum(axis=0))
        cross = together.sum(axis=0)
    return cross / np.where(norm > 0, norm, 1)


def _errors(block):
    """Standard errors of the agreement of series that have nothing in common: (n_features,).

    Two series that have nothing to do with each other, of autocorrelation r, correlate by the
    root of ``(1 + 2 sum r^2) / P``; every two performances are a pair of its own.
    """
    n_sequences, n_frames = block.shape[:2]
    power = _power(block).sum(axis=0)
    correlation = irfft(power, 2 * len(power) - 2, axis=0)[:n_frames]
    correlation /= np.where(correlation[0] > 0, correlation[0], 1)
    width = 1 + 2 * np.square(correlation[1:]).sum(axis=0)
    return np.sqrt(2 * width / (n_sequences * (n_sequences - 1) * n_frames))


def metric_matrix(block, covariance):
    """``(R + a I)^-1 - (2 S + a I)^-1``, tempered: symmetric, without negative eigenvalues.

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
    spread = _moments(block)
    a = _RIDGE * np.trace(spread) / len(spread)
    if not a > 0:
        return np.zeros_like(spread)
    ridge = a * np.eye(len(spread))
    same = np.linalg.inv(covariance + ridge)
    ratio = same - np.linalg.inv(2 * spread + ridge)
    values, vectors = np.linalg.eigh((ratio + ratio.T) / 2)
    values = np.where(values > _NOTHING * np.trace(same), values, 0)
    shares = np.einsum("ki,kl,li->i", vectors, spread, vectors)
    tempered = values**_TRUST
    tempered *= (values @ shares) / ((tempered @ shares) or 1)
    return (vectors * tempered) @ vectors.T


def _moments(block):
    """Mean outer product of features with themselves."""
    frames = block.reshape(-1, block.shape[2])
    return (frames.T @ frames).astype(np.float64) / len(frames)


def _square_root(matrix):
    """A map after which squared distances are those of a metric: ``A A' = M``."""
    values, vectors = np.linalg.eigh(matrix)
    return vectors * np.sqrt(np.maximum(values, 0))


def _unmatched(block):
    """Covariance of the differences of all pairs at equal times, without any matching."""
    n_sequences = len(block)
    total = block.sum(axis=0)
    outer = total.T @ total / (n_sequences * block.shape[1])
    return 2 * (n_sequences * _moments(block) - outer) / (n_sequences - 1)


def _matched(block, others, times):
    """For every sequence, its others at its times: (n_sequences, n_others, P, n_features).

    Parameters
    ----------
    block : ndarray, shape (n_sequences, P, n_features)
    others : ndarray of int, shape (n_sequences, n_others)
    times : ndarray, shape (n_sequences, n_others, P)
        ``tau``.
    """
    n_frames, n_features = block.shape[1:]
    matched = sample(block[others.ravel()], times.reshape(-1, n_frames), n_frames)
    return matched.reshape(*times.shape, n_features)


def _paced(matched, energy, times):
    """Yield matched velocities, compressed, with the weights of their rates."""
    weights = 1 + RATE_WEIGHT * (np.gradient(times, axis=2) - 1)
    for velocity, own in zip(matched, weights, strict=True):
        fast = compressed(velocity, energy)
        fast *= own[:, :, np.newaxis]
        yield fast


def _differences(block, matched):
    """Covariance R of differences at matched times, and for how many frames they stay alike.

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
    lags = range(1 + int(_LONGEST * n_frames))
    return covariance / count, _length(np.array([np.trace(lagged, k) for k in lags]))


def _power(block):
    """Power spectra along time, long enough for all lags: (n_sequences, n_frequencies, ...)."""
    spectrum = rfft(block, 2 * next_fast_len(block.shape[1], real=True), axis=1)
    return np.square(spectrum.real) + np.square(spectrum.imag)


def _length(autocovariance):
    """For how many lags something stays alike, from its autocovariance at lags 0, 1, ..."""
    if not autocovariance[0] > 0:
        return 1.0
    correlation = autocovariance / autocovariance[0]
    ends = np.flatnonzero(correlation <= 0)
    last = ends[0] if len(ends) else len(correlation)
    return float(1 + 2 * correlation[1:last].sum())


def _turn(compared):
    """Principal axes of what is compared, (n_sequences, P, 2 n_features), as columns.

    The fewest that hold nearly all of it, and as many as features at most, but two: matching by
    them costs no more than without a metric. None if there is nothing to compare.
    """
    values, vectors = np.linalg.eigh(_moments(compared))
    held = np.cumsum(np.maximum(values[::-1], 0))
    if not held[-1] > 0:
        return None
    count = 1 + int(np.searchsorted(held, _KEPT * held[-1]))
    return vectors[:, ::-1][:, : min(count, max(compared.shape[2] // 2, 2))]
