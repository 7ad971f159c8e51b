"""Cut recordings into performances, from one event to another."""

import math
import warnings
from collections import Counter
from collections.abc import Hashable
from numbers import Real

import numpy as np
import pandas as pd

from ..inputs.recorded import Recorded
from ..inputs.tables import FRAME, label_of_part
from ..matching.counting import whole

_HELP = (
    "attrs['events'] must be a list of dicts with label, context and frame, as read_motion returns "
    "it for C3D files"
)


def cut_at_events(
    df: pd.DataFrame,
    start: str | tuple[str, str],
    stop: str | tuple[str, str] | None = None,
    *,
    performance: Hashable = None,
) -> list[pd.DataFrame]:
    """Cut a recording into performances at its events, such as gait cycles at heel strikes.

    Parameters
    ----------
    df : DataFrame (n_frames, n_features)
        A recording whose ``attrs["events"]`` are as `read_motion` returns them: a list of dicts
        with ``label``, ``context`` and ``frame``, from 0, with fractions. Every group of a C3D file
        has them at its own frame rate. Frames are looked up in the index, so that rows may have
        been selected before: ``df.iloc[10:]`` begins with frame 10, and ``df.iloc[::2]`` has every
        second frame.
    start : str or (str, str)
        Label of the events at which a performance begins, or label and context: ``"Foot Strike"``,
        ``("Foot Strike", "Left")``. Case is ignored.
    stop : str or (str, str), default=None
        Label, or label and context, of the events at which a performance ends. By default it is
        `start`, so that a performance lasts until the next event of the same kind.
    performance : hashable, default=None
        Label of the recording; by default ``df.attrs["performance"]``, if there is one.

    Returns
    -------
    list of DataFrame (n_frames_i, n_features)
        The performances by time, one for each `start` that is followed by a `stop`. Both are
        included, rounded to the frames that the recording has, and frames are indexed from 0. A
        performance is left out if another `start` comes before its `stop`, or if one of them lies
        outside of the recording. The list is empty if none is complete, or if
        ``attrs["events"]`` is, as of a static trial. The ``attrs`` of a performance are those of
        the recording, with these changed or added:

        events : list of dict
            The events within the performance, with ``frame`` counted from its first frame. The
            events at its two ends are left out, so that the others are key-frames.
        rows : list of int
            Its first and last frame, as events count them in the recording.
        frame_rate : float
            That of its rows, half of the recording's in ``df.iloc[::2]``.
        first_frame : int
            The number of its first frame in the trial, if the recording has ``first_frame``.
        first_time, times : float, list of float
            The time of its first frame and the times of all, in seconds, if the recording has them.
        performance, levels : hashable, tuple of str
            Its label, 0, 1, ... by time, behind the label of the recording if it has one; and the
            names of the levels of an index of labels.

    Raises
    ------
    ValueError
        If the recording has no ``attrs["events"]``, or none of `start` or `stop`; the message lists
        those that it has. If the index does not tell which frames the rows are, or not in order, or
        frames of a performance are missing.

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
    if not isinstance(df, pd.DataFrame):
        raise ValueError(
            f"A recording must be a DataFrame, as read_motion returns it, got {type(df).__name__}."
        )
    name = name_recording(df)
    if isinstance(events := df.attrs.get("events"), (list, tuple)) and not events:
        warnings.warn(
            f"{name} has no events, so no performance is cut out of it.", UserWarning, stacklevel=2
        )
        return []
    events = read_events(df, name)
    starts = _select(events, start, "start", name)
    stops = starts if stop is None else _select(events, stop, "stop", name)
    recording = _Frames(df, name)
    cuts = []
    for begin, end in _pair(starts, stops, recording.place):
        other_events = [event for event in events if event is not begin and event is not end]
        rows = recording.rows_between(begin, end)
        if rows is not None:
            cuts.append(_cut(df, recording, rows, other_events))
    label = df.attrs.get("performance") if performance is None else performance
    for i, cut in enumerate(cuts):
        cut.attrs |= {"performance": i, "levels": ("performance", FRAME)}
        if label is not None:
            cut.attrs |= label_of_part(label, i, "part", df.attrs.get("levels", ()))
    return cuts


def name_recording(df):
    """The name of a recording in messages."""
    label = df.attrs.get("performance")
    return "The recording" if label is None else f"The recording {str(label)[:60]!r}"


def read_events(df, name):
    """The events that have a frame, by time."""
    events = df.attrs.get("events")
    if not isinstance(events, (list, tuple)):
        raise ValueError(f"{name} has no events; {_HELP}.")
    for event in events:
        has_label = isinstance(event, dict) and isinstance(event.get("label"), str)
        if not has_label or not isinstance(event.get("frame"), Real | None):
            raise ValueError(f"{name}: {_HELP}, got {repr(event)[:100]} among them.")
    placed = [e for e in events if e.get("frame") is not None and math.isfinite(e["frame"])]
    if not placed:
        raise ValueError(
            f"{name}: its events have no frames, as its file has no frame rate. Set them: "
            "event['frame'] = event['time'] * rate, for each of df.attrs['events']."
        )
    return sorted(placed, key=lambda event: event["frame"])


def _select(events, what, name, recording):
    """Events of a label, or of a label and a context."""
    wanted = (what,) if isinstance(what, str) else what
    good = isinstance(wanted, (tuple, list)) and len(wanted) in (1, 2)
    if not good or not all(isinstance(word, str) for word in wanted):
        raise ValueError(
            f"{name} must be the label of an event, or a pair of label and context, got {what!r}."
        )
    wanted = [word.strip().casefold() for word in wanted]
    selected = [event for event in events if words_of(event)[: len(wanted)] == wanted]
    if not selected:
        kinds = Counter((event["label"], event.get("context")) for event in events)
        listed = ", ".join(
            f"{(kind[0] if kind[1] is None else kind)!r} ({n})" for kind, n in kinds.items()
        )
        listed = listed if len(listed) <= 300 else f"{listed[:300]} ..."
        raise ValueError(f"{recording} has no event {what!r} for {name}; there are {listed}.")
    return selected


def words_of(event):
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
    performance = df.iloc[rows].set_axis(pd.RangeIndex(len(rows), name=FRAME))
    first, last = recording.frames[rows[[0, -1]]].tolist()
    attrs = recording.attrs_of(rows) | {"rows": [first, last]}
    attrs["events"] = [
        event | {"frame": round((event["frame"] - first) / recording.step, 5)}
        for event in events
        if first < event["frame"] < last
    ]
    if isinstance(number := df.attrs.get("first_frame"), int):
        attrs["first_frame"] = number + whole(first / _rows_per_frame(attrs), "down")
    performance.attrs = attrs
    return performance


def _rows_per_frame(attrs):
    """Analog channels have several rows in a frame of the trial."""
    groups = attrs.get("groups", {})
    rates = [groups.get(group, {}).get("frame_rate") for group in ("analog", "markers")]
    if attrs.get("kind") != "analog" or not all(rates):
        return 1
    return rates[0] / rates[1]
