"""Blends of bodies frame by frame: limbs on the sphere, headings on the circle, paths by steps."""

from typing import NamedTuple

import numpy as np

from .axes import heading, turned
from .base import ACROSS
from .formats import LANDMARKS, SIDES
from .landmarks import as_tuple
from .limbs import LIMB_NAMES, LIMBS, landmarks_of, limbs_of, size_of, unit
from .sphere import blended, mean_direction, weighted
from .upright import as_recorded, y_up

__all__ = ["at_frames", "blend_bodies", "blend_numbers", "blend_postures"]

# What is shorter in a posture is no direction.
_SHOWN = 1e-6


def blend_numbers(arrays, frames, weights):
    """Weighted sums of whatever is no direction.

    Parameters
    ----------
    arrays : list of ndarray (n_frames_i, ...)
    frames : ndarray, shape (n, n_frames)
        The frames of each that meet, with fractions.
    weights : ndarray, shape (n, n_frames)
        Of sum 1 along the first axis.

    Returns
    -------
    ndarray, shape (n_frames, ...)
    """
    pairs = zip(arrays, frames, weights, strict=True)
    return sum((at_frames(x, f).T * w).T for x, f, w in pairs)


def blend_postures(arrays, frames, weights, first, n_dims):
    """The same of postures: after the first columns, directions of limbs, ``n_dims`` columns each.

    A direction that any of them lacks somewhere, such as of hips seen end-on, is a number.
    """
    linear = blend_numbers(arrays, frames, weights)
    limbs = [x[:, first:].reshape(len(x), -1, n_dims) for x in arrays]
    shown = [(np.linalg.norm(x, axis=2) > _SHOWN).all(axis=0) for x in limbs]
    straight = np.all(shown, axis=0)
    out = linear[:, first:].reshape(len(linear), -1, n_dims)
    out[:, straight] = _blend_vectors([x[:, straight] for x in limbs], frames, weights)
    return linear


def blend_bodies(arrays, frames, weights, skeleton, owner=None):
    """The same of joint positions.

    Parameters
    ----------
    arrays : list of ndarray (n_frames_i, n_dims * n_joints)
        Checked, of one unit.
    frames, weights : as for `blend_numbers`
    skeleton : Skeleton
    owner : int, default=None
        Whose size and lengths of limbs the blend has; by default the blended ones.

    Returns
    -------
    ndarray, shape (n_frames, n_dims * n_joints)
    """
    plan = Plan(skeleton)
    figures = [plan.take_apart(x) for x in arrays]
    straight = plan.straight(figures)
    sizes = np.array([x.size for x in figures])
    size = weighted(sizes[:, np.newaxis], weights)
    if owner is not None:
        size = np.full(len(size), sizes[owner])
    # Places and offsets are blended in bodies.
    links = blend_numbers([x.links / x.size for x in figures], frames, weights)
    links *= size[:, np.newaxis, np.newaxis]
    limbs = [x.links[:, straight] for x in figures]
    links[:, straight] = _blend_vectors(limbs, frames, weights, owner)
    angle, place = _path(figures, frames, weights, size)
    place[:, 1] = _heights([x.place[:, 1] for x in figures], figures, frames, weights, size)
    foot = _heights([x.foot for x in figures], figures, frames, weights, size)
    return plan.put_together(links, place, angle, foot)


def at_frames(x, frames):
    """A sequence (n_frames, ...) at frames with fractions, straight in between."""
    left, share = _between(x, frames)
    return ((x[left].T * (1 - share)) + (x[left + 1].T * share)).T


def _between(x, frames):
    left = np.minimum(frames.astype(np.intp), len(x) - 2)
    return left, frames - left


def _blend_vectors(arrays, frames, weights, owner=None):
    """Vectors (n_frames_i, n_links, n_dims) blended in direction and length, or with one's own."""
    met = []
    for x, f in zip(arrays, frames, strict=True):
        left, share = _between(x, f)
        met.append(
            blended(np.stack([x[left], x[left + 1]]), np.stack([1 - share, share])[..., None])
        )
    met = np.stack(met)
    if owner is None:
        return blended(met, weights[..., np.newaxis])
    lengths = np.linalg.norm(met, axis=-1, keepdims=True)
    return mean_direction(met / lengths, weights[..., np.newaxis]) * lengths[owner]


