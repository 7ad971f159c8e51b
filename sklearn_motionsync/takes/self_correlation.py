"""Self-correlation of a take: its period, or whether it has one."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import pandas as pd
from scipy.fft import irfft, next_fast_len, rfft

from ..inputs.collections import as_collection, check_members
from ..inputs.tables import as_pandas
from ..inputs.types import TrialLike
from ..inputs.wording import counted
from ..matching.counting import parabola_vertex, whole
from ..matching.filters import smooth

# Cycles that a take must hold at least to show that it repeats.
LEAST_CYCLES = 1.6
# The shortest overlap of a take with itself, as a share of the take.
_OVERLAP = 0.3
# Multiples of a period have peaks, too: the period is at the first peak of this share of the
# highest.
_NEAR = 0.9
# Of a period that many times longer than another one a take must hold two.
_FAR = 2.5
# Other cycles fit where the strength is this share of the one that the default threshold requires.
_FITS, _THRESHOLD = 0.6, 0.4
# A lag this near to a multiple of a period is that multiple; lags of a lower ratio are one.
_MULTIPLE, _DISTINCT = 0.1, 1.25
# Before a peak the correlation falls below this share of the peak, or the peak is a noise ripple.
_FALL = 0.5
# Width of the smoothing, as a share of the time scale of the movement.
_SMOOTHING = 1 / 4
# A lower breadth of the movement raises the required strength.
_BROAD = 2.25
# Variances below this share of the total are rounding errors.
_NOTHING = 1e-12


class SelfCorrelation(NamedTuple):
    """Result of `self_correlation`.

    Attributes
    ----------
    correlation : ndarray, shape (n_lags,)
        Correlation of the take with itself at lags of 0, 1, ... frames, up to 70 % of the take: the
        mean of ``pose`` and ``velocity``, from -1 to 1.
    pose, velocity : ndarray, shape (n_lags,)
        Correlations of the poses, and of their velocities.
    peaks : ndarray of int
        Lags of the maxima before which the correlation falls below half their height.
    period : float
        Frames of a cycle, with fractions: the lag of the first peak that reaches 90 % of the
        highest. NaN without any.
    strength : float
        The correlation at the period; 0 without any.
    n_cycles : float
        Length of the take in periods; 0 without any.
    breadth : float
        Participation ratio of the variances along the principal components, the effective number of
        dimensions: the squared sum of the variances by the sum of their squares, 1 for a single
        feature. The smaller it is, the larger are chance correlations of noise.
    periods : ndarray of float
        Frames of all cycles that fit, in increasing order, ``period`` among them: where every
        second or fourth step is stronger, those of a step, of two, and of four. Peaks that reach 60
        % of the strength of a cyclic take, without the multiples of a period that is as strong.
    """

    correlation: np.ndarray
    pose: np.ndarray
    velocity: np.ndarray
    peaks: np.ndarray
    period: float
    strength: float
    n_cycles: float
    breadth: float
    periods: np.ndarray


def self_correlation(take: TrialLike) -> SelfCorrelation:
    r"""Correlate a take with itself at every lag, to find the period of what repeats.

    At lag :math:`L` it correlates the frames :math:`a(t) = x(t)` and :math:`b(t) = x(t + L)`, less
    their means over the overlap:

    .. math:: r(L) = \frac{\sum_t \langle a(t), b(t) \rangle}
              {\sqrt{\sum_t |a(t)|^2 \; \sum_t |b(t)|^2}}

    The result is the mean of the correlations of poses and of velocities. Velocities alone
    mistake one stroke of several for a cycle; poses alone are sensitive to slow changes. At
    every lag at least 30 % of the take overlap.

    Parameters
    ----------
    take : array-like or DataFrame, shape (n_frames, n_features)
        One take. Features are weighted by their variance; of joint positions give those that
        `DirectionCosines` makes of them.

    Returns
    -------
    SelfCorrelation
        The correlation at every lag, its peaks, and the period.

    Raises
    ------
    ValueError
        If the take breaks the contract of one trial.

    See Also
    --------
    CycleSegmenter : Cuts takes into cycles.

    Notes
    -----
    Poses are smoothed by a Gaussian whose standard deviation is a fourth of the square root of
    their variance divided by the variance of their change per frame: for a sine, a twenty-fifth of
    its period. Time and memory grow as those of a Fourier transform of the take.

    References
    ----------
    H. Ning, T. Tan, L. Wang, W. Hu: Kinematics-based tracking of human walking in monocular video
    sequences. Image and Vision Computing 22 (2004) 429-441.

    Examples
    --------
    >>> import numpy as np
    >>> from sklearn_motionsync.takes import self_correlation
    >>> t = np.arange(200)
    >>> take = np.column_stack([np.sin(2 * np.pi * t / 63), np.cos(2 * np.pi * t / 63)])
    >>> result = self_correlation(take)
    >>> round(result.period, 1), round(result.strength, 2), round(result.n_cycles, 1)
    (63.0, 1.0, 3.2)
    >>> self_correlation(take[:70]).period
    nan
    """
    take = as_pandas(take)
    several = as_collection(take)
    if several is not None and not (isinstance(take, pd.DataFrame) and len(several) == 1):
        raise ValueError(
            f"Give one take, (n_frames, n_features), got {counted(len(several), 'trial')}; "
            "for several use CycleSegmenter().report(X)."
        )
    (array,) = check_members([take])
    return correlate(np.asarray(array))


def correlate(x, limits=None):
    """`self_correlation` of features (n_frames, n_features) that were checked.

    ``limits`` are the least and the largest number of frames of a period.
    """
    n_frames = len(x)
    x = x.astype(np.float64) - x[0]
    x -= x.mean(axis=0)
    width, n_lags, noise = smoothing_width(x), int((1 - _OVERLAP) * n_frames) + 1, noise_of(x)
    smoothed = [smooth(x[np.newaxis], width, order)[0] for order in (0, 1)]
    pose, velocity = (
        _autocorrelation(y, n_lags, noise * noise_gain(width, order))
        for order, y in enumerate(smoothed)
    )
    breadth, correlation = breadth_of(smoothed[0]), (pose + velocity) / 2
    # Maxima above 0 before which the correlation of poses falls below half their height.
    inner, before, after = correlation[1:-1], correlation[:-2], correlation[2:]
    peaks = np.flatnonzero((inner > before) & (inner >= after) & (inner > 0)) + 1
    peaks = peaks[np.minimum.accumulate(pose)[peaks] < _FALL * correlation[peaks]]
    offsets, values = parabola_vertex(*(correlation[peaks + k] for k in (-1, 0, 1)))
    lags = peaks + offsets
    if limits is not None:
        inside = (limits[0] <= lags) & (lags <= limits[1])
        lags, values = lags[inside], values[inside]
    period, periods, strength, n_cycles = np.nan, np.empty(0), 0.0, 0.0
    if len(lags):
        required = required_strength(n_frames / lags, breadth, _THRESHOLD)
        # A take that holds a movement twice shows that it repeats; others count, too, unless one
        # that is strong is far shorter.
        strong = lags[values >= required]
        far = lags > _FAR * (strong[0] if len(strong) else np.inf)
        shown = (n_frames >= whole(2 * lags, "up")) | ~far
        first = int(np.argmax(values >= _NEAR * values[shown].max()))
        period, strength = float(lags[first]), float(values[first])
        n_cycles = n_frames / period
        fits = shown & (values >= _FITS * required)
        fits &= np.maximum(lags / period, period / lags) >= _DISTINCT
        fits[first] = True
        periods = _distinct_periods(lags[fits], values[fits], period)
    return SelfCorrelation(
        correlation, pose, velocity, peaks, period, strength, n_cycles, breadth, periods
    )


def _distinct_periods(lags, values, period):
    """Lags without those that a shorter one explains: near it, or multiples that hardly exceed it.

    The ``period`` is kept.
    """
    distinct = []
    for lag, value in zip(lags, values, strict=True):
        ratios, other_values = (
            lag / np.array([k for k, _ in distinct]),
            np.array([v for _, v in distinct]),
        )
        multiples = np.round(ratios)
        repeats = np.abs(ratios - multiples) <= _MULTIPLE * multiples
        explained = (ratios < _DISTINCT) | (repeats & (other_values >= _NEAR * value))
        if lag == period or not explained.any():
            distinct.append((lag, value))
    return np.array([lag for lag, _ in distinct])


def required_strength(n_cycles, breadth, threshold):
    """The strength from which a movement of so many cycles is cyclic.

    All cycles but one are correlated with others. Chance correlations are larger if these are less
    than one cycle, and for movements in few directions.
    """
    overlap = np.clip(np.asarray(n_cycles) - 1, 1e-12, 1)
    required = 1 - (1 - threshold) * min(1, np.sqrt(breadth / _BROAD))
    return required / np.sqrt(overlap)


def rejection_reason(correlation, threshold):
    """Why a take cannot be segmented; empty, if it can."""
    required = required_strength(correlation.n_cycles, correlation.breadth, threshold)
    if not correlation.n_cycles or correlation.strength < required:
        return "not cyclic"
    hundredths = whole(100 * correlation.n_cycles, "down")
    return "" if hundredths >= 100 * LEAST_CYCLES else f"holds {hundredths / 100:.2f} cycles"


def breadth_of(x):
    """The participation ratio of the variances of features along their principal components."""
    x = x - x.mean(axis=0)
    products = x.T @ x
    total = np.trace(products)
    return float(1 / np.square(products / total).sum()) if total > 0 else 1.0


def smoothing_width(x):
    """Standard deviation, in frames, of the Gaussian that smooths centred features."""
    change, bend = (np.square(np.diff(x, k, axis=0)).sum() / max(len(x) - k, 1) for k in (1, 2))
    # White noise of variance 1 has first differences of variance 2 and second ones of variance 6.
    change = max(change - bend / 3, change / 100)
    return _SMOOTHING * np.sqrt(np.square(x).sum() / len(x) / change) if change > 0 else 0.0


def noise_of(x):
    """Variance of white noise in centred features, reduced by its share of the whole variance."""
    bends = np.diff(x, 3, axis=0)
    energy = np.square(x).sum() / len(x)
    # Third differences of white noise have 1 + 9 + 9 + 1 times its variance; those of slow movement
    # are small.
    noise = np.square(bends).sum() / (20 * max(len(bends), 1))
    return noise * max(1 - noise / energy, 0) if energy > 0 else 0.0


def noise_gain(width, order):
    """The share of the variance of white noise that passes a filter."""
    middle = int(np.ceil(4 * width)) + 2
    impulse = np.zeros((1, 2 * middle + 1, 1))
    impulse[0, middle] = 1
    return np.square(smooth(impulse, width, order)).sum()


def _autocorrelation(x, n_lags, noise):
    """The correlation of features with themselves at every lag, less the means of each overlap.

    ``noise`` is the variance of noise in a frame.
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
