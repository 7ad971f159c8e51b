"""Performances to begin with: synthetic ones with known truth, archives and files of real ones."""

from ._archive import load_performances
from ._bending import make_bending
from ._cmu import fetch_cmu
from ._events import cut_at_events
from ._gait import make_gait
from ._gaps import fill_gaps, find_gaps
from ._motion import read_motion
from ._poses import from_poses

__all__ = [
    "cut_at_events",
    "fetch_cmu",
    "fill_gaps",
    "find_gaps",
    "from_poses",
    "load_performances",
    "make_bending",
    "make_gait",
    "read_motion",
]
