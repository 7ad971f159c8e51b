"""Limits of synthetic performances: their parameters, and their size."""

from numbers import Real

from sklearn.utils._param_validation import Interval

# Ranges of the parameters that all makers have.
LIMITS = {
    "style": [Interval(Real, 0, 100, closed="both")],
    "warp": [Interval(Real, 0, 10, closed="both")],
    "noise": [Interval(Real, 0, 1000, closed="both")],
    "frame_rate": [Interval(Real, 0.001, 10**9, closed="both")],
    "random_state": ["random_state"],
}

# Bytes that a maker makes at most.
_LARGEST = 16e9


def check_size(maker, what, n_numbers, smaller):
    """Refuse so many numbers, with the memory they would take, before memory runs out."""
    n_bytes = 8 * n_numbers
    if n_bytes > _LARGEST:
        raise ValueError(
            f"{what} would take {n_bytes / 1e9:.0f} GB; {maker} makes up to "
            f"{_LARGEST / 1e9:.0f} GB. Give a smaller {smaller}."
        )
