"""Synthetic gait of people in two groups: angles of one leg and the force under the foot."""

from __future__ import annotations

from numbers import Integral, Real
from pathlib import Path
from typing import NamedTuple

import numpy as np
from scipy.interpolate import PchipInterpolator
from sklearn.utils import Bunch, check_random_state
from sklearn.utils._param_validation import Interval

from ..inputs.types import RandomState
from ..matching.counting import whole
from ..utils.parameters import validated_function
from .bending import LIMITS

_GROUPS = ("A", "B")
_UNITS = ("degrees", "degrees", "degrees", "body weights")
# The moments of the key-frames, as shares of a cycle from heel strike to heel strike.
_TOE_OFF = 0.62
_KEYFRAMES = {
    "first force peak": 0.14,
    "valley of the force": 0.30,
    "second force peak": 0.48,
    "toe-off": _TOE_OFF,
    "peak knee flexion": 0.73,
}
_KEY_MOMENTS = np.array(list(_KEYFRAMES.values()))
# Degrees of flexion (of the ankle dorsiflexion) and body weights, by share of the cycle.
_CURVES = {
    "hip_flexion": {
        0.00: 30, 0.08: 27, 0.18: 20, 0.30: 8, 0.42: -3, 0.52: -10, 0.60: -5, 0.68: 9, 0.77: 24,
        0.86: 33, 0.94: 32,
    },
    "knee_flexion": {
        0.00: 4, 0.06: 12, 0.14: 19, 0.26: 12, 0.39: 4, 0.49: 11, 0.56: 25, 0.62: 40, 0.67: 54,
        0.73: 61, 0.79: 55, 0.86: 33, 0.92: 11, 0.97: 2,
    },
    "ankle_dorsiflexion": {
        0.00: 0, 0.03: -4, 0.07: -6, 0.14: -1, 0.24: 5, 0.36: 9, 0.45: 11, 0.52: 6, 0.58: -10,
        0.64: -19, 0.70: -11, 0.78: -2, 0.86: 1, 0.94: 1,
    },
    "vertical_force": {
        0.00: 0, 0.03: 0.36, 0.07: 0.82, 0.14: 1.12, 0.22: 0.91, 0.30: 0.76, 0.39: 0.93, 0.48: 1.10,
        0.54: 0.76, 0.58: 0.30, _TOE_OFF: 0, 0.75: 0, 0.90: 0,
    },
}  # fmt: skip
# Standard deviations between people: of an angle throughout, in degrees; of a wave along the cycle,
# in degrees; of the range of a curve, as a share. The wave also differs between the cycles of a
# person, by a share of that between people. The force changes by a share for each degree of it.
_SHIFT = {"hip_flexion": 4.0, "knee_flexion": 3.0, "ankle_dorsiflexion": 2.5}
_WAVE, _WAVE_WITHIN = 1.5, 0.3
_RANGE, _FORCE_PER_DEGREE = 0.06, 0.02
# Noise of the force in body weights, as a share of that of the angles in degrees.
_FORCE_NOISE = 0.01
# The number of moments of the pace of a person.
_N_PACE = 501


