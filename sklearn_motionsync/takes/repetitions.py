"""Where a take repeats by itself, at which period."""

from typing import NamedTuple

import numpy as np
from scipy.ndimage import uniform_filter1d

from ..matching.counting import first_largest, first_smallest, whole
from ..matching.filters import smooth
from .self_correlation import (
    LEAST_CYCLES,
    SelfCorrelation,
    breadth_of,
    correlate,
    noise_gain,
    noise_of,
    rejection_reason,
    required_strength,
    smoothing_width,
)

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
# Stretches of a slowly changing pace are one: their periods differ up to the first ratio, and
# between them are so many periods.
_SAME_PACE, _BETWEEN = 1.3, 0.25
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
    return summary_of(_join(take, sorted(stretches, key=lambda s: s.start), threshold))


def summary_of(stretches):
    """What repeats in a take that has stretches."""
    longest = max(stretches, key=lambda stretch: stretch.stop - stretch.start)
    n_cycles = sum(stretch.correlation.n_cycles for stretch in stretches)
    return Repeats(stretches, longest.correlation._replace(n_cycles=n_cycles), "")


def _join(take, stretches, threshold):
    """Neighbours of nearly the same period as one stretch."""
    joined = stretches[:1]
    for stretch in stretches[1:]:
        before, (a, b) = joined[-1], (joined[-1].correlation, stretch.correlation)
        near = stretch.start - before.stop <= whole(_BETWEEN * min(a.period, b.period), "down")
        if near and _ratio(a.period, b.period) <= _SAME_PACE:
            start, stop = before.start, stretch.stop
            correlation = correlate(take.x[start:stop], take.limits)
            if (
                rejection_reason(correlation, threshold)
                or _ratio(correlation.period, a.period) > _SAME_PACE
            ):
                # The pace changes too much for a single period.
                longer = max(before, stretch, key=lambda one: one.stop - one.start).correlation
                n_cycles = a.n_cycles + b.n_cycles
                period = (stop - start) / n_cycles
                correlation = longer._replace(period=period, n_cycles=n_cycles)
            joined[-1] = Repetition(start, stop, correlation)
        else:
            joined.append(stretch)
    return joined


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
