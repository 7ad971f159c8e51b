"""Bodies as in a mirror: left and right exchanged."""

import re

import numpy as np
import pandas as pd

from ..inputs.collections import as_collection
from ..inputs.numbers import as_numbers
from ..inputs.tables import as_pandas
from .axes import heading
from .columns import check_columns
from .formats import LANDMARKS, SIDES
from .landmarks import as_tuple
from .limbs import unit
from .skeleton import Skeleton
from .upright import UPS, y_up

__all__ = ["mirror", "partners_of"]

# A joint without a partner that is never nearer to the middle than this, in widths of the hips or
# the shoulders, is on one side.
_OFF = 0.25


def mirror(X, skeleton):
    """Exchange left and right: the same performances as in a mirror.

    So that those who do it with the left and with the right make one set, or to see how far a
    person is from being even.

    Parameters
    ----------
    X : list of arrays (n_frames_i, n_dims * n_joints), 3-D array, 2-D array or DataFrame
        Joint positions, one or several performances; gaps may be NaN.
    skeleton : Skeleton
        Tells the joints. Those of each pair take each other's place: left and right of a landmark,
        then names that differ by "left" and "right", or "L" and "R". All others are in the middle.

    Returns
    -------
    The kind that was given, of the same shape, names and order
        The first horizontal axis is turned around: x, or y where x is vertical. So whoever faces z
        still does. Twice, it gives back what was given.

    Raises
    ------
    ValueError
        If the width or the order of the columns is not that of the skeleton, or a joint is on one
        side and has no partner.

    See Also
    --------
    DirectionCosines : Of a mirrored performance they are those of the mirrored limbs: of the other
        side's limbs with x turned around, of the hips and the shoulders with y and z.

    Examples
    --------
    >>> from sklearn_motionsync import mirror
    >>> from sklearn_motionsync.datasets import make_bending
    >>> bunch = make_bending(3, random_state=0)
    >>> mirrored = mirror(bunch.data, bunch.skeleton)
    >>> left, right = (3 * bunch.skeleton.index_of(f"{side}_wrist") for side in ("left", "right"))
    >>> bool((mirrored[0][:, left] == -bunch.data[0][:, right]).all())
    True
    """
    if not isinstance(skeleton, Skeleton):
        raise ValueError(
            "mirror needs the Skeleton of the positions, such as Skeleton.from_frame(df); got "
            f"{type(skeleton).__name__}."
        )
    partners, alone = partners_of(skeleton)
    # Frame by frame it does not matter which of them are one performance.
    whole = isinstance(X, pd.DataFrame) or getattr(X, "ndim", 1) == 3
    one = whole or as_collection(X) is None
    parts = [X] if one else list(X)
    if not parts:
        raise ValueError("Found 0 performances (n_samples=0); there is nothing to mirror.")
    arrays = [_checked(x, skeleton, i) for i, x in enumerate(parts)]
    _check_middle(arrays, skeleton, alone)
    mirrored = [
        _like(x, _exchanged(array, skeleton, partners))
        for x, array in zip(parts, arrays, strict=True)
    ]
    return mirrored[0] if one else mirrored


def _checked(x, skeleton, i):
    """Numbers (..., n_joints, n_dims) of one performance, or of several in one array."""
    what = f"Performance {i}"
    x = as_pandas(x)
    check_columns(x, skeleton, what)
    array = as_numbers(x, what)
    width = skeleton.n_dims * len(skeleton.joints)
    if array.ndim < 2 or array.shape[-1] != width:
        raise ValueError(
            f"{what} has shape {array.shape}, but the positions of the skeleton's "
            f"{len(skeleton.joints)} joints are (n_frames, {width})."
        )
    return array.reshape(*array.shape[:-1], -1, skeleton.n_dims)


def _exchanged(array, skeleton, partners):
    out = array[..., partners, :]
    across = UPS[skeleton.n_dims][skeleton.up][0][0]
    out[..., across] = -out[..., across]
    return out.reshape(*array.shape[:-2], -1)


def _like(x, array):
    """An array as the kind of what was given."""
    if x is not as_pandas(x):
        # Polars, which need not be installed.
        return type(x)(dict(zip(x.columns, array.T, strict=True)))
    if not isinstance(x, pd.DataFrame):
        return array
    df = pd.DataFrame(array, index=x.index, columns=x.columns)
    df.attrs = dict(x.attrs)
    return df


# -- who belongs to whom ------------------------------------------------------------------------


