"""Several recordings of the same movement, on one clock.

>>> from sklearn.pipeline import make_pipeline
>>> from sklearn_motionsync import ActionModel, ASpace, DenseSynchronizer, DirectionCosines
>>> from sklearn_motionsync.datasets import make_bending
>>> bending = make_bending(random_state=0)
>>> pipe = make_pipeline(
...     DirectionCosines(bending.skeleton), ASpace(0.95), DenseSynchronizer(), ActionModel()
... ).fit(bending.data, actionmodel__groups=bending.actor)
>>> new = make_bending(2, random_state=1).data
>>> pipe.predict([*new, new[0][::-1]]).tolist()  # people not seen, and a bend backwards
[1, 1, -1]
"""

from . import datasets, display, metrics
from .aspace import ASpace
from .blending import blend_performances
from .body.direction_cosines import DirectionCosines
from .body.joint_positions import JointPositions
from .body.mirror import mirror
from .body.skeleton import Skeleton
from .display import (
    ActionModelDisplay,
    CycleDisplay,
    LagDisplay,
    MetricDisplay,
    SearchDisplay,
    SkeletonDisplay,
    SynchronizationDisplay,
    TrellisDisplay,
)
from .framewise import FrameWise
from .live.online import OnlineSynchronizer
from .live.stream import LivePhase
from .long_tables import to_sequences
from .model.action_model import ActionModel
from .model.departures import find_departures
from .model.detector import ActionDetector
from .recognition import ActionClassifier, synchronization_distances
from .sequences import to_frame
from .synchronizers.base import Synchronizer
from .synchronizers.dense import DenseSynchronizer
from .synchronizers.keyframes import KeyframeSynchronizer
from .synchronizers.lags import Lags
from .synchronizers.linear import LinearSynchronizer
from .synchronizers.match import Match
from .synchronizers.parts import PartSynchronizer
from .synchronizers.timing import TimingChannel
from .takes.cycles import CycleSegmenter
from .takes.search import find_performances
from .takes.self_correlation import self_correlation
from .tracking.track import Track
from .tracking.tracker import MotionTracker

__version__ = "0.1.0.dev0"

__all__ = [
    "ASpace",
    "ActionClassifier",
    "ActionDetector",
    "ActionModel",
    "ActionModelDisplay",
    "CycleDisplay",
    "CycleSegmenter",
    "DenseSynchronizer",
    "DirectionCosines",
    "FrameWise",
    "JointPositions",
    "KeyframeSynchronizer",
    "LagDisplay",
    "Lags",
    "LinearSynchronizer",
    "LivePhase",
    "Match",
    "MetricDisplay",
    "MotionTracker",
    "OnlineSynchronizer",
    "PartSynchronizer",
    "SearchDisplay",
    "Skeleton",
    "SkeletonDisplay",
    "SynchronizationDisplay",
    "Synchronizer",
    "TimingChannel",
    "Track",
    "TrellisDisplay",
    "blend_performances",
    "datasets",
    "display",
    "find_departures",
    "find_performances",
    "metrics",
    "mirror",
    "self_correlation",
    "synchronization_distances",
    "to_frame",
    "to_sequences",
]
