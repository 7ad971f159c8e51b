"""Performances as other packages keep them: nested tables, and labelled arrays of xarray.

A nested table has a row a performance and a column a feature, and each of its cells is a series, as
in sktime. A labelled array has names for its dimensions, and labels along them.
"""

import numpy as np
import pandas as pd

from .tables import FRAME, as_pandas, labelled, labels_given

__all__ = ["as_table", "check_dimensions", "is_labelled_array", "is_nested", "split_nested"]

# Names of the dimension of frames.
_TIMES = ("time", "frame")


def is_nested(df):
    """Whether the first cell of a table is a series."""
    if df.shape[0] == 0 or df.shape[1] == 0 or df.dtypes.iloc[0].kind != "O":
        return False
    return np.ndim(df.iat[0, 0]) == 1


def split_nested(df):
    """The performances of a nested table.

    Raises
    ------
    ValueError
        If a cell is no series, or the cells of a row differ in length or in frames.
    """
    labels, levels = labels_given(df.index)
    sequences = []
    for label, row in zip(labels, df.to_numpy(dtype=object), strict=True):
        frames = [getattr(cell, "index", None) for cell in row]
        first = frames[0] if isinstance(frames[0], pd.Index) else pd.RangeIndex(len(row[0]))
        for name, cell, index in zip(df.columns, row, frames, strict=True):
            if np.ndim(cell) != 1:
                raise ValueError(
                    f"Column {name!r} of performance {label!r} holds {cell!r:.60}, and others "
                    f"hold a series: leave it out, as in df.drop(columns=[{name!r}])."
                )
            if len(cell) != len(first) or (isinstance(index, pd.Index) and not index.equals(first)):
                raise ValueError(
                    f"Column {name!r} of performance {label!r} has {len(cell)} frames, which are "
                    f"not the {len(first)} frames of column {df.columns[0]!r}: resample them to "
                    "the same frames."
                )
        # Each column keeps its type; their names may be of any type.
        x = pd.DataFrame({k: np.asarray(cell) for k, cell in enumerate(row)}, index=first)
        x.columns = df.columns
        sequences.append(labelled(x, label, (*levels, first.name or FRAME), df.attrs))
    return sequences


def is_labelled_array(x):
    """Whether it is a DataArray of xarray."""
    kind = type(x)
    return (kind.__module__.partition(".")[0], kind.__name__) == ("xarray", "DataArray")


def as_table(x):
    """One performance of polars or xarray as a table of pandas; anything else as it is.

    The frames of an array lie along its dimension "time" or "frame", else along the first. Its
    coordinates name rows and columns, and those of a single value are its label.
    """
    if not is_labelled_array(x) or x.ndim != 2:
        return as_pandas(x)
    frames = next((dim for dim in _TIMES if dim in x.dims), x.dims[0])
    x = x.transpose(frames, ...)
    rows, columns = (
        x.indexes[dim] if dim in x.indexes else pd.RangeIndex(n, name=dim)
        for dim, n in zip(x.dims, x.shape, strict=True)
    )
    columns = columns.set_names([None] * columns.nlevels)
    table = pd.DataFrame(x.values, index=rows, columns=columns)
    table.attrs = dict(x.attrs)
    levels = {name: value.item() for name, value in x.coords.items() if value.ndim == 0}
    # Of several levels there is a tuple beside its items.
    levels = {name: value for name, value in levels.items() if not isinstance(value, tuple)}
    if not levels:
        return table
    label = tuple(levels.values()) if len(levels) > 1 else next(iter(levels.values()))
    return labelled(table, label, (*levels, frames), table.attrs)


def check_dimensions(x):
    """Refuse a 3-D DataArray whose first dimension is that of the frames."""
    if is_labelled_array(x) and x.dims[0] in _TIMES:
        time, second, third = x.dims
        raise ValueError(
            f"The dimensions of the DataArray are {x.dims}, and the first tells performances "
            f"apart: give X.transpose({second!r}, {time!r}, {third!r})."
        )
