"""TRC: markers in columns of text, as OpenSim, Pose2Sim, Cortex and Vicon write them."""

import math
import re

import numpy as np

from .kinematics import check_positions
from .text import (
    MotionText,
    check_n_rows,
    check_time,
    count_decimals,
    decode,
    fields_of,
    read_numbers,
    show,
    unique,
)

# Where Cortex did not see a marker.
_NOWHERE = 9999999.0
_AXIS = re.compile(rb"[XYZxyz]\d*")


def read_trc(path):
    """Names, positions and facts of a TRC file; markers that were not seen are NaN."""
    text = MotionText(path)
    first = fields_of(text.row())
    if not first or not first[0].lower().startswith(b"pathfiletype"):
        raise text.error(f"expected 'PathFileType', with which TRC files begin, got {show(first)}.")
    facts = _read_facts(text)
    where = text.line_number
    names, row = _read_names(text, facts)
    frames, decimals = _read_frames(text, row, len(names))
    check_n_rows(text, "NumFrames", where, facts["numframes"], len(frames))
    check_positions(path, text.size, len(frames), len(names))
    # Blank columns at the end of a row take no bytes of the file.
    values = np.full((len(frames), 2 + 3 * len(names)), np.nan)
    for i, frame in enumerate(frames):
        values[i, : len(frame)] = frame
    return {
        "joints": unique(names),
        "parents": [-1] * len(names),
        "positions": _only_seen(values[:, 2:].reshape(len(frames), -1, 3)),
        "times": values[:, 1].copy(),
        "decimals": decimals,
        "frame_rate": facts["datarate"],
        "units": facts["units"],
        "up": None,
        "kind": "markers",
        "first_frame": _first_frame(values[0, 0]),
    }


def _read_facts(text):
    """What the line of values says, by the names in the line above it, in small letters."""
    keys = [key.lower() for key in text.line()]
    if b"numframes" not in keys and b"datarate" not in keys:
        raise text.error(
            f"expected 'DataRate CameraRate NumFrames NumMarkers Units ...', got {show(keys)}."
        )
    row = text.row()
    words = row.split()
    # A unit may be left out between its tabs.
    values = dict(zip(keys, words if len(words) == len(keys) else fields_of(row), strict=False))
    rate = _number(values.get(b"datarate", b""))
    return {
        "datarate": rate if 0 < rate < math.inf else None,
        "units": decode(values.get(b"units", b"")) or None,
        "numframes": _count(text, values, b"numframes", "NumFrames"),
        "nummarkers": _count(text, values, b"nummarkers", "NumMarkers"),
    }


def _number(word):
    try:
        return float(word)
    except ValueError:
        return math.nan


def _count(text, values, key, name):
    if key not in values:
        return None
    number = _number(values[key])
    if not 0 < number < 2**53 or number != int(number):
        raise text.error(f"{name} needs a whole number above 0, got {show([values[key]])}.")
    return int(number)


def _read_names(text, facts):
    """Names of the markers, and the first row of numbers."""
    labels = fields_of(text.row())
    if len(labels) < 2 or b"frame" not in labels[0].lower() or b"time" not in labels[1].lower():
        raise text.error(
            f"expected 'Frame# Time' and the names of the markers, got {show(labels)}."
        )
    names = [label for label in labels[2:] if label]
    at, row = text.line_number, text.row()
    axes = [field for field in fields_of(row) if field]
    n = len(names) if facts["nummarkers"] is None else facts["nummarkers"]
    if axes and _AXIS.fullmatch(axes[0]):
        n, row = _count_axes(text, axes), text.row()
    if len(names) != n:
        names = _names_by_place(labels, n)
    if not names:
        raise text.error(
            f"line {at} names {sum(map(bool, labels[2:]))} markers, but there are columns for {n}; "
            "each has its name in the first of its three columns, with tabs between them."
        )
    return [decode(name) for name in names], row


def _count_axes(text, axes):
    """Markers in a row of X1 Y1 Z1 X2 Y2 Z2 ..., however they are counted."""
    letters = b"".join(axis[:1] for axis in axes).lower()
    if letters != b"xyz" * (len(axes) // 3):
        raise text.error(f"expected X1 Y1 Z1 X2 Y2 Z2 ..., got {show(axes)}.")
    return len(axes) // 3


def _names_by_place(labels, n):
    """Names in the first of three columns each, some of which are not there; [] if they are not."""
    places = labels[2 : 2 + 3 * n : 3]
    if len(places) != n or sum(map(bool, labels[2:])) != sum(map(bool, places)):
        return []
    return [name or b"marker_%d" % (j + 1) for j, name in enumerate(places)]


def _read_frames(text, row, n_markers):
    """Numbers of every frame, and how many decimals its time has; markers at its end may lack."""
    frames, decimals, time = [], 0, -math.inf
    n = 2 + 3 * n_markers
    while row:
        fields = fields_of(row)
        tabbed = b"\t" in row
        while len(fields) > n and not fields[-1]:
            fields.pop()
        short = tabbed and text.is_whole and len(fields) % 3 == 2
        if len(fields) != n and not (short and len(fields) < n):
            raise text.error(
                f"a frame needs its number, its time and 3 numbers for each of {n_markers} "
                f"markers, {n} in all, got {len(fields)} ({show(fields)}). A marker that was not "
                "seen is left blank between its tabs."
            )
        numbers = read_numbers(text, fields, "a frame")
        time = check_time(text, numbers[1], time)
        decimals = max(decimals, count_decimals(fields[1]))
        frames.append(numbers)
        row = text.row()
    return frames, decimals


def _only_seen(positions):
    """NaN where a marker has no place, or the one that writers give to markers not seen."""
    blank = (positions == 0).all(axis=2)
    nothing = np.isnan(positions).any(axis=2) | (positions == _NOWHERE).all(axis=2)
    if not (blank | nothing).all():
        nothing |= blank
    positions[nothing] = np.nan
    return positions


def _first_frame(number):
    return int(number) if math.isfinite(number) else None
