"""Self-correlation of a take: where it repeats, and its period, or whether it has one."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import pandas as pd
from scipy.fft import irfft, next_fast_len, rfft
from scipy.ndimage import uniform_filter1d

from ..inputs.collections import as_collection, check_members
from ..inputs.tables import as_pandas
from ..inputs.types import TrialLike
from ..inputs.wording import counted
from ..matching.counting import first_largest, first_smallest, parabola_vertex, whole
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


# -- where in a take it repeats by itself ---------------------------------------------------------

# Lags in frames at which a take is compared with itself, in groups that are filtered alike; for
# longer ones the take is halved again and again, and compared at the last of these.
_GROUPS = ((3, 6), (6, 12), (12, 24), (24, 48))
# Width of the Gaussian, as a share of the lag.
_WIDTH = 1 / 24
# Frames repeat if their similarity exceeds the first number, and their movement the second one, as
# a share of the mean energy of the stretch (at first: of the largest energy of the take).
_SIMILAR, _MOVES = 0.4, 0.05
# Where the evidence falls by so much, times the period, the movement pauses: by about 1 where the
# body stands for a period.
_PAUSE = 0.75
# Proposals hold at least so many periods: fewer than `LEAST_CYCLES`, as their ends are not final.
_LEAST_PROPOSED = 1.5
# A stretch that ends so near to an end of the take, in periods, goes on to it: in the last part of
# a cycle a body may hardly move.
_NEAR_END = 0.5
# Proposals of a part of a take that are tried; those of about the same lag and place are one.
_TRIES, _SAME_LAG, _SAME_PLACE = 6, 1.25, 0.5
# What a strength counts at most, where other movements could have repeated by chance.
_HIGHEST = 0.98


class Repetition(NamedTuple):
    """Frames of a take that repeat, ``stop`` excluded, and their self-correlation."""

    start: int
    stop: int
    correlation: SelfCorrelation


class Repeats(NamedTuple):
    """What repeats in a take.

    ``stretches`` are in order of time; ``correlation`` is the self-correlation of the longest one,
    with the cycles of all, or that of the take if there is none; then ``reason`` tells why.
    """

    stretches: list[Repetition]
    correlation: SelfCorrelation
    reason: str


def find_repeats(x, threshold, limits=None):
    """Stretches of a take (n_frames, n_features) in which its movement repeats, as `Repeats`.

    Every lag proposes the interval whose frames repeat best one lag later. The proposal that
    explains most movement, times the number of its periods, is tried first: the self-correlation
    gives its period, its ends are found again at this period, and it is judged by the threshold of
    the self-correlation. The parts before and behind an accepted stretch are searched in the same
    way. ``limits`` are the least and the largest number of frames of a period.
    """
    take, stretches, open_parts = _Take(x, limits), [], [(0, len(x))]
    while open_parts:
        part = open_parts.pop()
        stretch = _find_first(take, part, threshold)
        if stretch is not None:
            stretches.append(stretch)
            open_parts += [(part[0], stretch.start), (stretch.stop, part[1])]
    if not stretches:
        correlation = correlate(x, limits)
        return Repeats([], correlation, rejection_reason(correlation, threshold) or "not cyclic")
    return summary_of(sorted(stretches, key=lambda stretch: stretch.start))


def summary_of(stretches):
    """What repeats in a take that has stretches."""
    longest = max(stretches, key=lambda stretch: stretch.stop - stretch.start)
    n_cycles = sum(stretch.correlation.n_cycles for stretch in stretches)
    return Repeats(stretches, longest.correlation._replace(n_cycles=n_cycles), "")


def _find_first(take, part, threshold):
    """The first proposal, in a part of a take, that is accepted; None without any."""
    tried = []
    for proposal in take.proposals(part):
        start, stop, lag, group = proposal
        if any(
            _ratio(lag, other_lag) < _SAME_LAG
            and min(stop, last) - max(start, first)
            > _SAME_PLACE * (max(stop, last) - min(start, first))
            for first, last, other_lag in tried
        ):
            continue
        if len(tried) == _TRIES:
            break
        tried.append((start, stop, lag))
        correlation = correlate(take.x[start:stop], take.limits)
        for _ in range(2):
            ends = (
                take.ends(correlation.period, (start, stop), part) if correlation.n_cycles else None
            )
            if ends is None:
                break
            again = correlate(take.x[ends[0] : ends[1]], take.limits)
            if not again.n_cycles or _ratio(again.period, correlation.period) > _SAME_LAG:
                break
            (start, stop), correlation = ends, again
        if not rejection_reason(correlation, threshold):
            required = take.required(correlation, group.places(start, stop), threshold)
            if min(correlation.strength, _HIGHEST) >= required:
                return Repetition(int(start), int(stop), correlation)
    return None


def _ratio(one, other):
    return max(one, other) / min(one, other)


class _Take:
    """A take, and at every lag the evidence that its frames repeat."""

    def __init__(self, x, limits):
        self.x = x.astype(np.float64) - x[0]
        self.x -= self.x.mean(axis=0)
        self.limits, self.noise = limits, noise_of(self.x)
        smoothed = smooth(self.x[np.newaxis], smoothing_width(self.x))[0]
        self.breadth, self.groups = breadth_of(smoothed), []
        longest, step, samples, groups = len(x) / LEAST_CYCLES, 1, self.x, _GROUPS
        least, most = (0, np.inf) if limits is None else limits
        while groups[0][0] * step <= longest:
            for group in groups:
                lags = np.arange(group[0], group[1])
                frames = lags * step
                lags = lags[
                    (frames <= min(longest, most * _SAME_LAG)) & (frames >= least / _SAME_LAG)
                ]
                if len(lags):
                    self.groups.append(_Group(samples, step, lags, self.noise / step))
            samples, step, groups = smooth(samples[np.newaxis], 1)[0][::2], 2 * step, _GROUPS[-1:]

    def proposals(self, part):
        """Start, stop, lag and group of the best interval of each lag, the best one first."""
        weighed = [
            (weight, (start, stop, lag, group))
            for group in self.groups
            for weight, start, stop, lag in group.proposals(part)
        ]
        return [proposal for _, proposal in sorted(weighed, key=lambda pair: -pair[0])]

    def ends(self, period, inside, part):
        """Start and stop of an interval at its period, within a part; None if it is too short."""
        lag = whole(period)
        first, last = (max(part[0], inside[0] - 2 * lag), min(part[1], inside[1] + 2 * lag))
        core = slice(inside[0] - first, inside[1] - first)
        signals = signals_at(self.x[first:last], lag, self.noise)
        evidence = evidence_at(lag, signals, [energy[core].mean() for _, energy in signals])
        _, start, stop = _best_interval(evidence, _PAUSE * lag)
        start, stop = first + start, first + stop + lag
        near = whole(_NEAR_END * period, "up")
        if start < near:
            start = 0
        if len(self.x) - stop < near:
            stop = len(self.x)
        return (start, stop) if stop - start >= whole(_LEAST_PROPOSED * period, "up") else None

    def required(self, correlation, places, threshold):
        """The strength that is required of one of several places of as much movement.

        At a single place chance correlations exceed ``r`` with a probability of about
        ``(1 - r**2) ** (n / 2)``; their degrees of freedom ``n`` are the breadth of the take at
        each repetition.
        """
        alone = required_strength(correlation.n_cycles, correlation.breadth, threshold)
        alone, freedom = min(alone, 1), self.breadth * (correlation.n_cycles - 1)
        return np.sqrt(1 - (1 - alone**2) * places ** (-2 / freedom))


class _Group:
    """Lags that are compared under one filter.

    ``samples`` (n_samples, n_features) are every ``step``-th frame of a take, lags count samples,
    and ``noise`` is the variance of white noise in a sample.
    """

    def __init__(self, samples, step, lags, noise):
        middle = np.sqrt(lags[0] * (lags[-1] + 1))
        signals = signals_at(samples, middle, noise)
        width = min(max(int(LEAST_CYCLES * middle), 1), len(samples))
        largest = [uniform_filter1d(e, width, mode="constant").max() for _, e in signals]
        self.step, self.lags, self.size = step, lags, largest[0]
        self.evidence = [evidence_at(k, signals, largest).astype(np.float32) for k in lags]
        self.moved = np.concatenate([[0], np.cumsum(signals[1][1])])

    def proposals(self, part):
        """The explained movement, times periods, of the best interval of each lag; it; the lag."""
        first, last = -(-part[0] // self.step), (part[1] - 1) // self.step + 1
        for lag, evidence in zip(self.lags, self.evidence, strict=True):
            least = (_LEAST_PROPOSED - 1) * lag
            inside = evidence[first : max(last - lag, first)]
            total, start, stop = _best_interval(inside)
            if stop - start >= max(least, 1):
                start, stop = ((first + k) * self.step for k in (start, stop + lag))
                yield total / lag * self.size, start, min(stop, part[1]), lag * self.step

    def places(self, start, stop):
        """The movement of the take as a multiple of that from one frame to another; at least 1."""
        first, last = start // self.step, -(-stop // self.step)
        moved = self.moved[min(last, len(self.moved) - 1)] - self.moved[first]
        return max(self.moved[-1] / moved, 1) if moved > 0 else np.inf


def signals_at(samples, lag, noise):
    """Poses less their moving mean, and velocities, as they suit a lag; with their energies."""
    width, signals = lag * _WIDTH, []
    for order in (0, 1):
        x = smooth(samples[np.newaxis], width, order)[0]
        if order == 0:
            x = x - uniform_filter1d(x, round(lag), axis=0, mode="nearest")
        energy = np.square(x).sum(axis=1) - noise * noise_gain(width, order)
        signals.append((x, np.maximum(energy, 0)))
    return signals


def evidence_at(lag, signals, sizes):
    """The evidence that each sample repeats one lag later: above 0 if it does.

    It is the product of both, less a share of the mean of their energies, and of ``sizes``.
    """
    total = 0.0
    for (x, energy), size in zip(signals, sizes, strict=True):
        products = np.einsum("ij,ij->i", x[:-lag], x[lag:])
        expected = _SIMILAR * (energy[:-lag] + energy[lag:]) / 2
        total = total + (products - expected) / max(size, 1e-300) - _MOVES
    return total


def _best_interval(values, deepest=np.inf):
    """The largest sum of neighbouring values, and where they begin and end, excluded.

    Within them the sum falls by ``deepest`` at most; otherwise they are the better one of both
    sides of the fall.
    """
    first, last = 0, len(values)
    while True:
        total, start, stop = _largest_sum(values, first, last)
        sums = np.concatenate([[0], np.cumsum(values[start:stop], dtype=np.float64)])
        falls = np.maximum.accumulate(sums) - sums
        if falls.max() <= deepest:
            return total, start, stop
        middle = start + first_largest(falls)
        sides = [(start, middle), (middle, stop)]
        first, last = max(sides, key=lambda side: _largest_sum(values, side[0], side[1])[0])


def _largest_sum(values, first, last):
    """The largest sum of neighbouring values in an interval, and where they begin and end."""
    sums = np.concatenate([[0], np.cumsum(values[first:last], dtype=np.float64)])
    gains = sums - np.minimum.accumulate(sums)
    stop = first_largest(gains)
    return gains[stop], first + first_smallest(sums[: stop + 1]), first + stop
