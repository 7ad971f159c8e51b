"""Displays of synchronizers, models and trackers: computed once, drawn any number of times.

As in scikit-learn, ``from_estimator`` checks its arguments, computes and draws, and ``plot`` draws
again. What is drawn are attributes, and the artists are those with a trailing underscore.
matplotlib, in the extra ``plot``, is imported on drawing.
"""

from .cycles import CycleDisplay
from .gait import GaitDisplay
from .groups import GroupDisplay, NormDisplay
from .lags import LagDisplay
from .live import PhaseDisplay
from .model import ActionModelDisplay
from .search import SearchDisplay
from .stick_figures import SkeletonDisplay
from .synchronization import SynchronizationDisplay
from .tracking import TrackingDisplay
from .trellis import TrellisDisplay

__all__ = [
    "ActionModelDisplay",
    "CycleDisplay",
    "GaitDisplay",
    "GroupDisplay",
    "LagDisplay",
    "NormDisplay",
    "PhaseDisplay",
    "SearchDisplay",
    "SkeletonDisplay",
    "SynchronizationDisplay",
    "TrackingDisplay",
    "TrellisDisplay",
]
