"""Blends of bodies frame by frame: limbs on the sphere, headings on the circle, paths by steps."""

import numpy as np

from .figure import Plan, along_angle
from .sphere import blended, mean_direction, weighted

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
