"""Performances to begin with: synthetic ones with known truth, and archives of real ones."""

from ._archive import load_performances
from ._bending import make_bending

__all__ = ["load_performances", "make_bending"]
