"""Phases of stretches: they are matched with one cycle that is repeated periodically."""

from itertools import pairwise

import numpy as np
from scipy.fft import irfft, rfft

from ..matching.costs import StepTable, step_table
from ..matching.counting import first_largest, whole
from ..matching.filters import smooth
from ..matching.trellis import Trellis
from ..matching.warps import normalise

__all__ = [
    "FOLLOWS",
    "PHASES",
    "SampledStretch",
    "average_cycle",
    "circular_peak",
    "constant_phases",
    "locate_cycles",
    "match_phases",
    "move_to_events",
    "similarity",
]

# Samples of a cycle, and positions per sample at which a path may stand.
PHASES, _SUBFRAMES = 32, 4
# Standard deviation, in samples, of the Gaussian derivative that gives velocities.
_WIDTH = 1
# Weight of (rho - 1)^2, for postures and velocities of mean square 1 each; the largest rate rho.
_SMOOTHNESS, _FASTEST = 0.3, 2
# Largest offset of a path from the mean pace, in cycles: at its beginning, and more per cycle.
_BEGIN, _DRIFT = 0.55, 0.3
# The first and the last cycle of a stretch within a take move as fast as this share of the template
# in this outer part, or the movement only begins there, or stops.
_PACE, _OUTER = 0.85, 0.1
# Cycles follow the template from this similarity on.
FOLLOWS = 0.5
# A known beginning of a cycle is at most so far from that of the match, in cycles.
_NEAR = 0.2
# Cycles of the portions in which long takes are matched, and of their overlap.
_PORTION, _OVERLAP = 16, 2


class SampledStretch:
    """A stretch of a take with about `PHASES` samples a cycle.

    Parameters
    ----------
    features : ndarray, shape (n_frames, n_features)
        Those of the take.
    period : float
        Mean number of frames of a cycle.
    start, stop : int
        The stretch; by default the whole take.

    Attributes
    ----------
    times : ndarray, shape (n_samples,)
        Frames of the samples, from the first to the last.
    values : ndarray, shape (n_samples, 2 * n_features)
        Postures less their mean, and velocities; each of mean square 1.
    mean_phases : ndarray, shape (n_samples,)
        Phases at the mean pace, 0 at the first frame.
    """

    def __init__(self, features, period, start=0, stop=None):
        stop = len(features) if stop is None else stop
        self._inside = slice(start, stop)
        inside = features[self._inside]
        self.begins, self.ends = start > 0, stop < len(features)
        last = len(inside) - 1
        n_samples = max(whole(last / period * PHASES), 1) + 1
        self.times = np.linspace(start, start + last, n_samples)
        self.mean_phases = (self.times - start) / period
        postures = self._sample(smooth(inside[np.newaxis], period / PHASES / 2)[0])
        velocities = smooth(postures[np.newaxis], _WIDTH, 1)[0]
        self.values = np.concatenate([_standardise(postures), _standardise(velocities)], axis=1)

    def sample(self, values):
        """Values of the frames of the take, (n_frames, n), at the samples."""
        return self._sample(values[self._inside])

    def _sample(self, values):
        return normalise([np.ascontiguousarray(values, dtype=np.float64)], len(self.times))[0]


def _standardise(x):
    x = x - x.mean(axis=0)
    size = np.sqrt(np.square(x).sum() / len(x))
    return x / size if size > 0 else x


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


def constant_phases(template, take):
    """Phases at the mean pace, shifted to the best circular correlation with the template."""
    cycle = average_cycle([take.values], [take.mean_phases])
    products = rfft(template, axis=0) * rfft(cycle, axis=0).conj()
    correlation = irfft(products.sum(axis=1), PHASES)
    return take.mean_phases + first_largest(correlation) / PHASES


def match_phases(template, take):
    """Phases of the best path of a take along the repeated template (Eqs. 12-17).

    Takes of many cycles are matched in overlapping portions, so that time and memory grow linearly.
    The phases of a portion end in the middle of the overlap with the next one.
    """
    values, cycle = take.values, _upsample(template)
    size, overlap = _PORTION * PHASES, _OVERLAP * PHASES
    phases = _match_portion(cycle, values[: size + overlap])
    for start in range(size, len(values) - overlap, size):
        portion = _match_portion(cycle, values[start : start + size + overlap])
        middle = overlap // 2
        portion += np.round(phases[start + middle] - portion[middle])
        phases = np.concatenate([phases[: start + middle], portion[middle:]])
    return np.maximum.accumulate(phases)


