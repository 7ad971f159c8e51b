"""Refinement: from a good warp to the best one for sequences of a single source.

Repeated trials of one source (a machine, a neuron, one trained athlete) show the same
postures but for noise and gain, so postures can place a moment to a fraction of a frame.
Different people do not: their postures differ by style, and following them misleads. The
misfit tells which is the case.
"""

import numpy as np
from scipy.interpolate import CubicSpline
from scipy.linalg import solveh_banded

from .consensus import follow
from .features import SMOOTHING, smooth

__all__ = ["choose_smoothing", "misfit", "refine_warps"]

# How much a rate is expected to change over the whole clip, in units of the mean rate.
_RATE_CHANGE = 2.0
# Steps end when no frame moves by more than a hundredth of one.
_ITERATIONS = 20
_LONGEST_STEP = 1.5
_SHORTEST_STEP = 0.01
# Gains are drawn towards 1 with this share of a feature's mean energy.
_RIDGE = 0.01
# Narrowest Gaussian that is one on a grid of frames.
_LEAST_SIGMA = 0.35
# The noise is measured on at most so many sequences.
_SAMPLE = 256
_SMOOTHINGS = (0.0, 0.005, 0.007, 0.01, 0.014, 0.02, 0.028, 0.04)


def choose_smoothing(on_clock):
    """Width of the smoothing that suits the noise, by generalised cross-validation.

    Parameters
    ----------
    on_clock : ndarray, shape (n_sequences, P, n_features)

    Returns
    -------
    float
        Standard deviation of a Gaussian, in frames; 0 for none.
    """
    n_frames = on_clock.shape[1]
    on_clock = on_clock[:: -(-len(on_clock) // _SAMPLE)]
    best, chosen = np.inf, 0.0
    for sigma in (share * (n_frames - 1) for share in _SMOOTHINGS):
        # No smoothing at all leaves no residual to judge by: a little stands in for it.
        used = max(sigma, _LEAST_SIGMA)
        residual = np.square(on_clock - smooth(on_clock, used)).sum(dtype=np.float64)
        score = residual / (1 - _gaussian(used).max()) ** 2
        if score < best:
            best, chosen = score, sigma
    return chosen


def misfit(base, moving, times):
    """Share of the base's variance that matched postures leave, noise aside.

    Parameters
    ----------
    base : ndarray, shape (P, n_features)
    moving : ndarray, shape (n_sequences, P, n_features)
    times : ndarray, shape (n_sequences, P)

    Returns
    -------
    ndarray, shape (n_sequences,)
        The slow part of the energy of the residuals, after fitting a gain and an offset to
        every feature, less what white noise puts there, over the energy of the base.
    """
    residuals = np.empty_like(moving)
    for residual, x, tau in zip(residuals, moving, times, strict=True):
        matched = follow(x.T, np.tile(tau, (x.shape[1], 1))).T
        residual[:] = base - _fit_gain(base, matched)[0]
    sigma = max(SMOOTHING * (len(base) - 1), _LEAST_SIGMA)
    slow = smooth(residuals, sigma)
    # White noise leaves this share of its energy in the slow part, which is not misfit.
    kernel = _gaussian(sigma)
    left = np.square(kernel).sum()
    share = left / (1 - 2 * kernel.max() + left)
    fast_energy = np.square(residuals - slow).sum(axis=(1, 2))
    slow_energy = np.square(slow).sum(axis=(1, 2)) - share * fast_energy
    energy = np.square(base - base.mean(axis=0)).sum()
    return np.maximum(slow_energy, 0) / energy if energy > 0 else np.zeros(len(moving))


def refine_warps(base, moving, times, reach):
    """Gauss-Newton steps along the tangent that bring matched postures together.

    Each step solves for the whole warp at once::

        sum_p |x_n(p) - g x_m(tau) - o - g x_m'(tau) (tau_new - tau)|^2 / s^2
            + sum_p (tau_new''(p) / q)^2

    with a gain g and an offset o for every feature, the noise s measured from the
    residual, and q the change of rate to be expected. The ends stay pinned, the warp stays
    non-decreasing and in the band; the largest rate of the trellis does not bind it.

    Parameters
    ----------
    base : ndarray, shape (P, n_features)
    moving : ndarray, shape (n_sequences, P, n_features)
    times : ndarray, shape (n_sequences, P)
        Warps to begin with.
    reach : float
        Largest offset, in frames.

    Returns
    -------
    ndarray, shape (n_sequences, P)
    """
    n_frames, n_features = base.shape
    if n_frames < 5:
        return times
    band, border = _curvature(n_frames)
    frames = np.arange(n_frames)
    low, high = np.maximum(frames - reach, 0), np.minimum(frames + reach, n_frames - 1)
    rounding = np.square(16 * np.finfo(base.dtype).eps) * np.square(base).mean()
    curves = [CubicSpline(frames, x) for x in moving]
    refined = times.astype(np.float64)
    for curve, tau in zip(curves, refined, strict=True):
        tangent = curve.derivative()
        for _ in range(_ITERATIONS):
            fitted, gain = _fit_gain(base, curve(tau))
            slope, residual = gain * tangent(tau), base - fitted
            noise = np.square(residual).sum() / (n_frames * n_features)
            pull = np.square(slope).sum(axis=1)[1:-1]
            if noise <= rounding or not pull.any():
                break
            stiffness = noise * (n_frames / _RATE_CHANGE) ** 2
            stiffness = max(stiffness, 1e-9 * pull.mean())
            system = stiffness * band
            system[-1] += pull
            target = pull * tau[1:-1] + (slope * residual).sum(axis=1)[1:-1] - stiffness * border
            step = solveh_banded(system, target) - tau[1:-1]
            tau[1:-1] += np.clip(step, -_LONGEST_STEP, _LONGEST_STEP)
            np.maximum.accumulate(np.clip(tau, low, high, out=tau), out=tau)
            if np.abs(step).max() < _SHORTEST_STEP:
                break
    return refined


def _gaussian(sigma):
    """Weights of a Gaussian filter."""
    reach = int(np.ceil(4 * sigma))
    weights = np.exp(-0.5 * (np.arange(-reach, reach + 1) / sigma) ** 2)
    return weights / weights.sum()


def _fit_gain(base, matched):
    """``g * matched + o``, and ``g``: least squares, gains drawn a little towards 1."""
    x, y = base - base.mean(axis=0), matched - matched.mean(axis=0)
    energy = np.square(y).sum(axis=0)
    ridge = _RIDGE * energy.mean()
    if ridge == 0:
        return np.broadcast_to(base.mean(axis=0), base.shape), np.ones(base.shape[1])
    gain = ((x * y).sum(axis=0) + ridge) / (energy + ridge)
    return gain * y + base.mean(axis=0), gain


def _curvature(n_frames):
    """``sum (tau'')^2`` for free inner frames: upper band, and what the pinned ends add."""
    band = np.zeros((3, n_frames - 2))
    band[2] = 6
    band[2, [0, -1]] = 5
    band[1, 1:] = -4
    band[0, 2:] = 1
    border = np.zeros(n_frames - 2)
    border[-2:] = 1, -2
    return band, border * (n_frames - 1)
