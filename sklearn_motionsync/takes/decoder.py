"""The decoder of takes: which of their frames follow a cycle that was learnt, and at what phase.

A frame of a take is rest, another movement, or the learnt cycle at some phase. The cheapest path
through these states is found by dynamic programming, as a match is (Eqs. 12-17): the phase goes on
by 0 to 2 times the mean pace, a change of pace costs, and so does entering and leaving the cycle.
"""

from itertools import compress, pairwise
from typing import NamedTuple

import numpy as np
from scipy.fft import irfft, rfft

from ..matching.counting import first_largest, first_smallest, parabola_vertex, runs_of, whole
from ..matching.filters import smooth
from ..matching.warps import normalise

# Samples of a cycle, and positions per sample at which a path may stand.
PHASES, _SUBFRAMES = 32, 4
# Standard deviation, in samples, of the Gaussian derivative that gives velocities.
_SPEED_WIDTH = 1
# Weight of (rho - 1)^2, for poses and velocities of mean square 1 each; the largest rate rho.
_SMOOTHNESS, _FASTEST = 0.3, 2
# The cost of a sample of another movement, as a share of half the squares of it and of the cycle.
# That of rest is its squared velocity.
_OTHER = 0.6
# What it costs to enter the cycle or to leave it, except at the ends of a take.
_SWITCH = 4.0
# Cycles are as long as others up to this ratio.
AS_LONG = 1.25
# Cycles follow the pattern from this similarity on.
FOLLOWS = 0.5
# Stretches hold so many cycles at least.
_LEAST = 0.9
# Takes of fewer features must repeat by themselves: of 20 takes of smoothed noise 19 followed the
# cycle of a single feature, 7 that of two, 2 that of three.
_FEATURES = 3
# A piece at an end of a stretch is a whole cycle if it lacks no more of the pattern's movement: if
# cycles begin where it turns, and if they begin where it moves.
_LACKS_AT_REST, _LACKS = 0.05, 0.02
# The movement turns where the square of its velocity is below this share of the mean.
_TURNS = 0.25
# A known beginning of a cycle is at most so far from that of the match, in cycles.
_NEAR = 0.2


class SampledTake:
    """A take with about `PHASES` samples a cycle.

    Parameters
    ----------
    features : ndarray, shape (n_frames, n_features)
    period : float
        Frames of a cycle.
    inside : slice, default=None
        Frames in which the cycle repeats; by default those that move more than the others.

    Attributes
    ----------
    times : ndarray, shape (n_samples,)
        Frames of the samples, from the first to the last.
    values : ndarray, shape (n_samples, 2 * n_features)
        Poses less their mean inside, and velocities; each of mean square 1 there.
    inside : ndarray of bool, shape (n_samples,)
    """

    def __init__(self, features, period, inside=None):
        last = len(features) - 1
        self.period = period
        self.times = np.linspace(0, last, max(whole(last / period * PHASES), 1) + 1)
        self.poses = self.sample(smooth(features[np.newaxis], period / PHASES / 2)[0])
        self.velocities = smooth(self.poses[np.newaxis], _SPEED_WIDTH, 1)[0]
        if inside is None:
            speeds = np.square(self.velocities).sum(axis=1)
            self.standardise(speeds >= speeds.mean())
        else:
            self.standardise((self.times >= inside.start) & (self.times <= inside.stop - 1))

    @classmethod
    def of(cls, features, repetition):
        """A take at the period of a repetition, and standardised in it."""
        inside = slice(repetition.start, repetition.stop)
        return cls(features, repetition.correlation.period, inside)

    def standardise(self, inside):
        """Take the mean and the size of what moves from these samples, a mask."""
        self.inside = inside
        poses = self.poses - self.poses[inside].mean(axis=0)
        parts = [x / (_size(x[inside]) or 1) for x in (poses, self.velocities)]
        self.values = np.concatenate(parts, axis=1)

    def sample(self, values):
        """Values of the frames, (n_frames, n), at the samples."""
        return normalise([np.ascontiguousarray(values, dtype=np.float64)], len(self.times))[0]


def _size(x):
    return np.sqrt(np.square(x).sum() / len(x))


