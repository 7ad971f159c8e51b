"""Moments of real movements that can be told from positions alone, without any matching.

`EVENTS` lists them: the extremum, the crossing of half the height or a turning point of one
coordinate of the body. A clip takes part in an event only where that moment is unambiguous
(`moment`, `turning_points`): a plateau, two rival peaks or a clip cut short would measure the
event, not the method. `read_actions` gives the clips and when it happens in them.
"""

from itertools import pairwise
from pathlib import Path
from typing import NamedTuple

import numpy as np
from scipy.ndimage import gaussian_filter1d
from scipy.signal import find_peaks
from sklearn_motionsync.datasets import load_performances

P = 100

# -- the events as data -----------------------------------------------------------------


class Event(NamedTuple):
    """One moment of one action.

    ``kind`` is "min", "max", "rise", "fall" or, of a curve that must turn exactly as ``turns``
    says, the number of the turning point. ``peers``: mean and median error of the best peer.
    """

    archive: str
    action: str
    name: str
    curve: str
    kind: str | int
    turns: str = ""
    peers: tuple = ()


BEND, ELBOW, GRAB = (
    ("hdm05", name) for name in ("depositFloorR", "elbowToKnee1RepsLelbowStart", "grabHighR")
)
HOP, JOG, SNEAK = (
    ("hdm05", name)
    for name in ("hopBothLegs1hops", "jogLeftCircle4StepsRstart", "sneak2StepsLStart")
)
PICK, SIT, STAND, THROW, PUSH, PULL = (
    ("utkinect", name) for name in ("pickUp", "sitDown", "standUp", "throw", "push", "pull")
)
WALK = ("cmu07_walk", "walk")
STEPS = "max min max min"
# The last numbers are no result of a run of this repository's: the smallest mean and the smallest
# median that any of 30 settings of DTW, soft-DTW, ADTW, SRVF and gdtw reached on these clips and
# pairs, each event and each number by the setting that is best for it.
EVENTS = [
    Event(*BEND, "pelvis lowest", "pelvis", "min", peers=(2.84, 0.89)),
    Event(*BEND, "hand lowest", "low hand", "min", peers=(5.03, 3.02)),
    Event(*BEND, "head lowest", "head", "min"),
    Event(*ELBOW, "ankle highest", "right ankle", "max", peers=(2.02, 1.43)),
    Event(*ELBOW, "head lowest", "head", "min"),
    Event(*GRAB, "hand rises", "right hand", "rise", peers=(2.17, 1.65)),
    Event(*GRAB, "hand falls", "right hand", "fall", peers=(3.49, 2.36)),
    Event(*HOP, "pelvis highest", "pelvis", "max", peers=(7.38, 5.56)),
    Event(*HOP, "ankle highest", "right ankle", "max", peers=(7.67, 5.84)),
    Event(*HOP, "head highest", "head", "max"),
    Event(*HOP, "ankle rises", "right ankle", "rise"),
    Event(*JOG, "right foot ahead, first", "step", 0, STEPS),
    Event(*JOG, "left foot ahead, first", "step", 1, STEPS, (0.56, 0.47)),
    Event(*JOG, "right foot ahead, second", "step", 2, STEPS, (0.58, 0.53)),
    Event(*JOG, "left foot ahead, second", "step", 3, STEPS),
    Event(*SNEAK, "ankle highest", "right ankle", "max", peers=(3.89, 3.33)),
    Event(*SNEAK, "right foot ahead", "step", "max", peers=(2.17, 1.83)),
    Event(*PICK, "hand lowest", "low hand", "min", peers=(12.36, 9.29)),
    Event(*PICK, "head lowest", "head", "min", peers=(12.40, 9.09)),
    Event(*SIT, "head lowest", "head", "min", peers=(9.19, 8.08)),
    Event(*SIT, "pelvis falls", "pelvis", "fall"),
    Event(*STAND, "head rises", "head", "rise", peers=(3.39, 2.29)),
    Event(*STAND, "pelvis rises", "pelvis", "rise"),
    Event(*STAND, "head lowest", "head", "min"),
    Event(*THROW, "hand falls", "right hand", "fall", peers=(3.09, 2.37)),
    Event(*PUSH, "hand furthest ahead", "reach", "max"),
    Event(*PUSH, "hand goes ahead", "reach", "rise"),
    Event(*PULL, "hand rises", "right hand", "rise"),
    Event(*WALK, "left foot ahead", "step", "min"),
    Event(*WALK, "right ankle highest", "right ankle", "max"),
    Event(*WALK, "left ankle highest", "left ankle", "max"),
]

