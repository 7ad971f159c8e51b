"""Events of trials, in a table or in ``attrs``, become key-frames."""

from __future__ import annotations

from collections.abc import Sequence
from graphlib import CycleError, TopologicalSorter
from itertools import pairwise
from numbers import Real

import numpy as np
import pandas as pd

from ..inputs.collections import as_collection
from ..inputs.numbers import as_numbers
from ..inputs.recorded import (
    frame_rate_of_rows,
    frames_of_rows,
    names_seconds,
    refuse_moved_events,
    start_of_rows,
)
from ..inputs.resampling import as_frame_rates
from ..inputs.tables import PERFORMANCE, as_pandas, index_of, labels_of, name_performance
from ..inputs.types import PerformancesLike, Table, ValuesLike
from ..inputs.wording import counted, within
from .events import read_events, words_of

__all__ = ["is_table_of_events", "keyframes_from_events"]

# Columns of a table of events, in lower case.
_EVENTS, _CONTEXT, _FRAMES = ("event", "label"), "context", ("frame", "frames")
# Names of the column of trials, if one column names them.
_TRIALS = [PERFORMANCE, "trial"]
# Frames beyond an end that are rounding.
_MARGIN = 0.5


def keyframes_from_events(
    X: PerformancesLike,
    events: Table | None = None,
    names: Sequence[str | tuple[str, str]] | None = None,
    *,
    by: str | Sequence[str] | None = None,
    frame_rate: float | ValuesLike | None = None,
) -> pd.DataFrame:
    """Turn the events of trials into key-frames, one row a trial and one column an event.

    The result is what synchronizers take as ``keyframes=``.

    Parameters
    ----------
    X : list of arrays (n_frames_i, n_features), 3-D array, 2-D array or DataFrame
        The trials, as the synchronizer takes them.
    events : DataFrame of pandas or polars, default=None
        One row an event, in any order: columns with the label of the trial, such as ``subject`` and
        ``trial``, the column ``event`` (or ``label``, and perhaps ``context``), and the time in
        ``frame`` or in ``seconds`` (or ``time``, ``t``, ``time (s)``). Case is ignored. If both are
        there, ``frame`` counts. A row whose time is NaN is left out. By default events are those of
        ``attrs["events"]`` of the trials, as `read_motion` and `cut_at_events` leave them.
    names : sequence of str or (str, str), default=None
        The events to take, in order of time: a label, or label and context, such as ``("Foot Off",
        "Left")``. Case is ignored. By default all.
    by : str or list of str, default=None
        The columns of ``events`` with the label of the trial, in the order of its levels. By
        default those with the names of the levels, or ``trial`` if there is one level.
    frame_rate : float, or array-like of shape (n_sequences,), default=None
        Frames per second of X, for seconds; by default what tables tell.

    Returns
    -------
    DataFrame (n_sequences, n_events)
        Frames of the rows of each trial, from 0, with fractions; NaN where a trial lacks an event.
        The index holds the labels of the trials, in the order of X. Columns are in order of time.
        Events with a context are pairs. Events at the first or last frame of a trial are left out,
        since both ends are aligned anyway.

    Raises
    ------
    ValueError
        If the table lacks a column, or names a trial that X does not have. If an event comes twice
        in a trial, lies outside of it, or two of them are at one frame. If trials have events in
        different orders; if ``names`` are not found; if no trial has an event; or if seconds are
        given and the frame rate is not known.

    See Also
    --------
    cut_at_events : Cuts recordings into trials at events.
    sklearn_motionsync.DenseSynchronizer : Takes key-frames, of some trials or of all.

    Notes
    -----
    Frames and seconds count as the index of a trial does, if it has frames or even times; else from
    its first row. With ``attrs["first_time"]`` seconds count from there.

    Labels of trials are compared as text, so that 3 and "3" are one.

    Examples
    --------
    >>> import numpy as np
    >>> import pandas as pd
    >>> from sklearn_motionsync.io import keyframes_from_events
    >>> trials = [np.zeros((n, 2)) for n in (101, 121, 91)]
    >>> events = pd.DataFrame({
    ...     "trial": [0, 0, 1],
    ...     "event": ["toe-off", "knee flexed", "toe-off"],
    ...     "seconds": [0.62, 0.73, 0.75],
    ... })
    >>> keyframes_from_events(trials, events, frame_rate=100)
                 toe-off  knee flexed
    performance
    0               62.0         73.0
    1               75.0          NaN
    2                NaN          NaN

    The same of events in ``attrs``, as of C3D files:

    >>> trial = pd.DataFrame(trials[0])
    >>> trial.attrs["events"] = [{"label": "Foot Off", "context": "Left", "frame": 62.0}]
    >>> keyframes_from_events([trial]).columns.tolist()
    [('Foot Off', 'Left')]
    """
    sequences = as_collection(X)
    if sequences is None:
        # Univariate trials in the rows of a matrix.
        sequences = list(np.asarray(X))
    refuse_moved_events(sequences)
    labels, levels = labels_of(sequences)
    trials = [name_performance(i, label) for i, label in enumerate(labels)]
    if events is None:
        listed = [_events_of(x, trial) for x, trial in zip(sequences, trials, strict=True)]
        clocks = [frames_of_rows(x) for x in sequences]
    else:
        listed, in_seconds = _events_in(events, labels, levels[:-1], by)
        clocks = [frames_of_rows(x) for x in sequences]
        if in_seconds:
            rates = _rates_of(sequences, trials, frame_rate)
            clocks = [
                start_of_rows(x) + np.arange(len(x)) / rate
                for x, rate in zip(sequences, rates, strict=True)
            ]
    columns = _Columns(names)
    rows = [
        _place(trial, trial_events, clock, columns)
        for trial, trial_events, clock in zip(trials, listed, clocks, strict=True)
    ]
    values = pd.DataFrame(rows, columns=pd.Index(columns.names(rows), tupleize_cols=False))
    lengths = np.array([len(x) for x in sequences])
    if names is None:
        values = values[_order(values.to_numpy() / lengths[:, np.newaxis], values.columns, trials)]
    _check_order(values, trials)
    return values.set_axis(index_of(labels, levels[:-1]))


