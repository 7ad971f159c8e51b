"""Bodies built of the heights, directions and lengths of their limbs, and the matrix of that."""

import numpy as np
import pandas as pd

from ..gate import as_numbers
from .formats import LANDMARKS, SIDES
from .limbs import LIMBS, leg_length, lowest, places_of

__all__ = ["built", "checked_lengths", "matrix_of"]

# How far the hips of a body may be moved from where its pelvis is, in leg lengths, so that it
# stands on the floor. Of 144 performances of optical motion capture, and of their approximations in
# an aSpace, none needs more than 0.21.
_MOVED = 0.25


def checked_lengths(limb_lengths, limbs):
    """One length above 0 for each limb."""
    names = list(limb_lengths.index) if isinstance(limb_lengths, pd.Series) else limbs
    if names not in (limbs, list(range(len(limbs)))):
        raise ValueError(f"limb_lengths is indexed by {names}; select {limbs}, in that order.")
    lengths = as_numbers(limb_lengths, "limb_lengths", dtype=np.float64)
    if lengths.shape != (len(limbs),):
        raise ValueError(
            f"limb_lengths needs one length for each of {limbs}, got shape {lengths.shape}."
        )
    wrong = ~((lengths > 0) & np.isfinite(lengths))
    if wrong.any():
        limb = int(wrong.argmax())
        raise ValueError(
            f"limb_lengths must be numbers above 0, got {lengths[limb]:g} for {limbs[limb]!r}."
        )
    return lengths


def built(heights, cosines, lengths, skeleton):
    """Positions of bodies with given heights, directions and lengths of limbs.

    Parameters
    ----------
    heights : ndarray, shape (n_frames,), or None
        Of the pelvis, in legs; None leaves it at height 0.
    cosines : ndarray, shape (n_frames, 12, n_dims)
        Of length 1; 0 for limbs that lack. What hangs on NaN is NaN.
    lengths : ndarray, shape (12,)
    skeleton : Skeleton
        Tells which limbs and landmarks there are.

    Returns
    -------
    ndarray, shape (n_frames, n_dims * n_landmarks)
        Of the landmarks of ``skeleton.body()``.
    """
    at = _chained(heights, cosines, lengths, skeleton.limbs)
    if heights is not None:
        legs = leg_length(lengths, skeleton.limbs)
        ankles = [f"{side}_ankle" for side in SIDES if f"{side}_leg" in skeleton.limbs]
        above = lowest([at[ankle] for ankle in ankles])
        # Where no ankle is seen, nothing tells the floor.
        down = 0 if np.isnan(above) else np.clip(above, -_MOVED * legs, _MOVED * legs)
        for side in SIDES:
            for joint in ("hip", "knee", "ankle"):
                at[f"{side}_{joint}"][:, 1] -= down
    return _joined(at, skeleton)


def matrix_of(lengths, skeleton):
    """The matrix (n_dims * n_landmarks, n_features) of the positions in heights and cosines.

    They are those that are ``built``, but for the move to the floor.
    """
    first, n_dims, limbs = int(skeleton.has_height), skeleton.n_dims, skeleton.limbs
    each = np.eye(first + n_dims * len(limbs))
    cosines = np.zeros((len(each), len(LIMBS), n_dims))
    cosines[:, places_of(limbs)] = each[:, first:].reshape(len(each), -1, n_dims)
    return _joined(_chained(each[:, 0] if first else None, cosines, lengths, limbs), skeleton).T


def _chained(heights, cosines, lengths, limbs):
    """Positions (n_frames, n_dims) by landmark, linear in heights and cosines."""
    limb = dict(zip(LIMBS, np.moveaxis(cosines * lengths[:, np.newaxis], 1, 0), strict=True))
    at = {"pelvis": np.zeros_like(limb["hip"])}
    if heights is not None:
        at["pelvis"][:, 1] = heights * leg_length(lengths, limbs)
    # What no limb joins to the pelvis starts where that is.
    at["neck"] = at["pelvis"] + limb["torso"]
    at["head"] = at["neck"] + limb["neck"]
    for side, sign in zip(SIDES, (0.5, -0.5), strict=True):
        at[f"{side}_hip"] = at["pelvis"] + sign * limb["hip"]
        at[f"{side}_shoulder"] = at["neck"] + sign * limb["shoulder"]
        for part in ("thigh", "leg", "arm", "forearm"):
            start, end, _, _ = LIMBS[f"{side}_{part}"]
            at[end] = at[start] + limb[f"{side}_{part}"]
    return at


def _joined(at, skeleton):
    joints = skeleton.body().joints
    return np.concatenate([at[name] for name in LANDMARKS if name in joints], axis=1)
