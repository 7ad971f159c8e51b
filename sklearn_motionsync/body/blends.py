"""Blends of bodies: directions on the sphere, headings on the circle, paths and standing feet."""

from typing import NamedTuple

import numpy as np
from scipy.linalg import solveh_banded
from scipy.ndimage import grey_opening

from ..matching.warps import at_times
from .axes import from_y_up, heading_axes, project_on_axes, to_y_up
from .formats import LANDMARKS, SIDES
from .landmarks import MIDPOINTS, as_tuple, guess_feet
from .limbs import (
    LATERAL_LIMBS,
    LIMBS,
    body_size,
    complete_legs,
    landmark_positions,
    limb_vectors,
    unit_vectors,
)
from .skeleton import loose_joints
from .sphere import mean_direction, mean_length, mean_vector

# A shorter link, in sizes of the body, has no direction.
_LEAST_LENGTH = 1e-6
# A link whose length changes by a smaller share is rigid.
_SAME_LENGTH = 0.01
# Hips whose horizontal part is smaller, as a share of their length, show no heading: within 17
# degrees of the vertical it jumps by half a turn. The smallest of 343 real trials is 0.33.
_LEAST_HORIZONTAL = 0.3


def blend_numbers(arrays, frames, weights):
    """Weighted sums (n_frames, ...) of sequences (n_frames_i, ...) at given frames.

    The frames (n, n_frames) of each sequence correspond, with fractions, and the weights of that
    shape have the sum 1 along the first axis.
    """
    pairs = zip(arrays, frames, weights, strict=True)
    return sum((at_times(x, f).T * w).T for x, f, w in pairs)


def blend_bodies(arrays, frames, weights, skeleton):
    """Blends of joint positions (n_frames_i, n_dims * n_joints), in space with feet that stand.

    They are checked and of one unit; frames and weights are those of `blend_numbers`.
    """
    structure = LinkStructure(skeleton)
    figures = [structure.decompose(x) for x in arrays]
    directed = structure.directed_links(figures)
    size = mean_length(np.array([[x.size] for x in figures]), weights)
    # Places and links are blended in units of the body.
    links = blend_numbers([x.links / x.size for x in figures], frames, weights)
    links *= size[:, np.newaxis, np.newaxis]
    # Vectors are blended in direction and in length.
    vectors = []
    for x, f in zip(figures, frames, strict=True):
        limbs, left = x.links[:, directed], np.minimum(f.astype(np.intp), len(x.links) - 2)
        share = f - left
        pair, shares = np.stack([limbs[left], limbs[left + 1]]), np.stack([1 - share, share])
        vectors.append(mean_vector(pair, shares[..., np.newaxis]))
    links[:, directed] = mean_vector(np.stack(vectors), weights[..., np.newaxis])
    angle, place = _blend_path(figures, frames, weights, size)
    place[:, 1] = _blend_heights([x.place[:, 1] for x in figures], figures, frames, weights, size)
    foot = _blend_heights([x.foot for x in figures], figures, frames, weights, size)
    points = structure.compose(links, place, angle, foot)
    if structure.legs:
        points = _hold_feet(points, structure, arrays, figures, angle, frames, weights, size)
    blend = structure.joints_of(points)
    for j in loose_joints(skeleton):
        columns = slice(skeleton.n_dims * j, skeleton.n_dims * (j + 1))
        columns_of_joint = [x[:, columns] for x in arrays]
        # What stands in the room does not turn with the body.
        if not any(np.ptp(x, axis=0).any() for x in columns_of_joint):
            blend[:, columns] = blend_numbers(columns_of_joint, frames, weights)
    return blend


def _blend_path(figures, frames, weights, size):
    """Heading (n_frames,) and place (n_frames, n_dims) of a blend: the means of the first frame,
    continued by weighted means of the steps.

    Each step is taken along the heading of its own body.
    """
    angles = np.stack([at_times(x.angle, f) for x, f in zip(figures, frames, strict=True)])
    first = np.stack([np.cos(angles[:, 0]), np.sin(angles[:, 0])], axis=1)
    start = mean_direction(first, weights[:, 0])
    between = _between(weights)
    rotation = (between * np.diff(angles, axis=1)).sum(axis=0)
    angle = np.arctan2(start[1], start[0]) + np.concatenate([[0], np.cumsum(rotation)])
    steps = 0
    for x, f, heading, w in zip(figures, frames, angles, between, strict=True):
        step = np.diff(at_times(x.place, f), axis=0)[:, np.newaxis] / x.size
        step = _rotate(step, _between(heading), inverse=True)[:, 0]
        steps = steps + w[:, np.newaxis] * step
    steps = steps * _between(size)[:, np.newaxis]
    steps = _rotate(steps[:, np.newaxis], _between(angle))[:, 0]
    begin = blend_numbers([x.place for x in figures], frames[:, :1], weights[:, :1])
    return angle, np.concatenate([begin, begin + np.cumsum(steps, axis=0)])


