"""Displays of what synchronizers and models did: compute once, draw as often as you like.

As in scikit-learn, ``from_estimator`` and ``from_predictions`` compute and draw, ``plot`` draws
again, and the artists stay on the display as attributes that end in an underscore.
matplotlib, in the extra ``plot``, is imported only when something is drawn.
"""

from .cycles import CycleDisplay
from .lags import LagDisplay
from .live import PhaseDisplay
from .metric import MetricDisplay
from .model import ActionModelDisplay
from .search import SearchDisplay
from .stick_figures import SkeletonDisplay
from .synchronization import SynchronizationDisplay
from .tracking import TrackingDisplay
from .trellis import TrellisDisplay

__all__ = [
    "ActionModelDisplay",
    "CycleDisplay",
    "LagDisplay",
    "MetricDisplay",
    "PhaseDisplay",
    "SearchDisplay",
    "SkeletonDisplay",
    "SynchronizationDisplay",
    "TrackingDisplay",
    "TrellisDisplay",
]
