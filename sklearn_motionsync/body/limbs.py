"""The limbs of the body model: the landmarks they join, their lengths, and the parts they form."""

from typing import NamedTuple

import numpy as np

from .formats import AXES, LANDMARKS, SIDES


class Limb(NamedTuple):
    """A limb of the body model: its two joints, its parent limb, and its direction at rest.

    At rest a person stands with the arms out to the sides. The axes are x to the person's left,
    y up and z forward.
    """

    start: str
    end: str
    parent: str | None
    rest: tuple


_LEFT, _RIGHT, _UP, _DOWN = (1, 0, 0), (-1, 0, 0), (0, 1, 0), (0, -1, 0)

# Parents come before their children.
LIMBS = {
    "hip": Limb("right_hip", "left_hip", None, _LEFT),
    "torso": Limb("pelvis", "neck", "hip", _UP),
    "shoulder": Limb("right_shoulder", "left_shoulder", "torso", _LEFT),
    "neck": Limb("neck", "head", "torso", _UP),
    "left_thigh": Limb("left_hip", "left_knee", "hip", _DOWN),
    "right_thigh": Limb("right_hip", "right_knee", "hip", _DOWN),
    "left_leg": Limb("left_knee", "left_ankle", "left_thigh", _DOWN),
    "right_leg": Limb("right_knee", "right_ankle", "right_thigh", _DOWN),
    "left_arm": Limb("left_shoulder", "left_elbow", "shoulder", _LEFT),
    "right_arm": Limb("right_shoulder", "right_elbow", "shoulder", _RIGHT),
    "left_forearm": Limb("left_elbow", "left_wrist", "left_arm", _LEFT),
    "right_forearm": Limb("right_elbow", "right_wrist", "right_arm", _RIGHT),
}
LIMB_NAMES = list(LIMBS)
# Limbs between the left and the right side: they point at a camera that sees the body's side.
LATERAL_LIMBS = ("hip", "shoulder")
# The limbs of each part of the body. The height of the pelvis belongs to no part.
PARTS = {
    "left arm": ("left_arm", "left_forearm"),
    "right arm": ("right_arm", "right_forearm"),
    "left leg": ("left_thigh", "left_leg"),
    "right leg": ("right_thigh", "right_leg"),
    "trunk": ("hip", "torso", "shoulder", "neck"),
}
# Largest mean deviation of the squared length of three cosines from 1: smoothing and resampling
# shorten them a little.
_UNIT_TOLERANCE = 0.05


# -- which limbs a body has ---------------------------------------------------------------


def limbs_between(landmarks):
    """Names of the limbs both of whose joints are among the landmarks."""
    known = set(landmarks)
    return [name for name, limb in LIMBS.items() if limb.start in known and limb.end in known]


def limb_indices(limbs):
    """Indices of limbs among all twelve: a slice if all are given."""
    if len(limbs) == len(LIMB_NAMES):
        return slice(None)
    return [LIMB_NAMES.index(name) for name in limbs]


def complete_legs(limbs):
    """The sides whose thigh and leg are both among the limbs."""
    return [side for side in SIDES if {f"{side}_thigh", f"{side}_leg"} <= set(limbs)]


# -- positions and lengths ----------------------------------------------------------------


def landmark_positions(positions, skeleton):
    """Landmarks (n_frames, 15, n_dims) of positions (n_frames, n_dims * n_joints).

    A landmark that the skeleton lacks is 0; one with a joint that is NaN is NaN.
    """
    joints = positions.reshape(len(positions), -1, skeleton.n_dims)
    indices = {LANDMARKS.index(name): skeleton.indices_of(name) for name in skeleton.landmarks}
    points = joints[:, [indices.get(k, (0,))[0] for k in range(len(LANDMARKS))]]
    points[:, [k for k in range(len(LANDMARKS)) if k not in indices]] = 0
    for k, of_one in indices.items():
        if len(of_one) > 1:
            points[:, k] = sum(joints[:, j] for j in of_one) / len(of_one)
    return points


def limb_vectors(points):
    """Limbs (n_frames, 12, n_dims) of landmarks (n_frames, 15, n_dims), from start to end."""
    start, end = ([LANDMARKS.index(limb[k]) for limb in LIMBS.values()] for k in (0, 1))
    return points[:, end] - points[:, start]


