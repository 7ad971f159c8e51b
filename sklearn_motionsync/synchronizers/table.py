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
        Who may know what performances are called.
    labels : sequence of length n_sequences, Index, or None

    Returns
    -------
    DataFrame
    """
    tables = [
        pd.DataFrame(np.column_stack(of_one), columns=list(columns))
        for of_one in zip(*columns.values(), strict=True)
    ]
    return to_frame(tables, performances=_labels_of(X) if labels is None else labels)


def _labels_of(X):
    """What performances are called, or tables which may know it; None if nobody does."""
    if isinstance(X, pd.Series):
        is_numbered = isinstance(X.index, pd.RangeIndex) or not X.index.is_unique
        return None if is_numbered else X.index
    if X is None or (not hasattr(X, "columns") and all(np.ndim(n) == 0 for n in X)):
        return None
    sequences = as_collection(X)
    are_tables = sequences and all(isinstance(x, pd.DataFrame) for x in sequences)
    return sequences if are_tables else None