def partners_of(skeleton):
    """For each joint the index of the one that takes its place, and who may be on one side.

    Returns
    -------
    partners : list of int
        A joint of the middle is its own.
    alone : list of int
        Joints without a partner that are no landmarks of the middle.

    Raises
    ------
    ValueError
        If a joint is on one side by its landmark or its name, and has no partner.
    """
    joints, landmarks = skeleton.joints, skeleton.landmarks
    partners, sided = {}, set()
    for name in LANDMARKS:
        side, _, part = name.rpartition("_")
        if not side or name not in landmarks:
            continue
        own = as_tuple(landmarks[name])
        other = as_tuple(landmarks.get(f"{SIDES[side == SIDES[0]]}_{part}", ()))
        sided |= set(own)
        if len(own) == len(other) == 1:
            partners.setdefault(own[0], other[0])
    lower = {joint.lower(): joint for joint in reversed(joints)}
    for joint in joints:
        if joint not in partners and (found := _by_name(joint, lower)) is not None:
            partners[joint] = found
    _pair_means(landmarks, partners)
    middle = {j for name in ("pelvis", "neck", "head") for j in as_tuple(landmarks.get(name, ()))}
    alone = [joint for joint in joints if joint not in partners]
    for joint in joints:
        other = partners.get(joint, joint)
        lacks = other == joint and (joint in sided or re.search("left|right", joint.lower()))
        if (lacks and joint not in middle) or partners.get(other, other) != joint:
            raise ValueError(
                f"The joint {joint!r} is on one side, and none takes its place on the other; the "
                f"joints are {list(joints)}. Leave its columns out, or name both in the landmarks."
            )
    index = {joint: j for j, joint in enumerate(joints)}
    return [index[partners.get(joint, joint)] for joint in joints], [
        index[joint] for joint in alone if joint not in middle
    ]


def _pair_means(landmarks, partners):
    """Joints of landmarks that are means, as far as their names told nothing: in their order."""
    for name in LANDMARKS:
        side, _, part = name.rpartition("_")
        if side == SIDES[0] and name in landmarks and f"{SIDES[1]}_{part}" in landmarks:
            pair = as_tuple(landmarks[name]), as_tuple(landmarks[f"{SIDES[1]}_{part}"])
            left, right = ([j for j in of if j not in partners] for of in pair)
            if len(left) == len(right):
                for one, other in zip(left, right, strict=True):
                    partners[one], partners[other] = other, one


def _by_name(joint, lower):
    """The joint whose name has the other side in it; None if there is none."""
    name = joint.lower()
    swapped = {"left": "right", "right": "left", "l": "r", "r": "l"}
    # "left" anywhere; "l" as a word, at the beginning, at the end.
    for pattern in ("left|right", r"(?<![a-z0-9])[lr](?![a-z0-9])", "^[lr]", "[lr]$"):
        other = re.sub(pattern, lambda found: swapped[found.group()], name)
        if other != name and other in lower:
            return lower[other]
    # After what a program put before every name.
    for start in range(1, len(name)):
        if not name[start - 1].isalnum() and name[start] in "lr":
            other = name[:start] + swapped[name[start]] + name[start + 1 :]
            if other in lower:
                return lower[other]
    return None


def _check_middle(arrays, skeleton, alone):
    """Refuse joints without a partner that are on one side all the time."""
    pair = next(
        (names for names in (("left_hip", "right_hip"), ("left_shoulder", "right_shoulder"))
         if set(names) <= set(skeleton.landmarks)), None,
    )  # fmt: skip
    if pair is None or not alone or skeleton.n_dims == 2:
        return
    nearest = np.full(len(alone), np.inf)
    for array in arrays:
        points = y_up(array.reshape(-1, *array.shape[-2:]).astype(np.float64), skeleton)
        left, right = (points[:, skeleton.indices_of(name)].mean(axis=1) for name in pair)
        seen = np.isfinite(left + right).all(axis=1)
        if not seen.any():
            continue
        points, left, right = points[seen], left[seen], right[seen]
        across = heading(unit(left - right))[:, 0]
        width = np.linalg.norm(left - right, axis=1, keepdims=True)
        from_middle = points[:, alone] - ((left + right) / 2)[:, np.newaxis]
        off = np.abs(np.einsum("fjd,fd->fj", from_middle, across))
        off = off / np.where(width > 0, width, np.inf)
        nearest = np.fmin(nearest, np.fmin.reduce(off, axis=0))
    # Of joints that are never seen, nothing is known.
    one_sided = [
        j for j, off in zip(alone, nearest, strict=True) if np.isfinite(off) and off > _OFF
    ]
    if one_sided:
        joint = skeleton.joints[one_sided[0]]
        raise ValueError(
            f"The joint {joint!r} is on one side in every frame, and none takes its place on the "
            f"other; the joints are {list(skeleton.joints)}. Leave its columns out, or name both "
            "in the landmarks."
        )
