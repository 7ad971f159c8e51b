"""Recordings of walking: their joint positions, labels and frame rates, checked."""

import numpy as np
import pandas as pd

from ..body.skeleton import Skeleton, check_columns
from ..inputs.collections import as_collection, check_members
from ..inputs.recorded import frame_rate_of_rows, frames_of_rows, start_of_rows
from ..inputs.resampling import as_frame_rates
from ..inputs.tables import as_pandas, index_of, labels_of
from ..inputs.wording import counted, within
from .feet import Walk, joints_of_feet

__all__ = ["CONTEXTS", "FOOT_OFF", "FOOT_STRIKE", "Recordings"]

# Frames beyond an end that are rounding.
_MARGIN = 0.5
# Least and largest frames a second.
_RATES = 1.0, 10_000.0
# Metres of the units of positions.
_METRES = {"m": 1.0, "cm": 0.01, "mm": 0.001}
# Labels of events, and contexts, as C3D files have them.
FOOT_STRIKE, FOOT_OFF = "Foot Strike", "Foot Off"
CONTEXTS = {"left": "Left", "right": "Right"}


class Recordings:
    """Recordings of bodies that walk.

    Parameters
    ----------
    X, skeleton, feet, frame_rate
        As of `gait_events`.

    Attributes
    ----------
    skeleton : Skeleton
    levels : list of str
        Names of the levels of the labels of recordings.
    """

    def __init__(self, X, skeleton=None, feet=None, frame_rate=None):
        sequences = as_collection(X)
        self._given = [as_pandas(X)] if sequences is None else sequences
        self._checked = check_members(self._given, finite="allow-nan")
        first = self._given[0]
        if skeleton is None:
            if not isinstance(first, pd.DataFrame):
                raise ValueError(
                    "Arrays do not name their joints: give a skeleton, such as "
                    "Skeleton.from_frame(df) or Skeleton(joints, parents)."
                )
            skeleton = Skeleton.from_frame(first)
        self.skeleton, self._feet = skeleton, joints_of_feet(skeleton, feet)
        width, expected = self._checked[0].shape[1], skeleton.n_dims * len(skeleton.joints)
        if width != expected:
            raise ValueError(
                f"{self.called(0)} has {counted(width, 'feature')} a frame, but the skeleton's "
                f"{len(skeleton.joints)} joints need {expected}."
            )
        if isinstance(first, pd.DataFrame):
            check_columns(list(first.columns), skeleton, self.called(0))
        self._labels, levels = labels_of(self._given)
        self.levels = list(levels[:-1])
        self._rates = self._find_rates(frame_rate)
        facts = self._checked.facts or [{}] * len(self._checked)
        self._units = [known.get("units") for known in facts]

    def __len__(self):
        return len(self._checked)

    def called(self, i):
        """The name of a recording in messages."""
        return self._checked.called(i)

    def walk(self, i):
        """The `Walk` of a recording."""
        return Walk(self._checked[i], self.skeleton, self._feet, self._rates[i], self.called(i))

    def length_of_leg(self, i, walk):
        """The length of a leg, and its unit: metres, if it is known that positions are lengths."""
        unit = self._units[i]
        return (walk.leg * _METRES[unit], "m") if unit in _METRES else (walk.leg, "")

    def frames_at(self, i, rows):
        """The frames of rows of a recording, with fractions, as its index counts."""
        frames = frames_of_rows(self._given[i])
        return np.interp(rows, np.arange(len(frames)), frames)

    def row_of_frame(self, i, frame):
        """The inverse of `frames_at`; beyond the ends, frames are single steps."""
        known = frames_of_rows(self._given[i])
        row = np.interp(frame, known, np.arange(len(known)))
        return row + frame - np.clip(frame, known[0], known[-1])

    def times_at(self, i, rows):
        """Seconds at rows of a recording."""
        return start_of_rows(self._given[i]) + np.asarray(rows, dtype=np.float64) / self._rates[i]

    def row_of_time(self, i, time):
        """The inverse of `times_at`."""
        return (time - start_of_rows(self._given[i])) * self._rates[i]

    def split_events(self, events):
        """The events of a table, by recording: label, side and row; None of each without a table.

        Parameters
        ----------
        events : DataFrame or None
            As `gait_events` returns it.
        """
        if events is None:
            return [None] * len(self)
        table = as_pandas(events)
        columns = list(getattr(table, "columns", ()))
        time = next((name for name in ("frame", "time") if name in columns), None)
        missing = [name for name in ("label", "context") if name not in columns]
        missing += ["frame"] * (time is None)
        missing += [k for k in self.levels if k not in columns] if len(self) > 1 else []
        if missing:
            raise ValueError(
                f"events: there is no column {missing[0]!r}; there are {columns}. Give a table as "
                "gait_events returns it."
            )
        places = {label: i for i, label in enumerate(self._labels)}
        keys = [self._labels[0]] * len(table)
        if set(self.levels) <= set(columns):
            keys = list(table[self.levels].itertuples(index=False, name=None))
            keys = [key[0] if len(self.levels) == 1 else key for key in keys]
        found = [[] for _ in self._labels]
        sides = {context.casefold(): side for side, context in CONTEXTS.items()}
        rows = zip(keys, table["label"], table["context"], table[time], strict=True)
        for key, label, context, value in rows:
            if key not in places:
                raise ValueError(
                    f"events: recording {key!r} is not in X, whose labels are {self._labels[:6]}."
                )
            i, side = places[key], sides.get(str(context).strip().casefold())
            if side is None or label not in (FOOT_STRIKE, FOOT_OFF) or pd.isna(value):
                continue
            at = self.row_of_frame(i, value) if time == "frame" else self.row_of_time(i, value)
            if not -_MARGIN <= at <= len(self._given[i]) - 1 + _MARGIN:
                raise ValueError(
                    f"events: {label} {context} at {time} {value:.6g} is outside of "
                    f"{within(self.called(i))}. Leave its row out, or give the events of these "
                    "recordings."
                )
            found[i].append((label, side, float(at)))
        return [sorted(own, key=lambda event: event[2]) for own in found]

    def stack(self, tables):
        """Tables of recordings below each other, with the labels of recordings in columns."""
        keys = index_of(self._labels, self.levels).repeat([len(table) for table in tables])
        labels = keys.to_frame(index=False)
        return pd.concat([labels, pd.concat(tables, ignore_index=True)], axis=1)

    def _find_rates(self, frame_rate):
        if frame_rate is not None:
            rates = as_frame_rates(frame_rate, len(self))
            rates = np.broadcast_to(rates, (len(self), 1))[:, 0].tolist()
        else:
            rates = [frame_rate_of_rows(x) for x in self._given]
        if None in rates:
            i = rates.index(None)
            raise ValueError(
                f"The frame rate of {within(self.called(i))} is not known: give frame_rate=, or "
                "tables whose attrs or index tell it."
            )
        slowest, fastest = _RATES
        for i, rate in enumerate(rates):
            if not slowest <= rate <= fastest:
                raise ValueError(
                    f"{self.called(i)} has a frame rate of {rate:g}; recordings of people have "
                    f"{slowest:g} to {fastest:g} frames a second. Give frame_rate= in frames a "
                    "second, not the time between frames."
                )
        return rates
