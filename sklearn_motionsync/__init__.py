"""Repeated trials of one movement, aligned in time.

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

from . import datasets, display, io, metrics
from .body.direction_cosines import DirectionCosines
from .body.joint_noise import JointNoise
from .body.joint_positions import JointPositions
from .body.mirror import mirror
from .body.skeleton import Skeleton
from .comparison.events import compare_events
from .comparison.groups import GroupComparison, compare_groups
from .comparison.norm import NormComparison, compare_to_norm
from .gait.events import gait_events
from .gait.parameters import gait_parameters
from .inputs.long_tables import to_frame, to_trials
from .model.action_model import ActionModel
from .model.departures import find_departures
from .model.detector import ActionDetector
from .online.members import Track
from .online.stream import LivePhase
from .online.synchronizer import OnlineSynchronizer
from .online.tracker import MotionTracker
from .recognition import ActionClassifier, synchronization_distances
from .report.player import write_player
from .report.report import write_report
from .segmentation.cycles import CycleSegmenter
from .segmentation.search import find_trials
from .segmentation.self_correlation import self_correlation
from .synchronizers.base import Synchronizer
from .synchronizers.blending import blend_trials
from .synchronizers.dense import DenseSynchronizer
from .synchronizers.learning import SynchronizationWarning
from .synchronizers.linear import LinearSynchronizer
from .synchronizers.match import Match
from .synchronizers.parts import Lags, PartSynchronizer
from .synchronizers.timing import TimingChannel
from .transformers.aspace import ASpace
from .transformers.framewise import FrameWise

__all__ = [
    "ASpace",
    "ActionClassifier",
    "ActionDetector",
    "ActionModel",
    "CycleSegmenter",
    "DenseSynchronizer",
    "DirectionCosines",
    "FrameWise",
    "GroupComparison",
    "JointNoise",
    "JointPositions",
    "Lags",
    "LinearSynchronizer",
    "LivePhase",
    "Match",
    "MotionTracker",
    "NormComparison",
    "OnlineSynchronizer",
    "PartSynchronizer",
    "Skeleton",
    "SynchronizationWarning",
    "Synchronizer",
    "TimingChannel",
    "Track",
    "blend_trials",
    "compare_events",
    "compare_groups",
    "compare_to_norm",
    "datasets",
    "display",
    "find_departures",
    "find_trials",
    "gait_events",
    "gait_parameters",
    "io",
    "metrics",
    "mirror",
    "self_correlation",
    "synchronization_distances",
    "to_frame",
    "to_trials",
    "write_player",
    "write_report",
]

# The displays are named in ``display``; they can be imported from here, too.
from .display import ActionModelDisplay as ActionModelDisplay
from .display import CycleDisplay as CycleDisplay
from .display import GaitDisplay as GaitDisplay
from .display import GroupDisplay as GroupDisplay
from .display import LagDisplay as LagDisplay
from .display import MetricDisplay as MetricDisplay
from .display import NormDisplay as NormDisplay
from .display import PhaseDisplay as PhaseDisplay
from .display import SearchDisplay as SearchDisplay
from .display import SkeletonDisplay as SkeletonDisplay
from .display import SynchronizationDisplay as SynchronizationDisplay
from .display import TrackingDisplay as TrackingDisplay
from .display import TrellisDisplay as TrellisDisplay

__version__ = "0.1.0"
