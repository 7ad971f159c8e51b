"""How much a take is like itself some time later: what tells its period, or that it has none."""

from typing import NamedTuple

import numpy as np
import pandas as pd
from scipy.fft import irfft, next_fast_len, rfft

from ..body.direction_cosines import DirectionCosines
from ..inputs.collections import as_collection, check_members
from ..inputs.tables import as_pandas
from ..matching.filters import smooth

__all__ = [
    "LEAST_CYCLES",
    "SelfCorrelation",
    "asked_of",
    "correlate",
    "lack_of",
    "reason_of",
    "self_correlation",
]

# Of shorter takes nobody can say that they repeat.
LEAST_CYCLES = 1.6
# The shortest overlap of a take with itself, as a share of it.
_OVERLAP = 0.3
# The first peak counts that comes so near to the highest: multiples of a period have peaks, too.
_NEAR = 0.9
# Before a peak the correlation falls below this share of it; what does not is a ripple of noise.
_FALL = 0.5
# Width of the smoothing, as a share of the time in which the movement changes.
_SMOOTHING = 1 / 4
# Of narrower movements more is asked.
_BROAD = 2.25
# Variances below this share of the whole are rounding.
_NOTHING = 1e-12


class SelfCorrelation(NamedTuple):
    """What `self_correlation` finds.

    Attributes
    ----------
    correlation : ndarray, shape (n_lags,)
        Of the take with itself a number of frames later, from -1 to 1: the mean of the two that
        follow. Lags are 0, 1, ... frames, up to 70 % of the take.
    posture, velocity : ndarray, shape (n_lags,)
        Of where the movement is, and of how it goes on.
    peaks : ndarray of int
        Lags of those maxima before which the correlation falls below half of them.
    period : float
        Frames of a cycle, with fractions: where the first peak is that reaches 90 % of the highest.
        NaN without any.
    strength : float
        The correlation there, 0 without any.
    n_cycles : float
        Frames of the take by those of a cycle; 0 without any.
    breadth : float
        How many directions of equal variance the movement is worth, the squared sum of the
        variances along its principal components by the sum of their squares: 1 for a single
        feature. The fewer, the more easily noise is like itself.
    """

    correlation: np.ndarray
    posture: np.ndarray
    velocity: np.ndarray
    peaks: np.ndarray
    period: float
    strength: float
    n_cycles: float
    breadth: float


def self_correlation(take, skeleton=None):
    r"""Compare a take with itself at every lag: what repeats is like itself after a period.

    Of a lag :math:`L` it compares the frames :math:`a(t) = x(t)` and :math:`b(t) = x(t + L)`, from
    which the means of this overlap are taken:

    .. math:: r(L) = \frac{\sum_t \langle a(t), b(t) \rangle}
              {\sqrt{\sum_t |a(t)|^2 \; \sum_t |b(t)|^2}}

    The correlation is the mean of that of the postures and that of their velocities. Velocity by
    itself takes one stroke of several for the whole; posture by itself sees slow changes. Lags are
    those at which at least 30 % of the take overlap.

    Parameters
    ----------
    take : array-like or DataFrame, shape (n_frames, n_features)
    skeleton : Skeleton, default=None
        That of joint positions, whose direction cosines are compared; None compares the features
        as they are, of which those with the largest variance count most.

    Returns
    -------
    SelfCorrelation

    Raises
    ------
    ValueError
        If the take breaks the contract of one performance.

    See Also
    --------
    CycleSegmenter : Cuts takes into cycles.

    Notes
    -----
    Postures are smoothed by a Gaussian, a fourth as wide as the root of their variance by that of
    their change in a frame: of a sine, a twenty-fifth of its period. Time and memory grow with the
    take as a Fourier transform of it does.

    References
    ----------
    H. Ning, T. Tan, L. Wang, W. Hu: Kinematics-based tracking of human walking in monocular video
    sequences. Image and Vision Computing 22 (2004) 429-441.

    Examples
    --------
    >>> import numpy as np
    >>> from sklearn_motionsync import self_correlation
    >>> t = np.arange(200)
    >>> take = np.column_stack([np.sin(2 * np.pi * t / 63), np.cos(2 * np.pi * t / 63)])
    >>> found = self_correlation(take)
    >>> round(found.period, 1), round(found.strength, 2), round(found.n_cycles, 1)
    (63.0, 1.0, 3.2)
    >>> self_correlation(take[:70]).period
    nan
    """
    take = as_pandas(take)
    several = as_collection(take)
    if several is not None and not (isinstance(take, pd.DataFrame) and len(several) == 1):
        raise ValueError(
            f"Give one take, (n_frames, n_features), got {len(several)} performances; "
            "CycleSegmenter().report(X) tells of several."
        )
    (array,) = check_members([take])
    if skeleton is not None:
        (array,) = DirectionCosines(skeleton).fit_transform([take])
    return correlate(np.asarray(array))


