"""gait_parameters: step and stride times and lengths, cadence, double support, symmetry."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from itertools import pairwise

import numpy as np
import pandas as pd

from ..body.formats import SIDES
from ..body.skeleton import Skeleton
from ..inputs.types import Table, TrialsLike, ValuesLike
from .events import events_of
from .recordings import FOOT_OFF, FOOT_STRIKE, Recordings, horizontal

# A foot on the ground that moves faster than so many leg lengths a second is on a belt. Feet that
# slide by retargeting move by 0.1.
_BELT = 0.25
# The part of the time between strike and foot-off in which the whole foot is on the ground.
_FLAT = (0.25, 0.55)
# What is measured in leg lengths.
_LENGTHS = ("speed", "stride length", "step length", "step width")
# A stride lasts at most so many times the median stride of its recording: else steps are missing.
_LONGEST = 1.5


def gait_parameters(
    X: TrialsLike,
    skeleton: Skeleton | None = None,
    *,
    events: Table | None = None,
    feet: Mapping[str, str | Sequence[str] | None] | None = None,
    frame_rate: float | ValuesLike | None = None,
) -> pd.DataFrame:
    """Spatio-temporal parameters of walking and running, with their units.

    Parameters
    ----------
    X : list of arrays (n_frames_i, n_dims * n_joints), 3-D array, or one recording
        As for `gait_events`.
    skeleton : Skeleton, default=None
        As for `gait_events`.
    events : DataFrame, default=None
        One row an event with ``label``, ``context``, and ``frame`` or ``time``, as `gait_events`
        returns it, and the labels of recordings if there are several. A row whose time is NaN is
        left out. By default events are those that `gait_events` finds.
    feet : mapping of str to str or tuple of str, default=None
        As for `gait_events`.
    frame_rate : float, or array-like of shape (n_recordings,), default=None
        Frames a second; by default what tables tell.

    Returns
    -------
    DataFrame
        One row a parameter of a recording, under the label of the recording and the name of the
        parameter: ``unit``; ``left`` and ``right``, means of the steps or strides of each side;
        ``mean``, ``sd`` and ``n`` of those of both sides; and ``asymmetry``, left minus right in
        per cent of their mean. NaN where nothing was measured. The parameters:

        cadence
            Steps a minute.
        speed
            Stride length by stride time.
        stride time, step time
            From a strike to the next of the same foot, and from the strike of the other foot to
            that of this one.
        stance time, swing time
            From strike to foot-off, and to the next strike.
        stance, single support, double support, flight
            Per cent of the stride with this foot on the ground, this one alone, both, and none.
        stride length, step length, step width
            Between strikes of the heel: of the same foot, and from that of the other foot, along
            the stride and across it. In metres, if the tables tell the unit of the positions.

    Raises
    ------
    ValueError
        As from `gait_events`; or if ``events`` lacks a column, names a recording that is not in X,
        or has an event outside of its recording.

    See Also
    --------
    gait_events : The events.
    compare_groups : Compares whole curves of groups.

    Notes
    -----
    On a treadmill lengths are those on the belt. Its speed is the mean speed of feet that are
    on the ground, if that exceeds 0.25 leg lengths a second. A stride longer than 1.5 times the
    median counts as two with a strike missed, and is left out.

    Examples
    --------
    >>> from sklearn_motionsync.gait import gait_parameters
    >>> from sklearn_motionsync.datasets import make_walk
    >>> walk = make_walk(1, random_state=0)
    >>> table = gait_parameters(walk.data, walk.skeleton, frame_rate=walk.frame_rate)
    >>> table.loc[0].loc[["cadence", "stride length"], ["unit", "mean"]].round(2)
                        unit    mean
    parameter
    cadence        steps/min  109.32
    stride length               1.44
    """
    recordings = Recordings(X, skeleton, feet, frame_rate)
    tables = []
    for i, known in enumerate(recordings.split_events(events)):
        walk = recordings.walk(i)
        events_of_walk = events_of(walk, known)
        tables.append(_parameters(walk, events_of_walk, *recordings.length_of_leg(i, walk)))
    stacked = recordings.stack(tables)
    return stacked.set_index([*recordings.levels, "parameter"])


def _parameters(walk, events, leg, unit):
    """The table of one recording; lengths are legs of so many units."""
    at = {
        (label, side): np.array([k for name, of, k in events if (name, of) == (label, side)])
        for label in (FOOT_STRIKE, FOOT_OFF)
        for side in SIDES
    }
    belt = _belt_velocity(walk, at)
    values = {}
    for side, other in zip(SIDES, SIDES[::-1], strict=True):
        for name, value in _of_side(walk, at, side, other, belt):
            values.setdefault(name, {s: [] for s in SIDES})[side].append(value)
    units = {
        "cadence": "steps/min", "speed": f"{unit}/s" if unit else "1/s", "stride time": "s",
        "step time": "s", "stance time": "s", "swing time": "s", "stance": "%",
        "single support": "%", "double support": "%", "flight": "%", "stride length": unit,
        "step length": unit, "step width": unit,
    }  # fmt: skip
    rows = []
    for name, of in units.items():
        scale = leg if name in _LENGTHS else 1.0
        by_side = values.get(name, {s: [] for s in SIDES})
        left, right = (scale * np.array(by_side[side]) for side in SIDES)
        both = np.concatenate([left, right])
        means = [float(x.mean()) if len(x) else np.nan for x in (left, right)]
        middle = sum(means) / 2
        asymmetry = 100 * (means[0] - means[1]) / middle if middle else np.nan
        mean = float(both.mean()) if len(both) else np.nan
        sd = float(both.std(ddof=1)) if len(both) > 1 else np.nan
        rows.append([name, of, *means, mean, sd, len(both), asymmetry])
    columns = ["parameter", "unit", "left", "right", "mean", "sd", "n", "asymmetry"]
    return pd.DataFrame(rows, columns=columns)


def _of_side(walk, at, side, other, belt):
    """Yield names and values of the steps and strides of a side: seconds, shares, and legs."""
    strikes, rate = at[FOOT_STRIKE, side], walk.rate
    if len(strikes) < 2:
        return
    strides = np.diff(strikes)
    longest = _LONGEST * np.median(np.concatenate([strides, np.diff(at[FOOT_STRIKE, other])]))
    for first, last in pairwise(strikes):
        if last - first > longest:
            continue
        seconds = (last - first) / rate
        yield "stride time", seconds
        heel = walk.heels[side]
        way = _ground(walk, heel, last, belt) - _ground(walk, heel, first, belt)
        length = float(np.linalg.norm(way))
        yield "stride length", length
        yield "speed", length / seconds
        (off,) = _between(at[FOOT_OFF, side], first, last) or (None,)
        (opposite,) = _between(at[FOOT_STRIKE, other], first, last) or (None,)
        (other_off,) = _between(at[FOOT_OFF, other], first, last) or (None,)
        if off is not None:
            yield "stance time", (off - first) / rate
            yield "swing time", (last - off) / rate
            yield "stance", 100 * (off - first) / (last - first)
        if opposite is not None:
            yield "step time", (last - opposite) / rate
            yield "cadence", 60 * rate / (last - opposite)
            place = _ground(walk, walk.heels[other], opposite, belt)
            step = _ground(walk, heel, last, belt) - place
            along = way / length if length > 0 else way
            yield "step length", float(step @ along)
            if len(step) > 1:
                yield "step width", float(np.sqrt(max(step @ step - (step @ along) ** 2, 0)))
        if None not in (off, opposite, other_off):
            yield from _support(first, last, off, opposite, other_off)


def _support(first, last, off, opposite, other_off):
    """Shares of a stride with one, both, and no foot on the ground."""
    # The other foot is on the ground until its foot-off, and from its strike on.
    intervals = (
        [(first, other_off), (opposite, last)] if other_off < opposite else [(opposite, other_off)]
    )
    both = sum(max(0.0, min(off, b) - max(first, a)) for a, b in intervals)
    others = sum(b - a for a, b in intervals)
    stride = last - first
    yield "double support", 100 * both / stride
    yield "single support", 100 * (off - first - both) / stride
    # None flies in walking: what is left is rounding.
    yield "flight", max(0.0, round(100 * (stride - (off - first) - others + both) / stride, 9))


def _between(events, first, last):
    """The only event between two samples, or none."""
    inside = events[(events > first) & (events < last)]
    return inside.tolist() if len(inside) == 1 else []


def _ground(walk, points, at, belt):
    """The horizontal place of a point at a sample, on the ground or on the belt."""
    k = int(np.clip(round(at), 0, len(points) - 1))
    return horizontal(points[k : k + 1])[0] - belt * at / walk.rate


def _belt_velocity(walk, at):
    """The horizontal velocity of feet on the ground, in legs a second; 0 if it is slow."""
    velocities = []
    for side, heel in walk.heels.items():
        offs = at[FOOT_OFF, side]
        for first in at[FOOT_STRIKE, side]:
            later = offs[offs > first]
            if not len(later):
                continue
            a, b = (round(first + share * (later[0] - first)) for share in _FLAT)
            if b < len(heel) and b > a:
                way = horizontal(heel[[a, b]])
                velocities.append((way[1] - way[0]) / (b - a) * walk.rate)
    known = [v for v in velocities if not np.isnan(v).any()]
    if not known:
        return np.zeros(walk.forward.shape[1])
    mean = np.median(known, axis=0)
    return mean if np.linalg.norm(mean) > _BELT else np.zeros_like(mean)
