"""Limits of what is made: parameters of synthetic performances, and their size."""

from numbers import Integral

# What is made at once at most, in bytes.
_LARGEST = 16e9


def check_parameters(maker, parameters):
    """Refuse what is no number of its kind, or out of its range.

    Parameters are ``(name, value, kind, least, most)``, kind being Integral or Real.
    """
    for name, value, kind, least, most in parameters:
        number = isinstance(value, kind) and not isinstance(value, bool)
        if not number or not least <= value <= most:
            what = "a whole number" if kind is Integral else "a number"
            raise ValueError(
                f"The '{name}' parameter of {maker} must be {what} from {least} to "
                f"{most}, got {value!r}."
            )


def check_size(maker, what, n_numbers, smaller):
    """Say what so many numbers would take before memory runs out."""
    n_bytes = 8 * n_numbers
    if n_bytes > _LARGEST:
        raise ValueError(
            f"{what} would take {n_bytes / 1e9:.0f} GB; {maker} makes up to "
            f"{_LARGEST / 1e9:.0f} GB. Give a smaller {smaller}."
        )
