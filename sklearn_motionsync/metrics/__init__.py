"""Measures of how well performances are synchronised, and scorers for grid searches."""

from .measures import (
    group_timing_error,
    inverse_consistency,
    keyframe_error,
    pause_share,
    roughness,
    timing_error,
)
from .phase import AmplitudePhase, amplitude_phase_variance
from .scorers import FeatureHoldoutScorer, SpreadScorer
from .spread import least_squares, pairwise_correlation, sobolev_least_squares

__all__ = [
    "AmplitudePhase",
    "FeatureHoldoutScorer",
    "SpreadScorer",
    "amplitude_phase_variance",
    "group_timing_error",
    "inverse_consistency",
    "keyframe_error",
    "least_squares",
    "pairwise_correlation",
    "pause_share",
    "roughness",
    "sobolev_least_squares",
    "timing_error",
]
