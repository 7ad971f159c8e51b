"""The one gate: whatever comes in from outside becomes numbers here, or is refused."""

import datetime
import math
import os
from numbers import Integral, Real

import numpy as np
import pandas as pd
from scipy.sparse import issparse

__all__ = [
    "as_numbers",
    "check_finite",
    "check_names",
    "check_squares",
    "is_integer",
    "names_of",
    "refuse",
]

_TIMES = (np.datetime64, np.timedelta64, datetime.date, datetime.time, datetime.timedelta)
_FILES = {"amc", "bvh", "c3d", "csv", "json", "npy", "npz", "parquet", "txt", "xlsx"}
_HELP = "; give numbers"
_HELP_FOR_TABLES = (
    "; give numbers. If it tells performances apart, to_sequences(df, by={0}, time=...) cuts the "
    "whole table; otherwise leave it out, x.drop(columns={0})"
)
_KEPT = np.dtype(np.float64), np.dtype(np.float32)
_SECONDS = "Give seconds as numbers, (t - t[0]) / np.timedelta64(1, 's')"


def as_numbers(values, what, *, dtype=None):
    """An array of real numbers of whatever was given, in single or double precision.

    Parameters
    ----------
    values : array-like, DataFrame or Series
    what : str
        What to call it in messages, with a capital letter.
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
        If it is text, dates, complex, masked, ragged, or beyond double precision.
    """
    # Nothing to refuse, and nothing to change.
    if type(values) is np.ndarray and values.dtype in _KEPT and dtype in (None, values.dtype):
        return values
    refuse(values, what)
    array = _as_array(values, what)
    if array.dtype.kind == "O":
        array = _from_objects(array, values, what)
    elif array.dtype.kind == "c":
        raise ValueError(
            f"{what}: complex data are not supported (Complex data not supported). Give the real "
            "and the imaginary part as two features."
        )
    elif array.dtype.kind not in "fbiu":
        raise ValueError(_not_numeric(values, what, f"it has the dtype {array.dtype}"))
    keeps = array.dtype == np.float32 and dtype is None
    return array if keeps else _cast(array, dtype or np.float64, what)


def refuse(values, what):
    """Refuse what would become numbers without being any: masked values, text, dates; and sparse.

    Parameters and errors are those of `as_numbers`.
    """
    if issparse(values):
        raise TypeError(f"{what} is a sparse matrix; use x.toarray().")
    if _is_masked(values):
        raise ValueError(
            f"{what} has masked values: interpolate the gaps, or drop what has them; "
            "x.filled(np.nan) makes them NaN."
        )
    if isinstance(values, (pd.DataFrame, pd.Series)):
        _refuse_columns(values, what)
    else:
        _refuse_items(values, what)


def _refuse_columns(table, what):
    for column in [table] if isinstance(table, pd.Series) else [c for _, c in table.items()]:
        which = f"{what}, column {column.name!r}," if column.name is not None else what
        if column.dtype.kind in "Mm" or isinstance(column.dtype, pd.PeriodDtype):
            raise ValueError(f"{which} holds dates or durations. {_SECONDS}.")
        if column.dtype.kind in "OSUT":
            help_ = _HELP if isinstance(table, pd.Series) else _HELP_FOR_TABLES
            _refuse_items(column.to_numpy(dtype=object), which, help_.format([column.name]))


def _refuse_items(values, what, help_=_HELP):
    """The same for arrays, and for lists in lists."""
    if isinstance(values, np.ndarray):
        kind = values.dtype.kind
        if kind in "Mm":
            raise ValueError(f"{what} holds dates or durations ({values.dtype}). {_SECONDS}.")
        if kind not in "OSU":
            return
        values = values.ravel().tolist() if kind != "O" else values.flat
    elif not isinstance(values, (list, tuple)):
        values = [values]
    for value in values:
        if isinstance(value, (str, bytes, os.PathLike)):
            raise ValueError(_not_numeric(value, what, _advice(value, help_)))
        if isinstance(value, _TIMES):
            kind = type(value).__name__
            raise ValueError(f"{what} holds dates or durations ({kind}). {_SECONDS}.")
        if isinstance(value, (list, tuple, np.ndarray)):
            _refuse_items(value, what, help_)


def _advice(text, advice):
    ending = str(text).rpartition(".")[2].lower()
    if isinstance(text, os.PathLike) or ending in _FILES:
        advice = "; read the files first, by read_motion(path), pandas.read_csv(path) or the like"
    return f"{str(text)[:60]!r}{advice}"


def _as_array(values, what):
    if isinstance(values, (pd.DataFrame, pd.Series)):
        return _from_pandas(values, what)
    try:
        return np.asarray(values)
    except (TypeError, ValueError) as error:
        raise ValueError(_not_numeric(values, what, str(error))) from error


