"""What comes in while tracking: takes and frames with gaps, and what of a posture they are."""

from typing import NamedTuple

import numpy as np
import pandas as pd

from ..gate import as_numbers, check_finite, check_names
from ..live.times import as_stamps
from ..sequences import as_collection
from ..tables import as_pandas, labels_of, name_performance

__all__ = ["Seen", "as_frame", "as_projection", "as_takes"]


class Seen(NamedTuple):
    """A take: observations (n_frames, n_observed), NaN where nothing is seen, and their times."""

    values: np.ndarray
    times: np.ndarray


def as_projection(projection, n_features):
    """What of a posture is observed: a matrix (n_observed, n_features) and an offset (n_observed,).

    Parameters
    ----------
    projection : array-like, tuple of two of them, or None
        A matrix; or it and the offset; None is all of the posture.
    n_features : int

    Returns
    -------
    matrix, offset : ndarray

    Raises
    ------
    ValueError
        If the matrix is not of this width, or anything is not finite, or there is not one offset
        for each of its rows.
    """
    if projection is None:
        return np.eye(n_features), np.zeros(n_features)
    if isinstance(projection, tuple) and len(projection) not in (1, 2):
        raise ValueError(
            "projection must be a matrix (n_observed, n_features), or the pair (matrix, offset); "
            f"got a tuple of {len(projection)}."
        )
    if isinstance(projection, list) and len({np.ndim(part) for part in projection}) > 1:
        raise ValueError(
            "projection must be a matrix (n_observed, n_features), or the tuple (matrix, offset); "
            "got a list of things of several dimensions."
        )
    pair = projection if isinstance(projection, tuple) else (projection,)
    matrix = as_numbers(pair[0], "The projection", dtype=np.float64)
    if matrix.ndim != 2 or matrix.shape[1] != n_features or len(matrix) == 0:
        raise ValueError(
            f"projection must be a matrix of shape (n_observed, {n_features}), as postures have "
            f"{n_features} features; got shape {matrix.shape}."
        )
    check_finite(matrix, "The projection, row")
    given = len(pair) == 2 and pair[1] is not None
    offset = pair[1] if given else np.zeros(len(matrix))
    offset = as_numbers(offset, "The offset", dtype=np.float64)
    if offset.shape != (len(matrix),):
        raise ValueError(
            f"The offset of a projection must have shape ({len(matrix)},), one number a row of the "
            f"matrix; got {offset.shape}."
        )
    check_finite(offset[np.newaxis], "The offset, row")
    return matrix, offset


def as_takes(X, times, names, on_rows, projection, frame_rate):
    """Takes of any kind, checked.

    Parameters
    ----------
    X : array-like (n_frames, n_observed), DataFrame, or collection of them
        With ``on_rows`` the rows of a 2-D array are takes of a single feature.
    times : array-like, shape (n_frames,); a list of them for a collection; or None
    names : list or None
        Names of the features of ``fit``, which are not those of a projection.
    on_rows : bool
    projection : matrix and offset
        The offset is taken away.
    frame_rate : float or None

    Returns
    -------
    list of Seen, bool
        And whether it was a single take.
    """
    sequences = as_collection(X)
    single = sequences is None and not on_rows
    if sequences is None:
        sequences = _takes_of_matrix(X, on_rows)
    if len(sequences) == 0:
        raise ValueError("Found 0 takes, at least 1 is needed.")
    called = ["The take"]
    if not single:
        called = [name_performance(*pair) for pair in enumerate(labels_of(sequences)[0])]
    times = [times] if single else _one_each(times, len(sequences))
    matrix, offset = projection
    takes = []
    for what, x, stamps in zip(called, sequences, times, strict=True):
        check_names(x, names, what)
        frames = x.index if isinstance(x, pd.DataFrame) else None
        values = _as_values(x, what, len(matrix))
        check_finite(values, f"{what}, frame", names, frames, allow_nan=True)
        takes.append(Seen(values - offset, as_stamps(stamps, len(values), frame_rate, what)))
    return takes, single


def as_frame(observation, time, names, projection, frame_rate, after):
    """One observation (n_observed,) less the offset, and its time, later than ``after``."""
    what, (matrix, offset) = "The observation", projection
    if isinstance(observation, pd.Series):
        check_names(observation.to_frame().T, names, what)
    values = as_numbers(observation, what, dtype=np.float64)
    if values.ndim == 0 and len(matrix) == 1:
        values = values[np.newaxis]
    if values.shape != (len(matrix),):
        raise ValueError(
            f"{what} has shape {values.shape}, expected ({len(matrix)},): one number a feature, "
            "NaN where it is not seen. For a whole take use track."
        )
    check_finite(values[np.newaxis], f"{what}, frame", names, allow_nan=True)
    (stamp,) = as_stamps(time, 1, frame_rate, what, after)
    return values - offset, float(stamp)


def _takes_of_matrix(X, on_rows):
    X = as_pandas(X)
    if not on_rows:
        return [X]
    rows = as_numbers(X, "The input", dtype=np.float64)
    if rows.ndim != 2:
        raise ValueError(
            f"Expected 2D array, one take a row, as in fit; got an array of shape {rows.shape}."
        )
    return list(rows[:, :, np.newaxis])


def _one_each(times, n):
    if times is None:
        return [None] * n
    given = len(times) if np.iterable(times) else "no"
    if given != n:
        raise ValueError(f"There are {n} takes, but {given} sequences of times: give one for each.")
    return list(times)


def _as_values(x, what, width):
    values = as_numbers(x, what, dtype=np.float64)
    if values.ndim != 2 or len(values) == 0:
        raise ValueError(
            f"{what} has shape {values.shape}, expected (n_frames, {width}) with at least 1 frame. "
            "Reshape your data: a single feature is a column, x[:, np.newaxis]."
        )
    if values.shape[1] != width:
        raise ValueError(
            f"{what} has {values.shape[1]} features a frame, expected are {width}. What is not "
            "seen is NaN; what is another measurement of the body needs a projection."
        )
    return values
