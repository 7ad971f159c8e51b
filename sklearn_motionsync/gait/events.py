"""gait_events: when each foot strikes the ground, and when it leaves it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np
import pandas as pd
from scipy.signal import find_peaks

from ..body.skeleton import Skeleton
from ..inputs.numbers import nanmean
from ..inputs.types import TrialsLike, ValuesLike
from ..matching.counting import first_largest, parabola_vertex, whole
from .recordings import CONTEXTS, FOOT_OFF, FOOT_STRIKE, Recordings, Walk, horizontal, pieces

# Standard deviations, in seconds, of the Gaussians for positions and for accelerations.
_POSITION, _ACCELERATION = 0.03, 0.0175
# A foot swings ahead by at least this share of the usual swing, and of the leg; strikes of a foot
# are at least so many seconds apart.
_LEAST_SWING, LEAST_STEP, _LEAST_STRIDE = 0.4, 0.15, 0.35
# The feet come as far apart and together within so many seconds before and after.
_SWING = 0.6
# Standard deviation of a delay within a recording; around its mean it is looked for so far.
_WITHIN, _AROUND = 0.010, 0.04
# Typical second derivative of the acceleration of a heel at a strike, in leg lengths: how sharp
# its peak is.
_SHARPNESS = 14000
# Integrals of the squared second and third derivative of a Gaussian of standard deviation 1.
_SECOND, _THIRD = 0.2116, 0.5289


class Delay(NamedTuple):
    """How long after a foot is farthest ahead or behind an event follows, in seconds.

    ``usual`` and ``spread`` are mean and standard deviation between recordings. It is looked for
    from ``first`` to ``last``.
    """

    usual: float
    spread: float
    first: float
    last: float


# Of the strike, after the heel is farthest ahead; of a runner's foot-off, after the toe is farthest
# behind; of the moment when an ankle rises fastest, after it is farthest behind.
_STRIKE = Delay(0.04, 0.015, -0.02, 0.15)
_RUN_OFF = Delay(-0.09, 0.015, -0.16, 0.06)
_RISE = Delay(0.0, 0.05, -0.15, 0.1)
# The peak of an ankle, which stands for a heel, is so many seconds from that of the heel.
_ANKLE_STRIKE = 0.02
# An ankle rises fastest so many seconds before the foot leaves the ground.
_ANKLE_OFF = 0.02
# The toe of a runner is farthest behind less than so many seconds after the other foot strikes (of
# seven walkers 0.06 and more, of three runners -0.04 to 0.015). Strikes farther off do not count.
_RUNNING, _OTHER_STRIKE = 0.04, 0.35


def gait_events(
    X: TrialsLike,
    skeleton: Skeleton | None = None,
    *,
    feet: Mapping[str, str | Sequence[str] | None] | None = None,
    frame_rate: float | ValuesLike | None = None,
) -> pd.DataFrame:
    """Heel strikes and foot-offs of walking and running, from positions of the feet.

    Parameters
    ----------
    X : list of arrays (n_frames_i, n_dims * n_joints), 3-D array, or one recording
        Joint positions, joint by joint x, y, z; or x, y of a side view. NaN is not seen.
    skeleton : Skeleton, default=None
        Which columns are which joints. By default that of the first table,
        ``Skeleton.from_frame(df)``.
    feet : mapping of str to str or tuple of str, default=None
        The joints at ``left_heel``, ``left_toe``, ``right_heel`` and ``right_toe``, several for
        their mean; None leaves one out. By default they are guessed from the names. The ankle
        stands for a missing heel.
    frame_rate : float, or array-like of shape (n_recordings,), default=None
        Frames a second; by default what tables tell.

    Returns
    -------
    DataFrame
        One row an event, by recording and time: the label of the recording (``trial``, or
        the levels of the labels of X); ``label``, "Foot Strike" or "Foot Off"; ``context``, "Left"
        or "Right"; ``frame``, from 0, with fractions, as the index of the recording counts; and
        ``time`` in seconds.

    Raises
    ------
    ValueError
        If the frame rate is not known, a recording is shorter than 0.25 s, no heel and no ankle is
        seen, or there is no pelvis above the feet.

    See Also
    --------
    gait_parameters : Spatio-temporal parameters of the same recordings.
    io.cut_at_events : Cuts recordings at events.
    io.keyframes_from_events : Makes key-frames of events.

    Notes
    -----
    A foot is farthest ahead of the pelvis some hundredths of a second before it strikes [1]_. At
    the strike the upward acceleration of the heel has a peak. Its delay after the foremost position
    is found in the mean of all strides of the foot, and then in each stride by itself. Both
    are drawn to the usual delay of 40 ms, the more the noisier the positions are: docs/method.md.
    If the acceleration has no peak, the heel strikes where it is lowest.

    A walker's foot leaves the ground where the toe is farthest behind [1]_; a runner's, where
    the upward acceleration of the toe is largest. A recording is one of running if the toe is
    farthest behind less than 40 ms after the other foot strikes, in the median. Without toes, the
    foot leaves the ground 20 ms after the ankle rises fastest.

    A body walks in the direction in which its feet swing while they are high; of a body that walks
    backwards the toes strike. It walks in one of both ways throughout a recording. Steps by less
    than 0.15 leg lengths, as in shuffling and turning on the spot, are not found.

    References
    ----------
    .. [1] Zeni, Richards, Higginson, "Two simple methods for determining gait events during
       treadmill and overground walking using kinematic data", Gait & Posture 27, 2008.

    Examples
    --------
    >>> from sklearn_motionsync.gait import gait_events
    >>> from sklearn_motionsync.datasets import make_walk
    >>> walk = make_walk(1, random_state=0)
    >>> events = gait_events(walk.data, walk.skeleton, frame_rate=walk.frame_rate)
    >>> events[["label", "context", "frame"]].round(1).head(3)
             label context  frame
    0  Foot Strike   Right   32.6
    1     Foot Off    Left   46.0
    2  Foot Strike    Left   87.1
    """
    recordings = Recordings(X, skeleton, feet, frame_rate)
    tables = []
    for i in range(len(recordings)):
        walk = recordings.walk(i)
        tables.append(tabulate_events(recordings, i, walk, events_of(walk)))
    return recordings.stack(tables)


def events_of(walk: Walk, known=None):
    """The events of a recording by time: label, side, and sample, with a fraction.

    Those that are known already, with rows, as from `Recordings.split_events`, are not found anew.
    """
    if known is not None:
        return [(label, side, row * walk.per_frame) for label, side, row in known]
    strikes = {side: _strikes(walk, side) for side in walk.heels}
    behind = {
        side: [(k, is_end) for k, is_end in _farthest(walk, side, points, -1) if not is_end]
        for side, points in (walk.heels | walk.toes).items()
    }
    # The toes of a runner are farthest behind about when the other foot strikes; a walker's, later.
    late = []
    for side, extremes in behind.items():
        other_strikes = np.array([k for other, at in strikes.items() if other != side for k in at])
        if side in walk.toes and len(other_strikes):
            late += [k - other_strikes[np.abs(other_strikes - k).argmin()] for k, _ in extremes]
    late = [k for k in late if abs(k) < _OTHER_STRIKE * walk.rate]
    running = bool(late) and np.median(late) < _RUNNING * walk.rate
    events = [(FOOT_STRIKE, side, k) for side, at in strikes.items() for k in at]
    events += [
        (FOOT_OFF, side, k)
        for side, extremes in behind.items()
        for k in _offs(walk, side, extremes, running)
        if _is_seen(walk.heels[side], k)
    ]
    return sorted(events, key=lambda event: event[2])


def tabulate_events(recordings, i, walk, events):
    """The table of the events of a recording: label, context, frame and time."""
    rows = [k / walk.per_frame for *_, k in events]
    return pd.DataFrame(
        {
            "label": [label for label, *_ in events],
            "context": [CONTEXTS[side] for _, side, _ in events],
            "frame": recordings.frames_at(i, rows),
            "time": recordings.times_at(i, rows),
        }
    )


def _strikes(walk, side):
    """Samples at which a foot strikes the ground."""
    heel = walk.heels[side]
    ahead = _farthest(walk, side, heel, 1)
    rise = walk.filtered(heel[:, 1], _ACCELERATION, 2)
    doubt = 0.0 if walk.has_heel[side] else _ANKLE_STRIKE
    peak = _DelayedPeak(walk, side, rise, ahead, _STRIKE, doubt)
    if not peak.is_known:
        rise = -walk.filtered(heel[:, 1], _ACCELERATION)
        peak = _DelayedPeak(walk, side, rise, ahead, _STRIKE, doubt)
    at = [peak.after(k, is_end) for k, is_end in ahead]
    return [float(k) for k in at if k is not None and _is_seen(heel, k)]


def _offs(walk, side, behind, running):
    """Samples at which a foot leaves the ground."""
    if side in walk.toes and not running:
        return [k for k, _ in behind]
    if side in walk.toes:
        rise, expected, later = walk.filtered(walk.toes[side][:, 1], _ACCELERATION, 2), _RUN_OFF, 0
    else:
        rise, expected = walk.filtered(walk.heels[side][:, 1], _ACCELERATION, 1), _RISE
        later = _ANKLE_OFF * walk.rate
    peak = _DelayedPeak(walk, side, rise, behind, expected)
    return [peak.after(k) + later for k, _ in behind]


class _DelayedPeak:
    """The peak of a curve that follows the moments when a foot is farthest ahead or behind.

    Parameters
    ----------
    walk : Walk
    side : str
    curve : ndarray, shape (n_samples,)
    extremes : list of (float, bool)
        From `_farthest`.
    expected : Delay
    doubt : float, default=0.0
        Standard deviation of peaks, in seconds, beside that by noise.

    Attributes
    ----------
    delay : float
        Samples from these moments to the peak of the mean of all strides, drawn to the usual delay,
        the more the noisier positions are.
    is_known : bool
        Whether the mean has a peak.
    """

    def __init__(self, walk, side, curve, extremes, expected, doubt=0.0):
        rate, noise = walk.rate, walk.noise[side]
        self._curve, self._rate, self._last = curve, rate, expected.last * rate
        # The variance of a mean of so many positions in a second.
        self._variance = noise * noise * walk.per_frame / rate
        inner = [k for k, is_end in extremes if not is_end]
        lags = np.arange(whole(expected.first * rate), whole(expected.last * rate) + 1)
        mean, many = np.full(len(lags), np.nan), max(len(inner), 1)
        if inner:
            index = np.round(np.asarray(inner)[:, np.newaxis]).astype(np.intp) + lags
            inside = (index >= 0) & (index < len(curve))
            around = np.where(inside, curve[np.clip(index, 0, len(curve) - 1)], np.nan)
            mean = nanmean(around, axis=0)
        height = np.sqrt(self._variance / many * _SECOND / _ACCELERATION**5)
        off = (lags / rate - expected.usual) / expected.spread
        peak = _peak(mean - height / 2 * np.square(off), mean)
        self.is_known, self.delay = peak is not None, expected.usual * rate
        self._height = np.inf
        if self.is_known:
            self._height = mean[round(peak)]
            share = self._share(expected.spread, many, doubt)
            self.delay += share * (peak + lags[0] - self.delay)
        self._share_of_one = self._share(_WITHIN, 1, doubt)
        self._is_clear = self._share(_WITHIN, 1, 0.0) > 0.5

    def after(self, k, is_end=False):
        """The sample of the peak that follows sample k, drawn to the mean delay.

        At an end the foot may have been farther before it was seen. There the peak alone counts, if
        it is at least half as high as that of the mean, and noise allows; else None.
        """
        if is_end:
            at = self._peak_between(k, k + self._last) if self._is_clear else None
            is_high = at is not None and self._curve[round(at)] > self._height / 2
            return at if is_high else None
        middle, around = k + self.delay, _AROUND * self._rate
        at = self._peak_between(middle - around, middle + around)
        return middle if at is None else middle + self._share_of_one * (at - middle)

    def _share(self, spread, count, doubt):
        """The weight of the peak of a mean of strides against a prior of this spread."""
        variance = self._variance / count * _THIRD / _ACCELERATION**7 / _SHARPNESS**2
        return spread**2 / (spread**2 + variance + doubt**2)

    def _peak_between(self, first, last):
        first, last = max(0, round(first) - 1), min(len(self._curve), round(last) + 2)
        at = _peak(self._curve[first:last])
        return None if at is None else first + at


def _farthest(walk, side, points, sign):
    """Samples at which a foot is farthest ahead (1) or behind (-1), and whether at an end.

    The other foot must have moved the other way: the pelvis alone moves in a squat.
    """
    curve = sign * walk.filtered(walk.ahead(points), _POSITION)
    seen = curve[~np.isnan(curve)]
    if not len(seen):
        return []
    low, high = np.percentile(seen, [3, 97])
    least = max(_LEAST_SWING * (high - low), LEAST_STEP)
    distance, out = whole(_LEAST_STRIDE * walk.rate, "down"), []
    other_heels = [heel for other, heel in walk.heels.items() if other != side]
    apart = horizontal(points - (other_heels[0] if other_heels else walk.pelvis))
    reach = whole(_SWING * walk.rate, "down")
    for piece in pieces(curve[:, np.newaxis]):
        stretch = curve[piece]
        floor = stretch.min() - high + low
        peaks, _ = find_peaks(
            np.concatenate([[floor], stretch, [floor]]), prominence=least, distance=distance
        )
        for k in peaks - 1:
            # At the first samples it may have been farther before.
            is_first = k <= whole(_POSITION * walk.rate, "down")
            is_end = is_first or k >= len(stretch) - 3
            # A foot that is last seen on its way ahead has not been farthest.
            near = apart[max(0, piece.start + k - reach) : piece.start + k + reach]
            # Of a hidden foot it is not known.
            moved = np.linalg.norm(np.ptp(near, axis=0))
            steps = np.isnan(moved) or moved >= LEAST_STEP
            if steps and (is_first or not is_end):
                out.append((piece.start + (k if is_end else _between(stretch, k)), is_end))
    return out


def _peak(values, curve=None):
    """The largest local maximum, between samples; of `curve`, by `values` there. None without."""
    curve = values if curve is None else curve
    inner = curve[1:-1]
    maxima = np.flatnonzero((inner >= curve[:-2]) & (inner > curve[2:])) + 1
    if not len(maxima):
        return None
    return _between(curve, int(maxima[first_largest(values[maxima])]))


def _between(values, k):
    """Where values have their maximum at sample k, no end, by a parabola."""
    return float(k + parabola_vertex(*values[k - 1 : k + 2])[0])


def _is_seen(points, at):
    k = round(at)
    return 0 <= k < len(points) and not np.isnan(points[k]).any()