def _between(x):
    """Means of neighbouring frames, along the last axis."""
    return (x[..., 1:] + x[..., :-1]) / 2


def _blend_heights(tracks, figures, frames, weights, size):
    """Heights above each floor, blended in units of the body, on the mean floor."""
    floors = [x.foot.min() for x in figures]
    above_floor = [(x - y) / f.size for x, y, f in zip(tracks, floors, figures, strict=True)]
    return blend_numbers(above_floor, frames, weights) * size + weights[:, 0] @ floors


# -- bodies as links along axes that turn with them ---------------------------------------


class Figure(NamedTuple):
    """A trial as links, a path and a heading, y up.

    Attributes
    ----------
    links : ndarray, shape (n_frames, n_links, n_dims)
        Vectors from each point to the next one, along axes that turn with the body.
    place : ndarray, shape (n_frames, n_dims)
        Of the first point, in the recording.
    angle : ndarray, shape (n_frames,)
        Heading about the vertical axis, unwrapped.
    size : float
        The unit of length of the body.
    foot : ndarray, shape (n_frames,)
        Height of the lower ankle, or the lowest landmark of a body without ankles.
    """

    links: np.ndarray
    place: np.ndarray
    angle: np.ndarray
    size: float
    foot: np.ndarray


class LinkStructure:
    """The tree of links from point to point that the bodies of a skeleton are decomposed into.

    The twelve limbs join the landmarks; hips and shoulders are joined to the middle of their
    pair, and that to the pelvis and the neck. Every other joint is joined to its parent, or else
    to the first point.

    Parameters
    ----------
    skeleton : Skeleton

    Attributes
    ----------
    links : list of (int, int)
        Pairs of points, parent first; each link comes before those that start at its end. The
        first points are the joints.
    rigid : ndarray of bool, shape (n_links,)
        Whether a link is a limb, half of one, or a bone, and keeps its length.
    """

    def __init__(self, skeleton):
        self.skeleton = skeleton
        self._points = {}
        for name, at in skeleton.landmarks.items():
            joints = skeleton.indices_of(name)
            # The mean of several joints is a point of its own.
            self._points[name] = joints[0] if isinstance(at, str) else self._count()
        for limb in MIDPOINTS.values():
            if limb in skeleton.limbs:
                self._points[limb] = self._count()
        choices = ("pelvis", "hip", "neck", "shoulder", *LANDMARKS)
        self._origin = next(self._points[name] for name in choices if name in self._points)
        self.links, self.rigid = self._find_links()
        self.legs = self._find_legs() if skeleton.n_dims == 3 else []

    def decompose(self, positions):
        """The `Figure` of positions (n_frames, n_dims * n_joints)."""
        points = self.points_of(positions)
        ends = np.array(self.links, dtype=int).reshape(-1, 2)
        angle = self._heading(points)
        links = _rotate(points[:, ends[:, 1]] - points[:, ends[:, 0]], angle, inverse=True)
        place, foot = points[:, self._origin], self._foot(points)
        return Figure(links, place, angle, self._size(positions), foot)

    def compose(self, links, place, angle, foot):
        """Points (n_frames, n_points, n_dims) of a figure, y up.

        They are moved up or down by one distance, so that the median difference between their
        lower ankle and the given height of the foot (n_frames,) is 0.
        """
        points = np.empty((len(links), self._count(), links.shape[2]))
        points[:, self._origin] = place
        links = _rotate(links, angle)
        for k, (near, far) in enumerate(self.links):
            points[:, far] = points[:, near] + links[:, k]
        points[..., 1] += np.median(foot - self._foot(points))
        return points

    def joints_of(self, points):
        """Positions (n_frames, n_dims * n_joints) of points, y up."""
        joints = from_y_up(points[:, : len(self.skeleton.joints)], self.skeleton)
        return joints.reshape(len(joints), -1)

    def directed_links(self, figures):
        """The rigid links that have a direction in every frame of all figures: (n_links,).

        Limbs and bones are rigid, and what keeps its length in every figure.
        """
        norms = [np.linalg.norm(x.links, axis=2) / x.size for x in figures]
        shown = np.all([(x > _LEAST_LENGTH).all(axis=0) for x in norms], axis=0)
        keeps_length = np.all(
            [np.ptp(x, axis=0) < _SAME_LENGTH * x.max(axis=0) for x in norms], axis=0
        )
        return shown & (self.rigid | keeps_length)

    def _count(self):
        """The number of points: the joints, means of joints, and midpoints."""
        return 1 + max([len(self.skeleton.joints) - 1, *self._points.values()])

    def points_of(self, positions):
        """Points (n_frames, n_points, n_dims), y up."""
        skeleton = self.skeleton
        joints = to_y_up(positions.reshape(len(positions), -1, skeleton.n_dims), skeleton)
        further = np.zeros((len(joints), self._count() - joints.shape[1], joints.shape[2]))
        points = np.concatenate([joints, further], axis=1)
        for name, at in skeleton.landmarks.items():
            if not isinstance(at, str):
                points[:, self._points[name]] = joints[:, skeleton.indices_of(name)].mean(axis=1)
        for limb in set(MIDPOINTS.values()) & set(self._points):
            pair = [self._points[f"{side}_{limb}"] for side in SIDES]
            points[:, self._points[limb]] = points[:, pair].mean(axis=1)
        return points

    def _find_links(self):
        points, joints = self._points, self.skeleton.joints
        pairs = [(m, limb) for m, limb in MIDPOINTS.items() if {m, limb} <= set(points)]
        n_midpoints = len(pairs)
        for name in self.skeleton.limbs:
            start, end = LIMBS[name][:2]
            pairs += [(name, start), (name, end)] if name in MIDPOINTS.values() else [(start, end)]
        pairs = [(points[a], points[b]) for a, b in pairs]
        means = [
            (points[name], joints.index(joint))
            for name, at in self.skeleton.landmarks.items()
            for joint in as_tuple(at)
            if not isinstance(at, str)
        ]
        # The first point may be at the far end of a limb.
        backwards = [(b, a) for a, b in pairs]
        links = _extend([], self._origin, pairs + backwards, points.values())
        links = _extend(links, self._origin, means, ())
        links = _extend(links, self._origin, self.skeleton.bones, ())
        feet = [
            (points[f"{side}_ankle"], joint)
            for side, joints_of_foot in self._find_feet().items()
            if f"{side}_ankle" in points
            for joint in joints_of_foot
        ]
        links = _extend(links, self._origin, [*self.skeleton.bones, *feet], range(len(joints)))
        rigid = {*pairs[n_midpoints:], *backwards[n_midpoints:], *self.skeleton.bones}
        return links, np.array([link in rigid for link in links], dtype=bool)

    def _find_legs(self):
        feet = self._find_feet()
        legs = []
        for side in complete_legs(self.skeleton.limbs):
            hip, knee, ankle = (self._points[f"{side}_{part}"] for part in ("hip", "knee", "ankle"))
            # A leg that hangs on its foot cannot be moved from the hip.
            if {(hip, knee), (knee, ankle)} <= set(self.links):
                foot = self._carried_by(ankle)
                soles = [p for p in feet[side] if p in foot]
                carried = [p for p in self._carried_by(knee) if p not in foot]
                legs.append(Leg(hip, knee, ankle, [ankle, *soles], carried, foot))
        return legs

    def _find_feet(self):
        joints, skeleton = self.skeleton.joints, self.skeleton
        joints_of_feet = guess_feet(joints, skeleton.landmarks)
        return {
            side: [joints.index(j) for name, j in joints_of_feet.items() if name.startswith(side)]
            for side in SIDES
        }

    def _carried_by(self, point):
        """A point, and those that links join to it."""
        carried = [point]
        for near, far in self.links:
            if near in carried:
                carried.append(far)
        return carried

    def _heading(self, points):
        lateral = next((name for name in LATERAL_LIMBS if name in self.skeleton.limbs), None)
        if lateral is None or points.shape[2] == 2:
            return np.zeros(len(points))
        left, right = (points[:, self._points[f"{side}_{lateral}"]] for side in SIDES)
        x, z = unit_vectors(left - right)[:, [0, 2]].T
        seen = np.flatnonzero(np.hypot(x, z) > _LEAST_HORIZONTAL)
        if not len(seen):
            return np.zeros(len(points))
        angle = np.arctan2(z[seen], x[seen])
        # Hips that turn over, as in a cartwheel, do not turn the body about the vertical axis.
        period = np.where(np.diff(seen) > 1, np.pi, 2 * np.pi)
        jumps = period * np.rint(np.diff(angle) / period)
        angle[1:] -= np.cumsum(jumps)
        return np.interp(np.arange(len(points)), seen, angle)

    def _size(self, positions):
        points = landmark_positions(positions, self.skeleton)
        lengths = np.median(np.linalg.norm(limb_vectors(points), axis=2), axis=0)
        return body_size(lengths, self.skeleton.limbs)

    def _foot(self, points):
        ankles = [self._points[name] for name in self._points if name.endswith("_ankle")]
        return points[:, ankles or list(self._points.values()), 1].min(axis=1)


