"""What the costs compare: the posture, how it moves, or its elastic square root."""

import numpy as np
from scipy.fft import irfft, next_fast_len, rfft
from scipy.ndimage import gaussian_filter1d
from sklearn import get_config

__all__ = ["cost_features", "smooth"]

# Standard deviation of a Gaussian, as a share of the clip, that leaves the movement of people
# and takes away the noise of motion capture: docs/method.md, flat from 0.02 to 0.05.
SMOOTHING = 0.03
# Standard deviation, in samples, from which Fourier transforms are the faster filter.
_WIDE = 10


def cost_features(on_clock, cost, subframes=1, smoothing=SMOOTHING):
    """Features of normalised sequences that a cost compares.

    Parameters
    ----------
    on_clock : ndarray, shape (n_sequences, Q, n_features)
        Linearly normalised sequences, ``subframes`` positions a frame.
    cost : {"posture", "velocity", "elastic"}
        ``"posture"``: the points themselves. ``"velocity"``: their derivative by the frame,
        smoothed. ``"elastic"``: the velocity divided by the square root of its length, whose
        squared distance is the Fisher-Rao distance.
    subframes : int, default=1
    smoothing : float, default=0.03
        Width of the smoothing, as a share of the clip.

    Returns
    -------
    ndarray, shape (n_sequences, Q, n_features)
    """
    if cost == "posture":
        return on_clock
    velocity = smooth(on_clock, smoothing * (on_clock.shape[1] - 1), order=1)
    velocity *= subframes
    if cost == "velocity":
        return velocity
    speed = np.linalg.norm(velocity, axis=2, keepdims=True)
    return velocity / np.sqrt(np.maximum(speed, np.finfo(speed.dtype).tiny))


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
        return _convolve(continued, sigma, order)[:, reach:-reach]
    filtered = gaussian_filter1d(continued, sigma, axis=1, order=order, mode="nearest")
    return filtered[:, reach:-reach]


def _convolve(sequences, sigma, order):
    """The same filter by Fourier transforms, for wide ones; the margins are of no use."""
    margin = int(4 * sigma + 0.5)
    impulse = np.zeros(2 * margin + 1)
    impulse[margin] = 1
    kernel = gaussian_filter1d(impulse, sigma, order=order, mode="constant")
    length = next_fast_len(sequences.shape[1] + 2 * margin, real=True)
    spectrum = rfft(kernel, length)[:, np.newaxis]
    out = np.empty_like(sequences)
    for result, sequence in zip(out, sequences, strict=True):
        # One at a time: no result may depend on what else is in the set.
        filtered = irfft(rfft(sequence, length, axis=0) * spectrum, length, axis=0)
        result[:] = filtered[margin : margin + len(sequence)]
    return out
