"""Transformers of poses, frame by frame.

`ASpace` is the principal component analysis of poses (Eqs. 3 to 5), and `FrameWise` applies any
transformer of scikit-learn to the frames of all trials.
"""

from .aspace import ASpace
from .framewise import FrameWise

__all__ = [
    "ASpace",
    "FrameWise",
]
