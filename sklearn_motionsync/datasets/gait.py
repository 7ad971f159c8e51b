"""People of two groups who walk: angles of one leg and the force under it, cycle by cycle."""

from numbers import Integral, Real
from typing import NamedTuple

import numpy as np
from scipy.interpolate import PchipInterpolator
from sklearn.utils import Bunch, check_random_state

from .limits import check_parameters, check_size

_GROUPS = ("A", "B")
_UNITS = ("degrees", "degrees", "degrees", "body weights")
# Noise of the force in body weights, as a share of that of the angles in degrees.
_FORCE_NOISE = 0.01
# At how many moments what the groups do is returned.
_N_MOMENTS = 101


def make_gait(
    n_people=10,
    n_cycles=3,
    *,
    amplitude=0.0,
    timing=0.0,
    takes=False,
    n_frames=100,
    style=1.0,
    warp=1.0,
    noise=0.3,
    frame_rate=100.0,
    random_state=None,
):
    """Gait cycles of people in two groups that differ by what is asked for, and nothing else.

    Flexion of hip, knee and ankle in the sagittal plane and the vertical force under the foot, from
    one heel strike to the next of the same foot. People differ in their movement, pace and
    duration, and their own cycles a little, too. In group B the knee is flexed further in
    swing by ``amplitude``, and the foot pushes off later by ``timing``.

    Parameters
    ----------
    n_people : int, default=10
        How many, up to a million; they belong to the groups A and B in turn.
    n_cycles : int, default=3
        Cycles of each person, up to 10000.
    amplitude : float, default=0.0
        Degrees, from -40 to 40, by which the peak of knee flexion in swing is larger in group
        B.
    timing : float, default=0.0
        Per cent of the cycle, from -12 to 12, by which toe-off comes later in group B. What is
        around it is shifted with it, the less the farther away; the heel strikes stay.
    takes : bool, default=False
        Whether to return one long take of all cycles of a person, with the events in it, instead
        of single cycles.
    n_frames : int, default=100
        Mean number of frames of a cycle, from 20 to a million; cycles have about 0.8 to 1.2 times
        as many.
    style : float, default=1.0
        How much people and cycles differ in their movement, up to 100; 0 for not at all. At 1
        angles have a standard deviation of 3 to 5 degrees between people.
    warp : float, default=1.0
        How much the pace varies within cycles, up to 10; 0 for that of the group throughout. At 1
        toe-off has a standard deviation of about 1.2 % of the cycle between people, and of 0.4 %
        within.
    noise : float, default=0.3
        Standard deviation of the noise of angles, in degrees, up to 1000; that of the force is a
        hundredth of it, in body weights, as long as the foot is on the ground.
    frame_rate : float, default=100.0
        Frames a second, from 0.001.
    random_state : int, RandomState instance or None, default=None

    Returns
    -------
    Bunch
        data : list of ndarray (n_frames_i, 4)
            Cycles, those of a person one after the other; or takes, one a person. The force
            is exactly 0 while the foot is in the air. A take begins before its first heel strike,
            and ends after its last one.
        times : list of ndarray (n_frames_i,)
            How much of the cycle is over at each frame, from 0 to 1: frames with equal times show
            the same moment, in both groups. In takes cycles are counted: the first heel strike is
            at 0, the last at ``n_cycles``.
        keyframes : ndarray (n_performances, 5)
            Frame (with fraction) of five moments within each cycle; in takes those of all cycles,
            and the heel strikes: ``(n_people, 6 * n_cycles + 1)``.
        keyframe_names : list of str
            What these moments are; in takes with the number of the cycle.
        keyframe_times : ndarray (n_keyframes,)
            When these moments come, on the scale of ``times``.
        person, group : ndarray of str (n_performances,)
            Who walks, and whether that is somebody of group "A" or "B".
        cycle : ndarray of int (n_performances,)
            Which of the person's cycles it is, from 1; not with takes.
        events : list of list of dict
            With takes only: the events of each take by time, as `read_motion` gives them: ``label``
            ("Foot Strike" or "Foot Off"), ``context`` ("Right"), ``time`` in seconds and ``frame``,
            from 0 and with fractions.
        feature_names : list of str
            "hip_flexion", "knee_flexion", "ankle_dorsiflexion", "vertical_force".
        units : list of str
            Their units: degrees, and body weights.
        frame_rate : float
            Frames a second, as given.
        group_names : list of str
            "A" and "B", in the order of what follows.
        group_curves : ndarray (2, 101, 4)
            What somebody typical of each group does at 101 moments, evenly spaced on the scale of
            ``times``: their difference is the true difference in shape.
        group_times : ndarray (2, 101)
            Which share of the cycle is over for them when these moments come: the difference is the
            true difference in timing.

    Raises
    ------
    ValueError
        If a parameter is out of its range; the message names it. If the cycles would take more than
        16 GB.

    See Also
    --------
    make_bending : Whole bodies, as joint positions.

    Examples
    --------
    >>> from sklearn_motionsync.datasets import make_gait
    >>> bunch = make_gait(4, n_cycles=2, timing=3, random_state=0)
    >>> len(bunch.data), bunch.feature_names
    (8, ['hip_flexion', 'knee_flexion', 'ankle_dorsiflexion', 'vertical_force'])
    >>> bunch.person.tolist(), "".join(bunch.group)
    (['person0', 'person0', 'person1', 'person1', ...], 'AABBAABB')
    >>> later = 100 * (bunch.group_times[1] - bunch.group_times[0])
    >>> later[[0, 30, 62, 100]].round(1).tolist()  # in per cent of the cycle
    [0.0, 0.8, 3.0, 0.0]
    """
    check_parameters(
        "make_gait",
        [
            ("n_people", n_people, Integral, 1, 10**6),
            ("n_cycles", n_cycles, Integral, 1, 10**4),
            ("amplitude", amplitude, Real, -40, 40),
            ("timing", timing, Real, -12, 12),
            ("n_frames", n_frames, Integral, 20, 10**6),
            ("style", style, Real, 0, 100),
            ("warp", warp, Real, 0, 10),
            ("noise", noise, Real, 0, 1000),
            ("frame_rate", frame_rate, Real, 0.001, 10**9),
        ],
    )
    if not isinstance(takes, (bool, np.bool_)):
        raise ValueError(
            f"The 'takes' parameter of make_gait must be True or False, got {takes!r}."
        )
    what = f"{n_people} people with {n_cycles} cycles of about {n_frames} frames"
    n_numbers = n_people * n_cycles * n_frames * len(CURVES)
    check_size("make_gait", what, n_numbers, "n_people, n_cycles or n_frames")
    # The same people walk, whatever is recorded of them.
    seeds = check_random_state(random_state).randint(np.iinfo(np.int32).max, size=n_people)
    record = _record_take if takes else _record_cycles
    people = []
    for i, seed in enumerate(seeds):
        own, in_b = check_random_state(seed), i % 2
        walk = draw_walk(own, n_cycles, amplitude * in_b, timing * in_b, style, warp)
        people.append(record(own, walk, n_frames, noise))
    made = _describe_takes(people, n_cycles, frame_rate) if takes else _describe_cycles(people)
    who = made.pop("who")
    moments = np.linspace(0, 1, _N_MOMENTS)
    return Bunch(
        **made,
        person=np.array([f"person{i}" for i in who]),
        group=np.array([_GROUPS[i % 2] for i in who]),
        feature_names=list(CURVES),
        units=list(_UNITS),
        frame_rate=float(frame_rate),
        group_names=list(_GROUPS),
        group_curves=np.stack([typical(moments, a) for a in (0.0, amplitude)]),
        group_times=np.stack([shifted(moments, t) for t in (0.0, timing)]),
    )


