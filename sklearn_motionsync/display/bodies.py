"""Joint positions for stick figures: vertical, turned to one heading, and projected."""

from copy import copy

import numpy as np

from ..body.axes import heading_axes, to_y_up
from ..body.columns import check_columns
from ..body.direction_cosines import DirectionCosines
from ..body.formats import AXES
from ..body.limbs import unit_vectors
from ..body.skeleton import Skeleton, loose_joints
from ..inputs.columns import parse_columns
from ..inputs.numbers import as_numbers, check_finite, column_names, nanmean
from ..matching.gaps import interpolate_gaps
from .base import COLORS

# The picture follows a body that walks farther than this, in heights of the body.
_FAR = 0.75
# The smallest ratio of the sides of a picture.
_FLAT = 0.05


def read_positions(x, skeleton, i):
    """Positions (n_frames, n_joints, n_dims) of one trial, the second axis vertical.

    Parameters
    ----------
    x : array-like, shape (n_frames, n_dims * n_joints)
        NaN where a joint was not seen. Joints that nothing is joined to become NaN.
    skeleton : Skeleton or None
        Without a skeleton the second axis is vertical. There are three axes, or two if the names of
        the columns or their number imply it.
    i : int
        The index of the trial, for messages.
    """
    if skeleton is not None and not isinstance(skeleton, Skeleton):
        raise ValueError(
            "skeleton must be a Skeleton, such as Skeleton.paper() or bunch.skeleton, or None for "
            f"points without bones; got {type(skeleton).__name__}."
        )
    what = f"Trial {i}"
    if skeleton is not None:
        wanted = skeleton.column_names
        if set(column_names(x) or ()) == set(wanted) and len(x.columns) == len(wanted):
            x = x[wanted]
        check_columns(column_names(x) or (), skeleton, what)
        n_dims, n_joints = skeleton.n_dims, len(skeleton.joints)
        expected = f"the skeleton's {n_joints} joints are (n_frames, {n_dims * n_joints})"
    names = column_names(x) if skeleton is None else None
    axes = ""
    if names and not (columns := parse_columns(names)).rest:
        x, axes = x[[names[place] for place in columns.places.ravel()]], columns.axes
    x = as_numbers(x, what, dtype=np.float64)
    if skeleton is None:
        if x.ndim == 3 and x.shape[2] in AXES:
            x, axes = x.reshape(len(x), -1), AXES[x.shape[2]]
        width = x.shape[-1] if x.ndim > 0 else 0
        n_dims = len(axes) or (2 if width % 2 == 0 and width % 3 else 3)
        n_joints = width // n_dims
        expected = "joints are (n_frames, 3 * n_joints)"
    if x.ndim != 2 or x.shape[1] != n_dims * n_joints or x.size == 0:
        raise ValueError(f"{what} has shape {x.shape}, but the positions of {expected}.")
    check_finite(x, f"{what}, frame", allow_nan=True)
    points = x.reshape(len(x), -1, n_dims)
    if skeleton is None:
        return points
    points, loose = to_y_up(points, skeleton), loose_joints(skeleton)
    if loose:
        points = points.copy()
        points[:, loose] = np.nan
    return points


def place_on_floor(x, skeleton, *, follow=False):
    """Positions turned to face forward in the first frame, the lowest joint of all frames at 0.

    The pelvis is above the origin in the first frame; with ``follow``, or if the body walks far,
    in all frames. Without a skeleton the positions are not turned, and the mean of the joints
    replaces the pelvis. Without hips the shoulders determine the heading. Positions in a plane are
    never turned.
    """
    n_dims = x.shape[2]
    rotation = np.eye(n_dims)
    named = set() if skeleton is None or n_dims == 2 else set(skeleton.landmarks)
    pairs = [part for part in ("hip", "shoulder") if {f"left_{part}", f"right_{part}"} <= named]
    if pairs:
        left, right = (landmark_track(x, skeleton, f"{s}_{pairs[0]}") for s in ("left", "right"))
        rotation = heading_axes(unit_vectors(_fill_gaps(left - right, f"{pairs[0]}s")[:1]))[0]
    if skeleton is not None and "pelvis" in skeleton.landmarks:
        track = _fill_gaps(landmark_track(x, skeleton, "pelvis"), "pelvis")
    else:
        track = _fill_gaps(nanmean(x, axis=1), "joints")
    floor, top = np.nanmin(x[..., 1]), np.nanmax(x[..., 1])
    # Over the ground, or across the picture.
    walked = np.ptp(np.delete(track, 1, axis=1), axis=0).max()
    follow = follow or walked > _FAR * (top - floor)
    origin = track if follow else np.repeat(track[:1], len(x), axis=0)
    origin[:, 1] = floor
    return (x - origin[:, np.newaxis]) @ rotation.T


