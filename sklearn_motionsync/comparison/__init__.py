"""Whether groups differ in shape or in timing, and whether a subject differs from a norm.

`compare_groups` tests aligned curves and their offsets by permutation, `compare_events` tests the
times of single events, and `compare_to_norm` compares one subject with the people of a norm.
"""

from .events import compare_events
from .groups import GroupComparison, compare_groups
from .norm import NormComparison, compare_to_norm

__all__ = [
    "GroupComparison",
    "NormComparison",
    "compare_events",
    "compare_groups",
    "compare_to_norm",
]