# -- what is recorded of it -------------------------------------------------------------


def _record_cycles(random_state, walk, n_frames, noise):
    """Of each cycle but the first and last: angles and force, times, and key-frames."""
    found = []
    moments = np.array(list(KEYFRAMES.values()))
    for c in range(1, len(walk.durations) - 1):
        length = round(n_frames * walk.durations[c])
        share = np.linspace(0, 1, length)
        times = walk.times_at(c, share)
        keyframes = (length - 1) * walk.shares_at(c, moments)
        found.append((_measure(random_state, walk, c + times, noise), times, keyframes))
    return found


def _record_take(random_state, walk, n_frames, noise):
    """A take of all of them: angles and force, times, strikes, and the other key-frames."""
    n = len(walk.durations)
    # In frames from the start of the first cycle, of which the take has the end only.
    strikes = np.concatenate([[0], np.cumsum(n_frames * walk.durations)])
    begin = np.ceil(strikes[1] - random_state.uniform(0.1, 0.35) * (strikes[1] - strikes[0]))
    end = strikes[-2] + random_state.uniform(0.1, 0.35) * (strikes[-1] - strikes[-2])
    frames = np.arange(begin, end)
    parts = np.split(frames, np.searchsorted(frames, strikes[1:-1]))
    durations = np.diff(strikes)
    phases = np.concatenate(
        [c + walk.times_at(c, (parts[c] - strikes[c]) / durations[c]) for c in range(n)]
    )
    moments = np.array(list(KEYFRAMES.values()))
    shares = np.stack([walk.shares_at(c, moments) for c in range(n)])
    others = strikes[:-1, np.newaxis] + shares * durations[:, np.newaxis] - begin
    data = _measure(random_state, walk, phases, noise)
    return data, phases - 1, strikes[1:-1] - begin, others


