"""What costs of running performances are worth, learnt from those of the training set.

Every performance is followed with the mean of the others, beside its phase as it is known when it
is over.
"""

import numpy as np

from ..matching.warps import sample as sample_at
from .stream import Calibration, Stream

__all__ = ["calibrate"]

# So many performances, and so many moments of each, tell enough.
_MOST, _MOMENTS = 24, 120
# Temperatures that are tried, in mean squared features of a sample; the least chance that counts.
_TEMPERATURES = np.geomspace(0.01, 1e3, 41)
_LEAST = 1e-12
# Of one performance alone: temperature and usual cost as 16 actions of people have them, in mean
# squared features.
_ALONE = 0.7, 0.5


def calibrate(course_of, performances, warped, times):
    """The calibration of a training set.

    Parameters
    ----------
    course_of : callable
        The course of a mean performance (P, n_features).
    performances : list of ndarray (n_frames_i, n_features)
    warped : ndarray, shape (n_sequences, P, n_features)
        Those, synchronised.
    times : ndarray, shape (n_sequences, P)
        ``tau`` of each.

    Returns
    -------
    Calibration
    """
    n, total = len(performances), warped.sum(axis=0, dtype=np.float64)
    chosen = np.unique(np.linspace(0, n - 1, _MOST).round().astype(np.intp))
    scores, recent = np.zeros(len(_TEMPERATURES)), []
    # What does not move costs nothing, whatever the unit.
    energy = float(np.square(course_of(total / n).features.moving).sum(axis=1).mean()) or 1.0
    if n == 1:
        return Calibration(*(energy * share for share in _ALONE))
    for i in chosen:
        course = course_of((total - warped[i]) / (n - 1))
        rows, truth, costs = _followed(course, performances[i], times[i])
        recent.append(costs)
        for k, temperature in enumerate(energy * _TEMPERATURES):
            right = Stream.chances(rows, temperature)[np.arange(len(rows)), truth]
            scores[k] += np.log(np.maximum(right, _LEAST)).mean()
    # Copies of one performance cost each other nothing, but for rounding.
    usual = max(np.median([np.max(costs) for costs in recent]), _LEAST * energy)
    return Calibration(float(energy * _TEMPERATURES[scores.argmax()]), float(usual))


def _followed(course, performance, times):
    """Costs of all phases at even moments, the right phases there, and recent costs of ticks."""
    stream, duration = Stream(course, 1, performance.shape[1]), len(performance) - 1
    ticks = np.arange(0, duration * (1 + 1e-9), course.step)
    share = ticks / duration
    last = course.n_frames - 1
    rows, recent, every = [], [], -(-len(ticks) // _MOMENTS)
    for k, sample in enumerate(sample_at([performance], share[np.newaxis] * last, last + 1)[0]):
        stream.tick(sample[np.newaxis])
        recent.append(stream.recent[0])
        if k % every == 0:
            rows.append(stream.running.costs[0])
    # Where tau stands still, any phase of that while is as right.
    rising = times + 1e-9 * np.arange(len(times))
    phases = np.interp(share * last, rising, np.arange(len(times)))
    truth = np.round(phases * course.trellis.table.subframes).astype(np.intp)
    return np.array(rows), truth[::every], np.array(recent)
