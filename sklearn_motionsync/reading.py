"""Performances that are read in parts, each checked once, so that few are in memory at a time."""

import numpy as np

from .gate import as_numbers
from .performances import Performances, check_performances
from .sequences import as_source
from .tables import INDEX_NAMES

__all__ = ["all_of", "parts_of_source"]

# Bytes of a number, at most.
_DOUBLE = 8
# A part ends with the performance that makes it so many bytes, or so many performances.
_BYTES, MANY = 1 << 25, 4096


def parts_of_source(estimator, X, on_rows):
    """The number of performances, and an iterator over checked parts; None if all are in memory.

    Parameters
    ----------
    estimator : fitted estimator
    X : performances of any kind
    on_rows : bool
        As for `check_performances`.
    """
    source = as_source(X)
    if source is None or len(source) == 0:
        return None
    return len(source), _read(estimator, source, on_rows)


def _read(estimator, source, on_rows):
    dtype = _dtype_of_maps(source)
    start, part, size = 0, [], 0
    for i in range(len(source)):
        part.append(source[i])
        size += _count(part[-1]) * _DOUBLE
        if size < _BYTES and len(part) < MANY and i + 1 < len(source):
            continue
        if dtype is None:
            dtype = as_numbers(part[0], "Performance 0").dtype
        how = {"on_rows": on_rows, "numbers": range(start, i + 1), "dtype": dtype}
        yield check_performances(estimator, part, reset=False, level="sequence", **how)
        start, part, size = i + 1, [], 0


def _count(x):
    """How many numbers; none of what is no array, and will be refused."""
    try:
        return int(np.prod(np.shape(x)))
    except ValueError:
        return 0


def _dtype_of_maps(source):
    """The precision of memory maps, which tell it unread; None of what has to be read."""
    kinds = {getattr(x, "dtype", None) for x in source} if isinstance(source, (list, tuple)) else ()
    kinds = {source.dtype} if isinstance(source, np.memmap) else kinds
    if not kinds:
        return None
    return np.dtype(np.float32 if kinds == {np.dtype(np.float32)} else np.float64)


def all_of(labels, levels, names):
    """What is known of performances that were read in parts: their labels, if they differ.

    Parameters
    ----------
    labels : list
    levels : set of tuple
        Those of the parts.
    names : ndarray of str or None
    """
    if len(levels) > 1 or len(set(labels)) < len(labels):
        labels, levels = list(range(len(labels))), {INDEX_NAMES}
    return Performances((), "list", labels, [], names, *levels)
