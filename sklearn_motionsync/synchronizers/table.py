"""The timing of performances as a table, which calls them as they came in."""

import numpy as np
import pandas as pd

from ..sequences import as_collection, to_frame

__all__ = ["table_of_timing"]


def table_of_timing(columns, X, labels):
    """Columns over performance and frame of the pattern.

    Parameters
    ----------
    columns : dict of ndarray, shape (n_sequences, P)
        By name.
    X : performances, how many frames each has, or None
        Who knows what performances are called, and what their level of the index is.
    labels : sequence of length n_sequences, or None

    Returns
    -------
    DataFrame
    """
    is_frame = isinstance(X, pd.DataFrame)
    if is_frame and labels is None:
        labels = list(X.index.droplevel(-1).unique())
    tables = [
        pd.DataFrame(np.column_stack(of_one), columns=list(columns))
        for of_one in zip(*columns.values(), strict=True)
    ]
    for table, x in zip(tables, _with_attributes(X), strict=False):
        table.attrs.update(x.attrs)
    table = to_frame(tables, performances=labels)
    if is_frame and X.index.nlevels == table.index.nlevels:
        known = zip(X.index.names[:-1], table.index.names, strict=False)
        table.index.names = [*(name or usual for name, usual in known), table.index.names[-1]]
    return table


def _with_attributes(X):
    """The sequences of a collection that may know what they are called; none of anything else."""
    if X is None or (not hasattr(X, "columns") and all(np.ndim(n) == 0 for n in X)):
        return []
    return [x for x in as_collection(X) or [] if hasattr(x, "attrs")]
