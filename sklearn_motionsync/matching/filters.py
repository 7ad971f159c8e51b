"""Gaussian filters along time, and derivatives under them."""

import functools

import numpy as np
from scipy.fft import irfft, next_fast_len, rfft
from scipy.ndimage import correlate1d, gaussian_filter1d
from sklearn import get_config

__all__ = ["SMOOTHING", "smooth"]

# Standard deviation of a Gaussian, as a share of the clip, that leaves the movement of people
# and takes away the noise of motion capture: docs/method.md, flat from 0.02 to 0.05.
SMOOTHING = 0.03
# Standard deviation, in samples, from which Fourier transforms are the faster filter.
_WIDE = 10


def smooth(on_clock, sigma, order=0):
    """Gaussian filter along time, or its derivative by the sample.

    Beyond the ends a sequence is continued by its own point reflection, so that a
    movement cut off in full swing keeps its velocity at the cut.
    """
    n_sequences = len(on_clock)
    out = np.empty_like(on_clock)
    # Half a dozen copies of what is handled at a time.
    room = get_config()["working_memory"] * 2**20 / 6
    size = max(1, int(room * n_sequences / max(1, on_clock.nbytes)))
    for start in range(0, n_sequences, size):
        rows = slice(start, start + size)
        out[rows] = _smooth(on_clock[rows], sigma, order)
    return out


def _smooth(on_clock, sigma, order):
    reach = min(int(np.ceil(4 * sigma)) + 1, on_clock.shape[1] - 1)
    before = 2 * on_clock[:, :1] - on_clock[:, reach:0:-1]
    after = 2 * on_clock[:, -1:] - on_clock[:, -2 : -reach - 2 : -1]
    continued = np.concatenate([before, on_clock, after], axis=1)
    # Below a third of a sample the derivative of a Gaussian is no derivative any more.
    sigma = max(sigma, 1 / 3)
    if sigma > _WIDE:
        beyond = _margin(sigma) - reach
        if beyond > 0:
            # The filter is longer than the reflections: their ends go on.
            continued = np.pad(continued, [(0, 0), (beyond, beyond), (0, 0)], mode="edge")
            reach += beyond
        return _convolve(continued, sigma, order)[:, reach:-reach]
    kernel = _kernel(float(sigma), order)
    return correlate1d(continued, kernel[::-1], axis=1, mode="nearest")[:, reach:-reach]


def _margin(sigma):
    """How far a filter reaches."""
    return int(4 * sigma + 0.5)


@functools.lru_cache(maxsize=64)
def _kernel(sigma, order):
    """What a filter makes of an impulse: its weights, the last first."""
    margin = _margin(sigma)
    impulse = np.zeros(2 * margin + 1)
    impulse[margin] = 1
    kernel = gaussian_filter1d(impulse, sigma, order=order, mode="constant")
    kernel.flags.writeable = False
    return kernel


def _convolve(sequences, sigma, order):
    """The same filter by Fourier transforms, for wide ones; the margins are of no use."""
    margin, kernel = _margin(sigma), _kernel(float(sigma), order)
    length = next_fast_len(sequences.shape[1] + 2 * margin, real=True)
    spectrum = rfft(kernel, length)[:, np.newaxis]
    out = np.empty_like(sequences)
    for result, sequence in zip(out, sequences, strict=True):
        # One at a time: no result may depend on what else is in the set.
        filtered = irfft(rfft(sequence, length, axis=0) * spectrum, length, axis=0)
        result[:] = filtered[margin : margin + len(sequence)]
    return out
