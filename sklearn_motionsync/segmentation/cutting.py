"""Performances cut out of takes, and where in which take they come from."""

import numpy as np
import pandas as pd

from ..inputs.collections import as_collection
from ..inputs.tables import FRAME, label_of_part, own_label

__all__ = ["cut_takes"]

# Level of the labels of takes that have none.
_TAKE = "take"


def cut_takes(X, performances, rows):
    """Cut performances out of takes.

    Parameters
    ----------
    X : list of arrays (n_frames_i, n_features), or any collection
        The takes as they were given, so that the parts are of the same kind: DataFrames keep
        columns and ``attrs``.
    performances : Performances
        The same, checked.
    rows : DataFrame
        One row a performance: ``take``, its index in ``X``; ``start`` and ``stop``, whole frames
        of the take, the last of which is excluded; and more.

    Returns
    -------
    performances : list of array, or of DataFrame, (n_frames_i, n_features)
        In the order of ``rows``. Parts of DataFrames are called by the label of the take and their
        number in it, by time, and indexed from 0.
    origin : DataFrame
        ``rows``, with the labels of the takes in place of their indices; row ``i`` is that of
        performance ``i``.
    """
    given = as_collection(X)
    takes = list(performances if given is None else given)
    counts = rows.groupby("take")["start"].rank(method="first").astype(int).to_numpy() - 1
    parts = []
    for take, start, stop, number in zip(
        rows["take"], rows["start"], rows["stop"], counts, strict=True
    ):
        source, array = takes[take], performances[take]
        if isinstance(source, pd.DataFrame):
            rows_of_part, label = slice(start, stop), performances.labels[take]
            parts.append(_part_of_table(source, rows_of_part, label, int(number)))
        else:
            parts.append(array[start:stop].copy())
    labels = np.empty(len(rows), dtype=object)
    labels[:] = [performances.labels[take] for take in rows["take"]]
    return parts, rows.assign(take=pd.Series(labels, index=rows.index).infer_objects())


def _part_of_table(df, rows, take, number):
    part = df.iloc[rows]
    part = part.set_axis(pd.RangeIndex(len(part), name=FRAME))
    label, levels = own_label(df)
    names = (_TAKE,) if label is None else levels
    part.attrs = df.attrs | label_of_part(take, number, "part", (*names, FRAME))
    return part
