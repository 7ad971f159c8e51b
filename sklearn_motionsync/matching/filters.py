"""Gaussian filters along time, derivatives under them, and the white noise of sequences."""

import functools
import math

import numpy as np
from scipy.ndimage import correlate1d, gaussian_filter1d
from scipy.signal import fftconvolve
from sklearn import get_config

from .counting import ROUNDING

# Standard deviation of a Gaussian, as a share of the clip, that preserves human movement
# and removes the noise of motion capture; and a finer one, for velocities under a metric, which
# weights noise down, and for offsets after a vote: docs/design.md.
SMOOTHING, FINE_SMOOTHING = 0.03, 0.02
# Standard deviation, in samples, from which Fourier transforms are the faster filter.
_WIDE = 10
# Narrowest Gaussian that is one on a grid of frames: the derivative of a narrower one is none.
LEAST_SIGMA = 1 / 3
# Order of the differences whose variance is taken for that of white noise: docs/design.md.
_ORDER = 6
# Share of white noise in the energy of velocities of one feature that is small.
_NOISE = 0.01


def smooth(on_clock, sigma, order=0):
    """Gaussian filter along time, or its derivative by the sample.

    Beyond its ends a sequence is continued by its point reflection, so that a
    movement cut off in full swing keeps its velocity at the cut.

    Parameters
    ----------
    on_clock : ndarray, shape (n_sequences, P, n_features)
    sigma : float
        Standard deviation, in samples.
    order : int, default=0
        Order of the derivative.

    Returns
    -------
    ndarray, shape (n_sequences, P, n_features)
    """
    n_sequences = len(on_clock)
    out = np.empty_like(on_clock)
    reach = min(math.ceil(4 * sigma - ROUNDING) + 1, on_clock.shape[1] - 1)
    sigma = float(max(sigma, LEAST_SIGMA))
    kernel = _kernel(sigma, order)
    # Half a dozen copies of the sequences that are filtered at a time.
    memory = get_config()["working_memory"] * 2**20 / 6
    size = max(1, int(memory * n_sequences / max(1, on_clock.nbytes)))
    for start in range(0, n_sequences, size):
        batch = on_clock[start : start + size]
        before = 2 * batch[:, :1] - batch[:, reach:0:-1]
        after = 2 * batch[:, -1:] - batch[:, -2 : -reach - 2 : -1]
        continued = np.concatenate([before, batch, after], axis=1)
        if sigma > _WIDE and len(kernel) <= 2 * reach + 1:
            # One at a time: no result may depend on the other sequences.
            filtered = [fftconvolve(x, kernel[:, np.newaxis], "same", axes=0) for x in continued]
        else:
            filtered = correlate1d(continued, kernel[::-1], axis=1, mode="nearest")
        out[start : start + size] = np.asarray(filtered)[:, reach:-reach]
    return out


@functools.lru_cache(maxsize=64)
def _kernel(sigma, order):
    """Impulse response of a filter."""
    margin = int(4 * sigma + 0.5)
    impulse = np.zeros(2 * margin + 1)
    impulse[margin] = 1
    kernel = gaussian_filter1d(impulse, sigma, order=order, mode="constant")
    kernel.flags.writeable = False
    return kernel


def white_noise(arrays):
    """Variance of the white noise of every feature, by differences of sixth order: (n_features,).

    Movements hardly have any; of white noise they have the binomial coefficient of 12 and 6. NaN if
    all arrays are too short.

    Parameters
    ----------
    arrays : sequence of ndarray (n_frames_i, n_features)
    """
    long_enough = [x for x in arrays if len(x) > _ORDER]
    if not long_enough:
        return np.full(arrays[0].shape[1], np.nan)
    differences = (np.diff(x.astype(np.float64), _ORDER, axis=0) for x in long_enough)
    variances = [np.square(each).mean(axis=0) for each in differences]
    return np.mean(variances, axis=0) / math.comb(2 * _ORDER, _ORDER)


def noise_width(positions):
    """Width of the Gaussian under which white noise has a small share in the energy of velocities.

    The derivative of white noise of variance v under a Gaussian of width s has the variance ``v /
    (4 sqrt(pi) s^3)``. Of one feature it may have 1 % of the energy, of more in the mean as much
    times the root of their number: noise averages out.

    Parameters
    ----------
    positions : ndarray, shape (n_trials, P, n_features)

    Returns
    -------
    float
        In frames, at most 9.3 % of the clip, of noise alone; 0 if the noise is too small for any
        smoothing.
    """
    velocity = smooth(positions, FINE_SMOOTHING * (positions.shape[1] - 1), order=1)
    energy = np.square(velocity).mean(axis=(0, 1))
    moves = energy > 0
    if not moves.any():
        return 0.0
    share = (white_noise(positions)[moves] / energy[moves]).mean() / (4 * math.sqrt(math.pi))
    width = np.cbrt(share / (_NOISE * math.sqrt(moves.sum())))
    return float(width) if width > LEAST_SIGMA else 0.0