def _match_portion(cycle, values):
    steps, moving, inner, _, _ = step_table("posture", _FASTEST, _SUBFRAMES)
    table = StepTable(steps, moving, inner, np.square(steps / _SUBFRAMES - 1), _SUBFRAMES)
    reach = int(np.ceil(PHASES * _BEGIN + _DRIFT * len(values)))
    trellis = Trellis(table, _SMOOTHNESS, reach, free=True)
    last = (len(values) - 1) * _SUBFRAMES
    positions = np.arange(-trellis.width, last + 1 + trellis.width)
    repeated = cycle[positions % len(cycle)]
    (path,) = trellis.paths(values[np.newaxis], repeated[np.newaxis])[0]
    return (np.arange(0, last + 1, _SUBFRAMES) + path) / len(cycle)


def _upsample(template):
    """The closed template at `_SUBFRAMES` positions per sample, by linear interpolation."""
    share = (np.arange(_SUBFRAMES) / _SUBFRAMES)[:, np.newaxis]
    following = np.roll(template, -1, axis=0)[:, np.newaxis]
    fine = (1 - share) * template[:, np.newaxis] + share * following
    return fine.reshape(-1, template.shape[1])


def circular_peak(curve):
    """Where a closed curve has its maximum, between samples, by a parabola."""
    k = first_largest(curve)
    before, here, after = (curve[(k + j) % len(curve)] for j in (-1, 0, 1))
    bend = before - 2 * here + after
    return k + ((before - after) / (2 * bend) if bend < 0 else 0.0)


def move_to_events(times, phases, events):
    """Phases that are whole numbers at events which are near such phases.

    Parameters
    ----------
    times, phases : ndarray, shape (n_samples,)
        Of a stretch.
    events : ndarray
        The times at which cycles begin, as far as they are known.
    """
    inside = events[(events >= times[0]) & (events <= times[-1])]
    at = np.interp(inside, times, phases)
    nearest = np.round(at)
    near = np.abs(at - nearest) < _NEAR
    # Of two events at the same beginning none is sure.
    values, counts = np.unique(nearest[near], return_counts=True)
    near &= np.isin(nearest, values[counts == 1])
    if not near.any():
        return phases
    return np.maximum.accumulate(phases + np.interp(phases, at[near], (nearest - at)[near]))


def locate_cycles(take, phases, template, incomplete):
    """Yield start, stop, completeness, and similarity to the template, of cycles of a stretch.

    A cycle is complete if it is whole, and similar to the template; others are left out, or
    ``incomplete``.
    """
    begins = np.arange(whole(phases[0], "up"), whole(phases[-1], "down") + 1)
    # np.interp needs phases that rise.
    rising = phases + np.linspace(0, 1e-9, len(phases))
    frames = whole(np.interp(begins, rising, take.times))
    outer = [(take.begins, slice(1, None), 0, _OUTER), (take.ends, slice(-1), -1, -_OUTER)]
    for within, inner, k, share in outer:
        if within and len(begins):
            first, last = sorted([begins[k], begins[k] + share])
            if not _keeps_pace(template, take, phases, first, last):
                begins, frames = begins[inner], frames[inner]
    ends = list(zip(begins, frames.tolist(), strict=True))
    if incomplete:
        ends = [(phases[0], int(take.times[0])), *ends, (phases[-1], int(take.times[-1]))]
    for (first, start), (following, stop) in pairwise(ends):
        if stop > start:
            score = similarity(template, take, phases, first, following)
            complete = {first, following} <= set(begins) and score >= FOLLOWS
            if complete or incomplete:
                yield start, stop + 1, complete, score


def _keeps_pace(template, take, phases, first, last):
    """Whether a stretch moves about as fast as the template, from one phase to another."""
    values, expected = _between(template, take, phases, first, last)
    width = template.shape[1] // 2
    speeds = [np.square(x[:, width:]).sum() for x in (values, expected)]
    return speeds[0] >= _PACE**2 * speeds[1]


def _between(template, take, phases, first, last):
    """Samples of a stretch from one phase to another, and the same of the template."""
    inside = (phases >= first) & (phases < last)
    cycle = _upsample(template)
    places = whole(phases[inside] * len(cycle))
    return take.values[inside], cycle[places % len(cycle)]


def similarity(template, take, phases, first=-np.inf, last=np.inf):
    """Cosine similarity of a stretch to the template, from one phase to another."""
    values, expected = (x.ravel() for x in _between(template, take, phases, first, last))
    size = np.sqrt((values @ values) * (expected @ expected))
    return float(values @ expected / size) if size > 0 else 0.0
