"""Takes, and trials that are cut out of them."""

import numpy as np
import pandas as pd

from ..inputs.collections import as_collection
from ..inputs.numbers import as_numbers
from ..inputs.recorded import Recorded
from ..inputs.tables import FRAME, as_pandas, label_of_part, own_label


def as_takes(X, *, univariate=False):
    """A collection of takes; a single take (n_frames, n_features) as a list of one.

    With ``univariate`` a one-dimensional array is a take of a single feature.
    """
    X = as_pandas(X)
    if as_collection(X) is not None:
        return X
    if isinstance(X, pd.DataFrame):
        return [X]
    take = as_numbers(X, "The take")
    if univariate and take.ndim == 1:
        take = take[:, np.newaxis]
    if take.ndim != 2:
        raise ValueError(
            f"Expected 2D array, one take (n_frames, n_features), or a list of takes; got an array "
            f"of shape {take.shape}. A single feature is a column, x[:, np.newaxis]."
        )
    return [take]


def cut_takes(X, trials, rows):
    """Cut trials out of takes.

    Parameters
    ----------
    X : list of arrays (n_frames_i, n_features), or any collection
        The takes as they were given: DataFrames keep columns and ``attrs``, which are
        moved to the frames of the trial.
    trials : Trials
        The same, checked.
    rows : DataFrame
        One row a trial: ``take``, its index in ``X``; ``start`` and ``stop``, whole frames
        of the take, ``stop`` excluded; and other columns.

    Returns
    -------
    trials : list of array, or of DataFrame, (n_frames_i, n_features)
        In the order of ``rows``. Those of DataFrames are indexed from 0, and labelled by the label
        of the take and their number in it, in order of time.
    locations : DataFrame
        ``rows``, with the labels of the takes in place of their indices.
    """
    collection = as_collection(X)
    takes = list(trials if collection is None else collection)
    numbers = rows.groupby("take")["start"].rank(method="first").astype(int).to_numpy() - 1
    tables = {i: takes[i] for i in set(rows["take"]) if isinstance(takes[i], pd.DataFrame)}
    recorded = {i: Recorded(table) for i, table in tables.items()}
    trials_cut = []
    for take, start, stop, number in zip(
        rows["take"], rows["start"], rows["stop"], numbers, strict=True
    ):
        if take in tables:
            source = tables[take]
            table = source.iloc[start:stop]
            table = table.set_axis(pd.RangeIndex(len(table), name=FRAME))
            label, levels = own_label(source)
            levels = ("take",) if label is None else levels
            name = label_of_part(trials.labels[take], int(number), "part", (*levels, FRAME))
            table.attrs = recorded[take].attrs_of(np.arange(start, stop)) | name
            trials_cut.append(table)
        else:
            trials_cut.append(trials[take][start:stop].copy())
    labels = np.empty(len(rows), dtype=object)
    labels[:] = [trials.labels[take] for take in rows["take"]]
    return trials_cut, rows.assign(take=pd.Series(labels, index=rows.index).infer_objects())