class Stretch(NamedTuple):
    """Samples of a take that follow a cycle.

    ``take`` is a `SampledTake`, ``where`` a slice of its samples, and ``phases`` are those of the
    samples in cycles, which never fall.
    """

    take: SampledTake
    where: slice
    phases: np.ndarray

    @property
    def times(self):
        """Frames of the samples."""
        return self.take.times[self.where]

    @property
    def values(self):
        """What is compared of the samples."""
        return self.take.values[self.where]

    @property
    def ends(self):
        """The first frame, and the frame after the last one."""
        return int(whole(self.times[0])), int(whole(self.times[-1])) + 1

    @property
    def n_cycles(self):
        """Cycles that it holds, with fractions."""
        return float(np.ptp(self.phases))

    def overlaps(self, other):
        """Whether they have frames in common."""
        (start, stop), (first, last) = self.ends, other.ends
        return start < last and first < stop


def follow(features, repetitions, pattern, period):
    """The stretches of a take that follow a cycle, in order of time.

    The take is decoded at the period of each of its repetitions. If none is as long as the pattern,
    it is also decoded at that of the pattern, but not in one or two features, which all that goes
    up and down follows. Of stretches that overlap the one that explains more frames is kept.

    Parameters
    ----------
    features : ndarray, shape (n_frames, n_features)
    repetitions : list of Repetition
        Where it repeats by itself.
    pattern : ndarray, shape (PHASES, 2 * n_features)
        The cycle.
    period : float
        Frames of the cycle in the takes that it was learnt from.
    """
    takes = [SampledTake.of(features, repetition) for repetition in repetitions]
    as_long = [max(take.period, period) <= AS_LONG * min(take.period, period) for take in takes]
    is_wide = features.shape[1] >= _FEATURES
    if is_wide and not any(as_long) and len(features) > _LEAST * period / 2:
        takes.append(_at_period(features, period, pattern))
    scored = []
    for take in takes:
        for where, phases in cheapest_path(take.values, pattern):
            stretch = Stretch(take, where, phases)
            score = similarity(pattern, stretch.values, phases)
            if score >= FOLLOWS and stretch.n_cycles >= _LEAST:
                scored.append((score * np.ptp(stretch.ends), stretch))
    followed = []
    for _, stretch in sorted(scored, key=lambda pair: -pair[0]):
        if not any(stretch.overlaps(other) for other in followed):
            followed.append(stretch)
    return sorted(followed, key=lambda stretch: stretch.times[0])


def _at_period(features, period, pattern):
    """A take that is sampled at a period, standardised by what of it follows the pattern."""
    take = SampledTake(features, period)
    inside = np.zeros(len(take.times), dtype=bool)
    for where, _ in cheapest_path(take.values, pattern):
        inside[where] = True
    if inside.any():
        take.standardise(inside)
    return take


def learn_cycle(features, repeats, progress):
    """The mean cycle of what repeats in takes, and its period in frames; None if nothing does.

    Repetitions are aligned at constant pace, each with the mean of those before it, and then
    matched. Those that do not follow the mean show another movement, and are left out.
    """
    sampled = [
        SampledTake.of(x, repetition)
        for x, of_take in zip(features, repeats, strict=True)
        for repetition in of_take.stretches
    ]
    while sampled:
        values, phases = [take.values[take.inside] for take in sampled], []
        for k, inside in enumerate(values):
            steady = np.arange(len(inside)) / PHASES
            if k:
                before = average_cycle(values[:k], phases)
                steady = steady + _shift_to(before, average_cycle([inside], [steady]))
            phases.append(steady)
        pattern = average_cycle(values, phases)
        step, phases = progress.stage("matching repetitions", len(values)), []
        for inside in values:
            phases.append(cheapest_path(inside, pattern, everywhere=True)[0][1])
            step()
        pattern = average_cycle(values, phases)
        alike = [
            similarity(pattern, inside, of_inside) >= FOLLOWS
            for inside, of_inside in zip(values, phases, strict=True)
        ]
        if all(alike) or not any(alike):
            return pattern, float(np.median([take.period for take in sampled]))
        sampled = list(compress(sampled, alike))
    return None


def mean_of(followed, start=0.0, curves=None):
    """The mean cycle of stretches of takes, from a phase on; of curves of the takes, if given."""
    values, phases = [], []
    for i, stretches in enumerate(followed):
        for stretch in stretches:
            of_stretch = stretch.values
            if curves is not None:
                of_stretch = stretch.take.sample(curves[i][:, np.newaxis])[stretch.where]
            values.append(of_stretch)
            phases.append(stretch.phases - start)
    return average_cycle(values, phases)


