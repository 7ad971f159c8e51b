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

from importlib import import_module

from .body.direction_cosines import DirectionCosines
from .body.joint_positions import JointPositions
from .body.skeleton import Skeleton
from .inputs.findings import TrialWarning, check_trials, mend_trials
from .inputs.long_tables import to_frame, to_trials
from .model.action_model import ActionModel
from .model.detector import ActionDetector
from .recognition.classifier import ActionClassifier
from .synchronizers.dense import DenseSynchronizer
from .synchronizers.learning import SynchronizationWarning
from .synchronizers.linear import LinearSynchronizer
from .synchronizers.match import Match
from .synchronizers.parts import PartSynchronizer
from .synchronizers.timing import TimingChannel
from .transformers.aspace import ASpace
from .transformers.framewise import FrameWise
from .utils.parameters import error_of_old_name

__all__ = [
    "ASpace",
    "ActionClassifier",
    "ActionDetector",
    "ActionModel",
    "DenseSynchronizer",
    "DirectionCosines",
    "FrameWise",
    "JointPositions",
    "LinearSynchronizer",
    "Match",
    "PartSynchronizer",
    "Skeleton",
    "SynchronizationWarning",
    "TimingChannel",
    "TrialWarning",
    "check_trials",
    "mend_trials",
    "to_frame",
    "to_trials",
]

__version__ = "0.1.0"

_ROOMS = {
    "body",
    "comparison",
    "datasets",
    "display",
    "gait",
    "io",
    "live",
    "metrics",
    "model",
    "recognition",
    "report",
    "synchronizers",
    "takes",
    "transformers",
}

# Where names are that were here before the first release. These lines go when it is out.
_NOW = {
    "ActionModelDisplay": "display.ActionModelDisplay",
    "CycleDisplay": "display.CycleDisplay",
    "CycleSegmenter": "takes.CycleSegmenter",
    "GaitDisplay": "display.GaitDisplay",
    "GroupComparison": "comparison.GroupComparison",
    "GroupDisplay": "display.GroupDisplay",
    "JointNoise": "body.JointNoise",
    "LagDisplay": "display.LagDisplay",
    "Lags": "synchronizers.Lags",
    "LivePhase": "live.LivePhase",
    "MotionTracker": "live.MotionTracker",
    "NormComparison": "comparison.NormComparison",
    "NormDisplay": "display.NormDisplay",
    "OnlineSynchronizer": "live.OnlineSynchronizer",
    "PhaseDisplay": "display.PhaseDisplay",
    "SearchDisplay": "display.SearchDisplay",
    "SkeletonDisplay": "display.SkeletonDisplay",
    "SynchronizationDisplay": "display.SynchronizationDisplay",
    "Synchronizer": "synchronizers.Synchronizer",
    "Track": "live.Track",
    "TrackingDisplay": "display.TrackingDisplay",
    "TrellisDisplay": "display.TrellisDisplay",
    "blend_performances": "synchronizers.blend_trials",
    "blend_trials": "synchronizers.blend_trials",
    "compare_events": "comparison.compare_events",
    "compare_groups": "comparison.compare_groups",
    "compare_to_norm": "comparison.compare_to_norm",
    "find_departures": "model.find_departures",
    "find_performances": "takes.find_trials",
    "find_trials": "takes.find_trials",
    "gait_events": "gait.gait_events",
    "gait_parameters": "gait.gait_parameters",
    "mirror": "body.mirror",
    "online": "live",
    "segmentation": "takes",
    "self_correlation": "takes.self_correlation",
    "synchronization_distances": "recognition.synchronization_distances",
    "to_sequences": "to_trials",
    "write_player": "report.write_player",
    "write_report": "report.write_report",
}


def __dir__():
    return sorted([*__all__, *_ROOMS, "__version__"])


def __getattr__(name):
    """Import a room when it is first asked for, and name the new place of a name from before."""
    if name in _ROOMS:
        return import_module(f".{name}", __name__)
    if name in _NOW:
        raise error_of_old_name(f"{__name__}.{name}", f"{__name__}.{_NOW[name]}")
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
