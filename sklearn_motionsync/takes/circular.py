"""Circular dense matching: a take follows one cycle that is repeated without end.

A take is sampled so that a cycle of its mean period has `PHASES` samples. It is the base of a
trellis with free ends, the moving sequence is the template, one cycle, tiled: so the phase wraps,
begins and ends anywhere, and runs at 0 to 2 times the mean pace. Phases count cycles.
"""

import numpy as np
from scipy.fft import irfft, rfft

from ..matching.costs import StepTable, step_table
from ..matching.filters import smooth
from ..matching.trellis import Trellis
from ..matching.warps import normalise

__all__ = ["PHASES", "Sampled", "average", "cycles_of", "follow", "keep_pace", "top_of"]

# Samples of a cycle, and positions between two of them.
PHASES, _SUBFRAMES = 32, 4
# Weight of (rho - 1)^2 where postures and velocities have a mean square of 1 each.
_SMOOTHNESS = 0.3
# Standard deviation, in samples, of the Gaussian under which velocities are derived.
_WIDTH = 1
# How far, in cycles, a part comes off the mean pace: for the phase it begins at, and by the cycle.
_BEGIN, _DRIFT = 0.55, 0.3
# Cycles of the parts in which long takes are matched, and by how many they overlap.
_PART, _OVERLAP = 16, 2
_FASTEST = 2


class Sampled:
    """A take with about `PHASES` samples a cycle, ready to be compared.

    Parameters
    ----------
    features : ndarray, shape (n_frames, n_features)
    period : float
        Mean number of frames of a cycle.

    Attributes
    ----------
    times : ndarray, shape (n_samples,)
        Frames of the samples, from the first to the last.
    values : ndarray, shape (n_samples, 2 * n_features)
        Postures as deviations from their mean, and velocities; either has the mean square 1.
    pace : ndarray, shape (n_samples,)
        The phase at the mean pace, 0 at the first frame.
    """

    def __init__(self, features, period):
        last = len(features) - 1
        n_samples = max(round(last / period * PHASES), 1) + 1
        self.times = np.linspace(0, last, n_samples)
        self.pace = self.times / period
        fine = smooth(features[np.newaxis], period / PHASES / 2)[0]
        postures = self.sample(fine)
        velocities = smooth(postures[np.newaxis], _WIDTH, 1)[0]
        self.values = np.concatenate([_scaled(postures), _scaled(velocities)], axis=1)

    def sample(self, values):
        """Values of frames (n_frames, n) at the samples."""
        return normalise([np.ascontiguousarray(values, dtype=np.float64)], len(self.times))[0]

    def at_frames(self, phases):
        """Phases of the samples at whole frames."""
        return np.interp(np.arange(self.times[-1] + 1), self.times, phases)


def _scaled(x):
    x = x - x.mean(axis=0)
    size = np.sqrt(np.square(x).sum() / len(x))
    return x / size if size > 0 else x


def average(many_values, many_phases):
    """The mean cycle of values (n_samples, n) whose phases are known: (PHASES, n).

    Each sample of the cycle is the mean over all cycles of all takes that have it.
    """
    sums = np.zeros((PHASES, many_values[0].shape[1]))
    counts = np.zeros(PHASES)
    for values, phases in zip(many_values, many_phases, strict=True):
        places = PHASES * phases
        wanted = np.arange(np.ceil(places[0]), np.floor(places[-1]) + 1)
        after = np.clip(np.searchsorted(places, wanted), 1, len(places) - 1)
        gaps = places[after] - places[after - 1]
        share = ((wanted - places[after - 1]) / np.where(gaps > 0, gaps, 1))[:, np.newaxis]
        found = (1 - share) * values[after - 1] + share * values[after]
        at = wanted.astype(int) % PHASES
        np.add.at(sums, at, found)
        counts += np.bincount(at, minlength=PHASES)
    return sums / np.maximum(counts, 1)[:, np.newaxis]


