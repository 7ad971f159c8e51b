"""KeyframeSynchronizer: piecewise linear warps between key-frames (Figs. 1c and 3c)."""

from __future__ import annotations

from numbers import Integral
from typing import Literal

import numpy as np
from sklearn.utils._param_validation import Interval

from ..inputs.types import PerformanceLike
from ..inputs.validation import names_of_input
from ..matching.filters import SMOOTHING, smooth
from ..matching.sizes import BATCH, EQUAL
from ..matching.units import Unit
from ..matching.warps import even_slices, sample
from ..utils.pipelines import MissingMetadata
from .anchored import AnchoredSynchronizer
from .match import Match
from .training import check_pattern

__all__ = ["KeyframeSynchronizer"]


class KeyframeSynchronizer(AnchoredSynchronizer):
    """Synchronise performances by key-frames, piecewise linearly between them.

    1. The pattern is the performance with the smallest sum of squared distances to all others:
       after warping by the key-frames if they are given, else after linear normalisation.
    2. If no key-frames are given, those of the pattern are the frames of largest curvature of its
       path, the paper's criterion; those of another performance are peaks of its curvature, with
       the closest postures in the same order.
    3. ``transform`` stretches each performance linearly between its key-frames so that they
       coincide with those of the pattern.

    Parameters
    ----------
    n_frames : int, default=None
        Frames of the common clock; by default the median length of the performances, or
        the length of a pattern given as an array.
    pattern : "median", int or array (n_frames, n_features), default="median"
        The pattern: the median performance, the one of an index, or an array, whose key-frames are
        always found by curvature.
    n_keyframes : int, default=5
        How many key-frames to find when none are given, at most ``P - 2``; the paper uses 5.

    Attributes
    ----------
    pattern_ : ndarray, shape (P, n_features)
        The pattern on the common clock.
    pattern_index_ : int or None
        Its index in the training set; None if it was given as an array.
    keyframes_ : ndarray, shape (n_keyframes,)
        The key-frames of the pattern, in frames of the common clock.
    n_frames_ : int
        ``P``.
    global_distances_ : ndarray, shape (n_sequences,)
        Sum of the squared distances of each performance to all others (step 1); NaN if the
        pattern was given.
    n_features_in_ : int
        Features of a frame (columns, for 2-D input).
    feature_names_in_ : ndarray of str
        Names of the features; only if the input had names.

    See Also
    --------
    DenseSynchronizer : Needs no key-frames, and takes those that are known.
    io.keyframes_from_events : Makes key-frames of a table of events.

    Notes
    -----
    Automatic key-frames suit performances of one style. In different styles they are often
    different moments, and linear normalisation is more accurate.

    Key-frames are metadata: in a Pipeline enable scikit-learn's metadata routing and request them
    with ``set_fit_request(keyframes=True)`` and ``set_transform_request(keyframes=True)``, for
    scorers with ``set_score_request(keyframes=True)``. Scorers that are called directly, displays
    and ``Match.from_estimator`` take ``keyframes=...``.

    Examples
    --------
    >>> from sklearn_motionsync import KeyframeSynchronizer
    >>> from sklearn_motionsync.datasets import make_bending
    >>> bunch = make_bending(4, random_state=0)
    >>> sync = KeyframeSynchronizer(n_frames=50)
    >>> sync.fit_transform(bunch.data, keyframes=bunch.keyframes).shape
    (4, 50, 45)
    """

    _parameter_constraints: dict = {
        **AnchoredSynchronizer._parameter_constraints,
        "n_keyframes": [Interval(Integral, 1, None, closed="left")],
    }

    _needs_all = True

    def __init__(
        self,
        n_frames: int | None = None,
        pattern: PerformanceLike | int | Literal["median"] = "median",
        n_keyframes: int = 5,
    ) -> None:
        self.n_frames = n_frames
        self.pattern = pattern
        self.n_keyframes = n_keyframes

    def _match(self, performances, keyframes=None, frame_rate=None):
        if self._needs_keyframes and keyframes is None:
            raise MissingMetadata(
                "The synchronizer was fitted with key-frames: give those of these performances too",
                "keyframes",
            )
        shares = self._shares(performances, keyframes, frame_rate)
        distances, times = np.empty(len(performances)), []
        for rows in even_slices(len(performances), BATCH):
            batch = performances.take(rows)
            if shares is None:
                on_clock = self.normalize(batch)
                knots = [match_keyframes(self.pattern_, self.keyframes_, x) for x in on_clock]
            else:
                knots = shares[rows] * (self.n_frames_ - 1)
            times.append(piecewise_linear(self.keyframes_, knots, self.n_frames_))
            synchronised = sample(batch, times[-1], self.n_frames_)
            differences = np.square(synchronised - self.pattern_)
            distances[rows] = differences.sum(axis=(1, 2), dtype=np.float64)
        return Match(np.concatenate(times), distances)

    def _learn(self, training, progress):
        pattern = check_pattern(self.pattern, training.trials, names_of_input(self))
        clock, keyframes = self._put_on_clock(training, pattern), None
        comparable, last = clock.poses, clock.n_frames - 1
        if training.keyframes is not None:
            keyframes = training.keyframes * last
            # On the mean key-frames all performances are comparable, as on one clock.
            times = piecewise_linear(keyframes.mean(axis=0), keyframes, clock.n_frames)
            comparable = clock.unit(sample(training.trials, times, clock.n_frames))
        learnt = self._learnt(training, clock, pattern, comparable)
        if keyframes is not None and learnt["pattern_index_"] is not None:
            learnt["keyframes_"] = keyframes[learnt["pattern_index_"]]
        else:
            count = self.n_keyframes if keyframes is None else keyframes.shape[1]
            learnt["keyframes_"] = curvature_keyframes(learnt["pattern_"], count)
        return learnt | {"_needs_keyframes": keyframes is not None}


