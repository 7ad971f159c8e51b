"""Bodies to be drawn: put upright, turned the same way, seen from a side."""

import numpy as np

from ..body.axes import heading
from ..body.limbs import unit
from ..body.skeleton import check_columns
from ..body.upright import y_up
from ..gate import as_numbers
from .given import mean_of_seen

__all__ = [
    "bodies_of",
    "bodies_of_postures",
    "bones_by_side",
    "limits",
    "on_screen",
    "placed",
    "upright",
]

# How far people may walk, in their heights, before the picture follows them.
_FAR = 0.75
# Pictures are at least so high and wide, as a share of the other.
_FLAT = 0.05
# What squares and products of coordinates bear.
_LARGEST = 1e150


def upright(x, skeleton, i):
    """(n_frames, n_joints, 3) of (n_frames, 3 n_joints), with the second axis vertical.

    Without a skeleton the second axis is taken for vertical.
    """
    what = f"Performance {i}"
    if skeleton is not None:
        check_columns(x, skeleton, what)
    x = as_numbers(x, what, dtype=np.float64)
    n_joints = x.shape[-1] // 3 if skeleton is None and x.ndim > 0 else 0
    if skeleton is not None:
        n_joints = len(skeleton.joints)
    if x.ndim != 2 or x.shape[1] != 3 * n_joints or x.size == 0:
        whose, width = "joints", "3 * n_joints"
        if skeleton is not None:
            whose, width = f"the skeleton's {n_joints} joints", 3 * n_joints
        raise ValueError(
            f"{what} has shape {x.shape}, but the positions of {whose} are (n_frames, {width})."
        )
    wrong = np.abs(x) > _LARGEST
    if wrong.any():
        frame, column = np.argwhere(wrong)[0]
        size = "infinite" if np.isinf(x[frame, column]) else "too large to draw"
        raise ValueError(
            f"{what}, frame {frame}, column {column} is {size}; make it NaN to leave a gap."
        )
    points = x.reshape(len(x), -1, 3)
    return points if skeleton is None else y_up(points, skeleton)


def placed(x, skeleton, *, follow=False):
    """A performance turned to face forward at first, above the origin, its lowest joint at 0.

    With ``follow``, or if it leads far away, the pelvis stays above the origin all the time.
    Without a skeleton nothing is turned, and the middle of the joints stands for the pelvis.
    """
    if skeleton is None:
        turn, way = np.eye(3), _known(mean_of_seen(x, axis=1), "joints")
    else:
        left, right, pelvis = map(skeleton.index_of, ("left_hip", "right_hip", "pelvis"))
        turn = heading(unit(_known(x[:, left] - x[:, right], "hips")[:1]))[0]
        way = _known(x[:, pelvis], "pelvis")
    floor, top = np.nanmin(x[..., 1]), np.nanmax(x[..., 1])
    follow = follow or np.ptp(way[:, [0, 2]], axis=0).max() > _FAR * (top - floor)
    origin = way if follow else np.repeat(way[:1], len(x), axis=0)
    origin[:, 1] = floor
    return (x - origin[:, np.newaxis]) @ turn.T


def _known(track, what):
    """A track (n_frames, 3) with its gaps bridged."""
    seen = np.flatnonzero(np.isfinite(track).all(axis=1))
    if len(seen) == 0:
        raise ValueError(
            f"No frame shows the {what}, so there is no telling where people stand and face."
        )
    frames = np.arange(len(track))
    return np.column_stack([np.interp(frames, seen, column[seen]) for column in track.T])


def on_screen(x, azimuth):
    """(n_frames, n_joints, 2) places across and up, as seen from far away at eye level."""
    a = np.deg2rad(azimuth)
    across = x @ np.array([np.cos(a), 0, -np.sin(a)])
    return np.stack([across, x[..., 1]], axis=-1)


def bones_by_side(skeleton):
    """Bones by the side of the body they hang on: below a hip or shoulder, or in the middle."""
    if skeleton is None:
        return {"left": [], "middle": [], "right": []}
    side_of = {}
    for side in ("left", "right"):
        for landmark in ("hip", "shoulder"):
            side_of[skeleton.index_of(f"{side}_{landmark}")] = side
    bones = {"left": [], "middle": [], "right": []}
    for parent, joint in skeleton.bones:
        above, seen = joint, set()
        while above >= 0 and above not in side_of and above not in seen:
            seen.add(above)
            above = skeleton.parents[above]
        bones[side_of.get(above, "middle")].append((parent, joint))
    return bones


def bodies_of(space, mean):
    """A function from points of a space to bodies (n, 15, 3) on the floor of the mean performance.

    A performance of its own would be put on a floor of its own.
    """
    if not hasattr(space, "inverse_transform"):
        names = [type(step).__name__ for _, step in space.steps]
        raise ValueError(
            "Stick figures of a model need steps with inverse_transform before the synchronizer; "
            f"they are {names}. Use from_postures with postures of your own."
        )

    def bodies(points):
        together = np.asarray(space.inverse_transform(np.concatenate([mean, points])))
        return together[len(mean) :].reshape(len(points), -1, 3)

    return bodies


def bodies_of_postures(performances, cosines):
    """Joint positions of performances given by direction cosines."""
    if not hasattr(cosines, "inverse_transform"):
        got = type(cosines).__name__
        raise ValueError(f"cosines must be a fitted DirectionCosines, got {got}.")
    # Single postures over each other are no set of performances.
    if len(performances) > 1 and all(len(x) > 1 for x in performances):
        return cosines.inverse_transform(performances)
    return [cosines.inverse_transform(x) for x in performances]


def limits(places):
    """The lowest and the highest coordinate (2,) of places, some way apart."""
    low, high = np.nanmin(places, axis=0), np.nanmax(places, axis=0)
    least = _FLAT * (high - low).max() or 1.0
    lacking = np.maximum(least - (high - low), 0) / 2
    return low - lacking, high + lacking
