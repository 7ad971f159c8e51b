"""The limbs of the body model: between which landmarks they are, and how long."""

from typing import NamedTuple

import numpy as np

from .formats import LANDMARKS, SIDES

__all__ = [
    "LEFT",
    "LIMBS",
    "LIMB_NAMES",
    "UP",
    "ancestor_of",
    "exponent_of",
    "landmarks_of",
    "largest_of",
    "leg_length",
    "limbs_between",
    "limbs_of",
    "lowest",
    "places_of",
    "size_of",
    "stretched_legs",
    "unit",
]


class Limb(NamedTuple):
    """A limb of the body model: its two joints, its parent limb, and where it points at rest.

    Rest directions are those of a person standing with the arms out, seen in a frame
    whose x axis points to the person's left, y up and z forward.
    """

    start: str
    end: str
    parent: str | None
    rest: tuple


LEFT, _RIGHT, UP, _DOWN = (1, 0, 0), (-1, 0, 0), (0, 1, 0), (0, -1, 0)

# Parents come before their children: frames are built in this order.
LIMBS = {
    "hip": Limb("right_hip", "left_hip", None, LEFT),
    "torso": Limb("pelvis", "neck", "hip", UP),
    "shoulder": Limb("right_shoulder", "left_shoulder", "torso", LEFT),
    "neck": Limb("neck", "head", "torso", UP),
    "left_thigh": Limb("left_hip", "left_knee", "hip", _DOWN),
    "right_thigh": Limb("right_hip", "right_knee", "hip", _DOWN),
    "left_leg": Limb("left_knee", "left_ankle", "left_thigh", _DOWN),
    "right_leg": Limb("right_knee", "right_ankle", "right_thigh", _DOWN),
    "left_arm": Limb("left_shoulder", "left_elbow", "shoulder", LEFT),
    "right_arm": Limb("right_shoulder", "right_elbow", "shoulder", _RIGHT),
    "left_forearm": Limb("left_elbow", "left_wrist", "left_arm", LEFT),
    "right_forearm": Limb("right_elbow", "right_wrist", "right_arm", _RIGHT),
}
LIMB_NAMES = list(LIMBS)


def limbs_between(landmarks):
    """Names of the limbs both of whose joints are among the landmarks."""
    return [name for name, limb in LIMBS.items() if {limb.start, limb.end} <= set(landmarks)]


def ancestor_of(name, limbs):
    """The nearest of the limbs that a limb hangs on; None if none of them is above it."""
    above = LIMBS[name].parent
    while above is not None and above not in limbs:
        above = LIMBS[above].parent
    return above


def stretched_legs(limbs):
    """The sides whose thigh and leg are both there."""
    return [side for side in SIDES if {f"{side}_thigh", f"{side}_leg"} <= set(limbs)]


def landmarks_of(positions, skeleton):
    """(n_frames, 15, n_dims) places of the landmarks along the recording's axes, and ``k``.

    They are in units of ``2**k``, in which no square leaves the range of the numbers, and no
    digit is lost. A landmark that the skeleton lacks is at 0; one whose joints have NaN has NaN.
    """
    joints = positions.reshape(len(positions), -1, skeleton.n_dims)
    columns = {LANDMARKS.index(name): skeleton.indices_of(name) for name in skeleton.landmarks}
    used = joints[:, sorted({j for of_one in columns.values() for j in of_one})]
    k = exponent_of(largest_of(used), used.dtype)
    if k:
        joints = np.ldexp(joints, -k)
    if len(columns) == len(LANDMARKS):
        points = joints[:, [of_one[0] for of_one in columns.values()]]
    else:
        points = np.zeros((len(joints), len(LANDMARKS), skeleton.n_dims), dtype=joints.dtype)
        points[:, list(columns)] = joints[:, [of_one[0] for of_one in columns.values()]]
    for place, of_one in columns.items():
        if len(of_one) > 1:
            points[:, place] = sum(joints[:, j] for j in of_one) / len(of_one)
    return points, k


def largest_of(values):
    """The largest absolute value of those that are not NaN; 0 if all are."""
    largest = max(values.max(), -values.min())
    return np.fmax.reduce(np.abs(values), axis=None, initial=0) if np.isnan(largest) else largest


def exponent_of(largest, dtype):
    """The k of a unit ``2**k`` in which numbers up to the largest have squares; 0 if they have."""
    info = np.finfo(dtype)
    if largest == 0 or abs(k := int(np.frexp(largest)[1])) < info.maxexp // 8:
        return 0
    return k


def limbs_of(points):
    """(n_frames, 12, n_dims) limb vectors of (n_frames, 15, n_dims) landmarks."""
    start, end = ([LANDMARKS.index(limb[k]) for limb in LIMBS.values()] for k in (0, 1))
    return points[:, end] - points[:, start]


def places_of(limbs):
    """Where limbs are among all twelve: a slice, if they are all."""
    if len(limbs) == len(LIMB_NAMES):
        return slice(None)
    return [LIMB_NAMES.index(name) for name in limbs]


def leg_length(lengths, limbs=LIMB_NAMES):
    """Length of the stretched leg, the mean of the sides that have one."""
    sides = stretched_legs(limbs)
    parts = [lengths[LIMB_NAMES.index(f"{s}_{p}")] for s in sides for p in ("thigh", "leg")]
    return sum(parts) / len(sides)


def size_of(lengths, limbs):
    """What tells the size of a body: the stretched leg, or without one all of its limbs."""
    if stretched_legs(limbs):
        return leg_length(lengths, limbs)
    return sum(lengths[LIMB_NAMES.index(name)] for name in limbs)


def lowest(tracks):
    """The lowest height of (n_frames, n_dims) tracks, the second axis vertical; NaN of none."""
    return np.fmin.reduce([np.fmin.reduce(track[:, 1]) for track in tracks])


def unit(vectors):
    """Directions of vectors (..., n_dims) of any length; what has none stays 0, or NaN."""
    norm = np.linalg.norm(vectors, axis=-1, keepdims=True)
    small = np.finfo(vectors.dtype).tiny ** 0.25
    shortest, longest = norm.min(), norm.max()
    if np.isnan(longest):
        shortest, longest = (f.reduce(norm, axis=None) for f in (np.fmin, np.fmax))
    if not (shortest > small and longest < 1 / small):
        largest = np.abs(vectors).max(axis=-1, keepdims=True)
        vectors = vectors / np.where(largest > 0, largest, 1)
        norm = np.linalg.norm(vectors, axis=-1, keepdims=True)
    return vectors / np.where(norm > 0, norm, 1)
