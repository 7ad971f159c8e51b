"""Array-likes become arrays of floats here; text, dates, masked and complex values are refused."""

import math
import os
import re
from datetime import date, time, timedelta
from numbers import Integral, Real

import numpy as np
import pandas as pd
from scipy.sparse import issparse

from ..matching.counting import ROUNDING

# The precisions that are kept.
FLOATS = np.dtype(np.float64), np.dtype(np.float32)
# Limits of the largest magnitude of a set of trials. In any unit of motion capture data lie
# far within; squares and fourth powers of such numbers neither overflow nor vanish.
SMALLEST, LARGEST = 1e-9, 1e9

_TIMES = np.datetime64, np.timedelta64, date, time, timedelta, pd.Period
_SECONDS = "Give seconds as numbers, (t - t[0]) / np.timedelta64(1, 's')"
_TEXT = (
    "Give numbers: pd.read_csv(path, decimal=',') reads decimal commas, skiprows=[1] leaves out a "
    "row of units, to_trials(df, by=..., time=...) takes columns that name the trial or the time, "
    "and pd.to_numeric(column, errors='coerce') makes other text NaN"
)
_ADVICE = "Interpolate the gap, as by sklearn_motionsync.io.fill_gaps(x, max_gap=10)"
# The name of a file, by its ending, which begins with a letter.
_FILE = re.compile(r".*\.[a-z]\w{1,4}", re.IGNORECASE | re.DOTALL)


def as_numbers(values, what, *, dtype=None) -> np.ndarray:
    """Convert an array-like to an array of real numbers in single or double precision.

    Parameters
    ----------
    values : array-like, DataFrame or Series
    what : str
        Its name in messages, with a capital letter.
    dtype : dtype, default=None
        By default float32 stays, and everything else becomes float64.

    Returns
    -------
    ndarray
        Of any shape; it may be a view of the input, and hold NaN.

    Raises
    ------
    TypeError
        If it is sparse.
    ValueError
        If it is text, dates, complex, masked or ragged.
    """
    if type(values) is np.ndarray and values.dtype in FLOATS and dtype in (None, values.dtype):
        return values
    refuse_non_numeric(values, what)
    try:
        is_pandas = isinstance(values, (pd.DataFrame, pd.Series))
        array = _array_of_pandas(values) if is_pandas else np.asarray(values)
        if array.dtype.kind == "O":
            array = np.where(pd.isna(array), np.nan, array).astype(np.float64)
    except (OverflowError, TypeError, ValueError) as error:
        raise ValueError(_not_numeric(values, what, str(error))) from error
    if array.dtype.kind == "c":
        raise ValueError(
            f"{what}: complex data are not supported (Complex data not supported). Give the real "
            "and the imaginary part as two features."
        )
    if array.dtype.kind not in "fbiu":
        raise ValueError(_not_numeric(values, what, f"it has the dtype {array.dtype}"))
    if array.dtype == np.float32 and dtype is None:
        return array
    # What is beyond the precision becomes infinite, which is refused later.
    with np.errstate(over="ignore"):
        return array.astype(dtype or np.float64, copy=False)


def _array_of_pandas(values):
    """The array of a table or column; missing values of pandas' own types become NaN."""
    dtypes = {values.dtype} if isinstance(values, pd.Series) else set(values.dtypes)
    kinds = {dtype.kind for dtype in dtypes}
    # Categories are objects, too.
    if kinds & set("OSUT"):
        return values.to_numpy(dtype=object)
    if "c" in kinds or (len(dtypes) == 1 and isinstance(next(iter(dtypes)), np.dtype)):
        # No copy where there is one block of memory.
        return values.to_numpy()
    return values.to_numpy(dtype=np.float64, na_value=np.nan)


def refuse_non_numeric(values, what):
    """Refuse sparse matrices, and what NumPy would convert silently: masked values, text, dates.

    Parameters and errors are those of `as_numbers`.
    """
    if issparse(values):
        raise TypeError(f"{what} is a sparse matrix; use x.toarray(), or sparse_output=False.")
    if _is_masked(values):
        raise ValueError(
            f"{what} has masked values: interpolate the gaps, or drop what has them; "
            "x.filled(np.nan) makes them NaN."
        )
    if isinstance(values, pd.Series):
        _refuse_column(values, what)
    elif isinstance(values, pd.DataFrame):
        for k, (name, dtype) in enumerate(values.dtypes.items()):
            # A column takes a copy of all attrs, so only those in question are taken.
            if dtype.kind not in "biufc":
                _refuse_column(values.iloc[:, k], f"{what}, column {name!r},")
    else:
        _refuse_items(values, what)


def _is_masked(values):
    """Whether anything is masked, in lists of masked rows too."""
    if isinstance(values, np.ma.MaskedArray):
        return values is np.ma.masked or np.ma.is_masked(values)
    if isinstance(values, np.ndarray):
        return values.dtype == object and any(map(_is_masked, values.flat))
    return isinstance(values, (list, tuple)) and any(map(_is_masked, values))


def _refuse_column(column, what):
    # Periods are objects, too.
    if column.dtype.kind in "OSUTMm":
        _refuse_items(column.to_numpy(dtype=object), what)


