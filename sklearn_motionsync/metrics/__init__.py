"""Measures of how well trials are synchronised, and scorers for grid searches."""

from .measures import group_timing_error, keyframe_error
from .scorers import FeatureHoldoutScorer, SpreadScorer
from .spread import least_squares

__all__ = [
    "FeatureHoldoutScorer",
    "SpreadScorer",
    "group_timing_error",
    "keyframe_error",
    "least_squares",
]