def landmark_track(x, skeleton, landmark):
    """Positions (n_frames, n_dims) of a landmark."""
    return x[:, list(skeleton.indices_of(landmark))].mean(axis=1)


def _fill_gaps(track, what):
    """A track (n_frames, n_dims) with straight lines across its gaps."""
    if np.isnan(track).any(axis=1).all():
        raise ValueError(
            f"No frame shows the {what}, so the place and the heading of the body are unknown."
        )
    return interpolate_gaps(track, held=True, way="line")


def project(x, skeleton, azimuth):
    """Positions (n_frames, n_points, 2) on the screen, seen from far away at eye level.

    Positions in a plane are used as they are. The points are the joints and, if limbs are drawn
    between landmarks, these after the joints.
    """
    if skeleton is not None and _joins_landmarks(skeleton):
        landmarks = [landmark_track(x, skeleton, name) for name in skeleton.body().joints]
        x = np.concatenate([x, np.stack(landmarks, axis=1)], axis=1)
    if x.shape[-1] == 2:
        return x
    a = np.deg2rad(azimuth)
    across = x @ np.array([np.cos(a), 0, -np.sin(a)])
    return np.stack([across, x[..., 1]], axis=-1)


def _joins_landmarks(skeleton):
    """Whether limbs are drawn between landmarks: a landmark is a mean, or there are no bones."""
    means = any(len(skeleton.indices_of(name)) > 1 for name in skeleton.landmarks)
    return means or not skeleton.bones


def bones_by_side(skeleton):
    """Bones by the side of the body: below a hip or shoulder, or in the middle.

    Limbs between landmarks, which follow the joints, replace the bones between joints that stand
    for landmarks.
    """
    bones = {"left": [], "middle": [], "right": []}
    if skeleton is None:
        return bones
    own = skeleton.bones
    if _joins_landmarks(skeleton):
        body, count = skeleton.body(), len(skeleton.joints)
        for side, of_side in bones_by_side(body).items() if body.bones else ():
            bones[side] += [(a + count, b + count) for a, b in of_side]
        joints = {j for name in skeleton.landmarks for j in skeleton.indices_of(name)}
        own = [bone for bone in own if not set(bone) <= joints]
    side_of = {}
    # The lower joints serve skeletons without hips and shoulders.
    for part in ("hip", "shoulder", "knee", "elbow", "ankle", "wrist"):
        for side in ("left", "right"):
            if f"{side}_{part}" in skeleton.landmarks:
                for joint in skeleton.indices_of(f"{side}_{part}"):
                    side_of.setdefault(joint, side)
    for parent, joint in own:
        sides = [_side_of(j, skeleton, side_of) for j in (parent, joint)]
        # A bone from one side to the other belongs to the middle.
        crosses = None not in sides and sides[0] != sides[1]
        bones["middle" if crosses or sides[1] is None else sides[1]].append((parent, joint))
    return bones


def _side_of(joint, skeleton, side_of):
    """The side of a joint, or of its nearest ancestor that has one."""
    while joint >= 0:
        if joint in side_of:
            return side_of[joint]
        joint = skeleton.parents[joint]
    return None


def invert_poses(x, inverse, skeleton):
    """Positions (n_frames, n_joints, n_dims) of poses; NaN where they are unknown.

    Parameters
    ----------
    x : array-like, shape (n_frames, n_features)
        NaN where a feature was not observed.
    inverse : DirectionCosines, or Pipeline with ``inverse_transform``
        Cosines leave out the limbs with NaN; a pipeline leaves out the whole body.
    skeleton : Skeleton
        The skeleton of the positions.
    """
    x = np.asarray(x)
    known = ~np.isnan(x).any(axis=1)
    if isinstance(inverse, DirectionCosines):
        inverse, known = copy(inverse).set_params(hidden="nan"), np.ones(len(x), dtype=bool)
    positions = np.full((len(x), len(skeleton.joints) * skeleton.n_dims), np.nan)
    if known.any():
        positions[known] = np.asarray(inverse.inverse_transform(x[known]))
    return positions.reshape(len(x), -1, skeleton.n_dims)


