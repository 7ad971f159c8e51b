"""Performances to begin with: synthetic ones with known truth, and archives of real ones."""

# The readers are in ``io``; they can be imported from here, too.
from ..io import cut_at_events as cut_at_events
from ..io import fill_gaps as fill_gaps
from ..io import find_gaps as find_gaps
from ..io import from_poses as from_poses
from ..io import read_motion as read_motion
from .archive import load_performances
from .bending import make_bending
from .cmu import fetch_cmu
from .gait import make_gait
from .walk import make_walk

__all__ = ["fetch_cmu", "load_performances", "make_bending", "make_gait", "make_walk"]
