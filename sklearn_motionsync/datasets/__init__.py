"""Trials to begin with: synthetic ones with known truth, and archives of real ones."""

from inspect import currentframe

from .archive import load_trials
from .bending import make_bending
from .gait import gait_csv, make_gait
from .walk import make_walk

__all__ = ["gait_csv", "load_trials", "make_bending", "make_gait", "make_walk"]


def __getattr__(name):
    """Name the new name of ``load_performances``; this goes when the first release is out."""
    if name == "load_performances":
        # As in the package: an import says what is wrong only if this is no AttributeError.
        is_import = currentframe().f_back.f_code.co_name == "_handle_fromlist"
        error = ImportError if is_import else AttributeError
        raise error(f"{__name__}.load_performances is {__name__}.load_trials now.")
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
