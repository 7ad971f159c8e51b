"""Bodies to be drawn: put upright, turned the same way, seen from a side."""

import numpy as np

from ..body.axes import heading
from ..body.limbs import y_up

__all__ = ["bones_by_side", "on_screen", "placed", "upright"]

# How far people may walk, in their heights, before the picture follows them.
_FAR = 0.75


def upright(x, skeleton, i):
    """(n_frames, n_joints, 3) of (n_frames, 3 n_joints), with the second axis vertical."""
    x = np.asarray(x, dtype=np.float64)
    if x.ndim != 2 or x.shape[1] != 3 * len(skeleton.joints):
        raise ValueError(
            f"Performance {i} has shape {x.shape}, but the positions of the skeleton's "
            f"{len(skeleton.joints)} joints are (n_frames, {3 * len(skeleton.joints)})."
        )
    return y_up(x.reshape(len(x), -1, 3), skeleton)


def placed(x, skeleton, *, follow=False):
    """A performance turned to face forward at first, above the origin, its lowest joint at 0.

    With ``follow``, or if it leads far away, the pelvis stays above the origin all the time.
    """
    left, right, pelvis = map(skeleton.index_of, ("left_hip", "right_hip", "pelvis"))
    hip = _known(x[:, left] - x[:, right], "hips")[:1]
    turn = heading(hip / max(np.linalg.norm(hip), np.finfo(float).tiny))[0]
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