def is_table_of_events(given):
    """Whether something is a table with one row an event."""
    columns = getattr(as_pandas(given), "columns", ())
    return any(str(name).strip().casefold() in _EVENTS for name in columns)


# -- events of each trial, as triples of label, context and time --------------------------


def _events_of(x, trial):
    """The events in ``attrs`` of a trial."""
    events = x.attrs.get("events") if isinstance(x, pd.DataFrame) else None
    if not events:
        return []
    return [(e["label"], e.get("context"), e["frame"]) for e in read_events(x, trial)]


def _events_in(events, labels, levels, by):
    """The events of each trial in a table, and whether their times are seconds."""
    table = as_pandas(events)
    if not isinstance(table, pd.DataFrame):
        raise ValueError(
            f"events must be a DataFrame of pandas or polars, got {type(events).__name__}."
        )
    if any(name is not None for name in table.index.names):
        table = table.reset_index()
    columns = {str(name).strip().casefold(): name for name in table.columns[::-1]}
    keys = _keys(columns, levels, by)
    label = next((columns[name] for name in _EVENTS if name in columns), None)
    frame = next((columns[name] for name in _FRAMES if name in columns), None)
    second = next((columns[name] for name in columns if names_seconds(name)), None)
    time = second if frame is None else frame
    missing = ["event"] * (label is None) + ["frame or seconds"] * (time is None)
    if missing:
        raise ValueError(
            f"events: there is no column {missing[0]}; there are {list(table.columns)}. A row is "
            "an event; a table with a column for every event becomes one by events.melt(["
            f"{', '.join(map(repr, keys))}], var_name='event', value_name='frame')."
        )
    times = as_numbers(table[time], f"events: column {time!r}", dtype=np.float64)
    contexts = table[columns[_CONTEXT]] if _CONTEXT in columns else [None] * len(table)
    places = {_as_text(name): i for i, name in enumerate(labels)}
    listed = [[] for _ in labels]
    rows = zip(table[keys].itertuples(index=False), table[label], contexts, times, strict=True)
    for key, event, context, at in rows:
        trial = key[0] if len(keys) == 1 else tuple(key)
        place = places.get(_as_text(trial))
        if place is None:
            raise ValueError(
                f"events: trial {trial!r} of event {event!r} is not in X, whose trials are "
                f"labelled {labels[:6]}{' ...' * (len(labels) > 6)}. Leave its rows out, or rename "
                "it."
            )
        if np.isfinite(at):
            listed[place].append((event, None if pd.isna(context) else context, at))
    return listed, frame is None


def _keys(columns, levels, by):
    """The columns of a table of events with the labels of trials."""
    if by is not None:
        by = [by] if isinstance(by, str) else list(by)
        missing = [name for name in by if name not in columns.values()]
        if missing or len(by) != len(levels):
            raise ValueError(
                f"by={by!r} must name {counted(len(levels), 'column')} of events, for the levels "
                f"{list(levels)} of the labels of X; columns are {list(columns.values())[::-1]}."
            )
        return by
    wanted = [[str(level).strip().casefold()] for level in levels]
    if len(levels) == 1:
        wanted[0] += _TRIALS
    keys = [next((columns[n] for n in names if n in columns), None) for names in wanted]
    if None in keys:
        raise ValueError(
            f"events: there is no column {levels[keys.index(None)]!r}, a level of the labels of X; "
            f"there are {list(columns.values())[::-1]}. Name those of the trial: by=[...]."
        )
    return keys


def _as_text(label):
    """A label as text: 3, 3.0 and "3" are one."""
    if isinstance(label, tuple):
        return tuple(map(_as_text, label))
    if isinstance(label, Real) and label == label // 1:
        label = int(label)
    return str(label).strip()


# -- where they are in their trial ----------------------------------------------------------


