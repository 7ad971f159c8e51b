"""Synthetic walks of whole bodies, with the true foot strikes and foot-offs."""

from __future__ import annotations

from numbers import Integral, Real
from typing import NamedTuple

import numpy as np
from scipy.interpolate import CubicHermiteSpline
from scipy.ndimage import gaussian_filter1d
from sklearn.utils import Bunch, check_random_state
from sklearn.utils._param_validation import Interval

from ..body.formats import SIDES
from ..body.skeleton import Skeleton
from ..inputs.types import RandomState
from ..utils.parameters import validated_function
from .bending import LIMITS

_ENDS = [f"{side}_{end}" for side in SIDES for end in ("heel", "toe")]
# An average body: metres, seconds, and shares of a stride or of the leg.
_LEG, _FOOT, _HIPS, _SHOULDERS, _TRUNK = 0.9, 0.2, 0.22, 0.36, 0.5
_STRIDE_TIME, _STANCE, _STRIDE_LENGTH, _WIDTH = 1.1, 0.62, 1.5, 0.1
# Their standard deviations between people, and those of time and length between strides.
_BETWEEN = {"leg": 0.05, "time": 0.07, "stance": 0.01, "length": 0.08, "width": 0.025}
_WITHIN = 0.015
# Degrees of the foot at the strike and as it leaves the ground; shares of the stance until it is
# flat, and from which on the heel rises.
_TOE_UP, _HEEL_UP, _FLAT, _RISES = 20.0, 60.0, 0.13, 0.6
# The ankle above and before the heel, in metres.
_ANKLE = 0.05, 0.07
# Metres a second of the heel at the strike: along the way and downwards. Seconds in which the toe
# gathers the speed of the body before it leaves the ground, and its speed upwards then.
_LANDING, _ROLL, _LIFT = (0.3, 0.6), 0.06, 0.35
# Seconds of the Gaussian by which skin and shoe smooth the way of a foot.
_SOFT = 0.008
# Metres by which the pelvis rises over a standing leg, and is before and behind its mean way.
_BOB, _SWAY = 0.02, 0.012


class _Gait(NamedTuple):
    """How a person walks: metres and seconds."""

    leg: float
    stride_time: float
    stance: float
    stride_length: float
    width: float
    shift: float


@validated_function(
    {
        "n_people": [Interval(Integral, 1, 10**6, closed="both")],
        "n_strides": [Interval(Integral, 1, 10**5, closed="both")],
        "treadmill": ["boolean"],
        "asymmetry": [Interval(Real, -30, 30, closed="both")],
        **{name: LIMITS[name] for name in ("style", "noise", "frame_rate", "random_state")},
    }
)
def make_walk(
    n_people: int = 6,
    n_strides: int = 6,
    *,
    treadmill: bool = False,
    asymmetry: float = 0.0,
    style: float = 1.0,
    noise: float = 0.001,
    frame_rate: float = 100.0,
    random_state: RandomState = None,
) -> Bunch:
    """Walks of whole bodies with feet, and the true strikes, foot-offs and lengths.

    The feet are planned: the heel strikes the ground with the toe up, the foot lies flat, rolls
    over the toe and swings. Pelvis, knees, trunk and arms follow. People differ in size, pace and
    width, and their strides a little in time and length.

    Parameters
    ----------
    n_people : int, default=6
        Number of people, one recording each.
    n_strides : int, default=6
        Number of strides of the right foot, up to 100000.
    treadmill : bool, default=False
        Whether they walk on a belt, and stay where they are.
    asymmetry : float, default=0.0
        Per cent of the stride, from -30 to 30, by which the strike of the left foot is later than
        half way between those of the right foot.
    style : float, default=1.0
        Size of the differences between people and strides, from 0 to 100.
    noise : float, default=0.001
        Standard deviation of the noise of positions in metres, up to 1000.
    frame_rate : float, default=100.0
        Frames a second, from 0.001.
    random_state : int, RandomState instance or None, default=None
        Seed of the generator; by default every call makes other people.

    Returns
    -------
    Bunch
        data : list of ndarray (n_frames_i, 57)
            Joint positions in metres, y up: the fifteen landmarks of the body, heels and toes.
        events : list of list of dict
            The events of each recording by time, as of ``read_motion``: ``label`` ("Foot Strike" or
            "Foot Off"), ``context``, ``time`` in seconds and ``frame``, with fractions.
        skeleton : Skeleton
            Which columns are which joints.
        frame_rate : float
            Frames a second, as given.
        speed, stride_length, step_width : ndarray (n_people,)
            Mean metres a second, and metres.

    Raises
    ------
    ValueError
        If a parameter is out of its range.

    See Also
    --------
    make_gait : Angles of one leg and the force under the foot, in two groups.

    Notes
    -----
    When the toe leaves the ground it is already as fast as the body, as on force plates.

    Examples
    --------
    >>> from sklearn_motionsync.datasets import make_walk
    >>> walk = make_walk(2, random_state=0)
    >>> walk.skeleton.joints[-4:]
    ('left_heel', 'left_toe', 'right_heel', 'right_toe')
    >>> [(event["label"], event["context"]) for event in walk.events[0][:4]]
    [('Foot Strike', 'Right'), ('Foot Off', 'Left'), ('Foot Strike', 'Left'), ('Foot Off', 'Right')]
    """
    seeds = check_random_state(random_state).randint(np.iinfo(np.int32).max, size=n_people)
    data, events, gaits = [], [], []
    for seed in seeds:
        generator = check_random_state(seed)
        gait = _draw(generator, style, asymmetry)
        positions, walk_events = _record(generator, gait, n_strides, style, treadmill, frame_rate)
        positions += generator.normal(0, noise, positions.shape) if noise > 0 else 0
        data.append(positions)
        events.append(walk_events)
        gaits.append(gait)
    return Bunch(
        data=data,
        events=events,
        skeleton=_skeleton(),
        frame_rate=float(frame_rate),
        speed=np.array([g.stride_length / g.stride_time for g in gaits]),
        stride_length=np.array([g.stride_length for g in gaits]),
        step_width=np.array([g.width for g in gaits]),
    )