# What the archives call what the curves are made of.
PARTS = ("pelvis", "head", "right hand", "left hand", "right ankle", "left ankle")
PARTS += ("right hip", "left hip")
JOINTS = {
    "hdm05": "root head rhand lhand rtibia ltibia rhipjoint lhipjoint",
    "utkinect": "HipCenter Head HandRight HandLeft AnkleRight AnkleLeft HipRight HipLeft",
    "cmu07_walk": "CC_Base_Hip CC_Base_Head CC_Base_R_Hand CC_Base_L_Hand CC_Base_R_Foot "
    "CC_Base_L_Foot CC_Base_R_Thigh CC_Base_L_Thigh",
}
# Width of the Gaussian under which curves are looked at: a share of the clip, and frames at least.
SMOOTHING = {"hdm05": 0.015, "utkinect": 0.03, "cmu07_walk": 0.015}
LEAST_FRAMES = 0.6
# Clips of fewer frames show no action.
LEAST_LENGTH = 8

# -- the rule of unambiguous moments ----------------------------------------------------


def moment(curve, kind):
    """When a smoothed curve has its extremum, or crosses half its height: in [0, 1], or NaN."""
    if kind in ("rise", "fall"):
        return _crossing(curve if kind == "rise" else -np.asarray(curve))
    return _summit(curve if kind == "max" else -np.asarray(curve))


def _crossing(curve):
    """Upwards through half the height: once, and back once at most."""
    above = curve - (curve.max() + curve.min()) / 2
    changes = np.diff((above >= 0).astype(int))
    upwards = np.flatnonzero(changes > 0)
    if len(upwards) != 1 or np.count_nonzero(changes < 0) > 1:
        return np.nan
    before = upwards[0]
    part = above[before] / (above[before] - above[before + 1])
    return (before + part) / (len(curve) - 1)


def _summit(curve):
    """The maximum: not at an end, no plateau, and no rival of three quarters' height."""
    height = (curve - curve.min()) / (np.ptp(curve) or 1)
    top, last = int(np.argmax(height)), len(curve) - 1
    if min(top, last - top) < 0.04 * last or np.mean(height > 0.97) > 0.25:
        return np.nan
    # Peaks at the ends are peaks as well.
    peaks = find_peaks(np.pad(height, 1, constant_values=-1), prominence=0.1)[0] - 1
    rivals = peaks[height[peaks] > 0.75]
    if np.any(np.abs(rivals - top) > 0.08 * len(curve)):
        return np.nan
    before, here, after = height[top - 1 : top + 2]
    bend = before + after - 2 * here
    # The vertex of the parabola through three frames.
    part = np.clip((before - after) / (2 * bend), -0.5, 0.5) if bend < 0 else 0.0
    return (top + part) / last


def turning_points(curve, turns):
    """When a smoothed curve turns, if it turns exactly like that ("max min"): in [0, 1], or NaN."""
    least = 0.3 * np.ptp(curve)
    found = [
        (int(frame), kind)
        for kind, sign in (("max", 1), ("min", -1))
        for frame in find_peaks(sign * np.asarray(curve), prominence=least)[0]
    ]
    found.sort()
    wanted = turns.split()
    if [kind for _, kind in found] != wanted:
        return np.full(len(wanted), np.nan)
    return np.array([frame for frame, _ in found]) / (len(curve) - 1)


# -- curves of the body -----------------------------------------------------------------


def body_curve(positions, part):
    """One coordinate of the body over time, of positions by part: height, step or reach."""
    if part == "low hand":
        return np.minimum(positions["right hand"][:, 1], positions["left hand"][:, 1])
    if part == "step":
        return _ahead(positions, positions["right ankle"] - positions["left ankle"])
    if part == "reach":
        return _ahead(positions, positions["right hand"] - positions["pelvis"])
    return positions[part][:, 1]


