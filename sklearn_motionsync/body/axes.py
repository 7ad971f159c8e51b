"""Axes of bodies and of limbs: along the hips, and along the parent limb."""

import numpy as np

from .limbs import LEFT, LIMBS, UP, ancestor_of, unit

__all__ = ["along_parents", "heading", "turned"]


def heading(hip):
    """Frames (n_frames, 3, 3), rows x to the left along the hips, y up, z forward.

    The direction (n_frames, 3) of the shoulders will do where there are no hips.
    """
    x = hip * np.array([1, 0, 1], dtype=hip.dtype)
    length = np.linalg.norm(x, axis=1, keepdims=True)
    # Hips one above the other show no heading: keep the recording's axes.
    shown = length[:, 0] > np.sqrt(np.finfo(hip.dtype).eps)
    x = np.where(shown[:, np.newaxis], x / np.where(length > 0, length, 1), LEFT)
    y = np.broadcast_to(np.asarray(UP, dtype=x.dtype), x.shape)
    return np.stack([x, y, np.cross(x, y)], axis=1).astype(hip.dtype)


def turned(vectors, frames):
    """Coordinates of (n_frames, n, 3) vectors along the rows of (n_frames, 3, 3) frames."""
    return vectors @ frames.transpose(0, 2, 1)


def _swing(rest, direction):
    """Rows: the axes after the smallest rotation that takes ``rest`` to each direction.

    It is made of two half-turns, about ``rest`` and about the middle of both, so that it is a
    rotation up to the rounding of numbers, also where the direction nearly is the opposite.
    """
    rest = np.asarray(rest, dtype=direction.dtype)
    cosine = direction @ rest
    sideways = direction * (rest == 0)
    # 1 + cosine, but for the digits that it loses there.
    along = np.where(cosine > 0, 1 + cosine, (sideways**2).sum(axis=1) / (1 + np.abs(cosine)))
    along[~direction.any(axis=1)] = 1
    middle = unit(along[:, np.newaxis] * rest + sideways)
    # At the opposite of rest every middle across serves in space, and in the plane only this one.
    across = (rest[0] == 0, rest[0] != 0, 0)
    middle = np.where(middle.any(axis=1, keepdims=True), middle, across).astype(direction.dtype)
    about_middle = 2 * middle[:, :, np.newaxis] * middle[:, np.newaxis] - np.eye(
        3, dtype=rest.dtype
    )
    return (2 * rest * rest - 1)[:, np.newaxis] * about_middle


def along_parents(cosines, limbs, *, inverse=False):
    """From cosines along the body's axes to those along the parent limbs' axes, or back.

    Parameters
    ----------
    cosines : ndarray, shape (n_frames, 12, n_dims)
        Of limbs in the plane of a picture, the rotations are about its normal.
    limbs : list of str
        Those that are there. Who lacks a parent hangs on the nearest limb above it, or on the body.
    inverse : bool, default=False

    Returns
    -------
    ndarray of the same shape
        0 for limbs that are not there.
    """
    n_dims = cosines.shape[2]
    if n_dims == 2:
        cosines = np.concatenate([cosines, np.zeros_like(cosines[..., :1])], axis=2)
    frames, out = {}, np.zeros_like(cosines)
    for i, (name, limb) in enumerate(LIMBS.items()):
        if name not in limbs:
            continue
        given, above = cosines[:, i : i + 1], ancestor_of(name, limbs)
        if above is None:
            local = whole = given
            parent = np.broadcast_to(np.eye(3, dtype=cosines.dtype), (len(cosines), 3, 3))
        else:
            parent = frames[above]
            local = given if inverse else turned(given, parent)
            whole = given @ parent if inverse else given
        out[:, i : i + 1] = whole if inverse else local
        frames[name] = _swing(limb.rest, local[:, 0]) @ parent
    return out[..., :n_dims]
