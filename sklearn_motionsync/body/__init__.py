"""The body: skeletons, the joints of the paper, and poses as direction cosines (Eq. 1).

A `Skeleton` names joints and limbs, `DirectionCosines` turns joint positions into poses that do not
depend on place, facing and size, and `JointPositions` turns poses back. `mirror` exchanges left and
right, and `JointNoise` tells how exactly the joints were measured.
"""

from .direction_cosines import DirectionCosines
from .joint_noise import JointNoise
from .joint_positions import JointPositions
from .mirror import mirror
from .skeleton import Skeleton

__all__ = [
    "DirectionCosines",
    "JointNoise",
    "JointPositions",
    "Skeleton",
    "mirror",
]
