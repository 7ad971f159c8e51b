"""Rigs: trees of joints with offsets at rest, and the rotations that bring them to positions."""

import warnings
from typing import NamedTuple

import numpy as np
from scipy.spatial.transform import Rotation

__all__ = ["Rig", "add_middles", "make_rig", "solve_rig"]

# Bones of a body whose median lengths differ from those of the rig by more than this share are as
# long as in the body.
_SAME_LENGTH = 1e-3
# Steps of a joint with one or two axes, and degrees by which its slopes are found.
_STEPS, _STEP = 12, 1e-4
# Shorter than this share of the longest bone, an offset has no direction.
_NO_LENGTH = 1e-6


class Rig(NamedTuple):
    """A tree of joints at rest, y up.

    Attributes
    ----------
    joints : list of str
    parents : list of int
        Index of each joint's parent, which comes before it; -1 for roots.
    offsets : list of list of float
        From the parent of a joint to the joint, at rest.
    channels : list of list of str
        Such as ``["Xposition", ..., "Zrotation", ...]``, of each joint; none of an end site.
    """

    joints: list
    parents: list
    offsets: list
    channels: list

    def free_axes(self, j):
        """Whether a joint moves along x, y and z in its parent."""
        return [f"{axis}position" in self.channels[j] for axis in "XYZ"]

    def turns(self, j):
        """The axes about which a joint turns, in the order of its channels."""
        return "".join(name[0] for name in self.channels[j] if name.endswith("rotation"))

    def is_end(self, j):
        """Whether a joint is an end site, which neither turns nor moves."""
        return not self.channels[j] and j not in self.parents

    @classmethod
    def from_attrs(cls, attrs):
        """The rig in the ``attrs`` of a table; None without one."""
        rig = attrs.get("rig")
        if rig is None:
            return None
        return cls(attrs["joints"], attrs["parents"], rig["offsets"], rig["channels"])


def add_middles(joints, parents, points):
    """A body with a joint in the middle of two that keep their distance, but not from the parent.

    So are hips that were moved from the pelvis by one height, whatever way it turns. The middle,
    ``<parent>_middle``, keeps its distance from the parent, and both joints that from the middle.

    Parameters
    ----------
    joints : list of str
    parents : list of int
    points : ndarray, shape (n_frames, n_joints, 3)

    Returns
    -------
    joints, parents, points :
        The same with more joints at the end.
    """
    joints, parents = list(joints), list(parents)

    def varies(start, end):
        lengths = np.linalg.norm(end - start, axis=1)
        return np.ptp(lengths) > _SAME_LENGTH * lengths.max()

    for parent in range(len(joints)):
        children = [j for j, above in enumerate(parents) if above == parent]
        at = points[:, parent]
        loose = [j for j in children if varies(at, points[:, j])]
        if len(loose) == 2:
            pair = points[:, loose]
            middle = pair.mean(axis=1)
            if not varies(*pair.swapaxes(0, 1)) and not varies(at, middle):
                for j in loose:
                    parents[j] = len(joints)
                joints.append(f"{joints[parent]}_middle")
                parents.append(parent)
                points = np.concatenate([points, middle[:, np.newaxis]], axis=1)
    return joints, parents, points


def make_rig(joints, parents, points):
    """A rig of a body that has none: at rest it is as in its first frame.

    Children of one joint turn by themselves: each hangs on a joint of its own in the same place,
    ``<child>_pivot``.

    Parameters
    ----------
    joints : list of str
    parents : list of int
    points : ndarray, shape (n_frames, n_joints, 3)
    """
    turns = ["Zrotation", "Xrotation", "Yrotation"]
    moves = ["Xposition", "Yposition", "Zposition"]
    rig, new = Rig([], [], [], []), {-1: -1}

    def add(name, parent, offset, channels):
        for values, value in zip(rig, (name, parent, offset, channels), strict=True):
            values.append(value)
        return len(rig.joints) - 1

    for j in _parents_first(parents):
        above = new[parents[j]]
        if parents[j] < 0:
            new[j] = add(joints[j], -1, points[0, j].tolist(), moves + turns)
            continue
        if parents.count(parents[j]) > 1:
            above = add(f"{joints[j]}_pivot", above, [0.0] * 3, turns)
        offset = (points[0, j] - points[0, parents[j]]).tolist()
        new[j] = add(joints[j], above, offset, turns)
    return rig