def _refuse_items(values, what):
    """Refuse text and dates in arrays, and in lists of lists."""
    if isinstance(values, np.ndarray):
        kind = values.dtype.kind
        if kind not in "OSUMm":
            return
        values = values.ravel().tolist() if kind in "SU" else values.ravel()
    elif not isinstance(values, (list, tuple)):
        values = [values]
    for value in values:
        if isinstance(value, (str, bytes, os.PathLike)):
            advice = _TEXT
            if isinstance(value, os.PathLike) or _FILE.fullmatch(str(value)):
                reader = "pd.read_csv" if str(value).endswith((".csv", ".txt")) else "read_motion"
                advice = f"Give what is in it: {reader}(path) reads files"
            raise ValueError(_not_numeric(value, what, f"{str(value)[:60]!r}. {advice}"))
        if isinstance(value, _TIMES):
            kind = type(value).__name__
            raise ValueError(f"{what} holds dates or durations ({kind}). {_SECONDS}.")
        if isinstance(value, (list, tuple, np.ndarray)):
            _refuse_items(value, what)


def _not_numeric(values, what, reason):
    if "inhomogeneous" in reason:
        reason = (
            "whose parts differ in length. Give every frame the same features; of events, such as "
            "times of spikes, make a rate at every frame"
        )
    return f"{what} is not a numeric array: got {type(values).__name__}, {reason}."


def check_finite(array, where, names=None, frames=None, *, allow_nan=False, advice=None):
    """Refuse NaN and infinity in (n_frames, n_features), naming the first one.

    Parameters
    ----------
    array : ndarray, shape (n_frames, n_features)
    where : str
        Up to the number of the frame, such as "Trial 3, frame".
    names, frames : list, default=None
        Names of the features, and labels of the frames.
    allow_nan : bool, default=False
        Refuse infinity only.
    advice : str, default=None
        What to do about NaN, instead of dropping the trial; by default to fill the gap.
    """
    # A sum is not finite if a term is not; no mask is made of a sound array.
    with np.errstate(over="ignore", invalid="ignore"):
        if math.isfinite(array.sum()) or np.isfinite(array).all():
            return
    bad = np.isinf(array) if allow_nan else ~np.isfinite(array)
    if not bad.any():
        return
    frame, feature = np.argwhere(bad)[0]
    kind = "NaN" if np.isnan(array[frame, feature]) else "infinity"
    label = "" if frames is None or frames[frame] == frame else f" ({frames[frame]})"
    name = "" if names is None else f" ({names[feature]!r})"
    advice = "Give NaN where nothing is known" if allow_nan else advice or _ADVICE
    raise ValueError(
        f"{where} {frame}{label}, feature {feature}{name} is {kind}; the input must be finite. "
        f"{advice}, or drop the trial. (Input X contains NaN or infinity.)"
    )


def check_magnitude(largest, what, *, training):
    """Refuse trials in a unit in which no movement is measured, by their largest absolute value.

    ``what`` is the trial that holds it. A set that is no whole training set may hold tiny values.
    """
    if largest > LARGEST or (training and 0 < largest < SMALLEST):
        raise ValueError(
            f"{what} holds the largest magnitude of all, {largest:.3g}. It must be between "
            f"{SMALLEST:g} and {LARGEST:g} unless all values are 0: give the data in another unit."
        )


def as_warps(times) -> np.ndarray:
    """Warps (n_sequences, P), from 0 to P - 1 but for rounding, which is taken off: a new array."""
    times = as_numbers(times, "times", dtype=np.float64)
    if times.ndim != 2 or times.shape[1] < 2:
        raise ValueError(
            "times must have shape (n_sequences, P), one row a trial and P at least 2, "
            f"got {times.shape}."
        )
    last = times.shape[1] - 1
    # Not a number fails the comparison, too.
    inside = (times >= -ROUNDING) & (times <= last + ROUNDING)
    if not inside.all():
        i, p = np.argwhere(~inside)[0]
        raise ValueError(
            f"Trial {i}: times must be from 0 to P - 1 = {last}, in frames of the clock, "
            f"got {times[i, p]:.10g} at frame {p}."
        )
    return np.clip(times, 0, last)


def column_names(x):
    """The names of the columns of a table, of any type; None if they are only numbered."""
    columns = getattr(x, "columns", None)
    if columns is None or callable(columns):
        return None
    names = list(columns)
    return None if names == list(range(len(names))) else names


def check_names(x, expected, what):
    """Refuse a table whose columns have other names, or another order, than expected.

    A table without names passes, as does any table where no names are expected.
    """
    names = column_names(x)
    if names is None or expected is None or names == list(expected):
        return
    raise ValueError(
        f"{what} has the columns {listed(names)}, expected are {listed(expected)}"
        f"{difference(names, expected)}. The feature names should match those that were passed "
        "during fit, in the same order: select them by df[names]."
    )


def difference(names, expected):
    """Which of the expected names a message says to lack, and which to be there besides."""
    names, expected = list(names or []), list(expected if expected is not None else [])
    lacks = [name for name in expected if name not in names]
    besides = [name for name in names if name not in expected]
    return (f"; it lacks {listed(lacks)}" if lacks else "") + (
        f"; it has besides {listed(besides)}" if besides else ""
    )


def listed(names):
    """Names as a message lists them: a few of many, and of long ones their beginning."""
    if names is None:
        return "None"
    shown, room = [], 36
    for name in map(repr, names):
        if len(name) > room:
            return f"[{', '.join([*shown, name[: max(room, 4)]])} ... {len(names)} in all]"
        shown, room = [*shown, name], room - len(name) - 2
    return f"[{', '.join(shown)}]"


def is_integer(value):
    """Whether a value is an integer, of an integer or a floating-point type, and no bool."""
    if isinstance(value, bool) or not isinstance(value, Real):
        return False
    return isinstance(value, Integral) or float(value).is_integer()


def nanmean(values, axis):
    """The mean of the values that are not NaN; NaN, without a warning, if all are."""
    seen = np.isfinite(values)
    count = seen.sum(axis=axis)
    total = np.where(seen, values, 0).sum(axis=axis)
    return np.where(count > 0, total / np.maximum(count, 1), np.nan)