def correlate(x):
    """`self_correlation` of features (n_frames, n_features) that were checked."""
    n_frames = len(x)
    x = x.astype(np.float64) - x[0]
    # In units of a power of two no square is out of range.
    x = np.ldexp(x, -int(np.frexp(np.abs(x).max())[1]))
    x -= x.mean(axis=0)
    width, n_lags, noise = _width(x), int((1 - _OVERLAP) * n_frames) + 1, _noise(x)
    smoothed = [smooth(x[np.newaxis], width, order)[0] for order in (0, 1)]
    posture, velocity = (
        _normalized(y, n_lags, noise * _left_of_noise(width, order))
        for order, y in enumerate(smoothed)
    )
    breadth = _breadth(smoothed[0])
    correlation = (posture + velocity) / 2
    peaks = _peaks_of(correlation, posture)
    if len(peaks) == 0:
        return SelfCorrelation(correlation, posture, velocity, peaks, np.nan, 0.0, 0.0, breadth)
    lags, values = _vertices(correlation, peaks)
    first = int(np.argmax(values >= _NEAR * values.max()))
    period, strength = float(lags[first]), float(values[first])
    told = period, strength, n_frames / period, breadth
    return SelfCorrelation(correlation, posture, velocity, peaks, *told)


def asked_of(n_cycles, breadth, threshold):
    """The strength from which so many cycles of a movement are a repetition.

    The take is compared with itself over all cycles but one. If these are less than a whole one, or
    if the movement has hardly more than one direction, it is more likely by chance that they are
    alike.
    """
    met = np.clip(np.asarray(n_cycles) - 1, 1e-12, 1)
    asked = 1 - (1 - threshold) * min(1, np.sqrt(breadth / _BROAD))
    return asked / np.sqrt(met)


def reason_of(found, threshold):
    """Why a take cannot be segmented; empty, if it can."""
    if not found.n_cycles or found.strength < asked_of(found.n_cycles, found.breadth, threshold):
        return "not cyclic"
    enough = found.n_cycles >= LEAST_CYCLES
    return "" if enough else f"holds {np.floor(100 * found.n_cycles) / 100:.2f} cycles"


def lack_of(found, threshold):
    """What is missing of a self-correlation that is not cyclic."""
    if not found.n_cycles:
        return "has no peak"
    asked = (
        f"{asked_of(found.n_cycles, found.breadth, threshold):.2f} at {found.n_cycles:.2f} cycles"
    )
    return f"has the strength {found.strength:.2f}, below {threshold=:g} ({asked})"


def _breadth(x):
    """The participation ratio of the variances of features along their principal components."""
    x = x - x.mean(axis=0)
    products = x.T @ x
    total = np.trace(products)
    return float(1 / np.square(products / total).sum()) if total > 0 else 1.0


def _width(x):
    """Standard deviation, in frames, of a Gaussian that leaves the movement of centred features."""
    change, bend = (np.square(np.diff(x, k, axis=0)).sum() / max(len(x) - k, 1) for k in (1, 2))
    # White noise adds 2 to the square of a change where it adds 6 to that of a second difference.
    change = max(change - bend / 3, change / 100)
    return _SMOOTHING * np.sqrt(np.square(x).sum() / len(x) / change) if change > 0 else 0.0


def _noise(x):
    """White noise a frame in the square of centred features, in the share that is none."""
    bends = np.diff(x, 3, axis=0)
    energy = np.square(x).sum() / len(x)
    # It adds 1 + 9 + 9 + 1 to the square of a third difference, slow movement hardly anything.
    noise = np.square(bends).sum() / (20 * max(len(bends), 1))
    return noise * max(1 - noise / energy, 0) if energy > 0 else 0.0


def _left_of_noise(width, order):
    """The share of the variance of white noise that is left by a filter."""
    middle = int(np.ceil(4 * width)) + 2
    impulse = np.zeros((1, 2 * middle + 1, 1))
    impulse[0, middle] = 1
    return np.square(smooth(impulse, width, order)).sum()


def _normalized(x, n_lags, noise):
    """The correlation of features with themselves at every lag, means of each overlap removed.

    ``noise`` of the squares of every frame is noise.
    """
    n, lags = len(x), np.arange(n_lags)
    x = x - x.mean(axis=0)
    size = next_fast_len(2 * n, real=True)
    spectrum = rfft(x, size, axis=0)
    products = irfft((spectrum.real**2 + spectrum.imag**2).sum(axis=1), size)[:n_lags]
    counts = n - lags
    sums = np.concatenate([np.zeros((1, x.shape[1])), np.cumsum(x, axis=0)])
    energy = np.concatenate([[0], np.cumsum(np.square(x).sum(axis=1))])
    early, late = sums[counts], sums[n] - sums[lags]
    of_early = energy[counts] - np.square(early).sum(axis=1) / counts
    of_late = energy[n] - energy[lags] - np.square(late).sum(axis=1) / counts
    products -= (early * late).sum(axis=1) / counts
    least = _NOTHING * energy[n]
    moves = (of_early > least) & (of_late > least)
    of_early, of_late = (np.maximum(of - counts * noise, of / 2) for of in (of_early, of_late))
    out = np.zeros(n_lags)
    out[moves] = products[moves] / np.sqrt(of_early[moves] * of_late[moves])
    return np.clip(out, -1, 1)


def _peaks_of(correlation, posture):
    """Maxima above 0 before which that of the postures falls below half of them."""
    inner, before, after = correlation[1:-1], correlation[:-2], correlation[2:]
    peaks = np.flatnonzero((inner > before) & (inner >= after) & (inner > 0)) + 1
    lowest = np.minimum.accumulate(posture)
    return peaks[lowest[peaks] < _FALL * correlation[peaks]]


def _vertices(correlation, peaks):
    """Where parabolas through peaks and their neighbours have their maxima, and these."""
    before, here, after = (correlation[peaks + k] for k in (-1, 0, 1))
    bend = before - 2 * here + after
    offsets = (before - after) / (2 * bend)
    return peaks + offsets, here - bend * offsets**2 / 2