def _path(figures, frames, weights, size):
    """Heading and place of a blend: it begins in the middle, and goes on by blended steps.

    Steps are seen along each body's own heading, so that who walks this way and who walks that way
    make one who walks.
    """
    angles = np.stack([at_frames(x.angle, f) for x, f in zip(figures, frames, strict=True)])
    at_first = np.stack([np.cos(angles[:, 0]), np.sin(angles[:, 0])], axis=1)
    start = mean_direction(at_first, weights[:, 0])
    between = (weights[:, 1:] + weights[:, :-1]) / 2
    turns = (between * np.diff(angles, axis=1)).sum(axis=0)
    angle = np.arctan2(start[1], start[0]) + np.concatenate([[0], np.cumsum(turns)])
    steps = 0
    for x, f, own, w in zip(figures, frames, angles, between, strict=True):
        step = np.diff(at_frames(x.place, f), axis=0)[:, np.newaxis] / x.size
        step = along_angle(step, (own[1:] + own[:-1]) / 2, inverse=True)[:, 0]
        steps = steps + w[:, np.newaxis] * step
    steps = steps * ((size[1:] + size[:-1]) / 2)[:, np.newaxis]
    steps = along_angle(steps[:, np.newaxis], (angle[1:] + angle[:-1]) / 2)[:, 0]
    begin = blend_numbers([x.place for x in figures], frames[:, :1], weights[:, :1])
    return angle, np.concatenate([begin, begin + np.cumsum(steps, axis=0)])


def _heights(tracks, figures, frames, weights, size):
    """Heights above the floor, blended in bodies, on the floor of the blend's first frame."""
    own = [(x - figure.floor) / figure.size for x, figure in zip(tracks, figures, strict=True)]
    return blend_numbers(own, frames, weights) * size + weights[:, 0] @ [x.floor for x in figures]


# -- figures: bodies taken apart into links, heading and path, and put together again ----

# Who is nearer than this, in bodies, has no direction from there.
_APART = 1e-6
# Hips that show less of themselves from above, in their lengths, show no heading: within 17 degrees
# of the vertical it leaps from side to side. Nobody's do in 343 real performances (0.33 at least).
_MOST_SHOWN = 0.3
# Between the joints of a pair: no landmarks, but where both sides are joined to the trunk.
_MIDDLES = {"hip": "pelvis", "shoulder": "neck"}


class Figure(NamedTuple):
    """A performance taken apart, y up.

    Attributes
    ----------
    links : ndarray, shape (n_frames, n_links, n_dims)
        From each point to the next one, along axes that turn with the body.
    place : ndarray, shape (n_frames, n_dims)
        Of the first point, in the recording.
    angle : ndarray, shape (n_frames,)
        How far the body is turned about the vertical axis, without jumps.
    size : float
        The stretched leg, or whatever tells the size of the body.
    foot : ndarray, shape (n_frames,)
        Height of the lower ankle, or the lowest landmark of a body without ankles.
    """

    links: np.ndarray
    place: np.ndarray
    angle: np.ndarray
    size: float
    foot: np.ndarray

    @property
    def floor(self):
        """Height of the lowest ankle ever."""
        return self.foot.min()

    @property
    def lengths(self):
        """(n_frames, n_links)."""
        return np.linalg.norm(self.links, axis=2)