def _skeleton():
    paper = Skeleton.paper()
    parents = [*paper.parents]
    parents += [paper.joints.index(f"{name.split('_')[0]}_ankle") for name in _ENDS]
    return Skeleton([*paper.joints, *_ENDS], parents, dict(paper.landmarks))


def _draw(rng, style, asymmetry):
    """The gait of a person."""
    draws = {name: style * sd * rng.normal() for name, sd in _BETWEEN.items()}
    leg = _LEG * np.exp(draws["leg"])
    return _Gait(
        leg=leg,
        stride_time=_STRIDE_TIME * np.exp(draws["time"]),
        stance=float(np.clip(_STANCE + draws["stance"], 0.55, 0.72)),
        stride_length=_STRIDE_LENGTH * leg * np.exp(draws["length"]) / 1.05,
        width=_WIDTH * np.exp(draws["width"] / _WIDTH),
        shift=asymmetry / 100,
    )


def _record(rng, gait, n_strides, style, treadmill, frame_rate):
    """The positions of a walk, and its events."""
    # One more stride at either end, which is cut off half way.
    count = n_strides + 3
    lasts = gait.stride_time * np.exp(style * _WITHIN * rng.normal(size=count))
    strikes = {"right": np.concatenate([[0], np.cumsum(lasts)])}
    strikes["left"] = strikes["right"][:-1] + (0.5 + gait.shift) * lasts
    begin, end = (strikes["right"][k] - 0.3 * gait.stride_time for k in (1, n_strides + 2))
    times = np.arange(0, end - begin, 1 / frame_rate) + begin
    speed = gait.stride_length / gait.stride_time
    feet, events = {}, []
    for side, at in strikes.items():
        offs = at + gait.stance * np.diff(at, append=at[-1] + gait.stride_time)
        places = speed * at + style * _WITHIN * gait.stride_length * rng.normal(size=len(at))
        feet[side] = _foot(times, at, offs, places, speed)
        moments = [("Foot Strike", t) for t in at] + [("Foot Off", t) for t in offs]
        events += [
            {"label": label, "context": side.capitalize(), "time": float(t - begin),
             "frame": float((t - begin) * frame_rate)}
            for label, t in moments if times[0] < t < times[-1]
        ]  # fmt: skip
    joints = _body(times, feet, gait, speed, strikes["right"])
    positions = np.stack([joints[name] for name in _skeleton().joints], axis=1)
    if treadmill:
        positions[..., 2] -= speed * (times - begin)[:, np.newaxis]
    events.sort(key=lambda event: event["time"])
    return positions.reshape(len(times), -1), events


