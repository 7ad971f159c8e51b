"""Whether groups differ in shape or in timing, and whether a subject differs from a norm.

`compare_groups` tests aligned curves and their offsets by permutation, `compare_effects` each
effect of several factors, `compare_events` the times of single events, and `compare_to_norm`
compares one subject with the people of a norm. `plan_study` tells how many people a study needs.
"""

from .effects import compare_effects
from .events import compare_events
from .groups import GroupComparison, compare_groups
from .norm import NormComparison, compare_to_norm
from .planning import plan_study

__all__ = [
    "GroupComparison",
    "NormComparison",
    "compare_effects",
    "compare_events",
    "compare_groups",
    "compare_to_norm",
    "plan_study",
]
