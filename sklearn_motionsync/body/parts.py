"""Parts of the body: arms, legs and trunk, and which features of a posture are theirs."""

import numpy as np

from .columns import AXES
from .limbs import LIMB_NAMES

__all__ = ["PARTS", "parts_of_limbs", "parts_of_names", "parts_of_postures"]

# Which limbs a part is made of. The height of the pelvis is of the body as a whole.
PARTS = {
    "left arm": ("left_arm", "left_forearm"),
    "right arm": ("right_arm", "right_forearm"),
    "left leg": ("left_thigh", "left_leg"),
    "right leg": ("right_thigh", "right_leg"),
    "trunk": ("hip", "torso", "shoulder", "neck"),
}
# How far squared lengths of three cosines may be from 1, on average over the frames: smoothing and
# resampling make them a little shorter.
_CLOSE = 0.05


def parts_of_limbs(limbs, n_dims, first):
    """Features of every part, by index, where limbs follow each other from feature ``first`` on."""
    at = {limb: range(first + i * n_dims, first + (i + 1) * n_dims) for i, limb in enumerate(limbs)}
    parts = {
        name: [k for limb in of_part if limb in at for k in at[limb]]
        for name, of_part in PARTS.items()
    }
    return {name: features for name, features in parts.items() if features}


def parts_of_names(names):
    """Features of every part, by index, of features some of which are called <limb>_<axis>.

    None if the trunk is all there is: then joints are called like its limbs, such as the neck.
    """
    split = [str(name).rpartition("_") for name in names]
    limb_of = [limb if axis in AXES[3] else None for limb, _, axis in split]
    parts = {
        name: [k for k, limb in enumerate(limb_of) if limb in of_part]
        for name, of_part in PARTS.items()
    }
    found = {name: features for name, features in parts.items() if features}
    return {} if [*found] == ["trunk"] else found


def parts_of_postures(performances):
    """Features of every part, by index, of postures without names; none of anything else.

    Postures of the whole body are told by what no other features are: a height, and the three
    cosines of twelve limbs, whose squares add up to 1.
    """
    n_limbs, n_dims = len(LIMB_NAMES), 3
    if performances[0].shape[1] != 1 + n_limbs * n_dims:
        return {}
    cosines = np.concatenate([x[:, 1:] for x in performances]).astype(np.float64)
    if not np.abs(cosines).max() < 1 + _CLOSE:
        return {}
    lengths = np.square(cosines.reshape(-1, n_limbs, n_dims)).sum(axis=2)
    are_directions = np.abs(lengths - 1).mean(axis=0) < _CLOSE
    return parts_of_limbs(LIMB_NAMES, n_dims, 1) if are_directions.all() else {}
