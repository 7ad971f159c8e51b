"""While a movement runs: its phase, and a body that is partly hidden.

`OnlineSynchronizer` tells frame by frame how far a movement has come, as a `LivePhase`.
`MotionTracker` follows poses through hidden limbs and noise, and answers with a `Track`.
"""

from .members import Track
from .stream import LivePhase
from .synchronizer import OnlineSynchronizer
from .tracker import MotionTracker

__all__ = [
    "LivePhase",
    "MotionTracker",
    "OnlineSynchronizer",
    "Track",
]
