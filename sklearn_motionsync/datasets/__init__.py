"""Trials to begin with: synthetic ones with known truth, and archives of real ones."""

from ..utils.parameters import error_of_old_name
from .archive import load_trials
from .bending import make_bending
from .gait import gait_csv, make_gait
from .walk import make_walk

__all__ = ["gait_csv", "load_trials", "make_bending", "make_gait", "make_walk"]


def __getattr__(name):
    """Name the new name of ``load_performances``; this goes when the first release is out."""
    if name == "load_performances":
        raise error_of_old_name(f"{__name__}.{name}", f"{__name__}.load_trials")
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