def _rates_of(sequences, trials, frame_rate):
    """Frames per second of each trial."""
    if frame_rate is not None:
        rates = as_frame_rates(frame_rate, len(sequences))
        return np.broadcast_to(rates, (len(sequences), 1))[:, 0]
    rates = [frame_rate_of_rows(x) for x in sequences]
    if None in rates:
        raise ValueError(
            f"events are in seconds, and the frame rate of {within(trials[rates.index(None)])} is "
            "not known. Give frame_rate=, or an events table with frames."
        )
    return rates


class _Columns:
    """The names of the columns, as chosen or as events have them."""

    def __init__(self, names):
        self._by_words, self._chosen = {}, names
        if names is not None:
            self._chosen = [name if isinstance(name, tuple) else (name,) for name in names]
            for name in self._chosen:
                if len(name) > 2 or not all(isinstance(word, str) for word in name):
                    raise ValueError(
                        f"names must be labels of events, or pairs of label and context; got "
                        f"{name!r} among them."
                    )

    def name(self, label, context):
        """The column of an event; None if it is not chosen."""
        words = tuple(words_of({"label": label, "context": context}))
        if words not in self._by_words:
            self._by_words[words] = (label, context) if words[1] else label
        if self._chosen is None:
            return self._by_words[words]
        for name in self._chosen:
            wanted = tuple(word.strip().casefold() for word in name)
            if words[: len(wanted)] == wanted:
                return name if len(name) > 1 else name[0]
        return None

    def names(self, rows):
        """Those that are known in some trial: all of the chosen ones."""
        placed = dict.fromkeys(name for row in rows for name in row)
        if self._chosen is None:
            wanted = list(placed) or ["any"]
        else:
            wanted = [name if len(name) > 1 else name[0] for name in self._chosen]
        missing = [name for name in wanted if name not in placed]
        if missing:
            there = list(self._by_words.values())
            raise ValueError(
                f"No trial has the event {missing[0]!r} inside, after its first frame and before "
                f"its last; there are {there[:8]}."
                if there
                else "No trial has an event: give a table, or trials with attrs['events']."
            )
        return wanted


def _place(trial, events, clock, columns):
    """The row of each event of a trial, by column."""
    placed, last = {}, len(clock) - 1
    margin = _MARGIN * (clock[-1] - clock[0]) / max(last, 1)
    for label, context, at in events:
        name = columns.name(label, context)
        if name is None:
            continue
        if not clock[0] - margin <= at <= clock[-1] + margin:
            raise ValueError(
                f"{trial}: event {name!r} at {at:.6g} is outside of it, from {clock[0]:.6g} to "
                f"{clock[-1]:.6g}."
            )
        row = float(np.interp(at, clock, np.arange(last + 1)))
        if not 0 < row < last:
            continue
        if name in placed:
            raise ValueError(
                f"{trial}: event {name!r} comes twice, in rows {placed[name]:.6g} and {row:.6g}. "
                "Cut the recording into trials by cut_at_events, or choose others by names=[...]."
            )
        placed[name] = row
    return placed


# -- their order -----------------------------------------------------------------------------


def _order(shares, names, trials):
    """Columns in an order that all trials have; where they leave it open, by mean time."""
    before = {}
    for trial, row in zip(trials, shares, strict=True):
        columns = np.flatnonzero(np.isfinite(row))
        in_time = columns[np.argsort(row[columns], kind="stable")].tolist()
        for pair in pairwise(in_time):
            if row[pair[0]] < row[pair[1]]:
                before.setdefault(pair, trial)
    sorter = TopologicalSorter({k: [] for k in range(len(names))})
    for first, second in before:
        sorter.add(second, first)
    try:
        sorter.prepare()
    except CycleError as error:
        # Each of the cycle comes before the next.
        cycle = error.args[1]
        (a, b), (c, d) = list(pairwise(cycle))[:2]
        raise ValueError(
            f"Trials have events in different orders: {names[a]!r} is before {names[b]!r} in "
            f"{within(before[a, b])}, and {names[c]!r} before {names[d]!r} in "
            f"{within(before[c, d])}. Key-frames have one order: leave an event out by "
            "names=[...], or correct these trials."
        ) from None
    means, ready, order = np.nanmean(shares, axis=0), [], []
    while sorter.is_active():
        ready += sorter.get_ready()
        ready.sort(key=lambda k: means[k])
        order.append(ready.pop(0))
        sorter.done(order[-1])
    return [names[k] for k in order]


def _check_order(values, trials):
    """Refuse a trial whose events do not follow each other."""
    for trial, row in zip(trials, values.to_numpy(), strict=True):
        columns = np.flatnonzero(np.isfinite(row))
        wrong = np.flatnonzero(np.diff(row[columns]) <= 0)
        if len(wrong):
            a, b = columns[wrong[0]], columns[wrong[0] + 1]
            raise ValueError(
                f"{trial}: event {values.columns[b]!r} in row {row[b]:.6g} is not after "
                f"{values.columns[a]!r} in row {row[a]:.6g}. Key-frames have one order, and one "
                "each at a time: leave one out, or change the order, by names=[...]."
            )
