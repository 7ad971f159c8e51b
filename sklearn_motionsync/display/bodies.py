"""Bodies to be drawn: put upright, turned the same way, seen from a side."""

import numpy as np

from ..body.axes import heading_axes, to_y_up
from ..body.limbs import unit_vectors
from ..body.skeleton import check_columns
from ..inputs.numbers import as_numbers, column_names
from .given import mean_of_seen

__all__ = [
    "bodies_of",
    "bodies_of_postures",
    "bones_by_side",
    "limits",
    "on_screen",
    "place_of",
    "placed",
    "upright",
    "with_landmarks",
]

# How far people may walk, in their heights, before the picture follows them.
_FAR = 0.75
# Pictures are at least so high and wide, as a share of the other.
_FLAT = 0.05
# What squares and products of coordinates bear.
_LARGEST = 1e150


def upright(x, skeleton, i):
    """(n_frames, n_joints, n_dims) of (n_frames, n_dims * n_joints), the second axis vertical.

    Without a skeleton the second axis is taken for vertical, and three axes are unless the names of
    the columns or their number say two.
    """
    what = f"Performance {i}"
    if skeleton is not None:
        check_columns(x, skeleton, what)
        n_dims, n_joints = skeleton.n_dims, len(skeleton.joints)
    names = column_names(x) or ()
    x = as_numbers(x, what, dtype=np.float64)
    if skeleton is None:
        width = x.shape[-1] if x.ndim > 0 else 0
        named = [str(name)[-2:] for name in names] == ["_x", "_y"] * (len(names) // 2)
        n_dims = 2 if width % 2 == 0 and (width % 3 or (names and named)) else 3
        n_joints = width // n_dims
    if x.ndim != 2 or x.shape[1] != n_dims * n_joints or x.size == 0:
        whose, width = "joints", "3 * n_joints"
        if skeleton is not None:
            whose, width = f"the skeleton's {n_joints} joints", n_dims * n_joints
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
    points = x.reshape(len(x), -1, n_dims)
    return points if skeleton is None else to_y_up(points, skeleton)


def placed(x, skeleton, *, follow=False):
    """A performance turned to face forward at first, above the origin, its lowest joint at 0.

    With ``follow``, or if it leads far away, the pelvis stays above the origin all the time.
    Without a skeleton nothing is turned, and the middle of the joints stands for the pelvis. Who
    has no hips faces as the shoulders do; nobody is turned in a picture.
    """
    n_dims = x.shape[2]
    turn = np.eye(n_dims)
    across = None if skeleton is None or n_dims == 2 else _side_by_side(skeleton)
    if across is not None:
        left, right = (place_of(x, skeleton, f"{side}_{across}") for side in ("left", "right"))
        turn = heading_axes(unit_vectors(_known(left - right, f"{across}s")[:1]))[0]
    if skeleton is not None and "pelvis" in skeleton.landmarks:
        way = _known(place_of(x, skeleton, "pelvis"), "pelvis")
    else:
        way = _known(mean_of_seen(x, axis=1), "joints")
    floor, top = np.nanmin(x[..., 1]), np.nanmax(x[..., 1])
    # Over the ground, or across the picture.
    walked = np.ptp(np.delete(way, 1, axis=1), axis=0).max()
    follow = follow or walked > _FAR * (top - floor)
    origin = way if follow else np.repeat(way[:1], len(x), axis=0)
    origin[:, 1] = floor
    return (x - origin[:, np.newaxis]) @ turn.T


def place_of(x, skeleton, landmark):
    """Where a landmark is: (n_frames, n_dims)."""
    return x[:, list(skeleton.indices_of(landmark))].mean(axis=1)


def _side_by_side(skeleton):
    """The landmarks of both sides that tell how a body faces; None if there are none."""
    pairs = [
        part
        for part in ("hip", "shoulder")
        if {f"left_{part}", f"right_{part}"} <= set(skeleton.landmarks)
    ]
    return pairs[0] if pairs else None


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
    """(n_frames, n_joints, 2) places across and up, as seen from far away at eye level.

    A picture is seen as it is.
    """
    if x.shape[-1] == 2:
        return x
    a = np.deg2rad(azimuth)
    across = x @ np.array([np.cos(a), 0, -np.sin(a)])
    return np.stack([across, x[..., 1]], axis=-1)


def with_landmarks(x, skeleton):
    """The joints, and after them the landmarks, if limbs are drawn between these."""
    if skeleton is None or not _has_limbs_of_its_own(skeleton):
        return x
    landmarks = [place_of(x, skeleton, name) for name in skeleton.body().joints]
    return np.concatenate([x, np.stack(landmarks, axis=1)], axis=1)


def _has_limbs_of_its_own(skeleton):
    """Whether bones do not show the limbs: there are none, or a landmark is a mean of joints."""
    means = any(len(skeleton.indices_of(name)) > 1 for name in skeleton.landmarks)
    return means or not skeleton.bones


def bones_by_side(skeleton):
    """Bones by the side of the body they hang on: below a hip or shoulder, or in the middle.

    Limbs of their own are between the landmarks after the joints, in place of bones between these.
    """
    bones = {"left": [], "middle": [], "right": []}
    if skeleton is None:
        return bones
    own = skeleton.bones
    if _has_limbs_of_its_own(skeleton):
        body, count = skeleton.body(), len(skeleton.joints)
        for side, of_side in bones_by_side(body).items() if body.bones else ():
            bones[side] += [(a + count, b + count) for a, b in of_side]
        joints = {j for name in skeleton.landmarks for j in skeleton.indices_of(name)}
        own = [bone for bone in own if not set(bone) <= joints]
    side_of = {}
    # Knees and elbows, for whoever has no hips and shoulders.
    for part in ("hip", "shoulder", "knee", "elbow", "ankle", "wrist"):
        for side in ("left", "right"):
            if f"{side}_{part}" in skeleton.landmarks:
                for joint in skeleton.indices_of(f"{side}_{part}"):
                    side_of.setdefault(joint, side)
    for parent, joint in own:
        sides = [_side_above(j, skeleton, side_of) for j in (parent, joint)]
        # What goes from one side to the other is on none.
        crosses = None not in sides and sides[0] != sides[1]
        bones["middle" if crosses or sides[1] is None else sides[1]].append((parent, joint))
    return bones


def _side_above(joint, skeleton, side_of):
    """The side of a joint, or of the nearest above it that has one."""
    while joint >= 0:
        if joint in side_of:
            return side_of[joint]
        joint = skeleton.parents[joint]
    return None


def bodies_of(space, mean, n_dims):
    """A function from points of a space to bodies (n, n_landmarks, n_dims) on the mean's floor.

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
        return together[len(mean) :].reshape(len(points), -1, n_dims)

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
