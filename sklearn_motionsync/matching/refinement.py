"""Refinement: from a good warp to the best one for sequences of a single source.

Repeated trials of one source (a machine, a neuron, one trained athlete) show the same
postures but for noise and gain, so postures can place a moment to a fraction of a frame.
Different people do not: their postures differ by style, and following them misleads.
``holdout`` tells which is the case.

A feature that never moves says nothing, and one that is there twice nothing new: what is
averaged over features is weighted by what they do, so that neither counts.
"""

import numpy as np
from scipy.interpolate import CubicSpline
from scipy.linalg import solveh_banded

from .filters import SMOOTHING, smooth
from .warps import follow

__all__ = [
    "MOST_STEPS",
    "choose_smoothing",
    "curvature",
    "independent_frames",
    "match_postures",
    "refine_warps",
    "slow_energy",
    "typical_energy",
]

# How much a rate is expected to change over the whole clip, in units of the mean rate.
_RATE_CHANGE = 2.0
# Steps end when no frame moves by more than a hundredth of one.
MOST_STEPS = 20
_LONGEST_STEP = 1.5
_SHORTEST_STEP = 0.01
# Gains are drawn towards 1 with this share of the energy of a typical feature.
_RIDGE = 0.003
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


def match_postures(moving, times):
    """Postures at the times of warps: (n_sequences, P, n_features)."""
    return follow(moving.swapaxes(1, 2), times[:, np.newaxis]).swapaxes(1, 2)


def slow_energy(base, matched):
    """What matched postures leave of the base's, as far as it is slow: (n_sequences,).

    The energy of the residuals, after fitting a gain and an offset to every feature and smoothing:
    noise is mostly gone.
    """
    residuals = base - _fit_gain(base[np.newaxis], matched)[0]
    sigma = max(SMOOTHING * (len(base) - 1), _LEAST_SIGMA)
    return np.square(smooth(residuals, sigma)).sum(axis=(1, 2))


def refine_warps(base, moving, times, reach, noise_width=0.0, steps=MOST_STEPS):
    """Gauss-Newton steps along the tangent that bring matched postures together.

    Each step solves for the whole warp at once::

        sum_p |x_n(p) - g x_m(tau) - o - g x_m'(tau) (tau_new - tau)|^2 / s^2
            + sum_p (tau_new''(p) / q)^2

    with a gain g and an offset o for every feature, the noise s of a feature measured from the
    residuals, and q the change of rate to be expected. The ends stay pinned, the warp stays
    non-decreasing and in the band; the largest rate of the trellis does not bind it.

    Parameters
    ----------
    base : ndarray, shape (P, n_features) or (n_sequences, P, n_features)
        One for all, or one for each. Features that are 0 have no say.
    moving : ndarray, shape (n_sequences, P, n_features)
    times : ndarray, shape (n_sequences, P)
        Warps to begin with.
    reach : float
        Largest offset, in frames.
    noise_width : float, default=0.0
        How wide the postures were smoothed, in frames.
    steps : int, default=20
        At most so many.

    Returns
    -------
    ndarray, shape (n_sequences, P)
    """
    n_frames = times.shape[1]
    if n_frames < 5:
        return times
    base, frames = base if base.ndim == 3 else base[np.newaxis], np.arange(n_frames)
    low, high = np.maximum(frames - reach, 0), np.minimum(frames + reach, n_frames - 1)
    energy = np.square(base - base.mean(axis=1, keepdims=True)).sum(axis=(1, 2))
    rounding = np.square(16 * np.finfo(base.dtype).eps) * energy / n_frames
    splines = CubicSpline(frames, moving, axis=1).c.astype(moving.dtype, copy=False)
    splines = np.ascontiguousarray(splines.transpose(2, 1, 0, 3))
    independent = independent_frames(n_frames, noise_width)
    refined = times.astype(np.float64)
    active = np.arange(len(moving))
    for _ in range(steps):
        own = slice(None) if len(base) == 1 else active
        values, tangents = _evaluate(splines, active, refined[active])
        fitted, gain = _fit_gain(base[own], values)
        slope, residual = gain * tangents, base[own] - fitted
        noise = typical_energy(residual, independent) / n_frames
        pull = np.vecdot(slope, slope)[:, 1:-1]
        going = (noise > rounding[own]) & pull.any(axis=1)
        active, noise, pull = active[going], noise[going], pull[going]
        if len(active) == 0:
            break
        push = np.vecdot(slope, residual)[going, 1:-1]
        stiffness = np.maximum(noise * (n_frames / _RATE_CHANGE) ** 2, 1e-9 * pull.mean(axis=1))
        step = _solve(refined[active, 1:-1], pull, push, stiffness)
        tau = refined[active]
        tau[:, 1:-1] += np.clip(step, -_LONGEST_STEP, _LONGEST_STEP)
        refined[active] = np.maximum.accumulate(np.clip(tau, low, high), axis=1)
        active = active[np.abs(step).max(axis=1) >= _SHORTEST_STEP]
    return refined


