"""Long recordings cut into trials: cycles, and where an action happens.

`CycleSegmenter` cuts a take of a movement that repeats, `find_trials` searches a take for an action
that is known, and `self_correlation` tells how a take resembles itself after each lag.
"""

from .cycles import CycleSegmenter
from .search import find_trials
from .self_correlation import self_correlation

__all__ = [
    "CycleSegmenter",
    "find_trials",
    "self_correlation",
]
