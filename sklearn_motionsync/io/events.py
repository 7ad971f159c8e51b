"""Performances of a recording, from one of its events to another."""

import math
from numbers import Real

import pandas as pd

from ..inputs.tables import FRAME, label_of_part

_HELP = (
    "attrs['events'] must be a list of dicts with label, context and frame, as read_motion gives "
    "for C3D files"
)


def cut_at_events(df, start, stop=None, *, performance=None):
    """Cut a recording into performances at its events, such as gait cycles at heel strikes.

    Parameters
    ----------
    df : DataFrame (n_frames, n_features)
        A recording whose ``attrs["events"]`` are as `read_motion` gives them: a list of dicts with
        ``label``, ``context`` and ``frame``, its place in the rows, from 0, with fractions. Any
        group of a C3D file has them at its own rate.
    start : str or (str, str)
        Label of the events at which a performance begins, or label and context: ``"Foot Strike"``,
        ``("Foot Strike", "Left")``. Capitals do not matter.
    stop : str or (str, str), default=None
        The same of the events at which it ends; by default the next event like `start`.
    performance : hashable, default=None
        What the recording is called; by default ``df.attrs["performance"]``, if it has that.

    Returns
    -------
    list of DataFrame (n_frames_i, n_features)
        By time, one for each `start` that is followed by a `stop`, both included, rounded to whole
        frames, and indexed from 0. A performance is left out where another `start` comes before
        its `stop`, or where one of them lies outside of the recording. The list is empty
        if none is complete. Their ``attrs`` are those of the recording, but for

        events : list of dict
            Those within the performance, ``frame`` counted from its first one. The events that
            bound it are left out, so that the others are key-frames for `KeyframeSynchronizer`.
        rows : list of int
            First and last row in the recording.
        first_frame : int
            The number of its first frame in the trial, if the recording has that.
        performance, levels : hashable, tuple of str
            What it is called: 0, 1, ... by time, behind the name of the recording if that has
            one; and the names of the levels of an index of them.

    Raises
    ------
    ValueError
        If the recording has no events, or none like `start` or `stop`; the message tells which
        there are.

    See Also
    --------
    read_motion : Reads events of C3D files.
    sklearn_motionsync.KeyframeSynchronizer : Lets the other events coincide.

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
    if not isinstance(df, pd.DataFrame):
        raise ValueError(
            f"A recording must be a DataFrame, as read_motion gives, got {type(df).__name__}."
        )
    events = _check_events(df)
    starts = _find(events, start, "start")
    stops = starts if stop is None else _find(events, stop, "stop")
    parts = []
    for first, last, own in _bounds(starts, stops):
        if first >= 0 and last < len(df):
            parts.append(_cut(df, first, last, [e for e in events if not any(e is o for o in own)]))
    return _name(parts, df.attrs, performance)


def _check_events(df):
    """The events that have a place, by time."""
    events = df.attrs.get("events")
    if not isinstance(events, (list, tuple)) or not events:
        raise ValueError(f"This recording has no events; {_HELP}.")
    for event in events:
        known = isinstance(event, dict) and isinstance(event.get("label"), str)
        frame = event.get("frame") if known else None
        if not known or not (frame is None or isinstance(frame, Real)):
            raise ValueError(f"{_HELP}, got {event!r} among them.")
    placed = [event for event in events if event.get("frame") is not None]
    if not placed:
        raise ValueError(
            "The events of this recording have no frames, as its file has no frame rate. Set them: "
            "event['frame'] = event['time'] * rate, for each of df.attrs['events']."
        )
    return sorted(
        (event for event in placed if math.isfinite(event["frame"])), key=lambda e: e["frame"]
    )


def _find(events, what, name):
    """Events of a label, or of a label and a context."""
    wanted = (what,) if isinstance(what, str) else what
    good = isinstance(wanted, (tuple, list)) and len(wanted) in (1, 2)
    if not good or not all(isinstance(word, str) for word in wanted):
        raise ValueError(
            f"{name} must be the label of an event, or a pair of label and context, got {what!r}."
        )
    wanted = [word.strip().casefold() for word in wanted]
    found = [event for event in events if _words(event)[: len(wanted)] == wanted]
    if not found:
        there = {}
        for event in events:
            key = event["label"], event.get("context")
            there[key] = there.get(key, 0) + 1
        listed = ", ".join(
            f"{label!r} ({n})" if context is None else f"{(label, context)!r} ({n})"
            for (label, context), n in there.items()
        )
        raise ValueError(f"There is no event {what!r} for {name}; there are {listed}.")
    return found


def _words(event):
    return [str(event.get(key) or "").strip().casefold() for key in ("label", "context")]


def _row(event):
    return math.floor(event["frame"] + 0.5)


def _bounds(starts, stops):
    """First and last row of every start that a stop follows before the next start, and both."""
    for i, start in enumerate(starts):
        first = _row(start)
        stop = next((event for event in stops if _row(event) > first), None)
        if stop is None:
            continue
        others = (event for event in starts[i + 1 :] if event is not stop)
        # A start marked twice in the same row is one.
        if not any(first <= _row(other) < _row(stop) for other in others):
            yield first, _row(stop), (start, stop)


def _cut(df, first, last, events):
    """The rows first to last, which know their events."""
    part = df.iloc[first : last + 1].set_axis(pd.RangeIndex(last - first + 1, name="frame"))
    part.attrs = df.attrs | {"rows": [first, last]} | _first(df.attrs, first, last)
    part.attrs["events"] = [
        event | {"frame": round(event["frame"] - first, 5)}
        for event in events
        if first < event["frame"] < last
    ]
    return part


def _first(attrs, first, last):
    """What else counts from the first row."""
    changed = {}
    rate, times = attrs.get("frame_rate"), attrs.get("times")
    if isinstance(number := attrs.get("first_frame"), int):
        changed["first_frame"] = number + math.floor(first / _samples(attrs))
    if times is not None:
        changed |= {"times": times[first : last + 1], "first_time": times[first]}
    elif rate and "first_time" in attrs:
        changed["first_time"] = attrs["first_time"] + first / rate
    return changed


def _samples(attrs):
    """Rows in a frame of the trial: analog channels have several."""
    groups = attrs.get("groups", {})
    rates = [groups.get(group, {}).get("frame_rate") for group in ("analog", "markers")]
    if attrs.get("kind") != "analog" or not all(rates):
        return 1
    return rates[0] / rates[1]


def _name(parts, attrs, performance):
    """The parts, with their labels."""
    whole = attrs.get("performance") if performance is None else performance
    for i, part in enumerate(parts):
        part.attrs["performance"], part.attrs["levels"] = i, ("performance", FRAME)
        if whole is not None:
            part.attrs |= label_of_part(whole, i, "part", attrs.get("levels", ()))
    return parts
