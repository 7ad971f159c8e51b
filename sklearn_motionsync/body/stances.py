"""Feet that stand: when they do, and bodies moved so that their feet go where they should."""

from typing import NamedTuple

import numpy as np
from scipy.linalg import solveh_banded
from scipy.ndimage import grey_opening

from .limbs import unit_vectors

__all__ = ["Leg", "find_stances", "hold_feet"]

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


def find_stances(points, legs, size):
    """How much the soles of a recording stand, between frames.

    Parameters
    ----------
    points : ndarray, shape (n_frames, n_points, 3)
        y up.
    legs : list of Leg
    size : float
        The unit of length of the body.

    Returns
    -------
    ndarray, shape (n_soles, n_frames - 1)
        From 0 to 1, for the soles of one leg after the other.
    """
    soles = [p for leg in legs for p in leg.soles]
    heights = (points[1:, soles, 1] + points[:-1, soles, 1]).T / 2
    stands = _fade((heights - heights.min(axis=0)) / size, _LOW, _HIGH)
    steps = np.linalg.norm(np.diff(points, axis=0), axis=2)
    pace = np.quantile(steps.max(axis=1), _FASTEST)
    if not pace > 0:
        return stands
    stands = stands * _fade(steps[:, soles].T / pace, _SLOW, _QUICK)
    width = 1 + 2 * int(np.rint(_BRIEF * size / pace))
    return grey_opening(stands, size=(1, min(width, stands.shape[1])), mode="nearest")


def hold_feet(points, legs, stands, steps, heights, lowest, forward, size):
    """Points of a body, moved so that soles go as they should while they stand.

    The body moves as a whole as far as it can, so that knees keep their angles. The rest is left to
    thighs and shanks, which turn and keep their lengths. Everything is linear least squares: where
    a sole goes as it should, nothing moves.

    Parameters
    ----------
    points : ndarray, shape (n_frames, n_points, 3)
        y up.
    legs : list of Leg
    stands : ndarray, shape (n_soles, n_frames - 1)
        As of `find_stances`.
    steps : ndarray, shape (n_soles, n_frames - 1, 2)
        Along the floor, as they should be.
    heights, lowest : ndarray, shape (n_soles, n_frames)
        As they should be while a sole stands, and below which it never goes.
    forward : ndarray, shape (n_frames, 3)
        Unit vectors, to where straight knees bend.
    size : ndarray, shape (n_frames,)

    Returns
    -------
    ndarray, shape (n_frames, n_points, 3)
    """
    points = points.copy()
    soles = [p for leg in legs for p in leg.soles]
    steps = steps - np.diff(points[:, soles][..., [0, 2]], axis=0).transpose(1, 0, 2)
    heights = heights - points[:, soles, 1].T
    there = np.pad(stands, [(0, 0), (1, 1)], mode="edge")
    there = (there[:, 1:] + there[:, :-1]) / 2
    way, rise = _even(steps, stands, _FLIGHT), _even(heights, there, _CENTRE)
    points[1:, :, [0, 2]] += np.cumsum(way, axis=0)[:, np.newaxis]
    points[:, :, 1] += rise[:, np.newaxis]
    steps, heights, first = steps - way, heights - rise, 0
    for leg in legs:
        own = slice(first, first + len(leg.soles))
        first = own.stop
        x, z = _centred(steps[own], stands[own]).T
        moved = np.stack([x, _even(heights[own], there[own], _CENTRE), z], axis=1)
        share = np.linalg.norm(moved, axis=1) / (_LARGEST * size)
        _move_foot(points, leg, moved / np.sqrt(1 + share**2)[:, np.newaxis], forward)
        sunk = np.maximum(lowest[own] - points[:, leg.soles, 1].T, 0).max(axis=0)
        _move_foot(points, leg, sunk[:, np.newaxis] * [0, 1, 0], forward)
    return points


def _fade(x, low, high):
    """1 up to the first bound, and 0 from the second one on."""
    share = np.clip((high - x) / (high - low), 0, 1)
    return share**2 * (3 - 2 * share)


# -- least squares over the frames --------------------------------------------------------


def _even(values, weights, centre):
    """The mean of values (n_soles, n_frames, ...) by their weights; without any it goes evenly."""
    own = weights.sum(axis=0) + centre
    return _solve(own, np.full(len(own) - 1, _EVEN), (weights.T * values.T).T.sum(axis=0))


def _centred(steps, weights):
    """Displacements (n_frames, 2) about 0 with the mean of steps (n_soles, n_frames - 1, 2)."""
    pull = weights.sum(axis=0) + _SWING
    force = (weights[..., np.newaxis] * steps).sum(axis=0)
    rest = np.full(len(pull) + 1, _CENTRE)
    return _solve(rest, pull, -np.diff(force, axis=0, prepend=0, append=0))


def _solve(own, pull, right):
    """Solve for values with the weights ``own``, and of their changes ``pull``: tridiagonal."""
    bands = np.zeros((2, len(own)))
    bands[0, 1:] = -pull
    bands[1] = own
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