def solve_rig(rig, points):
    """The channels of a rig at positions.

    Every joint turns as far as it must for its children to lie in their directions, by least
    squares where there are several. Bones keep their length: that of the rig, or the median of the
    positions if it differs.

    Parameters
    ----------
    rig : Rig
    points : ndarray, shape (n_frames, n_joints, 3)
        Positions of its joints, y up; NaN of an end site that is not known.

    Returns
    -------
    channels : ndarray, shape (n_frames, n_channels)
        Positions, and degrees.
    offsets : ndarray, shape (n_joints, 3)
        Those of the rig, with the lengths of the body.
    """
    n_frames, n_joints = points.shape[:2]
    offsets = _fit_lengths(rig, points)
    seen, axes = ~np.isnan(points).any(axis=(0, 2)), [None] * n_joints
    placed, columns = np.empty_like(points), []
    for j, parent in enumerate(rig.parents):
        above = axes[parent] if parent >= 0 else np.broadcast_to(np.eye(3), (n_frames, 3, 3))
        start = placed[:, parent] if parent >= 0 else 0
        moved, free = np.tile(offsets[j], (n_frames, 1)), rig.free_axes(j)
        if any(free):
            moved[:, free] = np.einsum("tba,tb->ta", above, points[:, j] - start)[:, free]
        placed[:, j] = start + np.einsum("tab,tb->ta", above, moved)
        order, angles = rig.turns(j), np.zeros((n_frames, len(rig.turns(j))))
        held = [(k, place) for k, place in _held_by(rig, offsets, j) if seen[k]]
        if held and order:
            at_rest = np.array([place for _, place in held])
            ways = points[:, [k for k, _ in held]] - placed[:, j, np.newaxis]
            ways = np.einsum("tba,tkb->tka", above, ways)
            if len(order) == 3:
                turn = _rotation(at_rest, ways)
                if len(held) == 1:
                    turn = _reach_hinge(rig, offsets, points, held[0], placed[:, j], above, turn)
                angles = _angles(order, turn)
            else:
                angles = _few_angles(order, at_rest, ways)
        axes[j] = above @ _turn(order, angles)
        values = {f"{axis}rotation": angle for axis, angle in zip(order, angles.T, strict=True)}
        values |= dict(zip(("Xposition", "Yposition", "Zposition"), moved.T, strict=True))
        columns += [values[name] for name in rig.channels[j]]
    return np.stack(columns, axis=1), offsets


def _held_by(rig, offsets, j):
    """Joints that turn with a joint as one body, and where they are at rest from it."""
    held, stack = [], [(j, np.zeros(3))]
    sizes = np.linalg.norm(offsets, axis=1)
    while stack:
        above, at = stack.pop()
        for k, parent in enumerate(rig.parents):
            if parent == above and not any(rig.free_axes(k)):
                place = at + offsets[k]
                if np.linalg.norm(place) > _NO_LENGTH * sizes.max():
                    held.append((k, place))
                if not rig.turns(k):
                    stack.append((k, place))
    return held


def _reach_hinge(rig, offsets, points, held, start, above, turn):
    """The turn of a joint, twisted about its bone so that a hinge at the end reaches its child.

    A hinge keeps the angle between its axis and its child, which leaves two twists.
    """
    k, at_rest = held
    below = _held_by(rig, offsets, k)
    if len(rig.turns(k)) != 1 or not below or np.isnan(points[:, below[0][0]]).any():
        return turn
    child, at = below[0]
    hinge = np.eye(3)["XYZ".index(rig.turns(k))]
    bone = turn @ (at_rest / np.linalg.norm(at_rest))
    knee = start + np.einsum("tab,tb->ta", above, turn @ at_rest)
    way = np.einsum("tba,tb->ta", above, points[:, child] - knee)
    way /= np.linalg.norm(way, axis=1, keepdims=True)
    axis = turn @ hinge
    along = np.einsum("ta,ta->t", axis, bone)[:, np.newaxis] * bone
    across, normal = axis - along, np.cross(bone, axis)
    # cos(twist) a + sin(twist) b = c
    a, b = np.einsum("ta,ta->t", across, way), np.einsum("ta,ta->t", normal, way)
    c = hinge @ at / np.linalg.norm(at) - np.einsum("ta,ta->t", along, way)
    middle, half = (
        np.arctan2(b, a),
        np.arccos(np.clip(c / np.maximum(np.hypot(a, b), 1e-300), -1, 1)),
    )
    twists = np.stack([middle - half, middle + half])
    twists = np.arctan2(np.sin(twists), np.cos(twists))
    twist = np.where(np.abs(twists[0]) < np.abs(twists[1]), twists[0], twists[1])
    return Rotation.from_rotvec(bone * twist[:, np.newaxis]).as_matrix() @ turn