def _extend(links, origin, pairs, required):
    """Links extended along pairs, breadth first; required points not reached are linked to the
    origin.
    """
    links = list(links)
    reached = {origin, *(far for _, far in links)}
    neighbours = {}
    for near, far in pairs:
        neighbours.setdefault(near, []).append(far)

    def grow(waiting):
        while waiting:
            near = waiting.pop(0)
            for far in neighbours.get(near, ()):
                if far not in reached:
                    reached.add(far)
                    links.append((near, far))
                    waiting.append(far)

    grow([origin, *(far for _, far in links)])
    for point in required:
        if point not in reached:
            reached.add(point)
            links.append((origin, point))
            grow([point])
    return links


def _rotate(vectors, angle, *, inverse=False):
    """Vectors (n_frames, n, n_dims) rotated by angles about the vertical axis; unchanged in 2-D."""
    if vectors.shape[2] == 2:
        return vectors
    axes = heading_axes(np.stack([np.cos(angle), 0 * angle, np.sin(angle)], axis=1))
    return project_on_axes(vectors, axes) if inverse else vectors @ axes


# -- feet that stand -------------------------------------------------------------------------------

# A sole stands up to the second number, a share of the pace of the body, and not at all from the
# third one on. The pace is the speed of the fastest point: the first number is its quantile.
_FASTEST, _SLOW, _QUICK = 0.95, 0.05, 0.25
# The same of its height above the lowest sole of the frame, in sizes of the body.
_LOW, _HIGH = 0.1, 0.2
# It stands for as long as the body would go twice this far at its pace: feet on a treadmill stop
# for a moment before they strike.
_BRIEF = 0.4
# Weights of least squares, beside 1 of a sole that stands: of changes from frame to frame; of steps
# of the body, so that it goes its own way in flight; of steps of a foot that does not stand; and of
# values about 0 that nothing else determines.
_EVEN, _FLIGHT, _SWING, _CENTRE = 0.3, 0.03, 1e-3, 1e-6
# A leg is stretched to this share of its length, or as far as it was.
_STRETCHED = 0.99
# A foot is moved by less than this, in sizes of the body.
_LARGEST = 0.25
# Share of the length of a thigh by which a knee bends forward where it is straight.
_STRAIGHT = 1e-3
# A shorter way of a foot, in lengths of the leg, is rounding.
_ROUNDING = 1e-9
_TINY = 1e-300


