"""Refinement: from a good warp to the best one for sequences of a single source.

Repeated trials of one source (a machine, a neuron, one trained athlete) have the same
poses but for noise and gain, so poses can place a moment to a fraction of a frame.
The poses of different people differ by style, and refining by them makes warps worse.
``unexplained_variance`` tells which is the case.

Averages over features are weighted by their variance, and copies are discounted, so that neither
constant features nor copies change a result.
"""

import math
from typing import NamedTuple

import numpy as np
from scipy.interpolate import CubicSpline
from scipy.linalg import solveh_banded

from .filters import SMOOTHING, smooth
from .metric import LONGEST_LAG
from .sizes import CACHE_NUMBERS, EQUAL

# Largest share of the variance that matching leaves of copies of one source: docs/design.md.
SAME_SOURCE = 0.025
# Expected change of the rate over the whole clip, in units of the mean rate.
_RATE_CHANGE = 2.0
# Steps end when no frame moves by more than a hundredth of one.
MAX_STEPS = 20
_SHORTEST_STEP = 0.01
# Least share of the squared slopes that counts as movement, and least rate, in standard errors.
_LEAST_SIGNAL, _SLOWEST = 0.05, 0.1


class Refiner(NamedTuple):
    """Refines warps to a pattern by poses.

    Attributes
    ----------
    pattern : ndarray, shape (P, n_features)
        Its poses, smoothed.
    noise_width : float
        Width of the smoothing of poses, in frames; 0 for none.
    """

    pattern: np.ndarray
    noise_width: float

    @classmethod
    def of(cls, pattern, noise_width):
        """The refiner to a pattern (P, n_features)."""
        return cls(_smoothed(pattern[np.newaxis], noise_width)[0], noise_width)

    def __call__(self, poses, times, reach):
        """Gauss-Newton steps along the tangent that bring matched poses together.

        Each step solves for the whole warp at once::

            sum_p |x_n(p) - g x_m(tau) - o - g x_m'(tau) (tau_new - tau)|^2 / s^2
                + sum_p (tau_new''(p) / q)^2

        with a gain g and an offset o for every feature, the noise s of a feature measured from the
        residuals, and q the change of rate to be expected. The ends stay pinned, the warp stays
        non-decreasing and in the band; the largest rate of the trellis does not bind it.

        Parameters
        ----------
        poses : ndarray, shape (n_trials, P, n_features)
        times : ndarray, shape (n_trials, P)
            Initial warps.
        reach : float
            Largest offset, in frames.

        Returns
        -------
        ndarray, shape (n_trials, P)
        """
        if times.shape[1] < 5:
            return times
        size = max(1, CACHE_NUMBERS // self.pattern.size)
        rows = [slice(start, start + size) for start in range(0, len(times), size)]
        return np.concatenate([self._refined(poses[few], times[few], reach) for few in rows])

    def _refined(self, poses, times, reach):
        """Refined warps of so few trials that their poses stay in the cache."""
        n_frames = times.shape[1]
        moving = _smoothed(poses, self.noise_width)
        base, frames = self.pattern[np.newaxis], np.arange(n_frames)
        low, high = np.maximum(frames - reach, 0), np.minimum(frames + reach, n_frames - 1)
        energy = np.square(base - base.mean(axis=1, keepdims=True)).sum(axis=(1, 2))
        rounding = np.square(16 * np.finfo(base.dtype).eps) * energy / n_frames
        splines = CubicSpline(frames, moving, axis=1).c.astype(moving.dtype, copy=False)
        splines = np.ascontiguousarray(splines.transpose(2, 1, 0, 3))
        refined = times.astype(np.float64)
        active, (band, border) = np.arange(len(moving)), curvature(n_frames)
        for _ in range(MAX_STEPS):
            values, tangents = _evaluate(splines, active, refined[active])
            fitted, gain = _fit_gain(base, values)
            slope, residual = gain * tangents, base - fitted
            noise = typical_energy(residual, self._independent(n_frames)) / n_frames
            pull = np.vecdot(slope, slope)[:, 1:-1]
            going = (noise > rounding) & pull.any(axis=1)
            active, noise, pull = active[going], noise[going], pull[going]
            if len(active) == 0:
                break
            push = np.vecdot(slope, residual)[going, 1:-1]
            stiffness = np.maximum(noise * (n_frames / _RATE_CHANGE) ** 2, 1e-9 * pull.mean(axis=1))
            tau = refined[active]
            # The systems of all warps, one below the other, are a single banded one.
            system = band[:, np.newaxis] * stiffness[:, np.newaxis]
            system[-1] += pull
            target = pull * tau[:, 1:-1] + push - stiffness[:, np.newaxis] * border
            solved = solveh_banded(system.reshape(3, -1), target.ravel())
            step = solved.reshape(pull.shape) - tau[:, 1:-1]
            tau[:, 1:-1] += step
            refined[active] = np.maximum.accumulate(np.clip(tau, low, high), axis=1)
            active = active[np.abs(step).max(axis=1) >= _SHORTEST_STEP]
        return refined

    def standard_errors(self, poses, times):
        """Standard errors of refined warps, in frames: (n_trials, P).

        The warp solves linear equations, with matrix A and right side y. Its covariance is
        ``A^-1 Cov(y) A^-1``. The squared slopes in y hold noise. The matrix has the inner products
        of the slopes of base and moving sequence instead, whose noise is independent. Noise that is
        the same for several frames counts by how many: the sum of its autocorrelation.

        Parameters
        ----------
        poses : ndarray, shape (n_trials, P, n_features)
        times : ndarray, shape (n_trials, P)
            Refined warps.
        """
        n_frames, errors, base = times.shape[1], np.zeros(times.shape), self.pattern
        if n_frames < 5:
            return errors
        frames, (band, _) = np.arange(n_frames), curvature(n_frames)
        lags = np.arange(1, math.ceil(LONGEST_LAG * n_frames))
        share = 1 - lags / (LONGEST_LAG * n_frames)
        base_slope = CubicSpline(frames, base)(frames, 1)
        width = SMOOTHING * (n_frames - 1)
        for x, tau, row in zip(_smoothed(poses, self.noise_width), times, errors, strict=True):
            spline = CubicSpline(frames, x)
            fitted, gain = _fit_gain(base[np.newaxis], spline(tau)[np.newaxis])
            residual, slope = base - fitted[0], gain[0] * spline(tau, 1)
            noise = typical_energy(residual[np.newaxis], self._independent(n_frames))[0] / n_frames
            pull = np.vecdot(slope, slope)
            if not (noise > 0 and pull[1:-1].any()):
                continue
            stiffness = max(noise * (n_frames / _RATE_CHANGE) ** 2, 1e-9 * pull[1:-1].mean())
            rates = np.maximum(np.gradient(tau), _SLOWEST)
            pulls = np.stack([pull, np.vecdot(slope, base_slope) / rates])[..., np.newaxis]
            total, common = smooth(pulls, width)[:, 1:-1, 0]
            pull = pull[1:-1]
            total = np.maximum(total, np.finfo(total.dtype).tiny)
            clean = pull * np.clip(common / total, _LEAST_SIGNAL, 1)
            system = band * stiffness
            system[-1] += clean
            inverse = solveh_banded(system, np.eye(n_frames - 2))
            variance = np.diagonal(inverse) + np.square(inverse) @ (pull - clean)
            spectrum = np.square(np.abs(np.fft.rfft(residual, 2 * n_frames, axis=0))).sum(axis=1)
            related = np.fft.irfft(spectrum)
            dependent = 1 + 2 * (share @ related[lags]) / (related[0] or 1)
            dependent = max(dependent, 1, 2 * math.sqrt(math.pi) * self.noise_width)
            # What the warp, gains and offsets have taken away from the residuals.
            features = np.square(residual).sum() / (n_frames * noise)
            degrees = np.diagonal(inverse) @ clean + 2 * features
            share_left = 1 - degrees * dependent / (features * n_frames)
            row[1:-1] = np.sqrt(noise / max(share_left, 0.5) * dependent * variance)
        return errors

    def _independent(self, n_frames):
        """Frames of white noise that estimate a covariance as well as these under the Gaussian."""
        return n_frames / max(1, np.sqrt(2 * np.pi) * self.noise_width)


def _smoothed(poses, width):
    return smooth(poses, width) if width else poses


def unexplained_variance(pattern, aligned, noise):
    """The variance that is left after matching, less that of white noise, as a share of all.

    It tells copies of one source, which differ in noise and gain, from people, whose styles differ.

    Parameters
    ----------
    pattern : ndarray, shape (P, n_features)
    aligned : ndarray, shape (n_trials, P, n_features)
        Other trials, sampled at their warps.
    noise : ndarray, shape (n_features,)
        Variance of the white noise of trials as they are recorded.

    Returns
    -------
    float
        The median over trials.
    """
    # Linear interpolation between frames leaves two thirds of white noise, in the mean over times.
    remaining = np.square(aligned - pattern).mean(axis=1) - (1 + 2 / 3) * noise
    moving = np.maximum(pattern.var(axis=0) - noise, 0).sum()
    share = np.median(np.maximum(remaining, 0).sum(axis=1))
    return float(share / moving) if moving > 0 else math.inf


def _evaluate(splines, active, times):
    """Cubic splines on whole frames, and their derivatives, each at times of its own.

    Their coefficients are (n_sequences, P - 1, 4, n_features), the highest power first.
    """
    pieces = splines.shape[1]
    piece = np.clip(times.astype(np.intp), 0, pieces - 1)
    x = (times - piece).astype(splines.dtype)[:, :, np.newaxis]
    at = piece + pieces * active[:, np.newaxis]
    a, b, c, d = np.moveaxis(splines.reshape(-1, *splines.shape[2:]).take(at, axis=0), 2, 0)
    values = a * x
    values += b
    tangents = a * (3 * x)
    tangents += 2 * b
    for out in (values, tangents):
        out *= x
        out += c
    values *= x
    values += d
    return values, tangents


def typical_energy(curves, independent=np.inf):
    """The energy of a typical feature of centred curves (n_sequences, P, n_features).

    Their total energy divided by the effective number of independent features, ``tr(C)^2 /
    tr(C^2)`` of their covariance C. The bias of ``tr(C^2)`` from few independent frames is
    removed.
    """
    energy, turned = np.square(curves).sum(axis=(1, 2)), curves.swapaxes(1, 2)
    # Of more features than frames: the squares of both products have one sum.
    products = turned @ curves if curves.shape[2] < curves.shape[1] else curves @ turned
    together = np.square(products).sum(axis=(1, 2))
    typical = together / np.where(energy > 0, energy, 1)
    unbiased = (typical - energy / independent) / (1 + 1 / independent)
    return np.maximum(unbiased, typical / 4)


def _fit_gain(base, matched):
    """``g * matched + o``, and ``g``: by least squares.

    Base and ``matched`` are (n_sequences, P, n_features), ``g`` (n_sequences, 1, n_features).
    """
    middle = base.mean(axis=1, keepdims=True)
    x, y = base - middle, matched - matched.mean(axis=1, keepdims=True)
    energy = np.square(y).sum(axis=1, keepdims=True)
    # Constant features and constant poses fit with any gain: it is 1.
    ridge = EQUAL[y.dtype] * energy.max(axis=2, keepdims=True)
    ridge[ridge == 0] = 1
    gain = ((x * y).sum(axis=1, keepdims=True) + ridge) / (energy + ridge)
    return gain * y + middle, gain


def curvature(n_frames):
    """``sum (tau'')^2`` of the inner frames: its upper band, and the terms of the pinned ends."""
    band = np.zeros((3, n_frames - 2))
    band[2] = 6
    band[2, [0, -1]] = 5
    band[1, 1:] = -4
    band[0, 2:] = 1
    border = np.zeros(n_frames - 2)
    border[-2:] = 1, -2
    return band, border * (n_frames - 1)