def bounds(places):
    """The lowest and the highest coordinates (2,) of places, apart by a smallest distance."""
    low, high = np.nanmin(places, axis=0), np.nanmax(places, axis=0)
    least = _FLAT * (high - low).max() or 1.0
    lacking = np.maximum(least - (high - low), 0) / 2
    return low - lacking, high + lacking


def stage(axis, title, low, high):
    """Prepare axes for stick figures between two corners (2,): a floor, and no scales."""
    margin = 0.05 * (high - low)
    axis.set_xlim(low[0] - margin[0], high[0] + margin[0])
    axis.set_ylim(low[1] - margin[1], high[1] + margin[1])
    axis.set_aspect("equal", anchor="S")
    axis.set_title(title, fontsize="medium")
    axis.set_yticks([])
    axis.grid(False)
    axis.set_xticks([])
    axis.spines[:].set_visible(False)
    axis.axhline(0, color="0.6", linewidth=1, zorder=0)
    axis.tick_params(length=0)


class BodyPanel:
    """The bodies of a panel: bones by side, dots, and pale shadows behind them.

    Parameters
    ----------
    axis : Axes
    skeleton : Skeleton or None
    marked : list of (int, int), default=None
        Violet bones; all others are then grey.
    alpha : float, default=1.0
        The opacity of bodies in one place, which are thinner.

    Attributes
    ----------
    bones : dict of str to LineCollection
        The bones of each side, and the ``"departing"`` ones. Each body is one line with gaps.
    dots : Line2D
        The heads; without bones all joints.
    shadows : LineCollection
    """

    def __init__(self, axis, skeleton, *, marked=None, alpha=1.0):
        self._skeleton, by_side = skeleton, bones_by_side(skeleton)
        self._bones = by_side
        self._all = [bone for bones in by_side.values() for bone in bones]
        width = 2.2 if alpha == 1 else 1.1
        colors = {side: COLORS[side] for side in by_side}
        if marked is not None:
            colors = dict.fromkeys(by_side, COLORS["quiet"])
            self._bones = {
                side: [bone for bone in bones if bone not in marked]
                for side, bones in by_side.items()
            }
        self.shadows = _bone_lines(axis, COLORS["shadow"], 3 * width, 1.0, 1)
        self.bones = {side: _bone_lines(axis, c, width, alpha, 2) for side, c in colors.items()}
        if marked is not None:
            self._bones["departing"] = marked
            self.bones["departing"] = _bone_lines(axis, COLORS["departure"], 2 * width, alpha, 3)
        joined = skeleton is not None and skeleton.bones
        size = 3 * width if joined else 1.5 * width
        (self.dots,) = axis.plot([], [], "o", color=colors["middle"], alpha=alpha, markersize=size)

    def show(self, bodies, shadows=()):
        """Move to bodies, each (n_points, 2)."""
        for side, lines in self.bones.items():
            lines.set_segments(_segments(bodies, self._bones[side]))
        self.shadows.set_segments(_segments(shadows, self._all))
        skeleton, dots = self._skeleton, []
        for body in bodies:
            if skeleton is None or not skeleton.bones:
                dots.append(body if skeleton is None else body[: len(skeleton.joints)])
            elif "head" in skeleton.landmarks:
                dots.append(landmark_track(body[np.newaxis], skeleton, "head"))
        self.dots.set_data(np.concatenate(dots).T if dots else ([], []))


def _bone_lines(axis, color, width, alpha, zorder):
    """An empty artist for the bones of stick figures."""
    from matplotlib.collections import LineCollection

    lines = LineCollection([], colors=color, linewidths=width, alpha=alpha, zorder=zorder)
    lines.set_capstyle("round")
    return axis.add_collection(lines, autolim=False)


def _segments(bodies, bones):
    """The bones of each body as one line with gaps: matplotlib draws few long lines faster."""
    if not bones or not len(bodies):
        return []
    lines, ends = np.full((len(bodies), len(bones), 3, 2), np.nan), np.array(bones)
    for line, body in zip(lines, bodies, strict=True):
        line[:, :2] = body[ends]
    return list(lines.reshape(len(bodies), -1, 2))