def _measure(random_state, walk, phases, noise):
    """Angles and force at phases, with noise; no force while the foot is in the air."""
    data = np.stack([curve(phases) for curve in walk.curves], axis=1)
    sizes = noise * np.array([1, 1, 1, _FORCE_NOISE])
    data += sizes * random_state.standard_normal(data.shape)
    data[:, 3] = np.where(phases % 1 < TOE_OFF, np.maximum(data[:, 3], 0), 0)
    return data


# -- how it is returned -----------------------------------------------------------------


def _describe_cycles(people):
    data, times, keyframes = zip(*[cycle for cycles in people for cycle in cycles], strict=True)
    n_cycles = len(people[0])
    numbers = np.arange(len(data))
    return {
        "data": list(data),
        "times": list(times),
        "keyframes": np.array(keyframes),
        "keyframe_names": list(KEYFRAMES),
        "keyframe_times": np.array(list(KEYFRAMES.values())),
        "cycle": numbers % n_cycles + 1,
        "who": numbers // n_cycles,
    }


def _describe_takes(people, n_cycles, frame_rate):
    data, times, strikes, others = zip(*people, strict=True)
    keyframes = [
        np.append(np.column_stack([at[:-1], inside[1:-1]]).ravel(), at[-1])
        for at, inside in zip(strikes, others, strict=True)
    ]
    names = ["heel strike", *KEYFRAMES]
    all_names = [f"{name} {c + 1}" for c in range(n_cycles) for name in names]
    moments = np.arange(n_cycles)[:, np.newaxis] + np.array([0, *KEYFRAMES.values()])
    toe_off = list(KEYFRAMES).index("toe-off")
    events = [
        _events(len(x), at, inside[:, toe_off], frame_rate)
        for x, at, inside in zip(data, strikes, others, strict=True)
    ]
    return {
        "data": list(data),
        "times": list(times),
        "keyframes": np.array(keyframes),
        "keyframe_names": [*all_names, f"heel strike {n_cycles + 1}"],
        "keyframe_times": np.append(moments.ravel(), n_cycles),
        "events": events,
        "who": np.arange(len(data)),
    }


def _events(n_frames, strikes, toe_offs, frame_rate):
    """What is within the take, by time."""
    marked = [("Foot Strike", f) for f in strikes] + [("Foot Off", f) for f in toe_offs]
    return [
        {
            "label": label,
            "context": "Right",
            "time": float(frame / frame_rate),
            "frame": float(frame),
        }
        for label, frame in sorted(marked, key=lambda event: event[1])
        if 0 <= frame <= n_frames - 1
    ]


# -- how somebody walks: the course of angles and force, cycle after cycle, and its pace -

# When the moments come, in shares of a cycle from heel strike to heel strike.
TOE_OFF = 0.62
KEYFRAMES = {
    "first force peak": 0.14,
    "valley of the force": 0.30,
    "second force peak": 0.48,
    "toe-off": TOE_OFF,
    "peak knee flexion": 0.73,
}

# Degrees of flexion, of the ankle dorsiflexion, and body weights, by share of the cycle.
CURVES = {
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
        0.54: 0.76, 0.58: 0.30, TOE_OFF: 0, 0.75: 0, 0.90: 0,
    },
}  # fmt: skip
# How people differ: degrees by which an angle is larger throughout, and by which it is larger here
# and smaller there; the share of the latter between cycles of somebody; and shares by which the
# range of a curve is larger, and by which the force is larger here and there, for each degree.
_MOVED = {"hip_flexion": 4.0, "knee_flexion": 3.0, "ankle_dorsiflexion": 2.5}
_BENT, _BENT_AGAIN = 1.5, 0.3
_LARGER, _FORCE_A_DEGREE = 0.06, 0.02
# At how many moments a pace is drawn.
_N_PACE = 501