def _ahead(positions, vectors):
    """The part of vectors that points where the hips face."""
    across = positions["left hip"] - positions["right hip"]
    facing = np.cross(across, [0.0, 1.0, 0.0])
    length = np.linalg.norm(facing, axis=1)
    return np.einsum("tk,tk->t", vectors, facing) / (length + 1e-12)


def find(curves, event, smoothing):
    """When an event happens in every clip, in frames of the clock; NaN where it is ambiguous."""
    moments, ranges = [], []
    for curve in curves:
        width = max(smoothing * len(curve), LEAST_FRAMES)
        smoothed = gaussian_filter1d(curve, width, mode="nearest")
        if event.turns:
            moments.append(turning_points(smoothed, event.turns)[event.kind])
        else:
            moments.append(moment(smoothed, event.kind))
        ranges.append(np.ptp(smoothed))
    moments, ranges = np.array(moments), np.array(ranges)
    # Who hardly moves that part of the body does not show the event.
    moments[ranges < 0.4 * np.median(ranges)] = np.nan
    return moments * (P - 1)


# -- the clips --------------------------------------------------------------------------


class Action(NamedTuple):
    """The clips of an action: joint positions, who performs, and the moments by event."""

    archive: str
    name: str
    data: list
    actors: np.ndarray
    skeleton: object
    moments: dict


def read_actions(folder, events=EVENTS):
    """Read the actions of some events, in their order, from the folder of the archives."""
    bunches, actions = {}, []
    for archive, name in dict.fromkeys((event.archive, event.action) for event in events):
        if archive not in bunches:
            bunches[archive] = read_archive(folder, archive)
        bunch = bunches[archive]
        parts = _joints_of_parts(bunch, archive)
        chosen = np.flatnonzero(bunch.target == name)
        data = [bunch.data[i] for i in chosen]
        by_part = [_by_part(x, parts) for x in data]
        moments = {
            e.name: find([body_curve(b, e.curve) for b in by_part], e, SMOOTHING[archive])
            for e in events
            if (e.archive, e.action) == (archive, name)
        }
        actions.append(Action(archive, name, data, bunch.actor[chosen], bunch.skeleton, moments))
    return actions


def read_archive(folder, archive):
    """The clips of an archive that have eight frames at least; takes of walking cut into cycles."""
    bunch = load_performances(Path(folder) / archive / f"{archive}_positions.npz")
    if archive == "cmu07_walk":
        bunch = _cut_into_cycles(bunch, _joints_of_parts(bunch, archive))
    chosen = [i for i, x in enumerate(bunch.data) if len(x) >= LEAST_LENGTH]
    bunch.data = [bunch.data[i] for i in chosen]
    bunch.target, bunch.actor = np.asarray(bunch.target)[chosen], np.asarray(bunch.actor)[chosen]
    return bunch


def _joints_of_parts(bunch, archive):
    joints = list(bunch.joints)
    return dict(zip(PARTS, map(joints.index, JOINTS[archive].split()), strict=True))


def _by_part(x, parts):
    joints = x.reshape(len(x), -1, 3).astype(float)
    return {part: joints[:, joint] for part, joint in parts.items()}


def _cut_into_cycles(bunch, parts):
    """Walks, cut from right foot ahead to right foot ahead, two cycles of a take at most.

    All are one person's: the take stands for the actor.
    """
    data, takes = [], []
    for take, x in enumerate(bunch.data):
        step = body_curve(_by_part(x, parts), "step")
        step = gaussian_filter1d(step, max(0.02 * len(step), 1), mode="nearest")
        peaks = find_peaks(step, prominence=0.4 * np.ptp(step))[0]
        cycles = [(a, b) for a, b in pairwise(peaks) if b - a >= 10]
        data += [x[a : b + 1] for a, b in cycles[:2]]
        takes += [take] * len(cycles[:2])
    bunch.data, bunch.actor = data, np.array(takes)
    bunch.target = np.full(len(data), "walk")
    return bunch
