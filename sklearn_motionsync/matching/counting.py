"""What is counted and chosen: numbers of frames, cuts and ties do not hang on the last bits.

Sums and products differ in their last bits from processor to processor. A length of 104.5 frames
may come out a little longer or shorter there, and of two equal values either one may be the larger.
So what is counted or chosen is decided here, with a tolerance.
"""

import numpy as np

# Values that differ by a smaller share are equal.
ROUNDING = 1e-9
# A value is a whole or a half number if it is this near to one; or, of a large one, if the share
# above of it is the difference.
_NEAR = 1e-6


def whole(values, way="nearest"):
    """Whole numbers of frames, cycles or other things, from values with fractions.

    A value that is a whole or a half number but for rounding counts as that number.

    Parameters
    ----------
    values : float, or array-like of float
        Finite.
    way : {"nearest", "down", "up"}, default="nearest"
        To the nearest whole number, from a half to the larger one; down to the largest one that is
        not above the value; or up to the smallest one that is not below it.

    Returns
    -------
    int, or ndarray of int
    """
    values = np.asarray(values, dtype=np.float64)
    halves = np.round(2 * values) / 2
    is_near = np.abs(values - halves) <= _NEAR + ROUNDING * np.abs(halves)
    values = np.where(is_near, halves, values)
    numbers = np.ceil(values) if way == "up" else np.floor(values + 0.5 * (way == "nearest"))
    return numbers.astype(np.intp) if numbers.ndim else int(numbers)


def first_smallest(values, rounding=None, axis=None):
    """The first index whose value is within rounding of the smallest.

    Parameters
    ----------
    values : array-like
        NaN is passed over.
    rounding : float, default=None
        The largest rounding of a value; by default the share 1e-9 of the smallest one.
    axis : int, default=None
        The axis that the index is of; by default that of the flattened values.

    Returns
    -------
    int, or ndarray of int
    """
    values = np.asarray(values)
    smallest = np.fmin.reduce(values, axis=axis, keepdims=True)
    if rounding is None:
        rounding = ROUNDING * np.abs(smallest)
    indices = (values <= smallest + rounding).argmax(axis=axis)
    return indices if indices.ndim else int(indices)


def first_largest(values, rounding=None, axis=None):
    """The first index whose value is within rounding of the largest, as `first_smallest`."""
    return first_smallest(np.negative(values), rounding, axis)


def parabola_vertex(before, here, after):
    """Where a parabola through a maximum and its neighbours has its vertex, and how high it is.

    Parameters
    ----------
    before, here, after : float or ndarray
        Values of a curve at three neighbouring samples, of which the middle one is a maximum.

    Returns
    -------
    offset, height : float or ndarray
        Samples from the middle one to the vertex, 0 where the three values lie on a straight line.
    """
    bend = before - 2 * here + after
    offset = np.where(bend < 0, (before - after) / np.where(bend < 0, 2 * bend, 1), 0.0)[()]
    return offset, here - bend * offset**2 / 2


def runs_of(mask):
    """The runs of True in a mask (n,): the first index of each, and the one after its last.

    Returns
    -------
    ndarray of int, shape (n_runs, 2)
    """
    return np.flatnonzero(np.diff(mask, prepend=False, append=False)).reshape(-1, 2)