class Walk(NamedTuple):
    """Consecutive cycles of one person.

    ``curves`` give angles and force at a phase, in cycles. At so many even steps of the group's
    pace ``moments`` come; when they do, ``shares`` of each cycle are over, which takes as long as
    ``durations`` say, about 1. There is one cycle more at either end.
    """

    curves: list
    moments: np.ndarray
    shares: np.ndarray
    durations: np.ndarray

    def times_at(self, cycle, share):
        """Which moment of a cycle it is when a share of it is over."""
        even = np.linspace(0, 1, _N_PACE)
        return np.interp(np.interp(share, self.shares[cycle], even), even, self.moments)

    def shares_at(self, cycle, moments):
        """Which share of a cycle is over at moments."""
        even = np.linspace(0, 1, _N_PACE)
        return np.interp(np.interp(moments, self.moments, even), even, self.shares[cycle])


def draw_walk(random_state, n_cycles, amplitude, timing, style, warp):
    """So many cycles of somebody, with one more before and after them."""
    n = n_cycles + 2
    durations = random_state.uniform(0.85, 1.15) * random_state.uniform(0.96, 1.04, n)
    curves = []
    for name, anchors in CURVES.items():
        at = np.array(list(anchors))
        values = _vary(random_state, style, name, at, _anchors_of(name, amplitude), n)
        # Cycle after cycle, so that one ends where the next begins.
        phases = np.arange(n)[:, np.newaxis] + at
        curves.append(PchipInterpolator(phases.ravel(), values.ravel()))
    even = np.linspace(0, 1, _N_PACE)
    shares = _draw_shares(random_state, n, warp, even)
    # Where the group is at an even pace, people are at theirs.
    moments = np.interp(even, shifted(even, timing), even)
    return Walk(curves, moments, shares, durations)


def _anchors_of(name, amplitude):
    """Values of a curve where it is known, with the knee flexed further in swing."""
    at, values = np.array(list(CURVES[name].items()), dtype=np.float64).T
    if name == "knee_flexion":
        peak = KEYFRAMES["peak knee flexion"]
        values += amplitude * np.cos(np.pi * np.clip((at - peak) / 0.42, -0.5, 0.5)) ** 2
    return values


def _vary(random_state, style, name, at, values, n):
    """The same of n cycles of a person, each a little larger or smaller here and there."""
    waves = np.arange(1, 4)[:, np.newaxis]

    def draw(count, size):
        weights = size * random_state.standard_normal((count, 3)) / waves[:, 0]
        return weights @ np.sin(2 * np.pi * (waves * at + random_state.uniform(size=(3, 1))))

    wave = draw(1, _BENT) + draw(n, _BENT * _BENT_AGAIN)
    larger = np.exp(style * _LARGER * random_state.standard_normal())
    moved = random_state.standard_normal()
    if name == "vertical_force":
        # What is 0 stays 0.
        return values * larger * np.exp(style * _FORCE_A_DEGREE * wave)
    return values * larger + style * (_MOVED[name] * moved + wave)


def _draw_shares(random_state, n, strength, even):
    """Shares of n cycles over at even moments: integrals of smooth positive rates."""
    waves = np.arange(1, 4)[:, np.newaxis]
    shape = np.sin(np.pi * waves * even + random_state.uniform(0, 2 * np.pi, (3, 1)))
    weights = random_state.standard_normal((1, 3)) + 0.35 * random_state.standard_normal((n, 3))
    rates = 2 ** (0.5 * strength * np.tanh(0.15 * (weights / waves[:, 0]) @ shape))
    shares = np.cumsum((rates[:, 1:] + rates[:, :-1]) / 2, axis=1)
    return np.hstack([np.zeros((n, 1)), shares / shares[:, -1:]])


def shifted(moments, timing):
    """The share of the cycle that is over when moments come, toe-off being later by timing."""
    exponent = np.log(0.5) / np.log(TOE_OFF)
    return moments + timing / 100 * np.sin(np.pi * moments**exponent) ** 2


def typical(moments, amplitude):
    """Angles and force of somebody typical: (n_moments, 4)."""
    curves = []
    for name, anchors in CURVES.items():
        at = np.arange(-1, 2)[:, np.newaxis] + np.array(list(anchors))
        values = np.tile(_anchors_of(name, amplitude), 3)
        curves.append(PchipInterpolator(at.ravel(), values)(moments))
    return np.stack(curves, axis=1)
