"""Events of recordings: they are cut at them into trials, or become key-frames."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Sequence
from numbers import Real

import numpy as np
import pandas as pd

from ..inputs.collections import as_collection
from ..inputs.numbers import as_numbers, check_finite
from ..inputs.recorded import (
    Recorded,
    frames_of_rows,
    names_seconds,
    refuse_moved_events,
    times_of_rows,
)
from ..inputs.tables import (
    FRAME,
    TRIAL,
    as_pandas,
    index_of,
    label_of_part,
    labels_of,
    name_trial,
)
from ..inputs.trial_facts import TrialFacts
from ..inputs.types import Table, TrialsLike, ValuesLike
from ..matching.counting import whole
from .text import warn

_HELP = (
    "attrs['events'] must be a list of dicts with label, context and frame, as read_motion returns "
    "it for C3D files"
)
# Columns of a table of events, in lower case.
_EVENTS, _CONTEXT, _FRAMES = ("event", "label"), "context", ("frame", "frames")
# Frames beyond an end that are rounding.
_MARGIN = 0.5


def cut_at_events(
    df: pd.DataFrame,
    start: str | tuple[str, str],
    stop: str | tuple[str, str] | None = None,
) -> list[pd.DataFrame]:
    """Cut a recording into trials at its events, such as gait cycles at heel strikes.

    Parameters
    ----------
    df : DataFrame (n_frames, n_features)
        A recording whose ``attrs["events"]`` are as `read_motion` returns them: a list of dicts
        with ``label``, ``context`` and ``frame``, from 0, with fractions. Every group of a C3D file
        has them at its own frame rate. Frames are looked up in the index, so that rows may have
        been selected before: ``df.iloc[10:]`` begins with frame 10, and ``df.iloc[::2]`` has every
        second frame.
    start : str or (str, str)
        Label of the events at which a trial begins, or label and context: ``"Foot Strike"``,
        ``("Foot Strike", "Left")``. Case is ignored.
    stop : str or (str, str), default=None
        Label, or label and context, of the events at which a trial ends. By default it is
        `start`, so that a trial lasts until the next event of the same kind.

    Returns
    -------
    list of DataFrame (n_frames_i, n_features)
        The trials by time, one for each `start` that is followed by a `stop`. Both are
        included, rounded to the frames that the recording has, and frames are indexed from 0. A
        trial is left out if another `start` comes before its `stop`, or if one of them lies
        outside of the recording. The list is empty if none is complete, or if
        ``attrs["events"]`` is, as of a static trial. The ``attrs`` of a trial are those of
        the recording, with these changed or added:

        events : list of dict
            The events within the trial, with ``frame`` counted from its first frame. The
            events at its two ends are left out, so that the others are key-frames.
        rows : list of int
            Its first and last frame, as events count them in the recording.
        frame_rate : float
            That of its rows, half of the recording's in ``df.iloc[::2]``.
        first_frame : int
            The number of its first frame in the trial, if the recording has ``first_frame``.
        first_time, times : float, list of float
            The time of its first frame and the times of all, in seconds, if the recording has them.
        trial, levels : hashable, tuple of str
            Its label, 0, 1, ... by time, behind ``df.attrs["trial"]`` if there is one; and the
            names of the levels of an index of labels.

    Raises
    ------
    ValueError
        If the recording has no ``attrs["events"]``, or none of `start` or `stop`; the message lists
        those that it has. If the index does not tell which frames the rows are, or not in order, or
        frames of a trial are missing.

    Warns
    -----
    UserWarning
        If ``attrs["events"]`` is empty; the message names the recording.

    See Also
    --------
    read_motion : Reads events of C3D files.
    keyframes_from_events : Makes key-frames of the other events.

    Examples
    --------
    >>> import pandas as pd
    >>> from sklearn_motionsync.io import cut_at_events
    >>> df = pd.DataFrame({"knee": range(100)})
    >>> df.attrs["events"] = [
    ...     {"label": "Foot Strike", "context": "Left", "frame": 10.2},
    ...     {"label": "Foot Off", "context": "Left", "frame": 41.0},
    ...     {"label": "Foot Strike", "context": "Left", "frame": 60.9},
    ... ]
    >>> (cycle,) = cut_at_events(df, ("Foot Strike", "Left"))
    >>> cycle["knee"].iloc[[0, -1]].tolist()
    [10, 61]
    >>> [(event["label"], event["frame"]) for event in cycle.attrs["events"]]
    [('Foot Off', 31.0)]
    """
    name = name_recording(df)
    if isinstance(events := df.attrs.get("events"), (list, tuple)) and not events:
        warn(f"{name} has no events, so no trial is cut out of it.")
        return []
    events = _read_events(df, name)
    starts = _select(events, start, "start", name)
    stops = starts if stop is None else _select(events, stop, "stop", name)
    recording = _Frames(df, name)
    cuts = []
    for begin, end in _pair(starts, stops, recording.place):
        other_events = [event for event in events if event is not begin and event is not end]
        rows = recording.rows_between(begin, end)
        if rows is not None:
            cuts.append(_cut(df, recording, rows, other_events))
    for i, cut in enumerate(cuts):
        cut.attrs |= {"trial": i, "levels": ("trial", FRAME)}
        if (label := df.attrs.get("trial")) is not None:
            cut.attrs |= label_of_part(label, i, "part", df.attrs.get("levels", ()))
    return cuts


def name_recording(df):
    """The name of a recording in messages; what is no table is refused."""
    if not isinstance(df, pd.DataFrame):
        raise ValueError(
            f"A recording must be a DataFrame, as read_motion returns it, got {type(df).__name__}; "
            "name the columns of an array with pd.DataFrame(x, columns=skeleton.column_names)."
        )
    label = df.attrs.get("trial")
    return "The recording" if label is None else f"The recording {str(label)[:60]!r}"


def _read_events(df, name):
    """The events that have a frame, by time."""
    events = df.attrs.get("events")
    if not isinstance(events, (list, tuple)):
        raise ValueError(f"{name} has no events; {_HELP}.")
    for event in events:
        has_label = isinstance(event, dict) and isinstance(event.get("label"), str)
        frame = event.get("frame") if has_label else ""
        if not isinstance(frame, Real | None) or frame in (math.inf, -math.inf):
            raise ValueError(f"{name}: {_HELP}, got {repr(event)[:100]} among them.")
    placed = [e for e in events if e.get("frame") is not None and math.isfinite(e["frame"])]
    if not placed:
        raise ValueError(
            f"{name}: its events have no frames, as its file has no frame rate. Set them: "
            "event['frame'] = (event['time'] - seconds of frame 0) * rate, for each of "
            "df.attrs['events']."
        )
    return sorted(placed, key=lambda event: event["frame"])


def _select(events, what, name, recording):
    """Events of a label, or of a label and a context."""
    words = _words_asked_for(what, name)
    selected = [event for event in events if _words_of(event)[: len(words)] == words]
    if not selected:
        kinds = Counter((event["label"], event.get("context")) for event in events)
        listed = ", ".join(
            f"{(kind[0] if kind[1] is None else kind)!r} ({n})" for kind, n in kinds.items()
        )
        listed = listed if len(listed) <= 300 else f"{listed[:300]} ..."
        raise ValueError(f"{recording} has no event {what!r} for {name}; there are {listed}.")
    return selected


def _words_asked_for(what, name):
    """A label, or a label and a context, as `_words_of` has those of events."""
    words = (what,) if isinstance(what, str) else what
    good = isinstance(words, (tuple, list)) and len(words) in (1, 2)
    if not good or not all(isinstance(word, str) for word in words):
        raise ValueError(
            f"{name} must be the label of an event, or a pair of label and context, got {what!r}."
        )
    return [word.strip().casefold() for word in words]


def _words_of(event):
    """Label and context of an event in lower case, to be compared."""
    return [str(event.get(key) or "").strip().casefold() for key in ("label", "context")]


class _Frames(Recorded):
    """Where events lie among the frames of a recording, of which rows may have been taken out."""

    def __init__(self, df, name):
        super().__init__(df)
        self._name = name
        if self.frames is None:
            raise ValueError(
                f"{name}: its index, {df.index[:3].tolist()!r:.100} ..., does not tell "
                "which frames its rows are, so that its events are not found. Cut before the index "
                "is changed; if no row was taken out, df.reset_index(drop=True) numbers them."
            )
        back = np.flatnonzero(np.diff(self.frames) <= 0)
        if len(back):
            row = int(back[0])
            raise ValueError(
                f"{name}: its rows are not in order of time: frame "
                f"{self.frames[row + 1]} follows frame {self.frames[row]}. Cut it before rows are "
                "rearranged, or sort it by df.sort_index()."
            )

    def place(self, event):
        """The frame next to an event: steps from the first row, where no row is missing."""
        start = self.frames[0] if len(self.frames) else 0
        return whole((event["frame"] - start) / self.step)

    def rows_between(self, begin, end):
        """The rows from one event to another; None if one of them is outside of the recording."""
        if not len(self.frames):
            return None
        places = np.arange(self.place(begin), self.place(end) + 1)
        frames = self.frames[0] + places * self.step
        if frames[0] < self.frames[0] or frames[-1] > self.frames[-1]:
            return None
        rows = np.searchsorted(self.frames, frames)
        missing = frames[self.frames[rows] != frames]
        if len(missing):
            raise ValueError(
                f"{self._name}: between {begin['label']!r} at frame {begin['frame']:g} and "
                f"{end['label']!r} at frame {end['frame']:g} there is no row of frame "
                f"{missing[0]}, one of {len(missing)}, and frames count as evenly spaced. Cut "
                "the recording before rows are dropped, as by dropna, or fill its gaps."
            )
        return rows


def _pair(starts, stops, place):
    """Every start with the next stop, if no other start lies between them."""
    for i, start in enumerate(starts):
        stop = next((event for event in stops if place(event) > place(start)), None)
        if stop is None:
            continue
        other_starts = (event for event in starts[i + 1 :] if event is not stop)
        # Two starts in the same row are one: the last of them counts.
        if not any(place(start) <= place(other) < place(stop) for other in other_starts):
            yield start, stop


def _cut(df, recording, rows, events):
    """Some rows, with the ``attrs`` that belong to them."""
    trial = df.iloc[rows].set_axis(pd.RangeIndex(len(rows), name=FRAME))
    first, last = recording.frames[rows[[0, -1]]].tolist()
    attrs = recording.attrs_of(rows) | {"rows": [first, last]}
    attrs["events"] = [
        event | {"frame": round((event["frame"] - first) / recording.step, 5)}
        for event in events
        if first < event["frame"] < last
    ]
    trial.attrs = attrs
    return trial


# -- key-frames ----------------------------------------------------------------------------


def keyframes_from_events(
    X: TrialsLike,
    events: Table | None = None,
    names: Sequence[str | tuple[str, str]] | None = None,
    *,
    frame_rate: float | ValuesLike | None = None,
) -> pd.DataFrame:
    """Turn the events of trials into key-frames, one row a trial and one column an event.

    The result is what synchronizers take as ``keyframes=``.

    Parameters
    ----------
    X : list of arrays (n_frames_i, n_features), 3-D array, 2-D array or DataFrame
        The trials, as the synchronizer takes them.
    events : DataFrame of pandas or polars, default=None
        One row an event, in any order: columns with the label of the trial, which are called like
        its levels, such as ``subject`` and ``trial`` (or ``trial`` if there is one level); the
        column ``event`` (or ``label``, and perhaps ``context``); and the time in ``frame`` or in
        ``seconds`` (or ``time``, ``t``, ``time (s)``). Case is ignored. If both are there,
        ``frame`` counts. A row whose time is NaN is left out. By default events are those of
        ``attrs["events"]`` of the trials, as `read_motion` and `cut_at_events` leave them.
    names : sequence of str or (str, str), default=None
        The events to take, in order of time: a label, or label and context, such as ``("Foot Off",
        "Left")``. Case is ignored. By default all.
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
    trial
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
    trials = [name_trial(i, label) for i, label in enumerate(labels)]
    in_seconds = False
    if events is None:
        listed = [_events_of(x, trial) for x, trial in zip(sequences, trials, strict=True)]
    else:
        listed, in_seconds = _events_in(events, labels, levels[:-1])
    if in_seconds or frame_rate is not None:
        rates = TrialFacts.of(sequences, frame_rate).known_rates()
    clocks = [frames_of_rows(x) for x in sequences]
    if in_seconds:
        clocks = [
            times_of_rows(x, np.arange(len(x)), rate)
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
        shares = np.nanmean(values.to_numpy() / lengths[:, np.newaxis], axis=0)
        values = values.iloc[:, np.argsort(shares, kind="stable")]
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
    return [(e["label"], e.get("context"), e["frame"]) for e in _read_events(x, trial)]


def _events_in(events, labels, levels):
    """The events of each trial in a table, and whether their times are seconds."""
    table = as_pandas(events)
    if not isinstance(table, pd.DataFrame):
        raise ValueError(
            f"events must be a DataFrame of pandas or polars, got {type(events).__name__}."
        )
    if any(name is not None for name in table.index.names):
        table = table.reset_index()
    columns = {str(name).strip().casefold(): name for name in table.columns[::-1]}
    keys = _keys(columns, levels)
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
    check_finite(times[:, np.newaxis], "events: row", [time], allow_nan=True)
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


def _keys(columns, levels):
    """The columns of a table of events with the labels of trials."""
    wanted = [[str(level).strip().casefold()] for level in levels]
    if len(levels) == 1:
        wanted[0].append(TRIAL)
    keys = [next((columns[n] for n in names if n in columns), None) for names in wanted]
    if None in keys:
        raise ValueError(
            f"events: there is no column {levels[keys.index(None)]!r}, a level of the labels of X; "
            f"there are {list(columns.values())[::-1]}. Rename those of the trial: "
            "events.rename(columns={...})."
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


class _Columns:
    """The names of the columns, as chosen or as events have them."""

    def __init__(self, names):
        self._by_words, self._chosen = {}, None
        if names is not None:
            self._chosen = {
                name: _words_asked_for(name, "each of names") for name in map(_plain_name, names)
            }

    def name(self, label, context):
        """The column of an event; None if it is not chosen."""
        words = _words_of({"label": label, "context": context})
        known = self._by_words.setdefault(tuple(words), (label, context) if words[1] else label)
        if self._chosen is None:
            return known
        return next((name for name, ask in self._chosen.items() if words[: len(ask)] == ask), None)

    def names(self, rows):
        """Those that are known in some trial: all of the chosen ones."""
        placed = dict.fromkeys(name for row in rows for name in row)
        wanted = list((placed if self._chosen is None else self._chosen) or ["any"])
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


def _plain_name(name):
    """A label alone as text; a list as a tuple, which names a column."""
    name = tuple(name) if isinstance(name, list) else name
    return name[0] if isinstance(name, tuple) and len(name) == 1 else name


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