def keep_pace(template, take):
    """Phases at the mean pace, begun where the take is most like the template."""
    own = average([take.values], [take.pace])
    products = rfft(template, axis=0) * rfft(own, axis=0).conj()
    likeness_by_shift = irfft(products.sum(axis=1), PHASES)
    return take.pace + likeness_by_shift.argmax() / PHASES


def follow(template, take):
    """Phases of the best path of a take along the repeated template (Eqs. 12-17).

    Takes of many cycles are matched in parts that overlap, so that time grows with the take as
    memory does. In the middle of an overlap the phases of the next part go on.
    """
    values, cycle = take.values, _between(template)
    whole, overlap = _PART * PHASES, _OVERLAP * PHASES
    phases = _follow(cycle, values[: whole + overlap])
    for start in range(whole, len(values) - overlap, whole):
        part = _follow(cycle, values[start : start + whole + overlap])
        middle = overlap // 2
        part += np.round(phases[start + middle] - part[middle])
        phases = np.concatenate([phases[: start + middle], part[middle:]])
    return np.maximum.accumulate(phases)


def _follow(cycle, values):
    steps, moving, inner, _, _ = step_table("posture", _FASTEST, _SUBFRAMES)
    table = StepTable(steps, moving, inner, np.square(steps / _SUBFRAMES - 1), _SUBFRAMES)
    reach = int(np.ceil(PHASES * _BEGIN + _DRIFT * len(values)))
    trellis = Trellis(table, _SMOOTHNESS, reach, free=True)
    last = (len(values) - 1) * _SUBFRAMES
    positions = np.arange(-trellis.width, last + 1 + trellis.width)
    repeated = cycle[positions % len(cycle)]
    (path,) = trellis.paths(values[np.newaxis], repeated[np.newaxis])[0]
    return (np.arange(0, last + 1, _SUBFRAMES) + path) / len(cycle)


def _between(template):
    """The template with positions between its samples, the last of which meets the first."""
    share = (np.arange(_SUBFRAMES) / _SUBFRAMES)[:, np.newaxis]
    following = np.roll(template, -1, axis=0)[:, np.newaxis]
    return ((1 - share) * template[:, np.newaxis] + share * following).reshape(
        -1, template.shape[1]
    )


def top_of(curve):
    """Where a closed curve has its maximum, between samples."""
    k = int(curve.argmax())
    before, here, after = (curve[(k + j) % len(curve)] for j in (-1, 0, 1))
    bend = before - 2 * here + after
    return k + ((before - after) / (2 * bend) if bend < 0 else 0.0)


def cycles_of(take, phases, template, incomplete):
    """Yield start, stop, whether it is whole, and likeness to the template, of cycles of a take."""
    last = int(take.times[-1])
    whole = np.arange(np.ceil(phases[0]), np.floor(phases[-1]) + 1)
    # Where the phase stands still the path is as good as vertical.
    rising = phases + np.linspace(0, 1e-9, len(phases))
    frames = np.round(np.interp(whole, rising, take.times)).astype(int)
    phase_of, frame_of = list(whole), list(frames)
    if incomplete:
        if not frame_of or frame_of[0] > 0:
            phase_of, frame_of = [phases[0], *phase_of], [0, *frame_of]
        if frame_of[-1] < last:
            phase_of, frame_of = [*phase_of, phases[-1]], [*frame_of, last]
    for k in range(len(frame_of) - 1):
        ends, rows = phase_of[k : k + 2], frame_of[k : k + 2]
        if rows[1] > rows[0]:
            score = _likeness(template, take, phases, *ends)
            yield rows[0], rows[1] + 1, bool(ends[1] - ends[0] > 1 - 1e-6), score


def _likeness(template, take, phases, first, last):
    """How like the template a take is from one phase to another: the cosine of their angle."""
    inside = (phases >= first) & (phases < last)
    cycle = _between(template)
    there = cycle[np.round(phases[inside] * len(cycle)).astype(int) % len(cycle)].ravel()
    here = take.values[inside].ravel()
    size = np.sqrt((here @ here) * (there @ there))
    return float(here @ there / size) if size > 0 else 0.0