def period_of(stretches):
    """The median number of frames from a phase to the same one of the next cycle, in the stretches
    of a take; of single cycles their number of frames; NaN without any.
    """
    periods = []
    for stretch in stretches:
        times, phases, n_cycles = stretch.times, stretch.phases, stretch.n_cycles
        following = np.interp(phases + 1, phases, times, right=np.nan) - times
        following = following[np.isfinite(following)]
        periods.append(following if len(following) else [np.ptp(times) / n_cycles])
    return float(np.median(np.concatenate(periods))) if periods else np.nan


def cheapest_path(values, pattern, *, everywhere=False):
    """The stretches of a take that follow a cycle, as the cheapest path has them.

    Parameters
    ----------
    values : ndarray, shape (n_samples, 2 * n_features)
        Of a `SampledTake`, or a part of them.
    pattern : ndarray, shape (PHASES, 2 * n_features)
        The cycle.
    everywhere : bool, default=False
        Whether all samples follow the cycle: then there is one stretch.

    Returns
    -------
    list of (slice, ndarray)
        The samples of every stretch and their phases in cycles, in order of time.
    """
    cycle = _upsample(pattern)
    costs, beside = _costs(values, cycle)
    n_samples, n_states = costs.shape
    switch = np.inf if everywhere else _SWITCH
    steps = np.arange(_FASTEST * _SUBFRAMES + 1)
    paces = (_SMOOTHNESS / 2 * np.square(steps / _SUBFRAMES - 1))[:, np.newaxis]
    before = (np.arange(n_states) - steps[:, np.newaxis]) % n_states
    taken = np.full((n_samples, n_states), -1, dtype=np.int8)
    left = np.full(n_samples, -1)
    within, outside = costs[0], np.inf if everywhere else beside[0]
    for k in range(1, n_samples):
        ways = within[before] + paces
        step = ways.argmin(axis=0)
        cheapest = ways.min(axis=0)
        entered = cheapest > outside + switch
        last = within.argmin()
        if within[last] + switch < outside:
            left[k], following = last, within[last] + switch
        else:
            following = outside
        within = np.minimum(cheapest, outside + switch) + costs[k]
        taken[k] = np.where(entered, -1, step)
        outside = following + beside[k]
    states = np.full(n_samples, -1)
    state = -1 if outside < within.min() else first_smallest(within)
    for k in range(n_samples - 1, -1, -1):
        states[k] = state
        if state < 0:
            state = left[k]
        else:
            step = int(taken[k, state])
            state = -1 if step < 0 else (state - step) % n_states
    return [
        (slice(start, stop), _unwrapped(states[start:stop], n_states))
        for start, stop in runs_of(states >= 0).tolist()
    ]