class Plan:
    """How the bodies of a skeleton are taken apart: which point hangs on which.

    Landmarks hang on each other by the twelve limbs; hips and shoulders on the middle of their
    pair, which goes with the pelvis and the neck. Every other joint hangs on its parent, and what
    hangs on nothing on the first point.

    Parameters
    ----------
    skeleton : Skeleton

    Attributes
    ----------
    links : list of (int, int)
        Pairs of points, the nearer to the first one before; each comes before those that hang on
        it. The first points are the joints.
    lasting : ndarray of bool, shape (n_links,)
        Whether a link is a limb, half of one, or a bone: what has a length of its own.
    """

    def __init__(self, skeleton):
        self.skeleton = skeleton
        self._points = {}
        for name, at in skeleton.landmarks.items():
            joints = skeleton.indices_of(name)
            # What is the mean of several joints is a point of its own.
            self._points[name] = joints[0] if isinstance(at, str) else self._count()
        for part in _MIDDLES:
            if part in skeleton.limbs:
                self._points[part] = self._count()
        self.origin = self._points[self._first()]
        self.links, self.lasting = self._linked()

    def points_of(self, positions):
        """(n_frames, n_points, n_dims) of (n_frames, n_dims * n_joints) positions, y up."""
        skeleton = self.skeleton
        joints = y_up(positions.reshape(len(positions), -1, skeleton.n_dims), skeleton)
        points = np.concatenate(
            [joints, np.zeros((len(joints), self._count() - joints.shape[1], joints.shape[2]))],
            axis=1,
        )
        for name, at in skeleton.landmarks.items():
            if not isinstance(at, str):
                points[:, self._points[name]] = joints[:, skeleton.indices_of(name)].mean(axis=1)
        for part in set(_MIDDLES) & set(self._points):
            pair = [self._points[f"{side}_{part}"] for side in SIDES]
            points[:, self._points[part]] = points[:, pair].mean(axis=1)
        return points

    def take_apart(self, positions):
        """The figure of a performance.

        Parameters
        ----------
        positions : ndarray, shape (n_frames, n_dims * n_joints)

        Returns
        -------
        Figure
        """
        points = self.points_of(positions)
        ends = np.array(self.links, dtype=int).reshape(-1, 2)
        angle = self._angle(points)
        links = along_angle(points[:, ends[:, 1]] - points[:, ends[:, 0]], angle, inverse=True)
        return Figure(
            links, points[:, self.origin], angle, self._size(positions), self._foot(points)
        )

    def put_together(self, links, place, angle, foot):
        """Positions (n_frames, n_dims * n_joints) of a figure.

        It is moved up or down as a whole, so that its lower ankle is, half of the time, no lower
        than it should be (n_frames,), and half of the time no higher.
        """
        points = np.empty((len(links), self._count(), links.shape[2]))
        points[:, self.origin] = place
        links = along_angle(links, angle)
        for k, (near, far) in enumerate(self.links):
            points[:, far] = points[:, near] + links[:, k]
        points[..., 1] += np.median(foot - self._foot(points))
        joints = as_recorded(points[:, : len(self.skeleton.joints)], self.skeleton)
        return joints.reshape(len(joints), -1)

    def straight(self, figures):
        """Which lasting links have a direction at every frame of all figures: (n_links,)."""
        shown = [(x.lengths > _APART * x.size).all(axis=0) for x in figures]
        return self.lasting & np.all(shown, axis=0)

    # -- which point hangs on which ----------------------------------------------------------

    def _count(self):
        """How many points there are: the joints, and those of their own."""
        return 1 + max([len(self.skeleton.joints) - 1, *self._points.values()])

    def _first(self):
        choices = ("pelvis", "hip", "neck", "shoulder", *LANDMARKS)
        return next(name for name in choices if name in self._points)

    def _linked(self):
        """Links from the first point to every other one, and which keep a length."""
        points, joints = self._points, self.skeleton.joints
        limbs = []
        for name in self.skeleton.limbs:
            start, end = LIMBS[name][:2]
            middle = name in _MIDDLES
            limbs += [(name, start), (name, end)] if middle else [(start, end)]
        limbs = [(points[a], points[b]) for a, b in limbs]
        middles = [(m, part) for part, m in _MIDDLES.items() if {m, part} <= set(points)]
        middles = [(points[a], points[b]) for a, b in middles]
        means = [
            (points[name], joints.index(joint))
            for name, at in self.skeleton.landmarks.items()
            for joint in as_tuple(at)
            if not isinstance(at, str)
        ]
        # The first point may be at the far end of a limb.
        ways = [*middles, *limbs]
        ways += [(b, a) for a, b in ways]
        links = _grown([], self.origin, ways, points.values())
        links = _grown(links, self.origin, means, ())
        links = _grown(links, self.origin, self.skeleton.bones, range(len(joints)))
        lasting = {*limbs, *((b, a) for a, b in limbs), *self.skeleton.bones}
        return links, np.array([link in lasting for link in links], dtype=bool)

    # -- what a body is ----------------------------------------------------------------------

    def _angle(self, points):
        across = next((name for name in ACROSS if name in self.skeleton.limbs), None)
        if across is None or points.shape[2] == 2:
            return np.zeros(len(points))
        left, right = (points[:, self._points[f"{side}_{across}"]] for side in SIDES)
        x, z = unit(left - right)[:, [0, 2]].T
        seen = np.flatnonzero(np.hypot(x, z) > _MOST_SHOWN)
        if not len(seen):
            return np.zeros(len(points))
        angle = np.arctan2(z[seen], x[seen])
        # Hips that went over the top, as in a cartwheel, have not turned the body about.
        period = np.where(np.diff(seen) > 1, np.pi, 2 * np.pi)
        leaps = period * np.rint(np.diff(angle) / period)
        angle[1:] -= np.cumsum(leaps)
        return np.interp(np.arange(len(points)), seen, angle)

    def _size(self, positions):
        points, k = landmarks_of(positions, self.skeleton)
        lengths = np.median(np.linalg.norm(limbs_of(points), axis=2), axis=0)
        lengths[[name not in self.skeleton.limbs for name in LIMB_NAMES]] = 0
        return np.ldexp(size_of(lengths, self.skeleton.limbs), k)

    def _foot(self, points):
        ankles = [self._points[name] for name in self._points if name.endswith("_ankle")]
        return points[:, ankles or list(self._points.values()), 1].min(axis=1)


def _grown(links, first, ways, everything):
    """Links, and those that ways lead on to, each point once; the rest hangs on the first point."""
    links = list(links)
    reached = {first, *(far for _, far in links)}
    from_here = {}
    for near, far in ways:
        from_here.setdefault(near, []).append(far)

    def grow(waiting):
        while waiting:
            near = waiting.pop(0)
            for far in from_here.get(near, ()):
                if far not in reached:
                    reached.add(far)
                    links.append((near, far))
                    waiting.append(far)

    grow([first, *(far for _, far in links)])
    for point in everything:
        if point not in reached:
            reached.add(point)
            links.append((first, point))
            grow([point])
    return links


def along_angle(vectors, angle, *, inverse=False):
    """Vectors (n_frames, n, n_dims) turned by angles about the vertical axis, or turned back.

    In the plane nothing is turned.
    """
    if vectors.shape[2] == 2:
        return vectors
    frames = heading(np.stack([np.cos(angle), 0 * angle, np.sin(angle)], axis=1))
    return turned(vectors, frames) if inverse else vectors @ frames
