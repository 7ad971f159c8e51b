"""The one gate: whatever comes in from outside becomes numbers here, or is refused."""

import datetime

import numpy as np
import pandas as pd
from scipy.sparse import issparse

__all__ = ["as_numbers", "check_finite", "check_names", "names_of"]

_TIMES = (np.datetime64, np.timedelta64, datetime.date, datetime.time, datetime.timedelta)
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
    if issparse(values):
        raise TypeError(f"{what} is a sparse matrix; use x.toarray().")
    if _is_masked(values):
        raise ValueError(
            f"{what} has masked values: interpolate the gaps, or drop what has them; "
            "x.filled(np.nan) makes them NaN."
        )
    array = _as_array(values, what)
    kind = array.dtype.kind
    if kind == "O":
        array = _from_objects(array, values, what)
    elif kind in "Mm":
        raise ValueError(f"{what} holds dates or durations ({array.dtype}). {_SECONDS}.")
    elif kind == "c":
        raise ValueError(
            f"{what}: complex data are not supported (Complex data not supported). Give the real "
            "and the imaginary part as two features."
        )
    elif kind not in "fbiu":
        raise ValueError(_not_numeric(values, what, f"it holds {_example(array)}"))
    keeps = array.dtype == np.float32 and dtype is None
    return array if keeps else _cast(array, dtype or np.float64, what)


def _as_array(values, what):
    if isinstance(values, (pd.DataFrame, pd.Series)):
        return _from_pandas(values, what)
    try:
        return np.asarray(values)
    except (TypeError, ValueError) as error:
        raise ValueError(_not_numeric(values, what, str(error))) from error


def _from_pandas(values, what):
    """The array of a table; missing values of pandas' own types become NaN."""
    columns = [values] if isinstance(values, pd.Series) else [c for _, c in values.items()]
    for column in columns:
        if column.dtype.kind in "Mm" or isinstance(column.dtype, pd.PeriodDtype):
            which = f", column {column.name!r}," if column.name is not None else ""
            raise ValueError(f"{what}{which} holds dates or durations. {_SECONDS}.")
        if column.dtype.kind in "OSUT" or isinstance(column.dtype, pd.CategoricalDtype):
            return values.to_numpy(dtype=object)
    if any(column.dtype.kind == "c" for column in columns):
        return values.to_numpy()
    if not columns:
        return np.empty(values.shape)
    single = all(column.dtype == np.float32 for column in columns)
    if all(isinstance(column.dtype, np.dtype) for column in columns):
        # No copy where there is one block of memory.
        return values.to_numpy() if single or len(set(_dtypes(columns))) == 1 else _double(values)
    return _double(values)


def _dtypes(columns):
    return [column.dtype for column in columns]


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
    """Numbers of an array of Python objects, none of which only looks like one."""
    for value in array.flat:
        if isinstance(value, (str, bytes)):
            raise ValueError(_not_numeric(values, what, f"it holds the text {_example(array)}"))
        if isinstance(value, _TIMES):
            kind = type(value).__name__
            raise ValueError(f"{what} holds dates or durations ({kind}). {_SECONDS}.")
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


def _example(array):
    text = next((v for v in array.flat if isinstance(v, (str, bytes))), None)
    if text is None:
        return f"the dtype {array.dtype}"
    advice = ""
    if str(text).rpartition(".")[2].lower() in ("bvh", "amc", "c3d", "csv", "npz", "txt", "npy"):
        advice = ": read the files first, such as by read_motion(path)"
    return f"{str(text)[:40]!r}{advice}"


def check_finite(array, where, names=None, frames=None):
    """Refuse NaN and infinity in (n_frames, n_features), naming the first one.

    Parameters
    ----------
    array : ndarray, shape (n_frames, n_features)
    where : str
        Up to the number of the frame, such as "Performance 3, frame".
    names, frames : list, default=None
        Names of the features, and labels of the frames.
    """
    # A sum is not finite if a term is not; no mask is made of a sound array.
    with np.errstate(over="ignore", invalid="ignore"):
        if np.isfinite(array.sum()) or np.isfinite(array).all():
            return
    frame, feature = np.argwhere(~np.isfinite(array))[0]
    kind = "NaN" if np.isnan(array[frame, feature]) else "infinity"
    label = "" if frames is None or frames[frame] == frame else f" ({frames[frame]})"
    name = "" if names is None else f" ({names[feature]!r})"
    raise ValueError(
        f"{where} {frame}{label}, feature {feature}{name} is {kind}; the input must be finite. "
        "Interpolate the gap, or drop the performance. (Input X contains NaN or infinity.)"
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