def piecewise_linear(knots, shifted, n_frames):
    """tau(p): piecewise linear through the ends and the key-frames, (n_trials, P).

    Parameters
    ----------
    knots : ndarray, shape (n_keyframes,)
        Of the pattern, in frames.
    shifted : sequence of ndarray (n_keyframes,)
        Of the trials.
    n_frames : int
    """
    p, last = np.arange(n_frames), n_frames - 1
    return np.stack([np.interp(p, [0, *knots, last], [0, *times, last]) for times in shifted])


# -- automatic key-frames: frames of large curvature (Figs. 1c and 3c) ---------------------


def curvature_keyframes(on_clock, count):
    """The frames of maximum curvature of one performance, in order of time.

    Frames closer than a third of the mean distance to a chosen one, or to an end, are chosen only
    if there are no others.

    Parameters
    ----------
    on_clock : ndarray, shape (P, n_features)
    count : int

    Returns
    -------
    ndarray, shape (min(count, P - 2),)
    """
    n_frames = len(on_clock)
    count = min(count, n_frames - 2)
    order = 1 + np.argsort(-_curvature(on_clock)[1:-1], kind="stable")
    gap = n_frames / (count + 1) / 3
    chosen = []
    for near in (gap, 0):
        for frame in order:
            taken_frames = [0, n_frames - 1, *chosen]
            if len(chosen) < count and min(abs(frame - other) for other in taken_frames) > near:
                chosen.append(int(frame))
    return np.sort(np.array(chosen, dtype=np.float64))


def match_keyframes(pattern, keyframes, on_clock):
    """The frames of a performance that correspond to the key-frames of the pattern.

    Candidates are the peaks of its curvature, and its own key-frames. Dynamic programming finds the
    increasing sequence with the smallest sum of squared distances between postures; of equal
    postures those closest in time, so that the pattern matches itself.

    Parameters
    ----------
    pattern : ndarray, shape (P, n_features)
    keyframes : ndarray, shape (n_keyframes,)
    on_clock : ndarray, shape (P, n_features)

    Returns
    -------
    ndarray, shape (n_keyframes,)
    """
    n_frames = len(on_clock)
    curvature = _curvature(on_clock)
    inner = curvature[1:-1]
    peaks = 1 + np.flatnonzero((inner >= curvature[:-2]) & (inner > curvature[2:]))
    candidates_by_rank = curvature_keyframes(on_clock, len(keyframes)).astype(np.intp)
    peaks = np.union1d(peaks, candidates_by_rank)
    unit = Unit.of(pattern[np.newaxis])
    expected, candidates = unit(pattern[keyframes.astype(np.intp)]), unit(on_clock[peaks])
    costs = np.square(expected[:, np.newaxis] - candidates).sum(axis=2, dtype=np.float64)
    # The distance in time decides between equal postures.
    costs += EQUAL[costs.dtype] * np.square((keyframes[:, np.newaxis] - peaks) / n_frames)
    best, choices = np.zeros(len(peaks)), []
    for cost in costs:
        # best[j]: the smallest cost of the key-frames so far, all of them before peak j.
        total = best + cost
        choices.append(np.concatenate([[-1], _running_argmin(total)]))
        best = np.concatenate([[np.inf], np.minimum.accumulate(total)[:-1]])
    frames, end = [], len(peaks)
    for choice in choices[::-1]:
        end = choice[end]
        frames.append(peaks[end])
    return np.array(frames[::-1], dtype=np.float64)


def _running_argmin(values):
    """Index of the first smallest value up to each position."""
    smallest = np.minimum.accumulate(values)
    is_new = np.concatenate([[True], smallest[1:] < smallest[:-1]])
    return np.maximum.accumulate(np.where(is_new, np.arange(len(values)), 0))


def _curvature(on_clock):
    """Curvature ``sqrt(|v|^2 |a|^2 - (v.a)^2) / |v|^3`` of the path, damped at low speed."""
    sigma = SMOOTHING * (len(on_clock) - 1)
    on_clock = on_clock[np.newaxis]
    scaled = Unit.of(on_clock)(on_clock)
    v, a = (smooth(scaled, sigma, order)[0].astype(np.float64) for order in (1, 2))
    vv, aa, va = np.square(v).sum(1), np.square(a).sum(1), (v * a).sum(1)
    at_rest = 0.1 * vv.mean()
    if at_rest == 0:
        return np.zeros_like(vv)
    return np.sqrt(np.maximum(vv * aa - va**2, 0)) / (vv + at_rest) ** 1.5
