"""Motion capture files, read and written; gaps, events and tracked key-points."""

from .events import cut_at_events, keyframes_from_events
from .gaps import fill_gaps, find_gaps
from .motion import read_motion
from .poses import from_poses
from .writing import write_motion

__all__ = [
    "cut_at_events",
    "fill_gaps",
    "find_gaps",
    "from_poses",
    "keyframes_from_events",
    "read_motion",
    "write_motion",
]
