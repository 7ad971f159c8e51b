"""Bodies built of the heights, directions and lengths of their limbs."""

import numpy as np

from .formats import LANDMARKS, SIDES
from .limbs import LIMBS, leg_length

__all__ = ["built"]

# How far the hips of a body may be moved from where its pelvis is, in leg lengths, so that it
# stands on the floor. Of 144 performances of optical motion capture, and of their approximations in
# an aSpace, none needs more than 0.21.
_MOVED = 0.25


def built(heights, cosines, lengths, skeleton):
    """Positions of bodies with given heights, directions and lengths of limbs.

    Parameters
    ----------
    heights : ndarray, shape (n_frames,), or None
        Of the pelvis, in legs; None leaves it at height 0.
    cosines : ndarray, shape (n_frames, 12, n_dims)
        Of length 1; 0 for limbs that lack.
    lengths : ndarray, shape (12,)
    skeleton : Skeleton
        Tells which limbs and landmarks there are.

    Returns
    -------
    ndarray, shape (n_frames, n_dims * n_landmarks)
        Of the landmarks of ``skeleton.body()``.
    """
    limbs = skeleton.limbs
    limb = dict(zip(LIMBS, np.moveaxis(cosines * lengths[:, np.newaxis], 1, 0), strict=True))
    at = {"pelvis": np.zeros_like(limb["hip"])}
    if heights is not None:
        legs = leg_length(lengths, limbs)
        at["pelvis"][:, 1] = heights * legs
    # What no limb joins to the pelvis starts where that is.
    at["neck"] = at["pelvis"] + limb["torso"]
    at["head"] = at["neck"] + limb["neck"]
    for side, sign in zip(SIDES, (0.5, -0.5), strict=True):
        at[f"{side}_hip"] = at["pelvis"] + sign * limb["hip"]
        at[f"{side}_shoulder"] = at["neck"] + sign * limb["shoulder"]
        for part in ("thigh", "leg", "arm", "forearm"):
            start, end, _, _ = LIMBS[f"{side}_{part}"]
            at[end] = at[start] + limb[f"{side}_{part}"]
    body = skeleton.body()
    if heights is not None:
        ankles = [f"{side}_ankle" for side in SIDES if f"{side}_leg" in limbs]
        above = min(at[ankle][:, 1].min() for ankle in ankles)
        for side in SIDES:
            for joint in ("hip", "knee", "ankle"):
                at[f"{side}_{joint}"][:, 1] -= np.clip(above, -_MOVED * legs, _MOVED * legs)
    return np.concatenate([at[name] for name in LANDMARKS if name in body.joints], axis=1)