def _costs(values, cycle):
    """Costs of samples at every phase (n_samples, n_states), and beside the cycle (n_samples,)."""
    squares, expected = (np.square(x).sum(axis=1) for x in (values, cycle))
    costs = (squares[:, np.newaxis] + expected - 2 * values @ cycle.T) / 2
    speeds = np.square(values[:, values.shape[1] // 2 :]).sum(axis=1)
    other = _OTHER * (squares + 2) / 2
    return costs, np.minimum(other, speeds)


def _unwrapped(states, n_states):
    """Phases in cycles, of states that never go back."""
    steps = np.diff(states, prepend=states[0]) % n_states
    return (states[0] + np.cumsum(steps)) / n_states


def average_cycle(many_values, many_phases):
    """The mean cycle of values (n_samples, n) of known phases: (PHASES, n).

    Each sample of the cycle is the mean over all cycles of all takes that have it.
    """
    sums = np.zeros((PHASES, many_values[0].shape[1]))
    counts = np.zeros(PHASES)
    for values, phases in zip(many_values, many_phases, strict=True):
        places = PHASES * phases
        wanted = np.arange(whole(places[0], "up"), whole(places[-1], "down") + 1)
        after = np.clip(np.searchsorted(places, wanted), 1, len(places) - 1)
        gaps = places[after] - places[after - 1]
        share = ((wanted - places[after - 1]) / np.where(gaps > 0, gaps, 1))[:, np.newaxis]
        values_between = (1 - share) * values[after - 1] + share * values[after]
        at = wanted % PHASES
        np.add.at(sums, at, values_between)
        counts += np.bincount(at, minlength=PHASES)
    return sums / np.maximum(counts, 1)[:, np.newaxis]


def _shift_to(pattern, cycle):
    """Phases from a cycle on to the best circular correlation of it with a pattern."""
    products = rfft(pattern, axis=0) * rfft(cycle, axis=0).conj()
    return first_largest(irfft(products.sum(axis=1), PHASES)) / PHASES


def _upsample(pattern):
    """The closed pattern at `_SUBFRAMES` positions per sample, by linear interpolation."""
    closed = np.concatenate([pattern, pattern[:1]])
    return normalise([closed], len(closed), _SUBFRAMES)[0, :-1]


def circular_peak(curve):
    """Where a closed curve has its maximum, between samples, by a parabola."""
    k = first_largest(curve)
    return k + parabola_vertex(*(curve[(k + j) % len(curve)] for j in (-1, 0, 1)))[0]


def move_to_events(stretch, events):
    """A stretch whose phases are whole numbers at events which are near such phases.

    The events are the times at which cycles begin, as far as they are known.
    """
    times, phases = stretch.times, stretch.phases
    inside = events[(events >= times[0]) & (events <= times[-1])]
    at = np.interp(inside, times, phases)
    nearest = np.round(at)
    near = np.abs(at - nearest) < _NEAR
    # Of two events at the same beginning none is sure.
    values, counts = np.unique(nearest[near], return_counts=True)
    near &= np.isin(nearest, values[counts == 1])
    if not near.any():
        return stretch
    moved = phases + np.interp(phases, at[near], (nearest - at)[near])
    return stretch._replace(phases=np.maximum.accumulate(moved))


class Piece(NamedTuple):
    """A piece of a stretch between two beginnings of a cycle, or before the first, or after the
    last: its frames, ``stop`` excluded, whether it is a whole cycle that follows the pattern, and
    its similarity to the pattern."""

    start: int
    stop: int
    complete: bool
    score: float


def cut_cycles(stretch, pattern):
    """The pieces of a stretch, cut where its phase is a whole number.

    The first and the last one are whole cycles, too, if little of the movement of the pattern is
    missing there, by the energy of its velocities; a little more if a cycle begins in rest.
    """
    times, phases = stretch.times, stretch.phases
    # np.interp needs phases that rise.
    rising = phases + np.linspace(0, 1e-9, len(phases))
    begins = np.arange(whole(phases[0], "up"), whole(phases[-1], "down") + 1)
    borders = np.unique([phases[0], *begins, phases[-1]])
    frames = whole(np.interp(borders, rising, times))
    energies = np.square(pattern[:, pattern.shape[1] // 2 :]).sum(axis=1)
    moved = np.concatenate([[0], np.cumsum(energies)]) / energies.sum()
    lacks = _LACKS_AT_REST if energies[0] < _TURNS * energies.mean() else _LACKS
    pieces = []
    for (first, following), (start, stop) in zip(pairwise(borders), pairwise(frames), strict=True):
        if stop > start:
            samples = PHASES * (np.array([first, following]) - whole(first, "down"))
            done, until = np.interp(samples, np.arange(PHASES + 1), moved)
            inside = (phases >= first) & (phases < following)
            score = similarity(pattern, stretch.values[inside], phases[inside])
            complete = bool(max(done, 1 - until) <= lacks) and score >= FOLLOWS
            pieces.append(Piece(int(start), int(stop) + 1, complete, score))
    return pieces


def similarity(pattern, values, phases):
    """Cosine similarity of samples (n_samples, n) of known phases to the pattern."""
    cycle = _upsample(pattern)
    expected = cycle[whole(phases * len(cycle)) % len(cycle)].ravel()
    values = values.ravel()
    size = np.sqrt((values @ values) * (expected @ expected))
    return float(values @ expected / size) if size > 0 else 0.0


def slowest_near(pattern, pose):
    """The sample of a cycle where it turns, of several the one nearest to a pose; or None.

    It turns where its velocity is smaller than before and after, and its square below a fourth of
    the mean.
    """
    n_features = pattern.shape[1] // 2
    speeds = np.square(pattern[:, n_features:]).sum(axis=1)
    turns = (speeds <= np.roll(speeds, 1)) & (speeds <= np.roll(speeds, -1))
    turns &= speeds < _TURNS * speeds.mean()
    if not turns.any():
        return None
    distances = np.square(pattern[:, :n_features] - pose[:n_features]).sum(axis=1)
    return first_smallest(np.where(turns, distances, np.inf))
