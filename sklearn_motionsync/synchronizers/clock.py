"""Units of time that the clock of the pattern is told in, and frame rates."""

import numpy as np

from ..gate import as_numbers

__all__ = ["UNITS", "as_frame_rate", "as_unit"]

UNITS = ("frames", "percent", "seconds")


def as_unit(unit):
    """A unit of time by its name."""
    if not (isinstance(unit, str) and unit in UNITS):
        raise ValueError(f"unit must be one of {list(UNITS)}, got {unit!r}.")
    return unit


def as_frame_rate(frame_rate):
    """Frames a second: one number above 0, or one a performance."""
    rate = as_numbers(frame_rate, "frame_rate")
    sound = (rate > 0) & np.isfinite(rate)
    if rate.ndim > 1 or not sound.all():
        which = f" for performance {int(np.argmin(sound))}" if rate.ndim == 1 else ""
        raise ValueError(
            f"frame_rate must be one number above 0, or one a performance, got {frame_rate!r}"
            f"{which}."
        )
    return rate