class Leg(NamedTuple):
    """The points of a leg, by index.

    Attributes
    ----------
    hip, knee, ankle : int
    soles : list of int
        Points that may stand: the ankle, and heel and toe as far as they are known.
    shank : list of int
        The knee, and what moves with it but for the foot.
    foot : list of int
        The ankle, and what moves with it.
    """

    hip: int
    knee: int
    ankle: int
    soles: list
    shank: list
    foot: list


def _find_stances(points, soles, size):
    """How much the soles of a recording stand between frames, from 0 to 1: (n_soles, n_frames - 1).

    The points (n_frames, n_points, 3) are y up, and ``size`` is the unit of length of the body.
    """
    heights = _between(points[:, soles, 1].T)
    stands = _fade((heights - heights.min(axis=0)) / size, _LOW, _HIGH)
    steps = np.linalg.norm(np.diff(points, axis=0), axis=2)
    pace = np.quantile(steps.max(axis=1), _FASTEST)
    if not pace > 0:
        return stands
    stands = stands * _fade(steps[:, soles].T / pace, _SLOW, _QUICK)
    width = 1 + 2 * int(np.rint(_BRIEF * size / pace))
    return grey_opening(stands, size=(1, min(width, stands.shape[1])), mode="nearest")


def _hold_feet(points, structure, arrays, figures, angle, frames, weights, size):
    """Points (n_frames, n_points, 3) of a blend whose feet stand where those of the trials do.

    Soles go along the floor as those of the trials with positive weights do, each along the
    heading of its own body. Negative weights do not make feet slip that stand.

    The body moves as a whole as far as it can, so that knees keep their angles. The rest is left to
    thighs and shanks, which turn and keep their lengths. Everything is linear least squares: where
    a sole goes as it should, nothing moves.
    """
    floor = weights[:, 0] @ [x.foot.min() for x in figures]
    weights = np.maximum(weights, 0)
    weights = weights / weights.sum(axis=0)
    soles = [p for leg in structure.legs for p in leg.soles]
    # Of each sole: how much it stands, its steps, and its heights, below the lowest of which it
    # never goes.
    stands, steps, heights, lowest = 0, 0, floor, floor
    for x, figure, f, w in zip(arrays, figures, frames, weights, strict=True):
        points_of_trial, between = structure.points_of(x), _between(w)
        middle = np.clip(_between(f) - 0.5, 0, len(x) - 2)
        stances = _find_stances(points_of_trial, soles, figure.size)
        stances = np.stack([np.interp(middle, np.arange(len(x) - 1), one) for one in stances])
        stands = stands + between * stances
        track, facing = at_times(points_of_trial[:, soles], f), at_times(figure.angle, f)
        step = _rotate(np.diff(track, axis=0), _between(facing), inverse=True)
        step = _rotate(step, _between(angle))[..., [0, 2]].transpose(1, 0, 2) / figure.size
        steps = steps + (between * _between(size))[:, np.newaxis] * step
        level = (track[..., 1].T - figure.foot.min()) / figure.size
        heights = heights + w * size * level
        least = (points_of_trial[:, soles, 1].min(axis=0) - figure.foot.min()) / figure.size
        lowest = lowest + w * size * least[:, np.newaxis]
    steps = steps - np.diff(points[:, soles][..., [0, 2]], axis=0).transpose(1, 0, 2)
    heights = heights - points[:, soles, 1].T
    standing = _between(np.pad(stands, [(0, 0), (1, 1)], mode="edge"))
    way, rise = _even(steps, stands, _FLIGHT), _even(heights, standing, _CENTRE)
    points = points.copy()
    points[1:, :, [0, 2]] += np.cumsum(way, axis=0)[:, np.newaxis]
    points[:, :, 1] += rise[:, np.newaxis]
    steps, heights, first = steps - way, heights - rise, 0
    # Straight knees bend forward.
    forward = np.stack([-np.sin(angle), 0 * angle, np.cos(angle)], axis=1)
    for leg in structure.legs:
        soles_of_leg = slice(first, first + len(leg.soles))
        first = soles_of_leg.stop
        x, z = _centred(steps[soles_of_leg], stands[soles_of_leg]).T
        y = _even(heights[soles_of_leg], standing[soles_of_leg], _CENTRE)
        moved = np.stack([x, y, z], axis=1)
        share = np.linalg.norm(moved, axis=1) / (_LARGEST * size)
        _move_foot(points, leg, moved / np.sqrt(1 + share**2)[:, np.newaxis], forward)
        sunk = np.maximum(lowest[soles_of_leg] - points[:, leg.soles, 1].T, 0).max(axis=0)
        _move_foot(points, leg, sunk[:, np.newaxis] * [0, 1, 0], forward)
    return points