def _parents_first(parents):
    """Joints, each after its parent and before what is not below it."""
    order, stack = [], [j for j, parent in enumerate(parents) if parent < 0][::-1]
    while stack:
        j = stack.pop()
        order.append(j)
        stack += [k for k, parent in enumerate(parents) if parent == j][::-1]
    return order


def _fit_lengths(rig, points):
    """The offsets, with the median lengths of bones where those of the rig differ."""
    offsets = np.array(rig.offsets, dtype=np.float64)
    for j, parent in enumerate(rig.parents):
        length = np.linalg.norm(offsets[j])
        # A pivot is where its parent is.
        while parent >= 0 and np.isnan(points[:, parent]).any():
            parent = rig.parents[parent]
        if parent < 0 or length == 0 or any(rig.free_axes(j)) or np.isnan(points[:, j]).any():
            continue
        measured = float(np.median(np.linalg.norm(points[:, j] - points[:, parent], axis=1)))
        if abs(measured - length) > _SAME_LENGTH * length:
            offsets[j] *= measured / length
    return offsets


def _rotation(rest, ways):
    """Rotations (n_frames, 3, 3) of vectors (n, 3) towards others (n_frames, n, 3)."""
    along = ways / np.maximum(np.linalg.norm(ways, axis=2, keepdims=True), 1e-300)
    unit = rest / np.linalg.norm(rest, axis=1, keepdims=True)
    weights = np.linalg.norm(rest, axis=1)
    # Vectors on one line leave the turn about it open: then the smallest rotation is taken.
    if np.linalg.matrix_rank(unit, tol=1e-4) == 1:
        return _smallest(unit[weights.argmax()], along[:, weights.argmax()])
    product = np.einsum("tka,kb->tab", along * weights[:, np.newaxis], unit)
    u, _, vt = np.linalg.svd(product)
    sign = np.sign(np.linalg.det(u @ vt))
    u = u * np.stack([np.ones_like(sign), np.ones_like(sign), sign], axis=1)[:, np.newaxis]
    return u @ vt


def _smallest(start, ends):
    """The smallest rotations (n_frames, 3, 3) from a unit vector to others (n_frames, 3)."""
    axis, cosine = np.cross(start, ends), ends @ start
    # Opposite vectors turn about any normal.
    other = np.cross(start, np.eye(3)[np.abs(start).argmin()])
    other /= np.linalg.norm(other)
    opposite = cosine < -1 + 1e-12
    angle = np.arctan2(np.linalg.norm(axis, axis=1), cosine)
    size = np.linalg.norm(axis, axis=1, keepdims=True)
    axis = np.where(opposite[:, np.newaxis], other, axis / np.where(size > 0, size, 1))
    return Rotation.from_rotvec(axis * angle[:, np.newaxis]).as_matrix()


def _angles(order, turn):
    """Rotations (n_frames, 3, 3) as degrees (n_frames, 3) about three axes, without jumps."""
    with warnings.catch_warnings():
        # Where two axes coincide either angle will do.
        warnings.simplefilter("ignore", UserWarning)
        angles = Rotation.from_matrix(turn).as_euler(order)
    return np.degrees(np.unwrap(angles, axis=0))


def _few_angles(order, at_rest, ways):
    """Degrees about one or two axes that bring vectors to others, by steps of Gauss and Newton.

    They begin at the best of some angles.
    """
    tries = np.stack(np.meshgrid(*[np.arange(0, 360, 30.0)] * len(order)), axis=-1)
    tries = tries.reshape(-1, len(order))
    turned = np.einsum("nab,kb->nka", _turn(order, tries), at_rest)
    angles = tries[np.einsum("tka,nka->tn", ways, turned).argmax(axis=1)]
    for _ in range(_STEPS):
        moved = _turn(order, angles) @ at_rest.T
        slopes = [
            (_turn(order, angles + step) @ at_rest.T - moved).reshape(len(ways), -1) / _STEP
            for step in _STEP * np.eye(len(order))
        ]
        residuals = (ways.transpose(0, 2, 1) - moved).reshape(len(ways), -1)
        slopes = np.stack(slopes, axis=2)
        angles = angles + np.einsum("tpm,tm->tp", np.linalg.pinv(slopes), residuals)
    return np.degrees(np.unwrap(np.radians(angles), axis=0))


def _turn(order, angles):
    """Rotations (n, 3, 3) by degrees (n, n_axes), each axis turned by those before it."""
    if not order:
        return np.broadcast_to(np.eye(3), (len(angles), 3, 3))
    return Rotation.from_euler(order, angles, degrees=True).as_matrix().reshape(-1, 3, 3)