def median_lengths(lengths):
    """Medians (12,) of lengths (n_frames, 12) over the frames that show a limb, else NaN."""
    medians = np.median(lengths, axis=0)
    for k in np.flatnonzero(np.isnan(medians)):
        seen = lengths[~np.isnan(lengths[:, k]), k]
        if seen.size:
            medians[k] = np.median(seen)
    return medians


def scale_missing_lengths(lengths, learnt):
    """Lengths (12,) with NaN filled in: learnt lengths scaled to the body that is seen.

    NaN remains if no limb is seen.
    """
    seen = ~np.isnan(lengths)
    total = learnt[seen].sum()
    ratio = lengths[seen].sum() / total if total > 0 else np.nan
    return np.where(seen, lengths, ratio * learnt).astype(lengths.dtype)


def body_size(lengths, limbs):
    """The unit of length of a body: the stretched leg, or without one the sum of its limbs.

    The stretched leg is the mean of the complete legs, thigh plus leg.
    """
    sides = complete_legs(limbs)
    parts = [f"{side}_{part}" for side in sides for part in ("thigh", "leg")] or limbs
    return sum(lengths[LIMB_NAMES.index(name)] for name in parts) / max(len(sides), 1)


def lowest_height(heights):
    """The smallest of all heights (n_frames,) of some joints; NaN if all are hidden."""
    return np.fmin.reduce([np.fmin.reduce(of_joint) for of_joint in heights], initial=np.nan)


def unit_vectors(vectors):
    """Vectors (..., n_dims) divided by their length; 0 where that is 0, NaN where it is NaN."""
    norms = np.linalg.norm(vectors, axis=-1, keepdims=True)
    return vectors / np.where(norms == 0, 1, norms)


# -- parts of the body --------------------------------------------------------------------


def cosine_names(limbs, n_dims, has_height):
    """Names of the features of `DirectionCosines`: the height, and ``<limb>_<axis>``."""
    names = [f"{limb}_{axis}" for limb in limbs for axis in AXES[n_dims]]
    return ["pelvis_height"] * has_height + names


def parts_of_names(names):
    """Indices of the features of each part that has some, of features called ``<limb>_<axis>``."""
    split = [str(name).rpartition("_") for name in names]
    limb_of = [limb if axis in AXES[3] else None for limb, _, axis in split]
    parts = {
        part: [k for k, limb in enumerate(limb_of) if limb in limbs]
        for part, limbs in PARTS.items()
    }
    return {part: features for part, features in parts.items() if features}


def names_of_poses(trials):
    """Names of the features of poses that came without; empty if they are others.

    Poses of the whole body are recognised by their 37 features: a height, and twelve times
    three cosines of length 1.
    """
    names = cosine_names(LIMB_NAMES, 3, True)
    if trials[0].shape[1] != len(names):
        return []
    cosines = np.concatenate([x[:, 1:] for x in trials]).astype(np.float64)
    if not np.abs(cosines).max() < 1 + _UNIT_TOLERANCE:
        return []
    squares = np.square(cosines.reshape(-1, len(LIMB_NAMES), 3)).sum(axis=2)
    are_directions = np.abs(squares - 1).mean(axis=0) < _UNIT_TOLERANCE
    return names if are_directions.all() else []


def names_of_cosines(trials, names):
    """Names of features that are direction cosines, whether or not they came with names.

    Parameters
    ----------
    trials : sequence of ndarray (n_frames_i, n_features)
    names : list of str

    Returns
    -------
    list of str, or None
        ``names`` if some are those of limbs whose cosines have length 1; the names of
        `DirectionCosines` for poses that `names_of_poses` recognises; otherwise None.
    """
    parts = parts_of_names(names)
    # Joints may be called neck or hip, too, which are of the trunk.
    if not set(parts) - {"trunk"}:
        return names_of_poses(trials) or None
    cosines = [k for features in parts.values() for k in features]
    squares = np.concatenate([np.square(x[:, cosines]).sum(axis=1) for x in trials])
    n_limbs = len({names[k].rpartition("_")[0] for k in cosines})
    return names if abs(np.nanmean(squares) / n_limbs - 1) < _UNIT_TOLERANCE else None


def part_of_limb(limb):
    """The part of the body of a limb, such as ``"left arm"``; the pelvis is of the trunk."""
    return next((part for part, limbs in PARTS.items() if limb in limbs), "trunk")