@validated_function(
    {
        "n_people": [Interval(Integral, 1, 10**6, closed="both")],
        "n_cycles": [Interval(Integral, 1, 10**4, closed="both")],
        "amplitude": [Interval(Real, -40, 40, closed="both")],
        "timing": [Interval(Real, -12, 12, closed="both")],
        "takes": ["boolean"],
        "n_frames": [Interval(Integral, 20, 10**6, closed="both")],
        **LIMITS,
    }
)
def make_gait(
    n_people: int = 10,
    n_cycles: int = 3,
    *,
    amplitude: float = 0.0,
    timing: float = 0.0,
    takes: bool = False,
    n_frames: int = 100,
    style: float = 1.0,
    warp: float = 1.0,
    noise: float = 0.3,
    frame_rate: float = 100.0,
    random_state: RandomState = None,
) -> Bunch:
    """Gait cycles of people in two groups with known differences in shape and timing.

    Flexion of hip, knee and ankle in the sagittal plane and the vertical force under the foot, from
    one heel strike to the next of the same foot. People differ in their movement, pace and
    duration, and so do, less, the cycles of a person.

    Parameters
    ----------
    n_people : int, default=10
        Number of people, up to a million; they belong to the groups A and B in turn.
    n_cycles : int, default=3
        Number of cycles of each person, up to 10000.
    amplitude : float, default=0.0
        Degrees, from -40 to 40, by which the knee flexes further in swing in group B.
    timing : float, default=0.0
        Per cent of the cycle, from -12 to 12, by which toe-off is later in group B. Moments
        around it are shifted with it, the less the farther away; the heel strikes stay.
    takes : bool, default=False
        Whether to return one long take of all cycles of each person, instead of single cycles.
    n_frames : int, default=100
        Mean number of frames of a cycle, from 20 to a million.
    style : float, default=1.0
        Size of the differences in movement between people and between cycles, from 0 to 100. At 1
        angles have a standard deviation of 3 to 5 degrees between people.
    warp : float, default=1.0
        Size of the variation of pace within cycles, from 0 (the pace of the group) to 10. At 1
        toe-off has a standard deviation of about 1.2 % of the cycle between people, and of 0.4 %
        within a person.
    noise : float, default=0.3
        Standard deviation of the noise of angles, in degrees, up to 1000; that of the force is a
        hundredth of it, in body weights.
    frame_rate : float, default=100.0
        Frames per second, from 0.001.
    random_state : int, RandomState instance or None, default=None
        Seed of the generator; by default every call makes other people.

    Returns
    -------
    Bunch
        data : list of ndarray (n_frames_i, 4)
            Cycles, person by person; or takes, one for each person, from before their first heel
            strike until after their last one. The force is 0 while the foot is in the air.
        times : list of ndarray (n_frames_i,)
            The moment that each frame shows, the same in both groups, from 0 to 1; in takes from
            heel strike to heel strike, up to ``n_cycles``.
        keyframes : ndarray (n_trials, 5)
            Frame (with fraction) of five moments within each cycle; in takes those of all cycles,
            and the heel strikes: ``(n_people, 6 * n_cycles + 1)``.
        keyframe_names : list of str
            Names of these moments; in takes with the number of the cycle.
        person, group : ndarray of str (n_trials,)
            The person, and the group, "A" or "B".
        cycle : ndarray of int (n_trials,)
            The number of the cycle of the person, from 1; not with takes.
        events : list of list of dict
            With takes only: the foot strikes and foot-offs of each, as of ``read_motion``.
        feature_names : list of str
            "hip_flexion", "knee_flexion", "ankle_dorsiflexion", "vertical_force".
        units : list of str
            Their units: degrees, and body weights.
        frame_rate : float
            Frames per second, as given.

    Raises
    ------
    ValueError
        If a parameter is out of its range.

    See Also
    --------
    make_bending : Whole bodies, as joint positions.

    Examples
    --------
    >>> from sklearn_motionsync.datasets import make_gait
    >>> bunch = make_gait(4, n_cycles=2, timing=3, random_state=0)
    >>> len(bunch.data), bunch.feature_names
    (8, ['hip_flexion', 'knee_flexion', 'ankle_dorsiflexion', 'vertical_force'])
    """
    # The same people walk, in cycles and in takes.
    seeds = check_random_state(random_state).randint(np.iinfo(np.int32).max, size=n_people)
    record = _record_take if takes else _record_cycles
    recorded = []
    for i, seed in enumerate(seeds):
        generator, in_b = check_random_state(seed), i % 2
        walk = _draw_walk(generator, n_cycles, amplitude * in_b, timing * in_b, style, warp)
        recorded.append(record(generator, walk, n_frames, noise))
    gait = _describe_takes(recorded, frame_rate) if takes else _describe_cycles(recorded)
    people = np.arange(n_people).repeat(len(gait.data) // n_people)
    gait.update(
        person=np.array([f"person{i}" for i in people]),
        group=np.array([_GROUPS[i % 2] for i in people]),
        feature_names=list(_CURVES),
        units=list(_UNITS),
        frame_rate=float(frame_rate),
    )
    return gait


# -- the walk of a person: curves, cycle after cycle, and their pace --------------------


class _Walk(NamedTuple):
    """Consecutive cycles of one person, with one more at either end.

    ``curves`` are functions of the phase, in cycles. ``moments`` and, for each cycle, ``shares``
    belong together: when a share of the cycle is over, it is at the moment. ``durations`` of the
    cycles are relative, about 1.
    """

    curves: list
    moments: np.ndarray
    shares: np.ndarray
    durations: np.ndarray

    def times_at(self, cycle, share):
        """The moments of a cycle when shares of it are over."""
        even = np.linspace(0, 1, _N_PACE)
        return np.interp(np.interp(share, self.shares[cycle], even), even, self.moments)

    def shares_at(self, cycle, moments):
        """The shares of a cycle that are over at moments."""
        even = np.linspace(0, 1, _N_PACE)
        return np.interp(np.interp(moments, self.moments, even), even, self.shares[cycle])


def _draw_walk(random_state, n_cycles, amplitude, timing, style, warp):
    n = n_cycles + 2
    durations = random_state.uniform(0.85, 1.15) * random_state.uniform(0.96, 1.04, n)
    curves = []
    for name, anchors in _CURVES.items():
        at = np.array(list(anchors))
        values = _vary(random_state, style, name, at, _anchor_values(name, amplitude), n)
        # Cycle after cycle, so that one ends where the next begins.
        phases = np.arange(n)[:, np.newaxis] + at
        curves.append(PchipInterpolator(phases.ravel(), values.ravel()))
    even = np.linspace(0, 1, _N_PACE)
    shares = _draw_shares(random_state, n, warp, even)
    # At even moments of the group's pace people are at even moments of their own.
    moments = np.interp(even, _shift_times(even, timing), even)
    return _Walk(curves, moments, shares, durations)


def _anchor_values(name, amplitude):
    """Values of a curve at its anchors, with the knee flexed further in swing."""
    at, values = np.array(list(_CURVES[name].items()), dtype=np.float64).T
    if name == "knee_flexion":
        peak = _KEYFRAMES["peak knee flexion"]
        values += amplitude * np.cos(np.pi * np.clip((at - peak) / 0.42, -0.5, 0.5)) ** 2
    return values


def _vary(random_state, style, name, at, values, n):
    """The values in n cycles of a person."""
    waves = np.arange(1, 4)[:, np.newaxis]

    def draw(count, size):
        weights = size * random_state.standard_normal((count, 3)) / waves[:, 0]
        return weights @ np.sin(2 * np.pi * (waves * at + random_state.uniform(size=(3, 1))))

    wave = draw(1, _WAVE) + draw(n, _WAVE * _WAVE_WITHIN)
    scale = np.exp(style * _RANGE * random_state.standard_normal())
    shift = random_state.standard_normal()
    if name == "vertical_force":
        # A force of 0 stays 0.
        return values * scale * np.exp(style * _FORCE_PER_DEGREE * wave)
    return values * scale + style * (_SHIFT[name] * shift + wave)


def _draw_shares(random_state, n, strength, even):
    """Shares of n cycles over at even moments: integrals of smooth positive rates."""
    waves = np.arange(1, 4)[:, np.newaxis]
    shape = np.sin(np.pi * waves * even + random_state.uniform(0, 2 * np.pi, (3, 1)))
    weights = random_state.standard_normal((1, 3)) + 0.35 * random_state.standard_normal((n, 3))
    rates = 2 ** (0.5 * strength * np.tanh(0.15 * (weights / waves[:, 0]) @ shape))
    shares = np.cumsum((rates[:, 1:] + rates[:, :-1]) / 2, axis=1)
    return np.hstack([np.zeros((n, 1)), shares / shares[:, -1:]])


def _shift_times(moments, timing):
    """The share of the cycle that is over at moments, with toe-off later by timing, in per cent."""
    exponent = np.log(0.5) / np.log(_TOE_OFF)
    return moments + timing / 100 * np.sin(np.pi * moments**exponent) ** 2


# -- the recordings of it ---------------------------------------------------------------


def _record_cycles(random_state, walk, n_frames, noise):
    """Of each cycle but the first and last: angles and force, times, and key-frames."""
    cycles = []
    for c in range(1, len(walk.durations) - 1):
        length = whole(n_frames * walk.durations[c])
        times = walk.times_at(c, np.linspace(0, 1, length))
        keyframes = (length - 1) * walk.shares_at(c, _KEY_MOMENTS)
        cycles.append((_measure(random_state, walk, c + times, noise), times, keyframes))
    return cycles


def _record_take(random_state, walk, n_frames, noise):
    """A take of all of them: angles and force, times, heel strikes, and key-frames."""
    n = len(walk.durations)
    # In frames from the start of the first cycle, of which the take has the end only.
    strikes = np.concatenate([[0], np.cumsum(n_frames * walk.durations)])
    first = np.ceil(strikes[1] - random_state.uniform(0.1, 0.35) * (strikes[1] - strikes[0]))
    end = strikes[-2] + random_state.uniform(0.1, 0.35) * (strikes[-1] - strikes[-2])
    frames = np.arange(first, end)
    frames_by_cycle = np.split(frames, np.searchsorted(frames, strikes[1:-1]))
    durations = np.diff(strikes)
    phases = np.concatenate(
        [c + walk.times_at(c, (frames_by_cycle[c] - strikes[c]) / durations[c]) for c in range(n)]
    )
    shares = np.stack([walk.shares_at(c, _KEY_MOMENTS) for c in range(n)])
    keyframes = strikes[:-1, np.newaxis] + shares * durations[:, np.newaxis] - first
    data = _measure(random_state, walk, phases, noise)
    return data, phases - 1, strikes[1:-1] - first, keyframes[1:-1]


def _measure(random_state, walk, phases, noise):
    """Angles and force at phases, with noise; no force while the foot is in the air."""
    data = np.stack([curve(phases) for curve in walk.curves], axis=1)
    sizes = noise * np.array([1, 1, 1, _FORCE_NOISE])
    data += sizes * random_state.standard_normal(data.shape)
    data[:, 3] = np.where(phases % 1 < _TOE_OFF, np.maximum(data[:, 3], 0), 0)
    return data


def _describe_cycles(people):
    data, times, keyframes = zip(*[cycle for cycles in people for cycle in cycles], strict=True)
    return Bunch(
        data=list(data),
        times=list(times),
        keyframes=np.array(keyframes),
        keyframe_names=list(_KEYFRAMES),
        cycle=np.tile(np.arange(1, len(people[0]) + 1), len(people)),
    )


def _describe_takes(people, frame_rate):
    n_cycles, names = len(people[0][-1]), ["heel strike", *_KEYFRAMES]
    data, times, all_keyframes, events = [], [], [], []
    for signals, phases, strikes, keyframes in people:
        data.append(signals)
        times.append(phases)
        # Strike and key-frames of one cycle after the other, and the last strike.
        by_cycle = np.column_stack([strikes[:-1], keyframes])
        all_keyframes.append(np.append(by_cycle, strikes[-1]))
        marked = [("Foot Strike", frame) for frame in strikes]
        marked += [("Foot Off", frame) for frame in keyframes[:, list(_KEYFRAMES).index("toe-off")]]
        events.append(
            [
                dict(label=label, context="Right", time=float(at / frame_rate), frame=float(at))
                for label, at in sorted(marked, key=lambda event: event[1])
                if 0 <= at <= len(signals) - 1
            ]
        )
    return Bunch(
        data=data,
        times=times,
        keyframes=np.array(all_keyframes),
        keyframe_names=[f"{name} {c + 1}" for c in range(n_cycles) for name in names]
        + [f"heel strike {n_cycles + 1}"],
        events=events,
    )


def gait_csv() -> Path:
    """The path of a CSV file of made gait that ships with the package.

    It has one row a frame: the columns ``group``, ``subject``, ``trial`` and ``time`` in seconds,
    and one column a signal: ``hip_flexion``, ``knee_flexion`` and ``ankle_dorsiflexion`` in degrees
    and ``vertical_force`` in body weights. There are three strides of each of ten people. Those of
    group B push off later, by 6 % of the stride: ``make_gait(timing=6, random_state=0)``.

    Returns
    -------
    Path
        Of the file.

    Examples
    --------
    >>> import pandas as pd
    >>> from sklearn_motionsync import to_trials
    >>> from sklearn_motionsync.datasets import gait_csv
    >>> trials = to_trials(pd.read_csv(gait_csv()), by=["group", "subject", "trial"], time="time")
    >>> trials.labels.groupby("group", sort=False)["subject"].nunique().to_dict()
    {'A': 5, 'B': 5}
    """
    return Path(__file__).with_name("gait.csv")
