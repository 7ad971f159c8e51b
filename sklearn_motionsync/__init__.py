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


def __dir__():
    return sorted([*__all__, *_ROOMS, "__version__"])


def __getattr__(name):
    """Import a room when it is first asked for."""
    if name in _ROOMS:
        return import_module(f".{name}", __name__)
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
