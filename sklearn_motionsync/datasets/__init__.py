"""Trials to begin with: synthetic ones with known truth, and archives of real ones."""

from .archive import load_trials
from .bending import make_bending
from .gait import gait_csv, make_gait
from .walk import make_walk

__all__ = ["gait_csv", "load_trials", "make_bending", "make_gait", "make_walk"]