def _from_pandas(values, what):
    """The array of a table; missing values of pandas' own types become NaN."""
    dtypes = {values.dtype} if isinstance(values, pd.Series) else set(values.dtypes)
    kinds = {dtype.kind for dtype in dtypes}
    # Categories are objects, too.
    if kinds & set("OSUT"):
        return values.to_numpy(dtype=object)
    if "c" in kinds or (len(dtypes) == 1 and isinstance(next(iter(dtypes)), np.dtype)):
        # No copy where there is one block of memory.
        return values.to_numpy()
    return _double(values)


def _double(values):
    return values.to_numpy(dtype=np.float64, na_value=np.nan)


def _is_masked(values):
    """Whether anything is masked, in lists of masked rows too."""
    if isinstance(values, np.ma.MaskedArray):
        return values is np.ma.masked or np.ma.is_masked(values)
    if isinstance(values, np.ndarray):
        return values.dtype == object and any(map(_is_masked, values.flat))
    return isinstance(values, (list, tuple)) and any(map(_is_masked, values))


def _from_objects(array, values, what):
    """Numbers of an array of Python objects."""
    try:
        return np.where(pd.isna(array), np.nan, array).astype(np.float64)
    except OverflowError as error:
        raise ValueError(_beyond(what)) from error
    except (TypeError, ValueError) as error:
        raise ValueError(_not_numeric(values, what, str(error))) from error


def _cast(array, dtype, what):
    with np.errstate(over="ignore"):
        out = array.astype(dtype, copy=False)
    if array.dtype.kind == "f" and array.dtype.itemsize > out.dtype.itemsize:
        lost = np.isinf(out) & np.isfinite(array)
        if lost.any():
            raise ValueError(_beyond(what, out.dtype))
    return out


def _beyond(what, dtype="double precision"):
    return f"{what} has numbers too large for {dtype}: use a larger unit."


def _not_numeric(values, what, reason):
    return f"{what} is not a numeric array: got {type(values).__name__}, {reason}."


def check_finite(array, where, names=None, frames=None, *, allow_nan=False):
    """Refuse NaN and infinity in (n_frames, n_features), naming the first one.

    Parameters
    ----------
    array : ndarray, shape (n_frames, n_features)
    where : str
        Up to the number of the frame, such as "Performance 3, frame".
    names, frames : list, default=None
        Names of the features, and labels of the frames.
    allow_nan : bool, default=False
        Refuse infinity only.
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
    advice = "Give NaN where nothing is known" if allow_nan else "Interpolate the gap"
    raise ValueError(
        f"{where} {frame}{label}, feature {feature}{name} is {kind}; the input must be finite. "
        f"{advice}, or drop the performance. (Input X contains NaN or infinity.)"
    )


def check_squares(values, squares, what):
    """Refuse data whose squares are beyond the range of their precision.

    Parameters
    ----------
    values : ndarray
        The data.
    squares : float
        Their variance, or the largest of several.
    what : str
        What they are squared for.
    """
    spread = np.ptp(values.astype(np.longdouble).reshape(-1, values.shape[-1]), axis=0).max()
    info = np.finfo(values.dtype)
    largest = np.abs(values).max()
    # Below this share of the values differences are rounding, and a variance of 0 is right.
    tells = spread > 64 * info.eps * largest
    if np.isfinite(squares) and (squares >= info.tiny or not tells):
        return
    precision = " or float64" if info.dtype == np.float32 else ""
    raise ValueError(
        f"The data differ by {float(spread):.2g}, so that their {what} are beyond {info.dtype}: "
        f"use another unit{precision}."
    )


def names_of(x):
    """The names of the columns of a table, of any type; None if they are only counted.

    Raises
    ------
    ValueError
        If only some names are text.
    """
    columns = getattr(x, "columns", None)
    if columns is None or callable(columns):
        return None
    names = list(columns)
    if names == list(range(len(names))) and not any(isinstance(c, bool) for c in names):
        return None
    texts = {isinstance(name, str) for name in names}
    if len(texts) > 1:
        raise ValueError(
            f"The columns {names[:6]} are named by text and by other things: scikit-learn knows "
            "columns by text only. Use df.columns = df.columns.astype(str)."
        )
    return names


def check_names(x, expected, what):
    """Refuse a table whose columns are named otherwise, or stand in another order, than expected.

    Parameters
    ----------
    x : anything
        What has no names is fine.
    expected : array-like or None
        None: no names are known.
    what : str
    """
    names = names_of(x)
    if names is None or expected is None or names == list(expected):
        return
    same = sorted(map(str, names)) == sorted(map(str, expected))
    raise ValueError(
        f"{what} has the columns {names[:8]}, expected are {list(expected)[:8]}. The feature names "
        "should match those that were passed during fit"
        + (", in the same order: select them by df[names]." if same else ".")
    )


def is_integer(value):
    """Whether a value is an integer, of an integer or a floating-point type, and no bool."""
    if isinstance(value, bool) or not isinstance(value, Real):
        return False
    return isinstance(value, Integral) or float(value).is_integer()