def _fade(x, low, high):
    """1 up to the first bound, and 0 from the second one on."""
    share = np.clip((high - x) / (high - low), 0, 1)
    return share**2 * (3 - 2 * share)


# -- least squares over the frames --------------------------------------------------------


def _even(values, weights, centre):
    """The mean of values (n_soles, n_frames, ...) by their weights; without any it goes evenly."""
    total = weights.sum(axis=0) + centre
    return _solve(total, np.full(len(total) - 1, _EVEN), (weights.T * values.T).T.sum(axis=0))


def _centred(steps, weights):
    """Displacements (n_frames, 2) about 0 with the mean of steps (n_soles, n_frames - 1, 2)."""
    pull = weights.sum(axis=0) + _SWING
    force = (weights[..., np.newaxis] * steps).sum(axis=0)
    rest = np.full(len(pull) + 1, _CENTRE)
    return _solve(rest, pull, -np.diff(force, axis=0, prepend=0, append=0))


def _solve(weights, pull, right):
    """Solve for values with these weights, and of their changes ``pull``: tridiagonal."""
    bands = np.zeros((2, len(weights)))
    bands[0, 1:] = -pull
    bands[1] = weights
    bands[1, 1:] += pull
    bands[1, :-1] += pull
    return solveh_banded(bands, right)