def _foot(times, strikes, offs, places, speed):
    """Heel, toe and ankle (n_frames, 2), along the way and upwards, of a foot.

    It is planned on a fine grid, and smoothed as by skin and shoe.
    """
    step = 0.001
    fine = np.arange(times[0] - 0.1, times[-1] + 0.1, step)
    heel, pitch = np.empty((len(fine), 2)), np.empty(len(fine))
    for k, (strike, off, place) in enumerate(zip(strikes, offs, places, strict=True)):
        standing = (fine >= strike) & (fine < off)
        heel[standing], pitch[standing] = _stance(fine[standing], strike, off, place, speed)
        if k + 1 == len(strikes):
            heel[fine >= off], pitch[fine >= off] = _stance(
                np.array([off]), strike, off, place, speed
            )
            break
        if k == 0:
            heel[fine < strike], pitch[fine < strike] = (place, 0), np.radians(_TOE_UP)
        swinging = (fine >= off) & (fine < strikes[k + 1])
        ends, angles = _stance(np.array([off - step, off]), strike, off, place, speed)
        velocity, turn = (ends[1] - ends[0]) / step, (angles[1] - angles[0]) / step
        knots = np.array([off, strikes[k + 1]])
        landing = np.array([_LANDING[0], -_LANDING[1]])
        way = CubicHermiteSpline(
            knots, np.array([ends[1], [places[k + 1], 0]]), np.array([velocity, landing])
        )
        angle = CubicHermiteSpline(knots, [angles[1], np.radians(_TOE_UP)], [turn, 0])
        heel[swinging], pitch[swinging] = way(fine[swinging]), angle(fine[swinging])
    along = np.stack([np.cos(pitch), np.sin(pitch)], axis=1)
    across = np.stack([-np.sin(pitch), np.cos(pitch)], axis=1)
    points = heel, heel + _FOOT * along, heel + _ANKLE[0] * along + _ANKLE[1] * across
    return [
        np.stack(
            [np.interp(times, fine, gaussian_filter1d(x, _SOFT / step)) for x in point.T], axis=1
        )
        for point in points
    ]


def _stance(times, strike, off, place, speed):
    """Heel and pitch of a foot on the ground; it turns about the heel, then about the toe."""
    share = (times - strike) / (off - strike)
    down = np.clip(1 - share / _FLAT, 0, 1) ** 2
    rise = np.clip((share - _RISES) / (1 - _RISES), 0, None) ** 2
    pitch = np.radians(_TOE_UP * down - _HEEL_UP * rise)
    rolled = np.square(np.clip(times - off + _ROLL, 0, None)) / (2 * _ROLL)
    toe = np.stack([place + _FOOT + speed * rolled, _LIFT * rolled], axis=1)
    from_toe = toe - _FOOT * np.stack([np.cos(pitch), np.sin(pitch)], axis=1)
    at_heel = np.stack([np.full(len(times), place), np.zeros(len(times))], axis=1)
    return np.where((rise > 0)[:, np.newaxis], from_toe, at_heel), pitch


def _body(times, feet, gait, speed, strikes):
    """All joints (n_frames, 3): x to the left, y up, z along the way."""
    phase = 2 * np.pi * np.interp(times, strikes, np.arange(len(strikes)))
    # It is fastest when both feet are on the ground.
    way = speed * (times - 0.02) - 0.02 + _SWAY * np.sin(2 * phase)
    height = gait.leg - _BOB * np.cos(2 * phase)
    pelvis = np.stack([0.5 * gait.width * -0.3 * np.sin(phase), height, way], axis=1)
    joints = {"pelvis": pelvis}
    reach = 0.0
    for side, sign in (("left", 1), ("right", -1)):
        joints[f"{side}_hip"] = pelvis + [sign * _HIPS / 2, -0.04, 0]
        for name, point in zip(("heel", "toe", "ankle"), feet[side], strict=True):
            aside = np.full(len(times), sign * gait.width / 2)
            joints[f"{side}_{name}"] = np.stack([aside, point[:, 1], point[:, 0]], axis=1)
        legs = joints[f"{side}_hip"] - joints[f"{side}_ankle"]
        reach = max(reach, np.linalg.norm(legs, axis=1).max())
    for side in SIDES:
        hip, ankle = joints[f"{side}_hip"], joints[f"{side}_ankle"]
        # Thigh and leg are alike, and stretched at most once.
        joints[f"{side}_knee"] = _bend(hip, ankle, 1.005 * reach / 2)
    joints["neck"] = pelvis + [0, _TRUNK, 0.03]
    joints["head"] = joints["neck"] + [0, 0.22, 0.02]
    for side, sign in (("left", 1), ("right", -1)):
        shoulder = joints["neck"] + [sign * _SHOULDERS / 2, -0.04, 0]
        # The right foot is ahead at phase 0, and the left arm with it.
        swing = np.radians(20) * sign * np.cos(phase) * min(speed, 2)
        down = np.stack([np.zeros(len(times)), -np.cos(swing), np.sin(swing)], axis=1)
        fore = np.stack([np.zeros(len(times)), -np.cos(swing + 0.4), np.sin(swing + 0.4)], axis=1)
        joints[f"{side}_shoulder"] = shoulder
        joints[f"{side}_elbow"] = shoulder + 0.3 * down
        joints[f"{side}_wrist"] = joints[f"{side}_elbow"] + 0.26 * fore
    return joints


def _bend(hip, ankle, half):
    """Knees in front of the line from hip to ankle, ``half`` from both."""
    line = ankle - hip
    depth = np.sqrt(np.maximum(half**2 - np.square(line).sum(axis=1) / 4, 0))
    front = np.stack([np.zeros(len(line)), line[:, 2], -line[:, 1]], axis=1)
    front /= np.linalg.norm(front, axis=1, keepdims=True)
    return hip + line / 2 + depth[:, np.newaxis] * front
