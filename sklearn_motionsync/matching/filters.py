"""Gaussian filters along time, derivatives under them, and the width that suits the noise."""

import functools

import numpy as np
from scipy.fft import irfft, next_fast_len, rfft
from scipy.ndimage import correlate1d, gaussian_filter1d
from sklearn import get_config

__all__ = ["SMOOTHING", "choose_smoothing", "smooth"]

# Standard deviation of a Gaussian, as a share of the clip, that preserves human movement
# and removes the noise of motion capture: docs/design.md.
SMOOTHING = 0.03
# Standard deviation, in samples, from which Fourier transforms are the faster filter.
_WIDE = 10
# Narrowest Gaussian that is one on a grid of frames.
LEAST_SIGMA = 0.35
# The noise is measured on at most so many sequences, for these shares of the clip.
_NOISE_SAMPLE = 256
_WIDTHS = (0.0, 0.005, 0.007, 0.01, 0.014, 0.02, 0.028, 0.04)


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
    reach = min(int(np.ceil(4 * sigma)) + 1, on_clock.shape[1] - 1)
    # Below a third of a sample the derivative of a Gaussian is no derivative any more.
    sigma = float(max(sigma, 1 / 3))
    kernel = _kernel(sigma, order)
    # Half a dozen copies of the sequences that are filtered at a time.
    memory = get_config()["working_memory"] * 2**20 / 6
    size = max(1, int(memory * n_sequences / max(1, on_clock.nbytes)))
    for start in range(0, n_sequences, size):
        some = on_clock[start : start + size]
        before = 2 * some[:, :1] - some[:, reach:0:-1]
        after = 2 * some[:, -1:] - some[:, -2 : -reach - 2 : -1]
        continued = np.concatenate([before, some, after], axis=1)
        if sigma > _WIDE:
            filtered = _convolve(continued, kernel, reach)
        else:
            filtered = correlate1d(continued, kernel[::-1], axis=1, mode="nearest")
            filtered = filtered[:, reach:-reach]
        out[start : start + size] = filtered
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


def _convolve(sequences, kernel, reach):
    """The same filter by Fourier transforms; without ``reach`` positions at both ends."""
    margin = len(kernel) // 2
    if margin > reach:
        # The filter is longer than the reflections: their ends go on.
        edges = [(0, 0), (margin - reach, margin - reach), (0, 0)]
        sequences, reach = np.pad(sequences, edges, mode="edge"), margin
    length = next_fast_len(sequences.shape[1] + 2 * margin, real=True)
    spectrum = rfft(kernel, length)[:, np.newaxis]
    out = np.empty_like(sequences)
    for result, sequence in zip(out, sequences, strict=True):
        # One at a time: no result may depend on the other sequences.
        filtered = irfft(rfft(sequence, length, axis=0) * spectrum, length, axis=0)
        result[:] = filtered[margin : margin + len(sequence)]
    return out[:, reach:-reach]


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
    on_clock = on_clock[:: -(-len(on_clock) // _NOISE_SAMPLE)]
    best, chosen = np.inf, 0.0
    for sigma in (share * (n_frames - 1) for share in _WIDTHS):
        # Without any smoothing there is no residual: a little smoothing stands for none.
        used = max(sigma, LEAST_SIGMA)
        residual = np.square(on_clock - smooth(on_clock, used)).sum(dtype=np.float64)
        grid = np.arange(-int(np.ceil(4 * used)), int(np.ceil(4 * used)) + 1)
        weights = np.exp(-0.5 * (grid / used) ** 2)
        score = residual / (1 - (weights / weights.sum()).max()) ** 2
        if score < best:
            best, chosen = score, sigma
    return chosen