# -- inverse kinematics of a leg ----------------------------------------------------------


def _move_foot(points, leg, moved, forward):
    """Move the foot of a leg by (n_frames, 3), in place, as far as the leg reaches.

    Where it is too short, the foot is lifted rather than moved along the floor.
    """
    hip, knee, ankle = (points[:, p] for p in leg[:3])
    thigh, reach = knee - hip, ankle - hip
    upper, lower, far = (np.linalg.norm(x, axis=1) for x in (thigh, ankle - knee, reach))
    goes = (np.abs(moved).max(axis=1) > _ROUNDING * (upper + lower))[:, np.newaxis]
    target, longest = reach + moved, np.maximum(far, _STRETCHED * (upper + lower))
    across = np.linalg.norm(target[:, [0, 2]], axis=1)
    target[:, [0, 2]] *= np.minimum(1, longest / np.maximum(across, _TINY))[:, np.newaxis]
    depth = np.sqrt(np.maximum(longest**2 - (target[:, [0, 2]] ** 2).sum(axis=1), 0))
    target[:, 1] = np.clip(target[:, 1], -depth, depth)
    shortest = np.minimum(far, np.abs(upper - lower) + (1 - _STRETCHED) * (upper + lower))
    new = np.maximum(np.linalg.norm(target, axis=1), np.maximum(shortest, _TINY))
    start, axis = unit_vectors(reach), unit_vectors(target)
    bend = thigh - (thigh * start).sum(axis=1, keepdims=True) * start
    along = (upper**2 + new**2 - lower**2) / (2 * new)
    wanted = np.sqrt(np.maximum(upper**2 - along**2, 0))
    bend = _bent(_turned(bend, start, axis), wanted, axis, forward, _STRAIGHT * upper)
    at = hip + along[:, np.newaxis] * axis + bend
    points[:, leg.shank] += np.where(goes, at - knee, 0)[:, np.newaxis]
    moved = hip + new[:, np.newaxis] * axis - ankle
    points[:, leg.foot] += np.where(goes, moved, 0)[:, np.newaxis]


def _bent(bend, wanted, axis, forward, least):
    """Vectors (n_frames, 3) across an axis to a knee, with the lengths wanted.

    Longer ones lean forward if the knee is nearly straight.
    """
    size = np.linalg.norm(bend, axis=1)
    front = forward - (forward * axis).sum(axis=1, keepdims=True) * axis
    front = unit_vectors(bend + least[:, np.newaxis] * front)
    cosine = (bend * front).sum(axis=1)
    more = np.sqrt(np.maximum(cosine**2 + wanted**2 - size**2, 0)) - cosine
    shorter = bend * (wanted / np.maximum(size, _TINY))[:, np.newaxis]
    return np.where((wanted < size)[:, np.newaxis], shorter, bend + more[:, np.newaxis] * front)


def _turned(vectors, start, end):
    """Vectors (n_frames, 3) under the smallest rotations from unit vectors to others."""
    normal, cosine = np.cross(start, end), (start * end).sum(axis=1, keepdims=True)
    along = (normal * vectors).sum(axis=1, keepdims=True) / np.maximum(1 + cosine, _TINY)
    return cosine * vectors + np.cross(normal, vectors) + along * normal