def _evaluate(splines, active, times):
    """Cubic splines on whole frames, and their derivatives, each at times of its own.

    Their coefficients are (n_sequences, P - 1, 4, n_features), the highest power first.
    """
    pieces = splines.shape[1]
    left = np.clip(times.astype(np.intp), 0, pieces - 1)
    x = (times - left).astype(splines.dtype)[:, :, np.newaxis]
    at = left + pieces * active[:, np.newaxis]
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


def _solve(inner, pull, push, stiffness):
    """Steps of all warps: their systems, one below the other, are a single banded one."""
    n_frames = inner.shape[1] + 2
    band, border = curvature(n_frames)
    system = band[:, np.newaxis] * stiffness[:, np.newaxis]
    system[-1] += pull
    target = pull * inner + push - stiffness[:, np.newaxis] * border
    solved = solveh_banded(system.reshape(3, -1), target.ravel())
    return solved.reshape(inner.shape) - inner


def independent_frames(n_frames, width):
    """So many frames tell as much of a covariance as white noise does that a Gaussian smoothed."""
    return n_frames / max(1, np.sqrt(2 * np.pi) * width)


def typical_energy(curves, independent=np.inf):
    """The energy of a typical feature of centred curves (n_sequences, P, n_features).

    All their energy, shared among as many features as vary on their own: ``tr(C)^2 / tr(C^2)`` of
    their covariance C. A covariance from few independent frames seems to tie features together:
    what that adds to ``tr(C^2)`` is taken off.
    """
    energy = np.square(curves).sum(axis=(1, 2))
    together = np.square(np.matmul(curves.swapaxes(1, 2), curves)).sum(axis=(1, 2))
    typical = together / np.where(energy > 0, energy, 1)
    unbiased = (typical - energy / independent) / (1 + 1 / independent)
    return np.maximum(unbiased, typical / 4)


def _gaussian(sigma):
    """Weights of a Gaussian filter."""
    reach = int(np.ceil(4 * sigma))
    weights = np.exp(-0.5 * (np.arange(-reach, reach + 1) / sigma) ** 2)
    return weights / weights.sum()


def _fit_gain(base, matched):
    """``g * matched + o``, and ``g``: least squares, gains drawn a little towards 1.

    Base and ``matched`` are (n_sequences, P, n_features), ``g`` (n_sequences, 1, n_features).
    """
    middle = base.mean(axis=1, keepdims=True)
    x, y = base - middle, matched - matched.mean(axis=1, keepdims=True)
    energy = np.square(y).sum(axis=1, keepdims=True)
    ridge = _RIDGE * typical_energy(y)[:, np.newaxis, np.newaxis]
    # Nothing moves: any gain fits.
    ridge[ridge == 0] = 1
    gain = ((x * y).sum(axis=1, keepdims=True) + ridge) / (energy + ridge)
    return gain * y + middle, gain


def curvature(n_frames):
    """``sum (tau'')^2`` for free inner frames: upper band, and what the pinned ends add."""
    band = np.zeros((3, n_frames - 2))
    band[2] = 6
    band[2, [0, -1]] = 5
    band[1, 1:] = -4
    band[0, 2:] = 1
    border = np.zeros(n_frames - 2)
    border[-2:] = 1, -2
    return band, border * (n_frames - 1)
