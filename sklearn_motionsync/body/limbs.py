"""The limbs of the body model, and which way up a body is."""

from typing import NamedTuple

import numpy as np

from .skeleton import LANDMARKS

__all__ = [
    "LEFT",
    "LIMBS",
    "LIMB_NAMES",
    "UP",
    "check_upright",
    "exponent_of",
    "landmarks_of",
    "leg_length",
    "limbs_of",
    "unit",
    "y_up",
]

# A body is upside down if it is in so many of its frames, by more than so many leg lengths. Of 363
# real performances that bend, hop, crouch and sit down, the one that comes closest has its pelvis
# 0.26 legs above the ankles and its head, on average, 0.15 above the pelvis.
_NEARLY_ALWAYS, _CLEARLY = 0.9, 0.1
# Whose left and right limbs differ by more is no body, so it has no upside; of those people the
# limbs differ by 1.38 at most.
_ALIKE = 1.5


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


def landmarks_of(positions, skeleton):
    """(n_frames, 15, 3) places of the landmarks, the second axis vertical, in units of ``2**k``; k.

    In that unit no square leaves the range of the numbers, and no digit is lost.
    """
    columns = [skeleton.index_of(name) for name in LANDMARKS]
    points = positions.reshape(len(positions), -1, 3)[:, columns]
    k = exponent_of(max(points.max(), -points.min()), points.dtype)
    return y_up(np.ldexp(points, -k) if k else points, skeleton), k


def exponent_of(largest, dtype):
    """The k of a unit ``2**k`` in which numbers up to the largest have squares; 0 if they have."""
    info = np.finfo(dtype)
    if largest == 0 or abs(k := int(np.frexp(largest)[1])) < info.maxexp // 8:
        return 0
    return k


def y_up(points, skeleton):
    """Points (..., 3) of a skeleton in axes of which the second is vertical."""
    if skeleton.up == "y":
        return points
    return np.stack([points[..., 0], points[..., 2], -points[..., 1]], axis=-1)


def limbs_of(points):
    """(n_frames, 12, 3) limb vectors of (n_frames, 15, 3) landmarks."""
    start, end = ([LANDMARKS.index(limb[k]) for limb in LIMBS.values()] for k in (0, 1))
    return points[:, end] - points[:, start]


def leg_length(lengths):
    """Length of the stretched leg, the mean of both sides."""
    parts = [
        lengths[LIMB_NAMES.index(f"{s}_{p}")] for s in ("left", "right") for p in ("thigh", "leg")
    ]
    return sum(parts) / 2


def unit(vectors):
    """Directions of vectors (..., 3) of any length; what has none stays 0."""
    norm = np.linalg.norm(vectors, axis=-1, keepdims=True)
    small = np.finfo(vectors.dtype).tiny ** 0.25
    if not (norm.min() > small and norm.max() < 1 / small):
        largest = np.abs(vectors).max(axis=-1, keepdims=True)
        vectors = vectors / np.where(largest > 0, largest, 1)
        norm = np.linalg.norm(vectors, axis=-1, keepdims=True)
    return vectors / np.where(norm > 0, norm, 1)


def _is_even(lengths):
    """Whether limbs of the left and the right are about as long as each other."""
    left, right = (
        np.array([lengths[i] for i, name in enumerate(LIMB_NAMES) if name.startswith(side)])
        for side in ("left", "right")
    )
    return bool(np.all((left < _ALIKE * right) & (right < _ALIKE * left)))


def check_upright(points, lengths, skeleton, what):
    """Refuse a body that stands on its head from the first to the last frame.

    Parameters
    ----------
    points : ndarray, shape (n_frames, 15, 3)
        Landmarks, the second axis vertical.
    lengths : ndarray, shape (n_frames, 12)
        Of the limbs.
    skeleton : Skeleton
    what : str
        What to call it in messages, with a capital letter.
    """
    left, right = (points[:, LANDMARKS.index(f"{side}_ankle")] for side in ("left", "right"))
    feet = left / 2 + right / 2
    pelvis, head = (points[:, LANDMARKS.index(name)] for name in ("pelvis", "head"))
    if np.count_nonzero(pelvis[:, 1] < feet[:, 1]) < _NEARLY_ALWAYS * (len(points) - 1):
        return
    typical = np.median(lengths, axis=0)
    legs = leg_length(typical)
    below = np.quantile(pelvis[:, 1] - feet[:, 1], _NEARLY_ALWAYS) < -_CLEARLY * legs
    if not below or (head - pelvis)[:, 1].mean() > -_CLEARLY * legs or not _is_even(typical):
        return
    axes = (("x", 1), ("y", 1), ("z", 1)) if skeleton.up == "y" else (("x", 1), ("z", 1), ("y", -1))
    rise = (head - feet).mean(axis=0)
    name, sign = axes[np.abs(rise).argmax()]
    seems = f"{'+' if sign * rise[np.abs(rise).argmax()] > 0 else '-'}{name}"
    raise ValueError(
        f"{what} is upside down: the pelvis is below the ankles and the head below the pelvis. "
        f"The skeleton says that +{skeleton.up} is up, but {seems} seems to be. Turn the positions "
        "(x, -y, -z instead of x, y, z), or give Skeleton(..., up=...) if another axis is vertical."
    )
